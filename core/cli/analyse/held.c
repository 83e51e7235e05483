/* What is held in a steady motion, as options; see held.h. */
#include "held.h"
#include <math.h>
#include <string.h>

int pw_hold_read (const pw_system *s, const char *option, const char *text, pw_initial_value *hold, int *holds,
                  pw_error *error) {
  char name[200];
  const char *equals = strchr (text, '=');
  pw_initial_value *new = hold + *holds;
  if (*holds == PW_HOLDS) return pw_fail (error, PW_INPUT, "%s: more than %d values are held", option, PW_HOLDS);
  if (equals == NULL || equals == text || (size_t)(equals - text) >= sizeof name)
    return pw_fail (error, PW_INPUT, "%s %s: expected STATE=VALUE", option, text);
  snprintf (name, sizeof name, "%.*s", (int)(equals - text), text);
  if (pw_read_expression (equals + 1, &new->value) != PW_OK || !isfinite (new->value))
    return pw_fail (error, PW_INPUT, "%s %s: \"%s\" is not a number", option, text, equals + 1);
  new->state = pw_system_find_held (s, name, error);
  if (new->state < 0) return error->status;
  for (int i = 0; i < *holds; i++)
    if (hold[i].state == new->state) return pw_fail (error, PW_INPUT, "%s %s: %s is held already", option, text, name);
  ++*holds;
  return PW_OK;
}
