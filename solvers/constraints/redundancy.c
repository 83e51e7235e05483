/* Redundant equations as combinations of the active ones, least-norm multipliers, and their description.
 *
 * A redundant equation is J_i = sum_a c_ia J_a over active equations a.  Its coefficients come from the saddle
 * point: with f = J_i^T and gamma = 0 the multipliers are c_i.  The vectors n_i = e_i - sum c_ia e_a span the
 * multipliers without force, J^T n_i = 0, so the least-norm ones are lambda + sum z_i n_i with z from a small
 * least-squares problem. */
#include <lapacke.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* The batch of an equation; *n: its index in the batch. */
static const pw_element_batch *redundancy_find (const pw_workspace *w, int row, int *n) {
  const pw_element_batch *k = w->batch;
  while (row >= k->row + k->b.count * k->kind->rows) k++;
  *n = row - k->row;
  return k;
}

double pw_rank_multiplier_unit (const pw_workspace *w, int row) {
  int n;
  const pw_element_batch *k = redundancy_find (w, row, &n);
  const double *J = k->J + n * k->b.cols;
  for (int b = 0; b < k->kind->bodies; b++)
    if (J[3 * b] != 0 || J[3 * b + 1] != 0) return 1;
  return w->scale.length;
}

static double redundancy_length (const pw_workspace *w, int row) {
  int n;
  double square = 0;
  const pw_element_batch *k = redundancy_find (w, row, &n);
  for (int c = 0; c < k->b.cols; c++) {
    int j = pw_global (k, n / k->kind->rows, c);
    double x = j < w->s->coords ? k->J[n * k->b.cols + c] / pw_as_length (w->s, j) : 0;
    square += x * x;
  }
  return sqrt (square);
}

/* f += weight J_i^T */
static void redundancy_add_row (const pw_workspace *w, int row, double weight, double *f) {
  int n;
  const pw_element_batch *k = redundancy_find (w, row, &n);
  for (int c = 0; c < k->b.cols; c++) {
    int j = pw_global (k, n / k->kind->rows, c);
    if (j < w->s->coords) f[j] += weight * k->J[n * k->b.cols + c];
  }
}

/* Solves r->row_force = J^T c for the multipliers c and clears the force. */
static void redundancy_solve (pw_run *r, double *c) {
  pw_saddle_solve (r->saddle, r->row_force, r->zero, r->row_force, c);
  memset (r->row_force, 0, (size_t)r->s->coords * sizeof *r->row_force);
}

/* Coefficients of the i-th redundant row in the active ones, where J is evaluated and the saddle factorised. */
static void redundancy_coefficients (pw_run *r, int i) {
  redundancy_add_row (r->w, r->redundant_row[i], 1, r->row_force);
  redundancy_solve (r, r->coefficient + i * r->s->rows);
}

/* A sum of the redundant equations with irregular weights, so that terms do not cancel, needs one solution only. */
double pw_rank_independence (pw_run *r) {
  double *c = r->coefficient, most = 0;
  for (int i = 0; i < r->redundant; i++) {
    int row = r->redundant_row[i];
    double x = pw_irregular (0, row + 1), length = redundancy_length (r->w, row);
    if (length > 0) redundancy_add_row (r->w, row, (x + copysign (1, x)) / 2 / length, r->row_force);
  }
  redundancy_solve (r, c);
  for (int row = 0; row < r->s->rows; row++)
    if (r->active[row]) most = pw_larger_or_nan (most, fabs (c[row]) * redundancy_length (r->w, row));
  return isnan (most) ? 0 : 1 / most;
}

void pw_rank_least_norm (pw_run *r, double *lambda) {
  int m = r->s->rows, k = r->redundant;
  double *c = r->coefficient, *A = r->normal, *z = A + k * k;
  for (int i = 0; i < k; i++) redundancy_coefficients (r, i);
  memset (A, 0, (size_t)(k * k + k) * sizeof *A);
  for (int row = 0; row < m; row++) { /* minimise sum ((lambda + N z) / size)^2, N = [e_i - c_i] */
    double size = pw_rank_multiplier_unit (r->w, row), weight = 1 / (size * size);
    for (int i = 0; i < k; i++) {
      double n = (r->redundant_row[i] == row) - c[i * m + row];
      z[i] -= weight * n * lambda[row];
      for (int j = 0; j <= i; j++) A[i * k + j] += weight * n * ((r->redundant_row[j] == row) - c[j * m + row]);
    }
  }
  if (LAPACKE_dposv_work (LAPACK_COL_MAJOR, 'U', k, 1, A, k, z, k) != 0) z[0] = NAN; /* multipliers become NaN */
  for (int row = 0; row < m; row++)
    for (int i = 0; i < k; i++) lambda[row] += z[i] * ((r->redundant_row[i] == row) - c[i * m + row]);
}

/* ---- Description ---- */

static void redundancy_append (char *buffer, size_t size, const char *text) {
  size_t n = strlen (buffer);
  snprintf (buffer + n, size - n, "%s", text);
}

/* The common direction of two rows with the same reaction: "lateral ", or "". */
static const char *redundancy_direction (const char *a, const char *b) {
  static const char *const word[][2] = {
    { "N", "lateral " }, { "T", "rolling " }, { "Fx", "x " }, { "Fy", "y " }, { "M", "angular " }
  };
  const char *x = strrchr (a, '.') + 1, *y = strrchr (b, '.') + 1;
  for (size_t i = 0; i < sizeof word / sizeof *word; i++)
    if (strcmp (x, word[i][0]) == 0 && strcmp (y, word[i][0]) == 0) return word[i][1];
  return "";
}

/* "wheels left and right: the same lateral constraint" */
static void redundancy_describe_pair (const pw_system *s, int one, int two, char *buffer, size_t size) {
  char a[120], b[120], x[120], y[120];
  pw_system_row_name (s, one, a, sizeof a);
  pw_system_row_name (s, two, b, sizeof b);
  const char *word = redundancy_direction (pw_system_reaction_name (s, one, x, sizeof x),
                                           pw_system_reaction_name (s, two, y, sizeof y));
  size_t kind = strcspn (a, " ");
  if (strcmp (a, b) == 0)
    snprintf (buffer, size, "%s: %s and %s are the same constraint", a, x, y);
  else if (kind == strcspn (b, " ") && strncmp (a, b, kind) == 0)
    snprintf (buffer, size, "%.*ss%s and%s: the same %sconstraint", (int)kind, a, a + kind, b + kind, word);
  else
    snprintf (buffer, size, "%s and %s: the same %sconstraint", a, b, word);
}

char *pw_run_redundancy (pw_run *r, int i, char *buffer, size_t size) {
  enum { MOST = 6 };
  const double none = 1e-8; /* round-off of a coefficient: eps / s^2 at a sine of 1.5e-4 */
  const pw_system *s = r->s;
  int row = r->redundant_row[i], partners = 0, last = -1, elements = 0;
  char element[120], own[120], before[120] = "", reaction[120];
  pw_system_row_name (s, row, own, sizeof own);
  snprintf (buffer, size, "%s (%s)", own, pw_system_reaction_name (s, row, reaction, sizeof reaction));
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return buffer;
  if (pw_saddle_factor (r->saddle) != PW_OK) return buffer;
  redundancy_coefficients (r, i);
  const double *c = r->coefficient + i * s->rows;
  for (int a = 0; a < s->rows; a++) {
    if (fabs (c[a]) < none) continue;
    partners++, last = a;
    pw_system_row_name (s, a, element, sizeof element);
    if (elements > MOST || strcmp (element, own) == 0 || strcmp (element, before) == 0) continue;
    strcpy (before, element);
    redundancy_append (buffer, size, elements == MOST ? " and others" : elements > 0 ? ", " : " follows from ");
    if (elements++ < MOST) redundancy_append (buffer, size, element);
  }
  if (partners == 0) redundancy_append (buffer, size, " has no effect in this configuration");
  if (partners == 1) redundancy_describe_pair (s, last, row, buffer, size);
  return buffer;
}
