/* Text models: interface between the files of this folder, each of which uses those above it.
 *
 *   yaml_read.c      reads and checks the text; messages with line, column and caret
 *   yaml_tree.c        builds a tree of scalars, lists and maps from libfyaml's events
 *   yaml_read.c      the tree as bytes
 *   yaml_read.c        keys, numbers and names from the tree
 *   yaml_expression.c  signals that are expressions of time and states; the reference solution
 *   yaml_expression.c      other signals, points of tables
 *   yaml.c       bodies and elements, through the field tables of their types
 *   yaml.c             the head of a model: parameters and default run settings, stored in a plug-in's table
 *
 * After an error, functions with the same reader return an error status, and only the first error is recorded: a
 * sequence of calls needs one check.  `label` ("torque T: value") begins their messages.  A NULL node is absent. */
#ifndef PW_YAML_H
#define PW_YAML_H

#include "expression.h"
#include "files.h"

typedef enum { PW_YAML_SCALAR, PW_YAML_LIST, PW_YAML_MAP } pw_yaml_type;

/* A scalar, a list of nodes, or a map, whose nodes alternate between keys and values. */
typedef struct pw_node {
  struct pw_node *next; /* in the same list or map */
  union {
    const char *text;      /* of a scalar */
    struct pw_node *first; /* of a list or map */
  };
  unsigned at;          /* offset in the source, of the opening quote or bracket if there is one */
  int count;            /* entries of a list, pairs of a map */
  unsigned char type;   /* pw_yaml_type */
  unsigned char quoted; /* 1: in quotes, or a block after | or > */
} pw_node;

struct pw_yaml {
  pw_plugin_table table; /* first: the address of a text model's table is that of its pw_yaml */
  char *path;            /* as shown in messages */
  char *folder;          /* of the file, links resolved */
  char *source;          /* the text, zero-terminated */
  size_t size;
  double max_ahead; /* indicators ([ ] { } , :) that libfyaml may read ahead of an event (yaml_tree.c) */
  pw_arena arena;   /* nodes and texts */
  const pw_node *root;
  const pw_node *bodies, *elements, *let, *reference; /* or NULL */
  int parameter_count;                                /* of table.parameters */
};

/* What functions share while a file is read or a model is built from it. */
typedef struct {
  const pw_yaml *y;
  pw_error *error;
  pw_scope *scope; /* parameters and what `let` defines so far, or NULL */
  /* for building */
  pw_model *model;
  pw_arena *arena;              /* lives as long as the model */
  pw_reference_text *reference; /* the model's */
  pw_names bodies;              /* names of bodies so far */
  pw_names names;               /* of bodies and elements so far, to their offsets in the source */
  pw_names elements;     /* names of all elements, to the index of their types; made when an expression needs it */
  const pw_field *field; /* being read */
  char *definition;      /* of the element being read, with all preceding fields */
  double points;         /* of all tables so far */
  double operations;     /* of all expressions so far */
} pw_reader;

enum { PW_YAML_DEPTH = 30 }; /* most lists and maps inside each other */
/* Limits of one model, about 1 GB each, so that a small file cannot use all memory: entries of each list, such as
 * bodies, elements, parameters; points of all tables; operations of all expressions. */
enum { PW_YAML_MAX_ITEMS = 1000000, PW_YAML_MAX_POINTS = 20000000, PW_YAML_MAX_OPERATIONS = 30000000 };

/* ---- The text (yaml_read.c) ---- */

/* Reads a file of at most `max_bytes` bytes into y->source and y->size, and checks its characters. */
int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error);

/* Fails with "PATH:LINE:COLUMN: error: TEXT", the line of the source at an offset, and a caret below. */
int pw_yaml_fail (const pw_reader *r, size_t at, const char *format, ...) PW_PRINTF (3, 4);

int pw_yaml_no_memory (const pw_reader *r);

/* The line of an offset, from 1. */
int pw_yaml_line (const pw_yaml *y, size_t at);

/* ---- The tree (yaml_tree.c) ---- */

int pw_yaml_read_tree (pw_yaml *y, pw_error *error);

/* Loads what pw_yaml_write_tree wrote (yaml_read.c).  PW_INPUT if it is incomplete; PW_RESOURCE. */
int pw_yaml_load_tree (pw_yaml *y, const char *bytes, size_t size, pw_error *error);

/* ---- Reading the tree (yaml_read.c) ---- */

enum { PW_YAML_MAX_KEYS = 40 }; /* most known keys of a map */

/* Finds known keys (ending with NULL) in a map, or in the pairs from a node on: value[i] becomes the value of key[i],
 * or NULL.  Other keys, repeated keys and empty values are refused; `owner` ("a body") is for messages. */
int pw_yaml_keys (const pw_reader *r, const pw_node *map, const char *const *key, const char *owner,
                  const pw_node **value);
int pw_yaml_keys_from (const pw_reader *r, const pw_node *first, const char *const *key, const char *owner,
                       const pw_node **value);

/* What a node is, for messages: "a list", "a map", "text". */
const char *pw_yaml_found (const pw_node *node);

/* Refuses anything but a list, or a list of `count` entries, which are `items` ("bodies"). */
int pw_yaml_list (const pw_reader *r, const pw_node *node, const char *label);
int pw_yaml_list_of (const pw_reader *r, const pw_node *node, const char *label, int count, const char *items);

/* A scalar's text, not empty. */
int pw_yaml_text (const pw_reader *r, const pw_node *node, const char *label, const char **text);

/* Read a number of a domain: an expression of the names in r->scope; two numbers: a list of `items`, "numbers, [x, y]";
 * one of `choices`, which end with NULL, as its index. */
int pw_yaml_number (const pw_reader *r, const pw_node *node, const char *label, pw_domain domain, double *value);
int pw_yaml_pair (const pw_reader *r, const pw_node *node, const char *label, const char *items, double *value);
int pw_yaml_choice (const pw_reader *r, const pw_node *node, const char *label, const char *const *choices, int *value);

/* The first name of the time t or of a state, BODY.phi, in an expression, or NULL. */
const char *pw_yaml_find_variable (const char *text);

/* Converts an offset in a scalar's text to one in the source; that of the node if the source spells it otherwise. */
size_t pw_yaml_offset (const pw_yaml *y, const pw_node *node, size_t offset);

/* Adds the names of all bodies so far to the valid names of a suggestion. */
void pw_yaml_suggest_bodies (const pw_reader *r, pw_nearest *near);

/* ---- Building ---- */

/* Makes a signal from expressions of time and, in forces, of states: value; rate and acceleration, or NULL
 * (yaml_expression.c). */
int pw_yaml_time_signal (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *const v[3],
                         pw_signal *signal);

/* Reads a signal of an element type into a field (yaml_expression.c). */
int pw_yaml_signal (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node, pw_signal *signal);

/* Reads the reference solution, after bodies and elements (yaml_expression.c). */
int pw_yaml_reference (pw_reader *r);

/* The build function; the parameters are an array of numbers in the order of y->parameter (yaml.c). */
void pw_yaml_build (pw_model *m, const void *parameters);

#endif
