/* Writes the linear algebra of specialised code, with macros of specialise.c and scene_head.inc: products with J,
 * factorisations, solutions. */
#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>
#include "specialise_parts.h"

/* The entry of J in row r and column c of element e of batch k. */
static pw_term specialise_entry (const pw_generator *gen, int k, int e, int r, int c) {
  const pw_element_batch *batch = &gen->s->batch[k];
  unsigned char type = gen->sparsity[k].J[r * batch->b.cols + c];
  int at = pw_specialise_J (gen, k, e) + r * batch->b.cols + c;
  if (type == PW_ENTRY_ZERO) return pw_term_zero ();
  if (type == PW_ENTRY_ONE || type == PW_ENTRY_MINUS_ONE)
    return (pw_term){ PW_TERM_ONE, type == PW_ENTRY_ONE ? 1 : -1, "1", type == PW_ENTRY_ONE ? 1 : -1 };
  return pw_term_named (type == PW_ENTRY_CONSTANT ? PW_TERM_CONSTANT : PW_TERM_VARIABLE, "J", at, gen->w->J[at]);
}

/* Loops over row r of element e of batch k; i: its constraint equation. */
#define EACH_EQUATION(k, e, r, i)                      \
  for (int k = 0, i = 0; k < gen->s->constraints; k++) \
    for (int e = 0; e < gen->s->batch[k].b.count; e++) \
      for (int r = 0; r < gen->s->batch[k].kind->rows; r++, i++)

/* K = [ M J^T ; J 0 ]; malloced. */
static pw_term *specialise_matrix (const pw_generator *gen) {
  const pw_system *s = gen->s;
  size_t n = (size_t)(s->coords + s->rows);
  pw_term *K = malloc ((n * n + 1) * sizeof *K);
  if (K == NULL) return NULL;
  for (size_t i = 0; i < n * n; i++) K[i] = pw_term_zero ();
  for (int j = 0; j < s->coords; j++)
    if (s->mass[j] > 0) /* one mass for vx and vy */
      K[(size_t)j * n + (size_t)j] =
          pw_term_named (PW_TERM_CONSTANT, "M", j - (j < 3 * s->bodies && j % 3 == 1), s->mass[j]);
  EACH_EQUATION (k, e, r, row)
  for (int c = 0; c < s->batch[k].b.cols; c++) {
    size_t i = (size_t)(s->coords + row), j = (size_t)pw_global (&s->batch[k], e, c);
    if (j < (size_t)s->coords) K[i * n + j] = K[j * n + i] = specialise_entry (gen, k, e, r, c);
  }
  return K;
}

typedef enum { SPECIALISE_ACCELERATION, SPECIALISE_VELOCITY, SPECIALISE_POSITION } specialise_unknown;

/* Writes the function `solve`, which computes accelerations and multipliers from forces f and right-hand sides g, or
 * solve_velocity or solve_position: changes of velocities or positions from right-hand sides g alone. */
static int specialise_solve (pw_generator *gen, const pw_elimination *ldl, specialise_unknown unknown) {
  static const char *const name[] = { "solve", "solve_velocity", "solve_position" };
  const pw_system *s = gen->s;
  char text[24], next[24];
  pw_term *right = malloc ((size_t)ldl->n * sizeof *right + 1);
  if (right == NULL) return PW_RESOURCE;
  for (int i = 0; i < ldl->n; i++) {
    int row = i - s->coords, force = row < 0 && unknown == SPECIALISE_ACCELERATION;
    right[i] = row >= 0 ? pw_term_named (PW_TERM_VARIABLE, "g", row, 1) : pw_term_zero ();
    if (force && pw_specialise_force (gen, i)) right[i] = pw_term_named (PW_TERM_VARIABLE, "f", i, 1);
    if (row >= 0 && !pw_specialise_is_independent (gen, row)) right[i] = pw_term_zero ();
    if (unknown == SPECIALISE_POSITION && row >= s->holonomic) right[i] = pw_term_zero ();
  }
  fprintf (gen->out,
           "\nINLINE void %s (const double *C, const double *J, const double *F, %sconst double *g, double *a%s) {\n"
           "  (void)C, (void)J, (void)F, (void)g, (void)a;\n",
           name[unknown], unknown == SPECIALISE_ACCELERATION ? "const double *f, " : "",
           unknown == SPECIALISE_ACCELERATION ? ", double *lambda" : "");
  pw_elimination_solve (ldl, &gen->emitter, right);
  for (int j = 0; j + 1 < s->coords; j += 2)
    fprintf (gen->out, "  STORE_PAIR (a + %d, %s, %s);\n", j, pw_term_text (right[j], text),
             pw_term_text (right[j + 1], next));
  if (s->coords % 2) fprintf (gen->out, "  a[%d] = %s;\n", s->coords - 1, pw_term_text (right[s->coords - 1], text));
  for (int i = 0; i < s->rows && unknown == SPECIALISE_ACCELERATION; i++)
    fprintf (gen->out, "  lambda[%d] = %s;\n", i, pw_term_text (right[s->coords + i], text));
  fputs ("}\n", gen->out);
  free (right);
  return PW_OK;
}

/* Writes a function that factorises K with the independent equations among the first `rows`; ldl: for its solution. */
static int specialise_factor (pw_generator *gen, pw_elimination *ldl, const pw_term *K, const char *name, int rows) {
  unsigned char takes_part[SPECIALISE_ROWS + 1];
  for (int i = 0; i < gen->s->rows; i++) takes_part[i] = i < rows && pw_specialise_is_independent (gen, i);
  pw_stream text;
  FILE *out = gen->emitter.code = pw_stream_open (&text);
  int status = out ? pw_elimination_open (ldl, gen->s, K, takes_part, &gen->emitter) : PW_RESOURCE;
  if (pw_stream_close (out, &text) != PW_OK) status = PW_RESOURCE;
  gen->emitter.code = gen->out;
  if (status == PW_OK)
    fprintf (gen->out,
             "\nGUARDED %s (const double *M, const double *C, const double *J, double *F) {\n  GUARDS;\n"
             "  (void)M, (void)C, (void)J, (void)F;\n%s  GUARDS_HOLD;\n}\n",
             name, text.text);
  free (text.text);
  return status;
}

/* ---- Products with J ---- */

typedef enum { SPECIALISE_TERMS, SPECIALISE_ABSOLUTE_VALUES } specialise_summands;

/* Writes the product of row r of element e with w, or the sum of the absolute values of its terms. */
static void specialise_row_product (const pw_generator *gen, int k, int e, int r, specialise_summands summands) {
  const char *plus = "";
  int absolute = summands == SPECIALISE_ABSOLUTE_VALUES;
  for (int c = 0; c < gen->s->batch[k].b.cols; c++) {
    int j = pw_global (&gen->s->batch[k], e, c);
    pw_term a = j < gen->s->coords ? specialise_entry (gen, k, e, r, c) : pw_term_zero ();
    if (a.type == PW_TERM_ZERO) continue;
    fprintf (gen->out, "%s%s", absolute || a.sign > 0 ? plus : *plus ? " - " : "-", absolute ? "fabs (" : "");
    if (a.type != PW_TERM_ONE) fprintf (gen->out, "%s * ", a.name);
    fprintf (gen->out, "w[%d]%s", j, absolute ? ")" : "");
    plus = " + ";
  }
  fputs (*plus ? ";\n" : "0;\n", gen->out);
}

/* Writes the function `product`: out = J w; size: the sums of the absolute values of its terms. */
static void specialise_product (const pw_generator *gen) {
  fputs ("\nINLINE void product (const double *J, const double *w, double *out, double *size) {\n  (void)J, (void)w, "
         "(void)out, (void)size;\n",
         gen->out);
  EACH_EQUATION (k, e, r, i) {
    fprintf (gen->out, "  out[%d] = ", i);
    specialise_row_product (gen, k, e, r, SPECIALISE_TERMS);
    fprintf (gen->out, "  size[%d] = ", i);
    specialise_row_product (gen, k, e, r, SPECIALISE_ABSOLUTE_VALUES);
  }
  fputs ("}\n", gen->out);
}

int pw_specialise_algebra (pw_generator *gen) {
  const pw_system *s = gen->s;
  pw_elimination all = { 0 }, position = { 0 };
  gen->emitter = (pw_emitter){ .prepare = pw_stream_open (&gen->prepare), .code = gen->out };
  specialise_product (gen);
  pw_term *K = specialise_matrix (gen);
  int status = K && gen->emitter.prepare ? specialise_factor (gen, &all, K, "factor", s->rows) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (gen, &all, SPECIALISE_ACCELERATION);
  if (status == PW_OK) status = specialise_solve (gen, &all, SPECIALISE_VELOCITY);
  int alone = PW_OK; /* PW_RETRY if the holonomic equations alone do not determine the massless coordinates */
  if (status == PW_OK) alone = specialise_factor (gen, &position, K, "factor_position", s->holonomic);
  if (alone == PW_RESOURCE) status = PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (gen, alone == PW_OK ? &position : &all, SPECIALISE_POSITION);
  fprintf (gen->out, "\nenum { FACTORS = %d };\n",
           1 + (all.factors > position.factors ? all.factors : position.factors));
  if (alone != PW_OK) fputs ("#define factor_position factor\n", gen->out);
  if (pw_stream_close (gen->emitter.prepare, &gen->prepare) != PW_OK) status = PW_RESOURCE;
  pw_elimination_close (&all);
  pw_elimination_close (&position);
  free (K);
  return status;
}
