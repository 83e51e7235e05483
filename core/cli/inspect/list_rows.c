/* Rows in columns: what a field is called, what it is, whether it may be left out, what it means. */
#include <stdio.h>
#include <string.h>
#include "list.h"

enum { ROWS_WIDTH = 110 }; /* of a line, where the last column leaves room for it */

/* ---- Filling ---- */

void pw_list_add (pw_list_rows *x, const char *name, const char *type, const char *given, const char *about) {
  if (x->rows == PW_LIST_ROWS) return;
  pw_list_row *r = &x->row[x->rows++];
  snprintf (r->name, sizeof r->name, "%s", name);
  snprintf (r->type, sizeof r->type, "%s", type);
  snprintf (r->given, sizeof r->given, "%s", given);
  r->about = about;
}

/* "required", or what is taken if nothing is written; for a number also what it may be, for a choice all there are. */
static void rows_given (const pw_field *f, char *text, size_t size) {
  static const char *const zero[] = { "0", "[0, 0]", "[0, 0]", "", "0", "" };
  static const char *const domain[] = { "", " (>= 0)", " (> 0)", " (1, 2, ...)" };
  snprintf (text, size, "%s%s", f->required || f->type == PW_BODY ? "required" : zero[f->type],
            f->type == PW_NUMBER ? domain[f->domain] : "");
  for (int i = 0; f->type == PW_CHOICE && f->choices[i]; i++) {
    size_t used = strlen (text);
    snprintf (text + used, size - used, "%s%s", i ? " | " : f->required ? ": " : "", f->choices[i]);
  }
}

void pw_list_fields (pw_list_rows *x, const pw_field *fields) {
  static const char *const types[] = { "number", "point", "vector", "body", "signal", "choice" };
  for (const pw_field *f = fields; f->name; f++) {
    char type[60], given[80];
    int n = pw_field_count (f) > 1 ? snprintf (type, sizeof type, "%d x ", f->count) : 0;
    n += snprintf (type + n, sizeof type - (size_t)n, "%s", types[f->type]);
    if (f->unit) snprintf (type + n, sizeof type - (size_t)n, " [%s]", f->unit);
    rows_given (f, given, sizeof given);
    pw_list_add (x, f->name, type, given, f->about ? f->about : "");
  }
}

/* ---- Printing ---- */

static void rows_wider (int *width, const char *text) {
  if (*width < (int)strlen (text)) *width = (int)strlen (text);
}

/* Breaks a text between words. */
static void rows_wrap (const char *text, int indent) {
  int room = ROWS_WIDTH - indent > 40 ? ROWS_WIDTH - indent : 40;
  while ((int)strlen (text) > room) {
    int n = room;
    while (n > 0 && text[n] != ' ') n--;
    if (n == 0) break;
    printf ("%.*s\n%*s", n, text, indent, "");
    text += n + 1;
  }
  puts (text);
}

void pw_list_print (pw_list_rows *x) {
  int name = 0, type = 0, given = 0;
  for (const pw_list_row *r = x->row; r < x->row + x->rows; r++) {
    rows_wider (&name, r->name);
    rows_wider (&type, r->type);
    rows_wider (&given, r->given);
  }
  for (const pw_list_row *r = x->row; r < x->row + x->rows; r++) {
    int indent = printf ("      %-*s  %-*s  ", name, r->name, type, r->type);
    if (given) indent += printf ("%-*s  ", given, r->given);
    rows_wrap (r->about, indent);
  }
  x->rows = 0;
}
