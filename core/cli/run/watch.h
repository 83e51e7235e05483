/* A run against the truth: samples are taken at its times, and their distance from it. */
#ifndef PW_WATCH_H
#define PW_WATCH_H

#include "cli.h"
#include "motion.h"

typedef struct {
  int on; /* 0: there is no truth */
  pw_motion truth, motion;
  int next; /* sample to come */
  pw_truth_error error;
} pw_watch;

/* Looks for the truth of a run up to t_end: a table's, if there is a path, else the model's own, unless `started` says that
 * the run starts elsewhere.  Close it in every case.  Errors: PW_INPUT, PW_MACHINE. */
int pw_watch_open (pw_watch *w, const pw_cli_model *m, const char *path, int started, double t_end, pw_error *error);
void pw_watch_close (pw_watch *w);

/* When the next sample is due, or INFINITY. */
double pw_watch_next (const pw_watch *w);
void pw_watch_take (pw_watch *w, const pw_system *s, const pw_sample *sample);

/* The samples of a run that goes on elsewhere: saved or loaded. */
void pw_watch_carry (pw_watch *w, pw_archive *a);

/* The errors of the samples taken; NULL if there are none. */
const pw_truth_error *pw_watch_errors (pw_watch *w, const pw_system *s);

#endif
