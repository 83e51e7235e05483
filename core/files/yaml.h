/* Text models: interface between the files that read them.
 *
 *   yaml_text.c    reads and checks the text; messages with line, column and caret; the tree as bytes
 *   yaml_tree.c    builds a tree of scalars, lists and maps from libfyaml's events
 *   yaml_expand.c  copies of repeated entries
 *   yaml_unit.c    units of parameters
 *   yaml.c         reads a model from the tree */
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
  int count;            /* entries of a list, pairs of a map; of a scalar 0, or its number in a copy (pw_copies) */
  unsigned char type;   /* pw_yaml_type */
  unsigned char quoted; /* 1: in quotes, or a block after | or > */
} pw_node;

/* A text model in memory, with a plug-in's table.  Bodies and elements are read when a model is built. */
typedef struct {
  pw_plugin_table table; /* first: the address of a text model's table is that of its pw_yaml */
  char *path;            /* as shown in messages */
  char *folder;          /* of the file, links resolved */
  char *source;          /* the text, zero-terminated */
  size_t size;
  double max_ahead; /* indicators ([ ] { } , :) that libfyaml may read ahead of an event (yaml_tree.c) */
  pw_arena arena;   /* nodes and texts */
  const pw_node *root;
  const pw_node *bodies, *elements, *states, *let, *reference; /* or NULL */
  int parameter_count;                                         /* of table.parameters */
} pw_yaml;

enum { PW_YAML_DEPTH = 30 }; /* most lists and maps inside each other */

/* `path`: absolute, links resolved; `shown`: the path in messages.  `error` is not NULL: PW_INPUT with the position;
 * PW_RESOURCE. */
pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error);
void pw_yaml_close (pw_yaml *y);

/* Calls `each` with the path of every file named below a node, which may be NULL, until it returns non-zero; returns
 * that, or 0. */
int pw_yaml_tables (const pw_yaml *y, const pw_node *node, int (*each) (void *context, const char *path),
                    void *context);

/* ---- yaml_expand.c ---- */

/* Copies of an entry with the key `repeat`, for one value of a counter after another. */
typedef struct {
  const pw_scope *scope; /* given: names besides the counter in numbers */
  pw_arena *arena;       /* given */
  const pw_node *repeat; /* given: the key */
  const char *counter;   /* given: its name */
  int i;                 /* its value */
  pw_node *entry;        /* the copy, without the key */
  struct pw_copy_text *text;
  int scalars;                  /* texts without braces, numbered from 1 */
  const pw_expression **number; /* scalars + 1: those read as numbers so far */
  double bytes;                 /* of the texts of all copies so far */
  const pw_node *faulty;        /* after PW_INPUT: the text, and the error in it */
  pw_expression_error fault;
} pw_copies;

/* The key `repeat` of an entry, or NULL. */
const pw_node *pw_yaml_repeat (const pw_node *entry);
int pw_copies_open (pw_copies *c, const pw_node *entry);
/* Makes c->entry the copy for this value.  Its texts stay in the arena. */
int pw_copies_set (pw_copies *c, int i);

/* Stores the value of a text of the copy that is a number.  PW_INPUT, error; PW_RESOURCE. */
int pw_copies_number (pw_copies *c, const pw_node *node, double *value, pw_expression_error *error);

/* The text of an expression with the counter replaced by its value in parentheses; NULL if out of memory. */
const char *pw_copies_expression (const pw_copies *c, const char *text, pw_arena *arena);

/* Refuses the unit of a parameter, a scalar, if it contains another unit than an SI unit, and says how to convert the
 * value. */
int pw_yaml_check_unit (const pw_yaml *y, const pw_node *unit, const pw_node *value, pw_error *error);

/* ---- yaml_text.c and yaml_tree.c ---- */

/* Reads a file of at most `max_bytes` bytes into y->source and y->size, and checks its characters. */
int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error);

/* Fails with "PATH:LINE:COLUMN: error: TEXT", the line of the source at an offset, and a caret below. */
int pw_yaml_fail (const pw_yaml *y, pw_error *error, size_t at, const char *format, ...) PW_PRINTF (4, 5);
int pw_yaml_no_memory (const pw_yaml *y, pw_error *error);

/* The line of an offset, from 1. */
int pw_yaml_line (const pw_yaml *y, size_t at);

/* Stores the tree of the source. */
int pw_yaml_read_tree (pw_yaml *y, pw_error *error);

/* Writes the tree as bytes, for programs without libfyaml; loads it.  PW_INPUT if it is incomplete; PW_RESOURCE. */
void pw_yaml_write_tree (const pw_yaml *y, FILE *f);
int pw_yaml_load_tree (pw_yaml *y, char *bytes, size_t size, pw_error *error);

#endif
