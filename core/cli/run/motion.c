/* Motions and their errors; a run compared with a reference. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *m, const pw_system *s, int samples, double t_end, pw_error *error) {
  int width = 2 * pw_system_coordinates (s) + pw_system_rows (s);
  *m = (pw_motion){ .samples = samples, .width = width };
  m->t = calloc ((size_t)samples, sizeof *m->t);
  m->x = calloc ((size_t)samples * (size_t)width, sizeof *m->x);
  if (m->t == NULL || m->x == NULL) {
    pw_motion_close (m);
    return pw_fail (error, PW_RESOURCE, "out of memory");
  }
  for (int k = 0; k < samples; k++) m->t[k] = k + 1 < samples ? t_end * (k + 1) / samples : t_end;
  return PW_OK;
}

int pw_motion_open_at (pw_motion *m, const pw_system *s, const pw_motion *times, pw_error *error) {
  int status = pw_motion_open (m, s, times->samples, 0, error);
  if (status == PW_OK) memcpy (m->t, times->t, (size_t)m->samples * sizeof *m->t);
  return status;
}

void pw_motion_close (pw_motion *m) {
  free (m->t);
  free (m->x);
  *m = (pw_motion){ .samples = 0 };
}

double pw_motion_next (const pw_motion *m) {
  return m->next < m->samples ? m->t[m->next] : INFINITY;
}

void pw_motion_take (pw_motion *m, const pw_system *s, const pw_sample *sample) {
  size_t n = (size_t)pw_system_coordinates (s), rows = (size_t)pw_system_rows (s);
  double *to = m->x + (size_t)m->next++ * (size_t)m->width;
  memcpy (to, sample->q, n * sizeof *to);
  memcpy (to + n, sample->v, n * sizeof *to);
  if (rows) memcpy (to + 2 * n, sample->lambda, rows * sizeof *to);
}

int pw_motion_reference (pw_motion *m, const pw_model *model, const pw_system *s, double t_end, pw_error *error) {
  int n = pw_system_coordinates (s), status = pw_motion_open (m, s, MOTION_SAMPLES, t_end, error);
  for (int k = 0; k < m->samples && status == PW_OK; k++) {
    double *x = m->x + k * m->width;
    for (int j = 2 * n; j < m->width; j++) x[j] = NAN;
    status = pw_system_reference (model, s, m->t[k], x, x + n, error);
  }
  return status;
}

int pw_motion_unit (const pw_system *s, int state) {
  int rate = state >= pw_system_coordinates (s);
  int angle = strncmp (pw_system_state_unit (s, state), "rad", 3) == 0;
  return (rate ? MOTION_SPEED : MOTION_LENGTH) + angle;
}

/* Raises a maximum; NaN stays, since an error that is unknown at one time has no maximum. */
static void motion_raise (double *most, double value) {
  if (value > *most || isnan (value)) *most = value;
}

static void motion_states (const pw_system *s, const pw_motion *reference, const pw_motion *m, double *error) {
  int last = m->samples - 1, known[MOTION_UNITS] = { 0 }, at_end[MOTION_UNITS] = { 0 };
  for (int j = 0; j < 2 * pw_system_coordinates (s); j++) {
    int unit = pw_motion_unit (s, j);
    for (int k = 0; k < m->samples; k++) {
      double exact = reference->x[k * reference->width + j];
      if (isnan (exact)) continue; /* not compared */
      double d = fabs (m->x[k * m->width + j] - exact);
      motion_raise (&error[MOTION_MOST + unit], d), known[unit] = 1;
      if (k == last) motion_raise (&error[MOTION_END + unit], d), at_end[unit] = 1;
    }
  }
  for (int i = 0; i < MOTION_UNITS; i++) {
    if (!known[i]) error[MOTION_MOST + i] = NAN;
    if (!at_end[i]) error[MOTION_END + i] = NAN;
  }
}

/* The largest multiplier of the same unit as row i, since forces and moments are not compared with each other; 1 N or
 * N m if all are zero or unknown. */
static double motion_load (const pw_system *s, const pw_motion *reference, int i) {
  double most = 0;
  for (int j = 0; j < pw_system_rows (s); j++)
    if (strcmp (pw_system_reaction_unit (s, i), pw_system_reaction_unit (s, j)) == 0)
      for (int k = 0; k < reference->samples; k++)
        most = fmax (most, fabs (reference->x[k * reference->width + 2 * pw_system_coordinates (s) + j]));
  return most > 0 ? most : 1;
}

static void motion_multipliers (const pw_system *s, const pw_motion *reference, const pw_motion *m, double *error) {
  const char *unit = NULL; /* neighbours mostly have the same unit */
  double load = 1;
  int jumps[MOTION_SAMPLES], compared = 0;
  /* At a jump multipliers have two values, and methods differ in which one they report. */
  for (int k = 0; k < m->samples; k++) jumps[k] = pw_system_jumps (s, reference->t[k]);
  for (int i = 0; i < pw_system_rows (s); i++) {
    if (unit == NULL || strcmp (unit, pw_system_reaction_unit (s, i)) != 0) {
      unit = pw_system_reaction_unit (s, i);
      load = motion_load (s, reference, i);
    }
    int j = 2 * pw_system_coordinates (s) + i;
    for (int k = 0; k < m->samples; k++) {
      double exact = reference->x[k * reference->width + j];
      if (isnan (exact) || jumps[k]) continue;
      motion_raise (&error[MOTION_LAMBDA], fabs (m->x[k * m->width + j] - exact) / load);
      compared = 1;
    }
  }
  if (!compared) error[MOTION_LAMBDA] = NAN;
}

void pw_motion_distance (const pw_system *s, const pw_motion *reference, const pw_motion *m,
                         double error[MOTION_ERRORS]) {
  for (int i = 0; i < MOTION_ERRORS; i++) error[i] = 0;
  motion_states (s, reference, m, error);
  motion_multipliers (s, reference, m, error);
}
