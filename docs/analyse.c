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

/* Steers for 5 s and differentiates the angle of the trailer with respect to the steering angle. */
static void steering (variant *steer, pw_error *e) {
  static const double angle = 0.02, step = 1e-6;
  pw_direction direction = { .step = step };
  pw_settings settings = { .step = 1e-3 };
  pw_system *system[5];
  pw_run *run[5];
  pw_sample now, slope;
  for (int i = 0; i < 5; i++) system[i] = compile (steer, angle + (i - 2) * step, e);
  for (int i = 0; i < 5; i++) run[i] = pw_run_open (system[i], "rk4+projection", &settings, e);
  for (int i = 0; i < 4; i++) direction.neighbour[i] = run[i < 2 ? i : i + 1];
  pw_variation *variation = pw_variation_open (run[2], &direction, 1, 0, e);
  int phi = pw_system_find_state (system[2], "trailer.phi", e);
  if (pw_variation_advance (variation, 5, 5, e) == PW_OK && pw_run_sample (run[2], 5, &now, e) == PW_OK &&
      pw_variation_sample (variation, 0, &slope, NULL, e) == PW_OK)
    printf ("after 5 s at %g rad the trailer's angle is %.5f rad, its derivative %.4f\n", angle, now.q[phi],
            slope.q[phi]);
  pw_variation_close (variation);
  for (int i = 0; i < 5; i++) pw_run_close (run[i]);
  for (int i = 0; i < 5; i++) pw_system_free (system[i]);
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
