/* Recording and layout of repeated sparse assemblies; see scatter.h. */
#include <stdlib.h>
#include <string.h>
#include "scatter.h"

void pw_scatter_record (pw_scatter_map *t) {
  *t = (pw_scatter_map){ .recording = 1 };
}

void pw_scatter_note (pw_scatter_map *t, int row, int col) {
  if (t->failed) return;
  if (t->count == t->room) {
    size_t room = t->room ? 2 * t->room : 256;
    int *rows = realloc (t->row, room * sizeof *rows);
    if (rows) t->row = rows;
    int *cols = rows ? realloc (t->col, room * sizeof *cols) : NULL;
    if (cols == NULL) {
      t->failed = 1;
      return;
    }
    t->col = cols;
    t->room = room;
  }
  t->row[t->count] = row;
  t->col[t->count++] = col;
}

/* Sorts contributions by a key in [0, n), stably; `order`: their indices, `start` (n + 1): the range of each key. */
static void scatter_sort (const int *key, const size_t *from, size_t count, int n, size_t *start, size_t *order) {
  memset (start, 0, ((size_t)n + 2) * sizeof *start);
  for (size_t i = 0; i < count; i++) start[key[i] + 2]++;
  for (int k = 0; k < n; k++) start[k + 2] += start[k + 1];
  for (size_t i = 0; i < count; i++) {
    size_t c = from ? from[i] : i;
    order[start[key[c] + 1]++] = c;
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
    scatter_sort (t->row, NULL, t->count, n, start, by_row);
    scatter_sort (t->col, by_row, t->count, n, start, order);
    int64_t nonzeros = 0;
    size_t i = 0;
    for (int c = 0; c < n; c++) {
      (*colptr)[c] = nonzeros;
      for (int last = -1; i < t->count && t->col[order[i]] == c; i++) {
        if (t->row[order[i]] != last) (*rowind)[nonzeros++] = last = t->row[order[i]];
        t->place[order[i]] = (size_t)nonzeros - 1;
      }
    }
    (*colptr)[n] = nonzeros;
    t->recording = 0;
  }
  free (by_row);
  free (order);
  free (start);
  free (t->row);
  free (t->col);
  t->row = t->col = NULL;
  if (status == PW_OK) return PW_OK;
  free (*colptr);
  free (*rowind);
  *colptr = *rowind = NULL;
  return status;
}

void pw_scatter_close (pw_scatter_map *t) {
  free (t->row);
  free (t->col);
  free (t->place);
  *t = (pw_scatter_map){ 0 };
}
