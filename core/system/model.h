/* A model: what a build function adds and pw_system_compile reads. */
#ifndef PW_MODEL_H
#define PW_MODEL_H

#include "util.h"

/* Limits of an element, also for types from plug-ins; `rows` are constraint equations, `cols` local coordinates. */
enum {
  PW_MAX_BODIES = 4,
  PW_MAX_INTERNAL = 4,
  PW_MAX_ROWS = 6,
  PW_MAX_SIGNALS = 4,
  PW_MAX_COLS = 3 * PW_MAX_BODIES + PW_MAX_INTERNAL
};

/* A value set by pw_model_set_initial. */
typedef struct {
  const char *state; /* "frame.vx" */
  double value;
} pw_initial_setting;

struct pw_model {
  const char *name;
  const pw_plugin_table *table;
  char *parameters; /* table->parameters_size bytes */
  pw_arena arena;   /* strings and definitions */
  pw_body *body;
  int bodies;
  pw_element *element;
  int elements;
  pw_named_output *output;
  int outputs;
  pw_initial_setting *initial;
  int initials;
  size_t body_room, element_room, output_room, initial_room; /* entries allocated */
  const pw_reference_text *reference;
  struct pw_kept *kept; /* objects of pw_model_keep */
  int built;            /* 1: pw_model_build has been called */
  pw_error error;       /* the first error */
};

enum { PW_NAME_MAX = 50 }; /* bytes of the longest name of a body, element, field, ... */
_Static_assert(PW_NAME_BYTES >= 3 * PW_NAME_MAX + 10, "room for \"KIND ELEMENT: FIELD[3]\"");

/* Checks every body, element and output: names, numbers, signals, and whether the table has the bodies of elements:
 * numbers below m->bodies. */
int pw_check_model (const pw_model *m, const pw_names *names, pw_error *error);

/* Returns what is wrong with an element type's table (in the buffer, or a constant), or "".  No other function may be
 * called with a table that has not passed. */
const char *pw_kind_check (const pw_kind *kind, char *buffer, size_t size);

/* 1 for the library's own element types, 0 for those of plug-ins. */
int pw_kind_is_built_in (const pw_kind *kind);

/* The name of value i of a field, "torque", or "u[1]" if the field has several; writes it to the buffer. */
char *pw_field_value_name (const pw_field *f, int i, char *buffer, size_t size);

/* As pw_field_at, for a definition that will be modified. */
static inline void *pw_field_mutable (const pw_kind *kind, void *definition, pw_field_type type, int index) {
  const char *at = pw_field_at (kind, definition, type, index);
  return at ? (char *)definition + (at - (const char *)definition) : NULL;
}

#endif
