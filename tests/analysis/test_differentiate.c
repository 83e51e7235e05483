/* pw_differentiate on functions that are no runs: bounds, kinks, jumps, noise, refusals, failures, threads. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pinwheel-analysis.h"

static int evaluations; /* of `functions`, in one thread */

/* A hash of a number, from -1 to 1. */
static double hash (double x) {
  unsigned long long bits;
  memcpy (&bits, &x, sizeof bits);
  bits ^= bits >> 33, bits *= 0xff51afd7ed558ccdULL, bits ^= bits >> 33, bits *= 0xc4ceb9fe1a85ec53ULL;
  return (double)(long long)bits / 9.3e18;
}

enum { SINE, KINK, JUMP, NOISE, SQUARE_ROOT, CONSTANT, WILD, ROUGH, FUNCTIONS };

/* Runs have errors of rtol: a random part and a part that changes with the parameter. */
static int functions (void *context, const double *x, double rtol, double *value, pw_error *error) {
  const double p = x[0], run = rtol * (hash (p + 1e3 * rtol) + sin (3 * p));
  (void)error;
  evaluations++;
  if (context && (p < *(const double *)context)) return pw_fail (error, PW_INPUT, "p is too small");
  value[SINE] = sin (p) + run;
  value[KINK] = fabs (p - 1) + run;
  value[JUMP] = (p < 1 ? p : 2) + run;
  value[NOISE] = hash (p);
  value[SQUARE_ROOT] = sqrt (p) + run;
  value[CONSTANT] = 3;
  value[WILD] = sin (1e4 * p) + run;
  value[ROUGH] = p * fabs (p) + x[1] + run;
  return PW_OK;
}

static pw_difference_settings settings (const double *x, double rtol, int neighbours) {
  return (pw_difference_settings){ .evaluate = functions,
                                   .x = x,
                                   .parameters = 2,
                                   .outputs = FUNCTIONS,
                                   .rtol = rtol,
                                   .neighbours = neighbours,
                                   .jobs = 1 };
}

static void contains (const pw_derivative *d, double truth, double most) {
  assert_int_equal (d->type, PW_DERIVATIVE);
  check_close ("derivative", d->value, truth, d->error, "the claim");
  check_below ("error", d->error, most, "the digits");
}

TEST (digits) {
  for (double rtol = 1e-12; rtol < 1e-5; rtol *= 100)
    for (double p = 0.1; p < 1000; p *= 1.7) {
      const double x[] = { p, 1 };
      pw_derivative out[2 * FUNCTIONS];
      double value[FUNCTIONS];
      pw_error error = { 0 };
      const pw_difference_settings d = settings (x, rtol, 6);
      check_ok (pw_differentiate (&d, out, value, &error), &error);
      assert_true (value[CONSTANT] == 3 && fabs (value[SINE] - sin (p)) < 3 * rtol);
      const double most = 1e4 * pow (rtol, 0.85) * fmax (1, 1 / p);
      contains (&out[SINE], cos (p), most);
      contains (&out[SQUARE_ROOT], 0.5 / sqrt (p), most);
      contains (&out[ROUGH], 2 * p, most * fmax (1, p));
      contains (&out[CONSTANT], 0, 1e-10 / p);
      if (rtol < 1e-11) contains (&out[WILD], 1e4 * cos (1e4 * p), 1);
      if (fabs (p - 1) > 0.1) contains (&out[KINK], p < 1 ? -1 : 1, most * fmax (1, p));
      contains (&out[FUNCTIONS + ROUGH], 1, most * fmax (1, p * p));
      contains (&out[FUNCTIONS + SINE], 0, most);
      assert_true (out[NOISE].type == PW_UNKNOWN || out[NOISE].error > 0.3 * fabs (out[NOISE].value));
    }
}

TEST (none) {
  const double x[] = { 1, 1 };
  pw_derivative out[2 * FUNCTIONS];
  pw_error error = { 0 };
  const pw_difference_settings d = settings (x, 1e-12, 6);
  check_ok (pw_differentiate (&d, out, NULL, &error), &error);
  assert_int_equal (out[KINK].type, PW_NO_DERIVATIVE);
  assert_true (isnan (out[KINK].value));
  check_close ("below", out[KINK].below, -1, 1e-3, "a few digits");
  check_close ("above", out[KINK].above, 1, 1e-3, "a few digits");
  assert_int_equal (out[JUMP].type, PW_UNKNOWN);
  contains (&out[SINE], cos (1), 1e-8);
  const double beside[] = { 1 - 1e-6, 1 };
  const pw_difference_settings near = settings (beside, 1e-12, 6);
  check_ok (pw_differentiate (&near, out, NULL, &error), &error);
  contains (&out[KINK], -1, 1e-3);
  contains (&out[JUMP], 1, 1e-3);
}

/* Bounds, and values that runs refuse: one-sided formulas. */
TEST (bounds) {
  double x[] = { 2, 1 }, low[] = { 2, -1 }, high[] = { 3, INFINITY };
  pw_derivative out[2 * FUNCTIONS];
  pw_error error = { 0 };
  for (int neighbours = 2; neighbours <= 6; neighbours += 2)
    for (int refused = 0; refused < 2; refused++) {
      pw_difference_settings d = settings (x, 1e-12, neighbours);
      if (refused)
        d.context = x;
      else
        d.low = low, d.high = high;
      check_ok (pw_differentiate (&d, out, NULL, &error), &error);
      check_close ("at a bound", out[SINE].value, cos (2), neighbours == 2 ? 1e-7 : 1e-8, "the order");
      if (neighbours > 2)
        contains (&out[SINE], cos (2), neighbours == 4 ? 1e-5 : 1e-7);
      else
        assert_true (isnan (out[SINE].error));
    }
}

/* Bounds nearer to each other than the usual steps. */
TEST (narrow) {
  const double x[] = { 2, 1 }, low[] = { 2 - 1e-6, -1 }, high[] = { 2 + 1e-6, INFINITY };
  pw_derivative out[2 * FUNCTIONS];
  pw_error error = { 0 };
  for (int neighbours = 2; neighbours <= 6; neighbours += 2) {
    pw_difference_settings d = settings (x, 1e-12, neighbours);
    d.low = low, d.high = high;
    check_ok (pw_differentiate (&d, out, NULL, &error), &error);
    check_close ("narrow", out[SINE].value, cos (2), 1e-4, "1e-12 over steps of 1e-7");
  }
}

TEST (fixed) {
  const double x[] = { 0.7, 1 };
  pw_derivative out[2 * FUNCTIONS];
  pw_error error = { 0 };
  double value[FUNCTIONS];
  pw_difference_settings d = settings (x, 1e-9, 2);
  check_ok (pw_differentiate (&d, out, value, &error), &error);
  check_close ("two neighbours", out[SINE].value, cos (0.7), 1e-5, "rtol^(2/3) is 1e-6");
  d.neighbours = 4;
  check_ok (pw_differentiate (&d, out, NULL, &error), &error);
  check_close ("four neighbours", out[SINE].value, cos (0.7), 5e-7, "rtol^(4/5) is 6e-8");
  d.value = value, evaluations = 0;
  check_ok (pw_differentiate (&d, out, NULL, &error), &error);
  assert_int_equal (evaluations, 8);
}

/* Results do not depend on the number of threads. */
TEST (threads) {
  const double x[] = { 0.7, 1 };
  pw_derivative out[2][2 * FUNCTIONS];
  pw_error error = { 0 };
  for (int i = 0; i < 2; i++) {
    pw_difference_settings d = settings (x, 1e-12, 6);
    d.jobs = i ? 5 : 1;
    check_ok (pw_differentiate (&d, out[i], NULL, &error), &error);
  }
  for (int i = 0; i < 2 * FUNCTIONS; i++)
    assert_true (out[0][i].type == out[1][i].type && (isnan (out[0][i].value) || out[0][i].value == out[1][i].value));
}

TEST (failures) {
  double x[] = { 2, 1 }, least = 2.5;
  pw_derivative out[2 * FUNCTIONS];
  pw_error error = { 0 };
  pw_difference_settings d = settings (x, 1e-12, 6);
  d.context = &least;
  assert_int_equal (pw_differentiate (&d, out, NULL, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "p is too small");
  error = (pw_error){ 0 };
  d.neighbours = 3;
  assert_int_equal (pw_differentiate (&d, out, NULL, &error), PW_INPUT);
  error = (pw_error){ 0 };
  assert_int_equal (pw_differentiate (NULL, out, NULL, &error), PW_INPUT);
  error = (pw_error){ 0 };
  long most;
  assert_null (pw_accurate_method (NULL, &(pw_settings){ 0 }, 1, &most, &error));
  check_error (&error, PW_INPUT, "a system is missing");
}

const check_fixture fixture = { NULL, NULL };
