/* pinwheel show: bodies, elements, parameters and defaults of a model. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "show.h"

enum { SHOW_DIGITS = 6 };

static void show_number (double value) {
  char text[32];
  fputs (pw_format (text, value, SHOW_DIGITS), stdout);
}

/* "(1, 2, 3)", padded to a column. */
static void show_tuple (const double *value, int count, int width) {
  char text[200] = "(", number[32];
  for (int i = 0; i < count; i++) {
    size_t used = strlen (text);
    snprintf (text + used, sizeof text - used, "%s%s", i ? ", " : "", pw_format (number, value[i], SHOW_DIGITS));
  }
  printf ("%s)%*s", text, width > (int)strlen (text) ? width - (int)strlen (text) : 0, "");
}

/* ---- Bodies ---- */

static void show_bodies (const pw_cli_model *m) {
  const pw_system *s = m->system;
  char mass[32], inertia[32];
  printf ("\nBodies\n  %-12s %-10s %-18s %-26s %s\n", "", "mass [kg]", "inertia [kg m^2]",
          "initial x, y [m], phi [rad]", "initial vx, vy [m/s], omega [rad/s]");
  for (int b = 0; b < pw_system_bodies (s); b++) {
    const double *M = pw_system_mass (s) + 3 * b;
    printf ("  %-12s %-10s %-18s ", pw_system_body_name (s, b), pw_format (mass, M[0], SHOW_DIGITS),
            pw_format (inertia, M[2], SHOW_DIGITS));
    show_tuple (pw_system_initial_q (s) + 3 * b, 3, 26);
    putchar (' ');
    show_tuple (pw_system_initial_v (s) + 3 * b, 3, 0);
    putchar ('\n');
  }
}

/* ---- Elements ---- */

static void show_harmonic (const pw_signal *s) {
  if (s->harmonic.offset != 0) show_number (s->harmonic.offset), printf (" + ");
  show_number (s->harmonic.amplitude);
  printf (" cos (");
  show_number (s->harmonic.omega);
  printf (" t");
  if (s->harmonic.phase != 0) printf (" + "), show_number (s->harmonic.phase);
  printf (")");
}

/* An expression as it was written, or f (t, states). */
static void show_function (const pw_signal *s) {
  static const char *const part[] = { "", ", rate ", ", acceleration " };
  const pw_signal_text *text = s->function.text;
  for (int i = 0; text && i < 3; i++)
    if (text->part[i]) printf ("%s%s", part[i], text->part[i]);
  if (text) return;
  printf ("f (t");
  for (const char *const *r = s->function.reads; r && *r; r++) printf (", %s", *r);
  printf (")");
}

/* ramp (from 0, to 1, start 2, duration 3) */
static void show_form (const pw_signal *s) {
  const pw_signal_form *form = pw_signal_form_of (s);
  printf ("%s (", form->name);
  for (const pw_field *f = form->fields; f->name; f++) {
    const void *at = (const char *)s + f->offset;
    if (s->type == PW_TABLE && f->type == PW_NUMBER && *(const double *)at == 0) continue; /* no scale, no offset */
    printf ("%s%s ", f == form->fields ? "" : ", ", f->name);
    if (f->type == PW_NUMBER) show_number (*(const double *)at);
    if (f->type == PW_CHOICE) printf ("%s", f->choices[*(const int *)at]);
  }
  if (s->type == PW_TABLE) {
    printf (", %d points from ", s->table.count), show_number (s->table.t[0]);
    printf (" to "), show_number (s->table.t[s->table.count - 1]), printf (" s");
  }
  printf (")");
}

static void show_signal (const pw_signal *s) {
  if (s->type == PW_CONSTANT)
    show_number (s->constant);
  else if (s->type == PW_FUNCTION)
    show_function (s);
  else
    (s->type == PW_HARMONIC ? show_harmonic : show_form) (s);
}

static void show_value (const pw_field *f, const char *at) {
  const void *p = at;
  if (f->type == PW_NUMBER) show_number (*(const double *)p);
  if (f->type == PW_POINT || f->type == PW_VECTOR) show_tuple (p, 2, 0);
  if (f->type == PW_BODY) printf ("%s", *(const char *const *)p);
  if (f->type == PW_SIGNAL) show_signal (p);
  if (f->type == PW_CHOICE) printf ("%s", f->choices[*(const int *)p]);
}

static void show_element (const pw_element *e) {
  printf ("  %s %s: ", e->kind->name, pw_element_name (e));
  for (const pw_field *f = e->kind->fields; f->name; f++) {
    printf ("%s%s ", f == e->kind->fields ? "" : "; ", f->name);
    for (int i = 0; i < pw_field_count (f); i++) {
      if (i) printf (", ");
      show_value (f, (const char *)e->definition + f->offset + (size_t)i * pw_field_bytes (f->type));
    }
    if (f->unit) printf (" %s", f->unit);
  }
  putchar ('\n');
}

/* ---- Derivatives without a formula ---- */

/* Derivative blocks that element types do not provide. */
static void show_differences (const pw_system *s) {
  char text[300];
  int count = pw_system_differences (s);
  if (count) puts ("\nDerivatives by differences, for implicit methods and linearisation");
  for (int i = 0; i < count; i++) printf ("  %s\n", pw_system_difference_name (s, i, text, sizeof text));
}

/* ---- Parameters and the rest ---- */

static void show_parameters (const pw_model *m) {
  static const char *const domain[] = { "", ">= 0", "> 0", "1, 2, ..." };
  const pw_parameter *p = pw_model_table (m)->parameters;
  if (p == NULL || p->name == NULL) return;
  puts ("\nParameters, changed with --set NAME=VALUE");
  for (; p->name; p++) {
    double value = pw_model_parameter (m, p);
    char text[32], with_unit[64];
    snprintf (with_unit, sizeof with_unit, "%s %s", pw_format (text, value, SHOW_DIGITS), p->unit ? p->unit : "");
    printf ("  %-12s %-18s %-10s %s", p->name, with_unit, domain[p->domain], p->about ? p->about : "");
    if (value != p->value) printf (" (default %s)", pw_format (text, p->value, SHOW_DIGITS));
    putchar ('\n');
  }
}

static void show_defaults (const pw_plugin_table *table) {
  pw_run_defaults d = pw_cli_defaults (table);
  printf ("\nRuns by default for ");
  show_number (d.t_end);
  printf (" s with %s, --step ", d.method);
  show_number (d.step);
  if (d.rtol != 0) printf (", --rtol "), show_number (d.rtol);
  putchar ('\n');
}

static void show_sizes (const pw_system *s) {
  int bodies = pw_system_bodies (s), rows = pw_system_rows (s), holonomic = pw_system_holonomic (s);
  printf ("\nSizes: %d %s, %d coordinates, %d constraint equation%s (%d on positions, %d on velocities)\n", bodies,
          bodies == 1 ? "body" : "bodies", pw_system_coordinates (s), rows, rows == 1 ? "" : "s", holonomic,
          rows - holonomic);
}

/* The states given by the reference solution of the model. */
static void show_reference (const pw_cli_model *m) {
  enum { MOST = 12 };
  int n = pw_system_coordinates (m->system), known = 0;
  char name[300];
  double *x = pw_system_has_reference (m->model) ? malloc (2 * (size_t)n * sizeof *x) : NULL;
  if (x && pw_system_reference (m->model, m->system, 0, x, x + n, NULL) == PW_OK)
    for (int i = 0; i < 2 * n; i++)
      if (!isnan (x[i]) && ++known <= MOST)
        printf ("%s%s", known > 1 ? ", " : "\nReference solution (truth): ",
                pw_system_state_name (m->system, i, name, sizeof name));
  if (known > MOST) printf (", and %d more", known - MOST);
  if (known) putchar ('\n');
  free (x);
}

static void show_model (const pw_cli_model *m) {
  char folder[1000];
  int elements;
  const pw_plugin_table *table = pw_model_table (m->model);
  const pw_element *e = pw_model_elements (m->model, &elements);
  printf ("%s: %s\n%s\n", pw_model_name (m->model), table->about ? table->about : "",
          pw_cli_short_path (pw_file_path (m->file), folder, sizeof folder));
  show_bodies (m);
  if (elements) puts ("\nElements");
  for (int i = 0; i < elements; i++) show_element (&e[i]);
  show_differences (m->system);
  show_parameters (m->model);
  show_defaults (table);
  show_reference (m);
  show_sizes (m->system);
}

typedef struct {
  pw_cli_line line;
  int matrices, yaml;
  const char *at;
} show;

static int show_command (void *options, pw_error *error) {
  const show *x = options;
  pw_cli_model m = { .file = NULL };
  double t = 0;
  int status = pw_cli_number ("--at", x->at, PW_NONNEGATIVE, &t, error);
  if (status == PW_OK) status = pw_cli_open (&m, &x->line, error);
  if (status == PW_OK && x->yaml)
    status = pw_show_yaml (&m, error);
  else if (status == PW_OK && (x->matrices || x->at))
    status = pw_show_matrices (&m, t, error);
  else if (status == PW_OK)
    show_model (&m);
  pw_cli_close_model (&m);
  return status;
}

static const struct poptOption show_options[] = {
  PW_OPTION_GROUP ("Output"),
  PW_FLAG_OPTION (show, matrices, "matrices", "Show M, J and gamma at the initial state instead"),
  PW_TEXT_OPTION (show, at, "at", 0, "T", "Show M, J and gamma at time T [s] of a run with the model's default method"),
  PW_FLAG_OPTION (show, yaml, "yaml", "Write the model as a text model with the same trajectory"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_show = {
  .name = "show",
  .synopsis = "MODEL [OPTION...]",
  .summary = "show the bodies, elements and parameters of a model, or its matrices",
  .help = "Show the bodies, elements, parameters and default run settings of a model, or the matrices of its equations "
          "of motion.",
  .least = 1,
  .most = 1,
  .size = sizeof (show),
  .function = show_command,
  .options = show_options,
};
