/* From the description to the compiled system: names become indices, elements become one batch per kind in use.
 *
 * compile_layout runs twice over the same takes, once to learn the size and once to place the arrays, so that one
 * allocation holds the system. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"
#include "signal.h"

/* What is known before the allocation. */
typedef struct {
  const pw_model *m;
  pw_names body, element;
  const pw_kind **kind; /* kinds in use, in the order of the slabs */
  int *count;           /* elements of each */
  int *slab_of;         /* slab of each element */
  int kinds;
  pw_system size; /* its counts */
  size_t text;    /* bytes of all names */
  int reads;      /* states read by signals, in all */
  size_t points;  /* of tables, in all */
} compile;

/* ---- Counting ---- */

static int compile_kind_limits (const pw_model *m, const pw_kind *k, pw_error *error) {
  if (k->bodies > PW_MAX_BODIES || k->own > PW_MAX_OWN || k->rows > PW_MAX_ROWS || k->signals > PW_MAX_SIGNALS ||
      (k->rows > 0) != (k->level != PW_FORCE))
    return pw_fail (error, PW_INPUT,
                    "model %s: kind %s does not fit: at most %d bodies, %d own coordinates, %d rows, %d signals; rows "
                    "if and only if "
                    "it is a constraint",
                    m->name, k->name, PW_MAX_BODIES, PW_MAX_OWN, PW_MAX_ROWS, PW_MAX_SIGNALS);
  return PW_OK;
}

static int compile_names (compile *c, pw_error *error) {
  const pw_model *m = c->m;
  if (pw_names_open (&c->body, (size_t)m->bodies) != PW_OK || pw_names_open (&c->element, (size_t)m->elements) != PW_OK)
    return pw_fail (error, PW_MACHINE, "model %s: out of memory", m->name);
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

/* How many elements of the system an element of the description stands for. */
static int compile_copies (const pw_model *m, const pw_kind *kind) {
  int massive = 0;
  if (!kind->each_body) return 1;
  for (int i = 0; i < m->bodies; i++) massive += m->body[i].mass > 0;
  return massive;
}

/* Slabs: holonomic kinds in order of appearance, then nonholonomic ones, then forces. */
static int compile_kinds (compile *c, pw_error *error) {
  static const pw_level order[] = { PW_HOLONOMIC, PW_NONHOLONOMIC, PW_FORCE };
  const pw_model *m = c->m;
  size_t room = (size_t)m->elements + 1;
  c->kind = malloc (room * sizeof *c->kind);
  c->count = calloc (room, sizeof *c->count);
  c->slab_of = malloc (room * sizeof *c->slab_of);
  if (c->kind == NULL || c->count == NULL || c->slab_of == NULL)
    return pw_fail (error, PW_MACHINE, "model %s: out of memory", m->name);
  for (int l = 0; l < 3; l++)
    for (int i = 0; i < m->elements; i++) {
      const pw_kind *kind = m->element[i].kind;
      if (kind->level != order[l]) continue;
      int k = 0;
      while (k < c->kinds && c->kind[k] != kind) k++;
      if (k == c->kinds) {
        if (compile_kind_limits (m, kind, error) != PW_OK) return PW_INPUT;
        c->kind[c->kinds++] = kind;
      }
      c->count[k] += compile_copies (m, kind);
      c->slab_of[i] = k;
    }
  return PW_OK;
}

static int compile_accounts (const pw_kind *k) {
  return (k->power != NULL || (k->rows > 0 && k->eta != NULL)) + (k->loss != NULL);
}

static int compile_count (compile *c, pw_error *error) {
  const pw_model *m = c->m;
  double coords = 3.0 * m->bodies, rows = 0, entries = 0;
  if (m->bodies == 0) return pw_fail (error, PW_INPUT, "model %s has no body", m->name);
  for (int k = 0; k < c->kinds; k++) {
    coords += (double)c->count[k] * c->kind[k]->own;
    rows += (double)c->count[k] * c->kind[k]->rows;
    if (c->kind[k]->level == PW_HOLONOMIC) c->size.holonomic += c->count[k] * c->kind[k]->rows;
    entries += (double)c->count[k] * compile_accounts (c->kind[k]);
  }
  if (coords > INT_MAX / 64 || rows > INT_MAX / 64) return pw_fail (error, PW_INPUT, "model %s is too large", m->name);
  c->size.bodies = m->bodies;
  c->size.coords = (int)coords;
  c->size.rows = (int)rows;
  c->size.entries = (int)entries;
  c->size.slabs = c->kinds;
  c->text = strlen (m->name) + 1;
  for (int i = 0; i < m->bodies; i++) c->text += strlen (m->body[i].name) + 1;
  for (int i = 0; i < m->elements; i++) {
    const pw_element *e = &m->element[i];
    c->text += strlen (pw_element_name (e)) + 1;
    for (int u = 0; u < e->kind->signals; u++) {
      const pw_signal *signal = pw_field_at (e->kind, e->definition, PW_SIGNAL, u);
      if (signal->type == PW_TABLE) c->points += (size_t)signal->table.count * (size_t)compile_copies (m, e->kind);
      if (signal->type != PW_FUNCTION || signal->function.reads == NULL) continue;
      for (const char *const *r = signal->function.reads; *r; r++) c->reads += compile_copies (m, e->kind);
    }
  }
  return PW_OK;
}

/* ---- One allocation ---- */

typedef struct {
  char *text;
  double *x; /* of signals that read states */
  double *table;
  int *state;
} compile_pools;

static void compile_layout_slab (const compile *c, pw_layout *l, pw_slab *k, int i) {
  const pw_kind *kind = c->kind[i];
  size_t n = (size_t)c->count[i], cols = (size_t)(3 * kind->bodies + kind->own);
  size_t block = cols > 3 ? cols : 3;
  void *element = pw_take (l, n, kind->element);
  void *body = pw_take (l, n * (size_t)kind->bodies, sizeof (int)),
       *column = pw_take (l, n * (size_t)kind->bodies, sizeof (int));
  void *u = pw_take (l, n * (size_t)kind->signals * 3, sizeof (double));
  void *J = pw_take (l, n * (size_t)kind->rows * cols, sizeof (double));
  int scratch = kind->force || kind->energy || kind->power || kind->loss || kind->contact;
  void *space = pw_take (l, scratch ? n * block : 0, sizeof (double));
  void *source = pw_take (l, n * (size_t)kind->signals, sizeof (pw_source)), *name = pw_take (l, n, sizeof (char *));
  if (l->base == NULL) return;
  *k = (pw_slab){ .kind = kind, .column = column, .J = J, .block = space, .u = u, .source = source, .name = name };
  k->b = (pw_batch){ .count = c->count[i], .cols = (int)cols, .element = element, .body = body, .u = u };
}

static void compile_layout (const compile *c, pw_layout *l, pw_system **system, compile_pools *pools) {
  size_t coords = (size_t)c->size.coords, bodies = (size_t)c->size.bodies, rows = (size_t)c->size.rows;
  pw_system *s = pw_take (l, 1, sizeof *s), none;
  if (l->base == NULL) s = &none;
  *s = c->size;
  s->slab = pw_take (l, (size_t)c->size.slabs + 1, sizeof *s->slab);
  s->pose = pw_take (l, bodies + 1, sizeof *s->pose);
  s->body_name = pw_take (l, bodies, sizeof *s->body_name);
  s->mass = pw_take (l, coords, sizeof *s->mass);
  s->metric = pw_take (l, coords, sizeof *s->metric);
  s->constant = pw_take (l, coords + 3, sizeof *s->constant);
  s->q0 = pw_take (l, coords, sizeof *s->q0);
  s->v0 = pw_take (l, coords, sizeof *s->v0);
  s->held = pw_take (l, 2 * coords, 1);
  s->scratch = pw_take (l, 3 * rows + coords + 3, sizeof *s->scratch);
  s->entry = pw_take (l, (size_t)c->size.entries, sizeof *s->entry);
  s->force = pw_take (l, (size_t)c->size.slabs, sizeof *s->force);
  for (int i = 0; i < c->kinds; i++) compile_layout_slab (c, l, l->base ? s->slab + i : NULL, i);
  pools->x = pw_take (l, 2 * (size_t)c->reads, sizeof (double));
  pools->table = pw_take (l, 4 * c->points, sizeof (double));
  pools->state = pw_take (l, (size_t)c->reads, sizeof (int));
  pools->text = pw_take (l, c->text, 1);
  *system = s;
}

/* ---- Filling ---- */

static const char *compile_text (compile_pools *pools, const char *text) {
  char *copy = strcpy (pools->text, text);
  pools->text += strlen (text) + 1;
  return copy;
}

static void compile_bodies (const compile *c, pw_system *s, compile_pools *pools) {
  s->model = compile_text (pools, c->m->name);
  for (int i = 0; i < s->bodies; i++) {
    const pw_body *b = &c->m->body[i];
    s->body_name[i] = compile_text (pools, b->name);
    s->mass[3 * i] = s->mass[3 * i + 1] = b->mass;
    s->mass[3 * i + 2] = b->inertia;
    memcpy (s->q0 + 3 * i, b->start, sizeof b->start);
    memcpy (s->v0 + 3 * i, b->rate, sizeof b->rate);
  }
  s->pose[s->bodies] = (pw_pose){ .cos = 1 };
}

/* The points of a table, and what is between them. */
static void compile_table (pw_source *source, compile_pools *pools) {
  pw_signal *s = &source->signal;
  size_t n = (size_t)s->table.count;
  double *t = memcpy (pools->table, s->table.t, n * sizeof *t), *value = t + n;
  s->table.value = memcpy (value, s->table.value, n * sizeof *value);
  s->table.t = t;
  source->spline = value + n;
  pools->table += 4 * n;
  pw_table_spline (s, source->spline);
}

/* The states a function reads. */
static int compile_reads (const compile *c, pw_system *s, pw_source *source, const char *const *reads,
                          compile_pools *pools, const char *element, pw_error *error) {
  source->state = pools->state;
  source->x = pools->x;
  for (const char *const *r = reads; *r; r++) {
    pw_error why = { 0 };
    int state = pw_find_state (s, *r, &why);
    if (state < 0)
      return pw_fail (error, PW_INPUT, "model %s: element %s reads a state: %s", c->m->name, element, why.text);
    *pools->state++ = state;
    source->reads++;
  }
  pools->x += 2 * source->reads;
  s->readers += source->reads > 0;
  return PW_OK;
}

static int compile_source (const compile *c, pw_system *s, pw_source *source, const pw_signal *signal,
                           compile_pools *pools, const char *element, pw_error *error) {
  if (signal->type == PW_FUNCTION && signal->function.open) {
    void *own = signal->function.open (signal->function.context);
    if (own == NULL) return pw_fail (error, PW_MACHINE, "model %s: out of memory", c->m->name);
    source->signal = *signal;
    source->signal.function.context = own;
  } else
    source->signal = *signal;
  if (signal->type == PW_TABLE) compile_table (source, pools);
  if (signal->type != PW_FUNCTION || signal->function.reads == NULL) return PW_OK;
  return compile_reads (c, s, source, signal->function.reads, pools, element, error);
}

/* Puts element `e` of its slab where the kind will find it; `body` is the one an each_body kind acts on, or -1. */
static int compile_element (const compile *c, pw_system *s, pw_slab *k, int e, const pw_element *from, int body,
                            pw_error *error) {
  static const pw_body ground = { .name = "ground" };
  const pw_kind *kind = k->kind;
  const pw_body *bodies[PW_MAX_BODIES];
  int *place = (int *)(size_t)k->b.body + e * kind->bodies, *column = (int *)(size_t)k->column + e * kind->bodies;
  for (int n = 0; n < kind->bodies; n++) {
    int index =
        body >= 0 ? body : pw_names_find (&c->body, *(const char **)pw_field_at (kind, from->definition, PW_BODY, n));
    bodies[n] = index < 0 ? &ground : &c->m->body[index];
    place[n] = index < 0 ? s->bodies : index;
    column[n] = index < 0 ? s->coords : 3 * index;
  }
  if (kind->prepare == NULL) return PW_OK;
  pw_error why = { 0 };
  pw_own own[PW_MAX_OWN] = { { 0 } };
  char *element = (char *)(size_t)k->b.element + (size_t)e * kind->element;
  if (kind->prepare (from->definition, bodies, element, own, &why) != PW_OK)
    return pw_fail (error, PW_INPUT, "model %s: %s %s: %s", c->m->name, kind->name, k->name[e], why.text);
  for (int n = 0, j = k->own + e * kind->own; n < kind->own; n++, j++) {
    s->mass[j] = own[n].mass;
    s->q0[j] = own[n].start;
    s->v0[j] = own[n].rate;
  }
  return PW_OK;
}

/* Puts an element of the description, once or for every body with mass; *e counts the elements of the slab. */
static int compile_put (const compile *c, pw_system *s, pw_slab *k, int *e, const pw_element *from,
                        compile_pools *pools, pw_error *error) {
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

/* After the elements, whose own coordinates a signal may read. */
static int compile_signals (const compile *c, pw_system *s, compile_pools *pools, pw_error *error) {
  int *next = c->count; /* from now on counts the elements seen of each slab */
  memset (next, 0, (size_t)s->slabs * sizeof *next);
  for (int n = 0; n < c->m->elements; n++) {
    const pw_element *from = &c->m->element[n];
    pw_slab *k = &s->slab[c->slab_of[n]];
    for (int copy = compile_copies (c->m, k->kind); copy > 0; copy--) {
      int e = next[c->slab_of[n]]++;
      for (int u = 0; u < k->kind->signals; u++)
        if (compile_source (c, s, &k->source[e * k->kind->signals + u],
                            pw_field_at (k->kind, from->definition, PW_SIGNAL, u), pools, k->name[e], error) != PW_OK)
          return PW_INPUT;
    }
  }
  return PW_OK;
}

static int compile_slabs (const compile *c, pw_system *s, compile_pools *pools, pw_error *error) {
  int row = 0, own = 3 * s->bodies;
  for (int i = 0; i < s->slabs; i++) {
    pw_slab *k = &s->slab[i];
    k->b.pose = s->pose;
    k->row = row;
    k->own = own;
    k->b.q = s->q0 + own;
    k->b.v = s->v0 + own;
    row += k->b.count * k->kind->rows;
    own += k->b.count * k->kind->own;
    int e = 0;
    for (int n = 0; n < c->m->elements; n++)
      if (c->slab_of[n] == i && compile_put (c, s, k, &e, &c->m->element[n], pools, error) != PW_OK) return PW_INPUT;
  }
  return compile_signals (c, s, pools, error);
}

static void compile_entries (pw_system *s) {
  pw_entry *entry = s->entry;
  for (int i = 0; i < s->slabs; i++) {
    const pw_kind *k = s->slab[i].kind;
    for (int e = 0; (k->power || (k->rows > 0 && k->eta)) && e < s->slab[i].b.count; e++)
      *entry++ = (pw_entry){ i, e, PW_WORK };
    for (int e = 0; k->loss && e < s->slab[i].b.count; e++) *entry++ = (pw_entry){ i, e, PW_LOSS };
  }
}

/* The values given from outside, which the consistent start holds. */
static int compile_given (const compile *c, pw_system *s, pw_error *error) {
  for (int i = 0; i < c->m->givens; i++) {
    int state = pw_find_state (s, c->m->given[i].state, error);
    if (state < 0) return PW_INPUT;
    s->held[state] = 1;
    *(state < s->coords ? s->q0 + state : s->v0 + state - s->coords) = c->m->given[i].value;
  }
  return PW_OK;
}

/* ---- Scales ---- */

static double compile_length (const compile *c) {
  const pw_model *m = c->m;
  double L = 0;
  for (int i = 0; i < m->elements; i++) {
    const pw_element *e = &m->element[i];
    for (int n = 0; n < e->kind->bodies && !e->kind->each_body; n++) {
      const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
      const char *body = *(const char **)pw_field_at (e->kind, e->definition, PW_BODY, n);
      if (at && strcmp (body, "ground") != 0) L = fmax (L, hypot (at[0], at[1]));
    }
  }
  for (int i = 0; i < m->bodies && L == 0; i++)
    if (m->body[i].mass > 0) L = sqrt (m->body[i].inertia / m->body[i].mass);
  return L > 0 ? L : 1;
}

/* M, and where it is zero 1e-6 of the mean mass, times L^2 for angles; without any mass 1 and L^2. */
static void compile_metric (pw_system *s) {
  double sum = 0, L2 = s->scale.length * s->scale.length;
  int massive = 0;
  for (int b = 0; b < s->bodies; b++)
    if (s->mass[3 * b] > 0) sum += s->mass[3 * b], massive++;
  double weight = massive ? 1e-6 * sum / massive : 1;
  for (int j = 0; j < s->coords; j++) {
    int angle = pw_is_angle (s, j);
    s->metric[j] = s->mass[j] > 0 ? s->mass[j] : angle ? weight * L2 : weight;
  }
}

/* ---- */

static pw_system *compile_allocate (const compile *c, compile_pools *pools, pw_error *error) {
  pw_layout l = { NULL, 0 };
  pw_system *s = NULL;
  compile_layout (c, &l, &s, pools);
  l = (pw_layout){ calloc (1, l.used), 0 };
  if (l.base == NULL) {
    pw_fail (error, PW_MACHINE, "model %s: out of memory", c->m->name);
    return NULL;
  }
  compile_layout (c, &l, &s, pools);
  return s;
}

static int compile_fill (const compile *c, pw_system *s, compile_pools *pools, pw_error *error) {
  s->t_signal = NAN;
  compile_bodies (c, s, pools);
  if (compile_slabs (c, s, pools, error) != PW_OK || compile_given (c, s, error) != PW_OK) return PW_INPUT;
  compile_entries (s);
  s->scale = (pw_scale){ compile_length (c), 1 };
  compile_metric (s);
  for (int i = 0; i < s->slabs; i++) {
    const pw_kind *kind = s->slab[i].kind;
    s->constraints += kind->rows > 0;
    s->moving += kind->eta != NULL;
    if (kind->force && !kind->constant) s->force[s->forces++] = i;
  }
  pw_sweep_constant (s);
  return PW_OK;
}

pw_system *pw_compile (const pw_model *m, pw_error *error) {
  compile c = { .m = m };
  compile_pools pools;
  pw_system *s = NULL;
  if (!m->built)
    pw_fail (error, PW_INPUT, "model %s: pw_compile before pw_build", m->name);
  else if (compile_names (&c, error) == PW_OK && compile_kinds (&c, error) == PW_OK &&
           compile_count (&c, error) == PW_OK)
    s = compile_allocate (&c, &pools, error);
  if (s && compile_fill (&c, s, &pools, error) != PW_OK) {
    pw_free (s);
    s = NULL;
  }
  pw_names_close (&c.body);
  pw_names_close (&c.element);
  free (c.kind);
  free (c.count);
  free (c.slab_of);
  return s;
}

/* Signals that have not been compiled are all zero. */
void pw_free (pw_system *s) {
  for (int k = 0; s && k < s->slabs; k++)
    for (int i = 0; i < s->slab[k].b.count * s->slab[k].kind->signals; i++) {
      const pw_signal *signal = &s->slab[k].source[i].signal;
      if (signal->type == PW_FUNCTION && signal->function.open && signal->function.close)
        signal->function.close (signal->function.context);
    }
  free (s);
}
