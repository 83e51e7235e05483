/* Local searches of `pinwheel optimise`, by NLopt without derivatives. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <nlopt.h>
#include <stdlib.h>
#include <string.h>
#include "optimise_parts.h"

#define SEARCH_FIRST 0.1    /* first steps, relative to the scales of the unknowns */
#define SEARCH_ROUGH 1e-3   /* last ones */
#define SEARCH_ALLOWED 1e-6 /* violation of a constraint, relative to its bound */

/* ---- Runs ---- */

typedef struct {
  pw_optimise *x;
  pw_search_start *s;
  nlopt_opt opt;
  double *u, *at, *value; /* the last run: scaled unknowns, unknowns, outputs */
  int known, failed;
  double least, most; /* objectives of the runs that succeeded */
} search;

double pw_search_unknown (const pw_free_number *k, double u) {
  return fmin (fmax (k->given ? k->low + u * k->scale : u * k->scale, k->low), k->high);
}

static double search_scaled (const pw_free_number *k, double x) {
  return k->given ? (x - k->low) / k->scale : x / k->scale;
}

/* A status; outputs that are not finite count as failed. */
static int search_run (const search *p, pw_error *error) {
  const pw_unknowns *u = &p->x->unknowns;
  pw_outcomes o = { .system = NULL };
  pw_cli_model m;
  pw_settings settings;
  pw_limit limit;
  char number[32];
  int status = pw_unknowns_system (u, p->at, &m, &settings, &limit, error);
  if (status == PW_OK) status = pw_outcomes_open (&o, m.system, "output", p->x->text, p->x->outputs, error);
  settings.ledger = o.ledger;
  if (status == PW_OK) status = pw_outcomes_run (&o, u->method, &settings, u->t_end, error);
  for (int i = 0; status == PW_OK && i < p->x->outputs; i++) {
    p->value[i] = pw_outcome_value (&o, i, NULL);
    if (!isfinite (p->value[i]))
      status = pw_fail (error, PW_METHOD, "%s is %s", p->x->text[i], pw_format (number, p->value[i], 9));
  }
  pw_outcomes_close (&o);
  pw_cli_close_model (&m);
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
  if (s->runs == s->room) {
    long room = s->room ? 2 * s->room : 64;
    double *more = realloc (s->trial, (size_t)room * (size_t)width * sizeof *more);
    if (more == NULL) return PW_RESOURCE;
    s->trial = more;
    s->room = room;
  }
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
    char number[32];
    x->leading = value;
    snprintf (x->progress.note, sizeof x->progress.note, "best %s", pw_format (number, p->value[0], 7));
  }
  pw_progress_at (&x->progress, x->done);
  pthread_mutex_unlock (&x->lock);
}

/* The run at scaled unknowns, unless it is the last one. */
static void search_evaluate (search *p, const double *u) {
  pw_optimise *x = p->x;
  int n = x->unknowns.count;
  pw_error own = { 0 };
  if (p->known && memcmp (p->u, u, (size_t)n * sizeof *u) == 0) return;
  memcpy (p->u, u, (size_t)n * sizeof *u);
  for (int i = 0; i < n; i++) p->at[i] = pw_search_unknown (x->unknowns.at + i, u[i]);
  int status = search_run (p, &own);
  if (status == PW_RETRY || pw_stop) {
    nlopt_force_stop (p->opt);
    return;
  }
  p->known = 1;
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

static double search_objective (unsigned n, const double *u, double *gradient, void *context) {
  search *p = context;
  (void)n, (void)gradient;
  search_evaluate (p, u);
  if (!p->failed) return p->x->sign[0] * p->value[0];
  return isfinite (p->most) ? p->most + fmax (p->most - p->least, 0.1 * fabs (p->most)) : 0;
}

typedef struct {
  search *p;
  int output;
} search_constraint;

/* In units of the bound; 1 for a run that failed. */
static double search_excess (unsigned n, const double *u, double *gradient, void *context) {
  const search_constraint *c = context;
  const pw_optimise *x = c->p->x;
  double bound = x->bound[c->output];
  (void)n, (void)gradient;
  search_evaluate (c->p, u);
  if (c->p->failed) return 1;
  return x->sign[c->output] * (c->p->value[c->output] - bound) / (bound != 0 ? fabs (bound) : 1);
}

/* ---- Searches ---- */

/* Bounds and tolerances.  BOBYQA needs two unknowns and has no constraints. */
static int search_open (search *p, search_constraint *c, double first, double last) {
  const pw_unknowns *k = &p->x->unknowns;
  int n = k->count, status = 1;
  p->opt = nlopt_create (p->x->outputs > 1 ? NLOPT_LN_COBYLA : n == 1 ? NLOPT_LN_SBPLX : NLOPT_LN_BOBYQA, (unsigned)n);
  if (p->opt == NULL) return PW_RESOURCE;
  nlopt_set_min_objective (p->opt, search_objective, p);
  for (int i = 0; i < n; i++) {
    if (isfinite (k->at[i].low))
      status &= nlopt_set_lower_bound (p->opt, i, search_scaled (k->at + i, k->at[i].low)) > 0;
    if (isfinite (k->at[i].high))
      status &= nlopt_set_upper_bound (p->opt, i, search_scaled (k->at + i, k->at[i].high)) > 0;
  }
  for (int i = 1; i < p->x->outputs; i++) {
    c[i] = (search_constraint){ p, i };
    status &= nlopt_add_inequality_constraint (p->opt, search_excess, c + i, SEARCH_ALLOWED / 10) > 0;
  }
  nlopt_set_xtol_abs1 (p->opt, last);
  nlopt_set_initial_step1 (p->opt, first);
  nlopt_set_maxeval (p->opt, 200 + 100 * n);
  return status ? PW_OK : PW_RESOURCE;
}

static int search_from (search *p, double first, double last) {
  const pw_unknowns *k = &p->x->unknowns;
  size_t n = (size_t)k->count, outputs = (size_t)p->x->outputs;
  double *memory = calloc (3 * n + outputs, sizeof *memory), value;
  search_constraint *c = calloc (outputs, sizeof *c);
  int status = memory && c ? PW_OK : PW_RESOURCE;
  if (status == PW_OK) {
    p->u = memory, p->at = memory + n, p->value = memory + 2 * n;
    double *u = p->value + outputs;
    for (size_t i = 0; i < n; i++) u[i] = search_scaled (k->at + i, p->s->first[i]);
    status = search_open (p, c, first, last);
    if (status == PW_OK) search_evaluate (p, u);
    if (status == PW_OK && !p->failed && !pw_stop && nlopt_optimize (p->opt, u, &value) == NLOPT_OUT_OF_MEMORY)
      status = PW_RESOURCE;
  }
  nlopt_destroy (p->opt);
  free (memory);
  free (c);
  return status;
}

static void search_task (pw_optimise *x, int i, double first, double last) {
  search p = { .x = x, .s = x->start + i, .least = INFINITY, .most = -INFINITY };
  if (pw_stop) return;
  int status = search_from (&p, first, last);
  pthread_mutex_lock (&x->lock);
  if (status != PW_OK) pw_fail (&x->error, status, "out of memory");
  pw_progress_at (&x->progress, ++x->done);
  pthread_mutex_unlock (&x->lock);
}

void pw_search_rough (void *context, int i) {
  search_task (context, i, SEARCH_FIRST, SEARCH_ROUGH);
}

void pw_search_fine (void *context, int i) {
  pw_optimise *x = context;
  search_task (x, x->starts + i, SEARCH_ROUGH, PW_SEARCH_FINE);
}
