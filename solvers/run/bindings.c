/* For programs in other languages: samples in rows of an array, an input that they set, layouts of structures. */
#include <string.h>
#include "method.h"
#include "pinwheel-analysis.h"

/* ---- Rows of samples ---- */

int pw_run_record_width (const pw_run *r) {
  return PW_RECORD_STATES + 3 * r->s->coords + r->s->rows + (r->settings.ledger ? r->s->entries : 0);
}

static void record_row (const pw_run *r, const pw_sample *x, double *row) {
  size_t n = (size_t)r->s->coords;
  const double head[PW_RECORD_STATES] = { x->t,    x->position, x->velocity,   x->kinetic, x->potential,
                                          x->work, x->loss,     x->projection, x->balance };
  memcpy (row, head, sizeof head);
  row += PW_RECORD_STATES;
  memcpy (row, x->q, n * sizeof *row);
  memcpy (row + n, x->v, n * sizeof *row);
  memcpy (row + 2 * n, x->a, n * sizeof *row);
  row += 3 * n;
  for (int i = 0; i < r->s->rows; i++) row[i] = 0 - x->lambda[i];
  if (x->ledger) memcpy (row + r->s->rows, x->ledger, (size_t)r->s->entries * sizeof *row);
}

int pw_run_record (pw_run *r, double t_end, const double *times, long count, long steps, double *rows, long *recorded,
                   pw_error *error) {
  int status = PW_OK;
  pw_sample sample;
  *recorded = 0;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  for (long step = 0; status == PW_OK && *recorded < count; step++) {
    while (times && status == PW_OK && *recorded < count && times[*recorded] <= r->t) {
      status = pw_run_sample (r, times[*recorded], &sample, error);
      if (status == PW_OK) record_row (r, &sample, rows + *recorded * pw_run_record_width (r)), ++*recorded;
    }
    if (status != PW_OK || step == steps || r->t >= t_end) break;
    status = times ? pw_run_advance_towards (r, times[*recorded], t_end, error) : pw_run_advance (r, t_end, error);
    if (status != PW_OK || times) continue;
    status = pw_run_sample (r, r->t, &sample, error);
    if (status == PW_OK) record_row (r, &sample, rows + *recorded * pw_run_record_width (r)), ++*recorded;
  }
  return status;
}

/* ---- Inputs ---- */

int pw_input_signal (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)t, (void)x, (void)gradient;
  value[0] = *(const double *)context;
  value[1] = value[2] = 0;
  return 0;
}

/* ---- Version and layouts ---- */

const char pw_version[] = PW_VERSION;

#define LAYOUT(type) \
  { #type, 0, sizeof(type) }
#define MEMBER(type, member) \
  { #type "." #member, offsetof(type, member), sizeof(((type *)NULL)->member) }

const pw_member pw_members[] = { LAYOUT (pw_error),
                                 MEMBER (pw_error, status),
                                 MEMBER (pw_error, text),
                                 LAYOUT (pw_initial_value),
                                 MEMBER (pw_initial_value, state),
                                 MEMBER (pw_initial_value, value),
                                 LAYOUT (pw_settings),
                                 MEMBER (pw_settings, t),
                                 MEMBER (pw_settings, span),
                                 MEMBER (pw_settings, step),
                                 MEMBER (pw_settings, rtol),
                                 MEMBER (pw_settings, atol),
                                 MEMBER (pw_settings, ledger),
                                 MEMBER (pw_settings, max_steps),
                                 MEMBER (pw_settings, initial),
                                 MEMBER (pw_settings, initials),
                                 MEMBER (pw_settings, specialised),
                                 LAYOUT (pw_statistics),
                                 MEMBER (pw_statistics, steps),
                                 MEMBER (pw_statistics, rejected),
                                 MEMBER (pw_statistics, rhs),
                                 MEMBER (pw_statistics, jacobians),
                                 MEMBER (pw_statistics, factorisations),
                                 MEMBER (pw_statistics, specialised),
                                 MEMBER (pw_statistics, position),
                                 MEMBER (pw_statistics, velocity),
                                 MEMBER (pw_statistics, g),
                                 MEMBER (pw_statistics, jv),
                                 LAYOUT (pw_initial_report),
                                 MEMBER (pw_initial_report, q_given),
                                 MEMBER (pw_initial_report, v_given),
                                 MEMBER (pw_initial_report, q),
                                 MEMBER (pw_initial_report, v),
                                 LAYOUT (pw_parameter),
                                 MEMBER (pw_parameter, name),
                                 MEMBER (pw_parameter, value),
                                 MEMBER (pw_parameter, unit),
                                 MEMBER (pw_parameter, about),
                                 LAYOUT (pw_field),
                                 MEMBER (pw_field, name),
                                 MEMBER (pw_field, type),
                                 MEMBER (pw_field, count),
                                 MEMBER (pw_field, unit),
                                 MEMBER (pw_field, required),
                                 MEMBER (pw_field, domain),
                                 MEMBER (pw_field, choices),
                                 MEMBER (pw_field, about),
                                 LAYOUT (pw_quantity),
                                 MEMBER (pw_quantity, name),
                                 MEMBER (pw_quantity, unit),
                                 MEMBER (pw_quantity, about),
                                 LAYOUT (pw_kind),
                                 MEMBER (pw_kind, name),
                                 MEMBER (pw_kind, about),
                                 MEMBER (pw_kind, fields),
                                 MEMBER (pw_kind, rows),
                                 MEMBER (pw_kind, reaction),
                                 LAYOUT (pw_plugin_table),
                                 MEMBER (pw_plugin_table, about),
                                 MEMBER (pw_plugin_table, parameters),
                                 MEMBER (pw_plugin_table, run.t_end),
                                 MEMBER (pw_plugin_table, run.step),
                                 MEMBER (pw_plugin_table, run.rtol),
                                 MEMBER (pw_plugin_table, run.method),
                                 LAYOUT (pw_signal),
                                 MEMBER (pw_signal, type),
                                 MEMBER (pw_signal, function.eval),
                                 MEMBER (pw_signal, function.context),
                                 MEMBER (pw_signal, function.reads),
                                 LAYOUT (pw_linear),
                                 MEMBER (pw_linear, positions),
                                 MEMBER (pw_linear, velocities),
                                 MEMBER (pw_linear, unknowns),
                                 MEMBER (pw_linear, A),
                                 MEMBER (pw_linear, re),
                                 MEMBER (pw_linear, im),
                                 MEMBER (pw_linear, steady),
                                 MEMBER (pw_linear, twist),
                                 MEMBER (pw_linear, B),
                                 MEMBER (pw_linear, basis),
                                 { NULL, 0, 0 } };
