/* The command `pinwheel run`: its options, what it has open, its checkpoints. */
#ifndef PW_RUN_COMMAND_H
#define PW_RUN_COMMAND_H

#include <pthread.h>
#include <stdatomic.h>
#include "motion.h"
#include "outcome.h"
#include "pinwheel-analysis.h"
#include "plot.h"

typedef struct {
  /* as given, or NULL; without --checkpoint, `path` is that of --resume */
  const char *path, *interval_text, *resume_path;
  /* as understood */
  double interval;       /* simulated time between two checkpoints [s]; 0: there are none */
  double next_time;      /* of the next checkpoint [s]; INFINITY: never */
  const char *last_path; /* of the last one, resumed or saved; NULL: none */
  double last_time;      /* its time [s] */
  pw_text fingerprint;   /* of this run: the head of its checkpoints */
  pw_archive state;      /* of the next checkpoint */
  pw_checkpoint resumed; /* the checkpoint from which the run continues */
  pw_output *lock;       /* FILE.part, empty, which locks out other processes during the whole run */
} pw_checkpoints;

/* `--error` (run_error.c): the repetition of the run, in a thread of its own. */
typedef struct {
  double t[MOTION_SAMPLES]; /* at which the runs are compared [s] */
  int taken;                /* rows of the run stored so far */
  int width;                /* numbers of a row */
  double *rows, *end;       /* those of the run; the errors at the end, and the largest ones, after them */
  pw_repetition *repetition;
  pw_settings settings;
  pw_limit limit;       /* of the repetition */
  atomic_int cancelled; /* 1: the run has ended early */
  pthread_t thread;
  int started; /* 1: the thread has not been joined */
  int status;  /* of the repetition */
  pw_error failure;
  int known; /* 1: `result` is */
  char unknown[40 + sizeof (pw_error)];
  pw_stated_error result;
} pw_error_run;

enum { PW_RUN_TABLE, PW_RUN_PAGE, PW_RUN_SUMMARY, PW_RUN_OUTPUTS };

typedef struct pw_run_cli {
  /* as given */
  pw_cli_line line;
  const char *row_interval_text; /* --every */
  const char *table_path, *summary_path, *plots_path, *page_path, *reference_path, *colour;
  const char **of;               /* ended by NULL; or NULL */
  int with_energies, with_error; /* 1: --energy, --error */
  pw_checkpoints checkpoints;
  /* as understood */
  pw_cli_engine engine;
  const char *method;
  pw_settings settings;
  pw_limit limit;
  double row_interval; /* of the table [s]; 0: each accepted step is a row */
  /* open */
  pw_output *output[PW_RUN_OUTPUTS]; /* NULL: not written */
  pw_csv *table;
  pw_plots *plots;
  pw_comparison comparison;
  pw_error_run stated;
  pw_outcomes outcomes; /* --of and --until; its system is NULL without them */
  pw_run *run;
  const char **redundant; /* a description of each redundant constraint equation; NULL: there are none */
  pw_progress progress;
  /* in progress */
  int has_outputs;             /* 1: the run is complete, and the values of --of are known */
  long rows;                   /* written to the table */
  int limited;                 /* 1: --limit, --max-steps or a signal during a step has stopped the run */
  int loaded;                  /* 1: the state of the checkpoint has been loaded */
  long batch;                  /* calls of pw_run_advance_towards between updates of the progress, at most */
  double cpu;                  /* processor time of the method [s] */
  double stepping, counted[2]; /* time in steps since, and real and processor time when `cpu` was counted [s] */
  int write_failed;            /* 1: the table or the summary could not be written */
  char kept_path[PW_RUN_OUTPUTS][4200]; /* of incomplete files that are kept, PATH_MAX and an ending, or "" */
} pw_run_cli;

/* The time at which the results end: that of --until, or that reached. */
static inline double pw_run_end_time (const pw_run_cli *command) {
  return command->outcomes.ended ? command->outcomes.t : pw_run_time (command->run);
}

/* ---- The error (run_error.c); without --error these do nothing ---- */

/* Starts the repetition; the run is open. */
int pw_error_run_start (pw_run_cli *command, pw_error *error);
double pw_error_run_next (const pw_error_run *e); /* the time of the next sample; INFINITY: there is none */
/* Stores the next sample of the run, whose last step contains its time. */
int pw_error_run_add (pw_error_run *e, pw_run *run, pw_error *error);
/* Ends the repetition, and states the error if the run is complete.  PW_RESOURCE. */
int pw_error_run_finish (pw_error_run *e, int complete, pw_error *error);
void pw_error_run_close (pw_error_run *e);
/* Prints the stated errors: of the bodies at the end, the largest of the other columns; or why they are unknown. */
void pw_report_stated (const pw_run_cli *command, FILE *f);

/* ---- The summary and the report (report.c) ---- */

enum { PW_RUN_REASON = 80 };
/* The summary of a run that ended with this error, if any; last: the last sample, or NULL; `reason` receives the text
 * of an interruption. */
pw_summary pw_run_summary (pw_run_cli *command, const pw_sample *last, const pw_error *error,
                           char reason[PW_RUN_REASON]);
/* Prints the outputs of --of of a complete run, if any. */
void pw_report_outputs (const pw_run_cli *command, FILE *f);
/* Prints the last state, reactions, energies if they are asked for, errors, residuals and cost. */
void pw_report_end (const pw_run_cli *command, const pw_summary *summary, const pw_sample *last);

#endif
