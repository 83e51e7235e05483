/* States in expressions: BODY.phi, and ELEMENT.spin of elements that have coordinates of their own. */
#include <string.h>
#include "yaml.h"

/* The index of a kind's name in pw_kinds, or -1. */
static int state_kind (const char *name) {
  for (int i = 0; pw_kinds[i]; i++)
    if (strcmp (pw_kinds[i]->name, name) == 0) return i;
  return -1;
}

/* All elements by name, those too that have not been built yet; what is wrong with them is said then. */
static int state_elements (pw_yaml_builder *b, pw_error *error) {
  const pw_node *list = b->y->elements;
  if (b->elements.slot) return PW_OK;
  if (pw_names_open (&b->elements, list ? (size_t)list->count : 0) != PW_OK) return pw_yaml_no_memory (b->y, error);
  for (const pw_node *n = list ? list->first : NULL; n; n = n->next) {
    const pw_node *key = n->type == PW_YAML_MAP ? n->first : NULL;
    int kind = key && key->type == PW_YAML_SCALAR && key->next->type == PW_YAML_SCALAR ? state_kind (key->text) : -1;
    if (kind >= 0) pw_names_add (&b->elements, key->next->text, kind);
  }
  return PW_OK;
}

static int state_no_owner (pw_yaml_builder *b, const pw_yaml_reading *r, const char *owner, size_t at,
                           pw_error *error) {
  char hint[200];
  pw_nearest near = { .sought = owner };
  int bodies;
  const pw_body *body = pw_model_bodies (b->m, &bodies);
  for (int i = 0; i < bodies; i++) pw_nearest_try (&near, body[i].name);
  for (size_t i = 0; i < b->elements.size; i++) {
    const struct pw_name *e = &b->elements.slot[i];
    if (e->name && pw_kinds[e->value]->own > 0) pw_nearest_try (&near, e->name);
  }
  return pw_yaml_fail (b->y, pw_yaml_place (b->y, r->node, at), error, "%s: there is no body \"%s\"%s", r->what, owner,
                       pw_nearest_text (&near, hint, sizeof hint));
}

static int state_of_element (pw_yaml_builder *b, const pw_yaml_reading *r, const char *owner, const char *part,
                             size_t at, pw_error *error) {
  char list[200] = "";
  if (state_elements (b, error) != PW_OK) return error->status;
  int found = pw_names_find (&b->elements, owner);
  if (found < 0) return state_no_owner (b, r, owner, at, error);
  const pw_kind *kind = pw_kinds[found];
  if (kind->own == 0)
    return pw_yaml_fail (b->y, pw_yaml_place (b->y, r->node, at), error, "%s: %s %s has no states of its own", r->what,
                         kind->name, owner);
  for (int i = 0; i < kind->own; i++) {
    const pw_quantity *own = &kind->coordinate[i];
    if (strcmp (part, own->name) == 0 || strcmp (part, own->rate) == 0) return PW_OK;
    size_t n = strlen (list);
    snprintf (list + n, sizeof list - n, "%s%s, %s", i ? ", " : "", own->name, own->rate);
  }
  return pw_yaml_fail (b->y, pw_yaml_place (b->y, r->node, at + strlen (owner) + 1), error,
                       "%s: the states of %s %s are %s, not \"%.30s\"", r->what, kind->name, owner, list, part);
}

int pw_yaml_state (pw_yaml_builder *b, const pw_yaml_reading *r, const char *name, size_t at, pw_error *error) {
  static const char *const part[] = { "x", "y", "phi", "vx", "vy", "omega", NULL };
  char owner[100];
  size_t n = strcspn (name, ".");
  int i = 0;
  snprintf (owner, sizeof owner, "%.*s", (int)n, name);
  if (pw_names_find (&b->bodies, owner) < 0) return state_of_element (b, r, owner, name + n + 1, at, error);
  while (part[i] && strcmp (part[i], name + n + 1) != 0) i++;
  if (part[i]) return PW_OK;
  return pw_yaml_fail (b->y, pw_yaml_place (b->y, r->node, at + n + 1), error,
                       "%s: a body's states are x, y, phi, vx, vy and omega, not \"%.30s\"", r->what, name + n + 1);
}
