/* Matches rows to coordinates without weight, and locates the entries of P, K, H and Z; see massless.h. */
#include <math.h>
#include "massless.h"

/* ---- Matching ---- */

/* Copies the rows of J into Z. */
static void massless_copy (pw_component *c) {
  double *row = c->Z;
  const pw_massless_block *block = c->block;
  for (int n = 0; n < c->rows * c->cols; n++) row[n] = 0;
  for (int i = 0; i < c->rows; i++, row += c->cols, block += PW_MASSLESS_BLOCKS)
    for (const pw_massless_block *p = block; p < block + PW_MASSLESS_BLOCKS && p->width; p++) {
      double *to = row + p->column;
      to[0] = p->J[0];
      if (p->width == 3) to[1] = p->J[1], to[2] = p->J[2];
    }
}

/* Subtracts the pivot row from row i so that its entry under the pivot vanishes. */
static void massless_eliminate (pw_component *c, int p, int i) {
  double *row = c->Z + i * c->cols, *pivot = c->Z + p * c->cols;
  double f = row[c->pivot[p]] / pivot[c->pivot[p]];
  for (int n = 0; n < c->cols; n++) row[n] -= f * pivot[n];
  row[c->pivot[p]] = 0;
}

static void massless_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  int row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int i = 0; i < PW_MASSLESS_BLOCKS; i++) {
    pw_massless_block block = c->block[a * PW_MASSLESS_BLOCKS + i];
    c->block[a * PW_MASSLESS_BLOCKS + i] = c->block[b * PW_MASSLESS_BLOCKS + i];
    c->block[b * PW_MASSLESS_BLOCKS + i] = block;
  }
  double size = c->gamma[a];
  c->gamma[a] = c->gamma[b], c->gamma[b] = size;
  for (int n = 0; n < c->cols; n++) {
    double z = c->Z[a * c->cols + n];
    c->Z[a * c->cols + n] = c->Z[b * c->cols + n];
    c->Z[b * c->cols + n] = z;
  }
}

/* Where the entries of P, K, H and Z are, for the matching found. */
static void massless_plan_copies (pw_component *c) {
  static const double zero = 0;
  c->massives = 0;
  for (int i = 0; i < c->rows; i++) {
    const pw_massless_block *block = c->block + i * PW_MASSLESS_BLOCKS;
    for (int p = 0; p < c->pivots; p++) c->from[i * c->pivots + p] = &zero;
    for (const pw_massless_block *x = block; x < block + PW_MASSLESS_BLOCKS && x->width; x++) {
      int massive = 0;
      for (int n = 0; n < x->width; n++) massive |= !c->massless[x->column + n];
      for (int p = 0; p < c->pivots; p++)
        if (c->pivot[p] >= x->column && c->pivot[p] < x->column + x->width)
          c->from[i * c->pivots + p] = x->J + c->pivot[p] - x->column;
      if (massive) c->massive[c->massives++] = (pw_massive_block){ x->J, i, c->global[x->column], x->width, x->column };
    }
    if (i < c->pivots) c->massives_h = c->massives, c->massless_j[i] = c->global[c->pivot[i]];
  }
}

/* The largest entries of the rows, into gamma. */
static void massless_measure (pw_component *c) {
  for (int i = 0; i < c->rows; i++) {
    c->gamma[i] = 0;
    for (int n = 0; n < c->cols; n++) c->gamma[i] = fmax (c->gamma[i], fabs (c->Z[i * c->cols + n]) / c->unit[n]);
  }
}

/* The p-th pivot and those after it were not found: rows have been swapped, but the plan is for their old positions.
 * Until they are matched again no pivot counts as large enough, and these are the smallest. */
static int massless_unmatched (pw_component *c, int p) {
  for (int i = 0; i < c->pivots; i++) c->least[i] = NAN;
  for (int i = p; i < c->pivots; i++) c->scale[i] = 0;
  return p;
}

/* Gaussian elimination; angles in units of length, rows scaled by their largest original entry: the remainder of
 * a dependent row is small. */
int pw_massless_match (pw_component *c) {
  const double guard = 0.1;
  massless_copy (c);
  massless_measure (c);
  for (int p = 0; p < c->pivots; p++) {
    int row = -1, column = -1;
    double best = 1e-12;
    for (int i = p; i < c->rows; i++)
      for (int n = 0; n < c->cols; n++) {
        double scaled = c->massless[n] ? fabs (c->Z[i * c->cols + n]) / c->unit[n] / c->gamma[i] : 0;
        if (scaled > best) best = scaled, row = i, column = n;
      }
    if (row < 0) return massless_unmatched (c, p);
    massless_swap (c, p, row);
    c->pivot[p] = column;
    c->scale[p] = best / fabs (c->Z[p * c->cols + column]);
    c->least[p] = guard * best;
    for (int i = p + 1; i < c->rows; i++) massless_eliminate (c, p, i);
  }
  massless_plan_copies (c);
  return c->pivots;
}
