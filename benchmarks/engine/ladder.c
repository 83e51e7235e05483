/* Runs of a method at decreasing steps or tolerances, and the cost of an accuracy; see ladder.h. */
#include "ladder.h"

void ladder_take (ladder *l, void *scene, const double *reference, int n, double *q, int round, int i) {
  ladder_point *p = &l->point[i];
  double start = timing_now ();
  p->level = l->first * pow (l->factor, i);
  p->evaluations = l->run (scene, l, p->level, q);
  p->cpu[round] = timing_now () - start;
  p->error = 0;
  for (int j = 0; j < n; j++)
    if (j % 3 < 2) p->error = isnan (q[j]) ? NAN : fmax (p->error, fabs (q[j] - reference[j]));
}

void ladder_sort (ladder *l) {
  for (int k = 0; k < l->count; k++) timing_median (l->point[k].cpu, LADDER_ROUNDS);
}

/* The value that belongs to an error, from the least-squares line through the points whose errors are within a
 * factor of 100 of it. */
static double ladder_line (const ladder *l, const double *value, double error) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, least = INFINITY;
  for (int k = 0; k < l->count; k++) {
    double x = log (l->point[k].error / error), y = log (value[k]);
    least = fmin (least, l->point[k].error); /* a run that failed has none */
    if (!(fabs (x) < log (100))) continue;
    n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return n < 2 || least > error ? 0 : exp ((sy - slope * sx) / n);
}

double ladder_time (const ladder *l, double error) {
  double value[LADDER_LEVELS];
  for (int k = 0; k < l->count; k++) value[k] = l->point[k].cpu[LADDER_ROUNDS / 2];
  return ladder_line (l, value, error);
}

double ladder_evaluations (const ladder *l, double error) {
  double value[LADDER_LEVELS];
  for (int k = 0; k < l->count; k++) value[k] = l->point[k].evaluations;
  return ladder_line (l, value, error);
}
