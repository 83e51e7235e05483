/* Time of a run by element types and by stages: two tables. */
#include <math.h>
#include "print_table.h"
#include "report.h"

/* One decimal below 100; empty if there is no value. */
static void profile_cell (pw_table *t, int there, double value) {
  pw_cell_number (t, 8, !there ? NAN : fabs (value) >= 99.95 ? round (value) : round (10 * value) / 10, 15);
}

static void profile_share (pw_table *t, double part, double whole) {
  char text[40];
  snprintf (text, sizeof text, "%.0f %%", 100 * part / whole);
  pw_cell (t, 8, whole > 0 ? text : "");
}

static void profile_head (pw_table *t, const char *const *head) {
  pw_cell (t, -14, *head++);
  for (; *head; head++) pw_cell (t, 8, *head);
  pw_row_end (t);
}

/* The counts of a kind, or of the bodies. */
static void profile_counts (pw_table *t, const char *name, int elements, int rows, int unknowns) {
  pw_cell (t, -14, name);
  const int count[] = { elements, rows, unknowns };
  for (int i = 0; i < 3; i++) pw_cell_number (t, 7, count[i], 15);
}

static void profile_kind (pw_table *t, const pw_profile_kind *x, double whole) {
  int rows = x->elements * x->kind->rows;
  double sum = x->signals + x->constraints + x->force;
  profile_counts (t, x->kind->name, x->elements, rows, rows + x->elements * x->kind->internal);
  profile_cell (t, x->kind->signals > 0, x->signals);
  profile_cell (t, rows > 0, x->constraints);
  profile_cell (t, x->kind->force && !x->kind->constant, x->force);
  profile_cell (t, 1, sum);
  profile_share (t, sum, whole);
  if (x->kind->g) profile_cell (t, 1, x->positions);
  pw_row_end (t);
}

static void profile_kinds (const pw_profile *p, int bodies, FILE *out) {
  static const char *const head[] = { "type",  "elements", "rows",  "unknowns", "signals", "J, gamma",
                                      "force", "sum",      "share", "g",        NULL };
  for (pw_table t = { .f = out }; pw_table_pass (&t);) {
    profile_head (&t, head);
    profile_counts (&t, "(bodies)", bodies, 0, 3 * bodies);
    for (int i = 0; i < 3; i++) pw_cell (&t, 8, "");
    profile_cell (&t, 1, p->configurations);
    profile_share (&t, p->configurations, p->evaluation);
    pw_row_end (&t);
    for (int i = 0; i < p->kinds; i++) profile_kind (&t, &p->kind[i], p->evaluation);
  }
}

/* A row of the stages; omitted unless the time is positive.  `whole`, `step`: 0 leaves their columns empty. */
static void profile_stage (pw_table *t, const char *name, double ns, double whole, double per_step, double step) {
  if (!(ns > 0)) return;
  pw_cell (t, -14, name);
  profile_cell (t, whole > 0, ns);
  profile_share (t, ns, whole);
  if (step > 0) profile_cell (t, 1, ns * per_step);
  if (step > 0) profile_share (t, ns * per_step, step);
  pw_row_end (t);
}

static void profile_stages (const pw_profile *p, FILE *out) {
  static const char *const head[] = { "stage", "per evaluation", "share", "per step", "share", NULL },
                           *const no_steps[] = { "stage", "per evaluation", "share", NULL };
  const struct {
    const char *name;
    double ns;
  } stage[] = { { "kinematics", p->kinematics },       { "equations", p->equations },
                { "stabilisation", p->stabilisation }, { "factorisation", p->factorisation },
                { "solution", p->solution },           { "together", p->evaluation } };
  double all = p->evaluations * p->evaluation + p->projections * p->projection;
  fputc ('\n', out);
  for (pw_table t = { .f = out }; pw_table_pass (&t);) {
    profile_head (&t, all > 0 ? head : no_steps);
    for (size_t i = 0; i < sizeof stage / sizeof *stage; i++)
      profile_stage (&t, stage[i].name, stage[i].ns, p->evaluation, p->evaluations, all);
    if (p->projections > 0) profile_stage (&t, "projection", p->projection, 0, p->projections, all);
  }
}

static void profile_print (const pw_system *s, const pw_run *r, const pw_profile *p, double cpu, FILE *out) {
  char t[32], evaluations[32], iterations[32];
  double steps = (double)pw_run_statistics (r)->steps;
  fprintf (out, "\n  what an evaluation of the accelerations costs at t = %s s [ns]\n\n",
           pw_format (t, pw_run_time (r), 8));
  profile_kinds (p, pw_system_bodies (s), out);
  profile_stages (p, out);
  if (steps == 0) return;
  pw_format (evaluations, (double)pw_run_statistics (r)->rhs / steps, 3);
  pw_format (iterations, p->iterations, 2);
  fprintf (out, "\n  a step of the run took %.0f ns, %s evaluations%s", 1e9 * cpu / steps, evaluations,
           p->evaluations > 0 ? "" : " of residuals, and matrices of the method's own");
  if (p->projections > 0)
    fprintf (out, " (that after a projection is part of it), %s iterations to project", iterations);
  fprintf (out, "\n");
}

int pw_print_profile (const pw_system *s, pw_run *r, double cpu, FILE *out, pw_error *error) {
  pw_profile p;
  int status = pw_run_profile (r, &p, error);
  if (status == PW_OK) profile_print (s, r, &p, cpu, out);
  if (status == PW_RETRY) fprintf (out, "\n  no profile: the run ended in a singular configuration\n");
  pw_profile_free (&p);
  return status == PW_RETRY ? PW_OK : status;
}
