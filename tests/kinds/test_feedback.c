/* Signals of forces that read velocities, as those of controllers do: with every method the motion is that with
 * elements of the same force laws. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

static const double feedback_c = 2; /* damping [N m s/rad] and [N s/m] */

static int feedback_eval (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = -feedback_c * x[0];
  if (gradient) gradient[0] = -feedback_c;
  return 0;
}

#define FEEDBACK(states)                                               \
  {                                                                    \
    PW_FUNCTION, .function = {.eval = feedback_eval, .reads = states } \
  }

typedef struct {
  double signals; /* 1: laws by signals; 0: by elements */
} feedback_parameters;

static const pw_parameter feedback_list[] = { { PW_AT (feedback_parameters, signals), 0, "", "", PW_REAL },
                                              { .name = NULL } };

/* Two rods: the hinge of the first one is damped, and air resists the motion of the second one.  The described initial
 * velocities are inconsistent. */
SCENE_WITH (feedback_build, feedback_list, feedback_parameters) {
  static const char *const omega[] = { "a.omega", NULL }, *const vx[] = { "b.vx", NULL },
                           *const vy[] = { "b.vy", NULL };
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1. / 12, .start = { 0.5 }, .rate = { 0, 0, 1 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1. / 12, .start = { 1.5 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "a", "ground" }, .at = { { -0.5 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "b", "a" }, .at = { { -0.5 }, { 0.5 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  if (p->signals != 0) {
    pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "a", "ground" }, .value = FEEDBACK (omega) });
    pw_add_force (m, &(pw_force){ .name = "F", .body = "b", .fx = FEEDBACK (vx), .fy = FEEDBACK (vy) });
  } else {
    pw_add_friction (m, &(pw_friction){ .name = "T", .body = { "a", "ground" }, .viscous = feedback_c });
    pw_add_drag (m, &(pw_drag){ .name = "F", .body = "b", .linear = feedback_c });
  }
}

/* q and a at 1 s and, from state[12] on, 0.3 steps earlier. */
static void feedback_run (const char *method, double signals, double step, double state[24]) {
  pw_error error = { 0 };
  pw_sample x;
  pw_system *s = scene_system (&feedback_build_table, "signals", signals, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .rtol = 1e-8, .span = 1 });
  runs_to (r, 1);
  for (int i = 0; i < 2; i++, state += 12) {
    check_ok (pw_run_sample (r, 1 - 0.3 * i * step, &x, &error), &error);
    memcpy (state, x.q, 6 * sizeof *state);
    memcpy (state + 6, x.a, 6 * sizeof *state);
  }
  runs_close (r, s);
}

TEST (methods) {
  char name[40];
  for (int i = 0; runs_method (i, name); i++) {
    int adaptive = runs_method (i, name)->adaptive;
    double with[24], without[24], step = adaptive ? 1e-6 : 0.01; /* adaptive: less than the last step of any method */
    double bound = adaptive ? 1e-5 : 1e-9;                       /* 1e3 rtol; the tolerance of galpha's iteration */
    feedback_run (name, 1, step, with);
    feedback_run (name, 0, step, without);
    for (int j = 0; j < 24; j++)
      check_close (name, with[j], without[j], bound * (1 + fabs (without[j])), "the same equations");
  }
}

/* leapfrog would be of order 1 if signals at the end of a step were evaluated with the velocities of its middle. */
TEST (order) {
  double exact[24], coarse[24], fine[24];
  feedback_run ("erk8+projection", 0, 1e-6, exact);
  feedback_run ("leapfrog+rattle", 1, 0.01, coarse);
  feedback_run ("leapfrog+rattle", 1, 0.005, fine);
  double order = log2 (fabs (coarse[2] - exact[2]) / fabs (fine[2] - exact[2]));
  check_close ("order of leapfrog", order, 2, 0.1, "over one halving");
}
