/* The program `pinwheel`: finds the command and hands over. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "util.h"

static const pw_command main_commands[] = {
  { "list", "[WHAT [NAME...]]", "what there is: models, methods of integration, kinds of element, signals",
    pw_cli_list },
  { "show", "MODEL [OPTION...]", "what a model is made of, and its matrices", pw_cli_show },
  { "check", "MODEL [OPTION...]", "mobility, redundant rows, start, derivatives, fast motions of a model",
    pw_cli_check },
  { "run", "MODEL [OPTION...]", "integrate a model; write a table, a summary, figures, an animation", pw_cli_run },
  { "sweep", "MODEL [OPTION...]", "a table of runs, for all combinations of varied parameters", pw_cli_sweep },
  { "compare", "MODEL [OPTION...]", "what accuracy costs: many methods against the truth", pw_cli_compare },
  { "drift", "MODEL [OPTION...]", "constraints and energy in a long run, by stabilisation", pw_cli_drift },
  { "new", "NAME.c|NAME.yaml", "write a small commented model to begin with", pw_cli_new },
  { NULL, NULL, NULL, NULL },
};

static int main_usage (void) {
  puts ("Pinwheel: planar multibody systems with pin joints and knife-edge wheels\n");
  for (const pw_command *c = main_commands; c->name; c++)
    printf ("  pinwheel %-7s %-24s %s\n", c->name, c->synopsis, c->about);
  puts ("\nMODEL is a name from `pinwheel list models`, or the path of a model file: ./mine.yaml is read, ./mine.c\n"
        "compiled on the fly.  WHAT is models, methods, kinds or signals.\n"
        "Folders named in PINWHEEL_MODELS, separated by \":\", are searched as well.\n"
        "`pinwheel COMMAND --help` shows a command's options; `pinwheel --version` the version.");
  return 0;
}

static int main_version (void) {
  printf ("pinwheel %s (plug-in ABI %d)\n", PW_VERSION, PW_ABI);
  return 0;
}

static int main_unknown (const char *word) {
  pw_error error = { 0 };
  pw_nearest near = { .sought = word };
  for (const pw_command *c = main_commands; c->name; c++) pw_nearest_try (&near, c->name);
  for (const char *const *o = (const char *const[]){ "help", "--help", "--version", NULL }; *o; o++)
    pw_nearest_try (&near, *o);
  char hint[100];
  size_t n = strlen (word);
  if (strchr (word, '/') || (n > 5 && strcmp (word + n - 5, ".yaml") == 0)) {
    pw_fail (&error, PW_INPUT, "\"%s\" is no command; to run a model write pinwheel run %s", word, word);
    return pw_cli_end (&error);
  }
  pw_fail (&error, PW_INPUT, "there is no %s \"%s\"%s", word[0] == '-' ? "option" : "command", word,
           pw_nearest_text (&near, hint, sizeof hint));
  return pw_cli_end (&error);
}

/* Runs a command; argv begins with its name, in whose place the title for messages goes. */
static int main_command (const char *name, int argc, const char **argv) {
  char title[40];
  for (const pw_command *c = main_commands; c->name; c++)
    if (strcmp (c->name, name) == 0) {
      snprintf (title, sizeof title, "pinwheel %s", c->name);
      argv[0] = title;
      return c->function (argc, argv);
    }
  return main_unknown (name);
}

static int main_dispatch (int argc, const char **argv) {
  static const char *help[] = { NULL, "--help", NULL };
  const char *word = argc > 1 ? argv[1] : "help";
  int is_help = strcmp (word, "help") == 0 || strcmp (word, "--help") == 0 || strcmp (word, "-?") == 0 ||
                strcmp (word, "-h") == 0;
  if (is_help && argc > 2) return main_command (argv[2], 2, help);
  if (is_help) return main_usage ();
  if (strcmp (word, "--version") == 0) return main_version ();
  return main_command (word, argc - 1, argv + 1);
}

int main (int argc, char **argv) {
  signal (SIGPIPE,
          SIG_IGN); /* a closed pipe, and a file that may not grow, is a failed write: what is open is tidied up */
  signal (SIGXFSZ, SIG_IGN);
  unsetenv ("POSIXLY_CORRECT"); /* popt would take no option that stands after the model */
  int status = main_dispatch (argc, (const char **)argv);
  pw_error error = { 0 };
  if ((fflush (stdout) != 0 || ferror (stdout)) && status == 0)
    pw_fail (&error, PW_MACHINE, "cannot write to standard output: %s", strerror (errno));
  return status ? status : pw_cli_end (&error);
}
