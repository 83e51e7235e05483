/* The equations of motion linearised on the constraints, in a frame that moves with the motion.
 *
 * A state obeys g (q, t) = 0 and J v = eta, so that variations obey  G dq = 0,  J dv = -B dq,  B = (J v)_q - eta_q.
 * With orthonormal bases N_q of the null space of G and N_v of that of J (both from one QR factorisation of J^T,
 * holonomic equations first, angles times L) the variations are
 *
 *     dq = N_q z,   dv = N_v u / T - J^+ B N_q z,
 *
 * with T the time scale of the scene; z and u are the minimal coordinates of the variation.  The variations of
 * the accelerations follow from the saddle-point system
 *
 *     [ M J^T ; J 0 ] (da, dlambda) = ( (f_q - (J^T lambda)_q) dq + f_v dv,  (gamma_q - (J a)_q) dq + gamma_v dv ),
 *
 * at constant time.  In a steady motion every body moves with the twist (vx, vy, w) of one frame (exceptions:
 * below), in which the state and the constraint manifold are at rest.  The components of vectors in that frame
 * rotate at -w, hence
 *
 *     z' = N_q^T (dv - W dq),   u' = T N_v^T (da - W dv),   W (x, y, phi) = w (-y, x, 0) for each body.
 *
 * Perturbations of a steady motion grow as exp (mu t) with the eigenvalues mu of this matrix A.  (Null-space form:
 * Garcia de Jalon & Bayo 1994, Kinematic and Dynamic Simulation of Multibody Systems.  Relative equilibria: Marsden &
 * Ratiu 1999, Introduction to Mechanics and Symmetry.) */
#include <complex.h>
#include <lapacke.h>
#include <stdlib.h>
#include "events.h"
#include "linear.h"
#include "rank.h"

/* Adds the derivatives with respect to q and v, by rows: (J^T lambda)_q - f_q and -f_v; gamma_q - (J a)_q and gamma_v;
 * B and 0. */
static void linear_put (pw_linearisation *x, const double *v) {
  const int n = x->n, of_J = n + x->m;
  const struct {
    pw_block block;
    int row, col;
    double factor;
    const double *w;
  } part[] = { { PW_JTL_Q, 0, 0, 1, NULL },   { PW_FORCE_Q, 0, 0, -1, NULL }, { PW_FORCE_V, 0, n, -1, NULL },
               { PW_GAMMA_Q, n, 0, 1, NULL }, { PW_GAMMA_V, n, n, 1, NULL },  { PW_JW_Q, n, 0, -1, x->a },
               { PW_JW_Q, of_J, 0, 1, v },    { PW_ETA_Q, of_J, 0, -1, NULL } };
  for (size_t i = 0; i < sizeof part / sizeof *part; i++)
    pw_tangent_add_block (&x->tangent, part[i].block,
                          &(pw_placement){ .row = part[i].row,
                                           .col = part[i].col,
                                           .rows = x->m,
                                           .factor = part[i].factor,
                                           .factor_nonholonomic = part[i].factor,
                                           .direction = part[i].w,
                                           .lambda = x->lambda });
  pw_tangent_add_signals (&x->tangent, 0, 0, n);
  pw_tangent_add_feedback (&x->tangent, &(pw_feedback){ 0, 0, n, 1, 1, .lambda = x->lambda });
  pw_tangent_add_feedback (&x->tangent, &(pw_feedback){ n, 0, n, -1, 1, .w = v, .a = x->a });
  pw_tangent_add_feedback (&x->tangent, &(pw_feedback){ of_J, 0, n, 1, 1, .w = v });
}

int pw_linear_evaluate (pw_linearisation *x, double t, const double *q, const double *v) {
  int status = pw_run_accelerate (x->r, t, q, v, x->a, x->lambda);
  if (status != PW_OK) return status;
  if (x->r->enforced) pw_fill_given (x->r, x->lambda);
  pw_scatter_begin_fill (&x->tangent.scatter, x->tangent.scatter.value);
  linear_put (x, v);
  return PW_OK;
}

static void linear_multiply (pw_linearisation *x) {
  const pw_scatter_map *t = &x->tangent.scatter;
  memset (x->product, 0, ((size_t)x->n + 2 * (size_t)x->m) * sizeof *x->product);
  for (int j = 0; j < 2 * x->n; j++)
    for (int64_t i = t->colptr[j]; i < t->colptr[j + 1]; i++) x->product[t->rowind[i]] += t->value[i] * x->dx[j];
}

void pw_linear_vary (pw_linearisation *x) {
  linear_multiply (x);
  for (int j = 0; j < x->n; j++) x->da[j] = -x->product[j];
  pw_saddle_solve (x->r->saddle, x->da, x->product + x->n, x->da, x->scratch);
}

/* Column j of Q without those of the unturned angles. */
static double *linear_column (const pw_linearisation *x, int j) {
  return x->Q + (size_t)(x->unturned + j) * (size_t)x->n;
}

/* The rows of J of the independent equations, of length 1, to Q. */
static void linear_independent_rows (pw_linearisation *x) {
  size_t n = (size_t)x->n;
  pw_rank_rows (x->r->w, x->R, x->norm);
  for (int k = 0; k < x->rank; k++) memcpy (linear_column (x, k), x->R + (size_t)x->row[k] * n, n * sizeof *x->R);
}

void pw_linear_bases (pw_linearisation *x) {
  int n = x->n, rank = x->rank;
  double *tau = x->da, *unit = x->Q;
  linear_independent_rows (x);
  memset (x->Q, 0, (size_t)x->unturned * (size_t)n * sizeof *x->Q);
  for (int j = 0; j < n; j++)
    if (pw_is_unturned (x->r->s, j)) unit[j] = 1, unit += n;
  LAPACKE_dgeqrf_work (LAPACK_COL_MAJOR, n, x->unturned + rank, x->Q, n, tau, x->scratch, n);
  for (int k = 0; k < rank; k++)
    memcpy (x->R + (size_t)k * (size_t)rank, linear_column (x, k) + x->unturned, (size_t)(k + 1) * sizeof *x->R);
  LAPACKE_dorgqr_work (LAPACK_COL_MAJOR, n, n, x->unturned + rank, x->Q, n, tau, x->scratch, n);
}

void pw_linear_tangent (pw_linearisation *x, int c) {
  int velocity = c >= x->positions, column = velocity ? x->rank + c - x->positions : x->holonomic + c;
  double T = x->r->w->scale.time, *b = x->row_scratch;
  const int stride = x->rank > 1 ? x->rank : 1; /* LAPACK refuses 0 */
  memset (x->dx, 0, 2 * (size_t)x->n * sizeof *x->dx);
  for (int j = 0; j < x->n; j++)
    x->dx[velocity ? x->n + j : j] = linear_column (x, column)[j] / pw_length_factor (x->r->s, j) / (velocity ? T : 1);
  if (velocity && x->r->s->feedback == 0) return;
  linear_multiply (x); /* dv -= J^+ B dq: solves R^T b = B dq, dv -= Q b */
  for (int i = 0; i < x->rank; i++) b[i] = x->product[x->n + x->m + x->row[i]] / x->norm[x->row[i]];
  LAPACKE_dtrtrs_work (LAPACK_COL_MAJOR, 'U', 'T', 'N', x->rank, 1, x->R, stride, b, stride);
  for (int i = 0; i < x->rank; i++)
    for (int j = 0; j < x->n; j++) x->dx[x->n + j] -= b[i] * linear_column (x, i)[j] / pw_length_factor (x->r->s, j);
}

/* Component of a vector over the coordinates along a column of Q. */
static double linear_along (const pw_linearisation *x, int column, const double *vector) {
  double sum = 0;
  for (int j = 0; j < x->n; j++) sum += linear_column (x, column)[j] * vector[j] * pw_length_factor (x->r->s, j);
  return sum;
}

void pw_linear_coordinates (const pw_linearisation *x, const double *dq, const double *dv, int stride, double *out) {
  for (int i = 0; i < x->positions; i++, out += stride) *out = linear_along (x, x->holonomic + i, dq);
  for (int i = 0; i < x->velocities; i++, out += stride) *out = linear_along (x, x->rank + i, dv) * x->r->w->scale.time;
}

void pw_linear_turn (const pw_linearisation *x, double w, const double *in, double *out) {
  for (int j = 0; j < 3 * x->r->s->bodies; j += 3) {
    out[j] -= w * in[j + 1];
    out[j + 1] += w * in[j];
  }
}

void pw_linear_rotate (const pw_linearisation *x, double angle, const double *in, double *out) {
  double c = pw_cos (angle), s = pw_sin (angle);
  memcpy (out, in, (size_t)x->n * sizeof *out);
  for (int j = 0; j < 3 * x->r->s->bodies; j += 3) {
    out[j] = c * in[j] - s * in[j + 1];
    out[j + 1] = s * in[j] + c * in[j + 1];
  }
}

static int linear_arrays (pw_linearisation *x) {
  size_t n = (size_t)x->n, m = (size_t)x->m, size = (size_t)x->size;
  x->memory = PW_ALLOC_ARRAYS (
      PW_ARRAY (x->a, n + 3), PW_ARRAY (x->lambda, m), PW_ARRAY (x->norm, m), PW_ARRAY (x->R, m * n),
      PW_ARRAY (x->Q, n * n), PW_ARRAY (x->dx, 2 * n), PW_ARRAY (x->product, n + 2 * m), PW_ARRAY (x->da, n + 3),
      PW_ARRAY (x->scratch, n + 3 * m + 3), PW_ARRAY (x->row_scratch, m), PW_ARRAY (x->symmetry, 3 * size),
      PW_ARRAY (x->later, 2 * n), PW_ARRAY (x->probe, 2 * n), PW_ARRAY (x->probe_a, n), PW_ARRAY (x->probe_da, n),
      PW_ARRAY (x->residual, 3 * (2 * m + n)), PW_ARRAY (x->left_vectors, x->modes ? size * size + size : 0),
      PW_ARRAY (x->upper_rows, 4 * size));
  return x->memory ? PW_OK : PW_RESOURCE;
}

int pw_linear_open (pw_linearisation *x, pw_run *r, pw_linear_extent extent) {
  *x = (pw_linearisation){ .r = r, .n = r->s->coords, .m = r->s->rows, .modes = extent == PW_LINEAR_MODES };
  int status = pw_tangent_open (&x->tangent, r);
  x->holonomic = x->tangent.holonomic, x->rank = x->tangent.rows, x->row = x->tangent.row;
  for (int j = 0; j < x->n; j++) x->unturned += pw_is_unturned (r->s, j);
  x->positions = r->s->mechanical - x->unturned - x->holonomic;
  x->velocities = x->n - x->unturned - x->rank;
  x->size = x->positions + x->velocities;
  if (status != PW_OK || extent == PW_LINEAR_COUNTS) return status;
  if (linear_arrays (x) != PW_OK) return PW_RESOURCE;
  const int states = 2 * x->n, rows = x->n + 2 * x->m;
  pw_scatter_begin_record (&x->tangent.scatter);
  linear_put (x, r->v);
  return pw_scatter_lay_out (&x->tangent.scatter, states > rows ? states : rows);
}

void pw_linear_close (pw_linearisation *x) {
  pw_tangent_close (&x->tangent);
  free (x->memory);
}

/* The co-moving frame.  In a frame with the origin r, the velocity u and the angular velocity w, a body at (x, y) with
 * the velocity v is at rest if v = u + w (-(y - r_y), x - r_x), and its acceleration is W v = w (-v_y, v_x, 0).  A
 * motion relative to the frame with constant velocity d is also steady if the equations do not depend on it: the spin
 * of a balanced rotor, bodies that drift apart.  In a rotating frame d rotates with it unless it belongs to an angle,
 * so W d counts as an acceleration. */

/* Residuals are dimensionless; accelerations in units of L / T^2, angles times L.
 *
 * LINEAR_STEADY: below it the linearisation changes by that fraction within the time scale T, less than the accuracy of
 * initial values with 6 digits.  LINEAR_EXACT: round-off of accelerations, for which a rotating frame must not be
 * chosen. */
static const double LINEAR_STEADY = 1e-6, LINEAR_EXACT = 1e-13,
                    LINEAR_ROUND_OFF = 1e-12; /* of singular values, relative to the largest one */
enum {
  LINEAR_IN_TURN = 8,      /* states compared in a turn of the frame */
  LINEAR_MOST_SPANS = 1000 /* the part of a turn that is sampled, in spans */
};

/* The unit of accelerations, L / T^2. */
static double linear_unit (const pw_linearisation *x) {
  const pw_scale *scale = &x->r->w->scale;
  return scale->length / (scale->time * scale->time);
}

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

/* Chooses a frame with small accelerations of the evaluated state; one that rotates only if it halves them. */
static void linear_choose_frame (pw_linearisation *x) {
  if (x->r->s->bodies == 0) return;
  x->frame = linear_frame_at (x, 0, 0);
  for (int b = 0; b < x->r->s->bodies && x->frame.residual > LINEAR_EXACT; b++) {
    pw_linear_frame f = linear_frame_at (x, b, x->r->v[3 * b + 2]);
    if (f.residual < x->frame.residual / 2) x->frame = f;
  }
  pw_linear_frame f = linear_fit (x);
  if (x->frame.residual > LINEAR_EXACT && f.residual < x->frame.residual / 2) x->frame = f;
}

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

int pw_null_space (int rows, int n, double *M, double tolerance, double *out) {
  double *work = malloc (((size_t)n * (size_t)n + 8 * (size_t)(rows + n)) * sizeof *work), *sigma = work,
         *VT = sigma + n;
  int count = 0;
  if (work == NULL) return PW_RESOURCE;
  if (LAPACKE_dgesvd_work (LAPACK_COL_MAJOR, 'N', 'A', rows, n, M, rows, sigma, NULL, 1, VT, n, VT + n * n,
                           8 * (rows + n) - n))
    count = PW_METHOD;
  tolerance = fmax (tolerance, LINEAR_ROUND_OFF * sigma[0]);
  while (count >= 0 && count < n && sigma[n - 1 - count] <= tolerance) {
    for (int j = 0; j < n; j++) out[count * n + j] = VT[j * n + n - 1 - count];
    count++;
  }
  free (work);
  return count;
}

/* The number of rigid displacements of the whole (x, y, phi) under which the equations are invariant to first order: of
 * the null space of the asymmetries.  x->symmetry becomes a basis of it.  A status < 0 if out of memory. */
static int linear_symmetries (pw_linearisation *x) {
  const int length = x->holonomic + x->rank + x->n;
  double null[9];
  if (x->r->s->bodies == 0) return 0;
  for (int k = 0; k < 3; k++) {
    linear_displace (x, k);
    pw_linear_coordinates (x, x->dx, x->dx + x->n, 1, x->symmetry + k * x->size);
    pw_linear_asymmetry (x, k == 2, x->residual + k * length);
  }
  for (int i = 0; i < 3 * length; i++)
    if (!isfinite (x->residual[i])) return 0;
  double most = 0, T = x->r->w->scale.time; /* most: the largest derivative of an acceleration */
  for (int i = x->positions; i < x->size; i++)
    for (int k = 0; k < x->size; k++) most = pw_larger_or_nan (most, fabs (x->A[i * x->size + k]) * T);
  const double tolerance = PW_LINEAR_SYMMETRIC + 1e-4 * PW_LINEAR_SYMMETRIC * most; /* of round-off */
  const int symmetries = pw_null_space (length, 3, x->residual, tolerance, null);
  for (int c = 0; c < x->size; c++) {
    double S[3] = { x->symmetry[c], x->symmetry[x->size + c], x->symmetry[2 * x->size + c] };
    for (int k = 0; k < symmetries; k++)
      x->symmetry[k * x->size + c] = null[3 * k] * S[0] + null[3 * k + 1] * S[1] + null[3 * k + 2] * S[2];
  }
  return symmetries == PW_METHOD ? 0 : symmetries;
}

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

/* Determines whether A is constant along the motion; see pw_linear.  Leaves the workspace at the current state.
 * Times are at irregular fractions of the span and of T, so that a periodic change is not sampled at its period. */
static pw_steadiness linear_steady (pw_linearisation *x) {
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

/* Inputs, states and mode shapes of a linearisation.
 *
 * A signal of a force changes the accelerations by the solution of the saddle-point system with the right-hand side
 * (f_u, 0); its column of the input matrix B is (0, T N_v^T da), with T and N_v as above.
 *
 * With the reflections Q that split off k rigid displacements, A = Q [ A11 A12 ; 0 A22 ] Q^T.  An eigenvector y2 of A22
 * for the eigenvalue mu has the rigid part y1 with  (A11 - mu) y1 = -A12 y2  and belongs to the mode Q (y1, y2). */

/* In units of 1/T: if an eigenvalue is closer than this to that of a rigid displacement, the rigid part of its mode is
 * not unique. */
static const double MODES_APART = 1e-6;

/* Fills B, column by column; NAN for signals of constraints. */
static void modes_inputs (pw_linearisation *x, double *B) {
  pw_workspace *w = x->r->w;
  int inputs = x->r->s->sources;
  for (int i = 0; i < x->r->s->limit_sources; i++, B++) /* none is reached, or there is no linearisation */
    for (int c = 0; c < x->size; c++) B[c * inputs] = 0;
  for (pw_element_batch *k = w->batch; k < w->batch + x->r->s->batches; k++) {
    const int signals = k->kind->signals, cols = k->b.cols;
    if (signals && k->kind->force_u) k->kind->force_u (&k->b, x->tangent.block);
    for (int i = 0; i < k->b.count * signals; i++, B++) {
      const int e = i / signals, u = i % signals;
      for (int c = 0; c < x->size; c++) B[c * inputs] = NAN;
      if (k->kind->force_u == NULL) continue;
      memset (x->dx, 0, 2 * (size_t)x->n * sizeof *x->dx);
      memset (x->da, 0, ((size_t)x->n + 3) * sizeof *x->da);
      memset (x->row_scratch, 0, (size_t)x->m * sizeof *x->row_scratch);
      for (int c = 0; c < cols; c++) x->da[pw_global (k, e, c)] += x->tangent.block[(e * cols + c) * signals + u];
      pw_saddle_solve (x->r->saddle, x->da, x->row_scratch, x->da, x->scratch);
      pw_linear_coordinates (x, x->dx, x->da, inputs, B);
    }
  }
}

/* Allocates B, basis and shape, and fills B and basis.  PW_OK or PW_RESOURCE. */
static int modes_matrices (pw_linearisation *x, pw_linear *l) {
  size_t size = (size_t)x->size, states = 2 * (size_t)x->n;
  l->B = malloc ((size * (size_t)x->r->s->sources + 1) * sizeof *l->B);
  l->basis = malloc ((size * states + 1) * sizeof *l->basis);
  l->shape = calloc (2 * size * states + 1, sizeof *l->shape);
  if (l->B == NULL || l->basis == NULL || l->shape == NULL) return PW_RESOURCE;
  modes_inputs (x, l->B);
  for (int c = 0; c < x->size; c++) {
    pw_linear_tangent (x, c);
    for (size_t j = 0; j < states; j++) l->basis[j * size + (size_t)c] = x->dx[j];
  }
  return PW_OK;
}

/* Sets the first k entries of y, y1, from the others, y2; 0 if they are not unique: if mu is about an eigenvalue of the
 * k rigid displacements, +- i w for two translations, 0 for any other one. */
static void modes_rigid_part (const pw_linearisation *x, int k, double complex mu, double complex *y) {
  double complex M[9];
  int pivot[3];
  double bound = MODES_APART / x->r->w->scale.time, w = x->frame.twist[2];
  for (int i = 0; i < k; i++) y[i] = 0;
  if (k == 0 || (k != 2 && cabs (mu) <= bound)) return;
  if (k >= 2 && (cabs (mu - I * w) <= bound || cabs (mu + I * w) <= bound)) return;
  for (int i = 0; i < k; i++)
    for (int c = 0; c < x->size; c++)
      if (c < k)
        M[c * k + i] = x->upper_rows[i * x->size + c] - (c == i ? mu : 0);
      else
        y[i] -= x->upper_rows[i * x->size + c] * y[c];
  LAPACKE_zgesv_work (LAPACK_COL_MAJOR, k, 1, M, k, pivot, y, k);
}

/* Transforms y to minimal coordinates by the reflections in x->symmetry. */
static void modes_reflect (pw_linearisation *x, int k, double complex *y) {
  double work[1], *part = x->upper_rows + 3 * (size_t)x->size; /* size */
  for (int imaginary = 0; k > 0 && imaginary < 2; imaginary++) {
    for (int i = 0; i < x->size; i++) part[i] = imaginary ? cimag (y[i]) : creal (y[i]);
    LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'L', 'N', x->size, 1, k, x->symmetry, x->size, x->tau, part, x->size, work,
                         1);
    for (int i = 0; i < x->size; i++) y[i] = imaginary ? creal (y[i]) + I * part[i] : part[i] + I * cimag (y[i]);
  }
}

/* Scales a shape so that its largest position, angles times L, is 1 m; velocities count if all positions are 0. */
static void modes_scale (const pw_linearisation *x, double complex *shape) {
  double complex most = 0;
  for (int part = 0; part < 2 && cabs (most) <= 0; part++)
    for (int j = 0; j < x->n; j++) {
      double complex value = shape[part * x->n + j] * pw_length_factor (x->r->s, j) * (part ? x->r->w->scale.time : 1);
      if (cabs (value) > cabs (most) * (1 + 1e-9)) most = value;
    }
  for (int j = 0; cabs (most) > 0 && j < 2 * x->n; j++) shape[j] /= most;
}

/* Fills the shapes after k rigid displacements have been split off; eigenvalues are not yet sorted.  Of an eigenvector
 * of A22 LAPACK has computed the conjugate, a left eigenvector of A22^T, since A22 is stored by rows. */
static int modes_shapes (pw_linearisation *x, int k, pw_linear *l) {
  int size = x->size, states = 2 * x->n, n = size - k;
  double complex *y = malloc (((size_t)size + 1) * sizeof *y);
  if (y == NULL) return PW_RESOURCE;
  for (int i = k; i < size; i++) {
    if (l->re[i] == 0 && l->im[i] == 0) continue;
    double complex *shape = (double complex *)l->shape + (size_t)i * (size_t)states;
    const double im = x->left_vectors[n * n + i - k], *re = x->left_vectors + (im < 0 ? i - k - 1 : i - k) * n;
    for (int j = 0; j < n; j++) y[k + j] = im == 0 ? re[j] : re[j] - I * (im > 0 ? re[n + j] : -re[n + j]);
    modes_rigid_part (x, k, l->re[i] + I * l->im[i], y);
    modes_reflect (x, k, y);
    for (int j = 0; j < states; j++)
      for (int c = 0; c < size; c++) shape[j] += l->basis[(size_t)j * (size_t)size + (size_t)c] * y[c];
    modes_scale (x, shape);
  }
  free (y);
  return PW_OK;
}

/* EIGEN_ROUND_OFF: size of the perturbations that estimate the uncertainty of eigenvalues, relative to the largest
 * entry of each row; then, after balancing, of the matrix: a hundred times round-off, lost in derivatives and QR
 * algorithm.  EIGEN_CERTAIN: a real or imaginary part is kept if it exceeds this multiple of the eigenvalue's shift. */
static const double EIGEN_ROUND_OFF = 100 * DBL_EPSILON, EIGEN_CERTAIN = 10;

/* The n eigenvalues of A, stored by rows (destroyed), conjugate pairs adjacent, im > 0 first, and the left eigenvectors
 * of A^T unless `left` is NULL; `work` has 4 n entries. */
static int eigen_values (int n, double *A, double *re, double *im, double *left, double *work) {
  for (int i = 0; i < n * n; i++)
    if (!isfinite (A[i])) return PW_RETRY;
  int failed = n && LAPACKE_dgeev_work (LAPACK_COL_MAJOR, left ? 'V' : 'N', 'N', n, A, n, re, im, left, left ? n : 1,
                                        NULL, 1, work, 4 * n);
  return failed ? PW_RETRY : PW_OK;
}

/* Perturbs each row of B by up to EIGEN_ROUND_OFF times its largest entry, or times `least` if that is larger. */
static void eigen_perturb (int n, double least, double *B) {
  for (int i = 0; i < n; i++, B += n) {
    double most = least;
    for (int k = 0; k < n; k++) most = fmax (most, fabs (B[k]));
    for (int k = 0; k < n; k++) B[k] += EIGEN_ROUND_OFF * most * pw_irregular (1.7, i * n + k + 1);
  }
}

/* The shift of each eigenvalue by the perturbation: the distance to the nearest one of the perturbed matrix (re2, im2);
 * with moduli in ascending order, the difference to the modulus of the same rank if that is larger, since the nearest
 * one is not meaningful among many defective ones; at least `least`.  re2 becomes the sorted moduli. */
static void eigen_shift (int n, const double *re, const double *im, double *re2, const double *im2, double least,
                         double *shift) {
  for (int i = 0; i < n; i++) {
    shift[i] = INFINITY;
    for (int k = 0; k < n; k++) shift[i] = fmin (shift[i], hypot (re[i] - re2[k], im[i] - im2[k]));
    shift[i] = fmax (shift[i], least);
  }
  for (int k = 0; k < n; k++) re2[k] = hypot (re2[k], im2[k]);
  LAPACKE_dlasrt_work ('I', n, re2);
  for (int i = 0; i < n; i++) {
    double size = hypot (re[i], im[i]);
    int rank = 0;
    for (int k = 0; k < n; k++) rank += hypot (re[k], im[k]) < size || (hypot (re[k], im[k]) == size && k < i);
    shift[i] = fmax (shift[i], fabs (size - re2[rank]));
  }
}

/* The eigenvalues of B; those of the perturbed matrix give their uncertainty.  B has room for 2 n^2 + 7 n entries. */
static int eigen_certain (const pw_linearisation *x, int n, double *B, double *re, double *im) {
  int cells = n * n, unused, also_unused;
  double *perturbed = B + cells, *re2 = perturbed + cells, *im2 = re2 + n, *shift = im2 + n, *work = shift + n;
  double most = 1 / x->r->w->scale.time; /* so that rows of zeros are perturbed, too */
  memcpy (perturbed, B, (size_t)cells * sizeof *B);
  if (eigen_values (n, B, re, im, x->modes ? x->left_vectors : NULL, work) != PW_OK) return PW_RETRY;
  if (x->modes) memcpy (x->left_vectors + cells, im, (size_t)n * sizeof *im);
  eigen_perturb (n, most, perturbed);
  if (n) LAPACKE_dgebal_work (LAPACK_COL_MAJOR, 'S', n, perturbed, n, &unused, &also_unused, work);
  for (int i = 0; i < cells; i++) most = fmax (most, fabs (perturbed[i]));
  eigen_perturb (n, most, perturbed);
  if (eigen_values (n, perturbed, re2, im2, NULL, work) != PW_OK) return PW_RETRY;
  eigen_shift (n, re, im, re2, im2, EIGEN_ROUND_OFF * most, shift);
  for (int i = 0, pair; i < n; i += 1 + pair) { /* uncertain parts become 0, the same for both eigenvalues of a pair */
    pair = im[i] > 0;
    double uncertain = EIGEN_CERTAIN * fmax (shift[i], shift[i + pair]);
    for (int k = i; k <= i + pair; k++) {
      if (!(fabs (re[k]) > uncertain)) re[k] = 0;
      if (!(fabs (im[k]) > uncertain)) im[k] = 0;
    }
  }
  return PW_OK;
}

/* Whether i comes before k: larger real part first, then larger frequency, then im > 0. */
static int eigen_before (const pw_linear *l, int i, int k) {
  if (l->re[i] != l->re[k]) return l->re[i] > l->re[k];
  if (fabs (l->im[i]) != fabs (l->im[k])) return fabs (l->im[i]) > fabs (l->im[k]);
  return l->im[i] > l->im[k];
}

/* Exchanges `length` numbers with those before them. */
static void eigen_swap (double *x, int length) {
  for (int k = 0; k < length; k++) {
    double kept = x[k];
    x[k] = x[k - length], x[k - length] = kept;
  }
}

static void eigen_sort (pw_linear *l) {
  const int length = 4 * l->coordinates; /* of a shape */
  for (int i = 1; i < l->unknowns; i++)
    for (int j = i; j > 0 && eigen_before (l, j, j - 1); j--) {
      unsigned char rigid = l->rigid[j];
      l->rigid[j] = l->rigid[j - 1], l->rigid[j - 1] = rigid;
      eigen_swap (l->re + j, 1);
      eigen_swap (l->im + j, 1);
      if (l->shape) eigen_swap (l->shape + (size_t)j * (size_t)length, length);
    }
}

/* Transforms B, stored by rows, by reflections, left in x->symmetry, that map the span of its first k vectors to that
 * of the first k unit vectors.  Returns 1 if the span is invariant: the lower left block is then 0. */
static int eigen_split (pw_linearisation *x, int k, double *B) {
  int n = x->size;
  double off = 0, *tau = x->tau, *work = x->dx; /* at least n */
  if (k == 0 || k > n) return k == 0;
  double size = LAPACKE_dlange_work (LAPACK_COL_MAJOR, 'F', n, n, B, n, work);
  LAPACKE_dgeqrf_work (LAPACK_COL_MAJOR, n, k, x->symmetry, n, tau, work, n);
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'L', 'T', n, n, k, x->symmetry, n, tau, B, n, work, n);
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'R', 'N', n, n, k, x->symmetry, n, tau, B, n, work, n);
  for (int i = k; i < n; i++)
    for (int c = 0; c < k; c++) off = pw_larger_or_nan (off, fabs (B[i * n + c]));
  return off <= PW_LINEAR_SYMMETRIC * size;
}

/* Fills re, im and rigid, sorted, and with modes the shapes.  Rigid displacements of the whole are split off, an
 * invariant subspace with known eigenvalues (in a rotating frame a displaced motion rotates at -w), so that they do not
 * cause defective zeros; if that fails, l->symmetries becomes 0.  Errors: PW_METHOD, PW_RESOURCE. */
static int eigen_all (pw_linearisation *x, pw_linear *l, pw_error *error) {
  int n = l->unknowns, k = l->symmetries;
  size_t cells = (size_t)n * (size_t)n;
  double *B = malloc ((2 * cells + 7 * (size_t)n + 1) * sizeof *B);
  if (B == NULL) return PW_RESOURCE;
  memcpy (B, x->A, cells * sizeof *B);
  if (!eigen_split (x, k, B)) {
    memcpy (B, x->A, cells * sizeof *B);
    k = l->symmetries = 0;
  }
  memcpy (x->upper_rows, B, (size_t)(k * n) * sizeof *B);
  for (int i = k; k > 0 && i < n; i++)
    memmove (B + (size_t)(i - k) * (size_t)(n - k), B + (size_t)i * (size_t)n + k, (size_t)(n - k) * sizeof *B);
  memset (l->rigid, 1, (size_t)k);
  if (k >= 2) l->im[0] = fabs (l->twist[2]), l->im[1] = 0 - l->im[0]; /* translations; 0 - 0 is not -0 */
  int status = eigen_certain (x, n - k, B, l->re + k, l->im + k);
  free (B);
  if (status == PW_OK && x->modes) status = modes_shapes (x, k, l);
  if (status == PW_RESOURCE) return status;
  eigen_sort (l);
  if (status == PW_OK) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: the eigenvalues of the linearisation cannot be computed", x->r->t);
}

/* |1 + z + z^2/2 + z^3/6 + z^4/24| <= 1, z = h (re + i im): a region within |z| < 4 (Hairer & Wanner 1996, section
 * IV.2).  For a growing solution only its frequency counts. */
static int rk4_stable (double re, double im, double h) {
  double x = h * fmin (re, 0), y = h * im, u = 1, v = 0;
  for (int k = 4; k > 0; k--) { /* u + i v = 1 + z (u + i v) / k */
    double real = x * u - y * v;
    v = (x * v + y * u) / k;
    u = 1 + real / k;
  }
  return hypot (u, v) <= 1 + 1e-12;
}

double pw_rk4_limit (double re, double im) {
  double size = hypot (fmin (re, 0), im), low = 0, high = 0;
  if (!(size > DBL_MIN)) return INFINITY; /* or a number that overflows */
  while (rk4_stable (re, im, high) && high * size < 4) low = high, high += 0.01 / size;
  for (int i = 0; i < 50; i++) {
    double middle = (low + high) / 2;
    *(rk4_stable (re, im, middle) ? &low : &high) = middle;
  }
  return low;
}

/* In units of the scene: two changes of a state, and the least change of the accelerations that counts as a jump. */
static const double LINEAR_FAR = 1e-6, LINEAR_NEAR = 1e-8, LINEAR_JUMP = 1e-6;

/* The change of the accelerations, in units of the scene, if state j changes by `part` of its unit; DBL_MAX if they
 * cannot be computed then.  Leaves the workspace at the changed state. */
static double linear_change (pw_linearisation *x, int j, double part) {
  pw_run *r = x->r;
  int n = x->n;
  double T = r->w->scale.time, most = 0, *q = x->dx, *v = q + n, *lambda = x->scratch;
  memcpy (q, r->q, (size_t)n * sizeof *q);
  memcpy (v, r->v, (size_t)n * sizeof *v);
  *(j < n ? q + j : v + j - n) += part * pw_unit (r->s, j % n) / (j < n ? 1 : T);
  if (pw_run_accelerate (r, r->t, q, v, x->da, lambda) != PW_OK) return DBL_MAX;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (x->da[i] - x->a[i]) * T * T / pw_unit (r->s, i));
  return most;
}

/* The first state with which accelerations jump: if it changes less, they change as much.  -1: none. */
static int linear_jump (pw_linearisation *x) {
  if (!pw_system_may_jump (x->r->s)) return -1;
  for (int j = 0; j < 2 * x->n; j++)
    for (int side = -1; side <= 1; side += 2) {
      double change = linear_change (x, j, side * LINEAR_FAR);
      if (change > LINEAR_JUMP && linear_change (x, j, side * LINEAR_NEAR) > change / 2) return j;
    }
  return -1;
}

static int linear_results (pw_linearisation *x, pw_linear *l) {
  size_t size = (size_t)x->size;
  x->A = l->A = malloc ((size * size + 1) * sizeof *l->A);
  l->re = calloc (2 * size + 1, sizeof *l->re);
  l->rigid = calloc (size + 1, 1);
  if (l->A == NULL || l->re == NULL || l->rigid == NULL) return PW_RESOURCE;
  l->im = l->re + size;
  return PW_OK;
}

/* Computes all but the counts.  Leaves the workspace at the current state. */
static int linear_compute (pw_linearisation *x, pw_linear *l, pw_error *error) {
  pw_run *r = x->r;
  int status = pw_linear_evaluate (x, r->t, r->q, r->v);
  if (status != PW_OK)
    return status > 0 ? pw_fail_singular (r, r->t, error)
                      : pw_run_annotate_error (r, pw_fail_signal (r->t, error), error);
  status = pw_events_check_modes (r, r->v, x->lambda, error);
  if (status != PW_OK) return status;
  linear_independent_rows (x); /* l->least: their smallest singular value, NaN if there are none, or LAPACK failed */
  if (x->rank && LAPACKE_dgesvj_work (LAPACK_COL_MAJOR, 'G', 'N', 'N', x->n, x->rank, linear_column (x, 0), x->n,
                                      x->row_scratch, 0, NULL, 1, x->scratch, x->n + x->m + 3) == 0)
    for (int k = 0; k < x->rank; k++) l->least = fmin (l->least, x->scratch[0] * x->row_scratch[k]);
  pw_linear_bases (x);
  int jump = linear_jump (x);
  if (pw_system_may_jump (r->s)) (void)pw_linear_evaluate (x, r->t, r->q, r->v);
  if (jump >= 0)
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: accelerations jump with %s at this state, or fail beside it: it has no linearisation",
                    r->t, PW_NAME (pw_system_state_name, r->s, jump));
  linear_choose_frame (x);
  if (linear_results (x, l) != PW_OK) return PW_RESOURCE;
  double *dq = x->dx, *dv = dq + x->n, w = x->frame.twist[2];
  for (int c = 0; c < x->size; c++) { /* z' and u' for a variation along minimal coordinate c */
    pw_linear_tangent (x, c);
    pw_linear_vary (x);
    pw_linear_turn (x, -w, dv, x->da); /* da becomes da - W dv, */
    pw_linear_turn (x, -w, dq, dv);    /* then dv becomes dv - W dq */
    pw_linear_coordinates (x, dv, x->da, x->size, x->A + c);
  }
  if (x->modes && modes_matrices (x, l) != PW_OK) return PW_RESOURCE;
  if ((l->symmetries = linear_symmetries (x)) < 0) return PW_RESOURCE;
  memcpy (l->twist, x->frame.twist, sizeof l->twist);
  l->acceleration = x->frame.acceleration;
  status = eigen_all (x, l, error);
  if (status == PW_OK) l->steady = linear_steady (x);
  return status;
}

/* With more than `most` coordinates only the counts. */
static int linear_run (pw_run *r, int most, pw_linear_extent extent, pw_linear *l, pw_error *error) {
  pw_linearisation x;
  *l = (pw_linear){ .least = NAN };
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (r->s->coords > most) extent = PW_LINEAR_COUNTS;
  pw_statistics before = r->statistics;
  int near_singular = r->near_singular, status = pw_linear_open (&x, r, extent);
  l->coordinates = x.n, l->rank = x.rank;
  l->positions = x.positions, l->velocities = x.velocities, l->unknowns = x.size;
  if (status == PW_OK && extent > PW_LINEAR_COUNTS)
    status = pw_run_check_derivatives (r, "the linearisation", "needs", error);
  if (status == PW_OK && extent > PW_LINEAR_COUNTS) status = linear_compute (&x, l, error);
  pw_linear_close (&x);
  if (status != PW_OK) pw_linear_free (l); /* eigenvalues that fail leave A */
  r->statistics = before;
  r->near_singular = near_singular;
  return status == PW_RESOURCE ? pw_fail_memory (r->s, error) : status;
}

int pw_run_linearise (pw_run *r, int most, pw_linear *l, pw_error *error) {
  return linear_run (r, most, PW_LINEAR_BASES, l, error);
}

int pw_run_linear_modes (pw_run *r, int most, pw_linear *l, pw_error *error) {
  return linear_run (r, most, PW_LINEAR_MODES, l, error);
}

void pw_linear_free (pw_linear *l) {
  free (l->B);
  free (l->basis);
  free (l->shape);
  free (l->A);
  free (l->re);
  free (l->rigid);
  l->A = l->re = l->im = l->B = l->basis = l->shape = NULL;
  l->rigid = NULL;
}
