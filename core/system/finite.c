/* Finds the element with non-finite values, for error messages. */
#include <math.h>
#include <stdio.h>
#include "system.h"

/* The first of `count` elements, of `each` numbers, with one that is not finite; -1: there is none. */
static int finite_first (const double *x, int count, int each) {
  for (int i = 0; i < count * each; i++)
    if (!isfinite (x[i])) return i / each;
  return -1;
}

int pw_find_nonfinite (pw_workspace *w, char *buffer, size_t size) {
  for (pw_element_batch *k = w->batch; k < w->batch + w->s->batches; k++) {
    const char *what = "force";
    int e = -1, rows = k->kind->rows, n = k->b.count;
    if (k->kind->force) {
      k->kind->force (&k->b, k->block);
      e = finite_first (k->block, n, k->b.cols);
    }
    if (e < 0 && rows > 0) {
      k->kind->J (&k->b, k->J);
      what = "J", e = finite_first (k->J, n, rows * k->b.cols);
    }
    if (e < 0 && rows > 0 && k->kind->gamma) {
      k->kind->gamma (&k->b, w->scratch + k->row);
      what = "gamma", e = finite_first (w->scratch + k->row, n, rows);
    }
    if (e < 0) continue;
    snprintf (buffer, size, "%s of %s %s", what, k->kind->name, k->name[e]);
    return 1;
  }
  return 0;
}
