/* The thresholds of the watchdog and of the run; see watchdog.h. */
#include "watchdog.h"

/* Residuals are scaled; lengths and motions are in units of L and rad; a relative sine is the sine over the largest one
 * of the run.  s: the sine; d: the residual; eps: the machine precision.  Where branches cross, the constraints are
 * x y = 0 in suitable coordinates, and s = |(x, y)|; with a residual d, x y = d: each branch turns, most sharply where
 * s^2 = 2 d. */
const pw_thresholds pw_watchdog_thresholds = {
  /* Residuals above which constraints count as lost: a motion with residuals of 1 % is wrong; without stabilisation
   * some drift is expected. */
  .lost = 1e-2,
  .lost_unstabilised = 0.1,

  /* A redundant row follows from the others up to a round-off of some 5e6 eps, or up to their residuals times this
   * ratio, for a sine as small as 1e-4. */
  .redundant_residual = 1e-9,
  .redundant_ratio = 1e4,

  /* Sines below which J has lost rank (rank_lost); the rank is computed (rank_suspect); or, where the scene is too
   * large for that, the configuration is refused (rank_refused).  Round-off leaves sqrt (eps) = 1.5e-8 of a row that
   * depends on others; below 1e-6 accelerations, with an error of eps / s after refinement, are wrong by more than
   * 1e-10.  Round-off leaves up to 1e-5 of a row that depends on rows which are nearly dependent themselves.
   * rank_suspect: a hundred times rank_refused. */
  .rank_lost = 1e-6,
  .rank_suspect = 1e-3,
  .rank_refused = 1e-5,

  /* Sine above which a row counts as independent: residuals of 1e-16 leave an error of 1e-8; ten times that. */
  .independent = 1e-7,

  /* Another set of active rows is sought where their independence (rank.h) is below both 0.6 of its initial value and
   * 0.7, where a coefficient exceeds 1 / 0.7. */
  .reselect_ratio = 0.6,
  .reselect_below = 0.7,

  /* near: relative sine below which a configuration is near a singular one.  refine: sine in the metric of a saddle
   * (saddle.h) below which its solutions are refined.  A stage of a step by an angle h has a residual of about h^2 / 8,
   * which decides on the branch unless s^2 is much larger: with steps of 1e-3 s at a few rad/s, up to s of 0.02.  A
   * factorisation has an error of eps / s^2, 5e-13 at 0.02. */
  .near = 0.02,
  .refine = 0.02,

  /* Drift: measured on four-bar linkages and slider-cranks, d / s^2 is 0.08 to 0.34 where the turn is sharpest;
   * accelerations, at least turn_reference L / T^2, have grown by a factor of 3 (turn_growth) when it is 0.02 to 0.07
   * (drift_turn).  From half of that on (drift_near) they are no reference for later ones.  Where d itself counts as
   * lost (drift_far), d / s^2 must be below its value in the sharpest turn (drift_any), whatever the accelerations.
   * Where the relative sine is above `regular`, the configuration is not singular, however large the drift. */
  .regular = 0.6,
  .turn_growth = 3,
  .turn_reference = 0.1,
  .drift_turn = 0.02,
  .drift_near = 0.01,
  .drift_far = 1e-2,
  .drift_any = 0.1,

  /* Growth of the accelerations in a jump.  Nonholonomic rows: accelerations do not grow when the motion passes a
   * singular configuration; in a jump at the sine s they reach 1 / s: 100 at half of `near`. */
  .jump_growth = 100,

  /* Change of the relative sine per unit of motion: the direction of a row of length 1 turns by at most an angle of 1
   * per rad, and that of the rows before it, too.  No step is taken to be more than twice as long as the last one. */
  .lipschitz = 2,
  .step_growth = 2,

  /* Change points (change_point.c): a sine within a step below an eighth of those at its ends (unresolved) belongs to a
   * turn that the step cannot resolve; below half of them, or a relative sine below half (low), there may be a change
   * point.  Strides of 0.3 times the sine stay on a curve whose radius is the sine.  A stride that approaches its
   * destination by less than a tenth of its length (progress) leads elsewhere. */
  .unresolved = 0.125,
  .low = 0.5,
  .stride = 0.3,
  .progress = 0.1,

  /* The projection leaves residuals of 1e-14, which leave an error of 1e-7 in the sine: below `floor`, ten times that,
   * also the shortest stride, it cannot be distinguished from 0 (`crossing`: twice that, since a stride ends within
   * `floor` of its destination).  Such a point must be left straight on, within 60 degrees of the direction in which it
   * was entered: the cosine `straight`. */
  .floor = 1e-6,
  .crossing = 2e-6,
  .straight = 0.5,

  /* Length of a step over the distance of branches that it resolves: methods of order 2 have an error of
   * (0.4)^2 / 12 = 1 % at a turn that takes 1 / 0.4 steps. */
  .resolved = 0.4,

  /* Differences between results of the same step divided into parts, differently each time: acceptable, and aimed at.
   * Near a singular configuration most agree to 1e-11; those that differ by more than the error of a good step, 1e-7,
   * do not agree.  A sample does not affect the next step: an error of 0.01 L or 0.01 rad is acceptable. */
  .agree = 1e-7,
  .agree_best = 1e-11,
  .sample = 1e-2,
  .sample_best = 1e-9,

  /* Sine at the end of a step over that at its beginning.  If it ends within a tenth of its length from a singular
   * configuration, the accelerations, whose error is that of the state over the sine, are ten times less accurate than
   * at its beginning. */
  .ends_singular = 0.1,

  /* The largest mass, and one over the smallest [kg]; the largest initial value.  Products of three masses must neither
   * overflow nor underflow. */
  .extreme = 1e100,

  /* Consecutive steps that do not advance.  Libraries reduce a step by factors of 4 to 10: it is below round-off after
   * 25 reductions; a thousand steps that do not advance are no search for a step size. */
  .stalled = 1000,
};
