/* pinwheel list kinds, list signals: enough to write a text model by. */
#include <stdio.h>
#include <string.h>
#include "list.h"
#include "util.h"

/* ---- All kinds, a line each ---- */

static void kinds_overview (void) {
  static const struct {
    int acts;
    pw_level level;
    const char *name;
  } part[] = { { 1, PW_HOLONOMIC, "constraints on positions" },
               { 1, PW_NONHOLONOMIC, "constraints on velocities" },
               { 1, PW_FORCE, "forces" },
               { 0, PW_FORCE, "without effect" } };
  puts ("Kinds of element");
  for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
    printf ("  %s\n", part[i].name);
    for (const pw_kind *const *k = pw_kinds; *k; k++)
      if ((*k)->level == part[i].level && pw_kind_acts (*k) == part[i].acts)
        printf ("    %-18s  %s\n", (*k)->name, (*k)->about);
  }
  puts ("`pinwheel list kinds NAME...` tells their fields, `pinwheel list kinds all` those of all");
}

/* ---- All about a kind ---- */

/* One of a field's values, as it is written. */
static const char *kinds_written (const pw_field *f) {
  static const char *const text[] = { "NUMBER", "[X, Y]", "[X, Y]", "BODY", "SIGNAL", "" };
  return f->type == PW_CHOICE ? f->choices[0] : text[f->type];
}

/* The shortest element of the kind a text model may have. */
static void kinds_example (const pw_kind *k) {
  printf ("    - {%s: NAME", k->name);
  for (const pw_field *f = k->fields; f->name; f++) {
    int count = pw_field_count (f);
    if (!f->required && f->type != PW_BODY) continue;
    printf (", %s: %s", f->name, count > 1 ? "[" : "");
    for (int i = 0; i < count; i++) printf ("%s%s", i ? ", " : "", kinds_written (f));
    if (count > 1) putchar (']');
  }
  puts ("}");
}

static void kinds_signals (const pw_kind *k) {
  if (k->signals == 0) return;
  printf ("    a signal: a number, an expression of t%s, or see `pinwheel list signals`\n",
          pw_kind_forced (k) ? " and of states such as BODY.phi" : "");
}

static void kinds_quantities (pw_list_rows *rows, const char *title, const pw_quantity *q, int count) {
  if (count > 0) printf ("    %s\n", title);
  for (int i = 0; i < count; i++) pw_list_add (rows, q[i].name, q[i].unit, q[i].rate ? q[i].rate : "", q[i].about);
  pw_list_print (rows);
}

static void kinds_show (const pw_kind *k) {
  static const char *const level[] = { "force", "constraint on positions", "constraint on velocities" };
  pw_list_rows rows = { .rows = 0 };
  printf ("%s: %s\n    %s", k->name, k->about, pw_kind_acts (k) ? level[k->level] : "without effect");
  if (k->rows) printf (", %d row%s per element", k->rows, k->rows == 1 ? "" : "s");
  puts (k->each_body ? ", acts on every body that has mass" : "");
  kinds_example (k);
  puts ("    fields");
  pw_list_fields (&rows, k->fields);
  pw_list_print (&rows);
  kinds_signals (k);
  kinds_quantities (&rows, "reactions", k->reaction, k->rows);
  kinds_quantities (&rows, "coordinates of its own, and their rates", k->coordinate, k->own);
}

static int kinds_named (const char *name, pw_error *error) {
  char hint[100];
  pw_nearest near = { .sought = name };
  int all = strcmp (name, "all") == 0;
  for (const pw_kind *const *k = pw_kinds; *k; k++) {
    if (all && k > pw_kinds) putchar ('\n');
    if (all || strcmp ((*k)->name, name) == 0) kinds_show (*k);
    if (strcmp ((*k)->name, name) == 0) return PW_OK;
    pw_nearest_try (&near, (*k)->name);
  }
  if (all) return PW_OK;
  return pw_fail (error, PW_INPUT, "there is no kind \"%s\"%s", name, pw_nearest_text (&near, hint, sizeof hint));
}

int pw_list_kinds (int names, const char **name, pw_error *error) {
  if (names == 0) kinds_overview ();
  for (int i = 0; i < names && error->status == PW_OK; i++) {
    if (i > 0) putchar ('\n');
    kinds_named (name[i], error);
  }
  return error->status;
}

/* ---- Signals ---- */

int pw_list_signals (int names, const char **name, pw_error *error) {
  pw_list_rows rows = { .rows = 0 };
  (void)names, (void)name, (void)error;
  puts ("Signals: a number, an expression of time (in C a function), or one of");
  for (const pw_signal_form *s = pw_signal_forms; s->name; s++) {
    printf ("  %s: %s\n", s->name, s->about);
    pw_list_fields (&rows, s->fields);
    if (s->type == PW_TABLE) {
      pw_list_add (&rows, "points", "list", "", "[[TIME, VALUE], ...]; in a text model, or");
      pw_list_add (&rows, "file", "text", "", "a CSV file in the model's folder, and");
      pw_list_add (&rows, "columns", "2 x text", "[1, 2]", "its columns of times and values, names or numbers");
    }
    pw_list_print (&rows);
  }
  return PW_OK;
}
