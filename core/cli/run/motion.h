/* Motions: states and multipliers at some times; the errors of one motion relative to another. */
#ifndef PW_MOTION_H
#define PW_MOTION_H

#include "cli.h"

enum { MOTION_SAMPLES = 100 /* of a motion, at most */ };

/* Errors: the largest of the coordinates and velocities of a unit, at the end, then over all samples; of the multipliers
 * relative to the largest one of the same unit, except at times at which a signal makes them jump.  NaN: not known. */
enum { MOTION_END, MOTION_MOST = 4, MOTION_LAMBDA = 8, MOTION_ERRORS };
enum { MOTION_LENGTH, MOTION_ANGLE, MOTION_SPEED, MOTION_RATE, MOTION_UNITS };

typedef struct {
  int samples, width; /* width: coordinates, velocities, multipliers */
  int next;           /* index of the sample that is taken next */
  double *t;          /* samples [s] */
  double *x;          /* samples x width; NaN: not known */
} pw_motion;

/* Opens a motion of 1 to MOTION_SAMPLES samples at the times t_end / samples, ..., t_end.  Errors: PW_RESOURCE. */
int pw_motion_open (pw_motion *m, const pw_system *s, int samples, double t_end, pw_error *error);
/* The same at the times of another motion. */
int pw_motion_open_at (pw_motion *m, const pw_system *s, const pw_motion *times, pw_error *error);
void pw_motion_close (pw_motion *m);
/* The time of the next sample; INFINITY if there is none. */
double pw_motion_next (const pw_motion *m);
/* Stores the next sample. */
void pw_motion_take (pw_motion *m, const pw_system *s, const pw_sample *sample);
/* The errors of a motion relative to a reference at the same times. */
void pw_motion_distance (const pw_system *s, const pw_motion *reference, const pw_motion *m,
                         double error[MOTION_ERRORS]);
/* The unit of a state: MOTION_LENGTH, ... */
int pw_motion_unit (const pw_system *s, int state);

/* Opens a motion with the model's own reference solution up to t_end; close it in every case. */
int pw_motion_reference (pw_motion *m, const pw_model *model, const pw_system *s, double t_end, pw_error *error);

/* Opens a motion from a table with columns as `pinwheel run -o` writes them: of its rows after 0 and up to t_end, at most
 * MOTION_SAMPLES.  *t_end = 0: set to the time of the last row.  `whole`: a row at the end is required.  PW_INPUT with the
 * line, PW_RESOURCE. */
int pw_motion_read (pw_motion *m, const pw_system *s, const char *path, double *t_end, int whole, pw_error *error);

/* ---- A run compared with a reference ---- */

typedef struct {
  pw_motion reference, motion; /* of 0 samples: there is no reference */
  pw_reference_error error;
} pw_comparison;

/* Opens the reference of a run up to t_end: the table at `path`, otherwise the model's reference solution unless the run
 * has other initial values (`started`).  The run takes the samples of `motion`.  Close it in every case.  Errors: PW_INPUT,
 * PW_RESOURCE. */
int pw_comparison_open (pw_comparison *c, const pw_cli_model *m, const char *path, int started, double t_end,
                        pw_error *error);
void pw_comparison_close (pw_comparison *c);
/* Saves or loads the samples of a checkpoint. */
void pw_comparison_serialise (pw_comparison *c, pw_archive *a);
/* The errors of the samples taken; NULL if there are none. */
const pw_reference_error *pw_comparison_errors (pw_comparison *c, const pw_system *s);

#endif
