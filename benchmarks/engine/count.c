/* Counts the instructions of a function: runs this program again under callgrind, and reads what that writes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "engine.h"

_Noreturn void engine_die (const char *what, const char *why) {
  fprintf (stderr, "%s: %s\n", what, why);
  exit (2);
}

void engine_check_arguments (int argc, char **argv, int most, const char *usage) {
  if (argc - 1 > most) engine_die (argv[0], usage);
  for (int i = 1; i < argc; i++)
    if (argv[i][0] == '-') engine_die (argv[i], usage);
}

long engine_counted (const timing_work *w, long n) {
  return w->run (w->context, n);
}

/* The instructions of all calls of a function.  The file has three lines for a call: "cfn=NAME", "calls=COUNT ..." and
 * "LINE INSTRUCTIONS".  COUNT is not used: it includes calls made while nothing is collected. */
static double count_read (FILE *file, const char *function) {
  char line[1000];
  double sum = 0, instructions;
  int named = 0, next = 0; /* the call is one of the function; its instructions are on the next line */
  while (fgets (line, sizeof line, file)) {
    if (strncmp (line, "cfn=", 4) == 0) {
      line[strcspn (line, "\n")] = '\0';
      named = strcmp (line + 4, function) == 0;
    } else if (strncmp (line, "calls=", 6) == 0) {
      next = named;
      named = 0;
    } else if (next) {
      if (sscanf (line, "%*s %lf", &instructions) == 1) sum += instructions;
      next = 0;
    }
  }
  return sum;
}

double engine_count (const char *program, const char *key, const char *side, const char *function) {
  char out[] = "/tmp/engine-XXXXXX", command[1200];
  if (system ("valgrind --version >/dev/null 2>&1") != 0) return 0;
  int fd = mkstemp (out);
  if (fd < 0) return 0;
  close (fd);
  /* LD_BIND_NOW: symbols are resolved before the first call, which is then like the others. */
  snprintf (command, sizeof command,
            "LD_BIND_NOW=1 valgrind -q --tool=callgrind --collect-atstart=no --toggle-collect=engine_counted "
            "--compress-strings=no --callgrind-out-file=%s '%s' --count %s %s >/dev/null 2>&1",
            out, program, key, side);
  double instructions = 0;
  FILE *file = system (command) == 0 ? fopen (out, "r") : NULL;
  if (file) {
    instructions = count_read (file, function);
    fclose (file);
  }
  remove (out);
  return instructions;
}
