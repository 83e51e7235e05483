/* The list of methods of a study. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "study.h"

static int methods_add (pw_study_methods *list, const char *name, pw_error *error) {
  const pw_method *integrator;
  int stabilisation, status = pw_method_parse (name, &integrator, &stabilisation, error);
  for (int i = 0; i < list->count; i++)
    if (strcmp (list->method[i].name, name) == 0) return status;
  if (status != PW_OK) return status;
  pw_study_method *method = &list->method[list->count++];
  strcpy (method->name, name);
  method->adaptive = pw_cli_adaptive (integrator, name);
  return PW_OK;
}

/* Every stabilisation of an integrator, or of all of them: NULL. */
static int methods_add_all (pw_study_methods *list, const char *integrator, pw_error *error) {
  char name[STUDY_NAME];
  int status = PW_OK;
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; status == PW_OK && s->name; s++) {
      if (integrator && strcmp (integrator, pw_methods[i]->name) != 0) continue;
      snprintf (name, sizeof name, "%s+%s", pw_methods[i]->name, s->name);
      status = methods_add (list, name, error);
    }
  return status;
}

/* "all", "INTEGRATOR+all", or a method. */
static int methods_add_item (pw_study_methods *list, char *item, pw_error *error) {
  const pw_method *method;
  int stabilisation;
  if (strcmp (item, "all") == 0) return methods_add_all (list, NULL, error);
  char *plus = item + strcspn (item, "+:");
  if (strcmp (plus, "+all") != 0) return methods_add (list, item, error);
  *plus = 0;
  int status = pw_method_parse (item, &method, &stabilisation, error);
  return status == PW_OK ? methods_add_all (list, method->name, error) : status;
}

int pw_study_methods_read (pw_study_methods *list, const char *text, pw_error *error) {
  const char *whole = text;
  char item[STUDY_NAME];
  int most = 1, status = PW_OK;
  for (int i = 0; pw_methods[i]; i++)
    for (const pw_stabilisation *s = pw_methods[i]->stabilisations; s->name; s++) most++;
  for (const char *c = text; *c; c++) most += *c == ',';
  *list = (pw_study_methods){ .method = calloc ((size_t)most, sizeof *list->method) };
  if (list->method == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t n; status == PW_OK; text += n + 1) {
    n = strcspn (text, ",");
    if (n == 0) return pw_fail (error, PW_INPUT, "--methods \"%.80s\": a name is missing", whole);
    if (n >= sizeof item) return pw_fail (error, PW_INPUT, "--methods \"%.80s\": too long a name", whole);
    snprintf (item, sizeof item, "%.*s", (int)n, text);
    status = methods_add_item (list, item, error);
    if (text[n] == 0) break;
  }
  return status;
}
