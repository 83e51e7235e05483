/* Elements: their properties, contact points and forces; the equations of motion. */
#include <stdlib.h>
#include <string.h>
#include "system.h"

int pw_system_elements (const pw_system *s) {
  int count = 0;
  for (int i = 0; i < s->batches; i++) count += s->batch[i].b.count;
  return count;
}

pw_element_info pw_system_element (const pw_system *s, int element) {
  pw_element_info info = { .contact = 0 };
  const pw_element_batch *k = s->batch;
  for (; element >= k->b.count; element -= k++->b.count) {
    info.contact += k->kind->contact ? k->b.count : 0;
    info.force += 3 * k->b.count * k->kind->bodies;
  }
  info.kind = k->kind;
  info.name = k->name[element];
  info.body = k->b.body + element * k->kind->bodies;
  info.row = k->row + element * k->kind->rows;
  info.coordinate = k->internal + element * k->kind->internal;
  info.contact = k->kind->contact ? info.contact + element : -1;
  info.force += 3 * element * k->kind->bodies;
  return info;
}

static int elements_update (pw_workspace *w, double t, const double *q, const double *v, pw_error *error) {
  if (pw_require (w, "a workspace", error) != PW_OK) return PW_INPUT;
  return pw_update_kinematics (w, t, q, v) == PW_OK ? PW_OK : pw_fail_evaluation (w, t, error);
}

/* ---- Contact points ---- */

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

int pw_workspace_contact_points (pw_workspace *w, double t, const double *q, const double *v, double (*out)[3],
                                 pw_error *error) {
  int status = elements_update (w, t, q, v, error);
  if (status != PW_OK) return status;
  PW_EACH_BATCH (k, w) {
    if (k->kind->contact == NULL) continue;
    k->kind->contact (&k->b, out[0]);
    out += k->b.count;
  }
  return PW_OK;
}

/* ---- Forces ---- */

/* F -= J^T lambda of each element, only the columns of bodies. */
static void elements_reactions (const pw_element_batch *k, const double *lambda, double *F) {
  const double *J = k->J;
  int cols = 3 * k->kind->bodies;
  for (int e = 0; e < k->b.count; e++, F += cols)
    for (int i = 0; i < k->kind->rows; i++, J += k->b.cols, lambda++)
      for (int c = 0; c < cols; c++) F[c] -= J[c] * *lambda;
}

/* F += the force of each element, only the components of bodies. */
static void elements_applied (const pw_element_batch *k, double *F) {
  int cols = 3 * k->kind->bodies;
  k->kind->force (&k->b, k->block);
  for (int e = 0; e < k->b.count; e++, F += cols)
    for (int c = 0; c < cols; c++) F[c] += k->block[e * k->b.cols + c];
}

int pw_system_force_size (const pw_system *s) {
  int size = 0;
  for (int i = 0; i < s->batches; i++) size += 3 * s->batch[i].b.count * s->batch[i].kind->bodies;
  return size;
}

int pw_workspace_forces (pw_workspace *w, double t, const double *q, const double *v, const double *lambda, double *out,
                         pw_error *error) {
  int status = elements_update (w, t, q, v, error);
  if (status != PW_OK) return status;
  memset (out, 0, (size_t)pw_system_force_size (w->s) * sizeof *out);
  pw_evaluate_J (w);
  PW_EACH_BATCH (k, w) {
    if (k->kind->rows) elements_reactions (k, lambda + k->row, out);
    if (k->kind->force) elements_applied (k, out);
    out += 3 * k->b.count * k->kind->bodies;
  }
  return PW_OK;
}

/* ---- Equations ---- */

static int elements_allocate (const pw_system *s, pw_equations *out, pw_error *error) {
  size_t n = (size_t)s->coords, rows = (size_t)s->rows;
  double *indices;
  const pw_array array[] = { { &out->mass, n },      /* first: it is what pw_equations_free frees */
                             { &out->force, n + 3 }, /* three more entries: the ground's */
                             { &out->g, rows },        { &out->eta, rows },
                             { &out->gamma, rows },    { &out->value, s->jacobian },
                             { &indices, s->jacobian } }; /* two indices fit in one double */
  out->coordinates = s->coords, out->rows = s->rows, out->holonomic = s->holonomic;
  if (pw_alloc_arrays (array, sizeof array / sizeof *array) == NULL) return pw_fail_memory (s, error);
  out->row = (int *)(void *)indices;
  out->column = out->row + s->jacobian;
  return PW_OK;
}

/* Stores the entries of J that are not in columns of the ground. */
static void elements_jacobian (const pw_workspace *w, pw_equations *out) {
  PW_EACH_CONSTRAINT (k, w)
    for (int i = 0; i < k->b.count * k->kind->rows; i++)
      for (int c = 0; c < k->b.cols; c++) {
        int column = pw_global (k, i / k->kind->rows, c);
        if (column >= w->s->coords) continue;
        out->row[out->entries] = k->row + i;
        out->column[out->entries] = column;
        out->value[out->entries++] = k->J[i * k->b.cols + c];
      }
}

static int elements_evaluate (pw_workspace *w, double t, const double *q, const double *v, pw_equations *out,
                              pw_error *error) {
  if (elements_update (w, t, q, v, error) != PW_OK) return PW_METHOD;
  pw_evaluate_J (w);
  elements_jacobian (w, out);
  memcpy (out->mass, w->s->M, (size_t)w->s->coords * sizeof *out->mass);
  pw_evaluate_force (w, out->force);
  pw_evaluate_g (w, out->g);
  pw_evaluate_eta (w, out->eta);
  pw_evaluate_gamma (w, out->gamma);
  return PW_OK;
}

int pw_system_equations (const pw_system *s, double t, const double *q, const double *v, pw_equations *out,
                         pw_error *error) {
  *out = (pw_equations){ .rows = 0 };
  pw_workspace *w = pw_workspace_new (s, error);
  int status = w ? elements_allocate (s, out, error) : s ? PW_RESOURCE : PW_INPUT;
  if (status == PW_OK) status = elements_evaluate (w, t, q, v, out, error);
  pw_workspace_free (w);
  return status;
}

void pw_equations_free (pw_equations *e) {
  free (e->mass);
  *e = (pw_equations){ .rows = 0 };
}
