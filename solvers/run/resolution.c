/* Signals that change within less than a step.  The stages of a method may miss such a change; then its error estimate
 * misses it as well.  Steps are limited so that they see it.
 *
 * The next time H is resolved if the signal deviates little from the chords through its values at 0, H / 2 and H: by at
 * most a quarter of the largest difference of neighbouring values, or so little that H times the deviation changes
 * velocities by less than a tenth of the tolerance.  The deviation is bounded by interval arithmetic, in parts that are
 * halved while the bound is too large (Moore, Kearfott & Cloud 2009, Introduction to Interval Analysis, chapter 6).
 * States that the signal reads are predicted by the velocities and accelerations of the state reached.
 *
 * Adaptive steps end within the time that is resolved; it is found by halving.  Fixed steps that are longer are
 * counted. */
#include <string.h>
#include "method.h"

#define RESOLUTION_SEEN 0.25     /* largest deviation over the difference of the values seen */
#define RESOLUTION_SHARE 0.1     /* of the tolerance: change of velocities that a step may miss */
#define RESOLUTION_FIXED 1e-6    /* relative tolerance with fixed steps */
#define RESOLUTION_LEAST 1e-10   /* of the span: if this time is not resolved, bounds are too wide to tell */
#define RESOLUTION_NARROWER 0.75 /* largest width of the bounds in a half over that in the whole (resolution_is_near) */
enum { RESOLUTION_DEPTH = 3 };   /* most halvings of a part */
enum { RESOLUTION_AHEAD = 16 };  /* number of fixed steps that are examined at once */

typedef struct {
  const pw_source *source;
  pw_source at;   /* the same, evaluated away from the state reached */
  double effect;  /* acceleration [velocity units / s] per unit of the signal; 0: unknown */
  double size;    /* largest magnitude, if bounds of it are known, else 1 */
  double longest; /* time last resolved */
  double end;     /* until which the signal is resolved in this sense; INFINITY: it is not examined */
} resolution_signal;

struct pw_resolution {
  int count;
  resolution_signal *signal;
  double harmonic;         /* longest step that harmonic signals permit */
  const pw_source *missed; /* a signal that fixed steps did not resolve */
  double previous_t;       /* beginning of the last step */
  double *lo, *hi;         /* of the time and the states that a signal reads */
};

/* The prediction of state j, an index as in pw_source.state, at the time t + s. */
static double resolution_state (const pw_run *r, int j, double s) {
  const int n = r->s->coords;
  return j < n ? r->q[j] + s * (r->v[j] + 0.5 * s * r->a[j]) : r->v[j - n] + s * r->a[j - n];
}

static double resolution_value (const pw_run *r, resolution_signal *x, double s) {
  for (int i = 0; i < x->at.reads; i++) x->at.x[i] = resolution_state (r, x->at.state[i], s);
  if (pw_signal_eval (&x->at, pw_before_breakpoint (r, r->t + s)) != 0) return NAN;
  return x->at.u[0];
}

/* Bounds of the signal between two times, on the path predicted. */
static void resolution_bounds (pw_run *r, const resolution_signal *x, double a, double b, double bounds[2]) {
  struct pw_resolution *d = r->resolution;
  d->lo[0] = r->t + (a > 0 ? a : 1e-6 * b); /* less at discontinuities: "t > 1" does not hold at t = 1 */
  d->hi[0] = fmax (d->lo[0], fmin (r->t + b, r->breakpoint - 1e-6 * (b - a)));
  for (int i = 0; i < x->at.reads; i++) {
    const int j = x->at.state[i], position = j < r->s->coords;
    const double from = resolution_state (r, j, a), to = resolution_state (r, j, b);
    const double bend = position ? fabs (r->a[j]) * (b - a) * (b - a) / 8 : 0;
    d->lo[i + 1] = fmin (from, to) - bend, d->hi[i + 1] = fmax (from, to) + bend;
  }
  pw_signal_bounds (&x->at, d->lo, d->hi, bounds);
}

/* 1 if the deviation from the chord from ya at a to yb at b is proved to be at most `most`, or bounds are unknown.
 * Bounds may be too wide, as of a difference of numbers that change alike.  In the smallest parts the value in the
 * middle therefore decides, if bounds shrink with the interval; those of a narrow peak would not. */
static int resolution_is_near (pw_run *r, resolution_signal *x, double a, double b, double ya, double yb, double most,
                               int depth) {
  double bounds[2];
  resolution_bounds (r, x, a, b, bounds);
  const double width = bounds[1] - bounds[0], m = a + (b - a) / 2, ym = ya + (yb - ya) / 2;
  if (!(width < INFINITY)) return 1;
  if (fmax (bounds[1] - fmin (ya, yb), fmax (ya, yb) - bounds[0]) <= most) return 1;
  if (depth > 0)
    return resolution_is_near (r, x, a, m, ya, ym, most, depth - 1) &&
           resolution_is_near (r, x, m, b, ym, yb, most, depth - 1);
  if (!(fabs (resolution_value (r, x, m) - ym) <= most)) return 0;
  for (int half = 0; half < 2; half++) {
    resolution_bounds (r, x, half ? m : a, half ? b : m, bounds);
    if (!(bounds[1] - bounds[0] <= RESOLUTION_NARROWER * width)) return 0;
  }
  return 1;
}

static int resolution_resolved (pw_run *r, resolution_signal *x, double H) {
  const double m = H / 2, y0 = resolution_value (r, x, 0), y1 = resolution_value (r, x, m),
               y2 = resolution_value (r, x, H), rtol = r->fixed_steps ? RESOLUTION_FIXED : r->settings.rtol;
  const double harmless = RESOLUTION_SHARE * rtol * (x->effect > 0 ? 1 / (x->effect * H) : x->size);
  const double most = fmax (harmless, RESOLUTION_SEEN * fmax (fabs (y1 - y0), fabs (y2 - y1)));
  return resolution_is_near (r, x, 0, m, y0, y1, most, RESOLUTION_DEPTH) &&
         resolution_is_near (r, x, m, H, y1, y2, most, RESOLUTION_DEPTH);
}

/* The first of `longest`, its half, quarter, ... down to `least` that is resolved; 0: none is. */
static double resolution_find (pw_run *r, resolution_signal *x, double longest, double least) {
  for (double H = longest;; H = fmax (H / 2, least)) {
    if (resolution_resolved (r, x, H)) return H;
    if (!(H > least)) return 0;
  }
}

/* Finds until when the signal is resolved, from the state reached on; before: length of the last step. */
static void resolution_examine (pw_run *r, resolution_signal *x, double before) {
  const double remaining = r->breakpoint - r->t, predicted = x->at.reads > 0 ? 0 : 2 * x->longest;
  const double growth = r->method->order > 0 ? 2 : 10; /* multistep methods lose their order if they grow slowly */
  const double ahead = r->fixed_steps ? RESOLUTION_AHEAD * r->settings.step : growth * before;
  const double longest = fmin (remaining, fmax (predicted, ahead));
  const double least = r->fixed_steps ? r->settings.step : RESOLUTION_LEAST * r->settings.span;
  x->longest = resolution_find (r, x, longest, fmin (longest, least));
  x->end = r->t + x->longest;
  if (x->longest > 0) return;
  if (r->fixed_steps)
    r->resolution->missed = x->source;
  else /* its bounds are too wide: it does not limit steps until then */
    x->end = x->at.reads > 0 ? r->t + ahead : INFINITY, x->longest = ahead;
}

double pw_resolution_end (pw_run *r) {
  struct pw_resolution *d = r->resolution;
  const double h = r->settings.step;
  int missed = r->fixed_steps && h > d->harmonic;
  if (!r->predicted) {
    d->previous_t = NAN, r->predicted = 1;
    for (resolution_signal *x = d->signal; x < d->signal + d->count; x++) x->longest = 0, x->end = -INFINITY;
  }
  double before = r->t - d->previous_t, end = r->fixed_steps ? INFINITY : r->t + d->harmonic;
  if (!(before > 0)) before = r->fixed_steps ? h : pw_first_step (r);
  for (resolution_signal *x = d->signal; x < d->signal + d->count; x++) {
    if (r->fixed_steps ? r->t + h > x->end + 1e-9 * h : r->t >= x->end - x->longest / 2)
      resolution_examine (r, x, before);
    missed |= r->fixed_steps && x->longest == 0;
    end = fmin (end, x->end);
  }
  r->statistics.unresolved += missed;
  d->previous_t = r->t;
  r->resolved_until = missed ? -INFINITY : end;
  return r->fixed_steps ? INFINITY : end;
}

char *pw_run_unresolved (const pw_run *r, char *signal, size_t size) {
  const pw_source *failed = r->w->failed;
  const struct pw_resolution *d = r->resolution;
  *signal = 0;
  if (d == NULL || r->statistics.unresolved == 0 || d->missed == NULL) return signal;
  r->w->failed = d->missed; /* which pw_failed_signal names */
  pw_failed_signal (r->w, signal, size);
  r->w->failed = failed;
  return signal;
}

/* The largest acceleration [velocity units / s] per unit of a force's signal; 0: unknown.  Constraints are left out:
 * they can only reduce it (Gauss' principle). */
static double resolution_effect (pw_run *r, const pw_source *source) {
  const pw_system *s = r->s;
  double *f = r->scratch, *changed = f + s->coords + 3, most = 0;
  if (!source->of_force) return 0;
  pw_evaluate_force (r->w, f);
  const double u = source->u[0];
  source->u[0] += 1;
  pw_evaluate_force (r->w, changed);
  source->u[0] = u; /* not u + 1 - 1: it may be small */
  for (int j = 0; j < s->coords; j++) {
    const double change = fabs (changed[j] - f[j]);
    if (change > 0) most = fmax (most, change / (s->mass[j] * pw_velocity_unit (r, j, r->v[j])));
  }
  return most < INFINITY ? most : 0;
}

int pw_resolution_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  struct pw_resolution *d, found = { .harmonic = INFINITY };
  int most = 0, reads = 0;
  for (const pw_source *source = r->w->source; source < r->w->source + s->sources; source++) {
    const int bounded = pw_signal_is_bounded (source);
    found.count += bounded, most = source->reads > most ? source->reads : most, reads += bounded ? source->reads : 0;
    if (source->signal.type != PW_HARMONIC || source->of_coordinate) continue;
    const double rtol = r->fixed_steps ? RESOLUTION_FIXED : r->settings.rtol, effect = resolution_effect (r, source);
    const double A = fabs (source->signal.harmonic.amplitude), half = PW_PI / fabs (source->signal.harmonic.omega);
    /* half a period, or longer if its effect is within the tolerance */
    const double longest = A == 0 ? INFINITY : effect > 0 ? fmax (half, RESOLUTION_SHARE * rtol / (effect * A)) : half;
    if (longest < found.harmonic) found.harmonic = longest, found.missed = source;
  }
  if (found.count == 0 && !(found.harmonic < (r->fixed_steps ? r->settings.step : INFINITY))) return PW_OK;
  double *x;
  if (!PW_ARENA_ARRAYS (&r->arena, PW_ARRAY (d, 1), PW_ARRAY (found.signal, found.count), PW_ARRAY (found.lo, most + 1),
                        PW_ARRAY (found.hi, most + 1), PW_ARRAY (x, 3 * found.count + 2 * reads)))
    return pw_fail_memory (s, error);
  resolution_signal *signal = found.signal;
  *(r->resolution = d) = found;
  for (const pw_source *source = r->w->source; source < r->w->source + s->sources; source++) {
    if (!pw_signal_is_bounded (source)) continue;
    double bounds[2]; /* in all states during the run */
    d->lo[0] = r->t, d->hi[0] = r->t + r->settings.span;
    for (int i = 1; i <= source->reads; i++) d->lo[i] = -DBL_MAX, d->hi[i] = DBL_MAX;
    pw_signal_bounds (source, d->lo, d->hi, bounds);
    const double size = fmax (fabs (bounds[0]), fabs (bounds[1]));
    *signal = (resolution_signal){ .at = *source, .source = source, .effect = resolution_effect (r, source) };
    signal->size = size > 1e-100 && size < 1e100 ? size : 1; /* a signal of 0 has bounds next to 0 */
    signal->at.u = x, signal->at.x = x + 3, x += 3 + 2 * source->reads;
    signal++;
  }
  r->resolved_until = -INFINITY;
  return PW_OK;
}
