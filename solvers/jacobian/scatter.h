/* Repeated assembly of a sparse matrix by the same sequence of contributions: the sequence is recorded once and laid
 * out in compressed columns; from then on the number of a contribution in the sequence determines where it is added. */
#ifndef PW_SCATTER_H
#define PW_SCATTER_H

#include <stdint.h>
#include <string.h>
#include "pinwheel.h"

typedef struct {
  int recording;      /* 1: contributions are recorded; 0: they are added */
  size_t count, room; /* number of contributions; number that `entry` has room for */
  struct pw_scatter_entry {
    int row, col;
    size_t number;
  } * entry;     /* while recording */
  size_t *place; /* of each contribution: the index in `value` to which it is added */
  size_t length; /* of `value`: nonzeros of the matrix laid out */
  size_t next;   /* while filling: number of the next contribution */
  double *value; /* while filling: the matrix */
  int failed;    /* 1: out of memory while recording */
} pw_scatter_map;

/* From now on contributions are recorded; their values are ignored.  *t: new or closed; it is overwritten. */
void pw_scatter_begin_record (pw_scatter_map *t);

/* Ends the recording, of a matrix with n columns.  PW_OK or PW_RESOURCE; free colptr (n + 1) and rowind (nonzeros) in
 * both cases. */
int pw_scatter_lay_out (pw_scatter_map *t, int n, int64_t **colptr, int64_t **rowind);
void pw_scatter_close (pw_scatter_map *t);

/* From now on contributions are added to these values, which are set to 0 first. */
static inline void pw_scatter_begin_fill (pw_scatter_map *t, double *value) {
  t->next = 0;
  t->value = memset (value, 0, t->length * sizeof *value);
}

void pw_scatter_record_entry (pw_scatter_map *t, int row, int col);

/* The next contribution. */
static inline void pw_scatter_add (pw_scatter_map *t, int row, int col, double value) {
  if (t->recording)
    pw_scatter_record_entry (t, row, col);
  else
    t->value[t->place[t->next++]] += value;
}

#endif
