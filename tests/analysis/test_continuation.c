/* Continuation of branches that are known in closed form. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "continuation.h"

/* p = x^3 - x, with the first equation twice and an unknown z whose value is arbitrary but for its symmetry's
 * condition. */
static int cubic (void *context, const double *u, double *F, double *dF, pw_error *error) {
  double x = u[0], p = u[2];
  (void)error;
  ++*(int *)context;
  if (x > 5) return PW_RETRY;
  F[0] = x * x * x - x - p;
  F[1] = 2 * F[0];
  if (dF == NULL) return PW_OK;
  dF[0] = 3 * x * x - 1, dF[1] = 2 * dF[0];
  dF[5] = 1;
  return PW_OK;
}

static int cubic_calls;
static const pw_branch_problem cubic_equations = {
  .unknowns = 2, .equations = 3, .tolerance = 1e-12, .evaluate = cubic, .context = &cubic_calls
};

static void continuation_open (pw_branch *b, const pw_branch_problem *problem) {
  pw_error error = { 0 };
  check_ok (pw_branch_open (b, problem, &error), &error);
  b->step = 0.05, b->max_change = 0.1, b->min_step = 1e-6;
}

static int slope_of_p (void *context, const pw_branch_point *point, double *value, pw_error *error) {
  (void)context, (void)error;
  *value = point->tangent[2];
  return PW_OK;
}

/* The branch passes both folds, at p = +- 2 / sqrt (27), x = -+ 1 / sqrt (3). */
TEST (folds) {
  double u[3] = { -2, 0.7, -5 }, next = 1;
  pw_error error = { 0 };
  pw_branch b;
  int folds = 0, points = 0;
  continuation_open (&b, &cubic_equations);
  check_ok (pw_branch_solve (&b, u, &error), &error);
  check_close ("x", u[0] * u[0] * u[0] - u[0], -5, 1e-12, "the tolerance");
  check_close ("z", u[1], 0.7, 1e-15, "it stays by its condition");
  check_ok (pw_branch_start (&b, u, 1, &error), &error);
  for (; b.reached.u[2] < 1 || b.reached.u[0] < 1; points++) {
    assert_true (points < 1000);
    check_ok (pw_branch_step (&b, &error), &error);
    check_close ("p", b.reached.u[2], pow (b.reached.u[0], 3) - b.reached.u[0], 1e-12, "the tolerance");
    assert_true (fabs (b.reached.u[2] - b.previous.u[2]) < 0.2); /* predicted: 0.1 */
    assert_true (b.reached.u[0] > b.previous.u[0]);
    if (!b.folded) continue;
    b.event_accuracy = 1e-10;
    check_ok (pw_branch_locate (&b, slope_of_p, NULL, &error), &error);
    check_close ("x", b.found.u[0], -next / sqrt (3), 1e-9, "10 times the accuracy asked, steps < 1");
    check_close ("p", b.found.u[2], next * 2 / sqrt (27), 1e-12, "quadratic at the fold");
    folds++, next = -1;
  }
  assert_int_equal (folds, 2);
  pw_branch_close (&b);
}

/* Pitchforks at p = *context on the curved branch x = 3 sin p: other branches leave it at (x - 3 sin p)^2 = p -
 * *context. */
static int pitchfork (void *context, const double *u, double *F, double *dF, pw_error *error) {
  double off = u[0] - 3 * sin (u[1]), p = u[1] - *(double *)context;
  (void)error;
  F[0] = off * (p - off * off);
  if (dF) dF[0] = p - 3 * off * off;
  return PW_OK;
}

static int pitchfork_sign (void *context, const pw_branch_point *point, double *value, pw_error *error) {
  double F, dF = 0;
  int status = pitchfork (context, point->u, &F, &dF, error);
  *value = dF;
  return status;
}

/* Steps of any length pass pitchforks on the same branch, and the pitchfork is located. */
TEST (pitchforks) {
  double where, F;
  const pw_branch_problem problem = {
    .unknowns = 1, .equations = 1, .tolerance = 1e-9, .rank_tolerance = 1e-7, .evaluate = pitchfork, .context = &where
  };
  pw_error error = { 0 };
  for (int k = 0; k < 300; k++) {
    double u[2] = { 0, 0 };
    int passed = 0;
    pw_branch b;
    check_ok (pw_branch_open (&b, &problem, &error), &error);
    b.max_change = 0.05 + 0.001 * k, b.step = b.max_change / 4, b.min_step = 1e-6, b.event_accuracy = 1e-7,
    where = 0.8 + 0.01 * (k % 17);
    check_ok (pw_branch_start (&b, u, 1, &error), &error);
    while (b.reached.u[1] < 1.5) {
      check_ok (pw_branch_step (&b, &error), &error);
      check_close ("x", b.reached.u[0], 3 * sin (b.reached.u[1]), 1e-4,
                   "the tolerance over the distance from the pitchfork");
      assert_false (b.folded);
      if (passed || b.reached.u[1] < where) continue;
      check_ok (pw_branch_locate (&b, pitchfork_sign, &where, &error), &error);
      check_close ("p", b.found.u[1], where, 1e-7, "a cubic between points nearby");
      check_ok (pitchfork (&where, b.found.u, &F, NULL, &error), &error);
      check_close ("residual", b.found.residual, fabs (F), 0, "that of the point");
      passed = 1;
    }
    assert_true (passed);
    pw_branch_close (&b);
  }
}

/* x = sin p, without derivatives near p = 1. */
static int gap (void *context, const double *u, double *F, double *dF, pw_error *error) {
  (void)context, (void)error;
  F[0] = u[0] - sin (u[1]);
  if (dF) dF[0] = fabs (u[1] - 1) < 0.01 ? NAN : 1;
  return PW_OK;
}

static int gap_middle (void *context, const pw_branch_point *point, double *value, pw_error *error) {
  (void)context, (void)error;
  *value = point->u[1] - 1;
  return PW_OK;
}

/* Where Newton's method fails, events are interpolated from the nearest points. */
TEST (interpolated) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = gap };
  double u[2] = { 0, 0 };
  pw_error error = { 0 };
  pw_branch b;
  check_ok (pw_branch_open (&b, &problem, &error), &error);
  b.max_change = b.step = 0.2, b.min_step = 1e-6, b.event_accuracy = 1e-9;
  check_ok (pw_branch_start (&b, u, 1, &error), &error);
  while (b.reached.u[1] < 1) check_ok (pw_branch_step (&b, &error), &error);
  check_ok (pw_branch_locate (&b, gap_middle, NULL, &error), &error);
  assert_int_equal (b.found.interpolated, 1);
  check_close ("p", b.found.u[1], 1, 1e-9, "the accuracy asked, steps < 1");
  check_close ("x", b.found.u[0], sin (1), 4e-6, "the cubic between points 0.2 apart: 0.2^4/384");
  check_close ("residual", b.found.residual, fabs (b.found.u[0] - sin (b.found.u[1])), 0, "that of the point");
  pw_branch_close (&b);
}

/* x = sin p, except at p = 1. */
static int puncture (void *context, const double *u, double *F, double *dF, pw_error *error) {
  return fabs (u[1] - 1) < 1e-12 ? PW_RETRY : gap (context, (double[]){ u[0], u[1] }, F, dF, error);
}

/* An event where the equations cannot be evaluated is located all the same, though the secant leads there at once. */
TEST (punctured) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = puncture };
  pw_error error = { 0 };
  for (int k = 0; k < 20; k++) {
    double u[2] = { sin (0.01 * k), 0.01 * k };
    pw_branch b;
    check_ok (pw_branch_open (&b, &problem, &error), &error);
    b.max_change = b.step = 0.2, b.min_step = 1e-6, b.event_accuracy = 1e-9;
    check_ok (pw_branch_start (&b, u, 1, &error), &error);
    while (b.reached.u[1] < 1) check_ok (pw_branch_step (&b, &error), &error);
    check_ok (pw_branch_locate (&b, gap_middle, NULL, &error), &error);
    check_close ("p", b.found.u[1], 1, 1e-9, "the accuracy asked, steps < 1");
    pw_branch_close (&b);
  }
}

/* With p decreasing from the same point x decreases, and steps grow without curvature. */
TEST (direction) {
  double u[3] = { -2, 0, -6 };
  pw_error error = { 0 };
  pw_branch b;
  continuation_open (&b, &cubic_equations);
  check_ok (pw_branch_start (&b, u, -1, &error), &error);
  check_ok (pw_branch_step (&b, &error), &error);
  assert_true (b.reached.u[2] < -6 && b.reached.u[0] < -2);
  pw_branch_close (&b);
}

/* dF/dx vanishes at a fold: the branch cannot start there by its parameter. */
TEST (start_at_fold) {
  double u[3] = { -1 / sqrt (3), 0, 2 / sqrt (27) };
  pw_error error = { 0 };
  pw_branch b;
  continuation_open (&b, &cubic_equations);
  assert_int_equal (pw_branch_start (&b, u, 1, &error), PW_RETRY);
  pw_branch_close (&b);
}

/* Where F cannot be evaluated, the branch ends with PW_RETRY, just before. */
TEST (end) {
  double u[3] = { 4.8, 0, 4.8 * 4.8 * 4.8 - 4.8 };
  pw_error error = { 0 };
  pw_branch b;
  int status = PW_OK;
  continuation_open (&b, &cubic_equations);
  b.max_change = 100;
  check_ok (pw_branch_start (&b, u, 1, &error), &error);
  while (status == PW_OK) status = pw_branch_step (&b, &error);
  assert_int_equal (status, PW_RETRY);
  check_close ("x", b.reached.u[0], 5, 1e-6, "the least step, of which x has a part");
  pw_branch_close (&b);
}

/* Where F cannot be evaluated at the beginning, there is no residual: not that of an earlier solution. */
TEST (not_begun) {
  double u[3] = { 1, 0, 0 }, outside[3] = { 6, 0, 0 };
  pw_error error = { 0 };
  pw_branch b;
  continuation_open (&b, &cubic_equations);
  check_ok (pw_branch_solve (&b, u, &error), &error);
  assert_int_equal (pw_branch_solve (&b, outside, &error), PW_RETRY);
  assert_true (isinf (b.residual));
  pw_branch_close (&b);
}

/* p = x^2 / 2 */
static int parabola (void *context, const double *u, double *F, double *dF, pw_error *error) {
  (void)context, (void)error;
  F[0] = u[0] * u[0] / 2 - u[1];
  if (dF) dF[0] = u[0];
  return PW_OK;
}

static int no_events (void *context, pw_error *error) {
  (void)context, (void)error;
  return PW_OK;
}

/* From p = 0.5 through the fold up to p = 1, which no point exceeds though tangents predict too little. */
TEST (range) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = parabola };
  pw_error error = { 0 }, why;
  for (int k = 0; k < 100; k++) {
    double u[2] = { -1, 0.5 }, p = 0;
    int folds = 0;
    pw_branch b;
    const pw_branch_event *next;
    continuation_open (&b, &problem);
    b.max_change = b.step = 0.2 + 0.003 * k, b.event_accuracy = 1e-9, b.max_points = 1000;
    check_ok (pw_branch_start (&b, u, -1, &error), &error);
    while (pw_branch_next (&b, no_events, &why, &next, &error) == PW_OK && next) {
      p = next->point.u[1], folds += next->event == PW_BRANCH_FOLD;
      assert_true (p >= -1e-12 && p <= 1);
    }
    assert_int_equal (folds, 1);
    check_close ("p", p, 1, 0, "the end of the range");
    check_close ("x", b.reached.u[0], sqrt (2), 1e-12, "the tolerance");
    pw_branch_close (&b);
  }
}

/* A branch that leads out of the range ends at its first point, without a reason. */
TEST (outwards) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = parabola };
  double u[2] = { sqrt (2), 1 };
  pw_error error = { 0 }, why = { .status = PW_METHOD, .text = "of another branch" };
  const pw_branch_event *next;
  pw_branch b;
  continuation_open (&b, &problem);
  check_ok (pw_branch_start (&b, u, 1, &error), &error);
  for (int i = 0; i < 2; i++) {
    check_ok (pw_branch_next (&b, no_events, &why, &next, &error), &error);
    assert_true ((next != NULL) == (i == 0));
  }
  assert_string_equal (why.text, "");
  pw_branch_close (&b);
}

static int failing_events (void *context, pw_error *error) {
  (void)context, (void)error;
  return PW_RETRY;
}

/* Where events cannot be sought, the branch ends, for good: the fold of this step does not follow. */
TEST (events_fail) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = parabola };
  double u[2] = { -0.05, 0.05 * 0.05 / 2 };
  pw_error error = { 0 }, why = { 0 };
  const pw_branch_event *next;
  pw_branch b;
  continuation_open (&b, &problem);
  b.step = 0.07, b.event_accuracy = 1e-9, b.max_points = 10;
  check_ok (pw_branch_start (&b, u, -1, &error), &error);
  for (int i = 0; i < 3; i++) {
    check_ok (pw_branch_next (&b, failing_events, &why, &next, &error), &error);
    assert_true ((next != NULL) == (i == 0));
  }
  assert_true (b.folded);
  assert_string_equal (why.text, "the next point cannot be evaluated");
  pw_branch_close (&b);
}

/* p = 0.5 + 0.3 sin x + climb (x - pi), and the same with other angles x. */
static int wave (void *context, const double *u, double *F, double *dF, pw_error *error) {
  double climb = *(double *)context;
  (void)error;
  F[0] = 0.5 + 0.3 * sin (u[0]) + climb * (u[0] - PW_PI) - u[1];
  if (dF) dF[0] = 0.3 * cos (u[0]) + climb;
  return PW_OK;
}

static int wave_same (void *context, const double *u, const double *other) {
  (void)context;
  return fabs (remainder (u[0] - other[0], 2 * PW_PI)) < 1e-6;
}

/* A branch is closed after a whole turn, also if it begins beside a fold, from one point to the same; but not if p
 * increases from turn to turn. */
TEST (turns) {
  static const double begin[] = { 0.3, 2, PW_PI / 2 - 1e-3, PW_PI / 2 + 1e-2, -PW_PI / 2 + 2e-3 };
  double climb;
  const pw_branch_problem problem = {
    .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = wave, .same = wave_same, .context = &climb
  };
  pw_error error = { 0 }, why;
  for (size_t k = 0; k < 2 * sizeof begin / sizeof *begin; k++) {
    double x = begin[k / 2], u[2];
    int folds = 0;
    pw_branch b;
    const pw_branch_event *next;
    climb = k % 2 ? 0.01 : 0;
    u[0] = x, u[1] = 0.5 + 0.3 * sin (x) + climb * (x - PW_PI);
    continuation_open (&b, &problem);
    b.max_change = b.step = 0.1, b.event_accuracy = 1e-9, b.max_points = 1000;
    check_ok (pw_branch_start (&b, u, 0.3 * cos (x) + climb, &error), &error);
    while (pw_branch_next (&b, no_events, &why, &next, &error) == PW_OK && next)
      folds += next->event == PW_BRANCH_FOLD, why = (pw_error){ 0 }; /* as evaluations of the point do */
    assert_string_equal (why.text, climb > 0 ? "" : "it has returned to its first point");
    if (climb > 0) {
      assert_true (folds > 5);
      check_close ("p", b.reached.u[1], 1, 0, "the end of the range");
    } else {
      assert_int_equal (folds, 2);
      check_close ("p", b.reached.u[1], u[1], 0, "that of the first point");
      check_close ("x", b.reached.u[0], x + 2 * PW_PI, 1e-8, "the tolerance over the slope");
    }
    pw_branch_close (&b);
  }
}

static int without_solution (void *context, const double *u, double *F, double *dF, pw_error *error) {
  (void)context, (void)error;
  F[0] = u[0] * u[0] + 1;
  if (dF) dF[0] = 2 * u[0];
  return PW_OK;
}

/* No solution: the residual where it stopped is that of the nearest miss. */
TEST (without_solution) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = without_solution };
  double u[2] = { 3, 0 };
  pw_error error = { 0 };
  pw_branch b;
  continuation_open (&b, &problem);
  assert_int_equal (pw_branch_solve (&b, u, &error), PW_RETRY);
  assert_true (b.residual >= 1 && b.residual < 2);
  pw_branch_close (&b);
}

/* Far from the solution a full step diverges: atan (x - p). */
static int steep (void *context, const double *u, double *F, double *dF, pw_error *error) {
  double y = u[0] - u[1];
  (void)context, (void)error;
  F[0] = atan (y);
  if (dF) dF[0] = 1 / (1 + y * y);
  return PW_OK;
}

TEST (damping) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-12, .evaluate = steep };
  double u[2] = { 5, 0.5 };
  pw_error error = { 0 };
  pw_branch b;
  continuation_open (&b, &problem);
  check_ok (pw_branch_solve (&b, u, &error), &error);
  check_close ("x", u[0], 0.5, 1e-12, "the tolerance; slope 1");
  pw_branch_close (&b);
}

/* x^3 = (p - 0.5)^2 */
static int cusp (void *context, const double *u, double *F, double *dF, pw_error *error) {
  double x = u[0], p = u[1] - 0.5;
  (void)context, (void)error;
  F[0] = x * x * x - p * p;
  if (dF) dF[0] = 3 * x * x;
  return PW_OK;
}

/* A branch ends at a cusp, where solutions within the tolerance are noise of 1e-3 in x: none of it is taken for a
 * fold. */
TEST (cusp) {
  const pw_branch_problem problem = { .unknowns = 1, .equations = 1, .tolerance = 1e-9, .evaluate = cusp };
  pw_error error = { 0 }, why;
  for (int k = 0; k < 100; k++) {
    double u[2] = { cbrt (0.25), 0 };
    pw_branch b;
    const pw_branch_event *next;
    continuation_open (&b, &problem);
    b.max_change = 0.01 + 6e-4 * k, b.step = b.max_change / 4, b.min_step = 1e-7, b.event_accuracy = 1e-9;
    b.max_points = 1000;
    check_ok (pw_branch_start (&b, u, 1, &error), &error);
    while (pw_branch_next (&b, no_events, &why, &next, &error) == PW_OK && next)
      assert_int_equal (next->event, PW_BRANCH_POINT);
    assert_string_equal (why.text, "Newton's method fails at the smallest step");
    check_close ("x", b.reached.u[0], 0, 1e-3, "the third root of the tolerance");
    pw_branch_close (&b);
  }
}
