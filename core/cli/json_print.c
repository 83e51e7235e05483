/* Writes items of JSON by a template. */
#include <stdarg.h>
#include <string.h>
#include "cli.h"

/* Writes a value by the conversion at *at, which is moved past it. */
static void print_value (pw_json *j, const char *key, const char **at, va_list *arguments) {
  const int is_long = (*at)[1] == 'l';
  const char type = (*at)[1 + is_long];
  *at += 2 + is_long;
  if (type == 's')
    pw_json_text (j, key, va_arg (*arguments, const char *));
  else if (type == 'i')
    pw_json_flag (j, key, va_arg (*arguments, int));
  else if (type == 'g')
    pw_json_number (j, key, va_arg (*arguments, double));
  else
    pw_json_number (j, key, is_long ? (double)va_arg (*arguments, long) : va_arg (*arguments, int));
}

void pw_json_print (pw_json *j, const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  for (const char *at = format; *(at += strspn (at, ", "));) {
    char key[40];
    const size_t n = strspn (at, "abcdefghijklmnopqrstuvwxyz0123456789_");
    snprintf (key, sizeof key, "%.*s", (int)n, at);
    if (n) at += n + strspn (at + n, ": ");
    if (*at == '%') {
      print_value (j, n ? key : NULL, &at, &arguments);
      continue;
    }
    if (*at == '{' || *at == '[')
      pw_json_open (j, n ? key : NULL, *at);
    else if (*at != '\n')
      pw_json_close (j, *at);
    else if (j)
      j->line = 1;
    at++;
  }
  va_end (arguments);
}
