/* On a terminal: the progress bar of a long run; Ctrl-C once, and repeatedly; names with control characters. */
#define _XOPEN_SOURCE 700
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"

enum { TERMINAL_COLUMNS = 70 }; /* the longest title, time and remaining time fit */

/* Starts a command whose standard output or error is the far end of a new terminal; returns the near end.  NULL instead
 * of `option`: no option. */
static int terminal_open (int output, const char *command, const char *model, const char *option, const char *value,
                          pid_t *child) {
  const char *program = getenv ("PINWHEEL");
  int near = posix_openpt (O_RDWR | O_NOCTTY);
  if (near < 0 || grantpt (near) != 0 || unlockpt (near) != 0) return -1;
  const struct winsize size = { .ws_row = 24, .ws_col = TERMINAL_COLUMNS };
  int far = open (ptsname (near), O_RDWR | O_NOCTTY), nothing = open ("/dev/null", O_RDWR);
  if (program == NULL) program = "build/pinwheel";
  if (ioctl (near, TIOCSWINSZ, &size) != 0) return -1;
  *child = fork ();
  if (*child == 0) {
    for (int i = 0; i < 3; i++) dup2 (i == output ? far : nothing, i);
    close (near);
    execl (program, program, command, model, option, value, (char *)NULL);
    _exit (127);
  }
  close (far);
  close (nothing);
  return near;
}

/* Reads on until the text is there, or to the end if it is NULL. */
static int terminal_read (int near, const char *until, char *text, size_t size, size_t *n) {
  while (*n + 1 < size) {
    ssize_t got = read (near, text + *n, size - 1 - *n);
    if (got <= 0) return until == NULL;
    *n += (size_t)got;
    text[*n] = 0;
    if (until && strstr (text, until)) return 1;
  }
  return 0;
}

/* A bar that says how far it is and how long it will take, and is wiped away before the last message. */
static void terminal_bar (const char *model, const char *title, const char *t_end, const char *of) {
  char text[20000] = "";
  size_t n = 0;
  pid_t child = -1;
  int status = 0, near = terminal_open (STDERR_FILENO, "run", model, "--t-end", t_end, &child);
  if (near < 0) skip ();
  assert_true (child > 0);
  assert_true (terminal_read (near, " to go\033[K", text, sizeof text, &n));
  assert_non_null (strstr (text, title));
  assert_non_null (strstr (text, of));
  assert_non_null (strstr (text, " %  t = "));
  const char *bar = strstr (text, title);
  check_below ("columns", (double)(strstr (bar, "\033[K") - bar - 1), TERMINAL_COLUMNS, "one line of the terminal");
  assert_int_equal (kill (child, SIGINT), 0);
  terminal_read (near, NULL, text, sizeof text, &n);
  close (near);
  assert_int_equal (waitpid (child, &status, 0), child);
  assert_true (WIFEXITED (status) && WEXITSTATUS (status) == 130);
  const char *wiped = strstr (text, "\r\033[K"), *message = strstr (text, "pinwheel: ");
  assert_true (wiped && message && message > wiped);
}

TEST (bar) {
  terminal_bar ("ezyroller", "\rezyroller [", "3e4", " of 3e+04 s  ");  /* most of a minute */
  terminal_bar ("ezyroller", "\rezyroller [", "1e7", " of 1e+07 s  ");  /* hours */
  terminal_bar ("ezyroller", "\rezyroller [", "1e12", " of 1e+12 s  "); /* nobody knows */
  /* the 16 bytes that are shown would end within the umlaut */
  cli_write ("fifteen-lettersü.yaml", "pinwheel: 1\nabout: free\nbodies:\n  - {name: b, mass: 1, inertia: 1}\n");
  terminal_bar (cli_path ("fifteen-lettersü.yaml"), "\rfifteen-letters [", "1e7", " of 1e+07 s  ");
}

/* A model that never answers: the first two Ctrl-C ask it to stop, the third ends the program. */
TEST (insist) {
  cli_write ("hang.c", "#include <stdio.h>\n#include <unistd.h>\n#include \"pinwheel.h\"\n"
                       "static int wait (void *c, double t, const double *x, double *u, double *g) {\n"
                       "  (void)c, (void)t, (void)x, (void)g;\n"
                       "  u[0] = u[1] = u[2] = 0;\n"
                       "  if (t == 0) return 0;\n  puts (\"waits\");\n  fflush (stdout);\n"
                       "  for (;;) pause ();\n"
                       "}\n"
                       "static void build (pw_model *m, const void *p) {\n  (void)p;\n"
                       "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1 });\n"
                       "  pw_add_torque (m, &(pw_torque){ .name = \"T\", .body = { \"a\", \"ground\" },\n"
                       "    .value = { PW_FUNCTION, .function = { .eval = wait } } });\n"
                       "}\n"
                       "PW_MODEL (.about = \"waits\", .build = build);\n");
  cli_run ("\"${PINWHEEL:-build/pinwheel}\" run @/hang.c >@/said & p=$!\n"
           "until grep -q waits @/said || ! kill -0 $p; do sleep 0.05; done\n"
           "n=0; while kill -TERM $p 2>/dev/null && [ $n -lt 200 ]; do n=$((n + 1)); sleep 0.05; done\n"
           "[ $n -ge 3 ] || echo too soon; kill -9 $p 2>/dev/null; wait $p 2>/dev/null; echo $?");
  assert_string_equal (cli_out, "143\n");
}

/* What a command prints at a terminal has none of the control characters of a name. */
static void terminal_escapes (const char *command, const char *path, const char *expected) {
  char text[10000] = "";
  size_t n = 0;
  pid_t child = -1;
  int near = terminal_open (STDOUT_FILENO, command, path, NULL, NULL, &child);
  if (near < 0) skip ();
  terminal_read (near, NULL, text, sizeof text, &n);
  close (near);
  waitpid (child, NULL, 0);
  assert_null (strchr (text, '\033'));
  assert_non_null (strstr (text, expected));
}

TEST (names) {
  assert_int_equal (mkdir (cli_path ("odd\033[31m"), 0700), 0);
  const char *path = cli_path ("odd\033[31m/x.yaml");
  terminal_escapes ("new", path, "/odd\\x1b[31m/x.yaml is written");
  terminal_escapes ("show", path, "/odd\\x1b[31m/x.yaml\r\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
