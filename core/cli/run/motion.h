/* Motions: states and Lagrange multipliers at some times (samples); the errors of one motion relative to another. */
#ifndef PW_MOTION_H
#define PW_MOTION_H

#include "cli.h"

enum {
  MOTION_SAMPLES = 100, /* of a motion, at most */
  MOTION_GAPS = 600     /* bytes of the text of pw_motion_gaps */
};

/* Units of states: m, rad, m/s, rad/s. */
enum { MOTION_LENGTH, MOTION_ANGLE, MOTION_SPEED, MOTION_RATE, MOTION_UNITS };

/* Indices of the errors of a motion, NaN if not known.  MOTION_END + unit: the largest error of any state of that unit
 * at the last sample; MOTION_LARGEST + unit: over all samples.  MOTION_MULTIPLIERS: the largest error of any
 * multiplier, over all samples but those at whose times a signal makes multipliers jump, relative to the largest
 * multiplier of the same unit in the same samples of the reference, jumps included. */
enum { MOTION_END, MOTION_LARGEST = MOTION_UNITS, MOTION_MULTIPLIERS = 2 * MOTION_UNITS, MOTION_ERRORS };

typedef struct {
  int times;     /* of samples */
  int width;     /* numbers of a sample: coordinates, velocities, multipliers */
  int taken;     /* samples stored so far, at the first of the times */
  double *t;     /* [s], times; owns the memory of `value` */
  double *value; /* times x width; NaN: not known */
} pw_motion;

/* The numbers of sample k. */
static inline double *pw_motion_at (const pw_motion *motion, int k) {
  return motion->value + (size_t)k * (size_t)motion->width;
}

/* Equally spaced times, t_end / times, ..., t_end. */
static inline void pw_equal_times (double t_end, int times, double *t) {
  for (int k = 0; k < times; k++) t[k] = k + 1 < times ? t_end * (k + 1) / times : t_end;
}

/* Opens a motion without samples, with the times of another motion or, if `at` is NULL, 1 to MOTION_SAMPLES times,
 * t_end / times, ..., t_end.  Errors: PW_RESOURCE. */
int pw_motion_open (pw_motion *motion, const pw_system *system, const pw_motion *at, int times, double t_end,
                    pw_error *error);
void pw_motion_close (pw_motion *motion);
/* The time of the next sample; INFINITY if there is none. */
double pw_motion_next_time (const pw_motion *motion);
/* Stores the next sample. */
void pw_motion_add (pw_motion *motion, const pw_system *system, const pw_sample *sample);
/* The errors of the samples taken of a motion, relative to those of a reference at the same times. */
void pw_motion_errors (const pw_system *system, const pw_motion *reference, const pw_motion *motion,
                       double error[MOTION_ERRORS]);
/* The number of samples in which number j of a motion is known. */
int pw_motion_known (const pw_motion *motion, int j);
/* Which coordinates a reference contains, if not all, in at least `least` samples: "only car.phi of 9 coordinates",
 * "none of 9 coordinates"; "": all. */
void pw_motion_gaps (const pw_system *system, const pw_motion *reference, int least, char text[MOTION_GAPS]);
/* The unit of a state: MOTION_LENGTH to MOTION_RATE. */
int pw_motion_unit (const pw_system *system, int state);

/* Opens a reference with all of its samples in *motion, zero-initialised, to be closed in every case.  If `path` is
 * NULL, it is the model's own reference solution up to *t_end; else the table at `path`, with columns as `pinwheel run
 * -o` writes them: at most MOTION_SAMPLES of its rows after t = 0 and up to *t_end; if *t_end is 0, it becomes the time
 * of the last row.  Errors: PW_INPUT with the line, PW_RESOURCE. */
int pw_motion_open_reference (pw_motion *motion, const pw_cli_model *compiled, const char *path, double *t_end,
                              pw_error *error);

#endif
