/* The page of an animation: animate.html, in which the run is a JavaScript object of names, shapes and flat arrays. */
#include <math.h>
#include <string.h>
#include <strings.h>
#include "animate.h"
#include "plot.h"

/* animate.html line by line, made from it by the Makefile. */
static const char *const page_lines[] = {
#include "animate.inc"
  NULL
};

static const char page_mark[] = "/* DATA */";

/* ---- JavaScript literals ---- */

/* A text between quotes, safe inside a script element. */
static void page_text (FILE *f, const char *text) {
  fputc ('"', f);
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    if (c < 32 || c == '"' || c == '\\' || c == '<' || c == '>' || c == '&')
      fprintf (f, "\\u%04x", c);
    else
      fputc (c, f);
  }
  fputc ('"', f);
}

static void page_number (FILE *f, double x, int digits) {
  char text[32];
  fputs (isfinite (x) ? pw_format (text, x, digits) : "NaN", f);
}

static void page_point (FILE *f, const double *at, const char *before) {
  fprintf (f, "%s[", before);
  page_number (f, at[0], 9);
  fputc (',', f);
  page_number (f, at[1], 9);
  fputc (']', f);
}

/* "key": "text", */
static void page_entry (FILE *f, const char *key, const char *text) {
  fprintf (f, "%s:", key);
  page_text (f, text);
  fputs (",\n", f);
}

/* ---- Shapes ---- */

static void page_bodies (FILE *f, const pw_plots *p) {
  fputs ("bodies:[", f);
  for (int b = 0; b < p->bodies; b++) {
    fputs (b ? ",\n{name:" : "\n{name:", f);
    page_text (f, pw_plot_body_name (p, b));
    fputs (",at:[", f);
    for (int k = 0; k < p->shape[b].count; k++) page_point (f, p->shape[b].at[k], k ? "," : "");
    fputs ("],spokes:[", f);
    for (int k = 0, n = 0; k < p->shape[b].count; k++)
      if (pw_plot_inside (&p->shape[b], k)) page_point (f, p->shape[b].at[k], n++ ? "," : "");
    fputs ("],outline:[", f);
    for (int k = 0; k < p->shape[b].corners; k++) page_point (f, p->shape[b].corner[k], k ? "," : "");
    fputs ("]}", f);
  }
  fputs ("],\nground:[", f);
  for (int g = 0; g < p->grounds; g++) page_point (f, p->ground[g], g ? "," : "");
  fputs ("],\n", f);
}

static void page_wheels (FILE *f, const pw_plots *p) {
  fputs ("wheels:[", f);
  for (int w = 0; w < p->wheels; w++) {
    fputs (w ? ",\n{name:" : "\n{name:", f);
    page_text (f, pw_plot_wheel_name (p, w));
    fprintf (f, ",body:%d,rolls:%d}", pw_plot_body_of_wheel (p, w), pw_plot_rolls (p, w));
  }
  fputs ("],\n", f);
}

static void page_links (FILE *f, const pw_plots *p) {
  fputs ("links:[", f);
  for (int i = 0; i < p->links; i++) {
    const pw_plot_link *link = &p->link[i];
    const pw_element_info e = pw_system_element (p->s, link->element);
    fputs (i ? ",\n{name:" : "\n{name:", f);
    page_text (f, e.name);
    fputs (",kind:", f);
    page_text (f, e.kind->name);
    fprintf (f, ",force:%d,ends:[", link->force);
    for (int n = 0; n < link->ends; n++) {
      fprintf (f, "%s{body:%d,at:", n ? "," : "", link->end[n].body);
      page_point (f, link->end[n].at, "");
      fputc ('}', f);
    }
    fputs ("]}", f);
  }
  fputs ("],\n", f);
}

/* ---- Numbers: `count` of each sample from `offset` on, sample by sample ---- */

static void page_array (FILE *f, const pw_plots *p, const char *key, int offset, int count, int digits) {
  fprintf (f, "%s:[", key);
  for (int i = 0; i < p->samples; i++) {
    const double *from = pw_plot_sample (p, i) + offset;
    fputs (i ? ",\n" : "\n", f);
    for (int j = 0; j < count; j++) {
      if (j) fputc (',', f);
      page_number (f, from[j], digits);
    }
  }
  fputs ("],\n", f);
}

static void page_data (FILE *f, const pw_plots *p, const char *method, const char *reason) {
  int wheels = PLOT_FIRST + 6 * p->bodies, links = wheels + 3 * p->wheels;
  fputs ("{\n", f);
  page_entry (f, "model", p->model);
  page_entry (f, "method", method);
  page_entry (f, "reason", reason);
  fputs ("size:", f);
  page_number (f, pw_plot_size (p), 9);
  fputs (",\n", f);
  page_bodies (f, p);
  page_wheels (f, p);
  page_links (f, p);
  page_array (f, p, "t", PLOT_T, 1, 10);
  page_array (f, p, "motion", PLOT_FIRST, 6 * p->bodies, 9);
  if (p->wheels > 0) page_array (f, p, "contact", wheels, 3 * p->wheels, 9);
  if (p->links > 0) page_array (f, p, "force", links, 2 * p->links, 6);
  page_array (f, p, "energy", PLOT_KINETIC, PLOT_FIRST - PLOT_KINETIC, 7);
  fputs ("}", f);
}

int pw_animation_check (const char *path, pw_error *error) {
  static const char ending[] = ".html";
  size_t n = strlen (path), m = sizeof ending - 1;
  if (n > m && strcasecmp (path + n - m, ending) == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "--animate %s: expected a name that ends in .html", path);
}

int pw_animate (const pw_plots *p, const char *path, pw_output *o, const char *method, const char *reason) {
  if (p->samples < 2) {
    pw_cli_say ("pinwheel: the run is too short for an animation: %s is not written\n", path);
    return 0;
  }
  FILE *f = pw_output_stream (o);
  for (const char *const *line = page_lines; *line; line++) {
    const char *mark = strstr (*line, page_mark);
    if (mark == NULL) {
      fputs (*line, f);
      continue;
    }
    fprintf (f, "%.*s", (int)(mark - *line), *line);
    page_data (f, p, method, reason);
    fputs (mark + sizeof page_mark - 1, f);
  }
  return 1;
}
