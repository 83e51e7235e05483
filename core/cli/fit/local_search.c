/* Local searches of `pinwheel optimise`, by NLopt, with derivatives of smooth outputs. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <nlopt.h>
#include <stdlib.h>
#include <string.h>
#include "optimise.h"
#include "util.h"

#define SEARCH_FIRST 0.1    /* first steps, relative to the scales of the unknowns */
#define SEARCH_ROUGH 1e-3   /* last ones */
#define SEARCH_ALLOWED 1e-6 /* violation of a constraint, relative to its bound */
#define SEARCH_GAIN 1e-9    /* least improvement for another repetition, relative to the value */

/* Fewest unknowns for derivatives, which cost as much as several runs; repetitions of a search. */
enum { SEARCH_SLOPES = 3, SEARCH_REPEATS = 8 };

/* ---- Runs ---- */

typedef struct {
  pw_optimise *x;
  pw_search_start *s;
  nlopt_opt opt;
  double *u, *at, *value; /* the last run: scaled unknowns, unknowns, outputs */
  double *allowed;        /* outputs: excess of the constraints of which the search does not take notice */
  double *slope;          /* outputs x unknowns: derivatives with respect to scaled unknowns; NULL: without */
  int known, sloped;      /* 1: there was a run; with derivatives */
  int failed;             /* 1: the last run failed */
  int refused;            /* 1: derivatives could not be computed, though the run succeeded */
  double least, most;     /* objectives of the runs that succeeded */
} search;

/* The value of an unknown: u is from 0 to 1 between the user's bounds, otherwise in units of its scale. */
static double search_unknown (const pw_unknown *k, double u) {
  return fmin (fmax (k->has_bounds ? k->low + u * k->scale : u * k->scale, k->low), k->high);
}

static double search_scaled (const pw_unknown *k, double x) {
  return k->has_bounds ? (x - k->low) / k->scale : x / k->scale;
}

/* A status; outputs that are not finite count as failed. */
static int search_run (const search *p, pw_error *error) {
  const pw_unknowns *u = &p->x->unknowns;
  pw_outcomes o = { .system = NULL };
  pw_unknown_run r;
  char number[32];
  int status = pw_unknown_run_prepare (&r, u, p->at, error);
  if (status == PW_OK) status = pw_outcomes_open (&o, r.m.system, "output", p->x->text, p->x->outputs, error);
  r.settings.ledger = o.ledger;
  if (status == PW_OK) status = pw_outcomes_run (&o, u->method, &r.settings, u->t_end, error);
  for (int i = 0; status == PW_OK && i < p->x->outputs; i++) {
    p->value[i] = pw_outcome_value (&o, i, NULL);
    if (!isfinite (p->value[i]))
      status = pw_fail (error, PW_METHOD, "%s is %s", p->x->text[i], pw_format (number, p->value[i], 9));
  }
  pw_outcomes_close (&o);
  pw_unknown_run_close (&r);
  return status;
}

/* The same with derivatives. */
static int search_differentiate (search *p, pw_error *error) {
  const pw_unknowns *u = &p->x->unknowns;
  pw_progress silent = { 0 };
  pw_sensitivity s = { .of = p->x->text, .unknowns = *u, .no_error = 1 };
  int status = pw_sensitivity_open (&s, p->at, error);
  if (status == PW_OK) status = pw_sensitivity_compute (&s, &silent, error);
  if (status == PW_OK && s.stopped) status = pw_limit_status (&s.limit, pw_run_time (s.base.run), error);
  for (int i = 0; i < p->x->outputs && status == PW_OK; i++) {
    p->value[i] = pw_outcome_value (&s.outcomes, i, NULL);
    for (int j = 0; j < u->count && status == PW_OK; j++) {
      double *slope = p->slope + i * u->count + j;
      *slope = u->list[j].scale * pw_sensitivity_derivative (&s, i, j, s.run_slope);
      if (!isfinite (p->value[i] + *slope)) status = pw_fail (error, PW_METHOD, "%s has no derivative", p->x->text[i]);
    }
  }
  pw_sensitivity_close (&s);
  p->s->derivatives += status == PW_OK;
  return status;
}

int pw_search_feasible (const pw_optimise *x, const double *value) {
  for (int i = 1; i < x->outputs; i++)
    if (x->sign[i] * (value[i] - x->bound[i]) > SEARCH_ALLOWED * (x->bound[i] != 0 ? fabs (x->bound[i]) : 1)) return 0;
  return 1;
}

/* Appends the last run to those of the start. */
static int search_store (search *p) {
  pw_search_start *s = p->s;
  int n = p->x->unknowns.count, width = n + p->x->outputs;
  if (pw_grow (&s->trial, (size_t)s->runs, &s->room, (size_t)width * sizeof *s->trial) != PW_OK) return PW_RESOURCE;
  double *row = s->trial + s->runs++ * width;
  memcpy (row, p->at, (size_t)n * sizeof *row);
  for (int i = 0; i < p->x->outputs; i++) row[n + i] = p->failed ? NAN : p->value[i];
  return PW_OK;
}

/* Keeps the last run if it is the best one. */
static void search_keep (search *p) {
  pw_optimise *x = p->x;
  pw_search_start *s = p->s;
  double value = x->sign[0] * p->value[0];
  p->least = fmin (p->least, value);
  p->most = fmax (p->most, value);
  if (!pw_search_feasible (x, p->value) || (s->found && !(value < x->sign[0] * s->value[0]))) return;
  s->found = 1;
  memcpy (s->best, p->at, (size_t)x->unknowns.count * sizeof *s->best);
  memcpy (s->value, p->value, (size_t)x->outputs * sizeof *s->value);
  pthread_mutex_lock (&x->lock);
  if (value < x->leading) {
    x->leading = value;
    snprintf (x->progress.note, sizeof x->progress.note, "best %.7g", p->value[0]);
  }
  pw_progress_at (&x->progress, x->done);
  pthread_mutex_unlock (&x->lock);
}

/* Runs with the unknowns, or differentiates.  If only the derivatives fail, the search ends. */
static int search_try (search *p, int slopes, pw_error *error) {
  pw_error own = { 0 };
  int status = slopes ? search_differentiate (p, &own) : PW_METHOD;
  if (status == PW_OK || status == PW_RETRY || status == PW_RESOURCE) {
    if (status != PW_OK) *error = own;
    return status;
  }
  status = search_run (p, error);
  p->refused = slopes && status == PW_OK;
  if (p->refused) nlopt_force_stop (p->opt);
  return status;
}

/* Runs with these scaled unknowns (slopes 1: with derivatives), unless the last run did. */
static void search_evaluate (search *p, const double *u, int slopes) {
  pw_optimise *x = p->x;
  int n = x->unknowns.count;
  pw_error own = { 0 };
  if (p->known && (p->sloped || !slopes) && memcmp (p->u, u, (size_t)n * sizeof *u) == 0) return;
  memcpy (p->u, u, (size_t)n * sizeof *u);
  for (int i = 0; i < n; i++) p->at[i] = search_unknown (x->unknowns.list + i, u[i]);
  int status = search_try (p, slopes, &own);
  if (status == PW_RETRY || pw_stop) {
    nlopt_force_stop (p->opt);
    return;
  }
  p->known = 1;
  p->sloped = slopes;
  p->failed = status != PW_OK;
  if (p->failed && p->s->failed++ == 0) p->s->error = own;
  if (search_store (p) != PW_OK) status = pw_fail (&own, PW_RESOURCE, "out of memory");
  if (!p->failed) search_keep (p);
  if (status != PW_RESOURCE) return;
  pthread_mutex_lock (&x->lock);
  if (x->error.status == PW_OK) x->error = own;
  pthread_mutex_unlock (&x->lock);
  pw_stop = pw_stop ? pw_stop : 1;
  nlopt_force_stop (p->opt);
}

/* The derivatives of factor x output. */
static void search_gradient (const search *p, int output, double factor, double *gradient) {
  int n = p->x->unknowns.count;
  for (int j = 0; gradient && j < n; j++) gradient[j] = p->failed || p->refused ? 0 : factor * p->slope[output * n + j];
}

/* A run that failed counts as worse than all others. */
static double search_objective (unsigned n, const double *u, double *gradient, void *context) {
  search *p = context;
  (void)n;
  search_evaluate (p, u, gradient != NULL);
  search_gradient (p, 0, p->x->sign[0], gradient);
  if (!p->failed) return p->x->sign[0] * p->value[0];
  return isfinite (p->most) ? p->most + fmax (p->most - p->least, 0.1 * fabs (p->most)) : 0;
}

/* The constraints, in units of their bounds; 1 for a run that failed. */
static void search_excess (unsigned count, double *excess, unsigned n, const double *u, double *gradient,
                           void *context) {
  search *p = context;
  const pw_optimise *x = p->x;
  search_evaluate (p, u, gradient != NULL);
  for (unsigned i = 0; i < count; i++) {
    int output = 1 + (int)i;
    double bound = x->bound[output], factor = x->sign[output] / (bound != 0 ? fabs (bound) : 1);
    excess[i] = p->failed ? 1 : factor * (p->value[output] - bound);
    search_gradient (p, output, factor, gradient ? gradient + i * n : NULL);
  }
}

/* ---- Searches ---- */

/* Bounds and tolerances. */
static int search_open (search *p, double first, double last) {
  const pw_unknowns *k = &p->x->unknowns;
  int n = k->count, status = 1;
  nlopt_algorithm simple = n == 1 ? NLOPT_LN_SBPLX : NLOPT_LN_BOBYQA; /* BOBYQA needs two unknowns and no constraints */
  p->opt = nlopt_create (p->slope ? NLOPT_LD_SLSQP : p->x->outputs > 1 ? NLOPT_LN_COBYLA : simple, (unsigned)n);
  if (p->opt == NULL) return PW_RESOURCE;
  nlopt_set_min_objective (p->opt, search_objective, p);
  for (int i = 0; i < n; i++) {
    if (isfinite (k->list[i].low))
      status &= nlopt_set_lower_bound (p->opt, i, search_scaled (k->list + i, k->list[i].low)) > 0;
    if (isfinite (k->list[i].high))
      status &= nlopt_set_upper_bound (p->opt, i, search_scaled (k->list + i, k->list[i].high)) > 0;
  }
  status &= nlopt_add_inequality_mconstraint (p->opt, (unsigned)p->x->outputs - 1, search_excess, p, p->allowed) > 0;
  status &= nlopt_set_xtol_abs1 (p->opt, last) > 0;
  status &= nlopt_set_initial_step1 (p->opt, first) > 0;
  nlopt_set_maxeval (p->opt, 200 + 100 * n);
  return status ? PW_OK : PW_RESOURCE;
}

static void search_point (const pw_unknowns *k, const double *x, double *u) {
  for (int i = 0; i < k->count; i++) u[i] = search_scaled (k->list + i, x[i]);
}

/* Searches from u.  SLSQP may end early, where derivatives change much: it begins again at its result. */
static int search_repeat (search *p, double *u) {
  for (int left = p->slope ? SEARCH_REPEATS : 1; left > 0 && !p->failed && !p->refused && !pw_stop; left--) {
    double before = p->s->found ? p->s->value[0] : NAN, value;
    nlopt_result result = nlopt_optimize (p->opt, u, &value);
    if (result == NLOPT_OUT_OF_MEMORY) return PW_RESOURCE;
    p->s->converged = (result > 0 && result != NLOPT_MAXEVAL_REACHED) || result == NLOPT_ROUNDOFF_LIMITED;
    if (!p->s->found || fabs (p->s->value[0] - before) <= SEARCH_GAIN * fabs (before)) break;
    search_point (&p->x->unknowns, p->s->best, u);
  }
  return PW_OK;
}

static int search_from (search *p, int slopes, double first, double last) {
  const pw_unknowns *k = &p->x->unknowns;
  size_t n = (size_t)k->count, outputs = (size_t)p->x->outputs;
  double *memory = calloc (3 * n + 2 * outputs + n * outputs, sizeof *memory);
  int status = memory ? PW_OK : PW_RESOURCE;
  if (status == PW_OK) {
    p->u = memory, p->at = memory + n, p->value = memory + 2 * n, p->allowed = p->value + outputs;
    double *u = p->allowed + outputs;
    p->slope = slopes ? u + n : NULL;
    p->known = p->refused = 0;
    for (size_t i = 0; i < outputs; i++) p->allowed[i] = SEARCH_ALLOWED / 10;
    search_point (k, p->s->first, u);
    status = search_open (p, first, last);
    if (status == PW_OK) search_evaluate (p, u, slopes);
    if (status == PW_OK) status = search_repeat (p, u);
  }
  nlopt_destroy (p->opt);
  p->opt = NULL;
  free (memory);
  return status;
}

static int search_task (pw_optimise *x, int i, int slopes, double first, double last, pw_error *error) {
  search p = { .x = x, .s = x->start + i, .least = INFINITY, .most = -INFINITY };
  if (pw_stop) return PW_OK;
  int status = search_from (&p, slopes, first, last);
  if (status == PW_OK && p.refused) status = search_from (&p, 0, first, last);
  pthread_mutex_lock (&x->lock);
  pw_progress_at (&x->progress, ++x->done);
  pthread_mutex_unlock (&x->lock);
  return status == PW_OK ? PW_OK : pw_fail (error, status, "out of memory");
}

int pw_search_rough (void *context, int i, pw_error *error) {
  return search_task (context, i, 0, SEARCH_FIRST, SEARCH_ROUGH, error);
}

int pw_search_fine (void *context, int i, pw_error *error) {
  pw_optimise *x = context;
  int slopes = x->smooth && x->unknowns.count >= SEARCH_SLOPES;
  return search_task (x, x->starts + i, slopes, SEARCH_ROUGH, PW_SEARCH_FINE, error);
}
