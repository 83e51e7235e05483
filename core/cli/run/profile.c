/* Where the time of a run goes: two tables. */
#include <math.h>
#include <stdlib.h>
#include "profile.h"

/* One decimal below 100, in any locale; empty if there is no value. */
static void profile_number (FILE *out, int there, double value, int width) {
  char text[40] = "";
  if (there && fabs (value) >= 99.95)
    snprintf (text, sizeof text, "%.0f", value);
  else if (there)
    snprintf (text, sizeof text, "%d.%d", (int)round (10 * value) / 10, abs ((int)round (10 * value)) % 10);
  fprintf (out, "%*s", width, text);
}

static void profile_share (FILE *out, double part, double whole) {
  fprintf (out, "%8.0f %%", 100 * part / whole);
}

static void profile_kind (const pw_profile_kind *x, double whole, FILE *out) {
  int rows = x->elements * x->kind->rows;
  double sum = x->signals + x->constraints + x->force;
  fprintf (out, "  %-14s%9d%9d%9d", x->kind->name, x->elements, rows, rows + x->elements * x->kind->own);
  profile_number (out, x->kind->signals > 0, x->signals, 10);
  profile_number (out, rows > 0, x->constraints, 10);
  profile_number (out, x->kind->force && !x->kind->constant, x->force, 10);
  profile_number (out, 1, sum, 10);
  profile_share (out, sum, whole);
  if (x->kind->g) profile_number (out, 1, x->positions, 10);
  fprintf (out, "\n");
}

static void profile_kinds (const pw_profile *p, int bodies, FILE *out) {
  fprintf (out, "  %-14s%9s%9s%9s%10s%10s%10s%10s%10s%10s\n", "kind", "elements", "rows", "unknowns", "signals",
           "J, gamma", "force", "sum", "share", "g");
  fprintf (out, "  %-14s%9d%9d%9d%30s", "(bodies)", bodies, 0, 3 * bodies, "");
  profile_number (out, 1, p->configurations, 10);
  profile_share (out, p->configurations, p->evaluation);
  fprintf (out, "\n");
  for (int i = 0; i < p->kinds; i++) profile_kind (&p->kind[i], p->evaluation, out);
}

/* One line of the stages; omitted unless the time is positive. */
static void profile_line (FILE *out, const char *name, double ns, double whole, double per_step, double step) {
  fprintf (out, "  %-14s", name);
  if (whole > 0) profile_number (out, 1, ns, 18);
  if (whole > 0) profile_share (out, ns, whole);
  if (step > 0) {
    profile_number (out, 1, ns * per_step, whole > 0 ? 14 : 42);
    profile_share (out, ns * per_step, step);
  }
  fprintf (out, "\n");
}

static void profile_stages (const pw_profile *p, FILE *out) {
  const struct {
    const char *name;
    double ns;
  } stage[] = { { "place", p->kinematics },     { "sweep", p->equations }, { "stabilise", p->stabilisation },
                { "factor", p->factorisation }, { "solve", p->solution },  { "all in one go", p->evaluation } };
  double all = p->evaluations * p->evaluation + p->projections * p->projection;
  fprintf (out, "\n  %-14s%18s%10s", "stage", "per evaluation", "share");
  if (all > 0) fprintf (out, "%14s%10s", "per step", "share");
  fprintf (out, "\n");
  for (size_t i = 0; i < sizeof stage / sizeof *stage; i++)
    if (stage[i].ns > 0) profile_line (out, stage[i].name, stage[i].ns, p->evaluation, p->evaluations, all);
  if (p->projections > 0) profile_line (out, "project", p->projection, 0, p->projections, all);
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
