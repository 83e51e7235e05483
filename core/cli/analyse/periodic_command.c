/* The command `periodic`: relative periodic motions, and their branches over a parameter. */
#include <stdlib.h>
#include <string.h>
#include "unknowns.h"
#include "figure.h"

/* A periodic motion found, or a point of a branch. */
typedef struct {
  pw_periodic_orbit orbit; /* its arrays are in `state` */
  double *state;           /* q, v at the beginning, q, v at the end; then re, im of the multipliers */
} pw_periodic_point;

enum { PW_PERIODIC_ATTEMPTS = 3 }; /* of Newton's method, each from the state after more periods of a run */

typedef struct {
  pw_cli_line line;
  const char *period_text, *vary_text;
  pw_cli_given periods, guess;
  pw_limit limit;
  pw_periodic_settings settings;
  const char *source; /* of the period: "of the signals", "--period", "found" */
  pw_vary vary;
  pw_periodic *search;
  pw_periodic_point *point; /* points: the motion, or those of the branch */
  int points;
  size_t room;                           /* points allocated */
  double residual[PW_PERIODIC_ATTEMPTS]; /* of Newton's method, in units of the scene; INFINITY: not begun */
  char reason[300];                      /* why the attempt with the least residual failed, or "" */
  int stopped;                           /* 1: by Ctrl-C or --limit */
} pw_periodic_command;

enum { PERIODIC_PERIODS = 100000 }; /* of the signals in one period of the motion, at most */
#define PERIODIC_LEAST 1e-100       /* shortest period that is sought [s] */

/* Periods of the run that precedes each attempt, in which the motion approaches a stable periodic one. */
static const int periodic_settling[] = { 0, 10, 100 };
_Static_assert(sizeof periodic_settling / sizeof *periodic_settling == PW_PERIODIC_ATTEMPTS, "one for each attempt");

static int periodic_read_period (pw_periodic_command *cmd, pw_error *error) {
  const double periods = pw_cli_given_or (cmd->periods, 1);
  cmd->settings.free = cmd->period_text && strcmp (cmd->period_text, "free") == 0;
  cmd->source = cmd->settings.free ? "found" : cmd->period_text ? "--period" : "of the signals";
  if (cmd->guess.text && !cmd->settings.free)
    return pw_fail (error, PW_INPUT, "--guess %s: only with --period free", cmd->guess.text);
  if (cmd->periods.text && cmd->period_text)
    return pw_fail (error, PW_INPUT, "--periods %s: not together with --period", cmd->periods.text);
  cmd->settings.period = cmd->guess.number;
  if (!cmd->settings.free &&
      pw_cli_number ("--period", cmd->period_text, PW_POSITIVE, &cmd->settings.period, error) != PW_OK)
    return error->status;
  if (cmd->settings.period > 0 && cmd->settings.period < PERIODIC_LEAST)
    return pw_fail (error, PW_INPUT, "%s: expected at least %g s", cmd->guess.text ? "--guess" : "--period",
                    PERIODIC_LEAST);
  if (periods > PERIODIC_PERIODS)
    return pw_fail (error, PW_INPUT, "--periods %s: expected at most %d", cmd->periods.text, PERIODIC_PERIODS);
  cmd->settings.periods = (int)periods;
  double period = pw_system_period (cmd->line.m.system);
  if (cmd->period_text || cmd->vary_text || period > 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: %s", pw_file_name (cmd->line.m.file),
                  isnan (period) ? "the periods of its signals have no common multiple: give --period T"
                                 : "no signal has a known period (those of expressions and tables are not known): "
                                   "give --period T, or --period free if no signal changes with time");
}

static int periodic_read_options (pw_periodic_command *cmd, pw_error *error) {
  pw_settings settings = { .rtol = 0 };
  pw_run_defaults d = cmd->line.m.defaults;
  d.rtol = 1e-12;
  pw_cli_settings (&cmd->line, &d, &settings, &cmd->limit);
  cmd->settings.method = cmd->line.method ? cmd->line.method : "erk8+projection";
  cmd->settings.rtol = settings.rtol, cmd->settings.methods = settings.methods;
  cmd->vary.name = cmd->vary.unit = "";
  cmd->settings.stop = pw_limit_over, cmd->settings.stop_context = &cmd->limit;
  if (periodic_read_period (cmd, error) != PW_OK || cmd->vary_text == NULL) return error->status;
  if (pw_vary_read (&cmd->vary, &cmd->line, cmd->vary_text, error) != PW_OK) return PW_INPUT;
  cmd->settings.first = cmd->vary.first, cmd->settings.last = cmd->vary.last;
  cmd->settings.compile = pw_vary_compile, cmd->settings.context = &cmd->vary;
  if (cmd->vary.parameter == NULL) /* fails with the nearest name */
    return pw_model_set (cmd->line.m.model, cmd->vary.name, cmd->settings.first, error);
  return PW_OK;
}

static int periodic_set_stopped (pw_periodic_command *cmd) {
  return cmd->stopped |= pw_limit_over (&cmd->limit) != 0;
}

static int periodic_add (pw_periodic_command *cmd, const pw_periodic_orbit *o, pw_error *error) {
  const size_t n = (size_t)pw_system_coordinates (cmd->line.m.system), multipliers = (size_t)o->multipliers;
  int status = pw_grow (&cmd->point, (size_t)cmd->points, &cmd->room, sizeof *cmd->point);
  double *at = status == PW_OK ? malloc ((4 * n + 2 * multipliers + 1) * sizeof *at) : NULL;
  if (at == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  pw_periodic_point *p = cmd->point + cmd->points++;
  *p = (pw_periodic_point){ .orbit = *o, .state = at };
  p->orbit.q = memcpy (at, o->q, n * sizeof *at);
  p->orbit.v = memcpy (at += n, o->v, n * sizeof *at);
  p->orbit.end = memcpy (at += n, o->end, 2 * n * sizeof *at);
  p->orbit.re = memcpy (at += 2 * n, o->re, multipliers * sizeof *at);
  p->orbit.im = memcpy (at + multipliers, o->im, multipliers * sizeof *at);
  return PW_OK;
}

/* Finds a periodic motion by one of the attempts.  PW_RETRY if none succeeds or the search is stopped. */
static int periodic_find (pw_periodic_command *cmd, pw_periodic_orbit *o, pw_error *error) {
  pw_progress progress;
  double best = INFINITY;
  int status = PW_RETRY;
  pw_progress_start (&progress, pw_file_name (cmd->line.m.file), "attempts", 0, PW_PERIODIC_ATTEMPTS);
  for (int k = 0; status == PW_RETRY && k < PW_PERIODIC_ATTEMPTS && !periodic_set_stopped (cmd); k++) {
    status = pw_periodic_solve (cmd->search, periodic_settling[k], cmd->settings.first, o, error);
    cmd->residual[k] = o->residual;
    if (o->residual <= best) snprintf (cmd->reason, sizeof cmd->reason, "%s", pw_periodic_reason (cmd->search));
    best = fmin (best, o->residual);
    pw_progress_at (&progress, k + 1);
  }
  pw_progress_end (&progress);
  return status;
}

static int periodic_fail (pw_periodic_command *cmd, pw_error *error) {
  char period[60] = "a free period", tried[200] = "";
  pw_error ignored = { 0 };
  pw_system *first = cmd->vary_text ? pw_vary_compile (&cmd->vary, cmd->settings.first, &ignored) : NULL;
  double signals = pw_system_period (first ? first : cmd->line.m.system);
  double T = cmd->settings.period > 0 ? cmd->settings.period : cmd->settings.periods * signals;
  pw_system_free (first);
  if (!cmd->settings.free) snprintf (period, sizeof period, "period %.9g s", T);
  for (int k = 0; k < PW_PERIODIC_ATTEMPTS; k++) {
    size_t used = strlen (tried);
    snprintf (tried + used, sizeof tried - used, isfinite (cmd->residual[k]) ? "%s%d (%.2g)" : "%s%d (not begun)",
              k ? ", " : "", periodic_settling[k], cmd->residual[k]);
  }
  return pw_fail (
      error, PW_METHOD,
      "%s: no periodic motion with %s found: Newton's method, begun after this many periods of a run, ends at this "
      "residual (in units of the scene, L and L/T): %s%s%s; begin nearer to one (--start)%s",
      pw_file_name (cmd->line.m.file), period, tried, *cmd->reason ? "; " : "", cmd->reason,
      cmd->settings.free ? ", or give --guess"
                         : ", or add losses if the motion grows in every period, as that of a vehicle without any");
}

static int periodic_follow (pw_periodic_command *cmd, pw_error *error) {
  pw_periodic_orbit o;
  pw_progress progress = { .title = NULL };
  pw_vary_progress (&cmd->vary, &progress, cmd->settings.first, cmd->settings.first, cmd->settings.last);
  int status = pw_periodic_follow (cmd->search, 1, error); /* towards the last value */
  while (status == PW_OK && !periodic_set_stopped (cmd)) {
    status = pw_periodic_next (cmd->search, &o, error);
    if (status != PW_OK || o.event == PW_PERIODIC_END) break;
    status = periodic_add (cmd, &o, error);
    pw_vary_progress (&cmd->vary, &progress, cmd->settings.first, o.parameter, cmd->settings.last);
  }
  pw_progress_end (&progress);
  if (!periodic_set_stopped (cmd) || status != PW_METHOD) return status;
  *error = (pw_error){ .status = PW_OK }; /* the limit or Ctrl-C prevented the first step */
  return PW_OK;
}

enum {
  PERIODIC_MOST = 12,     /* multipliers in the text, at most */
  PERIODIC_POINTS = 12,   /* of a branch that are not events, in the text, about */
  PERIODIC_BODIES = 20,   /* in the figure, at most */
  PERIODIC_SAMPLES = 400, /* of one motion, in its figure */
  PERIODIC_CURVES = 3     /* over the parameter, see periodic_curve */
};
/* [SI units]  Smaller displacements, rotations, speeds and states are printed as 0, displacements also drawn as 0. */
#define PERIODIC_SMALL 1e-9
#define PERIODIC_WHOLE 1e-7 /* turns: the largest distance of a rotation from whole ones */

/* The names of pw_periodic_event; PW_PERIODIC_END has none: it is not stored. */
static const char *const periodic_events[] = { "point", "fold", "branch point", "period doubling", "Neimark-Sacker" };

/* Displacement of the first body in one period [m]: along its initial x axis, to the left of that, and in total. */
typedef struct {
  double along, left, total;
} periodic_displacement;

static periodic_displacement periodic_displace (const pw_periodic_orbit *o) {
  double x = o->end[0] - o->q[0], y = o->end[1] - o->q[1], c = cos (o->q[2]), s = sin (o->q[2]);
  return (periodic_displacement){ c * x + s * y, c * y - s * x, hypot (x, y) };
}

/* The largest modulus of the multipliers that are not trivial; NaN if there is none. */
static double periodic_largest (const pw_periodic_orbit *o) {
  return o->multipliers > o->trivial ? hypot (o->re[0], o->im[0]) : NAN;
}

static double periodic_round (double value) {
  return pw_rounded (value, PERIODIC_SMALL);
}

/* Change in one period of the angle of a body relative to the whole [rad], or of an internal coordinate: whole turns,
 * or by a symmetry, since nothing depends on it.  i: number of the body; of the coordinate, from number `bodies` on. */
static double periodic_rotation (const pw_system *s, const pw_periodic_orbit *o, int i) {
  const int bodies = pw_system_bodies (s), j = i < bodies ? 3 * i + 2 : i + 2 * bodies;
  return periodic_round (o->end[j] - o->q[j] - (i < bodies ? o->rotation : 0));
}

static int periodic_rotations (const pw_system *s) {
  return pw_system_coordinates (s) - pw_system_states (s) - 2 * pw_system_bodies (s);
}

/* The name of what turns: a body, or a coordinate. */
static const char *periodic_rotation_name (const pw_system *s, int i, char *text, size_t size) {
  const int bodies = pw_system_bodies (s);
  return i < bodies ? pw_system_body_name (s, i) : pw_system_state_name (s, i + 2 * bodies, text, size);
}

static void periodic_print_rotations (const pw_system *s, const pw_periodic_orbit *o) {
  char text[PW_NAME_BYTES];
  int shown = 0;
  for (int i = 0; i < periodic_rotations (s) && shown <= PERIODIC_MOST; i++) {
    const double rotation = periodic_rotation (s, o, i), turns = rotation / (2 * PW_PI), whole = round (turns);
    const char *name = periodic_rotation_name (s, i, text, sizeof text);
    if (rotation == 0) continue;
    printf (shown++ ? "                               " : "  relative to the whole        ");
    if (shown > PERIODIC_MOST)
      puts ("...");
    else if (fabs (turns - whole) < PERIODIC_WHOLE)
      printf ("%s: %.0f whole turn%s\n", name, whole, fabs (whole) == 1 ? "" : "s");
    else
      printf ("%s: a free rotation by %.6g rad\n", name, rotation);
  }
}

static void periodic_print_multipliers (const pw_periodic_orbit *o, int symmetries) {
  int nontrivial = o->multipliers - o->trivial, shown = 0, shift = o->trivial > symmetries;
  printf ("  Floquet multipliers          ");
  for (int i = 0; i < nontrivial; i++) {
    if (o->im[i] < 0 || shown++ >= PERIODIC_MOST) continue;
    if (shown > 1) printf ("\n                               ");
    printf (o->im[i] > 0 ? "%.6g +- %.6g i, modulus %.6g" : "%.6g", o->re[i], o->im[i], hypot (o->re[i], o->im[i]));
  }
  puts (nontrivial == 0 ? "none" : shown > PERIODIC_MOST ? " ..." : "");
  printf ("  trivial multipliers          %d%s%s\n", o->trivial, symmetries ? ", of symmetries" : "",
          !shift       ? ""
          : symmetries ? " and a shift in time"
                       : ", of a shift in time");
}

static const char *periodic_stability (const pw_periodic_orbit *o, char *text, size_t size) {
  double largest = periodic_largest (o);
  if (o->multipliers == o->trivial) return "no perturbations but trivial ones";
  if (o->unstable)
    snprintf (text, size, "unstable: %d growing, the fastest by a factor of %.6g per period", o->unstable, largest);
  else if (largest > 1 - 1e-6) /* with the tolerance of pw_periodic_orbit.unstable */
    snprintf (text, size, "neutral: not all perturbations decay");
  else
    snprintf (text, size, "stable: perturbations shrink to %.6g or less per period", largest);
  return text;
}

static void periodic_print_motion (const pw_periodic_command *cmd, const pw_periodic_orbit *o) {
  const periodic_displacement d = periodic_displace (o);
  char text[200];
  printf ("%s: a periodic motion%s\n\n", pw_file_name (cmd->line.m.file),
          pw_states_symmetries (pw_periodic_symmetries (cmd->search), text));
  printf ("  period                       %.9g s, %s\n", o->period, cmd->source);
  printf ("  displacement per period      %.6g m", periodic_round (d.total));
  printf (periodic_round (d.total) > 0 ? ": %.6g m along %s, %.6g m to its left\n" : "\n", periodic_round (d.along),
          pw_system_body_name (cmd->line.m.system, 0), periodic_round (d.left));
  printf ("  rotation per period          %.6g rad\n", periodic_round (o->rotation));
  periodic_print_rotations (cmd->line.m.system, o);
  printf ("  mean speed                   %.6g m/s\n", periodic_round (d.total / o->period));
  periodic_print_multipliers (o, pw_periodic_symmetries (cmd->search));
  printf ("  stability                    %s\n", periodic_stability (o, text, sizeof text));
  printf ("  residual                     %.1e after %s\n", o->residual, PW_COUNTED (o->iterations, "iteration"));
  puts ("\nInitial state");
  pw_states_print (cmd->line.m.system, o->q, o->v, 8, PERIODIC_SMALL);
}

/* Prints a row for each event and about PERIODIC_POINTS other points. */
static void periodic_print_branch (const pw_periodic_command *cmd) {
  static const char *const head[] = { "period [s]", "displacement [m]",   "rotation [rad]",
                                      "growing",    "largest multiplier", NULL };
  char text[40];
  printf ("%s: a branch of periodic motions%s, %s from %.9g to %.9g, %s\n\n", pw_file_name (cmd->line.m.file),
          pw_states_symmetries (pw_periodic_symmetries (cmd->search), text), cmd->vary.name, cmd->settings.first,
          cmd->settings.last, PW_COUNTED (cmd->points, "point"));
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -15, "event");
    pw_cell_unit (&t, 12, cmd->vary.name, cmd->vary.unit);
    pw_head (&t, 12, 12, head);
    for (int i = 0; i < cmd->points; i++) {
      const pw_periodic_orbit *o = &cmd->point[i].orbit;
      int stride = cmd->points / PERIODIC_POINTS + 1;
      const periodic_displacement d = periodic_displace (o);
      if (o->event == PW_PERIODIC_POINT && i % stride && i + 1 < cmd->points) continue;
      pw_cell (&t, -15,
               o->event != PW_PERIODIC_POINT ? periodic_events[o->event]
               : i == 0                      ? "begins"
               : i + 1 < cmd->points         ? ""
               : cmd->stopped                ? "stopped"
                                             : "ends");
      pw_cell_number (&t, 12, o->parameter, 9);
      pw_cell_number (&t, 12, o->period, 7);
      pw_cell_number (&t, 12, periodic_round (d.total), 6);
      pw_cell_number (&t, 12, periodic_round (o->rotation), 6);
      pw_cell_number (&t, 7, o->unstable, 3);
      pw_cell_number (&t, 12, periodic_largest (o), 6);
      pw_row_end (&t);
    }
  }
  double last = cmd->point[cmd->points - 1].orbit.parameter;
  if (!cmd->stopped && *pw_periodic_reason (cmd->search))
    printf ("\nThe branch ends at %s = %.9g: %s\n", cmd->vary.name, last, pw_periodic_reason (cmd->search));
}

static void periodic_json (const void *context, pw_json *j) {
  const pw_periodic_command *cmd = context;
  const pw_system *s = cmd->line.m.system;
  char text[PW_NAME_BYTES];
  pw_json_print (
      j, "{schema: %d, model: %s, parameter: %s, unit: %s, method: %s, symmetries: %d, complete: %i, motions: [", 1,
      pw_file_name (cmd->line.m.file), cmd->vary_text ? cmd->vary.name : NULL, cmd->vary.unit, cmd->settings.method,
      pw_periodic_symmetries (cmd->search), !cmd->stopped);
  for (const pw_periodic_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
    const pw_periodic_orbit *o = &p->orbit;
    const periodic_displacement d = periodic_displace (o);
    pw_json_print (j, "\n{");
    if (cmd->vary_text) pw_json_print (j, "parameter: %g, event: %s", o->parameter, periodic_events[o->event]);
    pw_json_print (j, "period: %g, displacement: %g, along: %g, left: %g, rotation: %g, rotations: {", o->period,
                   d.total, d.along, d.left, o->rotation);
    for (int i = 0; i < periodic_rotations (s); i++)
      pw_json_number (j, periodic_rotation_name (s, i, text, sizeof text), periodic_rotation (s, o, i));
    pw_json_print (j, "}, residual: %g, iterations: %d, growing: %d", o->residual, o->iterations, o->unstable);
    pw_states_json (s, o->q, o->v, "start", j);
    pw_states_json (s, o->end, o->end + pw_system_coordinates (s), "end", j);
    pw_json_open (j, "multipliers", '[');
    for (int i = 0; i < o->multipliers; i++)
      pw_json_print (j, "{re: %g, im: %g, trivial: %i}", o->re[i], o->im[i], i >= o->multipliers - o->trivial);
    pw_json_print (j, "]}");
  }
  pw_json_print (j, "]}");
}

static void periodic_csv (const void *context, pw_cells *t) {
  const pw_periodic_command *cmd = context;
  const pw_system *s = cmd->line.m.system;
  const int multipliers = cmd->point->orbit.multipliers; /* of every point */
  pw_cells_name (t, cmd->vary_text ? cmd->vary.name : "parameter", cmd->vary.unit);
  pw_cells_text (t, "event,period [s],displacement [m],rotation [rad],growing,residual");
  pw_states_header (s, t);
  pw_complex_header (t, multipliers, "");
  pw_cells_end (t);
  for (const pw_periodic_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
    const pw_periodic_orbit *o = &p->orbit;
    const periodic_displacement d = periodic_displace (o);
    pw_cells_number (t, cmd->vary_text ? o->parameter : NAN);
    pw_cells_text (t, periodic_events[o->event]);
    const double number[] = { o->period, d.total, o->rotation, o->unstable, o->residual };
    for (int k = 0; k < 5; k++) pw_cells_number (t, number[k]);
    pw_states_cells (s, p->state, t);
    pw_complex_cells (t, o->re, o->im, o->multipliers, multipliers);
    pw_cells_end (t);
  }
}

/* Stores x, y, phi, omega of the bodies drawn at PERIODIC_SAMPLES + 1 times of one period, one row for each. */
static int periodic_sample (const pw_periodic_command *cmd, int bodies, double *row, pw_error *error) {
  const pw_periodic_orbit *o = &cmd->point->orbit;
  const pw_settings settings = { .span = o->period,
                                 .rtol = 1e-9,
                                 .methods = cmd->line.methods }; /* finer than lines in a figure */
  int status;
  pw_run *r = pw_run_open (cmd->line.m.system, cmd->settings.method, &settings, error);
  if (r == NULL) return error->status;
  status = pw_run_restart (r, o->q, o->v, error);
  for (int i = 0; i <= PERIODIC_SAMPLES && status == PW_OK; i++) {
    double t = o->period * i / PERIODIC_SAMPLES;
    pw_sample sample;
    status = pw_run_advance_to (r, t, o->period, error);
    if (status == PW_OK) status = pw_run_sample (r, t, &sample, error);
    for (int b = 0; status == PW_OK && b < bodies; b++, row += 4) {
      memcpy (row, sample.q + 3 * b, 3 * sizeof *row);
      row[3] = sample.v[3 * b + 2];
    }
  }
  pw_run_close (r);
  return status;
}

/* Paths of the bodies, and their angular velocities over their angles. */
static void periodic_draw_motion (const pw_periodic_command *cmd, pw_curves *c) {
  const int all = pw_system_bodies (cmd->line.m.system), bodies = all < PERIODIC_BODIES ? all : PERIODIC_BODIES;
  double *row = malloc ((size_t)(4 * bodies * (PERIODIC_SAMPLES + 1) + 1) * sizeof *row);
  int status = row ? periodic_sample (cmd, bodies, row, &c->error) : pw_fail (&c->error, PW_RESOURCE, "out of memory");
  for (int phase = 0; phase < 2 && status == PW_OK; phase++) {
    pw_curves_panel (
        c, phase ? &(pw_panel){ .x_label = "φ [rad]", .y_label = "ω [rad/s]", .aspect = 1, .type = PW_PANEL_HALF }
                 : &(pw_panel){ .x_label = "x [m]", .y_label = "y [m]", .type = PW_PANEL_EQUAL });
    for (int b = 0; b < bodies; b++) {
      char name[FIGURE_NAME + 4];
      pw_curves_add (c, "line", pw_figure_name (pw_system_body_name (cmd->line.m.system, b), name));
      for (const double *at = row + 4 * b; at < row + 4 * bodies * (PERIODIC_SAMPLES + 1); at += 4 * bodies)
        pw_curves_point (c, at[2 * phase], at[2 * phase + 1], 0);
    }
    if (phase) continue;
    pw_curves_add (c, "numbered", NULL); /* the beginning and the end of each path */
    for (int b = 0; b < bodies; b++)
      for (int end = 0; end <= PERIODIC_SAMPLES; end += PERIODIC_SAMPLES)
        pw_curves_point (c, row[4 * (b + bodies * end)], row[4 * (b + bodies * end) + 1], b + 1);
  }
  free (row);
}

/* The ordinate of curve k over the parameter: displacement [m], modulus of the largest multiplier, period [s]. */
static double periodic_curve (const pw_periodic_orbit *o, int k) {
  const periodic_displacement d = periodic_displace (o);
  return k == 0 ? periodic_round (d.total) : k == 1 ? periodic_largest (o) : o->period;
}

/* Curves over the parameter, of what is not constant. */
static void periodic_draw_branch (const pw_periodic_command *cmd, pw_curves *c, const double range[2]) {
  static const char *const label[PERIODIC_CURVES] = { "displacement [m]", "largest modulus", "period [s]" };
  for (int k = 0; k < PERIODIC_CURVES; k++) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < cmd->points; i++) {
      low = fmin (low, periodic_curve (&cmd->point[i].orbit, k));
      high = fmax (high, periodic_curve (&cmd->point[i].orbit, k));
    }
    if (!(high - low > 1e-9 * fabs (high))) continue;
    pw_curves_panel (c, &(pw_panel){ .x_label = PW_FIGURE_LABEL (cmd->vary.name, cmd->vary.unit),
                                     .y_label = label[k],
                                     .x = { range[0], range[1] },
                                     .type = PW_PANEL_BELOW });
    /* the parts whose motions have no growing perturbations, then those whose motions have some; a point where one part
     * ends and the next begins belongs to both; from an event on, the stability is that of the next point */
    for (int stable = 1; stable >= 0; stable--) {
      int inside = 0; /* 1: the last point began or continued a part */
      pw_curves_add (c, stable ? "stable" : "unstable", stable ? "stable" : "unstable");
      for (const pw_periodic_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
        int last = p + 1 == cmd->point + cmd->points;
        const pw_periodic_point *after = p->orbit.event == PW_PERIODIC_POINT ? p : p + 1;
        int here = !last && (after->orbit.unstable == 0) == stable;
        if (here || inside) pw_curves_point (c, p->orbit.parameter, periodic_curve (&p->orbit, k), 0);
        if (!here) pw_curves_point (c, NAN, NAN, 0);
        inside = here;
      }
    }
  }
}

/* The multipliers of all points, the trivial ones as rings, and the unit circle. */
static void periodic_draw_multipliers (const pw_periodic_command *cmd, pw_curves *c, const double range[2]) {
  const char *scale = PW_FIGURE_LABEL (cmd->vary.name, cmd->vary.unit); /* lives as long as this block */
  double reach = 1;
  for (int i = 0; i < cmd->points; i++) reach = fmax (reach, periodic_largest (&cmd->point[i].orbit));
  pw_panel panel = { .x_label = "real part", .y_label = "imaginary part", .aspect = 1 };
  if (cmd->vary_text) panel.z_label = scale;
  panel.type = cmd->vary_text ? 0 : PW_PANEL_HALF;
  panel.x[1] = panel.y[1] = 1.12 * reach, panel.x[0] = panel.y[0] = -panel.x[1];
  panel.z[0] = range[0], panel.z[1] = range[1];
  pw_curves_panel (c, &panel);
  pw_curves_add (c, "thin", NULL);
  for (int i = 0; i <= 200; i++) pw_curves_point (c, cos (2 * PW_PI * i / 200), sin (2 * PW_PI * i / 200), 0);
  for (int trivial = 1; trivial >= 0; trivial--) {
    pw_curves_add (c, trivial ? "rings" : cmd->vary_text ? "scale" : "dots", NULL);
    for (int k = 0; k < cmd->points; k++) {
      const pw_periodic_orbit *o = &cmd->point[k].orbit;
      for (int i = 0; i < o->multipliers; i++)
        if ((i >= o->multipliers - o->trivial) == trivial) pw_curves_point (c, o->re[i], o->im[i], o->parameter);
    }
  }
}

static void periodic_draw (const void *context, pw_curves *c) {
  const pw_periodic_command *cmd = context;
  const double range[] = { fmin (cmd->settings.first, cmd->settings.last),
                           fmax (cmd->settings.first, cmd->settings.last) };
  if (cmd->vary_text)
    periodic_draw_branch (cmd, c, range);
  else
    periodic_draw_motion (cmd, c);
  periodic_draw_multipliers (cmd, c, range);
}

static const pw_results periodic_results = {
  .name = "periodic",
  .title = "periodic motions",
  .takes_folder = 1,
  .lines = 1,
  .table = periodic_csv,
  .json = periodic_json,
  .draw = periodic_draw,
};

static int periodic_command (void *options, pw_error *error) {
  pw_periodic_command *cmd = options;
  pw_results results = periodic_results;
  if (cmd->vary_text == NULL) results.title = "periodic motion over one period, Floquet multipliers";
  int status = pw_cli_open (&cmd->line, error);
  if (status == PW_OK) status = periodic_read_options (cmd, error);
  if (status == PW_OK) status = pw_results_open (&cmd->line, &results, pw_cli_tables, (pw_use){ 0 }, error);
  if (status == PW_OK) pw_report_model (&cmd->line.m), pw_cli_report_tables (cmd->line.m.system, cmd->settings.period);
  if (status == PW_OK) {
    pw_periodic_orbit o;
    pw_limit_start (&cmd->limit);
    cmd->search = pw_periodic_open (cmd->line.m.system, &cmd->settings, error);
    if (cmd->search == NULL && error->status == PW_METHOD && periodic_set_stopped (cmd)) *error = (pw_error){ 0 };
    pw_stop_catch ();
    status = cmd->search ? periodic_find (cmd, &o, error) : error->status;
    if (status == PW_RETRY && !periodic_set_stopped (cmd)) status = periodic_fail (cmd, error);
    if (status == PW_OK && cmd->search)
      status = cmd->vary_text ? periodic_follow (cmd, error) : periodic_add (cmd, &o, error);
    pw_stop_release ();
    if (status == PW_RETRY) status = PW_OK;
  }
  if (status == PW_OK && cmd->points && cmd->vary_text) periodic_print_branch (cmd);
  if (status == PW_OK && cmd->points && !cmd->vary_text) periodic_print_motion (cmd, &cmd->point->orbit);
  if (status == PW_OK && cmd->points) status = pw_results_write (&cmd->line, &results, cmd, error);
  for (int i = 0; i < cmd->points; i++) free (cmd->point[i].state);
  free (cmd->point);
  pw_periodic_close (cmd->search);
  return status == PW_OK && cmd->stopped ? pw_cli_incomplete (&cmd->line, error) : status;
}

static const struct poptOption periodic_options_table[] = {
  PW_OPTION_GROUP ("Periodic motions"),
  PW_TEXT_OPTION (pw_periodic_command, period_text, "period", 0, "T|free",
                  "Period [s] (default that of the signals); free: sought, if no signal changes with time"),
  PW_NUMBER_OPTION (pw_periodic_command, periods, "periods", 0, "N", PW_COUNT,
                    "Repeat after N periods of the signals (default 1)"),
  PW_NUMBER_OPTION (pw_periodic_command, guess, "guess", 0, "T", PW_POSITIVE,
                    "First guess of a free period [s] (default: the time of the first return)"),
  PW_TEXT_OPTION (pw_periodic_command, vary_text, "vary", 0, "PARAM=LOW:HIGH", "Follow the motion over a parameter"),
  PW_RESULTS_OPTIONS ("Write the motion or branch as a table", "Write the results", "Draw a figure"),
  PW_TEXT_OPTION (pw_cli_line, method, "method", 'm', "METHOD", "Adaptive integrator (default erk8+projection)"),
  PW_METHOD_FILE_OPTION,
  PW_NUMBER_OPTION (pw_cli_line, rtol, "rtol", 0, "R", PW_POSITIVE, "Relative tolerance (default 1e-12)"),
  PW_LIMIT_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_periodic = {
  .name = "periodic",
  .synopsis = "MODEL [OPTION...]",
  .summary = "find periodic motions, and follow them over a parameter",
  .help = "Find a motion that repeats after one period but for a displacement in the plane, such as a gait, with the "
          "displacement per period and Floquet multipliers, which say how perturbations change in one period; with "
          "--vary, follow it over a parameter.",
  .options_size = sizeof (pw_periodic_command),
  .function = periodic_command,
  .options = periodic_options_table,
};
