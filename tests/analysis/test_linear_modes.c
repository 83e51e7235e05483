/* The matrices and mode shapes of a linearisation against runs with small perturbations and harmonic torques, and
 * closed forms. */
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

enum { MOST = 40 }; /* unknowns, states */

typedef struct {
  pw_system *s;
  pw_linear l;
  int n;         /* coordinates */
  double length; /* L */
} modes;

static modes modes_of (pw_system *s) {
  pw_error error = { 0 };
  modes x = { .s = s, .n = pw_system_coordinates (s), .length = pw_system_length (s) };
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  check_ok (pw_run_linear_modes (r, 100, &x.l, &error), &error);
  assert_true (x.l.unknowns <= MOST && 2 * x.n <= MOST);
  pw_run_close (r);
  return x;
}

static void modes_close (modes *x) {
  pw_linear_free (&x->l);
  pw_system_free (x->s);
}

/* ---- Runs ---- */

/* The state at time t of a run from the initial state plus eps times a perturbation, in the axes of the frame. */
static void modes_run (const modes *x, pw_system *s, double eps, const double *perturbation, double t, double *out) {
  pw_error error = { 0 };
  pw_sample sample;
  double q[MOST];
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .span = t, .step = 1e-3 });
  memcpy (q, pw_run_initial (r)->q, (size_t)x->n * sizeof *q);
  memcpy (q + x->n, pw_run_initial (r)->v, (size_t)x->n * sizeof *q);
  for (int j = 0; perturbation && j < 2 * x->n; j++) q[j] += eps * perturbation[j];
  if (perturbation) check_ok (pw_run_restart (r, q, q + x->n, &error), &error);
  check_ok (pw_run_advance_to (r, t, t, &error), &error);
  check_ok (pw_run_sample (r, t, &sample, &error), &error);
  memcpy (out, sample.q, (size_t)x->n * sizeof *out);
  memcpy (out + x->n, sample.v, (size_t)x->n * sizeof *out);
  pw_run_close (r);
  double c = cos (x->l.twist[2] * t), sine = sin (x->l.twist[2] * t);
  for (int j = 0; j < 2 * x->n; j += 3) {
    double u = out[j], v = out[j + 1];
    out[j] = c * u + sine * v;
    out[j + 1] = c * v - sine * u;
  }
}

/* y' = A y + B u(t) by RK4; u is cos (omega t), the second of two signals, if omega > 0. */
static void modes_solve (const pw_linear *l, double *y, double omega, double t) {
  enum { STEPS = 2000 };
  double h = t / STEPS;
  int n = l->unknowns;
  for (int i = 0; i < STEPS; i++) {
    double k[5][MOST] = { { 0 } }, at[MOST];
    for (int stage = 1; stage <= 4; stage++) {
      double part = stage == 1 ? 0 : stage == 4 ? h : h / 2;
      for (int a = 0; a < n; a++) at[a] = y[a] + part * k[stage - 1][a];
      for (int a = 0; a < n; a++) {
        k[stage][a] = omega > 0 ? l->B[2 * a + 1] * cos (omega * (i * h + part)) : 0;
        for (int b = 0; b < n; b++) k[stage][a] += l->A[a * n + b] * at[b];
      }
    }
    for (int a = 0; a < n; a++) y[a] += h / 6 * (k[1][a] + 2 * k[2][a] + 2 * k[3][a] + k[4][a]);
  }
}

/* Compares half the difference of two runs, over eps, with the states of y. */
static void modes_compare (const modes *x, const double *plus, const double *minus, double eps, const double *y) {
  char name[100];
  for (int j = 0; j < 2 * x->n; j++) {
    double expected = 0, scale = 1;
    for (int c = 0; c < x->l.unknowns; c++) {
      expected += x->l.basis[j * x->l.unknowns + c] * y[c];
      scale = fmax (scale, fabs (x->l.basis[j * x->l.unknowns + c] * y[c]));
    }
    check_close (pw_system_state_name (x->s, j, name, sizeof name), (plus[j] - minus[j]) / (2 * eps), expected,
                 1e-6 * scale, "eps^2 of differences 1e-8 times third derivatives, round-off 1e-13/eps");
  }
}

/* ---- Scenes ---- */

/* A tractor with a trailer hitched on its axle, and a torque between them.  In the steady turn the trailer's axle has
 * no lateral velocity: u sin (heading) = -w L. */
typedef struct {
  double amplitude, w, stiffness;
} modes_parameters;

static const pw_parameter modes_list[] = { { PW_AT (modes_parameters, amplitude), 0, "N m", "amplitude", PW_REAL },
                                           { PW_AT (modes_parameters, w), 0, "rad/s", "turn rate", PW_REAL },
                                           { PW_AT (modes_parameters, stiffness), 0, "N m/rad", "at the hitch",
                                             PW_REAL },
                                           { .name = NULL } };

SCENE_WITH (modes_vehicle, modes_list, modes_parameters) {
  const double u = 1.3, L = 0.7, heading = -asin (p->w * L / u);
  pw_add_body (m, &(pw_body){ .name = "tractor", .mass = 2, .inertia = 0.3, .rate = { u, 0, p->w } });
  pw_add_body (m, &(pw_body){ .name = "trailer",
                              .mass = 1.5,
                              .inertia = 0.2,
                              .start = { -L * cos (heading), -L * sin (heading), heading },
                              .rate = { u + p->w * L * sin (heading), -p->w * L * cos (heading), p->w } });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "tractor" });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "trailer" });
  pw_add_pin (m, &(pw_pin){ .name = "hitch", .body = { "tractor", "trailer" }, .at = { { 0, 0 }, { L, 0 } } });
  pw_add_speed (m, &(pw_speed){ .name = "pull", .body = "tractor", .value = { .constant = u } });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){
             .name = "centring", .body = { "tractor", "trailer" }, .stiffness = p->stiffness, .angle = -heading });
  pw_add_torque (m, &(pw_torque){ .name = "actuator",
                                  .body = { "tractor", "trailer" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = p->amplitude, .omega = 3 } } });
}

/* ---- Tests ---- */

/* Every minimal coordinate, perturbed by itself, spreads as exp (A t); positions and velocities stay on the
 * constraints. */
static void modes_spread (const char *model) {
  const double eps = 1e-4, t = 1.1;
  modes x = modes_of (scene_named (model, NULL, 0));
  for (int c = 0; c < x.l.unknowns; c++) {
    double along[MOST], plus[MOST], minus[MOST], y[MOST] = { 0 };
    for (int j = 0; j < 2 * x.n; j++) along[j] = x.l.basis[j * x.l.unknowns + c];
    y[c] = 1;
    modes_run (&x, x.s, eps, along, t, plus);
    modes_run (&x, x.s, -eps, along, t, minus);
    modes_solve (&x.l, y, 0, t);
    modes_compare (&x, plus, minus, eps, y);
  }
  modes_close (&x);
}

TEST (spread) {
  modes_spread ("n-trailer");
  modes_spread ("car");
}

/* A mode keeps its shape and changes as exp (mu t); a complex one by its real part. */
static void modes_decay (pw_system *s, int modes_expected) {
  const double eps = 1e-4, t = 0.8;
  int seen = 0;
  modes x = modes_of (s);
  for (int i = 0; i < x.l.unknowns; i++) {
    const double complex *shape = (const double complex *)x.l.shape + 2 * x.n * i, mu = (x.l.re[i] + I * x.l.im[i]);
    double start[MOST], plus[MOST], minus[MOST], most = 0;
    for (int j = 0; j < 2 * x.n; j++) start[j] = creal (shape[j]);
    for (int j = 0; j < x.n; j++) most = fmax (most, cabs (shape[j]) * (j % 3 == 2 ? x.length : 1));
    if (x.l.rigid[i] || x.l.re[i] == 0) {
      check_close ("none", most, 0, 0, "rigid displacements and zeros have no shape");
      continue;
    }
    seen++;
    check_close ("largest", most, 1, 1e-9, "scaled; ties to 1e-9");
    modes_run (&x, x.s, eps, start, t, plus);
    modes_run (&x, x.s, -eps, start, t, minus);
    for (int j = 0; j < 2 * x.n; j++)
      check_close ("mode", (plus[j] - minus[j]) / (2 * eps), creal (shape[j] * cexp (mu * t)), 1e-6,
                   "eps^2 of differences 1e-8 times third derivatives, round-off 1e-13/eps");
  }
  assert_int_equal (seen, modes_expected);
  modes_close (&x);
}

TEST (decay) {
  modes_decay (scene_named ("n-trailer", NULL, 0), 2);
  modes_decay (scene_system (&modes_vehicle_table, "w", 0.8, "stiffness", 3.0, NULL), 2);
}

/* A torque drives the states as x' = A x + B u, in a straight motion and a turn, whose frame rotates. */
TEST (torque) {
  const double eps = 1e-3, t = 1.3;
  for (int turn = 0; turn < 2; turn++) {
    double plus[MOST], minus[MOST], y[MOST] = { 0 }, w = 0.8 * turn;
    pw_system *up = scene_system (&modes_vehicle_table, "amplitude", eps, "w", w, NULL),
              *down = scene_system (&modes_vehicle_table, "amplitude", -eps, "w", w, NULL);
    modes x = modes_of (scene_system (&modes_vehicle_table, "w", w, NULL));
    check_close ("twist", x.l.twist[2], w, 1e-9, "the described turn is steady");
    check_close ("hinge", x.l.re[x.l.unknowns - 1], -sqrt (1.3 * 1.3 / 0.49 - w * w), 1e-9,
                 "-w R/L, R the turning radius of the trailer's axle");
    modes_run (&x, up, 0, NULL, t, plus);
    modes_run (&x, down, 0, NULL, t, minus);
    modes_solve (&x.l, y, 3, t);
    modes_compare (&x, plus, minus, eps, y);
    modes_close (&x);
    pw_system_free (up);
    pw_system_free (down);
  }
}

/* The transfer function C (i w - A)^-1 B of state j. */
static double complex modes_transfer (const pw_linear *l, double omega, int j) {
  double complex M[4], det, sum = 0; /* two unknowns */
  for (int i = 0; i < 4; i++) M[i] = (i % 3 == 0 ? I * omega : 0) - l->A[i];
  det = M[0] * M[3] - M[1] * M[2];
  double complex y[2] = { (M[3] * l->B[0] - M[1] * l->B[1]) / det, (M[0] * l->B[1] - M[2] * l->B[0]) / det };
  for (int c = 0; c < 2; c++) sum += l->basis[2 * j + c] * y[c];
  return sum;
}

/* A damped compound pendulum with a torque: phi = tau / (k - J w^2 + i d w), k = m g l, J = I + m l^2. */
/* A rotor of inertia I that turns at 1 rad/s about its centre, and on it at r = 0.5 m a pendulum, 1 kg at a = 1 m.
 * The perturbations u of the rotor's angle and b of the pendulum's obey
 *
 *     (I + r^2) u'' + r a b'' - r a (b - u) = 0,   a^2 b'' + r a u'' + r a (b - u) = 0.
 *
 * With I = 2.25 kg m^2 they oscillate at 1 rad/s, as fast as the rotor turns, with u = -b/2.  That is no eigenvalue of
 * a rigid rotation, which is the only symmetry. */
SCENE (modes_rotor) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 2.25, .rate = { 0, 0, 1 } });
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 1, .start = { 1.5 }, .rate = { 0, 1.5, 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "rotor", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "rotor", "bob" }, .at = { { 0.5, 0 }, { -1, 0 } } });
}

TEST (rotor) {
  modes x = modes_of (scene_system (&modes_rotor_table, NULL));
  int mode = -1;
  for (int i = 0; i < x.l.unknowns; i++)
    if (fabs (x.l.im[i] - 1) < 1e-6) mode = i;
  assert_true (mode >= 0);
  const double *shape = x.l.shape + 4 * x.n * mode; /* complex */
  double complex rotor = shape[2 * 2] + I * shape[2 * 2 + 1], bob = shape[2 * 5] + I * shape[2 * 5 + 1];
  check_close ("rotor / bob", creal (rotor / bob), -0.5, 1e-9, "round-off");
  check_close ("phase", cimag (rotor / bob), 0, 1e-9, "round-off");
  modes_close (&x);
}

SCENE (modes_pendulum) {
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 2, .inertia = 0.5, .start = { 0, -0.7, -PW_PI / 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "bob", "ground" }, .at = { { -0.7, 0 } } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "D", .body = { "bob", "ground" }, .damping = 0.6 });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "bob", "ground" } });
}

TEST (transfer) {
  const double frequency[] = { 0.1, 3.05, 40 }, k = 2 * 9.81 * 0.7, J = 0.5 + 2 * 0.49, d = 0.6;
  modes x = modes_of (scene_system (&modes_pendulum_table, NULL));
  assert_int_equal (x.l.unknowns, 2);
  for (int i = 0; i < 3; i++) {
    double w = frequency[i];
    double complex expected = 1 / (k - J * w * w + I * d * w);
    check_below ("phi", cabs (modes_transfer (&x.l, w, 2) / expected - 1), 1e-11, "closed form, round-off");
    check_below ("omega", cabs (modes_transfer (&x.l, w, 5) / (I * w * expected) - 1), 1e-11, "closed form, round-off");
  }
  double complex mu = -d / (2 * J) + I * sqrt (k / J - d * d / (4 * J * J));
  check_below ("eigenvalue", cabs ((x.l.re[0] + I * x.l.im[0]) - mu), 1e-11, "closed form, round-off");
  for (int i = 0; i < 2; i++) {
    const double *phi = x.l.shape + 2 * (6 * i + 2), *omega = phi + 6;
    double complex rate = (omega[0] + I * omega[1]) / (phi[0] + I * phi[1]);
    check_below ("shape", cabs (rate - (x.l.re[i] + I * x.l.im[i])), 1e-11, "omega = mu phi");
  }
  modes_close (&x);
}

/* Signals of constraints have no column of B. */
TEST (constraint_signal) {
  pw_error error = { 0 };
  modes x = modes_of (scene_system (&modes_vehicle_table, NULL));
  int pull = pw_system_find_signal (x.s, "pull", &error),
      torque = pw_system_find_signal (x.s, "actuator.value", &error);
  assert_true (pull >= 0 && torque >= 0 && pw_system_signals (x.s) == 2);
  assert_true (pw_system_signal_of_force (x.s, torque) && !pw_system_signal_of_force (x.s, pull));
  for (int i = 0; i < x.l.unknowns; i++) assert_true (isnan (x.l.B[2 * i + pull]) && isfinite (x.l.B[2 * i + torque]));
  assert_string_equal (pw_system_signal_unit (x.s, torque), "N m");
  assert_int_equal (pw_system_find_signal (x.s, "actuator.valve", &error), PW_INPUT);
  assert_non_null (strstr (error.text, "has no signal \"actuator.valve\"; did you mean \"actuator.value\"?"));
  modes_close (&x);
}
