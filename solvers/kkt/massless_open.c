/* Finds the components of rows and massless coordinates by union-find; see massless.h. */
#include <stdlib.h>
#include "massless.h"
#include "util.h"

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
