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
  int there;  /* 1: continued, with something in it */
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

/* Finds out where it goes. */
static int output_place (pw_output *o, pw_error *error) {
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
  return PW_OK;
}

static int output_open_file (pw_output *o, pw_error *error) {
  if (output_place (o, error) != PW_OK) return error->status;
  o->stream = fopen (o->part ? o->part : o->real, "w");
  if (o->stream) return PW_OK;
  return pw_fail (error, PW_MACHINE, "cannot write %s: %s", o->path, strerror (errno));
}

static pw_output *output_new (const char *path, pw_error *error) {
  pw_output *o = calloc (1, sizeof *o);
  if (o) o->path = strdup (path);
  if (o && o->path && *path) return o;
  if (o && o->path)
    pw_fail (error, PW_INPUT, "the name of a file to write is empty");
  else
    pw_fail (error, PW_MACHINE, "out of memory");
  output_free (o);
  return NULL;
}

pw_output *pw_output_open (const char *path, pw_error *error) {
  pw_output *o = output_new (path, error);
  if (o == NULL) return NULL;
  if (strcmp (path, "-") == 0) {
    o->stream = stdout;
    return o;
  }
  if (output_open_file (o, error) == PW_OK) return o;
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

void pw_output_discard (pw_output *o) {
  output_close (o);
  if (o->part) remove (o->part);
  output_free (o);
}

/* ---- Going on where another process was stopped ---- */

unsigned long long pw_check_sum (unsigned long long sum, const void *bytes, size_t count) {
  const unsigned char *c = bytes;
  for (size_t i = 0; i < count; i++) sum = ((sum ^ c[i]) * 1099511628211u) & 0xffffffffffffffffu;
  return sum;
}

/* The check sum of the last 64 kB before `length`; PW_RETRY if there are not so many bytes. */
static int output_check (FILE *f, pw_mark *mark) {
  char bytes[4096];
  unsigned long long from = mark->length > 65536 ? mark->length - 65536 : 0;
  mark->check = PW_CHECK;
  if (fseeko (f, (off_t)from, SEEK_SET) != 0) return PW_RETRY;
  for (unsigned long long left = mark->length - from; left > 0;) {
    size_t want = left < sizeof bytes ? (size_t)left : sizeof bytes;
    if (fread (bytes, 1, want, f) != want) return PW_RETRY;
    mark->check = pw_check_sum (mark->check, bytes, want);
    left -= want;
  }
  return PW_OK;
}

int pw_output_continued (const pw_output *o) {
  return o->there;
}

int pw_output_sync (pw_output *o, pw_error *error) {
  errno = 0;
  if (fflush (o->stream) != 0 || ferror (o->stream) || fsync (fileno (o->stream)) != 0)
    return output_fail (o, o->why ? o->why : errno, 0, error);
  return PW_OK;
}

int pw_output_mark (pw_output *o, pw_mark *mark, pw_error *error) {
  if (o->part == NULL)
    return pw_fail (error, PW_INPUT, "%s cannot be continued: it is no regular file",
                    o->stream == stdout ? "standard output" : o->path);
  if (pw_output_sync (o, error) != PW_OK) return PW_MACHINE;
  mark->length = (unsigned long long)ftello (o->stream);
  FILE *f = fopen (o->part, "r");
  int status = f ? output_check (f, mark) : PW_RETRY;
  if (f) fclose (f);
  return status == PW_OK ? PW_OK : pw_fail (error, PW_MACHINE, "cannot read %s", o->part);
}

/* 1 if the file begins with what was marked; it is left open in o->stream. */
static int output_is_marked (pw_output *o, const char *path, const pw_mark *mark) {
  pw_mark now = { .length = mark->length };
  if (o->stream) fclose (o->stream);
  o->stream = fopen (path, "r+");
  return o->stream && output_check (o->stream, &now) == PW_OK && now.check == mark->check;
}

/* A process that was killed right after its table was complete has left it under its own name. */
static int output_reopen (pw_output *o, const pw_mark *mark, pw_error *error) {
  if (output_place (o, error) != PW_OK) return error->status;
  if (o->part == NULL) return pw_fail (error, PW_INPUT, "cannot continue %s: it is no regular file", o->path);
  int good = output_is_marked (o, o->part, mark), absent = o->stream == NULL && errno == ENOENT;
  if (absent && output_is_marked (o, o->real, mark)) good = rename (o->real, o->part) == 0;
  if (!good && absent && o->stream == NULL)
    return pw_fail (error, PW_INPUT, "cannot continue %s: there is no %s", o->path, o->part);
  if (!good)
    return pw_fail (error, PW_INPUT, "cannot continue %s: %s is not the table that the checkpoint belongs to", o->path,
                    absent ? "it" : o->part);
  if (fseeko (o->stream, (off_t)mark->length, SEEK_SET) == 0 &&
      ftruncate (fileno (o->stream), (off_t)mark->length) == 0)
    return PW_OK;
  return pw_fail (error, PW_MACHINE, "cannot write %s: %s", o->part, strerror (errno));
}

pw_output *pw_output_continue (const char *path, const pw_mark *mark, pw_error *error) {
  pw_output *o = output_new (path, error);
  if (o && output_reopen (o, mark, error) == PW_OK) {
    o->there = 1;
    return o;
  }
  if (o && o->stream) fclose (o->stream);
  output_free (o);
  return NULL;
}
