/* Motions: their samples, and the errors of one motion relative to another. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *motion, const pw_system *system, int samples, double t_end, pw_error *error) {
  int width = 2 * pw_system_coordinates (system) + pw_system_rows (system);
  *motion = (pw_motion){ .samples = samples, .width = width };
  motion->t = calloc ((size_t)samples, sizeof *motion->t);
  motion->value = calloc ((size_t)samples * (size_t)width, sizeof *motion->value);
  if (motion->t == NULL || motion->value == NULL) {
    pw_motion_close (motion);
    return pw_fail (error, PW_RESOURCE, "out of memory");
  }
  for (int k = 0; k < samples; k++) motion->t[k] = k + 1 < samples ? t_end * (k + 1) / samples : t_end;
  return PW_OK;
}

int pw_motion_open_at (pw_motion *motion, const pw_system *system, const pw_motion *times, pw_error *error) {
  int status = pw_motion_open (motion, system, times->samples, 0, error);
  if (status == PW_OK) memcpy (motion->t, times->t, (size_t)motion->samples * sizeof *motion->t);
  return status;
}

void pw_motion_close (pw_motion *motion) {
  free (motion->t);
  free (motion->value);
  *motion = (pw_motion){ .samples = 0 };
}

double pw_motion_next_time (const pw_motion *motion) {
  return motion->taken < motion->samples ? motion->t[motion->taken] : INFINITY;
}

void pw_motion_add (pw_motion *motion, const pw_system *system, const pw_sample *sample) {
  size_t n = (size_t)pw_system_coordinates (system), rows = (size_t)pw_system_rows (system);
  double *values = pw_motion_at (motion, motion->taken++);
  memcpy (values, sample->q, n * sizeof *values);
  memcpy (values + n, sample->v, n * sizeof *values);
  if (rows) memcpy (values + 2 * n, sample->lambda, rows * sizeof *values);
}

/* The model's own reference solution; multipliers are not known. */
static int motion_of_model (pw_motion *motion, const pw_cli_model *compiled, double t_end, pw_error *error) {
  const pw_system *system = compiled->system;
  int n = pw_system_coordinates (system), status = pw_motion_open (motion, system, MOTION_SAMPLES, t_end, error);
  for (int k = 0; k < motion->samples && status == PW_OK; k++) {
    double *state = pw_motion_at (motion, k);
    for (int j = 2 * n; j < motion->width; j++) state[j] = NAN;
    status = pw_system_reference (compiled->model, system, motion->t[k], state, state + n, error);
  }
  return status;
}

int pw_motion_open_reference (pw_motion *motion, const pw_cli_model *compiled, const char *path, double *t_end,
                              pw_motion_rows required, pw_error *error) {
  return path ? pw_motion_read (motion, compiled->system, path, t_end, required, error)
              : motion_of_model (motion, compiled, *t_end, error);
}

int pw_motion_unit (const pw_system *system, int state) {
  int rate = state >= pw_system_coordinates (system);
  int angle = strncmp (pw_system_state_unit (system, state), "rad", 3) == 0;
  return (rate ? MOTION_SPEED : MOTION_LENGTH) + angle;
}

/* Raises a maximum.  Once it is NaN it remains so: the error is unknown at one time, and so its maximum is too. */
static void motion_raise_largest (double *largest, double value) {
  if (value > *largest || isnan (value)) *largest = value;
}

/* Errors of coordinates and velocities: NaN for a unit of which the reference has no value. */
static void motion_states (const pw_system *system, const pw_motion *reference, const pw_motion *motion,
                           double *error) {
  int last = motion->samples - 1, known[MOTION_UNITS] = { 0 }, at_end[MOTION_UNITS] = { 0 };
  for (int j = 0; j < 2 * pw_system_coordinates (system); j++) {
    int unit = pw_motion_unit (system, j);
    for (int k = 0; k < motion->samples; k++) {
      double exact = pw_motion_at (reference, k)[j];
      if (isnan (exact)) continue; /* not compared */
      double difference = fabs (pw_motion_at (motion, k)[j] - exact);
      motion_raise_largest (&error[MOTION_LARGEST + unit], difference), known[unit] = 1;
      if (k == last) motion_raise_largest (&error[MOTION_END + unit], difference), at_end[unit] = 1;
    }
  }
  for (int i = 0; i < MOTION_UNITS; i++) {
    if (!known[i]) error[MOTION_LARGEST + i] = NAN;
    if (!at_end[i]) error[MOTION_END + i] = NAN;
  }
}

/* The largest |multiplier| of the constraint equations whose reaction has the same unit as that of this row, since forces
 * and moments cannot be compared with each other; 1 N or N m if all are zero or unknown. */
static double motion_largest_multiplier (const pw_system *system, const pw_motion *reference, int row) {
  double largest = 0;
  for (int j = 0; j < pw_system_rows (system); j++)
    if (strcmp (pw_system_reaction_unit (system, row), pw_system_reaction_unit (system, j)) == 0)
      for (int k = 0; k < reference->samples; k++)
        largest = fmax (largest, fabs (pw_motion_at (reference, k)[2 * pw_system_coordinates (system) + j]));
  return largest > 0 ? largest : 1;
}

static void motion_multipliers (const pw_system *system, const pw_motion *reference, const pw_motion *motion,
                                double *error) {
  const char *unit = NULL; /* neighbours mostly have the same unit */
  double largest = 1;
  int jumps[MOTION_SAMPLES], compared = 0;
  /* At a jump multipliers have two values, and methods differ in which one they report. */
  for (int k = 0; k < motion->samples; k++) jumps[k] = pw_system_jumps (system, reference->t[k]);
  for (int row = 0; row < pw_system_rows (system); row++) {
    if (unit == NULL || strcmp (unit, pw_system_reaction_unit (system, row)) != 0) {
      unit = pw_system_reaction_unit (system, row);
      largest = motion_largest_multiplier (system, reference, row);
    }
    int j = 2 * pw_system_coordinates (system) + row;
    for (int k = 0; k < motion->samples; k++) {
      double exact = pw_motion_at (reference, k)[j];
      if (isnan (exact) || jumps[k]) continue;
      motion_raise_largest (&error[MOTION_MULTIPLIERS], fabs (pw_motion_at (motion, k)[j] - exact) / largest);
      compared = 1;
    }
  }
  if (!compared) error[MOTION_MULTIPLIERS] = NAN;
}

void pw_motion_distance (const pw_system *system, const pw_motion *reference, const pw_motion *motion,
                         double error[MOTION_ERRORS]) {
  for (int i = 0; i < MOTION_ERRORS; i++) error[i] = 0;
  motion_states (system, reference, motion, error);
  motion_multipliers (system, reference, motion, error);
}
