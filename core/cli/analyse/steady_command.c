/* pinwheel steady: steady motions, and their branches over a parameter. */
#include "steady_report.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "progress.h"
#include "report.h"
#include "states.h"
#include "util.h"

enum { STEADY_STARTS = 30 };

/* ---- What is held and varied ---- */

/* NAME=FIRST:LAST, a parameter of the model or something held. */
static int steady_vary (pw_steady_cli *x, pw_error *error) {
  if (pw_vary_read (&x->vary, &x->line, &x->m, x->vary_text, error) != PW_OK) return PW_INPUT;
  x->set.first = x->vary.first, x->set.last = x->vary.last;
  if (x->vary.parameter) {
    x->set.compile = pw_vary_compile;
    x->set.context = &x->vary;
    return PW_OK;
  }
  if (strchr (x->vary.name, '.') == NULL) return pw_model_set (x->m.model, x->vary.name, x->set.first, error);
  x->set.vary = x->set.holds;
  int status =
      pw_hold_add (x->m.system, "--vary", x->vary_text, x->vary.name, x->set.first, x->hold, &x->set.holds, error);
  if (status == PW_OK) x->vary.unit = pw_system_held_unit (x->m.system, x->hold[x->set.vary].state);
  return status;
}

static int steady_options (pw_steady_cli *x, pw_error *error) {
  double starts = STEADY_STARTS;
  int status = pw_cli_number ("--at", x->at_text, PW_NONNEGATIVE, &x->set.t, error);
  x->limit.seconds = INFINITY;
  x->set.span = pw_cli_defaults (pw_file_table (x->m.file)).t_end;
  x->set.vary = -1;
  x->set.hold = x->hold;
  if (status == PW_OK) status = pw_cli_number ("--limit", x->line.limit, PW_POSITIVE, &x->limit.seconds, error);
  if (status == PW_OK) status = pw_cli_number ("--starts", x->starts_text, PW_REAL, &starts, error);
  if (status == PW_OK && !(starts >= 0 && starts <= 1e9 && starts == floor (starts)))
    status = pw_fail (error, PW_INPUT, "--starts %s: expected a whole number >= 0", x->starts_text);
  for (const char **text = x->hold_texts; status == PW_OK && text && *text; text++)
    status = pw_hold_read (x->m.system, "--hold", *text, x->hold, &x->set.holds, error);
  if (status == PW_OK && x->vary_text) status = steady_vary (x, error);
  x->attempts = (int)starts;
  return status;
}

/* ---- Points ---- */

static pw_steady_point *steady_add (pw_steady_cli *x, const pw_steady_motion *m, int attempt, pw_error *error) {
  size_t coordinates = (size_t)pw_system_coordinates (x->m.system), n = (size_t)m->linear->unknowns;
  int status = pw_grow (&x->point, (size_t)x->points, &x->room, sizeof *x->point);
  double *a = status == PW_OK ? malloc ((2 * coordinates + 2 * n) * sizeof *a + n) : NULL;
  if (a == NULL) return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  pw_steady_point *p = x->point + x->points++;
  *p = (pw_steady_point){ .branch = x->branches, .attempt = attempt, .motion = *m, .state = a };
  p->motion.linear = NULL;
  p->linear.unknowns = (int)n;
  memcpy (p->linear.twist, m->linear->twist, sizeof p->linear.twist);
  p->motion.q = memcpy (a, m->q, coordinates * sizeof *a);
  p->motion.v = memcpy (a += coordinates, m->v, coordinates * sizeof *a);
  p->linear.re = memcpy (a += coordinates, m->linear->re, n * sizeof *a);
  p->linear.im = memcpy (a += n, m->linear->im, n * sizeof *a);
  p->linear.rigid = memcpy (a + n, m->linear->rigid, n);
  return p;
}

/* What else to hold to select the motion last found within its family. */
static int steady_advise (pw_steady_cli *x, pw_steady_point *p, pw_error *error) {
  pw_initial_value hold[PW_HOLDS];
  char name[300];
  size_t used = 0;
  int count = p->motion.family > 0 ? pw_steady_suggest (x->steady, hold, PW_HOLDS) : 0;
  for (int i = 0; i < count && used < sizeof p->advice; i++)
    used += (size_t)snprintf (p->advice + used, sizeof p->advice - used, " --hold %s=%.9g",
                              pw_system_held_name (x->m.system, hold[i].state, name, sizeof name), hold[i].value);
  return count < 0 ? pw_fail (error, count, "%s: out of memory", pw_file_name (x->m.file)) : PW_OK;
}

static int steady_same (const pw_steady_cli *x, const pw_steady_motion *a, const pw_steady_motion *b) {
  return fabs (a->parameter - b->parameter) <= 1e-9 * fabs (x->set.last - x->set.first) &&
         pw_steady_same (x->steady, a->q, a->v, b->q, b->v);
}

static int steady_stop (pw_steady_cli *x) {
  return x->stopped |= pw_limit_over (&x->limit) != 0;
}

/* ---- The search ---- */

/* Adds a solution that differs from those found; of each sort of families only one. */
static int steady_found (pw_steady_cli *x, const pw_steady_motion *m, int attempt, pw_error *error) {
  if (m->linear->steady == PW_CHANGING) return x->changing++, PW_OK;
  for (int i = 0; i < x->points; i++) {
    const pw_steady_motion *known = &x->point[i].motion;
    if (m->family > 0 && known->family == m->family && known->unstable == m->unstable) return PW_OK;
    if (steady_same (x, known, m)) return PW_OK;
  }
  if (!x->vary_text) x->branches++;
  pw_steady_point *p = steady_add (x, m, attempt, error);
  return p ? steady_advise (x, p, error) : PW_RESOURCE;
}

/* Solutions at a value of the parameter; that from the initial state is the first. */
static int steady_search (pw_steady_cli *x, double parameter, pw_error *error) {
  pw_progress progress;
  pw_steady_motion m;
  int status = PW_OK;
  pw_progress_count (&progress, pw_file_name (x->m.file), "starts", 0, x->attempts + 2);
  for (int k = 0; status == PW_OK && k <= x->attempts + 1 && !steady_stop (x); k++) {
    status = pw_steady_solve (x->steady, k, parameter, &m, error);
    if (status == PW_OK) status = steady_found (x, &m, k, error);
    if (status == PW_RETRY || (status == PW_METHOD && k > 0)) {
      x->nearest[k > 1] = fmin (x->nearest[k > 1], m.residual);
      *error = (pw_error){ 0 };
      status = PW_OK;
    }
    pw_progress_at (&progress, k + 1);
  }
  pw_progress_end (&progress);
  return status;
}

static int steady_fail (pw_steady_cli *x, pw_error *error) {
  char initial[60], random[100] = "", reason[300] = "";
  if (x->changing)
    return pw_fail (error, PW_INPUT,
                    "%s: the equations change with time or along the motion: there is no steady motion",
                    pw_file_name (x->m.file));
  snprintf (initial, sizeof initial, "from the initial state the residual ends at %.2g", x->nearest[0]);
  if (x->attempts)
    snprintf (random, sizeof random, ", from %d random ones at %.2g at best", x->attempts, x->nearest[1]);
  if (*pw_steady_reason (x->steady)) snprintf (reason, sizeof reason, "; %s", pw_steady_reason (x->steady));
  return pw_fail (error, PW_METHOD,
                  "%s: no steady motion found: %s%s, in units of the scene (L, L/T, L/T^2)%s; change what is held, or "
                  "begin nearer to one (--start)",
                  pw_file_name (x->m.file), initial, random, reason);
}

/* ---- Branches ---- */

static int steady_branch (pw_steady_cli *x, const pw_steady_point *from, int direction, pw_error *error) {
  char (*more)[PW_STEADY_REASON] = realloc (x->end, ((size_t)x->branches + 1) * sizeof *more);
  if (more == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  x->end = more;
  char *end = x->end[x->branches++];
  pw_steady_motion m = { 0 };
  pw_progress progress = { .title = NULL };
  const double begin = from->motion.parameter;
  int status = pw_steady_follow (x->steady, from->motion.q, from->motion.v, begin, direction, error);
  while (status == PW_OK && !steady_stop (x)) {
    status = pw_steady_next (x->steady, &m, error);
    if (status != PW_OK || m.event == PW_STEADY_END) break;
    if (steady_add (x, &m, from->attempt, error) == NULL) status = PW_RESOURCE;
    pw_vary_progress (&x->vary, &progress, begin, m.parameter, direction > 0 ? x->set.last : x->set.first);
  }
  pw_progress_end (&progress);
  snprintf (end, PW_STEADY_REASON, "%.199s", status == PW_METHOD ? error->text : pw_steady_reason (x->steady));
  if (status != PW_METHOD) return status;
  *error = (pw_error){ 0 };
  return PW_OK;
}

/* Whether a motion is one of the points from number `first`. */
static int steady_seen (const pw_steady_cli *x, const pw_steady_motion *m, int first) {
  int seen = 0;
  for (int k = first; k < x->points; k++) seen |= steady_same (x, &x->point[k].motion, m);
  return seen;
}

/* Follows the solutions that are on no branch yet: from one end of the range, or in between in both directions unless
 * the branch returns. */
static int steady_from (pw_steady_cli *x, double parameter, int direction, pw_error *error) {
  int known = x->points, status = steady_search (x, parameter, error), found = x->points - known;
  int inside = parameter != x->set.first && parameter != x->set.last;
  if (status < 0 && status != PW_RESOURCE && x->branches > 0) {
    pw_cli_say ("pinwheel: no branches sought from the other end: %s\n", error->text);
    *error = (pw_error){ 0 };
    return PW_OK;
  }
  pw_steady_point *start = malloc (((size_t)found + 1) * sizeof *start);
  if (start == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (found) memcpy (start, x->point + known, (size_t)found * sizeof *start);
  x->points = known;
  for (int i = 0; i < found; i++) {
    const pw_steady_motion *m = &start[i].motion;
    int seen = steady_seen (x, m, 0), before = x->points;
    if (status == PW_OK && !seen && !x->stopped) status = steady_branch (x, start + i, direction, error);
    if (status == PW_OK && !seen && !x->stopped && inside && !steady_seen (x, m, before + 1))
      status = steady_branch (x, start + i, -direction, error);
    free (start[i].state);
  }
  free (start);
  return status;
}

/* Without enough held, the branch has the values of the motion nearest to the initial state. */
static int steady_complete (pw_steady_cli *x, pw_error *error) {
  const pw_system *s = x->m.system;
  pw_steady_motion m;
  char name[300];
  double parameter = x->set.first;
  if (x->set.vary >= 0)
    parameter = pw_system_held_value (s, x->hold[x->set.vary].state, pw_system_initial_q (s), pw_system_initial_v (s));
  int status = pw_steady_solve (x->steady, 0, isfinite (parameter) ? parameter : x->set.first, &m, error);
  if (status == PW_RETRY || (status == PW_OK && m.family == 0)) return PW_OK;
  if (status != PW_OK) return status;
  int more = pw_steady_suggest (x->steady, x->hold + x->set.holds, PW_HOLDS - x->set.holds);
  if (more < 0) return pw_fail (error, more, "%s: out of memory", pw_file_name (x->m.file));
  for (int i = x->set.holds; i < x->set.holds + more; i++)
    pw_cli_say ("pinwheel: holding %s=%.9g, as in the motion nearest to the initial state\n",
                pw_system_held_name (s, x->hold[i].state, name, sizeof name), x->hold[i].value);
  x->set.holds += more;
  pw_steady_close (x->steady);
  x->steady = pw_steady_open (x->m.system, &x->set, error);
  return x->steady ? PW_OK : error->status;
}

/* The value in the model, or in its initial state. */
static double steady_model_value (const pw_steady_cli *x) {
  const pw_system *s = x->m.system;
  if (x->set.vary < 0) return pw_model_parameter (x->m.model, x->vary.parameter);
  return pw_system_held_value (s, x->hold[x->set.vary].state, pw_system_initial_q (s), pw_system_initial_v (s));
}

/* Branches that begin at the ends of the range, or if there are none, one at the value of the model. */
static int steady_branches (pw_steady_cli *x, pw_error *error) {
  int status = steady_complete (x, error);
  double own = steady_model_value (x), part = (own - x->set.first) / (x->set.last - x->set.first);
  if (status == PW_OK) status = steady_from (x, x->set.first, 1, error);
  if (status == PW_OK && !x->stopped) status = steady_from (x, x->set.last, -1, error);
  if (status == PW_OK && !x->stopped && x->points == 0 && part > 0 && part < 1) status = steady_from (x, own, 1, error);
  return status;
}

/* ---- The command ---- */

static int steady_compute (pw_steady_cli *x, pw_error *error) {
  x->nearest[0] = x->nearest[1] = INFINITY;
  pw_limit_start (&x->limit);
  x->steady = pw_steady_open (x->m.system, &x->set, error);
  if (x->steady == NULL) return error->status;
  pw_stop_catch ();
  int status = x->vary_text ? steady_branches (x, error) : steady_search (x, 0, error);
  pw_stop_release ();
  if (status == PW_OK && x->points == 0 && !x->stopped) status = steady_fail (x, error);
  return status;
}

static void steady_close (pw_steady_cli *x) {
  pw_files_close (&x->files);
  for (int i = 0; i < x->points; i++) free (x->point[i].state);
  free (x->point);
  free (x->end);
  pw_steady_close (x->steady);
  pw_cli_close_model (&x->m);
}

static int steady_command (void *options, pw_error *error) {
  pw_steady_cli *x = options;
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = steady_options (x, error);
  if (status == PW_OK) status = pw_figure_results (&x->line, &x->m, x->folder, "steady", &x->files, error);
  if (status == PW_OK) pw_report_model (x->m.model);
  if (status == PW_OK) status = steady_compute (x, error);
  if (status == PW_OK && x->points) pw_steady_print (x);
  if (status == PW_OK && x->points && x->folder) status = pw_steady_write (x, error);
  steady_close (x);
  return status == PW_OK && x->stopped ? pw_cli_incomplete (&x->line, error) : status;
}

static const struct poptOption steady_options_table[] = {
  PW_OPTION_GROUP ("Steady motions"),
  PW_HOLD_OPTION (pw_steady_cli, hold_texts),
  PW_TEXT_OPTION (pw_steady_cli, vary_text, "vary", 0, "NAME=FIRST:LAST",
                  "Follow branches over a parameter of the model, or of a held value such as BODY.speed"),
  PW_TEXT_OPTION (pw_steady_cli, starts_text, "starts", 0, "N",
                  "Begin at the initial state and at N random ones (default 30)"),
  PW_TEXT_OPTION (pw_steady_cli, at_text, "at", 0, "T", "Evaluate signals at time T [s] (default 0)"),
  PW_TEXT_OPTION (pw_steady_cli, folder, "output", 'o', "DIR",
                  "Write steady.csv, steady.json and, with --vary, figures into a folder"),
  PW_WIDTH_OPTION,
  PW_TEXT_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS", "Stop after this much processor time (default unlimited)"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_steady = {
  .name = "steady",
  .synopsis = "MODEL [OPTION...]",
  .summary = "find steady motions, and follow them over a parameter",
  .help =
      "Find steady motions, in which every body moves with one frame at constant speed and angular velocity, and "
      "equilibria; with --vary, follow them over a parameter, through folds, with eigenvalues and the values at which "
      "stability changes.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_steady_cli),
  .function = steady_command,
  .options = steady_options_table,
};
