/* The rows of a sweep and their files: a journal while it runs, then its table or part. */
#ifndef PW_SWEEP_JOURNAL_H
#define PW_SWEEP_JOURNAL_H

#include <sys/types.h>
#include "sweep_plan.h"

/* The rows done, in the order of completion, in a file next to the table, from which a sweep that was stopped
 * continues. */
typedef struct {
  char *table_path; /* links followed */
  char *path;       /* of the journal: that of the table and ".part" */
  int descriptor;   /* of the journal, locked; -1: not open */
  int begun;        /* 1: this process has written the fingerprint, in a new file or where it was incomplete */
  off_t *offset;    /* in the journal, of the line of row r of the part: offset[r / parts]; 0: missing */
  long rows, done;  /* numbers of these rows; of those in the journal */
  off_t size;       /* bytes of the journal's complete lines */
  pw_text line;     /* the line that is written */
} pw_journal;

/* Opens the journal of the table at `path`, or creates it.  It is truncated at the first line that is incomplete,
 * damaged, repeated or of another part.  Close it in every case.
 * Errors: PW_RESOURCE if it cannot be written or another process has it, PW_INPUT if it belongs to another sweep. */
int pw_journal_open (pw_journal *journal, const pw_plan *plan, const char *path, pw_error *error);
/* Appends a row of the grid: the exit status of its run, 0 to 4, and its line of the table, `text`, without a newline.
 * One thread at a time.  PW_RESOURCE: the journal is unchanged. */
int pw_journal_add (pw_journal *journal, const pw_plan *plan, long row, int status, const char *text, pw_error *error);
/* Closes the journal; removes it if it was begun here and has no rows. */
void pw_journal_close (pw_journal *journal);

/* ---- Rows (sweep_rows.c) ---- */

/* Computes the missing rows in `jobs` threads, until all are there or pw_stop is set.  PW_RESOURCE. */
int pw_sweep_rows (const pw_plan *plan, pw_journal *journal, int jobs, pw_error *error);

/* ---- The table ---- */

/* How the runs of a table ended. */
typedef struct {
  long rows, failed; /* runs; those that failed */
  int status;        /* exit status of the first that failed */
  char reason[300];  /* from its row */
} pw_tally;

/* Writes the table of a complete journal, or its part, and removes the journal. */
int pw_sweep_finish (pw_journal *journal, const pw_plan *plan, pw_tally *tally, pw_error *error);
/* Writes the table at `path` from all parts of a sweep. */
int pw_sweep_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error);

#endif
