/* Periodic motions: reference digits, closed forms of multipliers, branches, free periods. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "periodic_case.h"
#include "search.h"
#include "runs.h"
#include "scene.h"

/* Multiplier i of those that are not trivial. */
static void periodic_expect (const pw_periodic_orbit *o, int i, double re, double im) {
  assert_true (i < o->multipliers - o->trivial);
  check_close ("multiplier", o->re[i], re, 2e-8, "steps of the derivatives: 1e-9 each");
  check_close ("multiplier", o->im[i], im, 2e-8, "steps of the derivatives: 1e-9 each");
}

/* Events of a branch, at most 8 of each type, with the parameter; the points that are stable and those that are not. */
typedef struct {
  int count[PW_PERIODIC_END], points, unstable;
  double at[PW_PERIODIC_END][8], last;
} branch_events;

static branch_events periodic_follow (pw_periodic *x) {
  pw_error error = { 0 };
  pw_periodic_orbit o;
  branch_events e = { .points = 0 };
  check_ok (pw_periodic_follow (x, 1, &error), &error);
  for (;;) {
    check_ok (pw_periodic_next (x, &o, &error), &error);
    if (o.event == PW_PERIODIC_END) return e;
    e.at[o.event][e.count[o.event]++ % 8] = e.last = o.parameter;
    e.points++;
    e.unstable += o.unstable > 0;
  }
}

/* ---- A driven pendulum: th'' = -sin th - 0.1 th' + A cos 0.8 t ---- */

typedef struct {
  double A, th, om;
} pendulum;

static const pw_parameter pendulum_parameters[] = { { PW_AT (pendulum, A), 0.2, "N m", "", PW_REAL },
                                                    { PW_AT (pendulum, th), 0, "rad", "", PW_REAL },
                                                    { PW_AT (pendulum, om), 0, "rad/s", "", PW_REAL },
                                                    { .name = NULL } };

SCENE_WITH (pendulum_build, pendulum_parameters, pendulum) {
  double s = sin (p->th), c = cos (p->th);
  const pw_signal torque = { PW_HARMONIC, .harmonic = { .amplitude = p->A, .omega = 0.8 } };
  pw_add_body (
      m, &(pw_body){ .name = "bob", .mass = 1, .start = { s, -c, p->th }, .rate = { c * p->om, s * p->om, p->om } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot", .body = { "bob", "ground" }, .at = { { 0, 1 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -1 } });
  pw_add_friction (m, &(pw_friction){ .name = "air", .body = { "bob", "ground" }, .viscous = 0.1 });
  pw_add_torque (m, &(pw_torque){ .name = "drive", .body = { "bob", "ground" }, .value = torque });
}

static pw_system *pendulum_at (void *context, double A, pw_error *error) {
  (void)context, (void)error;
  return scene_system (&pendulum_build_table, "A", A, NULL);
}

/* Three orbits at A = 0.2: shooting with 30 digits (Taylor series), confirmed by AUTO-07p. */
TEST (pendulum) {
  static const struct {
    double th, om, re[2], im;
  } orbit[] = { { 0.5982763426814, 0.1196106484219, { 0.265099104796, 0.265099104796 }, 0.621015774681 },
                { 1.2066430427563, 0.6718812719357, { 1.79476852725, 0.254037287173 }, 0 },
                { -1.2305856526574, 1.2572101436741, { 0.205346676608, 0.205346676608 }, 0.643250239154 } };
  for (int i = 0; i < 3; i++) {
    double th = round (100 * orbit[i].th) / 100, om = round (100 * orbit[i].om) / 100;
    pw_system *s = scene_system (&pendulum_build_table, "th", th, "om", om, NULL);
    pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = 0 });
    pw_periodic_orbit o = periodic_solve (x, 0, 0);
    assert_int_equal (pw_periodic_symmetries (x), 0);
    assert_int_equal (o.multipliers, 2);
    assert_int_equal (o.unstable, i == 1);
    check_close ("period", o.period, 2.5 * PW_PI, 1e-14, "of the signal");
    check_close ("theta", o.q[2], orbit[i].th, 1e-11, "13 digits, run at 1e-12");
    check_close ("omega", o.v[2], orbit[i].om, 1e-11, "13 digits, run at 1e-12");
    for (int k = 0; k < 2; k++) periodic_expect (&o, k, orbit[i].re[k], k ? -orbit[i].im : orbit[i].im);
    pw_periodic_close (x);
    pw_system_free (s);
  }
}

/* The folds of the same two sources. */
TEST (folds) {
  pw_system *s = pendulum_at (NULL, 0.1, NULL);
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .compile = pendulum_at, .first = 0.1, .last = 0.35 });
  periodic_solve (x, 0, 0.1);
  branch_events e = periodic_follow (x);
  assert_int_equal (e.count[PW_PERIODIC_FOLD], 2);
  assert_int_equal (e.count[PW_PERIODIC_REAL] + e.count[PW_PERIODIC_FLIP] + e.count[PW_PERIODIC_TORUS], 0);
  assert_true (e.points > 20 && e.unstable > 5);
  check_close ("fold", e.at[PW_PERIODIC_FOLD][0], 0.2551903155158, 1e-10, "quadratic in the distance along the branch");
  check_close ("fold", e.at[PW_PERIODIC_FOLD][1], 0.1460465894553, 1e-10, "quadratic in the distance along the branch");
  check_close ("end", e.last, 0.35, 0, "the end of the range");
  pw_periodic_close (x);
  pw_system_free (s);
}

/* ---- An oscillator: x'' = -(a - 2 q cos 2 t) x + (p - c x^2) x' ---- */

typedef struct {
  double a, q, p, c, x, mass; /* mass: of a disc with the inertia 1: 1 / L^2 */
} oscillator;

static const pw_parameter oscillator_parameters[] = { { PW_AT (oscillator, a), 1, "", "", PW_REAL },
                                                      { PW_AT (oscillator, q), 0, "", "", PW_REAL },
                                                      { PW_AT (oscillator, p), 0, "", "", PW_REAL },
                                                      { PW_AT (oscillator, c), 0, "", "", PW_REAL },
                                                      { PW_AT (oscillator, x), 0, "", "", PW_REAL },
                                                      { PW_AT (oscillator, mass), 1, "", "", PW_REAL },
                                                      { .name = NULL } };

static int oscillator_torque (void *context, double t, const double *x, double value[3], double *gradient) {
  const oscillator *o = context;
  double stiffness = o->a - 2 * o->q * cos (2 * t);
  value[0] = -stiffness * x[0] + (o->p - o->c * x[0] * x[0]) * x[1];
  if (gradient) gradient[0] = -stiffness - 2 * o->c * x[0] * x[1], gradient[1] = o->p - o->c * x[0] * x[0];
  return 0;
}

/* The parameters of a system outlive it: more than exist at a time. */
SCENE_WITH (oscillator_build, oscillator_parameters, oscillator) {
  static const char *const reads[] = { "disc.phi", "disc.omega", NULL };
  static oscillator kept[16];
  static int next;
  oscillator *o = &kept[next++ % 16];
  *o = *p;
  const pw_signal torque = { PW_FUNCTION, .function = { .eval = oscillator_torque, .context = o, .reads = reads } };
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = p->mass, .inertia = 1, .start = { 0, 0, o->x } });
  pw_add_pin (m, &(pw_pin){ .name = "axle", .body = { "disc", "ground" } });
  pw_add_torque (m, &(pw_torque){ .name = "torque", .body = { "disc", "ground" }, .value = torque });
}

static pw_system *mathieu_at (void *context, double a, pw_error *error) {
  (void)context, (void)error;
  return scene_system (&oscillator_build_table, "a", a, "q", 1., NULL);
}

/* Mathieu's equation: characteristic values (DLMF 28.2), where the multipliers are -1, -1 or 1, 1, and between them. */
TEST (mathieu) {
  static const struct {
    double a, re[2], im, accuracy;
  } row[] = { { 1.8591080725143634, { -1, -1 }, 0, 1e-4 },
              { -0.11024881699209521, { -1, -1 }, 0, 1e-4 },
              { 4.371300982735086, { 1, 1 }, 0, 1e-4 },
              { 3.917024772998471, { 1, 1 }, 0, 1e-4 },
              { 2.5, { -0.0483762, -0.0483762 }, 0.998829, 1e-6 },
              { 1, { -4.15605494, -0.2406128 }, 0, 6e-8 } };
  for (int i = 0; i < 6; i++) {
    pw_system *s = mathieu_at (NULL, row[i].a, NULL);
    pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = PW_PI });
    pw_periodic_orbit o = periodic_solve (x, 0, 0);
    assert_int_equal (o.multipliers, 2);
    for (int k = 0; k < 2; k++) {
      const char *why = "digits given; the root of 1e-9 at a double one";
      check_close ("multiplier", o.re[k], row[i].re[k], row[i].accuracy, why);
      check_close ("multiplier", o.im[k], k ? -row[i].im : row[i].im, row[i].accuracy, why);
    }
    check_close ("determinant", o.re[0] * o.re[1] - o.im[0] * o.im[1], 1, 1e-7, "no damping (Liouville)");
    pw_periodic_close (x);
    pw_system_free (s);
  }
}

/* At the boundaries period doubles, or branches with the period of the forcing begin. */
TEST (boundaries) {
  pw_system *s = mathieu_at (NULL, 3, NULL);
  const double end[] = { -0.3, 4.2 },
               exact[][2] = { { 1.8591080725143634, -0.11024881699209521 }, { 3.917024772998471 } };
  for (int i = 0; i < 2; i++) {
    pw_periodic_event event = i ? PW_PERIODIC_REAL : PW_PERIODIC_FLIP;
    pw_periodic_settings set = { .period = PW_PI, .compile = mathieu_at, .first = 3, .last = end[i] };
    pw_periodic *x = periodic_open (s, &set);
    periodic_solve (x, 0, 3);
    branch_events e = periodic_follow (x);
    assert_int_equal (e.count[event], 2 - i);
    for (int k = 0; k < 2 - i; k++)
      check_close ("boundary", e.at[event][k], exact[i][k], 1e-6, "1e-7 of a step; a double root");
    pw_periodic_close (x);
  }
  pw_system_free (s);
}

static pw_system *growing_at (void *context, double p, pw_error *error) {
  (void)context, (void)error;
  return scene_system (&oscillator_build_table, "p", p, "c", 1., NULL);
}

/* Rest of the undriven oscillator, seen with any period: multipliers exp ((p / 2 +- i w) T). */
TEST (torus) {
  pw_system *s = growing_at (NULL, -0.5, NULL);
  pw_periodic_settings set = { .period = 2, .compile = growing_at, .first = -0.5, .last = 0.5 };
  pw_periodic *x = periodic_open (s, &set);
  pw_periodic_orbit o = periodic_solve (x, 0, -0.5);
  double w = sqrt (1 - 1 / 16.);
  periodic_expect (&o, 0, exp (-0.5) * cos (2 * w), exp (-0.5) * sin (2 * w));
  branch_events e = periodic_follow (x);
  assert_int_equal (e.count[PW_PERIODIC_TORUS], 1);
  check_close ("crossing", e.at[PW_PERIODIC_TORUS][0], 0, 1e-7, "1e-7 of a step");
  pw_periodic_close (x);
  pw_system_free (s);
}

/* Van der Pol's oscillator: the period by other authors' digits, the multiplier by Liouville's formula. */
TEST (van_der_pol) {
  enum { SAMPLES = 800 };
  pw_error error = { 0 };
  pw_periodic_orbit o;
  double sum = 0;
  pw_system *s = scene_system (&oscillator_build_table, "p", 1., "c", 1., "x", 2., NULL);
  for (int given = 0; given < 2; given++) {
    pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .free = 1, .period = given * 6 });
    o = periodic_solve (x, given ? 10 : 0, 0);
    check_close ("period", o.period, 6.66328686, 1e-8, "the digits given");
    assert_int_equal (o.trivial, 1);
    check_close ("trivial multiplier", o.re[1], 1, 1e-7, "steps of the derivatives");
    pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-11 });
    check_ok (pw_run_restart (r, o.q, o.v, &error), &error);
    sum = 0;
    for (int i = 0; i < SAMPLES; i++) {
      double angle = runs_to (r, i * o.period / SAMPLES).q[2];
      sum += (1 - angle * angle) * o.period / SAMPLES;
    }
    periodic_expect (&o, 0, exp (sum), 0);
    pw_run_close (r);
    pw_periodic_close (x);
  }
  pw_system_free (s);
  s = scene_system (&oscillator_build_table, "p", -1., "c", 1., "x", 0.1, NULL); /* decays */
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .free = 1, .period = 6 });
  assert_int_equal (pw_periodic_solve (x, 10, 0, &o, &error), PW_RETRY);
  assert_int_equal (error.status, PW_OK);
  assert_string_equal (pw_periodic_reason (x), "Newton's method leads to a steady motion or an equilibrium");
  pw_periodic_close (x);
  pw_system_free (s);
}

/* The same motion in a scene of 10 micrometres. */
TEST (small) {
  pw_system *s = scene_system (&oscillator_build_table, "p", 1., "c", 1., "x", 2., "mass", 1e10, NULL);
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .free = 1, .period = 6 });
  check_close ("period", periodic_solve (x, 10, 0).period, 6.66328686, 1e-8, "the digits given");
  pw_periodic_close (x);
  pw_system_free (s);
}

static pw_system *van_der_pol_at (void *context, double p, pw_error *error) {
  (void)context, (void)error;
  return scene_system (&oscillator_build_table, "p", p, "c", p, "x", 2., NULL);
}

/* Motions with 70 steps do not limit those of others; a second branch begins where the first one did, whose period has
 * grown to five times. */
TEST (again) {
  pw_error error = { 0 };
  pw_periodic_orbit o;
  pw_system *s = van_der_pol_at (NULL, 1, NULL);
  pw_periodic_settings set = { .free = 1, .compile = van_der_pol_at, .first = 0.1, .last = 20, .points = 5 };
  pw_periodic *x = periodic_open (s, &set);
  assert_int_equal (pw_periodic_follow (x, 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "no motion has been found from which to follow a branch");
  assert_int_equal (pw_periodic_next (x, &o, &(pw_error){ 0 }), PW_OK);
  assert_int_equal (o.event, PW_PERIODIC_END);
  periodic_solve (x, 1, 0.1);
  pw_periodic_solve (x, 1, 60, &o, &(pw_error){ 0 });
  assert_true (isfinite (o.residual));
  double begin = periodic_solve (x, 1, 1).period;
  assert_true (periodic_follow (x).last == 20 && x->last_period > 4 * begin);
  error = (pw_error){ 0 };
  check_ok (pw_periodic_follow (x, -1, &error), &error);
  check_ok (pw_periodic_next (x, &o, &error), &error);
  check_close ("period", o.period, begin, 1e-13, "that of the first branch");
  x->begin_period = 0; /* as after a search without result */
  assert_int_equal (pw_periodic_follow (x, -1, &(pw_error){ 0 }), PW_INPUT);
  check_ok (pw_periodic_next (x, &o, &error), &error);
  assert_int_equal (o.event, PW_PERIODIC_END);
  pw_periodic_close (x);
  pw_system_free (s);
}

/* ---- Periods and refusals ---- */

TEST (refused) {
  pw_error error = { 0 };
  pw_system *s = gallery_open ("snakeboard", NULL);
  check_close ("period", pw_system_period (s), 2, 1e-14, "2 pi / omega");
  assert_null (pw_periodic_open (s, &(pw_periodic_settings){ .period = 1.9 }, &error));
  check_error (
      &error, PW_INPUT,
      "model snakeboard: signal swing.value does not repeat after 1.9 s; if no period is given, that of the harmonic "
      "signals and pulses is used");
  error = (pw_error){ 0 };
  assert_null (pw_periodic_open (s, &(pw_periodic_settings){ .free = 1 }, &error));
  check_error (&error, PW_INPUT,
               "model snakeboard: signal swing.value changes with time, so the period cannot be free");
  error = (pw_error){ 0 };
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = 4 });
  assert_int_equal (pw_periodic_follow (x, 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "first = last = 0: expected a range");
  error = (pw_error){ 0 };
  pw_periodic_close (x);
  pw_system_free (s);
  s = mathieu_at (NULL, 1, NULL);
  check_close ("period", pw_system_period (s), 0, 0, "a function has none that is known");
  assert_null (pw_periodic_open (s, &(pw_periodic_settings){ .period = 0 }, &error));
  check_error (&error, PW_INPUT, "model scene: no signal has a known period: a period is needed");
  pw_system_free (s);
}

static pw_system *mathieu_with_error (void *context, double a, pw_error *error) {
  pw_fail (error, PW_INPUT, "a = %g is refused", a);
  return mathieu_at (context, a, error);
}

static int stop_at_once (void *context) {
  (void)context;
  return 1;
}

/* An error that `compile` records counts, whatever it returns; a stop is the reason of PW_RETRY. */
TEST (compile_and_stop) {
  pw_error error = { 0 };
  pw_periodic_orbit o;
  pw_system *s = mathieu_at (NULL, 1, NULL);
  const pw_periodic_settings wrong = { .period = PW_PI, .compile = mathieu_with_error, .first = 1, .last = 2 };
  assert_null (pw_periodic_open (s, &wrong, &error));
  check_error (&error, PW_INPUT, "a = 1 is refused");
  assert_null (
      pw_steady_open (s, &(pw_steady_settings){ .compile = mathieu_with_error, .vary = -1 }, &(pw_error){ 0 }));
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = PW_PI, .stop = stop_at_once });
  for (int settle = 0; settle < 2; settle++) {
    assert_int_equal (pw_periodic_solve (x, settle, 0, &o, &error), PW_RETRY);
    assert_string_equal (pw_periodic_reason (x), "stopped");
  }
  pw_periodic_close (x);
  pw_system_free (s);
}

/* Settings and arguments out of range are named. */
TEST (settings) {
  static const struct {
    pw_periodic_settings set;
    const char *text;
  } wrong[] = {
    { { .rtol = -1 }, "setting rtol = -1: expected a number > 0" },
    { { .period = -1 }, "setting period = -1: expected a number > 0" },
    { { .period = NAN }, "setting period = nan: expected a number > 0" },
    { { .periods = -1 }, "setting periods = -1: expected a number > 0" },
    { { .points = -2 }, "setting points = -2: expected a number > 0" },
    { { .last = INFINITY }, "settings first = 0, last = inf: expected finite numbers" },
  };
  pw_system *s = gallery_open ("snakeboard", NULL);
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    pw_error error = { 0 };
    assert_null (pw_periodic_open (s, &wrong[i].set, &error));
    check_error (&error, PW_INPUT, wrong[i].text);
  }
  pw_error e[2] = { { 0 } };
  pw_periodic_orbit o;
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = 4 });
  assert_int_equal (pw_periodic_solve (x, -1, 0, &o, &e[0]), PW_INPUT);
  check_error (&e[0], PW_INPUT, "settle = -1: expected a number >= 0");
  assert_int_equal (pw_periodic_follow (x, 0, &e[1]), PW_INPUT);
  check_error (&e[1], PW_INPUT, "direction = 0: expected 1 or -1");
  pw_periodic_close (x);
  pw_system_free (s);
}

/* A search that could not be opened is refused. */
TEST (missing) {
  pw_error e[5] = { { 0 } };
  pw_periodic_orbit o;
  assert_null (pw_periodic_open (NULL, &(pw_periodic_settings){ .period = 1 }, &e[0]));
  check_error (&e[0], PW_INPUT, "a system is missing");
  pw_system *s = mathieu_at (NULL, 1, NULL);
  assert_null (pw_periodic_open (s, NULL, &e[1]));
  check_error (&e[1], PW_INPUT, "settings is missing");
  assert_null (pw_periodic_open (s, &(pw_periodic_settings){ .method = "x" }, NULL)); /* no error is wanted */
  pw_system_free (s);
  assert_int_equal (pw_periodic_solve (NULL, 0, 0, &o, &e[2]), PW_INPUT);
  assert_int_equal (pw_periodic_follow (NULL, 1, &e[3]), PW_INPUT);
  assert_int_equal (pw_periodic_next (NULL, &o, &e[4]), PW_INPUT);
  for (int i = 2; i < 5; i++) check_error (&e[i], PW_INPUT, "a search is missing");
  assert_string_equal (pw_periodic_reason (NULL), "");
  assert_int_equal (pw_periodic_symmetries (NULL), 0);
}
