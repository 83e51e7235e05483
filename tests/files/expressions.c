/* Expressions from their text; see expressions.h. */
#include "check.h"
#include "expressions.h"

static const char *const expression_names[] = { "t", "frame.phi", NULL };
static pw_arena expression_arena;

int expression_read (const char *text, const pw_expression **x, pw_expression_error *trouble) {
  pw_scope s = { 0 };
  assert_int_equal (pw_scope_reserve (&s, 1, &expression_arena), PW_OK);
  pw_scope_add (&s, "a", 3);
  int status = pw_expression_read (&s, expression_names, text, &expression_arena, x, trouble);
  pw_scope_close (&s);
  return status;
}

const pw_expression *expression_of (const char *text) {
  const pw_expression *x = NULL;
  pw_expression_error trouble;
  if (expression_read (text, &x, &trouble) != PW_OK) print_error ("%s: %s\n", text, trouble.text);
  assert_non_null (x);
  return x;
}

double expression_at (const char *text, double t, double phi) {
  return pw_expression_value (expression_of (text), (double[]){ t, phi });
}

int expression_teardown (void) {
  pw_arena_free (&expression_arena);
  return 0;
}
