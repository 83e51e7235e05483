/* Signals: values and time derivatives of what the user wants to happen over time. */
#include <math.h>
#include "signal.h"

/* offset + A cos (w t + p), -A w sin (w t + p), -A w^2 cos (w t + p); a force needs no sine */
static void signal_harmonic (const pw_signal *s, double angle, double u[3]) {
  double A = s->harmonic.amplitude, w = s->harmonic.omega, c = A * cos (angle);
  u[0] = s->harmonic.offset + c;
  u[1] = -A * w * sin (angle);
  u[2] = -w * w * c;
}

/* What is not a number has failed, too. */
static int signal_function (const pw_source *source, double t, int derivatives, double u[3]) {
  const pw_function *f = &source->signal.function;
  int status = f->eval (f->context, t, source->x, u, source->reads ? source->x + source->reads : NULL);
  if (status != 0) return status;
  return !isfinite (u[0]) || (derivatives && !(isfinite (u[1]) && isfinite (u[2])));
}

/* What most scenes have comes first. */
int pw_signal_eval (const pw_source *source, double t, int derivatives, double u[3]) {
  const pw_signal *s = &source->signal;
  u[1] = u[2] = 0;
  if (s->type == PW_HARMONIC && !derivatives) {
    u[0] = s->harmonic.offset + s->harmonic.amplitude * cos (s->harmonic.omega * t + s->harmonic.phase);
    return 0;
  }
  u[0] = 0;
  if (s->type == PW_FUNCTION) return signal_function (source, t, derivatives, u);
  if (s->type > PW_HARMONIC) return pw_shape_eval (source, t, u);
  if (s->type == PW_HARMONIC)
    signal_harmonic (s, s->harmonic.omega * t + s->harmonic.phase, u);
  else
    u[0] = s->constant;
  return 0;
}

double pw_signal_breakpoint (const pw_signal *s, int knots, double t) {
  if (s->type != PW_FUNCTION) return pw_shape_breakpoint (s, knots, t);
  return s->function.breakpoint ? s->function.breakpoint (s->function.context, t) : INFINITY;
}
