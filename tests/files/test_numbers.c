/* Numbers are written with the fewest digits that read back as the same number. */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pinwheel-files.h"

/* The digits without sign, point, exponent and zeros at both ends. */
static int numbers_digits (const char *text) {
  int digits = 0, zeros = 0;
  for (; *text && *text != 'e'; text++) {
    if (*text < '0' || *text > '9') continue;
    zeros = *text == '0' ? zeros + (digits > 0) : 0;
    digits += digits > 0 || *text != '0';
  }
  return digits - zeros;
}

static void numbers_check (double value) {
  char text[32], shorter[40];
  double back = 0;
  assert_ptr_equal (pw_format (text, value, 17), text);
  if (pw_read_number (text, &back) != PW_OK || back != value || signbit (back) != signbit (value))
    fail_msg ("%a is written as %s, which is %a", value, text, back);
  int digits = numbers_digits (text);
  snprintf (shorter, sizeof shorter, "%.*e", digits > 2 ? digits - 2 : 0, value); /* a digit less */
  if (digits > 1 && strtod (shorter, NULL) == value) fail_msg ("%a is written as %s, not as %s", value, text, shorter);
}

TEST (shortest) {
  uint64_t state = 88172645463325252ULL;
  for (int i = 0; i < 200000; i++) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17; /* Marsaglia's xorshift */
    double bits, value = (double)(state >> 11) * 0x1p-53 * pow (10, (int)(state % 12) - 6);
    memcpy (&bits, &state, sizeof bits);
    numbers_check (i % 2 ? value : isfinite (bits) ? bits : 0);
    numbers_check ((double)(state % 1000000) / 1000);
  }
}

TEST (powers) {
  for (int k = -1074; k < 1024; k++) { /* the interval below a power of 2 is half as long */
    const double power = ldexp (1, k);
    numbers_check (power), numbers_check (nextafter (power, 0)), numbers_check (-nextafter (power, INFINITY));
  }
  for (int k = -323; k <= 308; k++) numbers_check (strtod (check_text ("1e%d", k), NULL));
}

TEST (known) {
  static const struct {
    double value;
    const char *text;
  } known[] = { { 0, "0" },
                { -0.0, "-0" },
                { 0.1, "0.1" },
                { 100, "100" },
                { -1.5, "-1.5" },
                { 1.0 / 3, "0.3333333333333333" },
                { 9007199254740992, "9007199254740992" },
                { 12345678901234568, "12345678901234568" },
                { 1e16, "10000000000000000" },
                { 1e17, "1e+17" },
                { 1e23, "1e+23" },
                { 0.0001, "0.0001" },
                { 0.000025, "2.5e-05" },
                { 5e-324, "5e-324" },
                { DBL_MIN, "2.2250738585072014e-308" },
                { DBL_MAX, "1.7976931348623157e+308" },
                { 9.5367431640625e-07, "9.5367431640625e-07" },
                { INFINITY, "inf" },
                { -INFINITY, "-inf" },
                { NAN, "nan" } };
  char text[32];
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    assert_string_equal (pw_format (text, known[i].value, 17), known[i].text);
  assert_string_equal (pw_format (text, 0.1, 3), "0.1");
  assert_string_equal (pw_format (text, 2.0 / 3, 0), "0.7");
}
