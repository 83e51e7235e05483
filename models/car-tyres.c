/* Car on tyres: the car of car.c with tyres that slip, its speed kept by a row that prescribes it.
 *
 * The stiffer the tyres, the closer it comes to the turning circle of the car whose wheels do not slip, of radius
 * (a + b) / tan (steer) in the middle of the rear axle; the difference falls like one over the stiffness.
 * (Pacejka 2012, Tire and Vehicle Dynamics, chapter 1.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double m, I, a, b, track, steer, u, stiffness;
} car;

static const pw_parameter parameters[] = {
  { PW_AT (car, m), 1000, "kg", "mass", PW_POSITIVE },
  { PW_AT (car, I), 1500, "kg m^2", "inertia about the centre of mass", PW_POSITIVE },
  { PW_AT (car, a), 1.2, "m", "front axle ahead of the centre of mass", PW_POSITIVE },
  { PW_AT (car, b), 1.4, "m", "rear axle behind the centre of mass", PW_POSITIVE },
  { PW_AT (car, track), 1.5, "m", "between left and right wheels", PW_POSITIVE },
  { PW_AT (car, steer), 0.3, "rad", "angle of a wheel in the middle of the front axle", PW_REAL },
  { PW_AT (car, u), 5, "m/s", "speed of the rear axle", PW_REAL },
  { PW_AT (car, stiffness), 4e4, "N", "cornering stiffness of a tyre", PW_POSITIVE },
  { .name = NULL },
};

/* A tyre at (x, y); a front one heads across its line to the point where the axles meet. */
static void tyre (pw_model *m, const car *p, const char *name, double x, double y) {
  double L = p->a + p->b, t = tan (p->steer);
  pw_add_tyre (m, &(pw_tyre){ .name = name,
                              .body = "car",
                              .at = { x, y },
                              .heading = x > 0 ? atan (t / (1 - y * t / L)) : 0,
                              .stiffness = p->stiffness,
                              .speed = 0.01 });
}

static void build (pw_model *m, const void *parameter) {
  const car *p = parameter;
  double w = p->u * tan (p->steer) / (p->a + p->b), half = p->track / 2;
  pw_add_body (m, &(pw_body){ .name = "car", .mass = p->m, .inertia = p->I, .rate = { p->u, p->b * w, w } });
  tyre (m, p, "rear-left", -p->b, half);
  tyre (m, p, "rear-right", -p->b, -half);
  tyre (m, p, "front-left", p->a, half);
  tyre (m, p, "front-right", p->a, -half);
  pw_add_speed (m, &(pw_speed){ .name = "cruise", .body = "car", .at = { -p->b, 0 }, .value = { .constant = p->u } });
}

PW_MODEL (.about = "car on tyres that slip, at constant speed", .parameters = parameters,
          .parameters_size = sizeof (car), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
