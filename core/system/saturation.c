/* The changes of positions and velocities that reverse saturating forces, such as friction (pw_kind.saturation). */
#include <math.h>
#include <stdio.h>
#include "system.h"

/* Fills the batch's block, 2 cols per element, if its forces saturate.  Returns the number of entries. */
static int saturation_fill (const pw_element_batch *k) {
  int n = k->kind->saturation ? k->b.count * 2 * k->b.cols : 0;
  for (int i = 0; i < n; i++) k->block[i] = INFINITY;
  if (n > 0) k->kind->saturation (&k->b, k->block);
  return n;
}

/* The state of entry i of the block, numbered as in pw_system_find_state; -1: the ground's. */
static int saturation_state (const pw_system *s, const pw_element_batch *k, int i) {
  int cols = k->b.cols, c = i % (2 * cols), j = pw_global (k, i / (2 * cols), c % cols);
  return j >= s->coords ? -1 : c < cols ? j : s->coords + j;
}

/* Loops over the entries i of the blocks of saturating batches k. */
#define EACH_SATURATION(k, i, w) \
  PW_EACH_BATCH (k, w)           \
    for (int i = 0, n = saturation_fill (k); i < n; i++)

void pw_evaluate_saturation (pw_workspace *w, double *least) {
  for (int j = 0; j < 2 * w->s->coords; j++) least[j] = INFINITY;
  EACH_SATURATION (k, i, w) {
    int state = saturation_state (w->s, k, i);
    if (state >= 0) least[state] = fmin (least[state], k->block[i]);
  }
}

int pw_find_saturation (pw_workspace *w, double *least, char *element, size_t size) {
  int found = -1;
  *least = INFINITY;
  EACH_SATURATION (k, i, w) {
    int state = saturation_state (w->s, k, i);
    if (state < w->s->coords || !(k->block[i] < *least)) continue;
    *least = k->block[i], found = state;
    snprintf (element, size, "%s %s", k->kind->name, k->name[i / (2 * k->b.cols)]);
  }
  return found;
}
