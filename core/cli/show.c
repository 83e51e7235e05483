/* pinwheel show: bodies, elements, parameters and defaults of a model. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"

/* ---- --yaml: a model as text with a bit-identical trajectory, if its initial values are consistent ----
 *
 * Numbers that are the default, 0, are omitted. */

enum { YAML_DIGITS = 17 };

/* A number with all of its digits. */
#define YAML_NUMBER(value) PW_DIGITS (value, YAML_DIGITS)

/* 1 for the default, 0; -0 is not the default. */
static int yaml_is_zero (double value) {
  return value == 0 && !signbit (value);
}

/* Names are made of letters, digits, _, - and characters beyond ASCII; one that begins with - could be read as an entry
 * of a list. */
static void yaml_name (const char *name) {
  printf (*name == '-' ? "\"%s\"" : "%s", name);
}

static void yaml_text (const char *text) {
  putchar ('"');
  for (; *text; text++) {
    int quoted = *text == '"' || *text == '\\', control = (unsigned char)*text < ' ';
    printf (quoted ? "\\%c" : control ? "\\x%02x" : "%c", *text);
  }
  putchar ('"');
}

static void yaml_pairs (const double *x, const double *y, int count) {
  for (int i = 0; i < count; i++) printf ("%s[%s, %s]", i ? ", " : "[", YAML_NUMBER (x[i]), YAML_NUMBER (y[i]));
  putchar (']');
}

/* 1 if an optional field has its default, zero in all bytes, and is not specified nevertheless. */
static int yaml_is_default (const pw_field *f, const void *structure, const void *at) {
  if (f->type == PW_TRACK) return 1; /* yaml_path */
  if (f->required || f->type == PW_BODY) return 0;
  if (f->given && *(const int *)(const void *)((const char *)structure + f->given)) return 0;
  size_t size = pw_field_bytes (f->type) * (size_t)pw_field_count (f);
  for (size_t i = 0; i < size; i++)
    if (((const char *)at)[i]) return 0;
  return 1;
}

/* Writes those fields of a structure that are not the default; returns the separator before what follows. */
static const char *yaml_fields (const pw_field *f, const void *structure, const char *separator, int digits);

/* {ramp: {to: 1, duration: 2}}; {expression: "t^2", rate: "2*t"}, or f (t, a.phi) for a function of a C model.  With
 * fewer digits than YAML_DIGITS, of the points of a table only their number and their first and last times. */
static void yaml_signal (const pw_signal *s, int digits) {
  static const char *const key[] = { "{expression: ", ", rate: ", ", acceleration: " };
  const pw_signal_form *form = pw_signal_form_of (s);
  const pw_signal_text *text = s->type == PW_FUNCTION ? s->function.text : NULL;
  if (text) {
    for (int i = 0; i < 3; i++)
      if (text->part[i]) fputs (key[i], stdout), yaml_text (text->part[i]);
    putchar ('}');
  } else if (s->type == PW_FUNCTION) {
    printf ("f (t");
    for (const char *const *state = s->function.reads; state && *state; state++) printf (", %s", *state);
    putchar (')');
  } else if (form == NULL)
    fputs (PW_DIGITS (s->constant, digits), stdout);
  else {
    printf ("{%s: {", form->name);
    const char *separator = yaml_fields (form->fields, s, "", digits);
    const double *t = s->table.t;
    const int count = s->type == PW_TABLE ? s->table.count : 0;
    if (count > 0) printf ("%spoints: ", separator);
    if (count > 0 && digits < YAML_DIGITS)
      printf ("%d from %s to %s s", count, PW_DIGITS (t[0], digits), PW_DIGITS (t[count - 1], digits));
    else if (count > 0)
      yaml_pairs (t, s->table.value, count);
    printf ("}}");
  }
}

static void yaml_field (const pw_field *f, const void *structure_field, int digits) {
  int count = pw_field_count (f);
  if (count > 1) putchar ('[');
  for (int i = 0; i < count; i++) {
    const void *at = (const char *)structure_field + (size_t)i * pw_field_bytes (f->type);
    const double *number = at;
    if (i) printf (", ");
    if (f->type == PW_NUMBER) fputs (PW_DIGITS (*number, digits), stdout);
    if (f->type == PW_POINT || f->type == PW_VECTOR)
      printf ("[%s, %s]", PW_DIGITS (number[0], digits), PW_DIGITS (number[1], digits));
    if (f->type == PW_BODY) yaml_name (*(const char *const *)at);
    if (f->type == PW_SIGNAL) yaml_signal (at, digits);
    if (f->type == PW_CHOICE) fputs (f->choices[*(const int *)at], stdout);
    if (f->type == PW_TEXT) yaml_text (*(const char *const *)at);
  }
  if (count > 1) putchar (']');
}

static const char *yaml_fields (const pw_field *f, const void *structure, const char *separator, int digits) {
  for (; f->name; f++) {
    const void *at = (const char *)structure + f->offset;
    if (yaml_is_default (f, structure, at)) continue;
    printf ("%s%s: ", separator, f->name), separator = ", ";
    yaml_field (f, at, digits);
  }
  return separator;
}

/* The name of the path of an element of a text model, "" if it has no name; NULL: the element has no path. */
static const char *yaml_path (const pw_model *m, const pw_element *e) {
  const pw_reference_text *text = pw_model_reference_text (m);
  pw_path *const *path = pw_field_at (e->kind, e->definition, PW_TRACK, 0);
  for (int i = 0; path && *path && i < text->paths; i++)
    if (text->path[i].path == *path) return text->path[i].name;
  return path && *path ? "" : NULL;
}

/* Numbers that are not the default, or that the model specifies: bit i of `specified`. */
static void yaml_triple (const char *key, const char *const name[3], const double value[3], unsigned specified) {
  int written = 0;
  for (int i = 0; i < 3; i++) {
    if (yaml_is_zero (value[i]) && !(specified >> i & 1)) continue;
    if (written++ == 0) printf (", %s: {", key);
    printf ("%s%s: %s", written > 1 ? ", " : "", name[i], YAML_NUMBER (value[i]));
  }
  if (written) putchar ('}');
}

static void yaml_body (const pw_body *b) {
  static const char *const state[] = { "x", "y", "phi", "vx", "vy", "omega" };
  printf ("  - {name: "), yaml_name (b->name);
  if (!yaml_is_zero (b->mass)) printf (", mass: %s", YAML_NUMBER (b->mass));
  if (!yaml_is_zero (b->inertia)) printf (", inertia: %s", YAML_NUMBER (b->inertia));
  yaml_triple ("start", state, b->start, b->specified);
  yaml_triple ("rate", state + 3, b->rate, b->specified >> 3);
  for (int i = 0; i < b->corners; i++)
    printf ("%s[%s, %s]%s", i ? ", " : ", outline: [", YAML_NUMBER (b->outline[i][0]), YAML_NUMBER (b->outline[i][1]),
            i + 1 < b->corners ? "" : "]");
  putchar ('}');
  /* a comment on values that are written although the model does not specify them, as reading the text will */
  const char *separator = "  # the model does not specify ";
  for (int i = 0; i < 6; i++) {
    double value = i < 3 ? b->start[i] : b->rate[i - 3];
    unsigned specified = b->specified ? b->specified >> i & 1 : value != 0; /* so -0 is written, but not specified */
    if (yaml_is_zero (value) || specified) continue;
    printf ("%s%s", separator, state[i]), separator = ", ";
  }
  putchar ('\n');
}

/* PW_INPUT if the model has contents that a text model cannot express. */
static int yaml_check (const pw_model *m, pw_error *error) {
  int elements;
  const char *model = pw_model_name (m);
  const pw_element *e = pw_model_elements (m, &elements);
  for (const pw_element *end = e + elements; e < end; e++) {
    const char *kind = e->kind->name, *name = pw_element_name (e);
    const pw_kind *const *k = pw_kinds;
    while (*k && *k != e->kind) k++;
    if (*k == NULL)
      return pw_fail (error, PW_INPUT,
                      "model %s cannot be written as text: %s %s has an element type of the model's own", model, kind,
                      name);
    const char *path = yaml_path (m, e);
    if (path && *path == 0)
      return pw_fail (error, PW_INPUT, "model %s cannot be written as text: the path of %s %s is the model's own",
                      model, kind, name);
    for (const pw_field *f = e->kind->fields; f->name; f++) {
      const pw_signal *s = (const void *)((const char *)e->definition + f->offset);
      for (int i = 0; f->type == PW_SIGNAL && i < pw_field_count (f); i++)
        if (s[i].type == PW_FUNCTION && s[i].function.text == NULL)
          return pw_fail (error, PW_INPUT,
                          "model %s cannot be written as text: the signal \"%s\" of %s %s is a function", model,
                          f->name, kind, name);
    }
  }
  int outputs;
  for (const pw_named_output *o = pw_model_outputs (m, &outputs), *end = o + outputs; o < end; o++)
    if (o->value.text == NULL)
      return pw_fail (error, PW_INPUT, "model %s cannot be written as text: output %s is a function", model, o->name);
  if (pw_model_initials (m))
    return pw_fail (error, PW_INPUT,
                    "--yaml: initial values of --start have no place in a text model; give them to run");
  return PW_OK;
}

static void yaml_outputs (const pw_model *m) {
  int count;
  const pw_named_output *o = pw_model_outputs (m, &count);
  if (count) puts ("outputs:");
  for (const pw_named_output *end = o + count; o < end; o++) {
    printf ("  - {name: %s, value: ", o->name), yaml_text (o->value.text->part[0]);
    if (o->unit) printf (", unit: "), yaml_text (o->unit);
    if (o->about) printf (", about: "), yaml_text (o->about);
    puts ("}");
  }
}

/* Writes a built model to standard output, without a reference solution in C. */
static int yaml_model (const pw_cli_model *opened, pw_error *error) {
  const pw_model *m = opened->model;
  if (yaml_check (m, error) != PW_OK) return error->status;
  puts ("pinwheel: 1");
  const pw_plugin_table *table = pw_model_table (m);
  const pw_reference_text *ref = pw_model_reference_text (m);
  int bodies, elements;
  const pw_body *b = pw_model_bodies (m, &bodies);
  const pw_element *e = pw_model_elements (m, &elements);
  if (table->about && *table->about) printf ("about: "), yaml_text (table->about), putchar ('\n');
  const char *const key[] = { "t_end", "step", "rtol" };
  const double value[] = { table->run.t_end, table->run.step, table->run.rtol };
  const char *separator = "run: {";
  for (int i = 0; i < 3; i++)
    if (value[i] != 0) printf ("%s%s: %s", separator, key[i], YAML_NUMBER (value[i])), separator = ", ";
  if (table->run.method) printf ("%smethod: ", separator), yaml_text (table->run.method), separator = ", ";
  if (*separator == ',') puts ("}");
  if (ref->names) puts ("let:"); /* of the names in expressions */
  for (int i = 0; i < ref->names; i++) printf ("  %s: %s\n", ref->name[i], YAML_NUMBER (ref->value[i]));
  if (ref->paths) puts ("paths:");
  for (const pw_path_text *p = ref->path; p < ref->path + ref->paths; p++) {
    printf ("  - {name: %s, %s%spoints: ", p->name, p->interpolation == PW_CUBIC ? "interpolation: cubic, " : "",
            p->closed ? "closed: true, " : "");
    yaml_pairs (p->x, p->y, p->count);
    puts ("}");
  }
  if (bodies) puts ("bodies:");
  for (int i = 0; i < bodies; i++) yaml_body (&b[i]);
  for (int of_states = 0, written = 0; of_states < 2; of_states++, written = 0)
    for (const pw_element *x = e; x < e + elements; x++) {
      if ((x->kind == &pw_kind_state) != of_states) continue;
      if (written++ == 0) puts (of_states ? "states:" : "elements:");
      printf ("  - {%s: ", of_states ? "name" : x->kind->name), yaml_name (pw_element_name (x));
      yaml_fields (x->kind->fields, x->definition, ", ", YAML_DIGITS);
      if (yaml_path (m, x)) printf (", path: %s", yaml_path (m, x));
      puts ("}");
    }
  yaml_outputs (m);
  if (table->reference)
    puts ("# The reference solution of the model is a function in C, which cannot be written as text.");
  if (ref->states) puts ("truth:");
  for (int i = 0; i < ref->states; i++) printf ("  %s: ", ref->state[i]), yaml_text (ref->text[i]), putchar ('\n');
  return PW_OK;
}

/* ---- The description ---- */

enum { SHOW_DIGITS = 6 };

static void show_bodies (const pw_system *s) {
  static const char *const head[] = { "",          "mass [kg]", "inertia [kg m^2]", "x [m]",         "y [m]",
                                      "phi [rad]", "vx [m/s]",  "vy [m/s]",         "omega [rad/s]", NULL };
  puts ("\nBodies and their initial conditions");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_head (&t, -1, 9, head);
    for (int b = 0; b < pw_system_bodies (s); b++) {
      const double *M = pw_system_mass (s) + 3 * b, *q = pw_system_initial_q (s) + 3 * b,
                   *v = pw_system_initial_v (s) + 3 * b;
      const double value[] = { M[0], M[2], q[0], q[1], q[2], v[0], v[1], v[2] };
      pw_cell (&t, -1, pw_system_body_name (s, b));
      for (int i = 0; i < 8; i++) pw_cell_number (&t, 1, value[i], SHOW_DIGITS);
      pw_row_end (&t);
    }
  }
}

static void show_outputs (const pw_model *m) {
  int count;
  const pw_named_output *outputs = pw_model_outputs (m, &count);
  if (count > 0) puts ("\nOutputs");
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (const pw_named_output *o = outputs; o < outputs + count; o++) {
      pw_cell (&t, -1, o->name);
      pw_cell (&t, -1, o->unit ? o->unit : "");
      pw_cell (&t, -1, o->value.text ? o->value.text->part[0] : "a function");
      pw_cell (&t, -1, o->about ? o->about : "");
      pw_row_end (&t);
    }
}

static void show_parameters (const pw_model *m) {
  const pw_parameter *parameters = pw_model_table (m)->parameters;
  if (parameters == NULL || parameters->name == NULL) return;
  puts ("\nParameters, changed with --set NAME=VALUE");
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (const pw_parameter *p = parameters; p->name; p++) {
      double value = pw_model_parameter (m, p);
      pw_cell (&t, -1, p->name);
      pw_cell_number (&t, 1, value, SHOW_DIGITS);
      pw_cell (&t, -1, p->unit ? p->unit : "");
      pw_cell (&t, -1, pw_domain_text (p->domain));
      pw_cell (&t, -1, p->about ? p->about : "");
      if (value != p->value) pw_cell (&t, -1, PW_PRINTED (60, "default %s", PW_DIGITS (p->value, SHOW_DIGITS)));
      pw_row_end (&t);
    }
}

static void show_model (const pw_cli_model *m) {
  const pw_system *s = m->system;
  const pw_plugin_table *table = pw_model_table (m->model);
  const pw_run_defaults *defaults = &m->defaults;
  int elements, differences = pw_system_differences (s), bodies = pw_system_bodies (s), rows = pw_system_rows (s),
                holonomic = pw_system_holonomic (s);
  const pw_element *e = pw_model_elements (m->model, &elements);
  pw_cli_print (stdout, "%s: %s\n%s\n", pw_model_name (m->model), table->about ? table->about : "",
                pw_cli_short_path (pw_file_path (m->file)));
  show_bodies (s);
  if (elements) puts ("\nElements");
  for (const pw_element *end = e + elements; e < end; e++) {
    printf ("  %s %s: ", e->kind->name, pw_element_name (e));
    for (const pw_field *f = e->kind->fields; f->name; f++) {
      const char *path = f->type == PW_TRACK ? yaml_path (m->model, e) : "";
      if (path == NULL) continue;
      const int may_be_missing = f->type == PW_TEXT || f->given || f->limit; /* which 0 does not say */
      if (may_be_missing && yaml_is_default (f, e->definition, (const char *)e->definition + f->offset)) continue;
      printf ("%s%s ", f == e->kind->fields ? "" : "; ", f->name);
      yaml_field (f, (const char *)e->definition + f->offset, SHOW_DIGITS);
      fputs (path, stdout);
      if (f->unit) printf (" %s", f->unit);
    }
    putchar ('\n');
  }
  show_outputs (m->model);
  if (differences) puts ("\nDerivatives by differences, for implicit methods and linearisation");
  for (int i = 0; i < differences; i++) printf ("  %s\n", PW_NAME (pw_system_difference_name, s, i));
  show_parameters (m->model);
  printf ("\nRuns by default for %s s with %s, --step %s", PW_DIGITS (defaults->t_end, SHOW_DIGITS), defaults->method,
          PW_DIGITS (defaults->step, SHOW_DIGITS));
  if (defaults->rtol != 0) printf (", --rtol %s", PW_DIGITS (defaults->rtol, SHOW_DIGITS));
  putchar ('\n');
  enum { LISTED = 12 }; /* states of the reference solution, at most */
  int n = pw_system_coordinates (m->system), known = 0;
  double *x = pw_model_has_reference (m->model) ? malloc (2 * (size_t)n * sizeof *x) : NULL;
  if (x && pw_system_reference (m->model, m->system, 0, x, x + n, NULL) == PW_OK)
    for (int i = 0; i < 2 * n; i++)
      if (!isnan (x[i]) && ++known <= LISTED)
        printf ("%s%s", known > 1 ? ", " : "\nReference solution: ", PW_NAME (pw_system_state_name, m->system, i));
  if (known > LISTED) printf (", and %d more", known - LISTED);
  if (known) putchar ('\n');
  free (x);
  printf ("\nSizes: %d %s, %d coordinates, %s (%d on positions, %d on velocities)\n", bodies,
          bodies == 1 ? "body" : "bodies", pw_system_coordinates (s), PW_COUNTED (rows, "constraint equation"),
          holonomic, rows - holonomic);
}

/* ---- The equations of motion in numbers ----
 *
 * M a + J^T lambda = f,  J a = gamma,  J v = eta;  for constraints on positions also g (q, t) = 0. */

enum { MATRICES_DIGITS = 7, MATRICES_PANEL = 6 /* columns of J side by side */ };

/* A row of numbers; "-" in place of NaN. */
static void matrices_row (pw_table *t, const char *name, const char *unit, const double *value, int count) {
  pw_cell_unit (t, -22, name, unit);
  for (int i = 0; i < count; i++)
    isnan (value[i]) ? pw_cell (t, 13, "-") : pw_cell_number (t, 13, value[i], MATRICES_DIGITS);
  pw_row_end (t);
}

/* The coordinate, or the first-order state of which it is the integral. */
static int matrices_state (const pw_system *s, int j) {
  return pw_system_state_hidden (s, j) ? j + pw_system_coordinates (s) : j;
}

/* Columns of J from `first` on; in a large scene only the rows that are not zero there.  Entries are sorted by rows. */
static void matrices_panel (const pw_system *s, const pw_equations *eq, int first) {
  int left = eq->coordinates - first, columns = left < MATRICES_PANEL ? left : MATRICES_PANEL;
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -22, "J");
    for (int c = 0; c < columns; c++)
      pw_cell (&t, 13, PW_NAME (pw_system_state_name, s, matrices_state (s, first + c)));
    pw_row_end (&t);
    for (int i = 0, entry = 0; i < eq->rows; i++) {
      double row[MATRICES_PANEL] = { 0 };
      int shown = eq->coordinates <= 2 * MATRICES_PANEL;
      for (; entry < eq->entries && eq->row[entry] == i; entry++) {
        int c = eq->column[entry] - first;
        if (c < 0 || c >= columns) continue;
        row[c] = eq->value[entry] + 0; /* not -0 */
        shown |= row[c] != 0;
      }
      if (!shown) continue;
      matrices_row (&t, PW_NAME (pw_system_reaction_name, s, i), "", row, columns);
    }
  }
}

static void matrices_print (const pw_cli_model *m, const pw_equations *eq, const pw_sample *sample) {
  const pw_system *s = m->system;
  printf ("%s at t = %s s\n", pw_file_name (m->file), PW_DIGITS (sample->t, MATRICES_DIGITS));
  static const char *const head[] = { "", "M", "f", "q", "v", "a", NULL }, *const rows[] = { "",  "gamma",  "eta",
                                                                                             "g", "lambda", NULL };
  puts ("\nM (diagonal), forces and state by coordinate [its unit]; all numbers in SI units");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_head (&t, -22, 13, head);
    for (int j = 0; j < eq->coordinates; j++) {
      const int state = matrices_state (s, j);
      const double value[] = { eq->mass[j], eq->force[j], state == j ? sample->q[j] : NAN, sample->v[j], sample->a[j] };
      matrices_row (&t, PW_NAME (pw_system_state_name, s, state), pw_system_state_unit (s, state), value, 5);
    }
  }
  if (eq->rows == 0) puts ("\nThe model has no constraints: no J, no gamma");
  if (eq->rows > 0) {
    puts ("\ngamma, eta, g and lambda by constraint equation, named after its reaction -lambda [its unit]");
    for (pw_table t = { 0 }; pw_table_pass (&t);) {
      pw_head (&t, -22, 13, rows);
      for (int i = 0; i < eq->rows; i++) {
        const double g = i < eq->holonomic ? eq->g[i] : NAN,
                     value[] = { eq->gamma[i], eq->eta[i], g, sample->lambda[i] };
        matrices_row (&t, PW_NAME (pw_system_reaction_name, s, i), pw_system_reaction_unit (s, i), value, 4);
      }
    }
  }
  if (eq->rows > 0 && eq->coordinates > 2 * MATRICES_PANEL)
    puts ("\nRows of J that are zero in the columns shown are left out");
  for (int j = 0; eq->rows > 0 && j < eq->coordinates; j += MATRICES_PANEL) matrices_panel (s, eq, j);
}

static int show_matrices (const pw_cli_line *line, double t, pw_error *error) {
  const pw_cli_model *m = &line->m;
  pw_run_defaults defaults = m->defaults;
  pw_settings settings;
  pw_limit limit;
  if (t > 0) defaults.t_end = t;
  pw_cli_settings (line, &defaults, &settings, &limit);
  pw_run *run = pw_limit_open (m->system, defaults.method, &settings, error);
  if (run == NULL) return error->status;
  pw_sample sample;
  pw_equations eq = { .rows = 0 };
  int status = t > 0 ? pw_run_advance_to (run, t, t, error) : PW_OK;
  if (status == PW_STOPPED) status = pw_limit_status (&limit, pw_run_time (run), error);
  if (status == PW_OK) status = pw_run_sample (run, t, &sample, error);
  if (status == PW_OK) status = pw_system_equations (m->system, sample.t, sample.q, sample.v, &eq, error);
  if (status == PW_OK) matrices_print (m, &eq, &sample);
  pw_equations_free (&eq);
  pw_run_close (run);
  return status;
}

/* ---- The command ---- */

typedef struct {
  pw_cli_line line;
  int matrices, yaml, code; /* 1: shown in place of the description of the model */
  pw_cli_given at;          /* time at which matrices are shown [s] */
} show_line;

static int show_command (void *options, pw_error *error) {
  show_line *given = options;
  const pw_cli_model *m = &given->line.m;
  int matrices = given->matrices || given->at.text, status = PW_OK;
  if (matrices + given->yaml + given->code > 1)
    status = pw_fail (error, PW_INPUT, "expected one of --%s, --yaml and --c", given->at.text ? "at T" : "matrices");
  if (status == PW_OK)
    status = pw_cli_requires ("--limit", given->line.limit.text, "--at", given->at.text != NULL, error);
  if (status == PW_OK) status = pw_cli_open (&given->line, error);
  if (status == PW_OK && given->code) {
    char *text = pw_cli_source (m->system, error);
    if (text) fputs (text, stdout);
    free (text);
    status = error->status;
  } else if (status == PW_OK && given->yaml)
    status = yaml_model (m, error);
  else if (status == PW_OK && matrices)
    status = show_matrices (&given->line, given->at.number, error);
  else if (status == PW_OK)
    show_model (m);
  return status;
}

static const struct poptOption show_options[] = {
  PW_OPTION_GROUP ("Output"),
  PW_FLAG_OPTION (show_line, matrices, "matrices", "Show M, J and gamma at the initial state instead"),
  PW_NUMBER_OPTION (show_line, at, "at", 0, "T", PW_NONNEGATIVE,
                    "Show M, J and gamma at time T [s] of a run with the model's default method"),
  PW_LIMIT_OPTION,
  PW_FLAG_OPTION (show_line, code, "c", "Write the C code of the specialised scene, as --specialise compiles it"),
  PW_FLAG_OPTION (show_line, yaml, "yaml", "Write the model as a text model with the same trajectory"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_show = {
  .name = "show",
  .synopsis = "MODEL [OPTION...]",
  .summary = "show the bodies, elements and parameters of a model, or its matrices",
  .help = "Show the bodies, elements, parameters and default run settings of a model, or the matrices of its equations "
          "of motion.",
  .options_size = sizeof (show_line),
  .function = show_command,
  .options = show_options,
};
