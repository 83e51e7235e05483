/* Second-order blocks, by formulas or by differences.
 *
 * Central differences with step h = eps^(1/3) in units of the scene (more for values above 1, see blocks_step):
 * truncation and round-off are both of the order eps^(2/3) (Dennis & Schnabel 1983, section 5.6). */
#include <math.h>
#include <string.h>
#include "system.h"

/* Each block is the derivative of `original` of the type's table, or of its product with w or lambda.  `function`: the
 * type's function for it; for PW_JTL_Q jw_q, from which blocks_transpose computes the block. */
#define BLOCKS_ENTRY(f, g) .function = offsetof (pw_kind, f), .original = offsetof (pw_kind, g)
static const struct {
  size_t function, original;
  enum { BLOCKS_NONE, BLOCKS_J_W, BLOCKS_JT_LAMBDA } product;
  int velocity; /* 1: derivative with respect to v; 0: to q */
  int square;   /* 1: it has as many rows as local columns; 0: kind->rows */
} blocks_table[PW_BLOCKS] = {
  [PW_JW_Q] = { BLOCKS_ENTRY (jw_q, J), .product = BLOCKS_J_W },
  [PW_JTL_Q] = { BLOCKS_ENTRY (jw_q, J), .product = BLOCKS_JT_LAMBDA, .square = 1 },
  [PW_ETA_Q] = { BLOCKS_ENTRY (eta_q, eta) },
  [PW_GAMMA_Q] = { BLOCKS_ENTRY (gamma_q, gamma) },
  [PW_GAMMA_V] = { BLOCKS_ENTRY (gamma_v, gamma), .velocity = 1 },
  [PW_FORCE_Q] = { BLOCKS_ENTRY (force_q, force), .square = 1 },
  [PW_FORCE_V] = { BLOCKS_ENTRY (force_v, force), .velocity = 1, .square = 1 },
};

pw_batch_function *pw_block_function (const pw_kind *kind, pw_block block) {
  return pw_kind_function (kind, blocks_table[block].function);
}

int pw_block_rows (const pw_kind *kind, pw_block block) {
  return blocks_table[block].square ? 3 * kind->bodies + kind->internal : kind->rows;
}

/* A batch of one element with a copy of its configurations, which can be changed without affecting other elements. */
typedef struct {
  pw_batch b;
  int body[PW_MAX_BODIES];
  pw_configuration configuration[PW_MAX_BODIES];
  double q[PW_MAX_INTERNAL], v[PW_MAX_INTERNAL];
} blocks_single;

static void blocks_isolate (const pw_element_batch *k, int e, blocks_single *one) {
  const pw_kind *kind = k->kind;
  one->b = k->b;
  one->b.count = 1;
  one->b.element = (const char *)k->b.element + (size_t)e * kind->element;
  for (int n = 0; n < kind->bodies; n++) {
    one->configuration[n] = k->b.configuration[k->b.body[e * kind->bodies + n]];
    one->body[n] = n;
  }
  for (int n = 0; n < kind->internal; n++) {
    one->q[n] = k->b.q[e * kind->internal + n];
    one->v[n] = k->b.v[e * kind->internal + n];
  }
  one->b.body = one->body;
  one->b.configuration = one->configuration;
  one->b.q = one->q;
  one->b.v = one->v;
  one->b.u = k->b.u + 3 * e * kind->signals;
  if (k->b.w) one->b.w = k->b.w + e * k->b.cols;
  if (k->b.lambda) one->b.lambda = k->b.lambda + e * kind->rows;
}

/* The coordinate or velocity of local column c. */
static double *blocks_variable (const pw_kind *kind, blocks_single *one, int c, int velocity) {
  if (c >= 3 * kind->bodies) return (velocity ? one->v : one->q) + c - 3 * kind->bodies;
  pw_configuration *p = &one->configuration[c / 3];
  double *const q[] = { &p->x, &p->y, &p->phi }, *const v[] = { &p->vx, &p->vy, &p->omega };
  return velocity ? v[c % 3] : q[c % 3];
}

/* y = the function or product whose derivative the block is. */
static void blocks_value (const pw_kind *kind, pw_block block, blocks_single *one, double *y) {
  pw_batch_function *original = pw_kind_function (kind, blocks_table[block].original);
  int rows = kind->rows, cols = one->b.cols;
  double J[PW_MAX_ROWS * PW_MAX_COLS] = { 0 };
  memset (y, 0, PW_MAX_COLS * sizeof *y);
  for (int n = 0; n < kind->bodies; n++) {
    pw_configuration *p = &one->configuration[n];
    pw_sin_cos (p->phi, &p->sin, &p->cos);
  }
  if (original == NULL) return;
  if (blocks_table[block].product == BLOCKS_NONE) {
    original (&one->b, y);
    return;
  }
  original (&one->b, J);
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < cols; c++) {
      if (blocks_table[block].product == BLOCKS_J_W)
        y[r] += J[r * cols + c] * one->b.w[c];
      else
        y[c] += J[r * cols + c] * one->b.lambda[r];
    }
}

/* The scene's unit of a local column, or of its velocity. */
static double blocks_unit (const pw_workspace *w, const pw_kind *kind, int c, int velocity) {
  double unit = c < 3 * kind->bodies && c % 3 < 2 ? w->scale.length : 1;
  return velocity ? unit / w->scale.time : unit;
}

/* An exactly representable step h that balances truncation, (h / unit)^2, and round-off, eps x / h, eps = 2.3e-16. */
static double blocks_step (const pw_workspace *w, const pw_kind *kind, int c, int velocity, double x) {
  double unit = blocks_unit (w, kind, c, velocity);
  volatile double moved = x + unit * cbrt (2.3e-16 * fmax (1, fabs (x) / unit));
  return moved - x;
}

void pw_difference (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block, double *out) {
  const pw_kind *kind = k->kind;
  int velocity = blocks_table[block].velocity, rows = pw_block_rows (kind, block), cols = k->b.cols;
  blocks_single one;
  blocks_isolate (k, e, &one);
  for (int c = 0; c < cols; c++) {
    double plus[PW_MAX_COLS], minus[PW_MAX_COLS], *x = blocks_variable (kind, &one, c, velocity), x0 = *x;
    double h = blocks_step (w, kind, c, velocity, x0);
    *x = x0 + h;
    blocks_value (kind, block, &one, plus);
    *x = x0 - h;
    blocks_value (kind, block, &one, minus);
    *x = x0;
    int ground = c < 3 * kind->bodies && k->column[e * kind->bodies + c / 3] >= w->s->coords;
    for (int r = 0; r < rows; r++) out[r * cols + c] = ground ? 0 : (plus[r] - minus[r]) / (2 * h);
  }
}

/* A derivative per unit of the variable is taken for 0 if it is at most this part of the function's value; that of a
 * constant function is round-off, eps / h = 4e-11 of the value. */
#define BLOCKS_ZERO 1e-6

int pw_block_missing (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block) {
  double value[PW_MAX_COLS], slope[PW_MAX_COLS * PW_MAX_COLS], most = 0;
  const pw_kind *kind = k->kind;
  int rows = pw_block_rows (kind, block), cols = k->b.cols;
  blocks_single one;
  if (pw_block_function (kind, block) || pw_kind_function (kind, blocks_table[block].original) == NULL) return 0;
  blocks_isolate (k, e, &one);
  blocks_value (kind, block, &one, value);
  for (int r = 0; r < rows; r++) most = fmax (most, fabs (value[r]));
  pw_difference (w, k, e, block, slope);
  for (int i = 0; i < rows * cols; i++)
    if (fabs (slope[i]) * blocks_unit (w, kind, i % cols, blocks_table[block].velocity) > BLOCKS_ZERO * most) return 1;
  return 0;
}

/* Moves an element to an irregular state, with other angle and angular velocity of its body n if `turned`. */
static void blocks_scatter (const pw_workspace *w, const pw_element_batch *k, int e, int n, int turned,
                            blocks_single *one, double *u) {
  const pw_kind *kind = k->kind;
  double L = w->scale.length;
  int i = 1;
  blocks_isolate (k, e, one);
  for (int b = 0; b < kind->bodies; b++) {
    pw_configuration *p = &one->configuration[b];
    double turn = turned && b == n ? 1.1 : 0;
    if (k->column[e * kind->bodies + b] >= w->s->coords) continue;
    p->x = L * pw_sin (2.4 * i++), p->y = L * pw_sin (2.4 * i++), p->phi = pw_sin (2.4 * i++) + turn;
    p->vx = L * pw_sin (2.4 * i++), p->vy = L * pw_sin (2.4 * i++), p->omega = pw_sin (2.4 * i++) + turn;
    pw_sin_cos (p->phi, &p->sin, &p->cos);
  }
  for (int c = 0; c < kind->internal; c++) one->q[c] = pw_sin (2.4 * i++), one->v[c] = pw_sin (2.4 * i++);
  for (int c = 0; c < 3 * kind->signals; c++) u[c] = pw_sin (2.4 * i++);
  one->b.u = u;
}

int pw_uses_angle (const pw_workspace *w, const pw_element_batch *k, int e, int n) {
  const pw_kind *kind = k->kind;
  const int cols = k->b.cols, column = 3 * n + 2;
  const struct {
    pw_batch_function *function;
    int size, width; /* entries; those of each local column in a row, 0: they do not belong to columns */
  } part[] = { { kind->g, kind->rows, 0 },     { kind->eta, kind->rows, 0 },
               { kind->gamma, kind->rows, 0 }, { kind->J, kind->rows * cols, 1 },
               { kind->force, cols, 1 },       { kind->force_u, cols * kind->signals, kind->signals } };
  blocks_single one, other;
  double u[3 * PW_MAX_SIGNALS], x[PW_MAX_COLS * PW_MAX_ROWS], y[PW_MAX_COLS * PW_MAX_ROWS];
  blocks_scatter (w, k, e, n, 0, &one, u);
  blocks_scatter (w, k, e, n, 1, &other, u);
  for (size_t f = 0; f < sizeof part / sizeof *part; f++) {
    if (part[f].function == NULL) continue;
    part[f].function (&one.b, x);
    part[f].function (&other.b, y);
    for (int i = 0; i < part[f].size; i++)
      if (x[i] != y[i] || (part[f].width && i / part[f].width % cols == column && x[i] != 0)) return 1;
  }
  return 0;
}

/* d(J^T lambda)/dq of element e from its d(J w)/dq: entry (r, c) is sum_i lambda_i dJ_ir/dq_c, where w = e_r gives
 * column r of J. */
static void blocks_transpose (const pw_element_batch *k, int e, pw_batch_function *jw_q, double *out) {
  double w[PW_MAX_COLS] = { 0 }, slope[PW_MAX_ROWS * PW_MAX_COLS];
  int cols = k->b.cols;
  blocks_single one;
  blocks_isolate (k, e, &one);
  one.b.w = w;
  memset (out, 0, (size_t)(cols * cols) * sizeof *out);
  for (int r = 0; r < cols; r++) {
    w[r] = 1;
    jw_q (&one.b, slope);
    w[r] = 0;
    for (int i = 0; i < k->kind->rows; i++)
      for (int c = 0; c < cols; c++) out[r * cols + c] += k->b.lambda[e * k->kind->rows + i] * slope[i * cols + c];
  }
}

int pw_evaluate_block (const pw_workspace *w, const pw_element_batch *k, pw_block block, double *out) {
  pw_batch_function *function = pw_block_function (k->kind, block);
  if (function == NULL) return 0;
  if (function != pw_by_differences && block != PW_JTL_Q) {
    function (&k->b, out);
    return 1;
  }
  for (int e = 0, size = pw_block_rows (k->kind, block) * k->b.cols; e < k->b.count; e++, out += size)
    if (function == pw_by_differences)
      pw_difference (w, k, e, block, out);
    else
      blocks_transpose (k, e, function, out);
  return 1;
}

void pw_by_differences (const pw_batch *b, double *out) {
  (void)b; /* only its address is used */
  (void)out;
}
