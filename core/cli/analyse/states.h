/* States in options and reports of analyses. */
#ifndef PW_STATES_H
#define PW_STATES_H

#include "cli.h"
#include "pinwheel-analysis.h"
#include "text.h"

enum { PW_HOLDS = 40 };

#define PW_HOLD_OPTION(type, member)                      \
  PW_LIST_OPTION (type, member, "hold", 0, "STATE=VALUE", \
                  "Seek motions with this value of a state, or of BODY.speed, .radius or .curvature; repeatable")

/* Adds a value to the list, which has room for PW_HOLDS; `option` and `text` are for messages.  PW_INPUT. */
int pw_hold_add (const pw_system *s, const char *option, const char *text, const char *name, double value,
                 pw_initial_value *hold, int *holds, pw_error *error);
/* The same of a text "NAME=VALUE". */
int pw_hold_read (const pw_system *s, const char *option, const char *text, pw_initial_value *hold, int *holds,
                  pw_error *error);

/* Prints a row for each body; numbers below `small` as 0. */
void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double small);
/* Writes an object; adds cells with the names. */
void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j);
void pw_states_head (const pw_system *s, pw_text *t);
/* Writes a list of numbers. */
void pw_numbers_json (pw_json *j, const char *key, const double *value, int count);

/* " up to 3 symmetries", or "" without. */
const char *pw_states_symmetries (int count, char text[40]);

#endif
