/* Initial conditions: given values are kept, the others change as little as possible. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "model.h"
#include "scene.h"
#include "system.h"
#include "start.h"
#include "toys.h"
#include "trial.h"

/* ---- Given values are kept ---- */

TEST (given_values_kept) {
  static const char *const name[] = { "frame.phi", "steer.phi", "frame.vx", NULL };
  static const double value[] = { 0.3, 2, 1.5 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_int_equal (start->released, 0);
  assert_true (start->q[2] == 0.3 && start->q[5] == 2 && start->v[0] == 1.5);
  int moved = 0;
  for (int j = 0; j < 6; j++) moved += (start->q[j] != start->q_given[j]) + (start->v[j] != start->v_given[j]);
  assert_true (start->moved == moved && moved > 0);
  assert_true (start->q_given[3] == 0.375 && start->v_given[0] == 1.5 && start->position > 0.01 &&
               start->velocity > 0.01);
  runs_close (r, s);
}

/* All states of the frame are given; they satisfy the row of wheel A, which has no other coordinates. */
TEST (given_body_kept) {
  static const char *const name[] = { "frame.x",  "frame.y",     "frame.phi", "frame.vx",
                                      "frame.vy", "frame.omega", "steer.phi", NULL };
  static const double value[] = { 1, 2, 0, 1, 0.1, 0.2, PW_PI / 2 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_int_equal (start->released, 0);
  const double q[] = { 1, 2, 0, 1.5, 2.125, PW_PI / 2 }, v[] = { 1, 0.1, 0.2, 1, 0.2, 4 };
  check_bits ("frame", start->q, q, 3);
  check_bits ("frame", start->v, v, 3);
  for (int j = 3; j < 6; j++) check_close ("steer", start->q[j], q[j], 8 * CHECK_EPS, "8 eps: round-off");
  /* wheel C does not slip: at phi = pi/2 its lateral velocity is vx - 0.125 omega = 0 */
  check_close ("steer.omega", start->v[5], start->v[3] / 0.125, 64 * CHECK_EPS, "64 eps: round-off");
  runs_close (r, s);
}

/* A chain whose second link is displaced, with a gear between the first and the third. */
static void start_chain (pw_model *m, const void *parameters) {
  static char link[16][16], pin[16][16];
  for (int i = 0; i < *(const double *)parameters; i++) {
    double off = i == 1 ? 0.05 : 0;
    snprintf (link[i], sizeof link[i], "link%d", i);
    snprintf (pin[i], sizeof pin[i], "pin%d", i);
    pw_add_body (m, &(pw_body){ .name = link[i], .mass = 1, .inertia = 0.1, .start = { i + 0.5 + off, off, 0 } });
    pw_add_pin (m, &(pw_pin){ .name = pin[i],
                              .body = { i > 0 ? link[i - 1] : "ground", link[i] },
                              .at = { { i > 0 ? 0.5 : 0, 0 }, { -0.5, 0 } } });
  }
  pw_add_gear (m, &(pw_gear){ .name = "gear", .body = { "link0", "link2", "ground" }, .ratio = 1 });
}

/* Given values are kept if they satisfy a constraint without other coordinates, in scenes of any size: all coordinates
 * of a body pinned to the ground, both angles of a gear. */
TEST (given_satisfied_rows) {
  static const char *const name[] = { "link0.x", "link0.y", "link0.phi", "link2.phi" };
  static const double value[] = { 0.5, 0, 0, 0 };
  static const pw_parameter list[] = { { .name = "links", .value = 3 }, { .name = NULL } };
  static const pw_plugin_table table = SCENE_TABLE_WITH (start_chain, list, sizeof (double));
  for (int links = 3; links <= 16; links++) {
    pw_error error = { 0 };
    pw_model *m = scene_model (&table, "links", (double)links, NULL);
    for (int i = 0; i < 4; i++) check_ok (pw_model_set_initial (m, name[i], value[i], &error), &error);
    pw_system *s = scene_compile (m);
    pw_run *r = runs_open (s, "rk4", NULL);
    const pw_initial_report *start = pw_run_initial (r);
    assert_true (start->released == 0 && start->moved > 0);
    check_bits ("link0", start->q, value, 3);
    assert_true (start->q[8] == 0);
    check_below ("position", runs_to (r, 0).position, START_ROUND_OFF, START_REASON);
    runs_close (r, s);
  }
}

/* Discs on massless arms.  Position and velocity of a disc's centre are given: with its arm's pins they leave one
 * equation that they satisfy, in scenes of any size. */
static void start_arms (pw_model *m, const void *parameters) {
  static char disc[40][16], arm[40][16], pin[80][16];
  for (int i = 0; i < *(const double *)parameters; i++) {
    snprintf (disc[i], sizeof disc[i], "disc%d", i);
    snprintf (arm[i], sizeof arm[i], "arm%d", i);
    snprintf (pin[2 * i], sizeof *pin, "tip%d", i);
    snprintf (pin[2 * i + 1], sizeof *pin, "hub%d", i);
    pw_add_body (
        m,
        &(pw_body){ .name = disc[i], .mass = 2, .inertia = 0.5, .start = { 3 * i + 0.6, 0.8 }, .rate = { -0.8, 0.6 } });
    pw_add_body (m, &(pw_body){ .name = arm[i], .start = { 0, 0, 0.3 } });
    pw_add_pin (m, &(pw_pin){ .name = pin[2 * i], .body = { disc[i], arm[i] }, .at = { { 0 }, { 0.4, 0.3 } } });
    pw_add_pin (
        m, &(pw_pin){ .name = pin[2 * i + 1], .body = { arm[i], "ground" }, .at = { { -0.4, -0.3 }, { 3 * i, 0 } } });
  }
}

TEST (given_centre_kept) {
  static const char *const name[] = { "disc0.x", "disc0.y", "disc0.vx", "disc0.vy" };
  static const double value[] = { 0.6, 0.8, -0.8, 0.6 };
  static const pw_parameter list[] = { { .name = "arms", .value = 1 }, { .name = NULL } };
  static const pw_plugin_table table = SCENE_TABLE_WITH (start_arms, list, sizeof (double));
  for (int arms = 1; arms <= 40; arms += 13) {
    pw_error error = { 0 };
    pw_model *m = scene_model (&table, "arms", (double)arms, NULL);
    for (int i = 0; i < 4; i++) check_ok (pw_model_set_initial (m, name[i], value[i], &error), &error);
    pw_system *s = scene_compile (m);
    pw_run *r = runs_open (s, "rk4", NULL);
    const pw_initial_report *start = pw_run_initial (r);
    assert_true (start->released == 0 && start->moved > 0);
    check_bits ("position", start->q, value, 2);
    check_bits ("velocity", start->v, value + 2, 2);
    check_below ("position", runs_to (r, 0).position, START_ROUND_OFF, START_REASON);
    runs_close (r, s);
  }
}

/* A given angle of the massless steering assembly does not change the frame. */
TEST (massive_body_kept) {
  static const char *const name[] = { "steer.phi", NULL };
  static const double value[] = { 2 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  const double frame[3] = { 0 };
  assert_int_equal (start->released, 0);
  check_bits ("frame", start->q, frame, 3);
  assert_true (start->q[5] == 2 && start->moved == 2);
  runs_close (r, s);
}

/* The angle of a wheel is specified, and velocities that violate its constraint: the velocities change. */
SCENE (start_slipping) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1, .rate = { 1, 0.3, 0.2 } });
  pw_add_body (m, &(pw_body){ .name = "steer", .start = { 0, 0, 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.125, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "C", .body = "steer" });
}

TEST (velocities_change) {
  pw_system *s = scene_system (&start_slipping_table, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  const pw_initial_report *start = pw_run_initial (r);
  const double frame[3] = { 0 };
  check_bits ("frame", start->q, frame, 3);
  assert_true (start->q[5] == 2 && start->v[1] != 0.3);
  runs_close (r, s);
}

/* Of given positions that contradict each other the one that is not 0 is kept; given velocities are kept. */
TEST (velocities_kept) {
  static const char *const name[] = { "frame.x", "steer.x", "steer.vy", NULL };
  static const double value[] = { 0, 5.375, 5 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_int_equal (start->released, 1);
  assert_true (start->v[4] == 5 && start->q[3] == 5.375 && start->q[0] > 4);
  runs_close (r, s);
}

/* Given values that contradict each other: some are released. */
TEST (released) {
  static const char *const name[] = { "frame.x", "frame.y", "frame.phi", "steer.x", NULL };
  static const double value[] = { 0, 0, 0, 3 };
  pw_system *s;
  pw_run *r = start_open (&s, name, value);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->released == 1 && start->moved > 0);
  runs_close (r, s);
}

/* ---- The smallest change: M-orthogonal to all admissible velocities ---- */

SCENE (start_massive) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1 });
  pw_add_body (m, &(pw_body){ .name = "steer", .mass = 0.4, .inertia = 0.02, .start = { 0.375, 0, PW_PI } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.125, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
}

/* A restart at other velocities, of which none is specified. */
TEST (least_change) {
  double v[6][6], change[6][6];
  pw_error error = { 0 };
  pw_system *s = scene_system (&start_massive_table, NULL);
  for (int i = 0; i < 6; i++) {
    const double omega = 0.7 - i * i, from[6] = { 1.0 + i, 0.3, omega, 0.1, omega, 1 };
    double q[6];
    pw_run *r = runs_open (s, "rk4", NULL);
    memcpy (q, pw_run_initial (r)->q, sizeof q);
    check_ok (pw_run_restart (r, q, from, &error), &error);
    memcpy (v[i], pw_run_initial (r)->v, sizeof v[i]);
    for (int j = 0; j < 6; j++) change[i][j] = v[i][j] - from[j];
    pw_run_close (r);
  }
  for (int i = 1; i < 6; i++) { /* differences of consistent velocities are admissible */
    double sum = 0, size = 0;
    for (int j = 0; j < 6; j++) {
      sum += (v[i][j] - v[0][j]) * s->mass[j] * change[0][j];
      size += fabs ((v[i][j] - v[0][j]) * s->mass[j] * change[0][j]);
    }
    check_close ("admissible velocity . M . change", sum, 0, 64 * CHECK_EPS * (1 + size),
                 "64 eps of the terms: round-off");
  }
  pw_system_free (s);
}

/* ---- A constraint with a signal ---- */

SCENE (start_driven) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add (m, &toy_kind_drive,
          &(toy_drive){ .name = "motor",
                        .body = { "disc", "ground" },
                        .angle = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 2, .phase = 1 } } });
}

TEST (driven_constraint) {
  pw_system *s = scene_system (&start_driven_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .t = 3, .span = 1 });
  const pw_initial_report *start = pw_run_initial (r);
  check_close ("angle", start->q[2], 0.5 * cos (7), 4 * CHECK_EPS, "4 eps: round-off");
  check_close ("rate", start->v[2], -sin (7), 4 * CHECK_EPS, "4 eps: round-off");
  pw_sample now = runs_to (r, 4);
  check_close ("angle", now.q[2], 0.5 * cos (9), 4 * CHECK_EPS, "projected: round-off");
  runs_close (r, s);
}

/* ---- Inconsistent initial conditions ---- */

SCENE (start_too_far) {
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = 1, .start = { 1.5, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "left", .body = { "rod", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "right", .body = { "rod", "ground" }, .at = { { 0.5, 0 }, { 3, 0 } } });
}

/* Two drives turn one disc at different speeds. */
SCENE (start_contradictory) {
  start_driven (m, NULL);
  m->body[0].start[2] = 0.5 * cos (1);
  pw_add (m, &toy_kind_drive,
          &(toy_drive){ .name = "other",
                        .body = { "disc", "ground" },
                        .angle = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 3, .phase = 1 } } });
}

/* Speeds contradict each other; that of another body has a larger residual, but can be satisfied. */
SCENE (start_speeds) {
  pw_add_body (m, &(pw_body){ .name = "fast", .mass = 1, .inertia = 1, .rate = { 1e4 } });
  pw_add_body (m, &(pw_body){ .name = "slow", .mass = 1, .inertia = 1 });
  pw_add_speed (m, &(pw_speed){ .name = "other", .body = "fast", .value.constant = 10050 });
  pw_add_speed (m, &(pw_speed){ .name = "one", .body = "slow", .value.constant = 1 });
  pw_add_speed (m, &(pw_speed){ .name = "two", .body = "slow", .value.constant = 2 });
}

static void start_expect_error (const pw_plugin_table *table, const char *text) {
  pw_error error = { 0 };
  pw_system *s = scene_system (table, NULL);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (&error, PW_INITIAL, text);
  pw_system_free (s);
}

TEST (inconsistent) {
  start_expect_error (&start_too_far_table,
                      "model scene: the initial state cannot be made consistent: pin left is open by 1 m; if it "
                      "can close, begin nearer to where it does");
  start_expect_error (
      &start_contradictory_table,
      "model scene: no velocities satisfy the constraints: drive motor, drive other contradict each other");
  start_expect_error (&start_speeds_table,
                      "model scene: no velocities satisfy the constraints: speed one, speed two contradict each other");
}
