/* Specialised code: products with J, factorisations, solutions. */
#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>
#include "specialise_parts.h"

/* ---- Linear algebra ---- */

static pw_term specialise_entry (const pw_specialise_scene *x, int k, int e, int r, int c) {
  const pw_element_batch *b = &x->s->batch[k];
  unsigned char type = x->sparsity[k].J[r * b->b.cols + c];
  int at = pw_specialise_J (x, k, e) + r * b->b.cols + c;
  if (type == PW_ENTRY_ZERO) return pw_term_zero ();
  if (type == PW_ENTRY_ONE || type == PW_ENTRY_MINUS_ONE)
    return (pw_term){ PW_TERM_ONE, type == PW_ENTRY_ONE ? 1 : -1, "1", type == PW_ENTRY_ONE ? 1 : -1 };
  return pw_term_named (type == PW_ENTRY_CONSTANT ? PW_TERM_CONSTANT : PW_TERM_VARIABLE, "J", at, x->w->J[at]);
}

/* Calls f for each entry of J that is not always 0. */
#define EACH_ENTRY(k, e, r, c)                            \
  for (int k = 0; k < x->s->constraints; k++)             \
    for (int e = 0; e < x->s->batch[k].b.count; e++)      \
      for (int r = 0; r < x->s->batch[k].kind->rows; r++) \
        for (int c = 0; c < x->s->batch[k].b.cols; c++)   \
          if (pw_global (&x->s->batch[k], e, c) < x->s->coords)

static pw_term *specialise_matrix (const pw_specialise_scene *x) {
  const pw_system *s = x->s;
  size_t n = (size_t)(s->coords + s->rows);
  pw_term *K = malloc ((n * n + 1) * sizeof *K);
  if (K == NULL) return NULL;
  for (size_t i = 0; i < n * n; i++) K[i] = pw_term_zero ();
  for (int j = 0; j < s->coords; j++)
    if (s->mass[j] > 0) /* one mass for vx and vy */
      K[(size_t)j * n + (size_t)j] =
          pw_term_named (PW_TERM_CONSTANT, "M", j - (j < 3 * s->bodies && j % 3 == 1), s->mass[j]);
  EACH_ENTRY (k, e, r, c) {
    size_t i = (size_t)(s->coords + s->batch[k].row + e * s->batch[k].kind->rows + r);
    size_t j = (size_t)pw_global (&s->batch[k], e, c);
    K[i * n + j] = K[j * n + i] = specialise_entry (x, k, e, r, c);
  }
  return K;
}

/* 1 for each equation and body where pw_sparsity says so; malloced. */
static unsigned char *specialise_lengths (const pw_specialise_scene *x) {
  unsigned char *length = calloc ((size_t)(x->s->rows * x->s->bodies) + 1, 1);
  for (int k = 0; length && k < x->s->constraints; k++) {
    const pw_element_batch *b = &x->s->batch[k];
    const int bodies = b->kind->bodies;
    for (int i = 0; i < b->b.count * b->kind->rows * bodies; i++) {
      int element = i / (b->kind->rows * bodies), of_element = i % (b->kind->rows * bodies);
      int body = b->b.body[element * bodies + i % bodies];
      if (body < x->s->bodies) length[(b->row + i / bodies) * x->s->bodies + body] = x->sparsity[k].length[of_element];
    }
  }
  return length;
}

enum { SPECIALISE_ACCELERATE, SPECIALISE_VELOCITY, SPECIALISE_POSITION };

/* solve...: a and lambda of forces f and right-hand sides g; velocities and positions have no forces. */
static int specialise_solve (const pw_specialise_scene *x, const pw_elimination *m, pw_emitter *e, int what) {
  static const char *const name[] = { "solve", "solve_velocity", "solve_position" };
  const pw_system *s = x->s;
  char text[24], next[24];
  pw_term *right = malloc ((size_t)m->n * sizeof *right + 1);
  if (right == NULL) return PW_RESOURCE;
  for (int i = 0; i < m->n; i++) {
    int row = i - s->coords, force = row < 0 && what == SPECIALISE_ACCELERATE;
    right[i] = row >= 0 ? pw_term_named (PW_TERM_VARIABLE, "g", row, 1) : pw_term_zero ();
    if (force && pw_specialise_force (x, i)) right[i] = pw_term_named (PW_TERM_VARIABLE, "f", i, 1);
    if (row >= 0 && !pw_specialise_is_independent (x, row)) right[i] = pw_term_zero ();
    if (what == SPECIALISE_POSITION && row >= s->holonomic) right[i] = pw_term_zero ();
  }
  fprintf (x->out,
           "\nINLINE void %s (const double *C, const double *J, const double *F, %sconst double *g, double *a%s) {\n"
           "  (void)C, (void)J, (void)F, (void)g, (void)a;\n",
           name[what], what == SPECIALISE_ACCELERATE ? "const double *f, " : "",
           what == SPECIALISE_ACCELERATE ? ", double *lambda" : "");
  pw_elimination_solve (m, e, right);
  for (int j = 0; j + 1 < s->coords; j += 2)
    fprintf (x->out, "  STORE_PAIR (a + %d, %s, %s);\n", j, pw_term_text (right[j], text),
             pw_term_text (right[j + 1], next));
  if (s->coords % 2) fprintf (x->out, "  a[%d] = %s;\n", s->coords - 1, pw_term_text (right[s->coords - 1], text));
  for (int i = 0; i < s->rows && what == SPECIALISE_ACCELERATE; i++)
    fprintf (x->out, "  lambda[%d] = %s;\n", i, pw_term_text (right[s->coords + i], text));
  fputs ("}\n", x->out);
  free (right);
  return PW_OK;
}

static int specialise_factor (const pw_specialise_scene *x, pw_elimination *m, pw_emitter *e, const pw_term *K,
                              const unsigned char *length, const char *name, int rows) {
  unsigned char takes_part[SPECIALISE_ROWS + 1];
  for (int i = 0; i < x->s->rows; i++) takes_part[i] = i < rows && pw_specialise_is_independent (x, i);
  pw_stream text;
  FILE *out = e->code = pw_stream_open (&text);
  int status = out ? pw_elimination_open (m, x->s, K, length, takes_part, e) : PW_RESOURCE;
  if (pw_stream_close (out, &text) != PW_OK) status = PW_RESOURCE;
  e->code = x->out;
  if (status == PW_OK)
    fprintf (x->out,
             "\nGUARDED %s (const double *M, const double *C, const double *J, double *F) {\n  GUARDS;\n"
             "  (void)M, (void)C, (void)J, (void)F;\n%s  GUARDS_HOLD;\n}\n",
             name, text.text);
  free (text.text);
  return status;
}

/* ---- Products with J ---- */

/* Row r of element e times w, or the sum of the absolute values of its terms. */
static void specialise_row_product (const pw_specialise_scene *x, int k, int e, int r, int absolute) {
  const char *plus = "";
  for (int c = 0; c < x->s->batch[k].b.cols; c++) {
    int j = pw_global (&x->s->batch[k], e, c);
    pw_term a = j < x->s->coords ? specialise_entry (x, k, e, r, c) : pw_term_zero ();
    if (a.type == PW_TERM_ZERO) continue;
    fprintf (x->out, "%s%s", absolute || a.sign > 0 ? plus : *plus ? " - " : "-", absolute ? "fabs (" : "");
    if (a.type != PW_TERM_ONE) fprintf (x->out, "%s * ", a.name);
    fprintf (x->out, "w[%d]%s", j, absolute ? ")" : "");
    plus = " + ";
  }
  fputs (*plus ? ";\n" : "0;\n", x->out);
}

/* out = J w, and size = the sums of the absolute values of its terms. */
static void specialise_product (const pw_specialise_scene *x) {
  fputs ("\nINLINE void product (const double *J, const double *w, double *out, double *size) {\n  (void)J, (void)w, "
         "(void)out, (void)size;\n",
         x->out);
  for (int k = 0; k < x->s->constraints; k++)
    for (int e = 0; e < x->s->batch[k].b.count; e++)
      for (int r = 0; r < x->s->batch[k].kind->rows; r++) {
        int i = x->s->batch[k].row + e * x->s->batch[k].kind->rows + r;
        fprintf (x->out, "  out[%d] = ", i);
        specialise_row_product (x, k, e, r, 0);
        fprintf (x->out, "  size[%d] = ", i);
        specialise_row_product (x, k, e, r, 1);
      }
  fputs ("}\n", x->out);
}

/* ---- All of it ---- */

int pw_specialise_algebra (pw_specialise_scene *x) {
  const pw_system *s = x->s;
  pw_elimination all = { 0 }, position = { 0 };
  pw_emitter e = { .prepare = pw_stream_open (&x->prepare), .prepared = &x->prepare.text, .code = x->out };
  specialise_product (x);
  pw_term *K = specialise_matrix (x);
  unsigned char *length = specialise_lengths (x);
  int status = K && length && e.prepare ? specialise_factor (x, &all, &e, K, length, "factor", s->rows) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (x, &all, &e, SPECIALISE_ACCELERATE);
  if (status == PW_OK) status = specialise_solve (x, &all, &e, SPECIALISE_VELOCITY);
  int alone = PW_OK; /* if the holonomic equations alone determine the massless coordinates */
  if (status == PW_OK) alone = specialise_factor (x, &position, &e, K, length, "factor_position", s->holonomic);
  if (alone == PW_RESOURCE) status = PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (x, alone == PW_OK ? &position : &all, &e, SPECIALISE_POSITION);
  x->constants = e.constants;
  fprintf (x->out, "\nenum { FACTORS = %d };\n", 1 + (all.factors > position.factors ? all.factors : position.factors));
  if (alone != PW_OK) fputs ("#define factor_position factor\n", x->out);
  if (pw_stream_close (e.prepare, &x->prepare) != PW_OK) status = PW_RESOURCE;
  pw_elimination_close (&all);
  pw_elimination_close (&position);
  free (K);
  free (length);
  return status;
}
