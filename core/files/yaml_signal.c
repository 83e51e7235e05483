/* Reads signals, paths and outputs of text models. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "yaml_read.h"

/* ---- Signals that are expressions ----
 *
 * Such a signal is a function, of which each compiled system has a copy (signal_open): it may outlive the model. */

/* That whose rules signals of the current field follow; NULL: those of limits. */
static const pw_kind *signal_kind (const pw_reader *r) {
  return r->field->limit ? NULL : r->kind;
}

enum { MAX_SIGNAL_STATES = 16, MAX_CHECKED_BREAKPOINTS = 100 };

/* Value and derivatives u; what is not given is computed from the last one given before; u[2] is 0 unless required. */
static void signal_derivatives (const pw_signal_function *f, const double *variable, double u[3]) {
  pw_expression_derivatives (f->expression[0], variable, PW_EXPRESSION_TIME, u);
  for (int i = 1; i <= f->derivatives; i++) {
    double given[3];
    if (f->expression[i] == NULL) continue;
    pw_expression_derivatives (f->expression[i], variable, PW_EXPRESSION_TIME, given);
    u[i] = given[0];
    if (i == 1) u[2] = given[1]; /* the derivative of the given rate, unless the acceleration is given, too */
  }
  if (f->derivatives < 2) u[2] = 0;
}

static int signal_eval (void *context, double t, const double *state, double value[3], double *gradient) {
  const pw_signal_function *f = context;
  double variable[PW_OUTPUT_READS + 1] = { t }, derivatives[3];
  if (f->states) memcpy (variable + 1, state, (size_t)f->states * sizeof *state);
  if (f->derivatives)
    signal_derivatives (f, variable, value);
  else
    value[0] = pw_expression_value (f->expression[0], variable);
  for (int i = 0; gradient && i < f->states; i++) {
    pw_expression_derivatives (f->expression[0], variable, 1 + i, derivatives);
    if (derivatives[0] != value[0]) /* at a jump in time, which only derivatives by t decide: pass it */
      variable[0] = nextafter (t, INFINITY), pw_expression_derivatives (f->expression[0], variable, 1 + i, derivatives);
    /* 0 where the derivative is unknown, such as that of sqrt (vx^2 + vy^2) at rest. */
    gradient[i] = isfinite (derivatives[1]) ? derivatives[1] : 0;
  }
  if (isfinite (value[0]) && (f->derivatives == 0 || (isfinite (value[1]) && isfinite (value[2])))) return 0;
  if (f->fixed == NULL || f->expression[0] == f->whole) return -1;
  pw_signal_function free = *f; /* beyond its side, "x > 0 ? sqrt (x) : 0" has no value */
  free.expression[0] = f->whole;
  return signal_eval (&free, t, state, value, gradient);
}

static int signal_sides (void *context, double t, const double *state, double *beyond) {
  pw_signal_function *f = context;
  double variable[PW_OUTPUT_READS + 1] = { t };
  if (state) memcpy (variable + 1, state, (size_t)f->states * sizeof *state);
  if (state) pw_expression_sides (f->whole, f->is_output, variable, f->side, beyond, beyond ? NULL : f->fixed);
  if (!beyond) f->expression[0] = state ? f->fixed : f->whole;
  return f->conditions;
}

static double signal_breakpoint (void *context, double t) {
  const pw_signal_function *f = context;
  double first = INFINITY;
  for (int i = 0; i < 3; i++)
    if (f->expression[i])
      first = fmin (first, pw_expression_breakpoint (i == 0 && f->whole ? f->whole : f->expression[i], t));
  return first;
}

static void signal_range (void *context, const double *lo, const double *hi, double bounds[2]) {
  const pw_signal_function *f = context;
  pw_expression_bounds (f->expression[0], 1 + f->states, lo, hi, bounds);
}

static void *signal_open (void *context) {
  const pw_signal_function *f = context;
  size_t bytes[3] = { 0 };
  for (int i = 0; i < 3; i++)
    if (f->expression[i]) bytes[i] = pw_expression_size (f->expression[i]);
  const size_t conditions = (size_t)f->conditions, sides = conditions * sizeof *f->side,
               fixed = conditions ? bytes[0] + 2 * conditions * sizeof *f->whole->code : 0;
  pw_signal_function *copy = malloc (sizeof *f + bytes[0] + bytes[1] + bytes[2] + sides + fixed);
  if (copy == NULL) return NULL;
  *copy = *f;
  char *at = (char *)(copy + 1);
  for (int i = 0; i < 3; at += bytes[i++])
    if (f->expression[i]) {
      copy->expression[i] = memcpy (at, f->expression[i], bytes[i]);
      pw_expression_share_paths (copy->expression[i]);
    }
  copy->whole = copy->expression[0];
  if (conditions == 0) return copy;
  copy->side = (double *)(void *)at;
  copy->fixed = memcpy (at + sides, f->expression[0], sizeof *copy->fixed); /* without its code */
  return copy;
}

static void signal_close (void *context) {
  const pw_signal_function *f = context;
  for (int i = 0; i < 3; i++)
    if (f->expression[i]) pw_expression_release_paths (i == 0 ? f->whole : f->expression[i]);
  free (context);
}

/* Whether the name of a state is that of a velocity, not of a coordinate or a first-order state. */
static int signal_is_velocity (const pw_reader *r, const char *name) {
  const char *dot = strchr (name, '.'), *part = dot ? dot + 1 : "";
  const char *owner = PW_PART (name, dot ? (size_t)(dot - name) : 0);
  if (dot == NULL) return 0;
  if (pw_names_find (&r->bodies, owner) >= 0) return pw_body_state (part) >= 3;
  const int kind = pw_names_find (&r->elements, owner);
  for (int i = 0; kind >= 0 && i < pw_kinds[kind]->internal; i++)
    if (strcmp (part, pw_kinds[kind]->coordinate[i].rate) == 0) return 1;
  return 0;
}

/* Adds a state, at an offset of the expression, unless it is known already. */
static int signal_add_state (pw_reader *r, const pw_node *node, pw_signal_function *f, const char *name, size_t at) {
  for (int i = 1; i <= f->states; i++)
    if (strcmp (f->name[i], name) == 0) return PW_OK;
  if (f->derivatives > 1 || (f->derivatives && !pw_kind_signals_feedback (r->kind)))
    return expression_fail (r, node, at, "\"%s\": %s alone", name,
                            r->kind->of_coordinate ? "a curve depends on its parameter s"
                                                   : "the signal of a position constraint depends on the time t");
  if (pw_check_state_name (r, node, name, at) != PW_OK) return r->error->status;
  if (f->derivatives && signal_is_velocity (r, name))
    return expression_fail (r, node, at,
                            "\"%s\": the signal of a velocity constraint depends on positions and first-order states, "
                            "not on velocities; use a state that follows it, {name: NAME, rate: (%s - NAME)/TIME}",
                            name, name);
  if (f->states == MAX_SIGNAL_STATES) return expression_fail (r, node, at, "more than %d states", MAX_SIGNAL_STATES);
  f->name[f->states + 1] = pw_arena_copy (r->arena, name);
  return f->name[++f->states] ? PW_OK : read_no_memory (r);
}

/* Finds the column of tables that a name in an expression names, also of an element that follows; its index is not set.
 * 0: there is none. */
static int find_column (pw_reader *r, const char *name, pw_column *c) {
  const char *dot = strchr (name, '.'), *last = strrchr (name, '.');
  if (dot == NULL && pw_is_state_name (r, name)) return *c = (pw_column){ PW_COLUMN_STATE, 0 }, 1;
  if (dot == NULL) return pw_kind_find_column (NULL, name, c);
  const char *owner = PW_PART (name, (size_t)(dot - name));
  const char *body = last == dot ? NULL : PW_PART (dot + 1, (size_t)(last - dot) - 1);
  if (body == NULL && pw_names_find (&r->bodies, owner) >= 0 && pw_body_state (last + 1) >= 0)
    return *c = (pw_column){ PW_COLUMN_STATE, 0 }, 1;
  int kind = pw_index_elements (r) == PW_OK ? pw_names_find (&r->elements, owner) : -1;
  const pw_kind *type = kind < 0 ? NULL : pw_kinds[kind];
  if (type == NULL || type->each_body != (body != NULL)) return 0;
  if (body && pw_names_find (&r->bodies, body) < 0) return 0;
  return pw_kind_find_column (type, last + 1, c) || (type->exact && pw_kind_find_column (type->exact, last + 1, c)) ||
         (type->companion && pw_kind_find_column (type->companion, last + 1, c));
}

/* The place of a wheel or marker that precedes, "rear.x", as an expression of states; NULL: the name is another one, or
 * out of memory. */
static const char *contact_text (pw_reader *r, const char *name) {
  const char *dot = strchr (name, '.');
  int elements, found = dot ? pw_names_find (&r->contacts, PW_PART (name, (size_t)(dot - name))) : -1;
  if (found < 0 || (strcmp (dot, ".x") != 0 && strcmp (dot, ".y") != 0)) return NULL;
  const pw_element *e = pw_model_elements (r->model, &elements) + found;
  const double *at = pw_field_at (e->kind, e->definition, PW_POINT, 0);
  const char *body = *(const char *const *)pw_field_at (e->kind, e->definition, PW_BODY, 0);
  if (!pw_expression_is_name (body)) return NULL;
  const char *format = dot[1] == 'x' ? "(%s.x + (%.17g)*cos (%s.phi) - (%.17g)*sin (%s.phi))"
                                     : "(%s.y + (%.17g)*sin (%s.phi) + (%.17g)*cos (%s.phi))";
  return pw_arena_copy (r->arena, PW_PRINTED (400, format, body, at[0], body, at[1], body));
}

static const char *expand_name (void *context, const char *name) {
  pw_reader *r = context;
  int output = pw_names_find (&r->outputs, name);
  return output >= 0 ? r->output[output]->node.text : contact_text (r, name);
}

/* Reports a name that is no column, with the nearest column of its body or element, or the nearest of these. */
static int output_unknown (pw_reader *r, const pw_node *node, const char *name, size_t at) {
  static const char *const other[] = { "x", "y", "work", "loss" };
  const size_t n = strcspn (name, ".");
  const char *owner = PW_PART (name, n);
  const int is_body = pw_names_find (&r->bodies, owner) >= 0, element = pw_names_find (&r->elements, owner);
  const pw_kind *kind = element >= 0 ? pw_kinds[element] : NULL;
  pw_nearest near = { .sought = is_body || kind ? name + n + 1 : owner };
  for (int i = 0; is_body && i < 6; i++) pw_nearest_try (&near, pw_body_states[i]);
  for (int i = 0; kind && i < 2 * kind->internal; i++)
    pw_nearest_try (&near, i % 2 ? kind->coordinate[i / 2].rate : kind->coordinate[i / 2].name);
  for (int i = 0; kind && i < kind->rows; i++) pw_nearest_try (&near, kind->reaction[i].name);
  for (int i = 0; kind && i < 4; i++)
    if (pw_kind_find_column (kind, other[i], &(pw_column){ 0 })) pw_nearest_try (&near, other[i]);
  if (is_body || kind)
    return expression_fail (r, node, at + n + 1, "%s has no column \"%.60s\"%s", owner, name + n + 1,
                            pw_nearest_text (&near));
  pw_suggest_bodies (r, &near);
  for (const struct pw_name *e = r->elements.slot, *end = e + r->elements.size; e < end; e++)
    if (e->name) pw_nearest_try (&near, e->name);
  return expression_fail (r, node, at, "there is no body or element \"%s\"%s", owner, pw_nearest_text (&near));
}

/* Adds the states on which a column depends, at an offset of the expression; output: the one that reads it, or NULL. */
static int signal_add_column (pw_reader *r, const pw_node *node, pw_signal_function *f,
                              const pw_output_function *output, const char *name, size_t at) {
  char state[PW_EXPRESSION_NAME];
  const char *place = contact_text (r, name), *owner = PW_PART (name, strcspn (name, "."));
  const char *where = output ? PW_PRINTED (100, "output \"%s\" reads %s: ", output->output.name, name) : "";
  pw_column c;
  for (const char *rest = place ? place : ""; pw_expression_next_name (&rest, state) != NULL;)
    if (strchr (state, '.') && signal_add_state (r, node, f, state, at) != PW_OK) return r->error->status;
  if (place) return PW_OK;
  const int found = find_column (r, name, &c);
  if (found && c.type == PW_COLUMN_CONTACT && pw_names_find (&r->contacts, owner) >= 0)
    return expression_fail (r, node, at, "%sthe name of the body of %s cannot be used in expressions", where, owner);
  if (found && c.type == PW_COLUMN_CONTACT)
    return expression_fail (r, node, at, "%sdescribe %s before the signals that read its place", where, owner);
  if (found && c.type != PW_COLUMN_STATE && output)
    return expression_fail (r, node, at,
                            "%sa signal cannot depend on reactions, energies and work, which follow from it", where);
  if (found || output == NULL) return signal_add_state (r, node, f, name, at);
  for (int i = 0; i < r->output_count; i++) /* it is an error of an output that contains the name */
    for (const char *text = r->output[i]->node.text, *rest = text, *p; (p = pw_expression_next_name (&rest, state));)
      if (strcmp (state, name) == 0) {
        r->label = PW_PRINTED (100, "output %s", r->output[i]->output.name);
        return output_unknown (r, &r->output[i]->node, name, (size_t)(p - text));
      }
  return expression_fail (r, node, at, "%sthere is no such column", where);
}

static int signal_expression (pw_reader *r, const pw_node *written, pw_signal_function *f, int i) {
  pw_node copy;
  const pw_node *node = &copy;
  char name[PW_EXPRESSION_NAME];
  if (pw_yaml_rename (r, written, &copy) != PW_OK) return r->error->status;
  const char *source = node->text;
  for (const char *rest = source, *p; (p = pw_expression_next_name (&rest, name)) != NULL;) {
    const int found = pw_names_find (&r->outputs, name);
    if (strcmp (name, f->name[0]) == 0) continue;
    if (r->kind->of_coordinate && strcmp (name, "t") == 0)
      return expression_fail (r, node, (size_t)(p - source), "the parameter of a curve is s, not t");
    const pw_output_function *output = found < 0 ? NULL : r->output[found];
    if (!output && pw_is_state_name (r, name) && !pw_scope_path (r->scope, name) &&
        signal_add_column (r, node, f, NULL, name, (size_t)(p - source)) != PW_OK)
      return r->error->status;
    for (int k = 1; output && k <= output->function.states; k++)
      if (signal_add_column (r, node, f, output, output->function.name[k], (size_t)(p - source)) != PW_OK)
        return r->error->status;
  }
  if (pw_yaml_expression (r, node, f->name, &f->text.part[i], &f->expression[i]) != PW_OK) return r->error->status;
  const pw_expression *expression = f->expression[i];
  f->jumps = f->jumps > expression->jumps ? f->jumps : expression->jumps;
  if (expression->jump == NULL || f->jump) return PW_OK;
  char *jump = pw_arena_alloc (r->arena, (size_t)expression->jump_size + 1);
  if (jump == NULL) return read_no_memory (r);
  f->jump = memcpy (jump, expression->jump, (size_t)expression->jump_size);
  if (expression->unlocated) f->text.jump = jump;
  return PW_OK;
}

/* Compares derivative i, 1 or 2, which is given, with that computed from the last one given before, at some times. */
static int signal_check_derivative (pw_reader *r, const pw_node *node, const pw_signal_function *f, int i,
                                    const char *name) {
  static const double time[] = { 0.3, 1.7, 4.1 }; /* [s], arbitrary */
  int last = f->expression[i - 1] ? i - 1 : 0, n = i - last;
  double given[3], exact[3][3], size = 0;
  for (int k = 0; k < 3; k++) {
    given[k] = pw_expression_value (f->expression[i], &time[k]);
    pw_expression_derivatives (f->expression[last], &time[k], PW_EXPRESSION_TIME, exact[k]);
    if (isfinite (given[k]) && isfinite (exact[k][n]))
      size = fmax (size, fabs (given[k]) + fabs (exact[k][n]) + 1e-6 * fabs (exact[k][0])); /* the last: round-off */
  }
  for (int k = 0; k < 3; k++)
    if (isfinite (given[k]) && isfinite (exact[k][n]) && fabs (given[k] - exact[k][n]) > 1e-6 * size)
      return read_fail (r, node->at, "%s: the %s at %s = %g%s is %.6g, but the derivative is %.6g", r->label, name,
                        f->name[0], time[k], r->kind->of_coordinate ? "" : " s", given[k], exact[k][n]);
  return PW_OK;
}

/* The derivatives at a time; states that the signal reads have irregular values. */
static void signal_derivatives_at (const pw_signal_function *f, double t, double u[3]) {
  double variable[PW_OUTPUT_READS + 1] = { t };
  for (int i = 1; i <= f->states; i++) variable[i] = 0.1 + fmod (0.618 * i, 1);
  signal_derivatives (f, variable, u);
}

/* The largest magnitude of derivative i at t +- 2^-1, 2^-2, ... 2^-20 s and t + 1 s. */
static double signal_magnitude (const pw_signal_function *f, double t, int i) {
  double size = 0;
  for (int k = -20; k <= 20; k++) {
    double u[3];
    signal_derivatives_at (f, t + (k < 0 ? -1 : 1) * ldexp (1, -abs (k)), u);
    if (isfinite (u[i])) size = fmax (size, fabs (u[i]));
  }
  return size;
}

/* Refuses signals that a constraint cannot follow: a jump of the value or, for positions, of its derivative, at one of
 * the first breakpoints after t = 0, of a curve after s = -1000, beyond round-off and the change between neighbours; a
 * jump as states change. */
static int signal_check_continuity (pw_reader *r, const pw_node *node, pw_signal_function *f) {
  const int is_curve = r->kind->of_coordinate;
  double t = is_curve ? -1000 : 0, before[3], after[3];
  if (f->states && f->jumps == PW_JUMPS)
    return read_fail (r, node->at, "%s: %.60s jumps as states change, and the signal of a velocity constraint must not",
                      r->label, f->jump);
  for (int k = 0; k < MAX_CHECKED_BREAKPOINTS; k++) {
    t = signal_breakpoint (f, t);
    if (t == INFINITY) return PW_OK;
    double last = nextafter (t, -INFINITY);
    signal_derivatives_at (f, last, before);
    signal_derivatives_at (f, t, after);
    for (int i = 0; i < f->derivatives; i++)
      if (fabs (after[i] - before[i]) >
          1e-9 * signal_magnitude (f, t, i) + 2 * (t - last) * (fabs (after[i + 1]) + fabs (before[i + 1])))
        return read_fail (r, node->at, "%s: its %s jumps from %.6g to %.6g at %s = %.9g%s, and that of %s must not",
                          r->label, i ? is_curve ? "derivative" : "rate" : "value", before[i], after[i], f->name[0], t,
                          is_curve ? "" : " s",
                          is_curve             ? "a curve"
                          : f->derivatives > 1 ? "a prescribed position"
                                               : "a velocity constraint");
  }
  return PW_OK;
}

/* The conditions of a function that has been read. */
static void signal_find_sides (pw_signal_function *f, pw_function *function) {
  double variable[PW_OUTPUT_READS + 1] = { 0 }, side[PW_EXPRESSION_CODES];
  if (f->states || f->is_output)
    f->conditions = pw_expression_sides (f->expression[0], f->is_output, variable, side, NULL, NULL);
  if (f->conditions) function->sides = signal_sides;
}

/* Makes a signal from expressions: value; rate and acceleration, or NULL. */
static int signal_of_time (pw_reader *r, const pw_node *const node[3], pw_signal *signal) {
  static const char *const key[] = { "expression", "rate", "acceleration" };
  pw_signal_function *f = pw_arena_alloc (r->arena, sizeof *f);
  if (f == NULL) return read_no_memory (r);
  f->name[0] = pw_signal_argument (r);
  if (r->kind->of_coordinate && pw_names_find (&r->scope->index, "s") >= 0)
    return read_fail (r, node[0]->at,
                      "%s: the model has a number \"s\", which is also the parameter of the curve: rename it",
                      r->label);
  f->derivatives = pw_kind_signals_force (signal_kind (r)) ? 0 : r->kind->level == PW_HOLONOMIC ? 2 : 1;
  *signal = (pw_signal){ PW_FUNCTION, .function = { .eval = signal_eval, .context = f, .text = &f->text } };
  signal->function.open = signal_open;
  signal->function.close = signal_close;
  for (int i = 0; i < 3; i++) {
    if (node[i] == NULL) continue;
    if (signal_expression (r, node[i], f, i) != PW_OK) return r->error->status;
    if (f->expression[i]->breaks) signal->function.breakpoint = signal_breakpoint;
    if (i == 0 && pw_expression_may_be_narrow (f->expression[0])) signal->function.range = signal_range;
    if (i > 0 && f->derivatives && f->states)
      return read_fail (r, node[i]->at, "%s: a %s belongs to an expression of the time alone", r->label, key[i]);
    if (i > 0 && !f->states && signal_check_derivative (r, node[i], f, i, key[i]) != PW_OK) return r->error->status;
  }
  if (f->states) signal->function.reads = f->name + 1;
  signal_find_sides (f, &signal->function);
  return f->derivatives ? signal_check_continuity (r, node[0], f) : PW_OK;
}

/* ---- Signals ----
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude: 3, omega: 2}}           and ramp, smooth-step, pulse: their fields are in signal.c
 *   {table: {points: [[0, 1], [2, 3]]}}            points
 *   {table: {file: M.csv, columns: [t, M]}}        points of a file, by default in columns 1 and 2
 *   {table: {file: M.csv, time: t, columns: [M]}}  the same
 *   "M0 * cos (omega * t)"                         an expression of the time t; in forces also of states: BODY.phi; of
 *                                                  a curve, of its parameter s
 *   {expression: .., rate: .., acceleration: ..}   the same; in constraints, its time derivatives may be given
 *   {mu: 0.8, load: ..}                            a limit: the product of a number and a signal */

/* Pairs of numbers: the points of a table or a path. */
typedef struct {
  double *x, *y;
  int count, skipped; /* pairs; rows of the file without both numbers */
} pairs;

static int pairs_list (pw_reader *r, const pw_node *list, const char *form, pairs *p) {
  if (pw_yaml_list (r, list, r->label) != PW_OK) return r->error->status;
  if (!PW_ARENA_ARRAYS (r->arena, PW_ARRAY (p->x, list->count), PW_ARRAY (p->y, list->count)))
    return read_no_memory (r);
  for (const pw_node *n = list->first; n; n = n->next, p->count++) {
    double pair[2] = { 0 };
    const char *label = PW_PRINTED (240, "%s: point %d", r->label, p->count + 1);
    if (pw_yaml_pair (r, n, label, form, pair) != PW_OK) return r->error->status;
    p->x[p->count] = pair[0], p->y[p->count] = pair[1];
  }
  return PW_OK;
}

/* Opens a file that the model names; NULL after an error. */
static FILE *pairs_open (pw_reader *r, const pw_node *node, const char **name) {
  char path[PW_PATH], from_model[PW_PATH];
  const char *reason;
  if (pw_yaml_text (r, node, r->label, name) != PW_OK) return NULL;
  errno = 0;
  FILE *f = pw_yaml_find (r->y, node->at, *name, path, from_model, &reason) ? pw_open_input (path, &reason) : NULL;
  if (f == NULL && pw_open_input_status () == PW_RESOURCE)
    pw_fail (r->error, PW_RESOURCE, "%s: cannot read %s: %s", r->y->path, *name, reason);
  else if (f == NULL)
    read_fail (r, node->at, "%s: cannot read \"%.60s\": %s", r->label, *name, reason);
  return f;
}

/* Pairs in two columns of a file, NULL: by default, converted to these units. */
static int pairs_file (pw_reader *r, const pw_node *node, const char *const column[2], const char *const unit[2],
                       pw_gaps gaps, pairs *p) {
  const char *name;
  pw_error cause = { 0 };
  int rows;
  FILE *f = pairs_open (r, node, &name);
  if (f == NULL) return r->error->status;
  double *x = pw_columns_from_stream (f, name, column, unit, 2, gaps, NULL, &rows, &cause);
  fclose (f);
  if (cause.status == PW_INPUT) return read_fail (r, node->at, "%s: %s", r->label, cause.text);
  if (x == NULL || pw_model_keep (r->model, x, free) != PW_OK) return read_no_memory (r);
  *p = (pairs){ x, x + rows, 0, 0 };
  for (int i = 0; i < rows; i++) {
    if (isnan (x[i]) || isnan (p->y[i])) continue;
    x[p->count] = x[i], p->y[p->count++] = p->y[i];
  }
  p->skipped = rows - p->count;
  return PW_OK;
}

/* Limits the pairs of all tables and paths together: many may read the same large file.  A point of a path, with its
 * cubics, needs the memory of `weight` points of a table. */
static int pairs_count (pw_reader *r, const pw_node *node, const pairs *p, int weight) {
  r->points += (double)weight * p->count;
  if (r->error->status != PW_OK || r->points <= PW_MAX_POINTS) return r->error->status;
  return read_fail (r, node->at, "%s: the tables up to here have more than %d points, the limit for a model%s",
                    r->label, PW_MAX_POINTS, weight > 1 ? "; one of a path counts as 8" : "");
}

/* The unit of the current field.  Only a drive has "m or rad"; the choice before this field decides. */
static const char *table_unit (const pw_reader *r) {
  const pw_field *choice = r->field;
  if (choice->unit == NULL || strcmp (choice->unit, "m or rad") != 0) return choice->unit;
  while (choice->type != PW_CHOICE) choice--;
  int chosen = *(const int *)(const void *)(r->definition + choice->offset);
  return strcmp (choice->choices[chosen], "angle") == 0 ? "rad" : "m";
}

/* The columns of times and values: `columns` has both or, if `time` is given, perhaps that of the values alone; NULL by
 * default. */
static int table_columns (pw_reader *r, const pw_node *columns, const pw_node *time, const char *column[2]) {
  const char *label = PW_PRINTED (240, "%s: columns", r->label);
  const int count = time && columns && columns->count != 2 ? 1 : 2;
  column[0] = column[1] = NULL;
  if (pw_yaml_list_of (r, columns, label, count, count == 1 ? "column, [value]" : "columns, [time, value]") != PW_OK)
    return r->error->status;
  const pw_node *first = columns ? columns->first : NULL;
  pw_yaml_text (r, time, PW_PRINTED (240, "%s: time", r->label), &column[0]);
  pw_yaml_text (r, count == 2 && first ? first->next : first, label, &column[1]);
  if (count == 1 || r->error->status != PW_OK) return r->error->status;
  if (time && first && first->type == PW_YAML_SCALAR && strcmp (first->text, column[0]) != 0)
    return read_fail (r, first->at, "%s: the first one is that of the times, but time is \"%.60s\"", label, column[0]);
  return pw_yaml_text (r, time ? NULL : first, label, &column[0]);
}

/* Besides the fields of the form. */
static const char *const table_keys[] = { "points", "file", "columns", "time", "time_scale", "time_offset" };
enum { TABLE_KEYS = sizeof table_keys / sizeof *table_keys };

/* Reads points or columns of a file; the times become time_offset + time_scale t, where whole numbers of ms since an
 * epoch stay exact. */
static int table_points (pw_reader *r, const pw_node *node, const pw_node *const v[TABLE_KEYS], pw_signal *s) {
  const pw_node *points = v[0], *file = v[1], *columns = v[2], *time = v[3]; /* as table_keys */
  double scale = 1, offset = 0;
  const char *column[2];
  pairs p = { .count = 0 };
  if ((points != NULL) == (file != NULL))
    return read_fail (r, node->at, "%s: %s", r->label,
                      points ? "a table has either points or a file" : "a table needs points or a file");
  if (points && columns) return read_fail (r, columns->at, "%s: columns belong to a file", r->label);
  if (points && time) return read_fail (r, time->at, "%s: a column of times belongs to a file", r->label);
  if (points)
    pairs_list (r, points, "numbers, [time, value]", &p);
  else if (table_columns (r, columns, time, column) == PW_OK)
    pairs_file (r, file, column, (const char *const[2]){ "s", table_unit (r) }, PW_GAPS_REFUSED, &p);
  pw_yaml_number (r, v[4], PW_PRINTED (240, "%s: time_scale", r->label), PW_POSITIVE, &scale);
  pw_yaml_number (r, v[5], PW_PRINTED (240, "%s: time_offset", r->label), PW_REAL, &offset);
  for (int i = 0; i < p.count && r->error->status == PW_OK; i++) p.x[i] = scale * (p.x[i] + offset / scale);
  s->table.t = p.x, s->table.value = p.y, s->table.count = p.count, s->table.skipped = p.skipped;
  return pairs_count (r, node, &p, 1);
}

/* Reads the fields of a form, except a table's points; value: of each, or NULL. */
static int signal_fields (pw_reader *r, const pw_signal_form *form, const pw_node *node, const pw_node *const *value,
                          pw_signal *signal) {
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    const char *label = PW_PRINTED (240, "%s: %s", r->label, f->name);
    if (value[i] == NULL && f->required) read_fail (r, node->at, "%s is missing", label);
    if (f->type == PW_NUMBER) pw_yaml_number (r, value[i], label, f->domain, at);
    if (f->type == PW_CHOICE) pw_yaml_choice (r, value[i], label, f->choices, at);
    /* 0 in the structure stands for a scale that is not given, which is 1 */
    if (value[i] && form->type == PW_TABLE && strcmp (f->name, "scale") == 0 && signal->table.scale == 0)
      read_fail (r, value[i]->at, "%s: 0 is not permitted", label);
  }
  return r->error->status;
}

/* Reads a signal of one form; a table has more keys than fields.  An error of the whole is reported at the faulty point
 * of a table, or at the signal. */
static int signal_form (pw_reader *r, const pw_signal_form *form, const pw_node *node, pw_signal *signal) {
  const char *key[PW_MAX_KEYS];
  const pw_node *v[PW_MAX_KEYS];
  char fault[300];
  int fields = 0, n, point, is_table = form->type == PW_TABLE;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[fields++] = f->name;
  for (n = fields; is_table && n < fields + TABLE_KEYS; n++) key[n] = table_keys[n - fields];
  key[n] = NULL;
  if (pw_yaml_keys (r, node, key, PW_PRINTED (100, "a %s", form->name), v) != PW_OK ||
      signal_fields (r, form, node, v, signal) != PW_OK ||
      (is_table && table_points (r, node, v + fields, signal) != PW_OK))
    return r->error->status;
  if (*pw_signal_check (signal, signal_kind (r), &point, fault, sizeof fault) == 0) return PW_OK;
  const pw_node *faulty = is_table && v[fields] && point >= 0 ? v[fields]->first : NULL;
  for (int i = 0; faulty && i < point; i++) faulty = faulty->next;
  return read_fail (r, (faulty ? faulty : node)->at, "%s: %s", r->label, fault);
}

/* Keys of a signal in braces, such as {harmonic: {...}}; those from SIGNAL_FORMS on are the names of the forms. */
enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

static int signal_map (pw_reader *r, const pw_node *node, pw_signal *signal) {
  const char *key[PW_MAX_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[PW_MAX_KEYS];
  char list[100] = "constant, expression";
  int n = SIGNAL_FORMS, given = 0, form = 0;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) {
    append (list, ", %s", f->name);
    key[n++] = f->name;
  }
  key[n] = NULL;
  if (pw_yaml_keys (r, node, key, "a signal", v) != PW_OK) return r->error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form = i;
  }
  if (given != 1)
    return read_fail (r, node->at, "%s: expected one of %s; found %s", r->label, list, given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return read_fail (r, node->at, "%s: a rate or acceleration belongs to an expression", r->label);
  if (v[SIGNAL_CONSTANT]) return pw_yaml_number (r, v[SIGNAL_CONSTANT], r->label, PW_REAL, &signal->constant);
  if (v[SIGNAL_EXPRESSION]) return signal_of_time (r, v + SIGNAL_EXPRESSION, signal);
  return signal_form (r, &pw_signal_forms[form - SIGNAL_FORMS], v[form], signal);
}

/* {mu: NUMBER, load: SIGNAL}, their product, of the field of a limit. */
static int signal_product (pw_reader *r, const pw_node *node, pw_signal *signal) {
  static const char *const key[] = { "mu", "load", NULL };
  const pw_node *v[2];
  double mu;
  if (pw_yaml_keys (r, node, key, "a limit", v) != PW_OK) return r->error->status;
  if (v[0] == NULL || v[1] == NULL)
    return read_fail (r, node->at, "%s: %s is missing: expected {mu: NUMBER, load: SIGNAL}", r->label,
                      key[v[0] != NULL]);
  if (pw_yaml_number (r, v[0], PW_PRINTED (240, "%s: mu", r->label), PW_NONNEGATIVE, &mu) != PW_OK)
    return r->error->status;
  pw_node load = *v[1];
  if (load.type == PW_YAML_SCALAR && pw_yaml_varies (r, load.text)) {
    const size_t size = strlen (load.text) + 40;
    char *text = pw_arena_alloc (r->arena, size);
    if (text == NULL) return read_no_memory (r);
    load.text = pw_print (text, size, "%.17g*(%s)", mu, load.text);
    return pw_yaml_signal (r, &load, signal);
  }
  if (pw_yaml_signal (r, &load, signal) != PW_OK) return r->error->status;
  if (signal->type == PW_FUNCTION)
    return read_fail (r, load.at, "%s: load: write the expression alone, load: \"...\"", r->label);
  double *const scaled[][2] = { [PW_CONSTANT] = { &signal->constant, NULL },
                                [PW_HARMONIC] = { &signal->harmonic.amplitude, &signal->harmonic.offset },
                                [PW_RAMP] = { &signal->ramp.from, &signal->ramp.to },
                                [PW_SMOOTH_STEP] = { &signal->ramp.from, &signal->ramp.to },
                                [PW_PULSE] = { &signal->pulse.height, &signal->pulse.offset },
                                [PW_TABLE] = { &signal->table.scale, &signal->table.offset } };
  if (signal->type == PW_TABLE && signal->table.scale == 0) signal->table.scale = 1; /* it is omitted */
  for (int i = 0; i < 2; i++)
    if (scaled[signal->type][i]) *scaled[signal->type][i] *= mu;
  return PW_OK;
}

int pw_yaml_signal (pw_reader *r, const pw_node *node, pw_signal *signal) {
  const char *first = node->type == PW_YAML_MAP && node->first ? node->first->text : "";
  if (r->field->limit && (strcmp (first, "mu") == 0 || strcmp (first, "load") == 0))
    return signal_product (r, node, signal);
  if (node->type == PW_YAML_MAP) return signal_map (r, node, signal);
  if (node->type == PW_YAML_SCALAR && pw_yaml_varies (r, node->text))
    return signal_of_time (r, (const pw_node *const[3]){ node, NULL, NULL }, signal);
  return pw_yaml_number (r, node, r->label, PW_REAL, &signal->constant);
}

/* ---- Paths ---- */

static void path_free (void *path) {
  pw_path_close (path);
}

static int path_points (pw_reader *r, const pw_node *node, const pw_node *points, const pw_node *file,
                        const pw_node *columns, pairs *p) {
  const char *column[2] = { NULL, NULL };
  if ((points != NULL) == (file != NULL))
    return read_fail (r, node->at, "%s: %s", r->label,
                      points ? "a path has either points or a file" : "a path needs points or a file");
  if (points && columns) return read_fail (r, columns->at, "%s: columns belong to a file", r->label);
  if (points && pairs_list (r, points, "numbers, [x, y]", p) != PW_OK) return r->error->status;
  if (pw_yaml_list_of (r, columns, r->label, 2, "columns, [x, y]") != PW_OK) return r->error->status;
  pw_yaml_text (r, columns ? columns->first : NULL, r->label, &column[0]);
  pw_yaml_text (r, columns ? columns->first->next : NULL, r->label, &column[1]);
  if (file && r->error->status == PW_OK)
    pairs_file (r, file, column, (const char *const[2]){ "m", "m" }, PW_GAPLESS, p);
  return pairs_count (r, node, p, 8);
}

/* Room for another path in the texts of the model, or NULL. */
static pw_path_text *path_add (pw_reader *r) {
  pw_reference_text *t = r->reference;
  if ((t->paths & (t->paths - 1)) == 0) { /* a power of two fills the array */
    pw_path_text *more = pw_arena_alloc (r->arena, 2 * ((size_t)t->paths + 1) * sizeof *more);
    if (more && t->paths) memcpy (more, t->path, (size_t)t->paths * sizeof *more);
    t->path = more;
  }
  return t->path ? &t->path[t->paths] : NULL;
}

int pw_yaml_name_path (const pw_reader *r, pw_scope *scope, const char *prefix, const char *name, pw_path *path) {
  const char *own = name + strlen (prefix);
  if (pw_scope_reserve (scope, scope->names + 2, r->arena) != PW_OK) return read_no_memory (r);
  pw_scope_add_path (scope, name, path);
  if (*prefix && pw_names_find (&scope->index, own) < 0) pw_scope_add_path (scope, own, path);
  return PW_OK;
}

int pw_yaml_path (pw_reader *r, const pw_node *node) {
  static const char *const key[] = { "name", "points", "file", "columns", "interpolation", "closed", NULL };
  static const char *const interpolation[] = { [PW_LINEAR] = "linear", [PW_CUBIC] = "cubic", NULL };
  static const char *const closed[] = { "false", "true", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  const char *own;
  pw_path_text *text = path_add (r);
  pairs p = { .count = 0 };
  pw_error cause = { 0 };
  if (pw_yaml_keys (r, node, key, "a path", v) != PW_OK) return r->error->status;
  if (v[0] == NULL) return read_fail (r, node->at, "a path needs a name");
  if (text == NULL) return read_no_memory (r);
  if (pw_build_name (r, v[0], "path", &text->name) != PW_OK || pw_yaml_name (r, v[0], "path", &own) != PW_OK)
    return r->error->status;
  if (pw_names_find (&r->scope->index, own) >= 0)
    return read_fail (r, v[0]->at, "path \"%s\": a parameter or number of let has this name", own);
  const char *label = r->label = PW_PRINTED (100, "path %s", text->name);
  path_points (r, node, v[1], v[2], v[3], &p);
  pw_yaml_choice (r, v[4], PW_PRINTED (140, "%s: interpolation", label), interpolation, &text->interpolation);
  pw_yaml_choice (r, v[5], PW_PRINTED (140, "%s: closed", label), closed, &text->closed);
  if (r->error->status != PW_OK) return r->error->status;
  text->x = p.x, text->y = p.y, text->count = p.count;
  pw_path *path = pw_path_open (p.x, p.y, p.count, text->interpolation, text->closed, &cause);
  if (cause.status == PW_INPUT) return read_fail (r, (v[1] ? v[1] : v[2])->at, "%s: %s", label, cause.text);
  if (path == NULL || pw_model_keep (r->model, path, path_free) != PW_OK) return read_no_memory (r);
  text->path = path;
  r->reference->paths++;
  return pw_yaml_name_path (r, r->scope, r->prefix, text->name, path);
}

/* ---- Outlines of bodies ---- */

enum { OUTLINE_MAX_BYTES = 16 << 20 };

/* Corners in a drawing. */
static int outline_svg (pw_reader *r, const pw_node *node, pairs *p) {
  const char *name, *why = "";
  char *text = NULL;
  size_t size;
  pw_error cause = { 0 };
  pw_corners points = { .count = 0 };
  FILE *f = pairs_open (r, node, &name);
  if (f == NULL) return r->error->status;
  int status = pw_read_rest (f, OUTLINE_MAX_BYTES, name, "the limit for a drawing", &text, &size, &cause);
  fclose (f);
  if (status == PW_OK) why = pw_svg_outline (text, &points, &status);
  PW_ARENA_ARRAYS (r->arena, PW_ARRAY (p->x, points.count), PW_ARRAY (p->y, points.count));
  for (size_t i = 0; p->x && i < points.count; i++) p->x[i] = points.point[i][0], p->y[i] = points.point[i][1];
  p->count = (int)points.count;
  free (points.point);
  free (text);
  if (status == PW_INPUT) return read_fail (r, node->at, "%s: %s", r->label, cause.text);
  if (*why) return read_fail (r, node->at, "%s: %.60s: %s", r->label, name, why);
  return status == PW_OK && p->x ? PW_OK : read_no_memory (r);
}

/* Scales the corners about the middle of their box, so that it has this width, and moves the middle to the origin; 0 if
 * the box has no width. */
static int outline_scale (pairs *p, double width) {
  double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
  for (int i = 0; i < p->count; i++) {
    low[0] = fmin (low[0], p->x[i]), high[0] = fmax (high[0], p->x[i]);
    low[1] = fmin (low[1], p->y[i]), high[1] = fmax (high[1], p->y[i]);
  }
  for (int i = 0; i < p->count && high[0] > low[0]; i++) {
    p->x[i] = (p->x[i] - (low[0] + high[0]) / 2) * width / (high[0] - low[0]);
    p->y[i] = (p->y[i] - (low[1] + high[1]) / 2) * width / (high[0] - low[0]);
  }
  return high[0] > low[0];
}

int pw_yaml_outline (pw_reader *r, const pw_node *node, pw_body *body) {
  static const char *const key[] = { "points", "file", "width", "at", NULL };
  const pw_node *v[4] = { NULL };
  double width = 0, at[2] = { 0 };
  pairs p = { .count = 0 };
  if (node == NULL) return PW_OK;
  r->label = PW_PRINTED (140, "outline of body %.60s", body->name);
  if (node->type != PW_YAML_MAP) v[node->type == PW_YAML_LIST ? 0 : 1] = node;
  if (node->type == PW_YAML_MAP && pw_yaml_keys (r, node, key, "an outline", v) != PW_OK) return r->error->status;
  if ((v[0] != NULL) == (v[1] != NULL))
    return read_fail (r, node->at, "%s: expected points or a file, .svg or .csv", r->label);
  const char *dot = v[1] && v[1]->type == PW_YAML_SCALAR ? strrchr (v[1]->text, '.') : NULL;
  pw_yaml_number (r, v[2], PW_PRINTED (240, "%s: width", r->label), PW_POSITIVE, &width);
  if (v[3]) pw_yaml_pair (r, v[3], PW_PRINTED (240, "%s: at", r->label), "numbers, [x, y]", at);
  if (r->error->status != PW_OK) return r->error->status;
  if (v[0])
    pairs_list (r, v[0], "numbers, [x, y]", &p);
  else if (dot && strcmp (dot, ".svg") == 0)
    outline_svg (r, v[1], &p);
  else
    pairs_file (r, v[1], (const char *const[2]){ NULL }, (const char *const[2]){ "m", "m" }, PW_GAPLESS, &p);
  if (pairs_count (r, node, &p, 1) != PW_OK) return r->error->status;
  if (p.count < 3) return read_fail (r, node->at, "%s: expected 3 corners at least, found %d", r->label, p.count);
  if (width > 0 && !outline_scale (&p, width))
    return read_fail (r, v[2]->at, "%s: a width is given, but all corners have the same x", r->label);
  double (*corner)[2] = pw_arena_alloc (r->arena, ((size_t)p.count + 1) * sizeof *corner);
  if (corner == NULL) return read_no_memory (r);
  for (int i = 0; i < p.count; i++) corner[i][0] = p.x[i] + at[0], corner[i][1] = p.y[i] + at[1];
  body->outline = (const double (*)[2])corner, body->corners = p.count;
  return PW_OK;
}

/* ---- Outputs ---- */

int pw_yaml_si_unit (const pw_reader *r, const pw_node *node, const char **unit) {
  const char *at;
  if (pw_yaml_text (r, node, "unit", unit) != PW_OK || node == NULL) return r->error->status;
  const pw_unit_name *other = pw_yaml_other_unit (*unit, &at);
  if (other == NULL) return PW_OK;
  return read_fail (r, node->at, "unit: \"%s\": states and outputs are in SI units and radians, as all columns",
                    other->name);
}

/* Reads an output but for the expression of its value. */
static int output_head (pw_reader *r, const pw_node *node) {
  static const char *const key[] = { "name", "value", "unit", "about", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  const char *own;
  if (pw_yaml_keys (r, node, key, "an output", v) != PW_OK) return r->error->status;
  if (v[0] == NULL) return read_fail (r, node->at, "an output needs a name");
  pw_output_function *o = pw_arena_alloc (r->arena, sizeof *o);
  if (o == NULL || pw_grow (&r->output, (size_t)r->output_count, &r->output_room, sizeof (void *)) != PW_OK)
    return read_no_memory (r);
  if (pw_build_name (r, v[0], "output", &o->output.name) != PW_OK || pw_yaml_name (r, v[0], "output", &own) != PW_OK)
    return r->error->status;
  if (pw_kind_find_column (NULL, own, &(pw_column){ 0 }))
    return read_fail (r, v[0]->at, "output \"%s\": this name is reserved: a column of tables", own);
  if (pw_names_find (&r->scope->index, own) >= 0)
    return read_fail (r, v[0]->at, "output \"%s\": a parameter, number of let or path has this name", own);
  if (v[1] == NULL) return read_fail (r, node->at, "output %s needs a value", own);
  if (v[1]->type != PW_YAML_SCALAR)
    return read_fail (r, v[1]->at, "output %s: expected an expression, found %s", own, pw_node_found (v[1]));
  if (r->output_count == PW_MOST_OUTPUTS)
    return read_fail (r, node->at, "a model has at most %d outputs", PW_MOST_OUTPUTS);
  o->node = *v[1];
  if ((o->node.text = pw_yaml_renamed (r, r->copies, "", v[1]->text)) == NULL) return read_no_memory (r);
  o->reader = PW_OUTPUT_UNREAD;
  o->function.name[0] = "t";
  o->output.value =
      (pw_function){ signal_eval, o, NULL, NULL, signal_open, signal_close, &o->function.text, NULL, NULL };
  pw_names_add (&r->outputs, o->output.name, r->output_count);
  r->output[r->output_count++] = o;
  if (pw_yaml_si_unit (r, v[2], &o->output.unit) != PW_OK) return r->error->status;
  return pw_yaml_text (r, v[3], "about", &o->output.about);
}

static int output_add_column (pw_reader *r, pw_output_function *o, const char *name, size_t at) {
  pw_signal_function *f = &o->function;
  for (int i = 1; i <= f->states; i++)
    if (strcmp (f->name[i], name) == 0) return PW_OK;
  if (f->states == PW_OUTPUT_READS) return expression_fail (r, &o->node, at, "more than %d columns", PW_OUTPUT_READS);
  f->name[f->states + 1] = pw_arena_copy (r->arena, name);
  return f->name[++f->states] ? PW_OK : read_no_memory (r);
}

/* Reports that output `last` reads output `first`, of which it is a function. */
static int output_cycle (const pw_reader *r, int last, int first, size_t at) {
  char list[300] = "";
  for (int i = last; i != first; i = r->output[i]->reader)
    append (list, "%s%s", *list ? ", " : ", through ", r->output[i]->output.name);
  return read_fail (r, pw_source_offset (r->y, &r->output[last]->node, at), "output %s is a function of itself%s",
                    r->output[first]->output.name, list);
}

/* Reads the expression of an output, after those of outputs in it. */
static int output_expression (pw_reader *r, int index, int reads) {
  pw_output_function *o = r->output[index];
  char name[PW_EXPRESSION_NAME];
  pw_column c;
  o->reader = reads;
  if ((o->node.text = pw_yaml_renamed (r, NULL, r->prefix, o->node.text)) == NULL) return read_no_memory (r);
  for (const char *source = o->node.text, *rest = source, *p; (p = pw_expression_next_name (&rest, name)) != NULL;) {
    const size_t at = (size_t)(p - source);
    int other = pw_names_find (&r->outputs, name), status = PW_OK;
    if (other >= 0 && r->output[other]->reader >= 0) return output_cycle (r, index, other, at);
    if (other >= 0 && r->output[other]->reader == PW_OUTPUT_UNREAD) status = output_expression (r, other, index);
    r->label = PW_PRINTED (100, "output %s", o->output.name);
    for (int i = 1; status == PW_OK && other >= 0 && i <= r->output[other]->function.states; i++)
      status = output_add_column (r, o, r->output[other]->function.name[i], at);
    if (status == PW_OK && other < 0 && strcmp (name, "t") != 0 &&
        (pw_is_state_name (r, name) || pw_kind_find_column (NULL, name, &c)) && !pw_scope_path (r->scope, name))
      status = output_add_column (r, o, name, at);
    if (status != PW_OK) return status;
  }
  o->reader = PW_OUTPUT_READ;
  r->label = PW_PRINTED (100, "output %s", o->output.name);
  pw_signal_function *f = &o->function;
  if (pw_yaml_expression (r, &o->node, f->name, &f->text.part[0], &f->expression[0]) != PW_OK) return r->error->status;
  f->is_output = 1;
  signal_find_sides (f, &o->output.value);
  return PW_OK;
}

int pw_yaml_outputs (pw_reader *r) {
  const int first = r->output_count;
  r->scope->expand = expand_name, r->scope->context = r;
  pw_yaml_entries (r, r->y->outputs, output_head);
  for (int i = first; i < r->output_count && r->error->status == PW_OK; i++)
    if (r->output[i]->reader == PW_OUTPUT_UNREAD) output_expression (r, i, i);
  return r->error->status;
}

int pw_add_outputs (pw_reader *r) {
  char name[PW_EXPRESSION_NAME];
  pw_column c;
  pw_error cause = { 0 };
  for (int i = 0; i < r->output_count; i++) {
    pw_output_function *o = r->output[i];
    r->label = PW_PRINTED (100, "output %s", o->output.name);
    for (const char *source = o->node.text, *rest = source, *p; (p = pw_expression_next_name (&rest, name)) != NULL;) {
      const size_t at = (size_t)(p - source);
      const int found = find_column (r, name, &c);
      if (pw_is_state_name (r, name) && !found) return output_unknown (r, &o->node, name, at);
      if (found && (c.type == PW_COLUMN_PROJECTION || c.type == PW_COLUMN_BALANCE))
        return expression_fail (r, &o->node, at, "%s describes the integration, not the motion", name);
    }
    o->output.value.reads = o->function.name + 1;
    if (pw_model_check_output (r->model, &o->output, &cause) != PW_OK) return pw_build_fail (r, &o->node, &cause);
    if (pw_add_output (r->model, &o->output) != PW_OK) return r->error->status;
  }
  return r->error->status;
}
