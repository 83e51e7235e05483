/* Numbers as text, with a decimal point in every locale. */
#define __STDC_WANT_IEC_60559_BFP_EXT__ 1 /* strfromd */
#include <ctype.h>
#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel-files.h"
#include "files.h"

/* strfromd, since printf takes a slower path once LAPACK has loaded libquadmath. */
#ifndef __GLIBC__
#define strfromd snprintf
#endif

/* Replaces the locale's decimal point, which may be several bytes long. */
static void number_point (char *text) {
  size_t begin = strspn (text, "+-0123456789");
  size_t length = strcspn (text + begin, "+-0123456789e");
  if (length == 0) return;
  text[begin] = '.';
  memmove (text + begin + 1, text + begin + length, strlen (text + begin + length) + 1);
}

char *pw_format (char buffer[32], double value, int digits) {
  int precision = digits < 1 ? 1 : digits > 17 ? 17 : digits;
  const char format[] = { '%', '.', (char)('0' + precision / 10), (char)('0' + precision % 10), 'g', 0 }; /* "%.17g" */
  if (isnan (value)) return strcpy (buffer, "nan");
  if (isinf (value)) return strcpy (buffer, value > 0 ? "inf" : "-inf");
  strfromd (buffer, 32, format, value);
  number_point (buffer);
  return buffer;
}

int pw_read_number (const char *text, double *value) {
  if (*text == 0 || isspace ((unsigned char)*text)) return PW_INPUT;
  locale_t standard = newlocale (LC_ALL_MASK, "C", (locale_t)0);
  if (standard == (locale_t)0) return PW_RESOURCE;
  locale_t before = uselocale (standard);
  char *end;
  double x = strtod (text, &end);
  uselocale (before);
  freelocale (standard);
  if (*end) return PW_INPUT;
  *value = x;
  return PW_OK;
}

/* Paths in buffers. */

char *pw_path (char path[PW_PATH], const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (path, PW_PATH, format, arguments);
  va_end (arguments);
  return path;
}
