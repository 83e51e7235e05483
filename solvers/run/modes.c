/* Modes of the constraint equations whose multipliers have limits, and their decision at an instant.
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
#include <string.h>
#include "modes.h"
#include "rank.h"
#include "util.h"

/* By which a limit that is reached is narrowed: the multiplier of the decision, of a projected state, differs from that
 * of the sample by round-off, about 1e-12 of the limit, which must not undo the event. */
#define MODES_TIGHTER 1e-10
#define CIRCLE_LAG 5e-4       /* of the direction of a circle (circle_longest) */
#define CIRCLE_FIRST 1e-6     /* [T] first fixed step of a circle that slides: u leaves 0 by more than round-off */
enum { CIRCLE_PARTS = 1024 }; /* into which a step is divided at most where that direction turns */
enum { MODES_IMPACTS = 10 };  /* most at one instant, after which all their equations hold */

/* ---- Modes of the run ---- */

double pw_mode_given (const pw_events *x, int i) {
  if (x->limit[i].circle) return x->limit[i].sliding[1] * x->direction[i];
  return x->limit[i].sliding[x->mode[i] > 0];
}

/* Value of signal n (0, 1: while it holds, while it does not) of the limits of equation i, at least 0; else `other`. */
static double modes_magnitude (const pw_run *r, int i, int n, double other) {
  const int source = r->s->limit_source[r->events->row[i]][n];
  return source < 0 ? other : fmax (0, r->w->u[3 * source]);
}

void pw_modes_set_limits (pw_run *r) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count && r->s->limit_sources > 0; i++) {
    pw_bounds *limit = &x->limit[i];
    if (pw_is_one_sided (limit)) continue;
    limit->most = modes_magnitude (r, i, 0, limit->most), limit->least = -limit->most;
    limit->sliding[1] = fmin (limit->most, modes_magnitude (r, i, 1, r->s->limit[x->row[i]].sliding[1]));
    limit->sliding[0] = -limit->sliding[1];
  }
}

int pw_mode_apart (const pw_events *x, int i) {
  return x->partner[i] >= 0 && x->mode[x->partner[i]] != 0;
}

int pw_mode_depends (const pw_events *x, int i) {
  return (x->spare[i] || (x->still[i] && !x->limit[i].circle)) && !pw_mode_apart (x, i);
}

signed char pw_mode_shown (const pw_events *x, int i) {
  return x->still[i] && !x->limit[i].circle ? 0 : x->mode[i];
}

signed char pw_mode_off (const pw_events *x, int i, double u) {
  if (isinf (x->limit[i].least) || x->limit[i].circle) return 1;
  return isinf (x->limit[i].most) || u < 0 ? -1 : 1;
}

void pw_mode_slide (pw_events *x, int i, const double *u) {
  x->mode[i] = pw_mode_off (x, i, u[i]);
  if (x->limit[i].circle == 0) return;
  const double size = hypot (u[i], u[i + 1]);
  x->mode[i + 1] = 1, x->bias[i] = x->bias[i + 1] = 0;
  for (int k = i; k < i + 2; k++) x->direction[k] = size > 0 ? u[k] / size : k == i;
}

void pw_modes_u (pw_run *r, const double *v, int g, double *u) {
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

/* A L of the circle whose first equation is i, where J is evaluated: an upper bound, of the masses without other
 * constraints. */
static double circle_rate (pw_run *r, int i) {
  pw_events *x = r->events;
  double A = 0;
  for (int row = x->row[i]; row < x->row[i] + 2; row++) {
    memset (x->gamma, 0, (size_t)r->s->rows * sizeof *x->gamma);
    memset (x->f, 0, ((size_t)r->s->coords + 3) * sizeof *x->f);
    x->gamma[row] = 1;
    pw_add_JT (r->w, x->gamma, x->f);
    for (int j = 0; j < r->s->coords; j++)
      if (r->s->mass[j] > 0) A += x->f[j] * x->f[j] / r->s->mass[j];
  }
  return A * x->limit[i].sliding[1];
}

/* The largest e0. */
static double circle_reach (const pw_run *r, int i) {
  const pw_events *x = r->events;
  return r->fixed_steps ? r->settings.step * x->rate[i] : sqrt (r->settings.rtol) * x->unit[i];
}

/* The longest step that follows the direction of a circle that slides; h: of e0 = A L h.  In it |u| does not fall below
 * half.  Where |u| is small, but not round-off, e is 0, or the lag of d behind n, about w A L h^2 / |u| with the rate w
 * of n, is below CIRCLE_LAG.  There fixed steps begin short when it begins to slide, and double; of adaptive ones, only
 * those that return there are limited: before, a small u may be an error. */
static double circle_longest (pw_run *r, int i) {
  pw_events *x = r->events;
  const double rate = x->rate[i], h = circle_reach (r, i) / rate;
  const double u[2] = { circle_speed (r->w, x->row[i]), circle_speed (r->w, x->row[i + 1]) }, size = hypot (u[0], u[1]);
  const int near = (size < 4 * h * rate), moves = (r->fixed_steps || x->away[i]) && size > PW_MODES_SMALL * x->unit[i];
  x->away[i] |= !near;
  double longest = near && r->fixed_steps ? x->stride : INFINITY, a[2];
  pw_mul_J (r->w, r->a, x->lambda);
  pw_evaluate_gamma (r->w, x->gamma);
  for (int m = 0; m < 2; m++) a[m] = x->lambda[x->row[i + m]] - x->gamma[x->row[i + m]];
  const double along = u[0] * a[0] + u[1] * a[1], turn = fabs (u[0] * a[1] - u[1] * a[0]);
  if (near && moves)
    longest = fmin (longest, fmax (size / (4 * rate), size * sqrt (CIRCLE_LAG * size / (rate * turn))));
  if (moves && along < 0) longest = fmin (longest, -size * size / (2 * along));
  longest = fmax (longest, near ? h / CIRCLE_PARTS : h);
  return longest < h || !near ? longest : INFINITY;
}

double pw_modes_begin_step (pw_run *r) {
  pw_events *x = r->events;
  double longest = INFINITY;
  for (int i = 0; i < x->count; i++) {
    if (x->limit[i].circle != 1 || x->mode[i] == 0) continue;
    x->rate[i] = circle_rate (r, i);
    longest = fmin (longest, circle_longest (r, i));
  }
  for (int i = 0; i < x->count; i++) {
    double n[2], by_u[4];
    if (x->limit[i].circle != 1 || x->mode[i] == 0) continue;
    const double speed = circle_direction (r, i, n, by_u);
    x->direction[i] = n[0], x->direction[i + 1] = n[1];
    x->reach[i] = fmin (circle_reach (r, i), longest * x->rate[i]);
    x->bias[i] = fmax (0, x->reach[i] - speed / 4);
  }
  x->stride *= 2;
  return longest;
}

/* pw_run.update_given */
static void modes_update (pw_run *r) {
  const pw_events *x = r->events;
  double n[2], by_u[4];
  pw_modes_set_limits (r);
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
    r->reaction[row] = pw_is_one_sided (&x->limit[i]) ? -pw_mode_given (x, i) : -part * limit;
    by->by_source[follows] = limit > 0 ? part : 0;
    for (int m = 0; m < 2 && circle; m++) by->by_u[m] = limit * by_u[2 * circle - 2 + m];
  }
}

void pw_modes_apply (pw_run *r) {
  pw_events *x = r->events;
  int off = 0;
  pw_modes_set_limits (r);
  r->update_given = NULL;
  r->couplings = 0;
  for (int i = 0; i < r->s->rows; i++) {
    const pw_bounds *limit = &r->s->limit[i];
    x->enforced[i] = pw_can_hold (limit);
    r->reaction[i] = 0;
    off |= !x->enforced[i];
  }
  for (int i = 0; i < x->count; i++) {
    const int apart = pw_mode_apart (x, i), on = x->partner[i];
    if (x->mode[i] == 0 && !apart && !x->spare[i] && !x->stepping) continue;
    x->enforced[x->row[i]] = 0;
    off = 1;
    if (on >= 0 && x->mode[i] && !apart)
      r->coupling[r->couplings++] =
          (pw_coupling){ x->row[i], x->row[on], pw_mode_given (x, i) * pw_limit_sign (&x->limit[on]) };
    if (x->stepping || (on < 0 && x->mode[i]))
      r->reaction[x->row[i]] = -(x->stepping ? x->mean[i] : pw_mode_given (x, i));
    if (!x->stepping && x->mode[i] && (r->s->limit_sources > 0 || x->limit[i].circle)) r->update_given = modes_update;
  }
  r->active = r->enforced = off ? x->enforced : NULL;
  r->redundant_drive = off;
  r->forces = off ? PW_FORCES_AT_LIMITS : r->s->forces > 0;
}

/* ---- Decisions ---- */

void pw_modes_matrix (pw_run *r, pw_saddle *saddle) {
  pw_events *x = r->events;
  const pw_system *s = r->s;
  const int n = x->d.n;
  double *Ja = x->lambda + s->rows, *A = x->d.A;
  for (int k = 0; k < n; k++) {
    double alone = 0; /* A_kk without constraints */
    memset (x->gamma, 0, (size_t)s->rows * sizeof *x->gamma);
    memset (x->f, 0, ((size_t)s->coords + 3) * sizeof *x->f);
    x->gamma[x->row[x->d.list[k]]] = 1;
    pw_add_JT (r->w, x->gamma, x->f);
    for (int j = 0; j < s->coords; j++)
      if (s->mass[j] > 0) alone += x->f[j] * x->f[j] / s->mass[j];
    memset (x->lambda, 0, (size_t)s->rows * sizeof *x->lambda);
    pw_saddle_solve (saddle, x->f, x->lambda, x->a, x->lambda);
    pw_mul_J (r->w, x->a, Ja);
    for (int i = 0; i < n; i++) A[i * n + k] = Ja[x->row[x->d.list[i]]];
    x->d.redundant[k] = !(A[k * n + k] > PW_DECISION_DEPENDENT * alone);
  }
  for (int k = 0; k < n; k++)
    for (int i = 0; i < n && x->d.redundant[k]; i++) A[i * n + k] = A[k * n + i] = 0;
}

pw_saddle *pw_modes_open_decision (pw_run *r, int impact, pw_error *error) {
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
  pw_modes_matrix (r, saddle);
  return saddle;
}

void pw_modes_push (pw_run *r, pw_saddle *saddle, double *v) {
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

int pw_modes_fail (pw_run *r, pw_saddle *saddle, int count, pw_error *error) {
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
                  count == 0  ? "with this friction there is no solution (Painleve)"
                  : count > 1 ? "with this friction there are several solutions (Painleve)"
                  : saddle    ? "their equations depend on each other or on other constraints"
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

void pw_modes_end_impact (pw_run *r, const double *v) {
  pw_events *x = r->events;
  const size_t bytes = (size_t)r->s->rows * sizeof *x->gamma;
  memcpy (x->gamma, x->lambda, bytes);
  pw_modes_u (r, v, 0, x->u); /* uses x->lambda */
  memcpy (x->lambda, x->gamma, bytes);
  impact_ledger (r);
}

void pw_modes_add (pw_events *x, int i, double lo, double hi, signed char trial) {
  const int k = x->d.n++;
  x->d.list[k] = i, x->place[i] = k;
  x->d.lo[k] = lo, x->d.hi[k] = hi, x->d.trial[k] = trial, x->d.fixed[k] = 0;
  x->d.normal[k] = x->partner[i] < 0 ? -1 : x->place[x->partner[i]];
}

/* 1 if a holonomic equation does not hold because g has left 0. */
static int modes_open (const pw_run *r, int i, double g) {
  const pw_events *x = r->events;
  return (x->row[i] < r->s->holonomic) && !x->triggered[i] && x->mode[i] * g > PW_MODES_SMALL * x->unit[i];
}

/* Impulses with the restitution of each equation times `part`; *loss: the energy that they dissipate.  If one of the
 * equations has had an impact since the last motion that was resolved, or all of several are slow, they all hold: it is
 * the end of an accumulation, also of a block that rocks. */
static int impact_try (pw_events *x, double part, int *count, double *loss) {
  int ends = 0, fast = 0, impacts = 0;
  for (int k = 0; k < x->d.n; k++) {
    const int i = x->d.list[k];
    if (x->d.normal[k] >= 0) continue;
    ends |= x->fell && x->struck[i], impacts++;
    fast |= fabs (x->u_before[i]) >= PW_MODES_SLOW * x->unit[i];
  }
  ends |= impacts > 1 && !fast;
  for (int k = 0; k < x->d.n; k++) {
    const int i = x->d.list[k], slow = ends || fabs (x->u_before[i]) < PW_MODES_SLOW * x->unit[i];
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
  pw_modes_u (r, r->v, 0, x->u_before);
  for (int i = 0; i < x->count; i++) {
    const double u = x->u_before[i] / x->unit[i];
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    const int hits = x->mode[i] && x->mode[i] * u < -PW_MODES_SMALL;
    x->rests[i] = 0;
    if (x->partner[i] >= 0 && x->place[x->partner[i]] >= 0) pw_modes_add (x, i, x->limit[i].least, x->limit[i].most, 0);
    if (!one_sided || modes_open (r, i, g[i]) || (x->mode[i] && x->mode[i] * u > PW_MODES_SMALL)) continue;
    *any |= hits;
    pw_modes_add (x, i, isinf (x->limit[i].least) ? -INFINITY : 0, isinf (x->limit[i].most) ? INFINITY : 0,
                  pw_mode_off (x, i, 0));
  }
  if (!*any) return PW_OK;
  pw_saddle *saddle = pw_modes_open_decision (r, 1, error);
  int count = -1;
  if (saddle == NULL || impact_solve (x, &count) != PW_OK || pw_decision_contradicts (&x->d)) {
    const int status = pw_modes_fail (r, saddle, count, error);
    pw_saddle_close (saddle);
    return status;
  }
  pw_modes_push (r, saddle, r->v);
  pw_saddle_close (saddle);
  if (pw_update_velocities (r->w, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  pw_modes_end_impact (r, r->v);
  for (int k = 0; k < x->d.n; k++) { /* listed if it changes u by more than what counts as 0 */
    const int i = x->d.list[k];
    if (fabs (x->d.x[k] * x->d.A[k * x->d.n + k]) > PW_MODES_SMALL * x->unit[i]) x->impulse[i] -= x->d.x[k];
    x->struck[i] |= x->d.x[k] != 0;
    x->rests[i] = fabs (x->u[i]) <= PW_MODES_SMALL * x->unit[i];
  }
  return PW_OK;
}

/* Impacts, and those that follow from them at the same instant; *any: 1 if there are.  After many, their equations hold
 * (impact_try). */
static int decide_all_impacts (pw_run *r, const double *g, int *any, pw_error *error) {
  pw_events *x = r->events;
  int more = 1;
  *any = 0;
  memset (x->impulse, 0, (size_t)x->count * sizeof *x->impulse);
  for (int pass = 0; more; pass++) {
    if (pass > MODES_IMPACTS + x->count)
      return pw_fail (error, PW_METHOD, "t = %.6g s: impacts follow each other endlessly", r->t);
    if (pass == MODES_IMPACTS) x->fell = 1;
    const int status = decide_impacts (r, g, &more, error);
    if (status != PW_OK) return status;
    *any |= more;
  }
  return PW_OK;
}

/* Lists D: equations that hold, and those whose u is 0.  jumps: 1 if velocities have jumped, or are initial ones. */
static void decide_list (pw_run *r, const double *g, int jumps) {
  pw_events *x = r->events;
  x->d.n = 0;
  for (int i = 0; i < x->count; i++) x->place[i] = -1;
  pw_modes_u (r, r->v, 0, x->u);
  for (int i = 0, equations; i < x->count; i += equations) {
    equations = x->limit[i].circle ? 2 : 1;
    const int on = x->partner[i];
    const double speed = equations == 2 ? hypot (x->u[i], x->u[i + 1]) : fabs (x->u[i]), u = speed / x->unit[i];
    const int open = !x->rests[i] && modes_open (r, i, g[i]);
    const int moving = u > PW_MODES_SMALL;
    const int parts = moving && (pw_mode_depends (x, i) || (equations == 2 && x->spare[i + 1]));
    const int misses = equations == 2 && x->triggered[i] && x->mode[i] && speed > x->reach[i]; /* u passes beside 0 */
    if (on >= 0 && x->place[on] < 0) {
      x->mode[i] = 1, x->spare[i] = x->still[i] = 0;
      continue;
    }
    const int moves = (jumps || (on >= 0 && x->before[on])) && !open;
    if ((moving && (moves || misses)) || parts) pw_mode_slide (x, i, x->u);
    const int stops = x->triggered[i] && !jumps && !misses && !parts; /* u has reached 0 */
    const int slides = x->mode[i] && moving && (!stops || x->row[i] < r->s->holonomic);
    for (int k = i; k < i + equations && slides; k++) x->spare[k] = x->still[k] = 0;
    if (open || (slides && on < 0)) continue;
    const double unit = on < 0 ? x->force_unit[i] : x->limit[i].most;
    const double tighter = x->mode[i] == 0 && x->triggered[i] ? MODES_TIGHTER * unit : 0;
    for (int k = i; k < i + equations; k++) {
      if (slides)
        pw_modes_add (x, k, x->limit[k].sliding[0], x->limit[k].sliding[1], x->mode[k]);
      else
        pw_modes_add (x, k, fmin (0, x->limit[k].least + tighter), fmax (0, x->limit[k].most - tighter),
                      on < 0 ? x->mode[k] : 0);
      x->d.fixed[x->d.n - 1] = (unsigned char)slides, x->d.towards[x->d.n - 1] = x->direction[k];
    }
  }
  pw_modes_apply (r); /* forces of those outside D */
  if (r->update_given) r->update_given (r);
}

int pw_modes_decide_sliding (pw_events *x, double unit, int *count) {
  for (int again = 1; again;) {
    if (pw_decide (&x->d, count) != PW_OK) return PW_RETRY;
    again = 0;
    for (int k = 0; k < x->d.n; k++) {
      const double *sliding = x->limit[x->d.list[k]].sliding, lo = unit * sliding[0], hi = unit * sliding[1];
      if (x->d.trial[k] > 0 && x->d.hi[k] > hi) x->d.hi[k] = hi, again = 1;
      if (x->d.trial[k] < 0 && x->d.lo[k] < lo) x->d.lo[k] = lo, again = 1;
    }
  }
  return PW_OK;
}

/* Decides the modes of D.  Their u becomes 0 exactly. */
static int decide_modes (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  pw_saddle *saddle = x->d.n > 0 ? pw_modes_open_decision (r, 0, error) : NULL;
  int count = -1, status = saddle ? pw_modes_decide_sliding (x, 1, &count) : PW_OK;
  if (x->d.n > 0 && (saddle == NULL || status != PW_OK || pw_decision_contradicts (&x->d)))
    status = pw_modes_fail (r, saddle, count, error);
  for (int k = 0; k < x->d.n && status == PW_OK; k++) {
    const int i = x->d.list[k], apart = pw_decision_apart (&x->d, k);
    x->mode[i] = apart ? 1 : x->d.trial[k];
    x->still[i] = (unsigned char)pw_decision_rests (&x->d, k);
    x->spare[i] = x->d.redundant[k] && !apart;
    x->direction[i] = x->d.towards[k];
    if (x->limit[i].circle != 1) continue;
    x->rate[i] = circle_rate (r, i);
    x->bias[i] = x->reach[i] = circle_reach (r, i);
    if (x->mode[i] && x->before[i] == 0) x->stride = CIRCLE_FIRST * r->w->scale.time, x->away[i] = 0;
  }
  for (int k = 0; k < x->d.n && status == PW_OK; k++) {
    const int i = x->d.list[k], circle = x->limit[i].circle;
    const int could = x->d.trial[k] && (circle == 1 || !(circle || x->d.fixed[k]));
    x->still[i] &= could && !pw_is_one_sided (&x->limit[i]) && pw_decision_depends (&x->d, k);
  }
  for (int k = 0; k < x->d.n; k++) x->d.normal[k] = -1;
  for (int k = 0; k < x->d.n && status == PW_OK; k++)
    x->d.trial[k] = x->d.fixed[k] || (x->d.trial[k] && pw_decision_depends (&x->d, k)); /* others keep its u */
  for (int k = 0; k < x->d.n; k++) x->d.x[k] = 0, x->d.b[k] = x->u[x->d.list[k]];
  if (x->d.n > 0 && status == PW_OK) {
    (void)pw_decision_solve (&x->d, 1);
    pw_modes_push (r, saddle, r->v);
    if (pw_update_velocities (r->w, r->v) != PW_OK) status = pw_fail_signal (r->t, error);
  }
  pw_saddle_close (saddle);
  return status;
}

static int modes_log (pw_run *r) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++) {
    const int on = x->partner[i],
              changes = pw_mode_shown (x, i) != x->before[i] && (on < 0 || !(x->mode[on] || x->before[on]));
    if ((!changes && x->impulse[i] == 0) || x->limit[i].circle == 2) continue;
    if (pw_grow (&r->event, (size_t)r->event_count, &r->event_room, sizeof *r->event) != PW_OK) return PW_RESOURCE;
    r->event[r->event_count++] =
        (pw_event){ r->t, x->impulse[i], x->row[i], x->before[i], pw_mode_shown (x, i), x->impulse[i] != 0 };
  }
  return PW_OK;
}

int pw_modes_decide (pw_run *r, int jumps, pw_error *error) {
  pw_events *x = r->events;
  int impacts;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  for (int i = 0; i < x->count; i++) {
    x->before[i] = pw_mode_shown (x, i);
    if (x->spare[i] && x->triggered[i] && pw_is_one_sided (&x->limit[i])) x->mode[i] = pw_mode_off (x, i, 0);
  }
  pw_modes_set_limits (r);
  pw_modes_u (r, r->v, 1, x->now);
  int status = decide_all_impacts (r, x->now, &impacts, error);
  if (status != PW_OK) return status;
  decide_list (r, x->now, jumps || impacts);
  status = decide_modes (r, error);
  if (status != PW_OK) return status;
  x->pending = x->fell = 0;
  memset (x->triggered, 0, (size_t)x->count);
  pw_modes_apply (r);
  return modes_log (r) == PW_OK ? PW_OK : pw_fail_memory (r->s, error);
}
