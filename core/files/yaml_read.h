/* Text models: what the files that read a model from its tree share.
 *
 *   yaml_read.c    keys, lists with their copies, texts, numbers, names
 *   yaml_signal.c  signals, paths and outputs
 *   yaml.c         bodies, elements, states; the head; included files
 *
 * After an error, functions with the same reader return its status, and only the first error is recorded: a sequence of
 * calls needs one check.  `label` ("torque T: value") begins their messages.  A NULL node is absent. */
#ifndef PW_YAML_READ_H
#define PW_YAML_READ_H

#include <string.h>
#include "yaml.h"

/* Limits of one model, about 1 GB each, so that a small file cannot use all memory: entries of each list, such as
 * bodies, elements, parameters; points of all tables and paths; operations of all expressions; copies of an entry; all
 * entries, with copies and included files; bytes of texts in copies. */
enum { PW_MAX_ITEMS = 1000000, PW_MAX_POINTS = 20000000, PW_MAX_OPERATIONS = 30000000 };
enum { MAX_COPIES = 100000, PW_MAX_ENTRIES = 2000000 };
#define MAX_COPIED 4e8
enum { PW_MAX_KEYS = 40 /* known keys of a map, and the end of their list */ };

/* A signal or output that is an expression. */
typedef struct {
  const pw_expression *expression[3]; /* value, rate, acceleration; NULL: not given, differentiated instead */
  int derivatives;                    /* required time derivatives; of a force: 0, nonholonomic: 1, holonomic: 2 */
  int states;                         /* number of states in it */
  pw_jumps jumps;
  const char *jump; /* an operation that jumps, as pw_expression.jump */
  int is_output;    /* 1: conditions on time count, too, since steps end at the breakpoints of signals only */
  /* conditions on states: their number and, in the context of a workspace, the expression with and without them, and
   * their sides; expression[0] is one of the two */
  int conditions;
  const pw_expression *whole;
  pw_expression *fixed;
  double *side;
  const char *name[PW_OUTPUT_READS + 2]; /* "t" or "s", then states, "BODY.phi"; not for evaluation */
  pw_signal_text text;
} pw_signal_function;

/* An output.  In a signal its expression stands for it, so that derivatives and breakpoints are those of the signal. */
typedef struct pw_output_function {
  pw_signal_function function; /* its states are columns */
  pw_node node;                /* its value, with the names of the model */
  pw_named_output output;
  int reader; /* the output that is being read and reads this one, or itself if it is the first; PW_OUTPUT_... */
} pw_output_function;

enum { PW_OUTPUT_UNREAD = -1, PW_OUTPUT_READ = -2 };

/* What functions share while a file is read or a model is built from it. */
typedef struct {
  const pw_yaml *y;
  pw_error *error;
  pw_scope *scope;              /* parameters and what `let` defines so far, or NULL */
  struct pw_copies *copies;     /* of the entry being read, or NULL */
  const char *prefix;           /* of names in an included file, or "" */
  const struct pw_place *place; /* of the included file, or NULL */
  /* for building */
  pw_model *model;
  pw_arena *arena;              /* lives as long as the model */
  pw_reference_text *reference; /* the model's */
  pw_names bodies;              /* names of bodies so far, to their indices */
  pw_names states;              /* names of all first-order states */
  pw_names names;               /* of bodies and elements so far, to their offsets in the source */
  pw_names truth;               /* states in the reference solution so far */
  pw_names elements; /* of elements so far, or all of this file (pw_index_elements), to the index of their types */
  pw_names contacts; /* names of wheels and markers so far, to the index of their elements */
  struct pw_output_function **output; /* outputs so far */
  pw_names outputs;                   /* their names, to their indices */
  int output_count;
  int numbers; /* names of the scope that are numbers; those of paths follow */
  size_t output_room;
  const pw_kind *kind;   /* of the element being read */
  const pw_field *field; /* of it */
  const char *label;     /* of that field, for messages */
  char *definition;      /* of the element, with all preceding fields */
  double points;         /* of all tables and paths so far */
  double operations;     /* of all expressions so far */
  int entries;           /* of all lists so far, and copies of them */
  int has_index;         /* 1: `elements` has those of this file */
  int indexed;           /* elements that were indexed, with copies */
  double copied;         /* bytes of texts in copies before r->copies */
} pw_reader;

#define read_fail(r, at, ...) pw_yaml_fail ((r)->y, (r)->error, at, __VA_ARGS__)

/* Appends to a text in an array, as far as it fits. */
#define append(text, ...) pw_print (text + strlen (text), sizeof text - strlen (text), __VA_ARGS__)
#define read_no_memory(r) pw_yaml_no_memory ((r)->y, (r)->error)

/* Reports an error at an offset of the expression, or name, in a node. */
#define expression_fail(r, node, at, ...) \
  read_fail (r, pw_source_offset ((r)->y, node, at), "%s: %s", (r)->label, PW_PRINTED (300, __VA_ARGS__))

/* Reads an entry of a list. */
typedef int read_entry (pw_reader *r, const pw_node *entry);

/* ---- yaml_read.c ---- */

/* What a node is, for messages. */
const char *pw_node_found (const pw_node *node);

int pw_node_is (const pw_node *node, const char *text);
/* Finds known keys (ending with NULL) in the pairs from a node on: value[i] becomes the value of key[i], or NULL.
 * Other keys, repeated keys and empty values are refused; `owner` ("a body") is for messages. */
int pw_yaml_keys_from (const pw_reader *r, const pw_node *first, const char *const *key, const char *owner,
                       const pw_node **value);
/* The same in a map. */
int pw_yaml_keys (const pw_reader *r, const pw_node *map, const char *const *key, const char *owner,
                  const pw_node **value);

int pw_yaml_list (const pw_reader *r, const pw_node *node, const char *label);
/* Refuses anything but a list of `count` entries, which are `items` ("bodies"). */
int pw_yaml_list_of (const pw_reader *r, const pw_node *node, const char *label, int count, const char *items);
/* A name of the file as it is in the model, or NULL if out of memory. */
const char *pw_yaml_prefixed (const pw_reader *r, const char *name);
/* A scalar's text, not empty. */
int pw_yaml_text (const pw_reader *r, const pw_node *node, const char *label, const char **text);
/* Converts an offset in a scalar's text to one in the source; that of the node if the source spells it otherwise. */
size_t pw_source_offset (const pw_yaml *y, const pw_node *node, size_t offset);
/* The name of a signal's argument: "t", the time, or "s", the parameter of a curve. */
const char *pw_signal_argument (const pw_reader *r);
/* Whether a name in the model is that of a state: BODY.phi, or a first-order state. */
int pw_is_state_name (const pw_reader *r, const char *name);
/* Reads a name that expressions can use. */
int pw_yaml_name (const pw_reader *r, const pw_node *node, const char *label, const char **name);
/* 1 if the value of an expression changes during the motion. */
int pw_yaml_varies (const pw_reader *r, const char *text);
/* A number of a domain: an expression of the names in r->scope. */
int pw_yaml_number (const pw_reader *r, const pw_node *node, const char *label, pw_domain domain, double *value);
/* Two numbers: a list of `items`, "numbers, [x, y]". */
int pw_yaml_pair (const pw_reader *r, const pw_node *node, const char *label, const char *items, double *value);
/* One of `choices`, which end with NULL, as its index. */
int pw_yaml_choice (const pw_reader *r, const pw_node *node, const char *label, const char *const *choices, int *value);
/* The index of the element type that a scalar names, or -1. */
int pw_find_kind_key (const pw_node *node);
/* Adds the names of all bodies so far to the valid names of a suggestion. */
void pw_suggest_bodies (const pw_reader *r, pw_nearest *near);
/* Counts an entry, for which the tables of names get room. */
int pw_count_entry (pw_reader *r, const pw_node *node);
/* Calls `each` with the entries of a list, or a map in its place, until an error. */
int pw_yaml_entries (pw_reader *r, const pw_node *list, read_entry *each);
/* The node of an expression with the names as they are in the model. */
int pw_yaml_rename (pw_reader *r, const pw_node *node, pw_node *renamed);
/* A text in which the counter of copies, unless they are NULL, is replaced by its value; and, unless the prefix of an
 * included file is "", names of its states and outputs get the prefix, and its other names are replaced by their
 * values.  NULL if out of memory. */
const char *pw_yaml_renamed (const pw_reader *r, const struct pw_copies *copies, const char *prefix, const char *text);
/* Reads an expression; `variable`: names, which end with NULL. */
int pw_yaml_expression (pw_reader *r, const pw_node *node, const char *const *variable, const char **text,
                        const pw_expression **expression);
/* Indexes all elements of the file, including those not built yet, besides those of files built before. */
int pw_index_elements (pw_reader *r);
/* The names of a body's states, x to omega, and the number of one, or -1. */
extern const char *const pw_body_states[6];
int pw_body_state (const char *part);
/* Checks that a name with a dot, or that of a first-order state, at an offset of the expression, names a state. */
int pw_check_state_name (pw_reader *r, const pw_node *node, const char *name, size_t at);
/* Reads the name of a body or element, which must be unique. */
int pw_build_name (pw_reader *r, const pw_node *node, const char *label, const char **name);
/* Reports an error of the core at a node, without its prefix "model NAME: ". */
int pw_build_fail (const pw_reader *r, const pw_node *node, const pw_error *cause);

/* ---- yaml_signal.c ---- */

int pw_yaml_signal (pw_reader *r, const pw_node *node, pw_signal *signal);
/* Adds a path to the names of a file by its name in the model and, without the prefix, by its name in the file. */
int pw_yaml_name_path (const pw_reader *r, pw_scope *scope, const char *prefix, const char *name, pw_path *path);
/* Reads a path, of which the following expressions can use functions. */
int pw_yaml_path (pw_reader *r, const pw_node *node);
/* Reads the outline of a body; the node may be NULL. */
int pw_yaml_outline (pw_reader *r, const pw_node *node, pw_body *body);
/* Reads the unit of a state or output, which are displayed in SI units, like all columns. */
int pw_yaml_si_unit (const pw_reader *r, const pw_node *node, const char **unit);
/* Reads the outputs of the file.  The columns that they read are checked by pw_add_outputs. */
int pw_yaml_outputs (pw_reader *r);
/* Adds the outputs to the model, after all elements. */
int pw_add_outputs (pw_reader *r);

#endif
