/* pinwheel show --matrices: the equations  M a + J^T lambda = f,  J a = gamma  in numbers. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "print_table.h"
#include "show.h"

enum { MATRICES_DIGITS = 7, MATRICES_PANEL = 6 /* columns of J side by side */ };

static void matrices_head (pw_table *t, const char *const *head) {
  for (pw_cell (t, -22, ""); *head; head++) pw_cell (t, 13, *head);
  pw_row_end (t);
}

static void matrices_coordinates (const pw_system *s, const pw_equations *k, const pw_sample *x) {
  static const char *const head[] = { "M", "f", "q", "v", "a", NULL };
  char name[300];
  puts ("\nM (diagonal), forces and state by coordinate; SI units");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    matrices_head (&t, head);
    for (int j = 0; j < k->coordinates; j++) {
      const double value[] = { k->mass[j], k->force[j], x->q[j], x->v[j], x->a[j] };
      pw_cell_unit (&t, -22, pw_system_state_name (s, j, name, sizeof name), pw_system_state_unit (s, j));
      for (int i = 0; i < 5; i++) pw_cell_number (&t, 13, value[i], MATRICES_DIGITS);
      pw_row_end (&t);
    }
  }
}

static void matrices_rows (const pw_system *s, const pw_equations *k, const pw_sample *x) {
  static const char *const head[] = { "gamma", "eta", "g", "lambda", NULL };
  char name[300];
  puts ("\ngamma, eta, g and lambda by constraint equation, named after its reaction, which is -lambda");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    matrices_head (&t, head);
    for (int i = 0; i < k->rows; i++) {
      pw_cell_unit (&t, -22, pw_system_reaction_name (s, i, name, sizeof name), pw_system_reaction_unit (s, i));
      pw_cell_number (&t, 13, k->gamma[i], MATRICES_DIGITS);
      pw_cell_number (&t, 13, k->eta[i], MATRICES_DIGITS);
      if (i < k->holonomic)
        pw_cell_number (&t, 13, k->g[i], MATRICES_DIGITS);
      else
        pw_cell (&t, 13, "-");
      pw_cell_number (&t, 13, x->lambda[i], MATRICES_DIGITS);
      pw_row_end (&t);
    }
  }
}

/* A few columns of J, with scratch memory for them; in a large scene only the rows that are not zero there. */
static void matrices_panel (const pw_system *s, const pw_equations *k, int first, int columns, double *J) {
  char name[300];
  memset (J, 0, (size_t)k->rows * MATRICES_PANEL * sizeof *J);
  for (int i = 0; i < k->entries; i++)
    if (k->column[i] >= first && k->column[i] < first + columns)
      J[k->row[i] * MATRICES_PANEL + k->column[i] - first] = k->value[i] + 0; /* not -0 */
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -22, "J");
    for (int c = 0; c < columns; c++) pw_cell (&t, 13, pw_system_state_name (s, first + c, name, sizeof name));
    pw_row_end (&t);
    for (int i = 0; i < k->rows; i++) {
      const double *row = J + (size_t)i * MATRICES_PANEL;
      int used = k->coordinates <= 2 * MATRICES_PANEL;
      for (int c = 0; c < columns; c++) used |= row[c] != 0;
      if (!used) continue;
      pw_cell (&t, -22, pw_system_reaction_name (s, i, name, sizeof name));
      for (int c = 0; c < columns; c++) pw_cell_number (&t, 13, row[c], MATRICES_DIGITS);
      pw_row_end (&t);
    }
  }
}

static int matrices_print (const pw_cli_model *m, const pw_equations *k, const pw_sample *x, pw_error *error) {
  const pw_system *s = m->system;
  char t[32];
  double *J = malloc ((size_t)k->rows * MATRICES_PANEL * sizeof *J + 1);
  if (J == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  printf ("%s at t = %s s\n", pw_file_name (m->file), pw_format (t, x->t, MATRICES_DIGITS));
  matrices_coordinates (s, k, x);
  if (k->rows == 0) puts ("\nThe model has no constraints: no J, no gamma");
  if (k->rows > 0) matrices_rows (s, k, x);
  if (k->rows > 0 && k->coordinates > 2 * MATRICES_PANEL)
    puts ("\nRows of J that are zero in the columns shown are left out");
  for (int j = 0; k->rows > 0 && j < k->coordinates; j += MATRICES_PANEL)
    matrices_panel (s, k, j, k->coordinates - j < MATRICES_PANEL ? k->coordinates - j : MATRICES_PANEL, J);
  free (J);
  return PW_OK;
}

/* Everything at a sample of the run. */
static int matrices_sample (const pw_cli_model *m, const pw_sample *x, pw_error *error) {
  pw_equations k;
  int status = pw_system_equations (m->system, x->t, x->q, x->v, &k, error);
  if (status == PW_OK) status = matrices_print (m, &k, x, error);
  pw_equations_free (&k);
  return status;
}

int pw_show_matrices (const pw_cli_model *m, double t, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (m->file));
  pw_settings settings = { .span = t > 0 ? t : d.t_end, .step = d.step, .rtol = d.rtol };
  pw_run *r = pw_run_open (m->system, d.method, &settings, error);
  if (r == NULL) return error->status;
  pw_sample x;
  int status = t > 0 ? pw_run_advance_to (r, t, t, error) : PW_OK;
  if (status == PW_OK) status = pw_run_sample (r, t, &x, error);
  if (status == PW_OK) status = matrices_sample (m, &x, error);
  pw_run_close (r);
  return status;
}
