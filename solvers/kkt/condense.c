/* Planning of the condensed matrix: its nodes; see condense.h. */
#include <math.h>
#include <stdlib.h>
#include "condense.h"
#include "util.h"

/* ---- Nodes ---- */

static void condense_contribute (pw_plan *c, const double *J, int step, int j, int is_pin) {
  int moves = 0, prescribed = 0;
  for (int n = 0; n < pw_group_width (c->k->s, j); n++)
    moves |= c->k->inverse[j + n] > 0, prescribed |= isinf (c->weight[j + n]) != 0;
  if (c->node) c->node[c->nodes].grounded |= prescribed;
  if (!moves) return;
  if (c->contribution) c->contribution[c->contributions] = (pw_plan_contribution){ J, c->nodes, step, j, is_pin };
  c->contributions++;
}

static void condense_element (pw_plan *c, const pw_element_batch *b, int e, int r, int size) {
  const pw_kind *kind = b->kind;
  const double *J = b->J + (e * kind->rows + r) * b->b.cols;
  int i = b->row + e * kind->rows + r;
  if (c->node)
    c->node[c->nodes] = (pw_plan_node){ .size = size, .row = i, .y = i, .grounded = pw_is_grounded (c->k->s, b, e) };
  for (int n = 0; n < kind->bodies; n++) {
    int j = b->column[e * kind->bodies + n];
    if (j < c->k->s->coords) condense_contribute (c, J + 3 * n, b->b.cols, j, kind == &pw_kind_pin && size == 2);
  }
  for (int n = 0; n < kind->internal; n++)
    condense_contribute (c, J + 3 * kind->bodies + n, b->b.cols, b->internal + e * kind->internal + n, 0);
  c->nodes++;
}

/* 1 for row n of a batch that becomes part of a node: active, not in a massless component, and not a function of
 * prescribed coordinates alone. */
static int condense_takes_part (const pw_plan *c, const pw_element_batch *b, int n, const unsigned char *active) {
  const double *J = b->J + n * b->b.cols, *inverse = c->k->inverse;
  int i = b->row + n, prescribed = 0;
  if ((active && !active[i]) || c->k->massless.component_of_row[i] >= 0) return 0;
  for (int x = 0; x < b->b.cols; x++) {
    int j = pw_global (b, n / b->kind->rows, x);
    if (j < c->k->s->coords && inverse[j] > 0 && J[x] != 0) return 1;
    prescribed |= j < c->k->s->coords && inverse[j] == 0;
  }
  return !prescribed;
}

/* 1 if rows n and n + 1 of a batch may share a node: rows of one element, or of elements of one row with the same
 * columns, such as two wheels of a body. */
static int condense_joins (const pw_element_batch *b, int n) {
  int e = n / b->kind->rows, next = (n + 1) / b->kind->rows;
  if (e == next) return 1;
  if (b->kind->rows > 1) return 0;
  for (int x = 0; x < b->b.cols; x++)
    if (pw_global (b, e, x) != pw_global (b, next, x)) return 0;
  return 1;
}

/* Groups such rows that follow one another into nodes. */
static void condense_elements (pw_plan *c, int rows, const unsigned char *active) {
  const pw_system *s = c->k->s;
  for (const pw_element_batch *b = c->k->w->batch;
       b < c->k->w->batch + s->batches && b->kind->rows > 0 && b->row < rows; b++)
    for (int n = 0, end = b->b.count * b->kind->rows, size; n < end; n += size ? size : 1) {
      for (size = 0; n + size < end && size < PW_BLOCK_NODE; size++)
        if (!condense_takes_part (c, b, n + size, active) || (size > 0 && !condense_joins (b, n))) break;
      if (size > 0) condense_element (c, b, n / b->kind->rows, n % b->kind->rows, size);
    }
}

/* 1 for an unmatched row that becomes a node: it has massive coordinates, and not only prescribed ones. */
static int condense_remains (const pw_plan *c, const pw_component *p, int i) {
  int prescribed = 0;
  for (int n = 0; n < p->cols; n++) {
    if (c->k->inverse[p->global[n]] > 0 && pw_massless_is_entry (p, i, n)) return 1;
    prescribed |= !p->massless[n] && c->k->inverse[p->global[n]] == 0;
  }
  return p->massives > 0 && !prescribed;
}

/* Adds the unmatched rows; the multiplier of one that does not become a node stays 0. */
static void condense_components (pw_plan *c) {
  int schurs = 0;
  for (int n = 0; n < c->k->massless.components; n++) {
    pw_component *p = &c->k->massless.component[n];
    for (int i = p->pivots; i < p->rows; i++) {
      if (!condense_remains (c, p, i)) continue;
      if (c->node)
        c->node[c->nodes] = (pw_plan_node){ .size = 1,
                                            .row = PW_PLAN_SCHUR,
                                            .y = c->k->s->rows + schurs++,
                                            .grounded = p->grounded,
                                            .gamma = &p->row[i].gamma,
                                            .lambda = &p->row[i].lambda };
      for (int g = 0; g < p->groups; g++)
        condense_contribute (c, p->A + i * p->stride + p->group[g].column, p->stride, p->group[g].j, 0);
      c->nodes++;
    }
  }
}

static void condense_nodes (pw_plan *c, int rows, const unsigned char *active) {
  c->nodes = c->contributions = 0;
  condense_elements (c, rows, active);
  condense_components (c);
}

static int condense_allocate (pw_plan *c, int rows, const unsigned char *active) {
  condense_nodes (c, rows, active);
  pw_plan_node *node = malloc (((size_t)c->nodes + 1) * sizeof *node);
  c->contribution = malloc (((size_t)c->contributions + 1) * sizeof *c->contribution);
  c->start = calloc ((size_t)c->k->s->coords + 2, sizeof *c->start);
  c->list = malloc (((size_t)c->contributions + 1) * sizeof *c->list);
  c->node = node;
  if (node == NULL || c->contribution == NULL || c->start == NULL || c->list == NULL) return PW_RESOURCE;
  condense_nodes (c, rows, active);
  for (int p = 0; p < c->contributions; p++) c->start[c->contribution[p].j + 2]++;
  for (int j = 0; j < c->k->s->coords; j++) c->start[j + 2] += c->start[j + 1];
  for (int p = 0; p < c->contributions; p++) c->list[c->start[c->contribution[p].j + 1]++] = p;
  return PW_OK;
}

/* ---- Unknowns beyond the rows ---- */

/* A body at which more nodes than this meet is not condensed, if its weights are finite: n nodes have n (n - 1) / 2
 * couplings, but only 2 n with an uncondensed body, fewer from n = 6.  Measured: 0.6 to 0.9 of the time with 7 nodes, 0.7
 * to 1.0 with 6. */
enum { CONDENSE_MEET = 6 };

static int condense_is_crowded (const pw_plan *c, int b) {
  const double *w = c->k->inverse + 3 * b;
  return c->start[3 * b + 1] - c->start[3 * b] > CONDENSE_MEET && w[0] > 0 && w[1] > 0 && w[2] > 0;
}

/* Adds two nodes for every body that is not condensed, and ranks the others. */
static int condense_uncondensed (pw_plan *c) {
  int bodies = c->k->s->bodies, nodes = c->nodes;
  c->uncondensed = malloc (((size_t)bodies + 1) * sizeof *c->uncondensed);
  if (c->uncondensed == NULL) return PW_RESOURCE;
  for (int b = 0; b < bodies; b++) c->uncondensed[b] = condense_is_crowded (c, b) ? nodes + 2 * c->uncondenseds++ : -1;
  if (c->uncondenseds == 0) return PW_OK;
  pw_plan_node *node = realloc (c->node, (size_t)(nodes + 2 * c->uncondenseds) * sizeof *node);
  if (node == NULL) return PW_RESOURCE;
  c->node = node;
  for (int y = c->k->s->rows + c->k->schurs, n = 0; n < c->uncondenseds; n++, y += 3) {
    node[c->nodes++] = (pw_plan_node){ .size = 2, .row = PW_PLAN_UNCONDENSED, .rank = 1, .y = y };
    node[c->nodes++] = (pw_plan_node){ .size = 1, .row = PW_PLAN_UNCONDENSED, .rank = 1, .y = y + 2 };
  }
  return pw_condense_rank (c);
}

/* Lists inactive rows and Schur rows; nodes are in the order of their rows. */
static void condense_fill_rows (pw_plan *c, int rows) {
  struct pw_saddle *k = c->k;
  int schurs = 0, inactives = 0, n = 0;
  for (int i = 0; i < rows; i++) {
    while (n < c->nodes && c->node[n].row >= 0 && c->node[n].row + c->node[n].size <= i) n++;
    int own = n < c->nodes && c->node[n].row >= 0 && c->node[n].row <= i;
    if (!own && k->massless.component_of_row[i] < 0) k->inactive[inactives++] = i;
  }
  for (n = 0; n < c->nodes; n++)
    if (c->node[n].row == PW_PLAN_SCHUR)
      k->schur[schurs++] = (pw_schur_row){ c->node[n].y, c->node[n].gamma, c->node[n].lambda };
}

static int condense_lay_out (pw_plan *c, int rows) {
  struct pw_saddle *k = c->k;
  k->inactives = rows;
  for (int n = 0; n < c->nodes; n++) {
    k->schurs += c->node[n].row == PW_PLAN_SCHUR;
    if (c->node[n].row >= 0) k->inactives -= c->node[n].size;
  }
  for (int i = 0; i < rows; i++) k->inactives -= k->massless.component_of_row[i] >= 0;
  if (condense_uncondensed (c) != PW_OK) return PW_RESOURCE;
  k->more = k->schurs + 3 * c->uncondenseds;
  pw_layout l = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    k->force = pw_layout_alloc (&l, k->massless.components ? (size_t)k->s->coords + 3 : 0, sizeof *k->force);
    k->y = pw_layout_alloc (&l, k->more ? (size_t)(k->s->rows + k->more) : 0, sizeof *k->y);
    k->schur = pw_layout_alloc (&l, (size_t)k->schurs, sizeof *k->schur);
    k->inactive = pw_layout_alloc (&l, (size_t)k->inactives, sizeof *k->inactive);
    if (pass == 1) break;
    k->memory = malloc (l.used + 1);
    if (k->memory == NULL) return PW_RESOURCE;
    l = (pw_layout){ k->memory, 0 };
  }
  condense_fill_rows (c, rows);
  return pw_condense_block (c);
}

int pw_condense (struct pw_saddle *k, const double *weight, int rows, const unsigned char *active) {
  pw_plan c = { .k = k, .weight = weight, .groups = pw_groups (k->s) };
  k->rows = rows;
  k->inverse = calloc ((size_t)k->s->coords + 3, sizeof *k->inverse);
  if (k->inverse == NULL) return PW_RESOURCE;
  for (int j = 0; j < k->s->coords; j++) k->inverse[j] = weight[j] > 0 ? 1 / weight[j] : 0;
  int status = condense_allocate (&c, rows, active);
  if (status == PW_OK) status = condense_lay_out (&c, rows);
  free (c.node);
  free (c.contribution);
  free (c.start);
  free (c.list);
  free (c.uncondensed);
  return status;
}
