/* Signals by expressions of time, and of states, in text models.
 *
 * Such an expression becomes a function signal.  Each compiled system has a copy, since it may outlive the model. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

enum { TIME_STATES = 16, TIME_TRIED = 100 }; /* states that a signal reads; breakpoints that are tried out */

typedef struct {
  const pw_expression *x[3];         /* value, rate, acceleration; NULL: not given, then it is differentiated */
  int derivatives;                   /* by time that are wanted: 0, 1, 2 */
  int states;                        /* it reads, */
  const char *name[TIME_STATES + 2]; /* "t", "BODY.phi" and the like; for reading only, like */
  pw_signal_text text;
} time_function;

/* ---- Evaluation ---- */

/* Each derivative that is not given is that of what is given below it. */
static void time_derivatives (const time_function *f, const double *variable, double u[3]) {
  pw_expression_derivatives (f->x[0], variable, 0, u);
  for (int i = 1; i <= f->derivatives; i++) {
    double d[3];
    if (f->x[i] == NULL) continue;
    pw_expression_derivatives (f->x[i], variable, 0, d);
    u[i] = d[0];
    if (i == 1) u[2] = d[1];
  }
  if (f->derivatives < 2) u[2] = 0;
}

static int time_eval (void *context, double t, const double *x, double value[3], double *gradient) {
  const time_function *f = context;
  double variable[TIME_STATES + 1] = { t }, u[3];
  if (f->states) memcpy (variable + 1, x, (size_t)f->states * sizeof *x);
  if (f->derivatives)
    time_derivatives (f, variable, value);
  else
    value[0] = pw_expression_value (f->x[0], variable);
  for (int i = 0; gradient && i < f->states; i++) {
    pw_expression_derivatives (f->x[0], variable, 1 + i, u);
    gradient[i] = isfinite (u[1]) ? u[1] : 0; /* |v| at rest has none; it only guides Newton's iteration */
  }
  return isfinite (value[0]) && (f->derivatives == 0 || (isfinite (value[1]) && isfinite (value[2]))) ? 0 : -1;
}

static double time_breakpoint (void *context, double t) {
  const time_function *f = context;
  double first = INFINITY;
  for (int i = 0; i < 3; i++)
    if (f->x[i]) first = fmin (first, pw_expression_breakpoint (f->x[i], t));
  return first;
}

static void *time_open (void *context) {
  const time_function *f = context;
  size_t size = sizeof *f;
  for (int i = 0; i < 3; i++) size += f->x[i] ? pw_expression_size (f->x[i]) : 0;
  time_function *copy = malloc (size);
  if (copy == NULL) return NULL;
  *copy = *f;
  char *at = (char *)(copy + 1);
  for (int i = 0; i < 3; i++) {
    if (f->x[i] == NULL) continue;
    copy->x[i] = memcpy (at, f->x[i], pw_expression_size (f->x[i]));
    at += pw_expression_size (f->x[i]);
  }
  return copy;
}

/* ---- Reading ---- */

typedef struct {
  pw_yaml_builder *b;
  time_function *f;
  const pw_node *node;
  const char *what;
  int forced;
  pw_function *signal;
  pw_error *error;
} time_reader;

/* Notes a state the expression reads. */
static int time_note (void *context, const char *name, size_t length, size_t at) {
  time_reader *r = context;
  time_function *f = r->f;
  char text[100];
  if (memchr (name, '.', length) == NULL) return PW_OK;
  snprintf (text, sizeof text, "%.*s", (int)length, name);
  for (int i = 1; i <= f->states; i++)
    if (strcmp (f->name[i], text) == 0) return PW_OK;
  if (!r->forced)
    return pw_yaml_fail (r->b->y, pw_yaml_place (r->b->y, r->node, at), r->error,
                         "%s: \"%s\": the signal of a constraint depends on the time t alone", r->what, text);
  if (pw_yaml_state (r->b, &(pw_yaml_reading){ r->node, r->what }, text, at, r->error) != PW_OK)
    return r->error->status;
  if (f->states == TIME_STATES || length >= sizeof text)
    return pw_yaml_fail (r->b->y, pw_yaml_place (r->b->y, r->node, at), r->error, "%s: more than %d states", r->what,
                         TIME_STATES);
  char *kept = pw_arena_text (r->b->arena, text);
  if (kept == NULL) return pw_yaml_no_memory (r->b->y, r->error);
  f->name[++f->states] = kept;
  return PW_OK;
}

/* The part that jumps as states change, as a text of its own. */
static int time_jump (time_reader *r, const pw_expression *x) {
  if (x->jump == NULL || r->f->text.jump) return PW_OK;
  char *text = pw_arena_take (r->b->arena, (size_t)x->jump_size + 1);
  if (text == NULL) return pw_yaml_no_memory (r->b->y, r->error);
  memcpy (text, x->jump, (size_t)x->jump_size);
  r->f->text.jump = text;
  return PW_OK;
}

static int time_expression (time_reader *r, int i) {
  const pw_yaml *y = r->b->y;
  pw_expression_trouble trouble;
  if (pw_yaml_text (y, r->node, r->what, &r->f->text.part[i], r->error) != PW_OK ||
      pw_expression_names (r->node->text, time_note, r) != PW_OK)
    return r->error->status;
  int status = pw_expression_read (r->b->x, r->f->name, r->node->text, r->b->arena, &r->f->x[i], &trouble);
  if (status == PW_INPUT)
    return pw_yaml_fail (y, pw_yaml_place (y, r->node, trouble.at), r->error, "%s: %s", r->what, trouble.text);
  if (status != PW_OK) return pw_yaml_no_memory (y, r->error);
  if (r->f->x[i]->breaks) r->signal->breakpoint = time_breakpoint;
  if ((r->b->codes += r->f->x[i]->codes) > PW_YAML_CODES)
    return pw_yaml_fail (y, r->node->at, r->error,
                         "%s: the signals by expressions up to here have more than %d operations, which need more "
                         "memory than a model may have",
                         r->what, PW_YAML_CODES);
  return time_jump (r, r->f->x[i]);
}

/* ---- Derivatives by time ---- */

/* Compares a derivative that is given with the exact one, at some times. */
static int time_check (time_reader *r, int i, const char *name) {
  static const double time[] = { 0.3, 1.7, 4.1 };
  double given[3], exact[3][3], size = 0;
  for (int k = 0; k < 3; k++) {
    given[k] = pw_expression_value (r->f->x[i], &time[k]);
    pw_expression_derivatives (r->f->x[i - 1], &time[k], 0, exact[k]);
    if (isfinite (given[k]) && isfinite (exact[k][1]))
      size = fmax (size, fabs (given[k]) + fabs (exact[k][1]) + 1e-6 * fabs (exact[k][0]));
  }
  for (int k = 0; k < 3; k++)
    if (isfinite (given[k]) && isfinite (exact[k][1]) && fabs (given[k] - exact[k][1]) > 1e-6 * size)
      return pw_yaml_fail (r->b->y, r->node->at, r->error, "%s: the %s at t = %g s is %.6g, but the derivative is %.6g",
                           r->what, name, time[k], given[k], exact[k][1]);
  return PW_OK;
}

/* The largest value of u[i] at times around t. */
static double time_size (const time_function *f, double t, int i) {
  double size = 0;
  for (int k = -20; k <= 20; k++) {
    double at = t + (k < 0 ? -1 : 1) * ldexp (1, -abs (k)), u[3];
    time_derivatives (f, &at, u);
    if (isfinite (u[i])) size = fmax (size, fabs (u[i]));
  }
  return size;
}

/* Refuses what a constraint cannot follow: a value that jumps, of positions a rate that does. */
static int time_continuous (time_reader *r, int levels) {
  static const char *const name[] = { "its value", "its rate" };
  double t = 0, before[3], after[3];
  for (int k = 0; k < TIME_TRIED && r->signal->breakpoint; k++) {
    t = time_breakpoint (r->f, t);
    if (t == INFINITY) return PW_OK;
    time_derivatives (r->f, &(double){ nextafter (t, -INFINITY) }, before);
    time_derivatives (r->f, &t, after);
    double between = t - nextafter (t, -INFINITY);
    for (int i = 0; i < levels; i++)
      if (fabs (after[i] - before[i]) >
          1e-9 * time_size (r->f, t, i) + 2 * between * (fabs (after[i + 1]) + fabs (before[i + 1])))
        return pw_yaml_fail (r->b->y, r->node->at, r->error,
                             "%s: %s jumps from %.6g to %.6g at t = %.9g s, and that of %s must not", r->what, name[i],
                             before[i], after[i], t, levels > 1 ? "a prescribed position" : "a velocity constraint");
  }
  return PW_OK;
}

/* Reads the value, and the derivatives as far as they are given. */
static int time_all (time_reader *r, const pw_node *const v[3]) {
  static const char *const key[] = { "expression", "rate", "acceleration" };
  for (int i = 0; i < 3; i++) {
    if (v[i] == NULL) continue;
    r->node = v[i];
    if (time_expression (r, i) != PW_OK) return r->error->status;
    if (i > 0 && r->f->x[i - 1] && !r->f->states && time_check (r, i, key[i]) != PW_OK) return r->error->status;
  }
  r->node = v[0];
  return r->forced ? PW_OK : time_continuous (r, r->f->derivatives);
}

int pw_yaml_of_time (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *const v[3],
                     pw_signal *signal, pw_error *error) {
  time_function *f = pw_arena_take (b->arena, sizeof *f);
  if (f == NULL) return pw_yaml_no_memory (b->y, error);
  *signal = (pw_signal){ PW_FUNCTION, .function = { .eval = time_eval, .context = f } };
  f->name[0] = "t";
  f->derivatives = pw_kind_forced (kind) ? 0 : kind->level == PW_HOLONOMIC ? 2 : 1;
  signal->function.open = time_open;
  signal->function.close = free;
  signal->function.text = &f->text;
  time_reader reader = { b, f, NULL, what, pw_kind_forced (kind), &signal->function, error };
  if (pw_yaml_keep_names (b, error) != PW_OK || time_all (&reader, v) != PW_OK) return error->status;
  if (f->states) signal->function.reads = f->name + 1;
  return PW_OK;
}
