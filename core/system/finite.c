/* Finds the element with non-finite values, for error messages. */
#include <math.h>
#include <stdio.h>
#include "system.h"

int pw_find_nonfinite (pw_workspace *w, char *buffer, size_t size) {
  PW_EACH_BATCH (k, w) {
    const int rows = k->kind->rows, cols = k->b.cols;
    const struct {
      const char *name;
      pw_batch_function *function;
      double *value;
      int each; /* numbers of an element */
    } part[] = { { "force", k->kind->force, k->block, cols },
                 { "J", rows ? k->kind->J : NULL, k->J, rows * cols },
                 { "gamma", rows ? k->kind->gamma : NULL, w->scratch + k->row, rows } };
    for (int p = 0; p < 3; p++) {
      if (part[p].function) part[p].function (&k->b, part[p].value);
      for (int i = 0; part[p].function && i < k->b.count * part[p].each; i++) {
        if (isfinite (part[p].value[i])) continue;
        snprintf (buffer, size, "%s of %s %s", part[p].name, k->kind->name, k->name[i / part[p].each]);
        return 1;
      }
    }
  }
  return 0;
}
