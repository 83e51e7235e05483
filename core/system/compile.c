/* Compiles a model: names become indices, the elements of each type become one batch.
 *
 * All arrays of the system but that of the batches are in its arena; `scratch` has data needed only during
 * compilation. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "system.h"

/* Bytes after an element, and their value, which `prepare` must not change. */
enum { COMPILE_GUARD = 64, COMPILE_MARK = 0xa5 };

/* The most elements, coordinates, constraint equations: products with columns and signals of an element must be int. */
enum { COMPILE_MOST = INT_MAX / 64 };

typedef struct {
  const pw_model *m;
  pw_system *s;
  pw_error *error;
  pw_arena scratch;
  pw_names name;           /* of bodies: their indices; of elements: theirs plus the number of bodies */
  int *batch_of;           /* for each element of the model: index of its batch */
  size_t bytes;            /* of the largest element and its guard */
  unsigned char *prepared; /* bytes: memory in which an element is prepared */
} compilation;

static int compile_no_memory (const compilation *job) {
  return pw_fail (job->error, PW_RESOURCE, "model %s: out of memory", job->m->name);
}

static int compile_too_large (const compilation *job) {
  return pw_fail (job->error, PW_INPUT, "model %s is too large", job->m->name);
}

/* Memory that belongs to the system.  NULL and the error if out of memory. */
static void *compile_alloc (const compilation *job, size_t count, size_t size) {
  void *p = pw_arena_alloc (&job->s->arena, count * size);
  if (p == NULL) compile_no_memory (job);
  return p;
}

static const char *compile_text (const compilation *job, const char *text) {
  const char *copy = pw_arena_copy (&job->s->arena, text);
  if (copy == NULL) compile_no_memory (job);
  return copy;
}

/* ---- Counting ---- */

static int compile_names (compilation *job) {
  const pw_model *m = job->m;
  if (pw_names_open (&job->name, (size_t)m->bodies + (size_t)m->elements) != PW_OK) return compile_no_memory (job);
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

/* Number of elements of the system for one element of the model: one, or one for each body with mass. */
static int compile_copies (const pw_model *m, const pw_kind *kind) {
  int massive = 0;
  if (!kind->each_body) return 1;
  for (int i = 0; i < m->bodies; i++) massive += m->body[i].mass > 0;
  return massive;
}

/* Counts the elements of each batch: holonomic types in order of appearance, then nonholonomic ones, then forces. */
static int compile_types (compilation *job) {
  static const pw_level order[] = { PW_HOLONOMIC, PW_NONHOLONOMIC, PW_FORCE };
  const pw_model *m = job->m;
  pw_system *s = job->s;
  size_t room = 0;
  double elements = 0;
  job->batch_of = pw_arena_alloc (&job->scratch, (size_t)m->elements * sizeof *job->batch_of);
  if (job->batch_of == NULL || pw_grow (&s->batch, 0, &room, sizeof *s->batch) != PW_OK) return compile_no_memory (job);
  for (int l = 0; l < 3; l++)
    for (int i = 0; i < m->elements; i++) {
      const pw_kind *kind = m->element[i].kind;
      if (kind->level != order[l]) continue;
      int k = 0;
      while (k < s->batches && s->batch[k].kind != kind) k++;
      if (k == s->batches) {
        if (pw_grow (&s->batch, (size_t)k, &room, sizeof *s->batch) != PW_OK) return compile_no_memory (job);
        s->batch[s->batches++] = (pw_element_batch){ .kind = kind };
      }
      int copies = compile_copies (m, kind);
      elements += copies;
      if (elements > COMPILE_MOST) return compile_too_large (job);
      s->batch[k].b.count += copies;
      job->batch_of[i] = k;
      if (job->bytes < kind->element + COMPILE_GUARD) job->bytes = kind->element + COMPILE_GUARD;
    }
  job->prepared = pw_arena_alloc (&job->scratch, job->bytes);
  return job->prepared ? PW_OK : compile_no_memory (job);
}

static int compile_count (const compilation *job) {
  const pw_model *m = job->m;
  pw_system *s = job->s;
  double coords = 3.0 * m->bodies;
  if (m->bodies == 0) return pw_fail (job->error, PW_INPUT, "model %s has no body", m->name);
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    coords += (double)k->b.count * k->kind->internal;
    s->rows += k->b.count * k->kind->rows;
    if (k->kind->level == PW_HOLONOMIC) s->holonomic = s->rows; /* these batches come first */
    s->sources += k->b.count * k->kind->signals;
  }
  if (coords > COMPILE_MOST || s->rows > COMPILE_MOST) return compile_too_large (job);
  s->bodies = m->bodies;
  s->coords = (int)coords;
  return PW_OK;
}

static int compile_arrays (const compilation *job) {
  pw_system *s = job->s;
  size_t coords = (size_t)s->coords, bodies = (size_t)s->bodies;
  s->source = compile_alloc (job, (size_t)s->sources, sizeof *s->source);
  s->body_name = compile_alloc (job, bodies, sizeof *s->body_name);
  s->mass = compile_alloc (job, 5 * coords + 3, sizeof *s->mass); /* and those after it */
  s->origin = compile_alloc (job, 2 * coords, 1);
  if (s->source == NULL || s->body_name == NULL || s->mass == NULL || s->origin == NULL) return PW_RESOURCE;
  s->metric = s->mass + coords, s->q0 = s->metric + coords, s->v0 = s->q0 + coords, s->constant = s->v0 + coords;
  return PW_OK;
}

/* ---- Bodies and elements ---- */

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
    s->mass[3 * i] = s->mass[3 * i + 1] = b->mass;
    s->mass[3 * i + 2] = b->inertia;
    memcpy (s->q0 + 3 * i, b->start, sizeof b->start);
    memcpy (s->v0 + 3 * i, b->rate, sizeof b->rate);
    for (int k = 0; k < 3; k++) {
      s->origin[3 * i + k] = compile_origin (b, b->start[k], k, PW_ZERO_POSITION);
      s->origin[s->coords + 3 * i + k] = compile_origin (b, b->rate[k], 3 + k, 0);
    }
  }
  return s->model ? PW_OK : PW_RESOURCE;
}

/* Prepares an element in scratch memory, checks that `prepare` stays within its size, and copies it. */
static int compile_prepare (const compilation *job, const pw_element *from, const pw_body *const *bodies,
                            pw_internal *internal, void *element) {
  const pw_kind *kind = from->kind;
  size_t size = kind->element;
  pw_error cause = { 0 };
  memset (job->prepared, 0, size);
  memset (job->prepared + size, COMPILE_MARK, COMPILE_GUARD);
  int status = kind->prepare (from->definition, bodies, job->prepared, internal, &cause);
  if (status != PW_OK)
    return pw_fail (job->error, status == PW_RESOURCE ? PW_RESOURCE : PW_INPUT, "model %s: %s %s: %s", job->m->name,
                    kind->name, pw_element_name (from), *cause.text ? cause.text : "prepare refuses it");
  for (size_t i = 0; i < COMPILE_GUARD; i++)
    if (job->prepared[size + i] != COMPILE_MARK)
      return pw_fail (job->error, PW_INPUT,
                      "model %s: element type %s: prepare writes more than the %zu bytes of .element", job->m->name,
                      kind->name, size);
  memcpy (element, job->prepared, size);
  return PW_OK;
}

/* The arrays of a batch while they are filled. */
typedef struct {
  char *element;
  int *body, *column;
  const char **name;
} batch_arrays;

/* Stores element e of a batch: bodies, columns, prepared element, internal coordinates.  body: the body on which an
 * each_body type acts, or -1. */
static int compile_element (const compilation *job, const pw_element_batch *k, const batch_arrays *a, int e,
                            const pw_element *from, int body) {
  static const pw_body ground = { .name = "ground" };
  const pw_kind *kind = k->kind;
  pw_system *s = job->s;
  const pw_body *bodies[PW_MAX_BODIES];
  for (int n = 0; n < kind->bodies; n++) {
    int index =
        body >= 0 ? body
                  : pw_names_find (&job->name, *(const char *const *)pw_field_at (kind, from->definition, PW_BODY, n));
    bodies[n] = index < 0 ? &ground : &job->m->body[index];
    a->body[e * kind->bodies + n] = index < 0 ? s->bodies : index;
    a->column[e * kind->bodies + n] = index < 0 ? s->coords : 3 * index;
  }
  if (kind->prepare == NULL) return PW_OK;
  pw_internal internal[PW_MAX_INTERNAL] = { { 0 } };
  int status = compile_prepare (job, from, bodies, internal, a->element + (size_t)e * kind->element);
  if (status != PW_OK) return status;
  for (int n = 0, j = k->internal + e * kind->internal; n < kind->internal; n++, j++) {
    const char *expected = pw_domain_check (PW_NONNEGATIVE, internal[n].mass);
    if (*expected)
      return pw_fail (job->error, PW_INPUT, "model %s: %s %s: inertia of %s = %g: expected %s", job->m->name,
                      kind->name, pw_element_name (from), kind->coordinate[n].name, internal[n].mass, expected);
    s->mass[j] = internal[n].mass;
    s->q0[j] = internal[n].start;
    s->v0[j] = internal[n].rate;
    s->origin[j] = internal[n].specified[0] ? PW_SPECIFIED : 0;
    s->origin[s->coords + j] = internal[n].specified[1] ? PW_SPECIFIED : 0;
  }
  return PW_OK;
}

/* Stores the elements of batch i, those of an each_body type once for every body with mass. */
static int compile_batch (const compilation *job, int i, const batch_arrays *a) {
  const pw_element_batch *k = &job->s->batch[i];
  int e = 0, status = PW_OK;
  for (int n = 0; n < job->m->elements && status == PW_OK; n++) {
    if (job->batch_of[n] != i) continue;
    const pw_element *from = &job->m->element[n];
    const char *name = compile_text (job, pw_element_name (from));
    if (name == NULL) return PW_RESOURCE;
    for (int b = k->kind->each_body ? 0 : -1; b < (k->kind->each_body ? job->s->bodies : 0); b++) {
      if (b >= 0 && !(job->m->body[b].mass > 0)) continue;
      a->name[e] = name;
      if ((status = compile_element (job, k, a, e++, from, b)) != PW_OK) break;
    }
  }
  return status;
}

static int compile_batches (const compilation *job) {
  pw_system *s = job->s;
  int row = 0, internal = 3 * s->bodies, status = PW_OK;
  pw_source *source = s->source;
  for (int i = 0; i < s->batches && status == PW_OK; i++) {
    pw_element_batch *k = &s->batch[i];
    const pw_kind *kind = k->kind;
    int count = k->b.count;
    size_t n = (size_t)count, bodies = n * (size_t)kind->bodies;
    batch_arrays a = { compile_alloc (job, n, kind->element), compile_alloc (job, bodies, sizeof (int)),
                       compile_alloc (job, bodies, sizeof (int)), compile_alloc (job, n, sizeof (char *)) };
    if (!a.element || !a.body || !a.column || !a.name) return PW_RESOURCE;
    *k = (pw_element_batch){
      .kind = kind, .row = row, .internal = internal, .column = a.column, .name = a.name, .source = source
    };
    k->b = (pw_batch){ count, 3 * kind->bodies + kind->internal, .element = a.element, .body = a.body };
    row += count * kind->rows;
    internal += count * kind->internal;
    source += count * kind->signals;
    status = compile_batch (job, i, &a);
  }
  return status;
}

/* ---- Initial values, scales ---- */

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

/* M with zeros replaced by 1e-6 of the mean of its other entries, where inertias count as inertia / L^2: independent of
 * units, and of whether a mass or an inertia is zero. */
static void compile_metric (pw_system *s) {
  double sum = 0, L2 = s->scale.length * s->scale.length;
  int massive = 0;
  for (int j = 0; j < s->coords; j++)
    if (s->mass[j] > 0) sum += s->mass[j] / (pw_is_angle (s, j) ? L2 : 1), massive++;
  double weight = massive ? 1e-6 * sum / massive : 1;
  for (int j = 0; j < s->coords; j++)
    s->metric[j] = s->mass[j] > 0 ? s->mass[j] : weight * (pw_is_angle (s, j) ? L2 : 1);
}

/* Counts the batches that have a property, lists the ledger's entries, and evaluates the constant forces. */
static int compile_totals (const compilation *job) {
  pw_system *s = job->s;
  int constant = 0;
  s->entry = compile_alloc (job, 2 * (size_t)pw_system_elements (s), sizeof *s->entry);
  if (s->entry == NULL) return PW_RESOURCE;
  s->entries = pw_ledger_list (s, s->entry);
  for (int i = 0; i < s->batches; i++) {
    const pw_kind *kind = s->batch[i].kind;
    s->constraints += kind->rows > 0;
    s->rheonomic += kind->eta != NULL;
    s->forces += kind->force && !kind->constant;
    constant |= kind->force && kind->constant;
    s->saturates |= kind->saturation != NULL;
  }
  if (!constant) return PW_OK;
  pw_workspace *w = pw_workspace_new (s, job->error);
  if (w == NULL) return PW_RESOURCE;
  pw_evaluate_constant (w, s->constant);
  pw_workspace_free (w);
  return PW_OK;
}

static int compile_all (compilation *job) {
  int status = compile_names (job);
  if (status == PW_OK) status = pw_check_model (job->m, &job->name, job->error);
  if (status == PW_OK) status = compile_types (job);
  if (status == PW_OK) status = compile_count (job);
  if (status == PW_OK) status = compile_arrays (job);
  if (status == PW_OK) status = compile_bodies (job);
  if (status == PW_OK) status = compile_batches (job);
  if (status == PW_OK) status = pw_compile_signals (job->s, job->m, job->batch_of, job->error);
  if (status == PW_OK) status = compile_initial (job);
  if (status != PW_OK) return status;
  job->s->scale = (pw_scale){ compile_length (job), 1 };
  compile_metric (job->s);
  return compile_totals (job);
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
  pw_arena_free (&job.scratch);
  if (status == PW_OK) return job.s;
  pw_system_free (job.s);
  return NULL;
}

void pw_system_free (pw_system *s) {
  if (s == NULL) return;
  pw_close_signals (s->source, s->source ? s->sources : 0);
  pw_arena_free (&s->arena);
  free (s->batch);
  free (s);
}
