/* Runs that several tests make; see runs.h. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pinwheel-files.h"
#include "runs.h"

pw_run *runs_open (pw_system *s, const char *method, const pw_settings *settings) {
  pw_error error = { 0 };
  pw_run *r = pw_run_open (s, method, settings, &error);
  check_ok (r ? PW_OK : error.status, &error);
  return r;
}

void runs_close (pw_run *r, pw_system *s) {
  pw_run_close (r);
  pw_system_free (s);
}

pw_run *runs_copy (pw_run *r, pw_system *s, const char *method, const pw_settings *settings) {
  pw_error error = { 0 };
  pw_archive archive = { .at = NULL };
  pw_run *copy = runs_open (s, method, settings);
  check_ok (pw_run_save (r, &archive, &error), &error);
  check_ok (pw_run_load (copy, &(pw_archive){ .at = archive.at, .size = archive.used, .loading = 1 }, &error), &error);
  pw_archive_free (&archive);
  return copy;
}

pw_system *runs_scene (const char *scene, const char *sets) {
  pw_error error = { 0 };
  char path[100], name[20];
  double value;
  int used;
  snprintf (path, sizeof path, "tests/models/events/%s.yaml", scene);
  pw_file *f = pw_file_open (path, &error);
  pw_model *m = f ? pw_file_model (f, &error) : NULL;
  check_ok (error.status, &error);
  for (; sscanf (sets, " %19[^=]=%lf%n", name, &value, &used) == 2; sets += used)
    check_ok (pw_model_set (m, name, value, &error), &error);
  check_ok (pw_model_build (m, &error), &error);
  pw_system *s = pw_system_compile (m, &error);
  check_ok (error.status, &error);
  pw_model_free (m);
  pw_file_close (f);
  return s;
}

const pw_method *runs_method (int i, char name[40]) {
  for (const pw_method *const *m = pw_methods; *m; m++)
    for (const pw_stabilisation *s = (*m)->stabilisations; s->name; s++)
      if (i-- == 0) {
        snprintf (name, 40, "%s+%s", (*m)->name, s->name);
        return *m;
      }
  return NULL;
}

const char *const runs_adaptive[RUNS_ADAPTIVE] = { "erk5+projection", "erk8+projection", "radau+ggl",
                                                   "bdf+projection",  "ida+ggl",         "adams+none" };

pw_sample runs_to (pw_run *r, double t) {
  pw_error error = { 0 };
  pw_sample sample;
  check_ok (pw_run_advance_to (r, t, t, &error), &error);
  check_ok (pw_run_sample (r, t, &sample, &error), &error);
  return sample;
}

void runs_state (pw_system *s, const char *method, const pw_settings *settings, double t, double *q, double *v,
                 pw_statistics *statistics) {
  pw_run *r = runs_open (s, method, settings);
  pw_sample sample = runs_to (r, t);
  memcpy (q, sample.q, (size_t)pw_system_coordinates (s) * sizeof *q);
  memcpy (v, sample.v, (size_t)pw_system_coordinates (s) * sizeof *v);
  if (statistics) *statistics = *pw_run_statistics (r);
  pw_run_close (r);
}

int runs_reference (const char *path, int lines, int columns, double *table) {
  char text[400];
  int line = 0;
  FILE *f = fopen (path, "r");
  assert_non_null (f);
  while (line < lines && fgets (text, sizeof text, f)) {
    if (text[0] == '#') continue;
    char *number = text;
    for (int c = 0; c < columns; c++) {
      char *end;
      table[line * columns + c] = strtod (number, &end);
      assert_true (end > number);
      number = end;
    }
    line++;
  }
  fclose (f);
  return line;
}
