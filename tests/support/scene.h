/* Models and systems that several tests use; any error fails the test. */
#ifndef SCENE_H
#define SCENE_H

#include "pinwheel.h"

/* The table of a model, whose bodies and elements the function `build` adds: without parameters; with a list of
 * parameters that are members of a structure of `bytes` bytes. */
#define SCENE_TABLE(build) SCENE_TABLE_WITH (build, NULL, 0)
#define SCENE_TABLE_WITH(build_, list, bytes) \
  { .abi = PW_ABI, .size = sizeof (pw_plugin_table), .parameters = list, .parameters_size = bytes, .build = build_ }

/* SCENE (fall) { ... } defines a function that adds bodies and elements to the model m, and its table, fall_table;
 * SCENE_WITH also has a list of parameters, the members of the structure p of this type. */
#define SCENE(name)                                               \
  static void name (pw_model *m, const void *);                   \
  static const pw_plugin_table name##_table = SCENE_TABLE (name); \
  static void name (pw_model *m, const void *parameter __attribute__ ((unused)))
#define SCENE_WITH(name, list, type)                                                        \
  static void name##_with (pw_model *m, const type *p);                                     \
  static void name (pw_model *m, const void *parameter) {                                   \
    name##_with (m, parameter);                                                             \
  }                                                                                         \
  static const pw_plugin_table name##_table = SCENE_TABLE_WITH (name, list, sizeof (type)); \
  static void name##_with (pw_model *m, const type *p __attribute__ ((unused)))

/* The table of models/vehicles/ezyroller.c. */
extern const pw_plugin_table scene_ezyroller;

/* A built model of a table, with parameters set: scene_model (&table, "m2", 0.1, "I2", 0.01, NULL). */
pw_model *scene_model (const pw_plugin_table *table, ...);

/* The same, compiled. */
pw_system *scene_system (const pw_plugin_table *table, ...);

/* The system of a model by name or path, with one parameter set (NULL: none). */
pw_system *scene_named (const char *model, const char *parameter, double value);

/* Compiles a model and frees it; scene_refused: it must be invalid, with this message. */
pw_system *scene_compile (pw_model *m);
void scene_refused (pw_model *m, const char *message);

#endif
