/* Writes C code for one compiled system: the source texts of its element types, called for one element at a time with
 * constant indices, and a factorisation without loops. */
#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>
#include <string.h>
#include "specialise_parts.h"

/* ---- Text ---- */

/* The text of a source file. */
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

static void specialise_texts (const pw_generator *gen, unsigned char done[SPECIALISE_TEXTS]) {
  char name[80], file[90];
  fputs ("#include <math.h>\n#include <string.h>\n#include \"pinwheel.h\"\n", gen->out);
  specialise_text (gen->out, "specialised.h", done);
  specialise_text (gen->out, "sine.h", done);
  specialise_text (gen->out, "batch.h", done);
  for (int k = 0; k < gen->s->batches; k++) {
    if (!pw_kind_is_built_in (gen->s->batch[k].kind)) continue;
    snprintf (file, sizeof file, "%s.c", pw_specialise_identifier (gen->s->batch[k].kind, name, sizeof name));
    specialise_text (gen->out, file, done);
  }
}

/* ---- The file ---- */

/* Lists the coordinates in pairs, X (0, pair) X (2, pair) and, if n is odd, X (4, one); and one by one. */
static void specialise_coordinates (FILE *out, int n) {
  fputs ("#define EACH_COORDINATES(X)", out);
  for (int i = 0; i < n; i += 2) fprintf (out, i + 1 < n ? " X (%d, pair)" : " X (%d, one)", i);
  fputs ("\n#define EACH_ONE(X)", out);
  for (int i = 0; i < n; i++) fprintf (out, " X (%d, one)", i);
  fputc ('\n', out);
}

static void specialise_constants (const pw_generator *gen) {
  const pw_system *s = gen->s;
  fprintf (gen->out,
           "\n/* ---- The scene ---- */\n\nenum { BODIES = %d, N = %d, ROWS = %d, HOLONOMIC = %d, INTERNAL = %d,\n"
           "  ENTRIES = %d, REDUNDANT = %d, LEDGER = %d, RHEONOMIC = %d, STATE_DEPENDENT = %d };\n",
           s->bodies, s->coords, s->rows, s->holonomic, s->coords - 3 * s->bodies, gen->J_entries,
           gen->independent != NULL, s->entries, s->rheonomic > 0, s->state_dependent > 0);
  fprintf (gen->out, "#define INLINE static inline%s\n",
           s->rows <= SPECIALISE_INLINE ? " __attribute__ ((always_inline))" : "");
  pw_specialise_list (gen->out, "BODY", s->bodies);
  pw_specialise_list (gen->out, "ROW", s->rows);
  pw_specialise_list (gen->out, "HOLONOMIC", s->holonomic);
  pw_specialise_list (gen->out, "INTERNAL", s->coords - 3 * s->bodies);
  specialise_coordinates (gen->out, s->coords);
  for (int b = 0; b < s->bodies; b++) fprintf (gen->out, "/* body %d: %s */\n", b, s->body_name[b]);
  fputs ("\nstatic const unsigned char independent[] = { ", gen->out);
  for (int i = 0; i < s->rows; i++) fprintf (gen->out, "%d, ", pw_specialise_is_independent (gen, i));
  fputs ("0 };\n", gen->out);
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

static int specialise_write (pw_generator *gen) {
  unsigned char done[SPECIALISE_TEXTS] = { 0 };
  fputs ("/* Generated by Pinwheel.  Compile with: cc -std=c11 -O2 -ffp-contract=off -fPIC -shared */\n", gen->out);
  specialise_texts (gen, done);
  specialise_constants (gen);
  specialise_text (gen->out, "scene_head.inc", done);
  pw_specialise_elements (gen);
  int status = pw_specialise_algebra (gen);
  pw_specialise_data (gen);
  pw_specialise_signals (gen);
  specialise_text (gen->out, "scene_both.inc", done); /* for single runs and for several */
  fputs ("\n#ifdef PW_LANES\n", gen->out);
  specialise_text (gen->out, "scene_lanes.inc", done);
  fprintf (gen->out,
           "\nPW_EXPORT const pw_specialised_lanes pw_specialised_scene_lanes = {\n"
           "  PW_SCENE_ABI, LANES_SERVED, %luu, sizeof (run_lanes), lanes_steps\n};\n#else\n",
           specialise_shape (gen->s));
  specialise_text (gen->out, "scene_tail.inc", done); /* for single runs */
  fprintf (gen->out,
           "\nstatic int prepare (pw_scene *s) {\n  const double *const M = s->mass;\n  double *const C = s->constant, "
           "J[ENTRIES + 1];\n"
           "  reference_jacobian (s, J);\n  (void)M, (void)C, (void)J;\n%s  return 0;\n}\n",
           gen->prepare.text ? gen->prepare.text : "");
  fprintf (gen->out,
           "\nPW_EXPORT const pw_specialised pw_specialised_scene = {\n"
           "  PW_SCENE_ABI, %d, %luu, independent, prepare, evaluate, project, stages, compute_residuals, "
           "steps\n};\n#endif\n",
           gen->emitter.constants + 1, specialise_shape (gen->s));
  return status;
}

static int specialise_open (pw_generator *gen) {
  const pw_system *s = gen->s;
  gen->sparsity = malloc (((size_t)s->batches + 1) * sizeof *gen->sparsity);
  gen->w = pw_workspace_new (s, NULL);
  if (gen->sparsity == NULL || gen->w == NULL) return PW_RESOURCE;
  if (pw_update_kinematics (gen->w, 0, s->q0, s->v0) == PW_OK) pw_evaluate_J (gen->w); /* else J = 0: no pivot */
  int status = PW_OK;
  for (int k = 0; k < s->batches && status == PW_OK; k++) {
    gen->J_entries += s->batch[k].b.count * s->batch[k].kind->rows * s->batch[k].b.cols;
    status = pw_sparsity_find (s->batch[k].kind, &gen->sparsity[k]);
  }
  return status;
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

char *pw_system_source (const pw_system *s, const unsigned char *independent, pw_error *error) {
  pw_stream text;
  if (pw_require (s, "a system", error) != PW_OK || pw_system_check_source (s, error) != PW_OK) return NULL;
  pw_generator gen = { .s = s, .independent = independent, .out = pw_stream_open (&text) };
  int status = gen.out ? specialise_open (&gen) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_write (&gen);
  if (pw_stream_close (gen.out, &text) != PW_OK) status = PW_RESOURCE;
  pw_workspace_free (gen.w);
  free (gen.sparsity);
  free (gen.prepare.text);
  if (status == PW_OK) return text.text;
  free (text.text);
  if (status == PW_RETRY) /* of pw_specialise_algebra */
    pw_fail (error, PW_INPUT, "model %s: no fixed order of elimination: redundant constraints, or a massless body",
             s->model);
  else
    pw_fail_memory (s, error);
  return NULL;
}
