/* Programs written by hand for one mechanism each, without a framework: what a general program is measured against.
 *
 * State and signs are Pinwheel's: q = (x, y, phi) of each body, M a + J^T lambda = f, rows in the order given. */
#ifndef BASELINE_H
#define BASELINE_H

/* ---- EzyRoller: frame and steering assembly, hinge B, wheels A and C, torque M0 cos (omega t) ---- */

typedef struct {
  double a, b, c, d;     /* wheel A, hinge B on the frame; wheel C, hinge B on the steering assembly [m] */
  double m1, I1, m2, I2; /* [kg], [kg m^2] */
  double M0, omega;      /* [N m], [rad/s] */
} ezy_model;

/* What does not change during a run. */
typedef struct {
  ezy_model p;
  double i1, k1, i2, k2; /* 1/m1, 1/I1, 1/m2, 1/I2; those of body 2 only if it has mass */
  double w1, u1, w2, u2; /* inverse metric of the position projection: lengths and angle of each body */
  double ih;             /* 1 / (c + d) */
  double SA, SC;         /* inverse pivots of the wheels */
  double A, C, n1, n2;   /* how the wheels couple to the hinge, and what the hinge has left of each angle */
  double trace;          /* of the hinge's 2 x 2 block */
} ezy;

/* A state with its accelerations and multipliers; rows Bx, By, A, C. */
typedef struct {
  double t, q[6], v[6], a[6], lambda[4];
} ezy_state;

void ezy_open (ezy *e, const ezy_model *model);

/* From rest, straight, at t = 0, with its accelerations. */
void ezy_start (const ezy *e, ezy_state *s);

/* Accelerations and multipliers: with mass in the steering assembly, and without. */
void ezy_massive (const ezy *e, double t, const double *q, const double *v, double *a, double *lambda);
void ezy_massless (const ezy *e, double t, const double *q, const double *v, double *a, double *lambda);

/* A step of the classical Runge-Kutta method, then positions and rates projected, then new accelerations. */
void ezy_massive_step (const ezy *e, double h, ezy_state *s);
void ezy_massless_step (const ezy *e, double h, ezy_state *s);

/* Makes a state consistent, positions first, with its accelerations; q and v are scratch afterwards. */
void ezy_project (const ezy *e, double t, double q[6], double v[6], ezy_state *s);

/* A step of any explicit Runge-Kutta method: stages by `rate`, then `project` as ezy_project does.  c and b have
 * `stages` entries, A the rows below its diagonal, one after the other. */
typedef struct {
  int stages;
  const double *c, *A, *b;
} ezy_tableau;
typedef struct {
  void (*rate) (void *context, double t, const double *q, const double *v, double *a, double *lambda);
  void (*project) (void *context, double t, double *q, double *v, ezy_state *s);
  void *context;
} ezy_dynamics;
void ezy_step (const ezy_tableau *b, const ezy_dynamics *d, double t1, ezy_state *s);

/* Minimal coordinates (A.x, A.y, phi1, phi2, speed u of A along the frame, phi1'): their rates, for any mass. */
void ezy_minimal (const ezy *e, double t, const double y[6], double rate[6]);

/* ---- Pendulum chain: uniform rods of length 1 m, mass 1 kg, pinned end to end, the first to the ground ---- */

typedef struct {
  int links;
  double mass, inertia, length, gravity;
  double *scratch; /* 8 per link */
} chain;

int chain_open (chain *c, int links); /* 0, or 1 if out of memory */
void chain_close (chain *c);

/* Accelerations 3 links, multipliers 2 links (force on the link before, as row r_before - r_after = 0). */
void chain_accelerate (chain *c, const double *q, const double *v, double *a, double *lambda);

/* ---- The EzyRoller by IDA: stabilised index 2, KLU, analytic sparse Jacobian ---- */

typedef struct ezy_ida ezy_ida;

/* From rest at t = 0; rtol = atol for all states.  NULL if SUNDIALS refuses. */
ezy_ida *ezy_ida_open (const ezy_model *model, double rtol, double t_end);
void ezy_ida_close (ezy_ida *d);

/* One step towards t_end.  Returns 1 when t_end is reached, 0 before, < 0 on failure. */
int ezy_ida_step (ezy_ida *d);

/* Steps and residuals so far, and the positions. */
void ezy_ida_look (const ezy_ida *d, long *steps, long *residuals, double q[6]);

/* ---- The EzyRoller, massive, by CVODES: Adams, or BDF with projection ---- */

typedef struct ezy_cvode ezy_cvode;

/* From rest at t = 0; rtol = atol for all states.  NULL if SUNDIALS refuses. */
ezy_cvode *ezy_cvode_open (const ezy_model *model, int adams, double rtol, double t_end);
void ezy_cvode_close (ezy_cvode *d);

/* One step towards t_end.  Returns 1 when t_end is reached, 0 before, < 0 on failure. */
int ezy_cvode_step (ezy_cvode *d);

/* Steps and evaluations so far, and the positions. */
void ezy_cvode_look (const ezy_cvode *d, long *steps, long *evaluations, double q[6]);

#endif
