/* Models: parameters, bodies and elements as the build function declares them. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"

/* An object that the model owns. */
struct pw_kept {
  void *object;
  void (*free_object) (void *object);
  struct pw_kept *next;
};

static int model_no_memory (pw_model *m) {
  return pw_fail (&m->error, PW_RESOURCE, "model %s: out of memory", m->name ? m->name : "");
}

/* Passes on the first error of the model. */
static int model_status (const pw_model *m, pw_error *error) {
  return m->error.status == PW_OK ? PW_OK : pw_fail (error, m->error.status, "%s", m->error.text);
}

pw_model *pw_model_new (const char *name, const pw_plugin_table *table, pw_error *error) {
  if (name == NULL || table == NULL) {
    pw_fail (error, PW_INPUT, "a model has no %s", name ? "table" : "name");
    return NULL;
  }
  char what[200];
  snprintf (what, sizeof what, "model %s", name);
  if (pw_plugin_check (table, what, error) != PW_OK) return NULL;
  pw_model *m = calloc (1, sizeof *m);
  if (m) {
    m->table = table;
    m->name = pw_arena_copy (&m->arena, name);
    m->parameters = pw_arena_alloc (&m->arena, table->parameters_size);
  }
  if (m == NULL || m->name == NULL || m->parameters == NULL) {
    pw_model_free (m);
    pw_fail (error, PW_RESOURCE, "model %s: out of memory", name);
    return NULL;
  }
  for (const pw_parameter *p = table->parameters; p && p->name; p++)
    memcpy (m->parameters + p->offset, &p->value, sizeof (double));
  return m;
}

void pw_model_free (pw_model *m) {
  if (m == NULL) return;
  for (struct pw_kept *k = m->kept; k; k = k->next) k->free_object (k->object);
  pw_arena_free (&m->arena);
  free (m->body);
  free (m->element);
  free (m->initial);
  free (m);
}

int pw_model_set (pw_model *m, const char *parameter, double value, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK) return PW_INPUT;
  if (parameter == NULL) return pw_fail (error, PW_INPUT, "model %s: the name of a parameter is missing", m->name);
  char hint[PW_HINT];
  int i = pw_find_name (m->table->parameters, sizeof (pw_parameter), parameter, hint);
  if (i < 0) return pw_fail (error, PW_INPUT, "model %s has no parameter \"%s\"%s", m->name, parameter, hint);
  const pw_parameter *p = &m->table->parameters[i];
  const char *expected = pw_domain_check (p->domain, value);
  if (*expected)
    return pw_fail (error, PW_INPUT, "model %s: parameter %s = %.17g: expected %s", m->name, parameter, value,
                    expected);
  if (m->built)
    return pw_fail (error, PW_INPUT, "model %s: parameter %s: pw_model_set after pw_model_build", m->name, parameter);
  memcpy (m->parameters + p->offset, &value, sizeof value);
  return PW_OK;
}

int pw_model_build (pw_model *m, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK) return PW_INPUT;
  if (m->built) return pw_fail (error, PW_INPUT, "model %s: pw_model_build called twice", m->name);
  m->table->build (m, m->parameters);
  m->built = 1;
  return model_status (m, error);
}

int pw_model_refuse (pw_model *m, const char *format, ...) {
  char text[400];
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (text, sizeof text, format, arguments);
  va_end (arguments);
  return pw_fail (&m->error, PW_INPUT, "model %s: %s", m->name, text);
}

static int model_grow (pw_model *m, void *array, int count, size_t *room, size_t size) {
  return pw_grow (array, (size_t)count, room, size) == PW_OK ? PW_OK : model_no_memory (m);
}

static void *model_copy (pw_model *m, const void *from, size_t bytes) {
  void *copy = pw_arena_alloc (&m->arena, bytes);
  if (copy) return memcpy (copy, from, bytes);
  model_no_memory (m);
  return NULL;
}

static const char *model_copy_text (pw_model *m, const char *text) {
  char *copy = text ? pw_arena_copy (&m->arena, text) : NULL;
  if (text && copy == NULL) model_no_memory (m);
  return copy;
}

int pw_add_body (pw_model *m, const pw_body *body) {
  if (m == NULL || body == NULL) return m ? pw_model_refuse (m, "pw_add_body without a body") : PW_INPUT;
  if (m->error.status != PW_OK || model_grow (m, &m->body, m->bodies, &m->body_room, sizeof *m->body) != PW_OK)
    return m->error.status;
  pw_body *b = &m->body[m->bodies++];
  *b = *body;
  b->name = model_copy_text (m, body->name);
  return m->error.status;
}

static const char *const *model_copy_names (pw_model *m, const char *const *names) {
  size_t count = 0;
  while (names[count]) count++;
  const char **copy = model_copy (m, names, (count + 1) * sizeof *copy);
  for (size_t i = 0; copy && i < count; i++) copy[i] = model_copy_text (m, names[i]);
  return copy;
}

/* Copies the points of a table, which pw_system_compile checks, and the names of the states that a function reads. */
static void model_copy_signal (pw_model *m, pw_signal *s) {
  if (s->type == PW_FUNCTION && s->function.reads) s->function.reads = model_copy_names (m, s->function.reads);
  if (s->type != PW_TABLE || s->table.count < 1 || s->table.t == NULL || s->table.value == NULL) return;
  s->table.t = model_copy (m, s->table.t, (size_t)s->table.count * sizeof (double));
  s->table.value = model_copy (m, s->table.value, (size_t)s->table.count * sizeof (double));
}

/* Checks an element type; that of the previous element has been checked. */
static int model_check_kind (pw_model *m, const pw_kind *kind) {
  if (m->elements > 0 && m->element[m->elements - 1].kind == kind) return PW_OK;
  char buffer[200];
  const char *fault = kind ? pw_kind_check (kind, buffer, sizeof buffer) : "the table is NULL";
  if (*fault == 0) return PW_OK;
  return pw_fail (&m->error, PW_INPUT, "model %s: element type %s: %s", m->name,
                  kind && kind->name && *kind->name ? kind->name : "(unnamed)", fault);
}

int pw_add (pw_model *m, const pw_kind *kind, const void *definition) {
  if (m == NULL) return PW_INPUT;
  if (m->error.status != PW_OK || model_check_kind (m, kind) != PW_OK ||
      model_grow (m, &m->element, m->elements, &m->element_room, sizeof *m->element) != PW_OK)
    return m->error.status;
  if (definition == NULL) return pw_model_refuse (m, "pw_add of element type %s without a definition", kind->name);
  void *copy = model_copy (m, definition, kind->definition);
  if (copy == NULL) return m->error.status;
  const char **name = copy;
  *name = model_copy_text (m, *name);
  for (int i = 0; i < kind->bodies && !kind->each_body; i++) {
    const char **body = pw_field_mutable (kind, copy, PW_BODY, i);
    *body = model_copy_text (m, *body);
  }
  for (int i = 0; i < kind->signals; i++) model_copy_signal (m, pw_field_mutable (kind, copy, PW_SIGNAL, i));
  m->element[m->elements++] = (pw_element){ kind, copy };
  return m->error.status;
}

#define MEMBER(type, function, member) \
  type function (const pw_model *m) {  \
    return m->member;                  \
  }
MEMBER (const char *, pw_model_name, name)
MEMBER (const pw_plugin_table *, pw_model_table, table)
MEMBER (int, pw_model_initials, initials)

double pw_model_parameter (const pw_model *m, const pw_parameter *p) {
  double value;
  memcpy (&value, m->parameters + p->offset, sizeof value);
  return value;
}

const pw_body *pw_model_bodies (const pw_model *m, int *count) {
  *count = m->bodies;
  return m->body;
}

const pw_element *pw_model_elements (const pw_model *m, int *count) {
  *count = m->elements;
  return m->element;
}

const pw_reference_text *pw_model_reference_text (const pw_model *m) {
  static const pw_reference_text nothing;
  return m->reference ? m->reference : &nothing;
}

void pw_model_set_reference (pw_model *m, const pw_reference_text *reference) {
  m->reference = reference;
}

int pw_model_keep (pw_model *m, void *object, void (*free_object) (void *object)) {
  struct pw_kept *k = pw_arena_alloc (&m->arena, sizeof *k);
  if (k == NULL) {
    free_object (object);
    return model_no_memory (m);
  }
  *k = (struct pw_kept){ object, free_object, m->kept };
  m->kept = k;
  return PW_OK;
}

pw_error *pw_model_error (pw_model *m) {
  return &m->error;
}

/* The signal of this name in an element, or NULL; *near collects the names. */
static pw_signal *model_find_signal (const pw_element *e, const char *name, pw_nearest *near) {
  char known[80];
  for (const pw_field *f = e->kind->fields; f->name; f++)
    for (int i = 0; f->type == PW_SIGNAL && i < pw_field_count (f); i++) {
      pw_nearest_try (near, pw_field_value_name (f, i, known, sizeof known));
      if (strcmp (known, name) == 0) return (pw_signal *)(void *)((char *)e->definition + f->offset) + i;
    }
  return NULL;
}

int pw_model_set_signal (pw_model *m, const char *element, const char *field, const pw_signal *signal,
                         pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK) return PW_INPUT;
  if (element == NULL || field == NULL || signal == NULL)
    return pw_fail (error, PW_INPUT, "model %s: %s is missing", m->name,
                    element == NULL ? "the name of an element"
                    : field == NULL ? "the name of a field"
                                    : "a signal");
  pw_nearest elements = { .sought = element }, fields = { .sought = field };
  const pw_element *e = NULL;
  for (int i = 0; i < m->elements && e == NULL; i++) {
    const char *name = pw_element_name (&m->element[i]);
    if (name) pw_nearest_try (&elements, name);
    if (name && strcmp (name, element) == 0) e = &m->element[i];
  }
  if (e == NULL)
    return pw_fail (error, PW_INPUT, "model %s has no element \"%s\"%s", m->name, element, pw_nearest_text (&elements));
  pw_signal *replaced = model_find_signal (e, field, &fields);
  if (replaced == NULL)
    return pw_fail (error, PW_INPUT, "model %s: %s %s has no signal \"%s\"%s", m->name, e->kind->name, element, field,
                    pw_nearest_text (&fields));
  *replaced = *signal;
  model_copy_signal (m, replaced);
  return model_status (m, error);
}

int pw_model_set_initial (pw_model *m, const char *state, double value, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK) return PW_INPUT;
  if (state == NULL) return pw_fail (error, PW_INPUT, "model %s: the name of a state is missing", m->name);
  const char *expected = pw_domain_check (PW_REAL, value);
  if (*expected)
    return pw_fail (error, PW_INPUT, "model %s: start %s = %g: expected %s", m->name, state, value, expected);
  if (model_grow (m, &m->initial, m->initials, &m->initial_room, sizeof *m->initial) == PW_OK) {
    m->initial[m->initials] = (pw_initial_setting){ model_copy_text (m, state), value };
    if (m->initial[m->initials].state) m->initials++;
  }
  return model_status (m, error);
}

/* ---- Reference solution: a function in C, or expressions of a text model ---- */

int pw_model_has_reference (const pw_model *m) {
  return m->table->reference != NULL || pw_model_reference_text (m)->states > 0;
}

int pw_system_reference (const pw_model *m, const pw_system *s, double t, double *q, double *v, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK || pw_require (s, "a system", error) != PW_OK) return PW_INPUT;
  int n = pw_system_coordinates (s);
  for (int j = 0; j < n; j++) q[j] = v[j] = NAN;
  if (m->table->reference) m->table->reference (m->parameters, t, q, v);
  const pw_reference_text *text = pw_model_reference_text (m);
  for (int i = 0; i < text->states; i++) {
    int state = pw_system_find_state (s, text->state[i], error);
    if (state < 0) return state;
    double *entry = state < n ? &q[state] : &v[state - n];
    *entry = text->eval (text->context, i, t);
  }
  return PW_OK;
}
