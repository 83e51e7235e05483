/* moreau: orders with and without events, rest after an accumulation, simultaneous impacts, ledger, samples.  Its
 * checkpoints: test_events.c. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "ladder.h"
#include "scene.h"
#include "trial.h"

TEST (order_without_limits) {
  static const struct {
    const char *model;
    double h, t;
  } scene[] = { { "ezyroller", 0.01, 2 },    { "n-trailer", 0.01, 1 }, { "pendulum", 0.01, 1 },
                { "n-four-bar", 0.01, 0.4 }, { "arm", 0.004, 1 },      { "snakeboard", 0.01, 1 },
                { "car-tyres", 0.002, 1 },   { "tractor", 0.01, 1 },   { "redundant-parallelogram", 0.01, 0.5 } };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    ladder_expect (scene[i].model, "moreau", scene[i].h, scene[i].t, 2, 0.3, LADDER_Q);
    pw_statistics cost = ladder_run (scene[i].model, "moreau", scene[i].h, scene[i].t).cost;
    check_below (scene[i].model, cost.position, 64 * CHECK_EPS, "round-off");
    check_below (scene[i].model, cost.velocity, 64 * CHECK_EPS, "round-off");
  }
}

enum { MOREAU_COORDS = 12, MOREAU_RUNS = 16 };

/* The root mean square of the errors with several steps of about h, in which events have various places. */
static double moreau_error (const char *scene, const char *sets, double t, double h) {
  double q0[MOREAU_COORDS], v0[MOREAU_COORDS], q[MOREAU_COORDS], v[MOREAU_COORDS], sum = 0;
  pw_system *s = runs_scene (scene, sets);
  const int n = pw_system_coordinates (s);
  assert_true (n <= MOREAU_COORDS);
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12, .span = t }, t, q0, v0, NULL);
  for (int k = 0; k < MOREAU_RUNS; k++) {
    double most = 0;
    runs_state (s, "moreau", &(pw_settings){ .step = h * (1 - 0.0213 * k), .span = t }, t, q, v, NULL);
    for (int j = 0; j < n; j++) most = fmax (most, fmax (fabs (q[j] - q0[j]), fabs (v[j] - v0[j])));
    sum += most * most / MOREAU_RUNS;
  }
  pw_system_free (s);
  return sqrt (sum);
}

/* While equations with limits hold or slide, the predicted multipliers preserve order 2. */
TEST (order_between_events) {
  static const struct {
    const char *scene, *sets;
    double t;
  } of[] = { { "ride-on", "gA=1e6 gC=1e6", 2 }, { "sleigh", "", 1.9 }, { "sleigh", "grip=0.6", 2 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    const double coarse = moreau_error (of[i].scene, of[i].sets, of[i].t, 0.016);
    const double fine = moreau_error (of[i].scene, of[i].sets, of[i].t, 0.008);
    check_close (check_text ("%s %s", of[i].scene, of[i].sets), coarse / fine, 4, 0.2, "order 2: 2^2");
  }
}

/* An impact takes effect at the end of a step, and the smaller friction of sliding within it: order 1.  Where forces
 * change without such jumps, the order is at least 1. */
TEST (order_through_events) {
  static const struct {
    const char *scene, *sets;
    double t, h;
    int first;
  } of[] = { { "ball", "", 3.4, 2e-3, 1 },  { "pendulum", "", 5, 2e-3, 1 },
             { "tether", "", 5, 4e-3, 1 },  { "tether", "I=0.02 rho=-0.4 w0=5", 3, 4e-3, 1 },
             { "wall", "", 2, 1e-3, 1 },    { "discs", "", 1.2, 1e-3, 1 },
             { "block", "", 8, 4e-3, 0 },   { "sleigh", "", 10, 4e-3, 0 },
             { "clutch", "", 15, 4e-3, 0 }, { "belt", "", 20, 1e-3, 1 },
             { "ratchet", "", 10, 4e-3, 0 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    double error[2];
    for (int k = 0; k < 2; k++) error[k] = moreau_error (of[i].scene, of[i].sets, of[i].t, of[i].h / (k ? 4 : 1));
    const char *what = check_text ("%s %s: order", of[i].scene, of[i].sets);
    const double order = log (error[0] / error[1]) / log (4);
    if (of[i].first)
      check_close (what, order, 1, 0.3, "impacts, and jumps of friction: 1, over two halvings");
    else
      check_close (what, order, 1.5, 0.75, "1 to 2, over two halvings");
  }
}

/* ---- Accumulation and simultaneous impacts ---- */

/* The number of steps is that of the time; the ball rests exactly, and its potential energy is lost. */
TEST (ball_rests) {
  for (double h = 0.01; h > 1e-3; h /= 3) {
    pw_system *s = runs_scene ("ball", "");
    pw_run *r = runs_open (s, "moreau", &(pw_settings){ .step = h, .span = 6, .ledger = 1 });
    double accumulated = sqrt (2 / 9.81) * (1 + 2 * 0.8 / (1 - 0.8));
    pw_sample x = runs_to (r, accumulated + 0.2);
    check_close ("velocity at rest", x.v[1], 0, 1e-14, "round-off, unless errors of order h delay the last bounce");
    x = runs_to (r, 6);
    check_close ("height", x.q[1], 0, 1e-14, "round-off");
    double force = 0;
    for (int i = 0; i < pw_system_rows (s); i++) force = fmax (force, fabs (x.lambda[i]));
    check_close ("force of the drive", force, 2 * 9.81, 1e-12, "the weights of ball and table, round-off");
    check_close ("loss and energy of projections", x.loss - x.projection, 9.81, 1e-12, "m g h, round-off");
    check_close ("balance", x.balance, 0, 1e-12, "gravity is constant, round-off");
    int events;
    (void)pw_run_events (r, &events);
    assert_int_equal (events, 0);
    assert_int_equal (pw_run_statistics (r)->steps, (long)ceil (6 / h - 0.02) + 1);
    runs_close (r, s);
  }
}

/* A body slides on a point beside its centre of mass: the torque of 0.5 N m is less than that with which it sticks. */
SCENE (moreau_two_frictions) {
  pw_add_body (m, &(pw_body){ .name = "sled", .mass = 1, .inertia = 1, .rate = { 2 } });
  pw_add_sliding_friction (m, &(pw_sliding_friction){ .name = "rub",
                                                      .body = { "sled", "ground" },
                                                      .at = { { 0, 0.5 } },
                                                      .limit = { .constant = 3 },
                                                      .limit_sliding = { .constant = 1 } });
  pw_add_friction (m, &(pw_friction){ .name = "hold",
                                      .body = { "sled", "ground" },
                                      .limit = { .constant = 1 },
                                      .limit_sliding = { .constant = 0.2 } });
}

TEST (sticking_beside_sliding) {
  pw_system *s = scene_system (&moreau_two_frictions_table, NULL);
  pw_run *r = runs_open (s, "moreau", &(pw_settings){ .step = 1e-3, .span = 1 });
  const pw_sample x = runs_to (r, 1);
  check_close ("angle", x.q[2], 0, 1e-14, "it sticks");
  check_close ("velocity", x.v[0], 1, 1e-12, "2 - 1 t");
  runs_close (r, s);
}

/* Of equations that depend on each other the later one carries what the first cannot, as where events are located; what
 * it carried before does not stay there: friction alone holds a moment below its limit. */
TEST (depends) {
  pw_system *s = runs_scene ("backstop", "");
  pw_run *r = runs_open (s, "moreau", &(pw_settings){ .step = 1e-3, .span = 3 });
  for (int i = 1; i < 30; i++) {
    const pw_sample x = runs_to (r, 0.1 * i);
    const double T = 0.1 + 0.6 * cos (0.3 * i), F = T > 0.65 ? 0.42 : T;
    const double *lambda = x.lambda + pw_system_rows (s) - 2; /* of F and W */
    check_close ("velocity", x.v[2], 0, 1e-14, "it rests");
    if (T > 0.42 && T < 0.66) continue; /* friction may slide still, beside the freewheel */
    check_close ("friction", lambda[0], F, 3e-3, "means over the step");
    check_close ("freewheel", lambda[1], F - T, 3e-3, "means over the step");
  }
  runs_close (r, s);
}

static double moreau_bounce;

/* A rod falls flat on two stops; below it three balls in a row. */
SCENE (moreau_row) {
  const char *const name[] = { "left", "middle", "right" };
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 2, .inertia = 1. / 6, .start = { 0, 1, 0 } });
  for (int i = 0; i < 2; i++)
    pw_add_end_stop (m, &(pw_end_stop){ .name = i ? "A" : "B",
                                        .body = { "rod", "ground" },
                                        .at = { { i ? 0.5 : -0.5 } },
                                        .what = PW_DRIVE_Y,
                                        .specified = { 1 },
                                        .restitution = moreau_bounce });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  for (int i = 0; i < 3; i++) {
    pw_add_body (m, &(pw_body){ .name = name[i], .mass = 1, .inertia = 1, .start = { i, -3 }, .rate = { 1 - i } });
    pw_add_slider (
        m, &(pw_slider){ .name = check_text ("S%d", i), .body = { name[i], "ground" }, .at = { { 0 }, { 0, -3 } } });
    if (i > 0)
      pw_add_end_stop (m, &(pw_end_stop){ .name = check_text ("C%d", i),
                                          .body = { name[i], name[i - 1] },
                                          .what = PW_DRIVE_X,
                                          .low = 0.5,
                                          .restitution = moreau_bounce });
  }
}

/* By symmetry the rod does not turn, and the balls at both ends reach the one at rest in the middle together, which
 * then stays there. */
TEST (simultaneous) {
  static const double bounce[] = { 0, 0.5, 1 };
  for (int i = 0; i < 3; i++) {
    const double e = moreau_bounce = bounce[i], h = 1e-3, t1 = sqrt (2 / 9.81);
    pw_system *s = scene_system (&moreau_row_table, NULL);
    pw_run *r = runs_open (s, "moreau", &(pw_settings){ .step = h });
    pw_sample x = runs_to (r, 0.6);
    check_close ("the rod's angle", x.q[2], 0, 1e-13, "round-off");
    check_close ("the rod's velocity", x.v[1], e > 0 ? e * 9.81 * t1 - 9.81 * (0.6 - t1) : 0, 9.81 * (1 + e) * h,
                 "the impact is up to h early or late");
    check_close ("the left ball's velocity", x.v[3], -e, 1e-12, "round-off");
    check_close ("the middle ball's velocity", x.v[6], 0, 1e-12, "round-off");
    check_close ("the right ball's velocity", x.v[9], e, 1e-12, "round-off");
    runs_close (r, s);
  }
}

/* ---- Samples, checkpoints ---- */

/* Samples inside steps of free flight are of order 2, continuous at the ends of all steps, and on the constraints. */
TEST (samples) {
  pw_system *s = runs_scene ("wall", "");
  pw_run *r = runs_open (s, "moreau", &(pw_settings){ .step = 0.01 });
  pw_error error = { 0 };
  double q[6], v[6];
  while (pw_run_time (r) < 2) {
    pw_sample x;
    const double t0 = pw_run_time (r);
    check_ok (pw_run_sample (r, t0, &x, &error), &error);
    memcpy (q, x.q, sizeof q);
    memcpy (v, x.v, sizeof v);
    check_ok (pw_run_advance (r, 2, &error), &error);
    check_ok (pw_run_sample (r, t0, &x, &error), &error);
    for (int j = 0; j < 6; j++) {
      check_close ("q at the beginning", x.q[j], q[j], 1e-13, "round-off");
      check_close ("v at the beginning", x.v[j], v[j], 1e-12, "round-off");
    }
    check_ok (pw_run_sample (r, 0.5 * (t0 + pw_run_time (r)), &x, &error), &error);
    check_below ("positions in the middle", x.position, 64 * CHECK_EPS, "round-off");
    check_below ("velocities in the middle", x.velocity, 64 * CHECK_EPS, "round-off");
  }
  runs_close (r, s);
}
