/* The motion over one period, with its derivatives with respect to the initial state; signals and their period. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "periodic_parts.h"

enum {
  FLOW_MULTIPLES = 24, /* of the longer period that are tried as a common period */
  FLOW_PERIODS = 3,    /* during which signals are compared with those one period later */
  FLOW_TIMES = 20,     /* scales of time T during which signals must be constant if the period is free */
  /* Largest ratio of the steps of a trial of Newton's method to those of the iterate before it: a trial far away, with
   * enormous velocities, would take millions. */
  FLOW_STEPS = 20,
  RETURN_SAMPLES = 20000, /* during which a run must return */
  RETURN_STEPS = 20       /* samples per scale of time T */
};
static const double FLOW_SETTLE_RTOL = 1e-9, /* of the run that settles */
    FLOW_FAR = 4,                            /* largest ratio of a free period to the last one known, or the reverse */
    RETURN_NEAR = 0.2,   /* distance of a return from the first state, relative to the largest one on the way */
    RETURN_MOVED = 1e-6; /* least distance that counts as motion, in units of the scene */

/* Least relative tolerances.  Derivatives, of which differences of runs have two thirds of the digits, need fewer than
 * states: Newton's method converges all the same. */
static const double flow_min_rtol[] = { [PW_FLOW] = 0, [PW_FLOW_DERIVATIVES] = 1e-10, [PW_FLOW_MULTIPLIERS] = 1e-12 };

/* ---- The period of signals ---- */

/* The period of a signal [s]; 0: none, or not known. */
static double signal_period (const pw_signal *s) {
  switch (s->type) {
  case PW_HARMONIC:
    return s->harmonic.amplitude != 0 && s->harmonic.omega != 0 ? 2 * PW_PI / fabs (s->harmonic.omega) : 0;
  case PW_PULSE:
    return s->pulse.height != 0 ? s->pulse.period : 0;
  case PW_CONSTANT:
  case PW_FUNCTION:
  case PW_RAMP:
  case PW_SMOOTH_STEP:
  case PW_TABLE:
    break;
  }
  return 0;
}

/* The least common multiple of two periods, where 0 stands for none; NaN if it is not found. */
static double common_period (double a, double b) {
  if (a == 0 || b == 0 || isnan (a)) return a + b;
  for (double i = 1, longer = fmax (a, b), ratio = longer / fmin (a, b); i <= FLOW_MULTIPLES; i++)
    if (fabs (i * ratio - round (i * ratio)) < 1e-9 * i) return i * longer;
  return NAN;
}

double pw_system_period (const pw_system *s) {
  double period = 0;
  for (int k = 0; k < s->batches; k++)
    for (int i = 0; i < s->batch[k].b.count * s->batch[k].kind->signals; i++)
      period = common_period (period, signal_period (&s->batch[k].source[i].signal));
  return period;
}

/* Sets x->system.period: of the settings, else of the signals times settings.periods, else of the last motion; verifies
 * that signals repeat after it.  If the period is free, sets it to a time during which signals are constant. */
static int flow_signals (pw_periodic *x, pw_run *r) {
  double own_period = pw_system_period (r->s), period = x->settings.period;
  int changed, status;
  if (x->settings.free) period = fmax (period, FLOW_TIMES * x->T);
  if (period <= 0) period = own_period == 0 ? x->last_period : x->settings.periods * own_period;
  if (!(period > 0))
    return pw_fail (&x->why, PW_INPUT,
                    isnan (own_period)
                        ? "model %s: the periods of its signals have no common multiple: a period is needed"
                        : "model %s: no signal has a known period: a period is needed",
                    x->s->model);
  status = x->settings.free ? pw_signals_change (r, x->settings.t, 0, period, &changed, &x->why)
                            : pw_signals_change (r, x->settings.t, period, FLOW_PERIODS * period, &changed, &x->why);
  if (status != PW_OK) return status;
  if (changed < 0) return x->system.period = period, PW_OK;
  const char *name = PW_NAME (pw_system_signal_name, r->s, changed);
  if (x->settings.free)
    return pw_fail (&x->why, PW_INPUT, "model %s: signal %s changes with time, so the period cannot be free",
                    x->s->model, name);
  return pw_fail (&x->why, PW_INPUT, "model %s: signal %s does not repeat after %.12g s%s", x->s->model, name, period,
                  x->settings.period > 0 ? "; if no period is given, that of the harmonic signals and pulses is used"
                                         : "");
}

/* ---- Runs ---- */

const pw_system *pw_periodic_system (pw_periodic *x, double value) {
  if (x->settings.compile == NULL) return x->s;
  if (x->system.own == NULL || x->system.value != value) {
    pw_system_free (x->system.own);
    x->system.value = value, x->system.period = 0;
    x->system.own = pw_compile_at (x->settings.compile, x->settings.context, value, &x->why);
  }
  const pw_system *s = x->system.own;
  return s && pw_steady_same_sizes (x->s, s, &x->why) == PW_OK ? s : NULL;
}

pw_run *pw_periodic_run (pw_periodic *x, double value, double rtol, const double *y) {
  const pw_settings settings = { .t = x->settings.t,
                                 .span = x->settings.period > 0 ? x->settings.period : x->T,
                                 .rtol = rtol,
                                 .stop = x->settings.stop,
                                 .stop_context = x->settings.stop_context };
  x->why = (pw_error){ 0 };
  const pw_system *s = pw_periodic_system (x, value);
  pw_run *r = s ? pw_run_open (s, x->settings.method, &settings, &x->why) : NULL;
  int status = r ? PW_OK : x->why.status;
  if (status == PW_STOPPED) x->why = (pw_error){ PW_METHOD, "stopped" };
  if (status == PW_OK && x->system.period <= 0) status = flow_signals (x, r);
  if (status == PW_OK && y) {
    status = pw_run_restart (r, y, y + x->n, &x->why);
    if (status == PW_INPUT) x->why.status = PW_RETRY; /* a trial with a value of 1e100, or NaN */
  }
  if (status == PW_OK) return r;
  pw_run_close (r);
  return NULL;
}

/* ---- The flow ---- */

/* x->change = the derivative of the consistent state nearest to x->state with respect to entry j of x->state, in the
 * unit of this entry, by differences. */
static int flow_nearest (pw_periodic *x, pw_run *r, int j) {
  const double h = 1e-5, initial = x->state[j];
  int n = x->n, status = PW_OK;
  memset (x->change, 0, 2 * (size_t)n * sizeof *x->change);
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    x->state[j] = initial + side * h * pw_periodic_unit (x, j);
    status = pw_run_restart (r, x->state, x->state + n, &x->why);
    for (int i = 0; i < n; i++) {
      x->change[i] += side * r->q[i] / (2 * h);
      x->change[n + i] += side * r->v[i] / (2 * h);
    }
  }
  x->state[j] = initial;
  return status;
}

/* Sets x->basis and x->dual at the initial state of the run.  nearest: 1: x->dual applies to any change of
 * x->state, by way of the change of the nearest consistent state; 0: only to changes that satisfy the constraints. */
static int flow_basis (pw_periodic *x, pw_run *r, int nearest) {
  pw_linearisation l;
  int n = x->n, status = pw_linear_open (&l, r, PW_LINEAR_BASES);
  if (status == PW_OK) status = pw_linear_evaluate (&l, r->t, r->q, r->v);
  if (status == PW_OK) pw_linear_bases (&l);
  x->size = l.size;
  for (int c = 0; status == PW_OK && c < l.size; c++) {
    pw_linear_tangent (&l, c);
    memcpy (x->basis + 2 * n * c, l.dx, 2 * (size_t)n * sizeof *l.dx);
  }
  for (int j = 0; status == PW_OK && j < 2 * n; j++) {
    memset (x->change, 0, 2 * (size_t)n * sizeof *x->change);
    x->change[j] = pw_periodic_unit (x, j);
    if (nearest) status = flow_nearest (x, r, j);
    pw_linear_coordinates (&l, x->change, x->change + n, 1, x->dual + j * l.size);
  }
  pw_linear_close (&l);
  return status == PW_OK && nearest ? pw_run_restart (r, x->state, x->state + n, &x->why) : status;
}

static void flow_state (const pw_periodic *x, const pw_sample *sample, double *y) {
  memcpy (y, sample->q, (size_t)x->n * sizeof *y);
  memcpy (y + x->n, sample->v, (size_t)x->n * sizeof *y);
}

/* The run whose end is differentiated, at its initial state. */
typedef struct {
  const pw_periodic *x;
  const pw_run *r;
  double end;
} flow_from;

/* pw_outputs: the state at the end after a change of the initial state by c, in minimal coordinates. */
static int flow_changed (void *context, const double *c, double rtol, double *value, pw_error *error) {
  const flow_from *from = context;
  const pw_periodic *x = from->x;
  const int n = x->n;
  pw_settings settings = from->r->settings;
  pw_sample sample;
  settings.rtol = rtol;
  memcpy (value, from->r->q, (size_t)n * sizeof *value);
  memcpy (value + n, from->r->v, (size_t)n * sizeof *value);
  for (int k = 0; k < x->size; k++)
    for (int i = 0; i < 2 * n && c[k] != 0; i++) value[i] += c[k] * x->basis[2 * n * k + i];
  pw_run *r = pw_run_open (from->r->s, x->settings.method, &settings, error);
  int status = r ? pw_run_restart (r, value, value + n, error) : error->status;
  while (status == PW_OK && pw_run_time (r) < from->end) status = pw_run_advance (r, from->end, error);
  if (status == PW_OK) status = pw_run_sample (r, from->end, &sample, error);
  if (status == PW_OK) flow_state (x, &sample, value);
  pw_run_close (r);
  return status;
}

/* Differentiates the state at the end of the period along x->basis, into x->Phi. */
static int flow_derivatives (pw_periodic *x, pw_run *r, double end, pw_flow_accuracy accuracy) {
  const int size = x->size, n = x->n;
  double *zero = calloc (2 * (size_t)size + 2, sizeof *zero), *L = zero + size + 1;
  pw_derivative *derivative = calloc (2 * (size_t)n * (size_t)size + 1, sizeof *derivative);
  const pw_difference_settings d = { .evaluate = flow_changed,
                                     .context = &(flow_from){ x, r, end },
                                     .x = zero,
                                     .parameters = size,
                                     .outputs = 2 * n,
                                     .size = L,
                                     .rtol = r->settings.rtol,
                                     .neighbours = accuracy == PW_FLOW_MULTIPLIERS ? 4 : 2,
                                     .jobs = 1 };
  int status = zero && derivative ? PW_OK : pw_fail_memory (x->s, &x->why);
  for (int c = 0; c < size && zero; c++) L[c] = x->L;
  if (status == PW_OK && size > 0) status = pw_differentiate (&d, derivative, NULL, &x->why);
  for (int i = 0; i < 2 * n * size && status == PW_OK; i++) x->Phi[i] = derivative[i].value;
  free (zero);
  free (derivative);
  return status;
}

/* As pw_periodic_flow, with a run at its initial state. */
static int flow_run (pw_periodic *x, pw_run *r, double period, pw_flow_accuracy accuracy) {
  size_t bytes = (size_t)x->n * sizeof *r->q;
  double end = x->settings.t + period;
  pw_sample sample;
  int nearest = x->settings.compile && accuracy == PW_FLOW_DERIVATIVES; /* for the tangent of a branch */
  int status = accuracy == PW_FLOW ? PW_OK : flow_basis (x, r, nearest);
  if (status != PW_OK) return status == PW_RETRY ? pw_fail_singular (r, r->t, &x->why) : status;
  status = pw_run_sample (r, r->t, &sample, &x->why);
  if (status != PW_OK) return status;
  flow_state (x, &sample, x->y0), memcpy (x->a0, sample.a, bytes);
  if (accuracy != PW_FLOW) x->steps = 0; /* the PW_FLOW that follows, at the same state, sets it */
  if (accuracy != PW_FLOW) return flow_derivatives (x, r, end, accuracy);
  while (status == PW_OK && pw_run_time (r) < end) {
    status = pw_run_advance (r, end, &x->why);
    if (status == PW_OK && x->steps > 0 && pw_run_statistics (r)->steps > FLOW_STEPS * x->steps) return PW_RETRY;
  }
  if (status == PW_OK && x->steps == 0) x->steps = pw_run_statistics (r)->steps;
  if (status == PW_OK) status = pw_run_sample (r, end, &sample, &x->why);
  if (status != PW_OK) return status;
  flow_state (x, &sample, x->y1), memcpy (x->a1, sample.a, bytes);
  return PW_OK;
}

int pw_periodic_flow (pw_periodic *x, const double *u, pw_flow_accuracy accuracy, pw_error *error) {
  double value = pw_periodic_parameter (x, u), rtol = fmax (x->settings.rtol, flow_min_rtol[accuracy]);
  double period = u[pw_periodic_unknowns (x) - 1] * x->T; /* if it is free */
  x->why = (pw_error){ 0 };
  if (x->settings.free && !(period * FLOW_FAR > x->last_period && period < FLOW_FAR * x->last_period)) return PW_RETRY;
  for (int j = 0; j < 2 * x->n; j++) x->state[j] = u[j] * pw_periodic_unit (x, j);
  pw_run *r = pw_periodic_run (x, value, rtol, x->state);
  int status = r ? flow_run (x, r, x->settings.free ? period : x->system.period, accuracy) : x->why.status;
  pw_run_close (r);
  if (status == PW_OK) return PW_OK;
  if (status == PW_STOPPED) pw_fail (&x->why, PW_METHOD, "stopped");
  int refused = x->settings.compile && x->system.own == NULL; /* the model refused the value of the parameter */
  if (status == PW_RESOURCE) pw_fail_memory (x->s, &x->why);
  if (status == PW_RESOURCE || (status == PW_INPUT && r == NULL && !refused))
    return pw_fail (error, status, "%s", x->why.text);
  return PW_RETRY;
}

/* ---- Where the search begins ---- */

double pw_periodic_difference (const pw_periodic *x, int j, double a, double b) {
  int rates = pw_steady_rate_count (x->s), keeps_turns = j >= 3 * x->s->bodies || j % 3 != 2;
  for (int k = 0; k < x->symmetries && !keeps_turns; k++)
    keeps_turns = x->steady->symmetry[k * rates + PW_RATE_TURN] != 0 ||
                  x->steady->symmetry[k * rates + pw_steady_angle_rate (x->s, j)] != 0;
  return keeps_turns ? a - b : remainder (a - b, 2 * PW_PI);
}

/* Sets y to the canonical state of a run at time t (pw_steady_canonical), and *distance to its distance from x->y0
 * in units of the scene. */
static int flow_distance (pw_periodic *x, pw_run *r, double t, double *y, double *distance) {
  pw_sample sample;
  int n = x->n, status = pw_run_sample (r, t, &sample, &x->why);
  if (status != PW_OK) return status;
  flow_state (x, &sample, y);
  pw_steady_canonical (x->steady, y, y + n);
  *distance = 0;
  for (int j = 0; j < 2 * n; j++)
    *distance = hypot (*distance, pw_periodic_difference (x, j, y[j], x->y0[j]) / pw_periodic_unit (x, j));
  return PW_OK;
}

/* Sets x->last_period to the time after which the run first returns near its present state, up to symmetries: where the
 * distance from it has a minimum. */
static int flow_return (pw_periodic *x, pw_run *r) {
  double t0 = pw_run_time (r), step = x->T / RETURN_STEPS, d[3] = { 0, 0, 0 }, far = 0;
  int status = flow_distance (x, r, t0, x->y0, d); /* stores the present state in x->y0 */
  for (int i = 1; status == PW_OK && i <= RETURN_SAMPLES; i++) {
    double t = t0 + i * step;
    d[0] = d[1], d[1] = d[2];
    status = pw_run_advance_to (r, t, t0 + RETURN_SAMPLES * step, &x->why);
    if (status == PW_OK && pw_run_stop_requested (r)) return PW_STOPPED;
    if (status == PW_OK) status = flow_distance (x, r, t, x->y1, &d[2]);
    if (status != PW_OK) break;
    far = fmax (far, d[2]);
    if (i > 2 && far > RETURN_MOVED && d[1] < RETURN_NEAR * far && d[1] < d[0] && d[1] <= d[2])
      return x->last_period = t - step - t0, PW_OK;
  }
  if (status != PW_OK) return status;
  return pw_fail (&x->why, PW_METHOD, "the motion does not return to a state: a guess of the period is needed");
}

int pw_periodic_settle (pw_periodic *x, double value, int periods) {
  pw_sample sample;
  pw_run *r = pw_periodic_run (x, value, FLOW_SETTLE_RTOL, NULL);
  if (r == NULL) return x->why.status;
  double end = r->t + periods * (x->settings.free ? x->last_period : x->system.period);
  int status = pw_run_advance_to (r, end, end, &x->why);
  if (status == PW_OK && pw_run_stop_requested (r)) status = PW_STOPPED;
  if (status == PW_OK) status = pw_run_sample (r, pw_run_time (r), &sample, &x->why);
  if (status == PW_OK)
    flow_state (x, &sample, x->state), pw_steady_move_to_start (x->steady, x->state, x->state + x->n);
  if (status == PW_OK && x->settings.free && x->settings.period <= 0) status = flow_return (x, r);
  pw_run_close (r);
  if (status == PW_STOPPED) pw_fail (&x->why, PW_METHOD, "stopped");
  return status == PW_OK || status == PW_RESOURCE ? status : PW_RETRY;
}
