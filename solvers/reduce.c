/* Elimination of coordinates without weight; see reduce.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "reduce.h"
#include "unroll.h"
#include "util.h"

PW_ONE_BY_ONE

/* ---- Components ---- */

/* Union-find over bodies and own coordinates that have columns without weight. */
typedef struct {
  pw_system *s;
  const double *weight;
  const unsigned char *active;
  int rows, groups;
  int *parent; /* groups */
  int *member; /* groups: component number of a root, or -1 */
} reduce_plan;

static int reduce_groups (const pw_system *s) {
  return s->bodies + s->coords - 3 * s->bodies;
}

static int reduce_group_of (const pw_system *s, int j) {
  return j < 3 * s->bodies ? j / 3 : j - 2 * s->bodies;
}

static int reduce_group_first (const pw_system *s, int g) {
  return g < s->bodies ? 3 * g : g + 2 * s->bodies;
}

static int reduce_group_width (const pw_system *s, int g) {
  return g < s->bodies ? 3 : 1;
}

static int reduce_light (const reduce_plan *p, int g) {
  int j = reduce_group_first (p->s, g);
  for (int n = 0; n < reduce_group_width (p->s, g); n++)
    if (p->weight[j + n] == 0) return 1;
  return 0;
}

static int reduce_root (const reduce_plan *p, int g) {
  while (p->parent[g] != g) g = p->parent[g] = p->parent[p->parent[g]];
  return g;
}

/* The groups an element touches, the ground left out; their first local columns go to `at`. */
static int reduce_touched (const pw_system *s, const pw_slab *k, int e, int *group, int *at) {
  int n = 0;
  for (int b = 0; b < k->kind->bodies; b++) {
    int j = k->column[e * k->kind->bodies + b];
    if (j >= s->coords) continue;
    at[n] = 3 * b;
    group[n++] = reduce_group_of (s, j);
  }
  for (int o = 0; o < k->kind->own; o++) {
    at[n] = 3 * k->kind->bodies + o;
    group[n++] = reduce_group_of (s, k->own + e * k->kind->own + o);
  }
  return n;
}

static int reduce_is_active (const reduce_plan *p, int row) {
  return row < p->rows && (p->active == NULL || p->active[row]);
}

/* Calls for every active row of every element that touches a light group; the component is that of this group. */
typedef void reduce_visit (reduce_plan *p, pw_reduce *r, const pw_slab *k, int e, int row, int component);

static void reduce_each_row (reduce_plan *p, pw_reduce *r, reduce_visit *visit) {
  const pw_system *s = p->s;
  int group[PW_REDUCE_PIECES], at[PW_REDUCE_PIECES];
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs && k->kind->rows > 0; k++)
    for (int e = 0; e < k->b.count; e++) {
      int n = reduce_touched (s, k, e, group, at), light = -1;
      for (int i = 0; i < n && light < 0; i++)
        if (reduce_light (p, group[i])) light = group[i];
      for (int i = 0; light >= 0 && i < k->kind->rows; i++) {
        int row = k->row + e * k->kind->rows + i;
        if (reduce_is_active (p, row)) visit (p, r, k, e, row, p->member[reduce_root (p, light)]);
      }
    }
}

/* Light groups that share an active row belong together. */
static void reduce_unite (reduce_plan *p) {
  const pw_system *s = p->s;
  int group[PW_REDUCE_PIECES], at[PW_REDUCE_PIECES];
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs && k->kind->rows > 0; k++)
    for (int e = 0; e < k->b.count; e++) {
      int any = 0, last = -1, n = reduce_touched (s, k, e, group, at);
      for (int i = 0; i < k->kind->rows; i++) any |= reduce_is_active (p, k->row + e * k->kind->rows + i);
      for (int i = 0; any && i < n; i++) {
        if (!reduce_light (p, group[i])) continue;
        if (last >= 0) p->parent[reduce_root (p, group[i])] = reduce_root (p, last);
        last = group[i];
      }
    }
}

static void reduce_count_row (reduce_plan *p, pw_reduce *r, const pw_slab *k, int e, int row, int component) {
  pw_component *c = &r->component[component];
  int group[PW_REDUCE_PIECES], at[PW_REDUCE_PIECES];
  (void)row;
  c->rows++;
  c->groups += reduce_touched (p->s, k, e, group, at); /* an upper bound */
}

static int reduce_add_group (const pw_system *s, pw_component *c, int g) {
  int j = reduce_group_first (s, g);
  for (int i = 0; i < c->groups; i++)
    if (c->group[i] == j) return c->group_column[i];
  c->group[c->groups] = j;
  c->group_column[c->groups++] = c->cols;
  for (int n = 0; n < reduce_group_width (s, g); n++) c->global[c->cols++] = j + n;
  return c->group_column[c->groups - 1];
}

static void reduce_fill_row (reduce_plan *p, pw_reduce *r, const pw_slab *k, int e, int row, int component) {
  pw_component *c = &r->component[component];
  int group[PW_REDUCE_PIECES], at[PW_REDUCE_PIECES], n = reduce_touched (p->s, k, e, group, at);
  const double *J = k->J + (row - k->row) * k->b.cols;
  pw_reduce_piece *piece = c->piece + c->rows * PW_REDUCE_PIECES;
  for (int i = 0; i < PW_REDUCE_PIECES; i++) piece[i].width = 0;
  for (int i = 0; i < n; i++)
    piece[i] =
        (pw_reduce_piece){ J + at[i], reduce_add_group (p->s, c, group[i]), reduce_group_width (p->s, group[i]) };
  r->component_of_row[row] = component;
  c->row[c->rows++] = row;
}

/* ---- Layout ---- */

static void reduce_lay_out_component (pw_layout *l, pw_component *c, int rows, int groups) {
  size_t n = (size_t)rows, m = 3 * (size_t)groups, pivots = n < m ? n : m;
  c->group = pw_take (l, (size_t)groups, sizeof (int));
  c->group_column = pw_take (l, (size_t)groups, sizeof (int));
  c->row = pw_take (l, n, sizeof (int));
  c->pivot = pw_take (l, m, sizeof (int));
  c->light = pw_take (l, m, sizeof (int));
  c->global = pw_take (l, m, sizeof (int));
  c->least = pw_take (l, m, sizeof (double));
  c->massless = pw_take (l, m, 1);
  c->unit = pw_take (l, m, sizeof (double));
  c->piece = pw_take (l, n * PW_REDUCE_PIECES, sizeof (pw_reduce_piece));
  c->from = pw_take (l, n * pivots, sizeof (double *));
  c->heavy = pw_take (l, n * PW_REDUCE_PIECES, sizeof (pw_reduce_heavy));
  c->P = pw_take (l, pivots * pivots, sizeof (double));
  c->Y = pw_take (l, n * pivots, sizeof (double));
  c->Z = pw_take (l, n * m, sizeof (double));
  c->gamma = pw_take (l, n, sizeof (double));
  c->lambda = pw_take (l, n, sizeof (double));
}

/* Groups of a component are at most those its rows touch, counted with repetition, and at most all. */
static int reduce_lay_out (pw_reduce *r, const reduce_plan *p) {
  pw_layout l = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    for (int i = 0; i < r->components; i++) {
      pw_component *c = &r->component[i];
      reduce_lay_out_component (&l, c, c->rows, c->groups < p->groups ? c->groups : p->groups);
    }
    if (pass == 1) break;
    r->memory = calloc (1, l.used + 1);
    if (r->memory == NULL) return PW_MACHINE;
    l = (pw_layout){ r->memory, 0 };
  }
  for (int i = 0; i < r->components; i++) r->component[i].rows = r->component[i].groups = 0;
  return PW_OK;
}

/* ---- Matching ---- */

/* Copies the rows of J into Z. */
static void reduce_copy (pw_component *c) {
  double *row = c->Z;
  const pw_reduce_piece *piece = c->piece;
  for (int n = 0; n < c->rows * c->cols; n++) row[n] = 0;
  for (int i = 0; i < c->rows; i++, row += c->cols, piece += PW_REDUCE_PIECES)
    for (const pw_reduce_piece *p = piece; p < piece + PW_REDUCE_PIECES && p->width; p++) {
      double *to = row + p->column;
      to[0] = p->J[0];
      if (p->width == 3) to[1] = p->J[1], to[2] = p->J[2];
    }
}

/* Subtracts the pivot row from row i so that its entry under the pivot vanishes. */
static void reduce_eliminate (pw_component *c, int p, int i) {
  double *row = c->Z + i * c->cols, *pivot = c->Z + p * c->cols;
  double f = row[c->pivot[p]] / pivot[c->pivot[p]];
  for (int n = 0; n < c->cols; n++) row[n] -= f * pivot[n];
  row[c->pivot[p]] = 0;
}

static void reduce_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  int row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int i = 0; i < PW_REDUCE_PIECES; i++) {
    pw_reduce_piece piece = c->piece[a * PW_REDUCE_PIECES + i];
    c->piece[a * PW_REDUCE_PIECES + i] = c->piece[b * PW_REDUCE_PIECES + i];
    c->piece[b * PW_REDUCE_PIECES + i] = piece;
  }
  for (int n = 0; n < c->cols; n++) {
    double z = c->Z[a * c->cols + n];
    c->Z[a * c->cols + n] = c->Z[b * c->cols + n];
    c->Z[b * c->cols + n] = z;
  }
}

/* Where the entries of P, K, H and Z are, for the matching found. */
static void reduce_plan_copies (pw_component *c) {
  static const double zero = 0;
  c->heavies = 0;
  for (int i = 0; i < c->rows; i++) {
    const pw_reduce_piece *piece = c->piece + i * PW_REDUCE_PIECES;
    for (int p = 0; p < c->pivots; p++) c->from[i * c->pivots + p] = &zero;
    for (const pw_reduce_piece *x = piece; x < piece + PW_REDUCE_PIECES && x->width; x++) {
      int heavy = 0;
      for (int n = 0; n < x->width; n++) heavy |= !c->massless[x->column + n];
      for (int p = 0; p < c->pivots; p++)
        if (c->pivot[p] >= x->column && c->pivot[p] < x->column + x->width)
          c->from[i * c->pivots + p] = x->J + c->pivot[p] - x->column;
      if (heavy) c->heavy[c->heavies++] = (pw_reduce_heavy){ x->J, i, c->global[x->column], x->width, x->column };
    }
    if (i < c->pivots) c->heavies_h = c->heavies, c->light[i] = c->global[c->pivot[i]];
  }
}

/* Gaussian elimination with complete pivoting over the massless columns, angles in units of length, rows scaled by
 * their largest entry.  Returns how many pivots were found. */
static int reduce_match (pw_component *c) {
  const double guard = 0.1;
  reduce_copy (c);
  c->worst = INFINITY;
  for (int p = 0; p < c->pivots; p++) {
    int row = -1, column = -1;
    double best = 1e-12;
    for (int i = p; i < c->rows; i++) {
      double most = 0;
      for (int n = 0; n < c->cols; n++) most = fmax (most, fabs (c->Z[i * c->cols + n]) / c->unit[n]);
      for (int n = 0; n < c->cols; n++) {
        double scaled = c->massless[n] ? fabs (c->Z[i * c->cols + n]) / c->unit[n] / most : 0;
        if (scaled > best) best = scaled, row = i, column = n;
      }
    }
    if (row < 0) return p;
    reduce_swap (c, p, row);
    c->pivot[p] = column;
    c->least[p] = guard * fabs (c->Z[p * c->cols + column]);
    c->worst = fmin (c->worst, best);
    for (int i = p + 1; i < c->rows; i++) reduce_eliminate (c, p, i);
  }
  reduce_plan_copies (c);
  return c->pivots;
}

/* ---- P = L U, the number of pivots a constant where it is usual ---- */

/* Returns 0 if a pivot has become too small, or is not a number. */
PW_INLINE int reduce_lu (pw_component *c, int n) {
  double *P = c->P;
  int good = 1;
  PW_UNROLL for (int i = 0; i < n * n; i++) P[i] = *c->from[i];
  PW_UNROLL for (int p = 0; p < n; p++) {
    double pivot = P[p * n + p], inverse = 1 / pivot;
    good &= fabs (pivot) >= c->least[p];
    P[p * n + p] = inverse;
    PW_UNROLL for (int i = p + 1; i < n; i++) {
      double l = P[i * n + p] * inverse;
      P[i * n + p] = l;
      PW_UNROLL for (int j = p + 1; j < n; j++) P[i * n + j] -= l * P[p * n + j];
    }
  }
  return good;
}

/* x = P^-1 x */
PW_INLINE void reduce_solve (const double *P, double *x, int n) {
  PW_UNROLL for (int i = 1; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[i * n + j] * x[j];
  }
  PW_UNROLL for (int i = n - 1; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[i * n + j] * x[j];
    x[i] *= P[i * n + i];
  }
}

/* x = P^-T x */
PW_INLINE void reduce_solve_transposed (const double *P, double *x, int n) {
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[j * n + i] * x[j];
    x[i] *= P[i * n + i];
  }
  PW_UNROLL for (int i = n - 2; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[j * n + i] * x[j];
  }
}

/* Y and Z~ of the rows left over. */
static void reduce_left_over (pw_component *c) {
  const pw_reduce_heavy *h = c->heavy;
  for (int i = c->pivots; i < c->rows; i++) {
    double *Y = c->Y + i * c->pivots, *Z = c->Z + i * c->cols;
    for (int p = 0; p < c->pivots; p++) Y[p] = *c->from[i * c->pivots + p];
    reduce_solve_transposed (c->P, Y, c->pivots);
    for (int n = 0; n < c->cols; n++) Z[n] = 0;
    for (const pw_reduce_heavy *x = h + c->heavies_h; x < h + c->heavies; x++)
      for (int n = 0; x->slot == i && n < x->width; n++) Z[x->column + n] = x->J[n];
    for (const pw_reduce_heavy *x = h; x < h + c->heavies_h; x++)
      for (int n = 0; n < x->width; n++) Z[x->column + n] -= Y[x->slot] * x->J[n];
  }
}

static inline int reduce_run (pw_component *c) {
  return c->pivots == 3 ? reduce_lu (c, 3) : reduce_lu (c, c->pivots);
}

double pw_reduce_factor (pw_reduce *r) {
  double worst = INFINITY;
  for (pw_component *c = r->component, *last = c + r->components; c < last; c++) {
    if (!reduce_run (c) && (reduce_match (c) < c->pivots || !reduce_run (c))) return 0;
    if (c->rows > c->pivots) reduce_left_over (c);
    if (c->worst < worst) worst = c->worst;
  }
  return worst * worst;
}

/* ---- Opening ---- */

/* Marks the light columns and says which of them no row determines. */
static int reduce_check (pw_reduce *r, const reduce_plan *p, pw_error *error) {
  const pw_system *s = p->s;
  char name[120];
  for (int i = 0; i < r->components; i++) {
    pw_component *c = &r->component[i];
    c->pivots = 0;
    for (int n = 0; n < c->cols; n++) {
      int j = c->global[n], angle = pw_is_angle (s, j);
      c->unit[n] = angle ? s->scale.length : 1;
      c->massless[n] = p->weight[j] == 0;
      c->pivots += c->massless[n];
    }
    int found = c->pivots <= c->rows ? reduce_match (c) : 0;
    if (found == c->pivots) continue;
    for (int n = 0; n < c->cols; n++) {
      int used = 0;
      for (int q = 0; q < found; q++) used |= c->pivot[q] == n;
      if (c->massless[n] && !used)
        return pw_fail (
            error, PW_INPUT,
            "model %s: %s has no mass, and no constraint determines how it moves; give it mass, or constrain it",
            s->model, pw_state_name (s, c->global[n], name, sizeof name));
    }
  }
  return PW_OK;
}

/* Numbers the components by their roots; a light group that no active row touches is an error. */
static int reduce_number (pw_reduce *r, reduce_plan *p, pw_error *error) {
  const pw_system *s = p->s;
  int group[PW_REDUCE_PIECES], at[PW_REDUCE_PIECES];
  char *seen = calloc ((size_t)p->groups + 1, 1);
  if (seen == NULL) return PW_MACHINE;
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs && k->kind->rows > 0; k++)
    for (int e = 0; e < k->b.count; e++)
      for (int n = reduce_touched (s, k, e, group, at); n-- > 0;)
        for (int i = 0; i < k->kind->rows; i++)
          seen[group[n]] |= (char)reduce_is_active (p, k->row + e * k->kind->rows + i);
  int status = PW_OK;
  for (int g = 0; g < p->groups && status == PW_OK; g++) {
    if (!reduce_light (p, g)) continue;
    char name[120];
    int j = reduce_group_first (s, g);
    while (p->weight[j] != 0) j++;
    if (!seen[g])
      status =
          pw_fail (error, PW_INPUT,
                   "model %s: %s has no mass, and no constraint determines how it moves; give it mass, or constrain it",
                   s->model, pw_state_name (s, j, name, sizeof name));
    if (reduce_root (p, g) == g) p->member[g] = r->components++;
  }
  free (seen);
  return status;
}

static int reduce_fill (pw_reduce *r, reduce_plan *p, pw_error *error) {
  reduce_unite (p);
  int status = reduce_number (r, p, error);
  if (status != PW_OK || r->components == 0) return status;
  r->component = calloc ((size_t)r->components, sizeof *r->component);
  if (r->component == NULL) return PW_MACHINE;
  reduce_each_row (p, r, reduce_count_row);
  if (reduce_lay_out (r, p) != PW_OK) return PW_MACHINE;
  reduce_each_row (p, r, reduce_fill_row);
  return reduce_check (r, p, error);
}

int pw_reduce_open (pw_reduce *r, pw_system *s, const double *weight, int rows, const unsigned char *active,
                    pw_error *error) {
  int groups = reduce_groups (s), status = PW_MACHINE;
  *r = (pw_reduce){ 0 };
  reduce_plan p = { .s = s, .weight = weight, .active = active, .rows = rows, .groups = groups };
  p.parent = malloc (((size_t)groups + 1) * sizeof *p.parent);
  p.member = malloc (((size_t)groups + 1) * sizeof *p.member);
  r->component_of_row = malloc (((size_t)s->rows + 1) * sizeof *r->component_of_row);
  if (p.parent && p.member && r->component_of_row) {
    for (int g = 0; g < groups; g++) p.parent[g] = g, p.member[g] = -1;
    for (int i = 0; i < s->rows; i++) r->component_of_row[i] = -1;
    status = reduce_fill (r, &p, error);
  }
  free (p.parent);
  free (p.member);
  if (status == PW_OK) return PW_OK;
  pw_reduce_close (r);
  return pw_fail (error, status, "model %s: out of memory", s->model);
}

void pw_reduce_close (pw_reduce *r) {
  free (r->memory);
  free (r->component);
  free (r->component_of_row);
  *r = (pw_reduce){ 0 };
}

/* ---- Solving ---- */

/* f -= J^T l over one of H's runs. */
static inline void reduce_pull (const pw_reduce_heavy *h, double *f, double l) {
  f += h->j;
  f[0] -= h->J[0] * l;
  if (h->width == 3) f[1] -= h->J[1] * l, f[2] -= h->J[2] * l;
}

/* J a over one. */
static inline double reduce_row (const pw_reduce_heavy *h, const double *a) {
  a += h->j;
  return h->width == 3 ? h->J[0] * a[0] + h->J[1] * a[1] + h->J[2] * a[2] : h->J[0] * a[0];
}

/* Of one component with n pivots. */
PW_INLINE void reduce_forward (pw_component *c, const double *gamma, double *f, int n) {
  double *mu = c->lambda;
  PW_UNROLL for (int p = 0; p < n; p++) c->gamma[p] = gamma[c->row[p]], mu[p] = f[c->light[p]];
  for (int i = n; i < c->rows; i++) {
    c->gamma[i] = gamma[c->row[i]];
    for (int p = 0; p < n; p++) c->gamma[i] -= c->Y[i * n + p] * c->gamma[p];
  }
  reduce_solve_transposed (c->P, mu, n);
  for (const pw_reduce_heavy *h = c->heavy, *end = h + c->heavies_h; h < end; h++) reduce_pull (h, f, mu[h->slot]);
}

PW_INLINE void reduce_backward (pw_component *c, double *a, double *lambda, int n) {
  double *x = c->gamma;
  for (const pw_reduce_heavy *h = c->heavy, *end = h + c->heavies_h; h < end; h++) x[h->slot] -= reduce_row (h, a);
  reduce_solve (c->P, x, n);
  for (int i = n; i < c->rows; i++) {
    lambda[c->row[i]] = c->lambda[i];
    for (int p = 0; p < n; p++) c->lambda[p] -= c->Y[i * n + p] * c->lambda[i];
  }
  PW_UNROLL for (int p = 0; p < n; p++) a[c->light[p]] = x[p], lambda[c->row[p]] = c->lambda[p];
}

void pw_reduce_forward (pw_reduce *r, const double *gamma, double *f) {
  for (pw_component *c = r->component, *last = c + r->components; c < last; c++)
    c->pivots == 3 ? reduce_forward (c, gamma, f, 3) : reduce_forward (c, gamma, f, c->pivots);
}

void pw_reduce_backward (pw_reduce *r, double *a, double *lambda) {
  for (pw_component *c = r->component, *last = c + r->components; c < last; c++)
    c->pivots == 3 ? reduce_backward (c, a, lambda, 3) : reduce_backward (c, a, lambda, c->pivots);
}
