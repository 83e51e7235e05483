/* Peaucellier's inversor: eight bars, the ground one of them, that draw an exactly straight line.
 *
 * Two arms of length L from O and a rhombus of side s keep OB OP = L^2 - s^2; the crank from A = (a, 0) keeps B on a circle
 * through O, and so P on the line x = (L^2 - s^2) / (2 a).  The crank is driven to and fro.
 * (Peaucellier 1864; Lipkin 1871.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double a, L, s, density, swing, omega;
} inversor;

static const pw_parameter parameters[] = {
  { PW_AT (inversor, a), 0.4, "m", "length of the crank, and distance of its pivot from O", PW_POSITIVE },
  { PW_AT (inversor, L), 1, "m", "length of the two arms", PW_POSITIVE },
  { PW_AT (inversor, s), 0.5, "m", "side of the rhombus", PW_POSITIVE },
  { PW_AT (inversor, density), 1, "kg/m", "mass of the bars over their length", PW_POSITIVE },
  { PW_AT (inversor, swing), 1.2, "rad", "amplitude of the crank", PW_REAL },
  { PW_AT (inversor, omega), PW_PI, "rad/s", "angular frequency of the crank", PW_REAL },
  { .name = NULL },
};

/* A uniform bar from one point to another. */
static void bar (pw_model *m, const inversor *p, const char *name, const double from[2], const double to[2]) {
  double x = to[0] - from[0], y = to[1] - from[1], l = hypot (x, y), mass = p->density * l;
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = mass,
                              .inertia = mass * l * l / 12,
                              .start = { (from[0] + to[0]) / 2, (from[1] + to[1]) / 2, atan2 (y, x) } });
}

static void pin (pw_model *m, const char *name, const char *one, double x1, const char *two, double x2) {
  pw_add_pin (m, &(pw_pin){ .name = name, .body = { one, two }, .at = { { x1, 0 }, { x2, 0 } } });
}

static void build (pw_model *m, const void *parameter) {
  const inversor *p = parameter;
  double half = p->swing / 2, OB = 2 * p->a * cos (half);
  if (OB <= fabs (p->L - p->s) || 2 * p->a >= p->L + p->s) {
    pw_refuse (m, "swing = %g: arms and rhombus do not reach the crank there", p->swing);
    return;
  }
  /* Along OB from O: to the middle of the rhombus, and from there to C, D. */
  double OP = (p->L * p->L - p->s * p->s) / OB, mid = (OB + OP) / 2, aside = sqrt (p->L * p->L - mid * mid);
  double c = cos (half), s = sin (half), L = p->L / 2, r = p->s / 2;
  const double O[2] = { 0, 0 }, A[2] = { p->a, 0 }, B[2] = { OB * c, OB * s }, P[2] = { OP * c, OP * s },
               C[2] = { mid * c - aside * s, mid * s + aside * c }, D[2] = { mid * c + aside * s, mid * s - aside * c };
  bar (m, p, "crank", A, B);
  bar (m, p, "OC", O, C);
  bar (m, p, "OD", O, D);
  bar (m, p, "BC", B, C);
  bar (m, p, "BD", B, D);
  bar (m, p, "PC", P, C);
  bar (m, p, "PD", P, D);
  pin (m, "A", "crank", -p->a / 2, "ground", p->a);
  pin (m, "O1", "OC", -L, "ground", 0);
  pin (m, "O2", "OD", -L, "ground", 0);
  pin (m, "B1", "crank", p->a / 2, "BC", -r);
  pin (m, "B2", "crank", p->a / 2, "BD", -r);
  pin (m, "C1", "OC", L, "BC", r);
  pin (m, "C2", "OC", L, "PC", r);
  pin (m, "D1", "OD", L, "BD", r);
  pin (m, "D2", "OD", L, "PD", r);
  pin (m, "P", "PC", -r, "PD", -r);
  pw_add_drive (m, &(pw_drive){ .name = "swing",
                                .body = { "crank", "ground" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_HARMONIC, .harmonic = { .amplitude = p->swing, .omega = p->omega } } });
}

PW_MODEL (.about = "Peaucellier's inversor, which draws an exactly straight line", .parameters = parameters,
          .parameters_size = sizeof (inversor), .run = { .t_end = 1, .step = 1e-3, .method = "rk4+projection" },
          .build = build);
