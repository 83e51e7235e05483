/* Models: element types; checks; parameters, bodies and elements as the build function declares them. */
#include <ctype.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"

const pw_kind *const pw_kinds[] = {
#define PW_KIND(k) &pw_kind_##k,
  PW_KINDS
#undef PW_KIND
      NULL
};

int pw_kind_is_built_in (const pw_kind *kind) {
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if (*k == kind || (*k)->exact == kind || (*k)->companion == kind) return 1;
  return 0;
}

size_t pw_field_bytes (pw_field_type type) {
  static const size_t bytes[] = {
    [PW_NUMBER] = sizeof (double), [PW_POINT] = sizeof (double[2]),  [PW_VECTOR] = sizeof (double[2]),
    [PW_BODY] = sizeof (char *),   [PW_SIGNAL] = sizeof (pw_signal), [PW_CHOICE] = sizeof (int),
    [PW_TEXT] = sizeof (char *),   [PW_TRACK] = sizeof (pw_path *)
  };
  return (size_t)type < sizeof bytes / sizeof *bytes ? bytes[type] : 0;
}

const void *pw_field_at (const pw_kind *kind, const void *definition, pw_field_type type, int index) {
  for (const pw_field *f = kind->fields; f->name; f++) {
    if (f->type != type) continue;
    if (index < pw_field_count (f)) return (const char *)definition + f->offset + (size_t)index * pw_field_bytes (type);
    index -= pw_field_count (f);
  }
  return NULL;
}

char *pw_field_value_name (const pw_field *f, int i, char *buffer, size_t size) {
  return pw_field_count (f) > 1 ? pw_print (buffer, size, "%s[%d]", f->name, i)
                                : pw_print (buffer, size, "%s", f->name);
}

_Static_assert(PW_NAME_MAX == 50, "as in FAULT_TEXT");
#define FAULT_TEXT ": expected at most 50 bytes of UTF-8 without control characters"

/* 1 if a name or unit is too long or not one line: it would spoil tables and files. */
static int is_bad_text (const char *text) {
  return strlen (text) > PW_NAME_MAX || !pw_is_line (text);
}

static const char *fault_field (const pw_kind *kind, const pw_field *f) {
  size_t bytes = pw_field_bytes (f->type) * (size_t)pw_field_count (f);
  if (is_bad_text (f->name) || (f->unit && is_bad_text (f->unit))) return "name or unit" FAULT_TEXT;
  if (bytes == 0) return "its type does not exist";
  if ((size_t)f->domain > PW_FRACTION) return "its domain does not exist";
  if (f->offset < sizeof (char *) || bytes > kind->definition || f->offset > kind->definition - bytes)
    return "outside the definition, whose first member is its name and whose sizeof is .definition";
  if (f->given && (f->type != PW_NUMBER || f->given < sizeof (char *) || f->given > kind->definition - sizeof (int)))
    return "given: not a number, or outside the definition";
  if (f->type == PW_CHOICE && (f->choices == NULL || f->choices[0] == NULL)) return "a choice without choices";
  return "";
}

/* The fault of the fields, or ""; the text may be in the buffer. */
static const char *fault_fields (const pw_kind *kind, char *buffer, size_t size) {
  int bodies = 0, signals = 0, limits = 0, paths = 0;
  if (kind->fields == NULL) return "no table of fields";
  for (const pw_field *f = kind->fields; f->name; f++) {
    const char *fault = fault_field (kind, f);
    if (*fault) return pw_print (buffer, size, "field %.50s: %s", f->name, fault);
    if (f->type == PW_BODY) bodies += pw_field_count (f);
    if (f->type == PW_TRACK) paths += pw_field_count (f);
    if (f->limit && (f->type != PW_SIGNAL || f->count > 1))
      return pw_print (buffer, size, "field %.50s: a limit that is not one signal", f->name);
    if (f->type == PW_SIGNAL && !f->limit && limits) return "signals after those of limits";
    if (f->type == PW_SIGNAL && !f->limit) signals += pw_field_count (f);
    limits |= f->limit;
  }
  if (paths > 1) return "more than one path";
  if (kind->each_body && (bodies > 0 || kind->bodies != 1))
    return "an element type that acts on each body has one body and no body fields";
  if (!kind->each_body && bodies != kind->bodies) return "bodies is not the sum of the counts of PW_BODY fields";
  if (signals != kind->signals) return "signals is not the sum of the counts of PW_SIGNAL fields";
  return "";
}

static const char *fault_functions (const pw_kind *kind) {
  pw_batch_function *const exact[] = { kind->g,       kind->g_size,     kind->eta,    kind->J,     kind->gamma,
                                       kind->force,   kind->force_u,    kind->energy, kind->power, kind->loss,
                                       kind->contact, kind->saturation, kind->J_u,    kind->eta_u, kind->gamma_u };
  for (size_t i = 0; i < sizeof exact / sizeof *exact; i++)
    if (exact[i] == PW_BY_DIFFERENCES) return "PW_BY_DIFFERENCES is permitted only for second-order blocks";
  if (kind->of_coordinate && (kind->internal == 0 || kind->rows == 0 || kind->force_u))
    return "signals of an internal coordinate, but no internal coordinate, no constraint equations, or force_u";
  if (kind->constant && (kind->force == NULL || kind->signals > 0))
    return "declared constant, but it has no force, or has signals";
  if (kind->signals > 0 && kind->rows == 0 && kind->force && kind->force_u == NULL)
    return "a force with signals, but no force_u";
  if (kind->force == NULL && kind->force_u) return "force_u, but no force";
  if ((kind->J_u || kind->eta_u || kind->gamma_u) && (kind->level != PW_NONHOLONOMIC || kind->force_u))
    return "J_u, eta_u or gamma_u, but its signals belong to no velocity constraint";
  if (kind->rows > 0 && kind->J == NULL) return "constraint equations without J";
  if (kind->level == PW_HOLONOMIC && kind->g == NULL) return "holonomic constraint equations without g";
  if (kind->level != PW_HOLONOMIC && kind->g) return "g, but no holonomic constraint equations";
  if (kind->limits && kind->rows == 0) return "limits, but no constraint equations";
  if (kind->exact && (kind->is_exact == NULL || kind->exact->definition != kind->definition))
    return "an exact type, but no is_exact, or definitions of different sizes";
  if (kind->companion && (kind->has_companion == NULL || kind->companion->definition != kind->definition))
    return "a companion, but no has_companion, or definitions of different sizes";
  return "";
}

static const char *fault_names (const pw_kind *kind) {
  const char *name[PW_MAX_ROWS + 2 * PW_MAX_INTERNAL];
  int names = 0;
  for (int i = 0; i < kind->rows; i++) {
    const pw_quantity *q = kind->reaction ? &kind->reaction[i] : NULL;
    if (!q || !q->name || !(q->unit || kind->reaction_unit))
      return "constraint equations whose reactions lack a name or unit";
    if (is_bad_text (q->name) || (q->unit && is_bad_text (q->unit))) return "name or unit of a reaction" FAULT_TEXT;
    name[names++] = q->name;
  }
  for (int i = 0; i < kind->internal; i++) {
    const pw_quantity *q = kind->coordinate ? &kind->coordinate[i] : NULL;
    if (!q || !q->name || !q->rate || !q->unit) return "internal coordinates without name, rate or unit";
    if (is_bad_text (q->name) || is_bad_text (q->rate) || is_bad_text (q->unit))
      return "name or unit of an internal coordinate" FAULT_TEXT;
    if (strcmp (q->unit, "rad") != 0 && *q->unit) return "an internal coordinate whose unit is neither rad nor none";
    name[names++] = q->name, name[names++] = q->rate;
  }
  for (int i = 0; i < names; i++)
    for (int n = 0; n < i; n++)
      if (strcmp (name[i], name[n]) == 0) return "two reactions or internal coordinates of the same name";
  return "";
}

/* A table is checked before use, so that a mistake in a plug-in does not crash the program. */
const char *pw_kind_check (const pw_kind *kind, char *buffer, size_t size) {
  if (kind->name == NULL || *kind->name == 0) return "no name";
  if (is_bad_text (kind->name)) return "its name" FAULT_TEXT;
  if (kind->definition < sizeof (char *)) return "the definition has no room for its name";
  if (kind->bodies < 0 || kind->bodies > PW_MAX_BODIES || kind->internal < 0 || kind->internal > PW_MAX_INTERNAL ||
      kind->rows < 0 || kind->rows > PW_MAX_ROWS || kind->signals < 0 || kind->signals > PW_MAX_SIGNALS)
    return pw_print (buffer, size, "at most %d bodies, %d internal coordinates, %d constraint equations and %d signals",
                     PW_MAX_BODIES, PW_MAX_INTERNAL, PW_MAX_ROWS, PW_MAX_SIGNALS);
  if (kind->bodies + kind->internal == 0) return "neither a body nor an internal coordinate";
  if (kind->level < PW_FORCE || kind->level > PW_NONHOLONOMIC || (kind->rows > 0) != (kind->level != PW_FORCE))
    return "rows and level are inconsistent";
  if ((kind->internal > 0 || kind->element > 0) && kind->prepare == NULL)
    return "a prepared element (.element > 0) or internal coordinates, but no prepare function";
  if (kind->element > INT_MAX) return "a prepared element of more than 2147483647 bytes";
  const char *fault = fault_names (kind);
  if (*fault == 0) fault = fault_fields (kind, buffer, size);
  return *fault ? fault : fault_functions (kind);
}

/* Names and units are one line, since tables have them in their heads; a description may have several lines. */
static int check_parameter (const pw_plugin_table *t, const pw_parameter *p, const char *what, pw_error *error) {
  const char *expected = pw_domain_check (p->domain, p->value);
  if (!pw_is_line (p->name) || (p->unit && !pw_is_line (p->unit)) || (p->about && !pw_is_text (p->about)))
    return pw_fail (error, PW_INPUT,
                    "%s: name, unit or meaning of parameter %s is not text: expected UTF-8 without control characters",
                    what, p->name);
  if (p->offset > t->parameters_size || t->parameters_size - p->offset < sizeof (double))
    return pw_fail (error, PW_INPUT,
                    "%s: parameter %s lies outside the model's structure: set .parameters_size to its sizeof", what,
                    p->name);
  if ((size_t)p->domain > PW_FRACTION)
    return pw_fail (error, PW_INPUT, "%s: parameter %s: its domain does not exist", what, p->name);
  if (*expected == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: parameter %s has the default %g: expected %s", what, p->name, p->value,
                  expected);
}

int pw_plugin_check (const pw_plugin_table *t, const char *what, pw_error *error) {
  if (pw_require (t, "the table of a model", error) != PW_OK) return PW_INPUT;
  if (t->abi != PW_ABI || t->size != sizeof *t)
    return pw_fail (error, PW_INPUT,
                    "%s was compiled for another Pinwheel (ABI %u, this one has %u; table of %zu bytes, here %zu): "
                    "recompile it",
                    what, t->abi, (unsigned)PW_ABI, t->size, sizeof *t);
  if (t->build == NULL && t->methods == NULL)
    return pw_fail (error, PW_INPUT, "%s has no build function: PW_MODEL (...) at its end must set .build", what);
  if (t->about && !pw_is_text (t->about))
    return pw_fail (error, PW_INPUT, "%s: .about is not text: expected UTF-8 without control characters", what);
  for (const pw_parameter *p = t->parameters; p && p->name; p++)
    if (check_parameter (t, p, what, error) != PW_OK) return PW_INPUT;
  return PW_OK;
}

/* `type`: "body" or an element type, for messages. */
static int check_name (const pw_model *m, const char *type, const char *name, pw_error *error) {
  if (name == NULL || *name == 0) return pw_fail (error, PW_INPUT, "model %s: a %s without a name", m->name, type);
  if (strlen (name) > PW_NAME_MAX)
    return pw_fail (error, PW_INPUT, "model %s: %s \"%.*s...\": a name has at most %d bytes, this one %zu", m->name,
                    type, PW_NAME_MAX, name, PW_NAME_MAX, strlen (name));
  if (strcmp (name, "ground") == 0)
    return pw_fail (error, PW_INPUT, "model %s: %s \"ground\": this name is reserved for the ground", m->name, type);
  int valid = pw_is_text (name);
  for (const unsigned char *c = (const unsigned char *)name; *c; c++)
    valid &= isalnum (*c) || *c == '_' || *c == '-' || *c >= 0x80; /* the latter: any character beyond ASCII */
  if (valid) return PW_OK;
  return pw_fail (error, PW_INPUT, "model %s: %s \"%s\": expected letters, digits, _, - and characters beyond ASCII",
                  m->name, type, name);
}

int pw_model_check_body (const pw_model *m, const pw_body *b, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK || pw_require (b, "a body", error) != PW_OK) return PW_INPUT;
  if (check_name (m, "body", b->name, error) != PW_OK) return PW_INPUT;
  const struct {
    const char *name;
    double value;
    pw_domain domain;
  } field[] = {
    { "mass", b->mass, PW_NONNEGATIVE }, { "inertia", b->inertia, PW_NONNEGATIVE }, { "start x", b->start[0], PW_REAL },
    { "start y", b->start[1], PW_REAL }, { "start phi", b->start[2], PW_REAL },     { "rate vx", b->rate[0], PW_REAL },
    { "rate vy", b->rate[1], PW_REAL },  { "rate omega", b->rate[2], PW_REAL },
  };
  for (size_t i = 0; i < sizeof field / sizeof *field; i++) {
    const char *expected = pw_domain_check (field[i].domain, field[i].value);
    if (*expected)
      return pw_fail (error, PW_INPUT, "model %s: body %s: %s = %g: expected %s", m->name, b->name, field[i].name,
                      field[i].value, expected);
  }
  int fits = b->corners == 0 || (b->outline && b->corners >= 3 && b->corners <= PW_MOST_CORNERS), finite = 1;
  for (int i = 0; fits && i < b->corners; i++) finite &= isfinite (b->outline[i][0]) && isfinite (b->outline[i][1]);
  if (fits && finite) return PW_OK;
  return pw_fail (error, PW_INPUT, "model %s: body %s: its outline has %d corners%s: expected 3 to %d", m->name,
                  b->name, b->corners, finite ? "" : ", not all of them finite", PW_MOST_CORNERS);
}

/* names: of all bodies of the model, or NULL while it is built: then any name passes. */
static int check_body_name (const pw_model *m, const pw_element *e, const char *body, const pw_names *names,
                            pw_error *error) {
  const char *kind = e->kind->name, *name = pw_element_name (e);
  if (body == NULL || *body == 0)
    return pw_fail (error, PW_INPUT, "model %s: %s %s: a body is missing (the ground is \"ground\")", m->name, kind,
                    name);
  int found = names ? pw_names_find (names, body) : -1;
  if (strcmp (body, "ground") == 0 || names == NULL || (found >= 0 && found < m->bodies)) return PW_OK;
  pw_nearest near = { .sought = body };
  for (int i = 0; i < m->bodies; i++) pw_nearest_try (&near, m->body[i].name);
  pw_nearest_try (&near, "ground");
  return pw_fail (error, PW_INPUT, "model %s: %s %s: there is no body \"%s\"%s", m->name, kind, name, body,
                  pw_nearest_text (&near));
}

static void check_value (const pw_kind *kind, const pw_field *f, const void *at, char *text, size_t size) {
  int point, choices = 0, numbers = f->type == PW_NUMBER ? 1 : f->type == PW_POINT || f->type == PW_VECTOR ? 2 : 0;
  for (int k = 0; k < numbers && !*text; k++) {
    const double value = ((const double *)at)[k];
    const char *expected = pw_domain_check (f->type == PW_NUMBER ? f->domain : PW_REAL, value);
    if (*expected) snprintf (text, size, " = %g: expected %s", value, expected);
  }
  if (f->type == PW_SIGNAL) pw_signal_check (at, f->limit ? NULL : kind, &point, text, size);
  if (f->type == PW_TEXT && *(const char *const *)at && is_bad_text (*(const char *const *)at))
    snprintf (text, size, FAULT_TEXT);
  if (f->type != PW_CHOICE) return;
  while (f->choices[choices]) choices++;
  const int value = *(const int *)at;
  if (value < 0 || value >= choices) snprintf (text, size, " = %d: expected 0 to %d", value, choices - 1);
}

static int check_field (const pw_model *m, const pw_element *e, const pw_field *f, const pw_names *names,
                        pw_error *error) {
  char name[PW_NAME_BYTES], fault[300];
  for (int i = 0; i < pw_field_count (f); i++) {
    const void *at = (const char *)e->definition + f->offset + (size_t)i * pw_field_bytes (f->type);
    *fault = 0;
    if (f->type == PW_BODY && check_body_name (m, e, *(const char *const *)at, names, error) != PW_OK) return PW_INPUT;
    check_value (e->kind, f, at, fault, sizeof fault);
    if (*fault)
      return pw_fail (error, PW_INPUT, "model %s: %s %s: %s%s%s", m->name, e->kind->name, pw_element_name (e),
                      pw_field_value_name (f, i, name, sizeof name), f->type == PW_SIGNAL ? ": " : "", fault);
  }
  return PW_OK;
}

static int check_element (const pw_model *m, const pw_element *e, const pw_names *names, pw_error *error) {
  int moves = !e->kind->of_coordinate;
  if (check_name (m, e->kind->name, pw_element_name (e), error) != PW_OK) return PW_INPUT;
  for (const pw_field *f = e->kind->fields; f->name; f++) {
    if (check_field (m, e, f, names, error) != PW_OK) return PW_INPUT;
    const pw_signal *signal = (const void *)((const char *)e->definition + f->offset);
    moves |= f->type == PW_SIGNAL && signal->type != PW_CONSTANT;
  }
  if (!moves)
    return pw_fail (error, PW_INPUT, "model %s: %s %s: the curve has no direction: no signal depends on %s", m->name,
                    e->kind->name, pw_element_name (e), e->kind->coordinate->name);
  for (int i = 0; i < e->kind->bodies && !e->kind->each_body; i++) {
    const char *body = *(const char *const *)pw_field_at (e->kind, e->definition, PW_BODY, i);
    for (int n = 0; n < i; n++)
      if (strcmp (*(const char *const *)pw_field_at (e->kind, e->definition, PW_BODY, n), body) == 0)
        return pw_fail (error, PW_INPUT, "model %s: %s %s: %s of its bodies are \"%s\": expected different ones",
                        m->name, e->kind->name, pw_element_name (e), e->kind->bodies > 2 ? "two" : "both", body);
    if (e->kind->bodies == 1 && strcmp (body, "ground") == 0)
      return pw_fail (error, PW_INPUT, "model %s: %s %s: expected a body other than the ground, which does not move",
                      m->name, e->kind->name, pw_element_name (e));
  }
  return PW_OK;
}

int pw_model_check_element (const pw_model *m, const pw_element *e, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK || pw_require (e, "an element", error) != PW_OK) return PW_INPUT;
  return check_element (m, e, NULL, error);
}

int pw_model_check_output (const pw_model *m, const pw_named_output *o, pw_error *error) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_";
  int reads = 0;
  if (pw_require (m, "a model", error) != PW_OK || pw_require (o, "an output", error) != PW_OK) return PW_INPUT;
  const char *name = o->name ? o->name : "";
  size_t first = strspn (name, letters), n = first;
  while (n > 0 && name[n] && (strchr (letters, name[n]) || (name[n] >= '0' && name[n] <= '9'))) n++;
  if (first == 0 || name[n] || n > 63)
    return pw_fail (error, PW_INPUT,
                    "model %s: output \"%.60s\": expected a letter, then letters, digits and _, at most 63 in all",
                    m->name, name);
  if ((o->unit && is_bad_text (o->unit)) || (o->about && !pw_is_text (o->about)))
    return pw_fail (error, PW_INPUT, "model %s: output %s: unit or meaning" FAULT_TEXT, m->name, name);
  if (o->value.eval == NULL) return pw_fail (error, PW_INPUT, "model %s: output %s: no eval", m->name, name);
  while (o->value.reads && o->value.reads[reads]) reads++;
  if (reads <= PW_OUTPUT_READS) return PW_OK;
  return pw_fail (error, PW_INPUT, "model %s: output %s reads more than %d columns", m->name, name, PW_OUTPUT_READS);
}

int pw_check_model (const pw_model *m, const pw_names *names, pw_error *error) {
  for (int i = 0; i < m->bodies; i++)
    if (pw_model_check_body (m, &m->body[i], error) != PW_OK) return PW_INPUT;
  for (int i = 0; i < m->elements; i++)
    if (check_element (m, &m->element[i], names, error) != PW_OK) return PW_INPUT;
  for (int i = 0; i < m->outputs; i++)
    if (pw_model_check_output (m, &m->output[i], error) != PW_OK) return PW_INPUT;
  if (m->outputs <= PW_MOST_OUTPUTS) return PW_OK;
  return pw_fail (error, PW_INPUT, "model %s: %d outputs; a model has at most %d", m->name, m->outputs,
                  PW_MOST_OUTPUTS);
}

/* An object that the model owns. */
struct pw_kept {
  void *object;
  void (*free_object) (void *object);
  struct pw_kept *next;
};

static int model_no_memory (pw_model *m) {
  return pw_fail (&m->error, PW_RESOURCE, "model %s: out of memory", m->name ? m->name : "");
}

static int model_status (const pw_model *m, pw_error *error) {
  return m->error.status == PW_OK ? PW_OK : pw_fail (error, m->error.status, "%s", m->error.text);
}

pw_model *pw_model_new (const char *name, const pw_plugin_table *table, pw_error *error) {
  if (name == NULL || table == NULL) {
    pw_fail (error, PW_INPUT, "a model has no %s", name ? "table" : "name");
    return NULL;
  }
  if (pw_plugin_check (table, PW_PRINTED (200, "model %s", name), error) != PW_OK) return NULL;
  if (table->build == NULL) {
    pw_fail (error, PW_INPUT, "model %s contains integration methods, but no build function", name);
    return NULL;
  }
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
  free (m->output);
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
  if (m->error.status != PW_OK) return m->error.status;
  if (pw_grow (&m->body, (size_t)m->bodies, &m->body_room, sizeof *m->body) != PW_OK) return model_no_memory (m);
  pw_body *b = &m->body[m->bodies++];
  *b = *body;
  b->name = model_copy_text (m, body->name);
  if (b->outline && b->corners > 0 && b->corners <= PW_MOST_CORNERS)
    b->outline = model_copy (m, b->outline, (size_t)b->corners * sizeof *b->outline);
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

static void model_close_path (void *path) {
  pw_path_close (path);
}

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
  if (m->error.status != PW_OK || model_check_kind (m, kind) != PW_OK) return m->error.status;
  if (definition && kind->exact && kind->is_exact (definition)) kind = kind->exact;
  if (model_check_kind (m, kind) != PW_OK) return m->error.status;
  if (pw_grow (&m->element, (size_t)m->elements, &m->element_room, sizeof *m->element) != PW_OK)
    return model_no_memory (m);
  if (definition == NULL) return pw_model_refuse (m, "pw_add of element type %s without a definition", kind->name);
  void *copy = model_copy (m, definition, kind->definition);
  if (copy == NULL) return m->error.status;
  const char **name = copy, **text;
  *name = model_copy_text (m, *name);
  for (int i = 0; i < kind->bodies && !kind->each_body; i++) {
    const char **body = pw_field_mutable (kind, copy, PW_BODY, i);
    *body = model_copy_text (m, *body);
  }
  for (int i = 0; (text = pw_field_mutable (kind, copy, PW_TEXT, i)) != NULL; i++) *text = model_copy_text (m, *text);
  pw_path **path = pw_field_mutable (kind, copy, PW_TRACK, 0);
  if (path && *path) pw_model_keep (m, pw_path_share (*path), model_close_path);
  pw_signal *signal;
  for (int i = 0; (signal = pw_field_mutable (kind, copy, PW_SIGNAL, i)) != NULL; i++) model_copy_signal (m, signal);
  m->element[m->elements++] = (pw_element){ kind, copy };
  return m->error.status;
}

int pw_add_output (pw_model *m, const pw_named_output *output) {
  if (m == NULL || output == NULL) return m ? pw_model_refuse (m, "pw_add_output without an output") : PW_INPUT;
  if (m->error.status != PW_OK) return m->error.status;
  if (pw_grow (&m->output, (size_t)m->outputs, &m->output_room, sizeof *m->output) != PW_OK) return model_no_memory (m);
  pw_named_output *o = &m->output[m->outputs++];
  *o = *output;
  o->name = model_copy_text (m, output->name);
  o->unit = model_copy_text (m, output->unit);
  o->about = model_copy_text (m, output->about);
  if (o->value.reads) o->value.reads = model_copy_names (m, o->value.reads);
  return m->error.status;
}

#define MEMBER(type, function, member) \
  type function (const pw_model *m) {  \
    return m->member;                  \
  }
MEMBER (const char *, pw_model_name, name)
MEMBER (const pw_plugin_table *, pw_model_table, table)
MEMBER (int, pw_model_initials, initials)

#define LIST(type, function, member, number)             \
  const type *function (const pw_model *m, int *count) { \
    *count = m->number;                                  \
    return m->member;                                    \
  }
LIST (pw_body, pw_model_bodies, body, bodies)
LIST (pw_element, pw_model_elements, element, elements)
LIST (pw_named_output, pw_model_outputs, output, outputs)

double pw_model_parameter (const pw_model *m, const pw_parameter *p) {
  double value;
  memcpy (&value, m->parameters + p->offset, sizeof value);
  return value;
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
  const char *copy = model_copy_text (m, state);
  if (copy && pw_grow (&m->initial, (size_t)m->initials, &m->initial_room, sizeof *m->initial) == PW_OK)
    m->initial[m->initials++] = (pw_initial_setting){ copy, value };
  else
    model_no_memory (m);
  return model_status (m, error);
}

int pw_model_has_reference (const pw_model *m) {
  return m->table->reference != NULL || pw_model_reference_text (m)->states > 0;
}
