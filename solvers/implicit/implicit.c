/* Parts of galpha and leapfrog: opening, scaling of the Newton matrix, steps; see implicit.h. */
#include <stdlib.h>
#include "implicit.h"

int pw_implicit_complete (pw_run *r, int status, int size, pw_dense_projection projection, pw_error *error) {
  pw_implicit *x = (pw_implicit *)r->data;
  const pw_scatter_map *pattern = &x->dae.tangent.scatter;
  if (status == PW_OK) status = pw_sparse_open (&x->sparse, PW_SPARSE_REAL, size, pattern->colptr, pattern->rowind);
  if (status != PW_OK) return pw_fail_memory (r->s, error);
  return pw_dense_output_open (r, projection, error);
}

void pw_implicit_close (pw_run *r) {
  pw_implicit *x = (pw_implicit *)r->data;
  pw_sparse_close (&x->sparse);
  pw_dae_close (&x->dae);
  pw_step_close (r);
}

void pw_implicit_scale (const pw_dae *x, double c, double e, double *row_factor, double *column_factor) {
  const pw_system *s = x->tangent.run->s;
  int n = x->n, g_rows = x->enforces_velocities ? 0 : x->tangent.holonomic; /* in which g = 0 replaces J v = eta */
  double mass = 0;
  for (int j = 0; j < n; j++) mass = fmax (mass, s->M[j]);
  if (mass == 0) mass = 1; /* all coordinates are massless */
  for (int j = 0; j < n; j++) {
    row_factor[j] = 1 / c, column_factor[j] = 1;
    row_factor[n + j] = 1 / (c * e * mass), column_factor[n + j] = c;
  }
  for (int i = 2 * n; i < 2 * n + x->rows; i++)
    row_factor[i] = i - 2 * n < g_rows ? 1 : 1 / c, column_factor[i] = c * e * mass;
  for (int i = 2 * n + x->rows; i < x->size; i++) row_factor[i] = 1, column_factor[i] = c;
}

int pw_implicit_fail (pw_run *r, int status, double h, pw_error *error) {
  if (status == PW_METHOD) return pw_fail_signal (r->t, error);
  if (status == PW_RESOURCE) return pw_fail (error, PW_RESOURCE, "t = %.6g s: out of memory in KLU", r->t);
  if (r->near_singular || pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  const char *reason = status == PW_SINGULAR ? "the Newton matrix is singular"
                       : status == PW_OK     ? "the error test fails"
                                             : "the iteration does not converge";
  if (r->fixed_steps)
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s; the step of %.6g s may be too large", r->t, reason, h);
  if (status == PW_SINGULAR) return pw_fail (error, PW_METHOD, "t = %.6g s: %s", r->t, reason);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s however small the step (rtol %.3g)", r->t, reason,
                  r->settings.rtol);
}

/* Makes a step of size h to *t1.  If it fails and its beginning or, in leapfrog, its end is near a singular
 * configuration, where the Newton matrix is singular, longer ones are tried, up to `stop`; *t1: the end of the step
 * made. */
static int implicit_step_around (pw_run *r, pw_implicit_step *step, double h, double stop, double *t1) {
  static const double longer[] = { 1.38, 1.76, 2.62 }; /* in units of h; irregular, since configurations may recur */
  int status = step (r, h, *t1);
  for (size_t i = 0; i < sizeof longer / sizeof *longer; i++) {
    double later = r->t + longer[i] * h;
    if ((status != PW_RETRY && status != PW_SINGULAR) || !(later <= stop)) break;
    if (!r->near_singular && !pw_watchdog_near_state (r)) break;
    if (pw_run_stop_requested (r)) return PW_STOPPED;
    r->statistics.rejected++;
    status = step (r, later - r->t, later);
    if (status == PW_OK) *t1 = later;
  }
  return status;
}

int pw_implicit_advance (pw_run *r, double t_end, pw_implicit_step *step, void (*accept) (pw_run *r), pw_error *error) {
  pw_implicit *x = (pw_implicit *)r->data;
  int whole;
  const double end = pw_step_end (r, t_end, &whole);
  double h = whole ? r->settings.step : end - r->t, t1 = end;
  size_t n = (size_t)r->s->coords * sizeof (double);
  int status = whole ? implicit_step_around (r, step, h, fmin (t_end, r->breakpoint), &t1) : step (r, h, t1);
  if (t1 > end) h = t1 - r->t, whole = 0;
  x->last.h = status == PW_OK ? h : 0;
  if (status != PW_OK) return status == PW_STOPPED ? status : pw_implicit_fail (r, status, h, error);
  pw_store_start (&x->last.start, r);
  memcpy (r->q, x->q1, n);
  memcpy (r->v, x->v1, n);
  accept (r);
  r->t = t1;
  pw_dense_output_integrate_ledger (&x->last, r);
  r->statistics.steps++;
  pw_count_step (r, whole, t1);
  return PW_OK;
}
