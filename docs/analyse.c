/* Analyses the car with a trailer of analysis.md: critical speed, growth in reverse, what parameters change.
 * Compile it like embed.c, and run it with the model:  ./analyse ./car-trailer.yaml */
#include <stdio.h>
#include "pinwheel-analysis.h"
#include "pinwheel-files.h"

/* The model of a file, in which one parameter varies. */
typedef struct {
  pw_file *file;
  const char *parameter;
} variant;

/* The system with this value of the parameter; NULL after an error. */
static pw_system *compile (void *context, double value, pw_error *e) {
  const variant *v = context;
  pw_model *model = pw_file_model (v->file, e);
  pw_model_set (model, v->parameter, value, e);
  pw_model_build (model, e);
  pw_system *system = e->status == PW_OK ? pw_system_compile (model, e) : NULL;
  pw_model_free (model);
  return system;
}

/* Follows straight motion from 2 to 60 m/s, and prints the speed at which an oscillation begins to grow. */
static void critical_speed (variant *speed, pw_error *e) {
  pw_steady_settings range = { .first = 2, .last = 60, .vary = -1, .compile = compile, .context = speed };
  pw_steady_motion m;
  pw_system *system = compile (speed, range.first, e);
  pw_steady *steady = pw_steady_open (system, &range, e);
  if (pw_steady_solve (steady, 0, range.first, &m, e) == PW_OK &&
      pw_steady_follow (steady, m.q, m.v, range.first, 1, e) == PW_OK)
    while (pw_steady_next (steady, &m, e) == PW_OK && m.event != PW_STEADY_END)
      if (m.event == PW_STEADY_OSCILLATION)
        printf ("critical speed %.5f m/s, %.5f Hz\n", m.parameter, m.linear->im[0] / (2 * PW_PI));
  pw_steady_close (steady), pw_system_free (system);
}

/* Linearises the initial motion in reverse. */
static void reverse (variant *speed, pw_error *e) {
  pw_linear linear = { .unknowns = 0 };
  pw_system *system = compile (speed, -2, e);
  pw_run *run = pw_run_open (system, "rk4+projection", &(pw_settings){ .step = 1e-3 }, e);
  if (pw_run_linearise (run, 100, &linear, e) == PW_OK && linear.steady == PW_STEADY)
    printf ("in reverse the trailer's angle grows at %.5f 1/s\n", linear.re[0]);
  pw_linear_free (&linear), pw_run_close (run), pw_system_free (system);
}

/* Steers for 5 s at an angle: the angle of the trailer at the end. */
static int steered (void *context, const double *angle, double rtol, double *phi, pw_error *e) {
  pw_sample end;
  pw_system *system = compile (context, *angle, e);
  pw_run *run = pw_run_open (system, "erk8+projection", &(pw_settings){ .rtol = rtol, .span = 5 }, e);
  if (pw_run_advance_to (run, 5, 5, e) == PW_OK && pw_run_sample (run, 5, &end, e) == PW_OK)
    *phi = end.q[pw_system_find_state (system, "trailer.phi", e)];
  pw_run_close (run), pw_system_free (system);
  return e->status;
}

/* Differentiates it with respect to the steering angle, by runs at neighbouring angles in two threads. */
static void steering (variant *steer, pw_error *e) {
  static const double angle = 0.02;
  const pw_difference_settings d = { .evaluate = steered,
                                     .context = steer,
                                     .x = &angle,
                                     .parameters = 1,
                                     .outputs = 1,
                                     .rtol = 1e-12,
                                     .neighbours = 6,
                                     .jobs = 2 };
  pw_derivative slope;
  double phi;
  if (pw_differentiate (&d, &slope, &phi, e) == PW_OK && slope.type == PW_DERIVATIVE)
    printf ("after 5 s at %g rad the trailer's angle is %.5f rad, its derivative %.4f +- %.1g\n", angle, phi,
            slope.value, slope.error);
}

int main (int count, char **argument) {
  pw_error e = { 0 };
  variant v = { pw_file_open (count > 1 ? argument[1] : "./car-trailer.yaml", &e), "u" };
  critical_speed (&v, &e);
  reverse (&v, &e);
  v.parameter = "steer";
  steering (&v, &e);
  if (e.status != PW_OK) fprintf (stderr, "analyse: %s\n", e.text);
  pw_file_close (v.file);
  return -e.status;
}
