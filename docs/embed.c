/* Pinwheel inside a program of your own.  From the source tree, after `make`:
 *     cc -std=c11 -Ibuild/include docs/embed.c -o embed -Lbuild -lpinwheel-files -lpinwheel -Wl,-rpath,$PWD/build -lm
 * with an installed Pinwheel:
 *     cc -std=c11 embed.c -o embed $(pkg-config --cflags --libs pinwheel) -lm
 * and, if the prefix is not searched by the system, with PKG_CONFIG_PATH=PREFIX/lib/pkgconfig in the environment and
 *     -Wl,-rpath,"$(pkg-config --variable=libdir pinwheel)"
 * or by CMake, with -DCMAKE_PREFIX_PATH=PREFIX, from
 *     find_package (pinwheel REQUIRED)
 *     target_link_libraries (embed pinwheel::pinwheel) */
#include <math.h>
#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* The torque of the rider drives and damps the hinge: M0 cos (pi t) - c (x[0] - x[1]), x: the states in `reads`. */
typedef struct {
  double M0, c; /* [N m], [N m s] */
} rider;

static int rider_torque (void *context, double t, const double *x, double value[3], double *gradient) {
  const rider *r = context;
  value[0] = r->M0 * cos (PW_PI * t) - r->c * (x[0] - x[1]);
  if (gradient) gradient[0] = -r->c, gradient[1] = r->c;
  return 0;
}

int main (void) {
  static const char *const reads[] = { "frame.omega", "steer.omega", NULL };
  rider parameters = { 0.1, 0.002 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = rider_torque, .context = &parameters, .reads = reads } };
  pw_error e = { 0 }; /* keeps the first error; calls with a NULL from a failed call fail, too */
  pw_sample now;

  pw_file *file = pw_file_open ("ezyroller", &e);
  pw_model *model = pw_file_model (file, &e);
  pw_model_set (model, "a", 0.6, &e);
  pw_model_build (model, &e);
  pw_model_set_signal (model, "rider", "value", &torque, &e);
  pw_system *system = pw_system_compile (model, &e);
  pw_run *run = pw_run_open (system, "rk4+projection", &(pw_settings){ .step = 1e-3 }, &e);
  pw_run_advance_to (run, 10, 10, &e);
  pw_run_sample (run, 10, &now, &e);

  if (e.status == PW_OK) {
    const double *frame = now.q + 3 * pw_system_find_body (system, "frame");
    printf ("frame at t = %g s: x = %.6f m, y = %.6f m, phi = %.6f rad\n", now.t, frame[0], frame[1], frame[2]);
  } else
    fprintf (stderr, "embed: %s\n", e.text);
  pw_run_close (run);
  pw_system_free (system);
  pw_model_free (model);
  pw_file_close (file);
  return -e.status;
}
