/* Projection of states: consistent states are unchanged, others are corrected, and accelerations are those of the
 * projected state. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"

enum { PROJECT_MOST = 24 };

/* Projects the state at 0.3 s with one velocity perturbed by `off`. */
static void project_try (const char *model, const char *parameter, double value, const char *method, double off) {
  pw_system *s = scene_named (model, parameter, value);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3 });
  pw_sample x = runs_to (r, 0.3);
  pw_error error = { 0 };
  pw_projector p;
  pw_residuals now;
  int n = pw_system_coordinates (s), rows = pw_system_rows (s);
  double q[PROJECT_MOST], v[PROJECT_MOST], a[PROJECT_MOST], other[PROJECT_MOST], lambda[PROJECT_MOST], mu[PROJECT_MOST],
      most = 1;
  assert_true (n + 3 <= PROJECT_MOST && rows <= PROJECT_MOST);
  memcpy (q, x.q, (size_t)n * sizeof *q);
  memcpy (v, x.v, (size_t)n * sizeof *v);
  check_ok (pw_projector_open_by_options (&p, r, &error), &error);
  v[1] += off;
  assert_int_equal (pw_project_state (&p, r, x.t, q, v, a, lambda, NULL), PW_OK);
  pw_evaluate_residuals (r->w, NULL, &now);
  check_below (model, now.position, 4 * CHECK_EPS, "round-off");
  check_below (model, now.velocity, 4 * CHECK_EPS, "round-off");
  check_bits ("positions", q, x.q, n);
  if (off == 0) {
    check_bits ("velocities", v, x.v, n);
    double known = fmin (r->statistics.velocity, PW_RESIDUAL_CONVERGED); /* smaller ones are not computed */
    check_close ("stored residual", r->residuals.velocity, fmax (known, now.velocity), 0, "same evaluation");
  } else
    assert_true (fabs (v[1] - x.v[1]) < fabs (off) && isnan (r->residuals.velocity));
  assert_int_equal (pw_run_accelerate (r, x.t, q, v, other, mu), PW_OK);
  for (int j = 0; j < n; j++) most = fmax (most, fabs (other[j]));
  for (int j = 0; j < n; j++) check_close (model, a[j], other[j], 256 * CHECK_EPS * most, "round-off, condition");
  for (int i = 0; i < rows; i++) check_close (model, lambda[i], mu[i], 256 * CHECK_EPS * most, "round-off, condition");
  pw_projector_close (&p);
  runs_close (r, s);
}

TEST (consistent) {
  project_try ("ezyroller", NULL, 0, "rk4+projection", 0);
  project_try ("ezyroller", "m2", 0.1, "rk4+projection", 0);
  project_try ("n-trailer", NULL, 0, "rk4+projection", 0);
}

TEST (perturbed) {
  project_try ("ezyroller", NULL, 0, "rk4+projection", 1e-3);
  project_try ("ezyroller", "m2", 0.1, "rk4+projection", 1e-3);
  project_try ("ezyroller", NULL, 0, "rk4+projection:metric=identity", 1e-3);
  project_try ("n-trailer", NULL, 0, "rk4+projection", 1e-3);
}

/* The length of the correction of a perturbed velocity. */
static double project_length (const char *method) {
  pw_system *s = scene_named ("ezyroller", "m2", 0.1);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3 });
  pw_sample x = runs_to (r, 0.3);
  pw_error error = { 0 };
  pw_projector p;
  double q[PROJECT_MOST], v[PROJECT_MOST], a[PROJECT_MOST], lambda[PROJECT_MOST], before[PROJECT_MOST], square = 0;
  int n = pw_system_coordinates (s);
  memcpy (q, x.q, (size_t)n * sizeof *q);
  memcpy (v, x.v, (size_t)n * sizeof *v);
  check_ok (pw_projector_open_by_options (&p, r, &error), &error);
  v[1] += 1e-3;
  memcpy (before, v, (size_t)n * sizeof *v);
  assert_int_equal (pw_project_state (&p, r, x.t, q, v, a, lambda, NULL), PW_OK);
  for (int j = 0; j < n; j++) square += (v[j] - before[j]) * (v[j] - before[j]);
  pw_projector_close (&p);
  runs_close (r, s);
  return sqrt (square);
}

/* The correction is shortest in the identity metric. */
TEST (metric) {
  double identity = project_length ("rk4+projection:metric=identity"), mass = project_length ("rk4+projection");
  print_message ("corrections %.6g and %.6g\n", identity, mass);
  check_below ("correction", identity, 0.999 * mass, "the mass matrix has entries from 0.1 to 1");
}

/* A residual that is NaN is the largest, in any row. */
TEST (nan_residual) {
  double size[PROJECT_MOST];
  pw_system *s = scene_named ("n-four-bar", NULL, 0);
  assert_in_range (s->holonomic, 3, PROJECT_MOST);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  for (int row = 0; row < 3; row++) {
    double g[PROJECT_MOST] = { 1e-3, 2e-3, 3e-3 };
    pw_residuals now;
    g[row] = NAN;
    pw_worst_position (r->w, g, size, NULL, 0, &now);
    assert_true (isnan (now.position));
    assert_int_equal (now.row_position, row);
  }
  pw_run_close (r);
  pw_system_free (s);
}

/* The statistics have the largest residuals of all steps, although not all of them are scaled. */
TEST (largest_residuals) {
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte", "rk4+nullspace", "radau+ggl" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .rtol = 1e-6 });
    const pw_statistics *found = pw_run_statistics (r);
    pw_residuals now, most = { .position = found->position, .velocity = found->velocity };
    pw_error error = { 0 };
    most.g = found->g, most.jv = found->jv;
    for (int n = 0; n < 100; n++) {
      check_ok (pw_run_advance (r, 100, &error), &error);
      assert_int_equal (pw_evaluate_J_at (r->w, r->t, r->q, r->v), PW_OK);
      pw_evaluate_residuals (r->w, NULL, &now);
      most.position = fmax (most.position, now.position), most.velocity = fmax (most.velocity, now.velocity);
      most.g = fmax (most.g, now.g), most.jv = fmax (most.jv, now.jv);
    }
    check_close (method[i], found->position, most.position, 0, "the same evaluation");
    check_close (method[i], found->velocity, most.velocity, 0, "the same evaluation");
    check_close (method[i], found->g, most.g, 0, "the same evaluation");
    check_close (method[i], found->jv, most.jv, 0, "the same evaluation");
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* A contradictory row of one projection is not reported as the cause of a failure of the next one. */
TEST (not_contradictory) {
  pw_system *s = scene_named ("redundant-parallelogram", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  pw_error error = { 0 };
  pw_projector p;
  check_ok (pw_projector_open_by_options (&p, r, &error), &error);
  p.contradictory_row = r->redundant_row[0];
  r->q[0] = NAN;
  assert_int_equal (pw_project_positions (&p, r, 0, r->q, r->v), PW_RETRY);
  assert_int_equal (p.contradictory_row, -1);
  pw_projector_close (&p);
  runs_close (r, s);
}

/* A point mass on a massless rod turns uniformly without gravity, 80 times: phi alone takes up the residual of the pin,
 * and only to the round-off of phi. */
TEST (large_angle) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "bdf+projection", "erk8+nullspace" };
  const double omega = 50, t = 10;
  pw_system *s = scene_named ("pendulum", "g", 0);
  pw_error error = { 0 };
  const pw_initial_value turn = { pw_system_find_state (s, "bob.omega", &error), omega };
  for (int i = 0; i < 4; i++) {
    pw_run *r =
        runs_open (s, method[i], &(pw_settings){ .step = 1e-4, .rtol = 1e-10, .initial = &turn, .initials = 1 });
    pw_sample x = runs_to (r, t);
    check_close (method[i], x.q[2], omega * t, 1e-3, "errors of the methods, by far");
    check_close (method[i], x.q[0], cos (x.q[2]), 4 * CHECK_EPS * omega * t, "round-off of phi");
    pw_run_close (r);
  }
  pw_system_free (s);
}
