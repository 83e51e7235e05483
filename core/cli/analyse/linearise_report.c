/* The reports of `pinwheel linearise`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linearise.h"
#include "plot.h"
#include "print_table.h"
#include "states.h"
#include "text.h"

/* LINEARISE_MODES: mode shapes in the text; LINEARISE_BODIES: bodies of each, and internal coordinates. */
enum { LINEARISE_DIGITS = 5, LINEARISE_MODES = 12, LINEARISE_BODIES = 20 };
static const double LINEARISE_SMALL = 1e-9; /* components below it are shown as 0 */

static const char *const linearise_motion[] = { "steady", "accelerated", "changing" };

/* ---- Eigenvalues ---- */

/* Fraction of critical damping; NaN for 0. */
static double linearise_damping (const pw_linear *l, int i) {
  double size = hypot (l->re[i], l->im[i]);
  return size > 0 ? -l->re[i] / size + 0 : NAN;
}

/* [s]; NaN if the mode does not grow (sign 1) or decay (-1). */
static double linearise_time (const pw_linear *l, int i, int sign) {
  return l->re[i] * sign > 0 ? log (2) / fabs (l->re[i]) : NAN;
}

/* A row for each real eigenvalue and conjugate pair. */
static void linearise_eigenvalues (const pw_linear *l) {
  static const char *const head[] = { "imaginary [1/s]", "frequency [Hz]", "damping",
                                      "doubles in [s]",  "halves in [s]",  NULL };
  puts ("\nEigenvalues, rightmost first");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, 4, "mode");
    pw_cell (&t, 12, "real [1/s]");
    for (const char *const *h = head; *h; h++) pw_cell (&t, 12, *h);
    pw_row_end (&t);
    for (int i = 0; i < l->unknowns; i++) {
      const double im = l->im[i],
                   value[] = { im != 0 ? im : NAN, im != 0 ? im / (2 * PW_PI) : NAN, linearise_damping (l, i),
                               linearise_time (l, i, 1), linearise_time (l, i, -1) };
      if (im < 0) continue;
      pw_cell_number (&t, 4, i + 1, 9);
      pw_cell_number (&t, 12, l->re[i], LINEARISE_DIGITS);
      for (int k = 0; k < 5; k++) pw_cell_number (&t, 12, value[k], LINEARISE_DIGITS);
      if (l->rigid[i]) pw_cell (&t, -1, "rigid displacement");
      pw_row_end (&t);
    }
  }
}

/* ---- Mode shapes ---- */

/* Rigid displacements and eigenvalues 0 have no shape. */
static int linearise_has_shape (const pw_linear *l, int i) {
  return !l->rigid[i] && (l->re[i] != 0 || l->im[i] != 0);
}

/* 1 if mode i is shown: it moves, and of a conjugate pair it is the first. */
static int linearise_shows (const pw_linear *l, int i) {
  return linearise_has_shape (l, i) && l->im[i] >= 0;
}

/* The real and imaginary part of a state in mode i. */
static const double *linearise_shape (const pw_linear *l, int i, int state) {
  return l->shape + 2 * ((size_t)i * 2 * (size_t)l->coordinates + (size_t)state);
}

/* A real component, or amplitude and phase of a complex one. */
static void linearise_component (pw_table *t, const pw_linear *l, int mode, int coordinate) {
  const double *c = linearise_shape (l, mode, coordinate);
  char text[80];
  double amplitude = hypot (c[0], c[1]);
  if (amplitude < LINEARISE_SMALL)
    snprintf (text, sizeof text, "0");
  else if (l->im[mode] == 0)
    snprintf (text, sizeof text, "%.5g", c[0]);
  else
    snprintf (text, sizeof text, "%.5g at %.5g deg", amplitude, round (1800 / PW_PI * atan2 (c[1], c[0])) / 10 + 0);
  pw_cell (t, 12, text);
}

static void linearise_mode (const pw_linearise *x, int mode) {
  const pw_system *s = x->m.system;
  int bodies = pw_system_bodies (s), shown = bodies < LINEARISE_BODIES ? bodies : LINEARISE_BODIES;
  char name[300];
  printf ("\nMode %d\n", mode + 1);
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    static const char *const head[] = { "", "x [m]", "y [m]", "phi [rad]" };
    for (int k = 0; k < 4; k++) pw_cell (&t, k ? 12 : -12, head[k]);
    pw_row_end (&t);
    for (int b = 0; b < shown; b++) {
      pw_cell (&t, -12, pw_system_body_name (s, b));
      for (int k = 0; k < 3; k++) linearise_component (&t, &x->linear, mode, 3 * b + k);
      pw_row_end (&t);
    }
    for (int j = 3 * bodies; j < pw_system_coordinates (s) && j < 3 * bodies + LINEARISE_BODIES; j++) {
      pw_cell_unit (&t, -12, pw_system_state_name (s, j, name, sizeof name), pw_system_state_unit (s, j));
      linearise_component (&t, &x->linear, mode, j);
      pw_row_end (&t);
    }
  }
  if (shown < bodies) printf ("  and %d more bodies\n", bodies - shown);
}

static void linearise_shapes (const pw_linearise *x) {
  const pw_linear *l = &x->linear;
  int shown = 0, more = 0;
  for (int i = 0; i < l->unknowns; i++) {
    if (!linearise_shows (l, i)) continue;
    if (shown == 0) puts ("\nMode shapes: displacements in the axes of the frame, the largest 1 m (angles times L)");
    if (shown++ < LINEARISE_MODES)
      linearise_mode (x, i);
    else
      more++;
  }
  if (more) printf ("\nand %d more modes\n", more);
}

void pw_linearise_print (const pw_linearise *x) {
  const pw_linear *l = &x->linear;
  printf ("%s%s at t = %.9g s: %d minimal coordinates, %d of positions and %d of velocities\n",
          pw_file_name (x->m.file), x->steady ? ", steady motion" : "", x->t, l->unknowns, l->positions, l->velocities);
  if (l->twist[2] != 0) printf ("The frame turns at %.5g rad/s\n", l->twist[2]);
  if (l->steady == PW_ACCELERATED)
    printf ("Not steady: accelerations of %.3g m/s^2 in the co-moving frame", l->acceleration);
  else if (l->steady == PW_CHANGING)
    printf ("Not steady: the equations change with time or along the motion");
  puts (l->steady == PW_STEADY ? "The motion is steady" : "; the eigenvalues are not stability exponents");
  linearise_eigenvalues (l);
  linearise_shapes (x);
}

/* ---- Matrices ---- */

/* Entry of [ A B ; C D ]: rows are minimal coordinates and outputs, columns minimal coordinates and inputs. */
static double linearise_entry (const pw_linearise *x, int row, int column) {
  const pw_linear *l = &x->linear;
  int n = l->unknowns;
  if (row < n && column < n) return l->A[row * n + column];
  if (row < n) return l->B[row * pw_system_signals (x->m.system) + x->input[column - n]];
  return column < n ? l->basis[x->output[row - n] * n + column] : 0;
}

static void linearise_matrix (const pw_linearise *x, pw_json *j, const char *key, int outputs, int inputs) {
  int n = x->linear.unknowns, first = outputs ? n : 0, left = inputs ? n : 0;
  j->line = 1;
  pw_json_open (j, key, '[');
  for (int i = first; i < (outputs ? n + x->outputs : n); i++) {
    j->line = 1;
    pw_json_open (j, NULL, '[');
    for (int c = left; c < (inputs ? n + x->inputs : n); c++) pw_json_number (j, NULL, linearise_entry (x, i, c));
    pw_json_close (j, ']');
  }
  pw_json_close (j, ']');
}

static void linearise_mode_json (const pw_linearise *x, pw_json *j, int i) {
  const pw_linear *l = &x->linear;
  char name[300];
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "re", l->re[i]);
  pw_json_number (j, "im", l->im[i]);
  pw_json_number (j, "frequency_hz", fabs (l->im[i]) / (2 * PW_PI));
  pw_json_number (j, "damping", linearise_damping (l, i));
  pw_json_number (j, "doubling_time", linearise_time (l, i, 1));
  pw_json_number (j, "halving_time", linearise_time (l, i, -1));
  pw_json_flag (j, "rigid", l->rigid[i]);
  pw_json_open (j, "shape", '{');
  for (int k = 0; linearise_has_shape (l, i) && k < 2 * l->coordinates; k++)
    pw_numbers_json (j, pw_system_state_name (x->m.system, k, name, sizeof name), linearise_shape (l, i, k), 2);
  pw_json_close (j, '}');
  pw_json_close (j, '}');
}

/* Names and units of inputs, or of outputs. */
static void linearise_names (const pw_linearise *x, pw_json *j, int inputs) {
  const pw_system *s = x->m.system;
  char name[300];
  j->line = 1;
  pw_json_open (j, inputs ? "inputs" : "outputs", '[');
  for (int i = 0; i < (inputs ? x->inputs : x->outputs); i++) {
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "name",
                  inputs ? pw_system_signal_name (s, x->input[i], name, sizeof name)
                         : pw_system_state_name (s, x->output[i], name, sizeof name));
    pw_json_text (j, "unit", inputs ? pw_system_signal_unit (s, x->input[i]) : pw_system_state_unit (s, x->output[i]));
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

void pw_linearise_json (const pw_linearise *x, pw_json *j) {
  const pw_linear *l = &x->linear;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_number (j, "t", x->t);
  pw_json_text (j, "motion", linearise_motion[l->steady]);
  pw_json_number (j, "positions", l->positions);
  pw_json_number (j, "velocities", l->velocities);
  pw_json_number (j, "symmetries", l->symmetries);
  pw_numbers_json (j, "twist", l->twist, 3);
  linearise_names (x, j, 1);
  linearise_names (x, j, 0);
  for (int i = 0; i < 4; i++) linearise_matrix (x, j, (const char *[]){ "A", "B", "C", "D" }[i], i / 2, i % 2);
  j->line = 1;
  pw_json_open (j, "eigenvalues", '[');
  for (int i = 0; i < l->unknowns; i++) linearise_mode_json (x, j, i);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

int pw_linearise_csv (const pw_linearise *x, FILE *f, pw_error *error) {
  const pw_system *s = x->m.system;
  int n = x->linear.unknowns, rows = n + x->outputs, columns = n + x->inputs;
  pw_text t = { .chars = NULL };
  char name[300];
  pw_text_cell (&t, "row");
  for (int c = 0; c < n; c++) snprintf (name, sizeof name, "x%d", c + 1), pw_text_name (&t, name, "m");
  for (int c = 0; c < x->inputs; c++)
    pw_text_name (&t, pw_system_signal_name (s, x->input[c], name, sizeof name),
                  pw_system_signal_unit (s, x->input[c]));
  int status = pw_text_line (&t, f, x->name, error);
  for (int i = 0; status == PW_OK && i < rows; i++) {
    if (i < n)
      snprintf (name, sizeof name, "x%d'", i + 1);
    else
      pw_system_state_name (s, x->output[i - n], name, sizeof name);
    pw_text_name (&t, name, i < n ? "m/s" : pw_system_state_unit (s, x->output[i - n]));
    for (int c = 0; c < columns; c++) pw_text_number (&t, linearise_entry (x, i, c));
    status = pw_text_line (&t, f, x->name, error);
  }
  return status;
}

int pw_linearise_npz (const pw_linearise *x, FILE *f, pw_error *error) {
  const pw_linear *l = &x->linear;
  int n = l->unknowns;
  pw_npz z = { .f = f };
  double *value = malloc (((size_t)(n + x->outputs) * (size_t)(n + x->inputs) + 2 * (size_t)n) * sizeof *value);
  if (value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int m = 0; m < 4; m++) {
    int first = m / 2 ? n : 0, left = m % 2 ? n : 0, rows = m / 2 ? x->outputs : n, columns = m % 2 ? x->inputs : n;
    for (int i = 0; i < rows; i++)
      for (int c = 0; c < columns; c++) value[i * columns + c] = linearise_entry (x, first + i, left + c);
    pw_npz_add (&z, (const char *[]){ "A", "B", "C", "D" }[m], rows, columns, 1, value);
  }
  for (int i = 0; i < n; i++) value[2 * i] = l->re[i], value[2 * i + 1] = l->im[i];
  pw_npz_add (&z, "eigenvalues", n, 1, 2, value);
  free (value);
  return pw_npz_end (&z, error);
}

/* ---- The page of mode shapes: displacements eps Re (shape exp (i im t)), without growth; real modes with it ---- */

/* Of pairs, periods are shown; of real modes, growth by exp (PAGE_TIMES).  PAGE_SIZE: largest displacement, in units
 * of the scene's length. */
enum { PAGE_SAMPLES = 180, PAGE_PERIODS = 3, PAGE_TIMES = 3 };
#define PAGE_SIZE 0.1

typedef struct {
  const pw_linearise *x;
  const double *base; /* configuration */
  double *state;      /* q, v: scratch */
  double size;        /* [m] */
  pw_error *error;
} page;

/* The state at time t of a mode, whose largest displacement is `size`. */
static void page_state (const page *p, int mode, double t, double end) {
  const pw_linear *l = &p->x->linear;
  const double re = l->re[mode], im = l->im[mode];
  const double growth = im == 0 ? exp (re * t - fmax (0, re * end)) : 1, c = growth * cos (im * t),
               s = growth * sin (im * t);
  const double rate_c = im == 0 ? re * c : -im * s, rate_s = im * c;
  for (int j = 0; j < l->coordinates; j++) {
    const double *shape = linearise_shape (l, mode, j);
    p->state[j] = p->base[j] + p->size * (c * shape[0] - s * shape[1]);
    p->state[l->coordinates + j] = p->size * (rate_c * shape[0] - rate_s * shape[1]);
  }
}

static void page_mode (const page *p, FILE *f, int mode) {
  const pw_linear *l = &p->x->linear;
  const double re = l->re[mode], im = l->im[mode],
               end = im == 0 ? PAGE_TIMES / fabs (re) : 2 * PW_PI * PAGE_PERIODS / im;
  char title[200];
  pw_plots *plots = pw_plots_open (NULL, 0, p->x->m.model, p->x->m.system, end, p->error);
  if (plots == NULL) return;
  for (int k = 0; k <= PAGE_SAMPLES; k++) {
    const double t = end * k / PAGE_SAMPLES;
    page_state (p, mode, t, end);
    pw_plots_add (plots, &(pw_sample){ .t = t, .q = p->state, .v = p->state + l->coordinates });
  }
  int n = snprintf (title, sizeof title, "mode %d: %.5g 1/s", mode + 1, re);
  if (im != 0) snprintf (title + n, sizeof title - (size_t)n, ", %.5g Hz, growth is not shown", im / (2 * PW_PI));
  pw_animation_run (f, plots, title, "");
  pw_plots_close (plots);
}

static void page_begin (FILE *f, const void *context) {
  const page *p = context;
  fputs ("const modes = [", f);
  for (int i = 0, shown = 0; i < p->x->linear.unknowns && p->error->status == PW_OK; i++) {
    if (!linearise_shows (&p->x->linear, i)) continue;
    fputs (shown++ ? ",\n" : "\n", f);
    page_mode (p, f, i);
  }
  fputs (
      "];\nfor (const mode of modes) $(\"mode\").add(new Option(mode.method));\n"
      "$(\"mode\").addEventListener(\"change\", () => { load(modes[$(\"mode\").selectedIndex]); pace(); key(); fit(); "
      "seek(start); });\nbegin(modes[0]);\n",
      f);
}

int pw_linearise_page (const pw_linearise *x, FILE *f, pw_error *error) {
  static const char *const panel[] = { "<p class=\"bar\"><label>Mode <select id=\"mode\"></select></label></p>\n",
                                       NULL };
  const size_t n = (size_t)x->linear.coordinates;
  pw_sample now;
  int shown = 0;
  for (int i = 0; i < x->linear.unknowns; i++) shown += linearise_shows (&x->linear, i);
  if (shown == 0) return pw_fail (error, PW_INPUT, "--animate %s: there is no mode with a shape", x->animate);
  if (pw_run_sample (x->r, pw_run_time (x->r), &now, error) != PW_OK) return error->status;
  double *state = malloc (2 * n * sizeof *state);
  if (state == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const page p = {
    .x = x, .base = now.q, .state = state, .size = PAGE_SIZE * pw_run_scale (x->r)->length, .error = error
  };
  pw_animation_page (f, panel, page_begin, &p);
  free (state);
  return error->status;
}
