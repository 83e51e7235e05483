/* Instructions, counted by callgrind in a process of its own. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "engine.h"

long engine_counted (const timing_work *w, long n) {
  return w->run (w->context, n);
}

/* The cost of all calls of a function: "cfn=NAME", "calls=COUNT ...", "LINE COST".  The counts are of no use, since they
 * run on while nothing is collected. */
static double count_read (FILE *file, const char *function) {
  char line[1000];
  double cost = 0, n;
  int ours = 0, next = 0;
  while (fgets (line, sizeof line, file)) {
    if (strncmp (line, "cfn=", 4) == 0) {
      line[strcspn (line, "\n")] = '\0';
      ours = strcmp (line + 4, function) == 0;
    } else if (strncmp (line, "calls=", 6) == 0) {
      next = ours;
      ours = 0;
    } else if (next) {
      if (sscanf (line, "%*s %lf", &n) == 1) cost += n;
      next = 0;
    }
  }
  return cost;
}

double engine_count (const char *program, const char *key, const char *side, const char *function) {
  char out[] = "/tmp/engine-XXXXXX", command[1200];
  if (system ("valgrind --version >/dev/null 2>&1") != 0) return 0;
  int fd = mkstemp (out);
  if (fd < 0) return 0;
  close (fd);
  /* Names are resolved at the start, so that the first call is like the others. */
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
