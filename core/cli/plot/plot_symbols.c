/* Symbols of elements in figures, and the hatching of the ground.
 *
 * The text of a symbol (pw_kind.symbol) consists of strokes separated by semicolons.  A stroke is a list of vertices "a x y":
 * the point p1 + a (p2 - p1) + u (x e + y n), where p1 and p2 are the points of the first and the last body, u the unit of
 * symbols, e a direction and n its normal to the left.  e is the heading of a contact point, or that of the field
 * `heading` in the last body; without them the direction from p1 to p2, or the x axis of the first body if they
 * coincide.  x = inf and -inf extend to the ends of the travel along e.  "o a x y r" is a circle of radius u r; "g1"
 * and "g2" are the pitch circles of gears with the axles p1 and p2 and the field `ratio`.  A stroke whose last vertex
 * is its first encloses an area, which hides what is below. "NAME:" before a stroke: it is drawn if that field of the
 * element is not zero; "NAME=2:": if it is 2. */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "plot.h"

enum { SYMBOL_CIRCLE = 24 }; /* vertices of a circle */

/* The value of a number or a choice of an element; 0 if it has no such field. */
static double symbol_field (const pw_plot_link *link, const char *name, size_t length) {
  const pw_field *f = link->kind->fields;
  while (f->name && (strncmp (f->name, name, length) != 0 || f->name[length])) f++;
  if (f->name == NULL) return 0;
  const void *at = (const char *)link->definition + f->offset;
  return f->type == PW_NUMBER ? *(const double *)at : f->type == PW_CHOICE ? *(const int *)at : 0;
}

double pw_plot_heading (const pw_plot_link *link) {
  return symbol_field (link, "heading", 7);
}

/* Reads a condition; 0 if it does not hold. */
static int symbol_condition (const pw_plot_link *link, const char **text) {
  const char *name = *text, *colon = name + strcspn (name, ":;");
  size_t n = strcspn (name, "=:");
  if (*colon != ':') return 1;
  double value = symbol_field (link, name, n);
  *text = colon + 1;
  return name[n] == '=' ? value == strtod (name + n + 1, NULL) : value != 0;
}

/* A circle of radius u r + d |p2 - p1| around a vertex. */
static void symbol_circle (pw_plot_stroke *s, const double *centre, double r, double d) {
  const double step = 2 * acos (-1) / SYMBOL_CIRCLE;
  for (int i = 0; i <= SYMBOL_CIRCLE; i++) {
    double c = cos (step * (i % SYMBOL_CIRCLE)), n = sin (step * (i % SYMBOL_CIRCLE));
    double vertex[] = { centre[0] + d * c, centre[1] + r * c, centre[2] + r * n, d * n };
    memcpy (s->at[s->count++], vertex, sizeof vertex);
  }
}

/* Radii R1 and R2 = |i| R1 of the ratio i: R1 + R2 = |p2 - p1| if i < 0, |R1 - R2| if i > 0 and one is a ring (Willis
 * 1870); equal circles for i = 1. */
static void symbol_gear (const pw_plot_link *link, pw_plot_stroke *s, int second) {
  double i = symbol_field (link, "ratio", 5), first = i == 1 ? 0.5 : 1 / fabs (1 - i);
  symbol_circle (s, (const double[]){ second, 0, 0 }, 0, second ? first * fabs (i) : first);
}

/* Numbers, at most `most`. */
static int symbol_numbers (const char **text, double *out, int most) {
  char *end;
  int n = 0;
  for (; n < most; n++, *text = end) {
    out[n] = strtod (*text, &end);
    if (end == *text) break;
  }
  return n;
}

/* The next stroke of a symbol, without vertices if its condition does not hold; 0 after the last one. */
static int symbol_next (const pw_plot_link *link, const char **text, pw_plot_stroke *s) {
  double x[4];
  s->count = s->upright = 0;
  while (isspace ((unsigned char)**text) || **text == ';') ++*text;
  if (**text == 0) return 0;
  int drawn = symbol_condition (link, text);
  *text += strspn (*text, " ");
  if (**text == 'g') {
    symbol_gear (link, s, (*text)[1] == '2');
  } else if (**text == 'o' && ++*text && symbol_numbers (text, x, 4) == 4) {
    symbol_circle (s, x, x[3], 0);
  } else {
    while (s->count < PLOT_VERTICES && symbol_numbers (text, x, 3) == 3)
      memcpy (s->at[s->count++], (const double[]){ x[0], x[1], x[2], 0 }, sizeof *s->at);
  }
  *text += strcspn (*text, ";");
  s->closed = s->count > 2 && memcmp (s->at[0], s->at[s->count - 1], sizeof *s->at) == 0;
  if (!drawn) s->count = 0;
  return 1;
}

/* ---- In the inertial frame ---- */

typedef struct {
  double p[2], d[2], e[2]; /* p1, p2 - p1, direction */
} symbol_frame;

void pw_plot_end (const pw_plots *p, int i, const pw_plot_link *link, int n, double out[2]) {
  static const double ground[3] = { 0 };
  int body = link->end[n].body;
  pw_plot_point (body < 0 ? ground : pw_plot_track (p, i, &p->bodies, body), link->end[n].at, out);
}

static symbol_frame symbol_place (const pw_plots *p, int i, const pw_plot_link *link) {
  symbol_frame f;
  int last = link->ends - 1, body = link->end[link->rail ? last : 0].body;
  double p2[2], angle = body < 0 ? 0 : pw_plot_track (p, i, &p->bodies, body)[2];
  pw_plot_end (p, i, link, 0, f.p);
  pw_plot_end (p, i, link, last, p2);
  f.d[0] = p2[0] - f.p[0], f.d[1] = p2[1] - f.p[1];
  if (link->contact >= 0)
    angle = pw_plot_track (p, i, &p->wheels, link->contact)[2];
  else if (link->rail)
    angle += pw_plot_heading (link);
  else if (hypot (f.d[0], f.d[1]) > 1e-9 * p->unit)
    angle = atan2 (f.d[1], f.d[0]);
  f.e[0] = cos (angle), f.e[1] = sin (angle);
  return f;
}

/* The ends of the travel of p1 along a rail and of its symbol, from p2, in units of symbols. */
static void symbol_travel (const pw_plots *p, const pw_plot_link *link, int samples, double *low, double *high) {
  *low = *high = 0;
  for (int i = 0; i < samples && link->rail; i++) {
    symbol_frame f = symbol_place (p, i, link);
    double s = -(f.d[0] * f.e[0] + f.d[1] * f.e[1]) / p->unit;
    *low = fmin (*low, s), *high = fmax (*high, s);
  }
  *low -= 2.5, *high += 2.5;
}

/* Hatching of the line from x0 to x1 at height y relative to p2, on its lower side. */
static int symbol_hatch (double x0, double x1, double y, int upright, pw_plot_stroke *s) {
  int strokes = (int)fmin (PLOT_HATCHES, ceil ((x1 - x0) / 0.6));
  for (int k = 0; k < strokes; k++) {
    double x = x0 + (x1 - x0) * (k + 0.5) / strokes;
    s[k] = (pw_plot_stroke){ 2, 0, upright, { { 1, x + 0.25, y }, { 1, x - 0.25, y - 0.5 } } };
  }
  return strokes;
}

/* A rail on the ground, or a support of a joint on the ground. */
static int symbol_ground (double low, double high, const pw_plot_link *link, pw_plot_stroke *s) {
  static const pw_plot_stroke support = {
    6, 0, 1, { { 1, 1.1, -1.5 }, { 1, .8, -1.5 }, { 1, 0, 0 }, { 1, -.8, -1.5 }, { 1, -1.1, -1.5 }, { 1, 1.1, -1.5 } }
  };
  const double groove = -.4; /* the lower edge of a slot, as in the symbols of element types */
  if (link->rail) return symbol_hatch (low, high, strstr (link->kind->symbol, "1 -inf -") ? groove : 0, 0, s);
  *s = support;
  return 1 + symbol_hatch (-1.1, 1.1, -1.5, 1, s + 1);
}

int pw_plot_strokes (const pw_plots *p, const pw_plot_link *link, int samples, pw_plot_stroke stroke[PLOT_STROKES]) {
  int ground = link->end[link->ends - 1].body < 0 || link->end[0].body < 0, n = 0;
  double low, high;
  if (link->kind->symbol == NULL) return 0;
  symbol_travel (p, link, samples, &low, &high);
  if (ground) n = symbol_ground (low, high, link, stroke);
  for (const char *text = link->kind->symbol; n < PLOT_STROKES && symbol_next (link, &text, &stroke[n]);) {
    pw_plot_stroke *s = &stroke[n];
    for (int k = 0; k < s->count; k++)
      if (isinf (s->at[k][1])) s->at[k][1] = s->at[k][1] > 0 ? high : low;
    n += s->count > 0;
  }
  return n;
}

void pw_plot_place (const pw_plots *p, int i, const pw_plot_link *link, const pw_plot_stroke *s, double (*at)[2]) {
  symbol_frame f = symbol_place (p, i, link);
  if (s->upright) f.e[0] = 1, f.e[1] = 0;
  if (s->upright && link->end[0].body < 0) f.d[0] = f.d[1] = 0;
  for (int k = 0; k < s->count; k++) {
    const double *v = s->at[k];
    at[k][0] = f.p[0] + v[0] * f.d[0] - v[3] * f.d[1] + p->unit * (v[1] * f.e[0] - v[2] * f.e[1]);
    at[k][1] = f.p[1] + v[0] * f.d[1] + v[3] * f.d[0] + p->unit * (v[1] * f.e[1] + v[2] * f.e[0]);
  }
}
