/* Memory of a long chain: what malloc hands out, and which pages an evaluation touches. */
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine.h"

static double memory_used (void) {
  struct mallinfo2 m = mallinfo2 ();
  return (double)m.uordblks + (double)m.hblkhd;
}

/* Forgets which pages were touched. */
static int memory_forget (void) {
  FILE *file = fopen ("/proc/self/clear_refs", "w");
  if (file == NULL) return 0;
  fputs ("1\n", file);
  return fclose (file) == 0;
}

/* Bytes of writable pages touched since. */
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

/* State and result are the caller's: their pages are not counted. */
static double memory_touch (pw_run *r, int links) {
  size_t n = (size_t)(3 * links + 3);
  double *q = calloc (5 * n, sizeof *q), *v = q + n, *a = v + n, *lambda = a + n, touched = 0;
  if (q == NULL) engine_die ("memory", "out of memory");
  engine_bend (links, 0, q, v);
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
  double start = timing_now (), use0 = memory_used ();
  pw_model *m = engine_describe_chain (links);
  double use1 = memory_used ();
  pw_system *s = pw_system_compile (m, &error);
  if (s == NULL) engine_die ("chain", error.text);
  double use2 = memory_used (), compiled = timing_now ();
  pw_run *r = engine_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  double use3 = memory_used (), opened = timing_now (), touched = memory_touch (r, links);
  pw_run_close (r);
  pw_system_free (s);
  pw_model_free (m);
  return (engine_memory){ (use1 - use0) / links, (use2 - use1) / links, (use3 - use2) / links,
                          touched / links,       compiled - start,      opened - compiled };
}
