/* Opening a run: settings, consistent initial state, accelerations there, method.  Restarts, checkpoints. */
#include <stdlib.h>
#include <string.h>
#include "events.h"
#include "methods.h"
#include "rank.h"

#define RUN_LEAST_RTOL (100 * DBL_EPSILON) /* round-off exceeds smaller tolerances */
#define RUN_MOST_STEPS 1e15                /* of a fixed size: shorter ones vanish in the round-off of the time */

static int run_settings (pw_settings *to, const pw_settings *from, int fixed_steps, pw_error *error) {
  const struct {
    const char *name;
    double value;
  } field[] = { { "step", from->step }, { "rtol", from->rtol }, { "atol", from->atol }, { "span", from->span } };
  for (size_t i = 0; i < sizeof field / sizeof *field; i++)
    if (!isfinite (field[i].value) || field[i].value < 0) /* 0 selects the default */
      return pw_fail (error, PW_INPUT, "setting %s = %g: expected a number > 0", field[i].name, field[i].value);
  if (!fixed_steps && from->rtol > 0 && from->rtol < RUN_LEAST_RTOL)
    return pw_fail (error, PW_INPUT, "setting rtol = %g: round-off allows no less than %.2g", from->rtol,
                    RUN_LEAST_RTOL);
  if (!fixed_steps && from->rtol >= 1)
    return pw_fail (error, PW_INPUT, "setting rtol = %g: expected a number less than 1", from->rtol);
  if (!isfinite (from->t)) return pw_fail (error, PW_INPUT, "setting t = %g: expected a finite number", from->t);
  if (from->max_steps < 0)
    return pw_fail (error, PW_INPUT, "setting max_steps = %ld: expected a number > 0", from->max_steps);
  *to = *from;
  if (to->step == 0) to->step = PW_STEP;
  if (to->rtol == 0) to->rtol = PW_RTOL;
  if (to->max_steps == 0) to->max_steps = PW_MAX_STEPS;
  if (to->span == 0) to->span = fixed_steps ? fmin (1000 * to->step, DBL_MAX) : 1;
  double least_step = (fabs (to->t) + to->span) / RUN_MOST_STEPS;
  if (!fixed_steps || to->step >= least_step) return PW_OK;
  return pw_fail (error, PW_INPUT, "setting step = %g: expected at least %g for a run to t = %g", to->step, least_step,
                  to->t + to->span);
}

static int run_allocate (pw_run *r) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3, rows = (size_t)s->rows, entries = (size_t)r->entries;
  size_t state = pw_state_length (s), scratch = 2 * n + 3 * rows, states = s->saturates ? 2 * n : 0;
  r->memory = PW_ALLOC_ARRAYS (
      PW_ARRAY (r->q, state), PW_ARRAY (r->ledger, entries), PW_ARRAY (r->rate, entries), PW_ARRAY (r->q_at, state),
      PW_ARRAY (r->ledger_at, entries), PW_ARRAY (r->scratch, scratch), PW_ARRAY (r->q_given, 2 * n),
      PW_ARRAY (r->given_before, 2 * n), PW_ARRAY (r->atol, 2 * n), PW_ARRAY (r->tolerance_bound, 2 * n),
      PW_ARRAY (r->matrix_state, states), PW_ARRAY (r->matrix_range, states), PW_ARRAY (r->watchdog.previous_q, 2 * n),
      PW_ARRAY (r->integrand_size, r->settings.integrals), PW_ARRAY (r->integrand_state, 2 * n),
      PW_ARRAY (r->origin, 2 * n));
  if (r->memory == NULL) return PW_RESOURCE;
  r->v = r->q + n, r->a = r->v + n, r->lambda = r->a + n;
  r->v_given = r->q_given + n;
  r->v_at = r->q_at + n, r->a_at = r->v_at + n, r->lambda_at = r->a_at + n;
  for (size_t j = 0; j < 2 * n; j++) r->tolerance_bound[j] = INFINITY;
  for (size_t j = 0; j < states; j++) r->matrix_range[j] = INFINITY;
  return PW_OK;
}

/* Sets the state to the system's initial values, except those that the settings give. */
static int run_initial_values (pw_run *r, const pw_settings *settings, pw_error *error) {
  const pw_system *s = r->s;
  memcpy (r->q, s->q0, (size_t)s->coords * sizeof (double));
  memcpy (r->v, s->v0, (size_t)s->coords * sizeof (double));
  memcpy (r->origin, s->origin, 2 * (size_t)s->coords);
  for (int i = 0; i < settings->initials; i++) {
    const pw_initial_value *x = &settings->initial[i];
    if (x->state < 0 || x->state >= 2 * s->coords || !isfinite (x->value))
      return pw_fail (error, PW_INPUT,
                      "setting initial: state %d = %g: expected a state from 0 to %d and a finite value", x->state,
                      x->value, 2 * s->coords - 1);
    *(x->state < s->coords ? r->q + x->state : r->v + x->state - s->coords) = x->value;
    r->origin[x->state] |= PW_GIVEN;
  }
  return pw_watchdog_check_values (r, error);
}

/* The time scale T: see pw_scale. */
static double run_time_scale (const pw_run *r) {
  const pw_system *s = r->s;
  double fastest = 1 / r->settings.span;
  for (int j = 0; j < s->mechanical; j++) {
    double unit = pw_unit (s, j);
    fastest = fmax (fastest, fmax (fabs (r->v[j]) / unit, sqrt (fabs (r->a[j]) / unit)));
  }
  return 1 / fastest;
}

/* After a part of the opening: PW_STOPPED if the caller requests it. */
static int run_check_stop (pw_run *r, int status) {
  return status >= PW_OK && pw_run_stop_opening (r) ? PW_STOPPED : status;
}

/* Leaves out equations with limits that depend on others, and opens the saddle of those that are left. */
static int run_leave_out (pw_run *r, pw_error *error) {
  pw_error own = { 0 };
  int status = pw_events_spare (r, &own);
  if (status == PW_OK) status = run_check_stop (r, pw_run_open_saddle (r, &own));
  if (status == PW_STOPPED || status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
  if (status == PW_OK && pw_watchdog_sine (r, NULL) >= r->thresholds.rank_suspect) return PW_OK;
  return pw_fail (error, PW_INPUT,
                  "model %s: limits of reactions, as by a grip, with constraints without limits that depend on each "
                  "other: leave out redundant ones",
                  r->s->model);
}

/* Opens the saddle at the consistent initial state and evaluates the accelerations there; if some rows are nearly
 * dependent, an independent set is selected first.  A scene too large for that fails below the sine rank_refused. */
static int run_first_evaluation (pw_run *r, pw_error *error) {
  int status = run_check_stop (r, pw_run_open_saddle (r, error));
  if (status != PW_OK) return status;
  double sine = pw_watchdog_sine (r, NULL);
  int large = (double)r->s->rows * r->s->coords > PW_RANK_MAX_ENTRIES;
  if (sine < (large ? r->thresholds.rank_refused : r->thresholds.rank_suspect)) {
    if (large) return pw_fail_singular (r, r->t, error);
    status = r->events ? run_leave_out (r, error) : run_check_stop (r, pw_rank_open (r, error));
    if (status == PW_OK && r->redundant) status = run_check_stop (r, pw_run_open_saddle (r, error));
    if (status != PW_OK) return status;
  }
  status = pw_run_evaluate (r, error);
  if (status == PW_OK) pw_run_set_references (r);
  return status;
}

/* Initial accelerations that are not finite come from an element or a signal, which is reported, or from a mass that
 * is too small for its force. */
static int run_check_finite (pw_run *r, pw_error *error) {
  char element[PW_NAME_BYTES];
  double sum = 0;
  int infinite = -1; /* the first such acceleration */
  for (int j = 0; j < r->s->coords; j++) {
    sum += fabs (r->a[j]);
    if (infinite < 0 && !isfinite (r->a[j])) infinite = j;
  }
  for (int i = 0; i < r->s->rows; i++) sum += fabs (r->lambda[i]);
  if (isfinite (sum)) return PW_OK;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (pw_find_nonfinite (r->w, element, sizeof element))
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s is not finite", r->t, element);
  if (infinite < 0) return PW_OK; /* only multipliers are infinite, or the sum has overflowed */
  return pw_fail (error, PW_METHOD, "t = %.6g s: the acceleration of %s is not finite", r->t,
                  pw_system_state_name (r->s, infinite, element, sizeof element));
}

int pw_run_check_derivatives (pw_run *r, const char *user, const char *needs, pw_error *error) {
  char block[200];
  int found = pw_find_missing_block (r->w, r->t, r->q, r->v, block, sizeof block);
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (found == PW_RESOURCE) return pw_fail_memory (r->s, error);
  if (found == 0) return PW_OK;
  return pw_fail (
      error, PW_INPUT,
      "model %s: %s is left out, but it is not zero, and %s %s it: add it, or PW_BY_DIFFERENCES in its place",
      r->s->model, block, user, needs);
}

static void checkpoint_add_text (unsigned long long *sum, const char *text) {
  *sum = pw_check_sum (*sum, text, strlen (text) + 1);
}

/* Adds numbers rounded to 1e-6 units and to single precision: libraries of another machine may round differently. */
static void checkpoint_add_state (unsigned long long *sum, const double *x, int n, double unit) {
  for (int j = 0; j < n; j++) {
    float rounded = (float)round (1e6 * x[j] / unit) + 0.0f; /* no -0 */
    *sum = pw_check_sum (*sum, &rounded, sizeof rounded);
  }
}

/* Adds the numbers of a signal; of a function there are none. */
static void checkpoint_add_signal (unsigned long long *sum, const pw_signal *x) {
  static const size_t bytes[] = { [PW_CONSTANT] = sizeof x->constant,
                                  [PW_HARMONIC] = sizeof x->harmonic,
                                  [PW_FUNCTION] = 0,
                                  [PW_RAMP] = sizeof x->ramp,
                                  [PW_SMOOTH_STEP] = sizeof x->ramp,
                                  [PW_PULSE] = sizeof x->pulse,
                                  [PW_TABLE] = 0 };
  *sum = pw_check_sum (*sum, &(int){ (int)x->type }, sizeof (int));
  *sum = pw_check_sum (*sum, &x->constant, bytes[x->type]);
  if (x->type != PW_TABLE) return;
  *sum = pw_check_sum (*sum, (int[]){ x->table.interpolation, x->table.ends }, 2 * sizeof (int));
  *sum = pw_check_sum (*sum, x->table.t, (size_t)x->table.count * sizeof (double));
  *sum = pw_check_sum (*sum, x->table.value, (size_t)x->table.count * sizeof (double));
}

/* A check sum, at the initial state, of what a saved state must share with the run that loads it: method, options,
 * settings, masses, names, numbers of signals, initial state and accelerations. */
static unsigned long long checkpoint_identity (const pw_run *r) {
  const pw_system *s = r->s;
  const pw_settings *set = &r->settings;
  const double number[] = { set->t, set->span, set->step, set->rtol, set->atol, set->ledger, r->fixed_steps };
  unsigned long long sum = pw_check_sum (PW_CHECK, number, sizeof number);
  sum = pw_check_sum (sum, r->option, sizeof r->option);
  sum = pw_check_sum (sum, s->mass, (size_t)s->coords * sizeof *s->mass);
  checkpoint_add_text (&sum, r->method->name);
  checkpoint_add_text (&sum, r->method->stabilisations[r->stabilisation].name);
  for (int b = 0; b < s->bodies; b++) checkpoint_add_text (&sum, s->body_name[b]);
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    checkpoint_add_text (&sum, k->kind->name);
    for (int e = 0; e < k->b.count; e++) checkpoint_add_text (&sum, k->name[e]);
  }
  for (int i = 0; i < s->sources; i++) checkpoint_add_signal (&sum, &s->source[i].signal);
  checkpoint_add_state (&sum, r->q, s->coords, s->scale.length);
  checkpoint_add_state (&sum, r->v, s->coords, s->scale.length);
  checkpoint_add_state (&sum, r->a, s->coords, s->scale.length);
  return sum;
}

/* The function that makes a step, without regard to signals. */
static int (*run_step (const pw_run *r)) (pw_run *r, double t_end, pw_error *error) {
  return r->events && !r->method->locates_no_events ? pw_events_advance : r->method->advance;
}

/* A step in which signals, events and conditions are watched. */
static int run_watched_advance (pw_run *r, double t_end, pw_error *error) {
  const double t0 = r->t;
  int status = r->sides ? pw_sides_begin (r, error) : PW_OK;
  if (r->resolution && status == PW_OK) t_end = fmin (t_end, pw_resolution_end (r));
  if (status == PW_OK) status = run_step (r) (r, t_end, error);
  return r->sides && status == PW_OK ? pw_sides_follow (r, t0, error) : status;
}

static int run_watch_steps (pw_run *r, pw_error *error) {
  r->resolved_until = INFINITY;
  if (r->s->sources == 0 && r->settings.integrals == 0) return PW_OK;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  int status = pw_resolution_open (r, error);
  if (status == PW_OK) status = pw_sides_open (r, error);
  if (r->resolution || r->sides) r->advance = run_watched_advance;
  return status;
}

static int run_open (pw_run *r, const char *method, const pw_settings *settings, pw_error *error) {
  const pw_settings none = { 0 };
  if (settings == NULL) settings = &none;
  r->thresholds = pw_watchdog_thresholds;
  r->refused_sine = r->thresholds.rank_lost;
  r->settings.integrals = settings->integrals, r->entries = r->s->entries + settings->integrals;
  if (run_allocate (r) != PW_OK) return pw_fail_memory (r->s, error);
  int status = run_initial_values (r, settings, error);
  if (status == PW_OK)
    status = pw_parse_options (method, settings->methods, &r->method, &r->stabilisation, r->option, error);
  if (status != PW_OK) return status;
  r->fixed_steps = !pw_method_adaptive (r->method, method);
  status = run_settings (&r->settings, settings, r->fixed_steps, error);
  if (status != PW_OK) return status;
  r->t = r->settings.t;
  pw_hold_signals (r->w, PW_HOLD_NONE);
  r->w->scale.time = r->settings.span; /* until the accelerations are known */
  status = run_check_stop (r, pw_events_open (r, error));
  if (status == PW_OK) status = run_first_evaluation (r, error);
  if (status == PW_OK) status = run_check_finite (r, error);
  if (status != PW_OK) return status;
  r->w->scale.time = run_time_scale (r);
  pw_ledger_begin (r);
  status = pw_events_begin (r, error); /* velocities may jump */
  if (r->events && status == PW_OK) r->w->scale.time = run_time_scale (r);
  r->advance = run_step (r);
  if (status != PW_OK) return status;
  for (int j = 0, n = r->s->coords; j < n; j++) {
    const int is_state = j >= r->s->mechanical;
    const double rtol = r->settings.rtol, given = r->settings.atol, unit = is_state ? 1 : pw_unit (r->s, j);
    r->atol[j] = is_state ? INFINITY : given > 0 ? given : rtol * unit;
    r->atol[n + j] = given > 0 ? given : rtol * unit / (is_state ? 1 : r->w->scale.time);
  }
  pw_run_count_moved (r);
  pw_run_set_reference_level (r);
  pw_forget_residuals (r);
  pw_record_residuals (r);
  status = pw_run_look_ahead (r, error);
  if (status != PW_OK) return status;
  if (pw_stabilised_by (r, PW_BAUMGARTE)) r->alpha = pw_run_option (r, "alpha"), r->beta = pw_run_option (r, "beta");
  r->identity = checkpoint_identity (r);
  status = pw_specialised_open (r, error);
  if (status == PW_OK) status = run_check_stop (r, r->method->open (r, error));
  if (status == PW_OK) status = run_watch_steps (r, error);
  if (status != PW_OK || !r->uses_derivatives) return status;
  return pw_run_check_derivatives (r, method, "needs", error);
}

static pw_run *run_new (const pw_system *s, const char *method, const pw_settings *settings, int inconsistent,
                        pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK) return NULL;
  pw_run *r = calloc (1, sizeof *r);
  if (r == NULL) {
    pw_fail_memory (s, error);
    return NULL;
  }
  r->s = s;
  r->inconsistent = inconsistent;
  r->w = pw_workspace_new (s, error);
  int status = r->w ? pw_run_annotate_error (r, run_open (r, method, settings, error), error) : PW_RESOURCE;
  if (status == PW_OK) return r;
  if (status == PW_STOPPED) pw_fail (error, PW_STOPPED, "model %s: stopped before the first step", s->model);
  pw_run_close (r);
  return NULL;
}

pw_run *pw_run_open (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error) {
  return run_new (s, method, settings, 0, error);
}

pw_run *pw_run_open_inconsistent (const pw_system *s, const char *method, const pw_settings *settings,
                                  pw_error *error) {
  return run_new (s, method, settings, 1, error);
}

/* Checks given positions or velocities x, whose states begin at `first`; NULL: none are given. */
static int restart_check (const pw_run *r, const double *x, int first, pw_error *error) {
  for (int j = 0, n = r->s->coords; x && j < n; j++)
    if (!(fabs (x[j]) < r->thresholds.extreme))
      return pw_fail (error, PW_INPUT, "model %s: restart with %s = %g: expected a magnitude below %g", r->s->model,
                      PW_NAME (pw_system_state_name, r->s, first + j), x[j], r->thresholds.extreme);
  return PW_OK;
}

static int restart_energy (pw_run *r, double *energy, pw_error *error) {
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  *energy = pw_energy (r, r->v);
  return PW_OK;
}

/* Continues from r->q and r->v, made consistent; *energy: that of the state reached. */
static int restart_continue (pw_run *r, double *energy, pw_error *error) {
  r->near_singular = 0;
  r->watchdog.singular_ahead = 1;
  if (r->events) return pw_events_restart (r, energy, error);
  int status = pw_run_select_rows (r, error);
  if (status == PW_OK) status = pw_run_make_consistent (r, NULL, error);
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  if (status == PW_OK) status = restart_energy (r, energy, error);
  if (status != PW_OK) return status;
  status = r->method->restart (r, error);
  r->interrupted = status != PW_OK; /* then the method is restarted before the next step */
  return status;
}

/* Of a run with events: saves the state reached, ledger and modes, or makes the saved ones those of the run. */
static void restart_keep (pw_run *r, pw_archive *a) {
  if (r->events == NULL) return;
  pw_archive_bytes (a, r->q, pw_state_length (r->s) * sizeof *r->q);
  pw_archive_bytes (a, r->ledger, (size_t)r->entries * sizeof *r->ledger);
  pw_events_serialise (r, a);
}

/* A change of energy by the caller is not an error of the method: it is added to the initial energy.  The caller's
 * functions may return other values and breakpoints than before.  The previous state moves to the sample arrays, in
 * which q and v may be, and the values given before to r->given_before. */
int pw_run_restart (pw_run *r, const double *q, const double *v, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  double before = 0, after = 0, *given = r->scratch;
  const size_t n = (size_t)r->s->coords, bytes = n * sizeof *q;
  if (pw_run_has_no_method (r, error)) return PW_RESOURCE;
  if (restart_check (r, q, 0, error) != PW_OK || restart_check (r, v, r->s->coords, error) != PW_OK) return PW_INPUT;
  r->w->failed = NULL;
  r->interrupted |= r->t >= r->breakpoint; /* and remains so if the restart is refused */
  int status = restart_energy (r, &before, error);
  if (status == PW_OK) status = pw_run_look_ahead (r, error);
  if (status != PW_OK) return pw_run_annotate_error (r, status, error);
  const double reselect_below = r->reselect_below;
  const pw_initial_report initial = r->initial;
  pw_archive kept = { .at = NULL };
  restart_keep (r, &kept);
  if (kept.failed) return pw_fail_memory (r->s, error);
  r->w->t_signal = NAN;
  memcpy (given, q ? q : r->q, bytes);
  memcpy (given + n, v ? v : r->v, bytes);
  memcpy (r->q_at, r->q, pw_state_length (r->s) * sizeof *q);
  memcpy (r->given_before, r->q_given, 2 * (n + 3) * sizeof *q);
  memcpy (r->q, given, bytes);
  memcpy (r->v, given + n, bytes);
  r->predicted = 0;
  pw_run_free_sides (r);
  status = restart_continue (r, &after, error);
  if (status == PW_OK) {
    r->moved_from = r->t;
    pw_run_count_moved (r);
    pw_watchdog_begin (r);
    if (!r->near_singular)
      pw_run_set_reference_level (r); /* accelerations near a singular configuration are no reference */
    r->energy0 += after - before;
    pw_archive_free (&kept);
    return PW_OK;
  }
  pw_run_annotate_error (r, status, error);
  memcpy (r->q, r->q_at, pw_state_length (r->s) * sizeof *r->q);
  if (r->events) {
    pw_archive from = { .at = kept.at, .size = kept.used, .loading = 1 };
    restart_keep (r, &from);
    pw_archive_free (&kept);
    if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK || pw_run_renew (r, NULL) != PW_OK) r->interrupted = 1;
  }
  memcpy (r->q_given, r->given_before, 2 * (n + 3) * sizeof *r->q);
  r->reselect_below = reselect_below, r->initial = initial;
  if (pw_run_select_rows (r, NULL) == PW_OK && pw_run_evaluate (r, NULL) == PW_OK && r->redundant)
    pw_watchdog_begin (r);
  r->interrupted |= r->redundant > 0; /* pw_run_select_rows may have opened the method at the refused state */
  return status;
}

/* A force changes accelerations alone, so that the method is restarted before the next step, as at a breakpoint. */
int pw_run_set_input (pw_run *r, int signal, double value, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  pw_source *x = signal >= 0 && signal < r->s->sources ? &r->w->source[signal] : NULL;
  if (x == NULL || x->signal.type != PW_HARMONIC)
    return pw_fail (error, PW_INPUT, "model %s: %s: expected a harmonic signal, whose place the value takes",
                    r->s->model, x ? PW_NAME (pw_system_signal_name, r->s, signal) : "an input that does not exist");
  if (!(fabs (value) < r->thresholds.extreme))
    return pw_fail (error, PW_INPUT, "model %s: input %s = %g: expected a magnitude below %g", r->s->model,
                    PW_NAME (pw_system_signal_name, r->s, signal), value, r->thresholds.extreme);
  const pw_harmonic before = x->signal.harmonic;
  if (before.amplitude == 0 && before.offset == value) return PW_OK;
  x->signal.harmonic = (pw_harmonic){ .offset = value };
  r->w->t_signal = NAN;
  r->interrupted |= x->of_force;
  const int status = x->of_force ? PW_OK : pw_run_restart (r, NULL, NULL, error);
  if (status != PW_OK) x->signal.harmonic = before, r->w->t_signal = NAN;
  return status;
}

/* Checkpoints: the state of a run as bytes.
 *
 * What a method or a factorisation has built up, such as pivot choices and earlier values of a multistep formula, is
 * not saved: the saved run and the loaded one both rebuild it from the state reached, and so continue alike.  A
 * method's `serialise` adds what it cannot rebuild: step size, counts. */

/* Saves identity and sizes of the run, or reads those of a saved one; 1 if they are the same. */
static int checkpoint_same (pw_run *r, pw_archive *a) {
  unsigned long long identity = r->identity;
  pw_archive_bytes (a, &identity, sizeof identity);
  const int own[] = { r->s->coords, r->s->rows, r->entries, r->redundant };
  enum { SIZES = sizeof own / sizeof *own };
  int same = identity == r->identity;
  for (int i = 0; i < SIZES; i++) {
    int size = own[i];
    pw_archive_bytes (a, &size, sizeof size);
    same &= size == own[i];
  }
  return same;
}

#define CHECKPOINT_LONG(name) long name;
#define CHECKPOINT_DOUBLE(name) double name;
typedef struct {
  PW_STATISTICS_COUNTS (CHECKPOINT_LONG)
  PW_STATISTICS_RESIDUALS (CHECKPOINT_DOUBLE)
} checkpoint_members;
_Static_assert(sizeof (checkpoint_members) == sizeof (pw_statistics),
               "enter each member of pw_statistics in util.h, PW_STATISTICS_..., and a count also in docs/manual.md");

static void checkpoint_state (pw_run *r, pw_archive *a) {
  size_t n = (size_t)r->s->coords * sizeof (double), entries = (size_t)r->entries * sizeof (double);
  double *const number[] = {
    &r->t,     &r->breakpoint,      &r->projected,     &r->energy0,      &r->potential0,     &r->exchanged,
    &r->power, &r->reference_level, &r->previous_norm, &r->independence, &r->reselect_below, &r->watchdog.largest_sine
  };
  for (size_t i = 0; i < sizeof number / sizeof *number; i++) pw_archive_bytes (a, number[i], sizeof (double));
  pw_archive_bytes (a, r->q, n);
  pw_archive_bytes (a, r->v, n);
  pw_archive_bytes (a, r->ledger, entries);
  for (int i = 0; i < r->s->sources; i++) /* values of inputs */
    if (r->s->source[i].signal.type == PW_HARMONIC)
      pw_archive_bytes (a, &r->w->source[i].signal.harmonic, sizeof (pw_harmonic));
  if (a->loading) r->w->t_signal = NAN;
#define CHECKPOINT_COUNT(name) pw_archive_count (a, &r->statistics.name);
#define CHECKPOINT_RESIDUAL(name) pw_archive_bytes (a, &r->statistics.name, sizeof (double));
  PW_STATISTICS_COUNTS (CHECKPOINT_COUNT)
  PW_STATISTICS_RESIDUALS (CHECKPOINT_RESIDUAL)
  pw_rank_serialise (r, a);
  pw_events_serialise (r, a);
  pw_run_serialise_sides (r, a);
}

/* Continues from the run's state, which was just saved or loaded, and loads the method's own data, if any, from a. */
static int checkpoint_continue (pw_run *r, pw_archive *a, pw_error *error) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  r->near_singular = 0;
  r->predicted = 0;
  if (r->method->serialise == NULL) r->statistics.restarts++;
  int status = pw_run_renew (r, error);
  if (status == PW_OK && r->method->serialise) r->method->serialise (r, a);
  if (status == PW_OK && a->failed) return pw_fail (error, PW_INPUT, "the saved state does not belong to this run");
  return status;
}

int pw_run_save (pw_run *r, pw_archive *a, pw_error *error) {
  pw_sample sample;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (r->near_singular) return PW_RETRY;
  int status = pw_run_settle (r, error);
  if (status == PW_OK)
    status = pw_run_sample (r, r->t, &sample, error); /* some methods evaluate the state reached only here */
  if (status != PW_OK) return status;
  checkpoint_same (r, a);
  checkpoint_state (r, a);
  pw_archive saved = { .used = a->used, .loading = 1 }; /* to load what the method saves next */
  if (r->method->serialise) r->method->serialise (r, a);
  if (a->failed) return pw_fail_memory (r->s, error);
  saved.at = a->at;
  saved.size = a->used;
  return checkpoint_continue (r, &saved, error);
}

int pw_run_load (pw_run *r, pw_archive *a, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (r->statistics.steps > 0 || r->t != r->settings.t)
    return pw_fail (error, PW_INPUT, "the run has advanced to t = %g s: a saved state needs a new one", r->t);
  int same = checkpoint_same (r, a);
  if (same) checkpoint_state (r, a);
  if (!same || a->failed) return pw_fail (error, PW_INPUT, "the saved state does not belong to this run");
  if (!isfinite (r->t) || r->t < r->settings.t || !pw_is_finite_state (r, r->q, r->v)) /* not written by a run */
    return pw_fail (
        error, PW_INPUT,
        "the saved state is not that of a run: its time, t = %g s, or a coordinate or velocity is impossible", r->t);
  return checkpoint_continue (r, a, error);
}
