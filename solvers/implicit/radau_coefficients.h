/* Coefficients of the Radau IIA method of order 5 (Hairer & Wanner 1996, section IV.8), for radau and for derivatives
 * of runs; A and gamma were computed with 60 digits from the nodes c. */
#ifndef PW_RADAU_COEFFICIENTS_H
#define PW_RADAU_COEFFICIENTS_H

enum { PW_RADAU_STAGES = 3 };

static const double radau_c[PW_RADAU_STAGES] = { 0.15505102572168219018, 0.64494897427831780982, 1 };
static const double radau_A[PW_RADAU_STAGES][PW_RADAU_STAGES] = {
  { 0.19681547722366042587, -0.06553542585019838811, 0.02377097434822015242 },
  { 0.39442431473908727700, 0.29207341166522846302, -0.04154875212599793020 },
  { 0.37640306270046727505, 0.51248582618842161384, 0.11111111111111111111 },
};
/* The real eigenvalue of A^-1, and the weights of the stages in the error estimate. */
static const double radau_gamma = 3.63783425274449573221;
static const double radau_e[PW_RADAU_STAGES] = { -10.04880939982741556, 1.38214273316074889, -1. / 3 };

#endif
