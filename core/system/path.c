/* Paths: polylines and cubic splines through points, arc lengths, nearest places.
 *
 * A path is a list of pieces, p(u) = a0 + a1 u + a2 u^2 + a3 u^3 with u from 0 to 1: lines, or the cubics of two tables
 * x(l), y(l) (signal.c) of the accumulated distance l of the points.  Where a cubic turns much or its arc length is not
 * obtained to round-off by Gauss's rule, it is halved, so that the direction of a piece stays within 37 degrees.
 *
 * The nearest place is a minimum of the distance from P, where f = (p - P) . p' changes its sign from - to +.  The
 * signs of the coefficients of f in the basis of Bernstein polynomials of degree 5 change at least as often as f does:
 * halving isolates the roots (Farin 2002, Curves and Surfaces for CAGD, chapter 5).  A tree of boxes around pieces
 * leaves out most of them. */
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include "system.h"

typedef struct {
  double x[4], y[4];       /* coefficients of u^0 ... u^3 [m] */
  double s, heading, size; /* arc length and direction at its beginning; its own arc length */
} piece;

typedef struct {
  double lo[2], hi[2];
} box;

struct pw_path {
  atomic_int users;
  int pieces, closed, is_linear;
  int leaves;          /* a power of two: least one >= pieces */
  double length, turn; /* arc length; change of direction of one lap */
  piece *piece;
  box *box; /* 2 leaves: box k contains boxes 2 k and 2 k + 1; box leaves + i: piece i */
};

/* ---- Pieces ---- */

/* Value and first three derivatives by u of one component. */
static inline void piece_component (const double a[4], double u, double out[4]) {
  out[0] = a[0] + u * (a[1] + u * (a[2] + u * a[3]));
  out[1] = a[1] + u * (2 * a[2] + 3 * u * a[3]);
  out[2] = 2 * a[2] + 6 * u * a[3];
  out[3] = 6 * a[3];
}

/* The arc length from u = 0 to u, by Gauss's rule of 8 points (Abramowitz & Stegun 1964, table 25.4). */
static double piece_length (const piece *c, double u) {
  static const double node[] = { 0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363 },
                      weight[] = { 0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763 };
  double sum = 0;
  for (int i = 0; i < 8; i++) {
    double at = u / 2 * (1 + (i < 4 ? node[i] : -node[i - 4]));
    double x = c->x[1] + at * (2 * c->x[2] + 3 * at * c->x[3]), y = c->y[1] + at * (2 * c->y[2] + 3 * at * c->y[3]);
    sum += weight[i % 4] * sqrt (x * x + y * y);
  }
  return u / 2 * sum;
}

/* The parameter at an arc length from the beginning of the piece, by Newton's method. */
static double piece_parameter (const piece *c, double s) {
  double u = s / c->size;
  for (int i = 0; i < 20 && u > 0 && u < 1; i++) {
    double x[4], y[4], last = u;
    piece_component (c->x, u, x);
    piece_component (c->y, u, y);
    u = fmin (1, fmax (0, u - (piece_length (c, u) - s) / hypot (x[1], y[1])));
    if (fabs (u - last) <= 1e-15) break;
  }
  return fmin (1, fmax (0, u));
}

/* The two halves of one component. */
static void piece_halve (const double a[4], double first[4], double second[4]) {
  double d[4];
  piece_component (a, 0.5, d);
  for (int i = 0; i < 4; i++) first[i] = ldexp (a[i], -i), second[i] = ldexp (d[i], -i) / (i == 3 ? 6 : i == 2 ? 2 : 1);
}

/* Bezier's control points of the derivative of a component. */
static inline void piece_hodograph (const double a[4], double d[3]) {
  d[0] = a[1], d[1] = a[1] + a[2], d[2] = a[1] + 2 * a[2] + 3 * a[3];
}

/* 1 if all directions are within 37 degrees of that of the chord, and halves have the same arc length to round-off. */
static int piece_is_good (const piece *c) {
  double x[3], y[3];
  piece first = { .s = 0 }, second = first;
  piece_hodograph (c->x, x);
  piece_hodograph (c->y, y);
  double cx = (x[0] + x[1] + x[2]) / 3, cy = (y[0] + y[1] + y[2]) / 3, chord = hypot (cx, cy);
  for (int i = 0; i < 3; i++) {
    double along = x[i] * cx + y[i] * cy;
    if (!(along > 0.8 * chord * hypot (x[i], y[i]) && along > 0.25 * chord * chord)) return 0;
  }
  piece_halve (c->x, first.x, second.x);
  piece_halve (c->y, first.y, second.y);
  double whole = piece_length (c, 1);
  return fabs (piece_length (&first, 1) + piece_length (&second, 1) - whole) <= 1e-14 * whole;
}

/* ---- Making a path ---- */

enum { PATH_HALVINGS = 40 /* most of a cubic: closer to a cusp there is no direction */ };

/* What functions share while a path is made. */
typedef struct {
  pw_path *p;
  size_t room; /* pieces allocated */
  int point;   /* at which the current cubic begins, from 1 */
  pw_error *error;
} maker;

static int make_fail_memory (const maker *m) {
  return pw_fail (m->error, PW_RESOURCE, "out of memory");
}

/* Appends a piece, or its halves. */
static int make_pieces (maker *m, const piece *c, int halvings) {
  pw_path *p = m->p;
  if (p->is_linear || piece_is_good (c)) {
    if (pw_grow (&p->piece, (size_t)p->pieces, &m->room, sizeof *p->piece) != PW_OK) return make_fail_memory (m);
    p->piece[p->pieces++] = *c;
    return PW_OK;
  }
  if (halvings == PATH_HALVINGS)
    return pw_fail (m->error, PW_INPUT, "the spline has a cusp, without a direction, after point %d", m->point);
  piece first = *c, second = *c;
  piece_halve (c->x, first.x, second.x);
  piece_halve (c->y, first.y, second.y);
  int status = make_pieces (m, &first, halvings + 1);
  return status == PW_OK ? make_pieces (m, &second, halvings + 1) : status;
}

/* The cubics of one component of n points at the distances t; spline: 2 n numbers. */
static void make_component (const double *t, const double *value, int n, double *spline) {
  pw_signal table = { PW_TABLE, .table = { .t = t, .value = value, .count = n, .interpolation = PW_CUBIC } };
  pw_table_spline (&table, spline);
}

static void make_coefficients (const double *value, const double *spline, int n, int i, double h, double a[4]) {
  double M = spline[n + i];
  a[0] = value[i], a[1] = h * spline[i], a[2] = h * h * M / 2, a[3] = h * h * (spline[n + i + 1] - M) / 6;
}

/* The points of a closed spline are repeated on both sides: the effect of the ends of a spline falls to less than half
 * from point to point, thus to less than round-off. */
enum { PATH_REPEATED = 64 };

static int make_cubics (maker *m, const double *x, const double *y, int count) {
  const int before = m->p->closed ? PATH_REPEATED : 0, n = m->p->closed ? count + 1 + 2 * before : count;
  double *t, *px, *py, *spline_x, *spline_y;
  const pw_array array[] = { { &t, (size_t)n },
                             { &px, (size_t)n },
                             { &py, (size_t)n },
                             { &spline_x, 2 * (size_t)n },
                             { &spline_y, 2 * (size_t)n } };
  char *memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  int status = memory ? PW_OK : make_fail_memory (m), first = (count - before % count) % count;
  for (int i = 0; memory && i < n; i++) {
    px[i] = x[(first + i) % count], py[i] = y[(first + i) % count];
    t[i] = i > 0 ? t[i - 1] + hypot (px[i] - px[i - 1], py[i] - py[i - 1]) : 0;
  }
  if (memory) make_component (t, px, n, spline_x), make_component (t, py, n, spline_y);
  for (int i = before; status == PW_OK && i < n - 1 - before; i++) {
    piece c = { .s = 0 };
    make_coefficients (px, spline_x, n, i, t[i + 1] - t[i], c.x);
    make_coefficients (py, spline_y, n, i, t[i + 1] - t[i], c.y);
    m->point = i - before + 1;
    status = make_pieces (m, &c, 0);
  }
  free (memory);
  return status;
}

static int make_lines (maker *m, const double *x, const double *y, int count) {
  int status = PW_OK, lines = m->p->closed ? count : count - 1;
  for (int i = 0, n = 1; status == PW_OK && i < lines; i++, n = (n + 1) % count)
    status = make_pieces (m, &(piece){ .x = { x[i], x[n] - x[i] }, .y = { y[i], y[n] - y[i] } }, 0);
  return status;
}

/* The angle from the direction of (x, y) at the end or beginning of one piece to that of another. */
static double make_turn (const piece *from, int end, const piece *to, int to_end) {
  double fx[4], fy[4], tx[4], ty[4];
  piece_component (from->x, end, fx), piece_component (from->y, end, fy);
  piece_component (to->x, to_end, tx), piece_component (to->y, to_end, ty);
  return atan2 (fx[1] * ty[1] - fy[1] * tx[1], fx[1] * tx[1] + fy[1] * ty[1]);
}

static void make_box (const piece *c, box *b) {
  const double *const component[] = { c->x, c->y };
  for (int k = 0; k < 2; k++) {
    const double *a = component[k], point[] = { a[0], a[0] + a[1] / 3, a[0] + (2 * a[1] + a[2]) / 3,
                                                a[0] + a[1] + a[2] + a[3] }; /* control points */
    b->lo[k] = fmin (fmin (point[0], point[1]), fmin (point[2], point[3]));
    b->hi[k] = fmax (fmax (point[0], point[1]), fmax (point[2], point[3]));
  }
}

/* Arc lengths, directions and boxes of the pieces. */
static int make_index (maker *m) {
  pw_path *p = m->p;
  piece *last = p->piece + p->pieces - 1;
  double s = 0, heading = atan2 (p->piece->y[1], p->piece->x[1]);
  for (piece *c = p->piece; c <= last; c++) {
    c->s = s, c->heading = heading, c->size = p->is_linear ? hypot (c->x[1], c->y[1]) : piece_length (c, 1);
    s += c->size;
    heading += make_turn (c, 0, c, 1) + (c < last ? make_turn (c, 1, c + 1, 0) : 0);
  }
  p->length = s;
  p->turn =
      p->closed ? 2 * PW_PI * rint ((heading + make_turn (last, 1, p->piece, 0) - p->piece->heading) / (2 * PW_PI)) : 0;
  for (p->leaves = 1; p->leaves < p->pieces;) p->leaves *= 2;
  p->box = malloc (2 * (size_t)p->leaves * sizeof *p->box);
  if (p->box == NULL) return make_fail_memory (m);
  for (int i = 0; i < p->leaves; i++)
    if (i < p->pieces)
      make_box (&p->piece[i], &p->box[p->leaves + i]);
    else
      p->box[p->leaves + i] = (box){ { INFINITY, INFINITY }, { -INFINITY, -INFINITY } };
  for (int i = p->leaves - 1; i > 0; i--)
    for (int k = 0; k < 2; k++) {
      p->box[i].lo[k] = fmin (p->box[2 * i].lo[k], p->box[2 * i + 1].lo[k]);
      p->box[i].hi[k] = fmax (p->box[2 * i].hi[k], p->box[2 * i + 1].hi[k]);
    }
  return isfinite (s) ? PW_OK : pw_fail (m->error, PW_INPUT, "the length of the path is not finite");
}

static int make_check (const double *x, const double *y, int count, int interpolation, int closed, pw_error *error) {
  const int least = interpolation == PW_CUBIC ? 4 : closed ? 3 : 2;
  if (x == NULL || y == NULL) return pw_fail (error, PW_INPUT, "the points are missing");
  if (interpolation != PW_LINEAR && interpolation != PW_CUBIC)
    return pw_fail (error, PW_INPUT, "interpolation = %d: expected PW_LINEAR or PW_CUBIC", interpolation);
  if (count < least)
    return pw_fail (error, PW_INPUT, "%s %s path needs at least %d different points, found %d",
                    closed ? "a closed" : "an open", interpolation == PW_CUBIC ? "cubic" : "linear", least,
                    count < 0 ? 0 : count);
  if (count > PW_PATH_POINTS) return pw_fail (error, PW_INPUT, "%d points; a path may have %d", count, PW_PATH_POINTS);
  for (int i = 0; i < count; i++) {
    if (!isfinite (x[i]) || !isfinite (y[i]))
      return pw_fail (error, PW_INPUT, "point %d is (%g, %g): expected finite numbers", i + 1, x[i], y[i]);
    if (i > 0 && !(hypot (x[i] - x[i - 1], y[i] - y[i - 1]) > 0))
      return pw_fail (error, PW_INPUT, "points %d and %d are equal, (%g, %g)", i, i + 1, x[i], y[i]);
  }
  return PW_OK;
}

/* The last point of a closed path repeats the first one if it is nearer than this part of the second's distance. */
#define PATH_EQUAL 1e-6

pw_path *pw_path_open (const double *x, const double *y, int count, int interpolation, int closed, pw_error *error) {
  maker m = { .error = error };
  if (x && y && closed && count > 2 &&
      hypot (x[count - 1] - x[0], y[count - 1] - y[0]) <= PATH_EQUAL * hypot (x[1] - x[0], y[1] - y[0]))
    count--;
  if (make_check (x, y, count, interpolation, closed, error) != PW_OK) return NULL;
  pw_path *p = m.p = calloc (1, sizeof *p);
  if (p == NULL) {
    make_fail_memory (&m);
    return NULL;
  }
  atomic_init (&p->users, 1);
  p->closed = closed != 0, p->is_linear = interpolation == PW_LINEAR;
  int status = p->is_linear ? make_lines (&m, x, y, count) : make_cubics (&m, x, y, count);
  if (status == PW_OK && make_index (&m) == PW_OK) return p;
  pw_path_close (p);
  return NULL;
}

pw_path *pw_path_share (pw_path *p) {
  atomic_fetch_add (&p->users, 1);
  return p;
}

void pw_path_close (pw_path *p) {
  if (p == NULL || atomic_fetch_sub (&p->users, 1) > 1) return;
  free (p->piece);
  free (p->box);
  free (p);
}

double pw_path_length (const pw_path *p) {
  return p->length;
}

/* ---- Places ---- */

/* A place: parameter u of piece i in a lap; beyond an end of an open path, the signed distance from it. */
typedef struct {
  int i;
  double u, lap, beyond;
} place;

static place place_at (const pw_path *p, double s) {
  place at = { .i = 0 };
  int high = p->pieces;
  if (p->closed) {
    at.lap = floor (s / p->length);
    s = fmax (0, s - at.lap * p->length);
  } else if (s < 0 || s > p->length) {
    at.beyond = s < 0 ? s : s - p->length;
    if (s > 0) at.i = p->pieces - 1, at.u = 1;
    return at;
  }
  while (high - at.i > 1) {
    int middle = at.i + (high - at.i) / 2;
    if (p->piece[middle].s <= s)
      at.i = middle;
    else
      high = middle;
  }
  at.u = piece_parameter (&p->piece[at.i], s - p->piece[at.i].s);
  return at;
}

/* Curvature and its derivatives by arc length from derivatives by u. */
static void place_curvature (const double x[4], const double y[4], double out[3]) {
  double v = hypot (x[1], y[1]), v1 = (x[1] * x[2] + y[1] * y[2]) / v;
  double v2 = (x[2] * x[2] + y[2] * y[2] + x[1] * x[3] + y[1] * y[3] - v1 * v1) / v, v3 = v * v * v;
  double c = x[1] * y[2] - y[1] * x[2], c1 = x[1] * y[3] - y[1] * x[3], c2 = x[2] * y[3] - y[2] * x[3];
  double k1 = (c1 - 3 * c * v1 / v) / v3; /* derivatives of the curvature by u */
  double k2 = (c2 - (6 * c1 * v1 + 3 * c * v2) / v + 12 * c * v1 * v1 / (v * v)) / v3;
  out[0] = c / v3;
  out[1] = k1 / v;
  out[2] = (k2 - k1 * v1 / v) / (v * v);
}

static void place_describe (const pw_path *p, const place *at, pw_path_place *out) {
  const piece *c = &p->piece[at->i];
  double x[4], y[4];
  piece_component (c->x, at->u, x);
  piece_component (c->y, at->u, y);
  double v = hypot (x[1], y[1]), turned = atan2 (c->x[1] * y[1] - c->y[1] * x[1], c->x[1] * x[1] + c->y[1] * y[1]);
  *out = (pw_path_place){ .s = c->s + (p->is_linear ? c->size * at->u : piece_length (c, at->u)) + at->lap * p->length +
                               at->beyond,
                          .x = x[0] + at->beyond * (x[1] / v),
                          .y = y[0] + at->beyond * (y[1] / v),
                          .cos = x[1] / v,
                          .sin = y[1] / v,
                          .heading = c->heading + turned + at->lap * p->turn };
  if (at->beyond == 0 && !p->is_linear) place_curvature (x, y, out->curvature);
}

void pw_path_at (const pw_path *p, double s, pw_path_place *out) {
  *out = (pw_path_place){ NAN, NAN, NAN, NAN, NAN, NAN, { NAN, NAN, NAN }, NAN, 0 };
  if (!isfinite (s)) return;
  place at = place_at (p, s);
  place_describe (p, &at, out);
  out->s = s;
}

double pw_path_break (const pw_path *p, double s) {
  if (!isfinite (s) || (p->closed && !p->is_linear)) return INFINITY;
  if (!p->is_linear) return s < 0 ? 0 : s < p->length ? p->length : INFINITY;
  place at = place_at (p, s);
  if (at.i + 1 < p->pieces) return p->piece[at.i + 1].s + at.lap * p->length;
  return p->closed ? (at.lap + 1) * p->length : INFINITY;
}

/* ---- Nearest places ---- */

typedef struct {
  const pw_path *p;
  double x, y;   /* the point */
  int first;     /* 1: the search ends at the first minimum */
  double square; /* of the least distance so far */
  place best;
} search;

/* (p - P) . p' and its derivative at u. */
static double search_slope (const search *s, const piece *c, double u, double *derivative) {
  double x[4], y[4];
  piece_component (c->x, u, x);
  piece_component (c->y, u, y);
  x[0] -= s->x, y[0] -= s->y;
  *derivative = x[1] * x[1] + y[1] * y[1] + x[0] * x[2] + y[0] * y[2];
  return x[0] * x[1] + y[0] * y[1];
}

/* Its root between lo and hi, where it is negative and positive. */
static double search_root (const search *s, const piece *c, double lo, double hi) {
  double u = lo + (hi - lo) / 2;
  for (int i = 0; i < 100; i++) {
    double derivative, f = search_slope (s, c, u, &derivative);
    if (f == 0) break;
    if (f < 0)
      lo = u;
    else
      hi = u;
    double next = u - f / derivative;
    if (!(next > lo && next < hi)) next = lo + (hi - lo) / 2;
    if (fabs (next - u) <= 1e-16) break;
    u = next;
  }
  return u;
}

static void search_try (search *s, int i, double u) {
  double x[4], y[4];
  piece_component (s->p->piece[i].x, u, x);
  piece_component (s->p->piece[i].y, u, y);
  double dx = s->x - x[0], dy = s->y - y[0], square = dx * dx + dy * dy;
  int earlier = i < s->best.i || (i == s->best.i && u < s->best.u);
  if (!s->first && (square > s->square || (square == s->square && !earlier))) return;
  s->square = square;
  s->best.i = i, s->best.u = u;
}

/* Bernstein coefficients of (p - P) . p' for u from 0 to 1. */
static void search_bernstein (const search *s, const piece *c, double b[6]) {
  static const double product[4][3] = { { 1, 2, 1 }, { 3, 6, 3 }, { 3, 6, 3 }, { 1, 2, 1 } },
                      sum[] = { 1, 5, 10, 10, 5, 1 };
  const double *const component[] = { c->x, c->y }, point[] = { s->x, s->y };
  memset (b, 0, 6 * sizeof *b);
  for (int k = 0; k < 2; k++) {
    const double *a = component[k], a0 = a[0] - point[k];
    const double e[] = { a0, a0 + a[1] / 3, a0 + (2 * a[1] + a[2]) / 3, a0 + a[1] + a[2] + a[3] };
    double d[3];
    piece_hodograph (a, d);
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < 3; j++) b[i + j] += product[i][j] * e[i] * d[j];
  }
  for (int i = 0; i < 6; i++) b[i] /= sum[i];
}

/* The coefficients for the parts before and after a fraction of the interval (de Casteljau). */
static void search_divide (const double b[6], double at, double before[6], double after[6]) {
  memcpy (after, b, 6 * sizeof *b);
  for (int n = 0; n < 6; n++) {
    before[n] = after[0];
    for (int i = 0; i < 5 - n; i++) after[i] += at * (after[i + 1] - after[i]);
  }
}

/* The sign of the first coefficient that is not 0; *changes: of signs. */
static int search_signs (const double b[6], int *changes) {
  int first = 0, last = 0;
  *changes = 0;
  for (int i = 0; i < 6; i++) {
    int sign = (b[i] > 0) - (b[i] < 0);
    *changes += sign * last < 0;
    if (sign) last = sign;
    if (!first) first = sign;
  }
  return first;
}

enum { SEARCH_DEPTH = 40 };

/* Tries the minima of the distance on piece i from u = lo to hi, of which hi may be the smaller one; b: coefficients of
 * its derivative in this direction.  Returns 1 if the search is to end. */
static int search_minima (search *s, int i, const double b[6], double lo, double hi, int depth) {
  double before[6], after[6], middle = (lo + hi) / 2;
  int changes, sign = search_signs (b, &changes);
  if (changes == 0 || (changes == 1 && sign > 0)) return 0;
  if (changes == 1 || depth == SEARCH_DEPTH) {
    search_try (s, i, changes == 1 ? search_root (s, &s->p->piece[i], fmin (lo, hi), fmax (lo, hi)) : middle);
    return s->first;
  }
  search_divide (b, 0.5, before, after);
  return search_minima (s, i, before, lo, middle, depth + 1) || search_minima (s, i, after, middle, hi, depth + 1);
}

static double search_box (const search *s, const box *b) {
  double x = fmax (0, fmax (b->lo[0] - s->x, s->x - b->hi[0])), y = fmax (0, fmax (b->lo[1] - s->y, s->y - b->hi[1]));
  return x * x + y * y;
}

/* Searches the pieces in box k, the nearer half first. */
static void search_tree (search *s, int k) {
  if (k >= s->p->leaves) {
    double b[6];
    int i = k - s->p->leaves;
    search_try (s, i, 0);
    if (i == s->p->pieces - 1 && !s->p->closed) search_try (s, i, 1);
    search_bernstein (s, &s->p->piece[i], b);
    search_minima (s, i, b, 0, 1, 0);
    return;
  }
  double square[] = { search_box (s, &s->p->box[2 * k]), search_box (s, &s->p->box[2 * k + 1]) };
  int nearer = square[1] < square[0];
  for (int n = 0; n < 2; n++)
    if (square[n ^ nearer] <= s->square) search_tree (s, 2 * k + (n ^ nearer));
}

/* The distance of the point along the tangent at the first or the last point of an open path. */
static double search_beyond (const search *s, int last) {
  const piece *c = &s->p->piece[last ? s->p->pieces - 1 : 0];
  double x[4], y[4];
  piece_component (c->x, last, x);
  piece_component (c->y, last, y);
  return ((s->x - x[0]) * x[1] + (s->y - y[0]) * y[1]) / hypot (x[1], y[1]);
}

/* The end of an open path, or what lies beyond it. */
static place search_end (const search *s, int last) {
  double beyond = search_beyond (s, last);
  return last ? (place){ s->p->pieces - 1, 1, 0, fmax (0, beyond) } : (place){ 0, 0, 0, fmin (0, beyond) };
}

/* Follows the falling distance from a place of the path. */
static place search_fall (search *s, place from) {
  const pw_path *p = s->p;
  double derivative;
  int forward = search_slope (s, &p->piece[from.i], from.u, &derivative) <= 0, changes;
  for (int n = 0; n <= p->pieces; n++) {
    double whole[6], before[6], after[6], b[6];
    search_bernstein (s, &p->piece[from.i], whole);
    if (from.u != !forward) search_divide (whole, from.u, before, after);
    const double *part = from.u == !forward ? whole : forward ? after : before; /* the part ahead */
    for (int i = 0; i < 6; i++) b[i] = forward ? part[i] : -part[5 - i];
    if (search_signs (b, &changes) > 0) break; /* it rises */
    if (search_minima (s, from.i, b, from.u, forward, 0)) return (place){ s->best.i, s->best.u, from.lap, 0 };
    int next = from.i + (forward ? 1 : -1);
    if (!p->closed && (next < 0 || next == p->pieces)) return search_end (s, forward);
    from.lap += next < 0 ? -1 : next == p->pieces;
    from.i = (next + p->pieces) % p->pieces, from.u = forward ? 0 : 1;
  }
  if (from.u == 1 && (p->closed || from.i < p->pieces - 1)) { /* between two pieces: the beginning of the second one */
    from.lap += from.i == p->pieces - 1;
    from.i = (from.i + 1) % p->pieces, from.u = 0;
  }
  return from;
}

/* At a corner of a polyline, to which the place nearest to the point belongs: the direction turns with the point. */
static void search_corner (const search *s, const place *at, pw_path_place *out) {
  const pw_path *p = s->p;
  const piece *after = &p->piece[at->i], *before = at->i > 0 ? after - 1 : p->closed ? &p->piece[p->pieces - 1] : NULL;
  double x = s->x - out->x, y = s->y - out->y, d = hypot (x, y);
  if (!p->is_linear || before == NULL || at->u != 0 || d == 0) return;
  if (x * before->x[1] + y * before->y[1] < 0 || x * after->x[1] + y * after->y[1] > 0) return;
  int right =
      before->x[1] * after->y[1] - before->y[1] * after->x[1] > 0; /* the side of the point: a turn to the left */
  double tx = right ? -y : y, ty = right ? x : -x;
  out->corner = 1;
  out->offset = right ? -d : d;
  out->cos = tx / d, out->sin = ty / d;
  out->heading = before->heading - (at->i > 0 ? 0 : p->turn) + at->lap * p->turn +
                 atan2 (before->x[1] * ty - before->y[1] * tx, before->x[1] * tx + before->y[1] * ty);
}

static void search_describe (const search *s, const place *at, pw_path_place *out) {
  place_describe (s->p, at, out);
  out->offset = out->cos * (s->y - out->y) - out->sin * (s->x - out->x);
  search_corner (s, at, out);
}

void pw_path_nearest (const pw_path *p, double x, double y, pw_path_place *out) {
  search s = { .p = p, .x = x, .y = y, .square = INFINITY };
  if (!isfinite (x) || !isfinite (y)) {
    pw_path_at (p, NAN, out);
    return;
  }
  search_tree (&s, 1);
  int last = s.best.i == p->pieces - 1 && s.best.u == 1;
  if (!p->closed && (last || (s.best.i == 0 && s.best.u == 0))) s.best = search_end (&s, last);
  search_describe (&s, &s.best, out);
}

void pw_path_nearest_from (const pw_path *p, double x, double y, double near, pw_path_place *out) {
  search s = { .p = p, .x = x, .y = y, .first = 1 };
  if (!isfinite (x) || !isfinite (y) || !isfinite (near)) {
    pw_path_at (p, NAN, out);
    return;
  }
  place from = place_at (p, near);
  int is_beyond = from.beyond != 0, last = from.beyond > 0;
  double beyond = is_beyond ? search_beyond (&s, last) : 0;
  from.beyond = 0;
  if (is_beyond && (last ? beyond >= 0 : beyond <= 0))
    from.beyond = beyond;
  else
    from = search_fall (&s, from);
  search_describe (&s, &from, out);
}
