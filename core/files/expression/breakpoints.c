/* Breakpoints: times at which an expression jumps or has a kink.
 *
 * Interval arithmetic shows that no comparison or other discontinuous operation changes in an interval of time, and that
 * none of its operands leaves the domain of a function, where comparisons with NaN become false; otherwise the interval
 * is bisected, the earlier half first, down to a relative width of 2^-36 (Moore, Kearfott & Cloud 2009, Introduction to
 * Interval Analysis, chapter 8).  Bisection then finds the two adjacent floating-point numbers between which an operation
 * changes: steps must end there.  Changes that cancel within this width, and changes by round-off only, are ignored.
 * While two compared numbers stay equal, the width grows. */
#include <math.h>
#include "expression_parts.h"
#include "pinwheel.h"

typedef struct {
  const pw_expression *x;
  double from;
  int remaining;                            /* intervals that may still be tested */
  int equal;                                /* intervals of the least width without a change */
  int max_equal;                            /* number of these after which `min_width` doubles */
  double min_width;                         /* relative width below which intervals are not bisected */
  double noise_end;                         /* end of the noise; INFINITY without noisy operations */
  unsigned char noisy[PW_EXPRESSION_CODES]; /* per operation: 1: changes too often for steps to end there */
} search;

/* Evaluates all discrete operations (comparisons and the like) at a time. */
static void search_evaluate (const search *s, double t, double *discrete) {
  double variable[PW_EXPRESSION_VARIABLES] = { t }, u[3];
  pw_expression_run_jet (s->x->code, s->x->codes, variable, 0, u, discrete);
}

static int search_changed (double a, double b) {
  return a != b && !(isnan (a) && isnan (b));
}

/* Whether an operation that is not noisy differs between two times. */
static int search_differ (const search *s, double a, double b) {
  double before[PW_EXPRESSION_CODES], after[PW_EXPRESSION_CODES];
  search_evaluate (s, a, before);
  search_evaluate (s, b, after);
  for (int i = 0; i < s->x->codes; i++)
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

/* Marks operations as noisy that change more than 8 times between a and b, or just after b: by round-off of equal numbers,
 * or too fast for any step.  Returns whether it marked any. */
static int search_mark_noisy (search *s, double a, double b) {
  const double width = 1e-6 * (1 + fabs (b));
  double value[2][PW_EXPRESSION_CODES];
  short changes[PW_EXPRESSION_CODES] = { 0 };
  int marked = 0;
  search_evaluate (s, a, value[0]);
  for (int k = 1; k <= 512; k++) {
    search_evaluate (s, k <= 256 ? a + (b - a) * (k / 256.0) : b + width * (k / 256.0 - 1), value[k % 2]);
    for (int i = 0; i < s->x->codes; i++)
      if (search_changed (value[0][i], value[1][i]) && ++changes[i] > 8 && !s->noisy[i]) s->noisy[i] = 1, marked = 1;
  }
  if (marked) s->noise_end = fmin (s->noise_end, b + 1e-2 * (1 + fabs (b)));
  return marked;
}

static double search_first (search *s, double a, double b) {
  if (s->remaining-- <= 0) return fmax (a, nextafter (s->from, INFINITY));
  if (!pw_expression_range (s->x, s->noisy, a, b).breaks) return INFINITY;
  if (b - a <= s->min_width * (fmax (fabs (a), fabs (b)) + s->min_width) + 1e-18) {
    if (search_differ (s, a, b)) return search_mark_noisy (s, a, b) ? search_first (s, a, b) : search_bisect (s, a, b);
    if (++s->equal % s->max_equal == 0) s->min_width = fmin (2 * s->min_width, 0x1p-10);
    return INFINITY;
  }
  double middle = a + (b - a) / 2, first = search_first (s, a, middle);
  return first < INFINITY ? first : search_first (s, middle, b);
}

/* At the limit of the search, or with noise, returns a time that need not be a breakpoint; the next call continues there. */
double pw_expression_breakpoint (const pw_expression *x, double t) {
  const double latest = 1e18;
  search s = {
    .x = x, .from = t, .remaining = 400 + 4000000 / (100 + x->codes), .min_width = 0x1p-36, .noise_end = INFINITY
  };
  s.max_equal = 1 + s.remaining / 120; /* all 26 doublings, to 2^-10, before the limit */
  double a = t, found = INFINITY;
  if (!x->breaks) return INFINITY;
  for (double w = 1e-9 * (1 + fabs (t)); a < latest && found == INFINITY; w *= 2) {
    if (a >= s.noise_end || (s.noise_end == INFINITY && !pw_expression_range (x, s.noisy, a, latest).breaks)) break;
    found = search_first (&s, a, a + w);
    a += w;
  }
  return fmin (found, s.noise_end);
}
