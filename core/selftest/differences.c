/* Second-order blocks of a scene that are computed by differences, and non-zero ones that are NULL in the table. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "random_scene.h"

static const char *const differences_name[PW_BLOCKS] = {
  [PW_JW_Q] = "jw_q",       [PW_JTL_Q] = "jw_q",      [PW_ETA_Q] = "eta_q",     [PW_GAMMA_Q] = "gamma_q",
  [PW_GAMMA_V] = "gamma_v", [PW_FORCE_Q] = "force_q", [PW_FORCE_V] = "force_v",
};

/* The batch of the i-th block that is computed by differences, and which *block of it, a pw_block; NULL if there are
 * fewer.  PW_JTL_Q is not counted: a type gives it by jw_q. */
static const pw_element_batch *differences_find (const pw_system *s, int i, int *block) {
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++)
    for (*block = 0; *block < PW_BLOCKS; ++*block)
      if (*block != PW_JTL_Q && pw_block_function (k->kind, (pw_block)*block) == pw_by_differences && i-- == 0)
        return k;
  return NULL;
}

int pw_system_differences (const pw_system *s) {
  int block, count = 0;
  while (differences_find (s, count, &block)) count++;
  return count;
}

char *pw_system_difference_name (const pw_system *s, int i, char *buffer, size_t size) {
  int block;
  const pw_element_batch *k = differences_find (s, i, &block);
  if (size > 0) buffer[0] = 0;
  if (k) snprintf (buffer, size, "%s of element type %s", differences_name[block], k->kind->name);
  return buffer;
}

/* ---- Missing blocks ---- */

/* Tests each block of the first, the last and a middle element of the batch: 1 if one is missing, with its name. */
static int differences_test (const pw_workspace *w, pw_element_batch *k, char *buffer, size_t size) {
  const int element[] = { 0, k->b.count - 1, k->b.count / 2 };
  for (int block = 0; block < PW_BLOCKS; block++)
    for (int i = 0; i < 3 && k->b.count > 0; i++) {
      if (!pw_block_missing (w, k, element[i], (pw_block)block)) continue;
      snprintf (buffer, size, "%s of element type %s", differences_name[block], k->kind->name);
      return 1;
    }
  return 0;
}

/* Searches a batch, with random k->b.w, multipliers and signals.  Returns as pw_find_missing_block. */
static int differences_search (pw_workspace *w, pw_element_batch *k, pw_random *random, char *buffer, size_t size) {
  int cols = k->b.count * k->b.cols, rows = k->b.count * k->kind->rows;
  double *x = malloc (((size_t)cols + (size_t)rows + 1) * sizeof *x);
  if (x == NULL) return PW_RESOURCE;
  for (int i = 0; i < cols + rows; i++) x[i] = pw_random_between (random, -1, 1);
  for (int i = 0; i < 3 * k->b.count * k->kind->signals; i++) k->u[i] = pw_random_between (random, -1, 1);
  k->b.w = x, k->b.lambda = x + cols;
  int found = differences_test (w, k, buffer, size);
  k->b.w = k->b.lambda = NULL;
  free (x);
  return found;
}

int pw_find_missing_block (pw_workspace *w, double t, const double *q, const double *v, char *buffer, size_t size) {
  const pw_system *s = w->s;
  const pw_source *failed = w->failed;
  pw_random random = { 1 };
  int not_built_in = 0, found = 0;
  for (pw_element_batch *k = w->batch; k < w->batch + s->batches; k++) not_built_in += !pw_kind_is_built_in (k->kind);
  if (not_built_in == 0) return 0;
  /* near the given state, at which blocks may vanish by chance or by symmetry */
  double *state = malloc ((2 * (size_t)s->coords + 1) * sizeof *state);
  if (state == NULL) return PW_RESOURCE;
  for (int i = 0; i < 2 * s->coords; i++) {
    int velocity = i >= s->coords, j = velocity ? i - s->coords : i;
    double unit = pw_unit (s, j) / (velocity ? w->scale.time : 1);
    state[i] = (velocity ? v[j] : q[j]) + 0.1 * unit * pw_random_between (&random, -1, 1);
  }
  (void)pw_update_kinematics (w, t, state, state + s->coords); /* signals may fail: random ones replace them */
  for (pw_element_batch *k = w->batch; found == 0 && k < w->batch + s->batches; k++)
    if (!pw_kind_is_built_in (k->kind)) found = differences_search (w, k, &random, buffer, size);
  free (state);
  w->failed = failed;
  w->t_signal = NAN; /* the search has changed the values of signals */
  return found;
}
