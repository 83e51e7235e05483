/* Strings of variable length, and the cells of a line of a CSV table. */
#ifndef PW_TEXT_H
#define PW_TEXT_H

#include "pinwheel-files.h"

/* A string; zero-initialised, it is empty. */
typedef struct {
  char *chars;   /* zero-terminated; NULL before anything is added */
  size_t length; /* bytes, without the terminating zero */
  size_t room;   /* bytes allocated */
  int failed;    /* 1: out of memory, so that text is missing */
} pw_text;

void pw_text_clear (pw_text *t);
void pw_text_free (pw_text *t);
void pw_text_add (pw_text *t, const char *text);
void pw_text_add_bytes (pw_text *t, const char *bytes, size_t count);
/* Add a cell, after a comma unless it is the first of its line: a number with 17 digits, nan if not finite; or text. */
void pw_text_number (pw_text *t, double value);
void pw_text_cell (pw_text *t, const char *text);
/* Adds the cell "NAME [UNIT]"; no unit if it is NULL or "". */
void pw_text_name (pw_text *t, const char *name, const char *unit);
/* Adds a cell in quotes; line ends in it become blanks. */
void pw_text_quoted (pw_text *t, const char *text);
/* Writes the text and a line end to a file, and frees the text.  PW_OK, or PW_RESOURCE with the file's folder. */
int pw_text_line (pw_text *t, FILE *f, const char *folder, pw_error *error);

/* Closes an incomplete table: it remains as NAME.part, whose path goes to the buffer; without rows it is removed, and
 * the path is "". */
void pw_cli_abandon_table (pw_output *o, long rows, char *part, size_t size);
/* Closes a table that was written with this status: with PW_OK as NAME, else as NAME.part, and says so.  A status. */
int pw_cli_close_table (pw_output *o, int status, pw_error *error);

#endif
