/* Ladders of runs; see ladder.h. */
#include "ladder.h"

double ladder_rung (const ladder *l, int i) {
  return l->first * pow (l->factor, i);
}

void ladder_take (ladder *l, void *scene, const double *reference, int n, double *q, int round, int level) {
  ladder_point *p = &l->point[level];
  double start = timing_now ();
  p->level = ladder_rung (l, level);
  p->evaluations = l->run (scene, l, p->level, q);
  p->cpu[round] = timing_now () - start;
  p->error = 0;
  for (int j = 0; j < n; j++)
    if (j % 3 < 2) p->error = isnan (q[j]) ? NAN : fmax (p->error, fabs (q[j] - reference[j]));
}

void ladder_sort (ladder *l, int rounds) {
  for (int k = 0; k < l->count; k++) timing_median (l->point[k].cpu, rounds);
}

/* The value at which the line through the points within a factor 100 of the error meets it. */
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

double ladder_time (const ladder *l, double error, int rounds) {
  double value[LADDER_RUNGS];
  for (int k = 0; k < l->count; k++) value[k] = l->point[k].cpu[rounds / 2];
  return ladder_line (l, value, error);
}

double ladder_evaluations (const ladder *l, double error) {
  double value[LADDER_RUNGS];
  for (int k = 0; k < l->count; k++) value[k] = l->point[k].evaluations;
  return ladder_line (l, value, error);
}
