/* Expressions: values, exact derivatives, and messages for invalid ones. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "expressions.h"
#include "selftest.h"

/* The same operations in C, in the same order, give the same bits. */
TEST (values) {
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
    { "2^-1^2", 0.5 },
    { "--a", 3 },
    { "1 < 2 == 2 > 1", 0 },
    { "0 || 1 && 0", 0 },
    { "1 ? 2 : 0 ? 3 : 4", 2 },
    { "0 ? 2 : 0 ? 3 : 4", 4 },
    { "min(7, 8)", 7 },
    { "1 + 2*a/4", 1 + 2 * a / 4 },
    { "(1 + 2)*a", 9 },
    { "a--2", 5 },
    { "+.5", 0.5 },
    { "1e-3*a", 1e-3 * a },
    { "a > 2 ? 10 : 20", 10 },
    { "a == 3 && a != 4 || a <= 1", 1 },
    { "a + frame.phi", 3.25 },
    { "sin(a)*cos(a) + tan(a)", pw_sin (a) * pw_cos (a) + tan (a) },
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
  for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
    double value = expression_at (good[i].text, 0, 0.25);
    check_bits (good[i].text, &value, &good[i].value, 1);
  }
  check_close ("log(e)", expression_at ("log(e)", 0, 0), 1, CHECK_EPS, "round-off");
  check_close ("e", expression_at ("e", 0, 0), e, 4 * CHECK_EPS, "round-off of exp");
}

TEST (troubles) {
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
    { "2a", 1, "an operator such as * is missing before \"a\"; write 2*a" },
    { "1 + 30deg*a", 6, "an operator such as * is missing before \"d\"; write 30*deg" },
    { "10 km/h", 3, "an operator such as * is missing before \"k\"; write 10*(1 / 3.6): numbers are in SI units" },
    { "30°", 2, "degrees are written *deg: 30*deg" },
    { "0x10", 1, "an operator such as * is missing before \"x\"" },
    { "a(2)", 0, "\"a\" is a number, not a function; a product is written with *" },
    { "sin a", 0, "\"sin\" is a function: write its argument in parentheses" },
    { "sin(a, 2)", 8, "too many arguments" },
    { "atan2(1)", 7, "too few arguments" },
    { "min()", 4, "too few arguments" },
    { "elliptic_K(t)", 11, "elliptic_K: this argument must be a constant" },
    { "jacobi_am(1, 2*t)", 13, "jacobi_am: this argument must be a constant" },
    { "2*(a + 1", 2, "there is no \")\" for this \"(\"" },
    { "a)", 1, "there is no \"(\" for this \")\"" },
    { "a*", 1, "something is missing after \"*\"" },
    { "*a", 0, "this does not belong here" },
    { "2(a)", 1, "an operator such as * is missing before \"(\"" },
    { "(a)(a)", 3, "an operator such as * is missing before \"(\"" },
    { "a**2", 1, "a power is written with ^" },
    { "\"a\"", 0, "\"\"\" does not belong in an expression" },
    { "2 \xc3\xb7 a", 2, "a non-ASCII character does not belong in an expression" },
    { "a & 1", 2, "\"&\" does not belong in an expression" },
    { "a &&", 2, "something is missing after \"&&\"" },
    { "2*(a + )", 5, "something is missing after \"+\"" },
    { "a ? 2", 2, "there is no \":\" for this \"?\"" },
    { "(a ? 2)", 3, "there is no \":\" for this \"?\"" },
    { "a : 2", 2, "this does not belong here" },
    { "sin(a, 2, 3)", 11, "too many arguments" },
    { "_pi", 0, "there is no \"_pi\"; did you mean \"pi\"?" },
  };
  const pw_expression *x;
  pw_expression_error trouble;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    assert_int_equal (expression_read (bad[i].text, &x, &trouble), PW_INPUT);
    if (trouble.at != bad[i].at) print_error ("%s: at %zu, not %zu\n", bad[i].text, trouble.at, bad[i].at);
    assert_int_equal (trouble.at, bad[i].at);
    assert_string_equal (trouble.text, bad[i].trouble);
  }
}

/* Texts that are too long, or in which too much is nested, are refused; long sums are not. */
TEST (limits) {
  static const struct {
    const char *piece;
    int count, status;
  } text[] = { { "1", 4001, PW_INPUT }, { "(", 3000, PW_INPUT },  { "-", 3999, PW_INPUT },    { "2^", 1500, PW_INPUT },
               { "+1", 2000, PW_OK },   { "t+", 1999, PW_INPUT }, { "t?1:", 999, PW_INPUT },  { "sin(", 900, PW_INPUT },
               { "*t", 0, PW_INPUT },   { "-", 150, PW_INPUT },   { "0||t<", 700, PW_INPUT }, { "+t||t", 700, PW_OK } };
  char source[6000];
  const pw_expression *x;
  pw_expression_error trouble;
  double value = 0;
  for (size_t i = 0; i < sizeof text / sizeof *text; i++) {
    *source = 0;
    for (int k = 0; k < text[i].count; k++) strcat (source, text[i].piece);
    assert_int_equal (expression_read (source, &x, &trouble), text[i].status);
  }
  assert_int_equal (pw_expression_number ("-1.5e3", &value), 1);
  assert_true (value == -1500);
  assert_int_equal (pw_expression_number ("nan", &value), 0);
  assert_int_equal (pw_expression_number ("1 ", &value), 0);
}

/* && and || are logical, whatever of them is known when the expression is read. */
TEST (truths) {
  static const double value[] = { 0, 0.5, 1, -2 };
  for (int i = 0; i < 64; i++) {
    double a = value[i & 3], b = value[i >> 2 & 3], known[2] = { i & 16, i & 32 };
    char left[20] = "t", right[20] = "frame.phi", text[100];
    if (known[0] != 0) snprintf (left, sizeof left, "%g", a);
    if (known[1] != 0) snprintf (right, sizeof right, "(%g)", b);
    snprintf (text, sizeof text, "(%s && %s) + 2*(%s || %s) + 4*(%s ? 1 : 0)", left, right, left, right, left);
    /* at t = 0 itself the reference of t is that just after */
    if (a == 0 && known[0] == 0) continue;
    double found = expression_at (text, a, b), expected = (a != 0 && b != 0) + 2 * (a != 0 || b != 0) + 4 * (a != 0);
    check_bits (text, &found, &expected, 1);
  }
}

/* ---- Derivatives ---- */

/* A random expression with finite derivatives of both variables. */
static void random_text (pw_random *r, int depth, char *text, size_t size) {
  static const char *const form[] = { "sin(1 + %s)",
                                      "cos(%s)",
                                      "tan(0.3*sin(%s))",
                                      "asin(0.9*sin(%s))",
                                      "acos(0.9*cos(%s))",
                                      "atan(%s)",
                                      "sinh(sin(%s))",
                                      "cosh(cos(%s))",
                                      "tanh(%s)",
                                      "exp(sin(%s))",
                                      "log(2 + sin(%s))",
                                      "log10(3 + cos(%s))",
                                      "sqrt(2 + sin(%s))",
                                      "jacobi_am(%s, 0.7)",
                                      "jacobi_am(%s, -elliptic_K(0.4))",
                                      "abs(7 + sin(%s))",
                                      "sign(9 + sin(%s))*(%s)",
                                      "(2 + sin(%s))^2.5",
                                      "sin(%s)^3",
                                      "(-sin(%s))",
                                      "2^cos(%s)",
                                      "(cos(%s) < 5 ? 3 : 7)",
                                      "mod(0.3 + 0.1*sin(%s), 1)",
                                      "floor(3.5 + 0.1*sin(%s))*(%s)",
                                      "(%s + %s)",
                                      "(%s)*(%s)",
                                      "(%s)/(3 + sin(%s))",
                                      "(2 + sin(%s))^(%s)",
                                      "(%s - %s)",
                                      "atan2(sin(%s), 2 + cos(%s))",
                                      "hypot(1 + cos(%s), 3 + sin(%s))",
                                      "min(sin(%s), 5 + cos(%s))",
                                      "max(sin(%s), 5 + cos(%s))" };
  static const char *const leaf[] = { "t", "frame.phi", "0.7*t", "a", "t*frame.phi" };
  char part[2][800];
  if (depth == 0) {
    snprintf (text, size, "%s", leaf[(int)pw_random_between (r, 0, 4.999)]);
    return;
  }
  for (int i = 0; i < 2; i++) random_text (r, depth - 1, part[i], sizeof part[i]);
  const char *f = form[(int)pw_random_between (r, 0, sizeof form / sizeof *form - 0.001)];
  text[0] = 0;
  for (int i = 0; *f; f++) {
    size_t n = strlen (text);
    int hole = strncmp (f, "%s", 2) == 0;
    snprintf (text + n, size - n, hole ? "%s" : "%.1s", hole ? part[i++] : f);
    f += hole;
  }
}

/* Differences of order 8 of the value or a derivative. */
static double difference (const pw_expression *x, const double at[2], int by, int order, double h) {
  static const double weight[] = { 4 / 5., -1 / 5., 4 / 105., -1 / 280. };
  double sum = 0, u[2][3];
  for (int k = 1; k <= 4; k++) {
    for (int side = 0; side < 2; side++) {
      double there[2] = { at[0], at[1] };
      there[by] += side ? -k * h : k * h;
      pw_expression_derivatives (x, there, by, u[side]);
    }
    sum += weight[k - 1] * (u[0][order] - u[1][order]) / h;
  }
  return sum;
}

/* Each derivative is that of the one before it.  Two step sizes tell how far differences can be trusted. */
TEST (derivatives) {
  const int expressions = 3000;
  pw_random r = { 12 };
  int sharp = 0;
  for (int i = 0; i < expressions; i++) {
    char text[1600];
    random_text (&r, 1 + i % 3, text, sizeof text);
    if (strlen (text) > 1500) continue;
    const pw_expression *x = expression_of (text);
    double at[2] = { pw_random_between (&r, -2, 2), pw_random_between (&r, -2, 2) }, u[3];
    for (int by = 0; by < 2; by++) {
      pw_expression_derivatives (x, at, by, u);
      double value = pw_expression_value (x, at);
      check_bits (text, &value, u, 1);
      for (int order = 0; order < 2; order++) {
        double near = difference (x, at, by, order, 1e-3), far = difference (x, at, by, order, 2e-3);
        double bound = 2 * fabs (near - far) + 1e-10 * (1 + fabs (u[order]) + fabs (near));
        sharp += bound < 1e-6 * (1 + fabs (near));
        check_close (text, u[order + 1], near, bound, "what two step sizes differ by, and their round-off");
      }
    }
  }
  check_below ("derivatives compared to less than six digits", 4 * expressions - sharp, 0.1 * expressions,
               "a few are wild");
}

/* What jumps or bends has the value and derivatives just after. */
TEST (after) {
  static const struct {
    const char *text;
    double t, u[3];
  } at[] = {
    { "t > 2 ? 3*t : 0", 2, { 6, 3, 0 } },
    { "t <= 2 ? 0 : t^2", 2, { 4, 4, 2 } },
    { "abs(t)", 0, { 0, 1, 0 } },
    { "abs(2 - t)", 2, { 0, 1, 0 } },
    { "floor(t)", 3, { 3, 0, 0 } },
    { "floor(-t)", 3, { -4, 0, 0 } },
    { "ceil(t)", 3, { 4, 0, 0 } },
    { "round(2*t)", 1.25, { 3, 0, 0 } },
    { "round(-2*t)", 1.25, { -3, 0, 0 } },
    { "round(3 - 2*t)", 1.25, { 0, 0, 0 } },
    { "round(-0.49999999999999994 - (t - 1))", 1, { -0.0, 0, 0 } },
    { "sign(t)", 0, { 1, 0, 0 } },
    { "sign(-t)", 0, { -1, 0, 0 } },
    { "mod(t, 3)", 3, { 0, 1, 0 } },
    { "mod(-t, 3)", 3, { 3, -1, 0 } },
    { "min(t, 1)", 1, { 1, 0, 0 } },
    { "max(t, 1, t^2)", 1, { 1, 2, 2 } },
    { "t == 1", 1, { 0, 0, 0 } },
    { "t != 1", 1, { 1, 0, 0 } },
    { "t && 1", 0, { 1, 0, 0 } },
    { "sin(t)^2 > 0", 0, { 1, 0, 0 } },
    { "sqrt(t - 1)", 2, { 1, 0.5, -0.25 } },
    { "3 < t || t < 2", 3, { 1, 0, 0 } },
    { "t < 2 || 2 < t", 2, { 1, 0, 0 } },
    { "atan2(t - 1, -1)", 1, { PW_PI, -1, 0 } },
    { "atan2(1 - t, -1)", 1, { -PW_PI, 1, 0 } },
    { "a > 3", 1, { 0, 0, 0 } },
    { "tanh(1/(1 - t)) < 0", 1, { 1, 0, 0 } },
    { "atan2(1 - t, 0) < -1", 1, { 1, 0, 0 } },
    { "atan2(t - 1, 1 - t) > 2", 1, { 1, 0, 0 } },
    { "atan2((t - 1)^2, 0) > 1", 1, { 1, 0, 0 } },
    { "(1 - t)^-3 < 0", 1, { 1, 0, 0 } },
    { "atan2(0 - (t - 1)^2, 1 - t) < 0", 1, { 1, 0, 0 } },
    { "hypot(t - 1, 0)", 1, { 0, 1, 0 } },
    { "hypot(3*(t - 1), 4*(t - 1) + 5*(t - 1)^2)", 1, { 0, 5, 8 } },
    { "hypot(3*(t - 1)^2, 4*(t - 1)^2)", 1, { 0, 0, 10 } },
    { "frame.phi >= 1", 1, { 1, 0, 0 } },
    { "frame.phi > 1", 1, { 0, 0, 0 } },
  };
  for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
    const pw_expression *x = expression_of (at[i].text);
    double u[3], variable[] = { at[i].t, 1 }, value = pw_expression_value (x, variable);
    pw_expression_derivatives (x, variable, 0, u);
    check_bits (at[i].text, &value, at[i].u, 1);
    for (int k = 0; k < 3; k++) check_close (at[i].text, u[k], at[i].u[k], 4 * CHECK_EPS, "round-off");
  }
}

const check_fixture fixture = { NULL, expression_teardown };
