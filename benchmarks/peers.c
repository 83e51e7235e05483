/* peers: what an accuracy costs by Pinwheel's methods and by programs written by hand for one mechanism alone with the same
 * kind of method: the EzyRoller with a massive steering assembly, 100 s, and chains of pendulums, 1 s.
 *
 *   peers [CSV]           every method down a ladder of tolerances or steps, by turns; what errors of the lengths at the
 *                         end of 1e-3, 1e-6, 1e-9, 1e-12 m cost; instructions of a run at about 1e-6, by callgrind if it
 *                         is there
 *   peers --count K LEVEL  run K alone, for callgrind
 *
 * Errors of the EzyRoller are against digits computed in quadruple precision (8th order, minimal coordinates, 10,000 and
 * 20,000 steps agree to 17 digits), those of chains against the program by hand with a small step.  Targets are what
 * programs by hand took on another machine: to be compared with the column by hand. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine/by_hand.h"
#include "engine/engine.h"

enum { PEERS_ERRORS = 4, PEERS_ROUNDS = 5, PEERS_LINKS = 1000 };
static const double peers_error[PEERS_ERRORS] = { 1e-3, 1e-6, 1e-9, 1e-12 }; /* [m] */
static const double peers_truth[6] = { 85.776831285852169, -52.654687622986008, -0.50097272513213377,
                                       86.105849606538573, -52.834610154037750, 2.6389584717201285 };

/* A mechanism, and what is known of its end. */
typedef struct {
  int links; /* of a chain; 0: the EzyRoller */
  double seconds;
  pw_system *system;
  const double *reference;
} peers_scene;

/* ---- Pinwheel ---- */

static double peers_ours (void *scene, const ladder *way, double level, double *q) {
  const peers_scene *s = scene;
  pw_error error = { 0 };
  pw_sample sample;
  pw_run *r = engine_open (s->system, way->method, &(pw_settings){ .rtol = level, .step = level, .span = s->seconds });
  int status = PW_OK;
  while (status == PW_OK && pw_run_time (r) < s->seconds) status = pw_run_advance (r, s->seconds, &error);
  if (status == PW_OK && pw_run_sample (r, s->seconds, &sample, &error) != PW_OK) engine_die (way->method, error.text);
  for (int j = 0; j < pw_system_coordinates (s->system); j++) q[j] = status == PW_OK ? sample.q[j] : NAN;
  double evaluations = (double)pw_run_statistics (r)->rhs;
  pw_run_close (r);
  return evaluations;
}

/* ---- Pairs ---- */

#define PEERS_HAND(text, key, from, by, levels, what, step) \
  { .name = text, .method = key, .first = from, .factor = by, .count = levels, .run = what, .function = step }
#define PEERS_OURS(key, from, by, levels) PEERS_HAND (key, key, from, by, levels, peers_ours, "pw_run_advance")
#define PEERS_CHAIN(text) PEERS_HAND (text, "", 0.04, 0.8, 18, by_hand_chain, "by_hand_chain_step")

static peers_scene peers_scenes[] = {
  { 0, BY_HAND_SECONDS, NULL, NULL }, { 10, 1, NULL, NULL }, { 100, 1, NULL, NULL }, { PEERS_LINKS, 1, NULL, NULL }
};
enum { PEERS_SCENES = sizeof peers_scenes / sizeof *peers_scenes };

enum { MINIMAL, EIGHTH, CLASSICAL, ADAMS, BDF, GGL, CHAIN, PEERS_HANDS = CHAIN + PEERS_SCENES - 1 };
static ladder peers_hand[PEERS_HANDS] = {
  PEERS_HAND ("8th order, minimal coordinates", "", 1, 0.83, 20, by_hand_minimal, "by_hand_minimal"),
  PEERS_HAND ("8th order and projection", "", 0.7, 0.83, 20, by_hand_eighth, "ezy_step"),
  PEERS_HAND ("classical Runge-Kutta and projection", "", 0.2, 0.58, 12, by_hand_classical, "ezy_massive_step"),
  PEERS_HAND ("CVODES Adams", "adams", 1e-4, 0.3, 19, by_hand_cvode, "ezy_cvode_step"),
  PEERS_HAND ("CVODES BDF and projection", "bdf", 1e-4, 0.3, 19, by_hand_cvode, "ezy_cvode_step"),
  PEERS_HAND ("IDAS, stabilised index 2, KLU", "ida", 1e-4, 0.3, 17, by_hand_ida, "ezy_ida_step"),
  PEERS_CHAIN ("chain of 10, 8th order"),
  PEERS_CHAIN ("chain of 100, 8th order"),
  PEERS_CHAIN ("chain of 1000, 8th order"),
};

typedef struct {
  int hand;
  double target[PEERS_ERRORS]; /* [ms]; 0: none */
  ladder ours;
} peers_pair;

static peers_pair peers_pairs[] = {
  { EIGHTH, { 0.5, 0.87, 2.1, 4.6 }, PEERS_OURS ("erk8+projection", 1e-3, 0.3, 21) },
  { EIGHTH, { 0.5, 0.87, 2.1, 4.6 }, PEERS_OURS ("erk8+projection:steps=fixed", 0.7, 0.83, 20) },
  { EIGHTH, { 0.5, 0.87, 2.1, 4.6 }, PEERS_OURS ("erk8+nullspace", 1e-3, 0.3, 21) },
  { MINIMAL, { 0.16, 0.41, 0.96, 2.3 }, PEERS_OURS ("erk8+projection", 1e-3, 0.3, 21) },
  { CLASSICAL, { 3, 3, 15, 102 }, PEERS_OURS ("erk5+projection", 1e-3, 0.3, 21) },
  { CLASSICAL, { 3, 3, 15, 102 }, PEERS_OURS ("rk4+projection", 0.2, 0.58, 12) },
  { CLASSICAL, { 3, 3, 15, 102 }, PEERS_OURS ("rk4+nullspace", 0.2, 0.58, 12) },
  { ADAMS, { 7.7, 14, 26, 0 }, PEERS_OURS ("adams+none", 1e-4, 0.3, 19) },
  { ADAMS, { 7.7, 14, 26, 0 }, PEERS_OURS ("adams+baumgarte", 1e-4, 0.3, 19) },
  { BDF, { 12, 37, 146, 0 }, PEERS_OURS ("bdf+projection", 1e-4, 0.3, 19) },
  { GGL, { 17, 51, 305, 0 }, PEERS_OURS ("ida+ggl", 1e-4, 0.3, 17) },
  { CHAIN, { 0, 0.16, 0, 0 }, PEERS_OURS ("erk8+projection", 1e-4, 0.3, 16) },
  { CHAIN + 1, { 0, 2.7, 0, 0 }, PEERS_OURS ("erk8+projection", 1e-4, 0.3, 16) },
  { CHAIN + 2, { 0, 65, 0, 0 }, PEERS_OURS ("erk8+projection", 1e-4, 0.3, 16) },
};
enum { PEERS_PAIRS = sizeof peers_pairs / sizeof *peers_pairs, PEERS_WAYS = PEERS_HANDS + PEERS_PAIRS };

static ladder *peers_way (int k) {
  return k < PEERS_HANDS ? &peers_hand[k] : &peers_pairs[k - PEERS_HANDS].ours;
}

static peers_scene *peers_scene_of (int k) {
  int hand = k < PEERS_HANDS ? k : peers_pairs[k - PEERS_HANDS].hand;
  return &peers_scenes[hand < CHAIN ? 0 : hand - CHAIN + 1];
}

static void peers_open (void) {
  static double reference[PEERS_SCENES][3 * PEERS_LINKS];
  for (int i = 0; i < PEERS_SCENES; i++) {
    peers_scene *s = &peers_scenes[i];
    s->system = s->links ? engine_chain (s->links) : engine_ezyroller (0);
    s->reference = s->links ? reference[i] : peers_truth;
    if (s->links) by_hand_chain (&s->links, NULL, 2e-4, reference[i]);
  }
}

/* ---- Instructions ---- */

typedef struct {
  int way;
  double level;
} peers_job;

static long peers_once (void *context, long n) {
  const peers_job *job = context;
  static double q[3 * PEERS_LINKS];
  const ladder *l = peers_way (job->way);
  l->run (peers_scene_of (job->way), l, job->level, q);
  return n;
}

/* Per evaluation, over a whole run at the level whose error is next to 1e-6; 0: not known. */
static double peers_instructions (const char *program, int k) {
  const ladder *l = peers_way (k);
  char key[20], level[40];
  int best = 0;
  for (int i = 0; i < l->count; i++)
    if (fabs (log (l->point[i].error / 1e-6)) < fabs (log (l->point[best].error / 1e-6))) best = i;
  snprintf (key, sizeof key, "%d", k);
  snprintf (level, sizeof level, "%.17g", l->point[best].level);
  return engine_count (program, key, level, l->function) / l->point[best].evaluations;
}

/* ---- Measuring ---- */

/* Runs of long chains are few, and as alike as they are long. */
static void peers_measure (void) {
  static double q[3 * PEERS_LINKS];
  for (int round = 0; round < PEERS_ROUNDS; round++)
    for (int k = 0; k < PEERS_WAYS; k++) {
      peers_scene *s = peers_scene_of (k);
      for (int i = 0; i < peers_way (k)->count; i++)
        ladder_take (peers_way (k), s, s->reference, pw_system_coordinates (s->system), q, round, i);
    }
  for (int k = 0; k < PEERS_WAYS; k++) ladder_sort (peers_way (k), PEERS_ROUNDS);
}

static void peers_put (FILE *csv, const peers_pair *p, int i, double hand, double ours) {
  const ladder *h = &peers_hand[p->hand], *o = &p->ours;
  double error = peers_error[i], a = ladder_time (h, error, PEERS_ROUNDS), b = ladder_time (o, error, PEERS_ROUNDS);
  double m = ladder_evaluations (h, error), n = ladder_evaluations (o, error);
  if (a == 0 && b == 0) return;
  printf ("%-27s %-36s %5.0e  %9.3f %9.3f %6.2f  %7.0f %7.0f  %6.0f %6.0f %6.2f  %6g\n", o->name, h->name, error,
          1e3 * a, 1e3 * b, a > 0 ? b / a : 0, m, n, hand, ours, m > 0 ? n * ours / (m * hand) : 0, p->target[i]);
  if (csv)
    fprintf (csv, "%s,\"%s\",%g,%.4g,%.4g,%.0f,%.0f,%.0f,%.0f,%g\n", o->name, h->name, error, 1e3 * a, 1e3 * b, m, n,
             hand, ours, p->target[i]);
}

static void peers_report (const char *program, FILE *csv) {
  double hand[PEERS_HANDS];
  for (int k = 0; k < PEERS_HANDS; k++) hand[k] = peers_instructions (program, k);
  printf ("%-27s %-36s %5s  %9s %9s %6s  %7s %7s  %6s %6s %6s  %6s\n", "method", "by hand", "error", "hand[ms]",
          "ours[ms]", "ratio", "evals", "ours", "instr", "ours", "ratio", "target");
  if (csv)
    fputs ("method,hand,error_m,hand_ms,our_ms,hand_evaluations,our_evaluations,hand_instructions,our_instructions,"
           "target_ms\n",
           csv);
  for (int k = 0; k < PEERS_PAIRS; k++) {
    double ours = peers_instructions (program, PEERS_HANDS + k);
    for (int i = 0; i < PEERS_ERRORS; i++) peers_put (csv, &peers_pairs[k], i, hand[peers_pairs[k].hand], ours);
  }
}

int main (int argc, char **argv) {
  if (argc == 4 && strcmp (argv[1], "--count") == 0) {
    peers_job job = { atoi (argv[2]), atof (argv[3]) };
    peers_scene *s = peers_scene_of (job.way);
    s->system = s->links ? engine_chain (s->links) : engine_ezyroller (0);
    engine_counted (&(timing_work){ peers_once, &job }, 1);
    return 0;
  }
  FILE *csv = argc > 1 ? fopen (argv[1], "w") : NULL;
  if (argc > 1 && csv == NULL) engine_die (argv[1], "cannot be written");
  peers_open ();
  peers_measure ();
  peers_report (argv[0], csv);
  for (int i = 0; i < PEERS_SCENES; i++) pw_system_free (peers_scenes[i].system);
  return csv && fclose (csv) != 0;
}
