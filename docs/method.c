/* An integration method of your own: that of Kutta of order 3; measures its order on a pendulum with a known motion.
 * From the source tree, after `make`:
 *     cc -std=c11 -Ibuild/include docs/method.c -o method -Lbuild -lpinwheel-files -lpinwheel -Wl,-rpath,$PWD/build -lm
 * with an installed Pinwheel as docs/embed.c.  Its last line makes it a file of methods for commands, too:
 *     pinwheel compare ezyroller --method-file docs/method.c */
#include <math.h>
#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-method.h"

enum { Q, V, V2, A2, V3, A3, LAMBDA, ARRAYS };

static int kutta3_open (pw_run *r, pw_error *error) {
  return pw_step_open (r, ARRAYS, error);
}

/* k2 = f (t + h/2, y + h/2 k1),  k3 = f (t + h, y - h k1 + 2 h k2),  y' = y + h/6 (k1 + 4 k2 + k3)  (Kutta 1901), with
 * y = (q, v) and k = (v, a). */
static int kutta3_advance (pw_run *r, double t_end, pw_error *error) {
  const pw_reached x = pw_run_state (r);
  const int n = pw_system_coordinates (x.system);
  const double h = pw_step_size (r, t_end);
  double *array[ARRAYS];
  for (int i = 0; i < ARRAYS; i++) array[i] = pw_step_array (r, i);
  double *q = array[Q], *v = array[V], *v2 = array[V2], *a2 = array[A2], *v3 = array[V3], *a3 = array[A3];
  for (int j = 0; j < n; j++) {
    q[j] = x.q[j] + h / 2 * x.v[j];
    v2[j] = x.v[j] + h / 2 * x.a[j];
  }
  int status = pw_run_accelerate (r, x.t + h / 2, q, v2, a2, array[LAMBDA]);
  for (int j = 0; j < n; j++) {
    q[j] = x.q[j] + h * (2 * v2[j] - x.v[j]);
    v3[j] = x.v[j] + h * (2 * a2[j] - x.a[j]);
  }
  if (status == PW_OK) status = pw_run_accelerate (r, pw_stage_time (r, x.t + h), q, v3, a3, array[LAMBDA]);
  for (int j = 0; j < n; j++) {
    q[j] = x.q[j] + h / 6 * (x.v[j] + 4 * v2[j] + v3[j]);
    v[j] = x.v[j] + h / 6 * (x.a[j] + 4 * a2[j] + a3[j]);
  }
  return pw_step_accept (r, status, h, q, v, error);
}

static const pw_stabilisation stabilisations[] = {
  { "none", "accelerations only: the constraints drift", PW_UNSTABILISED },
  { "projection", "positions and velocities projected after each step", PW_PROJECTION },
  { .name = NULL },
};
static const pw_option options[] = { { .name = NULL } };

static const pw_method kutta3 = { .name = "kutta3",
                                  .about = "Runge-Kutta of order 3, fixed step (Kutta 1901)",
                                  .order = 3,
                                  .stabilisations = stabilisations,
                                  .options = options,
                                  .open = kutta3_open,
                                  .advance = kutta3_advance,
                                  PW_STEP_FUNCTIONS };
static const pw_method *const methods[] = { &kutta3, NULL };

/* The largest error of the positions at the end of a run. */
static double error_of_run (const char *method, double step, pw_error *e) {
  const double t_end = 2;
  double q[30], v[30], most = NAN;
  pw_sample now;
  pw_file *file = pw_file_open ("pendulum", e);
  pw_model *model = pw_file_model (file, e);
  pw_model_build (model, e);
  pw_system *system = pw_system_compile (model, e);
  pw_run *run = pw_run_open (system, method, &(pw_settings){ .step = step, .methods = methods }, e);
  pw_run_advance_to (run, t_end, t_end, e);
  pw_run_sample (run, t_end, &now, e);
  if (e->status == PW_OK && pw_system_reference (model, system, t_end, q, v, e) == PW_OK)
    for (int j = 0; j < pw_system_coordinates (system); j++) most = fmax (most, fabs (now.q[j] - q[j]));
  pw_run_close (run);
  pw_system_free (system);
  pw_model_free (model);
  pw_file_close (file);
  return most;
}

int main (void) {
  static const char *const method[] = { "kutta3", "kutta3+projection", NULL };
  pw_error e = { 0 };
  for (int i = 0; method[i]; i++) {
    double before = NAN;
    for (double step = 0.04; step > 0.004 && e.status == PW_OK; step /= 2) {
      double off = error_of_run (method[i], step, &e);
      printf ("%-18s step %-6g error %.3e m  order %.2f\n", method[i], step, off, log2 (before / off));
      before = off;
    }
  }
  if (e.status != PW_OK) fprintf (stderr, "method: %s\n", e.text);
  return -e.status;
}

PW_METHOD_FILE (methods);
