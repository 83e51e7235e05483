/* Newton's iteration for BDF: (I - gamma df/dy) x = b without forming the dense df/dy.
 *
 * y = (q, v), y' = (v, a), and gamma is CVODES' coefficient of the step.  With T = (T_q, T_v, T_a, T_lambda), the
 * sparse derivatives of the equations of motion (tangent.c), a change of the state changes a and lambda so that T (dq,
 * dv, da, dlambda) = 0.  With
 *
 *   x_q = b_q + gamma x_v,   x_v = b_v + gamma da
 *
 * only da and dlambda are unknown, with a matrix like that of the accelerations:
 *
 *   (T_a + gamma T_v + gamma^2 T_q) da + T_lambda dlambda = - T_q (b_q + gamma b_v) - T_v b_v
 *
 * T is evaluated when CVODES asks for a new Jacobian; gamma changes more often. */
#include <stdlib.h>
#include <string.h>
#include <cvodes/cvodes.h>
#include "bdf_newton.h"

int pw_multistep_accelerate (pw_method_data *d, double t, const double *y) {
  pw_run *r = d->sun.run;
  int status = pw_run_accelerate (r, pw_before_breakpoint (r, t), y, y + d->n, d->a, d->lambda);
  return status == PW_OK ? 0 : status > 0 ? 1 : -1;
}

/* Adds all entries of T, in the columns q, v, a, lambda. */
static void newton_fill_T (pw_method_data *d) {
  int n = d->n;
  const pw_tangent_layout to = {
    .momentum = 0, .constraint = n, .q = 0, .v = n, .a = 2 * n, .lambda = 3 * n, .a_factor = 1, .lambda_factor = 1
  };
  pw_tangent_add_momentum (&d->newton.tangent, &to, d->lambda);
  pw_tangent_add_accelerations (&d->newton.tangent, &to, d->v, d->a);
}

/* Adds all entries of the matrix (T_a + gamma T_v + gamma^2 T_q, T_lambda) from those of T. */
static void newton_fill_matrix (pw_bdf_newton *w, int n) {
  const pw_scatter_map *T = &w->tangent.scatter;
  const double power[] = { w->gamma * w->gamma, w->gamma, 1 };
  for (int c = 0; c < 3 * n + w->tangent.rows; c++) {
    int part = c < 2 * n ? c / n : 2, column = c < 2 * n ? c % n : c - 2 * n; /* parts: q; v; a and lambda */
    for (int64_t i = T->colptr[c]; i < T->colptr[c + 1]; i++)
      pw_scatter_add (&w->scatter, (int)T->rowind[i], column, w->scatter.recording ? 0 : power[part] * T->value[i]);
  }
}

/* Called by CVODES: evaluates T, unless CVODES proposes to `reuse` the last one and that is still valid, then forms the
 * matrix with gamma.  *evaluated: 1 if T was evaluated. */
static int newton_set_up (realtype t, N_Vector y, N_Vector derivative, SUNMatrix matrix, booleantype reuse,
                          booleantype *evaluated, realtype gamma, void *data, N_Vector tmp1, N_Vector tmp2,
                          N_Vector tmp3) {
  pw_method_data *d = data;
  pw_bdf_newton *w = &d->newton;
  (void)derivative, (void)matrix, (void)tmp1, (void)tmp2, (void)tmp3;
  *evaluated = !reuse || d->sun.run->matrix_outdated;
  if (*evaluated) {
    int status = pw_multistep_accelerate (d, t, N_VGetArrayPointer (y));
    if (status != 0) return status;
    memcpy (d->v, N_VGetArrayPointer (y) + d->n, (size_t)d->n * sizeof *d->v);
    pw_scatter_begin_fill (&w->tangent.scatter, w->tangent.scatter.value);
    newton_fill_T (d);
    pw_matrix_evaluated (d->sun.run, N_VGetArrayPointer (y), d->v);
    d->sun.run->statistics.jacobians++;
  }
  w->gamma = gamma;
  pw_scatter_begin_fill (&w->scatter, w->scatter.value);
  newton_fill_matrix (w, d->n);
  d->sun.run->statistics.factorisations++; /* CVODES factorises next */
  return 0;
}

/* ---- Solving for x ---- */

/* right = - T_q (b_q + gamma b_v) - T_v b_v */
static void newton_right_side (const pw_method_data *d, const double *b, double *right) {
  const pw_bdf_newton *w = &d->newton;
  const pw_scatter_map *T = &w->tangent.scatter;
  int n = d->n;
  memset (right, 0, (size_t)(n + w->tangent.rows) * sizeof *right);
  for (int c = 0; c < 2 * n; c++) {
    double factor = c < n ? b[c] + w->gamma * b[n + c] : b[c];
    for (int64_t i = T->colptr[c]; i < T->colptr[c + 1]; i++) right[T->rowind[i]] -= T->value[i] * factor;
  }
}

static int newton_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector vx, N_Vector vb, realtype tolerance) {
  pw_method_data *d = solver->content;
  pw_bdf_newton *w = &d->newton;
  const double *b = N_VGetArrayPointer (vb), *da = w->right;
  double *x = N_VGetArrayPointer (vx);
  int n = d->n;
  (void)matrix, (void)tolerance;
  if (d->sun.run->matrix_outdated) return SUNLS_PACKAGE_FAIL_REC; /* CVODES then requests a new matrix */
  newton_right_side (d, b, w->right);
  if (pw_sparse_solve (&d->sun.sparse, w->right) != PW_OK) return SUNLS_PACKAGE_FAIL_UNREC;
  for (int j = 0; j < n; j++) {
    x[n + j] = b[n + j] + w->gamma * da[j];
    x[j] = b[j] + w->gamma * x[n + j];
  }
  return SUNLS_SUCCESS;
}

/* ---- Opening ---- */

/* Records the patterns of T and of the matrix; there are no values yet. */
static int newton_lay_out (pw_method_data *d) {
  pw_bdf_newton *w = &d->newton;
  pw_tangent *x = &w->tangent;
  int columns = 3 * d->n + x->rows, size = d->n + x->rows;
  pw_scatter_begin_record (&x->scatter);
  newton_fill_T (d);
  if (pw_scatter_lay_out (&x->scatter, columns) != PW_OK) return PW_RESOURCE;
  pw_scatter_begin_record (&w->scatter);
  newton_fill_matrix (w, d->n);
  return pw_scatter_lay_out (&w->scatter, size);
}

int pw_bdf_open_newton (pw_method_data *d) {
  pw_bdf_newton *w = &d->newton;
  pw_sun *x = &d->sun;
  if (pw_tangent_open (&w->tangent, x->run) != PW_OK || newton_lay_out (d) != PW_OK ||
      pw_sun_open_solver (x, d->n + w->tangent.rows, &w->scatter, d, newton_solve) != PW_OK)
    return PW_RESOURCE;
  int failed = CVodeSetLinearSolver (d->cvode, x->solver, x->matrix) || CVodeSetLinSysFn (d->cvode, newton_set_up);
  return failed ? PW_RESOURCE : PW_OK;
}

void pw_bdf_close_newton (pw_method_data *d) {
  pw_scatter_close (&d->newton.scatter);
  pw_tangent_close (&d->newton.tangent);
}
