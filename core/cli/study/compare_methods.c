/* Which methods are compared, and on which ladders. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "compare.h"

/* ---- Ladders ---- */

/* "FROM:TO", in either order, or a single rung. */
static int methods_ladder (const char *option, const char *text, pw_ladder *ladder, pw_error *error) {
  if (text == NULL) return PW_OK;
  char part[2][40];
  const char *colon = strchr (text, ':');
  const char *second = colon ? colon + 1 : text;
  size_t n = colon ? (size_t)(colon - text) : strlen (text);
  if (n >= sizeof part[0] || strlen (second) >= sizeof part[1])
    return pw_fail (error, PW_INPUT, "%s %.80s: expected FROM:TO", option, text);
  memcpy (part[0], text, n);
  part[0][n] = 0;
  strcpy (part[1], second);
  double from = 0, to = 0;
  int status = pw_cli_number (option, part[0], PW_POSITIVE, &from, error);
  if (status == PW_OK) status = pw_cli_number (option, part[1], PW_POSITIVE, &to, error);
  if (status != PW_OK) return status;
  *ladder = (pw_ladder){ fmax (from, to), fmin (from, to) };
  if (ladder->from / ladder->to > 1e30) return pw_fail (error, PW_INPUT, "%s %.80s: too long a ladder", option, text);
  return PW_OK;
}

/* Decades as one writes them: 1e-6, whatever the division of 1e-5 by 10 leaves behind the twelfth digit. */
static double methods_rounded (double rung) {
  char text[32];
  pw_read_number (pw_format (text, rung, 12), &rung);
  return rung;
}

double pw_compare_rung (const pw_ladder *ladder, int adaptive, int i) {
  double rung = adaptive ? methods_rounded (ladder->from / pow (10, i)) : ldexp (ladder->from, -i);
  return rung >= ladder->to * (1 - 1e-9) ? rung : 0;
}

int pw_compare_methods (pw_compare *x, pw_error *error) {
  x->ladder[0] = (pw_ladder){ 0.1, 1e-4 };
  x->ladder[1] = (pw_ladder){ 1e-3, 1e-12 };
  int status = pw_contestants_read (&x->list, x->methods_text ? x->methods_text : "all", error);
  if (status == PW_OK) status = methods_ladder ("--step-ladder", x->step_text, &x->ladder[0], error);
  if (status == PW_OK) status = methods_ladder ("--rtol-ladder", x->rtol_text, &x->ladder[1], error);
  if (status != PW_OK) return status;
  for (int i = 0; i < x->list.count; i++)
    for (int k = 0; pw_compare_rung (&x->ladder[x->list.method[i].adaptive], x->list.method[i].adaptive, k) > 0; k++)
      x->rungs++;
  x->row = calloc ((size_t)x->rungs + 1, sizeof *x->row);
  return x->row ? PW_OK : pw_fail (error, PW_MACHINE, "out of memory");
}
