/* Repeated assembly of a sparse matrix by the same sequence of contributions: the sequence is recorded once and laid
 * out in compressed columns; from then on the number of a contribution determines its position. */
#ifndef PW_SCATTER_H
#define PW_SCATTER_H

#include <stdint.h>
#include "pinwheel.h"

typedef struct {
  int recording;
  size_t count, room; /* number of contributions; allocated number while recording */
  struct pw_scatter_entry {
    int row, col;
    size_t number;
  } * entry;     /* while recording */
  size_t *place; /* index in `value` of each contribution */
  size_t next;   /* number of the next contribution */
  double *value; /* while filling */
  int failed;    /* out of memory while recording */
} pw_scatter_map;

void pw_scatter_record (pw_scatter_map *t);
/* Ends the recording: colptr (n + 1) and rowind (nonzeros) are allocated with malloc for the caller.  PW_RESOURCE. */
int pw_scatter_lay_out (pw_scatter_map *t, int n, int64_t **colptr, int64_t **rowind);
void pw_scatter_close (pw_scatter_map *t);

/* Begins filling the values, which the caller has zeroed. */
static inline void pw_scatter_begin (pw_scatter_map *t, double *value) {
  t->next = 0;
  t->value = value;
}

void pw_scatter_note (pw_scatter_map *t, int row, int col);

static inline void pw_scatter_add (pw_scatter_map *t, int row, int col, double value) {
  if (t->recording)
    pw_scatter_note (t, row, col);
  else
    t->value[t->place[t->next++]] += value;
}

#endif
