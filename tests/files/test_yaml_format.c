/* Every example of docs/model-format.md is a model that runs.  Run from the top folder. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "runs.h"

/* Copies the next example to the file; 0 if there is none. */
static int format_next (FILE *document) {
  char line[600];
  FILE *example = NULL;
  while (fgets (line, sizeof line, document)) {
    if (example && strcmp (line, "```\n") == 0) return fclose (example) == 0;
    if (example) fputs (line, example);
    if (strcmp (line, "```yaml\n") == 0) example = fopen (cli_path ("m.yaml"), "w");
  }
  assert_null (example);
  return 0;
}

static void format_run (void) {
  gallery_scene x = gallery_load (cli_path ("m.yaml"), NULL);
  const pw_run_defaults *d = &pw_file_table (x.file)->run;
  pw_run *r =
      runs_open (x.system, d->method ? d->method : "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample end = runs_to (r, 1);
  check_below ("position residual of an example", end.position, 1e-13, "projected: round-off");
  pw_run_close (r);
  gallery_close (&x);
}

TEST (examples) {
  int examples = 0;
  FILE *document = fopen ("docs/model-format.md", "r");
  assert_non_null (document);
  for (; format_next (document); examples++) format_run ();
  fclose (document);
  assert_true (examples >= 4);
}

const check_fixture fixture = { cli_setup, cli_teardown };
