/* Plans the condensed matrix: its nodes, and the bodies that are not condensed; see condense.h. */
#include <math.h>
#include <stdlib.h>
#include "condense.h"

/* ---- Nodes ---- */

/* Begins a node: the contributions that follow are its own. */
static void condense_add_node (pw_plan *plan, pw_plan_node node) {
  plan->failed |= pw_grow (&plan->node, (size_t)plan->nodes, &plan->node_room, sizeof *plan->node) != PW_OK;
  node.first_contribution = plan->contributions;
  if (!plan->failed) plan->node[plan->nodes++] = node;
}

/* Adds the contribution of the last node to the group that begins with coordinate j.  If these coordinates are all
 * prescribed or massless there is none, and a prescribed one makes the node `grounded`. */
static void condense_contribute (pw_plan *plan, const double *J, int row_stride, int j, int is_pin) {
  int moves = 0, is_prescribed = 0;
  if (plan->failed) return;
  for (int n = 0; n < pw_group_width (plan->saddle->s, j); n++) {
    moves |= plan->saddle->inverse_weight[j + n] > 0;
    is_prescribed |= isinf (plan->weight[j + n]) != 0;
  }
  if (!moves) plan->node[plan->nodes - 1].grounded |= is_prescribed;
  if (!moves) return;
  plan->failed = pw_grow (&plan->contribution, (size_t)plan->contributions, &plan->contribution_room,
                          sizeof *plan->contribution) != PW_OK;
  if (!plan->failed)
    plan->contribution[plan->contributions++] = (pw_plan_contribution){ J,          plan->nodes - 1,
                                                                        row_stride, pw_group_of (plan->saddle->s, j),
                                                                        is_pin,     is_prescribed };
}

/* Adds the node of `size` rows from row n of a batch on. */
static void condense_element (pw_plan *plan, const pw_element_batch *b, int n, int size) {
  const int e = n / b->kind->rows, is_pin = b->kind == &pw_kind_pin && size == 2;
  const int is_rolling_wheel = pw_kind_is_built_in (b->kind) && b->kind->contact && b->kind->internal == 1;
  condense_add_node (plan, (pw_plan_node){ .size = size,
                                           .unknown = b->row + n,
                                           .grounded = pw_is_grounded (plan->saddle->s, b, e),
                                           .rolls = is_rolling_wheel && size == 1 && n % 2 == 1 });
  for (int x = 0; x < b->b.cols; x += pw_group_columns (b->kind, x)) {
    int j = pw_global (b, e, x);
    if (j < plan->saddle->s->coords) condense_contribute (plan, b->J + n * b->b.cols + x, b->b.cols, j, is_pin);
  }
}

/* 1 for row n of a batch that becomes part of a node: active, not in a massless component, and with an entry other than
 * 0 at a coordinate that is not prescribed, or without prescribed coordinates. */
static int condense_takes_part (const pw_plan *plan, const pw_element_batch *b, int n, const unsigned char *active) {
  const double *J = b->J + n * b->b.cols, *inverse = plan->saddle->inverse_weight;
  int i = b->row + n, prescribed = 0;
  if ((active && !active[i]) || plan->saddle->massless.component_of_row[i] >= 0) return 0;
  for (int x = 0; x < b->b.cols; x++) {
    int j = pw_global (b, n / b->kind->rows, x);
    if (j < plan->saddle->s->coords && inverse[j] > 0 && J[x] != 0) return 1;
    prescribed |= j < plan->saddle->s->coords && inverse[j] == 0;
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

/* Makes nodes of the rows that become part of one; others are inactive unless they are in a massless component. */
static void condense_elements (pw_plan *plan, const unsigned char *active) {
  struct pw_saddle *saddle = plan->saddle;
  for (const pw_element_batch *b = saddle->w->batch;
       b < saddle->w->batch + saddle->s->constraints && b->row < saddle->rows; b++)
    for (int n = 0, end = b->b.count * b->kind->rows, size; n < end; n += size ? size : 1) {
      for (size = 0; n + size < end && size < PW_BLOCK_NODE; size++)
        if (!condense_takes_part (plan, b, n + size, active) || (size > 0 && !condense_joins (b, n))) break;
      if (size > 0)
        condense_element (plan, b, n, size);
      else if (saddle->massless.component_of_row[b->row + n] < 0)
        saddle->inactive[saddle->inactive_count++] = b->row + n;
    }
}

/* 1 for an unmatched row i that becomes a node: it has an entry other than round-off at a massive coordinate that is
 * not prescribed, or its component has massive coordinates and none is prescribed. */
static int condense_remains (const pw_plan *plan, const pw_component *p, int i) {
  int prescribed = 0;
  for (int n = 0; n < p->cols; n++) {
    if (plan->saddle->inverse_weight[p->global[n]] > 0 && pw_massless_is_entry (p, i, n)) return 1;
    prescribed |= !p->is_massless[n] && plan->saddle->inverse_weight[p->global[n]] == 0;
  }
  return p->massives > 0 && !prescribed;
}

/* Adds the unmatched rows of the massless components; the multiplier of one that does not become a node is 0. */
static void condense_components (pw_plan *plan) {
  for (pw_component *p = plan->saddle->massless.component; p < plan->saddle->massless.end; p++)
    for (int i = p->pivots; i < p->rows; i++) {
      p->unknown[i] = condense_remains (plan, p, i) ? p->row[i].equation : -1;
      if (p->unknown[i] < 0) continue;
      condense_add_node (plan, (pw_plan_node){ .size = 1, .unknown = p->unknown[i], .grounded = p->grounded });
      for (int g = 0; g < p->groups; g++)
        condense_contribute (plan, p->A + i * p->stride + p->group[g].column, p->stride, p->group[g].j, 0);
    }
}

/* Sorts the contributions by group. */
static int condense_sort (pw_plan *plan) {
  plan->start = pw_arena_alloc (&plan->arena, ((size_t)plan->groups + 2) * sizeof *plan->start);
  plan->list = pw_arena_alloc (&plan->arena, (size_t)plan->contributions * sizeof *plan->list);
  if (plan->failed || plan->start == NULL || plan->list == NULL) return PW_RESOURCE;
  for (int p = 0; p < plan->contributions; p++) plan->start[plan->contribution[p].group + 2]++;
  for (int g = 0; g < plan->groups; g++) plan->start[g + 2] += plan->start[g + 1];
  for (int p = 0; p < plan->contributions; p++) plan->list[plan->start[plan->contribution[p].group + 1]++] = p;
  return PW_OK;
}

/* ---- Dependent equations ---- */

typedef struct {
  pw_plan *plan;
  int *capacity; /* groups: coordinates that no equation takes yet */
  int *taken;    /* contributions: equations of the node that take a coordinate of the group */
  int *by, *of;  /* groups: the contribution by which the search has come, and that which gives way; -1: none */
  int *queue, *visited, queued, search;
} condense_matching;

/* Queues the groups to which node n contributes; contribution `of` gives way to one of them (-1: a new equation). */
static void matching_queue (condense_matching *m, int n, int of) {
  const pw_plan *plan = m->plan;
  int end = n + 1 < plan->nodes ? plan->node[n + 1].first_contribution : plan->contributions;
  for (int p = plan->node[n].first_contribution; p < end; p++) {
    int g = plan->contribution[p].group;
    if (m->visited[g] == m->search) continue;
    m->visited[g] = m->search, m->by[g] = p, m->of[g] = of;
    m->queue[m->queued++] = g;
  }
}

/* Lets an equation of node n take a coordinate; others give way to theirs.  0 if none is left (Berge 1957). */
static int matching_augment (condense_matching *m, int n) {
  const pw_plan *plan = m->plan;
  m->search++, m->queued = 0;
  matching_queue (m, n, -1);
  for (int i = 0; i < m->queued; i++) {
    int g = m->queue[i];
    for (int x = plan->start[g]; m->capacity[g] == 0 && x < plan->start[g + 1]; x++)
      if (m->taken[plan->list[x]]) matching_queue (m, plan->contribution[plan->list[x]].node, plan->list[x]);
    if (m->capacity[g] == 0) continue;
    for (m->capacity[g]--; m->taken[m->by[g]]++, m->of[g] >= 0; g = plan->contribution[m->of[g]].group)
      m->taken[m->of[g]]--;
    return 1;
  }
  return 0;
}

/* Finds out whether the equations depend on each other in every configuration, since some of them are more than the
 * coordinates in which they have entries, such as those of ten pins between the same two bodies.  Then *row is one of
 * them, else it stays. */
static int condense_find_dependent (pw_plan *plan, int *row) {
  size_t groups = (size_t)plan->groups + 1;
  condense_matching m = { .plan = plan, .capacity = pw_arena_alloc (&plan->arena, 5 * groups * sizeof (int)) };
  m.taken = pw_arena_alloc (&plan->arena, ((size_t)plan->contributions + 1) * sizeof *m.taken);
  if (m.capacity == NULL || m.taken == NULL) return PW_RESOURCE;
  m.by = m.capacity + groups, m.of = m.by + groups, m.queue = m.of + groups, m.visited = m.queue + groups;
  for (int j = 0; j < plan->saddle->s->coords; j++)
    m.capacity[pw_group_of (plan->saddle->s, j)] += plan->saddle->inverse_weight[j] > 0;
  for (int n = 0; n < plan->nodes; n++)
    for (int i = 0; i < plan->node[n].size; i++)
      if (!matching_augment (&m, n)) return *row = plan->node[n].unknown + i, PW_OK;
  return PW_OK;
}

/* ---- Bodies that are not condensed ---- */

/* A body to which more nodes than this contribute is not condensed: n nodes have n (n - 1) / 2 couplings, but only 2 n
 * with an uncondensed body, fewer from n = 6.  Measured: 0.6 to 0.9 of the time with 7 nodes, 0.7 to 1.0 with 6. */
enum { CONDENSE_NODES = 6 };

/* Adds two nodes for every body that is not condensed, and ranks all nodes. */
static int condense_uncondensed (pw_plan *plan) {
  struct pw_saddle *saddle = plan->saddle;
  plan->uncondensed = pw_arena_alloc (&plan->arena, (size_t)plan->groups * sizeof *plan->uncondensed);
  if (plan->uncondensed == NULL) return PW_RESOURCE;
  for (int g = 0; g < plan->groups; g++) {
    plan->uncondensed[g] = -1;
    if (plan->start[g + 1] - plan->start[g] <= CONDENSE_NODES || g >= saddle->s->bodies) continue;
    plan->uncondensed[g] = plan->nodes;
    condense_add_node (plan, (pw_plan_node){ .size = 2, .rank = 1, .unknown = saddle->s->rows + saddle->extra });
    condense_add_node (plan, (pw_plan_node){ .size = 1, .rank = 1, .unknown = saddle->s->rows + saddle->extra + 2 });
    saddle->extra += 3;
  }
  if (saddle->extra == 0) return PW_OK;
  saddle->y = malloc ((size_t)(saddle->s->rows + saddle->extra) * sizeof *saddle->y);
  return plan->failed || saddle->y == NULL ? PW_RESOURCE : pw_condense_rank (plan);
}

/* ---- Opening ---- */

int pw_condense (struct pw_saddle *saddle, const double *weight, const unsigned char *active) {
  size_t n = (size_t)saddle->s->coords;
  pw_plan plan = { .saddle = saddle, .weight = weight, .groups = pw_groups (saddle->s) };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &saddle->memory);) {
    saddle->inverse_weight = pw_layout_alloc (&l, n + 3, sizeof *saddle->inverse_weight);
    saddle->force = pw_layout_alloc (&l, saddle->massless.components ? n : 0, sizeof *saddle->force);
    saddle->inactive = pw_layout_alloc (&l, (size_t)saddle->rows, sizeof *saddle->inactive);
  }
  if (saddle->memory == NULL) return PW_RESOURCE;
  for (size_t j = 0; j < n; j++) saddle->inverse_weight[j] = weight[j] > 0 ? 1 / weight[j] : 0;
  condense_elements (&plan, active);
  condense_components (&plan);
  int status = condense_sort (&plan);
  if (status == PW_OK) status = condense_find_dependent (&plan, &saddle->dependent_row);
  if (saddle->dependent_row < 0) {
    if (status == PW_OK) status = condense_uncondensed (&plan);
    if (status == PW_OK) status = pw_condense_block (&plan);
  }
  free (plan.node);
  free (plan.contribution);
  free (plan.pair);
  pw_arena_free (&plan.arena);
  return status;
}
