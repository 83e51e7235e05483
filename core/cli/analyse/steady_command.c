/* The command `steady`: steady motions, and their branches over a parameter. */
#include <stdlib.h>
#include <string.h>
#include "unknowns.h"
#include "figure.h"

/* A steady motion found, or a point of a branch. */
typedef struct {
  int branch;              /* number of its branch, from 1; without --vary the number of the motion */
  int attempt;             /* number of the attempt of pw_steady_solve that found it */
  pw_steady_motion motion; /* its arrays are in `state`; motion.linear is NULL */
  pw_linear linear;        /* twist, unknowns, and in `state` re, im, rigid; the other members are not set */
  double *state;           /* q, v, re, im, rigid */
  char advice[1000];       /* options that select it in its family, " --hold NAME=VALUE..."; "" if none or too long */
} pw_steady_point;

enum { PW_STEADY_REASON = 200 }; /* longest reason, its end included */

typedef struct {
  pw_cli_line line;
  const char **hold_texts, *vary_text;
  pw_cli_given starts_given, at;
  pw_limit limit;
  pw_steady_settings settings;
  pw_initial_value hold[PW_HOLDS]; /* settings.holds values */
  pw_vary vary;
  int random_attempts; /* in each search: those that begin at random states */
  pw_steady *search;
  pw_steady_point *point; /* points: the motions, or those of each branch in turn */
  int points;
  size_t room;                   /* points allocated */
  char (*end)[PW_STEADY_REASON]; /* branches: why each ended; "" at the end of the range, or if stopped */
  int branches;
  double residual[2]; /* the least of the attempts: from the initial state, from random ones */
  int changing;       /* solutions that are not steady, as the equations change with time or along the motion */
  int families;       /* solutions of which no branch begins, since they are members of families */
  int stopped;        /* 1: by Ctrl-C or --limit */
} pw_steady_command;

#define STEADY_STARTS 30 /* default of --starts */

/* Directions of pw_steady_follow: towards the first or the last value of the range. */
enum { TO_FIRST = -1, TO_LAST = 1 };

/* Reads --vary NAME=LOW:HIGH: NAME is a parameter of the model, or a quantity that is held at the varied value. */
static int steady_read_vary (pw_steady_command *cmd, pw_error *error) {
  if (pw_vary_read (&cmd->vary, &cmd->line, cmd->vary_text, error) != PW_OK) return PW_INPUT;
  cmd->settings.first = cmd->vary.first, cmd->settings.last = cmd->vary.last;
  if (cmd->vary.parameter) {
    cmd->settings.compile = pw_vary_compile;
    cmd->settings.context = &cmd->vary;
    return PW_OK;
  }
  pw_error held = { 0 }, parameter = { 0 };
  if (strchr (cmd->vary.name, '.') == NULL && pw_system_find_held (cmd->line.m.system, cmd->vary.name, &held) < 0) {
    pw_model_set (cmd->line.m.model, cmd->vary.name, cmd->settings.first, &parameter);
    if (strstr (parameter.text, "did you mean") || !strstr (held.text, "did you mean")) held = parameter;
    return pw_fail (error, held.status, "%s", held.text);
  }
  cmd->settings.vary = cmd->settings.holds;
  int status = pw_hold_add (cmd->line.m.system, "--vary", cmd->vary_text, cmd->vary.name, cmd->settings.first,
                            cmd->hold, &cmd->settings.holds, error);
  if (status == PW_OK) cmd->vary.unit = pw_system_held_unit (cmd->line.m.system, cmd->hold[cmd->settings.vary].state);
  return status;
}

static int steady_read_options (pw_steady_command *cmd, pw_error *error) {
  const double starts = pw_cli_given_or (cmd->starts_given, STEADY_STARTS);
  cmd->settings.t = cmd->at.number;
  cmd->limit.seconds = pw_cli_given_or (cmd->line.limit, INFINITY);
  cmd->settings.span = cmd->line.m.defaults.t_end;
  cmd->settings.vary = -1; /* none of the values held */
  cmd->settings.hold = cmd->hold;
  if (!(starts >= 0 && starts <= 1e9 && starts == floor (starts)))
    return pw_fail (error, PW_INPUT, "--starts %s: expected a whole number >= 0", cmd->starts_given.text);
  int status = pw_hold_read (cmd->line.m.system, cmd->hold_texts, cmd->hold, &cmd->settings.holds, error);
  if (status == PW_OK && cmd->vary_text) status = steady_read_vary (cmd, error);
  cmd->random_attempts = (int)starts;
  return status;
}

static pw_steady_point *steady_add (pw_steady_command *cmd, const pw_steady_motion *m, int attempt, pw_error *error) {
  size_t coordinates = (size_t)pw_system_coordinates (cmd->line.m.system), n = (size_t)m->linear->unknowns;
  int status = pw_grow (&cmd->point, (size_t)cmd->points, &cmd->room, sizeof *cmd->point);
  double *a = status == PW_OK ? malloc ((2 * coordinates + 2 * n) * sizeof *a + n) : NULL;
  if (a == NULL) return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  pw_steady_point *p = cmd->point + cmd->points++;
  *p = (pw_steady_point){ .branch = cmd->branches, .attempt = attempt, .motion = *m, .state = a };
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

/* The error of this status after pw_steady_suggest. */
static int steady_unadvised (const pw_steady_command *cmd, int status, pw_error *error) {
  return pw_fail (error, status, "%s: %s", pw_file_name (cmd->line.m.file),
                  status == PW_RESOURCE ? "out of memory" : "the family of the steady motion cannot be determined");
}

static void steady_forget (pw_steady_command *cmd, int kept) {
  if (!cmd->vary_text) cmd->branches -= cmd->points - kept;
  while (cmd->points > kept) free (cmd->point[--cmd->points].state);
}

static int steady_same (const pw_steady_command *cmd, const pw_steady_motion *a, const pw_steady_motion *b) {
  return fabs (a->parameter - b->parameter) <= 1e-9 * fabs (cmd->settings.last - cmd->settings.first) &&
         pw_steady_same (cmd->search, a->q, a->v, b->q, b->v);
}

static int steady_is_stopped (pw_steady_command *cmd) {
  return cmd->stopped |= pw_limit_over (&cmd->limit) != 0;
}

/* Adds a solution unless it is known or not steady; only one of those in families of the same dimension and stability.
 * Its advice: the options --hold which, besides those given, select it within its family. */
static int steady_found (pw_steady_command *cmd, const pw_steady_motion *m, int attempt, pw_error *error) {
  if (m->linear->steady == PW_CHANGING) return cmd->changing++, PW_OK;
  for (int i = 0; i < cmd->points; i++) {
    const pw_steady_motion *known = &cmd->point[i].motion;
    if (m->family > 0 && known->family == m->family && known->unstable == m->unstable) return PW_OK;
    if (steady_same (cmd, known, m)) return PW_OK;
  }
  if (!cmd->vary_text) cmd->branches++;
  pw_steady_point *p = steady_add (cmd, m, attempt, error);
  if (p == NULL) return PW_RESOURCE;
  pw_initial_value hold[PW_HOLDS];
  size_t used = 0;
  int count = p->motion.family > 0 ? pw_steady_suggest (cmd->search, hold, PW_HOLDS) : 0;
  for (int i = 0; i < count && used < sizeof p->advice; i++)
    used += (size_t)snprintf (p->advice + used, sizeof p->advice - used, " --hold %s=%.9g",
                              PW_NAME (pw_system_held_name, cmd->line.m.system, hold[i].state), hold[i].value);
  if (used >= sizeof p->advice) *p->advice = 0;
  return count < 0 ? steady_unadvised (cmd, count, error) : PW_OK;
}

/* Adds the solutions at a value of the parameter, first the one found from the initial state; later attempts may fail
 * by PW_METHOD, too. */
static int steady_search (pw_steady_command *cmd, double parameter, pw_error *error) {
  pw_progress progress;
  pw_steady_motion m;
  int status = PW_OK, symmetries = pw_steady_symmetries (cmd->search);
  const int attempts = PW_STEADY_NOT_RANDOM + cmd->random_attempts, before = cmd->points, changing = cmd->changing;
  const double residual[2] = { cmd->residual[0], cmd->residual[1] };
  pw_progress_start (&progress, pw_file_name (cmd->line.m.file), "starts", 0, attempts);
  for (int k = 0; status == PW_OK && k < attempts && !steady_is_stopped (cmd); k++) {
    status = pw_steady_solve (cmd->search, k, parameter, &m, error);
    const int lost = symmetries - pw_steady_symmetries (cmd->search);
    if (status == PW_OK && lost == 0) status = steady_found (cmd, &m, k, error);
    double *least = &cmd->residual[k >= PW_STEADY_NOT_RANDOM];
    *least = fmin (*least, m.residual);
    if (status == PW_RETRY || (status == PW_METHOD && k > 0)) {
      *error = (pw_error){ 0 };
      status = PW_OK;
    }
    if (lost > 0) { /* those found may differ by what is lost */
      symmetries -= lost, steady_forget (cmd, before), k = -1;
      cmd->changing = changing;
      memcpy (cmd->residual, residual, sizeof residual);
    }
    pw_progress_at (&progress, k + 1);
  }
  pw_progress_end (&progress);
  return status;
}

static int steady_fail (pw_steady_command *cmd, pw_error *error) {
  char random[100] = "", reason[300] = "";
  if (cmd->families)
    return pw_fail (
        error, PW_METHOD,
        "%s: all steady motions found are members of families, in which no branch begins; hold more (--hold)",
        pw_file_name (cmd->line.m.file));
  const char *initial = PW_PRINTED (60, "from the initial state the residual ends at %.2g", cmd->residual[0]);
  if (cmd->random_attempts)
    snprintf (random, sizeof random, ", from %s at %.2g at best", PW_COUNTED (cmd->random_attempts, "random state"),
              cmd->residual[1]);
  if (cmd->changing)
    snprintf (reason, sizeof reason, "; %s %s not steady, as the equations change with time or along the motion",
              PW_COUNTED (cmd->changing, "solution"), cmd->changing == 1 ? "is" : "are");
  else if (*pw_steady_reason (cmd->search))
    snprintf (reason, sizeof reason, "; %s", pw_steady_reason (cmd->search));
  return pw_fail (error, PW_METHOD,
                  "%s: no steady motion found: %s%s, in units of the scene (L, L/T, L/T^2)%s; change what is held, or "
                  "begin nearer to one (--start)",
                  pw_file_name (cmd->line.m.file), initial, random, reason);
}

/* Removes a branch that has no direction where it should begin, since the motion is one of a family there. */
static int steady_omit (pw_steady_command *cmd, const pw_steady_motion *m, pw_error *error) {
  cmd->branches--;
  cmd->families++;
  pw_cli_say ("pinwheel: %s=%.9g: no branch begins at a steady motion that is one of a family of dimension %d\n",
              cmd->vary.name, m->parameter, m->family);
  *error = (pw_error){ 0 };
  return PW_OK;
}

static int steady_follow (pw_steady_command *cmd, const pw_steady_point *from, int direction, pw_error *error) {
  char (*ends)[PW_STEADY_REASON] = realloc (cmd->end, ((size_t)cmd->branches + 1) * sizeof *ends);
  if (ends == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  cmd->end = ends;
  char *end = cmd->end[cmd->branches++];
  pw_steady_motion m = { 0 };
  pw_progress progress = { .title = NULL };
  const double begin = from->motion.parameter;
  int status = pw_steady_follow (cmd->search, from->motion.q, from->motion.v, begin, direction, error);
  if (status == PW_METHOD && from->motion.family > 0) return steady_omit (cmd, &from->motion, error);
  while (status == PW_OK && !steady_is_stopped (cmd)) {
    status = pw_steady_next (cmd->search, &m, error);
    if (status != PW_OK || m.event == PW_STEADY_END) break;
    if (m.event == PW_STEADY_POINT && m.linear->steady == PW_CHANGING) { /* a symmetry at the beginning is lost */
      cmd->changing++, status = pw_fail (error, PW_METHOD, "the equations change along the motion");
      break;
    }
    if (steady_add (cmd, &m, from->attempt, error) == NULL) status = PW_RESOURCE;
    pw_vary_progress (&cmd->vary, &progress, begin, m.parameter,
                      direction == TO_LAST ? cmd->settings.last : cmd->settings.first);
  }
  pw_progress_end (&progress);
  snprintf (end, PW_STEADY_REASON, "%.199s", status == PW_METHOD ? error->text : pw_steady_reason (cmd->search));
  if (status != PW_METHOD) return status;
  *error = (pw_error){ 0 };
  return PW_OK;
}

static int steady_is_known (const pw_steady_command *cmd, const pw_steady_motion *m, int first) {
  int known = 0;
  for (int k = first; k < cmd->points; k++) known |= steady_same (cmd, &cmd->point[k].motion, m);
  return known;
}

/* Searches at a value of the parameter, and follows the solutions that are on no branch yet: from an end of the range
 * in this direction, from a value in between also in the other one, unless the branch is closed. */
static int steady_branches_from (pw_steady_command *cmd, double parameter, int direction, pw_error *error) {
  int before = cmd->points, status = steady_search (cmd, parameter, error), found = cmd->points - before;
  int inside = parameter != cmd->settings.first && parameter != cmd->settings.last;
  if (status < 0 && status != PW_RESOURCE && cmd->branches > 0) {
    pw_cli_say ("pinwheel: no branches sought from the other end: %s\n", error->text);
    *error = (pw_error){ 0 };
    steady_forget (cmd, before);
    return PW_OK;
  }
  pw_steady_point *start = malloc (((size_t)found + 1) * sizeof *start);
  if (start == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (found) memcpy (start, cmd->point + before, (size_t)found * sizeof *start);
  cmd->points = before; /* what follows adds the branches of these solutions */
  for (int i = 0; i < found; i++) {
    const pw_steady_motion *m = &start[i].motion;
    const int known = steady_is_known (cmd, m, 0), first = cmd->points;
    if (status == PW_OK && !known && !cmd->stopped) status = steady_follow (cmd, start + i, direction, error);
    const int begun = cmd->points > first; /* 0: steady_omit has removed the branch */
    if (status == PW_OK && !known && !cmd->stopped && inside && begun && !steady_is_known (cmd, m, first + 1))
      status = steady_follow (cmd, start + i, -direction, error);
    free (start[i].state);
  }
  free (start);
  return status;
}

/* The value of the parameter in the model, or in its initial state. */
static double steady_model_value (const pw_steady_command *cmd) {
  const pw_system *s = cmd->line.m.system;
  if (cmd->settings.vary < 0) return pw_model_parameter (cmd->line.m.model, cmd->vary.parameter);
  return pw_system_held_value (s, cmd->hold[cmd->settings.vary].state, pw_system_initial_q (s),
                               pw_system_initial_v (s));
}

/* If the quantities held leave a family of motions, holds further ones, at their values in the motion nearest to the
 * initial state: at the initial value of the held quantity that varies, if that is finite, else where the range begins,
 * as for a parameter; at a value within the range if the family is smaller there. */
static int steady_hold_more (pw_steady_command *cmd, pw_error *error) {
  const double first = cmd->settings.first, held = cmd->settings.vary < 0 ? NAN : steady_model_value (cmd),
               begin = isfinite (held) ? held : first, within = pw_value_within (first, cmd->settings.last);
  pw_error none = { 0 };
  pw_steady_motion m;
  int status = pw_steady_solve (cmd->search, 0, begin, &m, error), family = m.family;
  if (status == PW_OK && family > 0 &&
      !(pw_steady_solve (cmd->search, 0, within, &m, &none) == PW_OK && m.family < family))
    status = pw_steady_solve (cmd->search, 0, begin, &m, error);
  if (status == PW_RETRY || (status == PW_OK && m.family == 0)) return PW_OK;
  if (status != PW_OK) return status;
  int more = pw_steady_suggest (cmd->search, cmd->hold + cmd->settings.holds, PW_HOLDS - cmd->settings.holds);
  if (more < 0) return steady_unadvised (cmd, more, error);
  for (int i = cmd->settings.holds; i < cmd->settings.holds + more; i++)
    pw_cli_say ("pinwheel: holding %s=%.9g, as in the motion nearest to the initial state\n",
                PW_NAME (pw_system_held_name, cmd->line.m.system, cmd->hold[i].state), cmd->hold[i].value);
  cmd->settings.holds += more;
  pw_steady_close (cmd->search);
  cmd->search = pw_steady_open (cmd->line.m.system, &cmd->settings, error);
  return cmd->search ? PW_OK : error->status;
}

enum {
  STEADY_DIGITS = 6,         /* of numbers in the text */
  STEADY_SHOWN = 12,         /* motions in the text, at most */
  STEADY_CONFIGURATIONS = 3, /* motions whose states are printed, at most */
  STEADY_EVENTS = 40         /* of branches, in the text, at most */
};
#define STEADY_SMALL 1e-12 /* numbers below it are printed as 0, in SI units */

/* By pw_steady_event, without PW_STEADY_END, which is not stored. */
static const char *const steady_events[] = { "point", "fold", "zero eigenvalue", "Hopf" };

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
  const pw_system *s = cmd->line.m.system;
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

static void steady_print (const pw_steady_command *cmd) {
  char text[40];
  const char *model = pw_file_name (cmd->line.m.file),
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
    pw_states_print (cmd->line.m.system, m->q, m->v, STEADY_DIGITS, STEADY_SMALL);
  }
  for (int i = 0; i < cmd->points && i < STEADY_SHOWN; i++)
    if (*cmd->point[i].advice)
      printf ("\nMotion %d is one of a family of dimension %d; to select one:%s\n", i + 1, cmd->point[i].motion.family,
              cmd->point[i].advice);
}

static void steady_json (const void *context, pw_json *j) {
  const pw_steady_command *cmd = context;
  pw_json_print (j, "{schema: %d, model: %s, parameter: %s, unit: %s, held: {", 1, pw_file_name (cmd->line.m.file),
                 cmd->vary_text ? cmd->vary.name : NULL, cmd->vary.unit);
  for (int i = 0; i < cmd->settings.holds; i++)
    if (i != cmd->settings.vary)
      pw_json_number (j, PW_NAME (pw_system_held_name, cmd->line.m.system, cmd->hold[i].state), cmd->hold[i].value);
  pw_json_print (j, "}, symmetries: %d, attempts: %d, complete: %i, ends: [", pw_steady_symmetries (cmd->search),
                 PW_STEADY_NOT_RANDOM + cmd->random_attempts, !cmd->stopped);
  for (int i = 0; cmd->vary_text && i < cmd->branches; i++) pw_json_text (j, NULL, cmd->end[i]);
  pw_json_print (j, "], motions: [");
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
    const pw_linear *l = &p->linear;
    pw_json_print (j, "\n{branch: %d", p->branch);
    if (cmd->vary_text)
      pw_json_print (j, "event: %s, parameter: %g", steady_events[p->motion.event], p->motion.parameter);
    pw_json_print (j, "attempt: %d, residual: %g", p->attempt, p->motion.residual);
    if (!cmd->vary_text) pw_json_number (j, "family", p->motion.family);
    pw_json_number (j, "growing", p->motion.unstable);
    pw_json_numbers (j, "twist", l->twist, 3);
    pw_states_json (cmd->line.m.system, p->motion.q, p->motion.v, "state", j);
    pw_json_open (j, "eigenvalues", '[');
    for (int i = 0; i < l->unknowns; i++)
      pw_json_print (j, "{re: %g, im: %g, frequency_hz: %g, rigid: %i}", l->re[i], l->im[i],
                     fabs (l->im[i]) / (2 * PW_PI), l->rigid[i]);
    pw_json_print (j, "]}");
  }
  pw_json_print (j, "]}");
}

static int steady_most_eigenvalues (const pw_steady_command *cmd) {
  int most = 0;
  for (int i = 0; i < cmd->points; i++)
    if (cmd->point[i].linear.unknowns > most) most = cmd->point[i].linear.unknowns;
  return most;
}

static void steady_csv (const void *context, pw_cells *t) {
  const pw_steady_command *cmd = context;
  const pw_system *s = cmd->line.m.system;
  const int most = steady_most_eigenvalues (cmd);
  pw_cells_text (t, "branch,event");
  pw_cells_name (t, cmd->vary_text ? cmd->vary.name : "parameter", cmd->vary.unit);
  pw_cells_text (t, "growing,residual");
  pw_states_header (s, t);
  pw_complex_header (t, most, "1/s");
  pw_cells_end (t);
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
    pw_cells_number (t, p->branch);
    pw_cells_text (t, steady_events[p->motion.event]);
    pw_cells_number (t, p->motion.parameter);
    pw_cells_number (t, p->motion.unstable);
    pw_cells_number (t, p->motion.residual);
    pw_states_cells (s, p->state, t);
    pw_complex_cells (t, p->linear.re, p->linear.im, p->linear.unknowns, most);
    pw_cells_end (t);
  }
}

enum { REAL, IMAGINARY }; /* parts of an eigenvalue */

/* Number k, from 0, of the real parts, or the absolute values of the imaginary parts, in descending order, of
 * eigenvalues without those of rigid displacements; NaN if there are fewer. */
static double steady_ranked (const pw_linear *l, int part, int k) {
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

/* The ranges of real and imaginary parts in the figure [1/s].  Modes that decay much faster than others grow or
 * oscillate are not shown, unless the others are nearly 0. */
static void steady_ranges (const pw_steady_command *cmd, double re[2], double im[2]) {
  double low = INFINITY, high = -INFINITY, imaginary = 0;
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++)
    for (int i = 0; i < p->linear.unknowns; i++) {
      if (p->linear.rigid[i]) continue;
      low = fmin (low, p->linear.re[i]), high = fmax (high, p->linear.re[i]);
      imaginary = fmax (imaginary, fabs (p->linear.im[i]));
    }
  if (low > high) low = -1, high = 1; /* no eigenvalues */
  const double slow = 5 * fmax (high, imaginary);
  if (slow > -5e-3 * low) low = fmax (low, -slow);
  const double size = fmax (fabs (low), fabs (high)),
               margin = fmax (4e-5, high - low < 1e-3 * size ? 0.05 * size : 0.04 * (high - low));
  re[0] = low - margin, re[1] = high + margin;
  im[1] = 1.08 * (imaginary > 1e-9 * fmax (1, size) ? imaginary : 2 * PW_PI), im[0] = -im[1];
}

/* Eigenvalues over the parameter, stable parts solid, unstable ones dashed; below them the root locus. */
static void steady_draw (const void *context, pw_curves *c) {
  const pw_steady_command *cmd = context;
  if (cmd->vary_text == NULL) return;
  const double first = fmin (cmd->settings.first, cmd->settings.last),
               last = fmax (cmd->settings.first, cmd->settings.last);
  const char *parameter = PW_FIGURE_LABEL (cmd->vary.name, cmd->vary.unit);
  double re[2], im[2];
  steady_ranges (cmd, re, im);
  for (int part = REAL; part <= IMAGINARY; part++) {
    pw_panel panel = { .x_label = parameter, .x = { first, last }, .type = part == REAL ? 0 : PW_PANEL_BELOW };
    panel.y_label = part == REAL ? "real part [1/s]" : "frequency [Hz]";
    panel.y[0] = part == REAL ? re[0] : 0, panel.y[1] = part == REAL ? re[1] : im[1] / (2 * PW_PI);
    pw_curves_panel (c, &panel);
    /* on the parts of branches where no modes grow (stable or neutral), then where some do */
    for (int stable = 1; stable >= 0; stable--) {
      pw_curves_add (c, stable ? "stable" : "unstable", stable ? "stable" : "unstable");
      for (int k = 0; k < steady_most_eigenvalues (cmd); k++)
        for (int i = 0, inside = 0; i < cmd->points; i++) { /* inside: 1: the last point began or continued a part */
          const pw_steady_point *p = cmd->point + i;
          /* at an event, where `unstable` does not count the modes that change, the next point decides */
          const pw_steady_point *decides = p->motion.event == PW_STEADY_POINT ? p : p + 1;
          const int here = i + 1 < cmd->points && p[1].branch == p->branch && (decides->motion.unstable == 0) == stable;
          const double value = steady_ranked (&p->linear, part, k) / (part == IMAGINARY ? 2 * PW_PI : 1);
          const int shown = (here || inside) && !(part == IMAGINARY && value <= 1e-12);
          pw_curves_point (c, p->motion.parameter, shown ? value : NAN, 0);
          if (!here) pw_curves_point (c, NAN, NAN, 0);
          inside = here;
        }
    }
    /* lines at the folds, and at the other events, if there are any */
    for (int folds = 0; folds < 2 && part == REAL; folds++) {
      int events = 0;
      for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++) {
        if (p->motion.event == PW_STEADY_POINT || (p->motion.event == PW_STEADY_FOLD) != folds) continue;
        if (events++ == 0) pw_curves_add (c, folds ? "fold" : "change", folds ? "fold" : "stability changes");
        pw_curves_point (c, p->motion.parameter, INFINITY, 0);
      }
    }
  }
  pw_curves_panel (c, &(pw_panel){ .x_label = "real part [1/s]",
                                   .y_label = "imaginary part [1/s]",
                                   .z_label = parameter,
                                   .x = { re[0], re[1] },
                                   .y = { im[0], im[1] },
                                   .z = { first, last } });
  pw_curves_add (c, "scale", NULL);
  for (const pw_steady_point *p = cmd->point; p < cmd->point + cmd->points; p++)
    for (int i = 0; i < p->linear.unknowns; i++)
      if (!p->linear.rigid[i]) pw_curves_point (c, p->linear.re[i], p->linear.im[i], p->motion.parameter);
}

static const pw_results steady_results = {
  .name = "steady",
  .title = "eigenvalues of steady motions",
  .takes_folder = 1,
  .lines = 1,
  .table = steady_csv,
  .json = steady_json,
  .draw = steady_draw,
};

/* Finds steady motions of the model; with --vary branches that begin at the ends of the range or, if there are none,
 * at the value of the model or within the range. */
static int steady_compute (pw_steady_command *cmd, pw_error *error) {
  const double first = cmd->settings.first, last = cmd->settings.last;
  cmd->residual[0] = cmd->residual[1] = INFINITY;
  pw_limit_start (&cmd->limit);
  cmd->search = pw_steady_open (cmd->line.m.system, &cmd->settings, error);
  if (cmd->search == NULL) return error->status;
  pw_stop_catch ();
  int status = cmd->vary_text ? steady_hold_more (cmd, error) : steady_search (cmd, 0, error);
  if (cmd->vary_text) {
    double own = steady_model_value (cmd), fraction = (own - first) / (last - first);
    if (!(fraction > 0 && fraction < 1)) own = pw_value_within (first, last);
    if (status == PW_OK) status = steady_branches_from (cmd, first, TO_LAST, error);
    if (status == PW_OK && !cmd->stopped) status = steady_branches_from (cmd, last, TO_FIRST, error);
    if (status == PW_OK && !cmd->stopped && cmd->points == 0) status = steady_branches_from (cmd, own, TO_LAST, error);
  }
  pw_stop_release ();
  if (status == PW_OK && cmd->points == 0 && !cmd->stopped) status = steady_fail (cmd, error);
  return status;
}

static int steady_command (void *options, pw_error *error) {
  pw_steady_command *cmd = options;
  int status = pw_cli_open (&cmd->line, error);
  if (status == PW_OK) status = steady_read_options (cmd, error);
  if (status == PW_OK) status = pw_results_open (&cmd->line, &steady_results, pw_cli_tables, (pw_use){ 0 }, error);
  if (status == PW_OK) pw_report_model (&cmd->line.m);
  if (status == PW_OK) status = steady_compute (cmd, error);
  if (status == PW_OK && cmd->points) {
    steady_print (cmd);
    status = pw_results_write (&cmd->line, &steady_results, cmd, error);
  }
  steady_forget (cmd, 0);
  free (cmd->point);
  free (cmd->end);
  pw_steady_close (cmd->search);
  return status == PW_OK && cmd->stopped ? pw_cli_incomplete (&cmd->line, error) : status;
}

static const struct poptOption steady_options_table[] = {
  PW_OPTION_GROUP ("Steady motions"),
  PW_HOLD_OPTION (pw_steady_command, hold_texts),
  PW_TEXT_OPTION (pw_steady_command, vary_text, "vary", 0, "NAME=LOW:HIGH",
                  "Follow branches over a parameter of the model, or of a held value such as BODY.speed"),
  PW_NUMBER_OPTION (pw_steady_command, starts_given, "starts", 0, "N", PW_REAL,
                    "Begin at the initial state and at N random ones (default 30)"),
  PW_NUMBER_OPTION (pw_steady_command, at, "at", 0, "T", PW_NONNEGATIVE, "Evaluate signals at time T [s] (default 0)"),
  PW_RESULTS_OPTIONS ("Write the motions as a table", "Write the results", "With --vary, draw figures"),
  PW_LIMIT_OPTION,
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
  .options_size = sizeof (pw_steady_command),
  .function = steady_command,
  .options = steady_options_table,
};
