/* Signals with a beginning and an end: ramps, smooth steps, pulses; and tables, through table.c. */
#include <math.h>
#include "signal.h"

/* from + (to - from) x, x = (t - start) / duration */
static void shape_ramp (const pw_signal *s, double x, double u[3]) {
  double rise = s->ramp.to - s->ramp.from;
  u[0] = s->ramp.from + rise * x;
  u[1] = rise / s->ramp.duration;
}

/* from + (to - from) (10 x^3 - 15 x^4 + 6 x^5): rate and acceleration begin and end with 0
 * (Flash & Hogan 1985, Journal of Neuroscience 5, 1688-1703). */
static void shape_smooth_step (const pw_signal *s, double x, double u[3]) {
  double rise = s->ramp.to - s->ramp.from, T = s->ramp.duration;
  u[0] = s->ramp.from + rise * (x * x * x * (10 + x * (6 * x - 15)));
  u[1] = rise * (30 * x * x * (1 - x) * (1 - x)) / T;
  u[2] = rise * (60 * x * (1 - x) * (1 - 2 * x)) / (T * T);
}

/* Ramps and smooth steps rest before and behind. */
static void shape_rise (const pw_signal *s, double t, double u[3]) {
  if (t < s->ramp.start)
    u[0] = s->ramp.from;
  else if (t >= s->ramp.start + s->ramp.duration)
    u[0] = s->ramp.to;
  else
    (s->type == PW_RAMP ? shape_ramp : shape_smooth_step) (s, (t - s->ramp.start) / s->ramp.duration, u);
}

static double shape_rise_breakpoint (const pw_signal *s, double t) {
  double end = s->ramp.start + s->ramp.duration;
  return t < s->ramp.start ? s->ramp.start : t < end ? end : INFINITY;
}

/* The beginnings of the pulse that t belongs to and of the one behind it; t is not before the first. */
static void shape_pulses (const pw_signal *s, double t, double *here, double *next) {
  double start = s->pulse.start, period = s->pulse.period;
  *here = start;
  *next = INFINITY;
  if (period == 0) return;
  double k = floor ((t - start) / period);
  if (start + k * period > t) k--; /* the quotient was rounded */
  if (start + (k + 1) * period <= t) k++;
  *here = start + k * period;
  *next = start + (k + 1) * period;
}

static double shape_pulse_end (const pw_signal *s, double here) {
  return s->pulse.width > 0 ? here + s->pulse.width : INFINITY;
}

static void shape_pulse (const pw_signal *s, double t, double u[3]) {
  double here, next;
  u[0] = s->pulse.offset;
  if (t < s->pulse.start) return;
  shape_pulses (s, t, &here, &next);
  if (t < shape_pulse_end (s, here)) u[0] += s->pulse.height;
}

static double shape_pulse_breakpoint (const pw_signal *s, double t) {
  double here, next;
  if (t < s->pulse.start) return s->pulse.start;
  shape_pulses (s, t, &here, &next);
  double end = shape_pulse_end (s, here);
  return t < end ? end : next > t ? next : INFINITY; /* late enough, times no longer tell pulses apart */
}

int pw_shape_eval (const pw_source *source, double t, double u[3]) {
  const pw_signal *s = &source->signal;
  if (s->type == PW_PULSE)
    shape_pulse (s, t, u);
  else if (s->type == PW_TABLE)
    pw_table_eval (s, source->spline, t, u);
  else
    shape_rise (s, t, u);
  return 0;
}

double pw_shape_breakpoint (const pw_signal *s, int knots, double t) {
  if (s->type == PW_RAMP || s->type == PW_SMOOTH_STEP) return shape_rise_breakpoint (s, t);
  if (s->type == PW_PULSE) return shape_pulse_breakpoint (s, t);
  return s->type == PW_TABLE ? pw_table_breakpoint (s, knots, t) : INFINITY;
}
