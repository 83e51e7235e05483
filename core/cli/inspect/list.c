/* pinwheel list: the models, methods and kinds there are. */
#include <stdio.h>
#include <string.h>
#include "list.h"
#include "util.h"

/* ---- Models ---- */

static int list_width (void *context, const char *name, const char *path) {
  int *width = context, n = (int)strlen (name);
  (void)path;
  if (*width < n) *width = n;
  return 0;
}

/* A file that cannot be opened is listed with the reason: the list is where one looks for it. */
static int list_model (void *context, const char *name, const char *path) {
  char folder[1000];
  pw_error error = { 0 };
  pw_file *f = pw_file_open (path, &error);
  const char *about = f ? pw_file_table (f)->about : error.text;
  const int width = *(const int *)context;
  printf ("  %-*s  %s\n  %-*s  %s\n", width, name, about ? about : "", width, "",
          pw_cli_short_path (path, folder, sizeof folder));
  pw_file_close (f);
  return 0;
}

static int list_models (int names, const char **name, pw_error *error) {
  int width = 0;
  (void)names, (void)name;
  puts ("Models");
  int status = pw_file_list (list_width, &width, error);
  if (status == PW_OK) status = pw_file_list (list_model, &width, error);
  if (status == PW_OK && width == 0)
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

static void list_method (const pw_method *m, int options) {
  printf ("  %s  (%s)\n      %s\n", m->name, m->adaptive ? "chooses its steps; --rtol, --atol" : "fixed steps; --step",
          m->about);
  for (const pw_stabilisation *s = m->stabilisations; s && s->name; s++)
    printf ("    +%-12s %s%s\n", s->name, s->about, s == m->stabilisations ? " (if none is named)" : "");
  for (const pw_stabilisation *s = m->refused; s && s->name; s++) printf ("    no %s: %s\n", s->name, s->about);
  for (const pw_option *o = m->options; options && o && o->name; o++) list_option (o);
}

static int list_method_named (const char *name, pw_error *error) {
  char hint[100];
  pw_nearest near = { .sought = name };
  int all = strcmp (name, "all") == 0;
  for (const pw_method *const *m = pw_methods; *m; m++) {
    if (all || strcmp ((*m)->name, name) == 0) list_method (*m, 1);
    if (strcmp ((*m)->name, name) == 0) return PW_OK;
    pw_nearest_try (&near, (*m)->name);
  }
  if (all) return PW_OK;
  return pw_fail (error, PW_INPUT, "there is no integrator \"%s\"%s", name, pw_nearest_text (&near, hint, sizeof hint));
}

static int list_methods (int names, const char **name, pw_error *error) {
  for (int i = 0; i < names && error->status == PW_OK; i++) list_method_named (name[i], error);
  if (names) return error->status;
  puts ("Methods, written INTEGRATOR[+STABILISATION][:OPTION=VALUE]...");
  for (const pw_method *const *m = pw_methods; *m; m++) list_method (*m, 0);
  puts ("`pinwheel list methods NAME...` tells their options, `pinwheel list methods all` those of all");
  return PW_OK;
}

/* ---- */

static int list_what (int words, const char **word, pw_error *error) {
  static const struct {
    const char *name;
    int (*list) (int names, const char **name, pw_error *error);
    int named; /* 1: some of it can be named */
  } part[] = { { "models", list_models, 0 },
               { "methods", list_methods, 1 },
               { "kinds", pw_list_kinds, 1 },
               { "signals", pw_list_signals, 0 } };
  pw_nearest near = { .sought = words ? word[0] : "" };
  for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
    if (words == 0 && i > 0) putchar ('\n');
    int here = words == 0 || strcmp (word[0], part[i].name) == 0;
    if (here && words > 1 && !part[i].named)
      return pw_fail (error, PW_INPUT, "unexpected argument \"%s\"; usage: pinwheel list %s", word[1], part[i].name);
    if (here && part[i].list (words ? words - 1 : 0, words ? word + 1 : word, error) != PW_OK) return error->status;
    if (here && words) return PW_OK;
    pw_nearest_try (&near, part[i].name);
  }
  char hint[100];
  if (words == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "there is no list of \"%s\"%s", word[0], pw_nearest_text (&near, hint, sizeof hint));
}

static int list_command (void *options, pw_error *error) {
  const pw_cli_line *l = options;
  return list_what (l->arguments, l->argument, error);
}

const pw_command pw_cli_list = {
  .name = "list",
  .synopsis = "[models | methods [NAME...] | kinds [NAME...] | signals]",
  .summary = "list models, integration methods, element types and signals",
  .help = "List the available models, integration methods, element types (kinds) and forms of signals. With a NAME or "
          "\"all\", describe the options of a method or the fields of an element type.",
  .size = sizeof (pw_cli_line),
  .function = list_command,
  .options = (const struct poptOption[]){ POPT_TABLEEND },
};
