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
#include "engine/ladder.h"

#define pw_method_erk8 eighth_unused
#include "erk8.c"
#undef pw_method_erk8

enum { EIGHTH_SECONDS = 100, EIGHTH_ROUNDS = 7, EIGHTH_WAYS = 4, EIGHTH_TARGETS = 2 };
static const double eighth_target[EIGHTH_TARGETS] = { 1e-6, 1e-9 }; /* [m] */
static const ezy_tableau eighth_tableau = { 12, erk8_c, erk8_A, erk8_b };

typedef struct {
  ezy hand;
  pw_system *system;
  pw_run *run; /* lends its right-hand side */
  pw_projector projector;
  double q[9], v[9], a[9]; /* as long as Pinwheel's own */
  double reference[6];
} eighth_scene;

/* ---- By hand ---- */

static void eighth_rate (void *context, double t, const double *q, const double *v, double *a, double *lambda) {
  const ezy *e = context;
  (e->p.m2 > 0 ? ezy_massive : ezy_massless) (e, t, q, v, a, lambda);
}

static void eighth_project (void *context, double t, double *q, double *v, ezy_state *s) {
  ezy_project (context, t, q, v, s);
}

static double eighth_drive (const eighth_scene *s, const ezy_dynamics *d, double h, double *q) {
  ezy_state state;
  ezy_start (&s->hand, &state);
  long steps = lround (EIGHTH_SECONDS / h);
  for (long i = 1; i <= steps; i++) ezy_step (&eighth_tableau, d, EIGHTH_SECONDS * (double)i / (double)steps, &state);
  memcpy (q, state.q, sizeof state.q);
  return 12.0 * (double)steps + 1;
}

static double eighth_by_hand (void *scene, const ladder *way, double h, double *q) {
  eighth_scene *s = scene;
  (void)way;
  return eighth_drive (s, &(ezy_dynamics){ eighth_rate, eighth_project, &s->hand }, h, q);
}

/* ---- The same on Pinwheel's right-hand side ---- */

static void eighth_copy (double *to, const double *from) {
  for (int j = 0; j < 6; j++) to[j] = from[j];
}

static void eighth_our_rate (void *context, double t, const double *q, const double *v, double *a, double *lambda) {
  eighth_scene *s = context;
  eighth_copy (s->q, q);
  eighth_copy (s->v, v);
  pw_run_accelerate (s->run, t, s->q, s->v, s->a, lambda);
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

static double eighth_same_rhs (void *scene, const ladder *way, double h, double *q) {
  eighth_scene *s = scene;
  (void)way;
  return eighth_drive (s, &(ezy_dynamics){ eighth_our_rate, eighth_our_project, s }, h, q);
}

/* ---- Pinwheel ---- */

static double eighth_ours (void *scene, const ladder *way, double rtol, double *q) {
  eighth_scene *s = scene;
  const char *method = way->method;
  pw_error error = { 0 };
  pw_sample sample;
  pw_run *r = engine_open (s->system, method, &(pw_settings){ .rtol = rtol, .span = EIGHTH_SECONDS });
  while (pw_run_time (r) < EIGHTH_SECONDS)
    if (pw_run_advance (r, EIGHTH_SECONDS, &error) != PW_OK) engine_die (method, error.text);
  if (pw_run_sample (r, EIGHTH_SECONDS, &sample, &error) != PW_OK) engine_die (method, error.text);
  eighth_copy (q, sample.q);
  double evaluations = (double)pw_run_statistics (r)->rhs;
  pw_run_close (r);
  return evaluations;
}

/* ---- Scenes ---- */

static void eighth_open (eighth_scene *s, int massless) {
  ezy_model p = { 0.5, 0.5, 0.125, 0.125, 1, 0.1, massless ? 0 : 0.1, massless ? 0 : 0.01, 0.1, PW_PI };
  pw_error error = { 0 };
  ezy_open (&s->hand, &p);
  s->system = engine_ezyroller (massless);
  s->run = engine_open (s->system, "rk4+none", &(pw_settings){ .span = EIGHTH_SECONDS });
  if (pw_projector_open (&s->projector, s->run, s->run->s->metric, NULL, &error) != PW_OK)
    engine_die ("projector", error.text);
  eighth_by_hand (s, NULL, 0.0125, s->reference);
}

static void eighth_close (eighth_scene *s) {
  pw_projector_close (&s->projector);
  pw_run_close (s->run);
  pw_system_free (s->system);
}

/* ---- Measuring ---- */

static void eighth_put (const char *scene, const ladder *w, FILE *csv) {
  for (const ladder_point *p = w->point; p < w->point + w->count; p++)
    fprintf (csv, "%s,%s,point,%.9g,%.9g,%.9g\n", scene, w->name, p->level, p->error, p->cpu[EIGHTH_ROUNDS / 2]);
  for (int j = 0; j < EIGHTH_TARGETS; j++)
    if (ladder_time (w, eighth_target[j], EIGHTH_ROUNDS) > 0)
      fprintf (csv, "%s,%s,line,nan,%.9g,%.9g\n", scene, w->name, eighth_target[j],
               ladder_time (w, eighth_target[j], EIGHTH_ROUNDS));
}

static void eighth_print (const ladder *w, const ladder *ours) {
  printf ("  %-40s", w->name);
  for (int j = 0; j < EIGHTH_TARGETS; j++) {
    double time = ladder_time (w, eighth_target[j], EIGHTH_ROUNDS);
    if (time > 0)
      printf ("  %8.3f (%6.3f)", 1e3 * time, ladder_time (ours, eighth_target[j], EIGHTH_ROUNDS) / time);
    else
      printf ("  %8s  %6s ", "never", "");
  }
  putchar ('\n');
}

static ladder eighth_ways[EIGHTH_WAYS] = {
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
  ladder *way = eighth_ways;
  eighth_scene s;
  double q[6];
  eighth_open (&s, massless);
  for (int round = 0; round < EIGHTH_ROUNDS; round++)
    for (int i = 0; i < EIGHTH_WAYS; i++)
      for (int k = 0; k < way[i].count; k++) ladder_take (&way[i], &s, s.reference, 6, q, round, k);
  printf ("\nsteering %s: processor time [ms] for an error of the lengths after %d s\n"
          "(in brackets how many times that erk8+projection takes)\n  %-40s  %-17s  %s\n",
          scene, EIGHTH_SECONDS, "", "   1e-6 m", "   1e-9 m");
  for (int i = 0; i < EIGHTH_WAYS; i++) ladder_sort (&way[i], EIGHTH_ROUNDS);
  for (int i = 0; i < EIGHTH_WAYS; i++) {
    eighth_print (&way[i], &way[2]);
    if (csv) eighth_put (scene, &way[i], csv);
  }
  eighth_close (&s);
}

int main (int argc, char **argv) {
  FILE *csv = argc > 1 ? fopen (argv[1], "w") : NULL;
  if (argc > 1 && csv == NULL) engine_die (argv[1], "cannot be written");
  if (csv) fputs ("steering,program,what,level,error_m,cpu_s\n", csv);
  puts ("EzyRoller: erk8+projection against an 8th-order program by hand");
  eighth_case (1, csv);
  eighth_case (0, csv);
  return csv && fclose (csv) != 0;
}
