/* Steps see what acts on them: signals whose values inside a step differ from those that the step can see.
 *
 * A step from t0 to t1 resolves a signal u if, with the hull of its values at t0, in the middle and at t1,
 *
 *   - an enclosure of u on the step exceeds the hull by no more than half its width,
 *   - u at irregular times differs from the parabola through the three values by no more than a share of that width,
 *
 * up to a small part of the largest |u| met so far.  Enclosures are by interval arithmetic and by the mean-value form
 * u(m) + u' (t - m) with an enclosure of u'.  The piece of the step with the largest excess is halved until none has an
 * excess, or u in the middle of a piece proves it (branch and bound; Moore, Kearfott & Cloud 2009, Introduction to
 * Interval Analysis, chapters 6 and 9): a peak of the width w in a step of size h takes about 2 log2 (h / w)
 * enclosures.
 *
 * Adaptive methods end a step where it would not resolve a signal; later errors are theirs to control.  Steps of fixed
 * size are counted.  A signal that reads states is enclosed along the predicted motion q + s v + s^2 a / 2, v + s a. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "narrow.h"
#include "method.h"

enum { PIECES = 120 };          /* most pieces of a step */
enum { ATTEMPTS = 200 };        /* at most, to find the end of a step */
enum { EVERY = 16 };            /* functions without enclosures are compared in one of 16 steps of fixed size */
#define WINDOW 8                /* steps that are tested together, where the signal is nearly straight */
#define RESTART 0.2             /* multistep methods restart for a step shorter than this part of the last one */
#define UNDECIDED 1e-2          /* excess that enclosures may leave undecided, over the largest |u| */
#define TINY 1e-100             /* excess without effect */
#define FIXED_SMALL 5e-3        /* small part of the largest |u|, with steps of fixed size; adaptive: rtol */
#define FIXED_HALF_PERIOD PW_PI /* largest omega h of a harmonic, with steps of fixed size */
#define ADAPTIVE_PHASE 4        /* the same, adaptive */

/* What is known of a signal in a run; saved in checkpoints. */
typedef struct {
  double size;  /* largest |u| met */
  double clear; /* time up to which all steps resolve it */
  double again; /* time before which windows are not tested */
  double step;  /* size of steps that would have resolved it; INFINITY if all have */
  double steps; /* of fixed size that have not */
  double miss;  /* largest difference from what they see */
} narrow_record;

typedef struct {
  const pw_source *source;
  pw_enclosure enclosure;
  int derivative, reads; /* derivative that acts; states read */
} narrow_signal;

struct pw_narrow {
  int count, fixed;      /* signals; 1: steps of fixed size */
  int multistep;         /* 1: a method that evaluates steps only at their ends, besides earlier states */
  double half, ratio;    /* shares of the hull's width; least over greatest slope of a nearly straight signal */
  double small;          /* small part of the largest |u| */
  narrow_signal *signal; /* count */
  narrow_record
      *record; /* count + 1; of the last one: .clear: time up to which steps are counted; .again: time of the last
                          * restart; .size: length of a step that was cut */
  pw_interval *value, *rate; /* of the time and the states that a signal reads */
  double *x;                 /* these states */
};

/* A signal on the way from the state reached. */
typedef struct {
  pw_run *r;
  const narrow_signal *signal;
  narrow_record *record;
} narrow_path;

static double path_value (const narrow_path *p, double t) {
  const pw_run *r = p->r;
  const double s = t - r->t;
  double *x = r->narrow->x;
  for (int i = 0, n = r->s->coords; i < p->signal->reads; i++) {
    int j = p->signal->source->state[i];
    x[i] = j < n ? r->q[j] + s * (r->v[j] + s * r->a[j] / 2) : r->v[j - n] + s * r->a[j - n];
  }
  return pw_signal_acting (p->signal->source, p->signal->derivative, t, x);
}

static pw_interval path_interval (double a, double b) {
  return (pw_interval){ fmin (a, b), fmax (a, b) };
}

/* Bounds of u in bound[0], of u' in bound[1]. */
static void path_enclose (const narrow_path *p, double t0, double t1, pw_interval bound[2]) {
  const pw_run *r = p->r;
  const double from = t0 - r->t, to = t1 - r->t;
  pw_interval *value = r->narrow->value, *rate = r->narrow->rate;
  *value++ = (pw_interval){ t0, t1 }, *rate++ = (pw_interval){ 1, 1 };
  for (int i = 0, n = r->s->coords; i < p->signal->reads; i++) {
    int j = p->signal->source->state[i], k = j < n ? j : j - n;
    double q = r->q[k], v = r->v[k], a = r->a[k], v0 = v + from * a, v1 = v + to * a;
    rate[i] = j < n ? path_interval (v0, v1) : path_interval (a, a);
    value[i] =
        j < n ? path_interval (q + from * (v + from * a / 2), q + to * (v + to * a / 2)) : path_interval (v0, v1);
    if (j < n && v0 * v1 < 0) /* it turns at v = 0 */
      value[i] = (pw_interval){ fmin (value[i].lo, q - v * v / a / 2), fmax (value[i].hi, q - v * v / a / 2) };
  }
  pw_signal_enclose (p->signal->source, p->signal->derivative, r->narrow->value, r->narrow->rate, bound);
}

/* 1 if every step of a size up to h between two times resolves the signal, by its slope alone. */
static int path_is_straight (const narrow_path *p, double t0, double t1, double h) {
  const pw_narrow *x = p->r->narrow;
  pw_interval bound[2], *u = &bound[0], *slope = &bound[1];
  path_enclose (p, t0, t1, bound);
  if (u->lo > u->hi) return 1; /* it has no value there: the method will fail */
  if (u->lo > 0 || u->hi < 0) p->record->size = fmax (p->record->size, fmin (fabs (u->lo), fabs (u->hi)));
  double small = x->small * p->record->size + TINY;
  return u->hi - u->lo <= small || h * (slope->hi - slope->lo) <= small ||
         (slope->lo > 0 && slope->hi <= x->ratio * slope->lo) || (slope->hi < 0 && slope->lo >= x->ratio * slope->hi);
}

/* What a step sees. */
typedef struct {
  double u0, middle, u1;
  double lo, hi, curved; /* permitted: range, difference from the parabola */
} narrow_view;

static int view_excludes (const narrow_view *see, double u) {
  return !(u >= see->lo && u <= see->hi);
}

/* A piece of a step. */
typedef struct {
  double t0, t1, excess, reach; /* reach: bound of |u - u(m)| in it */
} narrow_piece;

/* Fills the excess of a piece; 1 if the value in the middle proves it. */
static int piece_measure (const narrow_path *p, const narrow_view *see, narrow_piece *piece) {
  double half = (piece->t1 - piece->t0) / 2, u = path_value (p, piece->t0 + half);
  pw_interval bound[2];
  path_enclose (p, piece->t0, piece->t1, bound);
  double reach = piece->reach = half * fmax (fabs (bound[1].lo), fabs (bound[1].hi));
  double lo = reach < INFINITY ? fmax (bound[0].lo, u - reach) : bound[0].lo;
  double hi = reach < INFINITY ? fmin (bound[0].hi, u + reach) : bound[0].hi;
  piece->excess = fmax (see->lo - lo, hi - see->hi);
  p->record->size = fmax (p->record->size, fabs (u));
  return view_excludes (see, u) && !isnan (u);
}

/* Twice the excess that round-off causes in the middle of a piece, of an interval of a few units in the last place. */
static double piece_round_off (const narrow_path *p, const narrow_view *see, const narrow_piece *piece) {
  pw_interval bound[2];
  double t = piece->t0 + (piece->t1 - piece->t0) / 2;
  path_enclose (p, t, t + 4 * DBL_EPSILON * fabs (t), bound);
  return 2 * fmax (see->lo - bound->lo, bound->hi - see->hi);
}

/* Halves pieces until none has an excess, other than by round-off: 1.  0: the signal leaves the range in the piece
 * *found, or may do so.  Without bounds of u', an excess that many pieces leave is that of the enclosures. */
static int path_search (const narrow_path *p, const narrow_view *see, double t0, double t1, narrow_piece *found) {
  narrow_piece piece[PIECES + 1] = { { .t0 = t0, .t1 = t1 } };
  const double least = 64 * DBL_EPSILON * fmax (fabs (t0), fabs (t1));
  int count = 1, most = 0;
  if (piece_measure (p, see, piece)) return *found = piece[0], 0;
  while (piece[most].excess > 0 && count < PIECES) {
    narrow_piece *left = &piece[most], *right = &piece[count++];
    double middle = left->t0 + (left->t1 - left->t0) / 2;
    *right = (narrow_piece){ .t0 = middle, .t1 = left->t1 };
    left->t1 = middle;
    if (piece_measure (p, see, left)) return *found = *left, 0;
    if (piece_measure (p, see, right)) return *found = *right, 0;
    most = 0;
    for (int i = 0; i < count; i++) {
      if (piece[i].t1 - piece[i].t0 < least) piece[i].excess = 0; /* too narrow to be seen by any step */
      if (piece[i].excess >= piece[most].excess) most = i;
    }
    if ((count & (count - 1)) == 0 && piece[most].excess <= piece_round_off (p, see, &piece[most])) return 1;
  }
  *found = piece[most];
  return piece[most].reach == INFINITY || !(piece[most].excess > UNDECIDED * p->record->size);
}

/* 1 if a multistep method, which does not evaluate the middle of a step, can know the signal's value there: from those
 * at the ends, and on an interval of the same size before the step, or since the last restart. */
static int path_shows_middle (const narrow_path *p, double t0, double h, const narrow_view *see, double small) {
  const pw_narrow *x = p->r->narrow;
  double lo = fmin (see->u0, see->u1), hi = fmax (see->u0, see->u1), from = fmax (x->record[x->count].again, t0 - h);
  if (!x->multistep || (see->middle >= lo - small && see->middle <= hi + small)) return 1;
  for (int i = 0; i < 2; i++) {
    double u = path_value (p, from + (t0 - from) * i / 2);
    lo = fmin (lo, u), hi = fmax (hi, u);
  }
  double half = (hi - lo) / 2 + small;
  return see->middle >= lo - half && see->middle <= hi + half;
}

/* 1 if a step resolves the signal; otherwise *end: an earlier end to try, *peak: a time where it is not resolved. */
static int path_is_resolved (const narrow_path *p, double t0, double t1, double *end, double *peak) {
  static const double part[] = { 0.21, 0.33, 0.68, 0.87 };
  const pw_narrow *x = p->r->narrow;
  const double h = t1 - t0, u0 = path_value (p, t0), middle = path_value (p, t0 + h / 2), u1 = path_value (p, t1);
  double lo = fmin (fmin (u0, u1), middle), hi = fmax (fmax (u0, u1), middle);
  if (isnan (u0 + middle + u1)) return 1; /* the method will fail */
  p->record->size = fmax (p->record->size, fmax (fabs (lo), fabs (hi)));
  double small = x->small * p->record->size + TINY, half = (hi - lo) / 2 + small;
  const narrow_view see = { u0, middle, u1, lo - half, hi + half, x->half * (hi - lo) + small };
  if (!path_shows_middle (p, t0, h, &see, small)) return *end = *peak = t0 + h / 2, 0;
  for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
    double s = part[i], t = t0 + s * h, u = path_value (p, t);
    double parabola = u0 * (1 - s) * (1 - 2 * s) + middle * 4 * s * (1 - s) + u1 * s * (2 * s - 1);
    if (isnan (u)) return 1;
    p->record->size = fmax (p->record->size, fabs (u));
    if (!(fabs (u - parabola) > see.curved) && !view_excludes (&see, u)) continue;
    p->record->miss = fmax (p->record->miss, fabs (u - parabola));
    return *end = *peak = t, 0;
  }
  narrow_piece found;
  if (p->signal->enclosure != PW_ENCLOSED || path_search (p, &see, t0, t1, &found)) return 1;
  p->record->miss = fmax (p->record->miss, found.excess);
  *peak = found.t0 + (found.t1 - found.t0) / 2;
  *end = found.t0 > t0 ? found.t0 : *peak;
  return 0;
}

/* 1 if a step is certain to resolve the signal, without evaluations or by its slope. */
static int path_is_clear (const narrow_path *p, double t0, double t1) {
  const pw_run *r = p->r;
  narrow_record *x = p->record;
  double h = t1 - t0, window = fmin (t0 + WINDOW * h, pw_before_breakpoint (r, t0 + WINDOW * h));
  if (p->signal->enclosure != PW_ENCLOSED) return 0;
  if (p->signal->reads) return path_is_straight (p, t0, t1, h);
  if (t1 <= x->clear) return 1;
  if (t0 >= x->again && path_is_straight (p, t0, window, h)) return x->clear = window, 1;
  if (t0 >= x->again) x->again = t0 + h * WINDOW / 2;
  return path_is_straight (p, t0, t1, h);
}

/* ---- Runs ---- */

static int narrow_derivative (const pw_system *s, const pw_source *source) {
  const pw_element_batch *k = s->batch;
  while (source - k->source >= k->b.count * k->kind->signals) k++;
  return source->of_force ? 0 : k->kind->level == PW_HOLONOMIC ? 2 : 1;
}

int pw_narrow_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  int count = 0, reads = 0;
  pw_narrow *x = pw_arena_alloc (&r->arena, sizeof *x);
  narrow_signal *signal = pw_arena_alloc (&r->arena, ((size_t)s->sources + 1) * sizeof *signal);
  if (x == NULL || signal == NULL) return pw_fail_memory (s, error);
  for (int i = 0; i < s->sources; i++) {
    const pw_source *source = r->w->source + i;
    int derivative = narrow_derivative (s, s->source + i);
    pw_enclosure enclosure = pw_signal_enclosure (source, derivative);
    if (enclosure == PW_RESOLVED || (enclosure == PW_UNENCLOSED && (!r->fixed_steps || source->reads))) continue;
    signal[count++] = (narrow_signal){ source, enclosure, derivative, source->reads };
    reads = source->reads > reads ? source->reads : reads;
  }
  if (count == 0) return PW_OK;
  *x = (pw_narrow){ .count = count,
                    .fixed = r->fixed_steps,
                    .multistep = r->method->order == 0,
                    .signal = signal,
                    .half = 0.5,
                    .ratio = 4 };
  x->small = r->settings.rtol;
  if (x->fixed) x->half = 0.25, x->ratio = 1.5, x->small = FIXED_SMALL;
  x->record = pw_arena_alloc (&r->arena, ((size_t)count + 1) * sizeof *x->record);
  x->value = pw_arena_alloc (&r->arena, ((size_t)reads + 1) * sizeof *x->value);
  x->rate = pw_arena_alloc (&r->arena, ((size_t)reads + 1) * sizeof *x->rate);
  x->x = pw_arena_alloc (&r->arena, ((size_t)reads + 1) * sizeof *x->x);
  if (x->record == NULL || x->value == NULL || x->rate == NULL || x->x == NULL) return pw_fail_memory (s, error);
  for (int i = 0; i <= count; i++) x->record[i].step = INFINITY;
  r->narrow = x;
  pw_narrow_forget (r);
  return PW_OK;
}

void pw_narrow_forget (pw_run *r) {
  pw_narrow *x = r->narrow;
  for (int i = 0; x && i <= x->count; i++) x->record[i].clear = x->record[i].again = r->t;
}

void pw_narrow_serialise (pw_run *r, pw_archive *a) {
  const pw_narrow *x = r->narrow;
  if (x) pw_archive_bytes (a, x->record, ((size_t)x->count + 1) * sizeof *x->record);
}

/* The end of a step that resolves one signal. */
static double narrow_end (pw_run *r, int i, double t1, double least) {
  const narrow_path p = { r, &r->narrow->signal[i], &r->narrow->record[i] };
  double end = t1, peak;
  if (p.signal->enclosure == PW_PERIODIC)
    return fmin (t1, r->t + ADAPTIVE_PHASE / fabs (p.signal->source->signal.harmonic.omega));
  for (int k = 0; k < ATTEMPTS && end > least; k++) {
    double before = pw_before_breakpoint (r, end);
    if (path_is_clear (&p, r->t, before) || path_is_resolved (&p, r->t, before, &end, &peak)) break;
  }
  double *cut = &r->narrow->record[r->narrow->count].size;
  if (end < t1 && p.signal->reads) *cut = fmax (*cut, t1 - r->t);
  return end;
}

/* Around a narrow force that depends on states Newton matrices are valid on the way of a step only: they are renewed
 * from the step that was cut to the first that is as long again. */
double pw_narrow_end (pw_run *r, double t1) {
  const pw_narrow *x = r->narrow;
  if (x == NULL || x->fixed) return t1;
  const double least = r->t + 4 * pw_least_step (r), h = t1 - r->t;
  double *cut = &x->record[x->count].size;
  for (double before = INFINITY; t1 < before && t1 > least;) {
    before = t1;
    for (int i = 0; i < x->count; i++) t1 = narrow_end (r, i, t1, least);
  }
  r->matrix_outdated |= *cut > 0;
  if (t1 - r->t >= *cut) *cut = 0;
  return fmin (fmax (t1, least), r->t + h);
}

int pw_narrow_stop (pw_run *r, double h, double last, double *stop) {
  double t1 = fmin (r->t + h, *stop), end = pw_narrow_end (r, t1);
  if (end >= t1) return 0;
  if (end - r->t < RESTART * last) {
    r->narrow->record[r->narrow->count].again = r->t;
    return 1;
  }
  *stop = end;
  return 0;
}

/* ---- Steps of fixed size ---- */

/* A time in the step where the signal differs from its initial value by at least half the largest difference, if
 * enclosures decide that; *peak: first, a time where it is not resolved. */
static void narrow_find_peak (const narrow_path *p, double t0, double t1, double *peak) {
  double u0 = path_value (p, t0), most = fabs (path_value (p, *peak) - u0);
  narrow_piece found;
  for (int k = 0; k < ATTEMPTS; k++) {
    const narrow_view see = { .lo = u0 - 2 * most - TINY, .hi = u0 + 2 * most + TINY };
    if (path_search (p, &see, t0, t1, &found)) return;
    double t = found.t0 + (found.t1 - found.t0) / 2, u = fabs (path_value (p, t) - u0);
    if (!(u > most)) return;
    *peak = t, most = u;
  }
}

/* The size of a step around `peak`, less than h, that resolves the signal: h / 2, h / 4, ... */
static double narrow_step (const narrow_path *p, double peak, double h) {
  double end, next, least = 64 * DBL_EPSILON * fabs (peak);
  do h /= 2;
  while (h > least && !path_is_resolved (p, peak - 0.3 * h, peak + 0.7 * h, &end, &next));
  return h;
}

/* Counts a step of fixed size if it does not resolve signal i; weight: the number of steps for which it stands. */
static void narrow_check_step (pw_run *r, int i, double t0, double t1, double weight) {
  const narrow_path p = { r, &r->narrow->signal[i], &r->narrow->record[i] };
  const pw_harmonic *harmonic = &p.signal->source->signal.harmonic;
  double end, peak, h = t1 - t0, step = h;
  if (p.signal->enclosure == PW_PERIODIC) {
    if (fabs (harmonic->omega) * h <= FIXED_HALF_PERIOD) return;
    p.record->miss = fabs (harmonic->amplitude), step = FIXED_HALF_PERIOD / fabs (harmonic->omega), weight = 1;
  } else {
    if (p.signal->enclosure == PW_ENCLOSED) weight = 1;
    if (weight == 0 || path_is_clear (&p, t0, t1) || path_is_resolved (&p, t0, t1, &end, &peak)) return;
    /* the first times, then at each power of 2 */
    if (p.record->steps < 2 * EVERY || frexp (p.record->steps + 1, &(int){ 0 }) == 0.5) {
      if (p.signal->enclosure == PW_ENCLOSED) narrow_find_peak (&p, t0, t1, &peak);
      step = narrow_step (&p, peak, h);
    }
  }
  p.record->steps += weight;
  p.record->step = fmin (p.record->step, step);
}

/* Checks the step that follows `number` others.  Of functions without `enclose`, the first steps and then every 16th
 * are checked, which stands for the 16 before.  What was missed is forgotten if it is a small part of |u| later. */
static void narrow_count_step (pw_run *r, double t0, double t1, long number, int of_states) {
  const double weight = number < EVERY ? 1 : number % EVERY == 0 ? EVERY : 0, end = pw_before_breakpoint (r, t1);
  pw_narrow *x = r->narrow;
  double most = 0;
  for (int i = 0; i < x->count; i++) {
    narrow_record *record = &x->record[i];
    if ((x->signal[i].reads > 0) <= of_states) narrow_check_step (r, i, t0, end, weight);
    if (record->miss < x->small * record->size) record->steps = 0, record->step = INFINITY;
    most = fmax (most, record->steps);
  }
  r->statistics.unresolved = (long)most;
}

void pw_narrow_count (pw_run *r, double t1) {
  pw_narrow *x = r->narrow;
  if (x == NULL || !x->fixed) return;
  narrow_record *all = &x->record[x->count];
  if (r->t >= all->clear - r->settings.step / 2) narrow_count_step (r, r->t, t1, r->statistics.steps, 1);
  all->clear = fmax (all->clear, t1);
}

int pw_narrow_count_several (pw_run *r, double h, int count) {
  pw_narrow *x = r->narrow;
  if (x == NULL) return count;
  narrow_record *all = &x->record[x->count];
  for (int i = 0; i < x->count; i++)
    if (x->signal[i].reads &&
        !path_is_straight (&(narrow_path){ r, &x->signal[i], &x->record[i] }, r->t, r->t + count * h, h))
      return 0;
  for (int k = 0; k < count; k++) {
    double t0 = r->t + k * h;
    if (t0 < all->clear - h / 2) continue; /* counted already */
    narrow_count_step (r, t0, t0 + h, r->statistics.steps + k, 0);
    all->clear = t0 + h;
  }
  return count;
}

long pw_run_unresolved (const pw_run *r, double *step, char *signal, size_t size) {
  const pw_narrow *x = r->narrow;
  int worst = 0;
  *step = INFINITY, *signal = 0;
  if (x == NULL || r->statistics.unresolved == 0) return 0;
  for (int i = 1; i < x->count; i++)
    if (x->record[i].step < x->record[worst].step) worst = i;
  *step = x->record[worst].step;
  pw_system_signal_name (r->s, (int)(x->signal[worst].source - r->w->source), signal, size);
  return r->statistics.unresolved;
}
