/* Writes the functions of elements and signals in specialised code, with macros of specialise.c and scene_head.inc. */
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

/* Opens a block with a batch `b` of element e alone; `more` ends the initialiser of b. */
static void specialise_batch (const pw_generator *gen, int k, int e, const char *more) {
  const pw_element_batch *batch = &gen->s->batch[k];
  fprintf (gen->out, "  { /* %s */\n    static const int body[] = { ", batch->name[e]);
  for (int n = 0; n < batch->kind->bodies; n++)
    fprintf (gen->out, "%s%d", n ? ", " : "", batch->b.body[e * batch->kind->bodies + n]);
  fprintf (gen->out, "%s };\n    const pw_batch b = { .count = 1, .cols = %d, .body = body, .configuration = c,\n",
           batch->kind->bodies ? "" : "0", batch->b.cols);
  fprintf (gen->out, "      .element = (const char *)s->element[%d] + %zu", k, (size_t)e * batch->kind->element);
  if (batch->kind->internal)
    fprintf (gen->out, ", .q = q + %d, .v = v + %d", batch->internal + e * batch->kind->internal,
             batch->internal + e * batch->kind->internal);
  if (batch->kind->signals)
    fprintf (gen->out, ", .u = s->u + %d", 3 * ((int)(batch->source - gen->s->source) + e * batch->kind->signals));
  fprintf (gen->out, "%s };\n", more);
}

/* Writes the call of a function of the type of batch k, which stores the result at `to`.  scene_TYPE is the table of a
 * built-in type in the code: the Makefile renames pw_kind_TYPE. */
static void specialise_call (const pw_generator *gen, int k, const char *function, const char *to) {
  char name[80];
  const pw_kind *kind = gen->s->batch[k].kind;
  if (pw_kind_is_built_in (kind))
    fprintf (gen->out, "    scene_%s.%s (&b, %s);\n", pw_specialise_identifier (kind, name, sizeof name), function, to);
  else
    fprintf (gen->out, "    s->kind[%d]->%s (&b, %s);\n", k, function, to);
}

/* The parameters of the generated functions, and statements that mark them as used. */
#define ARGUMENTS "const pw_scene *s, const pw_configuration *c, const double *q, const double *v, double *out"
#define UNUSED "  (void)s, (void)c, (void)q, (void)v, (void)out;\n"

/* Writes a function of the first `rows` constraint equations, which fills J, or one number for each equation, by calls
 * of `function`, the member of the types' tables at `offset`; zeros for types where that is NULL. */
static void specialise_rows (const pw_generator *gen, const char *name, const char *function, size_t offset, int rows) {
  char to[40];
  fprintf (gen->out, "\nINLINE void %s (" ARGUMENTS ") {\n" UNUSED, name);
  for (int k = 0; k < gen->s->constraints && gen->s->batch[k].row < rows; k++) {
    const pw_element_batch *batch = &gen->s->batch[k];
    for (int e = 0; e < batch->b.count; e++) {
      int first = e * batch->kind->rows, exists = pw_kind_function (batch->kind, offset) != NULL;
      for (int r = 0; !exists && r < batch->kind->rows; r++)
        fprintf (gen->out, "  out[%d] = 0;\n", batch->row + first + r);
      if (!exists) continue;
      specialise_batch (gen, k, e, "");
      int at = offset == offsetof (pw_kind, J) ? pw_specialise_J (gen, k, e) : batch->row + first;
      snprintf (to, sizeof to, "out + %d", at);
      specialise_call (gen, k, function, to);
      fputs ("  }\n", gen->out);
    }
  }
  fputs ("}\n", gen->out);
}

int pw_specialise_force (const pw_generator *gen, int j) {
  int forces = 0;
  for (int k = 0; k < gen->s->batches; k++) {
    const pw_element_batch *batch = &gen->s->batch[k];
    for (int i = 0; batch->kind->force && i < batch->b.count * batch->b.cols; i++)
      if (gen->sparsity[k].force[i % batch->b.cols] != PW_ENTRY_ZERO &&
          pw_global (batch, i / batch->b.cols, i % batch->b.cols) == j)
        forces |= batch->kind->constant ? SPECIALISE_CONSTANT : SPECIALISE_CHANGING;
  }
  return forces;
}

static void specialise_forces (const pw_generator *gen) {
  const pw_system *s = gen->s;
  fprintf (gen->out, "\nINLINE void forces (" ARGUMENTS ") {\n" UNUSED);
  for (int j = 0; j < s->coords; j++)
    fprintf (gen->out,
             pw_specialise_force (gen, j) & SPECIALISE_CONSTANT ? "  out[%d] = s->force[%d];\n" : "  out[%d] = 0;\n", j,
             j);
  for (int k = 0; k < s->batches; k++) {
    const pw_element_batch *batch = &s->batch[k];
    for (int e = 0; batch->kind->force && !batch->kind->constant && e < batch->b.count; e++) {
      specialise_batch (gen, k, e, "");
      fprintf (gen->out, "    double f[%d];\n", batch->b.cols);
      specialise_call (gen, k, "force", "f");
      for (int c = 0; c < batch->b.cols; c++)
        if (gen->sparsity[k].force[c] != PW_ENTRY_ZERO && pw_global (batch, e, c) < s->coords)
          fprintf (gen->out, "    out[%d] += f[%d];\n", pw_global (batch, e, c), c);
      fputs ("  }\n", gen->out);
    }
  }
  fputs ("}\n", gen->out);
}

/* Writes the function of the ledger's powers (pw_evaluate_ledger); that of a constraint is -lambda^T eta by default. */
static void specialise_ledger (const pw_generator *gen) {
  const pw_system *s = gen->s;
  char more[40];
  fputs ("\nINLINE void ledger (const pw_scene *s, const pw_configuration *c, const double *q, const double *v,\n"
         "                           const double *lambda, double *out) {\n" UNUSED "  (void)lambda;\n",
         gen->out);
  for (int i = 0; i < s->entries; i++) {
    const pw_element_batch *batch = &s->batch[s->entry[i].batch];
    int k = s->entry[i].batch, e = s->entry[i].element, rows = batch->kind->rows, row = batch->row + e * rows;
    int by_eta = rows > 0 && s->entry[i].type == PW_WORK && batch->kind->power == NULL;
    snprintf (more, sizeof more, ", .lambda = lambda + %d", row);
    specialise_batch (gen, k, e, more);
    fprintf (gen->out, "    double y[%d];\n", rows > 0 ? rows : 1);
    specialise_call (gen, k, by_eta ? "eta" : s->entry[i].type == PW_WORK ? "power" : "loss", "y");
    fprintf (gen->out, "    out[%d] = ", i);
    if (!by_eta) fputs ("y[0]", gen->out);
    for (int r = 0; by_eta && r < rows; r++) fprintf (gen->out, "%s - lambda[%d] * y[%d]", r ? "" : "0", row + r, r);
    fputs (";\n  }\n", gen->out);
  }
  fputs ("}\n", gen->out);
}

void pw_specialise_elements (const pw_generator *gen) {
  specialise_rows (gen, "jacobian", "J", offsetof (pw_kind, J), gen->s->rows);
  specialise_rows (gen, "constraints", "g", offsetof (pw_kind, g), gen->s->holonomic);
  specialise_rows (gen, "sizes", "g_size", offsetof (pw_kind, g_size), gen->s->holonomic);
  specialise_rows (gen, "right_sides", "eta", offsetof (pw_kind, eta), gen->s->rows);
  specialise_rows (gen, "gammas", "gamma", offsetof (pw_kind, gamma), gen->s->rows);
  specialise_forces (gen);
  specialise_ledger (gen);
}

/* ---- Signals ---- */

/* 1 if all signals are constant or harmonic, which generated code evaluates itself. */
static int specialise_is_simple (const pw_system *s) {
  for (int i = 0; i < s->sources; i++)
    if (s->source[i].signal.type != PW_CONSTANT && s->source[i].signal.type != PW_HARMONIC) return 0;
  return 1;
}

/* If a signal is neither, `update` evaluates all of them; for several runs at once lanes_signals calls it. */
void pw_specialise_signals (const pw_generator *gen) {
  const pw_system *s = gen->s;
  const int simple = specialise_is_simple (s);
  fputs ("\nGUARDED signals (pw_scene *s, double t, const double *q, const double *v) {\n  GUARDS;\n"
         "  (void)s, (void)t, (void)q, (void)v;\n",
         gen->out);
  if (!simple)
    fprintf (gen->out, "#ifndef PW_LANES\n  %sreturn s->update (s->workspace, t, q, v);\n#endif\n",
             s->state_dependent ? "" : "if (t != *s->t_signal) ");
  for (int i = 0; i < s->sources && simple; i++) {
    if (i == 0) fputs ("  SIGNALS_BEGIN (t);\n", gen->out);
    if (s->source[i].signal.type == PW_CONSTANT) {
      fprintf (gen->out, "  s->u[%d] = CONSTANT (%d);\n", 3 * i, i);
      if (!s->source[i].of_force) fprintf (gen->out, "  s->u[%d] = s->u[%d] = 0;\n", 3 * i + 1, 3 * i + 2);
    } else
      fprintf (gen->out, "  GUARD_CALL (harmonic (HARMONIC (%d), t, %d, s->u + %d));\n", i, !s->source[i].of_force,
               3 * i);
  }
  if (simple) fputs ("  SIGNALS_END (t);\n", gen->out);
  fputs ("  GUARDS_HOLD;\n}\n", gen->out);
}

/* ---- Lanes ---- */

int pw_system_check_source (const pw_system *s, pw_error *error) {
  const struct {
    int count, most;
    const char *what;
  } limit[] = { { s->rows, SPECIALISE_ROWS, "constraint equations" },
                { pw_system_elements (s), SPECIALISE_ELEMENTS, "elements" },
                { s->bodies, SPECIALISE_BODIES, "bodies" } };
  for (size_t i = 0; i < sizeof limit / sizeof *limit; i++)
    if (limit[i].count > limit[i].most)
      return pw_fail (error, PW_INPUT, "model %s: %d %s: specialised code has at most %d", s->model, limit[i].count,
                      limit[i].what, limit[i].most);
  return PW_OK;
}

int pw_system_has_lanes (const pw_system *s) {
  for (int k = 0; k < s->batches; k++)
    if (!pw_kind_is_built_in (s->batch[k].kind) || s->batch[k].kind->element % sizeof (double)) return 0;
  return s->state_dependent == 0 && pw_system_check_source (s, NULL) == PW_OK;
}

/* A run's data, as doubles: the elements of all batches, then for each signal a pw_harmonic or a constant and zeros. */
void pw_specialise_data (const pw_generator *gen) {
  const pw_system *s = gen->s;
  const int per_signal = sizeof (pw_harmonic) / sizeof (double);
  int data = 0;
  fputs ("\nstatic const int datum_begin[] = { ", gen->out);
  for (int k = 0; k < s->batches; k++) {
    fprintf (gen->out, "%d, ", data);
    data += s->batch[k].b.count * (int)(s->batch[k].kind->element / sizeof (double));
  }
  fprintf (gen->out, "%d };\nenum { BATCHES = %d, SIGNALS = %d, SIMPLE = %d, DATA = %d, FIXED = %d };\n", data,
           s->batches, s->sources, specialise_is_simple (s), data + per_signal * s->sources, gen->emitter.constants);
  fputs ("static const unsigned char is_harmonic[] = { ", gen->out);
  for (int i = 0; i < s->sources; i++) fprintf (gen->out, "%d, ", s->source[i].signal.type == PW_HARMONIC);
  fputs ("0 };\n", gen->out);
  pw_specialise_list (gen->out, "DATUM", data + per_signal * s->sources);
  pw_specialise_list (gen->out, "SIGNAL", 3 * s->sources);
  pw_specialise_list (gen->out, "ENTRY", gen->J_entries);
  pw_specialise_list (gen->out, "FIXED", gen->emitter.constants); /* pw_scene.constant */
  pw_specialise_list (gen->out, "LEDGER", s->entries);
  pw_specialise_list (gen->out, "BATCH", s->batches + 1); /* the last one: the signals */
  pw_specialise_list (gen->out, "WATCH", (int)(sizeof (pw_scene_watch) / sizeof (double)));
}
