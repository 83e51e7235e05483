/* EzyRoller: a ride-on of two segments that moves because its rider swings the steering hinge.
 *
 * The frame has the rider and a wheel A at the rear; the steering assembly has a wheel C in front and is
 * hinged to the frame at B; a torque acts between the two.  Initially the assembly is turned by pi, so that C is behind
 * B.  By default it is massless.
 * (TU Delft ME41055, Multibody Dynamics B, 2018, homework 8.) */
#include "pinwheel.h"

typedef struct {
  double a, b, c, d, m1, I1, m2, I2, M0, omega;
} ezyroller;

static const pw_parameter parameters[] = {
  { PW_AT (ezyroller, a), 0.5, "m", "distance from the frame's centre of mass to wheel A", PW_NONNEGATIVE },
  { PW_AT (ezyroller, b), 0.5, "m", "distance from the frame's centre of mass to hinge B", PW_NONNEGATIVE },
  { PW_AT (ezyroller, c), 0.125, "m", "distance from the steering assembly's centre of mass to wheel C",
    PW_NONNEGATIVE },
  { PW_AT (ezyroller, d), 0.125, "m", "distance from the steering assembly's centre of mass to hinge B",
    PW_NONNEGATIVE },
  { PW_AT (ezyroller, m1), 1, "kg", "mass of the frame with its rider", PW_POSITIVE },
  { PW_AT (ezyroller, I1), 0.1, "kg m^2", "inertia of the frame about its centre of mass", PW_POSITIVE },
  { PW_AT (ezyroller, m2), 0, "kg", "mass of the steering assembly", PW_NONNEGATIVE },
  { PW_AT (ezyroller, I2), 0, "kg m^2", "inertia of the steering assembly", PW_NONNEGATIVE },
  { PW_AT (ezyroller, M0), 0.1, "N m", "amplitude of the rider's torque", PW_REAL },
  { PW_AT (ezyroller, omega), PW_PI, "rad/s", "angular frequency of the rider's torque", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const ezyroller *p = parameter;
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = p->m1, .inertia = p->I1 });
  pw_add_body (m, &(pw_body){ .name = "steer", .mass = p->m2, .inertia = p->I2, .start = { p->b - p->d, 0, PW_PI } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { p->b, 0 }, { -p->d, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -p->a, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "C", .body = "steer", .at = { p->c, 0 } });
  pw_add_torque (m, &(pw_torque){ .name = "rider",
                                  .body = { "frame", "steer" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = p->M0, .omega = p->omega } } });
}

static const pw_preset presets[] = {
  { "drive it", "Twice the torque at the same rhythm: the vehicle goes farther with each swing.", "M0=0.2 t_end=60" },
  { "break it", "Steps of a quarter of a swing without stabilisation: the pin opens until the run stops.",
    "method=rk4+none step=0.5" },
  { "mend it", "The same steps with projection: the pin stays closed; what remains is the error of the steps.",
    "method=rk4+projection step=0.5" },
  { .name = NULL },
};

PW_MODEL (.about = "two-segment ride-on propelled by swinging the steering hinge", .parameters = parameters,
          .parameters_size = sizeof (ezyroller), .run = { .t_end = 100, .step = 1e-3, .method = "rk4+projection" },
          .presets = presets, .build = build);
