/* Specialised code: functions of elements and signals. */
#include <stddef.h>
#include <string.h>
#include "specialise_parts.h"

char *pw_specialise_identifier (const pw_kind *kind, char *buffer, size_t size) {
  snprintf (buffer, size, "%s", kind->name);
  for (char *c = buffer; *c; c++)
    if (*c == '-') *c = '_';
  return buffer;
}

void pw_specialise_list (FILE *out, const char *name, int n) {
  fprintf (out, "#define EACH_%s(X)", name);
  for (int i = 0; i < n; i++) fprintf (out, " X (%d)", i);
  fputc ('\n', out);
}

/* ---- Elements ---- */

/* Opens a block with a batch of one element, `more` at the end of its initialiser. */
static void specialise_batch (const pw_generator *scene, int k, int e, const char *more) {
  const pw_element_batch *batch = &scene->s->batch[k];
  fputs ("  { /* ", scene->out);
  pw_emit_name (scene->out, batch->kind->name);
  fputc (' ', scene->out);
  pw_emit_name (scene->out, batch->name[e]);
  fputs (" */\n    static const int body[] = { ", scene->out);
  for (int n = 0; n < batch->kind->bodies; n++)
    fprintf (scene->out, "%s%d", n ? ", " : "", batch->b.body[e * batch->kind->bodies + n]);
  fprintf (scene->out, "%s };\n    const pw_batch b = { .count = 1, .cols = %d, .body = body, .configuration = c,\n",
           batch->kind->bodies ? "" : "0", batch->b.cols);
  fprintf (scene->out, "      .element = (const char *)s->element[%d] + %zu", k, (size_t)e * batch->kind->element);
  if (batch->kind->internal)
    fprintf (scene->out, ", .q = q + %d, .v = v + %d", batch->internal + e * batch->kind->internal,
             batch->internal + e * batch->kind->internal);
  if (batch->kind->signals) fprintf (scene->out, ", .u = s->u + %d", 3 * pw_specialise_u (scene, k, e));
  fprintf (scene->out, "%s };\n", more);
}

/* The call of a function of its type, as text. */
static void specialise_call (const pw_generator *scene, int k, const char *function, const char *to) {
  char name[80];
  const pw_kind *kind = scene->s->batch[k].kind;
  if (pw_kind_is_built_in (kind))
    fprintf (scene->out, "    scene_%s.%s (&b, %s);\n", pw_specialise_identifier (kind, name, sizeof name), function,
             to);
  else
    fprintf (scene->out, "    s->kind[%d]->%s (&b, %s);\n", k, function, to);
}

/* Text of the parameters of the generated functions, and of statements that mark them as used. */
#define ARGUMENTS "const pw_scene *s, const pw_configuration *c, const double *q, const double *v, double *out"
#define UNUSED "  (void)s, (void)c, (void)q, (void)v, (void)out;\n"

/* Writes a function of the first `rows` constraint equations: J, or one number for each.  `function` is the member at
 * `offset` of a type's table; NULL: zeros. */
static void specialise_rows (const pw_generator *scene, const char *name, const char *function, size_t offset,
                             int rows) {
  char to[40];
  fprintf (scene->out, "\nINLINE void %s (" ARGUMENTS ") {\n" UNUSED, name);
  for (int k = 0; k < scene->s->constraints && scene->s->batch[k].row < rows; k++) {
    const pw_element_batch *batch = &scene->s->batch[k];
    for (int e = 0; e < batch->b.count; e++) {
      int first = e * batch->kind->rows, exists = pw_kind_function (batch->kind, offset) != NULL;
      for (int r = 0; !exists && r < batch->kind->rows; r++)
        fprintf (scene->out, "  out[%d] = 0;\n", batch->row + first + r);
      if (!exists) continue;
      specialise_batch (scene, k, e, "");
      int at = offset == offsetof (pw_kind, J) ? pw_specialise_J (scene, k, e) : batch->row + first;
      snprintf (to, sizeof to, "out + %d", at);
      specialise_call (scene, k, function, to);
      fputs ("  }\n", scene->out);
    }
  }
  fputs ("}\n", scene->out);
}

int pw_specialise_force (const pw_generator *scene, int j) {
  int forces = 0;
  for (int k = 0; k < scene->s->batches; k++) {
    const pw_element_batch *batch = &scene->s->batch[k];
    for (int i = 0; batch->kind->force && i < batch->b.count * batch->b.cols; i++)
      if (scene->sparsity[k].force[i % batch->b.cols] != PW_ENTRY_ZERO &&
          pw_global (batch, i / batch->b.cols, i % batch->b.cols) == j)
        forces |= batch->kind->constant ? SPECIALISE_CONSTANT : SPECIALISE_CHANGING;
  }
  return forces;
}

static void specialise_forces (const pw_generator *scene) {
  const pw_system *s = scene->s;
  fprintf (scene->out, "\nINLINE void forces (" ARGUMENTS ") {\n" UNUSED);
  for (int j = 0; j < s->coords; j++)
    fprintf (scene->out,
             pw_specialise_force (scene, j) & SPECIALISE_CONSTANT ? "  out[%d] = s->force[%d];\n" : "  out[%d] = 0;\n",
             j, j);
  for (int k = 0; k < s->batches; k++) {
    const pw_element_batch *batch = &s->batch[k];
    for (int e = 0; batch->kind->force && !batch->kind->constant && e < batch->b.count; e++) {
      specialise_batch (scene, k, e, "");
      fprintf (scene->out, "    double f[%d];\n", batch->b.cols);
      specialise_call (scene, k, "force", "f");
      for (int c = 0; c < batch->b.cols; c++)
        if (scene->sparsity[k].force[c] != PW_ENTRY_ZERO && pw_global (batch, e, c) < s->coords)
          fprintf (scene->out, "    out[%d] += f[%d];\n", pw_global (batch, e, c), c);
      fputs ("  }\n", scene->out);
    }
  }
  fputs ("}\n", scene->out);
}

/* The ledger's rates, as pw_evaluate_ledger. */
static void specialise_ledger (const pw_generator *scene) {
  const pw_system *s = scene->s;
  char more[40];
  fputs ("\nINLINE void ledger (const pw_scene *s, const pw_configuration *c, const double *q, const double *v,\n"
         "                           const double *lambda, double *out) {\n" UNUSED "  (void)lambda;\n",
         scene->out);
  for (int i = 0; i < s->entries; i++) {
    const pw_element_batch *batch = &s->batch[s->entry[i].batch];
    int k = s->entry[i].batch, e = s->entry[i].element, rows = batch->kind->rows, row = batch->row + e * rows;
    int by_eta = rows > 0 && s->entry[i].type == PW_WORK && batch->kind->power == NULL;
    snprintf (more, sizeof more, ", .lambda = lambda + %d", row);
    specialise_batch (scene, k, e, more);
    fprintf (scene->out, "    double y[%d];\n", rows > 0 ? rows : 1);
    specialise_call (scene, k, by_eta ? "eta" : s->entry[i].type == PW_WORK ? "power" : "loss", "y");
    fprintf (scene->out, "    out[%d] = ", i);
    if (!by_eta) fputs ("y[0]", scene->out);
    for (int r = 0; by_eta && r < rows; r++) fprintf (scene->out, "%s - lambda[%d] * y[%d]", r ? "" : "0", row + r, r);
    fputs (";\n  }\n", scene->out);
  }
  fputs ("}\n", scene->out);
}

void pw_specialise_elements (const pw_generator *scene) {
  specialise_rows (scene, "jacobian", "J", offsetof (pw_kind, J), scene->s->rows);
  specialise_rows (scene, "constraints", "g", offsetof (pw_kind, g), scene->s->holonomic);
  specialise_rows (scene, "sizes", "g_size", offsetof (pw_kind, g_size), scene->s->holonomic);
  specialise_rows (scene, "right_sides", "eta", offsetof (pw_kind, eta), scene->s->rows);
  specialise_rows (scene, "gammas", "gamma", offsetof (pw_kind, gamma), scene->s->rows);
  specialise_forces (scene);
  specialise_ledger (scene);
}

/* ---- Signals ---- */

static int specialise_is_simple (const pw_system *s) {
  for (int i = 0; i < s->sources; i++)
    if (s->source[i].signal.type != PW_CONSTANT && s->source[i].signal.type != PW_HARMONIC) return 0;
  return 1;
}

/* In lanes, signals of other forms have been evaluated before. */
void pw_specialise_signals (const pw_generator *scene) {
  const pw_system *s = scene->s;
  const int simple = specialise_is_simple (s);
  fputs ("\nGUARDED signals (pw_scene *s, double t, const double *q, const double *v) {\n  GUARDS;\n"
         "  (void)s, (void)t, (void)q, (void)v;\n",
         scene->out);
  if (!simple)
    fprintf (scene->out, "#ifndef PW_LANES\n  %sreturn s->update (s->workspace, t, q, v);\n#endif\n",
             s->state_dependent ? "" : "if (t != *s->t_signal) ");
  for (int i = 0; i < s->sources && simple; i++) {
    if (i == 0) fputs ("  SIGNALS_BEGIN (t);\n", scene->out);
    if (s->source[i].signal.type == PW_CONSTANT) {
      fprintf (scene->out, "  s->u[%d] = CONSTANT (%d);\n", 3 * i, i);
      if (!s->source[i].of_force) fprintf (scene->out, "  s->u[%d] = s->u[%d] = 0;\n", 3 * i + 1, 3 * i + 2);
    } else
      fprintf (scene->out, "  GUARD_CALL (harmonic (HARMONIC (%d), t, %d, s->u + %d));\n", i, !s->source[i].of_force,
               3 * i);
  }
  if (simple) fputs ("  SIGNALS_END (t);\n", scene->out);
  fputs ("  GUARDS_HOLD;\n}\n", scene->out);
}

/* ---- Lanes ---- */

int pw_system_has_lanes (const pw_system *s) {
  for (int k = 0; k < s->batches; k++)
    if (!pw_kind_is_built_in (s->batch[k].kind) || s->batch[k].kind->element % sizeof (double)) return 0;
  return s->rows <= SPECIALISE_ROWS && s->state_dependent == 0;
}

/* The prepared elements of all batches, then four numbers of each signal, one after the other. */
void pw_specialise_data (const pw_generator *scene) {
  const pw_system *s = scene->s;
  int data = 0;
  fputs ("\nstatic const int datum_begin[] = { ", scene->out);
  for (int k = 0; k < s->batches; k++) {
    fprintf (scene->out, "%d, ", data);
    data += s->batch[k].b.count * (int)(s->batch[k].kind->element / sizeof (double));
  }
  fprintf (scene->out, "%d };\nenum { BATCHES = %d, SIGNALS = %d, SIMPLE = %d, DATA = %d, FIXED = %d };\n", data,
           s->batches, s->sources, specialise_is_simple (s), data + 4 * s->sources, scene->constants);
  fputs ("static const unsigned char is_harmonic[] = { ", scene->out);
  for (int i = 0; i < s->sources; i++) fprintf (scene->out, "%d, ", s->source[i].signal.type == PW_HARMONIC);
  fputs ("0 };\n", scene->out);
  pw_specialise_list (scene->out, "DATUM", data + 4 * s->sources);
  pw_specialise_list (scene->out, "SIGNAL", 3 * s->sources);
  pw_specialise_list (scene->out, "ENTRY", scene->entries);
  pw_specialise_list (scene->out, "FIXED", scene->constants);
  pw_specialise_list (scene->out, "LEDGER", s->entries);
  pw_specialise_list (scene->out, "BATCH", s->batches + 1);
  pw_specialise_list (scene->out, "WATCH", (int)(sizeof (pw_scene_watch) / sizeof (double)));
}
