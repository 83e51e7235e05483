/* Periodic motions of vehicles: gaits against long runs, numbers of bodies, common periods of signals. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "periodic_case.h"
#include "search.h"
#include "runs.h"
#include "scene.h"

/* A gait: the EzyRoller in air, with a constant torque that makes it turn. */

static pw_system *gait_open (double bias, double omega) {
  pw_model *m = scene_model (&scene_ezyroller, "omega", omega, NULL);
  pw_add_drag (m, &(pw_drag){ .name = "air", .body = "frame", .linear = 0.2 });
  if (bias != 0) {
    const pw_signal torque = { .constant = bias };
    pw_add_torque (m, &(pw_torque){ .name = "bias", .body = { "frame", "steer" }, .value = torque });
  }
  return scene_compile (m);
}

static pw_system *gait_at (void *context, double omega, pw_error *error) {
  (void)context, (void)error;
  return gait_open (0, omega);
}

/* A run from rest ends in the gait: displacement and rotation in one period, and the factor by which the distance from
 * the gait shrinks in one period, the largest multiplier. */
static void gait_compare (double bias, int settled) {
  pw_system *s = gait_open (bias, PW_PI);
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = 0 });
  pw_periodic_orbit o = periodic_solve (x, 10, 0);
  assert_int_equal (pw_periodic_symmetries (x), 3);
  assert_int_equal (o.trivial, 3);
  double length = hypot (o.end[0] - o.q[0], o.end[1] - o.q[1]), q[3] = { 0 }, off[2] = { 0 };
  pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12 });
  for (int k = settled / 2 - 1; k <= settled / 2 + 1; k++) {
    pw_sample now = runs_to (r, k * o.period);
    off[0] = off[1], off[1] = hypot (now.q[0] - q[0], now.q[1] - q[1]) - length;
    memcpy (q, now.q, sizeof q);
  }
  check_close ("decay in a period", off[1] / off[0], o.re[0], 1e-3, "the next multiplier has died out");
  memcpy (q, runs_to (r, settled * o.period).q, sizeof q);
  pw_sample last = runs_to (r, (settled + 1) * o.period);
  check_close ("displacement", hypot (last.q[0] - q[0], last.q[1] - q[1]), length, 1e-9, "both run at 1e-12");
  check_close ("rotation", last.q[2] - q[2], o.rotation, 1e-9, "both run at 1e-12");
  assert_true (bias == 0 || fabs (o.rotation) > 0.01);
  pw_run_close (r);
  pw_periodic_close (x);
  pw_system_free (s);
}

TEST (gait) {
  gait_compare (0, 110);
}

TEST (turning_gait) {
  gait_compare (0.002, 110);
}

/* The period follows the frequency. */
TEST (frequency) {
  pw_error error = { 0 };
  pw_system *s = gait_open (0, 3);
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .compile = gait_at, .first = 3, .last = 4, .points = 4 });
  periodic_solve (x, 10, 3);
  pw_periodic_orbit o;
  check_ok (pw_periodic_follow (x, 1, &error), &error);
  for (int i = 0;; i++) {
    check_ok (pw_periodic_next (x, &o, &error), &error);
    if (o.event == PW_PERIODIC_END) break;
    check_close ("period", o.period, 2 * PW_PI / o.parameter, 1e-13, "of the signal");
    assert_true (i < 40);
  }
  pw_periodic_close (x);
  x = periodic_open (s, &(pw_periodic_settings){ .period = 2 * PW_PI / 3, .compile = gait_at, .first = 3, .last = 4 });
  periodic_solve (x, 10, 3);
  assert_int_equal (pw_periodic_follow (x, 1, &error), PW_INPUT); /* the derivative needs a neighbour */
  assert_non_null (strstr (error.text, "signal rider.value does not repeat after 2.09439510239 s"));
  for (int i = 0; i < 5; i++) assert_int_equal (pw_periodic_solve (x, 1, 3.5, &o, &(pw_error){ 0 }), PW_INPUT);
  pw_periodic_close (x);
  pw_system_free (s);
}

static pw_system *snake_at (void *context, double n, pw_error *error) {
  (void)context;
  if (n != floor (n)) return pw_fail (error, PW_INPUT, "%g bodies", n), NULL;
  return gallery_open ("wheeled-snake", "n", n, NULL);
}

/* A parameter that changes the number of bodies is refused every time. */
TEST (bodies) {
  pw_periodic_orbit o;
  pw_system *s = snake_at (NULL, 3, NULL);
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .compile = snake_at, .first = 3, .last = 5 });
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    assert_int_equal (pw_periodic_solve (x, 0, 4, &o, &error), PW_INPUT);
    check_error (&error, PW_INPUT,
                 "model wheeled-snake: the parameter changes the number of bodies or constraint equations");
  }
  pw_periodic_close (x);
  pw_system_free (s);
}

/* A common period does not depend on the order of the signals. */
TEST (common_period) {
  for (int i = 0; i < 2; i++) {
    pw_model *m = scene_model (&scene_ezyroller, "omega", i == 0 ? 2 * PW_PI : 2 * PW_PI / 30, NULL);
    const pw_harmonic other = { .amplitude = 1, .omega = i == 0 ? 2 * PW_PI / 30 : 2 * PW_PI };
    const pw_signal torque = { .type = PW_HARMONIC, .harmonic = other };
    pw_add_torque (m, &(pw_torque){ .name = "torque", .body = { "frame", "steer" }, .value = torque });
    pw_system *s = scene_compile (m);
    check_close ("period", pw_system_period (s), 30, 1e-13, "30 = 30 * 1");
    pw_system_free (s);
  }
}

/* A trial far away is repeated nearer, instead of ending the search. */
TEST (wild) {
  double u[40] = { 1e200 };
  pw_error error = { 0 };
  pw_system *s = gallery_open ("snakeboard", NULL);
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .period = 4 });
  assert_true (pw_periodic_unknowns (x) < 40);
  assert_int_equal (pw_periodic_flow (x, u, PW_FLOW, &error), PW_RETRY);
  pw_periodic_close (x);
  pw_system_free (s);
}
