/* Journals and parts of a sweep, and the table made of them.
 *
 * A journal has rows in the order of completion, each appended by one write.  If the program is killed, the fingerprint
 * and complete lines remain, and perhaps an incomplete line.  The next start removes the first line that is incomplete
 * or damaged, and all after it, whose rows are computed again.  A lock excludes other processes; it ends with the
 * process.  The table is written under another name in the order of the grid and renamed, then the journal is removed:
 * if the program is killed in between, the same command finds the journal complete and writes the same bytes again.
 * The file of a part, which is written like a table, has the fingerprint and the lines of its journal in the order of
 * the grid.
 *
 *     pinwheel sweep 2              the fingerprint: lines "KEY = VALUE"
 *     ...
 *     part = 2/4
 *     end
 *     17 0 83c1f0a2 1.5,0.05,ok,... a row's number, its run's exit status, a checksum, its line of the table */
#define _GNU_SOURCE /* asprintf */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include "sweep_journal.h"

typedef struct {
  long row;         /* its number in the grid */
  int status;       /* exit status of the run */
  const char *text; /* the table's line, which ends with a newline */
  size_t text_size; /* bytes of that line, the newline included */
  size_t line_size; /* bytes of the journal's line, the newline included */
} journal_line;

/* A file in memory, read only, and not ended by 0. */
typedef struct {
  char *begin, *end;
} journal_map;

/* Of a row's number, status and text. */
static unsigned long journal_checksum (long row, int status, const char *text, size_t size) {
  const char *front = PW_PRINTED (40, "%ld %d ", row, status);
  return pw_check_sum (pw_check_sum (PW_CHECK, front, strlen (front)), text, size) & 0xffffffff;
}

/* Reads the line that begins here; 0 if it is incomplete or damaged. */
static int journal_line_read (const char *begin, const char *end, journal_line *line) {
  const char *newline = begin < end ? memchr (begin, '\n', (size_t)(end - begin)) : NULL;
  int n = 0; /* bytes up to the line of the table */
  unsigned long checksum;
  if (newline == NULL) return 0;
  if (sscanf (PW_PART (begin, (size_t)(newline - begin)), "%10ld %1d %8lx %n", &line->row, &line->status, &checksum,
              &n) != 3 ||
      n == 0)
    return 0;
  line->text = begin + n;
  line->text_size = (size_t)(newline + 1 - line->text);
  line->line_size = (size_t)(newline + 1 - begin);
  return line->row >= 0 && line->status >= 0 && line->status <= 4 &&
         journal_checksum (line->row, line->status, line->text, line->text_size - 1) == checksum;
}

static int journal_map_open (journal_map *map, int descriptor) {
  struct stat info;
  map->begin = map->end = "";
  if (fstat (descriptor, &info) != 0) return PW_RESOURCE;
  if (info.st_size == 0) return PW_OK;
  void *bytes = mmap (NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (bytes == MAP_FAILED) return PW_RESOURCE;
  map->begin = bytes;
  map->end = map->begin + info.st_size;
  return PW_OK;
}

static void journal_map_close (journal_map *map) {
  if (map->end > map->begin) munmap (map->begin, (size_t)(map->end - map->begin));
  *map = (journal_map){ NULL, NULL };
}

/* Appends a text to the journal, all or nothing. */
static int journal_write (pw_journal *journal, const char *text, size_t size, pw_error *error) {
  size_t done = 0;
  while (done < size) {
    ssize_t n = pwrite (journal->descriptor, text + done, size - done, journal->size + (off_t)done);
    if (n <= 0) {
      const char *why = n < 0 ? strerror (errno) : "nothing was written";
      int removed = done == 0 || ftruncate (journal->descriptor, journal->size) == 0;
      (void)removed; /* if not, the next start removes the incomplete line */
      return pw_fail (error, PW_RESOURCE, "cannot write %s: %s; the same command will continue after its %ld rows",
                      journal->path, why, journal->done);
    }
    done += (size_t)n;
  }
  journal->size += (off_t)size;
  return PW_OK;
}

/* Verifies that the journal is one of this sweep, and reads its rows; journal->size is where the next row goes. */
static int journal_read (pw_journal *journal, const journal_map *map, pw_error *error) {
  char difference[400];
  size_t size = (size_t)(map->end - map->begin), magic_size = strlen (PW_SWEEP_MAGIC);
  const char *rows = pw_fingerprint_end (PW_SWEEP_MAGIC, map->begin, map->end), *own = journal->fingerprint->text;
  journal->size = 0;
  if (rows == NULL) { /* with an incomplete fingerprint there are no rows */
    if (memcmp (map->begin, PW_SWEEP_MAGIC, size < magic_size ? size : magic_size) == 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "%s exists and is not the journal of a sweep: remove it if it is not needed",
                    journal->path);
  }
  const pw_fingerprint there = { map->begin, rows, "there" };
  const pw_fingerprint here = { own, own + journal->fingerprint->size, "here" };
  if (pw_fingerprint_differ (there, here, NULL, difference, sizeof difference))
    return pw_fail (error, PW_INPUT,
                    "%.80s belongs to another sweep: %.300s; finish that one with its own command, or remove the file",
                    journal->path, difference);
  journal_line line; /* until one that is incomplete, damaged, a duplicate or of another part */
  for (; journal_line_read (rows, map->end, &line); rows += line.line_size) {
    long k = line.row / journal->parts;
    if (line.row % journal->parts != journal->part - 1 || k >= journal->rows || journal->offset[k] != 0) break;
    journal->offset[k] = (off_t)(rows - map->begin);
    journal->done++;
  }
  journal->size = (off_t)(rows - map->begin);
  return PW_OK;
}

static int journal_begin (pw_journal *journal, pw_error *error) {
  journal_map map;
  if (journal_map_open (&map, journal->descriptor) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", journal->path, strerror (errno));
  int status = journal_read (journal, &map, error);
  off_t file_size = (off_t)(map.end - map.begin);
  journal_map_close (&map);
  if (status != PW_OK) return status;
  if (file_size > journal->size && ftruncate (journal->descriptor, journal->size) != 0)
    return pw_fail (error, PW_RESOURCE, "cannot write %s: %s", journal->path, strerror (errno));
  journal->begun = journal->size == 0;
  if (!journal->begun) return PW_OK;
  return journal_write (journal, journal->fingerprint->text, journal->fingerprint->size, error);
}

int pw_journal_open (pw_journal *journal, const char *path, long rows, int part, int parts,
                     const pw_stream *fingerprint, pw_error *error) {
  *journal = (pw_journal){ .part = part,
                           .parts = parts,
                           .fingerprint = fingerprint,
                           .descriptor = -1,
                           .rows = rows / parts + (rows % parts >= part) };
  journal->table_path = pw_output_path (path, error);
  if (journal->table_path == NULL) return error->status;
  if (asprintf (&journal->path, "%s.part", journal->table_path) < 0) journal->path = NULL;
  journal->offset = calloc ((size_t)journal->rows + 1, sizeof *journal->offset);
  if (journal->path == NULL || journal->offset == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory for a sweep of %ld rows", journal->rows);
  journal->descriptor = pw_lock_path (journal->path, error);
  return journal->descriptor >= 0 ? journal_begin (journal, error) : error->status;
}

int pw_journal_add (pw_journal *journal, long row, int status, const char *text, pw_error *error) {
  const off_t at = journal->size;
  char *line;
  const int size =
      asprintf (&line, "%ld %d %08lx %s\n", row, status, journal_checksum (row, status, text, strlen (text)), text);
  if (size < 0) return pw_fail (error, PW_RESOURCE, "out of memory");
  status = journal_write (journal, line, (size_t)size, error);
  free (line);
  if (status != PW_OK) return status;
  journal->offset[row / journal->parts] = at;
  journal->done++;
  return PW_OK;
}

int pw_journal_lacks (const pw_journal *journal, long row) {
  return row % journal->parts == journal->part - 1 && journal->offset[row / journal->parts] == 0;
}

void pw_journal_close (pw_journal *journal) {
  if (journal->begun && journal->done == 0 && journal->descriptor >= 0) unlink (journal->path);
  if (journal->descriptor >= 0) close (journal->descriptor);
  free (journal->offset);
  free (journal->path);
  free (journal->table_path);
  *journal = (pw_journal){ .descriptor = -1 };
}

/* Reads the line of a row, and counts how its run ended; 0 if it is another line. */
static int table_read_row (const char *at, const char *end, long row, journal_line *line, pw_tally *tally) {
  if (!journal_line_read (at, end, line) || line->row != row) return 0;
  tally->rows++;
  if (line->status == 0 || tally->failed++ > 0) return 1;
  tally->status = line->status;
  /* the reason is the last cell and the only one in quotes, which are doubled inside */
  const char *c = line->text, *last = line->text + line->text_size - 2;
  while (c < last && !(c[0] == ',' && c[1] == '"')) c++;
  size_t n = 0;
  for (c += 2; c < last && n + 1 < sizeof tally->reason; c++) {
    tally->reason[n++] = *c;
    if (*c == '"') c++;
  }
  tally->reason[n] = 0;
  return 1;
}

/* Completes the file if there is no error so far, else removes it. */
static int table_close (pw_output *output, pw_error *error) {
  if (error->status == PW_OK) return pw_output_finish (output, error);
  pw_output_discard (output);
  return error->status;
}

/* What table_write needs. */
typedef struct {
  const pw_journal *journal;
  const journal_map *map;
  const pw_stream *heading;
  pw_journal_visit *visit;
  void *context;
  pw_tally *tally;
  pw_error *error; /* if the journal was changed */
} table_source;

static void table_write (const void *context, pw_cells *cells) {
  const table_source *x = context;
  FILE *f = cells->f;
  const pw_journal *journal = x->journal;
  const int is_part = journal->parts > 1;
  fprintf (f, is_part ? "%s" : "%s\n", is_part ? journal->fingerprint->text : x->heading->text);
  for (long k = 0; k < journal->rows; k++) {
    const char *at = x->map->begin + journal->offset[k];
    journal_line line;
    if (!table_read_row (at, x->map->end, journal->part - 1 + k * journal->parts, &line, x->tally)) {
      pw_fail (x->error, PW_RESOURCE, "%s was changed by another program", journal->path);
      return;
    }
    fwrite (is_part ? at : line.text, 1, is_part ? line.line_size : line.text_size, f);
    if (x->visit) x->visit (x->context, k, line.text);
  }
}

int pw_journal_finish (pw_journal *journal, const pw_stream *heading, pw_journal_visit *visit, void *context,
                       pw_tally *tally, pw_error *error) {
  journal_map map;
  pw_error failure = { 0 };
  *tally = (pw_tally){ .rows = 0 };
  if (journal_map_open (&map, journal->descriptor) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", journal->path, strerror (errno));
  pw_output *output = pw_output_open_as (journal->table_path, ".sorted", &failure);
  const table_source source = { journal, &map, heading, visit, context, tally, &failure };
  if (output) pw_cli_write_table (journal->table_path, pw_output_stream (output), &source, table_write, &failure);
  if (output) table_close (output, &failure);
  journal_map_close (&map);
  if (failure.status != PW_OK)
    return pw_fail (error, failure.status, "%.300s; all rows are in %.150s, so the same command only has to sort them",
                    failure.text, journal->path);
  if (unlink (journal->path) == 0) return PW_OK;
  return pw_fail (error, PW_RESOURCE, "%s is complete, but %s cannot be removed: %s", journal->table_path,
                  journal->path, strerror (errno));
}

typedef struct {
  const char *path;
  journal_map map;
  const char *first_row, *next_row; /* the lines of these rows */
  int number, parts;                /* part I of N */
} table_part;

static int table_open_part (table_part *part, const char *path, pw_error *error) {
  const char *reason;
  size_t size = 0;
  FILE *f = pw_open_input (path, &reason);
  part->path = path;
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot open the part %s: %s", path, reason);
  int status = journal_map_open (&part->map, fileno (f)), why = errno;
  fclose (f);
  if (status != PW_OK) return pw_fail (error, PW_RESOURCE, "cannot read the part %s: %s", path, strerror (why));
  part->first_row = part->next_row = pw_fingerprint_end (PW_SWEEP_MAGIC, part->map.begin, part->map.end);
  const char *value = part->first_row ? pw_fingerprint_value (part->map.begin, part->first_row, "part", &size) : NULL;
  if (sscanf (PW_PART (value ? value : "", size), "%9d/%9d", &part->number, &part->parts) != 2 || part->parts < 1 ||
      part->number < 1 || part->number > part->parts)
    return pw_fail (error, PW_INPUT, "%s is not a part of a sweep: parts are written by --part I/N", path);
  return PW_OK;
}

static int table_by_part (const void *a, const void *b) {
  return ((const table_part *)a)->number - ((const table_part *)b)->number;
}

/* Sorts the parts; they must be all those of one sweep, each of them once. */
static int table_match_parts (table_part *part, int count, pw_error *error) {
  char difference[400];
  for (int i = 1; i < count; i++) {
    const pw_fingerprint first = { part[0].map.begin, part[0].first_row, "in the first" };
    const pw_fingerprint second = { part[i].map.begin, part[i].first_row, "in the second" };
    if (pw_fingerprint_differ (first, second, "part", difference, sizeof difference))
      return pw_fail (error, PW_INPUT, "%.80s and %.80s are parts of different sweeps: %.300s", part[0].path,
                      part[i].path, difference);
    if (part[i].parts != part[0].parts)
      return pw_fail (error, PW_INPUT, "%.200s is one of %d parts, %.200s one of %d", part[0].path, part[0].parts,
                      part[i].path, part[i].parts);
  }
  qsort (part, (size_t)count, sizeof *part, table_by_part);
  for (int i = 0; i < count; i++) {
    if (i > 0 && part[i].number == part[i - 1].number)
      return pw_fail (error, PW_INPUT, "%.200s and %.200s are both part %d of %d", part[i - 1].path, part[i].path,
                      part[i].number, part[0].parts);
    if (part[i].number != i + 1) return pw_fail (error, PW_INPUT, "part %d of %d is missing", i + 1, part[0].parts);
  }
  if (count < part[0].parts) return pw_fail (error, PW_INPUT, "part %d of %d is missing", count + 1, part[0].parts);
  return PW_OK;
}

/* Writes the table from sorted parts: row r is the next one of part[r % count]. */
static int table_merge (table_part *part, int count, FILE *stream, pw_tally *tally, pw_error *error) {
  size_t size = 0;
  const char *rows_value = pw_fingerprint_value (part->map.begin, part->first_row, "rows", &size);
  const char *heading = pw_fingerprint_value (part->map.begin, part->first_row, "columns", &size);
  if (rows_value == NULL || heading == NULL)
    return pw_fail (error, PW_INPUT, "%s has no number of rows or no columns: it was changed", part->path);
  long rows = strtol (rows_value, NULL, 10);
  fwrite (heading, 1, size, stream);
  putc ('\n', stream);
  for (long r = 0; r < rows; r++) {
    table_part *source = part + r % count;
    journal_line line;
    if (!table_read_row (source->next_row, source->map.end, r, &line, tally))
      return pw_fail (error, PW_INPUT, "%s is not complete: row %ld is missing; finish that part first", source->path,
                      r + 1);
    fwrite (line.text, 1, line.text_size, stream);
    source->next_row += line.line_size;
  }
  for (int i = 0; i < count; i++)
    if (part[i].next_row != part[i].map.end)
      return pw_fail (error, PW_INPUT, "%s has too many rows: it was changed", part[i].path);
  return PW_OK;
}

int pw_journal_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error) {
  *tally = (pw_tally){ .rows = 0 };
  pw_output *output = NULL;
  table_part *part = calloc ((size_t)count, sizeof *part);
  int status = part ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < count && status == PW_OK; i++) {
    const pw_use use[] = { { "-o", path, PW_WRITES, pw_cli_csv }, { "the part", parts[i], PW_READS, NULL } };
    status = pw_check_paths (use, 2, error);
    if (status == PW_OK) status = pw_cli_check_format (use, error);
    if (status == PW_OK) status = table_open_part (part + i, parts[i], error);
  }
  if (status == PW_OK) status = table_match_parts (part, count, error);
  if (status == PW_OK && (output = pw_output_open_as (path, ".sorted", error)) == NULL) status = error->status;
  if (output) table_merge (part, count, pw_output_stream (output), tally, error);
  if (output) status = table_close (output, error);
  for (int i = 0; part && i < count; i++) journal_map_close (&part[i].map);
  free (part);
  return status;
}
