static inline double larger (double a, double b) {
  return a > b ? a : b;
}

/* For constants: all entries of J that do not change, at an arbitrary state. */
static void reference_jacobian (const pw_scene *s, double *J) {
  double zero[N + 3] = { 0 };
  pw_configuration c[BODIES + 1];
  configurations (zero, zero, c);
  jacobian (s, c, zero, zero, J);
}

INLINE void store (const pw_configuration *c, const double *J, pw_configuration *to_c, double *to_J) {
  if (to_c == NULL) return;
  memcpy (to_c, c, BODIES * sizeof *c);
  memcpy (to_J, J, ENTRIES * sizeof *J);
}

/* 1 unless the squares of all numbers are finite. */
INLINE int is_not_finite (int n, const double *x) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * x[i];
  return !(sum < 1e300);
}

static int evaluate (pw_scene *s, double t, const double *q, const double *v, double *a, double *lambda, double *rate,
                     pw_configuration *to_c, double *to_J) {
  pw_configuration c[BODIES + 1];
  double J[ENTRIES + 1], F[FACTORS], f[N + 3], g[ROWS + 1];
  if (configurations (q, v, c) || signals (s, t, q, v)) return 1;
  jacobian (s, c, q, v, J);
  if (factor (s->mass, s->constant, J, F)) return 1;
  gammas (s, c, q, v, g);
  forces (s, c, q, v, f);
  solve (s->constant, J, F, f, g, a, lambda);
  if (LEDGER && rate) ledger (s, c, q, v, lambda, rate);
  store (c, J, to_c, to_J);
  return is_not_finite (N, a);
}

/* Residuals below which an iteration has converged, or may stall; see projection in the general engine. */
#define GOOD 0x4p-52
#define ENOUGH 0x40p-52

/* Gauss-Newton iteration on g(q) = 0, with the smallest change in the metric of M. */
INLINE int positions (pw_scene *s, double *q, const double *v, pw_configuration *c, double *J) {
  double g[ROWS + 1] = { 0 }, size[HOLONOMIC + 1], F[FACTORS], d[N + 3], before = INFINITY;
  for (s->iterations = 0;; s->iterations++) {
    double worst = 0, most = 0;
    if (configurations (q, v, c)) return 1;
    constraints (s, c, q, v, g);
    if (!(before < 1e-6)) {
      sizes (s, c, q, v, size);
      for (int i = 0; i < HOLONOMIC; i++) size[i] = 1 / larger (size[i], s->length);
    }
    for (int i = 0; i < HOLONOMIC; i++) {
      worst = larger (fabs (g[i]) * size[i], worst);
      most = larger (fabs (g[i]), most);
    }
    s->position = worst, s->g = most;
    if (is_not_finite (HOLONOMIC, g)) return 1;
    if (worst <= GOOD || (worst > before / 4 && worst <= ENOUGH)) return 0;
    if (s->iterations >= 30) return 1;
    before = worst;
    jacobian (s, c, q, v, J);
    if (factor_position (s->mass, s->constant, J, F)) return 1;
    for (int i = 0; i < HOLONOMIC; i++) g[i] = -g[i];
    solve_position (s->constant, J, F, g, d);
    for (int j = 0; j < N; j++) q[j] += d[j];
  }
}

/* right = eta - J v, and its scaled and absolute maximum. */
INLINE void velocity_residual (pw_scene *s, const pw_configuration *c, const double *q, const double *v,
                               const double *J, double *right) {
  double size[ROWS + 1], eta[ROWS + 1], worst = 0, most = 0;
  product (J, v, right, size);
  if (RHEONOMIC) {
    right_sides (s, c, q, v, eta);
    for (int i = 0; i < ROWS; i++) right[i] -= eta[i], size[i] += fabs (eta[i]);
  }
  for (int i = 0; i < ROWS; i++) {
    right[i] = -right[i];
    worst = larger (fabs (right[i]) / (size[i] + s->speed), worst);
    most = larger (fabs (right[i]), most);
  }
  s->velocity = worst, s->jv = most;
}

/* Velocities with J v = eta, unless they satisfy it to round-off already. */
INLINE void velocities (pw_scene *s, double *v, pw_configuration *c, const double *q, const double *J,
                        const double *F) {
  double right[ROWS + 1], d[N + 3];
  velocity_residual (s, c, q, v, J, right);
  if (s->velocity <= GOOD) return;
  solve_velocity (s->constant, J, F, right, d);
  for (int j = 0; j < N; j++) v[j] += d[j];
  for (int b = 0; b < BODIES; b++) c[b].vx = v[3 * b], c[b].vy = v[3 * b + 1], c[b].omega = v[3 * b + 2];
  velocity_residual (s, c, q, v, J, right);
}

static int project (pw_scene *s, double t, double *q, double *v, double *a, double *lambda, pw_configuration *to_c,
                    double *to_J) {
  pw_configuration c[BODIES + 1];
  double J[ENTRIES + 1], F[FACTORS], f[N + 3], g[ROWS + 1], Q[N + 3], V[N + 3];
  memcpy (Q, q, N * sizeof *q);
  memcpy (V, v, N * sizeof *v);
  if (signals (s, t, Q, V) || positions (s, Q, V, c, J)) return 1;
  jacobian (s, c, Q, V, J);
  if (factor (s->mass, s->constant, J, F)) return 1;
  velocities (s, V, c, Q, J, F);
  if (READERS && signals (s, t, Q, V)) return 1;
  gammas (s, c, Q, V, g);
  forces (s, c, Q, V, f);
  solve (s->constant, J, F, f, g, a, lambda);
  if (is_not_finite (N, a) || is_not_finite (N, V)) return 1;
  memcpy (q, Q, N * sizeof *q);
  memcpy (v, V, N * sizeof *v);
  store (c, J, to_c, to_J);
  return 0;
}
