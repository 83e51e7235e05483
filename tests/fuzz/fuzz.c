#define _POSIX_C_SOURCE 200809L
#include "fuzz.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "pinwheel-files.h"

static char fuzz_path[200];

static void fuzz_remove (void) {
  if (*fuzz_path) remove (fuzz_path);
}

const char *fuzz_file (const uint8_t *data, size_t size, const char *ending) {
  const char *folder = getenv ("TMPDIR");
  if (*fuzz_path == 0) atexit (fuzz_remove);
  snprintf (fuzz_path, sizeof fuzz_path, "%s/fuzz-%ld%s", folder ? folder : "/tmp", (long)getpid (), ending);
  FILE *f = fopen (fuzz_path, "wb");
  if (f == NULL || fwrite (data, 1, size, f) != size || fclose (f) != 0) {
    perror (fuzz_path);
    exit (1);
  }
  return fuzz_path;
}

char *fuzz_text (const uint8_t *data, size_t size) {
  char *text = malloc (size + 1);
  if (text == NULL) exit (1);
  memcpy (text, data, size);
  text[size] = 0;
  return text;
}

int fuzz_lines (char *text, const char **line, int most) {
  int n = 0;
  for (char *rest = NULL, *w = strtok_r (text, "\n", &rest); w && n < most; w = strtok_r (NULL, "\n", &rest))
    line[n++] = w;
  line[n] = NULL;
  return n;
}

static pw_file *fuzz_model_file;
static pw_model *fuzz_model;
static pw_system *fuzz_system;

static void fuzz_free (void) {
  pw_free (fuzz_system);
  pw_model_free (fuzz_model);
  pw_file_close (fuzz_model_file);
}

struct pw_system *fuzz_pendulum (void) {
  pw_error error = { 0 };
  if (fuzz_system) return fuzz_system;
  fuzz_model_file = pw_file_open ("models/pendulum.yaml", &error);
  fuzz_model = fuzz_model_file ? pw_file_model (fuzz_model_file, &error) : NULL;
  if (fuzz_model && pw_build (fuzz_model, &error) == PW_OK) fuzz_system = pw_compile (fuzz_model, &error);
  if (fuzz_system == NULL) {
    fprintf (stderr, "%s\n", error.text);
    exit (1);
  }
  atexit (fuzz_free);
  return fuzz_system;
}
