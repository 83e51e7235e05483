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

int pw_scatter_lay_out (pw_scatter_map *t, int n) {
  t->place = malloc ((t->count + 1) * sizeof *t->place);
  t->colptr = malloc (((size_t)n + 1) * sizeof *t->colptr);
  t->rowind = malloc ((t->count + 1) * sizeof *t->rowind);
  if (t->failed || !t->place || !t->colptr || !t->rowind) return PW_RESOURCE;
  const struct pw_scatter_entry *e = t->entry;
  if (t->count > 0) qsort (t->entry, t->count, sizeof *t->entry, scatter_compare);
  for (int c = 0; c < n; c++) {
    t->colptr[c] = (int64_t)t->nonzeros;
    for (int last_row = -1; e < t->entry + t->count && e->col == c; e++) {
      if (e->row != last_row) t->rowind[t->nonzeros++] = last_row = e->row;
      t->place[e->number] = t->nonzeros - 1;
    }
  }
  t->colptr[n] = (int64_t)t->nonzeros;
  free (t->entry);
  t->entry = NULL;
  t->recording = 0;
  t->value = malloc ((t->nonzeros + 1) * sizeof *t->value);
  return t->value ? PW_OK : PW_RESOURCE;
}

void pw_scatter_close (pw_scatter_map *t) {
  free (t->entry);
  free (t->place);
  free (t->colptr);
  free (t->rowind);
  free (t->value);
  *t = (pw_scatter_map){ 0 };
}
