/* Selects the independent constraint equations that a run enforces; the redundant ones are only monitored.
 *
 * The rank is computed at the initial configuration and at up to three a short motion away.  During the motion the set
 * may become ill-conditioned while another one is not; then that is selected.  (Garcia de Jalon & Gutierrez-Lopez 2013,
 * Multibody dynamics with redundant constraints and singular mass matrix.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"
#include "util.h"

/* The number of configurations nearby, and their distance in units of L and rad: far enough for sines well above the
 * threshold `independent`, near enough for the projection to converge. */
enum { INDEPENDENT_NEARBY = 3 };
static const double INDEPENDENT_MOTION = 0.03;

static int independent_rank (const pw_run *r, pw_row_basis *b, double sine) {
  return pw_row_basis_select (b, r->w, sine, r->s->rows, r->s->rows);
}

/* The rank at the initial configuration, where equations with smaller sines than a run accepts are dependent: a
 * configuration in which an equation has a double root is known to the root of its residual only. */
static int independent_rank_initially (const pw_run *r, pw_row_basis *b) {
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
static int independent_rank_at (pw_run *r, pw_row_basis *b, int n, double *q, double sine, int ignores_others) {
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
static int independent_rank_nearby (pw_run *r, pw_row_basis *b, int n, double *q) {
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
  size_t rows = (size_t)r->s->rows, number = sizeof *r->coefficient;
  r->active_array = pw_arena_alloc (&r->arena, rows);
  r->redundant_row = pw_arena_alloc (&r->arena, redundant * sizeof *r->redundant_row);
  r->coefficient = pw_arena_alloc (&r->arena, 5 * rows * number);
  r->row_force = pw_arena_alloc (&r->arena, ((size_t)r->s->coords + 3 + rows) * number);
  if (!r->active_array || !r->redundant_row || !r->coefficient || !r->row_force) return PW_RESOURCE;
  r->least_norm = r->row_force + r->s->coords + 3;
  independent_activate (r, active);
  return PW_OK;
}

/* ---- Singular initial configurations ---- */

/* 1 if a motion in one of the directions leads to a consistent configuration of a higher rank, where a run can begin.
 * Sines must exceed those at a double root. */
static int independent_is_regular_nearby (pw_run *r, pw_row_basis *b, int rank, double *q) {
  for (int n = 0; n < INDEPENDENT_NEARBY; n++)
    if (independent_rank_nearby (r, b, n, q) > rank &&
        independent_rank_at (r, b, -1, q, r->thresholds.rank_refused, 0) > rank)
      return 1;
  return 0;
}

/* The coordinate, rather an angle than a length, in which the most nearly dependent equation of the basis changes most
 * when all others hold. */
static int independent_changed (const pw_system *s, const pw_row_basis *b) {
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
static int independent_fail (pw_run *r, pw_row_basis *b, int rank, int n, double *q, pw_error *error) {
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
static int independent_search (pw_run *r, pw_row_basis *b, pw_error *error) {
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
  pw_row_basis b;
  int status = pw_row_basis_open (&b, r->s);
  b.run = r;
  status = status == PW_OK ? independent_search (r, &b, error) : pw_fail_memory (r->s, error);
  pw_row_basis_close (&b);
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return status;
}

/* The numbers of holonomic and of all rows are prescribed, since drift makes dependent equations appear independent. */
int pw_rank_reselect (pw_run *r) {
  const pw_system *s = r->s;
  pw_row_basis b;
  int holonomic = 0, rank = s->rows - r->redundant;
  if (pw_row_basis_open (&b, s) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < s->holonomic; i++) holonomic += r->active[i];
  int found = pw_row_basis_select (&b, r->w, r->thresholds.independent, holonomic, rank);
  int changes = found == rank && memcmp (b.active, r->active, (size_t)s->rows) != 0;
  if (changes) independent_activate (r, b.active);
  pw_row_basis_close (&b);
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
