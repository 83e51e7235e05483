/* peers: what an accuracy costs with Pinwheel's methods, and with programs written by hand for one mechanism by the
 * same kind of method: 100 s of the EzyRoller with a massive steering assembly, and 1 s of chains of pendulums.
 *
 *   peers [CSV]            runs every method with each tolerance or step of its ladder; prints, and writes to CSV, the
 *                          cost of errors of 1e-3, 1e-6, 1e-9 and 1e-12 m of the positions at the end and, if valgrind
 *                          is installed, the instructions per evaluation of a run with an error of about 1e-6 m
 *   peers --count K LEVEL  one level of ladder K alone, for callgrind
 *
 * Errors of the EzyRoller refer to digits computed in quadruple precision (order 8, minimal coordinates; 10,000 and
 * 20,000 steps agree to 17 digits), those of chains to the program by hand with a small step.  Targets are times of
 * the programs by hand on another machine: compare them with the column of these programs. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine/by_hand.h"
#include "engine/engine.h"

enum { PEERS_ERRORS = 4, PEERS_LINKS = 1000 /* of the longest chain */ };
static const double peers_error[PEERS_ERRORS] = { 1e-3, 1e-6, 1e-9, 1e-12 }; /* [m] */
static const double peers_exact[6] = { 85.776831285852169, -52.654687622986008, -0.50097272513213377,
                                       86.105849606538573, -52.834610154037750, 2.6389584717201285 };

/* A mechanism, the time of a run [s], and the exact positions at its end. */
typedef struct {
  int links; /* of a chain; 0: the EzyRoller */
  double seconds;
  pw_system *system;
  const double *reference;
} peers_scene;

/* ---- Pinwheel ---- */

/* Runs a method of Pinwheel; `level` is the tolerance or the step.  Stores the final positions in q, NAN if it fails;
 * returns the number of evaluations. */
static double peers_ours (void *scene, const ladder *self, double level, double *q) {
  const peers_scene *s = scene;
  pw_error error = { 0 };
  pw_sample sample;
  pw_run *r = engine_open (s->system, self->method, &(pw_settings){ .rtol = level, .step = level, .span = s->seconds });
  int status = PW_OK;
  while (status == PW_OK && pw_run_time (r) < s->seconds) status = pw_run_advance (r, s->seconds, &error);
  if (status == PW_OK && pw_run_sample (r, s->seconds, &sample, &error) != PW_OK) engine_die (self->method, error.text);
  for (int j = 0; j < pw_system_coordinates (s->system); j++) q[j] = status == PW_OK ? sample.q[j] : NAN;
  double evaluations = (double)pw_run_statistics (r)->rhs;
  pw_run_close (r);
  return evaluations;
}

/* ---- Programs written by hand, and methods of Pinwheel that are compared with them ---- */

#define PEERS_LADDER(name_, method_, first_, factor_, count_, run_, function_)                          \
  {                                                                                                     \
    .name = name_, .method = method_, .first = first_, .factor = factor_, .count = count_, .run = run_, \
    .function = function_                                                                               \
  }
#define PEERS_OURS(method, first, factor, count) \
  PEERS_LADDER (method, method, first, factor, count, peers_ours, "pw_run_advance")
#define PEERS_CHAIN(name) PEERS_LADDER (name, "", 0.04, 0.8, 18, by_hand_chain, "by_hand_chain_step")

/* The EzyRoller, then the chains. */
static peers_scene peers_scenes[] = {
  { 0, BY_HAND_SECONDS, NULL, NULL }, { 10, 1, NULL, NULL }, { 100, 1, NULL, NULL }, { PEERS_LINKS, 1, NULL, NULL }
};
enum { PEERS_SCENES = sizeof peers_scenes / sizeof *peers_scenes };

/* Indices of peers_hand; from CHAIN on, chains of 10, 100 and 1000 links. */
enum { MINIMAL, EIGHTH, CLASSICAL, ADAMS, BDF, GGL, CHAIN, PEERS_HANDS = CHAIN + PEERS_SCENES - 1 };
static ladder peers_hand[PEERS_HANDS] = {
  PEERS_LADDER ("8th order, minimal coordinates", "", 1, 0.83, 20, by_hand_minimal, "by_hand_minimal"),
  PEERS_LADDER ("8th order and projection", "", 0.7, 0.83, 20, by_hand_eighth, "ezy_step"),
  PEERS_LADDER ("classical Runge-Kutta and projection", "", 0.2, 0.58, 12, by_hand_classical, "ezy_massive_step"),
  PEERS_LADDER ("CVODES Adams", "adams", 1e-4, 0.3, 19, by_hand_cvode, "ezy_cvode_step"),
  PEERS_LADDER ("CVODES BDF and projection", "bdf", 1e-4, 0.3, 19, by_hand_cvode, "ezy_cvode_step"),
  PEERS_LADDER ("IDAS, stabilised index 2, KLU", "ida", 1e-4, 0.3, 17, by_hand_ida, "ezy_ida_step"),
  PEERS_CHAIN ("chain of 10, 8th order"),
  PEERS_CHAIN ("chain of 100, 8th order"),
  PEERS_CHAIN ("chain of 1000, 8th order"),
};

typedef struct {
  int hand;                    /* index of the program by hand */
  double target[PEERS_ERRORS]; /* time for each error [ms]; 0: none */
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
enum { PEERS_PAIRS = sizeof peers_pairs / sizeof *peers_pairs, PEERS_LADDERS = PEERS_HANDS + PEERS_PAIRS };

static ladder *peers_ladder (int k) {
  return k < PEERS_HANDS ? &peers_hand[k] : &peers_pairs[k - PEERS_HANDS].ours;
}

static peers_scene *peers_scene_of (int k) {
  int hand = k < PEERS_HANDS ? k : peers_pairs[k - PEERS_HANDS].hand;
  return &peers_scenes[hand < CHAIN ? 0 : 1 + hand - CHAIN];
}

static void peers_open_scene (peers_scene *s) {
  s->system = s->links ? engine_chain (s->links) : engine_ezyroller (0);
}

static void peers_open (void) {
  static double reference[PEERS_SCENES][3 * PEERS_LINKS];
  for (int i = 0; i < PEERS_SCENES; i++) {
    peers_scene *s = &peers_scenes[i];
    peers_open_scene (s);
    s->reference = s->links ? reference[i] : peers_exact;
    if (s->links) by_hand_chain (&s->links, NULL, 2e-4, reference[i]);
  }
}

/* ---- Instructions ---- */

typedef struct {
  int ladder;
  double level;
} peers_job;

static long peers_once (void *context, long n) {
  const peers_job *job = context;
  static double q[3 * PEERS_LINKS];
  const ladder *l = peers_ladder (job->ladder);
  l->run (peers_scene_of (job->ladder), l, job->level, q);
  return n;
}

/* Instructions per evaluation of a run at the level whose error is closest to 1e-6 m; 0: not known. */
static double peers_instructions (const char *program, int k) {
  const ladder *l = peers_ladder (k);
  char key[20], level[40];
  int closest = 0;
  for (int i = 0; i < l->count; i++)
    if (fabs (log (l->point[i].error / 1e-6)) < fabs (log (l->point[closest].error / 1e-6))) closest = i;
  snprintf (key, sizeof key, "%d", k);
  snprintf (level, sizeof level, "%.17g", l->point[closest].level);
  return engine_count (program, key, level, l->function) / l->point[closest].evaluations;
}

/* ---- Measuring ---- */

/* All levels of all ladders, round after round, so that a slow phase of the machine affects all of them. */
static void peers_measure (void) {
  static double q[3 * PEERS_LINKS];
  for (int round = 0; round < LADDER_ROUNDS; round++)
    for (int k = 0; k < PEERS_LADDERS; k++) {
      peers_scene *s = peers_scene_of (k);
      for (int i = 0; i < peers_ladder (k)->count; i++)
        ladder_take (peers_ladder (k), s, s->reference, pw_system_coordinates (s->system), q, round, i);
    }
  for (int k = 0; k < PEERS_LADDERS; k++) ladder_sort (peers_ladder (k));
}

/* The line of the i-th error; instructions are those per evaluation. */
static void peers_put (FILE *csv, const peers_pair *p, int i, double hand_instructions, double our_instructions) {
  const ladder *hand = &peers_hand[p->hand], *ours = &p->ours;
  const double error = peers_error[i], target = p->target[i];
  double hand_ms = 1e3 * ladder_time (hand, error), our_ms = 1e3 * ladder_time (ours, error);
  double hand_evaluations = ladder_evaluations (hand, error), our_evaluations = ladder_evaluations (ours, error);
  double instruction_ratio = our_evaluations * our_instructions / (hand_evaluations * hand_instructions);
  if (hand_ms == 0 && our_ms == 0) return;
  printf ("%-27s %-36s %5.0e  %9.3f %9.3f %6.2f  %7.0f %7.0f  %6.0f %6.0f %6.2f  %6g\n", ours->name, hand->name, error,
          hand_ms, our_ms, hand_ms > 0 ? our_ms / hand_ms : 0, hand_evaluations, our_evaluations, hand_instructions,
          our_instructions, hand_evaluations > 0 ? instruction_ratio : 0, target);
  if (csv)
    fprintf (csv, "%s,\"%s\",%g,%.4g,%.4g,%.0f,%.0f,%.0f,%.0f,%g\n", ours->name, hand->name, error, hand_ms, our_ms,
             hand_evaluations, our_evaluations, hand_instructions, our_instructions, target);
}

static void peers_report (const char *program, FILE *csv) {
  double instructions[PEERS_HANDS];
  for (int k = 0; k < PEERS_HANDS; k++) instructions[k] = peers_instructions (program, k);
  printf ("%-27s %-36s %5s  %9s %9s %6s  %7s %7s  %6s %6s %6s  %6s\n", "method", "by hand", "error", "hand[ms]",
          "ours[ms]", "ratio", "evals", "ours", "instr", "ours", "ratio", "target");
  if (csv)
    fputs ("method,hand,error_m,hand_ms,our_ms,hand_evaluations,our_evaluations,hand_instructions,our_instructions,"
           "target_ms\n",
           csv);
  for (int k = 0; k < PEERS_PAIRS; k++) {
    double ours = peers_instructions (program, PEERS_HANDS + k);
    for (int i = 0; i < PEERS_ERRORS; i++) peers_put (csv, &peers_pairs[k], i, instructions[peers_pairs[k].hand], ours);
  }
}

int main (int argc, char **argv) {
  if (argc == 4 && strcmp (argv[1], "--count") == 0) {
    peers_job job = { atoi (argv[2]), atof (argv[3]) };
    peers_open_scene (peers_scene_of (job.ladder));
    engine_counted (&(timing_work){ peers_once, &job }, 1);
    return 0;
  }
  engine_check_arguments (argc, argv, 1, "usage: peers [CSV]");
  FILE *csv = argc > 1 ? fopen (argv[1], "w") : NULL;
  if (argc > 1 && csv == NULL) engine_die (argv[1], "cannot be written");
  peers_open ();
  peers_measure ();
  peers_report (argv[0], csv);
  for (int i = 0; i < PEERS_SCENES; i++) pw_system_free (peers_scenes[i].system);
  return csv && fclose (csv) != 0;
}
