/* Accelerations a and multipliers lambda of a run, with Baumgarte's terms if selected:
 *
 *   M a + J^T lambda = f
 *   J a = gamma - 2 alpha (J v - eta) - beta^2 g     for holonomic rows
 *   J a = gamma - alpha (J v - eta)                  for nonholonomic ones
 *
 * (Baumgarte 1972, Stabilization of constraints and integrals of motion in dynamical systems.) */
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"
#include "specialised.h"

/* Specialised code is compiled for one scene and serves in place of the general evaluation and projection.  It refuses
 * states at which a pivot is small or a value extreme; the general functions evaluate these. */

/* pw_scene.update: evaluates the signals for the compiled code. */
static int specialised_update (void *workspace, double t, const double *q, const double *v) {
  return pw_update_signals (workspace, t, q, v);
}

/* Makes r->scene, the data of the compiled code; PW_OK or PW_RESOURCE. */
static int specialised_allocate (pw_run *r, int constants) {
  const pw_system *s = r->s;
  const void **element;
  const pw_kind **kind;
  const pw_signal **signal;
  double *constant; /* filled by `prepare` */
  if (!PW_ARENA_ARRAYS (&r->arena, PW_ARRAY (element, s->batches), PW_ARRAY (kind, s->batches),
                        PW_ARRAY (signal, s->sources), PW_ARRAY (constant, constants), PW_ARRAY (r->scene, 1)))
    return PW_RESOURCE;
  for (int i = 0; i < s->batches; i++) element[i] = s->batch[i].b.element, kind[i] = s->batch[i].kind;
  for (int i = 0; i < s->sources; i++) signal[i] = &r->w->source[i].signal;
  *r->scene = (pw_scene){ .element = element,
                          .kind = kind,
                          .signal = signal,
                          .constant = constant,
                          .mass = s->mass,
                          .force = s->constant,
                          .u = r->w->u,
                          .t_signal = &r->w->t_signal,
                          .update = specialised_update,
                          .workspace = r->w };
  return PW_OK;
}

void pw_specialised_select (pw_run *r) {
  const pw_specialised *code = r->settings.specialised;
  int suits = r->scene != NULL;
  for (int i = 0; suits && i < r->s->rows; i++) suits = code->independent[i] == (r->active == NULL || r->active[i]);
  r->specialised = suits ? code : NULL;
}

int pw_specialised_open (pw_run *r, pw_error *error) {
  const pw_specialised *code = r->settings.specialised;
  if (code == NULL || r->settings.integrals > 0 || r->events) return PW_OK;
  if (!pw_specialised_fits (code, r->s))
    return pw_fail (error, PW_INPUT, "model %s: the specialised code belongs to another scene", r->s->model);
  if (specialised_allocate (r, code->constants) != PW_OK) return pw_fail_memory (r->s, error);
  r->scene->length = r->w->scale.length, r->scene->speed = r->scene->length / r->w->scale.time;
  r->scene->redundant_residual = r->thresholds.redundant_residual;
  r->scene->alpha = r->alpha, r->scene->beta = r->beta;
  if (code->prepare (r->scene) != 0) r->scene = NULL;
  pw_specialised_select (r);
  return PW_OK;
}

void pw_specialised_count (pw_run *r, long evaluations, long iterations) {
  r->statistics.rhs += evaluations;
  r->statistics.specialised += evaluations;
  r->statistics.factorisations += evaluations + iterations;
}

/* After an evaluation at (q, v): makes the workspace and the saddle consistent with it, and counts it. */
static void specialised_finish (pw_run *r, const double *q, const double *v, long iterations) {
  if (r->s->coords > 3 * r->s->bodies) pw_point_to_internal (r->w, q, v);
  pw_saddle_postpone (r->saddle, PW_SCENE_PIVOT);
  pw_specialised_count (r, 1, iterations);
}

/* As pw_run_accelerate, if specialised code can do it: 1; 0 if not. */
static int specialised_evaluate (pw_run *r, double t, const double *q, const double *v, double *a, double *lambda) {
  if (!pw_specialised_suits (r)) return 0;
  if (r->specialised->evaluate (r->scene, t, q, v, a, lambda, r->w->configuration, r->w->J)) return 0;
  specialised_finish (r, q, v, 0);
  return 1;
}

/* The first stage of a step is the state reached, which has been evaluated. */
int pw_specialised_stages (pw_run *r, const pw_scene_step *x) {
  if (!pw_specialised_suits (r) || r->specialised->stages (r->scene, x)) return 0;
  pw_specialised_count (r, x->stages - 1, 0);
  return 1;
}

static void specialised_copy_residuals (pw_run *r) {
  const pw_scene *x = r->scene;
  r->residuals = (pw_residuals){ .position = x->position, .g = x->g, .velocity = x->velocity, .jv = x->jv };
}

int pw_specialised_project (const pw_projector *p, pw_run *r, double t, double *q, double *v, double *a,
                            double *lambda) {
  if (p->owns_velocity || !pw_specialised_suits (r)) return 0;
  if (r->specialised->project (r->scene, t, q, v, a, lambda, r->w->configuration, r->w->J)) return 0;
  specialised_finish (r, q, v, r->scene->iterations);
  if (r->active)
    pw_forget_residuals (r);
  else
    specialised_copy_residuals (r);
  return 1;
}

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

int pw_watchdog_near_state (pw_run *r) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  pw_saddle_factor (r->saddle);
  r->watchdog.singular_ahead = 1;
  return pw_watchdog_near (r);
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

/* Adds Baumgarte's terms to gamma. */
__attribute__ ((noinline)) static void dynamics_stabilise (pw_run *r, const double *v, double *gamma) {
  const pw_system *s = r->s;
  double *Jv = r->scratch + s->coords + 3 + s->rows, *eta = Jv + s->rows, *g = eta;
  pw_mul_J (r->w, v, Jv);
  pw_evaluate_eta (r->w, eta);
  for (int i = 0; i < s->rows; i++) gamma[i] -= (i < s->holonomic ? 2 : 1) * r->alpha * (Jv[i] - eta[i]);
  pw_evaluate_g (r->w, g);
  for (int i = 0; i < s->holonomic; i++) gamma[i] -= r->beta * r->beta * g[i];
}

/* The first coords + 3 + rows numbers of r->scratch stay free for callers. */
void pw_run_gamma (pw_run *r, const double *v, double *gamma) {
  pw_evaluate_gamma (r->w, gamma);
  if (r->alpha + r->beta != 0) dynamics_stabilise (r, v, gamma);
}

/* Solves K x = y (n x n) by elimination with partial pivoting; returns 0 unless the determinant is positive. */
static int dynamics_eliminate (double *K, double *y, int n) {
  int sign = 1;
  for (int i = 0; i < n; i++) {
    int best = i;
    for (int k = i + 1; k < n; k++)
      if (fabs (K[k * n + i]) > fabs (K[best * n + i])) best = k;
    for (int j = 0; j < n && best != i; j++) {
      const double swap = K[i * n + j];
      K[i * n + j] = K[best * n + j], K[best * n + j] = swap;
    }
    const double swap = y[i];
    y[i] = y[best], y[best] = swap;
    sign *= (best == i ? 1 : -1) * (K[i * n + i] > 0 ? 1 : -1);
    for (int k = i + 1; k < n; k++) {
      const double factor = K[k * n + i] / K[i * n + i];
      for (int j = i; j < n; j++) K[k * n + j] -= factor * K[i * n + j];
      y[k] -= factor * y[i];
    }
  }
  for (int i = n - 1; i >= 0; i--) {
    for (int j = i + 1; j < n; j++) y[i] -= K[i * n + j] * y[j];
    y[i] /= K[i * n + i];
  }
  return sign > 0;
}

/* Friction x of contacts that slide, multiples c of their normal multipliers, which are linear functions of it:
 *
 *   x = c lambda_N = c (lambda_N0 + L x),   lambda_N0: without friction;   columns of L: of unit friction alone
 *
 * The forces f without that friction, gamma: as of the equations.  The determinant of 1 - c L is that of the
 * non-symmetric system of equations over that of the symmetric one.  Where it is not positive, motions are not unique
 * (Painleve 1895; Genot & Brogliato 1999, European Journal of Mechanics A 18, 653-677). */
__attribute__ ((noinline)) static void dynamics_couple (pw_run *r, const double *f, const double *gamma) {
  const int rows = r->s->rows, m = r->couplings;
  const size_t n = (size_t)r->s->coords + 3;
  double *force = r->coupling_memory, *a = force + n, *lambda = a + n, *K = lambda + rows, *x = K + m * m;
  (void)pw_saddle_factor (r->saddle);
  for (const pw_coupling *c = r->coupling; c < r->coupling + m; c++) r->reaction[c->row] = 0;
  memcpy (force, f, n * sizeof *force);
  pw_add_given_forces (r, force);
  memcpy (lambda, gamma, (size_t)rows * sizeof *lambda);
  pw_saddle_solve (r->saddle, force, lambda, a, lambda);
  for (int k = 0; k < m; k++) x[k] = r->coupling[k].ratio * lambda[r->coupling[k].on];
  for (int j = 0; j < m; j++) {
    memset (force, 0, n * sizeof *force);
    memset (lambda, 0, (size_t)rows * sizeof *lambda);
    lambda[r->coupling[j].row] = -1;
    pw_add_JT (r->w, lambda, force);
    memset (lambda, 0, (size_t)rows * sizeof *lambda);
    pw_saddle_solve (r->saddle, force, lambda, a, lambda);
    for (int k = 0; k < m; k++) K[k * m + j] = (k == j) - r->coupling[k].ratio * lambda[r->coupling[k].on];
  }
  r->coupling_lost = !dynamics_eliminate (K, x, m);
  for (int k = 0; k < m; k++) r->reaction[r->coupling[k].row] = -x[k];
}

/* Returns the forces at the current configuration: those computed into f, or the system's array of constant forces if
 * there are no others.  gamma: as of the equations. */
static inline const double *dynamics_forces (pw_run *r, double *f, const double *gamma) {
  if (r->forces == 0) return r->s->constant;
  pw_evaluate_force (r->w, f);
  if (r->forces == PW_FORCES_AT_LIMITS) {
    if (r->couplings > 0) dynamics_couple (r, f, gamma);
    pw_add_given_forces (r, f);
  }
  return f;
}

/* Adds the correction dx to x.  Returns the largest correction over the largest value; NaN for 0 / 0. */
static double dynamics_correct (double *x, const double *dx, int n) {
  double value = 0, correction = 0;
  for (int i = 0; i < n; i++) {
    x[i] += dx[i];
    value = pw_larger (value, fabs (x[i])), correction = pw_larger (correction, fabs (dx[i]));
  }
  return correction / value;
}

/* Iterative refinement (Wilkinson 1963): near a singular configuration the factorisation has an error of eps / sine^2
 * (watchdog.c); refinement reduces it to eps / sine.  Each correction is smaller than the one before by the factor of
 * the first one: the one after 1e-8 is round-off. */
static void dynamics_refine (pw_run *r, const double *v, double *a, double *lambda) {
  const pw_system *s = r->s;
  double *f = r->scratch, *gamma = f + s->coords + 3;                                  /* residuals */
  double *da = r->w->scratch, *dlambda = da + s->coords + 3, *Jda = dlambda + s->rows; /* corrections */
  pw_run_gamma (r, v, gamma);
  if (dynamics_forces (r, f, gamma) != f) pw_evaluate_force (r->w, f);
  for (int j = 0; j < s->coords; j++) da[j] = a[j];
  for (int i = 0; i < s->rows; i++) dlambda[i] = lambda[i];
  double size = INFINITY;
  for (int pass = 0; pass < 3 && !(size < 1e-8);
       pass++) { /* the first solution is the correction of a = 0, lambda = 0 */
    for (int j = 0; j < s->coords; j++) f[j] -= s->mass[j] * da[j];
    for (int i = 0; i < s->rows; i++) dlambda[i] = -dlambda[i];
    pw_add_JT (r->w, dlambda, f);
    pw_mul_J (r->w, da, Jda);
    for (int i = 0; i < s->rows; i++) gamma[i] -= Jda[i];
    pw_saddle_solve (r->saddle, f, gamma, da, dlambda);
    size = pw_larger_or_nan (dynamics_correct (a, da, s->coords), dynamics_correct (lambda, dlambda, s->rows));
  }
}

void pw_run_accelerate_updated (pw_run *r, const double *v, double *a, double *lambda) {
  pw_run_gamma (r, v, lambda);
  const double *f = dynamics_forces (r, r->scratch, lambda);
  r->statistics.rhs++;
  pw_saddle_solve (r->saddle, f, lambda, a, lambda);
  if (pw_saddle_sine_below (r->saddle, r->thresholds.refine)) dynamics_refine (r, v, a, lambda);
}

/* Factorises and solves, with gamma of the constraints in the array of lambda; *near = 1 near a singular configuration,
 * where the status is PW_RETRY if the sine is at most r->refused_sine. */
PW_INLINE int dynamics_solve (pw_run *r, const double *v, double *a, double *lambda, int *near) {
  if (r->alpha + r->beta != 0) dynamics_stabilise (r, v, lambda);
  const double *f = dynamics_forces (r, r->scratch, lambda);
  r->statistics.rhs++;
  r->statistics.factorisations++;
  int status = pw_saddle_factor_solve (r->saddle, f, lambda, a, lambda);
  *near = r->watchdog.singular_ahead && pw_watchdog_near (r);
  if (*near && r->watchdog.evaluated_sine <= r->refused_sine) return PW_RETRY;
  if (status == PW_OK && pw_saddle_sine_below (r->saddle, r->thresholds.refine)) dynamics_refine (r, v, a, lambda);
  return status;
}

int pw_run_accelerate_by_gamma (pw_run *r, const double *v, double *a, double *lambda) {
  int near;
  return dynamics_solve (r, v, a, lambda, &near);
}

int pw_run_accelerate_evaluated (pw_run *r, const double *v, double *a, double *lambda) {
  pw_evaluate_gamma (r->w, lambda);
  return pw_run_accelerate_by_gamma (r, v, a, lambda);
}

int pw_run_accelerate (pw_run *r, double t, const double *q, const double *v, double *a, double *lambda) {
  if (specialised_evaluate (r, t, q, v, a, lambda)) return PW_OK;
  int near, status = pw_update_kinematics (r->w, t, q, v);
  if (status != PW_OK) return status;
  pw_evaluate_J_gamma (r->w, lambda);
  status = dynamics_solve (r, v, a, lambda, &near);
  if (near) r->near_singular = 1;
  return status;
}

void pw_sample_reached (pw_run *r) {
  memcpy (r->q_at, r->q, pw_state_length (r->s) * sizeof *r->q);
  memcpy (r->ledger_at, r->ledger, (size_t)r->entries * sizeof (double));
  r->projected_at = r->projected;
  (void)pw_evaluate_J_at (r->w, r->t, r->q_at, r->v_at);
}

/* Completes r->residuals: those below the largest so far, unless the constraints were lost then, need not be known. */
PW_SELDOM void dynamics_evaluate_residuals (pw_run *r) {
  pw_residuals *now = &r->residuals;
  const double lost = pw_lost_residual (r), position = fmin (r->statistics.position, lost),
               velocity = fmin (r->statistics.velocity, lost);
  if (pw_specialised_suits (r) && !r->active && isnan (now->position) && isnan (now->velocity)) {
    r->specialised->residuals (r->scene, r->q, r->v, r->w->configuration, r->w->J);
    specialised_copy_residuals (r);
  }
  if (isnan (now->position)) pw_evaluate_position_residual (r->w, r->enforced, position, now);
  if (isnan (now->velocity)) pw_evaluate_velocity_residual (r->w, r->enforced, velocity, now);
}

void pw_record_residuals (pw_run *r) {
  const pw_residuals *now = &r->residuals;
  pw_statistics *largest = &r->statistics;
  if (isnan (now->position) || isnan (now->velocity)) dynamics_evaluate_residuals (r);
  largest->position = pw_larger (largest->position, now->position);
  largest->velocity = pw_larger (largest->velocity, now->velocity);
  largest->g = pw_larger (largest->g, now->g);
  largest->jv = pw_larger (largest->jv, now->jv);
}

/* For the methods themselves; methods.c, which reads options, depends on all methods. */
double pw_run_option (const pw_run *r, const char *name) {
  int i = 0;
  while (r->method->options[i].name && strcmp (r->method->options[i].name, name) != 0) i++;
  return r->method->options[i].name ? r->option[i] : 0;
}

void pw_run_evaluate_sides (pw_run *r, double t, const double *q, const double *v, double *beyond) {
  double *read = r->sides->read;
  for (const pw_source *x = r->sides->of; x < r->sides->of + r->sides->functions; x++) {
    for (int i = 0; q && i < x->reads; i++) {
      const int j = x->state[i];
      read[i] = j < r->s->coords ? q[j] : v[j - r->s->coords];
    }
    const int count = x->signal.function.sides (x->signal.function.context, t, q ? read : NULL, beyond);
    if (beyond) beyond += count;
  }
}

/* Fixes the sides at a state; q NULL: frees them. */
static void sides_fix (pw_run *r, double t, const double *q, const double *v) {
  if (r->sides == NULL) return;
  pw_run_evaluate_sides (r, t, q, v, NULL);
  r->sides->fixed = q != NULL;
  r->w->t_signal = NAN;
}

void pw_run_fix_sides (pw_run *r) {
  const size_t n = (size_t)r->s->coords;
  if (r->sides == NULL) return;
  r->sides->t = r->t;
  memcpy (r->sides->state, r->q, n * sizeof *r->q);
  memcpy (r->sides->state + n, r->v, n * sizeof *r->v);
  sides_fix (r, r->t, r->q, r->v);
}

void pw_run_free_sides (pw_run *r) {
  sides_fix (r, r->t, NULL, NULL);
}

void pw_run_serialise_sides (pw_run *r, pw_archive *a) {
  pw_sides *x = r->sides;
  if (x == NULL) return;
  pw_archive_bytes (a, &x->t, sizeof x->t);
  pw_archive_bytes (a, &x->fixed, sizeof x->fixed);
  pw_archive_bytes (a, &x->h, sizeof x->h);
  pw_archive_bytes (a, x->changed, (size_t)x->count);
  pw_archive_bytes (a, x->size, (size_t)x->count * sizeof *x->size);
  pw_archive_bytes (a, x->state, 2 * (size_t)r->s->coords * sizeof *x->state);
  pw_archive_bytes (a, &r->interrupted, sizeof r->interrupted);
  if (a->loading && !a->failed && x->fixed) sides_fix (r, x->t, x->state, x->state + r->s->coords);
}
