/* leapfrog: order 2, reversibility, energy in long runs, residuals, samples, errors. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "ladder.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

enum { LEAPFROG_COORDS = 120 };

static const struct {
  const char *model;
  double h, t;
} leapfrog_scene[] = { { "ezyroller", 0.01, 2 }, { "n-trailer", 0.01, 1 },
                       { "pendulum", 0.01, 1 },  { "n-four-bar", 0.01, 0.4 },
                       { "arm", 0.004, 1 },      { "snakeboard", 0.01, 1 },
                       { "chain", 0.0025, 0.1 }, { "redundant-parallelogram", 0.01, 0.5 },
                       { "car-tyres", 0.002, 1 } };
enum { LEAPFROG_SCENES = sizeof leapfrog_scene / sizeof *leapfrog_scene };

TEST (order) {
  for (int i = 0; i < LEAPFROG_SCENES; i++)
    ladder_expect (leapfrog_scene[i].model, "leapfrog", leapfrog_scene[i].h, leapfrog_scene[i].t, 2, 0.25,
                   LADDER_LAMBDA);
  ladder_expect ("tractor", "leapfrog", 0.01, 1, 2, 0.25, LADDER_Q); /* prescribed motion */
}

TEST (residuals) {
  for (int i = 0; i < LEAPFROG_SCENES; i++) {
    double h = leapfrog_scene[i].h;
    pw_statistics cost = ladder_run (leapfrog_scene[i].model, "leapfrog", h, 20 * h).cost;
    check_below (leapfrog_scene[i].model, cost.position, 64 * CHECK_EPS, "round-off");
    check_below (leapfrog_scene[i].model, cost.velocity, 64 * CHECK_EPS, "round-off");
    check_below ("evaluations of a step", (double)cost.rhs / (double)cost.steps, 6, "Newton's iteration converges");
  }
}

/* ---- Conservative scenes ---- */

/* A board on two skewed knife edges held by springs, with a sprung rider: three nonholonomic rows, five pins, light
 * trucks, conservative. */
SCENE (leapfrog_board) {
  pw_add_body (m, &(pw_body){ .name = "board", .mass = 6, .inertia = 0.1, .rate = { 1, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "rotor", .inertia = 0.2, .start = { 0, 0, 0.7 }, .rate = { 1, 0, 0 } });
  pw_add_body (
      m, &(pw_body){ .name = "front", .mass = 0.3, .inertia = 0.002, .start = { 0.3, 0, 0 }, .rate = { 1, 0, 0 } });
  pw_add_body (
      m, &(pw_body){ .name = "rear", .mass = 0.3, .inertia = 0.002, .start = { -0.3, 0, 0 }, .rate = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "bearing", .body = { "rotor", "board" } });
  pw_add_pin (m, &(pw_pin){ .name = "F", .body = { "front", "board" }, .at = { { 0, 0 }, { 0.3, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "R", .body = { "rear", "board" }, .at = { { 0, 0 }, { -0.3, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "front" });
  pw_add_wheel (m, &(pw_wheel){ .name = "B", .body = "rear" });
  pw_add_rotational_spring (m,
                            &(pw_rotational_spring){ .name = "rider", .body = { "rotor", "board" }, .stiffness = 2 });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){ .name = "kf", .body = { "front", "board" }, .stiffness = 3, .angle = 0.1 });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){ .name = "kr", .body = { "rear", "board" }, .stiffness = 3, .angle = -0.1 });
}

/* An EzyRoller steered by a spring; its steering assembly is massless. */
SCENE (leapfrog_roller) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 10, .inertia = 2, .rate = { 1, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "steer", .start = { 0.6, 0, 0.1 }, .rate = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.1, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "C", .body = "steer", .at = { -0.2, 0 } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "k", .body = { "steer", "frame" }, .stiffness = 1 });
}

static pw_system *leapfrog_open (const char *model) {
  if (strcmp (model, "board") == 0) return scene_system (&leapfrog_board_table, NULL);
  if (strcmp (model, "roller") == 0) return scene_system (&leapfrog_roller_table, NULL);
  return ladder_open (model);
}

/* n steps forwards and, with reversed velocities, n steps backwards: distance from the initial state, in units of
 * the scene. */
static double leapfrog_reversed_error (const char *model, const char *method, double h, int n) {
  pw_error error = { 0 };
  double q[LEAPFROG_COORDS], v[LEAPFROG_COORDS], off = 0;
  pw_system *s = leapfrog_open (model);
  assert_true (s->coords <= LEAPFROG_COORDS);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = h, .span = 2 * n * h });
  pw_sample x = runs_to (r, 0);
  memcpy (q, x.q, (size_t)s->coords * sizeof *q);
  memcpy (v, x.v, (size_t)s->coords * sizeof *v);
  double back[LEAPFROG_COORDS], T = pw_run_scale (r)->time;
  x = runs_to (r, n * h);
  for (int j = 0; j < s->coords; j++) back[j] = -x.v[j];
  check_ok (pw_run_restart (r, NULL, back, &error), &error);
  x = runs_to (r, 2 * n * h);
  for (int j = 0; j < s->coords; j++) {
    off = fmax (off, fabs (x.q[j] - q[j]) / pw_unit (s, j));
    off = fmax (off, fabs (x.v[j] + v[j]) / pw_unit (s, j) * T);
  }
  pw_run_close (r);
  pw_system_free (s);
  return off;
}

static const struct {
  const char *model;
  double h;
  int steps;
} leapfrog_conservative[] = {
  { "board", 0.02, 100 },
  { "roller", 0.05, 10 }, /* the motion decays to straight running, so that round-off grows on the way back */
  { "pendulum", 0.1, 100 },
  { "redundant-parallelogram", 0.05, 100 },
  { "chaplygin-sleigh", 0.1, 50 }
};
enum { LEAPFROG_CONSERVATIVE = sizeof leapfrog_conservative / sizeof *leapfrog_conservative };

TEST (way_back) {
  for (int i = 0; i < LEAPFROG_CONSERVATIVE; i++) {
    const char *model = leapfrog_conservative[i].model;
    double h = leapfrog_conservative[i].h, n = leapfrog_conservative[i].steps;
    double off = leapfrog_reversed_error (model, "leapfrog", h, (int)n);
    check_below (model, off, 1000 * n * CHECK_EPS, "round-off of each step");
    check_below (model, 1e4 * off, leapfrog_reversed_error (model, "rk4+projection", h, (int)n),
                 "rk4 is not reversible");
  }
}

/* Change of the mean energy error from the first quarter of a run to the last, relative to its largest value in the
 * first. */
static double leapfrog_drift_of (const char *model, const char *method, double h, int steps) {
  double mean[4] = { 0 }, most = 0;
  pw_error error = { 0 };
  pw_system *s = leapfrog_open (model);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = h, .span = 1, .ledger = 1 });
  for (int i = 0; i < 4 * steps; i++) {
    pw_sample x;
    check_ok (pw_run_advance (r, INFINITY, &error), &error);
    check_ok (pw_run_sample (r, pw_run_time (r), &x, &error), &error);
    mean[i / steps] += x.balance / steps;
    if (i < steps) most = fmax (most, fabs (x.balance));
  }
  pw_run_close (r);
  pw_system_free (s);
  return fabs (mean[3] - mean[0]) / most;
}

TEST (energy) {
  for (int i = 0; i < LEAPFROG_CONSERVATIVE; i++) {
    const char *model = leapfrog_conservative[i].model;
    double h = leapfrog_conservative[i].h, transient = i == 4 ? 0.1 : 0.05;
    check_below (model, leapfrog_drift_of (model, "leapfrog", h, 2000), transient, "of the error that comes and goes");
  }
  check_below ("n-four-bar", leapfrog_drift_of ("n-four-bar", "leapfrog", 2e-3, 2000), 0.05,
               "past singular configurations");
  check_below ("pendulum, rk4", 0.5, leapfrog_drift_of ("pendulum", "rk4+projection", 0.1, 2000), "it drifts");
  check_below ("board, rk4", 10 * leapfrog_drift_of ("board", "leapfrog", 0.02, 2000),
               leapfrog_drift_of ("board", "rk4+projection", 0.02, 2000), "it drifts");
}

/* ---- Step sizes and settings ---- */

/* The last step is shortened; the order is unchanged. */
TEST (last_step) {
  static const char *const model[] = { "arm", "n-four-bar", "ezyroller" };
  for (int k = 0; k < 3; k++) {
    double h = 0.004, t = 0.3 + h / 12;
    ladder_error coarse = ladder_run (model[k], "leapfrog", h, t), fine = ladder_run (model[k], "leapfrog", h / 4, t);
    check_below (model[k], fine.q, coarse.q / 10, "order 2 has 1/16");
    check_below (model[k], fine.v, coarse.v / 10, "order 2 has 1/16");
    check_below (model[k], fine.lambda, coarse.lambda / 10, "order 2 has 1/16");
  }
}

SCENE (leapfrog_damped) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1, .rate = { 0, 0, 1 } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "c", .body = { "rotor", "ground" }, .damping = 1000 });
}

static void leapfrog_stops (pw_system *s, double step, const char *cause) {
  pw_error error = { 0 };
  pw_run *r = runs_open (s, "leapfrog", &(pw_settings){ .step = step, .span = 100 });
  assert_int_equal (pw_run_advance_to (r, 100, 100, &error), PW_METHOD);
  if (strstr (error.text, cause) == NULL) fail_msg ("%s", error.text);
  pw_run_close (r);
  pw_system_free (s);
}

TEST (large_steps) {
  leapfrog_stops (ladder_open ("ezyroller"), 3, "the step of 3 s may be too large");
  leapfrog_stops (ladder_open ("pendulum"), 1, "the step of 1 s may be too large");
  leapfrog_stops (scene_system (&leapfrog_damped_table, NULL), 0.01,
                  "t = 0 s: the iteration does not converge; the step of 0.01 s may be too large");
}

/* ---- Forces that are not a number ---- */

typedef struct {
  const char *name, *body;
} leapfrog_edge;

/* Undefined from x = 0.05 on. */
static void leapfrog_edge_force (const pw_batch *b, double *out) {
  out[0] = b->configuration[b->body[0]].x < 0.05 ? 0 : NAN;
  out[1] = out[2] = 0;
}

static void leapfrog_edge_force_q (const pw_batch *b, double *out) {
  (void)b;
  memset (out, 0, 9 * sizeof *out);
}

static const pw_field leapfrog_edge_fields[] = {
  { PW_AT (leapfrog_edge, body), PW_BODY, .required = 1, .about = "the body" },
  { .name = NULL },
};

static const pw_kind leapfrog_edge_kind = {
  .name = "edge",
  .about = "a force that is undefined beyond an edge",
  .definition = sizeof (leapfrog_edge),
  .fields = leapfrog_edge_fields,
  .bodies = 1,
  .force = leapfrog_edge_force,
  .force_q = leapfrog_edge_force_q,
};

SCENE (leapfrog_beyond_edge) {
  pw_add_body (m, &(pw_body){ .name = "puck", .mass = 1, .inertia = 1, .rate = { 1, 0, 0 } });
  pw_add (m, &leapfrog_edge_kind, &(leapfrog_edge){ .name = "edge", .body = "puck" });
}

/* The step that meets it is refused, although the corrections of y and phi are 0. */
TEST (undefined_force) {
  leapfrog_stops (scene_system (&leapfrog_beyond_edge_table, NULL), 0.01,
                  "t = 0.04 s: the iteration does not converge");
}
