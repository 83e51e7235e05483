/* Method names, options and settings: accepted ones, and messages for others. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "methods.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"
#include "util.h"

/* ---- The table ---- */

TEST (table) {
  for (int i = 0; pw_methods[i]; i++) {
    const pw_method *m = pw_methods[i];
    assert_true (m->name && m->about && m->open && m->advance && m->at && m->restart && m->close);
    assert_true (m->stabilisations && m->stabilisations[0].name && m->options);
    int options = 0;
    for (const pw_option *o = m->options; o->name; o++, options++) {
      assert_true (o->about && o->about[0]);
      assert_string_equal (o->choices ? "" : pw_domain_check (o->domain, o->value), "");
    }
    assert_true (options <= PW_MAX_OPTIONS);
    for (int k = 0; k < i; k++) assert_string_not_equal (m->name, pw_methods[k]->name);
  }
}

/* Every integrator with every stabilisation opens and makes a step. */
TEST (every_pair) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  char name[40];
  for (int i = 0; runs_method (i, name); i++) {
    pw_run *r = runs_open (s, name, NULL);
    pw_sample now = runs_to (r, 0.01);
    assert_true (now.t == 0.01 && pw_run_statistics (r)->steps > 0);
    pw_run_close (r);
  }
  pw_system_free (s);
}

TEST (parse) {
  static const struct {
    const char *name;
    double value;
  } option[] = { { "alpha", 25 }, { "beta", 0.5 }, { "every", 1 } }; /* the last one is a default */
  const pw_method *m;
  int stabilisation;
  double value[PW_MAX_OPTIONS];
  pw_error error = { 0 };
  check_ok (pw_method_parse ("rk4", NULL, &m, &stabilisation, &error), &error);
  assert_string_equal (m->name, "rk4");
  assert_int_equal (stabilisation, 0);
  check_ok (pw_parse_options ("rk4+baumgarte:alpha=2.5e1:beta=.5", NULL, &m, &stabilisation, value, &error), &error);
  assert_string_equal (m->stabilisations[stabilisation].name, "baumgarte");
  int found = 0;
  for (int i = 0; m->options[i].name; i++)
    for (int k = 0; k < 3; k++) {
      if (strcmp (m->options[i].name, option[k].name) != 0) continue;
      check_bits (option[k].name, &value[i], &option[k].value, 1);
      found++;
    }
  assert_int_equal (found, 3);
  check_ok (pw_method_parse ("rk4+projection:metric=identity:inputs=held:every=3", NULL, &m, &stabilisation, &error),
            &error);
}

/* A text that ends in "..." matches longer messages. */
static void methods_refused (const char *name, const char *text) {
  const pw_method *m;
  int stabilisation;
  pw_error error = { 0 };
  assert_int_equal (pw_method_parse (name, NULL, &m, &stabilisation, &error), PW_INPUT);
  const char *open = strstr (text, "...");
  if (open == NULL)
    check_error (&error, PW_INPUT, text);
  else
    assert_memory_equal (error.text, text, (size_t)(open - text));
}

TEST (refused) {
  methods_refused ("rk5", "there is no integrator \"rk5\"; did you mean \"erk5\"?");
  methods_refused ("idas+ggl", "there is no integrator \"idas\"; did you mean \"ida\"?");
  methods_refused ("", "there is no integrator \"\"; valid are rk4, ...");
  methods_refused ("rk4+ggl", "integrator rk4 has no stabilisation \"ggl\"; valid are none, ...");
  methods_refused ("rk4+projektion",
                   "integrator rk4 has no stabilisation \"projektion\"; did you mean \"projection\"?");
  methods_refused ("ida+projection", "integrator ida has no stabilisation \"projection\"; valid are none, ...");
  methods_refused ("rk4+nulspace", "integrator rk4 has no stabilisation \"nulspace\"; did you mean \"nullspace\"?");
  methods_refused ("rk4+nullspace:positions=project",
                   "method option positions cannot be \"project\"; did you mean \"projected\"?");
  methods_refused ("adams+projection",
                   "integrator adams has no projection: CVODES projects with bdf only, and restarts after each "
                   "projection would leave order 1; use bdf+projection or erk8+projection");
  methods_refused ("adams+projektion", "integrator adams has no stabilisation \"projektion\"; valid are none, ...");
  methods_refused ("galpha+index2", "integrator galpha has no stabilisation \"index2\"; did you mean \"index3\"?");
  methods_refused ("galpha+ggl:ro=1", "method galpha+ggl has no option \"ro\"; did you mean \"rho\"?");
  methods_refused ("galpha:rho=1.5", "method option rho=1.5: expected a number from 0 to 1");
  methods_refused ("leapfrog+projection", "integrator leapfrog has no stabilisation \"projection\"; valid...");
  methods_refused ("leapfog", "there is no integrator \"leapfog\"; did you mean \"leapfrog\"?");
  methods_refused ("rk4+baumgarte:alfa=1", "method rk4+baumgarte has no option \"alfa\"; did you mean \"alpha\"?");
  methods_refused ("rk4+none:alpha=1", "method rk4+none has no option \"alpha\"; valid...");
  methods_refused ("rk4+projection:metric=masses", "method option metric cannot be \"masses\"; did you mean \"mass\"?");
  methods_refused ("rk4+projection:every", "method option \"every\": expected NAME=VALUE");
  methods_refused ("rk4+projection:every=0", "method option every=0: expected a whole number >= 1");
  methods_refused ("rk4+projection:every=2e9", "method option every=2e9: expected a whole number up to 1e9");
  methods_refused ("rk4+projection:every=2.5", "method option every=2.5: expected a whole number >= 1");
  methods_refused ("rk4+baumgarte:alpha=-1", "method option alpha=-1: expected a number >= 0");
  methods_refused ("rk4+baumgarte:alpha=", "method option alpha=: expected a number");
  methods_refused ("rk4+baumgarte:alpha=1,5", "method option alpha=1,5: expected a number");
  methods_refused ("rk4+baumgarte:alpha=1e", "method option alpha=1e: expected a number");
  methods_refused ("rk4+baumgarte:alpha=1e999", "method option alpha=1e999: expected a finite number");
  methods_refused ("rk4+none+ggl", "method \"rk4+none+ggl\": expected INTEGRATOR+STABILISATION:OPTION=VALUE");
}

TEST (long_names) {
  char name[200] = "rk4+";
  memset (name + 4, 'x', 150);
  char text[400];
  snprintf (text, sizeof text, "method \"%.80s\": a name is too long", name);
  methods_refused (name, text);
  strcpy (name, "rk4+none:");
  memset (name + 9, 'x', 150);
  snprintf (text, sizeof text, "method \"%.80s\": an option is too long", name);
  methods_refused (name, text);
}

/* ---- Settings ---- */

static void methods_bad_setting (const pw_settings *settings, const char *text) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  assert_null (pw_run_open (s, "rk4", settings, &error));
  check_error (&error, PW_INPUT, text);
  pw_system_free (s);
}

TEST (settings) {
  methods_bad_setting (&(pw_settings){ .step = -1 }, "setting step = -1: expected a number > 0");
  methods_bad_setting (&(pw_settings){ .step = NAN }, "setting step = nan: expected a number > 0");
  methods_bad_setting (&(pw_settings){ .rtol = -1 }, "setting rtol = -1: expected a number > 0");
  methods_bad_setting (&(pw_settings){ .atol = INFINITY }, "setting atol = inf: expected a number > 0");
  methods_bad_setting (&(pw_settings){ .span = -2 }, "setting span = -2: expected a number > 0");
  methods_bad_setting (&(pw_settings){ .t = NAN }, "setting t = nan: expected a finite number");
}

SCENE (methods_build_disc) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
}

/* The option steps=fixed makes an adaptive integrator use the step size in place of the tolerances: the default span is
 * 1000 steps, which is the time scale of a scene at rest, and rtol may have any value. */
TEST (fixed_steps) {
  static const char *const method[] = { "rk4", "erk5:steps=fixed", "erk8:steps=fixed", "radau:steps=fixed" };
  pw_system *s = scene_system (&methods_build_disc_table, NULL);
  for (int i = 0; i < 4; i++) {
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.01, .rtol = 1e-20 });
    assert_true (pw_run_initial (r)->time == 10);
    pw_run_close (r);
  }
  pw_system_free (s);
}
