/* Motions: the state and the multipliers at some times, and how far one motion is from another, the truth. */
#ifndef PW_MOTION_H
#define PW_MOTION_H

#include "pinwheel-files.h"
#include "run.h"

enum { MOTION_SAMPLES = 100 };

/* Errors: the largest of the coordinates and rates of a unit, at the end, then over all samples; of the multipliers
 * relative to the largest one of the same unit, but for samples at which a signal makes them jump. */
enum { MOTION_END, MOTION_MOST = 4, MOTION_LAMBDA = 8, MOTION_ERRORS };
enum { MOTION_LENGTH, MOTION_ANGLE, MOTION_SPEED, MOTION_RATE, MOTION_UNITS };

/* What happens at some times.  NaN: not known. */
typedef struct {
  int samples, width; /* width: coordinates, rates, multipliers */
  double *t;          /* samples [s] */
  double *x;          /* samples x width */
} pw_motion;

int pw_motion_open (pw_motion *m, const pw_system *s, int samples, pw_error *error);
void pw_motion_close (pw_motion *m);
/* Sample i becomes what was found at its time. */
void pw_motion_take (pw_motion *m, const pw_system *s, int i, const pw_sample *sample);
/* Samples evenly spaced, the last one at t_end. */
void pw_motion_times (pw_motion *m, double t_end);
/* The errors of a motion, each the largest distance from the truth. */
void pw_motion_distance (const pw_system *s, const pw_motion *truth, const pw_motion *m, double error[MOTION_ERRORS]);
/* Which kind of unit a state has. */
int pw_motion_unit (const pw_system *s, int state);
/* 1 if the motion knows state or multiplier j at some time. */
int pw_motion_knows (const pw_motion *m, int j);

/* Opens a motion with what the model itself knows up to t_end. */
int pw_motion_truth (pw_motion *m, const pw_model *model, const pw_system *s, double t_end, pw_error *error);

/* Opens a motion with a table of samples, columns as in a run's own; rows are thinned to MOTION_SAMPLES, those after t_end
 * left out.  *t_end 0: that of the last row.  `whole`: there must be a row at the end (motion_file.c).  PW_INPUT with line. */
int pw_motion_read (pw_motion *m, const pw_system *s, const char *path, double *t_end, int whole, pw_error *error);

#endif
