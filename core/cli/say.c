/* Messages and what else contains names of files. */
#define _POSIX_C_SOURCE 200809L
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>
#include "cli.h"
#include "util.h"

/* What a terminal would obey is written as \\xNN. */
static void say_text (FILE *f, const char *text) {
  for (int n; *text; text += n) {
    n = pw_utf8_size (text);
    int odd = n == 0 || pw_control (text);
    if (n == 0) n = 1;
    for (int i = 0; i < n; i++) {
      if (odd)
        fprintf (f, "\\x%02x", (unsigned char)text[i]);
      else
        fputc (text[i], f);
    }
  }
}

static void say (FILE *f, const char *format, va_list arguments) {
  char text[12000];
  vsnprintf (text, sizeof text, format, arguments);
  if (isatty (fileno (f)))
    say_text (f, text);
  else
    fputs (text, f);
}

void pw_cli_say (const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  say (stderr, format, arguments);
  va_end (arguments);
}

void pw_cli_print (FILE *f, const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  say (f, format, arguments);
  va_end (arguments);
}
