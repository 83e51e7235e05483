/* The command `pinwheel run`: its options, what it has open, and its checkpoints (run_command.c). */
#ifndef PW_RUN_COMMAND_H
#define PW_RUN_COMMAND_H

#include "motion.h"
#include "plot.h"
#include "cli.h"

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

enum { PW_RUN_TABLE, PW_RUN_PAGE, PW_RUN_SUMMARY, PW_RUN_OUTPUTS };

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *row_interval_text; /* --every */
  const char *table_path, *summary_path, *plots_path, *page_path, *reference_path, *colour;
  int with_energies, profile; /* 1: --energy, --profile */
  pw_checkpoints checkpoints;
  /* as understood */
  pw_cli_model compiled;
  pw_cli_engine engine;
  const char *method;
  pw_settings settings;
  pw_limit limit;
  double t_end;        /* [s] */
  double row_interval; /* of the table [s]; 0: each accepted step is a row */
  /* open */
  pw_output *output[PW_RUN_OUTPUTS]; /* NULL: not written */
  pw_csv *table;
  pw_plots *plots;
  pw_comparison comparison;
  pw_run *run;
  const char **redundant; /* a description of each redundant constraint equation; NULL: there are none */
  pw_progress progress;
  /* in progress */
  long rows;                            /* written to the table */
  int limited;                          /* 1: --limit, --max-steps or a signal during a step has stopped the run */
  int loaded;                           /* 1: the state of the checkpoint has been loaded */
  long batch;                           /* calls of pw_run_advance_towards between updates of the progress, at most */
  double cpu;                           /* processor time of the method [s] */
  int write_failed;                     /* 1: the table or the summary could not be written */
  char unresolved[PW_NAME_BYTES];       /* a signal that steps did not resolve */
  char kept_path[PW_RUN_OUTPUTS][4200]; /* of incomplete files that are kept, PATH_MAX and an ending, or "" */
} pw_run_cli;

/* Reads the options and the checkpoint that is resumed, whose engine is used if *specialise is
 * PW_SPECIALISE_AUTO. */
int pw_checkpoints_open (pw_run_cli *command, pw_specialise *specialise, pw_error *error);
/* Before anything is written: locks the checkpoint file, verifies that a resumed checkpoint belongs to this run and
 * opens its table; without --resume, refuses a table that could not be continued. */
int pw_checkpoints_prepare (pw_run_cli *command, pw_error *error);
/* After everything is open: loads the state of the checkpoint that is resumed, if any; schedules the next one. */
int pw_checkpoints_resume (pw_run_cli *command, pw_error *error);
/* Saves a checkpoint that is due; near a singular configuration it is postponed. */
int pw_checkpoints_save (pw_run_cli *command, pw_error *error);
void pw_checkpoints_close (pw_checkpoints *checkpoints);

/* ---- The summary and the report (report.c) ---- */

enum { PW_RUN_REASON = 80 };
/* The summary of a run that ended with this error, if any; last: the last sample, or NULL; `reason` receives the text
 * of an interruption. */
pw_summary pw_run_summary (pw_run_cli *command, const pw_sample *last, const pw_error *error,
                           char reason[PW_RUN_REASON]);
/* Prints the last state, reactions, energies if they are asked for, errors, residuals and cost. */
void pw_report_end (const pw_run_cli *command, const pw_summary *summary, const pw_sample *last);

#endif
