/* Symmetries of a system: displacements under which its equations are invariant, by a rank decision like that of
 * linear_frame.c at a state in general position.  Besides displacements of the whole these are changes of angles on
 * which nothing depends, such as that of a wheel that rolls. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rank.h"
#include "steady_parts.h"
#include "util.h"

/* Several states, since a body alone has more displacements than equations. */
enum { GROUP_STATES = 2 };

/* GROUP_APART: distance of the states from the initial one, in units of the scene, in irregular directions.
 * GROUP_ROUND: round-off of derivatives.  GROUP_PIVOT, GROUP_ZERO: smallest pivots and entries of rates. */
static const double GROUP_APART = 0.02, GROUP_ROUND = 1e-12, GROUP_PIVOT = 1e-6, GROUP_ZERO = 1e-7;

void pw_steady_combine (const pw_steady *x, const double *part, double unit, double *rates) {
  int count = pw_steady_rates (x->s);
  memset (rates, 0, (size_t)count * sizeof *rates);
  for (int k = 0; k < x->group; k++)
    for (int c = 0; c < count; c++) rates[c] += part[k] / unit * x->axis[k * count + c];
}

void pw_steady_field (const pw_steady *x, const double *rates, const double *q, double *v) {
  int bodies = 3 * x->s->bodies;
  for (int j = 0; j < bodies; j += 3) {
    v[j] = x->L * rates[0] - rates[2] * (q[j + 1] - x->origin[1]);
    v[j + 1] = x->L * rates[1] + rates[2] * (q[j] - x->origin[0]);
    v[j + 2] = rates[2] + rates[3 + j / 3];
  }
  for (int j = bodies; j < x->n; j++) v[j] = rates[3 + x->s->bodies + j - bodies];
}

/* The change of the equations by displacement c, in units of the scene: a column. */
static void group_change (pw_steady *x, int c, double *rates, double *out) {
  pw_linearisation *l = &x->at[0].x;
  memset (rates, 0, (size_t)pw_steady_rates (x->s) * sizeof *rates);
  rates[c] = 1;
  memset (l->dx, 0, 2 * (size_t)x->n * sizeof *l->dx);
  pw_steady_field (x, rates, x->q, l->dx);
  if (c == 2) pw_linear_turn (l, 1, x->v, l->dx + x->n);
  pw_linear_asymmetry (l, c == 2, out);
}

/* The largest change of an acceleration by a single coordinate. */
static double group_size (pw_steady *x) {
  pw_linearisation *l = &x->at[0].x;
  double most = 0;
  for (int c = 0; c < x->n; c++) {
    memset (l->dx, 0, 2 * (size_t)x->n * sizeof *l->dx);
    l->dx[c] = pw_unit (x->s, c);
    pw_linear_vary (l);
    for (int j = 0; j < x->n; j++)
      most = pw_larger_or_nan (most, fabs (l->da[j]) * pw_length_factor (x->s, j) * x->T * x->T / x->L);
  }
  return most;
}

/* Reduced row echelon form of `rows` independent rows of length n, with pivots first in the angles of single bodies, so
 * that these stand alone. */
static void group_reduce (int rows, int n, double *row) {
  for (int i = 0, c = n - 1; i < rows && c >= 0; c--) {
    int best = i;
    for (int k = i; k < rows; k++)
      if (fabs (row[k * n + c]) > fabs (row[best * n + c])) best = k;
    double pivot = row[best * n + c];
    if (fabs (pivot) < GROUP_PIVOT) continue;
    for (int j = 0; j < n; j++) {
      double kept = row[best * n + j];
      row[best * n + j] = row[i * n + j];
      row[i * n + j] = kept / pivot;
    }
    for (int k = 0; k < rows; k++) {
      double factor = row[k * n + c];
      for (int j = 0; k != i && j < n; j++) row[k * n + j] -= factor * row[i * n + j];
    }
    i++;
  }
  for (int k = 0; k < rows * n; k++)
    if (fabs (row[k]) < GROUP_ZERO) row[k] = 0;
}

int pw_steady_null (int rows, int n, double *M, double tolerance, double *out) {
  double *work = malloc (((size_t)n * (size_t)n + 8 * (size_t)(rows + n)) * sizeof *work), *sigma = work,
         *V = sigma + n;
  int left = 0;
  if (work == NULL) return PW_RESOURCE;
  if (LAPACKE_dgesvd_work (LAPACK_COL_MAJOR, 'N', 'A', rows, n, M, rows, sigma, NULL, 1, V, n, V + n * n,
                           8 * (rows + n) - n))
    left = PW_METHOD;
  tolerance = fmax (tolerance, GROUP_ROUND * sigma[0]);
  while (left >= 0 && left < n && sigma[n - 1 - left] <= tolerance) {
    for (int j = 0; j < n; j++) out[left * n + j] = V[j * n + n - 1 - left];
    left++;
  }
  free (work);
  return left;
}

/* State `number` near the initial one, in general position on the constraints: off them residuals rotate with the whole. */
static int group_place (pw_steady *x, double apart, int number) {
  pw_run *r = x->at[0].r;
  pw_projector p;
  for (int j = 0; j < x->n; j++) {
    x->q[j] = r->q[j] + apart * pw_unit (x->s, j) * pw_irregular (1.7 + number, j + 1);
    x->v[j] = r->v[j] + apart * pw_unit (x->s, j) / x->T * pw_irregular (2.9 + number, j + 1);
  }
  if (pw_projector_open (&p, r, x->s->metric, x->s->metric, &x->why) != PW_OK) return PW_RESOURCE;
  int status = pw_project_positions (&p, r, x->set.t, x->q, x->v);
  if (status == PW_OK) status = pw_project_velocities (&p, r, x->v);
  pw_projector_close (&p);
  if (status == PW_OK) status = pw_linear_evaluate (&x->at[0].x, x->set.t, x->q, x->v);
  if (status == PW_OK) pw_rank_rows (r->w, x->at[0].x.R, x->at[0].x.norm);
  return status;
}

/* Removes combinations that displace nothing, such as a rotation of the whole about the centre of a pinned disc less one of
 * its angle: no symmetries.  x->q is in general position. */
static int group_effective (pw_steady *x, int rates) {
  int n = x->n + 3, group = x->group; /* at least as many rows as columns */
  double *F = calloc ((size_t)(n + group + rates) * (size_t)group + 1, sizeof *F), *c = F + n * group,
         *w = c + group * group;
  if (F == NULL) return PW_RESOURCE;
  for (int k = 0; k < group; k++) {
    pw_steady_field (x, x->axis + k * rates, x->q, F + k * n);
    for (int j = 0; j < x->n; j++) F[k * n + j] /= pw_unit (x->s, j);
  }
  int idle = group ? pw_steady_null (n, group, F, 1e-9, c) : 0;
  for (int i = 0; i < idle * group; i++)
    for (int j = 0; j < rates; j++) w[i / group * rates + j] += c[i] * x->axis[i % group * rates + j];
  group_reduce (idle, rates, w);
  for (int i = 0; i < idle; i++) {
    int last = rates - 1;
    while (last > 0 && w[i * rates + last] == 0) last--;
    for (int k = 0; k < group; k++) {
      double factor = x->axis[k * rates + last];
      for (int j = 0; j < rates; j++) x->axis[k * rates + j] -= factor * w[i * rates + j];
    }
  }
  free (F);
  return idle;
}

/* The coordinate whose change rate c > 2 is. */
static int group_coordinate (const pw_steady *x, int c) {
  return c < 3 + x->s->bodies ? 3 * (c - 3) + 2 : 2 * x->s->bodies + c - 3;
}

/* Finds the angles that are symmetries by themselves. */
static void group_find_cyclic (pw_steady *x) {
  int rates = pw_steady_rates (x->s);
  for (int k = 0; k < x->group; k++) {
    int last = 0, count = 0;
    for (int c = 0; c < rates; c++)
      if (x->axis[k * rates + c] != 0) last = c, count++;
    if (count == 1 && last > 2) x->cyclic[group_coordinate (x, last)] = 1;
  }
}

int pw_steady_find_group (pw_steady *x) {
  pw_linearisation *l = &x->at[0].x;
  int rates = pw_steady_rates (x->s), length = l->holonomic + l->rank + x->n, rows = GROUP_STATES * (length + 3);
  int status = PW_OK;
  double *M = calloc ((size_t)rows * (size_t)rates + (size_t)rates, sizeof *M), size = 0;
  if (M == NULL) return PW_RESOURCE;
  for (int k = 0; k < GROUP_STATES && status == PW_OK; k++) {
    status = group_place (x, GROUP_APART, k);
    if (status == PW_RETRY) status = group_place (x, GROUP_APART / 100, k);
    for (int c = 0; c < rates && status == PW_OK; c++)
      group_change (x, c, M + rows * rates, M + c * rows + k * (length + 3));
    if (status == PW_OK) size = fmax (size, group_size (x));
  }
  double tolerance = PW_LINEAR_SYMMETRIC * (1 + 1e-4 * size);
  if (status == PW_OK) x->group = x->s->bodies ? pw_steady_null (rows, rates, M, tolerance, x->axis) : 0;
  free (M);
  if (status != PW_OK || x->group < 0) return status != PW_OK ? status : x->group;
  int idle = group_effective (x, rates);
  if (idle < 0) return idle;
  group_reduce (x->group, rates, x->axis);
  x->group -= idle;
  group_find_cyclic (x);
  return PW_OK;
}

int pw_steady_find_gauge (pw_steady *x) {
  int group = x->group, holds = x->set.holds, rows = holds > group ? holds : group;
  double *M = calloc ((size_t)rows * (size_t)group + 1, sizeof *M);
  if (M == NULL) return PW_RESOURCE;
  for (int k = 0; k < group; k++) {
    const double *axis = x->axis + k * pw_steady_rates (x->s);
    pw_steady_field (x, axis, x->q, x->dq);
    memset (x->dv, 0, (size_t)x->n * sizeof *x->dv);
    pw_linear_turn (&x->at[0].x, axis[2], x->v, x->dv);
    for (int i = 0; i < holds; i++)
      M[k * rows + i] = pw_hold_change (x->s, x->hold + i, x->q, x->v, x->dq, x->dv) / pw_hold_unit (x, x->hold + i);
  }
  x->gauge = group ? pw_steady_null (rows, group, M, 1e-9, x->fixed) : 0;
  free (M);
  return x->gauge < 0 ? x->gauge : PW_OK;
}

/* ---- Comparison ---- */

/* Rotates positions and velocities by an angle about a point. */
static void group_rotate (const pw_steady *x, double angle, const double *about, double *q, double *v) {
  double c = pw_cos (angle), s = pw_sin (angle), centre[2] = { about[0], about[1] };
  for (int j = 0; j < 3 * x->s->bodies; j += 3) {
    double dx = q[j] - centre[0], dy = q[j + 1] - centre[1], vx = v[j], vy = v[j + 1];
    q[j] = centre[0] + c * dx - s * dy, q[j + 1] = centre[1] + s * dx + c * dy, q[j + 2] += angle;
    v[j] = c * vx - s * vy, v[j + 1] = s * vx + c * vy;
  }
}

/* The angle of the whole: that of the first body on whose angle something depends; if there is none, of the line from
 * the centre to the last body. */
static double group_angle (const pw_steady *x, const double centre[2], const double *q) {
  int last = 3 * (x->s->bodies - 1);
  for (int b = 0; b < x->s->bodies; b++)
    if (!x->cyclic[3 * b + 2]) return q[3 * b + 2];
  return atan2 (q[last + 1] - centre[1], q[last] - centre[0]);
}

/* Spins first. */
void pw_steady_canonical (const pw_steady *x, double *q, double *v) {
  int rates = pw_steady_rates (x->s);
  for (int k = 0; k < x->group; k++) {
    const double *axis = x->axis + k * rates;
    int c = rates - 1;
    while (c > 2 && axis[c] == 0) c--;
    if (c > 2 && axis[0] == 0 && axis[1] == 0 && axis[2] == 0) {
      double by = -q[group_coordinate (x, c)] / axis[c];
      for (int b = 0; b < x->s->bodies; b++) q[3 * b + 2] += by * axis[3 + b];
      for (int j = 3 * x->s->bodies; j < x->n; j++) q[j] += by * axis[3 - 2 * x->s->bodies + j];
    }
    if (axis[2] == 0) continue;
    double centre[2] = { x->origin[0] - x->L * axis[1] / axis[2], x->origin[1] + x->L * axis[0] / axis[2] };
    group_rotate (x, -group_angle (x, centre, q), centre, q, v);
  }
  for (int k = 0; k < x->group; k++) {
    const double *axis = x->axis + k * rates;
    double square = axis[0] * axis[0] + axis[1] * axis[1];
    if (axis[2] != 0 || !(square > 0)) continue;
    double by = (axis[0] * q[0] + axis[1] * q[1]) / square;
    for (int j = 0; j < 3 * x->s->bodies; j += 3) q[j] -= by * axis[0], q[j + 1] -= by * axis[1];
  }
}

void pw_steady_home (const pw_steady *x, double *q, double *v) {
  int whole = 0;
  for (int k = 0; k < x->group; k++) {
    const double *axis = x->axis + k * pw_steady_rates (x->s);
    whole += axis[0] != 0 || axis[1] != 0 || axis[2] != 0;
  }
  if (x->gauge < x->group || whole < 3) return;
  double dx = x->start[0] - q[0], dy = x->start[1] - q[1];
  group_rotate (x, x->start[2] - q[2], q, q, v);
  for (int j = 0; j < 3 * x->s->bodies; j += 3) q[j] += dx, q[j + 1] += dy;
}

double pw_steady_distance (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2) {
  size_t bytes = (size_t)x->n * sizeof *q1;
  double *a = x->q0, *va = x->v0, *b = x->dq, *vb = x->dv, most = 0;
  memcpy (a, q1, bytes), memcpy (va, v1, bytes), memcpy (b, q2, bytes), memcpy (vb, v2, bytes);
  pw_steady_canonical (x, a, va);
  pw_steady_canonical (x, b, vb);
  for (int j = 0; j < x->n; j++) {
    double unit = pw_unit (x->s, j), off = (a[j] - b[j]) / unit, size = fmax (1, fabs (b[j] / unit));
    if (j < 3 * x->s->bodies && j % 3 == 2) off = remainder (off, 2 * PW_PI), size = 1;
    if (!x->cyclic[j]) most = pw_larger_or_nan (most, fabs (off) / size);
    off = (va[j] - vb[j]) / unit * x->T;
    most = pw_larger_or_nan (most, fabs (off) / fmax (1, fabs (vb[j] / unit * x->T)));
  }
  return most;
}

/* The tolerance is the root of STEADY_EXACT, with a margin: so far solutions can be from an exact double root. */
int pw_steady_same (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2) {
  return pw_steady_distance (x, q1, v1, q2, v2) <= 1e-4;
}
