/* States in options and reports of analyses. */
#include "states.h"
#include <math.h>
#include <string.h>
#include "print_table.h"

enum { STATES_BODIES = 20 }; /* printed */

int pw_hold_add (const pw_system *s, const char *option, const char *text, const char *name, double value,
                 pw_initial_value *hold, int *holds, pw_error *error) {
  if (*holds == PW_HOLDS) return pw_fail (error, PW_INPUT, "%s: more than %d values are held", option, PW_HOLDS);
  int state = pw_system_find_held (s, name, error);
  if (state < 0) return error->status;
  for (int i = 0; i < *holds; i++)
    if (hold[i].state == state) return pw_fail (error, PW_INPUT, "%s %s: %s is held already", option, text, name);
  hold[(*holds)++] = (pw_initial_value){ state, value };
  return PW_OK;
}

int pw_hold_read (const pw_system *s, const char *option, const char *text, pw_initial_value *hold, int *holds,
                  pw_error *error) {
  char name[200];
  const char *equals = strchr (text, '=');
  double value;
  if (equals == NULL || equals == text || (size_t)(equals - text) >= sizeof name)
    return pw_fail (error, PW_INPUT, "%s %s: expected STATE=VALUE", option, text);
  snprintf (name, sizeof name, "%.*s", (int)(equals - text), text);
  if (pw_read_expression (equals + 1, &value) != PW_OK || !isfinite (value))
    return pw_fail (error, PW_INPUT, "%s %s: \"%s\" is not a number", option, text, equals + 1);
  return pw_hold_add (s, option, text, name, value, hold, holds, error);
}

void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double small) {
  static const char *const head[] = { "", "x [m]", "y [m]", "phi [rad]", "vx [m/s]", "vy [m/s]", "omega [rad/s]" };
  int bodies = pw_system_bodies (s);
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    for (int k = 0; k < 7; k++) pw_cell (&t, k ? 12 : -12, head[k]);
    pw_row_end (&t);
    for (int b = 0; b < bodies && b < STATES_BODIES; b++) {
      pw_cell (&t, -12, pw_system_body_name (s, b));
      for (int k = 0; k < 6; k++) {
        double value = (k < 3 ? q : v)[3 * b + k % 3];
        pw_cell_number (&t, 12, fabs (value) < small ? 0 : value, digits);
      }
      pw_row_end (&t);
    }
  }
  if (bodies > STATES_BODIES) printf ("  and %d more bodies\n", bodies - STATES_BODIES);
}

void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j) {
  int n = pw_system_coordinates (s);
  char name[300];
  pw_json_open (j, key, '{');
  for (int i = 0; i < 2 * n; i++)
    pw_json_number (j, pw_system_state_name (s, i, name, sizeof name), i < n ? q[i] : v[i - n]);
  pw_json_close (j, '}');
}

void pw_numbers_json (pw_json *j, const char *key, const double *value, int count) {
  pw_json_open (j, key, '[');
  for (int i = 0; i < count; i++) pw_json_number (j, NULL, value[i]);
  pw_json_close (j, ']');
}

void pw_states_head (const pw_system *s, pw_text *t) {
  char name[300];
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++)
    pw_text_name (t, pw_system_state_name (s, i, name, sizeof name), pw_system_state_unit (s, i));
}

const char *pw_states_symmetries (int count, char text[40]) {
  *text = 0;
  if (count > 0) snprintf (text, 40, " up to %d %s", count, count == 1 ? "symmetry" : "symmetries");
  return text;
}
