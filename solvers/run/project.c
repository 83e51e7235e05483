/* Coordinate projection: the nearest positions with g = 0, the nearest velocities with J v = eta, in the metric W.
 *
 *   [ W G^T ] [ dq ]   [  0 ]          [ W J^T ] [ dv ]   [     0     ]
 *   [ G  0  ] [ mu ] = [ -g ]          [ J  0  ] [ mu ] = [ eta - J v ]
 *
 * G: the holonomic rows of J; mu: multipliers of the projection.
 *
 * (Lubich 1991, Extrapolation integrators for constrained multibody systems; Eich 1993, Convergence results for a
 * coordinate projection method applied to mechanical systems with algebraic constraints.) */
#include "method.h"
#include "specialised.h"

/* With the mass matrix as metric of positions massless coordinates do not contribute to the norm: the constraint
 * equations determine them, as in the accelerations, and coordinates with mass do not move because of them.  If the
 * holonomic equations do not determine all of them, the run's saddle is used, which contains all equations: the change
 * of positions then satisfies the nonholonomic ones, too. */
int pw_projector_open (pw_projector *p, pw_run *r, const double *weight_q, const double *weight_v, pw_error *error) {
  const pw_system *s = r->s;
  *p = (pw_projector){ .owns_velocity = weight_v != NULL,
                       .velocity = weight_v ? NULL : r->saddle,
                       .active = r->active,
                       .contradictory_row = -1 };
  pw_error cause = { 0 };
  p->position = pw_saddle_open (r->w, weight_q ? weight_q : s->mass, s->holonomic, r->active, &cause);
  if (p->position == NULL && !weight_q && cause.status != PW_RESOURCE) p->position = r->saddle;
  if (p->position == NULL) pw_fail (error, cause.status, "%s", cause.text);
  p->owns_position = p->position != r->saddle;
  if (p->owns_velocity) p->velocity = pw_saddle_open (r->w, weight_v, s->rows, r->active, error);
  if (p->position && p->velocity) return PW_OK;
  pw_projector_close (p);
  return PW_RESOURCE;
}

const char *const pw_metrics[] = { "mass", "identity", NULL };

/* The identity metric weights metres and radians equally, as the plain pseudo-inverse does. */
int pw_projector_open_by_options (pw_projector *p, pw_run *r, pw_error *error) {
  double *ones = r->scratch;
  if (pw_run_option (r, "metric") == 0) return pw_projector_open (p, r, NULL, NULL, error);
  for (int j = 0; j < r->s->coords; j++) ones[j] = 1;
  return pw_projector_open (p, r, ones, ones, error);
}

void pw_projector_close (pw_projector *p) {
  if (p->owns_position) pw_saddle_close (p->position);
  if (p->owns_velocity) pw_saddle_close (p->velocity);
  *p = (pw_projector){ 0 };
}

/* PW_RETRY if a redundant equation is violated where the others hold: it contradicts them.  size: scratch. */
static int project_check_redundant (pw_projector *p, const pw_run *r, const double *g, double *size) {
  double largest = r->thresholds.redundant_residual;
  if (p->active == NULL || p->ignores_inactive) return PW_OK;
  pw_evaluate_g_size (r->w, size);
  for (int i = 0; i < r->s->holonomic; i++) {
    double residual = p->active[i] || (r->enforced && !r->enforced[i]) ? 0 : fabs (g[i]) / size[i];
    if (residual > largest || isnan (residual)) largest = residual, p->contradictory_row = i;
  }
  return p->contradictory_row < 0 ? PW_OK : PW_RETRY;
}

/* Residuals below this one need not be computed: an iteration has converged, and there have been larger ones. */
static double project_known (double largest) {
  return largest < PW_RESIDUAL_CONVERGED ? largest : PW_RESIDUAL_CONVERGED;
}

double pw_largest_angle (const pw_system *s, const double *q) {
  double largest = 1;
  for (int b = 0; b < s->bodies; b++) largest = fmax (largest, fabs (q[3 * b + 2]));
  return largest;
}

/* As pw_project_positions; then J and, unless it is NULL, gamma are evaluated. */
static int project_positions (pw_projector *p, pw_run *r, double t, double *q, const double *v, double *gamma) {
  const int max_iterations = 30; /* quadratic convergence needs some 5; a bad start needs more */
  const pw_system *s = r->s;
  pw_residuals now = { 0 };
  double *g = r->scratch, *size = g + s->rows, *mu = size + s->rows, *dq = mu + s->rows;
  double previous = INFINITY; /* the residual before the last correction */
  double accepted = PW_RESIDUAL_ACCEPTED, at_large_angles = 0;
  const double known = project_known (r->statistics.position);
  p->contradictory_row = -1;
  for (p->iterations = 0;; p->iterations++) {
    int status = pw_update_kinematics (r->w, t, q, v);
    if (status != PW_OK) return status;
    pw_evaluate_g (r->w, g);
    pw_worst_position (r->w, g, size, p->active, known, &now);
    int stalled = now.position > previous / 4; /* at round-off, since convergence is quadratic */
    if (now.position <= PW_RESIDUAL_CONVERGED) break;
    if (stalled && now.position <= accepted) break;
    if (p->iterations >= max_iterations || !isfinite (now.position)) return PW_RETRY;
    if (p->iterations == 0) at_large_angles = accepted * pw_largest_angle (s, q); /* not later: it may diverge */
    if (stalled) accepted = at_large_angles; /* if the next correction stalls, too */
    previous = now.position;
    pw_evaluate_J (r->w);
    r->statistics.factorisations++;
    if (pw_saddle_factor (p->position) != PW_OK) return PW_RETRY;
    for (int i = 0; i < s->rows; i++) g[i] = i < s->holonomic ? -g[i] : 0;
    pw_saddle_solve (p->position, NULL, g, dq, mu);
    for (int j = 0; j < s->coords; j++) q[j] += dq[j];
  }
  if (p->active == NULL) r->residuals.position = now.position, r->residuals.g = now.g;
  int status = project_check_redundant (p, r, g, size);
  if (status != PW_OK) return status;
  if (gamma)
    pw_evaluate_J_gamma (r->w, gamma);
  else
    pw_evaluate_J (r->w);
  return PW_OK;
}

int pw_project_positions (pw_projector *p, pw_run *r, double t, double *q, const double *v) {
  return project_positions (p, r, t, q, v, NULL);
}

/* v += dv with J (v + dv) = eta; p->velocity must be factorised. */
static void project_correct_velocities (pw_projector *p, pw_run *r, double *v) {
  const pw_system *s = r->s;
  double *right = r->scratch, *eta = right + s->rows, *mu = eta + s->rows, *dv = mu + s->rows;
  pw_mul_J (r->w, v, right);
  if (s->rheonomic) pw_evaluate_eta (r->w, eta);
  for (int i = 0; i < s->rows; i++) right[i] = (s->rheonomic ? eta[i] : 0) - right[i];
  pw_saddle_solve (p->velocity, NULL, right, dv, mu);
  for (int j = 0; j < s->coords; j++) v[j] += dv[j];
}

int pw_project_velocities (pw_projector *p, pw_run *r, double *v) {
  r->statistics.factorisations++;
  if (pw_saddle_factor (p->velocity) != PW_OK) return PW_RETRY;
  project_correct_velocities (p, r, v);
  if (pw_saddle_sine_below (p->velocity, r->thresholds.refine)) project_correct_velocities (p, r, v);
  return pw_update_velocities (r->w, v);
}

/* 1 if the velocities satisfy J v = eta to round-off and need no correction; J must be evaluated.  0 also with another
 * metric than M; and near a singular configuration and with redundant equations, where small residuals do not imply
 * small errors. */
static int project_accepts_velocities (const pw_projector *p, pw_run *r) {
  r->residuals.velocity = NAN;
  if (p->owns_velocity || p->active || r->near_singular) return 0;
  pw_residuals now;
  pw_evaluate_velocity_residual (r->w, NULL, project_known (r->statistics.velocity), &now);
  if (!(now.velocity <= PW_RESIDUAL_CONVERGED)) return 0;
  r->residuals.velocity = now.velocity, r->residuals.jv = now.jv;
  return 1;
}

static int project_state (pw_projector *p, pw_run *r, double t, double *q, double *v, double *a, double *lambda) {
  if (r->specialised && pw_specialised_project (p, r, t, q, v, a, lambda)) {
    p->iterations = r->scene->iterations, p->contradictory_row = -1;
    return PW_OK;
  }
  int status = project_positions (p, r, t, q, v, lambda);
  if (status != PW_OK) return status;
  if (project_accepts_velocities (p, r)) return pw_run_accelerate_by_gamma (r, v, a, lambda);
  status = pw_project_velocities (p, r, v);
  if (status != PW_OK) return status;
  if (p->owns_velocity) return pw_run_accelerate_evaluated (r, v, a, lambda);
  pw_run_accelerate_updated (r, v, a, lambda);
  return PW_OK;
}

int pw_project_state (pw_projector *p, pw_run *r, double t, double *q, double *v, double *a, double *lambda,
                      double *added_energy) {
  int status = added_energy ? pw_update_kinematics (r->w, t, q, v) : PW_OK;
  if (status != PW_OK) return status;
  double before = added_energy ? pw_energy (r, v) : 0;
  status = project_state (p, r, t, q, v, a, lambda);
  if (status == PW_OK && added_energy) *added_energy += pw_energy (r, v) - before;
  return status;
}

/* e += de with W de + J^T mu = 0 and J (e + de) = 0; J de = 0 for the equations after the first `rows`. */
void pw_project_error (pw_run *r, pw_saddle *saddle, double *e, int rows) {
  const pw_system *s = r->s;
  double *right = r->scratch, *mu = right + s->rows, *de = mu + s->rows;
  pw_mul_J (r->w, e, right);
  for (int i = 0; i < s->rows; i++) right[i] = i < rows ? -right[i] : 0;
  pw_saddle_solve (saddle, NULL, right, de, mu);
  for (int j = 0; j < s->coords; j++) e[j] += de[j];
}
