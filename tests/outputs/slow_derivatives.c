/* A campaign: stated errors of derivatives contain the true ones.  Random models, of which a third or more have events:
 * conditions on states, contacts, switching velocities, breakpoints that parameters move.  The truth: differences of
 * runs of another program, in 80-bit numbers, that ends steps at events; closed forms; extrapolated differences of runs
 * with other steps and tighter tolerances.  SEED=N in the environment selects other models. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "outcome.h"

typedef long double real;

static double campaign_random (double low, double high) {
  static unsigned long long x; /* xorshift, Marsaglia 2003 */
  if (x == 0) x = 88172645463325252ULL + (getenv ("SEED") ? 1000003 * strtoull (getenv ("SEED"), NULL, 10) : 0);
  x ^= x << 13, x ^= x >> 7, x ^= x << 17;
  return low + (high - low) * (double)(x >> 11) / 9007199254740992.;
}

/* ---- Counts ---- */

enum { CAMPAIGN_MOST = 20000 };
static struct {
  int all, events, outside, none, unknown, known; /* triples; known: with a stated and a true error */
  double ratio[CAMPAIGN_MOST];                    /* known: stated over true error */
  double digits[CAMPAIGN_MOST];                   /* known: stated error, relative */
} counts;

static int campaign_order (const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Counts a triple; of_truth: the error of the truth. */
static void campaign_count (const char *what, double derivative, double error, real truth, double of_truth, int event) {
  const double off = fabs (derivative - (double)truth);
  counts.all++, counts.events += event;
  if (isnan (derivative)) {
    print_message ("none or unknown: %s, true %.12Lg\n", what, truth);
    counts.unknown++;
    return;
  }
  if (!(off <= error + of_truth + 4 * DBL_EPSILON * fabs (derivative))) {
    print_message ("outside: %s: %.12g +- %.2g, true %.12Lg +- %.1g\n", what, derivative, error, truth, of_truth);
    counts.outside++;
  }
  if (off > 0 && counts.known < CAMPAIGN_MOST) counts.ratio[counts.known] = error / off;
  if (off > 0 && counts.known < CAMPAIGN_MOST)
    counts.digits[counts.known++] = error / fmax (fabs (derivative), DBL_MIN);
}

static void campaign_report (const char *name) {
  qsort (counts.ratio, (size_t)counts.known, sizeof (double), campaign_order);
  qsort (counts.digits, (size_t)counts.known, sizeof (double), campaign_order);
  print_message (
      "%s: %d derivatives, %d of them of motions with events; %d outside of their stated errors, %d unknown; "
      "medians: stated over true error %.1f, stated error %.1g of the derivative\n",
      name, counts.all, counts.events, counts.outside, counts.unknown, counts.ratio[counts.known / 2],
      counts.digits[counts.known / 2]);
}

/* ---- A particle on a line, with a force that changes at events ---- */

enum { MOST_P = 6, STATES = 5 }; /* parameters; x, v, integrals of x, v^2 and of the power */

/* p: parameters, the last one but one the initial position, the last one the initial velocity. */
typedef real line_force (int mode, real t, const real *y, const real *p);
typedef real line_event (real t, const real *y, const real *p); /* the mode is 1 where it is > 0 */

typedef struct {
  const char *name, *force; /* of the YAML model, b.x, b.vx, parameters a, b, c, d */
  line_force *f;
  line_event *g;
  double low[MOST_P], high[MOST_P]; /* of a, b, c, d, x0, v0 */
  int parameters;                   /* of a, b, c, d that are in use */
  double rate;                      /* the fastest, for the steps [1/s] */
} line_model;

static real threshold_v (real t, const real *y, const real *p) {
  (void)t;
  return y[1] - p[2];
}
static real threshold_x (real t, const real *y, const real *p) {
  (void)t;
  return y[0] - p[2];
}
static real threshold_t (real t, const real *y, const real *p) {
  (void)y;
  return t - p[2];
}
static real at_zero (real t, const real *y, const real *p) {
  (void)t, (void)p;
  return y[0];
}
static real thrust (int mode, real t, const real *y, const real *p) {
  (void)t, (void)y;
  return mode ? -p[0] : -p[1];
}
static real gear (int mode, real t, const real *y, const real *p) {
  (void)t, (void)y;
  return mode ? p[1] : p[0];
}
static real wall (int mode, real t, const real *y, const real *p) {
  (void)t, (void)p;
  return mode ? -p[0] * (y[0] - p[2]) - p[1] * y[1] : -p[1] * y[1];
}
static real pulse (int mode, real t, const real *y, const real *p) {
  return (mode ? p[0] : 0) - p[1] * y[0] + 0 * t;
}
static real bilinear (int mode, real t, const real *y, const real *p) {
  return -(mode ? p[0] : p[1]) * y[0] + p[2] * cosl (p[3] * t);
}
static real relay (int mode, real t, const real *y, const real *p) {
  (void)t;
  return (mode ? -p[0] : p[0]) - p[1] * y[1];
}
static real smooth (int mode, real t, const real *y, const real *p) {
  (void)mode;
  return -p[0] * sinl (y[0]) - p[1] * y[1] * fabsl (1 + y[1] * y[1]) + p[2] * sinl (p[3] * t);
}
static real ball (int mode, real t, const real *y, const real *p) {
  (void)t;
  return mode ? -p[1] : -p[1] - p[0] * y[0];
}

static const line_model line_models[] = {
  { "switching velocity",
    "b.vx > c ? -a : -b",
    thrust,
    threshold_v,
    { 2, 0.5, 0.1, 0, -1, 1 },
    { 4, 1.5, 0.6, 0, 1, 2 },
    3,
    10 },
  { "gear", "b.vx > c ? b : a", gear, threshold_v, { 1, 0.2, 1, 0, -1, 0 }, { 3, 0.8, 2, 0, 1, 0.5 }, 3, 10 },
  { "position", "b.x > c ? b : a", gear, threshold_x, { 0.2, -1, 0.3, 0, -1, 0.5 }, { 2, 1, 1, 0, 0, 2 }, 3, 10 },
  { "wall",
    "-a*max (0, b.x - c) - b*b.vx",
    wall,
    threshold_x,
    { 1e2, 0.01, 0.5, 0, 0, 1 },
    { 1e4, 0.3, 1, 0, 0.2, 2 },
    3,
    100 },
  { "breakpoint",
    "(t > c ? a : 0) - b*b.x",
    pulse,
    threshold_t,
    { 1, 1, 0.2, 0, -1, -1 },
    { 3, 9, 1.5, 0, 1, 1 },
    3,
    10 },
  { "bilinear spring",
    "(b.x > 0 ? -a : -b)*b.x + c*cos (d*t)",
    bilinear,
    at_zero,
    { 5, 10, 1, 1, 0.5, -1 },
    { 9, 30, 3, 4, 1, 1 },
    4,
    10 },
  { "relay",
    "(b.x > c ? -a : a) - b*b.vx",
    relay,
    threshold_x,
    { 1, 0.1, -0.2, 0, -1, -1 },
    { 3, 0.5, 0.2, 0, 1, 1 },
    3,
    10 },
  { "bounces", "-b - a*min (0, b.x)", ball, at_zero, { 1e2, 5, 0, 0, 0.2, -1 }, { 1e4, 10, 0, 0, 1, 1 }, 2, 100 },
  { "smooth",
    "-a*sin (b.x) - b*b.vx*abs (1 + b.vx^2) + c*sin (d*t)",
    smooth,
    NULL,
    { 1, 0.05, 0.5, 1, -1, -1 },
    { 9, 0.2, 3, 4, 1, 1 },
    4,
    10 },
};
enum { LINE_MODELS = sizeof line_models / sizeof *line_models };

static void line_rates (const line_model *m, int mode, real t, const real *y, const real *p, real *dy) {
  dy[0] = y[1], dy[1] = m->f (mode, t, y, p), dy[2] = y[0], dy[3] = y[1] * y[1], dy[4] = dy[1] * y[1];
}

/* A step of the classical Runge-Kutta method. */
static void line_step (const line_model *m, int mode, real t, real h, const real *y, const real *p, real *to) {
  real k[4][STATES], z[STATES];
  line_rates (m, mode, t, y, p, k[0]);
  for (int s = 1; s < 4; s++) {
    for (int j = 0; j < STATES; j++) z[j] = y[j] + (s < 3 ? h / 2 : h) * k[s - 1][j];
    line_rates (m, mode, t + (s < 3 ? h / 2 : h), z, p, k[s]);
  }
  for (int j = 0; j < STATES; j++) to[j] = y[j] + h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]);
}

/* The part of a step after which the event function g changes its sign, by bisection. */
static real line_root (const line_model *m, line_event *g, int mode, real t, real h, const real *y, const real *p,
                       int sign) {
  real low = 0, high = h, z[STATES];
  for (int i = 0; i < 80; i++) {
    real middle = (low + high) / 2;
    line_step (m, mode, t, middle, y, p, z);
    if ((g (t + middle, z, p) > 0) == (sign > 0))
      low = middle;
    else
      high = middle;
  }
  return high;
}

static real line_velocity (real t, const real *y, const real *p) {
  (void)t, (void)p;
  return y[1];
}

enum { LINE_OUTPUTS = 8 };
static const char line_of[] = "--of b.x --of b.vx --of integral:b.x --of rms:b.vx --of mean:b.vx --of F.work "
                              "--of max:b.x --of min:b.x";

/* Outputs at the end of a run; *events: their number. */
static void line_run (const line_model *m, const real *p, double t_end, real *out, int *events) {
  const int steps = (int)(t_end * m->rate * 400);
  real y[STATES] = { p[4], p[5] }, z[STATES], t = 0, most = y[0], least = y[0];
  int mode = m->g ? m->g (0, y, p) > 0 || (m->g (0, y, p) == 0 && y[1] > 0) : 0;
  *events = 0;
  for (int i = 1; i <= steps;) {
    const real end = i * (real)t_end / steps;
    real h = end - t;
    line_step (m, mode, t, h, y, p, z);
    const int changes = m->g && (m->g (end, z, p) > 0) != mode;
    if (changes) {
      h = line_root (m, m->g, mode, t, h, y, p, mode ? 1 : -1);
      line_step (m, mode, t, h, y, p, z);
    }
    if ((y[1] > 0) != (z[1] > 0)) { /* an extremum of x inside the step */
      real inside[STATES];
      line_step (m, mode, t, line_root (m, line_velocity, mode, t, h, y, p, y[1] > 0 ? 1 : -1), y, p, inside);
      most = fmaxl (most, inside[0]), least = fminl (least, inside[0]);
    }
    memcpy (y, z, sizeof y);
    most = fmaxl (most, y[0]), least = fminl (least, y[0]);
    if (changes)
      mode = !mode, t += h, ++*events;
    else
      t = end, i++;
  }
  const real values[LINE_OUTPUTS] = {
    y[0], y[1], y[2], sqrtl (y[3] / t_end), (y[0] - p[4]) / t_end, y[4], most, least
  };
  memcpy (out, values, sizeof values);
}

/* Derivatives with respect to all parameters, by extrapolated differences; their error is estimated as three times the
 * difference of two steps. */
static void line_truth (const line_model *m, const real *p, double t_end, real truth[MOST_P][LINE_OUTPUTS],
                        double error[MOST_P][LINE_OUTPUTS], int *events) {
  real f[4][LINE_OUTPUTS], other[LINE_OUTPUTS], q[MOST_P];
  int count;
  line_run (m, p, t_end, other, events);
  for (int j = 0; j < MOST_P; j++)
    for (int size = 0; size < 2; size++) {
      const real h = (size ? 1e-6L : 3e-6L) * fmaxl (fabsl (p[j]), 0.1L);
      for (int k = 0; k < 4; k++) {
        memcpy (q, p, sizeof q);
        q[j] += h * (k < 2 ? k - 2 : k - 1);
        line_run (m, q, t_end, f[k], &count);
      }
      for (int i = 0; i < LINE_OUTPUTS; i++) {
        real d = (8 * (f[2][i] - f[1][i]) - (f[3][i] - f[0][i])) / (12 * h);
        error[j][i] = 3 * (double)fabsl (d - truth[j][i]) + 1e-10 * (double)fabsl (d);
        truth[j][i] = d;
      }
    }
}

static void line_trial (const line_model *m) {
  static const char *const name[] = { "a", "b", "c", "d", "b.x", "b.vx" };
  const double t_end = campaign_random (1, 3);
  double value[MOST_P], derivative[CLI_MOST], error[CLI_MOST], of_truth[MOST_P][LINE_OUTPUTS];
  real p[MOST_P], truth[MOST_P][LINE_OUTPUTS];
  int events, count, used = 0;
  char by[200] = "", what[400];
  for (int j = 0; j < MOST_P; j++) p[j] = value[j] = campaign_random (m->low[j], m->high[j]);
  for (int j = 0; j < MOST_P; j++)
    if (j < m->parameters || j > 3) sprintf (by + strlen (by), " --by %s", name[j]), used++;
  cli_write ("line.yaml", check_text ("pinwheel: 1\nrun: {t_end: %.17g, method: erk8, rtol: 1e-9}\nparameters: "
                                      "[{name: a, value: %.17g}, {name: b, value: %.17g}, {name: c, value: %.17g}, "
                                      "{name: d, value: %.17g}]\n"
                                      "bodies: [{name: b, mass: 1, inertia: 1, start: {x: %.17g}, rate: {vx: %.17g}}]\n"
                                      "elements:\n  - {slider: s, body: [b, ground], at: [[0, 0], [0, 0]]}\n"
                                      "  - {force: F, body: b, fx: '%s'}\n",
                                      t_end, value[0], value[1], value[2], value[3], value[4], value[5], m->force));
  cli_shell (check_text ("pinwheel sensitivity @/line.yaml %s%s -o @/sens/sensitivity.csv --json "
                         "@/sens/sensitivity.json --plots @/sens --every 100",
                         line_of, by));
  count = cli_sensitivity ("derivative", derivative);
  assert_int_equal (count, LINE_OUTPUTS * used);
  assert_int_equal (cli_sensitivity ("error", error), count);
  line_truth (m, p, t_end, truth, of_truth, &events);
  for (int i = 0; i < LINE_OUTPUTS; i++)
    for (int j = 0, k = 0; j < MOST_P; j++) {
      if (j >= m->parameters && j < 4) continue;
      snprintf (what, sizeof what, "%s, a %.17g b %.17g c %.17g d %.17g x %.17g v %.17g to %.17g, output %d by %s",
                m->name, value[0], value[1], value[2], value[3], value[4], value[5], t_end, i, name[j]);
      campaign_count (what, derivative[i * used + k], error[i * used + k], truth[j][i], of_truth[j][i], events > 0);
      k++;
    }
}

TEST (line) {
  memset (&counts, 0, sizeof counts);
  for (int i = 0; i < 6 * LINE_MODELS; i++) line_trial (&line_models[i % LINE_MODELS]);
  campaign_report ("particles on a line");
  assert_true (counts.all >= 1000 && 3 * counts.events > counts.all);
  assert_int_equal (counts.outside, 0);
  check_below ("unknown", counts.unknown, 0.01 * counts.all, "1 %");
}

/* ---- The sleigh: a closed form ---- */

/* theta and omega after the time t, see test_sensitivity.c. */
static void sleigh_run (const real p[5], double t, real out[2]) {
  const real m = p[0], I = p[1], a = p[2], u = p[3], w = p[4], k = sqrtl (I / m + a * a),
             A = sqrtl (u * u + k * k * w * w), s = a * A / (k * k), c = atanhl (u / A);
  out[0] = k / a * (2 * atanl (tanhl ((s * t + c) / 2)) - 2 * atanl (tanhl (c / 2)));
  out[1] = k / a * s / coshl (s * t + c);
}

TEST (sleigh) {
  static const char *const name[] = { "m", "I", "a", "u0", "w0" };
  static const double low[] = { 0.5, 0.2, 0.1, -0.8, 0.4 }, high[] = { 2, 1, 0.5, 0.8, 1.2 };
  memset (&counts, 0, sizeof counts);
  for (int trial = 0; trial < 20; trial++) {
    double derivative[CLI_MOST], error[CLI_MOST], t = campaign_random (2, 20);
    real p[5], q[5], f[4][2];
    char set[400] = "";
    for (int j = 0; j < 5; j++) {
      const double value = campaign_random (low[j], high[j]);
      p[j] = value;
      sprintf (set + strlen (set), " --set %s=%.17g --by %s", name[j], value, name[j]);
    }
    cli_shell (check_text ("pinwheel sensitivity chaplygin-sleigh --of sleigh.phi --of sleigh.omega -t %.17g%s -o "
                           "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens --every 100",
                           t, set));
    assert_int_equal (cli_sensitivity ("derivative", derivative), 10);
    assert_int_equal (cli_sensitivity ("error", error), 10);
    for (int j = 0; j < 5; j++) {
      const real h = 1e-4L * fabsl (p[j]);
      for (int k = 0; k < 4; k++) {
        memcpy (q, p, sizeof q);
        q[j] += h * (k < 2 ? k - 2 : k - 1);
        sleigh_run (q, t, f[k]);
      }
      for (int i = 0; i < 2; i++) {
        const real truth = (8 * (f[2][i] - f[1][i]) - (f[3][i] - f[0][i])) / (12 * h);
        campaign_count (name[j], derivative[5 * i + j], error[5 * i + j], truth, 1e-13 * (double)fabsl (truth), 0);
      }
    }
  }
  campaign_report ("sleighs");
  assert_int_equal (counts.outside + counts.unknown, 0);
}

/* ---- Mechanisms and vehicles: extrapolated differences of runs ---- */

enum { SCENE_OUTPUTS = 6 };

typedef struct {
  const char *file, *parameter[2]; /* NULL: a path in the folder of the test */
  double value[2], t_end;
  char output[SCENE_OUTPUTS][200];
} scene_trial;

/* The outputs with parameter `which` changed. */
static void scene_run (const scene_trial *x, int which, double by, double *out) {
  const char *of[SCENE_OUTPUTS];
  double value[2] = { x->value[0], x->value[1] };
  pw_outcomes set;
  pw_error error = { 0 };
  if (which >= 0) value[which] += by;
  gallery_scene scene = gallery_load (x->file, x->parameter[0], value[0], x->parameter[1], value[1], NULL);
  for (int i = 0; i < SCENE_OUTPUTS; i++) of[i] = x->output[i];
  check_ok (pw_outcomes_open (&set, scene.system, "--of", of, SCENE_OUTPUTS, NULL, &error), &error);
  const pw_settings settings = { .rtol = 3e-14, .span = x->t_end, .max_steps = 100000000 };
  check_ok (pw_outcomes_run (&set, "erk8+projection", &settings, x->t_end, NULL, &error), &error);
  for (int i = 0; i < SCENE_OUTPUTS; i++) out[i] = pw_outcome_value (&set, i);
  pw_outcomes_close (&set);
  gallery_close (&scene);
}

/* Six outputs: states, a reaction, extrema, means. */
static void scene_choose (scene_trial *x) {
  static const char *const prefix[SCENE_OUTPUTS] = { "", "", "max:", "mean:", "integral:", "rms:" };
  gallery_scene scene = gallery_load (x->file, NULL);
  const int n = 2 * pw_system_coordinates (scene.system), rows = pw_system_rows (scene.system);
  char name[200];
  for (int i = 0; i < SCENE_OUTPUTS; i++) {
    int which = (int)campaign_random (0, i == 5 && rows ? rows : n);
    if (i == 5 && rows)
      pw_system_reaction_name (scene.system, which, name, sizeof name);
    else
      pw_system_state_name (scene.system, which, name, sizeof name);
    snprintf (x->output[i], sizeof x->output[i], "%s%.150s", prefix[i], name);
  }
  for (int p = 0; p < 2; p++) {
    const pw_parameter *list = pw_file_table (scene.file)->parameters;
    for (x->value[p] = 0; list->name; list++)
      if (strcmp (list->name, x->parameter[p]) == 0) x->value[p] = list->value * campaign_random (0.97, 1.03);
    assert_true (x->value[p] != 0);
  }
  gallery_close (&scene);
}

static void scene_check (scene_trial *x, int event) {
  double derivative[CLI_MOST], error[CLI_MOST], f[2][4][SCENE_OUTPUTS];
  char of[2000] = "", what[500];
  scene_choose (x);
  for (int i = 0; i < SCENE_OUTPUTS; i++) sprintf (of + strlen (of), " --of %s", x->output[i]);
  cli_shell (check_text ("pinwheel sensitivity %s%s --set %s=%.17g --set %s=%.17g --by %s --by %s -t %.17g -o "
                         "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens "
                         "--every 100 2>&1",
                         x->file, of, x->parameter[0], x->value[0], x->parameter[1], x->value[1], x->parameter[0],
                         x->parameter[1], x->t_end));
  assert_int_equal (cli_sensitivity ("derivative", derivative), 2 * SCENE_OUTPUTS);
  assert_int_equal (cli_sensitivity ("error", error), 2 * SCENE_OUTPUTS);
  for (int p = 0; p < 2; p++) {
    const double step[2] = { 3.3e-4 * fabs (x->value[p]), 1.1e-4 * fabs (x->value[p]) };
    for (int size = 0; size < 2; size++)
      for (int k = 0; k < 4; k++) scene_run (x, p, step[size] * (k < 2 ? k - 2 : k - 1), f[size][k]);
    for (int i = 0; i < SCENE_OUTPUTS; i++) {
      double d[2];
      for (int size = 0; size < 2; size++) {
        const double (*y)[SCENE_OUTPUTS] = (const double (*)[SCENE_OUTPUTS])f[size];
        d[size] = (8 * (y[2][i] - y[1][i]) - (y[3][i] - y[0][i])) / (12 * step[size]);
      }
      snprintf (what, sizeof what, "%s, %s = %.17g, %s = %.17g: %s by %s", x->file, x->parameter[0], x->value[0],
                x->parameter[1], x->value[1], x->output[i], x->parameter[p]);
      campaign_count (what, derivative[2 * i + p], error[2 * i + p], d[0],
                      2 * fabs (d[1] - d[0]) + (1e-13 * fabs (f[0][0][i]) + 1e-14) / step[0], event);
    }
  }
}

/* A pendulum against a spring, a vehicle whose steering torque switches, a linkage with a breakpoint. */
static void scene_write (void) {
  cli_write ("stop.yaml",
             "pinwheel: 1\nparameters: [{name: k, value: 2000}, {name: s, value: 0.3}]\n"
             "bodies:\n  - {name: a, mass: 1, inertia: 0.1, start: {x: 1}}\n"
             "  - {name: b, mass: 0.5, inertia: 0.05, start: {x: 1.7}}\nelements:\n"
             "  - {pin: P, body: [ground, a], at: [[0, 0], [-1, 0]]}\n"
             "  - {pin: Q, body: [a, b], at: [[0.3, 0], [-0.4, 0]]}\n  - {gravity: g, acceleration: [0, -9.81]}\n"
             "  - {torque: T, body: [a, ground], value: '-k*min (0, a.phi + s)'}\n");
  cli_write ("switch.yaml",
             "pinwheel: 1\nparameters: [{name: amp, value: 5}, {name: h, value: 0.2}]\nbodies:\n"
             "  - {name: a, mass: 1, inertia: 1, start: {x: 0}, rate: {vx: 1}}\n"
             "  - {name: b, mass: 0.5, inertia: 0.1, start: {x: 1}, rate: {vx: 1}}\nelements:\n"
             "  - {pin: p, body: [a, b], at: [[0.5, 0], [-0.5, 0]]}\n  - {wheel: w, body: a, at: [-0.3, 0]}\n"
             "  - {torque: t, body: [b, a], value: '(b.phi - a.phi > h ? -amp : amp) - 0.5*(b.omega - a.omega)'}\n");
  cli_write ("pulse.yaml", "pinwheel: 1\nparameters: [{name: s, value: 0.4}, {name: w, value: 0.3}]\nbodies:\n"
                           "  - {name: a, mass: 1, inertia: 0.1, start: {x: 0.5}}\n"
                           "  - {name: b, mass: 0.5, inertia: 0.05, start: {x: 1.5}}\nelements:\n"
                           "  - {pin: P, body: [ground, a], at: [[0, 0], [-0.5, 0]]}\n"
                           "  - {pin: Q, body: [a, b], at: [[0.5, 0], [-0.5, 0]]}\n"
                           "  - {torque: T, body: [a, ground], value: {pulse: {height: 3, start: s, width: w}}}\n"
                           "  - {gravity: g, acceleration: [0, -9.81]}\n");
}

TEST (scenes) {
  static const struct {
    const char *file, *parameter[2];
    double t_end;
    int event;
  } scene[] = { { "ezyroller", { "a", "M0" }, 4, 0 },         { "snakeboard", { "swing", "m" }, 2, 0 },
                { "roller-racer", { "a", "swing" }, 2, 0 },   { "car", { "a", "u0" }, 3, 0 },
                { "pendulum", { "l", "g" }, 3, 0 },           { "slider-crank", { "l1", "m1" }, 1, 0 },
                { "knife-edge-incline", { "g", "w" }, 3, 0 }, { "stop.yaml", { "k", "s" }, 0.8, 1 },
                { "switch.yaml", { "amp", "h" }, 0.6, 1 },    { "pulse.yaml", { "s", "w" }, 1, 1 } };
  memset (&counts, 0, sizeof counts);
  scene_write ();
  for (size_t i = 0; i < 3 * sizeof scene / sizeof *scene; i++) {
    const size_t k = i % (sizeof scene / sizeof *scene);
    char path[300];
    snprintf (path, sizeof path, "%s", strstr (scene[k].file, ".yaml") ? cli_path (scene[k].file) : scene[k].file);
    scene_trial x = { .file = path,
                      .parameter = { scene[k].parameter[0], scene[k].parameter[1] },
                      .t_end = scene[k].t_end };
    scene_check (&x, scene[k].event);
  }
  campaign_report ("mechanisms and vehicles");
  assert_int_equal (counts.outside, 0);
  check_below ("unknown", counts.unknown, 0.02 * counts.all, "2 %");
}

const check_fixture fixture = { cli_setup_undrawn, cli_teardown };
