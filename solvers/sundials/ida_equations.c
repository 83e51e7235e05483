/* The equations of motion as F (t, y, y') = 0, for IDA; y = (q, v, lambda, mu).
 *
 *   none, baumgarte   q' = v,               M v' + J^T lambda = f,   J v' = gamma - 2 alpha (J v - eta) - beta^2 g
 *                     with alpha (J v - eta) alone for nonholonomic equations
 *   index2            q' = v,               M v' + J^T lambda = f,   J v = eta
 *   ggl               q' = v - D G^T mu,    M v' + J^T lambda = f,   J v = eta,   g = 0
 *   si1               q' = v - D G^T mu',   M v' + J^T lambda' = f,  J v = eta,   g = 0
 *
 * with G the rows of J of the holonomic equations, D = 1 for lengths and 1/L^2 for angles, so that mu has one unit
 * (Baumgarte 1972; Gear, Gupta & Leimkuhler 1985; Gear 1988).  In si1 the unknowns lambda and mu are the integrals of
 * the multipliers. */
#include "ida_equations.h"

int pw_ida_update (ida_data *d, double t, const double *y) {
  int status = pw_evaluate_J_at (d->sun.run->w, pw_before_breakpoint (d->sun.run, t), y, y + d->n);
  return status == PW_OK ? 0 : -1;
}

/* ---- Residual ---- */

/* d->given is scratch in the following functions: for n + 3 numbers (forces are added in blocks of 3), then for as many
 * more. */

/* q' - v + D G^T mu */
static void ida_kinematics (ida_data *d, const double *y, const double *yp, double *out) {
  int n = d->n;
  for (int j = 0; j < n; j++) out[j] = yp[j] - y[n + j];
  if (!d->positions) return;
  double *pull = d->given;
  pw_tangent_pull (&d->tangent, pw_ida_lambda (d, y, yp) + d->rows, d->mus, pull);
  for (int j = 0; j < n; j++) out[j] += d->tangent.D[j] * pull[j];
}

/* M v' + J^T lambda - f */
static void ida_momentum (ida_data *d, const double *y, const double *yp, double *out) {
  const pw_system *s = d->sun.run->s;
  int n = d->n;
  double *pull = d->given, *f = pull + n + 3;
  pw_tangent_pull (&d->tangent, pw_ida_lambda (d, y, yp), d->rows, pull);
  pw_evaluate_force (d->sun.run->w, f);
  for (int j = 0; j < n; j++) out[j] = s->mass[j] * yp[n + j] + pull[j] - f[j];
}

/* jv = J v' - gamma + 2 alpha (J v - eta) + beta^2 g, or + alpha (J v - eta) of nonholonomic equations; on entry J v - eta */
static void ida_stabilised (ida_data *d, const double *yp, double *jv, double *other) {
  pw_run *r = d->sun.run;
  const pw_system *s = r->s;
  for (int i = 0; i < s->rows; i++) jv[i] *= (i < s->holonomic ? 2 : 1) * r->alpha;
  pw_mul_J (r->w, yp + d->n, other);
  for (int i = 0; i < s->rows; i++) jv[i] += other[i];
  pw_evaluate_gamma (r->w, other);
  for (int i = 0; i < s->rows; i++) jv[i] -= other[i];
  if (r->beta == 0) return;
  pw_evaluate_g (r->w, other);
  for (int i = 0; i < s->holonomic; i++) jv[i] += r->beta * r->beta * other[i];
}

/* J v - eta, and g; or the stabilised acceleration constraints */
static void ida_constraints (ida_data *d, const double *y, const double *yp, double *out) {
  const pw_system *s = d->sun.run->s;
  double *jv = d->given, *other = jv + s->rows;
  pw_mul_J (d->sun.run->w, y + d->n, jv);
  pw_evaluate_eta (d->sun.run->w, other);
  for (int i = 0; i < s->rows; i++) jv[i] -= other[i];
  if (!d->velocities) ida_stabilised (d, yp, jv, other);
  pw_tangent_compress (&d->tangent, jv, d->rows, out);
  if (!d->positions) return;
  pw_evaluate_g (d->sun.run->w, other);
  pw_tangent_compress (&d->tangent, other, d->mus, out + d->rows);
}

int pw_ida_residual (pw_real t, N_Vector vy, N_Vector vyp, N_Vector out, void *data) {
  ida_data *d = data;
  const double *y = N_VGetArrayPointer (vy), *yp = N_VGetArrayPointer (vyp);
  double *f = N_VGetArrayPointer (out);
  if (pw_run_stop_requested (d->sun.run) || pw_ida_update (d, t, y) != 0) return -1;
  ida_kinematics (d, y, yp, f);
  ida_momentum (d, y, yp, f + d->n);
  ida_constraints (d, y, yp, f + 2 * d->n);
  return 0;
}

/* ---- Newton matrix ---- */

static void ida_matrix_fill (ida_data *d, const double *y, const double *yp, double c) {
  int n = d->n;
  const pw_tangent_layout to = { .momentum = n,
                                 .constraint = 2 * n,
                                 .q = 0,
                                 .v = n,
                                 .a = n,
                                 .lambda = 2 * n,
                                 .mu = 2 * n + d->rows,
                                 .of_q = c,
                                 .of_a = c,
                                 .of_lambda = d->impulses ? c : 1 };
  const double *lambda = pw_ida_lambda (d, y, yp);
  pw_tangent_kinematics (&d->tangent, &to, pw_tangent_mu (&d->tangent, lambda + d->rows, d->mus));
  pw_tangent_momentum (&d->tangent, &to, pw_tangent_lambda (&d->tangent, lambda));
  if (d->velocities)
    pw_tangent_velocities (&d->tangent, &to, y + n, 1);
  else
    pw_tangent_accelerations (&d->tangent, &to, y + n, yp + n);
  if (d->positions) pw_tangent_positions (&d->tangent, &to, 2 * n + d->rows);
}

int pw_ida_matrix (pw_real t, pw_real c, N_Vector vy, N_Vector vyp, N_Vector residual, SUNMatrix matrix, void *data,
                   N_Vector t1, N_Vector t2, N_Vector t3) {
  ida_data *d = data;
  const double *y = N_VGetArrayPointer (vy), *yp = N_VGetArrayPointer (vyp);
  (void)residual, (void)t1, (void)t2, (void)t3;
  if (pw_ida_update (d, t, y) != 0) return -1;
  pw_sun_clear (matrix, d->tangent.colptr, d->tangent.rowind);
  pw_scatter_begin (&d->tangent.scatter, SUNSparseMatrix_Data (matrix));
  ida_matrix_fill (d, y, yp, c);
  pw_matrix_evaluated (d->sun.run, y, y + d->n);
  return 0;
}

int pw_ida_open_matrix (ida_data *d) {
  pw_tangent *x = &d->tangent;
  pw_scatter_record (&x->scatter);
  ida_matrix_fill (d, N_VGetArrayPointer (d->sun.y), N_VGetArrayPointer (d->yp), 1);
  if (pw_scatter_lay_out (&x->scatter, d->size, &x->colptr, &x->rowind) != PW_OK) return PW_RESOURCE;
  return pw_sun_open_matrix (&d->sun, d->size, x->colptr, x->rowind);
}
