/* What `pinwheel check` found, for the eye. */
#include <math.h>
#include "check.h"
#include "system.h"

enum { CHECK_LISTED = 8, CHECK_DIGITS = 5 };

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
  text_count ("coordinates", s->coords);
  snprintf (text, sizeof text, "%d (%d on positions, %d on velocities)", s->rows, s->holonomic, s->rows - s->holonomic);
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
  if (s->mass[3 * b] == 0) return s->mass[3 * b + 2] == 0 ? "neither mass nor inertia" : "no mass";
  return s->mass[3 * b + 2] == 0 ? "no inertia" : NULL;
}

static void text_mass (const pw_check *x) {
  const pw_system *s = x->m.system;
  int lacking = 0;
  puts ("\nMass");
  for (int b = 0; b < s->bodies; b++) lacking += text_lack (s, b) != NULL;
  text_count ("bodies without mass or inertia", lacking);
  for (int b = 0, listed = 0; b < s->bodies && listed < CHECK_LISTED; b++)
    if (text_lack (s, b)) printf ("    %s has %s\n", s->body_name[b], text_lack (s, b)), listed++;
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
  for (int i = 0; i < 2 * x->m.system->coords && listed < CHECK_LISTED; i++) {
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

/* ---- Fast motions ---- */

static void text_fastest (const pw_check *x) {
  char text[300], a[32], b[32];
  double re = x->linear.re[0], im = x->linear.im[0], size = hypot (re, im);
  snprintf (text, sizeof text, im != 0 ? "%s +- %s i 1/s" : "%s 1/s", pw_format (a, re, CHECK_DIGITS),
            pw_format (b, im, CHECK_DIGITS));
  text_line ("fastest eigenvalue", text);
  if (im != 0) {
    snprintf (text, sizeof text, "%s Hz, undamped it would be %s Hz", pw_format (a, im / (2 * PW_PI), CHECK_DIGITS),
              pw_format (b, size / (2 * PW_PI), CHECK_DIGITS));
    text_line ("its frequency", text);
    snprintf (text, sizeof text, "%s of critical",
              pw_format (a, fabs (re) > 1e-9 * size ? -re / size : 0, CHECK_DIGITS));
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
  if (x->r == NULL) return;
  puts ("\nLinearised at the start");
  text_count ("unknowns", x->linear.unknowns);
  snprintf (text, sizeof text, "not computed: %d coordinates, the limit is %d", x->linear.coordinates, CHECK_MOST);
  if (x->linear.re == NULL)
    text_line ("eigenvalues", text);
  else if (!pw_check_moves (x))
    text_line ("eigenvalues", "all 0: nothing vibrates, grows or decays");
  if (!pw_check_moves (x)) return;
  text_fastest (x);
  text_limit (x);
}

void pw_check_text (const pw_check *x) {
  const char *about = pw_file_table (x->m.file)->about;
  printf ("%s: %s\n", pw_file_name (x->m.file), about ? about : "");
  text_mobility (x);
  text_mass (x);
  text_start (x);
  text_kinds (x);
  text_linear (x);
  if (x->problems == 0)
    puts ("\nNothing is wrong");
  else
    printf ("\n%d problem%s\n", x->problems, x->problems == 1 ? "" : "s");
  for (int i = 0; i < x->problems && i < (int)(sizeof x->problem / sizeof *x->problem); i++)
    printf ("  %s\n", x->problem[i]);
}
