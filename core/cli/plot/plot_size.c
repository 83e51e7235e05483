/* The size of what figures show. */
#include <math.h>
#include "plot.h"

/* A rectangle [m]. */
typedef struct {
  double x0, x1, y0, y1;
} box;

void pw_plot_point (const double *motion, const double *at, double out[2]) {
  double c = cos (motion[2]), s = sin (motion[2]);
  out[0] = motion[0] + c * at[0] - s * at[1];
  out[1] = motion[1] + s * at[0] + c * at[1];
}

static void box_extend (box *b, const double *point) {
  if (!isfinite (point[0]) || !isfinite (point[1])) return;
  *b = (box){ fmin (b->x0, point[0]), fmax (b->x1, point[0]), fmin (b->y0, point[1]), fmax (b->y1, point[1]) };
}

/* All attachment points, centres of mass and wheels of a sample. */
static void box_extend_sample (const pw_plots *p, int i, box *b) {
  for (int k = 0; k < p->bodies.shown; k++) {
    const double *motion = pw_plot_track (p, i, &p->bodies, k);
    box_extend (b, motion);
    for (int n = 0; n < p->shape[k].count; n++) {
      double point[2];
      pw_plot_point (motion, p->shape[k].at[n], point);
      box_extend (b, point);
    }
  }
  for (int w = 0; w < p->wheels.shown; w++) box_extend (b, pw_plot_track (p, i, &p->wheels, w));
}

double pw_plot_diagonal (const pw_plots *p, int *n, double most) {
  box b = { INFINITY, -INFINITY, INFINITY, -INFINITY };
  double diagonal = 0;
  for (int g = 0; g < p->grounds && isinf (most); g++) box_extend (&b, p->ground[g]);
  for (int i = 0; i < *n; i++) {
    box_extend_sample (p, i, &b);
    diagonal = b.x1 >= b.x0 ? hypot (b.x1 - b.x0, b.y1 - b.y0) : 0;
    if (diagonal > most) *n = i;
  }
  return diagonal;
}

double pw_plot_size (const pw_plots *p) {
  int n = 1;
  double size = pw_plot_diagonal (p, &n, INFINITY);
  return size > 0 ? size : pw_system_length (p->s);
}

double pw_plot_unit (const pw_plots *p) {
  double reach = 0, size = pw_plot_size (p);
  for (int b = 0; b < p->bodies.shown; b++)
    for (int k = 0; k < p->shape[b].count; k++)
      reach = fmax (reach, hypot (p->shape[b].at[k][0], p->shape[b].at[k][1]));
  return 0.035 * (reach > 0 ? fmin (size, 4 * reach) : size);
}
