/* Memory of a long chain: allocated by malloc, and in the pages that an evaluation touches. */
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine.h"

static double memory_used (void) {
  struct mallinfo2 m = mallinfo2 ();
  return (double)m.uordblks + (double)m.hblkhd;
}

/* Clears the referenced flags of all pages; 0: the system refuses. */
static int memory_forget (void) {
  FILE *file = fopen ("/proc/self/clear_refs", "w");
  if (file == NULL) return 0;
  fputs ("1\n", file);
  return fclose (file) == 0;
}

/* Bytes of the writable pages referenced since. */
static double memory_touched (void) {
  char line[300], rights[5] = "";
  double sum = 0, kb;
  FILE *file = fopen ("/proc/self/smaps", "r");
  while (file && fgets (line, sizeof line, file)) {
    sscanf (line, "%*x-%*x %4s", rights);
    if (sscanf (line, "Referenced: %lf kB", &kb) == 1 && strchr (rights, 'w')) sum += 1024 * kb;
  }
  if (file) fclose (file);
  return sum;
}

/* Bytes of the pages that an evaluation touches, without the state and the result: 11 numbers per link. */
static double memory_touch (pw_run *r, int links) {
  size_t n = (size_t)(3 * links + 3);
  double *q = calloc (5 * n, sizeof *q), *v = q + n, *a = v + n, *lambda = a + n, touched = 0;
  if (q == NULL) engine_die ("memory", "out of memory");
  engine_bend (links, ENGINE_PINNED, q, v);
  pw_run_accelerate (r, 0, q, v, a, lambda);
  if (memory_forget ()) {
    pw_run_accelerate (r, 0, q, v, a, lambda);
    touched = memory_touched () - (double)(11 * links) * sizeof *q;
  }
  free (q);
  return touched;
}

engine_memory engine_measure_memory (int links) {
  pw_error error = { 0 };
  double start = timing_now (), at_start = memory_used ();
  pw_model *m = engine_describe_chain (links);
  double described = memory_used ();
  pw_system *s = pw_system_compile (m, &error);
  if (s == NULL) engine_die ("chain", error.text);
  double with_system = memory_used (), compiled = timing_now ();
  pw_run *r = engine_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  double with_run = memory_used (), opened = timing_now (), touched = memory_touch (r, links);
  pw_run_close (r);
  pw_system_free (s);
  pw_model_free (m);
  return (engine_memory){ (described - at_start) / links,
                          (with_system - described) / links,
                          (with_run - with_system) / links,
                          touched / links,
                          compiled - start,
                          opened - compiled };
}
