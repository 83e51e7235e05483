/* Writes C code for one compiled system: the source texts of its element types, called for one element at a time with
 * constant indices, and a factorisation without loops.  scene_head.inc explains the macros in the code. */
#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>
#include <string.h>
#include "specialised.h"
#include "selftest.h"

enum {
  SPECIALISE_ROWS = 60,      /* most constraint equations: code without loops becomes too long */
  SPECIALISE_ELEMENTS = 120, /* most elements: compilation takes about 0.1 s for each */
  SPECIALISE_BODIES = 200,   /* most bodies: the elimination has a dense matrix */
  SPECIALISE_INLINE = 8      /* up to this number of rows all functions are inlined: common parts are computed once */
};

/* Terms are values that generated code has when it runs. */
typedef enum { TERM_ZERO, TERM_ONE, TERM_CONSTANT, TERM_VARIABLE } term_type;

/* sign times 0 (any sign), 1, a constant of a run (M[0], J[3], or C[2] computed by `prepare`), or a variable. */
typedef struct {
  term_type type;
  int sign;
  char name[20]; /* as printed without the sign: "C[3]", "x12", "J[7]" */
  double value;  /* at the initial state, including the sign, to choose pivots; 1 for f and g of solutions */
} term;

/* Where statements go. */
typedef struct {
  FILE *prepare, *code;     /* those that compute constants; the others, of the function being written */
  int constants, variables; /* how many C[0], C[1], ... and x0, x1, ... there are so far */
  pw_arena memory;          /* of all terms, which are 0 at first */
} emitter;

/* array[i] */
static term term_named (term_type type, const char *array, int i, double value) {
  term a = { type, 1, "", value };
  snprintf (a.name, sizeof a.name, "%s[%d]", array, i);
  return a;
}

/* "-x3": the term with its sign, in the buffer unless it is 0. */
static const char *term_text (term a, char buffer[24]) {
  if (a.type == TERM_ZERO) return "0";
  snprintf (buffer, 24, "%s%s", a.sign < 0 ? "-" : "", a.type == TERM_ONE ? "1" : a.name);
  return buffer;
}

static term term_negative (term a) {
  a.sign = -a.sign;
  a.value = -a.value;
  return a;
}

/* The following functions write a statement unless none is needed, and return the term of its result. */

/* The term sign (a op b): a new variable or constant. */
static term emit_define (emitter *to, int constant, int sign, double value, const char *a, char op, const char *b) {
  term out = { constant ? TERM_CONSTANT : TERM_VARIABLE, sign, "", value };
  if (constant)
    snprintf (out.name, sizeof out.name, "C[%d]", to->constants++);
  else
    snprintf (out.name, sizeof out.name, "x%d", to->variables++);
  fprintf (constant ? to->prepare : to->code, "  %s%s = %s %c %s;\n", constant ? "" : "const double ", out.name, a, op,
           b);
  return out;
}

static int emit_is_constant (term a) {
  return a.type != TERM_VARIABLE;
}

/* a b */
static term emit_product (emitter *to, term a, term b) {
  if (a.type == TERM_ZERO || b.type == TERM_ZERO) return (term){ 0 };
  if (a.type == TERM_ONE) return a.sign < 0 ? term_negative (b) : b;
  if (b.type == TERM_ONE) return b.sign < 0 ? term_negative (a) : a;
  return emit_define (to, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value * b.value, a.name, '*',
                      b.name);
}

/* a - b c */
static term emit_difference (emitter *to, term a, term b, term c) {
  char text[60];
  if (b.type == TERM_ZERO || c.type == TERM_ZERO) return a;
  if (a.type == TERM_ZERO) return term_negative (emit_product (to, b, c));
  if (emit_is_constant (b) && emit_is_constant (c) && !emit_is_constant (a)) { /* the product once and for all */
    b = emit_product (to, b, c);
    c = (term){ TERM_ONE, 1, "1", 1 };
  }
  int constant = emit_is_constant (a) && emit_is_constant (b) && emit_is_constant (c);
  const char *left = b.type == TERM_ONE ? "" : b.name, *right = c.type == TERM_ONE && *left ? "" : c.name;
  snprintf (text, sizeof text, "%s%s%s", left, *left && *right ? " * " : "", right);
  return emit_define (to, constant, a.sign, a.value - b.value * c.value, a.name,
                      b.sign * c.sign * a.sign > 0 ? '-' : '+', text);
}

/* a / b */
static term emit_quotient (emitter *to, term a, term b) {
  if (b.type == TERM_ONE) return b.sign < 0 ? term_negative (a) : a;
  return emit_define (to, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value / b.value, a.name, '/',
                      b.name);
}

/* Symbolic elimination of the saddle-point system K = [ M J^T ; J 0 ] of a scene: K = L D L^T with symmetric 1 x 1 and
 * 2 x 2 pivots, in an order fixed when the code is generated: massless coordinates with the constraint equations that
 * determine them, coordinates with mass, constraint equations by least fill-in (Duff, Erisman & Reid 2017, chapters 5
 * and 7). */

typedef struct {
  int coordinates, n;   /* unknowns: the coordinates, then the constraint equations */
  term *K, *L;          /* n x n: K, column p as it was when unknown p was eliminated; L of K = L D L^T */
  term *inverse;        /* n: reciprocal pivots */
  int *order, *partner; /* n: unknowns in their order; partner of a 2 x 2 pivot, or -1 */
  int *step;            /* n: position in the order; n: not eliminated yet; n + 1: takes no part */
  int pivots;           /* entries of `order` so far */
  int factors;          /* entries of F, an array of the generated code */
  const term *original; /* n x n: K before the elimination; the caller's */
} elimination;

static const term elimination_one = { TERM_ONE, 1, "1", 1 };

#define AT(p, q) ldl->K[(size_t)(p) * (size_t)ldl->n + (size_t)(q)]
#define FACTOR(p, q) ldl->L[(size_t)(p) * (size_t)ldl->n + (size_t)(q)]
#define ORIGINAL(p, q) ldl->original[(size_t)(p) * (size_t)ldl->n + (size_t)(q)]

/* Loops over the unknowns eliminated after the m-th pivot. */
#define EACH_LATER(i, m)           \
  for (int i = 0; i < ldl->n; i++) \
    if (ldl->step[i] > (m) && ldl->step[i] <= ldl->n)

static int elimination_is_zero (term a) {
  return a.type == TERM_ZERO;
}

/* 1 if unknown i is not eliminated yet and coupled to p. */
static int elimination_couples (const elimination *ldl, int i, int p) {
  return ldl->step[i] == ldl->n && i != p && !elimination_is_zero (AT (i, p));
}

static int elimination_degree (const elimination *ldl, int p) {
  int degree = 0;
  for (int i = 0; i < ldl->n; i++) degree += elimination_couples (ldl, i, p);
  return degree;
}

/* Gives p, and its partner unless it is -1, the next position in the order. */
static void elimination_place (elimination *ldl, int p, int partner) {
  ldl->partner[ldl->pivots] = partner;
  ldl->order[ldl->pivots] = p;
  ldl->step[p] = ldl->pivots++;
  if (partner >= 0) ldl->step[partner] = ldl->step[p];
}

/* The general engine takes over if the pivot of an equation is not larger than this part of its diagonal entry, or if
 * the square of a variable pivot in a massless coordinate's column is not above this part of its sum of squares. */
#define ELIMINATION_ROW "PW_SCENE_PIVOT"
#define ELIMINATION_COLUMN "0.04" /* (1/5)^2; elimination_next_pair demands 2/5 of the largest entry */

static void elimination_guard_row (emitter *to, term pivot, term diagonal) {
  char a[24], b[24];
  int constant = pivot.type != TERM_VARIABLE && diagonal.type != TERM_VARIABLE;
  if (!constant && strcmp (pivot.name, diagonal.name) == 0)
    return; /* a sum of squares; evaluation finds it out if it is 0 */
  fprintf (constant ? to->prepare : to->code, "  GUARD (%s > " ELIMINATION_ROW " * %s);\n", term_text (pivot, a),
           term_text (diagonal, b));
}

/* Compares the pivot of column c with the entries of all equations there, now and before the elimination. */
static void elimination_guard_column (const elimination *ldl, emitter *to, int c, term pivot) {
  if (pivot.type != TERM_VARIABLE) return;
  fprintf (to->code, "  GUARD (%s * %s > " ELIMINATION_COLUMN " * (", pivot.name, pivot.name);
  const char *plus = "";
  for (int i = ldl->coordinates; i < ldl->n; i++) {
    term now = AT (i, c), was = ORIGINAL (i, c);
    for (int k = 0; k < 2; k++, now = was) {
      if (elimination_is_zero (now) || (k == 1 && strcmp (AT (i, c).name, was.name) == 0)) continue;
      fprintf (to->code, "%s%s * %s", plus, now.name, now.name);
      plus = " + ";
    }
  }
  fprintf (to->code, "));\n");
}

/* Eliminates unknown p with a 1 x 1 pivot, whose reciprocal is `inverse`. */
static void elimination_pivot (elimination *ldl, emitter *to, int p, term inverse) {
  fprintf (to->code, "  /* unknown %d */\n", p);
  elimination_place (ldl, p, -1);
  ldl->inverse[p] = inverse;
  for (int i = 0; i < ldl->n; i++)
    if (elimination_couples (ldl, i, p)) FACTOR (i, p) = emit_product (to, AT (i, p), ldl->inverse[p]);
  for (int i = 0; i < ldl->n; i++)
    for (int j = 0; j <= i && elimination_couples (ldl, i, p); j++)
      if (elimination_couples (ldl, j, p))
        AT (i, j) = AT (j, i) = emit_difference (to, AT (i, j), FACTOR (i, p), AT (j, p));
}

/* Eliminates a massless coordinate c and an equation r with the pivot [ 0 d ; d 0 ].  FACTOR (k, c) = K_kc / d is the
 * entry of L in column r. */
static void elimination_pair (elimination *ldl, emitter *to, int c, int r) {
  fprintf (to->code, "  /* unknowns %d and %d */\n", c, r);
  elimination_place (ldl, c, r);
  ldl->inverse[c] = emit_quotient (to, elimination_one, AT (r, c));
  for (int k = 0; k < ldl->n; k++) {
    if (!elimination_couples (ldl, k, c)) continue;
    FACTOR (k, c) = emit_product (to, AT (k, c), ldl->inverse[c]);
    for (int l = 0; l < ldl->n; l++)
      if (elimination_couples (ldl, l, r))
        AT (k, l) = AT (l, k) = emit_difference (to, AT (k, l), FACTOR (k, c), AT (l, r));
  }
}

/* Finds the next pair of a massless coordinate c and an equation r: a pivot of 1, else a constant, else a variable one;
 * among these the one with the least fill-in, which is far below 1e6.  0 if there is none. */
static int elimination_next_pair (const elimination *ldl, const double *mass, int *c, int *r) {
  long least = -1;
  for (int j = 0; j < ldl->coordinates; j++) {
    double most = 0;
    if (mass[j] != 0 || ldl->step[j] != ldl->n) continue;
    for (int i = ldl->coordinates; i < ldl->n; i++)
      if (elimination_couples (ldl, i, j)) most = fmax (most, fabs (AT (i, j).value));
    for (int i = ldl->coordinates; i < ldl->n; i++) { /* no other entry may be much larger at the initial state */
      if (!elimination_couples (ldl, i, j) || !(fabs (AT (i, j).value) > 0.4 * most)) continue;
      long rank = AT (i, j).type == TERM_ONE ? 0 : AT (i, j).type == TERM_CONSTANT ? 1 : 2;
      long cost = rank * 1000000 + (long)(elimination_degree (ldl, j) - 1) * (elimination_degree (ldl, i) - 1);
      if (least < 0 || cost < least) least = cost, *c = j, *r = i;
    }
  }
  return least >= 0;
}

/* The next equation: that of least degree, with an addition for variable pivots, so that constant ones are preferred,
 * and a larger one for zero pivots.  -1 after the last one. */
static int elimination_next_row (const elimination *ldl) {
  int best = -1, least = 0;
  for (int i = ldl->coordinates; i < ldl->n; i++) {
    if (ldl->step[i] != ldl->n) continue;
    int degree = elimination_degree (ldl, i) + (elimination_is_zero (AT (i, i)) ? ldl->n : 0) +
                 (AT (i, i).type == TERM_VARIABLE ? ldl->n / 2 : 0);
    if (best < 0 || degree < least) best = i, least = degree;
  }
  return best;
}

/* Eliminates the equations, coupled ones in pairs p, q: with the entries [ a b ; b c ] of their block, the pivots are a
 * and c - b^2 / a, whose reciprocals 1 / a and a / (a c - b^2) need not be computed one after the other. */
static int elimination_rows (elimination *ldl, emitter *to) {
  const size_t n = (size_t)ldl->n;
  term *diagonal = pw_arena_alloc (&to->memory, 2 * n * sizeof *diagonal); /* of K before this elimination */
  term *before_p = diagonal + n;                                           /* that before p was eliminated */
  if (diagonal == NULL) return PW_RESOURCE;
  for (int i = 0; i < ldl->n; i++) diagonal[i] = AT (i, i);
  int p = -1; /* the equation eliminated last, if the next one may be its q */
  for (int q; (q = elimination_next_row (ldl)) >= 0;) {
    if (elimination_is_zero (AT (q, q))) return PW_RETRY;
    if (p < 0 || elimination_is_zero (AT (q, p))) {
      for (int i = 0; i < ldl->n; i++) before_p[i] = AT (i, i);
      elimination_guard_row (to, term_negative (AT (q, q)), term_negative (diagonal[q]));
      elimination_pivot (ldl, to, q, emit_quotient (to, elimination_one, AT (q, q)));
      p = AT (q, q).type == TERM_VARIABLE ? q : -1;
    } else {
      term a = AT (p, p), b = AT (q, p), ac = emit_product (to, a, before_p[q]);
      term det = emit_difference (to, ac, b, b);
      elimination_guard_row (to, det, emit_product (to, a, diagonal[q]));
      elimination_pivot (ldl, to, q, emit_quotient (to, a, det));
      p = -1;
    }
  }
  return PW_OK;
}

/* Stores a variable x12, local to the factorisation, in F, unless that is done; slot[12]: 1 plus its index in F. */
static void elimination_keep (elimination *ldl, emitter *to, int *slot, term *a) {
  if (a->type != TERM_VARIABLE || a->name[0] != 'x') return;
  int v = atoi (a->name + 1);
  if (slot[v] == 0) {
    slot[v] = ++ldl->factors;
    fprintf (to->code, "  F[%d] = %s;\n", slot[v] - 1, a->name);
  }
  snprintf (a->name, sizeof a->name, "F[%d]", slot[v] - 1);
}

static int elimination_keep_all (elimination *ldl, emitter *to) {
  int *slot = pw_arena_alloc (&to->memory, (size_t)to->variables * sizeof *slot);
  if (slot == NULL) return PW_RESOURCE;
  for (int m = 0; m < ldl->pivots; m++) {
    int p = ldl->order[m], r = ldl->partner[m];
    elimination_keep (ldl, to, slot, &ldl->inverse[p]);
    EACH_LATER (i, m) {
      elimination_keep (ldl, to, slot, p < ldl->coordinates && r < 0 ? &AT (i, p) : &FACTOR (i, p));
      if (r >= 0) elimination_keep (ldl, to, slot, &AT (i, r));
    }
  }
  return PW_OK;
}

/* K: n x n, symmetric, n = coordinates + rows; takes_part: rows, 0 for an equation that is ignored.
 * Writes the statements of the factorisation; the last of them store in F what the solution needs.  PW_RETRY if a
 * massless coordinate is determined by no equation, or an equation has no pivot; PW_RESOURCE. */
static int elimination_open (elimination *ldl, const pw_system *s, const term *K, const unsigned char *takes_part,
                             emitter *to) {
  *ldl = (elimination){ .original = K, .coordinates = s->coords, .n = s->coords + s->rows };
  const size_t n = (size_t)ldl->n, terms = 2 * n * n + n;
  ldl->K = pw_arena_alloc (&to->memory, terms * sizeof *ldl->K + 3 * n * sizeof (int));
  if (ldl->K == NULL) return PW_RESOURCE;
  ldl->L = ldl->K + n * n, ldl->inverse = ldl->L + n * n;
  ldl->order = (int *)(void *)(ldl->K + terms), ldl->partner = ldl->order + n, ldl->step = ldl->partner + n;
  memcpy (ldl->K, K, n * n * sizeof *K);
  for (int i = 0; i < ldl->n; i++) ldl->step[i] = i < s->coords || takes_part[i - s->coords] ? ldl->n : ldl->n + 1;
  for (int c, r; elimination_next_pair (ldl, s->mass, &c, &r);) {
    elimination_guard_column (ldl, to, c, AT (r, c));
    elimination_pair (ldl, to, c, r);
  }
  for (int j = 0; j < s->coords; j++) {
    if (ldl->step[j] < ldl->n) continue;
    if (s->mass[j] == 0) return PW_RETRY;
    elimination_pivot (ldl, to, j, emit_quotient (to, elimination_one, AT (j, j)));
  }
  int status = elimination_rows (ldl, to);
  return status == PW_OK ? elimination_keep_all (ldl, to) : status;
}

/* Divides by the m-th pivot, and eliminates its unknowns from the later rows.  Row p of a pivot [ 0 d ; d 0 ]
 * determines the multiplier of equation r, and row r the coordinate p: their entries of y are exchanged.
 * elimination_backward divides that of the coordinate. */
static void elimination_forward (const elimination *ldl, emitter *to, term *y, int m) {
  int p = ldl->order[m], r = ldl->partner[m];
  if (r >= 0) {
    term f = emit_product (to, y[p], ldl->inverse[p]), gamma = y[r];
    EACH_LATER (i, m) {
      y[i] = emit_difference (to, y[i], AT (i, r), f);
      y[i] = emit_difference (to, y[i], FACTOR (i, p), gamma);
    }
    y[r] = f;
    y[p] = gamma;
    return;
  }
  term z = emit_product (to, y[p], ldl->inverse[p]);
  EACH_LATER (i, m) {
    y[i] = p < ldl->coordinates ? emit_difference (to, y[i], AT (i, p), z)
                                : emit_difference (to, y[i], FACTOR (i, p), y[p]);
  }
  y[p] = z;
}

/* Completes the unknowns of the m-th pivot from the later ones. */
static void elimination_backward (const elimination *ldl, emitter *to, term *y, int m) {
  int p = ldl->order[m], r = ldl->partner[m];
  term sum = r >= 0 ? y[p] : (term){ 0 };
  EACH_LATER (i, m) {
    if (r >= 0) {
      y[r] = emit_difference (to, y[r], FACTOR (i, p), y[i]);
      sum = emit_difference (to, sum, AT (i, r), y[i]);
    } else if (p < ldl->coordinates)
      sum = emit_difference (to, sum, AT (i, p), y[i]);
    else
      y[p] = emit_difference (to, y[p], FACTOR (i, p), y[i]);
  }
  if (r >= 0)
    y[p] = emit_product (to, sum, ldl->inverse[p]);
  else if (p < ldl->coordinates)
    y[p] = emit_difference (to, y[p], term_negative (sum), ldl->inverse[p]);
}

/* Sparsity of element types, found at random states of random scenes.  All entries of a plug-in's type count as
 * variable: the force of a wall, for example, is 0 at most states.  So do those of a type that rejects random
 * definitions, and those of a force that is 0 at all these states.  Elements on the ground, with more constant entries,
 * are ignored. */

enum { SPARSITY_SCENES = 12, SPARSITY_STATES = 4 };

typedef struct {
  /* rows x cols: TERM_ZERO, TERM_ONE or -TERM_ONE for every definition; TERM_CONSTANT during a motion; or
   * TERM_VARIABLE */
  signed char J[PW_MAX_ROWS * PW_MAX_COLS];
  signed char force[PW_MAX_COLS]; /* cols: TERM_ZERO or TERM_VARIABLE */
} sparsity;

/* The type of an entry with this value that has not changed. */
static signed char sparsity_of_value (double value) {
  return value == 0 ? TERM_ZERO : value == 1 ? TERM_ONE : value == -1 ? -TERM_ONE : TERM_CONSTANT;
}

/* Merges the entries of element e at one state into `out`.  first: its entries of J at the scene's first state, stored
 * if is_first; known: 1 if `out` has entries already. */
static void sparsity_state (const pw_element_batch *k, int e, int is_first, int known, double *first, sparsity *out) {
  int n = k->kind->rows * k->b.cols;
  for (int i = 0; i < n; i++) {
    double value = k->J[e * n + i];
    if (is_first) first[i] = value;
    if (!known) out->J[i] = sparsity_of_value (value);
    if (value != first[i]) out->J[i] = TERM_VARIABLE;
    if (out->J[i] < TERM_CONSTANT && out->J[i] != sparsity_of_value (value)) out->J[i] = TERM_CONSTANT;
  }
  for (int c = 0; k->kind->force && c < k->b.cols; c++)
    if (k->block[e * k->b.cols + c] != 0) out->force[c] = TERM_VARIABLE;
}

static int sparsity_scene (const pw_system *s, pw_random *random, int *known, sparsity *out) {
  double q[PW_SCENE_COORDS], v[PW_SCENE_COORDS], first[PW_SCENE_BATCH][PW_MAX_ROWS * PW_MAX_COLS];
  pw_workspace *w = pw_workspace_new (s, NULL);
  if (w == NULL) return PW_RESOURCE;
  pw_element_batch *k = w->batch; /* the only one */
  for (int state = 0; state < SPARSITY_STATES; state++) {
    for (int j = 0; j < s->coords; j++) {
      q[j] = s->q0[j] + pw_random_between (random, -2, 2);
      v[j] = pw_random_between (random, -2, 2);
    }
    if (pw_update_kinematics (w, pw_random_between (random, 0, 3), q, v) != PW_OK) break;
    pw_evaluate_J (w);
    if (k->kind->force) k->kind->force (&k->b, k->block);
    for (int e = 0; e < k->b.count; e++) {
      int is_grounded = 0;
      for (int n = 0; n < k->kind->bodies; n++) is_grounded |= k->column[e * k->kind->bodies + n] >= s->coords;
      if (is_grounded) continue;
      sparsity_state (k, e, state == 0, *known, first[e], out);
      *known = 1;
    }
  }
  pw_workspace_free (w);
  return PW_OK;
}

static int sparsity_find (const pw_kind *kind, sparsity *out) {
  pw_random random = { .state = 7 };
  int known = 0, status = PW_OK;
  memset (out, 0, sizeof *out);
  for (int n = 0; pw_kind_is_built_in (kind) && n < SPARSITY_SCENES && status == PW_OK; n++) {
    pw_error why = { 0 };
    pw_system *s = pw_random_scene (kind, &random, &why);
    status = s ? sparsity_scene (s, &random, &known, out) : why.status == PW_RESOURCE ? PW_RESOURCE : PW_OK;
    pw_system_free (s);
  }
  if (!known) memset (out, TERM_VARIABLE, sizeof *out);
  if (kind->force && memchr (out->force, TERM_VARIABLE, sizeof out->force) == NULL)
    memset (out->force, TERM_VARIABLE, sizeof out->force);
  return status;
}

typedef struct {
  const pw_system *s;
  const unsigned char *independent; /* as in pw_system_source */
  FILE *out;                        /* the generated code */
  pw_workspace *w;                  /* at the initial state */
  sparsity *sparsity;               /* batches */
  pw_stream prepare;                /* statements of the generated function `prepare` */
  emitter emitter;
} generator;

#define WRITE(...) fprintf (gen->out, __VA_ARGS__)

static int specialise_J (const generator *gen, int k, int e) {
  const pw_element_batch *batch = &gen->w->batch[k];
  return (int)(batch->J - gen->w->J) + e * batch->kind->rows * batch->b.cols;
}

static int specialise_is_independent (const generator *gen, int row) {
  return gen->independent == NULL || gen->independent[row];
}

/* "rolling_wheel", in the buffer, which is returned. */
static char *specialise_identifier (const pw_kind *kind, char *buffer, size_t size) {
  snprintf (buffer, size, "%s", kind->name);
  for (char *c = buffer; *c; c++)
    if (*c == '-') *c = '_';
  return buffer;
}

/* #define EACH_name(X) X (0) X (1) ...: a loop without a counter, so that arrays stay in registers. */
static void specialise_list (FILE *out, const char *name, int n) {
  fprintf (out, "#define EACH_%s(X)", name);
  for (int i = 0; i < n; i++) fprintf (out, " X (%d)", i);
  fputc ('\n', out);
}

typedef struct {
  const char *name;        /* "pin.c" */
  const char *const *line; /* each with its line end; ends with NULL */
} source_text;
#include "source_texts.inc" /* written by the build: source_texts, which ends with a NULL name */

enum { SPECIALISE_TEXTS = sizeof source_texts / sizeof *source_texts };

/* Writes the text of a source file, unless it is marked in `done` or not in source_texts (pinwheel.h), after the texts
 * of the headers that it includes. */
static void specialise_text (FILE *out, const char *name, unsigned char done[SPECIALISE_TEXTS]) {
  char header[80], hint[PW_HINT];
  const int i = pw_find_name (source_texts, sizeof *source_texts, name, hint);
  if (i < 0 || done[i]) return;
  done[i] = 1;
  for (const char *const *line = source_texts[i].line; *line; line++)
    if (sscanf (*line, "#include \"%79[a-z_0-9.]\"", header) == 1) specialise_text (out, header, done);
  fprintf (out, "\n/* ---- %s ---- */\n\n", name);
  for (const char *const *line = source_texts[i].line; *line; line++)
    if (strncmp (*line, "#include \"", 10) != 0) fputs (*line, out);
}

/* Opens a block with a batch `b` of element e alone; `more` ends the initialiser of b. */
static void specialise_batch (const generator *gen, int k, int e, const char *more) {
  const pw_element_batch *batch = &gen->s->batch[k];
  WRITE ("  { /* %s */\n    static const int body[] = { ", batch->name[e]);
  for (int n = 0; n < batch->kind->bodies; n++)
    WRITE ("%s%d", n ? ", " : "", batch->b.body[e * batch->kind->bodies + n]);
  WRITE ("%s };\n    const pw_batch b = { .count = 1, .cols = %d, .body = body, .configuration = c,\n",
         batch->kind->bodies ? "" : "0", batch->b.cols);
  WRITE ("      .element = (const char *)s->element[%d] + %zu", k, (size_t)e * batch->kind->element);
  if (batch->kind->internal)
    WRITE (", .q = q + %d, .v = v + %d", batch->internal + e * batch->kind->internal,
           batch->internal + e * batch->kind->internal);
  if (batch->kind->signals)
    WRITE (", .u = s->u + %d", 3 * ((int)(batch->source - gen->s->source) + e * batch->kind->signals));
  WRITE ("%s };\n", more);
}

/* Writes the call of a function of the type of batch k, which stores the result at `to`.  scene_TYPE is the table of a
 * built-in type in the code: the Makefile renames pw_kind_TYPE. */
static void specialise_call (const generator *gen, int k, const char *function, const char *to) {
  char name[80];
  const pw_kind *kind = gen->s->batch[k].kind;
  if (pw_kind_is_built_in (kind))
    WRITE ("    scene_%s.%s (&b, %s);\n", specialise_identifier (kind, name, sizeof name), function, to);
  else
    WRITE ("    s->kind[%d]->%s (&b, %s);\n", k, function, to);
}

/* The parameters of the generated functions, and statements that mark them as used. */
#define ARGUMENTS "const pw_scene *s, const pw_configuration *c, const double *q, const double *v, double *out"
#define UNUSED "  (void)s, (void)c, (void)q, (void)v, (void)out;\n"

/* Writes a function of the first `rows` constraint equations, which fills J, or one number for each equation, by calls
 * of `function`, the member of the types' tables at `offset`; zeros for types where that is NULL. */
static void specialise_rows (const generator *gen, const char *name, const char *function, size_t offset, int rows) {
  char to[40];
  WRITE ("\nINLINE void %s (" ARGUMENTS ") {\n" UNUSED, name);
  for (int k = 0; k < gen->s->constraints && gen->s->batch[k].row < rows; k++) {
    const pw_element_batch *batch = &gen->s->batch[k];
    for (int e = 0; e < batch->b.count; e++) {
      int first = e * batch->kind->rows, exists = pw_kind_function (batch->kind, offset) != NULL;
      for (int r = 0; !exists && r < batch->kind->rows; r++) WRITE ("  out[%d] = 0;\n", batch->row + first + r);
      if (!exists) continue;
      specialise_batch (gen, k, e, "");
      int at = offset == offsetof (pw_kind, J) ? specialise_J (gen, k, e) : batch->row + first;
      snprintf (to, sizeof to, "out + %d", at);
      specialise_call (gen, k, function, to);
      WRITE ("  }\n");
    }
  }
  WRITE ("}\n");
}

/* Which forces act on coordinate j: 0, or a sum of these. */
enum { SPECIALISE_CONSTANT = 1, SPECIALISE_CHANGING = 2 };

static int specialise_forces_on (const generator *gen, int j) {
  int forces = 0;
  for (int k = 0; k < gen->s->batches; k++) {
    const pw_element_batch *batch = &gen->s->batch[k];
    for (int i = 0; batch->kind->force && i < batch->b.count * batch->b.cols; i++)
      if (gen->sparsity[k].force[i % batch->b.cols] != TERM_ZERO &&
          pw_global (batch, i / batch->b.cols, i % batch->b.cols) == j)
        forces |= batch->kind->constant ? SPECIALISE_CONSTANT : SPECIALISE_CHANGING;
  }
  return forces;
}

static void specialise_forces (const generator *gen) {
  const pw_system *s = gen->s;
  WRITE ("\nINLINE void forces (" ARGUMENTS ") {\n" UNUSED);
  for (int j = 0; j < s->coords; j++)
    WRITE (specialise_forces_on (gen, j) & SPECIALISE_CONSTANT ? "  out[%d] = s->force[%d];\n" : "  out[%d] = 0;\n", j,
           j);
  for (int k = 0; k < s->batches; k++) {
    const pw_element_batch *batch = &s->batch[k];
    for (int e = 0; batch->kind->force && !batch->kind->constant && e < batch->b.count; e++) {
      specialise_batch (gen, k, e, "");
      WRITE ("    double f[%d];\n", batch->b.cols);
      specialise_call (gen, k, "force", "f");
      for (int c = 0; c < batch->b.cols; c++)
        if (gen->sparsity[k].force[c] != TERM_ZERO && pw_global (batch, e, c) < s->coords)
          WRITE ("    out[%d] += f[%d];\n", pw_global (batch, e, c), c);
      WRITE ("  }\n");
    }
  }
  WRITE ("}\n");
}

/* Writes the function of the ledger's powers (pw_evaluate_ledger); that of a constraint is -lambda^T eta by default. */
static void specialise_ledger (const generator *gen) {
  const pw_system *s = gen->s;
  char more[40];
  WRITE ("\nINLINE void ledger (const pw_scene *s, const pw_configuration *c, const double *q, const double *v,\n"
         "                           const double *lambda, double *out) {\n" UNUSED "  (void)lambda;\n");
  for (int i = 0; i < s->entries; i++) {
    const pw_element_batch *batch = &s->batch[s->entry[i].batch];
    int k = s->entry[i].batch, e = s->entry[i].element, rows = batch->kind->rows, row = batch->row + e * rows;
    int by_eta = rows > 0 && s->entry[i].type == PW_WORK && batch->kind->power == NULL;
    snprintf (more, sizeof more, ", .lambda = lambda + %d", row);
    specialise_batch (gen, k, e, more);
    WRITE ("    double y[%d];\n", rows > 0 ? rows : 1);
    specialise_call (gen, k, by_eta ? "eta" : s->entry[i].type == PW_WORK ? "power" : "loss", "y");
    WRITE ("    out[%d] = ", i);
    if (!by_eta) WRITE ("y[0]");
    for (int r = 0; by_eta && r < rows; r++) WRITE ("%s - lambda[%d] * y[%d]", r ? "" : "0", row + r, r);
    WRITE (";\n  }\n");
  }
  WRITE ("}\n");
}

/* 1 if all signals are constants or harmonics of time, which generated code evaluates itself. */
static int specialise_is_simple (const pw_system *s) {
  for (int i = 0; i < s->sources; i++)
    if (s->source[i].of_coordinate ||
        (s->source[i].signal.type != PW_CONSTANT && s->source[i].signal.type != PW_HARMONIC))
      return 0;
  return 1;
}

/* If a signal is neither, `update` evaluates all of them; for several runs at once lanes_signals calls it. */
static void specialise_signals (const generator *gen) {
  const pw_system *s = gen->s;
  const int simple = specialise_is_simple (s);
  WRITE ("\nGUARDED signals (pw_scene *s, double t, const double *q, const double *v) {\n  GUARDS;\n"
         "  (void)s, (void)t, (void)q, (void)v;\n");
  if (!simple)
    WRITE ("#ifndef PW_LANES\n  %sreturn s->update (s->workspace, t, q, v);\n#endif\n",
           s->state_dependent ? "" : "if (t != *s->t_signal) ");
  for (int i = 0; i < s->sources && simple; i++) {
    if (i == 0) WRITE ("  SIGNALS_BEGIN (t);\n");
    if (s->source[i].signal.type == PW_CONSTANT) {
      WRITE ("  s->u[%d] = CONSTANT (%d);\n", 3 * i, i);
      if (!s->source[i].of_force) WRITE ("  s->u[%d] = s->u[%d] = 0;\n", 3 * i + 1, 3 * i + 2);
    } else
      WRITE ("  GUARD_CALL (harmonic (HARMONIC (%d), t, %d, s->u + %d));\n", i, !s->source[i].of_force, 3 * i);
  }
  if (simple) WRITE ("  SIGNALS_END (t);\n");
  WRITE ("  GUARDS_HOLD;\n}\n");
}

/* A run's data, as doubles: the elements of all batches, then for each signal a pw_harmonic or a constant and zeros. */
static void specialise_data (const generator *gen) {
  const pw_system *s = gen->s;
  const int per_signal = sizeof (pw_harmonic) / sizeof (double);
  int data = 0;
  WRITE ("\nstatic const int datum_begin[] = { ");
  for (int k = 0; k < s->batches; k++) {
    WRITE ("%d, ", data);
    data += s->batch[k].b.count * (int)(s->batch[k].kind->element / sizeof (double));
  }
  WRITE ("%d };\nenum { BATCHES = %d, SIGNALS = %d, SIMPLE = %d, DATA = %d, FIXED = %d };\n", data, s->batches,
         s->sources, specialise_is_simple (s), data + per_signal * s->sources, gen->emitter.constants);
  WRITE ("static const unsigned char is_harmonic[] = { ");
  for (int i = 0; i < s->sources; i++) WRITE ("%d, ", s->source[i].signal.type == PW_HARMONIC);
  WRITE ("0 };\n");
  specialise_list (gen->out, "DATUM", data + per_signal * s->sources);
  specialise_list (gen->out, "SIGNAL", 3 * s->sources);
  specialise_list (gen->out, "ENTRY", (int)s->jacobian);
  specialise_list (gen->out, "FIXED", gen->emitter.constants); /* pw_scene.constant */
  specialise_list (gen->out, "LEDGER", s->entries);
  specialise_list (gen->out, "BATCH", s->batches + 1); /* the last one: the signals */
  specialise_list (gen->out, "WATCH", (int)(sizeof (pw_scene_watch) / sizeof (double)));
}

static term specialise_entry (const generator *gen, int k, int e, int r, int c) {
  const int cols = gen->s->batch[k].b.cols, type = gen->sparsity[k].J[r * cols + c];
  const int at = specialise_J (gen, k, e) + r * cols + c;
  if (type == TERM_ZERO) return (term){ 0 };
  if (type == TERM_ONE || type == -TERM_ONE) return (term){ TERM_ONE, type, "1", type };
  return term_named ((term_type)type, "J", at, gen->w->J[at]);
}

/* Loops over row r of element e of batch k; i: its constraint equation. */
#define EACH_EQUATION(k, e, r, i)                      \
  for (int k = 0, i = 0; k < gen->s->constraints; k++) \
    for (int e = 0; e < gen->s->batch[k].b.count; e++) \
      for (int r = 0; r < gen->s->batch[k].kind->rows; r++, i++)

/* K = [ M J^T ; J 0 ] */
static term *specialise_matrix (generator *gen) {
  const pw_system *s = gen->s;
  size_t n = (size_t)(s->coords + s->rows);
  term *K = pw_arena_alloc (&gen->emitter.memory, n * n * sizeof *K);
  if (K == NULL) return NULL;
  for (int j = 0; j < s->coords; j++)
    if (s->mass[j] > 0) /* one mass for vx and vy */
      K[(size_t)j * n + (size_t)j] = term_named (TERM_CONSTANT, "M", j - (j < 3 * s->bodies && j % 3 == 1), s->mass[j]);
  EACH_EQUATION (k, e, r, row)
  for (int c = 0; c < s->batch[k].b.cols; c++) {
    size_t i = (size_t)(s->coords + row), j = (size_t)pw_global (&s->batch[k], e, c);
    if (j < (size_t)s->coords) K[i * n + j] = K[j * n + i] = specialise_entry (gen, k, e, r, c);
  }
  return K;
}

/* Writes the product of row r of element e with w; absolute: the sum of the absolute values of its terms. */
static void specialise_row_product (const generator *gen, int k, int e, int r, int absolute) {
  const char *plus = "";
  for (int c = 0; c < gen->s->batch[k].b.cols; c++) {
    int j = pw_global (&gen->s->batch[k], e, c);
    term a = j < gen->s->coords ? specialise_entry (gen, k, e, r, c) : (term){ 0 };
    if (a.type == TERM_ZERO) continue;
    WRITE ("%s%s", absolute || a.sign > 0 ? plus : *plus ? " - " : "-", absolute ? "fabs (" : "");
    if (a.type != TERM_ONE) WRITE ("%s * ", a.name);
    WRITE ("w[%d]%s", j, absolute ? ")" : "");
    plus = " + ";
  }
  fputs (*plus ? ";\n" : "0;\n", gen->out);
}

/* Writes the function `product`: out = J w; size: the sums of the absolute values of its terms. */
static void specialise_product (const generator *gen) {
  WRITE ("\nINLINE void product (const double *J, const double *w, double *out, double *size) {\n  (void)J, (void)w, "
         "(void)out, (void)size;\n");
  EACH_EQUATION (k, e, r, i) {
    WRITE ("  out[%d] = ", i);
    specialise_row_product (gen, k, e, r, 0);
    WRITE ("  size[%d] = ", i);
    specialise_row_product (gen, k, e, r, 1);
  }
  WRITE ("}\n");
}

typedef enum { SPECIALISE_ACCELERATION, SPECIALISE_VELOCITY, SPECIALISE_POSITION } specialise_unknown;

/* Writes the function `solve`, which computes accelerations and multipliers from forces f and right-hand sides g, or
 * solve_velocity or solve_position: changes of velocities or positions from right-hand sides g alone. */
static int specialise_solve (generator *gen, const elimination *ldl, specialise_unknown unknown) {
  static const char *const name[] = { "solve", "solve_velocity", "solve_position" };
  const pw_system *s = gen->s;
  char text[24], next[24];
  term *right = pw_arena_alloc (&gen->emitter.memory, (size_t)ldl->n * sizeof *right);
  if (right == NULL) return PW_RESOURCE;
  for (int i = 0; i < ldl->n; i++) {
    const int row = i - s->coords, is_used = unknown != SPECIALISE_POSITION || row < s->holonomic;
    if (row >= 0 && is_used && specialise_is_independent (gen, row)) right[i] = term_named (TERM_VARIABLE, "g", row, 1);
    if (row < 0 && unknown == SPECIALISE_ACCELERATION && specialise_forces_on (gen, i))
      right[i] = term_named (TERM_VARIABLE, "f", i, 1);
  }
  WRITE ("\nINLINE void %s (const double *C, const double *J, const double *F, %sconst double *g, double *a%s) {\n"
         "  (void)C, (void)J, (void)F, (void)g, (void)a;\n",
         name[unknown], unknown == SPECIALISE_ACCELERATION ? "const double *f, " : "",
         unknown == SPECIALISE_ACCELERATION ? ", double *lambda" : "");
  for (int m = 0; m < ldl->pivots; m++) elimination_forward (ldl, &gen->emitter, right, m);
  for (int m = ldl->pivots - 1; m >= 0; m--) elimination_backward (ldl, &gen->emitter, right, m);
  for (int j = 0; j + 1 < s->coords; j += 2)
    WRITE ("  STORE_PAIR (a + %d, %s, %s);\n", j, term_text (right[j], text), term_text (right[j + 1], next));
  if (s->coords % 2) WRITE ("  a[%d] = %s;\n", s->coords - 1, term_text (right[s->coords - 1], text));
  for (int i = 0; i < s->rows && unknown == SPECIALISE_ACCELERATION; i++)
    WRITE ("  lambda[%d] = %s;\n", i, term_text (right[s->coords + i], text));
  WRITE ("}\n");
  return PW_OK;
}

/* Writes a function that factorises K with the independent equations among the first `rows`; ldl: for its solution. */
static int specialise_factor (generator *gen, elimination *ldl, const term *K, const char *name, int rows) {
  unsigned char takes_part[SPECIALISE_ROWS + 1];
  for (int i = 0; i < gen->s->rows; i++) takes_part[i] = i < rows && specialise_is_independent (gen, i);
  pw_stream text;
  FILE *out = gen->emitter.code = pw_stream_open (&text);
  int status = out ? elimination_open (ldl, gen->s, K, takes_part, &gen->emitter) : PW_RESOURCE;
  if (pw_stream_close (out, &text) != PW_OK) status = PW_RESOURCE;
  gen->emitter.code = gen->out;
  if (status == PW_OK)
    WRITE ("\nGUARDED %s (const double *M, const double *C, const double *J, double *F) {\n  GUARDS;\n"
           "  (void)M, (void)C, (void)J, (void)F;\n%s  GUARDS_HOLD;\n}\n",
           name, text.text);
  free (text.text);
  return status;
}

static int specialise_algebra (generator *gen) {
  const pw_system *s = gen->s;
  elimination all = { 0 }, position = { 0 };
  gen->emitter.prepare = pw_stream_open (&gen->prepare), gen->emitter.code = gen->out;
  specialise_product (gen);
  term *K = specialise_matrix (gen);
  int status = K && gen->emitter.prepare ? specialise_factor (gen, &all, K, "factor", s->rows) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (gen, &all, SPECIALISE_ACCELERATION);
  if (status == PW_OK) status = specialise_solve (gen, &all, SPECIALISE_VELOCITY);
  int alone = PW_OK; /* PW_RETRY if the holonomic equations alone do not determine the massless coordinates */
  if (status == PW_OK) alone = specialise_factor (gen, &position, K, "factor_position", s->holonomic);
  if (alone == PW_RESOURCE) status = PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (gen, alone == PW_OK ? &position : &all, SPECIALISE_POSITION);
  WRITE ("\nenum { FACTORS = %d };\n", 1 + (all.factors > position.factors ? all.factors : position.factors));
  if (alone != PW_OK) WRITE ("#define factor_position factor\n");
  if (pw_stream_close (gen->emitter.prepare, &gen->prepare) != PW_OK) status = PW_RESOURCE;
  return status;
}

static void specialise_constants (const generator *gen) {
  const pw_system *s = gen->s;
  WRITE ("\n/* ---- The scene ---- */\n\nenum { BODIES = %d, N = %d, ROWS = %d, HOLONOMIC = %d, INTERNAL = %d,\n"
         "  ENTRIES = %d, REDUNDANT = %d, LEDGER = %d, RHEONOMIC = %d, STATE_DEPENDENT = %d };\n",
         s->bodies, s->coords, s->rows, s->holonomic, s->coords - 3 * s->bodies, (int)s->jacobian,
         gen->independent != NULL, s->entries, s->rheonomic > 0, s->state_dependent > 0);
  WRITE ("#define INLINE static inline%s\n", s->rows <= SPECIALISE_INLINE ? " __attribute__ ((always_inline))" : "");
  specialise_list (gen->out, "BODY", s->bodies);
  specialise_list (gen->out, "ROW", s->rows);
  specialise_list (gen->out, "HOLONOMIC", s->holonomic);
  specialise_list (gen->out, "INTERNAL", s->coords - 3 * s->bodies);
  /* the coordinates in pairs, X (0, pair) X (2, pair) and, if their number is odd, X (4, one); and one by one */
  WRITE ("#define EACH_COORDINATES(X)");
  for (int i = 0; i < s->coords; i += 2) WRITE (i + 1 < s->coords ? " X (%d, pair)" : " X (%d, one)", i);
  WRITE ("\n#define EACH_ONE(X)");
  for (int i = 0; i < s->coords; i++) WRITE (" X (%d, one)", i);
  WRITE ("\n");
  for (int b = 0; b < s->bodies; b++) WRITE ("/* body %d: %s */\n", b, s->body_name[b]);
  WRITE ("\nstatic const unsigned char independent[] = { ");
  for (int i = 0; i < s->rows; i++) WRITE ("%d, ", specialise_is_independent (gen, i));
  WRITE ("0 };\n");
}

/* Hash of the structure that a system must share with generated code; independent equations are compared separately. */
static unsigned long specialise_shape (const pw_system *s) {
  unsigned long long h = PW_CHECK;
  const int counts[] = {
    s->bodies, s->coords, s->rows, s->holonomic, s->batches, s->entries, s->sources, s->rheonomic
  };
  h = pw_check_sum (h, counts, sizeof counts);
  for (int j = 0; j < s->coords; j++) h = pw_check_sum (h, &(char){ s->mass[j] > 0 }, 1);
  for (int k = 0; k < s->batches; k++) {
    const pw_element_batch *batch = &s->batch[k];
    h = pw_check_sum (h, batch->kind->name, strlen (batch->kind->name) + 1);
    h = pw_check_sum (h, batch->b.body, (size_t)(batch->b.count * batch->kind->bodies) * sizeof *batch->b.body);
    const int sizes[] = { batch->b.count, (int)batch->kind->element, batch->kind->rows, batch->kind->internal,
                          batch->kind->signals };
    h = pw_check_sum (h, sizes, sizeof sizes);
  }
  for (int i = 0; i < s->sources; i++)
    h = pw_check_sum (h, (int[]){ (int)s->source[i].signal.type, s->source[i].of_force, s->source[i].reads },
                      3 * sizeof (int));
  for (int i = 0; i < s->entries; i++)
    h = pw_check_sum (h, (int[]){ s->entry[i].batch, s->entry[i].element, (int)s->entry[i].type }, 3 * sizeof (int));
  return (unsigned long)h;
}

static int specialise_write (generator *gen) {
  unsigned char done[SPECIALISE_TEXTS] = { 0 };
  char name[80], file[90];
  WRITE ("/* Generated by Pinwheel.  Compile with: cc -std=c11 -O2 -ffp-contract=off -fPIC -shared */\n"
         "#include <math.h>\n#include <string.h>\n#include \"pinwheel.h\"\n");
  specialise_text (gen->out, "specialised.h", done);
  specialise_text (gen->out, "sine.h", done);
  specialise_text (gen->out, "batch.h", done);
  for (int k = 0; k < gen->s->batches; k++) {
    snprintf (file, sizeof file, "%s.c", specialise_identifier (gen->s->batch[k].kind, name, sizeof name));
    if (pw_kind_is_built_in (gen->s->batch[k].kind)) specialise_text (gen->out, file, done);
  }
  specialise_constants (gen);
  specialise_text (gen->out, "scene_head.inc", done);
  specialise_rows (gen, "jacobian", "J", offsetof (pw_kind, J), gen->s->rows);
  specialise_rows (gen, "constraints", "g", offsetof (pw_kind, g), gen->s->holonomic);
  specialise_rows (gen, "sizes", "g_size", offsetof (pw_kind, g_size), gen->s->holonomic);
  specialise_rows (gen, "right_sides", "eta", offsetof (pw_kind, eta), gen->s->rows);
  specialise_rows (gen, "gammas", "gamma", offsetof (pw_kind, gamma), gen->s->rows);
  specialise_forces (gen);
  specialise_ledger (gen);
  int status = specialise_algebra (gen);
  specialise_data (gen);
  specialise_signals (gen);
  specialise_text (gen->out, "scene_both.inc", done); /* for single runs and for several */
  WRITE ("\n#ifdef PW_LANES\n");
  specialise_text (gen->out, "scene_lanes.inc", done);
  WRITE ("\nPW_EXPORT const pw_specialised_lanes pw_specialised_scene_lanes = {\n"
         "  PW_SCENE_ABI, LANES_SERVED, %luu, sizeof (run_lanes), lanes_steps\n};\n#else\n",
         specialise_shape (gen->s));
  specialise_text (gen->out, "scene_tail.inc", done); /* for single runs */
  WRITE ("\nstatic int prepare (pw_scene *s) {\n  const double *const M = s->mass;\n  double *const C = s->constant, "
         "J[ENTRIES + 1];\n"
         "  reference_jacobian (s, J);\n  (void)M, (void)C, (void)J;\n%s  return 0;\n}\n",
         gen->prepare.text ? gen->prepare.text : "");
  WRITE ("\nPW_EXPORT const pw_specialised pw_specialised_scene = {\n"
         "  PW_SCENE_ABI, %d, %luu, independent, prepare, evaluate, project, stages, compute_residuals, "
         "steps\n};\n#endif\n",
         gen->emitter.constants + 1, specialise_shape (gen->s));
  return status;
}

static int specialise_open (generator *gen) {
  const pw_system *s = gen->s;
  gen->sparsity = pw_arena_alloc (&gen->emitter.memory, (size_t)s->batches * sizeof *gen->sparsity);
  gen->w = pw_workspace_new (s, NULL);
  if (gen->sparsity == NULL || gen->w == NULL) return PW_RESOURCE;
  if (pw_update_kinematics (gen->w, 0, s->q0, s->v0) == PW_OK) pw_evaluate_J (gen->w); /* else J = 0: no pivot */
  int status = PW_OK;
  for (int k = 0; k < s->batches && status == PW_OK; k++) status = sparsity_find (s->batch[k].kind, &gen->sparsity[k]);
  return status;
}

int pw_system_check_source (const pw_system *s, pw_error *error) {
  const struct {
    int count, most;
    const char *what;
  } limit[] = { { s->rows, SPECIALISE_ROWS, "constraint equations" },
                { pw_system_elements (s), SPECIALISE_ELEMENTS, "elements" },
                { s->bodies, SPECIALISE_BODIES, "bodies" } };
  if (s->limited)
    return pw_fail (error, PW_INPUT, "model %s: specialised code has no limits of reactions, as by a grip", s->model);
  if (s->feedback)
    return pw_fail (error, PW_INPUT, "model %s: specialised code has no constraints whose signals depend on states",
                    s->model);
  for (size_t i = 0; i < sizeof limit / sizeof *limit; i++)
    if (limit[i].count > limit[i].most)
      return pw_fail (error, PW_INPUT, "model %s: %d %s: specialised code has at most %d", s->model, limit[i].count,
                      limit[i].what, limit[i].most);
  return PW_OK;
}

char *pw_system_source (const pw_system *s, const unsigned char *independent, pw_error *error) {
  pw_stream text;
  if (pw_require (s, "a system", error) != PW_OK || pw_system_check_source (s, error) != PW_OK) return NULL;
  generator gen = { .s = s, .independent = independent, .out = pw_stream_open (&text) };
  int status = gen.out ? specialise_open (&gen) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_write (&gen);
  if (pw_stream_close (gen.out, &text) != PW_OK) status = PW_RESOURCE;
  pw_workspace_free (gen.w);
  pw_arena_free (&gen.emitter.memory);
  free (gen.prepare.text);
  if (status == PW_OK) return text.text;
  free (text.text);
  if (status == PW_RETRY) /* of specialise_algebra */
    pw_fail (error, PW_INPUT, "model %s: no fixed order of elimination: redundant constraints, or a massless body",
             s->model);
  else
    pw_fail_memory (s, error);
  return NULL;
}

int pw_system_has_lanes (const pw_system *s) {
  for (int k = 0; k < s->batches; k++)
    if (!pw_kind_is_built_in (s->batch[k].kind) || s->batch[k].kind->element % sizeof (double)) return 0;
  return s->state_dependent == 0 && pw_system_check_source (s, NULL) == PW_OK;
}

int pw_specialised_fits (const pw_specialised *code, const pw_system *s) {
  return code->abi == PW_SCENE_ABI && code->shape == specialise_shape (s);
}

int pw_specialised_lanes_fit (const pw_specialised_lanes *code, const pw_system *s) {
  return code->abi == PW_SCENE_ABI && code->shape == specialise_shape (s);
}

int pw_specialised_lanes_count (const pw_specialised_lanes *code) {
  return code->lanes;
}

void *pw_specialised_lanes_memory (const pw_specialised_lanes *code) {
  enum { ALIGN = 64 }; /* bytes: of the largest vector registers, those of AVX-512 */
  return aligned_alloc (ALIGN, (code->size + ALIGN - 1) / ALIGN * ALIGN);
}
