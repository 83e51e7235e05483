/* The progress of a long run and the remaining time on standard error: a bar on a terminal, else a line a minute. */
#ifndef PW_PROGRESS_H
#define PW_PROGRESS_H

#include <time.h>

typedef struct {
  const char *what; /* shown in front */
  const char *unit; /* "s" for time; else what is counted; "": t is a part of 1 */
  double from;      /* initial value; not 0 if a run or sweep is resumed */
  double t_end;     /* final value: time [s] or count */
  double start;     /* clock when it started [s] */
  double next;      /* clock when it may be drawn or written again [s] */
  int shown;        /* 1: there is a bar to erase */
  int on;           /* 0: draws nothing */
  char note[40];    /* shown at the end; "" at first */
  int lines;        /* 1: no terminal: lines in place of the bar */
} pw_progress;

/* The time of a clock [s]. */
double pw_seconds (clockid_t id);
/* The processor time of the program [s]. */
double pw_cpu_clock (void);

/* `on` 0 suppresses the bar, but not the lines. */
void pw_progress_start (pw_progress *p, const char *what, double t_end, int on);
/* The same for work that is counted in `unit` ("runs"): `from` of `count` are done already. */
void pw_progress_count (pw_progress *p, const char *what, const char *unit, double from, double count);
/* Draws the bar for the time or count t, at most ten times a second, or writes a line. */
void pw_progress_at (pw_progress *p, double t);
/* Erases the bar. */
void pw_progress_end (pw_progress *p);

#endif
