/* Evaluation of all batches, and products with J. */
#include <math.h>
#include <string.h>
#include "system.h"

void pw_evaluate_J (pw_workspace *w) {
  PW_EACH_CONSTRAINT (k, w) k->kind->J (&k->b, k->J);
}

/* Fills an array over constraint equations by the function at this offset of each type's table; NULL gives zeros. */
static void evaluate_rows (pw_workspace *w, size_t function, int rows, double *out) {
  PW_EACH_CONSTRAINT (k, w) {
    if (k->row >= rows) break;
    pw_batch_function *f = pw_kind_function (k->kind, function);
    if (f)
      f (&k->b, out + k->row);
    else
      for (int i = k->row; i < k->row + k->b.count * k->kind->rows; i++) out[i] = 0;
  }
}

void pw_evaluate_g (pw_workspace *w, double *g) {
  evaluate_rows (w, offsetof (pw_kind, g), w->s->holonomic, g);
}

void pw_evaluate_g_size (pw_workspace *w, double *size) {
  evaluate_rows (w, offsetof (pw_kind, g_size), w->s->holonomic, size);
  for (int i = 0; i < w->s->holonomic; i++) size[i] = pw_larger (size[i], w->scale.length);
}

void pw_evaluate_eta (pw_workspace *w, double *eta) {
  evaluate_rows (w, offsetof (pw_kind, eta), w->s->rows, eta);
}

void pw_evaluate_gamma (pw_workspace *w, double *gamma) {
  evaluate_rows (w, offsetof (pw_kind, gamma), w->s->rows, gamma);
}

/* Adds the forces that are constant, or the others. */
static void evaluate_add_forces (const pw_workspace *w, int constant, double *f) {
  PW_EACH_BATCH (k, w) {
    if (k->kind->force == NULL || (k->kind->constant != 0) != constant) continue;
    const double *block = k->block;
    const int *column = k->column;
    double *internal = f + k->internal;
    k->kind->force (&k->b, k->block);
    for (int e = 0; e < k->b.count; e++) {
      for (int n = 0; n < k->kind->bodies; n++, column++, block += 3) {
        f[*column] += block[0];
        f[*column + 1] += block[1];
        f[*column + 2] += block[2];
      }
      for (int n = 0; n < k->kind->internal; n++) *internal++ += *block++;
    }
  }
}

void pw_evaluate_force (pw_workspace *w, double *f) {
  memcpy (f, w->s->constant, (size_t)w->s->coords * sizeof *f);
  evaluate_add_forces (w, 0, f);
}

void pw_evaluate_constant (pw_workspace *w, double *f) {
  evaluate_add_forces (w, 1, f);
}

double pw_potential (pw_workspace *w) {
  double sum = 0;
  PW_EACH_BATCH (k, w) {
    if (k->kind->energy == NULL) continue;
    k->kind->energy (&k->b, k->block);
    for (int e = 0; e < k->b.count; e++) sum += k->block[e];
  }
  return sum;
}

double pw_kinetic (const pw_system *s, const double *v) {
  double sum = 0;
  for (int j = 0; j < s->coords; j++) sum += s->M[j] * v[j] * v[j];
  return sum / 2;
}

void pw_mul_J (const pw_workspace *w, const double *x, double *out) {
  static const double ground[3] = { 0, 0, 0 };
  PW_EACH_CONSTRAINT (k, w) {
    const double *J = k->J, *X[PW_MAX_BODIES], *y = x + k->internal; /* entries of x: of each body, internal */
    const int bodies = k->kind->bodies, internal = k->kind->internal, *column = k->column;
    for (int e = 0; e < k->b.count; e++, column += bodies, y += internal) {
      for (int n = 0; n < bodies; n++) X[n] = column[n] < w->s->coords ? x + column[n] : ground;
      for (int r = 0; r < k->kind->rows; r++) {
        double sum = 0;
        for (int n = 0; n < bodies; n++, J += 3) sum += J[0] * X[n][0] + J[1] * X[n][1] + J[2] * X[n][2];
        for (int n = 0; n < internal; n++) sum += *J++ * y[n];
        *out++ = sum;
      }
    }
  }
}

void pw_add_JT (const pw_workspace *w, const double *lambda, double *out) {
  PW_EACH_CONSTRAINT (k, w) {
    const double *J = k->J;
    for (int e = 0; e < k->b.count; e++)
      for (int r = 0; r < k->kind->rows; r++, lambda++) {
        for (int n = 0; n < k->kind->bodies; n++, J += 3) {
          double *to = out + k->column[e * k->kind->bodies + n];
          to[0] += J[0] * *lambda;
          to[1] += J[1] * *lambda;
          to[2] += J[2] * *lambda;
        }
        for (int n = 0; n < k->kind->internal; n++) out[k->internal + e * k->kind->internal + n] += *J++ * *lambda;
      }
  }
}

/* Updates the largest scaled and absolute residual, and the constraint equation of the former.  NaN is the largest,
 * hence the negated comparisons. */
static inline void evaluate_update_worst (int i, double residual, double size, double *scaled, double *largest,
                                          int *row) {
  double error = fabs (residual), ratio = error / size;
  if (!(error <= *largest) && !isnan (*largest)) *largest = error;
  if (!(ratio <= *scaled) && !isnan (*scaled)) *scaled = ratio, *row = i;
}

void pw_worst_position (const pw_system *s, const double *g, const double *size, const unsigned char *enforced,
                        pw_residuals *r) {
  r->position = r->g = 0, r->row_position = -1;
  for (int i = 0; i < s->holonomic; i++)
    if (enforced == NULL || enforced[i])
      evaluate_update_worst (i, g[i], size[i], &r->position, &r->g, &r->row_position);
}

/* Updates the worst residual J v - eta with a batch; eta NULL: zero; unit: L / T of a run. */
static void evaluate_worst_velocity (const pw_element_batch *k, const double *eta, const unsigned char *enforced,
                                     double unit, pw_residuals *worst) {
  const double *J = k->J, *rate = k->b.v;
  const int bodies = k->kind->bodies, internal = k->kind->internal, *body = k->b.body;
  int i = k->row;
  for (int e = 0; e < k->b.count; e++, body += bodies, rate += internal)
    for (int r = 0; r < k->kind->rows; r++, i++) {
      double sum = 0, size = 0;
      for (int n = 0; n < bodies; n++, J += 3) {
        const pw_configuration *p = &k->b.configuration[body[n]];
        double x = J[0] * p->vx, y = J[1] * p->vy, phi = J[2] * p->omega; /* terms of J v */
        sum += x + y + phi;
        size += fabs (x) + fabs (y) + fabs (phi);
      }
      for (int n = 0; n < internal; n++) {
        double term = *J++ * rate[n];
        sum += term;
        size += fabs (term);
      }
      if (eta) sum -= eta[i], size += fabs (eta[i]);
      if (enforced == NULL || enforced[i])
        evaluate_update_worst (i, sum, size + unit, &worst->velocity, &worst->jv, &worst->row_velocity);
    }
}

void pw_evaluate_velocity_residual (pw_workspace *w, const unsigned char *enforced, pw_residuals *r) {
  double *eta = w->s->rheonomic ? w->scratch : NULL, unit = w->scale.length / w->scale.time;
  r->velocity = r->jv = 0, r->row_velocity = -1;
  if (eta) pw_evaluate_eta (w, eta);
  PW_EACH_CONSTRAINT (k, w) evaluate_worst_velocity (k, eta, enforced, unit, r);
}

void pw_evaluate_position_residual (pw_workspace *w, const unsigned char *enforced, pw_residuals *r) {
  double *value = w->scratch, *size = value + w->s->rows;
  pw_evaluate_g (w, value);
  pw_evaluate_g_size (w, size);
  pw_worst_position (w->s, value, size, enforced, r);
}

void pw_evaluate_residuals (pw_workspace *w, const unsigned char *enforced, pw_residuals *r) {
  pw_evaluate_position_residual (w, enforced, r);
  pw_evaluate_velocity_residual (w, enforced, r);
}
