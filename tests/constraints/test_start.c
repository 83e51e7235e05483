/* Consistent initial conditions: given values are kept, consistent ones unchanged, impossible ones refused. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "model.h"
#include "scene.h"
#include "system.h"
#include "start.h"
#include "trial.h"

/* ---- Initial values of the settings ---- */

/* Initial values of the settings replace those of the system for this run, with the same result as in the model. */
TEST (settings) {
  static const char *const name[] = { "frame.omega", "steer.phi", NULL };
  static const double value[] = { 0.3, 0.2 };
  pw_system *own, *shared;
  pw_error error = { 0 };
  pw_run *expected = start_open (&own, name, value), *plain = start_open (&shared, NULL, NULL);
  pw_initial_value initial[2];
  for (int i = 0; i < 2; i++)
    initial[i] = (pw_initial_value){ pw_system_find_state (shared, name[i], &error), value[i] };
  pw_run *r = runs_open (shared, "rk4", &(pw_settings){ .initial = initial, .initials = 2 });
  const pw_initial_report *a = pw_run_initial (r), *b = pw_run_initial (expected);
  check_bits ("positions", a->q, b->q, 6);
  check_bits ("velocities", a->v, b->v, 6);
  assert_true (a->moved == b->moved && a->changed == b->changed && a->released == b->released && a->moved > 0);
  for (int i = 0; i < 12; i++) assert_int_equal (pw_initial_specified (a, i), pw_initial_specified (b, i));
  assert_true (pw_initial_specified (a, initial[0].state) && !pw_initial_specified (pw_run_initial (plain), 2));
  pw_run_close (r);
  pw_run_close (plain);
  pw_run *again = runs_open (shared, "rk4", NULL);
  check_bits ("the system's", pw_run_initial (again)->q, shared->q0, 6);
  runs_close (again, shared);
  runs_close (expected, own);
}

TEST (bad_settings) {
  static const pw_initial_value bad[] = { { -1, 0 }, { 12, 0 }, { 0, NAN }, { 0, 1e200 } };
  static const char *const expected[] = { "state -1 = 0: expected a state from 0 to 11", "state 12 = 0: expected",
                                          "state 0 = nan: expected",
                                          "values too extreme: frame.x is initially 1e+200" };
  pw_system *s = scene_compile (scene_model (&scene_ezyroller, NULL));
  for (int i = 0; i < 4; i++) {
    pw_error error = { 0 };
    assert_null (pw_run_open (s, "rk4", &(pw_settings){ .initial = bad + i, .initials = 1 }, &error));
    assert_int_equal (error.status, PW_INPUT);
    assert_non_null (strstr (error.text, expected[i]));
  }
  pw_system_free (s);
}

/* ---- Consistent and nearly consistent values ---- */

TEST (consistent_unchanged) {
  pw_system *s;
  pw_run *r = start_open (&s, NULL, NULL);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->moved == 0 && start->released == 0);
  check_bits ("positions", start->q, s->q0, 6);
  check_bits ("velocities", start->v, s->v0, 6);
  runs_close (r, s);
}

/* All deviations above round-off are corrected and reported. */
TEST (small_deviation) {
  static const char *const name[] = { "steer.x", "frame.vy", NULL };
  static const double value[] = { 0.375 + 1e-10, 1e-10 };
  for (int i = 0; i < 2; i++) {
    pw_system *s;
    const char *const one[] = { name[i], NULL };
    pw_run *r = start_open (&s, one, value + i);
    assert_true (pw_run_initial (r)->moved > 0);
    runs_close (r, s);
  }
}

/* Deviations of round-off are corrected without a report. */
TEST (round_off) {
  static const char *const name[] = { "steer.x", NULL };
  static const double value[] = { 0.375 + 12 * CHECK_EPS };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  int changed = 0;
  for (int j = 0; j < 6; j++) changed += start->q[j] != start->q_given[j];
  assert_true (changed > 0 && start->moved == 0);
  runs_close (r, s);
}

/* A restart does not change a state reached by a run. */
TEST (reached_state_unchanged) {
  for (double t = 0.25; t <= 2; t += 0.25) {
    double q[6], v[6];
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    pw_sample now = runs_to (r, t);
    memcpy (q, now.q, sizeof q);
    memcpy (v, now.v, sizeof v);
    check_ok (pw_run_restart (r, q, v, &error), &error);
    assert_int_equal (pw_run_initial (r)->moved, 0);
    now = runs_to (r, t);
    check_bits ("positions", now.q, q, 6);
    check_bits ("velocities", now.v, v, 6);
    runs_close (r, s);
  }
}

/* ---- Specified values are kept ---- */

typedef struct {
  double phi, x, omega, vy, specified;
} start_given;

static const pw_parameter start_rod_list[] = { { PW_AT (start_given, phi) },       { PW_AT (start_given, x) },
                                               { PW_AT (start_given, omega) },     { PW_AT (start_given, vy) },
                                               { PW_AT (start_given, specified) }, { .name = NULL } };

/* A rod on a pin with one or two specified states. */
SCENE_WITH (start_rod, start_rod_list, start_given) {
  pw_add_body (m, &(pw_body){ .name = "rod",
                              .mass = 1,
                              .inertia = 1. / 12,
                              .start = { p->x, 0, p->phi },
                              .rate = { 0, p->vy, p->omega },
                              .specified = (unsigned)p->specified });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "ground", "rod" }, .at = { { 0 }, { -0.5, 0 } } });
}

static const pw_initial_report *start_of_rod (pw_system **s, pw_run **r, double phi, double x, double omega, double vy,
                                              double specified) {
  *s = scene_system (&start_rod_table, "phi", phi, "x", x, "omega", omega, "vy", vy, "specified", specified, NULL);
  *r = runs_open (*s, "rk4", NULL);
  check_below ("position", runs_to (*r, 0).position, START_ROUND_OFF, START_REASON);
  check_below ("velocity", runs_to (*r, 0).velocity, START_ROUND_OFF, START_REASON);
  return pw_run_initial (*r);
}

/* A specified angle and angular velocity are unchanged; omitted values follow. */
TEST (specified) {
  pw_system *s;
  pw_run *r;
  const pw_initial_report *start = start_of_rod (&s, &r, PW_PI / 6, 0, 2, 0, 0);
  assert_true (start->q[2] == PW_PI / 6 && start->v[2] == 2 && start->moved == 4 && start->changed == 0);
  check_close ("x", start->q[0], 0.5 * cos (PW_PI / 6), START_ROUND_OFF, START_REASON);
  check_close ("vy", start->v[1], cos (PW_PI / 6), START_ROUND_OFF, START_REASON);
  assert_true (pw_initial_specified (start, 2) && pw_initial_specified (start, 5) && !pw_initial_specified (start, 0));
  runs_close (r, s);
}

/* A specified 0, and x instead of the angle: the angle follows from x = 0.5 cos phi, omega from vy = 0.5 omega cos
 * phi. */
TEST (specified_zero) {
  pw_system *s;
  pw_run *r;
  const pw_initial_report *start = start_of_rod (&s, &r, 1.5, 0, 0, 0, PW_SPECIFIES_X);
  assert_true (start->q[0] == 0 && start->changed == 0);
  check_close ("phi", start->q[2], PW_PI / 2, START_ROUND_OFF, START_REASON);
  runs_close (r, s);
  start = start_of_rod (&s, &r, PW_PI / 3, 0, 0, 0.75, 0);
  assert_true (start->q[2] == PW_PI / 3 && start->v[1] == 0.75 && start->changed == 0);
  check_close ("omega", start->v[2], 3, START_ROUND_OFF, START_REASON);
  runs_close (r, s);
}

/* Of specified positions that contradict the pin the angle is kept, which comes first, and so are specified
 * velocities. */
TEST (overspecified) {
  pw_system *s;
  pw_run *r;
  const pw_initial_report *start = start_of_rod (&s, &r, PW_PI / 6, 0.5, 2, 0, 0);
  assert_true (start->released == 0 && start->changed == 1 && start->v[2] == 2 && start->q[2] == PW_PI / 6);
  check_close ("x", start->q[0], 0.5 * cos (PW_PI / 6), START_ROUND_OFF, START_REASON);
  runs_close (r, s);
}

/* Given values take precedence over specified ones. */
TEST (given_before_specified) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&start_rod_table, "phi", PW_PI / 6, NULL);
  check_ok (pw_model_set_initial (m, "rod.y", 0.4, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, "rk4", NULL);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->q[1] == 0.4 && start->released == 0 && start->changed == 1);
  check_close ("phi", start->q[2], asin (0.8), START_ROUND_OFF, START_REASON);
  runs_close (r, s);
}

/* A body on two wheels, or in two slots, one behind the other, pinned to an arm without given values. */
SCENE_WITH (start_axles, start_rod_list, start_given) {
  const int slots = p->specified != 0;
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 1, .inertia = 1 });
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 1 });
  for (int i = 0; i < 2; i++) {
    const char *name = i ? "front" : "rear";
    if (slots)
      pw_add_slot (m, &(pw_slot){ .name = name, .body = { "car", "ground" }, .at = { { i - 0.5, 0 }, { 0, 0 } } });
    else
      pw_add_wheel (m, &(pw_wheel){ .name = name, .body = "car", .at = { i - 0.5, 0 } });
  }
  pw_add_pin (m, &(pw_pin){ .name = "H", .body = { "car", "arm" } });
}

/* Given values that satisfy the constraints are kept, though they leave two equations for one unknown: with y, or vy,
 * only the angle, or omega, of the car is left. */
TEST (given_consistent) {
  static const char *const name[2][3] = { { "car.vx", "car.vy", "car.omega" }, { "car.x", "car.y", "car.phi" } };
  for (int slots = 0; slots < 2; slots++)
    for (int given = 1; given < 8; given++) {
      pw_model *m = scene_model (&start_axles_table, "specified", (double)slots, NULL);
      for (int j = 0; j < 3; j++)
        if (given >> j & 1) check_ok (pw_model_set_initial (m, name[slots][j], j == 0 ? 10 : 0, NULL), NULL);
      pw_system *s = scene_compile (m);
      pw_run *r = runs_open (s, "rk4", NULL);
      const pw_initial_report *start = pw_run_initial (r);
      const double *state_of = slots ? start->q : start->v;
      assert_true (start->released == 0 && start->changed == 0);
      check_close ("x of the car", state_of[0], given & 1 ? 10 : 0, START_ROUND_OFF, START_REASON);
      check_close ("x of the arm", state_of[3], given & 1 ? 10 : 0, 10 * START_ROUND_OFF, START_REASON);
      runs_close (r, s);
    }
}
