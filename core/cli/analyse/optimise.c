/* pinwheel optimise: parameters and initial values for which an output is largest or smallest.
 *
 * Local searches begin at several starts: the model's values, and Sobol points (pw_unknowns_starts).  Each search is a
 * task of its own, so that results do not depend on the number of threads.  The best results are then refined. */
#define _POSIX_C_SOURCE 200809L
#include <nlopt.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "unknowns.h"
#include "figure.h"

/* An optimisation for `pinwheel optimise`: the problem, its searches and their results.  Comments on arrays begin with
 * their sizes. */

/* A local search and its runs. */
typedef struct {
  double *from, *to;    /* unknowns: where it begins; its result, the best run that satisfies the constraints */
  double *output;       /* outputs: of that run */
  int feasible;         /* 1: there is such a run */
  int converged;        /* 1: NLopt ended the search by its tolerances or at round-off */
  long runs, failed;    /* number of runs; of those that failed */
  long derivatives;     /* number of points at which derivatives were computed */
  double *trials;       /* runs x (unknowns + outputs): all runs; outputs of failed ones are NaN */
  size_t allocated;     /* rows of `trials` */
  pw_error first_error; /* of the first failed run */
} pw_search;

typedef struct {
  pw_cli_line line;
  const char *maximise, *minimise;
  pw_cli_given starts_given, seed_given;
  const char **free, **subject_to;
  pw_unknowns unknowns;
  const char **output; /* outputs, as text: the objective, then the left sides of the constraints */
  char (*unit)[80];    /* outputs */
  double *sign;        /* outputs: 1 or -1; of the objective: sign x objective is minimised */
  double *bound;       /* outputs: of a constraint: sign x (output - bound) <= 0 */
  int outputs, starts, jobs;
  int refinements;    /* searches that continue from the best results of the starts, with smaller last steps */
  int differentiable; /* 1: outputs have derivatives, except where a motion has none */
  double seed;
  pw_search *search;              /* starts, then refinements */
  const pw_search *best;          /* that with the best result; NULL: none has one */
  unsigned char *without_effect;  /* unknowns: 1: changes of it alone do not change the outputs of the optimum */
  unsigned char *objective_same;  /* unknowns: 1: they do not change the objective of the optimum */
  const char *incomplete;         /* why the best result may not be an optimum; NULL: it is one */
  long runs, failed, derivatives; /* of all searches */
  const pw_error *first_error;    /* of the first failed run; NULL: there is none */
  pthread_mutex_t lock;           /* of the members below */
  pw_progress progress;
  int searches_done;
  double least; /* sign x best objective so far */
} pw_optimise;

#define SEARCH_FINE 1e-7 /* last steps of refinements, relative to the scales of the unknowns */

enum { OPTIMISE_REFINED = 3 }; /* results that are refined, at most */
#define OPTIMISE_RUNS 20.      /* usual number of runs of a search, to choose the engine */
#define OPTIMISE_DIVERGED 1e6  /* modulus of an unknown without bounds, in units of its scale: the search diverged */

/* Local searches of `pinwheel optimise`, by NLopt; refinements of SEARCH_SLOPES or more unknowns use derivatives of
 * differentiable outputs.  NLopt varies scaled unknowns (search_unknown). */

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

static int search_neighbour (void *problem, const double *x, double rtol, double *value, pw_error *error) {
  (void)rtol;
  return search_run (problem, x, value, error);
}

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

/* The largest violation of a constraint by the outputs of a run, relative to its bound if that is not 0; <= 0: there is
 * none.  *constraint: the index in `output` of the constraint with that violation, from 1; not set without
 * constraints. */
static double search_worst (const pw_optimise *problem, const double *output, int *constraint) {
  double most = -INFINITY;
  for (int i = 1; i < problem->outputs; i++)
    if (search_violation (problem, i, output) > most) most = search_violation (problem, i, output), *constraint = i;
  return most;
}

/* 1 if the outputs of a run satisfy the constraints. */
static int search_feasible (const pw_optimise *problem, const double *output) {
  int constraint;
  return search_worst (problem, output, &constraint) <= SEARCH_ALLOWED;
}

/* Makes the last run the result of the search if it is the best one. */
static void search_keep (local_search *local) {
  pw_optimise *problem = local->problem;
  pw_search *search = local->search;
  const double objective = problem->sign[0] * local->output[0];
  local->least = fmin (local->least, objective);
  local->most = fmax (local->most, objective);
  if (search->feasible && !(objective < problem->sign[0] * search->output[0])) return;
  if (!search_feasible (problem, local->output)) {
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

/* Makes the run with these scaled unknowns the last one unless it already is, with derivatives if `slopes`. */
static void search_evaluate (local_search *local, const double *scaled, int slopes) {
  const pw_unknowns *unknowns = &local->problem->unknowns;
  const size_t size = (size_t)unknowns->count * sizeof *scaled;
  pw_error error = { 0 };
  if (local->known > slopes && memcmp (local->scaled, scaled, size) == 0) return;
  memcpy (local->scaled, scaled, size);
  for (int i = 0; i < unknowns->count; i++) local->unknown[i] = search_unknown (unknowns->list + i, scaled[i]);
  int status = search_run (local->problem, local->unknown, local->output, &error);
  if (status == PW_OK && slopes) { /* if only the derivatives fail, the search ends */
    pw_error own = { 0 };
    status = search_differentiate (local, &own);
    if (status == PW_RETRY || status == PW_RESOURCE)
      error = own;
    else
      local->repeat |= status != PW_OK, status = PW_OK;
  }
  if (status == PW_RETRY || pw_stop) {
    nlopt_force_stop (local->optimiser);
    return;
  }
  local->known = 1 + slopes;
  local->failed = status != PW_OK;
  if (local->failed && local->search->failed++ == 0) local->search->first_error = error;
  pw_search *search = local->search;
  const size_t n = (size_t)unknowns->count, width = n + (size_t)local->problem->outputs;
  if (pw_grow (&search->trials, (size_t)search->runs, &search->allocated, width * sizeof *search->trials) == PW_OK) {
    double *row = search->trials + (size_t)search->runs++ * width;
    memcpy (row, local->unknown, size);
    for (size_t i = n; i < width; i++) row[i] = local->failed ? NAN : local->output[i - n];
  } else
    status = pw_fail (&error, PW_RESOURCE, "out of memory");
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

/* Opens the optimiser with the bounds and these first and last steps of scaled unknowns.  SLSQP uses derivatives.
 * Without them BOBYQA is the fastest, but takes neither constraints, as COBYLA does, nor a single unknown, as SBPLX
 * does. */
static int search_open (local_search *local, double first, double last) {
  const pw_unknowns *unknowns = &local->problem->unknowns;
  int n = unknowns->count, done = 1;
  const nlopt_algorithm algorithm = local->slope         ? NLOPT_LD_SLSQP
                                    : local->constrained ? NLOPT_LN_COBYLA
                                    : n == 1             ? NLOPT_LN_SBPLX
                                                         : NLOPT_LN_BOBYQA;
  nlopt_opt o = local->optimiser = nlopt_create (algorithm, (unsigned)n);
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

/* Tasks of pw_parallel: the search from start i; refinement i. */
static int search_rough (void *context, int i, pw_error *error) {
  return search_task (context, i, 0, SEARCH_FIRST, SEARCH_ROUGH, error);
}

static int search_fine (void *context, int i, pw_error *error) {
  pw_optimise *problem = context;
  int slopes = problem->differentiable && problem->unknowns.count >= SEARCH_SLOPES;
  return search_task (problem, problem->starts + i, slopes, SEARCH_ROUGH, SEARCH_FINE, error);
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

/* Likewise: sets without_effect[i] and objective_same[i], by two runs; their failure is an effect. */
static int search_effect (void *context, int i, pw_error *error) {
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

#define REPORT_SAME 0.01 /* largest distance of results of the same optimum, in scales of the unknowns */

static int optimise_open_searches (pw_optimise *problem, pw_error *error) {
  const size_t n = (size_t)problem->unknowns.count, width = 2 * n + (size_t)problem->outputs,
               starts = (size_t)problem->starts, all = starts + OPTIMISE_REFINED;
  double *start = pw_unknowns_starts (&problem->unknowns, problem->starts, problem->seed),
         *memory = pw_arena_alloc (&problem->line.arena, all * width * sizeof *memory);
  problem->search = pw_arena_alloc (&problem->line.arena, all * sizeof *problem->search);
  problem->without_effect = pw_arena_alloc (&problem->line.arena, 2 * n);
  int status = start && memory && problem->search && problem->without_effect
                   ? PW_OK
                   : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) problem->objective_same = problem->without_effect + n;
  for (size_t i = 0; status == PW_OK && i < all; i++) {
    pw_search *search = problem->search + i;
    search->from = memory + i * width, search->to = search->from + n, search->output = search->to + n;
    if (i < starts) memcpy (search->from, start + i * n, n * sizeof *start);
  }
  free (start);
  return status;
}

/* The search with the best result among the first `count` searches without those `excluded`, which may be NULL; of
 * equal ones the first that converged, or else the first.  NULL: none has a result. */
static const pw_search *optimise_best (const pw_optimise *problem, int count, const unsigned char *excluded) {
  const pw_search *best = NULL;
  for (int i = 0; i < count; i++) {
    const pw_search *search = problem->search + i;
    if (!search->feasible || (excluded && excluded[i])) continue;
    double gain = best ? problem->sign[0] * (best->output[0] - search->output[0]) : INFINITY;
    if (gain > 0 || (gain == 0 && search->converged && !best->converged)) best = search;
  }
  return best;
}

/* 1 if two searches have results, and these are the same optimum: they differ little in all unknowns but those without
 * effect. */
static int optimise_same (const pw_optimise *problem, const pw_search *a, const pw_search *b) {
  int same = a->feasible && b->feasible;
  for (int j = 0; same && j < problem->unknowns.count; j++)
    same = problem->without_effect[j] || fabs (a->to[j] - b->to[j]) <= REPORT_SAME * problem->unknowns.list[j].scale;
  return same;
}

static int optimise_refine (pw_optimise *problem, pw_error *error) {
  const pw_search *best;
  unsigned char *refined = calloc ((size_t)problem->starts, 1); /* 1: its result, or the same optimum, is refined */
  if (refined == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (problem->refinements < OPTIMISE_REFINED && (best = optimise_best (problem, problem->starts, refined))) {
    pw_search *refinement = problem->search + problem->starts + problem->refinements++;
    memcpy (refinement->from, best->to, (size_t)problem->unknowns.count * sizeof *best->to);
    for (int i = 0; i < problem->starts; i++)
      refined[i] |= (unsigned char)optimise_same (problem, problem->search + i, best);
  }
  free (refined);
  problem->progress.last = problem->starts + problem->refinements;
  return pw_parallel (problem->jobs, problem->refinements, search_fine, problem, error);
}

/* PW_METHOD if the search with the best result did not converge, or all its runs but one failed, or it ended at a
 * very large value of an unknown without bounds. */
static int optimise_converged (const pw_optimise *problem, pw_error *error) {
  const pw_search *search = problem->best;
  const pw_unknown *farthest = NULL;
  double distance = 0; /* in units of its scale */
  for (int i = 0; i < problem->unknowns.count; i++) {
    const pw_unknown *unknown = problem->unknowns.list + i;
    if (unknown->has_bounds || !(fabs (search->to[i]) >= distance * unknown->scale)) continue;
    farthest = unknown, distance = fabs (search->to[i]) / unknown->scale;
  }
  int found = search->converged && distance < OPTIMISE_DIVERGED;
  if (found && search->failed > 0 && search->runs - search->failed == 1)
    return pw_fail (error, PW_METHOD, "all other runs of the search failed: %s", search->first_error.text);
  if (found) return PW_OK;
  if (farthest == NULL) return pw_fail (error, PW_METHOD, "the search did not converge");
  return pw_fail (error, PW_METHOD,
                  "the search %s; perhaps there is no optimum unless bounds are given, as in --free %s=LOW:HIGH",
                  search->converged ? "diverged" : "did not converge", farthest->name);
}

static int optimise_search (pw_optimise *problem, pw_error *error) {
  pw_stop_catch ();
  pthread_mutex_init (&problem->lock, NULL);
  pw_progress_start (&problem->progress, pw_file_name (problem->line.m.file), "searches", 0,
                     problem->starts + OPTIMISE_REFINED);
  int status = pw_parallel (problem->jobs, problem->starts, search_rough, problem, error);
  if (status == PW_OK) status = optimise_refine (problem, error);
  pw_progress_end (&problem->progress);
  problem->best = optimise_best (problem, problem->starts + problem->refinements, NULL);
  if (status == PW_OK && problem->best && !pw_stop && optimise_converged (problem, &(pw_error){ 0 }) == PW_OK)
    status = pw_parallel (problem->jobs, problem->unknowns.count, search_effect, problem, error);
  pthread_mutex_destroy (&problem->lock);
  pw_stop_release ();
  for (int i = 0; i < problem->starts + problem->refinements; i++) {
    const pw_search *search = problem->search + i;
    problem->runs += search->runs, problem->failed += search->failed, problem->derivatives += search->derivatives;
    if (problem->first_error == NULL && search->failed) problem->first_error = &search->first_error;
  }
  return status;
}

enum {
  REPORT_DIGITS = 9,
  REPORT_PANELS = 6 /* of a figure, at most: one for each unknown */
};

/* The objective of the first run, with the initial values; NaN if it failed. */
static double report_initial (const pw_optimise *problem) {
  return problem->search[0].runs > 0 ? problem->search[0].trials[problem->unknowns.count] : NAN;
}

/* The bound at which the best value of unknown i is: -1 the lower one, 1 the upper one, 0 neither, or no effect.  The
 * value of an incomplete search must be exactly there. */
static int report_bound (const pw_optimise *problem, int i) {
  const pw_unknown *unknown = problem->unknowns.list + i;
  if (problem->without_effect[i]) return 0;
  double near = problem->incomplete ? 0 : 10 * SEARCH_FINE * unknown->scale, value = problem->best->to[i];
  return value - unknown->low <= near ? -1 : unknown->high - value <= near;
}

static void report_unknowns (const pw_optimise *problem) {
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    static const char *const head[] = { "free", "initially", "best", "from", "to", NULL };
    pw_head (&t, -12, 12, head);
    for (int i = 0; i < problem->unknowns.count; i++) {
      const pw_unknown *u = problem->unknowns.list + i;
      pw_cell_unit (&t, -12, u->name, u->unit);
      pw_cell_number (&t, 12, u->value, REPORT_DIGITS);
      pw_cell_number (&t, 12, problem->best->to[i], REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (u->low) ? u->low : NAN, REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (u->high) ? u->high : NAN, REPORT_DIGITS);
      pw_cell (&t, -1,
               problem->without_effect[i]
                   ? "without effect"
                   : (const char *[]){ "at its lower bound", "", "at its upper bound" }[1 + report_bound (problem, i)]);
      pw_row_end (&t);
    }
  }
}

static void report_outputs (const pw_optimise *problem) {
  const double *output = problem->best->output;
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < problem->outputs; i++) {
      const char *bound = PW_DIGITS (problem->bound[i], REPORT_DIGITS);
      pw_cell_unit (&t, -12, problem->output[i], problem->unit[i]);
      pw_cell_number (&t, 12, output[i], REPORT_DIGITS);
      if (i > 0) pw_cell (&t, -1, PW_PRINTED (60, "at %s %s", problem->sign[i] > 0 ? "most" : "least", bound));
      if (i == 0)
        pw_cell (
            &t, -1,
            PW_PRINTED (60, "%s%s", problem->maximise ? "largest" : "smallest", problem->incomplete ? " so far" : ""));
      if (i == 0)
        pw_cell (&t, -1, PW_PRINTED (60, "(initially %s)", PW_DIGITS (report_initial (problem), REPORT_DIGITS)));
      pw_row_end (&t);
    }
}

static void optimise_print (const pw_optimise *problem) {
  char options[PW_UNKNOWNS_OPTIONS];
  /* a search from a start also ends at a result that continues from there */
  const pw_search *best = problem->best, continued = { .feasible = 1, .to = best->from };
  int same = 0;
  for (int i = 0; i < problem->starts; i++)
    same += optimise_same (problem, problem->search + i, best) ||
            (best - problem->search >= problem->starts && optimise_same (problem, problem->search + i, &continued));
  report_unknowns (problem);
  report_outputs (problem);
  printf ("\n%s from %s, %d of which %s\n", PW_COUNTED (problem->runs, "run"), PW_COUNTED (problem->starts, "start"),
          same,
          problem->incomplete ? "end here"
          : same == 1         ? "ends at this optimum"
                              : "end at this optimum");
  if (problem->derivatives)
    printf ("with derivatives at %s of the searches that continue (SLSQP), without in the others\n",
            PW_COUNTED (problem->derivatives, "point"));
  if (problem->first_error)
    pw_cli_print (stdout, "%s failed and %s as infeasible, the first of them: %s\n",
                  PW_COUNTED (problem->failed, "run"), problem->failed == 1 ? "counts" : "count",
                  problem->first_error->text);
  if (memchr (problem->objective_same, 0, (size_t)problem->unknowns.count) == NULL)
    pw_cli_say ("pinwheel: no free value has an effect on %s\n", problem->output[0]);
  if (pw_unknowns_options (&problem->unknowns, problem->best->to, options)) printf ("\n%s\n", options);
}

static void optimise_json (const void *context, pw_json *j) {
  const pw_optimise *problem = context;
  char options[PW_UNKNOWNS_OPTIONS];
  pw_json_print (j, "{schema: %d, model: %s, status: %s", 1, pw_file_name (problem->line.m.file),
                 pw_results_word (&problem->line, pw_stop != 0, problem->incomplete == NULL));
  pw_json_text (j, problem->maximise ? "maximise" : "minimise", problem->output[0]);
  pw_json_print (j, "value: %g, initial: %g, options: %s, method: %s, t_end: %g, seed: %g", problem->best->output[0],
                 report_initial (problem), pw_unknowns_options (&problem->unknowns, problem->best->to, options),
                 problem->unknowns.method, problem->unknowns.settings.span, problem->seed);
  pw_json_print (j, "runs: %ld, failed: %ld, derivatives: %ld, reason: %s, unknowns: [", problem->runs, problem->failed,
                 problem->derivatives, problem->first_error ? problem->first_error->text : "");
  for (int i = 0; i < problem->unknowns.count; i++) {
    const pw_unknown *u = problem->unknowns.list + i;
    pw_json_print (j, "{name: %s, unit: %s, initial: %g, value: %g, low: %g, high: %g, bound: %s}", u->name, u->unit,
                   u->value, problem->best->to[i], u->low, u->high,
                   (const char *[]){ "low", NULL, "high" }[1 + report_bound (problem, i)]);
  }
  pw_json_print (j, "], constraints: [");
  for (int i = 1; i < problem->outputs; i++)
    pw_json_print (j, "{output: %s, type: %s, bound: %g, value: %g}", problem->output[i],
                   problem->sign[i] > 0 ? "<=" : ">=", problem->bound[i], problem->best->output[i]);
  pw_json_print (j, "], starts: [");
  for (const pw_search *s = problem->search; s < problem->search + problem->starts + problem->refinements; s++) {
    pw_json_print (j, "{value: %g, runs: %ld, failed: %ld", s->feasible ? s->output[0] : NAN, s->runs, s->failed);
    pw_json_numbers (j, "from", s->from, problem->unknowns.count);
    pw_json_numbers (j, "to", s->to, s->feasible ? problem->unknowns.count : 0);
    pw_json_close (j, '}');
  }
  pw_json_print (j, "]}");
}

/* Writes the command that runs the result, as a comment: the given options that affect runs, then the values found. */
static void report_command (const pw_optimise *problem, const char *values, FILE *f) {
  const pw_cli_line *line = &problem->line;
  const struct {
    const char *option, *value;
  } given[] = { { "--max-file", line->max_file.text },
                { "--method", line->method },
                { "--t-end", line->t_end.text },
                { "--step", line->step.text },
                { "--rtol", line->rtol.text },
                { "--atol", line->atol.text },
                { "--max-steps", line->max_steps.text },
                { "--until", line->until },
                { "--specialise", problem->unknowns.engine.code ? "always" : line->specialise } };
  fputs ("# pinwheel run ", f);
  pw_cli_word (f, line->argument[0]);
  for (const char **set = line->sets; set && *set; set++) fputs (" --set ", f), pw_cli_word (f, *set);
  for (const char **start = line->starts; start && *start; start++) fputs (" --start ", f), pw_cli_word (f, *start);
  for (size_t i = 0; i < sizeof given / sizeof *given; i++)
    if (given[i].value) fprintf (f, " %s ", given[i].option), pw_cli_word (f, given[i].value);
  fprintf (f, " %s\n", values);
}

static void optimise_yaml (const void *context, pw_cells *result) {
  const pw_optimise *problem = context;
  FILE *f = result->f;
  char values[PW_UNKNOWNS_OPTIONS];
  const pw_search *best = problem->best;
  if (pw_unknowns_options (&problem->unknowns, best->to, values) && strpbrk (problem->line.argument[0], "\r\n") == NULL)
    report_command (problem, values, f);
  if (problem->incomplete)
    fprintf (f, "# perhaps not an optimum: %.*s\n", (int)strcspn (problem->incomplete, "\r\n"), problem->incomplete);
  fputs ("model: ", f);
  pw_cli_quoted (f, pw_file_name (problem->line.m.file), "''");
  fputs (problem->maximise ? "\nmaximise: " : "\nminimise: ", f);
  pw_cli_quoted (f, problem->output[0], "''");
  fprintf (f, "\nvalue: %.17g\n", best->output[0]);
  for (int initial = 0; initial < 2; initial++)
    for (int i = 0, first = 1; i < problem->unknowns.count; i++) {
      if ((problem->unknowns.list[i].parameter == NULL) != initial) continue;
      if (first) fputs (initial ? "start:\n" : "set:\n", f);
      first = 0;
      fprintf (f, "  %s: %.17g\n", problem->unknowns.list[i].name, best->to[i]);
    }
}

/* The objective of every run against each unknown, the best one marked. */
static void optimise_draw (const void *context, pw_curves *c) {
  const pw_optimise *problem = context;
  static const char *const style[] = { "infeasible", "feasible" };
  const int n = problem->unknowns.count, width = n + problem->outputs, panels = n < REPORT_PANELS ? n : REPORT_PANELS;
  const char *objective = PW_FIGURE_LABEL (problem->output[0], problem->unit[0]);
  for (int i = 0; i < panels; i++) {
    pw_curves_panel (
        c, &(pw_panel){ .x_label = PW_FIGURE_LABEL (problem->unknowns.list[i].name, problem->unknowns.list[i].unit),
                        .y_label = objective,
                        .aspect = panels > 1 ? 0.7 : 0.5,
                        .type = panels > 1 ? PW_PANEL_HALF : 0 });
    for (int feasible = 0; feasible < 2; feasible++) {
      pw_curves_add (c, style[feasible], style[feasible]);
      for (const pw_search *s = problem->search; s < problem->search + problem->starts + problem->refinements; s++)
        for (const double *run = s->trials; run && run < s->trials + s->runs * width; run += width)
          if (!isnan (run[n]) && search_feasible (problem, run + n) == feasible) pw_curves_point (c, run[i], run[n], 0);
    }
    pw_curves_add (c, "best", "best");
    pw_curves_point (c, problem->best->to[i], problem->best->output[0], 0);
  }
}

static const pw_results optimise_results = {
  .name = "optimise",
  .title = "runs of the optimisation",
  .lines = 2,
  .table = optimise_yaml,
  .json = optimise_json,
  .draw = optimise_draw,
};

static int optimise_read (pw_optimise *problem, pw_error *error) {
  size_t count = 1;
  problem->least = INFINITY, problem->seed = pw_cli_given_or (problem->seed_given, 1);
  problem->starts = (int)pw_cli_given_or (problem->starts_given, 10), problem->jobs = pw_parallel_jobs (&problem->line);
  if (!problem->maximise == !problem->minimise)
    return pw_fail (error, PW_INPUT, "expected one of --maximise OUTPUT and --minimise OUTPUT");
  for (const char **given = problem->subject_to; given && *given; given++) count++;
  problem->output = pw_arena_alloc (&problem->line.arena, (count + 1) * sizeof *problem->output); /* ended by NULL */
  problem->unit = pw_arena_alloc (&problem->line.arena, count * sizeof *problem->unit);
  problem->bound = pw_arena_alloc (&problem->line.arena, 2 * count * sizeof *problem->bound);
  if (problem->output == NULL || problem->unit == NULL || problem->bound == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  problem->sign = problem->bound + count;
  problem->output[0] = problem->maximise ? problem->maximise : problem->minimise;
  problem->sign[0] = problem->maximise ? -1 : 1;
  problem->outputs = 1;
  for (const char **given = problem->subject_to; given && *given; given++) {
    const int i = problem->outputs++;
    char *text = pw_arena_copy (&problem->line.arena, *given), *symbol = NULL; /* "OUTPUT<=VALUE" or "OUTPUT>=VALUE" */
    if (text == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
    for (char *c = text; *c; c++)
      if ((*c == '<' || *c == '>') && c[1] == '=') symbol = c;
    if (symbol == NULL || pw_read_expression (symbol + 2, &problem->bound[i]) != PW_OK || !isfinite (problem->bound[i]))
      return pw_fail (error, PW_INPUT, "--subject-to %.200s: expected OUTPUT<=VALUE or OUTPUT>=VALUE%s", *given,
                      symbol ? PW_NUMBER_HINT (symbol + 2) : "");
    problem->sign[i] = *symbol == '<' ? 1 : -1;
    *symbol = 0;
    while (symbol > text && symbol[-1] == ' ') *--symbol = 0;
    problem->output[i] = text; /* OUTPUT is kept */
  }
  return PW_OK;
}

/* Checks the outputs of an option, from number `first` on, and stores their units.  Extrema are not differentiable. */
static int optimise_open_outputs (pw_optimise *problem, int first, int count, const char *option, pw_error *error) {
  pw_outcomes set;
  int status = pw_outcomes_open (&set, problem->line.m.system, option, problem->output + first, count,
                                 problem->line.until, error);
  if (status == PW_OK) pw_outcomes_report (&set);
  for (int i = 0; i < set.outcomes; i++) pw_outcome_unit (&set, i, problem->unit[first + i], sizeof *problem->unit);
  for (int i = 0; i < set.functionals; i++) problem->differentiable &= !pw_is_extremum (set.functional[i].type);
  pw_outcomes_close (&set);
  return status;
}

static int optimise_open (pw_optimise *problem, pw_error *error) {
  static const char *const texts[] = { ".yaml", ".yml", NULL };
  int status = pw_cli_open (&problem->line, error);
  problem->differentiable = 1;
  if (status == PW_OK)
    status = optimise_open_outputs (problem, 0, 1, problem->maximise ? "--maximise" : "--minimise", error);
  if (status == PW_OK) status = optimise_open_outputs (problem, 1, problem->outputs - 1, "--subject-to", error);
  if (status == PW_OK) status = pw_unknowns_open (&problem->unknowns, &problem->line, error);
  if (status == PW_OK) status = pw_unknowns_read (&problem->unknowns, "--free", problem->free, error);
  if (status == PW_OK) status = pw_unknowns_engine (&problem->unknowns, OPTIMISE_RUNS, problem->starts, error);
  if (status == PW_OK) status = pw_results_open (&problem->line, &optimise_results, texts, (pw_use){ 0 }, error);
  return status == PW_OK ? optimise_open_searches (problem, error) : status;
}

/* The error if no run satisfies the constraints: that of the first run if every run failed. */
static int optimise_infeasible (const pw_optimise *problem, pw_error *error) {
  char unit[90] = "";
  int i = 0;
  if (problem->failed == problem->runs && problem->first_error)
    return pw_fail (error, problem->first_error->status, "no run succeeded (%s); the first failed: %s",
                    PW_COUNTED (problem->runs, "run"), problem->first_error->text);
  const double *output = NULL; /* of the run whose largest violation is smallest */
  double least = INFINITY;
  int n = problem->unknowns.count, width = n + problem->outputs, constraint = 0;
  for (const pw_search *search = problem->search; search < problem->search + problem->starts; search++)
    for (long k = 0; k < search->runs; k++) {
      const double *run = search->trials + k * width + n;
      double violation = isnan (run[0]) ? NAN : search_worst (problem, run, &constraint);
      if (violation <= least) least = violation, output = run, i = constraint;
    }
  if (*problem->unit[i]) snprintf (unit, sizeof unit, " %s", problem->unit[i]);
  return pw_fail (error, PW_METHOD,
                  "no run from %s satisfies --subject-to; in the nearest one %s is %s%s and must be at %s %s%s",
                  PW_COUNTED (problem->starts, "start"), problem->output[i], PW_DIGITS (output[i], 9), unit,
                  problem->sign[i] > 0 ? "most" : "least", PW_DIGITS (problem->bound[i], 9), unit);
}

static int optimise_finish (pw_optimise *problem, pw_error *error) {
  int stopped = pw_stop != 0;
  if (problem->best == NULL && stopped) pw_cli_say ("pinwheel: interrupted before any run satisfied the constraints\n");
  if (problem->best == NULL) return stopped ? PW_INTERRUPTED : optimise_infeasible (problem, error);
  pw_error unconverged = { 0 };
  int converged = optimise_converged (problem, &unconverged) == PW_OK;
  problem->incomplete = stopped ? "the search was interrupted" : converged ? NULL : unconverged.text;
  optimise_print (problem);
  pw_unknowns_report (&problem->unknowns, problem->best->to);
  int status = pw_results_write (&problem->line, &optimise_results, problem, error);
  if (stopped) pw_cli_say ("pinwheel: interrupted; this is the best result so far\n");
  if (status == PW_OK && stopped) return PW_INTERRUPTED;
  return status == PW_OK && !converged ? pw_fail (error, unconverged.status, "%s", unconverged.text) : status;
}

static int optimise_command (void *options, pw_error *error) {
  pw_optimise *problem = options;
  int status = optimise_read (problem, error);
  if (status == PW_OK) status = optimise_open (problem, error);
  if (status == PW_OK) status = optimise_search (problem, error);
  if (status == PW_OK) status = optimise_finish (problem, error);
  for (int i = 0; problem->search && i < problem->starts + OPTIMISE_REFINED; i++) free (problem->search[i].trials);
  pw_unknowns_close (&problem->unknowns);
  return status;
}

static const struct poptOption optimise_options[] = {
  PW_OPTION_GROUP ("Optimisation"),
  PW_TEXT_OPTION (pw_optimise, maximise, "maximise", 0, "OUTPUT", "Maximise " PW_OUTPUT_HELP),
  PW_TEXT_OPTION (pw_optimise, minimise, "minimise", 0, "OUTPUT", "Minimise such an output"),
  PW_LIST_OPTION (pw_optimise, free, "free", 0, "NAME[=LOW:HIGH[:log]]",
                  "Vary a parameter or an initial value, such as frame.vx, between bounds, or within its domain; "
                  "repeatable"),
  PW_LIST_OPTION (pw_optimise, subject_to, "subject-to", 0, "OUTPUT<=VALUE",
                  "Constraint, or OUTPUT>=VALUE, which may be violated by 1e-6 of VALUE; repeatable"),
  PW_NUMBER_OPTION (pw_optimise, starts_given, "starts", 0, "N", PW_COUNT,
                    "Search from the model's values and N - 1 points between the bounds (default 10)"),
  PW_NUMBER_OPTION (pw_optimise, seed_given, "seed", 0, "N", PW_COUNT, "Seed of these points (default 1)"),
  PW_JOBS_OPTION ("Number of concurrent runs (default: one per processor)"),
  PW_TEXT_OPTION (pw_cli_line, table, "output", 'o', "FILE.yaml",
                  "Write the values, with the command of their run as a comment"),
  PW_SUMMARY_OPTIONS ("Write a summary", "Write figures of all runs"),
  PW_METHOD_OPTIONS,
  PW_UNTIL_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_optimise = {
  .name = "optimise",
  .synopsis = "MODEL --maximise|--minimise OUTPUT --free NAME[=LOW:HIGH]... [OPTION...]",
  .summary = "find the parameters for which an output is largest or smallest",
  .help = "Vary parameters and initial values of a model until an output of its runs is largest or smallest, by local "
          "searches from several starts. Runs that fail count as infeasible.",
  .options_size = sizeof (pw_optimise),
  .function = optimise_command,
  .options = optimise_options,
};
