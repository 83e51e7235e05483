/* The progress bar of commands, or lines of text without a terminal. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>
#include "progress.h"

#define PROGRESS_DELAY 0.5        /* time before the bar appears [s], so that short runs show none */
#define PROGRESS_BAR_INTERVAL 0.1 /* between drawings of the bar [s] */
#define PROGRESS_LINE_INTERVAL 60 /* between lines without a terminal [s] */
#define PROGRESS_WIDTH 30         /* characters of a full bar, fewer on a narrow terminal */
#define PROGRESS_COLUMNS 80       /* of a terminal that does not report its width */
#define PROGRESS_TITLE 16         /* bytes of the title before the bar, at most */

double pw_seconds (clockid_t id) {
  struct timespec now;
  clock_gettime (id, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void pw_progress_start (pw_progress *p, const char *title, const char *unit, double first, double last) {
  double now = pw_seconds (CLOCK_MONOTONIC);
  int lines = !isatty (STDERR_FILENO);
  *p = (pw_progress){ .title = title, .unit = unit, .first = first, .last = last, .start = now, .lines = lines };
  p->remaining = INFINITY;
  p->next = now + (lines ? PROGRESS_LINE_INTERVAL : PROGRESS_DELAY);
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

/* Draws the title, a bar that leaves room for `text` in the line, and `text`. */
static void progress_draw (const pw_progress *p, double fraction, const char *text) {
  struct winsize size = { .ws_col = 0 };
  char bar[PROGRESS_WIDTH + 1] = "";
  int columns = ioctl (STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : PROGRESS_COLUMNS;
  int room = columns - (int)strlen (" [] ") - (int)strlen (text) - 1, shown = (int)strnlen (p->title, PROGRESS_TITLE);
  if (shown > room) shown = room > 0 ? room : 0;
  while (shown > 0 && (p->title[shown] & 0xC0) == 0x80) shown--; /* not in the middle of a character */
  int width = room - shown;
  width = width < 0 ? 0 : width > PROGRESS_WIDTH ? PROGRESS_WIDTH : width;
  for (int i = 0; i < width; i++) bar[i] = i < (int)(fraction * width) ? '#' : '.';
  fprintf (stderr, "\r%.*s [%s] %s\033[K", shown, p->title, bar, text);
}

/* The remaining time: estimated from the rate so far when something was done last, and falling since then.  It is not
 * known, NaN, if it is over, or if twice as much remains as was shown before. */
static double progress_remaining (pw_progress *p, double now) {
  const double rate = (p->reached - p->first) / (p->changed - p->start),
               estimate = (p->last - p->reached) / rate - (now - p->changed), before = p->remaining;
  if (p->reached >= p->last) return 0;
  if (!(rate > 0 && estimate > 0)) return NAN;
  p->remaining = fmin (estimate, before);
  return estimate < 2 * before + 5 ? p->remaining : NAN;
}

void pw_progress_at (pw_progress *p, double reached) {
  if (p->title == NULL || (p->no_bar && !p->lines)) return;
  double now = pw_seconds (CLOCK_MONOTONIC);
  if (reached != p->reached) p->reached = reached, p->changed = now;
  if (now < p->next) return;
  p->next = now + (p->lines ? PROGRESS_LINE_INTERVAL : PROGRESS_BAR_INTERVAL);
  double fraction = fmin (fmax (reached / p->last, 0), 1);
  char remaining[24], done[80] = "", text[200];
  progress_duration (progress_remaining (p, now), remaining, sizeof remaining);
  if (strcmp (p->unit, "s") == 0)
    snprintf (done, sizeof done, "t = %.4g of %.4g s  ", fmin (reached, p->last), p->last);
  else if (*p->unit && reached > p->last)
    snprintf (done, sizeof done, "%.9g %.40s  ", floor (reached), p->unit);
  else if (*p->unit) /* a count may include a part of what is in progress */
    snprintf (done, sizeof done, "%.9g of %.9g %.40s  ", floor (reached), p->last, p->unit);
  snprintf (text, sizeof text, "%*.0f %%  %s%s to go%s%s", p->lines ? 0 : 3, floor (100 * fraction), done, remaining,
            *p->note ? "  " : "", p->note);
  if (p->lines)
    fprintf (stderr, "pinwheel: %s: %s\n", p->title, text);
  else
    progress_draw (p, fraction, text);
  fflush (stderr);
  p->drawn = !p->lines;
}

void pw_progress_end (pw_progress *p) {
  if (p->drawn) fputs ("\r\033[K", stderr);
  p->drawn = 0;
}
