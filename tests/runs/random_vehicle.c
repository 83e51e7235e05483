#include "random_vehicle.h"
#include <math.h>
#include "runs.h"
#include "scene.h"

static double vehicle_random (unsigned *state) {
  *state = *state * 1664525u + 1013904223u;
  return (double)(*state >> 8) / (1 << 24);
}

static unsigned vehicle_seed = 1;
static int vehicle_rolls; /* 1: the second wheel rolls, and slides on a circle; half of the limits oscillate */

static pw_signal vehicle_limit (unsigned *x, double value) {
  if (!vehicle_rolls || vehicle_random (x) < 0.5) return (pw_signal){ .constant = value };
  return (pw_signal){ PW_HARMONIC, .harmonic = { .amplitude = 0.5 * value * vehicle_random (x),
                                                 .omega = 5 * vehicle_random (x),
                                                 .offset = value } };
}

SCENE (vehicle_scene) {
  unsigned *x = &vehicle_seed;
  const double d = 0.1 + 0.3 * vehicle_random (x);
  pw_add_body (m,
               &(pw_body){ .name = "a", .mass = 0.5 + vehicle_random (x), .inertia = 0.05 + 0.2 * vehicle_random (x) });
  pw_add_body (m, &(pw_body){ .name = "b",
                              .mass = 0.1 + 0.4 * vehicle_random (x),
                              .inertia = 0.01 + 0.05 * vehicle_random (x),
                              .start = { 0.5 + d, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "a", "b" }, .at = { { 0.5 }, { -d } } });
  pw_add_wheel (
      m, &(pw_wheel){
             .name = "A", .body = "a", .at = { -0.5 }, .grip = vehicle_limit (x, 0.02 + 0.2 * vehicle_random (x)) });
  const double grip = 0.05 + 0.4 * vehicle_random (x);
  if (vehicle_rolls)
    pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "C",
                                                  .body = "b",
                                                  .at = { 0.2, 0.02 },
                                                  .radius = 0.1,
                                                  .inertia = 0.002 + 0.01 * vehicle_random (x),
                                                  .grip = vehicle_limit (x, grip),
                                                  .brake = vehicle_limit (x, 0.03 * vehicle_random (x)) });
  else
    pw_add_wheel (m, &(pw_wheel){ .name = "C", .body = "b", .at = { 0.2, 0.02 }, .grip = vehicle_limit (x, grip) });
  pw_add_friction (m, &(pw_friction){ .name = "F",
                                      .body = { "a", "b" },
                                      .limit = vehicle_limit (x, 0.01 + 0.05 * vehicle_random (x)),
                                      .limit_sliding = { .constant = vehicle_random (x) < 0.5 ? 0 : 0.005 } });
  pw_add_end_stop (m, &(pw_end_stop){ .name = "S",
                                      .body = { "a", "b" },
                                      .what = PW_DRIVE_ANGLE,
                                      .low = -0.2 - vehicle_random (x),
                                      .high = 0.2 + vehicle_random (x) });
  pw_add_torque (m, &(pw_torque){ .name = "T",
                                  .body = { "a", "b" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.1 + 0.2 * vehicle_random (x),
                                                                        .omega = 1 + 4 * vehicle_random (x),
                                                                        .phase = 6 * vehicle_random (x) } } });
}

pw_system *random_vehicle (unsigned *seed, int rolls) {
  vehicle_seed = *seed, vehicle_rolls = rolls;
  pw_system *s = scene_system (&vehicle_scene_table, NULL);
  *seed = vehicle_seed;
  return s;
}

int random_vehicle_events (pw_system *s, const char *method, double step, double t, double *time, int *row) {
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .rtol = 1e-11, .span = t });
  (void)runs_to (r, t);
  int count;
  const pw_event *event = pw_run_events (r, &count);
  for (int i = 0; i < count && i < RANDOM_EVENTS; i++) time[i] = event[i].t, row[i] = 8 * event[i].row + event[i].to;
  pw_run_close (r);
  return count;
}
