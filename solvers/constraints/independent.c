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
#include "util.h"

static int independent_rank (const pw_run *r, pw_row_basis *b) {
  return pw_row_basis_select (b, r->w, r->limits.independent, NULL, r->s->rows, r->s->rows);
}

/* An admissible direction of size 1 in units of the scene: the given velocities, or a projected arbitrary vector. */
static void independent_direction (const pw_system *s, const pw_row_basis *b, const double *v, int number,
                                   double *motion) {
  double most = 0;
  for (int j = 0; j < s->coords; j++)
    motion[j] = number == 0 ? v[j] * pw_as_length (s, j) : pw_irregular (1.7, (j + 1) * number);
  pw_row_basis_orthogonalise (b, motion, 0);
  for (int j = 0; j < s->coords; j++) most = fmax (most, fabs (motion[j]));
  for (int j = 0; most > 0 && j < s->coords; j++) motion[j] *= s->scale.length / most / pw_as_length (s, j);
}

/* The rank a short motion away, of 0.03 L or rad: far enough for sines well above `independent`, near enough for the
 * projection to converge.  0 if no such configuration is found.  q: coords, scratch. */
static int independent_nearby (pw_run *r, pw_row_basis *b, int number, double *q) {
  const pw_system *s = r->s;
  pw_projector p;
  pw_error none = { 0 };
  int away = 0;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  independent_rank (r, b);
  independent_direction (s, b, r->v, number, q);
  for (int j = 0; j < s->coords; j++) q[j] = r->q[j] + 0.03 * q[j];
  const unsigned char *before = r->active;
  r->active = b->active;
  if (pw_projector_open (&p, r, s->metric, NULL, &none) == PW_OK) {
    p.ignores_inactive = 1;
    if (pw_project_positions (&p, r, r->t, q, r->v) == PW_OK) away = independent_rank (r, b);
    pw_projector_close (&p);
  }
  r->active = before;
  return away;
}

/* Makes rows the active ones and lists the others. */
static void independent_use (pw_run *r, const unsigned char *active) {
  const pw_system *s = r->s;
  r->active = memmove (r->independent, active, (size_t)s->rows);
  r->redundant = r->redundant_moves = 0;
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->constraints; k++)
    for (int i = k->row; i < k->row + k->b.count * k->kind->rows; i++) {
      if (active[i]) continue;
      r->redundant_row[r->redundant++] = i;
      r->redundant_moves |= k->kind->eta != NULL;
    }
}

static int independent_store (pw_run *r, const unsigned char *active, int redundant) {
  size_t rows = (size_t)r->s->rows, k = (size_t)redundant;
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &r->rank_memory);) {
    r->independent = pw_layout_alloc (&l, rows, 1);
    r->redundant_row = pw_layout_alloc (&l, k, sizeof *r->redundant_row);
    r->coefficient = pw_layout_alloc (&l, k * rows, sizeof *r->coefficient);
    r->normal = pw_layout_alloc (&l, k * k + k, sizeof *r->normal);
    r->row_force = pw_layout_alloc (&l, (size_t)r->s->coords + 3, sizeof *r->row_force);
    r->zero = pw_layout_alloc (&l, rows, sizeof *r->zero);
    r->least_norm = pw_layout_alloc (&l, rows, sizeof *r->least_norm);
  }
  if (r->rank_memory == NULL) return PW_RESOURCE;
  independent_use (r, active);
  return PW_OK;
}

/* Selects the rows at the state reached, and computes the largest rank nearby; q: coords, scratch. */
static int independent_search (pw_run *r, pw_row_basis *b, double *q, pw_error *error) {
  const pw_system *s = r->s;
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v), rank = independent_rank (r, b), best = rank;
  for (int number = 0; number < 3 && status == PW_OK; number++) {
    int away = independent_nearby (r, b, number, q);
    if (away > best) best = away;
  }
  if (best > rank)
    return pw_fail (
        error, PW_INITIAL,
        "model %s: the initial configuration is singular: %d constraint equations are independent there, %d nearby; "
        "begin slightly off it",
        s->model, rank, best);
  if (best == s->rows || status != PW_OK) return status;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  independent_rank (r, b);
  return independent_store (r, b->active, s->rows - best) == PW_OK ? PW_OK : pw_fail_memory (s, error);
}

int pw_rank_open (pw_run *r, pw_error *error) {
  pw_row_basis b;
  double *q = malloc ((size_t)r->s->coords * sizeof *q);
  int good = pw_row_basis_open (&b, r->s) == PW_OK && q;
  int status = good ? independent_search (r, &b, q, error) : pw_fail_memory (r->s, error);
  pw_row_basis_close (&b);
  free (q);
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return status;
}

/* The rank is not computed again, since drift makes dependent equations independent. */
int pw_rank_reselect (pw_run *r) {
  const pw_system *s = r->s;
  pw_row_basis b;
  int holonomic = 0, all = s->rows - r->redundant;
  if (pw_row_basis_open (&b, s) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < s->holonomic; i++) holonomic += r->active[i];
  int rank = pw_row_basis_select (&b, r->w, r->limits.independent, NULL, holonomic, all);
  int other = rank == all && memcmp (b.active, r->active, (size_t)s->rows) != 0;
  if (other) independent_use (r, b.active);
  pw_row_basis_close (&b);
  return other;
}

void pw_rank_serialise (pw_run *r, pw_archive *a) {
  int redundant = 0;
  if (r->redundant == 0) return;
  pw_archive_bytes (a, r->independent, (size_t)r->s->rows);
  for (int i = 0; i < r->s->rows; i++) redundant += !r->independent[i];
  a->failed |= redundant != r->redundant;
  if (!a->failed) independent_use (r, r->independent);
}
