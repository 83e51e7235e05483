/* First-order states and feedback on velocity constraints, in text models, against independent digits.
 *
 * References: reduced equations of the same vehicles, integrated by extrapolation with 30 digits, and the same in
 * redundant coordinates by another code; both agree to 2e-13. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "pinwheel-analysis.h"
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* A car whose rear axle is the point R: steered by its position; by an actuator with a lag. */
#define CAR                                                                                            \
  "pinwheel: 1\n"                                                                                      \
  "let: {a: 0.6, b: 0.4, k: 0.5, kr: 0.3, tau: 0.2, phi0: 0.3}\n"                                      \
  "bodies:\n"                                                                                          \
  "  - {name: car, mass: 2, inertia: 0.5, start: {x: b*cos (phi0), y: 1 + b*sin (phi0), phi: phi0}}\n" \
  "elements:\n"                                                                                        \
  "  - {wheel: R, body: car, at: [-b, 0]}\n"                                                           \
  "  - {speed: X, body: car, at: [-b, 0], value: 1}\n"
static const char steered[] =
    CAR "  - {steered-wheel: F, body: car, at: [a, 0], heading: \"-atan (k*(car.y - b*sin (car.phi))) - car.phi\"}\n";
static const char lagging[] =
    CAR "  - {steered-wheel: F, body: car, at: [a, 0], heading: delta}\n"
        "states:\n"
        "  - {name: delta, unit: rad, rate: \"(-atan (k*(car.y - b*sin (car.phi))) - car.phi - kr*car.omega - "
        "delta)/tau\"}\n";

/* A knife edge with PI control of the yaw rate. */
static const char sleigh[] = "pinwheel: 1\n"
                             "bodies:\n"
                             "  - {name: car, mass: 1, inertia: 0.2, rate: {vx: 1}}\n"
                             "elements:\n"
                             "  - {wheel: R, body: car, at: [-0.3, 0]}\n"
                             "  - {torque: T, body: [car, ground], value: 2*(0.5 - car.omega) + z}\n"
                             "states:\n"
                             "  - {name: z, rate: 0.5 - car.omega, unit: rad}\n";

/* A robot that follows the wall y = sin x by its yaw rate. */
static const char follower[] = "pinwheel: 1\n"
                               "bodies:\n"
                               "  - {name: car, mass: 2, inertia: 0.1, start: {x: 0, y: 1, phi: 0}}\n"
                               "elements:\n"
                               "  - {wheel: R, body: car, at: [0, 0]}\n"
                               "  - {speed: X, body: car, at: [0, 0], value: 1}\n"
                               "  - pfaffian: yaw\n"
                               "    body: [car, ground]\n"
                               "    a: [0, 0, 1]\n"
                               "    value: 4*(atan (cos (car.x)) - atan (car.y - 0.5 - sin (car.x)) - car.phi)\n";

/* ---- Scenes ---- */

typedef struct {
  pw_file *file;
  pw_model *model;
  pw_system *s;
  pw_error error;
} scene;

static scene scene_open (const char *text) {
  const char *build = getenv ("BUILD");
  char path[64];
  scene x = { 0 };
  snprintf (path, sizeof path, "%.30s/states_%d.yaml", build ? build : "build", (int)getpid ());
  FILE *f = fopen (path, "w");
  assert_non_null (f);
  fputs (text, f);
  fclose (f);
  x.file = pw_file_open (path, &x.error);
  x.model = x.file ? pw_file_model (x.file, &x.error) : NULL;
  if (x.model && pw_model_build (x.model, &x.error) == PW_OK) x.s = pw_system_compile (x.model, &x.error);
  remove (path);
  check_ok (x.error.status, &x.error);
  return x;
}

static void scene_close (scene *x) {
  pw_system_free (x->s);
  pw_model_free (x->model);
  pw_file_close (x->file);
}

static pw_run *scene_run (scene *x, const char *method, const pw_settings *settings) {
  pw_run *r = pw_run_open (x->s, method, settings, &x->error);
  check_ok (x->error.status, &x->error);
  return r;
}

static pw_sample scene_advance (scene *x, pw_run *r, double t) {
  pw_sample sample;
  while (pw_run_time (r) < t) check_ok (pw_run_advance (r, t, &x->error), &x->error);
  check_ok (pw_run_sample (r, t, &sample, &x->error), &x->error);
  return sample;
}

/* ---- Motions ---- */

typedef struct {
  const char *name; /* of a state, or of a reaction */
  double value;
} expected;

static void compare (const char *text, const char *method, double t, const expected *list) {
  scene x = scene_open (text);
  pw_run *r = scene_run (&x, method, &(pw_settings){ .rtol = 1e-11, .span = t });
  const pw_sample end = scene_advance (&x, r, t);
  const int n = pw_system_coordinates (x.s);
  for (const expected *e = list; e->name; e++) {
    const int state = pw_system_find_state (x.s, e->name, NULL);
    const double value = state < 0   ? -end.lambda[pw_system_find_reaction (x.s, e->name, &x.error)]
                         : state < n ? end.q[state]
                                     : end.v[state - n];
    check_close (check_text ("%s: %s", method, e->name), value, e->value, 1e-8,
                 "five times the largest error seen, 2.0e-9 of a reaction with bdf");
  }
  pw_run_close (r);
  scene_close (&x);
}

static const char *const methods[] = { "rk4+projection", "erk8", "bdf+projection", "ida+ggl", "radau", NULL };
#define EXPECT(text, t, ...) \
  for (const char *const *m = methods; *m; m++) compare (text, *m, t, (const expected[]){ __VA_ARGS__, { NULL, 0 } })

TEST (position_feedback) {
  EXPECT (steered, 2, { "car.phi", -0.3275798218145923 }, { "car.omega", -0.008938915889967245 },
          { "X.F", -0.001116245452704434 }, { "R.N", -0.01377242622118368 }, { "F.N", 0.1177283837854947 });
}

TEST (actuator) {
  EXPECT (lagging, 1, { "car.phi", -0.1252454700311632 }, { "delta", -0.3333557512994809 },
          { "car.omega", -0.3462786553956557 }, { "X.F", -0.09811896975224645 }, { "R.N", -0.4224454263740811 });
}

TEST (integral_control) {
  EXPECT (sleigh, 5, { "car.x", 1.166661059 }, { "car.y", 4.40253730653 }, { "car.omega", 0.486864505218 },
          { "z", 0.168469703157 }, { "R.N", 0.648324645443 });
}

TEST (wall_follower) {
  EXPECT (follower, 5, { "car.x", 4.08789517032 }, { "car.y", -0.350645861085 }, { "car.omega", 0.430413466351 },
          { "R.N", 0.860826932701 }, { "yaw.F", 0.0593363846571 });
}

/* ---- Analyses ---- */

/* A straight drive at the speed V = 1, L = 1: y' = phi, phi' = delta, delta' = (-k y - phi - kr delta - delta)/tau. */
TEST (linearisation) {
  scene x = scene_open (lagging);
  pw_linear l;
  const pw_initial_value straight[] = { { 0, 0.4 }, { 1, 0 }, { 2, 0 } };
  pw_run *r = scene_run (&x, "rk4", &(pw_settings){ .initial = straight, .initials = 3 });
  check_ok (pw_run_linearise (r, 100, &l, &x.error), &x.error);
  assert_int_equal (l.unknowns, 4); /* x, y, phi and delta: not the integral of delta */
  /* mu^3 + p mu^2 + q mu + c of the equations above */
  const double tau = 0.2, p = (1 + 0.3) / tau, q = 1 / tau, c = 0.5 / tau;
  const char *reason = "forty times the error seen, round-off of mu^3 with |mu| = 5.7";
  int tested = 0;
  for (int i = 0; i < l.unknowns; i++) {
    const double re = l.re[i], im = l.im[i];
    if (hypot (re, im) == 0) continue; /* x */
    const double re2 = re * re - im * im, im2 = 2 * re * im, re3 = re2 * re - im2 * im, im3 = re2 * im + im2 * re;
    check_close ("real part", re3 + p * re2 + q * re + c, 0, 1e-11, reason);
    check_close ("imaginary part", im3 + p * im2 + q * im, 0, 1e-11, reason);
    tested++;
  }
  assert_int_equal (tested, 3);
  pw_linear_free (&l);
  pw_run_close (r);
  scene_close (&x);
}

/* ---- Names; held inputs; what is refused; checkpoints ---- */

TEST (names) {
  scene x = scene_open (sleigh);
  char text[PW_NAME_BYTES];
  const int n = pw_system_coordinates (x.s), z = pw_system_find_state (x.s, "z", &x.error);
  assert_int_equal (pw_system_states (x.s), 1);
  assert_int_equal (z, 2 * n - 1);
  assert_string_equal (pw_system_state_name (x.s, z, text, sizeof text), "z");
  assert_string_equal (pw_system_state_unit (x.s, z), "rad");
  assert_true (pw_system_state_hidden (x.s, n - 1));
  assert_false (pw_system_state_hidden (x.s, z));
  assert_true (pw_system_find_state (x.s, "z.integral", &x.error) < 0);
  check_close ("kinetic energy without the state", pw_system_mass (x.s)[n - 1], 0, 0, "exact");
  scene_close (&x);
}

/* Held inputs: forces keep their values in a step, rates of states do not.  For z' = cos 5t, rk4 is Simpson's rule,
 * with an error of h^4/2880 times the fourth derivative of the rate, 5^4; held rates give 5e-3. */
TEST (held_inputs) {
  scene x = scene_open ("pinwheel: 1\n"
                        "bodies: [{name: a, mass: 1, inertia: 1}]\n"
                        "states: [{name: z, rate: cos (5*t)}]\n");
  pw_run *r = scene_run (&x, "rk4+projection:inputs=held", &(pw_settings){ .step = 1e-2 });
  const pw_sample end = scene_advance (&x, r, 1);
  check_close ("z", end.v[pw_system_coordinates (x.s) - 1], sin (5) / 5, 1e-8 / 2880 * 625, "error of Simpson's rule");
  pw_run_close (r);
  scene_close (&x);
}

TEST (leapfrog_refuses) {
  scene x = scene_open (lagging);
  assert_null (pw_run_open (x.s, "leapfrog", NULL, &x.error));
  check_error (&x.error, PW_INPUT,
               "leapfrog: the signal of a constraint depends on the first-order state delta; use galpha or rk4");
  scene_close (&x);
}

/* A loaded run continues bit for bit; the state is part of what is saved. */
TEST (checkpoint) {
  scene x = scene_open (lagging);
  pw_archive a = { 0 };
  double end[2];
  pw_run *run[] = { scene_run (&x, "erk8", NULL), scene_run (&x, "erk8", NULL) };
  scene_advance (&x, run[0], 1);
  check_ok (pw_run_save (run[0], &a, &x.error), &x.error);
  a.size = a.used, a.used = 0, a.loading = 1;
  check_ok (pw_run_load (run[1], &a, &x.error), &x.error);
  for (int i = 0; i < 2; i++) {
    end[i] = scene_advance (&x, run[i], 2).v[pw_system_coordinates (x.s) - 1];
    pw_run_close (run[i]);
  }
  check_bits ("delta", &end[0], &end[1], 1);
  pw_archive_free (&a);
  scene_close (&x);
}
