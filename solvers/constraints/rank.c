/* Redundant equations: an independent set is selected, the others are monitored.
 *
 * A redundant equation is J_i = sum_a c_ia J_a over active equations a.  Its coefficients come from the saddle
 * point: with f = J_i^T and gamma = 0 the multipliers are c_i.  The vectors n_i = e_i - sum c_ia e_a span the
 * multipliers that pull on nothing, so the least-norm ones are lambda + sum z_i n_i with z from a small
 * least-squares problem.
 *
 * The rank is found at consistent configurations off the singular set: at the initial one and at two configurations
 * a short motion away.  During the motion a set may become ill-conditioned where another one is not: then another is
 * selected. (Garcia de Jalon & Gutierrez-Lopez 2013, Multibody dynamics with redundant constraints and singular mass
 * matrix.) */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* ---- Gram-Schmidt ---- */

double pw_rank_unit (const pw_system *s, int j) {
  return pw_is_angle (s, j) ? s->scale.length : 1;
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
        if (j < n) row[j] += k->J[i * k->b.cols + c] / pw_rank_unit (s, j);
      }
      for (int j = 0; j < n; j++) square += row[j] * row[j];
      for (int j = 0; square > 0 && j < n; j++) row[j] /= sqrt (square);
      if (norm) norm[k->row + i] = sqrt (square);
    }
}

/* Orthogonalises a row against the kept ones; returns its norm afterwards. */
static double rank_orthogonalise (double *row, const double *rows, const int *kept, int rank, int n) {
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

/* The next row to keep of rows first .. end - 1: the first whose norm is at least 0.9 of the largest. */
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
  for (int i = first; i < end; i++) norm[i] = rank_orthogonalise (rows + (size_t)i * (size_t)n, rows, kept, rank, n);
  for (int next; rank < most && (next = rank_pivot (norm, active, first, end)) >= 0;) {
    double *row = rows + (size_t)next * (size_t)n;
    norm[next] = rank_orthogonalise (row, rows, kept, rank, n);
    if (!(norm[next] > tol)) {
      norm[next] = 0;
      continue;
    }
    for (int j = 0; j < n; j++) row[j] /= norm[next];
    active[next] = 1;
    kept[rank++] = next;
    for (int i = first; i < end; i++)
      if (!active[i] && norm[i] > 0)
        norm[i] = rank_orthogonalise (rows + (size_t)i * (size_t)n, rows, kept + rank - 1, 1, n);
  }
  return rank;
}

/* The kept rows become an orthonormal basis of the range of J^T, their numbers go to `kept`.  Holonomic rows come
 * first: a nonholonomic one must not take the place of a position.  At most `holonomic` of them, and `all` in all. */
static int rank_basis_of (const pw_workspace *w, double tol, int holonomic, int all, double *rows, int *kept,
                          unsigned char *active) {
  const pw_system *s = w->s;
  double *norm = rows + (size_t)s->rows * (size_t)s->coords;
  pw_rank_rows (w, rows, NULL);
  memset (active, 0, (size_t)s->rows);
  int rank = rank_keep (tol, holonomic, rows, norm, kept, active, 0, 0, s->holonomic, s->coords);
  return rank_keep (tol, all, rows, norm, kept, active, rank, s->holonomic, s->rows, s->coords);
}

static int rank_basis (const pw_workspace *w, double tol, double *rows, int *kept, unsigned char *active) {
  return rank_basis_of (w, tol, w->s->rows, w->s->rows, rows, kept, active);
}

/* rows x (coords + 1): the rows, then their norms. */
static size_t rank_room (const pw_system *s) {
  return (size_t)s->rows * ((size_t)s->coords + 1);
}

int pw_rank_select (const pw_workspace *w, double tol, unsigned char *active) {
  const pw_system *s = w->s;
  double *rows = malloc ((rank_room (s) + 1) * sizeof *rows);
  int *kept = malloc (((size_t)s->rows + 1) * sizeof *kept), rank = PW_RESOURCE;
  if (rows && kept) rank = rank_basis (w, tol, rows, kept, active);
  free (rows);
  free (kept);
  return rank;
}

/* ---- Selection ---- */

typedef struct {
  double *rows, *q, *motion;
  int *kept;
  unsigned char *active, *best;
  char *memory;
} rank_search;

static int rank_search_open (rank_search *x, const pw_system *s) {
  size_t n = (size_t)s->coords, m = (size_t)s->rows;
  x->memory = malloc ((rank_room (s) + 2 * n + 4) * sizeof (double) + m * sizeof (int) + 2 * m);
  if (x->memory == NULL) return PW_RESOURCE;
  x->rows = (double *)(void *)x->memory;
  x->q = x->rows + rank_room (s);
  x->motion = x->q + n;
  x->kept = (int *)(void *)(x->motion + n + 4);
  x->active = (unsigned char *)(x->kept + m);
  x->best = x->active + m;
  return PW_OK;
}

/* A direction that the rows allow, of size 1 in units of the scene: the given velocities, or a fixed irregular one. */
static void rank_direction (const pw_system *s, const rank_search *x, int rank, const double *v, int number) {
  double most = 0;
  for (int j = 0; j < s->coords; j++)
    x->motion[j] = number == 0 ? v[j] * pw_rank_unit (s, j) : pw_sin (1.7 + 2.39996 * (j + 1) * number);
  rank_orthogonalise (x->motion, x->rows, x->kept, rank, s->coords);
  for (int j = 0; j < s->coords; j++) most = fmax (most, fabs (x->motion[j]));
  for (int j = 0; most > 0 && j < s->coords; j++) x->motion[j] *= s->scale.length / most / pw_rank_unit (s, j);
}

/* The rank a short motion away, with the rows that are independent there in x->active; 0 if there is no such
 * configuration. */
static int rank_nearby (pw_run *r, rank_search *x, int rank, int number) {
  const pw_system *s = r->s;
  pw_projector p;
  pw_error none = { 0 };
  int row, away = 0;
  double worst;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  pw_evaluate_J (r->w);
  rank_basis (r->w, r->limits.independent, x->rows, x->kept, x->active);
  rank_direction (s, x, rank, r->v, number);
  for (int j = 0; j < s->coords; j++) x->q[j] = r->q[j] + 0.03 * x->motion[j];
  const unsigned char *before = r->active;
  r->active = x->active;
  if (pw_projector_open (&p, r, s->metric, s->metric, &none) == PW_OK) {
    p.alone = 1;
    if (pw_project_positions (&p, r, r->t, x->q, r->v, &row, &worst) == PW_OK)
      away = rank_basis (r->w, r->limits.independent, x->rows, x->kept, x->active);
    pw_projector_close (&p);
  }
  r->active = before;
  return away;
}

/* Lists the equations that the run's mask omits; work needs least-norm multipliers only if one of these is
 * rheonomic. */
static void rank_list_redundant (pw_run *r) {
  const pw_system *s = r->s;
  double *shared = (double *)(void *)r->redundant_row - s->rows;
  r->redundant = 0;
  r->shared = NULL;
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->constraints; k++)
    for (int i = k->row; i < k->row + k->b.count * k->kind->rows; i++) {
      if (r->active[i]) continue;
      r->redundant_row[r->redundant++] = i;
      if (k->kind->eta) r->shared = shared;
    }
}

static int rank_store (pw_run *r, const unsigned char *active, int redundant) {
  size_t m = (size_t)r->s->rows, k = (size_t)redundant;
  size_t numbers = k * m + k * k + k + (size_t)r->s->coords + 3 + 2 * m;
  r->rank_memory = malloc (numbers * sizeof (double) + k * sizeof (int) + m);
  if (r->rank_memory == NULL) return PW_RESOURCE;
  r->coefficient = (double *)(void *)r->rank_memory;
  r->redundant_row = (int *)(void *)(r->coefficient + numbers);
  r->active = memcpy (r->redundant_row + k, active, m);
  rank_list_redundant (r);
  return PW_OK;
}

int pw_rank_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  rank_search x;
  if (rank_search_open (&x, s) != PW_OK) return pw_fail (error, PW_RESOURCE, "model %s: out of memory", s->model);
  int status = pw_update_kinematics (r->w, r->t, r->q, r->v);
  pw_evaluate_J (r->w);
  int rank = rank_basis (r->w, r->limits.independent, x.rows, x.kept, x.active), best = rank;
  memcpy (x.best, x.active, (size_t)s->rows);
  for (int number = 0; number < 3 && status == PW_OK; number++) {
    int away = rank_nearby (r, &x, rank, number);
    if (away <= best) continue;
    best = away;
    memcpy (x.best, x.active, (size_t)s->rows);
  }
  if (best > rank)
    status = pw_fail (
        error, PW_INITIAL,
        "model %s: the start is a singular configuration: %d constraint rows are independent there, %d nearby; "
        "start a little off it",
        s->model, rank, best);
  else if (best < s->rows && rank_store (r, x.best, s->rows - best) != PW_OK)
    status = pw_fail (error, PW_RESOURCE, "model %s: out of memory", s->model);
  free (x.memory);
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) == PW_OK) pw_evaluate_J (r->w);
  return status;
}

/* Drift reduces the dependence of equations: the rank is kept. */
int pw_rank_reselect (pw_run *r) {
  const pw_system *s = r->s;
  rank_search x;
  int holonomic = 0, all = s->rows - r->redundant;
  if (rank_search_open (&x, s) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < s->holonomic; i++) holonomic += r->active[i];
  int rank = rank_basis_of (r->w, r->limits.independent, holonomic, all, x.rows, x.kept, x.active);
  int other = rank == all && memcmp (x.active, r->active, (size_t)s->rows) != 0;
  if (other) memcpy (r->redundant_row + r->redundant, x.active, (size_t)s->rows), rank_list_redundant (r);
  free (x.memory);
  return other;
}

void pw_rank_serialise (pw_run *r, pw_archive *a) {
  int found = 0, most = r->redundant;
  if (most == 0) return;
  unsigned char *mask = (unsigned char *)(r->redundant_row + most);
  pw_archive_bytes (a, mask, (size_t)r->s->rows);
  for (int i = 0; i < r->s->rows; i++) found += !mask[i];
  if (found == most)
    rank_list_redundant (r);
  else
    a->failed = 1;
}

void pw_rank_close (pw_run *r) {
  free (r->rank_memory);
  r->rank_memory = NULL;
  r->active = NULL;
  r->redundant = 0;
}

/* ---- Least-norm multipliers ---- */

/* f = J_i^T */
static void rank_row (const pw_workspace *w, int row, double *f) {
  const pw_system *s = w->s;
  memset (f, 0, (size_t)s->coords * sizeof *f);
  for (const pw_element_batch *k = w->batch; k < w->batch + w->s->constraints; k++) {
    int n = row - k->row;
    if (n < 0 || n >= k->b.count * k->kind->rows) continue;
    for (int c = 0; c < k->b.cols; c++) {
      int j = pw_global (k, n / k->kind->rows, c);
      if (j < s->coords) f[j] += k->J[n * k->b.cols + c];
    }
  }
}

double pw_rank_multiplier_unit (const pw_workspace *w, int row) {
  for (const pw_element_batch *k = w->batch; k < w->batch + w->s->constraints; k++) {
    int n = row - k->row;
    if (n < 0 || n >= k->b.count * k->kind->rows) continue;
    const double *J = k->J + n * k->b.cols;
    for (int b = 0; b < k->kind->bodies; b++)
      if (J[3 * b] != 0 || J[3 * b + 1] != 0) return 1;
  }
  return w->scale.length;
}

void pw_rank_coefficients (pw_run *r, int i) {
  const pw_system *s = r->s;
  int m = s->rows, k = r->redundant;
  double *f = r->coefficient + k * m + k * k + k, *nothing = f + s->coords + 3;
  memset (nothing, 0, (size_t)m * sizeof *nothing);
  rank_row (r->w, r->redundant_row[i], f);
  pw_saddle_solve (r->saddle, f, nothing, f, r->coefficient + i * m);
}

static double rank_length (const pw_system *s, const pw_element_batch *k, int n) {
  double square = 0;
  for (int c = 0; c < k->b.cols; c++) {
    int j = pw_global (k, n / k->kind->rows, c);
    double x = j < s->coords ? k->J[n * k->b.cols + c] / pw_rank_unit (s, j) : 0;
    square += x * x;
  }
  return sqrt (square);
}

/* f += weight J_i^T, rows of length 1. */
static void rank_add_row (const pw_system *s, const pw_element_batch *k, int n, double weight, double *f) {
  double length = rank_length (s, k, n);
  for (int c = 0; c < k->b.cols && length > 0; c++) {
    int j = pw_global (k, n / k->kind->rows, c);
    if (j < s->coords) f[j] += weight / length * k->J[n * k->b.cols + c];
  }
}

/* An irregular sum of the redundant equations, in which nothing cancels, needs one solve for any number of them. */
double pw_rank_conditioning (pw_run *r) {
  const pw_system *s = r->s;
  int m = s->rows, k = r->redundant;
  double *c = r->coefficient, *f = c + k * m + k * k + k, *nothing = f + s->coords + 3, most = 0;
  memset (f, 0, (size_t)(s->coords + 3 + m) * sizeof *f);
  for (const pw_element_batch *b = r->w->batch; b < r->w->batch + s->constraints; b++)
    for (int n = 0; n < b->b.count * b->kind->rows; n++) {
      double x = pw_sin (2.39996 * (b->row + n + 1));
      if (!r->active[b->row + n]) rank_add_row (s, b, n, (x + copysign (1, x)) / 2, f);
    }
  pw_saddle_solve (r->saddle, f, nothing, f, c);
  for (const pw_element_batch *b = r->w->batch; b < r->w->batch + s->constraints; b++)
    for (int n = 0; n < b->b.count * b->kind->rows; n++)
      if (r->active[b->row + n]) most = pw_largest (most, fabs (c[b->row + n]) * rank_length (s, b, n));
  return isnan (most) ? 0 : 1 / most;
}

/* Solves A x = b, symmetric positive definite k x k, in place (Cholesky). */
static void rank_cholesky (double *A, double *b, int k) {
  for (int i = 0; i < k; i++) {
    for (int j = 0; j <= i; j++) {
      double sum = A[i * k + j];
      for (int n = 0; n < j; n++) sum -= A[i * k + n] * A[j * k + n];
      A[i * k + j] = i == j ? sqrt (sum) : sum / A[j * k + j];
    }
    for (int n = 0; n < i; n++) b[i] -= A[i * k + n] * b[n];
    b[i] /= A[i * k + i];
  }
  for (int i = k - 1; i >= 0; i--) {
    for (int n = i + 1; n < k; n++) b[i] -= A[n * k + i] * b[n];
    b[i] /= A[i * k + i];
  }
}

void pw_rank_least_norm (pw_run *r, double *lambda) {
  const pw_system *s = r->s;
  int m = s->rows, k = r->redundant;
  if (k == 0) return;
  for (int i = 0; i < k; i++) pw_rank_coefficients (r, i);
  double *c = r->coefficient, *A = c + k * m, *z = A + k * k;
  for (int i = 0; i < k; i++) { /* minimise sum ((lambda + N z) / size)^2, N = [e_i - c_i] */
    z[i] = 0;
    for (int j = 0; j <= i; j++) A[i * k + j] = 0;
  }
  for (int row = 0; row < m; row++) {
    double size = pw_rank_multiplier_unit (r->w, row), weight = 1 / (size * size);
    for (int i = 0; i < k; i++) {
      double n = (r->redundant_row[i] == row) - c[i * m + row];
      z[i] -= weight * n * lambda[row];
      for (int j = 0; j <= i; j++) A[i * k + j] += weight * n * ((r->redundant_row[j] == row) - c[j * m + row]);
    }
  }
  rank_cholesky (A, z, k);
  for (int row = 0; row < m; row++)
    for (int i = 0; i < k; i++) lambda[row] += z[i] * ((r->redundant_row[i] == row) - c[i * m + row]);
}
