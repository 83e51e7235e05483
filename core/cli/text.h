/* Texts that grow, and the cells of a table's line. */
#ifndef PW_TEXT_H
#define PW_TEXT_H

#include <stdio.h>
#include "pinwheel.h"

typedef struct {
  char *at; /* ended by a 0, NULL at first */
  size_t used, room;
  int failed; /* out of memory: what was added since is lost */
} pw_text;

void pw_text_clear (pw_text *t);
void pw_text_free (pw_text *t);
void pw_text_add (pw_text *t, const char *text);
void pw_text_add_bytes (pw_text *t, const char *bytes, size_t count);
/* "a,b": a number with 17 digits, or a text, after a comma unless it is the first of its line; not finite is nan. */
void pw_text_number (pw_text *t, double value);
void pw_text_cell (pw_text *t, const char *text);
/* "NAME [UNIT]" as a cell; no unit if it is NULL or "". */
void pw_text_name (pw_text *t, const char *name, const char *unit);
/* A cell in quotes, on one line. */
void pw_text_quoted (pw_text *t, const char *text);
/* Ends the line, writes it to a file of the folder, and frees it.  PW_OK or PW_MACHINE. */
int pw_text_line (pw_text *t, FILE *f, const char *folder, pw_error *error);

#endif
