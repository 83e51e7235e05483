/* Symmetries of a system: displacements under which its equations are invariant.  Besides displacements of the whole
 * these are changes of angles on which nothing depends, such as that of a wheel that rolls.  They span the null space
 * of the derivatives of the equations along all displacements, at states in general position, near the initial one and
 * far away, since forces may be constant over a region only; and at each solution (pw_steady_keep_symmetries). */
#include <stdlib.h>
#include "rank.h"
#include "search.h"

enum {
  SYMMETRY_NEAR = 2,  /* states; more than one, since a body alone has more displacements than equations */
  SYMMETRY_STATES = 8 /* the others are turned, and displaced by up to L, 3 L, 9 L, ..., if the whole can be */
};
static const double SYMMETRY_DISTANCE = 0.02, /* of a state from the initial or displaced one, in units of the scene */
    SYMMETRY_PIVOT = 1e-6,                    /* least rate that can be a pivot */
    SYMMETRY_ZERO = 1e-7,                     /* rates below it count as 0 */
    SYMMETRY_SAME = 1e-4; /* of equal states: a double root moves by the root of the residual, 3e-5, with a margin */

void pw_steady_combine (const pw_steady *x, const double *coefficient, double unit, double *rates) {
  int count = pw_steady_rate_count (x->s);
  memset (rates, 0, (size_t)count * sizeof *rates);
  for (int k = 0; k < x->symmetries; k++)
    for (int c = 0; c < count; c++) rates[c] += coefficient[k] / unit * x->symmetry[k * count + c];
}

void pw_steady_velocities (const pw_steady *x, const double *rates, const double *q, double *v) {
  int internal = 3 * x->s->bodies; /* the first internal coordinate */
  for (int j = 0; j < internal; j += 3) {
    v[j] = x->L * rates[PW_RATE_X] - rates[PW_RATE_TURN] * (q[j + 1] - x->origin[1]);
    v[j + 1] = x->L * rates[PW_RATE_Y] + rates[PW_RATE_TURN] * (q[j] - x->origin[0]);
    v[j + 2] = rates[PW_RATE_TURN] + rates[pw_steady_angle_rate (x->s, j)];
  }
  for (int j = internal; j < x->n; j++) v[j] = rates[pw_steady_angle_rate (x->s, j)];
}

/* The largest change of an acceleration by a single coordinate, in units of the scene. */
static double symmetry_largest_change (pw_steady *x) {
  pw_linearisation *l = &x->system.linearisation;
  double most = 0;
  for (int c = 0; c < x->n; c++) {
    memset (l->dx, 0, 2 * (size_t)x->n * sizeof *l->dx);
    l->dx[c] = pw_unit (x->s, c);
    pw_linear_vary (l);
    for (int j = 0; j < x->n; j++)
      most = pw_larger_or_nan (most, fabs (l->da[j]) * pw_length_factor (x->s, j) * x->T * x->T / x->L);
  }
  return most;
}

/* Reduced row echelon form of `rows` rows of n rates; rows that depend on others become 0 and are last.  Pivots are
 * chosen from the last column on, so that angles of single bodies stand alone in their rows. */
static void symmetry_reduce (int rows, int n, double *row) {
  for (int i = 0, c = n - 1; i < rows && c >= 0; c--) {
    int best = i;
    for (int k = i; k < rows; k++)
      if (fabs (row[k * n + c]) > fabs (row[best * n + c])) best = k;
    double pivot = row[best * n + c];
    if (fabs (pivot) < SYMMETRY_PIVOT) continue;
    for (int j = 0; j < n; j++) {
      double kept = row[best * n + j];
      row[best * n + j] = row[i * n + j];
      row[i * n + j] = kept / pivot;
    }
    for (int k = 0; k < rows; k++) {
      double factor = row[k * n + c];
      for (int j = 0; k != i && j < n; j++) row[k * n + j] -= factor * row[i * n + j];
    }
    i++;
  }
  for (int k = 0; k < rows * n; k++)
    if (fabs (row[k]) < SYMMETRY_ZERO) row[k] = 0;
}

void pw_irregular_state (const pw_run *r, double distance, int number, double *q, double *v) {
  for (int j = 0; j < r->s->coords; j++) {
    double unit = distance * pw_unit (r->s, j);
    q[j] = r->q[j] + unit * pw_irregular (1.7 + number, j + 1);
    v[j] = r->v[j] + unit / r->w->scale.time * pw_irregular (2.9 + number, j + 1);
  }
}

/* The whole translates by t while it rotates by w about the origin, p -> R p + V t, with R the rotation by w and V the
 * mean of the rotations on the way. */
void pw_steady_displace (const pw_steady *x, const double *rates, double time, double *q, double *v) {
  const double *o = x->origin, t[2] = { time * x->L * rates[PW_RATE_X], time * x->L * rates[PW_RATE_Y] };
  double w = time * rates[PW_RATE_TURN], c = pw_cos (w), s = pw_sin (w), half = pw_sin (w / 2);
  double p = fabs (w) > 1e-8 ? s / w : 1, r = fabs (w) > 1e-8 ? 2 * half * half / w : w / 2; /* V = [ p -r ; r p ] */
  for (int j = 0; j < 3 * x->s->bodies; j += 3) {
    double dx = q[j] - o[0], dy = q[j + 1] - o[1], vx = v[j], vy = v[j + 1];
    q[j] = o[0] + c * dx - s * dy + p * t[0] - r * t[1];
    q[j + 1] = o[1] + s * dx + c * dy + r * t[0] + p * t[1];
    q[j + 2] += w;
    v[j] = c * vx - s * vy, v[j + 1] = s * vx + c * vy;
  }
  for (int j = 0; j < x->n; j++)
    if (pw_is_angle (x->s, j)) q[j] += time * rates[pw_steady_angle_rate (x->s, j)];
}

/* Evaluates derivatives at state `number` in general position, but on the constraints: off them residuals rotate with
 * the whole.  near: greatest distance of a state from the initial one, or from that after a displacement. */
static int symmetry_evaluate (pw_steady *x, double near, int number) {
  pw_run *r = x->system.run;
  pw_projector p;
  pw_irregular_state (r, near, number, x->q, x->v);
  if (number >= SYMMETRY_NEAR) { /* displaces the whole by up to `far` along x and y, and turns it by up to pi */
    const double far = pow (3, number - SYMMETRY_NEAR);
    memset (x->combined, 0, (size_t)pw_steady_rate_count (x->s) * sizeof *x->combined);
    for (int i = PW_RATE_X; i <= PW_RATE_TURN; i++)
      x->combined[i] = (i == PW_RATE_TURN ? PW_PI : far) * pw_irregular (0.9 + number, 1 + i);
    pw_steady_displace (x, x->combined, 1, x->q, x->v);
  }
  if (pw_projector_open (&p, r, x->s->metric, x->s->metric, &x->why) != PW_OK) return PW_RESOURCE;
  int status = pw_project_positions (&p, r, x->settings.t, x->q, x->v);
  if (status == PW_OK) status = pw_project_velocities (&p, r, x->v);
  pw_projector_close (&p);
  if (status == PW_OK) status = pw_linear_evaluate (&x->system.linearisation, x->settings.t, x->q, x->v);
  if (status == PW_OK) pw_rank_rows (r->w, x->system.linearisation.R, x->system.linearisation.norm);
  return status;
}

/* Number of residuals and accelerations by which an asymmetry is measured. */
static int symmetry_length (const pw_steady *x) {
  const pw_linearisation *l = &x->system.linearisation;
  return l->holonomic + l->rank + x->n + 3; /* the last three are 0, so that there are at least as many as rates */
}

/* Stores the asymmetries of the rows of x->symmetry at x->q, x->v as columns of M, from one column to the next `rows`
 * later, relative to 1 + 1e-4 x the largest derivative of an acceleration, whose round-off they contain.  0 if one is
 * not finite. */
static int symmetry_columns (pw_steady *x, int rows, double *M) {
  const double scale = 1 / (1 + 1e-4 * symmetry_largest_change (x));
  int finite = 1, length = symmetry_length (x) - 3;
  pw_linearisation *l = &x->system.linearisation;
  for (int c = 0; c < x->symmetries; c++, M += rows) { /* what displacements change in the equations at x->q, x->v */
    const double *rates = x->symmetry + c * pw_steady_rate_count (x->s);
    memset (l->dx, 0, 2 * (size_t)x->n * sizeof *l->dx);
    pw_steady_velocities (x, rates, x->q, l->dx);
    pw_linear_turn (l, rates[PW_RATE_TURN], x->v, l->dx + x->n);
    pw_linear_asymmetry (l, rates[PW_RATE_TURN], M);
    for (int i = 0; i < length; i++) finite &= isfinite (M[i] *= scale);
  }
  return finite;
}

/* out: the rates of the combinations of rows of x->symmetry in the null space of M (rows x symmetries, by columns,
 * destroyed; rows >= symmetries).  Returns their number, or a status < 0. */
static int symmetry_combinations (const pw_steady *x, int rows, double *M, double tolerance, double *out) {
  int count = x->symmetries;
  double *c = malloc (((size_t)count * (size_t)count + 1) * sizeof *c);
  if (c == NULL) return PW_RESOURCE;
  int found = count ? pw_null_space (rows, count, M, tolerance, c) : 0;
  for (int i = 0; i < found; i++) pw_steady_combine (x, c + i * count, 1, out + i * pw_steady_rate_count (x->s));
  free (c);
  return found;
}

/* Subtracts from the symmetries the combinations of them that displace nothing, such as a rotation of a pinned disc as
 * the whole less that of its angle alone.  Returns the number of these combinations, by which the caller reduces
 * x->symmetries, or a status < 0.  x->q is in general position. */
static int symmetry_remove_idle (pw_steady *x, int rates) {
  int n = x->n + 3, count = x->symmetries; /* at least as many rows as columns */
  double *F = calloc ((size_t)n * (size_t)count + 1, sizeof *F), *idle_rates = x->free_symmetry;
  if (F == NULL) return PW_RESOURCE;
  for (int k = 0; k < count; k++) {
    pw_steady_velocities (x, x->symmetry + k * rates, x->q, F + k * n);
    for (int j = 0; j < x->n; j++) F[k * n + j] /= pw_unit (x->s, j);
  }
  int idle = symmetry_combinations (x, n, F, PW_STEADY_RANK, idle_rates);
  free (F);
  symmetry_reduce (idle, rates, idle_rates);
  for (int i = 0; i < idle; i++) {
    int last = rates - 1; /* the pivot */
    while (last > 0 && idle_rates[i * rates + last] == 0) last--;
    for (int k = 0; k < count; k++) {
      double factor = x->symmetry[k * rates + last];
      for (int j = 0; j < rates; j++) x->symmetry[k * rates + j] -= factor * idle_rates[i * rates + j];
    }
  }
  return idle;
}

/* Leaves only one symmetry that turns the whole, the last of them: the other rows keep their pivots. */
static void symmetry_keep_one_turn (pw_steady *x, int rates) {
  const double *turn = NULL;
  for (int k = x->symmetries - 1; k >= 0; k--) {
    double *rate = x->symmetry + k * rates, factor = turn ? rate[PW_RATE_TURN] / turn[PW_RATE_TURN] : 0;
    if (turn == NULL && rate[PW_RATE_TURN] != 0) turn = rate;
    for (int c = 0; c < rates && factor != 0; c++) {
      rate[c] -= factor * turn[c];
      if (c == PW_RATE_TURN || fabs (rate[c]) < SYMMETRY_ZERO) rate[c] = 0;
    }
  }
}

/* Makes x->symmetry a basis whose rows are as sparse as possible. */
static void symmetry_simplify (pw_steady *x, int idle) {
  int rates = pw_steady_rate_count (x->s);
  symmetry_reduce (x->symmetries, rates, x->symmetry);
  x->symmetries -= idle;
  symmetry_keep_one_turn (x, rates);
}

/* Leaves the combinations of symmetries in the null space of M.  A status. */
static int symmetry_restrict (pw_steady *x, int rows, double *M) {
  int left = symmetry_combinations (x, rows, M, PW_LINEAR_SYMMETRIC, x->free_symmetry);
  if (left < 0) return left;
  if (left == x->symmetries) return PW_OK; /* the basis remains as it is */
  memcpy (x->symmetry, x->free_symmetry, (size_t)(left * pw_steady_rate_count (x->s)) * sizeof *x->symmetry);
  x->symmetries = left;
  return PW_OK;
}

static int symmetry_add_state (pw_steady *x, int number, int rows, double *M) {
  int status = symmetry_evaluate (x, SYMMETRY_DISTANCE, number);
  M += number * symmetry_length (x);
  if (status == PW_RETRY) status = symmetry_evaluate (x, SYMMETRY_DISTANCE / 100, number);
  const int finite = status == PW_OK && symmetry_columns (x, rows, M);
  if (number < SYMMETRY_NEAR || status == PW_RESOURCE) return status;
  for (int c = 0; c < x->symmetries && !finite; c++) memset (M + c * rows, 0, (size_t)symmetry_length (x) * sizeof *M);
  return PW_OK; /* the whole may be joined to the ground, or forces undefined far away */
}

int pw_steady_find_symmetries (pw_steady *x) {
  int rates = pw_steady_rate_count (x->s), rows = SYMMETRY_STATES * symmetry_length (x), status = PW_OK;
  double *M = calloc ((size_t)rows * (size_t)rates, sizeof *M);
  if (M == NULL) return PW_RESOURCE;
  for (int c = 0; c < rates; c++) x->symmetry[c * rates + c] = 1;
  x->symmetries = x->s->bodies ? rates : 0;
  for (int k = SYMMETRY_STATES; k-- > 0 && status == PW_OK;) status = symmetry_add_state (x, k, rows, M);
  if (status == PW_OK) status = symmetry_restrict (x, rows, M);
  free (M);
  if (status != PW_OK) return status;
  int idle = symmetry_remove_idle (x, rates); /* at state 0, evaluated last */
  if (idle < 0) return idle;
  symmetry_simplify (x, idle);
  return PW_OK;
}

int pw_steady_keep_symmetries (pw_steady *x) {
  int rows = symmetry_length (x), count = x->symmetries;
  int status = pw_linear_evaluate (&x->system.linearisation, x->settings.t, x->q, x->v);
  if (status != PW_OK || count == 0) return status;
  double *M = calloc ((size_t)rows * (size_t)count, sizeof *M);
  if (M == NULL) return PW_RESOURCE;
  if (symmetry_columns (x, rows, M)) status = symmetry_restrict (x, rows, M);
  if (x->symmetries < count) symmetry_simplify (x, 0);
  free (M);
  return status;
}

int pw_steady_find_free_symmetries (pw_steady *x) {
  int symmetries = x->symmetries, holds = x->settings.holds, rows = holds > symmetries ? holds : symmetries;
  double *M = calloc ((size_t)rows * (size_t)symmetries + 1, sizeof *M);
  if (M == NULL) return PW_RESOURCE;
  for (int k = 0; k < symmetries; k++) {
    const double *symmetry = x->symmetry + k * pw_steady_rate_count (x->s);
    pw_steady_velocities (x, symmetry, x->q, x->dq);
    memset (x->dv, 0, (size_t)x->n * sizeof *x->dv);
    pw_linear_turn (&x->system.linearisation, symmetry[PW_RATE_TURN], x->v, x->dv);
    for (int i = 0; i < holds; i++) M[k * rows + i] = pw_hold_residual (x, x->hold + i, x->dq, x->dv);
  }
  x->free_symmetries = symmetries ? pw_null_space (rows, symmetries, M, PW_STEADY_RANK, x->free_symmetry) : 0;
  free (M);
  return x->free_symmetries < 0 ? x->free_symmetries : PW_OK;
}

static int symmetry_of_whole (const double *symmetry) {
  return symmetry[PW_RATE_X] != 0 || symmetry[PW_RATE_Y] != 0 || symmetry[PW_RATE_TURN] != 0;
}

/* The angle by which a state is turned along a symmetry: that of the first body which only this symmetry turns, if
 * possible one that turns as the whole, so that whole turns do not matter; if there is none, of the line to the last
 * body from the centre, or from the first body if the whole can be translated. */
static double symmetry_angle (const pw_steady *x, const double *turn, const double *q) {
  const double own[] = { x->origin[0] - x->L * turn[PW_RATE_Y] / turn[PW_RATE_TURN],
                         x->origin[1] + x->L * turn[PW_RATE_X] / turn[PW_RATE_TURN] },
               *centre = own;
  int rates = pw_steady_rate_count (x->s), last = 3 * (x->s->bodies - 1);
  double angle = NAN;
  for (int b = 0; b < x->s->bodies; b++) {
    double factor = 1 + turn[PW_RATE_ANGLES + b] / turn[PW_RATE_TURN];
    int others = 0;
    for (const double *rate = x->symmetry; rate < x->symmetry + x->symmetries * rates; rate += rates) {
      others += rate != turn && rate[PW_RATE_ANGLES + b] != 0;
      if (rate != turn && symmetry_of_whole (rate)) centre = q;
    }
    if (others == 0 && factor == 1) return q[3 * b + 2];
    if (others == 0 && fabs (factor) > SYMMETRY_PIVOT && isnan (angle)) angle = q[3 * b + 2] / factor;
  }
  return isfinite (angle) ? angle : atan2 (q[last + 1] - centre[1], q[last] - centre[0]);
}

/* The time by which a state is ahead along a symmetry that does not turn the whole: that of the angle that is its
 * pivot, else of the position of the first body. */
static double symmetry_time (const pw_steady *x, const double *rate, const double *q) {
  int c = pw_steady_rate_count (x->s) - 1;
  while (c >= PW_RATE_ANGLES && rate[c] == 0) c--;
  const int k = c - PW_RATE_ANGLES, bodies = x->s->bodies; /* the inverse of pw_steady_angle_rate */
  if (k >= 0) return q[k < bodies ? 3 * k + 2 : 2 * bodies + k] / rate[c];
  double square = rate[PW_RATE_X] * rate[PW_RATE_X] + rate[PW_RATE_Y] * rate[PW_RATE_Y];
  return square > 0 ? (rate[PW_RATE_X] * q[0] + rate[PW_RATE_Y] * q[1]) / (x->L * square) : 0;
}

/* The whole is turned first, since this changes what the other symmetries change; these commute, and the pivot of each
 * is changed by it alone. */
void pw_steady_canonical (const pw_steady *x, double *q, double *v) {
  int rates = pw_steady_rate_count (x->s);
  for (int turns = 1; turns >= 0; turns--)
    for (const double *rate = x->symmetry; rate < x->symmetry + x->symmetries * rates; rate += rates) {
      if ((rate[PW_RATE_TURN] != 0) != turns) continue;
      const double time = turns ? symmetry_angle (x, rate, q) / rate[PW_RATE_TURN] : symmetry_time (x, rate, q);
      pw_steady_displace (x, rate, -time, q, v);
    }
}

void pw_steady_move_to_start (const pw_steady *x, double *q, double *v) {
  int whole = 0, count = pw_steady_rate_count (x->s);
  for (int k = 0; k < x->symmetries; k++) whole += symmetry_of_whole (x->symmetry + k * count);
  if (x->free_symmetries < x->symmetries || whole < 3) return;
  memset (x->combined, 0, (size_t)count * sizeof *x->combined);
  x->combined[PW_RATE_TURN] = 1;
  pw_steady_displace (x, x->combined, x->start[2] - q[2], q, v);
  double dx = x->start[0] - q[0], dy = x->start[1] - q[1];
  for (int j = 0; j < 3 * x->s->bodies; j += 3) q[j] += dx, q[j + 1] += dy;
}

double pw_steady_distance (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2) {
  size_t bytes = (size_t)x->n * sizeof *q1;
  double *a = x->scratch[0], *va = x->scratch[1], *b = x->dq, *vb = x->dv, most = 0;
  memcpy (a, q1, bytes), memcpy (va, v1, bytes), memcpy (b, q2, bytes), memcpy (vb, v2, bytes);
  pw_steady_canonical (x, a, va);
  pw_steady_canonical (x, b, vb);
  for (int j = 0; j < x->n; j++) {
    double unit = pw_unit (x->s, j), off = (a[j] - b[j]) / unit, size = fmax (1, fabs (b[j] / unit));
    if (j < 3 * x->s->bodies && j % 3 == 2) off = remainder (off, 2 * PW_PI), size = 1;
    most = pw_larger_or_nan (most, fabs (off) / size);
    off = (va[j] - vb[j]) / unit * x->T;
    most = pw_larger_or_nan (most, fabs (off) / fmax (1, fabs (vb[j] / unit * x->T)));
  }
  return most;
}

int pw_steady_same (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2) {
  return x && pw_steady_distance (x, q1, v1, q2, v2) <= SYMMETRY_SAME;
}

/* What is held in a steady motion: A (q, v) = value B (q, v).  For a state A is the state and B = 1; for a body
 *
 *     speed      A = vx cos phi + vy sin phi,  B = 1        radius      A = speed,  B = omega
 *                                                           curvature   A = omega,  B = speed */

static const struct {
  const char *name, *unit;
} hold_of_body[PW_HOLD_OF_BODY] = { { "speed", "m/s" }, { "radius", "m" }, { "curvature", "1/m" } };

int pw_system_find_held (const pw_system *s, const char *name, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK || pw_require (name, "a name", error) != PW_OK) return PW_INPUT;
  const char *dot = strrchr (name, '.');
  pw_error none = { 0 };
  for (int k = 0; dot && k < PW_HOLD_OF_BODY; k++) {
    if (strcmp (dot + 1, hold_of_body[k].name) != 0) continue;
    int b = pw_system_find_body (s, PW_PART (name, (size_t)(dot - name)));
    if (b >= 0) return 2 * s->coords + b * PW_HOLD_OF_BODY + k;
  }
  int state = pw_system_find_state (s, name, &none);
  if (state >= 0) return state;
  pw_nearest near = { .sought = name };
  for (int i = 0; i < 2 * s->coords + PW_HOLD_OF_BODY * s->bodies; i++)
    pw_nearest_try (&near, PW_NAME (pw_system_held_name, s, i));
  return pw_fail (error, PW_INPUT, "model %s has no state \"%s\"%s", s->model, name, pw_nearest_text (&near));
}

char *pw_system_held_name (const pw_system *s, int held, char *buffer, size_t size) {
  int index = held - 2 * s->coords;
  if (index < 0) return pw_system_state_name (s, held, buffer, size);
  snprintf (buffer, size, "%s.%s", s->body_name[index / PW_HOLD_OF_BODY], hold_of_body[index % PW_HOLD_OF_BODY].name);
  return buffer;
}

const char *pw_system_held_unit (const pw_system *s, int held) {
  int index = held - 2 * s->coords;
  return index < 0 ? pw_system_state_unit (s, held) : hold_of_body[index % PW_HOLD_OF_BODY].unit;
}

typedef struct {
  double A, B;
} hold_pair;

/* A and B, or if dq is not NULL, their changes by the variation (dq, dv). */
static hold_pair hold_terms (const pw_system *s, int held, const double *q, const double *v, const double *dq,
                             const double *dv) {
  int index = held - 2 * s->coords, b = 3 * (index / PW_HOLD_OF_BODY);
  double B_constant = dq ? 0 : 1; /* B = 1, or its change */
  if (held < s->coords) return (hold_pair){ dq ? dq[held] : q[held], B_constant };
  if (index < 0) return (hold_pair){ dq ? dv[held - s->coords] : v[held - s->coords], B_constant };
  double c = pw_cos (q[b + 2]), sine = pw_sin (q[b + 2]), speed = c * v[b] + sine * v[b + 1], omega = v[b + 2];
  if (dq) speed = c * dv[b] + sine * dv[b + 1] + (c * v[b + 1] - sine * v[b]) * dq[b + 2], omega = dv[b + 2];
  return index % PW_HOLD_OF_BODY == PW_HOLD_SPEED    ? (hold_pair){ speed, B_constant }
         : index % PW_HOLD_OF_BODY == PW_HOLD_RADIUS ? (hold_pair){ speed, omega }
                                                     : (hold_pair){ omega, speed };
}

double pw_system_held_value (const pw_system *s, int held, const double *q, const double *v) {
  const hold_pair pair = hold_terms (s, held, q, v, NULL, NULL);
  return pair.A / pair.B;
}

/* The unit of A, a product of units of the scene. */
static double hold_unit (const pw_steady *x, int held) {
  int n = x->n, index = held - 2 * n;
  if (index < 0) return held < n ? pw_unit (x->s, held) : pw_unit (x->s, held - n) / x->T;
  return (index % PW_HOLD_OF_BODY == PW_HOLD_CURVATURE ? 1 : x->L) / x->T;
}

double pw_hold_residual (const pw_steady *x, const pw_initial_value *hold, const double *dq, const double *dv) {
  const hold_pair pair = hold_terms (x->s, hold->state, x->q, x->v, dq, dv);
  return (pair.A - hold->value * pair.B) / hold_unit (x, hold->state);
}
