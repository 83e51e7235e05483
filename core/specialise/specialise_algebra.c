/* Specialised code: products with J, factorisations, solutions. */
#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>
#include "specialise_parts.h"

/* ---- Linear algebra ---- */

static pw_term specialise_entry (const pw_generator *scene, int k, int e, int r, int c) {
  const pw_element_batch *batch = &scene->s->batch[k];
  unsigned char type = scene->sparsity[k].J[r * batch->b.cols + c];
  int at = pw_specialise_J (scene, k, e) + r * batch->b.cols + c;
  if (type == PW_ENTRY_ZERO) return pw_term_zero ();
  if (type == PW_ENTRY_ONE || type == PW_ENTRY_MINUS_ONE)
    return (pw_term){ PW_TERM_ONE, type == PW_ENTRY_ONE ? 1 : -1, "1", type == PW_ENTRY_ONE ? 1 : -1 };
  return pw_term_named (type == PW_ENTRY_CONSTANT ? PW_TERM_CONSTANT : PW_TERM_VARIABLE, "J", at, scene->w->J[at]);
}

/* Loops over row r of element e of batch k; i: its constraint equation. */
#define EACH_EQUATION(k, e, r, i)                        \
  for (int k = 0, i = 0; k < scene->s->constraints; k++) \
    for (int e = 0; e < scene->s->batch[k].b.count; e++) \
      for (int r = 0; r < scene->s->batch[k].kind->rows; r++, i++)

/* [ M J^T ; J 0 ]; malloced. */
static pw_term *specialise_matrix (const pw_generator *scene) {
  const pw_system *s = scene->s;
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
    if (j < (size_t)s->coords) K[i * n + j] = K[j * n + i] = specialise_entry (scene, k, e, r, c);
  }
  return K;
}

/* rows x bodies: as pw_sparsity.length, for the equations of the scene; malloced. */
static unsigned char *specialise_lengths (const pw_generator *scene) {
  unsigned char *length = calloc ((size_t)(scene->s->rows * scene->s->bodies) + 1, 1);
  for (int k = 0; length && k < scene->s->constraints; k++) {
    const pw_element_batch *batch = &scene->s->batch[k];
    const int bodies = batch->kind->bodies;
    for (int i = 0; i < batch->b.count * batch->kind->rows * bodies; i++) {
      int element = i / (batch->kind->rows * bodies), of_element = i % (batch->kind->rows * bodies);
      int body = batch->b.body[element * bodies + i % bodies];
      if (body < scene->s->bodies)
        length[(batch->row + i / bodies) * scene->s->bodies + body] = scene->sparsity[k].length[of_element];
    }
  }
  return length;
}

typedef enum { SPECIALISE_ACCELERATION, SPECIALISE_VELOCITY, SPECIALISE_POSITION } specialise_unknown;

/* Writes the function `solve`: accelerations and multipliers from forces f and right-hand sides g; or solve_velocity,
 * solve_position: changes of velocities or positions from right-hand sides g alone. */
static int specialise_solve (const pw_generator *scene, const pw_elimination *ldl, pw_emitter *emitter,
                             specialise_unknown unknown) {
  static const char *const name[] = { "solve", "solve_velocity", "solve_position" };
  const pw_system *s = scene->s;
  char text[24], next[24];
  pw_term *right = malloc ((size_t)ldl->n * sizeof *right + 1);
  if (right == NULL) return PW_RESOURCE;
  for (int i = 0; i < ldl->n; i++) {
    int row = i - s->coords, force = row < 0 && unknown == SPECIALISE_ACCELERATION;
    right[i] = row >= 0 ? pw_term_named (PW_TERM_VARIABLE, "g", row, 1) : pw_term_zero ();
    if (force && pw_specialise_force (scene, i)) right[i] = pw_term_named (PW_TERM_VARIABLE, "f", i, 1);
    if (row >= 0 && !pw_specialise_is_independent (scene, row)) right[i] = pw_term_zero ();
    if (unknown == SPECIALISE_POSITION && row >= s->holonomic) right[i] = pw_term_zero ();
  }
  fprintf (scene->out,
           "\nINLINE void %s (const double *C, const double *J, const double *F, %sconst double *g, double *a%s) {\n"
           "  (void)C, (void)J, (void)F, (void)g, (void)a;\n",
           name[unknown], unknown == SPECIALISE_ACCELERATION ? "const double *f, " : "",
           unknown == SPECIALISE_ACCELERATION ? ", double *lambda" : "");
  pw_elimination_solve (ldl, emitter, right);
  for (int j = 0; j + 1 < s->coords; j += 2)
    fprintf (scene->out, "  STORE_PAIR (a + %d, %s, %s);\n", j, pw_term_text (right[j], text),
             pw_term_text (right[j + 1], next));
  if (s->coords % 2) fprintf (scene->out, "  a[%d] = %s;\n", s->coords - 1, pw_term_text (right[s->coords - 1], text));
  for (int i = 0; i < s->rows && unknown == SPECIALISE_ACCELERATION; i++)
    fprintf (scene->out, "  lambda[%d] = %s;\n", i, pw_term_text (right[s->coords + i], text));
  fputs ("}\n", scene->out);
  free (right);
  return PW_OK;
}

static int specialise_factor (const pw_generator *scene, pw_elimination *ldl, pw_emitter *emitter, const pw_term *K,
                              const unsigned char *length, const char *name, int rows) {
  unsigned char takes_part[SPECIALISE_ROWS + 1];
  for (int i = 0; i < scene->s->rows; i++) takes_part[i] = i < rows && pw_specialise_is_independent (scene, i);
  pw_stream text;
  FILE *out = emitter->code = pw_stream_open (&text);
  int status = out ? pw_elimination_open (ldl, scene->s, K, length, takes_part, emitter) : PW_RESOURCE;
  if (pw_stream_close (out, &text) != PW_OK) status = PW_RESOURCE;
  emitter->code = scene->out;
  if (status == PW_OK)
    fprintf (scene->out,
             "\nGUARDED %s (const double *M, const double *C, const double *J, double *F) {\n  GUARDS;\n"
             "  (void)M, (void)C, (void)J, (void)F;\n%s  GUARDS_HOLD;\n}\n",
             name, text.text);
  free (text.text);
  return status;
}

/* ---- Products with J ---- */

typedef enum { SPECIALISE_TERMS, SPECIALISE_ABSOLUTE_VALUES } specialise_summands;

/* Row r of element e times w, or the sum of the absolute values of its terms. */
static void specialise_row_product (const pw_generator *scene, int k, int e, int r, specialise_summands summands) {
  const char *plus = "";
  int absolute = summands == SPECIALISE_ABSOLUTE_VALUES;
  for (int c = 0; c < scene->s->batch[k].b.cols; c++) {
    int j = pw_global (&scene->s->batch[k], e, c);
    pw_term a = j < scene->s->coords ? specialise_entry (scene, k, e, r, c) : pw_term_zero ();
    if (a.type == PW_TERM_ZERO) continue;
    fprintf (scene->out, "%s%s", absolute || a.sign > 0 ? plus : *plus ? " - " : "-", absolute ? "fabs (" : "");
    if (a.type != PW_TERM_ONE) fprintf (scene->out, "%s * ", a.name);
    fprintf (scene->out, "w[%d]%s", j, absolute ? ")" : "");
    plus = " + ";
  }
  fputs (*plus ? ";\n" : "0;\n", scene->out);
}

/* out = J w, and size = the sums of the absolute values of its terms. */
static void specialise_product (const pw_generator *scene) {
  fputs ("\nINLINE void product (const double *J, const double *w, double *out, double *size) {\n  (void)J, (void)w, "
         "(void)out, (void)size;\n",
         scene->out);
  EACH_EQUATION (k, e, r, i) {
    fprintf (scene->out, "  out[%d] = ", i);
    specialise_row_product (scene, k, e, r, SPECIALISE_TERMS);
    fprintf (scene->out, "  size[%d] = ", i);
    specialise_row_product (scene, k, e, r, SPECIALISE_ABSOLUTE_VALUES);
  }
  fputs ("}\n", scene->out);
}

int pw_specialise_algebra (pw_generator *scene) {
  const pw_system *s = scene->s;
  pw_elimination all = { 0 }, position = { 0 };
  pw_emitter emitter = { .prepare = pw_stream_open (&scene->prepare),
                         .prepared = &scene->prepare.text,
                         .code = scene->out };
  specialise_product (scene);
  pw_term *K = specialise_matrix (scene);
  unsigned char *length = specialise_lengths (scene);
  int status = K && length && emitter.prepare ? specialise_factor (scene, &all, &emitter, K, length, "factor", s->rows)
                                              : PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (scene, &all, &emitter, SPECIALISE_ACCELERATION);
  if (status == PW_OK) status = specialise_solve (scene, &all, &emitter, SPECIALISE_VELOCITY);
  int alone = PW_OK; /* if the holonomic equations alone determine the massless coordinates */
  if (status == PW_OK)
    alone = specialise_factor (scene, &position, &emitter, K, length, "factor_position", s->holonomic);
  if (alone == PW_RESOURCE) status = PW_RESOURCE;
  if (status == PW_OK)
    status = specialise_solve (scene, alone == PW_OK ? &position : &all, &emitter, SPECIALISE_POSITION);
  scene->constants = emitter.constants;
  fprintf (scene->out, "\nenum { FACTORS = %d };\n",
           1 + (all.factors > position.factors ? all.factors : position.factors));
  if (alone != PW_OK) fputs ("#define factor_position factor\n", scene->out);
  if (pw_stream_close (emitter.prepare, &scene->prepare) != PW_OK) status = PW_RESOURCE;
  pw_elimination_close (&all);
  pw_elimination_close (&position);
  free (K);
  free (length);
  return status;
}
