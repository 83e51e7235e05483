/* Reads the outline of a body from a drawing in SVG: the first path, polygon or polyline outside of definitions; of a
 * path the first part, with curves as lines.  Transformations are refused but translations. */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

enum { SVG_LINES = 12 /* of a curve */ };

typedef struct {
  const char *at;
  pw_corners *points;
  double now[2], control[2]; /* the last point; the last control point, for smooth curves */
} svg;

/* Skips blanks and commas, and reads a number, which the next one may follow without them: "1.5-2.5". */
static int svg_number (svg *s, double *value) {
  char text[60];
  s->at += strspn (s->at, " \t\r\n,");
  const size_t sign = *s->at == '-' || *s->at == '+', n = pw_number_size (s->at + sign);
  if (n == 0 || sign + n >= sizeof text) return 0;
  pw_print (text, sizeof text, "%.*s", (int)(sign + n), s->at);
  s->at += sign + n;
  return pw_read_number (text, value) == PW_OK;
}

/* Skips blanks and commas; 1 if the attribute ends there. */
static int svg_ends (svg *s) {
  s->at += strspn (s->at, " \t\r\n,");
  return *s->at == '"' || *s->at == '\'';
}

/* Reads a point, from the last one if it is relative. */
static int svg_point (svg *s, int relative, double point[2]) {
  for (int i = 0; i < 2; i++) {
    if (!svg_number (s, &point[i])) return 0;
    if (relative) point[i] += s->now[i];
  }
  return 1;
}

static int svg_add (svg *s, const double point[2]) {
  memcpy (s->now, point, sizeof s->now);
  memcpy (s->control, point, sizeof s->control);
  pw_corners *p = s->points;
  if (pw_grow (&p->point, p->count, &p->room, sizeof *p->point) != PW_OK) return PW_RESOURCE;
  p->point[p->count][0] = point[0];
  p->point[p->count++][1] = -point[1]; /* y points downwards in a drawing */
  return PW_OK;
}

/* A cubic Bezier curve from the last point. */
static int svg_curve (svg *s, const double b[2], const double c[2], const double d[2]) {
  const double a[2] = { s->now[0], s->now[1] }, control[2] = { c[0], c[1] };
  int status = PW_OK;
  for (int i = 1; i <= SVG_LINES && status == PW_OK; i++) {
    const double t = (double)i / SVG_LINES, u = 1 - t;
    double point[2];
    for (int k = 0; k < 2; k++)
      point[k] = i < SVG_LINES ? u * u * (u * a[k] + 3 * t * b[k]) + t * t * (3 * u * c[k] + t * d[k]) : d[k];
    status = svg_add (s, point);
  }
  memcpy (s->control, control, sizeof control);
  return status;
}

/* The curves of a command: C, S with a reflected control point; Q, T of degree 2.  1: read; 0: numbers are missing. */
static int svg_curves (svg *s, char command, int relative, int *status) {
  double p[3][2], reflected[2];
  const int cubic = command == 'C' || command == 'S', smooth = command == 'S' || command == 'T';
  const int from = smooth ? 1 : 0, count = cubic ? 3 : 2;
  for (int k = 0; k < 2; k++) p[0][k] = reflected[k] = 2 * s->now[k] - s->control[k];
  for (int i = from; i < count; i++)
    if (!svg_point (s, relative, p[i])) return 0;
  if (cubic) return *status = svg_curve (s, p[0], p[1], p[2]), 1;
  double b[2], c[2];
  for (int k = 0; k < 2; k++) b[k] = (s->now[k] + 2 * p[0][k]) / 3, c[k] = (p[1][k] + 2 * p[0][k]) / 3;
  *status = svg_curve (s, b, c, p[1]);
  memcpy (s->control, p[0], sizeof s->control);
  return 1;
}

/* Reads the first part of a path; returns what is wrong, or "". */
static const char *svg_path (svg *s, int *status) {
  char command = 0, last = 0;
  int relative = 0;
  for (int first = 1; *status == PW_OK; first = 0) {
    if (svg_ends (s)) return first ? "its path is empty" : "";
    if (isalpha ((unsigned char)*s->at))
      relative = islower ((unsigned char)*s->at), command = (char)toupper ((unsigned char)*s->at++);
    if ((command == 'M' && !first) || command == 'Z') return "";
    if (first && command != 'M') return "its path does not begin with M";
    double point[2] = { s->now[0], s->now[1] };
    int read = 1;
    if (command == 'M' || command == 'L') {
      read = svg_point (s, relative, point);
      command = 'L';
    } else if (command == 'H' || command == 'V') {
      const int k = command == 'V';
      read = svg_number (s, &point[k]);
      if (relative) point[k] += s->now[k];
    } else if (strchr ("CSQT", command)) {
      if (!strchr (command == 'S' || command == 'C' ? "CS" : "QT", last)) memcpy (s->control, s->now, sizeof s->now);
      read = svg_curves (s, command, relative, status);
    } else
      return command == 'A' ? "it has an arc: convert arcs to curves" : "its path has an unknown command";
    if (!read) return "a number of its path is missing";
    if (!strchr ("CSQT", command)) *status = svg_add (s, point);
    last = command;
  }
  return "";
}

/* The value of an attribute in a tag, after its quote; NULL: it has none. */
static const char *svg_attribute (const char *tag, const char *name) {
  const size_t end = strcspn (tag, ">"), n = strlen (name);
  for (const char *c = tag; (c = strstr (c, name)) != NULL && c + n < tag + end; c += n)
    if (isspace ((unsigned char)c[-1]) && c[n] == '=' && (c[n + 1] == '"' || c[n + 1] == '\'')) return c + n + 2;
  return NULL;
}

const char *pw_svg_outline (const char *text, pw_corners *points, int *status) {
  svg s = { .points = points };
  *status = PW_OK;
  for (const char *tag = text; (tag = strchr (tag, '<')) != NULL; tag++) {
    const char *end = strncmp (tag, "<!--", 4) == 0 ? "-->" : strncmp (tag, "<defs", 5) == 0 ? "</defs>" : NULL;
    if (end && strstr (tag, end)) tag = strstr (tag, end);
    if (end) continue;
    const char *transform = svg_attribute (tag, "transform"), *polygon;
    const size_t n = transform ? strcspn (transform, ")") : 0;
    if (transform &&
        (strncmp (transform, "translate", 9) != 0 || transform[n] != ')' || transform[n + 1] != transform[-1]))
      return "it has transformations: apply them in the program that has drawn it";
    if (strncmp (tag, "<path", 5) == 0 && (s.at = svg_attribute (tag, "d")) != NULL) return svg_path (&s, status);
    if ((strncmp (tag, "<polygon", 8) != 0 && strncmp (tag, "<polyline", 9) != 0) ||
        (polygon = svg_attribute (tag, "points")) == NULL)
      continue;
    double point[2];
    for (s.at = polygon; *status == PW_OK && !svg_ends (&s); *status = svg_add (&s, point))
      if (!svg_point (&s, 0, point)) return "a number of its points is missing";
    return "";
  }
  return "it has no path, polygon or polyline: convert its objects to paths";
}
