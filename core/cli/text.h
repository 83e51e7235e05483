/* Texts that grow, and the cells of a table's line. */
#ifndef PW_TEXT_H
#define PW_TEXT_H

#include <stdio.h>
#include "pinwheel-files.h"

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

/* Ends a table that is not whole: what there is of it stays, as NAME.part, whose path goes to the buffer; without a row there
 * is nothing to keep, and the path is "". */
void pw_text_abandon (pw_output *o, long rows, char *part, size_t size);
/* Ends a table that was written in one go, with the status of that: whole, or else NAME.part.  Returns a status. */
int pw_text_end (pw_output *o, int status, pw_error *error);

#endif
