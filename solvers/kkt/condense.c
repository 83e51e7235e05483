/* Planning of the condensed matrix: its nodes; see condense.h. */
#include <math.h>
#include <stdlib.h>
#include "condense.h"
#include "util.h"

/* ---- Nodes ---- */

/* Begins a node: the contributions that follow are its own. */
static void condense_add_node (pw_plan *c, pw_plan_node node) {
  c->failed |= pw_grow (&c->node, (size_t)c->nodes, &c->node_room, sizeof *c->node) != PW_OK;
  node.first = c->contributions;
  if (!c->failed) c->node[c->nodes++] = node;
}

static void condense_contribute (pw_plan *c, const double *J, int step, int j, int is_pin) {
  int moves = 0, prescribed = 0;
  for (int n = 0; n < pw_group_width (c->k->s, j); n++)
    moves |= c->k->inverse[j + n] > 0, prescribed |= isinf (c->weight[j + n]) != 0;
  if (c->failed) return;
  c->node[c->nodes - 1].grounded |= prescribed;
  if (!moves) return;
  c->failed =
      pw_grow (&c->contribution, (size_t)c->contributions, &c->contribution_room, sizeof *c->contribution) != PW_OK;
  if (!c->failed) c->contribution[c->contributions++] = (pw_plan_contribution){ J, c->nodes - 1, step, j, is_pin };
}

/* The node of `size` rows from row n of a batch on. */
static void condense_element (pw_plan *c, const pw_element_batch *b, int n, int size) {
  const int e = n / b->kind->rows, is_pin = b->kind == &pw_kind_pin && size == 2;
  condense_add_node (c, (pw_plan_node){ .size = size, .y = b->row + n, .grounded = pw_is_grounded (c->k->s, b, e) });
  for (int x = 0; x < b->b.cols; x += pw_group_columns (b->kind, x)) {
    int j = pw_global (b, e, x);
    if (j < c->k->s->coords) condense_contribute (c, b->J + n * b->b.cols + x, b->b.cols, j, is_pin);
  }
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

/* Groups such rows that follow one another into nodes; others that are in no massless component are inactive. */
static void condense_elements (pw_plan *c, const unsigned char *active) {
  struct pw_saddle *k = c->k;
  for (const pw_element_batch *b = k->w->batch; b < k->w->batch + k->s->constraints && b->row < k->rows; b++)
    for (int n = 0, end = b->b.count * b->kind->rows, size; n < end; n += size ? size : 1) {
      for (size = 0; n + size < end && size < PW_BLOCK_NODE; size++)
        if (!condense_takes_part (c, b, n + size, active) || (size > 0 && !condense_joins (b, n))) break;
      if (size > 0)
        condense_element (c, b, n, size);
      else if (k->massless.component_of_row[b->row + n] < 0)
        k->inactive[k->inactives++] = b->row + n;
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

/* Adds the unmatched rows; the multiplier of one that does not become a node is 0. */
static void condense_components (pw_plan *c) {
  for (pw_component *p = c->k->massless.component; p < c->k->massless.end; p++)
    for (int i = p->pivots; i < p->rows; i++) {
      p->y[i] = condense_remains (c, p, i) ? p->row[i].row : -1;
      if (p->y[i] < 0) continue;
      condense_add_node (c, (pw_plan_node){ .size = 1, .y = p->y[i], .grounded = p->grounded });
      for (int g = 0; g < p->groups; g++)
        condense_contribute (c, p->A + i * p->stride + p->group[g].column, p->stride, p->group[g].j, 0);
    }
}

/* Sorts the contributions by coordinate. */
static int condense_sort (pw_plan *c) {
  const int coords = c->k->s->coords;
  c->start = calloc ((size_t)coords + 2, sizeof *c->start);
  c->list = malloc (((size_t)c->contributions + 1) * sizeof *c->list);
  if (c->failed || c->start == NULL || c->list == NULL) return PW_RESOURCE;
  for (int p = 0; p < c->contributions; p++) c->start[c->contribution[p].j + 2]++;
  for (int j = 0; j < coords; j++) c->start[j + 2] += c->start[j + 1];
  for (int p = 0; p < c->contributions; p++) c->list[c->start[c->contribution[p].j + 1]++] = p;
  return PW_OK;
}

/* ---- Bodies that are not condensed ---- */

/* A body at which more nodes than this meet is not condensed, if its weights are finite: n nodes have n (n - 1) / 2
 * couplings, but only 2 n with an uncondensed body, fewer from n = 6.  Measured: 0.6 to 0.9 of the time with 7 nodes,
 * 0.7 to 1.0 with 6. */
enum { CONDENSE_MEET = 6 };

static int condense_is_crowded (const pw_plan *c, int b) {
  const double *w = c->k->inverse + 3 * b;
  return c->start[3 * b + 1] - c->start[3 * b] > CONDENSE_MEET && w[0] > 0 && w[1] > 0 && w[2] > 0;
}

/* Adds two nodes for every body that is not condensed, and ranks the others. */
static int condense_uncondensed (pw_plan *c) {
  struct pw_saddle *k = c->k;
  c->uncondensed = malloc (((size_t)k->s->bodies + 1) * sizeof *c->uncondensed);
  if (c->uncondensed == NULL) return PW_RESOURCE;
  for (int b = 0; b < k->s->bodies; b++) {
    c->uncondensed[b] = -1;
    if (!condense_is_crowded (c, b)) continue;
    c->uncondensed[b] = c->nodes;
    condense_add_node (c, (pw_plan_node){ .size = 2, .rank = 1, .y = k->s->rows + k->more });
    condense_add_node (c, (pw_plan_node){ .size = 1, .rank = 1, .y = k->s->rows + k->more + 2 });
    k->more += 3;
  }
  if (k->more == 0) return PW_OK;
  k->y = malloc ((size_t)(k->s->rows + k->more) * sizeof *k->y);
  return c->failed || k->y == NULL ? PW_RESOURCE : pw_condense_rank (c);
}

/* ---- Opening ---- */

static int condense_plan (pw_plan *c, const unsigned char *active) {
  condense_elements (c, active);
  condense_components (c);
  int status = condense_sort (c);
  if (status == PW_OK) status = condense_uncondensed (c);
  return status == PW_OK ? pw_condense_block (c) : status;
}

int pw_condense (struct pw_saddle *k, const double *weight, const unsigned char *active) {
  size_t n = (size_t)k->s->coords;
  pw_plan c = { .k = k, .weight = weight, .groups = pw_groups (k->s) };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &k->memory);) {
    k->inverse = pw_layout_alloc (&l, n + 3, sizeof *k->inverse);
    k->force = pw_layout_alloc (&l, k->massless.components ? n : 0, sizeof *k->force);
    k->inactive = pw_layout_alloc (&l, (size_t)k->rows, sizeof *k->inactive);
  }
  if (k->memory == NULL) return PW_RESOURCE;
  for (size_t j = 0; j < n; j++) k->inverse[j] = weight[j] > 0 ? 1 / weight[j] : 0;
  int status = condense_plan (&c, active);
  free (c.node);
  free (c.contribution);
  free (c.pair);
  free (c.start);
  free (c.list);
  free (c.uncondensed);
  free (c.chain);
  free (c.is_linked);
  return status;
}
