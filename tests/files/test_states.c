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

/* A car with PI control of its speed and a prescribed steering angle. */
static const char cruise[] = "pinwheel: 1\n"
                             "bodies: [{name: car, mass: 1000, inertia: 1500, rate: {vx: 2, vy: 0, omega: 0}}]\n"
                             "elements:\n"
                             "  - {wheel: R, body: car, at: [-1.4, 0]}\n"
                             "  - {steered-wheel: F, body: car, at: [1.2, 0], heading: 0.1*sin (t)}\n"
                             "  - {force: D, body: car, at: [-1.4, 0], axes: body, fx: drive - 50*speed}\n"
                             "outputs:\n"
                             "  - {name: speed, value: car.vx*cos (car.phi) + car.vy*sin (car.phi)}\n"
                             "  - {name: drive, value: 800*(10 - speed) + 200*z}\n"
                             "states: [{name: z, rate: 10 - speed}]\n";

/* A cart with a pendulum and a PID controller whose derivative is filtered. */
static const char balance[] =
    "pinwheel: 1\n"
    "bodies:\n"
    "  - {name: cart, mass: 1, inertia: 1}\n"
    "  - {name: arm, mass: 0.3, inertia: 0.01, start: {x: 0.4*sin (0.2), y: -0.4*cos (0.2), phi: 0.2}}\n"
    "elements:\n"
    "  - {slider: S, body: [cart, ground], at: [[0, 0], [0, 0]]}\n"
    "  - {pin: P, body: [cart, arm], at: [[0, 0], [0, 0.4]]}\n"
    "  - {gravity: g, acceleration: [0, -9.81]}\n"
    "  - {force: F, body: cart, at: [0, 0], fx: push - 0.5*cart.vx}\n"
    "outputs:\n"
    "  - {name: lack, value: 0.3 - cart.x}\n"
    "  - {name: push, value: 10*lack + 3*z + 3*(lack - w)/0.1}\n"
    "states: [{name: z, rate: lack}, {name: w, rate: (lack - w)/0.1}]\n";

/* A motor with inductance on a shaft with two inertias. */
static const char motor[] = "pinwheel: 1\n"
                            "bodies: [{name: a, mass: 1, inertia: 0.01}, {name: b, mass: 1, inertia: 0.03}]\n"
                            "elements:\n"
                            "  - {pin: A, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {pin: B, body: [b, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {torque: M, body: [a, ground], value: 0.2*i}\n"
                            "  - {torque: K, body: [a, b], value: 5*(b.phi - a.phi) + 0.02*(b.omega - a.omega)}\n"
                            "  - {torque: C, body: [b, ground], value: -0.01*b.omega}\n"
                            "states: [{name: i, rate: (12*sin (t) - i - 0.2*a.omega)/0.05, unit: A}]\n";

/* A tractor that reverses two trailers by feedback of the hitch angles. */
static const char reversing[] =
    "pinwheel: 1\n"
    "let:\n"
    "  x1: -0.2 - 1.5*cos (0.1)\n"
    "  y1: -1.5*sin (0.1)\n"
    "  x2: x1 - 0.1*cos (0.1) - 1.2*cos (0.25)\n"
    "  y2: y1 - 0.1*sin (0.1) - 1.2*sin (0.25)\n"
    "bodies:\n"
    "  - {name: t0, mass: 5, inertia: 1, start: {x: 0.4, y: 0, phi: 0}}\n"
    "  - {name: t1, mass: 3, inertia: 0.5, start: {x: x1 + 0.2*cos (0.1), y: y1 + 0.2*sin (0.1), phi: 0.1}}\n"
    "  - {name: t2, mass: 2, inertia: 0.4, start: {x: x2 + 0.3*cos (0.25), y: y2 + 0.3*sin (0.25), phi: 0.25}}\n"
    "elements:\n"
    "  - {wheel: R0, body: t0, at: [-0.4, 0]}\n"
    "  - {speed: X, body: t0, at: [-0.4, 0], value: -1}\n"
    "  - {steered-wheel: F, body: t0, at: [0.6, 0], heading: -3*(t1.phi - t0.phi) + 5*(t2.phi - t1.phi)}\n"
    "  - {wheel: R1, body: t1, at: [-0.2, 0]}\n"
    "  - {wheel: R2, body: t2, at: [-0.3, 0]}\n"
    "  - {pin: H1, body: [t1, t0], at: [[1.3, 0], [-0.6, 0]]}\n"
    "  - {pin: H2, body: [t2, t1], at: [[0.9, 0], [-0.3, 0]]}\n";

/* A car with relaxation of its tyres and a steering that lags. */
static const char tyres[] =
    "pinwheel: 1\n"
    "bodies: [{name: car, mass: 1500, inertia: 2500, rate: {vx: 20}}]\n"
    "elements:\n"
    "  - {speed: X, body: car, at: [0, 0], value: 20}\n"
    "  - {force: front, body: car, at: [1.2, 0], axes: body, fx: -f*sin (delta), fy: f*cos (delta)}\n"
    "  - {force: rear, body: car, at: [-1.4, 0], axes: body, fx: 0, fy: r}\n"
    "outputs:\n"
    "  - {name: across, value: -car.vx*sin (car.phi) + car.vy*cos (car.phi)}\n"
    "states:\n"
    "  - {name: delta, rate: (0.05 - delta)/0.05, unit: rad}\n"
    "  - {name: f, rate: (-60000*(atan ((across + 1.2*car.omega)/20) - delta) - f)*20/0.4, unit: N}\n"
    "  - {name: r, rate: (-80000*atan ((across - 1.4*car.omega)/20) - r)*20/0.4, unit: N}\n";

/* A tractor with n trailers, each hitched to the axle ahead. */
static const char trailers[] = "pinwheel: 1\n"
                               "parameters: [{name: n, value: 4, domain: count}]\n"
                               "bodies:\n"
                               "  - {name: b0, mass: 1, inertia: 0.1}\n"
                               "  - {repeat: {i: n}, name: \"b{i}\", mass: 1, inertia: 0.1, start: {x: -0.7*i}}\n"
                               "elements:\n"
                               "  - {wheel: W0, body: b0, at: [0, 0]}\n"
                               "  - {speed: X, body: b0, at: [0, 0], value: 1}\n"
                               "  - {pfaffian: turn, body: [b0, ground], a: [0, 0, 1], value: 0.3*sin (t)}\n"
                               "  - repeat: {i: n}\n"
                               "    list:\n"
                               "      - {wheel: \"W{i}\", body: \"b{i}\", at: [0, 0]}\n"
                               "      - {pin: \"H{i}\", body: [\"b{i}\", \"b{i - 1}\"], at: [[0.7, 0], [0, 0]]}\n";

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
    check_close (check_text ("%s: %s", method, e->name), value, e->value, 1e-8 * fmax (1, fabs (e->value)),
                 "five times the largest error seen, 2.0e-9 of a reaction with bdf; the references have 12 digits");
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

TEST (cruise_control) {
  EXPECT (cruise, 5, { "car.x", 40.1201820626 }, { "car.y", 15.7594497044 }, { "car.omega", -0.401668082368 },
          { "z", 6.10933021237 });
}

TEST (filtered_derivative) {
  EXPECT (balance, 2, { "cart.x", 0.245001479707 }, { "arm.phi", -0.086379536472 }, { "arm.omega", 1.6450768382 },
          { "z", -0.0167281776819 }, { "w", 0.0277257042773 });
}

TEST (motor_current) {
  EXPECT (motor, 4, { "a.phi", 85.5362444714 }, { "b.phi", 85.775837773 }, { "a.omega", -5.8208683567 },
          { "i", -7.88370192856 });
}

TEST (reversing_trailers) {
  EXPECT (reversing, 3, { "t0.phi", 0.320424905003 }, { "t1.phi", 0.396063374584 }, { "t2.phi", 0.423833909881 },
          { "X.F", -0.00131085112753 });
}

TEST (tyre_relaxation) {
  EXPECT (tyres, 0.5, { "car.x", 9.99657228848 }, { "car.y", 0.214464960147 }, { "car.omega", 0.238645450076 },
          { "f", 3176.35759453 }, { "r", 2710.93880027 }, { "X.F", 288.814648327 });
}

TEST (repeated_trailers) {
  EXPECT (trailers, 10, { "b0.x", 9.2823078626 }, { "b4.x", 6.72158951957 }, { "b4.y", 1.94906288537 },
          { "b4.phi", 0.257709743356 }, { "X.F", 0.0357711174008 }, { "turn.F", -0.0251721458723 });
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
