/* Contacts with friction: a woodpecker toy with element types of this file, random scenes by several methods, scenes
 * without a unique solution. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "pinwheel-selftest.h"
#include "runs.h"
#include "scene.h"

/* ---- A woodpecker toy (Glocker 1995; Glocker 2001, Set-Valued Force Laws) ----
 *
 * Its kinematics are linear: y, phi of the sleeve M and of the bird S; y_S = y_M + lM phi_M + lG phi_S.  The beak
 * touches the pole, and the lower and the upper edge of the sleeve:
 *
 *   g = c + n . q,  u = t . q'        q = (x, y, phi) of both bodies
 *
 * Times of the events and states: the equations of each phase, written by hand, with 50 digits. */

typedef struct {
  const char *name, *body[2];
  double c, n[6], t[6];
  double restitution, mu; /* mu = 0: g = 0 */
} linear;

typedef struct {
  double c, n[6], t[6];
} linear_element;

static int linear_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                           pw_error *error) {
  const linear *x = definition;
  (void)bodies, (void)internal, (void)error;
  linear_element *e = element;
  e->c = x->c;
  memcpy (e->n, x->n, sizeof e->n);
  memcpy (e->t, x->t, sizeof e->t);
  return PW_OK;
}

static double linear_dot (const pw_batch *b, int e, const double *n, double size) {
  double sum = 0;
  for (int i = 0; i < 2; i++) {
    const pw_configuration *c = &b->configuration[b->body[2 * e + i]];
    const double q[] = { c->x, c->y, c->phi };
    for (int k = 0; k < 3; k++) sum += size > 0 ? fabs (n[3 * i + k] * q[k]) : n[3 * i + k] * q[k];
  }
  return sum;
}

static void linear_g (const pw_batch *b, double *out) {
  const linear_element *x = b->element;
  for (int e = 0; e < b->count; e++) out[e] = x[e].c + linear_dot (b, e, x[e].n, 0);
}

static void linear_g_size (const pw_batch *b, double *out) {
  const linear_element *x = b->element;
  for (int e = 0; e < b->count; e++) out[e] = fabs (x[e].c) + linear_dot (b, e, x[e].n, 1);
}

static void linear_J (const pw_batch *b, double *out) {
  const linear_element *x = b->element;
  for (int e = 0; e < b->count; e++) memcpy (out + 6 * e, x[e].n, sizeof x->n);
}

static void linear_J_tangent (const pw_batch *b, double *out) {
  const linear_element *x = b->element;
  for (int e = 0; e < b->count; e++) memcpy (out + 6 * e, x[e].t, sizeof x->t);
}

static void linear_loss (const pw_batch *b, double *out) {
  const linear_element *x = b->element;
  for (int e = 0; e < b->count; e++) {
    out[e] = 0;
    for (int i = 0; i < 2; i++) {
      const pw_configuration *c = &b->configuration[b->body[2 * e + i]];
      out[e] += b->lambda[e] * (x[e].t[3 * i] * c->vx + x[e].t[3 * i + 1] * c->vy + x[e].t[3 * i + 2] * c->omega);
    }
  }
}

static void linear_limits (const void *definition, pw_bounds *limit) {
  const linear *x = definition;
  if (x->mu == 0) return;
  limit->most = 0;
  limit->restitution = x->restitution;
}

static void linear_friction_limits (const void *definition, pw_bounds *limit) {
  const linear *x = definition;
  limit->least = -x->mu, limit->most = x->mu;
  limit->relative = limit->initially_slides = 1;
}

static int linear_rubs (const void *definition) {
  return ((const linear *)definition)->mu > 0;
}

static const pw_field linear_fields[] = {
  { PW_AT (linear, body), PW_BODY, .count = 2, .about = "bodies" },
  { PW_AT (linear, c), PW_NUMBER, .unit = "m", .about = "gap at 0" },
  { PW_AT (linear, n), PW_NUMBER, .count = 6, .about = "derivatives of the gap" },
  { PW_AT (linear, t), PW_NUMBER, .count = 6, .about = "tangential velocity" },
  { PW_AT (linear, restitution), PW_NUMBER, .domain = PW_FRACTION, .about = "restitution" },
  { PW_AT (linear, mu), PW_NUMBER, .domain = PW_NONNEGATIVE, .about = "friction coefficient" },
  { .name = NULL },
};

static const pw_quantity linear_normal[] = { { "N", "N", NULL, "normal force" } },
                         linear_tangential[] = { { "T", "N", NULL, "friction" } };

static const pw_kind linear_friction = {
  .name = "linear",
  .about = "friction of a linear contact",
  .definition = sizeof (linear),
  .element = sizeof (linear_element),
  .fields = linear_fields,
  .bodies = 2,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = linear_tangential,
  .prepare = linear_prepare,
  .J = linear_J_tangent,
  .loss = linear_loss,
  .limits = linear_friction_limits,
};

static const pw_kind linear_contact = {
  .name = "linear",
  .about = "linear contact",
  .definition = sizeof (linear),
  .element = sizeof (linear_element),
  .fields = linear_fields,
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  .reaction = linear_normal,
  .prepare = linear_prepare,
  .g = linear_g,
  .g_size = linear_g_size,
  .J = linear_J,
  .limits = linear_limits,
  .companion = &linear_friction,
  .has_companion = linear_rubs,
};

SCENE (woodpecker) {
  const double mM = 0.0003, mS = 0.0045, JM = 5e-9, JS = 7e-7, r0 = 0.0025, rM = 0.0031, hM = 0.0058, lM = 0.01,
               lG = 0.015, hS = 0.02, lS = 0.0201, mu = 0.3;
  const double phi = -(rM - r0) / hM, beak = -0.2788, vy = -0.3411, omega = -7.4583;
  const char *const both[2] = { "M", "S" };
  pw_add_body (m, &(pw_body){ .name = "M", .mass = mM, .inertia = JM, .start = { 0, 0, phi }, .rate = { 0, vy, 0 } });
  pw_add_body (m, &(pw_body){ .name = "S",
                              .mass = mS,
                              .inertia = JS,
                              .start = { 0, lM * phi + lG * beak, beak },
                              .rate = { 0, vy + lG * omega, omega } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add_rotational_spring (m,
                            &(pw_rotational_spring){ .name = "K", .body = { both[0], both[1] }, .stiffness = 0.0056 });
  pw_add (m, &linear_contact, &(linear){ .name = "bar", .body = { both[0], both[1] }, .n = { 0, 1, lM, 0, -1, lG } });
  pw_add (m, &linear_contact,
          &(linear){ .name = "beak",
                     .body = { both[0], both[1] },
                     .c = lM + lG - lS - r0,
                     .n = { 0, 0, 0, 0, 0, -hS },
                     .t = { 0, 1, lM, 0, 0, lG - lS },
                     .restitution = 0.5,
                     .mu = mu });
  for (int i = 0; i < 2; i++)
    pw_add (m, &linear_contact,
            &(linear){ .name = i ? "upper" : "lower",
                       .body = { both[0], both[1] },
                       .c = rM - r0,
                       .n = { 0, 0, i ? -hM : hM },
                       .t = { 0, 1, rM },
                       .mu = mu });
}

static const double woodpecker_event[] = {
  0.021636314053299524, 0.061213931247964802, 0.067023398144524254, 0.077877992289727945, 0.080988805418649230,
  0.081575328789609301, 0.083416385579125362, 0.118675112948824219, 0.121335470557988878, 0.167389522868870911,
  0.206999848513437361, 0.212830080144206928, 0.223748643919619809, 0.226841494027447104, 0.227414803666511086,
  0.229281419834481529, 0.264594986865061732, 0.267380890511946253, 0.313557149533096228, 0.353136372636157639,
  0.358949178330251997, 0.369813892965034224, 0.372921982835567665, 0.373506479936118281, 0.375351504905811368,
  0.410618978986929174, 0.413299587881339455, 0.459373088366443860, 0.498978408344654794, 0.504805838064530005,
  0.515715623370611853, 0.518811043672106871, 0.519386223122281129, 0.521249265282922621, 0.556555367626591580,
  0.559324382066986698, 0.605483970877928650
};

/* What happens at each of these times, in turn: the first event, and of impacts the sign of the sliding velocity. */
static const struct {
  const char *row, *mode;
  int slip;
} woodpecker_kind[] = { { "linear lower", "sticks", 0 }, { "linear lower", "slides-", 0 },
                        { "linear lower", "free", 0 },   { "linear upper", "free", -1 },
                        { "linear beak", "free", 1 },    { "linear upper", "holds", 1 },
                        { "linear upper", "free", 0 },   { "linear lower", "free", -1 },
                        { "linear lower", "holds", -1 } };
enum { WOODPECKER_KINDS = sizeof woodpecker_kind / sizeof *woodpecker_kind };

static const struct {
  double t, value[6]; /* y, phi of M, phi of S, and their rates */
} woodpecker_state[] = {
  { 0.150,
    { -0.02068579610421250, -0.10344827586206896, -0.31032966614015163, -0.30247800872802796, 0,
      -7.88824367375289072 } },
  { 0.300,
    { -0.04132741608343129, -0.10344827586206896, -0.34237385510784452, -0.25918492260468485, 0,
      -8.34282414371394870 } },
  { 0.600,
    { -0.08178979111183331, -0.10344827586206896, -0.41414149709608175, -0.12484340331282765, 0,
      -9.52037990656143629 } },
};

/* The i-th event after the beginning is what it should be. */
static void woodpecker_check (const pw_system *s, const pw_event *event, int i) {
  const int kind = i % WOODPECKER_KINDS, slip = woodpecker_kind[kind].slip;
  char row[50];
  assert_string_equal (pw_system_row_name (s, event->row, row, sizeof row), woodpecker_kind[kind].row);
  assert_string_equal (pw_system_mode_name (s, event->row, event->to), woodpecker_kind[kind].mode);
  assert_int_equal (event->impact, slip != 0);
  if (slip) assert_true (event[1].impulse * slip < 0); /* of friction */
}

/* The events of a run after its beginning, the first one at each time; returns their number. */
static int woodpecker_events (const pw_system *s, const pw_run *r, double *time, int most) {
  int count, n = 0;
  const pw_event *event = pw_run_events (r, &count);
  for (int i = 0; i < count; i++) {
    if (event[i].t < 1e-9 || n == most || (n > 0 && event[i].t < time[n - 1] + 1e-9)) continue;
    woodpecker_check (s, event + i, n);
    time[n++] = event[i].t;
  }
  return n;
}

/* Numbers compared with the 69 of the toy: start, times of events, states, cycle. */
static int woodpecker_compared;

static void woodpecker_start (const pw_system *s, const pw_run *r) {
  static const char *const mode[] = { "free", "holds", "free", "slides+", "slides-", "slides+" };
  for (int row = 1; row < pw_system_rows (s); row++) /* beak, lower, upper; their friction; where free, it has none */
    assert_string_equal (pw_system_mode_name (s, row, pw_run_mode (r, row)), mode[row - 1]);
}

static double woodpecker_run (const char *method, double step, double rtol, double bound, const char *reason) {
  enum { COUNT = sizeof woodpecker_event / sizeof *woodpecker_event, STATES = 3 };
  static const int of[6] = { 1, 2, 5, 1, 2, 5 };
  double time[COUNT + 10], most = 0;
  int count;
  pw_system *s = scene_system (&woodpecker_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .rtol = rtol, .span = 0.606, .ledger = 1 });
  woodpecker_start (s, r);
  for (int i = 0; i < STATES; i++) {
    const pw_sample x = runs_to (r, woodpecker_state[i].t);
    for (int k = 0; k < 6; k++)
      check_close (check_text ("%s, number %d at %g s", method, k, x.t), k < 3 ? x.q[of[k]] : x.v[of[k]],
                   woodpecker_state[i].value[k], 1000 * bound, "velocities up to 20 rad/s, accelerations 1e3");
    check_close (check_text ("%s, balance", method), x.balance / x.kinetic, 0, 1e4 * bound, "losses are counted");
  }
  (void)runs_to (r, 0.606);
  count = woodpecker_events (s, r, time, COUNT + 10);
  if (count != COUNT) print_error ("%s: %d events\n", method, count);
  for (int i = 0; i < COUNT && i < count; i++) {
    check_close (check_text ("%s, event %d", method, i + 1), time[i], woodpecker_event[i], bound, reason);
    most = fmax (most, fabs (time[i] - woodpecker_event[i]));
  }
  assert_int_equal (count, COUNT);
  woodpecker_compared = 1 + STATES * 6 + COUNT;
  runs_close (r, s);
  return most;
}

TEST (woodpecker_to_round_off) {
  woodpecker_run ("erk8+projection", 0, 1e-12, 1e-11, "10 rtol: impacts amplify errors");
  woodpecker_run ("radau+ggl", 0, 1e-12, 1e-11, "10 rtol: impacts amplify errors");
}

/* The periodic motion that it approaches: the distance from it shrinks by a factor of about 0.84 in each cycle. */
TEST (woodpecker_cycle) {
  static const double time[] = { 0,
                                 0.0058207572348098022545,
                                 0.016709825280643503296,
                                 0.019811178939636432686,
                                 0.020390700477988666383,
                                 0.022245391272032776592,
                                 0.057533801960158213397,
                                 0.060262535991420886919,
                                 0.10638265814428988435,
                                 0.14597606514375182353 };
  static const double state[] = { 0.019445379284716526658, -0.20513534924352575665, 17.574666205576077863 };
  enum { CYCLES = 130, TIMES = sizeof time / sizeof *time, MOST = (CYCLES + 1) * WOODPECKER_KINDS };
  static double at[MOST];
  double now[3], before = 0;
  pw_error error = { 0 };
  pw_sample x;
  pw_system *s = scene_system (&woodpecker_table, NULL);
  pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = CYCLES * 0.146 });
  int known = 0, slips = 0, all;
  while (slips < CYCLES) {
    check_ok (pw_run_advance (r, CYCLES, &error), &error);
    const pw_event *event = pw_run_events (r, &all);
    if (all == known || event[all - 1].from || !event[all - 1].to || event[all - 1].row != event[1].row) continue;
    known = all, slips++; /* the lower contact, which has stuck, begins to slide */
    check_ok (pw_run_sample (r, event[all - 1].t, &x, &error), &error);
    now[0] = before - x.q[1], now[1] = x.q[5], now[2] = x.v[5];
    before = x.q[1];
  }
  const int count = woodpecker_events (s, r, at, MOST);
  for (int i = 0; i < TIMES; i++)
    check_close (check_text ("cycle, event %d", i), at[count - TIMES + i] - at[count - TIMES], time[i], 1e-11,
                 "impacts amplify errors");
  check_close ("drop", now[0], state[0], 1e-11, "the same");
  check_close ("phi", now[1], state[1], 1e-12, "it follows from the friction there");
  check_close ("omega", now[2], state[2], 2e-10, "accelerations of 1e3 rad/s^2");
  assert_int_equal (woodpecker_compared + TIMES + 3, 69);
  runs_close (r, s);
}

/* All methods but leapfrog and moreau, which refuse. */
TEST (woodpecker_methods) {
  char method[40];
  for (int i = 0; runs_method (i, method); i++) {
    if (strncmp (method, "leapfrog", 8) == 0 || strncmp (method, "moreau", 6) == 0) continue;
    const int second = runs_method (i, method)->order == 2;
    woodpecker_run (method, 1e-4, 1e-10, second ? 2e-5 : 2e-8,
                    second ? "(h k)^2, k up to 50/s" : "(h k)^4; 200 rtol of multistep methods");
  }
}

/* Friction that depends on normal forces does not lower the order. */
TEST (orders) {
  static const struct {
    const char *method;
    double step;
    int order;
  } of[] = { { "rk4+projection", 4e-4, 4 }, { "radau+ggl:steps=fixed", 8e-4, 5 }, { "galpha+ggl", 4e-5, 2 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    double error[2];
    for (int n = 0; n < 2; n++) error[n] = woodpecker_run (of[i].method, of[i].step / (n ? 2 : 1), 0, 1e-4, "no bound");
    check_close (check_text ("order of %s", of[i].method), log2 (error[0] / error[1]), of[i].order, 0.5,
                 "at these steps");
  }
}

TEST (derivatives) {
  pw_error error = { 0 };
  pw_selftest_report report = { 0 };
  for (int seed = 1; seed < 4; seed++)
    check_ok (pw_selftest (&linear_contact, (unsigned)seed, &report, &error), &error);
  assert_int_equal (report.failed, 0);
}

TEST (leapfrog_refuses) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&woodpecker_table, NULL);
  assert_null (pw_run_open (s, "leapfrog", NULL, &error));
  check_error (&error, PW_INPUT, "leapfrog: the friction of linear beak depends on a reaction; use galpha or rk4");
  pw_system_free (s);
}

/* ---- Painleve's rod, which slides on one end: of length 1, at 50 degrees friction 2.3 is too much ---- */

typedef struct {
  double v, mu, tilt;
} rod_parameters;

static const pw_parameter rod_list[] = { { PW_AT (rod_parameters, v), -1, "m/s", "velocity", PW_REAL },
                                         { PW_AT (rod_parameters, mu), 2.3, "", "friction", PW_REAL },
                                         { PW_AT (rod_parameters, tilt), 50, "", "angle", PW_REAL },
                                         { .name = NULL } };

SCENE_WITH (rod, rod_list, rod_parameters) {
  const double phi = p->tilt * PW_PI / 180;
  pw_add_body (
      m,
      &(pw_body){
          .name = "rod", .mass = 1, .inertia = 1. / 12, .start = { 0, 0.5 * sin (phi), phi }, .rate = { p->v, 0, 0 } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add_contact (m, &(pw_contact){ .name = "tip", .body = { "rod", "ground" }, .at = { { -0.5 } }, .mu = p->mu });
}

/* A_nn - mu A_nt = 1 + 3 cos^2 - 3 mu sin cos: positive for mu = 1.51, negative for 1.52. */
TEST (painleve) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&rod_table, "mu", 1.51, NULL);
  runs_close (runs_open (s, "erk8+projection", NULL), s);
  s = scene_system (&rod_table, "mu", 1.52, NULL);
  assert_null (pw_run_open (s, "erk8+projection", NULL, &error));
  check_error (&error, PW_METHOD,
               "t = 0 s: whether contact tip holds cannot be decided: with this friction there is no solution "
               "(Painleve)");
  pw_system_free (s);
  s = scene_system (&rod_table, "v", 1., NULL); /* in the other direction */
  runs_close (runs_open (s, "erk8+projection", NULL), s);
  s = scene_system (&rod_table, "v", 0., NULL); /* it sticks */
  runs_close (runs_open (s, "erk8+projection", NULL), s);
}

/* ---- Contacts beside wheels with a grip ---- */

typedef struct {
  double mu, rolls;
} beside_parameters;

static const pw_parameter beside_list[] = { { PW_AT (beside_parameters, mu), 0.2, "", "friction of the disc", PW_REAL },
                                            { PW_AT (beside_parameters, rolls), 0, "", "1: rolling wheel", PW_REAL },
                                            { .name = NULL } };

SCENE_WITH (beside, beside_list, beside_parameters) {
  const pw_signal grip = { PW_HARMONIC, .harmonic = { .amplitude = 0.1, .omega = 3, .offset = 0.3 } };
  pw_add_body (
      m, &(pw_body){
             .name = "sled", .mass = 1, .inertia = 0.5, .rate = { 2, p->rolls != 0 ? 0 : 0.5, 2 }, .specified = 0x39 });
  pw_add_body (
      m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 0.005, .start = { 0, 10.1, 0 }, .rate = { 2, 0, 15 } });
  if (p->rolls != 0)
    pw_add_rolling_wheel (
        m, &(pw_rolling_wheel){ .name = "R", .body = "sled", .radius = 0.1, .inertia = 0.01, .grip = grip });
  else
    pw_add_wheel (m, &(pw_wheel){ .name = "R", .body = "sled", .at = { -0.25 }, .grip = grip });
  pw_add_force (m, &(pw_force){ .name = "weight", .body = "disc", .fy = { .constant = -9.81 } });
  pw_add_contact (
      m,
      &(pw_contact){
          .name = "floor", .body = { "disc", "ground" }, .at = { { 0, 0 }, { 0, 10 } }, .radius = 0.1, .mu = p->mu });
}

/* A limit that varies does not disturb the friction of a contact that slides, nor that friction the limit: the disc
 * ends as if alone, rolling at (m v0 - I w0 / R) / (m + I / R^2) = 5/6 m/s, the sled as beside a smooth one. */
TEST (limits_that_vary) {
  static const char *const method[] = { "erk8+projection", "radau+ggl", "ida+ggl" };
  for (int i = 0; i < 3; i++) {
    double q[2][3];
    for (int rough = 0; rough < 2; rough++) {
      pw_system *s = scene_system (&beside_table, "mu", rough ? 0.2 : 0., NULL);
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .rtol = 1e-10, .span = 2, .ledger = 1 });
      const pw_sample x = runs_to (r, 2);
      check_close (method[i], x.balance, 0, 1e-7, "losses are counted");
      check_close (method[i], x.v[3], rough ? 5. / 6 : 2, 1e-7, "1e3 rtol");
      memcpy (q[rough], x.q, sizeof q[rough]);
      runs_close (r, s);
    }
    for (int j = 0; j < 3; j++) check_close (method[i], q[1][j], q[0][j], 1e-6, "1e4 rtol, different steps");
  }
}

/* The same beside a rolling wheel with a grip, a friction circle: both are in one decision. */
TEST (circle_beside_friction) {
  double v[2][6];
  for (int rough = 0; rough < 2; rough++) {
    pw_system *s = scene_system (&beside_table, "rolls", 1., "mu", rough ? 0.2 : 0., NULL);
    pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-10, .span = 2, .ledger = 1 });
    const pw_sample x = runs_to (r, 2);
    memcpy (v[rough], x.v, sizeof v[rough]);
    runs_close (r, s);
  }
  check_close ("disc", v[1][3], 5. / 6, 1e-7, "1e3 rtol");
  for (int j = 0; j < 3; j++) check_close ("sled", v[1][j], v[0][j], 1e-6, "1e4 rtol, different steps");
}

/* The impacts of some strength, of normal forces: how many weak ones follow before a contact rests depends on the
 * tolerance. */
static int contacts_impacts (const pw_system *s, const pw_run *r, double *time, int *row, int most) {
  int count, n = 0;
  const pw_event *event = pw_run_events (r, &count);
  for (int i = 0; i < count && n < most; i++)
    if (event[i].impulse > 0.05 && event[i].row < pw_system_holonomic (s))
      time[n] = event[i].t, row[n++] = event[i].row;
  return n;
}

/* ---- A car whose driven wheel has a grip bumps into a wall and scrapes along it ---- */

SCENE (bump) {
  const double angle = 0.5;
  pw_add_body (m, &(pw_body){ .name = "car",
                              .mass = 1,
                              .inertia = 0.1,
                              .start = { 0, 0, angle },
                              .rate = { 2 * cos (angle), 2 * sin (angle) } });
  pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "R",
                                                .body = "car",
                                                .at = { -0.3 },
                                                .radius = 0.1,
                                                .inertia = 0.002,
                                                .grip = { .constant = 2 },
                                                .torque = { .constant = 0.15 } });
  for (int i = 0; i < 2; i++)
    pw_add_contact (m, &(pw_contact){ .name = i ? "tail" : "wall",
                                      .body = { "car", "ground" },
                                      .at = { { i ? -0.3 : 0.3 }, { 1.5 } },
                                      .heading = PW_PI / 2,
                                      .radius = 0.1,
                                      .mu = 0.3,
                                      .restitution = 0.2 });
}

TEST (circle_and_friction) {
  static const struct {
    const char *method;
    double step, rtol;
  } of[] = {
    { "erk8+projection", 0, 1e-11 }, { "radau+ggl", 0, 1e-10 }, { "ida+ggl", 0, 1e-10 }, { "rk4+projection", 1e-4, 0 }
  };
  static double time[2][50];
  static int row[2][50];
  pw_system *s = scene_system (&bump_table, NULL);
  double q[3];
  int impacts = 0;
  for (int i = 0; i < 4; i++) {
    const pw_settings set = { .step = of[i].step, .rtol = of[i].rtol, .span = 3, .ledger = 1 };
    pw_run *r = runs_open (s, of[i].method, &set);
    const pw_sample x = runs_to (r, 3);
    const int n = contacts_impacts (s, r, time[i > 0], row[i > 0], 50);
    if (i == 0) impacts = n, memcpy (q, x.q, sizeof q);
    assert_int_equal (n, impacts);
    for (int k = 0; k < n; k++) check_close (of[i].method, time[i > 0][k], time[0][k], 1e-6, "1e4 rtol");
    for (int j = 0; j < 3; j++) check_close (of[i].method, x.q[j], q[j], 1e-5, "1e4 rtol, order 2 of rk4 in circles");
    check_close (of[i].method, x.balance, 0, 1e-6, "losses are counted");
    pw_run_close (r);
  }
  assert_true (impacts >= 2);
  pw_system_free (s);
}

/* ---- Random scenes: a block and a disc thrown on an inclined ground with a round obstacle and a wall ---- */

static double contacts_random (unsigned *state) {
  *state = *state * 1664525u + 1013904223u;
  return (double)(*state >> 8) / (1 << 24);
}

static unsigned contacts_seed;

SCENE (contacts_thrown) {
  unsigned *x = &contacts_seed;
  const double half[2] = { 0.1 + 0.3 * contacts_random (x), 0.1 + 0.3 * contacts_random (x) },
               mass = 0.5 + contacts_random (x), radius = 0.1 + 0.2 * contacts_random (x),
               slope = 0.4 * contacts_random (x) - 0.2;
  pw_contact contact = { .restitution = 0.7 * contacts_random (x), .mu = contacts_random (x) };
  if (contacts_random (x) < 0.5) contact.mu_sliding = 0.7 * contact.mu;
  pw_add_body (m, &(pw_body){ .name = "block",
                              .mass = mass,
                              .inertia = mass * (half[0] * half[0] + half[1] * half[1]) / 3,
                              .start = { 0, 0.8 + contacts_random (x), 6 * contacts_random (x) },
                              .rate = { 2 * contacts_random (x) - 1, 0, 8 * contacts_random (x) - 4 } });
  pw_add_body (m, &(pw_body){ .name = "disc",
                              .mass = 1,
                              .inertia = radius * radius / 2,
                              .start = { 1.2, 0.8 + contacts_random (x), 0 },
                              .rate = { -1.5 * contacts_random (x), 0, 20 * contacts_random (x) - 10 } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { -9.81 * sin (slope), -9.81 * cos (slope) } });
  static const char *const name[] = { "c0", "c1", "c2", "c3", "w0", "w1", "w2", "w3" };
  for (int i = 0; i < 8; i++) {
    contact.name = name[i];
    contact.body[0] = "block", contact.body[1] = "ground";
    contact.at[0][0] = i & 1 ? half[0] : -half[0], contact.at[0][1] = i & 2 ? half[1] : -half[1];
    contact.at[1][0] = i < 4 ? 0 : -1.5, contact.heading = i < 4 ? 0 : -PW_PI / 2;
    pw_add_contact (m, &contact);
  }
  contact.body[0] = "disc", contact.radius = radius;
  contact.at[0][0] = contact.at[0][1] = contact.at[1][0] = contact.heading = 0;
  contact.name = "g0";
  pw_add_contact (m, &contact);
  contact.name = "hill", contact.other_radius = 0.3, contact.at[1][0] = 2;
  pw_add_contact (m, &contact);
}

/* Methods find the same impacts, dissipate what the motion loses, and end at the same place; no run fails. */
TEST (random_scenes) {
  enum { MOST = 200, SCENES = 40 };
  static const struct {
    const char *method;
    double step, rtol;
  } of[] = {
    { "erk8+projection", 0, 1e-11 }, { "rk4+projection", 5e-4, 0 }, { "radau+ggl", 0, 1e-10 }, { "ida+ggl", 0, 1e-10 }
  };
  static double time[2][MOST];
  static int row[2][MOST];
  for (unsigned scene = 0; scene < SCENES; scene++) {
    contacts_seed = 1000 * scene + 17;
    pw_system *s = scene_system (&contacts_thrown_table, NULL);
    double q[6];
    int count = 0;
    for (int i = 0; i < 4; i++) {
      const char *what = check_text ("scene %u, %s", scene, of[i].method);
      const pw_settings set = { .step = of[i].step, .rtol = of[i].rtol, .span = 2, .ledger = 1 };
      pw_run *r = runs_open (s, of[i].method, &set);
      const pw_sample x = runs_to (r, 2);
      check_close (what, x.balance, 0, 1e-6, "losses are counted");
      const int n = contacts_impacts (s, r, time[i > 0], row[i > 0], MOST);
      if (i == 0) count = n, memcpy (q, x.q, sizeof q);
      if (n != count) print_error ("%s: %d impacts, not %d\n", what, n, count);
      assert_int_equal (n, count);
      for (int e = 0; e < n && i > 0; e++) {
        assert_int_equal (row[1][e], row[0][e]);
        check_close (what, time[1][e], time[0][e], 1e-4, "of the order of 1e-8, amplified by some tens of impacts");
      }
      for (int j = 0; j < 6; j++) check_close (what, x.q[j], q[j], 1e-4, "as the times");
      pw_run_close (r);
    }
    pw_system_free (s);
  }
}

/* ---- Four discs in a row: impacts that follow each other within less than the tolerance ---- */

static double contacts_gap;

SCENE (contacts_row) {
  static const char *const name[] = { "a", "b", "c", "d" }, *const between[] = { "ab", "bc", "cd" };
  for (int i = 0; i < 4; i++) {
    pw_add_body (m, &(pw_body){ .name = name[i],
                                .mass = 1,
                                .inertia = 0.01,
                                .start = { i == 0 ? -1 : (0.2 + contacts_gap) * (i - 1) },
                                .rate = { i == 0 } });
    if (i > 0)
      pw_add_contact (m, &(pw_contact){ .name = between[i - 1],
                                        .body = { name[i - 1], name[i] },
                                        .radius = 0.1,
                                        .other_radius = 0.1,
                                        .restitution = 1 });
  }
}

/* However small the gaps, each disc stops at the next one, and the last one leaves with the velocity of the first. */
TEST (row_of_discs) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "radau+ggl", "bdf+projection", "ida+ggl" };
  static const double gap[] = { 1e-10, 1e-8, 1e-6, 1e-4 };
  for (int i = 0; i < 4; i++) {
    contacts_gap = gap[i];
    pw_system *s = scene_system (&contacts_row_table, NULL);
    for (int m = 0; m < 5; m++) {
      const char *what = check_text ("gap %g, %s", gap[i], method[m]);
      pw_run *r = runs_open (s, method[m], &(pw_settings){ .span = 2 });
      const pw_sample x = runs_to (r, 2);
      for (int body = 0; body < 4; body++)
        check_close (what, x.v[3 * body], body == 3, 2e-4, "rtol 1e-6, relative to the radius, thrice");
      pw_run_close (r);
    }
    pw_system_free (s);
  }
}

const check_fixture fixture = { NULL, NULL };
