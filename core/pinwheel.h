/* Pinwheel: planar multibody systems with pin joints and knife-edge wheels.
 *
 * This header is all that a model file includes.  It declares
 *   - the description: bodies, elements, signals and parameters a model is made of,
 *   - the element kinds that come with Pinwheel, and what a kind of your own has to provide,
 *   - the compiled system that the solvers integrate.
 *
 * Units are SI, angles are radians, counter-clockwise.  The state is q = (x, y, phi) of each body's centre of
 * mass, then the coordinates that elements own, and v = dq/dt.  The equations are
 *
 *     M a + J^T lambda = f(t, q, v),     g(q, t) = 0,     J v = eta(t, q),     J = [ G = dg/dq ; S(q, t) ]
 *
 * with the holonomic rows G first and the nonholonomic rows S after them; differentiated once more, J a = gamma. */
#ifndef PINWHEEL_H
#define PINWHEEL_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifdef __GNUC__
#pragma GCC visibility push(default)
#endif

#define PW_VERSION "0.1.0"
#define PW_ABI 1 /* raised, once 0.1.0 is out, when a plug-in compiled against an older header could be misread */
#define PW_PI 3.14159265358979323846

#ifdef __GNUC__
#define PW_EXPORT __attribute__ ((visibility ("default")))
#else
#define PW_EXPORT
#endif

/* ---- Status and errors ---- */

/* What a function returns: 0 good, > 0 not done but may be tried again, < 0 stop.  The negative of a
 * negative status is the exit status of the program. */
typedef enum {
  PW_OK = 0,        /* good */
  PW_RETRY = 1,     /* not usable, a smaller step may be */
  PW_STOPPED = 2,   /* a run was asked to stop by pw_settings.stop: it is where it was, and can go on */
  PW_RESOURCE = -1, /* out of memory, a file cannot be written */
  PW_INPUT = -2,    /* the description or an option is wrong */
  PW_INITIAL = -3,  /* the start cannot be made consistent */
  PW_METHOD = -4    /* the method failed on the way */
} pw_status;

/* A caller-owned error, all zero at first: the first failure is kept, later ones do not overwrite it.  NULL in the place of
 * a file, model, system or run is one: what a call could not give may be passed on to the next. */
typedef struct {
  int status;     /* a pw_status; 0: no error so far */
  char text[500]; /* one line without a full stop: what was found, what was expected, the nearest valid name; for a text
                     model "FILE:LINE:COLUMN: error: " before it, and the line with a caret below as two further lines */
} pw_error;

/* Records a failure and returns its status.  A NULL error is allowed; an error already set stays. */
int pw_fail (pw_error *error, int status, const char *format, ...)
#ifdef __GNUC__
    __attribute__ ((format (printf, 3, 4)))
#endif
    ;

/* ---- Signals: what a torque, drive or heading does over time ---- */

typedef enum { PW_CONSTANT, PW_HARMONIC, PW_FUNCTION, PW_RAMP, PW_SMOOTH_STEP, PW_PULSE, PW_TABLE } pw_signal_type;

/* How a table goes from point to point, and how a cubic one begins and ends. */
enum { PW_LINEAR, PW_CUBIC };
enum { PW_ENDS_FREE, PW_ENDS_REST };

/* A function signal as a text model has it. */
typedef struct {
  const char *part[3]; /* expressions of value, rate, acceleration; NULL: not given */
  const char *jump;    /* a part that jumps when states change, where no step ends; or NULL */
} pw_signal_text;

/* A signal computed by the caller.  `eval` stores the value and, if the signal serves a constraint, its first and
 * second time derivative in value[0..2]; x holds the states named in `reads`, in that order, and gradient (NULL
 * when not wanted) takes the derivative of value[0] by each of them.  A non-zero return stops the run.  For the same t
 * and x it must give the same values, but for changes between steps that pw_run_restart follows (a torque that a controller
 * of yours sets anew). */
typedef struct {
  int (*eval) (void *context, double t, const double *x, double value[3], double *gradient);
  void *context; /* passed to eval and breakpoint as it is; must outlive the systems, or what open makes of it does */
  const char *const *reads; /* NULL-terminated "BODY.phi", "BODY.vx", ...; forces only; may be NULL */
  double (*breakpoint) (void *context, double t); /* first discontinuity after t, or INFINITY; may be NULL */
  void *(*open) (
      void *context); /* each compiled system, and each workspace and run from the system's, gets a context of its
                                     own, made from this one, or NULL without memory; threads may call it at the same time.
                                     May be NULL: all share `context`, and eval must be safe in all threads that run them */
  void (*close) (void *context); /* frees what open made, with the system or workspace; may be NULL */
  const pw_signal_text *text;    /* NULL: it is not of a text model */
} pw_function;

/* offset + amplitude cos (omega t + phase) */
typedef struct {
  double amplitude; /* unit of the signal */
  double omega;     /* angular frequency [rad/s] */
  double phase;     /* [rad] */
  double offset;    /* unit of the signal */
} pw_harmonic;

/* From one value to another. */
typedef struct {
  double from, to; /* before and behind; unit of the signal */
  double start;    /* [s] */
  double duration; /* [s], > 0 */
} pw_ramp;

/* offset + height from start to start + width, and each period again. */
typedef struct {
  double height; /* while it lasts; unit of the signal */
  double start;  /* [s] */
  double width;  /* how long it lasts [s]; 0: for ever */
  double period; /* from one pulse to the next [s], > width; 0: there is one */
  double offset; /* at all times, below the height; unit of the signal */
} pw_pulse;

/* Through points. */
typedef struct {
  const double *t;     /* times of its points, increasing [s]; pw_add and pw_model_set_signal copy the points */
  const double *value; /* at these times; the first and the last are held outside */
  int count;           /* of points: at least 2, of a cubic table with free ends 4 */
  int interpolation;   /* PW_LINEAR, PW_CUBIC: a spline with continuous rate and acceleration */
  int ends;            /* PW_ENDS_FREE: of a spline as its points ask for (not a knot); PW_ENDS_REST: at rate 0 */
  double scale;        /* the signal is offset + scale value; 0: 1 */
  double offset;       /* unit of the signal */
} pw_points;

/* A signal; all zero is the constant 0. */
typedef struct {
  pw_signal_type type; /* which member of the union holds */
  union {
    double constant;      /* PW_CONSTANT: the value */
    pw_harmonic harmonic; /* PW_HARMONIC */
    pw_function function; /* PW_FUNCTION */
    pw_ramp ramp;         /* PW_RAMP: along a straight line; PW_SMOOTH_STEP: with continuous rate and acceleration */
    pw_pulse pulse;       /* PW_PULSE */
    pw_points table;      /* PW_TABLE */
  };
} pw_signal;

/* A signal made of numbers: serves checks, text models, `show` and `list signals`. */
typedef struct {
  const char *name; /* "ramp", as written in a model file */
  pw_signal_type type;
  const char *about;
  const struct pw_field *fields; /* numbers and choices, their offsets those in pw_signal; ended by a NULL name */
} pw_signal_form;

/* All forms, ended by a NULL name; constants and functions have none. */
extern const pw_signal_form pw_signal_forms[];
const pw_signal_form *pw_signal_form_of (const pw_signal *s); /* or NULL */

/* ---- The description ---- */

typedef struct pw_model pw_model;

/* A rigid body.  Its frame sits at its centre of mass.  Massless bodies are allowed. */
typedef struct {
  const char *name;   /* unique among bodies and elements; "ground" is reserved */
  double mass;        /* [kg], >= 0 */
  double inertia;     /* about the centre of mass [kg m^2], >= 0 */
  double start[3];    /* x, y [m], phi [rad] at the start */
  double rate[3];     /* vx, vy [m/s], omega [rad/s] at the start */
  unsigned specified; /* bits of PW_SPECIFIES_X, ...: these initial values, and no others; 0: those that are not 0 */
} pw_body;

/* Which initial values a body specifies; others give way where the constraints ask for it.  NOTHING: none of them. */
enum {
  PW_SPECIFIES_X = 1,
  PW_SPECIFIES_Y = 2,
  PW_SPECIFIES_PHI = 4,
  PW_SPECIFIES_VX = 8,
  PW_SPECIFIES_VY = 16,
  PW_SPECIFIES_OMEGA = 32,
  PW_SPECIFIES_NOTHING = 64
};

/* The domain of a number. */
typedef enum {
  PW_REAL,        /* any finite number */
  PW_NONNEGATIVE, /* >= 0 */
  PW_POSITIVE,    /* > 0 */
  PW_COUNT,       /* a whole number >= 1 */
  PW_FRACTION     /* from 0 to 1 */
} pw_domain;

/* A named parameter of a model; it lives as a double at `offset` in the model's own parameter structure. */
typedef struct {
  const char *name;  /* as written after --set */
  size_t offset;     /* byte offset in the structure handed to build; PW_AT gives name and offset */
  double value;      /* default */
  const char *unit;  /* "m", "kg m^2", ... or "" */
  const char *about; /* what it means, in a few words */
  pw_domain domain;  /* which values make sense */
} pw_parameter;

#define PW_AT(type, member) .name = #member, .offset = offsetof (type, member)

/* How a model wants to be run when the user does not say; zeros leave Pinwheel's own choice. */
typedef struct {
  double t_end;       /* [s] */
  double step;        /* [s], fixed-step methods */
  double rtol;        /* relative tolerance, adaptive methods */
  const char *method; /* "rk4+projection", ... */
} pw_run_defaults;

typedef struct pw_kind pw_kind;

/* What a plug-in exports, under the name `pw_plugin`.  The parameters handed to its functions live as long as the model. */
typedef struct {
  unsigned abi;                                        /* PW_ABI */
  size_t size;                                         /* sizeof (pw_plugin_table) */
  const char *about;                                   /* one line: what the model is */
  const pw_parameter *parameters;                      /* ended by a NULL name; may be NULL */
  size_t parameters_size;                              /* bytes of the structure the parameters live in */
  pw_run_defaults run;                                 /* how to run it by default */
  void (*build) (pw_model *m, const void *parameters); /* declares bodies and elements */

  /* The motion from the described start, where it is known; may be NULL.  Stores what is known at time t of the
   * coordinates, three for each body in the order they were added, then those that elements own, and of their rates; all
   * of them are NaN, not known, before. */
  void (*reference) (const void *parameters, double t, double *q, double *v);
} pw_plugin_table;

/* Ends a model file:  PW_MODEL (.about = "...", .parameters = ..., .build = build) */
#define PW_MODEL(...)                               \
  extern PW_EXPORT const pw_plugin_table pw_plugin; \
  const pw_plugin_table pw_plugin = { .abi = PW_ABI, .size = sizeof (pw_plugin_table), __VA_ARGS__ }

/* Adds a body.  The model keeps a copy, the name included.  Returns PW_OK or the first error of the model, which
 * pw_model_build reports: a build function need not look at it. */
int pw_add_body (pw_model *m, const pw_body *body);

/* Adds an element of any kind; `definition` is the kind's definition structure, of which a copy is kept, names and
 * all.  Returns as pw_add_body. */
int pw_add (pw_model *m, const pw_kind *kind, const void *definition);

/* Lets a build function refuse what it was given ("links: at most 1000").  Returns the status. */
int pw_model_refuse (pw_model *m, const char *format, ...);

/* Jacobi's amplitude am (u | m) and the complete elliptic integral K (m), m = k^2 <= 1 (NaN above): sn = sin (am).  A
 * pendulum let go at an angle A from its lowest point is at 2 asin (k sn (K - w t)), k = sin (A / 2). */
double pw_jacobi_am (double u, double m);
double pw_elliptic_K (double m);

/* Sine and cosine of an angle [rad] to 1 ulp, with the same bits on every machine for |x| < 1e6; beyond, those of the C library. */
void pw_sin_cos (double x, double *sine, double *cosine);
double pw_sin (double x);
double pw_cos (double x);

/* ---- The element kinds: constraints on positions, on velocities, forces, and what has no effect ---- */

/* Pin: a point of body 1 and a point of body 2 coincide.  Two holonomic rows. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];     /* the point in each body's frame [m]; on the ground: in the world */
} pw_pin;

/* Weld: body 2 is fixed to body 1.  Three holonomic rows. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];     /* the common point in each body's frame [m]; on the ground: in the world */
  double angle;        /* of body 2 relative to body 1: phi2 - phi1 [rad] */
} pw_weld;

/* Slider: a point of body 1 stays on a line of body 2, and body 1 does not turn against body 2.  Two holonomic rows. */
typedef struct {
  const char *name;
  const char *body[2]; /* what slides, and what it slides on; "ground" for one of them */
  double at[2][2];     /* the point, and a point of the line, in each body's frame [m]; on the ground: in the world */
  double heading;      /* direction of the line in body 2's frame [rad] */
  double angle;        /* of body 1 relative to body 2: phi1 - phi2 [rad] */
} pw_slider;

/* Slot: a point of body 1 stays on a line of body 2.  One holonomic row. */
typedef struct {
  const char *name;
  const char *body[2]; /* the one with the point, and the one with the line; "ground" for one of them */
  double at[2][2];     /* the point, and a point of the line, in each body's frame [m]; on the ground: in the world */
  double heading;      /* direction of the line in body 2's frame [rad] */
} pw_slot;

/* Rod: a massless bar keeps a point of body 1 and a point of body 2 at a distance.  One holonomic row. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];     /* the ends in each body's frame [m]; on the ground: in the world */
  double length;       /* [m], > 0 */
} pw_rod;

/* Where a gear takes its offset from. */
enum { PW_GEAR_START, PW_GEAR_OFFSET };

/* Gear: the angles of two bodies, seen from a third, the carrier, keep a ratio: phi1 - phi3 = ratio (phi2 - phi3) +
 * offset.  One holonomic row. */
typedef struct {
  const char *name;
  const char *body[3]; /* the two gears and their carrier; "ground" for one of them */
  double ratio;        /* of their speeds on the carrier; negative: they turn against each other; not 0 */
  int from;            /* PW_GEAR_START: the offset is that of the start as described; PW_GEAR_OFFSET: as given */
  double offset;       /* [rad] */
} pw_gear;

/* What a drive prescribes. */
enum { PW_DRIVE_X, PW_DRIVE_Y, PW_DRIVE_ANGLE };

/* Drive: where a point of body 1 is, seen from body 2, or how it is turned, follows a signal.  One holonomic row. */
typedef struct {
  const char *name;
  const char *body[2]; /* the driven body, and the one it is seen from; "ground" for one of them */
  double at[2][2];     /* a point in each body's frame [m]; on the ground: in the world; without meaning for an angle */
  int what;        /* PW_DRIVE_X, PW_DRIVE_Y: from point 2 to point 1 in body 2's frame; PW_DRIVE_ANGLE: phi1 - phi2 */
  pw_signal value; /* with its first and second time derivative [m] or [rad] */
} pw_drive;

/* Wheel: a knife edge; the point does not move across the heading.  One nonholonomic row. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];   /* contact point in the body's frame [m] */
  double heading; /* rolling direction in the body's frame [rad] */
} pw_wheel;

/* Rolling wheel: the contact point moves neither across the heading nor along it other than by rolling.  Two
 * nonholonomic rows and a coordinate of its own, the spin angle, whose rate is positive rolling along the heading. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];     /* contact point in the body's frame [m] */
  double heading;   /* rolling direction in the body's frame [rad] */
  double radius;    /* [m], > 0 */
  double inertia;   /* about its axle [kg m^2], >= 0; its mass belongs to the body */
  double start;     /* spin angle at the start [rad] */
  double rate;      /* its rate at the start [rad/s]; 0: as the body's start makes it roll */
  pw_signal torque; /* on the wheel about its axle [N m]; what it reacts on is out of the plane */
} pw_rolling_wheel;

/* Steered wheel: a wheel whose heading in the body follows a signal.  One nonholonomic row. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];      /* contact point in the body's frame [m] */
  pw_signal heading; /* rolling direction in the body's frame, with its first time derivative [rad] */
} pw_steered_wheel;

/* Speed: the speed of a point along a direction fixed in its body follows a signal.  One nonholonomic row. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];    /* the point in the body's frame [m] */
  double heading;  /* the direction in the body's frame [rad] */
  pw_signal value; /* with its first time derivative [m/s] */
} pw_speed;

/* Pfaffian: any linear relation between the velocities of two bodies, both along the axes of body 1:
 * a . (vx1, vy1, omega1) + b . (vx2, vy2, omega2) = value.  One nonholonomic row. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double a[3];         /* of body 1's velocity, x and y along its own axes, and of its rate */
  double b[3];         /* of body 2's velocity, x and y along body 1's axes, and of its rate */
  pw_signal value;     /* with its first time derivative */
} pw_pfaffian;

/* Tyre: a wheel that gives way sideways; a lateral force grows with the slip instead of a row that forbids it. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];     /* contact point in the body's frame [m] */
  double heading;   /* rolling direction in the body's frame [rad] */
  double stiffness; /* cornering stiffness: lateral force per slip [N], > 0 */
  double speed;     /* below about this rolling speed the slip is regularised [m/s], > 0 */
  double load;      /* normal load that limits the force [N]; 0: linear, no limit */
  double friction;  /* the limit is friction times load; > 0 if there is a load */
} pw_tyre;

/* Rolling resistance: a force along a heading, against the motion of its point along it. */
typedef struct {
  const char *name;
  const char *body;
  double at[2];   /* contact point in the body's frame [m] */
  double heading; /* rolling direction in the body's frame [rad] */
  double limit;   /* the force when it rolls: coefficient times normal load [N], >= 0 */
  double speed;   /* below about this speed the force is smoothed [m/s], > 0 */
} pw_rolling_resistance;

/* Spring: pulls a point of body 1 and a point of body 2 together along their line, with a damper beside it. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];     /* the ends in each body's frame [m]; on the ground: in the world */
  double stiffness;    /* [N/m], >= 0 */
  double damping;      /* [N s/m], >= 0 */
  double length;       /* free length [m], >= 0 */
} pw_spring;

/* Rotational spring: turns two bodies to an angle between them, with a damper beside it. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double stiffness;    /* [N m/rad], >= 0 */
  double damping;      /* [N m s/rad], >= 0 */
  double angle;        /* free angle, of body 1 relative to body 2: phi1 - phi2 [rad] */
} pw_rotational_spring;

/* Friction: a viscous and a Coulomb torque against the turning of body 1 on body 2, in a pin for instance. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  double viscous;      /* [N m s/rad], >= 0 */
  double limit;        /* Coulomb torque [N m], >= 0 */
  double speed;        /* below about this rate the Coulomb torque is smoothed [rad/s]; > 0 if there is a limit */
} pw_friction;

/* Sliding friction: a viscous and a Coulomb force against the motion of a point of body 1 along a line of body 2, in a
 * slider or slot for instance. */
typedef struct {
  const char *name;
  const char *body[2]; /* what slides, and what it slides on; "ground" for one of them */
  double at[2][2];     /* the point, and a point of the line, in each body's frame [m]; on the ground: in the world */
  double heading;      /* direction of the line in body 2's frame [rad] */
  double viscous;      /* [N s/m], >= 0 */
  double limit;        /* Coulomb force [N], >= 0 */
  double speed;        /* below about this speed the Coulomb force is smoothed [m/s]; > 0 if there is a limit */
} pw_sliding_friction;

/* Drag: air, at rest, slows down a body's centre of mass and its turning. */
typedef struct {
  const char *name;
  const char *body;
  double linear;            /* [N s/m], >= 0 */
  double quadratic;         /* half density times area times coefficient [N s^2/m^2], >= 0 */
  double turning;           /* [N m s/rad], >= 0 */
  double turning_quadratic; /* [N m s^2/rad^2], >= 0 */
} pw_drag;

/* Gravity: the same acceleration for every body that has mass, in any direction of the plane. */
typedef struct {
  const char *name;
  double acceleration[2]; /* in the world, (0, -9.81) for a plane that stands upright [m/s^2] */
} pw_gravity;

/* The axes along which a force is given. */
enum { PW_AXES_WORLD, PW_AXES_BODY };

/* Force: acts on a point of a body, from outside. */
typedef struct {
  const char *name;
  const char *body;
  double at[2]; /* where, in the body's frame [m] */
  int axes;     /* PW_AXES_WORLD; PW_AXES_BODY: it turns with the body */
  pw_signal fx; /* [N] */
  pw_signal fy; /* [N] */
} pw_force;

/* Torque: acts on body 1, and its opposite on body 2. */
typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground" for one of them */
  pw_signal value;     /* [N m] */
} pw_torque;

/* Motor: turns body 1 against body 2 to an angle that follows a signal, as a spring and damper of limited torque. */
typedef struct {
  const char *name;
  const char *body[2]; /* what it turns, and what it reacts on; "ground" for one of them */
  double stiffness;    /* torque per error of the angle [N m/rad], >= 0 */
  double damping;      /* torque per error of the rate [N m s/rad], >= 0 */
  double limit;        /* the torque saturates here [N m]; 0: no limit */
  pw_signal angle;     /* target of phi1 - phi2 [rad] */
  pw_signal rate;      /* target of omega1 - omega2 [rad/s] */
} pw_motor;

/* Marker: a point of a body, followed in tables, figures and animations.  It has no effect. */
typedef struct {
  const char *name;
  const char *body;
  double at[2]; /* the point in the body's frame [m] */
} pw_marker;

/* The list of kinds: the one line to add for a new file in a directory of core/kinds/. */
#define PW_KINDS               \
  PW_KIND (pin)                \
  PW_KIND (weld)               \
  PW_KIND (slider)             \
  PW_KIND (slot)               \
  PW_KIND (rod)                \
  PW_KIND (gear)               \
  PW_KIND (drive)              \
  PW_KIND (wheel)              \
  PW_KIND (rolling_wheel)      \
  PW_KIND (steered_wheel)      \
  PW_KIND (speed)              \
  PW_KIND (pfaffian)           \
  PW_KIND (tyre)               \
  PW_KIND (rolling_resistance) \
  PW_KIND (spring)             \
  PW_KIND (rotational_spring)  \
  PW_KIND (friction)           \
  PW_KIND (sliding_friction)   \
  PW_KIND (drag)               \
  PW_KIND (gravity)            \
  PW_KIND (force)              \
  PW_KIND (torque)             \
  PW_KIND (motor)              \
  PW_KIND (marker)

/* ---- What a kind provides ---- */

typedef enum { PW_NUMBER, PW_POINT, PW_VECTOR, PW_BODY, PW_SIGNAL, PW_CHOICE } pw_field_type;

/* One field of a definition structure: serves validation, text models, `show`, `list kinds` and the manual. */
typedef struct pw_field {
  const char *name;           /* as written in a model file */
  size_t offset;              /* in the definition structure */
  pw_field_type type;         /* double, double[2], double[2], const char *, pw_signal, int */
  int count;                  /* how many of them in a row; 0 means 1 */
  const char *unit;           /* NULL where there is none */
  int required;               /* a text model must write it */
  pw_domain domain;           /* of a number */
  const char *const *choices; /* NULL-terminated names of a choice's values 0, 1, ... */
  const char *about;          /* meaning */
} pw_field;

/* Name and unit of a constraint row's reaction, or of an internal coordinate. */
typedef struct {
  const char *name;  /* "Fx" */
  const char *unit;  /* "N" */
  const char *rate;  /* internal coordinates only: the name of its velocity */
  const char *about; /* sign and meaning */
} pw_quantity;

/* A coordinate an element owns, as its kind's prepare describes it. */
typedef struct {
  double
      mass; /* its entry of M [kg m^2], >= 0; an internal coordinate may be massless if the element's rows determine it */
  double start;     /* its value at the start [rad] */
  double rate;      /* its rate at the start [rad/s] */
  int specified[2]; /* 1: start, rate are what the definition says, not a consequence of something else */
} pw_internal;

/* Where a body is and how it moves; the ground is a body at rest at the origin. */
typedef struct {
  double x, y, phi;     /* centre of mass [m], angle [rad] */
  double cos, sin;      /* of phi */
  double vx, vy, omega; /* [m/s], [rad/s] */
} pw_configuration;

/* All elements of one kind in a scene, as its sweeps see them.  Element e has local coordinates: (x, y, phi) of each
 * of its bodies, then its own; there are `cols` of them.  Arrays are row-major, one element after the other. */
typedef struct {
  int count;                             /* elements */
  int cols;                              /* 3 kind->bodies + kind->own */
  const void *element;                   /* count structures of kind->element bytes, made by kind->prepare */
  const int *body;                       /* count x kind->bodies indices into configuration */
  const pw_configuration *configuration; /* of every body of the scene, and the ground */
  const double *q;                       /* count x kind->own: internal coordinates */
  const double *v;                       /* count x kind->own: their rates */
  const double *u;                       /* count x kind->signals x 3: value, rate and acceleration of each signal */
  const double *w;                       /* count x cols: the direction w, for jw_q only */
  const double *lambda;                  /* count x kind->rows: the multipliers, for power and loss only */
} pw_batch;

/* Fills one array for the whole batch. */
typedef void pw_batch_function (const pw_batch *b, double *out);

/* In a second-order block's place: asks the core to difference the function below it. */
pw_batch_function pw_by_differences;
#define PW_BY_DIFFERENCES pw_by_differences

typedef enum {
  PW_FORCE,       /* no rows */
  PW_HOLONOMIC,   /* rows g (q, t) = 0 */
  PW_NONHOLONOMIC /* rows S (q, t) v = eta (t, q) */
} pw_level;

/* An element kind: one const table in one file.  A NULL sweep means identically zero; the self-test verifies it.
 * Sizes are given per element. */
struct pw_kind {
  const char *name;              /* "pin" */
  const char *about;             /* one line */
  size_t definition;             /* bytes of the definition structure, whose first member is `const char *name` */
  size_t element;                /* bytes of the prepared element */
  const pw_field *fields;        /* ended by a NULL name; `name` itself is not listed */
  int bodies;                    /* bodies an element touches: as many as its fields of type PW_BODY name */
  int own;                       /* coordinates of its own */
  int rows;                      /* constraint rows */
  int signals;                   /* signals, in the order of its fields; they serve the force if there is a force_u */
  int each_body;                 /* 1: no body is named; the element acts on every body that has mass */
  int constant;                  /* 1: its force depends on nothing: evaluated once, when the scene is compiled */
  pw_level level;                /* of its rows */
  const pw_quantity *reaction;   /* one per row: what -lambda is */
  const pw_quantity *coordinate; /* one per internal coordinate */
  const char *(*reaction_unit) (const void *element, int row); /* where it depends on the element; may be NULL */

  /* Turns a checked definition into a prepared element; bodies are those it names or acts on, in order, the ground as
   * a body without mass.  own takes mass and start of each internal coordinate, zero so far.  Returns a status. */
  int (*prepare) (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                  pw_error *error);

  pw_batch_function *g;       /* rows: residual of holonomic rows */
  pw_batch_function *g_size;  /* rows: sum of the absolute values of the terms of g, the reference size of g */
  pw_batch_function *eta;     /* rows: right-hand side of J v = eta; for holonomic rows -dg/dt */
  pw_batch_function *J;       /* rows x cols */
  pw_batch_function *gamma;   /* rows: right-hand side of J a = gamma */
  pw_batch_function *force;   /* cols: generalised force */
  pw_batch_function *force_u; /* cols x signals: derivative of the force by each signal's value */
  pw_batch_function
      *jw_q; /* rows x cols: derivative of J w by q, w given in the batch; that of J^T lambda follows from it */
  pw_batch_function *eta_q;   /* rows x cols */
  pw_batch_function *gamma_q; /* rows x cols */
  pw_batch_function *gamma_v; /* rows x cols */
  pw_batch_function *force_q; /* cols x cols */
  pw_batch_function *force_v; /* cols x cols */
  pw_batch_function *energy;  /* 1: potential energy [J] */
  pw_batch_function *power;   /* 1: power the element feeds into the system [W] */
  pw_batch_function *loss;    /* 1: power it dissipates [W], >= 0 */
  pw_batch_function *contact; /* 3: point on the ground [m] and heading [rad], for paths and pictures */
  /* 2 cols: a force that saturates, such as friction; by how much each coordinate, then each velocity, may change until the
   * force has changed by its own size.  INFINITY, already there, where it does not saturate.  NULL: nowhere. */
  pw_batch_function *saturation;
};

/* How many values a field stands for, and the bytes of one; 0: there is no such type. */
static inline int pw_field_count (const pw_field *f) {
  return f->count > 0 ? f->count : 1;
}
size_t pw_field_bytes (pw_field_type type);

/* The k-th value of a type in a definition, counting each of its fields' `count`; NULL if there are not as many. */
const void *pw_field_at (const pw_kind *kind, const void *definition, pw_field_type type, int k);

/* 1 if elements of the kind take part in the motion; a marker does not. */
static inline int pw_kind_acts (const pw_kind *kind) {
  return kind->rows > 0 || kind->own > 0 || kind->force != NULL;
}

/* 1 if its signals serve a force: they may depend on states, and need no derivatives. */
static inline int pw_kind_forced (const pw_kind *kind) {
  return kind->force_u != NULL;
}

/* Every kind k of the list: its table pw_kind_k, and pw_add_k, which is pw_add with that table. */
#define PW_KIND(k)                                                       \
  extern const pw_kind pw_kind_##k;                                      \
  static inline int pw_add_##k (pw_model *m, const pw_##k *definition) { \
    return pw_add (m, &pw_kind_##k, definition);                         \
  }
PW_KINDS
#undef PW_KIND

/* The built-in kinds, ended by NULL. */
extern const pw_kind *const pw_kinds[];

/* ---- Models from outside a build function ---- */

/* A model with its parameters at their defaults, not built yet.  `name` is copied; the table must outlive the model.
 * NULL with the error filled if the table does not fit this library or memory is out. */
pw_model *pw_model_new (const char *name, const pw_plugin_table *table, pw_error *error);
void pw_model_free (pw_model *m);

/* Sets a parameter before pw_model_build.  Errors: unknown name, value outside its domain. */
int pw_model_set (pw_model *m, const char *parameter, double value, pw_error *error);

/* Runs the model's build function.  Errors: whatever an added body or element is wrong about. */
int pw_model_build (pw_model *m, pw_error *error);

/* Replaces a signal of a built model: pw_model_set_signal (m, "rider", "value", &signal, e).  Errors: PW_INPUT for an element or
 * field that does not exist, with the nearest name; whether the field can take the signal is pw_system_compile's to tell. */
int pw_model_set_signal (pw_model *m, const char *element, const char *field, const pw_signal *signal, pw_error *error);

/* Gives a start value, "frame.vx" or "wheel.spin", which the consistent start then holds.  Errors: PW_INPUT for a value that
 * is not finite; whether there is such a state is pw_system_compile's to tell. */
int pw_model_set_initial (pw_model *m, const char *state, double value, pw_error *error);

/* ---- What a model consists of ---- */

const char *pw_model_name (const pw_model *m);
const pw_plugin_table *pw_model_table (const pw_model *m);
double pw_model_parameter (const pw_model *m, const pw_parameter *p); /* its value; p: in the model's table */

/* Its bodies and elements in the order they were added, once it is built; they belong to the model, until more are added. */
typedef struct {
  const pw_kind *kind;
  void *definition; /* kind->definition bytes, the first member its name */
} pw_element;
const pw_body *pw_model_bodies (const pw_model *m, int *count);
const pw_element *pw_model_elements (const pw_model *m, int *count);
static inline const char *pw_element_name (const pw_element *e) {
  return *(const char *const *)e->definition;
}
int pw_model_initial (const pw_model *m); /* how many values pw_model_set_initial has given */

/* What a text model knows about its motion: expressions of the time for some states; and the values of the names in these
 * and in signals. */
typedef struct {
  int states;                 /* 0: nothing */
  const char **state, **text; /* states: "bob.phi", and its expression */
  int names;
  const char **name;                               /* names */
  double *value;                                   /* names */
  double (*eval) (void *context, int i, double t); /* the value of expression i */
  void *context;
} pw_reference_text;
const pw_reference_text *pw_model_reference (const pw_model *m); /* all zero: it knows nothing */
void pw_model_set_reference (pw_model *m,
                             const pw_reference_text *reference); /* which must live as long as the model */

/* ---- For build functions that read their models from elsewhere ---- */

/* Frees an object with the model: memory of function signals, for instance.  PW_RESOURCE, and the object is released at once. */
int pw_model_keep (pw_model *m, void *object, void (*free_object) (void *object));

/* The first error of a model, which a build function may set. */
pw_error *pw_model_error (pw_model *m);

/* What pw_system_compile would refuse in a body, and in an element, but for bodies that do not exist; errors begin with
 * "model NAME: ".  PW_INPUT. */
int pw_model_check_body (const pw_model *m, const pw_body *body, pw_error *error);
int pw_model_check_element (const pw_model *m, const pw_element *element, pw_error *error);

/* What is wrong with a signal of a kind, written to the buffer, which is returned; "" if nothing is.  *point becomes the point
 * of a table that is meant, or -1. */
char *pw_signal_check (const pw_signal *s, const pw_kind *kind, int *point, char *buffer, size_t size);

/* Checks a plug-in's table: its ABI, that it can build, its texts and parameters.  Errors: PW_INPUT, beginning with `what`, a path
 * or "model NAME". */
int pw_plugin_check (const pw_plugin_table *table, const char *what, pw_error *error);

/* ---- The compiled system ---- */

/* A compiled system is never modified: any number of runs and threads may share it.  It does not refer to the model it was
 * compiled from, but to the element types and the function signals. */
typedef struct pw_system pw_system;

/* What an evaluation modifies: configurations, J, values of signals, scratch memory.  A run has one; so does a program that
 * evaluates a system itself.  It belongs to one thread at a time, and the system must outlive it. */
typedef struct pw_workspace pw_workspace;

/* Checks and compiles a built model.  NULL with the error filled if it cannot be. */
pw_system *pw_system_compile (const pw_model *m, pw_error *error);
void pw_system_free (pw_system *s);

/* 1 if a built model knows its motion (see pw_plugin_table), and what it knows at time t: q and v have as many entries as
 * the system compiled from it has coordinates; what is not known is NaN.  It holds for the described start, not for values
 * of pw_model_set_initial.  Errors: PW_INPUT for a state the system does not have. */
int pw_system_has_reference (const pw_model *m);
int pw_system_reference (const pw_model *m, const pw_system *s, double t, double *q, double *v, pw_error *error);

/* Sizes: bodies, coordinates (q and v have as many entries each), constraint rows, of which the first are holonomic. */
int pw_system_bodies (const pw_system *s);
int pw_system_coordinates (const pw_system *s);
int pw_system_rows (const pw_system *s);
int pw_system_holonomic (const pw_system *s);

/* Index of a body by name, or -1. */
int pw_system_find_body (const pw_system *s, const char *name);

/* Index of a state by name: i for coordinate q[i], n + i for its rate v[i], n the number of coordinates.  PW_INPUT
 * and the error, with the nearest name, if there is no such state. */
int pw_system_find_state (const pw_system *s, const char *name, pw_error *error);

/* The name and unit of a state ("frame.vx", "m/s"); the name is written to the buffer, which is returned. */
char *pw_system_state_name (const pw_system *s, int state, char *buffer, size_t size);
const char *pw_system_state_unit (const pw_system *s, int state);

/* The name and unit of a row's reaction ("B.Fx", "N"), as pw_system_state_name. */
char *pw_system_reaction_name (const pw_system *s, int row, char *buffer, size_t size);
const char *pw_system_reaction_unit (const pw_system *s, int row);

/* The row whose reaction has this name: its value is -lambda[row] of a sample.  PW_INPUT and the error, with the nearest
 * name, if there is none. */
int pw_system_find_reaction (const pw_system *s, const char *name, pw_error *error);

/* The kind and name of a row's element ("wheel C"), as pw_system_state_name. */
char *pw_system_row_name (const pw_system *s, int row, char *buffer, size_t size);

/* Its name; the name of a body; the diagonal of M [kg], [kg m^2]: one number per coordinate; the length scale L [m]. */
const char *pw_system_name (const pw_system *s);
const char *pw_system_body_name (const pw_system *s, int body);
const double *pw_system_mass (const pw_system *s);
double pw_system_length (const pw_system *s);

/* The initial conditions as described: coordinates and velocities. */
const double *pw_system_initial_q (const pw_system *s);
const double *pw_system_initial_v (const pw_system *s);

/* 1 if multipliers may jump at time t: the signal of a force jumps there, or any derivative of one that a constraint follows. */
int pw_system_jumps (const pw_system *s, double t);

/* ---- Its elements, in the order of its constraint equations ---- */

/* An element that acts on every body counts once for each. */
typedef struct {
  const char *name;
  const pw_kind *kind; /* kind->level is the type of its constraint equations */
  const int *body;     /* kind->bodies indices; that of the ground is the number of bodies */
  int row;             /* its first constraint equation, of kind->rows */
  int coordinate;      /* its first internal coordinate, of kind->own */
  int contact;         /* index of its contact point; -1: it has none */
  int force;           /* where its forces begin in pw_workspace_forces */
} pw_element_info;
int pw_system_elements (const pw_system *s);
pw_element_info pw_system_element (const pw_system *s, int element);
int pw_system_row_element (const pw_system *s, int row); /* the element of a constraint equation */

/* A workspace for the functions below, which evaluate a state.  NULL and the error without memory. */
pw_workspace *pw_workspace_new (const pw_system *s, pw_error *error);
void pw_workspace_free (pw_workspace *w);

/* The functions below evaluate a state.  Errors: PW_METHOD if a signal fails, PW_RESOURCE. */

/* Point on the ground [m] and heading [rad] of each contact. */
int pw_system_contacts (const pw_system *s);
int pw_workspace_contact_points (pw_workspace *w, double t, const double *q, const double *v, double (*out)[3],
                                 pw_error *error);

/* The force (Fx, Fy [N], M [N m] about the centre of mass) of each element on each of its bodies, the ground's without
 * meaning: -J^T lambda and what it applies.  Constraint equations on velocities count alike. */
int pw_system_force_size (const pw_system *s);
int pw_workspace_forces (pw_workspace *w, double t, const double *q, const double *v, const double *lambda, double *out,
                         pw_error *error);

/* The equations M a + J^T lambda = f,  J v = eta,  J a = gamma at a state.  J by its entries, those that are 0 here among
 * them, row by row of each element; there is at most one for each row and column. */
typedef struct {
  int coordinates, rows, holonomic, entries;
  double *mass, *force; /* coordinates: diagonal of M; f */
  double *g;            /* holonomic */
  double *eta, *gamma;  /* rows */
  int *row, *column;    /* entries: where they are in J */
  double *value;        /* entries */
} pw_equations;
int pw_system_equations (const pw_system *s, double t, const double *q, const double *v, pw_equations *out,
                         pw_error *error);
void pw_equations_free (pw_equations *e); /* in every case */

/* Second-order blocks that are PW_BY_DIFFERENCES, and the name of one ("force_q of kind drag"), as pw_system_state_name. */
int pw_system_differences (const pw_system *s);
char *pw_system_difference_name (const pw_system *s, int i, char *buffer, size_t size);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#ifdef __cplusplus
}
#endif

#endif
