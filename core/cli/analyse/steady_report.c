/* The reports of `pinwheel steady`: text, JSON, table and figure. */
#include "steady_report.h"
#include <math.h>
#include "figure.h"
#include "print_table.h"
#include "text.h"

enum {
  STEADY_DIGITS = 6,         /* of numbers in the text */
  STEADY_SHOWN = 12,         /* motions in the text, at most */
  STEADY_CONFIGURATIONS = 3, /* motions whose states are printed, at most */
  STEADY_EVENTS = 40         /* of branches, in the text, at most */
};
#define STEADY_SMALL 1e-12 /* numbers below it are printed as 0, in SI units */

/* By pw_steady_event, without PW_STEADY_END, which is not stored. */
static const char *const steady_events[] = { "point", "fold", "zero eigenvalue", "Hopf" };

/* ---- Text ---- */

static void steady_cell (pw_table *t, double value) {
  pw_cell_number (t, 12, pw_rounded (value, STEADY_SMALL), STEADY_DIGITS);
}

/* Prints real part and frequency of the rightmost eigenvalue, the first one that is neither 0 nor of a rigid
 * displacement; at an event, of the one that crosses the imaginary axis. */
static void steady_cells_rightmost (pw_table *t, const pw_steady_point *p) {
  const pw_linear *l = &p->linear;
  int best = -1, crossing = p->motion.event != PW_STEADY_POINT;
  for (int i = 0; i < l->unknowns; i++) {
    if (crossing ? l->rigid[i] && l->im[i] != 0 : l->rigid[i] || (l->re[i] == 0 && l->im[i] == 0)) continue;
    if ((l->im[i] != 0) != (p->motion.event == PW_STEADY_OSCILLATION) && crossing) continue;
    if (best < 0 || (crossing && fabs (l->re[i]) < fabs (l->re[best]))) best = i;
  }
  double im = best < 0 ? NAN : fabs (l->im[best]);
  /* the real part of a crossing is 0 to the accuracy with which events are found */
  steady_cell (t, best < 0 ? NAN : crossing ? round (l->re[best] * 1e8) / 1e8 + 0 : l->re[best]);
  steady_cell (t, im > 0 ? im / (2 * PW_PI) : NAN);
}

static void steady_print_motions (const pw_steady_command *cmd) {
  const pw_system *s = cmd->m.system;
  const int n = pw_system_coordinates (s), held[] = { 2 * n, n + 2 }; /* (pw_system_find_held) speed, omega of body 0 */
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, 6, "motion");
    for (int k = 0; k < 2; k++)
      pw_cell_unit (&t, 12, PW_NAME (pw_system_held_name, s, held[k]), pw_system_held_unit (s, held[k]));
    pw_head (&t, 7, 7, (const char *[]){ "family", "growing", "rightmost [1/s]", "frequency [Hz]", "residual", NULL });
    for (int i = 0; i < cmd->points && i < STEADY_SHOWN; i++) {
      const pw_steady_point *p = cmd->point + i;
      pw_cell_number (&t, 6, i + 1, 6);
      for (int k = 0; k < 2; k++) steady_cell (&t, pw_system_held_value (s, held[k], p->motion.q, p->motion.v));
      pw_cell_number (&t, 7, p->motion.family, 6);
      pw_cell_number (&t, 7, p->motion.unstable, 6);
      steady_cells_rightmost (&t, p);
      pw_cell_number (&t, 8, p->motion.residual, 2);
      pw_row_end (&t);
    }
  }
  if (cmd->points > STEADY_SHOWN) printf ("  and %d more, see -o DIR\n", cmd->points - STEADY_SHOWN);
}

/* Prints a row for the ends of each branch and for each of the first events. */
static void steady_print_branches (const pw_steady_command *cmd) {
  int events = 0;
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    events = 0;
    pw_cell (&t, 6, "branch");
    pw_cell (&t, -15, "event");
    pw_cell_unit (&t, 12, cmd->vary.name, cmd->vary.unit);
    pw_head (&t, 7, 7, (const char *[]){ "growing", "rightmost [1/s]", "frequency [Hz]", NULL });
    for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
      int first = p == cmd->point || p[-1].branch != p->branch,
          last = p == cmd->point + cmd->points - 1 || p[1].branch != p->branch;
      if (!first && !last && (p->motion.event == PW_STEADY_POINT || ++events > STEADY_EVENTS)) continue;
      pw_cell_number (&t, 6, p->branch, 6);
      pw_cell (&t, -15,
               first                                               ? "begins"
               : p->motion.event != PW_STEADY_POINT                ? steady_events[p->motion.event]
               : cmd->stopped && p + 1 == cmd->point + cmd->points ? "stopped"
                                                                   : "ends");
      pw_cell_number (&t, 12, p->motion.parameter, 9);
      pw_cell_number (&t, 7, p->motion.unstable, 6);
      steady_cells_rightmost (&t, p);
      pw_row_end (&t);
    }
  }
  if (events > STEADY_EVENTS) printf ("and %s, see -o DIR\n", PW_COUNTED (events - STEADY_EVENTS, "more event"));
  for (int i = 0; i < cmd->branches; i++)
    if (*cmd->end[i]) printf ("Branch %d ends: %s\n", i + 1, cmd->end[i]);
}

void pw_steady_print (const pw_steady_command *cmd) {
  char text[40];
  const char *model = pw_file_name (cmd->m.file),
             *symmetries = pw_states_symmetries (pw_steady_symmetries (cmd->search), text);
  if (cmd->vary_text) {
    printf ("%s: %d %s of steady motions%s, %s from %.9g to %.9g\n\n", model, cmd->branches,
            cmd->branches == 1 ? "branch" : "branches", symmetries, cmd->vary.name, cmd->settings.first,
            cmd->settings.last);
    steady_print_branches (cmd);
    return;
  }
  printf ("%s: %d steady %s%s, from the initial state and %d random ones\n\n", model, cmd->points,
          cmd->points == 1 ? "motion" : "motions", symmetries, cmd->random_attempts);
  steady_print_motions (cmd);
  for (int i = 0; i < cmd->points && i < STEADY_CONFIGURATIONS; i++) {
    const pw_steady_motion *m = &cmd->point[i].motion;
    printf ("\nMotion %d, found from %s\n", i + 1,
            cmd->point[i].attempt >= PW_STEADY_NOT_RANDOM ? "a random state" : "the initial state");
    pw_states_print (cmd->m.system, m->q, m->v, STEADY_DIGITS, STEADY_SMALL);
  }
  for (int i = 0; i < cmd->points && i < STEADY_SHOWN; i++)
    if (*cmd->point[i].advice)
      printf ("\nMotion %d is one of a family of dimension %d; to select one:%s\n", i + 1, cmd->point[i].motion.family,
              cmd->point[i].advice);
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

static void steady_point_json (const pw_steady_command *cmd, const pw_steady_point *p, pw_json *j) {
  const pw_system *s = cmd->m.system;
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "branch", p->branch);
  if (cmd->vary_text) pw_json_text (j, "event", steady_events[p->motion.event]);
  if (cmd->vary_text) pw_json_number (j, "parameter", p->motion.parameter);
  pw_json_number (j, "attempt", p->attempt);
  pw_json_number (j, "residual", p->motion.residual);
  if (!cmd->vary_text) pw_json_number (j, "family", p->motion.family);
  pw_json_number (j, "growing", p->motion.unstable);
  pw_json_numbers (j, "twist", p->linear.twist, 3);
  pw_states_json (s, p->motion.q, p->motion.v, "state", j);
  steady_eigenvalues_json (&p->linear, j);
  pw_json_close (j, '}');
}

static void steady_json (const void *context, pw_json *j) {
  const pw_steady_command *cmd = context;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (cmd->m.file));
  pw_json_text (j, "parameter", cmd->vary_text ? cmd->vary.name : NULL);
  pw_json_text (j, "unit", cmd->vary.unit);
  pw_json_open (j, "held", '{');
  for (int i = 0; i < cmd->settings.holds; i++)
    if (i != cmd->settings.vary)
      pw_json_number (j, PW_NAME (pw_system_held_name, cmd->m.system, cmd->hold[i].state), cmd->hold[i].value);
  pw_json_close (j, '}');
  pw_json_number (j, "symmetries", pw_steady_symmetries (cmd->search));
  pw_json_number (j, "attempts", PW_STEADY_NOT_RANDOM + cmd->random_attempts);
  pw_json_flag (j, "complete", !cmd->stopped);
  pw_json_open (j, "ends", '[');
  for (int i = 0; cmd->vary_text && i < cmd->branches; i++) pw_json_text (j, NULL, cmd->end[i]);
  pw_json_close (j, ']');
  pw_json_open (j, "motions", '[');
  for (int i = 0; i < cmd->points; i++) steady_point_json (cmd, cmd->point + i, j);
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- The table ---- */

/* The largest number of eigenvalues of a point. */
static int steady_most_eigenvalues (const pw_steady_command *cmd) {
  int most = 0;
  for (int i = 0; i < cmd->points; i++)
    if (cmd->point[i].linear.unknowns > most) most = cmd->point[i].linear.unknowns;
  return most;
}

static int steady_csv (const void *context, FILE *f, pw_error *error) {
  const pw_steady_command *cmd = context;
  const pw_system *s = cmd->m.system;
  int states = 2 * pw_system_coordinates (s), most = steady_most_eigenvalues (cmd);
  pw_text t = { .chars = NULL };
  pw_text_cell (&t, "branch,event");
  pw_text_name (&t, cmd->vary_text ? cmd->vary.name : "parameter", cmd->vary.unit);
  pw_text_cell (&t, "growing,residual");
  pw_states_header (s, &t);
  pw_complex_header (&t, most, "1/s");
  int status = pw_text_line (&t, f, cmd->folder, error);
  for (const pw_steady_point *p = cmd->point; status == PW_OK && p < cmd->point + cmd->points; p++) {
    pw_text_number (&t, p->branch);
    pw_text_cell (&t, steady_events[p->motion.event]);
    pw_text_number (&t, p->motion.parameter);
    pw_text_number (&t, p->motion.unstable);
    pw_text_number (&t, p->motion.residual);
    for (int i = 0; i < states; i++) pw_text_number (&t, p->state[i]);
    pw_complex_cells (&t, p->linear.re, p->linear.im, p->linear.unknowns, most);
    status = pw_text_line (&t, f, cmd->folder, error);
  }
  return status;
}

/* ---- The figure: data sets of gnuplot end with two blank lines; a row of nan keeps each from being empty ---- */

/* Whether the branch is stable from p to the next point.  At an event, where `unstable` does not count the modes that
 * change, the next point decides. */
static int steady_is_stable (const pw_steady_point *p) {
  return (p->motion.event == PW_STEADY_POINT ? p : p + 1)->motion.unstable == 0;
}

typedef enum { REAL, IMAGINARY } steady_part;

/* Number k, from 0, of the real parts, or the absolute values of the imaginary parts, in descending order, of
 * eigenvalues without those of rigid displacements; NaN if there are fewer. */
static double steady_ranked (const pw_linear *l, steady_part part, int k) {
  for (int i = 0; i < l->unknowns; i++) {
    double value = part == IMAGINARY ? fabs (l->im[i]) : l->re[i];
    int above = 0;
    for (int j = 0; j < l->unknowns; j++) {
      double other = part == IMAGINARY ? fabs (l->im[j]) : l->re[j];
      above += !l->rigid[j] && (other > value || (other == value && j < i));
    }
    if (!l->rigid[i] && above == k) return value;
  }
  return NAN;
}

/* Writes the k-th real part and frequency on the parts of a branch where no modes grow (stable or neutral), or where
 * some do, with a blank line after each. */
static void steady_write_parts (FILE *f, const pw_steady_point *first, int count, int k, int stable) {
  int inside = 0; /* 1: the last point began or continued a part */
  for (const pw_steady_point *p = first; p < first + count; p++) {
    int here = p + 1 < first + count && steady_is_stable (p) == stable;
    if (here || inside)
      fprintf (f, "%.10g %.10g %.10g\n", p->motion.parameter, steady_ranked (&p->linear, REAL, k),
               steady_ranked (&p->linear, IMAGINARY, k) / (2 * PW_PI));
    if (inside && !here) fputs ("\n", f);
    inside = here;
  }
}

static int steady_data (const void *context, FILE *f, pw_error *error) {
  const pw_steady_command *cmd = context;
  fprintf (f, "# %s, real part [1/s], frequency [Hz]: stable parts; unstable ones; events; eigenvalues [1/s]\n",
           cmd->vary.name);
  for (int stable = 1; stable >= 0; stable--) {
    for (int i = 0, count; i < cmd->points; i += count) {
      for (count = 1; i + count < cmd->points && cmd->point[i + count].branch == cmd->point[i].branch;) count++;
      for (int k = 0; k < steady_most_eigenvalues (cmd); k++) steady_write_parts (f, cmd->point + i, count, k, stable);
    }
    fputs ("nan nan nan\n\n\n", f);
  }
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++)
    if (p->motion.event != PW_STEADY_POINT) fprintf (f, "%.10g %d\n", p->motion.parameter, p->motion.event);
  fputs ("nan nan\n\n\n", f);
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++)
    for (int i = 0; i < p->linear.unknowns; i++)
      if (!p->linear.rigid[i])
        fprintf (f, "%.10g %.10g %.10g\n", p->motion.parameter, p->linear.re[i], p->linear.im[i]);
  fputs ("nan nan nan\n", f);
  (void)error;
  return PW_OK;
}

static void steady_variables (const void *context, FILE *f) {
  const pw_steady_command *cmd = context;
  double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++)
    for (int i = 0; i < p->linear.unknowns; i++)
      for (int k = 0; k < 2 && !p->linear.rigid[i]; k++) {
        double value = k ? p->linear.im[i] : p->linear.re[i];
        low[k] = fmin (low[k], value), high[k] = fmax (high[k], value);
      }
  if (low[0] > high[0]) low[0] = -1, high[0] = 1, low[1] = high[1] = 0; /* no eigenvalues */
  fprintf (f, "re_min = %.10g\nre_max = %.10g\nim_min = %.10g\nim_max = %.10g\n", low[0], high[0], low[1], high[1]);
  pw_figure_label (f, "label_of_x", 0, cmd->vary.name, cmd->vary.unit);
  int folds = 0, changes = 0;
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++)
    folds += p->motion.event == PW_STEADY_FOLD, changes += p->motion.event > PW_STEADY_FOLD;
  fprintf (f, "folds = %d\nchanges = %d\n", folds, changes);
  fprintf (f, "first = %.10g\nlast = %.10g\n", fmin (cmd->settings.first, cmd->settings.last),
           fmax (cmd->settings.first, cmd->settings.last));
}

int pw_steady_write (const pw_steady_command *cmd, pw_error *error) {
  int status = pw_figure_write_tables (cmd->folder, "steady", 1, cmd, steady_csv, steady_json, error);
  if (status != PW_OK || !cmd->vary_text) return status;
  return pw_figure_write (&cmd->line, &cmd->m, cmd->folder, "steady", cmd, steady_data, steady_variables, error);
}
