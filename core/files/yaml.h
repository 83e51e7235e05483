/* Text models: interface between the files that read them.
 *
 *   yaml_text.c  reads and checks the text; messages with line, column and caret; the tree as bytes
 *   yaml_tree.c  builds a tree of scalars, lists and maps from libfyaml's events
 *   yaml_parts.c copies of entries; files that a model reads; places of included files
 *   yaml.c       reads a model from the tree */
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

/* A text model in memory, or a file that it includes, with a plug-in's table.  Bodies and elements are read when a model
 * is built. */
typedef struct pw_yaml {
  pw_plugin_table table; /* first: the address of a text model's table is that of its pw_yaml */
  char *path;            /* as shown in messages */
  char *file;            /* its path: the model's with links resolved, those of included files below its folder */
  char *folder;          /* of that path */
  char *source;          /* the text, zero-terminated */
  size_t size;
  double max_ahead; /* indicators ([ ] { } , :) that libfyaml may read ahead of an event (yaml_tree.c) */
  pw_arena arena;   /* nodes and texts */
  const pw_node *root;
  const pw_node *bodies, *elements, *include, *let, *reference; /* or NULL */
  int parameter_count;                                          /* of table.parameters */
  struct pw_yaml *model; /* the file that was opened; itself unless this one is included */
  struct pw_yaml *next;  /* the next included file, in any order; pw_yaml_close of the model closes all */
  size_t base;           /* bytes of the files before it */
  int height;            /* levels of files that it includes; -1 while these are opened */
} pw_yaml;

enum { PW_YAML_DEPTH = 30 }; /* most lists and maps inside each other */

/* `path`: absolute, links resolved; `shown`: the path in messages.  `error` is not NULL: PW_INPUT with the position;
 * PW_RESOURCE. */
pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error);
void pw_yaml_close (pw_yaml *y);

/* Calls `each` with the path of every table and included file, perhaps more than once, until it returns non-zero;
 * returns that, or 0. */
int pw_yaml_tables (const pw_yaml *y, int (*each) (void *context, const char *path), void *context);

/* ---- yaml_parts.c ---- */

/* Copies of an entry with the key `repeat`, for values of a counter, one at a time. */
typedef struct {
  const pw_scope *scope; /* given: names besides the counter in the numbers in braces */
  pw_arena *arena;       /* given */
  const char *counter;   /* given: its name */
  const pw_node *repeat; /* given: the key */
  pw_node *entry;        /* the copy, without the key */
  struct pw_copy_text *text;
  int scalars;                  /* texts without braces, numbered from 1 */
  const pw_expression **number; /* scalars + 1: those read as numbers so far */
  double bytes;               /* of the texts of all copies so far */
  const pw_node *faulty;      /* after PW_INPUT: the text, and the error in it */
  pw_expression_error fault;
} pw_copies;

/* The key `repeat` of an entry, or NULL. */
const pw_node *pw_copies_repeat (const pw_node *entry);
int pw_copies_open (pw_copies *c, const pw_node *entry);
/* Makes c->entry the copy for this value.  Its texts stay in the arena. */
int pw_copies_set (pw_copies *c, double i);

/* Stores the value of a text of the copy that is a number; 0 if it cannot be read. */
int pw_copies_number (pw_copies *c, const pw_node *node, double i, double *value);

/* The path of a file, given its name in y. */
char *pw_yaml_path (const pw_yaml *y, const char *name, char path[PW_PATH]);
/* Stores the same with links resolved.  0, and the reason (errno if it cannot be resolved): it is not in the folder of
 * the model, in which all files are that it reads. */
int pw_yaml_find (const pw_yaml *y, const char *name, char path[PW_PATH], const char **reason);
/* The included file of this name in y, if it has been opened, or NULL. */
pw_yaml *pw_yaml_included (const pw_yaml *y, const char *name);

/* A frame in the plane. */
typedef struct {
  double at[2], phi; /* [m], [rad] */
  double cos, sin;
} pw_place;

/* The frame at (x, y) and phi in that around it; NULL: in the world. */
pw_place pw_place_in (const pw_place *around, double x, double y, double phi);
/* Turns a vector from the frame to the world (sign 1), or back (-1). */
void pw_place_turn (const pw_place *p, int sign, double v[2]);
/* The point in the world of a point in the frame; and back. */
void pw_place_point (const pw_place *p, double v[2]);
void pw_place_back (const pw_place *p, double v[2]);

/* Reads a file of at most `max_bytes` bytes into y->source and y->size, and checks its characters. */
int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error);

/* Fails with "PATH:LINE:COLUMN: error: TEXT", the line of the source at an offset, and a caret below. */
int pw_yaml_fail (const pw_yaml *y, pw_error *error, size_t at, const char *format, ...) PW_PRINTF (4, 5);
/* Adds " (TEXT)" to the first line of such an error. */
void pw_yaml_where (pw_error *error, const char *format, ...) PW_PRINTF (2, 3);
int pw_yaml_no_memory (const pw_yaml *y, pw_error *error);

/* The line of an offset, from 1. */
int pw_yaml_line (const pw_yaml *y, size_t at);

/* Stores the tree of the source. */
int pw_yaml_read_tree (pw_yaml *y, pw_error *error);

/* Writes the tree as bytes, for programs without libfyaml; loads it.  PW_INPUT if it is incomplete; PW_RESOURCE. */
void pw_yaml_write_tree (const pw_yaml *y, FILE *f);
int pw_yaml_load_tree (pw_yaml *y, char *bytes, size_t size, pw_error *error);

#endif
