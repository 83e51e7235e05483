/* Expressions: values, exact derivatives, breakpoints, and messages for invalid ones. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "expression.h"
#include "random_scene.h"

static const char *const expression_names[] = { "t", "frame.phi", NULL };
static pw_arena expression_arena;

/* Reads over the parameter a = 3 and two variables. */
static int expression_read (const char *text, const pw_expression **x, pw_expression_error *trouble) {
  pw_scope s = { 0 };
  assert_int_equal (pw_scope_open (&s, 1, &expression_arena), PW_OK);
  pw_scope_add (&s, "a", 3);
  int status = pw_expression_read (&s, expression_names, text, &expression_arena, x, trouble);
  pw_scope_close (&s);
  return status;
}

/* What must be an expression. */
static const pw_expression *expression_of (const char *text) {
  const pw_expression *x = NULL;
  pw_expression_error trouble;
  if (expression_read (text, &x, &trouble) != PW_OK) print_error ("%s: %s\n", text, trouble.text);
  assert_non_null (x);
  return x;
}

static double expression_at (const char *text, double t, double phi) {
  return pw_expression_value (expression_of (text), (double[]){ t, phi });
}

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
    { "min(7)", 7 },
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
                                      "elliptic_K(0.5 + 0.4*sin(%s))",
                                      "elliptic_K(0.1*sin(%s))",
                                      "elliptic_K(-3 + sin(%s))",
                                      "jacobi_am(%s, 0.7)",
                                      "jacobi_am(1.3, 0.5 + 0.3*sin(%s))",
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
                                      "max(sin(%s), 5 + cos(%s))",
                                      "jacobi_am(sin(%s), 0.5 + 0.2*sin(%s))" };
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

/* ---- Breakpoints ---- */

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
    { "exp(elliptic_K(t/4)) > -1", 4, 0 },
    { "sin(jacobi_am(t, t/2)) < 2", 2, 0 },
    { "jacobi_am(t/2, -t) > 1", 1.6950459364929928, 0 },
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
  double t = -1e-9 / (1 - 1e-9); /* the first interval, from t, ends at the kink */
  check_close ("abs(t)", pw_expression_breakpoint (expression_of ("abs(t)"), t), 0, 1e-24, "exact");
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
                                      "-jacobi_am(t, atan2(t, t))/(2*t) > deg/sin(t)" };
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

/* am (u | m) = u - m S/2 + m^2 (S sin^2 u / 4 - 3 R / 8) + ..., S and R the integrals of sin^2 and sin^4 from 0 to u
 * (Abramowitz & Stegun 16.13.4): derivatives by m where the means have converged. */
TEST (amplitude) {
  double u[3], small = 2, S = small / 2 - sin (2 * small) / 4;
  double R = 3 * small / 8 - sin (2 * small) / 4 + sin (4 * small) / 32, s = sin (small);
  pw_expression_derivatives (expression_of ("jacobi_am(2, t)"), (double[]){ 0, 0 }, 0, u);
  check_close ("d am/dm", u[1], -S / 2, 4 * CHECK_EPS, "round-off");
  for (double m = 0; m < 1e-7; m += 3e-8) {
    pw_expression_derivatives (expression_of ("jacobi_am(2, t)"), (double[]){ m, 0 }, 0, u);
    check_close ("d2 am/dm2", u[2], S * s * s / 2 - 3 * R / 4, 1e-6, "differences over 1e-4, and the next term");
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

static int expression_teardown (void) {
  pw_arena_free (&expression_arena);
  return 0;
}

const check_fixture fixture = { NULL, expression_teardown };
