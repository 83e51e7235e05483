/* Source files whose text generated code contains; the build embeds them in the library (sources.inc). */
#ifndef PW_SOURCES_H
#define PW_SOURCES_H

typedef struct {
  const char *name;        /* "pin.c" */
  const char *const *line; /* each with its line end; ends with NULL */
} pw_source_text;
extern const pw_source_text pw_source_texts[]; /* ends with a NULL name */

#endif
