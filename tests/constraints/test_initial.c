/* Initial conditions of random linkages and vehicles: values that belong to a consistent state are kept to the bit; of
 * others, a maximal set that the constraints do not relate.
 *
 * Joints are placed at points of a random state, so that it satisfies the constraints.  A part of its values is
 * specified, exactly or changed; the run then begins without the others.  Independence is verified with dense matrices,
 * by elimination with complete pivoting. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pinwheel-solvers.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "system.h"

enum { BODIES = 7, STATES = 6 * BODIES, JOINTS = 12 };

/* ---- Random scenes ---- */

static uint64_t random_state;
static double random_between (double low, double high) {
  random_state = random_state * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (double)(random_state >> 11) / 9007199254740992.;
}
static int random_below (int n) {
  return (int)random_between (0, n);
}

typedef enum { PIN, SLOT, ROD, WHEEL } joint_type;

typedef struct {
  joint_type type;
  int body[2]; /* -1: ground */
  double at[2][2], heading, length;
} random_joint;

typedef struct {
  int bodies, joints;
  double mass[BODIES], q[3 * BODIES], v[3 * BODIES]; /* mass 0: massless */
  random_joint joint[JOINTS];
  unsigned specified[BODIES];                 /* PW_SPECIFIES_X, ... */
  double start[3 * BODIES], rate[3 * BODIES]; /* the values specified */
} random_scene;

static random_scene now;
static char names[BODIES + JOINTS][8];

static const char *body_name (int b) {
  return b < 0 ? "ground" : names[b];
}

static void build (pw_model *m, const void *none __attribute__ ((unused))) {
  for (int b = 0; b < now.bodies; b++) {
    snprintf (names[b], sizeof names[b], "b%d", b);
    pw_body body = {
      .name = names[b], .mass = now.mass[b], .inertia = 0.1 * now.mass[b], .specified = now.specified[b]
    };
    memcpy (body.start, now.start + 3 * b, sizeof body.start);
    memcpy (body.rate, now.rate + 3 * b, sizeof body.rate);
    pw_add_body (m, &body);
  }
  for (int i = 0; i < now.joints; i++) {
    const random_joint *j = &now.joint[i];
    const char *one = body_name (j->body[0]), *two = body_name (j->body[1]);
    char *name = names[BODIES + i];
    snprintf (name, sizeof names[0], "j%d", i);
    const double (*at)[2] = j->at;
    if (j->type == PIN)
      pw_add_pin (
          m, &(pw_pin){ .name = name, .body = { one, two }, .at = { { at[0][0], at[0][1] }, { at[1][0], at[1][1] } } });
    else if (j->type == SLOT)
      pw_add_slot (m, &(pw_slot){ .name = name,
                                  .body = { one, two },
                                  .at = { { at[0][0], at[0][1] }, { at[1][0], at[1][1] } },
                                  .heading = j->heading });
    else if (j->type == ROD)
      pw_add_rod (m, &(pw_rod){ .name = name,
                                .body = { one, two },
                                .at = { { at[0][0], at[0][1] }, { at[1][0], at[1][1] } },
                                .length = j->length });
    else
      pw_add_wheel (m, &(pw_wheel){ .name = name, .body = one, .at = { at[0][0], at[0][1] }, .heading = j->heading });
  }
}
static const pw_plugin_table random_table = SCENE_TABLE (build);

/* Joins two bodies at a point of the world. */
static random_joint *join (joint_type type, int one, int two, double x, double y) {
  random_joint *j = &now.joint[now.joints++];
  *j = (random_joint){ .type = type, .body = { one, two }, .length = 1 };
  for (int i = 0; i < 2; i++) {
    const int b = j->body[i];
    const double *q = now.q + 3 * b, dx = b < 0 ? x : x - q[0], dy = b < 0 ? y : y - q[1];
    const double c = b < 0 ? 1 : cos (q[2]), s = b < 0 ? 0 : sin (q[2]);
    j->at[i][0] = c * dx + s * dy, j->at[i][1] = c * dy - s * dx;
  }
  return j;
}

/* Bodies between the points of a polygon from the ground to the ground. */
static void random_loop (int n) {
  double x = 0, y = 0, heading = random_between (-3, 3);
  now.bodies = n;
  for (int b = 0; b < n; b++) {
    const double length = random_between (0.4, 2);
    heading += random_between (0.3, 2.2);
    double *q = now.q + 3 * b;
    q[0] = x + 0.5 * length * cos (heading), q[1] = y + 0.5 * length * sin (heading);
    q[2] = heading + (random_below (3) ? 0 : random_between (-3, 3));
    join (PIN, b - 1, b, x, y);
    x += length * cos (heading), y += length * sin (heading);
  }
  if (random_below (3) == 0) { /* the last body slides in the ground */
    random_joint *slot = join (SLOT, n - 1, -1, x, y);
    slot->heading = random_between (-3, 3);
  } else {
    join (PIN, n - 1, -1, x, y);
  }
}

/* Bodies that hang on each other by pins, rods and slots. */
static void random_tree (int n) {
  now.bodies = n;
  for (int b = 0; b < n; b++) {
    const int parent = random_below (b + 1) - 1;
    const joint_type type = (joint_type)random_below (3);
    double *q = now.q + 3 * b, x = random_between (-2, 2), y = random_between (-2, 2);
    q[0] = x + random_between (0.3, 1), q[1] = y + random_between (-1, -0.3), q[2] = random_between (-1, 1);
    random_joint *j = join (type, parent, b, x, y);
    if (type == SLOT) j->heading = random_between (-3, 3);
    if (type != ROD) continue;
    const double beside[2] = { random_between (0.5, 1), random_between (-1, 1) };
    j->at[1][0] += beside[0], j->at[1][1] += beside[1]; /* away from the first point by: */
    j->length = hypot (beside[0], beside[1]);
  }
}

/* A car and trailers, on wheels; some axles behind each other's hitch. */
static void random_vehicle (int n) {
  now.bodies = n;
  double x = 0, y = 0, heading = random_between (-3, 3);
  for (int b = 0; b < n; b++) {
    const double length = random_between (0.5, 2), hitch = random_between (-0.2, 0.3);
    double *q = now.q + 3 * b;
    heading += b ? random_between (-1, 1) : 0;
    q[0] = x - length * cos (heading), q[1] = y - length * sin (heading), q[2] = heading;
    if (b) join (PIN, b - 1, b, x, y);
    const double axle = length + (b ? 0 : 0.5) * random_between (-0.3, 0.3);
    join (WHEEL, b, b, x - axle * cos (heading), y - axle * sin (heading));
    x -= (length + hitch) * cos (heading), y -= (length + hitch) * sin (heading);
  }
}

/* A scene with consistent positions now.q and velocities now.v. */
static void random_make (int number) {
  random_state = (uint64_t)number * 7919 + 17;
  for (int i = 0; i < 3; i++) random_between (0, 1);
  now = (random_scene){ .bodies = 0 };
  if (number % 3 == 0) random_loop (3 + random_below (4));
  if (number % 3 == 1) random_tree (1 + random_below (BODIES));
  if (number % 3 == 2) random_vehicle (1 + random_below (5));
  for (int b = 0; b < now.bodies; b++) now.mass[b] = exp (random_between (-2, 2));
  for (int j = 0; j < 3 * now.bodies; j++) now.start[j] = now.q[j], now.rate[j] = random_between (-2, 2);
  for (int b = 0; b < now.bodies; b++) now.specified[b] = PW_SPECIFIES_NOTHING;
  pw_system *s = scene_system (&random_table, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  memcpy (now.q, pw_run_initial (r)->q, sizeof (double) * 3 * (size_t)now.bodies);
  memcpy (now.v, pw_run_initial (r)->v, sizeof (double) * 3 * (size_t)now.bodies);
  runs_close (r, s);
}

/* Specifies each position and velocity with these probabilities, as changed by `change`; the others begin at 0. */
static void random_specify (double positions, double velocities, double (*change) (double)) {
  for (int j = 0; j < 6 * now.bodies; j++) {
    const int b = j % (3 * now.bodies) / 3, is_rate = j >= 3 * now.bodies, k = j % 3;
    double *to = is_rate ? now.rate + 3 * b + k : now.start + 3 * b + k;
    const double value = is_rate ? now.v[3 * b + k] : now.q[3 * b + k];
    const unsigned flag = (unsigned)PW_SPECIFIES_X << (3 * is_rate + k);
    if (j < 3 * now.bodies && k == 0) now.specified[b] = PW_SPECIFIES_NOTHING;
    *to = 0;
    if (random_between (0, 1) > (is_rate ? velocities : positions)) continue;
    now.specified[b] |= flag;
    *to = change ? change (value) : value;
  }
}

/* ---- Independence ---- */

/* The rank of J, unit vectors of the flagged coordinates, and that of coordinate `more` (or -1). */
static int rank_with (const pw_workspace *w, int rows, const unsigned char *kept, int more) {
  const pw_system *s = w->s;
  static double a[(3 * BODIES + 3 * JOINTS) * 3 * BODIES];
  const int n = s->coords;
  int m = rows, rank = 0;
  memset (a, 0, sizeof a);
  PW_EACH_CONSTRAINT (k, w)
    for (int i = 0; i < k->b.count * k->kind->rows && k->row < rows; i++)
      for (int c = 0; c < k->b.cols; c++)
        if (pw_global (k, i / k->kind->rows, c) < n)
          a[(k->row + i) * n + pw_global (k, i / k->kind->rows, c)] += k->J[i * k->b.cols + c];
  for (int j = 0; j < n; j++)
    if (kept[j] || j == more) a[m++ * n + j] = 1;
  for (; rank < m; rank++) {
    int p = rank, q = 0;
    for (int i = rank; i < m; i++)
      for (int j = 0; j < n; j++)
        if (fabs (a[i * n + j]) > fabs (a[p * n + q])) p = i, q = j;
    if (fabs (a[p * n + q]) < 1e-6) break;
    for (int j = 0; j < n; j++) {
      const double swapped = a[p * n + j];
      a[p * n + j] = a[rank * n + j], a[rank * n + j] = swapped;
    }
    for (int i = rank + 1; i < m; i++) {
      const double factor = a[i * n + q] / a[rank * n + q];
      for (int j = 0; j < n; j++) a[i * n + j] -= factor * a[rank * n + j];
      a[i * n + q] = 0;
    }
  }
  return rank;
}

typedef struct {
  int scenes, specified, kept, determined, unattainable, lost, refused;
} counts;

/* 1 if a run that specifies the positions kept and this one begins with all of them, on the same branch. */
static int attainable (const pw_run *r, const unsigned char *kept, int more) {
  const random_scene before = now;
  for (int b = 0; b < now.bodies; b++) now.specified[b] = PW_SPECIFIES_NOTHING;
  for (int j = 0; j < 3 * now.bodies; j++) {
    const int is_kept = kept[j] || j == more;
    if (is_kept) now.specified[j / 3] |= (unsigned)PW_SPECIFIES_X << j % 3;
    now.start[j] = is_kept ? r->q_given[j] : 0, now.rate[j] = 0;
  }
  pw_system *s = scene_system (&random_table, NULL);
  pw_run *again = pw_run_open (s, "rk4", NULL, NULL);
  int all = again && pw_run_initial (again)->changed == 0;
  for (int b = 0; again && b < now.bodies; b++) all &= fabs (again->q[3 * b + 2] - r->q[3 * b + 2]) < 0.5;
  pw_run_close (again);
  pw_system_free (s);
  now = before;
  return all;
}

/* Counts what became of the specified values of a level; those that are not kept must be determined by those that are,
 * or unattainable with them. */
static void count_level (const pw_run *r, int velocities, counts *count) {
  const pw_system *s = r->s;
  const double *is = velocities ? r->v : r->q, *was = velocities ? r->v_given : r->q_given;
  unsigned char kept[3 * BODIES] = { 0 }, specified[3 * BODIES];
  for (int j = 0; j < s->coords; j++) {
    specified[j] = (r->origin[velocities * s->coords + j] & PW_SPECIFIED) != 0;
    kept[j] =
        specified[j] && (is[j] == was[j] || (velocities && !pw_initial_moved (s, pw_run_initial (r), s->coords + j)));
    count->specified += specified[j], count->kept += kept[j];
  }
  pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  const int rows = velocities ? s->rows : s->holonomic, rank = rank_with (r->w, rows, kept, -1);
  for (int j = 0; j < s->coords; j++) {
    if (!specified[j] || kept[j]) continue;
    if (rank_with (r->w, rows, kept, j) == rank)
      count->determined++;
    else if (velocities || attainable (r, kept, j))
      count->lost++;
    else
      count->unattainable++;
  }
}

static void count_scene (counts *position, counts *velocity) {
  pw_system *s = scene_system (&random_table, NULL);
  pw_error error = { 0 };
  pw_run *r = pw_run_open (s, "rk4", NULL, &error);
  position->scenes++, velocity->scenes++;
  if (r == NULL) {
    position->refused++;
    print_message ("%s\n", error.text);
  } else {
    const pw_sample start = runs_to (r, 0);
    check_below ("position", start.position, 64 * CHECK_EPS, "64 eps of the row's terms: round-off");
    check_below ("velocity", start.velocity, 64 * CHECK_EPS, "64 eps of the row's terms: round-off");
    count_level (r, 0, position);
    count_level (r, 1, velocity);
  }
  pw_run_close (r);
  pw_system_free (s);
}

static void print_counts (const char *what, const counts *c) {
  print_message ("%s: %d scenes, %d values specified: %d kept, %d determined by these, %d unattainable with these, %d "
                 "lost; %d scenes refused\n",
                 what, c->scenes, c->specified, c->kept, c->determined, c->unattainable, c->lost, c->refused);
}

static double rounded (double x) {
  return round (1000 * x) / 1000;
}
static double sketched (double x) {
  return x + random_between (-0.1, 0.1);
}

/* Any part of a consistent state is kept, and so is a maximal part of one that was rounded or sketched. */
TEST (positions) {
  static double (*const change[]) (double) = { NULL, rounded, sketched };
  static const char *const name[] = { "exact", "rounded", "sketched" };
  for (int c = 0; c < 3; c++)
    for (int part = 1; part <= 4; part++) {
      counts position = { 0 }, velocity = { 0 };
      for (int i = 0; i < 120; i++) {
        random_make (i);
        random_specify (0.25 * part, 0.25 * part, change[c]);
        count_scene (&position, &velocity);
      }
      print_counts (check_text ("%s, %d %%, positions", name[c], 25 * part), &position);
      print_counts (check_text ("%s, %d %%, velocities", name[c], 25 * part), &velocity);
      assert_int_equal (position.lost + velocity.lost + position.refused, 0);
      if (change[c] == NULL) assert_int_equal (position.kept, position.specified);
      check_below ("unattainable", position.unattainable, 0.02 * position.specified,
                   "sketches off by 0.1 of bars of 0.4 to 2, beyond what these reach");
    }
}

/* Velocities that belong to consistent ones are kept at consistent positions; to round-off, since they satisfy the
 * constraints to round-off only. */
TEST (velocities) {
  for (int part = 1; part <= 4; part++) {
    counts position = { 0 }, velocity = { 0 };
    for (int i = 0; i < 300; i++) {
      random_make (i);
      random_specify (1, 0.25 * part, NULL);
      count_scene (&position, &velocity);
    }
    print_counts (check_text ("all positions, %d %% of the velocities", 25 * part), &velocity);
    assert_int_equal (position.kept, position.specified);
    assert_int_equal (velocity.kept, velocity.specified);
  }
}

/* ---- Four-bar linkages by one angle ---- */

/* A four-bar linkage whose crank has this angle, and nothing else is specified. */
static void four_bar (const double length[4], double angle) {
  now = (random_scene){ .bodies = 3 };
  for (int b = 0; b < 3; b++) {
    now.mass[b] = 1, now.specified[b] = b == 0 ? PW_SPECIFIES_PHI : PW_SPECIFIES_NOTHING;
    now.joint[now.joints++] = (random_joint){ .type = PIN,
                                              .body = { b - 1, b },
                                              .at = { { b ? length[b - 1] / 2 : 0, 0 }, { -length[b] / 2, 0 } } };
  }
  now.joint[now.joints++] =
      (random_joint){ .type = PIN, .body = { 2, -1 }, .at = { { length[2] / 2, 0 }, { length[3], 0 } } };
  now.start[2] = angle;
}

/* The least sum of squares of the angles of coupler and rocker with which the crank can have this angle. */
static double nearest_branch (const double length[4], double angle) {
  const double x = length[3] - length[0] * cos (angle), y = -length[0] * sin (angle), d = hypot (x, y);
  const double inner = acos ((length[1] * length[1] + d * d - length[2] * length[2]) / (2 * length[1] * d));
  double least = INFINITY;
  for (int sign = -1; sign <= 1; sign += 2) {
    const double coupler = atan2 (y, x) + sign * inner;
    const double rocker = atan2 (y - length[1] * sin (coupler), x - length[1] * cos (coupler));
    least = fmin (least, pow (remainder (coupler, 2 * PW_PI), 2) + rocker * rocker);
  }
  return least;
}

/* The angle of the crank is kept where it can be reached, by the law of cosines; elsewhere it is changed, or no linkage
 * closes. */
TEST (crank_angles) {
  int kept = 0, nearest = 0, changed = 0, refused = 0;
  random_state = 5;
  for (int i = 0; i < 300; i++) {
    double length[4];
    for (int k = 0; k < 4; k++) length[k] = random_between (0.5, 3);
    const double angle = random_between (-PW_PI, PW_PI);
    const double diagonal = hypot (length[3] - length[0] * cos (angle), length[0] * sin (angle));
    const double slack = fmin (length[1] + length[2] - diagonal, diagonal - fabs (length[1] - length[2]));
    if (fabs (slack) < 1e-3) continue; /* nearly a dead point */
    four_bar (length, angle);
    pw_error error = { 0 };
    pw_system *s = scene_system (&random_table, NULL);
    pw_run *r = pw_run_open (s, "rk4", NULL, &error);
    if (slack > 0) {
      assert_non_null (r);
      const double *q = pw_run_initial (r)->q;
      assert_true (q[2] == angle && pw_run_initial (r)->changed == 0);
      kept++, nearest += q[5] * q[5] + q[8] * q[8] < nearest_branch (length, angle) + 1e-9;
    } else if (r) {
      char reason[200];
      assert_true (pw_run_initial (r)->q[2] != angle && pw_run_initial (r)->changed == 1);
      assert_non_null (strstr (pw_run_initial_reason (r, 2, reason, sizeof reason), "pin j"));
      changed++;
    } else {
      double longest = 0, sum = 0;
      for (int k = 0; k < 4; k++) longest = fmax (longest, length[k]), sum += length[k];
      assert_true (error.status == PW_INITIAL && longest > sum - longest); /* no such linkage closes */
      refused++;
    }
    pw_run_close (r);
    pw_system_free (s);
  }
  print_message ("%d angles kept, %d on the nearest branch, %d changed, %d linkages refused\n", kept, nearest, changed,
                 refused);
  assert_true (kept > 150 && nearest >= kept);
}
