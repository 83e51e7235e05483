/* One of each kind: a cart on a driven rolling wheel and a tyre, a welded box, an arm that follows a drive and carries
 * a massless skate, a four-bar loop on top. */
#include "pinwheel.h"

typedef struct {
  double torque, swing;
} zoo;

static const pw_parameter parameters[] = {
  { PW_AT (zoo, torque), 0.4, "N m", "amplitude at the rolling wheel", PW_REAL },
  { PW_AT (zoo, swing), 0.3, "rad", "amplitude of the arm", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const zoo *p = parameter;
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 2, .inertia = 0.3, .rate = { 0.5, 0, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "box", .mass = 0.4, .inertia = 0.01, .start = { -0.3, 0.2, 0.1 } });
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 0.5, .inertia = 0.05, .start = { 0.8, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "skate", .start = { 1.2, 0, 0.2 } });
  pw_add_body (m, &(pw_body){ .name = "left", .mass = 0.2, .inertia = 0.002, .start = { 0, 0.15, PW_PI / 2 } });
  pw_add_body (m, &(pw_body){ .name = "top", .mass = 0.3, .inertia = 0.004, .start = { 0.15, 0.3, 0 } });
  pw_add_body (m, &(pw_body){ .name = "right", .mass = 0.2, .inertia = 0.003, .start = { 0.3, 0.1, PW_PI / 2 } });
  pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "W",
                                                .body = "cart",
                                                .at = { -0.2, 0.1 },
                                                .radius = 0.15,
                                                .inertia = 0.02,
                                                .torque = { PW_HARMONIC, .harmonic = { p->torque, 2, 0.3, 0.1 } } });
  pw_add_tyre (m, &(pw_tyre){ .name = "T",
                              .body = "cart",
                              .at = { 0.2, -0.1 },
                              .stiffness = 30,
                              .speed = 0.1,
                              .load = 20,
                              .friction = 0.8 });
  pw_add_weld (m, &(pw_weld){ .name = "glue", .body = { "cart", "box" }, .at = { { -0.3, 0.2 } }, .angle = 0.1 });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "cart", "arm" }, .at = { { 0.4, 0 }, { -0.4, 0 } } });
  pw_add_drive (m, &(pw_drive){ .name = "swing",
                                .body = { "arm", "cart" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_HARMONIC, .harmonic = { p->swing, 3, -PW_PI / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "S", .body = { "arm", "skate" }, .at = { { 0.4, 0 }, { 0, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "E", .body = "skate", .at = { -0.1, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "L0", .body = { "cart", "left" }, .at = { { 0, 0 }, { -0.15, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "L1", .body = { "left", "top" }, .at = { { 0.15, 0 }, { -0.15, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "R1", .body = { "top", "right" }, .at = { { 0.15, 0 }, { 0.2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "R0", .body = { "right", "cart" }, .at = { { -0.2, 0 }, { 0.3, -0.1 } } });
  pw_add_spring (m, &(pw_spring){ .name = "tie",
                                  .body = { "ground", "cart" },
                                  .at = { { -1, 0.5 }, { 0.1, 0 } },
                                  .stiffness = 8,
                                  .damping = 0.3,
                                  .length = 1 });
  pw_add_torque (m, &(pw_torque){ .name = "push", .body = { "left", "cart" }, .value = { .constant = 0.05 } });
  pw_add_gravity (m, &(pw_gravity){ .name = "slope", .acceleration = { 0.3, -0.8 } });
}

PW_MODEL (.about = "one of each kind", .parameters = parameters, .parameters_size = sizeof (zoo),
          .run = { .t_end = 3, .step = 1e-3 }, .build = build);
