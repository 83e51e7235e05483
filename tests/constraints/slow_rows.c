/* A run that writes a million rows needs no more memory than one that writes ten thousand. */
#define _DEFAULT_SOURCE /* wait4 */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>
#include "check.h"

/* The largest memory of the program [kB] while it writes this number of rows. */
static long rows_memory (long rows, const char *method) {
  const char *program = getenv ("PINWHEEL");
  char t_end[30];
  struct rusage used;
  int status;
  snprintf (t_end, sizeof t_end, "%ld", rows / 1000);
  pid_t child = fork ();
  assert_true (child >= 0);
  if (child == 0) {
    execl (program ? program : "build/pinwheel", "pinwheel", "run", "pendulum", "-m", method, "--step", "1e-3",
           "--t-end", t_end, "--every", "1e-3", "--energy", "--specialise", "never", "-o", "/dev/null",
           (char *)NULL); /* without a compiler, whose memory counts as well */
    _exit (127);
  }
  assert_true (wait4 (child, &status, 0, &used) == child);
  assert_true (WIFEXITED (status) && WEXITSTATUS (status) == 0);
  return used.ru_maxrss;
}

TEST (constant) {
  static const char *const method[] = { "rk4+projection", "ida+ggl" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    long few = rows_memory (10000, method[i]), many = rows_memory (1000000, method[i]);
    print_message ("%s: 10,000 rows in %ld kB, 1,000,000 in %ld kB\n", method[i], few, many);
    assert_true (many < few + 1024); /* 1 MB: variations of the allocator */
  }
}
