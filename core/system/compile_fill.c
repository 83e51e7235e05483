/* Fills a system that has been laid out: bodies, elements, signals, the ledger's entries, scales. */
#include <math.h>
#include <string.h>
#include "compile.h"
#include "signal.h"

static const char *compile_text (pw_pools *pools, const char *text) {
  char *copy = strcpy (pools->text, text);
  pools->text += strlen (text) + 1;
  return copy;
}

/* Origin of the initial value of a body's state (0 to 5); `perhaps` for a 0 of a body that does not say which it
 * specifies. */
static unsigned char compile_origin (const pw_body *b, double value, int state, unsigned char perhaps) {
  if (b->specified) return b->specified >> state & 1 ? PW_SPECIFIED : 0;
  return value != 0 ? PW_SPECIFIED : perhaps;
}

static void compile_bodies (const pw_compilation *c, pw_system *s, pw_pools *pools) {
  s->model = compile_text (pools, c->m->name);
  for (int i = 0; i < s->bodies; i++) {
    const pw_body *b = &c->m->body[i];
    s->body_name[i] = compile_text (pools, b->name);
    s->mass[3 * i] = s->mass[3 * i + 1] = b->mass;
    s->mass[3 * i + 2] = b->inertia;
    memcpy (s->q0 + 3 * i, b->start, sizeof b->start);
    memcpy (s->v0 + 3 * i, b->rate, sizeof b->rate);
    for (int k = 0; k < 3; k++) {
      s->held[3 * i + k] = compile_origin (b, b->start[k], k, PW_PERHAPS);
      s->held[s->coords + 3 * i + k] = compile_origin (b, b->rate[k], 3 + k, 0);
    }
  }
}

/* Copies the points of a table and computes its spline. */
static void compile_table (pw_source *source, pw_pools *pools) {
  pw_signal *s = &source->signal;
  size_t n = (size_t)s->table.count;
  double *t = memcpy (pools->table, s->table.t, n * sizeof *t), *value = t + n;
  for (size_t i = 0; i < n; i++) value[i] = pw_table_value (s, (int)i);
  s->table.value = value;
  s->table.scale = s->table.offset = 0;
  s->table.t = t;
  source->spline = value + n;
  pools->table += 4 * n;
  pw_table_spline (s, source->spline);
}

/* Converts the names of states a function reads to indices. */
static int compile_reads (const pw_compilation *c, pw_system *s, pw_source *source, const char *const *reads,
                          pw_pools *pools, const char *element, pw_error *error) {
  source->state = pools->state;
  for (const char *const *r = reads; *r; r++) {
    pw_error why = { 0 };
    int state = pw_system_find_state (s, *r, &why);
    if (state < 0)
      return pw_fail (error, PW_INPUT, "model %s: element %s reads a state: %s", c->m->name, element, why.text);
    *pools->state++ = state;
    source->reads++;
  }
  s->readers += source->reads > 0;
  return PW_OK;
}

static int compile_source (const pw_compilation *c, pw_system *s, pw_source *source, const pw_signal *signal,
                           pw_pools *pools, const char *element, pw_error *error) {
  if (signal->type == PW_FUNCTION && signal->function.open) {
    void *own = signal->function.open (signal->function.context);
    if (own == NULL) return pw_fail (error, PW_RESOURCE, "model %s: out of memory", c->m->name);
    source->signal = *signal;
    source->signal.function.context = own;
  } else
    source->signal = *signal;
  if (signal->type == PW_TABLE) compile_table (source, pools);
  if (signal->type != PW_FUNCTION || signal->function.reads == NULL) return PW_OK;
  return compile_reads (c, s, source, signal->function.reads, pools, element, error);
}

/* Prepares an element in scratch memory, checks that `prepare` stays within its size, and copies it into the system. */
static int compile_prepare (const pw_compilation *c, const pw_system *s, const pw_element_batch *k, int e,
                            const pw_element *from, const pw_body *const *bodies, pw_internal *own, pw_error *error) {
  const pw_kind *kind = k->kind;
  size_t size = kind->element;
  pw_error why = { 0 };
  memset (c->prepared, 0, size);
  memset (c->prepared + size, PW_COMPILE_MARK, PW_COMPILE_GUARD);
  if (kind->prepare (from->definition, bodies, c->prepared, own, &why) != PW_OK)
    return pw_fail (error, PW_INPUT, "model %s: %s %s: %s", c->m->name, kind->name, k->name[e], why.text);
  for (int i = 0; i < PW_COMPILE_GUARD; i++)
    if (c->prepared[size + (size_t)i] != PW_COMPILE_MARK)
      return pw_fail (error, PW_INPUT, "model %s: kind %s: prepare writes more than the %zu bytes of .element",
                      c->m->name, kind->name, size);
  memcpy (c->array[k - s->batch].element + (size_t)e * size, c->prepared, size);
  return PW_OK;
}

/* Stores element e of a batch: bodies, columns, prepared element, internal coordinates.  body: the one an each_body
 * type acts on, or -1. */
static int compile_element (const pw_compilation *c, pw_system *s, pw_element_batch *k, int e, const pw_element *from,
                            int body, pw_error *error) {
  static const pw_body ground = { .name = "ground" };
  const pw_kind *kind = k->kind;
  const pw_body *bodies[PW_MAX_BODIES];
  const pw_batch_arrays *array = &c->array[k - s->batch];
  int *place = array->body + e * kind->bodies, *column = array->column + e * kind->bodies;
  for (int n = 0; n < kind->bodies; n++) {
    int index = body >= 0
                    ? body
                    : pw_names_find (&c->body, *(const char *const *)pw_field_at (kind, from->definition, PW_BODY, n));
    bodies[n] = index < 0 ? &ground : &c->m->body[index];
    place[n] = index < 0 ? s->bodies : index;
    column[n] = index < 0 ? s->coords : 3 * index;
  }
  if (kind->prepare == NULL) return PW_OK;
  pw_internal own[PW_MAX_INTERNAL] = { { 0 } };
  if (compile_prepare (c, s, k, e, from, bodies, own, error) != PW_OK) return PW_INPUT;
  for (int n = 0, j = k->own + e * kind->own; n < kind->own; n++, j++) {
    s->mass[j] = own[n].mass;
    s->q0[j] = own[n].start;
    s->v0[j] = own[n].rate;
    s->held[j] = own[n].specified[0] ? PW_SPECIFIED : 0;
    s->held[s->coords + j] = own[n].specified[1] ? PW_SPECIFIED : 0;
  }
  return PW_OK;
}

/* Stores an element of the description, once or for every body with mass; *e counts the elements of the batch. */
static int compile_copies (const pw_compilation *c, pw_system *s, pw_element_batch *k, int *e, const pw_element *from,
                           pw_pools *pools, pw_error *error) {
  const char *name = compile_text (pools, pw_element_name (from));
  if (!k->kind->each_body) {
    k->name[*e] = name;
    return compile_element (c, s, k, (*e)++, from, -1, error);
  }
  for (int b = 0; b < s->bodies; b++) {
    if (!(c->m->body[b].mass > 0)) continue;
    k->name[*e] = name;
    if (compile_element (c, s, k, (*e)++, from, b, error) != PW_OK) return PW_INPUT;
  }
  return PW_OK;
}

/* Runs after all elements are stored, because signals may read their internal coordinates. */
static int compile_signals (const pw_compilation *c, pw_system *s, pw_pools *pools, pw_error *error) {
  int *next = c->count; /* reused: counts the elements visited in each batch */
  memset (next, 0, (size_t)s->batches * sizeof *next);
  for (int n = 0; n < c->m->elements; n++) {
    const pw_element *from = &c->m->element[n];
    pw_element_batch *k = &s->batch[c->slab_of[n]];
    for (int copy = pw_compile_copies (c->m, k->kind); copy > 0; copy--) {
      int e = next[c->slab_of[n]]++;
      for (int u = 0; u < k->kind->signals; u++) {
        int i = e * k->kind->signals + u;
        k->source[i] = (pw_source){ .forced = pw_kind_forced (k->kind) };
        if (compile_source (c, s, &k->source[i], pw_field_at (k->kind, from->definition, PW_SIGNAL, u), pools,
                            k->name[e], error) != PW_OK)
          return PW_INPUT;
      }
    }
  }
  return PW_OK;
}

static int compile_batches (const pw_compilation *c, pw_system *s, pw_pools *pools, pw_error *error) {
  int row = 0, own = 3 * s->bodies;
  pw_source *source = s->source;
  for (int i = 0; i < s->batches; i++) {
    pw_element_batch *k = &s->batch[i];
    k->row = row;
    k->own = own;
    k->source = source;
    row += k->b.count * k->kind->rows;
    own += k->b.count * k->kind->own;
    source += k->b.count * k->kind->signals;
    int e = 0;
    for (int n = 0; n < c->m->elements; n++)
      if (c->slab_of[n] == i && compile_copies (c, s, k, &e, &c->m->element[n], pools, error) != PW_OK) return PW_INPUT;
  }
  return compile_signals (c, s, pools, error);
}

/* 1 if an element may do work: it has power or a rheonomic constraint.  A position prescribed by constants does no
 * work. */
static int compile_has_work (const pw_element_batch *k, int element) {
  const pw_kind *kind = k->kind;
  int constants = 0;
  if (kind->power) return 1;
  if (kind->rows == 0 || kind->eta == NULL) return 0;
  for (int u = 0; u < kind->signals; u++)
    constants += k->source[element * kind->signals + u].signal.type == PW_CONSTANT;
  return kind->level != PW_HOLONOMIC || constants < kind->signals;
}

static void compile_entries (pw_system *s) {
  pw_entry *entry = s->entry;
  for (int i = 0; i < s->batches; i++) {
    const pw_element_batch *k = &s->batch[i];
    for (int e = 0; e < k->b.count; e++)
      if (compile_has_work (k, e)) *entry++ = (pw_entry){ i, e, PW_WORK };
    for (int e = 0; k->kind->loss && e < k->b.count; e++) *entry++ = (pw_entry){ i, e, PW_LOSS };
  }
  s->entries = (int)(entry - s->entry);
}

/* Values of pw_model_set_initial. */
static int compile_initial (const pw_compilation *c, pw_system *s, pw_error *error) {
  for (int i = 0; i < c->m->givens; i++) {
    int state = pw_system_find_state (s, c->m->given[i].state, error);
    if (state < 0) return PW_INPUT;
    s->held[state] |= PW_GIVEN;
    *(state < s->coords ? s->q0 + state : s->v0 + state - s->coords) = c->m->given[i].value;
  }
  return PW_OK;
}

/* ---- Scales ---- */

static double compile_length (const pw_compilation *c) {
  const pw_model *m = c->m;
  double L = 0;
  for (int i = 0; i < m->elements; i++) {
    const pw_element *e = &m->element[i];
    if (!pw_kind_acts (e->kind)) continue;
    for (int n = 0; n < e->kind->bodies && !e->kind->each_body; n++) {
      const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
      const char *body = *(const char *const *)pw_field_at (e->kind, e->definition, PW_BODY, n);
      if (at && strcmp (body, "ground") != 0) L = fmax (L, hypot (at[0], at[1]));
    }
  }
  for (int i = 0; i < m->bodies && L == 0; i++)
    if (m->body[i].mass > 0) L = sqrt (m->body[i].inertia / m->body[i].mass);
  return L > 0 ? L : 1;
}

/* M with zeros replaced by 1e-6 of the mean of its other entries, angles in units of L.  This is independent of
 * units, and of whether mass or inertia is zero. */
static void compile_metric (pw_system *s) {
  double sum = 0, L2 = s->scale.length * s->scale.length;
  int massive = 0;
  for (int j = 0; j < s->coords; j++)
    if (s->mass[j] > 0) sum += s->mass[j] / (pw_is_angle (s, j) ? L2 : 1), massive++;
  double weight = massive ? 1e-6 * sum / massive : 1;
  for (int j = 0; j < s->coords; j++)
    s->metric[j] = s->mass[j] > 0 ? s->mass[j] : weight * (pw_is_angle (s, j) ? L2 : 1);
}

/* The sum of the constant forces; the state does not matter. */
static int compile_constant (pw_system *s, pw_error *error) {
  pw_workspace *w = pw_workspace_new (s, error);
  if (w == NULL) return PW_RESOURCE;
  pw_evaluate_constant (w, s->constant);
  pw_workspace_free (w);
  return PW_OK;
}

/* ---- */

int pw_compile_fill (const pw_compilation *c, pw_system *s, pw_pools *pools, pw_error *error) {
  int constant = 0;
  compile_bodies (c, s, pools);
  if (compile_batches (c, s, pools, error) != PW_OK || compile_initial (c, s, error) != PW_OK) return PW_INPUT;
  compile_entries (s);
  s->scale = (pw_scale){ compile_length (c), 1 };
  compile_metric (s);
  for (int i = 0; i < s->batches; i++) {
    const pw_kind *kind = s->batch[i].kind;
    s->constraints += kind->rows > 0;
    s->moving += kind->eta != NULL;
    s->forces += kind->force && !kind->constant;
    constant |= kind->force && kind->constant;
    s->saturates |= kind->saturation != NULL;
  }
  return constant ? compile_constant (s, error) : PW_OK;
}
