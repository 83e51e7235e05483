/* Finds, prints and writes the reference solution of a comparison. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "reference.h"

#define REFERENCE_LOOSEST 1e-9 /* the largest tolerance, after failures with smaller ones */
#define REFERENCE_STEPS 1e5    /* the fewest steps of fixed size at first, */
#define REFERENCE_FEWEST 1000  /* and after failures with more steps */
#define REFERENCE_ROUND_OFF 8  /* the smallest uncertainty, in units of round-off of the largest coordinate */

/* ---- Runs ---- */

typedef struct {
  pw_visitor base;
  pw_motion *motion;
} sampler;

/* Stores the samples up to the time reached. */
static int sampler_visit (pw_visitor *visitor, pw_run *run, pw_error *error) {
  pw_motion *motion = ((sampler *)visitor)->motion;
  pw_sample sample;
  while ((visitor->due = pw_motion_next_time (motion)) <= pw_run_time (run)) {
    int status = pw_run_sample (run, visitor->due, &sample, error);
    if (status != PW_OK) return status;
    pw_motion_add (motion, visitor->study->compiled.system, &sample);
    visitor->row->balance = fmax (visitor->row->balance, fabs (sample.balance));
  }
  return PW_OK;
}

int pw_motion_run (pw_study *study, pw_row *row, pw_motion *motion, pw_error *error) {
  sampler visitor = { { .visit = sampler_visit, .study = study, .row = row }, motion };
  pw_settings settings = { .span = study->t_end, .ledger = motion != NULL };
  *(row->adaptive ? &settings.rtol : &settings.step) = row->level;
  if (motion) row->balance = motion->taken = 0;
  return pw_study_run (study, row, &settings, motion ? &visitor.base : NULL, error);
}

/* ---- Uncertainty ---- */

/* The largest |coordinate| and |velocity| of each unit; returns 1 if multipliers are known. */
static int reference_sizes (const pw_system *system, const pw_motion *motion, double size[MOTION_UNITS]) {
  int states = 2 * pw_system_coordinates (system), has_multipliers = 0;
  for (int i = 0; i < MOTION_UNITS; i++) size[i] = 0;
  for (int k = 0; k < motion->taken; k++)
    for (int j = 0; j < motion->width; j++) {
      double value = fabs (pw_motion_at (motion, k)[j]);
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

/* ---- Candidates ---- */

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
  double loosest = candidate->row.adaptive ? REFERENCE_LOOSEST : study->t_end / REFERENCE_FEWEST;
  pw_error run_error = { 0 };
  int status = pw_motion_open (&candidate->motion, study->compiled.system, MOTION_SAMPLES, study->t_end, error);
  if (status != PW_OK) return status;
  status = PW_RETRY;
  while (status != PW_OK && candidate->row.level <= loosest) {
    run_error = (pw_error){ 0 };
    status = pw_motion_run (study, &candidate->row, &candidate->motion, &run_error);
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

/* 1 if two methods have the same integrator. */
static int reference_same_integrator (const reference_candidate *a, const reference_candidate *b) {
  size_t n = strcspn (a->row.method, "+");
  return strncmp (a->row.method, b->row.method, n + 1) == 0;
}

/* The two candidates with the smallest distance, with different integrators if possible; 0 if there are none. */
static int reference_pair (const pw_system *system, const reference_candidate *candidates, int *first, int *second) {
  double least = INFINITY;
  for (int same = 0; same < 2 && isinf (least); same++)
    for (int i = 0; i < REFERENCE_CANDIDATES; i++)
      for (int j = i + 1; j < REFERENCE_CANDIDATES; j++) {
        const reference_candidate *a = &candidates[i], *b = &candidates[j];
        if (!a->finished || !b->finished || reference_same_integrator (a, b) != same) continue;
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

/* Selects the reference: the first of the two candidates that agree best.  The second is its first partner. */
static void reference_choose (pw_reference *reference, const pw_system *system, reference_candidate *list) {
  int best = -1, second = -1;
  if (!reference_pair (system, list, &best, &second)) return;
  reference->known = 1;
  reference_name (&list[best], reference->name, sizeof reference->name);
  reference_add_partner (reference, system, &list[best], &list[second]);
  memcpy (reference->uncertainty, reference->partner[0].error, sizeof reference->uncertainty);
  for (int i = 0; i < REFERENCE_CANDIDATES; i++)
    if (i != best && i != second && list[i].finished) reference_add_partner (reference, system, &list[best], &list[i]);
  reference->motion = list[best].motion;
  list[best].motion = (pw_motion){ .times = 0 };
  reference_raise_uncertainty (system, reference);
}

static int reference_compute (pw_reference *reference, pw_study *study, double step, pw_error *error) {
  reference_candidate candidates[REFERENCE_CANDIDATES] = {
    { study, .row = { .method = "erk8+projection", .adaptive = 1, .level = 3e-14 /* the least is 2.2e-14 */ } },
    { study, .row = { .method = "rk4+projection", .level = fmin (step, study->t_end / REFERENCE_STEPS) } },
    { study, .row = { .method = "ida+ggl", .adaptive = 1, .level = 1e-13 } },
    { study, .row = { .method = "ida+baumgarte", .adaptive = 1, .level = 1e-13 } },
  };
  pw_study_begin_progress (study, "reference", "methods", REFERENCE_CANDIDATES);
  int status = pw_study_parallel (study, REFERENCE_CANDIDATES, reference_run, candidates, error);
  if (status == PW_OK) reference_choose (reference, study->compiled.system, candidates);
  for (int i = 0; i < REFERENCE_CANDIDATES; i++) {
    reference->limited |= candidates[i].row.state == ROW_STOPPED;
    pw_motion_close (&candidates[i].motion);
  }
  return status;
}

/* Makes all velocities unknown if any is, so that no error is that of a part of them. */
static void reference_complete_velocities (const pw_system *system, pw_motion *motion) {
  int n = pw_system_coordinates (system), complete = 1;
  for (int j = n; j < 2 * n; j++) complete &= pw_motion_known (motion, j) == motion->times;
  for (int k = 0; !complete && k < motion->times; k++)
    for (int j = n; j < 2 * n; j++) pw_motion_at (motion, k)[j] = NAN;
}

int pw_reference_find (pw_reference *reference, pw_study *study, double step, pw_error *error) {
  const char *path = study->reference_path;
  double t_end = path && study->line.t_end == NULL ? 0 : study->t_end; /* 0: that of the table */
  /* the model's solution holds only for its own initial values */
  if (path == NULL && (study->line.starts || !pw_model_has_reference (study->compiled.model)))
    return reference_compute (reference, study, step, error);
  int status = pw_motion_open_reference (&reference->motion, &study->compiled, path, &t_end, error);
  if (status != PW_OK) return status;
  pw_motion_gaps (study->compiled.system, &reference->motion, path ? 1 : reference->motion.times, reference->gaps);
  if (path == NULL && *reference->gaps) {
    pw_motion_close (&reference->motion);
    return reference_compute (reference, study, step, error);
  }
  if (path == NULL) reference_complete_velocities (study->compiled.system, &reference->motion);
  double last = reference->motion.t[reference->motion.times - 1];
  if (last < t_end)
    return pw_fail (error, PW_INPUT,
                    "--reference %s: no row at the final time, t = %s s; the last one before it is at %s s", path,
                    PW_DIGITS (t_end, 9), PW_DIGITS (last, 9));
  snprintf (reference->name, sizeof reference->name, "%s", path ? path : "the exact solution of the model");
  study->t_end = t_end;
  reference->known = 1;
  reference->from_table = path != NULL;
  reference_raise_uncertainty (study->compiled.system, reference);
  return PW_OK;
}

/* ---- Output ---- */

void pw_reference_print (const pw_reference *reference, int partners) {
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

int pw_reference_write (const pw_reference *reference, const char *folder, const pw_study_column *error_columns,
                        pw_error *error) {
  pw_output *output = pw_figure_open_file (folder, "truth.csv", error);
  if (output == NULL) return error->status;
  FILE *f = pw_output_stream (output);
  pw_text line = { .chars = NULL };
  pw_text_cell (&line, "truth,against");
  for (int k = 0; k < MOTION_ERRORS; k++) pw_text_name (&line, error_columns[k].name, error_columns[k].unit);
  int status = pw_text_line (&line, f, folder, error);
  for (int i = -1; status == PW_OK && reference->known && i < reference->partners; i++) {
    pw_text_quoted (&line, reference->name);
    pw_text_quoted (&line, i < 0 ? "uncertainty" : reference->partner[i].name);
    for (int k = 0; k < MOTION_ERRORS; k++)
      pw_text_number (&line, i < 0 ? reference->uncertainty[k] : reference->partner[i].error[k]);
    status = pw_text_line (&line, f, folder, error);
  }
  return pw_cli_close_table (output, status, error);
}
