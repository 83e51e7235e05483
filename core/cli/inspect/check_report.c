/* The report of `pinwheel check`: a sequence of entries, each with a key in JSON, a label and words in text. */
#include <math.h>
#include <stdarg.h>
#include "check_report.h"
#include "report.h"

enum { REPORT_LISTED = 8, REPORT_EIGENVALUES = 60 };

/* ---- Entries: in JSON, or in the text if j is NULL ---- */

/* Begins a line for the next item. */
static void report_line (pw_json *j) {
  if (j) j->line = 1;
}

static void report_section (pw_json *j, const char *key, char bracket, const char *title) {
  if (j == NULL && title) printf ("\n%s\n", title);
  report_line (j);
  pw_json_open (j, key, bracket);
}

/* Prints in the text only. */
PW_PRINTF (2, 3) static void report_say (pw_json *j, const char *format, ...) {
  va_list list;
  va_start (list, format);
  if (j == NULL) vprintf (format, list);
  va_end (list);
}

/* A number in JSON, unless the key is NULL; a line in the text, unless the label is NULL. */
PW_PRINTF (5, 6)
static void report_entry (pw_json *j, const char *key, double value, const char *label, const char *format, ...) {
  va_list list;
  if (key) pw_json_number (j, key, value);
  if (j || label == NULL) return;
  printf ("  %-34s ", label);
  va_start (list, format);
  vprintf (format, list);
  va_end (list);
  putchar ('\n');
}

/* An item of a list, of which the text shows the first few; `listed` counts them. */
static void report_item (pw_json *j, int *listed, const char *text, const char *line) {
  if (text) pw_json_text (j, NULL, text);
  if ((*listed)++ < REPORT_LISTED) report_say (j, "    %s\n", line);
}

static void report_end_list (pw_json *j, int listed) {
  pw_json_close (j, ']');
  if (listed > REPORT_LISTED) report_say (j, "    and %d more\n", listed - REPORT_LISTED);
}

/* ---- Mobility and mass ---- */

static void report_singular_value (pw_json *j, const pw_check *x) {
  const pw_linear *l = &x->linear;
  double length = x->r ? pw_run_scale (x->r)->length : NAN;
  char value[32], unit[32];
  const char *label = l->rank > 0 ? "smallest singular value of J" : NULL;
  if (isnan (l->least))
    report_entry (j, "least_singular_value", NAN, label, "not computed: %d coordinates, the limit is %d",
                  l->coordinates, CHECK_MOST);
  else
    report_entry (j, "least_singular_value", x->r ? l->least : NAN, label,
                  "%s, rows of length 1, angles in units of L = %s m", pw_format (value, l->least, CHECK_DIGITS),
                  pw_format (unit, length, CHECK_DIGITS));
  pw_json_number (j, "length_scale", length);
}

static void report_mobility (pw_json *j, const pw_check *x) {
  const pw_system *s = x->m.system;
  const pw_linear *l = &x->linear;
  int coordinates = pw_system_coordinates (s), rows = pw_system_rows (s), holonomic = pw_system_holonomic (s),
      listed = 0;
  report_section (j, "mobility", '{', "Mobility");
  pw_json_number (j, "bodies", pw_system_bodies (s));
  report_entry (j, "coordinates", coordinates, "coordinates", "%d", coordinates);
  report_entry (j, "rows", rows, "constraint equations", "%d (%d on positions, %d on velocities)", rows, holonomic,
                rows - holonomic);
  pw_json_number (j, "holonomic_rows", holonomic);
  const struct {
    const char *key, *label;
    int value;
  } count[] = { { "configuration", "degrees of freedom, configuration", l->positions },
                { "velocity", "degrees of freedom, velocity", l->velocities },
                { "rank", "rank of J", l->rank } };
  for (int i = 0; i < 3; i++)
    report_entry (j, count[i].key, x->r ? (double)count[i].value : NAN, x->r ? count[i].label : NULL, "%d",
                  count[i].value);
  report_singular_value (j, x);
  pw_json_close (j, '}');
  report_section (j, "redundant", '[', NULL);
  if (x->r) report_entry (j, NULL, 0, "redundant constraint equations", "%d", pw_run_redundant (x->r));
  for (const char *const *r = x->redundant; r && *r; r++) report_item (j, &listed, *r, *r);
  report_end_list (j, listed);
}

static void report_mass (pw_json *j, const pw_check *x) {
  static const char *const lack[] = { NULL, "no mass", "no inertia", "neither mass nor inertia" };
  const char *matrix = x->r ? "regular" : x->failure.status == PW_INPUT ? "singular" : NULL;
  const pw_system *s = x->m.system;
  const double *M = pw_system_mass (s);
  int lacking = 0, listed = 0;
  for (int b = 0; b < pw_system_bodies (s); b++) lacking += M[3 * b] == 0 || M[3 * b + 2] == 0;
  report_section (j, "massless", '[', "Mass");
  report_entry (j, NULL, 0, "bodies without mass or inertia", "%d", lacking);
  for (int b = 0; b < pw_system_bodies (s); b++) {
    int which = (M[3 * b] == 0) + 2 * (M[3 * b + 2] == 0);
    const char *name = pw_system_body_name (s, b);
    char line[300];
    if (which == 0) continue;
    snprintf (line, sizeof line, "%s has %s", name, lack[which]);
    report_item (j, &listed, name, line);
  }
  report_end_list (j, listed);
  report_entry (j, NULL, 0, "saddle-point matrix", "%s%s", matrix ? matrix : "not known",
                matrix && x->r == NULL ? "; see below" : "");
  report_line (j);
  pw_json_text (j, "saddle_point", matrix);
}

/* ---- Initial conditions ---- */

static void report_change (pw_json *j, const pw_check *x, int i, int *listed) {
  char name[PW_STATE_NAME], line[500], a[32], b[32], c[32];
  double from, to;
  pw_report_state (x->m.system, pw_run_initial (x->r), i, name, &from, &to);
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "state", name);
  pw_json_number (j, "from", from);
  pw_json_number (j, "to", to);
  pw_json_close (j, '}');
  snprintf (line, sizeof line, "%-20s from %s to %s, by %s %s", name, pw_format (a, from, 10), pw_format (b, to, 10),
            pw_format (c, to - from, 3), pw_system_state_unit (x->m.system, i));
  report_item (j, listed, NULL, line);
}

static void report_initial (pw_json *j, const pw_check *x) {
  static const char title[] = "Initial conditions";
  int listed = 0, n = pw_system_coordinates (x->m.system);
  if (x->r == NULL) {
    report_line (j);
    pw_json_text (j, "start", NULL);
    report_say (j, "\n%s\n  FAILED: %s\n", title, x->failure.text);
    return;
  }
  const pw_initial_report *initial = pw_run_initial (x->r);
  report_section (j, "start", '{', title);
  pw_json_number (j, "moved", initial->moved);
  pw_json_flag (j, "freed", initial->released);
  pw_json_open (j, "changes", '[');
  if (initial->moved == 0)
    report_say (j, "  consistent as described\n");
  else
    report_say (j, "  %d value%s changed%s\n", initial->moved, initial->moved == 1 ? " was" : "s were",
                initial->released ? ", including given ones: they cannot all be satisfied" : "");
  for (int i = 0; i < 2 * n; i++)
    if (pw_initial_moved (x->m.system, initial, i)) report_change (j, x, i, &listed);
  report_end_list (j, listed);
  pw_json_close (j, '}');
  if (x->known)
    report_say (j, "  compared with the reference solution of the model in %d state%s\n", x->known,
                x->known == 1 ? "" : "s");
}

/* ---- Element types ---- */

static void report_failures (pw_json *j, const pw_selftest_report *r, const char *where, const char *label) {
  char error[32], bound[32];
  for (const pw_selftest_check *c = r->check; c < r->check + r->checks; c++) {
    if (!c->failed) continue;
    report_say (j, "    %s: %s does not hold: off by %s, the bound is %s\n      %s\n", label, c->about,
                pw_format (error, c->error, 2), pw_format (bound, c->bound, 2), c->where);
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "check", c->name);
    pw_json_text (j, "in", where);
    pw_json_text (j, "expected", c->about);
    pw_json_number (j, "error", c->error);
    pw_json_number (j, "bound", c->bound);
    pw_json_text (j, "where", c->where);
    pw_json_close (j, '}');
  }
}

static void report_kind (pw_json *j, const pw_checked_kind *k) {
  char name[100];
  report_line (j);
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "kind", k->kind->name);
  pw_json_number (j, "elements", k->count);
  pw_json_number (j, "checks", k->alone.checks + k->inside.checks);
  pw_json_open (j, "failed", '[');
  snprintf (name, sizeof name, "%s (%d element%s)", k->kind->name, k->count, k->count == 1 ? "" : "s");
  report_entry (j, NULL, 0, name, "%s: %d checks at random, %d in this model",
                k->alone.failed + k->inside.failed ? "FAILED" : "good", k->alone.checks, k->inside.checks);
  if (*k->untested) report_say (j, "    not tested at random: %s\n", k->untested);
  report_failures (j, &k->alone, "random scenes", "at random");
  report_failures (j, &k->inside, "this model", "in this model");
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- Linearisation ---- */

/* An eigenvalue, or a conjugate pair. */
static char *report_eigenvalue (const pw_linear *l, int i, char buffer[100]) {
  char re[32], im[32];
  snprintf (buffer, 100, l->im[i] != 0 ? "%s +- %s i 1/s" : "%s 1/s", pw_format (re, l->re[i], CHECK_DIGITS),
            pw_format (im, fabs (l->im[i]), CHECK_DIGITS));
  return buffer;
}

/* Number of equal eigenvalues from i on. */
static int report_same (const pw_linear *l, int i) {
  int k = i;
  while (k < l->unknowns && l->re[k] == l->re[i] && fabs (l->im[k]) == fabs (l->im[i]) && l->rigid[k] == l->rigid[i])
    k++;
  return k - i;
}

static void report_eigenvalues (const pw_linear *l) {
  char text[100];
  for (int i = 0, lines = 0, same; i < l->unknowns; i += same, lines++) {
    if (lines == REPORT_EIGENVALUES) {
      printf ("    and %d more\n", l->unknowns - i);
      return;
    }
    same = report_same (l, i);
    int multiplicity = l->im[i] != 0 ? same / 2 : same;
    char times[30] = "";
    if (multiplicity > 1) snprintf (times, sizeof times, ", %d times", multiplicity);
    report_entry (NULL, NULL, 0, i == 0 ? "eigenvalues, rightmost first" : "", "%s%s%s", report_eigenvalue (l, i, text),
                  times, l->rigid[i] ? ": rigid displacement" : "");
  }
}

static void report_motion (pw_json *j, const pw_linear *l) {
  static const char *const steady[] = { "steady", "accelerated", "changing" };
  char a[32], w[32];
  pw_json_text (j, "motion", steady[l->steady]);
  report_entry (j, "acceleration", l->acceleration, l->steady == PW_ACCELERATED ? "motion" : NULL,
                "not steady: accelerations of %s m/s^2 in the co-moving frame", pw_format (a, l->acceleration, 3));
  if (l->steady == PW_CHANGING)
    report_entry (j, NULL, 0, "motion", "not steady: the equations change with time or along the motion");
  if (l->steady != PW_STEADY) report_entry (j, NULL, 0, "", "the eigenvalues are not stability exponents");
  report_entry (j, "turn_rate", l->twist[2], l->twist[2] != 0 ? "co-moving frame" : NULL, "turns at %s rad/s",
                pw_format (w, l->twist[2], CHECK_DIGITS));
  pw_json_number (j, "symmetries", l->symmetries);
}

static void report_stability (pw_json *j, const pw_check *x) {
  const pw_linear *l = &x->linear;
  double slowest = -INFINITY;
  char time[32];
  for (int i = 0; i < l->unknowns; i++)
    if (!l->rigid[i]) slowest = fmax (slowest, l->re[i]);
  const char *label = l->steady == PW_STEADY && isfinite (slowest) ? "stability" : NULL;
  if (slowest > 0)
    report_entry (j, "doubling_time", x->doubling, label, "unstable, doubles in %s s",
                  pw_format (time, x->doubling, CHECK_DIGITS));
  else if (slowest < 0)
    report_entry (j, "doubling_time", x->doubling, label, "stable, the slowest perturbation halves in %s s",
                  pw_format (time, log (2) / -slowest, CHECK_DIGITS));
  else
    report_entry (j, "doubling_time", x->doubling, label,
                  "neutral: no perturbation grows exponentially, not all decay");
}

static void report_fastest (pw_json *j, const pw_check *x) {
  const pw_linear *l = &x->linear;
  int there = x->fastest >= 0;
  double re = there ? l->re[x->fastest] : 0, im = there ? fabs (l->im[x->fastest]) : 0, size = hypot (re, im);
  double damping = !there ? NAN : re != 0 ? -re / size : 0;
  char text[100], a[32], b[32];
  if (there) report_entry (j, NULL, 0, "fastest eigenvalue", "%s", report_eigenvalue (l, x->fastest, text));
  report_entry (j, "frequency_hz", im / (2 * PW_PI), im != 0 ? "its frequency" : NULL,
                "%s Hz, undamped it would be %s Hz", pw_format (a, im / (2 * PW_PI), CHECK_DIGITS),
                pw_format (b, size / (2 * PW_PI), CHECK_DIGITS));
  report_entry (j, "damping", damping, im != 0 ? "its damping" : NULL, "%s of critical",
                pw_format (a, damping, CHECK_DIGITS));
  if (there && im == 0)
    report_entry (j, NULL, 0, re < 0 ? "it decays by e in" : "it grows by e in", "%s s",
                  pw_format (a, 1 / size, CHECK_DIGITS));
  if (isinf (x->limit))
    report_entry (j, "rk4_step", x->limit, there ? "RK4 is stable" : NULL, "with any step: the fast modes grow");
  else
    report_entry (j, "rk4_step", x->limit, there ? "RK4 is stable up to a step of" : NULL,
                  "%s s; the model's step is %s s", pw_format (a, x->limit, 3), pw_format (b, x->step, 6));
}

static void report_linear (pw_json *j, const pw_check *x) {
  const pw_linear *l = &x->linear;
  if (l->A == NULL) report_line (j), pw_json_text (j, "linearisation", NULL);
  if (x->r == NULL || (j && l->A == NULL)) return;
  report_section (j, "linearisation", '{', "Linearised at the initial state");
  report_entry (j, "unknowns", l->unknowns, "unknowns", "%d", l->unknowns);
  if (l->A == NULL && l->coordinates > CHECK_MOST)
    report_entry (j, NULL, 0, "eigenvalues", "not computed: %d coordinates, the limit is %d", l->coordinates,
                  CHECK_MOST);
  if (l->A == NULL) return;
  report_motion (j, l);
  if (j == NULL && x->fastest < 0 && l->twist[2] == 0)
    report_entry (j, NULL, 0, "eigenvalues", "all 0: nothing vibrates, grows or decays");
  else if (j == NULL)
    report_eigenvalues (l);
  report_stability (j, x);
  report_fastest (j, x);
  report_section (j, "eigenvalues", '[', NULL);
  for (int i = 0; i < l->unknowns; i++) {
    pw_json_open (j, NULL, '[');
    pw_json_number (j, NULL, l->re[i]);
    pw_json_number (j, NULL, l->im[i]);
    pw_json_close (j, ']');
  }
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* ---- The report ---- */

static void report_list (pw_json *j, const char *key, const char *one, const pw_check_list *l) {
  int most = (int)(sizeof l->text / sizeof *l->text);
  if (l->count > 0) report_say (j, "\n%d %s\n", l->count, l->count == 1 ? one : key);
  report_section (j, key, '[', NULL);
  for (int i = 0; i < l->count && i < most; i++) {
    pw_json_text (j, NULL, l->text[i]);
    report_say (j, "  %s\n", l->text[i]);
  }
  pw_json_close (j, ']');
}

static void report_lists (pw_json *j, const pw_check *x) {
  report_list (j, "problems", "problem", &x->problem);
  report_list (j, "findings", "finding", &x->finding);
}

void pw_check_report (const pw_check *x, pw_json *j) {
  const char *about = pw_file_table (x->m.file)->about;
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_text (j, "status", x->problem.count ? "failed" : "ok");
  if (j) report_lists (j, x);
  report_say (j, "%s: %s\n", pw_file_name (x->m.file), about ? about : "");
  report_mobility (j, x);
  report_mass (j, x);
  report_initial (j, x);
  report_section (j, "kinds", '[',
                  "Self-test of the element types in use: each function against differences of others");
  for (const pw_checked_kind *k = x->kind; k < x->kind + x->kinds; k++) report_kind (j, k);
  pw_json_close (j, ']');
  report_linear (j, x);
  report_line (j);
  pw_json_close (j, '}');
  if (x->problem.count + x->finding.count == 0) report_say (j, "\nNo problems found\n");
  if (j == NULL) report_lists (j, x);
}
