/* pinwheel compare: accuracy and cost of methods.  A row is a method with a tolerance or step size: a run with samples
 * and energies gives its errors, further runs without them its processor time. */
#include <float.h>
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>
#include <math.h>
#include <string.h>
#include "motion.h"
#include "study.h"

enum { REFERENCE_CANDIDATES = 4 };

typedef struct {
  pw_motion motion;
  int known;                         /* 0: there is no reference */
  int from_table;                    /* 1: it is the table of --reference */
  int limited;                       /* 1: the limit of processor time has stopped a method that would compute it */
  double uncertainty[MOTION_ERRORS]; /* 0 where nothing is compared */
  double size[MOTION_UNITS];         /* largest coordinate or velocity */
  char gaps[MOTION_GAPS]; /* pw_motion_gaps of the table or, if a computed reference replaces it, of the model's own */
  char name[300];         /* "erk8+projection, rtol 3e-14", "the exact solution of the model" or a path */
  double cpu;             /* processor time of a computed one [s]; else 0 */
  int partners;           /* number of other computed solutions, with their distances from this one */
  struct {
    char name[100];
    double error[MOTION_ERRORS];
  } partner[REFERENCE_CANDIDATES - 1];
} pw_reference;

typedef struct {
  pw_study study;
  int table;     /* 1: --table */
  int concludes; /* 1: a conclusion is printed, since errors of coordinates are known */
  const char *rtol_text, *step_text;
  pw_cli_given repeats_given;
  double finest_step; /* of --step-ladder [s] */
  double repeats;     /* timed runs of a row, at most */
  pw_reference reference;
} pw_compare;

/* Indices in compare_columns.  The counts that pw_study_record_run fills begin with the steps. */
enum {
  COLUMN_LEVEL = 2,
  COLUMN_T = 4,
  COLUMN_ERROR,
  COLUMN_ORDER = COLUMN_ERROR + MOTION_ERRORS + 1,
  COLUMN_POSITION,
  COLUMN_VELOCITY,
  COLUMN_BALANCE,
  COLUMN_STEPS,
  COLUMN_CPU = COLUMN_STEPS + 5,
  COLUMN_SPREAD,
  COLUMN_PERCENT,
  COLUMN_REPEATS
};

static const char *compare_ladder_name (const pw_row *row) {
  return row->adaptive ? "rtol" : "step";
}

static const char *compare_upper_bounds (const pw_row *row) {
  return row->bound_names;
}

static const pw_study_column compare_columns[] = {
  { "method", .text = pw_study_method },
  { "ladder", .text = compare_ladder_name },
  { "rung", NULL, "or step", 10, .format = "%.4g" },
  { "status", .text = pw_study_status },
  { "t", .unit = "s" },
  { "end.length", "m", "m", 10, .format = "%.1e" },
  { "end.angle", "rad", "rad", 10, .format = "%.1e" },
  { "end.speed", .unit = "m/s" },
  { "end.rate", .unit = "rad/s" },
  { "largest.length", "m", "m", 10, .format = "%.1e" },
  { "largest.angle", "rad", "rad", 10, .format = "%.1e" },
  { "largest.speed", .unit = "m/s" },
  { "largest.rate", .unit = "rad/s" },
  { "multiplier", NULL, "multipl.", 10, .format = "%.1e" },
  { "below", .text = compare_upper_bounds },
  { "order", NULL, "order", 6, .format = "%.1f" },
  { "residual.position", NULL, "position", 10, .format = "%.1e" },
  { "residual.velocity", NULL, "velocity", 9, .format = "%.1e" },
  { "balance", "J", "energy J", 10, .format = "%.1e" },
  { "steps", NULL, "steps", 10, .format = "%.0f" },
  { .name = "rejected" },
  { "rhs", NULL, "evaluat.", 10, .format = "%.0f" },
  { "jacobians", NULL, "Jacob.", 8, .format = "%.0f" },
  { "factorisations", NULL, "factor.", 9, .format = "%.0f" },
  { "cpu", "s", "median s", 10, .format = "%.2e" },
  { "spread", .unit = "s" },
  { NULL, NULL, "spread", 7, .format = "%.0f %%" },
  { .name = "repeats" },
};

/* Coordinates of a row's point in the figures; the last two are errors. */
enum { POINT_LEVEL, POINT_CPU, POINT_RHS, POINT_LENGTH, POINT_ANGLE, POINT_COORDINATES };

/* ---- The reference solution: a table, the exact solution of the model, or else a motion computed with a tight
 * tolerance ----
 *
 * The solution of the model is used if it contains all coordinates, its velocities if it contains all of them.
 * Several methods compute one; of the two that agree best, the first is the reference, and their distance is its
 * uncertainty. */

#define REFERENCE_LOOSEST 1e-9 /* the largest tolerance, after failures with smaller ones */
#define REFERENCE_STEPS 1e5    /* the fewest steps of fixed size at first, */
#define REFERENCE_FEWEST 1000  /* and after failures with more steps */
#define REFERENCE_ROUND_OFF 8  /* the smallest uncertainty, in units of round-off of the largest coordinate */

typedef struct {
  pw_visitor base;
  pw_motion *motion;
} sampler;

static int sampler_visit (pw_visitor *visitor, pw_run *run, pw_error *error) {
  pw_motion *motion = ((sampler *)visitor)->motion;
  pw_sample sample;
  while ((visitor->due = pw_motion_next_time (motion)) <= pw_run_time (run)) {
    int status = pw_run_sample (run, visitor->due, &sample, error);
    if (status != PW_OK) return status;
    pw_motion_add (motion, visitor->study->line.m.system, &sample);
    visitor->row->balance = fmax (visitor->row->balance, fabs (sample.balance));
  }
  return PW_OK;
}

/* One run of a row at its level, as pw_study_run.  Stores the samples of a motion and the largest energy balance;
 * motion NULL: without samples, for the measurement of times. */
static int compare_run (pw_study *study, pw_row *row, pw_motion *motion, pw_error *error) {
  sampler visitor = { { .visit = sampler_visit, .study = study, .row = row }, motion };
  pw_settings settings = { .span = study->settings.span, .ledger = motion != NULL };
  *(row->adaptive ? &settings.rtol : &settings.step) = row->level;
  if (motion) row->balance = motion->taken = 0;
  return pw_study_run (study, row, &settings, motion ? &visitor.base : NULL, error);
}

/* The largest |coordinate| and |velocity| of each unit; returns 1 if multipliers are known. */
static int reference_sizes (const pw_system *system, const pw_motion *motion, double size[MOTION_UNITS]) {
  int states = 2 * pw_system_coordinates (system), has_multipliers = 0;
  for (int i = 0; i < MOTION_UNITS; i++) size[i] = 0;
  for (int k = 0; k < motion->taken; k++)
    for (int j = 0; j < motion->width; j++) {
      double value = fabs (pw_motion_at (motion, k)[j]);
      if (pw_system_state_hidden (system, j)) continue;
      if (j >= states)
        has_multipliers |= !isnan (value);
      else
        size[pw_motion_unit (system, j)] = fmax (size[pw_motion_unit (system, j)], value);
    }
  return has_multipliers;
}

/* Raises the uncertainties to round-off; that of multipliers is relative. */
static void reference_raise_uncertainty (const pw_system *system, pw_reference *reference) {
  double *uncertainty = reference->uncertainty;
  int has_multipliers =
      reference_sizes (system, &reference->motion, reference->size) &&
      uncertainty[MOTION_MULTIPLIERS] < 1; /* else never compared, or as uncertain as they are large */
  for (int i = 0; i < MOTION_ERRORS; i++) {
    double size = i < MOTION_MULTIPLIERS ? reference->size[i % MOTION_UNITS] : has_multipliers ? 1 : 0;
    if (i < MOTION_LARGEST)
      uncertainty[i] = uncertainty[i + MOTION_LARGEST]; /* agreement at the end may be accidental */
    uncertainty[i] = fmax (uncertainty[i], REFERENCE_ROUND_OFF * DBL_EPSILON * size);
  }
  if (!has_multipliers) uncertainty[MOTION_MULTIPLIERS] = 0;
}

typedef struct {
  pw_study *study;
  pw_row row;   /* method, and its tolerance or step size */
  int finished; /* 1: the run has reached the end */
  pw_motion motion;
} reference_candidate;

/* Runs candidate i, again with ten times the tolerance or step size if it fails.  PW_RETRY: interrupted. */
static int reference_run (void *context, int i, pw_error *error) {
  reference_candidate *candidate = (reference_candidate *)context + i;
  pw_study *study = candidate->study;
  double loosest = candidate->row.adaptive ? REFERENCE_LOOSEST : study->settings.span / REFERENCE_FEWEST;
  pw_error run_error = { 0 };
  int status =
      pw_motion_open (&candidate->motion, study->line.m.system, NULL, MOTION_SAMPLES, study->settings.span, error);
  if (status != PW_OK) return status;
  status = PW_RETRY;
  while (status != PW_OK && candidate->row.level <= loosest) {
    run_error = (pw_error){ 0 };
    status = compare_run (study, &candidate->row, &candidate->motion, &run_error);
    if (status == PW_OK || pw_stop || candidate->row.state == ROW_STOPPED || status == PW_RESOURCE ||
        status == PW_INITIAL)
      break;
    candidate->row.level *= 10;
  }
  candidate->finished = status == PW_OK;
  pw_study_progress (study, &candidate->row, 1);
  return candidate->finished ? PW_OK : pw_study_record_run (study, &candidate->row, status, &run_error, error);
}

/* The distance of two motions, relative to the size of the first; NaN if it is unknown. */
static double reference_distance (const pw_system *system, const pw_motion *a, const pw_motion *b) {
  double error[MOTION_ERRORS], size[MOTION_UNITS], largest = 0;
  reference_sizes (system, a, size);
  pw_motion_errors (system, a, b, error);
  for (int i = 0; i < MOTION_UNITS; i++) {
    double relative = error[MOTION_LARGEST + i] / (size[i] > 0 ? size[i] : 1);
    if (!isnan (largest) && !(relative <= largest)) largest = relative;
  }
  return largest;
}

static void reference_name (const reference_candidate *candidate, char *text, size_t size) {
  snprintf (text, size, "%s, %s %s%s", candidate->row.method, candidate->row.adaptive ? "rtol" : "step",
            PW_DIGITS (candidate->row.level, 4), candidate->row.adaptive ? "" : " s");
}

/* The two candidates with the smallest distance, with different integrators if possible; 0 if there are none. */
static int reference_pair (const pw_system *system, const reference_candidate *candidates, int *first, int *second) {
  double least = INFINITY;
  for (int same = 0; same < 2 && isinf (least); same++)
    for (int i = 0; i < REFERENCE_CANDIDATES; i++)
      for (int j = i + 1; j < REFERENCE_CANDIDATES; j++) {
        const reference_candidate *a = &candidates[i], *b = &candidates[j];
        int same_integrator = strncmp (a->row.method, b->row.method, strcspn (a->row.method, "+") + 1) == 0;
        if (!a->finished || !b->finished || same_integrator != same) continue;
        double distance = reference_distance (system, &a->motion, &b->motion);
        if (distance < least) least = distance, *first = i, *second = j;
      }
  return isfinite (least);
}

static void reference_add_partner (pw_reference *reference, const pw_system *system, const reference_candidate *best,
                                   const reference_candidate *partner) {
  int i = reference->partners++;
  reference_name (partner, reference->partner[i].name, sizeof reference->partner[i].name);
  pw_motion_errors (system, &best->motion, &partner->motion, reference->partner[i].error);
}

static int reference_compute (pw_reference *reference, pw_study *study, double step, pw_error *error) {
  reference_candidate candidates[REFERENCE_CANDIDATES] = {
    { study, .row = { .method = "erk8+projection", .adaptive = 1, .level = 3e-14 /* the least is 2.2e-14 */ } },
    { study, .row = { .method = "rk4+projection", .level = fmin (step, study->settings.span / REFERENCE_STEPS) } },
    { study, .row = { .method = "ida+ggl", .adaptive = 1, .level = 1e-13 } },
    { study, .row = { .method = "ida+baumgarte", .adaptive = 1, .level = 1e-13 } },
  };
  const pw_system *system = study->line.m.system;
  pw_study_begin_progress (study, "reference", "methods", REFERENCE_CANDIDATES);
  int status = pw_study_parallel (study, REFERENCE_CANDIDATES, reference_run, candidates, error);
  int best = -1, second = -1;
  if (status == PW_OK && reference_pair (system, candidates, &best, &second)) {
    reference->known = 1; /* the first of the two that agree best; the second is its first partner */
    reference_name (&candidates[best], reference->name, sizeof reference->name);
    reference_add_partner (reference, system, &candidates[best], &candidates[second]);
    memcpy (reference->uncertainty, reference->partner[0].error, sizeof reference->uncertainty);
    for (int i = 0; i < REFERENCE_CANDIDATES; i++)
      if (i != best && i != second && candidates[i].finished)
        reference_add_partner (reference, system, &candidates[best], &candidates[i]);
    reference->motion = candidates[best].motion;
    reference->cpu = candidates[best].row.cpu;
    candidates[best].motion = (pw_motion){ .times = 0 };
    reference_raise_uncertainty (system, reference);
  }
  for (int i = 0; i < REFERENCE_CANDIDATES; i++) {
    reference->limited |= candidates[i].row.state == ROW_STOPPED;
    pw_motion_close (&candidates[i].motion);
  }
  return status;
}

/* Finds the reference.  step: the smallest step size of the comparison [s].  Sets the study's span to the end of a
 * table unless --t-end is given.  Close the motion of the reference in every case. */
static int reference_find (pw_reference *reference, pw_study *study, double step, pw_error *error) {
  const char *path = study->reference_path;
  double t_end = path && study->line.t_end.text == NULL ? 0 : study->settings.span; /* 0: that of the table */
  /* the model's solution holds only for its own initial values */
  if (path == NULL && (study->line.starts || !pw_model_has_reference (study->line.m.model)))
    return reference_compute (reference, study, step, error);
  int status = pw_motion_open_reference (&reference->motion, &study->line.m, path, &t_end, error);
  if (status != PW_OK) return status;
  pw_motion_gaps (study->line.m.system, &reference->motion, path ? 1 : reference->motion.times, reference->gaps);
  if (path == NULL && *reference->gaps) {
    pw_motion_close (&reference->motion);
    return reference_compute (reference, study, step, error);
  }
  pw_motion *motion = &reference->motion;
  int n = pw_system_coordinates (study->line.m.system), complete = 1;
  for (int j = n; j < 2 * n && path == NULL; j++) complete &= pw_motion_known (motion, j) == motion->times;
  for (int k = 0; !complete && k < motion->times; k++) /* so that no error is that of a part of the velocities */
    for (int j = n; j < 2 * n; j++) pw_motion_at (motion, k)[j] = NAN;
  double last = motion->t[motion->times - 1];
  if (last < t_end)
    return pw_fail (error, PW_INPUT,
                    "--reference %s: no row at the final time, t = %s s; the last one before it is at %s s", path,
                    PW_DIGITS (t_end, 9), PW_DIGITS (last, 9));
  snprintf (reference->name, sizeof reference->name, "%s", path ? path : "the exact solution of the model");
  study->settings.span = t_end;
  reference->known = 1;
  reference->from_table = path != NULL;
  reference_raise_uncertainty (study->line.m.system, reference);
  return PW_OK;
}

/* Prints the reference, its uncertainty and its distances from the first `partners` other solutions. */
static void reference_print (const pw_reference *reference, int partners) {
  const char *gaps = reference->gaps;
  if (*gaps && !reference->from_table)
    pw_cli_print (stdout, "the model's own reference solution contains at all times %s: a computed one is used\n",
                  gaps);
  if (!reference->known) {
    printf ("no two methods reach the end%s, so errors are unknown; --reference FILE.csv provides a reference\n\n",
            reference->limited ? " within --limit" : "");
    return;
  }
  pw_cli_print (stdout, "errors are measured against %s%s\n", reference->name,
                reference->from_table ? ", as if it were exact" : "");
  if (*gaps && reference->from_table) pw_cli_print (stdout, "  it contains %s\n", gaps);
  for (int i = 0; i < partners && i < reference->partners; i++)
    printf ("  %s agrees with it to %.1e m, %.1e rad%s\n", reference->partner[i].name,
            reference->partner[i].error[MOTION_LARGEST + MOTION_LENGTH],
            reference->partner[i].error[MOTION_LARGEST + MOTION_ANGLE],
            i == 0 ? ": the uncertainty of the reference" : "");
  putchar ('\n');
}

/* Writes FOLDER/truth.csv: the uncertainty of the reference, and its distances from all other solutions. */
static int reference_write (const pw_reference *reference, const char *folder, pw_error *error) {
  pw_output *output = pw_figure_open_file (folder, "truth.csv", error);
  if (output == NULL) return error->status;
  pw_cells line = { .f = pw_output_stream (output) };
  pw_cells_text (&line, "truth,against");
  for (const pw_study_column *c = compare_columns + COLUMN_ERROR; c < compare_columns + COLUMN_ERROR + MOTION_ERRORS;
       c++)
    pw_cells_name (&line, c->name, c->unit);
  pw_cells_end (&line);
  for (int i = -1; reference->known && i < reference->partners; i++) {
    pw_cells_quoted (&line, reference->name);
    pw_cells_quoted (&line, i < 0 ? "uncertainty" : reference->partner[i].name);
    for (int k = 0; k < MOTION_ERRORS; k++)
      pw_cells_number (&line, i < 0 ? reference->uncertainty[k] : reference->partner[i].error[k]);
    pw_cells_end (&line);
  }
  return pw_output_finish (output, error);
}

/* ---- The conclusion: the processor time of each method for the numbers of correct digits in conclusion_required,
 * interpolated on its work-precision curve and relative to the cheapest method; then the runs that failed or were
 * stopped ---- */

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
  const pw_compare *compare;
  double uncertainty;           /* relative, of the reference: its conclusion_error */
  int width;                    /* of columns: that of the longest name of a method */
  int best[CONCLUSION_COLUMNS]; /* the cheapest method; -1: none */
  conclusion_cost cheapest[CONCLUSION_COLUMNS];
} pw_conclusion;

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

/* The least processor time of a method for the required relative error, interpolated between neighbouring runs on
 * logarithmic scales.  It is an upper bound if no run before it was less accurate, if the run just before it failed, so
 * that its error is unknown, or if it is interpolated to an error that is only known to be below the uncertainty. */
static conclusion_cost conclusion_least_cost (const pw_conclusion *conclusion, int method, double required) {
  conclusion_cost least = { NAN, 0 };
  double previous = NAN;
  int less_accurate_before = 0;
  const pw_study *study = &conclusion->compare->study;
  for (const pw_row *row = study->row; row < study->row + study->rows; row++) {
    if (row->curve != method) continue;
    double error = row->state == ROW_DONE
                       ? conclusion_error (&conclusion->compare->reference, row->value + COLUMN_ERROR + MOTION_LARGEST)
                       : NAN;
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

static void conclusion_print_heading (const pw_conclusion *conclusion) {
  static const char *const unit[] = { "m", "rad" }, *const name[] = { "lengths", "angles" };
  const pw_reference *reference = &conclusion->compare->reference;
  const char *between = "";
  printf ("Processor time for ");
  for (int k = 0; k < CONCLUSION_COLUMNS; k++)
    printf ("%s%d", k == 0 ? "" : k + 1 < CONCLUSION_COLUMNS ? ", " : " and ", conclusion_required[k].digits);
  printf (" correct digits, relative to the cheapest method.\n"
          "Digits: the largest error of a coordinate at %d times up to %s s, relative to\n",
          reference->motion.taken, PW_DIGITS (conclusion->compare->study.settings.span, 6));
  for (int i = MOTION_LENGTH; i <= MOTION_ANGLE; i++)
    if (reference->uncertainty[MOTION_LARGEST + i] > 0) {
      printf ("%s%s %s (%s)", between, PW_DIGITS (conclusion_scale (reference, i), 3), unit[i], name[i]);
      between = ", ";
    }
  const double digits = -log10 (conclusion->uncertainty);
  printf (". The reference has %s digits%s.\n\n", digits >= 0.05 ? PW_PRINTED (40, "%.1f", digits) : "no correct",
          conclusion->compare->study.reference_path ? " if its table is exact" : "");
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
    printf ("  %*s", conclusion->width,
            conclusion->best[k] < 0 ? "-" : conclusion->compare->study.method[conclusion->best[k]]);
  printf ("\n%-*s", conclusion->width, "its time");
  for (int k = 0; k < CONCLUSION_COLUMNS; k++)
    printf ("  %*s", conclusion->width, conclusion_format_time (text, conclusion->cheapest[k]));
  for (int i = 0; i < conclusion->compare->study.methods; i++) {
    printf ("\n%-*s", conclusion->width, conclusion->compare->study.method[i]);
    for (int k = 0; k < CONCLUSION_COLUMNS; k++) {
      printf ("  %*s", conclusion->width, conclusion_format_ratio (text, conclusion, i, k));
      bounds |= *text == '<';
      any_uncertain |= *text == 'u';
    }
  }
  puts (bounds ? "\n< marks an upper bound: the least accurate run has more digits already, or a run next to it failed "
                 "or is as\n"
                 "accurate as the reference"
               : "");
  if (any_uncertain) puts ("uncertain: the reference is not accurate enough to distinguish methods");
}

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

static void conclusion_print (const pw_compare *compare) {
  const pw_study *study = &compare->study;
  const pw_reference *reference = &compare->reference;
  pw_conclusion conclusion = { .compare = compare, .width = CONCLUSION_WIDTH };
  conclusion.uncertainty = conclusion_error (reference, reference->uncertainty + MOTION_LARGEST);
  for (int i = 0; i < study->methods; i++)
    if ((int)strlen (study->method[i]) > conclusion.width) conclusion.width = (int)strlen (study->method[i]);
  /* the cheapest method of each column for which the reference is accurate enough */
  for (int k = 0; k < CONCLUSION_COLUMNS; k++) {
    conclusion.best[k] = -1;
    conclusion.cheapest[k].cpu = NAN;
    for (int i = 0; i < study->methods && conclusion.uncertainty <= conclusion_required[k].error; i++) {
      conclusion_cost candidate = conclusion_least_cost (&conclusion, i, conclusion_required[k].error);
      if (isnan (candidate.cpu) || conclusion.cheapest[k].cpu <= candidate.cpu) continue;
      conclusion.cheapest[k] = candidate;
      conclusion.best[k] = i;
    }
  }
  conclusion_print_heading (&conclusion);
  conclusion_print_table (&conclusion);
  for (int i = 0; i < study->methods; i++) {
    const pw_row *first, *any;
    int failures = conclusion_count_runs (study, i, RUNS_FAILED, &first);
    if (first == NULL) continue;
    int cut = strlen (first->reason) > CONCLUSION_REASON;
    pw_cli_print (stdout, "%s: %d of %d runs %s, first at %s %s: %.*s%s\n", first->method, failures,
                  conclusion_count_runs (study, i, RUNS_ALL, &any), first->state == ROW_FAILED ? "fail" : "are refused",
                  first->adaptive ? "rtol" : "step", PW_DIGITS (first->level, 4), CONCLUSION_REASON, first->reason,
                  cut ? "..." : "");
  }
  /* one line for all methods with runs that the limit has stopped or prevented */
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

/* ---- The rows ---- */

enum { COMPARE_REPEATS = 99 }; /* the largest value of --repeats */
#define COMPARE_FEW 3          /* timed runs of a row that suffice if their times agree or are long */
#define COMPARE_FEWEST 2       /* those that suffice if their times agree and are long */
#define COMPARE_QUIET 0.05     /* largest spread of times that agree, over the least one */
#define COMPARE_ENOUGH 0.1     /* sum of times [s] that are long */
#define COMPARE_HOPELESS 100   /* cost of a run over that of the reference, from which on it is abandoned */
#define COMPARE_CLEAR 10   /* error over uncertainty of the reference, so that orders are accurate to log2 1.1 = 0.14 */
#define COMPARE_AGREE 0.1  /* largest relative difference of the last two orders in the asymptotic range */
#define COMPARE_DECADE 1.6 /* factor of the cost if a tolerance is divided by ten, of a method of order 5: 10^(1/5) */

/* Explicit and implicit, one-step and multistep methods, each with the stabilisation that suits it. */
static const char compare_default_methods[] = "rk4+projection,erk5+projection,erk8+projection,bdf+projection,"
                                              "ida+baumgarte,ida+ggl,radau+ggl,galpha+index3";

/* ---- Ladders: the tolerances or step sizes of a method ---- */

typedef struct {
  double from, to; /* from >= to > 0 */
} compare_ladder;

/* "FROM:TO", in either order, or a single level. */
static int compare_read_ladder (const char *option, const char *text, compare_ladder *ladder, pw_error *error) {
  if (text == NULL) return PW_OK;
  char first[40];
  size_t n = strcspn (text, ":");
  if (n >= sizeof first || strlen (text + n) > sizeof first)
    return pw_fail (error, PW_INPUT, "%s %.80s: expected FROM:TO", option, text);
  snprintf (first, sizeof first, "%.*s", (int)n, text);
  double from = 0, to = 0;
  int status = pw_cli_number (option, first, PW_POSITIVE, &from, error);
  if (status == PW_OK) status = pw_cli_number (option, text[n] ? text + n + 1 : first, PW_POSITIVE, &to, error);
  if (status != PW_OK) return status;
  *ladder = (compare_ladder){ fmax (from, to), fmin (from, to) };
  if (ladder->from / ladder->to > 1e30) return pw_fail (error, PW_INPUT, "%s %.80s: too long a ladder", option, text);
  return PW_OK;
}

/* Level i of a ladder, or 0 after its end; steps are halved, tolerances divided by ten and rounded to 12 digits. */
static double compare_level (compare_ladder ladder, int adaptive, int i) {
  double level = ldexp (ladder.from, -i);
  if (adaptive) pw_read_number (PW_DIGITS (ladder.from / pow (10, i), 12), &level);
  return level >= ladder.to * (1 - 1e-9) ? level : 0;
}

/* All rows are one group; those of a method are a curve, with a point each. */
enum { COMPARE_GROUP = 0, COMPARE_POINTS = 1 };

static int compare_plan_rows (pw_study *study, const compare_ladder ladders[2], pw_error *error) {
  for (int i = 0; i < study->methods; i++) {
    int adaptive = pw_cli_adaptive (study->line.methods, study->method[i]);
    double level;
    for (int k = 0; (level = compare_level (ladders[adaptive], adaptive, k)) > 0; k++) {
      pw_row *row = pw_study_add (study, COMPARE_GROUP, i, study->method[i], COMPARE_POINTS, error);
      if (row == NULL) return PW_RESOURCE;
      row->adaptive = adaptive;
      row->coarser_levels = k;
      row->level = row->value[COLUMN_LEVEL] = level;
      row->value[COLUMN_REPEATS] = 0;
    }
  }
  return PW_OK;
}

static int compare_plan (pw_study *study, pw_error *error) {
  pw_compare *compare = (pw_compare *)study;
  compare_ladder ladders[2] = { { 0.1, 1e-4 }, { 1e-3, 1e-12 } }; /* steps, tolerances */
  study->settings.span = pw_cli_given_or (study->line.t_end, study->line.m.defaults.t_end);
  study->cpu_limit = pw_cli_given_or (study->line.limit, 10);
  compare->repeats = pw_cli_given_or (compare->repeats_given, 9);
  if (compare->repeats > COMPARE_REPEATS)
    return pw_fail (error, PW_INPUT, "--repeats %s: at most %d", compare->repeats_given.text, COMPARE_REPEATS);
  int status = pw_study_read_methods (study, compare_default_methods, error);
  if (status == PW_OK) status = compare_read_ladder ("--step-ladder", compare->step_text, &ladders[0], error);
  if (status == PW_OK) status = compare_read_ladder ("--rtol-ladder", compare->rtol_text, &ladders[1], error);
  study->limit.seconds = study->cpu_limit;
  compare->finest_step = ladders[0].to;
  return status == PW_OK ? compare_plan_rows (study, ladders, error) : status;
}

/* ---- A row ---- */

/* Errors below the uncertainty of the reference are replaced by it, and marked. */
static void compare_set_errors (const pw_compare *compare, const pw_motion *motion, pw_row *row) {
  const pw_reference *reference = &compare->reference;
  double *error = &row->value[COLUMN_ERROR];
  if (!reference->known) return;
  pw_motion_errors (compare->study.line.m.system, &reference->motion, motion, error);
  for (int i = 0; i < MOTION_ERRORS; i++) {
    if (reference->uncertainty[i] == 0) error[i] = NAN;
    if (!(error[i] <= reference->uncertainty[i])) continue;
    error[i] = reference->uncertainty[i];
    row->upper_bounds |= 1u << (COLUMN_ERROR + i);
    strcat (strcat (row->bound_names, *row->bound_names ? " " : ""), compare_columns[COLUMN_ERROR + i].name);
  }
}

/* The order p of a row and the coarser one before it, with twice the step h, from error ~ h^p, with the largest error
 * of lengths or, if that is unknown, of angles.  NaN if an error is unknown, or if that of the row is less than
 * COMPARE_CLEAR times the uncertainty. */
static double compare_pair_order (const pw_compare *compare, const pw_row *row) {
  const pw_row *coarser = row - 1;
  const double *error = &row->value[COLUMN_ERROR];
  int error_index = isnan (error[MOTION_LARGEST]) ? MOTION_LARGEST + MOTION_ANGLE : MOTION_LARGEST;
  int known = coarser->state == ROW_DONE && row->state == ROW_DONE &&
              error[error_index] > COMPARE_CLEAR * compare->reference.uncertainty[error_index];
  return known ? log2 (coarser->value[COLUMN_ERROR + error_index] / error[error_index]) : NAN;
}

/* The observed order of convergence: only of fixed steps and in the asymptotic range, where the last two orders agree
 * and errors are well above the uncertainty of the reference; else NaN. */
static double compare_order (const pw_compare *compare, const pw_row *row) {
  if (row->adaptive || row->coarser_levels < 2) return NAN;
  double order = compare_pair_order (compare, row), coarser_order = compare_pair_order (compare, row - 1);
  return order > 0 && fabs (order - coarser_order) <= COMPARE_AGREE * order ? order : NAN;
}

/* Measures runs without samples; the processor time of the row is their median. */
static int compare_measure_times (pw_compare *compare, pw_row *row, pw_error *error) {
  double cpu[COMPARE_REPEATS], sum = 0;
  int n = 0;
  while (n < compare->repeats && sum <= compare->study.cpu_limit) {
    int status = compare_run (&compare->study, row, NULL, error);
    if (status != PW_OK) return status;
    sum += cpu[n++] = row->cpu;
    gsl_sort (cpu, 1, (size_t)n);
    const int agree = cpu[n - 1] - cpu[0] <= COMPARE_QUIET * cpu[0], is_long = sum > COMPARE_ENOUGH;
    const int enough = (n >= COMPARE_FEW && (agree || is_long)) || (n >= COMPARE_FEWEST && agree && is_long);
    if (enough && compare->repeats_given.text == NULL) break;
  }
  row->cpu = gsl_stats_median_from_sorted_data (cpu, 1, (size_t)n);
  row->value[COLUMN_REPEATS] = n;
  if (n < 2) return PW_OK;
  row->value[COLUMN_SPREAD] = cpu[n - 1] - cpu[0];
  row->value[COLUMN_PERCENT] = 100 * row->value[COLUMN_SPREAD] / row->cpu;
  return PW_OK;
}

/* The processor time [s] of a row, predicted from the coarser levels of its method: a halved step doubles it; a
 * tolerance divided by ten costs the factor that the last one did, at first COMPARE_DECADE.  INFINITY after a run that
 * was stopped or skipped; 0, not predicted, for the first level and after a failure. */
static double compare_predicted_time (const pw_row *row) {
  const pw_row *coarser = row - 1;
  if (row->coarser_levels == 0 || coarser->state == ROW_FAILED || coarser->state == ROW_REFUSED) return 0;
  if (coarser->state != ROW_DONE) return INFINITY;
  if (!row->adaptive) return 2 * coarser->cpu;
  if (row->coarser_levels < 2 || coarser[-1].state != ROW_DONE) return COMPARE_DECADE * coarser->cpu;
  return fmax (coarser->cpu / coarser[-1].cpu, 1) * coarser->cpu;
}

static int compare_measure (pw_study *study, pw_row *row, pw_error *error) {
  pw_compare *compare = (pw_compare *)study;
  pw_error run_error = { 0 };
  double predicted = compare_predicted_time (row);
  const char *limit = PW_DIGITS (study->cpu_limit, 4);
  if (predicted > study->cpu_limit) {
    row->state = ROW_SKIPPED;
    const char *text = isfinite (predicted) ? PW_PRINTED (60, ", about %.2g s", predicted) : "";
    snprintf (row->reason, sizeof row->reason, "too slow%s; the limit is %s s", text, limit);
    return PW_OK;
  }
  row->balance = NAN;
  pw_motion motion; /* at the times of the reference */
  int status =
      pw_motion_open (&motion, study->line.m.system, compare->reference.known ? &compare->reference.motion : NULL,
                      MOTION_SAMPLES, study->settings.span, &run_error);
  if (status == PW_OK) status = compare_run (study, row, &motion, &run_error);
  if (status == PW_OK) compare_set_errors (compare, &motion, row);
  pw_motion_close (&motion);
  if (status == PW_OK) status = compare_measure_times (compare, row, &run_error);
  if (row->state == ROW_STOPPED)
    snprintf (row->reason, sizeof row->reason, "too slow: the limit of %s s was reached at t = %s s", limit,
              PW_DIGITS (row->t, 4));
  status = pw_study_record_run (study, row, status, &run_error, error);
  row->value[COLUMN_ORDER] = compare_order (compare, row);
  if (row->state != ROW_REFUSED) {
    row->value[COLUMN_POSITION] = row->statistics.position;
    row->value[COLUMN_VELOCITY] = row->statistics.velocity;
    row->value[COLUMN_BALANCE] = row->balance;
  }
  row->value[COLUMN_CPU] = row->cpu;
  const double *largest = &row->value[COLUMN_ERROR + MOTION_LARGEST];
  const double point[] = { row->level, row->cpu, (double)row->statistics.rhs, largest[MOTION_LENGTH],
                           largest[MOTION_ANGLE] };
  if (row->state == ROW_DONE) memcpy (row->point, point, sizeof point);
  return status;
}

/* ---- The command ---- */

static int compare_begin (pw_study *study, pw_error *error) {
  pw_compare *compare = (pw_compare *)study;
  int status = reference_find (&compare->reference, study, compare->finest_step, error);
  if (status == PW_OK && study->folder) status = reference_write (&compare->reference, study->folder, error);
  if (status != PW_OK) return status;
  if (study->line.limit.text == NULL && compare->reference.cpu > 0)
    study->cpu_limit = fmin (study->cpu_limit, fmax (COMPARE_ENOUGH, COMPARE_HOPELESS * compare->reference.cpu));
  study->limit.seconds = study->cpu_limit;
  study->run_share = 1 / (compare->repeats + 1);
  const double *largest = compare->reference.uncertainty + MOTION_LARGEST;
  compare->concludes = compare->reference.known && (largest[MOTION_LENGTH] > 0 || largest[MOTION_ANGLE] > 0);
  study->quiet = compare->concludes && !compare->table;
  reference_print (&compare->reference, compare->table ? REFERENCE_CANDIDATES : 1);
  return PW_OK;
}

static void compare_conclude (const pw_study *study) {
  const pw_compare *compare = (const pw_compare *)study;
  if (compare->concludes && compare->table) putchar ('\n');
  if (compare->concludes) conclusion_print (compare);
}

/* Work-precision diagrams of lengths and of angles, if their errors are known; errors above the size of the motion mean
 * nothing. */
static int compare_figures (pw_study *study, pw_error *error) {
  static const char *const name[] = { "work-precision", "work-precision-angles" },
                           *const title[] = { "work-precision diagram", "work-precision diagram of angles" },
                           *const axis[] = { "CPU time [s]", "right-hand side evaluations" },
                           *const label[] = { "largest error of a coordinate [m]", "largest error of an angle [rad]" };
  const pw_reference *reference = &((pw_compare *)study)->reference;
  int status = PW_OK;
  for (int unit = 0; status == PW_OK && unit < 2; unit++) {
    const double uncertainty = reference->uncertainty[MOTION_LARGEST + unit];
    double least = INFINITY, most = 0;
    pw_curves c;
    for (const pw_row *row = study->row; row < study->row + study->rows; row++) {
      const double e = row->state == ROW_DONE ? row->point[0][POINT_LENGTH + unit] : NAN;
      if (e > 0 && isfinite (e)) least = fmin (least, e), most = fmax (most, e);
    }
    status = pw_curves_open (&c, &study->line, study->folder, name[unit], title[unit], error);
    for (int k = 0; status == PW_OK && k < 2; k++) {
      pw_curves_panel (&c, &(pw_panel){ .x_label = axis[k],
                                        .y_label = label[unit],
                                        .y = { least / 4, fmin (3 * most, fmax (10 * least, reference->size[unit])) },
                                        .aspect = 1.05,
                                        .type = PW_PANEL_HALF | PW_PANEL_LOG_X | PW_PANEL_LOG_Y });
      if (uncertainty > least / 4) {
        pw_curves_add (&c, "band", "below the uncertainty of the reference");
        pw_curves_point (&c, INFINITY, uncertainty, 0);
      }
      pw_study_add_curves (study, COMPARE_GROUP, &c, POINT_CPU + k, POINT_LENGTH + unit);
    }
    if (status == PW_OK) status = pw_study_close_figure (study, &c, error);
  }
  return status;
}

static void compare_close (pw_study *study) {
  pw_motion_close (&((pw_compare *)study)->reference.motion);
}

static int compare_command (void *options, pw_error *error) {
  static const char *const group[] = { "" };
  static const pw_study_type type = {
    .table_names = { "compare.csv", "truth.csv" },
    .row_noun = "rows",
    .group = group,
    .heading_above =
        "      rtol  error at the end    largest error       error of        residual of        error of     "
        "                                  CPU time",
    .column = compare_columns,
    .columns = sizeof compare_columns / sizeof *compare_columns,
    .runs_per_row = 9,
    .timed = 1,
    .time_column = COLUMN_T,
    .first_count_column = COLUMN_STEPS,
    .plan = compare_plan,
    .begin = compare_begin,
    .measure = compare_measure,
    .conclude = compare_conclude,
    .figures = compare_figures,
    .close = compare_close
  };
  return pw_study_command (options, &type, error);
}

static const struct poptOption compare_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_STUDY_METHODS_OPTION ("default: eight representative ones"),
  PW_FLAG_OPTION (pw_compare, table, "table", "Print every run, not only the conclusion"),
  PW_TEXT_OPTION (pw_compare, rtol_text, "rtol-ladder", 0, "FROM:TO",
                  "Tolerances of adaptive methods, by decades (default 1e-3:1e-12)"),
  PW_TEXT_OPTION (pw_compare, step_text, "step-ladder", 0, "FROM:TO",
                  "Step sizes of fixed-step methods [s], halved each time (default 0.1:1e-4)"),
  PW_NUMBER_OPTION (
      pw_cli_line, limit, "limit", 0, "SECONDS", PW_POSITIVE,
      "Processor time of a single run; runs expected to take longer are skipped (default 10, at most 100 times "
      "that of a computed reference)"),
  PW_NUMBER_OPTION (
      pw_compare, repeats_given, "repeats", 0, "N", PW_COUNT,
      "Timed repetitions of each run, at most 99, of which the median is reported (default: 3 that agree to 5 %, "
      "else up to 9 within a tenth of a second; 2 of long runs)"),
  PW_JOBS_OPTION ("Number of methods that run at a time, each on a physical core of its own (default: all cores)"),
  PW_NUMBER_OPTION (pw_cli_line, t_end, "t-end", 't', "T", PW_POSITIVE, "Final time [s]"),
  PW_ENGINE_OPTION,
  PW_TEXT_OPTION (
      pw_study, reference_path, "reference", 0, "FILE.csv",
      "Measure errors against this table, with columns as in run -o, instead of the model's exact solution or a "
      "computed reference"),
  PW_ALIAS_OPTION (pw_study, reference_path, "truth"),
  PW_TEXT_OPTION (pw_study, table_path, "output", 'o', "FILE.csv", "Write the table of all runs"),
  PW_TEXT_OPTION (pw_study, folder, "plots", 0, "DIR", "Write tables and work-precision diagrams into a folder"),
  PW_WIDTH_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_compare = {
  .name = "compare",
  .synopsis = "MODEL [OPTION...]",
  .summary = "compare the accuracy and cost of methods against a reference solution",
  .help = "Run a model by several methods, each with a ladder of tolerances or step sizes, and compare their errors "
          "against a reference solution with their processor times.",
  .options_size = sizeof (pw_compare),
  .function = compare_command,
  .options = compare_options,
};
