/* The EzyRoller by hand: redundant coordinates with the steering assembly's mass and without, and minimal ones.
 *
 * With c1, s1, c2, s2 the cosines and sines of both angles the rows are
 *
 *   Bx   [  1    0   -b s1 | -1   0   -d s2 ]        gamma  b c1 w1^2 + d c2 w2^2
 *   By   [  0    1    b c1 |  0  -1    d c2 ]               b s1 w1^2 + d s2 w2^2
 *   A    [ -s1   c1  -a    |  0   0    0    ]               w1 (c1 vx1 + s1 vy1)
 *   C    [  0    0    0    | -s2  c2   c    ]               w2 (c2 vx2 + s2 vy2)
 *
 * and the multipliers solve the 4 x 4 system S lambda = J M^-1 f - gamma, S = J M^-1 J^T.  The pivots of the wheels are
 * constant, and no body has both of them, so they are eliminated first; a 2 x 2 block remains for the hinge. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "baseline.h"

enum { EZY_ITERATIONS = 10 }; /* of the position projection; it takes 2 or 3 */

/* Cosines and sines of phi1 and phi2. */
typedef struct {
  double c1, s1, c2, s2;
} ezy_directions;

static inline ezy_directions ezy_directions_of (const double *q) {
  return (ezy_directions){ cos (q[2]), sin (q[2]), cos (q[5]), sin (q[5]) };
}

static inline double ezy_torque (const ezy *e, double t) {
  return e->p.M0 * cos (e->p.omega * t);
}

static inline void ezy_gamma (const ezy_model *p, const ezy_directions *x, const double *v, double *gamma) {
  double w1 = v[2] * v[2], w2 = v[5] * v[5];
  gamma[0] = p->b * x->c1 * w1 + p->d * x->c2 * w2;
  gamma[1] = p->b * x->s1 * w1 + p->d * x->s2 * w2;
  gamma[2] = v[2] * (x->c1 * v[0] + x->s1 * v[1]);
  gamma[3] = v[5] * (x->c2 * v[3] + x->s2 * v[4]);
}

/* J w */
static inline void ezy_rows (const ezy_model *p, const ezy_directions *x, const double *w, double *out) {
  out[0] = w[0] - p->b * x->s1 * w[2] - w[3] - p->d * x->s2 * w[5];
  out[1] = w[1] + p->b * x->c1 * w[2] - w[4] + p->d * x->c2 * w[5];
  out[2] = -x->s1 * w[0] + x->c1 * w[1] - p->a * w[2];
  out[3] = -x->s2 * w[3] + x->c2 * w[4] + p->c * w[5];
}

/* J^T lambda, l: lambda */
static inline void ezy_transpose (const ezy_model *p, const ezy_directions *x, const double *l, double *out) {
  out[0] = l[0] - x->s1 * l[2];
  out[1] = l[1] + x->c1 * l[2];
  out[2] = p->b * (x->c1 * l[1] - x->s1 * l[0]) - p->a * l[2];
  out[3] = -l[0] - x->s2 * l[3];
  out[4] = -l[1] + x->c2 * l[3];
  out[5] = p->d * (x->c2 * l[1] - x->s2 * l[0]) + p->c * l[3];
}

void ezy_open (ezy *e, const ezy_model *model) {
  const ezy_model *p = model;
  int massive = p->m2 > 0;
  double light = 1e-6 * p->m1; /* a massless body 2 moves in place of body 1 */
  double size = fmax (fmax (p->a, p->b), fmax (p->c, p->d));
  *e = (ezy){ .p = *p, .i1 = 1 / p->m1, .k1 = 1 / p->I1, .ih = 1 / (p->c + p->d) };
  e->move1 = e->i1, e->turn1 = e->k1;
  e->move2 = 1 / light, e->turn2 = 1 / (light * size * size);
  e->pivot_A = 1 / (e->i1 + p->a * p->a * e->k1);
  if (!massive) return;
  e->move2 = e->i2 = 1 / p->m2, e->turn2 = e->k2 = 1 / p->I2;
  e->pivot_C = 1 / (e->i2 + p->c * p->c * e->k2);
  e->couple_A = p->a * p->b * e->k1 - e->i1;
  e->couple_C = e->i2 - p->c * p->d * e->k2;
  e->remain1 = p->b * p->b * e->k1 - e->couple_A * e->couple_A * e->pivot_A;
  e->remain2 = p->d * p->d * e->k2 - e->couple_C * e->couple_C * e->pivot_C;
  e->trace = 2 * (e->i1 + e->i2) + e->remain1 + e->remain2;
}

/* ---- With mass in the steering assembly ---- */

/* S with its wheels eliminated: columns A and C in the rows of the hinge, and the inverse of the block that remains,
 *
 *   1/m1 + 1/m2 + k1' n1 n1^T + k2' n2 n2^T,   n = (-s, c)
 *   k1' = b^2/I1 - (a b/I1 - 1/m1)^2 / S_AA,   k2' = d^2/I2 - (1/m2 - c d/I2)^2 / S_CC */
typedef struct {
  double Ax, Ay, Cx, Cy; /* columns of S */
  double xx, xy, yy;     /* inverse of the block */
} ezy_factor;

static inline ezy_factor ezy_factorise (const ezy *e, const ezy_directions *x) {
  ezy_factor f = {
    .Ax = e->couple_A * x->s1, .Ay = -e->couple_A * x->c1, .Cx = e->couple_C * x->s2, .Cy = -e->couple_C * x->c2
  };
  double n1 = e->remain1 * x->s1, n2 = e->remain2 * x->s2;
  double xx = e->i1 + e->i2 + n1 * x->s1 + n2 * x->s2, xy = -n1 * x->c1 - n2 * x->c2, yy = e->trace - xx;
  double det = 1 / (xx * yy - xy * xy);
  f.xx = yy * det, f.xy = -xy * det, f.yy = xx * det;
  return f;
}

/* S lambda = r */
static inline void ezy_solve (const ezy *e, const ezy_factor *f, const double *r, double *lambda) {
  double A = e->pivot_A * r[2], C = e->pivot_C * r[3];
  double x = r[0] - f->Ax * A - f->Cx * C, y = r[1] - f->Ay * A - f->Cy * C;
  lambda[0] = f->xx * x + f->xy * y;
  lambda[1] = f->xy * x + f->yy * y;
  lambda[2] = A - e->pivot_A * (f->Ax * lambda[0] + f->Ay * lambda[1]);
  lambda[3] = C - e->pivot_C * (f->Cx * lambda[0] + f->Cy * lambda[1]);
}

static inline void ezy_massive_solve (const ezy *e, const ezy_directions *x, const ezy_factor *f, double T,
                                      const double *v, double *a, double *lambda) {
  const ezy_model *p = &e->p;
  double A1 = e->k1 * T, A2 = -e->k2 * T; /* angular accelerations without constraints */
  double r[4], force[6];
  ezy_gamma (p, x, v, r);
  r[0] = -p->b * x->s1 * A1 - p->d * x->s2 * A2 - r[0];
  r[1] = p->b * x->c1 * A1 + p->d * x->c2 * A2 - r[1];
  r[2] = -p->a * A1 - r[2];
  r[3] = p->c * A2 - r[3];
  ezy_solve (e, f, r, lambda);
  ezy_transpose (p, x, lambda, force);
  a[0] = -e->i1 * force[0];
  a[1] = -e->i1 * force[1];
  a[2] = A1 - e->k1 * force[2];
  a[3] = -e->i2 * force[3];
  a[4] = -e->i2 * force[4];
  a[5] = A2 - e->k2 * force[5];
}

static inline void ezy_massive_by (const ezy *e, double T, const double *q, const double *v, double *a,
                                   double *lambda) {
  ezy_directions x = ezy_directions_of (q);
  ezy_factor f = ezy_factorise (e, &x);
  ezy_massive_solve (e, &x, &f, T, v, a, lambda);
}

void ezy_massive (const ezy *e, double t, const double *q, const double *v, double *a, double *lambda) {
  ezy_massive_by (e, ezy_torque (e, t), q, v, a, lambda);
}

/* ---- Without mass: the hinge and wheel C balance the torque, and body 2 follows body 1 ---- */

/* The equations of body 2 alone give the forces on it; the remaining unknown, lambda_A, follows from the row of
 * wheel A. */
static inline void ezy_massless_solve (const ezy *e, const ezy_directions *x, double T, const double *v, double *a,
                                       double *lambda) {
  const ezy_model *p = &e->p;
  double gamma[4];
  ezy_gamma (p, x, v, gamma);
  lambda[3] = -T * e->ih;
  lambda[0] = -x->s2 * lambda[3];
  lambda[1] = x->c2 * lambda[3];
  double X = -e->i1 * lambda[0], Y = -e->i1 * lambda[1];
  double R = e->k1 * (T + p->b * (x->s1 * lambda[0] - x->c1 * lambda[1]));
  lambda[2] = e->pivot_A * (x->c1 * Y - x->s1 * X - p->a * R - gamma[2]);
  a[0] = X + e->i1 * x->s1 * lambda[2];
  a[1] = Y - e->i1 * x->c1 * lambda[2];
  a[2] = R + e->k1 * p->a * lambda[2];
  double Bx = a[0] - p->b * x->s1 * a[2] - gamma[0], By = a[1] + p->b * x->c1 * a[2] - gamma[1];
  a[5] = (gamma[3] + x->s2 * Bx - x->c2 * By) * e->ih;
  a[3] = Bx - p->d * x->s2 * a[5];
  a[4] = By + p->d * x->c2 * a[5];
}

static inline void ezy_massless_by (const ezy *e, double T, const double *q, const double *v, double *a,
                                    double *lambda) {
  ezy_directions x = ezy_directions_of (q);
  ezy_massless_solve (e, &x, T, v, a, lambda);
}

void ezy_massless (const ezy *e, double t, const double *q, const double *v, double *a, double *lambda) {
  ezy_massless_by (e, ezy_torque (e, t), q, v, a, lambda);
}

/* ---- Steps ---- */

/* Projects q onto the hinge by Gauss-Newton in the metric, to round-off.  Returns the directions of the result. */
static inline ezy_directions ezy_project_hinge (const ezy *e, double *q) {
  const ezy_model *p = &e->p;
  for (int n = 0;; n++) {
    ezy_directions x = ezy_directions_of (q);
    double b1 = p->b * x.s1, b2 = p->b * x.c1, d1 = p->d * x.s2, d2 = p->d * x.c2;
    double gx = q[0] + b2 + d2 - q[3], gy = q[1] + b1 + d1 - q[4];
    double residual =
        fmax (fabs (gx) / fmax (1, fabs (q[0]) + fabs (q[3])), fabs (gy) / fmax (1, fabs (q[1]) + fabs (q[4])));
    if (residual <= 4 * DBL_EPSILON || n == EZY_ITERATIONS) return x;
    double i = e->move1 + e->move2, xx = i + e->turn1 * b1 * b1 + e->turn2 * d1 * d1;
    double xy = -e->turn1 * b1 * b2 - e->turn2 * d1 * d2, yy = i + e->turn1 * b2 * b2 + e->turn2 * d2 * d2;
    double det = 1 / (xx * yy - xy * xy), mx = det * (yy * gx - xy * gy), my = det * (xx * gy - xy * gx);
    q[0] -= e->move1 * mx;
    q[1] -= e->move1 * my;
    q[2] -= e->turn1 * (b2 * my - b1 * mx);
    q[3] += e->move2 * mx;
    q[4] += e->move2 * my;
    q[5] -= e->turn2 * (d2 * my - d1 * mx);
  }
}

typedef void ezy_rhs (const ezy *e, double T, const double *q, const double *v, double *a, double *lambda);

/* Stages 2 to 4 of the classical method; stage 1 is the state itself.  q and v take the result.  Returns the torque at
 * the end of the step. */
static inline double ezy_stages (const ezy *e, ezy_rhs *rhs, double h, const ezy_state *s, double *q, double *v) {
  double v2[6], v3[6], v4[6], a2[6], a3[6], a4[6], lambda[4];
  double middle = ezy_torque (e, s->t + h / 2), end = ezy_torque (e, s->t + h);
  for (int j = 0; j < 6; j++) q[j] = s->q[j] + h / 2 * s->v[j], v2[j] = s->v[j] + h / 2 * s->a[j];
  rhs (e, middle, q, v2, a2, lambda);
  for (int j = 0; j < 6; j++) q[j] = s->q[j] + h / 2 * v2[j], v3[j] = s->v[j] + h / 2 * a2[j];
  rhs (e, middle, q, v3, a3, lambda);
  for (int j = 0; j < 6; j++) q[j] = s->q[j] + h * v3[j], v4[j] = s->v[j] + h * a3[j];
  rhs (e, end, q, v4, a4, lambda);
  for (int j = 0; j < 6; j++) {
    q[j] = s->q[j] + h / 6 * (s->v[j] + 2 * v2[j] + 2 * v3[j] + v4[j]);
    v[j] = s->v[j] + h / 6 * (s->a[j] + 2 * a2[j] + 2 * a3[j] + a4[j]);
  }
  return end;
}

/* Projects, and computes the accelerations: one factorisation serves the velocities and the accelerations. */
static inline void ezy_massive_finish (const ezy *e, double t, double T, double *q, double *v, ezy_state *s) {
  double r[4], mu[4], force[6];
  ezy_directions x = ezy_project_hinge (e, q);
  ezy_factor f = ezy_factorise (e, &x);
  ezy_rows (&e->p, &x, v, r);
  ezy_solve (e, &f, r, mu);
  ezy_transpose (&e->p, &x, mu, force);
  s->t = t;
  memcpy (s->q, q, sizeof s->q);
  s->v[0] = v[0] - e->i1 * force[0];
  s->v[1] = v[1] - e->i1 * force[1];
  s->v[2] = v[2] - e->k1 * force[2];
  s->v[3] = v[3] - e->i2 * force[3];
  s->v[4] = v[4] - e->i2 * force[4];
  s->v[5] = v[5] - e->k2 * force[5];
  ezy_massive_solve (e, &x, &f, T, s->v, s->a, s->lambda);
}

/* The impulse of wheel A alone changes the velocities of body 1; those of body 2 follow from them. */
static inline void ezy_massless_finish (const ezy *e, double t, double T, double *q, double *v, ezy_state *s) {
  const ezy_model *p = &e->p;
  ezy_directions x = ezy_project_hinge (e, q);
  double mu = e->pivot_A * (x.c1 * v[1] - x.s1 * v[0] - p->a * v[2]);
  s->t = t;
  memcpy (s->q, q, sizeof s->q);
  s->v[0] = v[0] + e->i1 * x.s1 * mu;
  s->v[1] = v[1] - e->i1 * x.c1 * mu;
  s->v[2] = v[2] + e->k1 * p->a * mu;
  double Bx = s->v[0] - p->b * x.s1 * s->v[2], By = s->v[1] + p->b * x.c1 * s->v[2];
  s->v[5] = (x.s2 * Bx - x.c2 * By) * e->ih;
  s->v[3] = Bx - p->d * x.s2 * s->v[5];
  s->v[4] = By + p->d * x.c2 * s->v[5];
  ezy_massless_solve (e, &x, T, s->v, s->a, s->lambda);
}

void ezy_massive_step (const ezy *e, double h, ezy_state *s) {
  double q[6], v[6], T = ezy_stages (e, ezy_massive_by, h, s, q, v);
  ezy_massive_finish (e, s->t + h, T, q, v, s);
}

void ezy_massless_step (const ezy *e, double h, ezy_state *s) {
  double q[6], v[6], T = ezy_stages (e, ezy_massless_by, h, s, q, v);
  ezy_massless_finish (e, s->t + h, T, q, v, s);
}

void ezy_project (const ezy *e, double t, double q[6], double v[6], ezy_state *s) {
  (e->p.m2 > 0 ? ezy_massive_finish : ezy_massless_finish) (e, t, ezy_torque (e, t), q, v, s);
}

void ezy_start (const ezy *e, ezy_state *s) {
  *s = (ezy_state){ .q = { [3] = e->p.b - e->p.d, [5] = acos (-1) } };
  (e->p.m2 > 0 ? ezy_massive : ezy_massless) (e, 0, s->q, s->v, s->a, s->lambda);
}

/* ---- Minimal coordinates ---- */

/* Kane's equations in u, the speed of A along the frame, and w = phi1'.  With delta = phi2 - phi1 and L = a + b the
 * centre of mass of body 2 has the velocity p = u cos delta + L w sin delta along body 2 and -c w2 across it. */
void ezy_minimal (const ezy *e, double t, const double y[6], double rate[6]) {
  const ezy_model *m = &e->p;
  double C = cos (y[3] - y[2]), S = sin (y[3] - y[2]), u = y[4], w = y[5], L = m->a + m->b, ih = e->ih;
  double T = ezy_torque (e, t), p = u * C + L * w * S, cross = u * S - L * w * C, w2 = cross * ih, turn = w2 - w;
  double K = (m->m2 * m->c * m->c + m->I2) * ih * ih;
  double uu = m->m1 + m->m2 * C * C + K * S * S, uw = L * S * C * (m->m2 - K);
  double ww = m->m1 * m->a * m->a + m->I1 + L * L * (m->m2 * S * S + K * C * C);
  double along = m->m2 * (m->c * w2 * w2 - turn * cross), across = (m->m2 * m->c * p * w2 - T) * ih - K * turn * p;
  double fu = m->m1 * m->a * w * w - along * C + across * S;
  double fw = -m->m1 * m->a * u * w + T - L * (along * S + across * C);
  double det = 1 / (uu * ww - uw * uw);
  rate[0] = u * cos (y[2]);
  rate[1] = u * sin (y[2]);
  rate[2] = w;
  rate[3] = w2;
  rate[4] = det * (ww * fu - uw * fw);
  rate[5] = det * (uu * fw - uw * fu);
}
