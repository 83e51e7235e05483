/* Queries of models and compiled systems: bodies and elements, contact points, forces, equations. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "pinwheel-solvers.h"
#include "runs.h"
#include "scene.h"

/* One of each element type; internal coordinates; a closed loop; massless bodies; gravity, which acts on every body. */
static const char *const queries_scene[] = { "tests/scenes/zoo.c", "ezyroller", "n-trailer", "andrews-squeezer",
                                             "knife-edge-incline" };
enum { SCENES = sizeof queries_scene / sizeof *queries_scene };

typedef struct {
  gallery_scene scene;
  pw_system *s; /* of the scene */
  pw_workspace *w;
  pw_run *r;
  pw_sample x;
} queries;

static queries queries_open (const char *model) {
  queries k = { .scene = gallery_load (model, NULL) };
  k.s = k.scene.system;
  k.r = runs_open (k.s, "rk4+projection", &(pw_settings){ .step = 1e-3 });
  k.x = runs_to (k.r, 0.01);
  k.w = pw_workspace_new (k.s, NULL);
  assert_non_null (k.w);
  return k;
}

static void queries_close (queries *k) {
  pw_run_close (k->r);
  pw_workspace_free (k->w);
  gallery_close (&k->scene);
}

/* M a = sum of the forces of all elements, for each body (Newton, Euler): reactions and applied forces, independently
 * of the solver's sums. */
TEST (forces) {
  for (int i = 0; i < SCENES; i++) {
    queries k = queries_open (queries_scene[i]);
    int bodies = pw_system_bodies (k.s);
    double *F = malloc ((size_t)pw_system_force_size (k.s) * sizeof *F), sum[3], size;
    check_ok (pw_workspace_forces (k.w, k.x.t, k.x.q, k.x.v, k.x.lambda, F, NULL), NULL);
    for (int b = 0; b < bodies; b++)
      for (int c = 0; c < 3; c++) {
        sum[c] = -pw_system_mass (k.s)[3 * b + c] * k.x.a[3 * b + c];
        size = fabs (sum[c]);
        for (int e = 0; e < pw_system_elements (k.s); e++) {
          pw_element_info info = pw_system_element (k.s, e);
          for (int n = 0; n < info.kind->bodies; n++)
            if (info.body[n] == b) sum[c] += F[info.force + 3 * n + c], size += fabs (F[info.force + 3 * n + c]);
        }
        check_below (queries_scene[i], fabs (sum[c]), 1e-10 * size + 1e-12,
                     "round-off of the solution, relative to the forces; these scenes are well conditioned");
      }
    free (F);
    queries_close (&k);
  }
}

/* M a + J^T lambda = f and J a = gamma at a sample; J v = eta and g = 0 after projection. */
TEST (equations) {
  for (int i = 0; i < SCENES; i++) {
    queries k = queries_open (queries_scene[i]);
    pw_equations e;
    check_ok (pw_system_equations (k.s, k.x.t, k.x.q, k.x.v, &e, NULL), NULL);
    double *r = calloc ((size_t)(e.coordinates + 2 * e.rows), sizeof *r), *Ja = r + e.coordinates, *Jv = Ja + e.rows;
    double largest = 1;
    for (int j = 0; j < e.coordinates; j++) r[j] = e.mass[j] * k.x.a[j] - e.force[j];
    for (int n = 0; n < e.entries; n++) {
      r[e.column[n]] += e.value[n] * k.x.lambda[e.row[n]];
      Ja[e.row[n]] += e.value[n] * k.x.a[e.column[n]];
      Jv[e.row[n]] += e.value[n] * k.x.v[e.column[n]];
      largest = fmax (largest, fabs (e.value[n] * k.x.lambda[e.row[n]]));
      largest = fmax (largest, fabs (e.value[n] * k.x.a[e.column[n]]));
    }
    const char *reason = "round-off of the solution, relative to the largest term";
    for (int j = 0; j < e.coordinates; j++) check_below (queries_scene[i], fabs (r[j]), 1e-11 * largest, reason);
    for (int j = 0; j < e.rows; j++) check_close (queries_scene[i], Ja[j], e.gamma[j], 1e-11 * largest, reason);
    for (int j = 0; j < e.rows; j++) check_close (queries_scene[i], Jv[j], e.eta[j], 1e-11 * largest, reason);
    for (int j = 0; j < e.holonomic; j++)
      check_below (queries_scene[i], fabs (e.g[j]), 1e-12, "positions are projected");
    assert_int_equal (e.rows, pw_system_rows (k.s));
    free (r);
    pw_equations_free (&e);
    queries_close (&k);
  }
}

/* Elements are those of the model, in the order of their rows; a reaction's name begins with its element's. */
TEST (elements) {
  for (int i = 0; i < SCENES; i++) {
    queries k = queries_open (queries_scene[i]);
    int rows = 0, contacts = 0, described, found = 0, bodies;
    const pw_element *e = pw_model_elements (k.scene.model, &described);
    char name[200];
    for (int n = 0; n < pw_system_elements (k.s); n++) {
      pw_element_info info = pw_system_element (k.s, n);
      for (int j = 0; j < described; j++)
        if (e[j].kind == info.kind && strcmp (pw_element_name (&e[j]), info.name) == 0) found += !info.kind->each_body;
      assert_int_equal (info.contact, info.kind->contact ? contacts++ : -1);
      if (info.kind->rows == 0) continue;
      assert_int_equal (info.row, rows);
      for (int row = rows; row < rows + info.kind->rows; row++) {
        assert_int_equal (pw_system_row_element (k.s, row), n);
        assert_int_equal (info.kind->level, row < pw_system_holonomic (k.s) ? PW_HOLONOMIC : PW_NONHOLONOMIC);
        assert_int_equal (
            strncmp (pw_system_reaction_name (k.s, row, name, sizeof name), info.name, strlen (info.name)), 0);
      }
      rows += info.kind->rows;
    }
    for (int j = 0; j < described; j++) found += e[j].kind->each_body;
    assert_int_equal (found, described);
    assert_int_equal (rows, pw_system_rows (k.s));
    assert_int_equal (contacts, pw_system_contacts (k.s));
    const pw_body *b = pw_model_bodies (k.scene.model, &bodies);
    assert_int_equal (bodies, pw_system_bodies (k.s));
    for (int j = 0; j < bodies; j++) {
      assert_string_equal (b[j].name, pw_system_body_name (k.s, j));
      check_bits ("described start", pw_system_initial_q (k.s) + 3 * j, b[j].start, 3);
      check_bits ("described rates", pw_system_initial_v (k.s) + 3 * j, b[j].rate, 3);
    }
    queries_close (&k);
  }
}

/* Contact points are displaced with their bodies and keep their headings. */
TEST (contacts) {
  static const double at[2] = { 0.3, -0.2 };
  pw_error error = { 0 };
  queries k = queries_open ("ezyroller");
  double out[4][3], *q = malloc ((size_t)pw_system_coordinates (k.s) * sizeof *q);
  assert_int_equal (pw_system_contacts (k.s), 2);
  memcpy (q, k.x.q, (size_t)pw_system_coordinates (k.s) * sizeof *q);
  check_ok (pw_workspace_contact_points (k.w, k.x.t, q, k.x.v, out, &error), &error);
  for (int j = 0; j < pw_system_coordinates (k.s); j += 3) q[j] += at[0], q[j + 1] += at[1];
  check_ok (pw_workspace_contact_points (k.w, k.x.t, q, k.x.v, out + 2, &error), &error);
  for (int i = 0; i < 2; i++) {
    for (int c = 0; c < 2; c++)
      check_close ("displaced contact", out[2 + i][c], out[i][c] + at[c], 1e-15, "one rounding of numbers below 1");
    check_close ("heading", out[2 + i][2], out[i][2], 0, "angles are the same");
  }
  free (q);
  queries_close (&k);
}
