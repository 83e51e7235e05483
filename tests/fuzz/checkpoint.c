/* A checkpoint: the file as it is, and, with its check sum made right, its state loaded into a run. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fuzz.h"
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* The bytes as a state, whatever they are. */
static void checkpoint_load (const uint8_t *data, size_t size, const char *method) {
  pw_error error = { 0 };
  pw_settings settings = { .step = 1e-3, .rtol = 1e-6, .span = 1, .ledger = 1 };
  pw_run *r = pw_open (fuzz_pendulum (), method, &settings, &error);
  pw_archive a = { .at = (unsigned char *)(size_t)data, .size = size, .loading = 1 };
  if (r == NULL) abort ();
  if (pw_run_load (r, &a, &error) == PW_OK) {
    double t = pw_time (r);
    for (int i = 0; i < 2 && error.status == PW_OK && t < 1e6; i++) pw_advance (r, t + 1e-3, &error);
  } else if (error.status >= 0)
    abort ();
  pw_close (r);
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const char *const methods[] = { "rk4+projection", "erk8+projection", "ida+ggl",
                                         "bdf+projection", "galpha+ggl",      "adams" };
  pw_error error = { 0 };
  pw_checkpoint c;
  if (size < 1) return 0;
  const char *method = methods[data[0] % 6];
  if (pw_checkpoint_read (fuzz_file (data + 1, size - 1, ".ck"), &c, &error) == PW_OK)
    checkpoint_load (c.state.at, c.state.size, method);
  pw_checkpoint_free (&c);
  uint8_t *copy = (uint8_t *)fuzz_text (data + 1, size - 1);
  checkpoint_load (copy, size - 1, method);
  free (copy);
  return 0;
}
