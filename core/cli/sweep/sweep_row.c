/* One run of a sweep, and the cells of its row. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include "progress.h"
#include "sweep_plan.h"

/* The result of a run; NaN if unknown. */
typedef struct {
  double t, kinetic, position, velocity, steps, rhs, cpu;
  double *state; /* columns */
} row_result;

static int row_read (const pw_sweep_system *s, pw_run *r, row_result *x, pw_error *error) {
  pw_sample sample;
  const pw_statistics *statistics = pw_run_statistics (r);
  int n = pw_system_coordinates (s->m.system);
  x->t = pw_run_time (r);
  x->position = statistics->position;
  x->velocity = statistics->velocity;
  x->steps = (double)statistics->steps;
  x->rhs = (double)statistics->rhs;
  int status = pw_run_sample (r, x->t, &sample, error);
  if (status != PW_OK) return status;
  x->kinetic = sample.kinetic;
  for (int i = 0; i < n; i++) x->state[s->column[i]] = sample.q[i], x->state[s->column[n + i]] = sample.v[i];
  return PW_OK;
}

/* The run itself; PW_RETRY if it was stopped.  A failed run still reports the time it reached. */
static int row_run (const pw_plan *p, const pw_sweep_system *s, const pw_settings *settings, row_result *x,
                    pw_error *error) {
  pw_run *r = pw_run_open (s->m.system, p->method, settings, error);
  int status = r ? PW_OK : error->status;
  while (status == PW_OK && pw_run_time (r) < p->t_end) status = pw_run_advance (r, p->t_end, error);
  if (status == PW_STOPPED) status = pw_limit_fail (settings->stop_context, pw_run_time (r), error);
  if (r == NULL) return status;
  int read = row_read (s, r, x, status == PW_OK ? error : &(pw_error){ 0 });
  pw_run_close (r);
  return status == PW_OK ? read : status;
}

/* With the initial values of the row. */
static int row_start (const pw_plan *p, const pw_sweep_system *s, long row, row_result *x, pw_error *error) {
  pw_limit limit = { .most = p->limit };
  pw_settings settings = p->settings;
  pw_initial_value *initial = malloc (((size_t)p->grid.axes + 1) * sizeof *initial);
  if (initial == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < p->grid.axes; i++)
    if (s->state[i] >= 0)
      initial[settings.initials++] = (pw_initial_value){ s->state[i], pw_grid_value (&p->grid, i, row) };
  settings.initial = initial;
  settings.specialised = s->code;
  settings.stop = pw_limit_over;
  settings.stop_context = &limit;
  pw_limit_start (&limit);
  double start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
  int status = row_run (p, s, &settings, x, error);
  x->cpu = pw_seconds (CLOCK_THREAD_CPUTIME_ID) - start;
  free (initial);
  return status > 0 && pw_stop == 0 ? pw_fail (error, PW_METHOD, "the method gave up") : status;
}

static void row_write (const pw_plan *p, long row, int status, const row_result *x, const char *reason, pw_text *t) {
  static const char *const word[] = { "ok", "machine", "input", "start", "method" };
  for (int i = 0; i < p->grid.axes; i++) pw_text_number (t, pw_grid_value (&p->grid, i, row));
  pw_text_cell (t, word[-status]);
  pw_text_number (t, x->t);
  for (int i = 0; i < p->columns; i++) pw_text_number (t, x->state[i]);
  const double rest[] = { x->kinetic, x->position, x->velocity, x->steps, x->rhs, x->cpu };
  for (int i = 0; i < (p->cpu ? 6 : 5); i++) pw_text_number (t, rest[i]);
  pw_text_quoted (t, reason);
}

int pw_sweep_row (const pw_plan *p, const pw_sweep_system *s, long row, pw_text *text, pw_error *error) {
  row_result x = { NAN, NAN, NAN, NAN, NAN, NAN, 0, NULL };
  x.state = malloc (((size_t)p->columns + 1) * sizeof *x.state);
  if (x.state == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < p->columns; i++) x.state[i] = NAN;
  int status = error->status == PW_OK ? row_start (p, s, row, &x, error) : error->status;
  if (status != PW_RETRY && status != PW_RESOURCE) row_write (p, row, status, &x, error->text, text);
  free (x.state);
  return text->failed ? pw_fail (error, PW_RESOURCE, "out of memory") : status;
}
