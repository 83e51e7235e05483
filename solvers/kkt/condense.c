/* Planning of the condensed matrix; see condense.h. */
#include <stdlib.h>
#include "condense.h"
#include "util.h"

enum { CONDENSE_SMALL_COORDS = 36 }; /* beyond, rows rarely share a body and S is better kept sparse */

/* ---- Nodes ---- */

static void condense_add_piece (pw_plan *c, const double *J, int step, int j, int width, int unit) {
  int weight = 0;
  for (int n = 0; n < width; n++) weight |= c->k->inverse[j + n] > 0;
  if (!weight) return;
  if (c->piece) {
    c->piece[c->pieces] = (pw_plan_piece){ J, step, j, width, unit };
    c->node_of[c->pieces] = c->nodes;
  }
  c->pieces++;
}

static void condense_element (pw_plan *c, const pw_slab *b, int e, int r, int size) {
  const pw_kind *kind = b->kind;
  const double *J = b->J + (e * kind->rows + r) * b->b.cols;
  int i = b->row + e * kind->rows + r;
  if (c->node) c->node[c->nodes] = (pw_plan_node){ .size = size, .row = i, .y = i };
  for (int n = 0; n < kind->bodies; n++) {
    int j = b->column[e * kind->bodies + n];
    if (j < c->k->s->coords) condense_add_piece (c, J + 3 * n, b->b.cols, j, 3, kind->unit && size == 2);
  }
  for (int n = 0; n < kind->own; n++)
    condense_add_piece (c, J + 3 * kind->bodies + n, b->b.cols, b->own + e * kind->own + n, 1, 0);
  c->nodes++;
}

/* How many rows of an element make a node.  A coordinate without mass has a small weight in the metric of positions; then a
 * block is badly conditioned, and of 3 rows its explicit inverse is not good enough. */
static int condense_longest (const pw_plan *c, const pw_slab *b, int e) {
  for (int n = 0; n < b->kind->bodies; n++) {
    int j = b->column[e * b->kind->bodies + n];
    for (int i = j; i < j + 3 && j < c->k->s->coords; i++)
      if (c->k->s->mass[i] == 0 && c->k->inverse[i] > 0) return 2;
  }
  return PW_LDL_NODE;
}

/* 1 for a row that stands for itself: not left out, not a component's, and not one that only held coordinates enter, which
 * says nothing of the others. */
static int condense_takes_part (const pw_plan *c, const pw_slab *b, int e, int r, const unsigned char *active) {
  const double *J = b->J + (e * b->kind->rows + r) * b->b.cols, *inverse = c->k->inverse;
  int i = b->row + e * b->kind->rows + r, held = 0;
  if ((active && !active[i]) || c->k->reduce.component_of_row[i] >= 0) return 0;
  for (int n = 0; n < b->b.cols; n++) {
    int j = pw_global (b, e, n);
    if (j < c->k->s->coords && inverse[j] > 0 && J[n] != 0) return 1;
    held |= j < c->k->s->coords && inverse[j] == 0;
  }
  return !held;
}

/* Runs of such rows of an element. */
static void condense_elements (pw_plan *c, int rows, const unsigned char *active) {
  const pw_system *s = c->k->s;
  for (const pw_slab *b = s->slab; b < s->slab + s->slabs && b->kind->rows > 0 && b->row < rows; b++)
    for (int e = 0; e < b->b.count; e++) {
      int longest = condense_longest (c, b, e), r = 0;
      while (r < b->kind->rows) {
        int size = 0;
        while (r + size < b->kind->rows && size < longest && condense_takes_part (c, b, e, r + size, active)) size++;
        if (size > 0) condense_element (c, b, e, r, size);
        r += size > 0 ? size : 1;
      }
    }
}

/* The rows of a component that are not pivots; a multiplier of one that touches nothing stays 0. */
static void condense_components (pw_plan *c) {
  int extra = 0;
  for (int n = 0; n < c->k->reduce.components; n++) {
    pw_component *p = &c->k->reduce.component[n];
    for (int i = p->pivots; i < p->rows; i++) {
      int pieces = c->pieces;
      for (int g = 0; g < p->groups; g++)
        condense_add_piece (c, p->Z + i * p->cols + p->group_column[g], p->cols, p->group[g],
                            p->group[g] < 3 * c->k->s->bodies ? 3 : 1, 0);
      if (c->pieces == pieces) continue;
      if (c->node)
        c->node[c->nodes] = (pw_plan_node){
          .size = 1, .row = PW_PLAN_EXTRA, .y = c->k->s->rows + extra++, .gamma = p->gamma + i, .lambda = p->lambda + i
        };
      c->nodes++;
    }
  }
}

static void condense_nodes (pw_plan *c, int rows, const unsigned char *active) {
  c->nodes = c->pieces = 0;
  condense_elements (c, rows, active);
  condense_components (c);
}

static int condense_sort_pieces (pw_plan *c) {
  int coords = c->k->s->coords;
  c->start = calloc ((size_t)coords + 2, sizeof (int));
  c->list = malloc (((size_t)c->pieces + 1) * sizeof (int));
  if (c->start == NULL || c->list == NULL) return PW_MACHINE;
  for (int p = 0; p < c->pieces; p++) c->start[c->piece[p].j + 2]++;
  for (int j = 0; j < coords; j++) c->start[j + 2] += c->start[j + 1];
  for (int p = 0; p < c->pieces; p++) c->list[c->start[c->piece[p].j + 1]++] = p;
  return PW_OK;
}

/* ---- Patches ---- */

static void condense_note_pair (pw_plan *c, int *pair, int a, int b) {
  if (pair) pair[2 * c->pairs] = a, pair[2 * c->pairs + 1] = b;
  c->pairs++;
}

/* Pairs of nodes that meet in a group, or with a kept body; only counted while `pair` is NULL. */
static void condense_pairs (pw_plan *c, int *pair) {
  c->pairs = 0;
  for (int n = 0; n < c->groups; n++) {
    int j = pw_plan_group (c, n), kept = pw_plan_kept (c, j);
    for (int x = c->start[j]; x < c->start[j + 1]; x++) {
      int a = c->node_of[c->list[x]];
      if (kept >= 0) condense_note_pair (c, pair, a, kept);
      for (int y = c->start[j]; y < x && kept < 0; y++) condense_note_pair (c, pair, a, c->node_of[c->list[y]]);
    }
  }
}

static pw_ldl *condense_pattern (pw_plan *c) {
  condense_pairs (c, NULL);
  int *pair = malloc ((size_t)(2 * c->pairs + 1) * sizeof *pair),
      *size = malloc ((3 * (size_t)c->nodes + 1) * sizeof *size);
  pw_ldl *ldl = NULL;
  if (pair && size) {
    int *y = size + c->nodes, *rank = y + c->nodes;
    condense_pairs (c, pair);
    for (int n = 0; n < c->nodes; n++) size[n] = c->node[n].size, y[n] = c->node[n].y, rank[n] = c->node[n].rank;
    ldl = pw_ldl_open (c->nodes, size, y, rank, c->pairs, pair);
  }
  free (pair);
  free (size);
  return ldl;
}

/* The pieces of a group in the order of their columns (few: by insertion). */
static void condense_sort_group (const pw_plan *c, const int *place, int j) {
  int *list = c->list + c->start[j], count = c->start[j + 1] - c->start[j];
  for (int x = 1; x < count; x++)
    for (int y = x; y > 0 && place[c->node_of[list[y - 1]]] > place[c->node_of[list[y]]]; y--) {
      int swap = list[y];
      list[y] = list[y - 1];
      list[y - 1] = swap;
    }
}

int pw_plan_column (const pw_plan *c, const pw_ldl *ldl, int j) {
  int column = ldl->nodes;
  for (int x = c->start[j]; x < c->start[j + 1]; x++) {
    int begun = c->begun[ldl->place[c->node_of[c->list[x]]]];
    if (begun < column) column = begun;
  }
  return column;
}

/* The groups that are in no chain in the order in which they are needed, those without a piece last. */
static int condense_sort_groups (pw_plan *c, const pw_ldl *ldl) {
  int nodes = ldl->nodes, *next = calloc ((size_t)nodes + 3, sizeof *next);
  c->begun = malloc (((size_t)nodes + 1) * sizeof *c->begun);
  c->group = malloc (((size_t)c->groups + 1) * sizeof *c->group);
  int status = next && c->begun && c->group ? PW_OK : PW_MACHINE;
  for (int j = nodes; j-- > 0 && status == PW_OK;) {
    c->begun[j] = j;
    for (int i = ldl->column[j].first; i < ldl->column[j + 1].first; i++) c->begun[ldl->below[i]] = j;
  }
  for (int n = 0; n < c->groups && status == PW_OK; n++)
    if (!c->is_linked[n]) next[pw_plan_column (c, ldl, pw_plan_group (c, n)) + 2]++;
  for (int p = 0; p <= nodes && status == PW_OK; p++) next[p + 2] += next[p + 1];
  for (int n = 0; n < c->groups && status == PW_OK; n++)
    if (!c->is_linked[n]) c->group[next[pw_plan_column (c, ldl, pw_plan_group (c, n)) + 1]++] = pw_plan_group (c, n);
  free (next);
  return status;
}

/* ---- Kept bodies ---- */

/* A body where more nodes meet is kept; its weights are to be finite. */
enum { CONDENSE_MEET = 8 };

static int condense_keeps (const pw_plan *c, int b) {
  const double *w = c->k->inverse + 3 * b;
  return c->start[3 * b + 1] - c->start[3 * b] > CONDENSE_MEET && w[0] > 0 && w[1] > 0 && w[2] > 0;
}

/* Rows that touch kept bodies only come after these. */
static void condense_rank (pw_plan *c) {
  for (int n = 0; n < c->nodes - c->keeps; n++) c->node[n].rank = 2;
  for (int p = 0; p < c->pieces; p++)
    if (pw_plan_kept (c, c->piece[p].j) < 0) c->node[c->node_of[p]].rank = 0;
}

/* Adds a node for every body that is kept. */
static int condense_keep (pw_plan *c) {
  int bodies = c->k->s->bodies;
  c->kept = malloc (((size_t)bodies + 1) * sizeof *c->kept);
  if (c->kept == NULL) return PW_MACHINE;
  for (int b = 0; b < bodies; b++) c->kept[b] = condense_keeps (c, b) ? c->nodes + c->keeps++ : -1;
  if (c->keeps == 0) return PW_OK;
  pw_plan_node *node = realloc (c->node, (size_t)(c->nodes + c->keeps) * sizeof *node);
  if (node == NULL) return PW_MACHINE;
  c->node = node;
  for (int h = 0; h < c->keeps; h++)
    node[c->nodes++] =
        (pw_plan_node){ .size = 3, .row = PW_PLAN_KEPT, .rank = 1, .y = c->k->s->rows + c->k->extras + 3 * h };
  condense_rank (c);
  return PW_OK;
}

static int condense_open_large (pw_plan *c) {
  pw_ldl *ldl = condense_pattern (c);
  for (int n = 0; ldl && n < c->groups; n++) condense_sort_group (c, ldl->place, pw_plan_group (c, n));
  int status = ldl ? pw_condense_chains (c, ldl) : PW_MACHINE;
  if (status == PW_OK) status = pw_ldl_lay_out (ldl);
  if (status == PW_OK) status = condense_sort_groups (c, ldl);
  if (status == PW_OK) return pw_condense_large (c, ldl);
  pw_ldl_close (ldl);
  return status;
}

static void condense_forget (pw_plan *c) {
  free (c->group);
  free (c->begun);
  free (c->chain);
  free (c->is_linked);
  c->group = c->begun = NULL;
  c->chain = NULL;
  c->is_linked = NULL;
}

/* The first node before the kept bodies with a pivot of nearly nothing, or -1. */
static int condense_find_dependent (const pw_plan *c) {
  const double follows = 1e-8; /* squared sine */
  pw_large *l = c->k->large;
  l->least = follows;
  pw_large_factor (l);
  l->least = 0;
  if (l->pivot > follows || l->row < 0) return -1;
  for (int n = 0; n < c->nodes; n++)
    if (c->node[n].rank == 0 && l->row >= c->node[n].y && l->row < c->node[n].y + c->node[n].size) return n;
  return -1;
}

/* Before its kept bodies, a row may follow from others: two legs of a platform that stands on the ground.  Such rows, as
 * the present pose shows them, come after the bodies, one by one; if they are many, all rows that touch these bodies do,
 * for what is left touches none. */
static int condense_try_large (pw_plan *c) {
  const int most = 12;
  for (int attempt = 0;; attempt++) {
    int status = condense_open_large (c), n = -1;
    if (status == PW_OK && c->keeps > 0 && attempt <= most) n = condense_find_dependent (c);
    if (n < 0) return status;
    c->node[n].rank = 2;
    for (int p = 0; p < c->pieces && attempt == most; p++)
      if (pw_plan_kept (c, c->piece[p].j) >= 0) c->node[c->node_of[p]].rank = 2;
    pw_large_close (c->k->large);
    c->k->large = NULL;
    condense_forget (c);
  }
}

/* ---- */

static pw_body_block *condense_take (const pw_plan *c, pw_layout *l, int is_small) {
  struct pw_saddle *k = c->k;
  k->force = pw_take (l, k->reduce.components ? (size_t)k->s->coords + 3 : 0, sizeof *k->force);
  k->y = pw_take (l, k->more ? (size_t)(k->s->rows + k->more) : 0, sizeof *k->y);
  k->extra = pw_take (l, (size_t)k->extras, sizeof *k->extra);
  k->idle = pw_take (l, (size_t)k->idles, sizeof *k->idle);
  k->small = is_small ? pw_take (l, 1, sizeof *k->small) : NULL;
  return is_small ? pw_take (l, (size_t)c->groups, sizeof (pw_body_block)) : NULL;
}

/* The rows that are not simply rows of the right-hand side; nodes come in the order of their rows. */
static void condense_fill_rows (pw_plan *c, int rows) {
  struct pw_saddle *k = c->k;
  int extra = 0, idle = 0, n = 0;
  for (int i = 0; i < rows; i++) {
    while (n < c->nodes && c->node[n].row >= 0 && c->node[n].row + c->node[n].size <= i) n++;
    int own = n < c->nodes && c->node[n].row >= 0 && c->node[n].row <= i;
    if (!own && k->reduce.component_of_row[i] < 0) k->idle[idle++] = i;
  }
  for (n = 0; n < c->nodes; n++)
    if (c->node[n].row == PW_PLAN_EXTRA)
      k->extra[extra++] = (pw_extra){ c->node[n].y, c->node[n].gamma, c->node[n].lambda };
}

/* 1 if most nodes are pins between bodies that are held by two pins alone: chains take less in the way of large scenes. */
static int condense_is_chain (const pw_plan *c) {
  unsigned char links[PW_SMALL] = { 0 };
  int inner = 0;
  for (int n = 0; n < c->k->s->bodies; n++) {
    const int *list = c->list + c->start[3 * n];
    if (c->start[3 * n + 1] - c->start[3 * n] != 2 || !c->piece[list[0]].unit || !c->piece[list[1]].unit) continue;
    for (int x = 0; x < 2; x++) inner += links[c->node_of[list[x]]]++;
  }
  return 2 * inner > c->nodes;
}

/* The condensed matrix is kept dense where few rows meet often. */
static int condense_is_small (const pw_plan *c) {
  const struct pw_saddle *k = c->k;
  if (k->unknowns > PW_SMALL_MOST || k->s->coords > CONDENSE_SMALL_COORDS) return 0;
  return k->unknowns <= PW_SMALL_UNROLLED || !condense_is_chain (c);
}

static int condense_lay_out (pw_plan *c, const double *weight, int rows) {
  struct pw_saddle *k = c->k;
  for (int n = 0; n < c->nodes; n++) {
    k->unknowns += c->node[n].size;
    k->extras += c->node[n].row == PW_PLAN_EXTRA;
  }
  for (int i = 0; i < rows; i++) k->idles += k->reduce.component_of_row[i] < 0;
  k->idles -= k->unknowns - k->extras;
  int is_small = condense_is_small (c);
  if (!is_small && condense_keep (c) != PW_OK) return PW_MACHINE;
  k->more = k->extras + 3 * c->keeps;
  pw_layout l = { NULL, 0 };
  condense_take (c, &l, is_small);
  k->memory = malloc (l.used + 1);
  if (k->memory == NULL) return PW_MACHINE;
  l = (pw_layout){ k->memory, 0 };
  pw_body_block *block = condense_take (c, &l, is_small);
  condense_fill_rows (c, rows);
  if (!is_small) return condense_try_large (c);
  pw_condense_small (c, weight, block);
  return PW_OK;
}

static int condense_allocate (pw_plan *c, int rows, const unsigned char *active) {
  condense_nodes (c, rows, active);
  pw_plan_node *node = malloc (((size_t)c->nodes + 1) * sizeof *node);
  c->piece = malloc (((size_t)c->pieces + 1) * sizeof *c->piece);
  c->node_of = malloc (((size_t)c->pieces + 1) * sizeof *c->node_of);
  c->node = node;
  if (c->node == NULL || c->piece == NULL || c->node_of == NULL) return PW_MACHINE;
  condense_nodes (c, rows, active);
  return PW_OK;
}

int pw_condense (struct pw_saddle *k, const double *weight, int rows, const unsigned char *active) {
  pw_plan c = { .k = k, .groups = k->s->coords - 2 * k->s->bodies };
  k->rows = rows;
  k->inverse = calloc ((size_t)k->s->coords + 3, sizeof *k->inverse);
  if (k->inverse == NULL) return PW_MACHINE;
  for (int j = 0; j < k->s->coords; j++) k->inverse[j] = weight[j] > 0 ? 1 / weight[j] : 0;
  int status = condense_allocate (&c, rows, active);
  if (status == PW_OK) status = condense_sort_pieces (&c);
  if (status == PW_OK) status = condense_lay_out (&c, weight, rows);
  free (c.node);
  free (c.piece);
  free (c.node_of);
  free (c.start);
  free (c.list);
  free (c.kept);
  condense_forget (&c);
  return status;
}
