/* Errors and orders of methods; see ladder.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "ladder.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

SCENE (ladder_arm) {
  double x = cos (0.5), y = sin (0.5);
  pw_add_body (m, &(pw_body){ .name = "upper", .mass = 2, .inertia = 0.2, .start = { 0.5 * x, 0.5 * y, 0.5 } });
  pw_add_body (m, &(pw_body){ .name = "lower", .mass = 1, .inertia = 0.1, .start = { 0.5 + x, y, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "S", .body = { "upper", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "E", .body = { "lower", "upper" }, .at = { { -0.5, 0 }, { 0.5, 0 } } });
  pw_add_drive (m,
                &(pw_drive){ .name = "D",
                             .what = PW_DRIVE_ANGLE,
                             .body = { "upper", "ground" },
                             .value = { PW_HARMONIC, .harmonic = { .offset = 0.1, .amplitude = 0.4, .omega = 3 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

SCENE (ladder_tractor) {
  pw_add_body (m, &(pw_body){ .name = "body", .mass = 3, .inertia = 0.5 });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "body", .at = { -0.4, 0 } });
  pw_add_steered_wheel (
      m, &(pw_steered_wheel){ .name = "front",
                              .body = "body",
                              .at = { 0.6, 0 },
                              .heading = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 2 } } });
  pw_add_speed (m, &(pw_speed){ .name = "push",
                                .body = "body",
                                .value = { PW_HARMONIC, .harmonic = { .offset = 2, .amplitude = 1, .omega = 1 } } });
}

pw_system *ladder_open (const char *model) {
  if (strcmp (model, "arm") == 0) return scene_system (&ladder_arm_table, NULL);
  if (strcmp (model, "tractor") == 0) return scene_system (&ladder_tractor_table, NULL);
  return scene_named (model, NULL, 0);
}

ladder_error ladder_run (const char *model, const char *method, double step, double t) {
  return ladder_solve (model, method, &(pw_settings){ .step = step, .span = t, .ledger = 1 }, t);
}

ladder_error ladder_solve (const char *model, const char *method, const pw_settings *settings, double t) {
  pw_system *s = ladder_open (model), *same = ladder_open (model);
  pw_run *r = runs_open (s, method, settings);
  pw_run *exact = runs_open (same, "erk8+projection", &(pw_settings){ .rtol = 3e-14, .span = t });
  pw_sample x = runs_to (r, t), y = runs_to (exact, t);
  ladder_error e = { .cost = *pw_run_statistics (r) };
  double largest = 0, time = pw_run_scale (exact)->time;
  for (int j = 0; j < s->coords; j++) {
    e.q = fmax (e.q, fabs (x.q[j] - y.q[j]) / pw_unit (s, j));
    e.v = fmax (e.v, fabs (x.v[j] - y.v[j]) / pw_unit (s, j) * time);
  }
  for (int i = 0; i < s->rows; i++) {
    e.lambda = fmax (e.lambda, fabs (x.lambda[i] - y.lambda[i]));
    largest = fmax (largest, fabs (y.lambda[i]));
  }
  e.lambda /= largest;
  runs_close (r, s);
  runs_close (exact, same);
  return e;
}

static void ladder_check (const char *model, const char *method, const char *quantity, double coarse, double fine,
                          double h, int order, double band) {
  check_close (check_text ("%s, %s: order of %s at h = %g", model, method, quantity, h), log2 (coarse / fine), order,
               band, "the order, and the next power of h");
}

void ladder_expect (const char *model, const char *method, double h, double t, int order, double band,
                    ladder_depth depth) {
  ladder_error e[3];
  for (int i = 0; i < 3; i++) e[i] = ladder_run (model, method, ldexp (h, -i), t);
  for (int i = 0; i < 2; i++) {
    ladder_check (model, method, "positions", e[i].q, e[i + 1].q, ldexp (h, -i), order, band);
    if (depth >= LADDER_V) ladder_check (model, method, "velocities", e[i].v, e[i + 1].v, ldexp (h, -i), order, band);
    if (depth >= LADDER_LAMBDA)
      ladder_check (model, method, "multipliers", e[i].lambda, e[i + 1].lambda, ldexp (h, -i), order, band);
  }
}
