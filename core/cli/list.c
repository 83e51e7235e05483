/* pinwheel list: models, methods, element types and signals. */
#include <errno.h>
#include <string.h>
#include "cli.h"

/* Characters of a line whose last column is wrapped; of a line of names; of the heading before the names. */
enum { LIST_WIDTH = 110, LIST_NAMES = 100, LIST_HEADING = 14 };

/* Of each type of field: its name, default (a choice has its first alternative), and value in an example. */
static const struct {
  const char *name, *zero, *example;
} list_types[] = { [PW_NUMBER] = { "number", "0", "NUMBER" },
                   [PW_POINT] = { "point", "[0, 0]", "[X, Y]" },
                   [PW_VECTOR] = { "vector", "[0, 0]", "[X, Y]" },
                   [PW_BODY] = { "body", "", "BODY" },
                   [PW_SIGNAL] = { "signal", "0", "SIGNAL" },
                   [PW_CHOICE] = { "choice", "", "" },
                   [PW_TEXT] = { "text", "", "TEXT" },
                   [PW_TRACK] = { "path", "none", "PATH" } };

/* A row such as "radius  number [m]  required  radius of the wheel", the last column wrapped. */
static void list_row (pw_table *t, const char *name, const char *type, const char *value, const char *about) {
  t->pad = t->indent = 4;
  pw_cell (t, -1, name);
  pw_cell (t, -1, type);
  pw_cell (t, 0, value);
  if (pw_cell (t, 0, "")) pw_cli_print_wrapped (about, t->indent, LIST_WIDTH);
  t->column = t->pad = 0; /* in place of pw_row_end: the wrapped text ends with a newline */
}

static void list_fields (pw_table *t, const pw_field *fields) {
  for (const pw_field *f = fields; f->name; f++) {
    char value[80];
    const char *times = pw_field_count (f) > 1 ? PW_PRINTED (16, "%d x ", f->count) : "",
               *unit = f->unit ? PW_PRINTED (40, " [%s]", f->unit) : "",
               *type = PW_PRINTED (60, "%s%s%s", times, list_types[f->type].name, unit);
    const char *domain = f->type == PW_NUMBER ? pw_domain_text (f->domain) : "";
    snprintf (value, sizeof value, *domain ? "%s (%s)" : "%s",
              f->required || f->type == PW_BODY ? "required" : list_types[f->type].zero, domain);
    for (int i = 0; f->type == PW_CHOICE && f->choices[i]; i++) { /* the alternatives */
      size_t used = strlen (value);
      const char *mark = i || f->required ? "" : " (default)";
      snprintf (value + used, sizeof value - used, "%s%s%s", i ? " | " : f->required ? ": " : "", f->choices[i], mark);
    }
    list_row (t, f->name, type, value, f->about ? f->about : "");
  }
}

/* Describes the entry of each name, or all entries for the name "all".  The first member of an entry is its name;
 * entries and names end with NULL.  `noun`: what an entry is, such as "element type". */
static int list_named (const char *noun, const void *const *entries, void (*describe) (const void *entry),
                       const char **name, pw_error *error) {
  for (int shown = 0; *name; name++) {
    int all = strcmp (*name, "all") == 0, found = all;
    pw_nearest near = { .sought = *name };
    for (const void *const *entry = entries; *entry; entry++) {
      const char *known = *(const char *const *)*entry;
      pw_nearest_try (&near, known);
      if (!all && strcmp (known, *name) != 0) continue;
      if (shown++ > 0) putchar ('\n');
      describe (*entry);
      found = 1;
    }
    if (!found) return pw_fail (error, PW_INPUT, "there is no %s \"%s\"%s", noun, *name, pw_nearest_text (&near));
  }
  return PW_OK;
}

static int list_longest (void *context, const char *name, const char *path) {
  int *width = context, length = (int)strlen (name);
  (void)path;
  if (*width < length) *width = length;
  return 0;
}

/* A file that cannot be opened is listed with the reason. */
static int list_model (void *context, const char *name, const char *path) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open (path, &error);
  const char *about = f ? pw_file_table (f)->about : error.text;
  const int width = *(const int *)context;
  pw_cli_print (stdout, "  %-*s  %s\n  %-*s  %s\n", width, name, about ? about : "", width, "",
                pw_cli_short_path (path));
  pw_file_close (f);
  return 0;
}

static const char list_none[] = " none found; folders named in the environment variable PINWHEEL_MODELS are searched";

static int list_models (const char **name, pw_error *error) {
  int width = 0;
  (void)name;
  puts ("Models");
  int status = pw_file_list (list_longest, &width, error);
  if (status == PW_OK) status = pw_file_list (list_model, &width, error);
  if (status == PW_OK && width == 0) printf (" %s\n", list_none);
  return status;
}

static void list_method (const pw_method *m) {
  printf ("  %s  (%s)\n      %s\n", m->name, m->adaptive ? "adaptive steps; --rtol, --atol" : "fixed steps; --step",
          m->about);
  for (const pw_stabilisation *s = m->stabilisations; s->name; s++)
    printf ("    +%-12s %s%s\n", s->name, s->about, s == m->stabilisations ? " (default)" : "");
  for (const pw_stabilisation *s = m->refused; s && s->name; s++) printf ("    no %s: %s\n", s->name, s->about);
}

static void list_method_options (const void *entry) {
  const pw_method *m = entry;
  list_method (m);
  for (const pw_option *o = m->options; o && o->name; o++) {
    printf ("    :%s=", o->name);
    for (int i = 0; o->choices && o->choices[i]; i++) printf ("%s%s", i ? "|" : "", o->choices[i]);
    if (o->choices == NULL) printf ("NUMBER%s%s", o->unit && *o->unit ? " " : "", o->unit ? o->unit : "");
    printf ("  (default %s", o->choices ? o->choices[(int)o->value] : PW_DIGITS (o->value, 6));
    if (o->with) printf ("; with %s", o->with);
    printf (")\n        %s\n", o->about);
  }
}

static int list_methods (const char **name, pw_error *error) {
  if (*name) return list_named ("integrator", (const void *const *)pw_methods, list_method_options, name, error);
  puts ("Methods, written INTEGRATOR[+STABILISATION][:OPTION=VALUE]...");
  for (const pw_method *const *m = pw_methods; *m; m++) list_method (*m);
  puts ("`pinwheel list methods NAME...` shows the options of a method, `pinwheel list methods all` those of all");
  return PW_OK;
}

static void list_quantities (const char *title, const pw_quantity *q, int count) {
  if (count > 0) printf ("    %s\n", title);
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < count; i++) list_row (&t, q[i].name, q[i].unit, q[i].rate ? q[i].rate : "", q[i].about);
}

static void list_kind (const void *entry) {
  static const char *const level[] = { "force", "constraint on positions", "constraint on velocities" };
  const pw_kind *k = entry;
  printf ("%s: %s\n    %s", k->name, k->about, pw_kind_acts (k) ? level[k->level] : "without effect");
  if (k->rows) printf (", %s per element", PW_COUNTED (k->rows, "constraint equation"));
  puts (k->each_body ? ", acts on every body that has mass" : "");
  /* the shortest element of the type in a text model */
  printf ("    - {%s: NAME", k == &pw_kind_state ? "name" /* in the list of states */ : k->name);
  for (const pw_field *f = k->fields; f->name; f++) {
    int count = pw_field_count (f);
    if (!f->required && f->type != PW_BODY) continue;
    printf (", %s: %s", f->name, count > 1 ? "[" : "");
    for (int i = 0; i < count; i++)
      printf ("%s%s", i ? ", " : "", f->type == PW_CHOICE ? f->choices[0] : list_types[f->type].example);
    if (count > 1) putchar (']');
  }
  puts ("}");
  puts ("    fields");
  for (pw_table t = { 0 }; pw_table_pass (&t);) list_fields (&t, k->fields);
  if (k->signals)
    printf ("    a signal is a number, an expression of t%s, or a form of `pinwheel list signals`\n",
            pw_kind_signals_force (k)      ? " and of states such as BODY.phi"
            : pw_kind_signals_feedback (k) ? ", of positions and first-order states"
                                           : "");
  for (const pw_field *f = k->fields; f->name; f++)
    if (f->limit) {
      puts ("    a limit: a signal that may depend on states; or {mu: NUMBER, load: SIGNAL}, their product");
      break;
    }
  list_quantities ("reactions", k->reaction, k->rows);
  if (k != &pw_kind_state) list_quantities ("internal coordinates, and their velocities", k->coordinate, k->internal);
}

static int list_kinds (const char **name, pw_error *error) {
  static const struct {
    int acts;
    pw_level level;
    const char *title;
  } section[] = { { 1, PW_HOLONOMIC, "constraints on positions" },
                  { 1, PW_NONHOLONOMIC, "constraints on velocities" },
                  { 1, PW_FORCE, "forces" },
                  { 0, PW_FORCE, "without effect" } };
  if (*name) return list_named ("element type", (const void *const *)pw_kinds, list_kind, name, error);
  puts ("Element types, or kinds.  A model names them in its list of elements.");
  for (size_t i = 0; i < sizeof section / sizeof *section; i++) {
    printf ("  %s\n", section[i].title);
    for (const pw_kind *const *k = pw_kinds; *k; k++)
      if ((*k)->level == section[i].level && pw_kind_acts (*k) == section[i].acts)
        printf ("    %-18s  %s\n", (*k)->name, (*k)->about);
  }
  puts ("`pinwheel list kinds NAME...` shows the fields of a type, `pinwheel list kinds all` those of all");
  return PW_OK;
}

static int list_signals (const char **name, pw_error *error) {
  (void)name, (void)error;
  puts ("A signal is a number, an expression of time (in C a function), or one of these forms:");
  for (const pw_signal_form *s = pw_signal_forms; s->name; s++) {
    printf ("  %s: %s\n", s->name, s->about);
    for (pw_table t = { 0 }; pw_table_pass (&t);) {
      list_fields (&t, s->fields);
      if (s->type != PW_TABLE) continue; /* the rest is in text models alone */
      list_row (&t, "points", "list", "", "[[TIME, VALUE], ...]; this and what follows are in text models only");
      list_row (&t, "file", "text", "", "CSV file in the model's folder, in place of `points`");
      list_row (&t, "columns", "2 x text", "[1, 2]", "names or numbers of its columns of times and values");
      list_row (&t, "time", "text", "1", "its column of times; `columns` then names the column of values");
      list_row (&t, "time_scale", "number", "1 (> 0)", "factor of the times, such as 1e-3 for ms");
      list_row (&t, "time_offset", "number [s]", "0", "added to the scaled times");
    }
  }
  return PW_OK;
}

/* ---- Without arguments: the names, on one screen ---- */

/* Prints a name.  *column: length of the line so far; printf counts the newline before it, too, hence - 1. */
static void list_name (int *column, const char *name) {
  if (*column + 1 + (int)strlen (name) > LIST_NAMES) *column = printf ("\n%*s", LIST_HEADING, "") - 1;
  *column += printf (" %s", name);
}

static int list_model_name (void *column, const char *name, const char *path) {
  (void)path;
  list_name (column, name);
  return 0;
}

static int list_overview (pw_error *error) {
  int column = printf ("%-*s", LIST_HEADING, "models");
  if (pw_file_list (list_model_name, &column, error) != PW_OK) return error->status;
  puts (column == LIST_HEADING ? list_none : "");
  for (const pw_method *const *m = pw_methods; *m; m++) {
    printf ("%-*s %s", LIST_HEADING, m == pw_methods ? "methods" : "", (*m)->name);
    for (const pw_stabilisation *s = (*m)->stabilisations; s->name; s++) printf (" +%s", s->name);
    putchar ('\n');
  }
  column = printf ("%-*s", LIST_HEADING, "kinds");
  for (const pw_kind *const *k = pw_kinds; *k; k++) list_name (&column, (*k)->name);
  column = printf ("\n%-*s", LIST_HEADING, "signals") - 1;
  for (const pw_signal_form *s = pw_signal_forms; s->name; s++) list_name (&column, s->name);
  puts ("\n`pinwheel list models`, `methods`, `kinds` (element types) or `signals` describes them.");
  return PW_OK;
}

/* ---- The command `list` ---- */

static int list_command (void *options, pw_error *error) {
  static const struct {
    const char *name;
    int (*list) (const char **name, pw_error *error);
    int named; /* 1: accepts names */
  } lists[] = { { "models", list_models, 0 },
                { "methods", list_methods, 1 },
                { "kinds", list_kinds, 1 },
                { "signals", list_signals, 0 },
                { .name = NULL } };
  const pw_cli_line *l = options;
  if (l->arguments == 0) return list_overview (error);
  const char *const sought = l->argument[0];
  char hint[PW_HINT];
  int i = pw_find_name (lists, sizeof *lists, sought, hint);
  if (i < 0) return pw_fail (error, PW_INPUT, "there is no list of \"%s\"%s", sought, hint);
  if (l->arguments > 1 && !lists[i].named)
    return pw_fail (error, PW_INPUT, "unexpected argument \"%s\"; usage: pinwheel list %s", l->argument[1], sought);
  return lists[i].list (l->argument + 1, error);
}

const pw_command pw_cli_list = {
  .name = "list",
  .synopsis = "[models | methods [NAME...] | kinds [NAME...] | signals]",
  .summary = "list models, integration methods, element types and signals",
  .any_arguments = 1,
  .help =
      "List the names of models, integration methods, element types (kinds) and forms of signals, or describe "
      "those of one sort. With a NAME or \"all\", describe the options of a method or the fields of an element type.",
  .options_size = sizeof (pw_cli_line),
  .function = list_command,
  .options = (const struct poptOption[]){ POPT_TABLEEND },
};

/* ---- The command `new`: writes a small commented model to start from ---- */

/* Generated by the Makefile: new-model.c.in and new-model.yaml.in as arrays of lines, new_model_c and
 * new_model_yaml. */
#include "new.inc"

#define NEW_LETTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-"

/* The model "my_car" for "folder/my_car.c".  Refuses a name that is too long, that a shell would split or change, that
 * a program would take for an option, or that ends in neither .c nor .yaml. */
static int new_command (void *options, pw_error *error) {
  const char *path = ((const pw_cli_line *)options)->argument[0], *slash = strrchr (path, '/'),
             *base = slash ? slash + 1 : path, *ending = base + strspn (base, NEW_LETTERS);
  enum { LONGEST = 99 };
  if (ending == base || ending - base > LONGEST || base[0] == '-' ||
      (strcmp (ending, ".c") != 0 && strcmp (ending, ".yaml") != 0))
    return pw_fail (error, PW_INPUT,
                    "\"%s\": a model file's name has at most %d letters, digits, _ and -, does not begin with -, and "
                    "ends in .c or .yaml",
                    path, LONGEST);
  const char *name = PW_PART (base, (size_t)(ending - base));
  FILE *f = fopen (path, "wx"); /* never overwrites a file */
  if (f == NULL && errno == EEXIST) return pw_fail (error, PW_INPUT, "%s exists already and was not changed", path);
  if (f == NULL) return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, strerror (errno));
  for (const char *const *line = ending[1] == 'y' ? new_model_yaml : new_model_c; *line; line++)
    for (const char *c = *line; *c; c++) *c == '%' ? fputs (name, f) : fputc (*c, f); /* %: the model's name */
  int failed = fflush (f) != 0 ? errno : 0;                                           /* an errno value */
  if (fclose (f) != 0 && failed == 0) failed = errno;
  if (failed) {
    remove (path);
    return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", path, strerror (failed));
  }
  pw_cli_print (stdout, "%s is written; now:  pinwheel run ", path);
  if (strchr (path, '/') == NULL) fputs ("./", stdout);
  if (path[strspn (path, NEW_LETTERS "./")])
    pw_cli_word (stdout, path);
  else
    fputs (path, stdout);
  putchar ('\n');
  return PW_OK;
}

const pw_command pw_cli_new = {
  .name = "new",
  .synopsis = "NAME.c|NAME.yaml",
  .summary = "write a small commented model to start from",
  .help = "Write a small commented model, in C or as text, to start from. Existing files are never overwritten.",
  .options_size = sizeof (pw_cli_line),
  .function = new_command,
  .options = (const struct poptOption[]){ POPT_TABLEEND },
};
