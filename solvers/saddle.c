/* The saddle-point system, condensed to the constraint rows.
 *
 *   S lambda = J W^-1 f - gamma,  S = J W^-1 J^T,     a = W^-1 (f - J^T lambda)
 *
 * (Golub & Greif 2003, On solving block-structured indefinite linear systems.)  Rows that share no coordinate with
 * weight do not meet in S, so S has the pattern of the mechanism: a chain is block tridiagonal.  Coordinates without
 * weight are eliminated before, in reduce.c.  A node of the factorisation is a run of up to 3 rows of one element. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "saddle.h"
#include "reduce.h"
#include "ldl.h"
#include "util.h"

/* Columns of a node: a body's three or an element's own one. */
typedef struct {
  const double *J; /* first row, first column */
  int stride;      /* from row to row */
  int j;           /* global coordinate */
  int width;
} saddle_piece;

typedef struct {
  int size;      /* rows */
  int first;     /* first piece */
  int position;  /* in the right-hand side of the factorisation */
  int row;       /* first global row, or -1: a row of a component */
  double *gamma; /* a component's: where gamma~ and lambda~ are kept */
  double *lambda;
} saddle_node;

/* One term of S: block (a, b) += J_a W^-1 J_b^T over the columns of one group. */
typedef struct {
  const double *A, *B;
  double *to;
  int j, stride_a, stride_b;
  signed char a, b, width; /* rows of A and of B, columns */
} saddle_term;

struct pw_saddle {
  pw_system *s;
  int nodes, rows, terms, unknowns;
  double *inverse;   /* coords + 3: 1 / weight; 0 for held ones and those without weight; the ground's 0 */
  double *force;     /* coords + 3 */
  double *y;         /* unknowns */
  saddle_node *node; /* nodes + 1 */
  saddle_piece *piece;
  saddle_term *term;
  pw_reduce reduce;
  pw_ldl *ldl;
  double pivot; /* squared, of the last factorisation */
  int pivot_row;
  double *zero; /* coords: a force of nothing */
  char *memory;
};

/* ---- Nodes ---- */

/* Collects nodes and pieces; with node NULL it only counts. */
typedef struct {
  saddle_node *node;
  saddle_piece *piece;
  int nodes, pieces;
} saddle_list;

static void saddle_add_piece (const pw_saddle *k, saddle_list *l, const double *J, int stride, int j, int width) {
  int weight = 0;
  for (int n = 0; n < width; n++) weight |= k->inverse[j + n] > 0;
  if (!weight) return;
  if (l->piece) l->piece[l->pieces] = (saddle_piece){ J, stride, j, width };
  l->pieces++;
}

static void saddle_element_node (const pw_saddle *k, saddle_list *l, const pw_slab *b, int e, int r, int size) {
  const pw_kind *kind = b->kind;
  const double *J = b->J + (e * kind->rows + r) * b->b.cols;
  if (l->node)
    l->node[l->nodes] = (saddle_node){ .size = size, .first = l->pieces, .row = b->row + e * kind->rows + r };
  l->nodes++;
  for (int n = 0; n < kind->bodies; n++) {
    int j = b->column[e * kind->bodies + n];
    if (j < k->s->coords) saddle_add_piece (k, l, J + 3 * n, b->b.cols, j, 3);
  }
  for (int n = 0; n < kind->own; n++)
    saddle_add_piece (k, l, J + 3 * kind->bodies + n, b->b.cols, b->own + e * kind->own + n, 1);
}

/* Runs of active rows of elements without massless coordinates around. */
static void saddle_element_nodes (const pw_saddle *k, saddle_list *l, int rows, const unsigned char *active) {
  const pw_system *s = k->s;
  for (const pw_slab *b = s->slab; b < s->slab + s->slabs && b->kind->rows > 0 && b->row < rows; b++)
    for (int e = 0; e < b->b.count; e++) {
      int i = b->row + e * b->kind->rows, r = 0;
      while (r < b->kind->rows) {
        int size = 0;
        while (r + size < b->kind->rows && size < PW_LDL_NODE && (active == NULL || active[i + r + size]) &&
               k->reduce.component_of_row[i + r + size] < 0)
          size++;
        if (size > 0) saddle_element_node (k, l, b, e, r, size);
        r += size > 0 ? size : 1;
      }
    }
}

/* The rows of a component that are not pivots. */
static void saddle_component_nodes (const pw_saddle *k, saddle_list *l) {
  for (int n = 0; n < k->reduce.components; n++) {
    pw_component *c = &k->reduce.component[n];
    for (int i = c->pivots; i < c->rows; i++) {
      if (l->node)
        l->node[l->nodes] =
            (saddle_node){ .size = 1, .first = l->pieces, .row = -1, .gamma = c->gamma + i, .lambda = c->lambda + i };
      l->nodes++;
      for (int g = 0; g < c->groups; g++)
        saddle_add_piece (k, l, c->Z + i * c->cols + c->group_column[g], c->cols, c->group[g],
                          c->group[g] < 3 * k->s->bodies ? 3 : 1);
    }
  }
}

static void saddle_nodes (const pw_saddle *k, saddle_list *l, int rows, const unsigned char *active) {
  saddle_element_nodes (k, l, rows, active);
  saddle_component_nodes (k, l);
  if (l->node) l->node[l->nodes].first = l->pieces;
}

/* ---- Terms: which pieces meet in a group ---- */

/* Pieces sorted by their group: first[j] .. first[j + 1] of list, with the node of each piece. */
typedef struct {
  int *first, *list, *node;
} saddle_meeting;

static int saddle_meet (const pw_saddle *k, int pieces, saddle_meeting *m) {
  m->first = calloc ((size_t)k->s->coords + 2, sizeof (int));
  m->list = malloc (((size_t)pieces + 1) * sizeof (int));
  m->node = malloc (((size_t)pieces + 1) * sizeof (int));
  if (m->first == NULL || m->list == NULL || m->node == NULL) return PW_MACHINE;
  for (int p = 0; p < pieces; p++) m->first[k->piece[p].j + 2]++;
  for (int j = 0; j < k->s->coords; j++) m->first[j + 2] += m->first[j + 1];
  for (int n = 0; n < k->nodes; n++)
    for (int p = k->node[n].first; p < k->node[n + 1].first; p++) {
      m->node[p] = n;
      m->list[m->first[k->piece[p].j + 1]++] = p;
    }
  return PW_OK;
}

static void saddle_meeting_close (saddle_meeting *m) {
  free (m->first);
  free (m->list);
  free (m->node);
}

/* Every pair of pieces that meet, each unordered pair once; `pair` takes their nodes, `terms` the terms of S. */
static long saddle_pairs (const pw_saddle *k, const saddle_meeting *m, int *pair, saddle_term *terms) {
  long count = 0;
  size_t values;
  for (int j = 0; j < k->s->coords; j++)
    for (int x = m->first[j]; x < m->first[j + 1]; x++)
      for (int y = m->first[j]; y <= x; y++, count++) {
        int a = m->list[x], b = m->list[y];
        if (pair) pair[2 * count] = m->node[a], pair[2 * count + 1] = m->node[b];
        if (terms == NULL) continue;
        int transposed;
        size_t at = pw_ldl_block (k->ldl, m->node[a], m->node[b], &transposed);
        const saddle_piece *A = &k->piece[transposed ? b : a], *B = &k->piece[transposed ? a : b];
        terms[count] = (saddle_term){ .A = A->J,
                                      .B = B->J,
                                      .to = pw_ldl_values (k->ldl, &values) + at,
                                      .j = j,
                                      .stride_a = A->stride,
                                      .stride_b = B->stride,
                                      .width = (signed char)A->width,
                                      .a = (signed char)k->node[m->node[transposed ? b : a]].size,
                                      .b = (signed char)k->node[m->node[transposed ? a : b]].size };
      }
  return count;
}

static int saddle_terms (pw_saddle *k, int pieces, pw_error *error) {
  saddle_meeting m = { NULL, NULL, NULL };
  int status = saddle_meet (k, pieces, &m), *pair = NULL, *size = malloc (((size_t)k->nodes + 1) * sizeof *size);
  if (status == PW_OK) {
    long terms = saddle_pairs (k, &m, NULL, NULL);
    k->terms = (int)terms;
    pair = malloc ((size_t)(2 * terms + 1) * sizeof *pair);
    k->term = malloc ((size_t)(terms + 1) * sizeof *k->term);
    status = pair && size && k->term ? PW_OK : PW_MACHINE;
  }
  if (status == PW_OK) {
    for (int n = 0; n < k->nodes; n++) size[n] = k->node[n].size;
    saddle_pairs (k, &m, pair, NULL);
    k->ldl = pw_ldl_open (k->nodes, size, k->terms, pair, error);
    status = k->ldl ? PW_OK : PW_MACHINE;
  }
  if (status == PW_OK) {
    saddle_pairs (k, &m, NULL, k->term);
    for (int n = 0; n < k->nodes; n++) k->node[n].position = pw_ldl_position (k->ldl, n);
  }
  saddle_meeting_close (&m);
  free (pair);
  free (size);
  return status;
}

/* ---- Opening ---- */

static int saddle_allocate (pw_saddle *k, const double *weight, int rows, const unsigned char *active, int *pieces) {
  saddle_list count = { 0 }, fill = { 0 };
  size_t n = (size_t)k->s->coords;
  k->inverse = calloc (3 * n + 6, sizeof *k->inverse);
  if (k->inverse == NULL) return PW_MACHINE;
  k->force = k->inverse + n + 3;
  k->zero = k->force + n + 3;
  for (size_t j = 0; j < n; j++) k->inverse[j] = weight[j] > 0 ? 1 / weight[j] : 0;
  saddle_nodes (k, &count, rows, active);
  pw_layout l = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    k->node = pw_take (&l, (size_t)count.nodes + 1, sizeof *k->node);
    k->piece = pw_take (&l, (size_t)count.pieces, sizeof *k->piece);
    k->y = pw_take (&l, (size_t)(PW_LDL_NODE * count.nodes), sizeof *k->y);
    if (pass == 1) break;
    k->memory = malloc (l.used);
    if (k->memory == NULL) return PW_MACHINE;
    l = (pw_layout){ k->memory, 0 };
  }
  fill.node = k->node;
  fill.piece = k->piece;
  saddle_nodes (k, &fill, rows, active);
  k->nodes = fill.nodes;
  k->rows = rows;
  *pieces = fill.pieces;
  return PW_OK;
}

pw_saddle *pw_saddle_open (pw_system *s, const double *weight, int rows, const unsigned char *active, pw_error *error) {
  int pieces = 0, status = PW_MACHINE;
  pw_saddle *k = calloc (1, sizeof *k);
  if (k) {
    k->s = s;
    status = pw_reduce_open (&k->reduce, s, weight, rows, active, error);
    if (status == PW_OK) status = saddle_allocate (k, weight, rows, active, &pieces);
    if (status == PW_OK) status = saddle_terms (k, pieces, error);
  }
  if (status == PW_OK) return k;
  pw_saddle_close (k);
  pw_fail (error, status, "model %s: out of memory", s->model);
  return NULL;
}

void pw_saddle_close (pw_saddle *k) {
  if (k == NULL) return;
  pw_reduce_close (&k->reduce);
  pw_ldl_close (k->ldl);
  free (k->inverse);
  free (k->term);
  free (k->memory);
  free (k);
}

/* ---- Numbers ---- */

static inline void saddle_add_term (const saddle_term *t, const double *inverse, int a, int b, int width) {
  for (int x = 0; x < a; x++)
    for (int y = 0; y < b; y++) {
      double sum = 0;
      for (int n = 0; n < width; n++) sum += t->A[x * t->stride_a + n] * inverse[n] * t->B[y * t->stride_b + n];
      t->to[x * b + y] += sum;
    }
}

/* A row whose coordinates are all held, or all belong to the ground, leaves an empty diagonal: singular. */
int pw_saddle_factor (pw_saddle *k) {
  size_t count;
  double *value = pw_ldl_values (k->ldl, &count);
  int node;
  k->pivot_row = -1;
  k->pivot = k->reduce.components ? pw_reduce_factor (&k->reduce) : INFINITY;
  memset (value, 0, count * sizeof *value);
  for (const saddle_term *t = k->term; t < k->term + k->terms; t++) {
    const double *inverse = k->inverse + t->j;
    if (t->width == 3 && t->a == 2 && t->b == 2)
      saddle_add_term (t, inverse, 2, 2, 3);
    else if (t->width == 3 && t->a == 1 && t->b == 1)
      saddle_add_term (t, inverse, 1, 1, 3);
    else
      saddle_add_term (t, inverse, t->a, t->b, t->width);
  }
  double pivot = pw_ldl_factor (k->ldl, &node);
  if (!(pivot >= k->pivot)) {
    k->pivot = pivot;
    k->pivot_row = node >= 0 ? k->node[node].row : -1;
  }
  return k->pivot > 1e-28 ? PW_OK : PW_RETRY;
}

double pw_saddle_pivot (const pw_saddle *k, int *row) {
  *row = k->pivot_row;
  return k->pivot > 0 ? sqrt (fmin (k->pivot, 1)) : 0;
}

/* y = J W^-1 f - gamma for every node. */
static void saddle_gather (pw_saddle *k, const double *f, const double *gamma) {
  for (const saddle_node *n = k->node; n < k->node + k->nodes; n++) {
    const double *right = n->row >= 0 ? gamma + n->row : n->gamma;
    for (int x = 0; x < n->size; x++) {
      double sum = -right[x];
      for (const saddle_piece *p = k->piece + n->first; p < k->piece + (n + 1)->first; p++)
        for (int i = 0; i < p->width; i++) sum += p->J[x * p->stride + i] * k->inverse[p->j + i] * f[p->j + i];
      k->y[n->position + x] = sum;
    }
  }
}

/* f -= J^T lambda, and lambda out of y. */
static void saddle_scatter (pw_saddle *k, double *f, double *lambda) {
  for (const saddle_node *n = k->node; n < k->node + k->nodes; n++) {
    const double *y = k->y + n->position;
    double *to = n->row >= 0 ? lambda + n->row : n->lambda;
    for (int x = 0; x < n->size; x++) to[x] = y[x];
    for (const saddle_piece *p = k->piece + n->first; p < k->piece + (n + 1)->first; p++)
      for (int x = 0; x < n->size; x++)
        for (int i = 0; i < p->width; i++) f[p->j + i] -= p->J[x * p->stride + i] * y[x];
  }
}

void pw_saddle_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda) {
  size_t coords = (size_t)k->s->coords;
  memcpy (k->force, f ? f : k->zero, coords * sizeof *k->force);
  memset (lambda, 0, (size_t)k->rows * sizeof *lambda);
  if (k->reduce.components) pw_reduce_forward (&k->reduce, gamma, k->force);
  saddle_gather (k, k->force, gamma);
  pw_ldl_solve (k->ldl, k->y);
  saddle_scatter (k, k->force, lambda);
  for (size_t j = 0; j < coords; j++) a[j] = k->inverse[j] * k->force[j];
  if (k->reduce.components) pw_reduce_backward (&k->reduce, a, lambda);
}
