/* The scenes of the programs engine and peers, built through the public interface. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "engine.h"

double engine_difference (const double *a, const double *b, int n) {
  double worst = 0, size = 0;
  for (int i = 0; i < n; i++) {
    worst = fmax (worst, fabs (a[i] - b[i]));
    size = fmax (size, fabs (a[i]));
  }
  return worst / size;
}

/* ---- Descriptions ---- */

typedef struct {
  double n, massless;
} scene;

static const pw_parameter scene_parameters[] = {
  { PW_AT (scene, n), 1, "", "size", PW_COUNT },
  { PW_AT (scene, massless), 0, "", "steering without mass", PW_NONNEGATIVE },
  { .name = NULL },
};

static void scene_ezyroller (pw_model *m, const void *parameters) {
  int massless = ((const scene *)parameters)->massless > 0;
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 1, .inertia = 0.1 });
  pw_add_body (m, &(pw_body){ .name = "steer",
                              .mass = massless ? 0 : 0.1,
                              .inertia = massless ? 0 : 0.01,
                              .start = { 0.375, 0, PW_PI } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "frame", "steer" }, .at = { { 0.5, 0 }, { -0.125, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "A", .body = "frame", .at = { -0.5, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "C", .body = "steer", .at = { 0.125, 0 } });
  pw_add_torque (m, &(pw_torque){ .name = "rider",
                                  .body = { "frame", "steer" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.1, .omega = PW_PI } } });
}

/* A uniform bar of 1 m and 1 kg. */
static void scene_bar (pw_model *m, const char *name, double x, double y, double phi) {
  pw_add_body (m, &(pw_body){ .name = name, .mass = 1, .inertia = 1.0 / 12, .start = { x, y, phi } });
}

static void scene_chain (pw_model *m, const void *parameters) {
  int links = (int)((const scene *)parameters)->n;
  char name[24], before[24] = "ground", pin[24];
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -9.81 } });
  for (int i = 0; i < links; i++, memcpy (before, name, sizeof before)) {
    snprintf (name, sizeof name, "%d", i + 1);
    scene_bar (m, name, i + 0.5, 0, 0);
    snprintf (pin, sizeof pin, "P%d", i + 1);
    pw_add_pin (m, &(pw_pin){ .name = pin, .body = { before, name }, .at = { { i ? 0.5 : 0, 0 }, { -0.5, 0 } } });
  }
}

static void scene_snake (pw_model *m, const void *parameters) {
  int links = (int)((const scene *)parameters)->n;
  char name[24], before[24] = "", joint[24];
  for (int i = 0; i < links; i++, memcpy (before, name, sizeof before)) {
    snprintf (name, sizeof name, "%d", i + 1);
    scene_bar (m, name, i + 0.5, 0, 0);
    snprintf (joint, sizeof joint, "P%d", i);
    if (i > 0) pw_add_pin (m, &(pw_pin){ .name = joint, .body = { before, name }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
    snprintf (joint, sizeof joint, "W%d", i + 1);
    pw_add_wheel (m, &(pw_wheel){ .name = joint, .body = name });
  }
}

/* Pins the point (at, 0) of a bar to the first bar of the node; becomes the first bar itself if there is none yet. */
static void scene_node (pw_model *m, char (*first)[24], double *first_at, int node, const char *bar, double at) {
  char pin[60];
  if (first[node][0] == '\0') {
    snprintf (first[node], sizeof first[node], "%s", bar);
    first_at[node] = at;
    return;
  }
  snprintf (pin, sizeof pin, "N%d-%s", node, bar);
  pw_add_pin (m, &(pw_pin){ .name = pin, .body = { first[node], bar }, .at = { { first_at[node], 0 }, { at, 0 } } });
}

static void scene_grid (pw_model *m, const void *parameters) {
  int n = (int)((const scene *)parameters)->n, side = n + 1;
  char (*first)[24] = calloc ((size_t)(side * side), sizeof *first), bar[24];
  double *first_at = calloc ((size_t)(side * side), sizeof *first_at);
  if (first == NULL || first_at == NULL) engine_die ("grid", "out of memory");
  snprintf (first[0], sizeof first[0], "ground");
  for (int j = 0; j < side; j++)
    for (int i = 0; i < side; i++)
      for (int vertical = 0; vertical < 2; vertical++) {
        if ((vertical ? j : i) == n) continue;
        snprintf (bar, sizeof bar, "%c%d-%d", vertical ? 'v' : 'h', i, j);
        scene_bar (m, bar, i + (vertical ? 0 : 0.5), j + (vertical ? 0.5 : 0), vertical ? PW_PI / 2 : 0);
        scene_node (m, first, first_at, j * side + i, bar, -0.5);
        scene_node (m, first, first_at, vertical ? (j + 1) * side + i : j * side + i + 1, bar, 0.5);
      }
  free (first);
  free (first_at);
}

/* ---- From description to run ---- */

static pw_model *scene_describe (const char *name, void (*build) (pw_model *, const void *), int n, int massless) {
  pw_plugin_table table = { .abi = PW_ABI,
                            .size = sizeof table,
                            .about = name,
                            .parameters = scene_parameters,
                            .parameters_size = sizeof (scene),
                            .build = build };
  pw_plugin_table *keep = malloc (sizeof *keep); /* never deallocated: the model refers to it */
  pw_error error = { 0 };
  if (keep == NULL) engine_die (name, "out of memory");
  *keep = table;
  pw_model *m = pw_model_new (name, keep, &error);
  if (m == NULL || pw_model_set (m, "n", n, &error) != PW_OK ||
      pw_model_set (m, "massless", massless, &error) != PW_OK || pw_model_build (m, &error) != PW_OK)
    engine_die (name, error.text);
  return m;
}

static pw_system *scene_compile (const char *name, void (*build) (pw_model *, const void *), int n, int massless) {
  pw_error error = { 0 };
  pw_model *m = scene_describe (name, build, n, massless);
  pw_system *s = pw_system_compile (m, &error);
  if (s == NULL) engine_die (name, error.text);
  pw_model_free (m);
  return s;
}

pw_system *engine_ezyroller (int massless) {
  return scene_compile ("ezyroller", scene_ezyroller, 1, massless);
}

pw_system *engine_chain (int links) {
  return scene_compile ("chain", scene_chain, links, 0);
}

pw_system *engine_snake (int links) {
  return scene_compile ("snake", scene_snake, links, 0);
}

pw_system *engine_grid (int cells) {
  return scene_compile ("grid", scene_grid, cells, 0);
}

pw_model *engine_describe_chain (int links) {
  return scene_describe ("chain", scene_chain, links, 0);
}

pw_run *engine_open (pw_system *s, const char *method, const pw_settings *settings) {
  pw_error error = { 0 };
  pw_run *r = pw_run_open (s, method, settings, &error);
  if (r == NULL) engine_die (method, error.text);
  return r;
}

void engine_bend (int links, engine_shape shape, double *q, double *v) {
  int moves = shape == ENGINE_FREE; /* its first end */
  double x = 0, y = 0, vx = moves ? 1 : 0, vy = moves ? 0.5 : 0;
  for (int i = 0; i < links; i++) {
    double phi = 0.4 * sin (0.7 * i), w = 0.3 * cos (1.1 * i), c = cos (phi) / 2, s = sin (phi) / 2;
    q[3 * i] = x += c, q[3 * i + 1] = y += s, q[3 * i + 2] = phi;
    v[3 * i] = vx -= s * w, v[3 * i + 1] = vy += c * w, v[3 * i + 2] = w;
    x += c, y += s, vx -= s * w, vy += c * w;
  }
}
