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
  } * entry;                /* while recording */
  int failed;               /* 1: out of memory while recording */
  int64_t *colptr, *rowind; /* the pattern laid out, in compressed columns */
  size_t nonzeros;          /* of the matrix */
  double *value;            /* nonzeros: for the values; callers may have them elsewhere */
  size_t *place;            /* of each contribution: the index of the value to which it is added */
  size_t next;              /* while filling: number of the next contribution */
  double *filled;           /* while filling: the values */
} pw_scatter_map;

/* From now on contributions are recorded; their values are ignored.  *t: new or closed; it is overwritten. */
void pw_scatter_begin_record (pw_scatter_map *t);

/* Ends the recording, of a matrix with n columns.  PW_OK or PW_RESOURCE; close the map in both cases. */
int pw_scatter_lay_out (pw_scatter_map *t, int n);
void pw_scatter_close (pw_scatter_map *t);

/* From now on contributions are added to these values, which are set to 0 first. */
static inline void pw_scatter_begin_fill (pw_scatter_map *t, double *value) {
  t->next = 0;
  t->filled = memset (value, 0, t->nonzeros * sizeof *value);
}

void pw_scatter_record_entry (pw_scatter_map *t, int row, int col);

/* The next contribution. */
static inline void pw_scatter_add (pw_scatter_map *t, int row, int col, double value) {
  if (t->recording)
    pw_scatter_record_entry (t, row, col);
  else
    t->filled[t->place[t->next++]] += value;
}

#endif
