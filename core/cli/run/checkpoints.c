/* Checkpoints of pinwheel run. */
#include <math.h>
#include <string.h>
#include "checkpoints.h"
#include "fingerprint.h"

static const char checkpoints_key[] = "checkpoint-every";

/* The interval of the file that is resumed. */
static void checkpoints_interval (pw_checkpoints *c) {
  char text[40];
  size_t size;
  const char *value = pw_fingerprint_value (c->from.text, c->from.head_end, checkpoints_key, &size);
  if (value == NULL || size >= sizeof text) return;
  memcpy (text, value, size);
  text[size] = 0;
  if (pw_read_number (text, &c->every) != PW_OK || !(c->every > 0)) c->every = 0;
}

int pw_checkpoints_open (pw_checkpoints *c, double t_end, pw_error *error) {
  c->due = INFINITY;
  if (c->resume && c->path == NULL) c->path = c->resume;
  if (c->path == NULL && c->every_text == NULL) return PW_OK;
  if (c->path == NULL)
    return pw_fail (error, PW_INPUT, "--checkpoint-every %s: --checkpoint FILE is needed to save to", c->every_text);
  if (c->resume && pw_checkpoint_read (c->resume, &c->from, error) != PW_OK) return error->status;
  c->every = t_end / 10;
  if (c->resume) checkpoints_interval (c);
  pw_text_add (&c->head, PW_CHECKPOINT_MAGIC);
  return pw_cli_number ("--checkpoint-every", c->every_text, PW_POSITIVE, &c->every, error);
}

int pw_checkpoints_reserve (pw_checkpoints *c, pw_error *error) {
  c->lock = pw_output_open (c->path, error);
  if (c->lock == NULL) return error->status;
  if (pw_output_is_file (c->lock)) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: a checkpoint needs a regular file, which can be read again and replaced",
                  c->path);
}

void pw_checkpoints_close (pw_checkpoints *c) {
  if (c->lock) pw_output_discard (c->lock);
  pw_text_free (&c->head);
  pw_archive_free (&c->state);
  pw_checkpoint_free (&c->from);
}

int pw_checkpoints_match (pw_checkpoints *c, pw_error *error) {
  static const char *words[2] = { "there", "here" };
  const unsigned short order = 1;
  char what[300], numbers[60];
  pw_print_number (&c->head, checkpoints_key, NULL, c->every);
  snprintf (numbers, sizeof numbers, "%s endian, %zu bytes", *(const unsigned char *)&order ? "little" : "big",
            sizeof (long));
  pw_print_line (&c->head, "numbers", NULL, numbers);
  pw_text_add (&c->head, "end\n");
  if (c->head.failed) return pw_fail (error, PW_MACHINE, "out of memory");
  if (c->resume && pw_fingerprint_differ (c->from.text, c->from.head_end, c->head.at, c->head.at + c->head.used, 1,
                                          words, what, sizeof what))
    return pw_fail (error, PW_INPUT, "the checkpoint %.100s belongs to another run: %.300s", c->resume, what);
  return PW_OK;
}

void pw_checkpoints_pass (pw_checkpoints *c, double t) {
  if (c->every == 0) return;
  double n = floor (t / c->every);
  while (n * c->every <= t) n++;
  c->due = n * c->every;
}

int pw_checkpoints_write (pw_checkpoints *c, double t, pw_error *error) {
  if (c->state.failed) return pw_fail (error, PW_MACHINE, "out of memory while saving a checkpoint");
  pw_output *o = pw_output_open_as (c->path, ".next", error);
  int status = o ? pw_checkpoint_put (o, c->head.at, &c->state, error) : error->status;
  if (status == PW_OK) c->saved = t;
  return status;
}
