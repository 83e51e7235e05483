/* Friction and other saturating forces bring bodies to rest at all tolerances, however small their velocity scale. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* All bodies slow down at 1 m/s^2 or 1 rad/s^2 and stop after v^2 / 2. */
typedef struct {
  double speed, v;
} saturation;

static const pw_parameter saturation_list[] = {
  { PW_AT (saturation, speed), 1e-8, "", "change over which the force saturates", PW_POSITIVE },
  { PW_AT (saturation, v), 1, "", "at the start", PW_POSITIVE },
  { .name = NULL },
};

static void saturation_body (pw_model *m, double vx, double omega) {
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .rate = { vx, 0, omega } });
}

SCENE_WITH (saturation_block, saturation_list, saturation) {
  saturation_body (m, p->v, 0);
  pw_add_slider (m, &(pw_slider){ .name = "s", .body = { "b", "ground" } });
  pw_add_sliding_friction (
      m,
      &(pw_sliding_friction){ .name = "f", .body = { "b", "ground" }, .limit = { .constant = 1 }, .speed = p->speed });
}

/* A block on a table that moves at 10 m/s. */
SCENE_WITH (saturation_table, saturation_list, saturation) {
  saturation_body (m, 10 + p->v, 0);
  pw_add_body (m, &(pw_body){ .name = "table", .mass = 1e9, .inertia = 1, .rate = { 10 } });
  pw_add_slider (m, &(pw_slider){ .name = "r", .body = { "table", "ground" } });
  pw_add_slider (m, &(pw_slider){ .name = "s", .body = { "b", "table" } });
  pw_add_sliding_friction (
      m,
      &(pw_sliding_friction){ .name = "f", .body = { "b", "table" }, .limit = { .constant = 1 }, .speed = p->speed });
}

SCENE_WITH (saturation_disc, saturation_list, saturation) {
  saturation_body (m, 0, p->v);
  pw_add_pin (m, &(pw_pin){ .name = "p", .body = { "b", "ground" } });
  pw_add_friction (
      m, &(pw_friction){ .name = "f", .body = { "b", "ground" }, .limit = { .constant = 1 }, .speed = p->speed });
}

SCENE_WITH (saturation_motor, saturation_list, saturation) {
  saturation_body (m, 0, p->v);
  pw_add_pin (m, &(pw_pin){ .name = "p", .body = { "b", "ground" } });
  pw_add_motor (m, &(pw_motor){ .name = "f", .body = { "b", "ground" }, .damping = 1 / p->speed, .limit = 1 });
}

SCENE_WITH (saturation_wheel, saturation_list, saturation) {
  saturation_body (m, p->v, 0);
  pw_add_wheel (m, &(pw_wheel){ .name = "w", .body = "b", .at = { 0.3, 0 } });
  pw_add_rolling_resistance (
      m, &(pw_rolling_resistance){ .name = "f", .body = "b", .at = { 0.3, 0 }, .limit = 1, .speed = p->speed });
}

/* A body that skids laterally. */
SCENE_WITH (saturation_tyre, saturation_list, saturation) {
  saturation_body (m, p->v, 0);
  pw_add_slider (m, &(pw_slider){ .name = "s", .body = { "b", "ground" } });
  pw_add_tyre (m, &(pw_tyre){ .name = "f",
                              .body = "b",
                              .heading = PW_PI / 2,
                              .stiffness = 1,
                              .speed = p->speed,
                              .load = 1,
                              .friction = 1 });
}

static const struct {
  const char *name;
  const pw_plugin_table *table;
  int state;     /* the coordinate whose velocity decreases */
  double moving; /* its final velocity */
} saturation_scenes[] = {
  { "block", &saturation_block_table, 0, 0 }, { "table", &saturation_table_table, 0, 10 },
  { "disc", &saturation_disc_table, 2, 0 },   { "motor", &saturation_motor_table, 2, 0 },
  { "wheel", &saturation_wheel_table, 0, 0 }, { "tyre", &saturation_tyre_table, 0, 0 },
};
enum { SATURATION_SCENES = sizeof saturation_scenes / sizeof *saturation_scenes };

/* Runs for 4 s, in at most a thousand steps, and checks the final state. */
static void saturation_stops (int scene, const char *method, double rtol, double atol, double speed, double v) {
  char what[160];
  pw_error error = { 0 };
  pw_sample x;
  double moving = saturation_scenes[scene].moving;
  int j = saturation_scenes[scene].state, steps = 0;
  pw_system *s = scene_system (saturation_scenes[scene].table, "speed", speed, "v", v, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = rtol, .atol = atol, .span = 4 });
  snprintf (what, sizeof what, "%s, %s, rtol %g, atol %g, speed %g, v = %g", saturation_scenes[scene].name, method,
            rtol, atol, speed, v);
  while (pw_run_time (r) < 4 && steps++ < 1000) check_ok (pw_run_advance (r, 4, &error), &error);
  check_close (what, pw_run_time (r), 4, 0, "a thousand steps: the sliding and the smoothed stop need about ten each");
  check_ok (pw_run_sample (r, 4, &x, &error), &error);
  double bound = 100 * fmax (rtol, atol) * (1 + 4 * moving) + 100 * speed;
  check_close (what, x.q[j], 4 * moving + v * v / 2, bound, "100 rtol, and the motion within the smoothing");
  check_close (what, x.v[j], moving, 10 * rtol * moving + 10 * speed, "at rest within the smoothing");
  runs_close (r, s);
}

static const char *const saturation_methods[] = { "bdf+none",   "bdf+projection", "ida+none",
                                                  "ida+index2", "ida+ggl",        "ida+si1",
                                                  "radau+ggl",  "radau+index2",   "radau+index3" };
enum { SATURATION_METHODS = sizeof saturation_methods / sizeof *saturation_methods };

/* Without bounds of the tolerances, bdf+projection ends at wrong positions, without an error. */
TEST (block) {
  static const double setting[][2] = { { 1e-6, 1e-8 }, { 1e-6, 1e-7 }, { 1e-4, 1e-8 },
                                       { 1e-4, 1e-7 }, { 1e-2, 1e-8 }, { 1e-8, 1e-10 } };
  for (int m = 0; m < SATURATION_METHODS; m++)
    for (size_t k = 0; k < sizeof setting / sizeof *setting; k++)
      for (int i = 0; i < 12; i++)
        saturation_stops (0, saturation_methods[m], setting[k][0], 0, setting[k][1], 0.2 + 0.15 * i);
}

TEST (kinds) {
  static const double setting[][2] = { { 1e-6, 1e-9 }, { 1e-5, 1e-7 }, { 1e-3, 1e-8 } };
  for (int scene = 1; scene < SATURATION_SCENES; scene++)
    for (int m = 0; m < SATURATION_METHODS; m++)
      for (size_t k = 0; k < sizeof setting / sizeof *setting; k++)
        for (int i = 0; i < 4; i++)
          saturation_stops (scene, saturation_methods[m], setting[k][0], 0, setting[k][1], 0.25 + 0.45 * i);
}

/* Explicit methods oscillate about rest, with an amplitude that the tolerance permits. */
TEST (explicit) {
  static const char *const methods[] = { "erk5+none", "erk5+projection", "erk8+projection" };
  for (int m = 0; m < 3; m++)
    for (int k = 2; k <= 3; k++)
      for (int i = 0; i < 12; i++) {
        double rtol = pow (10, -k), v = 0.2 + 0.15 * i, q[3], w[3];
        pw_system *s = scene_system (saturation_scenes[0].table, "speed", 1e-8, "v", v, NULL);
        runs_state (s, methods[m], &(pw_settings){ .rtol = rtol, .span = 4 }, 4, q, w, NULL);
        check_close (methods[m], q[0], v * v / 2, 4 * pow (rtol, 0.75), "4 s at rtol^(3/4)");
        check_close (methods[m], w[0], 0, 4 * pow (rtol, 0.75),
                     "what the error test permits with 6 states and T = 2 s");
        pw_system_free (s);
      }
}

/* The same with an absolute tolerance above the velocity scale, which pw_run_saturation returns. */
TEST (atol) {
  for (int m = 0; m < SATURATION_METHODS; m++)
    for (int i = 0; i < 4; i++) saturation_stops (0, saturation_methods[m], 1e-4, 1e-3, 1e-8, 0.25 + 0.45 * i);
  for (int scene = 0; scene < SATURATION_SCENES; scene++) {
    char element[100];
    double least;
    pw_system *s = scene_system (saturation_scenes[scene].table, "speed", 1e-8, NULL);
    pw_run *r = runs_open (s, "bdf+projection", NULL);
    int j = pw_run_saturation (r, &least, element, sizeof element);
    assert_true (j == pw_system_coordinates (s) + saturation_scenes[scene].state);
    check_close (saturation_scenes[scene].name, least, 1e-8, 1e-8 * 8 * CHECK_EPS, "round-off");
    assert_string_equal (element + strlen (element) - 2, " f");
    runs_close (r, s);
  }
}

/* A force of constant power, which is not finite at rest. */
static int saturation_power (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = 1 / x[0];
  if (gradient) gradient[0] = -1 / (x[0] * x[0]);
  return 0;
}

SCENE_WITH (saturation_driven, saturation_list, saturation) {
  static const char *const reads[] = { "b.vx", NULL };
  saturation_block (m, p);
  pw_add_force (m, &(pw_force){ .name = "p",
                                .body = "b",
                                .fx = { PW_FUNCTION, .function = { .eval = saturation_power, .reads = reads } } });
}

/* pw_run_saturation finds the velocity scale although a signal has no value at rest. */
TEST (no_rest) {
  char element[100];
  double least;
  pw_system *s = scene_system (&saturation_driven_table, "speed", 1e-3, NULL);
  pw_run *r = runs_open (s, "erk5+projection", NULL);
  assert_int_equal (pw_run_saturation (r, &least, element, sizeof element), pw_system_coordinates (s));
  check_close ("driven block", least, 1e-3, 1e-3 * 8 * CHECK_EPS, "round-off");
  runs_close (r, s);
}
