/* A run compared with a reference. */
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
  return status == PW_OK ? pw_motion_open_at (&c->motion, m->system, &c->reference, error) : status;
}

void pw_comparison_close (pw_comparison *c) {
  pw_motion_close (&c->reference);
  pw_motion_close (&c->motion);
}

void pw_comparison_serialise (pw_comparison *c, pw_archive *a) {
  int next = c->motion.next;
  if (c->motion.samples == 0) return;
  pw_archive_bytes (a, &next, sizeof next);
  if (next < 0 || next > c->motion.samples) a->failed = 1;
  if (a->failed) return;
  c->motion.next = next;
  pw_archive_bytes (a, c->motion.x, (size_t)next * (size_t)c->motion.width * sizeof *c->motion.x);
}

const pw_reference_error *pw_comparison_errors (pw_comparison *c, const pw_system *s) {
  double error[MOTION_ERRORS];
  if (c->motion.next == 0) return NULL;
  c->motion.samples = c->reference.samples = c->motion.next; /* a run may have ended early */
  pw_motion_distance (s, &c->reference, &c->motion, error);
  c->error.samples = c->motion.next;
  c->error.t = c->motion.t[c->motion.next - 1];
  for (int i = 0; i < MOTION_UNITS; i++) {
    c->error.end[i] = error[MOTION_END + i];
    c->error.most[i] = error[MOTION_MOST + i];
  }
  c->error.reactions = error[MOTION_LAMBDA];
  return &c->error;
}
