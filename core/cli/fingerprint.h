/* Fingerprints of checkpoints and journals of sweeps: a first line that names the format (`magic`, with its "\n"),
 * lines "KEY = VALUE" with everything that determines the results of a run or a sweep, and a line "end". */
#ifndef PW_FINGERPRINT_H
#define PW_FINGERPRINT_H

#include <stdint.h>
#include "pinwheel-files.h"
#include "text.h"

/* ---- Writing ---- */

/* Adds the line "KEY NAME = VALUE", where the key is that of a list of values; or, if `name` is NULL, "KEY = VALUE". */
void pw_fingerprint_line (pw_text *t, const char *key, const char *name, const char *value);
void pw_fingerprint_number (pw_text *t, const char *key, const char *name, double value);
/* Adds a line with the name of a file and a checksum of its contents.  PW_INPUT or PW_RESOURCE if it cannot be read. */
int pw_fingerprint_file (pw_text *t, const char *key, const char *name, const char *path, pw_error *error);
/* Adds the first lines of the fingerprint of a run or sweep: `magic`, version, model, the checksum of its tables
 * (pw_fingerprint_tables) unless it is 0, method, span, step and tolerances.  Errors as of pw_fingerprint_file. */
int pw_fingerprint_run (pw_text *t, const char *magic, const pw_file *file, uint64_t table_sum, const char *method,
                        const pw_settings *settings, pw_error *error);
/* Continues a checksum, 0 at first, with the tables in the signals of a model. */
uint64_t pw_fingerprint_tables (uint64_t sum, const pw_model *m);
/* Adds a line for each state of a list of "STATE=VALUE", its last value; the list ends with NULL, or is NULL. */
void pw_fingerprint_initial (pw_text *t, const char **starts);

/* ---- Reading ---- */

/* The end of the fingerprint at the beginning of a text; NULL if it is incomplete or its first line is not `magic`. */
const char *pw_fingerprint_end (const char *magic, const char *at, const char *end);
/* The value of a key, of *size bytes and not zero-terminated; NULL if there is none. */
const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size);

typedef struct {
  const char *begin, *end;
  const char *where; /* in messages: "here", "there" */
} pw_fingerprint;

/* 1 if fingerprints differ in a key other than `ignored` (may be NULL); `text` is then the first difference: "step is
 * 0.001 there and 0.002 here". */
int pw_fingerprint_differ (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size);

#endif
