/* Prints what an evaluation of the accelerations costs, by element types and by stages: two tables. */
#include <math.h>
#include "print_table.h"
#include "report.h"

/* A time [ns], with one decimal below 100; empty if it is NaN. */
static void profile_cell (pw_table *table, double ns) {
  pw_cell_number (table, 8, fabs (ns) >= 99.95 ? round (ns) : round (10 * ns) / 10, 15);
}

static void profile_share (pw_table *table, double part, double whole) {
  pw_cell (table, 8, whole > 0 ? PW_PRINTED (40, "%.0f %%", 100 * part / whole) : "");
}

/* The name of an element type, or of the bodies, and its counts; unknowns: accelerations and multipliers. */
static void profile_counts (pw_table *table, const char *name, int elements, int rows, int unknowns) {
  pw_cell (table, -14, name);
  const int count[] = { elements, rows, unknowns };
  for (int i = 0; i < 3; i++) pw_cell_number (table, 7, count[i], 15);
}

static void profile_kind (pw_table *table, const pw_profile_kind *cost, double evaluation) {
  const pw_kind *kind = cost->kind;
  int rows = cost->elements * kind->rows;
  double sum = cost->signals + cost->constraints + cost->force;
  profile_counts (table, kind->name, cost->elements, rows, rows + cost->elements * kind->internal);
  profile_cell (table, kind->signals > 0 ? cost->signals : NAN);
  profile_cell (table, rows > 0 ? cost->constraints : NAN);
  profile_cell (table, kind->force && !kind->constant ? cost->force : NAN);
  profile_cell (table, sum);
  profile_share (table, sum, evaluation);
  if (kind->g) profile_cell (table, cost->positions);
  pw_row_end (table);
}

static void profile_kinds (const pw_profile *profile, int bodies, FILE *f) {
  static const char *const head[] = { "type",  "elements", "rows",  "unknowns", "signals", "J, gamma",
                                      "force", "sum",      "share", "g",        NULL };
  for (pw_table table = { .f = f }; pw_table_pass (&table);) {
    pw_head (&table, -14, 8, head);
    profile_counts (&table, "(bodies)", bodies, 0, 3 * bodies);
    for (int i = 0; i < 3; i++) pw_cell (&table, 8, "");
    profile_cell (&table, profile->configurations);
    profile_share (&table, profile->configurations, profile->evaluation);
    pw_row_end (&table);
    for (int i = 0; i < profile->kinds; i++) profile_kind (&table, &profile->kind[i], profile->evaluation);
  }
}

/* A row of the table of stages, omitted unless its time `ns` is positive.  per_step: how often a step has the stage.
 * whole, step: the times of an evaluation and of a step [ns]; if `whole` is 0 the cells per evaluation are empty, if
 * `step` is 0 there are none per step. */
static void profile_stage (pw_table *table, const char *name, double ns, double per_step, double whole, double step) {
  if (!(ns > 0)) return;
  pw_cell (table, -14, name);
  profile_cell (table, whole > 0 ? ns : NAN);
  profile_share (table, ns, whole);
  if (step > 0) profile_cell (table, ns * per_step);
  if (step > 0) profile_share (table, ns * per_step, step);
  pw_row_end (table);
}

static void profile_stages (const pw_profile *profile, FILE *f) {
  static const char *const head[] = { "stage", "per evaluation", "share", "per step", "share", NULL },
                           *const no_steps[] = { "stage", "per evaluation", "share", NULL };
  const struct {
    const char *name;
    double ns;
  } stage[] = { { "kinematics", profile->kinematics },       { "equations", profile->equations },
                { "stabilisation", profile->stabilisation }, { "factorisation", profile->factorisation },
                { "solution", profile->solution },           { "together", profile->evaluation } };
  double step = profile->evaluations * profile->evaluation + profile->projections * profile->projection;
  fputc ('\n', f);
  for (pw_table table = { .f = f }; pw_table_pass (&table);) {
    pw_head (&table, -14, 8, step > 0 ? head : no_steps);
    for (size_t i = 0; i < sizeof stage / sizeof *stage; i++)
      profile_stage (&table, stage[i].name, stage[i].ns, profile->evaluations, profile->evaluation, step);
    if (profile->projections > 0)
      profile_stage (&table, "projection", profile->projection, profile->projections, 0, step);
  }
}

static void profile_print (const pw_system *system, const pw_run *run, const pw_profile *profile, double cpu, FILE *f) {
  double steps = (double)pw_run_statistics (run)->steps;
  fprintf (f, "\n  what an evaluation of the accelerations costs [ns] at t = %s s\n\n",
           PW_DIGITS (pw_run_time (run), 8));
  profile_kinds (profile, pw_system_bodies (system), f);
  profile_stages (profile, f);
  if (pw_run_statistics (run)->specialised > 0)
    fprintf (f, "\n  `together` is by specialised code, all other times are of the general engine\n");
  if (steps == 0) return;
  const char *evaluations = PW_DIGITS ((double)pw_run_statistics (run)->rhs / steps, 3);
  const char *iterations = PW_DIGITS (profile->iterations, 2);
  fprintf (f, "\n  a step of the run took %.0f ns; evaluations%s: %s", 1e9 * cpu / steps,
           profile->evaluations > 0 ? "" : " of residuals, matrices not counted", evaluations);
  if (profile->projections > 0)
    fprintf (f, " (with those after projections); iterations of a projection: %s", iterations);
  fprintf (f, "\n");
}

int pw_print_profile (const pw_system *system, pw_run *run, double cpu, FILE *f, pw_error *error) {
  pw_profile profile;
  int status = pw_run_profile (run, &profile, error);
  if (status == PW_OK) profile_print (system, run, &profile, cpu, f);
  if (status == PW_RETRY) fprintf (f, "\n  no profile: the run ended in a singular configuration\n");
  pw_profile_free (&profile);
  return status == PW_RETRY ? PW_OK : status;
}
