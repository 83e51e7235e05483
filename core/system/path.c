/* Paths: polylines and cubic splines through points, arc lengths, nearest places.
 *
 * A path is a list of pieces, p(u) = a0 + a1 u + a2 u^2 + a3 u^3 with u from 0 to 1: lines, or the cubics of two tables
 * x(l), y(l) (signal.c) of the accumulated distance l of the points.  Where a cubic turns much or its arc length is not
 * obtained to round-off by Gauss's rule, it is halved, so that the direction of a piece stays within 37 degrees.
 *
 * The nearest place is a minimum of the distance from P, where f = (p - P) . p' changes its sign from - to +.  The
 * signs of the coefficients of f in the basis of Bernstein polynomials of degree 5 change at least as often as f does:
 * halving isolates the roots (Farin 2002, Curves and Surfaces for CAGD, chapter 5).  Most pieces are left out, since
 * the distance changes at most as fast as the arc length. */
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include "system.h"

typedef struct {
  double x[2][4];          /* coefficients of u^0 ... u^3 of x and y [m] */
  double s, heading, size; /* arc length and direction at its beginning; its own arc length */
} piece;

struct pw_path {
  atomic_int users;
  int pieces, closed, is_linear;
  double length, turn; /* arc length; change of direction of one lap */
  piece *piece;
};

/* Value and first three derivatives by u of x and y. */
static inline void piece_point (const piece *c, double u, double out[2][4]) {
  for (int k = 0; k < 2; k++) {
    const double *a = c->x[k];
    out[k][0] = a[0] + u * (a[1] + u * (a[2] + u * a[3]));
    out[k][1] = a[1] + u * (2 * a[2] + 3 * u * a[3]);
    out[k][2] = 2 * a[2] + 6 * u * a[3];
    out[k][3] = 6 * a[3];
  }
}

/* The arc length from u = 0 to u, by Gauss's rule. */
static double piece_length (const piece *c, double u) {
  double sum = 0;
  for (int i = 0; i < 8; i++) {
    double at = u / 2 * (1 + (i < 4 ? pw_gauss_node[i] : -pw_gauss_node[i - 4]));
    double point[2][4];
    piece_point (c, at, point);
    sum += pw_gauss_weight[i % 4] * sqrt (point[0][1] * point[0][1] + point[1][1] * point[1][1]);
  }
  return u / 2 * sum;
}

static void piece_halve (const piece *c, piece half[2]) {
  double d[2][4];
  piece_point (c, 0.5, d);
  for (int k = 0; k < 2; k++)
    for (int i = 0; i < 4; i++)
      half[0].x[k][i] = ldexp (c->x[k][i], -i), half[1].x[k][i] = ldexp (d[k][i], -i) / (i == 3 ? 6 : i == 2 ? 2 : 1);
}

/* Bezier's control points of the derivative of a component. */
static inline void piece_hodograph (const double a[4], double d[3]) {
  d[0] = a[1], d[1] = a[1] + a[2], d[2] = a[1] + 2 * a[2] + 3 * a[3];
}

/* 1 if all directions are within 37 degrees of that of the chord, and halves have the same arc length to round-off. */
static int piece_is_good (const piece *c, const piece half[2]) {
  double x[3], y[3];
  piece_hodograph (c->x[0], x);
  piece_hodograph (c->x[1], y);
  double cx = (x[0] + x[1] + x[2]) / 3, cy = (y[0] + y[1] + y[2]) / 3, chord = hypot (cx, cy);
  for (int i = 0; i < 3; i++) {
    double along = x[i] * cx + y[i] * cy;
    if (!(along > 0.8 * chord * hypot (x[i], y[i]) && along > 0.25 * chord * chord)) return 0;
  }
  double whole = piece_length (c, 1);
  return fabs (piece_length (&half[0], 1) + piece_length (&half[1], 1) - whole) <= 1e-14 * whole;
}

enum { PATH_HALVINGS = 40 /* most of a cubic: closer to a cusp there is no direction */ };

/* Appends a piece, or its halves; point: at which its cubic begins, from 1; room: pieces allocated. */
static int make_pieces (pw_path *p, const piece *c, int point, int halvings, size_t *room, pw_error *error) {
  piece half[2] = { { .s = 0 } };
  if (!p->is_linear) piece_halve (c, half);
  if (p->is_linear || piece_is_good (c, half)) {
    if (pw_grow (&p->piece, (size_t)p->pieces, room, sizeof *p->piece) != PW_OK)
      return pw_fail (error, PW_RESOURCE, "out of memory");
    p->piece[p->pieces++] = *c;
    return PW_OK;
  }
  if (halvings == PATH_HALVINGS)
    return pw_fail (error, PW_INPUT, "the spline has a cusp, without a direction, after point %d", point);
  int status = make_pieces (p, &half[0], point, halvings + 1, room, error);
  return status == PW_OK ? make_pieces (p, &half[1], point, halvings + 1, room, error) : status;
}

/* The points of a closed spline are repeated on both sides: the effect of the ends of a spline falls to less than half
 * from point to point, thus to less than round-off. */
enum { PATH_REPEATED = 64 };

static int make_all_pieces (pw_path *p, const double *x, const double *y, int count, pw_error *error) {
  const int before = p->closed && !p->is_linear ? PATH_REPEATED : 0, n = count + p->closed + 2 * before;
  double *t, *point[2], *spline; /* of n points: distances, x and y; 2 n: of one of these (pw_table_spline) */
  char *memory = PW_ALLOC_ARRAYS (PW_ARRAY (t, n), PW_ARRAY (point[0], n), PW_ARRAY (point[1], n),
                                  PW_ARRAY (spline, 4 * (size_t)n));
  size_t room = 0;
  if (memory == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < n; i++) {
    const int from = (i + count - before % count) % count;
    point[0][i] = x[from], point[1][i] = y[from];
    t[i] = i > 0 ? t[i - 1] + hypot (point[0][i] - point[0][i - 1], point[1][i] - point[1][i - 1]) : 0;
  }
  for (int k = 0; k < 2 && !p->is_linear; k++)
    pw_table_spline (&(pw_signal){ PW_TABLE, .table = { t, point[k], n, .interpolation = PW_CUBIC } },
                     spline + 2 * n * k);
  int status = PW_OK;
  for (int i = before; status == PW_OK && i < n - 1 - before; i++) {
    piece c = { .s = 0 };
    for (int k = 0; k < 2; k++) {
      const double h = t[i + 1] - t[i], *slope = spline + 2 * n * k, *second = slope + n;
      double *a = c.x[k];
      a[0] = point[k][i], a[1] = point[k][i + 1] - a[0];
      if (!p->is_linear)
        a[1] = h * slope[i], a[2] = h * h * second[i] / 2, a[3] = h * h * (second[i + 1] - second[i]) / 6;
    }
    status = make_pieces (p, &c, i - before + 1, 0, &room, error);
  }
  free (memory);
  return status;
}

/* The angle from the direction at the end or beginning of one piece to that of another. */
static double make_turn (const piece *from, int end, const piece *to, int to_end) {
  double f[2][4], t[2][4];
  piece_point (from, end, f);
  piece_point (to, to_end, t);
  return atan2 (f[0][1] * t[1][1] - f[1][1] * t[0][1], f[0][1] * t[0][1] + f[1][1] * t[1][1]);
}

static int make_index (pw_path *p, pw_error *error) {
  piece *last = p->piece + p->pieces - 1;
  double s = 0, heading = atan2 (p->piece->x[1][1], p->piece->x[0][1]);
  for (piece *c = p->piece; c <= last; c++) {
    c->s = s, c->heading = heading, c->size = p->is_linear ? hypot (c->x[0][1], c->x[1][1]) : piece_length (c, 1);
    s += c->size;
    heading += make_turn (c, 0, c, 1) + (c < last ? make_turn (c, 1, c + 1, 0) : 0);
  }
  p->length = s;
  if (p->closed)
    p->turn = 2 * PW_PI * rint ((heading + make_turn (last, 1, p->piece, 0) - p->piece->heading) / (2 * PW_PI));
  return isfinite (s) ? PW_OK : pw_fail (error, PW_INPUT, "the length of the path is not finite");
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
  if (x && y && closed && count > 2 &&
      hypot (x[count - 1] - x[0], y[count - 1] - y[0]) <= PATH_EQUAL * hypot (x[1] - x[0], y[1] - y[0]))
    count--;
  if (make_check (x, y, count, interpolation, closed, error) != PW_OK) return NULL;
  pw_path *p = calloc (1, sizeof *p);
  if (p == NULL) return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  atomic_init (&p->users, 1);
  p->closed = closed != 0, p->is_linear = interpolation == PW_LINEAR;
  if (make_all_pieces (p, x, y, count, error) == PW_OK && make_index (p, error) == PW_OK) return p;
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
  free (p);
}

double pw_path_length (const pw_path *p) {
  return p->length;
}

/* 1 if a disc on the left that touches the path at an arc length does not fit there. */
static int path_is_tight (const pw_path *p, double s, double radius) {
  pw_path_place at, other;
  pw_path_at (p, s, &at);
  pw_path_nearest (p, at.x - radius * at.sin, at.y + radius * at.cos, INFINITY, &other);
  return !(at.curvature[0] * radius < 1) || !(other.offset > radius * (1 - 1e-9));
}

double pw_path_tight (const pw_path *p, double radius) {
  if (!(radius > 0)) return NAN;
  for (int i = 0; i < 4 * p->pieces; i++) {
    const double s = p->piece[i / 4].s + i % 4 * p->piece[i / 4].size / 4;
    if (path_is_tight (p, s, radius)) return s;
  }
  for (double s = p->length; !p->closed && s > p->length / 1000; s /= 2) {
    if (path_is_tight (p, -s, radius)) return -s;
    if (path_is_tight (p, p->length + s, radius)) return p->length + s;
  }
  return NAN;
}

int pw_path_is_smooth (const pw_path *p) {
  return !p->is_linear;
}

/* A place: parameter u of piece i in a lap; beyond an end of an open path, the signed distance from it. */
typedef struct {
  int i;
  double u, lap, beyond;
} place;

/* The piece with an arc length; the first or last one beyond the ends. */
static int place_piece (const pw_path *p, double s) {
  int low = 0, high = p->pieces;
  while (high - low > 1) {
    const int middle = low + (high - low) / 2;
    if (p->piece[middle].s <= s)
      low = middle;
    else
      high = middle;
  }
  return low;
}

static place place_at (const pw_path *p, double s) {
  place at = { .lap = p->closed ? floor (s / p->length) : 0 };
  const double along = s - at.lap * p->length, inside = fmin (fmax (0, along), p->length);
  at.i = place_piece (p, inside);
  at.beyond = p->closed ? 0 : along - inside;
  const piece *c = &p->piece[at.i];
  const double part = inside - c->s; /* of the piece's arc length; its parameter u by Newton's method */
  double u = part / c->size;
  for (int i = 0; i < 20 && u > 0 && u < 1; i++) {
    double x[2][4], last = u;
    piece_point (c, u, x);
    u = fmin (1, fmax (0, u - (piece_length (c, u) - part) / hypot (x[0][1], x[1][1])));
    if (fabs (u - last) <= 1e-15) break;
  }
  at.u = fmin (1, fmax (0, u));
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

static double place_arc_length (const pw_path *p, const place *at) {
  const piece *c = &p->piece[at->i];
  return c->s + (p->is_linear ? c->size * at->u : piece_length (c, at->u)) + at->lap * p->length + at->beyond;
}

static void place_describe (const pw_path *p, const place *at, pw_path_place *out) {
  const piece *c = &p->piece[at->i];
  double point[2][4];
  const double *x = point[0], *y = point[1], *from[] = { c->x[0], c->x[1] };
  piece_point (c, at->u, point);
  double v = hypot (x[1], y[1]),
         turned = atan2 (from[0][1] * y[1] - from[1][1] * x[1], from[0][1] * x[1] + from[1][1] * y[1]);
  *out = (pw_path_place){ .s = place_arc_length (p, at),
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
  for (int i = at.i + 1; i < p->pieces; i++) {
    const double next = p->piece[i].s + at.lap * p->length;
    if (next > s) return next;
  }
  if (!p->closed) return INFINITY;
  const double lap = (at.lap + 1) * p->length; /* where s is rounded to the end of the lap before, it is s itself */
  return lap > s ? lap : lap + p->piece[1].s;
}

typedef struct {
  const pw_path *p;
  double x, y;  /* the point */
  double near;  /* arc length next to which a minimum of the distance is sought; INFINITY: the least distance */
  double lap;   /* of the pieces being searched */
  double least; /* distance, or difference of arc length from `near`, of the best place so far */
  place best;
} search;

/* The distance from u of a piece; slope: (p - P) . p', its derivative by u, |p'|. */
static double search_distance (const search *s, const piece *c, double u, double slope[3]) {
  double point[2][4], *x = point[0], *y = point[1];
  piece_point (c, u, point);
  x[0] -= s->x, y[0] -= s->y;
  slope[0] = x[0] * x[1] + y[0] * y[1];
  slope[1] = x[1] * x[1] + y[1] * y[1] + x[0] * x[2] + y[0] * y[2];
  slope[2] = hypot (x[1], y[1]);
  return hypot (x[0], y[0]);
}

/* The root of the slope between lo and hi, where it is negative and positive. */
static double search_root (const search *s, const piece *c, double lo, double hi) {
  double u = lo + (hi - lo) / 2, slope[3];
  for (int i = 0; i < 100; i++) {
    search_distance (s, c, u, slope);
    if (slope[0] == 0) break;
    *(slope[0] < 0 ? &lo : &hi) = u;
    double next = u - slope[0] / slope[1];
    if (!(next > lo && next < hi)) next = lo + (hi - lo) / 2;
    if (fabs (next - u) <= 1e-16) break;
    u = next;
  }
  return u;
}

/* Takes a minimum of the distance if it is better than the best one so far.  At an end of an open path the place is
 * that on its tangent. */
static void search_try (search *s, int i, double u) {
  const pw_path *p = s->p;
  double slope[3], measure = search_distance (s, &p->piece[i], u, slope);
  place at = { i, u, s->lap, 0 };
  if (!p->closed && ((i == 0 && u == 0) || (i == p->pieces - 1 && u == 1))) at.beyond = -slope[0] / slope[2];
  if (isfinite (s->near)) measure = fabs (place_arc_length (p, &at) - s->near);
  if (measure < s->least) s->least = measure, s->best = at;
}

/* Bernstein coefficients of (p - P) . p' for u from 0 to 1. */
static void search_bernstein (const search *s, const piece *c, double b[6]) {
  static const double product[4][3] = { { 1, 2, 1 }, { 3, 6, 3 }, { 3, 6, 3 }, { 1, 2, 1 } },
                      sum[] = { 1, 5, 10, 10, 5, 1 };
  const double point[] = { s->x, s->y };
  memset (b, 0, 6 * sizeof *b);
  for (int k = 0; k < 2; k++) {
    const double *a = c->x[k], a0 = a[0] - point[k];
    const double e[] = { a0, a0 + a[1] / 3, a0 + (2 * a[1] + a[2]) / 3, a0 + a[1] + a[2] + a[3] };
    double d[3];
    piece_hodograph (a, d);
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < 3; j++) b[i + j] += product[i][j] * e[i] * d[j];
  }
  for (int i = 0; i < 6; i++) b[i] /= sum[i];
}

enum { SEARCH_DEPTH = 40 };

/* Tries the minima of the distance on piece i between u = lo and hi; b: coefficients of its slope there, of which 0
 * counts as positive, so that a root where two parts meet belongs to one of them. */
static void search_minima (search *s, int i, const double b[6], double lo, double hi, int depth) {
  double before[6], after[6];
  int changes = 0, falls = 0; /* changes of sign, of which those from + to - */
  for (int k = 1; k < 6; k++) changes += (b[k] < 0) != (b[k - 1] < 0), falls += b[k] < 0 && b[k - 1] >= 0;
  if (changes == falls) return; /* none, or a maximum */
  if (changes == 1 || depth == SEARCH_DEPTH) {
    search_try (s, i, search_root (s, &s->p->piece[i], lo, hi));
    return;
  }
  memcpy (after, b, sizeof after);
  for (int n = 0; n < 6; n++) { /* the coefficients for the two halves (de Casteljau) */
    before[n] = after[0];
    for (int k = 0; k < 5 - n; k++) after[k] = (after[k] + after[k + 1]) / 2;
  }
  search_minima (s, i, before, lo, lo + (hi - lo) / 2, depth + 1);
  search_minima (s, i, after, lo + (hi - lo) / 2, hi, depth + 1);
}

/* Tries the minima on a piece and at its beginning, and at the end of an open path. */
static void search_piece (search *s, int i) {
  const pw_path *p = s->p;
  double before[6], b[6];
  search_bernstein (s, &p->piece[i > 0 ? i - 1 : p->pieces - 1], before);
  search_bernstein (s, &p->piece[i], b);
  if (b[0] >= 0 && (before[5] < 0 || (i == 0 && !p->closed))) search_try (s, i, 0);
  search_minima (s, i, b, 0, 1, 0);
  if (b[5] < 0 && i == p->pieces - 1 && !p->closed) search_try (s, i, 1);
}

static void search_all (search *s) {
  const pw_path *p = s->p;
  double slope[3], bound = INFINITY;
  for (int i = 0, stride = (int)sqrt (p->pieces); i < p->pieces; i += stride)
    bound = fmin (bound, search_distance (s, &p->piece[i], 0, slope));
  bound *= 1 + 1e-9; /* beyond round-off */
  for (int i = 0; i < p->pieces;) {
    const double far = search_distance (s, &p->piece[i], 0, slope) - bound;
    const int next = far > p->piece[i].size ? place_piece (p, p->piece[i].s + far) : i;
    if (next == i) search_piece (s, i);
    bound = fmin (bound, s->least * (1 + 1e-9));
    i = next > i ? next : i + 1;
  }
}

/* Searches the minimum of the distance next to an arc length. */
static void search_near (search *s) {
  const pw_path *p = s->p;
  const place from = place_at (p, s->near);
  for (int step = -1; step <= 1; step += 2)
    for (int n = step > 0; n <= p->pieces; n++) {
      int i = from.i + step * n;
      const int lap = (i >= p->pieces) - (i < 0);
      if (lap != 0 && !p->closed) break;
      i -= lap * p->pieces, s->lap = from.lap + lap;
      const double start = p->piece[i].s + s->lap * p->length;
      if (fmax (start - s->near, s->near - start - p->piece[i].size) > s->least) break;
      search_piece (s, i);
    }
}

/* At a corner of a polyline, to which the place nearest to the point belongs: the direction turns with the point. */
static void search_corner (const search *s, pw_path_place *out) {
  const pw_path *p = s->p;
  const place *at = &s->best;
  const double x = s->x - out->x, y = s->y - out->y, d = hypot (x, y);
  if (!p->is_linear || at->u != 0 || at->beyond != 0 || d == 0 || (at->i == 0 && !p->closed)) return;
  const piece *after = &p->piece[at->i], *before = at->i > 0 ? after - 1 : &p->piece[p->pieces - 1];
  const int left =
      before->x[0][1] * after->x[1][1] - before->x[1][1] * after->x[0][1] > 0; /* the turn; the point is on its right */
  out->corner = 1;
  out->offset = left ? -d : d;
  out->cos = (left ? -y : y) / d, out->sin = (left ? x : -x) / d;
  out->heading = before->heading - (at->i > 0 ? 0 : p->turn) + at->lap * p->turn +
                 atan2 (before->x[0][1] * out->sin - before->x[1][1] * out->cos,
                        before->x[0][1] * out->cos + before->x[1][1] * out->sin);
}

void pw_path_nearest (const pw_path *p, double x, double y, double near, pw_path_place *out) {
  search s = { .p = p, .x = x, .y = y, .near = near, .least = INFINITY };
  if (!isfinite (x) || !isfinite (y) || (!isfinite (near) && near != INFINITY)) {
    pw_path_at (p, NAN, out);
    return;
  }
  if (isfinite (near))
    search_near (&s);
  else
    search_all (&s);
  place_describe (p, &s.best, out);
  out->offset = out->cos * (y - out->y) - out->sin * (x - out->x);
  search_corner (&s, out);
}
