/* Shapes of bodies in figures and animations, and the elements drawn between them (links). */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include "plot.h"

static int shapes_order (const void *a, const void *b) {
  const double *p = a, *q = b;
  return p[0] != q[0] ? (p[0] > q[0]) - (p[0] < q[0]) : (p[1] > q[1]) - (p[1] < q[1]);
}

/* The convex hull by monotone chains (Andrew 1979): below from left to right, then above from right to left. */
static void shapes_outline (pw_plot_body *shape) {
  double point[PLOT_ATTACHMENTS + 1][2] = { { 0, 0 } }, hull[2 * PLOT_ATTACHMENTS + 2][2], size = 0;
  int n = shape->attachments + 1, corners = 0;
  memcpy (point + 1, shape->attachment, (size_t)shape->attachments * sizeof *point);
  qsort (point, (size_t)n, sizeof *point, shapes_order);
  for (int i = 0; i < n; i++) size = fmax (size, hypot (point[i][0], point[i][1]));
  for (int i = 0, least = 2; i < 2 * n - 1; i++) {
    const double *next = point[i < n ? i : 2 * n - 2 - i];
    if (i == n) least = corners + 1;
    for (; corners >= least; corners--) {
      const double *a = hull[corners - 2], *b = hull[corners - 1];
      const double doubled_area = (b[0] - a[0]) * (next[1] - a[1]) - (b[1] - a[1]) * (next[0] - a[0]);
      if (doubled_area > 1e-9 * size * size) break; /* they turn to the left */
    }
    if (i < 2 * n - 2) memcpy (hull[corners++], next, sizeof *hull);
  }
  shape->corners = corners < 3 ? 0 : corners;
  memcpy (shape->hull, hull, (size_t)shape->corners * sizeof *hull);
  shape->corner = (const double (*)[2])shape->hull;
}

int pw_plot_inside (const pw_plot_body *shape, int k) {
  if (shape->corners && shape->corner != (const double (*)[2])shape->hull) return 0;
  for (int i = 0; i < shape->corners; i++)
    if (memcmp (shape->corner[i], shape->attachment[k], sizeof shape->attachment[k]) == 0) return 0;
  return 1;
}

/* The points of an element on the bodies drawn, each once and without the centre of mass, which is always drawn; and on
 * the ground. */
static void shapes_add_points (pw_plots *plots, const pw_element *e, const int *bodies) {
  for (int n = 0; n < e->kind->bodies; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int b = plots->body_index[bodies[n]], known = 0;
    pw_plot_body *shape = at && b >= 0 && (at[0] != 0 || at[1] != 0) ? &plots->shape[b] : NULL;
    for (int i = 0; shape && i < shape->attachments; i++)
      known |= shape->attachment[i][0] == at[0] && shape->attachment[i][1] == at[1];
    if (shape && !known && shape->attachments < PLOT_ATTACHMENTS)
      memcpy (shape->attachment[shape->attachments++], at, 2 * sizeof *at);
    if (at && b == PLOT_GROUND && plots->grounds < PLOT_DRAWN)
      memcpy (plots->ground[plots->grounds++], at, 2 * sizeof *at);
  }
}

/* The field of an element type whose name has `length` characters, or the end of the fields, without a name. */
static const pw_field *shapes_find (const pw_kind *kind, const char *name, size_t length) {
  const pw_field *f = kind->fields;
  while (f->name && (strncmp (f->name, name, length) != 0 || f->name[length])) f++;
  return f;
}

/* The value of a number or a choice of an element, 1 for a path; 0 if it has no such field. */
static double shapes_field (const pw_kind *kind, const void *definition, const char *name, size_t length) {
  const pw_field *f = shapes_find (kind, name, length);
  if (f->name == NULL) return 0;
  const void *at = (const char *)definition + f->offset;
  if (f->type == PW_TRACK) return *(pw_path *const *)at != NULL;
  return f->type == PW_NUMBER ? *(const double *)at : f->type == PW_CHOICE ? *(const int *)at : 0;
}

/* The discs of an element, each once. */
static void shapes_add_discs (pw_plots *plots, const pw_element *e, const int *bodies) {
  char field[32];
  int n;
  for (const char *text = e->kind->symbol; text; text = strchr (text, ';')) {
    if (sscanf (text += *text == ';', " d %d %31[a-z_]", &n, field) != 2 || plots->discs == PLOT_DRAWN) continue;
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    const pw_plot_disc disc = { plots->body_index[bodies[n]],
                                { at[0], at[1], shapes_field (e->kind, e->definition, field, strlen (field)) } };
    int known = disc.body == PLOT_HIDDEN || disc.at[2] == 0;
    for (const pw_plot_disc *d = plots->disc; d < plots->disc + plots->discs; d++)
      known |= d->body == disc.body && memcmp (d->at, disc.at, sizeof disc.at) == 0;
    if (!known) plots->disc[plots->discs++] = disc;
  }
}

/* Adds an end at the joint of two bodies, the first one's end of an earlier link between them; 0 if there is none. */
static int shapes_add_joint (const pw_plots *plots, int first, int second, pw_plot_link *link) {
  for (const pw_plot_link *l = plots->link; l < plots->link + plots->links; l++)
    for (int n = 0; n < 2 && l->ends == 2 && !l->rail; n++)
      if (l->end[n].body == first && l->end[1 - n].body == second) {
        link->end[link->ends++] = l->end[n];
        return 1;
      }
  return 0;
}

/* Places an element without points at the joints of its bodies with the last one; 0 if it cannot be drawn there. */
static int shapes_at_joints (const pw_plots *plots, const pw_element *e, const int *bodies, pw_plot_link *link) {
  if (e->kind->bodies == 0) return 0;
  int last = plots->body_index[bodies[e->kind->bodies - 1]];
  for (int n = 0; n < e->kind->bodies - 1 && link->ends < 2; n++)
    if (!shapes_add_joint (plots, plots->body_index[bodies[n]], last, link)) return 0;
  return e->kind->symbol && link->ends > 0;
}

/* 1 if the two points of an element are optional and not given. */
static int shapes_without_points (const pw_element *e) {
  const pw_field *f = e->kind->fields;
  while (f->name && f->type != PW_POINT) f++;
  const double *at =
      f->name && !f->required && f->count == 2 ? pw_field_at (e->kind, e->definition, PW_POINT, 0) : NULL;
  return at && at[0] == 0 && at[1] == 0 && at[2] == 0 && at[3] == 0;
}

/* Fills a link; 0 if the element has no place, or one of its bodies is not drawn. */
static int shapes_link (const pw_plots *plots, const pw_element *e, int element, pw_plot_link *link) {
  const pw_element_info info = pw_system_element (plots->system, element);
  *link = (pw_plot_link){ .element = element,
                          .kind = e->kind,
                          .definition = e->definition,
                          .rail = e->kind->symbol && (strstr (e->kind->symbol, "inf") || strchr (e->kind->symbol, '@')),
                          .force_end = -1,
                          .companion_offset = -1,
                          .wheel = plots->wheels.drawn - 1 };
  while (link->wheel >= 0 && plots->wheels.system_index[link->wheel] != element) link->wheel--;
  for (int n = 0; n < e->kind->bodies && link->ends < 2; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int body = plots->body_index[info.body[n]];
    if (at == NULL) continue;
    if (body == PLOT_HIDDEN) return 0;
    if (link->force_end < 0 && body >= 0) link->force_end = link->ends, link->force_offset = info.force + 3 * n;
    link->end[link->ends].body = body;
    memcpy (link->end[link->ends++].at, at, 2 * sizeof *at);
  }
  pw_plot_link joint = *link;
  joint.ends = 0;
  if ((link->ends == 0 || shapes_without_points (e)) && shapes_at_joints (plots, e, info.body, &joint)) {
    *link = joint;
    if (link->force_end >= link->ends) link->force_end = -1; /* the end that is not at the joint */
    return 1;
  }
  if (shapes_without_points (e) && shapes_field (e->kind, e->definition, "what", 4) == PW_DRIVE_ANGLE) return 0;
  return link->force_end >= 0;
}

pw_plot_link *pw_plot_accompanied (const pw_plots *plots, const pw_element_info *companion) {
  for (pw_plot_link *link = plots->link; link < plots->link + plots->links; link++)
    if (link->kind->companion == companion->kind &&
        strcmp (*(const char *const *)link->definition, companion->name) == 0)
      return link;
  return NULL;
}

/* A system has its elements sorted by type; those of a type are in the order of the model, which has no companions. */
void pw_plot_find_shapes (pw_plots *plots) {
  int most = plots->links, elements, next = 0;
  const pw_element *e = pw_model_elements (plots->model, &elements);
  const double *mass = pw_system_mass (plots->system);
  const pw_kind *last = NULL;
  plots->links = 0;
  for (int i = 0; i < pw_system_elements (plots->system); i++) {
    const pw_element_info info = pw_system_element (plots->system, i);
    if (info.kind->each_body) continue;
    if (info.kind != last) next = 0;
    last = info.kind;
    while (next < elements && e[next].kind != last) next++;
    pw_plot_link *link = next == elements ? pw_plot_accompanied (plots, &info) : NULL;
    if (link) /* both have the same bodies */
      link->companion_offset = link->force_offset + info.force - pw_system_element (plots->system, link->element).force;
    if (next == elements) continue;
    shapes_add_points (plots, &e[next], info.body);
    shapes_add_discs (plots, &e[next], info.body);
    if (plots->links < most) plots->links += shapes_link (plots, &e[next], i, &plots->link[plots->links]);
    next++;
  }
  for (int b = 0; b < plots->bodies.drawn; b++) {
    const double *M = mass + 3 * plots->bodies.system_index[b];
    plots->shape[b].is_point_mass = M[0] > 0 && M[2] == 0;
    const pw_body *body = pw_model_bodies (plots->model, &(int){ 0 }) + plots->bodies.system_index[b];
    if (body->corners)
      plots->shape[b].corners = body->corners, plots->shape[b].corner = body->outline;
    else
      shapes_outline (&plots->shape[b]);
  }
}

void pw_plot_point (const double *placement, const double *at, double out[2]) {
  double c = cos (placement[2]), s = sin (placement[2]);
  out[0] = placement[0] + c * at[0] - s * at[1];
  out[1] = placement[1] + s * at[0] + c * at[1];
}

/* Symbols of elements in figures, and the hatching of the ground.
 *
 * The text of a symbol (pw_kind.symbol) consists of strokes separated by semicolons.  A stroke is a list of vertices
 * "a x y": the point p1 + a (p2 - p1) + u (x e + y n), as in pw_plot_stroke, where p1 and p2 are the points of the
 * first and the last body, u the unit of symbols, e a direction and n its normal to the left.  For a contact point e is
 * its heading; for a symbol with a rail or a length, the field `heading` in the last body; otherwise the direction from
 * p1 to p2, or the x axis of the first body if these coincide.  In a rail, x = inf and x = -inf are the ends of the
 * travel of p1 along e.  "@NAME" in place of x or y is the length in that field of the element.
 *
 * "o a x y r" is a circle of radius u r around that point; "g1" and "g2" are the pitch circles of gears with the axles
 * p1 and p2 and the field `ratio`; "h y" is a hatching below the rail at this y; "p" is the path of the element.  A
 * stroke whose last vertex is its first encloses an area, which hides what is below.  "d n NAME" is the disc of radius
 * NAME of body n, around its point: it is drawn with the body.  "NAME:" before a stroke: it is drawn if that field is
 * not zero or, of an optional number, given; "NAME=2:": if it is 2; "ground:": if the last body is the ground. */

enum { SYMBOL_CIRCLE = 24 }; /* sides of the polygon of a circle */
#define SYMBOL_HATCH 0.6     /* distance of the strokes of a hatching, in units of symbols */
#define SYMBOL_OVERHANG 2.5  /* of a rail beyond the travel, in units of symbols */

static double symbol_field (const pw_plot_link *link, const char *name, size_t length) {
  return shapes_field (link->kind, link->definition, name, length);
}

double pw_plot_heading (const pw_plot_link *link) {
  return symbol_field (link, "heading", 7);
}

/* 1 if a field of an element is not zero, or is an optional number that is given. */
static int symbol_has (const pw_plot_link *link, const char *name, size_t length) {
  const pw_field *f = shapes_find (link->kind, name, length);
  return symbol_field (link, name, length) != 0 ||
         (f->name && f->given && *(const int *)((const char *)link->definition + f->given) != 0);
}

/* Reads conditions; 0 if one of them does not hold. */
static int symbol_conditions (const pw_plot_link *link, const char **text) {
  int hold = 1;
  for (const char *colon; (colon = *text + strcspn (*text, ":;"), *colon == ':'); *text = colon + 1) {
    const char *name = *text + strspn (*text, " ");
    const size_t length = strcspn (name, "=:");
    if (name[length] == '=')
      hold &= symbol_field (link, name, length) == strtod (name + length + 1, NULL);
    else if (length == 6 && strncmp (name, "ground", length) == 0)
      hold &= link->end[link->ends - 1].body == PLOT_GROUND;
    else
      hold &= symbol_has (link, name, length);
  }
  *text += strspn (*text, " ");
  return hold;
}

/* A circle around a vertex, of radius u r or d |p2 - p1|: r or d is 0. */
static void symbol_circle (pw_plot_stroke *stroke, const double *centre, double r, double d) {
  const double step = 2 * PW_PI / SYMBOL_CIRCLE;
  for (int i = 0; i <= SYMBOL_CIRCLE; i++) {
    double c = cos (step * (i % SYMBOL_CIRCLE)), s = sin (step * (i % SYMBOL_CIRCLE));
    double vertex[] = { centre[0] + d * c, centre[1] + r * c, centre[2] + r * s, d * s };
    memcpy (stroke->vertex[stroke->vertices++], vertex, sizeof vertex);
  }
}

/* Reads numbers, at most `most`, with lengths in the unit u; returns how many there are. */
static int symbol_numbers (const pw_plot_link *link, double u, const char **text, double *out, int most) {
  int n = 0;
  for (char *end; n < most; n++) {
    const char *name = *text + strspn (*text, " ");
    if (*name == '@') {
      const size_t length = strcspn (++name, " ;");
      out[n] = symbol_field (link, name, length) / u, *text = name + length;
      continue;
    }
    out[n] = strtod (*text, &end);
    if (end == *text) break;
    *text = end;
  }
  return n;
}

/* Hatching below the line from x0 to x1 at height y relative to p1 + d, of at most `most` strokes: at the same places
 * relative to x = at, however long the line is.  Returns the number of strokes. */
static int symbol_hatch (double x0, double x1, double y, double at, int upright, int most, pw_plot_stroke *stroke) {
  double step = SYMBOL_HATCH;
  int strokes = 0;
  while ((x1 - x0) / step > PLOT_HATCHES) step *= 2;
  for (double k = ceil ((x0 - at) / step); strokes < most && at + k * step < x1; k++) {
    const double x = at + k * step, side = 0.4 * step;
    stroke[strokes++] = (pw_plot_stroke){ 2, 0, upright, { { 1, x + side, y }, { 1, x - side, y - 2 * side } } };
  }
  return strokes;
}

/* The path of an element between its ends, relative to p2, and hatching on its right; room: for PLOT_STROKES / 2
 * strokes at least.  Returns the number of strokes. */
static int symbol_path (const pw_plot_link *link, double u, int room, pw_plot_stroke *stroke) {
  enum { PIECES = 10, INTERVALS = PLOT_VERTICES - 1 };
  const pw_path *path = *(pw_path *const *)pw_field_at (link->kind, link->definition, PW_TRACK, 0);
  const double length = pw_path_length (path);
  const int hatches = (int)fmin (room - PIECES, length / u / SYMBOL_HATCH);
  pw_path_place at;
  for (int n = 0; n < PIECES; n++) {
    stroke[n] = (pw_plot_stroke){ PLOT_VERTICES, 0, 0, { { 0 } } };
    for (int k = 0; k < PLOT_VERTICES; k++) {
      pw_path_at (path, length * (n * INTERVALS + k) / (PIECES * INTERVALS), &at);
      memcpy (stroke[n].vertex[k], (const double[]){ 1, at.x / u, at.y / u, 0 }, sizeof *stroke[n].vertex);
    }
  }
  for (int n = 0; n < hatches; n++) {
    const double side = 0.4 * length / u / hatches;
    pw_path_at (path, length * (n + 0.5) / hatches, &at);
    stroke[PIECES + n] =
        (pw_plot_stroke){ 2,
                          0,
                          0,
                          { { 1, at.x / u, at.y / u },
                            { 1, at.x / u + side * (at.sin - at.cos), at.y / u - side * (at.sin + at.cos) } } };
  }
  return PIECES + hatches;
}

/* The ends of a rail along e from p2, and the origin of the last body, in units of symbols. */
typedef struct {
  double low, high, origin;
} symbol_rail;

/* Reads the next part of a symbol; *strokes: room for them; their number, 0 if its conditions do not hold.  0 after the
 * last one. */
static int symbol_next (const pw_plot_link *link, double u, symbol_rail rail, const char **text, pw_plot_stroke *stroke,
                        int *strokes) {
  const int room = *strokes;
  double number[4];
  *stroke = (pw_plot_stroke){ 0, 0, 0, { { 0 } } };
  *strokes = 0;
  while (isspace ((unsigned char)**text) || **text == ';') ++*text;
  if (**text == 0) return 0;
  const int drawn = symbol_conditions (link, text);
  if (**text == 'g') {
    /* a pitch circle of gears of the ratio i: the radii R1 and R2 = |i| R1 have R1 + R2 = |p2 - p1| if i < 0, and
     * |R1 - R2| = |p2 - p1| if i > 0 and one is a ring (Willis 1870); equal circles for i = 1 */
    const int second = (*text)[1] == '2';
    double i = symbol_field (link, "ratio", 5), first = i == 1 ? 0.5 : 1 / fabs (1 - i);
    symbol_circle (stroke, (const double[]){ second, 0, 0 }, 0, second ? first * fabs (i) : first);
  } else if (**text == 'p') {
    *strokes = drawn && symbol_field (link, "path", 4) != 0 ? symbol_path (link, u, room, stroke) : 0;
  } else if (**text == 'h' && ++*text && symbol_numbers (link, u, text, number, 1) == 1) {
    *strokes = drawn ? symbol_hatch (rail.low, rail.high, number[0], rail.origin, 0, room, stroke) : 0;
  } else if (**text == 'o' && ++*text && symbol_numbers (link, u, text, number, 4) == 4) {
    symbol_circle (stroke, number, number[3], 0);
  } else {
    while (stroke->vertices < PLOT_VERTICES && symbol_numbers (link, u, text, number, 3) == 3) {
      if (isinf (number[1])) number[1] = number[1] > 0 ? rail.high : rail.low;
      memcpy (stroke->vertex[stroke->vertices++], (const double[]){ number[0], number[1], number[2], 0 },
              sizeof *stroke->vertex);
    }
  }
  *text += strcspn (*text, ";");
  if (*strokes > 0) return 1;
  stroke->closed = stroke->vertices > 2 &&
                   memcmp (stroke->vertex[0], stroke->vertex[stroke->vertices - 1], sizeof *stroke->vertex) == 0;
  *strokes = drawn && stroke->vertices > 0;
  return 1;
}

/* The frame of a symbol, as in pw_plot_stroke. */
typedef struct {
  double p1[2], d[2], e[2];
} symbol_frame;

void pw_plot_end (const pw_plots *plots, int i, const pw_plot_link *link, int n, double out[2]) {
  static const double ground[3] = { 0 };
  int body = link->end[n].body;
  pw_plot_point (body < 0 ? ground : pw_plot_track (plots, i, &plots->bodies, body), link->end[n].at, out);
}

static symbol_frame symbol_frame_at (const pw_plots *plots, int i, const pw_plot_link *link) {
  symbol_frame frame;
  int last = link->ends - 1, body = link->end[link->rail ? last : 0].body;
  double p2[2], angle = body < 0 ? 0 : pw_plot_track (plots, i, &plots->bodies, body)[2];
  pw_plot_end (plots, i, link, 0, frame.p1);
  pw_plot_end (plots, i, link, last, p2);
  frame.d[0] = p2[0] - frame.p1[0], frame.d[1] = p2[1] - frame.p1[1];
  if (link->wheel >= 0)
    angle = pw_plot_track (plots, i, &plots->wheels, link->wheel)[2];
  else if (link->rail)
    angle += pw_plot_heading (link);
  else if (hypot (frame.d[0], frame.d[1]) > 1e-9 * plots->symbol_unit)
    angle = atan2 (frame.d[1], frame.d[0]);
  frame.e[0] = cos (angle), frame.e[1] = sin (angle);
  return frame;
}

/* A rail: beyond the ends of the travel of p1, and of its disc. */
static symbol_rail symbol_travel (const pw_plots *plots, const pw_plot_link *link, int samples) {
  const pw_plot_end_of *last = &link->end[link->ends - 1];
  const double heading = pw_plot_heading (link), u = plots->symbol_unit;
  const double beyond = SYMBOL_OVERHANG + symbol_field (link, "radius", 6) / u;
  symbol_rail rail = { 0, 0, -(last->at[0] * cos (heading) + last->at[1] * sin (heading)) / u };
  for (int i = 0; i < samples && link->rail; i++) {
    symbol_frame frame = symbol_frame_at (plots, i, link);
    double travel = -(frame.d[0] * frame.e[0] + frame.d[1] * frame.e[1]) / u;
    rail.low = fmin (rail.low, travel), rail.high = fmax (rail.high, travel);
  }
  rail.low -= beyond, rail.high += beyond;
  return rail;
}

/* The support of a joint, or of p1 on a rail, on the ground.  Returns the number of strokes. */
static int symbol_support (pw_plot_stroke *stroke) {
  static const pw_plot_stroke support = {
    6, 0, 1, { { 1, 1.1, -1.5 }, { 1, .8, -1.5 }, { 1, 0, 0 }, { 1, -.8, -1.5 }, { 1, -1.1, -1.5 }, { 1, 1.1, -1.5 } }
  };
  *stroke = support;
  return 1 + symbol_hatch (-1.1, 1.1, -1.5, -0.9, 1, PLOT_HATCHES, stroke + 1);
}

int pw_plot_strokes (const pw_plots *plots, const pw_plot_link *link, int samples,
                     pw_plot_stroke stroke[PLOT_STROKES]) {
  const int first = link->end[0].body == PLOT_GROUND, last = link->end[link->ends - 1].body == PLOT_GROUND;
  if (link->kind->symbol == NULL) return 0;
  const symbol_rail rail = symbol_travel (plots, link, samples);
  int n = (link->rail ? first && !last : first || last) ? symbol_support (stroke) : 0, more;
  for (const char *text = link->kind->symbol;
       (more = PLOT_STROKES - n) > 0 && symbol_next (link, plots->symbol_unit, rail, &text, &stroke[n], &more);)
    n += more;
  return n;
}

void pw_plot_place (const pw_plots *plots, int i, const pw_plot_link *link, const pw_plot_stroke *stroke,
                    double (*out)[2]) {
  symbol_frame frame = symbol_frame_at (plots, i, link);
  if (stroke->upright) frame.e[0] = 1, frame.e[1] = 0;
  if (stroke->upright && link->end[0].body < 0) frame.d[0] = frame.d[1] = 0;
  for (int k = 0; k < stroke->vertices; k++) {
    const double *vertex = stroke->vertex[k];
    out[k][0] = frame.p1[0] + vertex[0] * frame.d[0] - vertex[3] * frame.d[1] +
                plots->symbol_unit * (vertex[1] * frame.e[0] - vertex[2] * frame.e[1]);
    out[k][1] = frame.p1[1] + vertex[0] * frame.d[1] + vertex[3] * frame.d[0] +
                plots->symbol_unit * (vertex[1] * frame.e[1] + vertex[2] * frame.e[0]);
  }
}
