/* Motions, and how far one is from another. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "compare.h"

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

int pw_motion_unit (const pw_system *s, int state) {
  int rate = state >= pw_count_coordinates (s);
  int angle = strncmp (pw_state_unit (s, state), "rad", 3) == 0;
  return (rate ? COMPARE_SPEED : COMPARE_LENGTH) + angle;
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
      motion_raise (&error[COMPARE_MOST + unit], d);
      if (k == m->samples - 1) motion_raise (&error[COMPARE_END + unit], d);
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
  for (int i = 0; i < pw_count_rows (s); i++) {
    if (unit == NULL || strcmp (unit, pw_reaction_unit (s, i)) != 0) {
      unit = pw_reaction_unit (s, i);
      load = motion_load (s, truth, i);
    }
    int j = 2 * pw_count_coordinates (s) + i;
    for (int k = 0; k < m->samples; k++) {
      double sure = truth->x[k * truth->width + j];
      if (!isnan (sure)) motion_raise (&error[COMPARE_LAMBDA], fabs (m->x[k * m->width + j] - sure) / load);
    }
  }
}

void pw_motion_distance (const pw_system *s, const pw_motion *truth, const pw_motion *m, double error[COMPARE_ERRORS]) {
  for (int i = 0; i < COMPARE_ERRORS; i++) error[i] = 0;
  motion_states (s, truth, m, error);
  motion_multipliers (s, truth, m, error);
}
