/* pinwheel show --yaml: a model as text with a bit-identical trajectory, if its initial values are consistent.
 *
 * Numbers are written with 17 digits, and omitted if they are the default, 0. */
#include <math.h>
#include <stdio.h>
#include "show.h"

enum { YAML_DIGITS = 17 };

/* A number with all of its digits. */
#define YAML_NUMBER(value) PW_DIGITS (value, YAML_DIGITS)

/* 1 for the default, 0; -0 is not the default. */
static int yaml_is_zero (double value) {
  return value == 0 && !signbit (value);
}

/* Names are made of letters, digits, _, - and characters beyond ASCII; one that begins with - could be read as an entry
 * of a list. */
static void yaml_name (const char *name) {
  printf (*name == '-' ? "\"%s\"" : "%s", name);
}

static void yaml_text (const char *text) {
  putchar ('"');
  for (; *text; text++) {
    int quoted = *text == '"' || *text == '\\', control = (unsigned char)*text < ' ';
    printf (quoted ? "\\%c" : control ? "\\x%02x" : "%c", *text);
  }
  putchar ('"');
}

/* ---- Values ---- */

/* {expression: "t^2", rate: "2*t"}, or f (t, a.phi) for a function of a C model */
static void yaml_function (const pw_signal *s) {
  static const char *const key[] = { "{expression: ", ", rate: ", ", acceleration: " };
  const pw_signal_text *text = s->function.text;
  for (int i = 0; text && i < 3; i++)
    if (text->part[i]) fputs (key[i], stdout), yaml_text (text->part[i]);
  printf (text ? "}" : "f (t");
  for (const char *const *state = s->function.reads; text == NULL && state && *state; state++) printf (", %s", *state);
  if (text == NULL) putchar (')');
}

/* The points of a table; with fewer digits than YAML_DIGITS only their number and their first and last times. */
static void yaml_points (const pw_signal *s, int digits) {
  const double *t = s->table.t;
  int count = s->table.count;
  if (digits < YAML_DIGITS) {
    printf ("%d from %s to %s s", count, PW_DIGITS (t[0], digits), PW_DIGITS (t[count - 1], digits));
    return;
  }
  for (int i = 0; i < count; i++)
    printf ("%s[%s, %s]", i ? ", " : "[", YAML_NUMBER (t[i]), YAML_NUMBER (s->table.value[i]));
  putchar (']');
}

/* 1 if an optional field has its default, zero in all bytes. */
static int yaml_is_default (const pw_field *f, const void *at) {
  if (f->required || f->type == PW_BODY) return 0;
  size_t size = pw_field_bytes (f->type) * (size_t)pw_field_count (f);
  for (size_t i = 0; i < size; i++)
    if (((const char *)at)[i]) return 0;
  return 1;
}

/* {ramp: {to: 1, duration: 2}} */
static void yaml_signal (const pw_signal *s, int digits) {
  const pw_signal_form *form = pw_signal_form_of (s);
  const char *separator = "";
  if (s->type == PW_FUNCTION) {
    yaml_function (s);
    return;
  }
  if (form == NULL) {
    fputs (PW_DIGITS (s->constant, digits), stdout);
    return;
  }
  printf ("{%s: {", form->name);
  for (const pw_field *f = form->fields; f->name; f++) {
    const void *at = (const char *)s + f->offset;
    if (yaml_is_default (f, at)) continue;
    printf ("%s%s: ", separator, f->name), separator = ", ";
    pw_show_field (f, at, digits);
  }
  if (s->type == PW_TABLE) printf ("%spoints: ", separator), yaml_points (s, digits);
  printf ("}}");
}

static void yaml_value (const pw_field *f, const void *at, int digits) {
  const double *number = at;
  if (f->type == PW_NUMBER) fputs (PW_DIGITS (*number, digits), stdout);
  if (f->type == PW_POINT || f->type == PW_VECTOR)
    printf ("[%s, %s]", PW_DIGITS (number[0], digits), PW_DIGITS (number[1], digits));
  if (f->type == PW_BODY) yaml_name (*(const char *const *)at);
  if (f->type == PW_SIGNAL) yaml_signal (at, digits);
  if (f->type == PW_CHOICE) fputs (f->choices[*(const int *)at], stdout);
}

void pw_show_field (const pw_field *f, const void *at, int digits) {
  int count = pw_field_count (f);
  if (count > 1) putchar ('[');
  for (int i = 0; i < count; i++) {
    if (i) printf (", ");
    yaml_value (f, (const char *)at + (size_t)i * pw_field_bytes (f->type), digits);
  }
  if (count > 1) putchar (']');
}

/* ---- Bodies and elements ---- */

/* Numbers that are not the default, or that the model specifies: bit i of `specified`. */
static void yaml_triple (const char *key, const char *const name[3], const double value[3], unsigned specified) {
  int written = 0;
  for (int i = 0; i < 3; i++) {
    if (yaml_is_zero (value[i]) && !(specified >> i & 1)) continue;
    if (written++ == 0) printf (", %s: {", key);
    printf ("%s%s: %s", written > 1 ? ", " : "", name[i], YAML_NUMBER (value[i]));
  }
  if (written) putchar ('}');
}

/* A comment on values that are written although the model does not specify them: reading the text will specify them. */
static void yaml_unspecified (const pw_body *b, const char *const name[6]) {
  const char *separator = "  # the model does not specify ";
  for (int i = 0; i < 6; i++) {
    double value = i < 3 ? b->start[i] : b->rate[i - 3];
    unsigned specified = b->specified ? b->specified >> i & 1 : value != 0; /* so -0 is written, but not specified */
    if (yaml_is_zero (value) || specified) continue;
    printf ("%s%s", separator, name[i]), separator = ", ";
  }
}

static void yaml_body (const pw_body *b) {
  static const char *const state[] = { "x", "y", "phi", "vx", "vy", "omega" };
  printf ("  - {name: "), yaml_name (b->name);
  if (!yaml_is_zero (b->mass)) printf (", mass: %s", YAML_NUMBER (b->mass));
  if (!yaml_is_zero (b->inertia)) printf (", inertia: %s", YAML_NUMBER (b->inertia));
  yaml_triple ("start", state, b->start, b->specified);
  yaml_triple ("rate", state + 3, b->rate, b->specified >> 3);
  putchar ('}');
  yaml_unspecified (b, state);
  putchar ('\n');
}

static void yaml_element (const pw_element *e) {
  printf ("  - {%s: ", e->kind->name), yaml_name (pw_element_name (e));
  for (const pw_field *f = e->kind->fields; f->name; f++) {
    const char *at = (const char *)e->definition + f->offset;
    if (yaml_is_default (f, at)) continue;
    printf (", %s: ", f->name);
    pw_show_field (f, at, YAML_DIGITS);
  }
  puts ("}");
}

/* ---- Contents that a text model cannot express ---- */

/* PW_INPUT if there are any. */
static int yaml_check (const pw_model *m, pw_error *error) {
  int elements;
  const char *model = pw_model_name (m);
  const pw_element *e = pw_model_elements (m, &elements);
  for (const pw_element *end = e + elements; e < end; e++) {
    const char *kind = e->kind->name, *name = pw_element_name (e);
    const pw_kind *const *k = pw_kinds;
    while (*k && *k != e->kind) k++;
    if (*k == NULL)
      return pw_fail (error, PW_INPUT,
                      "model %s cannot be written as text: %s %s has an element type of the model's own", model, kind,
                      name);
    for (const pw_field *f = e->kind->fields; f->name; f++) {
      const pw_signal *s = (const void *)((const char *)e->definition + f->offset);
      for (int i = 0; f->type == PW_SIGNAL && i < pw_field_count (f); i++)
        if (s[i].type == PW_FUNCTION && s[i].function.text == NULL)
          return pw_fail (error, PW_INPUT,
                          "model %s cannot be written as text: the signal \"%s\" of %s %s is a function", model,
                          f->name, kind, name);
    }
  }
  if (pw_model_initials (m))
    return pw_fail (error, PW_INPUT,
                    "--yaml: initial values of --start have no place in a text model; give them to run");
  return PW_OK;
}

/* ---- The model ---- */

static void yaml_run (const pw_run_defaults *run) {
  const char *const key[] = { "t_end", "step", "rtol" };
  const double value[] = { run->t_end, run->step, run->rtol };
  const char *separator = "run: {";
  for (int i = 0; i < 3; i++)
    if (value[i] != 0) printf ("%s%s: %s", separator, key[i], YAML_NUMBER (value[i])), separator = ", ";
  if (run->method) printf ("%smethod: ", separator), yaml_text (run->method), separator = ", ";
  if (*separator == ',') puts ("}");
}

/* Expressions contain names, whose values are written under `let`. */
static void yaml_names (const pw_reference_text *ref) {
  if (ref->names) puts ("let:");
  for (int i = 0; i < ref->names; i++) printf ("  %s: %s\n", ref->name[i], YAML_NUMBER (ref->value[i]));
}

static void yaml_reference (const pw_model *m) {
  const pw_reference_text *ref = pw_model_reference_text (m);
  if (pw_model_table (m)->reference)
    puts ("# The reference solution of the model is a function in C, which cannot be written as text.");
  if (ref->states) puts ("truth:");
  for (int i = 0; i < ref->states; i++) printf ("  %s: ", ref->state[i]), yaml_text (ref->text[i]), putchar ('\n');
}

int pw_show_yaml (const pw_cli_model *opened, pw_error *error) {
  const pw_model *m = opened->model;
  if (yaml_check (m, error) != PW_OK) return error->status;
  puts ("pinwheel: 1");
  const pw_plugin_table *table = pw_model_table (m);
  int bodies, elements;
  const pw_body *b = pw_model_bodies (m, &bodies);
  const pw_element *e = pw_model_elements (m, &elements);
  if (table->about && *table->about) printf ("about: "), yaml_text (table->about), putchar ('\n');
  yaml_run (&table->run);
  yaml_names (pw_model_reference_text (m));
  if (bodies) puts ("bodies:");
  for (int i = 0; i < bodies; i++) yaml_body (&b[i]);
  if (elements) puts ("elements:");
  for (int i = 0; i < elements; i++) yaml_element (&e[i]);
  yaml_reference (m);
  return PW_OK;
}
