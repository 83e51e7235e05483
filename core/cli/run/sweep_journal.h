/* The journal of a sweep: the rows done, from which it continues if it was stopped; and the table made of it, or of the
 * parts of a sweep (sweep_journal.c). */
#ifndef PW_SWEEP_JOURNAL_H
#define PW_SWEEP_JOURNAL_H

#include <sys/types.h>
#include "cli.h"

#define PW_SWEEP_MAGIC "pinwheel sweep 2\n" /* the first line of a fingerprint */

/* The rows done, in the order of completion, in a file next to the table, from which a sweep that was stopped
 * continues. */
typedef struct {
  int part, parts;              /* part I of N */
  const pw_stream *fingerprint; /* its first lines */
  char *table_path;             /* links followed */
  char *path;                   /* of the journal: that of the table and ".part" */
  int descriptor;               /* of the journal, locked; -1: not open */
  int begun;       /* 1: this process has written the fingerprint, in a new file or where it was incomplete */
  off_t *offset;   /* in the journal, of the line of row r of the part: offset[r / parts]; 0: missing */
  long rows, done; /* numbers of these rows; of those in the journal */
  off_t size;      /* bytes of the journal's complete lines */
} pw_journal;

/* Called with a row of the part, from 0, and its line of the table. */
typedef void pw_journal_visit (void *context, long row, const char *line);

/* How the runs of a table ended. */
typedef struct {
  long rows, failed; /* runs; those that failed */
  int status;        /* exit status of the first that failed */
  char reason[300];  /* from its row */
} pw_tally;

/* Opens the journal of a part of the table at `path`, or creates it; rows: of the table.  It is truncated at the first
 * line that is incomplete, damaged, repeated or of another part.  Close it in every case.  PW_RESOURCE if it cannot be
 * written or another process has it, PW_INPUT if it belongs to another sweep. */
int pw_journal_open (pw_journal *journal, const char *path, long rows, int part, int parts,
                     const pw_stream *fingerprint, pw_error *error);
/* Appends a row of the grid: the exit status of its run, 0 to 4, and its line of the table, `text`, without a newline.
 * One thread at a time.  PW_RESOURCE: the journal is unchanged. */
int pw_journal_add (pw_journal *journal, long row, int status, const char *text, pw_error *error);
/* 1 if a row of the grid belongs to the part and is missing. */
int pw_journal_lacks (const pw_journal *journal, long row);
/* Removes the journal if it was begun here and has no rows. */
void pw_journal_close (pw_journal *journal);
/* Writes the table of a complete journal, or its part, and removes the journal.  visit: called with the line of each
 * row; NULL: nothing. */
int pw_journal_finish (pw_journal *journal, const pw_stream *heading, pw_journal_visit *visit, void *context,
                       pw_tally *tally, pw_error *error);
/* Writes the table at `path` from all parts of a sweep. */
int pw_journal_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error);

#endif
