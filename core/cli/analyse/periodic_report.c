/* The reports of `pinwheel periodic`. */
#include "periodic_report.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "print_table.h"
#include "states.h"
#include "text.h"

enum { PERIODIC_SHOWN = 12, PERIODIC_BODIES = 20, PERIODIC_SAMPLES = 400, PERIODIC_CURVES = 3 };
static const double PERIODIC_SMALL = 1e-9; /* displacements shown as 0 */

static const char *const periodic_events[] = { "point", "fold", "branch point", "period doubling", "Neimark-Sacker" };

/* ---- Quantities ---- */

/* Displacement of the first body: along and across its initial direction, and its length [m]. */
static void periodic_displacement (const pw_periodic_orbit *o, double d[3]) {
  double x = o->end[0] - o->q[0], y = o->end[1] - o->q[1], c = cos (o->q[2]), s = sin (o->q[2]);
  d[0] = c * x + s * y, d[1] = c * y - s * x, d[2] = hypot (x, y);
}

static double periodic_largest (const pw_periodic_orbit *o) {
  return o->multipliers > o->trivial ? hypot (o->re[0], o->im[0]) : NAN;
}

/* ---- Text ---- */

static double periodic_round (double value) {
  return fabs (value) < PERIODIC_SMALL ? 0 : value;
}

static void periodic_multipliers (const pw_periodic_orbit *o, int symmetries) {
  int own = o->multipliers - o->trivial, shown = 0, more = 0;
  printf ("  Floquet multipliers          ");
  for (int i = 0; i < own; i++) {
    if (o->im[i] < 0) continue;
    if (shown == PERIODIC_SHOWN) {
      more = 1;
      break;
    }
    if (shown++) printf ("\n                               ");
    printf (o->im[i] > 0 ? "%.6g +- %.6g i, modulus %.6g" : "%.6g", o->re[i], o->im[i], hypot (o->re[i], o->im[i]));
  }
  puts (own == 0 ? "none" : more ? " ..." : "");
  printf ("  trivial multipliers          %d%s%s\n", o->trivial, symmetries ? ", of symmetries" : "",
          o->trivial > symmetries ? ", of a shift in time" : "");
}

static const char *periodic_verdict (const pw_periodic_orbit *o, char *text, size_t size) {
  double most = periodic_largest (o);
  if (o->multipliers == o->trivial) return "no perturbations but shifts along symmetries";
  if (o->unstable)
    snprintf (text, size, "unstable: %d growing, the fastest by a factor of %.6g per period", o->unstable, most);
  else if (most > 1 - 1e-6)
    snprintf (text, size, "neutral: not all perturbations decay");
  else
    snprintf (text, size, "stable: perturbations shrink to %.6g or less per period", most);
  return text;
}

static void periodic_one (const pw_periodic_cli *x, const pw_periodic_orbit *o) {
  double d[3];
  char text[200];
  periodic_displacement (o, d);
  printf ("%s: a periodic motion%s\n\n", pw_file_name (x->m.file),
          pw_states_symmetries (pw_periodic_symmetries (x->search), text));
  printf ("  period                       %.9g s, %s\n", o->period, x->source);
  printf ("  displacement per period      %.6g m", periodic_round (d[2]));
  printf (periodic_round (d[2]) > 0 ? ": %.6g m along %s, %.6g m to its left\n" : "\n", periodic_round (d[0]),
          pw_system_body_name (x->m.system, 0), periodic_round (d[1]));
  printf ("  rotation per period          %.6g rad\n", periodic_round (o->rotation));
  printf ("  mean speed                   %.6g m/s\n", periodic_round (d[2] / o->period));
  periodic_multipliers (o, pw_periodic_symmetries (x->search));
  printf ("  stability                    %s\n", periodic_verdict (o, text, sizeof text));
  printf ("  residual                     %.1e after %d iterations\n", o->residual, o->iterations);
  puts ("\nInitial state");
  pw_states_print (x->m.system, o->q, o->v, 8, PERIODIC_SMALL);
}

static void periodic_branch (const pw_periodic_cli *x) {
  char text[40];
  printf ("%s: a branch of periodic motions%s, %s from %.9g to %.9g, %d points\n\n", pw_file_name (x->m.file),
          pw_states_symmetries (pw_periodic_symmetries (x->search), text), x->vary.name, x->set.first, x->set.last,
          x->points);
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -15, "event");
    *x->vary.unit ? pw_cell_unit (&t, 12, x->vary.name, x->vary.unit) : pw_cell (&t, 12, x->vary.name);
    for (int k = 0; k < 5; k++)
      pw_cell (
          &t, 12,
          (const char *[]){ "period [s]", "displacement [m]", "rotation [rad]", "growing", "largest multiplier" }[k]);
    pw_row_end (&t);
    for (int i = 0; i < x->points; i++) {
      const pw_periodic_orbit *o = &x->point[i].orbit;
      int stride = x->points / PERIODIC_SHOWN + 1;
      double d[3];
      if (o->event == PW_PERIODIC_POINT && i % stride && i + 1 < x->points) continue;
      periodic_displacement (o, d);
      pw_cell (&t, -15,
               o->event != PW_PERIODIC_POINT ? periodic_events[o->event]
               : i == 0                      ? "begins"
               : i + 1 < x->points           ? ""
                                             : "ends");
      pw_cell_number (&t, 12, o->parameter, 9);
      pw_cell_number (&t, 12, o->period, 7);
      pw_cell_number (&t, 12, periodic_round (d[2]), 6);
      pw_cell_number (&t, 12, periodic_round (o->rotation), 6);
      pw_cell_number (&t, 7, o->unstable, 3);
      pw_cell_number (&t, 12, periodic_largest (o), 6);
      pw_row_end (&t);
    }
  }
  double last = x->point[x->points - 1].orbit.parameter;
  if (!x->stopped && *pw_periodic_reason (x->search))
    printf ("\nThe branch ends at %s = %.9g: %s\n", x->vary.name, last, pw_periodic_reason (x->search));
}

void pw_periodic_print (const pw_periodic_cli *x) {
  if (x->vary_text)
    periodic_branch (x);
  else
    periodic_one (x, &x->point->orbit);
}

/* ---- JSON ---- */

static void periodic_point_json (const pw_periodic_cli *x, const pw_periodic_orbit *o, pw_json *j) {
  int n = pw_system_coordinates (x->m.system);
  double d[3];
  periodic_displacement (o, d);
  j->line = 1;
  pw_json_open (j, NULL, '{');
  if (x->vary_text) pw_json_number (j, "parameter", o->parameter);
  if (x->vary_text) pw_json_text (j, "event", periodic_events[o->event]);
  pw_json_number (j, "period", o->period);
  pw_json_number (j, "displacement", d[2]);
  pw_json_number (j, "along", d[0]);
  pw_json_number (j, "left", d[1]);
  pw_json_number (j, "rotation", o->rotation);
  pw_json_number (j, "residual", o->residual);
  pw_json_number (j, "iterations", o->iterations);
  pw_json_number (j, "growing", o->unstable);
  pw_states_json (x->m.system, o->q, o->v, "start", j);
  pw_states_json (x->m.system, o->end, o->end + n, "end", j);
  pw_json_open (j, "multipliers", '[');
  for (int i = 0; i < o->multipliers; i++) {
    pw_json_open (j, NULL, '{');
    pw_json_number (j, "re", o->re[i]);
    pw_json_number (j, "im", o->im[i]);
    pw_json_flag (j, "trivial", i >= o->multipliers - o->trivial);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

static void periodic_json (const void *context, pw_json *j) {
  const pw_periodic_cli *x = context;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_text (j, "parameter", x->vary_text ? x->vary.name : NULL);
  pw_json_text (j, "unit", x->vary.unit);
  pw_json_text (j, "method", x->set.method);
  pw_json_number (j, "symmetries", pw_periodic_symmetries (x->search));
  pw_json_flag (j, "complete", !x->stopped);
  j->line = 1;
  pw_json_open (j, "motions", '[');
  for (int i = 0; i < x->points; i++) periodic_point_json (x, &x->point[i].orbit, j);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- The table ---- */

static int periodic_csv (const void *context, FILE *f, pw_error *error) {
  const pw_periodic_cli *x = context;
  const pw_system *s = x->m.system;
  int states = 2 * pw_system_coordinates (s), most = x->point->orbit.multipliers;
  pw_text t = { .chars = NULL };
  char name[300];
  pw_text_name (&t, x->vary_text ? x->vary.name : "parameter", x->vary.unit);
  pw_text_cell (&t, "event,period [s],displacement [m],rotation [rad],growing,residual");
  pw_states_head (s, &t);
  for (int i = 1; i <= most; i++)
    for (int k = 0; k < 2; k++) snprintf (name, sizeof name, "%s%d", k ? "im" : "re", i), pw_text_cell (&t, name);
  int status = pw_text_line (&t, f, x->folder, error);
  for (const pw_periodic_point *p = x->point; status == PW_OK && p < x->point + x->points; p++) {
    const pw_periodic_orbit *o = &p->orbit;
    double d[3];
    periodic_displacement (o, d);
    pw_text_number (&t, x->vary_text ? o->parameter : NAN);
    pw_text_cell (&t, periodic_events[o->event]);
    const double number[] = { o->period, d[2], o->rotation, o->unstable, o->residual };
    for (int k = 0; k < 5; k++) pw_text_number (&t, number[k]);
    for (int i = 0; i < states; i++) pw_text_number (&t, p->state[i]);
    for (int i = 0; i < most; i++)
      for (int k = 0; k < 2; k++) pw_text_number (&t, i < o->multipliers ? (k ? o->im : o->re)[i] : NAN);
    status = pw_text_line (&t, f, x->folder, error);
  }
  return status;
}

/* ---- The figure: paths and angular velocities, or curves over the parameter; multipliers and the unit circle ---- */

/* t / T, then x, y, phi, omega of the bodies, over one period. */
static int periodic_motion (const pw_periodic_cli *x, const pw_periodic_orbit *o, FILE *f, pw_error *error) {
  const pw_settings settings = { .span = o->period, .rtol = 1e-9 };
  int bodies = pw_system_bodies (x->m.system), status;
  pw_run *r = pw_run_open (x->m.system, x->set.method, &settings, error);
  if (r == NULL) return error->status;
  status = pw_run_restart (r, o->q, o->v, error);
  for (int i = 0; i <= PERIODIC_SAMPLES && status == PW_OK; i++) {
    double t = o->period * i / PERIODIC_SAMPLES;
    pw_sample sample;
    status = pw_run_advance_to (r, t, o->period, error);
    if (status == PW_OK) status = pw_run_sample (r, t, &sample, error);
    if (status != PW_OK) break;
    fprintf (f, "%.9g", (double)i / PERIODIC_SAMPLES);
    for (int b = 0; b < bodies && b < PERIODIC_BODIES; b++)
      fprintf (f, " %.9g %.9g %.9g %.9g", sample.q[3 * b], sample.q[3 * b + 1], sample.q[3 * b + 2],
               sample.v[3 * b + 2]);
    fputs ("\n", f);
  }
  pw_run_close (r);
  return status;
}

/* What is drawn over the parameter. */
static double periodic_curve (const pw_periodic_orbit *o, int k) {
  double d[3];
  periodic_displacement (o, d);
  return k == 0 ? periodic_round (d[2]) : k == 1 ? periodic_largest (o) : o->period;
}

/* Lines of the branch that are stable or not; points belong to the piece after them, and end the one before. */
static void periodic_line (const pw_periodic_cli *x, FILE *f, int stable) {
  int drawing = 0;
  for (const pw_periodic_point *p = x->point; p < x->point + x->points; p++) {
    int last = p + 1 == x->point + x->points;
    int here = !last && (p[p->orbit.event != PW_PERIODIC_POINT].orbit.unstable == 0) == stable;
    if (here || drawing) {
      fprintf (f, "%.10g", p->orbit.parameter);
      for (int k = 0; k < PERIODIC_CURVES; k++) fprintf (f, " %.9g", periodic_curve (&p->orbit, k));
      fputs ("\n", f);
    }
    if (drawing && !here) fputs ("\n", f);
    drawing = here;
  }
  fputs ("nan nan nan nan\n\n\n", f);
}

static void periodic_multipliers_data (const pw_periodic_cli *x, FILE *f, int trivial) {
  for (const pw_periodic_point *p = x->point; p < x->point + x->points; p++)
    for (int i = 0; i < p->orbit.multipliers; i++)
      if ((i >= p->orbit.multipliers - p->orbit.trivial) == trivial)
        fprintf (f, "%.9g %.9g %.10g\n", p->orbit.re[i], p->orbit.im[i], p->orbit.parameter);
  fputs ("nan nan nan\n\n\n", f);
}

static int periodic_data (const void *context, FILE *f, pw_error *error) {
  const pw_periodic_cli *x = context;
  int status = PW_OK;
  if (x->vary_text) {
    fputs ("# parameter, displacement [m], largest multiplier, period [s]: stable parts; unstable ones; events; "
           "multipliers; "
           "trivial ones\n",
           f);
    for (int stable = 1; stable >= 0; stable--) periodic_line (x, f, stable);
    for (const pw_periodic_point *p = x->point; p < x->point + x->points; p++)
      if (p->orbit.event != PW_PERIODIC_POINT) fprintf (f, "%.10g %d\n", p->orbit.parameter, p->orbit.event);
    fputs ("nan nan\n\n\n", f);
  } else {
    fputs ("# t / T, then x [m], y [m], phi [rad], omega [rad/s] of each body; multipliers; trivial ones\n", f);
    status = periodic_motion (x, &x->point->orbit, f, error);
    fputs ("\n\n", f);
  }
  for (int trivial = 0; trivial < 2; trivial++) periodic_multipliers_data (x, f, trivial);
  return status;
}

static void periodic_variables (const void *context, FILE *f) {
  const pw_periodic_cli *x = context;
  int bodies = pw_system_bodies (x->m.system);
  double largest = 0;
  if (bodies > PERIODIC_BODIES) bodies = PERIODIC_BODIES;
  pw_figure_label (f, "label_of_x", 0, x->vary.name, x->vary.unit);
  fprintf (f, "branch = %d\nfirst = %.10g\nlast = %.10g\nbodies = %d\narray body[%d]\n", x->vary_text != NULL,
           fmin (x->set.first, x->set.last), fmax (x->set.first, x->set.last), bodies, bodies ? bodies : 1);
  for (int i = 0; i < x->points; i++) largest = fmax (largest, periodic_largest (&x->point[i].orbit));
  fprintf (f, "largest = %.9g\narray low[3]\narray high[3]\n", largest);
  for (int k = 0; k < PERIODIC_CURVES; k++) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < x->points; i++) {
      low = fmin (low, periodic_curve (&x->point[i].orbit, k));
      high = fmax (high, periodic_curve (&x->point[i].orbit, k));
    }
    fprintf (f, "low[%d] = %.9g\nhigh[%d] = %.9g\n", k + 1, isfinite (low) ? low : 0, k + 1,
             isfinite (high) ? high : 0);
  }
  for (int b = 0; b < bodies; b++) pw_figure_element (f, "body", b + 1, pw_system_body_name (x->m.system, b));
}

int pw_periodic_write (const pw_periodic_cli *x, pw_error *error) {
  int status = pw_figure_tables (x->folder, "periodic", 1, x, periodic_csv, periodic_json, error);
  if (status != PW_OK) return status;
  return pw_figure_write (&x->line, &x->m, x->folder, "periodic", x, periodic_data, periodic_variables, error);
}
