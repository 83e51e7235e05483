/* Signals that are narrow compared with steps: adaptive methods see them, steps of fixed size that miss them are
 * counted, and signals that steps resolve change nothing. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "model.h"
#include "runs.h"
#include "signal.h"

const check_fixture fixture = { cli_setup, cli_teardown };

#define END 3.0 /* [s] */
#define PI PW_PI

static double random_between (double lo, double hi) {
  return lo + (hi - lo) * ((double)rand () / RAND_MAX);
}

/* A body of 1 kg that a force pushes along x: signal in the format of a text model, initial speed. */
static gallery_scene pushed (const char *signal, double speed) {
  char text[4000];
  int n = snprintf (text, sizeof text,
                    "pinwheel: 1\nbodies: [{name: b, mass: 1, inertia: 1, rate: {vx: %.17g}}]\n"
                    "elements:\n  - {force: F, body: b, fx: %s}\n",
                    speed, signal);
  assert_true (n < (int)sizeof text);
  cli_write ("m.yaml", text);
  return gallery_load (cli_path ("m.yaml"), NULL);
}

static const pw_signal *pushing (const gallery_scene *x) {
  return pw_field_at (x->model->element[0].kind, x->model->element[0].definition, PW_SIGNAL, 0);
}

/* ---- Signals of time that are narrow around t = c, with the width w, and their integrals from 0 to END ---- */

typedef struct {
  double A, c, w;
} bump;

static void gauss (const bump *b, char *text, size_t size) {
  snprintf (text, size, "\"%.17g*exp (-((t - %.17g)/%.17g)^2)\"", b->A, b->c, b->w);
}
static double gauss_integral (const bump *b) {
  return b->A * b->w * sqrt (PI) * (erf ((END - b->c) / b->w) + erf (b->c / b->w)) / 2;
}

static void peak (const bump *b, char *text, size_t size) {
  snprintf (text, size, "\"%.17g/(1 + ((t - %.17g)/%.17g)^2)\"", b->A, b->c, b->w);
}
static double peak_integral (const bump *b) {
  return b->A * b->w * (atan ((END - b->c) / b->w) + atan (b->c / b->w));
}

/* Beside a smooth signal. */
static void product (const bump *b, char *text, size_t size) {
  snprintf (text, size, "\"sin (t)*cos (t) + %.17g*exp (-((t - %.17g)/%.17g)^2)*cos ((t - %.17g)/%.17g)\"", b->A, b->c,
            b->w, b->c, b->w);
}
static double product_integral (const bump *b) {
  return pow (sin (END), 2) / 2 + b->A * b->w * sqrt (PI) * exp (-0.25); /* c is many widths from both ends */
}

/* Two opposite edges 4 w apart. */
static void edges (const bump *b, char *text, size_t size) {
  snprintf (text, size, "\"%.17g*(tanh ((t - %.17g)/%.17g + 2) - tanh ((t - %.17g)/%.17g - 2))\"", b->A, b->c, b->w,
            b->c, b->w);
}
static double edges_integral (const bump *b) {
  return 8 * b->A * b->w;
}

/* A pulse of a harmonic: breakpoints are found, too. */
static void burst (const bump *b, char *text, size_t size) {
  snprintf (text, size, "\"abs (t - %.17g) < %.17g ? %.17g*cos (pi*(t - %.17g)/%.17g/2)^2 : 0\"", b->c, b->w, b->A,
            b->c, b->w);
}
static double burst_integral (const bump *b) {
  return b->A * b->w;
}

/* A spline through A at c and 0 at other points, w/4 apart. */
enum { SPIKE = 43 };
static void spike_points (const bump *b, double t[SPIKE], double y[SPIKE]) {
  for (int i = 0; i < SPIKE; i++) {
    t[i] = i == 0 ? 0 : i == SPIKE - 1 ? END : b->c + b->w / 4 * (i - SPIKE / 2);
    y[i] = i == SPIKE / 2 ? b->A : 0;
  }
}
static void spike (const bump *b, char *text, size_t size) {
  double t[SPIKE], y[SPIKE];
  spike_points (b, t, y);
  int n = snprintf (text, size, "{table: {interpolation: cubic, ends: rest, points: [");
  for (int i = 0; i < SPIKE; i++)
    n += snprintf (text + n, size - (size_t)n, "%s[%.17g, %.17g]", i ? ", " : "", t[i], y[i]);
  snprintf (text + n, size - (size_t)n, "]}}");
}
static double spike_integral (const bump *b) {
  double t[SPIKE], y[SPIKE], spline[2 * SPIKE], sum = 0;
  spike_points (b, t, y);
  const pw_points points = { .t = t, .value = y, .count = SPIKE, .interpolation = PW_CUBIC, .ends = PW_ENDS_REST };
  pw_table_spline (&(pw_signal){ PW_TABLE, .table = points }, spline);
  for (int i = 0; i < SPIKE - 1; i++) {
    double h = t[i + 1] - t[i];
    sum += h * (y[i] + y[i + 1]) / 2 - h * h * h * (spline[SPIKE + i] + spline[SPIKE + i + 1]) / 24;
  }
  return sum;
}

static const struct {
  const char *name;
  void (*text) (const bump *, char *, size_t);
  double (*integral) (const bump *);
  double width; /* in units of w */
} shape[] = { { "gauss", gauss, gauss_integral, 2 },       { "peak", peak, peak_integral, 2 },
              { "product", product, product_integral, 2 }, { "edges", edges, edges_integral, 4 },
              { "burst", burst, burst_integral, 1 },       { "spike", spike, spike_integral, 0.25 } };
enum { SHAPES = sizeof shape / sizeof *shape, BURST = 4, SPIKES = 5 };

/* ---- Adaptive methods ---- */

static const char *const adaptive[] = { "erk5", "erk8", "radau", "adams", "bdf", "ida", NULL };

/* The momentum is the integral of the force, however narrow that is: an error of some tolerances in each of up to some
 * hundred steps; a peak that was missed is at least 0.1. */
TEST (momentum) {
  char text[3000], what[60];
  double q[3], v[3];
  srand (1);
  for (int n = 0; n < 20; n++)
    for (int i = 0; i < SHAPES; i++) {
      bump b = { .w = pow (10, random_between (-6, -1.3)), .c = random_between (0.6, 2.4) };
      b.A = (rand () % 2 ? 1 : -1) * pow (10, random_between (-1, 1)) / b.w;
      shape[i].text (&b, text, sizeof text);
      gallery_scene x = pushed (text, 0);
      for (int k = 0; adaptive[k]; k++) {
        runs_state (x.system, adaptive[k], &(pw_settings){ .rtol = 1e-6, .span = END }, END, q, v, NULL);
        double exact = shape[i].integral (&b);
        snprintf (what, sizeof what, "%s, %s, w = %.2g", shape[i].name, adaptive[k], b.w);
        check_close (what, v[0], exact, 2e-4 * (1 + fabs (exact)), "200 tolerances of 1e-6; measured: 60");
      }
      gallery_close (&x);
    }
}

/* A body that passes a narrow force at 3 m/s gains its work. */
TEST (place) {
  char text[3000], what[60];
  double q[3], v[3];
  srand (2);
  for (int n = 0; n < 30; n++) {
    double w = pow (10, random_between (-6, -1)), c = random_between (0.7, 4),
           A = pow (10, random_between (-1, 0.5)) / w;
    snprintf (text, sizeof text, "\"%.17g*exp (-((b.x - %.17g)/%.17g)^2)\"", A, c, w);
    gallery_scene x = pushed (text, 3);
    for (int k = 0; adaptive[k]; k++) {
      runs_state (x.system, adaptive[k], &(pw_settings){ .rtol = 1e-6, .span = END }, END, q, v, NULL);
      snprintf (what, sizeof what, "%s, w = %.2g", adaptive[k], w);
      check_close (what, v[0], sqrt (9 + 2 * A * w * sqrt (PI)), 1e-3, "200 tolerances at 5 m/s");
    }
    gallery_close (&x);
  }
}

/* A drive whose prescribed angle hardly changes, but whose acceleration does: the torque's impulse is seen. */
TEST (drive) {
  static const char model[] =
      "pinwheel: 1\nbodies: [{name: b, mass: 1, inertia: 1}]\nelements:\n"
      "  - {pin: P, body: [ground, b], at: [[0, 0], [0.3, 0]]}\n"
      "  - {drive: D, body: [b, ground], what: angle, value: \"t + 1e-3*exp (-((t - 1.3)/1e-3)^2)\"}\n";
  double q[3], v[3];
  pw_statistics statistics;
  cli_write ("m.yaml", model);
  gallery_scene x = gallery_load (cli_path ("m.yaml"), NULL);
  for (int k = 0; adaptive[k]; k++) {
    runs_state (x.system, adaptive[k], &(pw_settings){ .rtol = 1e-4, .span = END }, END, q, v, &statistics);
    check_below (adaptive[k], 20, (double)statistics.steps, "steps that resolve accelerations of 2000 rad/s^2");
    check_close (adaptive[k], q[2], END, 0.02, "the prescribed angle");
  }
  gallery_close (&x);
}

/* ---- Signals that steps resolve ---- */

/* The same signals without enclosures: the same steps and results. */
TEST (resolved) {
  static const char *const smooth[] = { "sin (t)*cos (t)",
                                        "2*cos (3*t)*exp (-t/2) + 0.1",
                                        "t^2*(3 - 2*t) - 10*t^3/(1 + t^2)",
                                        "tanh (2*(t - 1)) + sqrt (1 + t)",
                                        "5*exp (-3*(t - 1.5)^2)",
                                        "-4*b.x - 0.3*b.vx + sin (2*t)",
                                        "-9.81*sin (b.x)",
                                        "-0.5*b.vx*abs (b.vx) + 1",
                                        "1/(1 + b.x^2)",
                                        "atan2 (1 + t, 2) + hypot (b.x, 1 + t)" };
  char text[400];
  for (size_t i = 0; i < sizeof smooth / sizeof *smooth; i++) {
    snprintf (text, sizeof text, "\"%s\"", smooth[i]);
    gallery_scene x = pushed (text, 0.5);
    pw_signal bare = *pushing (&x);
    pw_error error = { 0 };
    bare.function.enclose = NULL;
    check_ok (pw_model_set_signal (x.model, "F", "fx", &bare, &error), &error);
    pw_system *other = pw_system_compile (x.model, &error);
    assert_non_null (other);
    for (double rtol = 1e-4; rtol > 1e-11; rtol *= 1e-3)
      for (int k = 0; adaptive[k]; k++) {
        const pw_settings set = { .rtol = rtol, .span = 10 };
        double state[6], same[6];
        pw_statistics seen, blind;
        runs_state (x.system, adaptive[k], &set, 10, state, state + 3, &seen);
        runs_state (other, adaptive[k], &set, 10, same, same + 3, &blind);
        if (seen.steps != blind.steps)
          print_error ("%s, %s, rtol %g: %ld steps, %ld without\n", smooth[i], adaptive[k], rtol, seen.steps,
                       blind.steps);
        assert_int_equal (seen.steps, blind.steps);
        check_bits (smooth[i], state, same, 6);
      }
    for (double step = 1e-3; step < 0.2; step *= 5) {
      pw_statistics seen;
      double state[6];
      runs_state (x.system, "rk4", &(pw_settings){ .step = step }, 10, state, state + 3, &seen);
      assert_int_equal (seen.unresolved, 0);
    }
    pw_system_free (other);
    gallery_close (&x);
  }
}

/* ---- Steps of fixed size ---- */

static long unresolved (const gallery_scene *x, const char *method, double step, double *resolving) {
  char signal[PW_NAME_BYTES];
  pw_run *r = runs_open (x->system, method, &(pw_settings){ .step = step });
  runs_to (r, END);
  long count = pw_run_unresolved (r, resolving, signal, sizeof signal);
  assert_int_equal (count, pw_run_statistics (r)->unresolved);
  assert_string_equal (signal, count > 0 ? "F.fx" : "");
  pw_run_close (r);
  return count;
}

/* A signal is reported if it is narrower than a fourth of the step, not if it is wider than twice the step; steps of
 * the size that the report names resolve it, up to the factor 4. */
TEST (fixed) {
  static const char *const method[] = { "rk4", "galpha", "leapfrog", "erk8:steps=fixed" };
  char text[3000];
  srand (3);
  for (int n = 0; n < 40; n++)
    for (int i = 0; i < SHAPES; i++) {
      int wide = n % 2;
      double step = pow (10, random_between (-2.5, -1.2)), resolving;
      double width = step * (wide ? random_between (2, 6) : pow (10, random_between (-3, log10 (0.25))));
      bump b = { 5, random_between (0.9, 2.1), width / shape[i].width };
      if (i == BURST && !wide) continue;       /* steps end at its breakpoints */
      if (i == SPIKES && b.w > 0.17) continue; /* its points would not be within the run */
      shape[i].text (&b, text, sizeof text);
      gallery_scene x = pushed (text, 0);
      long count = unresolved (&x, method[n / 2 % 4], step, &resolving);
      if ((count == 0) != wide) print_error ("%s, step %g, width %g, c %.17g\n", shape[i].name, step, width, b.c);
      assert_int_equal (count == 0, wide);
      if (!wide) {
        check_below ("count", (double)count, 12, "steps around one place");
        check_close ("log4 of the step that resolves it", log (resolving / width) / log (4), 0, 1.5, "halvings");
      }
      gallery_close (&x);
    }
}

/* The same along the motion. */
TEST (fixed_place) {
  char text[400];
  srand (4);
  for (int n = 0; n < 40; n++) {
    int wide = n % 2;
    double step = pow (10, random_between (-2.5, -1.2)), resolving;
    double w = 3 * step * (wide ? random_between (2, 6) : pow (10, random_between (-3, log10 (0.25)))) / 2;
    snprintf (text, sizeof text, "\"0.5*exp (-((b.x - %.17g)/%.17g)^2)\"", random_between (2, 7), w);
    gallery_scene x = pushed (text, 3);
    long count = unresolved (&x, "rk4", step, &resolving);
    if ((count == 0) != wide) print_error ("step %g, width %g: %ld\n", step, w, count);
    assert_int_equal (count == 0, wide);
    gallery_close (&x);
  }
}

static int tone (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)x, (void)gradient;
  value[0] = cos (2000 * PI * t + *(const double *)context);
  return 0;
}

/* A force of 1000 Hz sampled each millisecond is reported at any phase: as an expression, a harmonic, or a C function;
 * not with eight steps in a period. */
TEST (alias) {
  char text[200];
  double resolving;
  for (double phase = 0; phase < 2 * PI; phase += PI / 6) {
    for (int form = 0; form < 3; form++) {
      snprintf (text, sizeof text,
                form == 0 ? "\"cos (2000*pi*t + %.17g)\""
                          : "{harmonic: {amplitude: 1, omega: 6283.1853071795865, phase: %.17g}}",
                phase);
      gallery_scene x = pushed (text, 0);
      if (form == 2) {
        const pw_signal f = { PW_FUNCTION, .function = { .eval = tone, .context = &phase } };
        pw_error error = { 0 };
        check_ok (pw_model_set_signal (x.model, "F", "fx", &f, &error), &error);
        pw_system_free (x.system);
        x.system = pw_system_compile (x.model, &error);
        assert_non_null (x.system);
      }
      long count = unresolved (&x, "rk4", 1e-3, &resolving);
      check_close ("steps", (double)count, END / 1e-3, 20, "all but some of the last, between two samples of 16");
      check_close ("step [ms]", 1e3 * resolving, 0.5, form == 1 ? 1e-3 : 0.3, "half a period, or a fourth");
      assert_int_equal (unresolved (&x, "rk4", 1e-3 / 8, &resolving), 0);
      gallery_close (&x);
    }
  }
}
