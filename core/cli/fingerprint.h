/* Fingerprints: lines "KEY = VALUE" with everything that determines the results of a run or a sweep. */
#ifndef PW_FINGERPRINT_H
#define PW_FINGERPRINT_H

#include <stdint.h>
#include "pinwheel-files.h"
#include "text.h"

/* ---- Writing: a first line that names the format, these lines, and a line "end" ---- */

/* "KEY OF = VALUE"; OF may be NULL. */
void pw_fingerprint_line (pw_text *t, const char *key, const char *of, const char *value);
void pw_fingerprint_number (pw_text *t, const char *key, const char *of, double value);
/* A file's name and a checksum of its contents.  PW_INPUT or PW_RESOURCE if it cannot be read. */
int pw_fingerprint_file (pw_text *t, const char *key, const char *name, const char *path, pw_error *error);
/* The first lines of a run's or sweep's fingerprint: `magic`; version, the model's name and checksums of its file and, if not
 * 0, of its tables; method and settings.  Errors as of pw_fingerprint_file. */
int pw_fingerprint_run (pw_text *t, const char *magic, const pw_file *file, uint64_t tables, const char *method,
                        const pw_settings *s, pw_error *error);
/* A checksum of the tables in a model's signals that continues `sum`; 0 at first. */
uint64_t pw_check_tables (uint64_t sum, const pw_model *m);
/* "STATE=VALUE" as on the command line; NULL-terminated, or NULL. */
void pw_fingerprint_initial (pw_text *t, const char **starts);

/* ---- Reading ---- */

/* The end of a fingerprint, or NULL if it is incomplete or its first line is not `magic`. */
const char *pw_fingerprint_end (const char *magic, const char *at, const char *end);
/* The value of a key, its size in *size; NULL if there is none. */
const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size);
/* Describes the first difference of two fingerprints: "step is 0.001 there and 0.002 here" with words "there" and "here";
 * the line "part" is ignored if `parts` is 0.  0 if they agree. */
int pw_fingerprint_differ (const char *a, const char *a_end, const char *b, const char *b_end, int parts,
                           const char *words[2], char *text, size_t size);

#endif
