/* The table of integrators; reading the names of methods: integrator[+stabilisation][:option=value]... */
#include <assert.h>
#include <locale.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "methods.h"

#define PW_METHOD(m) extern const pw_method pw_method_##m;
PW_METHODS
#undef PW_METHOD

const pw_method *const pw_methods[] = {
#define PW_METHOD(m) &pw_method_##m,
  PW_METHODS
#undef PW_METHOD
      NULL
};

enum { METHODS_PART = 80 }; /* characters of a part of a method, with the final 0 */

/* Reads one part of the method, up to one of the characters `ends`; for errors: is_a, "a name"; whole, the method. */
static int methods_part (char part[METHODS_PART], const char **text, const char *ends, const char *is_a,
                         const char *whole, pw_error *error) {
  size_t n = strcspn (*text, ends);
  if (n >= METHODS_PART) return pw_fail (error, PW_INPUT, "method \"%.80s\": %s is too long", whole, is_a);
  memcpy (part, *text, n);
  part[n] = 0;
  *text += n;
  return PW_OK;
}

/* Describes what the table of a method lacks; "" if it is complete. */
static const char *methods_lack (const pw_method *m) {
  int options = 0;
  while (m->options && m->options[options].name) options++;
  if (m->stabilisations == NULL || m->stabilisations[0].name == NULL) return "its table has no stabilisations";
  if (m->options == NULL) return "its table has no options: a list that is ended by a NULL name";
  static_assert (PW_MAX_OPTIONS == 12, "the number in the next line");
  if (options > PW_MAX_OPTIONS) return "its table has more than 12 options";
  if (!m->open || !m->advance || !m->at || !m->restart || !m->close)
    return "its table needs open, advance, at, restart and close";
  return "";
}

static int methods_integrator (const char *name, const pw_method *const *own, const pw_method **method,
                               pw_error *error) {
  const pw_method *const *const list[] = { pw_methods, own };
  pw_nearest near = { .sought = name };
  for (int l = 0; l < 2; l++)
    for (int i = 0; list[l] && list[l][i]; i++) {
      pw_nearest_try (&near, list[l][i]->name);
      if (strcmp (list[l][i]->name, name) != 0) continue;
      *method = list[l][i];
      const char *lack = l > 0 && (*method)->locates_no_events ? "events cannot be left to it" : methods_lack (*method);
      return *lack ? pw_fail (error, PW_INPUT, "integrator %s: %s", name, lack) : PW_OK;
    }
  return pw_fail (error, PW_INPUT, "there is no integrator \"%s\"%s", name, pw_nearest_text (&near));
}

static int methods_stabilisation (const pw_method *method, const char *name, int *stabilisation, pw_error *error) {
  char hint[PW_HINT];
  int refused = pw_find_name (method->refused, sizeof *method->refused, name, hint);
  if (refused >= 0)
    return pw_fail (error, PW_INPUT, "integrator %s has no %s: %s", method->name, name, method->refused[refused].about);
  *stabilisation = pw_find_name (method->stabilisations, sizeof *method->stabilisations, name, hint);
  if (*stabilisation >= 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "integrator %s has no stabilisation \"%s\"%s", method->name, name, hint);
}

/* Reads a decimal number, with a point whatever the locale. */
static int methods_number (const pw_option *o, const char *text, double *value, pw_error *error) {
  locale_t c_locale = newlocale (LC_ALL_MASK, "C", (locale_t)0);
  if (c_locale == (locale_t)0) return pw_fail (error, PW_RESOURCE, "method option %s: out of memory", o->name);
  locale_t before = uselocale (c_locale);
  char *end;
  *value = strtod (text, &end);
  uselocale (before);
  freelocale (c_locale);
  int decimal = end > text && *end == 0 && text[strspn (text, "+-.0123456789eE")] == 0;
  const char *expected = decimal ? pw_domain_check (o->domain, *value) : "a number";
  return *expected ? pw_fail (error, PW_INPUT, "method option %s=%s: expected %s", o->name, text, expected) : PW_OK;
}

/* Reads an option, which must exist for the integrator and this stabilisation; *given: one bit for each option that has
 * been read. */
static int methods_option (const pw_method *method, int stabilisation, char *part, double *values, unsigned *given,
                           pw_error *error) {
  char *equals = strchr (part, '='), hint[PW_HINT];
  const char *with = method->stabilisations[stabilisation].name;
  if (equals == NULL) return pw_fail (error, PW_INPUT, "method option \"%s\": expected NAME=VALUE", part);
  *equals = 0;
  pw_nearest near = { .sought = part };
  for (int i = 0; method->options[i].name; i++) {
    const pw_option *o = &method->options[i];
    if (o->with && strcmp (o->with, with) != 0) continue;
    pw_nearest_try (&near, o->name);
    if (strcmp (o->name, part) != 0) continue;
    if (*given & 1U << i) return pw_fail (error, PW_INPUT, "method option %s is given twice", part);
    *given |= 1U << i;
    if (o->choices == NULL) return methods_number (o, equals + 1, values + i, error);
    values[i] = pw_find_name (o->choices, sizeof *o->choices, equals + 1, hint);
    if (values[i] >= 0) return PW_OK;
    return pw_fail (error, PW_INPUT, "method option %s cannot be \"%s\"%s", o->name, equals + 1, hint);
  }
  return pw_fail (error, PW_INPUT, "method %s+%s has no option \"%s\"%s", method->name, with, part,
                  pw_nearest_text (&near));
}

int pw_parse_options (const char *text, const pw_method *const *own, const pw_method **method, int *stabilisation,
                      double *values, pw_error *error) {
  char part[METHODS_PART];
  unsigned given = 0;
  const char *whole = text;
  *stabilisation = 0;
  if (text == NULL) return pw_fail (error, PW_INPUT, "the name of a method is missing");
  if (methods_part (part, &text, "+:", "a name", whole, error) != PW_OK ||
      methods_integrator (part, own, method, error) != PW_OK)
    return PW_INPUT;
  for (int i = 0; (*method)->options[i].name; i++) values[i] = (*method)->options[i].value;
  if (*text == '+') {
    text++;
    if (methods_part (part, &text, "+:", "a name", whole, error) != PW_OK ||
        methods_stabilisation (*method, part, stabilisation, error) != PW_OK)
      return PW_INPUT;
  }
  while (*text == ':') {
    text++;
    int status = methods_part (part, &text, ":", "an option", whole, error);
    if (status == PW_OK) status = methods_option (*method, *stabilisation, part, values, &given, error);
    if (status != PW_OK) return status;
  }
  if (*text)
    return pw_fail (error, PW_INPUT, "method \"%.80s\": expected INTEGRATOR+STABILISATION:OPTION=VALUE", whole);
  return PW_OK;
}

int pw_method_parse (const char *text, const pw_method *const *own, const pw_method **method, int *stabilisation,
                     pw_error *error) {
  double values[PW_MAX_OPTIONS];
  const pw_method *found;
  int index;
  return pw_parse_options (text, own, method ? method : &found, stabilisation ? stabilisation : &index, values, error);
}

#define METHODS_STEP_RATIO 20. /* typical ratio of an adaptive step at rtol 1e-6 to the model's fixed step */
#define METHODS_ORDER 6.       /* typical order of the error of such a step */

int pw_method_adaptive (const pw_method *integrator, const char *method) {
  return integrator->adaptive && strstr (method, ":steps=fixed") == NULL;
}

double pw_method_steps (const char *method, const pw_settings *s, double step, double t_end) {
  const pw_method *integrator;
  int stabilisation;
  if (pw_method_parse (method, s->methods, &integrator, &stabilisation, NULL) != PW_OK) return 0;
  if (!pw_method_adaptive (integrator, method)) return t_end / (s->step > 0 ? s->step : step);
  return t_end / (METHODS_STEP_RATIO * step) * pow (1e-6 / (s->rtol > 0 ? s->rtol : PW_RTOL), 1 / METHODS_ORDER);
}
