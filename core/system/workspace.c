/* Workspaces: data that a run modifies. */
#include <math.h>
#include <stdlib.h>
#include "system.h"

/* The number of entries of J of all elements, zeros included. */
static size_t workspace_entries (const pw_system *s) {
  size_t entries = 0;
  for (int i = 0; i < s->batches; i++)
    entries += (size_t)s->batch[i].b.count * (size_t)(s->batch[i].kind->rows * s->batch[i].b.cols);
  return entries;
}

/* Copies batch i of the system, with arrays of the workspace.  *J: advances over the batch's part of w->J. */
static void workspace_batch (pw_layout *layout, const pw_workspace *w, int i, double **J) {
  const pw_element_batch *from = &w->s->batch[i];
  const pw_kind *kind = from->kind;
  size_t n = (size_t)from->b.count, cols = (size_t)from->b.cols;
  int used = kind->force || kind->energy || kind->power || kind->loss;
  double *block = pw_layout_alloc (layout, used ? (kind->saturation ? 2 : 1) * n * cols : 0, sizeof *block);
  if (layout->base == NULL) return;
  pw_element_batch *k = &w->batch[i];
  *k = *from;
  k->J = *J, k->block = block;
  *J += n * (size_t)kind->rows * cols;
  k->source = w->source + (from->source - w->s->source);
  k->b.u = k->u = w->u + 3 * (k->source - w->source);
  k->b.configuration = w->configuration;
  k->b.q = w->s->q0 + k->internal, k->b.v = w->s->v0 + k->internal; /* until kinematics are updated */
}

static void workspace_layout (pw_layout *layout, pw_workspace *w) {
  const pw_system *s = w->s;
  pw_layout_alloc (layout, 1, sizeof *w);
  w->batch = pw_layout_alloc (layout, (size_t)s->batches, sizeof *w->batch);
  w->force = pw_layout_alloc (layout, (size_t)s->forces, sizeof *w->force);
  w->source = pw_layout_alloc (layout, (size_t)s->sources, sizeof *w->source);
  w->configuration = pw_layout_alloc (layout, (size_t)s->bodies + 1, sizeof *w->configuration);
  w->scratch = pw_layout_alloc (layout, (size_t)(3 * s->rows + s->coords) + 3, sizeof *w->scratch);
  w->u = pw_layout_alloc (layout, 3 * (size_t)s->sources, sizeof *w->u);
  w->J = pw_layout_alloc (layout, workspace_entries (s), sizeof *w->J);
  double *J = w->J;
  for (int i = 0; i < s->batches; i++) workspace_batch (layout, w, i, &J);
  double *x = pw_layout_alloc (layout, 2 * (size_t)s->reads, sizeof *x);
  for (int i = 0; layout->base && i < s->sources; i++) {
    w->source[i] = s->source[i];
    w->source[i].u = w->u + 3 * i;
    w->source[i].x = x;
    x += 2 * s->source[i].reads; /* values, gradient */
  }
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
  pw_layout layout = { NULL, 0 };
  if (pw_require (s, "a system", error) != PW_OK) return NULL;
  workspace_layout (&layout, &(pw_workspace){ .s = s });
  pw_workspace *w = calloc (1, layout.used);
  if (w) {
    w->s = s;
    w->scale = s->scale;
    w->t_signal = NAN;
    workspace_layout (&(pw_layout){ (char *)w, 0 }, w);
    w->configuration[s->bodies].cos = 1;
    for (int i = 0, n = 0; i < s->batches; i++)
      if (w->batch[i].kind->force && !w->batch[i].kind->constant) w->force[n++] = &w->batch[i];
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
