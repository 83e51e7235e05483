/* Checkpoints: the state of a run as bytes.
 *
 * What a method or a factorisation has built up, such as pivot choices and earlier values of a multistep formula, is
 * not saved: the saved run and the loaded one both rebuild it from the state reached, and so continue alike.  A
 * method's `serialise` adds what it cannot rebuild: step size, counts. */
#include <math.h>
#include "method.h"
#include "rank.h"
#include "util.h"

/* Saves the sizes of the run, or reads those of a saved one; 1 if they are the same. */
static int checkpoint_sizes (pw_run *r, pw_archive *a) {
  const int own[] = { r->s->coords, r->s->rows, r->s->entries, r->redundant };
  enum { SIZES = sizeof own / sizeof *own };
  int same = 1;
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
  size_t n = (size_t)r->s->coords * sizeof (double), entries = (size_t)r->s->entries * sizeof (double);
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
  checkpoint_sizes (r, a);
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
  int same_sizes = checkpoint_sizes (r, a);
  if (same_sizes) checkpoint_state (r, a);
  if (!same_sizes || a->failed) return pw_fail (error, PW_INPUT, "the saved state does not belong to this run");
  if (!isfinite (r->t) || r->t < r->settings.t || !pw_is_finite_state (r, r->q, r->v)) /* not written by a run */
    return pw_fail (
        error, PW_INPUT,
        "the saved state is not that of a run: its time, t = %g s, or a coordinate or velocity is impossible", r->t);
  return checkpoint_continue (r, a, error);
}
