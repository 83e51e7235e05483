/* Names and sizes of a compiled system; times at which its signals jump. */
#include <float.h>
#include <string.h>
#include "system.h"

/* The states of a body: names and units. */
static const char *const query_states[] = { "x", "y", "phi", "vx", "vy", "omega" };
static const char *const query_units[] = { "m", "m", "rad", "m/s", "m/s", "rad/s" };

#define MEMBER(type, function, member) \
  type function (const pw_system *s) { \
    return s->member;                  \
  }
MEMBER (int, pw_system_bodies, bodies)
MEMBER (int, pw_system_coordinates, coords)
MEMBER (int, pw_system_rows, rows)
MEMBER (int, pw_system_holonomic, holonomic)
MEMBER (int, pw_system_signals, sources)
MEMBER (int, pw_system_ledger_entries, entries)
MEMBER (int, pw_system_outputs, outputs)
MEMBER (const char *, pw_system_name, model)
MEMBER (const double *, pw_system_mass, M)
MEMBER (double, pw_system_length, scale.length)
MEMBER (const double *, pw_system_initial_q, q0)
MEMBER (const double *, pw_system_initial_v, v0)

const char *pw_system_body_name (const pw_system *s, int body) {
  return s->body_name[body];
}

int pw_system_unturned (const pw_system *s, int body) {
  return pw_is_unturned (s, 3 * body + 2);
}

int pw_system_jumps (const pw_system *s, double t) {
  const double near = 8 * DBL_EPSILON * fmax (fabs (t), 1); /* round-off of sums of steps, also near 0 */
  /* signals of forces count only if their values may jump: their derivatives are not used */
  for (const pw_source *source = s->source, *end = source + s->sources; source < end; source++)
    if (!source->of_coordinate && (!source->of_force || pw_signal_value_may_jump (&source->signal)))
      if (pw_signal_breakpoint (&source->signal, 0, t - near) <= t + near) return 1;
  return 0;
}

int pw_system_find_body (const pw_system *s, const char *name) {
  for (int b = 0; s && name && b < s->bodies; b++)
    if (strcmp (s->body_name[b], name) == 0) return b;
  return -1;
}

/* The batch that contains constraint equation, internal coordinate or signal i of the system, the index of its element
 * in the batch, and its number in the element.  member: offset of `rows`, `internal` or `signals` in pw_kind. */
static const pw_element_batch *query_find_element (const pw_system *s, size_t member, int i, int *element,
                                                   int *number) {
  for (const pw_element_batch *k = s->batch;; k++) {
    int per_element = *(const int *)(const void *)((const char *)k->kind + member);
    if (i < k->b.count * per_element) {
      *element = i / per_element;
      *number = i % per_element;
      return k;
    }
    i -= k->b.count * per_element;
  }
}

char *pw_member_name (const pw_system *s, const pw_element_batch *k, int e, const char *what, char *buffer,
                      size_t size) {
  const char *body = k->kind->each_body ? s->body_name[k->b.body[e]] : "";
  return pw_join (buffer, size, k->name[e], *body ? "." : "", body, *what ? "." : "", what, NULL);
}

char *pw_system_state_name (const pw_system *s, int state, char *buffer, size_t size) {
  int velocity = state >= s->coords, j = velocity ? state - s->coords : state, e, n;
  if (j < 3 * s->bodies)
    return pw_join (buffer, size, s->body_name[j / 3], ".", query_states[3 * velocity + j % 3], NULL);
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, internal), j - 3 * s->bodies, &e, &n);
  const pw_quantity *x = &k->kind->coordinate[n];
  return pw_member_name (s, k, e, velocity ? x->rate : x->name, buffer, size);
}

const char *pw_system_state_unit (const pw_system *s, int state) {
  int velocity = state >= s->coords, j = velocity ? state - s->coords : state, e, n;
  if (j >= s->mechanical) return velocity ? s->state_unit[2 * (j - s->mechanical)] : "";
  if (j < 3 * s->bodies) return query_units[3 * velocity + j % 3];
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, internal), j - 3 * s->bodies, &e, &n);
  const char *unit = k->kind->coordinate[n].unit;
  return !velocity ? unit : *unit ? "rad/s" : "1/s";
}

/* Index of a state named like "BODY.x", or -1; if only the body exists, near->best becomes its nearest state.  The
 * search for the body begins at body `first`. */
static int query_body_state (const pw_system *s, const char *name, int first, pw_nearest *near) {
  const char *dot = strrchr (name, '.');
  const size_t n = dot ? (size_t)(dot - name) : 0;
  if (dot == NULL || s->bodies == 0) return -1;
  int b = first;
  while (strncmp (s->body_name[b], name, n) != 0 || s->body_name[b][n])
    if ((b = b + 1 < s->bodies ? b + 1 : 0) == first) return -1;
  for (int i = 0; i < 6; i++)
    if (strcmp (dot + 1, query_states[i]) == 0) return i < 3 ? 3 * b + i : s->coords + 3 * b + i - 3;
  pw_nearest nearest = { .sought = dot + 1 };
  for (int i = 0; i < 6; i++) pw_nearest_try (&nearest, query_states[i]);
  nearest.sought = name;
  *near = nearest;
  snprintf (near->best, sizeof near->best, "%s.%.10s", s->body_name[b], nearest.best); /* names of states have fewer */
  return -1;
}

typedef char *query_name (const pw_system *s, int i, char *buffer, size_t size);

/* The index of near->sought among the `count` names that name_of gives; fails if it is not there, with a hint:
 * near->best, or else the nearest name.  what: "state", ... */
static int query_find (const pw_system *s, const char *what, int count, query_name *name_of, pw_nearest *near,
                       pw_error *error) {
  char text[PW_NAME_BYTES];
  if (pw_require (s, "a system", error) != PW_OK) return PW_INPUT;
  if (near->sought == NULL) return pw_fail (error, PW_INPUT, "model %s: the name of a %s is missing", s->model, what);
  int search = *near->best == 0;
  for (int i = 0; i < count; i++)
    if (strcmp (name_of (s, i, text, sizeof text), near->sought) == 0) return i;
  for (int i = 0; search && i < count; i++) pw_nearest_try (near, name_of (s, i, text, sizeof text));
  return pw_fail (error, PW_INPUT, "model %s has no %s \"%s\"%s", s->model, what, near->sought, pw_nearest_text (near));
}

static int query_find_state (const pw_system *s, const char *name, int first, pw_error *error) {
  pw_nearest near = { .sought = name };
  int state = s && name ? query_body_state (s, name, first, &near) : -1;
  if (state < 0) state = query_find (s, "state", s ? 2 * s->coords : 0, pw_system_state_name, &near, error);
  if (state < 0 || !pw_is_hidden (s, state)) return state;
  return pw_fail (error, PW_INPUT, "model %s has no state \"%s\": the integral of a state is not computed", s->model,
                  name);
}

int pw_system_find_state (const pw_system *s, const char *name, pw_error *error) {
  return query_find_state (s, name, 0, error);
}

int pw_system_states (const pw_system *s) {
  return s->coords - s->mechanical;
}

int pw_system_state_hidden (const pw_system *s, int state) {
  return pw_is_hidden (s, state);
}

int pw_system_row_element (const pw_system *s, int row) {
  int element, n;
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, rows), row, &element, &n);
  while (k > s->batch) element += (--k)->b.count; /* the elements of earlier batches */
  return element;
}

char *pw_system_reaction_name (const pw_system *s, int row, char *buffer, size_t size) {
  int e, n;
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, rows), row, &e, &n);
  return pw_member_name (s, k, e, k->kind->reaction[n].name, buffer, size);
}

const char *pw_system_reaction_unit (const pw_system *s, int row) {
  int e, n;
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, rows), row, &e, &n);
  if (k->kind->reaction_unit == NULL) return k->kind->reaction[n].unit;
  return k->kind->reaction_unit ((const char *)k->b.element + (size_t)e * k->kind->element, n);
}

int pw_system_find_reaction (const pw_system *s, const char *name, pw_error *error) {
  return query_find (s, "reaction", s ? s->rows : 0, pw_system_reaction_name, &(pw_nearest){ .sought = name }, error);
}

char *pw_system_row_name (const pw_system *s, int row, char *buffer, size_t size) {
  int e, n;
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, rows), row, &e, &n);
  return pw_print (buffer, size, "%s %s", k->kind->name, k->name[e]);
}

static const pw_element_batch *query_signal (const pw_system *s, int signal, int *element, const pw_field **field,
                                             int *index) {
  if (signal < s->limit_sources) {
    *element = s->limit_signal[signal].element, *field = s->limit_signal[signal].field, *index = 0;
    return &s->batch[s->limit_signal[signal].batch];
  }
  signal -= s->limit_sources;
  const pw_element_batch *k = query_find_element (s, offsetof (pw_kind, signals), signal, element, index);
  const pw_field *f = k->kind->fields;
  for (; f->type != PW_SIGNAL || *index >= pw_field_count (f); f++)
    if (f->type == PW_SIGNAL) *index -= pw_field_count (f);
  *field = f;
  return k;
}

int pw_system_signal_of_force (const pw_system *s, int signal) {
  return s->source[signal].of_force;
}

char *pw_system_signal_name (const pw_system *s, int signal, char *buffer, size_t size) {
  int e, n;
  const pw_field *f;
  char field[80];
  const pw_element_batch *k = query_signal (s, signal, &e, &f, &n);
  return pw_member_name (s, k, e, pw_field_value_name (f, n, field, sizeof field), buffer, size);
}

const char *pw_system_signal_unit (const pw_system *s, int signal) {
  int e, n;
  const pw_field *f;
  query_signal (s, signal, &e, &f, &n);
  return f->unit ? f->unit : "";
}

int pw_system_find_signal (const pw_system *s, const char *name, pw_error *error) {
  for (int i = 0; s && name && i < s->batches; i++) {
    const pw_element_batch *k = &s->batch[i];
    for (int e = 0; k->kind->signals == 1 && !k->kind->each_body && e < k->b.count; e++)
      if (strcmp (k->name[e], name) == 0) return (int)(k->source - s->source) + e;
  }
  return query_find (s, "signal", s ? s->sources : 0, pw_system_signal_name, &(pw_nearest){ .sought = name }, error);
}

int pw_system_contacts (const pw_system *s) {
  int count = 0;
  for (int i = 0; i < s->batches; i++) count += s->batch[i].kind->contact ? s->batch[i].b.count : 0;
  return count;
}

char *pw_system_contact_name (const pw_system *s, int i, char *buffer, size_t size) {
  const pw_element_batch *k = s->batch;
  int contact = i / 2;
  for (; k->kind->contact == NULL || contact >= k->b.count; k++) contact -= k->kind->contact ? k->b.count : 0;
  return pw_member_name (s, k, contact, i % 2 ? "y" : "x", buffer, size);
}

char *pw_system_ledger_name (const pw_system *s, int entry, char *buffer, size_t size) {
  const pw_entry *listed = &s->entry[entry];
  return pw_member_name (s, &s->batch[listed->batch], listed->element, listed->type == PW_WORK ? "work" : "loss",
                         buffer, size);
}

/* Columns that are one number of a sample. */
static const struct {
  const char *name, *unit;
  size_t offset; /* in pw_sample */
} query_scalars[PW_COLUMN_TYPES] = {
  [PW_COLUMN_TIME] = { "t", "s", offsetof (pw_sample, t) },
  [PW_COLUMN_POSITION] = { "residual.position", "", offsetof (pw_sample, position) },
  [PW_COLUMN_VELOCITY] = { "residual.velocity", "", offsetof (pw_sample, velocity) },
  [PW_COLUMN_KINETIC] = { "kinetic", "J", offsetof (pw_sample, kinetic) },
  [PW_COLUMN_POTENTIAL] = { "potential", "J", offsetof (pw_sample, potential) },
  [PW_COLUMN_PROJECTION] = { "projection", "J", offsetof (pw_sample, projection) },
  [PW_COLUMN_BALANCE] = { "balance", "J", offsetof (pw_sample, balance) },
  [PW_COLUMN_WORK] = { "work", "J", offsetof (pw_sample, work) },
  [PW_COLUMN_LOSS] = { "loss", "J", offsetof (pw_sample, loss) },
};

size_t pw_column_offset (pw_column_type type) {
  return query_scalars[type].offset;
}

int pw_system_columns (const pw_system *s, pw_column_type type) {
  if (type == PW_COLUMN_STATE) return 2 * s->coords;
  if (type == PW_COLUMN_CONTACT) return 2 * pw_system_contacts (s);
  if (type == PW_COLUMN_REACTION) return s->rows;
  if (type == PW_COLUMN_LEDGER) return s->entries;
  return type == PW_COLUMN_OUTPUT ? s->outputs : 1;
}

char *pw_system_column_name (const pw_system *s, pw_column c, char *buffer, size_t size) {
  if (c.type == PW_COLUMN_STATE) return pw_system_state_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_CONTACT) return pw_system_contact_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_REACTION) return pw_system_reaction_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_LEDGER) return pw_system_ledger_name (s, c.index, buffer, size);
  return pw_print (buffer, size, "%s",
                   c.type == PW_COLUMN_OUTPUT ? s->output[c.index].name : query_scalars[c.type].name);
}

const char *pw_system_column_unit (const pw_system *s, pw_column c) {
  if (c.type == PW_COLUMN_STATE) return pw_system_state_unit (s, c.index);
  if (c.type == PW_COLUMN_REACTION) return pw_system_reaction_unit (s, c.index);
  if (c.type == PW_COLUMN_OUTPUT) return s->output[c.index].unit;
  return c.type == PW_COLUMN_CONTACT ? "m" : c.type == PW_COLUMN_LEDGER ? "J" : query_scalars[c.type].unit;
}

const char *pw_system_output_name (const pw_system *s, int output) {
  return s->output[output].name;
}

const char *pw_system_output_unit (const pw_system *s, int output) {
  return s->output[output].unit;
}

unsigned pw_system_output_reads (const pw_system *s, int output) {
  return s->output[output].types;
}

int pw_system_output_jumps (const pw_system *s, int output) {
  const pw_compiled_output *o = &s->output[output];
  return o->function.sides != NULL && o->types & ~(1u << PW_COLUMN_STATE);
}

int pw_kind_find_column (const pw_kind *kind, const char *name, pw_column *c) {
  for (int type = 0; kind == NULL && type < PW_COLUMN_TYPES; type++)
    if (query_scalars[type].name && strcmp (name, query_scalars[type].name) == 0)
      return *c = (pw_column){ (pw_column_type)type, 0 }, 1;
  if (kind == NULL) return 0;
  for (int i = 0; i < kind->internal; i++) {
    if (strcmp (name, kind->coordinate[i].name) == 0) return *c = (pw_column){ PW_COLUMN_STATE, i }, 1;
    if (strcmp (name, kind->coordinate[i].rate) == 0) return *c = (pw_column){ PW_COLUMN_STATE, kind->internal + i }, 1;
  }
  for (int i = 0; i < kind->rows; i++)
    if (strcmp (name, kind->reaction[i].name) == 0) return *c = (pw_column){ PW_COLUMN_REACTION, i }, 1;
  for (int i = 0; i < 2 && kind->contact; i++)
    if (strcmp (name, i ? "y" : "x") == 0) return *c = (pw_column){ PW_COLUMN_CONTACT, i }, 1;
  const int works = kind->power || (kind->rows > 0 && kind->eta), is_loss = strcmp (name, "loss") == 0;
  if (is_loss ? kind->loss == NULL && kind->limits == NULL : !works || strcmp (name, "work") != 0) return 0;
  return *c = (pw_column){ PW_COLUMN_LEDGER, is_loss }, 1;
}

int pw_system_find_column (const pw_system *s, const char *name, pw_column *c, pw_error *error) {
  char buffer[PW_NAME_BYTES];
  pw_nearest near = { .sought = name };
  if (pw_require (s, "a system", error) != PW_OK || pw_require (name, "the name of a column", error) != PW_OK)
    return PW_INPUT;
  const int state = query_body_state (s, name, 0, &(pw_nearest){ .sought = name });
  if (state >= 0) return *c = (pw_column){ PW_COLUMN_STATE, state }, PW_OK;
  for (int is_unknown = 0; is_unknown < 2; is_unknown++)
    for (*c = (pw_column){ 0 }; c->type < PW_COLUMN_TYPES; c->type++)
      for (c->index = 0; c->index < pw_system_columns (s, c->type); c->index++) {
        if (c->type == PW_COLUMN_STATE && pw_is_hidden (s, c->index)) continue;
        const char *known = pw_system_column_name (s, *c, buffer, sizeof buffer);
        if (strcmp (known, name) == 0) return PW_OK;
        if (is_unknown) pw_nearest_try (&near, known);
      }
  return pw_fail (error, PW_INPUT, "no column \"%.100s\"%s", name, pw_nearest_text (&near));
}

int pw_system_limited (const pw_system *s) {
  return s->limited;
}

const pw_bounds *pw_system_limits (const pw_system *s, int row) {
  return pw_is_limited (s, row) ? &s->limit[row] : NULL;
}

const char *pw_system_mode_name (const pw_system *s, int row, int mode) {
  const pw_bounds *limit = s->limit ? &s->limit[row] : NULL;
  if (limit && limit->relative && mode == 0) return "sticks";
  if (mode == 0) return "holds";
  return limit && limit->circle             ? "slides"
         : limit && pw_is_one_sided (limit) ? "free"
         : mode > 0                         ? "slides+"
                                            : "slides-";
}

/* "torque T: value" */
static char *query_signal_label (const pw_system *s, int signal, char *buffer, size_t size) {
  int e, n;
  const pw_field *f;
  char field[80];
  const pw_element_batch *k = query_signal (s, signal, &e, &f, &n);
  return pw_print (buffer, size, "%s %s: %s", k->kind->name, k->name[e],
                   pw_field_value_name (f, n, field, sizeof field));
}

/* Which part of a run its table covers; "" if it covers the run, which lasts for a good part of the table. */
static void query_coverage (const pw_points *table, double t_end, char *text, size_t size) {
  const double first = table->t[0], last = table->t[table->count - 1], before = fmin (fmax (first, 0), t_end),
               after = fmin (fmax (t_end - last, 0), t_end), covered = t_end - before - after, least = 1e-9 * t_end;
  const char *times = PW_PRINTED (80, "the table has times from %.15g to %.15g s", first, last);
  *text = 0;
  if (first > t_end)
    snprintf (text, size,
              "%s, after the run, which ends at %.6g s: its first value holds throughout; time_offset: %.15g "
              "lets it begin at 0",
              times, t_end, -first);
  else if (last < 0)
    snprintf (text, size, "%s, before the run: its last value holds throughout", times);
  else if (before > least || after > least)
    snprintf (
        text, size, "%s and covers %.3g %% of the run, which ends at %.6g s: %s%s%s", times, 100 * covered / t_end,
        t_end, before > least ? PW_PRINTED (80, "its first value holds for %.6g s before", before) : "",
        before > least && after > least ? ", " : "",
        after > least ? PW_PRINTED (80, "its last value %sfor %.6g s after", before > least ? "" : "holds ", after)
                      : "");
  else if (t_end < 0.05 * (last - fmax (first, 0)))
    snprintf (text, size,
              "%s, of which the run, which ends at %.6g s, uses %.2g %%: if they are in ms, add time_scale: 1e-3",
              times, t_end, 100 * t_end / (last - fmax (first, 0)));
}

char *pw_system_table_notice (const pw_system *s, int signal, double t_end, char *buffer, size_t size) {
  const pw_points *table = &s->source[signal].signal.table;
  char coverage[300] = "", skipped[80] = "";
  *buffer = 0;
  if (s->source[signal].signal.type != PW_TABLE || s->source[signal].of_coordinate || !(t_end > 0)) return buffer;
  query_coverage (table, t_end, coverage, sizeof coverage);
  if (table->skipped)
    snprintf (skipped, sizeof skipped, "%d row%s with empty cells %s left out of the table", table->skipped,
              table->skipped == 1 ? "" : "s", table->skipped == 1 ? "is" : "are");
  if (*coverage || *skipped)
    snprintf (buffer, size, "%s: %s%s%s", PW_NAME (query_signal_label, s, signal), coverage,
              *coverage && *skipped ? "; " : "", skipped);
  return buffer;
}

char *pw_failed_signal (const pw_workspace *w, char *buffer, size_t size) {
  buffer[0] = 0;
  return w->failed ? query_signal_label (w->s, (int)(w->failed - w->source), buffer, size) : buffer;
}

int pw_fail_evaluation (const pw_workspace *w, double t, pw_error *error) {
  return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed: %s is not a finite number, or its function failed", t,
                  pw_failed_signal (w, (char[PW_NAME_BYTES]){ 0 }, PW_NAME_BYTES));
}

int pw_system_may_jump (const pw_system *s) {
  for (int i = 0; i < s->batches; i++)
    if (!pw_kind_is_built_in (s->batch[i].kind)) return 1;
  for (int i = 0; i < s->sources; i++)
    if (s->source[i].reads > 0 && !s->source[i].of_coordinate) return 1;
  return 0;
}

int pw_system_reference (const pw_model *m, const pw_system *s, double t, double *q, double *v, pw_error *error) {
  if (pw_require (m, "a model", error) != PW_OK || pw_require (s, "a system", error) != PW_OK) return PW_INPUT;
  int n = pw_system_coordinates (s);
  for (int j = 0; j < n; j++) q[j] = v[j] = NAN;
  if (m->table->reference) m->table->reference (m->parameters, t, q, v);
  const pw_reference_text *text = pw_model_reference_text (m);
  for (int i = 0, body = 0; i < text->states; i++) {
    int state = query_find_state (s, text->state[i], body, error);
    if (state < 0) return state;
    body = state % n < 3 * s->bodies ? state % n / 3 : 0; /* the next one is probably near */
    double *entry = state < n ? &q[state] : &v[state - n];
    *entry = text->eval (text->context, i, t);
  }
  return PW_OK;
}
