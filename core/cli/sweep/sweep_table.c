/* Tables and parts in the order of the grid: put together under another name, then renamed, then the journal goes.
 * Killed anywhere between, the same command finds the journal complete and writes the same bytes again. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "sweep.h"

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

/* Completes the file if all went well so far, else removes it. */
static int table_close (pw_output *o, pw_error *error) {
  if (error->status == PW_OK) pw_output_ready (o, error);
  if (error->status == PW_OK) return pw_output_finish (o, error);
  pw_output_discard (o);
  return error->status;
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
  pw_error own = { 0 };
  *tally = (pw_tally){ .rows = 0 };
  if (pw_map_open (&map, j->file) != PW_OK)
    return pw_fail (error, PW_MACHINE, "cannot read %s: %s", j->part, strerror (errno));
  pw_output *o = pw_output_open_as (j->path, ".sorted", &own);
  if (o) table_write (j, p, &map, pw_output_stream (o), tally, &own);
  if (o) table_close (o, &own);
  pw_map_close (&map);
  int status = own.status;
  if (status != PW_OK)
    pw_fail (error, status, "%.300s; all rows are in %.150s, so the same command has only to sort them", own.text,
             j->part);
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
  const char *reason;
  char *rest = NULL;
  FILE *f = pw_open_input (path, &reason);
  x->path = path;
  if (f == NULL) return pw_fail (error, PW_INPUT, "cannot open the part %s: %s", path, reason);
  int status = pw_map_open (&x->map, fileno (f)), why = errno;
  fclose (f);
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
  *tally = (pw_tally){ .rows = 0 };
  pw_output *o = NULL;
  table_part *x = calloc ((size_t)count, sizeof *x);
  int status = x ? PW_OK : pw_fail (error, PW_MACHINE, "out of memory");
  for (int i = 0; i < count && status == PW_OK; i++) {
    const pw_use use[] = { { "-o", path, PW_WRITES, NULL }, { "the part", parts[i], PW_READS, NULL } };
    status = pw_check_uses (use, 2, error);
    if (status == PW_OK) status = table_open_part (x + i, parts[i], error);
  }
  if (status == PW_OK) status = table_match (x, count, error);
  if (status == PW_OK && (o = pw_output_open_as (path, ".sorted", error)) == NULL) status = error->status;
  if (o) table_weave (x, count, pw_output_stream (o), tally, error);
  if (o) status = table_close (o, error);
  for (int i = 0; x && i < count; i++) pw_map_close (&x[i].map);
  free (x);
  return status;
}
