/* Files of Pinwheel: finds and loads models, reads tables, writes tables, summaries and checkpoints. */
#ifndef PINWHEEL_FILES_H
#define PINWHEEL_FILES_H

#include <stdint.h>
#include <stdio.h>
#include "run.h"

PW_BEGIN

/* ---- Models ---- */

/* An open model file: a loaded plug-in or a text model, with its table. */
typedef struct pw_file pw_file;

/* Opens a model, given its name or path.
 *
 * A name ("ezyroller") is searched for as NAME.so, NAME.yaml in the folders of the environment variable PINWHEEL_MODELS
 * (separated by ":"), and in those that belong to the running program and this library: models/ next to them or one
 * up, lib/pinwheel/models/ of the installation.  A path has a "/" or an ending: a .so is loaded, a .c compiled by $CC
 * or cc in a private temporary folder, its messages passed through on standard error; a .yaml is read
 * (docs/model-format.md).  Files in the current directory must be given as paths.
 *
 * Errors: PW_INPUT for a model that is not found (with the nearest name), matches several files, does not compile, is
 * not a Pinwheel plug-in, has another ABI or parameters outside their structure or domain; PW_RESOURCE. */
pw_file *pw_file_open (const char *model, pw_error *error);

/* The same with another limit in bytes than PW_FILE_DEFAULT_BYTES for a model in YAML, up to PW_FILE_MAX_BYTES.
 * Reading one takes about 10 times its size in memory. */
#define PW_FILE_DEFAULT_BYTES (64u << 20)
#define PW_FILE_MAX_BYTES (2000u << 20)
pw_file *pw_file_open_limited (const char *model, size_t max_bytes, pw_error *error);
void pw_file_close (pw_file *f);

/* A new model from the file, parameters at their defaults, not yet built.  The file must outlive it. */
pw_model *pw_file_model (const pw_file *f, pw_error *error);
const pw_plugin_table *pw_file_table (const pw_file *f);
const char *pw_file_name (const pw_file *f); /* "ezyroller" */
const char *pw_file_path (const pw_file *f);

/* The path of the file that a model's name or path refers to, malloced; NULL and an error as from pw_file_open. */
char *pw_file_find (const char *model, pw_error *error);

/* Calls `each` with the path of each table of a text model, once for each path and each signal that reads it, and of
 * each included file, until it returns non-zero; returns that, or 0. */
int pw_file_tables (const pw_file *f, int (*each) (void *context, const char *path), void *context);

/* Calls `each` with the name and path of every model on the search path, sorted by name, until it returns non-zero.
 * PW_OK, also then, or PW_RESOURCE. */
int pw_file_list (int (*each) (void *context, const char *name, const char *path), void *context, pw_error *error);

/* ---- Interactive pages ---- */

/* What a page needs to simulate a model in the browser. */
typedef struct {
  char *name; /* "engine", "model", "tree", or the path of a table relative to the model */
  char *bytes;
  size_t size;
} pw_page_file;
typedef struct {
  pw_page_file *file;
  int files;
} pw_page;
/* Errors: PW_INPUT if the model is a .so instead of its source, does not compile to WebAssembly, or tools for that are
 * missing, with the command that installs them; PW_RESOURCE. */
int pw_page_open (pw_page *p, const pw_file *f, pw_error *error);
void pw_page_close (pw_page *p); /* in every case */

/* ---- Specialised scenes ---- */

/* The loaded code of a system. */
typedef struct pw_scene_code pw_scene_code;

/* Loads what $CC or cc makes of the text of pw_system_source: from the cache, pinwheel/ below $XDG_CACHE_HOME or
 * ~/.cache, or compiled; without a cache in a temporary folder.  Systems of the same structure share code
 * (pw_specialised_fits), and so may processes at the same time.
 *
 * NULL and PW_INPUT without compiler or pinwheel.h; PW_METHOD if the text does not compile, with the path at which it
 * is kept; PW_STOPPED if a Unix signal (such as SIGINT) ended the compiler; PW_RESOURCE. */
pw_scene_code *pw_scene_code_open (const char *text, const pw_system *s, pw_error *error);
/* The same for 2, 4 or 8 runs at once (pw_runs_advance), if pw_system_has_lanes. */
pw_scene_code *pw_scene_lanes_open (const char *text, const pw_system *s, int lanes, pw_error *error);
/* 1 if the cache has an object that pw_scene_lanes_open would try first. */
int pw_scene_lanes_cached (const char *text, int lanes);
const pw_specialised_lanes *
pw_scene_code_lanes (const pw_scene_code *c); /* NULL if it is for single runs, or compiled by clang */
/* The number of runs whose lanes fill a vector register of this processor; 1 if several runs at once are not faster. */
int pw_processor_lanes (void);
/* For pw_settings.specialised; NULL if c is NULL or for several runs at once. */
const pw_specialised *pw_scene_code_table (const pw_scene_code *c);
/* A line about a cache, or a file in it, that was ignored, or ""; lives as long as the code. */
const char *pw_scene_code_notice (const pw_scene_code *c);
void pw_scene_code_close (pw_scene_code *c);

/* ---- Numbers, the same in every locale ---- */

/* "%.9g" and the like with a decimal point; with 17 digits, only as many as read back as the same number; nan, inf or
 * -inf.  Returns the buffer. */
char *pw_format (char buffer[32], double value, int digits);

/* Reads a number that fills the whole text, nan and inf included; else PW_INPUT or PW_RESOURCE, and *value stays. */
int pw_read_number (const char *text, double *value);

/* The same for numbers and expressions of numbers, as in text models: "30*deg", "2*pi/3". */
int pw_read_expression (const char *text, double *value);

/* For messages: what to write in place of a number with a unit, "; write 30*deg" for 30deg and "30 °"; "" for another
 * text.  Returns the buffer. */
char *pw_number_hint (const char *text, char *buffer, size_t size);

/* ---- Formulas: expressions of named numbers, the same language (parser.c) ---- */

typedef struct pw_formula pw_formula;

/* Reads an expression of at most PW_FORMULA_NAMES names, which end with NULL.  NULL and PW_INPUT with the reason, or
 * PW_RESOURCE. */
#define PW_FORMULA_NAMES 32
pw_formula *pw_formula_open (const char *text, const char *const *names, pw_error *error);
/* The value for values of the names; it may be non-finite. */
double pw_formula_value (const pw_formula *f, const double *value);
void pw_formula_close (pw_formula *f);

/* ---- Conditions: formulas of the columns of a run, "car.x > 10 && car.vy < 0" (parser.c) ---- */

typedef struct pw_condition pw_condition;

/* PW_INPUT if it is not a condition, or for an unknown column, with the nearest name; PW_RESOURCE.  The system must
 * outlive it. */
pw_condition *pw_condition_open (const pw_system *s, const char *text, pw_error *error);
int pw_condition_needs_ledger (const pw_condition *c); /* 1: it reads columns that need pw_settings.ledger */
/* > 0 where the condition is true at a sample: of a comparison, the difference of its sides; of && and ||, the smaller
 * and the larger one.  NaN if a signal fails.  For pw_crossing.value. */
double pw_condition_value (void *condition, const pw_sample *x);
void pw_condition_close (pw_condition *c);

/* The name that a parameter has in a file that a text model includes, given that name or with the file's prefix; NULL:
 * there is none. */
const char *pw_file_included_parameter (const pw_file *f, const char *name);

/* ---- Tables of numbers, and units in their headers, "NAME [UNIT]" (columns.c) ---- */

/* Finds the factor from a unit to SI units.  PW_INPUT if it is unknown, PW_RETRY if its dimension is not that of
 * `wanted`, unless that is NULL or unknown. */
int pw_unit_factor (const char *unit, const char *wanted, double *factor);

/* Returns the length of the name in a header's cell, and stores its unit: what is between brackets at its end, or a
 * known unit between parentheses; "" without a unit, or if it is - or 1. */
size_t pw_unit_split (const char *cell, char *unit, size_t size);

/* Finds the factor of a column from its header's cell, 1 without a unit.  PW_INPUT, and `why`: column, unit, reason. */
int pw_unit_check (const char *cell, const char *wanted, double *factor, char *why, size_t size);

/* Reads columns of a table by their names or numbers ("1", ...), in SI units: `unit` of each, or NULL for any.  The
 * first one increases if it is the time, in "s".  Empty cells are gaps, NaN, in the time too; nan is one in the others.
 * Returns `width` arrays of *rows numbers (0 if the table has only names), one after the other; free it.  Columns after
 * the first one may be missing if `missing` is not NULL: it receives 1 for each of those, which have no array, else 0.
 * NULL and PW_INPUT with file, line and nearest name, or PW_RESOURCE. */
double *pw_read_columns (const char *path, const char *const *column, const char *const *unit, int width,
                         unsigned char *missing, int *rows, pw_error *error);

/* ---- Reading ---- */

/* Opens a regular file for reading.  NULL, and the reason in *why, if that fails or it is a file of another type. */
FILE *pw_open_input (const char *path, const char **why);

/* Right after pw_open_input has failed: PW_RESOURCE if, by errno, memory or descriptors were short, else PW_INPUT. */
int pw_open_input_status (void);

/* ---- What a command reads and writes ---- */

typedef enum { PW_READS, PW_WRITES, PW_WRITES_INTO } pw_use_how;
typedef struct {
  const char *what; /* "--json", "the model"; for messages */
  const char *path; /* "-" is standard output; NULL: not used */
  pw_use_how how;
  /* NULL at the end: PW_WRITES_INTO a folder: endings of the names of the files it gets; PW_WRITES: endings of formats
   * that are written (".csv"), NULL for any */
  const char *const *names;
} pw_use;

/* Refuses a file that is both read and written, or written twice, under any name: files are compared by device and
 * inode, files that do not exist yet by device and inode of their folder, and their name.  PW_INPUT, PW_RESOURCE. */
int pw_check_paths (const pw_use *use, int count, pw_error *error);

/* ---- Complete files ---- */

/* A file written under a temporary name, NAME.part, and renamed when complete; "-" is standard output.
 *
 * The temporary file is new, locked against other processes, and never a symbolic link; if the name itself is one, the
 * file it leads to is replaced.  The replacement keeps mode and owner if permitted.  Files that are not regular (a
 * pipe, a device) and open descriptors (/dev/stdout, /dev/fd/N) are written directly. */
typedef struct pw_output pw_output;

/* Errors: PW_RESOURCE with the path and the reason, also if another process is writing it; PW_INPUT if it is "". */
pw_output *pw_output_open (const char *path, pw_error *error);
/* The same with another ending than ".part"; if pw_output_finish fails, the temporary file is removed. */
pw_output *pw_output_open_as (const char *path, const char *ending, pw_error *error);
FILE *pw_output_stream (pw_output *o); /* stdout for "-", /dev/stdout, /dev/fd/1; NULL after pw_output_ready */
/* Whether it is a regular file, not written directly. */
int pw_output_is_file (const pw_output *o);
/* Writes all output to the disk and closes the stream; only the renaming is missing.  PW_RESOURCE. */
int pw_output_ready (pw_output *o, pw_error *error);
/* Completes and frees: the file is written to the disk, then renamed, then its folder is written to the disk.
 * PW_RESOURCE if one of these fails; unless the renaming was done, NAME.part remains and the error names it. */
int pw_output_finish (pw_output *o, pw_error *error);
/* The same for several outputs, some of which may be NULL: completes all, or leaves all under their temporary names. */
int pw_output_finish_all (pw_output *const *o, int count, pw_error *error);
/* Gives up and frees: NAME.part remains; a text is cut after its last complete line.  The path of NAME.part is written
 * to the buffer, which is returned; NULL, and "" in the buffer, if there is none (standard output, a device). */
char *pw_output_abandon (pw_output *o, char *buffer, size_t size);
/* Gives up and frees, and removes NAME.part. */
void pw_output_discard (pw_output *o);

/* The path of a regular file to be written, links followed, for the caller to free.  NULL and PW_RESOURCE. */
char *pw_output_path (const char *path, pw_error *error);
/* Opens a file for reading and writing, creates it if there is none, and locks it until the descriptor that is returned
 * is closed.  A symbolic link is not followed.  -1 and PW_RESOURCE, also if another process has it. */
int pw_lock_path (const char *path, pw_error *error);
/* Locks a folder until the descriptor returned is closed.  -1 and PW_RESOURCE, also if another process has it. */
int pw_lock_folder (const char *path, pw_error *error);

/* The position in a file from which another process continues. */
typedef struct {
  unsigned long long length, check; /* bytes; checksum of the last ones */
} pw_mark;

/* Writes all output to the disk, and marks its end.  Errors: PW_RESOURCE; PW_INPUT if it is not a regular file. */
int pw_output_mark (pw_output *o, pw_mark *mark, pw_error *error);
/* Reopens NAME.part or, if only NAME exists, renames that to NAME.part; truncates it at the mark.  A table continues
 * without a header.  PW_INPUT if the file is missing, not regular, or differs from the marked contents; PW_RESOURCE. */
pw_output *pw_output_continue (const char *path, const pw_mark *mark, pw_error *error);

/* ---- Checkpoints ----
 *
 *     pinwheel checkpoint 2      lines "KEY = VALUE": the run it belongs to
 *     ...
 *     end
 *     state = 812 bytes, check sum 0123456789abcdef
 *
 * and the state, bytes as in memory. */

#define PW_CHECKPOINT_MAGIC "pinwheel checkpoint 2\n"

/* Writes a checkpoint and completes the file, which is released in every case; an existing one is replaced only then.
 * The head begins with PW_CHECKPOINT_MAGIC and ends with "end\n".  Errors: PW_RESOURCE. */
int pw_checkpoint_put (pw_output *o, const char *head, const pw_archive *state, pw_error *error);
/* The same, to the file at a path. */
int pw_checkpoint_write (const char *path, const char *head, const pw_archive *state, pw_error *error);

/* A checkpoint that was read: text up to `state`, which is ready for loading. */
typedef struct {
  char *text;
  const char *head_end; /* after "end\n" */
  pw_archive state;     /* its bytes belong to the text */
} pw_checkpoint;

/* PW_INPUT if it is not a checkpoint, of another version, truncated or damaged; PW_RESOURCE.  Free it in every case. */
int pw_checkpoint_read (const char *path, pw_checkpoint *c, pw_error *error);
void pw_checkpoint_free (pw_checkpoint *c);

/* ---- NumPy archives ---- */

/* Begin with { .f = stream }, add arrays, then end. */
typedef struct {
  FILE *f;
  struct pw_npz_entry *entry;
  size_t room;
  int count, failed; /* arrays; 1: memory was exhausted, which pw_npz_end reports */
  unsigned long at;  /* bytes written */
} pw_npz;

/* Adds an array of rows x columns numbers, row by row, or a vector if columns < 0; each number is 1 double, or 2 if it
 * is complex (parts).  The name has at most 300 bytes. */
void pw_npz_add (pw_npz *z, const char *name, long rows, long columns, int parts, const double *value);
/* Adds a vector of texts, each of `width` > 0 Unicode characters, of which the last ones may be 0. */
void pw_npz_add_texts (pw_npz *z, const char *name, long rows, int width, const uint32_t *character);
/* Completes the archive and frees its memory, in every case.  PW_RESOURCE; errors of the stream are the caller's. */
int pw_npz_end (pw_npz *z, pw_error *error);

/* ---- Tables ---- */

/* A table of samples: states, contact points, reactions (-lambda), scaled residuals, and energies if the run keeps a
 * ledger.  As CSV it has a header line "t [s],frame.x [m],...", then a line per sample; non-finite is
 * nan.  If the output is named .npz, it is a NumPy archive with a vector per column, named without unit, which is
 * written when the table is closed; it cannot continue a file (PW_INPUT).  PW_RESOURCE; PW_METHOD if a signal fails. */
typedef struct pw_csv pw_csv;
pw_csv *pw_csv_open (const pw_system *s, int ledger, pw_output *o, pw_error *error);
int pw_csv_write (pw_csv *c, const pw_system *s /* not used */, const pw_sample *sample, pw_error *error);
int pw_csv_close (pw_csv *c, pw_error *error); /* the output stays open; c may be NULL */

/* ---- JSON ---- */

/* Writes JSON to a stream: numbers by pw_format, with 17 digits unless `digits` is set, null for what is not finite;
 * text contains no "<", so that it may be part of a script in HTML.  Begin with { .f = stream } and open one container.
 * A key is NULL in lists and for the outermost container.  A NULL pw_json writes nothing. */
typedef struct {
  FILE *f;
  int lines;        /* outermost levels whose items have separate lines */
  int line;         /* 1: the next item, or the end of the container, begins a line */
  int depth, items; /* containers that are open; 0: the innermost has no items yet */
  int digits;       /* of numbers; 0: 17 */
} pw_json;
void pw_json_open (pw_json *j, const char *key, char bracket); /* '{' or '[' */
void pw_json_close (pw_json *j, char bracket);
void pw_json_number (pw_json *j, const char *key, double value);
void pw_json_numbers (pw_json *j, const char *key, const double *value, int count); /* a list */
void pw_json_text (pw_json *j, const char *key, const char *text);                  /* NULL: null */
void pw_json_flag (pw_json *j, const char *key, int value);
/* Writes items by a template such as "{name: %s, value: %g, list: [": %s a text or null, %g, %d and %ld a number, %i a
 * flag; a line end begins a line with the next item.  What is opened may be closed by another call. */
void pw_json_print (pw_json *j, const char *format, ...) PW_PRINTF (2, 3);

/* ---- Summaries ---- */

/* The errors of a run against the reference.  NaN: unknown. */
typedef struct {
  const char *source; /* "the model", or the path of a table */
  int samples;        /* compared */
  double t;           /* of the last one [s] */
  double end[4];      /* at t: of lengths [m], angles [rad], velocities [m/s], angular velocities [rad/s] */
  double most[4];     /* the largest of the run, in the same order */
  double reactions;   /* the largest, not at jumps, relative to the largest reference reaction of the same unit, or to
                         1 if that is 0 */
} pw_reference_error;

/* The errors of a run that its repetition states, of the numbers of a row of pw_run_record. */
typedef struct {
  const char *repeated;        /* with what: "a tenth of the tolerance", ... */
  const char *unknown;         /* why no error can be stated; NULL: the errors are stated */
  double t;                    /* of the last comparison [s] */
  int columns;                 /* numbers of a row */
  const double *end, *largest; /* columns: errors at t, and the largest of the run; NaN: of residuals */
  char *(*name) (const pw_system *s, int column, char *buffer, size_t size);
} pw_stated_error;

/* What a run was and how it ended; `reason` is "" when the status is ok. */
typedef struct {
  const char *model, *method;
  const char *status; /* "ok", "input", "start", "method", "machine", "interrupted" */
  const char *reason;
  double cpu;                   /* [s], integration alone */
  const char *const *redundant; /* a message per redundant constraint equation, ended by NULL; may be NULL */
  const pw_event *event;        /* events: of constraint equations with limits */
  int events;
  const pw_reference_error *reference; /* NULL: no reference */
  const pw_stated_error *stated;       /* NULL: not asked for */
  const char *general;                 /* why the general engine was used; "": it was not; NULL: no run */
  const char *const *of;               /* outputs of --of, ended by NULL; NULL: none */
  const double *of_value;              /* their values; NULL: not known */
  const char *until;                   /* the condition of --until; NULL: none */
  double stop_time;                    /* at which it has ended the run [s]; NaN: it has not become true */
  double energy_defect;                /* relative, as pw_run_energy_defect says; NaN: not known */
} pw_summary;

/* Writes the JSON summary; unknown values (model, method, s, sample, statistics may be NULL) and non-finite ones become
 * null.  The output stays open.  PW_RESOURCE. */
int pw_json_write (const pw_summary *summary, const pw_system *s, const pw_sample *sample, int ledger,
                   const pw_statistics *statistics, pw_output *o, pw_error *error);

PW_END

#endif
