/* L D L^T by rows within the skyline of a matrix, which it does not leave (Jennings 1966, A compact storage scheme for the
 * solution of symmetric linear simultaneous equations), two rows and two columns at a time:
 *
 *   c_ij = S_ij - sum_{b <= k < j} c_ik L_jk,   b = max (begin_i, begin_j),   L_ij = c_ij / d_j,   d_i = S_ii - sum_j c_ij L_ij
 *   i, i + 1:  det = d_i s - c c,   1 / d_{i+1} = d_i / det,    c = c_{i+1 i},  s = S_{i+1 i+1} - sum_{j < i} ... */
#include "skyline.h"

/* The row a pair begins with. */
static int skyline_pair (int i, int n) {
  return i - ((i ^ n) & 1);
}

void pw_skyline_open (int *begin, int n) {
  for (int i = n & 1; i < n; i += 2) {
    int first = begin[i] < begin[i + 1] ? begin[i] : begin[i + 1];
    first = skyline_pair (first, n);
    begin[i] = begin[i + 1] = first < 0 ? 0 : first;
  }
}

/* What is left of rows i and i + 1 in columns b to i - 1, in place of their L. */
static void skyline_rows (const double *S, double *L, const int *begin, int i, int n) {
  int j = begin[i], b = j;
  const double *s = S + i * n;
  double *c = L + i * n, *e = c + n;
  if (j == 0 && n & 1) c[0] = s[0], e[0] = s[n], j = 1;
  for (; j < i; j += 2) {
    const double *l = L + j * n, *m = l + n;
    double cl = s[j], cm = s[j + 1], el = s[n + j], em = s[n + j + 1];
    for (int k = begin[j] > b ? begin[j] : b; k < j; k++) {
      cl -= c[k] * l[k], cm -= c[k] * m[k];
      el -= e[k] * l[k], em -= e[k] * m[k];
    }
    c[j] = cl, c[j + 1] = cm - cl * m[j];
    e[j] = el, e[j + 1] = em - el * m[j];
  }
}

int pw_skyline_factor (const double *S, double *L, const int *begin, double least, int n) {
  int good = 1;
  if (n & 1) L[0] = 1 / S[0], good = S[0] > least * S[0];
  for (int i = n & 1; i < n; i += 2) {
    double *c = L + i * n, *e = c + n;
    const double S0 = S[i * n + i], S1 = S[(i + 1) * n + i + 1];
    double d = S0, off = S[(i + 1) * n + i], s = S1;
    skyline_rows (S, L, begin, i, n);
    for (int j = begin[i]; j < i; j++) {
      double l = c[j] * L[j * n + j], m = e[j] * L[j * n + j];
      d -= c[j] * l, off -= e[j] * l, s -= e[j] * m;
      c[j] = l, e[j] = m;
    }
    double det = d * s - off * off;
    c[i] = 1 / d;
    e[i] = off * c[i];
    e[i + 1] = d / det;
    good &= d > least * S0 && det > least * (d * S1);
  }
  return good;
}

void pw_skyline_solve (const double *L, const int *begin, double *y, int n) {
  for (int i = n & 1; i < n; i += 2) {
    const double *l = L + i * n, *m = l + n;
    double y0 = y[i], y1 = y[i + 1];
    for (int j = begin[i]; j < i; j++) y0 -= l[j] * y[j], y1 -= m[j] * y[j];
    y[i] = y0;
    y[i + 1] = y1 - m[i] * y0;
  }
  for (int i = 0; i < n; i++) y[i] *= L[i * n + i];
  for (int i = n - 2; i >= 0; i -= 2) {
    const double *l = L + i * n, *m = l + n;
    double y1 = y[i + 1], y0 = y[i] - m[i] * y1;
    y[i] = y0;
    for (int j = begin[i]; j < i; j++) y[j] -= l[j] * y0 + m[j] * y1;
  }
}
