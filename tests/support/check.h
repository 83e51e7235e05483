/* Tests, and their checks: a number is compared with a reference, within a bound that has a reason.
 *
 * With PW_TOL_SCALE in the environment every bound is multiplied by it; 0 prints all of them and fails none. */
#ifndef CHECK_H
#define CHECK_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include "pinwheel.h"

#define CHECK_EPS 2.220446049250313e-16

/* TEST (pendulum) { ... } defines a test, which the program prints as test_pendulum.  A program runs the tests of its
 * file in the order of their definitions. */
#define TEST(name)                                                    \
  static void test_##name (void **check_state);                       \
  __attribute__ ((constructor)) static void check_add_##name (void) { \
    check_add ("test_" #name, test_##name);                           \
  }                                                                   \
  static void test_##name (void **check_state __attribute__ ((unused)))

/* What a program does before its first test and after its last one: a file of tests can define `fixture`. */
typedef struct {
  int (*setup) (void), (*teardown) (void); /* not 0: failure */
} check_fixture;
extern const check_fixture fixture;

/* Adds a test; runs all of them and returns the number of failures. */
void check_add (const char *name, CMUnitTestFunction test);
int check_run (void);

/* A text as by printf, until the eighth call after this one. */
const char *check_text (const char *format, ...) __attribute__ ((format (printf, 1, 2)));

/* |value - reference| <= bound */
#define check_close(what, value, reference, bound, reason) \
  check_close_at (what, value, reference, bound, reason, __FILE__, __LINE__)
/* value <= bound */
#define check_below(what, value, bound, reason) check_below_at (what, value, bound, reason, __FILE__, __LINE__)
/* Two arrays agree to the bit. */
#define check_bits(what, a, b, n) check_bits_at (what, a, b, n, __FILE__, __LINE__)
/* An error has this status and exactly this text. */
#define check_error(error, status, text) check_error_at (error, status, text, __FILE__, __LINE__)
/* A status is PW_OK; otherwise prints the error. */
#define check_ok(status, error) check_ok_at (status, error, __FILE__, __LINE__)

void check_close_at (const char *what, double value, double reference, double bound, const char *reason,
                     const char *file, int line);
void check_below_at (const char *what, double value, double bound, const char *reason, const char *file, int line);
void check_bits_at (const char *what, const double *a, const double *b, int n, const char *file, int line);
void check_error_at (const pw_error *error, int status, const char *text, const char *file, int line);
void check_ok_at (int status, const pw_error *error, const char *file, int line);

#endif
