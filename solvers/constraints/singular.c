/* The watchdog's thresholds, and the sine that measures how far the constraints are from a singular configuration; see
 * watchdog.h. */
#include <math.h>
#include <stdlib.h>
#include "method.h"
#include "rank.h"
#include "util.h"

/* s: the sine; d: the scaled constraint residual; eps: the machine precision.  Where branches cross, the constraints
 * are x y = 0 in suitable coordinates, and s = |(x, y)|; with a residual d, x y = d: each branch turns, most sharply
 * where s^2 = 2 d. */
const pw_thresholds pw_watchdog_thresholds = {
  /* A motion with residuals of 1 % is wrong; without stabilisation some drift is expected. */
  .lost = 1e-2,
  .lost_unstabilised = 0.1,

  /* A redundant row follows from the others up to a round-off of some 5e6 eps, or up to their residuals divided by a
   * sine as small as 1e-4. */
  .redundant_residual = 1e-9,
  .redundant_ratio = 1e4,

  /* rank_lost: round-off leaves sqrt (eps) = 1.5e-8 of a row that depends on others; below 1e-6 accelerations, with an
   * error of eps / s after refinement, are wrong by more than 1e-10.  rank_refused: round-off leaves up to 1e-5 of a
   * row that depends on rows which are nearly dependent themselves.  rank_suspect: a hundred times rank_refused. */
  .rank_lost = 1e-6,
  .rank_suspect = 1e-3,
  .rank_refused = 1e-5,

  /* Residuals of 1e-16 leave an error of 1e-8 in a sine; ten times that. */
  .independent = 1e-7,

  /* A stage of a step by an angle h has a residual of about h^2 / 8, which decides on the branch unless s^2 is much
   * larger: with steps of 1e-3 s at a few rad/s, up to s of 0.02.  A factorisation has an error of eps / s^2, 5e-13 at
   * 0.02. */
  .near = 0.02,
  .refine = 0.02,

  /* Drift: measured on four-bar linkages and slider-cranks, d / s^2 is 0.08 to 0.34 where the turn is sharpest;
   * accelerations, at least turn_reference L / T^2, have grown by a factor of 3 when it is 0.02 to 0.07 (drift_turn).
   * From half of that on (drift_near) they are no reference for later ones.  Where d itself counts as lost (drift_far),
   * d / s^2 must be below its value in the sharpest turn (drift_any), whatever the accelerations.  Above `regular`
   * times its largest value the sine is not that of a singular configuration, however large the drift. */
  .regular = 0.6,
  .turn_growth = 3,
  .turn_reference = 0.1,
  .drift_turn = 0.02,
  .drift_near = 0.01,
  .drift_far = 1e-2,
  .drift_any = 0.1,

  /* Nonholonomic rows: accelerations do not grow when the motion passes a singular configuration; in a jump at the sine
   * s they reach 1 / s: 100 at half of `near`. */
  .jump_growth = 100,

  /* The direction of a row of length 1 turns by at most an angle of 1 per rad, and that of the rows before it, too.  No
   * step is taken to be more than twice as long as the last one. */
  .lipschitz = 2,
  .step_growth = 2,

  /* Change points (change_point.c): a sine within a step below an eighth of those at its ends belongs to a turn that
   * the step cannot resolve; half of them indicates that there may be one.  Strides of 0.3 times the sine stay on a
   * curve whose radius is the sine.  A stride that approaches its destination by less than a tenth of its length leads
   * elsewhere. */
  .unresolved = 0.125,
  .low = 0.5,
  .stride = 0.3,
  .progress = 0.1,

  /* The projection leaves residuals of 1e-14, which leave an error of 1e-7 in the sine: below `floor`, ten times that,
   * it cannot be distinguished from 0 (`crossing`: twice that, since a stride ends within `floor` of its destination).
   * Such a point must be left straight on, within 60 degrees of the direction in which it was entered. */
  .floor = 1e-6,
  .crossing = 2e-6,
  .straight = 0.5,

  /* Methods of order 2 have an error of (0.4)^2 / 12 = 1 % at a turn that takes 1 / 0.4 steps. */
  .resolved = 0.4,

  /* Results of the same step divided into parts, differently each time, near a singular configuration mostly agree to
   * 1e-11; those that differ by more than the error of a good step, 1e-7, do not agree. */
  .agree = 1e-7,
  .agree_best = 1e-11,

  /* A step that ends within a tenth of its length from a singular configuration: the accelerations, whose error is that
   * of the state over the sine, are ten times less accurate than at its beginning. */
  .ends_singular = 0.1,

  /* A sample does not affect the next step: an error of 0.01 L or 0.01 rad is acceptable. */
  .sample = 1e-2,
  .sample_best = 1e-9,

  /* Independence of the active rows: another set is sought below both 0.6 of the initial value and 0.7, where a
   * coefficient exceeds 1 / 0.7. */
  .reselect_ratio = 0.6,
  .reselect_below = 0.7,

  /* Products of three masses must neither overflow nor underflow. */
  .extreme = 1e100,

  /* Libraries reduce a step by factors of 4 to 10: it is below round-off after 25 reductions; a thousand steps that do
   * not advance are no search for a step size. */
  .stalled = 1000,
};

/* ---- Opening ---- */

/* The index of the n-th body of element e; that of the ground is s->bodies. */
static int singular_body (const pw_system *s, const pw_element_batch *k, int e, int n) {
  int j = k->column[e * k->kind->bodies + n];
  return j < s->coords ? j / 3 : s->bodies;
}

/* 1 if a holonomic constraint connects bodies that are already connected; -1 if out of memory.  The ground is a body,
 * to which an element on one body connects it. */
static int singular_has_loops (const pw_system *s) {
  int loops = 0, *set = malloc (((size_t)s->bodies + 1) * sizeof *set);
  if (set == NULL) return -1;
  for (int b = 0; b <= s->bodies; b++) set[b] = b;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->constraints && k->row < s->holonomic; k++)
    for (int e = 0; e < k->b.count; e++) {
      int first = k->kind->bodies > 1 ? singular_body (s, k, e, 0) : s->bodies;
      for (int n = k->kind->bodies > 1; n < k->kind->bodies; n++) {
        int a = pw_root (set, first), b = pw_root (set, singular_body (s, k, e, n));
        loops |= a == b;
        set[b] = a;
      }
    }
  free (set);
  return loops;
}

/* The holonomic rows of a tree of bodies cannot become dependent, whatever its configuration. */
int pw_watchdog_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  pw_watchdog *watch = &r->watchdog;
  watch->loops = singular_has_loops (s);
  if (watch->loops < 0) return pw_fail_memory (s, error);
  if (watch->loops == 0 && s->rows == s->holonomic) return PW_OK;
  pw_saddle_close (watch->saddle);
  pw_length_weights (s, r->scratch);
  watch->saddle = pw_saddle_open (r->w, r->scratch, s->rows, r->active, error);
  return watch->saddle ? PW_OK : PW_RESOURCE;
}

/* ---- Sines ---- */

double pw_watchdog_sine (pw_run *r, int *row) {
  pw_saddle *saddle = r->watchdog.saddle;
  if (row) *row = -1;
  if (saddle == NULL) return 1;
  int status = pw_saddle_factor (saddle);
  double sine = pw_saddle_sine (saddle, row);
  return status == PW_OK ? sine : 0;
}

int pw_watchdog_near (pw_run *r) {
  pw_watchdog *watch = &r->watchdog;
  if (!watch->singular_ahead || watch->saddle == NULL) return 0;
  if (!r->fixed_steps && !pw_saddle_sine_below (r->saddle, r->thresholds.refine)) return 0;
  watch->evaluated_sine = pw_watchdog_sine (r, NULL);
  return watch->evaluated_sine < r->thresholds.near * watch->largest_sine;
}

int pw_fail_singular (pw_run *r, double t, pw_error *error) {
  char element[PW_NAME_BYTES] = "a constraint";
  int row = -1;
  double sine = pw_watchdog_sine (r, &row);
  /* largest_sine is 0 while the run is being opened */
  if (sine > r->thresholds.rank_refused && sine > r->thresholds.near * r->watchdog.largest_sine)
    return pw_fail (
        error, PW_METHOD,
        "t = %.6g s: values too extreme: masses and inertias differ by so much that the equations of motion "
        "cannot be solved; the configuration is not singular",
        t);
  if (row >= 0) pw_system_row_name (r->s, row, element, sizeof element);
  if (sine <= r->thresholds.rank_lost)
    return pw_fail (error, PW_METHOD, "t = %.6g s: singular configuration: %s depends on other constraints", t,
                    element);
  return pw_fail (
      error, PW_METHOD,
      "t = %.6g s: near a singular configuration: %s nearly depends on other constraints (sine %.2g); the next "
      "step cannot be computed",
      t, element, sine);
}

int pw_watchdog_near_state (pw_run *r) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  pw_saddle_factor (r->saddle);
  r->watchdog.singular_ahead = 1;
  return pw_watchdog_near (r);
}

int pw_watchdog_check_values (const pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  const double extreme = r->thresholds.extreme;
  char name[PW_NAME_BYTES];
  for (int i = 0; i < 2 * s->coords; i++) {
    double value = i < s->coords ? r->q[i] : r->v[i - s->coords];
    if (!(fabs (value) < extreme))
      return pw_fail (error, PW_INPUT,
                      "model %s: values too extreme: %s is initially %g: expected a magnitude below %g", s->model,
                      pw_system_state_name (s, i, name, sizeof name), value, extreme);
  }
  for (int j = 0; s->rows > 0 && j < s->coords; j++) {
    double unit = pw_length_factor (s, j) * pw_length_factor (s, j), mass = s->mass[j] / unit;
    if (mass != 0 && !(mass < extreme && mass > 1 / extreme))
      return pw_fail (
          error, PW_INPUT,
          "model %s: values too extreme: the mass or inertia that goes with %s is %g: expected 0, or %g to %g",
          s->model, pw_system_state_name (s, j, name, sizeof name), s->mass[j], unit / extreme, unit * extreme);
  }
  return PW_OK;
}
