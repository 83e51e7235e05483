/* The error of a run, stated from its repetition with a tenth of the tolerance, or half the step.
 *
 * If a repetition has at most half the error of the run, the error is at most twice the difference of both.  A
 * difference can vanish by chance, so that the error at the end is taken from the last fifth of the samples.  Where the
 * difference is a large part of the motion, a second repetition shows whether it becomes smaller at all: it does not in
 * chaotic motions, and when the run takes another branch. */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel-analysis.h"
#include "util.h"

/* Stated error over difference, with fixed and with adaptive steps.  In about 1,600 runs of random mechanisms
 * (tests/reference/stated.py) the factor 2 left 3.3 % of the runs outside, 2 and 4 left 0.8 %. */
static const double SAFETY[] = { 3, 5 };
static const double LARGE = 0.01, /* a second repetition is made above this difference over the range of the motion */
    STILL = 1e-3,                 /* the least range of a motion, in units of the scene */
    SMALLER = 0.5,                /* of the differences of two repetitions, at most */
    ROUND_OFF = 64 * DBL_EPSILON; /* of the largest value of a column: equal values do not state an error of 0 */
enum { LAST = 5 };                /* the last fifth of the samples */

struct pw_repetition {
  const pw_system *s;
  const char *method;
  pw_settings settings; /* of the run */
  int adaptive, coarse; /* coarse: 1 if no smaller tolerance is possible, so that the tolerance is ten times larger */
  const double *times;
  long count; /* times */
  int width;  /* numbers of a row */
  pw_scale scale;
  double *first; /* rows of the repetition: count x width */
  pw_run *run;   /* open, and its rows recorded so far */
  long recorded;
};

static pw_settings repetition_settings (const pw_repetition *r, int number) {
  pw_settings x = r->settings;
  const double tolerance = r->coarse ? 10 : pow (10, -number);
  if (!r->adaptive)
    x.step = (x.step > 0 ? x.step : PW_STEP) / pow (2, number);
  else
    x.rtol = (x.rtol > 0 ? x.rtol : PW_RTOL) * tolerance, x.atol *= tolerance;
  return x;
}

/* Opens a repetition; if its tolerance is too small for the method, one with a larger tolerance. */
static pw_run *repetition_open_run (pw_repetition *r, int number, pw_error *error) {
  pw_settings settings = repetition_settings (r, number);
  pw_error own = { 0 };
  pw_run *run = pw_run_open (r->s, r->method, &settings, &own);
  if (run || !r->adaptive || number > 1 || own.status != PW_INPUT) {
    if (run == NULL) pw_fail (error, own.status, "%s", own.text);
    return run;
  }
  r->coarse = 1;
  settings = repetition_settings (r, number);
  return pw_run_open (r->s, r->method, &settings, error);
}

/* Continues a repetition, r->run, whose first r->recorded rows are stored; in at most this number of steps, if > 0. */
static int repetition_record (pw_repetition *r, int number, double *rows, long steps, pw_error *error) {
  long recorded;
  if (r->run == NULL && (r->run = repetition_open_run (r, number, error)) == NULL) return error->status;
  r->scale = *pw_run_scale (r->run);
  int status = pw_run_record (r->run, r->times[r->count - 1], r->times + r->recorded, r->count - r->recorded,
                              steps > 0 ? steps : LONG_MAX, rows + r->recorded * r->width, &recorded, error);
  r->recorded += recorded;
  if (status == PW_OK && r->recorded < r->count) return PW_RETRY;
  pw_run_close (r->run);
  r->run = NULL, r->recorded = 0;
  return status;
}

pw_repetition *pw_repetition_open (const pw_system *s, const char *method, const pw_settings *settings,
                                   const double *times, long count, pw_error *error) {
  const pw_method *integrator;
  if (pw_require (s, "a system", error) != PW_OK || pw_require (settings, "settings", error) != PW_OK) return NULL;
  if (pw_method_parse (method, settings->methods, &integrator, NULL, error) != PW_OK) return NULL;
  if (count < 1 || times == NULL) {
    pw_fail (error, PW_INPUT, "no times at which runs are compared");
    return NULL;
  }
  pw_repetition *r = calloc (1, sizeof *r);
  const int width = pw_system_record_width (s, settings->ledger);
  double *first = calloc ((size_t)count * (size_t)width, sizeof *first);
  if (r && first) {
    *r = (pw_repetition){ .s = s, .method = method, .settings = *settings, .times = times, .count = count };
    r->adaptive = pw_method_adaptive (integrator, method), r->width = width, r->first = first;
    return r;
  }
  free (r);
  free (first);
  pw_fail (error, PW_RESOURCE, "out of memory");
  return NULL;
}

void pw_repetition_close (pw_repetition *r) {
  if (r == NULL) return;
  pw_run_close (r->run);
  free (r->first);
  free (r);
}

int pw_repetition_run (pw_repetition *r, long steps, pw_error *error) {
  return repetition_record (r, 1, r->first, steps, error);
}

const char *pw_repetition_text (const pw_repetition *r) {
  return !r->adaptive ? "half the step" : r->coarse ? "ten times the tolerance" : "a tenth of the tolerance";
}

/* The largest difference of a column in the rows from `from` on. */
static double repetition_difference (const double *a, const double *b, long from, long count, int width, int column) {
  double most = 0;
  for (long k = from; k < count; k++) {
    double d = fabs (a[k * width + column] - b[k * width + column]);
    if (d > most || isnan (d)) most = d;
  }
  return most;
}

/* The largest difference of any state, divided by the range of the states of its unit; *state: which.  NaN if a state
 * of one of the runs is not a number. */
static double repetition_relative (const pw_repetition *r, const double *a, const double *b, long count, int *state) {
  const int n = pw_system_coordinates (r->s);
  double most = 0;
  *state = 0;
  for (int i = 0; i < 2 * n && !isnan (most); i++) {
    if (pw_system_state_hidden (r->s, i)) continue;
    const char *unit = pw_system_state_unit (r->s, i);
    const double size = (*unit == 'm' ? r->scale.length : 1) / (i < n ? 1 : r->scale.time);
    double range = STILL * size, d = repetition_difference (a, b, 0, count, r->width, PW_RECORD_STATES + i);
    for (int j = 0; j < 2 * n; j++) {
      double least = INFINITY, largest = -INFINITY;
      if (strcmp (pw_system_state_unit (r->s, j), unit) != 0) continue;
      for (const double *x = a + PW_RECORD_STATES + j, *last = x + count * r->width; x < last; x += r->width)
        least = fmin (least, *x), largest = fmax (largest, *x);
      range = fmax (range, largest - least);
    }
    if (!(d <= most * range)) most = d / range, *state = i;
  }
  return most;
}

/* Whether a second repetition approaches the first one, where that is far from the run. */
static int repetition_converges (pw_repetition *r, const double *rows, long count, int state, pw_error *error) {
  double *second = calloc ((size_t)r->count * (size_t)r->width, sizeof *second);
  pw_error own = { 0 };
  if (second == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = r->coarse ? PW_METHOD : repetition_record (r, 2, second, 0, &own), column = PW_RECORD_STATES + state;
  const double before = repetition_difference (rows, r->first, 0, count, r->width, column),
               after = status == PW_OK ? repetition_difference (r->first, second, 0, count, r->width, column) : NAN;
  free (second);
  if (status == PW_RESOURCE || status == PW_STOPPED) return pw_fail (error, status, "%s", own.text);
  if (after <= SMALLER * before) return PW_OK;
  char name[PW_NAME_BYTES];
  const char *unit = pw_system_state_unit (r->s, state);
  pw_system_state_name (r->s, state, name, sizeof name);
  if (isnan (after))
    return pw_fail (error, PW_METHOD, "%s differs by %.3g %s in the repetition with %s", name, before, unit,
                    pw_repetition_text (r));
  return pw_fail (error, PW_METHOD,
                  "%s differs by %.3g %s in the repetition with %s, and that by %.3g %s from a further one: the "
                  "motion is chaotic, takes another branch, or needs a smaller %s",
                  name, before, unit, pw_repetition_text (r), after, unit, r->adaptive ? "tolerance" : "step");
}

int pw_repetition_error (pw_repetition *r, const double *rows, long count, double *end, double *largest,
                         pw_error *error) {
  const double factor = SAFETY[r->adaptive];
  int state, status = PW_OK;
  if (count < 1 || count > r->count) return pw_fail (error, PW_INPUT, "%ld rows: expected 1 to %ld", count, r->count);
  if (!(repetition_relative (r, rows, r->first, count, &state) <= LARGE))
    status = repetition_converges (r, rows, count, state, error);
  for (int i = 0; status == PW_OK && i < r->width; i++) {
    double least = 0;
    end[i] = largest[i] = NAN;
    /* the time, constraint residuals, energy of projections and balance have no error that this could state */
    if (i < 3 || i == PW_RECORD_STATES - 2 || i == PW_RECORD_STATES - 1) continue;
    if (i >= PW_RECORD_STATES && pw_system_state_hidden (r->s, i - PW_RECORD_STATES)) continue;
    for (long k = 0; k < count; k++) least = fmax (least, ROUND_OFF * fabs (rows[k * r->width + i]));
    end[i] = least + factor * repetition_difference (rows, r->first, count - 1 - count / LAST, count, r->width, i);
    largest[i] = least + factor * repetition_difference (rows, r->first, 0, count, r->width, i);
  }
  return status;
}
