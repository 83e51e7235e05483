/* Pinwheel's files: models found by name, tables and summaries written. */
#ifndef PINWHEEL_FILES_H
#define PINWHEEL_FILES_H

#include <stdio.h>
#include "run.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Models ---- */

/* A model file that is open: a plug-in loaded, and its table. */
typedef struct pw_file pw_file;

/* Opens a model by name ("ezyroller": NAME.so on the search path: the folders of PINWHEEL_MODELS, then those next to
 * the library's program: build/models or lib/pinwheel/models) or by path (with a "/" or an ending: a .so is loaded, a
 * .c is compiled with $CC or cc in a private temporary folder, its messages passed through on standard error).
 * Nothing is loaded from the current directory unless named by path.  Errors, all PW_INPUT: not found (with the
 * nearest name), found twice (with both paths), does not compile, is not a Pinwheel plug-in, has another ABI. */
pw_file *pw_file_open (const char *model, pw_error *error);
void pw_file_close (pw_file *f);

/* A new model from the file, parameters at their defaults, not yet built.  The file must outlive it. */
pw_model *pw_file_model (const pw_file *f, pw_error *error);
const pw_plugin_table *pw_file_table (const pw_file *f);
const char *pw_file_name (const pw_file *f); /* "ezyroller" */
const char *pw_file_path (const pw_file *f);

/* Calls `each` with the name and path of every model on the search path, in order of name, until it returns non-zero. */
int pw_file_list (int (*each) (void *context, const char *name, const char *path), void *context, pw_error *error);

/* ---- Numbers, the same in every locale ---- */

/* "%.17g" (or fewer digits) with a decimal point; non-finite as nan, inf, -inf.  Returns the buffer. */
char *pw_format (char buffer[32], double value, int digits);

/* Reads a number that fills the whole text; PW_INPUT otherwise. */
int pw_read_number (const char *text, double *value);

/* ---- Files that are whole or carry another name ---- */

/* A file written as NAME.part and renamed when complete; "-" is standard output. */
typedef struct pw_output pw_output;

/* Errors: PW_MACHINE with the path and the reason. */
pw_output *pw_output_open (const char *path, pw_error *error);
FILE *pw_output_stream (pw_output *o);
/* Completes: flushes, checks, renames.  PW_MACHINE if anything failed: NAME.part stays and the text names it. */
int pw_output_finish (pw_output *o, pw_error *error);
/* Gives up: NAME.part stays with whole lines; its path, or NULL for standard output, is written to the buffer. */
char *pw_output_abandon (pw_output *o, char *buffer, size_t size);

/* ---- Tables ---- */

/* A CSV of samples: one header line "t [s],frame.x [m],...", then a line per sample with 17 digits. */
typedef struct pw_csv pw_csv;
pw_csv *pw_csv_open (const pw_system *s, int ledger, pw_output *o, pw_error *error);
int pw_csv_write (pw_csv *c, pw_system *s, const pw_sample *sample, pw_error *error);
void pw_csv_close (pw_csv *c);

/* ---- Summaries ---- */

/* What a run was and how it ended; `reason` is "" when the status is ok. */
typedef struct {
  const char *model, *method;
  const char *status; /* "ok", "input", "start", "method", "machine", "interrupted" */
  const char *reason;
  double cpu; /* [s], integration alone */
} pw_summary;

/* Writes the JSON summary.  s, sample and statistics may be NULL if the run did not get that far. */
int pw_json_write (const pw_summary *summary, const pw_system *s, const pw_sample *sample, int ledger,
                   const pw_statistics *statistics, pw_output *o, pw_error *error);

#ifdef __cplusplus
}
#endif

#endif
