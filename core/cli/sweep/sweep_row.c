/* One run of a sweep, from the model to the cells of its row. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include "progress.h"
#include "sweep.h"

/* The result of a run; NaN if unknown. */
typedef struct {
  double t, kinetic, position, velocity, steps, rhs, cpu;
  double *state; /* columns */
} row_result;

/* States go to the columns of their names. */
static int row_states (const pw_plan *p, const pw_system *s, const pw_sample *sample, double *state, pw_error *error) {
  char name[300];
  int n = pw_system_coordinates (s);
  for (int i = 0; i < 2 * n; i++) {
    int from = pw_plan_state (s, i);
    int column = pw_names_find (&p->index, pw_system_state_name (s, from, name, sizeof name));
    if (column < 0)
      return pw_fail (error, PW_INPUT,
                      "%s has no column: the number of bodies may only depend on parameters that are counts", name);
    state[column] = from < n ? sample->q[from] : sample->v[from - n];
  }
  return PW_OK;
}

static int row_read (const pw_plan *p, const pw_system *s, pw_run *r, row_result *x, pw_error *error) {
  pw_sample sample;
  const pw_statistics *statistics = pw_run_statistics (r);
  x->t = pw_run_time (r);
  x->position = statistics->position;
  x->velocity = statistics->velocity;
  x->steps = (double)statistics->steps;
  x->rhs = (double)statistics->rhs;
  int status = pw_run_sample (r, x->t, &sample, error);
  if (status != PW_OK) return status;
  x->kinetic = sample.kinetic;
  return row_states (p, s, &sample, x->state, error);
}

/* The run itself; PW_RETRY if it was stopped.  A failed run still reports the time it reached. */
static int row_run (const pw_plan *p, long row, row_result *x, pw_error *error) {
  pw_cli_model m;
  pw_limit limit = { .most = p->limit };
  pw_settings settings = p->settings;
  settings.stop = pw_limit_over;
  settings.stop_context = &limit;
  pw_limit_start (&limit);
  double start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
  pw_run *r = NULL;
  int status = pw_plan_scene (p, row, &m, error);
  if (status == PW_OK && (r = pw_run_open (m.system, p->method, &settings, error)) == NULL) status = error->status;
  while (status == PW_OK && pw_run_time (r) < p->t_end) status = pw_run_advance (r, p->t_end, error);
  if (status == PW_STOPPED) status = pw_limit_fail (&limit, pw_run_time (r), error);
  if (r) {
    pw_error *own = &(pw_error){ 0 };
    int read = row_read (p, m.system, r, x, status == PW_OK ? error : own);
    if (status == PW_OK) status = read;
    pw_run_close (r);
  }
  pw_cli_close_model (&m);
  x->cpu = pw_seconds (CLOCK_THREAD_CPUTIME_ID) - start;
  return status > 0 && pw_stop == 0 ? pw_fail (error, PW_METHOD, "the method gave up") : status;
}

static void row_write (const pw_plan *p, long row, int status, const row_result *x, const char *reason, pw_text *t) {
  static const char *const word[] = { "ok", "machine", "input", "start", "method" };
  for (int i = 0; i < p->grid.axes; i++) pw_text_number (t, pw_grid_value (&p->grid, i, row));
  pw_text_cell (t, word[-status]);
  pw_text_number (t, x->t);
  for (int i = 0; i < p->columns; i++) pw_text_number (t, x->state[i]);
  pw_text_number (t, x->kinetic);
  pw_text_number (t, x->position);
  pw_text_number (t, x->velocity);
  pw_text_number (t, x->steps);
  pw_text_number (t, x->rhs);
  if (p->cpu) pw_text_number (t, x->cpu);
  pw_text_quoted (t, reason);
}

int pw_sweep_row (const pw_plan *p, long row, pw_text *text, pw_error *error) {
  pw_error own = { 0 };
  row_result x = { NAN, NAN, NAN, NAN, NAN, NAN, NAN, NULL };
  x.state = malloc (((size_t)p->columns + 1) * sizeof *x.state);
  if (x.state == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < p->columns; i++) x.state[i] = NAN;
  int status = row_run (p, row, &x, &own);
  if (status == PW_RESOURCE) pw_fail (error, status, "row %ld of the grid: %s", row + 1, own.text);
  if (status != PW_RETRY && status != PW_RESOURCE) row_write (p, row, status, &x, own.text, text);
  free (x.state);
  if (text->failed) return pw_fail (error, PW_RESOURCE, "out of memory");
  return status;
}
