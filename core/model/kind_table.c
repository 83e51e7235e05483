/* Element types: the list of built-in ones, the fields of a definition, and checks of a type's table.  A table is
 * checked before use, so that a mistake in a plug-in is reported instead of crashing the program. */
#include <stdio.h>
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
    if (*k == kind) return 1;
  return 0;
}

size_t pw_field_bytes (pw_field_type type) {
  switch (type) {
  case PW_NUMBER:
    return sizeof (double);
  case PW_POINT:
  case PW_VECTOR:
    return 2 * sizeof (double);
  case PW_BODY:
    return sizeof (char *);
  case PW_SIGNAL:
    return sizeof (pw_signal);
  case PW_CHOICE:
    return sizeof (int);
  }
  return 0;
}

const void *pw_field_at (const pw_kind *kind, const void *definition, pw_field_type type, int k) {
  for (const pw_field *f = kind->fields; f->name; f++) {
    if (f->type != type) continue;
    if (k < pw_field_count (f)) return (const char *)definition + f->offset + (size_t)k * pw_field_bytes (type);
    k -= pw_field_count (f);
  }
  return NULL;
}

/* The fault of one field, or "". */
static const char *fault_field (const pw_kind *k, const pw_field *f) {
  size_t bytes = pw_field_bytes (f->type) * (size_t)pw_field_count (f);
  if (bytes == 0) return "its type does not exist";
  if (f->offset < sizeof (char *) || f->offset + bytes > k->definition)
    return "it lies outside the definition: is .definition its sizeof, its first member the name?";
  if (f->type == PW_CHOICE && (f->choices == NULL || f->choices[0] == NULL)) return "a choice without choices";
  return "";
}

static const char *fault_fields (const pw_kind *k, char *buffer, size_t size) {
  int bodies = 0, signals = 0;
  if (k->fields == NULL) return "no table of fields";
  for (const pw_field *f = k->fields; f->name; f++) {
    const char *fault = fault_field (k, f);
    if (*fault) {
      snprintf (buffer, size, "field %s: %s", f->name, fault);
      return buffer;
    }
    if (f->type == PW_BODY) bodies += pw_field_count (f);
    if (f->type == PW_SIGNAL) signals += pw_field_count (f);
  }
  if (k->each_body && (bodies > 0 || k->bodies != 1))
    return "an element type that acts on each body has one body and no body fields";
  if (!k->each_body && bodies != k->bodies) return "bodies is not the number of fields of type PW_BODY";
  if (signals != k->signals) return "signals is not the number of fields of type PW_SIGNAL";
  return "";
}

static const char *fault_functions (const pw_kind *k) {
  pw_batch_function *const exact[] = { k->g,       k->g_size, k->eta,   k->J,    k->gamma,   k->force,
                                       k->force_u, k->energy, k->power, k->loss, k->contact, k->saturation };
  for (size_t i = 0; i < sizeof exact / sizeof *exact; i++)
    if (exact[i] == pw_by_differences) return "PW_BY_DIFFERENCES is permitted only for second-order blocks";
  if (k->constant && (k->force == NULL || k->signals > 0))
    return "declared constant, but it has no force, or has signals";
  if (k->rows > 0 && k->J == NULL) return "constraint equations without J";
  if (k->level == PW_HOLONOMIC && k->g == NULL) return "holonomic constraint equations without g";
  if (k->level != PW_HOLONOMIC && k->g) return "g, but no holonomic constraint equations";
  return "";
}

static int fault_is_long (const char *name) {
  return strlen (name) > PW_NAME_MAX;
}

static const char *fault_names (const pw_kind *k) {
  for (int i = 0; i < k->rows; i++)
    if (k->reaction == NULL || k->reaction[i].name == NULL || k->reaction[i].unit == NULL)
      return "constraint equations without names of their reactions";
    else if (fault_is_long (k->reaction[i].name))
      return "a reaction's name of more than 50 bytes";
  for (int i = 0; i < k->internal; i++)
    if (k->coordinate == NULL || k->coordinate[i].name == NULL || k->coordinate[i].rate == NULL ||
        k->coordinate[i].unit == NULL)
      return "internal coordinates without names";
    else if (fault_is_long (k->coordinate[i].name) || fault_is_long (k->coordinate[i].rate))
      return "an internal coordinate's name of more than 50 bytes";
  return "";
}

const char *pw_kind_check (const pw_kind *k, char *buffer, size_t size) {
  if (k->name == NULL || *k->name == 0) return "no name";
  if (fault_is_long (k->name)) return "a name of more than 50 bytes";
  if (k->definition < sizeof (char *)) return "the definition has no room for its name";
  if (k->bodies < 0 || k->bodies > PW_MAX_BODIES || k->internal < 0 || k->internal > PW_MAX_INTERNAL || k->rows < 0 ||
      k->rows > PW_MAX_ROWS || k->signals < 0 || k->signals > PW_MAX_SIGNALS) {
    snprintf (buffer, size, "at most %d bodies, %d internal coordinates, %d constraint equations and %d signals",
              PW_MAX_BODIES, PW_MAX_INTERNAL, PW_MAX_ROWS, PW_MAX_SIGNALS);
    return buffer;
  }
  if (k->bodies + k->internal == 0) return "neither a body nor an internal coordinate";
  if (k->level < PW_FORCE || k->level > PW_NONHOLONOMIC || (k->rows > 0) != (k->level != PW_FORCE))
    return "rows and level are inconsistent";
  if ((k->internal > 0 || k->element > 0) && k->prepare == NULL)
    return "an element or internal coordinates, but no prepare function";
  const char *fault = fault_names (k);
  if (*fault == 0) fault = fault_fields (k, buffer, size);
  return *fault ? fault : fault_functions (k);
}
