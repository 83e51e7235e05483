/* The description from inside: what pw_system_compile reads. */
#ifndef PW_MODEL_H
#define PW_MODEL_H

#include "util.h"

/* The most an element may have; plug-in kinds are checked against it. */
enum {
  PW_MAX_BODIES = 4,
  PW_MAX_INTERNAL = 4,
  PW_MAX_ROWS = 6,
  PW_MAX_SIGNALS = 4,
  PW_MAX_COLS = 3 * PW_MAX_BODIES + PW_MAX_INTERNAL
};

typedef struct {
  const char *state;
  double value;
} pw_given;

struct pw_model {
  const char *name;
  const pw_plugin_table *table;
  char *parameters; /* table->parameters_size bytes */
  pw_arena arena;   /* strings and definitions */
  pw_body *body;
  int bodies, body_room;
  pw_element *element;
  int elements, element_room;
  pw_given *given;
  int givens, given_room;
  const pw_reference_text *reference;
  struct pw_kept *kept; /* released with the model */
  int built;
  pw_error error; /* the first one */
};

/* The most bytes in a name: "KIND ELEMENT" and "ELEMENT.REACTION" are to fit the 120 of a buffer. */
enum { PW_NAME_MOST = 50 };

/* Checks every body and element against its field table: names, numbers, bodies' names, signals. */
int pw_check_model (const pw_model *m, const pw_names *bodies, pw_error *error);

/* "" if the table of an element type is consistent, else its fault, perhaps in the buffer.  Other functions may crash on an
 * inconsistent table. */
const char *pw_kind_check (const pw_kind *kind, char *buffer, size_t size);

/* pw_field_at of a definition that is to be modified. */
static inline void *pw_field_in (const pw_kind *kind, void *definition, pw_field_type type, int k) {
  const char *at = pw_field_at (kind, definition, type, k);
  return at ? (char *)definition + (at - (const char *)definition) : NULL;
}

#endif
