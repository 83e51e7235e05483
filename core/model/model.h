/* The description from inside: what pw_compile reads. */
#ifndef PW_MODEL_H
#define PW_MODEL_H

#include "util.h"

/* The most an element may have; plug-in kinds are checked against it. */
enum {
  PW_MAX_BODIES = 4,
  PW_MAX_OWN = 4,
  PW_MAX_ROWS = 6,
  PW_MAX_SIGNALS = 4,
  PW_MAX_COLS = 3 * PW_MAX_BODIES + PW_MAX_OWN
};

typedef struct {
  const pw_kind *kind;
  void *definition; /* a copy; kind->definition bytes, the first member its name */
} pw_element;

typedef struct {
  const char *state;
  double value;
} pw_given;

/* What a text model knows about its motion: expressions of the time for some states; and the values of the names in these
 * and in signals. */
typedef struct {
  int states;                 /* 0: nothing */
  const char **state, **text; /* states: "bob.phi", and its expression */
  int names;
  const char **name;                               /* names */
  double *value;                                   /* names */
  double (*eval) (void *context, int i, double t); /* the value of expression i */
  void *context;
} pw_truth_text;

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
  pw_truth_text truth;
  int built;
  pw_error error; /* the first one */
};

/* The most bytes in a name: "KIND ELEMENT" and "ELEMENT.REACTION" are to fit the 120 of a buffer. */
enum { PW_NAME_MOST = 50 };

static inline const char *pw_element_name (const pw_element *e) {
  return *(const char *const *)e->definition;
}

/* Checks every body and element against its field table: names, numbers, bodies' names, signals. */
int pw_check_model (const pw_model *m, const pw_names *bodies, pw_error *error);
int pw_check_body (const pw_model *m, const pw_body *b, pw_error *error);
int pw_check_element (const pw_model *m, const pw_element *e, const pw_names *bodies, pw_error *error);

/* The k-th field of a type in a kind, counting each of its `count`; address inside the definition. */
void *pw_field_at (const pw_kind *kind, const void *definition, pw_field_type type, int k);

/* Whether it takes part in the motion; a marker does not. */
static inline int pw_kind_acts (const pw_kind *kind) {
  return kind->rows > 0 || kind->own > 0 || kind->force != NULL;
}

/* "" if the table of a kind holds together, else what is wrong with it, perhaps in the buffer.  Anything else may crash on
 * one that does not. */
const char *pw_kind_fault (const pw_kind *kind, char *buffer, size_t size);

/* Bytes of one value of a field; 0: there is no such type. */
size_t pw_field_bytes (pw_field_type type);

/* How many a field stands for. */
static inline int pw_field_count (const pw_field *f) {
  return f->count > 0 ? f->count : 1;
}

#endif
