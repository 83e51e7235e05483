/* effects: measures what a physical effect costs in a scene, and checks that effects cost nothing in a scene without
 * them.
 *
 *   effects [FOLDER]     instructions per evaluation of the EzyRoller, counted by callgrind
 *
 * First the EzyRoller alone, with the libpinwheel to which this program is linked and with the one in FOLDER, which
 * has only the element types of the EzyRoller: the counts must be equal, otherwise the exit status is 1.  Then the
 * EzyRoller with one further effect at a time, and what an event costs: wheel A, with a grip, slides and holds again.
 * Element types are found by name: it runs with both libraries. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine/engine.h"

enum {
  EFFECTS_POOL = 64,     /* states that are evaluated */
  EFFECTS_SPACING = 200, /* steps between them */
  EFFECTS_ROUNDS = 10,   /* evaluations of each */
  EFFECTS_COORDS = 12,   /* 3 bodies, or 2 and a spin angle; 3 entries of the ground */
  EFFECTS_STEPS = 2100   /* of a run with events */
};

/* ---- Scenes ---- */

static void effects_add (pw_model *m, const char *kind, const void *definition) {
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if (strcmp ((*k)->name, kind) == 0) {
      pw_add (m, *k, definition);
      return;
    }
  pw_model_refuse (m, "this library has no element type %s", kind);
}

static void effects_wheel (pw_model *m) {
  effects_add (m, "wheel", &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
}

static void effects_seat (pw_model *m) {
  pw_add_body (m, &(pw_body){ .name = "seat", .mass = 0.2, .inertia = 0.01, .start = { 0.1, 0, 0 } });
}

static void effects_gravity (pw_model *m) {
  effects_wheel (m);
  effects_add (m, "gravity", &(pw_gravity){ .name = "slope", .acceleration = { 0.1, -0.05 } });
}

static void effects_torque (pw_model *m) {
  effects_wheel (m);
  effects_add (m, "torque",
               &(pw_torque){ .name = "wind", .body = { "frame", "ground" }, .value = { .constant = 0.01 } });
}

static void effects_spring (pw_model *m) {
  effects_wheel (m);
  effects_add (m, "spring",
               &(pw_spring){ .name = "return",
                             .body = { "frame", "steer" },
                             .at = { { 0.2, 0 }, { 0.1, 0 } },
                             .stiffness = 5,
                             .damping = 0.1,
                             .length = 0.1 });
}

static void effects_tyre (pw_model *m) {
  effects_wheel (m);
  effects_add (m, "tyre",
               &(pw_tyre){ .name = "side", .body = "frame", .at = { -0.3, 0 }, .stiffness = 1, .speed = 0.1 });
}

static void effects_drive (pw_model *m) {
  effects_wheel (m);
  effects_add (m, "drive",
               &(pw_drive){ .name = "servo",
                            .body = { "frame", "steer" },
                            .what = PW_DRIVE_ANGLE,
                            .value = { PW_HARMONIC, .harmonic = { 0.3, PW_PI, -PW_PI / 2, -PW_PI } } });
}

static void effects_rolling (pw_model *m) {
  effects_add (m, "rolling-wheel",
               &(pw_rolling_wheel){ .name = "A",
                                    .body = "frame",
                                    .at = { -0.5, 0 },
                                    .radius = 0.1,
                                    .inertia = 1e-3,
                                    .torque = { .constant = 0.01 } });
}

static void effects_pinned (pw_model *m) {
  effects_wheel (m);
  effects_seat (m);
  effects_add (m, "pin", &(pw_pin){ .name = "S", .body = { "frame", "seat" }, .at = { { 0, 0 }, { -0.1, 0 } } });
}

static void effects_welded (pw_model *m) {
  effects_wheel (m);
  effects_seat (m);
  effects_add (m, "weld", &(pw_weld){ .name = "S", .body = { "frame", "seat" }, .at = { { 0, 0 }, { -0.1, 0 } } });
}

static void effects_grip (pw_model *m) {
  effects_add (m, "wheel",
               &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 }, .grip = { .constant = 0.03 } });
}

static const struct {
  const char *key, *what;
  void (*add) (pw_model *m);
} effects_scene[] = {
  { "none", "the EzyRoller alone", effects_wheel },
  { "gravity", "gravity along a slope", effects_gravity },
  { "torque", "a second torque, constant", effects_torque },
  { "spring", "a spring with a damper", effects_spring },
  { "tyre", "a tyre on the frame", effects_tyre },
  { "drive", "a drive of the steering angle", effects_drive },
  { "rolling-wheel", "a driven rolling-wheel in place of wheel A", effects_rolling },
  { "pin", "a third body, pinned to the frame", effects_pinned },
  { "weld", "a third body, welded to the frame", effects_welded },
  { "grip", "a grip of wheel A, which holds", effects_grip },
};
enum { EFFECTS_SCENES = sizeof effects_scene / sizeof *effects_scene };

typedef struct {
  double scene, massless;
} effects_parameters;

static const pw_parameter effects_parameter[] = {
  { PW_AT (effects_parameters, scene), 0, "", "which scene", PW_NONNEGATIVE },
  { PW_AT (effects_parameters, massless), 0, "", "steering without mass", PW_NONNEGATIVE },
  { .name = NULL },
};

static void effects_build (pw_model *m, const void *parameters) {
  const effects_parameters *p = parameters;
  double factor = p->massless > 0 ? 0 : 1;
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1 });
  pw_add_body (
      m, &(pw_body){ .name = "steer", .mass = 0.1 * factor, .inertia = 0.01 * factor, .start = { 0.375, 0, PW_PI } });
  effects_add (m, "pin", &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.125, 0 } } });
  effects_add (m, "wheel", &(pw_wheel){ .name = "C", .body = "steer", .at = { 0.125, 0 } });
  effects_add (m, "torque",
               &(pw_torque){ .name = "rider",
                             .body = { "frame", "steer" },
                             .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.1, .omega = PW_PI } } });
  effects_scene[(int)p->scene].add (m);
}

static const pw_plugin_table effects_table = { .abi = PW_ABI,
                                               .size = sizeof (pw_plugin_table),
                                               .about = "EzyRoller with effects",
                                               .parameters = effects_parameter,
                                               .parameters_size = sizeof (effects_parameters),
                                               .build = effects_build };

/* ---- Evaluations, under callgrind ---- */

static const char *const effects_steering[] = { "massive", "massless" };

typedef struct {
  pw_system *system;
  pw_run *run;
  double t[EFFECTS_POOL], q[EFFECTS_POOL][EFFECTS_COORDS], v[EFFECTS_POOL][EFFECTS_COORDS];
  double a[EFFECTS_COORDS], lambda[8]; /* 4 constraint equations, and at most 3 of an effect */
} effects_data;

static long effects_evaluate (void *context, long n) {
  effects_data *d = context;
  for (long i = 0; i < n; i++) {
    int k = (int)(i % EFFECTS_POOL);
    pw_run_accelerate (d->run, d->t[k], d->q[k], d->v[k], d->a, d->lambda);
  }
  return n;
}

static pw_run *effects_open (const char *key, int massless, double step, pw_system **system) {
  pw_error e = { 0 };
  int scene = 0;
  while (scene < EFFECTS_SCENES && strcmp (effects_scene[scene].key, key) != 0) scene++;
  if (scene == EFFECTS_SCENES) engine_die (key, "no such scene");
  pw_model *m = pw_model_new ("effects", &effects_table, &e);
  if (m) pw_model_set (m, "scene", scene, &e), pw_model_set (m, "massless", massless, &e);
  pw_system *s = m && pw_model_build (m, &e) == PW_OK ? pw_system_compile (m, &e) : NULL;
  pw_run *r = s ? pw_run_open (s, "rk4+projection", &(pw_settings){ .step = step, .span = 10 }, &e) : NULL;
  if (r == NULL) engine_die (key, e.text);
  pw_model_free (m);
  *system = s;
  return r;
}

static void effects_close (pw_run *r, pw_system *s) {
  pw_run_close (r);
  pw_system_free (s);
}

/* Fills the pool from a run of the EzyRoller alone: all scenes are evaluated at the same states, since the
 * instructions of a sine depend on the angle.  Further coordinates keep their initial values. */
static void effects_fill (effects_data *d, int massless) {
  pw_error e = { 0 };
  pw_system *s;
  pw_run *alone = effects_open ("none", massless, 1e-3, &s);
  for (int k = 0; k < EFFECTS_POOL; k++) {
    for (int i = 0; i < EFFECTS_SPACING && e.status == PW_OK; i++) pw_run_advance (alone, 100, &e);
    d->t[k] = alone->t;
    memcpy (d->q[k], d->run->q, (size_t)d->run->s->coords * sizeof (double));
    memcpy (d->v[k], d->run->v, (size_t)d->run->s->coords * sizeof (double));
    memcpy (d->q[k], alone->q, (size_t)alone->s->coords * sizeof (double));
    memcpy (d->v[k], alone->v, (size_t)alone->s->coords * sizeof (double));
  }
  if (e.status != PW_OK) engine_die ("the EzyRoller alone", e.text);
  effects_close (alone, s);
}

/* The process whose instructions callgrind counts: evaluates the pool several times. */
static int effects_child (const char *key, const char *steering) {
  static effects_data d;
  int massless = strcmp (steering, effects_steering[1]) == 0;
  d.run = effects_open (key, massless, 1e-3, &d.system);
  effects_fill (&d, massless);
  engine_counted (&(timing_work){ effects_evaluate, &d }, EFFECTS_ROUNDS * EFFECTS_POOL);
  effects_close (d.run, d.system);
  return 0;
}

/* ---- Events: instructions of the two steps that find an event and restart after it, less those of two others ---- */

static long effects_step (void *context, long n) {
  pw_error e = { 0 };
  if (pw_run_advance (context, 20, &e) != PW_OK) engine_die ("a step with an event", e.text);
  return n;
}

/* A run with events: 1 for steps that find one or restart after one; the numbers of steps made, and of events. */
typedef struct {
  unsigned char marked[EFFECTS_STEPS];
  int steps;
  long events;
} effects_run;

static effects_run effects_find (int steering) {
  effects_run found = { 0 };
  pw_system *s;
  pw_run *r = effects_open ("grip", steering, 1e-2, &s);
  for (int i = 0; i < EFFECTS_STEPS && pw_run_time (r) < 20; found.steps = ++i) {
    const long known = r->event_count;
    effects_step (r, 1);
    if (i == 0 || r->event_count == known) continue;
    found.marked[i] = found.marked[i - 1] = 1;
    found.events += r->event_count - known;
  }
  effects_close (r, s);
  return found;
}

/* The process that callgrind counts: of a run with events the marked steps, or the others. */
static int effects_event_child (int marked_ones, int steering) {
  const effects_run found = effects_find (steering);
  pw_system *s;
  pw_run *r = effects_open ("grip", steering, 1e-2, &s);
  for (int i = 0; i < found.steps; i++)
    found.marked[i] == marked_ones ? engine_counted (&(timing_work){ effects_step, r }, 1) : effects_step (r, 1);
  effects_close (r, s);
  return 0;
}

static void effects_event (const char *program) {
  printf ("\nan event, at which wheel A slides or holds; the restart of the method; evaluations of an ordinary step\n");
  for (int steering = 0; steering < 2; steering++) {
    const effects_run found = effects_find (steering);
    int marked = 0;
    for (int i = 0; i < found.steps; i++) marked += found.marked[i];
    const char *name = effects_steering[steering];
    const double step = engine_count (program, "ordinary", name, "pw_run_advance") / (found.steps - marked);
    const double all = engine_count (program, "event", name, "pw_run_advance") - marked * step;
    const double restart = engine_count (program, "event", name, "pw_run_renew") / (double)found.events,
                 evaluation = step / 4;
    const double rest = all / (double)found.events - restart;
    printf ("%-50s %10.0f %10.0f\n", name, rest, restart);
    printf ("%-50s %10.1f %10.1f\n", "  in evaluations", rest / evaluation, restart / evaluation);
  }
}

static int effects_list_kinds (void) {
  for (const pw_kind *const *k = pw_kinds; *k; k++) printf (" %s", (*k)->name);
  printf ("\n");
  return 0;
}

/* ---- The table ---- */

/* Instructions per evaluation. */
static double effects_count (const char *program, const char *key, int massless) {
  double instructions = engine_count (program, key, effects_steering[massless], "pw_run_accelerate");
  if (instructions == 0) engine_die (key, "no instructions were counted; is valgrind installed?");
  return instructions / (EFFECTS_ROUNDS * EFFECTS_POOL);
}

static void effects_print (const char *what, const double count[2], const double base[2]) {
  printf ("%-50s %10.2f %10.2f", what, count[0], count[1]);
  if (base) printf (" %+10.2f %+10.2f", count[0] - base[0], count[1] - base[1]);
  printf ("\n");
  fflush (stdout);
}

/* Prints the element types of the library that the dynamic linker finds, and the counts of the EzyRoller alone. */
static void effects_library (const char *program, const char *name, double count[2]) {
  char command[1000];
  printf ("%s:", name);
  fflush (stdout);
  snprintf (command, sizeof command, "'%s' --kinds", program);
  if (system (command) != 0) engine_die (name, "cannot be run");
  for (int i = 0; i < 2; i++) count[i] = effects_count (program, "none", i);
  effects_print ("  the EzyRoller alone", count, NULL);
}

/* The same with the library in a folder, which the dynamic linker then searches first. */
static void effects_other_library (const char *program, const char *folder, double count[2]) {
  const char *given = getenv ("LD_LIBRARY_PATH");
  char path[8000], saved[4000];
  snprintf (saved, sizeof saved, "%s", given ? given : "");
  snprintf (path, sizeof path, "%.3000s:%s", folder, saved);
  setenv ("LD_LIBRARY_PATH", path, 1);
  effects_library (program, "few kinds", count);
  given ? setenv ("LD_LIBRARY_PATH", saved, 1) : unsetenv ("LD_LIBRARY_PATH");
}

int main (int argc, char **argv) {
  double all[2], few[2];
  int equal = 1;
  if (argc == 4 && strcmp (argv[1], "--count") == 0) {
    const int ordinary = strcmp (argv[2], "ordinary") == 0, massless = strcmp (argv[3], effects_steering[1]) == 0;
    if (ordinary || strcmp (argv[2], "event") == 0) return effects_event_child (!ordinary, massless);
    return effects_child (argv[2], argv[3]);
  }
  if (argc == 2 && strcmp (argv[1], "--kinds") == 0) return effects_list_kinds ();
  engine_check_arguments (argc, argv, 1, "usage: effects [FOLDER]");
  printf ("instructions per evaluation, steering with mass and without; difference to the EzyRoller alone\n\n");
  effects_library (argv[0], "all kinds", all);
  if (argc == 2) {
    effects_other_library (argv[0], argv[1], few);
    equal = all[0] == few[0] && all[1] == few[1];
    printf ("%s to the instruction\n", equal ? "the same" : "NOT the same");
  }
  printf ("\nwith one effect more\n");
  for (int i = 1; i < EFFECTS_SCENES; i++) {
    double count[2] = { effects_count (argv[0], effects_scene[i].key, 0),
                        effects_count (argv[0], effects_scene[i].key, 1) };
    effects_print (effects_scene[i].what, count, all);
  }
  effects_event (argv[0]);
  return !equal;
}
