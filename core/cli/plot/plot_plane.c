/* Figures in the plane, with equal axes: paths, and the mechanism along its way.  Of a run that goes far the start is
 * drawn a second time, in detail. */
#include <math.h>
#include "plot_script.h"

enum {
  PLANE_GAP = 76,  /* between panels side by side [px] */
  PLANE_TALL = 680 /* highest panel [px] */
};

/* One or two panels with what they show. */
typedef struct {
  int count, samples[2]; /* of the run */
  pw_plot_box box[2];
  pw_panel panel[2];
} plane;

/* Widens a rectangle to a panel's proportions. */
static void plane_fit (pw_plot_box *box, const pw_panel *panel) {
  double w = box->x1 - box->x0, h = box->y1 - box->y0, x = (box->x0 + box->x1) / 2, y = (box->y0 + box->y1) / 2;
  double aspect = (panel->y1 - panel->y0) / (panel->x1 - panel->x0);
  h = fmax (h, w * aspect);
  w = h / aspect;
  *box = (pw_plot_box){ x - w / 2, x + w / 2, y - h / 2, y + h / 2 };
}

/* A margin around what is shown. */
static pw_plot_box plane_loosen (pw_plot_box box) {
  if (!(box.x1 >= box.x0)) box = (pw_plot_box){ 0, 0, 0, 0 };
  double edge = 0.05 * fmax (box.x1 - box.x0, box.y1 - box.y0);
  if (edge == 0) edge = 1;
  return (pw_plot_box){ box.x0 - edge, box.x1 + edge, box.y0 - edge, box.y1 + edge };
}

/* Height over width of a rectangle, as far as a panel follows it. */
static double plane_aspect (pw_plot_box box, double least, double most) {
  return fmin (fmax ((box.y1 - box.y0) / (box.x1 - box.x0), least), most);
}

/* One panel, as high as it should be; a tall one is made narrower. */
static void plane_single (plane *g, pw_script *s) {
  double wide = s->width - s->left - s->right, high = wide * plane_aspect (g->box[0], 0.3, 2);
  if (high > PLANE_TALL) {
    wide *= PLANE_TALL / high;
    high = PLANE_TALL;
    s->width = s->left + s->right + (int)wide;
  }
  g->panel[0] = (pw_panel){ s->left, s->left + wide, s->top, s->top + high };
  s->height = s->top + (int)high + s->bottom;
}

/* Two panels: a long straight way is drawn above its start, another one at its left. */
static void plane_pair (plane *g, pw_script *s) {
  s->top += SCRIPT_HEAD;
  if (plane_aspect (g->box[0], 0, 1) < 0.5) {
    double wide = s->width - s->left - s->right, first = wide * plane_aspect (g->box[0], 0.15, 0.5);
    double y = s->top + first + s->bottom + SCRIPT_HEAD, second = wide * plane_aspect (g->box[1], 0.25, 0.6);
    g->panel[0] = (pw_panel){ s->left, s->left + wide, s->top, s->top + first };
    g->panel[1] = (pw_panel){ s->left, s->left + wide, y, y + second };
    s->height = (int)(y + second) + s->bottom;
    return;
  }
  s->width = SCRIPT_WIDER;
  double wide = s->width - s->left - s->right - PLANE_GAP, first = 0.4 * wide;
  double high = fmax (first * plane_aspect (g->box[0], 0.5, 2), (wide - first) * plane_aspect (g->box[1], 0.5, 1.3));
  g->panel[0] = (pw_panel){ s->left, s->left + first, s->top, s->top + high };
  g->panel[1] = (pw_panel){ s->left + first + PLANE_GAP, s->left + wide + PLANE_GAP, s->top, s->top + high };
  s->height = s->top + (int)high + s->bottom;
}

static plane plane_lay_out (const pw_plots *p, pw_script *s, pw_plot_box (*box) (const pw_plots *p, int n)) {
  plane g = { .count = p->closeup > 0 ? 2 : 1, .samples = { p->samples, p->closeup } };
  for (int i = 0; i < g.count; i++) g.box[i] = plane_loosen (box (p, g.samples[i]));
  if (g.count == 1)
    plane_single (&g, s);
  else
    plane_pair (&g, s);
  for (int i = 0; i < g.count; i++) plane_fit (&g.box[i], &g.panel[i]);
  return g;
}

/* Title, place and ranges of panel i. */
static void plane_panel (const pw_script *s, const pw_plots *p, const plane *g, int i) {
  char t[32];
  if (g->count == 2 && i == 0) fputs ("set title 'whole run'\n", s->f);
  if (g->count == 2 && i == 1)
    fprintf (s->f, "set title 'the first %s s'\n", pw_format (t, pw_plot_sample (p, g->samples[1] - 1)[PLOT_T], 3));
  pw_script_panel (s, g->panel[i]);
  pw_script_range (s, "x", g->box[i].x0, g->box[i].x1);
  pw_script_range (s, "y", g->box[i].y0, g->box[i].y1);
}

static pw_script plane_page (const char *name) {
  return (pw_script){ .name = name,
                      .width = SCRIPT_WIDTH,
                      .left = SCRIPT_LEFT,
                      .right = SCRIPT_RIGHT,
                      .top = SCRIPT_TOP,
                      .bottom = SCRIPT_BOTTOM };
}

int pw_plot_paths (const pw_plots *p, pw_error *error) {
  pw_curves c = p->wheels > 0 ? pw_plot_wheels (p) : pw_plot_bodies (p);
  pw_script s = plane_page ("paths");
  s.top += pw_script_names (p, &c);
  if (pw_script_numbered (&c)) s.right = SCRIPT_BAR;
  plane g = plane_lay_out (p, &s, pw_plot_box_of_paths);
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  pw_script_begin (&s, p, pw_plot_followed (p));
  fputs ("set xlabel 'x [m]'\nset ylabel 'y [m]'\nunset xzeroaxis\n", s.f);
  for (int i = 0; i < g.count; i++) {
    if (i == 0) pw_script_key (&s, p, &c);
    if (i == 0 && g.count == 2 && pw_script_numbered (&c)) fputs ("unset colorbox\n", s.f);
    if (i == 1 && pw_script_numbered (&c)) pw_script_key (&s, p, &c);
    plane_panel (&s, p, &g, i);
    pw_script_draw (&s, p, &c, 0, 1, i == 0);
  }
  return pw_script_end (&s, error);
}

/* Bodies, wheels and what is nothing but a point, as far as there are any. */
static void plane_images (FILE *f, const pw_plots *p, const char *file) {
  static const char *const styles[] = { "lines lw 1.4 dt 1", "lines lw 4 dt 1", "points pt 7 ps 0.5" };
  const char *before = "plot ";
  for (int block = PLOT_BODIES; block <= PLOT_CENTRES; block++) {
    if (!pw_plot_has (p, block)) continue;
    fprintf (f, "%s'%s' index %d using 1:2:3 with %s lc palette", before, file, block, styles[block]);
    before = ", \\\n  ";
  }
}

/* The whole path of each marker, over the images. */
static void plane_traces (FILE *f, const pw_plots *p) {
  pw_curves c = pw_plot_wheels (p);
  for (int k = 0; k < c.count; k++)
    if (!pw_plot_rolls (p, pw_plot_pick (k, c.count, c.shown)))
      fprintf (f, ", \\\n  '%s' index %d using 2:3 with lines lw 1.6 dt 1 lc rgb 'black'", c.file, k);
}

int pw_plot_mechanism (const pw_plots *p, pw_error *error) {
  static const char *const files[] = { "mechanism.dat", "mechanism-start.dat" };
  pw_script s = plane_page ("mechanism");
  s.bottom += SCRIPT_FOOT;
  plane g = plane_lay_out (p, &s, pw_plot_box_of);
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  pw_script_begin (&s, p, "the mechanism along its way");
  fputs ("unset key\nset xlabel 'x [m]'\nset ylabel 'y [m]'\nunset xzeroaxis\n", s.f);
  for (int i = 0; i < g.count; i++) {
    plane_panel (&s, p, &g, i);
    pw_script_range (&s, "cb", 0, pw_plot_sample (p, g.samples[i] - 1)[PLOT_T]);
    pw_script_bar (&s, g.panel[i], "t [s]");
    plane_images (s.f, p, files[i]);
    plane_traces (s.f, p);
    if (p->grounds > 0) fputs (", \\\n  'ground.dat' using 1:2 with points pt 9 ps 1.2 lc rgb 'black'", s.f);
    fputs ("\n", s.f);
  }
  return pw_script_end (&s, error);
}
