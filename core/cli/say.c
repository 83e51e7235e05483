/* Messages and other text that contains names, and the error with which a command ends. */
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
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

/* 1 if a write to standard output has failed since it is a pipe that the reader has closed: `pinwheel ... | head`. */
static int say_pipe_closed (void) {
  struct pollfd out = { .fd = STDOUT_FILENO, .events = POLLOUT };
  return ferror (stdout) && poll (&out, 1, 0) == 1 && out.revents & POLLERR;
}

const char *pw_cli_status_word (int status) {
  static const char *const word[] = { "ok", "machine", "input", "start", "method" };
  return status == PW_INTERRUPTED ? "interrupted" : word[-status];
}

int pw_cli_report_error (const pw_error *error) {
  if (error->status >= PW_OK) return 0; /* also PW_RETRY, after a request to stop */
  if (error->status == PW_RESOURCE && say_pipe_closed ()) return PW_CLOSED_PIPE;
  fflush (stdout);
  int has_location = strstr (error->text, ": error: ") != NULL; /* the format of compilers, which editors recognise */
  pw_cli_say ("%s%s\n", has_location ? "" : "pinwheel: ", error->text);
  return -error->status;
}
