/* Assembly of J and second-order blocks into sparse matrices; see newton.h. */
#include <stdlib.h>
#include "newton.h"

int pw_newton_open (pw_newton_scratch *n, const pw_system *s) {
  size_t block_size = 1, direction_size = 1;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    const size_t columns = (size_t)k->b.count * (size_t)k->b.cols,
                 widths[] = { (size_t)k->b.cols, (size_t)k->kind->rows, (size_t)k->kind->signals }; /* last: force_u */
    if (columns > direction_size) direction_size = columns;
    for (int i = 0; i < 3; i++)
      if (columns * widths[i] > block_size) block_size = columns * widths[i];
  }
  n->block = malloc ((block_size + direction_size) * sizeof *n->block);
  n->direction = n->block ? n->block + block_size : NULL;
  return n->block ? PW_OK : PW_RESOURCE;
}

void pw_newton_close (pw_newton_scratch *n) {
  free (n->block);
}

/* Copies the entries of a vector of coordinates that belong to the columns of each element; 0 for the ground. */
static void newton_gather (const pw_system *s, const pw_element_batch *k, const double *vector, double *local) {
  for (int e = 0; e < k->b.count; e++)
    for (int c = 0; c < k->b.cols; c++) {
      int j = pw_global (k, e, c);
      *local++ = j < s->coords ? vector[j] : 0;
    }
}

/* What a batch adds: its rows of J, or their transpose; blocks whose rows are its constraint equations, or its
 * coordinates. */
typedef enum { NEWTON_J, NEWTON_JT, NEWTON_EQUATIONS, NEWTON_COORDINATES } newton_part;

/* 1 for a column of x or y, 0 for one of an angle. */
static inline int newton_is_length (int c) {
  return c % 3 != 2;
}

/* 1 for an entry of a pin that is always zero: in columns of x and y its rows of J are constant, multiples of unit
 * vectors, so that their derivatives are in columns of angles only, and those of J^T lambda in rows of angles only. */
static inline int newton_is_zero (newton_part part, int r, int c) {
  if (part == NEWTON_J || part == NEWTON_JT) return newton_is_length (c) && c % 3 == 1 - r;
  return newton_is_length (c) || (part == NEWTON_COORDINATES && newton_is_length (r));
}

/* Adds the values of a batch, rows x columns of each element. */
static void newton_add (const pw_system *s, const pw_element_batch *k, newton_part part, const double *value,
                        pw_scatter_map *t, const pw_placement *put) {
  const int of_coordinates = part == NEWTON_COORDINATES, rows = of_coordinates ? k->b.cols : k->kind->rows,
            transposed = part == NEWTON_JT, is_pin = k->kind == &pw_kind_pin;
  const double factor = !of_coordinates && k->row >= s->holonomic ? put->factor_nonholonomic : put->factor;
  for (int e = 0; e < k->b.count; e++)
    for (int r = 0; r < rows; r++) {
      int i = of_coordinates ? pw_global (k, e, r) : k->row + e * rows + r;
      if (!of_coordinates && put->row_index) i = put->row_index[i];
      for (int c = 0; c < k->b.cols; c++, value++) {
        int j = pw_global (k, e, c), row = transposed ? j : i;
        if (j >= s->coords || i < 0 || (of_coordinates && i >= s->coords)) continue;
        if (is_pin && newton_is_zero (part, r, c)) continue;
        double scale = put->row_scale ? put->row_scale[row] : 1;
        pw_scatter_add (t, put->row + row, put->col + (transposed ? i : j), t->recording ? 0 : factor * *value * scale);
      }
    }
}

void pw_newton_add_block (pw_newton_scratch *n, pw_workspace *w, pw_scatter_map *t, pw_block block,
                          const pw_placement *put) {
  const pw_system *s = w->s;
  for (pw_element_batch *k = w->batch; k < w->batch + s->batches; k++) {
    int of_equations = block == PW_JW_Q || block == PW_ETA_Q || block == PW_GAMMA_Q || block == PW_GAMMA_V;
    if ((of_equations || block == PW_JTL_Q) && (k->kind->rows == 0 || k->row >= put->rows)) continue;
    if (pw_block_function (k->kind, block) == NULL) continue;
    if (put->direction) newton_gather (s, k, put->direction, n->direction);
    k->b.w = n->direction;
    k->b.lambda = put->lambda ? put->lambda + k->row : NULL;
    if (!t->recording) pw_evaluate_block (w, k, block, n->block);
    newton_add (s, k, of_equations ? NEWTON_EQUATIONS : NEWTON_COORDINATES, n->block, t, put);
  }
}

static void newton_add_J (const pw_workspace *w, pw_scatter_map *t, newton_part part, const pw_placement *put) {
  const pw_system *s = w->s;
  for (const pw_element_batch *k = w->batch; k < w->batch + s->constraints && k->row < put->rows; k++)
    newton_add (s, k, part, k->J, t, put);
}

void pw_newton_add_J (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put) {
  newton_add_J (w, t, NEWTON_J, put);
}

void pw_newton_add_JT (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put) {
  newton_add_J (w, t, NEWTON_JT, put);
}

void pw_newton_add_signals (pw_newton_scratch *n, pw_workspace *w, pw_scatter_map *t, int row, int col_q, int col_v) {
  const pw_system *s = w->s;
  for (pw_element_batch *k = w->batch; s->state_dependent > 0 && k < w->batch + s->batches; k++) {
    int signals = k->kind->signals, cols = k->b.cols;
    if (signals == 0 || k->kind->force_u == NULL) continue;
    if (!t->recording) k->kind->force_u (&k->b, n->block);
    for (int e = 0; e < k->b.count; e++)
      for (int u = 0; u < signals; u++) {
        const pw_source *source = &k->source[e * signals + u];
        for (int read = 0; read < source->reads; read++) { /* source->x: values of the states read, derivatives */
          int j = source->state[read], col = j < s->coords ? col_q + j : col_v + j - s->coords;
          double slope = source->x[source->reads + read];
          for (int c = 0; c < cols; c++) {
            int i = pw_global (k, e, c);
            if (i >= s->coords) continue;
            pw_scatter_add (t, row + i, col, t->recording ? 0 : -n->block[(e * cols + c) * signals + u] * slope);
          }
        }
      }
  }
}
