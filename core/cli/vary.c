/* A parameter that varies continuously, of --vary NAME=FIRST:LAST. */
#include <math.h>
#include <string.h>
#include "cli.h"
#include "util.h"

int pw_cli_vary_read (pw_cli_vary *v, const pw_cli_line *l, const pw_cli_model *m, const char *text, pw_error *error) {
  const char *equals = strchr (text, '='), *colon = equals ? strchr (equals, ':') : NULL;
  char first[100];
  v->line = l, v->m = m, v->text = text;
  if (colon == NULL || equals == text || (size_t)(equals - text) >= sizeof v->name ||
      (size_t)(colon - equals) > sizeof first)
    return pw_fail (error, PW_INPUT, "--vary %s: expected NAME=FIRST:LAST", text);
  snprintf (v->name, sizeof v->name, "%.*s", (int)(equals - text), text);
  snprintf (first, sizeof first, "%.*s", (int)(colon - equals - 1), equals + 1);
  if (pw_read_expression (first, &v->first) == PW_OK && pw_read_expression (colon + 1, &v->last) == PW_OK &&
      isfinite (v->last - v->first) && v->first != v->last)
    return PW_OK;
  return pw_fail (error, PW_INPUT, "--vary %s: expected two different numbers FIRST:LAST", text);
}

int pw_cli_vary_check (const pw_cli_vary *v, pw_error *error) {
  const pw_parameter *p = pw_cli_parameter (v->m->model, v->name);
  const double end[] = { v->first, v->last };
  if (p->domain == PW_COUNT)
    return pw_fail (error, PW_INPUT,
                    "--vary %s: %s counts something and cannot vary continuously; use `pinwheel sweep`", v->text,
                    p->name);
  for (int i = 0; i < 2; i++)
    if (*pw_domain_check (p->domain, end[i]))
      return pw_fail (error, PW_INPUT, "--vary %s: expected %s", v->text, pw_domain_check (p->domain, end[i]));
  for (const char **set = v->line->sets; set && *set; set++)
    if (strncmp (*set, p->name, strlen (p->name)) == 0 && (*set)[strlen (p->name)] == '=')
      return pw_fail (error, PW_INPUT, "%s is given by --vary and by --set", p->name);
  return PW_OK;
}

void pw_cli_vary_progress (const pw_cli_vary *v, pw_progress *p, double from, double value, double to) {
  char number[32];
  if (p->t_end == 0) pw_progress_count (p, pw_file_name (v->m->file), "", 0, 1);
  snprintf (p->note, sizeof p->note, "%.20s = %s", v->name, pw_format (number, value, 4));
  pw_progress_at (p, (value - from) / (to - from));
}

pw_system *pw_cli_vary_compile (void *vary, double value, pw_error *error) {
  const pw_cli_vary *v = vary;
  pw_model *m = pw_file_model (v->m->file, error);
  pw_system *s = NULL;
  if (m && pw_cli_apply (m, "--set", v->line->sets, pw_model_set, error) == PW_OK &&
      pw_model_set (m, v->name, value, error) == PW_OK &&
      pw_cli_apply (m, "--start", v->line->starts, pw_model_set_initial, error) == PW_OK &&
      pw_model_build (m, error) == PW_OK)
    s = pw_system_compile (m, error);
  pw_model_free (m);
  return s;
}
