/* Fingerprints: lines "KEY = VALUE" with all that decides what a run or a sweep computes. */
#ifndef PW_FINGERPRINT_H
#define PW_FINGERPRINT_H

#include <stdint.h>
#include "pinwheel-files.h"
#include "text.h"

/* ---- Making: a first line of its own, these, and "end" on a line ---- */

/* "KEY OF = VALUE"; OF may be NULL. */
void pw_print_line (pw_text *t, const char *key, const char *of, const char *value);
void pw_print_number (pw_text *t, const char *key, const char *of, double value);
/* A file's name and a check sum of what is in it.  PW_MACHINE if it cannot be read. */
int pw_print_file (pw_text *t, const char *key, const char *name, const char *path, pw_error *error);
/* The model's name and check sums of its file and, if not 0, of its tables.  PW_MACHINE if the file cannot be read. */
int pw_print_model (pw_text *t, const pw_file *file, uint64_t tables, pw_error *error);
/* A check sum of the tables in a model's signals, after those it was begun with; begin with 0. */
uint64_t pw_check_tables (uint64_t sum, const pw_model *m);
/* "STATE=VALUE" as on the command line; NULL-terminated, or NULL. */
void pw_print_starts (pw_text *t, const char **starts);

/* ---- Reading ---- */

/* Where what follows a fingerprint begins, or NULL if it is not whole or its first line is not `magic`. */
const char *pw_fingerprint_end (const char *magic, const char *at, const char *end);
/* The value of a key, its size in *size; NULL if there is none. */
const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size);
/* Puts the first difference of two fingerprints into words, "step is 0.001 there and 0.002 here" with words "there" and
 * "here"; the part does not count if `parts` is 0.  0 if they agree. */
int pw_fingerprint_differ (const char *a, const char *a_end, const char *b, const char *b_end, int parts,
                           const char *words[2], char *text, size_t size);

#endif
