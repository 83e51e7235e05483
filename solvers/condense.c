/* Planning of the condensed matrix; see condense.h. */
#include <stdlib.h>
#include <string.h>
#include "condense.h"
#include "util.h"

enum { CONDENSE_SMALL_COORDS = 36 }; /* beyond, rows rarely share a body and S is better kept sparse */

/* Columns of a node. */
typedef struct {
  const double *J;
  int step, j, width;
} condense_piece;

typedef struct {
  int size, first; /* rows, first piece */
  int row;         /* first global row, or -1: a row of a component */
  double *gamma, *lambda;
} condense_node;

/* Nodes and pieces; while the arrays are NULL they are only counted. */
typedef struct {
  struct pw_saddle *k;
  condense_node *node; /* nodes + 1 */
  condense_piece *piece;
  int *node_of;        /* pieces */
  int nodes, pieces;
  int *start, *list;   /* pieces by coordinate: list[start[j]] .. list[start[j + 1]] */
  long terms;
  int panels;          /* of a small scene */
  int place[PW_SMALL]; /* first position of each node in a small scene */
} condense;

/* ---- Nodes ---- */

static void condense_add_piece (condense *c, const double *J, int step, int j, int width) {
  int weight = 0;
  for (int n = 0; n < width; n++) weight |= c->k->inverse[j + n] > 0;
  if (!weight) return;
  if (c->piece) {
    c->piece[c->pieces] = (condense_piece){ J, step, j, width };
    c->node_of[c->pieces] = c->nodes;
  }
  c->pieces++;
}

static void condense_element (condense *c, const pw_slab *b, int e, int r, int size) {
  const pw_kind *kind = b->kind;
  const double *J = b->J + (e * kind->rows + r) * b->b.cols;
  if (c->node) c->node[c->nodes] = (condense_node){ .size = size, .first = c->pieces, .row = b->row + e * kind->rows + r };
  for (int n = 0; n < kind->bodies; n++) {
    int j = b->column[e * kind->bodies + n];
    if (j < c->k->s->coords) condense_add_piece (c, J + 3 * n, b->b.cols, j, 3);
  }
  for (int n = 0; n < kind->own; n++) condense_add_piece (c, J + 3 * kind->bodies + n, b->b.cols, b->own + e * kind->own + n, 1);
  c->nodes++;
}

/* Runs of active rows of elements without massless coordinates around. */
static void condense_elements (condense *c, int rows, const unsigned char *active) {
  const pw_system *s = c->k->s;
  const int *component = c->k->reduce.component_of_row;
  for (const pw_slab *b = s->slab; b < s->slab + s->slabs && b->kind->rows > 0 && b->row < rows; b++)
    for (int e = 0; e < b->b.count; e++) {
      int i = b->row + e * b->kind->rows, r = 0;
      while (r < b->kind->rows) {
        int size = 0;
        while (r + size < b->kind->rows && size < PW_LDL_NODE && (active == NULL || active[i + r + size]) && component[i + r + size] < 0) size++;
        if (size > 0) condense_element (c, b, e, r, size);
        r += size > 0 ? size : 1;
      }
    }
}

/* The rows of a component that are not pivots. */
static void condense_components (condense *c) {
  for (int n = 0; n < c->k->reduce.components; n++) {
    pw_component *p = &c->k->reduce.component[n];
    for (int i = p->pivots; i < p->rows; i++) {
      if (c->node) c->node[c->nodes] = (condense_node){ .size = 1, .first = c->pieces, .row = -1, .gamma = p->gamma + i, .lambda = p->lambda + i };
      for (int g = 0; g < p->groups; g++)
        condense_add_piece (c, p->Z + i * p->cols + p->group_column[g], p->cols, p->group[g], p->group[g] < 3 * c->k->s->bodies ? 3 : 1);
      c->nodes++;
    }
  }
}

static void condense_nodes (condense *c, int rows, const unsigned char *active) {
  c->nodes = c->pieces = 0;
  condense_elements (c, rows, active);
  condense_components (c);
  if (c->node) c->node[c->nodes].first = c->pieces;
}

static int condense_sort_pieces (condense *c) {
  int coords = c->k->s->coords;
  c->start = calloc ((size_t)coords + 2, sizeof (int));
  c->list = malloc (((size_t)c->pieces + 1) * sizeof (int));
  if (c->start == NULL || c->list == NULL) return PW_MACHINE;
  for (int p = 0; p < c->pieces; p++) c->start[c->piece[p].j + 2]++;
  for (int j = 0; j < coords; j++) c->start[j + 2] += c->start[j + 1];
  for (int p = 0; p < c->pieces; p++) c->list[c->start[c->piece[p].j + 1]++] = p;
  return PW_OK;
}

/* ---- Factorisation pattern ---- */

/* Calls for every pair of pieces in the same columns, each unordered pair once. */
typedef void condense_visit (condense *c, int a, int b, void *context);

static void condense_each_pair (condense *c, condense_visit *visit, void *context) {
  for (int j = 0; j < c->k->s->coords; j++)
    for (int x = c->start[j]; x < c->start[j + 1]; x++)
      for (int y = c->start[j]; y <= x; y++) visit (c, c->list[x], c->list[y], context);
}

static void condense_note_pair (condense *c, int a, int b, void *context) {
  int *pair = context;
  if (pair) {
    pair[2 * c->terms] = c->node_of[a];
    pair[2 * c->terms + 1] = c->node_of[b];
  }
  c->terms++;
}

static int condense_pattern (condense *c, pw_error *error) {
  condense_each_pair (c, condense_note_pair, NULL);
  int *pair = malloc ((size_t)(2 * c->terms + 1) * sizeof *pair), *size = malloc (((size_t)c->nodes + 1) * sizeof *size);
  if (pair && size) {
    c->terms = 0;
    condense_each_pair (c, condense_note_pair, pair);
    for (int n = 0; n < c->nodes; n++) size[n] = c->node[n].size;
    c->k->ldl = pw_ldl_open (c->nodes, size, c->terms, pair, error);
  }
  free (pair);
  free (size);
  if (c->k->ldl == NULL) return PW_MACHINE;
  c->k->value = pw_ldl_values (c->k->ldl, &c->k->values);
  return PW_OK;
}

/* ---- Terms ---- */

/* 1 if the short form can tell where J is, how wide it is and how many rows there are. */
static int condense_is_short (const condense *c, int p) {
  const condense_node *n = &c->node[c->node_of[p]];
  return n->row >= 0 && n->size <= 2 && c->piece[p].width == 3;
}

static pw_term_shape condense_shape (const condense *c, int a, int b) {
  int rows_a = c->node[c->node_of[a]].size, rows_b = c->node[c->node_of[b]].size;
  if (a == b) return rows_a == 1 ? PW_TERM_D1 : PW_TERM_D2;
  return rows_a == 1 ? (rows_b == 1 ? PW_TERM_11 : PW_TERM_12) : (rows_b == 1 ? PW_TERM_21 : PW_TERM_22);
}

static int condense_offset (const condense *c, const double *J) {
  return (int)(J - c->k->base);
}

/* Where the next term of each shape goes; with `fill` 0 they are only counted. */
typedef struct {
  int fill, next[PW_TERM_SHAPES], wides;
} condense_filling;

static void condense_put_term (condense *c, int a, int b, void *context) {
  condense_filling *to = context;
  struct pw_saddle *k = c->k;  int is_short = condense_is_short (c, a) && condense_is_short (c, b);
  pw_ldl_place at = pw_ldl_block (k->ldl, c->node_of[a], c->node_of[b]);
  if (at.transposed) {
    int swap = a;
    a = b;
    b = swap;
  }
  const condense_piece *A = &c->piece[a], *B = &c->piece[b];
  int *next = is_short ? &to->next[condense_shape (c, a, b)] : &to->wides;
  if (to->fill && is_short)
    k->term[*next] = (pw_term){ condense_offset (c, A->J), condense_offset (c, B->J), at.offset, A->j, (short)A->step, (short)B->step, at.step };
  if (to->fill && !is_short)
    k->wide[*next] = (pw_wide_term){ A->J, B->J, at.offset, A->j, A->step, B->step, at.step,  (signed char)c->node[c->node_of[a]].size,
                                     (signed char)c->node[c->node_of[b]].size, (signed char)A->width };
  ++*next;
}

/* ---- Layout ---- */

static void condense_take (condense *c, pw_layout *l) {
  struct pw_saddle *k = c->k;
  k->y = pw_take (l, (size_t)(k->unknowns + (c->panels > 0 ? k->s->rows + k->extras : 0)), sizeof *k->y);
  k->row_of = pw_take (l, (size_t)k->unknowns, sizeof *k->row_of);
  k->term = pw_take (l, (size_t)k->first[PW_TERM_SHAPES], sizeof *k->term);
  k->wide = pw_take (l, (size_t)k->wides, sizeof *k->wide);
  k->piece = pw_take (l, (size_t)k->pieces, sizeof *k->piece);
  k->wide_piece = pw_take (l, (size_t)k->wide_pieces, sizeof *k->wide_piece);
  k->extra = pw_take (l, (size_t)k->extras, sizeof *k->extra);
  k->idle = pw_take (l, (size_t)k->idles, sizeof *k->idle);  k->row_of_node = pw_take (l, (size_t)c->nodes, sizeof *k->row_of_node);
  pw_small *small = pw_take (l, c->panels > 0, sizeof *small);
  pw_panel *panel = pw_take (l, (size_t)c->panels, sizeof *panel);
  if (l->base == NULL || c->panels == 0) return;
  *small = (pw_small){ .n = k->unknowns, .panel = panel, .end = panel, .inverse = k->inverse, .guard = k->guard };
  k->small = small;
  k->plain = k->reduce.components == 0 && k->idles == 0 ? small : NULL;
}

static void condense_count (condense *c, int rows, const unsigned char *active, condense_filling *count) {
  struct pw_saddle *k = c->k;
  condense_each_pair (c, condense_put_term, count);
  for (int shape = 0; shape < PW_TERM_SHAPES; shape++) k->first[shape + 1] = k->first[shape] + count->next[shape];
  k->wides = count->wides;
  for (int p = 0; p < c->pieces; p++) {
    int is_short = condense_is_short (c, p);
    k->pieces1 += is_short && c->node[c->node_of[p]].size == 1;
    k->pieces += is_short;
    k->wide_pieces += !is_short;
  }
  for (int n = 0; n < c->nodes; n++) {
    k->unknowns += c->node[n].size;
    k->extras += c->node[n].row < 0;
  }  for (int i = 0; i < rows; i++) k->idles += active && !active[i];
  if (k->unknowns > PW_SMALL || k->s->coords > CONDENSE_SMALL_COORDS) return;
  c->panels = k->s->bodies + k->s->coords - 3 * k->s->bodies;
  k->first[PW_TERM_SHAPES] = k->wides = k->pieces = k->pieces1 = k->wide_pieces = 0;
}

static void condense_fill_pieces (condense *c) {
  struct pw_saddle *k = c->k;
  int next[2] = { 0, k->pieces1 }, wide = 0;
  for (int p = 0; p < c->pieces; p++) {
    const condense_piece *x = &c->piece[p];
    int node = c->node_of[p], size = c->node[node].size, y = pw_ldl_position (k->ldl, node);
    if (condense_is_short (c, p))
      k->piece[next[size - 1]++] = (pw_piece){ condense_offset (c, x->J), x->j, y, x->step };
    else
      k->wide_piece[wide++] = (pw_wide_piece){ x->J, x->j, y, x->step, (signed char)size, (signed char)x->width };
  }
}

/* First position of a node on the right-hand side. */
static int condense_position (const condense *c, int node) {
  return c->panels > 0 ? c->place[node] : pw_ldl_position (c->k->ldl, node);
}

static void condense_fill_rows (condense *c, int rows, const unsigned char *active) {
  struct pw_saddle *k = c->k;
  int extra = 0, idle = 0;
  for (int n = 0; n < c->nodes; n++) {
    int y = condense_position (c, n);
    k->row_of_node[n] = c->node[n].row;
    for (int r = 0; r < c->node[n].size; r++) k->row_of[y + r] = c->node[n].row < 0 ? -1 : c->node[n].row + r;
    if (c->node[n].row < 0) k->extra[extra++] = (pw_extra){ y, c->node[n].gamma, c->node[n].lambda };
  }
  for (int i = 0; i < rows; i++)
    if (active && !active[i]) k->idle[idle++] = i;
}

/* Puts the nodes of a small scene in an order in which those of a panel are neighbours. */
static void condense_order_small (condense *c) {
  unsigned long long touched[PW_SMALL] = { 0 };
  int order[PW_SMALL], y = 0, bodies = c->k->s->bodies;
  for (int p = 0; p < c->pieces; p++) {
    int j = c->piece[p].j;
    touched[c->node_of[p]] |= 1ULL << (j < 3 * bodies ? j / 3 : j - 2 * bodies);
  }
  pw_small_order (c->nodes, touched, order);
  for (int i = 0; i < c->nodes; i++) {
    c->place[order[i]] = y;
    y += c->node[order[i]].size;
  }
}

/* Coordinates that are all without weight need no panel: their accelerations are found elsewhere. */
static void condense_fill_panels (condense *c, const double *weight) {
  struct pw_saddle *k = c->k;
  int bodies = k->s->bodies;
  for (int n = 0; n < c->panels; n++) {
    int j = n < bodies ? 3 * n : n + 2 * bodies, width = n < bodies ? 3 : 1, heavy = 0;
    for (int i = 0; i < width; i++) heavy |= weight[j + i] != 0;
    if (!heavy) continue;
    pw_panel *p = k->small->end++;
    *p = (pw_panel){ .j = j, .width = width };
    for (int x = c->start[j]; x < c->start[j + 1]; x++) {
      const condense_piece *piece = &c->piece[c->list[x]];
      int node = c->node_of[c->list[x]];
      pw_small_add_rows (p, condense_position (c, node), c->node[node].size, piece->J, piece->step);
    }
  }
  for (int n = 0; n < c->nodes; n++)
    for (int r = 0; r < c->node[n].size && c->node[n].first == c->node[n + 1].first; r++)
      k->small->start[c->place[n] + r] = 1;
  for (int i = 0; i < k->unknowns; i++) k->small->row[i] = k->row_of[i];
  for (int e = 0; e < k->extras; e++) k->small->row[k->extra[e].y] = k->s->rows + e;
}

static int condense_lay_out (condense *c, const double *weight, int rows, const unsigned char *active) {
  struct pw_saddle *k = c->k;
  condense_filling count = { 0 }, fill = { .fill = 1 };
  condense_count (c, rows, active, &count);
  pw_layout l = { NULL, 0 };
  condense_take (c, &l);
  k->memory = malloc (l.used + 1);
  if (k->memory == NULL) return PW_MACHINE;
  l = (pw_layout){ k->memory, 0 };
  condense_take (c, &l);
  if (c->panels > 0) condense_order_small (c);
  condense_fill_rows (c, rows, active);
  if (c->panels > 0) {
    condense_fill_panels (c, weight);
    return PW_OK;
  }
  memcpy (fill.next, k->first, sizeof fill.next);
  condense_each_pair (c, condense_put_term, &fill);
  condense_fill_pieces (c);
return PW_OK;
}

/* ---- */

static int condense_allocate (condense *c, int rows, const unsigned char *active) {
  condense_nodes (c, rows, active);
  condense_node *node = malloc (((size_t)c->nodes + 1) * sizeof *node);
  c->piece = malloc (((size_t)c->pieces + 1) * sizeof *c->piece);
  c->node_of = malloc (((size_t)c->pieces + 1) * sizeof *c->node_of);
  c->node = node;
  if (c->node == NULL || c->piece == NULL || c->node_of == NULL) return PW_MACHINE;
  condense_nodes (c, rows, active);
  return PW_OK;
}

int pw_condense (struct pw_saddle *k, const double *weight, int rows, const unsigned char *active, pw_error *error) {
  condense c = { .k = k };
  size_t n = (size_t)k->s->coords + 3;
  k->rows = rows;
  k->base = (const double *)(const void *)k->s;
  k->inverse = calloc (3 * n, sizeof *k->inverse);
  if (k->inverse == NULL) return PW_MACHINE;
  k->force = k->inverse + n;
  k->z = k->force + n;
  for (int j = 0; j < k->s->coords; j++) k->inverse[j] = weight[j] > 0 ? 1 / weight[j] : 0;
  int status = condense_allocate (&c, rows, active);
  if (status == PW_OK) status = condense_sort_pieces (&c);
  if (status == PW_OK) status = condense_pattern (&c, error);
  if (status == PW_OK) status = condense_lay_out (&c, weight, rows, active);
  free (c.node);
  free (c.piece);
  free (c.node_of);
  free (c.start);
  free (c.list);
  return status;
}
