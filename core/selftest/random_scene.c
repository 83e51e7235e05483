/* Builds the scene of the self-test from the table of an element type. */
#include <string.h>
#include "selftest.h"

double pw_random_between (pw_random *r, double low, double high) {
  return low + (high - low) * ldexp ((double)(pw_random_bits (&r->state) >> 11), -53);
}

typedef struct {
  const pw_kind *kind;
  pw_random *random;
} random_scene;

static double scene_number (pw_random *r, pw_domain domain) {
  if (domain == PW_COUNT) return floor (pw_random_between (r, 1, 6));
  if (domain == PW_FRACTION) return pw_random_between (r, 0, 1);
  if (domain == PW_NONNEGATIVE && pw_random_between (r, 0, 1) < 0.2) return 0;
  double size = pw_random_between (r, 0.3, 1.5);
  return domain == PW_REAL && pw_random_between (r, 0, 1) < 0.5 ? -size : size;
}

/* One value of a field.  Points are near the centre of mass, so that points of distant bodies do not coincide. */
static void scene_value (pw_random *r, const pw_field *f, void *at) {
  int is_default = f->type == PW_NUMBER && f->domain == PW_REAL && !f->required && pw_random_between (r, 0, 1) < 0.2;
  if (f->type == PW_NUMBER) *(double *)at = is_default ? 0 : scene_number (r, f->domain);
  if (f->type == PW_SIGNAL && !f->limit) {
    pw_harmonic *h = &((pw_signal *)at)->harmonic;
    ((pw_signal *)at)->type = PW_HARMONIC;
    h->amplitude = pw_random_between (r, 0.5, 1.5), h->omega = pw_random_between (r, 0.5, 2);
    h->phase = pw_random_between (r, -3, 3), h->offset = pw_random_between (r, -1, 1);
  }
  if (f->limit && !f[-1].limit)
    ((pw_signal *)at)->constant = scene_number (r, PW_NONNEGATIVE); /* that while sliding: 0 */
  int choices = 0;
  while (f->type == PW_CHOICE && f->choices[choices]) choices++;
  if (f->type == PW_CHOICE) *(int *)at = (int)floor (pw_random_between (r, 0, choices));
  for (int i = 0; i < 2 && f->type == PW_POINT; i++) ((double *)at)[i] = pw_random_between (r, -0.6, 0.6);
  for (int i = 0; i < 2 && f->type == PW_VECTOR; i++) ((double *)at)[i] = scene_number (r, PW_REAL);
}

static const char *const scene_bodies[PW_SCENE_BODIES] = { "b0", "b1", "b2", "b3" };

/* Element e acts on bodies e, e + 1, ...; of the last element, if it has several bodies, one is the ground. */
static const char *scene_body (const random_scene *x, int e, int n) {
  int last = e == PW_SCENE_ELEMENTS - 1;
  if (last && x->kind->bodies > 1 && n == (int)(x->random->state % (unsigned)x->kind->bodies)) return "ground";
  return scene_bodies[(e + n) % PW_SCENE_BODIES];
}

static void scene_element (pw_model *m, const random_scene *x, int e) {
  static const char *const name[PW_SCENE_ELEMENTS] = { "e0", "e1", "e2" };
  char *definition = pw_arena_alloc (&m->arena, x->kind->definition);
  if (definition == NULL) {
    pw_fail (&m->error, PW_RESOURCE, "model %s: out of memory", m->name);
    return;
  }
  *(const char **)(void *)definition = name[e];
  do
    for (const pw_field *f = x->kind->fields; f->name; f++)
      for (int i = 0; i < pw_field_count (f); i++)
        scene_value (x->random, f, definition + f->offset + (size_t)i * pw_field_bytes (f->type));
  while (x->kind->exact && x->kind->is_exact (definition));
  for (int n = 0; n < x->kind->bodies && !x->kind->each_body; n++)
    *(const char **)pw_field_mutable (x->kind, definition, PW_BODY, n) = scene_body (x, e, n);
  pw_add (m, x->kind, definition);
}

static void scene_build (pw_model *m, const void *parameters) {
  const random_scene *x = parameters;
  for (int b = 0; b < PW_SCENE_BODIES; b++)
    pw_add_body (m, &(pw_body){ .name = scene_bodies[b],
                                .mass = pw_random_between (x->random, 0.5, 2),
                                .inertia = pw_random_between (x->random, 0.1, 1) });
  for (int e = 0; e < (x->kind->each_body ? 1 : PW_SCENE_ELEMENTS); e++) scene_element (m, x, e);
}

static pw_system *scene_try (const pw_kind *kind, pw_random *random, pw_error *error) {
  const pw_plugin_table table = {
    .abi = PW_ABI, .size = sizeof table, .parameters_size = sizeof (random_scene), .build = scene_build
  };
  pw_system *s = NULL;
  pw_model *m = pw_model_new (kind->name, &table, error);
  if (m == NULL) return NULL;
  memcpy (m->parameters, &(random_scene){ kind, random }, sizeof (random_scene));
  if (pw_model_build (m, error) == PW_OK) s = pw_system_compile (m, error);
  pw_model_free (m);
  return s;
}

pw_system *pw_random_scene (const pw_kind *kind, pw_random *random, pw_error *error) {
  for (int i = 0; i < 2000; i++) { /* the type may reject inconsistent numbers */
    *error = (pw_error){ 0 };
    pw_system *s = scene_try (kind, random, error);
    if (s || error->status != PW_INPUT) return s;
  }
  return NULL;
}
