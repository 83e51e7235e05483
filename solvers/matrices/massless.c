/* Elimination of massless coordinates, and the two halves of a solution; see massless.h. */
#include <math.h>
#include <stdlib.h>
#include "massless.h"
#include "block_ldl.h"
#include "util.h"

/* `pivots` is c->pivots: an argument, since it is the constant 3 in most calls, so that loops are unrolled. */

/* ---- Elimination ---- */

/* Copies J to A. */
PW_INLINE void massless_copy (pw_component *c) {
  const pw_massless_group *end = c->group + c->groups;
  double *row = c->A;
  for (const pw_massless_row *r = c->row; r < c->row + c->rows; r++, row += c->stride) {
    const double **from = r->source;
    for (const pw_massless_group *g = c->group; g < end; g++) {
      const double *J = *from++;
      double *A = row + g->column;
      A[0] = J[0];
      if (g->width == 3) A[1] = J[1], A[2] = J[2];
    }
  }
}

/* The weighted sum of the squares of the entries of row i. */
static double massless_square (const pw_component *c, int i, const double *weight) {
  const double *A = c->A + i * c->stride;
  double sum = 0;
  for (int n = 0; n < c->cols; n++) sum += weight[n] * A[n] * A[n];
  return sum;
}

/* Exchanges two rows. */
static void massless_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  pw_massless_row row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int n = 0; n < c->stride; n++) {
    double x = c->A[a * c->stride + n];
    c->A[a * c->stride + n] = c->A[b * c->stride + n];
    c->A[b * c->stride + n] = x;
  }
}

/* Entries below this, relative to the terms or the largest entry of their row, are what round-off leaves of 0. */
#define MASSLESS_ROUND_OFF 1e-12

int pw_massless_is_entry (const pw_component *c, int i, int column) {
  return fabs (c->A[i * c->stride + column]) * sqrt (c->squared_scale[column]) >
         MASSLESS_ROUND_OFF * sqrt (c->row[i].squared_terms);
}

/* Matches the row with the largest entry in a massless column, each row scaled by its largest original entry (so that
 * the remainder of a dependent row is small), and moves it to p.  Returns 0 if all entries are round-off; the component
 * is then matched again at the next factorisation. */
static int massless_select_pivot (pw_component *c, int p) {
  const double guard = 0.1; /* a pivot may lose a digit before the component is matched again */
  int row = -1, column = -1;
  double best = MASSLESS_ROUND_OFF;
  for (int i = p; i < c->rows; i++)
    for (int n = 0; n < c->cols; n++) {
      if (!c->is_massless[n]) continue;
      double scaled = sqrt (c->squared_scale[n]) * fabs (c->A[i * c->stride + n]) / c->row[i].largest;
      if (scaled > best) best = scaled, row = i, column = n;
    }
  if (row < 0) {
    for (int i = 0; i < c->pivots; i++) c->row[i].rematch_below = NAN;
    return 0;
  }
  massless_swap (c, p, row);
  c->row[p].pivot_column = column;
  c->row[p].pivot_scale = sqrt (c->squared_scale[column]) / c->row[p].largest;
  c->row[p].rematch_below = guard * best;
  return 1;
}

/* Subtracts multiples of row p from the rows after it, two columns at a time. */
PW_INLINE void massless_eliminate (pw_component *c, int p, int pivots) {
  const int pivot = c->row[p].pivot_column, cols = c->cols;
  double *P = c->A + p * c->stride, inverse = 1 / P[pivot];
  double square = c->rows > pivots ? massless_square (c, p, c->massive_squared_scale) : 0;
  for (int i = p + 1; i < c->rows; i++) {
    double *A = c->A + i * c->stride, l = A[pivot] * inverse;
    A[c->first_L_column + p] = l;
    if (l == 0) continue;
    for (int k = 0; k < cols; k += 2) {
      double even = A[k] - l * P[k], odd = A[k + 1] - l * P[k + 1];
      A[k] = even, A[k + 1] = odd;
    }
    A[pivot] = 0;
    c->row[i].squared_terms += l * l * square;
  }
  P[pivot] = inverse;
}

typedef enum { MASSLESS_AS_MATCHED, MASSLESS_MATCH } massless_mode;

/* Eliminates with the pivots matched before, or matches them.  Returns the number of pivots that are large enough. */
PW_INLINE int massless_reduce (pw_component *c, massless_mode mode, int pivots) {
  const int matches = mode == MASSLESS_MATCH;
  massless_copy (c);
  c->least_pivot = INFINITY;
  for (int i = matches ? 0 : pivots; i < c->rows; i++)
    c->row[i].squared_terms = massless_square (c, i, c->squared_scale);
  for (int i = 0; matches && i < c->rows; i++) {
    c->row[i].largest = 0;
    for (int k = 0; k < c->cols; k++)
      c->row[i].largest = fmax (c->row[i].largest, sqrt (c->squared_scale[k]) * fabs (c->A[i * c->stride + k]));
  }
  PW_UNROLL for (int p = 0; p < pivots; p++) {
    if (matches && !massless_select_pivot (c, p)) return p;
    const pw_massless_row *row = &c->row[p];
    double pivot = fabs (c->A[p * c->stride + row->pivot_column]) * row->pivot_scale;
    if (!(pivot >= c->least_pivot)) c->least_pivot = pivot;
    if (!matches && !(pivot >= row->rematch_below)) return p;
    massless_eliminate (c, p, pivots);
  }
  return pivots;
}

int pw_massless_match (pw_component *c) {
  return massless_reduce (c, MASSLESS_MATCH, c->pivots);
}

double pw_massless_factor (pw_massless *m) {
  double least = INFINITY;
  for (pw_component *c = m->component; c < m->end; c++) {
    int found = c->pivots == 3 ? massless_reduce (c, MASSLESS_AS_MATCHED, 3)
                               : massless_reduce (c, MASSLESS_AS_MATCHED, c->pivots);
    if (found < c->pivots && pw_massless_match (c) < c->pivots) return 0;
    for (int i = c->pivots; i < c->rows; i++) {
      double terms = c->row[i].squared_terms, square = massless_square (c, i, c->massive_squared_scale);
      double remainder = terms > 0 ? sqrt (square / terms) : 0;
      if (!(remainder >= c->least_pivot)) c->least_pivot = remainder;
    }
    if (!(c->least_pivot >= least)) least = c->least_pivot;
  }
  return least > 1 ? 1 : least * least;
}

/* ---- Solving ---- */

/* gamma~, then w in place of lambda, then f~. */
PW_INLINE void massless_forward (pw_component *c, double *f, double *gamma, int pivots) {
  pw_massless_row *row = c->row;
  for (int i = 0; i < c->rows; i++) {
    const double *L = c->A + i * c->stride + c->first_L_column;
    row[i].gamma = gamma[row[i].equation];
    PW_UNROLL for (int p = 0; p < pivots; p++) row[i].gamma -= p < i ? L[p] * row[p].gamma : 0;
  }
  for (int i = pivots; i < c->rows; i++)
    if (c->unknown[i] >= 0) gamma[c->unknown[i]] = row[i].gamma;
  PW_UNROLL for (int p = 0; p < pivots; p++) {
    double w = f[c->global[row[p].pivot_column]];
    PW_UNROLL for (int q = 0; q < p; q++) w -= c->A[q * c->stride + row[p].pivot_column] * row[q].lambda;
    row[p].lambda = w * c->A[p * c->stride + row[p].pivot_column];
  }
  for (const int *column = c->massive; column < c->massive + c->massives; column++) {
    double change = 0;
    PW_UNROLL for (int p = 0; p < pivots; p++) change += c->A[p * c->stride + *column] * row[p].lambda;
    f[c->global[*column]] -= change;
  }
}

void pw_massless_forward (pw_massless *m, double *f, double *gamma) {
  for (pw_component *c = m->component; c < m->end; c++)
    c->pivots == 3 ? massless_forward (c, f, gamma, 3) : massless_forward (c, f, gamma, c->pivots);
}

/* gamma~ - H' a, then a_P and lambda_p from the last pivot to the first. */
PW_INLINE void massless_backward (pw_component *c, double *a, double *lambda, int pivots) {
  pw_massless_row *row = c->row;
  for (const int *column = c->massive; column < c->massive + c->massives; column++) {
    double x = a[c->global[*column]];
    PW_UNROLL for (int p = 0; p < pivots; p++) row[p].gamma -= c->A[p * c->stride + *column] * x;
  }
  /* reads all before storing any: one row's index may be the `unknown` of another */
  for (int i = pivots; i < c->rows; i++) row[i].lambda = c->unknown[i] < 0 ? 0 : lambda[c->unknown[i]];
  for (int i = pivots; i < c->rows; i++) lambda[row[i].equation] = row[i].lambda;
  PW_UNROLL for (int p = pivots - 1; p >= 0; p--) {
    const double *A = c->A + p * c->stride;
    double x = row[p].gamma;
    PW_UNROLL for (int q = p + 1; q < pivots; q++) x -= A[row[q].pivot_column] * a[c->global[row[q].pivot_column]];
    a[c->global[row[p].pivot_column]] = x * A[row[p].pivot_column];
    for (int i = p + 1; i < c->rows; i++) row[p].lambda -= c->A[i * c->stride + c->first_L_column + p] * row[i].lambda;
    lambda[row[p].equation] = row[p].lambda;
  }
}

void pw_massless_backward (pw_massless *m, double *a, double *lambda) {
  for (pw_component *c = m->component; c < m->end; c++)
    c->pivots == 3 ? massless_backward (c, a, lambda, 3) : massless_backward (c, a, lambda, c->pivots);
}

/* Finds the components of rows and massless coordinates by union-find; see massless.h. */

/* ---- Components ---- */

/* Union-find over the groups that contain massless coordinates, here called massless groups. */
typedef struct {
  const pw_system *s;
  const pw_workspace *w;
  const double *weight;
  const unsigned char *active;
  int rows, groups;
  int *parent; /* groups */
  int *member; /* groups: -1: in no active row; at a root, once they are numbered: the number of its component */
} massless_plan;

/* 1 if a group contains a massless coordinate. */
static int massless_is_group (const massless_plan *p, int group) {
  int j = pw_group_first (p->s, group);
  for (int n = 0; n < pw_group_width (p->s, j); n++)
    if (p->weight[j + n] == 0) return 1;
  return 0;
}

/* The groups of an element's coordinates, without the ground, and the first local column of each.  Returns their
 * number. */
static int massless_element_groups (const pw_system *s, const pw_element_batch *k, int e, int *group, int *column) {
  int n = 0;
  for (int x = 0; x < k->b.cols; x += pw_group_columns (k->kind, x)) {
    int j = pw_global (k, e, x);
    if (j >= s->coords) continue;
    column[n] = x;
    group[n++] = pw_group_of (s, j);
  }
  return n;
}

static int massless_is_active (const massless_plan *p, int row) {
  return row < p->rows && (p->active == NULL || p->active[row]);
}

/* Unites massless groups that share an active row, and marks them as members. */
static void massless_unite (massless_plan *p) {
  int group[PW_MASSLESS_GROUPS], column[PW_MASSLESS_GROUPS];
  PW_EACH_CONSTRAINT (k, p->w)
    for (int e = 0; e < k->b.count; e++) {
      int active = 0, last = -1, n = massless_element_groups (p->s, k, e, group, column);
      for (int i = 0; i < k->kind->rows; i++) active |= massless_is_active (p, k->row + e * k->kind->rows + i);
      for (int i = 0; active && i < n; i++) {
        if (!massless_is_group (p, group[i])) continue;
        p->member[group[i]] = 0;
        if (last >= 0) p->parent[pw_root (p->parent, group[i])] = pw_root (p->parent, last);
        last = group[i];
      }
    }
}

/* The index of a group in a component; adds it if it is not there. */
static int massless_add_group (const pw_system *s, pw_component *c, int g) {
  int j = pw_group_first (s, g), width = pw_group_width (s, j);
  for (int i = 0; i < c->groups; i++)
    if (c->group[i].j == j) return i;
  c->group[c->groups] = (pw_massless_group){ j, width, c->cols };
  for (int n = 0; n < width; n++) c->global[c->cols++] = j + n;
  return c->groups++;
}

/* Adds a row and its groups to a component. */
static void massless_add_row (const pw_system *s, pw_component *c, int row, int n, const int *group, const int *column,
                              const double *J) {
  pw_massless_row *to = &c->row[c->rows++];
  to->equation = row;
  for (int i = 0; i < n; i++) to->source[massless_add_group (s, c, group[i])] = J + column[i];
}

/* Adds each active row with a massless group to the component of that group; before massless_lay_out, only counts the
 * rows, and the groups with repetition. */
static void massless_add_rows (massless_plan *p, pw_massless *m) {
  int group[PW_MASSLESS_GROUPS], column[PW_MASSLESS_GROUPS];
  PW_EACH_CONSTRAINT (k, p->w)
    for (int e = 0; e < k->b.count; e++) {
      int n = massless_element_groups (p->s, k, e, group, column), first = 0;
      while (first < n && !massless_is_group (p, group[first])) first++;
      for (int i = e * k->kind->rows; first < n && i < (e + 1) * k->kind->rows; i++) {
        if (!massless_is_active (p, k->row + i)) continue;
        int component = m->component_of_row[k->row + i] = p->member[pw_root (p->parent, group[first])];
        pw_component *c = &m->component[component];
        c->grounded |= pw_is_grounded (p->s, k, e);
        if (c->row)
          massless_add_row (p->s, c, k->row + i, n, group, column, k->J + i * k->b.cols);
        else
          c->rows++, c->groups += n;
      }
    }
}

/* Allocates the components' arrays.  A component has at most as many groups as were counted with repetition, at most
 * those of the scene, and at most as many pivots as rows. */
static int massless_lay_out (pw_massless *m, const massless_plan *p) {
  static const double zero[3] = { 0 };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &m->memory);)
    for (pw_component *c = m->component; c < m->end; c++) {
      size_t rows = (size_t)c->rows, groups = (size_t)(c->groups < p->groups ? c->groups : p->groups),
             cols = 3 * groups;
      c->group = pw_layout_alloc (&l, groups, sizeof *c->group);
      c->global = pw_layout_alloc (&l, cols, sizeof *c->global);
      c->is_massless = pw_layout_alloc (&l, cols, 1);
      c->massive = pw_layout_alloc (&l, cols, sizeof *c->massive);
      c->squared_scale = pw_layout_alloc (&l, cols, sizeof *c->squared_scale);
      c->massive_squared_scale = pw_layout_alloc (&l, cols, sizeof *c->massive_squared_scale);
      c->row = pw_layout_alloc (&l, rows, sizeof *c->row);
      c->unknown = pw_layout_alloc (&l, rows, sizeof *c->unknown);
      c->A = pw_layout_alloc (&l, rows * (cols + rows + 1), sizeof *c->A);
      const double **from = pw_layout_alloc (&l, rows * groups, sizeof *from);
      if (l.base == NULL) continue;
      for (size_t i = 0; i < rows; i++) c->row[i].source = from + i * groups;
      for (size_t i = 0; i < rows * groups; i++) from[i] = zero;
      c->rows = c->groups = 0;
    }
  return m->memory ? PW_OK : PW_RESOURCE;
}

/* ---- Opening ---- */

static int massless_undetermined (const pw_system *s, int j, pw_error *error) {
  const char *lacking = pw_is_angle (s, j) ? "inertia" : "mass";
  int user = j < 3 * s->bodies && j % 3 == 2 ? s->angle_user[j / 3] : -1;
  const pw_element_info element = user < 0 ? (pw_element_info){ 0 } : pw_system_element (s, user);
  const char *depends = user >= 0 && pw_kind_is_built_in (element.kind) ? "depends" : "may depend";
  return pw_fail (error, PW_INPUT,
                  "model %s: %s has no %s, and no constraint determines how it moves%s; give it %s, or constrain it",
                  s->model, PW_NAME (pw_system_state_name, s, j), lacking,
                  user < 0 ? ""
                           : PW_PRINTED (300, ", although %s %s %s on it", element.kind->name, element.name, depends),
                  lacking);
}

/* Marks the massless columns and matches them; reports a column that no row determines. */
static int massless_check (pw_massless *m, const massless_plan *p, pw_error *error) {
  const pw_system *s = p->s;
  for (pw_component *c = m->component; c < m->end; c++) {
    int massless = 0;
    for (int n = 0; n < c->cols; n++) {
      int j = c->global[n];
      c->squared_scale[n] = pw_is_angle (s, j) ? 1 / (s->scale.length * s->scale.length) : 1;
      c->is_massless[n] = p->weight[j] == 0;
      c->massive_squared_scale[n] = c->is_massless[n] ? 0 : c->squared_scale[n];
      if (!c->is_massless[n]) c->massive[c->massives++] = n;
      massless += c->is_massless[n];
    }
    c->pivots = massless < c->rows ? massless : c->rows;
    c->first_L_column = c->cols + c->cols % 2;
    c->stride = c->first_L_column + c->pivots;
    int found = pw_massless_match (c);
    if (found == massless) continue;
    for (int n = 0; n < c->cols; n++) {
      int used = 0;
      for (int q = 0; q < found; q++) used |= c->row[q].pivot_column == n;
      if (c->is_massless[n] && !used) return massless_undetermined (s, c->global[n], error);
    }
  }
  return PW_OK;
}

/* Numbers the components; a massless group in no active row is an error. */
static int massless_number_components (pw_massless *m, massless_plan *p, pw_error *error) {
  for (int g = 0; g < p->groups; g++) {
    if (!massless_is_group (p, g)) continue;
    int j = pw_group_first (p->s, g);
    while (p->weight[j] != 0) j++;
    if (p->member[g] < 0) return massless_undetermined (p->s, j, error);
    if (pw_root (p->parent, g) == g) p->member[g] = m->components++;
  }
  return PW_OK;
}

static int massless_build (pw_massless *m, massless_plan *p, pw_error *error) {
  for (int g = 0; g < p->groups; g++) p->parent[g] = g, p->member[g] = -1;
  for (int i = 0; i < p->s->rows; i++) m->component_of_row[i] = -1;
  massless_unite (p);
  int status = massless_number_components (m, p, error);
  if (status != PW_OK || m->components == 0) return status;
  m->component = calloc ((size_t)m->components, sizeof *m->component);
  if (m->component == NULL) return PW_RESOURCE;
  m->end = m->component + m->components;
  massless_add_rows (p, m);
  if (massless_lay_out (m, p) != PW_OK) return PW_RESOURCE;
  massless_add_rows (p, m);
  return massless_check (m, p, error);
}

int pw_massless_open (pw_massless *m, pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                      pw_error *error) {
  massless_plan p = { .s = w->s, .w = w, .weight = weight, .active = active, .rows = rows, .groups = pw_groups (w->s) };
  p.parent = malloc (((size_t)p.groups + 1) * sizeof *p.parent);
  p.member = malloc (((size_t)p.groups + 1) * sizeof *p.member);
  *m = (pw_massless){ .component_of_row = malloc (((size_t)w->s->rows + 1) * sizeof *m->component_of_row) };
  int status = p.parent && p.member && m->component_of_row ? massless_build (m, &p, error) : PW_RESOURCE;
  free (p.parent);
  free (p.member);
  return status;
}

void pw_massless_close (pw_massless *m) {
  free (m->memory);
  free (m->component);
  free (m->component_of_row);
}
