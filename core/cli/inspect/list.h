/* What `pinwheel list` prints: rows in columns as wide as they need, and the lists that live in files of their own. */
#ifndef PW_LIST_H
#define PW_LIST_H

#include "cli.h"

enum { PW_LIST_ROWS = 40 };

/* One line: "radius", "number [m]", "required", "radius of the wheel". */
typedef struct {
  char name[32], type[40], given[80];
  const char *about;
} pw_list_row;

typedef struct {
  pw_list_row row[PW_LIST_ROWS];
  int rows;
} pw_list_rows;

/* Appends a row; all four texts, of which only the last one is not copied. */
void pw_list_add (pw_list_rows *x, const char *name, const char *type, const char *given, const char *about);

/* Appends the rows of a table of fields, ended by a NULL name. */
void pw_list_fields (pw_list_rows *x, const pw_field *fields);

/* Prints the rows in columns, indented by six, and empties them. */
void pw_list_print (pw_list_rows *x);

/* The kinds of element: one line each if no name is given, else all about those named; "all" names all. */
int pw_list_kinds (int names, const char **name, pw_error *error);

/* The forms of a signal. */
int pw_list_signals (int names, const char **name, pw_error *error);

#endif
