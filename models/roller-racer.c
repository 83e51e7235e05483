/* Roller racer: a seat on a rear axle and a handlebar with an axle of its own; swinging the handlebar propels it.
 *
 * The rider is a motor with a spring's give that turns the handlebar to a cosine.  With stiffness and damping 0 nobody
 * steers, and kinetic energy is kept; otherwise it equals the work of the rider.
 * (Krishnaprasad & Tsakiris 2001, Dynamical Systems 16; Bizyaev 2017, Regular and Chaotic Dynamics 22.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double m1, I1, m2, I2, a, b, c, swing, omega, stiffness, damping, u0, delta;
} racer;

static const pw_parameter parameters[] = {
  { PW_AT (racer, m1), 5, "kg", "mass of the seat with its rider", PW_POSITIVE },
  { PW_AT (racer, I1), 0.2, "kg m^2", "inertia of the seat", PW_POSITIVE },
  { PW_AT (racer, m2), 0.5, "kg", "mass of the handlebar", PW_NONNEGATIVE },
  { PW_AT (racer, I2), 0.01, "kg m^2", "inertia of the handlebar", PW_NONNEGATIVE },
  { PW_AT (racer, a), 0.1, "m", "rear axle behind the centre of mass of the seat", PW_REAL },
  { PW_AT (racer, b), 0.3, "m", "pivot ahead of the centre of mass of the seat", PW_POSITIVE },
  { PW_AT (racer, c), 0.08, "m", "front axle behind the pivot", PW_REAL },
  { PW_AT (racer, swing), 0.7, "rad", "amplitude of the handlebar", PW_REAL },
  { PW_AT (racer, omega), 2 * PW_PI, "rad/s", "angular frequency of the handlebar", PW_REAL },
  { PW_AT (racer, stiffness), 60, "N m/rad", "of the rider's arms", PW_NONNEGATIVE },
  { PW_AT (racer, damping), 2, "N m s/rad", "of the rider's arms", PW_NONNEGATIVE },
  { PW_AT (racer, u0), 0, "m/s", "speed of the rear axle at the start", PW_REAL },
  { PW_AT (racer, delta), 0.7, "rad", "angle of the handlebar at the start", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const racer *p = parameter;
  double c = p->c * cos (p->delta), s = p->c * sin (p->delta);
  double w = p->c != 0 ? -p->u0 * sin (p->delta) / p->c : 0; /* of the handlebar while the seat does not turn */
  pw_add_body (m, &(pw_body){ .name = "seat", .mass = p->m1, .inertia = p->I1, .rate = { p->u0, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "handlebar",
                              .mass = p->m2,
                              .inertia = p->I2,
                              .start = { p->b - c, -s, p->delta },
                              .rate = { p->u0 + w * s, -w * c, w } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot", .body = { "seat", "handlebar" }, .at = { { p->b, 0 }, { p->c, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "seat", .at = { -p->a, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "front", .body = "handlebar" });
  pw_add_motor (m, &(pw_motor){ .name = "rider",
                                .body = { "handlebar", "seat" },
                                .stiffness = p->stiffness,
                                .damping = p->damping,
                                .angle = { PW_HARMONIC, .harmonic = { .amplitude = p->swing, .omega = p->omega } },
                                .rate = { PW_HARMONIC, .harmonic = { .amplitude = -p->swing * p->omega,
                                                                     .omega = p->omega,
                                                                     .phase = -PW_PI / 2 } } });
}

PW_MODEL (.about = "ride-on propelled by swinging its handlebar", .parameters = parameters,
          .parameters_size = sizeof (racer), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
