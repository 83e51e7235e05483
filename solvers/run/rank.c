/* The rank of J, and a set of independent rows, by Gram-Schmidt; see rank.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
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
  size_t rows = (size_t)s->rows, columns = (size_t)s->coords + 1;
  *b = (pw_row_basis){ .coords = s->coords };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &b->memory);) {
    b->rows = pw_layout_alloc (&l, rows * (size_t)s->coords, sizeof *b->rows);
    b->norm = pw_layout_alloc (&l, rows, sizeof *b->norm);
    b->kept = pw_layout_alloc (&l, rows, sizeof *b->kept);
    b->active = pw_layout_alloc (&l, rows, 1);
    b->value = pw_layout_alloc (&l, s->jacobian, sizeof *b->value);
    b->column = pw_layout_alloc (&l, s->jacobian, sizeof *b->column);
    b->first = pw_layout_alloc (&l, rows + 1, sizeof *b->first);
    b->count = pw_layout_alloc (&l, columns, sizeof *b->count);
    b->sum = pw_layout_alloc (&l, columns, sizeof *b->sum);
    b->queue = pw_layout_alloc (&l, columns, sizeof *b->queue);
  }
  return b->memory ? PW_OK : PW_RESOURCE;
}

void pw_row_basis_close (pw_row_basis *b) {
  free (b->memory);
}

/* Stores the entries of all rows, of length 1. */
static void rank_read (pw_row_basis *b, const pw_workspace *w) {
  int entry = 0;
  PW_EACH_CONSTRAINT (k, w)
    for (int i = 0; i < k->b.count * k->kind->rows; i++, entry += k->b.cols) {
      double square = 0;
      b->first[k->row + i] = entry;
      for (int c = 0; c < k->b.cols; c++) {
        int j = pw_global (k, i / k->kind->rows, c), is_ground = j >= w->s->coords;
        double x = is_ground ? 0 : k->J[i * k->b.cols + c] / pw_length_factor (w->s, j);
        b->column[entry + c] = is_ground ? 0 : j, b->value[entry + c] = x;
        square += x * x;
      }
      for (int c = entry; square > 0 && c < entry + k->b.cols; c++) b->value[c] /= sqrt (square);
    }
  b->first[w->s->rows] = entry;
}

/* Takes a row out of the counts of its columns; those that it leaves to one other row are queued. */
static int rank_take (pw_row_basis *b, int i, int queued) {
  b->active[i] = 1;
  for (int c = b->first[i]; c < b->first[i + 1]; c++) {
    if (b->value[c] == 0) continue;
    b->sum[b->column[c]] -= i;
    if (--b->count[b->column[c]] == 1) b->queue[queued++] = b->column[c];
  }
  return queued;
}

/* Activates the rows that belong to every maximal independent set: those that alone have an entry in some column, then
 * those for which this holds without them, and so on.  The pins of a tree of bodies are all of this kind.  In small
 * scenes they stay in the basis, so that of the others the most independent of them, too, are selected. */
static void rank_take_private (pw_row_basis *b, const pw_system *s) {
  const double least = 1e-3; /* entry of a row of length 1: its sine with the others is at least that */
  const int is_large = pw_is_large (s);
  int queued = 0;
  memset (b->active, 0, (size_t)s->rows);
  memset (b->count, 0, (size_t)s->coords * sizeof *b->count);
  memset (b->sum, 0, (size_t)s->coords * sizeof *b->sum);
  for (int i = 0; i < s->rows; i++)
    for (int c = b->first[i]; c < b->first[i + 1]; c++)
      if (b->value[c] != 0) b->count[b->column[c]]++, b->sum[b->column[c]] += i;
  for (int j = 0; j < s->coords && is_large; j++)
    if (b->count[j] == 1) b->queue[queued++] = j;
  for (int n = 0; n < queued; n++) {
    int j = b->queue[n], i = (int)b->sum[j], c = b->first[i];
    if (b->count[j] != 1) continue;
    while (b->column[c] != j || b->value[c] == 0) c++;
    if (fabs (b->value[c]) >= least) queued = rank_take (b, i, queued);
  }
}

static double *rank_row (const pw_row_basis *b, int i) {
  return b->rows + (size_t)i * (size_t)b->coords;
}

/* Makes the rows that are not active yet dense, in the columns that they have. */
static void rank_fill (pw_row_basis *b, const pw_system *s) {
  b->rank = b->coords = 0;
  for (int j = 0; j < s->coords; j++)
    if (b->count[j] > 0) b->queue[j] = b->coords++;
  for (int i = 0; i < s->rows; i++) {
    if (b->active[i]) continue;
    memset (rank_row (b, i), 0, (size_t)b->coords * sizeof *b->rows);
    for (int c = b->first[i]; c < b->first[i + 1]; c++)
      if (b->value[c] != 0) rank_row (b, i)[b->queue[b->column[c]]] += b->value[c];
  }
}

/* Orthogonalises a row against the rows kept from number `first` on; returns its norm afterwards. */
static double rank_orthogonalise (const pw_row_basis *b, double *row, int first) {
  double square = 0;
  for (int k = first; k < b->rank; k++) {
    const double *kept = rank_row (b, b->kept[k]);
    double dot = 0;
    for (int j = 0; j < b->coords; j++) dot += row[j] * kept[j];
    for (int j = 0; j < b->coords; j++) row[j] -= dot * kept[j];
  }
  for (int j = 0; j < b->coords; j++) square += row[j] * row[j];
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
  for (int i = first; i < end; i++)
    if (!b->active[i]) b->norm[i] = rank_orthogonalise (b, rank_row (b, i), 0);
  for (int next; b->rank < max_rank && (next = rank_pivot (b, first, end)) >= 0;) {
    double *row = rank_row (b, next), norm = b->norm[next] = rank_orthogonalise (b, row, 0);
    if (b->run && pw_run_stop_opening (b->run)) return;
    if (!(norm > tol)) {
      b->norm[next] = 0;
      continue;
    }
    for (int j = 0; j < b->coords; j++) row[j] /= norm;
    b->active[next] = 1;
    b->kept[b->rank++] = next;
    for (int i = first; i < end; i++)
      if (!b->active[i] && b->norm[i] > 0) b->norm[i] = rank_orthogonalise (b, rank_row (b, i), b->rank - 1);
  }
}

int pw_row_basis_select (pw_row_basis *b, const pw_workspace *w, double tol, int max_holonomic, int max_rows) {
  const pw_system *s = w->s;
  int holonomic = 0, all = 0; /* those taken without computation */
  rank_read (b, w);
  rank_take_private (b, s);
  rank_fill (b, s);
  for (int i = 0; i < s->rows; i++) all += b->active[i], holonomic += b->active[i] && i < s->holonomic;
  rank_keep (b, tol, max_holonomic - holonomic, 0, s->holonomic);
  rank_keep (b, tol, max_rows - all, s->holonomic, s->rows);
  return all + b->rank;
}

/* The sine that measures how far the constraints are from a singular configuration; see method.h. */

/* ---- Opening ---- */

/* The index of the n-th body of element e; that of the ground is s->bodies. */
static int singular_body (const pw_system *s, const pw_element_batch *k, int e, int n) {
  int j = k->column[e * k->kind->bodies + n];
  return j < s->coords ? j / 3 : s->bodies;
}

/* 1 if a holonomic constraint connects bodies that are already connected; -1 if out of memory.  The ground is a body,
 * to which an element on one body connects it. */
static int singular_has_loops (const pw_system *s) {
  int loops = 0, *set = malloc (((size_t)s->bodies + 1) * sizeof *set);
  if (set == NULL) return -1;
  for (int b = 0; b <= s->bodies; b++) set[b] = b;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->constraints && k->row < s->holonomic; k++)
    for (int e = 0; e < k->b.count; e++) {
      int first = k->kind->bodies > 1 ? singular_body (s, k, e, 0) : s->bodies;
      for (int n = k->kind->bodies > 1; n < k->kind->bodies; n++) {
        int a = pw_root (set, first), b = pw_root (set, singular_body (s, k, e, n));
        loops |= a == b;
        set[b] = a;
      }
    }
  free (set);
  return loops;
}

/* The holonomic rows of a tree of bodies cannot become dependent, whatever its configuration. */
int pw_watchdog_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  pw_watchdog *watch = &r->watchdog;
  watch->loops = singular_has_loops (s);
  if (watch->loops < 0) return pw_fail_memory (s, error);
  if (watch->loops == 0 && s->rows == s->holonomic) return PW_OK;
  pw_saddle_close (watch->saddle);
  pw_length_weights (s, r->scratch);
  watch->saddle = pw_saddle_open (r->w, r->scratch, s->rows, r->active, error);
  return watch->saddle ? PW_OK : PW_RESOURCE;
}

/* ---- Sines ---- */

double pw_watchdog_sine (pw_run *r, int *row) {
  pw_saddle *saddle = r->watchdog.saddle;
  if (row) *row = -1;
  if (saddle == NULL) return 1;
  int status = pw_saddle_factor (saddle);
  double sine = pw_saddle_sine (saddle, row);
  return status == PW_OK ? sine : 0;
}

int pw_watchdog_near (pw_run *r) {
  pw_watchdog *watch = &r->watchdog;
  if (!watch->singular_ahead || watch->saddle == NULL) return 0;
  if (!r->fixed_steps && !pw_saddle_sine_below (r->saddle, r->thresholds.refine)) return 0;
  watch->evaluated_sine = pw_watchdog_sine (r, NULL);
  return watch->evaluated_sine < r->thresholds.near * watch->largest_sine;
}

int pw_fail_singular (pw_run *r, double t, pw_error *error) {
  int row = -1;
  double sine = pw_watchdog_sine (r, &row);
  /* largest_sine is 0 while the run is being opened */
  if (sine > r->thresholds.rank_refused && sine > r->thresholds.near * r->watchdog.largest_sine)
    return pw_fail (
        error, PW_METHOD,
        "t = %.6g s: values too extreme: masses and inertias differ by so much that the equations of motion "
        "cannot be solved; the configuration is not singular",
        t);
  const char *name = row >= 0 ? PW_NAME (pw_system_row_name, r->s, row) : "a constraint";
  if (sine <= r->thresholds.rank_lost)
    return pw_fail (error, PW_METHOD, "t = %.6g s: singular configuration: %s depends on other constraints", t, name);
  return pw_fail (
      error, PW_METHOD,
      "t = %.6g s: near a singular configuration: %s nearly depends on other constraints (sine %.2g); the next "
      "step cannot be computed",
      t, name, sine);
}

int pw_watchdog_near_state (pw_run *r) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  pw_saddle_factor (r->saddle);
  r->watchdog.singular_ahead = 1;
  return pw_watchdog_near (r);
}

int pw_watchdog_check_values (const pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  const double extreme = r->thresholds.extreme;
  for (int i = 0; i < 2 * s->coords; i++) {
    double value = i < s->coords ? r->q[i] : r->v[i - s->coords];
    if (!(fabs (value) < extreme))
      return pw_fail (error, PW_INPUT,
                      "model %s: values too extreme: %s is initially %g: expected a magnitude below %g", s->model,
                      PW_NAME (pw_system_state_name, s, i), value, extreme);
  }
  for (int j = 0; s->rows > 0 && j < s->coords; j++) {
    double unit = pw_length_factor (s, j) * pw_length_factor (s, j), mass = s->mass[j] / unit;
    if (mass != 0 && !(mass < extreme && mass > 1 / extreme))
      return pw_fail (
          error, PW_INPUT,
          "model %s: values too extreme: the mass or inertia that goes with %s is %g: expected 0, or %g to %g",
          s->model, PW_NAME (pw_system_state_name, s, j), s->mass[j], unit / extreme, unit * extreme);
  }
  return PW_OK;
}
