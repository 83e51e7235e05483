/* Decisions: linear complementarity problems with two-sided limits (modes.c).  The limits of friction of a contact are
 * multiples of the normal multiplier.  A circle limits the resultant of two multipliers. */
#include <math.h>
#include <string.h>
#include "decision.h"

#define DECISION_NEAR 0.5       /* [limit] of a circle: a multiplier that is larger is near its limit */
#define DECISION_ROUND_OFF 1e-9 /* of z, in the units of decision_size */
enum {
  DECISION_MOST = 5000,    /* combinations of modes that are tried, at about a microsecond each */
  DECISION_PASSES = 10000, /* most projected gradients */
  DECISION_LATE = 500      /* of these, after which circles no longer alternate */
};

/* Makes z and x of an equation comparable. */
static double decision_unit (const pw_decision *d, int k) {
  const double A = d->A[k * d->n + k];
  return A > 0 ? sqrt (A) : 1;
}

int pw_decision_apart (const pw_decision *d, int k) {
  return d->normal[k] >= 0 && d->trial[d->normal[k]] != 0;
}

/* The given multiplier of an equation at the limit of its trial mode; for friction, the factor of the normal one. */
static double decision_given (const pw_decision *d, int k) {
  const double limit = d->trial[k] > 0 ? d->hi[k] : d->lo[k];
  if (d->limit[d->list[k]].circle) return limit * d->towards[k];
  return d->normal[k] < 0 ? limit : limit * pw_limit_sign (&d->limit[d->list[d->normal[k]]]);
}

/* The system K x = y that states z = 0 for the m equations d->held.  Given multipliers are moved to y.  Friction that
 * slides is a multiple of its normal multiplier: it adds to that column. */
static void decision_assemble (pw_decision *d, int m, double *K, double *y) {
  const int n = d->n;
  for (int i = 0; i < m; i++) {
    const double *row = d->A + d->held[i] * n;
    y[i] = d->b[d->held[i]];
    for (int j = 0; j < m; j++) {
      K[i * m + j] = row[d->held[j]];
      for (int k = 0; k < n; k++)
        if (d->normal[k] == d->held[j] && d->trial[k]) K[i * m + j] += row[k] * decision_given (d, k);
    }
    for (int k = 0; k < n; k++)
      if (d->trial[k] && d->normal[k] < 0) y[i] -= row[k] * d->x[k];
  }
}

int pw_decision_solve (pw_decision *d, int skips) {
  const int n = d->n;
  int m = 0, *held = d->held;
  for (int k = 0; k < n; k++) {
    d->redundant[k] = 0;
    if (d->trial[k] == 0 && !pw_decision_apart (d, k)) held[m++] = k;
  }
  double *K = d->factor, *y = K + m * m;
  decision_assemble (d, m, K, y);
  for (int i = 0; i < m; i++) { /* Gaussian elimination: without friction K is positive semidefinite */
    if (!(fabs (K[i * m + i]) > PW_DECISION_DEPENDENT * d->A[held[i] * n + held[i]])) {
      if (!skips && d->normal[held[i]] < 0) return PW_RETRY;
      d->redundant[held[i]] = 1, y[i] = 0;
      for (int k = 0; k < m; k++) K[i * m + k] = K[k * m + i] = k == i;
    }
    for (int k = i + 1; k < m; k++) {
      const double factor = K[k * m + i] / K[i * m + i];
      for (int j = i; j < m; j++) K[k * m + j] -= factor * K[i * m + j];
      y[k] -= factor * y[i];
    }
  }
  for (int i = m - 1; i >= 0; i--) {
    for (int j = i + 1; j < m; j++) y[i] -= K[i * m + j] * y[j];
    d->x[held[i]] = y[i] /= K[i * m + i];
  }
  for (int k = 0; k < n; k++)
    if (d->normal[k] >= 0 && (d->trial[k] || pw_decision_apart (d, k)))
      d->x[k] = pw_decision_apart (d, k) ? 0 : decision_given (d, k) * d->x[d->normal[k]];
  return PW_OK;
}

int pw_decision_depends (pw_decision *d, int k) {
  const signed char mode = d->trial[k];
  int more = 0; /* equations are left out if k holds, too */
  (void)pw_decision_solve (d, 1);
  for (int i = 0; i < d->n; i++) more -= d->redundant[i];
  d->trial[k] = 0;
  (void)pw_decision_solve (d, 1);
  for (int i = 0; i < d->n; i++) more += d->redundant[i];
  d->trial[k] = mode;
  return more > 0;
}

double pw_decision_z (const pw_decision *d, int k) {
  double z = d->b[k];
  for (int i = 0; i < d->n; i++) z -= d->A[k * d->n + i] * d->x[i];
  return z;
}

/* By how much equation k violates its conditions, in the units of decision_size; *to: the mode that would satisfy them.
 * size: decision_size, of which round-off is no violation. */
static double decision_violation (const pw_decision *d, int k, double size, int *to) {
  const double unit = decision_unit (d, k), scale = d->normal[k] < 0 ? 1 : fabs (d->x[d->normal[k]]);
  const double hi = d->normal[k] < 0 ? d->hi[k] : d->hi[k] * scale, lo = d->normal[k] < 0 ? d->lo[k] : d->lo[k] * scale;
  *to = d->x[k] > hi ? 1 : -1;
  if (d->limit[d->list[k]].circle) return 0; /* decision_step_on_circle */
  if (d->fixed[k] || pw_decision_apart (d, k)) return 0;
  /* It holds only if the equations on which it depends imply z = 0.  Otherwise it changes before all others: until then
   * their multipliers are those of contradictory equations. */
  if (d->redundant[k]) {
    const double z = pw_decision_z (d, k) / unit;
    *to = isinf (lo) || (!isinf (hi) && z > 0) ? 1 : -1;
    return 1e6 * (*to * z - DECISION_ROUND_OFF * size);
  }
  if (d->trial[k] == 0) return unit * fmax (d->x[k] - hi, lo - d->x[k]);
  *to = 0;
  /* nearly dependent equations have z of this size whichever of them hold */
  return -d->trial[k] * pw_decision_z (d, k) / unit - 2 * PW_DECISION_DEPENDENT * size;
}

/* Sets the given multipliers, except those of friction, which pw_decision_solve sets. */
static void decision_set_given (pw_decision *d) {
  for (int k = 0; k < d->n; k++)
    if (d->trial[k] && d->normal[k] < 0) d->x[k] = decision_given (d, k);
}

/* The largest |z| and |x|, made comparable by the factor sqrt (A_kk) of each equation. */
static double decision_size (const pw_decision *d) {
  double size = 0;
  for (int k = 0; k < d->n; k++) {
    const double unit = decision_unit (d, k);
    size = fmax (size, fmax (fabs (d->b[k]) / unit, fabs (d->x[k]) * unit));
  }
  return size;
}

int pw_decision_rests (const pw_decision *d, int k) {
  return fabs (pw_decision_z (d, k)) <= DECISION_ROUND_OFF * decision_size (d) * decision_unit (d, k);
}

int pw_decision_contradicts (const pw_decision *d) {
  for (int k = 0; k < d->n; k++)
    if (d->trial[k] == 0 && d->A[k * d->n + k] == 0 && !pw_decision_apart (d, k) && !pw_decision_rests (d, k)) return 1;
  return 0;
}

int pw_decision_pivot (pw_decision *d, int skips) {
  const int n = d->n, last = 50 * (n + 1) - 1;
  int changed = -1, before = 0; /* the last equation that changed its mode, and its mode before */
  for (int k = 0; k < n; k++) d->blocked[k] = 0;
  for (int pass = 0; pass <= last; pass++) {
    int worst = -1, to = 0, next = 0;
    double most = 0;
    decision_set_given (d);
    if (pw_decision_solve (d, skips) != PW_OK) {
      if (changed < 0 || before == 0) return PW_RETRY; /* else it depends on those that hold: back to its limit */
      d->trial[changed] = (signed char)before, d->blocked[changed] = 1;
      continue;
    }
    const double size = decision_size (d);
    for (int k = 0; k < n && (worst < 0 || pass < 10 * n || pass == last); k++) {
      const double violation = d->blocked[k] ? 0 : decision_violation (d, k, size, &next);
      if (violation > most) most = violation, worst = k, to = next;
    }
    if (worst < 0) return PW_OK;
    if (pass == last && most <= DECISION_ROUND_OFF * size) return PW_OK; /* modes that differ by round-off alternate */

    if (to != 0) memset (d->blocked, 0, (size_t)n); /* fewer hold: others may be independent now */
    changed = worst, before = d->trial[worst];
    d->trial[worst] = (signed char)to;
  }
  return PW_RETRY;
}

/* A projected-gradient step for the circle of the equations k, k + 1: y = x + z / trace (A), of their diagonal block.
 * If y is within the limit, both hold from now on, unless it is `late` and y is near the limit.  Otherwise x has the
 * direction of y and the length of the limit.  Returns the change of the direction, or 2 if the mode changes. */
static double decision_step_on_circle (pw_decision *d, int k, int late) {
  const double trace = d->A[k * d->n + k] + d->A[(k + 1) * d->n + k + 1];
  double y[2], change = 0;
  for (int m = 0; m < 2; m++) {
    const double *row = d->A + (k + m) * d->n;
    double z = d->b[k + m];
    for (int i = 0; i < d->n; i++) z -= row[i] * d->x[i];
    y[m] = d->x[k + m] + (d->trial[k] && trace > 0 ? z / trace : 0);
  }
  const double size = hypot (y[0], y[1]), most = d->hi[k] * (1 + (d->trial[k] ? -1 : 1) * 1e-13);
  if (size <= most && (d->trial[k] == 0 || size == 0)) return 0;
  if (size < most && !(late && size > DECISION_NEAR * most)) return d->trial[k] = d->trial[k + 1] = 0, 2;
  if (d->trial[k] == 0) change = 2;
  for (int m = 0; m < 2; m++) {
    change = fmax (change, fabs (y[m] / size - d->towards[k + m]));
    d->towards[k + m] = y[m] / size, d->trial[k + m] = 1;
  }
  return change;
}

/* 1 for an equation whose mode is no choice of a combination: it slides, or is on a circle. */
static int decision_stays (const pw_decision *d, int k) {
  return d->fixed[k] || d->limit[d->list[k]].circle;
}

/* Sets the next combination of trial modes: 0, 1, -1 with two limits, as of friction; 0 and the limit with one.  0
 * after the last combination. */
static int decision_next_modes (pw_decision *d) {
  for (int k = 0; k < d->n; k++) {
    const signed char off = isinf (d->lo[k]) ? 1 : isinf (d->hi[k]) ? -1 : 0;
    if (decision_stays (d, k) || (off == 0 && d->lo[k] == d->hi[k])) continue;
    const signed char now = d->trial[k];
    d->trial[k] = off ? (now ? 0 : off) : now == 0 ? 1 : now == 1 ? -1 : 0;
    if (d->trial[k]) return 1;
  }
  return 0;
}

/* Tries all combinations of modes: friction that depends on reactions may have no solution, or several (Painleve).
 * Solutions count as different if A x differs.  found: 1 if x and the trial modes are a solution already.  PW_OK: they
 * are the only one.  PW_RETRY: *count solutions, 0 or 2.  *count = -1: not known, too many combinations. */
static int decision_enumerate (pw_decision *d, int found, int *count) {
  const int n = d->n;
  double combinations = 1, *kept_z = d->choice, *kept_modes = kept_z + n;
  for (int k = 0; k < n; k++) combinations *= decision_stays (d, k) ? 1 : isinf (d->lo[k]) || isinf (d->hi[k]) ? 2 : 3;
  *count = -1;
  if (combinations > DECISION_MOST) return found ? PW_OK : PW_RETRY;
  *count = found;
  double size = 0; /* of z without x */
  for (int k = 0; k < n; k++) size = fmax (size, fabs (d->b[k]) / decision_unit (d, k));
  for (int k = 0; k < n && found; k++) kept_modes[k] = d->trial[k], kept_z[k] = pw_decision_z (d, k);
  for (int k = 0; k < n; k++) d->trial[k] = decision_stays (d, k) ? d->trial[k] : 0;
  do {
    int to, good, same = 1;
    decision_set_given (d);
    (void)pw_decision_solve (d, 1);
    good = decision_size (d) < 1e6 * size; /* else the equations that hold nearly depend on each other */
    for (int k = 0; k < n; k++) good &= decision_violation (d, k, size, &to) <= DECISION_ROUND_OFF * size;
    for (int k = 0; *count > 0 && k < n; k++)
      same &= fabs (pw_decision_z (d, k) - kept_z[k]) <= 1e-6 * size * decision_unit (d, k);
    if (!good || (*count > 0 && same)) continue;
    if (++*count > 1) return PW_RETRY;
    for (int k = 0; k < n; k++) kept_modes[k] = d->trial[k], kept_z[k] = pw_decision_z (d, k);
  } while (decision_next_modes (d));
  for (int k = 0; k < n && *count == 1; k++) d->trial[k] = (signed char)kept_modes[k];
  decision_set_given (d);
  return *count == 1 ? pw_decision_solve (d, 1) : PW_RETRY;
}

/* 1 if no circle at its limit would slide against the direction of its multiplier. */
static int decision_circles_agree (const pw_decision *d) {
  const double size = decision_size (d);
  for (int k = 0; k < d->n; k++) {
    if (d->limit[d->list[k]].circle != 1 || d->trial[k] == 0 || d->fixed[k]) continue;
    const double along = pw_decision_z (d, k) * d->towards[k] + pw_decision_z (d, k + 1) * d->towards[k + 1];
    if (along / sqrt (d->A[k * d->n + k] + d->A[(k + 1) * d->n + k + 1]) < -1e-9 * size) return 0;
  }
  return 1;
}

/* The first pass.  With friction of contacts it begins with the present modes.  Otherwise all hold at first, so that of
 * equations that depend on each other no more than necessary reach their limits. */
static int decision_begin (pw_decision *d, int coupled, int *count) {
  int status = coupled ? pw_decision_pivot (d, 0) : PW_RETRY;
  for (int k = 0; k < d->n && status != PW_OK; k++)
    if (!d->fixed[k]) d->trial[k] = 0;
  if (status != PW_OK) status = pw_decision_pivot (d, 1);
  return coupled ? decision_enumerate (d, status == PW_OK, count) : status;
}

/* Projected gradients for circles (Goldstein 1964, Convex programming in Hilbert space) alternate with pivoting for the
 * other equations.  If equations depend on each other, circles may leave and reach their limits in turn without end:
 * after DECISION_LATE passes they stay there, and the result is checked. */
int pw_decide (pw_decision *d, int *count) {
  int coupled = 0, circles = 0;
  for (int k = 0; k < d->n; k++) coupled |= d->normal[k] >= 0, circles |= d->limit[d->list[k]].circle;
  *count = -1;
  int status = decision_begin (d, coupled, count);
  double before = INFINITY, change = circles ? INFINITY : 0;
  for (int pass = 0; pass < DECISION_PASSES && status == PW_OK && change != 0; pass++) {
    if (pass > 0) status = pw_decision_pivot (d, 1);
    if (status != PW_OK && coupled) status = decision_enumerate (d, 0, count);
    before = change, change = 0;
    for (int k = 0; k < d->n && status == PW_OK; k++)
      if (d->limit[d->list[k]].circle == 1)
        change = fmax (change, decision_step_on_circle (d, k, pass > DECISION_LATE));
    if (change < 1e-12 && change >= before) change = 0;
  }
  if (change != 0 || !decision_circles_agree (d)) return PW_RETRY;
  return coupled && circles && status == PW_OK ? decision_enumerate (d, 1, count) : status;
}
