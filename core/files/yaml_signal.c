/* Signals of text models that are expressions: their values and derivatives, and what constraints demand of them.
 *
 * Such a signal is a function.  Each compiled system has a copy (pw_yaml_signal_open): it may outlive the model. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

enum { MAX_CHECKED_BREAKPOINTS = 100 };

/* Value and derivatives u; what is not given is computed from the last one given before; u[2] is 0 unless required. */
static void signal_derivatives (const pw_signal_function *f, const double *variable, double u[3]) {
  pw_expression_derivatives (f->expression[0], variable, PW_EXPRESSION_TIME, u);
  for (int i = 1; i <= f->derivatives; i++) {
    double given[3];
    if (f->expression[i] == NULL) continue;
    pw_expression_derivatives (f->expression[i], variable, PW_EXPRESSION_TIME, given);
    u[i] = given[0];
    if (i == 1) u[2] = given[1]; /* the derivative of the given rate, unless the acceleration is given, too */
  }
  if (f->derivatives < 2) u[2] = 0;
}

int pw_yaml_signal_eval (void *context, double t, const double *state, double value[3], double *gradient) {
  const pw_signal_function *f = context;
  double variable[PW_SIGNAL_STATES + 1] = { t }, derivatives[3];
  if (f->states) memcpy (variable + 1, state, (size_t)f->states * sizeof *state);
  if (f->derivatives)
    signal_derivatives (f, variable, value);
  else
    value[0] = pw_expression_value (f->expression[0], variable);
  for (int i = 0; gradient && i < f->states; i++) {
    pw_expression_derivatives (f->expression[0], variable, 1 + i, derivatives);
    if (derivatives[0] != value[0]) /* at a jump in time, which only derivatives by t decide: pass it */
      variable[0] = nextafter (t, INFINITY), pw_expression_derivatives (f->expression[0], variable, 1 + i, derivatives);
    /* 0 where the derivative is unknown, such as that of sqrt (vx^2 + vy^2) at rest. */
    gradient[i] = isfinite (derivatives[1]) ? derivatives[1] : 0;
  }
  return isfinite (value[0]) && (f->derivatives == 0 || (isfinite (value[1]) && isfinite (value[2]))) ? 0 : -1;
}

double pw_yaml_signal_breakpoint (void *context, double t) {
  const pw_signal_function *f = context;
  double first = INFINITY;
  for (int i = 0; i < 3; i++)
    if (f->expression[i]) first = fmin (first, pw_expression_breakpoint (f->expression[i], t));
  return first;
}

void *pw_yaml_signal_open (void *context) {
  const pw_signal_function *f = context;
  size_t bytes[3] = { 0 };
  for (int i = 0; i < 3; i++)
    if (f->expression[i]) bytes[i] = pw_expression_size (f->expression[i]);
  pw_signal_function *copy = malloc (sizeof *f + bytes[0] + bytes[1] + bytes[2]);
  if (copy == NULL) return NULL;
  *copy = *f;
  char *at = (char *)(copy + 1);
  for (int i = 0; i < 3; at += bytes[i++])
    if (f->expression[i]) copy->expression[i] = memcpy (at, f->expression[i], bytes[i]);
  return copy;
}

/* Compares derivative i, 1 or 2, which is given, with that computed from the last one given before, at some times. */
const char *pw_yaml_signal_check_derivative (const pw_signal_function *f, int i, const char *name,
                                             char fault[PW_SIGNAL_FAULT]) {
  static const double time[] = { 0.3, 1.7, 4.1 }; /* [s], arbitrary */
  int last = f->expression[i - 1] ? i - 1 : 0, n = i - last;
  double given[3], exact[3][3], size = 0;
  for (int k = 0; k < 3; k++) {
    given[k] = pw_expression_value (f->expression[i], &time[k]);
    pw_expression_derivatives (f->expression[last], &time[k], PW_EXPRESSION_TIME, exact[k]);
    if (isfinite (given[k]) && isfinite (exact[k][n]))
      size = fmax (size, fabs (given[k]) + fabs (exact[k][n]) + 1e-6 * fabs (exact[k][0])); /* the last: round-off */
  }
  for (int k = 0; k < 3; k++)
    if (isfinite (given[k]) && isfinite (exact[k][n]) && fabs (given[k] - exact[k][n]) > 1e-6 * size)
      return pw_print (fault, PW_SIGNAL_FAULT, "the %s at t = %g s is %.6g, but the derivative is %.6g", name, time[k],
                       given[k], exact[k][n]);
  return fault;
}

/* The derivatives at a time; states that the signal reads have irregular values. */
static void signal_derivatives_at (const pw_signal_function *f, double t, double u[3]) {
  double variable[PW_SIGNAL_STATES + 1] = { t };
  for (int i = 1; i <= f->states; i++) variable[i] = 0.1 + fmod (0.618 * i, 1);
  signal_derivatives (f, variable, u);
}

/* The largest magnitude of derivative i at t +- 2^-1, 2^-2, ... 2^-20 s and t + 1 s. */
static double signal_magnitude (const pw_signal_function *f, double t, int i) {
  double size = 0;
  for (int k = -20; k <= 20; k++) {
    double u[3];
    signal_derivatives_at (f, t + (k < 0 ? -1 : 1) * ldexp (1, -abs (k)), u);
    if (isfinite (u[i])) size = fmax (size, fabs (u[i]));
  }
  return size;
}

/* Refuses signals that a constraint cannot follow: a jump of the value or, for positions, of its derivative, at one of
 * the first breakpoints after t = 0, beyond round-off and the change between adjacent times; a jump as states change,
 * other than that of an angle by whole turns. */
const char *pw_yaml_signal_check_continuity (pw_signal_function *f, char fault[PW_SIGNAL_FAULT]) {
  double t = 0, before[3], after[3];
  if (f->states && f->text.jump && strncmp (f->text.jump, "atan2", 5) != 0)
    return pw_print (fault, PW_SIGNAL_FAULT, "%.60s jumps as states change, and that of a velocity constraint must not",
                     f->text.jump);
  for (int k = 0; k < MAX_CHECKED_BREAKPOINTS; k++) {
    t = pw_yaml_signal_breakpoint (f, t);
    if (t == INFINITY) return fault;
    double last = nextafter (t, -INFINITY);
    signal_derivatives_at (f, last, before);
    signal_derivatives_at (f, t, after);
    for (int i = 0; i < f->derivatives; i++)
      if (fabs (after[i] - before[i]) >
          1e-9 * signal_magnitude (f, t, i) + 2 * (t - last) * (fabs (after[i + 1]) + fabs (before[i + 1])))
        return pw_print (fault, PW_SIGNAL_FAULT,
                         "its %s jumps from %.6g to %.6g at t = %.9g s, and that of %s must not", i ? "rate" : "value",
                         before[i], after[i], t,
                         f->derivatives > 1 ? "a prescribed position" : "a velocity constraint");
  }
  return fault;
}
