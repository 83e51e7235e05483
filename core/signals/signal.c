/* Signals: values, first two time derivatives and breakpoints of each form; tables are in table.c. */
#include <math.h>
#include "signal.h"

/* ---- Ramps, smooth steps, pulses ---- */

/* A ramp, from + (to - from) x with x = (t - start) / duration; or a smooth step, with 10 x^3 - 15 x^4 + 6 x^5 in place
 * of x, whose first and second derivatives are 0 at both ends (Flash & Hogan 1985, Journal of Neuroscience 5,
 * 1688-1703).  Both are constant before their start and after their end. */
static void signal_rise (const pw_signal *s, double t, double u[3]) {
  double rise = s->ramp.to - s->ramp.from, T = s->ramp.duration, x = (t - s->ramp.start) / T;
  u[0] = s->ramp.from;
  if (t < s->ramp.start) return;
  if (t >= s->ramp.start + T)
    u[0] = s->ramp.to;
  else if (s->type == PW_RAMP) {
    u[0] += rise * x;
    u[1] = rise / T;
  } else {
    u[0] += rise * (x * x * x * (10 + x * (6 * x - 15)));
    u[1] = rise * (30 * x * x * (1 - x) * (1 - x)) / T;
    u[2] = rise * (60 * x * (1 - x) * (1 - 2 * x)) / (T * T);
  }
}

static double signal_rise_breakpoint (const pw_signal *s, double t) {
  double end = s->ramp.start + s->ramp.duration;
  return t < s->ramp.start ? s->ramp.start : t < end ? end : INFINITY;
}

/* The beginning of the period that contains t, and of the next one, for t >= start. */
static void signal_pulse_period (const pw_signal *s, double t, double *begin, double *next) {
  double start = s->pulse.start, period = s->pulse.period;
  *begin = start;
  *next = INFINITY;
  if (period == 0) return;
  double k = floor ((t - start) / period);
  if (start + k * period > t) k--; /* the quotient was rounded */
  if (start + (k + 1) * period <= t) k++;
  *begin = start + k * period;
  *next = start + (k + 1) * period;
}

static double signal_pulse_end (const pw_signal *s, double begin) {
  return s->pulse.width > 0 ? begin + s->pulse.width : INFINITY;
}

static void signal_pulse (const pw_signal *s, double t, double u[3]) {
  double begin, next;
  u[0] = s->pulse.offset;
  if (t < s->pulse.start) return;
  signal_pulse_period (s, t, &begin, &next);
  if (t < signal_pulse_end (s, begin)) u[0] += s->pulse.height;
}

static double signal_pulse_breakpoint (const pw_signal *s, double t) {
  double begin, next;
  if (t < s->pulse.start) return s->pulse.start;
  signal_pulse_period (s, t, &begin, &next);
  double end = signal_pulse_end (s, begin);
  return t < end ? end : next > t ? next : INFINITY; /* next == t if the period is below the resolution of t */
}

/* ---- All signals ---- */

/* Fails if a number that is needed is not finite, or no value is stored: a callback in another language that ends
 * before its first statement may return 0. */
static int signal_function (const pw_source *source, double t) {
  const pw_function *f = &source->signal.function;
  double *u = source->u;
  u[0] = NAN;
  int status = f->eval (f->context, t, source->x, u, source->reads ? source->x + source->reads : NULL);
  if (status != 0) return status;
  return !isfinite (u[0]) || (!source->of_force && !(isfinite (u[1]) && isfinite (u[2])));
}

/* offset + A cos (omega t + phase) and its derivatives, A the amplitude */
static void signal_harmonic (const pw_signal *s, double t, int derivatives, double u[3]) {
  double A = s->harmonic.amplitude, omega = s->harmonic.omega, sine, cosine;
  pw_sin_cos (omega * t + s->harmonic.phase, &sine, &cosine);
  u[0] = s->harmonic.offset + A * cosine;
  if (!derivatives) return;
  u[1] = -A * omega * sine;
  u[2] = -omega * omega * (A * cosine);
}

int pw_signal_eval (const pw_source *source, double t) {
  const pw_signal *s = &source->signal;
  double *u = source->u;
  u[0] = u[1] = u[2] = 0;
  switch (s->type) {
  case PW_CONSTANT:
    u[0] = s->constant;
    break;
  case PW_HARMONIC:
    signal_harmonic (s, t, !source->of_force, u);
    break;
  case PW_FUNCTION:
    return signal_function (source, t);
  case PW_TABLE:
    pw_table_eval (s, source->spline, t, u);
    break;
  case PW_PULSE:
    signal_pulse (s, t, u);
    break;
  case PW_RAMP:
  case PW_SMOOTH_STEP:
    signal_rise (s, t, u);
    break;
  }
  return 0;
}

double pw_signal_breakpoint (const pw_signal *s, int kinks, double t) {
  switch (s->type) {
  case PW_CONSTANT:
  case PW_HARMONIC:
    break;
  case PW_RAMP:
  case PW_SMOOTH_STEP:
    return signal_rise_breakpoint (s, t);
  case PW_PULSE:
    return signal_pulse_breakpoint (s, t);
  case PW_TABLE:
    return pw_table_breakpoint (s, kinks, t);
  case PW_FUNCTION:
    return s->function.breakpoint ? s->function.breakpoint (s->function.context, t) : INFINITY;
  }
  return INFINITY;
}
