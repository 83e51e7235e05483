/* See start.h. */
#include "start.h"
#include "check.h"
#include "runs.h"
#include "scene.h"

pw_run *start_open (pw_system **system, const char *const *name, const double *value) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  for (int i = 0; name && name[i]; i++) check_ok (pw_model_set_initial (m, name[i], value[i], &error), &error);
  *system = scene_compile (m);
  pw_run *r = runs_open (*system, "rk4", NULL);
  pw_sample now = runs_to (r, 0);
  check_below ("position", now.position, START_ROUND_OFF, START_REASON);
  check_below ("velocity", now.velocity, START_ROUND_OFF, START_REASON);
  return r;
}
