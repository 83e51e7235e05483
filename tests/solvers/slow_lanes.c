/* Random mechanisms and large models in lanes: runs end with the state, the statistics and the error of single runs, to
 * the bit. */
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mechanism.h"
#include "method.h"
#include "pinwheel-files.h"
#include "scene.h"
#include "specialised.h"

enum { MOST = 8, SCENES = 40 };

typedef struct {
  int n, status[MOST];
  pw_run *run[MOST];
  pw_error error[MOST];
} several;

static void several_open (several *x, const pw_system *s, int n, const char *method, double step,
                          const pw_specialised *code) {
  *x = (several){ .n = n };
  for (int k = 0; k < n; k++) {
    int j = 3 * (k % s->bodies);
    pw_initial_value value = { s->coords + j, s->v0[j] + 0.02 * k };
    pw_settings set = { .step = step, .span = 1, .specialised = code, .initial = &value, .initials = 1 };
    x->run[k] = pw_run_open (s, method, &set, NULL);
    set.initials = 0; /* if the changed velocity contradicts a prescribed one */
    if (x->run[k] == NULL) x->run[k] = pw_run_open (s, method, &set, &x->error[k]);
    check_ok (x->error[k].status, &x->error[k]);
  }
}

static void several_close (several *x) {
  for (int k = 0; k < x->n; k++) pw_run_close (x->run[k]);
}

/* Advances all runs together, each until it ends. */
static void several_advance (several *x, double t, const pw_specialised_lanes *code, void *memory) {
  pw_run *run[MOST];
  double t_end[MOST];
  int which[MOST], status[MOST];
  for (int k = 0; k < x->n; k++) which[k] = k, t_end[k] = t;
  for (int left = x->n, keep; left > 0; left = keep) {
    pw_error error[MOST] = { { 0 } };
    for (int i = 0; i < left; i++) run[i] = x->run[which[i]];
    pw_runs_advance (run, left, t_end, code, memory, status, error);
    for (int i = keep = 0; i < left; i++) {
      int k = which[i];
      x->status[k] = status[i], x->error[k] = error[i];
      if (status[i] == PW_OK && pw_run_time (run[i]) < t) which[keep++] = k;
    }
  }
}

static void compare (const several *alone, const several *together) {
  for (int k = 0; k < alone->n; k++) {
    const pw_run *a = alone->run[k], *b = together->run[k];
    assert_int_equal (alone->status[k], together->status[k]);
    assert_string_equal (alone->error[k].text, together->error[k].text);
    check_bits ("time", &a->t, &b->t, 1);
    check_bits ("positions", a->q, b->q, a->s->coords);
    check_bits ("velocities", a->v, b->v, a->s->coords);
    check_bits ("work and losses", a->ledger, b->ledger, a->s->entries);
    assert_memory_equal (&a->statistics, &b->statistics, sizeof (pw_statistics));
  }
}

/* Compares n runs.  Returns the number of those that failed, -1 if the scene has no lanes. */
static int try_system (const pw_system *s, int n, const char *method, double step) {
  const double t = 100.3 * step;
  int failed = 0;
  pw_error error = { 0 };
  several alone, together;
  char *text = pw_system_source (s, NULL, &error);
  pw_scene_code *one = text ? pw_scene_code_open (text, s, &error) : NULL;
  pw_scene_code *many = one ? pw_scene_lanes_open (text, s, n, &error) : NULL;
  const pw_specialised_lanes *code = pw_scene_code_lanes (many);
  check_ok (error.status, &error);
  if (code) {
    void *memory = pw_specialised_lanes_memory (code);
    assert_non_null (memory);
    several_open (&alone, s, n, method, step, pw_scene_code_table (one));
    several_open (&together, s, n, method, step, pw_scene_code_table (one));
    for (int k = 0; k < n; k++) {
      alone.status[k] = pw_run_advance_to (alone.run[k], t, t, &alone.error[k]);
      failed += alone.status[k] != PW_OK;
    }
    several_advance (&together, t, code, memory);
    compare (&alone, &together);
    several_close (&alone);
    several_close (&together);
    free (memory);
  }
  pw_scene_code_close (one);
  pw_scene_code_close (many);
  free (text);
  return code ? failed : -1;
}

TEST (random) {
  static const char *const method[] = { "rk4+projection", "rk4+none", "erk8+projection:steps=fixed",
                                        "erk5+projection:steps=fixed" };
  static const mechanism_view unchanged = { .mirror = 0 };
  int tried = 0, failed = 0;
  for (unsigned seed = 1; seed <= SCENES; seed++) {
    mechanism m;
    pw_error error = { 0 };
    mechanism_make (seed, &m);
    pw_system *s = mechanism_compile (&m, &unchanged, &error);
    check_ok (error.status, &error);
    int n =
        pw_system_has_lanes (s) ? try_system (s, 2 << seed % 3, method[seed % 4], seed % 5 == 0 ? 0.02 : 0.002) : -1;
    tried += n >= 0, failed += n > 0 ? n : 0;
    pw_system_free (s);
  }
  assert_true (tried == 0 || tried == SCENES); /* 0: a compiler that does not vectorise loops over runs */
  print_message ("%d of %d mechanisms in lanes, %d runs failed\n", tried, SCENES, failed);
}

TEST (models) {
  static const char *const model[] = { "theo-jansen", "andrews-squeezer", "wheeled-snake", "chain" };
  for (size_t i = 0; i < sizeof model / sizeof *model; i++)
    for (int n = 2; n <= 8; n *= 4) {
      pw_system *s = scene_named (model[i], NULL, 0);
      assert_true (pw_system_has_lanes (s));
      int failed = try_system (s, n, "rk4+projection", strcmp (model[i], "andrews-squeezer") == 0 ? 1e-6 : 1e-3);
      assert_true (failed <= 0); /* below: a compiler that does not vectorise loops over runs */
      pw_system_free (s);
    }
}
