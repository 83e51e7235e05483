/* The sine that measures how far the constraints are from a singular configuration; see watchdog.h. */
#include <math.h>
#include <stdlib.h>
#include "method.h"
#include "rank.h"
#include "util.h"

/* ---- Opening ---- */

/* The index of the n-th body of element e; that of the ground is s->bodies. */
static int singular_body (const pw_system *s, const pw_element_batch *k, int e, int n) {
  int j = k->column[e * k->kind->bodies + n];
  return j < s->coords ? j / 3 : s->bodies;
}

/* 1 if a holonomic constraint connects bodies that are already connected; -1 if out of memory.  The ground is a body,
 * to which an element on one body connects it. */
static int singular_has_loops (const pw_system *s) {
  int loops = 0, *set = malloc (((size_t)s->bodies + 1) * sizeof *set);
  if (set == NULL) return -1;
  for (int b = 0; b <= s->bodies; b++) set[b] = b;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->constraints && k->row < s->holonomic; k++)
    for (int e = 0; e < k->b.count; e++) {
      int first = k->kind->bodies > 1 ? singular_body (s, k, e, 0) : s->bodies;
      for (int n = k->kind->bodies > 1; n < k->kind->bodies; n++) {
        int a = pw_root (set, first), b = pw_root (set, singular_body (s, k, e, n));
        loops |= a == b;
        set[b] = a;
      }
    }
  free (set);
  return loops;
}

/* The holonomic rows of a tree of bodies cannot become dependent, whatever its configuration. */
int pw_watchdog_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  pw_watchdog *watch = &r->watchdog;
  watch->loops = singular_has_loops (s);
  if (watch->loops < 0) return pw_fail_memory (s, error);
  if (watch->loops == 0 && s->rows == s->holonomic) return PW_OK;
  pw_saddle_close (watch->saddle);
  pw_length_weights (s, r->scratch);
  watch->saddle = pw_saddle_open (r->w, r->scratch, s->rows, r->active, error);
  return watch->saddle ? PW_OK : PW_RESOURCE;
}

/* ---- Sines ---- */

double pw_watchdog_sine (pw_run *r, int *row) {
  pw_saddle *saddle = r->watchdog.saddle;
  if (row) *row = -1;
  if (saddle == NULL) return 1;
  int status = pw_saddle_factor (saddle);
  double sine = pw_saddle_sine (saddle, row);
  return status == PW_OK ? sine : 0;
}

int pw_watchdog_near (pw_run *r) {
  pw_watchdog *watch = &r->watchdog;
  if (!watch->singular_ahead || watch->saddle == NULL) return 0;
  if (!r->fixed_steps && !pw_saddle_sine_below (r->saddle, r->thresholds.refine)) return 0;
  watch->evaluated_sine = pw_watchdog_sine (r, NULL);
  return watch->evaluated_sine < r->thresholds.near * watch->largest_sine;
}

int pw_fail_singular (pw_run *r, double t, pw_error *error) {
  int row = -1;
  double sine = pw_watchdog_sine (r, &row);
  /* largest_sine is 0 while the run is being opened */
  if (sine > r->thresholds.rank_refused && sine > r->thresholds.near * r->watchdog.largest_sine)
    return pw_fail (
        error, PW_METHOD,
        "t = %.6g s: values too extreme: masses and inertias differ by so much that the equations of motion "
        "cannot be solved; the configuration is not singular",
        t);
  const char *name = row >= 0 ? PW_NAME (pw_system_row_name, r->s, row) : "a constraint";
  if (sine <= r->thresholds.rank_lost)
    return pw_fail (error, PW_METHOD, "t = %.6g s: singular configuration: %s depends on other constraints", t, name);
  return pw_fail (
      error, PW_METHOD,
      "t = %.6g s: near a singular configuration: %s nearly depends on other constraints (sine %.2g); the next "
      "step cannot be computed",
      t, name, sine);
}

int pw_watchdog_near_state (pw_run *r) {
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  pw_saddle_factor (r->saddle);
  r->watchdog.singular_ahead = 1;
  return pw_watchdog_near (r);
}

int pw_watchdog_check_values (const pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  const double extreme = r->thresholds.extreme;
  for (int i = 0; i < 2 * s->coords; i++) {
    double value = i < s->coords ? r->q[i] : r->v[i - s->coords];
    if (!(fabs (value) < extreme))
      return pw_fail (error, PW_INPUT,
                      "model %s: values too extreme: %s is initially %g: expected a magnitude below %g", s->model,
                      PW_NAME (pw_system_state_name, s, i), value, extreme);
  }
  for (int j = 0; s->rows > 0 && j < s->coords; j++) {
    double unit = pw_length_factor (s, j) * pw_length_factor (s, j), mass = s->mass[j] / unit;
    if (mass != 0 && !(mass < extreme && mass > 1 / extreme))
      return pw_fail (
          error, PW_INPUT,
          "model %s: values too extreme: the mass or inertia that goes with %s is %g: expected 0, or %g to %g",
          s->model, PW_NAME (pw_system_state_name, s, j), s->mass[j], unit / extreme, unit * extreme);
  }
  return PW_OK;
}
