/* A checkpoint: the file as it is, its state loaded into a run whatever its check sum, and one that a run has written,
 * forged: numbers of its state changed, its check sum made right, and resumed by the command. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"
#include "fuzz.h"
#include "pinwheel-files.h"
#include "method.h"
#include "util.h"

static const char *const checkpoint_methods[] = { "rk4+projection", "erk8+projection", "ida+ggl",
                                                  "bdf+projection", "radau+ggl",       "galpha+ggl",
                                                  "adams",          "rk4+baumgarte",   "erk5+nullspace" };
enum { CHECKPOINT_METHODS = sizeof checkpoint_methods / sizeof *checkpoint_methods };

/* The bytes as a state after the identity of the run, whatever they are. */
static void checkpoint_load (const uint8_t *data, size_t size, const char *method) {
  pw_error error = { 0 };
  pw_settings settings = { .step = 1e-3, .rtol = 1e-6, .span = 1, .ledger = 1 };
  pw_run *r = pw_run_open (fuzz_pendulum (), method, &settings, &error);
  if (r == NULL) abort ();
  pw_archive saved = { .at = NULL };
  pw_archive_bytes (&saved, &(unsigned long long){ r->identity }, sizeof r->identity);
  pw_archive_bytes (&saved, (uint8_t *)(size_t)data, size);
  pw_archive a = { .at = saved.at, .size = saved.used, .loading = 1 };
  if (pw_run_load (r, &a, &error) == PW_OK) {
    double t = pw_run_time (r);
    for (int i = 0; i < 2 && error.status == PW_OK && t < 1e6; i++) pw_run_advance (r, t + 1e-3, &error);
  } else if (error.status >= 0)
    abort ();
  pw_archive_free (&saved);
  pw_run_close (r);
}

/* ---- Forged ---- */

static char checkpoint_path[200], checkpoint_summary[200];

static void checkpoint_remove (void) {
  remove (checkpoint_path);
  remove (checkpoint_summary);
}

static int checkpoint_command (int method, int resume) {
  const char *argv[] = { "pinwheel run",
                         "models/linkages/pendulum.yaml",
                         "-t0.1",
                         "--step=1e-3",
                         "--rtol=1e-9",
                         "--limit=2",
                         "--max-steps=2000",
                         "-m",
                         checkpoint_methods[method],
                         "--json",
                         checkpoint_summary,
                         resume ? "--resume" : "--checkpoint",
                         checkpoint_path,
                         resume ? NULL : "--checkpoint-every=0.01",
                         NULL };
  return pw_cli_main (&pw_cli_run, NULL, resume ? 13 : 14, argv);
}

/* What a run with a method writes, made once and kept. */
static const uint8_t *checkpoint_valid (int method, size_t *size) {
  static uint8_t data[CHECKPOINT_METHODS][1 << 16];
  static size_t used[CHECKPOINT_METHODS];
  if (*checkpoint_path == 0) {
    const char *folder = getenv ("TMPDIR");
    snprintf (checkpoint_path, sizeof checkpoint_path, "%s/fuzz-forged-%ld.ck", folder ? folder : "/tmp",
              (long)getpid ());
    snprintf (checkpoint_summary, sizeof checkpoint_summary, "%s/fuzz-forged-%ld.json", folder ? folder : "/tmp",
              (long)getpid ());
    atexit (checkpoint_remove);
  }
  if (used[method] == 0) {
    remove (checkpoint_path);
    if (checkpoint_command (method, 0) != 0) abort ();
    FILE *f = fopen (checkpoint_path, "rb");
    if (f == NULL) abort ();
    used[method] = fread (data[method], 1, sizeof data[method], f);
    fclose (f);
  }
  *size = used[method];
  return data[method];
}

/* One edit of ten bytes: a place, and what is put there: a number, or a special one. */
static void checkpoint_edit (uint8_t *state, size_t size, const uint8_t *edit) {
  static const double special[] = { 0, -1, 1e300, -1e300, 1e-320, 0.0199, 1e9 };
  size_t at = ((size_t)edit[0] << 8 | edit[1]) % size;
  double value;
  memcpy (&value, edit + 2, sizeof value);
  if (edit[2] < 7) value = special[edit[2]];
  if (edit[3] < 128) at -= at % 8;
  if (at + sizeof value <= size) memcpy (state + at, &value, sizeof value);
}

static void checkpoint_forge (const uint8_t *edit, size_t count, int method) {
  size_t size;
  const uint8_t *valid = checkpoint_valid (method, &size);
  uint8_t *copy = malloc (size + 1);
  if (copy == NULL) exit (1);
  memcpy (copy, valid, size);
  copy[size] = 0;
  uint8_t *line = copy;
  while (strncmp ((char *)line, "\nend\nstate = ", 13) != 0) line++;
  line += 5;
  uint8_t *sum = (uint8_t *)strstr ((char *)line, "sum ") + 4, *state = sum + 17;
  size_t states = (size_t)(copy + size - state);
  for (size_t i = 0; i < count; i++) checkpoint_edit (state, states, edit + 10 * i);
  char text[17];
  unsigned long long whole = pw_check_sum (PW_CHECK, copy, (size_t)(line - copy));
  snprintf (text, sizeof text, "%016llx", pw_check_sum (whole, state, states));
  memcpy (sum, text, 16);
  FILE *f = fopen (checkpoint_path, "wb");
  if (f == NULL || fwrite (copy, 1, size, f) != size || fclose (f) != 0) exit (1);
  free (copy);
  int status = checkpoint_command (method, 1);
  if (status < 0 || status > 4 || (count == 0 && status != 0)) abort ();
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  pw_error error = { 0 };
  pw_checkpoint c;
  if (size < 1) return 0;
  int method = data[0] % CHECKPOINT_METHODS;
  if (data[0] & 128) {
    checkpoint_forge (data + 1, (size - 1) / 10 < 8 ? (size - 1) / 10 : 8, method);
    return 0;
  }
  if (pw_checkpoint_read (fuzz_file (data + 1, size - 1, ".ck"), &c, &error) == PW_OK)
    checkpoint_load (c.state.at, c.state.size, checkpoint_methods[method]);
  pw_checkpoint_free (&c);
  uint8_t *copy = (uint8_t *)fuzz_text (data + 1, size - 1);
  checkpoint_load (copy, size - 1, checkpoint_methods[method]);
  free (copy);
  return 0;
}
