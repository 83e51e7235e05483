/* Wheels that lock a body, and constraints that contradict each other: refused, with the names of the elements. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- Wheels that lock a body ---- */

typedef struct {
  double wheels, speed, torque;
} locked_cart;

static const pw_parameter locked_cart_list[] = {
  { PW_AT (locked_cart, wheels), 3, "", "number of wheels, no two on one axle", PW_COUNT },
  { PW_AT (locked_cart, speed), 0, "m/s", "initial speed", PW_REAL },
  { PW_AT (locked_cart, torque), 2, "N m", "on the body", PW_REAL },
  { .name = NULL },
};

SCENE_WITH (locked_build_cart, locked_cart_list, locked_cart) {
  static const char *const name[] = { "front", "left", "right", "rear" };
  static const double at[][3] = { { 0.5, 0, 0.3 }, { 0, 0.4, -0.2 }, { 0, -0.4, 0.1 }, { -0.5, 0.1, 0.7 } };
  pw_add_body (
      m, &(pw_body){ .name = "cart", .mass = 3, .inertia = 0.2, .start = { 1, 2, 0.3 }, .rate = { p->speed, 0, 0 } });
  for (int i = 0; i < (int)p->wheels; i++)
    pw_add_wheel (m, &(pw_wheel){ .name = name[i], .body = "cart", .at = { at[i][0], at[i][1] }, .heading = at[i][2] });
  pw_add_torque (m, &(pw_torque){ .name = "push", .body = { "cart", "ground" }, .value = { .constant = p->torque } });
}

/* The cart stays at rest under a torque. */
TEST (locked) {
  static const char *const method[] = {
    "rk4+none",       "rk4+baumgarte", "rk4+projection", "rk4+projection:metric=identity",
    "ida+none",       "ida+baumgarte", "ida+ggl",        "ida+index2",
    "ida+si1",        "adams+none",    "bdf+none",       "bdf+baumgarte",
    "bdf+projection", "rk4+nullspace", "galpha+index3",  "galpha+ggl",
    "leapfrog",       "radau+ggl",     "radau+index2",   "radau+index3"
  };
  for (int wheels = 3; wheels <= 4; wheels++)
    for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
      pw_system *s = scene_system (&locked_build_cart_table, "wheels", (double)wheels, NULL);
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .rtol = 1e-8, .span = 2 });
      assert_int_equal (pw_run_redundant (r), wheels - 3);
      pw_sample x = runs_to (r, 2);
      const double q[] = { 1, 2, 0.3 };
      for (int j = 0; j < 3; j++) {
        check_close (method[i], x.q[j], q[j], 16 * CHECK_EPS, "at rest");
        check_close (method[i], x.v[j], 0, 16 * CHECK_EPS, "at rest");
      }
      runs_close (r, s);
    }
}

TEST (locked_with_velocity) {
  for (int wheels = 3; wheels <= 4; wheels++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&locked_build_cart_table, "wheels", (double)wheels, "speed", 1.5, NULL);
    assert_null (pw_run_open (s, "rk4+projection", NULL, &error));
    check_error (&error, PW_INITIAL,
                 wheels == 3
                     ? "model scene: the given velocities would have to be removed entirely: wheel front, wheel left, "
                       "wheel right allow no such motion; wheels that slip sideways are of type tyre"
                     : "model scene: the given velocities would have to be removed entirely: wheel front, wheel left, "
                       "wheel right, wheel rear allow no such motion; wheels that slip sideways are of type tyre");
    pw_system_free (s);
  }
}

/* Wheels steered in parallel lock while the car moves; a drive and a wheel that contradict each other get no advice. */
SCENE (locked_steering) {
  static const double at[4][2] = { { -1, 0.5 }, { -1, -0.5 }, { 1, 0.5 }, { 1, -0.5 } };
  static const char *const name[] = { "rear-left", "rear-right", "left", "right" };
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 1, .inertia = 1, .rate = { 1, 0, 0 } });
  for (int i = 0; i < 2; i++)
    pw_add_wheel (m, &(pw_wheel){ .name = name[i], .body = "car", .at = { at[i][0], at[i][1] } });
  for (int i = 2; i < 4; i++)
    pw_add_steered_wheel (
        m, &(pw_steered_wheel){
               .name = name[i],
               .body = "car",
               .at = { at[i][0], at[i][1] },
               .heading = { PW_HARMONIC, .harmonic = { .amplitude = 0.1, .omega = 1, .phase = -PW_PI / 2 } } });
}

TEST (steered_to_lock) {
  static const char *const method[] = { "rk4+projection", "ida+ggl", "radau+ggl", "galpha+ggl", "erk8", "leapfrog" };
  pw_system *s = scene_system (&locked_steering_table, NULL);
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_error error = { 0 };
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .span = 1 });
    assert_int_equal (pw_run_advance_to (r, 1, 1, &error), PW_METHOD);
    assert_non_null (strstr (error.text, "constraints contradict each other: steered-wheel "));
    assert_non_null (strstr (error.text, "; wheels that slip sideways are of type tyre"));
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* A body on rolling wheels that cross: both rows of a wheel are violated, and it is named once. */
SCENE (locked_cross) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 1, .inertia = 1, .rate = { 1, 0.5, 0 } });
  for (int i = 0; i < 2; i++)
    pw_add_rolling_wheel (
        m,
        &(pw_rolling_wheel){ .name = i ? "across" : "along", .body = "cart", .heading = i * PW_PI / 2, .radius = 1 });
}

TEST (crossed_wheels_locked) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&locked_cross_table, NULL);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (
      &error, PW_INITIAL,
      "model scene: the given velocities would have to be removed entirely: rolling-wheel along, rolling-wheel "
      "across allow no such motion; wheels that slip sideways are of type tyre");
  pw_system_free (s);
}

/* A wheel across the velocity specified.  Its rolling direction has a component of 6e-17 along it, due to round-off. */
SCENE (locked_across) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 1, .inertia = 1, .rate = { 3 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "wheel", .body = "cart", .heading = PW_PI / 2 });
}

TEST (round_off_allows_no_motion) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&locked_across_table, NULL);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (
      &error, PW_INITIAL,
      "model scene: the given velocities would have to be removed entirely: wheel wheel allows no such motion");
  pw_system_free (s);
}

/* A body specified at rest, whose wheel is specified to spin: the value that is not 0 is kept. */
SCENE (locked_spin) {
  pw_add_body (m, &(pw_body){ .name = "cart",
                              .mass = 1,
                              .inertia = 1,
                              .specified = PW_SPECIFIES_VX | PW_SPECIFIES_VY | PW_SPECIFIES_OMEGA });
  pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "wheel", .body = "cart", .radius = 1, .rate = 1 });
}

TEST (spinning_wheel_moves) {
  pw_system *s = scene_system (&locked_spin_table, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->v[0] == 1 && start->v[3] == 1 && start->changed == 1);
  runs_close (r, s);
}

/* A tricycle with turned front wheel rests if its speed is given as 0, though its parts move in the model. */
SCENE (locked_build_tricycle) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 1, .rate = { 1, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "fork", .mass = 1, .inertia = 1, .start = { 1, 0, 0.5 }, .rate = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "head", .body = { "frame", "fork" }, .at = { { 1, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "frame" });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "fork" });
}

TEST (rest_given) {
  pw_system *s = scene_system (&locked_build_tricycle_table, NULL);
  pw_initial_value rest = { .state = pw_system_find_state (s, "frame.vx", NULL), .value = 0 };
  pw_run *r = runs_open (s, "rk4", &(pw_settings){ .initial = &rest, .initials = 1 });
  const pw_initial_report *start = pw_run_initial (r);
  assert_true (start->v[0] == 0 && fabs (start->v[3]) < CHECK_EPS * 10 && start->changed == 1);
  runs_close (r, s);
}

/* A weld removes the given velocity; the wheel allows it. */
SCENE (locked_build_post) {
  pw_add_body (m, &(pw_body){ .name = "post", .mass = 1, .inertia = 1, .rate = { 1, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "sledge", .mass = 1, .inertia = 1 });
  pw_add_weld (m, &(pw_weld){ .name = "base", .body = { "post", "ground" } });
  pw_add_wheel (m, &(pw_wheel){ .name = "skate", .body = "sledge" });
}

TEST (wheel_not_to_blame) {
  pw_system *s = scene_system (&locked_build_post_table, NULL);
  runs_close (runs_open (s, "rk4", NULL), s);
}

/* Most of the velocity is lateral: accepted, although the constraint removes all but a hundredth of it. */
SCENE (locked_build_skidding) {
  pw_add_body (m, &(pw_body){ .name = "skate", .mass = 1, .inertia = 1, .rate = { 0.01, 1, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "skate" });
}

TEST (skidding) {
  pw_system *s = scene_system (&locked_build_skidding_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  pw_sample x = runs_to (r, 1);
  check_close ("longitudinal", x.v[0], 0.01, 16 * CHECK_EPS, "the part that the wheel allows");
  check_close ("lateral", x.v[1], 0, 16 * CHECK_EPS, "the wheel does not slip");
  runs_close (r, s);
}

/* Three axles that initially meet in one point, until the third wheel is steered. */
static int locked_steer (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = 0.5 * t * t;
  value[1] = t;
  value[2] = 1;
  return 0;
}

SCENE (locked_build_steered) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 3, .inertia = 0.2, .rate = { 1, 0, 0 } });
  pw_add_body (m,
               &(pw_body){ .name = "fork", .mass = 0.2, .inertia = 0.01, .start = { 0.5, 0, 0 }, .rate = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "head", .body = { "cart", "fork" }, .at = { { 0.5, 0 } } });
  pw_add_drive (m, &(pw_drive){ .name = "steering",
                                .body = { "fork", "cart" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_FUNCTION, .function = { .eval = locked_steer } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "middle", .body = "cart" });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "cart", .at = { -0.5, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "fork" });
}

/* Wheels that lock during the motion stop the run with the name of a wheel. */
TEST (locks_in_motion) {
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte",  "rk4+none",      "ida+baumgarte",
                                        "ida+ggl",        "rk4+nullspace",  "galpha+index3", "galpha+ggl",
                                        "adams+none",     "ida+si1",        "ida+index2",    "adams+baumgarte",
                                        "bdf+baumgarte",  "bdf+projection", "leapfrog",      "radau+ggl",
                                        "radau+index2",   "radau+index3" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&locked_build_steered_table, NULL);
    pw_run *r = pw_run_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-8, .span = 1 }, &error);
    int status = r ? pw_run_advance_to (r, 1, 1, &error) : error.status;
    print_message ("%s: %s\n", method[i], error.text);
    assert_true (status == PW_METHOD || status == PW_INITIAL);
    assert_non_null (strstr (error.text, "wheel "));
    assert_null (strstr (error.text, "in position")); /* wheels constrain velocities only */
    /* the heading t^2 / 2 must exceed the error that the tolerance permits in the others */
    if (r) check_below ("time", pw_run_time (r), 0.05, "the heading is then 1e-3");
    if (r) pw_run_close (r);
    pw_system_free (s);
  }
}

/* ---- Contradictory constraints ---- */

/* Two bodies at pivots 10 m apart, with a weld between their ends, 1 m from the pivots. */
SCENE (locked_build_gap) {
  pw_add_body (m, &(pw_body){ .name = "left", .mass = 1, .inertia = 0.1, .start = { 0.5, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "right", .mass = 1, .inertia = 0.1, .start = { 9.5, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "left", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "right", "ground" }, .at = { { 0.5, 0 }, { 10, 0 } } });
  pw_add_weld (m, &(pw_weld){ .name = "joint", .body = { "left", "right" }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
}

TEST (open_weld) {
  pw_error error = { 0 };
  double open = 0;
  pw_system *s = scene_system (&locked_build_gap_table, NULL);
  assert_null (pw_run_open (s, "rk4+projection", NULL, &error));
  print_message ("%s\n", error.text);
  assert_int_equal (error.status, PW_INITIAL);
  const char *by = strstr (error.text, " is open by ");
  assert_non_null (by);
  assert_true (sscanf (by, " is open by %lf", &open) == 1 && open > 1 && open < 10);
  pw_system_free (s);
}

typedef struct {
  double offset;
} locked_offset;

static const pw_parameter locked_offset_list[] = {
  { PW_AT (locked_offset, offset), 0, "rad", "initial angle of the second drive", PW_REAL },
  { .name = NULL },
};

/* Two drives prescribe different angles of one body. */
SCENE_WITH (locked_build_drives, locked_offset_list, locked_offset) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 0.1 });
  pw_add_pin (m, &(pw_pin){ .name = "hub", .body = { "disc", "ground" } });
  pw_add_drive (m, &(pw_drive){ .name = "one", .body = { "disc", "ground" }, .what = PW_DRIVE_ANGLE });
  pw_signal other = { .constant = p->offset };
  if (p->offset == 0) other = (pw_signal){ PW_FUNCTION, .function = { .eval = locked_steer } };
  pw_add_drive (m, &(pw_drive){ .name = "two", .body = { "disc", "ground" }, .what = PW_DRIVE_ANGLE, .value = other });
}

TEST (contradictory_drives) {
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte",   "ida+ggl",    "ida+baumgarte",
                                        "rk4+nullspace",  "galpha+index3",   "galpha+ggl", "ida+si1",
                                        "bdf+projection", "adams+baumgarte", "leapfrog" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&locked_build_drives_table, "offset", 0.1, NULL);
    assert_null (pw_run_open (s, method[i], NULL, &error));
    print_message ("%s\n", error.text);
    assert_int_equal (error.status, PW_INITIAL);
    assert_non_null (strstr (error.text, "drive "));
    pw_system_free (s);
    error = (pw_error){ 0 };
    s = scene_system (&locked_build_drives_table, NULL);
    pw_run *r = pw_run_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-6, .span = 1 }, &error);
    int status = r ? pw_run_advance_to (r, 1, 1, &error) : error.status;
    print_message ("%s\n", error.text);
    assert_true (status == PW_METHOD || status == PW_INITIAL);
    assert_non_null (strstr (error.text, "drive "));
    if (r) pw_run_close (r);
    pw_system_free (s);
  }
}
