/* Forms of signals: their fields, and checks of signals. */
#include <math.h>
#include <stdio.h>
#include "signal.h"

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
  { FORM_AT (table, scale), PW_NUMBER, .about = "factor of the values, not 0; omitted: 1" },
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

/* ---- Checks: each writes the fault to `text`, or leaves it empty ---- */

/* Each field is a number, or a choice that is 0 or 1. */
static void form_check_fields (const pw_signal *s, const pw_signal_form *form, char *text, size_t size) {
  for (const pw_field *f = form->fields; f->name && !*text; f++) {
    const void *at = (const char *)s + f->offset;
    const char *expected = f->type == PW_NUMBER ? pw_domain_check (f->domain, *(const double *)at) : "";
    int choice = f->type == PW_CHOICE ? *(const int *)at : 0;
    if (*expected) snprintf (text, size, "%s = %g: expected %s", f->name, *(const double *)at, expected);
    if (choice < 0 || choice > 1) snprintf (text, size, "%s = %d: expected 0 or 1", f->name, choice);
  }
}

static void form_check_pulse (const pw_signal *s, char *text, size_t size) {
  double width = s->pulse.width, period = s->pulse.period;
  if (period > 0 && !(width > 0 && width < period))
    snprintf (text, size, "a pulse every %g s: expected a width > 0 and < %g s, found %g s", period, period, width);
}

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
              "%s has %s, and a prescribed position must not: use a smooth-step, a cubic table with ends at rest, a "
              "harmonic",
              form, jumps ? "jumps" : "kinks");
  else if (jumps)
    snprintf (text, size, "%s jumps, and the signal of a velocity constraint must not: use a ramp or smooth-step",
              form);
}

static void form_check_function (const pw_signal *s, const pw_kind *kind, char *text, size_t size) {
  if (s->function.eval == NULL)
    snprintf (text, size, "a function signal without eval");
  else if (s->function.reads && !pw_kind_signals_force (kind))
    snprintf (text, size, "a constraint's signal may depend on time only");
}

char *pw_signal_check (const pw_signal *s, const pw_kind *kind, int *point, char *buffer, size_t size) {
  const pw_signal_form *form = pw_signal_form_of (s);
  *buffer = 0;
  *point = -1;
  if (s->type == PW_FUNCTION)
    form_check_function (s, kind, buffer, size);
  else if (s->type == PW_CONSTANT && !isfinite (s->constant))
    snprintf (buffer, size, "%g: expected a finite number", s->constant);
  else if (form)
    form_check_fields (s, form, buffer, size);
  else if (s->type != PW_CONSTANT)
    snprintf (buffer, size, "signal type %d does not exist", (int)s->type);
  if (!*buffer && s->type == PW_PULSE) form_check_pulse (s, buffer, size);
  if (!*buffer && s->type == PW_TABLE) form_check_points (s, point, buffer, size);
  if (!*buffer) form_check_continuity (s, kind, buffer, size);
  return buffer;
}
