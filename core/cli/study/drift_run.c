/* One run, looked at after every accepted step: between steps a projected method shows nothing of what it corrects. */
#include <math.h>
#include "drift.h"
#include "stop.h"

enum { RUN_STEPS = 256 };   /* between two looks at the clock */
#define RUN_ROUND_OFF 1e-14 /* a scaled residual below has no growth to speak of */

static void run_raise (double *most, double value) {
  if (!(value <= *most)) *most = value;
}

static void run_begin (pw_drift_row *r) {
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    r->most[i] = r->early[i] = 0;
    r->end[i] = NAN;
    for (int k = 0; r->part && k < DRIFT_PARTS; k++) r->part[k][i] = NAN;
  }
}

/* Which part of the run a time belongs to; its end does. */
static int run_part (const pw_drift *x, double t) {
  int k = (int)ceil (t / x->t_end * DRIFT_PARTS - 1e-9) - 1;
  return k < 0 ? 0 : k < DRIFT_PARTS ? k : DRIFT_PARTS - 1;
}

/* Takes the state reached into the row. */
static int run_look (const pw_drift *x, pw_drift_row *r, pw_run *run, pw_error *error) {
  pw_sample sample;
  int status = pw_at (run, pw_time (run), &sample, error), k = run_part (x, pw_time (run));
  if (status != PW_OK) return status;
  const double value[DRIFT_QUANTITIES] = { sample.position, sample.velocity, fabs (sample.balance) };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    run_raise (&r->most[i], value[i]);
    if (k < DRIFT_PARTS / 2) run_raise (&r->early[i], value[i]);
    if (k == DRIFT_PARTS - 1) r->end[i] = fmax (r->end[i], value[i]);
    if (r->part) r->part[k][i] = fmax (r->part[k][i], value[i]);
  }
  return PW_OK;
}

static int run_steps (pw_drift *x, pw_drift_row *r, pw_run *run, pw_error *error) {
  int status = PW_OK;
  while (status == PW_OK && pw_time (run) < x->t_end) {
    for (int n = 0; status == PW_OK && n < RUN_STEPS && pw_time (run) < x->t_end; n++) {
      status = pw_advance (run, x->t_end, error);
      if (status == PW_OK) status = run_look (x, r, run, error);
    }
    if (status == PW_STOPPED) return pw_limit_fail (&x->limit, pw_time (run), error);
    pw_progress_at (&x->progress, x->done + fmin (pw_time (run) / x->t_end, 1));
  }
  return status;
}

int pw_drift_run (pw_drift *x, pw_drift_row *r, pw_error *error) {
  pw_error own = { 0 };
  run_begin (r);
  r->t = 0;
  pw_limit_start (&x->limit);
  pw_run *run = pw_open (x->m.system, r->method, &x->settings, &own);
  r->status = run ? run_steps (x, r, run, &own) : own.status;
  if (run) {
    r->t = pw_time (run);
    r->statistics = *pw_run_statistics (run);
    pw_close (run);
  }
  if (r->status == PW_RETRY && pw_stop) return PW_RETRY;
  if (r->status == PW_MACHINE || r->status == PW_START) return pw_fail (error, r->status, "%s", own.text);
  if (r->status != PW_OK) snprintf (r->reason, sizeof r->reason, "%s", own.status ? own.text : "the method gave up");
  return PW_OK;
}

double pw_drift_growth (const pw_drift_row *r, int quantity) {
  int told = quantity == DRIFT_BALANCE || r->most[quantity] > RUN_ROUND_OFF;
  return r->status == PW_OK && told && r->early[quantity] > 0 ? log2 (r->most[quantity] / r->early[quantity]) : NAN;
}
