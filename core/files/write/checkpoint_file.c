/* Checkpoints as files: a head in text, then the state of a run in binary, with a checksum of both. */
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

/* ---- Writing ---- */

static unsigned long long checkpoint_sum (const char *head, size_t head_size, const void *state, size_t state_size) {
  return pw_check_sum (pw_check_sum (PW_CHECK, head, head_size), state, state_size);
}

int pw_checkpoint_put (pw_output *o, const char *head, const pw_archive *state, pw_error *error) {
  FILE *f = pw_output_stream (o);
  errno = 0; /* for pw_output_check */
  fprintf (f, "%sstate = %zu bytes, check sum %016llx\n", head, state->used,
           checkpoint_sum (head, strlen (head), state->at, state->used));
  if (state->used > 0) fwrite (state->at, 1, state->used, f);
  int status = pw_output_check (o, error);
  if (status == PW_OK) return pw_output_finish (o, error);
  pw_output_discard (o);
  return status;
}

int pw_checkpoint_write (const char *path, const char *head, const pw_archive *state, pw_error *error) {
  pw_output *o = pw_output_open_as (path, ".next", error); /* as the program names the next checkpoint of a run */
  return o ? pw_checkpoint_put (o, head, state, error) : error ? error->status : PW_RESOURCE;
}

/* ---- Reading ---- */

#define CHECKPOINT_MAX_BYTES (SIZE_MAX / 4) /* no limit in practice; sums of sizes do not overflow */

static int checkpoint_version (const char *path, const char *text, pw_error *error) {
  static const char magic[] = PW_CHECKPOINT_MAGIC;
  size_t word = strcspn (magic, "0123456789");
  if (strncmp (text, magic, word) != 0) return pw_fail (error, PW_INPUT, "%s is not a checkpoint of Pinwheel", path);
  long format = strtol (text + word, NULL, 10), readable = strtol (magic + word, NULL, 10);
  if (format > 0 && format != readable)
    return pw_fail (error, PW_INPUT, "%s is a checkpoint of format %ld; this Pinwheel reads format %ld", path, format,
                    readable);
  if (strncmp (text, magic, sizeof magic - 1) == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated or damaged", path);
}

/* Finds the end of the head, and the state after it, in a file of `size` bytes. */
static int checkpoint_parse (const char *path, pw_checkpoint *c, size_t size, pw_error *error) {
  size_t state_size = 0;
  unsigned long long sum = 0;
  int n = 0; /* length of the line after the head */
  static const char last[] = "\nend\n";
  const char *end = strstr (c->text, last);
  c->head_end = end ? end + strlen (last) : NULL;
  if (end == NULL || sscanf (c->head_end, "state = %zu bytes, check sum %16llx%n", &state_size, &sum, &n) != 2 ||
      c->head_end[n] != '\n')
    return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated or damaged", path);
  const char *state = c->head_end + n + 1;
  size_t head_size = (size_t)(c->head_end - c->text), found = size - (size_t)(state - c->text);
  if (found < state_size)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated: found %zu bytes of %zu", path, size,
                    size - found + state_size);
  if (found > state_size || checkpoint_sum (c->text, head_size, state, state_size) != sum)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is damaged: its checksum is wrong", path);
  c->state = (pw_archive){ .at = (unsigned char *)c->text + (state - c->text), .size = state_size, .loading = 1 };
  return PW_OK;
}

int pw_checkpoint_read (const char *path, pw_checkpoint *c, pw_error *error) {
  size_t size = 0;
  *c = (pw_checkpoint){ .text = NULL };
  if (pw_require (path, "the name of a checkpoint", error) != PW_OK) return PW_INPUT;
  int status = pw_read_file ("cannot read the checkpoint", path, CHECKPOINT_MAX_BYTES, "the limit for a checkpoint",
                             &c->text, &size, error);
  if (status == PW_OK) status = checkpoint_version (path, c->text, error);
  return status == PW_OK ? checkpoint_parse (path, c, size, error) : status;
}

void pw_checkpoint_free (pw_checkpoint *c) {
  free (c->text);
  *c = (pw_checkpoint){ .text = NULL };
}
