/* Measures the processor time of small pieces of work, one alone or two in comparison.  Batches of both alternate, so
 * that a slow phase of the machine affects both; the result is the median of the ratios of adjacent batches. */
#ifndef TIMING_H
#define TIMING_H

#include <math.h>
#include <stdlib.h>
#include <time.h>

enum { TIMING_PAIRS_MAX = 99 }; /* most batches or pairs */

/* Work to be timed: does it n times and returns how many units (evaluations, steps) that were. */
typedef struct {
  long (*run) (void *context, long n);
  void *context;
} timing_work;

/* The result of a comparison: medians over the pairs. */
typedef struct {
  double base, ours; /* time per unit [ns] */
  double ratio;      /* of ours / base in each pair */
} timing_result;

/* Processor time of this process so far [s]. */
static inline double timing_now (void) {
  struct timespec t;
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline int timing_order (const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* The median; sorts the values. */
static inline double timing_median (double *value, int count) {
  qsort (value, (size_t)count, sizeof *value, timing_order);
  return count % 2 ? value[count / 2] : (value[count / 2 - 1] + value[count / 2]) / 2;
}

/* Time per unit [ns] of one batch. */
static inline double timing_batch (const timing_work *w, long n) {
  double start = timing_now ();
  long units = w->run (w->context, n);
  return 1e9 * (timing_now () - start) / (double)units;
}

/* How many times the work can be done in the given time [s]; also warms up the caches. */
static inline long timing_calibrate (const timing_work *w, double seconds) {
  for (long n = 1;; n *= 2) {
    double start = timing_now ();
    w->run (w->context, n);
    double used = timing_now () - start;
    if (used > seconds / 4) return (long)fmax (1, (double)n * seconds / used);
  }
}

/* The median time per unit [ns] of one piece of work. */
static inline double timing_alone (const timing_work *w, int batches, double seconds) {
  double ns[TIMING_PAIRS_MAX];
  long n = timing_calibrate (w, seconds);
  for (int i = 0; i < batches; i++) ns[i] = timing_batch (w, n);
  return timing_median (ns, batches);
}

/* Compares two pieces of work in pairs of batches of about this duration [s] each; the order alternates. */
static inline timing_result timing_compare (const timing_work *base, const timing_work *ours, int pairs,
                                            double seconds) {
  double a[TIMING_PAIRS_MAX], b[TIMING_PAIRS_MAX], ratio[TIMING_PAIRS_MAX];
  long na = timing_calibrate (base, seconds), nb = timing_calibrate (ours, seconds);
  for (int i = 0; i < pairs; i++) {
    if (i % 2) b[i] = timing_batch (ours, nb);
    a[i] = timing_batch (base, na);
    if (i % 2 == 0) b[i] = timing_batch (ours, nb);
    ratio[i] = b[i] / a[i];
  }
  return (timing_result){ timing_median (a, pairs), timing_median (b, pairs), timing_median (ratio, pairs) };
}

#endif
