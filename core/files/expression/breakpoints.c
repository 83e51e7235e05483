/* Breakpoints: times at which an expression jumps or has a kink.
 *
 * An interval of time is excluded if interval arithmetic proves that in it, wherever the value depends on them, the
 * discrete parts of operations stay the same (the result of a comparison, the sign of the operand of abs, and so on),
 * and no operand of a comparison, sign, min or max becomes NaN at the end of a function's domain.
 * Otherwise it is bisected, the earlier half first, down to a least width, at first 2^-36 |t| (Moore, Kearfott &
 * Cloud 2009, Introduction to Interval Analysis, chapter 8).  If an operation differs between the ends of such an
 * interval, bisection finds the two adjacent floating-point numbers between which it changes: steps must end there.
 * Changes that cancel within the least width are ignored.  So are those of noisy operations, which change too often
 * for steps to end there.  The least width doubles where many intervals of that width could not be excluded although
 * nothing changes in them, as while two compared numbers stay equal. */
#include <math.h>
#include "expression_parts.h"
#include "pinwheel.h"

#define LATEST 1e18                  /* breakpoints after it are not found [s] */
#define FIRST_WIDTH 1e-9             /* of the first interval, relative to 1 s + |t|; each next one is twice as wide */
#define LEAST_WIDTH 0x1p-36          /* initial value of search.least_width */
#define GREATEST_LEAST_WIDTH 0x1p-10 /* to which it grows */
#define SMALLEST_INTERVAL 1e-18      /* [s]: not bisected either, for t near 0 */
enum { NOISE_CHANGES = 8 };          /* more changes in an interval of the least width and just after it are noise */
enum { NOISE_SAMPLES = 256 };        /* times in the interval at which changes are counted; as many again after it */
#define NOISE_WIDTH 1e-6             /* of the time after the interval, relative to 1 s + |t| */
#define NOISE_DURATION 1e-2          /* for which changes of a noisy operation are ignored, relative to 1 s + |t| */

typedef struct {
  const pw_expression *expression;
  double from;                              /* time at which the search begins */
  int remaining;                            /* intervals that may still be tested */
  int undecided;                            /* intervals so far of the least width, not excluded, without a change */
  int undecided_to_double;                  /* number of these after which the least width doubles */
  double least_width;                       /* w: intervals up to w (|t| + w 1 s) are not bisected; w^2: for t near 0 */
  double noise_end;                         /* time until which noisy operations are ignored; INFINITY: none is noisy */
  unsigned char noisy[PW_EXPRESSION_CODES]; /* 1: this operation is noisy */
} search;

/* Evaluates the discrete part of all operations at time t, with states 0 (pw_expression_run_jet). */
static void search_evaluate (const search *s, double t, double *discrete) {
  double variable[PW_EXPRESSION_VARIABLES] = { t }, u[3];
  pw_expression_run_jet (s->expression, variable, PW_EXPRESSION_TIME, u, discrete);
}

static int search_changed (double a, double b) {
  return a != b && !(isnan (a) && isnan (b));
}

/* Whether an operation that is not noisy differs between two times. */
static int search_differ (const search *s, double a, double b) {
  double before[PW_EXPRESSION_CODES], after[PW_EXPRESSION_CODES];
  search_evaluate (s, a, before);
  search_evaluate (s, b, after);
  for (int i = 0; i < s->expression->codes; i++)
    if (!s->noisy[i] && search_changed (before[i], after[i])) return 1;
  return 0;
}

/* Bisects to adjacent floating-point numbers; returns the one after the change. */
static double search_bisect (const search *s, double a, double b) {
  const double first = a;
  for (double middle = a + (b - a) / 2; middle > a && middle < b; middle = a + (b - a) / 2)
    if (search_differ (s, first, middle))
      b = middle;
    else
      a = middle;
  return b;
}

/* Marks operations as noisy by their changes between a and b and just after b.  Returns whether it marked any. */
static int search_mark_noisy (search *s, double a, double b) {
  const double after = NOISE_WIDTH * (1 + fabs (b));
  double value[2][PW_EXPRESSION_CODES];
  short changes[PW_EXPRESSION_CODES] = { 0 };
  int marked = 0;
  search_evaluate (s, a, value[0]);
  for (int k = 1; k <= 2 * NOISE_SAMPLES; k++) {
    double part = (double)k / NOISE_SAMPLES, t = part <= 1 ? a + (b - a) * part : b + after * (part - 1);
    search_evaluate (s, t, value[k % 2]);
    for (int i = 0; i < s->expression->codes; i++)
      if (search_changed (value[0][i], value[1][i]) && ++changes[i] > NOISE_CHANGES && !s->noisy[i])
        s->noisy[i] = 1, marked = 1;
  }
  if (marked) s->noise_end = fmin (s->noise_end, b + NOISE_DURATION * (1 + fabs (b)));
  return marked;
}

/* The first breakpoint between a and b, or INFINITY; at the limit of the search, a time up to which there is none. */
static double search_first (search *s, double a, double b) {
  if (s->remaining-- <= 0) return fmax (a, nextafter (s->from, INFINITY));
  if (!pw_expression_range (s->expression, s->noisy, a, b).breaks) return INFINITY;
  if (b - a <= s->least_width * (fmax (fabs (a), fabs (b)) + s->least_width) + SMALLEST_INTERVAL) {
    if (search_differ (s, a, b)) return search_mark_noisy (s, a, b) ? search_first (s, a, b) : search_bisect (s, a, b);
    if (++s->undecided % s->undecided_to_double == 0) s->least_width = fmin (2 * s->least_width, GREATEST_LEAST_WIDTH);
    return INFINITY;
  }
  double middle = a + (b - a) / 2, first = search_first (s, a, middle);
  return first < INFINITY ? first : search_first (s, middle, b);
}

double pw_expression_breakpoint (const pw_expression *expression, double t) {
  search s = { .expression = expression, .from = t, .least_width = LEAST_WIDTH, .noise_end = INFINITY };
  s.remaining = 400 + 4000000 / (100 + expression->codes); /* so that the time of a search has a bound */
  s.undecided_to_double = 1 + s.remaining / 120;           /* 26 doublings, 2^-36 to 2^-10, before the limit */
  double a = t, found = INFINITY;
  if (!expression->breaks) return INFINITY;
  for (double width = FIRST_WIDTH * (1 + fabs (t)); a < LATEST && found == INFINITY; width *= 2) {
    if (a >= s.noise_end || !pw_expression_range (expression, s.noisy, a, LATEST).breaks) break;
    found = search_first (&s, a, a + width);
    a += width;
  }
  return fmin (found, s.noise_end); /* noise_end is no breakpoint, but a new search begins there */
}
