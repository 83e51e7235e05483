/* tyre: lateral sliding, the wheel as the limit of large stiffness, the load. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- A block that slides laterally ----
 *
 *   linear      m v' = -C v / v0:                      v = v(0) exp (-k t),  k = C / (m v0)
 *   saturating  m v' = -mu N tanh (C v / (mu N v0)):   sinh (C v / (mu N v0)) decays with the same k */

static const struct { double m, C, v0, v; } tyre_s = { 2, 3, 0.5, 0.7 };

typedef struct {
  double load, friction;
} tyre_parameters;

static const pw_parameter tyre_list[] = {
  { PW_AT (tyre_parameters, load), 0, "N", "normal load", PW_NONNEGATIVE },
  { PW_AT (tyre_parameters, friction), 0, "", "of the tyre", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (tyre_slide, tyre_list, tyre_parameters) {
  double c = cos (0.8), s = sin (0.8); /* of the heading; the block slides to the left of it */
  pw_add_body (m,
               &(pw_body){ .name = "block", .mass = tyre_s.m, .inertia = 1, .rate = { -tyre_s.v * s, tyre_s.v * c } });
  pw_add_tyre (m, &(pw_tyre){ .name = "T",
                              .body = "block",
                              .heading = 0.8,
                              .stiffness = tyre_s.C,
                              .speed = tyre_s.v0,
                              .load = p->load,
                              .friction = p->friction });
}

static void tyre_stop (const char *method, double load, double bound, const char *reason) {
  pw_system *s = scene_system (&tyre_slide_table, "load", load, "friction", load > 0 ? 0.4 : 0, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 1, .ledger = 1 });
  double k = tyre_s.C / (tyre_s.m * tyre_s.v0), scale = load > 0 ? 0.4 * load * tyre_s.v0 / tyre_s.C : 0;
  for (int i = 1; i <= 5; i++) {
    double t = 0.2 * i, v = tyre_s.v * exp (-k * t);
    if (load > 0) v = scale * asinh (sinh (tyre_s.v / scale) * exp (-k * t));
    pw_sample x = runs_to (r, t);
    check_close ("speed", hypot (x.v[0], x.v[1]), v, bound, reason);
    check_close ("loss", x.loss, tyre_s.m * (tyre_s.v * tyre_s.v - v * v) / 2, bound, reason);
  }
  runs_close (r, s);
}

TEST (slide) {
  tyre_stop ("rk4", 0, 1e-10, "(h k)^4 at h = 1e-3 and k = 3/s");
  tyre_stop ("rk4", 5, 1e-10, "(h k)^4 at h = 1e-3 and k = 3/s");
  tyre_stop ("ida", 0, 1e-7, "1e3 rtol");
  tyre_stop ("ida", 5, 1e-7, "1e3 rtol");
}

/* ---- With increasing stiffness the motion on tyres approaches that on wheels ---- */

typedef struct {
  double stiffness; /* 0: a wheel */
} tyre_vehicle_parameters;

static const pw_parameter tyre_vehicle_list[] = {
  { PW_AT (tyre_vehicle_parameters, stiffness), 0, "N", "of the tyres; 0: wheels", PW_NONNEGATIVE },
  { .name = NULL },
};

static void tyre_wheel (pw_model *m, const char *name, const char *body, double x, double stiffness) {
  if (stiffness > 0)
    pw_add_tyre (m, &(pw_tyre){ .name = name, .body = body, .at = { x, 0 }, .stiffness = stiffness, .speed = 0.2 });
  else
    pw_add_wheel (m, &(pw_wheel){ .name = name, .body = body, .at = { x, 0 } });
}

/* A vehicle of two segments, moved by a torque at its hinge. */
SCENE_WITH (tyre_vehicle, tyre_vehicle_list, tyre_vehicle_parameters) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1, .rate = { 0.5 } });
  pw_add_body (m, &(pw_body){ .name = "steer", .mass = 0.2, .inertia = 0.01, .start = { 0.6 }, .rate = { 0.5 } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.1, 0 } } });
  tyre_wheel (m, "A", "frame", -0.5, p->stiffness);
  tyre_wheel (m, "C", "steer", 0.1, p->stiffness);
  pw_add_torque (m, &(pw_torque){ .name = "rider",
                                  .body = { "frame", "steer" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.1, .omega = 3 } } });
}

TEST (limit) {
  enum { STEPS = 5 }; /* stiffnesses, from 100 N over two decades */
  double wheel[6], rate[6], q[6], v[6], distance[STEPS], stiffness = 100;
  pw_settings settings = { .rtol = 1e-10, .span = 2 };
  pw_system *s = scene_system (&tyre_vehicle_table, NULL);
  runs_state (s, "ida+ggl", &settings, 2, wheel, rate, NULL);
  pw_system_free (s);
  for (int i = 0; i < STEPS; i++, stiffness *= sqrt (10)) {
    s = scene_system (&tyre_vehicle_table, "stiffness", stiffness, NULL);
    runs_state (s, "ida+ggl", &settings, 2, q, v, NULL);
    distance[i] = 0;
    for (int j = 0; j < 6; j++) distance[i] = fmax (distance[i], fabs (q[j] - wheel[j]));
    pw_system_free (s);
  }
  check_close ("slope over two decades", log10 (distance[0] / distance[STEPS - 1]) / 2, 1, 0.02,
               "1/C, and the next power of 1/C at the soft end");
  check_close ("slope at the stiff end", 2 * log10 (distance[STEPS - 2] / distance[STEPS - 1]), 1, 0.005,
               "1/C, and the next power of 1/C");
}

/* ---- Load and friction: both are given, or neither; the square of the speed does not underflow ---- */

TEST (refused) {
  scene_refused (scene_model (&tyre_slide_table, "load", 5.0, NULL),
                 "model scene: tyre T: friction = 0: expected > 0, since a load limits the force to friction x load");
  scene_refused (scene_model (&tyre_slide_table, "friction", 0.4, NULL),
                 "model scene: tyre T: load = 0: expected > 0, since friction limits the force to friction x load");
  double element[100];
  pw_error error = { 0 };
  pw_tyre tyre = { .name = "T", .body = "a", .stiffness = 1, .speed = 1e-170 };
  assert_true (pw_kind_tyre.element <= sizeof element);
  assert_int_equal (pw_kind_tyre.prepare (&tyre, NULL, element, NULL, &error), PW_INPUT);
  assert_string_equal (error.text, "speed = 1e-170: expected >= 1.5e-154, so that its square does not underflow");
}

/* ---- By all methods: a car and a trailer on tyres, with and without a load, off their axes, oblique ---- */

SCENE (tyre_car) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 10, .inertia = 1.5, .rate = { 3, 0.4, 0.3 } });
  pw_add_tyre (m, &(pw_tyre){ .name = "front",
                              .body = "car",
                              .at = { 0.5, 0.1 },
                              .heading = 0.2,
                              .stiffness = 80,
                              .speed = 0.1,
                              .load = 50,
                              .friction = 0.4 });
  pw_add_tyre (m, &(pw_tyre){ .name = "rear", .body = "car", .at = { -0.4, -0.1 }, .stiffness = 60, .speed = 0.1 });
  pw_add_body (m, &(pw_body){ .name = "trailer", .mass = 2, .inertia = 0.1, .start = { -1.1 }, .rate = { 3 } });
  pw_add_pin (m, &(pw_pin){ .name = "hitch", .body = { "car", "trailer" }, .at = { { -0.6, 0 }, { 0.5, 0 } } });
  pw_add_tyre (m, &(pw_tyre){ .name = "axle",
                              .body = "trailer",
                              .at = { -0.2, 0 },
                              .stiffness = 50,
                              .speed = 0.1,
                              .load = 20,
                              .friction = 0.5 });
}

TEST (methods) {
  trial (&tyre_car_table, 2);
}
