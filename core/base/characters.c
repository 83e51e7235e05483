/* Checks of external texts: UTF-8 without control characters, which could move a terminal's cursor; printing into
 * buffers. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "util.h"

int pw_utf8_size (const char *text) {
  /* The smallest code of each number of following bytes; a smaller one is encoded in too many bytes. */
  static const unsigned least[] = { 0, 0x80, 0x800, 0x10000 };
  const unsigned char *p = (const unsigned char *)text;
  /* The first byte is 0xxxxxxx, 110xxxxx, 1110xxxx or 11110xxx, the following ones are 10xxxxxx. */
  int following = p[0] < 0x80 ? 0 : p[0] >> 5 == 6 ? 1 : p[0] >> 4 == 14 ? 2 : p[0] >> 3 == 30 ? 3 : -1;
  if (following < 0) return 0;
  unsigned code = following ? p[0] & (0x3Fu >> following) : p[0];
  for (int i = 1; i <= following; i++) {
    if (p[i] >> 6 != 2) return 0;
    code = code << 6 | (p[i] & 0x3Fu);
  }
  int surrogate = code >= 0xD800 && code < 0xE000;
  return code < least[following] || code > 0x10FFFF || surrogate ? 0 : following + 1;
}

int pw_control (const char *text) {
  const unsigned char *p = (const unsigned char *)text;
  if (p[0] == '\n' || p[0] == '\t') return 0;
  return p[0] < ' ' || p[0] == 0x7F ? p[0] : p[0] == 0xC2 && p[1] >= 0x80 && p[1] < 0xA0 ? p[1] : 0;
}

int pw_is_text (const char *text) {
  for (int n; *text; text += n)
    if ((n = pw_utf8_size (text)) == 0 || pw_control (text)) return 0;
  return 1;
}

int pw_is_line (const char *text) {
  return pw_is_text (text) && text[strcspn (text, "\n\t")] == 0;
}

void pw_text_sanitise (char *text) {
  for (int n; *text; text += n) {
    n = pw_utf8_size (text);
    int replace = n == 0 || pw_control (text);
    if (n == 0) n = 1;
    if (replace) memset (text, '?', (size_t)n);
  }
}

char *pw_print (char *buffer, size_t size, const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (buffer, size, format, arguments);
  va_end (arguments);
  return buffer;
}
