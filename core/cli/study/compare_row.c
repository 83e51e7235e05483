/* One rung: a run that is looked into and keeps accounts, then runs of the method alone on the clock. */
#include <math.h>
#include <stdlib.h>
#include "compare.h"
#include "stop.h"

#define ROW_SHORT 0.005 /* a batch of steps that took less processor time [s] may be longer the next time */
#define ROW_LONG 0.02
#define ROW_FEW 3      /* repeats at least, unless the limit forbids it */
#define ROW_FINER 1.2  /* times as many steps tell an order */
#define ROW_CLEAR 10   /* times the reference's uncertainty: halved steps then tell an order to log2 1.1 = 0.14 */
#define ROW_AGREE 0.1  /* of an order: by no more than that the last two differ in the asymptotic range */
#define ROW_ENOUGH 0.5 /* more are made until they have taken so long [s] */

/* ---- A run ---- */

/* Takes the samples that the last step has reached. */
static int row_samples (const pw_compare *x, pw_rung *r, pw_run *run, pw_motion *m, int *next, pw_error *error) {
  pw_sample sample;
  while (m && *next < m->samples && m->t[*next] <= pw_time (run)) {
    int status = pw_at (run, m->t[*next], &sample, error);
    if (status != PW_OK) return status;
    pw_motion_take (m, x->m.system, *next, &sample);
    r->balance = fmax (r->balance, fabs (sample.balance));
    ++*next;
  }
  return PW_OK;
}

/* Steps in batches, so that clocks are read seldom. */
static int row_steps (pw_compare *x, pw_rung *r, pw_run *run, pw_motion *m, pw_error *error) {
  int status = PW_OK, next = 0;
  long batch = 8;
  while (status == PW_OK && pw_time (run) < x->t_end) {
    double due = m && next < m->samples ? m->t[next] : x->t_end, start = pw_cpu_clock ();
    long n = 0;
    do { status = pw_advance (run, x->t_end, error); } while (status == PW_OK && ++n < batch && pw_time (run) < due);
    double used = pw_cpu_clock () - start;
    r->cpu += used;
    if (status == PW_OK) status = row_samples (x, r, run, m, &next, error);
    if (used < ROW_SHORT && n == batch && batch < 65536) batch *= 2;
    if (used > ROW_LONG && batch > 1) batch /= 2;
    pw_progress_at (&x->progress, x->rows + fmin (pw_time (run) / x->t_end, 1) / (x->repeats + 1));
    if (status == PW_STOPPED) return PW_RETRY;
    if (status == PW_OK && r->cpu > x->limit && pw_time (run) < x->t_end) {
      r->state = COMPARE_STOPPED;
      return PW_RETRY;
    }
  }
  return status;
}

int pw_compare_run (pw_compare *x, pw_rung *r, pw_motion *motion, pw_error *error) {
  pw_limit any = { .most = INFINITY };
  pw_settings settings = { .span = x->t_end, .ledger = motion != NULL, .stop = pw_limit_over, .stop_context = &any };
  *(r->method->adaptive ? &settings.rtol : &settings.step) = r->rung;
  r->cpu = 0;
  pw_run *run = pw_open (x->m.system, r->method->name, &settings, error);
  if (run == NULL) return error->status;
  if (motion) r->balance = 0;
  int status = row_steps (x, r, run, motion, error);
  r->t = pw_time (run);
  r->statistics = *pw_run_statistics (run);
  pw_close (run);
  return status;
}

/* ---- A row ---- */

static void row_unknown (pw_rung *r) {
  for (int i = 0; i < MOTION_ERRORS; i++) r->error[i] = NAN;
  r->balance = r->spread = r->order = NAN;
}

/* An error below what the truth can tell is no more than that. */
static void row_errors (const pw_compare *x, pw_rung *r, const pw_motion *m) {
  const pw_truth *truth = &x->truth;
  if (!truth->known) return;
  pw_motion_distance (x->m.system, &truth->motion, m, r->error);
  for (int i = 0; i < MOTION_ERRORS; i++) {
    if (truth->uncertainty[i] == 0) r->error[i] = NAN;
    if (!(r->error[i] <= truth->uncertainty[i])) continue;
    r->error[i] = truth->uncertainty[i];
    r->below |= 1u << i;
  }
}

/* log (error before / error) over log (steps / steps before); NaN where an error is not known or may be the reference's by more
 * than a tenth, and where the steps are much the same. */
static double row_order (const pw_compare *x, const pw_rung *r) {
  const pw_rung *before = r - 1;
  int i = isnan (r->error[MOTION_MOST]) ? MOTION_MOST + MOTION_ANGLE : MOTION_MOST;
  int known =
      before->state == COMPARE_DONE && r->state == COMPARE_DONE && r->error[i] > ROW_CLEAR * x->truth.uncertainty[i];
  double finer =
      r->method->adaptive ? (double)r->statistics.steps / (double)before->statistics.steps : before->rung / r->rung;
  return known && finer > ROW_FINER ? log (before->error[i] / r->error[i]) / log (finer) : NAN;
}

double pw_compare_order (const pw_compare *x, const pw_rung *r, int before) {
  double order = before >= 2 ? row_order (x, r) : NAN, last = before >= 2 ? row_order (x, r - 1) : NAN;
  return order > 0 && fabs (order - last) <= ROW_AGREE * order ? order : NAN;
}

static int row_compare (const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static int row_times (pw_compare *x, pw_rung *r, pw_error *error) {
  double cpu[COMPARE_REPEATS], sum = 0;
  int n = 0;
  while (n < x->repeats && !(n >= ROW_FEW && sum > ROW_ENOUGH) && sum <= x->limit) {
    int status = pw_compare_run (x, r, NULL, error);
    if (status != PW_OK) return status;
    sum += cpu[n++] = r->cpu;
    pw_progress_at (&x->progress, x->rows + (n + 1.0) / (x->repeats + 1));
  }
  qsort (cpu, (size_t)n, sizeof *cpu, row_compare);
  r->repeats = n;
  r->cpu = n % 2 ? cpu[n / 2] : (cpu[n / 2 - 1] + cpu[n / 2]) / 2;
  r->spread = n > 1 ? cpu[n - 1] - cpu[0] : NAN;
  return PW_OK;
}

static void row_stopped (const pw_compare *x, pw_rung *r) {
  char limit[32], t[32];
  snprintf (r->reason, sizeof r->reason, "too slow: the limit of %s s was reached at t = %s s",
            pw_format (limit, x->limit, 4), pw_format (t, r->t, 4));
}

int pw_compare_row (pw_compare *x, pw_rung *r, pw_motion *scratch, pw_error *error) {
  pw_error own = { 0 };
  row_unknown (r);
  int status = pw_compare_run (x, r, scratch, &own);
  if (status == PW_OK) {
    row_errors (x, r, scratch);
    status = row_times (x, r, &own);
  }
  if (status == PW_OK) return PW_OK;
  if (status == PW_RETRY && r->state == COMPARE_STOPPED) {
    row_stopped (x, r);
    return PW_OK;
  }
  if (status == PW_RETRY && pw_stop) return PW_RETRY;
  if (status == PW_MACHINE || status == PW_START) return pw_fail (error, status, "%s", own.text);
  r->state = status == PW_INPUT ? COMPARE_REFUSED : COMPARE_FAILED;
  snprintf (r->reason, sizeof r->reason, "%s", own.status ? own.text : "the method gave up");
  return PW_OK;
}
