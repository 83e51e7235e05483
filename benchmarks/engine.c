/* engine: compares Pinwheel with programs written by hand, and measures its cost against the size of a scene.
 *
 *   engine                     everything; writes benchmarks/results/engine-MACHINE.csv
 *   engine KEY...              comparisons whose key starts with KEY (rhs, chain-1000, ...), growth, memory; no file
 *   engine --count KEY SIDE    the work of one side of a comparison ("base" or "ours") alone, for callgrind
 *
 * Times are medians over pairs of alternating batches; instructions are exact.  Both are per unit: an evaluation of the
 * accelerations, a step, a body. */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "engine/engine.h"

enum { ENGINE_PAIRS = 21, ENGINE_IDA_BATCHES = 5, ENGINE_SIZES = 5 /* of a scene, at most */ };
static const double engine_batch = 0.01; /* duration of a batch [s] */

static engine_case engine_cases[] = {
  { "rhs", "EzyRoller, one evaluation", "evaluation", 1.5, engine_open_rhs, engine_close_ezy, .calls = 640 },
  { "rhs-massless", "EzyRoller, massless steering, one evaluation", "evaluation", 1.5, engine_open_rhs,
    engine_close_ezy, .massless = 1, .calls = 640 },
  { "rhs-light", "  massless (right) against massive (left), both Pinwheel", "evaluation", 1, engine_open_light,
    engine_close_ezy, .calls = 640 },
  { "rhs-minimal", "  against minimal coordinates by hand (no target)", "evaluation", 0, engine_open_minimal,
    engine_close_ezy, .calls = 640 },
  { "step", "EzyRoller, one step of rk4+projection", "step", 1.5, engine_open_step, engine_close_ezy, .calls = 1000 },
  { "step-massless", "EzyRoller, massless steering, one step of rk4+projection", "step", 1.5, engine_open_step,
    engine_close_ezy, .massless = 1, .calls = 1000 },
  { "step-light", "  massless (right) against massive (left), both Pinwheel", "step", 1, engine_open_light_step,
    engine_close_ezy, .calls = 1000 },
  { "special-rhs", "EzyRoller, specialised, one evaluation", "evaluation", 1, engine_open_rhs, engine_close_ezy,
    .specialised = 1, .calls = 640 },
  { "special-rhs-massless", "EzyRoller, specialised, massless steering, one evaluation", "evaluation", 1,
    engine_open_rhs, engine_close_ezy, .massless = 1, .specialised = 1, .calls = 640 },
  { "special-step", "EzyRoller, specialised, one step of rk4+projection", "step", 1, engine_open_step, engine_close_ezy,
    .specialised = 1, .calls = 1000 },
  { "special-step-massless", "EzyRoller, specialised, massless steering, one step", "step", 1, engine_open_step,
    engine_close_ezy, .massless = 1, .specialised = 1, .calls = 1000 },
#define SPECIALISED(name, limit)                                                                      \
  { "special-" name,                                                                                  \
    name ", one evaluation, specialised (right) against general",                                     \
    "evaluation",                                                                                     \
    limit,                                                                                            \
    engine_open_specialised,                                                                          \
    engine_close_specialised,                                                                         \
    .model = name,                                                                                    \
    .calls = 640 },                                                                                   \
  {                                                                                                   \
    "special-" name "-step", "  one step of rk4+projection", "step", 0, engine_open_specialised_step, \
        engine_close_specialised, .model = name, .calls = 100                                         \
  }
  SPECIALISED ("snakeboard", 0.4),
  SPECIALISED ("n-trailer", 0),
  SPECIALISED ("roller-racer", 0),
  SPECIALISED ("theo-jansen", 0.4),
  SPECIALISED ("andrews-squeezer", 0),
#define LANES(name, limit)                                                                                  \
  {                                                                                                         \
    "lanes-" name, name ", a step of rk4+projection, runs in lanes (right) against general", "step", limit, \
        engine_open_lanes, engine_close_lanes, .model = name                                                \
  }
  LANES ("ezyroller", 0.1),
  LANES ("snakeboard", 0),
  LANES ("n-trailer", 0),
  LANES ("roller-racer", 0),
  LANES ("theo-jansen", 0),
  LANES ("andrews-squeezer", 0),
  LANES ("wheeled-snake", 0),
  LANES ("chain", 0),
  { "chain-10", "chain of 10, one evaluation, per body", "body", 1.6, engine_open_chain, engine_close_chain,
    .links = 10, .calls = 10 },
  { "chain-100", "chain of 100", "body", 1.6, engine_open_chain, engine_close_chain, .links = 100, .calls = 4 },
  { "chain-1000", "chain of 1000", "body", 1.6, engine_open_chain, engine_close_chain, .links = 1000, .calls = 2 },
  { "chain-10000", "chain of 10,000", "body", 1.6, engine_open_chain, engine_close_chain, .links = 10000 },
  { "chain-100000", "chain of 100,000", "body", 1.6, engine_open_chain, engine_close_chain, .links = 100000 },
  { "ida-6", "EzyRoller, massless, one step of ida+ggl, rtol 1e-6", "step", 1.15, engine_open_ida, engine_close_ida,
    .rtol = 1e-6, .calls = 1 },
  { "ida-10", "EzyRoller, massless, one step of ida+ggl, rtol 1e-10", "step", 1.15, engine_open_ida, engine_close_ida,
    .rtol = 1e-10, .calls = 1 },
  { .key = NULL },
};

/* ---- Reporting ---- */

typedef struct {
  FILE *csv;
  const char *program;
  char *const *only; /* beginnings of keys, or NULL: everything */
  int met, missed;
} engine_report;

static int engine_wanted (const engine_report *r, const char *key) {
  if (r->only == NULL) return 1;
  for (char *const *k = r->only; *k; k++)
    if (strncmp (*k, key, strlen (*k)) == 0) return 1;
  return 0;
}

/* A number as text; "" for 0. */
static const char *engine_number (char *buffer, size_t size, double value, int digits) {
  if (value == 0) return "";
  snprintf (buffer, size, "%.*f", digits, value);
  return buffer;
}

/* Counts whether a value is in [low, high]; "" without a target, high = 0. */
static const char *engine_verdict (engine_report *r, double value, double low, double high) {
  if (high == 0) return "";
  int met = value >= low && value <= high;
  met ? r->met++ : r->missed++;
  return met ? "met" : "MISSED";
}

static void engine_target (char *buffer, size_t size, double low, double high) {
  if (high == 0)
    buffer[0] = '\0';
  else if (low > 0)
    snprintf (buffer, size, "%g..%g", low, high);
  else
    snprintf (buffer, size, "<= %g", high);
}

/* A line of the table and of the file.  Values of 0 are not printed; if high > 0, the ratio must be in [low, high].
 * difference: of the results of both sides. */
typedef struct {
  const char *what, *unit;
  double base, ours, ratio, base_count, our_count, low, high, difference;
} engine_line;

static void engine_put (engine_report *r, const engine_line *l) {
  enum { WIDTH = 40 };
  char target[WIDTH], base[WIDTH], ours[WIDTH], ratio_text[WIDTH], counts[2][WIDTH], agreement[WIDTH] = "";
  const char *verdict = engine_verdict (r, l->ratio, l->low, l->high);
  const char *ratio = engine_number (ratio_text, WIDTH, l->ratio, 3);
  engine_target (target, WIDTH, l->low, l->high);
  if (l->difference > 0) snprintf (agreement, WIDTH, "agree to %.0e", l->difference);
  printf ("%-58s %10s %10s %8s %10s %10s  %-10s %-6s %s\n", l->what, engine_number (base, WIDTH, l->base, 1),
          engine_number (ours, WIDTH, l->ours, 1), ratio, engine_number (counts[0], WIDTH, l->base_count, 1),
          engine_number (counts[1], WIDTH, l->our_count, 1), target, verdict, agreement);
  fflush (stdout);
  if (r->csv == NULL) return;
  fprintf (r->csv, "\"%s\",%s,%s,%s,%s,%s,%s,%s,%s\n", l->what + strspn (l->what, " "), l->unit,
           engine_number (base, WIDTH, l->base, 2), engine_number (ours, WIDTH, l->ours, 2), ratio,
           engine_number (counts[0], WIDTH, l->base_count, 2), engine_number (counts[1], WIDTH, l->our_count, 2),
           target, verdict);
}

static void engine_title (const char *title) {
  printf ("\n%s\n%-58s %10s %10s %8s %10s %10s  %-10s\n", title, "", "base", "Pinwheel", "ratio", "instr.", "instr.",
          "target");
}

/* ---- Comparisons ---- */

static timing_result engine_compare (engine_report *r, engine_case *c) {
  c->open (c);
  timing_result t = timing_compare (&c->base, &c->ours, ENGINE_PAIRS, engine_batch);
  engine_line l = { c->what, c->unit, t.base, t.ours, t.ratio, .high = c->target, .difference = c->difference };
  if (c->calls > 0) {
    double calls = (double)c->calls * (c->links > 0 ? c->links : 1);
    l.base_count =
        engine_count (r->program, c->key, "base", c->base_function) / (c->base_steps ? (double)c->base_steps : calls);
    l.our_count =
        engine_count (r->program, c->key, "ours", c->our_function) / (c->our_steps ? (double)c->our_steps : calls);
  }
  engine_put (r, &l);
  if (c->base_steps > 0)
    printf ("  steps %ld and %ld, residuals %ld and %ld\n", c->base_steps, c->our_steps, c->base_residuals,
            c->our_residuals);
  c->close (c);
  return t;
}

/* One sin and cos of the same angle: in this unit, times differ less between machines than in ns. */
static long engine_sincos (void *context, long n) {
  double *angle = context, sum = 0;
  for (long i = 0; i < n; i++) sum += sin (angle[i % 64]) + cos (angle[i % 64]);
  angle[64] = sum; /* keeps the compiler from removing the loop */
  return n;
}

static double engine_time_sincos (void) {
  double angle[65]; /* the last one takes the sum */
  timing_work work = { engine_sincos, angle };
  for (int i = 0; i < 64; i++) angle[i] = 0.05 * i - 1.6;
  return timing_alone (&work, ENGINE_PAIRS, engine_batch);
}

/* Checks the time [ns] of a program written by hand: `known`, where a sin and a cos take 15 ns; accepts 30 % more. */
static void engine_units (engine_report *r, double sincos, const char *what, double ns, double known) {
  engine_put (r, &(engine_line){ what, "sin+cos pair", sincos, ns, ns / sincos, .high = 1.3 * known / 15 });
}

/* ---- Growth ---- */

/* The slope of log time against log size, from entry `from` on, by least squares. */
static double engine_slope (const int *size, const double *time, int from, int count) {
  double n = count - from, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (int i = from; i < count; i++) {
    double x = log (size[i]), y = log (time[i]);
    sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

/* Reports the ratio of the largest to the least time per body, `ns`, and the slope, both without the smallest scene. */
static void engine_growth_lines (engine_report *r, const char *name, const int *size, const double *ns, int count,
                                 int target) {
  char what[2][80];
  double least = ns[1], most = ns[1], time[ENGINE_SIZES];
  for (int i = 1; i < count; i++) least = fmin (least, ns[i]), most = fmax (most, ns[i]);
  for (int i = 0; i < count; i++) time[i] = ns[i] * size[i];
  snprintf (what[0], sizeof what[0], "%s: most over least ns per body", name);
  snprintf (what[1], sizeof what[1], "%s: slope of log time against log N", name);
  engine_put (r, &(engine_line){ what[0], "ratio", least, most, most / least, .high = target ? 1.5 : 0 });
  double slope = engine_slope (size, time, 1, count);
  engine_put (r,
              &(engine_line){ what[1], "slope", .ratio = slope, .low = target ? 0.95 : 0, .high = target ? 1.06 : 0 });
}

typedef struct {
  const char *name;
  pw_system *(*open) (int size);
  engine_shape shape;
  engine_task task;
  int target; /* 1: growth must be linear */
  int count, size[ENGINE_SIZES];
} engine_growth;

static void engine_grow (engine_report *r, const engine_growth *g) {
  engine_cost *cost[ENGINE_SIZES];
  double ns[ENGINE_SIZES];
  int bodies[ENGINE_SIZES];
  for (int i = 0; i < g->count; i++) {
    pw_system *s = g->open (g->size[i]);
    bodies[i] = s->bodies;
    cost[i] = engine_cost_open (s, g->task, g->shape);
  }
  for (int k = 0; k < (g->task == ENGINE_IDA ? ENGINE_IDA_BATCHES : ENGINE_PAIRS); k++)
    for (int i = 0; i < g->count; i++) engine_cost_take (cost[i]);
  for (int i = 0; i < g->count; i++) {
    char what[80];
    ns[i] = engine_cost_close (cost[i]);
    snprintf (what, sizeof what, "%s, %d bodies: ns per body", g->name, bodies[i]);
    engine_put (r, &(engine_line){ what, "body", .ours = ns[i] });
  }
  engine_growth_lines (r, g->name, bodies, ns, g->count, g->target);
}

static void engine_grow_all (engine_report *r) {
  static const engine_growth all[] = {
    { "chain, evaluation", engine_chain, ENGINE_PINNED, ENGINE_EVALUATION, 1, 5, { 10, 100, 1000, 10000, 100000 } },
    { "chain, projection", engine_chain, ENGINE_PINNED, ENGINE_PROJECTION, 1, 5, { 10, 100, 1000, 10000, 100000 } },
    { "chain, step of ida+ggl", engine_chain, ENGINE_PINNED, ENGINE_IDA, 1, 4, { 10, 100, 1000, 10000 } },
    { "snake, evaluation", engine_snake, ENGINE_FREE, ENGINE_EVALUATION, 1, 4, { 10, 100, 1000, 10000 } },
    { "grid, evaluation", engine_grid, ENGINE_DESCRIBED, ENGINE_EVALUATION, 0, 4, { 2, 7, 22, 70 } },
  };
  for (size_t i = 0; i < sizeof all / sizeof *all; i++) engine_grow (r, &all[i]);
}

static void engine_memory_lines (engine_report *r) {
  engine_memory m = engine_measure_memory (100000);
  double sum = m.description + m.system + m.run, time = m.compile + m.open;
  engine_put (r, &(engine_line){ "  description", "B/body", .ratio = m.description });
  engine_put (r, &(engine_line){ "  system", "B/body", .ratio = m.system });
  engine_put (r, &(engine_line){ "  run of rk4+projection", "B/body", .ratio = m.run });
  engine_put (r, &(engine_line){ "memory per body, all of it", "B/body", .ratio = sum, .high = 2048 });
  if (m.touched > 0)
    engine_put (r, &(engine_line){ "  in pages an evaluation touches, state and result apart", "B/body",
                                   .ratio = m.touched, .high = 400 });
  engine_put (r, &(engine_line){ "  describing and compiling [s]", "s", .ratio = m.compile });
  engine_put (r, &(engine_line){ "  opening a run [s]", "s", .ratio = m.open });
  engine_put (r, &(engine_line){ "validation and ordering [s]", "s", .ratio = time, .high = 2 });
}

/* ---- The program ---- */

/* The processor's name as part of a file name: "amd-epyc-7763". */
static void engine_machine (char *name, size_t size) {
  char line[300] = "";
  FILE *file = fopen ("/proc/cpuinfo", "r");
  while (file && fgets (line, sizeof line, file) && strncmp (line, "model name", 10) != 0) line[0] = '\0';
  if (file) fclose (file);
  const char *text = strchr (line, ':') ? strchr (line, ':') + 2 : "unknown";
  size_t n = 0;
  for (; *text && n + 1 < size; text++)
    if (isalnum ((unsigned char)*text))
      name[n++] = (char)tolower ((unsigned char)*text);
    else if (n > 0 && name[n - 1] != '-')
      name[n++] = '-';
  while (n > 0 && name[n - 1] == '-') n--;
  name[n] = '\0';
}

static void engine_everything (engine_report *r) {
  double ezyroller = 0, chain_link = 0, ida = 0; /* times of programs by hand [ns] */
  engine_title ("Against programs written by hand: ns per unit, instructions per unit");
  for (engine_case *c = engine_cases; c->key; c++) {
    if (!engine_wanted (r, c->key)) continue;
    timing_result t = engine_compare (r, c);
    if (strcmp (c->key, "rhs") == 0) ezyroller = t.base;
    if (strcmp (c->key, "chain-1000") == 0) chain_link = t.base;
    if (strcmp (c->key, "ida-6") == 0) ida = t.base;
  }
  if (r->only == NULL) {
    double sincos = engine_time_sincos ();
    engine_title ("The hand-written programs, in units of one sin and cos (base)");
    engine_units (r, sincos, "EzyRoller, evaluation by hand", ezyroller, 80);
    engine_units (r, sincos, "chain of 1000, evaluation by hand, per body", chain_link, 49);
    engine_units (r, sincos, "EzyRoller, IDA by hand, step", ida, 5000);
  }
  if (engine_wanted (r, "growth")) engine_title ("Growth with the size of the scene"), engine_grow_all (r);
  if (engine_wanted (r, "memory")) engine_title ("Chain of 100,000 bodies"), engine_memory_lines (r);
}

static int engine_child (const char *key, const char *side) {
  for (engine_case *c = engine_cases; c->key; c++)
    if (strcmp (c->key, key) == 0) {
      c->open (c);
      engine_counted (strcmp (side, "base") == 0 ? &c->base : &c->ours, c->calls);
      c->close (c);
      return 0;
    }
  return 2;
}

int main (int argc, char **argv) {
  char machine[100], path[160], part[170];
  if (argc == 4 && strcmp (argv[1], "--count") == 0) return engine_child (argv[2], argv[3]);
  engine_check_arguments (argc, argv, argc, "usage: engine [KEY]...");
  engine_report r = { .program = argv[0], .only = argc > 1 ? argv + 1 : NULL };
  engine_machine (machine, sizeof machine);
  snprintf (path, sizeof path, "benchmarks/results/engine-%s.csv", machine);
  snprintf (part, sizeof part, "%s.part", path);
  if (r.only == NULL) {
    mkdir ("benchmarks/results", 0777);
    r.csv = fopen (part, "w");
    if (r.csv == NULL) engine_die (part, "cannot be written");
    fprintf (r.csv, "what,unit,base_ns,pinwheel_ns,ratio,base_instructions,pinwheel_instructions,target,verdict\n");
  }
  printf ("machine %s; medians of %d interleaved pairs of %g ms\n", machine, ENGINE_PAIRS, 1e3 * engine_batch);
  engine_everything (&r);
  printf ("\n%d targets met, %d missed\n", r.met, r.missed);
  if (r.csv == NULL) return 0;
  if (fclose (r.csv) != 0 || rename (part, path) != 0) engine_die (path, "cannot be written");
  printf ("%s\n", path);
  return 0;
}
