/* Inputs, states and mode shapes of a linearisation.
 *
 * A signal of a force changes the accelerations by the solution of the saddle-point system with the right-hand side
 * (f_u, 0); its column of the input matrix B is (0, T N_v^T da), with T and N_v of linear_variation.c.
 *
 * With the reflections Q that split off k rigid displacements, A = Q [ A11 A12 ; 0 A22 ] Q^T.  An eigenvector y2 of A22
 * for the eigenvalue mu has the rigid part y1 with  (A11 - mu) y1 = -A12 y2  and belongs to the mode Q (y1, y2). */
#include <complex.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linear.h"
#include "rank.h"

/* In units of 1/T: if an eigenvalue is closer than this to that of a rigid displacement, the rigid part of its mode is
 * not unique. */
static const double MODES_APART = 1e-6;

/* ---- Matrices ---- */

/* The column of B of signal u of element e of a batch, whose force_u is evaluated in the scratch block. */
static void modes_input (pw_linearisation *x, const pw_element_batch *k, int e, int u, double *column) {
  const int signals = k->kind->signals, cols = k->b.cols;
  memset (x->dx, 0, 2 * (size_t)x->n * sizeof *x->dx);
  memset (x->da, 0, ((size_t)x->n + 3) * sizeof *x->da);
  memset (x->row_scratch, 0, (size_t)x->m * sizeof *x->row_scratch);
  for (int c = 0; c < cols; c++) x->da[pw_global (k, e, c)] += x->tangent.block[(e * cols + c) * signals + u];
  pw_saddle_solve (x->r->saddle, x->da, x->row_scratch, x->da, x->scratch);
  pw_linear_coordinates (x, x->dx, x->da, x->r->s->sources, column);
}

/* Fills B, column by column; NAN for signals of constraints. */
static void modes_inputs (pw_linearisation *x, double *B) {
  pw_workspace *w = x->r->w;
  int inputs = x->r->s->sources;
  for (pw_element_batch *k = w->batch; k < w->batch + x->r->s->batches; k++) {
    if (k->kind->signals == 0) continue;
    if (k->kind->force_u) k->kind->force_u (&k->b, x->tangent.block);
    for (int i = 0; i < k->b.count * k->kind->signals; i++, B++)
      if (k->kind->force_u)
        modes_input (x, k, i / k->kind->signals, i % k->kind->signals, B);
      else
        for (int c = 0; c < x->size; c++) B[c * inputs] = NAN;
  }
}

int pw_linear_matrices (pw_linearisation *x, pw_linear *l) {
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

/* ---- Shapes ---- */

/* 1 if mu is about an eigenvalue of the k rigid displacements: +- i w for two translations, 0 for any other one. */
static int modes_near_rigid (const pw_linearisation *x, int k, double complex mu) {
  double bound = MODES_APART / x->r->w->scale.time, w = x->frame.twist[2];
  return (k != 2 && cabs (mu) <= bound) || (k >= 2 && (cabs (mu - I * w) <= bound || cabs (mu + I * w) <= bound));
}

/* Sets the first k entries of y, y1, from the others, y2; 0 if they are not unique. */
static void modes_rigid_part (const pw_linearisation *x, int k, double complex mu, double complex *y) {
  double complex M[9];
  int pivot[3];
  for (int i = 0; i < k; i++) y[i] = 0;
  if (k == 0 || modes_near_rigid (x, k, mu)) return;
  for (int i = 0; i < k; i++)
    for (int c = 0; c < x->size; c++)
      if (c < k)
        M[c * k + i] = x->upper_rows[i * x->size + c] - (c == i ? mu : 0);
      else
        y[i] -= x->upper_rows[i * x->size + c] * y[c];
  LAPACKE_zgesv_work (LAPACK_COL_MAJOR, k, 1, M, k, pivot, y, k);
}

/* Sets y, after its first k entries, to the eigenvector j of A22.  LAPACK has computed its conjugate, a left
 * eigenvector of A22^T, since A22 is stored by rows. */
static void modes_vector (const pw_linearisation *x, int k, int j, double complex *y) {
  int n = x->size - k;
  double im = x->left_vectors[n * n + j];
  const double *re = x->left_vectors + (size_t)(im < 0 ? j - 1 : j) * (size_t)n;
  for (int i = 0; i < n; i++) y[k + i] = im == 0 ? re[i] : re[i] - I * (im > 0 ? re[n + i] : -re[n + i]);
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

int pw_linear_shapes (pw_linearisation *x, int k, pw_linear *l) {
  int size = x->size, states = 2 * x->n;
  double complex *y = malloc (((size_t)size + 1) * sizeof *y);
  if (y == NULL) return PW_RESOURCE;
  for (int i = k; i < size; i++) {
    if (l->re[i] == 0 && l->im[i] == 0) continue;
    double complex *shape = (double complex *)l->shape + (size_t)i * (size_t)states;
    modes_vector (x, k, i - k, y);
    modes_rigid_part (x, k, l->re[i] + I * l->im[i], y);
    modes_reflect (x, k, y);
    for (int j = 0; j < states; j++)
      for (int c = 0; c < size; c++) shape[j] += l->basis[(size_t)j * (size_t)size + (size_t)c] * y[c];
    modes_scale (x, shape);
  }
  free (y);
  return PW_OK;
}
