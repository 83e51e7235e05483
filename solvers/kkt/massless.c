/* Elimination of massless coordinates, and the two halves of a solution; see massless.h. */
#include <math.h>
#include "massless.h"
#include "unroll.h"

/* `pivots` is c->pivots: an argument, since it is the constant 3 in most calls, so that loops are unrolled. */

/* ---- Elimination ---- */

/* Copies J to A. */
PW_INLINE void massless_copy (pw_component *c) {
  const pw_massless_group *end = c->group + c->groups;
  double *row = c->A;
  for (const pw_massless_row *r = c->row; r < c->row + c->rows; r++, row += c->stride) {
    const double **from = r->source;
    for (const pw_massless_group *g = c->group; g < end; g++) {
      const double *J = *from++;
      double *A = row + g->column;
      A[0] = J[0];
      if (g->width == 3) A[1] = J[1], A[2] = J[2];
    }
  }
}

/* The weighted sum of the squares of the entries of row i. */
static double massless_square (const pw_component *c, int i, const double *weight) {
  const double *A = c->A + i * c->stride;
  double sum = 0;
  for (int n = 0; n < c->cols; n++) sum += weight[n] * A[n] * A[n];
  return sum;
}

/* Exchanges two rows. */
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

/* Entries below this, relative to the terms or the largest entry of their row, are what round-off leaves of 0. */
#define MASSLESS_ROUND_OFF 1e-12

int pw_massless_is_entry (const pw_component *c, int i, int column) {
  return fabs (c->A[i * c->stride + column]) * sqrt (c->squared_scale[column]) >
         MASSLESS_ROUND_OFF * sqrt (c->row[i].squared_terms);
}

/* Matches the row with the largest entry in a massless column, each row scaled by its largest original entry (so that
 * the remainder of a dependent row is small), and moves it to p.  Returns 0 if all entries are round-off; the component
 * is then matched again at the next factorisation. */
static int massless_select_pivot (pw_component *c, int p) {
  const double guard = 0.1; /* a pivot may lose a digit before the component is matched again */
  int row = -1, column = -1;
  double best = MASSLESS_ROUND_OFF;
  for (int i = p; i < c->rows; i++)
    for (int n = 0; n < c->cols; n++) {
      if (!c->is_massless[n]) continue;
      double scaled = sqrt (c->squared_scale[n]) * fabs (c->A[i * c->stride + n]) / c->row[i].largest;
      if (scaled > best) best = scaled, row = i, column = n;
    }
  if (row < 0) {
    for (int i = 0; i < c->pivots; i++) c->row[i].rematch_below = NAN;
    return 0;
  }
  massless_swap (c, p, row);
  c->row[p].pivot_column = column;
  c->row[p].pivot_scale = sqrt (c->squared_scale[column]) / c->row[p].largest;
  c->row[p].rematch_below = guard * best;
  return 1;
}

/* Subtracts multiples of row p from the rows after it, two columns at a time. */
PW_INLINE void massless_eliminate (pw_component *c, int p, int pivots) {
  const int pivot = c->row[p].pivot_column, cols = c->cols;
  double *P = c->A + p * c->stride, inverse = 1 / P[pivot];
  double square = c->rows > pivots ? massless_square (c, p, c->massive_squared_scale) : 0;
  for (int i = p + 1; i < c->rows; i++) {
    double *A = c->A + i * c->stride, l = A[pivot] * inverse;
    A[c->first_L_column + p] = l;
    if (l == 0) continue;
    for (int k = 0; k < cols; k += 2) {
      double even = A[k] - l * P[k], odd = A[k + 1] - l * P[k + 1];
      A[k] = even, A[k + 1] = odd;
    }
    A[pivot] = 0;
    c->row[i].squared_terms += l * l * square;
  }
  P[pivot] = inverse;
}

typedef enum { MASSLESS_AS_MATCHED, MASSLESS_MATCH } massless_mode;

/* Eliminates with the pivots matched before, or matches them.  Returns the number of pivots that are large enough. */
PW_INLINE int massless_reduce (pw_component *c, massless_mode mode, int pivots) {
  const int matches = mode == MASSLESS_MATCH;
  massless_copy (c);
  c->least_pivot = INFINITY;
  for (int i = matches ? 0 : pivots; i < c->rows; i++)
    c->row[i].squared_terms = massless_square (c, i, c->squared_scale);
  for (int i = 0; matches && i < c->rows; i++) {
    c->row[i].largest = 0;
    for (int k = 0; k < c->cols; k++)
      c->row[i].largest = fmax (c->row[i].largest, sqrt (c->squared_scale[k]) * fabs (c->A[i * c->stride + k]));
  }
  PW_UNROLL for (int p = 0; p < pivots; p++) {
    if (matches && !massless_select_pivot (c, p)) return p;
    const pw_massless_row *row = &c->row[p];
    double pivot = fabs (c->A[p * c->stride + row->pivot_column]) * row->pivot_scale;
    if (!(pivot >= c->least_pivot)) c->least_pivot = pivot;
    if (!matches && !(pivot >= row->rematch_below)) return p;
    massless_eliminate (c, p, pivots);
  }
  return pivots;
}

int pw_massless_match (pw_component *c) {
  return massless_reduce (c, MASSLESS_MATCH, c->pivots);
}

double pw_massless_factor (pw_massless *m) {
  double least = INFINITY;
  for (pw_component *c = m->component; c < m->end; c++) {
    int found = c->pivots == 3 ? massless_reduce (c, MASSLESS_AS_MATCHED, 3)
                               : massless_reduce (c, MASSLESS_AS_MATCHED, c->pivots);
    if (found < c->pivots && pw_massless_match (c) < c->pivots) return 0;
    for (int i = c->pivots; i < c->rows; i++) {
      double terms = c->row[i].squared_terms, square = massless_square (c, i, c->massive_squared_scale);
      double remainder = terms > 0 ? sqrt (square / terms) : 0;
      if (!(remainder >= c->least_pivot)) c->least_pivot = remainder;
    }
    if (!(c->least_pivot >= least)) least = c->least_pivot;
  }
  return least > 1 ? 1 : least * least;
}

/* ---- Solving ---- */

/* gamma~, then w in place of lambda, then f~. */
PW_INLINE void massless_forward (pw_component *c, double *f, double *gamma, int pivots) {
  pw_massless_row *row = c->row;
  for (int i = 0; i < c->rows; i++) {
    const double *L = c->A + i * c->stride + c->first_L_column;
    row[i].gamma = gamma[row[i].equation];
    PW_UNROLL for (int p = 0; p < pivots; p++) row[i].gamma -= p < i ? L[p] * row[p].gamma : 0;
  }
  for (int i = pivots; i < c->rows; i++)
    if (c->unknown[i] >= 0) gamma[c->unknown[i]] = row[i].gamma;
  PW_UNROLL for (int p = 0; p < pivots; p++) {
    double w = f[c->global[row[p].pivot_column]];
    PW_UNROLL for (int q = 0; q < p; q++) w -= c->A[q * c->stride + row[p].pivot_column] * row[q].lambda;
    row[p].lambda = w * c->A[p * c->stride + row[p].pivot_column];
  }
  for (const int *column = c->massive; column < c->massive + c->massives; column++) {
    double change = 0;
    PW_UNROLL for (int p = 0; p < pivots; p++) change += c->A[p * c->stride + *column] * row[p].lambda;
    f[c->global[*column]] -= change;
  }
}

void pw_massless_forward (pw_massless *m, double *f, double *gamma) {
  for (pw_component *c = m->component; c < m->end; c++)
    c->pivots == 3 ? massless_forward (c, f, gamma, 3) : massless_forward (c, f, gamma, c->pivots);
}

/* gamma~ - H' a, then a_P and lambda_p from the last pivot to the first. */
PW_INLINE void massless_backward (pw_component *c, double *a, double *lambda, int pivots) {
  pw_massless_row *row = c->row;
  for (const int *column = c->massive; column < c->massive + c->massives; column++) {
    double x = a[c->global[*column]];
    PW_UNROLL for (int p = 0; p < pivots; p++) row[p].gamma -= c->A[p * c->stride + *column] * x;
  }
  /* reads all before storing any: one row's index may be the `unknown` of another */
  for (int i = pivots; i < c->rows; i++) row[i].lambda = c->unknown[i] < 0 ? 0 : lambda[c->unknown[i]];
  for (int i = pivots; i < c->rows; i++) lambda[row[i].equation] = row[i].lambda;
  PW_UNROLL for (int p = pivots - 1; p >= 0; p--) {
    const double *A = c->A + p * c->stride;
    double x = row[p].gamma;
    PW_UNROLL for (int q = p + 1; q < pivots; q++) x -= A[row[q].pivot_column] * a[c->global[row[q].pivot_column]];
    a[c->global[row[p].pivot_column]] = x * A[row[p].pivot_column];
    for (int i = p + 1; i < c->rows; i++) row[p].lambda -= c->A[i * c->stride + c->first_L_column + p] * row[i].lambda;
    lambda[row[p].equation] = row[p].lambda;
  }
}

void pw_massless_backward (pw_massless *m, double *a, double *lambda) {
  for (pw_component *c = m->component; c < m->end; c++)
    c->pivots == 3 ? massless_backward (c, a, lambda, 3) : massless_backward (c, a, lambda, c->pivots);
}
