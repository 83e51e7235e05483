/* Text models: interface between the files that read them.
 *
 *   yaml_text.c    reads and checks the text; messages with line, column and caret; hints; the tree as bytes
 *   yaml_tree.c    builds a tree of scalars, lists and maps from libfyaml's events
 *   yaml_expand.c  copies of repeated entries; included files
 *   yaml_unit.c    units of parameters
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
  int count;             /* entries of a list, pairs of a map; of a scalar 0, or its number in a copy (pw_copies) */
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

/* What changes in expressions that are kept as text. */
typedef struct {
  const pw_copies *copies; /* or NULL; its counter becomes a number */
  const char *prefix;      /* of the states of an included file, or ""; its other names become numbers */
  const pw_names *states;  /* all first-order states */
  const pw_names *outputs; /* all outputs */
  const pw_scope *scope;   /* the other names */
} pw_renames;
/* NULL if out of memory. */
const char *pw_yaml_renamed (const pw_renames *names, const char *text, pw_arena *arena);

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

/* A frame in the plane. */
typedef struct {
  double at[2], phi; /* [m], [rad] */
  double cos, sin;
} pw_place;

/* The frame at (x, y) and phi in that around it; NULL: in the world. */
pw_place pw_place_in (const pw_place *around, const double at[2], double phi);
/* Turns a vector from the frame to the world (sign 1), or back (-1). */
void pw_place_turn (const pw_place *p, int sign, double v[2]);
/* The point in the world of a point in the frame; and back. */
void pw_place_point (const pw_place *p, double v[2]);
void pw_place_back (const pw_place *p, double v[2]);

/* Moves the initial state of a body from a frame, or NULL, to the world.  Returns "", or the pair of which only one
 * value is specified, so that it cannot be turned. */
const char *pw_place_body (const pw_place *p, pw_body *body);
/* Makes a body a uniform bar between two points. */
void pw_place_bar (pw_body *body, const double from[2], const double to[2]);
/* The name of body i of an element, or NULL. */
const char *pw_place_body_of (const pw_kind *kind, const char *definition, int i);
/* A field that may be a direction in the ground, which a frame, or NULL, turns; or NULL. */
const char *pw_place_direction (const pw_place *p, const pw_kind *kind, const char *definition);

/* The first unit that is no SI unit in a text, and its place; NULL: there is none. */
const pw_unit_name *pw_yaml_other_unit (const char *unit, const char **at);

/* Refuses the unit of a parameter, a scalar, if it contains another unit than an SI unit, and says how to convert the
 * value. */
int pw_yaml_check_unit (const pw_yaml *y, const pw_node *unit, const pw_node *value, pw_error *error);

/* ---- yaml_text.c and yaml_tree.c ---- */

/* A hint for a key, which is none of these, that end with NULL, nor like one; or "". */
const char *pw_yaml_key_hint (const char *text, const char *const *key);
/* The element type whose name is near, or in whose description a word begins with the text. */
pw_nearest pw_yaml_nearest_kind (const char *text);

/* Reads a file of at most `max_bytes` bytes into y->source and y->size. */
int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error);

/* Fails with "PATH:LINE:COLUMN: error: TEXT", the line of the source at an offset, and a caret below. */
int pw_yaml_fail (const pw_yaml *y, pw_error *error, size_t at, const char *format, ...) PW_PRINTF (4, 5);
int pw_yaml_no_memory (const pw_yaml *y, pw_error *error);

/* The beginning of the file that contains an offset, and its path from the folder of the model; "" for the model. */
const char *pw_yaml_part (const pw_yaml *y, size_t at, char path[PW_PATH]);

/* The line of an offset, from 1. */
int pw_yaml_line (const pw_yaml *y, size_t at);

/* Checks the characters of the source from y->begin on. */
int pw_yaml_check_source (const pw_yaml *y, pw_error *error);

/* Checks the source from y->begin on, and stores its tree. */
int pw_yaml_read_tree (pw_yaml *y, pw_error *error);

/* Writes the tree as bytes, for programs without libfyaml; loads it.  PW_INPUT if it is incomplete; PW_RESOURCE. */
void pw_yaml_write_tree (const pw_yaml *y, FILE *f);
int pw_yaml_load_tree (pw_yaml *y, char *bytes, size_t size, pw_error *error);

#endif
