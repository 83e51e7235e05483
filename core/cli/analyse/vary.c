/* The option --vary of `steady` and `periodic`. */
#include "vary.h"
#include <string.h>

/* Refuses a parameter that is a count or also given by --set, and a range outside its domain. */
static int vary_check (const pw_vary *v, const char *text, pw_error *error) {
  const pw_parameter *p = v->parameter;
  const double ends[] = { v->first, v->last };
  if (p->domain == PW_COUNT)
    return pw_fail (error, PW_INPUT,
                    "--vary %s: %s counts something and cannot vary continuously; use `pinwheel sweep`", text, p->name);
  for (int i = 0; i < 2; i++)
    if (*pw_domain_check (p->domain, ends[i]))
      return pw_fail (error, PW_INPUT, "--vary %s: expected %s", text, pw_domain_check (p->domain, ends[i]));
  for (const char **set = v->unknowns.line->sets; set && *set; set++)
    if (strncmp (*set, p->name, strlen (p->name)) == 0 && (*set)[strlen (p->name)] == '=')
      return pw_fail (error, PW_INPUT, "%s is given by --vary and by --set", p->name);
  return PW_OK;
}

int pw_vary_read (pw_vary *v, const pw_cli_line *line, const pw_cli_model *m, const char *text, pw_error *error) {
  const size_t size = strcspn (text, "=");
  if (size == 0 || size >= sizeof v->unknown.name || strchr (text + size, ':') == NULL)
    return pw_fail (error, PW_INPUT, "--vary %s: expected NAME=FIRST:LAST", text);
  if (pw_cli_range (text + size + 1, &v->first, &v->last) != PW_OK || v->first == v->last)
    return pw_fail (error, PW_INPUT, "--vary %s: expected two different numbers FIRST:LAST", text);
  v->name = memcpy (v->unknown.name, text, size);
  v->parameter = v->unknown.parameter = pw_cli_parameter (m->model, v->name);
  v->unknowns = (pw_unknowns){ .line = line, .m = m, .list = &v->unknown, .count = 1 };
  if (v->parameter == NULL) return PW_OK;
  v->unit = v->parameter->unit ? v->parameter->unit : "";
  return vary_check (v, text, error);
}

void pw_vary_progress (const pw_vary *v, pw_progress *p, double from, double value, double to) {
  if (p->title == NULL) pw_progress_start (p, pw_file_name (v->unknowns.m->file), "", 0, 1);
  snprintf (p->note, sizeof p->note, "%.20s = %.4g", v->name, value);
  pw_progress_at (p, (value - from) / (to - from));
}

pw_system *pw_vary_compile (void *vary, double value, pw_error *error) {
  const pw_vary *v = vary;
  pw_cli_model m;
  pw_unknowns_system (&m, &v->unknowns, &value, error);
  pw_model_free (m.model);
  return m.system;
}
