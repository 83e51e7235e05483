/* An expression of two names: what is taken has a value, what is not has its trouble and a place in it. */
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

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const double x = 0.5, y = -2;
  char *text = fuzz_text (data, size);
  pw_expression *e = pw_expression_open (2);
  pw_expression_trouble trouble = { 0 };
  double value;
  if (e == NULL || pw_expression_name (e, "x", &x) != PW_OK || pw_expression_name (e, "speed", &y) != PW_OK) abort ();
  if (pw_expression_set (e, text, &trouble) == PW_OK)
    value = pw_expression_value (e);
  else if (trouble.at > strlen (text) || *trouble.text == 0)
    abort ();
  if (pw_expression_fixed (e, text, &value, &trouble) == PW_OK) pw_expression_value (e);
  pw_expression_names (text, expression_name, text);
  pw_expression_number (text, &value);
  pw_expression_is_name (text);
  pw_expression_close (e);
  free (text);
  return 0;
}
