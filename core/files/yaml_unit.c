/* Units of parameters, which must be SI units: 40 with the unit deg would mean 40 rad. */
#include <ctype.h>
#include <string.h>
#include "yaml.h"

enum { UNIT_BYTES = 400 /* of a unit of up to 60 characters with SI units in place of others, and its end */ };

/* Whether a UTF-8 character is a letter, not a sign like those of multiplication (·, U+22C5) or a raised digit. */
static int unit_is_letter (const char *character) {
  const unsigned char first = (unsigned char)*character;
  if (first < 0xC3 || strncmp (character, "×", 2) == 0) return isalpha (first) || strncmp (character, "µ", 2) == 0;
  return first != 0xE2; /* U+2000 to U+2FFF */
}

/* The first place where a name is a word of its own in a text, or NULL. */
static const char *unit_find_word (const char *text, const char *name) {
  for (const char *at = strstr (text, name), *before; at; at = strstr (at + 1, name)) {
    for (before = at; before > text && ((unsigned char)*--before & 0xC0) == 0x80;) continue;
    if ((at == text || !unit_is_letter (before)) && !unit_is_letter (at + strlen (name))) return at;
  }
  return NULL;
}

const pw_unit_name *pw_yaml_other_unit (const char *unit, const char **at) {
  for (const pw_unit_name *other = pw_unit_names; other->name; other++) {
    if (strcmp (other->factor, "1") == 0 || (strchr (other->name, '/') && strcmp (other->name, unit) != 0)) continue;
    if ((*at = unit_find_word (unit, other->name)) != NULL) return other;
  }
  return NULL;
}

/* Replaces the other unit, at a place in the unit, by SI units.  conversion: of a value, "*deg" or "/1e-3^2". */
static void unit_replace (char unit[UNIT_BYTES], const pw_unit_name *other, const char *at, char conversion[40]) {
  const char *before = at, *after = at + strlen (other->name);
  int power;
  pw_unit_power (after, &power);
  while (before > unit && before[-1] == ' ') before--;
  const int divides = before > unit && before[-1] == '/';
  const int product = strpbrk (other->si, " /") && (divides || power != 1);
  const char *text = PW_PRINTED (UNIT_BYTES, "%.*s%s%s%s%s", (int)(at - unit), unit, product ? "(" : "", other->si,
                                 product ? ")" : "", after);
  memcpy (unit, text, UNIT_BYTES);
  snprintf (conversion, 40, power == 1 ? "%c%s" : "%c%s^%d", divides ? '/' : '*', other->factor, power);
}

/* Refuses a unit that contains this other unit than an SI unit, and says how to convert the value. */
static int unit_refuse (const pw_yaml *y, const pw_node *node, const pw_node *value, const pw_unit_name *other,
                        pw_error *error) {
  const char *unit = node->text;
  static const char why[] = "unit: numbers are in SI units, angles in radians, and no unit converts a value";
  char si[UNIT_BYTES], conversion[40];
  const char *at;
  double factor;
  int replaced = 0, number = value->type == PW_YAML_SCALAR && strlen (value->text) <= 30 &&
                             pw_expression_number (value->text, &(double){ 0 });
  if (strlen (unit) > 60 || pw_unit_factor (unit, NULL, &factor) != PW_OK) { /* not understood as a whole */
    pw_unit_factor (other->name, other->si, &factor);
    return pw_yaml_fail (y, error, node->at, "%s; convert it with 1 %s = %.15g %s, and write %s instead", why,
                         other->name, factor, other->si, other->si);
  }
  snprintf (si, sizeof si, "%s", unit);
  for (; (other = pw_yaml_other_unit (si, &at)) != NULL; replaced++) unit_replace (si, other, at, conversion);
  if (replaced > 1) snprintf (conversion, sizeof conversion, "*%.15g", factor);
  return pw_yaml_fail (y, error, node->at, "%s; write \"value: %s%s, unit: %s\"", why, number ? value->text : "(..)",
                       conversion, si);
}

int pw_yaml_check_unit (const pw_yaml *y, const pw_node *node, const pw_node *value, pw_error *error) {
  const char *at, *unit = node->text, *in = strstr (unit, " in "); /* "persons in lane": no inches, unless a product */
  const pw_unit_name *other = pw_yaml_other_unit (unit, &at);
  if (other == NULL || (in && at == in + 1 && pw_unit_factor (unit, NULL, &(double){ 0 }) != PW_OK)) return PW_OK;
  return unit_refuse (y, node, value, other, error);
}
