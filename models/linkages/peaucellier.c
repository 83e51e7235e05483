/* Peaucellier's inversor: eight bars, the ground one of them, that draw an exactly straight line.
 *
 * Two arms of length L from O and a rhombus of side s keep OB OP = L^2 - s^2; the crank from A = (a, 0) keeps B on a
 * circle through O and thus P on the line x = (L^2 - s^2) / (2 a).  The crank angle is prescribed.
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
  { PW_AT (inversor, density), 1, "kg/m", "mass per length of the bars", PW_POSITIVE },
  { PW_AT (inversor, swing), 1.2, "rad", "amplitude of the crank", PW_REAL },
  { PW_AT (inversor, omega), PW_PI, "rad/s", "angular frequency of the crank", PW_REAL },
  { .name = NULL },
};

/* A uniform bar from one point to another. */
static void add_bar (pw_model *m, const inversor *p, const char *name, const double from[2], const double to[2]) {
  double x = to[0] - from[0], y = to[1] - from[1], l = hypot (x, y), mass = p->density * l;
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = mass,
                              .inertia = mass * l * l / 12,
                              .start = { (from[0] + to[0]) / 2, (from[1] + to[1]) / 2, atan2 (y, x) } });
}

static void add_pin (pw_model *m, const char *name, const char *one, double x1, const char *two, double x2) {
  pw_add_pin (m, &(pw_pin){ .name = name, .body = { one, two }, .at = { { x1, 0 }, { x2, 0 } } });
}

/* The joints: A and O on the ground, B on the crank, C and D on the arms, P on the line; and the bars between them. */
enum { A, O, B, C, D, P, JOINTS, BARS = 7 };
static const struct {
  const char *name;
  int from, to;
} bars[BARS] = { { "crank", A, B }, { "OC", O, C }, { "OD", O, D }, { "BC", B, C },
                 { "BD", B, D },    { "PC", P, C }, { "PD", P, D } };

typedef struct {
  double at[JOINTS][2]; /* [m] */
} joints;

/* The joints at a crank angle. */
static joints joints_at (const inversor *p, double angle) {
  double half = angle / 2, c = cos (half), s = sin (half);
  /* mid: from O to the middle of the rhombus along OB; aside: from there to C and D. */
  double OB = 2 * p->a * c, OP = (p->L * p->L - p->s * p->s) / OB, mid = (OB + OP) / 2,
         aside = sqrt (p->L * p->L - mid * mid);
  return (joints){ { [A] = { p->a, 0 },
                     [B] = { OB * c, OB * s },
                     [C] = { mid * c - aside * s, mid * s + aside * c },
                     [D] = { mid * c + aside * s, mid * s - aside * c },
                     [P] = { OP * c, OP * s } } };
}

static void build (pw_model *m, const void *parameter) {
  const inversor *p = parameter;
  /* least_OB: smallest distance of B from O; arm, side: half lengths */
  double least_OB = 2 * p->a * cos (p->swing / 2), arm = p->L / 2, side = p->s / 2;
  if (fabs (p->swing) >= PW_PI || least_OB <= fabs (p->L - p->s)) {
    pw_model_refuse (m, "swing = %g: arms and rhombus do not reach the crank there", p->swing);
    return;
  }
  if (2 * p->a >= p->L + p->s) {
    pw_model_refuse (m, "a = %g: arms and rhombus do not reach the crank at the angle 0", p->a);
    return;
  }
  joints j = joints_at (p, p->swing);
  for (int i = 0; i < BARS; i++) add_bar (m, p, bars[i].name, j.at[bars[i].from], j.at[bars[i].to]);
  add_pin (m, "A", "crank", -p->a / 2, "ground", p->a);
  add_pin (m, "O1", "OC", -arm, "ground", 0);
  add_pin (m, "O2", "OD", -arm, "ground", 0);
  add_pin (m, "B1", "crank", p->a / 2, "BC", -side);
  add_pin (m, "B2", "crank", p->a / 2, "BD", -side);
  add_pin (m, "C1", "OC", arm, "BC", side);
  add_pin (m, "C2", "OC", arm, "PC", side);
  add_pin (m, "D1", "OD", arm, "BD", side);
  add_pin (m, "D2", "OD", arm, "PD", side);
  add_pin (m, "P", "PC", -side, "PD", -side);
  pw_add_marker (m, &(pw_marker){ .name = "pencil", .body = "PC", .at = { -side, 0 } });
  pw_add_drive (m, &(pw_drive){ .name = "swing",
                                .body = { "crank", "ground" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_HARMONIC, .harmonic = { .amplitude = p->swing, .omega = p->omega } } });
}

static double bar_angle (const joints *j, int i) {
  const double *from = j->at[bars[i].from], *to = j->at[bars[i].to];
  return atan2 (to[1] - from[1], to[0] - from[0]);
}

/* The line OB turns by `turn` from its initial direction; relative to it each bar turns by less than pi. */
static void reference (const void *parameter, double t, double *q, double *v) {
  const inversor *p = parameter;
  double angle = p->swing * cos (p->omega * t), turn = (angle - p->swing) / 2;
  joints j = joints_at (p, angle), j0 = joints_at (p, p->swing);
  (void)v;
  for (int i = 0; i < BARS; i++, q += 3) {
    const double *from = j.at[bars[i].from], *to = j.at[bars[i].to], start = bar_angle (&j0, i) + turn;
    q[0] = (from[0] + to[0]) / 2, q[1] = (from[1] + to[1]) / 2;
    q[2] = start + remainder (bar_angle (&j, i) - start, 2 * PW_PI);
  }
}

PW_MODEL (.about = "Peaucellier's inversor, which draws an exactly straight line", .parameters = parameters,
          .parameters_size = sizeof (inversor), .run = { .t_end = 1, .step = 1e-3, .method = "rk4+projection" },
          .build = build, .reference = reference);
