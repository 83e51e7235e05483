/* Knife edge on an incline: a skate whose edge is under its centre of mass, on a slope that descends along x.
 *
 * Started along the slope and turning, it does not slide down for good but drifts sideways along a cycloid:
 * x = G sin^2 (w t), y = G (w t - sin (2 w t) / 2), G = g sin alpha / (2 w^2); the edge carries 2 m g sin alpha |sin w t|.
 * (Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems; Bloch 2003, Nonholonomic Mechanics and Control.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double m, I, alpha, g, w;
} incline;

static const pw_parameter parameters[] = {
  { PW_AT (incline, m), 1, "kg", "mass", PW_POSITIVE },
  { PW_AT (incline, I), 0.1, "kg m^2", "inertia about the centre of mass", PW_POSITIVE },
  { PW_AT (incline, alpha), PW_PI / 6, "rad", "angle of the slope", PW_REAL },
  { PW_AT (incline, g), 9.81, "m/s^2", "gravity", PW_REAL },
  { PW_AT (incline, w), 1, "rad/s", "angular velocity at the start", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const incline *p = parameter;
  pw_add_body (m, &(pw_body){ .name = "skate", .mass = p->m, .inertia = p->I, .rate = { 0, 0, p->w } });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "skate" });
  pw_add_gravity (m, &(pw_gravity){ .name = "slope", .acceleration = { p->g * sin (p->alpha), 0 } });
}

PW_MODEL (.about = "turning skate on a slope, which drifts sideways instead of down", .parameters = parameters,
          .parameters_size = sizeof (incline), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
