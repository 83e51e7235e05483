/* The reports of `pinwheel steady`. */
#include "steady_report.h"
#include <math.h>
#include <stdlib.h>
#include "figure.h"
#include "print_table.h"
#include "states.h"
#include "text.h"

enum { STEADY_DIGITS = 6, STEADY_SHOWN = 12, STEADY_CONFIGURATIONS = 3, STEADY_EVENTS = 40 };
static const double STEADY_SMALL = 1e-12; /* shown as 0 */

static const char *const steady_events[] = { "point", "fold", "zero eigenvalue", "Hopf" };

/* ---- Text ---- */

/* A number, 0 for round-off. */
static void steady_number (pw_table *t, double value) {
  pw_cell_number (t, 12, fabs (value) < STEADY_SMALL ? 0 : value, STEADY_DIGITS);
}

/* Real part and frequency of the rightmost eigenvalue, of events of that which crosses the imaginary axis. */
static void steady_rightmost (pw_table *t, const pw_steady_point *p) {
  const pw_linear *l = &p->linear;
  int best = -1, crossing = p->motion.event != PW_STEADY_POINT;
  for (int i = 0; i < l->unknowns; i++) {
    if (!crossing && (l->rigid[i] || (l->re[i] == 0 && l->im[i] == 0))) continue;
    if ((l->im[i] != 0) != (p->motion.event == PW_STEADY_OSCILLATION) && crossing) continue;
    if (best < 0 || (crossing && fabs (l->re[i]) < fabs (l->re[best]))) best = i;
  }
  double im = best < 0 ? NAN : fabs (l->im[best]);
  steady_number (t, best < 0 ? NAN : crossing ? round (l->re[best] * 1e8) / 1e8 + 0 : l->re[best]);
  steady_number (t, im > 0 ? im / (2 * PW_PI) : NAN);
}

static double steady_held (const pw_steady_cli *x, const pw_steady_point *p, const char *quantity) {
  char name[300];
  pw_error none = { 0 };
  const pw_system *s = x->m.system;
  snprintf (name, sizeof name, "%s.%s", pw_system_body_name (s, 0), quantity);
  int held = pw_system_find_held (s, name, &none);
  return held < 0 ? NAN : pw_system_held_value (s, held, p->motion.q, p->motion.v);
}

static void steady_cell_name (pw_table *t, const pw_steady_cli *x, const char *quantity, const char *unit) {
  char name[300];
  snprintf (name, sizeof name, "%s.%s", pw_system_body_name (x->m.system, 0), quantity);
  pw_cell_unit (t, 12, name, unit);
}

/* A row for each motion. */
static void steady_motions (const pw_steady_cli *x) {
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, 6, "motion");
    steady_cell_name (&t, x, "speed", "m/s");
    steady_cell_name (&t, x, "omega", "rad/s");
    for (int k = 0; k < 5; k++)
      pw_cell (&t, 7, (const char *[]){ "family", "growing", "rightmost [1/s]", "frequency [Hz]", "residual" }[k]);
    pw_row_end (&t);
    for (int i = 0; i < x->points && i < STEADY_SHOWN; i++) {
      const pw_steady_point *p = x->point + i;
      pw_cell_number (&t, 6, i + 1, 6);
      steady_number (&t, steady_held (x, p, "speed"));
      steady_number (&t, steady_held (x, p, "omega"));
      pw_cell_number (&t, 7, p->motion.family, 6);
      pw_cell_number (&t, 7, p->motion.unstable, 6);
      steady_rightmost (&t, p);
      pw_cell_number (&t, 8, p->motion.residual, 2);
      pw_row_end (&t);
    }
  }
  if (x->points > STEADY_SHOWN) printf ("  and %d more, see -o DIR\n", x->points - STEADY_SHOWN);
}

/* A row for the ends of each branch and each event, of which only the first ones are shown. */
static void steady_branches (const pw_steady_cli *x) {
  int events = 0;
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    events = 0;
    pw_cell (&t, 6, "branch");
    pw_cell (&t, -15, "event");
    *x->vary.unit ? pw_cell_unit (&t, 12, x->vary.name, x->vary.unit) : pw_cell (&t, 12, x->vary.name);
    for (int k = 0; k < 3; k++) pw_cell (&t, 7, (const char *[]){ "growing", "rightmost [1/s]", "frequency [Hz]" }[k]);
    pw_row_end (&t);
    for (const pw_steady_point *p = x->point; p < x->point + x->points; p++) {
      int first = p == x->point || p[-1].branch != p->branch,
          last = p == x->point + x->points - 1 || p[1].branch != p->branch;
      if (!first && !last && (p->motion.event == PW_STEADY_POINT || ++events > STEADY_EVENTS)) continue;
      pw_cell_number (&t, 6, p->branch, 6);
      pw_cell (&t, -15,
               first                                ? "begins"
               : p->motion.event != PW_STEADY_POINT ? steady_events[p->motion.event]
                                                    : "ends");
      pw_cell_number (&t, 12, p->motion.parameter, 9);
      pw_cell_number (&t, 7, p->motion.unstable, 6);
      steady_rightmost (&t, p);
      pw_row_end (&t);
    }
  }
  if (events > STEADY_EVENTS) printf ("and %d more events, see -o DIR\n", events - STEADY_EVENTS);
  for (int i = 0; i < x->branches; i++)
    if (*x->end[i]) printf ("Branch %d ends: %s\n", i + 1, x->end[i]);
}

void pw_steady_print (const pw_steady_cli *x) {
  char text[40];
  const char *model = pw_file_name (x->m.file),
             *symmetries = pw_states_symmetries (pw_steady_symmetries (x->steady), text);
  if (x->vary_text) {
    printf ("%s: %d %s of steady motions%s, %s from %.9g to %.9g\n\n", model, x->branches,
            x->branches == 1 ? "branch" : "branches", symmetries, x->vary.name, x->set.first, x->set.last);
    steady_branches (x);
    return;
  }
  printf ("%s: %d steady %s%s, from the initial state and %d random ones\n\n", model, x->points,
          x->points == 1 ? "motion" : "motions", symmetries, x->attempts);
  steady_motions (x);
  for (int i = 0; i < x->points && i < STEADY_CONFIGURATIONS; i++) {
    const pw_steady_motion *m = &x->point[i].motion;
    printf ("\nMotion %d, found from %s\n", i + 1, x->point[i].attempt > 1 ? "a random state" : "the initial state");
    pw_states_print (x->m.system, m->q, m->v, STEADY_DIGITS, STEADY_SMALL);
  }
  for (int i = 0; i < x->points && i < STEADY_SHOWN; i++)
    if (*x->point[i].advice)
      printf ("\nMotion %d is one of a family of dimension %d; to select one:%s\n", i + 1, x->point[i].motion.family,
              x->point[i].advice);
}

/* ---- JSON ---- */

static void steady_eigenvalues_json (const pw_linear *l, pw_json *j) {
  pw_json_open (j, "eigenvalues", '[');
  for (int i = 0; i < l->unknowns; i++) {
    pw_json_open (j, NULL, '{');
    pw_json_number (j, "re", l->re[i]);
    pw_json_number (j, "im", l->im[i]);
    pw_json_number (j, "frequency_hz", fabs (l->im[i]) / (2 * PW_PI));
    pw_json_flag (j, "rigid", l->rigid[i]);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

static void steady_point_json (const pw_steady_cli *x, const pw_steady_point *p, pw_json *j) {
  const pw_system *s = x->m.system;
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "branch", p->branch);
  if (x->vary_text) pw_json_text (j, "event", steady_events[p->motion.event]);
  if (x->vary_text) pw_json_number (j, "parameter", p->motion.parameter);
  pw_json_number (j, "attempt", p->attempt);
  pw_json_number (j, "residual", p->motion.residual);
  if (!x->vary_text) pw_json_number (j, "family", p->motion.family);
  pw_json_number (j, "growing", p->motion.unstable);
  pw_numbers_json (j, "twist", p->linear.twist, 3);
  pw_states_json (s, p->motion.q, p->motion.v, "state", j);
  steady_eigenvalues_json (&p->linear, j);
  pw_json_close (j, '}');
}

static void steady_json (const void *context, pw_json *j) {
  const pw_steady_cli *x = context;
  char name[300];
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_text (j, "parameter", x->vary_text ? x->vary.name : NULL);
  pw_json_text (j, "unit", x->vary.unit);
  pw_json_open (j, "held", '{');
  for (int i = 0; i < x->set.holds; i++)
    if (i != x->set.vary)
      pw_json_number (j, pw_system_held_name (x->m.system, x->hold[i].state, name, sizeof name), x->hold[i].value);
  pw_json_close (j, '}');
  pw_json_number (j, "symmetries", pw_steady_symmetries (x->steady));
  pw_json_number (j, "attempts", x->attempts + 2);
  pw_json_flag (j, "complete", !x->stopped);
  pw_json_open (j, "ends", '[');
  for (int i = 0; x->vary_text && i < x->branches; i++) pw_json_text (j, NULL, x->end[i]);
  pw_json_close (j, ']');
  j->line = 1;
  pw_json_open (j, "motions", '[');
  for (int i = 0; i < x->points; i++) steady_point_json (x, x->point + i, j);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- The table ---- */

/* The largest number of eigenvalues of a point. */
static int steady_eigenvalues (const pw_steady_cli *x) {
  int most = 0;
  for (int i = 0; i < x->points; i++)
    if (x->point[i].linear.unknowns > most) most = x->point[i].linear.unknowns;
  return most;
}

static int steady_csv (const void *context, FILE *f, pw_error *error) {
  const pw_steady_cli *x = context;
  const pw_system *s = x->m.system;
  int states = 2 * pw_system_coordinates (s), most = steady_eigenvalues (x);
  pw_text t = { .chars = NULL };
  char name[300];
  pw_text_cell (&t, "branch,event");
  pw_text_name (&t, x->vary_text ? x->vary.name : "parameter", x->vary.unit);
  pw_text_cell (&t, "growing,residual");
  pw_states_head (s, &t);
  for (int i = 1; i <= most; i++)
    for (int k = 0; k < 2; k++)
      snprintf (name, sizeof name, "%s%d", k ? "im" : "re", i), pw_text_name (&t, name, "1/s");
  int status = pw_text_line (&t, f, x->folder, error);
  for (const pw_steady_point *p = x->point; status == PW_OK && p < x->point + x->points; p++) {
    pw_text_number (&t, p->branch);
    pw_text_cell (&t, steady_events[p->motion.event]);
    pw_text_number (&t, p->motion.parameter);
    pw_text_number (&t, p->motion.unstable);
    pw_text_number (&t, p->motion.residual);
    for (int i = 0; i < states; i++) pw_text_number (&t, p->state[i]);
    for (int i = 0; i < most; i++)
      for (int k = 0; k < 2; k++)
        pw_text_number (&t, i < p->linear.unknowns ? (k ? p->linear.im : p->linear.re)[i] : NAN);
    status = pw_text_line (&t, f, x->folder, error);
  }
  return status;
}

/* ---- The figure ---- */

/* Whether the part of a branch from p to the next point is stable: events belong to both sides. */
static int steady_stable (const pw_steady_point *p) {
  return (p->motion.event == PW_STEADY_POINT ? p : p + 1)->motion.unstable == 0;
}

/* The real part, or modulus of the imaginary part, of a point that is number k in descending order, without rigid
 * displacements; NaN if there are fewer. */
static double steady_ranked (const pw_linear *l, int imaginary, int k) {
  for (int i = 0; i < l->unknowns; i++) {
    double value = imaginary ? fabs (l->im[i]) : l->re[i];
    int above = 0;
    for (int j = 0; j < l->unknowns; j++) {
      double other = imaginary ? fabs (l->im[j]) : l->re[j];
      above += !l->rigid[j] && (other > value || (other == value && j < i));
    }
    if (!l->rigid[i] && above == k) return value;
  }
  return NAN;
}

/* Lines of the k-th real part and frequency of a branch, with a blank line after each part of the given stability. */
static void steady_line (FILE *f, const pw_steady_point *first, int count, int k, int stable) {
  int drawing = 0;
  for (const pw_steady_point *p = first; p < first + count; p++) {
    int here = p + 1 < first + count && steady_stable (p) == stable;
    if (here || drawing)
      fprintf (f, "%.10g %.10g %.10g\n", p->motion.parameter, steady_ranked (&p->linear, 0, k),
               steady_ranked (&p->linear, 1, k) / (2 * PW_PI));
    if (drawing && !here) fputs ("\n", f);
    drawing = here;
  }
}

static int steady_data (const void *context, FILE *f, pw_error *error) {
  const pw_steady_cli *x = context;
  fprintf (f, "# %s, real part [1/s], frequency [Hz]: stable parts; unstable ones; events; eigenvalues [1/s]\n",
           x->vary.name);
  for (int stable = 1; stable >= 0; stable--) {
    for (int i = 0, count; i < x->points; i += count) {
      for (count = 1; i + count < x->points && x->point[i + count].branch == x->point[i].branch;) count++;
      for (int k = 0; k < steady_eigenvalues (x); k++) steady_line (f, x->point + i, count, k, stable);
    }
    fputs ("nan nan nan\n\n\n", f);
  }
  for (const pw_steady_point *p = x->point; p < x->point + x->points; p++)
    if (p->motion.event != PW_STEADY_POINT) fprintf (f, "%.10g %d\n", p->motion.parameter, p->motion.event);
  fputs ("nan nan\n\n\n", f);
  for (const pw_steady_point *p = x->point; p < x->point + x->points; p++)
    for (int i = 0; i < p->linear.unknowns; i++)
      if (!p->linear.rigid[i])
        fprintf (f, "%.10g %.10g %.10g\n", p->motion.parameter, p->linear.re[i], p->linear.im[i]);
  fputs ("nan nan nan\n", f);
  (void)error;
  return PW_OK;
}

static void steady_variables (const void *context, FILE *f) {
  const pw_steady_cli *x = context;
  double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
  for (const pw_steady_point *p = x->point; p < x->point + x->points; p++)
    for (int i = 0; i < p->linear.unknowns; i++)
      for (int k = 0; k < 2 && !p->linear.rigid[i]; k++) {
        double value = k ? p->linear.im[i] : p->linear.re[i];
        low[k] = fmin (low[k], value), high[k] = fmax (high[k], value);
      }
  if (low[0] > high[0]) low[0] = -1, high[0] = 1, low[1] = high[1] = 0; /* no eigenvalues */
  fprintf (f, "y_min = %.10g\ny_max = %.10g\nz_min = %.10g\nz_max = %.10g\n", low[0], high[0], low[1], high[1]);
  pw_figure_label (f, "label_of_x", 0, x->vary.name, x->vary.unit);
  fprintf (f, "first = %.10g\nlast = %.10g\n", fmin (x->set.first, x->set.last), fmax (x->set.first, x->set.last));
}

int pw_steady_write (const pw_steady_cli *x, pw_error *error) {
  int status = pw_figure_tables (x->folder, "steady", 1, x, steady_csv, steady_json, error);
  if (status != PW_OK || !x->vary_text) return status;
  return pw_figure_write (&x->line, &x->m, x->folder, "steady", x, steady_data, steady_variables, error);
}
