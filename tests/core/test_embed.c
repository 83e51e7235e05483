/* docs/embed.c, a program that uses Pinwheel as a library, prints the results of the same run here; the directories
 * depend on each other only as .ci/layers permits.
 *
 * BUILD in the environment is the build folder, otherwise build; run from the top folder. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include "check.h"
#include "pinwheel-files.h"
#include "pinwheel-selftest.h"
#include "runs.h"
#include "scene.h"

static const char *embed_build (void) {
  const char *build = getenv ("BUILD");
  return build ? build : "build";
}

/* Runs a command and keeps what it writes; returns its exit status. */
static int embed_run (const char *command, char *text, size_t size) {
  FILE *f = popen (command, "r");
  assert_non_null (f);
  size_t n = fread (text, 1, size - 1, f);
  text[n] = 0;
  int status = pclose (f);
  return WIFEXITED (status) ? WEXITSTATUS (status) : -1;
}

/* The torque of docs/embed.c. */
static int embed_torque (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context;
  value[0] = 0.1 * cos (PW_PI * t) - 0.002 * (x[0] - x[1]);
  if (gradient) gradient[0] = -0.002, gradient[1] = 0.002;
  return 0;
}

TEST (embed) {
  static const char *const reads[] = { "frame.omega", "steer.omega", NULL };
  const pw_signal torque = { PW_FUNCTION, .function = { .eval = embed_torque, .reads = reads } };
  pw_error error = { 0 };
  char command[300], printed[300];
  snprintf (command, sizeof command, "'%s/docs/embed'", embed_build ());
  assert_int_equal (embed_run (command, printed, sizeof printed), 0);
  pw_model *m = scene_model (&scene_ezyroller, "a", 0.6, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  pw_sample now = runs_to (r, 10);
  assert_string_equal (printed, check_text ("frame at t = %g s: x = %.6f m, y = %.6f m, phi = %.6f rad\n", now.t,
                                            now.q[0], now.q[1], now.q[2]));
  runs_close (r, s);
}

TEST (layers) {
#if defined(__SANITIZE_ADDRESS__)
  skip (); /* the libraries also need that of the sanitizer */
#else
  char command[300], text[8000];
  snprintf (command, sizeof command, "BUILD='%s' sh .ci/layers 2>&1", embed_build ());
  int status = embed_run (command, text, sizeof text);
  if (status != 0) print_error ("%s", text);
  assert_int_equal (status, 0);
  assert_non_null (strstr (text, "ok     core refers to no symbol of solvers\n"));
  assert_null (strstr (text, "FAILED"));
#endif
}

/* What a failed call returned is refused by the next one. */
TEST (null) {
  pw_error e[6] = { { 0 } };
  pw_page page;
  pw_system *s = scene_compile (scene_model (&scene_ezyroller, "a", 0.6, NULL));
  assert_null (pw_csv_open (NULL, 0, NULL, &e[0]));
  check_error (&e[0], PW_INPUT, "a system is missing");
  assert_null (pw_csv_open (s, 0, NULL, &e[1]));
  check_error (&e[1], PW_INPUT, "an output is missing");
  assert_int_equal (pw_csv_write (NULL, s, NULL, &e[2]), PW_INPUT);
  check_error (&e[2], PW_INPUT, "a table is missing");
  assert_int_equal (pw_page_open (&page, NULL, &e[3]), PW_INPUT);
  check_error (&e[3], PW_INPUT, "a model file is missing");
  pw_page_close (&page);
  assert_null (pw_scene_code_open (NULL, s, &e[4]));
  check_error (&e[4], PW_INPUT, "specialised code is missing");
  assert_int_equal (pw_json_write (&(pw_summary){ .model = "m" }, s, NULL, 0, NULL, NULL, &e[5]), PW_INPUT);
  check_error (&e[5], PW_INPUT, "an output is missing");
  assert_null (pw_scene_code_open ("", NULL, NULL));
  assert_null (pw_file_table (NULL));
  assert_string_equal (pw_scene_code_notice (NULL), "");
  assert_int_equal (pw_file_tables (NULL, NULL, NULL), 0);
  assert_int_equal (pw_checkpoint_write ("/nonexistent/a.ck", "", &(pw_archive){ .used = 0 }, NULL), PW_RESOURCE);
  assert_null (pw_file_open ("tests/no-such.yaml", NULL));
  assert_null (pw_file_open ("tests/bad-models.txt", NULL));
  pw_system_free (s);
}

/* A compiler that writes no object is reported, and tolerated without a place for the report.  Changes the environment:
 * the last test. */
TEST (no_object) {
  pw_error error = { 0 };
  pw_system *s = scene_compile (scene_model (&scene_ezyroller, "a", 0.6, NULL));
  char *text = pw_system_source (s, NULL, NULL);
  setenv ("CC", "true", 1);
  unsetenv ("HOME");
  unsetenv ("XDG_CACHE_HOME");
  assert_null (pw_scene_code_open (text, s, NULL));
  assert_null (pw_scene_code_open (text, s, &error));
  check_error (&error, PW_RESOURCE, "the compiler has written no object");
  free (text);
  pw_system_free (s);
}

/* Functions with an error report what is missing. */
TEST (missing) {
  static const char *const expected[] = { "a function for each model is missing",
                                          "the name of a file to write is missing",
                                          "the name of a checkpoint is missing",
                                          "an expression is missing",
                                          "the list of names is missing",
                                          "an element type is missing",
                                          "the table of a model is missing",
                                          "the name of a table is missing",
                                          "a model is missing",
                                          "a model is missing",
                                          "a summary is missing" };
  enum { MISSING = sizeof expected / sizeof *expected };
  pw_error e[MISSING] = { { 0 } };
  pw_checkpoint c;
  pw_selftest_report report = { 0 };
  int rows;
  assert_int_equal (pw_file_list (NULL, NULL, &e[0]), PW_INPUT);
  assert_null (pw_output_open (NULL, &e[1]));
  assert_int_equal (pw_checkpoint_read (NULL, &c, &e[2]), PW_INPUT);
  assert_null (pw_formula_open (NULL, NULL, &e[3]));
  assert_null (pw_formula_open ("1", NULL, &e[4]));
  assert_int_equal (pw_selftest (NULL, 1, &report, &e[5]), PW_INPUT);
  assert_int_equal (pw_plugin_check (NULL, "it", &e[6]), PW_INPUT);
  assert_null (pw_read_columns (NULL, NULL, NULL, 0, NULL, &rows, &e[7]));
  assert_int_equal (pw_model_check_body (NULL, NULL, &e[8]), PW_INPUT);
  assert_int_equal (pw_model_check_element (NULL, NULL, &e[9]), PW_INPUT);
  assert_int_equal (pw_json_write (NULL, NULL, NULL, 0, NULL, NULL, &e[10]), PW_INPUT);
  for (int i = 0; i < MISSING; i++) check_error (&e[i], PW_INPUT, expected[i]);
}
