/* The command `linearise`: x' = A x + B u, y = C x + D u, linearised at a time of a run or at a steady motion. */
#include <complex.h>
#include <stdlib.h>
#include <string.h>
#include "plot.h"
#include "unknowns.h"

typedef struct {
  pw_cli_line line;
  pw_cli_given at;
  const char *name, *json_path;             /* of -o and --json, or NULL */
  const char *page_path;                    /* of --animate, or NULL */
  const char **hold_texts;                  /* of --hold */
  int steady;                               /* 1: --steady */
  const char **input_names, **output_names; /* ended by NULL; or NULL: all signals of forces, all states */
  pw_run *r;
  double t;                  /* of the state that is linearised [s] */
  pw_initial_value *initial; /* 2 x coordinates: the steady motion; NULL: the model's initial state */
  pw_limit limit;
  pw_linear linear;
  int inputs, outputs, *input, *output; /* numbers of the signals u and the states y, and their indices */
} pw_linearise_command;

enum { LINEARISE_COORDINATES = 400 }; /* at most: the cost is cubic */

/* Adds the indices of the names, which end with NULL, each once; `find` returns that of one name. */
static int linearise_find_all (const pw_system *s, const char **name, int *list, int *count,
                               int (*find) (const pw_system *s, const char *name, pw_error *error), pw_error *error) {
  for (; *name; name++) {
    int index = find (s, *name, error), repeated = 0;
    if (index < 0) return index;
    for (int i = 0; i < *count; i++) repeated |= list[i] == index;
    if (!repeated) list[(*count)++] = index;
  }
  return PW_OK;
}

/* Selects inputs and outputs: those named; by default all signals of forces, and all states.  Signals of constraints
 * are refused: their first and second time derivatives would be inputs as well. */
static int linearise_select (pw_linearise_command *cmd, pw_error *error) {
  const pw_system *s = cmd->line.m.system;
  int states = 2 * pw_system_coordinates (s), signals = pw_system_signals (s);
  cmd->input = malloc (((size_t)signals + 1) * sizeof *cmd->input);
  cmd->output = malloc (((size_t)states + 1) * sizeof *cmd->output);
  if (cmd->input == NULL || cmd->output == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; cmd->input_names == NULL && i < signals; i++)
    if (pw_system_signal_of_force (s, i)) cmd->input[cmd->inputs++] = i;
  for (int i = 0; cmd->output_names == NULL && i < states; i++)
    if (!pw_system_state_hidden (s, i)) cmd->output[cmd->outputs++] = i;
  int status = PW_OK;
  if (cmd->input_names)
    status = linearise_find_all (s, cmd->input_names, cmd->input, &cmd->inputs, pw_system_find_signal, error);
  if (status == PW_OK && cmd->output_names)
    status = linearise_find_all (s, cmd->output_names, cmd->output, &cmd->outputs, pw_system_find_state, error);
  for (int i = 0; i < cmd->inputs && status == PW_OK; i++)
    if (!pw_system_signal_of_force (s, cmd->input[i]))
      status =
          pw_fail (error, PW_INPUT, "--input %s is the signal of a constraint; only signals of forces can be inputs",
                   PW_NAME (pw_system_signal_name, s, cmd->input[i]));
  return status;
}

/* Newton's method from the initial state, then from one to which forces lead; the quantities of --hold are held. */
static int linearise_solve_steady (pw_linearise_command *cmd, pw_steady *steady, pw_error *error) {
  int n = pw_system_coordinates (cmd->line.m.system);
  pw_steady_motion motion;
  int status = steady ? PW_RETRY : error->status, changes = 0;
  for (int attempt = 0; status == PW_RETRY && attempt < PW_STEADY_NOT_RANDOM && !pw_limit_over (&cmd->limit);
       attempt++) {
    status = pw_steady_solve (steady, attempt, 0 /* no parameter */, &motion, error);
    if (status == PW_OK && motion.linear->steady == PW_CHANGING) status = PW_RETRY, changes = 1;
  }
  if (status == PW_RETRY && pw_limit_over (&cmd->limit)) return pw_limit_status (&cmd->limit, cmd->t, error);
  if (status == PW_RETRY)
    return pw_fail (
        error, PW_METHOD,
        "%s: no steady motion is reached from the initial state: %s; `pinwheel steady` also begins at random states",
        pw_file_name (cmd->line.m.file),
        changes ? "the solutions found are not steady, as the equations change with time or along the motion"
                : PW_PRINTED (70, "the last residual is %.2g, in units of the scene", motion.residual));
  if (status != PW_OK) return status;
  cmd->initial = malloc (2 * (size_t)n * sizeof *cmd->initial);
  if (cmd->initial == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < 2 * n; i++) cmd->initial[i] = (pw_initial_value){ i, i < n ? motion.q[i] : motion.v[i - n] };
  return PW_OK;
}

/* Runs the model to the time of --at, and makes the state reached consistent; or opens a run at the steady motion. */
static int linearise_run (pw_linearise_command *cmd, pw_error *error) {
  const pw_run_defaults *d = &cmd->line.m.defaults;
  pw_settings settings;
  pw_cli_settings (&cmd->line, d, &settings, &cmd->limit);
  if (!cmd->steady) settings.span = fmax (settings.span, cmd->t); /* else after --at: signals are constant in it */
  pw_limit_start (&cmd->limit);
  if (cmd->steady) {
    pw_initial_value hold[PW_HOLDS];
    pw_steady_settings set = { .hold = hold, .t = cmd->t, .span = settings.span, .vary = -1 /* none of them */ };
    if (pw_hold_read (cmd->line.m.system, cmd->hold_texts, hold, &set.holds, error) != PW_OK) return error->status;
    pw_steady *steady = pw_steady_open (cmd->line.m.system, &set, error);
    int status = linearise_solve_steady (cmd, steady, error);
    pw_steady_close (steady);
    if (status != PW_OK) return status;
    settings.t = cmd->t;
    settings.initial = cmd->initial;
    settings.initials = 2 * pw_system_coordinates (cmd->line.m.system);
  }
  cmd->r = pw_limit_open (cmd->line.m.system, d->method, &settings, error);
  if (cmd->r == NULL) return error->status;
  if (cmd->steady) return PW_OK;
  int status = pw_report_initial_state (&cmd->line.m, cmd->limit.seconds, error);
  if (cmd->t == 0 || status != PW_OK) return status;
  pw_cli_report_tables (cmd->line.m.system, cmd->t);
  pw_progress progress;
  pw_stop_catch ();
  pw_progress_start (&progress, pw_file_name (cmd->line.m.file), "s", 0, cmd->t);
  while (status == PW_OK && pw_run_time (cmd->r) < cmd->t) {
    status = pw_run_advance (cmd->r, cmd->t, error);
    pw_progress_at (&progress, pw_run_time (cmd->r));
  }
  pw_progress_end (&progress);
  pw_stop_release ();
  if (status == PW_STOPPED) status = pw_limit_status (&cmd->limit, pw_run_time (cmd->r), error);
  return status == PW_OK ? pw_run_restart (cmd->r, NULL, NULL, error) : status;
}

/* ---- Reports: text, matrices in files, and the page of modes ---- */

enum {
  LINEARISE_DIGITS = 5, /* of numbers in the text */
  LINEARISE_MODES = 12, /* mode shapes in the text, at most */
  LINEARISE_ROWS = 20   /* in each: bodies, at most, and internal coordinates of elements, at most */
};
#define LINEARISE_SMALL 1e-9 /* components of mode shapes below it are printed as 0: the largest is 1 */

static const char *const linearise_motions[] = { "steady", "accelerated", "changing" }; /* by pw_steadiness */

/* Damping ratio of mode i, the fraction of critical damping; NaN for the eigenvalue 0. */
static double linearise_damping (const pw_linear *l, int i) {
  double modulus = hypot (l->re[i], l->im[i]);
  return modulus > 0 ? -l->re[i] / modulus + 0 : NAN; /* + 0 turns -0 into 0 */
}

/* Time in which exp (rate t) doubles, or with -rate halves [s]; NaN if it does not grow. */
static double linearise_doubling_time (double rate) {
  return rate > 0 ? log (2) / rate : NAN;
}

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
  const pw_system *s = cmd->line.m.system;
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
      const int shown = pw_system_state_hidden (s, j) ? j + pw_system_coordinates (s) : j;
      pw_cell_unit (&t, -12, PW_NAME (pw_system_state_name, s, shown), pw_system_state_unit (s, shown));
      linearise_print_component (&t, &cmd->linear, mode, shown);
      pw_row_end (&t);
    }
  }
  if (bodies > LINEARISE_ROWS) printf ("  and %d more bodies\n", bodies - LINEARISE_ROWS);
  if (internal > LINEARISE_ROWS) printf ("  and %d more internal coordinates\n", internal - LINEARISE_ROWS);
}

static void linearise_print (const pw_linearise_command *cmd) {
  const pw_linear *l = &cmd->linear;
  printf ("%s%s at t = %.9g s: %d minimal coordinates, %d of positions and %d of velocities\n",
          pw_file_name (cmd->line.m.file), cmd->steady ? ", steady motion" : "", cmd->t, l->unknowns, l->positions,
          l->velocities);
  if (l->twist[2] != 0) printf ("The frame turns at %.5g rad/s\n", l->twist[2]);
  if (l->steady == PW_ACCELERATED)
    printf ("Not steady: accelerations of %.3g m/s^2 in the co-moving frame", l->acceleration);
  else if (l->steady == PW_CHANGING)
    printf ("Not steady: the equations change with time or along the motion");
  puts (l->steady == PW_STEADY ? "The motion is steady" : "; the eigenvalues are not stability exponents");
  linearise_print_eigenvalues (l);
  int shown = 0;
  for (int i = 0; i < l->unknowns; i++) {
    if (!linearise_is_shown (l, i)) continue;
    if (shown == 0) puts ("\nMode shapes: displacements in the axes of the frame, the largest 1 m (angles times L)");
    if (shown++ < LINEARISE_MODES) linearise_print_mode (cmd, i);
  }
  if (shown > LINEARISE_MODES) printf ("\nand %d more modes\n", shown - LINEARISE_MODES);
}

/* Entry of [ A B ; C D ], whose rows belong to minimal coordinates, then outputs, and columns to minimal coordinates,
 * then inputs; D = 0. */
static double linearise_entry (const pw_linearise_command *cmd, int row, int column) {
  const pw_linear *l = &cmd->linear;
  int n = l->unknowns;
  if (row < n && column < n) return l->A[row * n + column];
  if (row < n) return l->B[row * pw_system_signals (cmd->line.m.system) + cmd->input[column - n]];
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

static void linearise_names_json (const pw_linearise_command *cmd, pw_json *j, const char *key, const int *list,
                                  int count, char *(*name_of) (const pw_system *s, int i, char *buffer, size_t size),
                                  const char *(*unit_of) (const pw_system *s, int i)) {
  pw_json_open (j, key, '[');
  for (int i = 0; i < count; i++)
    pw_json_print (j, "{name: %s, unit: %s}", PW_NAME (name_of, cmd->line.m.system, list[i]),
                   unit_of (cmd->line.m.system, list[i]));
  pw_json_close (j, ']');
}

static void linearise_json (const pw_linearise_command *cmd, pw_json *j) {
  const pw_linear *l = &cmd->linear;
  linearise_block block[4];
  pw_json_print (j, "{schema: %d, model: %s, t: %g, motion: %s, positions: %d, velocities: %d, symmetries: %d", 1,
                 pw_file_name (cmd->line.m.file), cmd->t, linearise_motions[l->steady], l->positions, l->velocities,
                 l->symmetries);
  pw_json_numbers (j, "twist", l->twist, 3);
  linearise_names_json (cmd, j, "inputs", cmd->input, cmd->inputs, pw_system_signal_name, pw_system_signal_unit);
  linearise_names_json (cmd, j, "outputs", cmd->output, cmd->outputs, pw_system_state_name, pw_system_state_unit);
  linearise_blocks (cmd, block);
  for (const linearise_block *b = block; b < block + 4; b++) {
    pw_json_open (j, b->name, '[');
    for (int i = 0; i < b->rows; i++) {
      pw_json_print (j, "\n[");
      for (int c = 0; c < b->columns; c++) pw_json_number (j, NULL, linearise_entry (cmd, b->row + i, b->column + c));
      pw_json_close (j, ']');
    }
    pw_json_close (j, ']');
  }
  pw_json_open (j, "eigenvalues", '[');
  for (int i = 0; i < l->unknowns; i++) {
    pw_json_print (
        j, "\n{re: %g, im: %g, frequency_hz: %g, damping: %g, doubling_time: %g, halving_time: %g, rigid: %i, shape: {",
        l->re[i], l->im[i], fabs (l->im[i]) / (2 * PW_PI), linearise_damping (l, i), linearise_doubling_time (l->re[i]),
        linearise_doubling_time (-l->re[i]), l->rigid[i]);
    for (int k = 0; linearise_has_shape (l, i) && k < 2 * l->coordinates; k++)
      if (!pw_system_state_hidden (cmd->line.m.system, k))
        pw_json_numbers (j, PW_NAME (pw_system_state_name, cmd->line.m.system, k), linearise_shape (l, i, k), 2);
    pw_json_print (j, "}}");
  }
  pw_json_print (j, "]}");
}

static void linearise_csv (const pw_linearise_command *cmd, pw_cells *t) {
  const pw_system *s = cmd->line.m.system;
  int n = cmd->linear.unknowns, rows = n + cmd->outputs, columns = n + cmd->inputs;
  pw_cells_text (t, "row");
  for (int c = 0; c < n; c++) pw_cells_name (t, PW_PRINTED (40, "x%d", c + 1), "m");
  for (int c = 0; c < cmd->inputs; c++)
    pw_cells_name (t, PW_NAME (pw_system_signal_name, s, cmd->input[c]), pw_system_signal_unit (s, cmd->input[c]));
  pw_cells_end (t);
  for (int i = 0; i < rows; i++) {
    if (i < n)
      pw_cells_name (t, PW_PRINTED (40, "x%d'", i + 1), "m/s");
    else
      pw_cells_name (t, PW_NAME (pw_system_state_name, s, cmd->output[i - n]),
                     pw_system_state_unit (s, cmd->output[i - n]));
    for (int c = 0; c < columns; c++) pw_cells_number (t, linearise_entry (cmd, i, c));
    pw_cells_end (t);
  }
}

static int linearise_npz (const pw_linearise_command *cmd, FILE *f, pw_error *error) {
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

static void page_mode (const page *p, FILE *f, int mode) {
  const pw_linear *l = &p->cmd->linear;
  const double re = l->re[mode], im = l->im[mode],
               end = im == 0 ? PAGE_TIME_CONSTANTS / fabs (re) : 2 * PW_PI * PAGE_PERIODS / im;
  char title[200];
  pw_plots *plots = pw_plots_open (NULL, 0, p->cmd->line.m.model, p->cmd->line.m.system, end, p->error);
  if (plots == NULL) return;
  for (int k = 0; k <= PAGE_SAMPLES; k++) {
    const double t = end * k / PAGE_SAMPLES;
    const double complex exponent = im == 0 ? re : im * I,
                         factor = p->size * cexp (exponent * t - (im == 0 ? fmax (0, re * end) : 0));
    for (int j = 0; j < l->coordinates; j++) {
      const double *shape = linearise_shape (l, mode, j);
      const double complex displacement = factor * (shape[0] + shape[1] * I);
      p->state[j] = p->q[j] + creal (displacement);
      p->state[l->coordinates + j] = creal (exponent * displacement);
    }
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

static int linearise_page (const pw_linearise_command *cmd, FILE *f, pw_error *error) {
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

/* ---- The command ---- */

/* Indices in the list of files of linearise_open_files; 0 is the model. */
enum { LINEARISE_JSON = 1, LINEARISE_CSV, LINEARISE_NPZ, LINEARISE_PAGE };

/* Opens the files before anything is computed.  -o NAME stands for NAME.json, .csv and .npz. */
static int linearise_open_files (pw_linearise_command *cmd, pw_error *error) {
  enum { PATH = 4096 };
  static const char *const ending[] = { ".json", ".csv", ".npz" };
  const char *name = cmd->name, *slash = name ? strrchr (name, '/') : NULL, *last = slash ? slash + 1 : name,
             *format = name ? strrchr (last, '.') : NULL, *path[3] = { cmd->json_path };
  int found = 0;
  if (last && (*last == 0 || strcmp (last, ".") == 0 || strcmp (last, "..") == 0 || strlen (name) > PATH - 10))
    return pw_fail (error, PW_INPUT, "-o %.200s: expected the name of a file, .csv, .npz or .json", name);
  for (int i = 0; i < 3 && format; i++)
    if (strcmp (format, ending[i]) == 0) path[i] = name, found = 1;
  if (name && !found && pw_cli_names_file (last))
    return pw_fail (error, PW_INPUT, "-o %.200s: expected a name that ends in .csv, .npz or .json", name);
  if (name && !found) {
    path[0] = pw_arena_copy (&cmd->line.arena, PW_PRINTED (PATH, "%s.json", name));
    path[1] = pw_arena_copy (&cmd->line.arena, PW_PRINTED (PATH, "%s.csv", name));
    path[2] = pw_arena_copy (&cmd->line.arena, PW_PRINTED (PATH, "%s.npz", name));
    if (path[0] == NULL || path[1] == NULL || path[2] == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  }
  if (cmd->page_path && pw_animation_check ("--animate", cmd->page_path, error) != PW_OK) return error->status;
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { path[0] == cmd->json_path ? "--json" : "-o", path[0], PW_WRITES, NULL },
                   { "-o", path[1], PW_WRITES, NULL },
                   { "-o", path[2], PW_WRITES, NULL },
                   { "--animate", cmd->page_path, PW_WRITES, NULL } };
  return pw_files_open (&cmd->line, use, sizeof use / sizeof *use, error);
}

static int linearise_command (void *options, pw_error *error) {
  pw_linearise_command *cmd = options;
  if (cmd->hold_texts && !cmd->steady) return pw_fail (error, PW_INPUT, "--hold needs --steady");
  cmd->t = cmd->at.number;
  int status =
      pw_cli_requires ("--limit", cmd->line.limit.text, "--at or --steady", cmd->at.text || cmd->steady, error);
  if (status == PW_OK) status = pw_cli_open (&cmd->line, error);
  if (status == PW_OK) status = linearise_select (cmd, error);
  if (status == PW_OK) status = linearise_open_files (cmd, error);
  if (status == PW_OK) pw_report_model (&cmd->line.m);
  const char *model = status == PW_OK ? pw_file_name (cmd->line.m.file) : NULL;
  const int coordinates = status == PW_OK ? pw_system_coordinates (cmd->line.m.system) : 0;
  if (coordinates > LINEARISE_COORDINATES)
    status = pw_fail (error, PW_INPUT, "%s has %d coordinates; linearise takes at most %d", model, coordinates,
                      LINEARISE_COORDINATES);
  if (status == PW_OK) status = linearise_run (cmd, error);
  if (status == PW_OK) status = pw_run_linear_modes (cmd->r, LINEARISE_COORDINATES, &cmd->linear, error);
  if (status == PW_OK && cmd->linear.unknowns == 0)
    status = pw_fail (error, PW_INPUT, "%s has no degrees of freedom: there is nothing to linearise", model);
  if (status == PW_OK) linearise_print (cmd);
  FILE *json = pw_files_stream (&cmd->line, LINEARISE_JSON), *csv = pw_files_stream (&cmd->line, LINEARISE_CSV),
       *npz = pw_files_stream (&cmd->line, LINEARISE_NPZ);
  if (status == PW_OK && json) linearise_json (cmd, &(pw_json){ .f = json, .lines = 1 });
  if (status == PW_OK && csv) linearise_csv (cmd, &(pw_cells){ .f = csv });
  if (status == PW_OK && npz) status = linearise_npz (cmd, npz, error);
  if (status == PW_OK && cmd->page_path)
    status = linearise_page (cmd, pw_files_stream (&cmd->line, LINEARISE_PAGE), error);
  if (status == PW_OK) status = pw_files_finish (&cmd->line, error);
  pw_linear_free (&cmd->linear);
  pw_run_close (cmd->r);
  free (cmd->initial);
  free (cmd->input);
  free (cmd->output);
  if (status == PW_RETRY) pw_cli_say ("pinwheel: interrupted\n");
  return status == PW_RETRY ? PW_INTERRUPTED : status;
}

static const struct poptOption linearise_options[] = {
  PW_OPTION_GROUP ("Linearisation"),
  PW_NUMBER_OPTION (pw_linearise_command, at, "at", 0, "T", PW_NONNEGATIVE,
                    "At time T [s] of a run with the model's default method (default 0)"),
  PW_FLAG_OPTION (pw_linearise_command, steady, "steady",
                  "At the steady motion that is reached from the initial state; signals are those of --at"),
  PW_HOLD_OPTION (pw_linearise_command, hold_texts),
  PW_LIST_OPTION (pw_linearise_command, input_names, "input", 0, "SIGNAL",
                  "Input u: the signal of a force, ELEMENT or ELEMENT.FIELD; repeatable (default all)"),
  PW_LIST_OPTION (pw_linearise_command, output_names, "output", 0, "STATE",
                  "Output y: a state, BODY.x, .y, .phi, .vx, .vy or .omega; repeatable (default all)"),
  PW_TEXT_OPTION (pw_linearise_command, name, "name", 'o', "FILE",
                  "Write FILE.csv (the matrix [A B; C D]), FILE.npz for NumPy, FILE.json (everything), or without an "
                  "ending all three"),
  PW_TEXT_OPTION (pw_linearise_command, json_path, "json", 0, "FILE", "Write everything as JSON"),
  PW_TEXT_OPTION (pw_linearise_command, page_path, "animate", 0, "FILE.html",
                  "Write a page in which the modes are animated"),
  PW_LIMIT_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_linearise = {
  .name = "linearise",
  .synopsis = "MODEL [OPTION...]",
  .summary = "linearise a model: matrices, eigenvalues and mode shapes",
  .help = "Linearise the equations of motion in minimal coordinates, which satisfy the constraints, in a frame that "
          "moves with the motion: x' = A x + B u, y = C x + D u. Prints eigenvalues with frequency, damping and time "
          "to double or halve, and mode shapes.",
  .options_size = sizeof (pw_linearise_command),
  .function = linearise_command,
  .options = linearise_options,
};
