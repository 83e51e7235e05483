/* The progress of a long run and the remaining time on standard error: a bar on a terminal, else a line a minute. */
#ifndef PW_PROGRESS_H
#define PW_PROGRESS_H

#include <time.h>

/* Zero-initialised, it shows nothing. */
typedef struct {
  const char *title; /* printed before the bar */
  const char *unit;  /* "s" for time; else what is counted; "": a fraction of 1 */
  double first;      /* initial time or count; not 0 if a run or sweep is resumed */
  double last;       /* final time [s] or count */
  double start;      /* clock when the work started [s] */
  double next;       /* clock before which nothing is drawn or written [s] */
  double reached;    /* time or count of the last call, */
  double changed;    /* and the clock when it was reached [s] */
  double remaining;  /* the remaining time last shown, which does not rise [s]; INFINITY: none yet */
  int drawn;         /* 1: there is a bar to erase */
  int no_bar;        /* 1: no bar on a terminal, as the results are printed there; set after the start */
  int lines;         /* 1: no terminal: lines in place of the bar */
  char note[60];     /* printed at the end of the line; "" at first */
} pw_progress;

/* The time of a clock [s]. */
double pw_seconds (clockid_t id);

/* Starts the progress of a run from time `first` to `last`, with the unit "s"; or of work that is counted in `unit`
 * ("runs"): `first` of `last` are done already. */
void pw_progress_start (pw_progress *p, const char *title, const char *unit, double first, double last);
/* Draws the bar for the time or count reached, at most ten times a second, or writes a line.  A count may exceed the
 * final one if that was an estimate. */
void pw_progress_at (pw_progress *p, double reached);
/* Erases the bar. */
void pw_progress_end (pw_progress *p);

#endif
