/* pinwheel show --matrices: the equations  M a + J^T lambda = f,  J a = gamma  in numbers. */
#include <stdio.h>
#include <stdlib.h>
#include "show.h"
#include "system.h"

enum { MATRICES_DIGITS = 7, MATRICES_PANEL = 6 /* columns of J side by side */ };

/* One array of everything: f (coords + 3), g eta gamma (rows each), unit (coords + 3), column (PANEL x rows). */
typedef struct {
  double *f, *g, *eta, *gamma, *unit, *column;
} matrices;

static void matrices_number (double value) {
  char text[32];
  printf (" %14s", pw_format (text, value, MATRICES_DIGITS));
}

/* "name [unit]" in a column of its own. */
static void matrices_name (const char *name, const char *unit) {
  char text[300];
  snprintf (text, sizeof text, "%s [%s]", name, unit);
  printf ("  %-22s", text);
}

static void matrices_coordinates (const pw_system *s, const matrices *k, const pw_sample *x) {
  char name[300];
  printf ("\nM (diagonal), forces and state by coordinate; SI units\n  %-22s %14s %14s %14s %14s %14s\n", "", "M", "f",
          "q", "v", "a");
  for (int j = 0; j < s->coords; j++) {
    matrices_name (pw_state_name (s, j, name, sizeof name), pw_state_unit (s, j));
    const double value[] = { s->mass[j], k->f[j], x->q[j], x->v[j], x->a[j] };
    for (int i = 0; i < 5; i++) matrices_number (value[i]);
    putchar ('\n');
  }
}

static void matrices_rows (const pw_system *s, const matrices *k, const pw_sample *x) {
  char name[300];
  printf ("\ngamma and its companions by constraint row, named after the row's reaction, which is -lambda\n"
          "  %-22s %14s %14s %14s %14s\n",
          "", "gamma", "eta", "g", "lambda");
  for (int i = 0; i < s->rows; i++) {
    matrices_name (pw_reaction_name (s, i, name, sizeof name), pw_reaction_unit (s, i));
    matrices_number (k->gamma[i]);
    matrices_number (k->eta[i]);
    if (i < s->holonomic)
      matrices_number (k->g[i]);
    else
      printf (" %14s", "-");
    matrices_number (x->lambda[i]);
    putchar ('\n');
  }
}

/* A few columns of J, each J times a unit vector; in a large scene only the rows that are not zero there. */
static void matrices_panel (const pw_system *s, const matrices *k, int first, int columns) {
  char name[300];
  printf ("\n  %-22s", "J");
  for (int c = 0; c < columns; c++) {
    printf (" %14s", pw_state_name (s, first + c, name, sizeof name));
    k->unit[first + c] = 1;
    pw_mul_J (s, k->unit, k->column + c * s->rows);
    k->unit[first + c] = 0;
  }
  putchar ('\n');
  for (int i = 0; i < s->rows; i++) {
    int used = s->coords <= 2 * MATRICES_PANEL;
    for (int c = 0; c < columns; c++) used |= k->column[c * s->rows + i] != 0;
    if (!used) continue;
    printf ("  %-22s", pw_reaction_name (s, i, name, sizeof name));
    for (int c = 0; c < columns; c++) matrices_number (k->column[c * s->rows + i]);
    putchar ('\n');
  }
}

static void matrices_print (const pw_cli_model *m, const matrices *k, const pw_sample *x) {
  const pw_system *s = m->system;
  char t[32];
  printf ("%s at t = %s s\n", pw_file_name (m->file), pw_format (t, x->t, MATRICES_DIGITS));
  matrices_coordinates (s, k, x);
  if (s->rows == 0) {
    puts ("\nThe model has no constraints: no J, no gamma");
    return;
  }
  matrices_rows (s, k, x);
  if (s->coords > 2 * MATRICES_PANEL) puts ("\nRows of J that are zero in the columns shown are left out");
  for (int j = 0; j < s->coords; j += MATRICES_PANEL)
    matrices_panel (s, k, j, s->coords - j < MATRICES_PANEL ? s->coords - j : MATRICES_PANEL);
}

/* Everything at a sample of the run. */
static int matrices_sample (const pw_cli_model *m, const pw_sample *x, pw_error *error) {
  pw_system *s = m->system;
  size_t coords = (size_t)s->coords + 3, rows = (size_t)s->rows;
  double *space = calloc (2 * coords + (3 + MATRICES_PANEL) * rows, sizeof *space);
  if (space == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  matrices k = { .f = space, .unit = space + coords, .g = space + 2 * coords };
  k.eta = k.g + rows;
  k.gamma = k.eta + rows;
  k.column = k.gamma + rows;
  int status = PW_OK;
  if (pw_place (s, x->t, x->q, x->v) != PW_OK)
    status = pw_fail (error, PW_METHOD, "at t = %g s a signal of the model reports an error", x->t);
  else {
    pw_sweep_J (s);
    pw_sweep_g (s, k.g);
    pw_sweep_eta (s, k.eta);
    pw_sweep_gamma (s, k.gamma);
    pw_sweep_force (s, k.f);
    matrices_print (m, &k, x);
  }
  free (space);
  return status;
}

int pw_show_matrices (const pw_cli_model *m, double t, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (m->file));
  pw_settings settings = { .span = t > 0 ? t : d.t_end, .step = d.step, .rtol = d.rtol };
  pw_run *r = pw_open (m->system, d.method, &settings, error);
  if (r == NULL) return error->status;
  pw_sample x;
  int status = t > 0 ? pw_advance_to (r, t, t, error) : PW_OK;
  if (status == PW_OK) status = pw_at (r, t, &x, error);
  if (status == PW_OK) status = matrices_sample (m, &x, error);
  pw_close (r);
  return status;
}
