/* Compiles a model: names become indices, the elements of each type become one batch.
 *
 * All arrays of the system but that of the batches are in its arena. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "system.h"

/* Bytes after an element, and their value, which `prepare` must not change. */
enum { COMPILE_GUARD = 64, COMPILE_MARK = 0xa5 };

/* The most elements, coordinates, constraint equations: products with columns and signals of an element must be int. */
enum { COMPILE_MOST = INT_MAX / 64 };

/* What an element of a system is compiled from. */
typedef struct {
  const pw_element *element; /* of the model */
  int body;                  /* the body on which an element that acts on every body acts, or -1 */
} compiled;

typedef struct {
  const pw_model *m;
  pw_system *s;
  pw_error *error;
  pw_names name;  /* of bodies: their indices; of elements: theirs plus the number of bodies */
  compiled *list; /* what each element of the system is compiled from, batch by batch */
  int listed;
  size_t list_room; /* entries allocated */
} compilation;

static int compile_no_memory (const compilation *job) {
  return pw_fail (job->error, PW_RESOURCE, "model %s: out of memory", job->m->name);
}

static int compile_too_large (const compilation *job) {
  return pw_fail (job->error, PW_INPUT, "model %s is too large", job->m->name);
}

static void *compile_alloc (const compilation *job, size_t count, size_t size) {
  void *p = pw_arena_alloc (&job->s->arena, count * size);
  if (p == NULL) compile_no_memory (job);
  return p;
}

#define compile_arrays(job, ...) (PW_ARENA_ARRAYS (&(job)->s->arena, __VA_ARGS__) ? PW_OK : compile_no_memory (job))

static const char *compile_text (const compilation *job, const char *text) {
  const char *copy = pw_arena_copy (&job->s->arena, text);
  if (copy == NULL) compile_no_memory (job);
  return copy;
}

static int compile_names (compilation *job) {
  const pw_model *m = job->m;
  const size_t names = (size_t)m->bodies + (size_t)m->elements + (size_t)m->outputs;
  if (pw_names_open (&job->name, names) != PW_OK) return compile_no_memory (job);
  for (int i = 0; i < m->bodies; i++)
    if (m->body[i].name && pw_names_add (&job->name, m->body[i].name, i) >= 0)
      return pw_fail (job->error, PW_INPUT, "model %s: two bodies are named \"%s\"", m->name, m->body[i].name);
  for (int i = 0; i < m->elements; i++) {
    const char *name = pw_element_name (&m->element[i]);
    int other = name ? pw_names_add (&job->name, name, m->bodies + i) : -1;
    if (other >= m->bodies)
      return pw_fail (job->error, PW_INPUT, "model %s: two elements are named \"%s\"", m->name, name);
    if (other >= 0)
      return pw_fail (job->error, PW_INPUT, "model %s: a body and a %s are both named \"%s\"", m->name,
                      m->element[i].kind->name, name);
  }
  return PW_OK;
}

/* 1 if an element of the model, or its companion, is of this type. */
static int compile_has_kind (const pw_element *from, const pw_kind *kind) {
  return from->kind == kind || (from->kind->companion == kind && from->kind->has_companion (from->definition));
}

/* Lists the elements of a batch, in the model from the first one on; those of an each_body type once for every body
 * with mass. */
static int compile_list (compilation *job, const pw_element *first, pw_element_batch *k) {
  const pw_model *m = job->m;
  int each = k->kind->each_body;
  for (const pw_element *from = first; from < m->element + m->elements; from++)
    for (int b = each ? 0 : -1; compile_has_kind (from, k->kind) && b < (each ? m->bodies : 0); b++) {
      if (b >= 0 && !(m->body[b].mass > 0)) continue;
      if (job->listed == COMPILE_MOST) return compile_too_large (job);
      if (pw_grow (&job->list, (size_t)job->listed, &job->list_room, sizeof *job->list) != PW_OK)
        return compile_no_memory (job);
      job->list[job->listed++] = (compiled){ from, b };
      k->b.count++;
    }
  return PW_OK;
}

/* A batch for each type: holonomic ones in order of appearance, then nonholonomic ones, then forces, then states. */
static int compile_types (compilation *job) {
  static const pw_level order[] = { PW_HOLONOMIC, PW_NONHOLONOMIC, PW_FORCE, PW_FORCE };
  const pw_model *m = job->m;
  pw_system *s = job->s;
  size_t room = 0;
  if (pw_grow (&s->batch, 0, &room, sizeof *s->batch) != PW_OK)
    return compile_no_memory (job); /* for no element, too */
  for (int l = 0; l < 4; l++)
    for (int i = 0; i < 2 * m->elements; i++) { /* each with its companion */
      const pw_element *from = &m->element[i / 2];
      const pw_kind *kind = i % 2 ? from->kind->companion : from->kind;
      int k = 0;
      if (kind == NULL || !compile_has_kind (from, kind)) continue;
      while (k < s->batches && s->batch[k].kind != kind) k++;
      if (kind->level != order[l] || k < s->batches || (kind->first_order && l < 3)) continue;
      if (pw_grow (&s->batch, (size_t)k, &room, sizeof *s->batch) != PW_OK) return compile_no_memory (job);
      s->batch[s->batches++] = (pw_element_batch){ .kind = kind };
      int status = compile_list (job, from, &s->batch[k]);
      if (status != PW_OK) return status;
    }
  return PW_OK;
}

/* The next limit of an element that varies, from field *f on; NULL: there is none. */
static const pw_signal *compile_limit (const pw_element *e, const pw_field **f) {
  for (; (*f)->name; ++*f) {
    const pw_signal *signal = (const void *)((const char *)e->definition + (*f)->offset);
    if ((*f)->limit && signal->type != PW_CONSTANT) return signal;
  }
  return NULL;
}

static int compile_sizes (const compilation *job) {
  const pw_model *m = job->m;
  pw_system *s = job->s;
  for (const pw_element *e = m->element; e < m->element + m->elements; e++)
    for (const pw_field *f = e->kind->fields; compile_limit (e, &f); f++) s->sources++, s->limit_sources++;
  if (m->bodies == 0) return pw_fail (job->error, PW_INPUT, "model %s has no body", m->name);
  if (m->bodies > COMPILE_MOST / 3) return compile_too_large (job);
  s->bodies = m->bodies;
  s->coords = s->mechanical = 3 * m->bodies;
  for (pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    const pw_kind *kind = k->kind;
    k->b.cols = 3 * kind->bodies + kind->internal;
    k->row = s->rows;
    k->internal = s->coords;
    if (!kind->first_order) s->mechanical = s->coords + k->b.count * kind->internal;
    s->coords += k->b.count * kind->internal;
    s->rows += k->b.count * kind->rows;
    if (kind->level == PW_HOLONOMIC) s->holonomic = s->rows; /* these batches come first */
    s->sources += k->b.count * kind->signals;
    size_t cols = (size_t)k->b.count * (size_t)k->b.cols, block = kind->saturation ? 2 * cols : cols;
    s->jacobian += (size_t)kind->rows * cols;
    if (s->block < block) s->block = block;
    s->constraints += kind->rows > 0, s->positions += kind->rows > 0 && kind->level == PW_HOLONOMIC;
    s->rheonomic += kind->eta != NULL;
    k->unrolled = kind->internal == 0 && kind->bodies <= 2 ? kind->bodies : 0;
    k->adds_force = kind->force && !kind->constant;
    if (k->adds_force && s->forces++ == 0) s->first_force = (int)(k - s->batch);
    s->saturates |= kind->saturation != NULL;
  }
  if (s->coords > COMPILE_MOST || s->rows > COMPILE_MOST) return compile_too_large (job);
  return compile_arrays (job, PW_ARRAY (s->source, s->sources), PW_ARRAY (s->body_name, s->bodies),
                         PW_ARRAY (s->state_unit, 2 * (s->coords - s->mechanical)), PW_ARRAY (s->angle_user, s->bodies),
                         PW_ARRAY (s->M, s->coords), PW_ARRAY (s->mass, s->coords), PW_ARRAY (s->metric, s->coords),
                         PW_ARRAY (s->q0, s->coords), PW_ARRAY (s->v0, s->coords),
                         PW_ARRAY (s->constant, s->coords + 3), PW_ARRAY (s->origin, 2 * s->coords));
}

/* Origin of the initial value of a body's state (0 to 5: x to omega); `zero`: the origin of a 0 without `specified`. */
static unsigned char compile_origin (const pw_body *b, double value, int state, unsigned char zero) {
  if (b->specified) return b->specified >> state & 1 ? PW_SPECIFIED : 0;
  return value != 0 ? PW_SPECIFIED : zero;
}

static int compile_bodies (const compilation *job) {
  pw_system *s = job->s;
  s->model = compile_text (job, job->m->name);
  for (int i = 0; i < s->bodies; i++) {
    const pw_body *b = &job->m->body[i];
    s->body_name[i] = compile_text (job, b->name);
    if (s->body_name[i] == NULL) return PW_RESOURCE;
    s->M[3 * i] = s->M[3 * i + 1] = b->mass;
    s->M[3 * i + 2] = b->inertia;
    memcpy (s->q0 + 3 * i, b->start, sizeof b->start);
    memcpy (s->v0 + 3 * i, b->rate, sizeof b->rate);
    for (int k = 0; k < 3; k++) {
      s->origin[3 * i + k] = compile_origin (b, b->start[k], k, PW_ZERO_POSITION);
      s->origin[s->coords + 3 * i + k] = compile_origin (b, b->rate[k], 3 + k, 0);
    }
  }
  return s->model ? PW_OK : PW_RESOURCE;
}

/* Prepares an element, and checks that `prepare` stays within its size; what follows it in memory is not used yet. */
static int compile_prepare (const compilation *job, const pw_kind *kind, const pw_element *from,
                            const pw_body *const *bodies, pw_internal *internal, unsigned char *element) {
  pw_error cause = { 0 };
  memset (element, 0, kind->element);
  memset (element + kind->element, COMPILE_MARK, COMPILE_GUARD);
  int status = kind->prepare (from->definition, bodies, element, internal, &cause);
  if (status != PW_OK)
    return pw_fail (job->error, status == PW_RESOURCE ? PW_RESOURCE : PW_INPUT, "model %s: %s %s: %s", job->m->name,
                    kind->name, pw_element_name (from), *cause.text ? cause.text : "prepare refuses it");
  for (size_t i = 0; i < COMPILE_GUARD; i++)
    if (element[kind->element + i] != COMPILE_MARK)
      return pw_fail (job->error, PW_INPUT,
                      "model %s: element type %s: prepare writes more than the %zu bytes of .element", job->m->name,
                      kind->name, kind->element);
  return PW_OK;
}

static int compile_element (const compilation *job, const pw_element_batch *k, int e, const compiled *from, int *body,
                            unsigned char *element) {
  static const pw_body ground = { .name = "ground" };
  const pw_kind *kind = k->kind;
  pw_system *s = job->s;
  const pw_body *bodies[PW_MAX_BODIES];
  const void *definition = from->element->definition;
  int again = e > 0 && from[-1].element == from->element; /* on another body */
  k->name[e] = again ? k->name[e - 1] : compile_text (job, pw_element_name (from->element));
  if (k->name[e] == NULL) return PW_RESOURCE;
  for (int n = 0; n < kind->bodies; n++) {
    int index = from->body;
    if (index < 0) index = pw_names_find (&job->name, *(const char *const *)pw_field_at (kind, definition, PW_BODY, n));
    bodies[n] = index < 0 ? &ground : &job->m->body[index];
    body[n] = index < 0 ? s->bodies : index;
    k->column[e * kind->bodies + n] = index < 0 ? s->coords : 3 * index;
  }
  if (kind->prepare == NULL) return PW_OK;
  pw_internal internal[PW_MAX_INTERNAL] = { { 0 } };
  int status = compile_prepare (job, kind, from->element, bodies, internal, element);
  if (status != PW_OK) return status;
  for (int n = 0, j = k->internal + e * kind->internal; n < kind->internal; n++, j++) {
    const char *expected = pw_domain_check (PW_NONNEGATIVE, internal[n].mass);
    if (*expected)
      return pw_fail (job->error, PW_INPUT, "model %s: %s %s: inertia of %s = %g: expected %s", job->m->name,
                      kind->name, k->name[e], kind->coordinate[n].name, internal[n].mass, expected);
    s->M[j] = internal[n].mass;
    s->q0[j] = internal[n].start;
    s->v0[j] = internal[n].rate;
    s->origin[j] = internal[n].specified[0] ? PW_SPECIFIED : 0;
    s->origin[s->coords + j] = internal[n].specified[1] ? PW_SPECIFIED : 0;
    if (!pw_is_hidden (s, j)) continue;
    const char *unit = ((const pw_state *)definition)->unit, **units = s->state_unit + 2 * (j - s->mechanical);
    const char *per_second = unit == NULL || *unit == 0 ? "1/s" : strpbrk (unit, " /") ? "(%s)/s" : "%s/s";
    units[0] = compile_text (job, unit ? unit : "");
    units[1] = compile_text (job, PW_PRINTED (PW_NAME_BYTES, per_second, unit));
    if (units[0] == NULL || units[1] == NULL) return PW_RESOURCE;
  }
  return PW_OK;
}

static int compile_batches (const compilation *job) {
  pw_source *source = job->s->source + job->s->limit_sources;
  const compiled *from = job->list;
  int status = PW_OK;
  for (pw_element_batch *k = job->s->batch; k < job->s->batch + job->s->batches && status == PW_OK; k++) {
    size_t n = (size_t)k->b.count, size = k->kind->element, bodies = (size_t)k->kind->bodies;
    unsigned char *element;
    int *body;
    status = compile_arrays (job, PW_ARRAY (element, n * size + COMPILE_GUARD), PW_ARRAY (body, n * bodies),
                             PW_ARRAY (k->column, n * bodies), PW_ARRAY (k->name, n));
    k->b.element = element;
    k->b.body = body;
    k->source = source;
    source += k->b.count * k->kind->signals;
    for (size_t e = 0; e < n && status == PW_OK; e++, from++)
      status = compile_element (job, k, (int)e, from, body + e * bodies, element + e * size);
  }
  return status;
}

static int compile_table (const compilation *job, pw_source *source, const char *element) {
  pw_points *table = &source->signal.table;
  size_t n = (size_t)table->count;
  double *t = compile_alloc (job, 4 * n, sizeof *t), *value = t + n;
  if (t == NULL) return PW_RESOURCE;
  memcpy (t, table->t, n * sizeof *t);
  for (size_t i = 0; i < n; i++) value[i] = pw_table_value (&source->signal, (int)i);
  table->t = t, table->value = value;
  table->scale = 1, table->offset = 0;
  source->spline = value + n;
  pw_table_spline (&source->signal, source->spline);
  for (size_t i = 0; i < 2 * n; i++)
    if (!isfinite (source->spline[i]))
      return pw_fail (job->error, PW_INPUT,
                      "model %s: element %s: the derivatives of the table are not finite at t = %g s", job->m->name,
                      element, t[i % n]);
  return PW_OK;
}

static int compile_reads (const compilation *job, pw_source *source, const char *element) {
  const char *const *reads = source->signal.function.reads;
  pw_system *s = job->s;
  while (reads && reads[source->reads]) source->reads++;
  int *state = compile_alloc (job, (size_t)source->reads, sizeof *state);
  source->state = state;
  if (state == NULL) return PW_RESOURCE;
  for (int i = 0; i < source->reads; i++) {
    pw_error cause = { 0 };
    state[i] = pw_system_find_state (s, reads[i], &cause);
    if (state[i] < 0)
      return pw_fail (job->error, PW_INPUT, "model %s: element %s reads a state: %s", s->model, element, cause.text);
  }
  for (int i = 0; i < source->reads && !source->of_force; i++)
    if (state[i] >= s->coords && state[i] < s->coords + s->mechanical)
      return pw_fail (job->error, PW_INPUT,
                      "model %s: element %s: the signal of a velocity constraint depends on positions and first-order "
                      "states, not on the velocity %s: the constraint would restrict accelerations; use a state that "
                      "follows it, with the rate (%s - STATE)/TIME",
                      s->model, element, reads[i], reads[i]);
  source->feedback = source->gradient = source->reads > 0 && !source->of_force;
  s->reads += source->reads;
  s->state_dependent += source->reads > 0;
  s->feedback += source->feedback;
  return PW_OK;
}

static int compile_signal (const compilation *job, pw_source *source, const pw_signal *signal, const char *element) {
  int status = PW_OK;
  source->signal = *signal;
  if (signal->type == PW_FUNCTION) pw_open_function (&source->signal.function, &status);
  if (status != PW_OK) return compile_no_memory (job);
  if (signal->type == PW_TABLE) return compile_table (job, source, element);
  return signal->type == PW_FUNCTION ? compile_reads (job, source, element) : PW_OK;
}

static int compile_limit_signals (const compilation *job) {
  pw_system *s = job->s;
  const compiled *from = job->list;
  const pw_signal *signal;
  int count = 0;
  s->limit_signal = compile_alloc (job, (size_t)s->limit_sources, sizeof *s->limit_signal);
  if (s->limit_signal == NULL) return PW_RESOURCE;
  for (int i = 0; i < s->batches; i++)
    for (int e = 0; e < s->batch[i].b.count; e++, from++)
      for (const pw_field *f = s->batch[i].kind->fields; (signal = compile_limit (from->element, &f)) != NULL; f++) {
        s->limit_signal[count] = (pw_limit_signal){ i, e, f };
        s->source[count].of_force = 1;
        const int status = compile_signal (job, &s->source[count++], signal, s->batch[i].name[e]);
        if (status != PW_OK) return status;
      }
  return PW_OK;
}

/* After all elements are stored, because signals may read their internal coordinates. */
static int compile_signals (const compilation *job) {
  pw_system *s = job->s;
  const compiled *from = job->list;
  pw_source *source = s->source + s->limit_sources;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++)
    for (int e = 0; e < k->b.count; e++, from++)
      for (int u = 0; u < k->kind->signals; u++, source++) {
        source->of_force = pw_kind_signals_force (k->kind);
        source->of_coordinate = k->kind->of_coordinate;
        const pw_signal *signal = pw_field_at (k->kind, from->element->definition, PW_SIGNAL, u);
        int status = compile_signal (job, source, signal, k->name[e]);
        if (status != PW_OK) return status;
        if (!source->of_coordinate) continue;
        int *state = compile_alloc (job, 1, sizeof *state); /* the internal coordinate whose function it is */
        if (state == NULL) return PW_RESOURCE;
        *state = k->internal + e * k->kind->internal;
        source->state = state, source->reads = 1;
        s->reads++, s->state_dependent++;
      }
  return PW_OK;
}

/* Values of pw_model_set_initial. */
static int compile_initial (const compilation *job) {
  pw_system *s = job->s;
  for (int i = 0; i < job->m->initials; i++) {
    int state = pw_system_find_state (s, job->m->initial[i].state, job->error);
    if (state < 0) return PW_INPUT;
    s->origin[state] |= PW_GIVEN;
    *(state < s->coords ? s->q0 + state : s->v0 + state - s->coords) = job->m->initial[i].value;
  }
  return PW_OK;
}

/* The length scale (pw_scale). */
static double compile_length (const compilation *job) {
  const pw_model *m = job->m;
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

/* What a workspace must evaluate: users of the angles of bodies without inertia, and constant forces. */
static int compile_evaluated (const compilation *job) {
  pw_system *s = job->s;
  int needed = 0, element = 0;
  for (int b = 0; b < s->bodies; b++) s->angle_user[b] = -1, needed |= s->M[3 * b + 2] == 0;
  for (int i = 0; i < s->batches; i++) needed |= s->batch[i].kind->constant;
  pw_workspace *w = needed ? pw_workspace_new (s, job->error) : NULL;
  if (w == NULL) return needed ? PW_RESOURCE : PW_OK;
  pw_add_constant_forces (w, s->constant);
  PW_EACH_BATCH (k, w)
    for (int e = 0; e < k->b.count; e++, element++) {
      for (int n = 0; n < k->kind->bodies; n++) {
        int b = k->b.body[e * k->kind->bodies + n];
        if (b == s->bodies || s->M[3 * b + 2] > 0 || s->angle_user[b] >= 0) continue;
        if (pw_kind_acts (k->kind) && (!pw_kind_is_built_in (k->kind) || pw_uses_angle (w, k, e, n)))
          s->angle_user[b] = element;
      }
      for (const pw_source *x = k->source + e * k->kind->signals; x < k->source + (e + 1) * k->kind->signals; x++)
        for (int i = 0; i < x->reads; i++) {
          int j = x->state[i] % s->coords;
          if (j < 3 * s->bodies && j % 3 == 2 && s->angle_user[j / 3] < 0) s->angle_user[j / 3] = element;
        }
    }
  pw_workspace_free (w);
  return PW_OK;
}

/* `mass` and `metric`: M with zeros replaced by the mean of its other entries where nothing turns a body, in the metric
 * otherwise by 1e-6 of it.  Inertias count as inertia / L^2: independent of units, and of whether a mass or an inertia
 * is zero. */
static void compile_metric (pw_system *s) {
  double sum = 0, L2 = s->scale.length * s->scale.length;
  int massive = 0;
  for (int j = s->mechanical; j < s->coords; j++) s->mass[j] = s->metric[j] = 1, s->M[j] = 0;
  for (int j = 0; j < s->mechanical; j++)
    if (s->M[j] > 0) sum += s->M[j] / (pw_is_angle (s, j) ? L2 : 1), massive++;
  double mean = massive ? sum / massive : 1;
  for (int j = 0; j < s->mechanical; j++) {
    double unit = pw_is_angle (s, j) ? L2 : 1, small = (massive ? 1e-6 : 1) * mean * unit;
    int is_unturned = j < 3 * s->bodies && j % 3 == 2 && s->M[j] == 0 && s->angle_user[j / 3] < 0;
    s->mass[j] = is_unturned ? mean * unit : s->M[j];
    s->metric[j] = s->mass[j] > 0 ? s->mass[j] : small;
  }
}

/* 1 if an element may do work: its type has a function `power` or eta.  A position prescribed by constants does no
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

/* The signal of a limit of an element, in its definition; -1: it has none. */
static int compile_find_limit (const pw_system *s, int batch, int element, const void *definition,
                               const pw_signal *signal) {
  for (int i = 0; signal && i < s->limit_sources; i++) {
    const pw_limit_signal *x = &s->limit_signal[i];
    if (x->batch == batch && x->element == element &&
        (const char *)definition + x->field->offset == (const void *)signal)
      return i;
  }
  return -1;
}

/* Sets pw_bounds.partner of the elements of a batch, companions, and of those that they accompany: both are in the
 * order of the model. */
static void compile_partners (pw_system *s, const pw_element_batch *k) {
  const pw_element_batch *of = s->batch;
  while (of < s->batch + s->constraints && of->kind->companion != k->kind) of++;
  for (int e = 0, first = 0; e < k->b.count && of < s->batch + s->constraints; e++, first++) {
    const int row = k->row + e * k->kind->rows;
    while (first < of->b.count && strcmp (of->name[first], k->name[e]) != 0) first++;
    if (first == of->b.count) return;
    s->limit[row].partner = of->row + first * of->kind->rows;
    s->limit[s->limit[row].partner].partner = row;
  }
}

static int compile_limits (const compilation *job) {
  pw_system *s = job->s;
  const compiled *from = job->list;
  pw_bounds *limit;
  const int status = compile_arrays (job, PW_ARRAY (limit, s->rows), PW_ARRAY (s->limit_source, s->rows));
  if (status != PW_OK) return status;
  for (int i = 0; i < s->rows; i++) limit[i] = (pw_bounds){ -INFINITY, INFINITY, { NAN, NAN }, .circle = 0 };
  for (int b = 0; b < s->constraints; b++)
    for (int e = 0; e < s->batch[b].b.count; e++, from++) {
      const pw_kind *kind = s->batch[b].kind;
      const void *definition = from->element->definition;
      const int first = s->batch[b].row + e * kind->rows;
      if (kind->limits) kind->limits (definition, limit + first);
      for (int i = first; i < first + kind->rows; i++) {
        limit[i].partner = -1;
        for (int n = 0; n < 2; n++) {
          s->limit_source[i][n] = compile_find_limit (s, b, e, definition, limit[i].signal[n]);
          limit[i].signal[n] = NULL;
        }
      }
    }
  s->limit = limit;
  for (int i = 0; i < s->rows; i++) {
    s->limited += pw_is_limited (s, i);
    if (isnan (limit[i].sliding[0])) limit[i].sliding[0] = limit[i].least;
    if (isnan (limit[i].sliding[1])) limit[i].sliding[1] = limit[i].most;
  }
  for (const pw_element_batch *k = s->batch; k < s->batch + s->constraints; k++) compile_partners (s, k);
  for (int i = 0; i < s->rows; i++) limit[i].relative &= limit[i].partner >= 0;
  if (s->limited == 0) s->limit = NULL;
  return PW_OK;
}

/* 1 if an element may dissipate energy: of constraints, if a multiplier has a limit.  A companion has the losses of
 * both. */
static int compile_has_loss (const pw_system *s, const pw_element_batch *k, int element) {
  if (k->kind->limits == NULL) return k->kind->loss != NULL;
  const pw_bounds *first = s->limit ? &s->limit[k->row + element * k->kind->rows] : NULL;
  if (first && first->partner >= 0 && !first->relative) return 0;
  for (int i = 0; i < k->kind->rows; i++)
    if (pw_is_limited (s, k->row + element * k->kind->rows + i)) return 1;
  return 0;
}

/* Lists the entries of the ledger, at most two for each element. */
static int compile_ledger (const compilation *job) {
  pw_system *s = job->s;
  s->entry = compile_alloc (job, 2 * (size_t)job->listed, sizeof *s->entry);
  if (s->entry == NULL) return PW_RESOURCE;
  for (int impact = 0; impact < 2; impact++) {
    for (int i = 0; i < s->batches; i++) {
      const pw_element_batch *k = &s->batch[i];
      for (int loss = 0; loss < 2; loss++) {
        const int first = s->entries;
        for (int e = 0; e < k->b.count; e++)
          if (impact == (loss && !k->kind->loss) && (loss ? compile_has_loss (s, k, e) : compile_has_work (k, e)))
            s->entry[s->entries++] = (pw_entry){ i, e, loss ? PW_LOSS : PW_WORK, .whole = 0 };
        const int whole = s->entries - first == k->b.count && (loss ? k->kind->loss : k->kind->power);
        if (whole) s->entry[first].whole = k->b.count;
      }
    }
    if (!impact) s->powers = s->entries;
  }
  return PW_OK;
}

/* Finds the columns that an output reads: those of the motion, and outputs added before. */
static int compile_output_reads (const compilation *job, pw_compiled_output *o) {
  static const unsigned refused =
      1u << PW_COLUMN_POSITION | 1u << PW_COLUMN_VELOCITY | 1u << PW_COLUMN_PROJECTION | 1u << PW_COLUMN_BALANCE;
  const char *const *reads = o->function.reads;
  pw_error cause = { 0 };
  while (reads && reads[o->reads]) o->reads++;
  pw_column *read = compile_alloc (job, (size_t)o->reads, sizeof *read);
  if ((o->read = read) == NULL) return PW_RESOURCE;
  for (int i = 0; i < o->reads; i++) {
    if (pw_system_find_column (job->s, reads[i], read + i, &cause) != PW_OK)
      return pw_fail (job->error, PW_INPUT, "model %s: output %s: %s", job->m->name, o->name, cause.text);
    if (refused >> read[i].type & 1)
      return pw_fail (job->error, PW_INPUT,
                      "model %s: output %s reads %s, which describes the integration, not the motion", job->m->name,
                      o->name, reads[i]);
    o->types |= 1u << read[i].type;
    if (read[i].type == PW_COLUMN_OUTPUT) o->types |= job->s->output[read[i].index].types;
  }
  job->s->output_types |= o->types;
  return PW_OK;
}

static int compile_outputs (compilation *job) {
  pw_system *s = job->s;
  s->output = compile_alloc (job, (size_t)job->m->outputs, sizeof *s->output);
  if (s->output == NULL) return PW_RESOURCE;
  for (const pw_named_output *from = job->m->output; from < job->m->output + job->m->outputs; from++) {
    pw_compiled_output o = { .name = compile_text (job, from->name),
                             .unit = compile_text (job, from->unit ? from->unit : ""),
                             .function = from->value };
    pw_column same;
    int status;
    if (o.name == NULL || o.unit == NULL) return PW_RESOURCE;
    if (pw_names_add (&job->name, o.name, 0) >= 0 || pw_kind_find_column (NULL, o.name, &same))
      return pw_fail (job->error, PW_INPUT,
                      "model %s: output \"%s\": a body, an element, another output or a column of tables has this name",
                      job->m->name, o.name);
    if ((status = compile_output_reads (job, &o)) != PW_OK) return status;
    o.function.reads = NULL;
    pw_open_function (&o.function, &status);
    s->output[s->outputs++] = o;
    if (status != PW_OK) return compile_no_memory (job);
  }
  return PW_OK;
}

/* The system owns the paths of elements, too: it outlives the model. */
static int compile_paths (const compilation *job) {
  pw_system *s = job->s;
  const pw_model *m = job->m;
  s->path = pw_arena_alloc (&s->arena, (size_t)m->elements * sizeof *s->path);
  if (s->path == NULL) return compile_no_memory (job);
  for (const pw_element *e = m->element; e < m->element + m->elements; e++) {
    pw_path *const *path = pw_field_at (e->kind, e->definition, PW_TRACK, 0);
    if (path && *path) s->path[s->paths++] = pw_path_share (*path);
  }
  return PW_OK;
}

static int compile_all (compilation *job) {
  int status = compile_names (job);
  if (status == PW_OK) status = pw_check_model (job->m, &job->name, job->error);
  if (status == PW_OK) status = compile_types (job);
  if (status == PW_OK) status = compile_sizes (job);
  if (status == PW_OK) status = compile_bodies (job);
  if (status == PW_OK) status = compile_batches (job);
  if (status == PW_OK) status = compile_limit_signals (job);
  if (status == PW_OK) status = compile_signals (job);
  if (status == PW_OK) status = compile_initial (job);
  if (status != PW_OK) return status;
  job->s->scale = (pw_scale){ compile_length (job), 1 };
  status = compile_evaluated (job);
  if (status == PW_OK) compile_metric (job->s);
  if (status == PW_OK) status = compile_limits (job);
  if (status == PW_OK) status = compile_ledger (job);
  if (status == PW_OK) status = compile_outputs (job);
  return status == PW_OK ? compile_paths (job) : status;
}

pw_system *pw_system_compile (const pw_model *m, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK) return NULL;
  compilation job = { .m = m, .s = calloc (1, sizeof *job.s), .error = error };
  int status = PW_OK;
  if (!m->built)
    status = pw_fail (error, PW_INPUT, "model %s: pw_system_compile before pw_model_build", m->name);
  else if (m->error.status != PW_OK) /* from pw_model_build, or from something added after it */
    status = pw_fail (error, m->error.status, "%s", m->error.text);
  else
    status = job.s ? compile_all (&job) : compile_no_memory (&job);
  pw_names_close (&job.name);
  free (job.list);
  if (status == PW_OK) return job.s;
  pw_system_free (job.s);
  return NULL;
}

void pw_system_free (pw_system *s) {
  if (s == NULL) return;
  pw_close_functions (s->source, s->source ? s->sources : 0, s->output, s->outputs);
  for (int i = 0; i < s->paths; i++) pw_path_close (s->path[i]);
  pw_arena_free (&s->arena);
  free (s->batch);
  free (s);
}
