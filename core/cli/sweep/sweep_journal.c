/* The journal of a sweep: rows as they are finished, each by one write of one line behind the last.
 *
 * Whenever the program is killed, what is there is the fingerprint, whole lines, and perhaps the beginning of one more,
 * which the next start cuts off.  A lock keeps a second process out; it ends with the process that holds it. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "sweep.h"

/* ---- Opening ---- */

/* Writes behind what is there, all or nothing. */
static int journal_write (pw_journal *j, const char *text, size_t size, pw_error *error) {
  size_t done = 0;
  while (done < size) {
    ssize_t n = pwrite (j->file, text + done, size - done, j->size + (off_t)done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const char *why = n < 0 ? strerror (errno) : "no bytes were taken";
      if (done > 0 && ftruncate (j->file, j->size) != 0) why = "no room"; /* the next start cuts it off */
      return pw_fail (error, PW_MACHINE, "cannot write %s: %s; the same command will go on after its %ld rows", j->part,
                      why, j->done);
    }
    done += (size_t)n;
  }
  j->size += (off_t)size;
  return PW_OK;
}

/* Notes each line that is whole, sound, of this part and not there already; stops at the first that is not. */
static void journal_rows (pw_journal *j, const pw_plan *p, const pw_map *map, const char *at) {
  pw_line line;
  for (; pw_line_read (at, map->end, &line); at += line.bytes) {
    long k = line.row / p->parts;
    if (line.row % p->parts != p->part - 1 || k >= j->rows || j->line[k] != 0) break;
    j->line[k] = (off_t)(at - map->at);
    j->done++;
  }
  j->size = (off_t)(at - map->at);
}

static int journal_read (pw_journal *j, const pw_plan *p, const pw_map *map, pw_error *error) {
  static const char *words[2] = { "there", "here" };
  char what[400];
  size_t size = (size_t)(map->end - map->at), magic = strlen (PW_SWEEP_MAGIC);
  const char *rows = pw_fingerprint_end (PW_SWEEP_MAGIC, map->at, map->end), *own = p->fingerprint.at;
  j->size = 0;
  if (rows == NULL) { /* a beginning of a fingerprint has no rows to lose */
    if (memcmp (map->at, PW_SWEEP_MAGIC, size < magic ? size : magic) == 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "%s is there already and is no journal of a sweep: remove it if it is not needed",
                    j->part);
  }
  if (pw_fingerprint_differ (map->at, rows, own, own + p->fingerprint.used, 1, words, what, sizeof what))
    return pw_fail (error, PW_INPUT,
                    "%.80s belongs to another sweep: %.300s; finish that one with its own command, or remove the file",
                    j->part, what);
  journal_rows (j, p, map, rows);
  return PW_OK;
}

static int journal_begin (pw_journal *j, const pw_plan *p, pw_error *error) {
  pw_map map;
  if (pw_map_open (&map, j->file) != PW_OK)
    return pw_fail (error, PW_MACHINE, "cannot read %s: %s", j->part, strerror (errno));
  int status = journal_read (j, p, &map, error);
  off_t there = (off_t)(map.end - map.at);
  pw_map_close (&map);
  if (status != PW_OK) return status;
  if (there > j->size && ftruncate (j->file, j->size) != 0)
    return pw_fail (error, PW_MACHINE, "cannot write %s: %s", j->part, strerror (errno));
  j->created = j->size == 0;
  return j->created ? journal_write (j, p->fingerprint.at, p->fingerprint.used, error) : PW_OK;
}

int pw_journal_open (pw_journal *j, const pw_plan *p, const char *path, pw_error *error) {
  *j = (pw_journal){ .file = -1, .rows = pw_plan_rows (p) };
  j->path = pw_output_path (path, error);
  if (j->path == NULL) return error->status;
  size_t size = strlen (j->path) + sizeof ".part";
  j->part = malloc (size);
  j->line = calloc ((size_t)j->rows + 1, sizeof *j->line);
  if (j->part == NULL || j->line == NULL)
    return pw_fail (error, PW_MACHINE, "out of memory for a sweep of %ld rows", j->rows);
  snprintf (j->part, size, "%s.part", j->path);
  j->file = pw_lock_path (j->part, error);
  return j->file >= 0 ? journal_begin (j, p, error) : error->status;
}

/* ---- Rows ---- */

int pw_journal_add (pw_journal *j, const pw_plan *p, long k, int status, const char *cells, pw_text *text,
                    pw_error *error) {
  off_t at = j->size;
  pw_text_clear (text);
  pw_line_add (text, pw_plan_row (p, k), status, cells);
  if (text->failed) return pw_fail (error, PW_MACHINE, "out of memory");
  if (journal_write (j, text->at, text->used, error) != PW_OK) return error->status;
  j->line[k] = at;
  j->done++;
  return PW_OK;
}

void pw_journal_close (pw_journal *j) {
  if (j->created && j->done == 0 && j->file >= 0) unlink (j->part);
  if (j->file >= 0) close (j->file);
  free (j->line);
  free (j->part);
  free (j->path);
  *j = (pw_journal){ .file = -1 };
}
