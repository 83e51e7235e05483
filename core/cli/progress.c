/* The progress bar of commands, or lines of text without a terminal. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include "progress.h"

#define PROGRESS_DELAY 0.5        /* time before the bar appears [s], so that short runs show none */
#define PROGRESS_BAR_INTERVAL 0.1 /* between drawings of the bar [s] */
#define PROGRESS_LINE_INTERVAL 60 /* between lines without a terminal [s] */
#define PROGRESS_WIDTH 30         /* characters of a full bar */
#define PROGRESS_TITLE 16         /* bytes of the title before it, at most */

double pw_seconds (clockid_t id) {
  struct timespec now;
  clock_gettime (id, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void pw_progress_count (pw_progress *p, const char *title, const char *unit, double first, double last) {
  double now = pw_seconds (CLOCK_MONOTONIC);
  int lines = !isatty (STDERR_FILENO);
  *p = (pw_progress){ .title = title, .unit = unit, .first = first, .last = last, .start = now, .lines = lines };
  p->next = now + (lines ? PROGRESS_LINE_INTERVAL : PROGRESS_DELAY);
}

void pw_progress_start (pw_progress *p, const char *title, double t_end) {
  pw_progress_count (p, title, "s", 0, t_end);
}

/* "0:07", "12:30", "3:05:00"; "-" if it is unknown or 1000 hours or more. */
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

void pw_progress_at (pw_progress *p, double reached) {
  if (p->title == NULL || (p->no_bar && !p->lines)) return;
  double now = pw_seconds (CLOCK_MONOTONIC);
  if (now < p->next) return;
  p->next = now + (p->lines ? PROGRESS_LINE_INTERVAL : PROGRESS_BAR_INTERVAL);
  double fraction = fmin (fmax (reached / p->last, 0), 1);
  char remaining[24], bar[PROGRESS_WIDTH + 1];
  progress_duration ((now - p->start) / (reached - p->first) * (p->last - reached), remaining, sizeof remaining);
  int full = (int)(fraction * PROGRESS_WIDTH), shown = (int)strnlen (p->title, PROGRESS_TITLE);
  while (shown > 0 && (p->title[shown] & 0xC0) == 0x80) shown--; /* not in the middle of a character */
  for (int i = 0; i < PROGRESS_WIDTH; i++) bar[i] = i < full ? '#' : '.';
  bar[PROGRESS_WIDTH] = 0;
  if (p->lines)
    fprintf (stderr, "pinwheel: %s: ", p->title);
  else
    fprintf (stderr, "\r%.*s [%s] ", shown, p->title, bar);
  fprintf (stderr, "%*.0f %%  ", p->lines ? 0 : 3, floor (100 * fraction));
  if (strcmp (p->unit, "s") == 0)
    fprintf (stderr, "t = %.4g of %.4g s  ", reached, p->last);
  else if (*p->unit)
    fprintf (stderr, "%.9g of %.9g %s  ", floor (reached), p->last, p->unit);
  fprintf (stderr, "%s to go%s%s%s", remaining, *p->note ? "  " : "", p->note, p->lines ? "\n" : "\033[K");
  fflush (stderr);
  p->drawn = !p->lines;
}

void pw_progress_end (pw_progress *p) {
  if (p->drawn) fputs ("\r\033[K", stderr);
  p->drawn = 0;
}
