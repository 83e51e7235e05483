/* N four-bar linkages in a row: N + 1 vertical cranks at x = 0, l, ..., N l and N couplers, all of length l.
 *
 * When the cranks are horizontal the configuration is singular: N constraint equations become dependent and the motion
 * could branch; the cranks of the reference solution stay parallel, at the angle theta to the horizontal:
 * theta'' = -(g / l) ((N + 1) / 2 + N) / ((N + 1) / 3 + N) cos theta.
 * (Gonzalez, Dopico, Pastorino & Cuadrado 2006, Multibody System Dynamics 16; IFToMM benchmark A02.) */
#include <math.h>
#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  double N, m, l, g, speed;
} four_bar;

static const pw_parameter parameters[] = {
  { PW_AT (four_bar, N), 2, "", "number of couplers", PW_COUNT },
  { PW_AT (four_bar, m), 1, "kg", "mass of a bar, a uniform rod", PW_POSITIVE },
  { PW_AT (four_bar, l), 1, "m", "length of a bar", PW_POSITIVE },
  { PW_AT (four_bar, g), 9.81, "m/s^2", "gravity", PW_REAL },
  { PW_AT (four_bar, speed), -1, "rad/s", "initial angular velocity of the cranks", PW_REAL },
  { .name = NULL },
};

static void build (pw_model *m, const void *parameter) {
  const four_bar *p = parameter;
  double l = p->l, inertia = p->m * l * l / 12, v = -p->speed * l;
  char crank[24], before[24], coupler[24], pin[24];
  for (int i = 0; i <= (int)p->N; i++) {
    snprintf (crank, sizeof crank, "crank%d", i);
    pw_add_body (m, &(pw_body){ .name = crank,
                                .mass = p->m,
                                .inertia = inertia,
                                .start = { i * l, l / 2, PW_PI / 2 },
                                .rate = { v / 2, 0, p->speed } });
    snprintf (pin, sizeof pin, "A%d", i);
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { crank, "ground" }, .at = { { -l / 2, 0 }, { i * l, 0 } } });
    if (i == 0) continue;
    snprintf (before, sizeof before, "crank%d", i - 1);
    snprintf (coupler, sizeof coupler, "coupler%d", i);
    pw_add_body (
        m,
        &(pw_body){
            .name = coupler, .mass = p->m, .inertia = inertia, .start = { (i - 0.5) * l, l, 0 }, .rate = { v, 0, 0 } });
    snprintf (pin, sizeof pin, "B%d", i);
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { before, coupler }, .at = { { l / 2, 0 }, { -l / 2, 0 } } });
    snprintf (pin, sizeof pin, "C%d", i);
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { coupler, crank }, .at = { { l / 2, 0 }, { l / 2, 0 } } });
  }
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -p->g } });
}

/* A rotating pendulum: with psi = theta + pi / 2 from the lowest point, W the angular velocity there and
 * theta'' = -kappa cos theta,  psi = 2 am (K + W t / 2 | k^2), k^2 = 4 kappa / W^2. */
static void reference (const void *parameter, double t, double *q, double *v) {
  const four_bar *p = parameter;
  double kappa = p->g / p->l * ((p->N + 1) / 2 + p->N) / ((p->N + 1) / 3 + p->N);
  double W = copysign (sqrt (p->speed * p->speed + 4 * kappa), p->speed), k2 = 4 * kappa / (W * W);
  double half = pw_jacobi_am (pw_elliptic_K (k2) + W * t / 2, k2), theta = 2 * half - PW_PI / 2;
  double rate = W * sqrt (1 - k2 * sin (half) * sin (half)), x = p->l * cos (theta), y = p->l * sin (theta);
  for (int i = 0; i <= 2 * (int)p->N; i++, q += 3, v += 3) { /* crank0, then crank and coupler in turn */
    int coupler = i > 0 && i % 2 == 0;
    double part = coupler ? 1 : 0.5;
    q[0] = p->l * (coupler ? i / 2 - 0.5 : (i + 1) / 2) + part * x, q[1] = part * y, q[2] = coupler ? 0 : theta;
    v[0] = -part * y * rate, v[1] = part * x * rate, v[2] = coupler ? 0 : rate;
  }
}

PW_MODEL (.about = "N four-bar linkages in a row, which pass singular configurations", .parameters = parameters,
          .parameters_size = sizeof (four_bar), .run = { .t_end = 10, .step = 1e-3, .method = "rk4+projection" },
          .build = build, .reference = reference);
