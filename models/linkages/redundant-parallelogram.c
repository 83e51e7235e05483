/* Redundant parallelogram: three equal cranks support one rigid coupler; two would suffice.
 *
 * Of the 12 constraint equations, 11 are independent: the distribution of the cranks' reactions along the coupler is
 * not determined by rigid-body mechanics.  The angle theta of the cranks against the horizontal obeys
 * theta'' = -(g / l) (3/2 + mc/m) / (1 + mc/m) cos theta.
 * (After the IFToMM library of computational benchmark problems; Gonzalez et al. 2006.) */
#include <math.h>
#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  double m, l, mc, g, theta;
} parallelogram;

static const pw_parameter parameters[] = {
  { PW_AT (parallelogram, m), 1, "kg", "mass of a crank, a uniform rod", PW_POSITIVE },
  { PW_AT (parallelogram, l), 1, "m", "length of a crank, and distance of their pivots", PW_POSITIVE },
  { PW_AT (parallelogram, mc), 2, "kg", "mass of the coupler, a uniform rod", PW_POSITIVE },
  { PW_AT (parallelogram, g), 9.81, "m/s^2", "gravity", PW_REAL },
  { PW_AT (parallelogram, theta), -PW_PI / 4, "rad", "initial angle of the cranks", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const parallelogram *p = parameter;
  double c = p->l * cos (p->theta), s = p->l * sin (p->theta);
  pw_add_body (
      m,
      &(pw_body){ .name = "coupler", .mass = p->mc, .inertia = p->mc * p->l * p->l / 3, .start = { p->l + c, s, 0 } });
  for (int i = 0; i < 3; i++) {
    char crank[24], pivot[24], joint[24];
    double x = i * p->l;
    snprintf (crank, sizeof crank, "crank%d", i + 1);
    snprintf (pivot, sizeof pivot, "A%d", i + 1);
    snprintf (joint, sizeof joint, "B%d", i + 1);
    pw_add_body (m, &(pw_body){ .name = crank,
                                .mass = p->m,
                                .inertia = p->m * p->l * p->l / 12,
                                .start = { x + c / 2, s / 2, p->theta } });
    pw_add_pin (m, &(pw_pin){ .name = pivot, .body = { crank, "ground" }, .at = { { -p->l / 2, 0 }, { x, 0 } } });
    pw_add_pin (m,
                &(pw_pin){ .name = joint, .body = { crank, "coupler" }, .at = { { p->l / 2, 0 }, { x - p->l, 0 } } });
  }
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -p->g } });
}

/* A pendulum with the angle psi = theta + pi / 2 from the lowest point, released at psi0: sin (psi / 2) =
 * k sn (K - w t | k^2), k = sin (psi0 / 2). */
static void reference (const void *parameter, double t, double *q, double *v) {
  const parallelogram *p = parameter;
  double k = sin (p->theta / 2 + PW_PI / 4), w = sqrt (p->g * (1.5 * p->m + p->mc) / (p->l * (p->m + p->mc)));
  double am = pw_jacobi_am (pw_elliptic_K (k * k) - w * t, k * k);
  double theta = 2 * asin (k * sin (am)) - PW_PI / 2, rate = -2 * k * w * cos (am);
  double x = p->l * cos (theta), y = p->l * sin (theta);
  if (fabs (p->theta + PW_PI / 2) >= PW_PI) return; /* half a turn or more from the lowest point: no reference */
  for (int i = 0; i < 4; i++, q += 3, v += 3) {     /* the coupler, then the cranks */
    double part = i == 0 ? 1 : 0.5;
    q[0] = p->l * (i == 0 ? 1 : i - 1) + part * x, q[1] = part * y, q[2] = i == 0 ? 0 : theta;
    v[0] = -part * y * rate, v[1] = part * x * rate, v[2] = i == 0 ? 0 : rate;
  }
}

PW_MODEL (.about = "three cranks with one coupler: one redundant constraint equation", .parameters = parameters,
          .parameters_size = sizeof (parallelogram), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build, .reference = reference);
