/* A run of pinwheel run, and its checkpoints (running.c). */
#ifndef PW_RUNNING_H
#define PW_RUNNING_H

#include "checkpoints.h"
#include "plots.h"
#include "progress.h"
#include "stop.h"
#include "watch.h"

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *every_text;
  const char *csv_path, *json_path, *plots_path, *animate_path, *reference_path;
  int energy, profile;
  pw_checkpoints check;
  /* as understood */
  pw_cli_model m;
  const char *method;
  pw_settings settings;
  pw_limit limit;
  double t_end, every; /* [s]; every 0: each accepted step is a row */
  /* open */
  pw_output *csv_output, *json_output, *page_output;
  pw_csv *csv;
  pw_plots *plots;
  pw_watch watch;
  pw_run *r;
  const char **redundant; /* what is said about each redundant row; NULL: there are none */
  pw_progress progress;
  /* under way */
  long row;             /* rows written */
  int limited;          /* 1: --limit or --max-steps has ended it */
  int resumed;          /* 1: the state of the checkpoint has been taken over */
  long batch;           /* steps to take before looking around */
  double cpu;           /* of the method [s] */
  char part[4200];      /* where an unfinished table is kept; "": there is none */
  char json_part[4200]; /* likewise of the summary */
  int lost;             /* 1: the machine has failed to write the table or the summary */
} pw_running;

/* Before anything is written: reads the checkpoint that is resumed, makes sure it is of this run, and opens its table. */
int pw_running_prepare (pw_running *x, pw_error *error);
/* When all is open: brings the run to the checkpoint's state, if one is resumed. */
int pw_running_resume (pw_running *x, pw_error *error);
/* A checkpoint is due: saves one, unless the pose is near a singular one; then it stays due. */
int pw_running_save (pw_running *x, pw_error *error);
/* After a run that was stopped from outside or by a limit: says where it can go on from. */
void pw_running_hint (const pw_running *x, int stopped);

#endif
