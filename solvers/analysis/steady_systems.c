/* The systems and runs of a search for steady motions, at values of the parameter. */
#include <string.h>
#include "steady_parts.h"
#include "util.h"

void pw_steady_leave (pw_steady *x, int k) {
  pw_linear_close (&x->at[k].x);
  if (x->at[k].r) pw_run_close (x->at[k].r);
  pw_system_free (x->at[k].own);
  memset (&x->at[k], 0, sizeof x->at[k]);
}

static int steady_fits (const pw_steady *x, const pw_system *s) {
  return s->coords == x->n && s->rows == x->m && s->holonomic == x->holonomic && s->bodies == x->s->bodies;
}

/* Opens a run at the last solution, of which it keeps what it can: without its velocities where all of them vanish. */
static int steady_open_run (pw_steady *x, int k, const pw_system *s) {
  const pw_settings settings = {
    .t = x->set.t, .span = x->set.span, .initial = x->known, .initials = x->solved ? 2 * x->n : 0
  };
  x->at[k].r = pw_run_open (s, "rk4+projection", &settings, &x->why);
  if (x->at[k].r == NULL && x->why.status == PW_INITIAL && x->solved) {
    for (int j = x->n; j < 2 * x->n; j++) x->known[j].value = 0;
    x->why = (pw_error){ 0 };
    x->at[k].r = pw_run_open (s, "rk4+projection", &settings, &x->why);
  }
  if (x->at[k].r == NULL) return x->why.status;
  if (pw_linear_open (&x->at[k].x, x->at[k].r, PW_WITHOUT_MODES, PW_STEADY_MOST) == PW_OK) return PW_OK;
  return pw_fail_memory (s, &x->why);
}

int pw_steady_at (pw_steady *x, int k, double value) {
  const pw_system *s = x->s;
  int status;
  if (x->at[k].r && (x->set.compile == NULL || x->at[k].value == value)) return PW_OK;
  pw_steady_leave (x, k);
  x->why = (pw_error){ 0 };
  x->at[k].value = value;
  if (x->set.compile) s = x->at[k].own = x->set.compile (x->set.context, value, &x->why);
  if (s == NULL)
    status = x->why.status;
  else if (!steady_fits (x, s))
    return pw_fail (&x->why, PW_INPUT, "model %s: the parameter changes the number of bodies or constraint equations",
                    s->model);
  else
    status = steady_open_run (x, k, s);
  if (status != PW_OK) pw_steady_leave (x, k);
  return status == PW_OK || status == PW_RESOURCE ? status : PW_RETRY;
}
