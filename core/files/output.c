/* Files that are whole or carry another name: written as NAME.part, renamed when complete.
 *
 * What is there already and is no regular file (a terminal, a pipe, /dev/null) is written as it is. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "files.h"

struct pw_output {
  FILE *stream;
  char *path; /* as the user knows it */
  char *real; /* where it goes in the end: links are followed, not replaced */
  char *part; /* real + ".part"; NULL: written directly */
  int why;    /* errno of the first write of ours that failed */
};

static void output_free (pw_output *o) {
  if (o == NULL) return;
  free (o->path);
  free (o->real);
  free (o->part);
  free (o);
}

static int output_fail (const pw_output *o, int why, int kept, pw_error *error) {
  const char *what = strcmp (o->path, "-") == 0 ? "standard output" : o->path;
  const char *reason = why ? strerror (why) : "a write failed";
  if (o->part && kept)
    return pw_fail (error, PW_MACHINE, "cannot write %s: %s; what was written is in %s", what, reason, o->part);
  return pw_fail (error, PW_MACHINE, "cannot write %s: %s", what, reason);
}

static int output_open_file (pw_output *o, pw_error *error) {
  struct stat info;
  int there = stat (o->path, &info) == 0, direct = there && !S_ISREG (info.st_mode) && !S_ISDIR (info.st_mode);
  errno = 0;
  if (there && S_ISDIR (info.st_mode))
    errno = EISDIR;
  else if (there && !direct && access (o->path, W_OK) != 0)
    errno = errno ? errno : EACCES;
  if (errno) return pw_fail (error, PW_MACHINE, "cannot write %s: %s", o->path, strerror (errno));
  o->real = there ? realpath (o->path, NULL) : strdup (o->path);
  if (o->real && !direct) {
    size_t size = strlen (o->real) + sizeof ".part";
    o->part = malloc (size);
    if (o->part) snprintf (o->part, size, "%s.part", o->real);
  }
  if (o->real == NULL || (o->part == NULL && !direct)) return pw_fail (error, PW_MACHINE, "out of memory");
  o->stream = fopen (direct ? o->real : o->part, "w");
  if (o->stream) return PW_OK;
  return pw_fail (error, PW_MACHINE, "cannot write %s: %s", o->path, strerror (errno));
}

pw_output *pw_output_open (const char *path, pw_error *error) {
  pw_output *o = calloc (1, sizeof *o);
  if (o) o->path = strdup (path);
  int status = PW_OK;
  if (o == NULL || o->path == NULL)
    status = pw_fail (error, PW_MACHINE, "out of memory");
  else if (*path == 0)
    status = pw_fail (error, PW_INPUT, "the name of a file to write is empty");
  else if (strcmp (path, "-") == 0)
    o->stream = stdout;
  else
    status = output_open_file (o, error);
  if (status == PW_OK) return o;
  output_free (o);
  return NULL;
}

FILE *pw_output_stream (pw_output *o) {
  return o->stream;
}

int pw_output_text (pw_output *o, const char *text, size_t size, pw_error *error) {
  errno = 0;
  if (fwrite (text, 1, size, o->stream) == size && !ferror (o->stream)) return PW_OK;
  if (o->why == 0) o->why = errno;
  return output_fail (o, o->why, 0, error);
}

/* Empties the buffer and closes; standard output stays open.  Returns 0, or the reason as an errno, -1 if unknown. */
static int output_close (pw_output *o) {
  int before = !ferror (o->stream) ? 0 : o->why ? o->why : -1;
  errno = 0;
  int bad = fflush (o->stream), why = errno;
  if (o->stream != stdout && fclose (o->stream) != 0 && !bad) bad = 1, why = errno;
  o->stream = NULL;
  return before ? before : bad ? (why ? why : -1) : 0;
}

/* Cuts a file back to its last whole line. */
static void output_whole_lines (const char *path) {
  FILE *f = fopen (path, "r+");
  if (f == NULL) return;
  long end = fseek (f, 0, SEEK_END) == 0 ? ftell (f) : 0, keep = end;
  while (keep > 0) {
    if (fseek (f, keep - 1, SEEK_SET) != 0 || fgetc (f) == '\n') break;
    keep--;
  }
  if (keep < end && ftruncate (fileno (f), keep) != 0) keep = end; /* then it stays as it is */
  fclose (f);
}

int pw_output_finish (pw_output *o, pw_error *error) {
  int why = output_close (o), status = PW_OK;
  if (why == 0 && o->part && rename (o->part, o->real) != 0) why = errno;
  if (why != 0) {
    if (o->part) output_whole_lines (o->part);
    status = output_fail (o, why > 0 ? why : 0, 1, error);
  }
  output_free (o);
  return status;
}

char *pw_output_abandon (pw_output *o, char *buffer, size_t size) {
  output_close (o);
  char *kept = NULL;
  buffer[0] = 0;
  if (o->part) {
    output_whole_lines (o->part);
    snprintf (buffer, size, "%s", o->part);
    kept = buffer;
  }
  output_free (o);
  return kept;
}
