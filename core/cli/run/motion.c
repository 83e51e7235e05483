/* Motions and their errors; a run compared with a reference. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *m, const pw_system *s, int samples, pw_error *error) {
  int width = 2 * pw_system_coordinates (s) + pw_system_rows (s);
  *m = (pw_motion){ .samples = samples, .width = width };
  m->t = calloc ((size_t)samples, sizeof *m->t);
  m->x = calloc ((size_t)samples * (size_t)width, sizeof *m->x);
  if (m->t && m->x) return PW_OK;
  pw_motion_close (m);
  return pw_fail (error, PW_RESOURCE, "out of memory");
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
  size_t n = (size_t)pw_system_coordinates (s), rows = (size_t)pw_system_rows (s);
  double *to = m->x + (size_t)i * (size_t)m->width;
  memcpy (to, sample->q, n * sizeof *to);
  memcpy (to + n, sample->v, n * sizeof *to);
  if (rows) memcpy (to + 2 * n, sample->lambda, rows * sizeof *to);
}

int pw_motion_reference (pw_motion *m, const pw_model *model, const pw_system *s, double t_end, pw_error *error) {
  int n = pw_system_coordinates (s), status = pw_motion_open (m, s, MOTION_SAMPLES, error);
  if (status != PW_OK) return status;
  pw_motion_times (m, t_end);
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

/* The maximum that propagates NaN: a quantity unknown at one time has no maximum.  Columns missing in the reference are
 * skipped. */
static void motion_raise (double *most, double value) {
  if (!(value <= *most)) *most = isnan (*most) ? *most : value;
}

static void motion_states (const pw_system *s, const pw_motion *reference, const pw_motion *m, double *error) {
  for (int j = 0; j < 2 * pw_system_coordinates (s); j++) {
    int unit = pw_motion_unit (s, j);
    for (int k = 0; k < m->samples; k++) {
      double exact = reference->x[k * reference->width + j];
      if (isnan (exact)) continue;
      double d = fabs (m->x[k * m->width + j] - exact);
      motion_raise (&error[MOTION_MOST + unit], d);
      if (k == m->samples - 1) motion_raise (&error[MOTION_END + unit], d);
    }
  }
}

/* The largest multiplier of the same unit as row i: forces and moments are not compared with each other. */
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
  int jumps[MOTION_SAMPLES],
      smooth = 0; /* at a jump they have two values, and methods differ in which one they report */
  for (int k = 0; k < m->samples; k++) smooth += !(jumps[k] = pw_system_jumps (s, reference->t[k]));
  if (smooth == 0) error[MOTION_LAMBDA] = NAN;
  for (int i = 0; i < pw_system_rows (s); i++) {
    if (unit == NULL || strcmp (unit, pw_system_reaction_unit (s, i)) != 0) {
      unit = pw_system_reaction_unit (s, i);
      load = motion_load (s, reference, i);
    }
    int j = 2 * pw_system_coordinates (s) + i;
    for (int k = 0; k < m->samples; k++) {
      double exact = reference->x[k * reference->width + j];
      if (!isnan (exact) && !jumps[k])
        motion_raise (&error[MOTION_LAMBDA], fabs (m->x[k * m->width + j] - exact) / load);
    }
  }
}

void pw_motion_distance (const pw_system *s, const pw_motion *reference, const pw_motion *m,
                         double error[MOTION_ERRORS]) {
  for (int i = 0; i < MOTION_ERRORS; i++) error[i] = 0;
  motion_states (s, reference, m, error);
  motion_multipliers (s, reference, m, error);
}

/* ---- A run compared with a reference ---- */

int pw_comparison_open (pw_comparison *c, const pw_cli_model *m, const char *path, int started, double t_end,
                        pw_error *error) {
  int status = PW_OK;
  *c = (pw_comparison){ .error = { .source = path ? path : "the model" } };
  if (path == NULL && !pw_system_has_reference (m->model)) return PW_OK;
  if (path == NULL && started) {
    fputs ("pinwheel: the model's reference solution holds for its own initial values: with --start errors are not "
           "computed\n",
           stderr);
    return PW_OK;
  }
  if (path)
    status = pw_motion_read (&c->reference, m->system, path, &t_end, 0, error);
  else
    status = pw_motion_reference (&c->reference, m->model, m->system, t_end, error);
  if (status == PW_OK) status = pw_motion_open (&c->motion, m->system, c->reference.samples, error);
  c->on = status == PW_OK;
  return status;
}

void pw_comparison_close (pw_comparison *c) {
  pw_motion_close (&c->reference);
  pw_motion_close (&c->motion);
}

double pw_comparison_next (const pw_comparison *c) {
  return c->on && c->next < c->reference.samples ? c->reference.t[c->next] : INFINITY;
}

void pw_comparison_take (pw_comparison *c, const pw_system *s, const pw_sample *sample) {
  pw_motion_take (&c->motion, s, c->next++, sample);
}

void pw_comparison_serialise (pw_comparison *c, pw_archive *a) {
  int next = c->next;
  if (!c->on) return;
  pw_archive_bytes (a, &next, sizeof next);
  if (next < 0 || next > c->motion.samples) a->failed = 1;
  if (a->failed) return;
  c->next = next;
  pw_archive_bytes (a, c->motion.x, (size_t)next * (size_t)c->motion.width * sizeof *c->motion.x);
}

/* 1 if state or multiplier j is known at any time. */
static int motion_knows (const pw_motion *m, int j) {
  int known = 0;
  for (int k = 0; k < m->samples; k++) known |= !isnan (m->x[k * m->width + j]);
  return known;
}

/* Errors of a unit are unknown if the reference contains no state with that unit. */
static void comparison_unknown (pw_comparison *c, const pw_system *s) {
  int n = pw_system_coordinates (s), known[MOTION_UNITS] = { 0 }, reactions = 0;
  for (int j = 0; j < 2 * n; j++) known[pw_motion_unit (s, j)] |= motion_knows (&c->reference, j);
  for (int j = 2 * n; j < c->reference.width; j++) reactions |= motion_knows (&c->reference, j);
  for (int i = 0; i < MOTION_UNITS; i++)
    if (!known[i]) c->error.end[i] = c->error.most[i] = NAN;
  if (!reactions) c->error.reactions = NAN;
}

const pw_reference_error *pw_comparison_errors (pw_comparison *c, const pw_system *s) {
  double error[MOTION_ERRORS];
  if (!c->on || c->next == 0) return NULL;
  c->motion.samples = c->reference.samples = c->next; /* a run may have ended early */
  pw_motion_distance (s, &c->reference, &c->motion, error);
  c->error.samples = c->next;
  c->error.t = c->reference.t[c->next - 1];
  for (int i = 0; i < MOTION_UNITS; i++) {
    c->error.end[i] = error[MOTION_END + i];
    c->error.most[i] = error[MOTION_MOST + i];
  }
  c->error.reactions = error[MOTION_LAMBDA];
  comparison_unknown (c, s);
  return &c->error;
}
