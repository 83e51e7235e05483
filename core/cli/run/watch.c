/* A run against the truth. */
#include <math.h>
#include "watch.h"

int pw_watch_open (pw_watch *w, const pw_cli_model *m, const char *path, int started, double t_end, pw_error *error) {
  int status = PW_OK;
  *w = (pw_watch){ .error = { .source = path ? path : "the model" } };
  if (path == NULL && !pw_has_truth (m->model)) return PW_OK;
  if (path == NULL && started) {
    fputs ("pinwheel: the model's truth holds for the start it describes: with --start no errors are taken\n", stderr);
    return PW_OK;
  }
  if (path)
    status = pw_motion_read (&w->truth, m->system, path, &t_end, 0, error);
  else
    status = pw_motion_truth (&w->truth, m->model, m->system, t_end, error);
  if (status == PW_OK) status = pw_motion_open (&w->motion, m->system, w->truth.samples, error);
  w->on = status == PW_OK;
  return status;
}

void pw_watch_close (pw_watch *w) {
  pw_motion_close (&w->truth);
  pw_motion_close (&w->motion);
}

double pw_watch_next (const pw_watch *w) {
  return w->on && w->next < w->truth.samples ? w->truth.t[w->next] : INFINITY;
}

void pw_watch_take (pw_watch *w, const pw_system *s, const pw_sample *sample) {
  pw_motion_take (&w->motion, s, w->next++, sample);
}

void pw_watch_carry (pw_watch *w, pw_archive *a) {
  int next = w->next;
  if (!w->on) return;
  pw_carry (a, &next, sizeof next);
  if (next < 0 || next > w->motion.samples) a->failed = 1;
  if (a->failed) return;
  w->next = next;
  pw_carry (a, w->motion.x, (size_t)next * (size_t)w->motion.width * sizeof *w->motion.x);
}

/* Errors of a unit of which the truth knows nothing are not known. */
static void watch_unknown (pw_watch *w, const pw_system *s) {
  int n = pw_count_coordinates (s), known[MOTION_UNITS] = { 0 }, reactions = 0;
  for (int j = 0; j < 2 * n; j++) known[pw_motion_unit (s, j)] |= pw_motion_knows (&w->truth, j);
  for (int j = 2 * n; j < w->truth.width; j++) reactions |= pw_motion_knows (&w->truth, j);
  for (int i = 0; i < MOTION_UNITS; i++)
    if (!known[i]) w->error.end[i] = w->error.most[i] = NAN;
  if (!reactions) w->error.reactions = NAN;
}

const pw_truth_error *pw_watch_errors (pw_watch *w, const pw_system *s) {
  double error[MOTION_ERRORS];
  if (!w->on || w->next == 0) return NULL;
  w->motion.samples = w->truth.samples = w->next; /* a run may have ended early */
  pw_motion_distance (s, &w->truth, &w->motion, error);
  w->error.samples = w->next;
  w->error.t = w->truth.t[w->next - 1];
  for (int i = 0; i < MOTION_UNITS; i++) {
    w->error.end[i] = error[MOTION_END + i];
    w->error.most[i] = error[MOTION_MOST + i];
  }
  w->error.reactions = error[MOTION_LAMBDA];
  watch_unknown (w, s);
  return &w->error;
}
