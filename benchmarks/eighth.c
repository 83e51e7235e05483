/* eighth: what an accuracy costs on the EzyRoller, 100 s, against an 8th-order program written by hand.
 *
 *   by hand       the tableau of erk8, fixed steps, a projection each, right-hand side and projection by hand
 *   same rhs      the same program on Pinwheel's right-hand side and projection
 *   erk8, ida     Pinwheel's adaptive methods
 *
 * Each goes down a ladder; the time for an error of 1e-6 and 1e-9 m is read off a line through its points nearby (least
 * squares of the logarithms).  All points are taken in turns, so that a machine that is slow for a while is slow for
 * all.  With an argument, writes the points there as CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine/engine.h"

#define pw_method_erk8 eighth_unused
#include "erk8.c"
#undef pw_method_erk8

enum { EIGHTH_SECONDS = 100, EIGHTH_ROUNDS = 7, EIGHTH_RUNGS = 24, EIGHTH_WAYS = 4, EIGHTH_TARGETS = 2 };
static const double eighth_target[EIGHTH_TARGETS] = { 1e-6, 1e-9 }; /* [m] */
static const ezy_tableau eighth_tableau = { 12, erk8_c, erk8_A, erk8_b };

typedef struct {
  double rung, error, cpu[EIGHTH_ROUNDS]; /* step [s] or tolerance; [m]; [s] */
} eighth_point;

typedef struct {
  ezy hand;
  pw_system *system;
  pw_run *run; /* lends its right-hand side */
  pw_projector projector;
  double q[9], v[9], a[9]; /* as long as Pinwheel's own */
  double truth[6];
} eighth_scene;

/* One way to go down a ladder: from `first`, by `factor`. */
typedef struct {
  const char *name, *method;
  double first, factor;
  int count;
  void (*run) (eighth_scene *s, const char *method, double rung, double q[6]);
  eighth_point point[EIGHTH_RUNGS];
} eighth_way;

/* ---- By hand ---- */

static void eighth_rate (void *context, double t, const double *q, const double *v, double *a, double *lambda) {
  const ezy *e = context;
  (e->p.m2 > 0 ? ezy_massive : ezy_massless) (e, t, q, v, a, lambda);
}

static void eighth_project (void *context, double t, double *q, double *v, ezy_state *s) {
  ezy_project (context, t, q, v, s);
}

static void eighth_drive (const eighth_scene *s, const ezy_dynamics *d, double h, double q[6]) {
  ezy_state state;
  ezy_start (&s->hand, &state);
  long steps = lround (EIGHTH_SECONDS / h);
  for (long i = 1; i <= steps; i++) ezy_step (&eighth_tableau, d, EIGHTH_SECONDS * (double)i / (double)steps, &state);
  memcpy (q, state.q, sizeof state.q);
}

static void eighth_by_hand (eighth_scene *s, const char *method, double h, double q[6]) {
  (void)method;
  eighth_drive (s, &(ezy_dynamics){ eighth_rate, eighth_project, &s->hand }, h, q);
}

/* ---- The same on Pinwheel's right-hand side ---- */

static void eighth_copy (double *to, const double *from) {
  for (int j = 0; j < 6; j++) to[j] = from[j];
}

static void eighth_our_rate (void *context, double t, const double *q, const double *v, double *a, double *lambda) {
  eighth_scene *s = context;
  eighth_copy (s->q, q);
  eighth_copy (s->v, v);
  pw_accelerate (s->run, t, s->q, s->v, s->a, lambda);
  eighth_copy (a, s->a);
}

static void eighth_our_project (void *context, double t, double *q, double *v, ezy_state *to) {
  eighth_scene *s = context;
  eighth_copy (s->q, q);
  eighth_copy (s->v, v);
  pw_project_state (&s->projector, s->run, t, s->q, s->v, s->a, to->lambda);
  to->t = t;
  eighth_copy (to->q, s->q);
  eighth_copy (to->v, s->v);
  eighth_copy (to->a, s->a);
}

static void eighth_same_rhs (eighth_scene *s, const char *method, double h, double q[6]) {
  (void)method;
  eighth_drive (s, &(ezy_dynamics){ eighth_our_rate, eighth_our_project, s }, h, q);
}

/* ---- Pinwheel ---- */

static void eighth_ours (eighth_scene *s, const char *method, double rtol, double q[6]) {
  pw_error error = { 0 };
  pw_sample sample;
  pw_run *r = engine_open (s->system, method, &(pw_settings){ .rtol = rtol, .span = EIGHTH_SECONDS });
  while (pw_time (r) < EIGHTH_SECONDS)
    if (pw_advance (r, EIGHTH_SECONDS, &error) != PW_OK) engine_die (method, error.text);
  if (pw_at (r, EIGHTH_SECONDS, &sample, &error) != PW_OK) engine_die (method, error.text);
  eighth_copy (q, sample.q);
  pw_close (r);
}

/* ---- Scenes ---- */

static void eighth_open (eighth_scene *s, int massless) {
  ezy_model p = { 0.5, 0.5, 0.125, 0.125, 1, 0.1, massless ? 0 : 0.1, massless ? 0 : 0.01, 0.1, PW_PI };
  pw_error error = { 0 };
  ezy_open (&s->hand, &p);
  s->system = engine_ezyroller (massless);
  s->run = engine_open (engine_ezyroller (massless), "rk4+none", &(pw_settings){ .span = EIGHTH_SECONDS });
  if (pw_projector_open (&s->projector, s->run, s->run->s->metric, NULL, &error) != PW_OK)
    engine_die ("projector", error.text);
  eighth_by_hand (s, NULL, 0.0125, s->truth);
}

static void eighth_close (eighth_scene *s) {
  pw_system *lent = s->run->s;
  pw_projector_close (&s->projector);
  pw_close (s->run);
  pw_free (lent);
  pw_free (s->system);
}

/* ---- Measuring ---- */

static void eighth_measure (eighth_scene *s, eighth_way *w, int round, int rung) {
  static const int length[] = { 0, 1, 3, 4 };
  eighth_point *p = &w->point[rung];
  double q[6], start = timing_now ();
  p->rung = w->first * pow (w->factor, rung);
  w->run (s, w->method, p->rung, q);
  p->cpu[round] = timing_now () - start;
  p->error = 0;
  for (int i = 0; i < 4; i++) p->error = fmax (p->error, fabs (q[length[i]] - s->truth[length[i]]));
}

/* The time at which the line through the points within a factor 100 of the target has its error; 0: it is not reached. */
static double eighth_time (const eighth_way *w, double target) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, least = INFINITY;
  for (const eighth_point *p = w->point; p < w->point + w->count; p++) {
    double x = log (p->error / target), y = log (p->cpu[EIGHTH_ROUNDS / 2]);
    least = fmin (least, p->error);
    if (!(fabs (x) < log (100))) continue;
    n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return n < 2 || least > target ? 0 : exp ((sy - slope * sx) / n);
}

static void eighth_put (const char *scene, const eighth_way *w, FILE *csv) {
  for (const eighth_point *p = w->point; p < w->point + w->count; p++)
    fprintf (csv, "%s,%s,point,%.9g,%.9g,%.9g\n", scene, w->name, p->rung, p->error, p->cpu[EIGHTH_ROUNDS / 2]);
  for (int j = 0; j < EIGHTH_TARGETS; j++)
    if (eighth_time (w, eighth_target[j]) > 0)
      fprintf (csv, "%s,%s,line,nan,%.9g,%.9g\n", scene, w->name, eighth_target[j], eighth_time (w, eighth_target[j]));
}

static void eighth_print (const eighth_way *w, const eighth_way *ours) {
  printf ("  %-40s", w->name);
  for (int j = 0; j < EIGHTH_TARGETS; j++) {
    double time = eighth_time (w, eighth_target[j]);
    if (time > 0)
      printf ("  %8.3f (%6.3f)", 1e3 * time, eighth_time (ours, eighth_target[j]) / time);
    else
      printf ("  %8s  %6s ", "never", "");
  }
  putchar ('\n');
}

static eighth_way eighth_ways[EIGHTH_WAYS] = {
  { .name = "by hand", .first = 0.5, .factor = 0.8, .count = 14, .run = eighth_by_hand },
  { .name = "by hand on Pinwheel's right-hand side", .first = 0.5, .factor = 0.8, .count = 14, .run = eighth_same_rhs },
  { .name = "erk8+projection",
    .method = "erk8+projection",
    .first = 1e-5,
    .factor = 0.4,
    .count = 19,
    .run = eighth_ours },
  { .name = "ida+ggl", .method = "ida+ggl", .first = 1e-6, .factor = 0.4, .count = 15, .run = eighth_ours },
};

static void eighth_case (int massless, FILE *csv) {
  const char *scene = massless ? "massless" : "massive";
  eighth_way *way = eighth_ways;
  eighth_scene s;
  eighth_open (&s, massless);
  for (int round = 0; round < EIGHTH_ROUNDS; round++)
    for (int i = 0; i < EIGHTH_WAYS; i++)
      for (int k = 0; k < way[i].count; k++) eighth_measure (&s, &way[i], round, k);
  printf ("\nsteering %s: processor time [ms] for an error of the lengths after %d s\n"
          "(in brackets how many times that erk8+projection takes)\n  %-40s  %-17s  %s\n",
          scene, EIGHTH_SECONDS, "", "   1e-6 m", "   1e-9 m");
  for (int i = 0; i < EIGHTH_WAYS; i++)
    for (int k = 0; k < way[i].count; k++) timing_median (way[i].point[k].cpu, EIGHTH_ROUNDS);
  for (int i = 0; i < EIGHTH_WAYS; i++) {
    eighth_print (&way[i], &way[2]);
    if (csv) eighth_put (scene, &way[i], csv);
  }
  eighth_close (&s);
}

int main (int argc, char **argv) {
  FILE *csv = argc > 1 ? fopen (argv[1], "w") : NULL;
  if (argc > 1 && csv == NULL) engine_die (argv[1], "cannot be written");
  if (csv) fputs ("steering,program,what,rung,error_m,cpu_s\n", csv);
  puts ("EzyRoller: erk8+projection against an 8th-order program by hand");
  eighth_case (1, csv);
  eighth_case (0, csv);
  return csv && fclose (csv) != 0;
}
