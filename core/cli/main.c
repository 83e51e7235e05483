/* The program `pinwheel`: finds the command and runs it. */
#include <errno.h>
#include <gsl/gsl_version.h>
#include <nlopt.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"

#define MAIN_ENTRY(name) &pw_cli_##name,
static const pw_command *const main_commands[] = { PW_COMMANDS (MAIN_ENTRY) NULL };

static int main_usage (void) {
  puts ("Usage: pinwheel COMMAND [ARGUMENT...] [OPTION...]\n"
        "Simulate planar multibody systems with pin joints and knife-edge wheels.\n\nCommands:");
  for (const pw_command *const *c = main_commands; *c; c++) printf ("  %-11s %s\n", (*c)->name, (*c)->summary);
  puts ("\nMost commands take a MODEL: a name from `pinwheel list models`, or the path of a model file.  A text model\n"
        "(./mine.yaml) is read; a model in C (./mine.c) is compiled on the fly.  The folders in the environment "
        "variable\n"
        "PINWHEEL_MODELS, separated by \":\", are searched as well.\n\n"
        "`pinwheel COMMAND --help` describes a command and its options; `pinwheel --version` prints versions.\n"
        "Exit status: 0 success, 1 resource error, 2 invalid input, 3 inconsistent initial conditions, 4 the method\n"
        "failed, 130 interrupted, 141 output closed.");
  return 0;
}

/* Runs a command; argv begins with its name. */
static int main_command (int argc, const char **argv) {
  const char *word = argv[0];
  pw_error error = { 0 };
  pw_nearest near = { .sought = word };
  for (const pw_command *const *c = main_commands; *c; c++) {
    if (strcmp ((*c)->name, word) == 0) return pw_cli_main (*c, main_commands, argc, argv);
    pw_nearest_try (&near, (*c)->name);
  }
  for (const char *const *o = (const char *const[]){ "help", "--help", "--version", NULL }; *o; o++)
    pw_nearest_try (&near, *o);
  size_t n = strlen (word);
  if (strchr (word, '/') || (n > 5 && strcmp (word + n - 5, ".yaml") == 0))
    pw_fail (&error, PW_INPUT, "\"%s\" is not a command; to run a model write pinwheel run %s", word, word);
  else
    pw_fail (&error, PW_INPUT, "there is no %s \"%s\"%s", word[0] == '-' ? "option" : "command", word,
             near.near ? pw_nearest_text (&near) : "; see pinwheel --help");
  return pw_cli_report_error (&error);
}

static int main_version (void) {
  char libraries[200];
  int v[3];
  nlopt_version (v, v + 1, v + 2);
  printf ("pinwheel %s (plug-in ABI %d)\n%s, GSL %s, NLopt %d.%d.%d\n", PW_VERSION, PW_ABI,
          pw_library_versions (libraries, sizeof libraries), gsl_version, v[0], v[1], v[2]);
  return 0;
}

int main (int argc, char **argv) {
  /* A closed pipe or a file size limit makes writes fail, which is handled like other errors. */
  signal (SIGPIPE, SIG_IGN);
  signal (SIGXFSZ, SIG_IGN);
  signal (SIGCHLD, SIG_DFL);    /* if it is ignored, the exit status of gnuplot is not known */
  unsetenv ("POSIXLY_CORRECT"); /* with this variable popt does not accept options after the model */
  const char **words = (const char **)(void *)argv, *word = argc > 1 ? words[1] : "help";
  int is_help = strcmp (word, "help") == 0 || strcmp (word, "--help") == 0 || strcmp (word, "-?") == 0 ||
                strcmp (word, "-h") == 0;
  int status = is_help && argc > 2               ? main_command (2, (const char *[]){ words[2], "--help", NULL })
               : is_help                         ? main_usage ()
               : strcmp (word, "--version") == 0 ? main_version ()
                                                 : main_command (argc - 1, words + 1);
  pw_error error = { 0 };
  if ((fflush (stdout) != 0 || ferror (stdout)) && status == 0)
    pw_fail (&error, PW_RESOURCE, "cannot write to standard output: %s", strerror (errno));
  return status ? status : pw_cli_report_error (&error);
}
