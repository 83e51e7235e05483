/* Angles beyond the range of the own sine are left to the general engine.  Returns 1 for these. */
INLINE int configurations (const double *q, const double *v, pw_configuration *c) {
  pw_lanes sine[BODIES / 2 + 1], cosine[BODIES / 2 + 1];
  for (int b = 0; b < BODIES; b++)
    if (!(fabs (q[3 * b + 2]) < PW_SINE_LIMIT)) return 1;
  for (int b = 0; b < BODIES; b += 2)
    pw_sin_cos_lanes ((pw_lanes){ q[3 * b + 2], b + 1 < BODIES ? q[3 * b + 5] : 0 }, &sine[b / 2], &cosine[b / 2]);
  for (int b = 0; b < BODIES; b++, q += 3, v += 3)
    c[b] = (pw_configuration){ q[0], q[1], q[2], cosine[b / 2][b % 2], sine[b / 2][b % 2], v[0], v[1], v[2] };
  c[BODIES] = (pw_configuration){ .cos = 1 };
  return 0;
}

/* offset + amplitude cos (omega t + phase), with derivatives on request. */
INLINE int harmonic (const pw_harmonic *h, double t, int derivatives, double *u) {
  double angle = h->omega * t + h->phase, omega = h->omega;
  pw_lanes sine, cosine;
  if (!(fabs (angle) < PW_SINE_LIMIT)) return 1;
  pw_sin_cos_lanes ((pw_lanes){ angle }, &sine, &cosine);
  u[0] = h->offset + h->amplitude * cosine[0];
  if (!derivatives) return 0;
  u[1] = -h->amplitude * omega * sine[0];
  u[2] = -h->amplitude * omega * omega * cosine[0];
  return 0;
}
