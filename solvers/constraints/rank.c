/* The rank of J: Gram-Schmidt on its rows. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rank.h"

double pw_as_length (const pw_system *s, int j) {
  return pw_is_angle (s, j) ? s->scale.length : 1;
}

void pw_rank_weights (const pw_system *s, double *weight) {
  for (int j = 0; j < s->coords; j++) weight[j] = pw_as_length (s, j) * pw_as_length (s, j);
}

void pw_rank_rows (const pw_workspace *w, double *rows, double *norm) {
  const pw_system *s = w->s;
  int n = s->coords;
  memset (rows, 0, (size_t)s->rows * (size_t)n * sizeof *rows);
  for (const pw_element_batch *k = w->batch; k < w->batch + w->s->constraints; k++)
    for (int i = 0; i < k->b.count * k->kind->rows; i++) {
      double *row = rows + (size_t)(k->row + i) * (size_t)n, square = 0;
      for (int c = 0; c < k->b.cols; c++) {
        int j = pw_global (k, i / k->kind->rows, c);
        if (j < n) row[j] += k->J[i * k->b.cols + c] / pw_as_length (s, j);
      }
      for (int j = 0; j < n; j++) square += row[j] * row[j];
      for (int j = 0; square > 0 && j < n; j++) row[j] /= sqrt (square);
      if (norm) norm[k->row + i] = sqrt (square);
    }
}

double pw_rank_orthogonalise (double *row, const double *rows, const int *kept, int rank, int n) {
  double norm = 0;
  for (int k = 0; k < rank; k++) {
    const double *other = rows + (size_t)kept[k] * (size_t)n;
    double dot = 0;
    for (int j = 0; j < n; j++) dot += row[j] * other[j];
    for (int j = 0; j < n; j++) row[j] -= dot * other[j];
  }
  for (int j = 0; j < n; j++) norm += row[j] * row[j];
  return sqrt (norm);
}

/* The next row to keep of rows first .. end - 1: the first whose norm is at least 0.9 of the largest, so that equal rows keep
 * their order whatever their round-off. */
static int rank_pivot (const double *norm, const unsigned char *active, int first, int end) {
  double most = 0;
  for (int i = first; i < end; i++)
    if (!active[i]) most = fmax (most, norm[i]);
  for (int i = first; i < end; i++)
    if (!active[i] && norm[i] > 0 && norm[i] >= 0.9 * most) return i;
  return -1;
}

/* Keeps independent equations among first .. end - 1 after the `rank` ones kept so far, until there are `most`;
 * returns the new rank.  Each is orthogonalised as others are kept, and once more before it is (Giraud, Langou &
 * Rozloznik 2005). */
static int rank_keep (double tol, int most, double *rows, double *norm, int *kept, unsigned char *active, int rank,
                      int first, int end, int n) {
  for (int i = first; i < end; i++) norm[i] = pw_rank_orthogonalise (rows + (size_t)i * (size_t)n, rows, kept, rank, n);
  for (int next; rank < most && (next = rank_pivot (norm, active, first, end)) >= 0;) {
    double *row = rows + (size_t)next * (size_t)n;
    norm[next] = pw_rank_orthogonalise (row, rows, kept, rank, n);
    if (!(norm[next] > tol)) {
      norm[next] = 0;
      continue;
    }
    for (int j = 0; j < n; j++) row[j] /= norm[next];
    active[next] = 1;
    kept[rank++] = next;
    for (int i = first; i < end; i++)
      if (!active[i] && norm[i] > 0)
        norm[i] = pw_rank_orthogonalise (rows + (size_t)i * (size_t)n, rows, kept + rank - 1, 1, n);
  }
  return rank;
}

static int rank_basis (const pw_workspace *w, double tol, const unsigned char *fixed, int holonomic, int all,
                       double *rows, int *kept, unsigned char *active) {
  const pw_system *s = w->s;
  double *norm = rows + (size_t)s->rows * (size_t)s->coords;
  pw_rank_rows (w, rows, NULL);
  for (int i = 0; fixed && i < s->rows * s->coords; i++)
    if (fixed[i % s->coords]) rows[i] = 0;
  memset (active, 0, (size_t)s->rows);
  int rank = rank_keep (tol, holonomic, rows, norm, kept, active, 0, 0, s->holonomic, s->coords);
  return rank_keep (tol, all, rows, norm, kept, active, rank, s->holonomic, s->rows, s->coords);
}

int pw_rank_basis (const pw_workspace *w, double tol, int holonomic, int all, double *rows, int *kept,
                   unsigned char *active) {
  return rank_basis (w, tol, NULL, holonomic, all, rows, kept, active);
}

int pw_rank_select (const pw_workspace *w, double tol, const unsigned char *fixed, unsigned char *active) {
  const pw_system *s = w->s;
  double *rows = malloc (pw_rank_room (s) * sizeof *rows);
  int *kept = malloc (((size_t)s->rows + 1) * sizeof *kept), rank = PW_RESOURCE;
  if (rows && kept) rank = rank_basis (w, tol, fixed, s->rows, s->rows, rows, kept, active);
  free (rows);
  free (kept);
  return rank;
}
