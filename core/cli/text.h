/* Strings of variable length, and the cells of a line of a CSV table. */
#ifndef PW_TEXT_H
#define PW_TEXT_H

#include <stdio.h>
#include "pinwheel-files.h"

typedef struct {
  char *at; /* terminated; NULL if empty */
  size_t used, room;
  int failed; /* out of memory: text added later is lost */
} pw_text;

void pw_text_clear (pw_text *t);
void pw_text_free (pw_text *t);
void pw_text_add (pw_text *t, const char *text);
void pw_text_add_bytes (pw_text *t, const char *bytes, size_t count);
/* A cell, after a comma unless it is the first of its line: a number with 17 digits, nan if not finite; or text. */
void pw_text_number (pw_text *t, double value);
void pw_text_cell (pw_text *t, const char *text);
/* "NAME [UNIT]" as a cell; no unit if it is NULL or "". */
void pw_text_name (pw_text *t, const char *name, const char *unit);
/* A cell in quotes, on one line. */
void pw_text_quoted (pw_text *t, const char *text);
/* Ends the line, writes it to a file of the folder, and frees it.  PW_OK or PW_RESOURCE. */
int pw_text_line (pw_text *t, FILE *f, const char *folder, pw_error *error);

/* Closes an incomplete table: it remains as NAME.part, whose path goes to the buffer; without rows it is removed, and
 * the path is "". */
void pw_text_abandon (pw_output *o, long rows, char *part, size_t size);
/* Closes a table with the status of writing it: PW_OK renames it to NAME, else it remains as NAME.part.  Returns a status. */
int pw_text_end (pw_output *o, int status, pw_error *error);

#endif
