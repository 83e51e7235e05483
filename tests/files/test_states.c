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

/* ---- Opening ---- */

static char path[64];

static void open_model (const char *text, pw_file **file, pw_model **model, pw_system **s, pw_error *error) {
  const char *build = getenv ("BUILD");
  snprintf (path, sizeof path, "%.30s/states_%d.yaml", build ? build : "build", (int)getpid ());
  FILE *f = fopen (path, "w");
  assert_non_null (f);
  fputs (text, f);
  fclose (f);
  *file = pw_file_open (path, error), *model = *file ? pw_file_model (*file, error) : NULL, *s = NULL;
  if (*model && pw_model_build (*model, error) == PW_OK) *s = pw_system_compile (*model, error);
  remove (path);
}

static void close_model (pw_file *file, pw_model *model, pw_system *s) {
  pw_system_free (s);
  pw_model_free (model);
  pw_file_close (file);
}

/* ---- Motions ---- */

typedef struct {
  const char *name; /* of a state, or of a reaction */
  double value;
} expected;

static void compare (const char *text, const char *method, double t, const expected *list) {
  pw_error error = { 0 };
  pw_file *file;
  pw_model *model;
  pw_system *s;
  pw_sample x;
  const pw_settings settings = { .rtol = 1e-11, .span = t };
  open_model (text, &file, &model, &s, &error);
  check_ok (error.status, &error);
  pw_run *r = pw_run_open (s, method, &settings, &error);
  check_ok (error.status, &error);
  while (pw_run_time (r) < t) check_ok (pw_run_advance (r, t, &error), &error);
  check_ok (pw_run_sample (r, t, &x, &error), &error);
  const int n = pw_system_coordinates (s);
  for (const expected *e = list; e->name; e++) {
    const int state = pw_system_find_state (s, e->name, NULL);
    const double value = state < 0   ? -x.lambda[pw_system_find_reaction (s, e->name, &error)]
                         : state < n ? x.q[state]
                                     : x.v[state - n];
    check_close (check_text ("%s: %s", method, e->name), value, e->value, 1e-8, "ten times the error seen with bdf");
  }
  pw_run_close (r);
  close_model (file, model, s);
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
  pw_error error = { 0 };
  pw_file *file;
  pw_model *model;
  pw_system *s;
  pw_linear l;
  open_model (lagging, &file, &model, &s, &error);
  check_ok (error.status, &error);
  const pw_initial_value straight[] = { { 0, 0.4 }, { 1, 0 }, { 2, 0 } };
  const pw_settings settings = { .initial = straight, .initials = 3 };
  pw_run *r = pw_run_open (s, "rk4", &settings, &error);
  check_ok (error.status, &error);
  check_ok (pw_run_linearise (r, 100, &l, &error), &error);
  assert_int_equal (l.unknowns, 4); /* y, phi, x and delta: not the integral of delta */
  /* mu^3 + p mu^2 + q mu + c of the equations above */
  const double tau = 0.2, p = (1 + 0.3) / tau, q = 1 / tau, c = 0.5 / tau;
  for (int i = 0; i < l.unknowns; i++) {
    const double re = l.re[i], im = l.im[i];
    if (hypot (re, im) < 1e-9) continue;
    const double re2 = re * re - im * im, im2 = 2 * re * im, re3 = re2 * re - im2 * im, im3 = re2 * im + im2 * re;
    check_close ("real part", re3 + p * re2 + q * re + c, 0, 1e-8, "differences of the signal's gradient");
    check_close ("imaginary part", im3 + p * im2 + q * im, 0, 1e-8, "differences of the signal's gradient");
  }
  pw_linear_free (&l);
  pw_run_close (r);
  close_model (file, model, s);
}

/* ---- What is refused, and names ---- */

TEST (names) {
  pw_error error = { 0 };
  pw_file *file;
  pw_model *model;
  pw_system *s;
  char text[PW_NAME_BYTES];
  open_model (sleigh, &file, &model, &s, &error);
  check_ok (error.status, &error);
  const int n = pw_system_coordinates (s), z = pw_system_find_state (s, "z", &error);
  assert_int_equal (z, 2 * n - 1);
  assert_string_equal (pw_system_state_name (s, z, text, sizeof text), "z");
  assert_string_equal (pw_system_state_unit (s, z), "rad");
  assert_true (pw_system_state_hidden (s, n - 1));
  assert_false (pw_system_state_hidden (s, z));
  assert_true (pw_system_find_state (s, "z.integral", &error) < 0);
  check_close ("kinetic energy without the state", pw_system_mass (s)[n - 1], 0, 0, "exact");
  close_model (file, model, s);
}

TEST (leapfrog_refuses) {
  pw_error error = { 0 };
  pw_file *file;
  pw_model *model;
  pw_system *s;
  open_model (lagging, &file, &model, &s, &error);
  assert_null (pw_run_open (s, "leapfrog", NULL, &error));
  check_error (&error, PW_INPUT,
               "leapfrog: the signal of a constraint depends on the first-order state delta; use galpha or rk4");
  close_model (file, model, s);
}

/* A loaded run continues bit for bit; the state is part of what is saved. */
TEST (checkpoint) {
  pw_error error = { 0 };
  pw_file *file;
  pw_model *model;
  pw_system *s;
  pw_archive a = { 0 };
  pw_sample x;
  double end[2] = { 0 };
  open_model (lagging, &file, &model, &s, &error);
  pw_run *first = pw_run_open (s, "erk8", NULL, &error), *second = pw_run_open (s, "erk8", NULL, &error);
  check_ok (error.status, &error);
  while (pw_run_time (first) < 1) check_ok (pw_run_advance (first, 1, &error), &error);
  check_ok (pw_run_save (first, &a, &error), &error);
  a.size = a.used, a.used = 0, a.loading = 1;
  check_ok (pw_run_load (second, &a, &error), &error);
  for (int i = 0; i < 2; i++) {
    pw_run *r = i ? second : first;
    while (pw_run_time (r) < 2) check_ok (pw_run_advance (r, 2, &error), &error);
    check_ok (pw_run_sample (r, 2, &x, &error), &error);
    end[i] = x.v[pw_system_coordinates (s) - 1];
    pw_run_close (r);
  }
  check_bits ("delta", &end[0], &end[1], 1);
  pw_archive_free (&a);
  close_model (file, model, s);
}
