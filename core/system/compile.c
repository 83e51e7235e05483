/* Compiles a description: names become indices, elements become one batch per element type.
 *
 * The system is one allocation.  compile_layout runs twice, first to compute its size, then to place the arrays;
 * compile_fill.c fills them. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "compile.h"

/* ---- Counting ---- */

static int compile_names (pw_compilation *c, pw_error *error) {
  const pw_model *m = c->m;
  if (pw_names_open (&c->body, (size_t)m->bodies) != PW_OK || pw_names_open (&c->element, (size_t)m->elements) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "model %s: out of memory", m->name);
  for (int i = 0; i < m->bodies; i++)
    if (m->body[i].name && pw_names_add (&c->body, m->body[i].name, i) >= 0)
      return pw_fail (error, PW_INPUT, "model %s: two bodies are named \"%s\"", m->name, m->body[i].name);
  for (int i = 0; i < m->elements; i++) {
    const char *name = pw_element_name (&m->element[i]);
    if (name == NULL) continue;
    if (pw_names_find (&c->body, name) >= 0)
      return pw_fail (error, PW_INPUT, "model %s: a body and a %s are both named \"%s\"", m->name,
                      m->element[i].kind->name, name);
    if (pw_names_add (&c->element, name, i) >= 0)
      return pw_fail (error, PW_INPUT, "model %s: two elements are named \"%s\"", m->name, name);
  }
  return pw_check_model (m, &c->body, error);
}

int pw_compile_copies (const pw_model *m, const pw_kind *kind) {
  int massive = 0;
  if (!kind->each_body) return 1;
  for (int i = 0; i < m->bodies; i++) massive += m->body[i].mass > 0;
  return massive;
}

/* Batches: holonomic types in order of appearance, then nonholonomic ones, then forces. */
static int compile_kinds (pw_compilation *c, pw_error *error) {
  static const pw_level order[] = { PW_HOLONOMIC, PW_NONHOLONOMIC, PW_FORCE };
  const pw_model *m = c->m;
  size_t room = (size_t)m->elements + 1;
  c->kind = malloc (room * sizeof *c->kind);
  c->count = calloc (room, sizeof *c->count);
  c->slab_of = malloc (room * sizeof *c->slab_of);
  c->array = calloc (room, sizeof *c->array);
  if (c->kind == NULL || c->count == NULL || c->slab_of == NULL || c->array == NULL)
    return pw_fail (error, PW_RESOURCE, "model %s: out of memory", m->name);
  for (int l = 0; l < 3; l++)
    for (int i = 0; i < m->elements; i++) {
      const pw_kind *kind = m->element[i].kind;
      if (kind->level != order[l]) continue;
      int k = 0;
      while (k < c->kinds && c->kind[k] != kind) k++;
      if (k == c->kinds) c->kind[c->kinds++] = kind;
      c->count[k] += pw_compile_copies (m, kind);
      c->slab_of[i] = k;
      if (c->room < kind->element + PW_COMPILE_GUARD) c->room = kind->element + PW_COMPILE_GUARD;
    }
  c->prepared = malloc (c->room + 1);
  return c->prepared ? PW_OK : pw_fail (error, PW_RESOURCE, "model %s: out of memory", m->name);
}

static int compile_ledger_entries (const pw_kind *k) {
  return (k->power != NULL || (k->rows > 0 && k->eta != NULL)) + (k->loss != NULL);
}

static int compile_count (pw_compilation *c, pw_error *error) {
  const pw_model *m = c->m;
  double coords = 3.0 * m->bodies, rows = 0, entries = 0;
  if (m->bodies == 0) return pw_fail (error, PW_INPUT, "model %s has no body", m->name);
  for (int k = 0; k < c->kinds; k++) {
    coords += (double)c->count[k] * c->kind[k]->own;
    rows += (double)c->count[k] * c->kind[k]->rows;
    if (c->kind[k]->level == PW_HOLONOMIC) c->size.holonomic += c->count[k] * c->kind[k]->rows;
    entries += (double)c->count[k] * compile_ledger_entries (c->kind[k]);
    c->size.sources += c->count[k] * c->kind[k]->signals;
  }
  if (coords > INT_MAX / 64 || rows > INT_MAX / 64) return pw_fail (error, PW_INPUT, "model %s is too large", m->name);
  c->size.bodies = m->bodies;
  c->size.coords = (int)coords;
  c->size.rows = (int)rows;
  c->size.entries = (int)entries;
  c->size.batches = c->kinds;
  c->text = strlen (m->name) + 1;
  for (int i = 0; i < m->bodies; i++) c->text += strlen (m->body[i].name) + 1;
  for (int i = 0; i < m->elements; i++) {
    const pw_element *e = &m->element[i];
    c->text += strlen (pw_element_name (e)) + 1;
    for (int u = 0; u < e->kind->signals; u++) {
      const pw_signal *signal = pw_field_at (e->kind, e->definition, PW_SIGNAL, u);
      if (signal->type == PW_TABLE) c->points += (size_t)signal->table.count * (size_t)pw_compile_copies (m, e->kind);
      if (signal->type != PW_FUNCTION || signal->function.reads == NULL) continue;
      for (const char *const *r = signal->function.reads; *r; r++) c->size.reads += pw_compile_copies (m, e->kind);
    }
  }
  return PW_OK;
}

/* ---- One allocation ---- */

static void compile_layout_batch (const pw_compilation *c, pw_layout *l, pw_element_batch *k, int i) {
  const pw_kind *kind = c->kind[i];
  size_t n = (size_t)c->count[i], bodies = n * (size_t)kind->bodies;
  pw_batch_arrays *a = &c->array[i];
  a->element = pw_take (l, n, kind->element);
  a->body = pw_take (l, bodies, sizeof *a->body);
  a->column = pw_take (l, bodies, sizeof *a->column);
  void *name = pw_take (l, n, sizeof (char *));
  if (l->base == NULL) return;
  *k = (pw_element_batch){ .kind = kind, .column = a->column, .name = name };
  k->b =
      (pw_batch){ .count = c->count[i], .cols = 3 * kind->bodies + kind->own, .element = a->element, .body = a->body };
}

static void compile_layout (const pw_compilation *c, pw_layout *l, pw_system **system, pw_pools *pools) {
  size_t coords = (size_t)c->size.coords, bodies = (size_t)c->size.bodies;
  pw_system *s = pw_take (l, 1, sizeof *s), none;
  if (l->base == NULL) s = &none;
  *s = c->size;
  s->batch = pw_take (l, (size_t)c->size.batches + 1, sizeof *s->batch);
  s->source = pw_take (l, (size_t)c->size.sources, sizeof *s->source);
  s->body_name = pw_take (l, bodies, sizeof *s->body_name);
  s->mass = pw_take (l, coords, sizeof *s->mass);
  s->metric = pw_take (l, coords, sizeof *s->metric);
  s->constant = pw_take (l, coords + 3, sizeof *s->constant);
  s->q0 = pw_take (l, coords, sizeof *s->q0);
  s->v0 = pw_take (l, coords, sizeof *s->v0);
  s->held = pw_take (l, 2 * coords, 1);
  s->entry = pw_take (l, (size_t)c->size.entries, sizeof *s->entry);
  for (int i = 0; i < c->kinds; i++) compile_layout_batch (c, l, l->base ? s->batch + i : NULL, i);
  pools->table = pw_take (l, 4 * c->points, sizeof (double));
  pools->state = pw_take (l, (size_t)c->size.reads, sizeof (int));
  pools->text = pw_take (l, c->text, 1);
  *system = s;
}

static pw_system *compile_allocate (const pw_compilation *c, pw_pools *pools, pw_error *error) {
  pw_layout l = { NULL, 0 };
  pw_system *s = NULL;
  compile_layout (c, &l, &s, pools);
  l = (pw_layout){ calloc (1, l.used), 0 };
  if (l.base == NULL) {
    pw_fail (error, PW_RESOURCE, "model %s: out of memory", c->m->name);
    return NULL;
  }
  compile_layout (c, &l, &s, pools);
  return s;
}

/* ---- */

pw_system *pw_system_compile (const pw_model *m, pw_error *error) {
  pw_compilation c = { .m = m };
  pw_pools pools;
  pw_system *s = NULL;
  if (pw_require (m, "a model", error) != PW_OK) return NULL;
  if (!m->built)
    pw_fail (error, PW_INPUT, "model %s: pw_system_compile before pw_model_build", m->name);
  else if (m->error.status != PW_OK) /* from something added after pw_model_build */
    pw_fail (error, m->error.status, "%s", m->error.text);
  else if (compile_names (&c, error) == PW_OK && compile_kinds (&c, error) == PW_OK &&
           compile_count (&c, error) == PW_OK)
    s = compile_allocate (&c, &pools, error);
  if (s && pw_compile_fill (&c, s, &pools, error) != PW_OK) {
    pw_system_free (s);
    s = NULL;
  }
  pw_names_close (&c.body);
  pw_names_close (&c.element);
  free (c.kind);
  free (c.count);
  free (c.slab_of);
  free (c.array);
  free (c.prepared);
  return s;
}

void pw_close_signals (const pw_source *source, int count) {
  for (int i = 0; i < count; i++) {
    const pw_signal *signal = &source[i].signal;
    if (signal->type == PW_FUNCTION && signal->function.open && signal->function.close)
      signal->function.close (signal->function.context);
  }
}

void pw_system_free (pw_system *s) {
  if (s) pw_close_signals (s->source, s->sources);
  free (s);
}
