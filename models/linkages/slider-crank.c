/* Slider-crank: a crank on the ground, a rod, and a slider; two drives keep the slider's y and angle at 0, so that it
 * stays on the x axis.
 *
 * With equal lengths crank and rod have the angles theta and -theta, and the slider passes over the crank's pivot, a
 * singular configuration in which the rod could turn with the crank instead.  For crank and rod of mass m and length
 * 1 m and a slider of mass ms, without gravity, theta follows from the constant kinetic energy
 * (5/12 + 9/4 sin^2 theta + 1/4 cos^2 theta) m theta'^2 / 2 + 4 ms sin^2 theta theta'^2 / 2. */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double l1, l2, m1, m2, ms, theta, omega, g;
} slider_crank;

static const pw_parameter parameters[] = {
  { PW_AT (slider_crank, l1), 1, "m", "length of the crank", PW_POSITIVE },
  { PW_AT (slider_crank, l2), 1, "m", "length of the rod", PW_POSITIVE },
  { PW_AT (slider_crank, m1), 1, "kg", "mass of the crank, a uniform rod", PW_POSITIVE },
  { PW_AT (slider_crank, m2), 1, "kg", "mass of the rod, uniform", PW_POSITIVE },
  { PW_AT (slider_crank, ms), 1, "kg", "mass of the slider", PW_NONNEGATIVE },
  { PW_AT (slider_crank, theta), PW_PI / 4, "rad", "initial angle of the crank", PW_REAL },
  { PW_AT (slider_crank, omega), 2, "rad/s", "initial angular velocity of the crank", PW_REAL },
  { PW_AT (slider_crank, g), 0, "m/s^2", "gravity, along -y", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const slider_crank *p = parameter;
  double c = cos (p->theta), s = sin (p->theta), w = p->omega;
  int equal = p->l1 == p->l2; /* asin is inaccurate near pi/2, and beyond it folds the rod back onto the crank */
  double beta = equal ? -p->theta : -asin (p->l1 * s / p->l2);
  double rate = equal ? -w : -p->l1 * c * w / (p->l2 * cos (beta));
  if (!(fabs (rate) <= 1e6 * fabs (w))) { /* NaN if it does not reach */
    pw_model_refuse (m, "l2 = %g: the rod does not reach the slider's axis at theta = %g, or is perpendicular to it",
                     p->l2, p->theta);
    return;
  }
  double x = p->l1 * c + p->l2 * cos (beta), v = -p->l1 * s * w - p->l2 * sin (beta) * rate;
  pw_add_body (m, &(pw_body){ .name = "crank",
                              .mass = p->m1,
                              .inertia = p->m1 * p->l1 * p->l1 / 12,
                              .start = { p->l1 * c / 2, p->l1 * s / 2, p->theta },
                              .rate = { -p->l1 * s * w / 2, p->l1 * c * w / 2, w } });
  pw_add_body (m, &(pw_body){ .name = "rod",
                              .mass = p->m2,
                              .inertia = p->m2 * p->l2 * p->l2 / 12,
                              .start = { p->l1 * c + p->l2 * cos (beta) / 2, p->l1 * s / 2, beta },
                              .rate = { -p->l1 * s * w - p->l2 * sin (beta) * rate / 2, p->l1 * c * w / 2, rate } });
  pw_add_body (m, &(pw_body){ .name = "slider", .mass = p->ms, .start = { x, 0, 0 }, .rate = { v, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "crank", "ground" }, .at = { { -p->l1 / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "crank", "rod" }, .at = { { p->l1 / 2, 0 }, { -p->l2 / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "C", .body = { "rod", "slider" }, .at = { { p->l2 / 2, 0 } } });
  pw_add_drive (m, &(pw_drive){ .name = "guide", .body = { "slider", "ground" }, .what = PW_DRIVE_Y });
  pw_add_drive (m, &(pw_drive){ .name = "upright", .body = { "slider", "ground" }, .what = PW_DRIVE_ANGLE });
  if (p->g != 0) pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -p->g } });
}

PW_MODEL (.about = "crank, rod and slider; with equal lengths it passes a singular configuration",
          .parameters = parameters, .parameters_size = sizeof (slider_crank),
          .run = { .t_end = 1, .step = 1e-3, .method = "rk4+projection" }, .build = build);
