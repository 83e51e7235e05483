/* Strings of variable length, and the cells of a line of a CSV table. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "text.h"

void pw_text_clear (pw_text *t) {
  t->length = 0;
  t->failed = 0;
  if (t->chars) *t->chars = 0;
}

void pw_text_free (pw_text *t) {
  free (t->chars);
  *t = (pw_text){ .chars = NULL };
}

void pw_text_add_bytes (pw_text *t, const char *bytes, size_t count) {
  if (pw_grow (&t->chars, t->length + count, &t->room, 1) != PW_OK) {
    t->failed = 1;
    return;
  }
  memcpy (t->chars + t->length, bytes, count);
  t->length += count;
  t->chars[t->length] = 0;
}

void pw_text_add (pw_text *t, const char *text) {
  pw_text_add_bytes (t, text, strlen (text));
}

void pw_text_cell (pw_text *t, const char *text) {
  if (t->length) pw_text_add (t, ",");
  pw_text_add (t, text);
}

void pw_text_number (pw_text *t, double value) {
  pw_text_cell (t, isfinite (value) ? PW_DIGITS (value, 17) : "nan");
}

void pw_text_name (pw_text *t, const char *name, const char *unit) {
  pw_text_cell (t, name);
  if (unit == NULL || *unit == 0) return;
  pw_text_add (t, " [");
  pw_text_add (t, unit);
  pw_text_add (t, "]");
}

void pw_text_quoted (pw_text *t, const char *text) {
  pw_text_cell (t, "\"");
  for (; *text; text++) {
    if (*text == '"') pw_text_add (t, "\"");
    pw_text_add_bytes (t, *text == '\n' || *text == '\r' ? " " : text, 1);
  }
  pw_text_add (t, "\"");
}

int pw_text_line (pw_text *t, FILE *f, const char *folder, pw_error *error) {
  pw_text_add (t, "\n");
  int failed = t->failed, not_written = !failed && (fputs (t->chars, f) < 0 || fflush (f) != 0);
  pw_text_free (t);
  if (failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (not_written) return pw_fail (error, PW_RESOURCE, "cannot write into %s: %s", folder, strerror (errno));
  return PW_OK;
}

void pw_cli_abandon_table (pw_output *o, long rows, char *part, size_t size) {
  *part = 0;
  if (rows > 0)
    pw_output_abandon (o, part, size);
  else
    pw_output_discard (o);
}

int pw_cli_close_table (pw_output *o, int status, pw_error *error) {
  char part[4200];
  if (status == PW_OK) return pw_output_finish (o, error);
  pw_output_abandon (o, part, sizeof part);
  pw_cli_say ("pinwheel: the table so far is kept in %s\n", part);
  return status;
}
