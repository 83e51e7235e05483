/* Differential drive: a robot on two driven wheels that roll, and a caster that trails.
 *
 * The speeds of the two wheels are prescribed; the middle of their axle goes round a circle of radius
 * (track / 2) (right + left) / (right - left).  Both wheels forbid the same motion along the axle: one of those two rows is
 * redundant.
 * (Siegwart, Nourbakhsh & Scaramuzza 2011, Introduction to Autonomous Mobile Robots, chapter 3.) */
#include "pinwheel.h"

typedef struct {
  double m, I, ahead, mc, Ic, trail, reach, track, radius, Iw, left, right;
} robot;

static const pw_parameter parameters[] = {
  { PW_AT (robot, m), 10, "kg", "mass of the robot with its wheels", PW_POSITIVE },
  { PW_AT (robot, I), 0.3, "kg m^2", "inertia of the robot", PW_POSITIVE },
  { PW_AT (robot, ahead), 0.05, "m", "centre of mass ahead of the axle", PW_REAL },
  { PW_AT (robot, mc), 0.2, "kg", "mass of the caster, at its wheel", PW_NONNEGATIVE },
  { PW_AT (robot, Ic), 0.001, "kg m^2", "inertia of the caster", PW_NONNEGATIVE },
  { PW_AT (robot, trail), 0.04, "m", "caster's wheel behind its pivot", PW_POSITIVE },
  { PW_AT (robot, reach), 0.2, "m", "caster's pivot ahead of the axle", PW_REAL },
  { PW_AT (robot, track), 0.3, "m", "between the two wheels", PW_POSITIVE },
  { PW_AT (robot, radius), 0.08, "m", "of the wheels", PW_POSITIVE },
  { PW_AT (robot, Iw), 0.002, "kg m^2", "inertia of a wheel about its axle", PW_NONNEGATIVE },
  { PW_AT (robot, left), 0.4, "m/s", "speed of the left wheel over the ground", PW_REAL },
  { PW_AT (robot, right), 0.6, "m/s", "speed of the right wheel over the ground", PW_REAL },
  { .name = NULL },
};

/* A wheel at `y` to the left of the middle and what drives it at a speed. */
static void wheel (pw_model *m, const robot *p, const char *name, const char *drive, double y, double speed) {
  pw_add_rolling_wheel (
      m, &(pw_rolling_wheel){
             .name = name, .body = "robot", .at = { -p->ahead, y }, .radius = p->radius, .inertia = p->Iw });
  pw_add_speed (m,
                &(pw_speed){ .name = drive, .body = "robot", .at = { -p->ahead, y }, .value = { .constant = speed } });
}

static void build (pw_model *m, const void *parameter) {
  const robot *p = parameter;
  double u = (p->right + p->left) / 2, w = (p->right - p->left) / p->track;
  pw_add_body (m, &(pw_body){ .name = "robot",
                              .mass = p->m,
                              .inertia = p->I,
                              .start = { p->ahead, 0, 0 },
                              .rate = { u, p->ahead * w, w } });
  pw_add_body (m, &(pw_body){ .name = "caster",
                              .mass = p->mc,
                              .inertia = p->Ic,
                              .start = { p->reach - p->trail, 0, 0 },
                              .rate = { u, 0, p->reach * w / p->trail } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot",
                            .body = { "robot", "caster" },
                            .at = { { p->reach - p->ahead, 0 }, { p->trail, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "caster-wheel", .body = "caster" });
  wheel (m, p, "left", "drive-left", p->track / 2, p->left);
  wheel (m, p, "right", "drive-right", -p->track / 2, p->right);
}

PW_MODEL (.about = "robot on two driven wheels and a caster", .parameters = parameters,
          .parameters_size = sizeof (robot), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
