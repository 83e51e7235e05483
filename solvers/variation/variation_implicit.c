/* Implicit steps of the derivatives, for stiff motions, by the Radau IIA method of order 5 with the coefficients a_ij,
 * c_i (Hairer & Wanner 1996, Solving Ordinary Differential Equations II, section IV.8).
 *
 * Stages are projected onto the linearised constraints (projected collocation, Ascher & Petzold 1991).  At the state
 * of the run at t_i = t + c_i h let p_i be the solution of these nearest to 0, N_i the tangent vectors of the minimal
 * coordinates (linear_variation.c), and N_i^+ a left inverse of N_i.  With Y at t, the stages satisfy
 *
 *     Y_i = p_i + N_i z_i,   N_i^+ (Y_i - Y - h sum_j a_ij F_j) = 0,   F_j = F_j (p_j) + A_j z_j,
 *
 * where F_j is the time derivative of Y_j, an affine function of z_j with the matrix A_j: linear equations for the z_i
 * of all columns.  The last stage is Y at the end of the step.  The error estimate, of order h^4,
 *
 *     err = N_3 (gamma/h - N_3^+ A_3)^-1 N_3^+ (F + sum_i e_i (Y_i - Y)/h),
 *
 * has gamma, the real eigenvalue of the inverse of (a_ij), and e_i from there.  With r = |err|/|Y|, (10 r)^(3/2) is
 * about the error of the method, of order h^6 (step_scale_error in variation_step.c), as in RADAU5. */
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>
#include "radau_coefficients.h"
#include "rank.h"
#include "util.h"
#include "variation_parts.h"

/* At stage i, F_i is in K[RATE + i], Y_i in K[STATE + i]; F at the beginning of the step is in K[0]. */
enum { STAGES = PW_VARIATION_STAGES, RATE = 1, STATE = RATE + STAGES };

struct pw_variation_implicit {
  int size;          /* number of minimal coordinates */
  double *N[STAGES]; /* size x 2n: N_i, a row for each coordinate */
  double *A[STAGES]; /* size x 2n: A_i */
  double *D[STAGES]; /* size x n: N_i^+; of dq for coordinates of position, of dv for those of velocity */
  double *matrix;    /* 3 size x 3 size, by columns */
  double *filter;    /* size x size, by columns: gamma/h - N_3^+ A_3 */
  double *z;         /* 3 size for each column: z_i of all stages */
  lapack_int *pivot; /* 3 size of `matrix`, then size of `filter` */
  char *memory;
};

pw_variation_implicit *pw_variation_implicit_open (const pw_variation *x) {
  pw_variation_implicit *p = calloc (1, sizeof *p);
  size_t size = (size_t)x->linear.size, rows = STAGES * size, vectors = 2 * size * (size_t)x->n;
  if (p == NULL) return NULL;
  p->size = x->linear.size;
  const pw_array array[] = { { &p->N[0], vectors },       { &p->N[1], vectors },
                             { &p->N[2], vectors },       { &p->A[0], vectors },
                             { &p->A[1], vectors },       { &p->A[2], vectors },
                             { &p->D[0], vectors / 2 },   { &p->D[1], vectors / 2 },
                             { &p->D[2], vectors / 2 },   { &p->matrix, rows * rows },
                             { &p->filter, size * size }, { &p->z, 2 * rows * (size_t)x->count } };
  p->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  p->pivot = malloc ((rows + size + 1) * sizeof *p->pivot);
  if (p->memory && p->pivot) return p;
  pw_variation_implicit_close (p);
  return NULL;
}

void pw_variation_implicit_close (pw_variation_implicit *p) {
  if (p == NULL) return;
  free (p->memory);
  free (p->pivot);
  free (p);
}

/* ---- Stages ---- */

/* N_i, A_i, N_i^+ of minimal coordinate c at the state evaluated; N_i^+ is the transpose of the orthonormal bases. */
static void implicit_tangent (pw_variation *x, int i, int c) {
  pw_linearisation *l = &x->linear;
  pw_variation_implicit *p = x->implicit;
  size_t n = (size_t)x->n, row = (size_t)c * n, half = n * sizeof (double);
  int velocity = c >= l->positions;
  double T = velocity ? x->r->w->scale.time : 1, *N = p->N[i] + 2 * row, *A = p->A[i] + 2 * row, *D = p->D[i] + row;
  pw_linear_tangent (l, c);
  memcpy (N, l->dx, 2 * half);
  for (int j = 0; j < x->n; j++) {
    double scale = pw_length_factor (x->r->s, j) * T;
    D[j] = N[velocity ? x->n + j : j] * scale * scale;
  }
  pw_linear_vary (l);
  memcpy (A, N + n, half);
  memcpy (A + n, l->da, half);
}

/* p_i of a column into `trial`: 0 if the constraints do not depend on the parameter. */
static void implicit_particular (pw_variation *x, pw_variation_column *c) {
  const double *row = c->direction->effect[pw_variation_column_index (c)] + x->n + x->m;
  int depends = 0;
  for (int i = 0; i < 2 * x->m; i++) depends |= row[i] != 0;
  memset (c->trial, 0, 2 * (size_t)x->n * sizeof *c->trial);
  if (depends) pw_variation_project (x, c);
}

/* Stage i: N_i, A_i, N_i^+; p_i, in place of Y_i; F_i (p_i); the run's accelerations into a[1 + i]. */
static int implicit_stage (pw_variation *x, int i, double h, double t1, pw_error *error) {
  size_t bytes = 2 * (size_t)x->n * sizeof (double);
  int status = pw_variation_evaluate_at (x, i + 1 < STAGES ? x->t + radau_c[i] * h : t1, error);
  if (status != PW_OK) return status;
  memcpy (x->a[1 + i], x->linear.a, bytes / 2);
  PW_EACH_COLUMN (c, x) {
    implicit_particular (x, c);
    memcpy (c->K[STATE + i], c->trial, bytes);
  }
  pw_variation_accelerate (x, 0, RATE + i);
  pw_variation_accelerate (x, 1, RATE + i);
  pw_linear_bases (&x->linear);
  for (int c = 0; c < x->linear.size; c++) implicit_tangent (x, i, c);
  return PW_OK;
}

/* ---- Equations ---- */

/* z = N_i^+ vector */
static void implicit_coordinates (const pw_variation *x, int i, const double *vector, double *z) {
  const double *D = x->implicit->D[i];
  for (int k = 0; k < x->implicit->size; k++) {
    z[k] = 0;
    for (int j = k < x->linear.positions ? 0 : x->n, end = j + x->n; j < end; j++) z[k] += *D++ * vector[j];
  }
}

/* Factorises the matrix of the z_i and the filter.  If one is singular, errors are not finite: the step is rejected. */
static void implicit_factor (pw_variation *x, double h) {
  pw_variation_implicit *p = x->implicit;
  int size = p->size, rows = STAGES * size;
  for (int j = 0; j < rows; j++) {
    const double *A = p->A[j / size] + (size_t)(j % size) * 2 * (size_t)x->n;
    double *column = p->matrix + (size_t)j * (size_t)rows;
    for (int i = 0; i < STAGES; i++) {
      double *part = column + i * size;
      implicit_coordinates (x, i, A, part);
      if (i == STAGES - 1 && j >= i * size)
        for (int k = 0; k < size; k++)
          p->filter[(j - i * size) * size + k] = (i * size + k == j) * radau_gamma / h - part[k];
      for (int k = 0; k < size; k++) part[k] = (i * size + k == j) - h * radau_A[i][j / size] * part[k];
    }
  }
  LAPACKE_dgetrf_work (LAPACK_COL_MAJOR, rows, rows, p->matrix, rows, p->pivot);
  LAPACKE_dgetrf_work (LAPACK_COL_MAJOR, size, size, p->filter, size, p->pivot + rows);
}

/* The right-hand sides of a column. */
static void implicit_rhs (pw_variation *x, const pw_variation_column *c, double h, double *z) {
  int length = 2 * x->n;
  double *sum = x->values;
  for (int i = 0; i < STAGES; i++, z += x->implicit->size) {
    for (int j = 0; j < length; j++) sum[j] = c->Y[j] - c->K[STATE + i][j];
    for (int k = 0; k < STAGES; k++) pw_add_scaled (sum, c->K[RATE + k], h * radau_A[i][k], length);
    implicit_coordinates (x, i, sum, z);
  }
}

/* Solves for the stages Y_i. */
static void implicit_solve (pw_variation *x, double h) {
  pw_variation_implicit *p = x->implicit;
  int rows = STAGES * p->size, columns = 0, length = 2 * x->n;
  PW_EACH_COLUMN (c, x) implicit_rhs (x, c, h, p->z + rows * columns++);
  LAPACKE_dgetrs_work (LAPACK_COL_MAJOR, 'N', rows, columns, p->matrix, rows, p->pivot, p->z, rows);
  const double *z = p->z;
  PW_EACH_COLUMN (c, x)
  for (int i = 0; i < STAGES; i++)
    for (int k = 0; k < p->size; k++, z++)
      pw_add_scaled (c->K[STATE + i], p->N[i] + (size_t)k * (size_t)length, *z, length);
}

/* F_i and Y_i of work and losses, for which the stages Y_i of dq and dv must be known. */
static int implicit_powers (pw_variation *x, double h, double t1, pw_error *error) {
  int from = 2 * x->n, length = x->size - from;
  for (int i = 0; x->ledger && i < STAGES; i++) {
    int status = pw_variation_evaluate_at (x, i + 1 < STAGES ? x->t + radau_c[i] * h : t1, error);
    if (status != PW_OK) return status;
    PW_EACH_COLUMN (c, x) memcpy (c->trial, c->K[STATE + i], (size_t)from * sizeof *c->trial);
    status = pw_variation_all_time_derivatives (x, RATE + i, error);
    if (status != PW_OK) return status;
  }
  PW_EACH_COLUMN (c, x)
  for (int i = 0; i < STAGES; i++) {
    memcpy (c->K[STATE + i] + from, c->Y + from, (size_t)length * sizeof *c->Y);
    for (int k = 0; k < STAGES; k++)
      pw_add_scaled (c->K[STATE + i] + from, c->K[RATE + k] + from, h * radau_A[i][k], length);
  }
  return PW_OK;
}

/* ---- Errors ---- */

/* e = N_3 (gamma/h - N_3^+ A_3)^-1 N_3^+ e */
static void implicit_filter (pw_variation *x, double *e) {
  pw_variation_implicit *p = x->implicit;
  int size = p->size, length = 2 * x->n;
  implicit_coordinates (x, 2, e, p->z);
  LAPACKE_dgetrs_work (LAPACK_COL_MAJOR, 'N', size, 1, p->filter, size, p->pivot + STAGES * size, p->z, size);
  memset (e, 0, (size_t)length * sizeof *e);
  for (int k = 0; k < size; k++) pw_add_scaled (e, p->N[2] + (size_t)k * (size_t)length, p->z[k], length);
}

/* The errors of the derivatives; those of work and losses, on which no time derivative depends, need no filter. */
static void implicit_errors (pw_variation *x, double h) {
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    const pw_variation_column *c = d->column;
    memcpy (d->local_error, c->K[0], (size_t)x->size * sizeof *d->local_error);
    for (int i = 0; i < STAGES; i++)
      for (int j = 0; j < x->size; j++) d->local_error[j] += radau_e[i] / h * (c->K[STATE + i][j] - c->Y[j]);
    implicit_filter (x, d->local_error);
    for (int j = 2 * x->n; j < x->size; j++) d->local_error[j] *= h / radau_gamma;
  }
}

/* The same estimate for the run's velocities, into `motion_error`; adds the integral of the accelerations to
 * `motion_defect`, and filters it. */
static void implicit_motion (pw_variation *x, double h) {
  int n = x->n;
  double *e = x->values, *defect = e + 2 * n;
  memset (e, 0, 4 * (size_t)n * sizeof *e);
  memcpy (e + n, x->a[0], (size_t)n * sizeof *e);
  memcpy (defect + n, x->motion_defect, (size_t)n * sizeof *e);
  for (int k = 0; k < STAGES; k++) {
    for (int i = 0; i < STAGES; i++) pw_add_scaled (e + n, x->a[1 + k], radau_e[i] * radau_A[i][k], n);
    pw_add_scaled (defect + n, x->a[1 + k], h * radau_A[2][k], n);
  }
  implicit_filter (x, e);
  implicit_filter (x, defect);
  memcpy (x->motion_error, e + n, (size_t)n * sizeof *e);
  for (int j = 0; j < n; j++) x->motion_defect[j] = defect[n + j] * radau_gamma / h;
}

int pw_variation_implicit_stages (pw_variation *x, double h, double t1, pw_error *error) {
  int status = PW_OK;
  for (int i = 0; i < STAGES && status == PW_OK; i++) status = implicit_stage (x, i, h, t1, error);
  if (status != PW_OK) return status;
  implicit_factor (x, h);
  implicit_solve (x, h);
  status = implicit_powers (x, h, t1, error);
  if (status != PW_OK) return status;
  implicit_errors (x, h);
  implicit_motion (x, h);
  PW_EACH_COLUMN (c, x) memcpy (c->trial, c->K[STATE + STAGES - 1], (size_t)x->size * sizeof *c->trial);
  return PW_OK;
}
