/* Elimination of coordinates without weight; see massless.h. */
#include <math.h>
#include "massless.h"
#include "unroll.h"

/* n: the number of pivots, a constant 3 in most calls, so that loops are unrolled. */

/* ---- Elimination ---- */

PW_INLINE void massless_copy (pw_component *c) {
  const pw_massless_group *end = c->group + c->groups;
  double *row = c->A;
  for (const pw_massless_row *r = c->row; r < c->row + c->rows; r++, row += c->stride) {
    const double **from = r->from;
    for (const pw_massless_group *g = c->group; g < end; g++) {
      const double *J = *from++;
      double *A = row + g->column;
      A[0] = J[0];
      if (g->width == 3) A[1] = J[1], A[2] = J[2];
    }
  }
}

/* The weighted sum of the squares of a row's entries. */
static double massless_square (const pw_component *c, int i, const double *weight) {
  const double *A = c->A + i * c->stride;
  double sum = 0;
  for (int n = 0; n < c->cols; n++) sum += weight[n] * A[n] * A[n];
  return sum;
}

static void massless_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  pw_massless_row row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int n = 0; n < c->stride; n++) {
    double x = c->A[a * c->stride + n];
    c->A[a * c->stride + n] = c->A[b * c->stride + n];
    c->A[b * c->stride + n] = x;
  }
}

/* Entries below this part of their row, some 1e3 eps, are what round-off leaves of 0. */
#define MASSLESS_ROUND_OFF 1e-12

int pw_massless_is_entry (const pw_component *c, int i, int column) {
  return fabs (c->A[i * c->stride + column]) * sqrt (c->square[column]) > MASSLESS_ROUND_OFF * sqrt (c->row[i].terms);
}

/* Moves the row with the largest entry in a massless column to p, each row scaled by its largest original entry, so
 * that the remainder of a dependent row is small.  Returns 0 if all are round-off; the component is then matched again
 * at the next factorisation. */
static int massless_select_pivot (pw_component *c, int p) {
  const double guard = 0.1; /* a pivot may lose one digit until the component is matched again */
  int row = -1, column = -1;
  double best = MASSLESS_ROUND_OFF;
  for (int i = p; i < c->rows; i++)
    for (int n = 0; n < c->cols; n++) {
      double scaled = c->massless[n] ? sqrt (c->square[n]) * fabs (c->A[i * c->stride + n]) / c->row[i].size : 0;
      if (scaled > best) best = scaled, row = i, column = n;
    }
  if (row < 0) {
    for (int i = 0; i < c->pivots; i++) c->row[i].least = NAN;
    return 0;
  }
  massless_swap (c, p, row);
  c->row[p].pivot = column;
  c->row[p].scale = sqrt (c->square[column]) / c->row[p].size;
  c->row[p].least = guard * best;
  return 1;
}

/* Subtracts row p from those after it, by pairs of columns.  `terms` of an unmatched row grows by the square of what is
 * subtracted. */
PW_INLINE void massless_eliminate (pw_component *c, int p, int n) {
  const int pivot = c->row[p].pivot, cols = c->cols;
  double *P = c->A + p * c->stride, inverse = 1 / P[pivot];
  double square = c->rows > n ? massless_square (c, p, c->massive_square) : 0;
  for (int i = p + 1; i < c->rows; i++) {
    double *A = c->A + i * c->stride, l = A[pivot] * inverse;
    A[c->lower + p] = l;
    if (l == 0) continue;
    for (int k = 0; k < cols; k += 2) {
      double even = A[k] - l * P[k], odd = A[k + 1] - l * P[k + 1];
      A[k] = even, A[k + 1] = odd;
    }
    A[pivot] = 0;
    c->row[i].terms += l * l * square;
  }
  P[pivot] = inverse;
}

/* Eliminates with the pivots matched before, or matches them (with `search`).  Returns the number of pivots that are
 * large enough. */
PW_INLINE int massless_reduce (pw_component *c, int search, int n) {
  massless_copy (c);
  c->least = INFINITY;
  for (int i = search ? 0 : n; i < c->rows; i++) c->row[i].terms = massless_square (c, i, c->square);
  for (int i = 0; search && i < c->rows; i++) {
    c->row[i].size = 0;
    for (int k = 0; k < c->cols; k++)
      c->row[i].size = fmax (c->row[i].size, sqrt (c->square[k]) * fabs (c->A[i * c->stride + k]));
  }
  PW_UNROLL for (int p = 0; p < n; p++) {
    if (search && !massless_select_pivot (c, p)) return p;
    const pw_massless_row *row = &c->row[p];
    double pivot = fabs (c->A[p * c->stride + row->pivot]) * row->scale;
    if (!(pivot >= c->least)) c->least = pivot;
    if (!search && !(pivot >= row->least)) return p;
    massless_eliminate (c, p, n);
  }
  return n;
}

int pw_massless_match (pw_component *c) {
  return massless_reduce (c, 1, c->pivots);
}

double pw_massless_factor (pw_massless *r) {
  double least = INFINITY;
  for (pw_component *c = r->component; c < r->end; c++) {
    if ((c->pivots == 3 ? massless_reduce (c, 0, 3) : massless_reduce (c, 0, c->pivots)) < c->pivots)
      if (pw_massless_match (c) < c->pivots) return 0;
    for (int i = c->pivots; i < c->rows; i++) {
      double remainder = c->row[i].terms > 0 ? sqrt (massless_square (c, i, c->massive_square) / c->row[i].terms) : 0;
      if (!(remainder >= c->least)) c->least = remainder;
    }
    if (!(c->least >= least)) least = c->least;
  }
  return least > 1 ? 1 : least * least;
}

/* ---- Solving ---- */

PW_INLINE void massless_forward (pw_component *c, double *f, double *gamma, int n) {
  pw_massless_row *row = c->row;
  for (int i = 0; i < c->rows; i++) {
    const double *L = c->A + i * c->stride + c->lower;
    row[i].gamma = gamma[row[i].row];
    PW_UNROLL for (int p = 0; p < n; p++) row[i].gamma -= p < i ? L[p] * row[p].gamma : 0;
  }
  for (int i = n; i < c->rows; i++)
    if (c->y[i] >= 0) gamma[c->y[i]] = row[i].gamma;
  PW_UNROLL for (int p = 0; p < n; p++) {
    double w = f[c->global[row[p].pivot]];
    PW_UNROLL for (int q = 0; q < p; q++) w -= c->A[q * c->stride + row[p].pivot] * row[q].lambda;
    row[p].lambda = w * c->A[p * c->stride + row[p].pivot];
  }
  for (const int *m = c->massive; m < c->massive + c->massives; m++) {
    double change = 0;
    PW_UNROLL for (int p = 0; p < n; p++) change += c->A[p * c->stride + *m] * row[p].lambda;
    f[c->global[*m]] -= change;
  }
}

void pw_massless_forward (pw_massless *r, double *f, double *gamma) {
  for (pw_component *c = r->component; c < r->end; c++)
    c->pivots == 3 ? massless_forward (c, f, gamma, 3) : massless_forward (c, f, gamma, c->pivots);
}

PW_INLINE void massless_backward (pw_component *c, double *a, double *lambda, int n) {
  pw_massless_row *row = c->row;
  for (const int *m = c->massive; m < c->massive + c->massives; m++) {
    double x = a[c->global[*m]];
    PW_UNROLL for (int p = 0; p < n; p++) row[p].gamma -= c->A[p * c->stride + *m] * x;
  }
  for (int i = n; i < c->rows; i++) row[i].lambda = c->y[i] < 0 ? 0 : lambda[c->y[i]];
  for (int i = n; i < c->rows; i++) lambda[row[i].row] = row[i].lambda;
  PW_UNROLL for (int p = n - 1; p >= 0; p--) {
    const double *A = c->A + p * c->stride;
    double x = row[p].gamma;
    PW_UNROLL for (int q = p + 1; q < n; q++) x -= A[row[q].pivot] * a[c->global[row[q].pivot]];
    a[c->global[row[p].pivot]] = x * A[row[p].pivot];
    for (int i = p + 1; i < c->rows; i++) row[p].lambda -= c->A[i * c->stride + c->lower + p] * row[i].lambda;
    lambda[row[p].row] = row[p].lambda;
  }
}

void pw_massless_backward (pw_massless *r, double *a, double *lambda) {
  for (pw_component *c = r->component; c < r->end; c++)
    c->pivots == 3 ? massless_backward (c, a, lambda, 3) : massless_backward (c, a, lambda, c->pivots);
}
