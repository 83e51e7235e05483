/* Integration methods of your own, compiled against the installed headers (docs/method.c is an example).
 *
 * A method is a const pw_method table (pinwheel-solvers.h).  A program passes its tables in pw_settings.methods, and a
 * file ends with PW_METHOD_FILE; their names, other than those of built-in methods, then work in pw_run_open and in
 * commands with --method-file FILE.c, with stabilisations and options.  The
 * run makes the initial state consistent, evaluates it, calls `open`, then `advance` for each step, which must not pass
 * t_end or the next discontinuity and ends with pw_step_accept.  It monitors constraints and energy, and evaluates the
 * state again before it calls `restart` after a discontinuity.
 *
 * The functions below turn a formula for the new state into a one-step method, here the semi-implicit Euler method:
 *
 *     static int euler_open (pw_run *r, pw_error *error) { return pw_step_open (r, 2, error); }
 *
 *     static int euler_advance (pw_run *r, double t_end, pw_error *error) {
 *       const pw_reached x = pw_run_state (r);
 *       double h = pw_step_size (r, t_end), *q = pw_step_array (r, 0), *v = pw_step_array (r, 1);
 *       for (int j = 0; j < pw_system_coordinates (x.system); j++) q[j] = x.q[j] + h * (v[j] = x.v[j] + h * x.a[j]);
 *       return pw_step_accept (r, PW_OK, h, q, v, error);
 *     }
 *
 *     const pw_method euler = { .name = "euler", .open = euler_open, .advance = euler_advance,
 *                               PW_STEP_FUNCTIONS, ... }; */
#ifndef PINWHEEL_METHOD_H
#define PINWHEEL_METHOD_H

#include "pinwheel-solvers.h"

PW_BEGIN

/* The state reached, the end of the last step.  The arrays belong to the run and change when a step is accepted. */
typedef struct {
  const pw_system *system;
  const pw_settings *settings; /* with defaults filled in, except that atol = 0 stays 0 */
  double t;
  double breakpoint;    /* next discontinuity of a signal, at which a step must end; INFINITY: none */
  const double *q, *v;  /* coordinates and velocities */
  const double *a;      /* accelerations */
  const double *lambda; /* multipliers */
} pw_reached;
pw_reached pw_run_state (const pw_run *r);

/* The value of an option of the method's table; for a choice, its index; 0 if there is no such option. */
double pw_run_option (const pw_run *r, const char *name);

/* Accelerations and multipliers at (t, q, v), with Baumgarte's terms if the stabilisation is PW_BAUMGARTE and the
 * table has the options alpha and beta.  PW_RETRY in a singular configuration; PW_METHOD if a signal failed. */
int pw_run_accelerate (pw_run *r, double t, const double *q, const double *v, double *a, double *lambda);

/* The time of a stage: a step that ends at a discontinuity evaluates signals just before it. */
double pw_stage_time (const pw_run *r, double t);

/* ---- One-step methods ---- */

/* Allocates the data of these functions, with `arrays` arrays for the method.  Errors: PW_RESOURCE. */
int pw_step_open (pw_run *r, int arrays, pw_error *error);

/* Array i, the same in every step; its length is the number of coordinates or of constraint equations, whichever is
 * larger. */
double *pw_step_array (pw_run *r, int i);

/* The size of the next step: settings->step; less if it would pass t_end or a discontinuity, or up to 1 % more to end
 * there. */
double pw_step_size (pw_run *r, double t_end);

/* Ends `advance`.  `status` is that of the stages; if it is PW_OK, (q, v) at t + h becomes the state reached:
 * projected onto the constraints if the stabilisation is PW_PROJECTION (in the metric of M), with accelerations and
 * multipliers.  Work and losses are integrated by the trapezoidal rule.  q and v, projected in place, must not be the
 * arrays of pw_run_state.  Errors: PW_METHOD, with the reason. */
int pw_step_accept (pw_run *r, int status, double h, double *q, double *v, pw_error *error);

/* The other functions of the table.  Samples inside a step: q and v by cubic Hermite interpolation, of order 4,
 * projected as at its end; a and lambda by linear interpolation. */
int pw_step_at (pw_run *r, double t, pw_error *error);
int pw_step_restart (pw_run *r, pw_error *error);
void pw_step_close (pw_run *r);
void pw_step_serialise (pw_run *r, pw_archive *a);
#define PW_STEP_FUNCTIONS \
  .at = pw_step_at, .restart = pw_step_restart, .close = pw_step_close, .serialise = pw_step_serialise

/* Ends a file of methods for `pinwheel --method-file`; `methods` is an array of const pw_method *, ended by NULL. */
#define PW_METHOD_FILE(methods_) PW_MODEL (.methods = (methods_))

PW_END

#endif
