/* Figures over time: velocities, angular velocities, energies. */
#include <math.h>
#include "plot_script.h"

enum {
  TIME_PANEL = 235, /* height of one of two panels [px] */
  TIME_ALONE = 340, /* of a single one */
  TIME_GAP = 16,    /* between panels that share their axis of time */
  TIME_APART = 72,  /* between panels that do not */
  TIME_MANY = 30,   /* turning points of a curve above which its end is drawn in detail */
  TIME_DETAIL = 12  /* turning points in the detail */
};

/* A page with n panels of a height, one above the other. */
static pw_script time_page (const pw_plots *p, const char *name, const pw_curves *c, int n, int panel, int gap) {
  pw_script s = { .name = name,
                  .width = SCRIPT_WIDTH,
                  .left = SCRIPT_LEFT,
                  .right = SCRIPT_RIGHT,
                  .top = SCRIPT_TOP,
                  .bottom = SCRIPT_BOTTOM };
  s.top += c ? pw_script_names (p, c) : 22;
  if (c && pw_script_numbered (c)) s.right = SCRIPT_BAR;
  s.height = s.top + n * panel + (n - 1) * gap + s.bottom;
  return s;
}

static void time_panel (const pw_script *s, int i, int panel, int gap) {
  double y = s->top + i * (panel + gap);
  pw_script_panel (s, (pw_panel){ s->left, s->width - s->right, y, y + panel });
}

static double time_end (const pw_plots *p) {
  return pw_plot_sample (p, p->samples - 1)[PLOT_T];
}

/* The range of y is gnuplot's choice, but for a number (3: vx ... 5: omega) that is the same throughout, or nearly, for
 * which it has none. */
static void time_span (const pw_script *s, const pw_plots *p, const pw_curves *c, int y) {
  double least = INFINITY, most = -INFINITY;
  for (int k = 0; k < c->count; k++)
    for (int i = 0; i < p->samples; i++) {
      double value = c->at (p, i, pw_plot_pick (k, c->count, c->shown))[y];
      if (!isfinite (value)) continue;
      least = fmin (least, value);
      most = fmax (most, value);
    }
  double size = fmax (fabs (least), fabs (most));
  if (most - least > 1e-6 * size)
    fputs ("set yrange [*:*]\n", s->f);
  else if (isfinite (size))
    pw_script_range (s, "y", least - (size > 0 ? 0.1 * size : 1), most + (size > 0 ? 0.1 * size : 1));
}

int pw_plot_velocities (const pw_plots *p, pw_error *error) {
  pw_curves c = pw_plot_bodies (p);
  pw_script s = time_page (p, "velocities", &c, 2, TIME_PANEL, TIME_GAP);
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  pw_script_range (&s, "x", 0, time_end (p));
  pw_script_begin (&s, p, "velocities of the centres of mass");
  pw_script_key (&s, p, &c);
  fputs ("set format x ''\nunset xlabel\nset ylabel 'vx [m/s]'\n", s.f);
  time_panel (&s, 0, TIME_PANEL, TIME_GAP);
  time_span (&s, p, &c, 3);
  pw_script_draw (&s, p, &c, -1, 3, 1);
  fputs ("unset colorbox\nset format x\nset xlabel 't [s]'\nset ylabel 'vy [m/s]'\n", s.f);
  time_panel (&s, 1, TIME_PANEL, TIME_GAP);
  time_span (&s, p, &c, 4);
  pw_script_draw (&s, p, &c, -1, 4, 0);
  return pw_script_end (&s, error);
}

/* How often the liveliest angular velocity turns; round-off does not count. */
static int time_turns (const pw_plots *p) {
  int most = 0;
  for (int b = 0; b < p->bodies; b++) {
    double largest = 0;
    for (int i = 0; i < p->samples; i++) largest = fmax (largest, fabs (pw_plot_motion (p, i, b)[5]));
    int turns = 0, before = 0;
    for (int i = 1; i < p->samples; i++) {
      double change = pw_plot_motion (p, i, b)[5] - pw_plot_motion (p, i - 1, b)[5];
      int now = (change > 1e-6 * largest) - (change < -1e-6 * largest);
      turns += now * before < 0;
      if (now) before = now;
    }
    if (turns > most) most = turns;
  }
  return most;
}

/* The part of the run at its end that is drawn in detail: 1/5, 1/10, 1/20, ...; 0 where that is not needed. */
static double time_detail (const pw_plots *p) {
  static const double parts[] = { 0.2, 0.1, 0.05, 0.02 };
  int turns = time_turns (p), k = 0;
  if (turns < TIME_MANY) return 0;
  while (k < 3 && turns * parts[k] > TIME_DETAIL) k++;
  return parts[k];
}

int pw_plot_angular (const pw_plots *p, pw_error *error) {
  double detail = time_detail (p), end = time_end (p);
  int n = detail > 0 ? 2 : 1, panel = detail > 0 ? TIME_PANEL : TIME_ALONE;
  pw_curves c = pw_plot_bodies (p);
  pw_script s = time_page (p, "angular", &c, n, panel, TIME_APART);
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  pw_script_begin (&s, p, detail > 0 ? "angular velocities, and their last part in detail" : "angular velocities");
  pw_script_key (&s, p, &c);
  fputs ("set xlabel 't [s]'\nset ylabel 'ω [rad/s]'\n", s.f);
  pw_script_range (&s, "x", 0, end);
  time_panel (&s, 0, panel, TIME_APART);
  time_span (&s, p, &c, 5);
  pw_script_draw (&s, p, &c, -1, 5, 1);
  if (detail > 0) {
    pw_script_range (&s, "x", end * (1 - detail), end);
    fputs ("unset colorbox\n", s.f);
    time_panel (&s, 1, panel, TIME_APART);
    pw_script_draw (&s, p, &c, -1, 5, 0);
  }
  return pw_script_end (&s, error);
}

/* ---- Energy ---- */

/* Largest absolute value of a number kept. */
static double time_largest (const pw_plots *p, int number) {
  double largest = 0;
  for (int i = 0; i < p->samples; i++) {
    double value = fabs (pw_plot_sample (p, i)[number]);
    if (isfinite (value)) largest = fmax (largest, value);
  }
  return largest;
}

/* "10⁻¹⁵ J" */
static void time_power_of_ten (FILE *f, int exponent) {
  static const char *const digits[] = { "⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹" };
  char text[16];
  snprintf (text, sizeof text, "%d", exponent);
  fputs ("10", f);
  for (const char *c = text; *c; c++) fputs (*c == '-' ? "⁻" : digits[*c - '0'], f);
  fputs (" J", f);
}

/* Whether a number kept has more than one value, as gnuplot's choice of a range needs. */
static int time_varies (const pw_plots *p, int number) {
  for (int i = 1; i < p->samples; i++)
    if (fabs (pw_plot_sample (p, i)[number] - pw_plot_sample (p, 0)[number]) > 0) return 1;
  return 0;
}

/* How far the account is from closing, in a unit of its own. */
static void time_balance (FILE *f, const pw_plots *p) {
  double largest = time_largest (p, PLOT_BALANCE);
  int exponent = largest > 0 ? (int)floor (log10 (largest)) : 0;
  if (exponent >= -2 && exponent <= 2) exponent = 0;
  fputs ("set ylabel 'balance [", f);
  if (exponent == 0)
    fputs ("J", f);
  else
    time_power_of_ten (f, exponent);
  fprintf (f, "]'\nset yrange [%s]\n", time_varies (p, PLOT_BALANCE) ? "*:*" : "-1:1");
  fprintf (f, "plot 'energy.dat' using 1:($%d/1e%d) with lines lt 1 lw 1 notitle\n", PLOT_BALANCE + 1, exponent);
}

int pw_plot_energy (const pw_plots *p, pw_error *error) {
  const pw_curves one = { .count = 0 };
  pw_script s = time_page (p, "energy", NULL, 2, TIME_PANEL, TIME_GAP);
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  pw_script_range (&s, "x", 0, time_end (p));
  pw_script_begin (&s, p, "energy, work and their balance");
  pw_script_key (&s, p, &one);
  fputs ("set format x ''\nunset xlabel\nset ylabel 'energy, work [J]'\n", s.f);
  int flat = !time_varies (p, PLOT_KINETIC) && !time_varies (p, PLOT_POTENTIAL) && !time_varies (p, PLOT_WORK);
  if (flat && time_largest (p, PLOT_KINETIC) == 0)
    fputs ("set yrange [-1:1]\n", s.f);
  else
    fputs ("set yrange [*:*]\n", s.f);
  time_panel (&s, 0, TIME_PANEL, TIME_GAP);
  fputs ("plot 'energy.dat' using 1:2 with lines lw 5 dt 1 lc rgb '#ddaa33' title 'kinetic'", s.f);
  if (time_largest (p, PLOT_POTENTIAL) > 0)
    fputs (", \\\n  '' using 1:3 with lines lw 1.8 dt (14,4) lc rgb '#888888' title 'potential'", s.f);
  if (time_largest (p, PLOT_LOSS) > 0)
    fputs (", \\\n  '' using 1:5 with lines lw 1.8 dt (4,3) lc rgb '#bb5566' title 'dissipated'", s.f);
  fputs (", \\\n  '' using 1:4 with lines lw 1.5 dt 1 lc rgb '#004488' title 'work'\n", s.f);
  fputs ("set format x\nset xlabel 't [s]'\n", s.f);
  time_panel (&s, 1, TIME_PANEL, TIME_GAP);
  time_balance (s.f, p);
  return pw_script_end (&s, error);
}
