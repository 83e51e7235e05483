/* The same input gives the same bits: in a second run, on a system used before, in any number of threads. */
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pinwheel-files.h"
#include "runs.h"
#include "util.h"

/* ---- Runs: scenes and methods that together use all parts of the library ---- */

static const struct {
  const char *scene, *parameter;
  double value, t_end;
} same_scenes[] = {
  { "models/vehicles/ezyroller.c", NULL, 0, 1 },  { "models/vehicles/ezyroller.c", "m2", 0.1, 1 },
  { "tests/scenes/zoo.c", NULL, 0, 0.4 },         { "tests/scenes/chain.c", "links", 5, 0.4 },
  { "tests/scenes/chain.c", "links", 150, 0.02 }, { "tests/scenes/feedback.yaml", NULL, 0, 0.4 },
};
static const char *const same_methods[] = { "rk4+none",
                                            "rk4+projection",
                                            "rk4+projection:metric=identity",
                                            "ida+none",
                                            "ida+ggl",
                                            "radau+ggl",
                                            "rk4+projection:every=3",
                                            "ida+baumgarte",
                                            "ida+index2",
                                            "ida+si1",
                                            "adams+none",
                                            "bdf+projection",
                                            "rk4+baumgarte:inputs=held" };

enum {
  SAME_SCENES = sizeof same_scenes / sizeof *same_scenes,
  SAME_METHODS = sizeof same_methods / sizeof *same_methods,
  SAME_RUNS = SAME_SCENES * SAME_METHODS,
  SAME_THREADS = 8
};

static pw_file *same_file[SAME_SCENES];

static int same_setup (void) {
  pw_error error = { 0 };
  for (int i = 0; i < SAME_SCENES; i++)
    if ((same_file[i] = pw_file_open (same_scenes[i].scene, &error)) == NULL) check_ok (error.status, &error);
  return 0;
}

static int same_teardown (void) {
  for (int i = 0; i < SAME_SCENES; i++) pw_file_close (same_file[i]);
  return 0;
}

/* ---- Hashes of all bits of a final state ---- */

static uint64_t same_hash (pw_run *r, const pw_sample *x, int coordinates, int rows) {
  size_t n = (size_t)coordinates * sizeof (double);
  const pw_statistics *s = pw_run_statistics (r);
  const long counts[] = { s->steps, s->rejected, s->rhs, s->jacobians, s->factorisations };
  const double numbers[] = { x->t, x->kinetic, x->potential, x->work, x->loss, s->position, s->velocity, s->g, s->jv };
  uint64_t h = pw_check_sum (PW_CHECK, x->q, n);
  h = pw_check_sum (pw_check_sum (h, x->v, n), x->a, n);
  h = pw_check_sum (h, x->lambda, (size_t)rows * sizeof (double));
  return pw_check_sum (pw_check_sum (h, counts, sizeof counts), numbers, sizeof numbers);
}

/* A compiled scene, or NULL and the error: threads call this, in which no assertion of cmocka may fail. */
static pw_system *same_system (int scene, pw_error *error) {
  pw_system *s = NULL;
  pw_model *m = pw_file_model (same_file[scene], error);
  if (m && same_scenes[scene].parameter)
    pw_model_set (m, same_scenes[scene].parameter, same_scenes[scene].value, error);
  if (m && pw_model_build (m, error) == PW_OK) s = pw_system_compile (m, error);
  pw_model_free (m);
  return s;
}

/* The hash of a run on a system; 0 if it fails. */
static uint64_t same_run_on (const pw_system *s, int run, pw_error *error) {
  double t = same_scenes[run / SAME_METHODS].t_end;
  pw_settings settings = { .step = 1e-3, .rtol = 1e-6, .span = t, .ledger = 1 };
  pw_run *r = pw_run_open (s, same_methods[run % SAME_METHODS], &settings, error);
  pw_sample sample;
  uint64_t h = 0;
  if (r == NULL) return 0;
  if (pw_run_advance_to (r, t, t, error) == PW_OK && pw_run_sample (r, t, &sample, error) == PW_OK)
    h = same_hash (r, &sample, pw_system_coordinates (s), pw_system_rows (s));
  pw_run_close (r);
  return h;
}

static uint64_t same_run (int run, pw_error *error) {
  pw_system *s = same_system (run / SAME_METHODS, error);
  uint64_t h = s ? same_run_on (s, run, error) : 0;
  pw_system_free (s);
  return h;
}

/* The hashes of all runs, computed in the first call. */
static const uint64_t *same_reference (void) {
  static uint64_t hash[SAME_RUNS];
  for (int i = 0; i < SAME_RUNS && hash[SAME_RUNS - 1] == 0; i++) {
    pw_error error = { 0 };
    hash[i] = same_run (i, &error);
    check_ok (error.status, &error);
  }
  return hash;
}

static void same_expect (int run, uint64_t hash, const char *what) {
  if (hash == same_reference ()[run]) return;
  print_error ("%s, %s %g, %s: other bits than in the first run\n", what, same_scenes[run / SAME_METHODS].scene,
               same_scenes[run / SAME_METHODS].value, same_methods[run % SAME_METHODS]);
  fail ();
}

/* ---- Tests ---- */

/* All hashes differ: they distinguish the runs. */
TEST (hashes) {
  const uint64_t *hash = same_reference ();
  for (int i = 0; i < SAME_RUNS; i++)
    for (int k = 0; k < i; k++) assert_true (hash[i] != hash[k]);
}

/* In reverse order, with memory that is not zero. */
TEST (again) {
  for (int i = SAME_RUNS - 1; i >= 0; i--) {
    pw_error error = { 0 };
    void *used[20];
    for (int k = 0; k < 20; k++)
      if ((used[k] = malloc ((size_t)1 << k)) != NULL) memset (used[k], 0x5a + i, (size_t)1 << k);
    for (int k = 0; k < 20; k++) free (used[k]);
    same_expect (i, same_run (i, &error), "again");
  }
}

/* A run does not depend on earlier ones of the same system. */
TEST (used_system) {
  for (int scene = 0; scene < SAME_SCENES; scene++) {
    pw_error error = { 0 };
    pw_system *s = same_system (scene, &error);
    assert_non_null (s);
    for (int i = 0; i < 2 * SAME_METHODS; i++) {
      int run = scene * SAME_METHODS + (5 * i + 2) % SAME_METHODS;
      same_expect (run, same_run_on (s, run, &error), "on a system used before");
    }
    pw_system_free (s);
  }
}

typedef struct {
  const pw_system *const *shared; /* one for each scene; NULL: each run compiles its own */
  int first;                      /* the run with which it begins */
  uint64_t hash[SAME_RUNS];
} same_worker;

static void *same_work (void *context) {
  same_worker *w = context;
  for (int i = 0; i < SAME_RUNS; i++) {
    int run = (w->first + i) % SAME_RUNS;
    pw_error error = { 0 };
    const pw_system *s = w->shared ? w->shared[run / SAME_METHODS] : NULL;
    w->hash[run] = s ? same_run_on (s, run, &error) : same_run (run, &error);
  }
  return NULL;
}

static void same_threads (const pw_system *const *shared, const char *what) {
  for (int threads = 2; threads <= SAME_THREADS; threads *= 2) {
    same_worker *w = calloc ((size_t)threads, sizeof *w);
    pthread_t id[SAME_THREADS];
    assert_non_null (w);
    for (int i = 0; i < threads; i++) {
      w[i].shared = shared;
      w[i].first = i * (SAME_RUNS / threads / 2); /* two threads each have the same scenes at about the same time */
      assert_int_equal (pthread_create (&id[i], NULL, same_work, w + i), 0);
    }
    for (int i = 0; i < threads; i++) pthread_join (id[i], NULL);
    for (int i = 0; i < threads; i++)
      for (int run = 0; run < SAME_RUNS; run++) same_expect (run, w[i].hash[run], what);
    free (w);
  }
}

TEST (threads) {
  same_threads (NULL, "in a thread");
}

/* All threads run all methods at once on one compiled system of each scene, which no run modifies. */
TEST (shared_system) {
  pw_system *s[SAME_SCENES];
  const pw_system *shared[SAME_SCENES];
  for (int i = 0; i < SAME_SCENES; i++) {
    pw_error error = { 0 };
    shared[i] = s[i] = same_system (i, &error);
    check_ok (error.status, &error);
  }
  same_threads (shared, "in a thread, on a shared system");
  for (int i = 0; i < SAME_SCENES; i++) pw_system_free (s[i]);
}

const check_fixture fixture = { same_setup, same_teardown };
