/* Symbolic elimination; see elimination.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "elimination.h"

static const pw_term elimination_one = { PW_TERM_ONE, 1, "1", 1 };

#define AT(p, q) x->K[(size_t)(p) * (size_t)x->n + (size_t)(q)]
#define FACTOR(p, q) x->L[(size_t)(p) * (size_t)x->n + (size_t)(q)]

static int elimination_is_zero (pw_term a) {
  return a.type == PW_TERM_ZERO;
}

/* 1 for an unknown that is not yet eliminated and coupled to p. */
static int elimination_couples (const pw_elimination *x, int i, int p) {
  return x->step[i] == x->n && i != p && !elimination_is_zero (AT (i, p));
}

static int elimination_degree (const pw_elimination *x, int p) {
  int degree = 0;
  for (int i = 0; i < x->n; i++) degree += elimination_couples (x, i, p);
  return degree;
}

/* A comment with the names of the unknowns. */
static void elimination_comment (const pw_elimination *x, pw_emitter *e, int p, int partner) {
  char name[120];
  for (int k = 0, i = p; k < 1 + (partner >= 0); k++, i = partner) {
    fputs (k ? " by " : "  /* ", e->code);
    pw_emit_name (e->code, i < x->coordinates ? pw_system_state_name (x->s, x->coordinates + i, name, sizeof name)
                                              : pw_system_reaction_name (x->s, i - x->coordinates, name, sizeof name));
  }
  fputs (" */\n", e->code);
}

static void elimination_place (pw_elimination *x, int p, int partner) {
  x->partner[x->pivots] = partner;
  x->order[x->pivots] = p;
  x->step[p] = x->pivots++;
  if (partner >= 0) x->step[partner] = x->step[p];
}

/* ---- Guards ---- */

/* The general engine takes over if a pivot is not larger than this part of its diagonal entry, or, both squared, of the norm
 * of its column, where elimination_is_large demands 0.4 of the largest entry at the initial state. */
#define ELIMINATION_ROW "PW_SCENE_PIVOT"
#define ELIMINATION_COLUMN "0.04"

static void elimination_guard_row (pw_emitter *e, pw_term pivot, pw_term diagonal) {
  char a[24], b[24];
  int constant = pivot.type != PW_TERM_VARIABLE && diagonal.type != PW_TERM_VARIABLE;
  if (!constant && strcmp (pivot.name, diagonal.name) == 0) return; /* a sum of squares: if 0, a is not finite */
  fprintf (constant ? e->prepare : e->code, "  GUARD (%s > " ELIMINATION_ROW " * %s);\n", pw_term_text (pivot, a),
           pw_term_text (diagonal, b));
}

/* p: the pivot of column c, against all entries of that column. */
static void elimination_guard_column (const pw_elimination *x, pw_emitter *e, int c, pw_term p) {
  if (p.type != PW_TERM_VARIABLE) return;
  fprintf (e->code, "  GUARD (%s * %s > " ELIMINATION_COLUMN " * (", p.name, p.name);
  const char *plus = "";
  for (int i = x->coordinates; i < x->n; i++) {
    pw_term now = AT (i, c), was = x->first[(size_t)i * (size_t)x->n + (size_t)c];
    for (int k = 0; k < 2; k++, now = was) {
      if (elimination_is_zero (now) || (k == 1 && strcmp (AT (i, c).name, was.name) == 0)) continue;
      fprintf (e->code, "%s%s * %s", plus, now.name, now.name);
      plus = " + ";
    }
  }
  fprintf (e->code, "));\n");
}

/* ---- Factorisation ---- */

/* K_ij -= a b, and its mirror image. */
static void elimination_update (pw_elimination *x, pw_emitter *e, int i, int j, pw_term a, pw_term b) {
  AT (i, j) = pw_emit_difference (e, AT (i, j), a, b);
  AT (j, i) = AT (i, j);
}

/* The first velocity p of a body: subtracts the terms of both velocities, of the same mass, from the diagonal entry of an
 * equation in which their entries are the components of a vector of constant length.  Returns 1 if done, and for the second
 * velocity. */
static int elimination_lengths (pw_elimination *x, pw_emitter *e, int i, int p) {
  if (i < x->coordinates || p >= 3 * x->s->bodies || p % 3 == 2) return 0;
  int first = p - p % 3;
  pw_term a = x->first[(size_t)i * (size_t)x->n + (size_t)first],
          b = x->first[(size_t)i * (size_t)x->n + (size_t)first + 1];
  if (!x->length[(size_t)(i - x->coordinates) * (size_t)x->s->bodies + (size_t)(p / 3)]) return 0;
  if (a.type != PW_TERM_VARIABLE || b.type != PW_TERM_VARIABLE) return 0;
  if (strcmp (a.name, AT (i, first).name) != 0 || strcmp (b.name, AT (i, first + 1).name) != 0) return 0;
  if (p > first) return 1;
  a.type = b.type = PW_TERM_CONSTANT;
  pw_term square = pw_emit_difference (e, pw_emit_product (e, a, a), pw_term_negative (b), b);
  AT (i, i) = pw_emit_difference (e, AT (i, i), square, x->inverse[p]);
  return 1;
}

static void elimination_pivot (pw_elimination *x, pw_emitter *e, int p, pw_term inverse) {
  elimination_comment (x, e, p, -1);
  elimination_place (x, p, -1);
  x->inverse[p] = inverse;
  for (int i = 0; i < x->n; i++)
    if (elimination_couples (x, i, p)) FACTOR (i, p) = pw_emit_product (e, AT (i, p), x->inverse[p]);
  for (int i = 0; i < x->n; i++)
    for (int j = 0; j <= i && elimination_couples (x, i, p); j++)
      if (elimination_couples (x, j, p) && !(i == j && elimination_lengths (x, e, i, p)))
        elimination_update (x, e, i, j, FACTOR (i, p), AT (j, p));
}

/* The pivot [ 0 p ; p 0 ] of a massless coordinate c and an equation r. */
static void elimination_pair (pw_elimination *x, pw_emitter *e, int c, int r) {
  elimination_comment (x, e, c, r);
  elimination_place (x, c, r);
  x->inverse[c] = pw_emit_quotient (e, elimination_one, AT (r, c));
  for (int k = 0; k < x->n; k++) {
    if (!elimination_couples (x, k, c)) continue;
    FACTOR (k, c) = pw_emit_product (e, AT (k, c), x->inverse[c]);
    for (int l = 0; l < x->n; l++)
      if (elimination_couples (x, l, r)) elimination_update (x, e, k, l, FACTOR (k, c), AT (l, r));
  }
}

/* 1 if no entry of column j is much larger than that of equation i at the initial state. */
static int elimination_is_large (const pw_elimination *x, int i, int j) {
  double most = 0;
  for (int k = x->coordinates; k < x->n; k++)
    if (elimination_couples (x, k, j)) most = fmax (most, fabs (AT (k, j).value));
  return fabs (AT (i, j).value) > 0.4 * most;
}

/* The next such pair: a pivot of 1, else a constant, else a variable one; of these the one with the least fill-in, which
 * is far below 1000000. */
static int elimination_next_pair (const pw_elimination *x, const double *mass, int *c, int *r) {
  long least = -1;
  for (int j = 0; j < x->coordinates; j++)
    for (int i = x->coordinates; mass[j] == 0 && x->step[j] == x->n && i < x->n; i++) {
      if (!elimination_couples (x, i, j) || !elimination_is_large (x, i, j)) continue;
      long kind = AT (i, j).type == PW_TERM_ONE ? 0 : AT (i, j).type == PW_TERM_CONSTANT ? 1 : 2;
      long cost = kind * 1000000 + (long)(elimination_degree (x, j) - 1) * (elimination_degree (x, i) - 1);
      if (least < 0 || cost < least) least = cost, *c = j, *r = i;
    }
  return least >= 0;
}

/* The next equation: the one with the least fill-in, to which variable pivots add, so that constant ones are preferred;
 * vanishing pivots are last. */
static int elimination_next_row (const pw_elimination *x) {
  int best = -1, least = 0;
  for (int i = x->coordinates; i < x->n; i++) {
    if (x->step[i] != x->n) continue;
    int degree = elimination_degree (x, i) + (elimination_is_zero (AT (i, i)) ? x->n : 0) +
                 (AT (i, i).type == PW_TERM_VARIABLE ? x->n / 2 : 0);
    if (best < 0 || degree < least) best = i, least = degree;
  }
  return best;
}

/* Equations by pairs p, q: with the entries a, b, c of their block, the pivots are a and c - b^2 / a, whose reciprocals
 * 1 / a and a / (a c - b^2) do not wait for each other. */
static int elimination_rows (pw_elimination *x, pw_emitter *e) {
  const size_t n = (size_t)x->n;
  pw_term *first = malloc ((2 * n + 1) * sizeof *first), *before = first + n;
  if (first == NULL) return PW_RESOURCE;
  for (int i = 0; i < x->n; i++) first[i] = AT (i, i);
  int status = PW_OK, p = -1;
  for (int q; (q = elimination_next_row (x)) >= 0; p = p < 0 && AT (q, q).type == PW_TERM_VARIABLE ? q : -1) {
    pw_term b = p < 0 ? pw_term_zero () : AT (q, p);
    if (elimination_is_zero (AT (q, q))) {
      status = PW_RETRY;
      break;
    }
    if (elimination_is_zero (b)) { /* does not depend on p */
      for (int i = 0; i < x->n; i++) before[i] = AT (i, i);
      elimination_guard_row (e, pw_term_negative (AT (q, q)), pw_term_negative (first[q]));
      elimination_pivot (x, e, q, pw_emit_quotient (e, elimination_one, AT (q, q)));
      p = -1;
      continue;
    }
    pw_term a = AT (p, p), det = pw_emit_difference (e, pw_emit_product (e, a, before[q]), b, b);
    elimination_guard_row (e, det, pw_emit_product (e, a, first[q]));
    elimination_pivot (x, e, q, pw_emit_quotient (e, a, det));
  }
  free (first);
  return status;
}

/* Moves variables that the solution needs to F. */
static void elimination_keep (pw_elimination *x, pw_emitter *e, int *slot, pw_term *a) {
  if (a->type != PW_TERM_VARIABLE || a->name[0] != 'x') return;
  int v = atoi (a->name + 1);
  if (slot[v] < 0) fprintf (e->code, "  F[%d] = %s;\n", slot[v] = x->factors++, a->name);
  snprintf (a->name, sizeof a->name, "F[%d]", slot[v]);
}

static int elimination_keep_all (pw_elimination *x, pw_emitter *e) {
  int *slot = malloc (((size_t)e->variables + 1) * sizeof *slot);
  if (slot == NULL) return PW_RESOURCE;
  for (int v = 0; v < e->variables; v++) slot[v] = -1;
  for (int m = 0; m < x->pivots; m++) {
    int p = x->order[m], r = x->partner[m];
    elimination_keep (x, e, slot, &x->inverse[p]);
    for (int i = 0; i < x->n; i++) {
      if (x->step[i] <= m || x->step[i] > x->n) continue;
      if (p < x->coordinates && r < 0)
        elimination_keep (x, e, slot, &AT (i, p));
      else
        elimination_keep (x, e, slot, &FACTOR (i, p));
      if (r >= 0) elimination_keep (x, e, slot, &AT (i, r));
    }
  }
  free (slot);
  return PW_OK;
}

static int elimination_allocate (pw_elimination *x, const pw_term *K) {
  size_t n = (size_t)x->n, terms = 2 * n * n + n;
  x->K = malloc (terms * sizeof *x->K + 3 * (n + 1) * sizeof (int));
  if (x->K == NULL) return PW_RESOURCE;
  x->L = x->K + n * n;
  x->inverse = x->L + n * n;
  x->order = (int *)(void *)(x->K + terms), x->partner = x->order + n, x->step = x->partner + n;
  memcpy (x->K, K, n * n * sizeof *K);
  for (size_t i = 0; i < n * n; i++) x->L[i] = pw_term_zero ();
  return PW_OK;
}

int pw_elimination_open (pw_elimination *x, const pw_system *s, const pw_term *K, const unsigned char *length,
                         const unsigned char *takes_part, pw_emitter *e) {
  *x = (pw_elimination){ .s = s, .first = K, .length = length, .coordinates = s->coords, .n = s->coords + s->rows };
  if (elimination_allocate (x, K) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < x->n; i++) x->step[i] = i < s->coords || takes_part[i - s->coords] ? x->n : x->n + 1;
  for (int c, r; elimination_next_pair (x, s->mass, &c, &r);) {
    elimination_guard_column (x, e, c, AT (r, c));
    elimination_pair (x, e, c, r);
  }
  for (int j = 0; j < s->coords; j++) {
    if (x->step[j] < x->n) continue;
    if (s->mass[j] == 0) return PW_RETRY;
    elimination_pivot (x, e, j, pw_emit_quotient (e, elimination_one, AT (j, j)));
  }
  int status = elimination_rows (x, e);
  return status == PW_OK ? elimination_keep_all (x, e) : status;
}

void pw_elimination_close (pw_elimination *x) {
  free (x->K);
  *x = (pw_elimination){ 0 };
}

/* ---- Solution ---- */

static void elimination_forward (const pw_elimination *x, pw_emitter *e, pw_term *y, int m) {
  int p = x->order[m], r = x->partner[m];
  if (r >= 0) {
    pw_term f = pw_emit_product (e, y[p], x->inverse[p]), gamma = y[r];
    for (int i = 0; i < x->n; i++) {
      if (x->step[i] <= m || x->step[i] > x->n) continue;
      y[i] = pw_emit_difference (e, y[i], AT (i, r), f);
      y[i] = pw_emit_difference (e, y[i], FACTOR (i, p), gamma);
    }
    y[r] = f;
    y[p] = gamma;
    return;
  }
  pw_term z = pw_emit_product (e, y[p], x->inverse[p]);
  for (int i = 0; i < x->n; i++) {
    if (x->step[i] <= m || x->step[i] > x->n) continue;
    y[i] = p < x->coordinates ? pw_emit_difference (e, y[i], AT (i, p), z)
                              : pw_emit_difference (e, y[i], FACTOR (i, p), y[p]);
  }
  y[p] = z;
}

static void elimination_backward (const pw_elimination *x, pw_emitter *e, pw_term *y, int m) {
  int p = x->order[m], r = x->partner[m];
  pw_term sum = r >= 0 ? y[p] : pw_term_zero ();
  for (int i = 0; i < x->n; i++) {
    if (x->step[i] <= m || x->step[i] > x->n) continue;
    if (r >= 0) {
      y[r] = pw_emit_difference (e, y[r], FACTOR (i, p), y[i]);
      sum = pw_emit_difference (e, sum, AT (i, r), y[i]);
    } else if (p < x->coordinates)
      sum = pw_emit_difference (e, sum, AT (i, p), y[i]);
    else
      y[p] = pw_emit_difference (e, y[p], FACTOR (i, p), y[i]);
  }
  if (r >= 0)
    y[p] = pw_emit_product (e, sum, x->inverse[p]);
  else if (p < x->coordinates)
    y[p] = pw_emit_difference (e, y[p], pw_term_negative (sum), x->inverse[p]);
}

void pw_elimination_solve (const pw_elimination *x, pw_emitter *e, pw_term *right) {
  for (int m = 0; m < x->pivots; m++) elimination_forward (x, e, right, m);
  for (int m = x->pivots - 1; m >= 0; m--) elimination_backward (x, e, right, m);
}
