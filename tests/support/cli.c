/* Runs the program in a temporary folder and reads its output, for the tests; see cli.h. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include "check.h"
#include "cli.h"

/* ---- Running the program ---- */

char cli_folder[] = "/tmp/pinwheel-cli-XXXXXX";
char cli_out[200000], cli_err[20000];

static int cli_read_all (const char *path, char *text, size_t size) {
  FILE *f = fopen (path, "r");
  if (f == NULL) return 0;
  size_t n = fread (text, 1, size - 1, f);
  text[n] = 0;
  fclose (f);
  return 1;
}

const char *cli_path (const char *name) {
  static char path[2][4200];
  static int next;
  next = !next;
  snprintf (path[next], sizeof path[next], "%s/%s", cli_folder, name);
  return path[next];
}

const char *cli_file (const char *name) {
  static char text[200000];
  return cli_read_all (cli_path (name), text, sizeof text) ? text : NULL;
}

void cli_expand (const char *from, char *to, size_t size) {
  size_t n = 0;
  for (; *from && n + sizeof cli_folder < size; from++)
    if (*from == '@')
      n += (size_t)snprintf (to + n, size - n, "%s", cli_folder);
    else
      to[n++] = *from;
  to[n] = 0;
}

int cli_run (const char *command) {
  char expanded[2000], script[3000];
  const char *program = getenv ("PINWHEEL");
  cli_expand (command, expanded, sizeof expanded);
  snprintf (script, sizeof script, "pinwheel () { '%s' \"$@\"; }\n{ %s\n} >%s/out 2>%s/err </dev/null",
            program ? program : "build/pinwheel", expanded, cli_folder, cli_folder);
  int status = system (script);
  assert_true (cli_read_all (cli_path ("out"), cli_out, sizeof cli_out));
  assert_true (cli_read_all (cli_path ("err"), cli_err, sizeof cli_err));
  return WIFEXITED (status) ? WEXITSTATUS (status) : -1;
}

void cli_shell (const char *command) {
  int status = cli_run (command);
  if (status != 0) print_error ("%s\nends with %d:\n%s%s", command, status, cli_out, cli_err);
  assert_int_equal (status, 0);
}

void cli_good (const char *command) {
  cli_shell (command);
  if (cli_err[0]) print_error ("%s\nsays\n%s", command, cli_err);
  assert_string_equal (cli_err, "");
}

void cli_bad (const char *command, int status, const char *message) {
  char text[1000], expanded[900];
  cli_expand (message, expanded, sizeof expanded);
  snprintf (text, sizeof text, "pinwheel: %s\n", expanded);
  int found = cli_run (command);
  if (found != status || strcmp (cli_err, text) != 0)
    print_error ("%s\nends with %d:\n%sexpected %d:\n%s", command, found, cli_err, status, text);
  assert_int_equal (found, status);
  assert_string_equal (cli_err, text);
}

void cli_bad_each (const char *command, const cli_wrong *each, size_t count) {
  for (size_t i = 0; i < count; i++) {
    cli_bad (check_text ("pinwheel %s %s", command, each[i].arguments), 2, each[i].message);
    assert_string_equal (cli_out, "");
  }
}

void cli_write_bytes (const char *name, const void *bytes, size_t size) {
  FILE *f = fopen (cli_path (name), "wb");
  assert_non_null (f);
  assert_int_equal (fwrite (bytes, 1, size, f), size);
  assert_int_equal (fclose (f), 0);
}

void cli_write (const char *name, const char *text) {
  cli_write_bytes (name, text, strlen (text));
}

void cli_shows (const char *text) {
  if (strstr (cli_out, text) == NULL) fail_msg ("\"%s\" is not in\n%s", text, cli_out);
}

/* ---- Reading summaries ---- */

/* The value of the first such key; NULL if there is none. */
static const char *cli_value (const char *json, const char *key) {
  char quoted[300];
  snprintf (quoted, sizeof quoted, "\"%s\"", key);
  json = strstr (json, quoted);
  return json ? json + strlen (quoted) + strspn (json + strlen (quoted), " \n:") : NULL;
}

double cli_number (const char *json, ...) {
  va_list keys;
  va_start (keys, json);
  for (const char *key = va_arg (keys, const char *); key; key = va_arg (keys, const char *)) {
    json = cli_value (json, key);
    if (json == NULL) print_error ("no key \"%s\"\n", key);
    assert_non_null (json);
  }
  va_end (keys);
  return strtod (json, NULL);
}

int cli_sensitivity (const char *key, double *value) {
  int count = 0;
  for (const char *at = cli_file ("sens/sensitivity.json"); (at = cli_value (at, key)) != NULL; count++)
    if (count < CLI_MOST) value[count] = strncmp (at, "null", 4) == 0 ? NAN : strtod (at, NULL);
  assert_in_range (count, 0, CLI_MOST);
  return count;
}

int cli_says (const char *json, const char *key, const char *value) {
  char quoted[300];
  int length = snprintf (quoted, sizeof quoted, "\"%s\"", value);
  json = cli_value (json, key);
  return json && strncmp (json, quoted, (size_t)length) == 0;
}

int cli_setup (void) {
  return mkdtemp (cli_folder) && setenv ("XDG_CACHE_HOME", cli_folder, 1) == 0 ? 0 : -1;
}

/* A gnuplot that draws nothing is found first. */
int cli_setup_undrawn (void) {
  if (cli_setup () != 0) return -1;
  cli_write ("gnuplot", "#!/bin/sh\n");
  cli_good ("chmod +x @/gnuplot");
  return setenv ("PATH", check_text ("%s:%s", cli_folder, getenv ("PATH")), 1);
}

int cli_teardown (void) {
  char command[200];
  snprintf (command, sizeof command, "rm -rf '%s'", cli_folder);
  return system (command);
}
