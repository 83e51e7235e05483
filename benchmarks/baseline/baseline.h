/* Programs written by hand for one mechanism each, for comparison with Pinwheel in benchmarks/engine.c and peers.c.
 *
 * State and signs are those of Pinwheel: q = (x, y, phi) of each body, M a + J^T lambda = f, J a = gamma. */
#ifndef BASELINE_H
#define BASELINE_H

/* ---- EzyRoller: frame and steering assembly, hinge B, wheels A and C, torque M0 cos (omega t) ---- */

typedef struct {
  double a, b, c, d;     /* distances of wheel A and hinge B on the frame, of wheel C and hinge B on the steering [m] */
  double m1, I1, m2, I2; /* frame, steering assembly (0, 0: massless) [kg], [kg m^2] */
  double M0, omega;      /* torque of the rider [N m], [rad/s] */
} ezy_model;

/* The constants of a run.  S = J M^-1 J^T; the wheels are eliminated from it first, which leaves a 2 x 2 block of
 * the hinge that ezyroller.c defines. */
typedef struct {
  ezy_model p;
  double i1, k1, i2, k2;     /* 1/m1, 1/I1, 1/m2, 1/I2; those of body 2 only if it has mass */
  double move1, turn1;       /* inverse metric of the position projection: displacement, rotation of body 1 */
  double move2, turn2;       /* of body 2 */
  double ih;                 /* 1 / (c + d) */
  double pivot_A, pivot_C;   /* 1 / S_AA, 1 / S_CC */
  double couple_A, couple_C; /* factors of the hinge's rows in the columns A and C of S */
  double remain1, remain2;   /* k1', k2' of the hinge's block */
  double trace;              /* of that block */
} ezy;

/* A state with its accelerations and multipliers; rows of constraints: Bx, By, A, C. */
typedef struct {
  double t, q[6], v[6], a[6], lambda[4];
} ezy_state;

void ezy_open (ezy *e, const ezy_model *model);

/* From rest, straight, at t = 0, with its accelerations. */
void ezy_start (const ezy *e, ezy_state *s);

/* Accelerations and multipliers: with mass in the steering assembly, and without. */
void ezy_massive (const ezy *e, double t, const double *q, const double *v, double *a, double *lambda);
void ezy_massless (const ezy *e, double t, const double *q, const double *v, double *a, double *lambda);

/* A step of the classical Runge-Kutta method, a projection of positions and velocities, new accelerations. */
void ezy_massive_step (const ezy *e, double h, ezy_state *s);
void ezy_massless_step (const ezy *e, double h, ezy_state *s);

/* Projects positions, then velocities, and computes the accelerations; overwrites q and v. */
void ezy_project (const ezy *e, double t, double q[6], double v[6], ezy_state *s);

/* A step to t1 by an explicit Runge-Kutta method, with a projection, of the massive EzyRoller.  c and b have `stages`
 * entries; A has its rows below the diagonal, one after the other. */
typedef struct {
  int stages;
  const double *c, *A, *b;
} ezy_tableau;
void ezy_step (const ezy *e, const ezy_tableau *tableau, double t1, ezy_state *s);

/* Minimal coordinates (A.x, A.y, phi1, phi2, speed u of A along the frame, phi1'): their rates, for any mass. */
void ezy_minimal (const ezy *e, double t, const double y[6], double rate[6]);

/* ---- Pendulum chain: uniform rods of length 1 m, mass 1 kg, pinned end to end, the first to the ground ---- */

typedef struct {
  int links;
  double mass, inertia, length, gravity; /* [kg], [kg m^2], [m], [m/s^2] */
  struct chain_pin *pin;                 /* work space */
} chain;

int chain_open (chain *c, int links); /* 0, or 1 if out of memory */
void chain_close (chain *c);

/* Accelerations (3 per link) and multipliers (2 per link, of the rows r_before - r_after = 0). */
void chain_accelerate (chain *c, const double *q, const double *v, double *a, double *lambda);

/* ---- The EzyRoller by IDA: stabilised index 2, KLU, analytic sparse Jacobian ---- */

typedef struct ezy_ida ezy_ida;

/* From rest at t = 0; rtol = atol for all states.  NULL if SUNDIALS refuses. */
ezy_ida *ezy_ida_open (const ezy_model *model, double rtol, double t_end);
void ezy_ida_close (ezy_ida *d);

/* One step towards t_end.  Returns 1 when t_end is reached, 0 before, < 0 on failure. */
int ezy_ida_step (ezy_ida *d);

/* Steps and residuals so far, and the positions. */
void ezy_ida_result (const ezy_ida *d, long *steps, long *residuals, double q[6]);

/* ---- The EzyRoller, massive, by CVODES: Adams, or BDF with projection ---- */

typedef struct ezy_cvode ezy_cvode;

/* From rest at t = 0; rtol = atol for all states.  NULL if SUNDIALS refuses. */
ezy_cvode *ezy_cvode_open (const ezy_model *model, int adams, double rtol, double t_end);
void ezy_cvode_close (ezy_cvode *d);

/* One step towards t_end.  Returns 1 when t_end is reached, 0 before, < 0 on failure. */
int ezy_cvode_step (ezy_cvode *d);

/* Steps and evaluations so far, and the positions. */
void ezy_cvode_result (const ezy_cvode *d, long *steps, long *evaluations, double q[6]);

#endif
