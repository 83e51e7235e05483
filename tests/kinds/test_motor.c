/* rotational-spring, force, motor: oscillators, rotating thrust, saturating torques. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

#define MOTOR_CONSTANT(x) \
  { PW_CONSTANT, .constant = x }

/* ---- Two bodies on a rotational spring, or on a motor that acts like one ----
 *
 *   d = phi1 - phi2 - beta:  I d'' + c d' + k d = 0,  1/I = 1/I1 + 1/I2;  I1 w1 + I2 w2 is constant */

static const struct { double I[2], k, c, beta, d, w; } motor_o = { { 0.4, 1.1 }, 5, 0.3, 0.5, 0.8, 1.5 };

typedef struct {
  double driven, limit;
} motor_parameters;

static const pw_parameter motor_list[] = {
  { PW_AT (motor_parameters, driven), 0, "", "1: a motor instead of a spring", PW_NONNEGATIVE },
  { PW_AT (motor_parameters, limit), 0, "N m", "of the motor", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (motor_oscillator, motor_list, motor_parameters) {
  int driven = p->driven > 0;
  pw_add_body (m, &(pw_body){ .name = "a",
                              .mass = 1,
                              .inertia = motor_o.I[0],
                              .start = { 0, 0, motor_o.beta + motor_o.d },
                              .rate = { 0, 0, motor_o.w } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = motor_o.I[1] });
  if (driven)
    pw_add_motor (m, &(pw_motor){ .name = "M",
                                  .body = { "a", "b" },
                                  .stiffness = motor_o.k,
                                  .damping = motor_o.c,
                                  .angle = MOTOR_CONSTANT (motor_o.beta) });
  else
    pw_add_rotational_spring (
        m,
        &(pw_rotational_spring){
            .name = "M", .body = { "a", "b" }, .stiffness = motor_o.k, .damping = motor_o.c, .angle = motor_o.beta });
}

static void motor_swing (const char *method, double driven, double bound, const char *reason) {
  pw_system *s = scene_system (&motor_oscillator_table, "driven", driven, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  double I = motor_o.I[0] * motor_o.I[1] / (motor_o.I[0] + motor_o.I[1]), b = motor_o.c / (2 * I),
         w = sqrt (motor_o.k / I - b * b), p = (motor_o.w + b * motor_o.d) / w;
  for (int i = 1; i <= 5; i++) {
    double t = 0.4 * i, decay = exp (-b * t), d = decay * (motor_o.d * cos (w * t) + p * sin (w * t)),
           rate = -b * d + w * decay * (p * cos (w * t) - motor_o.d * sin (w * t)),
           turned = motor_o.I[0] * motor_o.w * motor_o.w / 2 - I * (motor_o.w * motor_o.w - rate * rate) / 2;
    pw_sample x = runs_to (r, t);
    check_close ("angle", x.q[2] - x.q[5] - motor_o.beta, d, bound, reason);
    check_close ("rate", x.v[2] - x.v[5], rate, 10 * bound, reason);
    check_close ("momentum", motor_o.I[0] * x.v[2] + motor_o.I[1] * x.v[5], motor_o.I[0] * motor_o.w, bound,
                 "the torques balance");
    check_close ("kinetic", x.kinetic, turned, 10 * bound, reason);
    double lost = motor_o.k * (motor_o.d * motor_o.d - d * d) / 2 + I * (motor_o.w * motor_o.w - rate * rate) / 2;
    if (driven > 0) /* a motor does work; it has neither energy nor loss */
      check_close ("work", x.work, -I * (motor_o.w * motor_o.w - rate * rate) / 2, 10 * bound, reason);
    else
      check_close ("loss", x.loss, lost, 10 * bound, reason);
    check_close ("balance", x.balance, 0, 10 * bound, reason);
  }
  runs_close (r, s);
}

TEST (oscillator) {
  for (int driven = 0; driven < 2; driven++) {
    motor_swing ("rk4", driven, 1e-9, "(h w)^4 at h = 1e-3 and w = 4/s");
    motor_swing ("ida", driven, 1e-6, "1e4 rtol");
  }
}

/* ---- A motor that follows a rate, with a limit ----
 *
 *   I w' = L tanh (c (u - w) / L):  sinh (c (u - w) / L) decays as exp (-c t / I);  the work is I w^2 / 2 */

SCENE_WITH (motor_start, motor_list, motor_parameters) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 0.4 });
  pw_add_motor (
      m, &(pw_motor){
             .name = "M", .body = { "rotor", "ground" }, .damping = 2, .limit = p->limit, .rate = MOTOR_CONSTANT (3) });
}

static void motor_run_up (const char *method, double limit, double bound, const char *reason) {
  pw_system *s = scene_system (&motor_start_table, "limit", limit, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 1, .ledger = 1 });
  for (int i = 1; i <= 5; i++) {
    double t = 0.2 * i, decay = exp (-2 * t / 0.4), scale = limit / 2, w = 3 * (1 - decay);
    if (limit > 0) w = 3 - scale * asinh (sinh (3 / scale) * decay);
    pw_sample x = runs_to (r, t);
    check_close ("rate", x.v[2], w, bound, reason);
    check_close ("work", x.work, 0.4 * w * w / 2, bound, reason);
    check_close ("balance", x.balance, 0, bound, reason);
    if (limit > 0) assert_true (x.v[2] < limit * t / 0.4);
  }
  runs_close (r, s);
}

TEST (limit) {
  motor_run_up ("rk4", 0, 1e-9, "(h k)^4 at h = 1e-3 and k = 5/s");
  motor_run_up ("rk4", 1.5, 1e-9, "(h k)^4 at h = 1e-3 and k = 5/s");
  motor_run_up ("ida", 1.5, 1e-6, "1e4 rtol");
}

/* ---- Thrust along the axes of a body that turns at the constant rate w, and along those of the world ----
 *
 *   body    m v' = F (cos w t, sin w t):  the thrust passes through the centre of mass
 *   world   m v' = F, and its work is F times the displacement of its point */

static const struct { double m, I, w, F; } motor_f = { 1.2, 0.3, 1.7, 0.9 };

SCENE (motor_thrust) {
  pw_add_body (m, &(pw_body){ .name = "ship", .mass = motor_f.m, .inertia = motor_f.I, .rate = { 0, 0, motor_f.w } });
  pw_add_force (
      m, &(pw_force){
             .name = "F", .body = "ship", .at = { -0.5, 0 }, .axes = PW_AXES_BODY, .fx = MOTOR_CONSTANT (motor_f.F) });
}

SCENE (motor_push) {
  pw_add_body (m, &(pw_body){ .name = "ship", .mass = motor_f.m, .inertia = motor_f.I, .rate = { 0, 0, motor_f.w } });
  pw_add_force (m, &(pw_force){ .name = "F",
                                .body = "ship",
                                .at = { -0.5, 0.2 },
                                .fx = MOTOR_CONSTANT (motor_f.F),
                                .fy = MOTOR_CONSTANT (-0.4) });
}

static void motor_fly (const char *method, double bound, const char *reason) {
  const double t = 2, w = motor_f.w, a = motor_f.F / motor_f.m;
  const pw_settings settings = { .step = 1e-3, .rtol = 1e-10, .span = t, .ledger = 1 };
  pw_system *s = scene_system (&motor_thrust_table, NULL);
  pw_run *r = runs_open (s, method, &settings);
  pw_sample x = runs_to (r, t);
  check_close ("vx", x.v[0], a * sin (w * t) / w, bound, reason);
  check_close ("vy", x.v[1], a * (1 - cos (w * t)) / w, bound, reason);
  check_close ("omega", x.v[2], w, bound, reason);
  check_close ("x", x.q[0], a * (1 - cos (w * t)) / (w * w), bound, reason);
  check_close ("y", x.q[1], a * (t - sin (w * t) / w) / w, bound, reason);
  check_close ("work", x.work, motor_f.m * a * a * (1 - cos (w * t)) / (w * w), bound, reason);
  runs_close (r, s);
  s = scene_system (&motor_push_table, NULL);
  r = runs_open (s, method, &settings);
  x = runs_to (r, t);
  double c = cos (x.q[2]), sn = sin (x.q[2]), X = x.q[0] - 0.5 * c - 0.2 * sn + 0.5,
         Y = x.q[1] - 0.5 * sn + 0.2 * c - 0.2;
  check_close ("x", x.q[0], a * t * t / 2, bound, reason);
  check_close ("vy", x.v[1], -0.4 / motor_f.m * t, bound, reason);
  check_close ("work", x.work, motor_f.F * X - 0.4 * Y, bound, reason);
  check_close ("balance", x.balance, 0, bound, reason);
  assert_true (fabs (x.v[2] - w) > 0.1);
  runs_close (r, s);
}

TEST (force) {
  motor_fly ("rk4", 1e-10, "(h w)^4 at h = 1e-3 and w = 2/s");
  motor_fly ("ida", 1e-6, "1e4 rtol");
}

/* ---- By all methods: an arm of two links with a motor, a spring and forces; signals that read states ---- */

SCENE (motor_arm) {
  pw_add_body (m, &(pw_body){ .name = "upper", .mass = 1, .inertia = 0.08, .start = { 0.5 } });
  pw_add_body (m, &(pw_body){ .name = "lower", .mass = 0.6, .inertia = 0.04, .start = { 1.4 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "upper", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "lower", "upper" }, .at = { { -0.4, 0 }, { 0.5, 0 } } });
  pw_add_motor (
      m, &(pw_motor){ .name = "shoulder",
                      .body = { "upper", "ground" },
                      .stiffness = 20,
                      .damping = 2,
                      .limit = 4,
                      .angle = { PW_HARMONIC, .harmonic = { .amplitude = 0.6, .omega = 2 } },
                      .rate = { PW_HARMONIC, .harmonic = { .amplitude = 1.2, .omega = 2, .phase = PW_PI / 2 } } });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){
             .name = "elbow", .body = { "lower", "upper" }, .stiffness = 3, .damping = 0.1, .angle = 0.5 });
  pw_add_force (m, &(pw_force){ .name = "jet",
                                .body = "lower",
                                .at = { 0.4, 0.05 },
                                .axes = PW_AXES_BODY,
                                .fx = MOTOR_CONSTANT (0.2),
                                .fy = { PW_HARMONIC, .harmonic = { .amplitude = 0.5, .omega = 3 } } });
  pw_add_force (m, &(pw_force){ .name = "wind", .body = "lower", .at = { 0.1, 0.1 }, .fx = MOTOR_CONSTANT (0.3) });
}

/* *context times the state that it reads. */
static int motor_follow (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)t;
  value[0] = *(const double *)context * x[0];
  if (gradient) gradient[0] = *(const double *)context;
  return 0;
}

/* A motor whose targets are twice the angle and the rate of another body, and a force that depends on that rate. */
SCENE (motor_leader) {
  static const char *const angle[] = { "leader.phi", NULL }, *const rate[] = { "leader.omega", NULL };
  static double twice = 2, brake = -0.3;
  pw_add_body (m, &(pw_body){ .name = "leader", .mass = 1, .inertia = 0.5, .rate = { 0, 0, 1 } });
  pw_add_body (m, &(pw_body){ .name = "follower", .mass = 1, .inertia = 0.1, .start = { 1 }, .rate = { 0.5 } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "leader", "ground" } });
  pw_add_motor (
      m,
      &(pw_motor){ .name = "M",
                   .body = { "follower", "ground" },
                   .stiffness = 8,
                   .damping = 1,
                   .limit = 3,
                   .angle = { PW_FUNCTION, .function = { .eval = motor_follow, .context = &twice, .reads = angle } },
                   .rate = { PW_FUNCTION, .function = { .eval = motor_follow, .context = &twice, .reads = rate } } });
  pw_add_force (
      m, &(pw_force){ .name = "F",
                      .body = "follower",
                      .at = { 0.1, 0.2 },
                      .axes = PW_AXES_BODY,
                      .fy = { PW_FUNCTION, .function = { .eval = motor_follow, .context = &brake, .reads = rate } } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "k", .body = { "leader", "ground" }, .stiffness = 2 });
}

TEST (methods) {
  trial (&motor_arm_table, 1.5);
  trial (&motor_leader_table, 1.5);
}
