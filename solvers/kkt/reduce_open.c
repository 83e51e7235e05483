/* Which rows and coordinates the elimination works on: the components, found by union-find; see reduce.h. */
#include <stdlib.h>
#include "reduce.h"
#include "util.h"

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
  for (int i = 0; i < n; i++) {
    int width = reduce_group_width (p->s, group[i]), unit = k->kind->unit && width == 3;
    piece[i] = (pw_reduce_piece){ J + at[i], reduce_add_group (p->s, c, group[i]), width,
                                  unit ? 1 + (row - k->row) % k->kind->rows : 0 };
  }
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
  c->scale = pw_take (l, m, sizeof (double));
  c->massless = pw_take (l, m, 1);
  c->unit = pw_take (l, m, sizeof (double));
  c->piece = pw_take (l, n * PW_REDUCE_PIECES, sizeof (pw_reduce_piece));
  c->from = pw_take (l, n * pivots, sizeof (double *));
  c->heavy = pw_take (l, n * PW_REDUCE_PIECES, sizeof (pw_reduce_heavy));
  c->single = pw_take (l, n * PW_REDUCE_PIECES, sizeof (pw_reduce_heavy));
  c->pair = pw_take (l, n, sizeof (pw_reduce_pair));
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

/* ---- Opening ---- */

static int reduce_undetermined (const pw_system *s, int j, pw_error *error) {
  char name[120];
  const char *lacking = pw_is_angle (s, j) ? "inertia" : "mass";
  return pw_fail (error, PW_INPUT,
                  "model %s: %s has no %s, and no constraint determines how it moves; give it %s, or constrain it",
                  s->model, pw_state_name (s, j, name, sizeof name), lacking, lacking);
}

/* Marks the light columns and says which of them no row determines. */
static int reduce_check (pw_reduce *r, const reduce_plan *p, pw_error *error) {
  const pw_system *s = p->s;
  for (int i = 0; i < r->components; i++) {
    pw_component *c = &r->component[i];
    c->pivots = 0;
    for (int n = 0; n < c->cols; n++) {
      int j = c->global[n];
      c->unit[n] = pw_is_angle (s, j) ? s->scale.length : 1;
      c->massless[n] = p->weight[j] == 0;
      c->pivots += c->massless[n];
    }
    int found = c->pivots <= c->rows ? pw_reduce_match (c) : 0;
    if (found == c->pivots) continue;
    for (int n = 0; n < c->cols; n++) {
      int used = 0;
      for (int q = 0; q < found; q++) used |= c->pivot[q] == n;
      if (c->massless[n] && !used) return reduce_undetermined (s, c->global[n], error);
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
    int j = reduce_group_first (s, g);
    while (p->weight[j] != 0) j++;
    if (!seen[g]) status = reduce_undetermined (s, j, error);
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
  r->end = r->component + r->components;
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
