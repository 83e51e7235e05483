/* Prints the conclusion of a comparison: the processor time of each method for the numbers of correct digits in
 * conclusion_required, interpolated on its work-precision curve and relative to the cheapest method; then the runs that
 * failed or were stopped. */
#include <math.h>
#include <string.h>
#include "reference.h"

enum {
  CONCLUSION_COLUMNS = 3,
  CONCLUSION_WIDTH = 14, /* of a column, at least */
  CONCLUSION_REASON = 70 /* characters of the reason of a failure, at most */
};
/* Numbers of correct digits, and the largest relative errors that have them. */
static const struct {
  int digits;
  double error;
} conclusion_required[CONCLUSION_COLUMNS] = { { 3, 1e-3 }, { 6, 1e-6 }, { 9, 1e-9 } };

typedef struct {
  double cpu;         /* [s]; NaN: no run is as accurate */
  int is_upper_bound; /* 1: see conclusion_least_cost */
} conclusion_cost;

typedef struct {
  const pw_study *study;
  const pw_reference *reference;
  int error_column;             /* in the rows: the largest error of lengths, then of angles */
  double uncertainty;           /* relative, of the reference: its conclusion_error */
  int width;                    /* of columns: that of the longest name of a method */
  int best[CONCLUSION_COLUMNS]; /* the cheapest method; -1: none */
  conclusion_cost cheapest[CONCLUSION_COLUMNS];
} pw_conclusion;

/* ---- Errors ---- */

/* Errors are relative to the largest coordinate of the same unit, those of angles to 1 rad at most. */
static double conclusion_scale (const pw_reference *reference, int unit) {
  double size = reference->size[unit] > 0 ? reference->size[unit] : 1;
  return unit == MOTION_ANGLE ? fmin (size, 1) : size;
}

/* The larger of the relative errors of lengths and angles, as far as they are compared; NaN if one of these is unknown.
 * errors: of lengths [m], of angles [rad]. */
static double conclusion_error (const pw_reference *reference, const double *errors) {
  double largest = 0;
  for (int unit = MOTION_LENGTH; unit <= MOTION_ANGLE; unit++) {
    double error = errors[unit] / conclusion_scale (reference, unit);
    if (reference->uncertainty[MOTION_LARGEST + unit] > 0 && !(error <= largest) && !isnan (largest)) largest = error;
  }
  return largest;
}

/* ---- Costs ---- */

/* The least processor time of a method for the required relative error, interpolated between neighbouring runs on
 * logarithmic scales.  It is an upper bound if no run before it was less accurate, if the run just before it failed, so
 * that its error is unknown, or if it is interpolated to an error that is only known to be below the uncertainty. */
static conclusion_cost conclusion_least_cost (const pw_conclusion *conclusion, int method, double required) {
  conclusion_cost least = { NAN, 0 };
  double previous = NAN;
  int less_accurate_before = 0;
  const pw_study *study = conclusion->study;
  for (const pw_row *row = study->row; row < study->row + study->rows; row++) {
    if (row->curve != method) continue;
    double error =
        row->state == ROW_DONE ? conclusion_error (conclusion->reference, row->value + conclusion->error_column) : NAN;
    conclusion_cost candidate = { error <= required ? row->cpu : NAN, !less_accurate_before || isnan (previous) };
    if (error <= required && previous > required) {
      double cpu = row[-1].cpu * pow (row->cpu / row[-1].cpu, log (required / previous) / log (error / previous));
      candidate = (conclusion_cost){ fmin (cpu, row->cpu), error <= conclusion->uncertainty };
    }
    if (candidate.cpu > 0 && !(least.cpu <= candidate.cpu)) least = candidate;
    less_accurate_before |= error > required;
    previous = error;
  }
  return least;
}

/* Finds the cheapest method of each column for which the reference is accurate enough. */
static void conclusion_find_cheapest (pw_conclusion *conclusion) {
  for (int k = 0; k < CONCLUSION_COLUMNS; k++) {
    conclusion->best[k] = -1;
    conclusion->cheapest[k].cpu = NAN;
    for (int i = 0; i < conclusion->study->methods && conclusion->uncertainty <= conclusion_required[k].error; i++) {
      conclusion_cost candidate = conclusion_least_cost (conclusion, i, conclusion_required[k].error);
      if (isnan (candidate.cpu) || conclusion->cheapest[k].cpu <= candidate.cpu) continue;
      conclusion->cheapest[k] = candidate;
      conclusion->best[k] = i;
    }
  }
}

/* ---- Table ---- */

static void conclusion_print_heading (const pw_conclusion *conclusion) {
  static const char *const unit[] = { "m", "rad" }, *const name[] = { "lengths", "angles" };
  const pw_reference *reference = conclusion->reference;
  const char *between = "";
  printf ("Processor time for ");
  for (int k = 0; k < CONCLUSION_COLUMNS; k++)
    printf ("%s%d", k == 0 ? "" : k + 1 < CONCLUSION_COLUMNS ? ", " : " and ", conclusion_required[k].digits);
  printf (" correct digits, relative to the cheapest method.\n"
          "Digits: the largest error of a coordinate at %d times up to %s s, relative to\n",
          reference->motion.taken, PW_DIGITS (conclusion->study->t_end, 6));
  for (int i = MOTION_LENGTH; i <= MOTION_ANGLE; i++)
    if (reference->uncertainty[MOTION_LARGEST + i] > 0) {
      printf ("%s%s %s (%s)", between, PW_DIGITS (conclusion_scale (reference, i), 3), unit[i], name[i]);
      between = ", ";
    }
  const double digits = -log10 (conclusion->uncertainty);
  printf (". The reference has %s digits%s.\n\n", digits >= 0.05 ? PW_PRINTED (40, "%.1f", digits) : "no correct",
          conclusion->study->reference_path ? " if its table is exact" : "");
}

/* "1.5 ms", "<0.2 ms", "-" */
static char *conclusion_format_time (char text[40], conclusion_cost c) {
  int ms = c.cpu < 1;
  snprintf (text, 40, "%s%s %s", c.is_upper_bound ? "<" : "", PW_DIGITS (ms ? 1e3 * c.cpu : c.cpu, 2), ms ? "ms" : "s");
  return isnan (c.cpu) ? strcpy (text, "-") : text;
}

/* The time for column k over that of the cheapest method: "2.5", "<30", "uncertain", "not reached" */
static char *conclusion_format_ratio (char text[40], const pw_conclusion *conclusion, int method, int k) {
  conclusion_cost c = conclusion_least_cost (conclusion, method, conclusion_required[k].error);
  double ratio = c.cpu / conclusion->cheapest[k].cpu;
  snprintf (text, 40, "%s%.*f", c.is_upper_bound ? "<" : "", ratio < 9.95, ratio);
  if (conclusion->uncertainty > conclusion_required[k].error) return strcpy (text, "uncertain");
  return isnan (c.cpu) ? strcpy (text, "not reached") : text;
}

/* The cheapest methods, their times, then a line for each method. */
static void conclusion_print_table (const pw_conclusion *conclusion) {
  char text[40];
  int bounds = 0, any_uncertain = 0;
  printf ("%-*s", conclusion->width, "");
  for (int k = 0; k < CONCLUSION_COLUMNS; k++)
    printf ("  %*d digits", conclusion->width - 7, conclusion_required[k].digits);
  printf ("\n%-*s", conclusion->width, "cheapest");
  for (int k = 0; k < CONCLUSION_COLUMNS; k++)
    printf ("  %*s", conclusion->width, conclusion->best[k] < 0 ? "-" : conclusion->study->method[conclusion->best[k]]);
  printf ("\n%-*s", conclusion->width, "its time");
  for (int k = 0; k < CONCLUSION_COLUMNS; k++)
    printf ("  %*s", conclusion->width, conclusion_format_time (text, conclusion->cheapest[k]));
  for (int i = 0; i < conclusion->study->methods; i++) {
    printf ("\n%-*s", conclusion->width, conclusion->study->method[i]);
    for (int k = 0; k < CONCLUSION_COLUMNS; k++) {
      printf ("  %*s", conclusion->width, conclusion_format_ratio (text, conclusion, i, k));
      bounds |= *text == '<';
      any_uncertain |= *text == 'u';
    }
  }
  puts (bounds ? "\n<: at most: no run has fewer digits, or it is unknown how many the one before or the next one has"
               : "");
  if (any_uncertain) puts ("uncertain: the reference is not accurate enough to distinguish methods");
}

/* ---- Runs that do not reach the end ---- */

/* Sets of states of runs: bits 1 << pw_row_state. */
enum {
  RUNS_ALL = ~0,
  RUNS_FAILED = 1 << ROW_FAILED | 1 << ROW_REFUSED,
  RUNS_LIMITED = 1 << ROW_STOPPED | 1 << ROW_SKIPPED
};

/* The number of runs of a method whose state is in a set, and the first of them or NULL. */
static int conclusion_count_runs (const pw_study *study, int method, int states, const pw_row **first) {
  int count = 0;
  *first = NULL;
  for (const pw_row *row = study->row; row < study->row + study->rows; row++)
    if (row->curve == method && states >> row->state & 1 && count++ == 0) *first = row;
  return count;
}

static void conclusion_print_failures (const pw_study *study, int method) {
  const pw_row *first, *any;
  int failures = conclusion_count_runs (study, method, RUNS_FAILED, &first);
  if (first == NULL) return;
  int cut = strlen (first->reason) > CONCLUSION_REASON;
  pw_cli_print (stdout, "%s: %d of %d runs %s, first at %s %s: %.*s%s\n", first->method, failures,
                conclusion_count_runs (study, method, RUNS_ALL, &any),
                first->state == ROW_FAILED ? "fail" : "are refused", first->adaptive ? "rtol" : "step",
                PW_DIGITS (first->level, 4), CONCLUSION_REASON, first->reason, cut ? "..." : "");
}

/* One line for all methods with runs that the limit has stopped or prevented. */
static void conclusion_print_limited (const pw_study *study) {
  const char *beginning = PW_PRINTED (80, "stopped by the limit of %s s: ", PW_DIGITS (study->cpu_limit, 4));
  const char *before = beginning;
  for (int i = 0; i < study->methods; i++) {
    const pw_row *first;
    if (conclusion_count_runs (study, i, RUNS_LIMITED, &first) == 0) continue;
    printf ("%s%s from %s", before, first->method, PW_DIGITS (first->level, 4));
    before = ", ";
  }
  if (before != beginning) putchar ('\n');
}

void pw_conclusion_print (const pw_study *study, const pw_reference *reference, int error_column) {
  pw_conclusion conclusion = {
    .study = study, .reference = reference, .error_column = error_column, .width = CONCLUSION_WIDTH
  };
  conclusion.uncertainty = conclusion_error (reference, reference->uncertainty + MOTION_LARGEST);
  for (int i = 0; i < study->methods; i++)
    if ((int)strlen (study->method[i]) > conclusion.width) conclusion.width = (int)strlen (study->method[i]);
  conclusion_find_cheapest (&conclusion);
  conclusion_print_heading (&conclusion);
  conclusion_print_table (&conclusion);
  for (int i = 0; i < study->methods; i++) conclusion_print_failures (study, i);
  conclusion_print_limited (study);
}
