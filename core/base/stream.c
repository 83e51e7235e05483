/* Streams into memory that report if any part of the text is missing.  open_memstream of glibc 2.36 does not: out of
 * memory, it drops what is written without setting the error indicator. */
#define _GNU_SOURCE /* fopencookie */
#include <stdlib.h>
#include <string.h>
#include "util.h"

static ssize_t stream_write (void *cookie, const char *bytes, size_t count) {
  pw_stream *t = cookie;
  if (pw_grow (&t->text, t->size + count, &t->room, 1) != PW_OK) return 0;
  memcpy (t->text + t->size, bytes, count);
  t->size += count;
  t->text[t->size] = 0;
  return (ssize_t)count;
}

FILE *pw_stream_open (pw_stream *t) {
  *t = (pw_stream){ .text = calloc (1, 1), .room = 1 };
  return t->text ? fopencookie (t, "w", (cookie_io_functions_t){ .write = stream_write }) : NULL;
}

int pw_stream_close (FILE *f, pw_stream *t) {
  int failed = f == NULL || ferror (f);
  if (f && fclose (f) != 0) failed = 1;
  if (!failed) return PW_OK;
  free (t->text);
  *t = (pw_stream){ .text = NULL };
  return PW_RESOURCE;
}
