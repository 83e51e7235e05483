/* Derivatives of a motion: the variational equations, integrated with a run.
 *
 * With y = (q, v) and a number p, at constant time,
 *
 *     dq' = dv,   dv' = da,
 *     [ M J^T ; J 0 ] (da, dlambda) = ( (f_q - (J^T lambda)_q) dq + f_v dv, (gamma_q - (J a)_q) dq + gamma_v dv )
 *                                     + d/dp ( f - M a - J^T lambda, gamma - J a ),
 *
 * the first line by the exact blocks of the element types (linear_variation.c), the second, the effect of p, by
 * differences of the systems of neighbouring runs (pw_direction), at the state of this one (variation_effect.c).
 * Initial values of dq and dv are differences of the neighbours' consistent initial states.  Differences with two
 * steps of p give their extrapolation (Richardson) and its error.  The error of the result obeys the same equations,
 * with the error of the differences in place of the effect of p; after each step the error of the step is added.
 *
 * The derivatives are integrated with steps of their own, which end at samples and breakpoints, along the states that
 * the run has reached by any method.  These steps are explicit (variation_explicit.c), or implicit if the motion is
 * stiff (variation_implicit.c).  The steps of a run with a fixed step are usually much smaller, and a linearisation
 * costs about 6 evaluations of the accelerations.  The result is therefore the derivative of the exact motion, to 1e-10
 * or the accuracy of the run's states; the derivative of the run's discretisation error is no part of it.
 *
 * After each step dq and dv are projected onto the tangent of the constraints,
 *
 *     G dq + dg/dp = 0,   J dv + ((J v)_q - eta_q) dq + d (J v - eta)/dp = 0,
 *
 * in the metric of the mass matrix. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "util.h"
#include "variation_parts.h"

/* How far the run is ahead of the derivatives where accelerations may jump, in units of the scene: those of neighbours
 * may jump earlier than the run's.  Several times the largest such difference. */
static const double VARIATION_AHEAD = 1e-4;
static const double VARIATION_FIRST_STEP = 1e-3; /* of the derivatives, in units of the scene */

/* ---- Opening ---- */

static int variation_open_arrays (pw_variation *x) {
  size_t n = (size_t)x->n, m = (size_t)x->m, entries = (size_t)x->r->s->entries, size = (size_t)x->size;
  size_t all = 3 * n + 4 * m + entries + 9, sample = 3 * n + m + entries;
  const pw_array array[] = { { &x->q, n + 3 },
                             { &x->v, n + 3 },
                             { &x->scratch, all },
                             { &x->values, 2 * all },
                             { &x->output, all },
                             { &x->sample[0], sample },
                             { &x->sample[1], sample },
                             { &x->a[0], PW_VARIATION_RATES * n },
                             { &x->element_energy, 2 * (size_t)x->elements },
                             { &x->motion_error, n },
                             { &x->motion_defect, n },
                             { &x->hold[0].state, 2 * n },
                             { &x->hold[1].state, 2 * n } };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  for (int k = 1; x->memory && k < PW_VARIATION_RATES; k++) x->a[k] = x->a[k - 1] + n;
  for (int i = 0; x->memory && i < x->count; i++) {
    pw_direction_copy *d = &x->direction[i];
    pw_array own[2 + 2 * (4 + PW_VARIATION_RATES)], *a = own;
    *a++ = (pw_array){ &d->local_error, size };
    *a++ = (pw_array){ &d->terms, n + 3 * m };
    for (int c = 0; c < 2; c++) {
      pw_variation_column *k = &d->column[c];
      *k = (pw_variation_column){ .direction = d };
      *a++ = (pw_array){ &d->effect[c], n + 3 * m };
      *a++ = (pw_array){ &k->Y, size };
      *a++ = (pw_array){ &k->trial, size };
      *a++ = (pw_array){ &k->lambda, m };
      for (int j = 0; j < PW_VARIATION_RATES; j++) *a++ = (pw_array){ &k->K[j], size };
    }
    d->memory = pw_alloc_arrays (own, (size_t)(a - own));
    if (d->memory == NULL) return PW_RESOURCE;
  }
  return x->memory ? PW_OK : PW_RESOURCE;
}

/* Neighbours must have the run's numbers of bodies, elements and (redundant) constraint equations. */
static int variation_check_neighbours (const pw_variation *x, const pw_direction *d, int i, pw_error *error) {
  const pw_system *s = x->r->s;
  if (d->initial) return PW_OK;
  if (x->r->statistics.steps > 0 || x->r->t != x->r->settings.t)
    return pw_fail (error, PW_INPUT, "direction %d: neighbours need a run that has not advanced; it is at t = %g s",
                    i + 1, x->r->t);
  for (int k = 0; k < PW_VARIATION_NEIGHBOURS; k++) {
    const pw_system *other = d->neighbour[k] ? d->neighbour[k]->s : NULL;
    if (other == NULL || d->step == 0 || !isfinite (d->step))
      return pw_fail (error, PW_INPUT, "direction %d: expected neighbours and a step that is not 0, or `initial`",
                      i + 1);
    if (other->coords != s->coords || other->rows != s->rows || other->holonomic != s->holonomic ||
        other->entries != s->entries || other->batches != s->batches || d->neighbour[k]->redundant != x->r->redundant)
      return pw_fail (error, PW_INPUT, "direction %d: the number of bodies, elements or equations changes", i + 1);
  }
  return PW_OK;
}

/* 1 if signals of a batch differ, or may: tables and functions are not compared. */
static int variation_signals_differ (const pw_element_batch *a, const pw_element_batch *b) {
  for (int i = 0; i < a->b.count * a->kind->signals; i++) {
    const pw_signal *one = &a->source[i].signal, *other = &b->source[i].signal;
    if (one->type == PW_FUNCTION || one->type == PW_TABLE || memcmp (one, other, sizeof *one) != 0) return 1;
  }
  return 0;
}

/* Finds what differs in the neighbours.  PW_OK, PW_RESOURCE; PW_INPUT if types or numbers of elements differ. */
static int variation_find_changes (const pw_variation *x, pw_direction_copy *d) {
  const pw_system *s = x->r->s;
  size_t bytes = (size_t)s->coords * sizeof (double);
  d->changes = calloc ((size_t)s->batches + 1, 1);
  if (d->changes == NULL) return PW_RESOURCE;
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS && d->given.initial == NULL; i++) {
    const pw_system *other = d->given.neighbour[i]->s;
    for (int k = 0; k < s->batches; k++) {
      const pw_element_batch *a = &s->batch[k], *b = &other->batch[k];
      if (a->kind != b->kind || a->b.count != b->b.count) return PW_INPUT;
      int signals = variation_signals_differ (a, b);
      d->changes[k] |= signals || memcmp (a->b.element, b->b.element, (size_t)a->b.count * a->kind->element) != 0;
      d->signals |= signals;
    }
    d->changes[s->batches] |=
        memcmp (s->mass, other->mass, bytes) != 0 || memcmp (s->constant, other->constant, bytes) != 0;
  }
  return PW_OK;
}

/* Adds the round-off of differences of initial states, 4 eps |weight value| each, to their error; sets d->start. */
static void variation_add_round_off (const pw_variation *x, pw_direction_copy *d) {
  const pw_run *near = d->given.neighbour[1], *r = x->r;
  const double relative = 4 * DBL_EPSILON * fabs (pw_direction_weight (&d->given, 0, 1)), *Y = d->column[0].trial;
  double *error = d->column[1].trial;
  for (int j = 0; j < 2 * x->n; j++) {
    int i = j % x->n;
    double weight = (j < x->n ? 1 : r->w->scale.time) / pw_unit (r->s, i), value = j < x->n ? near->q[i] : near->v[i],
           round = value != (j < x->n ? r->q[i] : r->v[i]) ? relative * fabs (value) : 0;
    error[j] += copysign (round, error[j]);
    d->start.all += weight * fabs (Y[j]), d->start.error += weight * fabs (error[j]), d->start.round += weight * round;
  }
  d->start.all = fmax (d->start.all, pw_variation_least_effect (d));
}

/* The initial derivatives, into `trial`. */
static int variation_start (pw_variation *x, pw_direction_copy *d, const pw_direction *given, pw_error *error) {
  int n = x->n;
  d->given = *given;
  d->columns = given->no_error ? 1 : 2;
  int status = variation_find_changes (x, d);
  if (status == PW_INPUT)
    return pw_fail (error, PW_INPUT, "direction %d: the elements change", (int)(d - x->direction) + 1);
  if (status != PW_OK) return pw_fail_memory (x->r->s, error);
  for (int c = 0; c < d->columns; c++) {
    double *Y = d->column[c].trial;
    if (given->initial && c == 0) memcpy (Y, given->initial, 2 * (size_t)n * sizeof *Y);
    for (int i = 0; i < PW_VARIATION_NEIGHBOURS && given->initial == NULL; i++) {
      const pw_run *r = given->neighbour[i];
      double weight = pw_direction_weight (given, c, i);
      for (int j = 0; j < n; j++) Y[j] += weight * (r->q[j] - x->r->q[j]), Y[n + j] += weight * (r->v[j] - x->r->v[j]);
    }
  }
  if (d->columns > 1 && given->initial == NULL) variation_add_round_off (x, d);
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS; i++) d->breakpoint[i] = x->t;
  return pw_variation_look_ahead (x, d, x->r->breakpoint, error);
}

/* Records the states of the run in its last step, from time t0; at first, its initial state.  A step across a jump is
 * not refined: samples in it, each computed by a Runge-Kutta step of its own, are not continuous in time and might seem
 * to cross the jump several times.  If it fails, or the run is stopped, the step remains to be recorded. */
static int variation_record (pw_variation *x, double t0, pw_error *error) {
  int last = x->points - 1, points, jumps = last < 0 ? 0 : x->point[last].jumps;
  x->begun = t0;
  int status = pw_variation_append (x, last < 0 ? t0 : x->r->t, error);
  points = x->points;
  if (status == PW_OK && last >= 0) status = pw_variation_find_jumps (x, last, error);
  int smooth = status == PW_OK && last >= 0 && x->points == points && !x->point[last].jumps;
  if (smooth) status = pw_variation_refine (x, last, error);
  if (smooth && status == PW_OK && x->points > points) status = pw_variation_find_jumps (x, last, error);
  if (status != PW_OK) x->points = last + 1;
  if (status != PW_OK && last >= 0) x->point[last].jumps = jumps;
  return status;
}

/* The smallest change of a velocity over which a force reverses, at most 1, in units of the scene. */
static double variation_reversal (pw_run *r) {
  char element[PW_NAME_BYTES];
  double least;
  int state = pw_run_saturation (r, &least, element, sizeof element); /* a velocity */
  return state < 0 ? 1 : fmin (1, least * r->w->scale.time / pw_unit (r->s, state - r->s->coords));
}

static int variation_open (pw_variation *x, const pw_direction *d, pw_error *error) {
  pw_run *r = x->r;
  if (pw_run_option (r, "inputs") != 0)
    return pw_fail (error, PW_INPUT, "derivatives need inputs=stage: held inputs depend on the steps");
  for (int i = 0; i < x->count; i++)
    if (variation_check_neighbours (x, &d[i], i, error) != PW_OK) return PW_INPUT;
  int status = pw_run_check_derivatives (r, "derivatives", "need", error);
  if (status != PW_OK) return status;
  x->reversal = variation_reversal (r);
  x->direction = calloc ((size_t)x->count + 1, sizeof *x->direction);
  const pw_linear_extent extent = x->n > PW_VARIATION_DENSE ? PW_LINEAR_DERIVATIVES : PW_LINEAR_BASES;
  if (x->direction == NULL || variation_open_arrays (x) != PW_OK || pw_linear_open (&x->linear, r, extent) != PW_OK)
    return pw_fail_memory (r->s, error);
  status = variation_record (x, x->t, error);
  for (int i = 0; i < x->count && status == PW_OK; i++) status = variation_start (x, &x->direction[i], &d[i], error);
  if (status != PW_OK) return status;
  memcpy (x->q, r->q, (size_t)x->n * sizeof *x->q);
  memcpy (x->v, r->v, (size_t)x->n * sizeof *x->v);
  status = pw_variation_evaluate (x, x->t, error);
  return status == PW_OK ? pw_variation_restart (x, error) : status;
}

pw_variation *pw_variation_open (pw_run *r, const pw_direction *d, int count, int ledger, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK || pw_require (d, "directions", error) != PW_OK) return NULL;
  pw_variation *x = calloc (1, sizeof *x);
  if (x == NULL) {
    pw_fail_memory (r->s, error);
    return NULL;
  }
  const pw_system *s = r->s;
  *x = (pw_variation){ .r = r, .n = s->coords, .m = s->rows, .entries = s->entries, .count = count, .ledger = ledger };
  x->size = 2 * x->n + (ledger ? x->entries : 0);
  for (int i = 0; i < s->batches; i++) x->elements += s->batch[i].b.count;
  x->t = r->t, x->h = VARIATION_FIRST_STEP * r->w->scale.time;
  x->passed = x->hold[0].to = x->hold[1].to = -INFINITY;
  x->may_jump = pw_system_may_jump (s);
  if (pw_run_annotate_error (r, variation_open (x, d, error), error) == PW_OK) return x;
  pw_variation_close (x);
  return NULL;
}

void pw_variation_close (pw_variation *x) {
  if (x == NULL) return;
  for (int i = 0; x->direction && i < x->count; i++) {
    free (x->direction[i].memory);
    free (x->direction[i].changes);
  }
  for (int i = 0; i < x->room; i++) free (x->point[i].x);
  pw_linear_close (&x->linear);
  pw_variation_implicit_close (x->implicit);
  free (x->point);
  free (x->direction);
  free (x->memory);
  free (x);
}

double pw_variation_step_size (const pw_variation *x) {
  return x->h;
}

/* ---- Advancing ---- */

/* Advances the run until its states reach time `to`, a breakpoint, or are too many. */
static int variation_advance_run (pw_variation *x, double to, double t_end, pw_error *error) {
  pw_run *r = x->r;
  int status = x->point[x->points - 1].t < r->t ? variation_record (x, x->begun, error) : PW_OK;
  while (status == PW_OK && r->t < to && x->points < PW_VARIATION_POINTS && (r->t < r->breakpoint || r->t == x->t)) {
    double t0 = x->begun = r->t;
    status = pw_run_advance (r, t_end, error);
    if (status == PW_OK && r->t > t0) status = variation_record (x, t0, error);
  }
  return status;
}

/* The time that the run must reach before the next step of the derivatives. */
static double variation_run_time (const pw_variation *x, double t, double t_end) {
  double ahead = x->may_jump ? VARIATION_AHEAD * x->r->w->scale.time : 0;
  return fmin (fmin (t, x->t + x->h) + ahead, t_end);
}

/* 1 if the time reached is a breakpoint that the derivatives have not passed. */
static int variation_before_breakpoint (const pw_variation *x) {
  return x->t == x->r->breakpoint && x->passed < x->t;
}

int pw_variation_advance (pw_variation *x, double t, double t_end, pw_error *error) {
  if (pw_require (x, "a variation", error) != PW_OK) return PW_INPUT;
  if (isnan (t)) return pw_fail (error, PW_INPUT, "t = nan: expected a time");
  pw_run *r = x->r;
  int status = PW_OK;
  r->stopped = 0;
  while (status == PW_OK && x->t < fmin (t, t_end)) {
    if (x->t == pw_variation_recorded_jump (x))
      status = pw_variation_pass_jump (x, error);
    else if (variation_before_breakpoint (x))
      status = pw_variation_pass_breakpoint (x, error);
    else {
      status = variation_advance_run (x, variation_run_time (x, t, t_end), t_end, error);
      if (status == PW_OK && pw_run_stop_requested (r)) return PW_STOPPED;
      double to = fmin (fmin (t, r->breakpoint), pw_variation_recorded_jump (x));
      if (status == PW_OK) status = pw_variation_approach_jump (x, error);
      if (status == PW_OK) status = pw_variation_step (x, to, error);
    }
    pw_variation_discard_points (x);
  }
  return pw_run_annotate_error (r, status, error);
}

double pw_variation_next_jump (pw_variation *x, double t, double t_end, pw_error *error) {
  if (pw_require (x, "a variation", error) != PW_OK) return NAN;
  int status = x->may_jump ? variation_advance_run (x, t, t_end, error) : PW_OK;
  double jump = pw_variation_recorded_jump (x);
  for (int i = 0; i + 1 < x->points && status == PW_OK; i++)
    if (x->point[i].jumps && x->point[i].t == jump) return x->point[i + 1].t;
  return status == PW_OK ? INFINITY : NAN;
}

double pw_variation_jump_slope (const pw_variation *x, int i) {
  return x->direction[i].column[0].slope;
}

/* ---- Samples ---- */

/* Column c as a sample, as pw_variation_sample; zeros if there is none. */
static int variation_column_sample (pw_variation *x, const pw_direction_copy *d, int c, pw_sample *sample) {
  int n = x->n, m = x->m, entries = x->entries;
  const pw_variation_column *from = &d->column[c];
  double *out = x->sample[c], *ledger = out + 3 * n + m;
  memset (out, 0, (size_t)(3 * n + m + entries) * sizeof *out);
  *sample = (pw_sample){ .t = x->t, .q = out, .v = out + n, .a = out + 2 * n, .lambda = out + 3 * n, .ledger = ledger };
  if (c >= d->columns) return PW_OK;
  if (pw_variation_outputs (x, from, from->Y, x->output) != PW_OK) return PW_METHOD;
  memcpy (out, from->Y, 2 * (size_t)n * sizeof *out);
  memcpy (out + 2 * n, from->K[0] + n, (size_t)n * sizeof *out);
  memcpy (out + 3 * n, x->output + 2 + entries, (size_t)m * sizeof *out);
  sample->kinetic = x->output[0], sample->potential = x->output[1];
  for (int i = 0; i < entries; i++) {
    ledger[i] = x->ledger ? from->Y[2 * n + i] : NAN;
    *(x->r->s->entry[i].type == PW_WORK ? &sample->work : &sample->loss) += ledger[i];
  }
  return PW_OK;
}

int pw_variation_sample (pw_variation *x, int i, pw_sample *derivative, pw_sample *error_of, pw_error *error) {
  if (pw_require (x, "a variation", error) != PW_OK) return PW_INPUT;
  if (i < 0 || i >= x->count) return pw_fail (error, PW_INPUT, "direction i = %d: expected 0 to %d", i, x->count - 1);
  /* the run's samples at a breakpoint are those after it */
  int status = variation_before_breakpoint (x) ? pw_variation_pass_breakpoint (x, error) : PW_OK;
  if (status != PW_OK) return pw_run_annotate_error (x->r, status, error);
  status = variation_column_sample (x, &x->direction[i], 0, derivative);
  if (status == PW_OK && error_of) status = variation_column_sample (x, &x->direction[i], 1, error_of);
  (void)pw_evaluate_J_at (x->r->w, x->at, x->q, x->v);
  return pw_run_annotate_error (x->r, status == PW_OK ? PW_OK : pw_fail_signal (x->t, error), error);
}
