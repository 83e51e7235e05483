/* A run compared with a reference. */
#include <math.h>
#include <stdio.h>
#include "motion.h"

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
static int comparison_knows (const pw_motion *m, int j) {
  int known = 0;
  for (int k = 0; k < m->samples; k++) known |= !isnan (m->x[k * m->width + j]);
  return known;
}

/* Errors of a unit are unknown if the reference contains no state with that unit. */
static void comparison_unknown (pw_comparison *c, const pw_system *s) {
  int n = pw_system_coordinates (s), known[MOTION_UNITS] = { 0 }, reactions = 0;
  for (int j = 0; j < 2 * n; j++) known[pw_motion_unit (s, j)] |= comparison_knows (&c->reference, j);
  for (int j = 2 * n; j < c->reference.width; j++) reactions |= comparison_knows (&c->reference, j);
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
