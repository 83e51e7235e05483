/* Models as text, for `pinwheel show` and `pinwheel show --yaml`. */
#ifndef PW_SHOW_H
#define PW_SHOW_H

#include "cli.h"

/* Prints the values of a field as in a text model, with this number of digits.  With fewer than 17, tables are
 * abridged. */
void pw_show_field (const pw_field *f, const void *at, int digits);

/* Writes a built model to standard output as text, with 17 digits, without a reference solution in C.  PW_INPUT if a
 * text model cannot express it: signals that are C functions, element types of a plug-in, values of --start. */
int pw_show_yaml (const pw_cli_model *opened, pw_error *error);

#endif
