/* Messages and printed tables, the progress of long work, requests to stop and limits of processor time. */
#define _DEFAULT_SOURCE /* CLOCK_MONOTONIC_COARSE */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include "cli.h"

/* Writes control characters and invalid bytes as \xNN. */
static void say_escaped (FILE *f, const char *text) {
  for (int n; *text; text += n) {
    n = pw_utf8_size (text);
    int escaped = n == 0 || pw_control (text);
    if (n == 0) n = 1;
    for (int i = 0; i < n; i++) fprintf (f, escaped ? "\\x%02x" : "%c", (unsigned char)text[i]);
  }
}

void pw_cli_print (FILE *f, const char *format, ...) {
  char text[12000]; /* two paths of 4096 bytes and a sentence; the rest is cut off */
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (text, sizeof text, format, arguments);
  va_end (arguments);
  if (isatty (fileno (f)))
    say_escaped (f, text);
  else
    fputs (text, f);
}

void pw_cli_quoted (FILE *f, const char *text, const char *quote) {
  fputc ('\'', f);
  for (; *text; text++)
    if (*text == '\'')
      fputs (quote, f);
    else
      fputc ((unsigned char)*text < ' ' ? ' ' : *text, f);
  fputc ('\'', f);
}

void pw_cli_word (FILE *f, const char *word) {
  pw_cli_quoted (f, word, "'\\''");
}

void pw_cli_print_wrapped (const char *text, int indent, int width) {
  int longest = width - indent > 40 ? width - indent : 40; /* of a line */
  while ((int)strlen (text) > longest) {
    int n = longest;
    while (n > 0 && text[n] != ' ') n--;
    if (n == 0) break;
    printf ("%.*s\n%*s", n, text, indent, "");
    text += n + 1;
  }
  puts (text);
}

const char *pw_cli_status_word (int status) {
  static const char *const word[] = { "ok", "machine", "input", "start", "method" };
  return status == PW_INTERRUPTED ? "interrupted" : word[-status];
}

int pw_cli_report_error (const pw_error *error) {
  if (error->status >= PW_OK) return 0;                           /* also PW_RETRY, after a request to stop */
  struct pollfd out = { .fd = STDOUT_FILENO, .events = POLLOUT }; /* a closed pipe: `pinwheel ... | head` */
  if (error->status == PW_RESOURCE && ferror (stdout) && poll (&out, 1, 0) == 1 && out.revents & POLLERR)
    return PW_CLOSED_PIPE;
  fflush (stdout);
  int has_location = strstr (error->text, ": error: ") != NULL; /* the format of compilers, which editors recognise */
  pw_cli_say ("%s%s\n", has_location ? "" : "pinwheel: ", error->text);
  return -error->status;
}

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

#define BATCH_SHORT 0.01          /* processor time of a batch [s] below which the next one is longer */
#define BATCH_LONG 0.04           /* above which it is shorter: the progress bar waits for its end */
enum { BATCH_LONGEST = 1 << 16 }; /* steps */

void pw_batch_adapt (long *batch, long steps, double cpu) {
  if (cpu < BATCH_SHORT && steps == *batch && *batch < BATCH_LONGEST) *batch *= 2;
  if (cpu > BATCH_LONG && *batch > 1) *batch /= 2;
}

void pw_progress_start (pw_progress *p, const char *title, const char *unit, double first, double last) {
  double now = pw_seconds (CLOCK_MONOTONIC);
  int lines = !isatty (STDERR_FILENO);
  *p = (pw_progress){ .title = title, .unit = unit, .first = first, .last = last, .start = now, .lines = lines };
  p->remaining = INFINITY;
  p->next = now + (lines ? PROGRESS_LINE_INTERVAL : PROGRESS_DELAY);
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

/* The remaining time, "0:07", "12:30", "3:05:00": estimated from the rate so far when something was done last, and
 * falling since then.  It is not known, "-", if it is over, if twice as much remains as was shown before, or if it is
 * 1000 hours or more. */
static void progress_remaining (pw_progress *p, double now, char *text, size_t size) {
  const double rate = (p->reached - p->first) / (p->changed - p->start),
               estimate = (p->last - p->reached) / rate - (now - p->changed), before = p->remaining;
  const int done = p->reached >= p->last, known = rate > 0 && estimate > 0;
  if (known && !done) p->remaining = fmin (estimate, before);
  const double seconds = done ? 0 : p->remaining;
  if (!done && !(known && estimate < 2 * before + 5 && seconds < 3600.0 * 1000)) {
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
  if (reached != p->reached) p->reached = reached, p->changed = now;
  if (now < p->next) return;
  p->next = now + (p->lines ? PROGRESS_LINE_INTERVAL : PROGRESS_BAR_INTERVAL);
  double fraction = fmin (fmax (reached / p->last, 0), 1);
  char remaining[24], done[80] = "", text[200];
  progress_remaining (p, now, remaining, sizeof remaining);
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

void pw_cli_abandon_table (pw_output *o, long rows, char *part, size_t size) {
  *part = 0;
  if (rows > 0)
    pw_output_abandon (o, part, size);
  else
    pw_output_discard (o);
}

_Static_assert(ATOMIC_INT_LOCK_FREE == 2, "a handler of signals may change only atomic objects without a lock");
atomic_int pw_stop;
static atomic_int stop_signals; /* since pw_stop_catch */
enum { STOP_NOW = 3 };          /* the signal that ends the program, see pw_stop_catch */

static void stop_on_signal (int number) {
  pw_stop = 1;
  if (++stop_signals < STOP_NOW) return;
  signal (number, SIG_DFL);
  raise (number);
}

static pthread_t stop_thread; /* of the command */

/* The handler outside the loops that check pw_stop.  While the command's thread blocks signals (build_defer, until
 * temporary files are removed), another thread, such as one of a BLAS library, may receive them; it passes them on to
 * the command's thread. */
static void stop_at_once (int number) {
  static const char text[] = "pinwheel: interrupted\n";
  if (!pthread_equal (pthread_self (), stop_thread)) {
    const int before = errno; /* of the interrupted thread */
    pthread_kill (stop_thread, number);
    errno = before;
    return;
  }
  ssize_t written = write (STDERR_FILENO, text, sizeof text - 1);
  (void)written;
  _exit (PW_INTERRUPTED);
}

/* Sets the handler of SIGINT and SIGTERM.  A signal that was already ignored when the program started, by trap '' or
 * because a script runs it in the background, stays ignored.  SA_RESTART: a write that waits for the reader of a pipe
 * goes on. */
static void stop_set (void (*handler) (int)) {
  static const int caught[] = { SIGINT, SIGTERM };
  struct sigaction action = { .sa_handler = handler, .sa_flags = SA_RESTART }, before;
  sigemptyset (&action.sa_mask);
  for (int i = 0; i < 2; i++)
    if (sigaction (caught[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction (caught[i], &action, NULL);
}

void pw_stop_catch (void) {
  stop_signals = 0;
  stop_set (stop_on_signal);
}

int pw_stop_release (void) {
  stop_thread = pthread_self ();
  stop_set (stop_at_once);
  return stop_signals;
}

void pw_limit_start (pw_limit *limit) {
  limit->start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
}

/* Reading the thread's clock takes a system call.  It is therefore read only when a coarse clock, which can be read
 * without one, has advanced: about 250 times a second. */
int pw_limit_over (void *context) {
  pw_limit *limit = context;
  if (pw_stop) return 1;
  if (isinf (limit->seconds)) return 0;
  double now = pw_seconds (CLOCK_MONOTONIC_COARSE);
  if (now == limit->last_check) return 0;
  if (pw_seconds (CLOCK_THREAD_CPUTIME_ID) - limit->start > limit->seconds) return 1; /* and in all later calls */
  limit->last_check = now;
  return 0;
}

pw_run *pw_limit_open (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error) {
  pw_limit *limit = settings->stop_context;
  pw_error own = { 0 };
  if (limit && limit->start == 0) pw_limit_start (limit);
  pw_run *r = pw_run_open (s, method, settings, &own);
  if (own.status == PW_STOPPED && pw_stop)
    own = (pw_error){ .status = PW_RETRY };
  else if (own.status == PW_STOPPED) {
    own.status = PW_OK;
    pw_fail (&own, PW_METHOD,
             "model %s: the limit of %s s of processor time is reached before the first step (--limit)",
             pw_system_name (s), PW_DIGITS (limit->seconds, 6));
  }
  if (error->status == PW_OK) *error = own;
  return r;
}

int pw_limit_status (const pw_limit *limit, double t, pw_error *error) {
  if (pw_stop) return PW_RETRY;
  return pw_fail (error, PW_METHOD, "t = %s s: the limit of %s s of processor time is reached (--limit)",
                  PW_DIGITS (t, 6), PW_DIGITS (limit->seconds, 6));
}

/* Prints tables: a first pass over the rows measures the columns, a second one prints. */

int pw_table_pass (pw_table *table) {
  if (table->f == NULL) table->f = stdout;
  return table->pass++ < 2;
}

int pw_cell (pw_table *table, int width, const char *text) {
  int length = 0, *widest = &table->width[table->column++]; /* length: characters of UTF-8 */
  for (const char *c = text; *c; c++) length += ((unsigned char)*c & 0xC0) != 0x80;
  if (*widest < abs (width)) *widest = abs (width);
  if (*widest < length) *widest = length;
  if (table->pass == 1) return 0;
  int blanks = *widest - length;
  fprintf (table->f, "%*s%s", table->pad + 2 + (width > 0 ? blanks : 0), "", text);
  table->pad = width > 0 ? 0 : blanks;
  table->indent += 2 + *widest;
  return 1;
}

int pw_cell_number (pw_table *table, int width, double value, int digits) {
  return pw_cell (table, width, isnan (value) ? "" : PW_DIGITS (value, digits));
}

int pw_cell_unit (pw_table *table, int width, const char *name, const char *unit) {
  return pw_cell (table, width, PW_PRINTED (350, *unit ? "%s [%s]" : "%s", name, unit));
}

void pw_row_end (pw_table *table) {
  if (table->pass == 2) fputc ('\n', table->f);
  table->column = table->pad = table->indent = 0;
}

void pw_head (pw_table *table, int first, int width, const char *const *heading) {
  pw_cell (table, first, *heading);
  while (*++heading) pw_cell (table, width, *heading);
  pw_row_end (table);
}

void pw_print_bodies (const pw_system *s, const double *q, const double *v, const char *heading, int first, int width,
                      int digits, double least) {
  const char *const head[] = { heading, "x [m]", "y [m]", "phi [rad]", "vx [m/s]", "vy [m/s]", "omega [rad/s]", NULL };
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_head (&t, first, width, head);
    for (int b = 0; b < pw_system_bodies (s) && b < PW_BODIES_PRINTED; b++) {
      pw_cell (&t, first, pw_system_body_name (s, b));
      for (int k = 0; k < 6; k++) {
        const double value = (k < 3 ? q : v)[3 * b + k % 3];
        pw_cell_number (&t, width, fabs (value) < least ? 0 : value, digits);
      }
      pw_row_end (&t);
    }
  }
}
