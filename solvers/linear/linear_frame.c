/* The co-moving frame of a linearisation, symmetries of the system, steadiness of the motion.
 *
 * In a frame with the origin r, the velocity u and the angular velocity w, a body at (x, y) with the velocity v is at
 * rest if v = u + w (-(y - r_y), x - r_x), and its acceleration is W v = w (-v_y, v_x, 0).  A motion relative to the
 * frame with constant velocity d is also steady if the equations do not depend on it: the spin of a balanced rotor,
 * bodies that drift apart.  In a rotating frame d rotates with it unless it belongs to an angle, so W d counts as an
 * acceleration. */
#include <lapacke.h>
#include <math.h>
#include <string.h>
#include "linear.h"
#include "rank.h"

/* Residuals are dimensionless; accelerations in units of L / T^2, angles times L.
 *
 * LINEAR_STEADY: below it the linearisation changes by that fraction within the time scale T, less than the accuracy of
 * initial values with 6 digits.  LINEAR_EXACT: round-off of accelerations, for which a rotating frame must not be
 * chosen. */
static const double LINEAR_STEADY = 1e-6, LINEAR_EXACT = 1e-13;

enum {
  LINEAR_IN_TURN = 8,      /* states compared in a turn of the frame */
  LINEAR_MOST_SPANS = 1000 /* the part of a turn that is sampled, in spans */
};

/* The unit of accelerations, L / T^2. */
static double linear_unit (const pw_linearisation *x) {
  const pw_scale *scale = &x->r->w->scale;
  return scale->length / (scale->time * scale->time);
}

/* ---- The frame ---- */

/* Computes the frame's residual: the largest |a - W v| and, for motions relative to the frame, |W d|. */
static void linear_set_residual (const pw_linearisation *x, pw_linear_frame *f) {
  const double *q = x->r->q, *v = x->r->v, *a = x->a, w = f->twist[2];
  double most = 0;
  for (int j = 0; j < 3 * x->r->s->bodies; j += 3) {
    double relative_x = v[j] - f->twist[0] + w * (q[j + 1] - f->origin[1]);
    double relative_y = v[j + 1] - f->twist[1] - w * (q[j] - f->origin[0]);
    most = pw_larger_or_nan (most, hypot (a[j] + w * v[j + 1], a[j + 1] - w * v[j]));
    most = pw_larger_or_nan (most, fabs (w) * hypot (relative_x, relative_y));
  }
  for (int j = 0; j < x->n; j++)
    if (pw_is_angle (x->r->s, j)) most = pw_larger_or_nan (most, fabs (a[j]) * x->r->s->scale.length);
  f->acceleration = most;
  f->residual = most / linear_unit (x);
}

/* The frame at body b, with its velocity and the angular velocity w. */
static pw_linear_frame linear_frame_at (const pw_linearisation *x, int b, double w) {
  const double *q = x->r->q + 3 * b, *v = x->r->v + 3 * b;
  pw_linear_frame f = { .origin = { q[0], q[1] }, .twist = { v[0], v[1], w } };
  linear_set_residual (x, &f);
  return f;
}

/* The frame that rotates with the positions of all bodies: at their mean, with its velocity and the angular velocity
 * that fits theirs best.  If all are at one point, the one that rotates with its velocity, w = v x a / v^2, if the
 * motion is steady in it. */
static pw_linear_frame linear_fit (const pw_linearisation *x) {
  const double *q = x->r->q, *v = x->r->v, *a = x->a;
  int bodies = x->r->s->bodies;
  double moment = 0, square = 0;
  pw_linear_frame f = { .residual = INFINITY };
  for (int j = 0; j < 3 * bodies; j++)
    if (j % 3 < 2) f.origin[j % 3] += q[j] / bodies, f.twist[j % 3] += v[j] / bodies;
  for (int j = 0; j < 3 * bodies; j += 3) {
    double dx = q[j] - f.origin[0], dy = q[j + 1] - f.origin[1];
    moment += dx * (v[j + 1] - f.twist[1]) - dy * (v[j] - f.twist[0]);
    square += dx * dx + dy * dy;
  }
  const int at_one_point = !(square > 0);
  if (at_one_point) moment = v[0] * a[1] - v[1] * a[0], square = v[0] * v[0] + v[1] * v[1];
  f.twist[2] = moment / square;
  linear_set_residual (x, &f);
  if (at_one_point && !(f.residual <= LINEAR_STEADY)) f.residual = INFINITY;
  return f;
}

void pw_linear_choose_frame (pw_linearisation *x) {
  if (x->r->s->bodies == 0) return;
  x->frame = linear_frame_at (x, 0, 0);
  for (int b = 0; b < x->r->s->bodies && x->frame.residual > LINEAR_EXACT; b++) {
    pw_linear_frame f = linear_frame_at (x, b, x->r->v[3 * b + 2]);
    if (f.residual < x->frame.residual / 2) x->frame = f;
  }
  pw_linear_frame f = linear_fit (x);
  if (x->frame.residual > LINEAR_EXACT && f.residual < x->frame.residual / 2) x->frame = f;
}

/* ---- Symmetries ---- */

/* dx = the variation by a rigid displacement of the whole: by L along x (k = 0) or y (1), or by 1 rad about the frame's
 * origin (2). */
static void linear_displace (pw_linearisation *x, int k) {
  const pw_system *s = x->r->s;
  const double *q = x->r->q, *v = x->r->v;
  memset (x->dx, 0, 2 * (size_t)x->n * sizeof *x->dx);
  for (int j = 0; j < 3 * s->bodies; j += 3) {
    if (k < 2) {
      x->dx[j + k] = s->scale.length;
      continue;
    }
    x->dx[j] = x->frame.origin[1] - q[j + 1];
    x->dx[j + 1] = q[j] - x->frame.origin[0];
    x->dx[j + 2] = 1;
  }
  if (k == 2) pw_linear_turn (x, 1, v, x->dx + x->n);
}

/* The scaled residuals of G dq = 0 and J dv + B dq = 0 for the variation dx: `holonomic` + `rank` numbers; `product`
 * and J must be up to date.  Returns the end of the numbers. */
static double *linear_violation (pw_linearisation *x, double *out) {
  const pw_system *s = x->r->s;
  pw_mul_J (x->r->w, x->dx, x->row_scratch);
  for (int k = 0; k < x->holonomic; k++) *out++ = x->row_scratch[x->row[k]] / x->norm[x->row[k]] / s->scale.length;
  pw_mul_J (x->r->w, x->dx + x->n, x->row_scratch);
  for (int k = 0; k < x->rank; k++) {
    int i = x->row[k];
    *out++ = (x->row_scratch[i] + x->product[x->n + x->m + i]) / x->norm[i] * x->r->w->scale.time / s->scale.length;
  }
  return out;
}

void pw_linear_asymmetry (pw_linearisation *x, double turn, double *out) {
  pw_linear_vary (x);
  out = linear_violation (x, out);
  pw_linear_turn (x, -turn, x->a, x->da);
  for (int j = 0; j < x->n; j++) out[j] = x->da[j] * pw_length_factor (x->r->s, j) / linear_unit (x);
}

/* The largest asymmetry of a symmetry: round-off, relative to 1 + 1e-4 x the largest derivative of an acceleration. */
static double linear_tolerance (const pw_linearisation *x) {
  double most = 0, T = x->r->w->scale.time;
  for (int i = x->positions; i < x->size; i++)
    for (int k = 0; k < x->size; k++) most = pw_larger_or_nan (most, fabs (x->A[i * x->size + k]) * T);
  return PW_LINEAR_SYMMETRIC + 1e-4 * PW_LINEAR_SYMMETRIC * most;
}

/* The null space of the asymmetries, from their singular value decomposition U sigma V^T; x->symmetry becomes a basis
 * of it: sums of the three displacements, whose coefficients are the last rows of V^T. */
int pw_linear_symmetries (pw_linearisation *x) {
  int length = x->holonomic + x->rank + x->n, symmetries = 0;
  double tolerance = linear_tolerance (x), sigma[3], VT[9], *work = x->residual + 3 * length;
  if (x->r->s->bodies == 0) return 0;
  for (int k = 0; k < 3; k++) {
    linear_displace (x, k);
    pw_linear_coordinates (x, x->dx, x->dx + x->n, 1, x->symmetry + k * x->size);
    pw_linear_asymmetry (x, k == 2, x->residual + k * length);
  }
  for (int i = 0; i < 3 * length; i++)
    if (!isfinite (x->residual[i])) return 0;
  if (LAPACKE_dgesvd_work (LAPACK_COL_MAJOR, 'N', 'A', length, 3, x->residual, length, sigma, NULL, 1, VT, 3, work,
                           PW_LINEAR_SVD_WORK + length))
    return 0;
  while (symmetries < 3 && sigma[2 - symmetries] <= tolerance) symmetries++;
  for (int c = 0; c < x->size; c++) {
    double S[3] = { x->symmetry[c], x->symmetry[x->size + c], x->symmetry[2 * x->size + c] };
    for (int k = 0; k < symmetries; k++)
      x->symmetry[k * x->size + c] = VT[2 - k] * S[0] + VT[5 - k] * S[1] + VT[8 - k] * S[2];
  }
  return symmetries;
}

/* ---- Steadiness ---- */

/* The state to which a steady motion leads after a time: rotated with the frame about its origin, which has moved along
 * an arc.  Angles, internal coordinates, and all coordinates if the frame does not rotate, continue at constant
 * velocity. */
static void linear_later (const pw_linearisation *x, double time, double *q, double *v) {
  const pw_linear_frame *f = &x->frame;
  double w = f->twist[2], c = pw_cos (w * time), s = pw_sin (w * time);
  pw_linear_rotate (x, w * time, x->r->v, v);
  for (int j = 0; j < x->n; j++) q[j] = x->r->q[j] + time * x->r->v[j];
  for (int j = 0; w != 0 && j < 3 * x->r->s->bodies; j += 3) {
    double dx = x->r->q[j] - f->origin[0], dy = x->r->q[j + 1] - f->origin[1];
    q[j] = f->origin[0] + c * dx - s * dy + (s * f->twist[0] - (1 - c) * f->twist[1]) / w;
    q[j + 1] = f->origin[1] + s * dx + c * dy + ((1 - c) * f->twist[0] + s * f->twist[1]) / w;
  }
}

/* Whether two vectors of accelerations agree to LINEAR_STEADY. */
static int linear_agree (const pw_linearisation *x, const double *a, const double *b) {
  double off = 0, most = linear_unit (x);
  for (int j = 0; j < x->n; j++) {
    double unit = pw_length_factor (x->r->s, j);
    off = pw_larger_or_nan (off, fabs (a[j] - b[j]) * unit);
    most = fmax (most, fabs (b[j]) * unit);
  }
  return off <= LINEAR_STEADY * most;
}

/* Whether the equations and their linearisation are the same after a time, except for the rotation, with the signals
 * after `later`. */
static int linear_same (pw_linearisation *x, double time, double later) {
  double angle = x->frame.twist[2] * time, *q = x->later, *v = q + x->n, *expected = x->scratch;
  pw_residuals now;
  linear_later (x, time, q, v);
  if (pw_linear_evaluate (x, x->r->t + later, q, v) != PW_OK) return 0;
  pw_evaluate_residuals (x->r->w, x->r->active, &now);
  if (!(now.position <= LINEAR_STEADY && now.velocity <= LINEAR_STEADY)) return 0;
  pw_linear_rotate (x, angle, x->probe_a, expected);
  if (!linear_agree (x, x->a, expected)) return 0;
  pw_linear_rotate (x, angle, x->probe, x->dx);
  pw_linear_rotate (x, angle, x->probe + x->n, x->dx + x->n);
  pw_linear_vary (x);
  double *end = linear_violation (x, x->residual);
  for (double *i = x->residual; i < end; i++)
    if (!(fabs (*i) <= LINEAR_STEADY)) return 0;
  pw_linear_rotate (x, angle, x->probe_da, expected);
  return linear_agree (x, x->da, expected);
}

/* A variation with components along all minimal coordinates, and its accelerations. */
static void linear_set_probe (pw_linearisation *x) {
  memset (x->probe, 0, 2 * (size_t)x->n * sizeof *x->probe);
  for (int c = 0; c < x->size; c++) {
    double weight = x->r->s->scale.length * pw_irregular (1.7, c + 1);
    pw_linear_tangent (x, c);
    for (int j = 0; j < 2 * x->n; j++) x->probe[j] += weight * x->dx[j];
  }
  memcpy (x->dx, x->probe, 2 * (size_t)x->n * sizeof *x->dx);
  pw_linear_vary (x);
  memcpy (x->probe_da, x->da, (size_t)x->n * sizeof *x->da);
  memcpy (x->probe_a, x->a, (size_t)x->n * sizeof *x->a);
}

/* Whether the equations are the same within a turn of the frame that takes longer than the span, or within
 * LINEAR_MOST_SPANS, if no signal changes within the span. */
static int linear_same_in_turn (pw_linearisation *x, double span) {
  const double turn = fmin (2 * PW_PI / fabs (x->frame.twist[2]), LINEAR_MOST_SPANS * span);
  int same = 1;
  if (x->frame.twist[2] == 0 || turn <= span) return 1;
  if (!linear_same (x, 0, 0.31 * span) || !linear_same (x, 0, span)) return 1;
  for (int i = 1; same && i <= LINEAR_IN_TURN; i++)
    same = linear_same (x, fmod (0.618034 * i, 1) * turn, 0); /* golden ratio: equidistributed */
  return same;
}

/* Times at irregular fractions of the span and of T, so that a periodic change is not sampled at its period. */
pw_steadiness pw_linear_steady (pw_linearisation *x) {
  static const double fraction[] = { 0.0123, 0.31, 0.77, 1 };
  pw_run *r = x->r;
  const double span = r->settings.span > 0 ? r->settings.span : r->w->scale.time;
  const double soon = 0.137 * fmin (r->w->scale.time, span);
  if (!(x->frame.residual <= LINEAR_STEADY)) return PW_ACCELERATED;
  if (!(pw_next_breakpoint (r->w, 0, r->t) > r->t + span)) return PW_CHANGING;
  linear_set_probe (x);
  int same = linear_same (x, soon, soon);
  for (size_t i = 0; same && i < sizeof fraction / sizeof *fraction; i++)
    same = linear_same (x, fraction[i] * span, fraction[i] * span);
  same = same && linear_same_in_turn (x, span);
  return pw_linear_evaluate (x, r->t, r->q, r->v) == PW_OK && same ? PW_STEADY : PW_CHANGING;
}
