/* Every example of docs/model-format.md is a model that runs.  Run from the top folder. */
#define _GNU_SOURCE /* mkstemps */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "pinwheel-files.h"
#include "runs.h"

static char format_path[] = "/tmp/pinwheel-format-XXXXXX.yaml";

/* Copies the next example to the file; 0 if there is none. */
static int format_next (FILE *document) {
  char line[600];
  FILE *example = NULL;
  while (fgets (line, sizeof line, document)) {
    if (example && strcmp (line, "```\n") == 0) return fclose (example) == 0;
    if (example) fputs (line, example);
    if (strcmp (line, "```yaml\n") == 0) example = fopen (format_path, "w");
  }
  assert_null (example);
  return 0;
}

static void format_run (void) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open (format_path, &error);
  check_ok (f ? PW_OK : error.status, &error);
  pw_model *m = pw_file_model (f, &error);
  check_ok (m ? pw_model_build (m, &error) : PW_RESOURCE, &error);
  pw_system *s = pw_system_compile (m, &error);
  check_ok (s ? PW_OK : error.status, &error);
  const pw_run_defaults *d = &pw_file_table (f)->run;
  pw_run *r = runs_open (s, d->method ? d->method : "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample end = runs_to (r, 1);
  check_below ("position residual of an example", end.position, 1e-13, "projected: round-off");
  pw_run_close (r);
  pw_system_free (s);
  pw_model_free (m);
  pw_file_close (f);
}

TEST (examples) {
  int examples = 0;
  FILE *document = fopen ("docs/model-format.md", "r");
  assert_non_null (document);
  for (; format_next (document); examples++) format_run ();
  fclose (document);
  assert_true (examples >= 4);
}

static int format_setup (void) {
  int file = mkstemps (format_path, 5);
  return file < 0 ? -1 : close (file);
}

static int format_teardown (void) {
  return remove (format_path);
}

const check_fixture fixture = { format_setup, format_teardown };
