/* Checks the table of a plug-in, and the bodies and elements of a model, before these are used. */
#include <ctype.h>
#include <string.h>
#include "model.h"
#include "signal.h"

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
  if (t->build == NULL)
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
  return PW_OK;
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

/* ---- Values: these functions write what is wrong, if anything, to `text` ---- */

static void check_numbers (const pw_field *f, const double *value, char *text, size_t size) {
  for (int k = 0; k < (f->type == PW_NUMBER ? 1 : 2) && !*text; k++) {
    const char *expected = pw_domain_check (f->type == PW_NUMBER ? f->domain : PW_REAL, value[k]);
    if (*expected) snprintf (text, size, " = %g: expected %s", value[k], expected);
  }
}

static void check_choice (const pw_field *f, int value, char *text, size_t size) {
  int choices = 0;
  while (f->choices[choices]) choices++;
  if (value < 0 || value >= choices) snprintf (text, size, " = %d: expected 0 to %d", value, choices - 1);
}

static int check_field (const pw_model *m, const pw_element *e, const pw_field *f, const pw_names *names,
                        pw_error *error) {
  char name[PW_NAME_BYTES], fault[300];
  int point; /* the faulty point of a table; not used here */
  for (int i = 0; i < pw_field_count (f); i++) {
    const void *at = (const char *)e->definition + f->offset + (size_t)i * pw_field_bytes (f->type);
    *fault = 0;
    if (f->type == PW_BODY && check_body_name (m, e, *(const char *const *)at, names, error) != PW_OK) return PW_INPUT;
    if (f->type == PW_NUMBER || f->type == PW_POINT || f->type == PW_VECTOR) check_numbers (f, at, fault, sizeof fault);
    if (f->type == PW_SIGNAL) pw_signal_check (at, e->kind, &point, fault, sizeof fault);
    if (f->type == PW_CHOICE) check_choice (f, *(const int *)at, fault, sizeof fault);
    if (*fault)
      return pw_fail (error, PW_INPUT, "model %s: %s %s: %s%s%s", m->name, e->kind->name, pw_element_name (e),
                      pw_field_value_name (f, i, name, sizeof name), f->type == PW_SIGNAL ? ": " : "", fault);
  }
  return PW_OK;
}

/* ---- Elements and models ---- */

static int check_element (const pw_model *m, const pw_element *e, const pw_names *names, pw_error *error) {
  if (check_name (m, e->kind->name, pw_element_name (e), error) != PW_OK) return PW_INPUT;
  for (const pw_field *f = e->kind->fields; f->name; f++)
    if (check_field (m, e, f, names, error) != PW_OK) return PW_INPUT;
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

int pw_check_model (const pw_model *m, const pw_names *names, pw_error *error) {
  for (int i = 0; i < m->bodies; i++)
    if (pw_model_check_body (m, &m->body[i], error) != PW_OK) return PW_INPUT;
  for (int i = 0; i < m->elements; i++)
    if (check_element (m, &m->element[i], names, error) != PW_OK) return PW_INPUT;
  return PW_OK;
}
