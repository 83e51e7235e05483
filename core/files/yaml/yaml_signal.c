/* Signals in text models.
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude, omega, phase, offset}}  and the other forms made of numbers (signal_form.c)
 *   "M0 * cos (omega * t)"                         an expression of the time t; of states, BODY.phi, for forces
 *   {expression: .., rate: .., acceleration: ..}   the same for constraints, which need its derivatives by time
 */
#include <stdio.h>
#include <string.h>
#include "yaml.h"

/* Reads what a form is made of; a table's points besides. */
static int signal_fields (pw_yaml_builder *b, const pw_signal_form *form, const char *what, const pw_node *node,
                          const pw_node *const *v, pw_signal *signal, pw_error *error) {
  char text[240];
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    snprintf (text, sizeof text, "%s: %s", what, f->name);
    if (v[i] == NULL && f->required) return pw_yaml_fail (b->y, node->at, error, "%s is missing", text);
    if (v[i] && f->type == PW_NUMBER && pw_yaml_number (b->y, v[i], text, f->domain, b->x, at, error) != PW_OK)
      return error->status;
    if (v[i] && f->type == PW_CHOICE && pw_yaml_choice (b, v[i], text, f->choices, at, error) != PW_OK)
      return error->status;
  }
  return PW_OK;
}

/* What only the whole tells: at the point of the table that is meant, or at the signal. */
static int signal_fault (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node,
                         const pw_node *points, const pw_signal *signal, pw_error *error) {
  char fault[300];
  int point;
  if (*pw_signal_fault (signal, kind, &point, fault, sizeof fault) == 0) return PW_OK;
  for (const pw_node *n = points ? points->first : NULL; n && point >= 0; n = n->next)
    if (point-- == 0) node = n;
  return pw_yaml_fail (b->y, node->at, error, "%s: %s", what, fault);
}

static int signal_form (pw_yaml_builder *b, const pw_kind *kind, const pw_signal_form *form, const char *what,
                        const pw_node *node, pw_signal *signal, pw_error *error) {
  const char *key[PW_YAML_KEYS];
  char about[100];
  const pw_node *v[PW_YAML_KEYS], *points = NULL;
  int n = 0;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[n++] = f->name;
  if (form->type == PW_TABLE)
    key[n] = "points", key[n + 1] = "file", key[n + 2] = "columns", key[n + 3] = NULL;
  else
    key[n] = NULL;
  snprintf (about, sizeof about, "a %s", form->name);
  if (pw_yaml_keys (b->y, node, 0, key, about, v, error) != PW_OK ||
      signal_fields (b, form, what, node, v, signal, error) != PW_OK)
    return error->status;
  if (form->type == PW_TABLE) {
    int scale = 0;
    while (strcmp (key[scale], "scale") != 0) scale++;
    if (v[scale] && signal->table.scale == 0)
      return pw_yaml_fail (b->y, v[scale]->at, error, "%s: scale: 0 would leave nothing of the table", what);
  }
  if (form->type == PW_TABLE && pw_yaml_points (b, what, node, v + n, signal, error) != PW_OK) return error->status;
  if (form->type == PW_TABLE) points = v[n];
  return signal_fault (b, kind, what, node, points, signal, error);
}

enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

/* "constant, expression, harmonic, ..." */
static char *signal_list (const char *const *key, char *buffer, size_t size) {
  size_t n = (size_t)snprintf (buffer, size, "%s, %s", key[SIGNAL_CONSTANT], key[SIGNAL_EXPRESSION]);
  for (key += SIGNAL_FORMS; *key && n < size; key++) n += (size_t)snprintf (buffer + n, size - n, ", %s", *key);
  return buffer;
}

/* {TYPE: ..} */
static int signal_map (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node,
                       pw_signal *signal, pw_error *error) {
  const char *key[PW_YAML_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[PW_YAML_KEYS];
  char list[100];
  int n = SIGNAL_FORMS, given = 0, form = -1;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) key[n++] = f->name;
  key[n] = NULL;
  if (pw_yaml_keys (b->y, node, 0, key, "a signal", v, error) != PW_OK) return error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form = i;
  }
  if (given != 1)
    return pw_yaml_fail (b->y, node->at, error, "%s: expected one of %s; found %s", what,
                         signal_list (key, list, sizeof list), given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return pw_yaml_fail (b->y, node->at, error, "%s: a rate or acceleration belongs to an expression", what);
  if (v[SIGNAL_CONSTANT])
    return pw_yaml_number (b->y, v[SIGNAL_CONSTANT], what, PW_REAL, b->x, &signal->constant, error);
  if (v[SIGNAL_EXPRESSION]) return pw_yaml_of_time (b, kind, what, v + SIGNAL_EXPRESSION, signal, error);
  return signal_form (b, kind, &pw_signal_forms[form - SIGNAL_FORMS], what, v[form], signal, error);
}

int pw_yaml_signal (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node, pw_signal *signal,
                    pw_error *error) {
  const pw_node *const v[3] = { node, NULL, NULL };
  if (node->type == PW_YAML_MAP) return signal_map (b, kind, what, node, signal, error);
  if (node->type == PW_YAML_SCALAR && pw_yaml_moves (node->text, NULL))
    return pw_yaml_of_time (b, kind, what, v, signal, error);
  return pw_yaml_number (b->y, node, what, PW_REAL, b->x, &signal->constant, error);
}
