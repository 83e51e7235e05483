/* The progress bar, or lines of text without a terminal. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include "progress.h"

#define PROGRESS_FIRST 0.5 /* time before the bar appears [s], so that short runs show none */
#define PROGRESS_EVERY 0.1 /* interval of updates [s] */
#define PROGRESS_LINES 60  /* interval of lines without a terminal [s] */
#define PROGRESS_WIDTH 30  /* characters of a full bar */

double pw_seconds (clockid_t id) {
  struct timespec now;
  clock_gettime (id, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double pw_cpu_clock (void) {
  return pw_seconds (CLOCK_PROCESS_CPUTIME_ID);
}

void pw_progress_start (pw_progress *p, const char *what, double t_end, int on) {
  double now = pw_seconds (CLOCK_MONOTONIC);
  int lines = !isatty (STDERR_FILENO);
  *p = (pw_progress){ .what = what,
                      .unit = "s",
                      .t_end = t_end,
                      .start = now,
                      .next = now + (lines ? PROGRESS_LINES : PROGRESS_FIRST),
                      .on = on || lines,
                      .lines = lines };
}

void pw_progress_count (pw_progress *p, const char *what, const char *unit, double from, double count) {
  pw_progress_start (p, what, count, 1);
  p->unit = unit;
  p->from = from;
}

/* "0:07", "12:30", "3:05:00"; "-" if unknown. */
static void progress_duration (double seconds, char *text, size_t size) {
  if (!(seconds < 3600.0 * 1000)) {
    snprintf (text, size, "-");
    return;
  }
  int s = (int)(seconds + 0.5), hours = s / 3600;
  if (hours > 0)
    snprintf (text, size, "%d:%02d:%02d", hours, s / 60 % 60, s % 60);
  else
    snprintf (text, size, "%d:%02d", s / 60, s % 60);
}

void pw_progress_at (pw_progress *p, double t) {
  if (!p->on) return;
  double now = pw_seconds (CLOCK_MONOTONIC);
  if (now < p->next) return;
  p->next = now + (p->lines ? PROGRESS_LINES : PROGRESS_EVERY);
  double part = fmin (fmax (t / p->t_end, 0), 1);
  char left[24], bar[PROGRESS_WIDTH + 1];
  progress_duration ((now - p->start) / (t - p->from) * (p->t_end - t), left, sizeof left);
  int full = (int)(part * PROGRESS_WIDTH);
  for (int i = 0; i < PROGRESS_WIDTH; i++) bar[i] = i < full ? '#' : '.';
  bar[PROGRESS_WIDTH] = 0;
  if (p->lines)
    fprintf (stderr, "pinwheel: %s: ", p->what);
  else
    fprintf (stderr, "\r%.16s [%s] ", p->what, bar);
  fprintf (stderr, "%*.0f %%  ", p->lines ? 0 : 3, floor (100 * part));
  if (strcmp (p->unit, "s") == 0)
    fprintf (stderr, "t = %.4g of %.4g s  ", t, p->t_end);
  else if (*p->unit)
    fprintf (stderr, "%.9g of %.9g %s  ", floor (t), p->t_end, p->unit);
  fprintf (stderr, "%s to go%s%s%s", left, *p->note ? "  " : "", p->note, p->lines ? "\n" : "\033[K");
  fflush (stderr);
  p->shown = !p->lines;
}

void pw_progress_end (pw_progress *p) {
  if (p->shown) fputs ("\r\033[K", stderr);
  p->shown = 0;
}
