/* Chaplygin sleigh: a body on one knife edge, its centre of mass ahead of the blade.
 *
 * It turns around and runs on straight, mass first, though nothing is lost: with J = I + m a^2, k^2 = J / m,
 * A^2 = u0^2 + k^2 w0^2, s = a A / k^2 and c = artanh (u0 / A) the blade's speed is u = A tanh (s t + c) and the rate
 * w = (A / k) sech (s t + c).
 * (Chaplygin 1911; Neimark & Fufaev 1972, Dynamics of Nonholonomic Systems.) */
#include "pinwheel.h"

typedef struct {
  double m, I, a, u0, w0;
} sleigh;

static const pw_parameter parameters[] = {
  { PW_AT (sleigh, m), 1, "kg", "mass", PW_POSITIVE },
  { PW_AT (sleigh, I), 0.5, "kg m^2", "inertia about the centre of mass", PW_POSITIVE },
  { PW_AT (sleigh, a), 0.25, "m", "centre of mass ahead of the blade", PW_REAL },
  { PW_AT (sleigh, u0), -0.4, "m/s", "speed of the blade at the start", PW_REAL },
  { PW_AT (sleigh, w0), 0.8, "rad/s", "angular velocity at the start", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const sleigh *p = parameter;
  pw_add_body (m, &(pw_body){ .name = "sleigh",
                              .mass = p->m,
                              .inertia = p->I,
                              .start = { p->a, 0, 0 },
                              .rate = { p->u0, p->a * p->w0, p->w0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "blade", .body = "sleigh", .at = { -p->a, 0 } });
}

PW_MODEL (.about = "body on one knife edge that turns around and runs mass first", .parameters = parameters,
          .parameters_size = sizeof (sleigh), .run = { .t_end = 20, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
