/* Expressions: what they are worth, and what is said of those that are none. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "expression.h"

static double expression_a = 3, expression_phi = 0.25;

static pw_expression *expression_open (void) {
  pw_expression *x = pw_expression_open (2);
  assert_non_null (x);
  assert_int_equal (pw_expression_name (x, "a", &expression_a), PW_OK);
  assert_int_equal (pw_expression_name (x, "frame.phi", &expression_phi), PW_OK);
  return x;
}

/* The same operations in C, in the same order, give the same bits. */
static void test_values (void **state) {
  const double e = exp (1), a = 3, pi = PW_PI;
  const struct {
    const char *text;
    double value;
  } good[] = {
    { "pi", pi },
    { "30*deg", 30 * (pi / 180) },
    { "-a", -a },
    { "a - 0.1", a - 0.1 },
    { "2^3^2", 512 },
    { "-2^2", -4 },
    { "1 + 2*a/4", 1 + 2 * a / 4 },
    { "(1 + 2)*a", 9 },
    { "a--2", 5 },
    { "+.5", 0.5 },
    { "1e-3*a", 1e-3 * a },
    { "a > 2 ? 10 : 20", 10 },
    { "a == 3 && a != 4 || a <= 1", 1 },
    { "a + frame.phi", 3.25 },
    { "sin(a)*cos(a) + tan(a)", sin (a) * cos (a) + tan (a) },
    { "asin(0.3) + acos(0.3)", asin (0.3) + acos (0.3) },
    { "atan2(1, -1)", atan2 (1, -1) },
    { "hypot(3, 4)", 5 },
    { "mod(-1, 3)", 2 },
    { "mod(7, 3)", 1 },
    { "min(a, 2, 5)", 2 },
    { "max(a, 2, 5)", 5 },
    { "sqrt(16) + abs(-1)", 5 },
    { "sign(-3) + sign(0) + sign(2)*2", 1 },
    { "floor(1.5) + ceil(1.5) + round(1.4)", 4 },
    { "log10(1000)", log10 (1000) },
    { "sinh(1) + cosh(1) + tanh(1) + atan(1)", sinh (1) + cosh (1) + tanh (1) + atan (1) },
  };
  pw_expression *x = expression_open ();
  pw_expression_trouble trouble;
  (void)state;
  for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
    if (pw_expression_set (x, good[i].text, &trouble) != PW_OK) print_error ("%s: %s\n", good[i].text, trouble.text);
    double value = pw_expression_value (x);
    check_bits (good[i].text, &value, &good[i].value, 1);
  }
  assert_int_equal (pw_expression_set (x, "log(e)", &trouble), PW_OK);
  check_close ("log(e)", pw_expression_value (x), 1, CHECK_EPS, "round-off");
  assert_int_equal (pw_expression_set (x, "e", &trouble), PW_OK);
  check_close ("e", pw_expression_value (x), e, 4 * CHECK_EPS, "round-off of exp");
  pw_expression_close (x);
}

static void test_troubles (void **state) {
  static const struct {
    const char *text;
    size_t at;
    const char *trouble;
  } bad[] = {
    { "", 0, "an expression is missing" },
    { "b + 1", 0, "there is no \"b\"" },
    { "1 + frame.phy", 4, "there is no \"frame.phy\"; did you mean \"frame.phi\"?" },
    { "a = 7", 2, "\"=\" would assign; equality is written ==" },
    { "1, 2", 1, "a comma belongs between the arguments of a function" },
    { "max((1, 2), 3)", 6, "a comma belongs between the arguments of a function" },
    { "a 2", 2, "an operator such as * is missing before \"2\"" },
    { "2a", 1, "an operator such as * is missing before \"a\"" },
    { "0x10", 1, "an operator such as * is missing before \"x\"" },
    { "a(2)", 0, "\"a\" is a number, not a function; a product is written with *" },
    { "sin a", 0, "\"sin\" is a function: write its argument in parentheses" },
    { "sin(a, 2)", 8, "too many arguments" },
    { "atan2(1)", 7, "too few arguments" },
    { "min()", 4, "too few arguments" },
    { "2*(a + 1", 2, "there is no \")\" for this \"(\"" },
    { "a)", 1, "there is no \"(\" for this \")\"" },
    { "a*", 1, "something is missing after \"*\"" },
    { "*a", 0, "this does not belong here" },
    { "2(a)", 1, "an operator such as * is missing before \"(\"" },
    { "(a)(a)", 3, "an operator such as * is missing before \"(\"" },
    { "a**2", 1, "a power is written with ^" },
    { "\"a\"", 0, "\"\"\" does not belong in an expression" },
    { "a & 1", 2, "\"&\" does not belong in an expression" },
    { "_pi", 0, "there is no \"_pi\"; did you mean \"pi\"?" },
  };
  pw_expression *x = expression_open ();
  pw_expression_trouble trouble;
  (void)state;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    assert_int_equal (pw_expression_set (x, bad[i].text, &trouble), PW_INPUT);
    if (trouble.at != bad[i].at) print_error ("%s: at %zu, not %zu\n", bad[i].text, trouble.at, bad[i].at);
    assert_int_equal (trouble.at, bad[i].at);
    assert_string_equal (trouble.text, bad[i].trouble);
  }
  pw_expression_close (x);
}

/* Assignments and long texts never reach muParser; a failed expression does not spoil the next. */
static void test_again (void **state) {
  static char text[6000];
  pw_expression *x = expression_open ();
  pw_expression_trouble trouble;
  (void)state;
  assert_int_equal (pw_expression_set (x, "a = 7", &trouble), PW_INPUT);
  assert_true (expression_a == 3);
  memset (text, '1', sizeof text - 1);
  assert_int_equal (pw_expression_set (x, text, &trouble), PW_INPUT);
  memset (text, '(', 3000);
  text[3000] = 0;
  assert_int_equal (pw_expression_set (x, text, &trouble), PW_INPUT);
  assert_int_equal (pw_expression_set (x, "sin(1, 2)", &trouble), PW_INPUT);
  assert_int_equal (pw_expression_set (x, "2*a", &trouble), PW_OK);
  assert_true (pw_expression_value (x) == 6);
  double value = 0;
  assert_int_equal (pw_expression_number ("-1.5e3", &value), 1);
  assert_true (value == -1500);
  assert_int_equal (pw_expression_number ("nan", &value), 0);
  assert_int_equal (pw_expression_number ("1 ", &value), 0);
  pw_expression_close (x);
}

int main (void) {
  const struct CMUnitTest tests[] = { cmocka_unit_test (test_values), cmocka_unit_test (test_troubles),
                                      cmocka_unit_test (test_again) };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
