/* Models and systems that several tests use; any error fails the test. */
#ifndef SCENE_H
#define SCENE_H

#include "pinwheel.h"

/* The table of models/ezyroller.c. */
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
