/* Models and systems that several tests use; see scene.h. */
#include <stdarg.h>
#include "check.h"
#include "gallery.h"
#include "scene.h"

/* The model file itself; the name of its table is changed, since a program can have only one pw_plugin. */
#define pw_plugin scene_ezyroller
#include "../../models/vehicles/ezyroller.c"

static pw_model *scene_build (const pw_plugin_table *table, va_list sets) {
  pw_error error = { 0 };
  pw_model *m = pw_model_new (table == &scene_ezyroller ? "ezyroller" : "scene", table, &error);
  check_ok (m ? PW_OK : error.status, &error);
  for (const char *name = va_arg (sets, const char *); name; name = va_arg (sets, const char *))
    check_ok (pw_model_set (m, name, va_arg (sets, double), &error), &error);
  check_ok (pw_model_build (m, &error), &error);
  return m;
}

pw_model *scene_model (const pw_plugin_table *table, ...) {
  va_list sets;
  va_start (sets, table);
  pw_model *m = scene_build (table, sets);
  va_end (sets);
  return m;
}

pw_system *scene_compile (pw_model *m) {
  pw_error error = { 0 };
  pw_system *s = pw_system_compile (m, &error);
  check_ok (s ? PW_OK : error.status, &error);
  pw_model_free (m);
  return s;
}

void scene_refused (pw_model *m, const char *message) {
  pw_error error = { 0 };
  assert_null (pw_system_compile (m, &error));
  check_error (&error, PW_INPUT, message);
  pw_model_free (m);
}

pw_system *scene_system (const pw_plugin_table *table, ...) {
  va_list sets;
  va_start (sets, table);
  pw_model *m = scene_build (table, sets);
  va_end (sets);
  return scene_compile (m);
}

pw_system *scene_named (const char *model, const char *parameter, double value) {
  return gallery_open (model, parameter, value, NULL); /* parameter NULL ends the list */
}
