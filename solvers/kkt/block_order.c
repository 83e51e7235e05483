/* Order and layout of a block L D L^T; see block_ldl.h. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <amd.h>
#include "block_ldl.h"
#include "util.h"

/* ---- Pattern ---- */

/* Lists of places: the pattern of each column, first of K, then of L. */
typedef struct {
  int *first, *list;
} order_lists;

static int order_compare (const void *a, const void *b) {
  int x = *(const int *)a, y = *(const int *)b;
  return (x > y) - (x < y);
}

/* Sorted lists without repetition of the rows of each column, from pairs; `place` renumbers and may be NULL; `lower`
 * keeps rows below the diagonal only.  The lists are allocated here. */
static int order_collect (int nodes, long pairs, const int *pair, const int *place, int lower, order_lists *lists) {
  int *first = lists->first = calloc ((size_t)nodes + 2, sizeof (int));
  int *list = lists->list = malloc ((size_t)(2 * pairs + 1) * sizeof (int));
  if (first == NULL || list == NULL) return PW_RESOURCE;
  for (int pass = 0; pass < 2; pass++) { /* counts column c in first[c + 2], then fills through first[c + 1] */
    for (long i = 0; i < 2 * pairs; i++) {
      int c = pair[i], r = pair[i ^ 1];
      if (place) c = place[c], r = place[r];
      if (c == r || (lower && r < c)) continue;
      if (pass == 0)
        first[c + 2]++;
      else
        list[first[c + 1]++] = r;
    }
    for (int c = 0; pass == 0 && c < nodes; c++) first[c + 2] += first[c + 1];
  }
  int to = 0, from = 0;
  for (int c = 0; c < nodes; c++) {
    int end = first[c + 1], previous = -1;
    qsort (list + from, (size_t)(end - from), sizeof (int), order_compare);
    first[c] = to;
    for (int i = from; i < end; i++)
      if (list[i] != previous) list[to++] = previous = list[i];
    from = end;
  }
  first[nodes] = to;
  return PW_OK;
}

static void order_lists_close (order_lists *l) {
  free (l->first);
  free (l->list);
  l->first = l->list = NULL;
}

/* Puts higher ranks later, without changing the order otherwise; place: of each node. */
static int order_sort_ranks (int nodes, const int *rank, int *order, int *place) {
  int at = 0, *old = malloc (((size_t)nodes + 1) * sizeof *old);
  if (old == NULL) return PW_RESOURCE;
  memcpy (old, order, (size_t)nodes * sizeof *old);
  for (int r = 0; r < PW_BLOCK_RANKS; r++)
    for (int j = 0; j < nodes; j++)
      if (rank[old[j]] == r) order[place[old[j]] = at++] = old[j];
  free (old);
  return PW_OK;
}

/* Minimum degree order of the graph of the nodes of rank 0. */
static int order_by_degree (int nodes, const int *rank, long pairs, const int *pair, int *order) {
  order_lists graph = { NULL, NULL };
  int *inner = malloc ((size_t)(2 * pairs + 1) * sizeof *inner);
  if (inner == NULL) return PW_RESOURCE;
  long inners = 0;
  for (long i = 0; i < pairs; i++) {
    if (rank[pair[2 * i]] > 0 || rank[pair[2 * i + 1]] > 0) continue;
    inner[2 * inners] = pair[2 * i];
    inner[2 * inners++ + 1] = pair[2 * i + 1];
  }
  int status = order_collect (nodes, inners, inner, NULL, 0, &graph);
  if (status == PW_OK && nodes > 0 && amd_order (nodes, graph.first, graph.list, order, NULL, NULL) < 0)
    status = PW_RESOURCE;
  order_lists_close (&graph);
  free (inner);
  return status;
}

/* Scratch data of the symbolic factorisation: the elimination tree as lists of children, and marks. */
typedef struct {
  int *mark, *child, *sibling;
  size_t room; /* of L's list */
} order_tree;

static int order_tree_open (order_tree *t, int nodes, const order_lists *K, order_lists *L) {
  size_t n = (size_t)nodes + 1;
  t->room = (size_t)K->first[nodes] + 16;
  t->mark = malloc (3 * n * sizeof *t->mark);
  L->first = malloc (n * sizeof *L->first);
  L->list = malloc (t->room * sizeof *L->list);
  if (t->mark == NULL || L->first == NULL || L->list == NULL) return PW_RESOURCE;
  t->child = t->mark + n;
  t->sibling = t->child + n;
  for (int j = 0; j < nodes; j++) t->mark[j] = t->child[j] = -1;
  L->first[0] = 0;
  return PW_OK;
}

/* Makes room for the rows of a column, including repetitions. */
static int order_tree_grow (order_tree *t, int j, const order_lists *K, order_lists *L) {
  size_t most = (size_t)L->first[j] + (size_t)(K->first[j + 1] - K->first[j]);
  for (int c = t->child[j]; c >= 0; c = t->sibling[c]) most += (size_t)(L->first[c + 1] - L->first[c]);
  if (most <= t->room) return PW_OK;
  if (most > INT_MAX / 2) return PW_RESOURCE;
  int *more = realloc (L->list, 2 * most * sizeof *more);
  if (more == NULL) return PW_RESOURCE;
  L->list = more;
  t->room = 2 * most;
  return PW_OK;
}

/* Columns of L: those of K, and those of the children in the elimination tree without the child's parent.  PW_RETRY
 * if there are more than `most` blocks. */
static int order_fill (int nodes, const order_lists *K, int most, order_lists *L) {
  order_tree t = { NULL, NULL, NULL, 0 };
  int status = order_tree_open (&t, nodes, K, L);
  for (int j = 0; j < nodes && status == PW_OK; j++) {
    status = order_tree_grow (&t, j, K, L);
    if (status != PW_OK) break;
    int used = L->first[j], *list = L->list;
    t.mark[j] = j;
    for (int i = K->first[j]; i < K->first[j + 1]; i++) t.mark[list[used++] = K->list[i]] = j;
    for (int c = t.child[j]; c >= 0; c = t.sibling[c])
      for (int i = L->first[c]; i < L->first[c + 1]; i++)
        if (t.mark[list[i]] != j) t.mark[list[used++] = list[i]] = j;
    L->first[j + 1] = used;
    if (used > most) status = PW_RETRY;
    if (used == L->first[j]) continue;
    qsort (list + L->first[j], (size_t)(used - L->first[j]), sizeof *list, order_compare);
    int parent = list[L->first[j]];
    t.sibling[j] = t.child[parent];
    t.child[parent] = j;
  }
  free (t.mark);
  return status;
}

/* Orders by rank, else as it is or by minimum degree, and lists the rows of each column in L.  PW_RETRY if there are
 * more than `most` blocks. */
static int order_try (int nodes, const int *rank, long pairs, const int *pair, int most, int *order, int *place,
                      order_lists *L) {
  order_lists K = { NULL, NULL };
  int status = order_sort_ranks (nodes, rank, order, place);
  if (status == PW_OK) status = order_collect (nodes, pairs, pair, place, 1, &K);
  if (status == PW_OK) status = order_fill (nodes, &K, most, L);
  order_lists_close (&K);
  return status;
}

/* The better of the two orders. */
static int order_plan (int nodes, const int *rank, long pairs, const int *pair, int *order, int *place,
                       order_lists *L) {
  order_lists natural = { NULL, NULL };
  int *other = malloc ((2 * (size_t)nodes + 1) * sizeof *other);
  int status = other ? order_by_degree (nodes, rank, pairs, pair, order) : PW_RESOURCE;
  if (status == PW_OK) status = order_try (nodes, rank, pairs, pair, INT_MAX, order, place, L);
  for (int j = 0; j < nodes && status == PW_OK; j++) other[j] = j;
  if (status == PW_OK) {
    status = order_try (nodes, rank, pairs, pair, L->first[nodes], other, other + nodes, &natural);
    if (status == PW_OK) {
      order_lists worse = *L;
      *L = natural;
      natural = worse;
      memcpy (order, other, (size_t)nodes * sizeof *order);
      memcpy (place, other + nodes, (size_t)nodes * sizeof *place);
    } else if (status == PW_RETRY)
      status = PW_OK;
  }
  order_lists_close (&natural);
  free (other);
  return status;
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

static int order_carve (pw_block_ldl *l, const int *size, const int *y, const int *order, const order_lists *L) {
  size_t n = (size_t)l->nodes, below = (size_t)L->first[l->nodes], targets = order_count_targets (l->nodes, L);
  pw_layout lay = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    l->column = pw_take (&lay, n + 1, sizeof *l->column);
    l->below = pw_take (&lay, below, sizeof *l->below);
    l->target = pw_take (&lay, targets, sizeof *l->target);
    if (pass == 1) break;
    l->pattern = malloc (lay.used);
    if (l->pattern == NULL) return PW_RESOURCE;
    lay = (pw_layout){ l->pattern, 0 };
  }
  memcpy (l->below, L->list, below * sizeof (int));
  for (int j = 0; j < l->nodes; j++)
    l->column[j] = (pw_column){ .y = y[order[j]], .first = L->first[j], .size = (unsigned char)size[order[j]] };
  l->column[l->nodes] = (pw_column){ .first = L->first[l->nodes] };
  return PW_OK;
}

int pw_block_lay_out (pw_block_ldl *l) {
  if (order_place_columns (l) != PW_OK) return PW_RESOURCE;
  order_place_targets (l);
  l->value = malloc (((size_t)l->values + 1) * sizeof *l->value);
  return l->value ? PW_OK : PW_RESOURCE;
}

pw_block_ldl *pw_block_open (int nodes, const int *size, const int *y, const int *rank, long pairs, const int *pair) {
  pw_block_ldl *l = calloc (1, sizeof *l);
  int *order = malloc (((size_t)nodes + 1) * sizeof *order);
  order_lists L = { NULL, NULL };
  if (l) l->place = malloc (((size_t)nodes + 1) * sizeof *l->place);
  int status = l && order && l->place ? order_plan (nodes, rank, pairs, pair, order, l->place, &L) : PW_RESOURCE;
  if (status == PW_OK) {
    l->nodes = nodes;
    status = order_carve (l, size, y, order, &L);
  }
  order_lists_close (&L);
  free (order);
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
