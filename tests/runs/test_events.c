/* Events of equations whose multipliers have limits: wheels that slide, friction that sticks, stops, ropes,
 * freewheels. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pinwheel-selftest.h"
#include "random_vehicle.h"
#include "runs.h"
#include "scene.h"

/* ---- The numbers of tests/runs/events.txt ---- */

enum { EVENTS_MOST = 64, EVENTS_NUMBERS = 50, EVENTS_INTEGRALS = 2 };

typedef struct {
  char where[10], name[30]; /* "at", "before", ...; a column, or "t" of a crossing */
  double at, value;         /* the time, the number of the event or of the crossing */
} events_number;

typedef struct {
  char scene[40], sets[80], crossing[30], after[EVENTS_MOST][10]; /* after: sign or element, or "" */
  double t_end, last, time[EVENTS_MOST];                          /* last: NaN if not given */
  int events, numbers, crossings;
  events_number number[EVENTS_NUMBERS];
} events_problem;

static events_problem events_problems[45];
static int events_count;

/* Sets of numbers, and their sizes.  Of the rocking block, 10, four more are in test_housner; 69 of the woodpecker toy
 * are in test_contacts.c. */
static struct {
  const char *name;
  int size, read;
} events_set[] = { { "1a", 11, 0 }, { "1b", 27, 0 },  { "2a", 6, 0 },  { "2b", 4, 0 },  { "2c", 8, 0 },
                   { "2d", 17, 0 }, { "3a", 48, 0 },  { "3b", 17, 0 }, { "4", 18, 0 },  { "5", 25, 0 },
                   { "6a", 28, 0 }, { "6b", 33, 0 },  { "6c", 27, 0 }, { "7a", 41, 0 }, { "7b", 82, 0 },
                   { "7c", 93, 0 }, { "7d", 133, 0 }, { "8a", 8, 0 },  { "8b", 5, 0 },  { "8c", 12, 0 },
                   { "9", 12, 0 },  { "9b", 22, 0 },  { "10", 21, 0 }, { "12", 19, 0 }, { "13", 13, 0 },
                   { "14a", 9, 0 }, { "14b", 10, 0 }, { "-", 147, 0 } };
enum { EVENTS_SETS = sizeof events_set / sizeof *events_set - 1 }; /* the last: numbers of no set */

static void events_add (events_problem *p, const char *where, double at, const char *name, double value, int *read) {
  events_number *n = &p->number[p->numbers++];
  assert_true (p->numbers <= EVENTS_NUMBERS);
  snprintf (n->where, sizeof n->where, "%s", where);
  snprintf (n->name, sizeof n->name, "%s", name);
  n->at = at, n->value = value;
  ++*read;
}

/* The numbers of a line: read counts them. */
static void events_read_line (events_problem *p, char *line, int *read) {
  const char *where = strtok (line, " \n"), *name = strcmp (where, "crossing") == 0 ? strtok (NULL, " \n") : NULL;
  double at = strtod (strtok (NULL, " \n"), NULL);
  if (strcmp (where, "event") == 0) {
    const char *after = strtok (NULL, " \n");
    p->time[p->events] = at;
    snprintf (p->after[p->events++], sizeof *p->after, "%s", after ? after : "");
    *read += after ? 2 : 1;
    return;
  }
  if (strcmp (where, "last") == 0) p->last = at, ++*read;
  if (name) {
    const double t = at;
    snprintf (p->crossing, sizeof p->crossing, "%s", name);
    at = ++p->crossings;
    if (!isnan (t)) events_add (p, where, at, "t", t, read);
  }
  while ((name = strtok (NULL, " \n"))) events_add (p, where, at, name, strtod (strtok (NULL, " \n"), NULL), read);
}

static int events_read (void) {
  char line[200], name[4];
  FILE *f = fopen ("tests/runs/events.txt", "r");
  assert_non_null (f);
  int set = EVENTS_SETS;
  while (fgets (line, sizeof line, f)) {
    if (line[0] == '#') continue;
    if (sscanf (line, "set %3s", name) == 1)
      for (set = 0; strcmp (events_set[set].name, name) != 0; set++) assert_in_range (set, 0, EVENTS_SETS - 1);
    else if (strncmp (line, "problem", 7) == 0) {
      events_problem *p = &events_problems[events_count++];
      p->last = NAN;
      set = EVENTS_SETS;
      assert_true (sscanf (line, "problem %39s %lf %79[^\n]", p->scene, &p->t_end, p->sets) >= 2);
    } else
      events_read_line (&events_problems[events_count - 1], line, &events_set[set].read);
  }
  fclose (f);
  return 0;
}

/* Nothing is missing in the file. */
TEST (numbers) {
  int total = 69 + 4;
  for (int i = 0; i < EVENTS_SETS; i++) {
    if (events_set[i].read != events_set[i].size) print_error ("set %s\n", events_set[i].name);
    assert_int_equal (events_set[i].read, events_set[i].size);
    total += events_set[i].size;
  }
  assert_int_equal (total, 822);
  assert_int_equal (events_set[EVENTS_SETS].read, events_set[EVENTS_SETS].size);
}

/* A run whose numbers are compared. */
typedef struct {
  const events_problem *p;
  const char *method, *reason;
  double bound, most; /* of times, ten times it of others; the largest error of a time */
  pw_system *s;
  pw_run *r;
  pw_workspace *w;
  pw_column column[EVENTS_NUMBERS], crossed; /* crossed: that whose crossings are sought */
  double before[EVENTS_NUMBERS];             /* values at the end of the last step */
  pw_crossing crossing;
  int events, crossings, compared, positive, integrals, integral[EVENTS_INTEGRALS]; /* integral: outputs */
  double since;                                                                     /* the last crossing */
} events_check;

static double events_column (events_check *c, const pw_sample *x, pw_column column) {
  double value;
  pw_error error = { 0 };
  check_ok (pw_workspace_columns (c->w, x, &column, 1, &value, &error), &error);
  return value;
}

static void events_compare (events_check *c, int i, double value) {
  const events_number *n = &c->p->number[i];
  const int is_time = strcmp (n->name, "t") == 0 || strcmp (n->name, "period") == 0;
  check_close (check_text ("%s, %s %s, %s %g %s", c->method, c->p->scene, c->p->sets, n->where, n->at, n->name), value,
               n->value, (is_time ? 1 : 10) * c->bound, is_time ? c->reason : "velocities between events");
  c->compared++;
}

/* The numbers of a place, of which this is the sample. */
static void events_compare_at (events_check *c, const char *where, double at, double t) {
  pw_sample x;
  pw_error error = { 0 };
  int count;
  const pw_event *event = pw_run_events (c->r, &count);
  for (int i = 0; i < c->p->numbers; i++) {
    const events_number *n = &c->p->number[i];
    if (strcmp (n->where, where) != 0 || n->at != at) continue;
    check_ok (pw_run_sample (c->r, t, &x, &error), &error);
    double value;
    if (strcmp (n->name, "events") == 0)
      value = count;
    else if (strcmp (n->name, "holds") == 0)
      value = pw_run_mode (c->r, event[count - 1].row) == 0;
    else if (strcmp (n->name, "impulse") == 0)
      value = fabs (event[(int)at - 1].impulse);
    else if (strcmp (n->name, "t") == 0)
      value = t;
    else if (strcmp (n->name, "period") == 0)
      value = t - c->since;
    else if (strncmp (n->name, "integral:", 9) == 0)
      value = x.integral[c->column[i].index];
    else if (strcmp (n->where, "before") == 0)
      value = c->before[i];
    else
      value = events_column (c, &x, c->column[i]) / (strcmp (n->where, "ratio") == 0 ? c->before[i] : 1);
    events_compare (c, i, value);
  }
}

/* An event that the last step begins with; k from 0. */
static void events_event (events_check *c, const pw_event *event, int k) {
  const events_problem *p = c->p;
  char row[100];
  if (k >= p->events) return;
  const char *what = check_text ("%s, %s %s, event %d", c->method, p->scene, p->sets, k + 1), *after = p->after[k];
  check_close (what, event->t, p->time[k], c->bound, c->reason);
  c->most = fmax (c->most, fabs (event->t - p->time[k]));
  (void)pw_system_row_name (c->s, event->row, row, sizeof row);
  const char *mode = pw_system_mode_name (c->s, event->row, event->to);
  if (strcmp (after, "1") == 0 || strcmp (after, "-1") == 0) {
    if (!strchr (mode, *after == '1' ? '+' : '-')) print_error ("%s: %s\n", what, mode);
    assert_non_null (strchr (mode, *after == '1' ? '+' : '-'));
  } else
    assert_non_null (strstr (row, after));
  events_compare_at (c, "before", k + 1, event->t);
  events_compare_at (c, "after", k + 1, event->t);
  events_compare_at (c, "ratio", k + 1, event->t);
}

static double events_crossed (void *context, const pw_sample *x) {
  events_check *c = context;
  return events_column (c, x, c->crossed);
}

/* After a step, or before the first one. */
static void events_step (events_check *c) {
  pw_sample x = { .t = NAN };
  pw_error error = { 0 };
  int count;
  const pw_event *event = pw_run_events (c->r, &count);
  for (; c->events < count; c->events++) events_event (c, &event[c->events], c->events);
  for (int i = 0; i < c->p->numbers; i++) {
    const char *where = c->p->number[i].where;
    if ((*where != 'b' && *where != 'r') || c->p->number[i].at != count + 1) continue;
    if (isnan (x.t)) check_ok (pw_run_sample (c->r, pw_run_time (c->r), &x, &error), &error);
    c->before[i] = events_column (c, &x, c->column[i]);
  }
  if (c->crossings == c->p->crossings) return;
  if (c->positive) {
    check_ok (pw_run_sample (c->r, pw_run_time (c->r), &x, &error), &error);
    if (events_crossed (c, &x) > 0) return;
    c->positive = c->crossing.begun = 0;
  }
  double t;
  check_ok (pw_run_find_crossing (c->r, &c->crossing, &t, &error), &error);
  if (isnan (t)) return;
  events_compare_at (c, "crossing", ++c->crossings, t);
  c->since = t, c->positive = 1;
}

static void events_advance (events_check *c, double t) {
  pw_error error = { 0 };
  while (pw_run_time (c->r) < t) {
    check_ok (pw_run_advance (c->r, t, &error), &error);
    events_step (c);
  }
}

static void events_integrand (void *context, const pw_sample *x, double *value) {
  const events_check *c = context;
  for (int i = 0; i < c->integrals; i++) value[i] = x->output[c->integral[i]];
}

/* Finds the columns, and the outputs whose integrals are compared. */
static void events_columns (events_check *c) {
  static const char *const others[] = { "t", "events", "holds", "impulse", "period" };
  pw_error error = { 0 };
  for (int i = 0; i < c->p->numbers; i++) {
    const char *name = c->p->number[i].name;
    int known = 0;
    for (size_t k = 0; k < sizeof others / sizeof *others; k++) known |= strcmp (name, others[k]) == 0;
    if (known) continue;
    const int integral = strncmp (name, "integral:", 9) == 0;
    check_ok (pw_system_find_column (c->s, name + (integral ? 9 : 0), &c->column[i], &error), &error);
    if (!integral) continue;
    assert_in_range (c->integrals, 0, EVENTS_INTEGRALS - 1);
    c->integral[c->integrals] = c->column[i].index;
    c->column[i].index = c->integrals++;
  }
  if (c->p->crossings > 0) check_ok (pw_system_find_column (c->s, c->p->crossing, &c->crossed, &error), &error);
}

/* 1 for contacts with friction. */
static int events_rubs (const events_problem *p) {
  return strcmp (p->scene, "rolling") == 0 || strcmp (p->scene, "rocking") == 0 || strcmp (p->scene, "zero") == 0;
}

/* Runs a problem, and compares its numbers; returns the largest error of the times of its events. */
static double events_run (const events_problem *p, const char *method, const pw_settings *settings, double bound,
                          const char *reason) {
  pw_error error = { 0 };
  events_check c = { .p = p, .method = method, .reason = reason, .bound = bound };
  c.s = runs_scene (p->scene, p->sets), c.w = pw_workspace_new (c.s, &error);
  events_columns (&c);
  pw_settings set = *settings;
  set.span = p->t_end, set.ledger = 1;
  set.integrals = c.integrals, set.integrand = events_integrand, set.integrand_context = &c;
  c.r = runs_open (c.s, method, &set);
  c.crossing.value = events_crossed, c.crossing.context = &c;
  events_step (&c);
  for (int i = 0; i < p->numbers; i++) {
    const events_number *n = &p->number[i];
    if (strcmp (n->where, "at") != 0 || (i > 0 && n[-1].at == n->at && strcmp (n[-1].where, "at") == 0)) continue;
    events_advance (&c, n->at);
    events_compare_at (&c, "at", n->at, n->at);
  }
  events_advance (&c, p->t_end);
  const char *what = check_text ("%s, %s %s", method, p->scene, p->sets);
  const double rest = (events_rubs (p) ? 100 : 10) * sqrt (fmax (10 * set.rtol, 1e-13)); /* of distances */
  int count;
  const pw_event *event = pw_run_events (c.r, &count);
  if (!isnan (p->last)) {
    check_close (check_text ("%s, last event", what), event[count - 1].t, p->last, bound + rest,
                 "the rest of the series, as many times the shortest motion that is resolved");
    while (event[count - 1].t > p->time[p->events - 1] + 1e-3) count--;
  }
  if (count != p->events) print_error ("%s: %d events\n", what, count);
  assert_int_equal (count, p->events);
  assert_int_equal (c.compared, p->numbers);
  check_close (check_text ("%s, balance", what), runs_to (c.r, p->t_end).balance, 0, 200 * bound,
               "losses by sliding and impacts are counted");
  pw_workspace_free (c.w);
  runs_close (c.r, c.s);
  return c.most;
}

static void events_all (const char *method, double step, double rtol, double bound, const char *reason) {
  for (int i = 0; i < events_count; i++) {
    /* the block only touches the speed of the belt, repeatedly: round-off decides whether it sticks for a moment */
    if (strncmp (method, "radau", 5) == 0 && strcmp (events_problems[i].sets, "vb=0.5 Fs=1 Fk=1") == 0) continue;
    events_run (&events_problems[i], method, &(pw_settings){ .step = step, .rtol = rtol }, bound, reason);
  }
}

TEST (fixed_steps) {
  events_all ("rk4+projection", 1e-3, 0, 1e-9, "(h k)^4 at h = 1e-3 and k up to 6/s");
  events_all ("radau+ggl:steps=fixed", 1e-3, 0, 1e-9, "h^5");
}

TEST (to_round_off) {
  events_all ("erk8+projection", 0, 1e-12, 5e-12, "5 rtol");
}

/* The first of each scene, and those whose impacts accumulate; all methods but moreau, which locates no events
 * (test_moreau.c). */
TEST (all_methods) {
  char method[40];
  for (int i = 0; runs_method (i, method); i++) {
    const pw_method *m = runs_method (i, method);
    if (m->locates_no_events) continue;
    const int fixed = !pw_method_adaptive (m, method), second = m->order == 2;
    const double bound = second ? 1e-4 : fixed ? 5e-8 : m->order > 0 ? 1e-7 : 2e-6;
    for (int k = 0; k < events_count; k++) {
      const events_problem *p = &events_problems[k];
      if (strncmp (method, "leapfrog", 8) == 0 && events_rubs (p)) continue; /* which it refuses */
      if (k > 0 && strcmp (p->scene, p[-1].scene) == 0 && isnan (p->last)) continue;
      events_run (p, method, &(pw_settings){ .step = 1e-3, .rtol = fixed ? 0 : 1e-10 }, bound,
                  second ? "(h k)^2, more where it drifts" : "errors of the method, 1e4 rtol of multistep ones");
    }
  }
}

/* Of the rocking block the tilt in balance, the rate p at which it departs from there, and the formulas of Housner
 * (1963, Bulletin of the Seismological Society of America 53, 403-417) for small angles, with the ratio of the rates in
 * an impact. */
TEST (housner) {
  const double digits[] = { 0.19739555984988075837, 3.7985845578046423355, 0.55417846707903372080,
                            0.052592168828495772927 };
  double tilt[3] = { 0.19, 0.2, 0 }, a[2] = { 0, 0 }, p = 0, ratio = 0;
  pw_error error = { 0 };
  for (int i = 0; i < 7; i++) { /* the acceleration there is 0: secants */
    pw_system *s = runs_scene ("rocking", check_text ("tilt=%.17g", i < 2 ? tilt[i] : tilt[2]));
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    if (i >= 2) tilt[0] = tilt[1], tilt[1] = tilt[2], a[0] = a[1];
    a[i > 0] = runs_to (r, 0).a[2];
    if (i > 0 && a[1] != a[0]) tilt[2] = tilt[1] - a[1] * (tilt[1] - tilt[0]) / (a[1] - a[0]);
    pw_linear l = { 0 };
    if (i == 6) check_ok (pw_run_linearise (r, 10, &l, &error), &error), p = l.re[0];
    pw_linear_free (&l);
    runs_close (r, s);
  }
  pw_system *s = runs_scene ("rocking", "");
  pw_run *r = runs_open (s, "erk8", &(pw_settings){ .rtol = 1e-12 });
  for (int count = 0; count < 2; (void)pw_run_events (r, &count)) {
    ratio = runs_to (r, pw_run_time (r)).v[2];
    check_ok (pw_run_advance (r, 1, &error), &error);
  }
  pw_sample x;
  int count;
  check_ok (pw_run_sample (r, pw_run_events (r, &count)[1].t, &x, &error), &error);
  ratio = x.v[2] / ratio;
  runs_close (r, s);
  const double alpha = tilt[2], rest = 1 - 0.15 / alpha;
  check_close ("tilt in balance", alpha, digits[0], 1e-14, "round-off");
  check_close ("p", p, digits[1], 1e-13, "round-off");
  check_close ("first impact", acosh (1 / rest) / p, digits[2], 1e-12, "round-off");
  check_close ("tilt after six impacts", alpha * (1 - sqrt (1 - pow (ratio, 12) * (1 - rest * rest))), digits[3], 1e-13,
               "round-off");
}

/* Errors of the times at three step sizes have the order of the method. */
TEST (orders) {
  static const struct {
    const char *method;
    double step;
    int order;
  } of[] = { { "rk4+projection", 0.02, 4 }, { "rk4+nullspace", 0.02, 4 }, { "radau+ggl:steps=fixed", 0.1, 5 },
             { "galpha+ggl", 4e-3, 2 },     { "galpha+index3", 4e-3, 2 }, { "leapfrog+rattle", 4e-3, 2 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++)
    for (int k = 0; k < events_count; k++) {
      const events_problem *p = &events_problems[k];
      if (strcmp (p->sets, "gA=0.03") != 0) continue;
      double error[2];
      for (int n = 0; n < 2; n++)
        error[n] = events_run (p, of[i].method, &(pw_settings){ .step = of[i].step / (n ? 4 : 1) }, 1e-4, "no bound");
      check_close (check_text ("order of %s", of[i].method), log (error[0] / error[1]) / log (4), of[i].order, 0.5,
                   "at these steps");
    }
}

/* ---- Contacts ---- */

SCENE (events_touching) {
  const char *const both[2] = { "a", "b" };
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 2, .start = { 0.3, 2, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 3, .inertia = 1, .start = { -0.2, 0.1, -0.3 } });
  pw_contact line = { .name = "L",
                      .body = { both[0], both[1] },
                      .at = { { 0.1, 0.3 }, { -0.2, 0.4 } },
                      .heading = 0.5,
                      .radius = 0.2,
                      .mu = 0.3 },
             point = line, disc = line;
  pw_add_contact (m, &line);
  point.name = "P", point.radius = 0, point.body[0] = "ground";
  pw_add_contact (m, &point);
  disc.name = "D", disc.heading = 0, disc.other_radius = 0.4;
  pw_add_contact (m, &disc);
}

/* Random scenes of the self-test contain discs alone. */
TEST (derivatives) {
  pw_error error = { 0 };
  pw_selftest_report report = { 0 };
  pw_system *s = scene_system (&events_touching_table, NULL);
  double q[6] = { 0.3, 2, 0.4, -0.2, 0.1, -0.3 }, v[6] = { 0.2, -0.5, 0.3, 0.4, 0.6, -0.7 };
  for (int i = 0; i < pw_system_elements (s); i++) {
    const pw_kind *kind = pw_system_element (s, i).kind;
    check_ok (pw_selftest_scene (s, 1, kind, 0, q, v, 7, &report, &error), &error);
    for (int n = 0; n < report.checks; n++)
      if (report.check[n].failed) print_error ("%s: %s\n", report.check[n].name, report.check[n].where);
    assert_int_equal (report.failed, 0);
  }
  pw_system_free (s);
}

/* ---- Friction circles, where the direction of sliding turns ---- */

/* A car whose driven rear wheel begins to spin while the steered front wheel slides. */
SCENE (events_drift) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 1000, .inertia = 1500, .rate = { 15 } });
  pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "R",
                                                .body = "car",
                                                .at = { -1.3 },
                                                .radius = 0.3,
                                                .inertia = 2,
                                                .grip.constant = 4500,
                                                .torque = { PW_RAMP, .ramp = { .to = 1600, .duration = 4 } } });
  pw_add_steered_wheel (
      m,
      &(pw_steered_wheel){ .name = "F",
                           .body = "car",
                           .at = { 1.2 },
                           .heading = { PW_HARMONIC, .harmonic = { .amplitude = -0.15, .omega = 1.5, .offset = 0.15 } },
                           .grip.constant = 5000 });
}

/* A body slides on a locked wheel and turns; the wheel comes to rest, and the body turns about it. */
SCENE (events_stop) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 1, .inertia = 0.2, .start = { 0, 0, 0.3 }, .rate = { 3, 1, 2 } });
  pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "R",
                                                .body = "car",
                                                .at = { 0.4, 0.1 },
                                                .radius = 0.1,
                                                .inertia = 0.01,
                                                .specified = { 0, 1 },
                                                .grip.constant = 2,
                                                .brake.constant = 100 });
}

/* Last event and final state, from the equations of each phase, written by hand, integrated by scipy 1.10: `drift` by
 * Radau at 1e-11, begun with sliding velocities of 1e-7 and 1e-8 m/s and extrapolated to 0; `stop` by DOP853 at 1e-13
 * in s with ds = dt/|u|, up to |u| = 1e-13 m/s. */
static const struct {
  const pw_plugin_table *scene;
  const char *name;
  int events;
  double t_end, last, q[3];
} events_circles[] = {
  { &events_drift_table, "drift", 3, 4, 3.6137736273, { 35.3013048066, 35.2333734420, 5.1549446084 } },
  { &events_stop_table, "stop", 1, 3, 1.96785338166638, { 2.37075151799125, 1.12918883091001, 5.35500447346621 } },
};

/* The largest error of the final position. */
static double events_circle (int i, const char *method, const pw_settings *settings, double bound, const char *reason) {
  pw_system *s = scene_system (events_circles[i].scene, NULL);
  pw_settings set = *settings;
  set.span = events_circles[i].t_end, set.ledger = 1;
  pw_run *r = runs_open (s, method, &set);
  pw_sample x = runs_to (r, set.span);
  double most = 0;
  int count;
  const pw_event *event = pw_run_events (r, &count);
  const char *what = events_circles[i].name;
  assert_int_equal (count, events_circles[i].events);
  check_close (check_text ("%s, %s, event", method, what), event[count - 1].t, events_circles[i].last, bound, reason);
  for (int j = 0; j < 3; j++) {
    check_close (check_text ("%s, %s", method, what), x.q[j], events_circles[i].q[j], bound, reason);
    most = fmax (most, fabs (x.q[j] - events_circles[i].q[j]));
  }
  const double scale = x.kinetic + x.loss + fabs (x.work); /* velocities of about 1: as positions */
  check_close (check_text ("%s, %s, balance", method, what), x.balance / scale, 0, 10 * bound, reason);
  runs_close (r, s);
  return most;
}

TEST (circles) {
  static const struct {
    const char *method;
    double rtol, bound;
  } of[] = { { "erk8+projection", 1e-11, 2e-8 }, { "erk5+projection", 1e-10, 2e-8 }, { "radau+ggl", 1e-11, 2e-7 },
             { "ida+ggl", 1e-12, 5e-8 },         { "bdf+projection", 1e-12, 5e-8 },  { "adams+none", 1e-12, 5e-8 } };
  for (int i = 0; i < 2; i++)
    for (size_t k = 0; k < sizeof of / sizeof *of; k++)
      events_circle (i, of[k].method, &(pw_settings){ .rtol = of[k].rtol }, of[k].bound,
                     "digits of the reference of `drift`, 1e-9; errors of 1e3 to 5e4 rtol");
}

/* Methods have order 2 at least where the direction turns near u = 0. */
TEST (circle_orders) {
  static const char *const method[] = { "rk4+projection", "rk4+nullspace", "galpha+ggl", "leapfrog+rattle",
                                        "radau+ggl:steps=fixed" };
  for (int i = 0; i < 2; i++)
    for (size_t k = 0; k < sizeof method / sizeof *method; k++) {
      double error[2];
      for (int n = 0; n < 2; n++)
        error[n] = events_circle (i, method[k], &(pw_settings){ .step = n ? 5e-4 : 2e-3 }, 1e-3, "no bound");
      const double order = log (error[0] / error[1]) / log (4);
      if (order > 1.7 || error[0] < 1e-9) continue; /* of the last moment before a stop, at any step size */
      print_error ("%s, %s: order %g, errors %g, %g\n", method[k], events_circles[i].name, order, error[0], error[1]);
      fail ();
    }
}

/* Where u passes 0 at a small distance, its direction turns within less than a step.  Final states from the equations
 * of one phase, written by hand, integrated by DOP853 of scipy 1.10 at 1e-13. */
TEST (passes_beside_0) {
  static const struct {
    const char *set;
    double q[2], v[2];
  } of[] = { { "torque=0.1", { 0.060643101604048, -0.05523707896227 }, { 0.12155583574851, -0.6686956602707 } },
             { "torque=0.02", { 0.012141629739368, -0.055545188740321 }, { 0.024337503570414, -0.66675172275695 } } };
  static const struct {
    const char *method;
    double rtol, bound;
  } by[] = { { "rk4+projection", 0, 2e-6 }, { "erk5+projection", 1e-6, 1e-6 }, { "erk8+projection", 1e-8, 1e-8 },
             { "radau+ggl", 1e-6, 1e-7 },   { "bdf+projection", 1e-8, 1e-6 },  { "ida+ggl", 1e-8, 1e-6 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++)
    for (size_t k = 0; k < sizeof by / sizeof *by; k++) {
      double q[6], v[6];
      pw_system *s = runs_scene ("circles/beside", of[i].set);
      runs_state (s, by[k].method, &(pw_settings){ .step = 1e-2, .rtol = by[k].rtol }, 1, q, v, NULL);
      for (int j = 0; j < 2; j++) {
        check_close (by[k].method, q[j], of[i].q[j], by[k].bound, "a step of 1e-2 s; 100 rtol at most");
        check_close (by[k].method, v[j], of[i].v[j], by[k].bound, "the same");
      }
      pw_system_free (s);
    }
}

/* ---- Events are neither missed nor invented ---- */

/* Impulses of round-off, of equations that an impact does not reach, are no events. */
TEST (impacts_apart) {
  static const char *const method[] = { "erk8+projection", "ida+ggl", "rk4+none" };
  for (int i = 0; i < 3; i++) {
    pw_system *s = runs_scene ("apart", "");
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-8, .span = 3 });
    int count;
    (void)runs_to (r, 3);
    const pw_event *event = pw_run_events (r, &count);
    assert_true (count > 4);
    for (int k = 1; k < count; k++) assert_int_not_equal (event[k].row, event[0].row); /* of the rope, which holds */
    runs_close (r, s);
  }
}

static unsigned events_seed = 1;

TEST (none_missed) {
  static double time[3][RANDOM_EVENTS];
  static int row[3][RANDOM_EVENTS];
  int total = 0;
  for (int i = 0; i < 40; i++) {
    pw_system *s = random_vehicle (&events_seed, 0);
    int fine = random_vehicle_events (s, "rk4+projection", 1e-4, 3, time[0], row[0]);
    int coarse = random_vehicle_events (s, "rk4+projection", 1e-2, 3, time[1], row[1]);
    int adaptive = random_vehicle_events (s, "erk8+projection", 0, 3, time[2], row[2]);
    if (fine != coarse || fine != adaptive)
      print_error ("scene %d: %d events with a hundredth of the step, %d, %d\n", i, fine, coarse, adaptive);
    assert_int_equal (fine, coarse);
    assert_int_equal (fine, adaptive);
    for (int k = 0; k < fine; k++) {
      assert_int_equal (row[0][k], row[1][k]);
      check_close (check_text ("scene %d, event %d", i, k), time[1][k], time[0][k], 1e-4, "errors of coarse steps");
    }
    total += fine;
    pw_system_free (s);
  }
  assert_true (total > 300);
}

/* The same with a rolling wheel, whose slip turns: two methods with different errors find the same events.  With fixed
 * steps those nearer to each other than the zone in which the direction of sliding is smoothed are not compared. */
TEST (rolling_wheels) {
  static double time[2][RANDOM_EVENTS];
  static int row[2][RANDOM_EVENTS];
  int total = 0;
  unsigned seed = 1;
  for (int i = 0; i < 12; i++) {
    pw_system *s = random_vehicle (&seed, 1);
    const int count = random_vehicle_events (s, "erk8+projection", 0, 3, time[0], row[0]);
    assert_int_equal (random_vehicle_events (s, "radau+ggl", 0, 3, time[1], row[1]), count);
    for (int k = 0; k < count; k++) {
      assert_int_equal (row[0][k], row[1][k]);
      check_close (check_text ("scene %d, event %d", i, k), time[1][k], time[0][k], 1e-6,
                   "1e-11, in directions that relax at the rate 1/sqrt (rtol)");
    }
    total += count;
    pw_system_free (s);
  }
  assert_true (total > 150);
}

/* moreau, which locates none of these events, converges to the same motions with order 1: the mean error of many, since
 * single ones depend on where events are in a step. */
TEST (not_located) {
  double error[2] = { 0, 0 }, balance[2] = { 0, 0 };
  for (int i = 0; i < 30; i++) {
    double q[9], v[9];
    pw_system *s = random_vehicle (&events_seed, 0);
    const int n = pw_system_coordinates (s);
    assert_true (n <= 9);
    runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-11, .span = 3 }, 3, q, v, NULL);
    for (int k = 0; k < 2; k++) {
      pw_run *r = runs_open (s, "moreau", &(pw_settings){ .step = 1e-3 / (k ? 4 : 1), .span = 3, .ledger = 1 });
      pw_sample x = runs_to (r, 3);
      for (int j = 0; j < n; j++) error[k] += fabs (x.q[j] - q[j]) / 30;
      balance[k] += fabs (x.balance) / 30;
      pw_run_close (r);
    }
    pw_system_free (s);
  }
  check_close ("order", log (error[0] / error[1]) / log (4), 1.25, 0.5, "1, more where forces do not jump");
  check_close ("order of the balance", log (balance[0] / balance[1]) / log (4), 1.5, 0.75, "the same");
  check_below ("error", error[0], 1e-2, "10 h");
  check_below ("balance", balance[0], 1e-3, "h times the energy, about 1 J");
}

/* A block that holds most of the time does not move: only the multiplier requires short steps. */
TEST (nothing_moves) {
  static const char *const method[] = { "erk5+projection", "erk8+projection", "radau+ggl", "ida+ggl",
                                        "bdf+projection",  "adams+none",      "rk4+none" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++)
    for (double rtol = 1e-12; rtol < 1e-3; rtol *= 100) {
      pw_system *s = runs_scene ("block", "k=0 x0=0 F=1.05 w=200 lim=1");
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = rtol, .span = 100 });
      int count;
      (void)runs_to (r, 2);
      const pw_event *event = pw_run_events (r, &count);
      if (count != 256) print_error ("%s, rtol %g: %d events\n", method[i], rtol, count);
      assert_int_equal (count, 256); /* two in each half of a period, the first one at t = 0 */
      for (int k = 2; k < count; k++)
        check_close ("half a period", event[k].t - event[k - 2].t, PW_PI / 200, k < 6 ? 1e-2 : 1e-3, "it settles");
      runs_close (r, s);
    }
}

/* ---- Checkpoints ---- */

/* Loaded runs continue like saved ones, bit for bit, whatever the modes at that time. */
TEST (checkpoints) {
  static const struct {
    const char *method, *scene, *sets;
  } of[] = { { "rk4+projection", "ride-on", "gA=0.008 gC=0.2" },
             { "erk8+projection", "ride-on", "gA=0.008 gC=0.2" },
             { "ida+ggl", "ride-on", "gA=0.008 gC=0.2" },
             { "radau+ggl", "ride-on", "gA=0.008 gC=0.2" },
             { "galpha+ggl", "ride-on", "gA=0.008 gC=0.2" },
             { "moreau", "ride-on", "gA=0.008 gC=0.2" },
             { "moreau", "ball", "" },
             { "moreau", "wall", "" },
             { "moreau", "belt", "" } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++)
    for (double t = 0.2; t < 1.5; t += 0.31) {
      pw_system *s = runs_scene (of[i].scene, of[i].sets);
      const pw_settings set = { .step = 1e-3, .rtol = 1e-8, .span = 2 };
      pw_run *saved = runs_open (s, of[i].method, &set);
      (void)runs_to (saved, t);
      pw_run *loaded = runs_copy (saved, s, of[i].method, &set);
      pw_sample a = runs_to (saved, 2), b = runs_to (loaded, 2);
      check_bits ("q", a.q, b.q, pw_system_coordinates (s));
      check_bits ("v", a.v, b.v, pw_system_coordinates (s));
      check_bits ("lambda", a.lambda, b.lambda, pw_system_rows (s));
      int events[2];
      const pw_event *e = pw_run_events (saved, &events[0]), *f = pw_run_events (loaded, &events[1]);
      assert_int_equal (events[0], events[1]);
      assert_true (events[0] > 3 || strcmp (of[i].method, "moreau") == 0); /* which locates none */
      for (int k = 0; k < events[0]; k++) assert_true (e[k].t == f[k].t && e[k].to == f[k].to);
      pw_run_close (loaded);
      runs_close (saved, s);
    }
}

/* An impact just after a checkpoint is located as without it: at the distance 0. */
TEST (checkpoint_before_an_impact) {
  static const char *const method[] = { "erk8+projection", "radau+ggl" };
  const double t = sqrt (2 / 9.81);
  pw_system *s = runs_scene ("ball", "");
  for (int i = 0; i < 2; i++) {
    const pw_settings set = { .rtol = 1e-8, .span = 1 };
    pw_run *saved = runs_open (s, method[i], &set);
    check_ok (pw_run_advance_to (saved, t - 1e-9, t - 1e-9, NULL), NULL);
    pw_run *loaded = runs_copy (saved, s, method[i], &set);
    for (int k = 0; k < 2; k++) {
      int count;
      pw_run *r = k ? loaded : saved;
      (void)runs_to (r, 0.6);
      const pw_event *event = pw_run_events (r, &count);
      assert_int_equal (count, 1);
      check_close (method[i], event[0].t, t, 1e-11, "of a parabola");
    }
    pw_run_close (loaded);
    pw_run_close (saved);
  }
  pw_system_free (s);
}

/* ---- Limits that are not reached; samples in a step with an event ---- */

TEST (not_reached) {
  double q[2][6], v[2][6];
  for (int i = 0; i < 2; i++) {
    pw_system *s = runs_scene (i ? "ride-on" : "../ezyroller", i ? "" : "m2=0.1 I2=0.01");
    runs_state (s, "rk4+projection", &(pw_settings){ .step = 1e-3 }, 5, q[i], v[i], NULL);
    pw_system_free (s);
  }
  check_bits ("q", q[0], q[1], 6);
  check_bits ("v", v[0], v[1], 6);
}

/* Samples on both sides of a bounce: those of the fall, then those of the rise. */
TEST (samples) {
  static const char *const method[] = { "rk4+projection", "ida+ggl", "bdf+projection", "radau", "galpha", "leapfrog" };
  const double t1 = sqrt (2 / 9.81);
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_system *s = runs_scene ("ball", "");
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.01, .rtol = 1e-9, .span = 1 });
    for (int k = -20; k <= 20; k++) {
      const double t = t1 + 4e-4 * (k + 0.5), rise = t - t1;
      pw_sample x = runs_to (r, t);
      double y = rise < 0 ? 1 - 9.81 / 2 * t * t : rise * (0.8 * 9.81 * t1 - 9.81 / 2 * rise);
      check_close (check_text ("%s, height at %g", method[i], t), x.q[1], y, 1e-6, "1e3 rtol");
    }
    runs_close (r, s);
  }
}

/* ---- Limits that vary ---- */

/* Signals of every form whose value is that of the first one. */
static const pw_signal events_grips[] = {
  { .constant = 0.3 },
  { PW_HARMONIC, .harmonic = { .omega = 1, .offset = 0.3 } },
  { PW_RAMP, .ramp = { .from = 0.3, .to = 0.3, .start = 20, .duration = 1 } },
  { PW_PULSE, .pulse = { .start = 20, .height = 1, .offset = 0.3 } },
  { PW_TABLE,
    .table = { .t = (const double[]){ 0, 20 }, .value = (const double[]){ 3, 3 }, .count = 2, .scale = 0.1 } },
};
static pw_signal events_grip;

SCENE (events_skid) {
  pw_add_body (
      m, &(pw_body){
             .name = "frame", .mass = 1, .inertia = 0.5, .start = { 0.25 }, .rate = { 2, 0.5, 2 }, .specified = 0x39 });
  pw_add_steered_wheel (m, &(pw_steered_wheel){ .name = "A", .body = "frame", .at = { -0.25 }, .grip = events_grip });
}

TEST (forms) {
  double q[6][3], v[6][3];
  const int forms = sizeof events_grips / sizeof *events_grips;
  for (int i = 0; i < forms; i++) {
    events_grip = events_grips[i];
    pw_system *s = scene_system (&events_skid_table, NULL);
    assert_int_equal (pw_system_signals (s), i == 0 ? 1 : 2);
    char name[80];
    if (i > 0) assert_string_equal (pw_system_signal_name (s, 0, name, sizeof name), "A.grip");
    runs_state (s, "rk4+projection", &(pw_settings){ .step = 1e-3 }, 10, q[i], v[i], NULL);
    pw_system_free (s);
    for (int j = 0; j < 3; j++) {
      check_close ("q", q[i][j], q[0][j], 1e-12, "events are located to round-off in units that differ");
      check_close ("v", v[i][j], v[0][j], 1e-12, "the same");
    }
  }
}

/* ---- Refused ---- */

static const char *events_wrong; /* the element of the next scene */

SCENE (events_bad) {
  const char *const both[2] = { "a", "b" };
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1, .rate = { 1 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .start = { 1 } });
  pw_wheel wheel = { .name = "W", .body = "a", .grip = { .constant = 2 } };
  wheel.grip_sliding.constant = strcmp (events_wrong, "grip") == 0 ? 3 : 0;
  if (strcmp (events_wrong, "grip-sliding") == 0) wheel.grip.constant = 0, wheel.grip_sliding.type = PW_HARMONIC;
  if (strcmp (events_wrong, "grip-missing") == 0) wheel.grip.constant = 0, wheel.grip_sliding.constant = 1;
  if (strcmp (events_wrong, "axle") == 0) wheel.grip.constant = 0;
  pw_add_wheel (m, &wheel);
  wheel.name = "V", wheel.at[1] = 1;
  if (strcmp (events_wrong, "axle") == 0) pw_add_wheel (m, &wheel);
  pw_friction friction = {
    .name = "F", .body = { both[0], both[1] }, .limit = { .constant = 1 }, .limit_sliding = { .constant = 2 }
  };
  if (strcmp (events_wrong, "smooth") == 0) friction.speed = 0.1;
  if (strcmp (events_wrong, "negative") == 0) friction.limit.constant = -2;
  if (strcmp (events_wrong, "without") == 0) friction.limit.constant = 0, friction.limit_sliding.type = PW_RAMP;
  if (strcmp (events_wrong, "signal") == 0) friction.limit.type = PW_HARMONIC, friction.speed = 0.1;
  friction.limit_sliding.ramp.duration = 1;
  if (strcmp (events_wrong, "axle") == 0) friction.limit_sliding.constant = 0;
  const char *const frictions[] = { "friction", "smooth", "negative", "without", "signal", "axle" };
  for (size_t i = 0; i < sizeof frictions / sizeof *frictions; i++)
    if (strcmp (events_wrong, frictions[i]) == 0) pw_add_friction (m, &friction);
  pw_end_stop stop = { .name = "S", .body = { both[0], both[1] }, .what = PW_DRIVE_ANGLE, .low = 1, .high = 1 };
  if (strcmp (events_wrong, "side") == 0) stop.low = stop.high = 0;
  if (strcmp (events_wrong, "side") == 0 || strcmp (events_wrong, "stop") == 0) pw_add_end_stop (m, &stop);
  pw_contact contact = { .name = "C", .body = { both[0], both[1] }, .heading = 1, .radius = 0.1, .other_radius = 0.1 };
  if (strcmp (events_wrong, "disc") == 0) pw_add_contact (m, &contact);
}

TEST (bad_elements) {
  static const struct {
    const char *wrong, *message;
  } of[] = {
    { "grip", "model scene: wheel W: grip_sliding = 3: expected at most the grip, 2" },
    { "friction", "model scene: friction F: limit_sliding = 2: expected at most the limit, 1" },
    { "smooth", "model scene: friction F: limit_sliding: expected none, unless friction is exact: a limit, no speed" },
    { "negative", "model scene: friction F: limit = -2: expected a number >= 0" },
    { "without", "model scene: friction F: limit_sliding: expected none, unless friction is exact: a limit, no speed" },
    { "grip-sliding", "model scene: wheel W: grip_sliding without grip" },
    { "grip-missing", "model scene: wheel W: grip_sliding without grip" },
    { "signal", "model scene: friction F: limit: a signal: expected a number, unless friction is exact: no speed" },
    { "stop", "model scene: stop S: low = 1, high = 1: expected low < high" },
    { "disc", "model scene: contact C: heading = 1: expected none: with other_radius, body 2 has a disc, not a line" },
    { "side", "model scene: stop S: neither low nor high is given: expected one or both" },
  };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    events_wrong = of[i].wrong;
    scene_refused (scene_model (&events_bad_table, NULL), of[i].message);
  }
}

/* Samples inside steps that an event has shortened; methods take them from what they know of the whole step. */
TEST (samples_of_shortened_steps) {
  pw_system *s = runs_scene ("sleigh", "");
  char method[40];
  pw_error error = { 0 };
  for (int i = 0; runs_method (i, method); i++) {
    const pw_method *m = runs_method (i, method);
    if (m->locates_no_events) continue;
    pw_run *exact = runs_open (s, "rk4", &(pw_settings){ .step = 1e-3 });
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-9 });
    const double bound = strcmp (method, "galpha") == 0 || m->order == 2 ? 1e-4 : 1e-5;
    for (int k = 1; k <= 4000; k++) {
      pw_sample x, y;
      while (pw_run_time (r) < 1e-3 * k) check_ok (pw_run_advance (r, 4, &error), &error);
      check_ok (pw_run_sample (r, 1e-3 * k, &x, &error), &error);
      y = runs_to (exact, 1e-3 * k);
      for (int j = 0; j < 3; j++) check_close (method, x.q[j], y.q[j], bound, "the method's error");
      for (int j = 0; j < 3; j++) check_close (method, x.v[j], y.v[j], bound, "the method's error");
    }
    pw_run_close (exact);
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* Energies of samples between events: what is sampled before an event does not enter what follows it. */
TEST (energies_of_samples) {
  static const char *const method[] = { "erk5+projection", "erk8+projection", "radau+ggl",  "bdf+projection",
                                        "ida+ggl",         "adams+baumgarte", "galpha+ggl", "rk4+nullspace" };
  static const char *const scene[] = { "ball", "pendulum", "rocking" };
  pw_error error = { 0 };
  for (int i = 0; i < 3; i++) {
    pw_system *s = runs_scene (scene[i], "");
    for (int m = 0; m < 8; m++) {
      pw_run *r = runs_open (s, method[m], &(pw_settings){ .rtol = 1e-9, .step = 1e-3, .span = 2, .ledger = 1 });
      for (int k = 1; k <= 130; k++) {
        pw_sample x;
        while (pw_run_time (r) < k / 65.) check_ok (pw_run_advance (r, 4, &error), &error);
        check_ok (pw_run_sample (r, k / 65., &x, &error), &error);
        check_close (check_text ("%s, %s, t = %g", scene[i], method[m], x.t), x.balance, 0, 1e-4,
                     "1e5 rtol, of energies of about 10 J; the error of galpha");
      }
      pw_run_close (r);
    }
    pw_system_free (s);
  }
}

/* The first impact of the pendulum, whatever the number of samples with which it is located: samples of steps, with
 * which modes are decided, are not those interpolated for tables. */
TEST (all_tolerances) {
  static const char *const methods[] = { "erk5+projection", "erk8+projection", "erk8+none", "erk8+baumgarte" };
  const double impulse = 1.6 * sqrt (2 * 9.81 * cos (PW_PI / 6));
  pw_system *s = runs_scene ("pendulum", "");
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
    for (double rtol = 1e-3; rtol > 1e-12; rtol /= 3) {
      pw_run *r = runs_open (s, methods[i], &(pw_settings){ .rtol = rtol, .span = 1 });
      int events;
      runs_to (r, 1);
      const pw_event *e = pw_run_events (r, &events);
      assert_int_equal (events, 1);
      check_close (methods[i], e->impulse, impulse, 10 * rtol * impulse, "the error of the velocity");
      pw_run_close (r);
    }
  pw_system_free (s);
}

/* ---- Wheels that depend on each other ---- */

static double events_axle[2]; /* grips */

/* A sleigh on one wheel, or on two side by side, under an oscillating force. */
SCENE (events_pair) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 1, .inertia = 0.3, .rate = { 2, 0, 0.2 } });
  for (int i = 0; i < 2 && events_axle[i] > 0; i++) {
    pw_wheel wheel = { .name = i ? "R" : "L", .body = "car", .at = { -0.25 }, .grip = { .constant = events_axle[i] } };
    if (events_axle[1] > 0) wheel.at[1] = i ? -0.2 : 0.3;
    pw_add_wheel (m, &wheel);
  }
  pw_add_force (m, &(pw_force){ .name = "push",
                                .body = "car",
                                .at = { 0.3 },
                                .axes = PW_AXES_BODY,
                                .fy = { PW_HARMONIC, .harmonic = { .amplitude = 2, .omega = 3 } } });
}

/* Two wheels on an axle hold and slide together, as one with the sum of their grips. */
TEST (wheels_on_an_axle) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "radau+ggl", "bdf+baumgarte", "ida+ggl" };
  static double time[2][RANDOM_EVENTS];
  static int row[2][RANDOM_EVENTS];
  for (int i = 0; i < 5; i++) {
    double q[2][3], v[3];
    int count[2];
    for (int two = 0; two < 2; two++) {
      events_axle[0] = two ? 0.5 : 0.7, events_axle[1] = two ? 0.2 : 0;
      pw_system *s = scene_system (&events_pair_table, NULL);
      count[two] = random_vehicle_events (s, method[i], 1e-3, 8, time[two], row[two]);
      runs_state (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-11, .span = 8 }, 8, q[two], v, NULL);
      pw_system_free (s);
    }
    assert_true (count[0] >= 6);
    assert_int_equal (count[1], 2 * count[0]);
    const char *reason = "errors of multistep methods at rtol 1e-11, which take other steps";
    for (int k = 0; k < count[1]; k++) check_close (method[i], time[1][k], time[0][k / 2], 1e-7, reason);
    for (int j = 0; j < 3; j++) check_close (method[i], q[1][j], q[0][j], 1e-6, reason);
  }
}

/* A car with four wheels whose front ones, steered alike, depend on each other only while they are straight; those at
 * the rear, which roll, always do. */
static double events_steer; /* mean heading of the front wheels */

SCENE (events_car) {
  static const char *const name[] = { "FL", "FR", "RL", "RR" };
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 1, .inertia = 1.5, .rate = { 10 } });
  for (int i = 0; i < 4; i++) {
    const double x = i < 2 ? 1.2 : -1.2, y = i % 2 ? -0.7 : 0.7;
    if (i < 2)
      pw_add_steered_wheel (
          m, &(pw_steered_wheel){ .name = name[i],
                                  .body = "car",
                                  .at = { x, y },
                                  .grip = { .constant = 2.5 },
                                  .heading = { PW_HARMONIC, .harmonic = { 0.15, 1, -PW_PI / 2, events_steer } } });
    else
      pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = name[i],
                                                    .body = "car",
                                                    .at = { x, y },
                                                    .radius = 0.3,
                                                    .inertia = 1e-3,
                                                    .torque = { .constant = 0.7 },
                                                    .grip = { .constant = 2.5 } });
  }
}

/* All methods find the same motion, at all tolerances; what slips dissipates what the motion loses. */
TEST (wheels_of_a_car) {
  static const struct {
    const char *method;
    double step, rtol, bound;
  } of[] = { { "erk8+projection", 0, 1e-11, 0 },   { "radau+ggl", 0, 1e-10, 1e-6 },
             { "ida+ggl", 0, 1e-10, 1e-5 },        { "bdf+projection", 0, 1e-10, 1e-5 },
             { "erk8+projection", 0, 1e-6, 1e-3 }, { "erk8+projection", 0, 1e-4, 0.1 },
             { "rk4+projection", 1e-4, 0, 1e-5 } };
  for (events_steer = 0; events_steer < 0.2; events_steer += 0.15) {
    pw_system *s = scene_system (&events_car_table, NULL);
    double q[5];
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
      const pw_settings set = { .step = of[i].step, .rtol = of[i].rtol, .span = 5, .ledger = 1 };
      pw_run *r = runs_open (s, of[i].method, &set);
      const pw_sample x = runs_to (r, 5);
      if (i == 0) memcpy (q, x.q, sizeof q);
      for (int j = 0; j < 3; j++)
        check_close (of[i].method, x.q[j], q[j], of[i].bound, "the error of the method, amplified by up to 1e3");
      check_close (of[i].method, x.balance, 0, fmax (1e-6, of[i].bound), "losses are counted");
      pw_run_close (r);
    }
    pw_system_free (s);
  }
}

/* A ball, pushed by 1 N, bounces from a block of 4 kg.  After an impact with the velocity u the block slides by
 * 0.0169 u^2 and stops before the next one, whose velocity is sqrt (0.04^2 + 2 * 0.0169) u. */
SCENE (events_shunt) {
  const char *const name[] = { "block", "ball" };
  for (int i = 0; i < 2; i++) {
    pw_add_body (m, &(pw_body){ .name = name[i], .mass = i ? 1 : 4, .inertia = 1, .start = { i ? -0.5 : 0 } });
    pw_add_slider (m, &(pw_slider){ .name = i ? "B" : "A", .body = { name[i], "ground" } });
  }
  pw_add_force (m, &(pw_force){ .name = "push", .body = "ball", .fx = { .constant = 1 } });
  pw_add_sliding_friction (
      m, &(pw_sliding_friction){ .name = "rub", .body = { "block", "ground" }, .limit = { .constant = 8 } });
  pw_add_end_stop (
      m,
      &(pw_end_stop){
          .name = "hit", .body = { "ball", "block" }, .what = PW_DRIVE_X, .specified = { 0, 1 }, .restitution = 0.3 });
}

/* Its impacts accumulate although friction holds between them. */
TEST (accumulation_with_friction) {
  char method[40];
  const double end = 0.26 * 0.26 / 4 / (1 - 0.04 * 0.04 - 0.26 * 0.26 / 2);
  for (int i = 0; runs_method (i, method); i++) {
    const pw_method *m = runs_method (i, method);
    if (m->locates_no_events) continue;
    pw_system *s = scene_system (&events_shunt_table, NULL);
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-9, .span = 2, .ledger = 1 });
    const pw_sample x = runs_to (r, 2);
    int count;
    (void)pw_run_events (r, &count);
    assert_in_range (count, 10, 60);
    for (int k = 0; k < 2; k++) check_close (method, x.q[3 * k], end, 2e-6, "the method's error");
    check_close (method, x.loss, 0.5 + end, 2e-6, "the work of the push");
    runs_close (r, s);
  }
}

SCENE (events_driven) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 1, .inertia = 1, .rate = { 1 } });
  pw_add_slider (m, &(pw_slider){ .name = "rail", .body = { "cart", "ground" } });
  pw_add_drive (m, &(pw_drive){ .name = "D",
                                .body = { "cart", "ground" },
                                .what = PW_DRIVE_X,
                                .value = { PW_HARMONIC, .harmonic = { 1, 1, -PW_PI / 2, 0 } } });
  pw_add_end_stop (m, &(pw_end_stop){ .name = "S", .body = { "cart", "ground" }, .what = PW_DRIVE_X, .high = 0.5 });
}

/* A drive runs into a stop: no motion is possible. */
TEST (driven_into_a_stop) {
  char method[40];
  for (int i = 0; runs_method (i, method); i++) {
    if (runs_method (i, method)->locates_no_events) continue;
    pw_error error = { 0 };
    pw_system *s = scene_system (&events_driven_table, NULL);
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-2, .rtol = 1e-8, .span = 1 });
    while (pw_run_time (r) < 1 && pw_run_advance (r, 1, &error) == PW_OK) continue;
    check_error (
        &error, PW_METHOD,
        "t = 0.523599 s: whether stop S holds cannot be decided: their equations depend on each other or on other "
        "constraints");
    runs_close (r, s);
  }
}

/* Of wheels without grip on an axle none can be left out. */
TEST (dependent) {
  pw_error error = { 0 };
  events_wrong = "axle";
  pw_system *s = scene_system (&events_bad_table, NULL);
  assert_null (pw_run_open (s, "rk4+projection", NULL, &error));
  check_error (&error, PW_INPUT,
               "model scene: limits of reactions, as by a grip, with constraints without limits that depend on each "
               "other: leave out redundant ones");
  pw_system_free (s);
}

/* Where a velocity stays at round-off, decisions do not go on without end: the run stops, or keeps the position. */
TEST (velocity_at_round_off) {
  static const char *const method[] = { "erk8+projection", "rk4+projection", "galpha+ggl" };
  pw_system *s = runs_scene ("circles/hardly", "");
  double x = 0;
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    pw_sample sample;
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .span = 1 });
    const int status = pw_run_advance_to (r, 0.3, 1, &error);
    check_ok (pw_run_sample (r, pw_run_time (r), &sample, &(pw_error){ 0 }), NULL);
    if (i == 0) x = sample.q[0];
    check_close (method[i], sample.q[0], x, 1e-6, "it hardly moves");
    if (i == 0) check_ok (status, &error);
    if (status != PW_OK) assert_non_null (strstr (error.text, "rolling-wheel e1 slides is decided by round-off"));
    pw_run_close (r);
  }
  pw_system_free (s);
}

TEST (no_code) {
  pw_error error = { 0 };
  pw_system *s = runs_scene ("sleigh", "");
  assert_null (pw_system_source (s, NULL, &error));
  check_error (&error, PW_INPUT, "model sleigh: specialised code has no limits of reactions, as by a grip");
  pw_system_free (s);
}

const check_fixture fixture = { events_read, NULL };
