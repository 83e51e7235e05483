/* Buffers that the state of a run is saved to and loaded from. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "run.h"
#include "util.h"

void pw_archive_bytes (pw_archive *a, void *bytes, size_t count) {
  if (count == 0 || a->failed) return;
  a->failed = a->loading ? a->size - a->used < count : pw_grow (&a->at, a->used + count, &a->size, 1) != PW_OK;
  if (a->failed) return;
  unsigned char *at = a->at + a->used;
  memcpy (a->loading ? bytes : at, a->loading ? at : bytes, count);
  a->used += count;
}

/* The bound leaves room for sums of counts. */
void pw_archive_count (pw_archive *a, long *count) {
  pw_archive_bytes (a, count, sizeof *count);
  if (a->loading && (*count < 0 || *count > LONG_MAX / 2)) a->failed = 1;
}

void pw_archive_clear (pw_archive *a) {
  a->used = 0;
  a->failed = 0;
}

void pw_archive_free (pw_archive *a) {
  free (a->at);
  *a = (pw_archive){ .at = NULL };
}
