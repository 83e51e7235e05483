/* Journals and parts of a sweep, and the table made of them.
 *
 * A journal has rows in the order of completion, each appended by one write.  If the program is killed, the fingerprint
 * and complete lines remain, and perhaps an incomplete line, which the next start removes.  A lock excludes other
 * processes; it ends with the process.  The table is written under another name in the order of the grid and renamed,
 * then the journal is removed: killed in between, the same command finds the journal complete and writes the same bytes
 * again.
 *
 *     pinwheel sweep 1              the fingerprint: lines "KEY = VALUE"
 *     ...
 *     part = 2/4
 *     end
 *     17 0 83c1f0a2 1.5,0.05,ok,... a row's number, its run's exit status, a check sum, its line of the table */
#define _GNU_SOURCE /* asprintf */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include "fingerprint.h"
#include "sweep_journal.h"

typedef struct {
  long row;
  int status;       /* exit status of the run */
  const char *text; /* the table's line, which ends with a newline */
  size_t size;      /* its bytes, the newline included */
  size_t bytes;     /* of the whole line */
} journal_line;

/* A file in memory, read only. */
typedef struct {
  char *at, *end;
} journal_map;

/* ---- Lines ---- */

/* FNV-1a (Fowler, Noll, Vo) of a row's number, status and text. */
static uint32_t journal_line_sum (long row, int status, const char *text, size_t size) {
  uint32_t h = 2166136261u;
  for (int i = 0; i < 32; i += 8) h = (h ^ (((uint32_t)row >> i) & 255)) * 16777619u;
  h = (h ^ (uint32_t)status) * 16777619u;
  for (size_t i = 0; i < size; i++) h = (h ^ (unsigned char)text[i]) * 16777619u;
  return h;
}

static void journal_line_add (pw_text *t, long row, int status, const char *text) {
  char front[60];
  size_t n = strlen (text);
  snprintf (front, sizeof front, "%ld %d %08lx ", row, status, (unsigned long)journal_line_sum (row, status, text, n));
  pw_text_add (t, front);
  pw_text_add_bytes (t, text, n);
  pw_text_add (t, "\n");
}

static int journal_line_read (const char *at, const char *end, journal_line *line) {
  const char *newline = at < end ? memchr (at, '\n', (size_t)(end - at)) : NULL;
  char front[40];
  int n = 0;
  unsigned long sum;
  if (newline == NULL) return 0;
  snprintf (front, sizeof front, "%.*s", (int)(newline - at < 39 ? newline - at : 39), at);
  if (sscanf (front, "%10ld %1d %8lx %n", &line->row, &line->status, &sum, &n) != 3 || n == 0) return 0;
  line->text = at + n;
  line->size = (size_t)(newline + 1 - line->text);
  line->bytes = (size_t)(newline + 1 - at);
  return line->row >= 0 && line->status >= 0 && line->status <= 4 &&
         journal_line_sum (line->row, line->status, line->text, line->size - 1) == (uint32_t)sum;
}

static int journal_map_open (journal_map *m, int file) {
  struct stat info;
  *m = (journal_map){ "", "" };
  m->end = m->at;
  if (fstat (file, &info) != 0) return PW_RESOURCE;
  if (info.st_size == 0) return PW_OK;
  void *at = mmap (NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, file, 0);
  if (at == MAP_FAILED) return PW_RESOURCE;
  m->at = at;
  m->end = m->at + info.st_size;
  return PW_OK;
}

static void journal_map_close (journal_map *m) {
  if (m->end > m->at) munmap (m->at, (size_t)(m->end - m->at));
  *m = (journal_map){ NULL, NULL };
}

/* ---- The journal ---- */

/* Appends a text, all or nothing. */
static int journal_write (pw_journal *j, const char *text, size_t size, pw_error *error) {
  size_t done = 0;
  while (done < size) {
    ssize_t n = pwrite (j->file, text + done, size - done, j->size + (off_t)done);
    if (n <= 0) {
      const char *why = n < 0 ? strerror (errno) : "no bytes were taken";
      if (done > 0 && ftruncate (j->file, j->size) != 0) why = "no room"; /* the next start removes it */
      return pw_fail (error, PW_RESOURCE, "cannot write %s: %s; the same command will continue after its %ld rows",
                      j->part, why, j->done);
    }
    done += (size_t)n;
  }
  j->size += (off_t)size;
  return PW_OK;
}

/* Records each line; stops at the first that is incomplete, damaged, a duplicate or of another part. */
static void journal_rows (pw_journal *j, const pw_plan *p, const journal_map *map, const char *at) {
  journal_line line;
  for (; journal_line_read (at, map->end, &line); at += line.bytes) {
    long k = line.row / p->parts;
    if (line.row % p->parts != p->part - 1 || k >= j->rows || j->line[k] != 0) break;
    j->line[k] = (off_t)(at - map->at);
    j->done++;
  }
  j->size = (off_t)(at - map->at);
}

static int journal_read (pw_journal *j, const pw_plan *p, const journal_map *map, pw_error *error) {
  char what[400];
  size_t size = (size_t)(map->end - map->at), magic = strlen (PW_SWEEP_MAGIC);
  const char *rows = pw_fingerprint_end (PW_SWEEP_MAGIC, map->at, map->end), *own = p->fingerprint.chars;
  j->size = 0;
  if (rows == NULL) { /* with an incomplete fingerprint there are no rows */
    if (memcmp (map->at, PW_SWEEP_MAGIC, size < magic ? size : magic) == 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "%s exists and is not the journal of a sweep: remove it if it is not needed",
                    j->part);
  }
  const pw_fingerprint there = { map->at, rows, "there" }, here = { own, own + p->fingerprint.length, "here" };
  if (pw_fingerprint_differ (there, here, NULL, what, sizeof what))
    return pw_fail (error, PW_INPUT,
                    "%.80s belongs to another sweep: %.300s; finish that one with its own command, or remove the file",
                    j->part, what);
  journal_rows (j, p, map, rows);
  return PW_OK;
}

static int journal_begin (pw_journal *j, const pw_plan *p, pw_error *error) {
  journal_map map;
  if (journal_map_open (&map, j->file) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", j->part, strerror (errno));
  int status = journal_read (j, p, &map, error);
  off_t there = (off_t)(map.end - map.at);
  journal_map_close (&map);
  if (status != PW_OK) return status;
  if (there > j->size && ftruncate (j->file, j->size) != 0)
    return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", j->part, strerror (errno));
  j->created = j->size == 0;
  return j->created ? journal_write (j, p->fingerprint.chars, p->fingerprint.length, error) : PW_OK;
}

int pw_journal_open (pw_journal *j, const pw_plan *p, const char *path, pw_error *error) {
  *j = (pw_journal){ .file = -1, .rows = pw_plan_rows (p) };
  j->path = pw_output_path (path, error);
  if (j->path == NULL) return error->status;
  if (asprintf (&j->part, "%s.part", j->path) < 0) j->part = NULL;
  j->line = calloc ((size_t)j->rows + 1, sizeof *j->line);
  if (j->part == NULL || j->line == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory for a sweep of %ld rows", j->rows);
  j->file = pw_lock_path (j->part, error);
  return j->file >= 0 ? journal_begin (j, p, error) : error->status;
}

int pw_journal_add (pw_journal *j, const pw_plan *p, long row, int status, const char *cells, pw_error *error) {
  off_t at = j->size;
  pw_text_clear (&j->text);
  journal_line_add (&j->text, row, status, cells);
  if (j->text.failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (journal_write (j, j->text.chars, j->text.length, error) != PW_OK) return error->status;
  j->line[row / p->parts] = at;
  j->done++;
  return PW_OK;
}

void pw_journal_close (pw_journal *j) {
  if (j->created && j->done == 0 && j->file >= 0) unlink (j->part);
  if (j->file >= 0) close (j->file);
  pw_text_free (&j->text);
  free (j->line);
  free (j->part);
  free (j->path);
  *j = (pw_journal){ .file = -1 };
}

/* ---- The table of a journal ---- */

/* The reason is the last cell and the only one in quotes, which are doubled inside. */
static void table_reason (const journal_line *line, char *reason, size_t size) {
  const char *c = line->text, *end = line->text + line->size - 2;
  while (c < end && !(c[0] == ',' && c[1] == '"')) c++;
  size_t n = 0;
  for (c += 2; c < end && n + 1 < size; c++) {
    reason[n++] = *c;
    if (*c == '"') c++;
  }
  reason[n] = 0;
}

/* Writes the line of a row, to a part the whole line, and returns its bytes; 0 if it is not there. */
static size_t table_row (FILE *stream, const char *at, const char *end, long row, int whole, pw_tally *tally) {
  journal_line line;
  if (!journal_line_read (at, end, &line) || line.row != row) return 0;
  fwrite (whole ? at : line.text, 1, whole ? line.bytes : line.size, stream);
  tally->rows++;
  if (line.status == 0 || tally->failed++ > 0) return line.bytes;
  tally->status = line.status;
  table_reason (&line, tally->reason, sizeof tally->reason);
  return line.bytes;
}

/* Completes the file if all went well so far, else removes it. */
static int table_close (pw_output *o, pw_error *error) {
  if (error->status == PW_OK) return pw_output_finish (o, error);
  pw_output_discard (o);
  return error->status;
}

static int table_write (const pw_journal *j, const pw_plan *p, const journal_map *map, FILE *stream, pw_tally *tally,
                        pw_error *error) {
  int is_part = p->parts > 1;
  fputs (is_part ? p->fingerprint.chars : p->head.chars, stream);
  if (!is_part) putc ('\n', stream);
  for (long k = 0; k < j->rows; k++)
    if (!table_row (stream, map->at + j->line[k], map->end, p->part - 1 + k * p->parts, is_part, tally))
      return pw_fail (error, PW_RESOURCE, "%s was changed by another program", j->part);
  return PW_OK;
}

int pw_sweep_finish (pw_journal *j, const pw_plan *p, pw_tally *tally, pw_error *error) {
  journal_map map;
  pw_error own = { 0 };
  *tally = (pw_tally){ .rows = 0 };
  if (journal_map_open (&map, j->file) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", j->part, strerror (errno));
  pw_output *o = pw_output_open_as (j->path, ".sorted", &own);
  if (o) table_write (j, p, &map, pw_output_stream (o), tally, &own);
  if (o) table_close (o, &own);
  journal_map_close (&map);
  if (own.status != PW_OK)
    return pw_fail (error, own.status, "%.300s; all rows are in %.150s, so the same command only has to sort them",
                    own.text, j->part);
  if (unlink (j->part) == 0) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "%s is complete, but %s cannot be removed: %s", j->path, j->part,
                  strerror (errno));
}

/* ---- The table of all parts ---- */

typedef struct {
  const char *path;
  journal_map map;
  const char *rows; /* the first one */
  const char *at;   /* the next one */
  int part, parts;
} table_part;

static int table_open_part (table_part *x, const char *path, pw_error *error) {
  const char *reason;
  char numbers[40] = "";
  size_t size;
  FILE *f = pw_open_input (path, &reason);
  x->path = path;
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot open the part %s: %s", path, reason);
  int status = journal_map_open (&x->map, fileno (f)), why = errno;
  fclose (f);
  if (status != PW_OK) return pw_fail (error, PW_RESOURCE, "cannot read the part %s: %s", path, strerror (why));
  x->rows = x->at = pw_fingerprint_end (PW_SWEEP_MAGIC, x->map.at, x->map.end);
  const char *part = x->rows ? pw_fingerprint_value (x->map.at, x->rows, "part", &size) : NULL;
  if (part)
    snprintf (numbers, sizeof numbers, "%.*s", (int)(size < 39 ? size : 39), part); /* a map is not terminated */
  if (sscanf (numbers, "%9d/%9d", &x->part, &x->parts) != 2 || x->parts < 1 || x->part < 1 || x->part > x->parts)
    return pw_fail (error, PW_INPUT, "%s is not a part of a sweep: parts are written by --part I/N", path);
  return PW_OK;
}

static int table_by_part (const void *a, const void *b) {
  return ((const table_part *)a)->part - ((const table_part *)b)->part;
}

/* All of one sweep, each part once. */
static int table_match (table_part *x, int count, pw_error *error) {
  char what[400];
  for (int i = 1; i < count; i++) {
    const pw_fingerprint first = { x->map.at, x->rows, "in the first" },
                         second = { x[i].map.at, x[i].rows, "in the second" };
    if (pw_fingerprint_differ (first, second, "part", what, sizeof what))
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

/* The rows, taken from the parts in turn: row r is the next one of part r mod n. */
static int table_merge (table_part *x, int count, FILE *stream, pw_tally *tally, pw_error *error) {
  size_t size = 0;
  const char *value = pw_fingerprint_value (x->map.at, x->rows, "rows", &size);
  const char *head = pw_fingerprint_value (x->map.at, x->rows, "columns", &size);
  if (value == NULL || head == NULL)
    return pw_fail (error, PW_INPUT, "%s has no number of rows or no columns: it was changed", x->path);
  long rows = strtol (value, NULL, 10);
  fwrite (head, 1, size, stream);
  putc ('\n', stream);
  for (long r = 0; r < rows; r++) {
    table_part *from = x + r % count;
    size_t bytes = table_row (stream, from->at, from->map.end, r, 0, tally);
    if (bytes == 0)
      return pw_fail (error, PW_INPUT, "%s is not complete: row %ld is missing; finish that part first", from->path,
                      r + 1);
    from->at += bytes;
  }
  for (int i = 0; i < count; i++)
    if (x[i].at != x[i].map.end) return pw_fail (error, PW_INPUT, "%s has too many rows: it was changed", x[i].path);
  return PW_OK;
}

int pw_sweep_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error) {
  *tally = (pw_tally){ .rows = 0 };
  pw_output *o = NULL;
  table_part *x = calloc ((size_t)count, sizeof *x);
  int status = x ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < count && status == PW_OK; i++) {
    const pw_use use[] = { { "-o", path, PW_WRITES, NULL }, { "the part", parts[i], PW_READS, NULL } };
    status = pw_check_paths (use, 2, error);
    if (status == PW_OK) status = table_open_part (x + i, parts[i], error);
  }
  if (status == PW_OK) status = table_match (x, count, error);
  if (status == PW_OK && (o = pw_output_open_as (path, ".sorted", error)) == NULL) status = error->status;
  if (o) table_merge (x, count, pw_output_stream (o), tally, error);
  if (o) status = table_close (o, error);
  for (int i = 0; x && i < count; i++) journal_map_close (&x[i].map);
  free (x);
  return status;
}
