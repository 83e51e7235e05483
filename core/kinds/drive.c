/* drive: a coordinate of a point of body 1 in the frame of body 2, or the angle between the two, follows a signal u.
 *
 *   g = e . D - c - u = 0           x, y    e = R(phi2) (1, 0) or R(phi2) (0, 1), D = r1 + R(phi1) s1 - r2,
 *   g = phi1 - phi2 - u = 0         angle   c = that component of s2                    (1 holonomic row)
 *
 * With p = e turned by +90 degrees and a = R(phi1) s1, so that de/dphi2 = p and dp/dphi2 = -e:
 *   G     = [ e  -p.a | -e  p.D ],  eta = u'                      (angle: [ 0 0 1 | 0 0 -1 ])
 *   gamma = u'' - v.H v, H = d2g/dq2, whose entries are p and -p over (r1, phi2) and (r2, phi2), -e.a over
 *           (phi1, phi1), e.a over (phi1, phi2), -e.D over (phi2, phi2)
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, sections 3.3 and 3.5.)
 * The drive acts on body 1 with -lambda: along e at its point, or as a moment; on body 2 with the opposite. */
#include <math.h>
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double s1[2]; /* the driven point in body 1's frame [m] */
  double e[2];  /* direction in body 2's frame; zero for an angle */
  double c;     /* component of the other point [m] */
  double turn;  /* 1 for an angle, else 0 */
} drive;

/* Directions and arms in world axes. */
typedef struct {
  double ex, ey, px, py, X, Y, Dx, Dy;
} drive_axes;

static inline drive_axes drive_turn (const drive *k, const pw_pose *A, const pw_pose *B) {
  drive_axes s = { .ex = B->cos * k->e[0] - B->sin * k->e[1], .ey = B->sin * k->e[0] + B->cos * k->e[1] };
  s.px = -s.ey, s.py = s.ex;
  s.X = A->cos * k->s1[0] - A->sin * k->s1[1], s.Y = A->sin * k->s1[0] + A->cos * k->s1[1];
  s.Dx = A->x + s.X - B->x, s.Dy = A->y + s.Y - B->y;
  return s;
}

/* Names the parts of element e: itself, its two poses, axes and the products of axes that occur. */
#define DRIVE_PARTS                                                               \
  const drive *k = (const drive *)b->element + e;                                 \
  const pw_pose *A = &b->pose[b->body[2 * e]], *B = &b->pose[b->body[2 * e + 1]]; \
  const drive_axes s = drive_turn (k, A, B);                                      \
  const double ea = s.ex * s.X + s.ey * s.Y, eD = s.ex * s.Dx + s.ey * s.Dy;      \
  const double pa = s.px * s.X + s.py * s.Y, pD = s.px * s.Dx + s.py * s.Dy;      \
  (void)ea, (void)eD, (void)pa, (void)pD

static int drive_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_own *own,
                          pw_error *error) {
  const pw_drive *d = definition;
  drive k = { .s1 = { d->at[0][0], d->at[0][1] }, .turn = d->what == PW_DRIVE_ANGLE };
  if (d->what != PW_DRIVE_ANGLE) {
    k.e[d->what] = 1;
    k.c = d->at[1][d->what];
  }
  *(drive *)element = k;
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void drive_g (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    DRIVE_PARTS;
    out[e] = eD - k->c + k->turn * (A->phi - B->phi) - b->u[3 * e];
  }
}

static void drive_g_size (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    DRIVE_PARTS;
    out[e] = fabs (s.ex) * (fabs (A->x) + fabs (s.X) + fabs (B->x)) +
             fabs (s.ey) * (fabs (A->y) + fabs (s.Y) + fabs (B->y)) + fabs (k->c) +
             k->turn * (fabs (A->phi) + fabs (B->phi)) + fabs (b->u[3 * e]);
  }
}

static void drive_eta (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) out[e] = b->u[3 * e + 1];
}

static void drive_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    DRIVE_PARTS;
    out[0] = s.ex, out[1] = s.ey, out[2] = k->turn - pa;
    out[3] = -s.ex, out[4] = -s.ey, out[5] = pD - k->turn;
  }
}

/* out = factor H w; (x, y) is w of r1 less that of r2, w1 and w2 are those of the angles. */
static inline void drive_curve (double *out, double factor, const drive_axes *s, double ea, double eD, double x,
                                double y, double w1, double w2) {
  out[0] = factor * s->px * w2;
  out[1] = factor * s->py * w2;
  out[2] = factor * ea * (w2 - w1);
  out[3] = -out[0];
  out[4] = -out[1];
  out[5] = factor * (s->px * x + s->py * y + ea * w1 - eD * w2);
}

static void drive_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    DRIVE_PARTS;
    double w1 = A->omega, w2 = B->omega, pV = s.px * (A->vx - B->vx) + s.py * (A->vy - B->vy);
    out[e] = b->u[3 * e + 2] - 2 * w2 * pV + w1 * (w1 - 2 * w2) * ea + w2 * w2 * eD;
  }
}

static void drive_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    DRIVE_PARTS;
    const double *w = b->w + 6 * e;
    drive_curve (out, 1, &s, ea, eD, w[0] - w[3], w[1] - w[4], w[2], w[5]);
  }
}

static void drive_jtl_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    DRIVE_PARTS;
    double l = b->lambda[e];
    memset (out, 0, 36 * sizeof *out);
    out[5] = out[30] = l * s.px, out[11] = out[31] = l * s.py;
    out[23] = out[33] = -l * s.px, out[29] = out[34] = -l * s.py;
    out[14] = -l * ea, out[17] = out[32] = l * ea, out[35] = -l * eD;
  }
}

static void drive_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    DRIVE_PARTS;
    double w1 = A->omega, w2 = B->omega, eV = s.ex * (A->vx - B->vx) + s.ey * (A->vy - B->vy);
    out[0] = w2 * w2 * s.ex;
    out[1] = w2 * w2 * s.ey;
    out[2] = -(w1 - w2) * (w1 - w2) * pa;
    out[3] = -out[0];
    out[4] = -out[1];
    out[5] = 2 * w2 * eV + w1 * (w1 - 2 * w2) * pa + w2 * w2 * pD;
  }
}

static void drive_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    DRIVE_PARTS;
    drive_curve (out, -2, &s, ea, eD, A->vx - B->vx, A->vy - B->vy, A->omega, B->omega);
  }
}

static const char *const drive_what[] = { "x", "y", "angle", NULL };

static const pw_field drive_fields[] = {
  { PW_AT (pw_drive, body), PW_BODY, .count = 2, .required = 1,
    .about = "the driven body, and the one it is seen from; ground for one of them" },
  { PW_AT (pw_drive, at), PW_POINT, .count = 2, .unit = "m",
    .about = "a point in each body's frame; without meaning for an angle" },
  { PW_AT (pw_drive, what), PW_CHOICE, .required = 1, .choices = drive_what,
    .about = "from the second point to the first in the second body's frame, or from body to body" },
  { PW_AT (pw_drive, value), PW_SIGNAL, .unit = "m or rad", .required = 1,
    .about = "its value over time, with two derivatives" },
  { .name = NULL },
};

static const pw_quantity drive_reaction[] = {
  { "F", "N or N m", NULL,
    "force on the first body at its point, along what is prescribed; moment on it for an angle" },
};

static const char *drive_unit (const void *element, int row) {
  (void)row;
  return ((const drive *)element)->turn != 0 ? "N m" : "N";
}

const pw_kind pw_kind_drive = {
  .name = "drive",
  .about = "a relative coordinate or angle of two bodies follows a signal of time",
  .definition = sizeof (pw_drive),
  .element = sizeof (drive),
  .fields = drive_fields,
  .bodies = 2,
  .rows = 1,
  .signals = 1,
  .level = PW_HOLONOMIC,
  .reaction = drive_reaction,
  .reaction_unit = drive_unit,
  .prepare = drive_prepare,
  .g = drive_g,
  .g_size = drive_g_size,
  .eta = drive_eta,
  .J = drive_J,
  .gamma = drive_gamma,
  .jw_q = drive_jw_q,
  .jtl_q = drive_jtl_q,
  .gamma_q = drive_gamma_q,
  .gamma_v = drive_gamma_v,
};
