/* A system with its steady motions; see steady_case.h. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "steady_case.h"

void steady_open (steady *t) {
  pw_error error = { 0 };
  t->set.hold = t->hold;
  t->set.span = 10;
  t->x = pw_steady_open (t->s, &t->set, &error);
  check_ok (t->x ? PW_OK : error.status, &error);
}

void steady_close (steady *t) {
  pw_steady_close (t->x);
  pw_system_free (t->s);
}

pw_steady_motion steady_solve (steady *t, int attempt, double parameter) {
  pw_error error = { 0 };
  pw_steady_motion m;
  check_ok (pw_steady_solve (t->x, attempt, parameter, &m, &error), &error);
  return m;
}

void steady_expect (const pw_linear *l, double re, double im) {
  double least = INFINITY;
  for (int i = 0; i < l->unknowns; i++) least = fmin (least, hypot (l->re[i] - re, l->im[i] - im));
  check_below ("distance to the nearest eigenvalue", least, 1e-9 * (hypot (re, im) + 1), "exact derivatives");
}

branch_events steady_follow (steady *t, const pw_steady_motion *from, int direction) {
  branch_events e = { .count = { 0 } };
  pw_error error = { 0 };
  double q[60], v[60];
  pw_steady_motion m;
  size_t bytes = (size_t)pw_system_coordinates (t->s) * sizeof *q;
  memcpy (q, from->q, bytes), memcpy (v, from->v, bytes);
  check_ok (pw_steady_follow (t->x, q, v, from->parameter, direction, &error), &error);
  for (;;) {
    check_ok (pw_steady_next (t->x, &m, &error), &error);
    if (e.count[m.event] < 3) e.at[m.event][e.count[m.event]] = m.parameter;
    e.count[m.event]++;
    if (m.event == PW_STEADY_END) break;
    assert_true (e.count[PW_STEADY_POINT] < 5000);
  }
  assert_string_equal (pw_steady_reason (t->x), "");
  return e;
}
