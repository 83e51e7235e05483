/* Elimination order and layout of a block L D L^T; see block_ldl.h. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <amd.h>
#include "block_ldl.h"
#include "util.h"

typedef struct {
  int nodes;
  const pw_plan_node *node;
  long pairs;
  const int *pair;
  int *first, *list;   /* neighbours of node n, with repetition: list[first[n]] to list[first[n + 1] - 1] */
  int *order, *column; /* node of each column; column of each node */
  int *first_below;    /* as in pw_block_column */
  int *parent;         /* of each column in the elimination tree, or -1 */
  int *visited;        /* the last row whose paths in this tree have visited the column */
  int *next;           /* of each node or column: its number of entries, then where the next one is listed */
  char *memory;
} order_search;

static int order_open (order_search *x) {
  int **const array[] = { &x->first, &x->order, &x->column, &x->first_below, &x->parent, &x->visited, &x->next };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &x->memory);) {
    x->list = pw_layout_alloc (&l, (size_t)(2 * x->pairs), sizeof *x->list);
    for (size_t i = 0; i < sizeof array / sizeof *array; i++)
      *array[i] = pw_layout_alloc (&l, (size_t)x->nodes + 1, sizeof (int));
  }
  return x->memory ? PW_OK : PW_RESOURCE;
}

/* Gives each list as many entries as x->next has counted: first[c] and x->next[c] become its beginning. */
static void order_begin_lists (order_search *x, int *first) {
  first[0] = 0;
  for (int c = 0; c < x->nodes; c++) {
    first[c + 1] = first[c] + x->next[c];
    x->next[c] = first[c];
  }
}

/* Lists the neighbours of each node in the graph of the nodes of at most this rank. */
static void order_list_neighbours (order_search *x, int rank) {
  memset (x->next, 0, (size_t)x->nodes * sizeof *x->next);
  for (int listing = 0; listing < 2; listing++) { /* counts, then lists */
    for (long i = 0; i < 2 * x->pairs; i++) {
      int c = x->pair[i], r = x->pair[i ^ 1];
      if (c == r || x->node[c].rank > rank || x->node[r].rank > rank) continue;
      if (listing) x->list[x->next[c]] = r;
      x->next[c]++;
    }
    if (!listing) order_begin_lists (x, x->first);
  }
}

/* Passes through the rows of L.  Row i has entries in the columns on the paths to i in the elimination tree that begin
 * at the columns in which row i of the matrix has entries (Davis 2005, Algorithm 849: LDL).  Counts them in
 * x->next of each column or, if `below` is not NULL, lists them there.  PW_RETRY if there are more than `most`. */
static int order_pass (const order_search *x, int most, int *below) {
  long count = 0;
  for (int i = 0; i < x->nodes; i++) x->visited[i] = x->parent[i] = -1;
  for (int i = 0; i < x->nodes && count <= most; i++) {
    int node = x->order[i];
    x->visited[i] = i;
    for (int k = x->first[node]; k < x->first[node + 1]; k++)
      for (int j = x->column[x->list[k]]; j < i && x->visited[j] != i; j = x->parent[j]) {
        if (x->parent[j] < 0) x->parent[j] = i;
        x->visited[j] = i;
        count++;
        if (below) below[x->next[j]] = i;
        x->next[j]++;
      }
  }
  return count <= most ? PW_OK : PW_RETRY;
}

/* A matrix with the columns x->order, the rows below their diagonals not yet listed; NULL if out of memory. */
static pw_block_ldl *order_allocate (const order_search *x) {
  size_t n = (size_t)x->nodes;
  pw_block_ldl *l = calloc (1, sizeof *l);
  for (pw_layout lay = { 0 }; l && pw_layout_pass (&lay, &l->pattern);) {
    l->column = pw_layout_alloc (&lay, n + 1, sizeof *l->column);
    l->below = pw_layout_alloc (&lay, (size_t)x->first_below[n], sizeof *l->below);
    l->column_of_node = pw_layout_alloc (&lay, n, sizeof *l->column_of_node);
  }
  if (l == NULL || l->pattern == NULL) return free (l), NULL;
  l->nodes = x->nodes;
  memcpy (l->column_of_node, x->column, n * sizeof *l->column_of_node);
  for (int j = 0; j <= l->nodes; j++) l->column[j].first_below = x->first_below[j];
  for (int j = 0; j < l->nodes; j++) {
    const pw_plan_node *node = &x->node[x->order[j]];
    l->column[j].unknown = node->unknown, l->column[j].size = (unsigned char)node->size;
  }
  return l;
}

/* Sorts x->order by rank and determines the pattern of L, fill-in included.  *status: PW_OK, PW_RESOURCE, or PW_RETRY
 * if there are more than `most` blocks below the diagonal. */
static pw_block_ldl *order_fill (order_search *x, int most, int *status) {
  int at = 0;
  for (int rank = 0; rank < PW_BLOCK_RANKS; rank++)
    for (int j = 0; j < x->nodes; j++)
      if (x->node[x->order[j]].rank == rank) x->column[x->order[j]] = at++;
  for (int n = 0; n < x->nodes; n++) x->order[x->column[n]] = n;
  memset (x->next, 0, (size_t)x->nodes * sizeof *x->next);
  *status = order_pass (x, most, NULL);
  if (*status != PW_OK) return NULL;
  order_begin_lists (x, x->first_below);
  pw_block_ldl *l = order_allocate (x);
  *status = l ? order_pass (x, most, l->below) : PW_RESOURCE;
  return l;
}

/* In the natural order or, if that has less fill-in, minimum degree in rank 0; NULL if out of memory or L is too
 * large. */
static pw_block_ldl *order_choose (order_search *x) {
  int status;
  if (order_open (x) != PW_OK) return NULL;
  order_list_neighbours (x, 0);
  if (x->nodes > 0 && amd_order (x->nodes, x->first, x->list, x->order, NULL, NULL) < 0) return NULL;
  order_list_neighbours (x, PW_BLOCK_RANKS - 1);
  pw_block_ldl *minimum_degree = order_fill (x, INT_MAX / 2, &status);
  if (minimum_degree == NULL) return NULL;
  for (int n = 0; n < x->nodes; n++) x->order[n] = n;
  pw_block_ldl *natural = order_fill (x, minimum_degree->column[x->nodes].first_below, &status);
  if (status == PW_RETRY) return minimum_degree;
  pw_block_close (minimum_degree);
  return natural;
}

/* ---- Layout ---- */

int pw_block_find (const pw_block_ldl *l, int a, int b) {
  const int row = l->column_of_node[a], column = l->column_of_node[b];
  if (row < column) return pw_block_find (l, b, a);
  const pw_block_column *c = &l->column[column];
  int at = c->first_value + pw_block_diagonal_values (c->size);
  for (int i = c->first_below; l->below[i] != row; i++) at += c->size * l->column[l->below[i]].size;
  return at;
}

/* Assigns each column its first value.  PW_OK, or PW_RESOURCE if there are too many values. */
static int order_place_columns (pw_block_ldl *l) {
  size_t at = 0;
  for (int j = 0; j < l->nodes; j++) {
    pw_block_column *c = &l->column[j];
    c->first_value = (int)at;
    if (c->in_chain) continue;
    at += (size_t)pw_block_diagonal_values (c->size);
    for (int i = c->first_below; i < c[1].first_below; i++) at += (size_t)(c->size * l->column[l->below[i]].size);
    if (at > INT_MAX) return PW_RESOURCE;
  }
  l->column[l->nodes].first_value = l->values = (int)at;
  return PW_OK;
}

/* For each column, for its q-th row below: walks once down the column of that row, where the targets of the rows p > q
 * are in ascending order. */
static void order_place_targets (pw_block_ldl *l) {
  int *target = l->target;
  for (const pw_block_column *c = l->column; c < l->column + l->nodes; c++) {
    int n = c[1].first_below - c->first_below;
    const int *below = l->below + c->first_below;
    if (n > PW_BLOCK_LISTED) continue;
    for (int q = 0; q < n; q++) {
      const pw_block_column *d = &l->column[below[q]];
      int at = d->first_value + pw_block_diagonal_values (d->size), i = d->first_below;
      for (int p = q + 1; p < n; p++, i++) {
        for (; l->below[i] != below[p]; i++) at += d->size * l->column[l->below[i]].size;
        /* rows p descending, each with p entries: those of rows n - 1 .. p + 1 come first */
        target[(n - 1 - p) * (n + p) / 2 + q] = at;
        at += d->size * l->column[below[p]].size;
      }
    }
    target += n * (n - 1) / 2;
  }
}

int pw_block_lay_out (pw_block_ldl *l) {
  size_t targets = 0, longest = 0;
  if (order_place_columns (l) != PW_OK) return PW_RESOURCE;
  for (const pw_block_column *c = l->column; c < l->column + l->nodes; c++) {
    size_t rows = (size_t)(c[1].first_below - c->first_below);
    if (rows <= PW_BLOCK_LISTED)
      targets += rows * (rows - 1) / 2; /* one for each pair of rows of the column */
    else if (rows > longest)
      longest = rows;
  }
  l->cursor = malloc ((2 * longest + 1) * sizeof *l->cursor);
  l->target = malloc ((targets + 1) * sizeof *l->target);
  l->value = malloc (((size_t)l->values + 1) * sizeof *l->value);
  if (l->cursor == NULL || l->target == NULL || l->value == NULL) return PW_RESOURCE;
  order_place_targets (l);
  return PW_OK;
}

pw_block_ldl *pw_block_open (int nodes, const pw_plan_node *node, long pairs, const int *pair) {
  order_search x = { .nodes = nodes, .node = node, .pairs = pairs, .pair = pair };
  pw_block_ldl *l = order_choose (&x);
  free (x.memory);
  return l;
}

void pw_block_close (pw_block_ldl *l) {
  if (l == NULL) return;
  free (l->cursor);
  free (l->target);
  free (l->value);
  free (l->pattern);
  free (l->memory);
  free (l);
}
