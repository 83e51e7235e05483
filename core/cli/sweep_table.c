/* Tables and parts in the order of the grid: put together under another name, then renamed, then the journal goes.
 * Killed anywhere between, the same command finds the journal complete and writes the same bytes again. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "sweep.h"

/* ---- Writing ---- */

typedef struct {
  const char *path;
  const char *journal; /* where all rows are, or NULL */
  char *temporary;
  FILE *stream;
} table_file;

char *pw_table_path (const char *path, pw_error *error) {
  struct stat info;
  int there = stat (path, &info) == 0, why = 0;
  if (there && !S_ISREG (info.st_mode)) {
    pw_fail (error, PW_MACHINE, "cannot write %s: a sweep needs a regular file, next to which it keeps its journal",
             path);
    return NULL;
  }
  if (there && access (path, W_OK) != 0) why = errno;
  char *real = why ? NULL : there ? realpath (path, NULL) : strdup (path);
  if (real == NULL) pw_fail (error, PW_MACHINE, "cannot write %s: %s", path, strerror (why ? why : errno));
  return real;
}

static int table_fail (const table_file *f, int why, pw_error *error) {
  const char *reason = why ? strerror (why) : "a write failed";
  if (f->journal == NULL) return pw_fail (error, PW_MACHINE, "cannot write %s: %s", f->path, reason);
  return pw_fail (error, PW_MACHINE,
                  "cannot write %.150s: %s; all rows are in %.150s, so the same command has only to sort them", f->path,
                  reason, f->journal);
}

static int table_open (table_file *f, const char *path, const char *journal, pw_error *error) {
  size_t size = strlen (path) + sizeof ".sorted";
  *f = (table_file){ .path = path, .journal = journal, .temporary = malloc (size) };
  if (f->temporary == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  snprintf (f->temporary, size, "%s.sorted", path);
  f->stream = fopen (f->temporary, "w");
  return f->stream ? PW_OK : table_fail (f, errno, error);
}

/* Completes the file if all went well so far, else removes it. */
static int table_close (table_file *f, int status, pw_error *error) {
  errno = 0;
  int bad = f->stream && (fflush (f->stream) != 0 || ferror (f->stream) || fsync (fileno (f->stream)) != 0);
  int why = errno;
  if (f->stream && fclose (f->stream) != 0 && !bad) bad = 1, why = errno;
  if (status == PW_OK && !bad && rename (f->temporary, f->path) != 0) bad = 1, why = errno;
  if (status == PW_OK && bad) status = table_fail (f, why, error);
  if (status != PW_OK && f->stream) unlink (f->temporary);
  free (f->temporary);
  return status;
}

/* ---- How the runs ended ---- */

/* The reason is the last cell and the only one in quotes, which are doubled inside. */
static void table_reason (const pw_line *line, char *reason, size_t size) {
  const char *c = line->text, *end = line->text + line->size - 2;
  while (c < end && !(c[0] == ',' && c[1] == '"')) c++;
  size_t n = 0;
  for (c += 2; c < end && n + 1 < size; c++) {
    reason[n++] = *c;
    if (*c == '"') c++;
  }
  reason[n] = 0;
}

static void table_count (pw_tally *tally, const pw_line *line) {
  tally->rows++;
  if (line->status == 0) return;
  if (tally->failed++ > 0) return;
  tally->status = line->status;
  table_reason (line, tally->reason, sizeof tally->reason);
}

/* ---- From a journal ---- */

static int table_write (const pw_journal *j, const pw_plan *p, const pw_map *map, FILE *stream, pw_tally *tally,
                        pw_error *error) {
  const char *head = p->parts > 1 ? p->fingerprint.at : p->head.at;
  fputs (head, stream);
  if (p->parts == 1) putc ('\n', stream);
  for (long k = 0; k < j->rows; k++) {
    pw_line line;
    const char *at = map->at + j->line[k];
    if (!pw_line_read (at, map->end, &line))
      return pw_fail (error, PW_MACHINE, "%s was changed by another program", j->part);
    fwrite (p->parts > 1 ? at : line.text, 1, p->parts > 1 ? line.bytes : line.size, stream);
    table_count (tally, &line);
  }
  return PW_OK;
}

int pw_table_finish (pw_journal *j, const pw_plan *p, pw_tally *tally, pw_error *error) {
  pw_map map;
  table_file f;
  *tally = (pw_tally){ .rows = 0 };
  if (pw_map_open (&map, j->file) != PW_OK)
    return pw_fail (error, PW_MACHINE, "cannot read %s: %s", j->part, strerror (errno));
  int status = table_open (&f, j->path, j->part, error);
  if (status == PW_OK) status = table_write (j, p, &map, f.stream, tally, error);
  status = table_close (&f, status, error);
  pw_map_close (&map);
  if (status == PW_OK && unlink (j->part) != 0)
    return pw_fail (error, PW_MACHINE, "%s is complete, but %s cannot be removed: %s", j->path, j->part,
                    strerror (errno));
  return status;
}

/* ---- From parts ---- */

typedef struct {
  const char *path;
  pw_map map;
  const char *rows; /* where they begin */
  const char *at;   /* the next one */
  int part, parts;
} table_part;

/* A number of the fingerprint; -1 if it is not there. */
static long table_value (const table_part *x, const char *key, char **rest) {
  size_t size;
  const char *value = pw_fingerprint_value (x->map.at, x->rows, key, &size);
  return value ? strtol (value, rest, 10) : -1;
}

static int table_open_part (table_part *x, const char *path, pw_error *error) {
  int file = open (path, O_RDONLY | O_CLOEXEC);
  char *rest = NULL;
  x->path = path;
  if (file < 0) return pw_fail (error, PW_INPUT, "cannot open the part %s: %s", path, strerror (errno));
  int status = pw_map_open (&x->map, file), why = errno;
  close (file);
  if (status != PW_OK) return pw_fail (error, PW_INPUT, "cannot read the part %s: %s", path, strerror (why));
  x->rows = x->at = pw_fingerprint_end (PW_SWEEP_MAGIC, x->map.at, x->map.end);
  if (x->rows) x->part = (int)table_value (x, "part", &rest);
  if (rest && *rest == '/') x->parts = (int)strtol (rest + 1, NULL, 10);
  if (x->parts < 1 || x->part < 1 || x->part > x->parts)
    return pw_fail (error, PW_INPUT, "%s is no part of a sweep: parts are written by --part I/N", path);
  return PW_OK;
}

static int table_by_part (const void *a, const void *b) {
  return ((const table_part *)a)->part - ((const table_part *)b)->part;
}

/* All of one sweep, each part once. */
static int table_match (table_part *x, int count, pw_error *error) {
  char what[400];
  for (int i = 1; i < count; i++) {
    const char *words[2] = { "in the first", "in the second" };
    if (pw_fingerprint_differ (x->map.at, x->rows, x[i].map.at, x[i].rows, 0, words, what, sizeof what))
      return pw_fail (error, PW_INPUT, "%.80s and %.80s are parts of different sweeps: %.300s", x->path, x[i].path,
                      what);
    if (x[i].parts != x->parts)
      return pw_fail (error, PW_INPUT, "%.200s is one of %d parts, %.200s one of %d", x->path, x->parts, x[i].path,
                      x[i].parts);
  }
  qsort (x, (size_t)count, sizeof *x, table_by_part);
  for (int i = 0; i < count; i++) {
    if (i > 0 && x[i].part == x[i - 1].part)
      return pw_fail (error, PW_INPUT, "%.200s and %.200s are both part %d of %d", x[i - 1].path, x[i].path, x[i].part,
                      x->parts);
    if (x[i].part != i + 1) return pw_fail (error, PW_INPUT, "part %d of %d is missing", i + 1, x->parts);
  }
  if (count < x->parts) return pw_fail (error, PW_INPUT, "part %d of %d is missing", count + 1, x->parts);
  return PW_OK;
}

/* The rows in turn from each part: row r is the next one of part r mod n. */
static int table_weave (table_part *x, int count, FILE *stream, pw_tally *tally, pw_error *error) {
  size_t size = 0;
  long rows = table_value (x, "rows", &(char *){ NULL });
  const char *head = pw_fingerprint_value (x->map.at, x->rows, "columns", &size);
  if (head == NULL) return pw_fail (error, PW_INPUT, "%s has no columns: it was changed", x->path);
  fwrite (head, 1, size, stream);
  putc ('\n', stream);
  for (long r = 0; r < rows; r++) {
    pw_line line;
    table_part *from = x + r % count;
    if (!pw_line_read (from->at, from->map.end, &line) || line.row != r)
      return pw_fail (error, PW_INPUT, "%s is not complete: row %ld is missing; finish that part first", from->path,
                      r + 1);
    fwrite (line.text, 1, line.size, stream);
    from->at += line.bytes;
    table_count (tally, &line);
  }
  for (int i = 0; i < count; i++)
    if (x[i].at != x[i].map.end) return pw_fail (error, PW_INPUT, "%s has rows too many: it was changed", x[i].path);
  return PW_OK;
}

int pw_table_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error) {
  table_file f = { .path = NULL };
  *tally = (pw_tally){ .rows = 0 };
  char *real = pw_table_path (path, error);
  table_part *x = calloc ((size_t)count, sizeof *x);
  int status = real == NULL ? error->status : x == NULL ? pw_fail (error, PW_MACHINE, "out of memory") : PW_OK;
  for (int i = 0; i < count && status == PW_OK; i++) {
    struct stat a, b;
    if (stat (parts[i], &a) == 0 && stat (path, &b) == 0 && a.st_dev == b.st_dev && a.st_ino == b.st_ino)
      status = pw_fail (error, PW_INPUT, "%s is a part and would be written over", path);
    else
      status = table_open_part (x + i, parts[i], error);
  }
  if (status == PW_OK) status = table_match (x, count, error);
  if (status == PW_OK) {
    status = table_open (&f, real, NULL, error);
    if (status == PW_OK) status = table_weave (x, count, f.stream, tally, error);
    status = table_close (&f, status, error);
  }
  for (int i = 0; x && i < count; i++) pw_map_close (&x[i].map);
  free (x);
  free (real);
  return status;
}
