/* Compiles the signals of all elements: their tables, the states that they read, the contexts of functions. */
#include <math.h>
#include <string.h>
#include "system.h"

/* Copies the points of a table and computes its spline. */
static int signals_table (pw_system *s, pw_source *source, const char *element, pw_error *error) {
  pw_points *table = &source->signal.table;
  size_t n = (size_t)table->count;
  double *t = pw_arena_alloc (&s->arena, 4 * n * sizeof *t), *value = t + n;
  if (t == NULL) return pw_fail_memory (s, error);
  memcpy (t, table->t, n * sizeof *t);
  for (size_t i = 0; i < n; i++) value[i] = pw_table_value (&source->signal, (int)i);
  table->t = t;
  table->value = value;
  table->scale = 1, table->offset = 0;
  source->spline = value + n;
  pw_table_spline (&source->signal, source->spline);
  for (size_t i = 0; i < 2 * n; i++)
    if (!isfinite (source->spline[i]))
      return pw_fail (error, PW_INPUT, "model %s: element %s: the derivatives of the table are not finite at t = %g s",
                      s->model, element, t[i % n]);
  return PW_OK;
}

/* Converts the names of the states that a function reads to indices. */
static int signals_reads (pw_system *s, pw_source *source, const char *element, pw_error *error) {
  const char *const *reads = source->signal.function.reads;
  int count = 0;
  while (reads && reads[count]) count++;
  int *state = pw_arena_alloc (&s->arena, (size_t)count * sizeof *state);
  if (state == NULL) return pw_fail_memory (s, error);
  for (int i = 0; i < count; i++) {
    pw_error cause = { 0 };
    state[i] = pw_system_find_state (s, reads[i], &cause);
    if (state[i] < 0)
      return pw_fail (error, PW_INPUT, "model %s: element %s reads a state: %s", s->model, element, cause.text);
  }
  source->state = state;
  source->reads = count;
  s->reads += count;
  s->state_dependent += count > 0;
  return PW_OK;
}

static int signals_source (pw_system *s, pw_source *source, const pw_signal *signal, const char *element,
                           pw_error *error) {
  const pw_function *opens = signal->type == PW_FUNCTION && signal->function.open ? &signal->function : NULL;
  void *context = opens ? opens->open (opens->context) : NULL;
  if (opens && context == NULL) return pw_fail_memory (s, error);
  source->signal = *signal;
  if (context) source->signal.function.context = context;
  if (signal->type == PW_TABLE) return signals_table (s, source, element, error);
  return signal->type == PW_FUNCTION ? signals_reads (s, source, element, error) : PW_OK;
}

int pw_compile_signals (pw_system *s, const pw_compiled *from, pw_error *error) {
  pw_source *source = s->source;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++)
    for (int e = 0; e < k->b.count; e++, from++)
      for (int u = 0; u < k->kind->signals; u++, source++) {
        source->of_force = pw_kind_signals_force (k->kind);
        const pw_signal *signal = pw_field_at (k->kind, from->element->definition, PW_SIGNAL, u);
        int status = signals_source (s, source, signal, k->name[e], error);
        if (status != PW_OK) return status;
      }
  return PW_OK;
}
