/* States in options and reports of `linearise`, `steady` and `periodic`. */
#ifndef PW_STATES_H
#define PW_STATES_H

#include <math.h>
#include "cli.h"
#include "pinwheel-analysis.h"
#include "text.h"

enum { PW_HOLDS = 40 }; /* values that are held, at most */

#define PW_HOLD_OPTION(type, member)                      \
  PW_LIST_OPTION (type, member, "hold", 0, "STATE=VALUE", \
                  "Seek motions with this value of a state, or of BODY.speed, .radius or .curvature; repeatable")

/* Adds a value to be held to a list with room for PW_HOLDS; `option` and `text` are for messages.  PW_INPUT. */
int pw_hold_add (const pw_system *s, const char *option, const char *text, const char *name, double value,
                 pw_initial_value *hold, int *holds, pw_error *error);
/* Adds the values of each --hold "STATE=VALUE" of a list that ends with NULL; NULL: there are none. */
int pw_hold_read (const pw_system *s, const char **texts, pw_initial_value *hold, int *holds, pw_error *error);

/* 0 in place of a number that is smaller, and due to round-off. */
static inline double pw_rounded (double value, double smallest) {
  return fabs (value) < smallest ? 0 : value;
}
/* Prints a row for each body, numbers rounded to 0 below `smallest`. */
void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double smallest);
/* Writes an object with the names and values of the states. */
void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j);
/* Writes a list of numbers. */
void pw_numbers_json (pw_json *j, const char *key, const double *value, int count);

/* Columns of a table: the states; `most` complex numbers, re1, im1, re2, ..., nan beyond `count`. */
void pw_states_header (const pw_system *s, pw_text *t);
void pw_complex_header (pw_text *t, int most, const char *unit);
void pw_complex_cells (pw_text *t, const double *re, const double *im, int count, int most);

/* " up to 3 symmetries", or "" without. */
const char *pw_states_symmetries (int count, char text[40]);

#endif
