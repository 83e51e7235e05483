/* Internal interfaces of libpinwheel-files. */
#ifndef PW_FILES_H
#define PW_FILES_H

#include <limits.h>
#include <sys/stat.h>
#include "pinwheel-files.h"
#include "util.h"

/* ---- Paths (number.c) ---- */

/* The size of a buffer for a path: a path that is cut to it is still too long for the system, which refuses it. */
enum { PW_PATH = PATH_MAX + 1 };
/* Prints a path into the buffer, which is returned. */
char *pw_path (char path[PW_PATH], const char *format, ...) PW_PRINTF (2, 3);

/* ---- Search path for models (file.c) ---- */

typedef struct {
  char *name; /* "ezyroller" */
  char *path; /* of the file itself, links resolved */
} pw_found;

/* All .so and .yaml files on the search path, sorted by name, then by path. */
typedef struct {
  pw_arena arena;
  pw_found *found;
  int count;
  size_t room;       /* entries of `found` allocated */
  char folders[400]; /* the folders searched, links resolved, for messages: "/first:/second", as many as fit */
  char unread[160];  /* folders of PINWHEEL_MODELS that cannot be searched: "/nowhere (No such file or directory)" */
} pw_search;

/* Searches every folder of the search path.  Close in every case.  PW_OK or PW_RESOURCE. */
int pw_search_open (pw_search *s, pw_error *error);
void pw_search_close (pw_search *s);

/* Find the pinwheel.h of this library; a file of the engine of interactive pages.  The path is "" if there is none.
 * PW_OK or PW_RESOURCE. */
int pw_search_header (char path[PW_PATH], pw_error *error);
int pw_search_page_file (const char *file, char path[PW_PATH], pw_error *error);

/* Whether a name has an ending such as ".so", after at least one character. */
int pw_ends_with (const char *name, const char *ending);

/* ---- Model files in C (compiler.c) ---- */

/* What is done with the compiled object at a path; it is deleted afterwards. */
typedef int pw_object_user (void *context, const char *object, pw_error *error);

/* Compiles a C file to a shared object or, unless `engine` is NULL, to WebAssembly linked with that archive, in a
 * private temporary folder; returns what `use` returns for the result.  PW_INPUT if it does not compile, or without
 * compiler or pinwheel.h; PW_RESOURCE. */
int pw_compile_file (const char *path, const char *engine, pw_object_user *use, void *context, pw_error *error);
#define PW_PAGE_TOOLS "clang, lld, wasi-libc and libclang-rt-14-dev-wasm32 (make deps TOOLS=page)"

/* Compiles generated code with all messages in a log, for `lanes` runs at once; 0: for single runs.  PW_INPUT without
 * compiler or pinwheel.h; PW_METHOD if it does not compile; PW_STOPPED if a signal ended the compiler; PW_RESOURCE. */
int pw_compile_scene (const char *path, const char *object, const char *log, int lanes, pw_error *error);
/* The compiler's options for generated code, ending with NULL: vector instructions of this processor, no fused
 * multiply-add, so that results have the same bits.  NULL: no code advances this number of runs. */
const char *const *pw_scene_options (int lanes);

/* The command of the C compiler: CC in the environment, else "cc". */
const char *pw_compiler (void);

/* Makes a new folder in TMPDIR that only the user can use.  PW_OK or PW_RESOURCE. */
int pw_temporary_folder (char folder[PW_PATH], pw_error *error);

/* ---- The cache (compiler.c) ---- */

/* Stores the path of the cache's folder, which is created if it does not exist; 0 if there is none, with a notice in
 * the buffer (otherwise unchanged) if one exists but others could have written to it, or it is unusable. */
int pw_cache_folder (char path[PW_PATH], char *notice, size_t size);
/* Deletes the least recently used files until the rest is within the limit; each use must set st_mtime. */
void pw_cache_trim (const char *folder);

/* ---- Models in YAML (yaml.c) ---- */

/* A text model in memory, with a plug-in's table.  `path`: absolute, links resolved; `shown`: the path in messages.
 * `error` is not NULL: PW_INPUT with the position; PW_RESOURCE.  Bodies and elements are read when a model is built. */
typedef struct pw_yaml pw_yaml;
pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error);
void pw_yaml_close (pw_yaml *y);
const pw_plugin_table *pw_yaml_table (const pw_yaml *y);
/* Writes the text, as read but for a byte order mark. */
void pw_yaml_write_source (const pw_yaml *y, FILE *f);
/* Writes the tree as bytes, for programs without libfyaml (yaml_read.c). */
void pw_yaml_write_tree (const pw_yaml *y, FILE *f);
/* As pw_file_tables. */
int pw_yaml_tables (const pw_yaml *y, int (*each) (void *context, const char *path), void *context);

/* The text model of a file; NULL for a compiled one. */
const pw_yaml *pw_file_yaml (const pw_file *f);

/* ---- Tables of numbers (columns.c) ---- */

/* Whether nan in a column other than the time is an error, or a gap like an empty cell. */
typedef enum { PW_GAPS_REFUSED, PW_GAPS_ALLOWED } pw_gaps;

/* As pw_read_columns, from a stream, which stays open; `shown` is its path in messages, "SHOWN:LINE: REASON".  NULL in
 * place of a column: the first one, or the second one, which is not the time. */
double *pw_columns_from_stream (FILE *f, const char *shown, const char *const *column, const char *const *unit,
                                int width, pw_gaps gaps, unsigned char *missing, int *rows, pw_error *error);

/* ---- Units (columns.c) ---- */

/* A known unit: "mm" is "1e-3" of "m".  The first four are the base units. */
typedef struct {
  const char *name, *factor, *si; /* the factor is an expression; "1": an SI unit */
} pw_unit_name;

extern const pw_unit_name pw_unit_names[]; /* ends with a NULL name */
/* Stores the power at p, after a name: "^2", "²", "2"; 1 if there is none, 0 if it is refused.  Returns its end. */
const char *pw_unit_power (const char *p, int *power);

/* ---- Reading (read.c) ---- */

/* As pw_read_rest, of the regular file at a path.  If it cannot be opened, the error is "FAILURE PATH: REASON". */
int pw_read_file (const char *failure, const char *path, size_t max_bytes, const char *limit, char **text, size_t *size,
                  pw_error *error);

/* Reads the rest of a file of at most `max_bytes` bytes into *text, zero-terminated; free it in every case.  `limit`
 * names the limit in messages: "the limit for a table".  PW_INPUT if the file is larger or unreadable; PW_RESOURCE. */
int pw_read_rest (FILE *f, size_t max_bytes, const char *path, const char *limit, char **text, size_t *size,
                  pw_error *error);

/* ---- Names of files (file.c) ---- */

/* Why a file is refused: "it is a directory, not a regular file". */
const char *pw_not_regular (mode_t mode);

/* Stores the folder of the file at a path in the buffer, which is returned. */
char *pw_folder_of (char folder[PW_PATH], const char *path);

/* The location of an existing or future file, links followed. */
typedef struct {
  char path[PW_PATH]; /* of the file itself, or naming the descriptor */
  int descriptor;     /* descriptor of this process that the path names ("-", /dev/stdout, /dev/fd/3), or -1 */
  int exists;         /* 1: `info` is known */
  struct stat info;
} pw_location;

/* 0 or an errno value. */
int pw_locate (pw_location *p, const char *path);

/* ---- Locks (file.c) ---- */

typedef enum {
  PW_LOCK_NEW,     /* a new file; removes one left by a killed process */
  PW_LOCK_KEEP,    /* the existing file, or a new one */
  PW_LOCK_EXISTING /* the existing file; ENOENT if there is none */
} pw_lock_mode;

/* Opens a regular file for reading and writing and locks it until it is closed; a symbolic link is not followed.  -1
 * and errno, for pw_lock_reason. */
int pw_lock_file (const char *path, pw_lock_mode mode);
const char *pw_lock_reason (int code); /* of an errno value, for messages */

/* ---- Outputs (output.c) ---- */

/* PW_RESOURCE if a write to its stream has failed; set errno to 0 before writing, for the reason. */
int pw_output_check (pw_output *o, pw_error *error);

/* Whether the output was opened by pw_output_continue. */
int pw_output_continued (const pw_output *o);
/* 1 if its path has this ending. */
int pw_output_named (const pw_output *o, const char *ending);

#endif
