/* Strings of variable length, and the cells of a line of a CSV table. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel-files.h"
#include "text.h"

void pw_text_clear (pw_text *t) {
  t->used = 0;
  t->failed = 0;
  if (t->at) *t->at = 0;
}

void pw_text_free (pw_text *t) {
  free (t->at);
  *t = (pw_text){ .at = NULL };
}

void pw_text_add_bytes (pw_text *t, const char *bytes, size_t count) {
  if (t->used + count + 1 > t->room) {
    size_t room = 2 * (t->used + count + 1) + 500;
    char *more = realloc (t->at, room);
    if (more == NULL) {
      t->failed = 1;
      return;
    }
    t->at = more;
    t->room = room;
  }
  memcpy (t->at + t->used, bytes, count);
  t->used += count;
  t->at[t->used] = 0;
}

void pw_text_add (pw_text *t, const char *text) {
  pw_text_add_bytes (t, text, strlen (text));
}

static void text_comma (pw_text *t) {
  if (t->used) pw_text_add (t, ",");
}

void pw_text_number (pw_text *t, double value) {
  char number[32];
  text_comma (t);
  pw_text_add (t, isfinite (value) ? pw_format (number, value, 17) : "nan");
}

void pw_text_cell (pw_text *t, const char *text) {
  text_comma (t);
  pw_text_add (t, text);
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
  int failed = t->failed, bad = !failed && (fputs (t->at, f) < 0 || fflush (f) != 0);
  pw_text_free (t);
  if (failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  return bad ? pw_fail (error, PW_RESOURCE, "cannot write into %s: %s", folder, strerror (errno)) : PW_OK;
}

void pw_text_abandon (pw_output *o, long rows, char *part, size_t size) {
  *part = 0;
  if (rows > 0)
    pw_output_abandon (o, part, size);
  else
    pw_output_discard (o);
}

int pw_text_end (pw_output *o, int status, pw_error *error) {
  char part[8];
  if (status == PW_OK) return pw_output_finish (o, error);
  pw_output_abandon (o, part, sizeof part);
  return status;
}
