/* Checkpoints as files: a head in text, then the state of a run in binary, with a checksum of both. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

/* ---- Writing ---- */

static unsigned long long checkpoint_check (const char *head, size_t head_size, const void *state, size_t size) {
  return pw_check_sum (pw_check_sum (PW_CHECK, head, head_size), state, size);
}

int pw_checkpoint_put (pw_output *o, const char *head, const pw_archive *state, pw_error *error) {
  char line[100];
  snprintf (line, sizeof line, "state = %zu bytes, check sum %016llx\n", state->used,
            checkpoint_check (head, strlen (head), state->at, state->used));
  int status = pw_output_text (o, head, strlen (head), error);
  if (status == PW_OK) status = pw_output_text (o, line, strlen (line), error);
  if (status == PW_OK) status = pw_output_text (o, (const char *)state->at, state->used, error);
  if (status == PW_OK) return pw_output_finish (o, error);
  pw_output_discard (o);
  return status;
}

int pw_checkpoint_write (const char *path, const char *head, const pw_archive *state, pw_error *error) {
  pw_output *o = pw_output_open_as (path, ".next", error);
  return o ? pw_checkpoint_put (o, head, state, error) : error->status;
}

/* ---- Reading ---- */

static int checkpoint_version (const char *path, const char *text, pw_error *error) {
  static const char magic[] = PW_CHECKPOINT_MAGIC;
  size_t word = strcspn (magic, "0123456789");
  if (strncmp (text, magic, word) != 0) return pw_fail (error, PW_INPUT, "%s is not a checkpoint of Pinwheel", path);
  if (strncmp (text, magic, sizeof magic - 1) == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s is a checkpoint of format %.*s; this Pinwheel reads format %d", path,
                  (int)strspn (text + word, "0123456789"), text + word, atoi (magic + word));
}

/* Finds the end of the head, and the state after it. */
static int checkpoint_parse (const char *path, pw_checkpoint *c, size_t size, pw_error *error) {
  size_t bytes = 0;
  unsigned long long check = 0;
  int n = 0;
  static const char last[] = "\nend\n";
  const char *end = strstr (c->text, last);
  c->head_end = end ? end + strlen (last) : NULL;
  if (end == NULL || sscanf (c->head_end, "state = %zu bytes, check sum %16llx%n", &bytes, &check, &n) != 2 ||
      c->head_end[n] != '\n')
    return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated or damaged", path);
  const char *state = c->head_end + n + 1;
  size_t found = size - (size_t)(state - c->text), head = (size_t)(c->head_end - c->text);
  if (found < bytes)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is truncated: found %zu bytes of %zu", path, size,
                    size - found + bytes);
  if (found > bytes || checkpoint_check (c->text, head, state, bytes) != check)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is damaged: its checksum is wrong", path);
  c->state = (pw_archive){ .at = (unsigned char *)c->text + (state - c->text), .size = bytes, .loading = 1 };
  return PW_OK;
}

int pw_checkpoint_read (const char *path, pw_checkpoint *c, pw_error *error) {
  size_t size = 0;
  *c = (pw_checkpoint){ .text = NULL };
  int status = pw_read_file ("cannot read the checkpoint", path, SIZE_MAX / 4, "the limit for a checkpoint", &c->text,
                             &size, error);
  if (status == PW_OK) status = checkpoint_version (path, c->text, error);
  return status == PW_OK ? checkpoint_parse (path, c, size, error) : status;
}

void pw_checkpoint_free (pw_checkpoint *c) {
  free (c->text);
  *c = (pw_checkpoint){ .text = NULL };
}
