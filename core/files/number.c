/* Numbers as text, with a decimal point in every locale; texts of limited size. */
#define __STDC_WANT_IEC_60559_BFP_EXT__ 1 /* strfromd */
#include <ctype.h>
#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

/* strfromd, since printf takes a slower path once LAPACK has loaded libquadmath. */
#ifndef __GLIBC__
#define strfromd snprintf
#endif

/* ---- The shortest text that reads back as the same number ----
 *
 * (Giulietti 2020, The Schubfach way to render doubles.) */

__extension__ typedef unsigned __int128 number_wide;

enum { POWER_LEAST = -292, POWER_MOST = 324, POWER_WORDS = 28 };

/* The first 128 bits of 10^k, rounded up, as { low, high }.  5^k has the same: x is 5^k 2^128 or 2^864 / 5^-k. */
static const uint64_t *number_power (int k) {
  static _Thread_local uint64_t known[POWER_MOST - POWER_LEAST + 1][2];
  uint64_t *power = known[k - POWER_LEAST];
  if (power[1]) return power;
  uint32_t x[POWER_WORDS] = { 0 };
  x[k < 0 ? POWER_WORDS - 1 : 4] = 1;
  for (int n = abs (k); n > 0; n--) {
    uint64_t carry = 0;
    for (int i = 0; k > 0 && i < POWER_WORDS; i++, carry >>= 32) x[i] = (uint32_t)(carry += 5 * (uint64_t)x[i]);
    for (int i = POWER_WORDS - 1; k < 0 && i >= 0; i--, carry %= 5)
      carry = carry << 32 | x[i], x[i] = (uint32_t)(carry / 5);
  }
  int top = POWER_WORDS - 1, shift = 0;
  while (x[top] == 0) top--;
  while (x[top] << shift >> 31 == 0) shift++;
  const uint64_t middle = (uint64_t)x[top - 2] << shift, last = (uint64_t)x[top - 4] << shift;
  power[1] = ((uint64_t)x[top] << 32 | x[top - 1]) << shift | middle >> 32;
  power[0] = middle << 32 | (uint64_t)x[top - 3] << shift | last >> 32;
  int exact = k >= 0 && (uint32_t)last == 0;
  for (int i = 0; i < top - 4; i++) exact &= x[i] == 0;
  power[0] += !exact;
  power[1] += power[0] == 0 && !exact;
  return power;
}

/* The upper 64 bits of power * x, rounded to odd: the last bit is also 1 if more than round-off has been cut off. */
static uint64_t number_product (const uint64_t *power, uint64_t x) {
  number_wide low = (number_wide)power[0] * x, high = (number_wide)power[1] * x + (low >> 64);
  return (uint64_t)(high >> 64) | ((uint64_t)high > 1);
}

/* The shortest decimal m 10^*e that is nearer to `value`, positive and finite, than to any other double; of several the
 * nearest one.  Returns m, which may end with zeros. */
static uint64_t number_decimal (double value, int *e) {
  uint64_t bits;
  memcpy (&bits, &value, sizeof bits);
  const uint64_t fraction = bits & (UINT64_MAX >> 12);
  const int exponent = (int)(bits >> 52), closer_below = fraction == 0 && exponent > 1;
  const int q = (exponent ? exponent : 1) - 1075; /* value = c 2^q */
  const uint64_t c = exponent ? fraction | 1ULL << 52 : fraction, odd = c & 1;
  *e = 0;
  if (q <= 0 && q > -53 && (c & ((1ULL << -q) - 1)) == 0) return c >> -q; /* an integer */
  *e = (q * 1262611 - (closer_below ? 524031 : 0)) >> 22; /* floor (log10 (2^q)), or of 3/4 2^q: exact for doubles */
  const int shift = q + ((-*e * 1741647) >> 19) + 1;      /* floor (log2 (10^-*e)), likewise */
  const uint64_t *power = number_power (-*e);
  /* four times the value and the ends of the interval that rounds to it, in units of 10^*e; odd: without its ends */
  const uint64_t middle = number_product (power, 4 * c << shift);
  const uint64_t least = number_product (power, (4 * c - 2 + (uint64_t)closer_below) << shift) + odd;
  const uint64_t most = number_product (power, (4 * c + 2) << shift) - odd;
  const uint64_t m = middle / 4, tens = m / 10;
  const int tens_below = least <= 40 * tens, tens_above = 40 * tens + 40 <= most;
  if (m >= 10 && tens_below != tens_above) return ++*e, tens + (uint64_t)tens_above;
  const int below = least <= 4 * m, above = 4 * m + 4 <= most;
  if (below != above) return m + (uint64_t)above;
  return m + (middle > 4 * m + 2 || (middle == 4 * m + 2 && (m & 1)));
}

/* Writes two digits. */
static void number_pair (char *to, unsigned pair) {
  to[0] = (char)('0' + pair / 10), to[1] = (char)('0' + pair % 10);
}

/* Prints a finite value as "%.17g" does, but with the fewest digits that read back as the same number. */
static void number_shortest (char *to, double value) {
  char text[20], *digit = text + sizeof text; /* the first digit */
  int e = 0;
  if (signbit (value)) *to++ = '-';
  uint64_t m = value != 0 ? number_decimal (fabs (value), &e) : 0;
  for (; m > 0 && m % 10 == 0; m /= 10) e++;
  for (; m >= 100; m /= 100) number_pair (digit -= 2, (unsigned)(m % 100));
  number_pair (digit -= 2, (unsigned)m);
  digit += m < 10;
  const int count = (int)(text + sizeof text - digit), power = e + count - 1; /* of ten, of the first digit */
  const int scientific = power < -4 || power >= 17, before = scientific ? 1 : power + 1;
  const size_t whole = before <= 0 ? 0 : (size_t)(before < count ? before : count), rest = (size_t)count - whole;
  memcpy (to, digit, whole), to += whole;
  if (before <= 0) *to++ = '0';
  if (rest > 0) *to++ = '.';
  for (int zeros = before < 0 ? -before : 0; zeros > 0; zeros--) *to++ = '0';
  memcpy (to, digit + whole, rest), to += rest;
  for (int zeros = before - count; zeros > 0; zeros--) *to++ = '0';
  if (scientific) {
    *to++ = 'e', *to++ = power < 0 ? '-' : '+';
    if (abs (power) >= 100) *to++ = (char)('0' + abs (power) / 100);
    number_pair (to, (unsigned)(abs (power) % 100));
    to += 2;
  }
  *to = 0;
}

char *pw_format (char buffer[32], double value, int digits) {
  const char format[] = { '%', '.', (char)('0' + digits / 10), (char)('0' + digits % 10), 'g', 0 }; /* "%.09g" */
  if (isnan (value)) return strcpy (buffer, "nan");
  if (isinf (value)) return strcpy (buffer, value > 0 ? "inf" : "-inf");
  if (digits >= 17) return number_shortest (buffer, value), buffer;
  strfromd (buffer, 32, digits < 1 ? "%.1g" : format, value);
  char *point = buffer + strspn (buffer, "+-0123456789"); /* the locale's, which may be several bytes long */
  size_t length = strcspn (point, "+-0123456789e");
  if (length > 0) *point = '.', memmove (point + 1, point + length, strlen (point + length) + 1);
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
