/* Element types: the list of built-in ones, the fields of a definition, and checks of a type's table.  A table is
 * checked before use, so that a mistake in a plug-in is reported instead of crashing the program. */
#include <limits.h>
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
  static const size_t bytes[] = {
    [PW_NUMBER] = sizeof (double), [PW_POINT] = sizeof (double[2]),  [PW_VECTOR] = sizeof (double[2]),
    [PW_BODY] = sizeof (char *),   [PW_SIGNAL] = sizeof (pw_signal), [PW_CHOICE] = sizeof (int)
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
  if (pw_field_count (f) > 1)
    snprintf (buffer, size, "%s[%d]", f->name, i);
  else
    snprintf (buffer, size, "%s", f->name);
  return buffer;
}

_Static_assert(PW_NAME_MAX == 50, "as in FAULT_TEXT");
#define FAULT_TEXT ": expected at most 50 bytes of UTF-8 without control characters"

/* 1 if a name or unit is too long or not one line: it would spoil tables and files. */
static int is_bad_text (const char *text) {
  return strlen (text) > PW_NAME_MAX || !pw_is_line (text);
}

/* The fault of one field, or "". */
static const char *fault_field (const pw_kind *kind, const pw_field *f) {
  size_t bytes = pw_field_bytes (f->type) * (size_t)pw_field_count (f);
  if (is_bad_text (f->name) || (f->unit && is_bad_text (f->unit))) return "name or unit" FAULT_TEXT;
  if (bytes == 0) return "its type does not exist";
  if ((size_t)f->domain > PW_FRACTION) return "its domain does not exist";
  if (f->offset < sizeof (char *) || bytes > kind->definition || f->offset > kind->definition - bytes)
    return "outside the definition, whose first member is its name and whose sizeof is .definition";
  if (f->type == PW_CHOICE && (f->choices == NULL || f->choices[0] == NULL)) return "a choice without choices";
  return "";
}

/* The fault of the fields, or ""; the text may be in the buffer. */
static const char *fault_fields (const pw_kind *kind, char *buffer, size_t size) {
  int bodies = 0, signals = 0;
  if (kind->fields == NULL) return "no table of fields";
  for (const pw_field *f = kind->fields; f->name; f++) {
    const char *fault = fault_field (kind, f);
    if (*fault) return snprintf (buffer, size, "field %.50s: %s", f->name, fault), buffer;
    if (f->type == PW_BODY) bodies += pw_field_count (f);
    if (f->type == PW_SIGNAL) signals += pw_field_count (f);
  }
  if (kind->each_body && (bodies > 0 || kind->bodies != 1))
    return "an element type that acts on each body has one body and no body fields";
  if (!kind->each_body && bodies != kind->bodies) return "bodies is not the sum of the counts of PW_BODY fields";
  if (signals != kind->signals) return "signals is not the sum of the counts of PW_SIGNAL fields";
  return "";
}

static const char *fault_functions (const pw_kind *kind) {
  pw_batch_function *const exact[] = { kind->g,     kind->g_size, kind->eta,     kind->J,
                                       kind->gamma, kind->force,  kind->force_u, kind->energy,
                                       kind->power, kind->loss,   kind->contact, kind->saturation };
  for (size_t i = 0; i < sizeof exact / sizeof *exact; i++)
    if (exact[i] == PW_BY_DIFFERENCES) return "PW_BY_DIFFERENCES is permitted only for second-order blocks";
  if (kind->constant && (kind->force == NULL || kind->signals > 0))
    return "declared constant, but it has no force, or has signals";
  if (kind->signals > 0 && kind->rows == 0 && kind->force && kind->force_u == NULL)
    return "a force with signals, but no force_u";
  if (kind->force == NULL && kind->force_u) return "force_u, but no force";
  if (kind->rows > 0 && kind->J == NULL) return "constraint equations without J";
  if (kind->level == PW_HOLONOMIC && kind->g == NULL) return "holonomic constraint equations without g";
  if (kind->level != PW_HOLONOMIC && kind->g) return "g, but no holonomic constraint equations";
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
    if (strcmp (q->unit, "rad") != 0) return "an internal coordinate whose unit is not rad";
    name[names++] = q->name, name[names++] = q->rate;
  }
  for (int i = 0; i < names; i++)
    for (int n = 0; n < i; n++)
      if (strcmp (name[i], name[n]) == 0) return "two reactions or internal coordinates of the same name";
  return "";
}

const char *pw_kind_check (const pw_kind *kind, char *buffer, size_t size) {
  if (kind->name == NULL || *kind->name == 0) return "no name";
  if (is_bad_text (kind->name)) return "its name" FAULT_TEXT;
  if (kind->definition < sizeof (char *)) return "the definition has no room for its name";
  if (kind->bodies < 0 || kind->bodies > PW_MAX_BODIES || kind->internal < 0 || kind->internal > PW_MAX_INTERNAL ||
      kind->rows < 0 || kind->rows > PW_MAX_ROWS || kind->signals < 0 || kind->signals > PW_MAX_SIGNALS) {
    snprintf (buffer, size, "at most %d bodies, %d internal coordinates, %d constraint equations and %d signals",
              PW_MAX_BODIES, PW_MAX_INTERNAL, PW_MAX_ROWS, PW_MAX_SIGNALS);
    return buffer;
  }
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
