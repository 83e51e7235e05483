/* Makes the initial state of a run consistent with the constraints: positions by Gauss-Newton, then velocities by
 * linear solves.
 *
 * States given by the user or specified by the model are prescribed and, where massless coordinates remain free, the
 * positions of those with mass; the rest moves as little as possible in the metric.  If that fails, fewer states are
 * prescribed, in the order of initial_sets.  A state that is consistent to round-off is left unchanged, bit for bit.
 *
 * Equations may depend on each other, all in all (redundant ones) or in the free coordinates, those that are not
 * prescribed.  Then a failed attempt is repeated with independent ones: it is "reduced". */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Rows times coordinates from which on the search for dependent equations, whose cost is rows^2 x coordinates, takes a
 * noticeable time (initial_try_sets). */
#define INITIAL_LARGE 1e4

/* Off the constraints dependent equations appear independent, the more the larger the residuals: hence several
 * tolerances. */
enum { INITIAL_TOLERANCES = 4 };
static const double initial_tolerance[INITIAL_TOLERANCES] = { 1e-7, 1e-4, 1e-2, 0.1 };

typedef enum { INITIAL_POSITIONS, INITIAL_VELOCITIES } initial_level;

/* Where an attempt failed. */
typedef struct {
  int row; /* -1: unknown */
  initial_level level;
  double residual; /* [m, rad, m/s, rad/s] */
  int assembled;   /* 1: positions were found */
} initial_failure;

/* Factor of the metric of massless coordinates, by which it becomes 1e-6 of the least entry of the mass matrix (angles
 * in units of L), but at least 1e-12 of the largest.  (In the system's metric it refers to the mean entry, which
 * unrelated massive bodies may determine.) */
static double initial_massless_scale (const pw_system *s) {
  double least = INFINITY, most = 0, massless = 0;
  for (int j = 0; j < s->coords; j++) {
    double length = pw_length_factor (s, j), entry = s->metric[j] / (length * length);
    if (s->mass[j] > 0)
      least = fmin (least, entry), most = fmax (most, entry);
    else
      massless = entry;
  }
  return massless > 0 && most > 0 ? fmax (1e-6 * least, 1e-12 * most) / massless : 1;
}

/* The weights of a metric, INFINITY for prescribed coordinates (NULL: none).  If `metric` is the mass matrix, the
 * constraint equations determine massless velocities. */
static void initial_weights (const pw_system *s, const double *metric, const unsigned char *prescribed,
                             double *weight) {
  double scale = initial_massless_scale (s);
  for (int j = 0; j < s->coords; j++)
    weight[j] = prescribed && prescribed[j] ? INFINITY : s->mass[j] > 0 ? metric[j] : scale * metric[j];
}

static int initial_positions (pw_projector *p, pw_run *r, initial_failure *failure) {
  int status = pw_project_positions (p, r, r->t, r->q, r->v);
  if (status == PW_OK) return PW_OK;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) == PW_OK && p->worst_row >= 0) {
    pw_evaluate_g (r->w, r->scratch);
    *failure = (initial_failure){ p->worst_row, INITIAL_POSITIONS, fabs (r->scratch[p->worst_row]), .assembled = 0 };
  }
  return status;
}

/* Projects velocities; kinematics and J must be up to date.  A second linear solve removes the round-off of a large
 * first correction. */
static int initial_velocities (pw_projector *p, pw_run *r, initial_failure *failure) {
  double *Jv = r->scratch, *eta = Jv + r->s->rows;
  pw_residuals now;
  pw_evaluate_residuals (r->w, NULL, &now);
  for (int i = 0; i < 2 && !(now.velocity <= PW_RESIDUAL_CONVERGED); i++) {
    int status = pw_project_velocities (p, r, r->v);
    if (status < 0) return status;
    if (status != PW_OK) break;
    pw_evaluate_residuals (r->w, NULL, &now);
  }
  if (now.velocity <= PW_RESIDUAL_ACCEPTED) return PW_OK;
  int row = now.row_velocity;
  pw_mul_J (r->w, r->v, Jv);
  pw_evaluate_eta (r->w, eta);
  *failure = (initial_failure){ row, INITIAL_VELOCITIES, row < 0 ? NAN : fabs (Jv[row] - eta[row]), .assembled = 1 };
  return PW_RETRY;
}

static int initial_project (pw_projector *p, pw_run *r, initial_level level, initial_failure *failure) {
  return level == INITIAL_VELOCITIES ? initial_velocities (p, r, failure) : initial_positions (p, r, failure);
}

/* Projects positions or velocities.  If that fails, it is repeated with equations that are independent in the free
 * coordinates (unless prescribed is NULL); the prescribed values must then satisfy the others to round-off.  weight:
 * metric of positions, then of velocities. */
static int initial_project_reduced (pw_projector *p, pw_run *r, initial_level level, const unsigned char *prescribed,
                                    const double *weight, initial_failure *failure, pw_error *error) {
  const pw_system *s = r->s;
  const unsigned char *former = r->active;
  size_t bytes = (size_t)s->coords * sizeof (double);
  int rank = s->rows;
  double *projected = level == INITIAL_VELOCITIES ? r->v : r->q;
  unsigned char *start = malloc (bytes + (size_t)s->rows + 1);
  if (start == NULL) return pw_fail_memory (s, error);
  unsigned char *active = start + bytes;
  memcpy (start, projected, bytes);
  int status = initial_project (p, r, level, failure);
  for (int i = 0; i < INITIAL_TOLERANCES && status == PW_RETRY && prescribed; i++) {
    pw_projector reduced;
    pw_error cause = { 0 };
    pw_residuals now;
    initial_failure unused;
    memcpy (projected, start, bytes);
    if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) break;
    int found = pw_rank_select (r->w, initial_tolerance[i], prescribed, active);
    if (found < 0) status = pw_fail_memory (s, error);
    if (found < 0 || found == rank) continue;
    rank = found;
    r->active = active;
    status = pw_projector_open (&reduced, r, weight, level == INITIAL_VELOCITIES ? weight + s->coords : weight, &cause);
    r->active = former;
    if (status != PW_OK) { /* out of memory, or the mass matrix does not determine these velocities */
      status = cause.status == PW_RESOURCE ? pw_fail (error, PW_RESOURCE, "%s", cause.text) : PW_RETRY;
      continue;
    }
    status = initial_project (&reduced, r, level, &unused);
    pw_projector_close (&reduced);
    pw_evaluate_residuals (r->w, NULL, &now);
    if (status == PW_OK && !(now.position <= PW_RESIDUAL_ACCEPTED * pw_largest_angle (s, r->q_given)))
      status = PW_RETRY;
  }
  free (start);
  return status;
}

/* Projects the positions `from` and the given velocities, with prescribed states (2 coords, or NULL); reduce_free: 1:
 * by initial_project_reduced.  The velocity metric is the mass matrix; if that does not determine all velocities, or
 * their projection fails, the position metric. */
static int initial_attempt (pw_run *r, const unsigned char *prescribed, int reduce_free, const double *from,
                            initial_failure *failure, pw_error *error) {
  const pw_system *s = r->s;
  const unsigned char *prescribed_v = prescribed ? prescribed + s->coords : NULL;
  size_t bytes = (size_t)s->coords * sizeof (double);
  double *weight = malloc (2 * bytes);
  if (weight == NULL) return pw_fail_memory (s, error);
  double *weight_v = weight + s->coords;
  initial_weights (s, s->metric, prescribed, weight);
  int status = PW_OK;
  for (int choice = 0; choice < 2 && status == PW_OK; choice++) {
    pw_projector p;
    pw_error cause = { 0 };
    memcpy (r->q, from, bytes);
    memcpy (r->v, r->v_given, bytes);
    status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
    if (status != PW_OK) break;
    initial_weights (s, choice == 0 ? s->mass : s->metric, prescribed_v, weight_v);
    status = pw_projector_open (&p, r, weight, weight_v, choice == 0 ? &cause : error);
    if (status == PW_OK) {
      const unsigned char *reduce_q = reduce_free ? prescribed : NULL, *reduce_v = reduce_free ? prescribed_v : NULL;
      status = initial_project_reduced (&p, r, INITIAL_POSITIONS, reduce_q, weight, failure, error);
      failure->assembled |= status == PW_OK;
      if (status == PW_OK)
        status = initial_project_reduced (&p, r, INITIAL_VELOCITIES, reduce_v, weight, failure, error);
      pw_projector_close (&p);
      if (status != PW_RETRY || failure->level == INITIAL_POSITIONS) break;
    }
    if (cause.status == PW_RESOURCE)
      status = pw_fail (error, PW_RESOURCE, "%s", cause.text);
    else if (choice == 0)
      status = PW_OK; /* the second choice follows */
  }
  free (weight);
  return status;
}

static int initial_fail (pw_run *r, const initial_failure *failure, pw_error *error) {
  if (failure->row < 0)
    return pw_fail (error, PW_INITIAL, "model %s: the initial state cannot be made consistent", r->s->model);
  const char *element = PW_NAME (pw_system_row_name, r->s, failure->row);
  const char *unit = strcmp (pw_system_reaction_unit (r->s, failure->row), "N m") == 0 ? "rad" : "m";
  const int is_open = failure->level == INITIAL_POSITIONS;
  return pw_fail (error, PW_INITIAL, "model %s: the initial state cannot be made consistent: %s is %s by %.6g %s%s",
                  r->s->model, element, is_open ? "open" : "violated", failure->residual, unit,
                  is_open ? "; if it can close, begin nearer to where it does" : "/s");
}

int pw_initial_moved (const pw_system *s, const pw_initial_report *report, int state) {
  int is_velocity = state >= s->coords, j = is_velocity ? state - s->coords : state;
  double unit = pw_unit (s, j) / (is_velocity ? report->time : 1);
  double from = is_velocity ? report->v_given[j] : report->q_given[j], to = is_velocity ? report->v[j] : report->q[j];
  return !(fabs (to - from) <= 16 * DBL_EPSILON * (fabs (to) + unit));
}

void pw_run_count_moved (pw_run *r) {
  r->initial.moved = r->initial.changed = 0;
  r->initial.time = r->w->scale.time;
  for (int j = 0; j < 2 * r->s->coords; j++) {
    if (!pw_initial_moved (r->s, &r->initial, j)) continue;
    r->initial.moved++;
    r->initial.changed += (r->origin[j] & (PW_GIVEN | PW_SPECIFIED)) == PW_SPECIFIED;
  }
}

int pw_initial_specified (const pw_initial_report *report, int state) {
  return (report->origin[state] & (PW_GIVEN | PW_SPECIFIED)) != 0;
}

int pw_initial_given (const pw_initial_report *report, int state) {
  return (report->origin[state] & PW_GIVEN) != 0;
}

/* An attempt from the given positions.  If it fails with all equations, it is repeated with independent ones, selected
 * at the given positions or, failing that, at those reached by an attempt without prescribed values, where the free
 * coordinates then start. */
static int initial_attempt_reduced (pw_run *r, const unsigned char *prescribed, int reduce_free,
                                    initial_failure *failure, pw_error *error) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords, rows = (size_t)s->rows;
  initial_failure later = { .row = -1 };
  int status = initial_attempt (r, prescribed, reduce_free, r->q_given, failure, error), rank = s->rows;
  if (status != PW_RETRY || r->active || (double)s->rows * s->coords > PW_RANK_MAX_ENTRIES) return status;
  double *at = malloc (2 * n * sizeof *at + rows); /* where the equations are selected */
  if (at == NULL) return pw_fail_memory (s, error);
  double *from = at + n; /* where attempts begin */
  unsigned char *active = (unsigned char *)(from + n);
  memcpy (at, r->q_given, n * sizeof *at);
  memcpy (from, at, n * sizeof *at);
  for (int i = 0; i < 2 * INITIAL_TOLERANCES && status == PW_RETRY; i++) {
    if (i == INITIAL_TOLERANCES) {
      if (initial_attempt (r, NULL, 0, r->q_given, &later, error) == PW_RESOURCE) status = PW_RESOURCE;
      for (size_t j = 0; j < n; j++) at[j] = r->q[j], from[j] = prescribed[j] ? from[j] : r->q[j];
      rank = s->rows;
    }
    if (status != PW_RETRY || pw_evaluate_J_at (r->w, r->t, at, r->v_given) != PW_OK) continue;
    int found = pw_rank_select (r->w, initial_tolerance[i % INITIAL_TOLERANCES], NULL, active);
    if (found < 0) status = pw_fail_memory (s, error);
    if (found < 0 || found == rank) continue;
    rank = found;
    r->active = active;
    later = (initial_failure){ .row = -1 };
    status = initial_attempt (r, prescribed, reduce_free, from, &later, error);
    r->active = NULL;
    failure->assembled |= later.assembled;
  }
  free (at);
  return status;
}

/* Fails if less than 1e-10 of the given velocities is left, in the norm of the metric, and nonholonomic equations are
 * among those that they violate. */
static int initial_locked (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  double given = 0, left = 0, speed = 0, *Jv = r->scratch, *eta = Jv + s->rows;
  char element[PW_NAME_BYTES], previous[PW_NAME_BYTES] = "", elements[300] = "";
  const char *advice = "";
  for (int j = 0; j < s->coords; j++) {
    given += s->metric[j] * r->v_given[j] * r->v_given[j];
    left += s->metric[j] * r->v[j] * r->v[j];
    speed = fmax (speed, fabs (r->v_given[j]) * pw_length_factor (s, j));
  }
  if (s->rows == s->holonomic || given == 0 || left > 1e-20 * given) return PW_OK;
  pw_mul_J (r->w, r->v_given, Jv);
  pw_evaluate_eta (r->w, eta);
  for (int i = s->holonomic; i < s->rows && strlen (elements) < 150; i++) {
    size_t length = strlen (elements);
    if (fabs (Jv[i] - eta[i]) <= 1e-10 * speed) continue;
    if (strcmp (pw_system_row_name (s, i, element, sizeof element), previous) == 0) continue;
    if (length) advice = pw_advice_on_wheel (s, i);
    snprintf (elements + length, sizeof elements - length, "%s%s", length ? ", " : "", strcpy (previous, element));
  }
  if (*elements == 0) return PW_OK;
  return pw_fail (error, PW_INITIAL,
                  "model %s: the given velocities would have to be removed entirely: %s allow no such motion%s",
                  s->model, elements, advice);
}

/* Sets of prescribed states, in the order tried: positions and velocities by origin; and whether the positions of
 * coordinates with mass are prescribed, too. */
static const struct initial_set {
  unsigned char q, v;
  enum {
    INITIAL_FREE,
    INITIAL_MASS,
    INITIAL_MASS_UNSPECIFIED /* as INITIAL_MASS, but the set applies only if one of them is PW_ZERO_POSITION */
  } mass;
} initial_sets[] = {
  { PW_GIVEN | PW_SPECIFIED, PW_GIVEN | PW_SPECIFIED, INITIAL_MASS },
  { PW_GIVEN | PW_SPECIFIED, PW_GIVEN, INITIAL_MASS },
  { PW_GIVEN, PW_GIVEN | PW_SPECIFIED, INITIAL_MASS_UNSPECIFIED },
  { PW_GIVEN, PW_GIVEN, INITIAL_MASS_UNSPECIFIED },
  { PW_GIVEN | PW_SPECIFIED, PW_GIVEN | PW_SPECIFIED, INITIAL_FREE },
  { PW_GIVEN | PW_SPECIFIED, PW_GIVEN, INITIAL_FREE },
  { PW_GIVEN, PW_GIVEN | PW_SPECIFIED, INITIAL_MASS },
  { PW_GIVEN, PW_GIVEN, INITIAL_MASS },
  { PW_GIVEN, PW_GIVEN | PW_SPECIFIED, INITIAL_FREE },
  { PW_GIVEN, PW_GIVEN, INITIAL_FREE },
  { 0, PW_GIVEN | PW_SPECIFIED, INITIAL_FREE },
  { 0, PW_GIVEN, INITIAL_FREE },
  { 0, 0, INITIAL_FREE },
};

/* The states that a set prescribes (2 coords); returns 0 if the set does not apply: it is to prescribe coordinates
 * because of their mass, but there are none (INITIAL_MASS_UNSPECIFIED: none of PW_ZERO_POSITION), or it leaves no
 * massless one that can move.  origin may be NULL: nothing is given or specified. */
static int initial_prescribe (const pw_system *s, const unsigned char *origin, const struct initial_set *set,
                              unsigned char *prescribed) {
  int n = s->coords, massless = 0, massive = 0, unspecified = 0;
  for (int j = 0; j < n; j++) {
    int q = origin ? origin[j] : 0, v = origin ? origin[n + j] : 0;
    int by_mass = set->mass && s->mass[j] > 0 && !(q & set->q);
    prescribed[j] = (q & set->q) != 0 || by_mass;
    prescribed[n + j] = (v & set->v) != 0;
    massless += s->mass[j] == 0 && !prescribed[j];
    massive += by_mass, unspecified += by_mass && q & PW_ZERO_POSITION;
  }
  return !set->mass || (massless > 0 && massive > 0 && (set->mass == INITIAL_MASS || unspecified > 0));
}

/* Makes attempts with one set after another, except those that prescribe the same as the last one (the same positions,
 * if these failed) and are reduced alike.  *released: 1 if the last set does not prescribe all that the user gives.
 *
 * In large scenes attempts are not reduced while states specified by the model are prescribed, since they usually fail
 * for sketches of linkages, which specify all positions; nor in the free coordinates unless the user gives values. */
static int initial_try_sets (pw_run *r, const unsigned char *origin, initial_failure *failure, int *released,
                             pw_error *error) {
  const int sets = sizeof initial_sets / sizeof *initial_sets;
  const pw_system *s = r->s;
  const double entries = (double)s->rows * s->coords;
  const int is_small = entries < INITIAL_LARGE;
  size_t n = (size_t)s->coords;
  unsigned char *prescribed = malloc (4 * n + 1);
  if (prescribed == NULL) return pw_fail_memory (s, error);
  unsigned char *last = prescribed + 2 * n;
  int status = PW_RETRY, last_reduce_all = -1, assembled = 0, given = 0;
  for (size_t j = 0; origin && j < 2 * n; j++) given |= origin[j] & PW_GIVEN;
  for (const struct initial_set *set = initial_sets; set < initial_sets + sets && status == PW_RETRY; set++) {
    if (!initial_prescribe (s, origin, set, prescribed)) continue;
    int reduce_all = is_small || !((set->q | set->v) & PW_SPECIFIED);
    if (reduce_all == last_reduce_all && memcmp (prescribed, last, assembled ? 2 * n : n) == 0) continue;
    int reduce_free = is_small || (reduce_all && given && entries <= PW_RANK_MAX_ENTRIES);
    initial_failure now = { .row = -1 };
    status = reduce_all ? initial_attempt_reduced (r, prescribed, reduce_free, &now, error)
                        : initial_attempt (r, prescribed, reduce_free, r->q_given, &now, error);
    memcpy (last, prescribed, 2 * n);
    last_reduce_all = reduce_all, assembled = now.assembled;
    if (now.row >= 0) *failure = now;
  }
  for (size_t j = 0; origin && j < 2 * n; j++) *released |= origin[j] & PW_GIVEN && !prescribed[j];
  free (prescribed);
  return status;
}

int pw_run_make_consistent (pw_run *r, const unsigned char *origin, pw_error *error) {
  const pw_system *s = r->s;
  size_t bytes = (size_t)s->coords * sizeof (double);
  pw_residuals before;
  initial_failure failure = { .row = -1 };
  int released = 0;
  memcpy (r->q_given, r->q, bytes);
  memcpy (r->v_given, r->v, bytes);
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return pw_fail_signal (r->t, error);
  pw_evaluate_residuals (r->w, NULL, &before);
  if (!(before.position <= 2 * PW_RESIDUAL_CONVERGED && before.velocity <= 2 * PW_RESIDUAL_CONVERGED))
    status = initial_try_sets (r, origin, &failure, &released, error);
  r->initial = (pw_initial_report){ .q_given = r->q_given,
                                    .v_given = r->v_given,
                                    .q = r->q,
                                    .v = r->v,
                                    .origin = r->origin,
                                    .released = released,
                                    .position = before.position,
                                    .velocity = before.velocity };
  if (status == PW_OK && origin) status = initial_locked (r, error); /* wheels may absorb the impulse of a restart */
  if (status == PW_METHOD) return pw_fail_signal (r->t, error);
  return status == PW_RETRY ? initial_fail (r, &failure, error) : status;
}
