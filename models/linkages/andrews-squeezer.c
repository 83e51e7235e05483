/* Andrews' squeezer: seven bodies, three loops, a spring, and a motor of constant torque on the small crank.
 *
 * Bodies K1 .. K7 and their angles as in the test set: K1 the crank (beta), K2 the rod from F on the crank to E, where
 * three loops meet; K3 the triangle on B with the spring; K4, K5 from E to the ground at A; K6, K7 likewise.  The crank
 * makes 2.5 turns in 0.03 s.
 * (Lioen & de Swart; Mazzia & Magherini: Test Set for Initial Value Problem Solvers, Andrews' squeezing mechanism.) */
#include <math.h>
#include "pinwheel.h"

typedef struct {
  double mom, c0, l0;
} squeezer;

static const pw_parameter parameters[] = {
  { PW_AT (squeezer, mom), 0.033, "N m", "torque of the motor", PW_REAL },
  { PW_AT (squeezer, c0), 4530, "N/m", "stiffness of the spring", PW_NONNEGATIVE },
  { PW_AT (squeezer, l0), 0.07785, "m", "free length of the spring", PW_NONNEGATIVE },
  { .name = NULL },
};

/* Points and lengths [m], by the letters of the test set */
static const double xa = -.06934, ya = -.00227, xb = -.03635, yb = .03273, xc = .014, yc = .072;
static const double d = .028, da = .0115, e = .02, ea = .01421, rr = .007, ra = .00092, ss = .035, sa = .01874,
                    sb = .01043, sc = .018, sd = .02, ta = .02308, tb = .00916, u = .04, ua = .01228, ub = .00449,
                    zf = .02, zt = .04, fa = .01421;

/* A body at the angle phi whose point `at`, in its frame, is at (x, y). */
static void add_part (pw_model *m, const char *name, double mass, double inertia, double x, double y, double phi,
                      const double at[2]) {
  double c = cos (phi), s = sin (phi);
  pw_add_body (m, &(pw_body){ .name = name,
                              .mass = mass,
                              .inertia = inertia,
                              .start = { x - c * at[0] + s * at[1], y - s * at[0] - c * at[1], phi } });
}

static void pin (pw_model *m, const char *name, const char *one, double x1, double y1, const char *two, double x2,
                 double y2) {
  pw_add_pin (m, &(pw_pin){ .name = name, .body = { one, two }, .at = { { x1, y1 }, { x2, y2 } } });
}

/* At the initial angles of the test set; Theta = 0, so K2 is at beta, and Omega = -Phi, so K6 is at epsilon - Phi. */
static void bodies (pw_model *m) {
  const double beta = -0.0617138900142764496, gamma = 0.455279819163070380, Phi = 0.222668390165885885,
               delta = 0.487364979543842550, epsilon = 1.23054744454982119;
  double xf = rr * cos (beta), yf = rr * sin (beta), xe = xf - d * cos (beta), ye = yf - d * sin (beta);
  add_part (m, "K1", .04325, 2.194e-6, 0, 0, beta, (double[]){ -ra, 0 });
  add_part (m, "K2", .00365, 4.410e-7, xf, yf, beta, (double[]){ da, 0 });
  add_part (m, "K3", .02373, 5.255e-6, xb, yb, gamma, (double[]){ -sb, sa });
  add_part (m, "K4", .00706, 5.667e-7, xe, ye, Phi + delta, (double[]){ 0, -ea });
  add_part (m, "K5", .07050, 1.169e-5, xa, ya, delta, (double[]){ -ta, -tb });
  add_part (m, "K6", .00706, 5.667e-7, xe, ye, epsilon - Phi, (double[]){ fa, 0 });
  add_part (m, "K7", .05498, 1.912e-5, xa, ya, epsilon, (double[]){ ub, ua });
}

static void build (pw_model *m, const void *parameter) {
  const squeezer *p = parameter;
  bodies (m);
  pin (m, "O", "K1", -ra, 0, "ground", 0, 0);
  pin (m, "B", "K3", -sb, sa, "ground", xb, yb);
  pin (m, "A5", "K5", -ta, -tb, "ground", xa, ya);
  pin (m, "A7", "K7", ub, ua, "ground", xa, ya);
  pin (m, "F", "K1", rr - ra, 0, "K2", da, 0);
  pin (m, "E3", "K2", da - d, 0, "K3", -sb, sa - ss);
  pin (m, "E4", "K2", da - d, 0, "K4", 0, -ea);
  pin (m, "E6", "K2", da - d, 0, "K6", fa, 0);
  pin (m, "G", "K4", 0, e - ea, "K5", zt - ta, -tb);
  pin (m, "H", "K6", fa - zf, 0, "K7", ub, ua - u);
  pw_add_spring (m, &(pw_spring){ .name = "spring",
                                  .body = { "K3", "ground" },
                                  .at = { { sd - sb, sa - sc }, { xc, yc } },
                                  .stiffness = p->c0,
                                  .length = p->l0 });
  pw_add_torque (m, &(pw_torque){ .name = "motor", .body = { "K1", "ground" }, .value = { .constant = p->mom } });
}

PW_MODEL (.about = "Andrews' squeezer: seven bodies driven by a constant torque", .parameters = parameters,
          .parameters_size = sizeof (squeezer), .run = { .t_end = 0.03, .step = 1e-5, .method = "rk4+projection" },
          .build = build);
