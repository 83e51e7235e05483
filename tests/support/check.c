/* Running tests, and comparisons of numbers, arrays and errors; see check.h. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"

const check_fixture fixture __attribute__ ((weak)) = { NULL, NULL };

static struct CMUnitTest check_tests[64];
static size_t check_count;

void check_add (const char *name, CMUnitTestFunction test) {
  if (check_count == sizeof check_tests / sizeof *check_tests) abort ();
  check_tests[check_count++] = (struct CMUnitTest){ .name = name, .test_func = test };
}

static int check_setup (void **state) {
  (void)state;
  return fixture.setup ? fixture.setup () : 0;
}

static int check_teardown (void **state) {
  (void)state;
  return fixture.teardown ? fixture.teardown () : 0;
}

int check_run (void) {
  if (check_count == 0) return 1; /* a program without tests would pass */
  return _cmocka_run_group_tests ("tests", check_tests, check_count, check_setup, check_teardown);
}

const char *check_text (const char *format, ...) {
  static char text[8][4000];
  static int next;
  va_list list;
  next = (next + 1) % 8;
  va_start (list, format);
  int length = vsnprintf (text[next], sizeof text[next], format, list);
  va_end (list);
  assert_true (length >= 0 && (size_t)length < sizeof text[next]);
  return text[next];
}

static double check_scale (void) {
  const char *text = getenv ("PW_TOL_SCALE");
  return text ? strtod (text, NULL) : 1;
}

void check_below_at (const char *what, double value, double bound, const char *reason, const char *file, int line) {
  double scale = check_scale ();
  if (scale == 0) {
    print_message ("%-48s %10.2e <= %10.2e  %s\n", what, value, bound, reason);
    return;
  }
  if (value <= scale * bound) return;
  print_error ("%s: %.17g is above the bound %.3g (%s)\n", what, value, scale * bound, reason);
  _fail (file, line);
}

void check_close_at (const char *what, double value, double reference, double bound, const char *reason,
                     const char *file, int line) {
  if (check_scale () != 0 && !(fabs (value - reference) <= check_scale () * bound))
    print_error ("%s: %.17g, expected %.17g\n", what, value, reference);
  check_below_at (what, fabs (value - reference), bound, reason, file, line);
}

void check_bits_at (const char *what, const double *a, const double *b, int n, const char *file, int line) {
  for (int i = 0; i < n; i++) {
    if (memcmp (a + i, b + i, sizeof *a) == 0) continue;
    print_error ("%s: entry %d: %.17g and %.17g\n", what, i, a[i], b[i]);
    _fail (file, line);
  }
}

void check_error_at (const pw_error *error, int status, const char *text, const char *file, int line) {
  if (error->status == status && strcmp (error->text, text) == 0) return;
  print_error ("status %d, expected %d\n  %s\nexpected\n  %s\n", error->status, status, error->text, text);
  _fail (file, line);
}

void check_ok_at (int status, const pw_error *error, const char *file, int line) {
  if (status == PW_OK) return;
  print_error ("status %d: %s\n", status, error ? error->text : "");
  _fail (file, line);
}
