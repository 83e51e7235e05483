/* pinwheel list: the models, methods and kinds there are. */
#include <stdio.h>
#include <string.h>
#include "cli.h"
#include "signal.h"
#include "util.h"

/* ---- Models ---- */

/* A file that cannot be opened is listed with the reason: the list is where one looks for it. */
static int list_model (void *context, const char *name, const char *path) {
  char folder[1000];
  pw_error error = { 0 };
  pw_file *f = pw_file_open (path, &error);
  const char *about = f ? pw_file_table (f)->about : error.text;
  printf ("  %-16s %s\n  %-16s %s\n", name, about ? about : "", "", pw_cli_short_path (path, folder, sizeof folder));
  pw_file_close (f);
  *(int *)context += 1;
  return 0;
}

static int list_models (pw_error *error) {
  int count = 0;
  puts ("Models");
  int status = pw_file_list (list_model, &count, error);
  if (status == PW_OK && count == 0)
    puts ("  none found; folders named in the environment variable PINWHEEL_MODELS are searched");
  return status;
}

/* ---- Methods ---- */

static void list_option (const pw_option *o) {
  char text[32];
  printf ("    :%s=", o->name);
  for (int i = 0; o->choices && o->choices[i]; i++) printf ("%s%s", i ? "|" : "", o->choices[i]);
  if (o->choices == NULL) printf ("NUMBER%s%s", o->unit && *o->unit ? " " : "", o->unit ? o->unit : "");
  printf ("  (default %s", o->choices ? o->choices[(int)o->value] : pw_format (text, o->value, 6));
  if (o->with) printf ("; with %s", o->with);
  printf (")\n        %s\n", o->about);
}

static void list_method (const pw_method *m) {
  printf ("  %s  (%s)\n      %s\n", m->name, m->adaptive ? "chooses its steps; --rtol, --atol" : "fixed steps; --step",
          m->about);
  for (const pw_stabilisation *s = m->stabilisations; s && s->name; s++)
    printf ("    +%-12s %s%s\n", s->name, s->about, s == m->stabilisations ? " (if none is named)" : "");
  for (const pw_option *o = m->options; o && o->name; o++) list_option (o);
}

static int list_methods (pw_error *error) {
  (void)error;
  puts ("Methods, written INTEGRATOR[+STABILISATION][:OPTION=VALUE]...");
  for (const pw_method *const *m = pw_methods; *m; m++) list_method (*m);
  return PW_OK;
}

/* ---- Kinds ---- */

static const char *const list_types[] = { "number", "point", "vector", "body", "signal", "choice" };

static void list_default (const pw_field *f) {
  static const char *const zero[] = { "0", "(0, 0)", "(0, 0)", "", "0" };
  if (f->required)
    printf ("required");
  else
    printf ("default %s", f->type == PW_CHOICE ? f->choices[0] : zero[f->type]);
}

static void list_field (const pw_field *f) {
  char type[40];
  if (f->count > 1)
    snprintf (type, sizeof type, "%d x %s", f->count, list_types[f->type]);
  else
    snprintf (type, sizeof type, "%s", list_types[f->type]);
  if (f->unit) snprintf (type + strlen (type), sizeof type - strlen (type), " [%s]", f->unit);
  printf ("      %-12s %-17s %s; ", f->name, type, f->about);
  list_default (f);
  static const char *const domain[] = { "", "; >= 0", "; > 0", "; a whole number >= 1" };
  if (f->type == PW_NUMBER) printf ("%s", domain[f->domain]);
  for (int i = 0; f->type == PW_CHOICE && f->choices[i]; i++) printf ("%s%s", i ? ", " : "; one of ", f->choices[i]);
  putchar ('\n');
}

static void list_kind (const pw_kind *k) {
  static const char *const level[] = { "no constraint", "position constraint", "velocity constraint" };
  printf ("  %s: %s\n    %s", k->name, k->about, level[k->level]);
  if (k->rows) printf (", %d row%s per element", k->rows, k->rows == 1 ? "" : "s");
  if (k->each_body) printf (", acts on every body that has mass");
  puts ("\n    fields");
  for (const pw_field *f = k->fields; f->name; f++) list_field (f);
  if (k->rows) puts ("    reactions");
  for (int i = 0; i < k->rows; i++)
    printf ("      %-12s %-17s %s\n", k->reaction[i].name, k->reaction[i].unit, k->reaction[i].about);
  if (k->own) puts ("    coordinates of its own");
  for (int i = 0; i < k->own; i++)
    printf ("      %-12s %-17s %s; its rate: %s\n", k->coordinate[i].name, k->coordinate[i].unit,
            k->coordinate[i].about, k->coordinate[i].rate);
}

static int list_kinds (pw_error *error) {
  (void)error;
  puts ("Kinds of element");
  for (const pw_kind *const *k = pw_kinds; *k; k++) list_kind (*k);
  return PW_OK;
}

/* ---- Signals ---- */

static void list_points (void) {
  puts ("      points       list              [[TIME, VALUE], ...]; in a text model, or\n"
        "      file         text              a CSV file in the model's folder, and\n"
        "      columns      2 x text          its columns of times and values, names or numbers; default [1, 2]");
}

static int list_signals (pw_error *error) {
  (void)error;
  puts ("Signals: a number, an expression of time (in C a function), or one of");
  for (const pw_signal_form *s = pw_signal_forms; s->name; s++) {
    printf ("  %s: %s\n", s->name, s->about);
    for (const pw_field *f = s->fields; f->name; f++) list_field (f);
    if (s->type == PW_TABLE) list_points ();
  }
  return PW_OK;
}

/* ---- */

static int list_what (const char *what, pw_error *error) {
  static const struct {
    const char *name;
    int (*list) (pw_error *error);
  } part[] = {
    { "models", list_models }, { "methods", list_methods }, { "kinds", list_kinds }, { "signals", list_signals }
  };
  pw_nearest near = { .sought = what ? what : "" };
  for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
    if (what == NULL && i > 0) putchar ('\n');
    int here = what == NULL || strcmp (what, part[i].name) == 0;
    if (here && part[i].list (error) != PW_OK) return error->status;
    if (here && what) return PW_OK;
    pw_nearest_try (&near, part[i].name);
  }
  char hint[100];
  if (what == NULL) return PW_OK;
  return pw_fail (error, PW_INPUT, "there is no list of \"%s\"%s", what, pw_nearest_text (&near, hint, sizeof hint));
}

int pw_cli_list (int argc, const char **argv) {
  static const struct poptOption options[] = { POPT_TABLEEND };
  pw_error error = { 0 };
  pw_cli_line l;
  if (pw_cli_read (&l, argc, argv, options, "[models|methods|kinds|signals]", 0, 1, &error) == PW_OK)
    list_what (l.arguments ? l.argument[0] : NULL, &error);
  pw_cli_close (&l);
  return pw_cli_end (&error);
}
