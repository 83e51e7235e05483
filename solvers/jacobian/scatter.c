/* Recording and layout of the sequence of contributions to a sparse matrix; see scatter.h. */
#include <stdlib.h>
#include "scatter.h"
#include "util.h"

void pw_scatter_begin_record (pw_scatter_map *t) {
  *t = (pw_scatter_map){ .recording = 1 };
}

void pw_scatter_record_entry (pw_scatter_map *t, int row, int col) {
  t->failed |= pw_grow (&t->entry, t->count, &t->room, sizeof *t->entry) != PW_OK;
  if (t->failed) return;
  t->entry[t->count] = (struct pw_scatter_entry){ row, col, t->count };
  t->count++;
}

/* By columns, then by rows. */
static int scatter_compare (const void *a, const void *b) {
  const struct pw_scatter_entry *x = a, *y = b;
  return x->col != y->col ? (x->col > y->col) - (x->col < y->col) : (x->row > y->row) - (x->row < y->row);
}

int pw_scatter_lay_out (pw_scatter_map *t, int n, int64_t **colptr, int64_t **rowind) {
  int64_t nonzeros = 0;
  t->place = malloc ((t->count + 1) * sizeof *t->place);
  *colptr = malloc (((size_t)n + 1) * sizeof **colptr);
  *rowind = malloc ((t->count + 1) * sizeof **rowind);
  if (t->failed || !t->place || !*colptr || !*rowind) return PW_RESOURCE;
  const struct pw_scatter_entry *e = t->entry;
  if (t->count > 0) qsort (t->entry, t->count, sizeof *t->entry, scatter_compare);
  for (int c = 0; c < n; c++) {
    (*colptr)[c] = nonzeros;
    for (int last_row = -1; e < t->entry + t->count && e->col == c; e++) {
      if (e->row != last_row) (*rowind)[nonzeros++] = last_row = e->row;
      t->place[e->number] = (size_t)nonzeros - 1;
    }
  }
  (*colptr)[n] = nonzeros;
  t->length = (size_t)nonzeros;
  free (t->entry);
  t->entry = NULL;
  t->recording = 0;
  return PW_OK;
}

void pw_scatter_close (pw_scatter_map *t) {
  free (t->entry);
  free (t->place);
  *t = (pw_scatter_map){ 0 };
}
