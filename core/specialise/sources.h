/* Texts of the sources that generated code contains, embedded when the library is built. */
#ifndef PW_SOURCES_H
#define PW_SOURCES_H

typedef struct {
  const char *name;        /* "pin.c" */
  const char *const *line; /* ends with NULL */
} pw_source_text;
extern const pw_source_text pw_source_texts[]; /* ends with a NULL name */

#endif
