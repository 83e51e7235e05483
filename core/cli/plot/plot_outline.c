/* The outline of a body in figures: the convex hull of its attachment points and its centre of mass, by gift wrapping
 * (Jarvis 1973). */
#include <math.h>
#include <string.h>
#include "plot.h"

/* Twice the area of the triangle a b c, positive if they go round to the left. */
static double outline_turn (const double *a, const double *b, const double *c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Of what lies in one direction the farthest is the corner. */
static int outline_before (const double *from, const double *best, const double *p, double flat) {
  double turn = outline_turn (from, best, p);
  if (fabs (turn) > flat) return turn < 0;
  return hypot (p[0] - from[0], p[1] - from[1]) > hypot (best[0] - from[0], best[1] - from[1]);
}

void pw_plot_outline (pw_plot_body *shape) {
  double p[PLOT_POINTS + 1][2] = { { 0, 0 } }, size = 0;
  int n = shape->count + 1, at = 0;
  memcpy (p + 1, shape->at, (size_t)shape->count * sizeof *p);
  for (int i = 0; i < n; i++) {
    size = fmax (size, hypot (p[i][0], p[i][1]));
    if (p[i][0] < p[at][0] || (p[i][0] == p[at][0] && p[i][1] < p[at][1])) at = i;
  }
  const int first = at;
  shape->corners = 0;
  do {
    int next = at == 0 ? 1 : 0;
    memcpy (shape->corner[shape->corners++], p[at], sizeof *p);
    for (int i = 0; i < n && n > 1; i++)
      if (i != at && i != next && outline_before (p[at], p[next], p[i], 1e-9 * size * size)) next = i;
    at = n > 1 ? next : first;
  } while (at != first && shape->corners < n);
  if (shape->corners < 3) shape->corners = 0;
}

int pw_plot_inside (const pw_plot_body *shape, int k) {
  for (int i = 0; i < shape->corners; i++)
    if (memcmp (shape->corner[i], shape->at[k], sizeof shape->at[k]) == 0) return 0;
  return 1;
}
