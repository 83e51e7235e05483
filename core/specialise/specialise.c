/* Writes a compiled system as C code for this scene alone: the sources of its element types, called for one element at a
 * time with constant indices, and a factorisation without loops. */
#define _POSIX_C_SOURCE 200809L
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "elimination.h"
#include "specialised.h"
#include "sparsity.h"
#include "sources.h"

enum {
  SPECIALISE_ROWS = 60, /* beyond, code without loops becomes too long */
  SPECIALISE_INLINE = 8 /* up to this, everything is inlined, so that common parts are computed once */
};

typedef struct {
  const pw_system *s;
  const unsigned char *independent; /* or NULL */
  FILE *out;
  pw_workspace *w;       /* at the initial state */
  pw_sparsity *sparsity; /* batches */
  int *J;                /* batches: first entry of J */
  int *u;                /* batches: first signal */
  int entries;           /* of J */
  int holonomic_only;    /* 1: positions are projected by the holonomic equations alone */
  char *prepare;         /* text of prepare's statements */
  size_t prepared;
  int constants;
} specialise_scene;

/* ---- Text ---- */

static int specialise_is_built_in (const pw_kind *kind) {
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if (*k == kind) return 1;
  return 0;
}

/* "rolling_wheel" */
static char *specialise_identifier (const pw_kind *kind, char *buffer, size_t size) {
  snprintf (buffer, size, "%s", kind->name);
  for (char *c = buffer; *c; c++)
    if (*c == '-') *c = '_';
  return buffer;
}

static const pw_source_text *specialise_find_source (const char *name) {
  for (const pw_source_text *t = pw_source_texts; t->name; t++)
    if (strcmp (t->name, name) == 0) return t;
  return NULL;
}

enum { SPECIALISE_SOURCES = 64 };

/* Writes a source once, after the headers of element types that it includes. */
static void specialise_source (FILE *out, const char *name, const pw_source_text **done, int *count) {
  const pw_source_text *source = specialise_find_source (name);
  char header[80];
  for (int i = 0; i < *count; i++)
    if (done[i] == source) return;
  if (source == NULL || *count == SPECIALISE_SOURCES) return;
  done[(*count)++] = source;
  for (const char *const *line = source->line; *line; line++)
    if (sscanf (*line, "#include \"%79[a-z_0-9.]\"", header) == 1) specialise_source (out, header, done, count);
  fprintf (out, "\n/* ---- %s ---- */\n\n", name);
  for (const char *const *line = source->line; *line; line++)
    if (strncmp (*line, "#include \"", 10) != 0) fputs (*line, out);
}

static void specialise_sources (const specialise_scene *x) {
  const pw_source_text *done[SPECIALISE_SOURCES];
  char name[80], file[90];
  int count = 0;
  fputs ("#include <math.h>\n#include <string.h>\n#include \"pinwheel.h\"\n", x->out);
  specialise_source (x->out, "specialised.h", done, &count);
  specialise_source (x->out, "sine.h", done, &count);
  for (int k = 0; k < x->s->batches; k++) {
    if (!specialise_is_built_in (x->s->batch[k].kind)) continue;
    snprintf (file, sizeof file, "%s.c", specialise_identifier (x->s->batch[k].kind, name, sizeof name));
    specialise_source (x->out, file, done, &count);
  }
}

/* ---- Elements ---- */

/* Opens a block with a batch of one element, `more` at the end of its initialiser. */
static void specialise_batch (const specialise_scene *x, int k, int e, const char *more) {
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
  if (b->kind->signals) fprintf (x->out, ", .u = s->u + %d", 3 * (x->u[k] + e * b->kind->signals));
  fprintf (x->out, "%s };\n", more);
}

/* The call of a function of its type, as text. */
static void specialise_call (const specialise_scene *x, int k, const char *function, const char *to) {
  char name[80];
  const pw_kind *kind = x->s->batch[k].kind;
  if (specialise_is_built_in (kind))
    fprintf (x->out, "    scene_%s.%s (&b, %s);\n", specialise_identifier (kind, name, sizeof name), function, to);
  else
    fprintf (x->out, "    s->kind[%d]->%s (&b, %s);\n", k, function, to);
}

#define ARGUMENTS "const pw_scene *s, const pw_configuration *c, const double *q, const double *v, double *out"
#define UNUSED "  (void)s, (void)c, (void)q, (void)v, (void)out;\n"

/* A function over constraint equations; `function` is at `offset` of the table; NULL: zeros. */
static void specialise_rows (const specialise_scene *x, const char *name, const char *function, size_t offset,
                             int rows) {
  char to[40];
  fprintf (x->out, "\nINLINE void %s (" ARGUMENTS ") {\n" UNUSED, name);
  for (int k = 0; k < x->s->constraints && x->s->batch[k].row < rows; k++) {
    const pw_element_batch *b = &x->s->batch[k];
    int has = *(pw_batch_function *const *)(const void *)((const char *)b->kind + offset) != NULL;
    for (int e = 0; e < b->b.count; e++) {
      int row = b->row + e * b->kind->rows;
      for (int r = 0; !has && r < b->kind->rows; r++) fprintf (x->out, "  out[%d] = 0;\n", row + r);
      if (!has) continue;
      specialise_batch (x, k, e, "");
      snprintf (to, sizeof to, "out + %d", row);
      specialise_call (x, k, function, to);
      fputs ("  }\n", x->out);
    }
  }
  fputs ("}\n", x->out);
}

static void specialise_jacobian (const specialise_scene *x) {
  char to[40];
  fputs ("\nINLINE void jacobian (" ARGUMENTS ") {\n" UNUSED, x->out);
  for (int k = 0; k < x->s->constraints; k++) {
    const pw_element_batch *b = &x->s->batch[k];
    for (int e = 0; e < b->b.count; e++) {
      specialise_batch (x, k, e, "");
      snprintf (to, sizeof to, "out + %d", x->J[k] + e * b->kind->rows * b->b.cols);
      specialise_call (x, k, "J", to);
      fputs ("  }\n", x->out);
    }
  }
  fputs ("}\n", x->out);
}

static void specialise_forces (const specialise_scene *x) {
  const pw_system *s = x->s;
  fprintf (x->out,
           "\nINLINE void forces (" ARGUMENTS ") {\n" UNUSED "  for (int j = 0; j < %d; j++) out[j] = s->force[j];\n",
           s->coords);
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
static void specialise_ledger (const specialise_scene *x) {
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

/* ---- Signals ---- */

static void specialise_signals (const specialise_scene *x) {
  const pw_system *s = x->s;
  int simple = 1, reads = s->state_dependent;
  for (int i = 0; i < s->sources; i++)
    simple &= s->source[i].signal.type == PW_CONSTANT || s->source[i].signal.type == PW_HARMONIC;
  fputs ("\nINLINE int signals (pw_scene *s, double t, const double *q, const double *v) {\n  (void)q, (void)v;\n",
         x->out);
  if (s->sources && !simple)
    fprintf (x->out, "  %sreturn s->update (s->workspace, t, q, v);\n%s", reads ? "" : "if (t != *s->t_signal) ",
             reads ? "" : "  return 0;\n");
  else if (s->sources) {
    fputs ("  if (t == *s->t_signal) return 0;\n", x->out);
    for (int i = 0; i < s->sources; i++) {
      if (s->source[i].signal.type == PW_CONSTANT) {
        fprintf (x->out, "  s->u[%d] = s->signal[%d]->constant;\n", 3 * i, i);
        if (!s->source[i].of_force) fprintf (x->out, "  s->u[%d] = s->u[%d] = 0;\n", 3 * i + 1, 3 * i + 2);
      } else
        fprintf (x->out, "  if (harmonic (&s->signal[%d]->harmonic, t, %d, s->u + %d)) return 1;\n", i,
                 !s->source[i].of_force, 3 * i);
    }
    fputs ("  *s->t_signal = t;\n  return 0;\n", x->out);
  } else
    fputs ("  *s->t_signal = t;\n  return 0;\n", x->out);
  fputs ("}\n", x->out);
}

/* ---- Linear algebra ---- */

static int specialise_is_independent (const specialise_scene *x, int row) {
  return x->independent == NULL || x->independent[row];
}

static pw_term specialise_entry (const specialise_scene *x, int k, int e, int r, int c) {
  const pw_element_batch *b = &x->s->batch[k];
  unsigned char type = x->sparsity[k].J[r * b->b.cols + c];
  int at = x->J[k] + (e * b->kind->rows + r) * b->b.cols + c;
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

static pw_term *specialise_matrix (const specialise_scene *x) {
  const pw_system *s = x->s;
  size_t n = (size_t)(s->coords + s->rows);
  pw_term *K = malloc ((n * n + 1) * sizeof *K);
  if (K == NULL) return NULL;
  for (size_t i = 0; i < n * n; i++) K[i] = pw_term_zero ();
  for (int j = 0; j < s->coords; j++)
    if (s->mass[j] > 0) K[(size_t)j * n + (size_t)j] = pw_term_named (PW_TERM_CONSTANT, "M", j, s->mass[j]);
  EACH_ENTRY (k, e, r, c) {
    size_t i = (size_t)(s->coords + s->batch[k].row + e * s->batch[k].kind->rows + r);
    size_t j = (size_t)pw_global (&s->batch[k], e, c);
    K[i * n + j] = K[j * n + i] = specialise_entry (x, k, e, r, c);
  }
  return K;
}

enum { SPECIALISE_ACCELERATE, SPECIALISE_VELOCITY, SPECIALISE_POSITION };

/* solve...: a and lambda of forces f and right-hand sides g; velocities and positions have no forces. */
static int specialise_solve (const specialise_scene *x, const pw_elimination *m, pw_emitter *e, int what) {
  static const char *const name[] = { "solve", "solve_velocity", "solve_position" };
  const pw_system *s = x->s;
  char text[24];
  pw_term *right = malloc ((size_t)m->n * sizeof *right + 1);
  if (right == NULL) return PW_RESOURCE;
  for (int i = 0; i < m->n; i++) {
    int row = i - s->coords, force = row < 0 && what == SPECIALISE_ACCELERATE;
    right[i] = row >= 0 ? pw_term_named (PW_TERM_VARIABLE, "g", row, 1) : pw_term_zero ();
    if (force) right[i] = pw_term_named (PW_TERM_VARIABLE, "f", i, 1);
    if (row >= 0 && !specialise_is_independent (x, row)) right[i] = pw_term_zero ();
    if (what == SPECIALISE_POSITION && row >= s->holonomic) right[i] = pw_term_zero ();
  }
  fprintf (x->out,
           "\nINLINE void %s (const double *C, const double *J, const double *F, %sconst double *g, double *a%s) {\n"
           "  (void)C, (void)J, (void)F, (void)g, (void)a;\n",
           name[what], what == SPECIALISE_ACCELERATE ? "const double *f, " : "",
           what == SPECIALISE_ACCELERATE ? ", double *lambda" : "");
  pw_elimination_solve (m, e, right);
  for (int j = 0; j < s->coords; j++) fprintf (x->out, "  a[%d] = %s;\n", j, pw_term_text (right[j], text));
  for (int i = 0; i < s->rows && what == SPECIALISE_ACCELERATE; i++)
    fprintf (x->out, "  lambda[%d] = %s;\n", i, pw_term_text (right[s->coords + i], text));
  fputs ("}\n", x->out);
  free (right);
  return PW_OK;
}

static int specialise_factor (const specialise_scene *x, pw_elimination *m, pw_emitter *e, const pw_term *K,
                              const char *name, int rows) {
  unsigned char takes_part[SPECIALISE_ROWS + 1];
  for (int i = 0; i < x->s->rows; i++) takes_part[i] = i < rows && specialise_is_independent (x, i);
  char *text = NULL;
  size_t size = 0;
  FILE *out = e->code = open_memstream (&text, &size);
  int status = out ? pw_elimination_open (m, x->s, K, takes_part, e) : PW_RESOURCE;
  if (out && fclose (out) != 0) status = PW_RESOURCE;
  e->code = x->out;
  if (status == PW_OK)
    fprintf (x->out,
             "\nINLINE int %s (const double *M, const double *C, const double *J, double *F) {\n"
             "  (void)M, (void)C, (void)J, (void)F;\n%s  return 0;\n}\n",
             name, text);
  free (text);
  return status;
}

/* ---- Products with J ---- */

/* Row r of element e times w, or the sum of the absolute values of its terms. */
static void specialise_row_product (const specialise_scene *x, int k, int e, int r, int absolute) {
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
static void specialise_product (const specialise_scene *x) {
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

/* ---- The whole ---- */

static void specialise_constants (const specialise_scene *x) {
  const pw_system *s = x->s;
  fprintf (x->out,
           "\n/* ---- The scene ---- */\n\nenum { BODIES = %d, N = %d, ROWS = %d, HOLONOMIC = %d, INTERNAL = %d,\n"
           "  ENTRIES = %d, REDUNDANT = %d, LEDGER = %d, RHEONOMIC = %d, READERS = %d };\n",
           s->bodies, s->coords, s->rows, s->holonomic, s->coords - 3 * s->bodies, x->entries, x->independent != NULL,
           s->entries, s->rheonomic > 0, s->state_dependent > 0);
  fprintf (x->out, "\n#define INLINE static inline%s\n\n",
           s->rows <= SPECIALISE_INLINE ? " __attribute__ ((always_inline))" : "");
  for (int b = 0; b < s->bodies; b++) {
    fprintf (x->out, "/* body %d: ", b);
    pw_emit_name (x->out, s->body_name[b]);
    fputs (" */\n", x->out);
  }
  for (int i = 0; i < s->rows; i++) {
    char name[120];
    fprintf (x->out, "/* equation %d: ", i);
    pw_emit_name (x->out, pw_system_reaction_name (s, i, name, sizeof name));
    fputs (" */\n", x->out);
  }
  fputs ("\nstatic const unsigned char independent[] = { ", x->out);
  for (int i = 0; i < s->rows; i++) fprintf (x->out, "%d, ", specialise_is_independent (x, i));
  fputs ("0 };\n", x->out);
}

/* Factorisations and solutions; prepare's statements are collected. */
static int specialise_algebra (specialise_scene *x) {
  const pw_system *s = x->s;
  pw_elimination all = { 0 }, position = { 0 };
  pw_emitter e = { .prepare = open_memstream (&x->prepare, &x->prepared), .code = x->out };
  pw_term *K = specialise_matrix (x);
  int status = K && e.prepare ? specialise_factor (x, &all, &e, K, "factor", s->rows) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_solve (x, &all, &e, SPECIALISE_ACCELERATE);
  if (status == PW_OK) status = specialise_solve (x, &all, &e, SPECIALISE_VELOCITY);
  x->holonomic_only = 1;
  if (status == PW_OK) {
    status = specialise_factor (x, &position, &e, K, "factor_position", s->holonomic);
    if (status == PW_RETRY) {
      x->holonomic_only = 0;
      status = specialise_solve (x, &all, &e, SPECIALISE_POSITION);
    } else if (status == PW_OK)
      status = specialise_solve (x, &position, &e, SPECIALISE_POSITION);
  }
  x->constants = e.constants;
  fprintf (x->out, "\nenum { FACTORS = %d };\n", 1 + (all.factors > position.factors ? all.factors : position.factors));
  if (!x->holonomic_only) fputs ("#define factor_position factor\n", x->out);
  if (e.prepare && fclose (e.prepare) != 0) status = PW_RESOURCE;
  pw_elimination_close (&all);
  pw_elimination_close (&position);
  free (K);
  return status;
}

static int specialise_write (specialise_scene *x) {
  const pw_source_text *done[SPECIALISE_SOURCES];
  int count = 0;
  fputs ("/* Generated by Pinwheel for the scene \"", x->out);
  pw_emit_name (x->out, x->s->model);
  fputs ("\".  Compile with: cc -std=c11 -O2 -ffp-contract=off -fPIC -shared */\n", x->out);
  specialise_sources (x);
  specialise_constants (x);
  specialise_jacobian (x);
  specialise_rows (x, "constraints", "g", offsetof (pw_kind, g), x->s->holonomic);
  specialise_rows (x, "sizes", "g_size", offsetof (pw_kind, g_size), x->s->holonomic);
  specialise_rows (x, "right_sides", "eta", offsetof (pw_kind, eta), x->s->rows);
  specialise_rows (x, "gammas", "gamma", offsetof (pw_kind, gamma), x->s->rows);
  specialise_forces (x);
  specialise_ledger (x);
  specialise_product (x);
  int status = specialise_algebra (x);
  specialise_source (x->out, "scene_head.inc", done, &count);
  specialise_signals (x);
  specialise_source (x->out, "scene_tail.inc", done, &count);

  fprintf (x->out,
           "\nstatic int prepare (pw_scene *s) {\n  const double *const M = s->mass;\n  double *const C = s->constant, "
           "J[ENTRIES + 1];\n"
           "  reference_jacobian (s, J);\n  (void)M, (void)C, (void)J;\n%s  return 0;\n}\n",
           x->prepare ? x->prepare : "");
  return status;
}

static int specialise_open (specialise_scene *x) {
  const pw_system *s = x->s;
  size_t n = (size_t)s->batches + 1;
  x->sparsity = malloc (n * sizeof *x->sparsity);
  x->J = malloc (2 * n * sizeof *x->J);
  x->w = pw_workspace_new (s, NULL);
  if (x->sparsity == NULL || x->J == NULL || x->w == NULL) return PW_RESOURCE;
  if (pw_update_kinematics (x->w, 0, s->q0, s->v0) == PW_OK) pw_evaluate_J (x->w);
  x->u = x->J + n;
  int u = 0, status = PW_OK;
  for (int k = 0; k < s->batches && status == PW_OK; k++) {
    const pw_element_batch *b = &s->batch[k];
    x->J[k] = x->entries, x->u[k] = u;
    x->entries += b->b.count * b->kind->rows * b->b.cols;
    u += b->b.count * b->kind->signals;
    status = pw_sparsity_find (b->kind, &x->sparsity[k]);
  }
  return status;
}

static void specialise_hash (uint64_t *h, const void *bytes, size_t size) {
  for (const unsigned char *b = bytes; size > 0; size--) *h = (*h ^ *b++) * 1099511628211u; /* FNV-1a */
}

unsigned long pw_system_shape (const pw_system *s) {
  uint64_t h = 14695981039346656037u;
  const int counts[] = {
    s->bodies, s->coords, s->rows, s->holonomic, s->batches, s->entries, s->sources, s->rheonomic
  };
  specialise_hash (&h, counts, sizeof counts);
  for (int j = 0; j < s->coords; j++) specialise_hash (&h, &(char){ s->mass[j] > 0 }, 1);
  for (int k = 0; k < s->batches; k++) {
    const pw_element_batch *b = &s->batch[k];
    specialise_hash (&h, b->kind->name, strlen (b->kind->name) + 1);
    specialise_hash (&h, b->b.body, (size_t)(b->b.count * b->kind->bodies) * sizeof *b->b.body);
    const int sizes[] = { b->b.count, (int)b->kind->element, b->kind->rows, b->kind->internal, b->kind->signals };
    specialise_hash (&h, sizes, sizeof sizes);
  }
  for (int i = 0; i < s->sources; i++)
    specialise_hash (&h, (int[]){ (int)s->source[i].signal.type, s->source[i].of_force, s->source[i].reads },
                     3 * sizeof (int));
  for (int i = 0; i < s->entries; i++)
    specialise_hash (&h, (int[]){ s->entry[i].batch, s->entry[i].element, (int)s->entry[i].type }, 3 * sizeof (int));
  return (unsigned long)h;
}

int pw_specialised_fits (const pw_specialised *code, const pw_system *s) {
  return code->abi == PW_SCENE_ABI && code->shape == pw_system_shape (s);
}

char *pw_system_source (const pw_system *s, const unsigned char *independent, pw_error *error) {
  char *text = NULL;
  size_t size = 0;
  if (pw_require (s, "a system", error) != PW_OK) return NULL;
  if (s->rows > SPECIALISE_ROWS) {
    pw_fail (error, PW_INPUT, "model %s: %d constraint equations: specialised code has at most %d", s->model, s->rows,
             SPECIALISE_ROWS);
    return NULL;
  }
  specialise_scene x = { .s = s, .independent = independent, .out = open_memstream (&text, &size) };
  int status = x.out ? specialise_open (&x) : PW_RESOURCE;
  if (status == PW_OK) status = specialise_write (&x);
  if (status == PW_OK) {
    fprintf (x.out,
             "\nPW_EXPORT const pw_specialised pw_specialised_scene = {\n"
             "  PW_SCENE_ABI, %d, %luu, independent, prepare, evaluate, project\n};\n",
             x.constants + 1, pw_system_shape (s));
  }
  if (x.out && fclose (x.out) != 0) status = PW_RESOURCE;
  pw_workspace_free (x.w);
  free (x.sparsity);
  free (x.J);
  free (x.prepare);
  if (status == PW_OK) return text;
  free (text);
  if (status == PW_RETRY)
    pw_fail (error, PW_INPUT, "model %s: no fixed order of elimination: redundant constraints, or a massless body",
             s->model);
  else
    pw_fail (error, status, "model %s: out of memory", s->model);
  return NULL;
}
