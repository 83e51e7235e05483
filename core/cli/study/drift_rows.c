/* Which runs are made: the methods side by side, then Baumgarte's alpha and beta, the projection's metric and frequency. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "drift.h"
#include "util.h"

/* ---- What is varied ---- */

/* Reads one "NAME=RANGE" into a grid of one axis. */
static int rows_axis (pw_grid *g, const char *text, pw_error *error) {
  const char *const list[] = { text, NULL };
  pw_grid_free (g);
  int status = pw_grid_read (g, list, error);
  for (long i = 0; status == PW_OK && i < g->rows; i++) {
    double value = pw_grid_value (g, 0, i);
    const char *expected = pw_domain_check (strcmp (g->axis->name, "every") == 0 ? PW_COUNT : PW_NONNEGATIVE, value);
    if (*expected)
      status = pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: expected %s", g->axis->name, g->axis->range, expected);
  }
  return status;
}

static int rows_vary (pw_drift *x, const char *text, pw_error *error) {
  const struct {
    const char *name;
    pw_grid *grid;
  } known[] = { { "alpha", &x->alpha }, { "beta", &x->beta }, { "every", &x->every } };
  char name[60], hint[100];
  snprintf (name, sizeof name, "%.*s", (int)strcspn (text, "="), text);
  pw_nearest near = { .sought = name };
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    if (strcmp (known[i].name, name) == 0) return rows_axis (known[i].grid, text, error);
    pw_nearest_try (&near, known[i].name);
  }
  return pw_fail (error, PW_INPUT, "--vary %.100s: alpha, beta and every can be varied%s", text,
                  pw_nearest_text (&near, hint, sizeof hint));
}

/* The defaults, then what was given. */
static int rows_axes (pw_drift *x, pw_error *error) {
  static const char *const usual[] = { "alpha=1,3,10,30,100,300,1000", "beta=1,10,100,1000", "every=1,2,5,10,20,50,100",
                                       NULL };
  int status = PW_OK;
  for (const char *const *v = usual; status == PW_OK && *v; v++) status = rows_vary (x, *v, error);
  for (const char **v = x->vary; status == PW_OK && v && *v; v++) status = rows_vary (x, *v, error);
  return status;
}

/* ---- Rows ---- */

static int rows_has_option (const pw_method *method, const char *name) {
  for (const pw_option *o = method->options; o && o->name; o++)
    if (strcmp (o->name, name) == 0) return 1;
  return 0;
}

/* The first integrator in the list that has an option; rk4 if none has. */
static const char *rows_integrator (const pw_drift *x, const char *option) {
  for (int i = 0; i < x->list.count; i++) {
    const pw_method *method;
    int stabilisation;
    if (pw_parse_method (x->list.method[i].name, &method, &stabilisation, NULL) == PW_OK &&
        rows_has_option (method, option))
      return method->name;
  }
  return "rk4";
}

static void rows_baumgarte (pw_drift *x) {
  const char *integrator = rows_integrator (x, "alpha");
  char a[32], b[32];
  for (long j = 0; j < x->beta.rows; j++)
    for (long i = 0; i < x->alpha.rows; i++) {
      pw_drift_row *r = &x->row[x->rows++];
      *r = (pw_drift_row){ .group = DRIFT_BAUMGARTE,
                           .line = (int)j,
                           .along = pw_grid_value (&x->alpha, 0, i),
                           .beta = pw_grid_value (&x->beta, 0, j) };
      snprintf (r->method, sizeof r->method, "%s+baumgarte:alpha=%s:beta=%s", integrator, pw_format (a, r->along, 9),
                pw_format (b, r->beta, 9));
    }
}

static void rows_projection (pw_drift *x) {
  static const char *const metric[] = { "mass", "identity" };
  const char *integrator = rows_integrator (x, "every");
  for (int j = 0; j < 2; j++)
    for (long i = 0; i < x->every.rows; i++) {
      pw_drift_row *r = &x->row[x->rows++];
      *r =
          (pw_drift_row){ .group = DRIFT_PROJECTION, .line = j, .along = pw_grid_value (&x->every, 0, i), .beta = NAN };
      snprintf (r->method, sizeof r->method, "%s+projection:metric=%s:every=%.0f", integrator, metric[j], r->along);
    }
}

int pw_drift_rows (pw_drift *x, pw_error *error) {
  int status = rows_axes (x, error);
  if (status != PW_OK) return status;
  double most = x->list.count + (double)x->alpha.rows * (double)x->beta.rows + 2 * (double)x->every.rows;
  if (most > 10000) return pw_fail (error, PW_INPUT, "%.0f runs are too many; vary less", most);
  x->row = calloc ((size_t)most, sizeof *x->row);
  if (x->row == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  for (int i = 0; i < x->list.count; i++) {
    pw_drift_row *r = &x->row[x->rows++];
    *r = (pw_drift_row){ .group = DRIFT_METHODS, .line = i, .along = NAN, .beta = NAN };
    snprintf (r->method, sizeof r->method, "%s", x->list.method[i].name);
    r->part = calloc (DRIFT_PARTS, sizeof *r->part);
    if (r->part == NULL) return pw_fail (error, PW_MACHINE, "out of memory");
  }
  if (x->only_methods) return PW_OK;
  rows_baumgarte (x);
  rows_projection (x);
  return PW_OK;
}

void pw_drift_free_rows (pw_drift *x) {
  for (int i = 0; i < x->rows; i++) free (x->row[i].part);
  free (x->row);
  pw_grid_free (&x->alpha);
  pw_grid_free (&x->beta);
  pw_grid_free (&x->every);
}
