/* Units in the headers of tables: conversion to SI units and check of the dimension.
 *
 * A unit is a product of names with optional powers: "N mm", "m/s^2", "km/h".  A slash divides by the single name after
 * it.  Angles are a separate dimension, since 1/s could mean turns or radians. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

/* The name km/h, and parentheses, are for messages of yaml.c, which take the first name of this list in a text. */
const pw_unit_name pw_unit_names[] = {
  { "m", "1", "m" },
  { "kg", "1", "kg" },
  { "s", "1", "s" },
  { "rad", "1", "rad" },
  { "N", "1", "kg m/s^2" },
  { "J", "1", "kg m^2/s^2" },
  { "W", "1", "kg m^2/s^3" },
  { "degrees", "deg", "rad" },
  { "degree", "deg", "rad" },
  { "deg", "deg", "rad" },
  { "°", "deg", "rad" },
  { "grad", "(pi/200)", "rad" },
  { "gon", "(pi/200)", "rad" },
  { "mrad", "1e-3", "rad" },
  { "rev", "(2*pi)", "rad" },
  { "rpm", "(pi/30)", "rad/s" },
  { "km/h", "(1/3.6)", "m/s" },
  { "mph", "0.44704", "m/s" },
  { "ft", "0.3048", "m" },
  { "mi", "1609.344", "m" },
  { "um", "1e-6", "m" },
  { "\xC2\xB5m", "1e-6", "m" }, /* the micro sign, then the Greek letter */
  { "\xCE\xBCm", "1e-6", "m" },
  { "mm", "1e-3", "m" },
  { "cm", "1e-2", "m" },
  { "dm", "0.1", "m" },
  { "km", "1e3", "m" },
  { "us", "1e-6", "s" },
  { "\xC2\xB5s", "1e-6", "s" },
  { "\xCE\xBCs", "1e-6", "s" },
  { "ms", "1e-3", "s" },
  { "min", "60", "s" },
  { "h", "3600", "s" },
  { "mN", "1e-3", "N" },
  { "kN", "1e3", "N" },
  { "MN", "1e6", "N" },
  { "Nm", "1", "N m" },
  { "kNm", "1e3", "N m" },
  { "Nmm", "1e-3", "N m" },
  { "g", "1e-3", "kg" },
  { "mg", "1e-6", "kg" },
  { "ug", "1e-9", "kg" },
  { "\xC2\xB5g", "1e-9", "kg" },
  { "\xCE\xBCg", "1e-9", "kg" },
  { "lb", "0.45359237", "kg" },
  { "lbf", "4.4482216152605", "N" },
  { "kJ", "1e3", "J" },
  { "kW", "1e3", "W" },
  { "in", "0.0254", "m" }, /* the last: yaml.c takes other units first, since it may be a preposition */
  { .name = NULL },
};

enum { UNITS_BASE = 4 }; /* base units, first in the list */

/* A unit: its factor to SI units, and its dimension as powers of the base units. */
typedef struct {
  double factor;
  int power[UNITS_BASE];
} units_value;

static int units_read (const char *text, units_value *u);

/* Multiplies *u by a power of the unit whose name has n bytes. */
static int units_multiply (const char *name, size_t n, int power, units_value *u) {
  units_value one = { .factor = 1 };
  const pw_unit_name *unit = pw_unit_names;
  while (unit->name && !(strlen (unit->name) == n && memcmp (unit->name, name, n) == 0)) unit++;
  if (unit->name == NULL && !(n == 1 && *name == '1')) return PW_INPUT;
  if (unit < pw_unit_names + UNITS_BASE)
    one.power[unit - pw_unit_names] = 1;
  else if (unit->name) {
    double factor = 1;
    pw_read_expression (unit->factor, &factor);
    units_read (unit->si, &one);
    one.factor *= factor;
  }
  u->factor *= power == 1 ? one.factor : pow (one.factor, power);
  for (int k = 0; k < UNITS_BASE; k++) u->power[k] += power * one.power[k];
  return PW_OK;
}

const char *pw_unit_power (const char *p, int *power) {
  static const char square[] = "\xC2\xB2", cube[] = "\xC2\xB3";
  char *end;
  *power = strncmp (p, square, 2) == 0 ? 2 : strncmp (p, cube, 2) == 0 ? 3 : 1;
  if (*power > 1) return p + 2;
  const int caret = *p == '^';
  p += caret;
  if (!isdigit ((unsigned char)*p) && !(*p == '-' && isdigit ((unsigned char)p[1]))) return *power = !caret, p;
  long value = strtol (p, &end, 10);
  *power = value > -10 && value < 10 ? (int)value : 0;
  return end;
}

/* Reads a product of names with powers; a slash divides by the next name only.  PW_INPUT if the text is none. */
static int units_read (const char *text, units_value *u) {
  static const char ends[] = " */^0123456789-\xC2"; /* of a name; the last begins a raised digit or a middle dot */
  static const char dot[] = "\xC2\xB7";
  int divide = 0, names = 0;
  *u = (units_value){ .factor = 1 };
  for (const char *p = text; *p;) {
    int power;
    size_t symbol = strncmp (p, "°", 2) == 0 || strncmp (p, "µ", 2) == 0 ? 2 : 0; /* begins with \xC2, too */
    size_t n = symbol + strcspn (p + symbol, ends);
    if (n == 0 && *p == '1' && !isdigit ((unsigned char)p[1])) n = 1; /* as in 1/s; other numbers are no units */
    if (n > 0) {
      const char *after = pw_unit_power (p + n, &power);
      if (power == 0 || units_multiply (p, n, divide ? -power : power, u) != PW_OK) return PW_INPUT;
      divide = 0, names++;
      p = after;
    }
    size_t separators = strspn (p, " *");
    p += separators;
    if (*p == '/' && !divide)
      divide = 1, p++, separators++;
    else if (strncmp (p, dot, 2) == 0)
      p += 2, separators++;
    p += strspn (p, " ");
    if (separators == 0 && *p) return PW_INPUT;
  }
  return divide || names == 0 ? PW_INPUT : PW_OK;
}

int pw_unit_factor (const char *unit, const char *wanted, double *factor) {
  units_value given, expected;
  *factor = 1;
  if (units_read (unit, &given) != PW_OK) return PW_INPUT;
  *factor = given.factor;
  if (wanted == NULL || units_read (wanted, &expected) != PW_OK) return PW_OK;
  return memcmp (given.power, expected.power, sizeof given.power) == 0 ? PW_OK : PW_RETRY;
}

size_t pw_unit_split (const char *cell, char *unit, size_t size) {
  size_t n = strlen (cell), name;
  double factor;
  *unit = 0;
  if (n < 2 || (cell[n - 1] != ']' && cell[n - 1] != ')')) return n;
  const char *open = strrchr (cell, cell[n - 1] == ']' ? '[' : '(');
  if (open == NULL) return n;
  const char *from = open + 1 + strspn (open + 1, " "), *end = cell + n - 1;
  while (end > from && end[-1] == ' ') end--;
  snprintf (unit, size, "%.*s", (int)(end - from < 90 ? end - from : 90), from);
  if (*open == '(' && pw_unit_factor (unit, NULL, &factor) != PW_OK) return *unit = 0, n; /* may be any remark */
  if (strcmp (unit, "-") == 0 || strcmp (unit, "1") == 0) *unit = 0;
  for (name = (size_t)(open - cell); name > 0 && cell[name - 1] == ' ';) name--;
  return name;
}

int pw_unit_check (const char *cell, const char *wanted, double *factor, char *why, size_t size) {
  char unit[100];
  *factor = 1;
  pw_unit_split (cell, unit, sizeof unit);
  int status = *unit ? pw_unit_factor (unit, wanted, factor) : PW_OK;
  if (status == PW_INPUT)
    snprintf (why, size, "column \"%.60s\": the unit \"%.40s\" is not known; expected %s, or one that converts to it",
              cell, unit, wanted ? wanted : "an SI unit");
  if (status == PW_RETRY)
    snprintf (why, size, "column \"%.60s\": the unit \"%.40s\" does not measure what %s does, which is expected", cell,
              unit, wanted);
  return status == PW_OK ? PW_OK : PW_INPUT;
}
