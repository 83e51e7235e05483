/* The search for relative periodic motions by single shooting, and their branches; multipliers.
 *
 * P (y) is the consistent state nearest to y, phi (y) the state one period after y, and D (d) y the state y displaced
 * by the symmetries of the system, by the k-th one at its rates for the time d_k.  The unknowns are y, d and, if it is
 * free, the period:
 *
 *     phi (P (y)) - D (d) P (y) = 0,    y - P (y) = 0,
 *
 * and corrections are orthogonal to symmetries and, with a free period, to the motion.  Derivatives of phi are
 * differences of runs (derivatives.c), along a basis B of perturbations on the constraints (x->basis).  P' = B B^+
 * (x->dual: B^+) is exact for such perturbations; on branches, whose tangents need all others, P' is computed by
 * differences.
 *
 * Multipliers are the eigenvalues of the monodromy matrix D (d)^-1 phi' in minimal coordinates of perturbations, in
 * the frame that has moved with the whole.  (Wulff & Schebesch 2008, Numerical continuation of symmetric periodic
 * orbits.) */
#include <lapacke.h>
#include <stdlib.h>
#include "search.h"

enum {
  PERIODIC_WORK = 34,             /* numbers of work space of LAPACK per minimal coordinate */
  PERIODIC_MAX_COORDINATES = 100, /* since the cost is cubic */
  PERIODIC_POINTS = 20,           /* of a branch, by default */
  PERIODIC_MAX_POINTS = 50        /* of a branch, as a multiple of those that the settings ask for */
};
static const double PERIODIC_EXACT = 1e-9, /* largest residual of a solution, in units of the scene */
    PERIODIC_RANK = 1e-7,                  /* smaller singular values of the derivatives count as 0 */
    PERIODIC_CIRCLE = 1e-6,                /* distance from the unit circle that is not round-off */
    PERIODIC_MIN_STEP = 1e-5,              /* in scaled unknowns; the range of the parameter is 1 */
    PERIODIC_EVENT = 1e-7,                 /* accuracy of events, relative to the step */
    PERIODIC_REAL = 1e-3;                  /* imaginary part, after location, of a pair that is about to become real */

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

/* The period of a signal [s]; 0: none, or not known. */
static double signal_period (const pw_signal *s) {
  if (s->type == PW_PULSE) return s->pulse.height != 0 ? s->pulse.period : 0;
  if (s->type != PW_HARMONIC || s->harmonic.amplitude == 0 || s->harmonic.omega == 0) return 0;
  return 2 * PW_PI / fabs (s->harmonic.omega);
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
    for (int i = 0; !s->batch[k].kind->of_coordinate && i < s->batch[k].b.count * s->batch[k].kind->signals; i++)
      period = common_period (period, signal_period (&s->batch[k].source[i].signal));
  return period;
}

/* Least relative tolerances.  Derivatives, of which differences of runs have two thirds of the digits, need fewer than
 * states: Newton's method converges all the same. */
static const double flow_min_rtol[] = { [PW_FLOW] = 0, [PW_FLOW_DERIVATIVES] = 1e-10, [PW_FLOW_MULTIPLIERS] = 1e-12 };

/* a - b for entry j of two states; of the angle of a body that no symmetry changes, without whole turns. */
static double periodic_difference (const pw_periodic *x, int j, double a, double b) {
  int rates = pw_steady_rate_count (x->s), keeps_turns = j >= 3 * x->s->bodies || j % 3 != 2;
  for (int k = 0; k < x->symmetries && !keeps_turns; k++)
    keeps_turns = x->steady->symmetry[k * rates + PW_RATE_TURN] != 0 ||
                  x->steady->symmetry[k * rates + pw_steady_angle_rate (x->s, j)] != 0;
  return keeps_turns ? a - b : remainder (a - b, 2 * PW_PI);
}

/* Sets x->period: of the settings, else of the signals times settings.periods, else of the last motion; verifies
 * that signals repeat after it.  If the period is free, sets it to a time during which signals are constant. */
static int flow_signals (pw_periodic *x, pw_run *r) {
  double own_period = pw_system_period (r->s), period = x->settings.period;
  const int is_free = x->settings.free;
  int changed;
  if (is_free) period = fmax (period, FLOW_TIMES * x->T);
  if (period <= 0) period = own_period == 0 ? x->last_period : x->settings.periods * own_period;
  if (!(period > 0))
    return pw_fail (&x->why, PW_INPUT,
                    isnan (own_period)
                        ? "model %s: the periods of its signals have no common multiple: a period is needed"
                        : "model %s: no signal has a known period: a period is needed",
                    x->s->model);
  int status = pw_signals_change (r, x->settings.t, is_free ? 0 : period, (is_free ? 1 : FLOW_PERIODS) * period,
                                  &changed, &x->why);
  if (status != PW_OK) return status;
  if (changed < 0) return x->period = period, PW_OK;
  const char *name = PW_NAME (pw_system_signal_name, r->s, changed);
  if (is_free)
    return pw_fail (&x->why, PW_INPUT, "model %s: signal %s changes with time, so the period cannot be free",
                    x->s->model, name);
  return pw_fail (&x->why, PW_INPUT, "model %s: signal %s does not repeat after %.12g s%s", x->s->model, name, period,
                  x->settings.period > 0 ? "; if no period is given, that of the harmonic signals and pulses is used"
                                         : "");
}

/* The system at a value of the parameter.  NULL, with x->why, if there is none. */
static const pw_system *periodic_system (pw_periodic *x, double value) {
  if (x->parametric.compile && (x->parametric.own == NULL || x->parametric.value != value)) x->period = 0;
  return pw_parametric_at (&x->parametric, value, &x->why);
}

/* Opens a run, which the caller closes, at a value of the parameter from the consistent state nearest to y, or if that
 * is NULL from the initial state, and determines x->period.  rtol 0: the default of pw_settings.  NULL, with x->why, if
 * it fails. */
static pw_run *periodic_run (pw_periodic *x, double value, double rtol, const double *y) {
  const pw_settings settings = { .t = x->settings.t,
                                 .span = x->settings.period > 0 ? x->settings.period : x->T,
                                 .rtol = rtol,
                                 .stop = x->settings.stop,
                                 .stop_context = x->settings.stop_context,
                                 .methods = x->settings.methods };
  x->why = (pw_error){ 0 };
  const pw_system *s = periodic_system (x, value);
  pw_run *r = s ? pw_run_open (s, x->settings.method, &settings, &x->why) : NULL;
  int status = r ? PW_OK : x->why.status;
  if (status == PW_STOPPED) x->why = (pw_error){ PW_METHOD, "stopped" };
  if (status == PW_OK && x->period <= 0) status = flow_signals (x, r);
  if (status == PW_OK && y) {
    status = pw_run_restart (r, y, y + x->n, &x->why);
    if (status == PW_INPUT) x->why.status = PW_RETRY; /* a trial with a value of 1e100, or NaN */
  }
  if (status == PW_OK) return r;
  pw_run_close (r);
  return NULL;
}

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
  const int size = x->size, n = x->n, limited = r->s->limited > 0;
  double *zero = calloc (2 * (size_t)size + 2, sizeof *zero), *L = zero + size + 1;
  pw_derivative *derivative = calloc (2 * (size_t)n * (size_t)size + 1, sizeof *derivative);
  const pw_difference_settings d = { .evaluate = flow_changed,
                                     .context = &(flow_from){ x, r, end },
                                     .x = zero,
                                     .parameters = size,
                                     .outputs = 2 * n,
                                     .size = L,
                                     .rtol = r->settings.rtol,
                                     /* a given step may be longer than a phase between two events */
                                     .neighbours = accuracy != PW_FLOW_MULTIPLIERS ? 2
                                                   : limited                       ? 6
                                                                                   : 4,
                                     .jobs = 1 };
  int status = zero && derivative ? PW_OK : pw_fail_memory (x->s, &x->why);
  for (int c = 0; c < size && zero; c++) L[c] = x->L;
  if (status == PW_OK && size > 0) status = pw_differentiate (&d, derivative, NULL, &x->why);
  for (int i = 0; i < 2 * n * size && status == PW_OK; i++) {
    x->Phi[i] = derivative[i].value;
    if (derivative[i].type != PW_DERIVATIVE && accuracy == PW_FLOW_MULTIPLIERS) status = PW_RETRY;
  }
  if (status == PW_RETRY)
    pw_fail (&x->why, PW_METHOD, "no multipliers: the state after a period has no derivative with respect to %s",
             limited ? "the initial one, as if an event were about to appear" : "the initial one");
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
  pw_run *r = periodic_run (x, value, rtol, x->state);
  int status = r ? flow_run (x, r, x->settings.free ? period : x->period, accuracy) : x->why.status;
  pw_run_close (r);
  if (status == PW_OK) return PW_OK;
  if (status == PW_STOPPED) pw_fail (&x->why, PW_METHOD, "stopped");
  int refused = x->settings.compile && x->parametric.own == NULL; /* the model refused the value of the parameter */
  if (status == PW_RESOURCE) pw_fail_memory (x->s, &x->why);
  if (status == PW_RESOURCE || (status == PW_INPUT && r == NULL && !refused))
    return pw_fail (error, status, "%s", x->why.text);
  return PW_RETRY;
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
    *distance = hypot (*distance, periodic_difference (x, j, y[j], x->y0[j]) / pw_periodic_unit (x, j));
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

/* Sets x->state to the state after some periods of the motion from the initial state, displaced as by
 * pw_steady_move_to_start, and a free period that is not given to a guess.  A status; x->why contains the reason of a
 * failure. */
static int flow_settle (pw_periodic *x, double value, int periods) {
  pw_sample sample;
  pw_run *r = periodic_run (x, value, FLOW_SETTLE_RTOL, NULL);
  if (r == NULL) return x->why.status;
  double end = r->t + periods * (x->settings.free ? x->last_period : x->period);
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

/* Speed along the orbit, after removal of symmetries, below which a motion is steady, in units of the scene. */
static const double EQUATIONS_STEADY = 1e-4;

/* x->work = the rates of the displacement d, x->state = D (d) y at the initial state y = x->y0. */
static void equations_displace (pw_periodic *x, const double *d) {
  pw_steady_combine (x->steady, d, 1, x->work);
  memcpy (x->state, x->y0, 2 * (size_t)x->n * sizeof *x->state);
  pw_steady_displace (x->steady, x->work, 1, x->state, x->state + x->n);
}

/* After a flow from the state of u. */
static void equations_residual (pw_periodic *x, const double *u, double *F) {
  int states = 2 * x->n;
  equations_displace (x, u + states);
  for (int j = 0; j < states; j++) {
    F[j] = periodic_difference (x, j, x->y1[j], x->state[j]) / pw_periodic_unit (x, j);
    F[states + j] = u[j] - x->y0[j] / pw_periodic_unit (x, j);
  }
}

/* Adds the derivatives of -D (d) y with respect to d, by differences. */
static void equations_by_displacement (pw_periodic *x, const double *u, int rows, double *column) {
  const double h = 1e-6;
  int states = 2 * x->n;
  double *d = x->work + pw_steady_rate_count (x->s);
  for (int k = 0; k < x->symmetries; k++, column += rows)
    for (int side = -1; side <= 1; side += 2) {
      memcpy (d, u + states, (size_t)x->symmetries * sizeof *d);
      d[k] += side * h;
      equations_displace (x, d);
      for (int j = 0; j < states; j++) column[j] -= side * x->state[j] / (2 * h) / pw_periodic_unit (x, j);
    }
}

/* The change of D (d) y by a change of y: positions and velocities rotate by the angle w. */
static void equations_rotate (const pw_periodic *x, double w, const double *in, double *out) {
  pw_linear_rotate (&x->steady->system.linearisation, w, in, out);
  pw_linear_rotate (&x->steady->system.linearisation, w, in + x->n, out + x->n);
}

/* The angle by which the whole turns in the last flow: that of the first body whose angle no symmetry changes except by
 * turning the whole, or 0. */
static double equations_turn (const pw_periodic *x) {
  int rates = pw_steady_rate_count (x->s);
  for (int b = 0; b < x->s->bodies; b++) {
    int others = 0;
    for (int k = 0; k < x->symmetries; k++) others += x->steady->symmetry[k * rates + PW_RATE_ANGLES + b] != 0;
    if (others == 0) return x->y1[3 * b + 2] - x->y0[3 * b + 2];
  }
  return 0;
}

/* Sets the displacement in u to the one that agrees best with a flow of one period from the state of u.  A status. */
static int equations_guess_displacement (pw_periodic *x, double *u, pw_error *error) {
  enum { CORRECTIONS = 3 }; /* the rotation is known; for a given one translations are linear */
  int states = 2 * x->n, count = x->symmetries, rates = pw_steady_rate_count (x->s), rank;
  size_t rows = 2 * (size_t)states, work_size = rows + (size_t)(PERIODIC_WORK * (states + count));
  int status = count ? pw_periodic_flow (x, u, PW_FLOW, error) : PW_OK;
  if (status != PW_OK || count == 0) return status;
  double *F = calloc (rows + rows * (size_t)count + work_size, sizeof *F), *M = F + rows,
         *work = M + rows * (size_t)count;
  if (F == NULL) return pw_fail_memory (x->s, error);
  for (int k = 0; k < count; k++) {
    double turn = x->steady->symmetry[k * rates + PW_RATE_TURN];
    if (turn != 0) u[states + k] = equations_turn (x) / turn;
  }
  for (int i = 0; i < CORRECTIONS; i++) {
    equations_residual (x, u, F);
    memset (M, 0, rows * (size_t)count * sizeof *M);
    memset (x->branch.pivot, 0, (size_t)count * sizeof *x->branch.pivot);
    equations_by_displacement (x, u, (int)rows, M);
    if (LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, states, count, 1, M, (int)rows, F, (int)rows, x->branch.pivot,
                             PW_STEADY_RANK, &rank, work, (int)work_size))
      break;
    for (int k = 0; k < count; k++) u[states + k] -= F[k];
  }
  free (F);
  return PW_OK;
}

/* Adds the derivatives with respect to y. */
static void equations_by_state (pw_periodic *x, const double *u, int rows, double *dF) {
  int states = 2 * x->n, size = x->size;
  pw_steady_combine (x->steady, u + states, 1, x->work);
  for (int c = 0; c < size; c++) {
    const double *B = x->basis + states * c, *Phi = x->Phi + states * c;
    equations_rotate (x, x->work[PW_RATE_TURN], B, x->state);
    for (int i = 0; i < states; i++) {
      double unit = pw_periodic_unit (x, i), by = (Phi[i] - x->state[i]) / unit, own = B[i] / unit;
      for (int j = 0; j < states; j++) {
        dF[j * rows + i] += by * x->dual[j * size + c];
        dF[j * rows + states + i] -= own * x->dual[j * size + c];
      }
    }
  }
  for (int j = 0; j < states; j++) dF[j * rows + states + j] += 1;
}

/* Direction k in which solutions can be shifted, along symmetries and in time, into x->change. */
static void equations_shift (pw_periodic *x, int k) {
  const size_t n = (size_t)x->n, bytes = n * sizeof *x->change;
  if (k == x->symmetries) { /* in time */
    memcpy (x->change, x->y0 + n, bytes), memcpy (x->change + n, x->a0, bytes);
    return;
  }
  const double *symmetry = x->steady->symmetry + k * pw_steady_rate_count (x->s);
  pw_steady_velocities (x->steady, symmetry, x->y0, x->change);
  memset (x->change + n, 0, bytes);
  pw_linear_turn (&x->steady->system.linearisation, symmetry[PW_RATE_TURN], x->y0 + n, x->change + n);
}

/* pw_branch_problem.evaluate.  The flow without derivatives comes last: the equations need its x->y0 to x->a1. */
static int equations_evaluate (void *periodic, const double *u, double *F, double *dF, pw_error *error) {
  pw_periodic *x = periodic;
  int rows = x->branch.problem.equations, states = 2 * x->n;
  int status = dF ? pw_periodic_flow (x, u, PW_FLOW_DERIVATIVES, error) : PW_OK;
  if (status == PW_OK) status = pw_periodic_flow (x, u, PW_FLOW, error);
  if (status != PW_OK) return status;
  equations_residual (x, u, F);
  if (dF == NULL) return PW_OK;
  equations_by_state (x, u, rows, dF);
  equations_by_displacement (x, u, rows, dF + states * rows);
  double *by_period = x->settings.free ? dF + (pw_periodic_unknowns (x) - 1) * rows : NULL;
  for (int j = 0; by_period && j < x->n; j++) {
    by_period[j] = x->y1[x->n + j] * x->T / pw_periodic_unit (x, j);
    by_period[x->n + j] = x->a1[j] * x->T / pw_periodic_unit (x, x->n + j);
  }
  for (int k = 0; k < x->symmetries + x->settings.free; k++) { /* corrections are orthogonal to shifts */
    double sum = 0;
    equations_shift (x, k);
    for (int j = 0; j < states; j++) sum += pow (x->change[j] / pw_periodic_unit (x, j), 2);
    for (int j = 0; j < states && sum > 0; j++)
      dF[j * rows + 2 * states + k] = x->change[j] / pw_periodic_unit (x, j) / sqrt (sum);
  }
  return PW_OK;
}

/* Minimal coordinates of a change of the initial state. */
static void equations_coordinates (const pw_periodic *x, const double *change, double *out) {
  memset (out, 0, (size_t)x->size * sizeof *out);
  for (int j = 0; j < 2 * x->n; j++)
    for (int c = 0; c < x->size; c++) out[c] += x->dual[j * x->size + c] * change[j] / pw_periodic_unit (x, j);
}

/* Sorts multipliers by modulus, the largest first; of a pair that with im > 0 first. */
static void equations_sort (int count, double *re, double *im) {
  for (int i = 1; i < count; i++)
    for (int k = i; k > 0; k--) {
      double before = hypot (re[k - 1], im[k - 1]), here = hypot (re[k], im[k]);
      if (!(here > before * (1 + 1e-12) || (here > before * (1 - 1e-12) && im[k] > im[k - 1]))) break;
      double swap = re[k];
      re[k] = re[k - 1], re[k - 1] = swap;
      swap = im[k], im[k] = im[k - 1], im[k - 1] = swap;
    }
}

/* The eigenvalues of the diagonal block from row `first` of x->monodromy, into x->re and x->im from entry `to`. */
static int equations_block (pw_periodic *x, int first, int count, int to, double *block, double *work) {
  for (int c = 0; c < count; c++)
    memcpy (block + c * count, x->monodromy + (first + c) * x->size + first, (size_t)count * sizeof *block);
  if (count && LAPACKE_dgeev_work (LAPACK_COL_MAJOR, 'N', 'N', count, block, count, x->re + to, x->im + to, NULL, 1,
                                   NULL, 1, work, PERIODIC_WORK * x->size))
    return PW_METHOD;
  equations_sort (count, x->re + to, x->im + to);
  return PW_OK;
}

/* Fills x->re, x->im with the multipliers of u, after a flow with derivatives: those that are not trivial, the largest
 * first, then the trivial ones; x->work with the rates of the displacement in a period.  PW_OK; PW_METHOD if LAPACK
 * fails; PW_RETRY with x->why: with a free period, the motion is steady.
 * In coordinates that begin with the shifts, the monodromy matrix is block triangular: the first block is trivial. */
static int equations_multipliers (pw_periodic *x, const double *u, int *trivial) {
  int n = x->n, size = x->size, lwork = PERIODIC_WORK * size, k = 0;
  double *S = x->monodromy + size * size, *tau = S + size * size, *work = tau + size;
  const int first = pw_steady_hidden_symmetries (x->steady), shifts = x->symmetries + x->settings.free - first;
  for (; k < shifts && k < size; k++) {
    equations_shift (x, first + k);
    equations_coordinates (x, x->change, S + k * size);
  }
  *trivial = k;
  pw_steady_combine (x->steady, u + 2 * n, 1, x->work);
  if (size == 0) return PW_OK;
  for (int c = 0; c < size; c++) {
    equations_rotate (x, -x->work[PW_RATE_TURN], x->Phi + 2 * n * c, x->change);
    equations_coordinates (x, x->change, x->monodromy + c * size);
  }
  LAPACKE_dgeqrf_work (LAPACK_COL_MAJOR, size, k, S, size, tau, work, lwork);
  if (x->settings.free && k > pw_periodic_symmetries (x) &&
      fabs (S[(k - 1) * size + k - 1]) * x->T < EQUATIONS_STEADY * x->L) {
    pw_fail (&x->why, PW_METHOD, "Newton's method leads to a steady motion or an equilibrium");
    return PW_RETRY;
  }
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'L', 'T', size, size, k, S, size, tau, x->monodromy, size, work, lwork);
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'R', 'N', size, size, k, S, size, tau, x->monodromy, size, work, lwork);
  int status = equations_block (x, k, size - k, 0, S, work);
  return status == PW_OK ? equations_block (x, 0, k, size - k, S, work) : status;
}

/* pw_branch_problem.same: up to symmetries, but not up to a shift in time. */
static int periodic_same (void *periodic, const double *u, const double *other) {
  pw_periodic *x = periodic;
  for (int j = 0; j < 2 * x->n; j++) {
    x->state[j] = u[j] * pw_periodic_unit (x, j);
    x->change[j] = other[j] * pw_periodic_unit (x, j);
  }
  return pw_steady_distance (x->steady, x->state, x->state + x->n, x->change, x->change + x->n) <= PW_BRANCH_SAME;
}

static int periodic_arrays (pw_periodic *x) {
  size_t n = (size_t)x->n, states = 2 * n, all = states + (size_t)x->symmetries + 2; /* of u */
  x->memory = PW_ALLOC_ARRAYS (
      PW_ARRAY (x->u, all), PW_ARRAY (x->y0, states), PW_ARRAY (x->y1, states), PW_ARRAY (x->a0, n),
      PW_ARRAY (x->a1, n), PW_ARRAY (x->state, states), PW_ARRAY (x->change, states),
      PW_ARRAY (x->Phi, states * states), PW_ARRAY (x->basis, states * states), PW_ARRAY (x->dual, states * states),
      PW_ARRAY (x->monodromy, (2 * states + 1 + PERIODIC_WORK) * states), PW_ARRAY (x->re, states),
      PW_ARRAY (x->im, states), PW_ARRAY (x->work, (size_t)pw_steady_rate_count (x->s) + all));
  return x->memory ? PW_OK : PW_RESOURCE;
}

/* The period of the signals where the range of the parameter begins, or if none has one there, where their amplitudes
 * may be 0, within the range; 0 without one.  Sets x->last_period to `periods` of these. */
static int periodic_signal_period (pw_periodic *x, double *period) {
  const double value[] = { x->settings.first, pw_value_within (x->settings.first, x->settings.last) };
  *period = 0;
  for (int i = 0; i < 2 && *period == 0; i++) {
    const pw_system *s = periodic_system (x, value[i]);
    if (s == NULL && i > 0 && x->why.status != PW_RESOURCE) return x->why = (pw_error){ 0 }, PW_OK;
    if (s == NULL) return x->why.status;
    *period = pw_system_period (s);
  }
  if (!(*period >= 0)) *period = 0;
  x->last_period = x->settings.periods * *period;
  return PW_OK;
}

static int periodic_check_settings (const pw_periodic_settings *set, pw_error *error) {
  if (!isfinite (set->rtol) || set->rtol < 0) /* 0 selects the default, here and below */
    return pw_fail (error, PW_INPUT, "setting rtol = %g: expected a number > 0", set->rtol);
  if (!isfinite (set->period) || set->period < 0)
    return pw_fail (error, PW_INPUT, "setting period = %g: expected a number > 0", set->period);
  if (set->periods < 0) return pw_fail (error, PW_INPUT, "setting periods = %d: expected a number > 0", set->periods);
  return pw_check_search (set->first, set->last, set->points, error);
}

static int periodic_open (pw_periodic *x, pw_error *error) {
  const pw_system *s = x->s;
  const pw_method *integrator;
  int stabilisation;
  if (pw_method_parse (x->settings.method, x->settings.methods, &integrator, &stabilisation, error) != PW_OK)
    return error->status;
  if (!pw_method_adaptive (integrator, x->settings.method))
    return pw_fail (error, PW_INPUT,
                    "method %s: periodic motions need one that controls its steps, such as erk8+projection",
                    x->settings.method);
  if (x->n > PERIODIC_MAX_COORDINATES)
    return pw_fail (error, PW_INPUT, "model %s has %d coordinates; periodic motions are sought with at most %d",
                    s->model, x->n, PERIODIC_MAX_COORDINATES);
  double period = x->settings.period;
  if (period == 0 && !x->settings.free && periodic_signal_period (x, &period) != PW_OK)
    return pw_fail (error, x->why.status, "%s", x->why.text);
  /* At a time at which no signal is likely to vanish: then the system would have more symmetries. */
  const pw_steady_settings settings = { .t = x->settings.t + 0.317 * period,
                                        .span = period > 0 ? period : 1,
                                        .first = x->settings.first,
                                        .last = x->settings.last,
                                        .vary = -1,
                                        .compile = x->settings.compile,
                                        .context = x->settings.context };
  x->steady = pw_steady_open_symmetries (s, &settings, error);
  if (x->steady == NULL) return error->status;
  x->symmetries = x->steady->free_symmetries = x->steady->symmetries, x->L = x->steady->L, x->T = x->steady->T;
  const pw_branch_problem problem = { .unknowns = pw_periodic_unknowns (x),
                                      .equations = pw_periodic_unknowns (x) + 2 * x->n,
                                      .tolerance = PERIODIC_EXACT,
                                      .rank_tolerance = PERIODIC_RANK,
                                      .evaluate = equations_evaluate,
                                      .same = periodic_same,
                                      .context = x };
  if (periodic_arrays (x) != PW_OK) return pw_fail_memory (s, error);
  int status = pw_branch_open (&x->branch, &problem, error);
  if (status != PW_OK) return status;
  pw_run *r = periodic_run (x, x->settings.first, 0, NULL); /* verifies the signals */
  if (r == NULL) return pw_fail (error, x->why.status, "%s", x->why.text);
  pw_run_close (r);
  return PW_OK;
}

pw_periodic *pw_periodic_open (const pw_system *s, const pw_periodic_settings *settings, pw_error *error) {
  pw_error ignored = { 0 };
  if (error == NULL) error = &ignored;
  if (pw_require (s, "a system", error) != PW_OK || pw_require (settings, "settings", error) != PW_OK) return NULL;
  if (periodic_check_settings (settings, error) != PW_OK) return NULL;
  pw_periodic *x = calloc (1, sizeof *x);
  if (x == NULL) return pw_fail_memory (s, error), NULL;
  x->s = s, x->settings = *settings, x->n = s->coords;
  x->parametric = (pw_parametric){ .described = s, .compile = settings->compile, .context = settings->context };
  if (x->settings.method == NULL) x->settings.method = "erk8+projection";
  if (x->settings.rtol == 0) x->settings.rtol = 1e-12;
  if (x->settings.points == 0) x->settings.points = PERIODIC_POINTS;
  if (x->settings.periods == 0) x->settings.periods = 1;
  if (periodic_open (x, error) == PW_OK) return x;
  pw_periodic_close (x);
  return NULL;
}

void pw_periodic_close (pw_periodic *x) {
  if (x == NULL) return;
  pw_system_free (x->parametric.own);
  pw_branch_close (&x->branch);
  pw_steady_close (x->steady);
  free (x->memory);
  free (x);
}

const char *pw_periodic_reason (const pw_periodic *x) {
  return x ? x->why.text : "";
}

int pw_periodic_symmetries (const pw_periodic *x) {
  return x ? x->symmetries - pw_steady_hidden_symmetries (x->steady) : 0;
}

/* PW_RETRY if forces depend on the number of whole turns of a body: then the accelerations do not repeat. */
static int periodic_turns (pw_periodic *x) {
  double off = 0, most = 0;
  int turns = 0;
  for (int j = 0; j < x->n; j++) {
    double unit = pw_unit (x->s, j);
    if (fabs (periodic_difference (x, j, x->y1[j], x->y0[j]) - (x->y1[j] - x->y0[j])) > PW_PI) turns = 1;
    off = fmax (off, fabs (x->a1[j] - x->a0[j]) / unit);
    most = fmax (most, fabs (x->a1[j]) / unit);
  }
  if (turns == 0 || off <= PERIODIC_CIRCLE * fmax (most, 1 / (x->T * x->T))) return PW_OK;
  pw_fail (&x->why, PW_METHOD, "bodies make whole turns in a period, on whose number forces depend");
  return PW_RETRY;
}

static int periodic_orbit (pw_periodic *x, const double *u, pw_periodic_orbit *out, pw_error *error) {
  int status = pw_periodic_flow (x, u, PW_FLOW_MULTIPLIERS, error);
  if (status == PW_OK) status = equations_multipliers (x, u, &out->trivial);
  if (status == PW_METHOD) return pw_fail (error, status, "model %s: no multipliers: LAPACK failed", x->s->model);
  out->rotation = x->work[PW_RATE_TURN]; /* the multipliers have set x->work */
  if (status == PW_OK) status = pw_periodic_flow (x, u, PW_FLOW, error);
  if (status == PW_OK) status = periodic_turns (x);
  if (status != PW_OK) return status;
  out->parameter = pw_periodic_parameter (x, u);
  out->period = x->last_period = x->settings.free ? u[pw_periodic_unknowns (x) - 1] * x->T : x->period;
  out->q = x->y0, out->v = x->y0 + x->n, out->end = x->y1;
  out->multipliers = x->size;
  out->re = x->re, out->im = x->im;
  out->unstable = 0;
  for (int i = 0; i < x->size - out->trivial; i++) out->unstable += hypot (x->re[i], x->im[i]) > 1 + PERIODIC_CIRCLE;
  return PW_OK;
}

int pw_periodic_solve (pw_periodic *x, int settle, double parameter, pw_periodic_orbit *out, pw_error *error) {
  *out = (pw_periodic_orbit){ .residual = INFINITY };
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  x->begin_period = 0;
  if (settle < 0) return pw_fail (error, PW_INPUT, "settle = %d: expected a number >= 0", settle);
  if (pw_check_parameter (parameter, error) != PW_OK) return PW_INPUT;
  if (x->settings.free) x->last_period = x->settings.period > 0 ? x->settings.period : 2 * PW_PI * x->T;
  int status = flow_settle (x, parameter, settle);
  if (status < 0) return pw_fail (error, status, "%s", x->why.text);
  if (status != PW_OK) return status;
  const int unknowns = pw_periodic_unknowns (x);
  memset (x->u, 0, ((size_t)unknowns + 1) * sizeof *x->u);
  for (int j = 0; j < 2 * x->n; j++) x->u[j] = x->state[j] / pw_periodic_unit (x, j);
  if (x->settings.free) x->u[unknowns - 1] = x->last_period / x->T;
  if (x->settings.last != x->settings.first)
    x->u[unknowns] = (parameter - x->settings.first) / (x->settings.last - x->settings.first);
  x->steps = 0;
  status = equations_guess_displacement (x, x->u, error);
  if (status != PW_OK) return status;
  status = pw_branch_solve (&x->branch, x->u, error);
  if (status == PW_OK) status = periodic_orbit (x, x->u, out, error);
  if (status == PW_OK) x->begin_period = out->period;
  out->residual = x->branch.residual;
  out->iterations = x->branch.iterations;
  return status;
}

int pw_periodic_follow (pw_periodic *x, int direction, pw_error *error) {
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  pw_branch_end (&x->branch);
  if (pw_check_branch (direction, x->settings.first, x->settings.last, error) != PW_OK) return PW_INPUT;
  if (!(x->begin_period > 0))
    return pw_fail (error, PW_INPUT, "no motion has been found from which to follow a branch");
  x->last_period = x->begin_period, x->steps = 0;
  pw_branch *b = &x->branch;
  b->max_change = 1.0 / x->settings.points, b->step = b->max_change / 4, b->min_step = PERIODIC_MIN_STEP;
  b->event_accuracy = PERIODIC_EVENT, b->max_points = PERIODIC_MAX_POINTS * x->settings.points;
  x->unstable = -1;
  int status = pw_branch_start (b, x->u, direction, error);
  return status == PW_RETRY ? pw_fail (error, PW_METHOD, "the branch cannot be followed from here") : status;
}

/* pw_branch_test: the distance of multiplier number `sought` from the unit circle, positive outside; if it moves on the
 * circle before it leaves it, +-1. */
static int periodic_test (void *periodic, const pw_branch_point *point, double *value, pw_error *error) {
  pw_periodic *x = periodic;
  pw_periodic_orbit o;
  int status = periodic_orbit (x, point->u, &o, error);
  *value = hypot (x->re[x->sought], x->im[x->sought]) - 1;
  if (x->on_circle) *value = *value > PERIODIC_CIRCLE ? 1 : -1;
  return status;
}

/* pw_branch_locate_mode: where a multiplier crosses the unit circle. */
static int periodic_crossing (void *periodic, int mode, int change, int *event, int *modes, pw_error *error) {
  pw_periodic *x = periodic;
  pw_branch *b = &x->branch;
  double value;
  x->sought = mode, x->on_circle = 0;
  int status = periodic_test (x, change < 0 ? &b->reached : &b->previous, &value, error); /* not outside the circle */
  x->on_circle = fabs (value) < PERIODIC_CIRCLE;
  if (status == PW_OK) status = pw_branch_locate (b, periodic_test, x, error);
  if (status == PW_OK) status = periodic_test (x, &b->found, &value, error);
  *event = fabs (x->im[mode]) > PERIODIC_REAL ? PW_PERIODIC_TORUS
           : x->re[mode] > 0                  ? PW_PERIODIC_REAL
                                              : PW_PERIODIC_FLIP;
  *modes = *event == PW_PERIODIC_TORUS ? 2 : 1;
  return status;
}

/* pw_branch_find_events: multipliers that cross the unit circle. */
static int periodic_events (void *periodic, pw_error *error) {
  pw_periodic *x = periodic;
  pw_periodic_orbit o;
  int before = x->unstable, status = periodic_orbit (x, x->branch.reached.u, &o, error);
  if (status != PW_OK) return status;
  x->unstable = o.unstable;
  return before < 0 ? PW_OK : pw_branch_find_changes (&x->branch, before, o.unstable, periodic_crossing, error);
}

int pw_periodic_next (pw_periodic *x, pw_periodic_orbit *out, pw_error *error) {
  *out = (pw_periodic_orbit){ .event = PW_PERIODIC_END };
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  const pw_branch_event *next;
  int status = pw_branch_next (&x->branch, periodic_events, &x->why, &next, error);
  if (next == NULL) return status;
  status = periodic_orbit (x, next->point.u, out, error);
  if (status != PW_OK) return status;
  if (x->unstable < 0) x->unstable = out->unstable;
  out->event = (pw_periodic_event)next->event;
  out->iterations = x->branch.iterations;
  out->residual = next->point.residual;
  return status;
}
