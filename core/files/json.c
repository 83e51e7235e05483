/* Writes JSON item by item, and the summary of a run. */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <string.h>
#include "files.h"

/* Before an item or the end of a container: a new line, indented by depth, or the text used within a line. */
static void json_separator (pw_json *j, int depth, const char *within_line) {
  if (j->depth <= j->lines || j->line)
    fprintf (j->f, "\n%*s", 2 * depth, "");
  else
    fputs (within_line, j->f);
  j->line = 0;
}

/* Bytes that are not UTF-8 become U+FFFD, the replacement character. */
static void json_string (FILE *f, const char *text) {
  fputc ('"', f);
  for (int n; *text; text += n ? n : 1) {
    n = pw_utf8_size (text);
    if (*text == '"' || *text == '\\')
      fprintf (f, "\\%c", *text);
    else if (*text == '\n')
      fputs ("\\n", f);
    else if ((unsigned char)*text < ' ' || *text == '<')
      fprintf (f, "\\u%04X", (unsigned)*text);
    else
      fwrite (n ? text : "\xEF\xBF\xBD", 1, (size_t)(n ? n : 3), f);
  }
  fputc ('"', f);
}

/* Begins an item.  0 if j is NULL: nothing is written. */
static int json_item (pw_json *j, const char *key) {
  if (j == NULL) return 0;
  if (j->items++ > 0) fputc (',', j->f);
  if (j->depth > 0) json_separator (j, j->depth, j->items > 1 ? " " : "");
  if (key) json_string (j->f, key), fputs (": ", j->f);
  return 1;
}

void pw_json_open (pw_json *j, const char *key, char bracket) {
  if (!json_item (j, key)) return;
  fputc (bracket, j->f);
  j->depth++;
  j->items = 0;
}

void pw_json_close (pw_json *j, char bracket) {
  if (j == NULL) return;
  if (j->items > 0 || j->line) json_separator (j, j->depth - 1, "");
  fputc (bracket, j->f);
  if (--j->depth == 0) fputc ('\n', j->f);
  j->items = 1;
}

void pw_json_text (pw_json *j, const char *key, const char *text) {
  if (json_item (j, key)) text ? json_string (j->f, text) : (void)fputs ("null", j->f);
}

void pw_json_number (pw_json *j, const char *key, double value) {
  char text[32];
  if (!json_item (j, key)) return;
  fputs (isfinite (value) ? pw_format (text, value, j->digits ? j->digits : 17) : "null", j->f);
}

void pw_json_numbers (pw_json *j, const char *key, const double *value, int count) {
  pw_json_open (j, key, '[');
  for (int i = 0; i < count; i++) pw_json_number (j, NULL, value[i]);
  pw_json_close (j, ']');
}

void pw_json_flag (pw_json *j, const char *key, int value) {
  if (json_item (j, key)) fputs (value ? "true" : "false", j->f);
}

static void json_value (pw_json *j, const char *key, const char **at, va_list *arguments) {
  const int is_long = (*at)[1] == 'l';
  const char type = (*at)[1 + is_long];
  *at += 2 + is_long;
  if (type == 's')
    pw_json_text (j, key, va_arg (*arguments, const char *));
  else if (type == 'i')
    pw_json_flag (j, key, va_arg (*arguments, int));
  else if (type == 'g')
    pw_json_number (j, key, va_arg (*arguments, double));
  else
    pw_json_number (j, key, is_long ? (double)va_arg (*arguments, long) : va_arg (*arguments, int));
}

void pw_json_print (pw_json *j, const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  for (const char *at = format; *(at += strspn (at, ", "));) {
    char key[40];
    const size_t n = strspn (at, "abcdefghijklmnopqrstuvwxyz0123456789_");
    snprintf (key, sizeof key, "%.*s", (int)n, at);
    if (n) at += n + strspn (at + n, ": ");
    if (*at == '%') {
      json_value (j, n ? key : NULL, &at, &arguments);
      continue;
    }
    if (*at == '{' || *at == '[')
      pw_json_open (j, n ? key : NULL, *at);
    else if (*at != '\n')
      pw_json_close (j, *at);
    else if (j)
      j->line = 1;
    at++;
  }
  va_end (arguments);
}

static void json_bodies (pw_json *j, const pw_system *s, const pw_sample *x) {
  static const char *const names[] = { "x", "y", "phi", "vx", "vy", "omega" };
  pw_json_open (j, "bodies", '{');
  for (int b = 0; b < pw_system_bodies (s); b++) {
    pw_json_open (j, pw_system_body_name (s, b), '{');
    for (int i = 0; i < 6; i++) pw_json_number (j, names[i], i < 3 ? x->q[3 * b + i] : x->v[3 * b + i - 3]);
    pw_json_close (j, '}');
  }
  pw_json_close (j, '}');
}

/* Internal coordinates "ELEMENT.NAME" and their velocities, one object per element. */
static void json_elements (pw_json *j, const pw_system *s, const pw_sample *x) {
  char element[300] = "";
  int n = pw_system_coordinates (s), first = 3 * pw_system_bodies (s), end = n - pw_system_states (s);
  if (end == first) return;
  pw_json_open (j, "elements", '{');
  for (int i = first; i < end; i++) {
    char *name = PW_NAME (pw_system_state_name, s, i), *dot = strrchr (name, '.');
    *dot = 0;
    if (strcmp (element, name) != 0) {
      if (*element) pw_json_close (j, '}');
      strcpy (element, name);
      pw_json_open (j, element, '{');
    }
    pw_json_number (j, dot + 1, x->q[i]);
    pw_json_number (j, strrchr (PW_NAME (pw_system_state_name, s, n + i), '.') + 1, x->v[i]);
  }
  pw_json_close (j, '}');
  pw_json_close (j, '}');
}

/* The columns of a type from `first` on. */
static void json_columns (pw_json *j, const char *key, const pw_system *s, pw_column_type type, int first, int count,
                          const double *value) {
  pw_json_open (j, key, '{');
  for (int i = 0; i < count; i++)
    pw_json_number (j, PW_NAME (pw_system_column_name, s, ((pw_column){ type, first + i })),
                    type == PW_COLUMN_REACTION ? 0 - value[i] : value[i]);
  pw_json_close (j, '}');
}

/* Opens an object for what is known; if that is NULL, writes null and returns 0. */
static int json_object (pw_json *j, const char *key, const void *known) {
  known ? pw_json_open (j, key, '{') : pw_json_text (j, key, NULL);
  return known != NULL;
}

/* An object of numbers; null without values. */
static void json_numbers (pw_json *j, const char *key, const char *const *name, const double *value, int count) {
  if (!json_object (j, key, value)) return;
  for (int i = 0; i < count; i++) pw_json_number (j, name[i], value[i]);
  pw_json_close (j, '}');
}

static void json_sample (pw_json *j, const pw_system *s, const pw_sample *x, int ledger) {
  static const char *const names[] = { "kinetic", "potential", "work", "loss", "projection", "balance" };
  if (s == NULL || x == NULL) {
    for (const char *const *key = (const char *const[]){ "t", "bodies", "reactions", "energy", NULL }; *key; key++)
      pw_json_text (j, *key, NULL);
    return;
  }
  pw_json_number (j, "t", x->t);
  json_bodies (j, s, x);
  json_elements (j, s, x);
  const int n = pw_system_coordinates (s), states = pw_system_states (s), outputs = pw_system_outputs (s);
  if (states > 0) json_columns (j, "states", s, PW_COLUMN_STATE, 2 * n - states, states, x->v + n - states);
  json_columns (j, "reactions", s, PW_COLUMN_REACTION, 0, pw_system_rows (s), x->lambda);
  if (outputs > 0) json_columns (j, "outputs", s, PW_COLUMN_OUTPUT, 0, outputs, x->output);
  const double energy[] = { x->kinetic, x->potential, x->work, x->loss, x->projection, x->balance };
  json_numbers (j, "energy", names, ledger ? energy : NULL, 6);
}

static void json_events (pw_json *j, const pw_summary *summary, const pw_system *s) {
  pw_json_open (j, "events", '[');
  for (const pw_event *e = summary->event; e < summary->event + summary->events; e++) {
    pw_json_print (j, "{t: %g, reaction: %s, from: %s, to: %s", e->t, PW_NAME (pw_system_reaction_name, s, e->row),
                   pw_system_mode_name (s, e->row, e->from), pw_system_mode_name (s, e->row, e->to));
    if (e->impact) pw_json_number (j, "impulse", e->impulse);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

static void json_reference (pw_json *j, const pw_reference_error *e) {
  static const char *const names[] = { "length", "angle", "speed", "rate" };
  if (!json_object (j, "truth", e)) return;
  pw_json_print (j, "source: %s, samples: %d, t: %g", e->source, e->samples, e->t);
  json_numbers (j, "end", names, e->end, 4);
  json_numbers (j, "largest", names, e->most, 4);
  pw_json_number (j, "reactions", e->reactions);
  pw_json_close (j, '}');
}

static void json_errors (pw_json *j, const char *key, const pw_system *s, const pw_stated_error *e,
                         const double *value) {
  if (!json_object (j, key, e->unknown ? NULL : e)) return;
  for (int i = 0; i < e->columns; i++)
    if (!isnan (value[i])) pw_json_number (j, PW_NAME (e->name, s, i), value[i]);
  pw_json_close (j, '}');
}

static void json_stated (pw_json *j, const pw_system *s, const pw_stated_error *e) {
  if (!json_object (j, "error", e)) return;
  pw_json_print (j, "repeated: %s, unknown: %s, t: %g", e->repeated, e->unknown, e->t);
  json_errors (j, "end", s, e, e->end);
  json_errors (j, "largest", s, e, e->largest);
  pw_json_close (j, '}');
}

static void json_statistics (pw_json *j, const pw_statistics *n, double cpu) {
  static const char *const residuals[] = { "position", "velocity" };
  json_numbers (j, "residual", residuals, n ? (const double[]){ n->position, n->velocity } : NULL, 2);
  if (!json_object (j, "statistics", n)) return;
#define JSON_COUNT(name) pw_json_number (j, #name, (double)n->name);
  PW_STATISTICS_COUNTS (JSON_COUNT)
  pw_json_number (j, "cpu_s", cpu);
  pw_json_close (j, '}');
}

int pw_json_write (const pw_summary *summary, const pw_system *s, const pw_sample *sample, int ledger,
                   const pw_statistics *statistics, pw_output *o, pw_error *error) {
  if (pw_require (summary, "a summary", error) != PW_OK || pw_require (o, "an output", error) != PW_OK) return PW_INPUT;
  pw_json j = { .f = pw_output_stream (o), .lines = 99 /* all levels */ };
  errno = 0;
  const char *engine = summary->general == NULL ? NULL : *summary->general ? "general" : "specialised";
  pw_json_print (&j, "{schema: %d, model: %s, method: %s, status: %s, reason: %s, engine: %s, engine_reason: %s", 1,
                 summary->model, summary->method, summary->status, summary->reason, engine, summary->general);
  json_sample (&j, s, sample, ledger);
  if (summary->of) pw_json_open (&j, "of", '{');
  for (int i = 0; summary->of && summary->of[i]; i++)
    pw_json_number (&j, summary->of[i], summary->of_value ? summary->of_value[i] : NAN);
  if (summary->of) pw_json_close (&j, '}');
  if (summary->until)
    pw_json_text (&j, "stopped",
                  isnan (summary->stop_time) ? NULL
                                             : PW_PRINTED (400, "%.300s at t = %s s", summary->until,
                                                           pw_format ((char[32]){ 0 }, summary->stop_time, 17)));
  pw_json_number (&j, "unbalanced", summary->energy_defect);
  pw_json_open (&j, "redundant", '[');
  for (const char *const *text = summary->redundant; text && *text; text++) pw_json_text (&j, NULL, *text);
  pw_json_print (&j, "], differences: [");
  for (int i = 0, n = s ? pw_system_differences (s) : 0; i < n; i++)
    pw_json_text (&j, NULL, PW_NAME (pw_system_difference_name, s, i));
  pw_json_close (&j, ']');
  if (s && pw_system_limited (s)) json_events (&j, summary, s);
  json_reference (&j, summary->reference);
  json_stated (&j, s, summary->stated);
  json_statistics (&j, statistics, summary->cpu);
  pw_json_close (&j, '}');
  return pw_output_check (o, error);
}
