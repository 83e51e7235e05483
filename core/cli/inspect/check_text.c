/* What `pinwheel check` found, for the eye. */
#include <math.h>
#include <string.h>
#include "check.h"

enum { CHECK_LISTED = 8, CHECK_EIGENVALUES = 60 };

static void text_line (const char *what, const char *value) {
  printf ("  %-34s %s\n", what, value);
}

static void text_count (const char *what, int value) {
  printf ("  %-34s %d\n", what, value);
}

static void text_more (int more) {
  if (more > 0) printf ("    and %d more\n", more);
}

/* ---- Mobility and mass ---- */

static void text_singular_value (const pw_check *x) {
  char text[200], value[32], length[32];
  const pw_linear *l = &x->linear;
  if (l->rank == 0) return;
  if (isnan (l->least))
    snprintf (text, sizeof text, "not computed: %d coordinates, the limit is %d", l->coordinates, CHECK_MOST);
  else
    snprintf (text, sizeof text, "%s, rows of length 1, angles in units of L = %s m",
              pw_format (value, l->least, CHECK_DIGITS), pw_format (length, pw_run_scale (x->r)->length, CHECK_DIGITS));
  text_line ("smallest singular value of J", text);
}

static void text_mobility (const pw_check *x) {
  const pw_system *s = x->m.system;
  char text[100];
  int listed = 0;
  puts ("\nMobility");
  int rows = pw_count_rows (s), holonomic = pw_count_holonomic (s);
  text_count ("coordinates", pw_count_coordinates (s));
  snprintf (text, sizeof text, "%d (%d on positions, %d on velocities)", rows, holonomic, rows - holonomic);
  text_line ("constraint rows", text);
  if (x->r == NULL) return;
  text_count ("degrees of freedom, configuration", x->linear.positions);
  text_count ("degrees of freedom, velocity", x->linear.velocities);
  text_count ("rank of J", x->linear.rank);
  text_singular_value (x);
  text_count ("redundant rows", pw_run_redundant (x->r));
  for (const char *const *r = x->redundant; r && *r && listed < CHECK_LISTED; r++, listed++) printf ("    %s\n", *r);
  text_more (pw_run_redundant (x->r) - listed);
}

/* What a body lacks; NULL: nothing. */
static const char *text_lack (const pw_system *s, int b) {
  const double *M = pw_system_mass (s) + 3 * b;
  if (M[0] == 0) return M[2] == 0 ? "neither mass nor inertia" : "no mass";
  return M[2] == 0 ? "no inertia" : NULL;
}

static void text_mass (const pw_check *x) {
  const pw_system *s = x->m.system;
  int lacking = 0, bodies = pw_count_bodies (s);
  puts ("\nMass");
  for (int b = 0; b < bodies; b++) lacking += text_lack (s, b) != NULL;
  text_count ("bodies without mass or inertia", lacking);
  for (int b = 0, listed = 0; b < bodies && listed < CHECK_LISTED; b++)
    if (text_lack (s, b)) printf ("    %s has %s\n", pw_system_body_name (s, b), text_lack (s, b)), listed++;
  text_more (lacking - CHECK_LISTED);
  text_line ("saddle-point matrix", x->r                          ? "regular"
                                    : x->start.status == PW_INPUT ? "singular; see below"
                                                                  : "not known");
}

/* ---- The start ---- */

static void text_start (const pw_check *x) {
  puts ("\nStart");
  if (x->r == NULL) {
    printf ("  FAILED: %s\n", x->start.text);
    return;
  }
  const pw_start_report *start = pw_run_start (x->r);
  char name[300], a[32], b[32], c[32];
  int listed = 0;
  if (start->moved == 0) puts ("  consistent as described");
  if (start->moved > 0)
    printf ("  %d value%s moved%s\n", start->moved, start->moved == 1 ? " was" : "s were",
            start->freed ? ", given ones among them: not all of those can be held" : "");
  for (int i = 0; i < 2 * pw_count_coordinates (x->m.system) && listed < CHECK_LISTED; i++) {
    double from, to;
    if (!pw_start_moved (x->m.system, start, i)) continue;
    pw_check_state (x, i, name, sizeof name, &from, &to);
    printf ("    %-20s from %s to %s, by %s %s\n", name, pw_format (a, from, 10), pw_format (b, to, 10),
            pw_format (c, to - from, 3), pw_state_unit (x->m.system, i));
    listed++;
  }
  text_more (start->moved - listed);
  if (x->known)
    printf ("  compared with the truth of the model, which knows %d state%s\n", x->known, x->known == 1 ? "" : "s");
}

/* ---- Kinds ---- */

static void text_fault (const pw_selftest_check *c, const char *where) {
  char error[32], bound[32];
  printf ("    %s: %s does not hold: off by %s, the bound is %s\n      %s\n", where, c->about,
          pw_format (error, c->error, 2), pw_format (bound, c->bound, 2), c->where);
}

static void text_failures (const pw_selftest_report *r, const char *where) {
  for (int i = 0; i < r->checks; i++)
    if (r->check[i].failed) text_fault (&r->check[i], where);
}

static void text_kinds (const pw_check *x) {
  char name[100];
  puts ("\nSelf-test of the kinds in use: each function against differences of others");
  for (const pw_checked_kind *k = x->kind; k < x->kind + x->kinds; k++) {
    snprintf (name, sizeof name, "%s (%d element%s)", k->kind->name, k->count, k->count == 1 ? "" : "s");
    printf ("  %-34s %s: %d checks at random, %d in this model\n", name,
            k->alone.failed + k->inside.failed ? "FAILED" : "good", k->alone.checks, k->inside.checks);
    if (*k->untested) printf ("    not tested at random: %s\n", k->untested);
    text_failures (&k->alone, "at random");
    text_failures (&k->inside, "in this model");
  }
}

/* ---- Linearisation ---- */

/* An eigenvalue, or a conjugate pair. */
static char *text_eigenvalue (const pw_linear *l, int i, char *buffer, size_t size) {
  char re[32], im[32];
  snprintf (buffer, size, l->im[i] != 0 ? "%s +- %s i 1/s" : "%s 1/s", pw_format (re, l->re[i], CHECK_DIGITS),
            pw_format (im, fabs (l->im[i]), CHECK_DIGITS));
  return buffer;
}

/* How many eigenvalues from i on are the same. */
static int text_same (const pw_linear *l, int i) {
  int k = i;
  while (k < l->unknowns && l->re[k] == l->re[i] && fabs (l->im[k]) == fabs (l->im[i]) && l->rigid[k] == l->rigid[i])
    k++;
  return k - i;
}

static void text_eigenvalues (const pw_linear *l) {
  char text[200];
  for (int i = 0, lines = 0, same; i < l->unknowns; i += same, lines++) {
    if (lines == CHECK_EIGENVALUES) {
      text_more (l->unknowns - i);
      return;
    }
    same = text_same (l, i);
    text_eigenvalue (l, i, text, sizeof text);
    size_t n = strlen (text);
    int times = l->im[i] != 0 ? same / 2 : same;
    if (times > 1) n += (size_t)snprintf (text + n, sizeof text - n, ", %d times", times);
    if (l->rigid[i]) snprintf (text + n, sizeof text - n, ": displacement of the whole");
    text_line (i == 0 ? "eigenvalues, rightmost first" : "", text);
  }
}

static void text_frame (const pw_linear *l) {
  char text[300], a[32];
  if (l->twist[2] != 0) {
    snprintf (text, sizeof text, "turns at %s rad/s", pw_format (a, l->twist[2], CHECK_DIGITS));
    text_line ("co-moving frame", text);
  }
  if (l->steady == PW_STEADY) return;
  if (l->steady == PW_ACCELERATED)
    snprintf (text, sizeof text, "not steady: accelerations of %s m/s^2 in the co-moving frame",
              pw_format (a, l->acceleration, 3));
  else
    snprintf (text, sizeof text, "not steady: its equations change with time or along the motion");
  text_line ("motion", text);
  text_line ("", "the eigenvalues are not stability exponents");
}

static void text_stability (const pw_check *x) {
  char text[100], a[32];
  const pw_linear *l = &x->linear;
  double slowest = -INFINITY;
  for (int i = 0; i < l->unknowns; i++)
    if (!l->rigid[i]) slowest = fmax (slowest, l->re[i]);
  if (l->steady != PW_STEADY || isinf (slowest)) return;
  if (slowest > 0)
    snprintf (text, sizeof text, "unstable, doubles in %s s", pw_format (a, pw_check_doubling (x), CHECK_DIGITS));
  else if (slowest < 0)
    snprintf (text, sizeof text, "stable, the slowest disturbance halves in %s s",
              pw_format (a, log (2) / -slowest, CHECK_DIGITS));
  else
    snprintf (text, sizeof text, "neutral: no disturbance grows exponentially, not all decay");
  text_line ("stability", text);
}

static void text_fastest (const pw_check *x) {
  char text[300], a[32], b[32];
  const pw_linear *l = &x->linear;
  double re = l->re[x->fastest], im = fabs (l->im[x->fastest]), size = hypot (re, im);
  text_line ("fastest eigenvalue", text_eigenvalue (l, x->fastest, text, sizeof text));
  if (im != 0) {
    snprintf (text, sizeof text, "%s Hz, undamped it would be %s Hz", pw_format (a, im / (2 * PW_PI), CHECK_DIGITS),
              pw_format (b, size / (2 * PW_PI), CHECK_DIGITS));
    text_line ("its frequency", text);
    snprintf (text, sizeof text, "%s of critical", pw_format (a, re != 0 ? -re / size : 0, CHECK_DIGITS));
    text_line ("its damping", text);
  } else {
    snprintf (text, sizeof text, "%s s", pw_format (a, 1 / size, CHECK_DIGITS));
    text_line (re < 0 ? "it decays by e in" : "it grows by e in", text);
  }
}

static void text_limit (const pw_check *x) {
  char text[200], a[32], b[32];
  if (isinf (x->limit)) {
    text_line ("RK4 is stable", "with any step: what is fast here grows");
    return;
  }
  snprintf (text, sizeof text, "%s s; the model's step is %s s", pw_format (a, x->limit, 3), pw_format (b, x->step, 6));
  text_line ("RK4 is stable up to a step of", text);
}

static void text_linear (const pw_check *x) {
  char text[100];
  const pw_linear *l = &x->linear;
  if (x->r == NULL) return;
  puts ("\nLinearised at the start");
  text_count ("unknowns", l->unknowns);
  snprintf (text, sizeof text, "not computed: %d coordinates, the limit is %d", l->coordinates, CHECK_MOST);
  if (l->A == NULL) text_line ("eigenvalues", text);
  if (l->A == NULL) return;
  text_frame (l);
  if (x->fastest < 0 && l->twist[2] == 0)
    text_line ("eigenvalues", "all 0: nothing vibrates, grows or decays");
  else
    text_eigenvalues (l);
  text_stability (x);
  if (x->fastest < 0) return;
  text_fastest (x);
  text_limit (x);
}

static void text_list (const pw_check_list *l, const char *what) {
  if (l->count > 0) printf ("\n%d %s%s\n", l->count, what, l->count == 1 ? "" : "s");
  for (int i = 0; i < pw_check_listed (l); i++) printf ("  %s\n", l->text[i]);
}

void pw_check_text (const pw_check *x) {
  const char *about = pw_file_table (x->m.file)->about;
  printf ("%s: %s\n", pw_file_name (x->m.file), about ? about : "");
  text_mobility (x);
  text_mass (x);
  text_start (x);
  text_kinds (x);
  text_linear (x);
  if (x->problem.count + x->finding.count == 0) puts ("\nNothing is wrong");
  text_list (&x->problem, "problem");
  text_list (&x->finding, "finding");
}
