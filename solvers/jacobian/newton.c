/* Assembly of second-order blocks into sparse matrices; see newton.h. */
#include <stdlib.h>
#include "newton.h"

int pw_newton_open (pw_newton *n, const pw_system *s) {
  size_t block = 1, w = 1;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    size_t cols = (size_t)k->b.cols, rows = cols > (size_t)k->kind->rows ? cols : (size_t)k->kind->rows;
    size_t count = (size_t)k->b.count;
    if (count * rows * cols > block) block = count * rows * cols;
    if (count * cols * PW_MAX_SIGNALS > block) block = count * cols * PW_MAX_SIGNALS;
    if (count * cols > w) w = count * cols;
  }
  n->block = malloc (block * sizeof *n->block);
  n->w = malloc (w * sizeof *n->w);
  if (n->block && n->w) return PW_OK;
  pw_newton_close (n);
  return PW_RESOURCE;
}

void pw_newton_close (pw_newton *n) {
  free (n->block);
  free (n->w);
  n->block = n->w = NULL;
}

static void newton_gather (const pw_system *s, const pw_element_batch *k, const double *w, double *local) {
  for (int e = 0; e < k->b.count; e++)
    for (int c = 0; c < k->b.cols; c++) {
      int j = pw_global (k, e, c);
      *local++ = j < s->coords ? w[j] : 0;
    }
}

/* Row of the matrix for a constraint equation. */
static inline int newton_row (const pw_placement *put, int row) {
  return put->map ? put->map[row] : row;
}

/* A pin's second-order blocks are zero in x and y columns, where its rows of J are unit vectors. */
static int newton_is_pin (const pw_kind *kind) {
  return kind == &pw_kind_pin;
}

static inline int newton_is_length (const pw_kind *kind, int c) {
  return c < 3 * kind->bodies && c % 3 != 2;
}

void pw_newton_block (pw_newton *n, pw_workspace *w, pw_scatter_map *t, pw_block block, const pw_placement *put) {
  const pw_system *s = w->s;
  for (pw_element_batch *k = w->batch; k < w->batch + s->batches; k++) {
    int rows = pw_block_rows (k->kind, block), cols = k->b.cols;
    int of_rows = block == PW_JW_Q || block == PW_ETA_Q || block == PW_GAMMA_Q || block == PW_GAMMA_V;
    int constraint = of_rows || block == PW_JTL_Q;
    if (constraint && (k->kind->rows == 0 || k->row >= put->rows)) continue;
    if (pw_block_function (k->kind, block) == NULL) continue;
    if (put->w) newton_gather (s, k, put->w, n->w);
    k->b.w = n->w;
    k->b.lambda = put->lambda ? put->lambda + k->row : NULL;
    if (!t->recording) pw_evaluate_block (w, k, block, n->block);
    const double *value = n->block;
    double factor = of_rows && k->row >= s->holonomic ? put->factor_nonholonomic : put->factor;
    int angles = constraint && newton_is_pin (k->kind);
    for (int e = 0; e < k->b.count; e++)
      for (int r = 0; r < rows; r++) {
        if (angles && !of_rows && newton_is_length (k->kind, r)) {
          value += cols;
          continue;
        }
        int i = of_rows ? newton_row (put, k->row + e * rows + r) : pw_global (k, e, r);
        double scaled = put->row_scale && !of_rows && i < s->coords ? factor * put->row_scale[i] : factor;
        for (int c = 0; c < cols; c++, value++) {
          int j = pw_global (k, e, c);
          if (j >= s->coords || i < 0 || (!of_rows && i >= s->coords)) continue;
          if (angles && newton_is_length (k->kind, c)) continue;
          pw_scatter_add (t, put->row + i, put->col + j, t->recording ? 0 : scaled * *value);
        }
      }
  }
}

/* Adds all entries of J, or of its transpose. */
static void newton_J (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put, int transposed) {
  const pw_system *s = w->s;
  for (const pw_element_batch *k = w->batch; k < w->batch + s->batches && k->kind->rows > 0 && k->row < put->rows;
       k++) {
    const double *value = k->J;
    double factor = k->row >= s->holonomic ? put->factor_nonholonomic : put->factor;
    int pin = newton_is_pin (k->kind);
    for (int e = 0; e < k->b.count; e++)
      for (int r = 0; r < k->kind->rows; r++) {
        int i = newton_row (put, k->row + e * k->kind->rows + r);
        for (int c = 0; c < k->b.cols; c++, value++) {
          int j = pw_global (k, e, c);
          if (j >= s->coords || i < 0 || (pin && newton_is_length (k->kind, c) && c % 3 == 1 - r)) continue;
          if (transposed)
            pw_scatter_add (t, put->row + j, put->col + i, factor * *value * (put->row_scale ? put->row_scale[j] : 1));
          else
            pw_scatter_add (t, put->row + i, put->col + j, factor * *value);
        }
      }
  }
}

void pw_newton_J (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put) {
  newton_J (w, t, put, 0);
}

void pw_newton_JT (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put) {
  newton_J (w, t, put, 1);
}

void pw_newton_signals (pw_newton *n, pw_workspace *w, pw_scatter_map *t, int row, int col, int col_v) {
  const pw_system *s = w->s;
  for (pw_element_batch *k = w->batch; s->state_dependent > 0 && k < w->batch + s->batches; k++) {
    int signals = k->kind->signals, cols = k->b.cols;
    if (signals == 0 || k->kind->force_u == NULL) continue;
    if (!t->recording) k->kind->force_u (&k->b, n->block);
    for (int e = 0; e < k->b.count; e++)
      for (int u = 0; u < signals; u++) {
        const pw_source *source = &k->source[e * signals + u];
        for (int x = 0; x < source->reads; x++) {
          int j = source->state[x], to = j < s->coords ? col + j : col_v + j - s->coords;
          for (int c = 0; c < cols; c++) {
            int i = pw_global (k, e, c);
            if (i >= s->coords) continue;
            pw_scatter_add (t, row + i, to,
                            t->recording ? 0 : -n->block[(e * cols + c) * signals + u] * source->x[source->reads + x]);
          }
        }
      }
  }
}
