/* Explicit Runge-Kutta methods with the coefficients A, b on q' = v, v' = a (t, q, v).
 *
 *   stage i      q_i = q + h sum_j A_ij v_j,   v_i = v + h sum_j A_ij a_j,   j < i
 *   new state    q + h sum_j b_j v_j,          v + h sum_j b_j a_j
 *
 * The rates of work and losses are integrated with the same stages.  The new state may be projected.  Its accelerations
 * are evaluated immediately, as stage 0 of the next step, so that they are always available. */
#include <stdlib.h>
#include <string.h>
#include "rk.h"
#include "dense_output.h"
#include "specialised.h"

enum { NULLSPACE_MOST = 256 }; /* constraint equations: their matrix is dense */
enum { RK_NODES = 3 };         /* states inside a step between which samples are interpolated */

/* Null-space velocities; see below. */
typedef struct {
  int rows;          /* active constraint equations */
  int *active_index; /* all equations: index among the active ones, or -1 */
  double *W_inv_J0T; /* coords x rows: W^-1 J0^T */
  double *K;         /* rows x rows: J W^-1 J0^T, eliminated in place */
  double *mu;        /* rows: eta - J w, then the multipliers of the correction */
  double *eta;       /* all equations */
  double *v;         /* coords + 3: scratch */
  char *memory;
} rk_nullspace;

struct pw_method_data {
  const pw_tableau *tableau;
  pw_rk_row row[PW_RK_STAGES]; /* nonzero weights: [i] of stage i > 0; [0] of the new state, as stage 0 has none */
  pw_rk_row estimate[3];       /* those of e, e3, e6 */
  int projects, every;         /* 1: coordinate projection; steps from one projection to the next */
  int uses_nullspace;          /* 1: stabilisation nullspace */
  int nullspace_projects;      /* 1: with positions projected after each step */
  int holds_signals;           /* 1: signals of forces are constant over a step */
  pw_projector projector;
  rk_nullspace nullspace;
  int off_grid; /* 1: the last step was divided and ended between the multiples of the step size */
  /* velocities, accelerations, and rates of the ledger's entries at the stages, then at the new state */
  double *stage_v[PW_RK_STAGES], *stage_a[PW_RK_STAGES], *stage_rate[PW_RK_STAGES];
  double *q, *v, *a, *lambda; /* the new state, laid out as in pw_run; before: q, lambda of a stage */
  double *own;                /* the run's own array: it, d->q and d->last.q change places in each step */
  double h, last_error;       /* adaptive: size of the next step, error of the last one */
  double *weight;             /* adaptive: reciprocal tolerances: [2 j] of q_j, [2 j + 1] of v_j */
  pw_step_start last, second; /* of the last step, for samples inside it; of the second part of a divided step */
  /* adaptive: states inside the last step for interpolation (rk_interpolate); their state: 0: not evaluated, 1: valid,
   * -1: invalid; the time of the last sample inside the step, and the number of samples at increasing times up to it */
  pw_step_start node[RK_NODES];
  int nodes, samples;
  double nodes_end; /* the end of the step whose nodes were evaluated: an event may have shortened it since then */
  double sampled;
  char *memory;
};

/* Null-space velocities, u = B^T W v.  The columns of B are a basis of ker J0, with J0 the constraint matrix at the
 * beginning of the step, constant over the step.  W is the metric of positions: the mass matrix, with small weights for
 * massless coordinates.  The equations integrated are
 *
 *   q' = v(t, q, u),    u' = B^T W a(t, q, v),      v:  J(t, q) v = eta,  B^T W v = u
 *
 * so that all velocity constraints hold at every stage, for any step size.  u has as many entries as there are degrees
 * of freedom.  Since B is constant, a Runge-Kutta stage of u is B^T W w, with w the stage of v by the same formula.
 * Then B^T W (v - w) = 0, which puts v - w in the range of W^-1 J0^T.  So no basis is formed, and the result is
 * independent of its choice:
 *
 *   v = w + W^-1 J0^T mu,    K mu = eta - J w,    K = J W^-1 J0^T
 *
 * The next step uses another basis; v, and with it the motion, does not change.  With this W a body made of two welded
 * parts moves like one body, up to round-off, and massless coordinates follow the massive ones.  (Kim & Vanderploeg
 * 1986, QR decomposition for state space representation of constrained mechanical dynamic systems: a basis kept while
 * it is well conditioned; Mani, Haug & Atkinson 1985, Application of singular value decomposition for analysis of
 * mechanical system dynamics.) */

/* Errors: PW_INPUT if the scene has more than NULLSPACE_MOST independent constraint equations; PW_RESOURCE. */
static int nullspace_open (rk_nullspace *b, pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  *b = (rk_nullspace){ .rows = 0 };
  for (int i = 0; i < s->rows; i++) b->rows += r->active == NULL || r->active[i];
  if (b->rows > NULLSPACE_MOST)
    return pw_fail (error, PW_INPUT,
                    "model %s: stabilisation nullspace works with dense matrices, for up to %d constraint rows, and "
                    "this scene has %d; use %s+projection",
                    s->model, NULLSPACE_MOST, b->rows, r->method->name);
  const size_t m = (size_t)b->rows, all = (size_t)s->rows, n = (size_t)s->coords;
  b->memory = PW_ALLOC_ARRAYS (PW_ARRAY (b->W_inv_J0T, n * m), PW_ARRAY (b->K, m * m), PW_ARRAY (b->mu, m),
                               PW_ARRAY (b->eta, all), PW_ARRAY (b->v, n + 3), PW_ARRAY (b->active_index, all));
  if (b->memory == NULL) return pw_fail_memory (s, error);
  for (int i = 0, count = 0; i < s->rows; i++) b->active_index[i] = r->active && !r->active[i] ? -1 : count++;
  return PW_OK;
}

/* Computes K and mu = eta - J w with the J last evaluated. */
static void nullspace_assemble (rk_nullspace *b, pw_run *r, const double *w) {
  const pw_system *s = r->s;
  const int m = b->rows;
  memset (b->K, 0, (size_t)(m * m) * sizeof *b->K);
  if (s->rheonomic) pw_evaluate_eta (r->w, b->eta); /* else it stays 0 */
  PW_EACH_CONSTRAINT (k, r->w)
    for (int n = 0; n < k->b.count * k->kind->rows; n++) {
      int i = b->active_index[k->row + n];
      if (i < 0) continue;
      b->mu[i] = b->eta[k->row + n];
      for (int c = 0; c < k->b.cols; c++) {
        int j = pw_global (k, n / k->kind->rows, c);
        double J = k->J[n * k->b.cols + c];
        if (j >= s->coords) continue; /* the ground */
        b->mu[i] -= J * w[j];
        pw_add_scaled (b->K + i * m, b->W_inv_J0T + j * m, J, m);
      }
    }
}

/* mu = K^-1 mu by Gaussian elimination with pivoting; row i is scaled to the largest entry 1.  PW_RETRY if a pivot is
 * round-off, as for dependent constraint equations, or a row is 0 or not finite. */
static int nullspace_eliminate (double *K, double *mu, int m) {
  const double least = 1e-13; /* some 500 eps */
  for (int i = 0; i < m; i++) {
    double most = 0;
    for (int j = 0; j < m; j++) most = pw_larger_or_nan (most, fabs (K[i * m + j]));
    if (!(most > 0 && isfinite (most))) return PW_RETRY;
    for (int j = 0; j < m; j++) K[i * m + j] *= 1 / most;
    mu[i] /= most;
  }
  for (int p = 0; p < m; p++) {
    int pivot = p;
    for (int i = p + 1; i < m; i++)
      if (fabs (K[i * m + p]) > fabs (K[pivot * m + p])) pivot = i;
    if (!(fabs (K[pivot * m + p]) > least)) return PW_RETRY;
    for (int j = 0; j < m; j++) {
      double x = K[p * m + j];
      K[p * m + j] = K[pivot * m + j], K[pivot * m + j] = x;
    }
    double x = mu[p], inverse;
    mu[p] = mu[pivot], mu[pivot] = x;
    inverse = K[p * m + p] = 1 / K[p * m + p];
    for (int i = p + 1; i < m; i++) {
      double factor = K[i * m + p] * inverse;
      if (factor == 0) continue; /* K is sparse: in chains it is banded */
      pw_add_scaled (&K[i * m + p + 1], &K[p * m + p + 1], -factor, m - p - 1);
      mu[i] -= factor * mu[p];
    }
  }
  for (int i = m - 1; i >= 0; i--) {
    for (int j = i + 1; j < m; j++) mu[i] -= K[i * m + j] * mu[j];
    mu[i] *= K[i * m + i];
  }
  return PW_OK;
}

/* Sets W^-1 J0^T for a step from the state reached.  PW_METHOD if a signal failed. */
static int nullspace_begin (rk_nullspace *b, pw_run *r) {
  const pw_system *s = r->s;
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  PW_EACH_CONSTRAINT (k, r->w)
    for (int n = 0; n < k->b.count * k->kind->rows; n++)
      for (int i = b->active_index[k->row + n], c = i < 0 ? k->b.cols : 0; c < k->b.cols; c++) {
        int j = pw_global (k, n / k->kind->rows, c);
        if (j < s->coords) b->W_inv_J0T[j * b->rows + i] = k->J[n * k->b.cols + c] / s->metric[j];
      }
  return PW_OK;
}

/* Corrects v with the J last evaluated; updates the velocity kinematics.  Returns as nullspace_velocities. */
static int nullspace_correct_velocities (rk_nullspace *b, pw_run *r, double *v) {
  const double *row = b->W_inv_J0T;
  nullspace_assemble (b, r, v);
  if (nullspace_eliminate (b->K, b->mu, b->rows) != PW_OK) return PW_RETRY;
  for (int j = 0; j < r->s->coords; j++, row += b->rows)
    for (int n = 0; n < b->rows; n++) v[j] += row[n] * b->mu[n];
  return pw_update_velocities (r->w, v);
}

/* Replaces v by the velocities at (t, q) with the same null-space velocities; updates kinematics and J.  PW_RETRY if
 * the step is too large for its basis, or the configuration is singular; PW_METHOD if a signal failed. */
static int nullspace_velocities (rk_nullspace *b, pw_run *r, double t, const double *q, double *v) {
  int status = pw_evaluate_J_at (r->w, t, q, v);
  return status == PW_OK ? nullspace_correct_velocities (b, r, v) : status;
}

/* Accelerations and multipliers right after nullspace_velocities.  Returns as pw_run_accelerate. */
static int nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda) {
  int status = pw_run_accelerate_evaluated (r, v, a, lambda);
  if (pw_watchdog_near (r)) r->near_singular = 1;
  return status;
}

/* At the end of a step: projects positions onto g = 0 unless p is NULL, then as nullspace_velocities; *added_energy,
 * unless it is NULL, grows by the energy [J] that the projection adds. */
static int nullspace_finalise (rk_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v,
                               double *added_energy) {
  int status = PW_OK;
  double before = 0;
  if (p == NULL || r->s->holonomic == 0) return nullspace_velocities (b, r, t, q, v);
  if (added_energy) { /* before the projection, with the same null-space velocities */
    memcpy (b->v, v, (size_t)r->s->coords * sizeof *v);
    status = nullspace_velocities (b, r, t, q, b->v);
    if (status == PW_OK) before = pw_energy (r, b->v);
  }
  if (status == PW_OK) status = pw_project_positions (p, r, t, q, v);
  if (status == PW_OK) status = nullspace_correct_velocities (b, r, v);
  if (status == PW_OK && added_energy) *added_energy += pw_energy (r, v) - before;
  return status;
}

static int rk_projects_next (const pw_run *r) {
  const pw_method_data *d = r->data;
  return d->projects && (d->every == 1 || (r->statistics.steps + 1) % d->every == 0);
}

/* (q, v) = (q0, v0) + h sum_j weight_j (v_j, a_j) over `terms` weights of a row of the tableau from the j-th on. */
PW_INLINE void rk_add (const pw_run *r, const pw_rk_row *row, int j, int terms, double h, double *q, double *v,
                       const double *q0, const double *v0) {
  const double *dq[2], *dv[2];
  double factor[2];
  PW_UNROLL for (int k = 0; k < terms; k++) {
    const int stage = row->stage[j + k];
    dq[k] = r->data->stage_v[stage], dv[k] = r->data->stage_a[stage], factor[k] = h * row->weight[j + k];
  }
  for (int i = 0, n = r->s->coords; i < n; i += 2) { /* two numbers at a time, the last one perhaps of the ground */
    pw_pair sum_q = PW_PAIR (q0, i), sum_v = PW_PAIR (v0, i);
    PW_UNROLL for (int k = 0; k < terms; k++) {
      sum_q += factor[k] * PW_PAIR (dq[k], i);
      sum_v += factor[k] * PW_PAIR (dv[k], i);
    }
    *(pw_pair *)(q + i) = sum_q, *(pw_pair *)(v + i) = sum_v;
  }
}

/* (q, v) = the state reached + h sum_j weight_j (v_j, a_j), with the weights of a row of the tableau, two at a time. */
static void rk_combine (const pw_run *r, double *q, double *v, const pw_rk_row *row, double h) {
  const double *q0 = r->q, *v0 = r->v;
  int j = row->count & 1;
  if (j) {
    rk_add (r, row, 0, 1, h, q, v, q0, v0);
    q0 = q, v0 = v;
  }
  for (; j < row->count; j += 2, q0 = q, v0 = v) rk_add (r, row, j, 2, h, q, v, q0, v0);
}

/* The ledger at the end of a step, from that at its beginning: end = beginning + h sum_j b_j rate_j. */
static void rk_ledger (const pw_run *r, double *end, const double *beginning, double h) {
  const pw_method_data *d = r->data;
  const pw_rk_row *b = &d->row[0];
  for (int i = 0; i < r->entries; i++) {
    double sum = beginning[i];
    for (int j = 0; j < b->count; j++) sum += h * b->weight[j] * d->stage_rate[b->stage[j]][i];
    end[i] = sum;
  }
}

/* Accelerations of a stage at the positions d->q and the velocities v, which the null-space method replaces, and the
 * rates of the ledger. */
static inline int rk_evaluate_stage (pw_run *r, double t, double *v, double *a, double *rate) {
  pw_method_data *d = r->data;
  int status;
  if (d->uses_nullspace) {
    status = nullspace_velocities (&d->nullspace, r, t, d->q, v);
    if (status == PW_OK) status = nullspace_accelerate (r, v, a, d->lambda);
  } else {
    status = pw_run_accelerate (r, t, d->q, v, a, d->lambda);
  }
  if (status == PW_OK && r->entries > 0) pw_ledger_rates (r, d->lambda, rate);
  return status;
}

/* The time of stage i of a step to t1 = t + h; exactly t1 at its end, since signals are evaluated once per time. */
static double rk_stage_time (const pw_run *r, int i, double h, double t1) {
  const double c = r->data->tableau->c[i];
  return pw_before_breakpoint (r, c == 1 ? t1 : r->t + c * h);
}

/* Does what rk_stages does by specialised code: 1; 0 if none suits, or it refuses a stage. */
static int rk_stages_specialised (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  if (r->specialised == NULL || d->holds_signals || d->uses_nullspace) return 0;
  return pw_specialised_stages (r, &(pw_scene_step){ d->tableau->stages, d->row, d->tableau->c, h, r->t,
                                                     pw_before_breakpoint (r, t1), r->q, d->stage_v, d->stage_a,
                                                     d->stage_rate, d->q, d->v, d->lambda });
}

/* Evaluates stages 1, 2, ...; stage 0 is the state reached.  Then combines them into the new state.  Returns as
 * pw_run_accelerate. */
static int rk_stages (pw_run *r, double h, double t1) {
  pw_method_data *d = r->data;
  const pw_tableau *tableau = d->tableau;
  d->stage_v[0] = r->v, d->stage_a[0] = r->a, d->stage_rate[0] = r->rate;
  if (rk_stages_specialised (r, h, t1)) return PW_OK;
  int status = PW_OK;
  if (d->holds_signals) { /* since a sample or a rejected step, the workspace may be at another state */
    status = pw_update_kinematics (r->w, r->t, r->q, r->v);
    pw_hold_signals (r->w, status == PW_OK ? PW_HOLD_INPUTS : PW_HOLD_NONE);
  }
  for (int i = 1; i < tableau->stages && status == PW_OK; i++) {
    rk_combine (r, d->q, d->stage_v[i], &d->row[i], h);
    status = rk_evaluate_stage (r, rk_stage_time (r, i, h, t1), d->stage_v[i], d->stage_a[i], d->stage_rate[i]);
  }
  if (d->holds_signals) pw_hold_signals (r->w, PW_HOLD_NONE);
  if (status != PW_OK) return status;
  rk_combine (r, d->q, d->v, &d->row[0], h);
  return pw_is_finite_state (r, d->q, d->v) ? PW_OK : PW_RETRY;
}

/* A step from the state reached to the new state at t1 = t + h: d->q, d->v, d->a, d->lambda.  project: 1 to project the
 * new state onto the constraints; *added_energy, unless it is NULL, grows by the energy [J] that projections add.
 * PW_RETRY if a smaller step may succeed; PW_METHOD if a signal failed. */
static int rk_step (pw_run *r, double h, double t1, int project, double *added_energy) {
  pw_method_data *d = r->data;
  int status = d->uses_nullspace ? nullspace_begin (&d->nullspace, r) : PW_OK;
  if (status == PW_OK) status = rk_stages (r, h, t1);
  if (status != PW_OK) return status;
  if (project) return pw_project_state (&d->projector, r, t1, d->q, d->v, d->a, d->lambda, added_energy);
  if (!d->uses_nullspace) return pw_run_accelerate (r, t1, d->q, d->v, d->a, d->lambda);
  status =
      nullspace_finalise (&d->nullspace, d->nullspace_projects ? &d->projector : NULL, r, t1, d->q, d->v, added_energy);
  return status == PW_OK ? nullspace_accelerate (r, d->v, d->a, d->lambda) : status;
}

static void rk_point (double *state, size_t n, double **q, double **v, double **a, double **lambda) {
  *q = state, *v = state + n, *a = *v + n, *lambda = *a + n;
}

/* Makes the new state the state reached. */
static void rk_accept (pw_run *r, double h, double t1, double added_energy) {
  pw_method_data *d = r->data;
  const size_t n = (size_t)r->s->coords + 3;
  double *const reached = d->q, *const spare = d->last.q;
  d->nodes = d->samples = 0;
  d->last.t = r->t, d->last.projected = r->projected, d->last.q = r->q;
  for (int i = 0; i < r->entries; i++) d->last.ledger[i] = r->ledger[i], d->last.rate[i] = r->rate[i];
  rk_point (reached, n, &r->q, &r->v, &r->a, &r->lambda);
  rk_point (spare, n, &d->q, &d->v, &d->a, &d->lambda);
  r->t = t1;
  rk_ledger (r, r->ledger, d->last.ledger, h);
  r->projected += added_energy;
  pw_ledger_rates (r, r->lambda, r->rate);
}

double pw_rk_distance (const pw_run *r, const double *q, const double *v) {
  double most = 0;
  for (int j = 0; j < r->s->coords; j++) {
    double dq = j < r->s->mechanical ? fabs (q[j] - r->q_at[j]) / pw_unit (r->s, j) : 0;
    double dv = fabs (v[j] - r->v_at[j]) / pw_velocity_unit (r, j, v[j]);
    most = pw_larger_or_nan (most, pw_larger_or_nan (dq, dv));
  }
  return most;
}

/* Reports why no step from the state at t succeeds; h: the size reported; status: result of the last attempt; divided:
 * 1 if it was divided near a singular configuration. */
static int rk_fail (pw_run *r, int status, double t, double h, int divided, pw_error *error) {
  int finite = pw_is_finite_state (r, r->data->q, r->data->v) && pw_is_finite_state (r, r->q, r->v);
  int has_projector = r->data->projects || r->data->nullspace_projects;
  int contradictory = has_projector && finite ? r->data->projector.contradictory_row : -1;
  if (status < 0) return pw_fail_signal (t, error);
  if (contradictory >= 0)
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s contradicts the other constraints", t,
                    PW_NAME (pw_system_row_name, r->s, contradictory));
  if (finite && pw_watchdog_near_state (r)) return pw_fail_singular (r, t, error);
  if (!finite && h < 1e-12 * fabs (t)) /* some 4000 eps */
    return pw_fail (error, PW_METHOD, "t = %.6g s: the next state is not finite, however small the step", t);
  return pw_fail (error, PW_METHOD, "t = %.6g s: the step of %.6g s is too large: %s", t, h,
                  divided                   ? "near a singular configuration, where no two divisions of it agree"
                  : !finite                 ? "the state is no longer finite"
                  : r->data->uses_nullspace ? "the basis of the velocities does not stay valid"
                  : r->data->projects       ? "the projection does not converge"
                                            : "a stage of it lands in a singular configuration");
}

/* Fixed steps, and samples inside the last step.  Steps end at multiples of the step size, at t_end and at
 * breakpoints.  A sample is a step from the beginning of the last step, as accurate as the method.  If a stage of a
 * step or sample lands near a singular configuration, its accelerations are inaccurate.  Then the step, unless it
 * follows a divided one, is divided in two parts, at different times, until two results agree. */

/* A step to t from the state `from`, which temporarily replaces the state reached: computes the new state, and its
 * ledger in r->ledger_at; with_energy: 1 to compute r->projected_at, too. */
static int fixed_step_from (pw_run *r, const pw_step_start *from, double t, int project, int with_energy) {
  const double h = t - from->t, t_reached = r->t;
  double *const q = r->q, *const v = r->v, *const a = r->a, *const rate = r->rate;
  double added_energy = 0;
  const size_t n = (size_t)r->s->coords + 3;
  r->t = from->t, r->q = from->q, r->v = from->q + n, r->a = from->q + 2 * n, r->rate = from->rate;
  int status = rk_step (r, h, t, project, with_energy ? &added_energy : NULL);
  r->t = t_reached, r->q = q, r->v = v, r->a = a, r->rate = rate;
  rk_ledger (r, r->ledger_at, from->ledger, h);
  r->projected_at = from->projected + added_energy;
  return status;
}

/* The same with the energy, and stores the new state in `to`. */
static int fixed_step_between (pw_run *r, const pw_step_start *from, double t, int project, pw_step_start *to) {
  pw_method_data *d = r->data;
  int status = fixed_step_from (r, from, t, project, 1);
  if (status != PW_OK) return status;
  to->t = t, to->projected = r->projected_at;
  memcpy (to->q, d->q, pw_state_length (r->s) * sizeof *d->q);
  memcpy (to->ledger, r->ledger_at, (size_t)r->entries * sizeof (double));
  pw_ledger_rates (r, d->lambda, to->rate);
  return PW_OK;
}

/* The same in two parts, the first one up to the time `between`. */
static int fixed_two_parts (pw_run *r, const pw_step_start *from, double between, double t, int project) {
  pw_step_start *second = &r->data->second;
  int status = fixed_step_between (r, from, between, project, second);
  return status == PW_OK ? fixed_step_from (r, second, t, project, 1) : status;
}

/* Divides the step to t1 at several times after `earliest`, until two successive results differ by at most `best`;
 * *between: the time of division with the least difference.  PW_RETRY if that exceeds `acceptable`; PW_STOPPED or
 * PW_METHOD.  status: of the undivided step, whose result is in d->q.  In a step from the state reached, energy added
 * by projections is an error, too. */
static int fixed_divide (pw_run *r, const pw_step_start *from, int status, double t1, int project, double earliest,
                         double *between) {
  /* fractions of the step; irregular, since configurations may recur */
  static const double part[] = { 0.382, 0.681, 0.209, 0.847, 0.127, 0.541, 0.943, 0.302, 0.764, 0.891 };
  const pw_method_data *d = r->data;
  const size_t bytes = pw_state_length (r->s) * sizeof *d->q;
  double least = INFINITY, energy = fmax (r->scene_energy, r->exchanged);
  int has_result = status == PW_OK, is_step = from->q == r->q; /* otherwise it is a sample */
  const double best = is_step ? r->thresholds.agree_best : r->thresholds.sample_best;
  const double acceptable = is_step ? r->thresholds.agree : r->thresholds.sample;
  if (has_result) memcpy (r->q_at, d->q, bytes);
  for (size_t i = 0; i < sizeof part / sizeof *part && least > best; i++) {
    double t = from->t + part[i] * (t1 - from->t);
    if (t <= earliest) continue;
    if (is_step && pw_run_stop_requested (r)) return PW_STOPPED;
    status = fixed_two_parts (r, from, t, t1, project);
    r->statistics.rejected++;
    if (status < 0) return status;
    if (status != PW_OK) continue;
    double difference = pw_rk_distance (r, d->q, d->v);
    if (is_step) difference = fmax (difference, fabs (r->projected_at - from->projected) / energy);
    if (has_result && difference < least) least = difference, *between = t;
    memcpy (r->q_at, d->q, bytes);
    has_result = 1;
  }
  return least <= acceptable ? PW_OK : PW_RETRY;
}

/* Many samples inside the last step of an adaptive method.  From the fifth one at increasing times on, positions are
 * those of the polynomial that has the positions, velocities and accelerations at the ends of the step and of steps to
 * quarters of it; velocities, and the ledger, those of the polynomial with their values and rates there (Hermite
 * interpolation; Stoer & Bulirsch 2002, Introduction to Numerical Analysis, section 2.1.5).  The state is then
 * projected like that of a step.  In the first and in the last quarter the polynomials must agree with steps: forces
 * may jump inside the last step. */

enum { DENSE_FIRST = 5, DENSE_NODES = RK_NODES + 2 };
#define DENSE_AGREE 0.1 /* largest difference from a step, in units of the scene, over the relative tolerance */

/* The weights at x of node k, with nodes at 0, 1/4, 1/2, 3/4, 1: of its value and two derivatives; of its value and
 * one. */
static void dense_weights (int k, double x, double second[3], double first[2]) {
  double L = 1, sum = 0, squares = 0;
  const double part = 1. / (DENSE_NODES - 1), s = x - k * part;
  for (int j = 0; j < DENSE_NODES; j++) {
    if (j == k) continue;
    const double inverse = 1 / ((k - j) * part); /* L = prod (x - z_j) / (z_k - z_j); sum = L' (z_k) */
    L *= (x - j * part) * inverse, sum += inverse, squares += inverse * inverse;
  }
  const double bend = 12 * sum * sum - 3 * (sum * sum - squares); /* (L^-3)'' at z_k */
  second[0] = L * L * L * (1 + s * (bend / 2 * s - 3 * sum));
  second[1] = L * L * L * s * (1 - 3 * sum * s);
  second[2] = L * L * L * s * s / 2;
  first[0] = L * L * (1 - 2 * sum * s);
  first[1] = L * L * s;
}

/* The sample at t by interpolation, not projected, without accelerations. */
static void dense_interpolate (pw_run *r, double t) {
  const pw_method_data *d = r->data;
  const pw_step_start end = { .t = r->t, .projected = r->projected, .q = r->q, .ledger = r->ledger, .rate = r->rate };
  const size_t n = (size_t)r->s->coords, room = n + 3, entries = (size_t)r->entries;
  const double h = r->t - d->last.t, x = (t - d->last.t) / h;
  memset (r->q_at, 0, n * sizeof (double));
  memset (r->v_at, 0, n * sizeof (double));
  memset (r->ledger_at, 0, entries * sizeof (double));
  for (int k = 0; k < DENSE_NODES; k++) {
    double w[3], u[2];
    const pw_step_start *node = k == 0 ? &d->last : k <= RK_NODES ? &d->node[k - 1] : &end;
    const double *q = node->q, *v = q + room, *a = v + room, *ledger = node->ledger, *rate = node->rate;
    dense_weights (k, x, w, u);
    for (size_t j = 0; j < n; j++) {
      r->q_at[j] += w[0] * q[j] + h * (w[1] * v[j] + h * w[2] * a[j]);
      r->v_at[j] += u[0] * v[j] + h * u[1] * a[j];
    }
    for (size_t i = 0; i < entries; i++) r->ledger_at[i] += u[0] * ledger[i] + h * u[1] * rate[i];
  }
  r->projected_at = d->last.projected + x * (r->projected - d->last.projected);
}

/* 1 if the polynomials agree with a step to t. */
static int dense_agrees (pw_run *r, double t) {
  pw_method_data *d = r->data;
  dense_interpolate (r, t);
  int status = fixed_step_from (r, &d->last, t, d->projects, 0);
  return status == PW_OK && !r->near_singular && pw_rk_distance (r, d->q, d->v) < DENSE_AGREE * r->settings.rtol;
}

/* Evaluates the nodes.  1 if samples may be interpolated between them. */
static int dense_open (pw_run *r) {
  pw_method_data *d = r->data;
  const pw_step_start *from = &d->last;
  const double part = (r->t - from->t) / (DENSE_NODES - 1);
  if (d->uses_nullspace || d->holds_signals || pw_before_breakpoint (r, r->t) < r->t) return 0;
  for (int k = 0; k < RK_NODES; k++) {
    int status = fixed_step_between (r, from, from->t + (k + 1) * part, d->projects, &d->node[k]);
    if (status != PW_OK || r->near_singular) return 0;
  }
  return dense_agrees (r, from->t + part / 2) && dense_agrees (r, r->t - part / 2);
}

/* The sample at t by interpolation.  1 if it is one of many and this succeeds. */
static int dense_sample (pw_run *r, double t) {
  pw_method_data *d = r->data;
  pw_projector *p = d->projects ? &d->projector : NULL;
  if (t == r->located) return 0;
  d->samples = t > d->sampled ? d->samples + 1 : 1;
  d->sampled = t;
  if (r->fixed_steps || d->samples < DENSE_FIRST) return 0;
  if (d->nodes == 0 || d->nodes_end != r->t) {
    d->nodes = dense_open (r) ? 1 : -1;
    d->nodes_end = r->t;
  }
  int status = PW_RETRY;
  if (d->nodes > 0) {
    dense_interpolate (r, t);
    status = p ? pw_project_state (p, r, t, r->q_at, r->v_at, r->a_at, r->lambda_at, NULL)
               : pw_run_accelerate (r, t, r->q_at, r->v_at, r->a_at, r->lambda_at);
  }
  const int succeeds = status == PW_OK && !r->near_singular;
  r->near_singular = 0;
  return succeeds;
}

/* A sample inside the last step as a step from its beginning; *divided: 1 near a singular configuration. */
static int fixed_sample (pw_run *r, double t, int *divided) {
  pw_method_data *d = r->data;
  const pw_step_start *from = &d->last;
  double between;
  int status = fixed_step_from (r, from, t, d->projects, r->settings.ledger);
  *divided = r->near_singular && status >= 0;
  if (*divided) {
    status = fixed_divide (r, from, status, t, d->projects, from->t, &between);
    if (status == PW_OK) status = fixed_two_parts (r, from, between, t, d->projects);
  }
  return status;
}

int pw_rk_at (pw_run *r, double t, pw_error *error) {
  pw_method_data *d = r->data;
  const pw_step_start *from = &d->last;
  if (t > r->t || t < from->t) return pw_fail_outside (r, from->t, t, error);
  if (t == r->t) {
    pw_sample_reached (r);
    return PW_OK;
  }
  const pw_statistics statistics = r->statistics;
  const double refused_sine = r->refused_sine;
  const int near_singular = r->near_singular;
  int status = PW_OK, divided = 0;
  r->near_singular = 0;
  r->refused_sine = 0; /* a sample is divided, not refused, near a singular configuration */
  if (!dense_sample (r, t)) {
    status = fixed_sample (r, t, &divided);
    memcpy (r->q_at, d->q, pw_state_length (r->s) * sizeof *d->q);
  }
  r->statistics = statistics, r->refused_sine = refused_sine, r->near_singular = near_singular;
  if (status < 0) return pw_fail_signal (t, error);
  return status == PW_OK ? PW_OK : rk_fail (r, status, from->t, t - from->t, divided, error);
}

/* Replaces a step to t1 near a singular configuration, which returned `status`, by the first part of a divided step,
 * and accepts that part; *t: its end.
 *
 * Accelerations at the end of a step, with which the next one begins, have the error of the state over the sine.  So if
 * the step ends at the singular configuration (singular: 1), longer ones, up to `stop`, are tried first, whose
 * first part ends after t1; otherwise they are tried if no division of the step to t1 is accurate. */
static int fixed_step_around (pw_run *r, int status, int singular, double t1, double stop, int project, double *t) {
  static const double beyond[] = { 0.62, 2.62, 7.62 }; /* in step sizes; irregular, since configurations may recur */
  const pw_step_start from = { .t = r->t, .projected = r->projected, .q = r->q, .ledger = r->ledger, .rate = r->rate };
  double added_energy = 0;
  if (!singular) status = fixed_divide (r, &from, status, t1, project, r->t, t);
  if (singular && status == PW_OK) status = PW_RETRY;
  for (size_t i = 0; i < sizeof beyond / sizeof *beyond && status == PW_RETRY && t1 < stop; i++)
    status = fixed_divide (r, &from, status, fmin (t1 + beyond[i] * r->settings.step, stop), project, t1, t);
  if (singular && status == PW_RETRY) status = fixed_divide (r, &from, status, t1, project, r->t, t);
  if (status == PW_OK) status = rk_step (r, *t - r->t, *t, project, &added_energy);
  if (status == PW_OK) rk_accept (r, *t - r->t, *t, r->settings.ledger ? added_energy : 0);
  return status;
}

static int rk_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  int whole, project = rk_projects_next (r);
  const int was_off_grid = d->off_grid;
  double added_energy = 0, t1 = pw_step_end (r, t_end, &whole);
  double h = whole && !was_off_grid ? r->settings.step : t1 - r->t;
  int status = rk_step (r, h, t1, project, r->settings.ledger ? &added_energy : NULL);
  int ends_singular =
      r->near_singular && r->watchdog.evaluated_sine < r->thresholds.ends_singular * r->watchdog.checked_sine;
  d->off_grid = r->near_singular && !was_off_grid;
  double stop = whole ? fmin (t_end, r->breakpoint) : t1, t = t1;
  if (d->off_grid) status = fixed_step_around (r, status, ends_singular, t1, stop, project, &t);
  if (status != PW_OK) {
    if (status != PW_STOPPED) status = rk_fail (r, status, r->t, r->settings.step, d->off_grid, error);
    d->off_grid = was_off_grid;
    return status;
  }
  r->statistics.steps++;
  if (d->off_grid) { /* r->counter counts it with the next step, to the next multiple */
    if (t > t1) r->counter.count = (long)floor ((t - r->counter.base) / r->settings.step);
    return PW_OK;
  }
  rk_accept (r, h, t1, added_energy);
  pw_count_step (r, whole, t1);
  return PW_OK;
}

/* Step-size control:
 *
 *   h_new = 0.9 h err^(3 m / 4 - k) err_last^m,  limited to h/5 ... 5 h; after a rejection to 0.9 h
 *
 * with k the tableau's exponent and m its memory (Gustafsson 1991; Hairer, Norsett & Wanner 1993, section II.4).  err
 * is the root mean square error of positions and velocities in units of the tolerances.  A projection leaves the part
 * of the error tangential to the constraints (Eich 1993; Hindmarsh et al., CVODE), to which a small part of the whole
 * error is added:
 *
 *   err = sqrt (tangential^2 + rtol^(1/2) whole^2)   so that the displacement by the projection is at most rtol^(3/4)
 *
 * Through the curvature of the constraints, the square of the displacement adds to the tangential error; without this
 * limit the steps of a mostly prescribed motion would grow until that square dominates.
 *
 * Where a force reverses within a step, such as friction, estimates of any order may miss it.  The largest change of
 * the acceleration at the stages, h |a_i - a| / 2, therefore counts like the error before a projection, so that a body
 * stopped by friction oscillates at speeds of at most rtol^(3/4).
 *
 * With estimates of the orders 3, 5 and 6, e5 is combined with e3 as in DOP853, and e6 guards both:
 *
 *   max (e5^2 / sqrt (e5^2 + e3^2 / 100), e6^3 / (e6^2 + e5^2))      of order h^8 and h^9 for smooth motions
 *
 * At the stability limit of a damped motion e5 may be blind to the instability while e3 is large for other reasons:
 * without e6 the error may then be many times the tolerances and remain undetected. */

#define ADAPT_SAFETY 0.9       /* in the factor from one step size to the next */
#define ADAPT_GROWTH 5.        /* upper bound of that factor */
#define ADAPT_REDUCTION 0.2    /* its lower bound */
#define ADAPT_LEAST_ERROR 1e-4 /* least err_last: smaller errors are accidental and would predict too small a step */

/* out = sum_j weight_j slope_j: an error estimate from n derivatives at the stages, over h. */
static void adapt_estimate (const pw_rk_row *e, double *const *slope, int n, double *out) {
  memset (out, 0, (size_t)n * sizeof *out);
  for (int j = 0; j < e->count; j++) pw_add_scaled (out, slope[e->stage[j]], e->weight[j], n);
}

/* Mean square of the errors r->q_at and r->v_at of positions and velocities in units of the tolerances. */
static double adapt_mean_square (const pw_run *r) {
  const double *w = r->data->weight;
  double sum = 0;
  for (int j = 0; j < r->s->coords; j++, w += 2) {
    double q = r->q_at[j] * w[0], v = r->v_at[j] * w[1];
    sum += q * q + v * v;
  }
  return sum / (r->s->coords + r->s->mechanical);
}

/* Mean square of an estimate before a projection, divided by h^2; stores its errors in r->q_at and r->v_at. */
static double adapt_whole (pw_run *r, const pw_rk_row *e) {
  pw_method_data *d = r->data;
  adapt_estimate (e, d->stage_v, r->s->coords, r->q_at);
  adapt_estimate (e, d->stage_a, r->s->coords, r->v_at);
  return adapt_mean_square (r);
}

/* Mean square of what a projection leaves of the errors in r->q_at and r->v_at, plus a small part of that before the
 * projection, `whole`; projected: 1 if the new state was. */
static double adapt_remaining (pw_run *r, double whole, int projected) {
  pw_method_data *d = r->data;
  if (!projected && !d->uses_nullspace) return whole;
  if (projected || d->nullspace_projects) pw_project_error (r, r->saddle, r->q_at, r->s->holonomic);
  pw_project_error (r, r->saddle, r->v_at, r->s->rows);
  return adapt_mean_square (r) + sqrt (r->settings.rtol) * whole;
}

/* The two errors of which the larger one counts (see the top of this file), from the squares of e3, e5, e6. */
static double adapt_combine (double square5, double square3) {
  return square5 == 0 ? 0 : square5 / sqrt (square5 + 0.01 * square3);
}

static double adapt_guard (double square6, double square5) {
  return square6 == 0 ? 0 : square6 * sqrt (square6) / (square6 + square5);
}

/* The error of the new state, divided by h. */
static double adapt_state (pw_run *r, int projected) {
  pw_method_data *d = r->data;
  const pw_tableau *tableau = d->tableau;
  d->stage_v[tableau->stages] = d->v, d->stage_a[tableau->stages] = d->a;
  double *w = d->weight, rtol = r->settings.rtol; /* reciprocal tolerances of positions and velocities */
  for (int j = 0, n = r->s->coords; j < n; j++) {
    *w++ = 1 / (pw_atol (r, j) + rtol * fmax (fabs (r->q[j]), fabs (d->q[j])));
    *w++ = 1 / (pw_atol (r, n + j) + rtol * fmax (fabs (r->v[j]), fabs (d->v[j])));
  }
  double square5 = adapt_remaining (r, adapt_whole (r, &d->estimate[0]), projected);
  if (tableau->e3 == NULL) return sqrt (square5);
  double square3 = adapt_remaining (r, adapt_whole (r, &d->estimate[1]), projected);
  double square6 = adapt_whole (r, &d->estimate[2]), err = adapt_combine (square5, square3);
  if (adapt_guard (square6, square5) > err) /* otherwise the projection of e6, which mostly reduces it, is not needed */
    err = fmax (err, adapt_guard (adapt_remaining (r, square6, projected), square5));
  return err;
}

/* The error of work and losses, which projections do not change, divided by h. */
static double adapt_ledger (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const pw_tableau *tableau = d->tableau;
  double square[3] = { 0 }; /* of e5, e3, e6 */
  pw_ledger_rates (r, d->lambda, d->stage_rate[tableau->stages]);
  for (int k = 0; k < (tableau->e3 ? 3 : 1); k++) {
    adapt_estimate (&d->estimate[k], d->stage_rate, r->entries, r->ledger_at);
    square[k] = pow (pw_ledger_norm (r, h, r->ledger_at), 2);
  }
  double err =
      tableau->e3 ? fmax (adapt_combine (square[0], square[1]), adapt_guard (square[2], square[0])) : sqrt (square[0]);
  return isfinite (err) ? err : 0;
}

/* Half the root mean square of the largest changes of accelerations at the stages, over the tolerances of velocities.
 * Only coordinates count whose velocity changes, at one of the stages, by more than the range in which a force
 * saturates. */
static double adapt_reversal (const pw_run *r) {
  const pw_method_data *d = r->data;
  int n = r->s->coords, stages = d->tableau->stages;
  double sum = 0;
  for (int j = 0; j < n; j++) {
    double range = pw_saturation_range (r, n + j), moved = 0, change = 0;
    for (int i = 1; i <= stages && isfinite (range); i++) {
      moved = fmax (moved, fabs (d->stage_v[i][j] - r->v[j]));
      change = fmax (change, fabs (d->stage_a[i][j] - r->a[j]));
    }
    change *= moved > range ? 0.5 * d->weight[2 * j + 1] : 0;
    sum += change * change;
  }
  return sqrt (sum / (2 * n));
}

/* The factor from this step size to the next; see the top of this file. */
static double adapt_factor (const pw_method_data *d, double err) {
  const pw_tableau *tableau = d->tableau;
  if (err == 0) return ADAPT_GROWTH;
  double exponent = tableau->exponent - 0.75 * tableau->memory;
  double factor = ADAPT_SAFETY * pow (err, -exponent) * pow (d->last_error, tableau->memory);
  return fmin (ADAPT_GROWTH, fmax (ADAPT_REDUCTION, factor));
}

/* The step to t1 = t + h; *err: its error, accepted up to 1; INFINITY if the step fails.  If a signal jumps at t1, the
 * estimate uses the accelerations just before t1, since the jump is not an error of the step. */
static int adapt_step (pw_run *r, double h, double t1, int project, double *added_energy, double *err) {
  pw_method_data *d = r->data;
  double before = pw_before_breakpoint (r, t1);
  r->near_singular = 0;
  int status = rk_step (r, h, t1, project, added_energy);
  if (status == PW_OK && before < t1) status = pw_run_accelerate (r, before, d->q, d->v, d->a, d->lambda);
  *err = status == PW_OK ? h * adapt_state (r, project) : INFINITY;
  if (r->entries > 0 && *err <= 1) *err = fmax (*err, h * adapt_ledger (r, h)); /* else it is rejected anyway */
  if (r->s->saturates && *err <= 1) *err = hypot (*err, pow (r->settings.rtol, 0.25) * h * adapt_reversal (r));
  if (status == PW_OK && before < t1) status = pw_run_accelerate (r, t1, d->q, d->v, d->a, d->lambda);
  if (status != PW_OK) *err = INFINITY;
  return status;
}

/* After a step that was shortened to end at t_end or a breakpoint, the next one has at least the size planned before,
 * and the error is remembered only if the step was long enough to predict that of the next one. */
static int rk_advance_adaptive (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), most_growth = ADAPT_GROWTH;
  int status = PW_OK, project = rk_projects_next (r);
  for (;;) {
    double t1 = r->t + d->h, added_energy = 0, err;
    int shortened = t1 > stop - 0.01 * d->h; /* or lengthened by up to 1 %, so that no tiny step remains */
    if (shortened) t1 = stop;
    double h = t1 - r->t;
    if (!shortened && !(h > pw_least_step (r))) {
      if (status != PW_OK) return rk_fail (r, status, r->t, h, 0, error);
      return pw_fail (error, PW_METHOD, "t = %.6g s: the tolerances require a step below %.3g s", r->t, h);
    }
    if (most_growth < ADAPT_GROWTH && (status = pw_run_check_limits (r, error)) != PW_OK) return status;
    status = adapt_step (r, h, t1, project, r->settings.ledger ? &added_energy : NULL, &err);
    if (status < 0) return pw_fail_signal (r->t, error);
    if (err <= 1) {
      double next = h * fmin (most_growth, adapt_factor (d, err));
      rk_accept (r, h, t1, added_energy);
      pw_bound_tolerances (r);
      d->h = shortened ? fmax (next, d->h) : next;
      if (!shortened || h > 0.5 * d->h) d->last_error = fmax (err, ADAPT_LEAST_ERROR);
      r->statistics.steps++;
      return PW_OK;
    }
    r->statistics.rejected++;
    d->h = h * (isfinite (err) ? fmin (0.9, adapt_factor (d, err)) : ADAPT_REDUCTION);
    most_growth = 1; /* no growth right after a rejection */
  }
}

static const char *const rk_steps[] = { "adaptive", "fixed", NULL };
static const char *const rk_positions[] = { "projected", "drift", NULL };
static const char *const rk_inputs[] = { "stage", "held", NULL };

const pw_stabilisation pw_rk_stabilisations[] = {
  PW_ACCELERATION_STABILISATIONS,
  { "projection", "projection onto the constraints after each step (Lubich 1991, Eich 1993)", PW_PROJECTION },
  { "nullspace",
    "velocities in a basis of the null space of J: velocities obey all constraints at every stage "
    "(Kim & Vanderploeg 1986)",
    PW_NULLSPACE },
  { .name = NULL },
};

#define RK_OPTIONS                                                                              \
  { .name = "inputs",                                                                           \
    .choices = rk_inputs,                                                                       \
    .about = "signals of forces at stage times, or held from the step's start (first order)" }, \
      PW_BAUMGARTE_OPTIONS, PW_PROJECTION_OPTIONS, {                                            \
    .name = "positions", .with = "nullspace", .choices = rk_positions,                          \
    .about = "positions projected after each step, or left to drift at the order of the method" \
  }

const pw_option pw_rk_fixed_options[] = { RK_OPTIONS, { .name = NULL } };
const pw_option pw_rk_adaptive_options[] = {
  { .name = "steps", .choices = rk_steps, .about = "steps that follow the tolerances, or of the given size" },
  RK_OPTIONS,
  { .name = NULL },
};

static pw_rk_row rk_nonzero_weights (const double *weight, int stages) {
  pw_rk_row row = { 0 };
  for (int j = 0; j < stages; j++)
    if (weight[j] != 0) {
      row.stage[row.count] = j;
      row.weight[row.count++] = weight[j];
    }
  return row;
}

static int rk_allocate (pw_method_data *d, const pw_run *r) {
  enum { ONCE = 8, MOST = ONCE + 3 * PW_RK_STAGES + 3 * RK_NODES }; /* arrays that exist once, not for each stage */
  size_t n = (size_t)r->s->coords + 3, state = pw_state_length (r->s), entries = (size_t)r->entries, count = ONCE;
  int stages = d->tableau->stages;
  pw_array array[MOST] = { PW_ARRAY (d->q, state),
                           PW_ARRAY (d->weight, 2 * n),
                           PW_ARRAY (d->last.q, state),
                           PW_ARRAY (d->last.ledger, entries),
                           PW_ARRAY (d->last.rate, entries),
                           PW_ARRAY (d->second.q, state),
                           PW_ARRAY (d->second.ledger, entries),
                           PW_ARRAY (d->second.rate, entries) };
  for (int i = 1; i <= stages; i++) { /* stage 0 has r->v, r->a and r->rate */
    array[count++] = (pw_array)PW_ARRAY (d->stage_rate[i], entries);
    if (i == stages) break; /* velocities and accelerations of the new state are in d->v, d->a */
    array[count++] = (pw_array)PW_ARRAY (d->stage_v[i], n);
    array[count++] = (pw_array)PW_ARRAY (d->stage_a[i], n);
  }
  for (pw_step_start *x = d->node; x < d->node + RK_NODES && !r->fixed_steps; x++) {
    array[count++] = (pw_array)PW_ARRAY (x->q, state);
    array[count++] = (pw_array)PW_ARRAY (x->ledger, entries);
    array[count++] = (pw_array)PW_ARRAY (x->rate, entries);
  }
  d->memory = pw_alloc_arrays (NULL, array, count);
  if (d->memory == NULL) return PW_RESOURCE;
  rk_point (d->q, n, &d->q, &d->v, &d->a, &d->lambda);
  return PW_OK;
}

int pw_rk_open (pw_run *r, const pw_tableau *tableau, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return pw_fail_memory (r->s, error);
  const double *A = tableau->A, *const estimate[] = { tableau->e, tableau->e3, tableau->e6 };
  d->tableau = tableau;
  d->own = r->q;
  d->row[0] = rk_nonzero_weights (tableau->b, tableau->stages);
  for (int i = 1; i < tableau->stages; A += i++) d->row[i] = rk_nonzero_weights (A, i); /* row i has i entries */
  for (int k = 0; k < 3; k++)
    if (estimate[k]) d->estimate[k] = rk_nonzero_weights (estimate[k], tableau->stages + 1);
  d->holds_signals = pw_run_option (r, "inputs") != 0;
  d->projects = pw_stabilised_by (r, PW_PROJECTION);
  d->uses_nullspace = pw_stabilised_by (r, PW_NULLSPACE);
  d->nullspace_projects = d->uses_nullspace && pw_run_option (r, "positions") == 0;
  d->every = (int)pw_run_option (r, "every");
  if (rk_allocate (d, r) != PW_OK) return pw_fail_memory (r->s, error);
  int status = d->projects || d->nullspace_projects ? pw_projector_open_by_options (&d->projector, r, error) : PW_OK;
  if (status == PW_OK && d->uses_nullspace) status = nullspace_open (&d->nullspace, r, error);
  return status == PW_OK ? pw_rk_restart (r, error) : status;
}

void pw_rk_close (pw_run *r) {
  double *const own = r->data->own;
  if (r->q != own) memcpy (own, r->q, pw_state_length (r->s) * sizeof *own);
  rk_point (own, (size_t)r->s->coords + 3, &r->q, &r->v, &r->a, &r->lambda);
  pw_projector_close (&r->data->projector);
  free (r->data->nullspace.memory);
  free (r->data->memory);
  free (r->data);
}

int pw_rk_restart (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data;
  (void)error;
  r->counter = (pw_step_counter){ .base = r->t };
  d->off_grid = 0;
  if (!r->fixed_steps) {
    d->h = 0.1 * r->w->scale.time * pow (r->settings.rtol, d->tableau->exponent);
    d->last_error = ADAPT_LEAST_ERROR;
  }
  d->nodes = d->samples = 0;
  pw_store_start (&d->last, r);
  return PW_OK;
}

void pw_rk_serialise (pw_run *r, pw_archive *a) {
  pw_method_data *d = r->data;
  pw_step_serialise (r, a);
  pw_archive_bytes (a, &d->off_grid, sizeof d->off_grid);
  pw_archive_bytes (a, &d->h, sizeof d->h);
  pw_archive_bytes (a, &d->last_error, sizeof d->last_error);
}

int pw_rk_advance (pw_run *r, double t_end, pw_error *error) {
  return r->fixed_steps ? rk_advance_fixed (r, t_end, error) : rk_advance_adaptive (r, t_end, error);
}

/* Several steps of fixed size in one call of specialised code.  Results are bit-identical to those of single steps.
 * What a run does less often than every step (run.c) is done after the last of them, so there are never more than
 * PW_CHECK_INTERVAL. */

/* 1 if the specialised function `steps` does everything that a step of this run needs.  The ledger records the first
 * steps one by one (run.c). */
static int several_possible (const pw_run *r) {
  const pw_method_data *d = r->data;
  if (r->method->advance != pw_rk_advance || d == NULL || !r->fixed_steps || d->holds_signals || d->uses_nullspace ||
      d->off_grid)
    return 0;
  if (d->projects && (d->every > 1 || d->projector.owns_velocity)) return 0;
  return pw_specialised_suits (r) && r->redundant == 0 && r->alpha + r->beta == 0 && !r->settings.ledger &&
         !r->interrupted && r->sides == NULL && (r->resolution == NULL || r->predicted) && r->stalled == 0 &&
         !(r->watchdog.saddle && r->watchdog.singular_ahead) && r->statistics.steps >= PW_CHECK_INTERVAL;
}

/* The number of whole steps that can be taken at once: up to t_end, which may be the end of the last one, and the next
 * breakpoint, with the tolerance of pw_step_end; up to the first that reaches t; up to the next look at coordinates
 * that are too large (run.c).  Each must be twice as long as a step that counts as stalled (run.c). */
static int several_count (const pw_run *r, double t, double t_end) {
  const double h = r->settings.step, longer = PW_STEP_LONGER * h,
               last = fmin (r->breakpoint, r->resolved_until) - longer, stop = fmin (t_end - longer, last),
               until = fmin (fmin (t, t_end), r->settings.t + 2 * r->checked_span);
  const int most = PW_CHECK_INTERVAL - (int)(r->statistics.steps % PW_CHECK_INTERVAL);
  const double base = r->counter.base, count = (double)r->counter.count;
  if (!(h > 128 * DBL_EPSILON * (fabs (r->t) + most * h)) || !(r->t < until)) return 0;
  int n = (int)fmin (most, (until - r->t) / h + 2);
  for (; n > 0; n--) {
    const double end = base + (count + n) * h, beginning = n > 1 ? base + (count + n - 1) * h : r->t;
    if (beginning < until && (end <= stop || (end == t_end && end <= last))) break;
  }
  return n;
}

/* The watchdog's data in the form that specialised code uses. */
static pw_scene_watch several_watchdog (const pw_run *r) {
  const pw_thresholds *limit = &r->thresholds;
  const pw_watchdog *watch = &r->watchdog;
  const double T = r->w->scale.time, L = r->s->scale.length, largest = watch->largest_sine;
  pw_scene_watch x = { .sine = INFINITY, .moved = watch->moved, .reference = r->reference_level };
  x.lost = pw_lost_residual (r);
  if (watch->saddle) /* else a tree of holonomic joints, never singular */
    x.sine = watch->checked_sine, x.reach = limit->lipschitz * largest, x.near_sine = limit->near * largest;
  x.growth = limit->step_growth, x.rank_lost = limit->rank_lost, x.regular = limit->regular * largest;
  x.drift = limit->drift_near;
  x.no_branch = 0.5 * limit->drift_near * limit->rank_lost * limit->rank_lost; /* 0.5: a margin for round-off */
  x.length = L, x.per_length = T * T / L, x.per_angle = T * T;
  return x;
}

/* Updates the run's data after the steps taken. */
static void several_record (pw_run *r, const pw_scene_steps *x) {
  pw_method_data *d = r->data;
  pw_statistics *now = &r->statistics;
  pw_watchdog *watch = &r->watchdog;
  r->t = x->t;
  d->last.t = x->t0, d->last.projected = r->projected;
  r->counter.count += x->done;
  r->near_singular = 0, r->w->failed = NULL;
  r->reference_level = x->watch.reference, r->previous_norm = x->watch.norm;
  now->steps += x->done;
  now->position = pw_larger (now->position, x->watch.position), now->g = pw_larger (now->g, x->watch.g);
  now->velocity = pw_larger (now->velocity, x->watch.velocity), now->jv = pw_larger (now->jv, x->watch.jv);
  pw_specialised_count (r, (long)x->stages * x->done, x->iterations);
  if (watch->saddle == NULL) return; /* else: what watchdog_follow stores where the sine need not be computed */
  watch->step_length = x->watch.step, watch->moved = x->watch.moved, watch->singular_ahead = 0;
  watch->sine_before_checked = NAN, watch->sine_slope = 0, watch->may_have_crossed = 0;
  watch->previous_t = r->t, watch->previous_sine = NAN;
  memcpy (watch->previous_q, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *watch->previous_q);
}

/* Fills x for the next steps, up to the first that reaches t, and returns their number; 0: fewer than `least` can be
 * taken at once. */
static int several_plan (pw_run *r, double t, double t_end, int least, pw_scene_steps *x) {
  pw_method_data *d = r->data;
  int count = several_possible (r) ? several_count (r, t, t_end) : 0;
  if (count < least) return 0;
  *x = (pw_scene_steps){ .count = count, .project = d->projects, .watch = several_watchdog (r) };
  x->stages = d->tableau->stages, x->row = d->row, x->c = d->tableau->c;
  x->h = r->settings.step, x->base = r->counter.base, x->number = r->counter.count;
  x->t = r->t, x->state = r->q, x->ledger = r->ledger, x->rate = r->rate;
  x->state0 = d->last.q, x->ledger0 = d->last.ledger, x->rate0 = d->last.rate;
  x->V = d->stage_v, x->A = d->stage_a, x->R = d->stage_rate;
  x->configuration = r->w->configuration, x->J = r->w->J;
  return count;
}

/* Makes the result of the steps the state reached.  Errors: PW_METHOD. */
static int several_finish (pw_run *r, const pw_scene_steps *x, pw_error *error) {
  int status = PW_OK;
  if (r->s->coords > 3 * r->s->bodies) pw_point_to_internal (r->w, r->q, r->v);
  if (x->done > 0) {
    several_record (r, x);
    pw_saddle_postpone (r->saddle, PW_SCENE_PIVOT);
  }
  /* A step that was refused has left its own configurations and J. */
  if (x->done < x->count && pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) status = pw_fail_signal (r->t, error);
  if (x->done > 0 && status == PW_OK) {
    status = pw_run_check_resolution (r, error);
    if (status == PW_OK) pw_ledger_record (r);
  }
  return pw_run_annotate_error (r, status, error);
}

int pw_run_advance_towards (pw_run *r, double t, double t_end, pw_error *error) {
  pw_scene_steps x;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (!pw_specialised_suits (r) || several_plan (r, t, t_end, 2, &x) == 0) return pw_run_advance (r, t_end, error);
  r->stopped = 0;
  if (pw_run_stop_requested (r)) return PW_STOPPED;
  r->specialised->steps (r->scene, &x);
  int status = several_finish (r, &x, error);
  return status == PW_OK && x.done == 0 ? pw_run_advance (r, t_end, error) : status;
}

/* Steps of runs with the step size, method and stabilisation of the first are taken together. */
void pw_runs_advance (pw_run *const *runs, int count, const double *t_end, const pw_specialised_lanes *code,
                      void *memory, int *status, pw_error *error) {
  int done[PW_LANES_MOST] = { 0 }, used = 0, index[PW_LANES_MOST]; /* of each lane that is used: its run */
  pw_scene_steps steps[PW_LANES_MOST];
  for (int i = 0; i < count && code && count <= code->lanes; i++) {
    if (runs[i] == NULL) continue; /* refused below */
    runs[i]->stopped = 0;
    const pw_run *r = runs[i], *first = used > 0 ? runs[index[0]] : r;
    if (pw_run_stop_requested (runs[i]))
      status[i] = PW_STOPPED, done[i] = 1;
    else if (r->method == first->method && r->stabilisation == first->stabilisation &&
             r->settings.step == first->settings.step &&
             several_plan (runs[i], t_end[i], t_end[i], 1, &steps[used]) > 0)
      index[used++] = i;
  }
  if (used > 0 && 2 * used > code->lanes) { /* with half of them empty, one run after the other is faster */
    pw_scene_steps *lane[PW_LANES_MOST];
    pw_scene *scene[PW_LANES_MOST];
    for (int k = 0; k < code->lanes; k++) { /* empty lanes repeat the steps of the first one */
      if (k >= used) steps[k] = steps[0], index[k] = index[0];
      lane[k] = &steps[k], scene[k] = runs[index[k]]->scene;
    }
    code->steps (scene, lane, memory);
    for (int k = 0; k < used; k++) {
      int i = index[k];
      status[i] = several_finish (runs[i], &steps[k], error ? &error[i] : NULL);
      done[i] = steps[k].done > 0 || status[i] != PW_OK;
    }
  }
  for (int i = 0; i < count; i++)
    if (i >= PW_LANES_MOST || !done[i])
      status[i] = pw_run_advance_towards (runs[i], t_end[i], t_end[i], error ? &error[i] : NULL);
}

int pw_run_advance_to (pw_run *r, double t, double t_end, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  while (r->t < t && !(r->t >= t_end)) {
    int status = pw_run_advance_towards (r, t, t_end, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}
