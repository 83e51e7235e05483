/* The options of a run's method.  methods.c, which reads them, refers to all methods, so it cannot serve them. */
#include <string.h>
#include "method.h"

double pw_run_option (const pw_run *r, const char *name) {
  int i = 0;
  while (r->method->options[i].name && strcmp (r->method->options[i].name, name) != 0) i++;
  return r->method->options[i].name ? r->option[i] : 0;
}
