/* A run as the command `pinwheel run` makes it, and its checkpoints. */
#ifndef PW_RUN_COMMAND_H
#define PW_RUN_COMMAND_H

#include "cli.h"
#include "motion.h"
#include "plot.h"
#include "progress.h"
#include "text.h"

typedef struct {
  /* as given; NULL: not */
  const char *path, *every_text, *resume;
  /* as understood */
  double every;       /* simulated time between two [s] */
  double due;         /* time of the next checkpoint [s]; INFINITY: never */
  double saved;       /* time of the last one [s]; 0: none */
  pw_text head;       /* of the files */
  pw_archive state;   /* state in the next checkpoint */
  pw_checkpoint from; /* the checkpoint resumed */
  pw_output *lock;    /* FILE.part, empty, which locks out other processes during the whole run */
} pw_checkpoints;

enum { PW_RUN_TABLE, PW_RUN_PAGE, PW_RUN_SUMMARY, PW_RUN_OUTPUTS };

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *every_text;
  const char *csv_path, *json_path, *plots_path, *animate_path, *reference_path, *colour;
  int energy, profile;
  pw_checkpoints check;
  /* as understood */
  pw_cli_model m;
  pw_cli_engine engine;
  const char *method;
  pw_settings settings;
  pw_limit limit;
  double t_end, every; /* [s]; every 0: each accepted step is a row */
  /* open */
  pw_output *output[PW_RUN_OUTPUTS]; /* NULL: not written */
  pw_csv *csv;
  pw_plots *plots;
  pw_comparison comparison;
  pw_run *r;
  const char **redundant; /* a description of each redundant constraint equation; NULL: there are none */
  pw_progress progress;
  /* in progress */
  long row;                        /* rows written */
  int limited;                     /* 1: --limit, --max-steps or a signal has stopped it */
  int resumed;                     /* 1: the state of the checkpoint has been loaded */
  long batch;                      /* steps between checks of signals and progress */
  double cpu;                      /* of the method [s] */
  char part[PW_RUN_OUTPUTS][4200]; /* paths of the incomplete files that are kept, PATH_MAX and an ending, or "" */
  int lost;                        /* 1: the table or the summary could not be written */
} pw_run_command;

/* Reads the options and the checkpoint that is resumed, whose engine is used unless --specialise names one. */
int pw_checkpoints_open (pw_run_command *x, pw_specialise *when, pw_error *error);
/* Before anything is written: verifies that the checkpoint belongs to this run, and opens its table. */
int pw_checkpoints_prepare (pw_run_command *x, pw_error *error);
/* After everything is open: loads the state of the checkpoint that is resumed, if any. */
int pw_checkpoints_resume (pw_run_command *x, pw_error *error);
/* Saves a checkpoint that is due; near a singular configuration it is postponed. */
int pw_checkpoints_save (pw_run_command *x, pw_error *error);
void pw_checkpoints_close (pw_checkpoints *c);

#endif
