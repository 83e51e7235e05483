/* Runs of random mechanisms: the energy balances, the constraints and the independent verifier's equations are
 * satisfied, and the motion depends neither on the frame, nor on the order of the description, nor on the method. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mechanism.h"
#include "runs.h"
#include "pinwheel-selftest.h"

#define TRY_SPAN 0.5   /* [s]: short enough for chaotic motions */
#define TRY_RTOL 1e-10 /* of erk8, the method the others are compared with */

/* The end of a run. */
typedef struct {
  int status;
  double balance, energy; /* worst balance, largest energy [J] */
  double q[64], v[64];
  pw_statistics statistics;
  pw_verification verification;
  pw_error error;
} try_end;

typedef struct {
  unsigned seed;
  unsigned tried, refused, failed;
} try_count;

static void try_measure (pw_system *s, pw_run *r, try_end *end) {
  size_t bytes = (size_t)pw_system_coordinates (s) * sizeof (double);
  pw_sample x;
  for (int i = 1; i <= 10 && end->status == PW_OK; i++) {
    double t = TRY_SPAN * i / 10;
    end->status = pw_run_advance_to (r, t, TRY_SPAN, &end->error);
    if (end->status == PW_OK) end->status = pw_run_sample (r, t, &x, &end->error);
    if (end->status != PW_OK) return;
    end->balance = fmax (end->balance, fabs (x.balance));
    end->energy = fmax (end->energy, fmax (x.kinetic, fmax (fabs (x.work), x.loss)));
  }
  memcpy (end->q, x.q, bytes);
  memcpy (end->v, x.v, bytes);
  end->statistics = *pw_run_statistics (r);
  end->status = pw_verify (s, pw_run_scale (r), x.t, x.q, x.v, x.a, x.lambda, &end->verification);
}

static void try_run (pw_system *s, const char *method, double rtol, double step, try_end *end) {
  *end = (try_end){ .status = PW_INPUT };
  assert_true (s == NULL || pw_system_coordinates (s) <= (int)(sizeof end->q / sizeof *end->q));
  pw_settings settings = { .rtol = rtol, .step = step, .span = TRY_SPAN, .ledger = 1 };
  pw_run *r = s ? pw_run_open (s, method, &settings, &end->error) : NULL;
  end->status = r ? PW_OK : end->error.status;
  if (r == NULL) return;
  try_measure (s, r, end);
  pw_run_close (r);
}

/* Counts and prints a value above its bound. */
static void try_bound (try_count *n, const char *what, double value, double bound) {
  if (value <= bound) return;
  print_message ("seed %u: %s %.3g, at most %.3g\n", n->seed, what, value, bound);
  n->failed++;
}

/* ---- Symmetries ---- */

/* Largest difference between the transformed state x of system a and the state y of system b. */
static double try_distance (pw_system *a, const try_end *x, pw_system *b, const try_end *y, const mechanism *m,
                            const mechanism_view *view) {
  double worst = 0;
  char name[100];
  for (int i = 0; i < m->bodies; i++) {
    pw_body now = { .mass = 1 };
    int ja = 3 * pw_system_find_body (a, m->body[i].name), jb = 3 * pw_system_find_body (b, m->body[i].name);
    memcpy (now.start, x->q + ja, sizeof now.start);
    memcpy (now.rate, x->v + ja, sizeof now.rate);
    mechanism_transform (view, &now);
    for (int k = 0; k < 3; k++)
      worst = fmax (worst, fmax (fabs (now.start[k] - y->q[jb + k]), fabs (now.rate[k] - y->v[jb + k])));
  }
  for (int j = 3 * m->bodies; j < pw_system_coordinates (a); j++) {
    int other = pw_system_find_state (b, pw_system_state_name (a, j, name, sizeof name), NULL);
    worst = fmax (worst, fabs (x->q[j] - y->q[other]));
  }
  return worst;
}

/* The largest velocity: errors grow with it. */
static double try_size (pw_system *s, const try_end *x) {
  double size = 1;
  for (int j = 0; j < pw_system_coordinates (s); j++) size = fmax (size, fabs (x->v[j]));
  return size;
}

/* 1 if the motion passes a singular configuration so closely that velocities exceed 1e3: round-off decides whether the
 * run can continue. */
static int try_is_nearly_singular (pw_system *s, const try_end *x) {
  return try_size (s, x) > 1e3;
}

static void try_views (try_count *n, const mechanism *m, pw_system *s, const try_end *x) {
  static const struct {
    const char *name;
    mechanism_view view;
  } views[] = { { "moved", { .x = 3, .y = -2 } },
                { "turned", { .angle = 0.7 } },
                { "mirrored", { .mirror = 1 } },
                { "backwards", { .backwards = 1 } } };
  for (size_t i = 0; i < sizeof views / sizeof *views; i++) {
    try_end y;
    pw_error error = { 0 };
    pw_system *other = mechanism_compile (m, &views[i].view, &error);
    try_run (other, "erk8+projection", TRY_RTOL, 0, &y);
    if (y.status == PW_OK) {
      try_bound (n, views[i].name, try_distance (s, x, other, &y, m, &views[i].view), 1e4 * TRY_RTOL * try_size (s, x));
    } else {
      print_message ("seed %u, %s: %s\n", n->seed, views[i].name, y.error.text);
      n->refused++;
      if (y.status != PW_METHOD || !try_is_nearly_singular (s, x)) n->failed++;
    }
    pw_system_free (other);
  }
}

/* ---- Other methods ---- */

/* The name of a stabilised method, a different one for each `turn`; returns its order. */
static int try_method (unsigned turn, char name[40]) {
  const pw_method *m;
  for (;;)
    for (int i = 0; (m = runs_method (i, name)) != NULL; i++)
      if (strstr (name, "+none") == NULL && turn-- == 0) return m->order;
}

static void try_other (try_count *n, const mechanism *m, pw_system *s, const try_end *x) {
  static const mechanism_view same = { .mirror = 0 };
  char method[40], what[100];
  try_end y;
  int order = try_method (n->seed, method);
  double step = order == 2 ? 1e-4 : 1e-3, bound = 1e-4 * try_size (s, x);
  try_run (s, method, 1e-9, step, &y);
  /* Fast motions take smaller steps; with these, the error of a method that is wrong would remain. */
  if (y.status == PW_OK && try_distance (s, x, s, &y, m, &same) > bound) try_run (s, method, 1e-9, step / 8, &y);
  snprintf (what, sizeof what, "%s is off by", method);
  if (y.status == PW_OK)
    try_bound (n, what, try_distance (s, x, s, &y, m, &same), bound);
  else
    print_message ("seed %u, %s: %s\n", n->seed, method, y.error.text);
}

/* ---- One mechanism ---- */

/* 1 if a motion is prescribed, which other constraints may contradict. */
static int try_prescribed (const mechanism *m) {
  for (int i = 0; i < m->elements; i++)
    if (m->element[i].kind == &pw_kind_drive || m->element[i].kind == &pw_kind_speed) return 1;
  return 0;
}

/* Makes the initial state of the mechanism consistent: which of several contradictory values are kept depends on their
 * order and on zeros, which views change.  Velocities change as little as possible, as by the impulse of a restart.  0
 * if there is no such state. */
static int try_consistent (const pw_system *s, mechanism *m) {
  const size_t n = (size_t)pw_system_coordinates (s);
  pw_run *r = pw_run_open (s, "rk4", NULL, NULL);
  double *q = calloc (2 * n + 1, sizeof *q), *v = q + n;
  assert_non_null (q);
  if (r) {
    memcpy (q, pw_run_initial (r)->q, n * sizeof *q);
    memcpy (v, pw_run_initial (r)->v, n * sizeof *v);
    for (int b = 0; b < m->bodies; b++) memcpy (v + 3 * b, m->body[b].rate, sizeof m->body[b].rate);
  }
  const int good = r && pw_run_restart (r, q, v, NULL) == PW_OK;
  for (int b = 0; good && b < m->bodies; b++) {
    memcpy (m->body[b].start, pw_run_initial (r)->q + 3 * b, sizeof m->body[b].start);
    memcpy (m->body[b].rate, pw_run_initial (r)->v + 3 * b, sizeof m->body[b].rate);
  }
  pw_run_close (r);
  free (q);
  return good;
}

static void try_seed (try_count *n) {
  static const mechanism_view unchanged = { .mirror = 0 };
  mechanism m;
  try_end x;
  pw_error error = { 0 };
  mechanism_make (n->seed, &m);
  pw_system *s = mechanism_compile (&m, &unchanged, &error);
  if (s == NULL) fail_msg ("seed %u: %s", n->seed, error.text);
  if (try_consistent (s, &m)) {
    pw_system_free (s);
    s = mechanism_compile (&m, &unchanged, &error);
  }
  try_run (s, "erk8+projection", TRY_RTOL, 0, &x);
  n->tried++;
  if (x.status == PW_OK) {
    try_bound (n, "position residual", x.statistics.position, 128 * CHECK_EPS);
    try_bound (n, "velocity residual", x.statistics.velocity, 1e-11);
    try_bound (n, "balance", x.balance, 1e4 * TRY_RTOL * fmax (x.energy, 1e-3));
    try_bound (n, "verifier's position", x.verification.position.scaled, 128 * CHECK_EPS);
    try_bound (n, "verifier's velocity", x.verification.velocity.scaled, 1e-10);
    try_bound (n, "verifier's acceleration", x.verification.acceleration.scaled, 1e-9);
    try_bound (n, "verifier's force", x.verification.force.scaled, 1e-8);
    try_views (n, &m, s, &x);
    try_other (n, &m, s, &x);
  } else {
    print_message ("seed %u: %s\n", n->seed, x.error.text);
    n->refused++;
    if (x.status == PW_INITIAL && !try_prescribed (&m)) n->failed++; /* rest is always consistent */
  }
  pw_system_free (s);
}

void mechanism_test (unsigned first, unsigned count) {
  try_count n = { .seed = first };
  for (; n.seed < first + count; n.seed++) try_seed (&n);
  print_message ("%u mechanisms, %u refused\n", n.tried, n.refused);
  assert_int_equal (n.failed, 0);
  check_below ("refused", n.refused, 0.05 * n.tried, "random constraints may be contradictory");
}
