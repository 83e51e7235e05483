/* Breakpoints of expressions: none is lost, whatever the expression, and none is found where nothing jumps. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "expressions.h"
#include "selftest.h"

TEST (breakpoints) {
  static const struct {
    const char *text;
    double first, next; /* 0: none */
  } at[] = {
    { "7", 0, 0 },
    { "sin(t) + exp(t)", 0, 0 },
    { "t > 7.0003 && t < 7.0103 ? 100 : 0", 7.0003, 7.0103 },
    { "7.0103 >= t && t >= 7.0003", 7.0003, 7.0103 },
    { "2*t - 1 > 3", 2, 0 },
    { "1 - t/4 <= -2 ? 1 : 0", 12, 0 },
    { "t > 1e-7", 1e-7, 0 },
    { "t > 1e9", 1e9, 0 },
    { "floor(t)", 1, 2 },
    { "ceil(t/2)", 2, 4 },
    { "round(t)", 0.5, 1.5 },
    { "mod(t, 0.3) < 0.1", 0.1, 0.3 },
    { "mod(t - 7, 20)", 7, 27 },
    { "sin(t) > 0.5", 0.5235987755982989, 2.6179938779914944 },
    { "abs(cos(t))", 1.5707963267948966, 4.7123889803846899 },
    { "t^2 > 2", 1.4142135623730951, 0 },
    { "(t - 1)^2 < 1e-6", 0.999, 1.001 }, /* both ends of an interval around 1 are far above */
    { "exp(t) < 3 ? 1 : 2", 1.0986122886681098, 0 },
    { "min(t, 1)", 1, 0 },
    { "max(1, t, 3)", 3, 0 },
    { "max(t, 1) > 1", 1, 0 }, /* 1 > 1 is false, but true just after */
    { "sign(t - 3)", 3, 0 },
    { "t == 4", 0, 0 }, /* not for any time */
    { "sin(t) > 0.5 && t < 1", 0.5235987755982989, 1 },
    { "0 && t > 3", 0, 0 },
    { "(t > 3)*(t > 5)", 3, 5 },
    { "t > 2 ? t > 5 ? 1 : 2 : 3", 2, 5 },
    { "frame.phi > 0", 0, 0 },
    { "t > 2 ? frame.phi : 0", 2, 0 },
    { "frame.phi > t", 0, 0 },
    { "atan2(sin(t), cos(t))", 3.1415926535897931, 9.4247779607693793 },
    { "atan2(floor(t/100), t - 1)", 1, 100 },
    { "sin(t) > 2", 0, 0 },
    { "max(0, min(t, 1) - min(t, 1)) + (t > 5)", 1, 5 },
    { "max(sin(t), sin(t)) + (t > 0.1)", 0.1, -1 }, /* what stays equal hides nothing near */
    { "jacobi_am(t, 0.5) > 1", 1.0832167728451687, 0 },
    { "cosh(t) > 2 || tan(t/9) > 1", 1.3169578969248168, 0 },
    /* Comparisons with NaN are false, but for !=; these operands become NaN, or numbers. */
    { "mod(acos(t), sinh(t - 1)) > cos(e)", 1, -1 }, /* jumps of mod accumulate before 1 */
    { "atan(asin(t - 2)) > -2", 1, 3 },
    { "atan(acos(2 - t)) > -2", 1, 3 },
    { "sin(log(3 - t)) < 2", 3, 0 },
    { "sin(log10(t - 3)) < 2", 3, 0 },
    { "sqrt(2 - t) > -1", 2, 0 },
    { "sqrt(t - 2) != -1 ? 1 : 0", 0, 0 },
    { "sqrt(t - 2) == sqrt(t - 2)", 2, -1 },
    { "jacobi_am(t/2, -3) > 1", 1.561413132451377, 0 },
    { "(2 - t)^2.5 > -1", 2, 0 },
    { "acos(t)^0 > t - 4", 5, 0 },
    { "(t - 3)^(t < 1 ? 2 : sqrt(-1 - t)) > 1 ? 1 : 0", 1, 0 },
    { "(t - 2)^(t < 1 ? 3 : log(-t)) < 0 ? 5 : 7", 1, 0 },
    { "(2*t - 2)^(1/0) > 1 ? 1 : 0", 0.5, 1.5 },
    { "1^acos(t) > t - 4", 5, 0 },
    { "mod(acos(t)/9, 5) < 6", 1, 0 },
    { "floor(0.5 + acos(t)/9) == 0", 1, 0 },
    { "round(sqrt(2 - t)/9) != 1", 0, 0 },
    { "ceil(0.5 + asin(t)/9) <= 1", 1, 0 },
    { "sign(3 + sqrt(2 - t))", 2, 0 },
    { "sign(-3 - sqrt(2 - t))", 2, 0 },
    { "min(sqrt(t - 2), 9 + t)", 2, 0 },
    { "max(sqrt(2 - t), -9)", 2, 0 },
    { "max(-9, acos(t))", 1, 0 },
    { "t > 2 || sqrt(t - 1) >= 0", 1, 0 },
    { "abs(1 + sqrt(2 - t)) >= 0 && t < 5", 2, 0 },
    { "hypot(acos(t), 1) > 0.5", 1, 0 },
    { "atan2(asin(t) + 2, 1) > -4", 1, 0 },
    { "sin(exp(t)) < 2", 709.782712893384, 0 },
    { "exp(t) - exp(t + 1) < 1", 709.782712893384, 0 },
    { "0*exp(t) < 1", 709.782712893384, 0 },
    { "exp(t)/exp(t) > 0", 709.782712893384, 0 },
    { "abs(exp(t)/(exp(t) - 2)) >= -1", 709.782712893384, 0 },
    { "sin(acos(frame.phi)) < 2", 0, 0 },
    /* poles */
    { "tanh(1/(t - 1))", 1, 0 },
    { "atan(3*(t - 2)^-3)", 2, 0 },
    { "exp(-(t - 2)^-2)", 0, 0 },
    { "atan(tan(t))", 1.5707963267948966, 4.7123889803846899 },
    { "atan2(t - 1, 0)", 1, 0 },
    /* hypot at the origin */
    { "hypot(t - 1, 0)", 1, 0 },
    { "hypot(0, 3 - 2*t)", 1.5, 0 },
    { "hypot(t - 2, 4 - t^2)", 2, 0 },
    { "hypot(t - 1, t - 2)", 0, 0 },
    { "hypot(t - 1, frame.phi)", 0, 0 },
    { "atan2(sin(t), log(1))", 3.1415926535897931, 6.2831853071795862 },
    { "1/(2 + sin(t)) + t/3 + t^2", 0, 0 },
    { "(sin(acos(frame.phi)) < 2) + (t > 3)", 3, 0 },
  };
  for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
    const pw_expression *x = expression_of (at[i].text);
    double first = pw_expression_breakpoint (x, 0),
           next = first < INFINITY ? pw_expression_breakpoint (x, first) : first;
    double expected[] = { at[i].first == 0 ? INFINITY : at[i].first, at[i].next == 0 ? INFINITY : at[i].next };
    if (expected[0] == INFINITY) assert_true (first == INFINITY);
    if (expected[0] < INFINITY)
      check_close (at[i].text, first, expected[0], 8 * CHECK_EPS * expected[0], "round-off of the comparison");
    if (at[i].next >= 0 && expected[1] == INFINITY) assert_true (next == INFINITY);
    if (at[i].next > 0)
      check_close (at[i].text, next, expected[1], 8 * CHECK_EPS * next, "round-off of the comparison");
  }
  double width = 0; /* of the first interval from -width, which ends at the kink, exactly */
  while (width != 1e-9 * (1 + width)) width = 1e-9 * (1 + width);
  check_close ("abs(t)", pw_expression_breakpoint (expression_of ("abs(t)"), -width), 0, 1e-24, "exact");
}

/* Numbers that ought to be equal differ by round-off again and again: no breakpoints, and none of the others is
 * lost. */
#define TEN_TIMES(x) x x x x x x x x x x
TEST (round_off) {
  static const char *const noisy[] = { "min(sin(t)^2 + cos(t)^2, 1)",
                                       "abs(sin(t)^2 + cos(t)^2 - 1)",
                                       "max(sin(t), 2*sin(t/2)*cos(t/2))",
                                       "sign(exp(t)*exp(-t) - 1)",
                                       "(t*t > (t - 1)*(t + 1) + 1)",
                                       "max(t, t)" TEN_TIMES (
                                           " + max(t, t) + max(t, t) + max(t, t)") /* equal, and many operations */ };
  for (size_t i = 0; i < sizeof noisy / sizeof *noisy; i++) {
    char text[500];
    int steps = 0, found = 0;
    double t = 0;
    snprintf (text, sizeof text, "%s + floor(t/2.5) + (t > 7)", noisy[i]);
    const pw_expression *x = expression_of (text);
    for (; t < 9 && steps < 1000; steps++) {
      t = pw_expression_breakpoint (x, t);
      found += t == 2.5 || t == 5 || t == 7 || t == 7.5;
    }
    assert_in_range (
        steps, 4, 300); /* searched anew after each hundredth of 1 + t, and after the four: log (10) / log (1.01) + 4 */
    assert_int_equal (found, 4);
  }
}

/* (t - 1)/(2 t) is a whole number at t = 1/(2 k + 1): too many of these lie just after 0, none after 0.01 may be
 * missed. */
TEST (accumulating) {
  const pw_expression *x = expression_of ("mod(t - 1, t ? 2*t : 1)");
  double t = 0;
  for (int k = 49; k >= 0;) {
    double jump = 1. / (2 * k + 1);
    t = pw_expression_breakpoint (x, t);
    assert_true (t <= jump + 4e-16);
    if (t > jump - 4e-16) k--;
  }
}

/* Where enclosures never decide, jumps a thousandth of the time apart are found all the same. */
TEST (undecided) {
  static const char *const text[] = { "-0.5 - t > deg/((t < t) ? t - 1 : sin(t))",
                                      "-jacobi_am(t, pi/4)/(2*t) > deg/sin(t)" };
  for (size_t i = 0; i < sizeof text / sizeof *text; i++) {
    const pw_expression *x = expression_of (text[i]);
    int found = 0;
    double t = 0;
    for (int steps = 0; t < 10 && steps < 100; steps++) {
      t = pw_expression_breakpoint (x, t);
      for (int k = 1; k <= 3; k++) found += fabs (t - k * PW_PI) < 1e-14;
    }
    assert_int_equal (found, 3);
  }
}

/* A whole number that bisection meets exactly is a break, too, whichever way it is passed. */
TEST (whole) {
  static const char *const jumping[] = { "ceil(t)",    "2*ceil(t)",      "floor(-t)", "3 - floor(-t)",
                                         "mod(-t, 1)", "round(0.5 - t)", "floor(t)" };
  for (size_t i = 0; i < sizeof jumping / sizeof *jumping; i++) {
    const pw_expression *x = expression_of (jumping[i]);
    double t = 0;
    for (int k = 1; k <= 100; k++) {
      t = pw_expression_breakpoint (x, t);
      check_bits (jumping[i], &t, (double[]){ k }, 1);
    }
  }
}

/* Between breakpoints nothing jumps: random thresholds on random curves, scanned at many times. */
TEST (scanned) {
  pw_random r = { 5 };
  for (int i = 0; i < 100; i++) {
    char text[200];
    snprintf (text, sizeof text, "(sin(%g*t + %g) + %g*t > %g) + 2*(mod(%g*t, %g) < %g) + 4*floor(%g*t)",
              pw_random_between (&r, 0.1, 9), pw_random_between (&r, 0, 6), pw_random_between (&r, -0.1, 0.1),
              pw_random_between (&r, -1, 1), pw_random_between (&r, -3, 3), pw_random_between (&r, 0.5, 2),
              pw_random_between (&r, 0.1, 0.4), pw_random_between (&r, -2, 2));
    const pw_expression *x = expression_of (text);
    double next = pw_expression_breakpoint (x, 0), before = pw_expression_value (x, (double[]){ 0, 0 });
    for (double t = 0; t < 10; t += 1e-3) {
      double now = pw_expression_value (x, (double[]){ t, 0 });
      int passed = next <= t;
      while (next <= t) {
        assert_true (pw_expression_value (x, (double[]){ nextafter (next, 0), 0 }) !=
                     pw_expression_value (x, (double[]){ next, 0 }));
        next = pw_expression_breakpoint (x, next);
      }
      if (!passed) check_bits (text, &now, &before, 1);
      before = now;
    }
  }
}

const check_fixture fixture = { NULL, expression_teardown };
