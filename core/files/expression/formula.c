/* Formulas: expressions of named numbers, none of which is the time. */
#include <stdlib.h>
#include "expression_parts.h"
#include "pinwheel-files.h"

struct pw_formula {
  pw_arena arena;
  const pw_expression *expression;
};

pw_formula *pw_formula_open (const char *text, const char *const *names, pw_error *error) {
  pw_expression_error why;
  int status = PW_RESOURCE, count = 0;
  if (pw_require (text, "an expression", error) != PW_OK || pw_require (names, "the list of names", error) != PW_OK)
    return NULL;
  while (names[count]) count++;
  if (count > PW_FORMULA_NAMES) {
    pw_fail (error, PW_INPUT, "more than %d names", PW_FORMULA_NAMES);
    return NULL;
  }
  pw_formula *f = calloc (1, sizeof *f);
  if (f) status = pw_expression_read (NULL, names, text, &f->arena, &f->expression, &why);
  if (status == PW_OK) return f;
  pw_fail (error, status, "%s", status == PW_INPUT ? why.text : "out of memory");
  pw_formula_close (f);
  return NULL;
}

double pw_formula_value (const pw_formula *f, const double *value) {
  int may_jump; /* unused: without a time, there is no value just after a jump */
  return pw_expression_run (f->expression->code, f->expression->codes, value, &may_jump);
}

void pw_formula_close (pw_formula *f) {
  if (f) pw_arena_free (&f->arena);
  free (f);
}
