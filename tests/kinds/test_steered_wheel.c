/* steered-wheel: a steered car, an equivalent massless fork, a constant heading. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- A car, its centre of mass on the rear axle, its front wheel at the distance L ahead ----
 *
 *   phi' = v tan(u) / L,  (m + I tan^2(u) / L^2) v^2 is constant: steering does no work */

static const struct { double m, I, L, v, A, w, o; } steered_c = { 2, 0.5, 0.9, 1.5, 0.5, 2, 0.2 };

#define STEERED_HEADING                                                                               \
  {                                                                                                   \
    PW_HARMONIC, .harmonic = {.amplitude = steered_c.A, .omega = steered_c.w, .offset = steered_c.o } \
  }

static double steered_angle (double t) {
  return steered_c.o + steered_c.A * cos (steered_c.w * t);
}

SCENE (steered_car) {
  pw_add_body (m, &(pw_body){ .name = "car",
                              .mass = steered_c.m,
                              .inertia = steered_c.I,
                              .rate = { steered_c.v, 0, steered_c.v * tan (steered_angle (0)) / steered_c.L } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "car" });
  pw_add_steered_wheel (
      m, &(pw_steered_wheel){ .name = "front", .body = "car", .at = { steered_c.L, 0 }, .heading = STEERED_HEADING });
}

static double steered_speed (double t) {
  double k = steered_c.I / (steered_c.m * steered_c.L * steered_c.L), a = tan (steered_angle (0)),
         b = tan (steered_angle (t));
  return steered_c.v * sqrt ((1 + k * a * a) / (1 + k * b * b));
}

/* x, y, phi at t_end, by Simpson's rule, for phi with half the step. */
static void steered_path (double t_end, double out[3]) {
  enum { STEPS = 4000 };
  double h = t_end / STEPS;
  out[0] = out[1] = out[2] = 0;
  for (int i = 0; i < STEPS; i++) {
    double phi[3] = { out[2] }, rate[5], v[3];
    for (int k = 0; k < 5; k++) {
      double t = (i + k / 4.0) * h;
      rate[k] = steered_speed (t) * tan (steered_angle (t)) / steered_c.L;
      if (k % 2 == 0) v[k / 2] = steered_speed (t);
    }
    phi[1] = phi[0] + h / 12 * (rate[0] + 4 * rate[1] + rate[2]);
    phi[2] = phi[1] + h / 12 * (rate[2] + 4 * rate[3] + rate[4]);
    out[0] += h / 6 * (v[0] * cos (phi[0]) + 4 * v[1] * cos (phi[1]) + v[2] * cos (phi[2]));
    out[1] += h / 6 * (v[0] * sin (phi[0]) + 4 * v[1] * sin (phi[1]) + v[2] * sin (phi[2]));
    out[2] = phi[2];
  }
}

static void steered_drive (const char *method, double bound, const char *reason) {
  const double t = 4;
  double path[3];
  steered_path (t, path);
  pw_system *s = scene_system (&steered_car_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = t, .ledger = 1 });
  check_below ("start", pw_run_initial (r)->velocity, 16 * CHECK_EPS, "given consistently");
  pw_sample x = runs_to (r, t);
  for (int i = 0; i < 3; i++) check_close ("path", x.q[i], path[i], bound, reason);
  check_close ("speed", hypot (x.v[0], x.v[1]), steered_speed (t), bound, reason);
  check_close ("kinetic", x.balance, 0, bound, reason);
  assert_true (x.work == 0);
  runs_close (r, s);
}

TEST (car) {
  steered_drive ("rk4+projection", 1e-10, "(h w)^4 at h = 1e-3 and w = 2/s, over 4 s");
  steered_drive ("rk4+baumgarte", 1e-10, "(h w)^4 at h = 1e-3 and w = 2/s, over 4 s");
  steered_drive ("ida+ggl", 1e-6, "1e4 rtol");
  steered_drive ("ida+baumgarte", 1e-6, "1e4 rtol");
}

/* ---- Compared with a wheel on a massless fork that a drive turns ---- */

typedef struct {
  double by; /* front wheel: 0: steered, 1: on a fork, 2: fixed heading 0.3, 3: steered to the constant heading 0.3 */
} steered_parameters;

static const pw_parameter steered_list[] = {
  { PW_AT (steered_parameters, by), 0, "", "type of the front wheel", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (steered_truck, steered_list, steered_parameters) {
  int by = (int)p->by;
  const double at[2] = { 0.6, 0.15 };
  pw_add_body (m, &(pw_body){ .name = "truck", .mass = 2, .inertia = 0.3, .rate = { 1 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "truck", .at = { -0.5, 0.1 }, .heading = 0.1 });
  pw_add_torque (m, &(pw_torque){ .name = "T",
                                  .body = { "truck", "ground" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.3, .omega = 1 } } });
  if (by == 0)
    pw_add_steered_wheel (
        m, &(pw_steered_wheel){ .name = "front", .body = "truck", .at = { at[0], at[1] }, .heading = STEERED_HEADING });
  if (by == 2)
    pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "truck", .at = { at[0], at[1] }, .heading = 0.3 });
  if (by == 3)
    pw_add_steered_wheel (
        m, &(pw_steered_wheel){
               .name = "front", .body = "truck", .at = { at[0], at[1] }, .heading = { PW_CONSTANT, .constant = 0.3 } });
  if (by != 1) return;
  pw_add_body (m, &(pw_body){ .name = "fork", .start = { at[0], at[1], steered_angle (0) } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "truck", "fork" }, .at = { { at[0], at[1] }, { 0, 0 } } });
  pw_add_drive (
      m,
      &(pw_drive){ .name = "handle", .body = { "fork", "truck" }, .what = PW_DRIVE_ANGLE, .value = STEERED_HEADING });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "fork" });
}

static void steered_compare (double one, double other, double bound, const char *reason) {
  pw_system *s = scene_system (&steered_truck_table, "by", one, NULL),
            *p = scene_system (&steered_truck_table, "by", other, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 }),
         *q = runs_open (p, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  for (int j = 0; j < 3; j++)
    check_close ("start", pw_run_initial (r)->v[j], pw_run_initial (q)->v[j], 1e-5, "small weights of a massless fork");
  for (int i = 1; i <= 4; i++) {
    pw_sample x = runs_to (r, 0.5 * i), y = runs_to (q, 0.5 * i);
    for (int j = 0; j < 3; j++) {
      check_close ("q", x.q[j], y.q[j], bound, reason);
      check_close ("v", x.v[j], y.v[j], bound, reason);
    }
    check_close ("front", trial_reaction (s, &x, "front.N"), trial_reaction (p, &y, "front.N"), 10 * bound, reason);
    check_close ("work", x.work, y.work, bound, reason);
  }
  pw_run_close (r), pw_run_close (q);
  pw_system_free (s), pw_system_free (p);
}

TEST (fork) {
  steered_compare (0, 1, 1e-9, "(h w)^4 at h = 1e-3 and w = 2/s: two projections");
  steered_compare (2, 3, 1e5 * CHECK_EPS, "round-off of 2000 steps");
}

/* ---- By all methods ---- */

TEST (methods) {
  trial (&steered_truck_table, 2);
  trial (&steered_car_table, 2);
}
