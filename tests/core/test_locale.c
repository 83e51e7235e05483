/* In a locale with a decimal comma models are read, and tables and summaries written, as in any other.  localedef makes
 * the locale, if the system has its sources. */
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"
#include "pinwheel-files.h"
#include "runs.h"

/* Runs a model and writes a table and a summary, NAME.csv and NAME.json. */
static void locale_write (const char *model, const char *name) {
  pw_error error = { 0 };
  pw_sample sample;
  char path[400];
  pw_system *s = gallery_open (model, NULL);
  pw_run *r = runs_open (s, "rk4+baumgarte:alpha=2.5:beta=.5", &(pw_settings){ .step = 1e-2, .ledger = 1 });
  snprintf (path, sizeof path, "%s/%s.csv", cli_folder, name);
  pw_output *o = pw_output_open (path, &error);
  pw_csv *csv = pw_csv_open (s, 1, o, &error);
  check_ok (error.status, &error);
  for (int i = 1; i <= 5; i++) {
    check_ok (pw_run_advance_to (r, 0.05 * i, 1, &error), &error);
    check_ok (pw_run_sample (r, 0.05 * i, &sample, &error), &error);
    check_ok (pw_csv_write (csv, s, &sample, &error), &error);
  }
  check_ok (pw_csv_close (csv, &error), &error);
  check_ok (pw_output_finish (o, &error), &error);
  snprintf (path, sizeof path, "%s/%s.json", cli_folder, name);
  o = pw_output_open (path, &error);
  pw_summary summary = { .model = "x", .method = "y", .status = "ok", .reason = "", .cpu = 0.25 };
  check_ok (pw_json_write (&summary, s, &sample, 1, pw_run_statistics (r), o, &error), &error);
  check_ok (pw_output_finish (o, &error), &error);
  runs_close (r, s);
}

TEST (comma) {
  static const char *const model[] = { "tests/models/arm.yaml", "models/linkages/chain.yaml",
                                       "models/vehicles/ezyroller.c" };
  if (cli_run ("localedef -i de_DE -f UTF-8 @/de_DE.UTF-8") != 0) skip ();
  for (size_t i = 0; i < sizeof model / sizeof *model; i++) {
    locale_write (model[i], "plain");
    setenv ("LOCPATH", cli_folder, 1);
    if (setlocale (LC_ALL, "de_DE.UTF-8") == NULL) skip ();
    assert_string_equal (check_text ("%.1f", 0.5), "0,5"); /* the locale has a decimal comma */
    locale_write (model[i], "comma");
    setlocale (LC_ALL, "C");
    cli_good ("cmp @/plain.csv @/comma.csv && cmp @/plain.json @/comma.json && test -s @/plain.csv");
  }
}

const check_fixture fixture = { cli_setup, cli_teardown };
