/* The program's commands and their common functions.
 *
 * A command is a table pw_cli_NAME in a file of its own; PW_COMMANDS lists them.  Its function returns PW_OK, a
 * negative status with the error set, or a positive exit status if it has reported everything.  Exit statuses are
 * 0 success, 1 resource error, 2 input, 3 initial conditions, 4 method, 130 interrupted, 141 closed pipe. */
#ifndef PW_CLI_H
#define PW_CLI_H

#include <popt.h>
#include <signal.h>
#include <stdatomic.h>
#include <time.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"
#include "util.h"

/* Exit statuses after SIGINT or SIGTERM, and after SIGPIPE: 128 + SIGINT and 128 + SIGPIPE, as shells report them. */
enum { PW_INTERRUPTED = 130, PW_CLOSED_PIPE = 141 };

/* ---- Requests to stop; commands check them between steps or more often (terminal.c) ---- */

/* 1: all runs stop.  Set by SIGINT and SIGTERM, and by the threads of a command after an error that ends it. */
extern atomic_int pw_stop;

/* Counts these signals from now on.  The first requests a stop at the next check.  The third ends the program, in case
 * that check never comes; the second does not, since some senders signal both a process and its group. */
void pw_stop_catch (void);
/* From now on a signal ends the program, with a message and PW_INTERRUPTED; commands begin so.  Returns the number of
 * signals since pw_stop_catch. */
int pw_stop_release (void);

/* A limit of the processor time of a run, measured by the clock of its thread. */
typedef struct {
  double seconds; /* INFINITY: no limit */
  /* private */
  double start;      /* the thread's clock at the start [s]; 0: not started */
  double last_check; /* the coarse clock when the limit was last found not exceeded [s] */
} pw_limit;

/* Starts the clock; call it in the thread of the run when the run begins. */
void pw_limit_start (pw_limit *limit);
/* 1 once the limit is exceeded or pw_stop is set.  For pw_settings.stop; the context is the pw_limit. */
int pw_limit_over (void *context);
/* Why a run returned PW_STOPPED at time t: PW_RETRY, without an error, if pw_stop is set (after a signal the command
 * returns PW_INTERRUPTED); else PW_METHOD with an error that names the limit. */
int pw_limit_status (const pw_limit *limit, double t, pw_error *error);
/* Opens a run whose settings.stop is pw_limit_over, or NULL, and starts the clock of its limit unless it runs already.
 * If the run is stopped meanwhile, the error is that of pw_limit_status, without a text if that is PW_RETRY. */
pw_run *pw_limit_open (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error);

/* The time of a clock [s]. */
double pw_seconds (clockid_t id);
/* The number of steps between two readings of the clock: after a batch of `steps` steps that took `cpu` seconds, it is
 * doubled if that was short and the batch complete, or halved if it was long. */
void pw_batch_adapt (long *batch, long steps, double cpu);

/* ---- The progress of long work and the remaining time on standard error: a bar on a terminal, else a line a
 * minute ---- */

/* Zero-initialised, it shows nothing. */
typedef struct {
  const char *title; /* printed before the bar */
  const char *unit;  /* "s" for time; else what is counted; "": a fraction of 1 */
  double first;      /* initial time or count; not 0 if a run or sweep is resumed */
  double last;       /* final time [s] or count */
  double start;      /* clock when the work started [s] */
  double next;       /* clock before which nothing is drawn or written [s] */
  double reached;    /* time or count of the last call, */
  double changed;    /* and the clock when it was reached [s] */
  double remaining;  /* the remaining time last shown, which does not rise [s]; INFINITY: none yet */
  int drawn;         /* 1: there is a bar to erase */
  int no_bar;        /* 1: no bar on a terminal, as the results are printed there; set after the start */
  int lines;         /* 1: no terminal: lines in place of the bar */
  char note[60];     /* printed at the end of the line; "" at first */
} pw_progress;

/* Starts the progress of a run from time `first` to `last`, with the unit "s"; or of work that is counted in `unit`
 * ("runs"): `first` of `last` are done already. */
void pw_progress_start (pw_progress *p, const char *title, const char *unit, double first, double last);
/* Draws the bar for the time or count reached, at most ten times a second, or writes a line.  A count may exceed the
 * final one if that was an estimate. */
void pw_progress_at (pw_progress *p, double reached);
/* Erases the bar. */
void pw_progress_end (pw_progress *p);

/* ---- Commands and their options ---- */

/* All commands, in the order of `pinwheel --help`. */
#define PW_COMMANDS(X) \
  X (list)             \
  X (show)             \
  X (check)            \
  X (linearise)        \
  X (steady)           \
  X (periodic)         \
  X (run)              \
  X (sensitivity)      \
  X (sweep) X (fit) X (optimise) X (compare) X (drift) X (page) X (new)

/* A model opened, built and compiled. */
typedef struct {
  pw_file *file;
  pw_run_defaults defaults; /* of runs; where the model has none, 10 s, rk4+projection, 1e-3 s; rtol may be 0 */
  pw_model *model;
  pw_system *system;
} pw_cli_model;

/* A folder that a command writes into; zero-initialised, none. */
typedef struct {
  const char *path;
  size_t made;      /* length of the part of the path that is the outermost folder made; 0: none was */
  int locked, lock; /* 1: the folder is locked; the descriptor of the lock */
} pw_folder;

/* The files that a command writes, and the folder that it writes into. */
enum { PW_FILES = 6 };
typedef struct {
  pw_output *output[PW_FILES]; /* NULL: not requested */
  pw_folder folder;
} pw_files;

/* The number of an option, read with the command line. */
typedef struct {
  const char *text; /* as given; NULL: it is not */
  double number;
} pw_cli_given;
static inline double pw_cli_given_or (pw_cli_given x, double otherwise) {
  return x.text ? x.number : otherwise;
}

/* The value of --specialise: when code is compiled for a scene. */
typedef enum { PW_SPECIALISE_AUTO, PW_SPECIALISE_ALWAYS, PW_SPECIALISE_NEVER } pw_specialise;

/* A command line: its arguments and the options shared by several commands, NULL if not given; and what most commands
 * use, released after the command.  The structure of options of every command begins with one. */
typedef struct {
  const char **argument; /* ended by NULL; NULL if there are none */
  int arguments;
  const char **sets, **starts; /* "NAME=VALUE" of each --set and --start; ended by NULL */
  const char **method_files;
  const char *method, *specialise, *width, *until;
  pw_specialise when; /* of --specialise, read by pw_cli_file */
  pw_cli_given max_file, t_end, step, rtol, atol, max_steps, limit, jobs;
  const char *table, *json, *plots; /* -o, --json, --plots of PW_RESULTS_OPTIONS */
  int drawn;                        /* the status of figures, set before the summary is written */
  pw_cli_model m;                   /* opened by pw_cli_open */
  pw_files files;                   /* opened by pw_files_open */
  const pw_method **methods;        /* of --method-file, which pw_cli_file opens; ended by NULL, or NULL */
  pw_arena arena;
  /* private */
  poptContext popt;
  struct poptOption *options; /* a copy of the command's options, bound to its structure */
  void **text;                /* the text or list that popt allocated for each option */
  pw_file **method_file;      /* ended by NULL, or NULL */
} pw_cli_line;

typedef struct {
  const char *name;     /* "run" */
  const char *synopsis; /* "MODEL [OPTION...]" */
  const char *summary;  /* one line, for `pinwheel --help` */
  const char *help;     /* sentences for `pinwheel run --help` */
  int any_arguments;    /* 1: any number of arguments, 0: exactly one */
  size_t options_size;  /* of the structure of options, which begins with a pw_cli_line */
  int (*function) (void *options, pw_error *error);
  const struct poptOption *options; /* entries defined below, ended by POPT_TABLEEND */
} pw_command;

#define PW_COMMAND(name) extern const pw_command pw_cli_##name;
PW_COMMANDS (PW_COMMAND)

/* Entries of a table of options: a text, a number of a domain (a pw_cli_given), a list of texts (the option may be
 * repeated), a flag (an int).  The member of the structure `type` is zero if the option is not given; texts are
 * released with the command line.  `name`: "every"; `letter`: 'e', or 0 without a short form; `value`: its name in the
 * help, "DT". */
#define PW_TEXT_OPTION(type, member, name, letter, value, help) \
  { name, letter, POPT_ARG_STRING, (void *)offsetof (type, member), 0, help, value }
#define PW_NUMBER_OPTION(type, member, name, letter, value, domain, help) \
  { name, letter, POPT_ARG_STRING, (void *)offsetof (type, member), 1 + (domain), help, value }
#define PW_LIST_OPTION(type, member, name, letter, value, help) \
  { name, letter, POPT_ARG_ARGV, (void *)offsetof (type, member), 0, help, value }
#define PW_FLAG_OPTION(type, member, name, help) \
  { name, 0, POPT_ARG_NONE, (void *)offsetof (type, member), 0, help, NULL }
/* Another name of a text option, without help. */
#define PW_ALIAS_OPTION(type, member, name) \
  { name, 0, POPT_ARG_STRING, (void *)offsetof (type, member), 0, NULL, NULL }
/* A heading for the options after it. */
#define PW_OPTION_GROUP(title) \
  { NULL, 0, POPT_ARG_NONE, NULL, 0, title, NULL }

/* Options of commands that open a model (MODEL), that integrate (STEP, with ENGINE), also with one method (METHOD). */
#define PW_MODEL_OPTIONS                                                                                       \
  PW_OPTION_GROUP ("Model"),                                                                                   \
      PW_LIST_OPTION (pw_cli_line, sets, "set", 0, "PARAM=VALUE",                                              \
                      "Set a parameter of the model to a number or an expression such as 30*deg; repeatable"), \
      PW_LIST_OPTION (pw_cli_line, starts, "start", 0, "STATE=VALUE",                                          \
                      "Set the initial value of a state, BODY.x, .y, .phi, .vx, .vy or .omega; repeatable"),   \
      PW_NUMBER_OPTION (pw_cli_line, max_file, "max-file", 0, "MB", PW_POSITIVE,                               \
                        "Read model files of up to this size (default 64)")
#define PW_STEP_OPTIONS                                                                                            \
  PW_NUMBER_OPTION (pw_cli_line, t_end, "t-end", 't', "T", PW_POSITIVE, "Final time [s]"),                         \
      PW_NUMBER_OPTION (pw_cli_line, step, "step", 0, "H", PW_POSITIVE, "Step size of fixed-step methods [s]"),    \
      PW_NUMBER_OPTION (pw_cli_line, rtol, "rtol", 0, "R", PW_POSITIVE, "Relative tolerance of adaptive methods"), \
      PW_NUMBER_OPTION (pw_cli_line, max_steps, "max-steps", 0, "N", PW_COUNT,                                     \
                        "Stop adaptive methods after this many attempted steps (default 1e7)"),                    \
      PW_NUMBER_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS", PW_POSITIVE,                                    \
                        "Stop a run after this much processor time (default unlimited)"),                          \
      PW_ENGINE_OPTION
#define PW_UNTIL_OPTION                                        \
  PW_TEXT_OPTION (pw_cli_line, until, "until", 0, "CONDITION", \
                  "End the run when a condition on columns becomes true, such as \"car.x > 10\"")
#define PW_LIMIT_OPTION                                                     \
  PW_NUMBER_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS", PW_POSITIVE, \
                    "Stop after this much processor time (default unlimited)")
#define PW_ENGINE_OPTION                                                                                    \
  PW_TEXT_OPTION (                                                                                          \
      pw_cli_line, specialise, "specialise", 0, "WHEN",                                                     \
      "Compile code for this scene alone, which runs faster: auto (if the runs are long enough, default), " \
      "always or never")
#define PW_JOBS_OPTION(help) PW_NUMBER_OPTION (pw_cli_line, jobs, "jobs", 'j', "N", PW_COUNT, help)
#define PW_METHOD_FILE_OPTION                                            \
  PW_LIST_OPTION (pw_cli_line, method_files, "method-file", 0, "FILE.c", \
                  "Compile a file of methods of your own, which are then used by name; repeatable")
#define PW_METHOD_OPTIONS                                                           \
  PW_OPTION_GROUP ("Integration"),                                                  \
      PW_TEXT_OPTION (pw_cli_line, method, "method", 'm', "METHOD",                 \
                      "Integrator and stabilisation, see `pinwheel list methods`"), \
      PW_METHOD_FILE_OPTION, PW_STEP_OPTIONS,                                       \
      PW_NUMBER_OPTION (pw_cli_line, atol, "atol", 0, "A", PW_POSITIVE,             \
                        "Absolute tolerance of every state (default rtol times its scale)")

/* Reads the command line (argv[0] is not read), runs the command and reports its error; returns the exit status.  all:
 * the commands, ended by NULL, for messages, or NULL. */
int pw_cli_main (const pw_command *command, const pw_command *const *all, int argc, const char **argv);

/* Refuses more than one argument. */
int pw_cli_at_most_one (const pw_command *command, const pw_cli_line *line, pw_error *error);

/* PW_INPUT if an option ("--every") is given (its value is not NULL) without the one that it requires ("-o DIR"). */
int pw_cli_requires (const char *option, const char *value, const char *required, int is_given, pw_error *error);

/* Reads the value of an option ("--step"), a number or an expression, in any locale; a NULL text leaves *value
 * unchanged.  PW_INPUT if it is neither or lies outside the domain. */
int pw_cli_number (const char *option, const char *text, pw_domain domain, double *value, pw_error *error);

/* The length of a text up to a character outside of parentheses, or its end. */
size_t pw_cli_part (const char *text, char end);

/* A range from a number to another one, which may be less. */
typedef struct {
  double low, high;
  long count;      /* 0: not given */
  int logarithmic; /* 1: both are > 0 */
} pw_range;
/* Reads "[NAME=]LOW:HIGH[:COUNT][:log]", or with a notice the old spelling "NAME=lin:LOW:HIGH:COUNT" (log:); `option`
 * begins messages.  PW_INPUT. */
int pw_cli_range (const char *option, const char *text, pw_range *range, pw_error *error);

/* A varied quantity. */
enum { PW_AXIS_VALUES = 11 /* of a range without COUNT */ };
#define PW_AXIS_MOST 1e8 /* values of an axis, and rows of a grid: a journal needs 8 bytes of memory per row */
typedef struct {
  char *name;
  char *text;                    /* of its values, "1:10:100" or "1,2,5", as written */
  pw_range range;                /* without a list */
  double *value;                 /* of a list; NULL: a range */
  long count;                    /* number of values */
  long stride;                   /* number of rows from one value to the next */
  const pw_parameter *parameter; /* NULL: the initial value of a state; set by a sweep, like stride and unit */
  const char *unit;
} pw_axis;
/* Reads "NAME=RANGE" or "NAME=V1,V2,..."; the arrays of the axis are in the arena.  PW_INPUT with the reason,
 * PW_RESOURCE. */
int pw_axis_read (pw_axis *axis, const char *text, pw_arena *arena, pw_error *error);
double pw_axis_value (const pw_axis *axis, long i); /* i from 0 */

/* Settings except `ledger` and `specialised`, whose span is the final time, and limit of a run, from options and
 * defaults.  The limit must outlive the run. */
void pw_cli_settings (const pw_cli_line *line, const pw_run_defaults *defaults, pw_settings *settings, pw_limit *limit);

/* The status of a command that was stopped: PW_INTERRUPTED after a signal, with a message that results are incomplete;
 * else PW_METHOD with an error that names --limit. */
int pw_cli_incomplete (const pw_cli_line *line, pw_error *error);

/* 1 if the step size of a method, built-in or one of `own`, follows a tolerance, 0 if it is fixed; -1 if there is no
 * such method. */
int pw_cli_adaptive (const pw_method *const *own, const char *method);
/* Prints notices of options without effect on a method; but --step and tolerances may be given together, as by scripts
 * that compare methods. */
void pw_cli_report_unused (const char *method, const pw_cli_line *line);

/* ---- Models ---- */

/* Opens the model file of a command line, whose first argument is its name or path.  A status. */
int pw_cli_file (pw_cli_line *line, pw_error *error);

/* Opens, builds and compiles the model of a command line with its --set and --start.  A status. */
int pw_cli_open (pw_cli_line *line, pw_error *error);
void pw_cli_close_model (pw_cli_model *m);

/* Prints notices of tables that do not cover a run from 0 to t_end, and of rows of their files that are left out. */
void pw_cli_report_tables (const pw_system *s, double t_end);

/* Reads "NAME=VALUE" of an option.  PW_INPUT if it does not have this form, which messages call `form`. */
enum { PW_ASSIGNED_NAME = 200 }; /* longest name, its end included */
int pw_cli_assignment (const char *option, const char *text, const char *form, char name[PW_ASSIGNED_NAME],
                       double *value, pw_error *error);

/* Sets the parameters of --set and the initial values of --start in a model that is not built yet.  PW_INPUT. */
int pw_cli_apply (const pw_cli_line *line, pw_model *m, pw_error *error);
/* 1 if the name may be that of a state: it has a dot, or the model with its defaults has this first-order state. */
int pw_cli_is_state (const pw_file *file, const char *name);
/* Fails: a model of the file has no parameter of this name, with the nearest one or else the nearest state, where
 * `states` are valid, too. */
int pw_cli_no_parameter (const pw_file *file, pw_model *m, const char *name, int states, pw_error *error);

/* The parameter of a model of this name; NULL: there is none. */
const pw_parameter *pw_cli_parameter (const pw_model *m, const char *name);

enum { PW_CHANGE_TEXT = 400 };
/* A state, and its values before and after the consistent initialisation. */
typedef struct {
  char name[PW_NAME_BYTES];
  const char *unit;
  double given, consistent;
} pw_state_change;
pw_state_change pw_cli_state_change (const pw_system *system, const pw_initial_report *initial, int state);
/* The largest such change [SI units] of the values given by the user, and a text such as "frame.vy from 1 to 1.2 m/s";
 * 0, without a text, if all are as given. */
double pw_cli_largest_change (const pw_run *r, const pw_system *s, char text[PW_CHANGE_TEXT]);

/* The part of a path that is relative to the current directory, or all of it if it does not lie there. */
const char *pw_cli_short_path (const char *path);

/* ---- The engine of runs (engine.c): what evaluates the equations of motion ---- */

typedef struct {
  pw_scene_code *code; /* NULL: the general engine */
  char reason[200];    /* why the general engine is used */
} pw_cli_engine;

/* The C text of the code specialised for a system, without the constraint equations that are redundant at the initial
 * state, if that can be made consistent.  NULL and the error if there can be none.  Free it. */
char *pw_cli_source (const pw_system *s, pw_error *error);
/* Chooses the engine for runs with `steps` steps in total; loads or compiles the code, and prints notices. */
void pw_cli_engine_open (pw_cli_engine *e, const pw_system *s, pw_specialise when, double steps);
void pw_cli_engine_close (pw_cli_engine *e);

/* The code that advances `lanes` runs at once, by a method of fixed step size; the caller closes it.  NULL: one run
 * after the other.  With `lanes` 0, as many as fill a vector register, but only if the code need not be compiled or
 * all runs together have PW_LANES_STEPS steps or more, which repay the compilation. */
#define PW_LANES_STEPS 5e6 /* measured: 2.4e6 (snakeboard) to 4.7e6 (ezyroller) on one processor */
pw_scene_code *pw_cli_engine_lanes (const pw_cli_engine *e, const pw_system *s, const char *method, int lanes,
                                    double steps);

/* ---- Cells of the lines of a CSV table; errors of writing are those of the stream ---- */

typedef struct {
  FILE *f;
  int cells; /* in the line so far */
} pw_cells;

void pw_cells_number (pw_cells *c, double value); /* by pw_format; nan if not finite */
void pw_cells_text (pw_cells *c, const char *text);
/* The cell "NAME [UNIT]", in quotes if the name has a comma; no unit if it is NULL or "".  Line ends in the name become
 * blanks. */
void pw_cells_name (pw_cells *c, const char *name, const char *unit);
/* A cell in quotes; line ends in it become blanks. */
void pw_cells_quoted (pw_cells *c, const char *text);
void pw_cells_end (pw_cells *c);

/* ---- Files ---- */

/* First entry of the list of files passed to pw_cli_check_uses, which fills in the path. */
#define PW_CLI_MODEL_USE \
  { "the model", NULL, PW_READS, NULL }

/* Refuses files that a command would both read and write, or write twice.  The first entry, PW_CLI_MODEL_USE, stands
 * for the model of the command line and, if its file is open, for the tables that it reads. */
int pw_cli_check_uses (const pw_cli_line *line, pw_use *use, int count, pw_error *error);

/* Makes a folder and those above it, and locks it.  The path must outlive it; close it in every case. */
int pw_folder_open (pw_folder *folder, const char *path, pw_error *error);
/* Unlocks a folder; removes what was made, as far as it is empty. */
void pw_folder_close (pw_folder *folder);

/* Checks a list of at most PW_FILES uses (pw_cli_check_uses), then opens each file that is written, use[i] as
 * output[i], and makes and locks the folder that is written into. */
int pw_files_open (pw_cli_line *line, pw_use *use, int count, pw_error *error);
FILE *pw_files_stream (const pw_cli_line *line, int i); /* NULL: not requested */
/* Completes all of them (pw_output_finish_all). */
int pw_files_finish (pw_cli_line *line, pw_error *error);

/* Writes the table of `table` to a file in the format that the ending of its path states: .csv; .npz, a NumPy archive
 * with a vector of each column, named without unit; or .json, an object with a list of each column.  PW_RESOURCE. */
int pw_cli_write_table (const char *path, FILE *f, const void *context,
                        void (*table) (const void *context, pw_cells *c), pw_error *error);
/* Whether a name ends as that of a file: ".csv", ".png", ... */
int pw_cli_names_file (const char *path);
/* Refuses a file in a format that is not written, and a new folder with the name of a file.  A status. */
int pw_cli_check_format (const pw_use *use, pw_error *error);
/* Endings of formats, for pw_use. */
extern const char *const pw_cli_csv[], *const pw_cli_json[], *const pw_cli_tables[];

/* ---- Messages ---- */

/* A number as text (pw_format), in a buffer that lives as long as the block around it. */
#define PW_DIGITS(value, digits) pw_format ((char[32]){ 0 }, value, digits)
/* What to write in place of a number with a unit (pw_number_hint), likewise. */
#define PW_NUMBER_HINT(text) pw_number_hint (text, (char[PW_HINT]){ 0 }, PW_HINT)

/* "1 run", "2 runs", likewise. */
#define PW_COUNTED(count, noun) PW_PRINTED (60, "%ld %s%s", (long)(count), noun, (count) == 1 ? "" : "s")

/* Prints to a stream; pw_cli_say: to standard error.  On a terminal control characters are escaped. */
void pw_cli_print (FILE *f, const char *format, ...) PW_PRINTF (2, 3);
#define pw_cli_say(...) pw_cli_print (stderr, __VA_ARGS__)

/* Writes a text in single quotes, on one line.  A quote in it becomes `quote`: "''" for gnuplot and YAML. */
void pw_cli_quoted (FILE *f, const char *text, const char *quote);
/* Writes a word of a shell command, in quotes. */
void pw_cli_word (FILE *f, const char *word);

/* Prints text broken into lines of `width` characters.  The first line continues at column `indent`, where the others
 * begin. */
void pw_cli_print_wrapped (const char *text, int indent, int width);

/* The word for a status in tables and summaries: "ok", "machine", "input", "start" or "method" for PW_OK to PW_METHOD,
 * "interrupted" for PW_INTERRUPTED. */
const char *pw_cli_status_word (int status);

/* Prints an error, if there is one, as "pinwheel: TEXT" on standard error, without "pinwheel:" if TEXT begins with a
 * file and line; returns the exit status.  A closed pipe on standard output is not reported: PW_CLOSED_PIPE. */
int pw_cli_report_error (const pw_error *error);

/* The end of a list of which `more` entries are not printed. */
void pw_report_more (FILE *f, int more, const char *hint);
/* Initial phi and headings that are probably degrees; expressions that may jump with states. */
void pw_report_model (const pw_cli_model *m);
/* Derivatives by differences, states changed by the consistent initialisation, redundant constraint equations. */
void pw_report_initialisation (pw_run *run, const pw_system *system, const char *const *redundant);
/* States that the consistent initialisation changes, if it succeeds within this processor time [s].  PW_OK or
 * PW_RESOURCE. */
int pw_report_initial_state (const pw_cli_model *m, double limit, pw_error *error);
/* Descriptions of the redundant constraint equations, ended by NULL; release them with one free.  NULL if there are
 * none or memory is exhausted. */
const char **pw_report_redundancies (pw_run *run);

/* Closes an incomplete table: it remains as NAME.part, whose path goes to the buffer; without rows it is removed, and
 * the path is "". */
void pw_cli_abandon_table (pw_output *o, long rows, char *part, size_t size);

/* ---- Fingerprints of checkpoints and journals of sweeps ----
 *
 * A first line that names the format (`magic`, with its "\n"), lines "KEY = VALUE" with everything that determines the
 * results of a run or a sweep, and a line "end": so results of different runs are never mixed. */

/* Adds the line "KEY NAME = VALUE", where the key is that of a list of values; or, if `name` is NULL, "KEY = VALUE". */
void pw_fingerprint_line (FILE *f, const char *key, const char *name, const char *value);
void pw_fingerprint_number (FILE *f, const char *key, const char *name, double value);
/* Adds a line with the name of a file and a checksum of its contents.  PW_INPUT or PW_RESOURCE if it cannot be read. */
int pw_fingerprint_file (FILE *f, const char *key, const char *name, const char *path, pw_error *error);
/* Adds the first lines of the fingerprint of a run or sweep: `magic`, version, model, the checksum of its tables
 * (pw_fingerprint_tables) unless it is 0, files of methods, method, span, step and tolerances.  Errors as of
 * pw_fingerprint_file. */
int pw_fingerprint_run (FILE *f, const char *magic, const pw_cli_line *line, uint64_t table_sum, const char *method,
                        const pw_settings *settings, pw_error *error);
/* Continues a checksum, 0 at first, with the tables in the signals of a model, and the points of its paths. */
uint64_t pw_fingerprint_tables (uint64_t sum, const pw_model *m);
/* Adds a line for each state of a list of "STATE=VALUE", its last value; the list ends with NULL, or is NULL. */
void pw_fingerprint_initial (FILE *f, const char **starts);

/* The end of the fingerprint at the beginning of a text; NULL if it is incomplete or its first line is not `magic`. */
const char *pw_fingerprint_end (const char *magic, const char *at, const char *end);
/* The value of a key, of *size bytes and not zero-terminated; NULL if there is none. */
const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size);

typedef struct {
  const char *begin, *end;
  const char *where; /* in messages: "here", "there" */
} pw_fingerprint;

/* 1 if fingerprints differ in a key other than `ignored` (may be NULL); `text` is then the first difference: "step is
 * 0.001 there and 0.002 here". */
int pw_fingerprint_differ (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size);

/* ---- Independent tasks in several threads ---- */

/* The number of concurrent tasks: the value of --jobs, else OMP_NUM_THREADS, else that of available processors. */
int pw_parallel_jobs (const pw_cli_line *line);

/* Task number i; returns a status. */
typedef int pw_task (void *context, int i, pw_error *error);

/* Calls task (context, i) for each i < count in any order, in at most `jobs` threads, of which the caller is one.
 * After the first task that does not return PW_OK no further ones are called; its status and error are returned.
 * PW_RESOURCE if a thread cannot be started: no task has been called. */
int pw_parallel (int jobs, int count, pw_task *task, void *context, pw_error *error);
/* The same for tasks that are timed: each thread has physical cores of its own, so there are no more threads than
 * cores.  If the processors are unknown, the tasks are called one after the other; if only their cores are, each
 * processor counts as a core. */
int pw_parallel_timed (int jobs, int count, pw_task *task, void *context, pw_error *error);

/* ---- Printed tables: columns as wide as their widest cell ----
 *
 * Write the rows in a loop, which is passed twice, first to measure the columns:
 *
 *     for (pw_table t = { 0 }; pw_table_pass (&t);)
 *       for (...) { pw_cell (&t, -8, name); pw_cell_number (&t, 13, value, 8); pw_row_end (&t); } */
typedef struct {
  FILE *f;               /* NULL: standard output */
  int pass;              /* 1: measures, 2: prints */
  int column, width[12]; /* the current column, of at most 12 */
  int pad;               /* blanks before the next cell */
  int indent;            /* characters of the row so far, with those blanks */
} pw_table;

int pw_table_pass (pw_table *table);
/* A cell after two blanks, of at least |width| characters, aligned to the right; width <= 0: to the left.  Returns 1 if
 * it is printed in this pass. */
int pw_cell (pw_table *table, int width, const char *text);
/* A number with this number of digits; empty if it is NaN. */
int pw_cell_number (pw_table *table, int width, double value, int digits);
/* A cell "NAME [UNIT]". */
int pw_cell_unit (pw_table *table, int width, const char *name, const char *unit);
void pw_row_end (pw_table *table);
/* A row of headings, or the rest of one, ended by NULL: the first in a cell of width `first`, others of `width`. */
void pw_head (pw_table *table, int first, int width, const char *const *heading);

enum { PW_BODIES_PRINTED = 20 }; /* at most */
/* Prints x, y, phi and their rates of the bodies, with 0 for numbers below `least`; first, width: of the columns. */
void pw_print_bodies (const pw_system *s, const double *q, const double *v, const char *heading, int first, int width,
                      int digits, double least);

#endif
