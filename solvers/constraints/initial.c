/* Consistent initial conditions: positions by Gauss-Newton, then velocities by linear solves.
 *
 * States given by the user or specified by the model are prescribed, and so are, where possible, the positions of
 * coordinates with mass; the rest moves as little as possible in the metric.  If that fails, first the velocities
 * specified by the model are released, then its positions, then the given positions, then everything.  A state that is
 * consistent to round-off is left unchanged, bit for bit. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Rows times coordinates above which the cost of seeking dependent equations, rows^2 x coordinates, counts.  Then they
 * are not sought while states specified by the model are prescribed: that usually fails for sketches of linkages, which
 * specify all positions; nor, unless values are given, for the coordinates that are not prescribed. */
#define INITIAL_SMALL 1e4

/* Off the constraints dependent equations appear independent, the more the larger the residuals: hence several
 * tolerances. */
enum { TOLERANCES = 4 };
static const double initial_tolerance[TOLERANCES] = { 1e-7, 1e-4, 1e-2, 0.1 };

/* Where an attempt failed. */
typedef struct {
  int row;
  int velocities; /* 0: positions, 1: velocities */
  double off;
  int assembled; /* 1: positions were found */
} initial_failure;

/* Scale factor for the metric of massless coordinates: 1e-6 of the least entry of the mass matrix, angles in units
 * of L, instead of the mean, since unrelated bodies may be massive; limited by round-off. */
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

/* The metric, with INFINITY for prescribed coordinates.  If `metric` is the mass matrix, the constraint equations
 * determine massless velocities. */
static void initial_weights (const pw_system *s, const double *metric, const unsigned char *prescribed,
                             double *weight) {
  double massless = initial_massless_scale (s);
  for (int j = 0; j < s->coords; j++)
    weight[j] = prescribed && prescribed[j] ? INFINITY : s->mass[j] > 0 ? metric[j] : massless * metric[j];
}

static int initial_positions (pw_projector *p, pw_run *r, initial_failure *failure) {
  int status = pw_project_positions (p, r, r->t, r->q, r->v);
  if (status == PW_OK) return PW_OK;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) == PW_OK && p->worst_row >= 0) {
    pw_evaluate_g (r->w, r->scratch);
    *failure = (initial_failure){ p->worst_row, 0, fabs (r->scratch[p->worst_row]), 0 };
  }
  return status;
}

/* Projects velocities; kinematics must be up to date.  A second linear solve removes the round-off of a large first
 * correction. */
static int initial_velocities (pw_projector *p, pw_run *r, double *v, initial_failure *failure) {
  pw_residuals now;
  pw_evaluate_residuals (r->w, NULL, &now);
  for (int i = 0; i < 2 && !(now.velocity <= PW_RESIDUAL_GOOD); i++) {
    int status = pw_project_velocities (p, r, v);
    if (status < 0) return status;
    if (status != PW_OK) break;
    pw_evaluate_residuals (r->w, NULL, &now);
  }
  if (now.velocity <= PW_RESIDUAL_ENOUGH) return PW_OK;
  *failure = (initial_failure){ now.row_velocity, 1, now.jv, 1 };
  return PW_RETRY;
}

static int initial_project (pw_projector *p, pw_run *r, int velocities, initial_failure *failure) {
  return velocities ? initial_velocities (p, r, r->v, failure) : initial_positions (p, r, failure);
}

/* Projects positions or velocities.  If that fails since equations depend on each other in the coordinates that are not
 * prescribed (not NULL), it is repeated with independent ones; the prescribed values must then satisfy the others to
 * round-off. */
static int initial_stage (pw_projector *p, pw_run *r, int velocities, const unsigned char *prescribed,
                          const double *weight, initial_failure *failure, pw_error *error) {
  const pw_system *s = r->s;
  const unsigned char *before = r->active;
  size_t bytes = (size_t)s->coords * sizeof (double);
  int rank = s->rows;
  unsigned char *start = malloc (bytes + (size_t)s->rows + 1);
  if (start == NULL) return pw_fail_memory (s, error);
  unsigned char *active = start + bytes;
  memcpy (start, velocities ? r->v : r->q, bytes);
  int status = initial_project (p, r, velocities, failure);
  for (int i = 0; i < TOLERANCES && status == PW_RETRY && prescribed; i++) {
    pw_projector own;
    pw_error why = { 0 };
    pw_residuals now;
    initial_failure unused;
    memcpy (velocities ? r->v : r->q, start, bytes);
    if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) break;
    int found = pw_rank_select (r->w, initial_tolerance[i], prescribed, active);
    if (found < 0) status = pw_fail_memory (s, error);
    if (found < 0 || found == rank) continue;
    rank = found;
    r->active = active;
    status = pw_projector_open (&own, r, weight, velocities ? weight + s->coords : weight, &why);
    r->active = before;
    if (status != PW_OK) { /* out of memory, or the mass matrix does not determine these velocities */
      status = why.status == PW_RESOURCE ? pw_fail (error, PW_RESOURCE, "%s", why.text) : PW_RETRY;
      continue;
    }
    status = initial_project (&own, r, velocities, &unused);
    pw_projector_close (&own);
    pw_evaluate_residuals (r->w, NULL, &now);
    if (status == PW_OK && !(now.position <= PW_RESIDUAL_ENOUGH)) status = PW_RETRY;
  }
  free (start);
  return status;
}

/* One attempt from these positions and the given velocities, with some states prescribed; seek: dependent equations are
 * sought in the coordinates that are not.  The velocity metric is the mass matrix if that determines all velocities,
 * else the position metric. */
static int initial_attempt (pw_run *r, const unsigned char *prescribed, int seek, const double *from,
                            initial_failure *failure, pw_error *error) {
  const pw_system *s = r->s;
  size_t bytes = (size_t)s->coords * sizeof (double);
  double *weight = malloc (2 * bytes);
  if (weight == NULL) return pw_fail_memory (s, error);
  initial_weights (s, s->metric, prescribed, weight);
  int status = PW_OK;
  for (int choice = 0; choice < 2 && status == PW_OK; choice++) {
    pw_projector p;
    pw_error none = { 0 };
    memcpy (r->q, from, bytes);
    memcpy (r->v, r->v_given, bytes);
    status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
    if (status != PW_OK) break;
    initial_weights (s, choice == 0 ? s->mass : s->metric, prescribed ? prescribed + s->coords : NULL,
                     weight + s->coords);
    status = pw_projector_open (&p, r, weight, weight + s->coords, choice == 0 ? &none : error);
    if (status == PW_OK) {
      status = initial_stage (&p, r, 0, seek ? prescribed : NULL, weight, failure, error);
      failure->assembled |= status == PW_OK;
      if (status == PW_OK)
        status = initial_stage (&p, r, 1, seek ? prescribed + s->coords : NULL, weight, failure, error);
      pw_projector_close (&p);
      if (status != PW_RETRY || !failure->velocities) break;
    }
    if (none.status == PW_RESOURCE) status = pw_fail (error, PW_RESOURCE, "%s", none.text);
    if (choice == 0 && none.status != PW_RESOURCE) status = PW_OK;
  }
  free (weight);
  return status;
}

static int initial_fail (pw_run *r, const initial_failure *failure, pw_error *error) {
  char element[120];
  if (failure->row < 0)
    return pw_fail (error, PW_INITIAL, "model %s: the initial state cannot be made consistent", r->s->model);
  pw_system_row_name (r->s, failure->row, element, sizeof element);
  int angle = strcmp (pw_system_reaction_unit (r->s, failure->row), "N m") == 0;
  return pw_fail (error, PW_INITIAL, "model %s: the initial state cannot be made consistent: %s is %s by %.6g %s%s",
                  r->s->model, element, failure->velocities ? "violated" : "open", failure->off, angle ? "rad" : "m",
                  failure->velocities ? "/s" : "; if it can close, begin nearer to where it does");
}

int pw_initial_moved (const pw_system *s, const pw_initial_report *report, int state) {
  int rate = state >= s->coords, j = rate ? state - s->coords : state;
  double unit = pw_unit (s, j) / (rate ? report->time : 1);
  double from = rate ? report->v_given[j] : report->q_given[j], to = rate ? report->v[j] : report->q[j];
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

/* If redundant equations make an attempt with all equations fail, it is repeated with an independent set, selected at
 * the given positions or, failing that, at those reached by an attempt without prescribed values, from which it then
 * starts. */
static int initial_ranked (pw_run *r, const unsigned char *prescribed, int seek, initial_failure *failure,
                           pw_error *error) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords, m = (size_t)s->rows;
  initial_failure later = { .row = -1 };
  int status = initial_attempt (r, prescribed, seek, r->q_given, failure, error), rank = s->rows;
  if (status != PW_RETRY || r->active || (double)s->rows * s->coords > PW_RANK_MAX_ENTRIES) return status;
  double *at = malloc (2 * n * sizeof *at + m);
  if (at == NULL) return pw_fail_memory (s, error);
  double *from = at + n;
  unsigned char *active = (unsigned char *)(from + n);
  memcpy (at, r->q_given, n * sizeof *at);
  memcpy (from, at, n * sizeof *at);
  for (int i = 0; i < 2 * TOLERANCES && status == PW_RETRY; i++) {
    if (i == TOLERANCES) {
      if (initial_attempt (r, NULL, 0, r->q_given, &later, error) == PW_RESOURCE) status = PW_RESOURCE;
      for (size_t j = 0; j < n; j++) at[j] = r->q[j], from[j] = prescribed[j] ? from[j] : r->q[j];
      rank = s->rows;
    }
    if (status != PW_RETRY || pw_evaluate_J_at (r->w, r->t, at, r->v_given) != PW_OK) continue;
    int now = pw_rank_select (r->w, initial_tolerance[i % TOLERANCES], NULL, active);
    if (now < 0) status = pw_fail_memory (s, error);
    if (now < 0 || now == rank) continue;
    rank = now;
    r->active = active;
    later = (initial_failure){ .row = -1 };
    status = initial_attempt (r, prescribed, seek, from, &later, error);
    r->active = NULL;
    failure->assembled |= later.assembled;
  }
  free (at);
  return status;
}

/* Reports given velocities of which less than 1e-10 is left, in the norm of the metric: the wheels allow no motion. */
static int initial_locked (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  double given = 0, left = 0;
  char element[120], before[120] = "", text[300] = "";
  for (int j = 0; j < s->coords; j++) {
    given += s->metric[j] * r->v_given[j] * r->v_given[j];
    left += s->metric[j] * r->v[j] * r->v[j];
  }
  if (s->rows == s->holonomic || given == 0 || left > 1e-20 * given) return PW_OK;
  for (int i = s->holonomic; i < s->rows && strlen (text) < 150; i++) {
    size_t n = strlen (text);
    if (strcmp (pw_system_row_name (s, i, element, sizeof element), before) != 0)
      snprintf (text + n, sizeof text - n, "%s%s", n ? ", " : "", strcpy (before, element));
  }
  return pw_fail (error, PW_INITIAL,
                  "model %s: the given velocities would have to be removed entirely: %s allow no such motion", s->model,
                  text);
}

/* Sets of prescribed states, in the order tried: positions and velocities by origin, and positions of coordinates with
 * mass.  If the positions fail, the velocities are not tried. */
static const struct initial_set {
  unsigned char q, v;
  enum { INITIAL_FREE, INITIAL_MASS, INITIAL_MASS_PERHAPS } mass; /* PERHAPS: only if some of them may be unintended */
} initial_sets[] = {
  { PW_GIVEN | PW_SPECIFIED, PW_GIVEN | PW_SPECIFIED, INITIAL_MASS },
  { PW_GIVEN | PW_SPECIFIED, PW_GIVEN, INITIAL_MASS },
  { PW_GIVEN, PW_GIVEN | PW_SPECIFIED, INITIAL_MASS_PERHAPS },
  { PW_GIVEN, PW_GIVEN, INITIAL_MASS_PERHAPS },
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

/* The mask of a set of prescribed states; returns 0 if the set does not apply.  origin may be NULL: nothing is given or
 * specified. */
static int initial_mask (const pw_system *s, const unsigned char *origin, const struct initial_set *set,
                         unsigned char *mask) {
  int n = s->coords, massless = 0, massive = 0, perhaps = 0;
  for (int j = 0; j < n; j++) {
    int q = origin ? origin[j] : 0, v = origin ? origin[n + j] : 0;
    int keep = set->mass && s->mass[j] > 0 && !(q & set->q);
    mask[j] = (q & set->q) != 0 || keep;
    mask[n + j] = (v & set->v) != 0;
    massless += s->mass[j] == 0 && !mask[j], massive += keep, perhaps += keep && q & PW_UNSPECIFIED;
  }
  return !set->mass || (massless > 0 && massive > 0 && (set->mass == INITIAL_MASS || perhaps > 0));
}

/* 1 if a value given by the user is not prescribed by the mask. */
static int initial_released (const pw_system *s, const unsigned char *origin, const unsigned char *mask) {
  int released = 0;
  for (int j = 0; origin && j < 2 * s->coords; j++) released |= origin[j] & PW_GIVEN && !mask[j];
  return released;
}

static int initial_try (pw_run *r, const unsigned char *origin, initial_failure *failure, int *released,
                        pw_error *error) {
  const int sets = sizeof initial_sets / sizeof *initial_sets;
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords;
  unsigned char *mask = malloc (4 * n + 1);
  if (mask == NULL) return pw_fail_memory (s, error);
  unsigned char *last = mask + 2 * n;
  int status = PW_RETRY, small = (double)s->rows * s->coords < INITIAL_SMALL, before = -1, assembled = 0, given = 0;
  for (size_t j = 0; origin && j < 2 * n; j++) given |= origin[j] & PW_GIVEN;
  for (const struct initial_set *set = initial_sets; set < initial_sets + sets && status == PW_RETRY; set++) {
    if (!initial_mask (s, origin, set, mask)) continue;
    int ranked = small || !((set->q | set->v) & PW_SPECIFIED);
    if (ranked == before && memcmp (mask, last, assembled ? 2 * n : n) == 0) continue;
    int seek = small || (ranked && given && (double)s->rows * s->coords <= PW_RANK_MAX_ENTRIES);
    initial_failure now = { .row = -1 };
    status =
        ranked ? initial_ranked (r, mask, seek, &now, error) : initial_attempt (r, mask, seek, r->q_given, &now, error);
    memcpy (last, mask, 2 * n);
    before = ranked, assembled = now.assembled;
    if (now.row >= 0) *failure = now;
  }
  *released = initial_released (s, origin, mask);
  free (mask);
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
  if (!(before.position <= 2 * PW_RESIDUAL_GOOD && before.velocity <= 2 * PW_RESIDUAL_GOOD))
    status = initial_try (r, origin, &failure, &released, error);
  r->initial = (pw_initial_report){ .q_given = r->q_given,
                                    .v_given = r->v_given,
                                    .q = r->q,
                                    .v = r->v,
                                    .origin = r->origin,
                                    .released = released,
                                    .position = before.position,
                                    .velocity = before.velocity };
  if (status == PW_OK) status = initial_locked (r, error);
  if (status == PW_METHOD) return pw_fail_signal (r->t, error);
  return status == PW_RETRY ? initial_fail (r, &failure, error) : status;
}
