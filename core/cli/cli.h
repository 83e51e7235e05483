/* The program from inside: its commands and what they share.
 *
 * A command is one file with one function, which gets the command line after the word "pinwheel" (argv[0] is
 * "pinwheel run", for messages) and returns the exit status: 0 good, 1 machine, 2 input, 3 start, 4 method, 130
 * interrupted, 141 closed pipe.  It keeps a pw_error, and ends with `return pw_cli_end (&error)`, the one place
 * that prints an error. */
#ifndef PW_CLI_H
#define PW_CLI_H

#include <popt.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

enum { PW_INTERRUPTED = 130, PW_CLOSED_PIPE = 141 }; /* exit statuses after Ctrl-C, and when nobody reads the output */

/* ---- Commands ---- */

typedef struct {
  const char *name;     /* "run" */
  const char *synopsis; /* "MODEL [OPTION...]" */
  const char *about;    /* one line */
  int (*function) (int argc, const char **argv);
} pw_command;

int pw_cli_list (int argc, const char **argv);
int pw_cli_show (int argc, const char **argv);
int pw_cli_check (int argc, const char **argv);
int pw_cli_new (int argc, const char **argv);
int pw_cli_run (int argc, const char **argv);
int pw_cli_sweep (int argc, const char **argv);
int pw_cli_compare (int argc, const char **argv);
int pw_cli_drift (int argc, const char **argv);

/* ---- Options ---- */

/* A command line that has been read; close it after the last use of its texts. */
typedef struct {
  poptContext popt;
  struct poptOption *table; /* a copy of the command's options, and help */
  void **text;              /* what popt allocated for each of them */
  const char **argument;    /* what is no option, ended by NULL */
  int arguments;            /* how many */
  char *max_file;           /* of commands with --set: what --max-file was given, or NULL */
} pw_cli_line;

/* Reads a command line.  `options` is popt's table without help, which is added here, as --max-file is to --set;
 * take texts with POPT_ARG_STRING, repeated ones with POPT_ARG_ARGV (a NULL-terminated list, or NULL if there were
 * none), numbers as texts and pass them to pw_cli_number.  All of these variables are NULL at first, and what they
 * were given is freed with the line.  Fewer arguments than `least` or more than `most` are refused; `synopsis` says
 * what is expected ("MODEL [OPTION...]").  PW_OK; 1 if help was asked for and has been printed; PW_INPUT for an
 * unknown option, with the nearest valid one, or one without its value.  Close the line in every case. */
int pw_cli_read (pw_cli_line *l, int argc, const char **argv, const struct poptOption *options, const char *synopsis,
                 int least, int most, pw_error *error);
void pw_cli_close (pw_cli_line *l);

/* Reads the value of an option ("--step") in any locale; a NULL text leaves *value.  PW_INPUT if it is no number of the
 * domain. */
int pw_cli_number (const char *option, const char *text, pw_domain domain, double *value, pw_error *error);

/* Entries of popt's table for --set and --start: two addresses of `const char **`, NULL at first. */
#define PW_CLI_MODEL_OPTIONS(sets, starts)                                                                         \
  { "set",        0, POPT_ARG_ARGV,                                                                                \
    (sets),       0, "Set a parameter of the model, to a number or an expression such as 30*deg; may be repeated", \
    "PARAM=VALUE" },                                                                                               \
  {                                                                                                                \
    "start", 0, POPT_ARG_ARGV, (starts), 0, "Set a start value, BODY.x|y|phi|vx|vy|omega; may be repeated",        \
        "STATE=VALUE"                                                                                              \
  }

/* How to run, as options say it; NULL: as the model wishes. */
typedef struct {
  const char *method, *t_end, *step, *rtol, *atol, *max_steps, *limit;
} pw_cli_wishes;

/* Entries of popt's table for a pw_cli_wishes: for commands that choose the methods themselves, and for those that run
 * one method. */
#define PW_CLI_STEP_OPTIONS(w)                                                                                           \
  { "t-end", 't', POPT_ARG_STRING, &(w)->t_end, 0, "Time to run to [s]", "T" },                                          \
      { "step", 0, POPT_ARG_STRING, &(w)->step, 0, "Step of fixed-step methods [s]", "H" },                              \
      { "rtol", 0, POPT_ARG_STRING, &(w)->rtol, 0, "Relative tolerance of adaptive methods", "R" },                      \
      { "max-steps", 0, POPT_ARG_STRING, &(w)->max_steps, 0, "Attempted steps of adaptive methods (default 1e7)", "N" }, \
  {                                                                                                                      \
    "limit", 0, POPT_ARG_STRING, &(w)->limit, 0, "Processor time of a single run [s]; by default any", "SECONDS"         \
  }
#define PW_CLI_RUN_OPTIONS(w)                                                                                        \
  { "method", 'm', POPT_ARG_STRING, &(w)->method, 0, "Integrator and stabilisation, see: pinwheel list methods",     \
    "METHOD" },                                                                                                      \
      PW_CLI_STEP_OPTIONS (w), {                                                                                     \
    "atol", 0, POPT_ARG_STRING, &(w)->atol, 0, "Absolute tolerance of every state; by default rtol times its scale", \
        "A"                                                                                                          \
  }

/* Options over a model's wishes: t_end and the settings, but for the ledger. */
int pw_cli_settle (const pw_cli_wishes *w, const pw_run_defaults *model, double *t_end, pw_settings *settings,
                   pw_error *error);

/* ---- Models ---- */

/* A model opened, built and compiled. */
typedef struct {
  pw_file *file;
  pw_model *model;
  pw_system *system;
} pw_cli_model;

/* Opens the model file that a command line's first argument names, by name or path. */
pw_file *pw_cli_file (const pw_cli_line *l, pw_error *error);

/* Opens the model of a command line, sets "PARAM=VALUE" and "STATE=VALUE" (NULL-terminated lists, or NULL), builds and
 * compiles it.  Returns a status; close the model in every case. */
int pw_cli_open (pw_cli_model *m, const pw_cli_line *l, const char *const *sets, const char *const *starts,
                 pw_error *error);
void pw_cli_close_model (pw_cli_model *m);

/* Applies every "NAME=VALUE" of a NULL-terminated list to a model by pw_set or pw_set_start; `option` ("--set") is for
 * messages. */
int pw_cli_apply (pw_model *m, const char *option, const char *const *list,
                  int (*set) (pw_model *m, const char *name, double value, pw_error *error), pw_error *error);

/* A path, relative to the current directory if it lies below; it may be written to the buffer. */
const char *pw_cli_short_path (const char *path, char *buffer, size_t size);

/* How to run a model by default: its own wishes, else 10 s of rk4+projection with steps of 1e-3 s.  rtol stays 0 where
 * the model does not say. */
pw_run_defaults pw_cli_defaults (const pw_plugin_table *table);

/* Shows M, J, gamma and all that stands beside them at time t of a run with the model's default method (matrices.c). */
int pw_cli_matrices (const pw_cli_model *m, double t, pw_error *error);

/* Writes a built model to standard output as text, with all numbers as they are (show_yaml.c).  PW_INPUT for what a text
 * model cannot say: function signals, kinds of the model's own. */
int pw_cli_yaml (const pw_cli_model *m, pw_error *error);

/* ---- Files ---- */

/* The first entry of a command's list for pw_cli_uses. */
#define PW_CLI_MODEL_USE \
  { "the model", NULL, PW_READS, NULL }

/* Refuses files that a command would read and write, or write twice.  The list begins with PW_CLI_MODEL_USE, which
 * stands for the model of the command line and, once its file is open, for the tables it reads; `file` may be NULL. */
int pw_cli_uses (const pw_cli_line *l, const pw_file *file, pw_use *use, int count, pw_error *error);

/* ---- The end ---- */

#ifdef __GNUC__
#define PW_PRINTS(n) __attribute__ ((format (printf, n, n + 1)))
#else
#define PW_PRINTS(n)
#endif

/* Print to standard error, and to a stream; on a terminal control characters are escaped, since names may contain them. */
void pw_cli_say (const char *format, ...) PW_PRINTS (1);
void pw_cli_print (FILE *f, const char *format, ...) PW_PRINTS (2);

/* Prints an error, if there is one, as "pinwheel: TEXT" on standard error, or as it is if it names a place in a file;
 * returns the exit status. */
int pw_cli_end (const pw_error *error);

#endif
