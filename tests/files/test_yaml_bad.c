/* Text models that are wrong: each entry of tests/bad-models.txt begins with a comment that says what it is told,
 * "# LINE:COLUMN: TEXT"; a caret below its own line points to the column.  Run from the top folder. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"

/* Opens, builds and compiles as the program does. */
static pw_error bad_open (const char *path) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open (path, &error);
  pw_model *m = f ? pw_file_model (f, &error) : NULL;
  if (m && pw_model_build (m, &error) == PW_OK) pw_system_free (pw_system_compile (m, &error));
  pw_model_free (m);
  pw_file_close (f);
  return error;
}

/* The caret's column, counted in characters, and that of the message agree as far as the line is shown from its
 * beginning. */
static void bad_caret (const char *path, const char *text, int column) {
  const char *line = strchr (text, '\n'), *caret = line ? strchr (line + 1, '\n') : NULL;
  assert_non_null (caret);
  int at = (int)strlen (caret + 1) - 2;
  assert_int_equal (caret[strlen (caret) - 1], '^');
  if (column < 45 && at != column) print_error ("%s: the caret is below column %d\n", path, at);
  if (column < 45) assert_int_equal (at, column);
}

/* Returns 1 if the file is told something else. */
static int bad_file (const char *path) {
  char first[600], expected[800];
  FILE *f = fopen (path, "r");
  assert_non_null (f);
  assert_non_null (fgets (first, sizeof first, f));
  fclose (f);
  first[strcspn (first, "\n")] = 0;
  pw_error error = bad_open (path);
  int line = 0, column = 0, text = 0;
  if (sscanf (first, "# %d:%d: %n", &line, &column, &text) != 2 || text == 0) {
    print_error ("%s does not say what is expected\n", path);
    return 1;
  }
  snprintf (expected, sizeof expected, "%s:%d:%d: error: %s\n", path, line, column, first + text);
  if (error.status != PW_INPUT || strncmp (error.text, expected, strlen (expected)) != 0) {
    print_error ("%s\nis told with status %d:\n%s\nexpected:\n%s", path, error.status, error.text, expected);
    return 1;
  }
  bad_caret (path, error.text, column);
  return 0;
}

TEST (bad_models) {
  int files = 0, failed = 0;
  struct dirent *entry;
  cli_good ("sh tests/support/entries.sh unpack tests/bad-models.txt @/bad");
  DIR *d = opendir (cli_path ("bad"));
  assert_non_null (d);
  while ((entry = readdir (d)) != NULL) {
    char path[300];
    if (strstr (entry->d_name, ".yaml") == NULL) continue;
    snprintf (path, sizeof path, "%s/%s", cli_path ("bad"), entry->d_name);
    failed += bad_file (path);
    files++;
  }
  closedir (d);
  assert_int_equal (failed, 0);
  assert_true (files >= 30);
}

/* ---- Damage ---- */

/* Columns of the first line do not count a byte order mark. */
TEST (byte_order_mark) {
  static const char *const bad[] = { "about: a: b\n", "pinwheel: 2\n", "pinwheel: 1, x: [\n", "{pinwheel: 1, x: 3}\n",
                                     "%YAML 1.2\n---\npinwheel: 1\n" };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    char text[100];
    cli_write_bytes ("m.yaml", bad[i], strlen (bad[i]));
    pw_error without = bad_open (cli_path ("m.yaml"));
    snprintf (text, sizeof text, "\xEF\xBB\xBF%s", bad[i]);
    cli_write_bytes ("m.yaml", text, strlen (text));
    pw_error with = bad_open (cli_path ("m.yaml"));
    assert_int_equal (without.status, PW_INPUT);
    assert_string_equal (with.text, without.text);
  }
}

/* A good model with one byte changed, or cut off somewhere, is read or refused with a text, never more. */
TEST (damage) {
  static const char byte[] = "{}[],:#&*!|>'\"%@ \n-t.=(1\xC3";
  static char text[4000], copy[4000];
  FILE *f = fopen ("tests/models/ezyroller.yaml", "rb");
  assert_non_null (f);
  size_t size = fread (text, 1, sizeof text, f);
  fclose (f);
  assert_true (size > 1000 && size < sizeof text);
  for (size_t i = 0; i < 600; i++) {
    size_t at = (i * 7919) % size;
    memcpy (copy, text, size);
    if (i % 6) copy[at] = byte[i % (sizeof byte - 1)];
    cli_write_bytes ("m.yaml", copy, i % 6 ? size : at);
    pw_error error = bad_open (cli_path ("m.yaml"));
    assert_true (error.status == PW_OK || (error.status == PW_INPUT && error.text[0]));
  }
}

TEST (size) {
  cli_write_bytes ("m.yaml", "pinwheel: 1\n", 12);
  assert_int_equal (truncate (cli_path ("m.yaml"), (64L << 20) + 1), 0);
  pw_error error = bad_open (cli_path ("m.yaml"));
  check_error (&error, PW_INPUT,
               check_text ("%s: the file has more than 64 MB, the limit for a model unless --max-file raises it",
                           cli_path ("m.yaml")));
  error = (pw_error){ 0 };
  assert_null (pw_file_open_limited (cli_path ("m.yaml"), 1 << 19, &error));
  check_error (&error, PW_INPUT,
               check_text ("%s: the file has more than 0.5 MB, the limit for a model unless --max-file raises it",
                           cli_path ("m.yaml")));
}

const check_fixture fixture = { cli_setup, cli_teardown };
