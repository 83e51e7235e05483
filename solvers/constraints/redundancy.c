/* Redundant equations as combinations of the active ones: least-norm multipliers, and a description for the user.
 *
 * A redundant row of J is J_i = sum_a c_ia J_a over active rows a.  Its coefficients come from the saddle-point system:
 * with f = J_i^T and gamma = 0 the multipliers are c_i.  The vectors n_i = e_i - sum_a c_ia e_a, with unit vectors e,
 * span the multipliers without force, J^T n_i = 0, so the least-norm ones are lambda + N z, N = [n_1 n_2 ...], with z
 * from a least-squares problem.  N is not stored: products with it take a solution of the saddle-point system. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* The batch of an equation; *e: its element there; *J: its row of J in the columns of that element. */
static const pw_element_batch *redundancy_find (const pw_workspace *w, int row, int *e, const double **J) {
  const pw_element_batch *k = w->batch;
  while (row >= k->row + k->b.count * k->kind->rows) k++;
  *e = (row - k->row) / k->kind->rows;
  *J = k->J + (row - k->row) * k->b.cols;
  return k;
}

double pw_rank_multiplier_unit (const pw_workspace *w, int row) {
  int e;
  const double *J;
  const pw_element_batch *k = redundancy_find (w, row, &e, &J);
  for (int b = 0; b < k->kind->bodies; b++)
    if (J[3 * b] != 0 || J[3 * b + 1] != 0) return 1;
  return w->scale.length;
}

/* The norm of a row as a derivative with respect to lengths (pw_length_factor). */
static double redundancy_norm (const pw_workspace *w, int row) {
  int e;
  const double *J;
  double square = 0;
  const pw_element_batch *k = redundancy_find (w, row, &e, &J);
  for (int c = 0; c < k->b.cols; c++) {
    int j = pw_global (k, e, c);
    double x = j < w->s->coords ? J[c] / pw_length_factor (w->s, j) : 0;
    square += x * x;
  }
  return sqrt (square);
}

/* f += weight J_i^T */
static void redundancy_add_row (const pw_workspace *w, int row, double weight, double *f) {
  int e;
  const double *J;
  const pw_element_batch *k = redundancy_find (w, row, &e, &J);
  for (int c = 0; c < k->b.cols; c++) f[pw_global (k, e, c)] += weight * J[c];
}

/* Solves r->row_force = J^T c for the multipliers c and clears the force. */
static void redundancy_solve (pw_run *r, double *c) {
  memset (c, 0, (size_t)r->s->rows * sizeof *c);
  pw_saddle_solve (r->saddle, r->row_force, c, r->row_force, c);
  memset (r->row_force, 0, (size_t)r->s->coords * sizeof *r->row_force);
}

/* Computes c of the i-th redundant row, where J is evaluated and the saddle factorised. */
static void redundancy_coefficients (pw_run *r, int i) {
  redundancy_add_row (r->w, r->redundant_row[i], 1, r->row_force);
  redundancy_solve (r, r->coefficient);
}

/* One solution, for a sum of all redundant rows; their weights are irregular so that terms do not cancel. */
double pw_rank_independence (pw_run *r) {
  double *c = r->coefficient /* overwritten: each user computes it first */, most = 0;
  for (int i = 0; i < r->redundant; i++) {
    int row = r->redundant_row[i];
    double x = pw_irregular (0, row + 1), norm = redundancy_norm (r->w, row);
    double weight = (x + copysign (1, x)) / 2; /* of modulus 1/2 to 1 */
    if (norm > 0) redundancy_add_row (r->w, row, weight / norm, r->row_force);
  }
  redundancy_solve (r, c);
  for (int row = 0; row < r->s->rows; row++)
    if (r->active[row]) most = pw_larger_or_nan (most, fabs (c[row]) * redundancy_norm (r->w, row));
  return isnan (most) ? 0 : 1 / most;
}

/* change = N z, where z has entries for redundant rows only. */
static void redundancy_change (pw_run *r, const double *z, double *change) {
  double *c = r->coefficient;
  pw_add_JT (r->w, z, r->row_force);
  redundancy_solve (r, c);
  for (int i = 0; i < r->s->rows; i++) change[i] = z[i] - c[i];
}

/* slope = -N^T (lambda / square), without entries for active rows; (c_i, x) = J_i a with J_a a = x. */
static void redundancy_slope (pw_run *r, const double *lambda, const double *square, double *slope) {
  double *x = r->coefficient, *a = r->row_force;
  for (int i = 0; i < r->s->rows; i++) x[i] = r->active[i] ? lambda[i] / square[i] : 0;
  pw_saddle_solve (r->saddle, NULL, x, a, x);
  pw_mul_J (r->w, a, slope);
  for (int i = 0; i < r->s->rows; i++) slope[i] = r->active[i] ? 0 : slope[i] - lambda[i] / square[i];
  memset (a, 0, (size_t)r->s->coords * sizeof *a);
}

/* sum x_i y_i scale_i, or with inverse = 1 sum x_i y_i / scale_i */
static double redundancy_product (const pw_run *r, const double *x, const double *y, const double *square,
                                  int inverse) {
  double sum = 0;
  for (int i = 0; i < r->s->rows; i++) sum += inverse ? x[i] * y[i] / square[i] : x[i] * y[i] * square[i];
  return sum;
}

/* Minimises sum (lambda / unit)^2 by conjugate gradients (CGLS: Bjorck 1996, Numerical Methods for Least Squares
 * Problems, section 7.4), with multipliers in these units: then the slope is at least the distance to the minimum.
 * There are as many different eigenvalues as redundant rows, or as active rows and one, at most. */
void pw_rank_least_norm (pw_run *r, double *lambda) {
  const double accepted = 1e-14;
  const int rows = r->s->rows, most = r->redundant < rows - r->redundant ? r->redundant : rows - r->redundant + 1;
  double *square = r->coefficient + rows, *slope = square + rows, *z = slope + rows, *change = z + rows, before = 0;
  for (int i = 0; i < rows; i++) square[i] = pow (pw_rank_multiplier_unit (r->w, i), 2), z[i] = 0;
  for (int n = 0; n <= most; n++) {
    redundancy_slope (r, lambda, square, slope);
    double now = redundancy_product (r, slope, slope, square, 0);
    if (now <= accepted * accepted * redundancy_product (r, lambda, lambda, square, 1)) return;
    for (int i = 0; i < rows; i++) z[i] = slope[i] * square[i] + (n > 0 ? now / before * z[i] : 0);
    redundancy_change (r, z, change);
    double length = now / redundancy_product (r, change, change, square, 1);
    for (int i = 0; i < rows; i++) lambda[i] += length * change[i];
    before = now;
  }
}

/* ---- Description ---- */

static void redundancy_append (char *buffer, size_t size, const char *text) {
  size_t n = strlen (buffer);
  snprintf (buffer + n, size - n, "%s", text);
}

/* The common direction of two reactions "ELEMENT.N" or the like: "lateral ", or "". */
static const char *redundancy_direction (const char *one, const char *two) {
  static const struct {
    const char *reaction, *direction;
  } known[] = { { "N", "lateral " }, { "T", "rolling " }, { "Fx", "x " }, { "Fy", "y " }, { "M", "angular " } };
  const char *a = strrchr (one, '.') + 1, *b = strrchr (two, '.') + 1;
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (strcmp (a, known[i].reaction) == 0 && strcmp (b, known[i].reaction) == 0) return known[i].direction;
  return "";
}

/* Describes two rows that are multiples of each other: "wheels left and right: the same lateral constraint". */
static void redundancy_describe_pair (const pw_system *s, int one, int two, char *buffer, size_t size) {
  const char *a = PW_NAME (pw_system_row_name, s, one), *b = PW_NAME (pw_system_row_name, s, two);
  const char *reaction_a = PW_NAME (pw_system_reaction_name, s, one);
  const char *reaction_b = PW_NAME (pw_system_reaction_name, s, two);
  const char *direction = redundancy_direction (reaction_a, reaction_b);
  size_t kind = strcspn (a, " "); /* length of the element's type, with which its name begins */
  if (strcmp (a, b) == 0)
    snprintf (buffer, size, "%s: %s and %s are the same constraint", a, reaction_a, reaction_b);
  else if (kind == strcspn (b, " ") && strncmp (a, b, kind) == 0)
    snprintf (buffer, size, "%.*ss%s and%s: the same %sconstraint", (int)kind, a, a + kind, b + kind, direction);
  else
    snprintf (buffer, size, "%s and %s: the same %sconstraint", a, b, direction);
}

char *pw_run_redundancy (pw_run *r, int i, char *buffer, size_t size) {
  enum { MAX_ELEMENTS = 6 };
  const double round_off = 1e-8; /* of c between rows of norm 1: eps / sine^2, if active rows have sines above 1.5e-4 */
  const pw_system *s = r->s;
  if (i < 0 || i >= r->redundant) return snprintf (buffer, size, "%s", ""), buffer;
  int row = r->redundant_row[i], partners = 0, last = -1, elements = 0;
  char before[PW_NAME_BYTES] = "";
  const char *own = PW_NAME (pw_system_row_name, s, row);
  snprintf (buffer, size, "%s (%s)", own, PW_NAME (pw_system_reaction_name, s, row));
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return buffer;
  if (pw_saddle_factor (r->saddle) != PW_OK) return buffer;
  redundancy_coefficients (r, i);
  const double *c = r->coefficient, least = round_off * redundancy_norm (r->w, row);
  for (int a = 0; a < s->rows; a++) {
    if (c[a] == 0 || fabs (c[a]) * redundancy_norm (r->w, a) <= least) continue;
    partners++, last = a;
    const char *element = PW_NAME (pw_system_row_name, s, a);
    if (elements > MAX_ELEMENTS || strcmp (element, own) == 0 || strcmp (element, before) == 0) continue;
    strcpy (before, element);
    redundancy_append (buffer, size, elements == MAX_ELEMENTS ? " and others" : elements > 0 ? ", " : " follows from ");
    if (elements++ < MAX_ELEMENTS) redundancy_append (buffer, size, element);
  }
  if (partners == 0) redundancy_append (buffer, size, " has no effect in this configuration");
  if (partners > 1 && elements == 0) redundancy_append (buffer, size, " follows from its other equations");
  if (partners == 1) redundancy_describe_pair (s, last, row, buffer, size);
  return buffer;
}
