/* Motions: their samples, and the errors of one motion relative to another. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *motion, const pw_system *system, int times, double t_end, pw_error *error) {
  int width = 2 * pw_system_coordinates (system) + pw_system_rows (system);
  *motion = (pw_motion){ .t = calloc ((size_t)times * (size_t)(1 + width), sizeof *motion->t) };
  if (motion->t == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  motion->times = times, motion->width = width, motion->value = motion->t + times;
  for (int k = 0; k < times; k++) motion->t[k] = k + 1 < times ? t_end * (k + 1) / times : t_end;
  return PW_OK;
}

int pw_motion_open_at (pw_motion *motion, const pw_system *system, const pw_motion *other, pw_error *error) {
  int status = pw_motion_open (motion, system, other->times, 0, error);
  if (status == PW_OK) memcpy (motion->t, other->t, (size_t)motion->times * sizeof *motion->t);
  return status;
}

void pw_motion_close (pw_motion *motion) {
  free (motion->t);
  *motion = (pw_motion){ .times = 0 };
}

double pw_motion_next_time (const pw_motion *motion) {
  return motion->taken < motion->times ? motion->t[motion->taken] : INFINITY;
}

void pw_motion_add (pw_motion *motion, const pw_system *system, const pw_sample *sample) {
  size_t n = (size_t)pw_system_coordinates (system), rows = (size_t)pw_system_rows (system);
  double *values = pw_motion_at (motion, motion->taken++);
  memcpy (values, sample->q, n * sizeof *values);
  memcpy (values + n, sample->v, n * sizeof *values);
  if (rows) memcpy (values + 2 * n, sample->lambda, rows * sizeof *values);
}

int pw_motion_known (const pw_motion *motion, int j) {
  int known = 0;
  for (int k = 0; k < motion->taken; k++) known += !isnan (pw_motion_at (motion, k)[j]);
  return known;
}

void pw_motion_gaps (const pw_system *system, const pw_motion *reference, int least, char text[MOTION_GAPS]) {
  enum { LISTED = 3 }; /* coordinates, at most */
  char names[MOTION_GAPS - 80] = "", more[30] = "";
  int n = pw_system_coordinates (system), known = 0;
  for (int j = 0; j < n; j++) {
    size_t used = strlen (names);
    if (pw_motion_known (reference, j) >= least && ++known <= LISTED)
      snprintf (names + used, sizeof names - used, "%s%s", known > 1 ? ", " : "only ",
                PW_NAME (pw_system_state_name, system, j));
  }
  if (known > LISTED) snprintf (more, sizeof more, " and %d more", known - LISTED);
  snprintf (text, MOTION_GAPS, "%s%s of %d coordinates", known ? names : "none", more, n);
  if (known == n) *text = 0;
}

int pw_motion_unit (const pw_system *system, int state) {
  int is_velocity = state >= pw_system_coordinates (system);
  int angle = strncmp (pw_system_state_unit (system, state), "rad", 3) == 0;
  return (is_velocity ? MOTION_SPEED : MOTION_LENGTH) + angle;
}

/* The largest |multiplier|, in the first samples, of the constraint equations whose reaction has the same unit as that
 * of this row, since forces and moments cannot be compared with each other; 1 N or N m if all are zero or unknown. */
static double motion_largest_multiplier (const pw_system *system, const pw_motion *reference, int samples, int row) {
  double largest = 0;
  for (int j = 0; j < pw_system_rows (system); j++)
    if (strcmp (pw_system_reaction_unit (system, row), pw_system_reaction_unit (system, j)) == 0)
      for (int k = 0; k < samples; k++)
        largest = fmax (largest, fabs (pw_motion_at (reference, k)[2 * pw_system_coordinates (system) + j]));
  return largest > 0 ? largest : 1;
}

/* Increases *error, NaN at first, to a larger difference; one that is NaN, not known, makes it NaN for good. */
static void motion_include (double *error, int *compared, double difference) {
  if (!*compared || difference > *error || isnan (difference)) *error = difference;
  *compared = 1;
}

void pw_motion_errors (const pw_system *system, const pw_motion *reference, const pw_motion *motion,
                       double error[MOTION_ERRORS]) {
  int states = 2 * pw_system_coordinates (system), last = motion->taken - 1;
  int compared[MOTION_ERRORS] = { 0 }, jumps[MOTION_SAMPLES];
  const char *unit = NULL; /* of the multiplier before: neighbours mostly have the same */
  double scale = 1;
  for (int i = 0; i < MOTION_ERRORS; i++) error[i] = NAN;
  for (int k = 0; k <= last; k++) jumps[k] = pw_system_jumps (system, reference->t[k]);
  for (int j = 0; j < motion->width; j++) {
    int is_state = j < states, state_unit = is_state ? pw_motion_unit (system, j) : 0, end = MOTION_END + state_unit;
    int largest = is_state ? MOTION_LARGEST + state_unit : MOTION_MULTIPLIERS;
    if (!is_state && (unit == NULL || strcmp (unit, pw_system_reaction_unit (system, j - states)) != 0)) {
      unit = pw_system_reaction_unit (system, j - states);
      scale = motion_largest_multiplier (system, reference, motion->taken, j - states);
    }
    for (int k = 0; k <= last; k++) {
      double expected = pw_motion_at (reference, k)[j];
      double difference = fabs (pw_motion_at (motion, k)[j] - expected) / scale;
      /* at a jump multipliers have two values, and methods differ in which one they report */
      if (isnan (expected) || (!is_state && jumps[k])) continue;
      motion_include (&error[largest], &compared[largest], difference);
      if (is_state && k == last) motion_include (&error[end], &compared[end], difference);
    }
  }
}
