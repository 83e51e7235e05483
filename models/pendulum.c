/* Pendulum: a point mass on a massless rod, released from the horizontal.
 *
 * sin (theta / 2) = k sn (K - sqrt (g / l) t | k^2) with theta from the lowest point and, from the horizontal, k^2 = 1/2.
 * (IFToMM library of computational benchmark problems, A01; Gonzalez et al. 2006.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double m, I, l, g, theta;
} pendulum;

static const pw_parameter parameters[] = {
  { PW_AT (pendulum, m), 1, "kg", "mass", PW_POSITIVE },
  { PW_AT (pendulum, I), 0, "kg m^2", "inertia of the bob about its own centre", PW_NONNEGATIVE },
  { PW_AT (pendulum, l), 1, "m", "length of the rod", PW_POSITIVE },
  { PW_AT (pendulum, g), 9.81, "m/s^2", "gravity", PW_REAL },
  { PW_AT (pendulum, theta), 0, "rad", "angle against the horizontal at the start", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const pendulum *p = parameter;
  pw_add_body (m, &(pw_body){ .name = "bob",
                              .mass = p->m,
                              .inertia = p->I,
                              .start = { p->l * cos (p->theta), p->l * sin (p->theta), p->theta } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot", .body = { "bob", "ground" }, .at = { { -p->l, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -p->g } });
}

PW_MODEL (.about = "point mass on a massless rod, released from the horizontal", .parameters = parameters,
          .parameters_size = sizeof (pendulum), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
