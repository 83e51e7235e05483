/* Which row determines which coordinate without weight, and where the entries of P, K, H and Z are; see reduce.h. */
#include <math.h>
#include "reduce.h"

/* ---- Matching ---- */

/* Copies the rows of J into Z. */
static void reduce_copy (pw_component *c) {
  double *row = c->Z;
  const pw_reduce_piece *piece = c->piece;
  for (int n = 0; n < c->rows * c->cols; n++) row[n] = 0;
  for (int i = 0; i < c->rows; i++, row += c->cols, piece += PW_REDUCE_PIECES)
    for (const pw_reduce_piece *p = piece; p < piece + PW_REDUCE_PIECES && p->width; p++) {
      double *to = row + p->column;
      to[0] = p->J[0];
      if (p->width == 3) to[1] = p->J[1], to[2] = p->J[2];
    }
}

/* Subtracts the pivot row from row i so that its entry under the pivot vanishes. */
static void reduce_eliminate (pw_component *c, int p, int i) {
  double *row = c->Z + i * c->cols, *pivot = c->Z + p * c->cols;
  double f = row[c->pivot[p]] / pivot[c->pivot[p]];
  for (int n = 0; n < c->cols; n++) row[n] -= f * pivot[n];
  row[c->pivot[p]] = 0;
}

static void reduce_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  int row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int i = 0; i < PW_REDUCE_PIECES; i++) {
    pw_reduce_piece piece = c->piece[a * PW_REDUCE_PIECES + i];
    c->piece[a * PW_REDUCE_PIECES + i] = c->piece[b * PW_REDUCE_PIECES + i];
    c->piece[b * PW_REDUCE_PIECES + i] = piece;
  }
  double size = c->gamma[a];
  c->gamma[a] = c->gamma[b], c->gamma[b] = size;
  for (int n = 0; n < c->cols; n++) {
    double z = c->Z[a * c->cols + n];
    c->Z[a * c->cols + n] = c->Z[b * c->cols + n];
    c->Z[b * c->cols + n] = z;
  }
}

/* The piece of row i that has a column. */
static const pw_reduce_piece *reduce_piece_at (const pw_component *c, int i, int column) {
  const pw_reduce_piece *x = c->piece + i * PW_REDUCE_PIECES;
  while (!(x->column <= column && column < x->column + x->width)) x++;
  return x;
}

/* 1 if the first two of three pivots are x and y of a body, in rows whose columns there are a unit matrix. */
static int reduce_is_pinned (const pw_component *c) {
  if (c->pivots != 3) return 0;
  const pw_reduce_piece *x = reduce_piece_at (c, 0, c->pivot[0]), *y = reduce_piece_at (c, 1, c->pivot[1]);
  return x->unit + y->unit == 3 && x->column == y->column && c->pivot[0] == x->column + x->unit - 1 &&
         c->pivot[1] == y->column + y->unit - 1;
}

/* How many of H's runs before x are the same row of a unit matrix in the same body. */
static int reduce_rank (const pw_component *c, const pw_reduce_heavy *x) {
  int n = 0;
  for (const pw_reduce_heavy *y = c->heavy; y < x; y++) n += y->j == x->j && y->unit == x->unit;
  return n;
}

/* The other row of x's unit matrix, or NULL. */
static const pw_reduce_heavy *reduce_partner (const pw_component *c, const pw_reduce_heavy *x) {
  for (const pw_reduce_heavy *y = c->heavy, *end = y + c->heavies_h; y < end && x->unit; y++)
    if (y->j == x->j && y->unit == 3 - x->unit && reduce_rank (c, y) == reduce_rank (c, x)) return y;
  return NULL;
}

static void reduce_pair_up (pw_component *c) {
  c->pairs = c->singles = 0;
  for (const pw_reduce_heavy *x = c->heavy, *end = x + c->heavies_h; x < end; x++) {
    const pw_reduce_heavy *y = reduce_partner (c, x);
    if (y == NULL)
      c->single[c->singles++] = *x;
    else if (x->unit == 1)
      c->pair[c->pairs++] = (pw_reduce_pair){ x->J, y->J, x->slot, y->slot, x->j };
  }
}

/* Where the entries of P, K, H and Z are, for the matching found. */
static void reduce_plan_copies (pw_component *c) {
  static const double zero = 0;
  c->heavies = 0;
  c->pinned = reduce_is_pinned (c);
  for (int n = 0; n < c->pivots * c->pivots; n++) c->P[n] = 0;
  for (int i = 0; i < c->rows; i++) {
    const pw_reduce_piece *piece = c->piece + i * PW_REDUCE_PIECES;
    for (int p = 0; p < c->pivots; p++) c->from[i * c->pivots + p] = &zero;
    for (const pw_reduce_piece *x = piece; x < piece + PW_REDUCE_PIECES && x->width; x++) {
      int heavy = 0;
      for (int n = 0; n < x->width; n++) heavy |= !c->massless[x->column + n];
      for (int p = 0; p < c->pivots; p++)
        if (c->pivot[p] >= x->column && c->pivot[p] < x->column + x->width)
          c->from[i * c->pivots + p] = x->J + c->pivot[p] - x->column;
      if (heavy)
        c->heavy[c->heavies++] = (pw_reduce_heavy){ x->J, i, c->global[x->column], x->width, x->unit, x->column };
    }
    if (i < c->pivots) c->heavies_h = c->heavies, c->light[i] = c->global[c->pivot[i]];
  }
  reduce_pair_up (c);
}

/* The largest entries of the rows, into gamma. */
static void reduce_measure (pw_component *c) {
  for (int i = 0; i < c->rows; i++) {
    c->gamma[i] = 0;
    for (int n = 0; n < c->cols; n++) c->gamma[i] = fmax (c->gamma[i], fabs (c->Z[i * c->cols + n]) / c->unit[n]);
  }
}

/* The p-th pivot and those behind it were not found: rows have been swapped, but what is planned is for their places of
 * before.  Until they are matched again no pivot is large enough, and these are the smallest. */
static int reduce_unmatched (pw_component *c, int p) {
  for (int i = 0; i < c->pivots; i++) c->least[i] = NAN;
  for (int i = p; i < c->pivots; i++) c->scale[i] = 0;
  return p;
}

/* Gaussian elimination; angles in units of length, rows scaled by the largest entry they had: what is left of a dependent
 * row is small. */
int pw_reduce_match (pw_component *c) {
  const double guard = 0.1;
  reduce_copy (c);
  reduce_measure (c);
  for (int p = 0; p < c->pivots; p++) {
    int row = -1, column = -1;
    double best = 1e-12;
    for (int i = p; i < c->rows; i++)
      for (int n = 0; n < c->cols; n++) {
        double scaled = c->massless[n] ? fabs (c->Z[i * c->cols + n]) / c->unit[n] / c->gamma[i] : 0;
        if (scaled > best) best = scaled, row = i, column = n;
      }
    if (row < 0) return reduce_unmatched (c, p);
    reduce_swap (c, p, row);
    c->pivot[p] = column;
    c->scale[p] = best / fabs (c->Z[p * c->cols + column]);
    c->least[p] = guard * best;
    for (int i = p + 1; i < c->rows; i++) reduce_eliminate (c, p, i);
  }
  reduce_plan_copies (c);
  return c->pivots;
}
