/* Messages and results of a run. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "print_table.h"
#include "report.h"

enum {
  REPORT_MOVED = 8, /* changed states, or messages of a kind, at most */
  REPORT_BODIES = 20,
  REPORT_ROWS = 24, /* of reactions, or of internal coordinates */
  REPORT_TEXT = 400 /* longest description of a redundant equation, end included */
};

static void report_more (FILE *f, int more, const char *hint) {
  if (more > 0) fprintf (f, "  and %d more%s\n", more, hint);
}

/* ---- Settings ---- */

/* A fixed step longer than the time in which the initial motion changes. */
static void report_step (const pw_run *r, double step) {
  char h[32], pace[32];
  double T = pw_run_scale (r)->time;
  if (step > T)
    pw_cli_say (
        "pinwheel: a step of %s s is long for a motion that changes within %s s, and nothing controls its error: "
        "compare with shorter ones\n",
        pw_format (h, step, 3), pw_format (pace, T, 2));
}

/* An absolute tolerance within which a force saturates. */
static void report_atol (pw_run *r, const pw_system *s, double atol) {
  char a[32], speed[32], element[PW_STATE_NAME];
  double least;
  int state = atol > 0 ? pw_run_saturation (r, &least, element, sizeof element) : -1;
  if (state >= 0 && atol > least)
    pw_cli_say ("pinwheel: --atol %s is above %s %s, within which the force of %s reverses: methods with Newton's "
                "iteration reduce it for the states it depends on, others may be wrong\n",
                pw_format (a, atol, 3), pw_format (speed, least, 3), pw_system_state_unit (s, state), element);
}

void pw_report_settings (pw_run *r, const pw_system *s, const char *method, const pw_cli_line *l,
                         const pw_settings *settings) {
  pw_cli_report_unused (method, l);
  if (pw_cli_adaptive (method) == 1)
    report_atol (r, s, settings->atol);
  else
    report_step (r, fmin (settings->step, settings->span));
}

/* ---- The model ---- */

/* Angles of more than a turn: most likely they are degrees. */
static void report_angle (const char *kind, const char *name, const char *what, double angle) {
  char value[32], degrees[32];
  if (!(fabs (angle) > 2 * PW_PI)) return;
  pw_format (value, angle, 6);
  pw_format (degrees, fmod (angle * 180 / PW_PI, 360), 4);
  pw_cli_say ("pinwheel: %s %s: %s = %s rad is more than a turn and ends at %s degrees; degrees are written %s*deg\n",
              kind, name, what, value, degrees, value);
}

/* Expressions that may jump when states change; steps do not end at such jumps. */
static void report_jump (const pw_element *e, const char *field, const pw_signal *s) {
  if (s->type != PW_FUNCTION || s->function.text == NULL || s->function.text->jump == NULL) return;
  pw_cli_say (
      "pinwheel: %s %s: %s: \"%.80s\" may jump as states change; steps do not end there, which costs accuracy\n",
      e->kind->name, pw_element_name (e), field, s->function.text->jump);
}

static void report_field (const pw_element *e, const pw_field *f) {
  const void *at = (const char *)e->definition + f->offset;
  const pw_signal *s = f->type == PW_SIGNAL ? at : NULL;
  int heading = strcmp (f->name, "heading") == 0;
  if (heading && f->type == PW_NUMBER) report_angle (e->kind->name, pw_element_name (e), f->name, *(const double *)at);
  if (heading && s && s->type == PW_CONSTANT) report_angle (e->kind->name, pw_element_name (e), f->name, s->constant);
  for (int i = 0; s && i < pw_field_count (f); i++) report_jump (e, f->name, s + i);
}

void pw_report_model (const pw_model *m) {
  int bodies, elements;
  const pw_body *b = pw_model_bodies (m, &bodies);
  const pw_element *e = pw_model_elements (m, &elements);
  for (int i = 0; i < bodies; i++) report_angle ("body", b[i].name, "initial phi", b[i].start[2]);
  for (int i = 0; i < elements; i++)
    for (const pw_field *f = e[i].kind->fields; f->name; f++) report_field (&e[i], f);
}

/* ---- Initialisation ---- */

void pw_report_state (const pw_system *s, const pw_initial_report *x, int i, char name[PW_STATE_NAME], double *from,
                      double *to) {
  int n = pw_system_coordinates (s);
  *from = i < n ? x->q_given[i] : x->v_given[i - n];
  *to = i < n ? x->q[i] : x->v[i - n];
  pw_system_state_name (s, i, name, PW_STATE_NAME);
}

/* States that the consistent initialisation has changed. */
static void report_initial (const pw_system *s, const pw_initial_report *initial) {
  int n = pw_system_coordinates (s), moved = initial->moved, listed = 0;
  char changed[80] = "";
  if (moved == 0) return;
  if (initial->changed) snprintf (changed, sizeof changed, ", %d of them specified by the model", initial->changed);
  pw_cli_say ("pinwheel: the initial values did not satisfy the constraints; %d of them %s changed%s%s:\n", moved,
              moved == 1 ? "was" : "were",
              initial->released ? ", including given ones, which cannot all be satisfied" : "", changed);
  for (int i = 0; i < 2 * n && listed < REPORT_MOVED; i++) {
    double from, to;
    char name[PW_STATE_NAME], a[32], b[32];
    if (!pw_initial_moved (s, initial, i)) continue;
    pw_report_state (s, initial, i, name, &from, &to);
    pw_cli_say ("  %s from %s to %s %s%s\n", name, pw_format (a, from, 10), pw_format (b, to, 10),
                pw_system_state_unit (s, i),
                initial->changed && pw_initial_specified (initial, i) ? " (specified)" : "");
    listed++;
  }
  report_more (stderr, moved - listed, "");
}

void pw_report_initialisation (const pw_run *r, const pw_system *s, const char *const *redundant) {
  int n = pw_system_differences (s), count = 0;
  char name[PW_STATE_NAME];
  for (int i = 0; i < n && i < REPORT_MOVED; i++)
    pw_cli_say ("pinwheel: derivatives by differences: %s\n", pw_system_difference_name (s, i, name, sizeof name));
  report_more (stderr, n - REPORT_MOVED, "");
  report_initial (s, pw_run_initial (r));
  for (; redundant && redundant[count]; count++)
    if (count < REPORT_MOVED) pw_cli_say ("pinwheel: redundant: %s\n", redundant[count]);
  report_more (stderr, count - REPORT_MOVED, "");
  if (count > 0)
    pw_cli_say ("pinwheel: reactions of redundant constraints are not unique: those of least norm are given\n");
}

const char **pw_report_redundancies (pw_run *r) {
  size_t n = (size_t)pw_run_redundant (r);
  const char **text = n > 0 ? malloc ((n + 1) * sizeof *text + n * REPORT_TEXT) : NULL;
  if (text == NULL) return NULL;
  char *buffer = (char *)(text + n + 1);
  for (size_t i = 0; i < n; i++) text[i] = pw_run_redundancy (r, (int)i, buffer + i * REPORT_TEXT, REPORT_TEXT);
  text[n] = NULL;
  return text;
}

/* ---- Results ---- */

static void report_bodies (const pw_system *s, const pw_sample *last) {
  static const char *const heads[] = { "x [m]", "y [m]", "phi [rad]", "vx [m/s]", "vy [m/s]", "omega [rad/s]" };
  int bodies = pw_system_bodies (s), shown = bodies < REPORT_BODIES ? bodies : REPORT_BODIES;
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -5, "body");
    for (int k = 0; k < 6; k++) pw_cell (&t, 13, heads[k]);
    pw_row_end (&t);
    for (int b = 0; b < shown; b++) {
      pw_cell (&t, -5, pw_system_body_name (s, b));
      for (int k = 0; k < 6; k++) pw_cell_number (&t, 13, k < 3 ? last->q[3 * b + k] : last->v[3 * b + k - 3], 8);
      pw_row_end (&t);
    }
  }
  report_more (stdout, bodies - shown, ": -o FILE.csv writes them all");
}

/* Internal coordinates of elements. */
static void report_internal (const pw_system *s, const pw_sample *last) {
  int first = 3 * pw_system_bodies (s), n = pw_system_coordinates (s),
      end = n - first > REPORT_ROWS ? first + REPORT_ROWS : n;
  char name[PW_STATE_NAME];
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int j = first; j < end; j++) {
      for (int state = j; state < 2 * n; state += n) {
        pw_cell (&t, -1, pw_system_state_name (s, state, name, sizeof name));
        pw_cell_number (&t, 13, state < n ? last->q[j] : last->v[j], 8);
        pw_cell (&t, -1, pw_system_state_unit (s, state));
      }
      pw_row_end (&t);
    }
  report_more (stdout, n - end, "");
}

static void report_reactions (const pw_system *s, const pw_sample *last) {
  int rows = pw_system_rows (s), shown = rows < REPORT_ROWS ? rows : REPORT_ROWS;
  char name[PW_STATE_NAME];
  if (rows > 0) printf ("\n  reaction\n");
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < shown; i++) {
      pw_cell (&t, -8, pw_system_reaction_name (s, i, name, sizeof name));
      pw_cell_number (&t, 13, 0 - last->lambda[i], 8);
      pw_cell (&t, -1, pw_system_reaction_unit (s, i));
      pw_row_end (&t);
    }
  report_more (stdout, rows - shown, ": -o FILE.csv writes them all");
}

static void report_energy (const pw_sample *last) {
  const struct {
    const char *name;
    double value;
  } row[] = { { "kinetic", last->kinetic }, { "potential", last->potential },   { "work", last->work },
              { "dissipated", last->loss }, { "projection", last->projection }, { "balance", last->balance } };
  printf ("\n  energy\n");
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < 6; i++) {
      pw_cell (&t, -10, row[i].name);
      pw_cell_number (&t, 13, row[i].value, 8);
      pw_cell (&t, -1, "J");
      pw_row_end (&t);
    }
}

/* A row of errors, unless both are unknown. */
static void report_error (pw_table *t, const char *name, double end, double largest, const char *unit) {
  if (isnan (end) && isnan (largest)) return;
  pw_cell (t, -10, name);
  pw_cell_number (t, 13, end, 3);
  pw_cell_number (t, 13, largest, 3);
  pw_cell (t, -1, unit);
  pw_row_end (t);
}

static void report_errors (const pw_reference_error *e) {
  static const char *const name[] = { "length", "angle", "speed", "rate" }, *const unit[] = { "m", "rad", "m/s",
                                                                                              "rad/s" };
  char time[32], at[40];
  if (e == NULL) return;
  snprintf (at, sizeof at, "at %s s", pw_format (time, e->t, 6));
  pw_cli_print (stdout, "\n  error against the reference solution of %s, at %d time%s\n", e->source, e->samples,
                e->samples == 1 ? "" : "s");
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -10, "");
    pw_cell (&t, 13, at);
    pw_cell (&t, 13, "largest");
    pw_row_end (&t);
    for (int i = 0; i < 4; i++) report_error (&t, name[i], e->end[i], e->most[i], unit[i]);
    report_error (&t, "reactions", NAN, e->reactions, "of the largest");
  }
}

void pw_report_warnings (const pw_run *r, const pw_system *s, double defect) {
  int state;
  double power, growth = pw_run_growth (r, &state, &power);
  char name[PW_STATE_NAME], times[32], grows[32], percent[32];
  if (defect > 0.01)
    pw_cli_say ("pinwheel: the energy does not balance: %s %% of it is unaccounted for; %s\n",
                pw_format (percent, 100 * defect, 2), pw_run_energy_advice (r, defect));
  if (growth != 0)
    pw_cli_say (
        "pinwheel: the motion grows without bound: %s has become %s times the scene's own speed and grows as t^%s; "
        "nothing opposes what drives it\n",
        pw_system_state_name (s, state, name, sizeof name), pw_format (times, growth, 2), pw_format (grows, power, 2));
}

void pw_report_end (const pw_summary *summary, const pw_system *s, const pw_sample *last, int energy,
                    const pw_statistics *statistics) {
  char t[32], a[32], b[32];
  printf ("%s, %s, at t = %s s\n\n", summary->model, summary->method, pw_format (t, last->t, 8));
  report_bodies (s, last);
  report_internal (s, last);
  report_reactions (s, last);
  if (energy) report_energy (last);
  report_errors (summary->reference);
  printf ("\n  worst scaled residuals: position %s, velocity %s\n", pw_format (a, statistics->position, 2),
          pw_format (b, statistics->velocity, 2));
  printf (
      "  %ld steps, %ld rejected, %ld right-hand sides, %ld Jacobians, %ld factorisations, %s s of processor time\n",
      statistics->steps, statistics->rejected, statistics->rhs, statistics->jacobians, statistics->factorisations,
      pw_format (a, summary->cpu, 3));
  if (*summary->general)
    pw_cli_print (stdout, "  general engine: %s\n", summary->general);
  else
    printf ("  code specialised for this scene: %ld evaluations\n", statistics->specialised);
  if (statistics->restarts > 0) printf ("  restarted at %ld checkpoints\n", statistics->restarts);
  if (*summary->reason) printf ("  ended early: %s\n", summary->reason);
}
