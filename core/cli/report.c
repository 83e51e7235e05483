/* Messages on a model and its initialisation, before a run, and the end of printed lists. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"

enum {
  REPORT_MESSAGES = 8, /* messages of one kind, or changed states, that are printed at most */
  REPORT_TEXT = 400    /* longest description of a redundant equation, end included */
};

void pw_report_more (FILE *f, int more, const char *hint) {
  if (more > 0) fprintf (f, "  and %d more%s\n", more, hint);
}

/* Angles of more than a turn that are multiples of 0.5: most likely they are degrees, not those of a long run. */
static void report_angle (const char *kind, const char *name, const char *field, double angle) {
  if (!(fabs (angle) > 2 * PW_PI) || fmod (angle, 0.5) != 0) return;
  pw_cli_say ("pinwheel: %s %s: %s = %s rad is more than a turn and ends at %s degrees; if degrees are meant, write "
              "\"*deg\" after the number\n",
              kind, name, field, PW_DIGITS (angle, 6), PW_DIGITS (fmod (angle * 180 / PW_PI, 360), 4));
}

/* A heading that is probably in degrees; expressions that may jump when states change: steps do not end there. */
static void report_field (const pw_element *element, const pw_field *field) {
  const void *value = (const char *)element->definition + field->offset;
  const char *kind = element->kind->name, *name = pw_element_name (element);
  const pw_signal *signal = field->type == PW_SIGNAL ? value : NULL;
  const double *number = signal && signal->type == PW_CONSTANT ? &signal->constant : NULL;
  if (field->type == PW_NUMBER) number = value;
  if (number && strcmp (field->name, "heading") == 0) report_angle (kind, name, field->name, *number);
  for (const pw_signal *s = signal; s && s < signal + pw_field_count (field); s++)
    if (s->type == PW_FUNCTION && s->function.text && s->function.text->jump)
      pw_cli_say (
          "pinwheel: %s %s: %s: \"%.80s\" may jump as states change; steps do not end there, which costs accuracy\n",
          kind, name, field->name, s->function.text->jump);
}

void pw_report_model (const pw_cli_model *m) {
  int elements;
  const pw_system *s = m->system;
  const pw_element *element = pw_model_elements (m->model, &elements);
  for (int i = 0; i < pw_system_bodies (s); i++)
    report_angle ("body", pw_system_body_name (s, i), "initial phi", pw_system_initial_q (s)[3 * i + 2]);
  for (int i = 0; i < elements; i++)
    for (const pw_field *field = element[i].kind->fields; field->name; field++) report_field (&element[i], field);
}

/* States that the consistent initialisation has changed: values that were specified, and those that were left out. */
static void report_initial (pw_run *run, const pw_system *system) {
  const pw_initial_report *initial = pw_run_initial (run);
  int n = pw_system_coordinates (system), changed = 0, listed = 0;
  char rounded[80] = "", reason[300];
  if (initial->moved == 0) return;
  for (int state = 0; state < 2 * n; state++)
    changed += pw_initial_moved (system, initial, state) && pw_initial_specified (initial, state);
  const char *left = PW_COUNTED (initial->moved - changed, "initial value");
  const int counted = changed == 0 && initial->moved > REPORT_MESSAGES; /* and not listed */
  if (initial->rounded)
    snprintf (rounded, sizeof rounded, " (%d by less than 1e-2 of its unit, as if rounded)", initial->rounded);
  if (changed)
    pw_cli_say ("pinwheel: the initial values do not satisfy the constraints: %d %s changed%s%s%s:\n", changed,
                changed == 1 ? "was" : "were", initial->released ? ", including given ones" : "", rounded,
                changed < initial->moved ? PW_PRINTED (80, "; %s left out follow%s from them", left,
                                                       initial->moved - changed == 1 ? "s" : "")
                                         : "");
  else
    pw_cli_say ("pinwheel: %s left out follow%s from the constraints%s\n", left, initial->moved == 1 ? "s" : "",
                counted ? "" : ":");
  if (counted) return;
  for (int specified = 1; specified >= 0; specified--)
    for (int state = 0; state < 2 * n && listed < REPORT_MESSAGES; state++) {
      if (!pw_initial_moved (system, initial, state) || pw_initial_specified (initial, state) != specified) continue;
      const pw_state_change c = pw_cli_state_change (system, initial, state);
      const char *origin = pw_initial_given (initial, state) ? "given" : "specified";
      if (specified) pw_run_initial_reason (run, state, reason, sizeof reason);
      pw_cli_say (specified ? "  %s from %s to" : "  %s =", c.name, PW_DIGITS (c.given, 10));
      pw_cli_say (" %s%s%s", PW_DIGITS (c.consistent, 10), *c.unit ? " " : "", c.unit);
      if (specified) pw_cli_say (" (%s%s%s)", origin, *reason ? "; otherwise " : "", reason);
      pw_cli_say ("\n");
      listed++;
    }
  pw_report_more (stderr, initial->moved - listed, "");
}

int pw_report_initial_state (const pw_cli_model *m, double limit, pw_error *error) {
  pw_error own = { 0 };
  pw_limit seconds = { .seconds = limit };
  const pw_settings settings = { .stop = pw_limit_over, .stop_context = &seconds };
  pw_run *run = pw_limit_open (m->system, "rk4+none", &settings, &own); /* makes no step: any method will do */
  if (run) report_initial (run, m->system);
  pw_run_close (run);
  return own.status == PW_RESOURCE ? pw_fail (error, own.status, "%s", own.text) : PW_OK;
}

void pw_report_initialisation (pw_run *run, const pw_system *system, const char *const *redundant) {
  int differences = pw_system_differences (system), count = 0;
  for (int i = 0; i < differences && i < REPORT_MESSAGES; i++)
    pw_cli_say ("pinwheel: derivatives by differences: %s\n", PW_NAME (pw_system_difference_name, system, i));
  pw_report_more (stderr, differences - REPORT_MESSAGES, "");
  report_initial (run, system);
  for (; redundant && redundant[count]; count++)
    if (count < REPORT_MESSAGES) pw_cli_say ("pinwheel: redundant: %s\n", redundant[count]);
  pw_report_more (stderr, count - REPORT_MESSAGES, "");
  if (count > 0)
    pw_cli_say ("pinwheel: reactions of redundant constraints are not unique: those of least norm are given\n");
}

const char **pw_report_redundancies (pw_run *run) {
  size_t count = (size_t)pw_run_redundant (run);
  const char **text = count > 0 ? malloc ((count + 1) * sizeof *text + count * REPORT_TEXT) : NULL;
  if (text == NULL) return NULL;
  char *buffer = (char *)(text + count + 1);
  for (size_t i = 0; i < count; i++) text[i] = pw_run_redundancy (run, (int)i, buffer + i * REPORT_TEXT, REPORT_TEXT);
  text[count] = NULL;
  return text;
}
