/* For programs in other languages: samples in rows of an array, signals whose value they set, layouts of structures. */
#include <string.h>
#include "method.h"
#include "pinwheel-analysis.h"

int pw_system_record_width (const pw_system *s, int ledger) {
  return PW_RECORD_STATES + 3 * s->coords + 2 * pw_system_contacts (s) + s->rows + s->outputs +
         (ledger ? s->entries : 0);
}

int pw_run_record_width (const pw_run *r) {
  return pw_system_record_width (r->s, r->settings.ledger);
}

/* The i-th number of a row; accelerations are states from 2 coords on. */
static pw_column record_column (const pw_system *s, int i) {
  static const pw_column_type first[PW_RECORD_STATES] = { PW_COLUMN_TIME,    PW_COLUMN_POSITION,   PW_COLUMN_VELOCITY,
                                                          PW_COLUMN_KINETIC, PW_COLUMN_POTENTIAL,  PW_COLUMN_WORK,
                                                          PW_COLUMN_LOSS,    PW_COLUMN_PROJECTION, PW_COLUMN_BALANCE },
                              next[] = { PW_COLUMN_CONTACT, PW_COLUMN_REACTION, PW_COLUMN_OUTPUT };
  if (i < PW_RECORD_STATES) return (pw_column){ first[i], 0 };
  if ((i -= PW_RECORD_STATES) < 3 * s->coords) return (pw_column){ PW_COLUMN_STATE, i };
  i -= 3 * s->coords;
  for (int k = 0; k < 3; i -= pw_system_columns (s, next[k++]))
    if (i < pw_system_columns (s, next[k])) return (pw_column){ next[k], i };
  return (pw_column){ PW_COLUMN_LEDGER, i };
}

char *pw_system_record_name (const pw_system *s, int i, char *buffer, size_t size) {
  const pw_column c = record_column (s, i);
  if (c.type != PW_COLUMN_STATE || c.index < 2 * s->coords) return pw_system_column_name (s, c, buffer, size);
  pw_system_state_name (s, c.index - s->coords, buffer, size);
  return strncat (buffer, "'", size - strlen (buffer) - 1);
}

/* Names of columns follow from those of bodies, elements and outputs. */
int pw_system_record_same (const pw_system *a, const pw_system *b, int ledger) {
  int same = a->bodies == b->bodies && a->batches == b->batches && a->outputs == b->outputs &&
             pw_system_record_width (a, ledger) == pw_system_record_width (b, ledger);
  for (int i = 0; same && i < a->bodies; i++) same = strcmp (a->body_name[i], b->body_name[i]) == 0;
  for (int k = 0; same && k < a->batches; k++) {
    const pw_element_batch *x = &a->batch[k], *y = &b->batch[k];
    same = x->kind == y->kind && x->b.count == y->b.count;
    for (int e = 0; same && e < x->b.count; e++) same = strcmp (x->name[e], y->name[e]) == 0;
  }
  for (int i = 0; same && i < a->outputs; i++) same = strcmp (a->output[i].name, b->output[i].name) == 0;
  return same;
}

const char *pw_system_record_unit (const pw_system *s, int i) {
  const pw_column c = record_column (s, i);
  const int j = c.index - 2 * s->coords;
  if (c.type != PW_COLUMN_STATE || j < 0) return pw_system_column_unit (s, c);
  if (j >= s->mechanical) return s->state_unit[2 * (j - s->mechanical) + 1];
  return pw_system_state_unit (s, j)[0] == 'm' ? "m/s^2" : "rad/s^2";
}

int pw_record_row (pw_run *r, double t, double *row, pw_error *error) {
  const size_t n = (size_t)r->s->coords;
  pw_sample x;
  int status = pw_run_sample (r, t, &x, error);
  if (status != PW_OK) return status;
  const double before_states[PW_RECORD_STATES] = { x.t,    x.position, x.velocity,   x.kinetic, x.potential,
                                                   x.work, x.loss,     x.projection, x.balance };
  memcpy (row, before_states, sizeof before_states);
  row += PW_RECORD_STATES;
  memcpy (row, x.q, n * sizeof *row);
  memcpy (row + n, x.v, n * sizeof *row);
  memcpy (row + 2 * n, x.a, n * sizeof *row);
  row += 3 * n;
  pw_evaluate_contacts (r->w, r->w->contact);
  for (int i = 0; i < pw_system_contacts (r->s); i++, row += 2) memcpy (row, r->w->contact[i], 2 * sizeof *row);
  for (int i = 0; i < r->s->rows; i++) row[i] = 0 - x.lambda[i]; /* reactions; no negative zeros */
  row += r->s->rows;
  if (r->s->outputs) memcpy (row, x.output, (size_t)r->s->outputs * sizeof *row);
  if (x.ledger) memcpy (row + r->s->outputs, x.ledger, (size_t)r->s->entries * sizeof *row);
  return PW_OK;
}

static int record_sample (pw_run *r, double t, double *rows, long *recorded, pw_error *error) {
  int status = pw_record_row (r, t, rows + *recorded * pw_run_record_width (r), error);
  *recorded += status == PW_OK;
  return status;
}

int pw_run_record (pw_run *r, double t_end, const double *times, long count, long steps, double *rows, long *recorded,
                   pw_error *error) {
  int status = PW_OK;
  *recorded = 0;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  for (long i = 0; times && i < count; i++)
    if (isnan (times[i])) return pw_fail (error, PW_INPUT, "times[%ld] = nan: expected a time", i);
  if (isnan (t_end)) return pw_fail (error, PW_INPUT, "t_end = nan: expected a time");
  for (long calls = 0; status == PW_OK && *recorded < count; calls++) {
    while (times && status == PW_OK && *recorded < count && times[*recorded] <= r->t)
      status = record_sample (r, times[*recorded], rows, recorded, error);
    if (status != PW_OK || *recorded == count || calls == steps || r->t >= t_end) break;
    status = times ? pw_run_advance_towards (r, times[*recorded], t_end, error) : pw_run_advance (r, t_end, error);
    if (status == PW_OK && times == NULL) status = record_sample (r, r->t, rows, recorded, error);
  }
  return status;
}

const char pw_version[] = PW_VERSION;

#define SIZE(type) \
  { #type, 0, sizeof(type) }
#define AT(type, a) \
  { #type "." #a, offsetof(type, a), sizeof(((type *)NULL)->a) }
#define AT2(type, a, b) AT (type, a), AT (type, b)
#define AT3(type, a, b, c) AT2 (type, a, b), AT (type, c)
#define AT4(type, a, b, c, d) AT2 (type, a, b), AT2 (type, c, d)

/* What the bindings in other languages use; a member that they begin to use is added here. */
const pw_member pw_members[] = {
  SIZE (pw_error),
  AT2 (pw_error, status, text),
  SIZE (pw_initial_value),
  AT2 (pw_initial_value, state, value),
  SIZE (pw_settings),
  AT4 (pw_settings, t, span, step, rtol),
  AT4 (pw_settings, atol, ledger, max_steps, initial),
  AT4 (pw_settings, initials, specialised, stop, stop_context),
  SIZE (pw_statistics),
  AT4 (pw_statistics, steps, rejected, rhs, jacobians),
  AT4 (pw_statistics, factorisations, restarts, specialised, position),
  AT4 (pw_statistics, unresolved, velocity, g, jv),
  AT (pw_statistics, conditions),
  SIZE (pw_archive),
  AT4 (pw_archive, at, used, size, loading),
  SIZE (pw_ensemble),
  AT4 (pw_ensemble, run, count, threads, inputs),
  AT4 (pw_ensemble, columns, signal, input, column),
  AT4 (pw_ensemble, observed, status, error, lanes),
  SIZE (pw_event),
  AT4 (pw_event, t, impulse, row, from),
  AT2 (pw_event, to, impact),
  SIZE (pw_crossing),
  AT2 (pw_crossing, value, context),
  SIZE (pw_initial_report),
  AT4 (pw_initial_report, q_given, v_given, q, v),
  AT2 (pw_initial_report, moved, released),
  SIZE (pw_parameter),
  AT4 (pw_parameter, name, value, unit, about),
  SIZE (pw_field),
  AT4 (pw_field, name, type, count, unit),
  AT4 (pw_field, required, domain, choices, about),
  SIZE (pw_quantity),
  AT3 (pw_quantity, name, unit, about),
  SIZE (pw_kind),
  AT4 (pw_kind, name, about, fields, rows),
  AT3 (pw_kind, reaction, level, force_u),
  SIZE (pw_element),
  AT2 (pw_element, kind, definition),
  SIZE (pw_plugin_table),
  AT4 (pw_plugin_table, about, parameters, run.t_end, run.step),
  AT2 (pw_plugin_table, run.rtol, run.method),
  SIZE (pw_signal),
  AT4 (pw_signal, type, function.eval, function.context, function.reads),
  AT (pw_signal, harmonic.offset),
  SIZE (pw_linear),
  AT4 (pw_linear, positions, velocities, unknowns, A),
  AT4 (pw_linear, re, im, steady, twist),
  AT2 (pw_linear, B, basis),
  { NULL, 0, 0 },
};
