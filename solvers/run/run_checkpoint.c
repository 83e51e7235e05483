/* Checkpoints: the state of a run as bytes.
 *
 * What a method or a factorisation has built up, such as pivot choices and earlier values of a multistep formula, is
 * not saved: the saved run and the loaded one both rebuild it from the state reached, and so continue alike.  A
 * method's `serialise` adds what it cannot rebuild: step size, counts. */
#include <math.h>
#include <string.h>
#include "method.h"
#include "rank.h"
#include "util.h"

static void checkpoint_add_text (unsigned long long *sum, const char *text) {
  *sum = pw_check_sum (*sum, text, strlen (text) + 1);
}

/* Adds numbers rounded to 1e-6 units and to single precision: libraries of another machine may round differently. */
static void checkpoint_add_state (unsigned long long *sum, const double *x, int n, double unit) {
  for (int j = 0; j < n; j++) {
    float rounded = (float)round (1e6 * x[j] / unit) + 0.0f; /* no -0 */
    *sum = pw_check_sum (*sum, &rounded, sizeof rounded);
  }
}

/* Adds the numbers of a signal; of a function there are none. */
static void checkpoint_add_signal (unsigned long long *sum, const pw_signal *x) {
  static const size_t bytes[] = { [PW_CONSTANT] = sizeof x->constant,
                                  [PW_HARMONIC] = sizeof x->harmonic,
                                  [PW_FUNCTION] = 0,
                                  [PW_RAMP] = sizeof x->ramp,
                                  [PW_SMOOTH_STEP] = sizeof x->ramp,
                                  [PW_PULSE] = sizeof x->pulse,
                                  [PW_TABLE] = 0 };
  *sum = pw_check_sum (*sum, &(int){ (int)x->type }, sizeof (int));
  *sum = pw_check_sum (*sum, &x->constant, bytes[x->type]);
  if (x->type != PW_TABLE) return;
  *sum = pw_check_sum (*sum, (int[]){ x->table.interpolation, x->table.ends }, 2 * sizeof (int));
  *sum = pw_check_sum (*sum, x->table.t, (size_t)x->table.count * sizeof (double));
  *sum = pw_check_sum (*sum, x->table.value, (size_t)x->table.count * sizeof (double));
}

unsigned long long pw_run_identity (const pw_run *r) {
  const pw_system *s = r->s;
  const pw_settings *set = &r->settings;
  const double number[] = { set->t, set->span, set->step, set->rtol, set->atol, set->ledger, r->fixed_steps };
  unsigned long long sum = pw_check_sum (PW_CHECK, number, sizeof number);
  sum = pw_check_sum (sum, r->option, sizeof r->option);
  sum = pw_check_sum (sum, s->mass, (size_t)s->coords * sizeof *s->mass);
  checkpoint_add_text (&sum, r->method->name);
  checkpoint_add_text (&sum, r->method->stabilisations[r->stabilisation].name);
  for (int b = 0; b < s->bodies; b++) checkpoint_add_text (&sum, s->body_name[b]);
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    checkpoint_add_text (&sum, k->kind->name);
    for (int e = 0; e < k->b.count; e++) checkpoint_add_text (&sum, k->name[e]);
  }
  for (int i = 0; i < s->sources; i++) checkpoint_add_signal (&sum, &s->source[i].signal);
  checkpoint_add_state (&sum, r->q, s->coords, s->scale.length);
  checkpoint_add_state (&sum, r->v, s->coords, s->scale.length);
  checkpoint_add_state (&sum, r->a, s->coords, s->scale.length);
  return sum;
}

/* Saves identity and sizes of the run, or reads those of a saved one; 1 if they are the same. */
static int checkpoint_same (pw_run *r, pw_archive *a) {
  unsigned long long identity = r->identity;
  pw_archive_bytes (a, &identity, sizeof identity);
  const int own[] = { r->s->coords, r->s->rows, r->entries, r->redundant };
  enum { SIZES = sizeof own / sizeof *own };
  int same = identity == r->identity;
  for (int i = 0; i < SIZES; i++) {
    int size = own[i];
    pw_archive_bytes (a, &size, sizeof size);
    same &= size == own[i];
  }
  return same;
}

#define CHECKPOINT_LONG(name) long name;
#define CHECKPOINT_DOUBLE(name) double name;
typedef struct {
  PW_STATISTICS_COUNTS (CHECKPOINT_LONG)
  PW_STATISTICS_RESIDUALS (CHECKPOINT_DOUBLE)
} checkpoint_members;
_Static_assert(sizeof (checkpoint_members) == sizeof (pw_statistics),
               "enter each member of pw_statistics in util.h, PW_STATISTICS_..., and a count also in docs/manual.md");

static void checkpoint_statistics (pw_statistics *s, pw_archive *a) {
#define CHECKPOINT_COUNT(name) pw_archive_count (a, &s->name);
#define CHECKPOINT_RESIDUAL(name) pw_archive_bytes (a, &s->name, sizeof s->name);
  PW_STATISTICS_COUNTS (CHECKPOINT_COUNT)
  PW_STATISTICS_RESIDUALS (CHECKPOINT_RESIDUAL)
}

static void checkpoint_state (pw_run *r, pw_archive *a) {
  size_t n = (size_t)r->s->coords * sizeof (double), entries = (size_t)r->entries * sizeof (double);
  double *const number[] = {
    &r->t,     &r->breakpoint,      &r->projected,     &r->energy0,      &r->potential0,     &r->exchanged,
    &r->power, &r->reference_level, &r->previous_norm, &r->independence, &r->reselect_below, &r->watchdog.largest_sine
  };
  for (size_t i = 0; i < sizeof number / sizeof *number; i++) pw_archive_bytes (a, number[i], sizeof (double));
  pw_archive_bytes (a, &r->speed_record, sizeof r->speed_record);
  pw_archive_bytes (a, &r->earlier_record, sizeof r->earlier_record);
  pw_archive_bytes (a, r->q, n);
  pw_archive_bytes (a, r->v, n);
  pw_archive_bytes (a, r->ledger, entries);
  checkpoint_statistics (&r->statistics, a);
  pw_rank_serialise (r, a);
}

/* Continues from the run's state, which was just saved or loaded, and loads the method's own data, if any, from a. */
static int checkpoint_continue (pw_run *r, pw_archive *a, pw_error *error) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  r->near_singular = 0;
  if (r->method->serialise == NULL) r->statistics.restarts++;
  int status = pw_run_renew (r, error);
  if (status == PW_OK && r->method->serialise) r->method->serialise (r, a);
  if (status == PW_OK && a->failed) return pw_fail (error, PW_INPUT, "the saved state does not belong to this run");
  return status;
}

int pw_run_save (pw_run *r, pw_archive *a, pw_error *error) {
  pw_sample sample;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (r->near_singular) return PW_RETRY;
  int status = pw_run_sample (r, r->t, &sample, error); /* some methods evaluate the state reached only here */
  if (status != PW_OK) return status;
  checkpoint_same (r, a);
  checkpoint_state (r, a);
  pw_archive saved = { .used = a->used, .loading = 1 }; /* to load what the method saves next */
  if (r->method->serialise) r->method->serialise (r, a);
  if (a->failed) return pw_fail_memory (r->s, error);
  saved.at = a->at;
  saved.size = a->used;
  return checkpoint_continue (r, &saved, error);
}

int pw_run_load (pw_run *r, pw_archive *a, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (r->statistics.steps > 0 || r->t != r->settings.t)
    return pw_fail (error, PW_INPUT, "the run has advanced to t = %g s: a saved state needs a new one", r->t);
  int same = checkpoint_same (r, a);
  if (same) checkpoint_state (r, a);
  if (!same || a->failed) return pw_fail (error, PW_INPUT, "the saved state does not belong to this run");
  if (!isfinite (r->t) || r->t < r->settings.t || !pw_is_finite_state (r, r->q, r->v)) /* not written by a run */
    return pw_fail (
        error, PW_INPUT,
        "the saved state is not that of a run: its time, t = %g s, or a coordinate or velocity is impossible", r->t);
  return checkpoint_continue (r, a, error);
}
