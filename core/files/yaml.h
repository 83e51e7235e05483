/* Text models: interface between the files that read them.
 *
 *   yaml_text.c  reads and checks the text; messages with line, column and caret; the tree as bytes
 *   yaml_tree.c  builds a tree of scalars, lists and maps from libfyaml's events
 *   yaml.c       reads a model from the tree (yaml_read.h) */
#ifndef PW_YAML_H
#define PW_YAML_H

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
  const pw_node *bodies, *elements, *states, *let, *reference, *outputs, *paths; /* or NULL */
  int parameter_count;                                                           /* of table.parameters */
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
