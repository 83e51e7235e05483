/* The rank of J, and a set of independent rows, by Gram-Schmidt; see rank.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rank.h"
#include "util.h"

double pw_length_factor (const pw_system *s, int j) {
  return pw_is_angle (s, j) ? s->scale.length : 1;
}

void pw_length_weights (const pw_system *s, double *weight) {
  for (int j = 0; j < s->coords; j++) weight[j] = pw_length_factor (s, j) * pw_length_factor (s, j);
}

void pw_rank_rows (const pw_workspace *w, double *rows, double *norm) {
  const pw_system *s = w->s;
  int n = s->coords;
  memset (rows, 0, (size_t)s->rows * (size_t)n * sizeof *rows);
  PW_EACH_CONSTRAINT (k, w)
    for (int i = 0; i < k->b.count * k->kind->rows; i++) {
      double *row = rows + (size_t)(k->row + i) * (size_t)n, square = 0;
      for (int c = 0; c < k->b.cols; c++) {
        int j = pw_global (k, i / k->kind->rows, c);
        if (j < n) row[j] += k->J[i * k->b.cols + c] / pw_length_factor (s, j);
      }
      for (int j = 0; j < n; j++) square += row[j] * row[j];
      for (int j = 0; square > 0 && j < n; j++) row[j] /= sqrt (square);
      if (norm) norm[k->row + i] = sqrt (square);
    }
}

int pw_row_basis_open (pw_row_basis *b, const pw_system *s) {
  size_t rows = (size_t)s->rows;
  *b = (pw_row_basis){ .coords = s->coords };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &b->memory);) {
    b->rows = pw_layout_alloc (&l, rows * (size_t)s->coords, sizeof *b->rows);
    b->norm = pw_layout_alloc (&l, rows, sizeof *b->norm);
    b->kept = pw_layout_alloc (&l, rows, sizeof *b->kept);
    b->active = pw_layout_alloc (&l, rows, 1);
  }
  return b->memory ? PW_OK : PW_RESOURCE;
}

void pw_row_basis_close (pw_row_basis *b) {
  free (b->memory);
}

static double *rank_row (const pw_row_basis *b, int i) {
  return b->rows + (size_t)i * (size_t)b->coords;
}

double pw_row_basis_orthogonalise (const pw_row_basis *b, double *vector, int first) {
  double square = 0;
  for (int k = first; k < b->rank; k++) {
    const double *kept = rank_row (b, b->kept[k]);
    double dot = 0;
    for (int j = 0; j < b->coords; j++) dot += vector[j] * kept[j];
    for (int j = 0; j < b->coords; j++) vector[j] -= dot * kept[j];
  }
  for (int j = 0; j < b->coords; j++) square += vector[j] * vector[j];
  return sqrt (square);
}

/* The next row to keep of rows first .. end - 1: the first whose norm is at least 0.9 of the largest, so that equal
 * rows keep their order whatever their round-off; -1 if none is left. */
static int rank_pivot (const pw_row_basis *b, int first, int end) {
  double most = 0;
  for (int i = first; i < end; i++)
    if (!b->active[i]) most = fmax (most, b->norm[i]);
  for (int i = first; i < end; i++)
    if (!b->active[i] && b->norm[i] > 0 && b->norm[i] >= 0.9 * most) return i;
  return -1;
}

/* Keeps independent rows among first .. end - 1, until max_rank rows are kept.  Each is orthogonalised whenever another
 * one is kept, and once more before it is kept itself (Giraud, Langou & Rozloznik 2005, The loss of orthogonality in
 * the Gram-Schmidt orthogonalization process). */
static void rank_keep (pw_row_basis *b, double tol, int max_rank, int first, int end) {
  for (int i = first; i < end; i++) b->norm[i] = pw_row_basis_orthogonalise (b, rank_row (b, i), 0);
  for (int next; b->rank < max_rank && (next = rank_pivot (b, first, end)) >= 0;) {
    double *row = rank_row (b, next), norm = b->norm[next] = pw_row_basis_orthogonalise (b, row, 0);
    if (!(norm > tol)) {
      b->norm[next] = 0;
      continue;
    }
    for (int j = 0; j < b->coords; j++) row[j] /= norm;
    b->active[next] = 1;
    b->kept[b->rank++] = next;
    for (int i = first; i < end; i++)
      if (!b->active[i] && b->norm[i] > 0) b->norm[i] = pw_row_basis_orthogonalise (b, rank_row (b, i), b->rank - 1);
  }
}

int pw_row_basis_select (pw_row_basis *b, const pw_workspace *w, double tol, const unsigned char *fixed,
                         int max_holonomic, int max_rows) {
  const pw_system *s = w->s;
  pw_rank_rows (w, b->rows, NULL);
  for (int i = 0; fixed && i < s->rows * s->coords; i++)
    if (fixed[i % s->coords]) b->rows[i] = 0;
  memset (b->active, 0, (size_t)s->rows);
  b->rank = 0;
  rank_keep (b, tol, max_holonomic, 0, s->holonomic);
  rank_keep (b, tol, max_rows, s->holonomic, s->rows);
  return b->rank;
}

int pw_rank_select (const pw_workspace *w, double tol, const unsigned char *fixed, unsigned char *active) {
  const pw_system *s = w->s;
  pw_row_basis b;
  int rank = PW_RESOURCE;
  if (pw_row_basis_open (&b, s) == PW_OK) {
    rank = pw_row_basis_select (&b, w, tol, fixed, s->rows, s->rows);
    memcpy (active, b.active, (size_t)s->rows);
  }
  pw_row_basis_close (&b);
  return rank;
}
