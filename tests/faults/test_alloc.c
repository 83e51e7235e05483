/* Every allocation is made to fail in turn: each is an error that says so, and nothing is left behind.
 *
 * What the libraries below Pinwheel allocate does not fail here; they are asked to clean up all the same. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "alloc.h"
#include "check.h"
#include "pinwheel-files.h"
#include "pinwheel-analysis.h"
#include "runs.h"
#include "scene.h"
#include "pinwheel-selftest.h"
#include "toys.h"
#include "yaml.h"

/* ---- Scenarios ---- */

/* Does something as far as it gets, cleans up, and returns a status. */
typedef int alloc_scenario (const char *what, pw_error *error);

/* Runs a scenario with its first allocation failing, then with the second, ... until it gets through. */
static void alloc_each (alloc_scenario *scenario, const char *what) {
  for (long fail = 1;; fail++) {
    pw_error error = { 0 };
    alloc.count = 0;
    alloc.fail = fail;
    int status = scenario (what, &error);
    alloc.fail = 0;
    if (alloc.live != 0) print_error ("%s: %d left behind after allocation %ld failed\n", what, alloc.live, fail);
    assert_int_equal (alloc.live, 0);
    if (alloc.count < fail) {
      check_ok (status, &error);
      assert_true (fail > 1);
      return;
    }
    if (status != PW_RESOURCE || strstr (error.text, "out of memory") == NULL)
      print_error ("%s: allocation %ld failed: status %d, \"%s\"\n", what, fail, status, error.text);
    assert_int_equal (status, PW_RESOURCE);
    assert_int_equal (error.status, PW_RESOURCE);
    assert_non_null (strstr (error.text, "out of memory"));
  }
}

/* The EzyRoller with toys on it, built from outside. */
static int alloc_model (pw_model **m, pw_error *error) {
  *m = pw_model_new ("ezyroller", &scene_ezyroller, error);
  int status = *m ? pw_model_set (*m, "M0", 0.2, error) : error->status;
  if (status == PW_OK) status = pw_model_build (*m, error);
  if (status != PW_OK) return status;
  pw_add (*m, &toy_kind_spring,
          &(toy_spring){
              .name = "k", .body = { "frame", "ground" }, .at = { { 1, 1 }, { 0 } }, .stiffness = 0.01, .length = 1 });
  status = pw_model_set_initial (*m, "frame.vx", 0.1, error);
  if (status == PW_OK) status = pw_model_set_initial (*m, "steer.phi", 3, error);
  return status;
}

static int alloc_system (pw_system **s, pw_error *error) {
  pw_model *m = NULL;
  *s = NULL;
  int status = alloc_model (&m, error);
  if (status == PW_OK) {
    *s = pw_system_compile (m, error);
    status = *s ? PW_OK : error->status;
  }
  pw_model_free (m);
  return status;
}

static int alloc_compile (const char *what, pw_error *error) {
  (void)what;
  pw_system *s;
  int status = alloc_system (&s, error);
  pw_system_free (s);
  return status;
}

static int alloc_run (const char *method, pw_error *error) {
  pw_system *s;
  pw_sample sample;
  int status = alloc_system (&s, error);
  if (status != PW_OK) return status;
  pw_run *r = pw_run_open (s, method, &(pw_settings){ .step = 1e-2, .rtol = 1e-4, .ledger = 1 }, error);
  status = r ? pw_run_advance_to (r, 0.1, 0.1, error) : error->status;
  if (status == PW_OK) status = pw_run_sample (r, pw_run_time (r), &sample, error);
  pw_archive archive = { .at = NULL };
  if (status == PW_OK) status = pw_run_save (r, &archive, error);
  pw_archive_free (&archive);
  if (status == PW_OK) status = pw_run_restart (r, NULL, NULL, error);
  if (status == PW_OK) status = pw_run_advance (r, 0.2, error);
  pw_run_close (r);
  pw_system_free (s);
  return status;
}

static int alloc_selftest (const char *what, pw_error *error) {
  (void)what;
  pw_selftest_report report = { 0 };
  return pw_selftest (&pw_kind_pin, 1, &report, error);
}

/* What `check` asks of a run. */
static int alloc_check (const char *what, pw_error *error) {
  pw_system *s;
  pw_linear linear = { 0 };
  pw_selftest_report report = { 0 };
  (void)what;
  int status = alloc_system (&s, error);
  pw_run *r = status == PW_OK ? pw_run_open (s, "rk4+projection", NULL, error) : NULL;
  if (status == PW_OK && r == NULL) status = error->status;
  if (status == PW_OK) status = pw_run_linearise (r, 100, &linear, error);
  if (status == PW_OK)
    status = pw_selftest_scene (s, 1, &pw_kind_pin, 0, pw_run_initial (r)->q, pw_run_initial (r)->v, 1, &report, error);
  pw_linear_free (&linear);
  pw_run_close (r);
  pw_system_free (s);
  return status;
}

static int alloc_verify (const char *what, pw_error *error) {
  (void)what;
  pw_system *s;
  pw_verification result;
  static const double zero[6] = { 0 };
  int status = alloc_system (&s, error);
  if (status == PW_OK) {
    status = pw_verify (s, &(pw_scale){ 1, 1 }, 0, zero, zero, zero, zero, &result);
    if (status != PW_OK) pw_fail (error, status, "out of memory");
  }
  pw_system_free (s);
  return status;
}

static int alloc_files (const char *path, pw_error *error) {
  pw_system *s;
  pw_sample sample;
  char part[200];
  int status = alloc_system (&s, error);
  if (status != PW_OK) return status;
  pw_run *r = pw_run_open (s, "rk4", &(pw_settings){ .ledger = 1 }, error);
  pw_output *table = r ? pw_output_open (path, error) : NULL;
  pw_csv *csv = table ? pw_csv_open (s, 1, table, error) : NULL;
  status = csv ? pw_run_sample (r, 0, &sample, error) : error->status;
  if (status == PW_OK) status = pw_csv_write (csv, s, &sample, error);
  if (status == PW_OK)
    status = pw_csv_close (csv, error);
  else
    pw_csv_close (csv, &(pw_error){ 0 });
  if (table && status == PW_OK)
    status = pw_output_finish (table, error);
  else if (table)
    pw_output_abandon (table, part, sizeof part);
  pw_run_close (r);
  pw_system_free (s);
  return status;
}

/* A link in the current folder to a file in another one. */
static int alloc_link (const char *link, pw_error *error) {
  return pw_check_paths ((const pw_use[]){ { "-o", link, PW_WRITES, NULL }, { "--json", "other", PW_WRITES, NULL } }, 2,
                         error);
}

static int alloc_text (const char *path, pw_error *error) {
  pw_file *f = pw_file_open (path, error);
  pw_model *m = f ? pw_file_model (f, error) : NULL;
  int status = m ? pw_model_build (m, error) : error->status;
  pw_system *s = status == PW_OK ? pw_system_compile (m, error) : NULL;
  status = s ? PW_OK : error->status;
  pw_system_free (s);
  pw_model_free (m);
  pw_file_close (f);
  return status;
}

static pw_stream alloc_stored; /* a tree as bytes */

static int alloc_tree (const char *path, pw_error *error) {
  pw_yaml y = { .path = (char[]){ "model.yaml" } };
  (void)path;
  int status = pw_yaml_load_tree (&y, alloc_stored.text, alloc_stored.size, error);
  pw_arena_free (&y.arena);
  return status;
}

/* ---- Tests ---- */

TEST (compile) {
  alloc_each (alloc_compile, "model and compile");
}

TEST (runs) {
  char name[40];
  for (int i = 0; runs_method (i, name); i++) alloc_each (alloc_run, name);
  alloc_each (alloc_run, "rk4+projection:metric=identity");
}

TEST (selftest) {
  alloc_each (alloc_selftest, "self-test");
  alloc_each (alloc_check, "check");
}

TEST (verify) {
  alloc_each (alloc_verify, "verifier");
}

/* A table as text and as an archive. */
TEST (files) {
  char path[] = "/tmp/pinwheel-alloc-XXXXXX", file[sizeof path + 10], part[sizeof path + 20];
  int fd = mkstemp (path);
  assert_true (fd >= 0);
  close (fd);
  for (int i = 0; i < 2; i++) {
    snprintf (file, sizeof file, "%s%s", path, i ? ".npz" : "");
    snprintf (part, sizeof part, "%s.part", file);
    alloc_each (alloc_files, file);
    unlink (file);
    unlink (part);
  }
}

TEST (links) {
  char link[] = "pinwheel-alloc-link";
  unlink (link);
  assert_int_equal (symlink ("build/absent.csv", link), 0);
  alloc_each (alloc_link, link);
  unlink (link);
}

TEST (texts) {
  alloc_each (alloc_text, "tests/models/ezyroller.yaml");
  alloc_each (alloc_text, "tests/models/arm.yaml");
  alloc_each (alloc_text, "tests/models/arms.yaml");
}

TEST (tree) {
  char path[PATH_MAX];
  assert_non_null (realpath ("tests/models/arms.yaml", path));
  pw_error error = { 0 };
  pw_yaml *y = pw_yaml_open (path, path, PW_FILE_DEFAULT_BYTES, &error);
  assert_non_null (y);
  FILE *f = pw_stream_open (&alloc_stored);
  pw_yaml_write_tree (y, f);
  assert_int_equal (pw_stream_close (f, &alloc_stored), PW_OK);
  pw_yaml_close (y);
  alloc.live = 0;
  alloc_each (alloc_tree, path);
  alloc_stored.size--;
  assert_int_equal (alloc_tree (path, &error), PW_INPUT);
  assert_string_equal (error.text, "model.yaml: the stored tree is incomplete");
  free (alloc_stored.text);
}

/* A method allocates when it is opened, and not in a step. */
TEST (steps) {
  pw_error error = { 0 };
  char name[40];
  for (int i = 0; runs_method (i, name); i++) {
    pw_system *s;
    check_ok (alloc_system (&s, &error), &error);
    pw_run *r = runs_open (s, name, &(pw_settings){ .step = 1e-2, .rtol = 1e-4, .ledger = 1 });
    runs_to (r, 0.1);
    long before = alloc.count;
    runs_to (r, 2);
    assert_int_equal (alloc.count, before);
    pw_run_close (r);
    pw_system_free (s);
  }
}
