/* Local searches of `pinwheel optimise`, by NLopt; refinements of SEARCH_SLOPES or more unknowns use derivatives of
 * differentiable outputs.  NLopt varies scaled unknowns (search_unknown). */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <nlopt.h>
#include <stdlib.h>
#include <string.h>
#include "optimise.h"

#define SEARCH_FIRST 0.1    /* first steps from a start, in scaled unknowns */
#define SEARCH_ROUGH 1e-3   /* last steps from a start, first steps of refinements */
#define SEARCH_ALLOWED 1e-6 /* permitted violation of a constraint, relative to its bound if that is not 0 */
#define SEARCH_PROBE 0.1    /* change of an unknown to find out whether it has an effect, in scales */
#define SEARCH_SAME 1e-6    /* largest change of an output without an effect, relative to its value and to its range */
#define SEARCH_ROUND 1e-12  /* round-off of an output, relative to its value */
#define SEARCH_GAIN 1e-9    /* least improvement of the objective for a restart, relative to its value */

enum {
  SEARCH_SLOPES = 3,  /* least number of unknowns for derivatives, which cost as much as several runs */
  SEARCH_RESTARTS = 7 /* of SLSQP, at most */
};

/* ---- Runs ---- */

typedef struct {
  pw_optimise *problem;
  pw_search *search;
  nlopt_opt optimiser;
  double *scaled, *unknown, *output; /* of the last run; the unknowns scaled and not */
  double *allowed;                   /* outputs: violation that NLopt permits */
  double *slope;   /* outputs x unknowns: derivatives with respect to scaled unknowns; NULL: none are used */
  int constrained; /* 1: NLopt knows the constraints */
  int known;       /* 1: there is a last run; 2: it was tried with derivatives */
  int failed;      /* 1: the last run failed */
  /* 1: the search ends, and is repeated with constraints and without derivatives: these could not be computed, though
   * the run succeeded; or NLopt does not know the constraints, and a run that violates one is the best */
  int repeat;
  double least, most; /* extrema of sign x objective in the runs that succeeded */
  double violated;    /* the largest violation in these, at least 0 */
  pw_error *error;    /* of a run that ends all searches, out of memory */
} local_search;

/* The value of an unknown.  If the user gives bounds, `scaled` runs from 0 to 1 between them; otherwise it is the value
 * in units of the scale. */
static double search_unknown (const pw_unknown *unknown, double scaled) {
  double value = (unknown->has_bounds ? unknown->low : 0) + scaled * unknown->scale;
  return fmin (fmax (value, unknown->low), unknown->high);
}

static double search_scaled (const pw_unknown *unknown, double value) {
  return (value - (unknown->has_bounds ? unknown->low : 0)) / unknown->scale;
}

/* Runs the model with these values of the unknowns and stores the outputs; a run with outputs that are not finite
 * fails. */
static int search_run (const pw_optimise *problem, const double *unknown, double *output, pw_error *error) {
  const pw_run_outputs outputs = {
    .unknowns = &problem->unknowns, .option = "output", .of = problem->output, .count = problem->outputs
  };
  int status = pw_run_outputs_at (&outputs, unknown, output, NULL, error);
  for (int i = 0; status == PW_OK && i < problem->outputs; i++)
    if (!isfinite (output[i]))
      status = pw_fail (error, PW_METHOD, "%s is %s", problem->output[i], PW_DIGITS (output[i], 9));
  return status;
}

/* ---- Derivatives ---- */

static int search_neighbour (void *problem, const double *x, double rtol, double *value, pw_error *error) {
  (void)rtol;
  return search_run (problem, x, value, error);
}

/* Stores the derivatives of the last run in local->slope. */
static int search_differentiate (local_search *local, pw_error *error) {
  const pw_unknowns *unknowns = &local->problem->unknowns;
  const int n = unknowns->count, outputs = local->problem->outputs;
  pw_derivative *derivative = malloc ((size_t)n * (size_t)outputs * sizeof *derivative);
  const pw_difference_settings d = { .evaluate = search_neighbour,
                                     .context = local->problem,
                                     .outputs = outputs,
                                     .rtol = pw_unknowns_noise (unknowns),
                                     .neighbours = 4,
                                     .value = local->output,
                                     .jobs = 1 };
  int status = derivative ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = pw_unknowns_differentiate (unknowns, local->unknown, d, derivative, error);
  for (int k = 0; k < n * outputs && status == PW_OK; k++)
    local->slope[k % outputs * n + k / outputs] = unknowns->list[k / outputs].scale * derivative[k].value;
  free (derivative);
  local->search->derivatives += status == PW_OK;
  return status;
}

/* sign / |bound|, or sign if the bound is 0: makes a constraint relative to its bound. */
static double search_factor (const pw_optimise *problem, int i) {
  return problem->sign[i] / (problem->bound[i] != 0 ? fabs (problem->bound[i]) : 1);
}

/* By how much the outputs of a run violate constraint i; <= 0: not at all. */
static double search_violation (const pw_optimise *problem, int i, const double *output) {
  return search_factor (problem, i) * (output[i] - problem->bound[i]);
}

double pw_search_violation (const pw_optimise *problem, const double *output, int *constraint) {
  double most = -INFINITY;
  for (int i = 1; i < problem->outputs; i++)
    if (search_violation (problem, i, output) > most) most = search_violation (problem, i, output), *constraint = i;
  return most;
}

int pw_search_feasible (const pw_optimise *problem, const double *output) {
  int constraint;
  return pw_search_violation (problem, output, &constraint) <= SEARCH_ALLOWED;
}

/* Appends the last run to those of the search. */
static int search_store (local_search *local) {
  pw_search *search = local->search;
  int unknowns = local->problem->unknowns.count, outputs = local->problem->outputs, width = unknowns + outputs;
  int status =
      pw_grow (&search->trials, (size_t)search->runs, &search->allocated, (size_t)width * sizeof *search->trials);
  if (status != PW_OK) return status;
  double *row = search->trials + search->runs++ * width;
  memcpy (row, local->unknown, (size_t)unknowns * sizeof *row);
  for (int i = 0; i < outputs; i++) row[unknowns + i] = local->failed ? NAN : local->output[i];
  return PW_OK;
}

/* Makes the last run the result of the search if it is the best one. */
static void search_keep (local_search *local) {
  pw_optimise *problem = local->problem;
  pw_search *search = local->search;
  const double objective = problem->sign[0] * local->output[0];
  local->least = fmin (local->least, objective);
  local->most = fmax (local->most, objective);
  if (search->feasible && !(objective < problem->sign[0] * search->output[0])) return;
  if (!pw_search_feasible (problem, local->output)) {
    local->repeat |= !local->constrained;
    return;
  }
  search->feasible = 1;
  memcpy (search->to, local->unknown, (size_t)problem->unknowns.count * sizeof *search->to);
  memcpy (search->output, local->output, (size_t)problem->outputs * sizeof *search->output);
  pthread_mutex_lock (&problem->lock);
  if (objective < problem->least) {
    problem->least = objective;
    snprintf (problem->progress.note, sizeof problem->progress.note, "best %.7g", local->output[0]);
  }
  pw_progress_at (&problem->progress, problem->searches_done);
  pthread_mutex_unlock (&problem->lock);
}

/* Makes a run, with derivatives if `slopes`.  If only the derivatives fail, the search ends. */
static int search_try (local_search *local, int slopes, pw_error *error) {
  pw_error own = { 0 };
  int status = search_run (local->problem, local->unknown, local->output, error);
  if (status != PW_OK || !slopes) return status;
  status = search_differentiate (local, &own);
  if (status == PW_RETRY || status == PW_RESOURCE) return *error = own, status;
  local->repeat |= status != PW_OK;
  return PW_OK;
}

/* Makes the run with these scaled unknowns the last one unless it already is, with derivatives if `slopes`. */
static void search_evaluate (local_search *local, const double *scaled, int slopes) {
  const pw_unknowns *unknowns = &local->problem->unknowns;
  const size_t size = (size_t)unknowns->count * sizeof *scaled;
  pw_error error = { 0 };
  if (local->known > slopes && memcmp (local->scaled, scaled, size) == 0) return;
  memcpy (local->scaled, scaled, size);
  for (int i = 0; i < unknowns->count; i++) local->unknown[i] = search_unknown (unknowns->list + i, scaled[i]);
  int status = search_try (local, slopes, &error);
  if (status == PW_RETRY || pw_stop) {
    nlopt_force_stop (local->optimiser);
    return;
  }
  local->known = 1 + slopes;
  local->failed = status != PW_OK;
  if (local->failed && local->search->failed++ == 0) local->search->first_error = error;
  if (search_store (local) != PW_OK) status = pw_fail (&error, PW_RESOURCE, "out of memory");
  if (!local->failed) search_keep (local);
  if (status == PW_RESOURCE) {
    *local->error = error;
    pw_stop = 1; /* ends the other searches, too */
  }
  if (status == PW_RESOURCE || local->repeat) nlopt_force_stop (local->optimiser);
}

/* Stores the derivatives of factor x output i, 0 if they are unknown, unless `grad` is NULL. */
static void search_gradient (const local_search *local, int i, double factor, double *grad) {
  int unknowns = local->problem->unknowns.count;
  for (int j = 0; grad && j < unknowns; j++)
    grad[j] = local->failed || local->repeat ? 0 : factor * local->slope[i * unknowns + j];
}

/* The function that NLopt minimises: sign x objective, for a failed run more than in all others. */
static double search_objective (unsigned unknowns, const double *scaled, double *grad, void *context) {
  local_search *local = context;
  double sign = local->problem->sign[0], most = local->most;
  (void)unknowns;
  search_evaluate (local, scaled, grad != NULL);
  search_gradient (local, 0, sign, grad);
  if (!local->failed) return sign * local->output[0];
  double beyond = fmax (most - local->least, 0.1 * fabs (most));
  return isfinite (most) ? most + (beyond > 0 ? beyond : 1) : 0;
}

/* The constraints of NLopt: their violations, for a run that failed more than in all others. */
static void search_constraints (unsigned count, double *violation, unsigned unknowns, const double *scaled,
                                double *grad, void *context) {
  local_search *local = context;
  search_evaluate (local, scaled, grad != NULL);
  for (int i = 1; i <= (int)count; i++) {
    violation[i - 1] = local->failed ? 1 + local->violated : search_violation (local->problem, i, local->output);
    local->violated = fmax (local->violated, local->failed ? 0 : violation[i - 1]);
    search_gradient (local, i, search_factor (local->problem, i), grad ? grad + (unsigned)(i - 1) * unknowns : NULL);
  }
}

/* ---- Searches ---- */

/* SLSQP uses derivatives.  Without them BOBYQA is the fastest, but takes neither constraints, as COBYLA does, nor a
 * single unknown, as SBPLX does. */
static nlopt_algorithm search_algorithm (const local_search *local) {
  if (local->slope) return NLOPT_LD_SLSQP;
  if (local->constrained) return NLOPT_LN_COBYLA;
  return local->problem->unknowns.count == 1 ? NLOPT_LN_SBPLX : NLOPT_LN_BOBYQA;
}

/* Opens the optimiser with the bounds and these first and last steps of scaled unknowns. */
static int search_open (local_search *local, double first, double last) {
  const pw_unknowns *unknowns = &local->problem->unknowns;
  int n = unknowns->count, done = 1;
  nlopt_opt o = local->optimiser = nlopt_create (search_algorithm (local), (unsigned)n);
  if (o == NULL) return PW_RESOURCE;
  nlopt_set_min_objective (o, search_objective, local);
  for (int i = 0; i < n; i++) {
    const pw_unknown *unknown = unknowns->list + i;
    if (isfinite (unknown->low)) done &= nlopt_set_lower_bound (o, i, search_scaled (unknown, unknown->low)) > 0;
    if (isfinite (unknown->high)) done &= nlopt_set_upper_bound (o, i, search_scaled (unknown, unknown->high)) > 0;
  }
  unsigned constraints = local->constrained ? (unsigned)local->problem->outputs - 1 : 0;
  done &= nlopt_add_inequality_mconstraint (o, constraints, search_constraints, local, local->allowed) > 0;
  done &= nlopt_set_xtol_abs1 (o, last) > 0;
  done &= nlopt_set_initial_step1 (o, first) > 0;
  nlopt_set_maxeval (o, 200 + 100 * n); /* of each nlopt_optimize */
  return done ? PW_OK : PW_RESOURCE;
}

static void search_point (const pw_unknowns *unknowns, const double *value, double *scaled) {
  for (int i = 0; i < unknowns->count; i++) scaled[i] = search_scaled (unknowns->list + i, value[i]);
}

/* Searches from a point, unless the run there failed.  SLSQP may end early where derivatives change much: it is
 * restarted at the best run as long as that improves. */
static int search_minimise (local_search *local, double *scaled) {
  pw_search *search = local->search;
  for (int left = local->slope ? 1 + SEARCH_RESTARTS : 1; left > 0 && !local->failed && !local->repeat && !pw_stop;
       left--) {
    double before = search->feasible ? search->output[0] : NAN, objective;
    nlopt_result result = nlopt_optimize (local->optimiser, scaled, &objective);
    if (result == NLOPT_OUT_OF_MEMORY) return PW_RESOURCE;
    search->converged = (result > 0 && result != NLOPT_MAXEVAL_REACHED) || result == NLOPT_ROUNDOFF_LIMITED;
    if (!search->feasible || fabs (search->output[0] - before) <= SEARCH_GAIN * fabs (before)) break;
    search_point (&local->problem->unknowns, search->to, scaled);
  }
  return PW_OK;
}

/* Searches from the best run so far, or else from the beginning of the search, by derivatives if `slopes`. */
static int search_from (local_search *local, int slopes, double first, double last) {
  const pw_unknowns *unknowns = &local->problem->unknowns;
  size_t n = (size_t)unknowns->count, outputs = (size_t)local->problem->outputs;
  double *memory = calloc (3 * n + 2 * outputs + n * outputs, sizeof *memory);
  int status = memory ? PW_OK : PW_RESOURCE;
  if (status == PW_OK) {
    double *begin = memory;
    local->scaled = begin + n, local->unknown = local->scaled + n, local->output = local->unknown + n;
    local->allowed = local->output + outputs;
    local->slope = slopes ? local->allowed + outputs : NULL;
    local->known = local->repeat = 0;
    for (size_t i = 0; i < outputs; i++)
      local->allowed[i] = SEARCH_ALLOWED / 10; /* so that NLopt's result is feasible */
    search_point (unknowns, local->search->feasible ? local->search->to : local->search->from, begin);
    status = search_open (local, first, last);
    if (status == PW_OK) search_evaluate (local, begin, slopes);
    if (status == PW_OK) status = search_minimise (local, begin);
  }
  nlopt_destroy (local->optimiser);
  local->optimiser = NULL;
  free (memory);
  return status;
}

/* Search i of the problem, repeated without derivatives if they fail.  A refinement without derivatives first ignores
 * the constraints, as COBYLA is slow in curved valleys; it is repeated with them once they matter. */
static int search_task (pw_optimise *problem, int i, int slopes, double first, double last, pw_error *error) {
  local_search local = {
    .problem = problem, .search = problem->search + i, .least = INFINITY, .most = -INFINITY, .error = error
  };
  if (pw_stop) return PW_OK;
  local.constrained = problem->outputs > 1 && (slopes || i < problem->starts);
  int status = search_from (&local, slopes, first, last);
  if (status == PW_OK && local.repeat) {
    local.constrained = problem->outputs > 1;
    status = search_from (&local, 0, first, last);
  }
  pthread_mutex_lock (&problem->lock);
  pw_progress_at (&problem->progress, ++problem->searches_done);
  pthread_mutex_unlock (&problem->lock);
  return status == PW_OK ? error->status : pw_fail (error, status, "out of memory");
}

int pw_search_rough (void *context, int i, pw_error *error) {
  return search_task (context, i, 0, SEARCH_FIRST, SEARCH_ROUGH, error);
}

int pw_search_fine (void *context, int i, pw_error *error) {
  pw_optimise *problem = context;
  int slopes = problem->differentiable && problem->unknowns.count >= SEARCH_SLOPES;
  return search_task (problem, problem->starts + i, slopes, SEARCH_ROUGH, PW_SEARCH_FINE, error);
}

/* The largest change of output i without an effect: small compared with its value and with its range over all runs, so
 * that a large constant in it hides no effect; but not below round-off. */
static double search_noise (const pw_optimise *problem, int i) {
  const int n = problem->unknowns.count, width = n + problem->outputs;
  double least = INFINITY, most = -INFINITY, size = fabs (problem->best->output[i]);
  for (const pw_search *s = problem->search; s < problem->search + problem->starts + problem->refinements; s++)
    for (long k = 0; k < s->runs; k++) {
      const double value = s->trials[k * width + n + i];
      least = fmin (least, value), most = fmax (most, value);
    }
  return fmax (SEARCH_ROUND * size, SEARCH_SAME * fmin (size, most - least));
}

int pw_search_effect (void *context, int i, pw_error *error) {
  pw_optimise *problem = context;
  const pw_unknown *unknown = problem->unknowns.list + i;
  size_t n = (size_t)problem->unknowns.count;
  double *unknowns = calloc (n + (size_t)problem->outputs, sizeof *unknowns), value = problem->best->to[i];
  if (unknowns == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  double *output = unknowns + n;
  memcpy (unknowns, problem->best->to, n * sizeof *unknowns);
  problem->without_effect[i] = problem->objective_same[i] = 1;
  for (int side = -1; side <= 1 && problem->objective_same[i]; side += 2) {
    unknowns[i] = search_unknown (unknown, search_scaled (unknown, value) + side * SEARCH_PROBE);
    if (unknowns[i] == value) continue;
    const int failed = search_run (problem, unknowns, output, &(pw_error){ 0 }) != PW_OK;
    for (int k = 0; k < problem->outputs; k++) {
      const double change = fabs (output[k] - problem->best->output[k]);
      if (!failed && change <= search_noise (problem, k)) continue;
      problem->without_effect[i] = 0;
      if (k == 0) problem->objective_same[i] = 0;
    }
  }
  free (unknowns);
  return PW_OK;
}
