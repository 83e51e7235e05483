/* A model as text, from the file to some steps of a run; mutated by lines and words as well as by bytes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fuzz.h"
#include "model.h"
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"
#include "system.h"

/* A few steps: what a description can do to the solvers. */
static void model_run (pw_system *s, const char *method) {
  pw_error error = { 0 };
  pw_settings settings = { .step = 1e-3, .span = 1e-2, .ledger = 1 };
  pw_run *r = s->coords <= 60 && s->rows <= 60 ? pw_open (s, method, &settings, &error) : NULL;
  for (int i = 0; r && i < 3 && error.status == PW_OK; i++) pw_advance (r, 1, &error);
  if (r) pw_close (r);
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const char *const methods[] = { "rk4+projection", "ida+ggl", "erk5+nullspace", "galpha+ggl",
                                         "bdf+projection" };
  pw_error error = { 0 };
  pw_file *file = pw_file_open (fuzz_file (data, size, ".yaml"), &error);
  pw_model *m = file ? pw_file_model (file, &error) : NULL;
  pw_system *s = m && pw_build (m, &error) == PW_OK ? pw_compile (m, &error) : NULL;
  if (s == NULL && error.status >= 0) abort (); /* what fails says so */
  if (s) model_run (s, methods[size % 5]);
  pw_free (s);
  pw_model_free (m);
  pw_file_close (file);
  return 0;
}

/* ---- Mutations along the grammar ---- */

size_t LLVMFuzzerMutate (uint8_t *data, size_t size, size_t most);
size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed);

/* Begin and end of the piece at a random place: a line, or a word. */
static void model_piece (const uint8_t *data, size_t size, unsigned at, const char *stops, size_t *from, size_t *to) {
  *from = *to = size ? at % size : 0;
  while (*from > 0 && strchr (stops, data[*from - 1]) == NULL) --*from;
  while (*to < size && (data[*to] == 0 || strchr (stops, data[*to]) == NULL)) ++*to;
}

/* One in four changes is by bytes; the others put a copy of one piece in the place of another, before it, or nowhere. */
size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed) {
  const char *stops = seed & 1 ? "\n" : " ,:[]{}()+-*/^\n";
  size_t a, b, c, d;
  if (seed % 4 == 3 || size < 4) return LLVMFuzzerMutate (data, size, most);
  model_piece (data, size, seed / 8, stops, &a, &b);
  model_piece (data, size, seed / 8 * 2654435761u, stops, &c, &d);
  size_t put = seed & 4 ? b - a : 0, over = seed & 2 ? d - c : 0;
  if (size + put - over > most) return size;
  uint8_t *piece = malloc (put + 1);
  if (piece == NULL) return size;
  memcpy (piece, data + a, put);
  memmove (data + c + put, data + c + over, size - c - over);
  memcpy (data + c, piece, put);
  free (piece);
  return size + put - over;
}
