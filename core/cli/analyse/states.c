/* States in options and reports of `linearise`, `steady` and `periodic`. */
#include "states.h"

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

int pw_hold_read (const pw_system *s, const char **texts, pw_initial_value *hold, int *holds, pw_error *error) {
  int status = PW_OK;
  for (; status == PW_OK && texts && *texts; texts++) {
    char name[PW_ASSIGNED_NAME];
    double value;
    status = pw_cli_assignment ("--hold", *texts, "STATE=VALUE", name, &value, error);
    if (status == PW_OK && !isfinite (value))
      status = pw_fail (error, PW_INPUT, "--hold %s: the value is not finite", *texts);
    if (status == PW_OK) status = pw_hold_add (s, "--hold", *texts, name, value, hold, holds, error);
  }
  return status;
}

void pw_states_print (const pw_system *s, const double *q, const double *v, int digits, double least) {
  int bodies = pw_system_bodies (s);
  pw_print_bodies (s, q, v, "", -12, 12, digits, least);
  if (bodies > PW_BODIES_PRINTED) printf ("  and %d more bodies\n", bodies - PW_BODIES_PRINTED);
  for (int n = pw_system_coordinates (s), j = n - pw_system_states (s); j < n; j++)
    printf ("  %s = %s %s\n", PW_NAME (pw_system_state_name, s, n + j), PW_DIGITS (pw_rounded (v[j], least), digits),
            pw_system_state_unit (s, n + j));
}

void pw_states_json (const pw_system *s, const double *q, const double *v, const char *key, pw_json *j) {
  int n = pw_system_coordinates (s);
  pw_json_open (j, key, '{');
  for (int i = 0; i < 2 * n; i++)
    if (!pw_system_state_hidden (s, i))
      pw_json_number (j, PW_NAME (pw_system_state_name, s, i), i < n ? q[i] : v[i - n]);
  pw_json_close (j, '}');
}

void pw_states_header (const pw_system *s, pw_text *t) {
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++)
    if (!pw_system_state_hidden (s, i))
      pw_text_name (t, PW_NAME (pw_system_state_name, s, i), pw_system_state_unit (s, i));
}

void pw_complex_header (pw_text *t, int most, const char *unit) {
  char name[32];
  for (int i = 0; i < 2 * most; i++)
    snprintf (name, sizeof name, "%s%d", i % 2 ? "im" : "re", i / 2 + 1), pw_text_name (t, name, unit);
}

void pw_complex_cells (pw_text *t, const double *re, const double *im, int count, int most) {
  for (int i = 0; i < 2 * most; i++) pw_text_number (t, i / 2 < count ? (i % 2 ? im : re)[i / 2] : NAN);
}

const char *pw_states_symmetries (int count, char text[40]) {
  *text = 0;
  if (count > 0) snprintf (text, 40, " up to %d %s", count, count == 1 ? "symmetry" : "symmetries");
  return text;
}
