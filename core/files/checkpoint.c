/* Checkpoints as files. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "files.h"

#define CHECKPOINT_LAST "end\n"

/* ---- Writing ---- */

/* The folder knows of the new name only when it is on the disk itself; some file systems refuse that, and need it not. */
static void checkpoint_sync_folder (const char *path) {
  char folder[4200] = ".";
  const char *slash = strrchr (path, '/');
  if (slash) snprintf (folder, sizeof folder, "%.*s", slash == path ? 1 : (int)(slash - path), path);
  int fd = open (folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  (void)fsync (fd);
  close (fd);
}

static unsigned long long checkpoint_check (const char *head, size_t head_size, const void *state, size_t size) {
  return pw_check_sum (pw_check_sum (PW_CHECK, head, head_size), state, size);
}

int pw_checkpoint_write (const char *path, const char *head, const pw_archive *state, pw_error *error) {
  char line[100];
  snprintf (line, sizeof line, "state = %zu bytes, check sum %016llx\n", state->used,
            checkpoint_check (head, strlen (head), state->at, state->used));
  pw_output *o = pw_output_open (path, error);
  if (o == NULL) return error->status;
  int status = pw_output_text (o, head, strlen (head), error);
  if (status == PW_OK) status = pw_output_text (o, line, strlen (line), error);
  if (status == PW_OK) status = pw_output_text (o, (const char *)state->at, state->used, error);
  if (status == PW_OK) status = pw_output_sync (o, error);
  if (status != PW_OK) {
    pw_output_discard (o);
    return status;
  }
  status = pw_output_finish (o, error);
  if (status == PW_OK) checkpoint_sync_folder (path);
  return status;
}

/* ---- Reading ---- */

static int checkpoint_slurp (const char *path, char **text, size_t *size, pw_error *error) {
  FILE *f = fopen (path, "rb");
  if (f == NULL) return pw_fail (error, PW_INPUT, "cannot read the checkpoint %s: %s", path, strerror (errno));
  struct stat info;
  long end = fstat (fileno (f), &info) == 0 && S_ISREG (info.st_mode) && fseek (f, 0, SEEK_END) == 0 ? ftell (f) : -1;
  int status = end < 0 || fseek (f, 0, SEEK_SET) != 0 ? PW_INPUT : PW_OK;
  if (status == PW_OK && (*text = malloc ((size_t)end + 1)) == NULL) status = PW_MACHINE;
  if (status == PW_OK && fread (*text, 1, (size_t)end, f) != (size_t)end) status = PW_INPUT;
  fclose (f);
  if (status == PW_OK) (*text)[ *size = (size_t)end] = 0;
  return status == PW_OK        ? PW_OK
         : status == PW_MACHINE ? pw_fail (error, status, "out of memory")
                                : pw_fail (error, status, "cannot read the checkpoint %s", path);
}

/* Checks the first line. */
static int checkpoint_version (const char *path, const char *text, pw_error *error) {
  static const char magic[] = PW_CHECKPOINT_MAGIC;
  size_t word = strcspn (magic, "0123456789");
  if (strncmp (text, magic, word) != 0) return pw_fail (error, PW_INPUT, "%s is no checkpoint of Pinwheel", path);
  if (strncmp (text, magic, sizeof magic - 1) == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s is a checkpoint of format %.*s; this Pinwheel reads format %d", path,
                  (int)strspn (text + word, "0123456789"), text + word, atoi (magic + word));
}

/* Finds the end of the head, and the state behind it. */
static int checkpoint_parse (const char *path, pw_checkpoint *c, size_t size, pw_error *error) {
  size_t bytes = 0;
  unsigned long long check = 0;
  int n = 0;
  const char *end = strstr (c->text, "\nend\n");
  c->head_end = end ? end + 1 + sizeof CHECKPOINT_LAST - 1 : NULL;
  if (end == NULL || sscanf (c->head_end, "state = %zu bytes, check sum %16llx%n", &bytes, &check, &n) != 2 ||
      c->head_end[n] != '\n')
    return pw_fail (error, PW_INPUT, "the checkpoint %s is cut off or damaged", path);
  const char *state = c->head_end + n + 1;
  size_t there = size - (size_t)(state - c->text), head = (size_t)(c->head_end - c->text);
  if (there < bytes)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is cut off: %zu bytes of %zu are there", path, size,
                    size - there + bytes);
  if (there > bytes || checkpoint_check (c->text, head, state, bytes) != check)
    return pw_fail (error, PW_INPUT, "the checkpoint %s is damaged: its check sum is wrong", path);
  c->state = (pw_archive){ .at = (unsigned char *)c->text + (state - c->text), .size = bytes, .loading = 1 };
  return PW_OK;
}

int pw_checkpoint_read (const char *path, pw_checkpoint *c, pw_error *error) {
  size_t size = 0;
  *c = (pw_checkpoint){ .text = NULL };
  int status = checkpoint_slurp (path, &c->text, &size, error);
  if (status == PW_OK) status = checkpoint_version (path, c->text, error);
  return status == PW_OK ? checkpoint_parse (path, c, size, error) : status;
}

void pw_checkpoint_free (pw_checkpoint *c) {
  free (c->text);
  *c = (pw_checkpoint){ .text = NULL };
}
