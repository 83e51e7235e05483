/* Massless coordinates follow the constraints: projections do not move massive coordinates instead, whatever the
 * units and the masses of other bodies.  An angle that nothing turns needs no inertia. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

typedef struct {
  double length, mass, other; /* units; mass of an unconnected body, 0: there is none */
} massless;

static const pw_parameter massless_list[] = {
  { PW_AT (massless, length), 1, "m", "unit of length", PW_POSITIVE },
  { PW_AT (massless, mass), 1, "kg", "unit of mass", PW_POSITIVE },
  { PW_AT (massless, other), 0, "kg", "of the other body", PW_NONNEGATIVE },
  { .name = NULL },
};

static const char *const massless_methods[] = { "rk4+projection",
                                                "rk4+nullspace",
                                                "erk5+projection",
                                                "erk5+projection:metric=identity",
                                                "erk8+projection",
                                                "erk8+nullspace",
                                                "bdf+projection",
                                                "bdf+projection:every=3",
                                                "bdf+projection:metric=identity",
                                                "ida+ggl",
                                                "radau+ggl",
                                                "radau+index2",
                                                "radau+index3",
                                                "galpha+ggl",
                                                "leapfrog+rattle" };

static void massless_other (pw_model *m, const massless *p) {
  if (p->other > 0)
    pw_add_body (m, &(pw_body){ .name = "other", .mass = p->other, .inertia = p->other, .rate = { 0, 0, 0.1 } });
}

/* A disc on a massless arm turns at 1 rad/s. */
SCENE_WITH (massless_disc, massless_list, massless) {
  double L = p->length;
  pw_add_body (m, &(pw_body){ .name = "disc", .inertia = p->mass * L * L, .start = { L, 0, 0 }, .rate = { 0, L, 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "disc", "ground" }, .at = { { -L, 0 }, { 0, 0 } } });
  massless_other (m, p);
}

static double massless_turned (const char *method, double length, double mass, double other) {
  double q[6], v[6];
  pw_system *s = scene_system (&massless_disc_table, "length", length, "mass", mass, "other", other, NULL);
  runs_state (s, method, &(pw_settings){ .rtol = 1e-6, .step = 1e-3, .span = 1 }, 1, q, v, NULL);
  pw_system_free (s);
  return fmax (fabs (q[2] - 1), fmax (hypot (q[0] / length - cos (1), q[1] / length - sin (1)), fabs (v[2] - 1)));
}

TEST (disc) {
  static const double units[][3] = { { 1, 1, 0 },      { 1, 1, 1 },   { 1, 1, 1e6 },   { 1e-3, 1, 0 },   { 1e3, 1, 0 },
                                     { 1, 1e-6, 1e3 }, { 1, 1e6, 0 }, { 1e3, 1e6, 1 }, { 1e-3, 1e-6, 0 } };
  for (size_t i = 0; i < sizeof massless_methods / sizeof *massless_methods; i++)
    for (size_t k = 0; k < sizeof units / sizeof *units; k++)
      check_below (massless_methods[i], massless_turned (massless_methods[i], units[k][0], units[k][1], units[k][2]),
                   1e-4, "100 rtol: the errors of some 30 steps");
}

/* With the mass metric there is no error, since only the angle changes, linearly. */
TEST (exact) {
  check_below ("bdf+projection", massless_turned ("bdf+projection", 1, 1, 0), 16 * CHECK_EPS, "round-off");
  check_below ("bdf+projection:every=3", massless_turned ("bdf+projection:every=3", 1, 1, 0), 16 * CHECK_EPS,
               "round-off");
}

/* Bars with inertia and with mass only, a massless coupler between bars with both, and a massless wheel carrier. */
SCENE_WITH (massless_chain, massless_list, massless) {
  double L = p->length, M = p->mass;
  pw_add_body (m, &(pw_body){ .name = "a", .inertia = M * L * L, .start = { L, 0, 0 }, .rate = { 0, L, 1 } });
  pw_add_body (m, &(pw_body){ .name = "b", .start = { 2.5 * L, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "c", .mass = M, .start = { 3.5 * L, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "a", "ground" }, .at = { { -L, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "a", "b" }, .at = { { L, 0 }, { -0.5 * L, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "C", .body = { "b", "c" }, .at = { { 0.5 * L, 0 }, { -0.5 * L, 0 } } });
  pw_add_rod (
      m, &(pw_rod){
             .name = "R", .body = { "c", "ground" }, .at = { { 0.5 * L, 0 }, { 4 * L, -2 * L } }, .length = 2 * L });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -L } });
  massless_other (m, p);
}

SCENE_WITH (massless_car, massless_list, massless) {
  double L = p->length, M = p->mass;
  pw_add_body (m, &(pw_body){ .name = "frame", .inertia = M * L * L, .rate = { L, 0, 0.3 } });
  pw_add_body (
      m, &(pw_body){
             .name = "tail", .mass = M, .inertia = 0.1 * M * L * L, .start = { -L, 0, 0 }, .rate = { L, 0, -0.2 } });
  pw_add_body (m, &(pw_body){ .name = "fork", .start = { 1.5 * L, 0, 0.4 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "frame", "tail" }, .at = { { -0.5 * L, 0 }, { 0.5 * L, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "fork" }, .at = { { L, 0 }, { -0.5 * L, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "V", .body = "frame", .at = { -0.1 * L, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "W", .body = "fork", .at = { 0.3 * L, 0 } });
  massless_other (m, p);
}

/* Norms of q and v in units of the scene. */
static void massless_state (const pw_plugin_table *table, const char *method, double rtol, double length, double mass,
                            double other, double *q, double *v) {
  pw_system *s = scene_system (table, "length", length, "mass", mass, "other", other, NULL);
  runs_state (s, method, &(pw_settings){ .rtol = rtol, .span = 2 }, 2, q, v, NULL);
  for (int i = 0; i < 9; i++)
    if (i % 3 != 2) q[i] /= length, v[i] /= length;
  pw_system_free (s);
}

static void massless_agree (const pw_plugin_table *table, const char *method) {
  static const double units[][3] = { { 1, 1, 0 }, { 1e-3, 1, 0 }, { 1e3, 1e6, 0 }, { 1, 1e-6, 0 }, { 1, 1, 1e3 } };
  double q[12], v[12], q0[12], v0[12];
  massless_state (table, "erk8+projection", 1e-12, 1, 1, 0, q0, v0);
  for (size_t k = 0; k < sizeof units / sizeof *units; k++) {
    massless_state (table, method, 1e-7, units[k][0], units[k][1], units[k][2], q, v);
    double worst = 0;
    for (int i = 0; i < 9; i++) worst = fmax (worst, fmax (fabs (q[i] - q0[i]), fabs (v[i] - v0[i])));
    check_below (method, worst, 3e-4, "3000 rtol: errors of some hundred steps, and their growth");
  }
}

TEST (agree) {
  static const char *const methods[] = { "bdf+projection", "bdf+projection:every=3", "erk5+projection",
                                         "erk8+nullspace", "ida+ggl" };
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    massless_agree (&massless_chain_table, methods[i]);
    massless_agree (&massless_car_table, methods[i]);
  }
}

/* ---- Point masses: nothing turns them, whatever their inertia ---- */

typedef struct {
  double inertia;
} points;

static const pw_parameter points_list[] = {
  { PW_AT (points, inertia), 0, "kg m^2", "of the point masses", PW_NONNEGATIVE },
  { .name = NULL },
};

/* Two point masses, one pinned to an arm, and a massless node that a spring pulls. */
SCENE_WITH (points_scene, points_list, points) {
  double I = p->inertia;
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 0.2, .start = { 0.5, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = I, .start = { 1, 0, 0.5 }, .rate = { 0, 0, 3 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 2, .inertia = I, .start = { 1, -1, 0 } });
  pw_add_body (m, &(pw_body){ .name = "node", .inertia = I, .start = { 2, -1, 0 }, .rate = { 0, 0, -1 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "arm", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "arm", "a" }, .at = { { 0.5, 0 }, { 0, 0 } } });
  pw_add_rod (m, &(pw_rod){ .name = "ab", .body = { "a", "b" }, .length = 1 });
  pw_add_rod (m, &(pw_rod){ .name = "an", .body = { "a", "node" }, .length = sqrt (2) });
  pw_add_rod (m, &(pw_rod){ .name = "bn", .body = { "b", "node" }, .length = 1 });
  pw_add_spring (
      m, &(pw_spring){ .name = "S", .body = { "node", "ground" }, .at = { { 0, 0 }, { 2, -2 } }, .stiffness = 30 });
  pw_add_drag (m, &(pw_drag){ .name = "D", .body = "b", .linear = 0.3 });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

/* The state at 1 s, its energy without the spin, and the energy balance. */
static void points_at (const char *method, double inertia, double *q, double *v, double *balance) {
  pw_system *s = scene_system (&points_scene_table, "inertia", inertia, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = 1e-9, .step = 1e-3, .span = 1 });
  pw_sample x = runs_to (r, 1);
  const double *M = pw_system_mass (s);
  double kinetic = 0;
  for (int j = 0; j < 12; j++) kinetic += M[j] * x.v[j] * x.v[j] / 2;
  for (int b = 1; b < 4; b++) assert_int_equal (pw_system_unturned (s, b), inertia == 0);
  assert_int_equal (pw_system_unturned (s, 0), 0);
  assert_true (M[5] == inertia);
  check_close (method, x.kinetic, kinetic, 1e-12, "round-off");
  memcpy (q, x.q, 12 * sizeof *q);
  memcpy (v, x.v, 12 * sizeof *v);
  *balance = x.balance;
  runs_close (r, s);
}

TEST (points) {
  const pw_method *m;
  char method[40];
  for (int i = 0; (m = runs_method (i, method)) != NULL; i++) {
    double q[12], v[12], q1[12], v1[12], balance, balance1, worst = 0;
    const double bound = m->adaptive ? 1e-5 : 100 * pow (1e-3, m->order);
    points_at (method, 1, q1, v1, &balance1);
    points_at (method, 0, q, v, &balance);
    for (int j = 0; j < 12; j++) worst = fmax (worst, fmax (fabs (q[j] - q1[j]), fabs (v[j] - v1[j])));
    check_below (method, worst, bound, "1e4 rtol, or 100 h^order");
    check_close (method, balance, balance1, bound, "1e4 rtol, or 100 h^order");
    check_close (method, q[5], 3.5, 1e-9, "round-off and the tolerance of a linear motion");
    check_close (method, q[11], -1, 1e-9, "round-off and the tolerance of a linear motion");
    check_close (method, v[5], 3, 1e-9, "round-off and the tolerance of a linear motion");
  }
}

/* The steady motion is isolated, with the spins kept; the linearisation is that without the angles. */
TEST (points_steady) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&points_scene_table, NULL);
  pw_steady *x = pw_steady_open (s, &(pw_steady_settings){ .vary = -1 }, &error);
  pw_steady_motion motion;
  check_ok (x ? PW_OK : error.status, &error);
  assert_int_equal (pw_steady_solve (x, 1, 0, &motion, &error), PW_OK);
  assert_int_equal (motion.family, 0);
  check_close ("spin of a", motion.v[5], 3, 1e-9, "round-off");
  assert_int_equal (motion.linear->unknowns, 4); /* the arm and the triangle turn */
  for (int i = 0; i < 4; i++) assert_true (motion.linear->im[i] != 0);
  pw_steady_close (x);
  pw_system_free (s);
}
