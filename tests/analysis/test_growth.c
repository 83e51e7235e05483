/* Eigenvalues against perturbed runs: each steady motion of the gallery, perturbed along each mode, follows exp (re + i
 * im) t. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "pinwheel-files.h"
#include "runs.h"

enum { GROWTH_COORDINATES = 100, GROWTH_MOTIONS = 4 };

/* A steady motion, its linearisation, and values for runs from it. */
typedef struct {
  const char *model;
  pw_system *s;
  int n, modes;
  double length, worst;
  pw_linear l;
  pw_initial_value base[2 * GROWTH_COORDINATES], initial[2 * GROWTH_COORDINATES];
} growth;

/* The state at time t from the base and `by` times the mode, whose numbers are 2 apart: re, im. */
static void growth_run (growth *g, const double *mode, double by, double t, double *state) {
  for (int j = 0; j < 2 * g->n; j++) {
    g->initial[j] = g->base[j];
    g->initial[j].value += by * mode[2 * j];
  }
  const pw_settings settings = { .rtol = 1e-12, .initial = g->initial, .initials = 2 * g->n, .span = t };
  runs_state (g->s, "erk8+projection", &settings, t, state, state + g->n, NULL);
}

/* Turns the translational part of a perturbation back by the angle of the frame, and makes it dimensionless. */
static void growth_frame (const growth *g, double angle, double rate, double *y) {
  for (int j = 0; j < 2 * g->n; j++) y[j] *= j < g->n ? 1 : 1 / rate;
  for (int b = 0; b < pw_system_bodies (g->s); b++)
    for (int part = 0; part < 2; part++) {
      double *p = y + 3 * b + part * g->n, x = p[0];
      p[0] = (x * cos (angle) + p[1] * sin (angle)) / g->length;
      p[1] = (p[1] * cos (angle) - x * sin (angle)) / g->length;
    }
}

/* The factor c with y = Re (c mode) by least squares, real for a real mode; returns the relative residual. */
static double growth_factor (int size, int real, const double *y, const double *re, const double *im, double c[2]) {
  double rr = 0, ri = 0, ii = 0, yr = 0, yi = 0, yy = 0, off = 0;
  for (int j = 0; j < size; j++) {
    rr += re[j] * re[j], ri -= re[j] * im[j], ii += im[j] * im[j];
    yr += y[j] * re[j], yi -= y[j] * im[j], yy += y[j] * y[j];
  }
  double det = !real ? rr * ii - ri * ri : rr;
  c[0] = !real ? (yr * ii - yi * ri) / det : yr / det;
  c[1] = !real ? (yi * rr - yr * ri) / det : 0;
  for (int j = 0; j < size; j++) off += pow (y[j] - c[0] * re[j] + c[1] * im[j], 2);
  return sqrt (off / yy);
}

/* Central differences over +-1e-5 of the length have errors of 1e-10, and round-off of tolerances 1e-12 / 1e-5. */
static void growth_mode (growth *g, int i) {
  double rate = hypot (g->l.re[i], g->l.im[i]), t = 1 / rate, by = 1e-5 * g->length, c[2];
  double plus[2 * GROWTH_COORDINATES], minus[2 * GROWTH_COORDINATES], re[2 * GROWTH_COORDINATES],
      im[2 * GROWTH_COORDINATES];
  const double *mode = g->l.shape + (size_t)i * 4 * (size_t)g->n;
  growth_run (g, mode, by, t, plus);
  growth_run (g, mode, -by, t, minus);
  for (int j = 0; j < 2 * g->n; j++) {
    plus[j] = (plus[j] - minus[j]) / (2 * by);
    re[j] = mode[2 * j], im[j] = mode[2 * j + 1];
  }
  growth_frame (g, g->l.twist[2] * t, rate, plus);
  growth_frame (g, 0, rate, re);
  growth_frame (g, 0, rate, im);
  double residual = growth_factor (2 * g->n, g->l.im[i] == 0, plus, re, im, c);
  double off =
      hypot (c[0] - exp (g->l.re[i] * t) * cos (g->l.im[i] * t), c[1] - exp (g->l.re[i] * t) * sin (g->l.im[i] * t));
  g->worst = fmax (g->worst, fmax (residual, off / exp (g->l.re[i] * t)));
  g->modes++;
}

static void growth_motion (growth *g, const double *q, const double *v) {
  pw_error error = { 0 };
  for (int j = 0; j < 2 * g->n; j++) g->base[j] = (pw_initial_value){ j, j < g->n ? q[j] : v[j - g->n] };
  pw_run *r = runs_open (g->s, "rk4", &(pw_settings){ .initial = g->base, .initials = 2 * g->n });
  check_ok (pw_run_linear_modes (r, GROWTH_COORDINATES, &g->l, &error), &error);
  assert_int_equal (g->l.steady, PW_STEADY);
  g->length = pw_run_scale (r)->length;
  for (int i = 0; i < g->l.unknowns; i++)
    if (!g->l.rigid[i] && g->l.im[i] >= 0 && (g->l.re[i] != 0 || g->l.im[i] != 0)) growth_mode (g, i);
  pw_linear_free (&g->l);
  pw_run_close (r);
}

typedef struct {
  const char *model, *hold;
  double value; /* of what is held */
  int modes;    /* at least, of all motions: those with an eigenvalue that is not 0, pairs once */
  const char *set[4];
  double to[4];
} growth_case;

static pw_system *growth_open (const growth_case *c) {
  return gallery_open (c->model, c->set[0], c->to[0], c->set[1], c->to[1], c->set[2], c->to[2], NULL);
}

/* All motions found from the initial state and from a few random ones. */
static growth growth_model (const growth_case *c, pw_system *s) {
  pw_error error = { 0 };
  pw_initial_value hold = { .state = c->hold ? pw_system_find_held (s, c->hold, &error) : 0, .value = c->value };
  pw_steady_settings set = { .vary = -1, .hold = &hold, .holds = c->hold != NULL };
  pw_steady_motion m;
  growth g = { .model = c->model, .s = s, .n = pw_system_coordinates (s) };
  double known[GROWTH_MOTIONS][2 * GROWTH_COORDINATES];
  int found = 0;
  assert_true (g.n <= GROWTH_COORDINATES);
  pw_steady *x = pw_steady_open (s, &set, &error);
  check_ok (x ? PW_OK : error.status, &error);
  for (int attempt = 0; attempt < 6 && found < GROWTH_MOTIONS; attempt++) {
    int status = pw_steady_solve (x, attempt, 0, &m, &error), same = 0;
    if (status == PW_RETRY) continue;
    check_ok (status, &error);
    for (int k = 0; k < found; k++) same |= pw_steady_same (x, known[k], known[k] + g.n, m.q, m.v);
    if (same) continue;
    memcpy (known[found], m.q, (size_t)g.n * sizeof *m.q);
    memcpy (known[found++] + g.n, m.v, (size_t)g.n * sizeof *m.v);
  }
  pw_steady_close (x);
  for (int k = 0; k < found; k++) growth_motion (&g, known[k], known[k] + g.n);
  pw_system_free (s);
  return g;
}

/* Drives are at rest. */
TEST (gallery) {
  static const growth_case scene[] = {
    { "car-tyres", NULL, 0, 2, { NULL }, { 0 } },
    { "car-two-trailers", NULL, 0, 2, { "k" }, { 0 } },
    { "chaplygin-sleigh", NULL, 0, 1, { NULL }, { 0 } },
    { "differential-drive", NULL, 0, 1, { NULL }, { 0 } },
    { "pendulum", NULL, 0, 1, { NULL }, { 0 } },
    { "roller-racer", NULL, 0, 2, { "swing", "u0" }, { 0, 2 } },
    { "ezyroller", "frame.speed", 1, 2, { "M0", "m2", "I2" }, { 0, 0.2, 0.01 } },
    { "wheeled-snake", NULL, 0, 14, { "amplitude" }, { 0 } },
    { "n-trailer", NULL, 0, 2, { NULL }, { 0 } },
    { "andrews-squeezer", NULL, 0, 1, { NULL }, { 0 } },
    { "chain", NULL, 0, 10, { NULL }, { 0 } },
    { "elliptic-wire", NULL, 0, 1, { NULL }, { 0 } },
    { "n-four-bar", NULL, 0, 1, { NULL }, { 0 } },
    { "redundant-parallelogram", NULL, 0, 1, { NULL }, { 0 } },
  };
  pw_error error = { 0 };
  pw_file *wire = pw_file_open ("elliptic-wire", &error); /* its own element type stays in memory */
  for (const growth_case *c = scene; c < scene + sizeof scene / sizeof *scene; c++) {
    growth g = growth_model (c, growth_open (c));
    assert_true (g.modes >= c->modes);
    check_below (c->model, g.worst, 1e-6, "runs to 1e-12, divided by displacements of 1e-5");
  }
  pw_file_close (wire);
}
