/* Redundant equations: an independent set is selected, the others are monitored.
 *
 * The rank is computed at consistent configurations: at the initial one and at up to three configurations a short
 * motion away.  During the motion a set may become ill-conditioned while another one is not; then that is
 * selected.  (Garcia de Jalon & Gutierrez-Lopez 2013, Multibody dynamics with redundant constraints and singular mass
 * matrix.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

typedef struct {
  double *rows, *q, *motion;
  int *kept;
  unsigned char *active, *best;
} independent_search;

static int independent_open (independent_search *x, const pw_system *s) {
  size_t n = (size_t)s->coords, m = (size_t)s->rows;
  x->rows = malloc ((pw_rank_room (s) + 2 * n) * sizeof (double) + m * sizeof (int) + 2 * m);
  if (x->rows == NULL) return PW_RESOURCE;
  x->q = x->rows + pw_rank_room (s);
  x->motion = x->q + n;
  x->kept = (int *)(void *)(x->motion + n);
  x->active = (unsigned char *)(x->kept + m);
  x->best = x->active + m;
  return PW_OK;
}

static int independent_rank (pw_run *r, independent_search *x) {
  return pw_rank_basis (r->w, r->limits.independent, r->s->rows, r->s->rows, x->rows, x->kept, x->active);
}

/* An admissible direction of size 1 in units of the scene: the given velocities, or a projected arbitrary vector. */
static void independent_direction (const pw_system *s, const independent_search *x, int rank, const double *v,
                                   int number) {
  double most = 0;
  for (int j = 0; j < s->coords; j++)
    x->motion[j] = number == 0 ? v[j] * pw_as_length (s, j) : pw_irregular (1.7, (j + 1) * number);
  pw_rank_orthogonalise (x->motion, x->rows, x->kept, rank, s->coords);
  for (int j = 0; j < s->coords; j++) most = fmax (most, fabs (x->motion[j]));
  for (int j = 0; most > 0 && j < s->coords; j++) x->motion[j] *= s->scale.length / most / pw_as_length (s, j);
}

/* The rank a short motion away, of 0.03 L or rad: far enough for sines well above `independent`, near enough for the
 * projection to converge.  x->active: the independent rows there.  0 if no such configuration is found. */
static int independent_nearby (pw_run *r, independent_search *x, int rank, int number) {
  const pw_system *s = r->s;
  pw_projector p;
  pw_error none = { 0 };
  int away = 0;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  independent_rank (r, x);
  independent_direction (s, x, rank, r->v, number);
  for (int j = 0; j < s->coords; j++) x->q[j] = r->q[j] + 0.03 * x->motion[j];
  const unsigned char *before = r->active;
  r->active = x->active;
  if (pw_projector_open (&p, r, s->metric, NULL, &none) == PW_OK) {
    p.alone = 1;
    if (pw_project_positions (&p, r, r->t, x->q, r->v) == PW_OK) away = independent_rank (r, x);
    pw_projector_close (&p);
  }
  r->active = before;
  return away;
}

/* Lists the redundant equations; work needs least-norm multipliers only if one of them is rheonomic. */
static void independent_list_redundant (pw_run *r) {
  const pw_system *s = r->s;
  r->redundant = 0;
  r->least_norm = NULL;
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->constraints; k++)
    for (int i = k->row; i < k->row + k->b.count * k->kind->rows; i++) {
      if (r->active[i]) continue;
      r->redundant_row[r->redundant++] = i;
      if (k->kind->eta) r->least_norm = (double *)(void *)r->redundant_row - s->rows;
    }
}

static int independent_store (pw_run *r, const unsigned char *active, int redundant) {
  size_t m = (size_t)r->s->rows, k = (size_t)redundant, numbers = k * m + k * k + k + (size_t)r->s->coords + 3 + 2 * m;
  r->rank_memory = malloc (numbers * sizeof (double) + k * sizeof (int) + m);
  if (r->rank_memory == NULL) return PW_RESOURCE;
  r->coefficient = (double *)(void *)r->rank_memory;
  r->redundant_row = (int *)(void *)(r->coefficient + numbers);
  r->active = memcpy (r->redundant_row + k, active, m);
  independent_list_redundant (r);
  return PW_OK;
}

int pw_rank_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  independent_search x;
  if (independent_open (&x, s) != PW_OK) return pw_fail_memory (s, error);
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v), rank = independent_rank (r, &x), best = rank;
  memcpy (x.best, x.active, (size_t)s->rows);
  for (int number = 0; number < 3 && status == PW_OK; number++) {
    int away = independent_nearby (r, &x, rank, number);
    if (away > best) best = away;
  }
  if (best > rank)
    status = pw_fail (
        error, PW_INITIAL,
        "model %s: the initial configuration is singular: %d constraint equations are independent there, %d nearby; "
        "begin slightly off it",
        s->model, rank, best);
  else if (best < s->rows && independent_store (r, x.best, s->rows - best) != PW_OK)
    status = pw_fail_memory (s, error);
  free (x.rows);
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return status;
}

/* The rank is not computed again, since drift makes dependent equations independent. */
int pw_rank_reselect (pw_run *r) {
  const pw_system *s = r->s;
  independent_search x;
  int holonomic = 0, all = s->rows - r->redundant;
  if (independent_open (&x, s) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < s->holonomic; i++) holonomic += r->active[i];
  int rank = pw_rank_basis (r->w, r->limits.independent, holonomic, all, x.rows, x.kept, x.active);
  int other = rank == all && memcmp (x.active, r->active, (size_t)s->rows) != 0;
  if (other) memcpy (r->redundant_row + r->redundant, x.active, (size_t)s->rows), independent_list_redundant (r);
  free (x.rows);
  return other;
}

void pw_rank_serialise (pw_run *r, pw_archive *a) {
  int found = 0, most = r->redundant;
  if (most == 0) return;
  unsigned char *mask = (unsigned char *)(r->redundant_row + most);
  pw_archive_bytes (a, mask, (size_t)r->s->rows);
  for (int i = 0; i < r->s->rows; i++) found += !mask[i];
  if (found == most)
    independent_list_redundant (r);
  else
    a->failed = 1;
}
