/* Order and layout of a block L D L^T; see block_ldl.h. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <amd.h>
#include "block_ldl.h"
#include "util.h"

/* ---- Pattern ---- */

/* Neighbours of each node, with repetition; or rows of each column, ascending. */
typedef struct {
  int *first, *list; /* of node or column c: list[first[c]] to list[first[c + 1] - 1] */
} order_lists;

/* An order of elimination. */
typedef struct {
  int *order, *place; /* node at each place; place of each node */
  order_lists L;      /* rows below the diagonal of each column, by place */
} order_variant;

static void order_lists_close (order_lists *l) {
  free (l->first);
  free (l->list);
}

/* The graph of the nodes of at most this rank. */
static int order_graph (int nodes, const pw_plan_node *node, int rank, long pairs, const int *pair,
                        order_lists *graph) {
  int *first = graph->first = calloc ((size_t)nodes + 2, sizeof *first);
  int *list = graph->list = malloc ((size_t)(2 * pairs + 1) * sizeof *list);
  if (first == NULL || list == NULL) return PW_RESOURCE;
  for (int pass = 0; pass < 2; pass++) { /* counts node c in first[c + 2], then fills through first[c + 1] */
    for (long i = 0; i < 2 * pairs; i++) {
      int c = pair[i], r = pair[i ^ 1];
      if (c == r || node[c].rank > rank || node[r].rank > rank) continue;
      if (pass == 0)
        first[c + 2]++;
      else
        list[first[c + 1]++] = r;
    }
    for (int c = 0; pass == 0 && c < nodes; c++) first[c + 2] += first[c + 1];
  }
  return PW_OK;
}

/* Minimum degree order of the nodes of rank 0. */
static int order_by_degree (int nodes, const pw_plan_node *node, long pairs, const int *pair, int *order) {
  order_lists graph = { NULL, NULL };
  int status = order_graph (nodes, node, 0, pairs, pair, &graph);
  if (status == PW_OK && nodes > 0 && amd_order (nodes, graph.first, graph.list, order, NULL, NULL) < 0)
    status = PW_RESOURCE;
  order_lists_close (&graph);
  return status;
}

/* Passes through the rows of L: row i has entries in the columns on the paths of the elimination tree from those of K to
 * i (Davis 2005, Algorithm 849: LDL).  The first pass counts them in first[column + 2] and builds the tree, the second
 * one lists them.  PW_RETRY if there are more than `most`. */
static int order_pass (int nodes, const order_lists *K, int most, order_variant *v, int *parent, int *mark) {
  long count = 0;
  for (int i = 0; i < nodes; i++) mark[i] = -1;
  for (int i = 0; i < nodes && count <= most; i++) {
    mark[i] = i;
    for (int x = K->first[v->order[i]]; x < K->first[v->order[i] + 1]; x++)
      for (int j = v->place[K->list[x]]; j < i && mark[j] != i; j = parent[j]) {
        if (parent[j] < 0) parent[j] = i;
        mark[j] = i;
        count++;
        if (v->L.list)
          v->L.list[v->L.first[j + 1]++] = i;
        else
          v->L.first[j + 2]++;
      }
  }
  return count <= most ? PW_OK : PW_RETRY;
}

static int order_fill (int nodes, const order_lists *K, int most, order_variant *v) {
  int *parent = malloc (2 * ((size_t)nodes + 1) * sizeof *parent), *first = NULL;
  v->L.first = first = calloc ((size_t)nodes + 2, sizeof *first);
  int status = parent && first ? PW_OK : PW_RESOURCE;
  for (int j = 0; j < nodes && status == PW_OK; j++) parent[j] = -1;
  if (status == PW_OK) status = order_pass (nodes, K, most, v, parent, parent + nodes);
  if (status == PW_OK) {
    for (int j = 0; j < nodes; j++) first[j + 2] += first[j + 1];
    v->L.list = malloc (((size_t)first[nodes + 1] + 1) * sizeof *v->L.list);
    status = v->L.list ? order_pass (nodes, K, most, v, parent, parent + nodes) : PW_RESOURCE;
  }
  free (parent);
  return status;
}

/* Moves nodes of higher rank to the end, otherwise in the same order, and lists the rows of each column. */
static int order_try (int nodes, const pw_plan_node *node, const order_lists *K, int most, order_variant *v) {
  int at = 0;
  for (int rank = 0; rank < PW_BLOCK_RANKS; rank++)
    for (int j = 0; j < nodes; j++)
      if (node[v->order[j]].rank == rank) v->place[v->order[j]] = at++;
  for (int n = 0; n < nodes; n++) v->order[v->place[n]] = n;
  return order_fill (nodes, K, most, v);
}

/* Stores in v[0] the order with less fill-in: minimum degree, or the natural order. */
static int order_plan (int nodes, const pw_plan_node *node, long pairs, const int *pair, order_variant *v) {
  order_lists K = { NULL, NULL };
  for (int i = 0; i < 2; i++) {
    v[i].order = malloc (((size_t)nodes + 1) * sizeof *v[i].order);
    v[i].place = malloc (((size_t)nodes + 1) * sizeof *v[i].place);
    if (v[i].order == NULL || v[i].place == NULL) return PW_RESOURCE;
  }
  for (int n = 0; n < nodes; n++) v[1].order[n] = n;
  int status = order_by_degree (nodes, node, pairs, pair, v[0].order);
  if (status == PW_OK) status = order_graph (nodes, node, PW_BLOCK_RANKS, pairs, pair, &K);
  if (status == PW_OK && order_try (nodes, node, &K, INT_MAX / 2, &v[0]) != PW_OK) status = PW_RESOURCE;
  if (status == PW_OK) {
    status = order_try (nodes, node, &K, v[0].L.first[nodes], &v[1]);
    order_variant other = v[0];
    if (status == PW_OK) v[0] = v[1], v[1] = other;
  }
  order_lists_close (&K);
  return status == PW_RETRY ? PW_OK : status;
}

/* ---- Layout ---- */

int pw_block_find (const pw_block_ldl *l, int p, int q) {
  const pw_column *c = &l->column[q];
  int at = c->at + pw_block_diagonal (c->size);
  for (int i = c->first; l->below[i] != p; i++) at += c->size * l->column[l->below[i]].size;
  return at;
}

/* Assigns the positions of the blocks.  Returns PW_RESOURCE if there are too many values. */
static int order_place_columns (pw_block_ldl *l) {
  size_t at = 0;
  for (int j = 0; j < l->nodes; j++) {
    pw_column *c = &l->column[j];
    c->at = (int)at;
    if (c->in_chain) continue;
    at += (size_t)pw_block_diagonal (c->size);
    for (int i = c->first; i < c[1].first; i++) at += (size_t)(c->size * l->column[l->below[i]].size);
    if (at > INT_MAX) return PW_RESOURCE;
  }
  l->column[l->nodes].at = l->values = (int)at;
  return PW_OK;
}

static size_t order_count_targets (int nodes, const order_lists *L) {
  size_t count = 0;
  for (int j = 0; j < nodes; j++) {
    size_t n = (size_t)(L->first[j + 1] - L->first[j]);
    if (n > 1) count += n * (n - 1) / 2;
  }
  return count;
}

/* Column by column: rows q of a column are visited once, each finding its targets by walking down column q. */
static void order_place_targets (pw_block_ldl *l) {
  int *target = l->target;
  for (const pw_column *c = l->column; c < l->column + l->nodes; c++) {
    int n = c[1].first - c->first;
    const int *below = l->below + c->first;
    for (int q = 0; q < n; q++) {
      const pw_column *d = &l->column[below[q]];
      int at = d->at + pw_block_diagonal (d->size), i = d->first;
      for (int p = q + 1; p < n; p++, i++) {
        for (; l->below[i] != below[p]; i++) at += d->size * l->column[l->below[i]].size;
        /* rows p descending: before row p there are those of n - 1 .. p + 1 */
        target[(n - 1 - p) * (n + p) / 2 + q] = at;
        at += d->size * l->column[below[p]].size;
      }
    }
    target += n * (n - 1) / 2;
  }
}

static int order_carve (pw_block_ldl *l, const pw_plan_node *node, const int *order, const order_lists *L) {
  size_t n = (size_t)l->nodes, below = (size_t)L->first[l->nodes], targets = order_count_targets (l->nodes, L);
  for (pw_layout lay = { 0 }; pw_layout_pass (&lay, &l->pattern);) {
    l->column = pw_layout_alloc (&lay, n + 1, sizeof *l->column);
    l->below = pw_layout_alloc (&lay, below, sizeof *l->below);
    l->target = pw_layout_alloc (&lay, targets, sizeof *l->target);
  }
  if (l->pattern == NULL) return PW_RESOURCE;
  memcpy (l->below, L->list, below * sizeof (int));
  for (int j = 0; j < l->nodes; j++)
    l->column[j] =
        (pw_column){ .y = node[order[j]].y, .first = L->first[j], .size = (unsigned char)node[order[j]].size };
  l->column[l->nodes] = (pw_column){ .first = L->first[l->nodes] };
  return PW_OK;
}

int pw_block_lay_out (pw_block_ldl *l) {
  if (order_place_columns (l) != PW_OK) return PW_RESOURCE;
  order_place_targets (l);
  l->value = malloc (((size_t)l->values + 1) * sizeof *l->value);
  return l->value ? PW_OK : PW_RESOURCE;
}

pw_block_ldl *pw_block_open (int nodes, const pw_plan_node *node, long pairs, const int *pair) {
  pw_block_ldl *l = calloc (1, sizeof *l);
  order_variant v[2] = { { 0 } };
  int status = l ? order_plan (nodes, node, pairs, pair, v) : PW_RESOURCE;
  if (status == PW_OK) {
    l->nodes = nodes;
    l->place = v[0].place;
    v[0].place = NULL;
    status = order_carve (l, node, v[0].order, &v[0].L);
  }
  for (int i = 0; i < 2; i++) {
    order_lists_close (&v[i].L);
    free (v[i].order);
    free (v[i].place);
  }
  if (status == PW_OK) return l;
  pw_block_close (l);
  return NULL;
}

void pw_block_close (pw_block_ldl *l) {
  if (l == NULL) return;
  free (l->place);
  free (l->value);
  free (l->pattern);
  free (l->memory);
  free (l);
}
