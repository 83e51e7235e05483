/* Text models: interface between the files that read them.
 *
 *   yaml_text.c    reads a text; messages with line, column and caret; units of parameters; the tree as bytes
 *   yaml_tree.c    builds a tree of scalars, lists and maps from libfyaml's events
 *   yaml_include.c reads a model and the files that it includes
 *   yaml_read.c, yaml_signal.c, yaml.c read a model from the tree (yaml_read.h) */
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
  unsigned at;           /* offset in the source, of the opening quote or bracket if there is one */
  int count;             /* entries of a list, pairs of a map */
  unsigned char type;    /* pw_yaml_type */
  unsigned char quoted;  /* 1: in quotes, or a block after | or > */
  unsigned char is_file; /* 1: the map of an included file, in place of its name */
} pw_node;

/* A text model in memory, with a plug-in's table.  Bodies and elements are read when a model is built. */
typedef struct {
  pw_plugin_table table; /* first: the address of a text model's table is that of its pw_yaml */
  char *path;            /* as shown in messages */
  char *folder;          /* of the file, links resolved */
  char *source;          /* the text and those of included files (pw_yaml_part), zero-terminated */
  size_t size;
  size_t begin;     /* of the file that is being read */
  int files;        /* included so far */
  double max_ahead; /* indicators ([ ] { } , :) that libfyaml may read ahead of an event (yaml_tree.c) */
  pw_arena arena;   /* nodes and texts */
  const pw_node *root;
  const pw_node *bodies, *elements, *states, *let, *reference, *include, *outputs, *paths; /* or NULL */
  int parameter_count;                                                                     /* of table.parameters */
} pw_yaml;

enum { PW_YAML_DEPTH = 30 /* most lists and maps inside each other */, PW_YAML_FILES = 8 /* most files */ };

/* `path`: absolute, links resolved; `shown`: the path in messages.  `error` is not NULL: PW_INPUT with the position;
 * PW_RESOURCE. */
pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error);
void pw_yaml_close (pw_yaml *y);

/* ---- yaml_include.c ---- */

/* Reads a model and the files in its lists `include`, whose maps replace their names; arguments as in pw_yaml_open. */
int pw_yaml_read_files (pw_yaml *y, const char *path, const char *shown, size_t max_bytes, pw_error *error);
/* See pw_file_included_parameter; root: of a file. */
const char *pw_yaml_included_parameter (const pw_node *root, const char *name);
/* Stores the path of a file that is named at an offset, links resolved; 0, and the reason (errno if it cannot be
 * resolved), unless it is in the folder of the model.  from_model receives its path from there. */
int pw_yaml_find (const pw_yaml *y, size_t at, const char *name, char path[PW_PATH], char from_model[PW_PATH],
                  const char **reason);
/* Calls `each` with the path of each table of the model, once for each place that names it, and of each included file,
 * until it returns non-zero; returns that, or 0. */
typedef int pw_yaml_each (void *context, const char *path);
int pw_yaml_tables (const pw_yaml *y, int with_included, pw_yaml_each *each, void *context);

/* ---- yaml_text.c and yaml_tree.c ---- */

/* Reads a file of at most `max_bytes` bytes into y->source and y->size. */
int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error);
/* Fails with "PATH:LINE:COLUMN: error: TEXT", the line of the source at an offset, and a caret below. */
int pw_yaml_fail (const pw_yaml *y, pw_error *error, size_t at, const char *format, ...) PW_PRINTF (4, 5);
int pw_yaml_no_memory (const pw_yaml *y, pw_error *error);
/* The beginning of the file that contains an offset, and its path from the folder of the model; "" for the model. */
const char *pw_yaml_part (const pw_yaml *y, size_t at, char path[PW_PATH]);
/* The line of an offset, from 1. */
int pw_yaml_line (const pw_yaml *y, size_t at);
/* The first unit that is no SI unit in a text, and its place; NULL: there is none. */
const pw_unit_name *pw_yaml_other_unit (const char *unit, const char **at);
/* Refuses the unit of a parameter, a scalar, if it contains one that is no SI unit, and says how to convert the
 * value. */
int pw_yaml_check_unit (const pw_yaml *y, const pw_node *unit, const pw_node *value, pw_error *error);
/* Checks the source from y->begin on, and stores its tree. */
int pw_yaml_read_tree (pw_yaml *y, pw_error *error);
/* Writes the tree as bytes, for programs without libfyaml; loads it.  PW_INPUT if it is incomplete; PW_RESOURCE. */
void pw_yaml_write_tree (const pw_yaml *y, FILE *f);
int pw_yaml_load_tree (pw_yaml *y, char *bytes, size_t size, pw_error *error);

#endif
