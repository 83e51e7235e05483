/* Selects the independent constraint equations that a run enforces; the redundant ones are only monitored.
 *
 * The rank is computed at the initial configuration and at up to three consistent ones a short motion away.  During the
 * motion the set may become ill-conditioned while another one is not; then that is selected.  (Garcia de Jalon &
 * Gutierrez-Lopez 2013, Multibody dynamics with redundant constraints and singular mass matrix.) */
#include <math.h>
#include <string.h>
#include "method.h"
#include "rank.h"
#include "util.h"

/* The number of configurations nearby, and their distance in units of L and rad: far enough for sines well above the
 * threshold `independent`, near enough for the projection to converge. */
enum { INDEPENDENT_NEARBY = 3 };
static const double INDEPENDENT_MOTION = 0.03;

static int independent_rank (const pw_run *r, pw_row_basis *b) {
  return pw_row_basis_select (b, r->w, r->thresholds.independent, NULL, r->s->rows, r->s->rows);
}

/* The n-th direction that the constraints allow, of largest component 1 in units of the scene: along the velocities (n =
 * 0), or an arbitrary one.  p->velocity: with the metric of lengths. */
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

/* The rank after a short motion in the n-th direction; 0 if no consistent configuration is found there. */
static int independent_rank_nearby (pw_run *r, pw_row_basis *b, int n) {
  const pw_system *s = r->s;
  double *q = r->q_at; /* scratch while the run is being opened */
  pw_projector p;
  pw_error unused = { 0 };
  int rank = 0;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  independent_rank (r, b);
  const unsigned char *former = r->active;
  r->active = b->active;
  pw_length_weights (s, q);
  if (pw_projector_open (&p, r, s->metric, q, &unused) == PW_OK) {
    p.ignores_inactive = 1;
    int status = independent_direction (&p, r, n, q);
    for (int j = 0; j < s->coords; j++) q[j] = r->q[j] + INDEPENDENT_MOTION * q[j];
    if (status == PW_OK && pw_project_positions (&p, r, r->t, q, r->v) == PW_OK) rank = independent_rank (r, b);
    pw_projector_close (&p);
  }
  r->active = former;
  return rank;
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

/* Selects the rows at the state reached, whose rank must be the largest one nearby. */
static int independent_search (pw_run *r, pw_row_basis *b, pw_error *error) {
  const pw_system *s = r->s;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  int rank = independent_rank (r, b), largest = rank;
  for (int n = 0; n < INDEPENDENT_NEARBY && !r->stopped; n++) {
    int nearby = independent_rank_nearby (r, b, n);
    if (nearby > largest) largest = nearby;
  }
  r->w->failed = NULL;
  if (r->stopped) return PW_STOPPED;
  if (largest > rank)
    return pw_fail (
        error, PW_INITIAL,
        "model %s: the initial configuration is singular: %d constraint equations are independent there, %d nearby; "
        "begin slightly off it",
        s->model, rank, largest);
  if (rank == s->rows) return PW_OK;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  independent_rank (r, b);
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
  int found = pw_row_basis_select (&b, r->w, r->thresholds.independent, NULL, holonomic, rank);
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
