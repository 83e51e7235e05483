/* The page of mode shapes: displacements eps Re (shape exp (i im t)) from the state, without growth; real modes with it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linearise.h"
#include "plot.h"

/* Of pairs, periods are shown; of real modes, growth by exp (PAGE_TIMES).  PAGE_SIZE: largest displacement, in units of the
 * scene's length. */
enum { PAGE_SAMPLES = 180, PAGE_PERIODS = 3, PAGE_TIMES = 3 };
#define PAGE_SIZE 0.1

typedef struct {
  const pw_linearise *x;
  const double *base; /* configuration */
  double *state;      /* q, v: scratch */
  double size;        /* [m] */
  int status;
  pw_error *error;
} page;

/* The state at time t of a mode, whose largest displacement is `size`. */
static void page_state (const page *p, int mode, double t, double end) {
  const pw_linear *l = &p->x->linear;
  const double re = l->re[mode], im = l->im[mode];
  const double growth = im == 0 ? exp (re * t - fmax (0, re * end)) : 1, c = growth * cos (im * t),
               s = growth * sin (im * t);
  const double rate_c = im == 0 ? re * c : -im * s, rate_s = im * c;
  for (int j = 0; j < l->coordinates; j++) {
    const double *shape = l->shape + 2 * ((size_t)mode * 2 * (size_t)l->coordinates + (size_t)j);
    p->state[j] = p->base[j] + p->size * (c * shape[0] - s * shape[1]);
    p->state[l->coordinates + j] = p->size * (rate_c * shape[0] - rate_s * shape[1]);
  }
}

static void page_mode (page *p, FILE *f, int mode) {
  const pw_linear *l = &p->x->linear;
  const double re = l->re[mode], im = l->im[mode],
               end = im == 0 ? PAGE_TIMES / fabs (re) : 2 * PW_PI * PAGE_PERIODS / im;
  char title[200], number[2][32];
  pw_plots *plots = pw_plots_open (NULL, 0, p->x->m.model, p->x->m.system, end, p->error);
  if (plots == NULL) {
    p->status = p->error->status;
    return;
  }
  for (int k = 0; k <= PAGE_SAMPLES; k++) {
    const double t = end * k / PAGE_SAMPLES;
    page_state (p, mode, t, end);
    pw_plots_add (plots, &(pw_sample){ .t = t, .q = p->state, .v = p->state + l->coordinates });
  }
  int n = snprintf (title, sizeof title, "mode %d: %s 1/s", mode + 1, pw_format (number[0], re, 5));
  if (im != 0)
    snprintf (title + n, sizeof title - (size_t)n, ", %s Hz, growth is not shown",
              pw_format (number[1], im / (2 * PW_PI), 5));
  pw_animation_run (f, plots, title, "");
  pw_plots_close (plots);
}

static void page_insert (FILE *f, pw_page_part part, const void *context) {
  page *p = *(page *const *)context;
  if (part == PW_PAGE_PANEL) {
    fputs ("<p class=\"bar\"><label>Mode <select id=\"mode\"></select></label></p>\n", f);
    return;
  }
  fputs ("const modes = [", f);
  for (int i = 0, shown = 0; i < p->x->linear.unknowns && p->status == PW_OK; i++) {
    if (!pw_linearise_shows (&p->x->linear, i)) continue;
    fputs (shown++ ? ",\n" : "\n", f);
    page_mode (p, f, i);
  }
  fputs (
      "];\nfor (const mode of modes) $(\"mode\").add(new Option(mode.method));\n"
      "$(\"mode\").addEventListener(\"change\", () => { load(modes[$(\"mode\").selectedIndex]); pace(); key(); fit(); "
      "seek(start); });\nbegin(modes[0]);\n",
      f);
}

int pw_linearise_page (const pw_linearise *x, FILE *f, pw_error *error) {
  const size_t n = (size_t)x->linear.coordinates;
  pw_sample now;
  double *memory = malloc (3 * n * sizeof *memory);
  page p = {
    .x = x, .base = memory, .state = memory + n, .size = PAGE_SIZE * pw_run_scale (x->r)->length, .error = error
  };
  page *context = &p;
  int shown = 0;
  for (int i = 0; i < x->linear.unknowns; i++) shown += pw_linearise_shows (&x->linear, i);
  p.status =
      memory ? pw_run_sample (x->r, pw_run_time (x->r), &now, error) : pw_fail (error, PW_RESOURCE, "out of memory");
  if (p.status == PW_OK && shown == 0)
    p.status = pw_fail (error, PW_INPUT, "--animate %s: there is no mode with a shape", x->animate);
  if (p.status == PW_OK) {
    memcpy (memory, now.q, n * sizeof *memory);
    pw_animation_page (f, page_insert, &context);
  }
  free (memory);
  return p.status;
}
