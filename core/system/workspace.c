/* Workspaces: data that a run modifies. */
#include <math.h>
#include <stdlib.h>
#include "system.h"

/* Copies batches and signals of the system, with arrays of the workspace; x: for the states that signals read. */
static void workspace_fill (pw_workspace *w, double *x) {
  const pw_system *s = w->s;
  double *J = w->J;
  for (int i = 0; i < s->batches; i++) {
    pw_element_batch *k = &w->batch[i];
    *k = s->batch[i];
    k->J = J, k->block = w->block;
    J += k->b.count * k->kind->rows * k->b.cols;
    k->source = w->source + (k->source - s->source);
    k->b.u = k->u = w->u + 3 * (k->source - w->source);
    k->b.configuration = w->configuration;
    k->b.q = s->q0 + k->internal, k->b.v = s->v0 + k->internal; /* until kinematics are updated */
  }
  for (int i = 0; i < s->sources; i++) {
    w->source[i] = s->source[i];
    w->source[i].u = w->u + 3 * i;
    w->source[i].x = x;
    x += 2 * s->source[i].reads; /* values, gradient */
  }
  w->configuration[s->bodies].cos = 1;
}

/* Opens a context of this workspace for each function signal with `open`. */
static int workspace_open_signals (pw_workspace *w) {
  int status = PW_OK;
  for (pw_source *source = w->source; source < w->source + w->s->sources; source++) {
    pw_function *f = &source->signal.function;
    if (source->signal.type != PW_FUNCTION || f->open == NULL) continue;
    f->context = status == PW_OK ? f->open (f->context) : NULL;
    if (f->context) continue;
    status = PW_RESOURCE; /* pw_close_signals must skip this signal and the following ones, which are not opened */
    f->close = NULL;
  }
  return status;
}

void pw_close_signals (const pw_source *source, int count) {
  for (int i = 0; i < count; i++) {
    const pw_signal *signal = &source[i].signal;
    if (signal->type == PW_FUNCTION && signal->function.open && signal->function.close)
      signal->function.close (signal->function.context);
  }
}

pw_workspace *pw_workspace_new (const pw_system *s, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK) return NULL;
  pw_workspace all = { .s = s, .scale = s->scale, .t_signal = NAN }, *w = NULL;
  char *memory;
  double *x = NULL;
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &memory);) {
    w = pw_layout_alloc (&l, 1, sizeof *w);
    all.batch = pw_layout_alloc (&l, (size_t)s->batches, sizeof *all.batch);
    all.source = pw_layout_alloc (&l, (size_t)s->sources, sizeof *all.source);
    all.configuration = pw_layout_alloc (&l, (size_t)s->bodies + 1, sizeof *all.configuration);
    all.scratch = pw_layout_alloc (&l, (size_t)(3 * s->rows + s->coords) + 3, sizeof *all.scratch);
    all.u = pw_layout_alloc (&l, 3 * (size_t)s->sources, sizeof *all.u);
    all.J = pw_layout_alloc (&l, s->jacobian, sizeof *all.J);
    all.block = pw_layout_alloc (&l, s->block, sizeof *all.block);
    x = pw_layout_alloc (&l, 2 * (size_t)s->reads, sizeof *x);
  }
  if (w) {
    *w = all;
    workspace_fill (w, x);
    if (workspace_open_signals (w) == PW_OK) return w;
  }
  pw_workspace_free (w);
  pw_fail_memory (s, error);
  return NULL;
}

void pw_workspace_free (pw_workspace *w) {
  if (w) pw_close_signals (w->source, w->s->sources);
  free (w);
}
