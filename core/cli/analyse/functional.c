/* Functionals of columns, evaluated along a run.
 *
 * Integrals are entries of the run's ledger.  That of work or a loss W with the rate P, from the time t0 on, is
 * (t - t0) W - integral of (t - t0) P.
 *
 * For extrema each step is sampled at its middle and end.  With its beginning, a column has the values x0, xm and x1;
 * where its bend |x0 - 2 xm + x1| is below |x1 - x0| / 5, the parabola through them is monotonic: the extremum is at an
 * end.  Otherwise, if it may be beyond the extremum so far, the step is sampled at 5 times between and beside its ends:
 * values jump at breakpoints, where steps end, so that a step before a jump is always sampled so.  The largest or least
 * value is refined by Brent's method between its neighbours. */
#include <gsl/gsl_errno.h>
#include <gsl/gsl_min.h>
#include <math.h>
#include "cli.h"
#include "outcome.h"

#define FUNCTIONAL_LINEAR 0.2 /* largest bend of a column that counts as monotonic, relative to |x1 - x0| */
#define FUNCTIONAL_INSET 1e-6 /* distance from the ends of a step of the times beside them, relative to its size */
/* Brent's method ends when its interval has shrunk by this factor: nearer to the extremum, the column changes by less
 * than round-off. */
#define FUNCTIONAL_WIDTH 1e-8
enum {
  FUNCTIONAL_MIDDLE = 4,                    /* index of the time in the middle of a step, see functional_times */
  FUNCTIONAL_END = PW_FUNCTIONAL_TIMES - 1, /* and at its end */
  FUNCTIONAL_OTHER = PW_FUNCTIONAL_TIMES,   /* index of any other time */
  FUNCTIONAL_ITERATIONS = 60                /* of Brent's method, at most; golden sections alone would need 39 */
};

/* A step of a run. */
typedef struct {
  pw_outcomes *set;
  pw_run *run;
  double t0, t1; /* its beginning and end [s] */
  int status;
  pw_error *error;
} functional_step;

/* ---- Values ---- */

/* Stores the columns in a sample as values[at] of their functionals. */
static int functional_read (pw_outcomes *set, const pw_sample *s, int at, pw_error *error) {
  int contacts = 0, status = PW_OK;
  for (int i = 0; i < set->functionals; i++) contacts |= set->functional[i].column.type == PW_COLUMN_CONTACT;
  if (contacts) status = pw_workspace_contact_points (set->workspace, s->t, s->q, s->v, set->contact, error);
  for (pw_functional *f = set->functional; f < set->functional + set->functionals && status == PW_OK; f++) {
    const pw_column c = f->column;
    f->values[at] =
        c.type == PW_COLUMN_CONTACT ? set->contact[c.index / 2][c.index % 2] : pw_column_value (set->system, c, s);
  }
  return status;
}

/* Stores the columns at t, a time in the step, as values[at], unless that or an earlier sample fails. */
static void functional_sample (functional_step *step, double t, int at) {
  pw_sample s;
  if (step->status == PW_OK) step->status = pw_run_sample (step->run, t, &s, step->error);
  if (step->status == PW_OK) step->status = functional_read (step->set, &s, at, step->error);
}

/* The column of a functional at time t in the step; NaN if that fails. */
static double functional_at (functional_step *step, const pw_functional *f, double t) {
  functional_sample (step, t, FUNCTIONAL_OTHER);
  return step->status == PW_OK ? f->values[FUNCTIONAL_OTHER] : NAN;
}

/* ---- Integrals ---- */

/* pw_settings.integrand, NaN where contact points cannot be evaluated. */
static void functional_integrands (void *context, const pw_sample *s, double *value) {
  pw_outcomes *set = context;
  const int status = functional_read (set, s, FUNCTIONAL_OTHER, NULL);
  for (const pw_functional *f = set->functional; f < set->functional + set->functionals; f++) {
    double x = status == PW_OK ? f->values[FUNCTIONAL_OTHER] : NAN;
    if (!pw_is_integral (f->type)) continue;
    *value++ = f->type == PW_RMS ? x * x : pw_column_is_integrated (f->column.type) ? (s->t - set->begin) * x : x;
  }
}

/* The value of a functional at the end of the run, where columns are their values[FUNCTIONAL_END]; integral: of its
 * integrand, over the span [s]. */
static double functional_of_integral (const pw_functional *f, double integral, double span) {
  if (pw_column_is_integrated (f->column.type)) integral = span * f->values[FUNCTIONAL_END] - integral;
  if (f->type == PW_INTEGRAL) return integral;
  return f->type == PW_MEAN ? integral / span : sqrt (fmax (integral / span, 0));
}

/* ---- Extrema ---- */

/* Keeps a value if it is beyond the extremum so far. */
static void functional_update_extremum (pw_functional *f, double t, double value) {
  if (f->type == PW_MAX ? value > f->value : value < f->value) f->value = value, f->t = t;
}

typedef struct {
  functional_step *step;
  const pw_functional *f;
  double origin; /* of GSL's times [s]: their tolerance is relative, and t may be large */
} functional_search;

/* What is minimised at a time after the origin: the column, or for a maximum its negative. */
static double functional_signed (double after, void *context) {
  functional_search *search = context;
  double value = functional_at (search->step, search->f, search->origin + after);
  return search->f->type == PW_MAX ? -value : value;
}

/* Refines an extremum that lies between the first and the last of three times; value: what is minimised, at each of
 * them, the least at the second one. */
static void functional_refine (functional_step *step, pw_functional *f, const double t[3], const double value[3]) {
  functional_search search = { step, f, t[1] };
  gsl_function minimised = { functional_signed, &search };
  gsl_min_fminimizer *m = gsl_min_fminimizer_alloc (gsl_min_fminimizer_brent);
  if (m == NULL) {
    step->status = pw_fail (step->error, PW_RESOURCE, "out of memory");
    return;
  }
  int status =
      gsl_min_fminimizer_set_with_values (m, &minimised, 0, value[1], t[0] - t[1], value[0], t[2] - t[1], value[2]);
  for (int i = 0; i < FUNCTIONAL_ITERATIONS && status == GSL_SUCCESS; i++) {
    status = gsl_min_fminimizer_iterate (m);
    if (gsl_min_fminimizer_x_upper (m) - gsl_min_fminimizer_x_lower (m) < FUNCTIONAL_WIDTH * (t[2] - t[0])) break;
  }
  double least = gsl_min_fminimizer_f_minimum (m);
  if (step->status == PW_OK)
    functional_update_extremum (f, t[1] + gsl_min_fminimizer_x_minimum (m), f->type == PW_MAX ? -least : least);
  gsl_min_fminimizer_free (m);
}

/* The extremum over the step from values at all of its times.  It is refined if it is inside the step and may be beyond
 * the extremum so far: by assumption it is beyond these values by their range at most. */
static void functional_extremum (functional_step *step, pw_functional *f, const double *t, const double *value) {
  double y[PW_FUNCTIONAL_TIMES], range = 0;
  int best = 0;
  for (int i = 0; i < PW_FUNCTIONAL_TIMES; i++) {
    y[i] = f->type == PW_MAX ? -value[i] : value[i];
    if (y[i] < y[best]) best = i;
  }
  for (int i = 0; i < PW_FUNCTIONAL_TIMES; i++) range = fmax (range, y[i] - y[best]);
  int inside = best > 0 && best < FUNCTIONAL_END && y[best] < y[best - 1] && y[best] < y[best + 1];
  int may_lead = y[best] - range < (f->type == PW_MAX ? -f->value : f->value);
  functional_update_extremum (f, t[best], value[best]);
  if (inside && may_lead) functional_refine (step, f, t + best - 1, y + best - 1);
}

/* Times in a step: its beginning, just after it, five times between, just before the end, the end. */
static void functional_times (const functional_step *step, double t[PW_FUNCTIONAL_TIMES]) {
  static const double part[PW_FUNCTIONAL_TIMES] = { 0,     FUNCTIONAL_INSET,     0.047, 0.231, 0.5, 0.769,
                                                    0.953, 1 - FUNCTIONAL_INSET, 1 };
  for (int i = 0; i < FUNCTIONAL_END; i++) t[i] = step->t0 + part[i] * (step->t1 - step->t0);
  t[FUNCTIONAL_END] = step->t1;
}

/* 1 if the values at the ends and in the middle do not suffice: the column is not nearly linear, and in the step may be
 * beyond the extremum so far. */
static int functional_needs_nodes (const pw_functional *f) {
  double x0 = f->values[0], xm = f->values[FUNCTIONAL_MIDDLE], x1 = f->values[FUNCTIONAL_END],
         bend = fabs (x0 - 2 * xm + x1),
         lead = f->type == PW_MAX ? fmax (x0, fmax (xm, x1)) - f->value : f->value - fmin (x0, fmin (xm, x1));
  return pw_is_extremum (f->type) && bend > FUNCTIONAL_LINEAR * fabs (x1 - x0) && lead + bend + fabs (x1 - x0) > 0;
}

/* Updates the extrema after a step. */
static void functional_extrema (functional_step *step) {
  double t[PW_FUNCTIONAL_TIMES];
  int nodes = pw_system_jumps (step->set->system, step->t1);
  pw_functional *const begin = step->set->functional, *const end = begin + step->set->functionals;
  functional_times (step, t);
  functional_sample (step, t[FUNCTIONAL_MIDDLE], FUNCTIONAL_MIDDLE);
  functional_sample (step, step->t1, FUNCTIONAL_END);
  for (const pw_functional *f = begin; f < end; f++) nodes |= functional_needs_nodes (f);
  for (int i = 1; nodes && i < FUNCTIONAL_END; i++)
    if (i != FUNCTIONAL_MIDDLE) functional_sample (step, t[i], i);
  for (pw_functional *f = begin; f < end && step->status == PW_OK; f++) {
    if (pw_is_extremum (f->type) && nodes) functional_extremum (step, f, t, f->values);
    if (pw_is_extremum (f->type) && !nodes) functional_update_extremum (f, step->t1, f->values[FUNCTIONAL_END]);
    f->values[0] = f->values[FUNCTIONAL_END];
  }
}

/* ---- Along the run ---- */

static void functional_begin (functional_step *step) {
  functional_sample (step, step->t1, 0);
  for (pw_functional *f = step->set->functional; f < step->set->functional + step->set->functionals; f++)
    f->value = f->values[0], f->t = step->t1;
}

/* Fills a row of the table, at a time in the last step. */
static void functional_row (functional_step *step, const pw_outcome_table *table, int row) {
  pw_outcomes *set = step->set;
  functional_sample (step, table->t[row], FUNCTIONAL_OTHER);
  for (pw_functional *f = set->functional; f < set->functional + set->functionals; f++)
    if (f->type == PW_FINAL) f->value = f->values[FUNCTIONAL_OTHER];
  for (int o = 0; o < set->outcomes; o++)
    table->value[o * table->rows + row] = pw_outcome_is_final (set, o) ? pw_outcome_value (set, o) : NAN;
}

static void functional_end (functional_step *step) {
  pw_outcomes *set = step->set;
  pw_sample s = { .t = step->t1 };
  if (step->status == PW_OK) step->status = pw_run_sample (step->run, step->t1, &s, step->error);
  if (step->status == PW_OK) step->status = functional_read (set, &s, FUNCTIONAL_END, step->error);
  for (pw_functional *f = set->functional; f < set->functional + set->functionals && step->status == PW_OK; f++) {
    if (pw_is_integral (f->type)) f->value = functional_of_integral (f, *s.integral++, step->t1 - set->begin);
    if (f->type == PW_FINAL) f->value = f->values[FUNCTIONAL_END];
  }
}

int pw_outcomes_run (pw_outcomes *set, const char *method, const pw_settings *settings, double t_end,
                     const pw_outcome_table *table, pw_error *error) {
  pw_settings own = *settings;
  own.ledger |= set->ledger;
  own.integrals = set->integrals, own.integrand = functional_integrands, own.integrand_context = set;
  set->begin = own.t;
  pw_run *r = pw_limit_open (set->system, method, &own, error);
  if (r == NULL) return error->status;
  functional_step step = { set, r, own.t, own.t, PW_OK, error };
  functional_begin (&step);
  for (int row = 0, rows = table ? table->rows : 0; step.status == PW_OK;) {
    for (; row < rows && table->t[row] <= step.t1 && step.status == PW_OK; row++) functional_row (&step, table, row);
    if (step.status != PW_OK || !(step.t1 < t_end)) break;
    step.status = set->extrema ? pw_run_advance (r, t_end, error)
                               : pw_run_advance_to (r, row < rows ? table->t[row] : t_end, t_end, error);
    step.t0 = step.t1, step.t1 = pw_run_time (r);
    if (step.status == PW_OK && set->extrema) functional_extrema (&step);
  }
  functional_end (&step);
  if (step.status == PW_STOPPED) step.status = pw_limit_status (settings->stop_context, step.t1, error);
  pw_run_close (r);
  return step.status;
}
