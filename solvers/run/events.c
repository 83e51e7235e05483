/* Modes of the constraint equations whose multipliers have limits, and the events at which they change.
 *
 * Mode 0: the equation holds.  Mode 1: its multiplier lambda is given, at its largest value, and u >= 0; mode -1: at
 * its smallest value, and u <= 0.  u is J v - eta or, of a holonomic equation, g.  An event is a root of lambda less a
 * limit, or of u.  After each step it is sought in the dense output; the state there becomes the state reached.  Before
 * the next step the modes are decided and the method begins anew.
 *
 * Decision.  The equations D that may hold have multipliers x in [lo, hi] and relative accelerations
 *
 *   z = J_D a - gamma_D = b - A x,   A = J_D H J_D^T,   H: of the saddle of the other equations that hold
 *   lo < x < hi: z = 0;   x = hi: z >= 0;   x = lo: z <= 0
 *
 * the conditions of a minimum of x^T A x / 2 - b^T x.  A is positive definite: accelerations are unique.  Principal
 * pivoting finds it (Murty 1974, Note on a Bard-type scheme for solving the complementarity problem; Judice & Pires
 * 1994, Computers & Operations Research 21, 587-596).  In an impact the same holds for impulses and u + e u before it,
 * e: restitution; finite multipliers transmit no impulse (Moreau 1988, Unilateral contact and dry friction in finite
 * freedom dynamics). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "crossing.h"
#include "decision.h"
#include "events.h"
#include "rank.h"
#include "util.h"

/* Velocities [units] that count as 0 where modes are decided: a hundred times the error, 1e-13, to which a root of u is
 * located (events_tolerance), so that friction that has stopped is found at rest. */
#define EVENTS_SMALL 1e-11
/* By which a limit that is reached is narrowed: the multiplier of the decision, of a projected state, differs from that
 * of the sample by round-off, about 1e-12 of the limit, which must not undo the event. */
#define EVENTS_TIGHTER 1e-10
#define EVENTS_ROUND_OFF 1e-14 /* of an event function that has been farther from its root: some tens of eps */
/* Impacts below this velocity [units] do not bounce: the next ones, in sum, would move nothing by more than v^2 /
 * acceleration, 1e-12 units. */
#define EVENTS_SLOW 1e-6
/* Longest first step after an event [T]: before it neither an error nor a bend of multipliers is known, and 1e-3 T
 * resolves what the scene's own time scale does. */
#define EVENTS_FIRST 1e-3
/* Of multipliers in a step [limits]: the parabolas by which roots are suspected then err by less than the distance of a
 * typical multiplier from its limit (events_longest). */
#define EVENTS_BEND 0.1
/* Distance of a multiplier [limits], or of u [units], from the boundary of a mode that is not round-off, nor that of
 * initial values with 6 digits. */
#define EVENTS_BOUNDARY 1e-6
#define EVENTS_PARTED 1e-9 /* u [units] of an equation that no longer depends on those that hold: more than round-off */
enum { EVENTS_PASSES = 10 }; /* most decisions at one instant: each but the first follows from a root at that instant */

typedef struct pw_events {
  int count;                            /* equations with limits; arrays of this length, unless said otherwise */
  int *row;                             /* their indices */
  pw_bounds *limit;                     /* their limits */
  double *force_unit, *unit;            /* of the multiplier; of u */
  signed char *mode, *before;           /* before: those before a decision */
  unsigned char *armed;                 /* 1: u has left its root, so that it may return there */
  unsigned char *triggered;             /* 1: at the root that is the state reached */
  unsigned char *rests;                 /* 1: u is 0 after an impact */
  unsigned char *struck;                /* 1: it has had an impact since the last motion that was not too short */
  unsigned char *spare;                 /* 1: it holds since others do, on which it depends: its multiplier is 0 */
  unsigned char *still;                 /* 1: at its limit, but u, of a circle the first one, is 0 since others hold */
  int *partner;                         /* of friction: its normal equation; -1: none */
  int *place;                           /* in D; -1: not in it */
  unsigned char *enforced;              /* rows: what r->enforced points to */
  unsigned char *other;                 /* rows: active equations of the saddle of a decision */
  double *start, *end, *previous, *now; /* 2 count: event functions at the ends of the last step, before it, anywhere */
  double start_t, previous_t;           /* NaN: not known */
  double longest, roughness; /* next adaptive step [s]; the bend of multipliers in the last one over EVENTS_BEND */
  double *memory;            /* of pw_first_crossing */
  double *u, *u_before, *impulse;
  const unsigned char *origin;      /* of initial values: of the run; NULL in a restart */
  double *direction, *bias, *reach; /* d, e and e0 of circles */
  double *offset; /* by which u [units] was on the wrong side of its root when it began to leave it: drift */
  int at_end;     /* 1: the state reached, its multipliers and its J are known */
  int samples;    /* 1: J has been evaluated elsewhere since */
  int pending;    /* 1: modes must be decided at the state reached */
  int fell;       /* 1: u has changed its sign without having left its root: too short a motion to be resolved */
  int stepping;   /* 1: events are not located; impulses of whole steps are decided (below) */
  int jumped;     /* 1: there was an impact in the last step */
  double *mean;   /* multipliers of the last step: its impulses over its length */

  pw_decision d;                  /* of the last decision; D: by their number among those with limits */
  double *f, *a, *gamma, *lambda; /* coords + 3; the same; rows; 2 rows */
} pw_events;

static int events_allocate (pw_run *r) {
  const pw_system *s = r->s;
  const size_t n = (size_t)s->limited, rows = (size_t)s->rows, coords = (size_t)s->coords + 3;
  pw_events *x = r->events = pw_arena_alloc (&r->arena, sizeof *x);
  if (x == NULL) return PW_RESOURCE;
  double **const number[] = { &x->force_unit, &x->unit, &x->u,     &x->u_before,  &x->impulse,
                              &x->offset,     &x->d.b,  &x->d.x,   &x->d.lo,      &x->d.hi,
                              &x->direction,  &x->bias, &x->reach, &x->d.towards, &x->mean };
  double **const function[] = { &x->start, &x->end, &x->now, &x->previous };
  signed char **const mode[] = { &x->mode, &x->before, &x->d.trial };
  unsigned char **const flag[] = { &x->armed,     &x->triggered, &x->rests,   &x->struck,     &x->still,
                                   &x->d.blocked, &x->spare,     &x->d.fixed, &x->d.redundant };
  int **const index[] = { &x->row, &x->d.list, &x->d.held, &x->partner, &x->place, &x->d.normal };
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &r->events_memory);) {
    x->d.limit = x->limit = pw_layout_alloc (&l, n, sizeof *x->limit);
    for (size_t i = 0; i < sizeof number / sizeof *number; i++) *number[i] = pw_layout_alloc (&l, n, sizeof (double));
    for (int i = 0; i < 4; i++) *function[i] = pw_layout_alloc (&l, 2 * n, sizeof (double));
    for (int i = 0; i < 3; i++) *mode[i] = pw_layout_alloc (&l, n, 1);
    for (size_t i = 0; i < sizeof flag / sizeof *flag; i++) *flag[i] = pw_layout_alloc (&l, n, 1);
    for (size_t i = 0; i < sizeof index / sizeof *index; i++) *index[i] = pw_layout_alloc (&l, n, sizeof (int));
    r->coupling = pw_layout_alloc (&l, n, sizeof *r->coupling);
    r->coupling_memory = pw_layout_alloc (&l, 2 * coords + rows + n * (n + 1), sizeof (double));
    x->enforced = pw_layout_alloc (&l, rows, 1);
    x->other = pw_layout_alloc (&l, rows, 1);
    x->d.choice = pw_layout_alloc (&l, 2 * n, sizeof *x->d.choice);
    x->d.A = pw_layout_alloc (&l, n * n, sizeof *x->d.A);
    x->d.factor = pw_layout_alloc (&l, n * (n + 1), sizeof *x->d.factor);
    x->f = pw_layout_alloc (&l, coords, sizeof *x->f);
    x->a = pw_layout_alloc (&l, coords, sizeof *x->a);
    x->gamma = pw_layout_alloc (&l, rows, sizeof *x->gamma);
    x->lambda = pw_layout_alloc (&l, 2 * rows, sizeof *x->lambda);
    x->memory = pw_layout_alloc (&l, 2 * n * (PW_CROSSING_DEPTH + 2), sizeof *x->memory);
    r->reaction = pw_layout_alloc (&l, rows, sizeof *r->reaction);
    r->given = pw_layout_alloc (&l, rows, sizeof *r->given);
  }
  return r->events_memory ? PW_OK : PW_RESOURCE;
}

/* ---- Modes of the run ---- */

/* The multiplier of an equation at a limit; on a circle, at the beginning of the step. */
static double events_given (const pw_events *x, int i) {
  if (x->limit[i].circle) return x->limit[i].sliding[1] * x->direction[i];
  return x->limit[i].sliding[x->mode[i] > 0];
}

/* Value of signal n (0, 1: while it holds, while it does not) of the limits of equation i, at least 0; else `other`. */
static double events_magnitude (const pw_run *r, int i, int n, double other) {
  const int source = r->s->limit_source[r->events->row[i]][n];
  return source < 0 ? other : fmax (0, r->w->u[3 * source]);
}

/* Sets the limits that vary, where kinematics are up to date. */
static void events_limits (pw_run *r) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count && r->s->limit_sources > 0; i++) {
    pw_bounds *limit = &x->limit[i];
    if (pw_is_one_sided (limit)) continue;
    limit->most = events_magnitude (r, i, 0, limit->most), limit->least = -limit->most;
    limit->sliding[1] = fmin (limit->most, events_magnitude (r, i, 1, r->s->limit[x->row[i]].sliding[1]));
    limit->sliding[0] = -limit->sliding[1];
  }
}

/* 1 for friction of a contact that is open: it is off, whatever its mode. */
static int events_apart (const pw_events *x, int i) {
  return x->partner[i] >= 0 && x->mode[x->partner[i]] != 0;
}

/* 1 if u is 0 since others hold, on which the equation depends. */
static int events_depends (const pw_events *x, int i) {
  return (x->spare[i] || (x->still[i] && !x->limit[i].circle)) && !events_apart (x, i);
}

/* The mode that users see. */
static signed char events_shown (const pw_events *x, int i) {
  return x->still[i] && !x->limit[i].circle ? 0 : x->mode[i];
}

/* The mode of an equation that does not hold: of one with two finite limits by the sign of u. */
static signed char events_off (const pw_events *x, int i, double u) {
  if (isinf (x->limit[i].least) || x->limit[i].circle) return 1;
  return isinf (x->limit[i].most) || u < 0 ? -1 : 1;
}

/* An equation slides, or both of a circle, of which i is the first, with these u. */
static void events_slide (pw_events *x, int i, const double *u) {
  x->mode[i] = events_off (x, i, u[i]);
  if (x->limit[i].circle == 0) return;
  const double size = hypot (u[i], u[i + 1]);
  x->mode[i + 1] = 1, x->bias[i] = x->bias[i + 1] = 0;
  for (int k = i; k < i + 2; k++) x->direction[k] = size > 0 ? u[k] / size : k == i;
}

/* u of the equations with limits at velocities v, where J is evaluated; of holonomic equations their rate, unless g is
 * 1. */
static void events_u (pw_run *r, const double *v, int g, double *u) {
  pw_events *x = r->events;
  double *Jv = x->lambda, *eta = Jv + r->s->rows;
  pw_mul_J (r->w, v, Jv);
  pw_evaluate_eta (r->w, eta);
  for (int i = 0; i < r->s->rows; i++) Jv[i] -= eta[i];
  if (g) pw_evaluate_g (r->w, Jv);
  for (int i = 0; i < x->count; i++) u[i] = Jv[x->row[i]];
}

/* ---- Sliding on a circle: two equations with a limit of the resultant of their multipliers ----
 *
 * Both multipliers are given, lambda = L n with n = u / |u|.  Near u = 0 the direction of u is stiff: it relaxes at the
 * rate A L / |u|, which no explicit method could follow where sliding begins or ends.  There
 *
 *   n = (u + e d) / |u + e d|,   d: n at the beginning of the step,   e = e0 (1 - |u| / (4 e0)) for |u| < 4 e0, else 0
 *
 * has a rate of at most A L / e0.  e and d are constant in a step; since d follows n, the error is that of the turn of
 * n in one step while |u| < 4 e0: methods are of order 2 there, and exact where n does not turn.  e0: A L h with fixed
 * steps h, otherwise sqrt (rtol) in units of u.  Beyond the line through 0 across d, n is mirrored at it, so that it
 * is continuous where u passes 0 within a step. */

/* J v of an equation, where J is evaluated. */
static double circle_speed (const pw_workspace *w, int row) {
  int e;
  const double *J;
  const pw_element_batch *k = pw_find_row (w, row, &e, &J);
  const int bodies = k->kind->bodies;
  double sum = 0;
  for (int n = 0; n < bodies; n++, J += 3) {
    const pw_configuration *p = k->b.configuration + k->b.body[e * bodies + n];
    sum += J[0] * p->vx + J[1] * p->vy + J[2] * p->omega;
  }
  for (int n = 0; n < k->kind->internal; n++) sum += J[n] * k->b.v[e * k->kind->internal + n];
  return sum;
}

/* n of the circle whose first equation is i, and its derivatives by u (2 x 2, row-major), where J is evaluated.
 * Returns |u|. */
static double circle_direction (const pw_run *r, int i, double n[2], double by_u[4]) {
  const pw_events *x = r->events;
  const double *d = x->direction + i, u0 = circle_speed (r->w, x->row[i]), u1 = circle_speed (r->w, x->row[i + 1]);
  const double along = u0 * d[0] + u1 * d[1] + x->bias[i], across = u1 * d[0] - u0 * d[1], size = hypot (along, across);
  const double a = size > 0 ? fabs (along) / size : 1, c = size > 0 ? across / size : 0, side = along < 0 ? -1 : 1;
  const double of[4] = { side * c * c, -a * c, -side * a * c, a * a }; /* along d, across it */
  n[0] = a * d[0] - c * d[1], n[1] = a * d[1] + c * d[0];
  for (int m = 0; m < 4; m++) {
    const double *R = (const double[]){ d[0], -d[1], d[1], d[0] }, *p = R + m / 2 * 2, *q = R + m % 2 * 2;
    const double sum = p[0] * (of[0] * q[0] + of[1] * q[1]) + p[1] * (of[2] * q[0] + of[3] * q[1]);
    by_u[m] = size > 0 ? sum / size : 0;
  }
  return hypot (u0, u1);
}

/* Sets e0 and, for this |u|, e.  A L: an upper bound, of the masses without other constraints. */
static void circle_set_bias (pw_run *r, int i, double speed) {
  pw_events *x = r->events;
  double A = 0;
  for (int row = x->row[i]; row < x->row[i] + 2 && r->fixed_steps; row++) {
    memset (x->gamma, 0, (size_t)r->s->rows * sizeof *x->gamma);
    memset (x->f, 0, ((size_t)r->s->coords + 3) * sizeof *x->f);
    x->gamma[row] = 1;
    pw_add_JT (r->w, x->gamma, x->f);
    for (int j = 0; j < r->s->coords; j++)
      if (r->s->mass[j] > 0) A += x->f[j] * x->f[j] / r->s->mass[j];
  }
  x->reach[i] = r->fixed_steps ? r->settings.step * A * x->limit[i].sliding[1] : sqrt (r->settings.rtol) * x->unit[i];
  x->bias[i] = fmax (0, x->reach[i] - speed / 4);
}

/* Sets d and e of a step from the state reached. */
static void circle_begin_step (pw_run *r) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++) {
    double n[2], by_u[4];
    if (x->limit[i].circle != 1 || x->mode[i] == 0) continue;
    const double speed = circle_direction (r, i, n, by_u);
    x->direction[i] = n[0], x->direction[i + 1] = n[1];
    circle_set_bias (r, i, speed);
  }
}

/* pw_run.update_given */
static void events_update (pw_run *r) {
  const pw_events *x = r->events;
  double n[2], by_u[4];
  events_limits (r);
  for (int i = 0; i < x->count; i++) {
    const int row = x->row[i], circle = x->limit[i].circle, *source = r->s->limit_source[row];
    const double limit = x->limit[i].sliding[1];
    pw_given *by = &r->given[row];
    const int is_given = x->mode[i] != 0 && x->partner[i] < 0; /* others: pw_couple */
    *by = (pw_given){ is_given, { source[0], source[1] }, .first = circle ? row + 1 - circle : -1 };
    if (!is_given) continue;
    if (circle == 1) circle_direction (r, i, n, by_u);
    const double part = circle ? n[circle - 1] : x->mode[i];
    const int follows = source[1] >= 0 && limit < x->limit[i].most;
    r->reaction[row] = pw_is_one_sided (&x->limit[i]) ? -events_given (x, i) : -part * limit;
    by->by_source[follows] = limit > 0 ? part : 0;
    for (int m = 0; m < 2 && circle; m++) by->by_u[m] = limit * by_u[2 * circle - 2 + m];
  }
}

/* Makes the modes those of the run. */
static void events_apply (pw_run *r) {
  pw_events *x = r->events;
  int off = 0;
  events_limits (r);
  r->update_given = NULL;
  r->couplings = 0;
  for (int i = 0; i < r->s->rows; i++) {
    const pw_bounds *limit = &r->s->limit[i];
    x->enforced[i] = pw_can_hold (limit);
    r->reaction[i] = 0;
    off |= !x->enforced[i];
  }
  for (int i = 0; i < x->count; i++) {
    const int apart = events_apart (x, i), on = x->partner[i];
    if (x->mode[i] == 0 && !apart && !x->spare[i] && !x->stepping) continue;
    x->enforced[x->row[i]] = 0;
    off = 1;
    if (on >= 0 && x->mode[i] && !apart)
      r->coupling[r->couplings++] =
          (pw_coupling){ x->row[i], x->row[on], events_given (x, i) * pw_limit_sign (&x->limit[on]) };
    if (x->stepping || (on < 0 && x->mode[i]))
      r->reaction[x->row[i]] = -(x->stepping ? x->mean[i] : events_given (x, i));
    if (!x->stepping && x->mode[i] && (r->s->limit_sources > 0 || x->limit[i].circle)) r->update_given = events_update;
  }
  r->active = r->enforced = off ? x->enforced : NULL;
  r->redundant_drive = off;
  r->forces = off ? PW_FORCES_AT_LIMITS : r->s->forces > 0;
}

/* ---- Event functions, positive beyond an event: two for each equation ---- */

/* Below this u [units] is 0 after its root: the error of the method. */
static double events_tolerance (const pw_run *r) {
  return r->fixed_steps ? 1e-13 : fmax (1e-13, 10 * r->settings.rtol);
}

/* Event functions where J is evaluated, from the multipliers and velocities. */
static void events_values (pw_run *r, const double *v, const double *lambda, double *value) {
  pw_events *x = r->events;
  const double tolerance = events_tolerance (r);
  events_u (r, v, 1, x->u);
  events_limits (r);
  for (int i = 0; i < x->count; i++) {
    const pw_bounds *limit = &x->limit[i];
    double y = lambda[x->row[i]], size = x->partner[i] < 0 ? 1 : fabs (lambda[x->row[x->partner[i]]]);
    value[2 * i] = isinf (limit->most) ? -1 : (y - size * limit->most) / x->force_unit[i] - EVENTS_ROUND_OFF;
    value[2 * i + 1] = isinf (limit->least) ? -1 : (size * limit->least - y) / x->force_unit[i] - EVENTS_ROUND_OFF;
    double u = x->mode[i] * x->u[i];
    if (limit->circle == 1) {
      value[2 * i] = (hypot (y, lambda[x->row[i + 1]]) - limit->most) / x->force_unit[i] - EVENTS_ROUND_OFF;
      u = x->u[i] * x->direction[i] + x->u[i + 1] * x->direction[i + 1];
    }
    if (limit->circle == 2) value[2 * i] = -1;
    if (limit->circle) value[2 * i + 1] = -1;
    if ((x->spare[i] && !limit->circle) || events_apart (x, i)) value[2 * i] = value[2 * i + 1] = -1;
    if (events_depends (x, i))
      value[2 * i + (limit->circle == 1)] = fabs (x->u[i]) / x->unit[i] - EVENTS_PARTED - tolerance / 10;
    if (x->mode[i] == 0 || limit->circle == 2 || events_apart (x, i) || (x->still[i] && !limit->circle)) continue;
    value[2 * i] = -u / x->unit[i] - (x->armed[i] ? EVENTS_ROUND_OFF : tolerance + x->offset[i]);
    value[2 * i + 1] = -1;
    if (x->still[i] && x->armed[i]) value[2 * i + 1] = EVENTS_SMALL / 2 - hypot (x->u[i], x->u[i + 1]) / x->unit[i];
  }
}

/* 1 if the method leaves the multipliers of the state reached in r->lambda, without Baumgarte's terms. */
static int events_knows_multipliers (const pw_run *r) {
  static const pw_stabilisation_kind kinds[] = { PW_UNSTABILISED, PW_PROJECTION, PW_NULLSPACE };
  for (size_t i = 0; i < sizeof kinds / sizeof *kinds && r->method->order > 0; i++) /* not of multistep methods */
    if (pw_stabilised_by (r, kinds[i])) return 1;
  return 0;
}

/* Where friction and normal forces that depend on each other do not determine the motion. */
static int events_fail_friction (pw_run *r, double t, pw_error *error) {
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the friction of %s and its normal force depend on each other: there is no "
                  "solution, or there are several (Painleve)",
                  t, PW_NAME (pw_system_row_name, r->s, r->coupling->row));
}

/* pw_crossing_search.at.  Otherwise multipliers are computed from the state: those of some methods are interpolated,
 * and modes are decided with these. */
static int events_at (void *context, double t, double *value, pw_error *error) {
  pw_run *r = context;
  const pw_statistics statistics = r->statistics;
  const double alpha = r->alpha, beta = r->beta;
  const int near_singular = r->near_singular;
  if (t == r->t && r->events->at_end) return events_values (r, r->v, r->lambda, value), PW_OK;
  r->events->samples = 1;
  r->located = t;
  int status = r->method->at (r, t, error);
  r->alpha = r->beta = 0;
  if (status == PW_OK && pw_saddle_factor (r->saddle) == PW_OK)
    pw_run_accelerate_updated (r, r->v_at, r->a_at, r->lambda_at);
  r->alpha = alpha, r->beta = beta;
  r->statistics = statistics, r->near_singular = near_singular;
  if (status == PW_OK) events_values (r, r->v_at, r->lambda_at, value);
  return status == PW_OK && r->couplings > 0 && r->coupling_lost ? events_fail_friction (r, t, error) : status;
}

/* Marks functions of u that have left their root. */
static void events_arm (pw_run *r, const double *value) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++)
    x->armed[i] |= x->mode[i] && value[2 * i] < -2 * events_tolerance (r) - x->offset[i];
}

/* Marks the equations at their roots; 1 if there are any. */
static int events_trigger (pw_run *r, const double *value) {
  pw_events *x = r->events;
  int any = 0;
  for (int i = 0; i < x->count; i++) any |= x->triggered[i] = value[2 * i] > 0 || value[2 * i + 1] > 0;
  return any;
}

/* ---- Decisions ---- */

/* Evaluates A with the saddle of the other equations, which must be factorised. */
static void decision_matrix (pw_run *r, pw_saddle *saddle) {
  pw_events *x = r->events;
  const pw_system *s = r->s;
  double *Ja = x->lambda + s->rows;
  for (int k = 0; k < x->d.n; k++) {
    memset (x->gamma, 0, (size_t)s->rows * sizeof *x->gamma);
    memset (x->f, 0, ((size_t)s->coords + 3) * sizeof *x->f);
    x->gamma[x->row[x->d.list[k]]] = 1;
    pw_add_JT (r->w, x->gamma, x->f);
    memset (x->lambda, 0, (size_t)s->rows * sizeof *x->lambda);
    pw_saddle_solve (saddle, x->f, x->lambda, x->a, x->lambda);
    pw_mul_J (r->w, x->a, Ja);
    for (int i = 0; i < x->d.n; i++) x->d.A[i * x->d.n + k] = Ja[x->row[x->d.list[i]]];
  }
}

/* The saddle without the equations D (impact: without all that have limits), A, and b: of accelerations; of velocities
 * in an impact.  NULL on errors. */
static pw_saddle *decision_open (pw_run *r, int impact, pw_error *error) {
  pw_events *x = r->events;
  const pw_system *s = r->s;
  memcpy (x->other, x->enforced, (size_t)s->rows);
  for (int i = 0; i < x->count && impact; i++) x->other[x->row[i]] = 0;
  for (int k = 0; k < x->d.n; k++) x->other[x->row[x->d.list[k]]] = 0;
  pw_saddle *saddle = pw_saddle_open (r->w, s->mass, s->rows, x->other, error);
  if (saddle == NULL || pw_saddle_factor (saddle) != PW_OK) return pw_saddle_close (saddle), NULL;
  if (impact) {
    memcpy (x->a, r->v, (size_t)s->coords * sizeof *x->a);
    pw_evaluate_eta (r->w, x->gamma);
  } else {
    pw_evaluate_force (r->w, x->f);
    for (int k = 0; k < x->d.n; k++) r->reaction[x->row[x->d.list[k]]] = 0; /* the unknowns */
    pw_add_JT (r->w, r->reaction, x->f);
    pw_evaluate_gamma (r->w, x->gamma);
    memcpy (x->lambda, x->gamma, (size_t)s->rows * sizeof *x->lambda);
    pw_saddle_solve (saddle, x->f, x->lambda, x->a, x->lambda);
  }
  double *Ja = x->lambda + s->rows;
  pw_mul_J (r->w, x->a, Ja);
  for (int k = 0; k < x->d.n; k++) x->d.b[k] = Ja[x->row[x->d.list[k]]] - x->gamma[x->row[x->d.list[k]]];
  decision_matrix (r, saddle);
  return saddle;
}

/* Adds to v the velocities of the impulses -x on D; impulses of the other equations in x->lambda. */
static void decision_push (pw_run *r, pw_saddle *saddle, double *v) {
  pw_events *x = r->events;
  const pw_system *s = r->s;
  memset (x->gamma, 0, (size_t)s->rows * sizeof *x->gamma);
  memset (x->f, 0, ((size_t)s->coords + 3) * sizeof *x->f);
  for (int k = 0; k < x->d.n; k++) x->gamma[x->row[x->d.list[k]]] = -x->d.x[k];
  pw_add_JT (r->w, x->gamma, x->f);
  memset (x->lambda, 0, (size_t)s->rows * sizeof *x->lambda);
  pw_saddle_solve (saddle, x->f, x->lambda, x->a, x->lambda);
  for (int j = 0; j < s->coords; j++) v[j] += x->a[j];
}

/* count: of solutions, -1: not known, or PW_DECISION_MIXED. */
static int decision_fail (pw_run *r, pw_saddle *saddle, int count, pw_error *error) {
  pw_events *x = r->events;
  char elements[300];
  memset (x->other, 0, (size_t)r->s->rows);
  for (int k = 0; k < x->d.n; k++) {
    const pw_bounds *limit = &r->s->limit[x->row[x->d.list[k]]];
    x->other[limit->relative ? limit->partner : x->row[x->d.list[k]]] = 1; /* a contact has one name for both */
  }
  pw_list_elements (r->s, x->other, 1, elements, sizeof elements);
  if (saddle == NULL && error && error->status == PW_RESOURCE) return PW_RESOURCE;
  return pw_fail (error, PW_METHOD, "t = %.6g s: whether %s hold%s cannot be decided: %s", r->t, elements,
                  strchr (elements, ',') ? "" : "s",
                  count == PW_DECISION_MIXED
                      ? "friction of contacts together with grips of rolling wheels is not supported"
                  : count == 0 ? "with this friction there is no solution (Painleve)"
                  : count > 1  ? "with this friction there are several solutions (Painleve)"
                  : saddle     ? "their equations depend on each other or on other constraints"
                               : "without them the accelerations are not determined");
}

/* Adds to the ledger what an impact dissipates and what constraints supply in it: impulses -x of D, x->lambda of the
 * others. */
static void impact_ledger (pw_run *r) {
  pw_events *x = r->events;
  const pw_system *s = r->s;
  double *eta = x->lambda + s->rows;
  pw_evaluate_eta (r->w, eta);
  for (int k = 0; k < x->d.n; k++) x->lambda[x->row[x->d.list[k]]] = x->d.x[k];
  for (int i = 0; i < s->entries; i++) {
    const pw_element_batch *k = &s->batch[s->entry[i].batch];
    const int first = k->row + s->entry[i].element * k->kind->rows;
    const int normal = k->kind->rows > 0 && s->limit[first].relative ? s->limit[first].partner : -1;
    for (int row = first; row < first + k->kind->rows && s->entry[i].type == PW_WORK && !k->kind->power; row++)
      r->ledger[i] -= x->lambda[row] * eta[row];
    for (int n = 0; n < x->d.n && s->entry[i].type == PW_LOSS; n++) {
      const int e = x->d.list[n];
      if ((x->row[e] >= first && x->row[e] < first + k->kind->rows) || x->row[e] == normal)
        r->ledger[i] += 0.5 * x->d.x[n] * (x->u_before[e] + x->u[e]);
    }
  }
}

/* After decision_push: u from the velocities v, and the ledger. */
static void impact_end (pw_run *r, const double *v) {
  pw_events *x = r->events;
  const size_t bytes = (size_t)r->s->rows * sizeof *x->gamma;
  memcpy (x->gamma, x->lambda, bytes);
  events_u (r, v, 0, x->u); /* uses x->lambda */
  memcpy (x->lambda, x->gamma, bytes);
  impact_ledger (r);
}

/* Adds an equation to D, with the limits of its multiplier or, of friction, of the multiple of the normal one. */
static void decide_add (pw_events *x, int i, double lo, double hi, signed char trial) {
  const int k = x->d.n++;
  x->d.list[k] = i, x->place[i] = k;
  x->d.lo[k] = lo, x->d.hi[k] = hi, x->d.trial[k] = trial, x->d.fixed[k] = 0;
  x->d.normal[k] = x->partner[i] < 0 ? -1 : x->place[x->partner[i]];
}

/* 1 if a holonomic equation does not hold because g has left 0. */
static int events_open (const pw_run *r, int i, double g) {
  const pw_events *x = r->events;
  return (x->row[i] < r->s->holonomic) && !x->triggered[i] && x->mode[i] * g > EVENTS_SMALL * x->unit[i];
}

/* Impulses with the restitution of each equation times `part`; *loss: the energy that they dissipate.  If one of the
 * equations has had an impact since the last motion that was resolved, they all hold: it is the end of an accumulation,
 * also of a block that rocks. */
static int impact_try (pw_events *x, double part, int *count, double *loss) {
  int ends = 0;
  for (int k = 0; k < x->d.n && x->fell; k++) ends |= x->d.normal[k] < 0 && x->struck[x->d.list[k]];
  for (int k = 0; k < x->d.n; k++) {
    const int i = x->d.list[k], slow = ends || fabs (x->u_before[i]) < EVENTS_SLOW * x->unit[i];
    x->d.b[k] = x->u_before[i] * (1 + (x->mode[i] && !slow && x->d.normal[k] < 0 ? part * x->limit[i].restitution : 0));
  }
  for (int k = 0; k < x->d.n && ends; k++)
    if (x->d.normal[k] < 0) x->d.lo[k] = -INFINITY, x->d.hi[k] = INFINITY, x->d.trial[k] = 0;
  const int status = ends ? pw_decision_pivot (&x->d, 1) : pw_decide (&x->d, count);
  *loss = 0;
  for (int k = 0; k < x->d.n; k++)
    *loss += x->d.x[k] * (x->u_before[x->d.list[k]] + (pw_decision_z (&x->d, k) - x->d.b[k]) / 2);
  return status;
}

/* Newton's law of several impacts, or with friction, may add energy (Kane 1984; Stronge 1990, Proceedings of the Royal
 * Society A 431, 169-181); without restitution it does not.  Where it would, all restitutions are reduced by the
 * largest factor with which it does not. */
static int impact_solve (pw_events *x, int *count) {
  double loss, low = 0, high = 1, size = 0;
  int status = impact_try (x, 1, count, &loss);
  for (int k = 0; k < x->d.n; k++) size += fabs (x->d.x[k] * x->u_before[x->d.list[k]]);
  if (status != PW_OK || loss >= -1e-12 * size) return status;
  for (int i = 0; i < 40; i++) {
    const double part = (low + high) / 2;
    if (impact_try (x, part, count, &loss) == PW_OK && loss >= 0)
      low = part;
    else
      high = part;
  }
  return impact_try (x, low, count, &loss);
}

/* Impacts: equations that do not hold, and whose u would leave its side.  *any: 1 if there are. */
static int decide_impacts (pw_run *r, const double *g, int *any, pw_error *error) {
  pw_events *x = r->events;
  *any = x->d.n = 0;
  for (int i = 0; i < x->count; i++) x->place[i] = -1;
  events_u (r, r->v, 0, x->u_before);
  for (int i = 0; i < x->count; i++) {
    const double u = x->u_before[i] / x->unit[i];
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    const int hits = x->mode[i] && x->mode[i] * u < -EVENTS_SMALL;
    x->impulse[i] = 0, x->rests[i] = 0;
    if (x->partner[i] >= 0 && x->place[x->partner[i]] >= 0) decide_add (x, i, x->limit[i].least, x->limit[i].most, 0);
    if (!one_sided || events_open (r, i, g[i]) || (x->mode[i] && x->mode[i] * u > EVENTS_SMALL)) continue;
    *any |= hits;
    decide_add (x, i, isinf (x->limit[i].least) ? -INFINITY : 0, isinf (x->limit[i].most) ? INFINITY : 0,
                events_off (x, i, 0));
  }
  if (!*any) return PW_OK;
  pw_saddle *saddle = decision_open (r, 1, error);
  int count = -1;
  if (saddle == NULL || impact_solve (x, &count) != PW_OK) {
    const int status = decision_fail (r, saddle, count, error);
    pw_saddle_close (saddle);
    return status;
  }
  decision_push (r, saddle, r->v);
  pw_saddle_close (saddle);
  if (pw_update_velocities (r->w, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  impact_end (r, r->v);
  for (int k = 0; k < x->d.n; k++) {
    x->impulse[x->d.list[k]] = -x->d.x[k];
    x->struck[x->d.list[k]] |= x->d.x[k] != 0;
    x->rests[x->d.list[k]] = fabs (x->u[x->d.list[k]]) <= EVENTS_SMALL * x->unit[x->d.list[k]];
  }
  return PW_OK;
}

/* Lists D: equations that hold, and those whose u is 0.  jumps: 1 if velocities have jumped, or are initial ones. */
static void decide_list (pw_run *r, const double *g, int jumps) {
  pw_events *x = r->events;
  x->d.n = 0;
  for (int i = 0; i < x->count; i++) x->place[i] = -1;
  events_u (r, r->v, 0, x->u);
  for (int i = 0, equations; i < x->count; i += equations) {
    equations = x->limit[i].circle ? 2 : 1;
    const int on = x->partner[i];
    const double speed = equations == 2 ? hypot (x->u[i], x->u[i + 1]) : fabs (x->u[i]), u = speed / x->unit[i];
    const int open = !x->rests[i] && events_open (r, i, g[i]);
    const int parts = events_depends (x, i) || (equations == 2 && x->spare[i + 1]);
    const int misses = equations == 2 && x->triggered[i] && x->mode[i] && speed > x->reach[i]; /* u passes beside 0 */
    if (on >= 0 && x->place[on] < 0) {
      x->mode[i] = 1, x->spare[i] = x->still[i] = 0;
      continue;
    }
    const int moves = (jumps || (on >= 0 && x->before[on])) && !open;
    if ((moves || misses || parts) && u > EVENTS_SMALL) events_slide (x, i, x->u);
    const int rolls = x->mode[i] && !(x->row[i] < r->s->holonomic) && x->triggered[i] && !jumps && !misses &&
                      !(parts && u > EVENTS_SMALL);
    const int slides = x->mode[i] && !rolls && u > EVENTS_SMALL;
    if (open || (slides && on < 0)) continue;
    const double unit = on < 0 ? x->force_unit[i] : x->limit[i].most;
    const double tighter = x->mode[i] == 0 && x->triggered[i] ? EVENTS_TIGHTER * unit : 0;
    for (int k = i; k < i + equations; k++) {
      if (slides)
        decide_add (x, k, x->limit[k].sliding[0], x->limit[k].sliding[1], x->mode[k]);
      else
        decide_add (x, k, fmin (0, x->limit[k].least + tighter), fmax (0, x->limit[k].most - tighter),
                    on < 0 ? x->mode[k] : 0);
      x->d.fixed[x->d.n - 1] = (unsigned char)slides, x->d.towards[x->d.n - 1] = x->direction[k];
    }
  }
  events_apply (r); /* forces of those outside D */
  if (r->update_given) r->update_given (r);
}

/* decide, where one that slides may have a smaller multiplier than one that holds.  x are `unit` times what
 * multipliers exceed `known` by (NULL: 0). */
static int decide_sliding (pw_events *x, double unit, const double *known, int *count) {
  for (int again = 1; again;) {
    if (pw_decide (&x->d, count) != PW_OK) return PW_RETRY;
    again = 0;
    for (int k = 0; k < x->d.n; k++) {
      const int i = x->d.list[k];
      const double from = known ? known[i] : 0, *sliding = x->limit[i].sliding;
      const double lo = unit * (sliding[0] - from), hi = unit * (sliding[1] - from);
      if (x->d.trial[k] > 0 && x->d.hi[k] > hi) x->d.hi[k] = hi, again = 1;
      if (x->d.trial[k] < 0 && x->d.lo[k] < lo) x->d.lo[k] = lo, again = 1;
    }
  }
  return PW_OK;
}

/* Decides the modes of D.  Their u becomes 0 exactly. */
static int decide_modes (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  pw_saddle *saddle = x->d.n > 0 ? decision_open (r, 0, error) : NULL;
  int count = -1, status = saddle ? decide_sliding (x, 1, NULL, &count) : PW_OK;
  if (x->d.n > 0 && (saddle == NULL || status != PW_OK)) status = decision_fail (r, saddle, count, error);
  for (int k = 0; k < x->d.n && status == PW_OK; k++) {
    const int i = x->d.list[k], apart = pw_decision_apart (&x->d, k);
    x->mode[i] = apart ? 1 : x->d.trial[k];
    x->spare[i] = x->d.redundant[k] && !apart;
    x->direction[i] = x->d.towards[k];
    if (x->limit[i].circle == 1) circle_set_bias (r, i, 0);
  }
  for (int k = 0; k < x->d.n && status == PW_OK; k++) {
    const int i = x->d.list[k], circle = x->limit[i].circle;
    const int could = x->d.trial[k] && (circle == 1 || !(circle || x->d.fixed[k]));
    x->still[i] = could && !pw_is_one_sided (&x->limit[i]) && pw_decision_depends (&x->d, k);
  }
  for (int k = 0; k < x->d.n && status == PW_OK; k++) {
    x->d.normal[k] = -1, x->d.trial[k] = (signed char)x->d.fixed[k];
    x->d.x[k] = 0, x->d.b[k] = x->u[x->d.list[k]];
  }
  if (x->d.n > 0 && status == PW_OK) {
    (void)pw_decision_solve (&x->d, 1);
    decision_push (r, saddle, r->v);
    if (pw_update_velocities (r->w, r->v) != PW_OK) status = pw_fail_signal (r->t, error);
  }
  pw_saddle_close (saddle);
  return status;
}

static int events_log (pw_run *r) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++) {
    const int on = x->partner[i],
              changes = events_shown (x, i) != x->before[i] && (on < 0 || !(x->mode[on] || x->before[on]));
    if ((!changes && x->impulse[i] == 0) || x->limit[i].circle == 2) continue;
    if (pw_grow (&r->event, (size_t)r->event_count, &r->event_room, sizeof *r->event) != PW_OK) return PW_RESOURCE;
    r->event[r->event_count++] =
        (pw_event){ r->t, x->impulse[i], x->row[i], x->before[i], events_shown (x, i), x->impulse[i] != 0 };
  }
  return PW_OK;
}

/* Decides the modes at the state reached.  jumps: 1 for initial velocities. */
static int events_decide (pw_run *r, int jumps, pw_error *error) {
  pw_events *x = r->events;
  int impacts;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  for (int i = 0; i < x->count; i++) {
    x->before[i] = events_shown (x, i);
    if (x->spare[i] && x->triggered[i] && pw_is_one_sided (&x->limit[i])) x->mode[i] = events_off (x, i, 0);
  }
  events_limits (r);
  events_u (r, r->v, 1, x->now);
  int status = decide_impacts (r, x->now, &impacts, error);
  if (status != PW_OK) return status;
  decide_list (r, x->now, jumps || impacts);
  status = decide_modes (r, error);
  if (status != PW_OK) return status;
  x->pending = x->fell = 0;
  memset (x->triggered, 0, (size_t)x->count);
  events_apply (r);
  return events_log (r) == PW_OK ? PW_OK : pw_fail_memory (r->s, error);
}

/* Projects the state reached onto the equations that hold so far: not all samples satisfy them exactly. */
static int events_project (pw_run *r, pw_error *error) {
  pw_projector p;
  int status = pw_projector_open (&p, r, NULL, NULL, error);
  if (status != PW_OK) return status;
  const double before = pw_energy (r, r->v);
  status = pw_project_positions (&p, r, r->t, r->q, r->v);
  if (status == PW_OK) status = pw_project_velocities (&p, r, r->v);
  pw_projector_close (&p);
  if (status != PW_OK) return pw_fail_singular (r, r->t, error);
  if (r->settings.ledger) r->projected += pw_energy (r, r->v) - before;
  return PW_OK;
}

/* ---- In a run ---- */

/* After a decision.  g of an equation that holds from now on becomes 0; u of one that does not is 0 or leaves it, but g
 * may have drifted. */
static int events_leave (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  int closes = 0, status = PW_OK;
  for (int i = 0; i < x->count; i++) closes |= (x->row[i] < r->s->holonomic) && x->mode[i] == 0 && x->before[i] != 0;
  if (closes) status = events_project (r, error);
  if (status == PW_OK && closes) status = pw_run_evaluate (r, error);
  if (status == PW_OK && closes) status = r->method->restart (r, error);
  if (status != PW_OK) return status;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  events_u (r, r->v, 1, x->u);
  for (int i = 0; i < x->count; i++)
    x->offset[i] = x->limit[i].circle ? 0 : fmax (0, -x->mode[i] * x->u[i] / x->unit[i]);
  return PW_OK;
}

static int events_prepare (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  int status = PW_OK;
  if (r->jumped) x->start_t = NAN;
  r->jumped = 0;
  for (int pass = 0; status == PW_OK && (x->pending || x->start_t != r->t); pass++) {
    if (pass == EVENTS_PASSES) {
      int i = 0;
      while (i < x->count - 1 && !x->triggered[i]) i++;
      return pw_fail (error, PW_METHOD, "t = %.6g s: modes change endlessly: %s", r->t,
                      PW_NAME (pw_system_row_name, r->s, x->row[i]));
    }
    if (x->pending) {
      x->previous_t = NAN, x->longest = EVENTS_FIRST * r->w->scale.time, x->roughness = 0;
      memset (x->armed, 0, (size_t)x->count);
      status = events_project (r, error);
      if (status == PW_OK) status = events_decide (r, 0, error);
      r->watchdog.largest_sine = 0;
      if (status == PW_OK) status = pw_run_renew (r, error);
      if (status == PW_OK) pw_run_set_reference_level (r);
      if (status == PW_OK) status = events_leave (r, error);
    }
    if (status == PW_OK) status = events_at (r, r->t, x->start, error);
    x->start_t = r->t;
    events_arm (r, x->start);
    x->pending = status == PW_OK && events_trigger (r, x->start);
  }
  return status == PW_OK && pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK ? pw_fail_signal (r->t, error) : status;
}

/* Twice the distance of a function from its chord in the last step, from t0, by its values at the ends and one step
 * earlier; NaN: that one is not known. */
static double events_bend (const pw_run *r, double t0, int i) {
  const pw_events *x = r->events;
  const double h = r->t - t0, before = t0 - x->previous_t;
  return fabs ((x->end[i] - x->start[i]) / h - (x->start[i] - x->previous[i]) / before) / (h + before) * h * h / 2;
}

/* 1 if no function comes near its root in the last step, from t0. */
static int events_far (const pw_run *r, double t0) {
  const pw_events *x = r->events;
  for (int i = 0; i < 2 * x->count; i++)
    if (!(fmax (x->start[i], x->end[i]) + 4 * events_bend (r, t0, i) < 0)) return 0;
  return 1;
}

/* The longest next adaptive step: multipliers that signals of time change must be resolved even where nothing moves,
 * and an error estimate would permit any step.  Multistep methods grow by up to 10, and lose their order if they are
 * interrupted more often. */
static double events_longest (pw_run *r, double t0) {
  pw_events *x = r->events;
  const double growth = r->method->order > 0 ? 2 : 10;
  double most = 0, last = x->roughness;
  int held = 0;
  for (int i = 0; i < 2 * x->count; i++) {
    if (x->mode[i / 2]) continue;
    held = 1;
    if (!isnan (x->previous_t)) most = fmax (most, events_bend (r, t0, i) / (EVENTS_BEND * (1 + fabs (x->end[i]))));
  }
  x->roughness = most;
  return held ? (r->t - t0) * fmin (growth, fmax (0.2, 1 / sqrt (fmax (most, last)))) : INFINITY;
}

/* The root of functions of u that have not left their root at t0, but do so before `root`, where they return to it. */
static int events_refine (pw_run *r, pw_crossing_search *search, double t0, double *root) {
  static const double part[] = { 0.5, 0.75, 0.25, 0.875, 0.125, 0.97, 0.03 };
  pw_events *x = r->events;
  int unarmed = 0;
  for (int i = 0; i < x->count; i++) unarmed |= x->triggered[i] && x->mode[i] && !x->armed[i];
  x->fell = unarmed;
  for (size_t p = 0; p < sizeof part / sizeof *part && x->fell; p++) {
    const double t = t0 + part[p] * (*root - t0);
    const int status = events_at (r, t, x->now, search->error);
    if (status != PW_OK) return status;
    events_arm (r, x->now);
    for (int i = 0; i < x->count; i++)
      if (x->triggered[i] && x->mode[i] && x->armed[i]) x->fell = 0;
    if (x->fell) continue;
    memcpy (x->start, x->now, 2 * (size_t)x->count * sizeof *x->start);
    search->status = events_at (r, *root, x->now, search->error);
    const double first = search->status == PW_OK ? pw_first_crossing (search, t, x->start, *root, x->now) : NAN;
    if (!isnan (first)) *root = first;
    return search->status;
  }
  return PW_OK;
}

/* Makes the sample at t the state reached. */
static int events_stop_at (pw_run *r, double t, pw_error *error) {
  pw_events *x = r->events;
  int status = events_at (r, t, x->now, error);
  if (status != PW_OK) return status;
  events_trigger (r, x->now);
  x->pending = 1, x->start_t = NAN;
  if (!x->fell) memset (x->struck, 0, (size_t)x->count);
  if (t == r->t) return PW_OK;
  memcpy (r->q, r->q_at, pw_state_length (r->s) * sizeof *r->q);
  memcpy (r->ledger, r->ledger_at, (size_t)r->entries * sizeof *r->ledger);
  r->projected = r->projected_at;
  r->t = t;
  pw_ledger_rates (r, r->lambda, r->rate);
  return PW_OK;
}

static int events_follow (pw_run *r, double t0, pw_error *error) {
  pw_events *x = r->events;
  const size_t bytes = 2 * (size_t)x->count * sizeof *x->start;
  pw_crossing_search search = { .count = 2 * x->count,
                                .at = events_at,
                                .context = r,
                                .memory = x->memory,
                                .width = 4 * DBL_EPSILON * fmax (fabs (r->t), r->w->scale.time),
                                .error = error };
  x->at_end = r->t < r->breakpoint && events_knows_multipliers (r), x->samples = 0;
  int status = events_at (r, r->t, x->end, error);
  x->at_end = 0;
  double root = NAN;
  if (status == PW_OK && (events_trigger (r, x->end) || !events_far (r, t0)))
    root = pw_first_crossing (&search, t0, x->start, r->t, x->end);
  if (status == PW_OK) status = search.status;
  if (status == PW_OK && !isnan (root)) {
    status = events_at (r, root, x->now, error);
    if (status == PW_OK && events_trigger (r, x->now)) status = events_refine (r, &search, t0, &root);
    if (status == PW_OK) status = events_stop_at (r, root, error);
  } else {
    events_arm (r, x->end);
    x->longest = events_longest (r, t0);
    memcpy (x->previous, x->start, bytes);
    memcpy (x->start, x->end, bytes);
    x->previous_t = t0, x->start_t = r->t;
  }
  if (x->samples == 0) return status;
  pw_forget_residuals (r);
  if (status == PW_OK && pw_evaluate_J_at (r->w, pw_before_breakpoint (r, r->t), r->q, r->v) != PW_OK)
    return pw_fail_signal (r->t, error);
  return status;
}

void pw_events_forget (pw_run *r) {
  pw_events *x = r->events;
  x->pending = x->fell = 0, x->start_t = x->previous_t = NAN;
  memset (x->armed, 0, (size_t)x->count);
}

int pw_events_advance (pw_run *r, double t_end, pw_error *error) {
  int status = events_prepare (r, error);
  const double t0 = r->t, longest = r->fixed_steps ? INFINITY : r->events->longest;
  if (status == PW_OK) circle_begin_step (r);
  if (status == PW_OK) status = r->method->advance (r, fmin (t_end, t0 + longest), error);
  return status == PW_OK ? events_follow (r, t0, error) : status;
}

/* ---- Opening ---- */

/* Units of multipliers and of u; needs the scales. */
static void events_units (pw_run *r) {
  pw_events *x = r->events;
  const double T = r->w->scale.time, L = r->s->scale.length;
  double force = 0;
  events_limits (r);
  for (int j = 0; j < r->s->mechanical; j++)
    force = fmax (force, r->s->mass[j] * pw_unit (r->s, j) * pw_unit (r->s, j) / (L * T * T));
  for (int i = 0; i < x->count; i++) {
    const double arm = pw_rank_multiplier_unit (r->w, x->row[i]), least = x->limit[i].least, most = x->limit[i].most;
    const double largest = fmax (isinf (least) ? 0 : -least, isinf (most) ? 0 : most);
    const double scale = force > 0 ? force * arm : 1;
    x->force_unit[i] = r->s->limit_source[x->row[i]][0] >= 0 ? fmax (largest, scale) : largest > 0 ? largest : scale;
    if (x->partner[i] >= 0) x->force_unit[i] = x->force_unit[x->partner[i]];
    x->unit[i] = L / arm / ((x->row[i] < r->s->holonomic) ? 1 : T);
  }
}

/* Modes for the search of consistent positions and velocities: equations that may be free on one side are, unless that
 * side is left, and friction is. */
static void events_initial (pw_run *r) {
  pw_events *x = r->events;
  events_units (r);
  events_u (r, r->v, 1, x->u);
  for (int i = 0; i < x->count; i++) {
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    const signed char off = events_off (x, i, 0);
    x->mode[i] = one_sided && (!(x->row[i] < r->s->holonomic) || off * x->u[i] >= -EVENTS_SMALL * x->unit[i]) ? off : 0;
    if (x->limit[i].initially_slides) x->mode[i] = 1;
  }
  events_apply (r);
}

/* 1 if a velocity that the model specifies or the user gives was not kept. */
static int events_moved (const pw_run *r) {
  for (int state = r->s->coords; state < 2 * r->s->coords; state++)
    if (pw_initial_specified (&r->initial, state) && pw_initial_moved (r->s, &r->initial, state)) return 1;
  return 0;
}

/* Makes the described state (in r->q_at, r->v_at) consistent with the present modes. */
static int events_consistent (pw_run *r, pw_error *error) {
  events_apply (r);
  memcpy (r->q, r->q_at, 2 * ((size_t)r->s->coords + 3) * sizeof *r->q);
  return pw_run_make_consistent (r, r->events->origin, error);
}

/* 1 if the initial velocities do not satisfy an equation. */
static int events_slides (const pw_events *x, int i) {
  return fabs (x->u_before[i]) > 1e-9 * x->unit[i];
}

/* Friction holds if the velocities, consistent without it, satisfy its equation, else it slides. */
static int events_initial_friction (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  int holds = 0;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  events_u (r, r->v, 0, x->u_before);
  for (int i = 0; i < x->count; i++) {
    if (!x->limit[i].initially_slides || x->partner[i] >= 0) continue; /* contacts are not closed yet */
    x->mode[i] = events_slides (x, i) ? events_off (x, i, x->u_before[i]) : 0;
    holds |= x->mode[i] == 0;
  }
  events_apply (r);
  return holds ? events_consistent (r, error) : PW_OK;
}

/* Velocities of which some are not kept if all equations with two limits hold: as many hold as keep them. */
static int events_initial_sliding (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++)
    if (x->mode[i] == 0 && !(x->row[i] < r->s->holonomic)) x->mode[i] = 1, x->direction[i] = 0;
  int status = events_consistent (r, error);
  for (int i = 0; i < x->count && status == PW_OK; i++) {
    pw_error own = { 0 };
    const int circle = x->limit[i].circle;
    if (pw_is_one_sided (&x->limit[i]) || x->limit[i].initially_slides || circle == 2) continue;
    if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
    events_u (r, r->v, 0, x->u_before);
    x->mode[i] = 0;
    if (circle) x->mode[i + 1] = 0;
    if (!events_slides (x, i) && !(circle && events_slides (x, i + 1))) continue;
    status = events_consistent (r, &own);
    if (status == PW_STOPPED || status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
    if (status == PW_OK && !events_moved (r)) continue;
    events_slide (x, i, x->u_before);
    status = events_consistent (r, error);
  }
  if (status != PW_OK) return status;
  return events_consistent (r, error);
}

int pw_events_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  pw_error own = { 0 };
  r->forces = s->forces > 0;
  if (s->limit == NULL) return pw_run_make_consistent (r, r->origin, error);
  if (events_allocate (r) != PW_OK) return pw_fail_memory (s, error);
  pw_events *x = r->events;
  for (int i = 0; i < s->rows; i++)
    if (pw_is_limited (s, i) && pw_can_hold (&s->limit[i])) x->row[x->count] = i, x->limit[x->count++] = s->limit[i];
  for (int i = 0; i < x->count; i++) {
    x->partner[i] = x->limit[i].relative ? 0 : -1;
    while (x->limit[i].relative && x->row[x->partner[i]] != x->limit[i].partner) x->partner[i]++;
  }
  x->start_t = x->previous_t = NAN, x->origin = r->origin;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  events_initial (r);
  memcpy (r->q_at, r->q, 2 * ((size_t)s->coords + 3) * sizeof *r->q);
  int status = events_consistent (r, &own);
  if (status == PW_STOPPED || status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
  if (status != PW_OK || events_moved (r)) status = events_initial_sliding (r, error);
  return status == PW_OK ? events_initial_friction (r, error) : status;
}

int pw_events_spare (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  x->d.n = 0;
  for (int i = 0; i < x->count; i++)
    if (x->mode[i] == 0 && x->partner[i] < 0) decide_add (x, i, -INFINITY, INFINITY, 0);
  pw_saddle *saddle = decision_open (r, 1, error);
  if (saddle == NULL) return error && error->status == PW_RESOURCE ? PW_RESOURCE : PW_RETRY;
  (void)pw_decision_solve (&x->d, 1);
  for (int k = 0; k < x->d.n; k++) x->spare[x->d.list[k]] = x->d.redundant[k];
  pw_saddle_close (saddle);
  events_apply (r);
  return PW_OK;
}

int pw_events_begin (pw_run *r, pw_error *error) {
  if (r->events == NULL) return PW_OK;
  events_units (r);
  r->events->longest = EVENTS_FIRST * r->w->scale.time;
  int status = events_decide (r, 1, error);
  if (status == PW_OK) status = pw_run_open_saddle (r, error);
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  if (status == PW_OK) pw_run_set_references (r);
  return status;
}

int pw_run_mode (const pw_run *r, int row) {
  const pw_events *x = r ? r->events : NULL;
  for (int i = 0; x && i < x->count; i++)
    if (x->row[i] == row) return events_shown (x, i);
  return 0;
}

int pw_events_restart (pw_run *r, double *energy, pw_error *error) {
  pw_events *x = r->events;
  x->start_t = x->previous_t = NAN, x->roughness = 0, x->origin = NULL;
  x->stepping = x->pending = x->fell = 0;
  memset (x->triggered, 0, (size_t)x->count);
  for (int i = 0; i < x->count; i++) x->limit[i].initially_slides = !pw_is_one_sided (&x->limit[i]);
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  events_initial (r);
  memcpy (r->q_at, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *r->q);
  int status = events_consistent (r, error);
  if (status == PW_OK) status = events_initial_friction (r, error);
  if (status != PW_OK) return status;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  *energy = pw_energy (r, r->v);
  status = pw_events_begin (r, error);
  return status == PW_OK ? pw_run_renew (r, error) : status;
}

int pw_events_check_modes (pw_run *r, const double *v, const double *lambda, pw_error *error) {
  pw_events *x = r->events;
  if (x == NULL) return PW_OK;
  events_u (r, v, 1, x->u);
  for (int i = 0; i < x->count; i++) {
    const char *name = PW_NAME (pw_system_row_name, r->s, x->row[i]);
    const pw_bounds *limit = &x->limit[i];
    const double y = lambda[x->row[i]], u = x->mode[i] * x->u[i];
    const double size = x->partner[i] < 0 ? 1 : fabs (lambda[x->row[x->partner[i]]]);
    const double least = y - size * limit->least, most = size * limit->most - y;
    const double unit = x->mode[i] ? x->unit[i] : x->force_unit[i], margin = x->mode[i] ? u : fmin (least, most);
    const int changes = margin > -EVENTS_BOUNDARY * unit;
    if (margin > EVENTS_BOUNDARY * unit || x->spare[i] || events_depends (x, i) || events_apart (x, i)) continue;
    if (x->mode[i] == 0)
      return pw_fail (error, PW_METHOD, "t = %.6g s: %s is %s a limit of its reaction: %.9g, limit %.9g", r->t, name,
                      changes ? "at" : "beyond", -y, -(least < most ? limit->least : limit->most));
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s %s: its %s is %.3g", r->t, name,
                    changes ? "begins or ceases to hold" : "is on the wrong side of its limit",
                    x->row[i] < r->s->holonomic ? "distance" : "velocity", u);
  }
  return PW_OK;
}

/* ---- Impulses of a step (moreau.c): no event is located ----
 *
 * None of the equations is enforced by others: all have given multipliers, in x->mean.  During a step these are
 * predicted ones; afterwards, with the impulses that correct them at its end, the mean of the step.  Mode 0: u is 0 at
 * the end of the step. */

int pw_impulses_open (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  if (x == NULL || x->stepping) return PW_OK;
  for (int i = 0; i < x->count; i++)
    if (x->partner[i] >= 0)
      return pw_fail (error, PW_INPUT, "%s: the friction of %s depends on a reaction: use rk4 or radau",
                      r->method->name, PW_NAME (pw_system_row_name, r->s, x->row[i]));
    else if (x->limit[i].circle)
      return pw_fail (error, PW_INPUT, "%s: the grip of %s limits a resultant: use rk4, erk8 or radau", r->method->name,
                      PW_NAME (pw_system_row_name, r->s, x->row[i]));
  for (int i = 0; i < x->count; i++) x->mean[i] = x->mode[i] ? events_given (x, i) : r->lambda[x->row[i]];
  x->stepping = 1;
  r->event_count = 0;
  events_apply (r);
  const int status = pw_run_open_saddle (r, error);
  return status == PW_OK ? pw_run_evaluate (r, error) : status;
}

int pw_impulses_predict (pw_run *r) {
  pw_events *x = r->events;
  int changed = 0;
  for (int i = 0; x && i < x->count; i++) {
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    const double next = x->mode[i] ? events_given (x, i) : x->jumped && one_sided ? 0 : x->mean[i];
    changed |= next != x->mean[i];
    x->mean[i] = next;
  }
  if (changed) events_apply (r);
  return changed;
}

/* Lists D, with the limits of what impulses add to those of the predicted multipliers: equations that held at the
 * beginning of the step, those of velocities, and those of positions whose g has left its side. */
static void impulses_list (pw_run *r, double h, const double *g) {
  pw_events *x = r->events;
  x->d.n = x->jumped = 0;
  events_limits (r);
  for (int i = 0; i < x->count; i++) {
    const int side = events_off (x, i, 0), is_position = x->row[i] < r->s->holonomic;
    const double before = side * x->u_before[i] / x->unit[i];
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    x->rests[i] = 1;
    if (is_position && x->mode[i] && side * g[i] > EVENTS_SMALL * x->unit[i]) continue;
    if (one_sided && x->mode[i] && before < -EVENTS_SMALL) {
      x->jumped = 1;
      x->rests[i] = before > -EVENTS_SLOW || x->limit[i].restitution == 0;
    }
    x->d.b[x->d.n] = x->u[i] + (x->rests[i] ? 0 : x->limit[i].restitution * x->u_before[i]);
    decide_add (x, i, h * (x->limit[i].least - x->mean[i]), h * (x->limit[i].most - x->mean[i]), x->mode[i]);
  }
}

int pw_impulses_solve (pw_run *r, pw_projector *p, double h, double t, const double *q, double *v, double *before,
                       pw_error *error) {
  pw_events *x = r->events;
  memcpy (before, r->v, (size_t)r->s->coords * sizeof *before);
  if (pw_evaluate_J_at (r->w, t, q, before) != PW_OK) return pw_fail_signal (t, error);
  if (pw_project_velocities (p, r, before) != PW_OK) return pw_fail_singular (r, t, error);
  events_u (r, before, 1, x->now);
  events_u (r, before, 0, x->u_before);
  if (pw_update_velocities (r->w, v) != PW_OK) return pw_fail_signal (t, error);
  events_u (r, v, 0, x->u);
  impulses_list (r, h, x->now);
  decision_matrix (r, r->saddle);
  int count = -1;
  if (decide_sliding (x, h, x->mean, &count) != PW_OK) return decision_fail (r, r->saddle, count, error);
  decision_push (r, r->saddle, v);
  if (pw_update_velocities (r->w, v) != PW_OK) return pw_fail_signal (t, error);
  impact_end (r, v);
  for (int i = 0; i < x->count; i++) x->mode[i] = x->mode[i] ? x->mode[i] : events_off (x, i, 0);
  for (int k = 0; k < x->d.n; k++) {
    const int i = x->d.list[k];
    x->mean[i] += x->d.x[k] / h;
    x->mode[i] = x->rests[i] ? x->d.trial[k] : events_off (x, i, 0);
  }
  events_apply (r);
  return PW_OK;
}

/* Lists the equations of positions that must be corrected by dq: those that hold, and those that are violated.
 * Returns 1 if one of them is violated. */
static int impulses_violated (pw_run *r, const double *g) {
  pw_events *x = r->events;
  int any = x->d.n = 0;
  for (int i = 0; i < x->count && x->row[i] < r->s->holonomic; i++) {
    const int side = events_off (x, i, 0), holds = x->mode[i] == 0;
    const double off = (holds ? -fabs (g[i]) : side * g[i]) / x->unit[i];
    if (!holds && !(off < -EVENTS_SMALL)) continue;
    any |= off < -EVENTS_SMALL;
    x->d.b[x->d.n] = g[i];
    decide_add (x, i, holds || side > 0 ? -INFINITY : 0, holds || side < 0 ? INFINITY : 0, 0);
  }
  return any;
}

int pw_impulses_project (pw_run *r, pw_projector *p, double t, double *q, const double *v) {
  pw_events *x = r->events;
  for (int pass = 0; pass < 3 * EVENTS_PASSES; pass++) {
    int status = pw_project_positions (p, r, t, q, v);
    if (status != PW_OK || x == NULL) return status;
    events_u (r, v, 1, x->now);
    if (!impulses_violated (r, x->now)) return PW_OK;
    if (pw_saddle_factor (p->position) != PW_OK) return PW_RETRY;
    decision_matrix (r, p->position);
    if (pw_decision_pivot (&x->d, 0) != PW_OK) return PW_RETRY;
    decision_push (r, p->position, q);
  }
  return PW_RETRY;
}

void pw_events_serialise (pw_run *r, pw_archive *a) {
  pw_events *x = r->events;
  if (x == NULL) return;
  pw_archive_bytes (a, x->mode, (size_t)x->count);
  pw_archive_bytes (a, x->triggered, (size_t)x->count);
  pw_archive_bytes (a, x->spare, (size_t)x->count);
  pw_archive_bytes (a, x->still, (size_t)x->count);
  pw_archive_bytes (a, x->struck, (size_t)x->count);
  pw_archive_bytes (a, x->offset, (size_t)x->count * sizeof *x->offset);
  pw_archive_bytes (a, x->direction, (size_t)x->count * sizeof *x->direction);
  pw_archive_bytes (a, x->bias, (size_t)x->count * sizeof *x->bias);
  pw_archive_bytes (a, x->reach, (size_t)x->count * sizeof *x->reach);
  pw_archive_bytes (a, &x->pending, sizeof x->pending);
  pw_archive_bytes (a, &x->fell, sizeof x->fell);
  pw_archive_bytes (a, x->mean, (size_t)x->count * sizeof *x->mean);
  pw_archive_bytes (a, &x->jumped, sizeof x->jumped);
  pw_archive_bytes (a, &x->stepping, sizeof x->stepping);
  pw_archive_count (a, &r->event_count);
  for (long i = 0; i < r->event_count && !a->failed; i++) {
    a->failed |= a->loading && pw_grow (&r->event, (size_t)i, &r->event_room, sizeof *r->event) != PW_OK;
    pw_archive_bytes (a, r->event + i, sizeof *r->event);
  }
  for (int i = 0; i < x->count; i++) {
    const signed char mode = x->mode[i];
    const double given = mode ? events_given (x, i) : 0;
    a->failed |= mode < -1 || mode > 1 || !isfinite (given) || !(x->offset[i] >= 0);
  }
  if (a->failed) r->event_count = 0;
  memset (x->armed, 0, (size_t)x->count);
  x->start_t = x->previous_t = NAN, x->longest = EVENTS_FIRST * r->w->scale.time, x->roughness = 0;
  if (!a->failed) events_apply (r);
}
