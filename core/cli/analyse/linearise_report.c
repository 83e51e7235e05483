/* The reports of `pinwheel linearise`: text, matrices in files, and the page of modes. */
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linearise.h"
#include "plot.h"
#include "print_table.h"
#include "states.h"
#include "text.h"

enum {
  LINEARISE_DIGITS = 5, /* of numbers in the text */
  LINEARISE_MODES = 12, /* mode shapes in the text, at most */
  LINEARISE_ROWS = 20   /* in each: bodies, at most, and internal coordinates of elements, at most */
};
#define LINEARISE_SMALL 1e-9 /* components of mode shapes below it are printed as 0: the largest is 1 */

static const char *const linearise_motions[] = { "steady", "accelerated", "changing" }; /* by pw_steadiness */

/* ---- Eigenvalues ---- */

/* Damping ratio of mode i, the fraction of critical damping; NaN for the eigenvalue 0. */
static double linearise_damping (const pw_linear *l, int i) {
  double modulus = hypot (l->re[i], l->im[i]);
  return modulus > 0 ? -l->re[i] / modulus + 0 : NAN; /* + 0 turns -0 into 0 */
}

/* Time in which exp (rate t) doubles, or with -rate halves [s]; NaN if it does not grow. */
static double linearise_doubling_time (double rate) {
  return rate > 0 ? log (2) / rate : NAN;
}

/* Prints a row for each real eigenvalue and each conjugate pair. */
static void linearise_print_eigenvalues (const pw_linear *l) {
  static const char *const head[] = { "mode",    "real [1/s]",     "imaginary [1/s]", "frequency [Hz]",
                                      "damping", "doubles in [s]", "halves in [s]",   NULL };
  puts ("\nEigenvalues, rightmost first");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_head (&t, 4, 12, head);
    for (int i = 0; i < l->unknowns; i++) {
      const double im = l->im[i], value[] = { l->re[i],
                                              im != 0 ? im : NAN,
                                              im != 0 ? im / (2 * PW_PI) : NAN,
                                              linearise_damping (l, i),
                                              linearise_doubling_time (l->re[i]),
                                              linearise_doubling_time (-l->re[i]) };
      if (im < 0) continue;
      pw_cell_number (&t, 4, i + 1, 9);
      for (int k = 0; k < 6; k++) pw_cell_number (&t, 12, value[k], LINEARISE_DIGITS);
      if (l->rigid[i]) pw_cell (&t, -1, "rigid displacement");
      pw_row_end (&t);
    }
  }
}

/* ---- Mode shapes ---- */

/* 1 if mode i has a shape: it is no rigid displacement, and its eigenvalue is not 0. */
static int linearise_has_shape (const pw_linear *l, int i) {
  return !l->rigid[i] && (l->re[i] != 0 || l->im[i] != 0);
}

/* 1 if mode i is shown: it has a shape, and is real or the first of a conjugate pair. */
static int linearise_is_shown (const pw_linear *l, int i) {
  return linearise_has_shape (l, i) && l->im[i] >= 0;
}

/* The real and imaginary part of the perturbation of a state in mode i. */
static const double *linearise_shape (const pw_linear *l, int i, int state) {
  return l->shape + 2 * ((size_t)i * 2 * (size_t)l->coordinates + (size_t)state);
}

/* Prints a component of a mode shape: a real number, or amplitude and phase of a complex one, this to 0.1 degrees. */
static void linearise_print_component (pw_table *t, const pw_linear *l, int mode, int coordinate) {
  const double *c = linearise_shape (l, mode, coordinate);
  double amplitude = hypot (c[0], c[1]), degrees = round (1800 / PW_PI * atan2 (c[1], c[0])) / 10 + 0;
  pw_cell (t, 12,
           amplitude < LINEARISE_SMALL ? "0"
           : l->im[mode] == 0          ? PW_PRINTED (80, "%.5g", c[0])
                                       : PW_PRINTED (80, "%.5g at %.5g deg", amplitude, degrees));
}

static void linearise_print_mode (const pw_linearise_command *cmd, int mode) {
  const pw_system *s = cmd->m.system;
  int bodies = pw_system_bodies (s), internal = pw_system_coordinates (s) - 3 * bodies;
  printf ("\nMode %d\n", mode + 1);
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    static const char *const head[] = { "", "x [m]", "y [m]", "phi [rad]", NULL };
    pw_head (&t, -12, 12, head);
    for (int b = 0; b < bodies && b < LINEARISE_ROWS; b++) {
      pw_cell (&t, -12, pw_system_body_name (s, b));
      for (int k = 0; k < 3; k++) linearise_print_component (&t, &cmd->linear, mode, 3 * b + k);
      pw_row_end (&t);
    }
    for (int j = 3 * bodies; j < 3 * bodies + internal && j < 3 * bodies + LINEARISE_ROWS; j++) {
      pw_cell_unit (&t, -12, PW_NAME (pw_system_state_name, s, j), pw_system_state_unit (s, j));
      linearise_print_component (&t, &cmd->linear, mode, j);
      pw_row_end (&t);
    }
  }
  if (bodies > LINEARISE_ROWS) printf ("  and %d more bodies\n", bodies - LINEARISE_ROWS);
  if (internal > LINEARISE_ROWS) printf ("  and %d more internal coordinates\n", internal - LINEARISE_ROWS);
}

static void linearise_print_shapes (const pw_linearise_command *cmd) {
  const pw_linear *l = &cmd->linear;
  int shown = 0;
  for (int i = 0; i < l->unknowns; i++) {
    if (!linearise_is_shown (l, i)) continue;
    if (shown == 0) puts ("\nMode shapes: displacements in the axes of the frame, the largest 1 m (angles times L)");
    if (shown++ < LINEARISE_MODES) linearise_print_mode (cmd, i);
  }
  if (shown > LINEARISE_MODES) printf ("\nand %d more modes\n", shown - LINEARISE_MODES);
}

void pw_linearise_print (const pw_linearise_command *cmd) {
  const pw_linear *l = &cmd->linear;
  printf ("%s%s at t = %.9g s: %d minimal coordinates, %d of positions and %d of velocities\n",
          pw_file_name (cmd->m.file), cmd->steady ? ", steady motion" : "", cmd->t, l->unknowns, l->positions,
          l->velocities);
  if (l->twist[2] != 0) printf ("The frame turns at %.5g rad/s\n", l->twist[2]);
  if (l->steady == PW_ACCELERATED)
    printf ("Not steady: accelerations of %.3g m/s^2 in the co-moving frame", l->acceleration);
  else if (l->steady == PW_CHANGING)
    printf ("Not steady: the equations change with time or along the motion");
  puts (l->steady == PW_STEADY ? "The motion is steady" : "; the eigenvalues are not stability exponents");
  linearise_print_eigenvalues (l);
  linearise_print_shapes (cmd);
}

/* ---- Matrices ---- */

/* Entry of [ A B ; C D ], whose rows belong to minimal coordinates, then outputs, and columns to minimal coordinates,
 * then inputs; D = 0. */
static double linearise_entry (const pw_linearise_command *cmd, int row, int column) {
  const pw_linear *l = &cmd->linear;
  int n = l->unknowns;
  if (row < n && column < n) return l->A[row * n + column];
  if (row < n) return l->B[row * pw_system_signals (cmd->m.system) + cmd->input[column - n]];
  return column < n ? l->basis[cmd->output[row - n] * n + column] : 0;
}

/* One of the matrices A, B, C, D in [ A B ; C D ]: its first row, number of rows, first column, number of columns. */
typedef struct {
  const char *name;
  int row, rows, column, columns;
} linearise_block;

static void linearise_blocks (const pw_linearise_command *cmd, linearise_block block[4]) {
  const int n = cmd->linear.unknowns;
  block[0] = (linearise_block){ "A", 0, n, 0, n };
  block[1] = (linearise_block){ "B", 0, n, n, cmd->inputs };
  block[2] = (linearise_block){ "C", n, cmd->outputs, 0, n };
  block[3] = (linearise_block){ "D", n, cmd->outputs, n, cmd->inputs };
}

static void linearise_block_json (const pw_linearise_command *cmd, pw_json *j, const linearise_block *b) {
  pw_json_open (j, b->name, '[');
  for (int i = 0; i < b->rows; i++) {
    j->line = 1;
    pw_json_open (j, NULL, '[');
    for (int c = 0; c < b->columns; c++) pw_json_number (j, NULL, linearise_entry (cmd, b->row + i, b->column + c));
    pw_json_close (j, ']');
  }
  pw_json_close (j, ']');
}

static void linearise_mode_json (const pw_linearise_command *cmd, pw_json *j, int i) {
  const pw_linear *l = &cmd->linear;
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "re", l->re[i]);
  pw_json_number (j, "im", l->im[i]);
  pw_json_number (j, "frequency_hz", fabs (l->im[i]) / (2 * PW_PI));
  pw_json_number (j, "damping", linearise_damping (l, i));
  pw_json_number (j, "doubling_time", linearise_doubling_time (l->re[i]));
  pw_json_number (j, "halving_time", linearise_doubling_time (-l->re[i]));
  pw_json_flag (j, "rigid", l->rigid[i]);
  pw_json_open (j, "shape", '{');
  for (int k = 0; linearise_has_shape (l, i) && k < 2 * l->coordinates; k++)
    pw_json_numbers (j, PW_NAME (pw_system_state_name, cmd->m.system, k), linearise_shape (l, i, k), 2);
  pw_json_close (j, '}');
  pw_json_close (j, '}');
}

/* Writes names and units of the inputs or outputs with the indices of a list. */
static void linearise_names_json (const pw_linearise_command *cmd, pw_json *j, const char *key, const int *list,
                                  int count, char *(*name_of) (const pw_system *s, int i, char *buffer, size_t size),
                                  const char *(*unit_of) (const pw_system *s, int i)) {
  pw_json_open (j, key, '[');
  for (int i = 0; i < count; i++) {
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "name", PW_NAME (name_of, cmd->m.system, list[i]));
    pw_json_text (j, "unit", unit_of (cmd->m.system, list[i]));
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

void pw_linearise_json (const pw_linearise_command *cmd, pw_json *j) {
  const pw_linear *l = &cmd->linear;
  linearise_block block[4];
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (cmd->m.file));
  pw_json_number (j, "t", cmd->t);
  pw_json_text (j, "motion", linearise_motions[l->steady]);
  pw_json_number (j, "positions", l->positions);
  pw_json_number (j, "velocities", l->velocities);
  pw_json_number (j, "symmetries", l->symmetries);
  pw_json_numbers (j, "twist", l->twist, 3);
  linearise_names_json (cmd, j, "inputs", cmd->input, cmd->inputs, pw_system_signal_name, pw_system_signal_unit);
  linearise_names_json (cmd, j, "outputs", cmd->output, cmd->outputs, pw_system_state_name, pw_system_state_unit);
  linearise_blocks (cmd, block);
  for (int i = 0; i < 4; i++) linearise_block_json (cmd, j, &block[i]);
  pw_json_open (j, "eigenvalues", '[');
  for (int i = 0; i < l->unknowns; i++) linearise_mode_json (cmd, j, i);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

int pw_linearise_csv (const pw_linearise_command *cmd, FILE *f, pw_error *error) {
  const pw_system *s = cmd->m.system;
  int n = cmd->linear.unknowns, rows = n + cmd->outputs, columns = n + cmd->inputs;
  pw_text t = { .chars = NULL };
  pw_text_cell (&t, "row");
  for (int c = 0; c < n; c++) pw_text_name (&t, PW_PRINTED (40, "x%d", c + 1), "m");
  for (int c = 0; c < cmd->inputs; c++)
    pw_text_name (&t, PW_NAME (pw_system_signal_name, s, cmd->input[c]), pw_system_signal_unit (s, cmd->input[c]));
  int status = pw_text_line (&t, f, cmd->name, error);
  for (int i = 0; status == PW_OK && i < rows; i++) {
    if (i < n)
      pw_text_name (&t, PW_PRINTED (40, "x%d'", i + 1), "m/s");
    else
      pw_text_name (&t, PW_NAME (pw_system_state_name, s, cmd->output[i - n]),
                    pw_system_state_unit (s, cmd->output[i - n]));
    for (int c = 0; c < columns; c++) pw_text_number (&t, linearise_entry (cmd, i, c));
    status = pw_text_line (&t, f, cmd->name, error);
  }
  return status;
}

int pw_linearise_npz (const pw_linearise_command *cmd, FILE *f, pw_error *error) {
  enum { REAL = 1, COMPLEX = 2 }; /* parts of a number */
  const pw_linear *l = &cmd->linear;
  int n = l->unknowns;
  linearise_block block[4];
  pw_npz z = { .f = f };
  double *value = malloc (((size_t)(n + cmd->outputs) * (size_t)(n + cmd->inputs) + 2 * (size_t)n) * sizeof *value);
  if (value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  linearise_blocks (cmd, block);
  for (const linearise_block *b = block; b < block + 4; b++) {
    for (int i = 0; i < b->rows; i++)
      for (int c = 0; c < b->columns; c++) value[i * b->columns + c] = linearise_entry (cmd, b->row + i, b->column + c);
    pw_npz_add (&z, b->name, b->rows, b->columns, REAL, value);
  }
  for (int i = 0; i < n; i++) value[2 * i] = l->re[i], value[2 * i + 1] = l->im[i];
  pw_npz_add (&z, "eigenvalues", n, -1 /* a vector */, COMPLEX, value);
  free (value);
  return pw_npz_end (&z, error);
}

/* ---- The page of mode shapes ----
 *
 * The displacement of a mode with the eigenvalue re + i im is size Re (shape exp (i im t)), without its growth; with
 * im = 0 it is size shape exp (re t) if it decays, or size shape exp (re (t - end)) if it grows, until t = end. */

enum {
  PAGE_SAMPLES = 180,     /* of each mode */
  PAGE_PERIODS = 3,       /* for which an oscillation is shown */
  PAGE_TIME_CONSTANTS = 3 /* 1 / |re|, for which a mode with im = 0 is shown */
};
#define PAGE_SIZE 0.1 /* largest displacement, relative to the length scale */

typedef struct {
  const pw_linearise_command *cmd;
  const double *q; /* the configuration that is perturbed */
  double *state;   /* scratch: q, v */
  double size;     /* of the largest displacement [m] */
  pw_error *error;
} page;

/* Sets the state at time t of a mode that is shown until `end` [s]. */
static void page_state (const page *p, int mode, double t, double end) {
  const pw_linear *l = &p->cmd->linear;
  const double re = l->re[mode], im = l->im[mode];
  const double complex exponent = im == 0 ? re : im * I,
                       factor = p->size * cexp (exponent * t - (im == 0 ? fmax (0, re * end) : 0));
  for (int j = 0; j < l->coordinates; j++) {
    const double *shape = linearise_shape (l, mode, j);
    const double complex displacement = factor * (shape[0] + shape[1] * I);
    p->state[j] = p->q[j] + creal (displacement);
    p->state[l->coordinates + j] = creal (exponent * displacement);
  }
}

static void page_mode (const page *p, FILE *f, int mode) {
  const pw_linear *l = &p->cmd->linear;
  const double re = l->re[mode], im = l->im[mode],
               end = im == 0 ? PAGE_TIME_CONSTANTS / fabs (re) : 2 * PW_PI * PAGE_PERIODS / im;
  char title[200];
  pw_plots *plots = pw_plots_open (NULL, 0, p->cmd->m.model, p->cmd->m.system, end, p->error);
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

/* Writes the list of modes, and the statements that show the one selected; their functions are those of
 * animate.html. */
static void page_begin (FILE *f, const void *context) {
  const page *p = context;
  fputs ("const modes = [", f);
  for (int i = 0, shown = 0; i < p->cmd->linear.unknowns && p->error->status == PW_OK; i++) {
    if (!linearise_is_shown (&p->cmd->linear, i)) continue;
    fputs (shown++ ? ",\n" : "\n", f);
    page_mode (p, f, i);
  }
  fputs (
      "];\nfor (const mode of modes) $(\"mode\").add(new Option(mode.method));\n"
      "$(\"mode\").addEventListener(\"change\", () => { load(modes[$(\"mode\").selectedIndex]); pace(); key(); fit(); "
      "seek(start); });\nbegin(modes[0]);\n",
      f);
}

int pw_linearise_page (const pw_linearise_command *cmd, FILE *f, pw_error *error) {
  static const char *const panel[] = { "<p class=\"bar\"><label>Mode <select id=\"mode\"></select></label></p>\n",
                                       NULL };
  const size_t n = (size_t)cmd->linear.coordinates;
  pw_sample now;
  int shown = 0;
  for (int i = 0; i < cmd->linear.unknowns; i++) shown += linearise_is_shown (&cmd->linear, i);
  if (shown == 0) return pw_fail (error, PW_INPUT, "--animate %s: there is no mode with a shape", cmd->page_path);
  if (pw_run_sample (cmd->r, pw_run_time (cmd->r), &now, error) != PW_OK) return error->status;
  double *state = malloc (2 * n * sizeof *state);
  if (state == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const page p = {
    .cmd = cmd, .q = now.q, .state = state, .size = PAGE_SIZE * pw_run_scale (cmd->r)->length, .error = error
  };
  pw_animation_page (f, panel, page_begin, &p);
  free (state);
  return error->status;
}
