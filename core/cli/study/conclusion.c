/* The conclusion of a comparison: the processor time of each method for 3, 6 and 9 correct digits, interpolated on its
 * work-precision curve and relative to the cheapest method; then failures. */
#include <math.h>
#include <string.h>
#include "reference.h"

enum {
  CONCLUSION_LEVELS = 3,
  CONCLUSION_WIDTH = 14, /* of a column, at least */
  CONCLUSION_REASON = 70 /* characters of the reason of a failure, at most */
};
static const int conclusion_digits[CONCLUSION_LEVELS] = { 3, 6, 9 };

typedef struct {
  double cpu;  /* [s]; NaN: no run is as accurate */
  int at_most; /* 1: an upper bound, see conclusion_cost */
} cost;

typedef struct {
  const pw_study *study;
  const pw_reference *reference;
  int column;         /* of the rows: the largest error of lengths, then of angles */
  double uncertainty; /* of the reference, as an error */
  int width;          /* of the names of methods */
  int best[CONCLUSION_LEVELS];
  cost cheapest[CONCLUSION_LEVELS];
} conclusion;

/* ---- Errors ---- */

/* Lengths are relative to the largest one of the motion; angles too, unless it exceeds 1 rad. */
static double conclusion_scale (const pw_reference *ref, int unit) {
  double size = ref->size[unit] > 0 ? ref->size[unit] : 1;
  return unit == MOTION_ANGLE ? fmin (size, 1) : size;
}

/* The larger of the relative errors of lengths and angles, as far as they are compared; NaN if one is unknown. */
static double conclusion_error (const pw_reference *ref, const double *of) {
  double most = 0;
  for (int unit = MOTION_LENGTH; unit <= MOTION_ANGLE; unit++) {
    double error = of[unit] / conclusion_scale (ref, unit);
    if (ref->uncertainty[MOTION_MOST + unit] > 0 && !(error <= most) && !isnan (most)) most = error;
  }
  return most;
}

static double conclusion_level (int k) {
  return pow (10, -conclusion_digits[k]);
}

/* ---- Costs ---- */

/* The least processor time of a method for this error, interpolated between neighbouring runs on logarithmic scales.  Upper
 * bounds are the time of a run without a less accurate one before it, and an interpolation to an error that is only known to
 * be below the uncertainty. */
static cost conclusion_cost (const conclusion *x, int line, double level) {
  cost least = { NAN, 0 };
  double before = NAN;
  int coarser = 0; /* 1: a run before is less accurate */
  const pw_study *s = x->study;
  for (const pw_row *r = s->row; r < s->row + s->rows; r++) {
    if (r->line != line) continue;
    double here = r->state == ROW_DONE ? conclusion_error (x->reference, r->value + x->column) : NAN;
    cost c = { here <= level ? r->cpu : NAN, !coarser };
    if (here <= level && before > level) {
      double cpu = r[-1].cpu * pow (r->cpu / r[-1].cpu, log (level / before) / log (here / before));
      c = (cost){ fmin (cpu, r->cpu), here <= x->uncertainty };
    }
    if (c.cpu > 0 && !(least.cpu <= c.cpu)) least = c;
    coarser |= here > level;
    before = here;
  }
  return least;
}

/* The cheapest method of each level that the reference can distinguish. */
static void conclusion_find (conclusion *x) {
  for (int k = 0; k < CONCLUSION_LEVELS; k++) {
    x->best[k] = -1;
    x->cheapest[k].cpu = NAN;
    for (int i = 0; i < x->study->methods && x->uncertainty <= conclusion_level (k); i++) {
      cost c = conclusion_cost (x, i, conclusion_level (k));
      if (isnan (c.cpu) || x->cheapest[k].cpu <= c.cpu) continue;
      x->cheapest[k] = c;
      x->best[k] = i;
    }
  }
}

/* ---- Table ---- */

static void conclusion_heading (const conclusion *x) {
  static const char *const unit[] = { "m", "rad" }, *const name[] = { "lengths", "angles" };
  const pw_reference *ref = x->reference;
  const char *between = "";
  char text[32];
  printf ("Processor time for 3, 6 and 9 correct digits, relative to the cheapest method.\n"
          "Digits: the largest error of a coordinate at %d times up to %s s, relative to\n",
          ref->motion.samples, pw_format (text, x->study->t_end, 6));
  for (int i = MOTION_LENGTH; i <= MOTION_ANGLE; i++)
    if (ref->uncertainty[MOTION_MOST + i] > 0) {
      printf ("%s%s %s (%s)", between, pw_format (text, conclusion_scale (ref, i), 3), unit[i], name[i]);
      between = ", ";
    }
  printf (". The reference has %.1f digits%s.\n\n", -log10 (x->uncertainty),
          x->study->reference_path ? " if its table is exact" : "");
}

/* "1.5 ms", "<0.2 ms", "-" */
static char *conclusion_time (char text[40], cost c) {
  char number[32];
  int ms = c.cpu < 1;
  snprintf (text, 40, "%s%s %s", c.at_most ? "<" : "", pw_format (number, ms ? 1e3 * c.cpu : c.cpu, 2),
            ms ? "ms" : "s");
  return isnan (c.cpu) ? strcpy (text, "-") : text;
}

static char *conclusion_ratio (char text[40], const conclusion *x, int method, int k) {
  cost c = conclusion_cost (x, method, conclusion_level (k));
  double ratio = c.cpu / x->cheapest[k].cpu;
  snprintf (text, 40, "%s%.*f", c.at_most ? "<" : "", ratio < 9.95, ratio);
  if (x->uncertainty > conclusion_level (k)) return strcpy (text, "uncertain");
  return isnan (c.cpu) ? strcpy (text, "not reached") : text;
}

/* The cheapest methods, their times, then a line for each method. */
static void conclusion_table (const conclusion *x) {
  char text[40];
  int most = 0, uncertain = 0;
  printf ("%-*s", x->width, "");
  for (int k = 0; k < CONCLUSION_LEVELS; k++) printf ("  %*d digits", x->width - 7, conclusion_digits[k]);
  printf ("\n%-*s", x->width, "cheapest");
  for (int k = 0; k < CONCLUSION_LEVELS; k++)
    printf ("  %*s", x->width, x->best[k] < 0 ? "-" : x->study->method[x->best[k]]);
  printf ("\n%-*s", x->width, "its time");
  for (int k = 0; k < CONCLUSION_LEVELS; k++) printf ("  %*s", x->width, conclusion_time (text, x->cheapest[k]));
  for (int i = 0; i < x->study->methods; i++) {
    printf ("\n%-*s", x->width, x->study->method[i]);
    for (int k = 0; k < CONCLUSION_LEVELS; k++) {
      printf ("  %*s", x->width, conclusion_ratio (text, x, i, k));
      most |= *text == '<';
      uncertain |= *text == 'u';
    }
  }
  puts (most ? "\n<: at most: no run has fewer digits, or the reference cannot tell how many the next one has" : "");
  if (uncertain) puts ("uncertain: the reference is not accurate enough to distinguish methods");
}

/* ---- Runs that do not reach the end ---- */

/* The number of runs of a method in these states, bits 1 << ROW_DONE etc., and the first of them or NULL. */
static int conclusion_count (const pw_study *x, int line, unsigned states, const pw_row **first) {
  int count = 0;
  *first = NULL;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    if (r->line == line && states >> r->state & 1 && count++ == 0) *first = r;
  return count;
}

static void conclusion_failure (const pw_study *x, int line) {
  char text[32];
  const pw_row *first, *any;
  int failures = conclusion_count (x, line, 1u << ROW_FAILED | 1u << ROW_REFUSED, &first);
  if (first == NULL) return;
  int cut = strlen (first->reason) > CONCLUSION_REASON;
  pw_cli_print (stdout, "%s: %d of %d runs %s, first at %s %s: %.*s%s\n", first->method, failures,
                conclusion_count (x, line, ~0u, &any), first->state == ROW_FAILED ? "fail" : "are refused",
                first->adaptive ? "rtol" : "step", pw_format (text, first->level, 4), CONCLUSION_REASON, first->reason,
                cut ? "..." : "");
}

/* One line for all methods that the limit has ended. */
static void conclusion_limit (const pw_study *x) {
  char text[32];
  int found = 0;
  for (int i = 0; i < x->methods; i++) {
    const pw_row *first;
    conclusion_count (x, i, 1u << ROW_STOPPED | 1u << ROW_SKIPPED, &first);
    if (first == NULL) continue;
    if (found++ == 0)
      printf ("stopped by the limit of %s s: ", pw_format (text, x->cpu_end, 4));
    else
      printf (", ");
    printf ("%s from %s", first->method, pw_format (text, first->level, 4));
  }
  if (found) putchar ('\n');
}

void pw_conclusion_print (const pw_study *s, const pw_reference *ref, int column) {
  conclusion x = { .study = s, .reference = ref, .column = column, .width = CONCLUSION_WIDTH };
  x.uncertainty = conclusion_error (ref, ref->uncertainty + MOTION_MOST);
  for (int i = 0; i < s->methods; i++)
    if ((int)strlen (s->method[i]) > x.width) x.width = (int)strlen (s->method[i]);
  conclusion_find (&x);
  conclusion_heading (&x);
  conclusion_table (&x);
  for (int i = 0; i < s->methods; i++) conclusion_failure (s, i);
  conclusion_limit (s);
}
