/* Checks for all tests: a number is compared with a reference, within a bound that has a reason.
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
