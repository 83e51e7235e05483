/* The saddle-point system, condensed to the constraint equations; bodies at which many meet are not (block_ldl.h).
 *
 *   S lambda = J W^-1 f - gamma,  S = J W^-1 J^T,     a = W^-1 (f - J^T lambda)
 *
 * (Golub & Greif 2003, On solving block-structured indefinite linear systems.)  Equations that share no coordinate with
 * weight do not meet in S, so S has the pattern of the mechanism: a chain is block tridiagonal.  Coordinates without
 * weight are eliminated first, in massless.c. */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "saddle.h"
#include "condense.h"

/* A pivot is 1 minus a squared cosine.  Round-off leaves the pivot of a dependent row at about eps / s^2, with s the
 * smallest sine of the rows before it: at this one if s = 0.07.  With a smaller s such a row passes, but its sine is
 * below `rank_suspect` (watchdog.c), where opening a run computes the rank. */
#define SADDLE_ROUND_OFF (200 * DBL_EPSILON)

pw_saddle *pw_saddle_open (pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                           pw_error *error) {
  int status = PW_RESOURCE;
  pw_saddle *saddle = calloc (1, sizeof *saddle);
  if (saddle) {
    *saddle = (pw_saddle){ .s = w->s, .w = w, .rows = rows, .pivot = INFINITY, .pivot_row = -1, .dependent_row = -1 };
    status = pw_massless_open (&saddle->massless, w, weight, rows, active, error);
    if (status == PW_OK) status = pw_condense (saddle, weight, active);
  }
  if (status == PW_OK) return saddle;
  pw_saddle_close (saddle);
  pw_fail (error, status, "model %s: out of memory", w->s->model);
  return NULL;
}

void pw_saddle_close (pw_saddle *saddle) {
  if (saddle == NULL) return;
  pw_massless_close (&saddle->massless);
  pw_block_close (saddle->block);
  free (saddle->y);
  free (saddle->memory);
  free (saddle);
}

void pw_saddle_postpone (pw_saddle *saddle, double pivot) {
  saddle->postponed = pivot;
}

int pw_saddle_factor (pw_saddle *saddle) {
  saddle->postponed = 0;
  saddle->pivot_row = saddle->dependent_row;
  if (saddle->block == NULL) return saddle->pivot = 0, PW_RETRY;
  saddle->pivot = saddle->massless.components ? pw_massless_factor (&saddle->massless) : INFINITY;
  if (!(saddle->pivot > SADDLE_ROUND_OFF)) return PW_RETRY;
  pw_block_factor (saddle->block);
  if (!(saddle->block->least_pivot >= saddle->pivot)) {
    const int row = saddle->block->least_unknown;
    saddle->pivot = saddle->block->least_pivot;
    saddle->pivot_row = row >= 0 && row < saddle->s->rows && saddle->massless.component_of_row[row] < 0 ? row : -1;
  }
  return saddle->pivot > SADDLE_ROUND_OFF ? PW_OK : PW_RETRY;
}

int pw_saddle_sine_below (pw_saddle *saddle, double sine) {
  if (sine * sine <= saddle->postponed) return 0;
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  return !(saddle->pivot >= sine * sine);
}

double pw_saddle_sine (pw_saddle *saddle, int *row) {
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  if (row) *row = saddle->pivot_row;
  return saddle->pivot > 0 ? sqrt (fmin (saddle->pivot, 1)) : 0;
}

void pw_saddle_solve (pw_saddle *saddle, const double *f, const double *gamma, double *a, double *lambda) {
  const size_t bytes = (size_t)saddle->rows * sizeof *lambda;
  double *y = saddle->extra ? saddle->y : lambda;
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  if (y != gamma) memcpy (y, gamma, bytes);
  for (int i = 0; i < saddle->extra; i++) y[saddle->s->rows + i] = 0;
  if (saddle->massless.components) {
    for (int j = 0; j < saddle->s->coords; j++) saddle->force[j] = f ? f[j] : 0;
    f = saddle->force;
    pw_massless_forward (&saddle->massless, saddle->force, y);
  }
  pw_block_solve (saddle->block, f, y, a);
  if (y != lambda) memcpy (lambda, y, bytes);
  for (int i = 0; i < saddle->inactive_count; i++) lambda[saddle->inactive[i]] = 0;
  if (saddle->massless.components) pw_massless_backward (&saddle->massless, a, lambda);
}

/* Plans the condensed matrix: its nodes, and the bodies that are not condensed; see condense.h. */

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

/* Plans the block L D L^T: the pattern of S and the group blocks; see condense.h and block_ldl.h. */

/* ---- Pattern ---- */

static void condense_add_pair (pw_plan *plan, int a, int b) {
  plan->failed |= pw_grow (&plan->pair, (size_t)plan->pairs, &plan->pair_room, 2 * sizeof *plan->pair) != PW_OK;
  if (plan->failed) return;
  plan->pair[2 * plan->pairs] = a, plan->pair[2 * plan->pairs + 1] = b;
  plan->pairs++;
}

/* Lists the pairs of nodes that meet at a group, or, if that is an uncondensed body, each of them with its nodes. */
static void condense_pairs (pw_plan *plan) {
  for (int g = 0; g < plan->groups; g++) {
    int body = plan->uncondensed[g];
    for (int x = plan->start[g]; x < plan->start[g + 1]; x++) {
      int a = plan->contribution[plan->list[x]].node;
      if (body >= 0) condense_add_pair (plan, a, body), condense_add_pair (plan, a, body + 1);
      for (int y = plan->start[g]; y < x && body < 0; y++)
        condense_add_pair (plan, a, plan->contribution[plan->list[y]].node);
    }
  }
}

/* Sorts the contributions of each group by column; by insertion, since there are few. */
static void condense_sort_columns (const pw_plan *plan, const int *column_of_node) {
  for (int g = 0; g < plan->groups; g++) {
    int *list = plan->list + plan->start[g], count = plan->start[g + 1] - plan->start[g];
    for (int x = 1; x < count; x++)
      for (int y = x; y > 0; y--) {
        int a = list[y - 1], b = list[y];
        if (column_of_node[plan->contribution[a].node] <= column_of_node[plan->contribution[b].node]) break;
        list[y - 1] = b, list[y] = a;
      }
  }
}

/* ---- Groups ---- */

/* Fills the block p of group g; *contributions, *couplings: numbers of those filled so far. */
static void condense_group (const pw_plan *plan, pw_block_ldl *l, int g, pw_group_block *p, int *contributions,
                            int *couplings) {
  int j = pw_group_first (plan->saddle->s, g), body = plan->uncondensed[g];
  *p = (pw_group_block){ .j = j,
                         .first_contribution = *contributions,
                         .first_coupling = *couplings,
                         .width = (unsigned char)pw_group_width (plan->saddle->s, j),
                         .uncondensed = body >= 0 };
  for (int x = plan->start[g]; x < plan->start[g + 1]; x++) {
    const pw_plan_contribution *a = &plan->contribution[plan->list[x]];
    const pw_plan_node *n = &plan->node[a->node];
    l->contribution[(*contributions)++] =
        (pw_contribution){ a->J, n->unknown, l->column[l->column_of_node[a->node]].first_value, a->row_stride,
                           (short)n->size };
    if (body >= 0)
      for (int i = 0; i < 2; i++) l->coupling[(*couplings)++] = pw_block_find (l, a->node, body + i);
    else
      for (int y = x + 1; y < plan->start[g + 1]; y++)
        l->coupling[(*couplings)++] = pw_block_find (l, a->node, plan->contribution[plan->list[y]].node);
  }
  for (int i = body; body >= 0 && i < body + 2; i++)
    l->contribution[(*contributions)++] = (pw_contribution){ .unknown = plan->node[i].unknown,
                                                             .diagonal = l->column[l->column_of_node[i]].first_value,
                                                             .size = (short)plan->node[i].size };
}

/* Allocates and fills the groups' blocks, and the chains. */
static int condense_fill (const pw_plan *plan, pw_block_ldl *l) {
  int contributions = 0, couplings = 0, filled = 0, uncondensed = plan->saddle->extra / 3;
  l->inverse_weight = plan->saddle->inverse_weight;
  l->groups = plan->groups - plan->linked; /* bodies of chains have no block */
  for (pw_layout lay = { 0 }; pw_layout_pass (&lay, &l->memory);) {
    l->group = pw_layout_alloc (&lay, (size_t)l->groups + 1, sizeof *l->group);
    l->contribution = pw_layout_alloc (&lay, (size_t)(plan->contributions - 2 * plan->linked + 2 * uncondensed),
                                       sizeof *l->contribution);
    l->coupling = pw_layout_alloc (&lay, (size_t)(plan->pairs - plan->linked), sizeof *l->coupling);
    l->chain = pw_layout_alloc (&lay, (size_t)plan->chains + 1, sizeof *l->chain);
    l->chain_factor = pw_layout_alloc (&lay, 3 * (size_t)(plan->linked + plan->chains), sizeof *l->chain_factor);
  }
  if (l->memory == NULL) return PW_RESOURCE;
  memcpy (l->chain, plan->chain, (size_t)plan->chains * sizeof *l->chain);
  l->chain[plan->chains] = (pw_chain){ .first_column = l->nodes + 1 };
  for (int last = 0; last < 2; last++) /* uncondensed bodies last: they add to diagonals that the others store */
    for (int g = 0; g < plan->groups; g++)
      if (!plan->is_linked[g] && (plan->uncondensed[g] >= 0) == last)
        condense_group (plan, l, g, &l->group[filled++], &contributions, &couplings);
  l->group[filled] = (pw_group_block){ .first_contribution = contributions, .first_coupling = couplings };
  return PW_OK;
}

int pw_condense_block (pw_plan *plan) {
  condense_pairs (plan);
  if (plan->failed || plan->pairs >= INT_MAX / 2) return PW_RESOURCE;
  pw_block_ldl *l = plan->saddle->block = pw_block_open (plan->nodes, plan->node, plan->pairs, plan->pair);
  if (l == NULL) return PW_RESOURCE;
  condense_sort_columns (plan, l->column_of_node);
  int status = pw_condense_chains (plan, l);
  if (status == PW_OK) status = pw_block_lay_out (l);
  return status == PW_OK ? condense_fill (plan, l) : status;
}

/* Finds the chains of a scene; see condense.h and block_ldl.h. */

/* A column, and the block between it and the next one. */
typedef struct {
  int contributions; /* to the column; 2 inside a chain */
  int sources;       /* bodies and eliminated columns that add to the block */
  pw_chain link;     /* one of these bodies as a chain of one; link.bodies is 0 if none can be in a chain */
} chain_between;

/* Fills link for a body whose two nodes are a column and the next one, the only row below it.  Returns the column; -1
 * if the body cannot be in a chain. */
static int chain_link (const pw_plan *plan, const pw_block_ldl *l, int body, pw_chain *link) {
  const int j = 3 * body, *list = plan->list + plan->start[body];
  if (plan->start[body + 1] - plan->start[body] != 2) return -1;
  const pw_plan_contribution *a = &plan->contribution[list[0]], *b = &plan->contribution[list[1]];
  int column = l->column_of_node[a->node];
  if (!a->is_pin || !b->is_pin || plan->saddle->inverse_weight[j] != plan->saddle->inverse_weight[j + 1]) return -1;
  if (l->column_of_node[b->node] != column + 1 ||
      l->column[column + 1].first_below - l->column[column].first_below != 1)
    return -1;
  *link = (pw_chain){ .first_column = column,
                      .bodies = 1,
                      .J_first = a->J,
                      .J_second = b->J,
                      .row_stride = a->row_stride,
                      .unknown = plan->node[a->node].unknown,
                      .j = j,
                      .unknown_stride = plan->node[b->node].unknown - plan->node[a->node].unknown };
  return column;
}

/* Appends the body of link, after that of last, if it continues the chain at the same strides; returns whether it
 * does. */
static int chain_add (pw_chain *chain, const pw_chain *last, const pw_chain *link) {
  int J_stride = (int)(link->J_first - last->J_first), j_stride = link->j - last->j;
  if (link->J_second - last->J_second != J_stride || link->unknown_stride != chain->unknown_stride) return 0;
  if (chain->bodies > 1 && (J_stride != chain->J_stride || j_stride != chain->j_stride)) return 0;
  chain->J_stride = J_stride;
  chain->j_stride = j_stride;
  chain->bodies++;
  return 1;
}

/* Joins links to chains. */
static void chain_join (pw_plan *plan, pw_block_ldl *l, const chain_between *between) {
  for (int p = 0; p < l->nodes;) {
    const chain_between *b = &between[p++];
    if (b->sources != 1 || b->link.bodies == 0) continue;
    pw_chain *chain = &plan->chain[plan->chains++];
    *chain = b->link;
    chain->first_factor = 3 * (plan->linked + plan->chains - 1);
    plan->is_linked[b->link.j / 3] = 1;
    for (; p < l->nodes && between[p].sources == 1 && between[p].contributions == 2; p++) {
      if (between[p].link.bodies == 0) break;
      if (!chain_add (chain, &between[p - 1].link, &between[p].link)) break;
      plan->is_linked[between[p].link.j / 3] = 1;
      l->column[p].in_chain = 1;
    }
    const pw_block_column *last = &l->column[chain->first_column + chain->bodies];
    chain->includes_last = chain->bodies > 1 && last[1].first_below == last->first_below;
    plan->linked += chain->bodies;
  }
}

/* Counts as sources the columns eliminated earlier that have both a column and the next one below them: fill-in. */
static void chain_fill (const pw_block_ldl *l, chain_between *between) {
  for (int p = 0; p < l->nodes; p++)
    for (int i = l->column[p].first_below + 1; i < l->column[p + 1].first_below; i++)
      if (l->below[i] == l->below[i - 1] + 1) between[l->below[i - 1]].sources++;
}

/* Counts a body as a source; its contributions are in the order of their columns. */
static void chain_count (const pw_plan *plan, const pw_block_ldl *l, int body, chain_between *between) {
  for (int x = plan->start[body] + 1; x < plan->start[body + 1]; x++) {
    int column = l->column_of_node[plan->contribution[plan->list[x - 1]].node];
    if (l->column_of_node[plan->contribution[plan->list[x]].node] == column + 1) between[column].sources++;
  }
}

int pw_condense_chains (pw_plan *plan, pw_block_ldl *l) {
  size_t nodes = (size_t)l->nodes;
  chain_between *between = pw_arena_alloc (&plan->arena, nodes * sizeof *between);
  plan->chain = pw_arena_alloc (&plan->arena, nodes * sizeof *plan->chain);
  plan->is_linked = pw_arena_alloc (&plan->arena, (size_t)plan->groups);
  if (!between || !plan->chain || !plan->is_linked) return PW_RESOURCE;
  for (int p = 0; p < plan->contributions; p++) between[l->column_of_node[plan->contribution[p].node]].contributions++;
  for (int body = 0; body < plan->saddle->s->bodies; body++) {
    pw_chain link;
    int column = chain_link (plan, l, body, &link);
    if (column >= 0) between[column].link = link;
    chain_count (plan, l, body, between);
  }
  chain_fill (l, between);
  chain_join (plan, l, between);
  return PW_OK;
}

/* Ranks the nodes of a scene with uncondensed bodies; see condense.h and block_ldl.h.
 *
 * Nodes of rank 0 are eliminated before the uncondensed bodies, as if these were at rest; those of rank 2 after them.
 * The matrix of rank 0 must be regular wherever the mechanism is.  A leg is a set of bodies joined by nodes that touch
 * neither uncondensed bodies nor the ground.  If a leg joins an uncondensed body to the ground, or to another
 * uncondensed body, and both its ends were at rest, the matrix would be singular where the leg is stretched.  So the
 * nodes at one end have rank 2: at the ground, or at one of the two bodies.  Then multipliers of rank 0 that exert no
 * force on the bodies of a leg exert none on the body at its other end either, since the forces of a joint on its two
 * bodies are opposite: dependent equations of rank 0 are dependent in the whole mechanism.  Nodes of uncondensed bodies
 * alone have rank 2, too: with these at rest their equations would be empty.  The rolling equation of a wheel has rank
 * 0: no other equation contains the wheel's spin. */

/* The end of the contributions of node n: one after the last. */
static int rank_end (const pw_plan *plan, int n) {
  return n + 1 < plan->nodes ? plan->node[n + 1].first_contribution : plan->contributions;
}

/* 1 if node n touches the ground, or prescribed coordinates of a condensed body, which are at rest as well. */
static int rank_is_grounded (const pw_plan *plan, int n) {
  int grounded = plan->node[n].grounded;
  for (int p = plan->node[n].first_contribution; p < rank_end (plan, n); p++)
    grounded |= plan->contribution[p].is_prescribed && plan->uncondensed[plan->contribution[p].group] < 0;
  return grounded;
}

/* 1 for a node that touches an uncondensed body; of the others 2 if it is grounded, else 0. */
static int rank_turn (const pw_plan *plan, int n) {
  for (int p = plan->node[n].first_contribution; p < rank_end (plan, n); p++)
    if (plan->uncondensed[plan->contribution[p].group] >= 0) return 1;
  return rank_is_grounded (plan, n) ? 2 : 0;
}

/* Joins the groups of node n, and the ground if the node is grounded.  Returns 0, without joining, if that would
 * connect two uncondensed bodies, or one with the ground, or if the node touches uncondensed bodies alone.  parent:
 * groups and the ground: union-find, in which uncondensed bodies and the ground are roots. */
static int rank_join (const pw_plan *plan, int *parent, int n) {
  const int first = plan->node[n].first_contribution, end = rank_end (plan, n);
  int at_rest = rank_is_grounded (plan, n) ? plan->groups : -1, root = -1, moves = first == end;
  if (plan->node[n].rolls && plan->contribution[end - 1].group >= plan->saddle->s->bodies) return 1;
  for (int p = first; p < end; p++) {
    moves |= plan->uncondensed[plan->contribution[p].group] < 0;
    root = pw_root (parent, plan->contribution[p].group);
    if (root != plan->groups && plan->uncondensed[root] < 0) continue;
    if (at_rest >= 0 && at_rest != root) return 0;
    at_rest = root;
  }
  if (!moves) return 0;
  if (at_rest >= 0) root = at_rest;
  for (int p = first; p < end; p++) parent[pw_root (parent, plan->contribution[p].group)] = root;
  return 1;
}

int pw_condense_rank (pw_plan *plan) {
  int *parent = pw_arena_alloc (&plan->arena, ((size_t)plan->groups + 1) * sizeof *parent);
  if (parent == NULL) return PW_RESOURCE;
  for (int g = 0; g <= plan->groups; g++) parent[g] = g;
  for (int turn = 0; turn < 3; turn++) /* the legs, then their ends at uncondensed bodies, then those at the ground */
    for (int n = 0; n < plan->nodes; n++)
      if (rank_turn (plan, n) == turn && !rank_join (plan, parent, n)) plan->node[n].rank = 2;
  return PW_OK;
}
