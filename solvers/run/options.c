/* The options of a run's method, for the methods themselves; methods.c, which reads options, depends on all methods. */
#include <string.h>
#include "method.h"

double pw_run_option (const pw_run *r, const char *name) {
  int i = 0;
  while (r->method->options[i].name && strcmp (r->method->options[i].name, name) != 0) i++;
  return r->method->options[i].name ? r->option[i] : 0;
}
