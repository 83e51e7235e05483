/* Writes JSON item by item. */
#include <math.h>
#include "files.h"

/* Writes the separator before an item or the end of a container. */
static void json_space (pw_json *j, int depth, const char *otherwise) {
  if (j->depth <= j->lines || j->line)
    fprintf (j->f, "\n%*s", 2 * depth, "");
  else
    fputs (otherwise, j->f);
  j->line = 0;
}

/* Bytes that are not UTF-8 become U+FFFD, the replacement character. */
static void json_string (FILE *f, const char *text) {
  fputc ('"', f);
  for (int n; *text; text += n ? n : 1) {
    n = pw_utf8_size (text);
    if (*text == '"' || *text == '\\')
      fprintf (f, "\\%c", *text);
    else if (*text == '\n')
      fputs ("\\n", f);
    else if ((unsigned char)*text < ' ')
      fprintf (f, "\\u%04X", (unsigned)*text);
    else
      fwrite (n ? text : "\xEF\xBF\xBD", 1, (size_t)(n ? n : 3), f);
  }
  fputc ('"', f);
}

static void json_item (pw_json *j, const char *key) {
  if (j->items++ > 0) fputc (',', j->f);
  if (j->depth > 0) json_space (j, j->depth, j->items > 1 ? " " : "");
  if (key == NULL) return;
  json_string (j->f, key);
  fputs (": ", j->f);
}

void pw_json_open (pw_json *j, const char *key, char bracket) {
  json_item (j, key);
  fputc (bracket, j->f);
  j->depth++;
  j->items = 0;
}

void pw_json_close (pw_json *j, char bracket) {
  if (j->items > 0 || j->line) json_space (j, j->depth - 1, "");
  fputc (bracket, j->f);
  if (--j->depth == 0) fputc ('\n', j->f);
  j->items = 1;
}

void pw_json_text (pw_json *j, const char *key, const char *text) {
  json_item (j, key);
  if (text)
    json_string (j->f, text);
  else
    fputs ("null", j->f);
}

void pw_json_number (pw_json *j, const char *key, double value) {
  char text[32];
  json_item (j, key);
  fputs (isfinite (value) ? pw_format (text, value, 17) : "null", j->f);
}

void pw_json_flag (pw_json *j, const char *key, int value) {
  json_item (j, key);
  fputs (value ? "true" : "false", j->f);
}
