/* An expression of two variables: what is taken has a value, derivatives and breakpoints, what is not has its trouble and a
 * place in it. */
#include <stdlib.h>
#include <string.h>
#include "expression.h"
#include "fuzz.h"
#include "pinwheel.h"

static int expression_name (void *context, const char *name, size_t length, size_t at) {
  const char *text = context;
  if (at + length > strlen (text) || strncmp (text + at, name, length) != 0) abort ();
  return 0;
}

static void expression_try (const pw_expression *x) {
  static const double variable[] = { 0.5, -2 };
  double u[3], t = 0, value = pw_expression_value (x, variable);
  pw_expression_derivatives (x, variable, 0, u);
  if (u[0] != value && u[0] == u[0]) abort ();
  for (int i = 0; i < 3 && t < 1e300; i++) {
    double next = pw_expression_breakpoint (x, t);
    if (!(next > t)) abort ();
    t = next;
  }
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const char *const variable[] = { "x", "speed", NULL };
  char *text = fuzz_text (data, size);
  pw_arena arena = { 0 };
  pw_expression_trouble trouble = { 0 };
  const pw_expression *x;
  double value;
  if (pw_expression_read (NULL, variable, text, &arena, &x, &trouble) == PW_OK)
    expression_try (x);
  else if (trouble.at > strlen (text) || *trouble.text == 0)
    abort ();
  pw_expression_constant (NULL, text, &value, &trouble);
  pw_expression_names (text, expression_name, text);
  pw_expression_number (text, &value);
  pw_expression_is_name (text);
  pw_arena_free (&arena);
  free (text);
  return 0;
}
