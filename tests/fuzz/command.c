/* A command line: the words of `show`, a grid for `sweep`, a method's name with options. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "fuzz.h"
#include "sweep.h"

static void command_quiet (void) {
  static int quiet;
  if (quiet++) return;
  if (freopen ("/dev/null", "w", stdout) == NULL) abort ();
}

/* `show` writes no files; a run to a time of someone's choice would be too long. */
static void command_show (int count, const char **line) {
  const char *argv[12] = { "pinwheel show", "models/pendulum.yaml" };
  int argc = 2;
  for (int i = 0; i < count && argc < 11; i++)
    if (strncmp (line[i], "--a", 3) != 0) argv[argc++] = line[i];
  argv[argc] = NULL;
  int status = pw_cli_show (argc, argv);
  if (status < 0 || status > 4) abort ();
}

static void command_grid (const char *const *line) {
  pw_grid g;
  pw_error error = { 0 };
  if (pw_grid_read (&g, line, &error) == PW_OK)
    for (int a = 0; a < g.axes; a++) {
      pw_grid_value (&g, a, 0);
      pw_grid_value (&g, a, g.rows - 1);
    }
  else if (error.status >= 0)
    abort ();
  pw_grid_free (&g);
}

static void command_method (const char *text) {
  pw_error error = { 0 };
  pw_run *r = pw_open (fuzz_pendulum (), text, NULL, &error);
  if (r)
    pw_close (r);
  else if (error.status >= 0)
    abort ();
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  const char *line[9];
  command_quiet ();
  if (size < 2) return 0;
  char *text = fuzz_text (data + 1, size - 1);
  int count = fuzz_lines (text, line, 8);
  if (data[0] % 3 == 0) command_show (count, line);
  if (data[0] % 3 == 1) command_grid (line);
  if (data[0] % 3 == 2 && count > 0) command_method (line[0]);
  free (text);
  return 0;
}
