/* Compares a run with a reference solution: opens the reference, and computes the errors of the run at its times. */
#include <string.h>
#include "motion.h"

int pw_comparison_open (pw_comparison *comparison, const pw_cli_model *compiled, const char *path, int started,
                        double t_end, pw_error *error) {
  *comparison = (pw_comparison){ .errors = { .source = path ? path : "the model" } };
  if (path == NULL && !pw_model_has_reference (compiled->model)) return PW_OK;
  if (path == NULL && started) {
    pw_cli_say (
        "pinwheel: the model's reference solution holds for its own initial values: with --start errors are not "
        "computed\n");
    return PW_OK;
  }
  int status = pw_motion_open_reference (&comparison->reference, compiled, path, &t_end, error);
  if (status != PW_OK) return status;
  pw_motion_gaps (compiled->system, &comparison->reference, 1, comparison->gaps);
  return pw_motion_open_at (&comparison->motion, compiled->system, &comparison->reference, error);
}

void pw_comparison_close (pw_comparison *comparison) {
  pw_motion_close (&comparison->reference);
  pw_motion_close (&comparison->motion);
}

void pw_comparison_serialise (pw_comparison *comparison, pw_archive *archive) {
  pw_motion *motion = &comparison->motion;
  int taken = motion->taken;
  if (motion->times == 0) return;
  pw_archive_bytes (archive, &taken, sizeof taken);
  if (taken < 0 || taken > motion->times) archive->failed = 1;
  if (archive->failed) return;
  motion->taken = taken;
  pw_archive_bytes (archive, motion->value, (size_t)taken * (size_t)motion->width * sizeof *motion->value);
}

const pw_reference_error *pw_comparison_errors (pw_comparison *comparison, const pw_system *system) {
  double error[MOTION_ERRORS];
  pw_motion *motion = &comparison->motion;
  pw_reference_error *errors = &comparison->errors;
  if (motion->taken == 0) return NULL;
  pw_motion_errors (system, &comparison->reference, motion, error);
  errors->samples = motion->taken;
  errors->t = motion->t[motion->taken - 1];
  memcpy (errors->end, error + MOTION_END, sizeof errors->end);
  memcpy (errors->most, error + MOTION_LARGEST, sizeof errors->most);
  errors->reactions = error[MOTION_MULTIPLIERS];
  return errors;
}
