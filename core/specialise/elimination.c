/* Symbolic elimination: the factorisation K = L D L^T with symmetric 1 x 1 and 2 x 2 pivots, and its solution. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "elimination.h"

pw_term pw_term_named (pw_term_type type, const char *array, int i, double value) {
  pw_term a = { type, 1, "", value };
  snprintf (a.name, sizeof a.name, "%s[%d]", array, i);
  return a;
}

const char *pw_term_text (pw_term a, char buffer[24]) {
  if (a.type == PW_TERM_ZERO) return "0";
  snprintf (buffer, 24, "%s%s", a.sign < 0 ? "-" : "", a.type == PW_TERM_ONE ? "1" : a.name);
  return buffer;
}

static pw_term term_negative (pw_term a) {
  a.sign = -a.sign;
  a.value = -a.value;
  return a;
}

/* ---- Terms; these functions write a statement unless none is needed, and return the term of its result ---- */

/* The term sign (a op b): a new variable or constant. */
static pw_term emit_define (pw_emitter *emitter, int constant, int sign, double value, const char *a, char op,
                            const char *b) {
  pw_term out = { constant ? PW_TERM_CONSTANT : PW_TERM_VARIABLE, sign, "", value };
  if (constant)
    snprintf (out.name, sizeof out.name, "C[%d]", emitter->constants++);
  else
    snprintf (out.name, sizeof out.name, "x%d", emitter->variables++);
  fprintf (constant ? emitter->prepare : emitter->code, "  %s%s = %s %c %s;\n", constant ? "" : "const double ",
           out.name, a, op, b);
  return out;
}

static int emit_is_constant (pw_term a) {
  return a.type != PW_TERM_VARIABLE;
}

/* a b */
static pw_term emit_product (pw_emitter *emitter, pw_term a, pw_term b) {
  if (a.type == PW_TERM_ZERO || b.type == PW_TERM_ZERO) return pw_term_zero ();
  if (a.type == PW_TERM_ONE) return a.sign < 0 ? term_negative (b) : b;
  if (b.type == PW_TERM_ONE) return b.sign < 0 ? term_negative (a) : a;
  return emit_define (emitter, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value * b.value, a.name,
                      '*', b.name);
}

/* a - b c */
static pw_term emit_difference (pw_emitter *emitter, pw_term a, pw_term b, pw_term c) {
  char text[60];
  if (b.type == PW_TERM_ZERO || c.type == PW_TERM_ZERO) return a;
  if (a.type == PW_TERM_ZERO) return term_negative (emit_product (emitter, b, c));
  if (emit_is_constant (b) && emit_is_constant (c) && !emit_is_constant (a)) { /* the product once and for all */
    b = emit_product (emitter, b, c);
    c = (pw_term){ PW_TERM_ONE, 1, "1", 1 };
  }
  int constant = emit_is_constant (a) && emit_is_constant (b) && emit_is_constant (c);
  const char *left = b.type == PW_TERM_ONE ? "" : b.name, *right = c.type == PW_TERM_ONE && *left ? "" : c.name;
  snprintf (text, sizeof text, "%s%s%s", left, *left && *right ? " * " : "", right);
  return emit_define (emitter, constant, a.sign, a.value - b.value * c.value, a.name,
                      b.sign * c.sign * a.sign > 0 ? '-' : '+', text);
}

/* a / b */
static pw_term emit_quotient (pw_emitter *emitter, pw_term a, pw_term b) {
  if (b.type == PW_TERM_ONE) return b.sign < 0 ? term_negative (a) : a;
  return emit_define (emitter, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value / b.value, a.name,
                      '/', b.name);
}

/* ---- Elimination ---- */

static const pw_term elimination_one = { PW_TERM_ONE, 1, "1", 1 };

#define AT(p, q) ldl->K[(size_t)(p) * (size_t)ldl->n + (size_t)(q)]
#define FACTOR(p, q) ldl->L[(size_t)(p) * (size_t)ldl->n + (size_t)(q)]
#define ORIGINAL(p, q) ldl->original[(size_t)(p) * (size_t)ldl->n + (size_t)(q)]

/* Loops over the unknowns eliminated after the m-th pivot. */
#define EACH_LATER(i, m)           \
  for (int i = 0; i < ldl->n; i++) \
    if (ldl->step[i] > (m) && ldl->step[i] <= ldl->n)

static int elimination_is_zero (pw_term a) {
  return a.type == PW_TERM_ZERO;
}

/* 1 if unknown i is not eliminated yet and coupled to p. */
static int elimination_couples (const pw_elimination *ldl, int i, int p) {
  return ldl->step[i] == ldl->n && i != p && !elimination_is_zero (AT (i, p));
}

/* The number of unknowns that are not eliminated yet and coupled to p. */
static int elimination_degree (const pw_elimination *ldl, int p) {
  int degree = 0;
  for (int i = 0; i < ldl->n; i++) degree += elimination_couples (ldl, i, p);
  return degree;
}

/* Gives p, and its partner unless it is -1, the next position in the order. */
static void elimination_place (pw_elimination *ldl, int p, int partner) {
  ldl->partner[ldl->pivots] = partner;
  ldl->order[ldl->pivots] = p;
  ldl->step[p] = ldl->pivots++;
  if (partner >= 0) ldl->step[partner] = ldl->step[p];
}

/* ---- Guards ---- */

/* The general engine takes over if the pivot of an equation is not larger than this part of its diagonal entry, or if
 * the square of a variable pivot in a massless coordinate's column is not above this part of its sum of squares. */
#define ELIMINATION_ROW "PW_SCENE_PIVOT"
#define ELIMINATION_COLUMN "0.04" /* (1/5)^2; elimination_is_large demands 2/5 of the largest entry */

static void elimination_guard_row (pw_emitter *emitter, pw_term pivot, pw_term diagonal) {
  char a[24], b[24];
  int constant = pivot.type != PW_TERM_VARIABLE && diagonal.type != PW_TERM_VARIABLE;
  if (!constant && strcmp (pivot.name, diagonal.name) == 0)
    return; /* a sum of squares; evaluation finds it out if it is 0 */
  fprintf (constant ? emitter->prepare : emitter->code, "  GUARD (%s > " ELIMINATION_ROW " * %s);\n",
           pw_term_text (pivot, a), pw_term_text (diagonal, b));
}

/* Compares the pivot of column c with the entries of all equations there, now and before the elimination. */
static void elimination_guard_column (const pw_elimination *ldl, pw_emitter *emitter, int c, pw_term pivot) {
  if (pivot.type != PW_TERM_VARIABLE) return;
  fprintf (emitter->code, "  GUARD (%s * %s > " ELIMINATION_COLUMN " * (", pivot.name, pivot.name);
  const char *plus = "";
  for (int i = ldl->coordinates; i < ldl->n; i++) {
    pw_term now = AT (i, c), was = ORIGINAL (i, c);
    for (int k = 0; k < 2; k++, now = was) {
      if (elimination_is_zero (now) || (k == 1 && strcmp (AT (i, c).name, was.name) == 0)) continue;
      fprintf (emitter->code, "%s%s * %s", plus, now.name, now.name);
      plus = " + ";
    }
  }
  fprintf (emitter->code, "));\n");
}

/* ---- Factorisation ---- */

/* K_ij -= a b, and its mirror image. */
static void elimination_update (pw_elimination *ldl, pw_emitter *emitter, int i, int j, pw_term a, pw_term b) {
  AT (i, j) = emit_difference (emitter, AT (i, j), a, b);
  AT (j, i) = AT (i, j);
}

/* Eliminates unknown p with a 1 x 1 pivot, whose reciprocal is `inverse`. */
static void elimination_pivot (pw_elimination *ldl, pw_emitter *emitter, int p, pw_term inverse) {
  fprintf (emitter->code, "  /* unknown %d */\n", p);
  elimination_place (ldl, p, -1);
  ldl->inverse[p] = inverse;
  for (int i = 0; i < ldl->n; i++)
    if (elimination_couples (ldl, i, p)) FACTOR (i, p) = emit_product (emitter, AT (i, p), ldl->inverse[p]);
  for (int i = 0; i < ldl->n; i++)
    for (int j = 0; j <= i && elimination_couples (ldl, i, p); j++)
      if (elimination_couples (ldl, j, p)) elimination_update (ldl, emitter, i, j, FACTOR (i, p), AT (j, p));
}

/* Eliminates a massless coordinate c and an equation r with the pivot [ 0 d ; d 0 ].  FACTOR (k, c) = K_kc / d is the
 * entry of L in column r. */
static void elimination_pair (pw_elimination *ldl, pw_emitter *emitter, int c, int r) {
  fprintf (emitter->code, "  /* unknowns %d and %d */\n", c, r);
  elimination_place (ldl, c, r);
  ldl->inverse[c] = emit_quotient (emitter, elimination_one, AT (r, c));
  for (int k = 0; k < ldl->n; k++) {
    if (!elimination_couples (ldl, k, c)) continue;
    FACTOR (k, c) = emit_product (emitter, AT (k, c), ldl->inverse[c]);
    for (int l = 0; l < ldl->n; l++)
      if (elimination_couples (ldl, l, r)) elimination_update (ldl, emitter, k, l, FACTOR (k, c), AT (l, r));
  }
}

/* 1 if the entry of equation i in column j can be a pivot: no other one is much larger at the initial state. */
static int elimination_is_large (const pw_elimination *ldl, int i, int j) {
  double most = 0;
  for (int k = ldl->coordinates; k < ldl->n; k++)
    if (elimination_couples (ldl, k, j)) most = fmax (most, fabs (AT (k, j).value));
  return fabs (AT (i, j).value) > 0.4 * most;
}

/* Finds the next pair of a massless coordinate c and an equation r: a pivot of 1, else a constant, else a variable one;
 * among these the one with the least fill-in, which is far below 1e6.  0 if there is none. */
static int elimination_next_pair (const pw_elimination *ldl, const double *mass, int *c, int *r) {
  long least = -1;
  for (int j = 0; j < ldl->coordinates; j++)
    for (int i = ldl->coordinates; mass[j] == 0 && ldl->step[j] == ldl->n && i < ldl->n; i++) {
      if (!elimination_couples (ldl, i, j) || !elimination_is_large (ldl, i, j)) continue;
      long rank = AT (i, j).type == PW_TERM_ONE ? 0 : AT (i, j).type == PW_TERM_CONSTANT ? 1 : 2;
      long cost = rank * 1000000 + (long)(elimination_degree (ldl, j) - 1) * (elimination_degree (ldl, i) - 1);
      if (least < 0 || cost < least) least = cost, *c = j, *r = i;
    }
  return least >= 0;
}

/* The next equation: that of least degree, with an addition for variable pivots, so that constant ones are preferred,
 * and a larger one for zero pivots.  -1 after the last one. */
static int elimination_next_row (const pw_elimination *ldl) {
  int best = -1, least = 0;
  for (int i = ldl->coordinates; i < ldl->n; i++) {
    if (ldl->step[i] != ldl->n) continue;
    int degree = elimination_degree (ldl, i) + (elimination_is_zero (AT (i, i)) ? ldl->n : 0) +
                 (AT (i, i).type == PW_TERM_VARIABLE ? ldl->n / 2 : 0);
    if (best < 0 || degree < least) best = i, least = degree;
  }
  return best;
}

/* Eliminates the equations, coupled ones in pairs p, q: with the entries [ a b ; b c ] of their block, the pivots are a
 * and c - b^2 / a, whose reciprocals 1 / a and a / (a c - b^2) need not be computed one after the other. */
static int elimination_rows (pw_elimination *ldl, pw_emitter *emitter) {
  const size_t n = (size_t)ldl->n;
  pw_term *diagonal = malloc ((2 * n + 1) * sizeof *diagonal); /* of K before the equations are eliminated */
  pw_term *before_p = diagonal + n;                            /* that before p was */
  if (diagonal == NULL) return PW_RESOURCE;
  for (int i = 0; i < ldl->n; i++) diagonal[i] = AT (i, i);
  int status = PW_OK, p = -1; /* p: the equation eliminated last, if the next one may be its q */
  for (int q; status == PW_OK && (q = elimination_next_row (ldl)) >= 0;) {
    if (elimination_is_zero (AT (q, q))) {
      status = PW_RETRY;
    } else if (p < 0 || elimination_is_zero (AT (q, p))) {
      for (int i = 0; i < ldl->n; i++) before_p[i] = AT (i, i);
      elimination_guard_row (emitter, term_negative (AT (q, q)), term_negative (diagonal[q]));
      elimination_pivot (ldl, emitter, q, emit_quotient (emitter, elimination_one, AT (q, q)));
      p = AT (q, q).type == PW_TERM_VARIABLE ? q : -1;
    } else {
      pw_term a = AT (p, p), b = AT (q, p), ac = emit_product (emitter, a, before_p[q]);
      pw_term det = emit_difference (emitter, ac, b, b);
      elimination_guard_row (emitter, det, emit_product (emitter, a, diagonal[q]));
      elimination_pivot (ldl, emitter, q, emit_quotient (emitter, a, det));
      p = -1;
    }
  }
  free (diagonal);
  return status;
}

/* Stores a variable x12, local to the factorisation, in F, unless that is done; slot: its index in F by its number. */
static void elimination_keep (pw_elimination *ldl, pw_emitter *emitter, int *slot, pw_term *a) {
  if (a->type != PW_TERM_VARIABLE || a->name[0] != 'x') return;
  int v = atoi (a->name + 1);
  if (slot[v] < 0) fprintf (emitter->code, "  F[%d] = %s;\n", slot[v] = ldl->factors++, a->name);
  snprintf (a->name, sizeof a->name, "F[%d]", slot[v]);
}

static int elimination_keep_all (pw_elimination *ldl, pw_emitter *emitter) {
  int *slot = malloc (((size_t)emitter->variables + 1) * sizeof *slot);
  if (slot == NULL) return PW_RESOURCE;
  for (int v = 0; v < emitter->variables; v++) slot[v] = -1;
  for (int m = 0; m < ldl->pivots; m++) {
    int p = ldl->order[m], r = ldl->partner[m];
    elimination_keep (ldl, emitter, slot, &ldl->inverse[p]);
    EACH_LATER (i, m) {
      if (p < ldl->coordinates && r < 0)
        elimination_keep (ldl, emitter, slot, &AT (i, p));
      else
        elimination_keep (ldl, emitter, slot, &FACTOR (i, p));
      if (r >= 0) elimination_keep (ldl, emitter, slot, &AT (i, r));
    }
  }
  free (slot);
  return PW_OK;
}

static int elimination_allocate (pw_elimination *ldl, const pw_term *K) {
  size_t n = (size_t)ldl->n, terms = 2 * n * n + n;
  ldl->K = malloc (terms * sizeof *ldl->K + 3 * (n + 1) * sizeof (int));
  if (ldl->K == NULL) return PW_RESOURCE;
  ldl->L = ldl->K + n * n;
  ldl->inverse = ldl->L + n * n;
  ldl->order = (int *)(void *)(ldl->K + terms), ldl->partner = ldl->order + n, ldl->step = ldl->partner + n;
  memcpy (ldl->K, K, n * n * sizeof *K);
  for (size_t i = 0; i < n * n; i++) ldl->L[i] = pw_term_zero ();
  return PW_OK;
}

int pw_elimination_open (pw_elimination *ldl, const pw_system *s, const pw_term *K, const unsigned char *takes_part,
                         pw_emitter *emitter) {
  *ldl = (pw_elimination){ .original = K, .coordinates = s->coords, .n = s->coords + s->rows };
  if (elimination_allocate (ldl, K) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < ldl->n; i++) ldl->step[i] = i < s->coords || takes_part[i - s->coords] ? ldl->n : ldl->n + 1;
  for (int c, r; elimination_next_pair (ldl, s->mass, &c, &r);) {
    elimination_guard_column (ldl, emitter, c, AT (r, c));
    elimination_pair (ldl, emitter, c, r);
  }
  for (int j = 0; j < s->coords; j++) {
    if (ldl->step[j] < ldl->n) continue;
    if (s->mass[j] == 0) return PW_RETRY;
    elimination_pivot (ldl, emitter, j, emit_quotient (emitter, elimination_one, AT (j, j)));
  }
  int status = elimination_rows (ldl, emitter);
  return status == PW_OK ? elimination_keep_all (ldl, emitter) : status;
}

void pw_elimination_close (pw_elimination *ldl) {
  free (ldl->K);
  *ldl = (pw_elimination){ 0 };
}

/* ---- Solution ---- */

/* Divides by the m-th pivot, and eliminates its unknowns from the later rows.  Row p of a pivot [ 0 d ; d 0 ]
 * determines the multiplier of equation r, and row r the coordinate p: their entries of y are exchanged.
 * elimination_backward divides that of the coordinate. */
static void elimination_forward (const pw_elimination *ldl, pw_emitter *emitter, pw_term *y, int m) {
  int p = ldl->order[m], r = ldl->partner[m];
  if (r >= 0) {
    pw_term f = emit_product (emitter, y[p], ldl->inverse[p]), gamma = y[r];
    EACH_LATER (i, m) {
      y[i] = emit_difference (emitter, y[i], AT (i, r), f);
      y[i] = emit_difference (emitter, y[i], FACTOR (i, p), gamma);
    }
    y[r] = f;
    y[p] = gamma;
    return;
  }
  pw_term z = emit_product (emitter, y[p], ldl->inverse[p]);
  EACH_LATER (i, m) {
    y[i] = p < ldl->coordinates ? emit_difference (emitter, y[i], AT (i, p), z)
                                : emit_difference (emitter, y[i], FACTOR (i, p), y[p]);
  }
  y[p] = z;
}

/* Completes the unknowns of the m-th pivot from the later ones. */
static void elimination_backward (const pw_elimination *ldl, pw_emitter *emitter, pw_term *y, int m) {
  int p = ldl->order[m], r = ldl->partner[m];
  pw_term sum = r >= 0 ? y[p] : pw_term_zero ();
  EACH_LATER (i, m) {
    if (r >= 0) {
      y[r] = emit_difference (emitter, y[r], FACTOR (i, p), y[i]);
      sum = emit_difference (emitter, sum, AT (i, r), y[i]);
    } else if (p < ldl->coordinates)
      sum = emit_difference (emitter, sum, AT (i, p), y[i]);
    else
      y[p] = emit_difference (emitter, y[p], FACTOR (i, p), y[i]);
  }
  if (r >= 0)
    y[p] = emit_product (emitter, sum, ldl->inverse[p]);
  else if (p < ldl->coordinates)
    y[p] = emit_difference (emitter, y[p], term_negative (sum), ldl->inverse[p]);
}

void pw_elimination_solve (const pw_elimination *ldl, pw_emitter *emitter, pw_term *right) {
  for (int m = 0; m < ldl->pivots; m++) elimination_forward (ldl, emitter, right, m);
  for (int m = ldl->pivots - 1; m >= 0; m--) elimination_backward (ldl, emitter, right, m);
}
