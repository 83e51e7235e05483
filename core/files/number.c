/* Numbers as text, with a decimal point in every locale; texts of limited size. */
#define __STDC_WANT_IEC_60559_BFP_EXT__ 1 /* strfromd */
#include <ctype.h>
#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

enum { READ_CHUNK = 1 << 16 }; /* bytes */

int pw_read_rest (FILE *f, size_t max_bytes, const char *path, const char *limit, char **text, size_t *size,
                  pw_error *error) {
  size_t room = 0;
  *text = NULL;
  *size = 0;
  for (size_t n = 1; n > 0; *size += n) {
    if (pw_grow (text, *size + READ_CHUNK, &room, 1) != PW_OK)
      return pw_fail (error, PW_RESOURCE, "%s: out of memory", path);
    n = fread (*text + *size, 1, room - *size - 1, f);
    (*text)[*size + n] = 0;
    if (*size + n > max_bytes)
      return pw_fail (error, PW_INPUT, "%s: the file has more than %g MB, %s", path, (double)(max_bytes >> 10) / 1024,
                      limit);
  }
  return ferror (f) ? pw_fail (error, PW_INPUT, "cannot read %s: %s", path, strerror (errno)) : PW_OK;
}
