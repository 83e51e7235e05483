/* Motions, and how far one is from another. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *m, const pw_system *s, int samples, pw_error *error) {
  int width = 2 * pw_count_coordinates (s) + pw_count_rows (s);
  *m = (pw_motion){ .samples = samples, .width = width };
  m->t = calloc ((size_t)samples, sizeof *m->t);
  m->x = calloc ((size_t)samples * (size_t)width, sizeof *m->x);
  if (m->t && m->x) return PW_OK;
  pw_motion_close (m);
  return pw_fail (error, PW_MACHINE, "out of memory");
}

void pw_motion_close (pw_motion *m) {
  free (m->t);
  free (m->x);
  *m = (pw_motion){ .samples = 0 };
}

void pw_motion_times (pw_motion *m, double t_end) {
  for (int k = 0; k < m->samples; k++) m->t[k] = k + 1 < m->samples ? t_end * (k + 1) / m->samples : t_end;
}

void pw_motion_take (pw_motion *m, const pw_system *s, int i, const pw_sample *sample) {
  size_t n = (size_t)pw_count_coordinates (s), rows = (size_t)pw_count_rows (s);
  double *to = m->x + (size_t)i * (size_t)m->width;
  memcpy (to, sample->q, n * sizeof *to);
  memcpy (to + n, sample->v, n * sizeof *to);
  if (rows) memcpy (to + 2 * n, sample->lambda, rows * sizeof *to);
}

int pw_motion_truth (pw_motion *m, const pw_model *model, const pw_system *s, double t_end, pw_error *error) {
  int n = pw_count_coordinates (s), status = pw_motion_open (m, s, MOTION_SAMPLES, error);
  if (status != PW_OK) return status;
  pw_motion_times (m, t_end);
  for (int k = 0; k < m->samples && status == PW_OK; k++) {
    double *x = m->x + k * m->width;
    for (int j = 2 * n; j < m->width; j++) x[j] = NAN;
    status = pw_true_state (model, s, m->t[k], x, x + n, error);
  }
  return status;
}

int pw_motion_knows (const pw_motion *m, int j) {
  int known = 0;
  for (int k = 0; k < m->samples; k++) known |= !isnan (m->x[k * m->width + j]);
  return known;
}

int pw_motion_unit (const pw_system *s, int state) {
  int rate = state >= pw_count_coordinates (s);
  int angle = strncmp (pw_state_unit (s, state), "rad", 3) == 0;
  return (rate ? MOTION_SPEED : MOTION_LENGTH) + angle;
}

/* NaN, once met, stays: what is not known at one time has no largest value.  A column the truth does not know is left
 * out instead. */
static void motion_raise (double *most, double value) {
  if (!(value <= *most)) *most = isnan (*most) ? *most : value;
}

static void motion_states (const pw_system *s, const pw_motion *truth, const pw_motion *m, double *error) {
  for (int j = 0; j < 2 * pw_count_coordinates (s); j++) {
    int unit = pw_motion_unit (s, j);
    for (int k = 0; k < m->samples; k++) {
      double sure = truth->x[k * truth->width + j];
      if (isnan (sure)) continue;
      double d = fabs (m->x[k * m->width + j] - sure);
      motion_raise (&error[MOTION_MOST + unit], d);
      if (k == m->samples - 1) motion_raise (&error[MOTION_END + unit], d);
    }
  }
}

/* The largest multiplier of the same unit as row i: forces and moments are not weighed against each other. */
static double motion_load (const pw_system *s, const pw_motion *truth, int i) {
  double most = 0;
  for (int j = 0; j < pw_count_rows (s); j++)
    if (strcmp (pw_reaction_unit (s, i), pw_reaction_unit (s, j)) == 0)
      for (int k = 0; k < truth->samples; k++)
        most = fmax (most, fabs (truth->x[k * truth->width + 2 * pw_count_coordinates (s) + j]));
  return most > 0 ? most : 1;
}

static void motion_multipliers (const pw_system *s, const pw_motion *truth, const pw_motion *m, double *error) {
  const char *unit = NULL; /* of neighbours it is mostly the same */
  double load = 1;
  int jumps[MOTION_SAMPLES],
      smooth = 0; /* they have two values where they jump, and methods differ in which they show */
  for (int k = 0; k < m->samples; k++) smooth += !(jumps[k] = pw_system_jumps (s, truth->t[k]));
  if (smooth == 0) error[MOTION_LAMBDA] = NAN;
  for (int i = 0; i < pw_count_rows (s); i++) {
    if (unit == NULL || strcmp (unit, pw_reaction_unit (s, i)) != 0) {
      unit = pw_reaction_unit (s, i);
      load = motion_load (s, truth, i);
    }
    int j = 2 * pw_count_coordinates (s) + i;
    for (int k = 0; k < m->samples; k++) {
      double sure = truth->x[k * truth->width + j];
      if (!isnan (sure) && !jumps[k]) motion_raise (&error[MOTION_LAMBDA], fabs (m->x[k * m->width + j] - sure) / load);
    }
  }
}

void pw_motion_distance (const pw_system *s, const pw_motion *truth, const pw_motion *m, double error[MOTION_ERRORS]) {
  for (int i = 0; i < MOTION_ERRORS; i++) error[i] = 0;
  motion_states (s, truth, m, error);
  motion_multipliers (s, truth, m, error);
}
