/* The picture in motion: frames of the mechanism with the paths so far, drawn by gnuplot in a temporary folder. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "animate_page.h"

enum { GIF_FRAMES = 200, GIF_WIDTH = 640, GIF_HEIGHT = 400, GIF_FASTEST = 3, GIF_SLOWEST = 10 }; /* delays [s / 100] */

/* What is seen of the plane: all of it, or a mechanism that goes far, followed. */
typedef struct {
  double x, y, half; /* centre and half a width [m] */
  int follows;
} gif_view;

static gif_view gif_look (const pw_plots *p) {
  pw_plot_box box = pw_plot_box_of (p, p->samples);
  double size = pw_plot_size (p), ratio = (double)GIF_WIDTH / GIF_HEIGHT;
  gif_view v = { .x = (box.x0 + box.x1) / 2, .y = (box.y0 + box.y1) / 2 };
  v.half = 0.55 * fmax (fmax (box.x1 - box.x0, ratio * (box.y1 - box.y0)), 0.5 * size);
  v.follows = v.half > 6 * size;
  if (v.follows) v.half = 2.5 * size;
  return v;
}

static void gif_centre (const pw_plots *p, int i, gif_view *v) {
  if (!v->follows) return;
  v->x = v->y = 0;
  for (int b = 0; b < p->bodies; b++) {
    v->x += pw_plot_motion (p, i, b)[0] / p->bodies;
    v->y += pw_plot_motion (p, i, b)[1] / p->bodies;
  }
}

static void gif_range (FILE *f, const char *axis, double centre, double half) {
  char a[32], b[32];
  fprintf (f, "set %srange [%s:%s]\n", axis, pw_format (a, centre - half, 9), pw_format (b, centre + half, 9));
}

static void gif_frame (FILE *f, const pw_plots *p, int i, int frame, gif_view *v) {
  pw_curves c = p->wheels > 0 ? pw_plot_wheels (p) : pw_plot_bodies (p);
  char t[32];
  gif_centre (p, i, v);
  gif_range (f, "x", v->x, v->half);
  gif_range (f, "y", v->y, v->half * GIF_HEIGHT / GIF_WIDTH);
  fprintf (f, "set label 1 't = %s s' at graph 0.02,0.95\n", pw_format (t, pw_plot_sample (p, i)[PLOT_T], 4));
  fputs ("plot ", f);
  for (int k = 0; k < c.count; k++)
    fprintf (f, "'%s' index %d every ::0::%d using 2:3 with lines lw 1 lc rgb '#aaaaaa', \\\n  ", c.file, k, i);
  if (p->grounds > 0) fputs ("'ground.dat' with points pt 9 lc rgb '#666666', ", f);
  fprintf (f,
           "'frames.dat' index %d with lines lw 3 lc rgb '#004488', '' index %d with lines lw 5 lc rgb '#222222', "
           "'' index %d with points pt 7 lc rgb '#004488'\n",
           3 * frame, 3 * frame + 1, 3 * frame + 2);
}

static int gif_script (const pw_plots *p, int stride, pw_error *error) {
  FILE *f = pw_plot_create (p, "animation.gp", error);
  if (f == NULL) return PW_MACHINE;
  gif_view v = gif_look (p);
  int frames = (p->samples + stride - 1) / stride;
  double t = pw_plot_sample (p, p->samples - 1)[PLOT_T] - pw_plot_sample (p, 0)[PLOT_T];
  double delay = fmin (fmax (round (100 * t / frames), GIF_FASTEST), GIF_SLOWEST);
  fprintf (f,
           "reset session\nset encoding utf8\nset terminal gif animate delay %d loop 0 noenhanced size %d,%d\n"
           "set output 'animation.gif'\nset size ratio -1\nunset key\nset grid lc rgb '#dddddd'\n"
           "set xlabel 'x [m]'\nset ylabel 'y [m]'\n",
           (int)delay, GIF_WIDTH, GIF_HEIGHT);
  for (int i = 0, frame = 0; i < p->samples; i += stride) gif_frame (f, p, i, frame++, &v);
  fputs ("unset output\n", f);
  return pw_plot_finish (p, "animation.gp", f, error);
}

/* Copies what gnuplot has drawn to where it was wanted. */
static int gif_copy (const pw_plots *p, const char *path, pw_error *error) {
  char drawn[PLOT_PATH], block[8192];
  snprintf (drawn, sizeof drawn, "%s/animation.gif", p->folder);
  FILE *from = fopen (drawn, "rb");
  if (from == NULL) return pw_fail (error, PW_MACHINE, "gnuplot has drawn no animation: %s", strerror (errno));
  pw_output *o = pw_output_open (path, error);
  for (size_t n = 0; o && (n = fread (block, 1, sizeof block, from)) > 0;) fwrite (block, 1, n, pw_output_stream (o));
  int why = ferror (from) ? errno : 0;
  fclose (from);
  if (o && why) pw_output_discard (o);
  if (o && why) return pw_fail (error, PW_MACHINE, "cannot read %s: %s", drawn, strerror (why));
  return o ? pw_output_finish (o, error) : error->status;
}

/* What gnuplot had to say about its failure. */
static void gif_pass_on (const char *messages) {
  FILE *f = fopen (messages, "r");
  for (int c; f && (c = fgetc (f)) != EOF;) fputc (c, stderr);
  if (f) fclose (f);
}

static int gif_draw (const pw_plots *p, const char *path, pw_error *error) {
  static const char *const script[] = { "animation.gp", NULL };
  char messages[PLOT_PATH];
  int stride = (p->samples + GIF_FRAMES - 1) / GIF_FRAMES, absent = 0;
  int status = pw_plot_write_frames (p, "frames.dat", stride, error);
  if (status == PW_OK) status = gif_script (p, stride, error);
  if (status != PW_OK) return status;
  snprintf (messages, sizeof messages, "%s/messages", p->folder); /* it counts its frames aloud */
  status = pw_plot_try_gnuplot (p->folder, script, messages, &absent, error);
  if (status != PW_OK) gif_pass_on (messages);
  if (status != PW_OK) return status;
  if (absent) return pw_fail (error, PW_MACHINE, "gnuplot was not found: %s is not drawn; a .html needs none", path);
  return gif_copy (p, path, error);
}

static void gif_remove (const char *folder) {
  static const char *const files[] = { "frames.dat",   "motion.dat",    "wheels.dat", "ground.dat",
                                       "animation.gp", "animation.gif", "messages" };
  char path[PLOT_PATH];
  for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
    snprintf (path, sizeof path, "%s/%s", folder, files[i]);
    remove (path);
  }
  rmdir (folder);
}

int pw_animate_gif (pw_plots *p, const char *path, pw_error *error) {
  const char *place = getenv ("TMPDIR"), *figures = p->folder;
  char folder[PLOT_PATH - 32];
  if (place == NULL || *place == 0) place = "/tmp";
  int n = snprintf (folder, sizeof folder, "%s/pinwheel-XXXXXX", place);
  if (n < 0 || (size_t)n >= sizeof folder || mkdtemp (folder) == NULL)
    return pw_fail (error, PW_MACHINE, "cannot make a folder in %s: %s", place, strerror (errno));
  p->folder = folder;
  int status = gif_draw (p, path, error);
  p->folder = figures;
  gif_remove (folder);
  return status;
}
