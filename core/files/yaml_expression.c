/* Expressions of time, and of states, in text models: signals, and the reference solution.  A signal becomes a function
 * signal, of which each compiled system has a copy (signal_open), since it may outlive the model. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

enum { MAX_SIGNAL_STATES = 16, MAX_CHECKED_BREAKPOINTS = 100 };

/* A signal defined by expressions. */
typedef struct {
  const pw_expression *expression[3];      /* value, rate, acceleration; NULL: not given, differentiated instead */
  int derivatives;                         /* required time derivatives; of a force: 0, nonholonomic: 1, holonomic: 2 */
  int states;                              /* number of states in it */
  const char *name[MAX_SIGNAL_STATES + 2]; /* "t", then states, "BODY.phi"; not for evaluation */
  pw_signal_text text;
} signal_function;

typedef struct {
  pw_reader *r;
  const pw_node *node;
  const char *label;  /* "torque T: value", for messages */
  signal_function *f; /* the signal it belongs to, or NULL */
} reading;

/* Reports an error at an offset of the expression. */
#define reading_fail(e, at, ...) \
  pw_yaml_fail ((e)->r, pw_yaml_offset ((e)->r->y, (e)->node, at), "%s: %s", (e)->label, PW_PRINTED (300, __VA_ARGS__))

/* Reads the expression; `variable`: names, which end with NULL. */
static int reading_expression (const reading *e, const char *const *variable, const char **text,
                               const pw_expression **expression) {
  pw_expression_error error;
  if (pw_yaml_text (e->r, e->node, e->label, text) != PW_OK) return e->r->error->status;
  int status = pw_expression_read (e->r->scope, variable, *text, e->r->arena, expression, &error);
  if (status == PW_INPUT) return reading_fail (e, error.at, "%s", error.text);
  if (status != PW_OK) return pw_yaml_no_memory (e->r);
  if ((e->r->operations += (*expression)->codes) <= PW_YAML_MAX_OPERATIONS) return PW_OK;
  return pw_yaml_fail (e->r, e->node->at,
                       "%s: the expressions up to here have more than %d operations, the limit for a model", e->label,
                       PW_YAML_MAX_OPERATIONS);
}

/* ---- States: BODY.phi, ELEMENT.spin ---- */

/* Indexes all elements, including those not built yet, whose errors are reported later. */
static int state_elements (pw_reader *r) {
  const pw_node *list = r->y->elements;
  if (r->elements.slot) return PW_OK;
  if (pw_names_open (&r->elements, list ? (size_t)list->count : 0) != PW_OK) return pw_yaml_no_memory (r);
  for (const pw_node *n = list ? list->first : NULL; n; n = n->next) {
    const pw_node *key = n->type == PW_YAML_MAP ? n->first : NULL;
    if (key == NULL || key->type != PW_YAML_SCALAR || key->next->type != PW_YAML_SCALAR) continue;
    for (int i = 0; pw_kinds[i]; i++)
      if (strcmp (pw_kinds[i]->name, key->text) == 0) pw_names_add (&r->elements, key->next->text, i);
  }
  return PW_OK;
}

static int state_unknown_owner (const reading *e, const char *owner, size_t at) {
  pw_nearest near = { .sought = owner };
  pw_yaml_suggest_bodies (e->r, &near);
  for (size_t i = 0; i < e->r->elements.size; i++) {
    const struct pw_name *element = &e->r->elements.slot[i];
    if (element->name && pw_kinds[element->value]->internal > 0) pw_nearest_try (&near, element->name);
  }
  return reading_fail (e, at, "there is no body \"%s\"%s", owner, pw_nearest_text (&near));
}

static int state_of_element (const reading *e, const char *owner, const char *part, size_t at) {
  char list[200] = "";
  if (state_elements (e->r) != PW_OK) return e->r->error->status;
  int found = pw_names_find (&e->r->elements, owner);
  if (found < 0) return state_unknown_owner (e, owner, at);
  const pw_kind *kind = pw_kinds[found];
  if (kind->internal == 0) return reading_fail (e, at, "%s %s has no states", kind->name, owner);
  for (int i = 0; i < kind->internal; i++) {
    const pw_quantity *state = &kind->coordinate[i];
    if (strcmp (part, state->name) == 0 || strcmp (part, state->rate) == 0) return PW_OK;
    size_t n = strlen (list);
    snprintf (list + n, sizeof list - n, "%s%s, %s", i ? ", " : "", state->name, state->rate);
  }
  return reading_fail (e, at + strlen (owner) + 1, "the states of %s %s are %s, not \"%.30s\"", kind->name, owner, list,
                       part);
}

/* Checks that a name with a dot, at an offset of the expression, names a state. */
static int state_check (const reading *e, const char *name, size_t at) {
  static const char *const part[] = { "x", "y", "phi", "vx", "vy", "omega" };
  size_t n = strcspn (name, ".");
  const char *owner = PW_PRINTED (100, "%.*s", (int)n, name);
  if (pw_names_find (&e->r->bodies, owner) < 0) return state_of_element (e, owner, name + n + 1, at);
  for (int i = 0; i < 6; i++)
    if (strcmp (part[i], name + n + 1) == 0) return PW_OK;
  return reading_fail (e, at + n + 1, "a body's states are x, y, phi, vx, vy and omega, not \"%.30s\"", name + n + 1);
}

/* ---- Evaluation of signals ---- */

/* Value and derivatives u; what is not given is computed from the last one given before; u[2] is 0 unless required. */
static void signal_derivatives (const signal_function *f, const double *variable, double u[3]) {
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
  const signal_function *f = context;
  double variable[MAX_SIGNAL_STATES + 1] = { t }, derivatives[3];
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
  return isfinite (value[0]) && (f->derivatives == 0 || (isfinite (value[1]) && isfinite (value[2]))) ? 0 : -1;
}

static double signal_breakpoint (void *context, double t) {
  const signal_function *f = context;
  double first = INFINITY;
  for (int i = 0; i < 3; i++)
    if (f->expression[i]) first = fmin (first, pw_expression_breakpoint (f->expression[i], t));
  return first;
}

/* pw_function.enclose; derivatives that are not given are computed from the last one that is. */
static void signal_enclose (void *context, const pw_interval *value, const pw_interval *rate, pw_interval bound[2]) {
  const signal_function *f = context;
  int last = f->derivatives;
  pw_interval u[4] = { [3] = { -INFINITY, INFINITY } };
  while (last > 0 && f->expression[last] == NULL) last--;
  pw_expression_enclose (f->expression[last], value, rate, f->derivatives > last ? 2 : 1, u);
  memcpy (bound, u + f->derivatives - last, 2 * sizeof *bound);
}

static void *signal_open (void *context) {
  const signal_function *f = context;
  size_t size = sizeof *f;
  for (int i = 0; i < 3; i++) size += f->expression[i] ? pw_expression_size (f->expression[i]) : 0;
  signal_function *copy = malloc (size);
  if (copy == NULL) return NULL;
  *copy = *f;
  char *at = (char *)(copy + 1);
  for (int i = 0; i < 3; i++) {
    if (f->expression[i] == NULL) continue;
    size = pw_expression_size (f->expression[i]);
    copy->expression[i] = memcpy (at, f->expression[i], size);
    at += size;
  }
  return copy;
}

/* ---- Reading of signals ---- */

/* Adds a state, unless it is known already. */
static int signal_add_state (const reading *e, const char *name, size_t at) {
  signal_function *f = e->f;
  for (int i = 1; i <= f->states; i++)
    if (strcmp (f->name[i], name) == 0) return PW_OK;
  if (f->derivatives)
    return reading_fail (e, at, "\"%s\": the signal of a constraint depends on the time t alone", name);
  if (state_check (e, name, at) != PW_OK) return e->r->error->status;
  if (f->states == MAX_SIGNAL_STATES) return reading_fail (e, at, "more than %d states", MAX_SIGNAL_STATES);
  f->name[f->states + 1] = pw_arena_copy (e->r->arena, name);
  return f->name[++f->states] ? PW_OK : pw_yaml_no_memory (e->r);
}

static int signal_read_expression (reading *e, int i) {
  pw_reader *r = e->r;
  signal_function *f = e->f;
  const char *source = e->node->type == PW_YAML_SCALAR ? e->node->text : "";
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = source, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (strchr (name, '.') && signal_add_state (e, name, (size_t)(p - source)) != PW_OK) return r->error->status;
  if (reading_expression (e, f->name, &f->text.part[i], &f->expression[i]) != PW_OK) return r->error->status;
  const pw_expression *expression = f->expression[i];
  if (expression->jump == NULL || f->text.jump) return PW_OK;
  char *jump = pw_arena_alloc (r->arena, (size_t)expression->jump_size + 1);
  f->text.jump = jump ? memcpy (jump, expression->jump, (size_t)expression->jump_size) : NULL;
  return jump ? PW_OK : pw_yaml_no_memory (r);
}

/* Compares derivative i, 1 or 2, which is given, with that computed from the last one given before, at some times. */
static int signal_check_derivative (const reading *e, int i, const char *name) {
  static const double time[] = { 0.3, 1.7, 4.1 }; /* [s], arbitrary */
  int last = e->f->expression[i - 1] ? i - 1 : 0, n = i - last;
  double given[3], exact[3][3], size = 0;
  for (int k = 0; k < 3; k++) {
    given[k] = pw_expression_value (e->f->expression[i], &time[k]);
    pw_expression_derivatives (e->f->expression[last], &time[k], PW_EXPRESSION_TIME, exact[k]);
    if (isfinite (given[k]) && isfinite (exact[k][n]))
      size = fmax (size, fabs (given[k]) + fabs (exact[k][n]) + 1e-6 * fabs (exact[k][0])); /* the last: round-off */
  }
  for (int k = 0; k < 3; k++)
    if (isfinite (given[k]) && isfinite (exact[k][n]) && fabs (given[k] - exact[k][n]) > 1e-6 * size)
      return pw_yaml_fail (e->r, e->node->at, "%s: the %s at t = %g s is %.6g, but the derivative is %.6g", e->label,
                           name, time[k], given[k], exact[k][n]);
  return PW_OK;
}

/* The largest magnitude of derivative i at t +- 2^-1, 2^-2, ... 2^-20 s and t + 1 s. */
static double signal_magnitude (const signal_function *f, double t, int i) {
  double size = 0;
  for (int k = -20; k <= 20; k++) {
    double at = t + (k < 0 ? -1 : 1) * ldexp (1, -abs (k)), u[3];
    signal_derivatives (f, &at, u);
    if (isfinite (u[i])) size = fmax (size, fabs (u[i]));
  }
  return size;
}

/* Refuses signals that a constraint cannot follow: a jump of the value or, for positions, of its derivative, at one of
 * the first breakpoints after t = 0, beyond round-off and the change between adjacent times. */
static int signal_check_continuity (const reading *e) {
  static const char *const name[] = { "its value", "its rate" };
  double t = 0, before[3], after[3];
  for (int k = 0; k < MAX_CHECKED_BREAKPOINTS; k++) {
    t = signal_breakpoint (e->f, t);
    if (t == INFINITY) return PW_OK;
    signal_derivatives (e->f, &(double){ nextafter (t, -INFINITY) }, before);
    signal_derivatives (e->f, &t, after);
    double between = t - nextafter (t, -INFINITY);
    for (int i = 0; i < e->f->derivatives; i++)
      if (fabs (after[i] - before[i]) >
          1e-9 * signal_magnitude (e->f, t, i) + 2 * between * (fabs (after[i + 1]) + fabs (before[i + 1])))
        return pw_yaml_fail (e->r, e->node->at, "%s: %s jumps from %.6g to %.6g at t = %.9g s, and that of %s must not",
                             e->label, name[i], before[i], after[i], t,
                             e->f->derivatives > 1 ? "a prescribed position" : "a velocity constraint");
  }
  return PW_OK;
}

static int signal_read_all (reading *e, const pw_node *const node[3]) {
  static const char *const key[] = { "expression", "rate", "acceleration" };
  for (int i = 0; i < 3; i++) {
    if ((e->node = node[i]) == NULL) continue;
    if (signal_read_expression (e, i) != PW_OK) return e->r->error->status;
    if (i > 0 && !e->f->states && signal_check_derivative (e, i, key[i]) != PW_OK) return e->r->error->status;
  }
  e->node = node[0];
  return e->f->derivatives ? signal_check_continuity (e) : PW_OK;
}

int pw_yaml_time_signal (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *const v[3],
                         pw_signal *signal) {
  signal_function *f = pw_arena_alloc (r->arena, sizeof *f);
  if (f == NULL) return pw_yaml_no_memory (r);
  f->name[0] = "t";
  f->derivatives = pw_kind_signals_force (kind) ? 0 : kind->level == PW_HOLONOMIC ? 2 : 1;
  *signal = (pw_signal){ PW_FUNCTION, .function = { .eval = signal_eval, .context = f, .text = &f->text } };
  signal->function.enclose = signal_enclose;
  signal->function.open = signal_open;
  signal->function.close = free;
  if (signal_read_all (&(reading){ .r = r, .label = label, .f = f }, v) != PW_OK) return r->error->status;
  for (int i = 0; i < 3; i++)
    if (f->expression[i] && f->expression[i]->breaks) signal->function.breakpoint = signal_breakpoint;
  if (f->states) signal->function.reads = f->name + 1;
  return PW_OK;
}

/* ---- Reference solution: `truth`, a map of states to expressions of time ---- */

static double reference_eval (void *context, int i, double t) {
  const pw_expression *const *x = context;
  return pw_expression_value (x[i], &t);
}

static int reference_entry (pw_reader *r, const pw_node *n, pw_names *seen) {
  static const char *const time[] = { "t", NULL };
  pw_reference_text *t = r->reference;
  const pw_expression **x = t->context;
  const char *name;
  if (pw_yaml_text (r, n, "truth", &name) != PW_OK) return r->error->status;
  if (strchr (name, '.') == NULL)
    return pw_yaml_fail (r, n->at, "truth: expected a state such as BODY.phi, found \"%.60s\"", name);
  if (state_check (&(reading){ .r = r, .node = n, .label = "truth" }, n->text, 0) != PW_OK) return r->error->status;
  if (pw_names_add (seen, n->text, 0) >= 0) return pw_yaml_fail (r, n->at, "truth: a second \"%s\"", n->text);
  const reading value = { .r = r, .node = n->next, .label = PW_PRINTED (100, "truth of %.60s", n->text) };
  t->state[t->states] = n->text;
  int status = reading_expression (&value, time, &t->text[t->states], &x[t->states]);
  t->states += status == PW_OK;
  return status;
}

int pw_yaml_reference (pw_reader *r) {
  const pw_node *map = r->y->reference;
  pw_reference_text *t = r->reference;
  pw_names seen = { .size = 0 };
  if (map || r->operations > 0) /* expressions may use names, whose values `show` writes */
    t->names = r->scope->names, t->name = r->scope->name, t->value = r->scope->value;
  if (map == NULL) return r->error->status;
  if (map->type != PW_YAML_MAP)
    return pw_yaml_fail (r, map->at, "truth: expected a map {STATE: EXPRESSION, ...}, found %s", pw_yaml_found (map));
  t->state = pw_arena_alloc (r->arena, ((size_t)map->count + 1) * sizeof *t->state);
  t->text = pw_arena_alloc (r->arena, ((size_t)map->count + 1) * sizeof *t->text);
  t->context = pw_arena_alloc (r->arena, ((size_t)map->count + 1) * sizeof (pw_expression *));
  t->eval = reference_eval;
  if (t->state == NULL || t->text == NULL || t->context == NULL || pw_names_open (&seen, (size_t)map->count) != PW_OK)
    return pw_yaml_no_memory (r);
  for (const pw_node *n = map->first; n && r->error->status == PW_OK; n = n->next->next) reference_entry (r, n, &seen);
  pw_names_close (&seen);
  return r->error->status;
}

/* Signals in text models.
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude: 3, omega: 2}}           and ramp, smooth-step, pulse: their fields are in signal.c
 *   {table: {points: [[0, 1], [2, 3]]}}            points
 *   {table: {file: M.csv, columns: [t, M]}}        points of a file, by default in columns 1 and 2
 *   {table: {file: M.csv, time: t, columns: [M]}}  the same
 *   "M0 * cos (omega * t)"                         an expression of the time t; in forces also of states: BODY.phi
 *   {expression: .., rate: .., acceleration: ..}   the same; in constraints, its time derivatives may be given
 */

/* ---- Points of tables, in the model ---- */

static int table_list (pw_reader *r, const char *label, const pw_node *list, double **times, pw_signal *s) {
  if (pw_yaml_list (r, list, label) != PW_OK) return r->error->status;
  size_t bytes = (size_t)list->count * sizeof (double);
  double *t = pw_arena_alloc (r->arena, bytes), *value = pw_arena_alloc (r->arena, bytes);
  if (t == NULL || value == NULL) return pw_yaml_no_memory (r);
  s->table.t = *times = t;
  s->table.value = value;
  for (const pw_node *n = list->first; n; n = n->next) {
    double point[2] = { 0 };
    const char *text = PW_PRINTED (240, "%s: point %d", label, s->table.count + 1);
    if (pw_yaml_pair (r, n, text, "numbers, [time, value]", point) != PW_OK) return r->error->status;
    t[s->table.count] = point[0];
    value[s->table.count++] = point[1];
  }
  return PW_OK;
}

/* ---- Points of tables: two columns of a file in the model's folder ---- */

static int table_has_parent (const char *name) {
  for (const char *part = name; part; part = strchr (part, '/'), part = part ? part + 1 : NULL)
    if (strncmp (part, "..", 2) == 0 && (part[2] == '/' || part[2] == 0)) return 1;
  return 0;
}

/* A model may only read files in its folder. */
static FILE *table_open (const pw_yaml *y, const char *name, const char **reason) {
  char joined[PW_PATH], path[PW_PATH];
  size_t n = strlen (y->folder); /* 0 for the root */
  *reason = "a table must be in the model's folder: its path is relative and has no \"..\"";
  if (*name == '/' || table_has_parent (name)) return NULL;
  if (realpath (pw_path (joined, "%s/%s", y->folder, name), path) == NULL) return *reason = strerror (errno), NULL;
  *reason = "it is a link that leads out of the model's folder";
  int is_inside = strncmp (path, y->folder, n) == 0 && (path[n] == '/' || path[n] == 0);
  return is_inside ? pw_open_input (path, reason) : NULL;
}

/* The unit of the current field.  Only a drive has "m or rad"; the choice before this field decides. */
static const char *table_unit (const pw_reader *r) {
  if (r->field->unit == NULL || strcmp (r->field->unit, "m or rad") != 0) return r->field->unit;
  const pw_field *choice = r->field;
  while (choice->type != PW_CHOICE) choice--;
  int chosen = *(const int *)(const void *)(r->definition + choice->offset);
  return strcmp (choice->choices[chosen], "angle") == 0 ? "rad" : "m";
}

/* The columns of times and values: `columns` has both or, if `time` is given, perhaps that of the values alone; NULL by
 * default. */
static int table_columns (pw_reader *r, const char *label, const pw_node *columns, const pw_node *time,
                          const char *column[2]) {
  const char *text = PW_PRINTED (240, "%s: columns", label);
  const int count = time && columns && columns->count != 2 ? 1 : 2;
  column[0] = column[1] = NULL;
  if (pw_yaml_list_of (r, columns, text, count, count == 1 ? "column, [value]" : "columns, [time, value]") != PW_OK)
    return r->error->status;
  const pw_node *first = columns ? columns->first : NULL;
  pw_yaml_text (r, time, PW_PRINTED (240, "%s: time", label), &column[0]);
  pw_yaml_text (r, count == 2 && first ? first->next : first, text, &column[1]);
  if (count == 1 || r->error->status != PW_OK) return r->error->status;
  if (time && first && first->type == PW_YAML_SCALAR && strcmp (first->text, column[0]) != 0)
    return pw_yaml_fail (r, first->at, "%s: the first one is that of the times, but time is \"%.60s\"", text,
                         column[0]);
  return pw_yaml_text (r, time ? NULL : first, text, &column[0]);
}

/* Leaves out rows without a time or value. */
static void table_skip_gaps (pw_points *table, double *t, double *value) {
  const int rows = table->count;
  table->count = 0;
  for (int i = 0; i < rows; i++) {
    if (isnan (t[i]) || isnan (value[i])) continue;
    t[table->count] = t[i];
    value[table->count++] = value[i];
  }
  table->skipped = rows - table->count;
}

static int table_file (pw_reader *r, const char *label, const pw_node *node, const pw_node *columns,
                       const pw_node *time, double **times, pw_signal *s) {
  const char *name, *reason, *column[2], *const unit[2] = { "s", table_unit (r) };
  pw_error cause = { 0 };
  if (table_columns (r, label, columns, time, column) != PW_OK) return r->error->status;
  if (pw_yaml_text (r, node, label, &name) != PW_OK) return r->error->status;
  errno = 0;
  FILE *f = table_open (r->y, name, &reason);
  if (f == NULL && pw_open_input_status () == PW_RESOURCE)
    return pw_fail (r->error, PW_RESOURCE, "%s: cannot read %s: %s", r->y->path, name, reason);
  if (f == NULL) return pw_yaml_fail (r, node->at, "%s: cannot read \"%.60s\": %s", label, name, reason);
  double *t = pw_columns_from_stream (f, name, column, unit, 2, PW_GAPS_REFUSED, &s->table.count, &cause);
  fclose (f);
  if (cause.status == PW_INPUT) return pw_yaml_fail (r, node->at, "%s: %s", label, cause.text);
  if (t == NULL || pw_model_keep (r->model, t, free) != PW_OK) return pw_yaml_no_memory (r);
  s->table.t = *times = t;
  s->table.value = t + s->table.count;
  table_skip_gaps (&s->table, t, t + s->table.count);
  return PW_OK;
}

/* Besides the fields of the form. */
static const char *const table_keys[] = { "points", "file", "columns", "time", "time_scale", "time_offset" };
enum { TABLE_KEYS = sizeof table_keys / sizeof *table_keys };

/* Converts the times to time_offset + time_scale t; whole numbers of ms since an epoch stay exact. */
static int table_times (pw_reader *r, const char *label, const pw_node *const v[2], int count, double *t) {
  double scale = 1, offset = 0;
  pw_yaml_number (r, v[0], PW_PRINTED (240, "%s: time_scale", label), PW_POSITIVE, &scale);
  pw_yaml_number (r, v[1], PW_PRINTED (240, "%s: time_offset", label), PW_REAL, &offset);
  for (int i = 0; i < count; i++) t[i] = scale * (t[i] + offset / scale);
  return r->error->status;
}

/* Reads points or columns of a file.  Limits the points of all tables together: many may read the same large file. */
static int table_points (pw_reader *r, const char *label, const pw_node *node, const pw_node *const v[TABLE_KEYS],
                         pw_signal *s) {
  const pw_node *points = v[0], *file = v[1], *columns = v[2], *time = v[3]; /* as table_keys */
  if ((points != NULL) == (file != NULL))
    return pw_yaml_fail (r, node->at, "%s: a table has either points or a file", label);
  if (points && columns) return pw_yaml_fail (r, columns->at, "%s: columns belong to a file", label);
  if (points && time) return pw_yaml_fail (r, time->at, "%s: a column of times belongs to a file", label);
  double *t = NULL;
  int status = points ? table_list (r, label, points, &t, s) : table_file (r, label, file, columns, time, &t, s);
  if (status == PW_OK) status = table_times (r, label, v + 4, s->table.count, t);
  if (status == PW_OK) r->points += s->table.count;
  if (status != PW_OK || r->points <= PW_YAML_MAX_POINTS) return status;
  return pw_yaml_fail (r, node->at, "%s: the tables up to here have more than %d points, the limit for a model", label,
                       PW_YAML_MAX_POINTS);
}

/* ---- Forms made of numbers ---- */

/* Reads the fields of a form, except a table's points; value: of each, or NULL. */
static int signal_fields (pw_reader *r, const pw_signal_form *form, const char *label, const pw_node *node,
                          const pw_node *const *value, pw_signal *signal) {
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    const char *text = PW_PRINTED (240, "%s: %s", label, f->name);
    if (value[i] == NULL && f->required) pw_yaml_fail (r, node->at, "%s is missing", text);
    if (f->type == PW_NUMBER) pw_yaml_number (r, value[i], text, f->domain, at);
    if (f->type == PW_CHOICE) pw_yaml_choice (r, value[i], text, f->choices, at);
    /* 0 in the structure stands for a scale that is not given, which is 1 */
    if (value[i] && form->type == PW_TABLE && strcmp (f->name, "scale") == 0 && signal->table.scale == 0)
      pw_yaml_fail (r, value[i]->at, "%s: 0 is not permitted", text);
  }
  return r->error->status;
}

/* Checks the signal as a whole; reports an error at the faulty point of a table, or at the signal. */
static int signal_check (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node,
                         const pw_node *points, const pw_signal *signal) {
  char fault[300];
  int point, i = 0;
  if (*pw_signal_check (signal, kind, &point, fault, sizeof fault) == 0) return PW_OK;
  for (const pw_node *n = points ? points->first : NULL; n; n = n->next, i++)
    if (i == point) node = n;
  return pw_yaml_fail (r, node->at, "%s: %s", label, fault);
}

/* Reads a signal of one form; a table has more keys than fields. */
static int signal_read_form (pw_reader *r, const pw_kind *kind, const pw_signal_form *form, const char *label,
                             const pw_node *node, pw_signal *signal) {
  const char *key[PW_YAML_MAX_KEYS];
  const pw_node *v[PW_YAML_MAX_KEYS];
  int fields = 0, n, is_table = form->type == PW_TABLE;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[fields++] = f->name;
  for (n = fields; is_table && n < fields + TABLE_KEYS; n++) key[n] = table_keys[n - fields];
  key[n] = NULL;
  if (pw_yaml_keys (r, node, key, PW_PRINTED (100, "a %s", form->name), v) != PW_OK ||
      signal_fields (r, form, label, node, v, signal) != PW_OK ||
      (is_table && table_points (r, label, node, v + fields, signal) != PW_OK))
    return r->error->status;
  return signal_check (r, kind, label, node, is_table ? v[fields] : NULL, signal);
}

/* Keys of a signal; those from SIGNAL_FORMS on are the names of the forms. */
enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

/* The keys of which a signal has one, for messages: "constant, expression, harmonic, ..." */
static char *signal_list (const char *const *key, char *buffer, size_t size) {
  size_t n = (size_t)snprintf (buffer, size, "%s, %s", key[SIGNAL_CONSTANT], key[SIGNAL_EXPRESSION]);
  for (key += SIGNAL_FORMS; *key && n < size; key++) n += (size_t)snprintf (buffer + n, size - n, ", %s", *key);
  return buffer;
}

/* A signal in braces, such as {harmonic: {...}}. */
static int signal_map (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node, pw_signal *signal) {
  const char *key[PW_YAML_MAX_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[PW_YAML_MAX_KEYS];
  char list[100];
  int n = SIGNAL_FORMS, given = 0, form_key = SIGNAL_FORMS;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) key[n++] = f->name;
  key[n] = NULL;
  if (pw_yaml_keys (r, node, key, "a signal", v) != PW_OK) return r->error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form_key = i;
  }
  if (given != 1)
    return pw_yaml_fail (r, node->at, "%s: expected one of %s; found %s", label, signal_list (key, list, sizeof list),
                         given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return pw_yaml_fail (r, node->at, "%s: a rate or acceleration belongs to an expression", label);
  if (v[SIGNAL_CONSTANT]) return pw_yaml_number (r, v[SIGNAL_CONSTANT], label, PW_REAL, &signal->constant);
  if (v[SIGNAL_EXPRESSION]) return pw_yaml_time_signal (r, kind, label, v + SIGNAL_EXPRESSION, signal);
  return signal_read_form (r, kind, &pw_signal_forms[form_key - SIGNAL_FORMS], label, v[form_key], signal);
}

int pw_yaml_signal (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node, pw_signal *signal) {
  const pw_node *const v[3] = { node, NULL, NULL };
  if (node->type == PW_YAML_MAP) return signal_map (r, kind, label, node, signal);
  if (node->type == PW_YAML_SCALAR && pw_yaml_find_variable (node->text))
    return pw_yaml_time_signal (r, kind, label, v, signal);
  return pw_yaml_number (r, node, label, PW_REAL, &signal->constant);
}
