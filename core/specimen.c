/* Builds the self-test's scene from nothing but a kind's table. */
#include <math.h>
#include <string.h>
#include "model.h"
#include "specimen.h"

/* splitmix64 (Steele, Lea, Flood 2014). */
static uint64_t specimen_next (pw_random *r) {
  uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

double pw_random_between (pw_random *r, double low, double high) {
  return low + (high - low) * ldexp ((double)(specimen_next (r) >> 11), -53);
}

/* ---- Does the table hold together? ---- */

static size_t specimen_bytes (pw_field_type type) {
  switch (type) {
  case PW_NUMBER:
    return sizeof (double);
  case PW_POINT:
  case PW_VECTOR:
    return 2 * sizeof (double);
  case PW_BODY:
    return sizeof (char *);
  case PW_SIGNAL:
    return sizeof (pw_signal);
  case PW_CHOICE:
    return sizeof (int);
  }
  return 0;
}

static const char *specimen_fields (const pw_kind *k) {
  int bodies = 0, signals = 0;
  if (k->fields == NULL) return "no table of fields";
  for (const pw_field *f = k->fields; f->name; f++) {
    size_t bytes = specimen_bytes (f->type) * (size_t)pw_field_count (f);
    if (bytes == 0) return "a field's type does not exist";
    if (f->offset < sizeof (char *) || f->offset + bytes > k->definition) return "a field lies outside the definition";
    if (f->type == PW_CHOICE && (f->choices == NULL || f->choices[0] == NULL)) return "a choice without choices";
    if (f->type == PW_BODY) bodies += pw_field_count (f);
    if (f->type == PW_SIGNAL) signals += pw_field_count (f);
  }
  if (k->each_body && (bodies > 0 || k->bodies != 1))
    return "a kind that acts on each body has one body and names none";
  if (!k->each_body && bodies != k->bodies) return "bodies is not the number of fields of type PW_BODY";
  if (signals != k->signals) return "signals is not the number of fields of type PW_SIGNAL";
  return "";
}

static const char *specimen_sweeps (const pw_kind *k) {
  pw_sweep *const exact[] = { k->g,       k->g_size, k->eta,   k->J,    k->gamma,  k->force,
                              k->force_u, k->energy, k->power, k->loss, k->contact };
  for (size_t i = 0; i < sizeof exact / sizeof *exact; i++)
    if (exact[i] == pw_by_differences) return "PW_BY_DIFFERENCES stands in another place than a second-order block's";
  if (k->constant && (k->force == NULL || k->signals > 0)) return "a constant force that is none, or has signals";
  if (k->rows > 0 && k->J == NULL) return "constraint rows without J";
  if (k->level == PW_HOLONOMIC && k->g == NULL) return "holonomic rows without g";
  return "";
}

const char *pw_specimen_fault (const pw_kind *k) {
  if (k->name == NULL || *k->name == 0) return "no name";
  if (k->definition < sizeof (char *)) return "the definition has no room for its name";
  if (k->bodies < 0 || k->bodies > PW_MAX_BODIES || k->own < 0 || k->own > PW_MAX_OWN || k->rows < 0 ||
      k->rows > PW_MAX_ROWS || k->signals < 0 || k->signals > PW_MAX_SIGNALS)
    return "more bodies, own coordinates, rows or signals than an element may have";
  if (k->bodies + k->own == 0) return "neither a body nor a coordinate of its own";
  if ((k->rows > 0) != (k->level != PW_FORCE)) return "rows and level contradict each other";
  if (k->rows > 0 && k->reaction == NULL) return "constraint rows without names of their reactions";
  if (k->own > 0 && k->coordinate == NULL) return "own coordinates without names";
  if ((k->own > 0 || k->element > 0) && k->prepare == NULL) return "something to prepare, but no prepare function";
  const char *fault = specimen_fields (k);
  return *fault ? fault : specimen_sweeps (k);
}

/* ---- Random definitions ---- */

/* What the build function is handed. */
typedef struct {
  const pw_kind *kind;
  pw_random *random;
} specimen;

static double specimen_number (pw_random *r, pw_domain domain) {
  if (domain == PW_COUNT) return floor (pw_random_between (r, 1, 6));
  if (domain == PW_FRACTION) return pw_random_between (r, 0, 1);
  if (domain == PW_NONNEGATIVE && pw_random_between (r, 0, 1) < 0.2) return 0;
  double size = pw_random_between (r, 0.3, 1.5);
  return domain == PW_REAL && pw_random_between (r, 0, 1) < 0.5 ? -size : size;
}

static pw_signal specimen_signal (pw_random *r) {
  pw_signal s = { .type = PW_HARMONIC };
  s.harmonic.amplitude = pw_random_between (r, 0.5, 1.5);
  s.harmonic.omega = pw_random_between (r, 0.5, 2);
  s.harmonic.phase = pw_random_between (r, -3, 3);
  s.harmonic.offset = pw_random_between (r, -1, 1);
  return s;
}

static int specimen_choice (pw_random *r, const pw_field *f) {
  int choices = 0;
  while (f->choices[choices]) choices++;
  return (int)floor (pw_random_between (r, 0, choices));
}

/* One value of a field.  Points stay near the centre of mass, so that bodies far apart keep their points apart. */
static void specimen_value (pw_random *r, const pw_field *f, void *at) {
  if (f->type == PW_NUMBER) *(double *)at = specimen_number (r, f->domain);
  if (f->type == PW_SIGNAL) *(pw_signal *)at = specimen_signal (r);
  if (f->type == PW_CHOICE) *(int *)at = specimen_choice (r, f);
  for (int i = 0; i < 2 && f->type == PW_POINT; i++) ((double *)at)[i] = pw_random_between (r, -0.6, 0.6);
  for (int i = 0; i < 2 && f->type == PW_VECTOR; i++) ((double *)at)[i] = specimen_number (r, PW_REAL);
}

/* Element e takes every body in turn, from another one on; the last element hangs on the ground. */
static const char *specimen_body (const specimen *x, int e, int n) {
  static const char *const name[PW_SPECIMEN_BODIES] = { "b0", "b1", "b2", "b3" };
  int last = e == PW_SPECIMEN_ELEMENTS - 1;
  if (last && x->kind->bodies > 1 && n == (int)(x->random->state % (unsigned)x->kind->bodies)) return "ground";
  return name[(e + n) % PW_SPECIMEN_BODIES];
}

static void specimen_element (pw_model *m, const specimen *x, int e) {
  static const char *const name[PW_SPECIMEN_ELEMENTS] = { "e0", "e1", "e2" };
  char *definition = pw_arena_take (&m->arena, x->kind->definition);
  if (definition == NULL) {
    pw_fail (&m->error, PW_MACHINE, "model %s: out of memory", m->name);
    return;
  }
  *(const char **)(void *)definition = name[e];
  for (const pw_field *f = x->kind->fields; f->name; f++)
    for (int i = 0; i < pw_field_count (f); i++)
      specimen_value (x->random, f, definition + f->offset + (size_t)i * specimen_bytes (f->type));
  for (int n = 0; n < x->kind->bodies && !x->kind->each_body; n++)
    *(const char **)pw_field_at (x->kind, definition, PW_BODY, n) = specimen_body (x, e, n);
  pw_add (m, x->kind, definition);
}

static void specimen_build (pw_model *m, const void *parameters) {
  static const char *const name[PW_SPECIMEN_BODIES] = { "b0", "b1", "b2", "b3" };
  const specimen *x = parameters;
  for (int b = 0; b < PW_SPECIMEN_BODIES; b++)
    pw_add_body (m, &(pw_body){ .name = name[b],
                                .mass = pw_random_between (x->random, 0.5, 2),
                                .inertia = pw_random_between (x->random, 0.1, 1) });
  for (int e = 0; e < (x->kind->each_body ? 1 : PW_SPECIMEN_ELEMENTS); e++) specimen_element (m, x, e);
}

static pw_system *specimen_try (const pw_kind *kind, pw_random *random, pw_error *error) {
  const pw_plugin_table table = {
    .abi = PW_ABI, .size = sizeof table, .parameters_size = sizeof (specimen), .build = specimen_build
  };
  pw_system *s = NULL;
  pw_model *m = pw_model_new (kind->name, &table, error);
  if (m == NULL) return NULL;
  memcpy (m->parameters, &(specimen){ kind, random }, sizeof (specimen));
  if (pw_build (m, error) == PW_OK) s = pw_compile (m, error);
  pw_model_free (m);
  return s;
}

pw_system *pw_specimen (const pw_kind *kind, pw_random *random, pw_error *error) {
  pw_error why;
  for (int i = 0; i < 50; i++) { /* a kind may refuse numbers that do not go together */
    why = (pw_error){ 0 };
    pw_system *s = specimen_try (kind, random, &why);
    if (s) return s;
    if (why.status != PW_INPUT) break;
  }
  pw_fail (error, why.status, "%s", why.text);
  return NULL;
}
