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
static void specialise_batch (const pw_specialise_scene *x, int k, int e, const char *more) {
  const pw_element_batch *b = &x->s->batch[k];
  fputs ("  { /* ", x->out);
  pw_emit_name (x->out, b->kind->name);
  fputc (' ', x->out);
  pw_emit_name (x->out, b->name[e]);
  fputs (" */\n    static const int body[] = { ", x->out);
  for (int n = 0; n < b->kind->bodies; n++) fprintf (x->out, "%s%d", n ? ", " : "", b->b.body[e * b->kind->bodies + n]);
  fprintf (x->out, "%s };\n    const pw_batch b = { .count = 1, .cols = %d, .body = body, .configuration = c,\n",
           b->kind->bodies ? "" : "0", b->b.cols);
  fprintf (x->out, "      .element = (const char *)s->element[%d] + %zu", k, (size_t)e * b->kind->element);
  if (b->kind->internal)
    fprintf (x->out, ", .q = q + %d, .v = v + %d", b->internal + e * b->kind->internal,
             b->internal + e * b->kind->internal);
  if (b->kind->signals) fprintf (x->out, ", .u = s->u + %d", 3 * pw_specialise_u (x, k, e));
  fprintf (x->out, "%s };\n", more);
}

/* The call of a function of its type, as text. */
static void specialise_call (const pw_specialise_scene *x, int k, const char *function, const char *to) {
  char name[80];
  const pw_kind *kind = x->s->batch[k].kind;
  if (pw_kind_is_built_in (kind))
    fprintf (x->out, "    scene_%s.%s (&b, %s);\n", pw_specialise_identifier (kind, name, sizeof name), function, to);
  else
    fprintf (x->out, "    s->kind[%d]->%s (&b, %s);\n", k, function, to);
}

#define ARGUMENTS "const pw_scene *s, const pw_configuration *c, const double *q, const double *v, double *out"
#define UNUSED "  (void)s, (void)c, (void)q, (void)v, (void)out;\n"

/* A function of the first `rows` constraint equations, one number for each, or J; `function` is at `offset` of the table;
 * NULL: zeros. */
static void specialise_rows (const pw_specialise_scene *x, const char *name, const char *function, size_t offset,
                             int rows) {
  char to[40];
  fprintf (x->out, "\nINLINE void %s (" ARGUMENTS ") {\n" UNUSED, name);
  for (int k = 0; k < x->s->constraints && x->s->batch[k].row < rows; k++) {
    const pw_element_batch *b = &x->s->batch[k];
    for (int e = 0; e < b->b.count; e++) {
      int first = e * b->kind->rows, has = pw_kind_function (b->kind, offset) != NULL;
      for (int r = 0; !has && r < b->kind->rows; r++) fprintf (x->out, "  out[%d] = 0;\n", b->row + first + r);
      if (!has) continue;
      specialise_batch (x, k, e, "");
      int at = offset == offsetof (pw_kind, J) ? pw_specialise_J (x, k, e) : b->row + first;
      snprintf (to, sizeof to, "out + %d", at);
      specialise_call (x, k, function, to);
      fputs ("  }\n", x->out);
    }
  }
  fputs ("}\n", x->out);
}

int pw_specialise_force (const pw_specialise_scene *x, int j) {
  int has = 0;
  for (int k = 0; k < x->s->batches; k++) {
    const pw_element_batch *b = &x->s->batch[k];
    for (int i = 0; b->kind->force && i < b->b.count * b->b.cols; i++)
      if (x->sparsity[k].force[i % b->b.cols] != PW_ENTRY_ZERO && pw_global (b, i / b->b.cols, i % b->b.cols) == j)
        has |= b->kind->constant ? SPECIALISE_CONSTANT : SPECIALISE_CHANGING;
  }
  return has;
}

static void specialise_forces (const pw_specialise_scene *x) {
  const pw_system *s = x->s;
  fprintf (x->out, "\nINLINE void forces (" ARGUMENTS ") {\n" UNUSED);
  for (int j = 0; j < s->coords; j++)
    fprintf (x->out,
             pw_specialise_force (x, j) & SPECIALISE_CONSTANT ? "  out[%d] = s->force[%d];\n" : "  out[%d] = 0;\n", j,
             j);
  for (int k = 0; k < s->batches; k++) {
    const pw_element_batch *b = &s->batch[k];
    for (int e = 0; b->kind->force && !b->kind->constant && e < b->b.count; e++) {
      specialise_batch (x, k, e, "");
      fprintf (x->out, "    double f[%d];\n", b->b.cols);
      specialise_call (x, k, "force", "f");
      for (int c = 0; c < b->b.cols; c++)
        if (x->sparsity[k].force[c] != PW_ENTRY_ZERO && pw_global (b, e, c) < s->coords)
          fprintf (x->out, "    out[%d] += f[%d];\n", pw_global (b, e, c), c);
      fputs ("  }\n", x->out);
    }
  }
  fputs ("}\n", x->out);
}

/* The ledger's rates, as pw_evaluate_ledger. */
static void specialise_ledger (const pw_specialise_scene *x) {
  const pw_system *s = x->s;
  char more[40];
  fputs ("\nINLINE void ledger (const pw_scene *s, const pw_configuration *c, const double *q, const double *v,\n"
         "                           const double *lambda, double *out) {\n" UNUSED "  (void)lambda;\n",
         x->out);
  for (int i = 0; i < s->entries; i++) {
    const pw_element_batch *b = &s->batch[s->entry[i].batch];
    int k = s->entry[i].batch, e = s->entry[i].element, rows = b->kind->rows, row = b->row + e * rows;
    int drive = rows > 0 && s->entry[i].type == PW_WORK && b->kind->power == NULL;
    snprintf (more, sizeof more, ", .lambda = lambda + %d", row);
    specialise_batch (x, k, e, more);
    fprintf (x->out, "    double y[%d];\n", rows > 0 ? rows : 1);
    specialise_call (x, k, drive ? "eta" : s->entry[i].type == PW_WORK ? "power" : "loss", "y");
    fprintf (x->out, "    out[%d] = ", i);
    if (!drive) fputs ("y[0]", x->out);
    for (int r = 0; drive && r < rows; r++) fprintf (x->out, "%s - lambda[%d] * y[%d]", r ? "" : "0", row + r, r);
    fputs (";\n  }\n", x->out);
  }
  fputs ("}\n", x->out);
}

void pw_specialise_elements (const pw_specialise_scene *x) {
  specialise_rows (x, "jacobian", "J", offsetof (pw_kind, J), x->s->rows);
  specialise_rows (x, "constraints", "g", offsetof (pw_kind, g), x->s->holonomic);
  specialise_rows (x, "sizes", "g_size", offsetof (pw_kind, g_size), x->s->holonomic);
  specialise_rows (x, "right_sides", "eta", offsetof (pw_kind, eta), x->s->rows);
  specialise_rows (x, "gammas", "gamma", offsetof (pw_kind, gamma), x->s->rows);
  specialise_forces (x);
  specialise_ledger (x);
}

/* ---- Signals ---- */

static int specialise_is_simple (const pw_system *s) {
  for (int i = 0; i < s->sources; i++)
    if (s->source[i].signal.type != PW_CONSTANT && s->source[i].signal.type != PW_HARMONIC) return 0;
  return 1;
}

/* In lanes, signals of other forms have been evaluated before. */
void pw_specialise_signals (const pw_specialise_scene *x) {
  const pw_system *s = x->s;
  const int simple = specialise_is_simple (s);
  fputs ("\nGUARDED signals (pw_scene *s, double t, const double *q, const double *v) {\n  GUARDS;\n"
         "  (void)s, (void)t, (void)q, (void)v;\n",
         x->out);
  if (!simple)
    fprintf (x->out, "#ifndef PW_LANES\n  %sreturn s->update (s->workspace, t, q, v);\n#endif\n",
             s->state_dependent ? "" : "if (t != *s->t_signal) ");
  for (int i = 0; i < s->sources && simple; i++) {
    if (i == 0) fputs ("  SIGNALS_BEGIN (t);\n", x->out);
    if (s->source[i].signal.type == PW_CONSTANT) {
      fprintf (x->out, "  s->u[%d] = CONSTANT (%d);\n", 3 * i, i);
      if (!s->source[i].of_force) fprintf (x->out, "  s->u[%d] = s->u[%d] = 0;\n", 3 * i + 1, 3 * i + 2);
    } else
      fprintf (x->out, "  GUARD_CALL (harmonic (HARMONIC (%d), t, %d, s->u + %d));\n", i, !s->source[i].of_force,
               3 * i);
  }
  if (simple) fputs ("  SIGNALS_END (t);\n", x->out);
  fputs ("  GUARDS_HOLD;\n}\n", x->out);
}

/* ---- Lanes ---- */

int pw_system_has_lanes (const pw_system *s) {
  for (int k = 0; k < s->batches; k++)
    if (!pw_kind_is_built_in (s->batch[k].kind) || s->batch[k].kind->element % sizeof (double)) return 0;
  return s->rows <= SPECIALISE_ROWS && s->state_dependent == 0;
}

/* The prepared elements of all batches, then four numbers of each signal, one after the other. */
void pw_specialise_data (const pw_specialise_scene *x) {
  const pw_system *s = x->s;
  int data = 0;
  fputs ("\nstatic const int datum_begin[] = { ", x->out);
  for (int k = 0; k < s->batches; k++) {
    fprintf (x->out, "%d, ", data);
    data += s->batch[k].b.count * (int)(s->batch[k].kind->element / sizeof (double));
  }
  fprintf (x->out, "%d };\nenum { BATCHES = %d, SIGNALS = %d, SIMPLE = %d, DATA = %d, FIXED = %d };\n", data,
           s->batches, s->sources, specialise_is_simple (s), data + 4 * s->sources, x->constants);
  fputs ("static const unsigned char is_harmonic[] = { ", x->out);
  for (int i = 0; i < s->sources; i++) fprintf (x->out, "%d, ", s->source[i].signal.type == PW_HARMONIC);
  fputs ("0 };\n", x->out);
  pw_specialise_list (x->out, "DATUM", data + 4 * s->sources);
  pw_specialise_list (x->out, "SIGNAL", 3 * s->sources);
  pw_specialise_list (x->out, "ENTRY", x->entries);
  pw_specialise_list (x->out, "FIXED", x->constants);
  pw_specialise_list (x->out, "LEDGER", s->entries);
  pw_specialise_list (x->out, "BATCH", s->batches + 1);
  pw_specialise_list (x->out, "WATCH", (int)(sizeof (pw_scene_watch) / sizeof (double)));
}
