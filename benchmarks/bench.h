/* Shared by the programs quick and demo: opens and compiles a model; ends the program on an error. */
#ifndef BENCH_H
#define BENCH_H

#include <stdio.h>
#include <stdlib.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

typedef struct {
  pw_file *file;
  pw_model *model;
  pw_system *system;
} bench_scene;

/* Prints the error and ends the program with its status. */
static inline void bench_fail (const char *what, const pw_error *error) {
  fprintf (stderr, "%s: %s\n", what, error->text);
  exit (-error->status);
}

/* Opens and compiles a model with default parameters; close it with bench_close. */
static inline bench_scene bench_open (const char *name) {
  pw_error error = { 0 };
  bench_scene s = { .file = pw_file_open (name, &error) };
  if (s.file) s.model = pw_file_model (s.file, &error);
  if (s.model && pw_model_build (s.model, &error) == PW_OK) s.system = pw_system_compile (s.model, &error);
  if (s.system == NULL) bench_fail (name, &error);
  return s;
}

static inline void bench_close (bench_scene *s) {
  pw_system_free (s->system);
  pw_model_free (s->model);
  pw_file_close (s->file);
}

#endif
