/* Sparsity of element types; see sparsity.h.  Elements on the ground, with more constant entries, do not count. */
#include <string.h>
#include "random_scene.h"
#include "sparsity.h"

enum { SPARSITY_SCENES = 12, SPARSITY_STATES = 4 };

/* The type of an entry with this value that has not changed. */
static unsigned char sparsity_of_value (double value) {
  return value == 0 ? PW_ENTRY_ZERO : value == 1 ? PW_ENTRY_ONE : value == -1 ? PW_ENTRY_MINUS_ONE : PW_ENTRY_CONSTANT;
}

/* 1 if one of the element's bodies is the ground. */
static int sparsity_is_grounded (const pw_system *s, const pw_element_batch *k, int e) {
  for (int n = 0; n < k->kind->bodies; n++)
    if (k->column[e * k->kind->bodies + n] >= s->coords) return 1;
  return 0;
}

/* Merges the entries of element e at one state into `out`.  first: its entries of J at the scene's first state, stored
 * if is_first; known: 1 if `out` has entries already. */
static void sparsity_state (const pw_element_batch *k, int e, int is_first, int known, double *first,
                            pw_sparsity *out) {
  int n = k->kind->rows * k->b.cols;
  for (int i = 0; i < n; i++) {
    double value = k->J[e * n + i];
    if (is_first) first[i] = value;
    if (!known) out->J[i] = sparsity_of_value (value);
    if (value != first[i]) out->J[i] = PW_ENTRY_VARIABLE;
    if (out->J[i] < PW_ENTRY_CONSTANT && out->J[i] != sparsity_of_value (value)) out->J[i] = PW_ENTRY_CONSTANT;
  }
  for (int c = 0; k->kind->force && c < k->b.cols; c++)
    if (k->block[e * k->b.cols + c] != 0) out->force[c] = PW_ENTRY_VARIABLE;
}

static int sparsity_scene (const pw_system *s, pw_random *random, int *known, pw_sparsity *out) {
  double q[PW_SCENE_COORDS], v[PW_SCENE_COORDS], first[PW_SCENE_BATCH][PW_MAX_ROWS * PW_MAX_COLS];
  pw_workspace *w = pw_workspace_new (s, NULL);
  if (w == NULL) return PW_RESOURCE;
  pw_element_batch *k = w->batch; /* the only one */
  for (int state = 0; state < SPARSITY_STATES; state++) {
    for (int j = 0; j < s->coords; j++) {
      q[j] = s->q0[j] + pw_random_between (random, -2, 2);
      v[j] = pw_random_between (random, -2, 2);
    }
    if (pw_update_kinematics (w, pw_random_between (random, 0, 3), q, v) != PW_OK) break;
    pw_evaluate_J (w);
    if (k->kind->force) k->kind->force (&k->b, k->block);
    for (int e = 0; e < k->b.count; e++) {
      if (sparsity_is_grounded (s, k, e)) continue;
      sparsity_state (k, e, state == 0, *known, first[e], out);
      *known = 1;
    }
  }
  pw_workspace_free (w);
  return PW_OK;
}

int pw_sparsity_find (const pw_kind *kind, pw_sparsity *out) {
  pw_random random = { .state = 7 };
  int known = 0, status = PW_OK;
  memset (out, 0, sizeof *out);
  for (int n = 0; pw_kind_is_built_in (kind) && n < SPARSITY_SCENES && status == PW_OK; n++) {
    pw_error why = { 0 };
    pw_system *s = pw_random_scene (kind, &random, &why);
    status = s ? sparsity_scene (s, &random, &known, out) : why.status == PW_RESOURCE ? PW_RESOURCE : PW_OK;
    pw_system_free (s);
  }
  if (!known) memset (out, PW_ENTRY_VARIABLE, sizeof *out);
  if (kind->force && memchr (out->force, PW_ENTRY_VARIABLE, sizeof out->force) == NULL)
    memset (out->force, PW_ENTRY_VARIABLE, sizeof out->force);
  return status;
}
