/* peers: what an accuracy costs on the EzyRoller with a massive steering assembly, 100 s, by Pinwheel's methods and by
 * programs written by hand for this vehicle alone with the same kind of method.
 *
 *   peers [CSV]           every method down a ladder of tolerances or steps, by turns; the points, and what errors of
 *                         1e-3, 1e-6, 1e-9, 1e-12 m cost; instructions of a run at about 1e-6 by callgrind, if it is there
 *   peers --count K RUNG  does run K alone, for callgrind
 *
 * The error is that of the lengths at the end against digits computed in quadruple precision (8th order, minimal
 * coordinates, 10,000 and 20,000 steps agreeing to 17 digits).  Targets are what such programs took on an earlier machine:
 * to be compared with this machine's column by hand. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine/engine.h"
#include "engine/ladder.h"

#define pw_method_erk8 peers_unused
#include "erk8.c"
#undef pw_method_erk8

enum { PEERS_SECONDS = 100, PEERS_ERRORS = 4, PEERS_ROUNDS = 5 };
static const double peers_error[PEERS_ERRORS] = { 1e-3, 1e-6, 1e-9, 1e-12 }; /* [m] */
static const double peers_truth[6] = { 85.776831285852169, -52.654687622986008, -0.50097272513213377,
                                       86.105849606538573, -52.834610154037750, 2.6389584717201285 };
static const ezy_model peers_model = { 0.5, 0.5, 0.125, 0.125, 1, 0.1, 0.1, 0.01, 0.1, PW_PI };
static const ezy_tableau peers_tableau = { 12, erk8_c, erk8_A, erk8_b };

/* ---- By hand ---- */

static void peers_rate (void *context, double t, const double *q, const double *v, double *a, double *lambda) {
  ezy_massive (context, t, q, v, a, lambda);
}

static void peers_project (void *context, double t, double *q, double *v, ezy_state *s) {
  ezy_project (context, t, q, v, s);
}

static double peers_eighth (void *scene, const ladder *way, double h, double q[6]) {
  long steps = lround (PEERS_SECONDS / h);
  ezy e;
  ezy_state s;
  (void)scene, (void)way;
  ezy_open (&e, &peers_model);
  ezy_start (&e, &s);
  for (long i = 1; i <= steps; i++)
    ezy_step (&peers_tableau, &(ezy_dynamics){ peers_rate, peers_project, &e },
              PEERS_SECONDS * (double)i / (double)steps, &s);
  memcpy (q, s.q, sizeof s.q);
  return 12.0 * (double)steps + 1;
}

static double peers_classical (void *scene, const ladder *way, double h, double q[6]) {
  long steps = lround (PEERS_SECONDS / h);
  ezy e;
  ezy_state s;
  (void)scene, (void)way;
  ezy_open (&e, &peers_model);
  ezy_start (&e, &s);
  for (long i = 0; i < steps; i++) {
    s.t = PEERS_SECONDS * (double)i / (double)steps;
    ezy_massive_step (&e, PEERS_SECONDS / (double)steps, &s);
  }
  memcpy (q, s.q, sizeof s.q);
  return 4.0 * (double)steps + 1;
}

/* A step of the tableau in minimal coordinates. */
static void peers_minimal_step (const ezy *e, double t, double h, double y[6]) {
  double K[12][6], z[6];
  const double *row = erk8_A;
  ezy_minimal (e, t, y, K[0]);
  for (int i = 1; i <= 12; row += i++) {
    const double *w = i < 12 ? row : erk8_b;
    memcpy (z, y, sizeof z);
    for (int k = 0; k < i; k++)
      if (w[k] != 0)
        for (int j = 0; j < 6; j++) z[j] += h * w[k] * K[k][j];
    if (i < 12) ezy_minimal (e, t + erk8_c[i] * h, z, K[i]);
  }
  memcpy (y, z, sizeof z);
}

static double peers_minimal (void *scene, const ladder *way, double h, double q[6]) {
  const ezy_model *m = &peers_model;
  long steps = lround (PEERS_SECONDS / h);
  double y[6] = { -m->a, 0, 0, acos (-1), 0, 0 };
  ezy e;
  (void)scene, (void)way;
  ezy_open (&e, m);
  h = PEERS_SECONDS / (double)steps;
  for (long i = 0; i < steps; i++) peers_minimal_step (&e, (double)i * h, h, y);
  q[0] = y[0] + m->a * cos (y[2]), q[1] = y[1] + m->a * sin (y[2]), q[2] = y[2];
  q[3] = q[0] + m->b * cos (y[2]) + m->d * cos (y[3]), q[4] = q[1] + m->b * sin (y[2]) + m->d * sin (y[3]), q[5] = y[3];
  return 12.0 * (double)steps;
}

static double peers_cvode (void *scene, const ladder *way, double rtol, double q[6]) {
  ezy_cvode *d = ezy_cvode_open (&peers_model, way->method[0] == 'a', rtol, PEERS_SECONDS);
  long steps, evaluations;
  int flag = 0;
  (void)scene;
  if (d == NULL) engine_die (way->name, "cannot be opened");
  while (flag == 0) flag = ezy_cvode_step (d);
  ezy_cvode_look (d, &steps, &evaluations, q);
  ezy_cvode_close (d);
  if (flag < 0) q[0] = NAN;
  return (double)evaluations;
}

static double peers_ida (void *scene, const ladder *way, double rtol, double q[6]) {
  ezy_ida *d = ezy_ida_open (&peers_model, rtol, PEERS_SECONDS);
  long steps, evaluations;
  int flag = 0;
  (void)scene;
  if (d == NULL) engine_die (way->name, "cannot be opened");
  while (flag == 0) flag = ezy_ida_step (d);
  ezy_ida_look (d, &steps, &evaluations, q);
  ezy_ida_close (d);
  if (flag < 0) q[0] = NAN;
  return (double)evaluations;
}

/* ---- Pinwheel ---- */

static double peers_ours (void *scene, const ladder *way, double rung, double q[6]) {
  pw_error error = { 0 };
  pw_sample sample;
  pw_run *r = engine_open (scene, way->method, &(pw_settings){ .rtol = rung, .step = rung, .span = PEERS_SECONDS });
  int status = PW_OK;
  while (status == PW_OK && pw_time (r) < PEERS_SECONDS) status = pw_advance (r, PEERS_SECONDS, &error);
  if (status == PW_OK && pw_at (r, PEERS_SECONDS, &sample, &error) != PW_OK) engine_die (way->method, error.text);
  for (int j = 0; j < 6; j++) q[j] = status == PW_OK ? sample.q[j] : NAN;
  double evaluations = (double)pw_run_statistics (r)->rhs;
  pw_close (r);
  return evaluations;
}

/* ---- Pairs ---- */

#define PEERS_HAND(text, key, from, by, rungs, what, step) \
  { .name = text, .method = key, .first = from, .factor = by, .count = rungs, .run = what, .function = step }
#define PEERS_OURS(key, from, by, rungs) PEERS_HAND (key, key, from, by, rungs, peers_ours, "pw_advance")

enum { MINIMAL, EIGHTH, CLASSICAL, ADAMS, BDF, GGL, PEERS_HANDS };
static ladder peers_hand[PEERS_HANDS] = {
  PEERS_HAND ("8th order, minimal coordinates", "", 1, 0.83, 18, peers_minimal, "peers_minimal"),
  PEERS_HAND ("8th order and projection", "", 0.7, 0.83, 18, peers_eighth, "ezy_step"),
  PEERS_HAND ("classical Runge-Kutta and projection", "", 0.2, 0.6, 12, peers_classical, "ezy_massive_step"),
  PEERS_HAND ("CVODES Adams", "adams", 1e-4, 0.3, 17, peers_cvode, "ezy_cvode_step"),
  PEERS_HAND ("CVODES BDF and projection", "bdf", 1e-4, 0.3, 17, peers_cvode, "ezy_cvode_step"),
  PEERS_HAND ("IDAS, stabilised index 2, KLU", "ida", 1e-4, 0.3, 16, peers_ida, "ezy_ida_step"),
};

typedef struct {
  int hand;
  double target[PEERS_ERRORS]; /* [ms]; 0: none */
  ladder ours;
} peers_pair;

static peers_pair peers_pairs[] = {
  { EIGHTH, { 0.5, 0.87, 2.1, 4.6 }, PEERS_OURS ("erk8+projection", 1e-3, 0.3, 21) },
  { EIGHTH, { 0.5, 0.87, 2.1, 4.6 }, PEERS_OURS ("erk8+nullspace", 1e-3, 0.3, 21) },
  { MINIMAL, { 0.16, 0.41, 0.96, 2.3 }, PEERS_OURS ("erk8+projection", 1e-3, 0.3, 21) },
  { CLASSICAL, { 3, 3, 15, 102 }, PEERS_OURS ("erk5+projection", 1e-3, 0.3, 21) },
  { CLASSICAL, { 3, 3, 15, 102 }, PEERS_OURS ("rk4+projection", 0.2, 0.6, 12) },
  { CLASSICAL, { 3, 3, 15, 102 }, PEERS_OURS ("rk4+nullspace", 0.2, 0.6, 12) },
  { ADAMS, { 7.7, 14, 26, 0 }, PEERS_OURS ("adams+none", 1e-4, 0.3, 17) },
  { ADAMS, { 7.7, 14, 26, 0 }, PEERS_OURS ("adams+baumgarte", 1e-4, 0.3, 17) },
  { BDF, { 12, 37, 146, 0 }, PEERS_OURS ("bdf+projection", 1e-4, 0.3, 17) },
  { GGL, { 17, 51, 305, 0 }, PEERS_OURS ("ida+ggl", 1e-4, 0.3, 16) },
};
enum { PEERS_PAIRS = sizeof peers_pairs / sizeof *peers_pairs };

static ladder *peers_way (int k) {
  return k < PEERS_HANDS ? &peers_hand[k] : &peers_pairs[k - PEERS_HANDS].ours;
}

/* ---- Instructions ---- */

typedef struct {
  const ladder *way;
  pw_system *system;
  double rung;
} peers_job;

static long peers_once (void *context, long n) {
  const peers_job *job = context;
  double q[6];
  job->way->run (job->system, job->way, job->rung, q);
  return n;
}

/* Per evaluation, over a whole run at the rung whose error is next to 1e-6; 0: not known. */
static double peers_instructions (const char *program, int k) {
  const ladder *l = peers_way (k);
  char key[20], rung[40];
  int best = 0;
  for (int i = 0; i < l->count; i++)
    if (fabs (log (l->point[i].error / 1e-6)) < fabs (log (l->point[best].error / 1e-6))) best = i;
  snprintf (key, sizeof key, "%d", k);
  snprintf (rung, sizeof rung, "%.17g", l->point[best].rung);
  return engine_count (program, key, rung, l->function) / l->point[best].evaluations;
}

/* ---- Measuring ---- */

static void peers_measure (pw_system *system) {
  for (int round = 0; round < PEERS_ROUNDS; round++)
    for (int k = 0; k < PEERS_HANDS + PEERS_PAIRS; k++)
      for (int i = 0; i < peers_way (k)->count; i++) ladder_take (peers_way (k), system, peers_truth, round, i);
  for (int k = 0; k < PEERS_HANDS + PEERS_PAIRS; k++) ladder_sort (peers_way (k), PEERS_ROUNDS);
}

static void peers_put (FILE *csv, const peers_pair *p, int i, double hand, double ours) {
  const ladder *h = &peers_hand[p->hand], *o = &p->ours;
  double error = peers_error[i], a = ladder_time (h, error, PEERS_ROUNDS), b = ladder_time (o, error, PEERS_ROUNDS);
  double m = ladder_evaluations (h, error), n = ladder_evaluations (o, error);
  printf ("%-16s %-37s %5.0e", o->name, h->name, error);
  printf ("  %9.3f %9.3f %6.2f  %7.0f %7.0f  %6.0f %6.0f %6.2f  %6g\n", 1e3 * a, 1e3 * b, b / a, m, n, hand, ours,
          n * ours / (m * hand), p->target[i]);
  if (csv)
    fprintf (csv, "%s,\"%s\",%g,%.4g,%.4g,%.0f,%.0f,%.0f,%.0f,%g\n", o->name, h->name, error, 1e3 * a, 1e3 * b, m, n,
             hand, ours, p->target[i]);
}

static void peers_report (const char *program, FILE *csv) {
  double hand[PEERS_HANDS];
  for (int k = 0; k < PEERS_HANDS; k++) hand[k] = peers_instructions (program, k);
  printf ("%-16s %-37s %5s  %9s %9s %6s  %7s %7s  %6s %6s %6s  %6s\n", "method", "by hand", "error", "hand[ms]",
          "ours[ms]", "ratio", "evals", "ours", "instr", "ours", "ratio", "target");
  if (csv)
    fputs ("method,hand,error_m,hand_ms,ours_ms,hand_evaluations,our_evaluations,hand_instructions,"
           "our_instructions,target_ms\n",
           csv);
  for (int k = 0; k < PEERS_PAIRS; k++) {
    double ours = peers_instructions (program, PEERS_HANDS + k);
    for (int i = 0; i < PEERS_ERRORS; i++) peers_put (csv, &peers_pairs[k], i, hand[peers_pairs[k].hand], ours);
  }
}

int main (int argc, char **argv) {
  pw_system *system = engine_ezyroller (0);
  if (argc == 4 && strcmp (argv[1], "--count") == 0) {
    peers_job job = { peers_way (atoi (argv[2])), system, atof (argv[3]) };
    engine_counted (&(timing_work){ peers_once, &job }, 1);
    return 0;
  }
  FILE *csv = argc > 1 ? fopen (argv[1], "w") : NULL;
  if (argc > 1 && csv == NULL) engine_die (argv[1], "cannot be written");
  peers_measure (system);
  peers_report (argv[0], csv);
  pw_free (system);
  return csv && fclose (csv) != 0;
}
