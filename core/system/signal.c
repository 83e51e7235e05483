/* Signals: values, first two time derivatives and breakpoints of each form; their fields and checks. */
#include <string.h>
#include "system.h"

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

/* Tables: signals that interpolate points (t_i, y_i).
 *
 *   u = y_i + b_i x + M_i x^2 / 2 + (M_j - M_i) x^3 / (6 h_i),   x = t - t_i,  j = i + 1,  h_i = t_j - t_i
 *
 * between two points; outside, the signal is constant.  b_i and M_i are the first and second derivative just after t_i.
 * In a cubic table the M_i make the first derivative continuous (de Boor 2001, A Practical Guide to Splines, chapter
 * IV):
 *
 *   h_k M_k + 2 (h_k + h_i) M_i + h_i M_j = 6 ((y_j - y_i) / h_i - (y_i - y_k) / h_k),   k = i - 1
 *
 * With free ends the first two intervals share one cubic, and so do the last two ("not a knot"); with ends at rest the
 * first derivative is 0 at both.  A linear table has M = 0. */

/* Row i of the equations for M: coefficients of M_k, M_i and M_j, and the right-hand side.  At free ends the formula of
 * table_extrapolate has eliminated M_0 and M_(n-1). */
static void table_row (const double *t, const double *y, int n, int ends, int i, double row[4]) {
  double before = i > 0 ? t[i] - t[i - 1] : 0, after = i < n - 1 ? t[i + 1] - t[i] : 0;
  double slope_before = i > 0 ? (y[i] - y[i - 1]) / before : 0, slope_after = i < n - 1 ? (y[i + 1] - y[i]) / after : 0;
  row[0] = before;
  row[1] = 2 * (before + after);
  row[2] = after;
  row[3] = 6 * (slope_after - slope_before);
  if (ends == PW_ENDS_REST) return;
  if (i == 1) row[1] += before + before * (before / after), row[2] -= before * (before / after);
  if (i == n - 2) row[1] += after + after * (after / before), row[0] -= after * (after / before);
}

static double table_extrapolate (double t0, double t1, double t2, double M1, double M2) {
  return M1 + (M1 - M2) * ((t1 - t0) / (t2 - t1));
}

/* Solves the tridiagonal equations for M without pivoting; they are diagonally dominant.  `upper`: memory for n
 * numbers, the upper diagonal after elimination. */
static void table_second_derivatives (const double *t, const double *y, int n, int ends, double *M, double *upper) {
  int first = ends == PW_ENDS_REST ? 0 : 1, last = n - 1 - first;
  double row[4];
  for (int i = first; i <= last; i++) {
    table_row (t, y, n, ends, i, row);
    double pivot = row[1] - (i > first ? row[0] * upper[i - 1] : 0);
    upper[i] = row[2] / pivot;
    M[i] = (row[3] - (i > first ? row[0] * M[i - 1] : 0)) / pivot;
  }
  for (int i = last - 1; i >= first; i--) M[i] -= upper[i] * M[i + 1];
  if (ends == PW_ENDS_REST) return;
  M[0] = table_extrapolate (t[0], t[1], t[2], M[1], M[2]);
  M[n - 1] = table_extrapolate (t[n - 1], t[n - 2], t[n - 3], M[n - 2], M[n - 3]);
}

void pw_table_spline (const pw_signal *s, double *spline) {
  const double *t = s->table.t, *y = s->table.value;
  int n = s->table.count;
  double *b = spline, *M = spline + n;
  memset (spline, 0, 2 * (size_t)n * sizeof *spline);
  if (s->table.interpolation == PW_CUBIC) table_second_derivatives (t, y, n, s->table.ends, M, b);
  for (int i = 0; i < n - 1; i++) {
    double h = t[i + 1] - t[i];
    b[i] = (y[i + 1] - y[i]) / h - h * (2 * M[i] + M[i + 1]) / 6;
  }
}

static int table_passed (const pw_signal *s, double t) {
  int low = 0, high = s->table.count;
  while (low < high) {
    int middle = low + (high - low) / 2;
    if (s->table.t[middle] <= t)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

static void table_eval (const pw_signal *s, const double *spline, double t, double u[3]) {
  int n = s->table.count, passed = table_passed (s, t), i = passed - 1;
  u[0] = s->table.value[i < 0 ? 0 : i];
  u[1] = u[2] = 0;
  if (passed == 0 || passed == n) return;
  double x = t - s->table.t[i], b = spline[i], M = spline[n + i];
  double third_derivative = (spline[n + i + 1] - M) / (s->table.t[i + 1] - s->table.t[i]);
  u[0] += x * (b + x * (M / 2 + x * (third_derivative / 6)));
  u[1] = b + x * (M + x * (third_derivative / 2));
  u[2] = M + x * third_derivative;
}

/* At each point of a linear table, and at the ends of a cubic one, the first or the second derivative jumps; at the
 * other points of a cubic table the second derivative has a kink. */
static double table_breakpoint (const pw_signal *s, int kinks, double t) {
  int n = s->table.count, next = table_passed (s, t);
  if (next == n) return INFINITY;
  int in_spline = s->table.interpolation == PW_CUBIC && next > 0;
  return s->table.t[in_spline && !kinks ? n - 1 : next];
}

/* Bounds of a cubic table between two times: of its pieces by their control points as Bezier curves (de Boor 2001). */
static void table_bounds (const pw_signal *s, const double *spline, double a, double b, double bounds[2]) {
  double before[3], after[3];
  bounds[0] = INFINITY, bounds[1] = -INFINITY;
  for (int i = table_passed (s, a); a < b; i++) {
    const double end = i < s->table.count ? fmin (s->table.t[i], b) : b, third = (end - a) / 3;
    table_eval (s, spline, a, before);
    table_eval (s, spline, nextafter (end, -INFINITY), after); /* at the last point the slope before it */
    const double y[] = { before[0], before[0] + third * before[1], after[0] - third * after[1], after[0] };
    for (int k = 0; k < 4; k++) bounds[0] = fmin (bounds[0], y[k]), bounds[1] = fmax (bounds[1], y[k]);
    a = end;
  }
}

/* Fails if a number that is needed is not finite, or no value is stored: a callback in another language that ends
 * before its first statement may return 0. */
static int signal_function (const pw_source *source, double t) {
  const pw_function *f = &source->signal.function;
  double *u = source->u;
  u[0] = NAN;
  int status = f->eval (f->context, t, source->x, u, source->gradient ? source->x + source->reads : NULL);
  if (status != 0) return status;
  if (source->feedback) u[2] = u[1]; /* then u[1] becomes the rate along the motion */
  return !isfinite (u[0]) || (!source->of_force && !(isfinite (u[1]) && isfinite (u[2])));
}

/* offset + A cos (omega t + phase) and its derivatives, A the amplitude */
static void signal_harmonic (const pw_signal *s, double t, int derivatives, double u[3]) {
  double A = s->harmonic.amplitude, omega = s->harmonic.omega, x = omega * t + s->harmonic.phase, sine, cosine;
  if (!derivatives) {
    u[0] = s->harmonic.offset + A * pw_cos (x);
    return;
  }
  pw_sin_cos (x, &sine, &cosine);
  u[0] = s->harmonic.offset + A * cosine;
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
    table_eval (s, source->spline, t, u);
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

int pw_signal_is_bounded (const pw_source *source) {
  const pw_signal *s = &source->signal;
  if (s->type == PW_TABLE) return s->table.interpolation == PW_CUBIC;
  return s->type == PW_FUNCTION && s->function.range && !source->of_coordinate;
}

void pw_signal_bounds (const pw_source *source, const double *lo, const double *hi, double bounds[2]) {
  const pw_signal *s = &source->signal;
  if (s->type == PW_TABLE)
    table_bounds (s, source->spline, *lo, *hi, bounds);
  else
    s->function.range (s->function.context, lo, hi, bounds);
}

double pw_signal_breakpoint (const pw_signal *s, int kinks, double t) {
  if (s->type == PW_PULSE) return signal_pulse_breakpoint (s, t);
  if (s->type == PW_TABLE) return table_breakpoint (s, kinks, t);
  if (s->type == PW_FUNCTION && s->function.breakpoint) return s->function.breakpoint (s->function.context, t);
  if (s->type != PW_RAMP && s->type != PW_SMOOTH_STEP) return INFINITY;
  double end = s->ramp.start + s->ramp.duration;
  return t < s->ramp.start ? s->ramp.start : t < end ? end : INFINITY;
}

#define FORM_AT(form, member) .name = #member, .offset = offsetof (pw_signal, form.member)

static const pw_field form_harmonic[] = {
  { FORM_AT (harmonic, amplitude), PW_NUMBER, .required = 1, .about = "amplitude" },
  { FORM_AT (harmonic, omega), PW_NUMBER, .unit = "rad/s", .required = 1, .about = "angular frequency" },
  { FORM_AT (harmonic, phase), PW_NUMBER, .unit = "rad", .about = "phase at t = 0" },
  { FORM_AT (harmonic, offset), PW_NUMBER, .about = "mean value" },
  { .name = NULL },
};

static const pw_field form_ramp[] = {
  { FORM_AT (ramp, from), PW_NUMBER, .about = "value before the start" },
  { FORM_AT (ramp, to), PW_NUMBER, .required = 1, .about = "value after the end" },
  { FORM_AT (ramp, start), PW_NUMBER, .unit = "s", .about = "start time" },
  { FORM_AT (ramp, duration), PW_NUMBER, .unit = "s", .required = 1, .domain = PW_POSITIVE, .about = "duration" },
  { .name = NULL },
};

static const pw_field form_pulse[] = {
  { FORM_AT (pulse, height), PW_NUMBER, .required = 1, .about = "height above the offset" },
  { FORM_AT (pulse, start), PW_NUMBER, .unit = "s", .about = "start time of the first pulse" },
  { FORM_AT (pulse, width), PW_NUMBER, .unit = "s", .domain = PW_NONNEGATIVE,
    .about = "duration of a pulse; 0: it never ends" },
  { FORM_AT (pulse, period), PW_NUMBER, .unit = "s", .domain = PW_NONNEGATIVE,
    .about = "time between the starts of two pulses; 0: a single pulse" },
  { FORM_AT (pulse, offset), PW_NUMBER, .about = "value outside the pulses" },
  { .name = NULL },
};

static const char *const form_interpolation[] = { [PW_LINEAR] = "linear", [PW_CUBIC] = "cubic", NULL };
static const char *const form_ends[] = { [PW_ENDS_FREE] = "free", [PW_ENDS_REST] = "rest", NULL };

static const pw_field form_table[] = {
  { FORM_AT (table, interpolation), PW_CHOICE, .choices = form_interpolation,
    .about = "interpolation between the points" },
  { FORM_AT (table, ends), PW_CHOICE, .choices = form_ends,
    .about = "end conditions of a cubic table: free (not-a-knot), or at rest (zero slope)" },
  { FORM_AT (table, scale), PW_NUMBER, .about = "factor of the values, not 0; left out: 1" },
  { FORM_AT (table, offset), PW_NUMBER, .about = "added to the scaled values" },
  { .name = NULL },
};

const pw_signal_form pw_signal_forms[] = {
  { "harmonic", PW_HARMONIC, "offset + amplitude cos (omega t + phase)", form_harmonic },
  { "ramp", PW_RAMP, "from one value to another along a straight line", form_ramp },
  { "smooth-step", PW_SMOOTH_STEP, "from one value to another with continuous first and second derivatives",
    form_ramp },
  { "pulse", PW_PULSE, "a rectangular pulse, once or periodically", form_pulse },
  { "table", PW_TABLE, "interpolation of points (time, value); constant before the first and after the last",
    form_table },
  { .name = NULL },
};

const pw_signal_form *pw_signal_form_of (const pw_signal *s) {
  const pw_signal_form *f = pw_signal_forms;
  while (f->name && f->type != s->type) f++;
  return f->name ? f : NULL;
}

/* These write the fault to `text`, or leave it empty. */
static void form_check_points (const pw_signal *s, int *point, char *text, size_t size) {
  const double *t = s->table.t, *y = s->table.value;
  int cubic = s->table.interpolation == PW_CUBIC, least = cubic && s->table.ends == PW_ENDS_FREE ? 4 : 2;
  if (s->table.count < least || t == NULL || y == NULL) {
    int count = t && y ? s->table.count : 0, used;
    used = snprintf (text, size, "a %s table%s needs at least %d points, found %d", form_interpolation[cubic],
                     least == 4 ? " with free ends" : "", least, count);
    if (s->table.skipped && (size_t)used < size)
      snprintf (text + used, size - (size_t)used, " and %d rows with empty cells", s->table.skipped);
    return;
  }
  for (int i = 0; i < s->table.count && !*text; i++) {
    *point = i;
    if (!isfinite (t[i]) || !isfinite (y[i]))
      snprintf (text, size, "point %d is (%g, %g): expected finite numbers", i + 1, t[i], y[i]);
    else if (!isfinite (pw_table_value (s, i)))
      snprintf (text, size, "point %d: offset + scale * %g is not finite", i + 1, y[i]);
    else if (i > 0 && !(t[i] > t[i - 1]))
      snprintf (text, size, "point %d is at t = %.9g s, after one at %.9g s: expected increasing times", i + 1, t[i],
                t[i - 1]);
    else if (i > 0 && !isfinite ((pw_table_value (s, i) - pw_table_value (s, i - 1)) / (t[i] - t[i - 1])))
      snprintf (text, size, "points %d (%g, %g) and %d (%g, %g): the slope between them is not finite", i, t[i - 1],
                y[i - 1], i + 1, t[i], y[i]);
  }
  if (!*text) *point = -1;
}

/* The form of a signal that jumps or has kinks, for messages; NULL if it has neither or is a function. */
static const char *form_with_kinks (const pw_signal *s) {
  if (s->type == PW_PULSE) return "a pulse";
  if (s->type == PW_RAMP) return "a ramp";
  if (s->type != PW_TABLE) return NULL;
  if (s->table.interpolation == PW_LINEAR) return "a linear table";
  return s->table.ends == PW_ENDS_FREE ? "a cubic table with free ends" : NULL;
}

/* Kinks of prescribed positions and jumps of prescribed velocities would require infinite forces. */
static void form_check_continuity (const pw_signal *s, const pw_kind *kind, char *text, size_t size) {
  const char *form = form_with_kinks (s);
  int jumps = pw_signal_value_may_jump (s);
  if (form == NULL || pw_kind_signals_force (kind)) return;
  if (kind->level == PW_HOLONOMIC)
    snprintf (text, size,
              "%s has %s, and a %s must not: use a smooth-step, a cubic table with ends at rest, a harmonic", form,
              jumps ? "jumps" : "kinks", kind->of_coordinate ? "curve" : "prescribed position");
  else if (jumps)
    snprintf (text, size, "%s jumps, and the signal of a velocity constraint must not: use a ramp or smooth-step",
              form);
}

char *pw_signal_check (const pw_signal *s, const pw_kind *kind, int *point, char *buffer, size_t size) {
  const pw_signal_form *form = pw_signal_form_of (s);
  *buffer = 0;
  *point = -1;
  if (s->type == PW_FUNCTION && s->function.eval == NULL)
    snprintf (buffer, size, "a function signal without eval");
  else if (s->type == PW_FUNCTION && s->function.reads && !pw_kind_signals_force (kind) &&
           !pw_kind_signals_feedback (kind))
    snprintf (buffer, size, "the signal of this constraint may depend on the time only");
  else if (s->type == PW_CONSTANT && !isfinite (s->constant))
    snprintf (buffer, size, "%g: expected a finite number", s->constant);
  else if (!form && s->type != PW_CONSTANT && s->type != PW_FUNCTION)
    snprintf (buffer, size, "signal type %d does not exist", (int)s->type);
  for (const pw_field *f = form ? form->fields : NULL; f && f->name && !*buffer; f++) {
    const void *at = (const char *)s + f->offset; /* a number, or a choice that is 0 or 1 */
    const char *expected = f->type == PW_NUMBER ? pw_domain_check (f->domain, *(const double *)at) : "";
    const int choice = f->type == PW_CHOICE ? *(const int *)at : 0;
    if (*expected) snprintf (buffer, size, "%s = %g: expected %s", f->name, *(const double *)at, expected);
    if (choice < 0 || choice > 1) snprintf (buffer, size, "%s = %d: expected 0 or 1", f->name, choice);
  }
  const pw_pulse *p = s->type == PW_PULSE ? &s->pulse : NULL;
  if (!*buffer && p && p->period > 0 && !(p->width > 0 && p->width < p->period))
    snprintf (buffer, size, "a pulse every %g s: expected a width > 0 and < %g s, found %g s", p->period, p->period,
              p->width);
  if (!*buffer && s->type == PW_TABLE) form_check_points (s, point, buffer, size);
  if (!*buffer) form_check_continuity (s, kind, buffer, size);
  return buffer;
}
