/* States in options and reports of `linearise`, `steady` and `periodic`. */
#ifndef PW_STATES_H
#define PW_STATES_H

#include <math.h>
#include "cli.h"
#include "pinwheel-analysis.h"

enum { PW_HOLDS = 40 }; /* quantities held at given values (pw_system_find_held), at most */

enum { PW_STEADY_NOT_RANDOM = 2 }; /* attempts of pw_steady_solve, 0 and 1, that do not begin at a random state */

#define PW_HOLD_OPTION(type, member)                      \
  PW_LIST_OPTION (type, member, "hold", 0, "STATE=VALUE", \
                  "Seek motions with this value of a state, or of BODY.speed, .radius or .curvature; repeatable")

/* Adds the quantity of this name to the list of those held, which has room for PW_HOLDS; `option` and `text` begin
 * messages.  PW_INPUT if there is none, with the nearest name, it is held already, or the list is full. */
int pw_hold_add (const pw_system *s, const char *option, const char *text, const char *name, double value,
                 pw_initial_value *hold, int *holds, pw_error *error);
/* Adds the quantity of each --hold "STATE=VALUE"; `texts` ends with NULL, or is NULL. */
int pw_hold_read (const pw_system *s, const char **texts, pw_initial_value *hold, int *holds, pw_error *error);

/* The value, or 0 if its modulus is below `least`. */
static inline double pw_rounded (double value, double least) {
  return fabs (value) < least ? 0 : value;
}
/* Prints the states of the bodies by pw_print_bodies, and the first-order states. */
void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double least);
/* Writes an object with the names and values of all states. */
void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j);

/* Add cells of a table: the names of the states; of `most` complex numbers, re1, im1, re2, ...; and these numbers, nan
 * beyond `count`. */
void pw_states_header (const pw_system *s, pw_text *t);
void pw_complex_header (pw_text *t, int most, const char *unit);
void pw_complex_cells (pw_text *t, const double *re, const double *im, int count, int most);

/* " up to 3 symmetries", or "" if there are none; returns the text. */
const char *pw_states_symmetries (int count, char text[40]);

#endif
