/* Snakeboard: a board on two steered trucks whose rider swings a rotor; it moves without touching the ground by a foot.
 *
 * Rotor and trucks follow cosines of the same frequency, which starts it from rest and drives it forward.  What the drives
 * work is its kinetic energy.
 * (Lewis, Ostrowski, Burdick & Murray 1994, IEEE Conference on Robotics and Automation.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double m, I, Ir, mt, It, l, swing, steer, trim, omega, u0;
} snakeboard;

static const pw_parameter parameters[] = {
  { PW_AT (snakeboard, m), 6, "kg", "mass of the board with the rotor's bearing", PW_POSITIVE },
  { PW_AT (snakeboard, I), 0.1, "kg m^2", "inertia of the board", PW_POSITIVE },
  { PW_AT (snakeboard, Ir), 0.2, "kg m^2", "inertia of the rotor", PW_POSITIVE },
  { PW_AT (snakeboard, mt), 0.3, "kg", "mass of a truck", PW_NONNEGATIVE },
  { PW_AT (snakeboard, It), 0.002, "kg m^2", "inertia of a truck", PW_NONNEGATIVE },
  { PW_AT (snakeboard, l), 0.3, "m", "trucks from the middle of the board", PW_POSITIVE },
  { PW_AT (snakeboard, swing), 0.7, "rad", "amplitude of the rotor", PW_REAL },
  { PW_AT (snakeboard, steer), 0.3, "rad", "amplitude of the trucks, one against the other", PW_REAL },
  { PW_AT (snakeboard, trim), 0, "rad", "mean angle of the trucks, one against the other", PW_REAL },
  { PW_AT (snakeboard, omega), PW_PI, "rad/s", "angular frequency of rotor and trucks", PW_REAL },
  { PW_AT (snakeboard, u0), 0, "m/s", "speed at the start", PW_REAL },
  { .name = NULL },
};

/* A truck with its axle and what turns it, on a board that turns at w; the front one is at +l and turns as told, the rear
 * one opposite. */
static void truck (pw_model *m, const snakeboard *p, const char *name, const char *pivot, const char *axle,
                   const char *drive, double side, double w) {
  double angle = side * (p->trim + p->steer);
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = p->mt,
                              .inertia = p->It,
                              .start = { side * p->l, 0, angle },
                              .rate = { p->u0, side * p->l * w, w } });
  pw_add_pin (m, &(pw_pin){ .name = pivot, .body = { name, "board" }, .at = { { 0, 0 }, { side * p->l, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = axle, .body = name });
  pw_add_drive (m, &(pw_drive){ .name = drive,
                                .body = { name, "board" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_HARMONIC, .harmonic = { .amplitude = side * p->steer,
                                                                      .omega = p->omega,
                                                                      .offset = side * p->trim } } });
}

static void build (pw_model *m, const void *parameter) {
  const snakeboard *p = parameter;
  double w = p->u0 * tan (p->trim + p->steer) / p->l; /* how fast the trucks let the board turn */
  pw_add_body (m, &(pw_body){ .name = "board", .mass = p->m, .inertia = p->I, .rate = { p->u0, 0, w } });
  pw_add_body (m,
               &(pw_body){ .name = "rotor", .inertia = p->Ir, .start = { 0, 0, p->swing }, .rate = { p->u0, 0, w } });
  pw_add_pin (m, &(pw_pin){ .name = "bearing", .body = { "rotor", "board" } });
  pw_add_drive (m, &(pw_drive){ .name = "swing",
                                .body = { "rotor", "board" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_HARMONIC, .harmonic = { .amplitude = p->swing, .omega = p->omega } } });
  truck (m, p, "front", "F", "A", "steer-front", 1, w);
  truck (m, p, "rear", "R", "B", "steer-rear", -1, w);
}

PW_MODEL (.about = "board that moves because its rider swings and steers", .parameters = parameters,
          .parameters_size = sizeof (snakeboard), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
