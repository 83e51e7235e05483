/* Models of the gallery with events: wheels that slide, friction that sticks, contacts that open and close.  Digits of
 * tests/reference/slipping.py: the phases between events, in other equations, and closed forms. */
#include <math.h>
#include "check.h"
#include "gallery.h"
#include "runs.h"

enum { SLIPPING_EVENTS = 10, SLIPPING_COLUMNS = 4 };

static const struct {
  const char *model;
  double t_end, time[SLIPPING_EVENTS]; /* NaN after the last one; of SLIPPING_EVENTS: the first ones */
  const char *column[SLIPPING_COLUMNS];
  double digits[SLIPPING_COLUMNS];
  double circle; /* factor of the bounds where a friction circle smooths the direction of sliding */
} slipping[] = {
  { "skidding-sleigh",
    8,
    { 0, 2.260966581394, 3.604883529849, 4.947283397075, 7.150616620896, NAN },
    { "sleigh.x", "sleigh.y", "sleigh.phi" },
    { 2.07705911102, 2.96997516131, 10.0809957117 },
    1 },
  { "drifting-car",
    5,
    { 0.5116687506035, 0.777349956457, 1, 1.066307566977, 1.070426545826, 1.8, 2.308248811328, 2.447755376744,
      2.993196360706, NAN },
    { "car.x", "car.y", "car.phi", "rear.spin" },
    { 27.6306577583, 9.16183567019, 3.11085533813, 24.3121641158 },
    100 },
  { "gripper",
    2,
    { 0, 0.1065948450007, 0.4397324372958, 0.6244742284267, 0.9397324372958, 1.124474228427, 1.439732437296,
      1.624474228427, 1.939732437296, NAN },
    { "part.y" },
    { -0.14910682697 },
    1 },
  { "rocking-block",
    5,
    { 0, 0.45275253827, 0.9465198300618, 1.312616705595, 1.601881614642, 1.837008614854, 2.031127686857, 2.192914380196,
      2.328578551628, NAN },
    { "block.x", "block.y", "block.phi" },
    { 0, 0.3, 0 },
    1 },
  { "hopper",
    3.9,
    { 0, 0.1442698640031, 0.1560658337285, 0.3479347907585, 0.5442698640032, 0.5560658337286, 0.7479347907585,
      0.9442698640032, 0.9560658337286, 1.147934790759 },
    { "foot.x", "foot.y" },
    { 0.377086387921, 0.0356302940005 },
    1 },
};

/* Times of events, those at one instant once. */
static void slipping_run (int i, const char *method, const pw_settings *settings, double bound) {
  pw_error error = { 0 };
  pw_settings set = *settings;
  pw_system *s = gallery_open (slipping[i].model, NULL);
  pw_workspace *w = pw_workspace_new (s, &error);
  set.span = slipping[i].t_end, set.ledger = 1;
  pw_run *r = runs_open (s, method, &set);
  pw_sample x = runs_to (r, slipping[i].t_end);
  int count, n = 0;
  const pw_event *event = pw_run_events (r, &count);
  bound *= slipping[i].circle;
  for (int k = 0; k < count && n < SLIPPING_EVENTS && !isnan (slipping[i].time[n]); k++) {
    if (k > 0 && event[k].t - event[k - 1].t < 1e-9) continue;
    check_close (check_text ("%s, %s, event %d", slipping[i].model, method, n), event[k].t, slipping[i].time[n], bound,
                 "the method's error");
    n++;
  }
  assert_true (n == SLIPPING_EVENTS || isnan (slipping[i].time[n]));
  for (int k = 0; k < SLIPPING_COLUMNS && slipping[i].column[k]; k++) {
    pw_column column;
    double value;
    check_ok (pw_system_find_column (s, slipping[i].column[k], &column, &error), &error);
    check_ok (pw_workspace_columns (w, &x, &column, 1, &value, &error), &error);
    check_close (check_text ("%s, %s, %s", slipping[i].model, method, slipping[i].column[k]), value,
                 slipping[i].digits[k], 10 * bound, "velocities of up to 10 m/s");
  }
  check_close (check_text ("%s, %s, balance", slipping[i].model, method), x.balance / (x.kinetic + x.loss + 1), 0,
               10 * bound, "losses by sliding and impacts are counted");
  pw_workspace_free (w);
  runs_close (r, s);
}

TEST (digits) {
  static const struct {
    const char *method;
    double step, rtol, bound;
  } run[] = { { "erk8+projection", 0, 1e-12, 1e-11 },
              { "rk4+projection", 1e-3, 0, 1e-8 },
              { "radau+ggl", 0, 1e-11, 1e-9 },
              { "ida+ggl", 0, 1e-11, 1e-8 } };
  for (size_t m = 0; m < sizeof run / sizeof *run; m++)
    for (size_t i = 0; i < sizeof slipping / sizeof *slipping; i++)
      slipping_run ((int)i, run[m].method, &(pw_settings){ .step = run[m].step, .rtol = run[m].rtol }, run[m].bound);
}
