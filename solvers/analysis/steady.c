/* The search for steady motions; equations in steady_equations.c. */
#include "steady_parts.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "util.h"

enum {
  STEADY_POINTS = 50,       /* of a branch, by default */
  STEADY_BREAKPOINTS = 1000 /* that are followed to find the last one */
};
static const double STEADY_EXACT = 1e-9, /* largest residual of a solution, in units of the scene */
    STEADY_SLOW = 1e-4,     /* rates that may be round-off at a double root: more than the root of STEADY_EXACT */
    STEADY_CRAWL = 1e-2,    /* the same at a root of higher order */
    STEADY_REGULAR = 1e-13, /* Newton's method ends at smaller residuals unless the root is of higher order */
    SUGGEST_CHANGE = 1e-8,  /* a quantity is worth holding if the square of its change along the family, without the */
    SUGGEST_LEFT = 1e-6;    /* part that is held already, exceeds SUGGEST_CHANGE, and SUGGEST_LEFT x the whole square */

/* ---- Opening ---- */

int pw_check_search (double first, double last, int points, pw_error *error) {
  if (!isfinite (first) || !isfinite (last))
    return pw_fail (error, PW_INPUT, "settings first = %g, last = %g: expected finite numbers", first, last);
  if (points < 0) return pw_fail (error, PW_INPUT, "setting points = %d: expected a number > 0", points);
  return PW_OK;
}

static int steady_arrays (pw_steady *x) {
  size_t n = (size_t)x->n, m = (size_t)x->m, rates = (size_t)pw_steady_rate_count (x->s), unknowns = n + rates;
  size_t holds = (size_t)x->settings.holds;
  const pw_array array[] = {
    { &x->symmetry, rates * rates },
    { &x->free_symmetry, rates * rates },
    { &x->norm, m },
    { &x->start, 2 * n },
    { &x->q, n + 3 },
    { &x->v, n + 3 },
    { &x->rates, rates },
    { &x->combined, rates },
    { &x->u, unknowns + 1 },
    { &x->F, n * rates + (1 + PW_STEADY_WORK) * unknowns },
    { &x->scratch[0], n },
    { &x->scratch[1], n },
    { &x->scratch[2], n },
    { &x->dq, n },
    { &x->dv, n },
    { &x->null_space, (unknowns + 1) * (unknowns + 1) },
  };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  x->solution = pw_arena_alloc (&x->arena, 2 * n * sizeof *x->solution);
  x->hold = pw_arena_alloc (&x->arena, (holds + n) * sizeof *x->hold);
  if (!x->memory || !x->solution || !x->hold) return PW_RESOURCE;
  if (holds) memcpy (x->hold, x->settings.hold, holds * sizeof *x->hold);
  for (int j = 0; j < 2 * x->n; j++) x->solution[j].state = j;
  return PW_OK;
}

/* The last breakpoint of signals within the span. */
static double steady_last_breakpoint (pw_workspace *w, double t, double span) {
  double end = t + span, next = t;
  for (int i = 0; i < STEADY_BREAKPOINTS && next <= end; i++) t = next, next = pw_next_breakpoint (w, 1, t);
  return t;
}

/* PW_INPUT if a signal changes with time within the span: the message names the first one and, if no signal changes
 * after the last breakpoint, the time of this breakpoint, rounded up. */
static int steady_constant (pw_steady *x, pw_error *error) {
  pw_run *r = x->system.run;
  char text[32];
  const double span = r->settings.span; /* with its default */
  int changed, later, status = pw_signals_change (r, x->settings.t, 0, span, &changed, error);
  if (status != PW_OK || changed < 0) return status;
  const char *name = PW_NAME (pw_system_signal_name, x->s, changed);
  double last = steady_last_breakpoint (r->w, x->settings.t, span);
  status = pw_signals_change (r, last, 0, span, &later, error);
  if (status != PW_OK) return status;
  snprintf (text, sizeof text, "%.9g", last);
  if (strtod (text, NULL) < last) snprintf (text, sizeof text, "%.9g", last * (1 + 1e-8));
  if (later < 0)
    return pw_fail (error, PW_INPUT,
                    "model %s: signal %s changes with time, but after %s s no signal does: give --at %s", x->s->model,
                    name, text, text);
  return pw_fail (
      error, PW_INPUT,
      "model %s: signal %s changes with time, so that there are no steady motions; `pinwheel periodic` finds "
      "periodic ones",
      x->s->model, name);
}

/* Whether signals may change with time. */
typedef enum { SIGNALS_CONSTANT, SIGNALS_MAY_CHANGE } signal_rule;

/* Stores the initial state and scales at the first value of the parameter. */
static int steady_begin (pw_steady *x, pw_error *error) {
  if (pw_steady_open_system (x, x->settings.first) != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  const pw_run *r = x->system.run;
  x->L = x->s->scale.length;
  x->T = r->w->scale.time;
  memcpy (x->start, r->q, (size_t)x->n * sizeof *r->q);
  memcpy (x->start + x->n, r->v, (size_t)x->n * sizeof *r->v);
  if (x->s->bodies) memcpy (x->origin, r->q, sizeof x->origin);
  return PW_OK;
}

/* Checks the signals and sets the symmetries and x->norm, all within the range: at its ends, for instance without
 * gravity, there may be more symmetries.  Leaves the system open at the first value. */
static int steady_symmetries (pw_steady *x, signal_rule signals, pw_error *error) {
  const double first = x->settings.first;
  int status = pw_steady_open_system (x, pw_value_within (first, x->settings.last));
  if (status != PW_OK) status = pw_steady_open_system (x, first);
  if (status != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  if (signals == SIGNALS_CONSTANT) status = steady_constant (x, error);
  if (status != PW_OK) return status;
  status = pw_steady_find_symmetries (x);
  if (status == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (status != PW_OK) return pw_fail_singular (x->system.run, x->settings.t, error);
  for (int i = 0; i < x->m; i++) x->norm[i] = x->system.linearisation.norm[i] > 0 ? x->system.linearisation.norm[i] : 1;
  status = pw_steady_open_system (x, first);
  return status == PW_OK ? PW_OK : pw_fail (error, x->why.status, "%s", x->why.text);
}

/* Holds the velocities of angles that nothing turns, which they keep. */
static void steady_hold_unturned (pw_steady *x) {
  for (int j = 0; j < x->n; j++) {
    int held = !pw_is_unturned (x->s, j);
    for (int i = 0; i < x->settings.holds; i++) held |= x->hold[i].state == x->n + j;
    if (!held) x->hold[x->settings.holds++] = (pw_initial_value){ .state = x->n + j, .value = x->start[x->n + j] };
  }
}

static int steady_open_branch (pw_steady *x, pw_error *error) {
  const pw_branch_problem problem = { .unknowns = pw_steady_unknowns (x),
                                      .equations = pw_steady_equations (x),
                                      .tolerance = STEADY_EXACT,
                                      .evaluate = pw_steady_evaluate,
                                      .same = pw_steady_same_motion,
                                      .check_step = pw_steady_check_step,
                                      .context = x };
  return pw_branch_open (&x->branch, &problem, error);
}

static pw_steady *steady_open (const pw_system *s, const pw_steady_settings *settings, signal_rule signals,
                               pw_error *error) {
  pw_steady *x = calloc (1, sizeof *x);
  if (x == NULL) return pw_fail_memory (s, error), NULL;
  x->s = s, x->settings = *settings;
  x->n = s->coords, x->m = s->rows, x->holonomic = s->holonomic;
  if (x->settings.points == 0) x->settings.points = STEADY_POINTS;
  int status = PW_OK;
  if (x->n > PW_STEADY_MAX_COORDINATES)
    status = pw_fail (error, PW_INPUT, "model %s has %d coordinates; steady motions are sought with at most %d",
                      s->model, x->n, PW_STEADY_MAX_COORDINATES);
  if (status == PW_OK && steady_arrays (x) != PW_OK) status = pw_fail_memory (s, error);
  if (status == PW_OK) status = steady_begin (x, error);
  if (status == PW_OK && signals == SIGNALS_CONSTANT) steady_hold_unturned (x);
  if (status == PW_OK) status = steady_symmetries (x, signals, error);
  if (status == PW_OK) status = steady_open_branch (x, error);
  if (status == PW_OK) return x;
  pw_steady_close (x);
  return NULL;
}

static int steady_check_settings (const pw_system *s, const pw_steady_settings *set, pw_error *error) {
  const int most = 2 * s->coords + PW_HOLD_OF_BODY * s->bodies - 1;
  if (pw_check_search (set->first, set->last, set->points, error) != PW_OK) return PW_INPUT;
  if (set->holds < 0 || (set->holds > 0 && set->hold == NULL))
    return pw_fail (error, PW_INPUT, "setting holds = %d: expected the number of entries of `hold`", set->holds);
  for (const pw_initial_value *x = set->hold, *end = x + set->holds; x < end; x++)
    if (x->state < 0 || x->state > most || !isfinite (x->value))
      return pw_fail (error, PW_INPUT, "setting hold: quantity %d = %g: expected one from 0 to %d and a finite value",
                      x->state, x->value, most);
  if (set->vary >= -1 && set->vary < set->holds) return PW_OK;
  return pw_fail (error, PW_INPUT, "setting vary = %d: expected -1 or an index of `hold`, below holds = %d", set->vary,
                  set->holds);
}

pw_steady *pw_steady_open (const pw_system *s, const pw_steady_settings *settings, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK || pw_require (settings, "settings", error) != PW_OK) return NULL;
  if (steady_check_settings (s, settings, error) != PW_OK) return NULL;
  return steady_open (s, settings, SIGNALS_CONSTANT, error);
}

pw_steady *pw_steady_open_symmetries (const pw_system *s, const pw_steady_settings *settings, pw_error *error) {
  return steady_open (s, settings, SIGNALS_MAY_CHANGE, error);
}

void pw_steady_close (pw_steady *x) {
  if (x == NULL) return;
  pw_steady_close_system (x);
  pw_branch_close (&x->branch);
  pw_linear_free (&x->linear);
  pw_arena_free (&x->arena);
  free (x->memory);
  free (x);
}

const char *pw_steady_reason (const pw_steady *x) {
  return x ? x->why.text : "";
}

int pw_steady_symmetries (const pw_steady *x) {
  return x ? x->symmetries : 0;
}

/* ---- Solutions ---- */

int pw_steady_motion_at (pw_steady *x, const double *u, pw_steady_motion *out, pw_error *error) {
  int status = pw_steady_open_system (x, pw_steady_parameter (x, u));
  if (status != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  pw_run *r = x->system.run;
  pw_steady_state (x, u);
  x->solved = 1;
  for (int j = 0; j < x->n; j++) x->solution[j].value = x->q[j], x->solution[x->n + j].value = x->v[j];
  memcpy (r->q, x->q, (size_t)x->n * sizeof *r->q);
  memcpy (r->v, x->v, (size_t)x->n * sizeof *r->v);
  pw_linear_free (&x->linear);
  status = pw_run_linearise (r, PW_STEADY_MAX_COORDINATES, &x->linear, error);
  if (status != PW_OK) return status;
  out->parameter = pw_steady_parameter (x, u);
  out->q = x->q, out->v = x->v;
  out->linear = &x->linear;
  out->unstable = x->neutral = 0;
  for (int i = 0; i < x->linear.unknowns; i++) {
    out->unstable += x->linear.re[i] > 0 && !x->linear.rigid[i];
    x->neutral += x->linear.re[i] == 0;
  }
  return PW_OK;
}

/* Sets x->null_space to the directions in which solutions form a family, without those of free symmetries.  Returns
 * their number, or a status < 0. */
static int steady_family (pw_steady *x) {
  int unknowns = pw_steady_unknowns (x), equations = pw_steady_equations (x);
  pw_error none = { 0 };
  int status = pw_steady_find_free_symmetries (x);
  if (status != PW_OK) return status;
  memset (x->branch.J, 0, (size_t)equations * ((size_t)unknowns + 1) * sizeof *x->branch.J);
  status = pw_steady_evaluate (x, x->u, x->branch.F, x->branch.J, &none);
  if (status != PW_OK) return status == PW_RESOURCE ? status : PW_METHOD;
  return pw_null_space (equations, unknowns, x->branch.J, PW_STEADY_RANK, x->null_space);
}

/* Replaces rates below the accuracy of a multiple root by rest, if that is a solution, too: then 1. */
static int steady_rest (pw_steady *x) {
  size_t bytes = ((size_t)pw_steady_unknowns (x) + 1) * sizeof *x->u;
  pw_error none = { 0 };
  double most = 0;
  for (int k = x->n; k < pw_steady_unknowns (x); k++) most = fmax (most, fabs (x->u[k]));
  if (most == 0 || most > (x->branch.residual > STEADY_REGULAR ? STEADY_CRAWL : STEADY_SLOW)) return 0;
  memcpy (x->null_space, x->u, bytes);
  memset (x->u + x->n, 0, (size_t)x->symmetries * sizeof *x->u);
  if (pw_branch_solve (&x->branch, x->u, &none) == PW_OK) return 1;
  memcpy (x->u, x->null_space, bytes);
  return 0;
}

/* Newton's method from the state of an attempt. */
static int steady_converge (pw_steady *x, int attempt, double parameter, pw_steady_motion *out, pw_error *error) {
  const double range = x->settings.last - x->settings.first;
  x->free_symmetries = 0;
  int status = pw_steady_start (x, attempt, x->u, error);
  if (status != PW_OK) return status;
  x->u[pw_steady_unknowns (x)] = range != 0 ? (parameter - x->settings.first) / range : 0;
  status = pw_branch_solve (&x->branch, x->u, error);
  out->iterations = x->branch.iterations;
  out->residual = x->branch.residual;
  if ((status == PW_OK || status == PW_RETRY) && steady_rest (x))
    status = PW_OK, out->iterations = x->branch.iterations, out->residual = x->branch.residual;
  pw_steady_state (x, x->u);
  return status;
}

/* Removes symmetries that the solution reached does not have: then PW_RETRY. */
static int steady_lose_symmetries (pw_steady *x, pw_error *error) {
  const int symmetries = x->symmetries, status = pw_steady_keep_symmetries (x);
  if (status == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (status != PW_OK || x->symmetries == symmetries) return PW_OK;
  pw_branch before = x->branch;
  const int opened = steady_open_branch (x, error);
  pw_branch_close (opened == PW_OK ? &before : &x->branch);
  if (opened == PW_OK) return PW_RETRY;
  x->branch = before;
  return opened;
}

int pw_steady_solve (pw_steady *x, int attempt, double parameter, pw_steady_motion *out, pw_error *error) {
  *out = (pw_steady_motion){ .parameter = parameter, .residual = INFINITY };
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  if (attempt < 0) return pw_fail (error, PW_INPUT, "attempt = %d: expected a number >= 0", attempt);
  if (pw_check_parameter (parameter, error) != PW_OK) return PW_INPUT;
  if (pw_steady_open_system (x, parameter) != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  int status, known;
  do {
    status = steady_converge (x, attempt, parameter, out, error);
    out->q = x->q, out->v = x->v;
    if (status != PW_OK) return status;
    known = steady_lose_symmetries (x, error);
  } while (known == PW_RETRY);
  if (known != PW_OK) return known;
  out->family = steady_family (x);
  if (out->family == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (out->family < 0) return pw_fail (error, PW_METHOD, "the family of the steady motion cannot be determined");
  pw_steady_move_to_start (x, x->q, x->v);
  status = pw_steady_nearest (x, x->q, x->v, x->u, error);
  return status == PW_OK ? pw_steady_motion_at (x, x->u, out, error) : status;
}

/* ---- Suggestions ---- */

/* The change of a quantity along direction i of the family, in units of the scene; if `relative` is 1, the
 * change of an angle less that of the angle of the first body. */
static double suggest_change (pw_steady *x, const pw_initial_value *hold, int relative, int i) {
  const double *z = x->null_space + (size_t)i * (size_t)pw_steady_unknowns (x);
  double *dq = x->dq, *dv = x->dv;
  pw_steady_combine (x, z + x->n, x->T, x->combined);
  pw_steady_velocities (x, x->combined, x->q, dv);
  for (int j = 0; j < x->n; j++) dq[j] = z[j] * pw_unit (x->s, j);
  pw_linear_turn (&x->system.linearisation, x->rates[PW_RATE_TURN], dq, dv);
  return pw_hold_residual (x, hold, dq, dv) - (relative ? dq[2] : 0);
}

/* Whether holding a quantity makes the family smaller.  `basis` has `count` orthonormal rows of length `family`, the
 * changes of what is held already along the family; that of this quantity becomes the next row. */
static int suggest_helps (pw_steady *x, const pw_initial_value *hold, int relative, int family, double *basis,
                          int count) {
  double *row = basis + count * family, left = 0, whole = 0; /* squares */
  for (int i = 0; i < family; i++) row[i] = suggest_change (x, hold, relative, i), whole += row[i] * row[i];
  for (int k = 0; k < count; k++) {
    double dot = 0;
    for (int i = 0; i < family; i++) dot += row[i] * basis[k * family + i];
    for (int i = 0; i < family; i++) row[i] -= dot * basis[k * family + i];
  }
  for (int i = 0; i < family; i++) left += row[i] * row[i];
  for (int i = 0; i < family; i++) row[i] /= sqrt (left);
  return left > SUGGEST_CHANGE && left > SUGGEST_LEFT * whole;
}

/* Candidate c to hold, as numbered by pw_system_find_held: speed and angular velocity of the first body; angles of
 * bodies; internal coordinates; positions; speed and angular velocity of every body. */
static int suggest_candidate (const pw_steady *x, int c) {
  int n = x->n, bodies = x->s->bodies;
  if (c < 2) return c == 0 ? 2 * n : n + 2;
  if ((c -= 2) < bodies) return 3 * c + 2;
  if ((c -= bodies) < n - 3 * bodies) return 3 * bodies + c;
  if ((c -= n - 3 * bodies) < 2 * bodies) return c / 2 * 3 + c % 2;
  c -= 2 * bodies;
  return c % 2 ? n + c / 2 * 3 + 2 : 2 * n + c / 2 * PW_HOLD_OF_BODY;
}

int pw_steady_suggest (pw_steady *x, pw_initial_value *hold, int most) {
  int family = x ? steady_family (x) : PW_INPUT, count = 0, held = 0;
  int turns = 0, anchored = 0; /* 1: the whole can turn; the angle of the first body is held, to which others relate */
  if (family < 0) return family;
  double *basis = calloc ((size_t)family * ((size_t)family + 1) + 1, sizeof *basis);
  if (basis == NULL) return PW_RESOURCE;
  for (int k = 0; k < x->free_symmetries; k++)
    for (int i = 0; i < x->symmetries; i++)
      turns |=
          x->free_symmetry[k * x->symmetries + i] * x->symmetry[i * pw_steady_rate_count (x->s) + PW_RATE_TURN] != 0;
  for (int c = 0; c < 2 + x->n + 2 * x->s->bodies && held < family && count < most; c++) {
    pw_initial_value try = { .state = suggest_candidate (x, c) };
    int placed = try.state < 3 * x->s->bodies; /* 1: a position or an angle of a body */
    int relative = turns && placed && try.state % 3 == 2;
    if (turns && placed && !relative) continue;
    if (!suggest_helps (x, &try, relative, family, basis, held)) continue;
    if (relative && !anchored && count < most)
      hold[count++] = (pw_initial_value){ .state = 2, .value = x->q[2] }, anchored = 1;
    if (count == most) break;
    try.value = pw_system_held_value (x->s, try.state, x->q, x->v);
    hold[count++] = try;
    held++;
  }
  free (basis);
  return count;
}
