/* The saddle-point system, condensed to the constraint equations; bodies at which many meet are not (block_ldl.h).
 *
 *   S lambda = J W^-1 f - gamma,  S = J W^-1 J^T,     a = W^-1 (f - J^T lambda)
 *
 * (Golub & Greif 2003, On solving block-structured indefinite linear systems.)  Equations that share no coordinate with
 * weight do not meet in S, so S has the pattern of the mechanism: a chain is block tridiagonal.
 *
 * Equations are grouped into nodes of 1 or 2 with the same columns.  A node contributes to a group of its coordinates
 * if at least one coordinate of that group has a finite weight other than 0.  An uncondensed body (block_ldl.h) adds
 * two nodes of its own, for -a_k.  Coupled, i.e. with a block in the matrix, are two nodes that contribute to the same
 * condensed group, and the two nodes of an uncondensed body with every node that contributes to it.
 *
 * Coordinates without weight, called massless, are eliminated first; the others are massive.  Each massless one is
 * matched to a constraint row and substituted out of the other rows.
 *
 * The rows and coordinates concerned form independent components, such as a massless body and its joints.  In each, the
 * matched rows p are P in the massless columns, a square matrix, and H in the massive ones; the unmatched rows i are K
 * and Z.  With  P = L U,  Y = K P^-1,
 *
 *     mu = P^-T f_P,     f~ = f - H^T mu,     Z' = Z - Y H,     gamma~ = gamma_i - Y gamma_p
 *
 * where f_P are the forces at the massless coordinates, the rows Z' and the massive coordinates form a system without
 * the massless ones.  Its solution yields
 *
 *     a_P = P^-1 (gamma_p - H a),       lambda_p = mu - Y^T lambda_i. */
#include <btf.h>
#include <float.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "saddle.h"
#include "block_ldl.h"
#include "dense.h"

/* A pivot is 1 minus a squared cosine.  Round-off leaves the pivot of a dependent row at about eps / s^2, with s the
 * smallest sine of the rows before it: at this one if s = 0.07.  With a smaller s such a row passes, but its sine is
 * below `rank_suspect` (watchdog.c), where opening a run computes the rank. */
#define SADDLE_ROUND_OFF (200 * DBL_EPSILON)

enum { MASSLESS_GROUPS = PW_MAX_BODIES + PW_MAX_INTERNAL }; /* most groups of one element */

/* Groups of coordinates: each body's three, then each internal coordinate alone.  The group of coordinate j. */
static inline int group_of (const pw_system *s, int j) {
  return j < 3 * s->bodies ? j / 3 : j - 2 * s->bodies;
}
static inline int group_first (const pw_system *s, int group) {
  return group < s->bodies ? 3 * group : group + 2 * s->bodies;
}
/* The number of coordinates in the group that begins with coordinate j. */
static inline int group_width (const pw_system *s, int j) {
  return j < 3 * s->bodies ? 3 : 1;
}

/* The number of columns in the group that begins with local column x of an element. */
static inline int group_columns (const pw_kind *kind, int x) {
  return x < 3 * kind->bodies ? 3 : 1;
}

/* 1 if an element's equations may change under a rigid displacement of its bodies: it touches the ground, acts on
 * fewer than two bodies, or is nonholonomic. */
static inline int is_grounded (const pw_system *s, const pw_element_batch *k, int e) {
  int grounded = k->kind->bodies < 2 || k->row >= s->holonomic;
  for (int b = 0; b < k->kind->bodies; b++) grounded |= k->column[e * k->kind->bodies + b] >= s->coords;
  return grounded;
}

/* A group of a component, whose coordinates are numbered as its local columns. */
typedef struct {
  int j, width; /* first global coordinate; 3 of a body, or 1 */
  int column;   /* first local column */
} massless_group;

/* A row of a component.  Entries in columns of angles are multiplied by 1 / L before they are compared with others. */
typedef struct {
  int equation;          /* its constraint equation */
  int j;                 /* matched rows: the coordinate */
  int pivot_column;      /* its local column */
  double largest;        /* largest entry when last matched */
  double pivot_scale;    /* matched rows: factor that makes the pivot relative to `largest` */
  double rematch_below;  /* matched rows: the relative pivot below which the component is matched again */
  double squared_terms;  /* unmatched rows: sum of squares of what Z' is the difference of, and of K */
  double gamma;          /* of unmatched rows gamma~ */
  double lambda;         /* the multiplier; of matched rows mu before that */
  const double **source; /* groups: its entries in the batch, or massless_zeros */
} massless_row;

/* The part of H in the columns of one group and in one row. */
typedef struct {
  const double *J;
  int p, j, width, column; /* the row; the group's first coordinate, width and first local column */
} massless_block;

typedef struct pw_component {
  int rows, cols, groups;
  int pivots;   /* matched rows */
  int blocks;   /* of H, without those of zeros */
  int grounded; /* 1: one of its elements is (is_grounded) */
  massless_group *group;
  int *global;                   /* cols: global coordinate */
  unsigned char *is_massless;    /* cols: 1 for a coordinate without weight */
  int massives;                  /* columns of the others */
  double *squared_scale;         /* cols: 1, or for an angle 1 / L^2 */
  double *massive_squared_scale; /* cols: the same, 0 for a massless coordinate */
  massless_row *row;             /* the matched ones first, in the order of elimination */
  int *unknown; /* rows: index in gamma and lambda for the unmatched row i, whichever row that is after matching again;
                 * -1: its multiplier is 0 */
  const double **entry;  /* rows x pivots: the entries of P and K in the batches */
  massless_block *block; /* blocks */
  double *P;          /* rows x pivots: L below the diagonal, U above it, the inverse of U's diagonal on it; then Y */
  double *x;          /* rows: scratch */
  double *A;          /* rows x cols: of unmatched rows Z', arbitrary in massless columns; scratch while matching */
  double least_pivot; /* the smallest pivot relative to its row, or norm of a row of Z' relative to its terms */
  char *memory;
} pw_component;

/* The contribution of a node to a group. */
typedef struct {
  const double *J; /* its entry in the node's first row and the group's first column */
  int node;
  int row_stride; /* from row to row of J */
  int group;
  int is_pin;        /* 1: both rows of a pin, whose x and y columns are the unit matrix or its negative */
  int is_prescribed; /* 1: some of the group's coordinates are prescribed */
} plan_contribution;

typedef struct {
  pw_saddle *saddle;
  const double *weight;
  const unsigned char *active;
  int *parent; /* groups: union-find of massless groups; see massless_unite */
  int *member; /* groups: -1: in no active row; at a root, once they are numbered: the number of its component */
  pw_plan_node *node;
  plan_contribution *contribution; /* those of a node follow one another */
  int *pair;                       /* 2 x pairs: coupled nodes */
  int nodes, contributions;
  long pairs;
  size_t node_room, contribution_room, pair_room; /* number of entries for which each has room */
  int failed;                                     /* 1: out of memory */
  int groups;
  int *start, *list; /* contributions to group g: list[start[g]] to list[start[g + 1] - 1] */
  int *uncondensed;  /* groups: first of the two nodes of an uncondensed body, or -1 */
  pw_chain *chain;
  int chains, linked;       /* number of chains; number of bodies in them */
  unsigned char *is_linked; /* groups: 1 for a body in a chain */
  pw_arena arena;           /* contains the arrays whose length is known beforehand */
} saddle_plan;

static const double massless_zeros[3] = { 0 };

static inline void massless_copy (pw_component *c, int i) {
  const double **from = c->row[i].source;
  for (const massless_group *g = c->group; g < c->group + c->groups; g++) {
    const double *J = *from++;
    double *A = c->A + i * c->cols + g->column;
    A[0] = J[0];
    if (g->width == 3) A[1] = J[1], A[2] = J[2];
  }
}

/* The weighted sum of the squares of the entries of row i. */
static double massless_square (const pw_component *c, int i, const double *weight) {
  double sum = 0;
  for (const massless_group *g = c->group, *end = g + c->groups; g < end; g++) {
    const double *A = c->A + i * c->cols + g->column, *w = weight + g->column;
    sum += w[0] * A[0] * A[0];
    if (g->width == 3) sum += w[1] * A[1] * A[1] + w[2] * A[2] * A[2];
  }
  return sum;
}

static void massless_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  massless_row row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int n = 0; n < c->cols; n++) {
    double x = c->A[a * c->cols + n];
    c->A[a * c->cols + n] = c->A[b * c->cols + n];
    c->A[b * c->cols + n] = x;
  }
}

/* Entries below this, relative to the terms or the largest entry of their row, are what round-off leaves of 0. */
#define MASSLESS_ROUND_OFF 1e-12

/* Matches the row with the largest entry in a massless column, each row scaled by its largest original entry (so that
 * the remainder of a dependent row is small), and moves it to p.  Returns 0 if all entries are round-off; the component
 * is then matched again at the next factorisation. */
static int massless_select_pivot (pw_component *c, int p) {
  const double guard = 0.1; /* a pivot may lose a digit before the component is matched again */
  int row = -1, column = -1;
  double best = MASSLESS_ROUND_OFF;
  for (int i = p; i < c->rows; i++)
    for (int n = 0; n < c->cols; n++) {
      if (!c->is_massless[n]) continue;
      double scaled = sqrt (c->squared_scale[n]) * fabs (c->A[i * c->cols + n]) / c->row[i].largest;
      if (scaled > best) best = scaled, row = i, column = n;
    }
  if (row < 0) {
    for (int i = 0; i < c->pivots; i++) c->row[i].rematch_below = NAN;
    return 0;
  }
  massless_swap (c, p, row);
  c->row[p].pivot_column = column, c->row[p].j = c->global[column];
  c->row[p].pivot_scale = sqrt (c->squared_scale[column]) / c->row[p].largest;
  c->row[p].rematch_below = guard * best;
  return 1;
}

/* Lists the entries of P and K, and the blocks of H. */
static void massless_list (pw_component *c) {
  const double **entry = c->entry;
  c->blocks = 0;
  for (const massless_row *r = c->row; r < c->row + c->rows; r++) {
    for (int p = 0; p < c->pivots; p++) {
      int g = 0, column = c->row[p].pivot_column;
      while (column >= c->group[g].column + c->group[g].width) g++;
      *entry++ = r->source[g] == massless_zeros ? massless_zeros : r->source[g] + column - c->group[g].column;
    }
    for (int g = 0; r < c->row + c->pivots && g < c->groups; g++) {
      const massless_group *group = &c->group[g];
      int massive = 0;
      for (int n = 0; n < group->width; n++) massive |= !c->is_massless[group->column + n];
      if (massive && r->source[g] != massless_zeros)
        c->block[c->blocks++] =
            (massless_block){ r->source[g], (int)(r - c->row), group->j, group->width, group->column };
    }
  }
}

/* Lists the matched rows as known ones of a dense S, which applies them to forces and accelerations. */
static void massless_list_known (pw_saddle *saddle) {
  pw_dense *d = saddle->dense;
  pw_dense_known *known = d->known;
  for (pw_dense_group *p = d->group; p < d->group + d->groups; p++) {
    p->known = known;
    for (pw_component *c = saddle->component; c < saddle->component + saddle->components; c++)
      for (int g = 0; g < c->groups; g++)
        for (massless_row *r = c->row; r < c->row + c->pivots && c->group[g].j == p->j; r++)
          if (r->source[g] != massless_zeros) *known++ = (pw_dense_known){ r->source[g], &r->lambda, &r->gamma };
    p->known_rows = (int)(known - p->known);
  }
  pw_dense_open (d);
}

/* Matches the massless coordinates to rows at the J last evaluated, by Gaussian elimination with complete pivoting over
 * their columns.  Returns the number of rows matched. */
static int massless_match (pw_component *c) {
  for (int i = 0; i < c->rows; i++) {
    massless_copy (c, i);
    c->row[i].largest = 0;
    for (int k = 0; k < c->cols; k++)
      c->row[i].largest = fmax (c->row[i].largest, sqrt (c->squared_scale[k]) * fabs (c->A[i * c->cols + k]));
  }
  for (int p = 0; p < c->pivots; p++) {
    if (!massless_select_pivot (c, p)) return p;
    const double *pivot_row = c->A + p * c->cols;
    for (int i = p + 1; i < c->rows; i++) {
      double *row = c->A + i * c->cols, l = row[c->row[p].pivot_column] / pivot_row[c->row[p].pivot_column];
      for (int k = 0; k < c->cols; k++) row[k] -= l * pivot_row[k];
      row[c->row[p].pivot_column] = 0;
    }
  }
  massless_list (c);
  return c->pivots;
}

enum { MASSLESS_LOCAL = 3 };

/* Calls f (n, c, ...), where n is c->pivots, with the constant 1, 2 or 3, so that loops are unrolled, or f_any (c,
 * ...), a function that is not inlined. */
#define MASSLESS_PIVOTS(f, ...)          \
  (c->pivots == 3   ? f (3, __VA_ARGS__) \
   : c->pivots == 2 ? f (2, __VA_ARGS__) \
   : c->pivots == 1 ? f (1, __VA_ARGS__) \
                    : f##_any (__VA_ARGS__))

/* P = L U.  Returns 0 if a pivot has become much smaller than when it was matched. */
PW_INLINE int massless_factor_P (int n, pw_component *c, double *P) {
  double least = INFINITY;
  PW_UNROLL for (int i = 0; i < n * n; i++) P[i] = *c->entry[i];
  PW_UNROLL for (int p = 0; p < n; p++) {
    double pivot = fabs (P[p * n + p]) * c->row[p].pivot_scale, inverse = 1 / P[p * n + p];
    least = pivot < least ? pivot : least;
    if (!(pivot >= c->row[p].rematch_below)) return 0;
    P[p * n + p] = inverse;
    PW_UNROLL for (int i = p + 1; i < n; i++) {
      double l = P[i * n + p] * inverse;
      P[i * n + p] = l;
      PW_UNROLL for (int j = p + 1; j < n; j++) P[i * n + j] -= l * P[p * n + j];
    }
  }
  c->least_pivot = least;
  return 1;
}

/* x = P^-1 x */
PW_INLINE void massless_solve_P (int n, const double *P, double *x) {
  PW_UNROLL for (int i = 1; i < n; i++) PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[i * n + j] * x[j];
  PW_UNROLL for (int i = n - 1; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[i * n + j] * x[j];
    x[i] *= P[i * n + i];
  }
}

/* x = P^-T x */
PW_INLINE void massless_solve_PT (int n, const double *P, double *x) {
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[j * n + i] * x[j];
    x[i] *= P[i * n + i];
  }
  PW_UNROLL for (int i = n - 2; i >= 0; i--) PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[j * n + i] * x[j];
}

/* Y and Z' of the unmatched rows.  What round-off leaves of a dependent row has any direction: only its size, relative
 * to the terms, reveals it. */
PW_SELDOM void massless_unmatched (int n, pw_component *c) {
  for (int i = n; i < c->rows; i++) {
    double *Y = c->P + i * n, *Z = c->A + i * c->cols, terms;
    massless_copy (c, i);
    terms = massless_square (c, i, c->squared_scale);
    for (int p = 0; p < n; p++) Y[p] = *c->entry[i * n + p];
    massless_solve_PT (n, c->P, Y);
    for (const massless_block *b = c->block; b < c->block + c->blocks; b++)
      for (int k = 0; k < b->width; k++) {
        double term = Y[b->p] * b->J[k];
        Z[b->column + k] -= term;
        terms += c->massive_squared_scale[b->column + k] * term * term;
      }
    double remainder = terms > 0 ? sqrt (massless_square (c, i, c->massive_squared_scale) / terms) : 0;
    if (!(remainder >= c->least_pivot)) c->least_pivot = remainder;
    c->row[i].squared_terms = terms;
  }
}

/* If `factors`, eliminates with the J last evaluated and the pivots matched before, and returns 0 if a pivot has become
 * much smaller than when it was matched.  Then, unless gamma is NULL: gamma~, mu and, unless S is dense, f~ in
 * `force`. */
PW_INLINE int massless_forward (int n, pw_component *c, int factors, int dense, const double *f, double *force,
                                double *gamma) {
  massless_row *row = c->row;
  double local[MASSLESS_LOCAL * MASSLESS_LOCAL], local_mu[MASSLESS_LOCAL];
  double *P = n <= MASSLESS_LOCAL ? local : c->P, *mu = n <= MASSLESS_LOCAL ? local_mu : c->x;
  if (factors) {
    if (!massless_factor_P (n, c, P)) return 0;
    if (n <= MASSLESS_LOCAL) PW_UNROLL for (int i = 0; i < n * n; i++) c->P[i] = P[i];
    if (c->rows > n) massless_unmatched (n, c);
  } else if (n <= MASSLESS_LOCAL) {
    PW_UNROLL for (int i = 0; i < n * n; i++) P[i] = c->P[i];
  }
  if (gamma == NULL) return 1;
  PW_UNROLL for (int p = 0; p < n; p++) row[p].gamma = gamma[row[p].equation], mu[p] = f[row[p].j];
  for (int i = n; i < c->rows; i++) {
    row[i].gamma = gamma[row[i].equation];
    PW_UNROLL for (int p = 0; p < n; p++) row[i].gamma -= c->P[i * n + p] * row[p].gamma;
  }
  for (int i = n; i < c->rows; i++)
    if (c->unknown[i] >= 0) gamma[c->unknown[i]] = row[i].gamma;
  massless_solve_PT (n, P, mu);
  for (const massless_block *b = c->block, *end = b + c->blocks; b < end && !dense; b++) {
    double *F = force + b->j, x = mu[b->p];
    F[0] -= b->J[0] * x;
    if (b->width == 3) F[1] -= b->J[1] * x, F[2] -= b->J[2] * x;
  }
  PW_UNROLL for (int p = 0; p < n; p++) row[p].lambda = mu[p];
  return 1;
}

PW_SELDOM int massless_forward_any (pw_component *c, int factors, int dense, const double *f, double *force,
                                    double *gamma) {
  return massless_forward (c->pivots, c, factors, dense, f, force, gamma);
}

/* If `factors`, eliminates with the J last evaluated, and matches again if a pivot has become much smaller than when it
 * was matched.  Then, unless gamma is NULL, does the first half of a solution: unless S is dense, saddle->force becomes
 * f~ at the massive coordinates; gamma becomes gamma~ at `unknown` of unmatched rows.  Returns the square of the least
 * `least_pivot`, at most 1; 0 if singular. */
PW_INLINE double massless_forward_all (pw_saddle *saddle, int factors, int dense, const double *f, double *gamma) {
  double least = 1;
  pw_component *c = saddle->component, *end = c + saddle->components;
  for (int matched = 0; c < end;) {
    if (MASSLESS_PIVOTS (massless_forward, c, factors, dense, f, saddle->force, gamma)) {
      if (!(c->least_pivot > 0)) return 0; /* or NaN */
      least = c->least_pivot < least ? c->least_pivot : least;
      c++, matched = 0;
    } else if (matched++ || massless_match (c) < c->pivots) {
      return 0;
    } else if (dense) {
      massless_list_known (saddle);
    }
  }
  return least * least;
}

/* gamma_p - H a, which a dense S has computed, a_P, lambda_p.  a is 0 at massless coordinates. */
PW_INLINE void massless_backward_component (int n, pw_component *c, int dense, double *a, double *lambda) {
  massless_row *row = c->row;
  double local[MASSLESS_LOCAL], *x = n <= MASSLESS_LOCAL ? local : c->x;
  PW_UNROLL for (int p = 0; p < n; p++) x[p] = row[p].gamma;
  for (const massless_block *b = c->block, *end = b + c->blocks; b < end && !dense; b++) {
    const double *A = a + b->j;
    x[b->p] -= b->width == 3 ? b->J[0] * A[0] + b->J[1] * A[1] + b->J[2] * A[2] : b->J[0] * A[0];
  }
  massless_solve_P (n, c->P, x);
  /* reads all before storing any: one row's index may be the `unknown` of another */
  for (int i = n; i < c->rows; i++) row[i].lambda = c->unknown[i] < 0 ? 0 : lambda[c->unknown[i]];
  for (int i = n; i < c->rows; i++) {
    lambda[row[i].equation] = row[i].lambda;
    PW_UNROLL for (int p = 0; p < n; p++) row[p].lambda -= c->P[i * n + p] * row[i].lambda;
  }
  PW_UNROLL for (int p = 0; p < n; p++) a[row[p].j] = x[p], lambda[row[p].equation] = row[p].lambda;
}

PW_SELDOM void massless_backward_component_any (pw_component *c, int dense, double *a, double *lambda) {
  massless_backward_component (c->pivots, c, dense, a, lambda);
}

/* Second half: from a of the massive coordinates and lambda at `unknown` of unmatched rows, a of the massless
 * coordinates and lambda of all rows. */
PW_INLINE void massless_backward (pw_saddle *saddle, int dense, double *a, double *lambda) {
  pw_component *c = saddle->component;
  for (int count = saddle->components; count > 0; count--, c++)
    MASSLESS_PIVOTS (massless_backward_component, c, dense, a, lambda);
}

/* 1 for a massless group: one that contains a massless coordinate.  Union-find over these finds the components. */
static int massless_is_group (const saddle_plan *p, int group) {
  int j = group_first (p->saddle->s, group);
  for (int n = 0; n < group_width (p->saddle->s, j); n++)
    if (p->weight[j + n] == 0) return 1;
  return 0;
}

/* The groups of an element's coordinates, without the ground, and the first local column of each.  Returns their
 * number. */
static int massless_element_groups (const pw_system *s, const pw_element_batch *k, int e, int *group, int *column) {
  int n = 0;
  for (int x = 0; x < k->b.cols; x += group_columns (k->kind, x)) {
    int j = pw_global (k, e, x);
    if (j >= s->coords) continue;
    column[n] = x;
    group[n++] = group_of (s, j);
  }
  return n;
}

static int massless_is_active (const saddle_plan *p, int row) {
  return row < p->saddle->rows && (p->active == NULL || p->active[row]);
}

/* Unites massless groups that share an active row, and marks them as members. */
static void massless_unite (saddle_plan *p) {
  int group[MASSLESS_GROUPS], column[MASSLESS_GROUPS];
  PW_EACH_CONSTRAINT (k, p->saddle->w)
    for (int e = 0; e < k->b.count; e++) {
      int active = 0, last = -1, n = massless_element_groups (p->saddle->s, k, e, group, column);
      for (int i = 0; i < k->kind->rows; i++) active |= massless_is_active (p, k->row + e * k->kind->rows + i);
      for (int i = 0; active && i < n; i++) {
        if (!massless_is_group (p, group[i])) continue;
        p->member[group[i]] = 0;
        if (last >= 0) p->parent[pw_root (p->parent, group[i])] = pw_root (p->parent, last);
        last = group[i];
      }
    }
}

/* The index of a group in a component; adds it if it is not there. */
static int massless_add_group (const pw_system *s, pw_component *c, int g) {
  int j = group_first (s, g), width = group_width (s, j);
  for (int i = 0; i < c->groups; i++)
    if (c->group[i].j == j) return i;
  c->group[c->groups] = (massless_group){ j, width, c->cols };
  for (int n = 0; n < width; n++) c->global[c->cols++] = j + n;
  return c->groups++;
}

/* Adds each active row with a massless group, and its groups, to the component of that group; before massless_lay_out,
 * only counts the rows, and the groups with repetition. */
static void massless_add_rows (saddle_plan *p) {
  pw_saddle *saddle = p->saddle;
  int group[MASSLESS_GROUPS], column[MASSLESS_GROUPS];
  PW_EACH_CONSTRAINT (k, saddle->w)
    for (int e = 0; e < k->b.count; e++) {
      int n = massless_element_groups (saddle->s, k, e, group, column), first = 0;
      while (first < n && !massless_is_group (p, group[first])) first++;
      for (int i = e * k->kind->rows; first < n && i < (e + 1) * k->kind->rows; i++) {
        const int row = k->row + i;
        if (!massless_is_active (p, row)) continue;
        saddle->component_of_row[row] = p->member[pw_root (p->parent, group[first])];
        pw_component *c = &saddle->component[saddle->component_of_row[row]];
        c->grounded |= is_grounded (saddle->s, k, e);
        if (c->row)
          for (int g = 0; g < n; g++)
            c->row[c->rows].source[massless_add_group (saddle->s, c, group[g])] = k->J + i * k->b.cols + column[g];
        else
          c->groups += n;
        if (c->row) c->row[c->rows].equation = row;
        c->rows++;
      }
    }
}

/* Allocates the components' arrays.  A component has at most as many groups as were counted with repetition, at most
 * those of the scene, and at most as many pivots as rows. */
static int massless_lay_out (const saddle_plan *p) {
  const pw_saddle *saddle = p->saddle;
  for (pw_component *c = saddle->component; c < saddle->component + saddle->components; c++) {
    const int rows = c->rows, groups = c->groups < p->groups ? c->groups : p->groups, cols = 3 * groups;
    const double **from;
    c->memory = PW_ALLOC_ARRAYS (
        PW_ARRAY (c->group, groups), PW_ARRAY (c->global, cols), PW_ARRAY (c->is_massless, cols),
        PW_ARRAY (c->squared_scale, cols), PW_ARRAY (c->massive_squared_scale, cols), PW_ARRAY (c->row, rows),
        PW_ARRAY (c->unknown, rows), PW_ARRAY (c->entry, (size_t)rows * (size_t)rows), PW_ARRAY (c->block, c->groups),
        PW_ARRAY (c->P, (size_t)rows * (size_t)rows), PW_ARRAY (c->A, (size_t)rows * (size_t)cols),
        PW_ARRAY (c->x, rows), PW_ARRAY (from, (size_t)rows * (size_t)groups));
    if (c->memory == NULL) return PW_RESOURCE;
    for (int i = 0; i < rows; i++) c->row[i].source = from + i * groups;
    for (int i = 0; i < rows * groups; i++) from[i] = massless_zeros;
    c->rows = c->groups = 0;
  }
  return PW_OK;
}

static int massless_undetermined (const pw_system *s, int j, pw_error *error) {
  const char *lacking = pw_is_angle (s, j) ? "inertia" : "mass";
  int user = j < 3 * s->bodies && j % 3 == 2 ? s->angle_user[j / 3] : -1;
  const pw_element_info element = user < 0 ? (pw_element_info){ 0 } : pw_system_element (s, user);
  const char *depends = user >= 0 && pw_kind_is_built_in (element.kind) ? "depends" : "may depend";
  return pw_fail (error, PW_INPUT,
                  "model %s: %s has no %s, and no constraint determines how it moves%s; give it %s, or constrain it",
                  s->model, PW_NAME (pw_system_state_name, s, j), lacking,
                  user < 0 ? ""
                           : PW_PRINTED (300, ", although %s %s %s on it", element.kind->name, element.name, depends),
                  lacking);
}

/* Marks a component's massless columns and matches them; reports a column that no row determines. */
static int massless_check (const saddle_plan *p, pw_component *c, pw_error *error) {
  const pw_system *s = p->saddle->s;
  int massless = 0, found;
  for (int n = 0; n < c->cols; n++) {
    int j = c->global[n];
    c->squared_scale[n] = pw_is_angle (s, j) ? 1 / (s->scale.length * s->scale.length) : 1;
    c->is_massless[n] = p->weight[j] == 0;
    c->massive_squared_scale[n] = c->is_massless[n] ? 0 : c->squared_scale[n];
    c->massives += !c->is_massless[n];
    massless += c->is_massless[n];
  }
  c->pivots = massless < c->rows ? massless : c->rows;
  found = massless_match (c);
  for (int n = 0; found < massless && n < c->cols; n++) {
    int used = 0;
    for (int q = 0; q < found; q++) used |= c->row[q].pivot_column == n;
    if (c->is_massless[n] && !used) return massless_undetermined (s, c->global[n], error);
  }
  massless_forward_any (c, 1, 0, NULL, NULL, NULL);
  return PW_OK;
}

/* Finds the components and matches them.  PW_OK, PW_RESOURCE, or PW_INPUT with the error that names a coordinate that
 * no row determines, such as one of a massless group in no active row. */
static int massless_open (saddle_plan *p, pw_error *error) {
  pw_saddle *saddle = p->saddle;
  int status = PW_OK;
  if (!PW_ARENA_ARRAYS (&p->arena, PW_ARRAY (p->parent, p->groups), PW_ARRAY (p->member, p->groups)))
    return PW_RESOURCE;
  for (int g = 0; g < p->groups; g++) p->parent[g] = g, p->member[g] = -1;
  for (int i = 0; i < saddle->s->rows; i++) saddle->component_of_row[i] = -1;
  massless_unite (p);
  for (int g = 0; g < p->groups; g++) {
    int j = group_first (saddle->s, g);
    if (!massless_is_group (p, g)) continue;
    while (p->weight[j] != 0) j++;
    if (p->member[g] < 0) return massless_undetermined (saddle->s, j, error);
    if (pw_root (p->parent, g) == g) p->member[g] = saddle->components++;
  }
  if (saddle->components == 0) return PW_OK;
  saddle->component = calloc ((size_t)saddle->components, sizeof *saddle->component);
  if (saddle->component == NULL) return PW_RESOURCE;
  massless_add_rows (p);
  if (massless_lay_out (p) != PW_OK) return PW_RESOURCE;
  massless_add_rows (p);
  for (int c = 0; c < saddle->components && status == PW_OK; c++)
    status = massless_check (p, &saddle->component[c], error);
  return status;
}

/* Begins a node: the contributions that follow are its own. */
static void condense_add_node (saddle_plan *plan, pw_plan_node node) {
  plan->failed |= pw_grow (&plan->node, (size_t)plan->nodes, &plan->node_room, sizeof *plan->node) != PW_OK;
  node.first_contribution = plan->contributions;
  if (!plan->failed) plan->node[plan->nodes++] = node;
}

/* Adds the contribution of the last node to the group that begins with coordinate j.  If these coordinates are all
 * prescribed or massless there is none, and a prescribed one makes the node `grounded`. */
static void condense_contribute (saddle_plan *plan, const double *J, int row_stride, int j, int is_pin) {
  int moves = 0, is_prescribed = 0;
  if (plan->failed) return;
  for (int n = 0; n < group_width (plan->saddle->s, j); n++) {
    moves |= plan->saddle->inverse_weight[j + n] > 0;
    is_prescribed |= isinf (plan->weight[j + n]) != 0;
  }
  if (!moves) plan->node[plan->nodes - 1].grounded |= is_prescribed;
  if (!moves) return;
  plan->failed = pw_grow (&plan->contribution, (size_t)plan->contributions, &plan->contribution_room,
                          sizeof *plan->contribution) != PW_OK;
  if (!plan->failed)
    plan->contribution[plan->contributions++] =
        (plan_contribution){ J, plan->nodes - 1, row_stride, group_of (plan->saddle->s, j), is_pin, is_prescribed };
}

/* Adds the node of `size` rows from row n of a batch on. */
static void condense_element (saddle_plan *plan, const pw_element_batch *b, int n, int size) {
  const int e = n / b->kind->rows, is_pin = b->kind == &pw_kind_pin && size == 2;
  const int is_rolling_wheel = pw_kind_is_built_in (b->kind) && b->kind->contact && b->kind->internal == 1;
  condense_add_node (plan, (pw_plan_node){ .size = size,
                                           .unknown = b->row + n,
                                           .grounded = is_grounded (plan->saddle->s, b, e),
                                           .rolls = is_rolling_wheel && size == 1 && n % 2 == 1 });
  for (int x = 0; x < b->b.cols; x += group_columns (b->kind, x)) {
    int j = pw_global (b, e, x);
    if (j < plan->saddle->s->coords) condense_contribute (plan, b->J + n * b->b.cols + x, b->b.cols, j, is_pin);
  }
}

/* 1 for row n of a batch that becomes part of a node: active, not in a massless component, and with an entry other than
 * 0 at a coordinate that is not prescribed, or without prescribed coordinates. */
static int condense_takes_part (const saddle_plan *plan, const pw_element_batch *b, int n) {
  const double *J = b->J + n * b->b.cols, *inverse = plan->saddle->inverse_weight;
  int i = b->row + n, prescribed = 0;
  if ((plan->active && !plan->active[i]) || plan->saddle->component_of_row[i] >= 0) return 0;
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
static void condense_elements (saddle_plan *plan) {
  pw_saddle *saddle = plan->saddle;
  for (const pw_element_batch *b = saddle->w->batch;
       b < saddle->w->batch + saddle->s->constraints && b->row < saddle->rows; b++)
    for (int n = 0, end = b->b.count * b->kind->rows, size; n < end; n += size ? size : 1) {
      for (size = 0; n + size < end && size < PW_BLOCK_NODE; size++)
        if (!condense_takes_part (plan, b, n + size) || (size > 0 && !condense_joins (b, n))) break;
      if (size > 0)
        condense_element (plan, b, n, size);
      else if (saddle->component_of_row[b->row + n] < 0)
        saddle->inactive[saddle->inactive_count++] = b->row + n;
    }
}

/* 1 for an unmatched row i that becomes a node: it has an entry other than round-off at a massive coordinate that is
 * not prescribed, or its component has massive coordinates and none is prescribed. */
static int condense_remains (const saddle_plan *plan, const pw_component *p, int i) {
  int prescribed = 0;
  for (int n = 0; n < p->cols; n++) {
    const double entry = fabs (p->A[i * p->cols + n]) * sqrt (p->squared_scale[n]);
    if (plan->saddle->inverse_weight[p->global[n]] > 0 && entry > MASSLESS_ROUND_OFF * sqrt (p->row[i].squared_terms))
      return 1;
    prescribed |= !p->is_massless[n] && plan->saddle->inverse_weight[p->global[n]] == 0;
  }
  return p->massives > 0 && !prescribed;
}

/* Adds the unmatched rows of the massless components; the multiplier of one that does not become a node is 0. */
static void condense_components (saddle_plan *plan) {
  const pw_saddle *saddle = plan->saddle;
  for (pw_component *p = saddle->component; p < saddle->component + saddle->components; p++)
    for (int i = p->pivots; i < p->rows; i++) {
      p->unknown[i] = condense_remains (plan, p, i) ? p->row[i].equation : -1;
      if (p->unknown[i] < 0) continue;
      condense_add_node (plan, (pw_plan_node){ .size = 1, .unknown = p->unknown[i], .grounded = p->grounded });
      for (int g = 0; g < p->groups; g++)
        condense_contribute (plan, p->A + i * p->cols + p->group[g].column, p->cols, p->group[g].j, 0);
    }
}

/* Sorts the contributions by group. */
static int condense_sort (saddle_plan *plan) {
  if (plan->failed || !PW_ARENA_ARRAYS (&plan->arena, PW_ARRAY (plan->start, plan->groups + 2),
                                        PW_ARRAY (plan->list, plan->contributions)))
    return PW_RESOURCE;
  for (int p = 0; p < plan->contributions; p++) plan->start[plan->contribution[p].group + 2]++;
  for (int g = 0; g < plan->groups; g++) plan->start[g + 2] += plan->start[g + 1];
  for (int p = 0; p < plan->contributions; p++) plan->list[plan->start[plan->contribution[p].group + 1]++] = p;
  return PW_OK;
}

/* The end of the contributions of node n: one after the last. */
static int condense_end (const saddle_plan *plan, int n) {
  return n + 1 < plan->nodes ? plan->node[n + 1].first_contribution : plan->contributions;
}

/* Finds out whether the equations depend on each other in every configuration, since some of them are more than the
 * coordinates in which they have entries, such as those of ten pins between the same two bodies.  Then *row is one of
 * them, else it stays.  The largest matching of equations to coordinates leaves it out (Duff 1981, On algorithms for
 * obtaining a maximum transversal). */
static int condense_find_dependent (saddle_plan *plan, int *row) {
  const pw_saddle *saddle = plan->saddle;
  size_t coords = (size_t)saddle->s->coords, equations = 2 * (size_t)plan->nodes; /* at most */
  int *match, *coordinate, *equation, *is_matched, *first, *more, count = 0, entries = 0;
  if (!PW_ARENA_ARRAYS (&plan->arena, PW_ARRAY (match, coords), PW_ARRAY (coordinate, 6 * (size_t)plan->contributions),
                        PW_ARRAY (equation, equations), PW_ARRAY (is_matched, equations),
                        PW_ARRAY (first, equations + 1), PW_ARRAY (more, 5 * equations)))
    return PW_RESOURCE;
  double work;
  for (int n = 0; n < plan->nodes; n++)
    for (int i = 0; i < plan->node[n].size; i++) {
      equation[count] = plan->node[n].unknown + i;
      for (int p = plan->node[n].first_contribution; p < condense_end (plan, n); p++) {
        int j = group_first (saddle->s, plan->contribution[p].group), end = j + group_width (saddle->s, j);
        for (; j < end; j++)
          if (saddle->inverse_weight[j] > 0) coordinate[entries++] = j;
      }
      first[++count] = entries;
    }
  if (btf_maxtrans ((int)coords, count, first, coordinate, 0, &work, match, more) == count) return PW_OK;
  for (size_t j = 0; j < coords; j++)
    if (match[j] >= 0) is_matched[match[j]] = 1;
  for (count = 0; is_matched[count];) count++;
  return *row = equation[count], PW_OK;
}

/* Ranks of the nodes of a scene with uncondensed bodies.  Nodes of rank 0 are eliminated before the uncondensed bodies,
 * as if these were at rest; those of rank 2 after them.  The matrix of rank 0 must be regular wherever the mechanism
 * is.  A leg is a set of bodies joined by nodes that touch neither uncondensed bodies nor the ground.  If a leg joins
 * an uncondensed body to the ground, or to another uncondensed body, and both its ends were at rest, the matrix would
 * be singular where the leg is stretched.  So the nodes at one end have rank 2: at the ground, or at one of the two
 * bodies.  Then multipliers of rank 0 that exert no force on the bodies of a leg exert none on the body at its other
 * end either, since the forces of a joint on its two bodies are opposite: dependent equations of rank 0 are dependent
 * in the whole mechanism.  Nodes of uncondensed bodies alone have rank 2, too: with these at rest their equations would
 * be empty.  The rolling equation of a wheel has rank 0: no other equation contains the wheel's spin. */

/* 1 if node n touches the ground, or prescribed coordinates of a condensed body, which are at rest as well. */
static int rank_is_grounded (const saddle_plan *plan, int n) {
  int grounded = plan->node[n].grounded;
  for (int p = plan->node[n].first_contribution; p < condense_end (plan, n); p++)
    grounded |= plan->contribution[p].is_prescribed && plan->uncondensed[plan->contribution[p].group] < 0;
  return grounded;
}

/* 1 for a node that touches an uncondensed body; of the others 2 if it is grounded, else 0. */
static int rank_turn (const saddle_plan *plan, int n) {
  for (int p = plan->node[n].first_contribution; p < condense_end (plan, n); p++)
    if (plan->uncondensed[plan->contribution[p].group] >= 0) return 1;
  return rank_is_grounded (plan, n) ? 2 : 0;
}

/* Joins the groups of node n, and the ground if the node is grounded.  Returns 0, without joining, if that would
 * connect two uncondensed bodies, or one with the ground, or if the node touches uncondensed bodies alone.  parent:
 * groups and the ground: union-find, in which uncondensed bodies and the ground are roots. */
static int rank_join (const saddle_plan *plan, int *parent, int n) {
  const int first = plan->node[n].first_contribution, end = condense_end (plan, n);
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

static int condense_rank (saddle_plan *plan) {
  int *parent = pw_arena_alloc (&plan->arena, ((size_t)plan->groups + 1) * sizeof *parent);
  if (parent == NULL) return PW_RESOURCE;
  for (int g = 0; g <= plan->groups; g++) parent[g] = g;
  for (int turn = 0; turn < 3; turn++) /* the legs, then their ends at uncondensed bodies, then those at the ground */
    for (int n = 0; n < plan->nodes; n++)
      if (rank_turn (plan, n) == turn && !rank_join (plan, parent, n)) plan->node[n].rank = 2;
  return PW_OK;
}

/* A body to which more nodes than this contribute is not condensed: n nodes have n (n - 1) / 2 couplings, but only 2 n
 * with an uncondensed body, fewer from n = 6.  Measured: 0.6 to 0.9 of the time with 7 nodes, 0.7 to 1.0 with 6. */
enum { CONDENSE_NODES = 6 };

/* Adds two nodes for every body that is not condensed, and ranks all nodes. */
static int condense_uncondensed (saddle_plan *plan) {
  pw_saddle *saddle = plan->saddle;
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
  return plan->failed || saddle->y == NULL ? PW_RESOURCE : condense_rank (plan);
}

static void condense_add_pair (saddle_plan *plan, int a, int b) {
  plan->failed |= pw_grow (&plan->pair, (size_t)plan->pairs, &plan->pair_room, 2 * sizeof *plan->pair) != PW_OK;
  if (plan->failed) return;
  plan->pair[2 * plan->pairs] = a, plan->pair[2 * plan->pairs + 1] = b;
  plan->pairs++;
}

/* Sorts the contributions of each group by column; by insertion, since there are few. */
static void condense_sort_columns (const saddle_plan *plan, const int *column_of_node) {
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

/* Fills the block p of group g; *contributions, *couplings: numbers of those filled so far. */
static void condense_group (const saddle_plan *plan, pw_block_ldl *l, int g, pw_group_block *p, int *contributions,
                            int *couplings) {
  int j = group_first (plan->saddle->s, g), body = plan->uncondensed[g];
  *p = (pw_group_block){ .j = j,
                         .first_contribution = *contributions,
                         .first_coupling = *couplings,
                         .width = (unsigned char)group_width (plan->saddle->s, j),
                         .uncondensed = body >= 0 };
  for (int x = plan->start[g]; x < plan->start[g + 1]; x++) {
    const plan_contribution *a = &plan->contribution[plan->list[x]];
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
static int condense_fill (const saddle_plan *plan, pw_block_ldl *l) {
  int contributions = 0, couplings = 0, filled = 0, uncondensed = plan->saddle->extra / 3;
  l->inverse_weight = plan->saddle->inverse_weight;
  l->groups = plan->groups - plan->linked; /* bodies of chains have no block */
  l->memory =
      PW_ALLOC_ARRAYS (PW_ARRAY (l->group, l->groups + 1),
                       PW_ARRAY (l->contribution, plan->contributions - 2 * plan->linked + 2 * uncondensed),
                       PW_ARRAY (l->coupling, plan->pairs - plan->linked), PW_ARRAY (l->chain, plan->chains + 1),
                       PW_ARRAY (l->chain_factor, 3 * (plan->linked + plan->chains)));
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

/* Fills link for a body whose two nodes are a column and the next one, the only row below it.  Returns the column; -1
 * if the body cannot be in a chain. */
static int chain_link (const saddle_plan *plan, const pw_block_ldl *l, int body, pw_chain *link) {
  const int j = 3 * body, *list = plan->list + plan->start[body];
  if (plan->start[body + 1] - plan->start[body] != 2) return -1;
  const plan_contribution *a = &plan->contribution[list[0]], *b = &plan->contribution[list[1]];
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

/* Finds the chains.  The contributions to each group in plan->list must be sorted by the columns of their nodes in l.
 * PW_OK or PW_RESOURCE. */
static int condense_chains (saddle_plan *plan, pw_block_ldl *l) {
  pw_chain_between *between;
  if (!PW_ARENA_ARRAYS (&plan->arena, PW_ARRAY (between, l->nodes), PW_ARRAY (plan->chain, l->nodes),
                        PW_ARRAY (plan->is_linked, plan->groups)))
    return PW_RESOURCE;
  for (int p = 0; p < plan->contributions; p++) between[l->column_of_node[plan->contribution[p].node]].contributions++;
  for (int body = 0; body < plan->saddle->s->bodies; body++) {
    pw_chain link;
    int column = chain_link (plan, l, body, &link);
    if (column >= 0) between[column].link = link;
    for (int x = plan->start[body] + 1; x < plan->start[body + 1]; x++) { /* contributions by ascending columns */
      column = l->column_of_node[plan->contribution[plan->list[x - 1]].node];
      if (l->column_of_node[plan->contribution[plan->list[x]].node] == column + 1) between[column].sources++;
    }
  }
  plan->chains = pw_block_join_chains (l, between, plan->chain, plan->is_linked);
  for (int c = 0; c < plan->chains; c++) plan->linked += plan->chain[c].bodies;
  return PW_OK;
}

/* Appends group g, unless it is massless; first: row of each node. */
static void condense_dense_group (const saddle_plan *plan, int g, const int *first) {
  const int j = group_first (plan->saddle->s, g), width = group_width (plan->saddle->s, j);
  int has_weight = 0;
  for (int i = 0; i < width; i++) has_weight |= plan->weight[j + i] != 0;
  if (!has_weight) return;
  pw_dense_add_group (plan->saddle->dense, j, width);
  for (int is_pin = 1; is_pin >= 0; is_pin--)
    for (int x = plan->start[g]; x < plan->start[g + 1]; x++) {
      const plan_contribution *a = &plan->contribution[plan->list[x]];
      if (a->is_pin == is_pin)
        pw_dense_add_rows (plan->saddle->dense, is_pin, first[a->node], plan->node[a->node].size, a->J, a->row_stride);
    }
}

static int condense_dense (const saddle_plan *plan) {
  pw_saddle *saddle = plan->saddle;
  int first[PW_DENSE], known = 0;
  for (const pw_component *c = saddle->component; c < saddle->component + saddle->components; c++)
    known += c->rows * c->groups;
  pw_dense *d = saddle->dense = pw_dense_new (plan->groups, known, saddle->s->coords, saddle->inverse_weight);
  if (d == NULL) return PW_RESOURCE;
  for (int n = 0; n < plan->nodes; n++) {
    first[n] = d->n;
    for (int i = 0; i < plan->node[n].size; i++) d->unknown[d->n++] = plan->node[n].unknown + i;
  }
  pw_dense_pad (d);
  for (int g = 0; g < plan->groups; g++) condense_dense_group (plan, g, first);
  massless_list_known (saddle);
  return PW_OK;
}

static int condense_block (saddle_plan *plan) {
  for (int g = 0; g < plan->groups; g++) /* nodes that meet at a group; at an uncondensed body each with its nodes */
    for (int x = plan->start[g], body = plan->uncondensed[g]; x < plan->start[g + 1]; x++) {
      int a = plan->contribution[plan->list[x]].node;
      if (body >= 0) condense_add_pair (plan, a, body), condense_add_pair (plan, a, body + 1);
      for (int y = plan->start[g]; y < x && body < 0; y++)
        condense_add_pair (plan, a, plan->contribution[plan->list[y]].node);
    }
  if (plan->failed || plan->pairs >= INT_MAX / 2) return PW_RESOURCE;
  pw_block_ldl *l = plan->saddle->block = pw_block_open (plan->nodes, plan->node, plan->pairs, plan->pair);
  if (l == NULL) return PW_RESOURCE;
  condense_sort_columns (plan, l->column_of_node);
  int status = condense_chains (plan, l);
  if (status == PW_OK) status = pw_block_lay_out (l);
  return status == PW_OK ? condense_fill (plan, l) : status;
}

void pw_saddle_postpone (pw_saddle *saddle, double pivot) {
  saddle->postponed = pivot;
}

/* The row of the smallest pivot, or -1. */
static int saddle_pivot_row (const pw_saddle *saddle) {
  const pw_block_ldl *l = saddle->block;
  const pw_dense *d = saddle->dense;
  if (l == NULL && d == NULL) return saddle->dependent_row;
  if ((d ? d->least_pivot : l->least_pivot) > saddle->pivot) return -1;
  const int row = d ? pw_dense_least_unknown (d) : l->least_unknown;
  return row >= 0 && row < saddle->s->rows && saddle->component_of_row[row] < 0 ? row : -1;
}

/* Factorises, if `factors`, and solves, unless lambda is NULL.  massless: 1 if there are components; dense: 1 if S is
 * dense. */
PW_INLINE int saddle_run (pw_saddle *saddle, int massless, int dense, int factors, const double *f, const double *gamma,
                          double *a, double *lambda) {
  pw_block_ldl *l = saddle->block;
  double *y = lambda, pivot = INFINITY, *least = dense ? &saddle->dense->least_pivot : &l->least_pivot;
  if (!dense && lambda && saddle->extra) {
    y = saddle->y;
    for (int i = 0; i < saddle->extra; i++) y[saddle->s->rows + i] = 0;
  }
  if (y != gamma) memcpy (y, gamma, (size_t)saddle->rows * sizeof *y);
  if (factors) saddle->postponed = 0;
  if (massless) {
    const size_t bytes = (size_t)saddle->s->coords * sizeof *f;
    if (y && !f)
      f = memset (saddle->force, 0, bytes);
    else if (y && !dense)
      f = memcpy (saddle->force, f, bytes);
    pivot = massless_forward_all (saddle, factors, dense, f, y);
    if (factors && !((saddle->pivot = pivot) > SADDLE_ROUND_OFF)) return *least = INFINITY, PW_RETRY;
  }
  if (dense)
    saddle->dense->run (saddle->dense, factors, f, y, a);
  else if (factors)
    pw_block_factor (l);
  if (factors) {
    saddle->pivot = *least >= pivot ? pivot : *least;
    if (!(saddle->pivot > SADDLE_ROUND_OFF)) return PW_RETRY;
  }
  if (y == NULL) return PW_OK;
  if (!dense) pw_block_solve (l, f, y, a);
  if (!dense && y != lambda) memcpy (lambda, y, (size_t)saddle->rows * sizeof *y);
  for (int i = 0; i < saddle->inactive_count; i++) lambda[saddle->inactive[i]] = 0;
  if (massless) massless_backward (saddle, dense, a, lambda);
  return PW_OK;
}

/* One function for each kind of scene: together, the code of one would add to the cost of the others. */
#define SADDLE_RUN(name, massless, dense)                                                                        \
  static int saddle_run_##name (pw_saddle *saddle, int factors, const double *f, const double *gamma, double *a, \
                                double *lambda) {                                                                \
    return saddle_run (saddle, massless, dense, factors, f, gamma, a, lambda);                                   \
  }

SADDLE_RUN (dense, 0, 1)
SADDLE_RUN (sparse, 0, 0)
SADDLE_RUN (massless_dense, 1, 1)
SADDLE_RUN (massless_sparse, 1, 0)

/* With equations that always depend on others, nothing is factorised. */
static int saddle_run_dependent (pw_saddle *saddle, int factors, const double *f, const double *gamma, double *a,
                                 double *lambda) {
  (void)factors, (void)f, (void)gamma, (void)a, (void)lambda;
  saddle->postponed = saddle->pivot = 0;
  return PW_RETRY;
}

int pw_saddle_factor (pw_saddle *saddle) {
  return pw_saddle_factor_solve (saddle, NULL, NULL, NULL, NULL);
}

void pw_saddle_solve (pw_saddle *saddle, const double *f, const double *gamma, double *a, double *lambda) {
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  (void)saddle->run (saddle, 0, f, gamma, a, lambda);
}

double pw_saddle_sine (pw_saddle *saddle, int *row) {
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  if (row) *row = saddle_pivot_row (saddle);
  return saddle->pivot > 0 ? sqrt (fmin (saddle->pivot, 1)) : 0;
}

void pw_saddle_close (pw_saddle *saddle) {
  if (saddle == NULL) return;
  for (int c = 0; c < saddle->components && saddle->component; c++) free (saddle->component[c].memory);
  free (saddle->component);
  pw_block_close (saddle->block);
  pw_dense_close (saddle->dense);
  free (saddle->y);
  free (saddle->memory);
  free (saddle);
}

static int saddle_plan_all (saddle_plan *plan, pw_error *error) {
  pw_saddle *saddle = plan->saddle;
  size_t n = (size_t)saddle->s->coords;
  saddle->memory =
      PW_ALLOC_ARRAYS (PW_ARRAY (saddle->inverse_weight, n + 3), PW_ARRAY (saddle->force, n),
                       PW_ARRAY (saddle->inactive, saddle->rows), PW_ARRAY (saddle->component_of_row, saddle->s->rows));
  if (saddle->memory == NULL) return PW_RESOURCE;
  for (size_t j = 0; j < n; j++) saddle->inverse_weight[j] = plan->weight[j] > 0 ? 1 / plan->weight[j] : 0;
  int status = massless_open (plan, error);
  if (status != PW_OK) return status;
  condense_elements (plan);
  condense_components (plan);
  status = condense_sort (plan);
  if (status == PW_OK) status = condense_find_dependent (plan, &saddle->dependent_row);
  saddle->run = saddle_run_dependent;
  if (status != PW_OK || saddle->dependent_row >= 0) return status;
  int equations = 0;
  for (int i = 0; i < plan->nodes; i++) equations += plan->node[i].size;
  if (equations <= PW_DENSE) {
    status = condense_dense (plan);
  } else {
    status = condense_uncondensed (plan);
    if (status == PW_OK) status = condense_block (plan);
  }
  if (status != PW_OK) return status;
  saddle->run = saddle->components ? (saddle->dense ? saddle_run_massless_dense : saddle_run_massless_sparse)
                                   : (saddle->dense ? saddle_run_dense : saddle_run_sparse);
  return PW_OK;
}

pw_saddle *pw_saddle_open (pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                           pw_error *error) {
  saddle_plan plan = { .weight = weight, .active = active, .groups = w->s->coords - 2 * w->s->bodies };
  pw_saddle *saddle = plan.saddle = calloc (1, sizeof *saddle);
  int status = PW_RESOURCE;
  if (saddle) {
    *saddle = (pw_saddle){ .s = w->s, .w = w, .rows = rows, .pivot = INFINITY, .dependent_row = -1 };
    status = saddle_plan_all (&plan, error);
  }
  free (plan.node);
  free (plan.contribution);
  free (plan.pair);
  pw_arena_free (&plan.arena);
  if (status == PW_OK) return saddle;
  pw_saddle_close (saddle);
  pw_fail (error, status, "model %s: out of memory", w->s->model);
  return NULL;
}
