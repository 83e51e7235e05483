/* Which methods are compared, and on which ladders. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "compare.h"

/* ---- Methods ---- */

/* Fixed steps by nature, or because the method's options say so. */
static int methods_adaptive (const pw_method *integrator, const char *name) {
  return integrator->adaptive && strstr (name, ":steps=fixed") == NULL;
}

static int methods_count_all (size_t *bytes) {
  int count = 0;
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; s->name; s++, count++)
      *bytes += strlen (pw_methods[i]->name) + strlen (s->name) + 2;
  return count;
}

/* A method is compared once, however often it is named. */
static void methods_add (pw_compare *x, const char *name, const pw_method *integrator) {
  for (int i = 0; i < x->methods; i++)
    if (strcmp (x->method[i].name, name) == 0) return;
  x->method[x->methods++] = (pw_contestant){ name, methods_adaptive (integrator, name) };
}

static char *methods_add_all (pw_compare *x, char *at) {
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; s->name; s++) {
      int n = sprintf (at, "%s+%s", pw_methods[i]->name, s->name);
      methods_add (x, at, pw_methods[i]);
      at += n + 1;
    }
  return at;
}

static int methods_read (pw_compare *x, pw_error *error) {
  const char *text = x->methods_text ? x->methods_text : "all";
  size_t bytes = strlen (text) + 1;
  int most = methods_count_all (&bytes) + 1;
  for (const char *c = text; *c; c++) most += *c == ',';
  x->names = malloc (bytes);
  x->method = calloc ((size_t)most, sizeof *x->method);
  if (x->names == NULL || x->method == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  char *at = x->names;
  for (int all = 0;; text++) {
    size_t n = strcspn (text, ",");
    if (n == 0) return pw_fail (error, PW_INPUT, "--methods \"%.80s\": a name is missing", x->methods_text);
    if (n == 3 && strncmp (text, "all", 3) == 0) {
      if (!all) at = methods_add_all (x, at);
      all = 1;
    } else {
      const pw_method *integrator;
      int stabilisation;
      memcpy (at, text, n);
      at[n] = 0;
      int status = pw_parse_method (at, &integrator, &stabilisation, error);
      if (status != PW_OK) return status;
      methods_add (x, at, integrator);
      at += n + 1;
    }
    text += n;
    if (*text == 0) return PW_OK;
  }
}

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
  int status = methods_read (x, error);
  if (status == PW_OK) status = methods_ladder ("--step-ladder", x->step_text, &x->ladder[0], error);
  if (status == PW_OK) status = methods_ladder ("--rtol-ladder", x->rtol_text, &x->ladder[1], error);
  if (status != PW_OK) return status;
  for (int i = 0; i < x->methods; i++)
    for (int k = 0; pw_compare_rung (&x->ladder[x->method[i].adaptive], x->method[i].adaptive, k) > 0; k++) x->rungs++;
  x->row = calloc ((size_t)x->rungs + 1, sizeof *x->row);
  return x->row ? PW_OK : pw_fail (error, PW_MACHINE, "out of memory");
}
