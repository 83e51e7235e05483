/* Recording and layout of repeated sparse assemblies; see scatter.h. */
#include <stdlib.h>
#include <string.h>
#include "scatter.h"
#include "util.h"

void pw_scatter_record (pw_scatter_map *t) {
  *t = (pw_scatter_map){ .recording = 1 };
}

void pw_scatter_note (pw_scatter_map *t, int row, int col) {
  t->failed |= pw_grow (&t->entry, t->count, &t->room, sizeof *t->entry) != PW_OK;
  if (!t->failed) t->entry[t->count++] = (struct pw_scatter_entry){ row, col };
}

static int scatter_key (const struct pw_scatter_entry *e, int by_column) {
  return by_column ? e->col : e->row;
}

/* Sorts contributions by row or column, in [0, n), stably; `order`: their indices, `start` (n + 1): the range of each. */
static void scatter_sort (const pw_scatter_map *t, int by_column, const size_t *from, int n, size_t *start,
                          size_t *order) {
  memset (start, 0, ((size_t)n + 2) * sizeof *start);
  for (size_t i = 0; i < t->count; i++) start[scatter_key (&t->entry[i], by_column) + 2]++;
  for (int k = 0; k < n; k++) start[k + 2] += start[k + 1];
  for (size_t i = 0; i < t->count; i++) {
    size_t c = from ? from[i] : i;
    order[start[scatter_key (&t->entry[c], by_column) + 1]++] = c;
  }
}

int pw_scatter_lay_out (pw_scatter_map *t, int n, int64_t **colptr, int64_t **rowind) {
  size_t *by_row = malloc ((t->count + 1) * sizeof *by_row), *order = malloc ((t->count + 1) * sizeof *order);
  size_t *start = malloc (((size_t)n + 2) * sizeof *start);
  t->place = malloc ((t->count + 1) * sizeof *t->place);
  *colptr = malloc (((size_t)n + 1) * sizeof **colptr);
  *rowind = malloc ((t->count + 1) * sizeof **rowind);
  int status = !t->failed && by_row && order && start && t->place && *colptr && *rowind ? PW_OK : PW_RESOURCE;
  if (status == PW_OK) {
    scatter_sort (t, 0, NULL, n, start, by_row);
    scatter_sort (t, 1, by_row, n, start, order);
    int64_t nonzeros = 0;
    size_t i = 0;
    for (int c = 0; c < n; c++) {
      (*colptr)[c] = nonzeros;
      for (int last = -1; i < t->count && t->entry[order[i]].col == c; i++) {
        int row = t->entry[order[i]].row;
        if (row != last) (*rowind)[nonzeros++] = last = row;
        t->place[order[i]] = (size_t)nonzeros - 1;
      }
    }
    (*colptr)[n] = nonzeros;
    t->recording = 0;
  }
  free (by_row);
  free (order);
  free (start);
  free (t->entry);
  t->entry = NULL;
  if (status == PW_OK) return PW_OK;
  free (*colptr);
  free (*rowind);
  *colptr = *rowind = NULL;
  return status;
}

void pw_scatter_close (pw_scatter_map *t) {
  free (t->entry);
  free (t->place);
  *t = (pw_scatter_map){ 0 };
}
