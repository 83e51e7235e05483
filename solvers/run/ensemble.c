/* Ensembles: runs that a caller steps together, in lanes and threads, with inputs that it sets between steps. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"

/* The runs from `first` to before `last`, which one thread steps, or observes if dt is NaN. */
typedef struct {
  const pw_ensemble *e;
  double dt;
  int first, last;
} ensemble_part;

/* Sets the inputs of run i; *t_end: where its step ends.  1 if it can be stepped. */
static int ensemble_begin (const pw_ensemble *e, int i, double dt, double *t_end) {
  pw_error *error = &e->error[i];
  pw_run *r = e->run[i];
  int status = pw_require (r, "a run", error);
  if (status == PW_OK && !(dt >= 0 && dt < INFINITY))
    status = pw_fail (error, PW_INPUT, "dt = %g: expected a finite time >= 0", dt);
  for (int k = 0; k < e->inputs && status == PW_OK; k++)
    status = pw_run_set_input (r, e->signal[k], e->input[(size_t)i * (size_t)e->inputs + (size_t)k], error);
  if (status == PW_OK) status = pw_run_settle (r, error);
  e->status[i] = status;
  if (status != PW_OK) return 0;
  *t_end = r->t + dt;
  return 1;
}

/* Steps up to PW_LANES_MOST runs, from `first` to before `last`. */
static void ensemble_step_lanes (const pw_ensemble *e, int first, int last, double dt, void *memory) {
  pw_run *run[PW_LANES_MOST];
  double t_end[PW_LANES_MOST];
  int index[PW_LANES_MOST], status[PW_LANES_MOST], n = 0;
  pw_error error[PW_LANES_MOST];
  for (int i = first; i < last; i++)
    if (e->status[i] == PW_OK && ensemble_begin (e, i, dt, &t_end[n])) run[n] = e->run[i], index[n++] = i;
  while (n > 0) {
    int left = 0;
    for (int k = 0; k < n; k++) error[k].status = PW_OK, *error[k].text = 0;
    pw_runs_advance (run, n, t_end, memory ? e->lanes : NULL, memory, status, error);
    for (int k = 0; k < n; k++) {
      const int i = index[k];
      if (status[k] != PW_OK) e->status[i] = status[k], e->error[i] = error[k];
      if (status[k] == PW_OK && run[k]->t < t_end[k]) run[left] = run[k], t_end[left] = t_end[k], index[left++] = i;
    }
    n = left;
  }
}

static void ensemble_observe_run (const pw_ensemble *e, int i) {
  pw_run *r = e->run[i];
  double *out = e->observed + (size_t)i * (size_t)e->columns;
  int states = r != NULL; /* 1: time and states alone are observed, which need no sample */
  for (int k = 0; k < e->columns; k++) {
    const int j = e->column[k] - PW_RECORD_STATES;
    out[k] = NAN;
    states &= e->column[k] == 0 || (r && j >= 0 && j < 2 * r->s->coords);
  }
  if (e->status[i] != PW_OK) return;
  if (states) {
    for (int k = 0; k < e->columns; k++) {
      const int j = e->column[k] - PW_RECORD_STATES;
      out[k] = j < 0 ? r->t : j < r->s->coords ? r->q[j] : r->v[j - r->s->coords];
    }
    return;
  }
  double *row = r ? malloc ((size_t)pw_run_record_width (r) * sizeof *row) : NULL;
  if (r == NULL)
    e->status[i] = pw_require (r, "a run", &e->error[i]);
  else if (row == NULL)
    e->status[i] = pw_fail (&e->error[i], PW_RESOURCE, "out of memory");
  else
    e->status[i] = pw_record_row (r, r->t, row, &e->error[i]);
  for (int k = 0; k < e->columns && e->status[i] == PW_OK; k++) out[k] = row[e->column[k]];
  free (row);
}

static void *ensemble_thread (void *argument) {
  const ensemble_part *x = argument;
  const pw_ensemble *e = x->e;
  if (isnan (x->dt)) {
    for (int i = x->first; i < x->last; i++) ensemble_observe_run (e, i);
    return NULL;
  }
  void *memory = e->lanes ? pw_specialised_lanes_memory (e->lanes) : NULL; /* NULL: one run after the other */
  const int width = memory ? pw_specialised_lanes_count (e->lanes) : 1;
  for (int i = x->first; i < x->last; i += width)
    ensemble_step_lanes (e, i, i + width < x->last ? i + width : x->last, x->dt, memory);
  free (memory);
  return NULL;
}

/* Divides the runs among the threads, in multiples of the lanes; the calling thread takes the last part, and those for
 * which no thread can be started. */
static void ensemble_divide (const pw_ensemble *e, double dt) {
  enum { THREADS = 256 };
  pthread_t thread[THREADS];
  ensemble_part part[THREADS];
  const int lanes = e->lanes ? pw_specialised_lanes_count (e->lanes) : 1, groups = (e->count + lanes - 1) / lanes;
  const int wanted = e->threads < groups ? e->threads : groups;
  const int parts = wanted < 1 ? 1 : wanted < THREADS ? wanted : THREADS;
  int started = 0;
  for (int k = 0, first = 0; k < parts; k++, first = part[k - 1].last) {
    const int last = (int)((long)groups * (k + 1) / parts) * lanes;
    part[k] = (ensemble_part){ e, dt, first, last < e->count ? last : e->count };
    if (k < parts - 1 && pthread_create (&thread[started], NULL, ensemble_thread, &part[k]) == 0)
      started++;
    else
      ensemble_thread (&part[k]);
  }
  while (started > 0) pthread_join (thread[--started], NULL);
}

void pw_ensemble_step (const pw_ensemble *e, double dt) {
  ensemble_divide (e, isnan (dt) ? -1 : dt);
}

void pw_ensemble_observe (const pw_ensemble *e) {
  ensemble_divide (e, NAN);
}
