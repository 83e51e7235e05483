/* The rank of J, and sets of independent rows, by Gram-Schmidt; the independent constraint equations that a run
 * enforces by them, and the redundant ones, which are only monitored, as combinations of these.
 *
 * The rank is computed at the initial configuration and at up to three a short motion away.  During the motion the set
 * may become ill-conditioned while another one is not; then that is selected.  (Garcia de Jalon & Gutierrez-Lopez 2013,
 * Multibody dynamics with redundant constraints and singular mass matrix.) */
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

void pw_list_elements (const pw_system *s, const unsigned char *which, int wanted, char *list, size_t size) {
  char element[PW_NAME_BYTES], previous[PW_NAME_BYTES] = "";
  int named = 0, more = 0;
  *list = 0;
  for (int i = 0; i < s->rows; i++) {
    size_t length = strlen (list);
    if (which[i] != wanted || strcmp (pw_system_row_name (s, i, element, sizeof element), previous) == 0) continue;
    strcpy (previous, element);
    if (named < 4 && length + strlen (element) + 16 < size)
      named++, snprintf (list + length, size - length, "%s%s", length ? ", " : "", element);
    else
      more++;
  }
  size_t length = strlen (list);
  if (more > 0) snprintf (list + length, size - length, "%s%d more", length ? " and " : "", more);
}

double pw_rank_norm (const pw_workspace *w, int row) {
  int e;
  const double *J;
  double square = 0;
  const pw_element_batch *k = pw_find_row (w, row, &e, &J);
  for (int c = 0; c < k->b.cols; c++) {
    int j = pw_global (k, e, c);
    double x = j < w->s->coords ? J[c] / pw_length_factor (w->s, j) : 0;
    square += x * x;
  }
  return sqrt (square);
}

void pw_rank_rows (const pw_workspace *w, double *rows, double *norm) {
  const pw_system *s = w->s;
  int n = s->coords, e;
  const double *J;
  memset (rows, 0, (size_t)s->rows * (size_t)n * sizeof *rows);
  for (int i = 0; i < s->rows; i++, rows += n) {
    const pw_element_batch *k = pw_find_row (w, i, &e, &J);
    const double length = pw_rank_norm (w, i);
    for (int c = 0; c < k->b.cols && length > 0; c++) {
      int j = pw_global (k, e, c);
      if (j < n) rows[j] += J[c] / pw_length_factor (s, j) / length;
    }
    if (norm) norm[i] = length;
  }
}

/* Independent rows of J.  Those that belong to every maximal independent set are found by their pattern; of the others,
 * an orthonormal basis is kept. */
typedef struct {
  struct pw_run *run;    /* whose settings.stop ends the selection (r->stopped), or NULL */
  unsigned char *active; /* rows: 1 for the independent ones */
  int rank;              /* number of rows in the basis */
  int *kept;             /* rank: their indices */
  double *rows;          /* rows x coords: those kept are the basis, the others scratch */
  double *norm;          /* rows: scratch */
  int coords;            /* columns in which the others have entries */
  int *first, *column;   /* rows + 1: the first entry of each row; column of each entry of J */
  double *value;         /* of these entries */
  int *count, *queue;    /* columns: number of remaining rows with an entry; scratch */
  long *sum;             /* columns: sum of the indices of these rows */
  char *memory;
} rank_basis;

static int rank_open (rank_basis *b, const pw_system *s) {
  size_t rows = (size_t)s->rows, columns = (size_t)s->coords + 1;
  *b = (rank_basis){ .coords = s->coords };
  b->memory = PW_ALLOC_ARRAYS (PW_ARRAY (b->rows, rows * (size_t)s->coords), PW_ARRAY (b->norm, rows),
                               PW_ARRAY (b->kept, rows), PW_ARRAY (b->active, rows), PW_ARRAY (b->value, s->jacobian),
                               PW_ARRAY (b->column, s->jacobian), PW_ARRAY (b->first, rows + 1),
                               PW_ARRAY (b->count, columns), PW_ARRAY (b->sum, columns), PW_ARRAY (b->queue, columns));
  return b->memory ? PW_OK : PW_RESOURCE;
}

/* Stores the entries of all rows, of length 1. */
static void rank_read (rank_basis *b, const pw_workspace *w) {
  int entry = 0;
  for (int i = 0, e; i < w->s->rows; i++) {
    const double *J, length = pw_rank_norm (w, i);
    const pw_element_batch *k = pw_find_row (w, i, &e, &J);
    b->first[i] = entry;
    for (int c = 0; c < k->b.cols; c++, entry++) {
      int j = pw_global (k, e, c), is_empty = j >= w->s->coords || length == 0;
      b->column[entry] = is_empty ? 0 : j;
      b->value[entry] = is_empty ? 0 : J[c] / pw_length_factor (w->s, j) / length;
    }
  }
  b->first[w->s->rows] = entry;
}

/* Activates the rows that belong to every maximal independent set: those that alone have an entry in some column, then
 * those for which this holds without them, and so on.  The pins of a tree of bodies are all of this kind.  In small
 * scenes they stay in the basis, so that of the others the most independent of them, too, are selected. */
static void rank_take_private (rank_basis *b, const pw_system *s) {
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
    if (!(fabs (b->value[c]) >= least)) continue;
    b->active[i] = 1; /* out of the counts of its columns; those that it leaves to one other row are queued */
    for (c = b->first[i]; c < b->first[i + 1]; c++) {
      if (b->value[c] == 0) continue;
      b->sum[b->column[c]] -= i;
      if (--b->count[b->column[c]] == 1) b->queue[queued++] = b->column[c];
    }
  }
}

static double *rank_row (const rank_basis *b, int i) {
  return b->rows + (size_t)i * (size_t)b->coords;
}

/* Makes the rows that are not active yet dense, in the columns that they have. */
static void rank_fill (rank_basis *b, const pw_system *s) {
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
static double rank_orthogonalise (const rank_basis *b, double *row, int first) {
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
static int rank_pivot (const rank_basis *b, int first, int end) {
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
static void rank_keep (rank_basis *b, double tol, int max_rank, int first, int end) {
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

/* Selects at most `max_holonomic` holonomic equations, and at most `max_rows` in all, by Gram-Schmidt on the J last
 * evaluated, rows of length 1: those of which a part longer than tol is independent of the ones kept before.  Holonomic
 * equations come first, since a nonholonomic one must not replace a holonomic one; of each kind the most independent
 * ones, in order where they are about equal.  Returns the rank. */
static int rank_select (rank_basis *b, const pw_workspace *w, double tol, int max_holonomic, int max_rows) {
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

/* A redundant row of J is J_i = sum_a c_ia J_a over active rows a.  Its coefficients come from the saddle-point system:
 * with f = J_i^T and gamma = 0 the multipliers are c_i.  The vectors n_i = e_i - sum_a c_ia e_a, with unit vectors e,
 * span the multipliers without force, J^T n_i = 0, so the least-norm ones are lambda + N z, N = [n_1 n_2 ...], with z
 * from a least-squares problem.  N is not stored: products with it take a solution of the saddle-point system. */

double pw_rank_multiplier_unit (const pw_workspace *w, int row) {
  int e;
  const double *J;
  const pw_element_batch *k = pw_find_row (w, row, &e, &J);
  for (int b = 0; b < k->kind->bodies; b++)
    if (J[3 * b] != 0 || J[3 * b + 1] != 0) return 1;
  return w->scale.length;
}

/* f += weight J_i^T */
static void redundancy_add_row (const pw_workspace *w, int row, double weight, double *f) {
  int e;
  const double *J;
  const pw_element_batch *k = pw_find_row (w, row, &e, &J);
  for (int c = 0; c < k->b.cols; c++) f[pw_global (k, e, c)] += weight * J[c];
}

/* Solves r->row_force = J^T c for the multipliers c and clears the force. */
static void redundancy_solve (pw_run *r, double *c) {
  memset (c, 0, (size_t)r->s->rows * sizeof *c);
  pw_saddle_solve (r->saddle, r->row_force, c, r->row_force, c);
  memset (r->row_force, 0, (size_t)r->s->coords * sizeof *r->row_force);
}

/* One solution, for a sum of all redundant rows; their weights are irregular so that terms do not cancel. */
double pw_rank_independence (pw_run *r) {
  double *c = r->coefficient /* overwritten: each user computes it first */, most = 0;
  for (int i = 0; i < r->redundant; i++) {
    int row = r->redundant_row[i];
    double x = pw_irregular (0, row + 1), norm = pw_rank_norm (r->w, row);
    double weight = (x + copysign (1, x)) / 2; /* of modulus 1/2 to 1 */
    if (norm > 0) redundancy_add_row (r->w, row, weight / norm, r->row_force);
  }
  redundancy_solve (r, c);
  for (int row = 0; row < r->s->rows; row++)
    if (r->active[row]) most = pw_larger_or_nan (most, fabs (c[row]) * pw_rank_norm (r->w, row));
  return isnan (most) ? 0 : 1 / most;
}

/* sum x_i y_i scale_i, or with inverse = 1 sum x_i y_i / scale_i */
static double redundancy_product (const pw_run *r, const double *x, const double *y, const double *square,
                                  int inverse) {
  double sum = 0;
  for (int i = 0; i < r->s->rows; i++) sum += inverse ? x[i] * y[i] / square[i] : x[i] * y[i] * square[i];
  return sum;
}

/* Minimises sum (lambda / unit)^2 by conjugate gradients (CGLS: Bjorck 1996, Numerical Methods for Least Squares
 * Problems, section 7.4), with multipliers in these units: then the slope is at least the distance to the minimum.
 * There are as many different eigenvalues as redundant rows, or as active rows and one, at most. */
void pw_rank_least_norm (pw_run *r, double *lambda) {
  const double accepted = 1e-14;
  const int rows = r->s->rows, most = r->redundant < rows - r->redundant ? r->redundant : rows - r->redundant + 1;
  double *x = r->coefficient, *square = x + rows, *slope = square + rows, *z = slope + rows, *change = z + rows,
         *a = r->row_force, before = 0;
  for (int i = 0; i < rows; i++) square[i] = pow (pw_rank_multiplier_unit (r->w, i), 2), z[i] = 0;
  for (int n = 0; n <= most; n++) {
    /* slope = -N^T (lambda / square), without entries for active rows; (c_i, x) = J_i a with J_a a = x */
    for (int i = 0; i < rows; i++) x[i] = r->active[i] ? lambda[i] / square[i] : 0;
    pw_saddle_solve (r->saddle, NULL, x, a, x);
    pw_mul_J (r->w, a, slope);
    for (int i = 0; i < rows; i++) slope[i] = r->active[i] ? 0 : slope[i] - lambda[i] / square[i];
    memset (a, 0, (size_t)r->s->coords * sizeof *a);
    double now = redundancy_product (r, slope, slope, square, 0);
    if (now <= accepted * accepted * redundancy_product (r, lambda, lambda, square, 1)) return;
    for (int i = 0; i < rows; i++) z[i] = slope[i] * square[i] + (n > 0 ? now / before * z[i] : 0);
    pw_add_JT (r->w, z, a);
    redundancy_solve (r, x);
    for (int i = 0; i < rows; i++) change[i] = z[i] - x[i]; /* N z; z has entries for redundant rows only */
    double length = now / redundancy_product (r, change, change, square, 1);
    for (int i = 0; i < rows; i++) lambda[i] += length * change[i];
    before = now;
  }
}

/* The common direction of two reactions "ELEMENT.N" or the like: "lateral ", or "". */
static const char *redundancy_direction (const char *one, const char *two) {
  static const struct {
    const char *reaction, *direction;
  } known[] = { { "N", "lateral " }, { "T", "rolling " }, { "Fx", "x " }, { "Fy", "y " }, { "M", "angular " } };
  const char *a = strrchr (one, '.') + 1, *b = strrchr (two, '.') + 1;
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (strcmp (a, known[i].reaction) == 0 && strcmp (b, known[i].reaction) == 0) return known[i].direction;
  return "";
}

/* Describes two rows that are multiples of each other: "wheels left and right: the same lateral constraint". */
static void redundancy_describe_pair (const pw_system *s, int one, int two, char *buffer, size_t size) {
  const char *a = PW_NAME (pw_system_row_name, s, one), *b = PW_NAME (pw_system_row_name, s, two);
  const char *reaction_a = PW_NAME (pw_system_reaction_name, s, one);
  const char *reaction_b = PW_NAME (pw_system_reaction_name, s, two);
  const char *direction = redundancy_direction (reaction_a, reaction_b);
  size_t kind = strcspn (a, " "); /* length of the element's type, with which its name begins */
  if (strcmp (a, b) == 0)
    snprintf (buffer, size, "%s: %s and %s are the same constraint", a, reaction_a, reaction_b);
  else if (kind == strcspn (b, " ") && strncmp (a, b, kind) == 0)
    snprintf (buffer, size, "%.*ss%s and%s: the same %sconstraint", (int)kind, a, a + kind, b + kind, direction);
  else
    snprintf (buffer, size, "%s and %s: the same %sconstraint", a, b, direction);
}

char *pw_run_redundancy (pw_run *r, int i, char *buffer, size_t size) {
  enum { MAX_ELEMENTS = 6 };
  const double round_off = 1e-8; /* of c between rows of norm 1: eps / sine^2, if active rows have sines above 1.5e-4 */
  const pw_system *s = r->s;
  if (i < 0 || i >= r->redundant) return snprintf (buffer, size, "%s", ""), buffer;
  int row = r->redundant_row[i], partners = 0, last = -1, elements = 0;
  char before[PW_NAME_BYTES] = "";
  const char *own = PW_NAME (pw_system_row_name, s, row);
  snprintf (buffer, size, "%s (%s)", own, PW_NAME (pw_system_reaction_name, s, row));
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return buffer;
  if (pw_saddle_factor (r->saddle) != PW_OK) return buffer;
  redundancy_add_row (r->w, row, 1, r->row_force);
  redundancy_solve (r, r->coefficient);
  const double *c = r->coefficient, least = round_off * pw_rank_norm (r->w, row);
  for (int a = 0; a < s->rows; a++) {
    if (c[a] == 0 || fabs (c[a]) * pw_rank_norm (r->w, a) <= least) continue;
    partners++, last = a;
    const char *element = PW_NAME (pw_system_row_name, s, a);
    if (elements > MAX_ELEMENTS || strcmp (element, own) == 0 || strcmp (element, before) == 0) continue;
    strcpy (before, element);
    const size_t n = strlen (buffer);
    snprintf (buffer + n, size - n, "%s%s",
              elements == MAX_ELEMENTS ? " and others"
              : elements > 0           ? ", "
                                       : " follows from ",
              elements < MAX_ELEMENTS ? element : "");
    elements++;
  }
  const char *other = partners == 0 ? " has no effect in this configuration"
                      : elements    ? ""
                                    : " follows from its other equations";
  if (partners != 1) strncat (buffer, other, size - strlen (buffer) - 1);
  if (partners == 1) redundancy_describe_pair (s, last, row, buffer, size);
  return buffer;
}

/* The number of configurations nearby, and their distance in units of L and rad: far enough for sines well above the
 * threshold `independent`, near enough for the projection to converge. */
enum { INDEPENDENT_NEARBY = 3 };
static const double INDEPENDENT_MOTION = 0.03;

static int independent_rank (const pw_run *r, rank_basis *b, double sine) {
  return rank_select (b, r->w, sine, r->s->rows, r->s->rows);
}

/* The rank at the initial configuration, where equations with smaller sines than a run accepts are dependent: a
 * configuration in which an equation has a double root is known to the root of its residual only. */
static int independent_rank_initially (const pw_run *r, rank_basis *b) {
  return independent_rank (r, b, fmax (r->thresholds.independent, r->thresholds.rank_lost));
}

/* The n-th direction that the constraints allow, of largest component 1 in units of the scene: along the velocities
 * (n = 0), or an arbitrary one.  p->velocity: with the metric of lengths. */
static int independent_direction (const pw_projector *p, pw_run *r, int n, double *direction) {
  const pw_system *s = r->s;
  double most = 0;
  for (int j = 0; j < s->coords; j++)
    direction[j] = n == 0 ? r->v[j] : pw_irregular (1.7, (j + 1) * n) / pw_length_factor (s, j);
  if (pw_saddle_factor (p->velocity) != PW_OK) return PW_RETRY;
  pw_project_error (r, p->velocity, direction, s->rows);
  for (int j = 0; j < s->coords; j++) most = fmax (most, fabs (direction[j]) * pw_length_factor (s, j));
  for (int j = 0; most > 0 && j < s->coords; j++) direction[j] *= s->scale.length / most;
  return PW_OK;
}

/* Selects anew, among the equations that exceed a sine, at the projection of q onto those selected in the basis.
 * n >= 0: q is set to a short motion in the n-th direction first.  Returns the rank; 0 if that fails, or unless
 * `ignores_others`, if another position equation is violated there. */
static int independent_rank_at (pw_run *r, rank_basis *b, int n, double *q, double sine, int ignores_others) {
  const pw_system *s = r->s;
  pw_projector p;
  pw_error unused = { 0 };
  int rank = 0, status = PW_OK;
  const unsigned char *former = r->active;
  r->active = b->active;
  if (n >= 0) pw_length_weights (s, q);
  if (pw_projector_open (&p, r, s->metric, n >= 0 ? q : NULL, &unused) == PW_OK) {
    p.ignores_inactive = ignores_others;
    if (n >= 0) {
      status = independent_direction (&p, r, n, q);
      for (int j = 0; j < s->coords; j++) q[j] = r->q[j] + INDEPENDENT_MOTION * q[j];
    }
    if (status == PW_OK && pw_project_positions (&p, r, r->t, q, r->v) == PW_OK) rank = independent_rank (r, b, sine);
    pw_projector_close (&p);
  }
  r->active = former;
  return rank;
}

/* The rank after a short motion in the n-th direction to q, where the initially redundant equations may be violated; 0
 * if the others are not satisfied there. */
static int independent_rank_nearby (pw_run *r, rank_basis *b, int n, double *q) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  independent_rank_initially (r, b);
  return independent_rank_at (r, b, n, q, r->thresholds.independent, 1);
}

/* Makes these rows the run's active ones and lists the others. */
static void independent_activate (pw_run *r, const unsigned char *active) {
  const pw_system *s = r->s;
  r->active = memmove (r->active_array, active, (size_t)s->rows);
  r->redundant = r->redundant_drive = 0;
  PW_EACH_CONSTRAINT (k, r->w)
    for (int i = k->row; i < k->row + k->b.count * k->kind->rows; i++) {
      if (active[i]) continue;
      r->redundant_row[r->redundant++] = i;
      r->redundant_drive |= k->kind->eta != NULL;
    }
}

/* Allocates what the run needs for its redundant rows, `redundant` in number, and activates the others. */
static int independent_store (pw_run *r, const unsigned char *active, size_t redundant) {
  const int rows = r->s->rows;
  if (!PW_ARENA_ARRAYS (&r->arena, PW_ARRAY (r->active_array, rows), PW_ARRAY (r->redundant_row, redundant),
                        PW_ARRAY (r->coefficient, 5 * rows), PW_ARRAY (r->row_force, r->s->coords + 3),
                        PW_ARRAY (r->least_norm, rows)))
    return PW_RESOURCE;
  independent_activate (r, active);
  return PW_OK;
}

/* 1 if a motion in one of the directions leads to a consistent configuration of a higher rank, where a run can begin.
 * Sines must exceed those at a double root. */
static int independent_is_regular_nearby (pw_run *r, rank_basis *b, int rank, double *q) {
  for (int n = 0; n < INDEPENDENT_NEARBY; n++)
    if (independent_rank_nearby (r, b, n, q) > rank &&
        independent_rank_at (r, b, -1, q, r->thresholds.rank_refused, 0) > rank)
      return 1;
  return 0;
}

/* The coordinate, rather an angle than a length, in which the most nearly dependent equation of the basis changes most
 * when all others hold. */
static int independent_changed (const pw_system *s, const rank_basis *b) {
  int weakest = b->rank > 0 ? b->kept[0] : 0, changed = 0;
  double most = -1;
  for (int k = 0; k < b->rank; k++)
    if (b->norm[b->kept[k]] < b->norm[weakest]) weakest = b->kept[k];
  for (int j = 0; j < s->coords && b->rank > 0; j++) {
    double entry = b->count[j] > 0 ? b->rows[(size_t)weakest * (size_t)b->coords + (size_t)b->queue[j]] : 0;
    double change = fabs (entry) * (pw_is_angle (s, j) ? 2 : 1);
    if (change > most) most = change, changed = j;
  }
  return changed;
}

/* The number, among the redundant equations, of the one with the largest residual at q; if none is violated there, of
 * the first that is independent there. */
static int independent_singular_row (pw_run *r, const double *q, const unsigned char *independent) {
  const pw_system *s = r->s;
  double *g = r->scratch, *size = g + s->rows, residual = r->thresholds.redundant_residual;
  int found = -1;
  (void)pw_update_kinematics (r->w, r->t, q, r->v);
  pw_evaluate_g (r->w, g);
  pw_evaluate_g_size (r->w, size);
  for (int i = 0; i < r->redundant; i++) {
    int row = r->redundant_row[i];
    if (found < 0 && independent[row]) found = i;
    if (row < s->holonomic && fabs (g[row]) / size[row] > residual) found = i, residual = fabs (g[row]) / size[row];
  }
  return found < 0 ? 0 : found;
}

/* Reports that the rank is higher after a motion in the n-th direction than initially: either a run can begin nearby,
 * or an equation forbids the motion, although it does not restrict velocities. */
static int independent_fail (pw_run *r, rank_basis *b, int rank, int n, double *q, pw_error *error) {
  const pw_system *s = r->s;
  unsigned char *nearby = (unsigned char *)(q + s->coords);
  char equation[250];
  pw_error why = { 0 };
  int regular = independent_is_regular_nearby (r, b, rank, q);
  (void)independent_rank_nearby (r, b, n, q);
  memcpy (nearby, b->active, (size_t)s->rows);
  const char *state = PW_NAME (pw_system_state_name, s, independent_changed (s, b));
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  independent_rank_initially (r, b);
  if (independent_store (r, b->active, (size_t)(s->rows - rank)) != PW_OK) return pw_fail_memory (s, error);
  int i = independent_singular_row (r, q, nearby);
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  pw_saddle_close (r->saddle);
  r->saddle = pw_saddle_open (r->w, s->mass, s->rows, r->active, &why);
  if (r->saddle == NULL) return pw_fail (error, why.status, "%s", why.text);
  pw_run_redundancy (r, i, equation, sizeof equation);
  r->w->failed = NULL;
  if (regular)
    return pw_fail (error, PW_INITIAL,
                    "model %s: the initial configuration is singular: %s, but not nearby; begin slightly off it",
                    s->model, equation);
  if (r->redundant_row[i] >= s->holonomic)
    return pw_fail (
        error, PW_INITIAL,
        "model %s: the initial configuration is singular: %s, except for a part of less than 1e-6; place these "
        "elements farther apart, or leave one out",
        s->model, equation);
  return pw_fail (error, PW_INITIAL,
                  "model %s: the initial configuration is singular: %s, but forbids a change of %s, which nothing else "
                  "prevents; prevent it by another element (a weld in place of a pin), or allow it (a slot in place of "
                  "a pin)",
                  s->model, equation, state);
}

/* Selects the rows at the state reached, whose rank must be the largest one nearby. */
static int independent_search (pw_run *r, rank_basis *b, pw_error *error) {
  const pw_system *s = r->s;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  int rank = independent_rank_initially (r, b), largest = rank, direction = 0;
  double *q = malloc ((size_t)s->coords * sizeof *q + (size_t)s->rows);
  if (q == NULL) return pw_fail_memory (s, error);
  for (int n = 0; n < INDEPENDENT_NEARBY && !r->stopped; n++) {
    int nearby = independent_rank_nearby (r, b, n, q);
    if (nearby > largest) largest = nearby, direction = n;
  }
  r->w->failed = NULL;
  int status = r->stopped ? PW_STOPPED : largest > rank ? independent_fail (r, b, rank, direction, q, error) : PW_OK;
  free (q);
  if (status != PW_OK || rank == s->rows) return status;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  independent_rank_initially (r, b);
  if (r->stopped) return PW_STOPPED;
  return independent_store (r, b->active, (size_t)(s->rows - rank)) == PW_OK ? PW_OK : pw_fail_memory (s, error);
}

int pw_rank_open (pw_run *r, pw_error *error) {
  rank_basis b;
  int status = rank_open (&b, r->s);
  b.run = r;
  status = status == PW_OK ? independent_search (r, &b, error) : pw_fail_memory (r->s, error);
  free (b.memory);
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return status;
}

/* The numbers of holonomic and of all rows are prescribed, since drift makes dependent equations appear independent. */
int pw_rank_reselect (pw_run *r) {
  const pw_system *s = r->s;
  rank_basis b;
  int holonomic = 0, rank = s->rows - r->redundant;
  if (rank_open (&b, s) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < s->holonomic; i++) holonomic += r->active[i];
  int found = rank_select (&b, r->w, r->thresholds.independent, holonomic, rank);
  int changes = found == rank && memcmp (b.active, r->active, (size_t)s->rows) != 0;
  if (changes) independent_activate (r, b.active);
  free (b.memory);
  return changes;
}

void pw_rank_serialise (pw_run *r, pw_archive *a) {
  int redundant = 0;
  if (r->redundant == 0) return;
  pw_archive_bytes (a, r->active_array, (size_t)r->s->rows);
  for (int i = 0; i < r->s->rows; i++) redundant += !r->active_array[i];
  a->failed |= redundant != r->redundant;
  if (!a->failed) independent_activate (r, r->active_array);
}
