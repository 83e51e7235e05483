/* Pinwheel: planar multibody systems with pin joints and knife-edge wheels.
 *
 * A model is a C file that includes only this header, compiled to a plug-in, or a YAML file, a text model
 * (docs/model-format.md).  This header declares
 *   - the description of a model: bodies, elements, signals and parameters,
 *   - the built-in element types, and what an element type of your own has to provide,
 *   - the compiled system that the solvers integrate.
 *
 * Units are SI, angles are radians, counter-clockwise.  The state consists of q, which is (x, y) of the centre of mass
 * and the angle phi of each body, then the internal coordinates of elements, and v = dq/dt.  The equations are
 *
 *     M a + J^T lambda = f(t, q, v),     g(q, t) = 0,     J v = eta(t, q),     J = [ G = dg/dq ; S(q, t) ]
 *
 * with the rows G of holonomic constraint equations before those of nonholonomic ones, S; a = dv/dt.  The derivative of
 * J v = eta with respect to time is J a = gamma(t, q, v). */
#ifndef PINWHEEL_H
#define PINWHEEL_H

#include <stddef.h>

#ifdef __GNUC__
#define PW_EXPORT __attribute__ ((visibility ("default")))
#define PW_PRINTF(text, first) __attribute__ ((format (printf, text, first)))
#define PW_VISIBILITY(change) _Pragma (change)
#else
#define PW_EXPORT
#define PW_PRINTF(text, first)
#define PW_VISIBILITY(change)
#endif

/* They enclose the declarations of a public header: exported from the library, with C linkage. */
#ifdef __cplusplus
#define PW_BEGIN PW_VISIBILITY ("GCC visibility push(default)") extern "C" {
#define PW_END \
  }            \
  PW_VISIBILITY ("GCC visibility pop")
#else
#define PW_BEGIN PW_VISIBILITY ("GCC visibility push(default)")
#define PW_END PW_VISIBILITY ("GCC visibility pop")
#endif

PW_BEGIN

#define PW_VERSION "0.1.0"
#define PW_ABI 1 /* 1 until 0.1.0 is released; then raised if plug-ins built with an older header could be misread */
#define PW_PI 3.14159265358979323846

/* ---- Status and errors ---- */

/* Status returned by functions: 0 success, > 0 not done but the call can be repeated, < 0 failure.  The program
 * exits with the negative of a negative status. */
typedef enum {
  PW_OK = 0,        /* success */
  PW_RETRY = 1,     /* step rejected; a smaller one may succeed */
  PW_STOPPED = 2,   /* pw_settings.stop stopped the run after its last accepted step; it can continue.  As the status
                     * of an error: the run was stopped while it was being opened */
  PW_RESOURCE = -1, /* out of memory, or a file cannot be written */
  PW_INPUT = -2,    /* the description or an option is wrong */
  PW_INITIAL = -3,  /* no consistent initial state found */
  PW_METHOD = -4    /* the method failed during the run */
} pw_status;

/* An error, owned by the caller and zero-initialised.  It keeps the first failure.  For functions with an argument
 * `error`, NULL in place of a file, model, system, workspace, run or search is a failure, too, so that the result of a
 * failed call may be passed on unchecked.  Functions that free or close ignore NULL; those that only return a property
 * do not check it. */
typedef struct {
  int status; /* a pw_status; 0: no error yet */
  /* One line without a full stop: found value, expected value, nearest valid name.  Text models: preceded by
   * "FILE:LINE:COLUMN: error: ", followed by the source line and a line with a caret. */
  char text[500];
} pw_error;

/* Records a failure unless one is already recorded, and returns `status`.  error may be NULL. */
int pw_fail (pw_error *error, int status, const char *format, ...) PW_PRINTF (3, 4);

/* ---- Signals: time histories of torques, drives, headings ---- */

typedef enum { PW_CONSTANT, PW_HARMONIC, PW_FUNCTION, PW_RAMP, PW_SMOOTH_STEP, PW_PULSE, PW_TABLE } pw_signal_type;

/* Interpolation of a table, and the end conditions of a cubic one. */
enum { PW_LINEAR, PW_CUBIC };
enum { PW_ENDS_FREE, PW_ENDS_REST };

/* The source text of a function signal in a text model. */
typedef struct {
  const char *part[3]; /* expressions of value, rate, acceleration; NULL: not given */
  const char *jump;    /* an operation that reads states and may jump within a step: "atan2 (a.y, a.x)"; or NULL */
} pw_signal_text;

/* A signal computed by the caller.  `eval` stores the value in value[0] and, for a signal of a constraint, its time
 * derivatives in value[1] and value[2].  x contains the states named in `reads`; gradient, unless NULL, receives the
 * derivatives of value[0] with respect to x.  A non-zero return, or a value that is not stored or not finite, stops the
 * run (radau may try shorter steps first).  Equal t and x must give equal values; if the function changes between steps
 * (a controller sets a new torque), call pw_run_restart. */
typedef struct {
  int (*eval) (void *context, double t, const double *x, double value[3], double *gradient);
  void *context; /* passed to eval and breakpoint; must outlive the systems, unless open replaces it */
  /* NULL-terminated "BODY.phi", "BODY.vx", ...; may be NULL.  Forces may read any state, velocity constraints positions
   * and first-order states. */
  const char *const *reads;
  double (*breakpoint) (void *context, double t); /* first discontinuity after t, or INFINITY; may be NULL */
  /* Returns a new context made from this one, for a compiled system, a workspace or a run; NULL if out of memory.
   * Must be thread-safe.  May be NULL: all share `context`, and eval must be thread-safe. */
  void *(*open) (void *context);
  void (*close) (void *context); /* frees a context made by open; may be NULL */
  const pw_signal_text *text;    /* NULL unless it comes from a text model */
  /* Bounds of value[0] for all times from lo[0] to hi[0] and states x from lo + 1 to hi + 1: least and largest value,
   * infinite if unknown.  Steps are then short enough to see what is narrow.  May be NULL. */
  void (*range) (void *context, const double *lo, const double *hi, double bounds[2]);
  /* Conditions on states at which the value jumps or has a kink; the result is their number.  beyond NULL: fixes the
   * side of each for later calls of eval, to that of (t, x), so that they return a smooth function, also beyond; x
   * NULL, too: ends that.  Otherwise stores how far (t, x) is beyond the fixed side of each one, negative on it, or
   * nothing if x is NULL.  Steps end where one becomes positive.  Needs `open`.  May be NULL. */
  int (*sides) (void *context, double t, const double *x, double *beyond);
} pw_function;

/* offset + amplitude cos (omega t + phase) */
typedef struct {
  double amplitude, omega, phase, offset; /* omega [rad/s], phase [rad], others: unit of the signal */
} pw_harmonic;

/* From one value to another. */
typedef struct {
  double from, to;        /* values before and after; unit of the signal */
  double start, duration; /* [s]; duration > 0 */
} pw_ramp;

/* offset + height from start to start + width, repeated each period; offset otherwise. */
typedef struct {
  double height; /* added to the offset during the pulse; unit of the signal */
  double start;  /* [s] */
  double width;  /* [s]; 0: the pulse never ends */
  double period; /* between the beginnings of two pulses [s], > width; 0: one pulse only */
  double offset; /* unit of the signal */
} pw_pulse;

/* A table: an interpolation through points. */
typedef struct {
  const double *t;     /* count: times of the points, increasing [s]; pw_add and pw_model_set_signal copy the points */
  const double *value; /* count: values of the points; constant before the first and after the last point */
  int count;           /* number of points: >= 2; cubic with free ends: >= 4 */
  int interpolation;   /* PW_LINEAR; PW_CUBIC: a spline with continuous first and second derivatives */
  int ends;            /* of a spline: PW_ENDS_FREE: not-a-knot; PW_ENDS_REST: first derivative 0 */
  double scale;        /* the signal is offset + scale value; 0 stands for 1 */
  double offset;       /* unit of the signal */
  int skipped;         /* rows of its file without a value, which are not among the points; for messages only */
} pw_points;

/* A signal; zero-initialised, it is the constant 0. */
typedef struct {
  pw_signal_type type; /* selects the member of the union */
  union {
    double constant;      /* PW_CONSTANT: the value */
    pw_harmonic harmonic; /* PW_HARMONIC */
    pw_function function; /* PW_FUNCTION */
    pw_ramp ramp;         /* PW_RAMP: linear; PW_SMOOTH_STEP: with continuous first and second derivatives */
    pw_pulse pulse;       /* PW_PULSE */
    pw_points table;      /* PW_TABLE */
  };
  int specified; /* of a limit: 1: it limits even if it is constant 0; text models set this */
} pw_signal;

/* A form of signal described by numbers; checks, text models, `show` and `list signals` use it. */
typedef struct {
  const char *name; /* "ramp", as written in a model file */
  pw_signal_type type;
  const char *about;
  const struct pw_field *fields; /* numbers and choices, with offsets in pw_signal; ends with a NULL name */
} pw_signal_form;

/* All forms; ends with a NULL name.  Constants and functions have no form. */
extern const pw_signal_form pw_signal_forms[];
const pw_signal_form *pw_signal_form_of (const pw_signal *s); /* NULL if it has none */

/* ---- The description ---- */

typedef struct pw_model pw_model;

/* A rigid body.  The origin of its frame is its centre of mass.  It may be massless. */
typedef struct {
  const char *name;           /* unique among bodies and elements; "ground" is reserved */
  double mass, inertia;       /* [kg], about the centre of mass [kg m^2], >= 0 */
  double start[3];            /* initial x, y [m], phi [rad] */
  double rate[3];             /* initial vx, vy [m/s], omega [rad/s] */
  unsigned specified;         /* PW_SPECIFIES_X | ...: which initial values are specified; 0: those that are not 0 */
  int corners;                /* of its outline in figures: 3 to PW_MOST_CORNERS, or 0 */
  const double (*outline)[2]; /* these corners in the body's frame [m]; NULL: the hull of its points */
} pw_body;

enum { PW_MOST_CORNERS = 2000 };

/* Initial values that a body specifies: the constraints are satisfied by changing the others rather than these. */
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
  PW_COUNT,       /* a whole number from 1 to 1e9 */
  PW_FRACTION     /* from 0 to 1 */
} pw_domain;

/* A named parameter of a model; it is stored as a double at `offset` in the model's parameter structure. */
typedef struct {
  const char *name;  /* as written after --set */
  size_t offset;     /* byte offset in the structure handed to build; PW_AT gives name and offset */
  double value;      /* default */
  const char *unit;  /* "m", "kg m^2", ... or "" */
  const char *about; /* what it means, in a few words */
  pw_domain domain;  /* valid values */
} pw_parameter;

#define PW_AT(type, member) .name = #member, .offset = offsetof (type, member)

/* Default run settings of a model; 0 or NULL: Pinwheel's default. */
typedef struct {
  double t_end;       /* [s] */
  double step;        /* [s], fixed-step methods */
  double rtol;        /* relative tolerance, adaptive methods */
  const char *method; /* "rk4+projection", ... */
} pw_run_defaults;

/* A run that an interactive page offers, such as one at which a method fails.  `settings` are words NAME=VALUE: method,
 * step, rtol, t_end, a parameter of the model, or start.STATE, the initial value of a state. */
typedef struct {
  const char *name;     /* on a button: "drive it" */
  const char *about;    /* what it shows, in one sentence */
  const char *settings; /* "method=rk4+none step=0.1 l=2 start.bob.vx=1" */
} pw_preset;

typedef struct pw_kind pw_kind;

/* What a plug-in exports as `pw_plugin`.  The parameters passed to its functions live as long as the model. */
typedef struct {
  unsigned abi;                                        /* PW_ABI */
  size_t size;                                         /* sizeof (pw_plugin_table) */
  const char *about;                                   /* one line: what the model is */
  const pw_parameter *parameters;                      /* ends with a NULL name; may be NULL */
  size_t parameters_size;                              /* sizeof the parameter structure */
  pw_run_defaults run;                                 /* default run settings */
  const pw_preset *presets;                            /* ends with a NULL name; may be NULL */
  void (*build) (pw_model *m, const void *parameters); /* declares bodies and elements */

  /* The reference (exact) solution for the described initial conditions; may be NULL.  Stores the known entries of q
   * and v at time t: three for each body in the order they were added, then the internal coordinates of elements in the
   * order of pw_system_element.  All entries are NaN (unknown) before the call. */
  void (*reference) (const void *parameters, double t, double *q, double *v);

  const struct pw_method *const *methods; /* integration methods (pinwheel-method.h), ended by NULL; may be NULL */
} pw_plugin_table;

/* Ends a model file:  PW_MODEL (.about = "...", .parameters = ..., .build = build) */
#define PW_MODEL(...)                               \
  extern PW_EXPORT const pw_plugin_table pw_plugin; \
  const pw_plugin_table pw_plugin = { .abi = PW_ABI, .size = sizeof (pw_plugin_table), __VA_ARGS__ }

/* Adds a body.  The model keeps a copy, including the name.  Returns PW_OK or the model's first error.  A build
 * function need not check it: pw_model_build reports it. */
int pw_add_body (pw_model *m, const pw_body *body);

/* Adds an element of any type; `definition` is the definition structure of that type.  The model keeps a copy,
 * including names.  Returns as pw_add_body. */
int pw_add (pw_model *m, const pw_kind *kind, const void *definition);

/* An output: a number with a name, such as a tracking error, computed where a sample of a run is taken.  Tables have it
 * as a column, and analyses find it by its name.  It has no effect on the motion. */
typedef struct {
  const char *name; /* a letter or _, then letters, digits and _, at most 63; not that of anything else, nor a column */
  const char *unit; /* an SI unit, "m", for display; NULL: none */
  const char *about; /* what it means, in a few words; NULL: not said */
  /* `eval` stores value[0], for which x contains the columns that `reads` names: states ("car.y"), places of wheels and
   * markers ("pencil.x"), reactions ("B.Fx"), kinetic, potential, work, loss, works and losses of elements, outputs
   * added before.  gradient is NULL, value[1] and value[2] are ignored, breakpoint is not called.  If it returns
   * non-zero, the output is NaN there. */
  pw_function value;
} pw_named_output;

enum { PW_MOST_OUTPUTS = 1000, PW_OUTPUT_READS = 31 }; /* outputs of a model; columns that one reads */

/* Adds an output.  The model keeps a copy, including texts.  Returns as pw_add_body. */
int pw_add_output (pw_model *m, const pw_named_output *output);

/* For build functions: rejects the parameters with a message ("links: at most 1000").  Returns PW_INPUT. */
int pw_model_refuse (pw_model *m, const char *format, ...) PW_PRINTF (2, 3);

/* ---- Functions for models: exact solutions; the same results on every machine ---- */

/* Jacobi's amplitude am (u | m) and the complete elliptic integral K (m), m = k^2 <= 1 (NaN above): sn = sin (am).
 * A pendulum released at rest at an angle A from its lowest point is at the angle 2 asin (k sn (K - w t)), where
 * k = sin (A / 2) and w is the angular frequency of small oscillations. */
double pw_jacobi_am (double u, double m);
double pw_elliptic_K (double m);

/* Sine and cosine of an angle [rad] to 1 ulp: for |x| < 1e6 the same bits on every machine, else the C library's. */
void pw_sin_cos (double x, double *sine, double *cosine);
double pw_sin (double x);
double pw_cos (double x);

/* ---- Paths: curves through points of the plane, for feedback that follows a track ---- */

/* A path: a polyline or a cubic spline through points, open or closed.  Its places are given by the arc length s from
 * the first point.  Beyond its ends an open path continues straight; a closed one continues by further laps.  A path is
 * never modified: any number of threads may share it. */
typedef struct pw_path pw_path;

/* A place on a path and, of a point near it, the offset. */
typedef struct {
  double s;            /* arc length [m]; of an open path < 0 before its first point */
  double x, y;         /* the place [m] */
  double heading;      /* direction [rad], without jumps of a whole turn along the path */
  double cos, sin;     /* of the heading */
  double curvature[3]; /* d heading/ds [1/m], positive to the left, and its first two derivatives by s */
  double offset;       /* distance of the point, positive to the left of the path [m]; 0 for pw_path_at */
  int corner; /* 1: the place is a corner of a polyline; the heading is at right angles to the way to the point */
} pw_path_place;

enum { PW_PATH_POINTS = 1000000 }; /* most points of a path */

/* A path through `count` points, x[i], y[i], that differ from the one before: at least 2; 3 if closed; 4 if cubic.
 * interpolation: PW_LINEAR, a polyline; PW_CUBIC, a spline in the accumulated distance of the points, with continuous
 * direction and curvature; "not a knot" at the ends of an open one.  The last point of a closed path may repeat the
 * first.  NULL and the error: PW_INPUT, also for a spline without direction at a cusp; PW_RESOURCE. */
pw_path *pw_path_open (const double *x, const double *y, int count, int interpolation, int closed, pw_error *error);
pw_path *pw_path_share (pw_path *p); /* one more owner, each of which closes it; returns the path */
void pw_path_close (pw_path *p);

/* The place at an arc length; at a corner, that just after it. */
void pw_path_at (const pw_path *p, double s, pw_path_place *place);

/* The place nearest to a point: near = INFINITY, of all places, and of several that with the least s; else the arc
 * length to which the place is next among those at which the distance has a minimum.  The offset of a point beyond an
 * end of an open path is that from its tangent there.  A point that is not finite: all members are NaN.
 *
 * With d the offset and k the curvature, the derivatives by x and y are (-sin, cos) of the offset, (cos, sin) /
 * (1 - k d) of the arc length, and k times the latter of the heading; at a corner (-sin, cos), (0, 0), and
 * (cos, sin) / -d. */
void pw_path_nearest (const pw_path *p, double x, double y, double near, pw_path_place *place);

/* The first arc length after s at which the direction or the curvature jumps; INFINITY if there is none. */
double pw_path_break (const pw_path *p, double s);
int pw_path_is_smooth (const pw_path *p); /* 1: a spline; 0: a polyline */
/* An arc length at which a disc on the left of the path that touches it there enters it elsewhere, or is larger than
 * the circle of curvature; NaN if there is none.  It is sought at four places of each piece between points that is not
 * cut further (path.c), and beyond the ends of an open path up to its length. */
double pw_path_tight (const pw_path *p, double radius);
double pw_path_length (const pw_path *p); /* [m]; of a closed path: of one lap */

/* ---- The element types: position constraints, velocity constraints, forces, markers ---- */

/* Pin: a point of body 1 and a point of body 2 coincide.  Two holonomic constraint equations. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];            /* the point in each body's frame [m]; on the ground: in the world */
} pw_pin;

/* Weld: body 2 is fixed to body 1.  Three holonomic constraint equations. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];            /* the common point in each body's frame [m]; on the ground: in the world */
  double angle;               /* phi2 - phi1 [rad]; of sliders, drives, motors, rotational springs: phi1 - phi2 */
} pw_weld;

/* Slider: a point of body 1 stays on a line of body 2, and body 1 does not rotate relative to body 2.  Two holonomic
 * constraint equations. */
typedef struct {
  const char *name, *body[2]; /* what slides, and what it slides on; "ground" for one of them */
  double at[2][2]; /* the point, and a point of the line, in each body's frame [m]; on the ground: in the world */
  double heading;  /* direction of the line in body 2's frame [rad] */
  double angle;    /* phi1 - phi2 [rad]; of a weld: phi2 - phi1 */
} pw_slider;

/* Slot: a point of body 1 stays on a line of body 2.  One holonomic constraint equation. */
typedef struct {
  const char *name, *body[2]; /* the body with the point, the body with the line; "ground" for one of them */
  double at[2][2]; /* the point, and a point of the line, in each body's frame [m]; on the ground: in the world */
  double heading;  /* direction of the line in body 2's frame [rad] */
} pw_slot;

/* Rod: a massless bar keeps points of bodies 1 and 2 at a fixed distance.  One holonomic constraint equation. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];            /* the end points in the bodies' frames [m]; on the ground: in the world */
  double length;              /* [m], > 0 */
} pw_rod;

/* Source of a gear's offset. */
enum { PW_GEAR_START, PW_GEAR_OFFSET };

/* Gear: the angles of two bodies relative to a third, the carrier, have a fixed ratio: phi1 - phi3 = ratio (phi2 -
 * phi3) + offset.  One holonomic constraint equation. */
typedef struct {
  const char *name, *body[3]; /* the two gears and their carrier; "ground" for one of them */
  double ratio;  /* of their angular velocities relative to the carrier; negative: opposite directions; not 0 */
  int from;      /* PW_GEAR_START: from the described initial angles; PW_GEAR_OFFSET: the field `offset` */
  double offset; /* [rad] */
} pw_gear;

/* What a drive prescribes. */
enum { PW_DRIVE_X, PW_DRIVE_Y, PW_DRIVE_ANGLE };

/* Drive: a coordinate of a point of body 1 relative to body 2, or the relative angle, follows a signal.  One
 * holonomic constraint equation.  The points of an angle serve figures and the length scale only. */
typedef struct {
  const char *name, *body[2]; /* the driven body, the reference body; "ground" for one of them */
  double at[2][2];            /* a point in each body's frame [m]; on the ground: in the world */
  int what;        /* PW_DRIVE_X, PW_DRIVE_Y: from point 2 to point 1 in body 2's frame; PW_DRIVE_ANGLE: phi1 - phi2 */
  pw_signal value; /* [m] or [rad]; with its first and second time derivative */
} pw_drive;

/* On-curve: a point of a body stays on a curve of the world, given by functions of a parameter s, an internal
 * coordinate.  Two holonomic constraint equations. */
typedef struct {
  const char *name, *body;
  double at[2];       /* the point in the body's frame [m] */
  pw_signal x, y;     /* the curve [m], as signals of s in place of the time; with two derivatives, not both 0 */
  double start, rate; /* initial s and its velocity; 0 and not specified: from the body's position and velocity */
  int specified[2];   /* 1: start, rate are specified even if 0 */
} pw_on_curve;

/* Stop: a coordinate of a point of body 1, or the angle phi1 - phi2, as of a drive, stays within limits.  Two holonomic
 * constraint equations. */
typedef struct {
  const char *name, *body[2]; /* the stopped body and the reference body, or "ground" for one of them */
  double at[2][2];            /* a point in each body's frame [m]; on the ground: in the world */
  int what;                   /* PW_DRIVE_... */
  double low, high;           /* limits [m] or [rad]; one that is 0 and not specified does not exist */
  int specified[2];           /* 1: low, high are specified even if 0 */
  double restitution;         /* velocity after an impact over that before it, 0 to 1 */
} pw_end_stop;

/* Rope: a rod that may be slack. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double at[2][2];            /* the end points in the bodies' frames [m]; on the ground: in the world */
  double length;              /* largest distance between them [m] */
  double restitution;         /* velocity after the rope has become taut over that before it, 0 to 1 */
} pw_rope;

/* Contact: a point or disc of body 1 stays on the left side of a line or a path of body 2, or outside of a disc of body
 * 2.  One holonomic constraint equation, and with friction a nonholonomic one. */
typedef struct {
  const char *name, *body[2]; /* what touches, and what it touches, or "ground" for one of them */
  double at[2][2];            /* the point or centre; a point of the line, the centre or the origin of the path [m] */
  double heading;             /* direction of the line, or of the path's x axis, in body 2's frame [rad] */
  double radius;              /* of the disc of body 1 [m]; 0: a point */
  double other_radius;        /* of the disc of body 2 [m]; 0: a line */
  pw_path *path;              /* a spline in place of the line, where the disc fits everywhere; NULL: none */
  double restitution;         /* normal velocity after an impact over that before it, 0 to 1 */
  double mu;                  /* largest friction over normal force; 0: no friction */
  double mu_sliding;          /* the same while it slides, at most mu; 0 and not specified: mu */
  int specified;              /* 1: mu_sliding is specified even if it is 0 */
} pw_contact;

/* Freewheel: body 1 does not turn more slowly than body 2.  One nonholonomic constraint equation. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
} pw_freewheel;

/* Wheel: a knife edge; the contact point does not move across the heading.  One nonholonomic constraint equation.  With
 * a grip, it slides against the force grip_sliding once holding would take more than the grip. */
typedef struct {
  const char *name, *body;
  double at[2];           /* contact point in the body's frame [m] */
  double heading;         /* rolling direction in the body's frame [rad] */
  pw_signal grip;         /* largest lateral force [N]; 0 and not specified: no limit */
  pw_signal grip_sliding; /* lateral force while sliding [N], at most the grip; 0 and not specified: the grip */
} pw_wheel;

/* Rolling wheel: the contact point moves neither across the heading nor, except by rolling, along it.  Two
 * nonholonomic constraint equations and an internal coordinate, the spin angle; its velocity is positive when
 * rolling along the heading.  With a grip it slides once the resultant of lateral and longitudinal force would exceed
 * the grip.  With grip or brake a third equation: the brake holds the wheel. */
typedef struct {
  const char *name, *body;
  double at[2];       /* contact point in the body's frame [m] */
  double heading;     /* rolling direction in the body's frame [rad] */
  double radius;      /* [m], > 0 */
  double inertia;     /* about its axle [kg m^2], >= 0; its mass belongs to the body */
  double start, rate; /* initial spin angle [rad] and velocity [rad/s]; rate 0 and not specified: of rolling at the
                       * body's velocity */
  int specified[2];   /* 1: start, rate are specified even if 0 */
  pw_signal torque;   /* on the wheel about its axle [N m]; its reaction on the body has no effect in the plane */
  pw_signal grip, grip_sliding; /* as of a wheel, of the resultant [N] */
  pw_signal brake;              /* largest torque against the spin [N m], as of friction */
} pw_rolling_wheel;

/* Steered wheel: a wheel whose heading in the body follows a signal.  One nonholonomic constraint equation. */
typedef struct {
  const char *name, *body;
  double at[2];                 /* contact point in the body's frame [m] */
  pw_signal heading;            /* rolling direction in the body's frame [rad]; with its first time derivative */
  pw_signal grip, grip_sliding; /* as of a wheel [N] */
} pw_steered_wheel;

/* Speed: a point's speed along a direction of its body follows a signal.  One nonholonomic constraint equation. */
typedef struct {
  const char *name, *body;
  double at[2];    /* the point in the body's frame [m] */
  double heading;  /* the direction in the body's frame [rad] */
  pw_signal value; /* [m/s]; with its first time derivative */
} pw_speed;

/* Pfaffian: a linear relation between the velocities of two bodies, both along the axes of body 1:
 * a . (vx1, vy1, omega1) + b . (vx2, vy2, omega2) = value.  One nonholonomic constraint equation. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double a[3], b[3];          /* coefficients of the velocities of body 1 and body 2 */
  pw_signal value;            /* with its first time derivative; its unit follows from a and b */
} pw_pfaffian;

/* Tyre: a wheel with side slip; a lateral force that grows with the slip replaces the constraint equation. */
typedef struct {
  const char *name, *body;
  double at[2];     /* contact point in the body's frame [m] */
  double heading;   /* rolling direction in the body's frame [rad] */
  double stiffness; /* cornering stiffness: lateral force per slip [N], > 0 */
  double speed;     /* below about this rolling speed the slip is regularised [m/s], > 0 */
  double load;      /* normal load, which limits the force [N]; 0: linear, no limit */
  double friction;  /* friction coefficient, force limit over load; > 0 if and only if load > 0 */
} pw_tyre;

/* Rolling resistance: a force along the heading that opposes the motion of its point. */
typedef struct {
  const char *name, *body;
  double at[2];   /* contact point in the body's frame [m] */
  double heading; /* rolling direction in the body's frame [rad] */
  double limit;   /* the force while rolling: coefficient times normal load [N], >= 0 */
  double speed;   /* below about this speed the force is smoothed [m/s], > 0 */
} pw_rolling_resistance;

/* Spring: a spring and parallel damper between a point of body 1 and a point of body 2. */
typedef struct {
  const char *name, *body[2];        /* the two bodies, or "ground" for one of them */
  double at[2][2];                   /* the end points in the bodies' frames [m]; on the ground: in the world */
  double stiffness, damping, length; /* [N/m], [N s/m], free length [m]; >= 0 */
} pw_spring;

/* Rotational spring: a torsion spring and parallel damper between two bodies. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double stiffness, damping;  /* [N m/rad], [N m s/rad], >= 0 */
  double angle;               /* free value of phi1 - phi2 [rad] */
} pw_rotational_spring;

/* Friction: a viscous and a Coulomb torque that oppose the rotation of body 1 relative to body 2, as in a pin. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  double viscous;             /* [N m s/rad], >= 0 */
  double speed;    /* below about this velocity the Coulomb torque is smoothed [rad/s]; 0: it is exact, and holds */
  pw_signal limit; /* Coulomb torque [N m], >= 0; constant if it is smoothed */
  pw_signal limit_sliding; /* exact Coulomb torque while sliding [N m], at most the limit; 0 and not specified: it */
} pw_friction;

/* Sliding friction: a viscous and a Coulomb force that oppose the motion of a point of body 1 along a line of body 2,
 * as in a slider or slot. */
typedef struct {
  const char *name, *body[2]; /* what slides, and what it slides on; "ground" for one of them */
  double at[2][2]; /* the point, and a point of the line, in each body's frame [m]; on the ground: in the world */
  double heading;  /* direction of the line in body 2's frame [rad] */
  double viscous;  /* [N s/m], >= 0 */
  double speed;    /* below about this speed the Coulomb force is smoothed [m/s]; 0: it is exact, and holds */
  pw_signal limit; /* Coulomb force [N], >= 0; constant if it is smoothed */
  pw_signal limit_sliding; /* exact Coulomb force while sliding [N], at most the limit; 0 and not specified: it */
} pw_sliding_friction;

/* Drag: still air opposes the velocity of a body's centre of mass and its rotation. */
typedef struct {
  const char *name, *body;
  double linear, quadratic;          /* [N s/m]; half air density x area x drag coefficient [N s^2/m^2]; >= 0 */
  double turning, turning_quadratic; /* [N m s/rad], [N m s^2/rad^2], >= 0 */
} pw_drag;

/* Gravity: the same acceleration for every body that has mass, in any direction of the plane. */
typedef struct {
  const char *name;
  double acceleration[2]; /* in the world [m/s^2]; (0, -9.81) in a vertical plane */
} pw_gravity;

/* The axes along which a force is given. */
enum { PW_AXES_WORLD, PW_AXES_BODY };

/* Force: an external force on a point of a body. */
typedef struct {
  const char *name, *body;
  double at[2];     /* the point in the body's frame [m] */
  int axes;         /* PW_AXES_WORLD, or PW_AXES_BODY: rotating with the body */
  pw_signal fx, fy; /* [N] */
} pw_force;

/* Torque: acts on body 1; the opposite torque acts on body 2. */
typedef struct {
  const char *name, *body[2]; /* the two bodies, or "ground" for one of them */
  pw_signal value;            /* [N m] */
} pw_torque;

/* Motor: a spring and damper of limited torque that drive the angle of body 1 relative to body 2 to a signal. */
typedef struct {
  const char *name, *body[2]; /* the driven body, the body with the reaction; "ground" for one of them */
  double stiffness, damping;  /* torque per error of angle [N m/rad], of angular velocity [N m s/rad]; >= 0 */
  double limit;               /* largest torque [N m]; 0: no limit */
  pw_signal angle, rate;      /* targets of phi1 - phi2 [rad], of omega1 - omega2 [rad/s] */
} pw_motor;

/* State: a first-order state z of a controller, an actuator, a motor's current: z' = rate.  Signals read it by name.
 * It has no mass: energies do not contain it. */
typedef struct {
  const char *name;
  pw_signal rate;    /* of the time, positions, velocities and states, also of z itself [unit/s] */
  double start;      /* initial value [unit] */
  const char *unit;  /* "rad s"; NULL or "": none */
  const char *about; /* what it means, in a few words; NULL: not said */
} pw_state;

/* Marker: a point of a body that appears in tables, figures and animations.  It has no effect on the motion. */
typedef struct {
  const char *name, *body;
  double at[2]; /* the point in the body's frame [m] */
} pw_marker;

/* The built-in element types: add one line for a new file in a directory of core/kinds/. */
#define PW_KINDS               \
  PW_KIND (pin)                \
  PW_KIND (weld)               \
  PW_KIND (slider)             \
  PW_KIND (slot)               \
  PW_KIND (rod)                \
  PW_KIND (gear)               \
  PW_KIND (drive)              \
  PW_KIND (on_curve)           \
  PW_KIND (end_stop)           \
  PW_KIND (rope)               \
  PW_KIND (contact)            \
  PW_KIND (wheel)              \
  PW_KIND (rolling_wheel)      \
  PW_KIND (steered_wheel)      \
  PW_KIND (freewheel)          \
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
  PW_KIND (state)              \
  PW_KIND (marker)

/* ---- What an element type provides ---- */

/* PW_POINT: fixed in a body; point i of a definition is in the frame of its body i.  PW_VECTOR: any other pair.
 * PW_TRACK: a path or NULL, at most one; models and systems become owners of it. */
typedef enum { PW_NUMBER, PW_POINT, PW_VECTOR, PW_BODY, PW_SIGNAL, PW_CHOICE, PW_TEXT, PW_TRACK } pw_field_type;

/* One field of a definition structure: used by validation, text models, `show`, `list kinds` and the manual. */
typedef struct pw_field {
  const char *name;           /* as written in a model file */
  size_t offset;              /* in the definition structure */
  pw_field_type type;         /* double, double[2], double[2], const char *, pw_signal, int, const char *, pw_path * */
  int count;                  /* array length; 0 stands for 1 */
  const char *unit;           /* NULL: no unit */
  int required;               /* 1: required in a text model */
  pw_domain domain;           /* of a number */
  const char *const *choices; /* NULL-terminated names of a choice's values 0, 1, ... */
  const char *about;          /* meaning */
  size_t given; /* of an optional number: where an int of the definition is 1 if a text model gives it; 0: nowhere */
  int limit;    /* 1: a signal that limits a multiplier (pw_bounds); not one of pw_kind.signals, after these */
} pw_field;

/* Name and unit of the reaction of a constraint equation, or of an internal coordinate. */
typedef struct {
  const char *name;  /* "Fx" */
  const char *unit;  /* "N" */
  const char *rate;  /* internal coordinates only: the name of its velocity */
  const char *about; /* sign and meaning */
} pw_quantity;

/* An internal coordinate of an element, as `prepare` describes it. */
typedef struct {
  double mass;      /* its entry of M [kg m^2], >= 0; 0 only if the element's constraints determine the coordinate */
  double start;     /* initial value, in the unit of the coordinate */
  double rate;      /* initial velocity */
  int specified[2]; /* 1: the definition gives start, rate; 0: derived from other values */
} pw_internal;

/* Configuration and velocity of a body; the ground is at rest at the origin. */
typedef struct {
  double x, y, phi;     /* centre of mass [m], angle [rad] */
  double cos, sin;      /* of phi */
  double vx, vy, omega; /* [m/s], [rad/s] */
} pw_configuration;

/* All elements of one type in a system, the argument of its functions.  The `cols` local coordinates of an element
 * are (x, y, phi) of each of its bodies, then its internal coordinates.  Arrays are row-major, one element after the
 * other. */
typedef struct {
  int count;                             /* elements */
  int cols;                              /* 3 kind->bodies + kind->internal */
  const void *element;                   /* count structures of kind->element bytes, made by kind->prepare */
  const int *body;                       /* count x kind->bodies indices into configuration */
  const pw_configuration *configuration; /* of all bodies of the system and the ground */
  const double *q;                       /* count x kind->internal: internal coordinates */
  const double *v;                       /* count x kind->internal: their velocities */
  const double *u;      /* count x kind->signals x 3: value; only of a constraint's signal: two time derivatives, the
                         * second one only of a position constraint */
  const double *w;      /* count x cols: any vector w, for jw_q = d(J w)/dq only */
  const double *lambda; /* count x kind->rows: multipliers, for power and loss */
} pw_batch;

/* Fills one array for all elements of the batch. */
typedef void pw_batch_function (const pw_batch *b, double *out);

/* Placeholder for a second-order block, that is jw_q, eta_q, gamma_q, gamma_v, force_q or force_v of a type: the core
 * computes the block by differences. */
pw_batch_function pw_by_differences;
#define PW_BY_DIFFERENCES pw_by_differences

typedef enum {
  PW_FORCE,       /* no constraint equations; the default */
  PW_HOLONOMIC,   /* g (q, t) = 0 */
  PW_NONHOLONOMIC /* S (q, t) v = eta (t, q) */
} pw_level;

/* Limits of the multiplier of a constraint equation.  Between them the equation holds.  At one of them it is
 * not enforced: its multiplier is given, and u = J v - eta, of a holonomic equation u = g, stays >= 0 at the largest
 * multiplier, <= 0 at the smallest one. */
typedef struct {
  double least, most;   /* multipliers with which the equation holds; both 0: it never does */
  double sliding[2];    /* those given at the smallest and at the largest one; their magnitudes are not larger */
  double restitution;   /* of an infinite limit: velocity J v - eta after an impact over that before it, 0 to 1 */
  int circle;           /* 1, 2: first, second of two equations with opposite limits, those of the resultant */
  int initially_slides; /* 1: initial velocities need not satisfy the equation, as of friction; 0: they are changed so
                         * that it holds, unless they are specified */
  const pw_signal *signal[2]; /* of opposite limits that vary: their magnitude while the equation holds, and while it
                               * does not, in the definition (pw_field.limit), in place of the numbers above; or NULL */
  /* 1: the limits are multiples of the magnitude of the multiplier of equation `partner`, as of Coulomb friction. */
  int relative;
  int partner; /* set by the core: the first row of the element that this one accompanies; of that row, this one */
} pw_bounds;

/* An element type: one const table.  A NULL function is zero (the self-test verifies this); J of constraint equations
 * and g of holonomic ones are required.  Sizes are per element; at most 4 bodies, 4 internal coordinates, 6 constraint
 * equations, 4 signals. */
struct pw_kind {
  const char *name;       /* "pin" */
  const char *about;      /* one line */
  size_t definition;      /* bytes of the definition structure, whose first member is `const char *name` */
  size_t element;         /* bytes of the prepared element */
  const pw_field *fields; /* ends with a NULL name; the member `name` is not listed */
  int bodies;             /* bodies of an element: those that its fields of type PW_BODY name, or 1 if each_body */
  int internal;           /* internal coordinates */
  int rows;               /* constraint equations */
  int signals;   /* but those of limits; in the order of the fields; of its force if force_u is set, else of its rows */
  int each_body; /* 1: names no body, acts on every body with mass; its outputs are "air.frame.N" */
  int constant;  /* 1: its force is constant and evaluated once, when the system is compiled */
  pw_level level;    /* of its constraint equations */
  int first_order;   /* 1: the velocities of its internal coordinates are first-order states, which have no energy */
  int of_coordinate; /* 1: its signals, of constraints, are functions of its first internal coordinate, not of time */
  const pw_quantity *reaction;                                 /* rows: meaning of each -lambda */
  const pw_quantity *coordinate;                               /* internal: the internal coordinates, in "rad" or "" */
  const char *(*reaction_unit) (const void *element, int row); /* if it depends on the element; may be NULL */

  /* Converts a checked definition into a prepared element.  bodies: those it names or acts on, in order; the ground
   * is a body without mass.  internal: receives mass and initial values of each internal coordinate; zero before.
   * Returns a status.  May be NULL if element and internal are 0. */
  int (*prepare) (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                  pw_error *error);

  pw_batch_function *g;      /* rows: residual of holonomic constraint equations */
  pw_batch_function *g_size; /* rows: sum of the absolute values of the terms of g, its reference size */
  pw_batch_function *eta;    /* rows: right-hand side of J v = eta; holonomic: minus the partial derivative of g by t */
  pw_batch_function *J;      /* rows x cols */
  pw_batch_function *gamma;  /* rows: right-hand side of J a = gamma */
  /* J and gamma at once, with the same bits, where parts of them are common; may be NULL. */
  void (*J_gamma) (const pw_batch *batch, double *J, double *gamma);
  pw_batch_function *force;   /* cols: generalised force */
  pw_batch_function *force_u; /* cols x signals: derivative of the force with respect to the value of each signal */
  pw_batch_function *jw_q;    /* rows x cols: derivative of J w by q; with unit vectors w, that of J^T lambda */
  pw_batch_function *eta_q, *gamma_q, *gamma_v; /* rows x cols */
  /* For signals of velocity constraints that depend on states: derivatives with respect to the values of the signals,
   * of J: rows x cols x signals; of eta and gamma: rows x signals.  The term of the signals' rates in gamma is
   * (eta_u - J_u v) u'. */
  pw_batch_function *J_u, *eta_u, *gamma_u;
  pw_batch_function *force_q, *force_v; /* cols x cols */
  pw_batch_function *energy;            /* 1: potential energy [J] */
  pw_batch_function *power;             /* 1: power supplied to the system [W]; NULL: -lambda . eta */
  /* 1: dissipated power [W], >= 0; with limits of multipliers, round-off while their equations hold; NULL: impacts
   * alone dissipate energy, if there are limits. */
  pw_batch_function *loss;
  pw_batch_function *contact; /* 3: contact point, or point of a marker [m], and heading [rad]; for output */
  /* 2 cols, for forces that saturate, such as friction: the smallest change of each coordinate, then of each velocity,
   * that reverses the force or changes it by its own magnitude.  Entries are INFINITY before the call. */
  pw_batch_function *saturation;
  /* Strokes in figures, separated by ";" (core/cli/plot/plot_shapes.c); NULL: none.  Vertex "a x y": at the fraction a
   * of the way from the first body's point to the last body's, plus x along and y to the left of the heading, in units
   * of symbols.  "o a x y r": a circle of radius r.  "d n NAME": the disc of body n with the radius in field NAME. */
  const char *symbol;
  /* Sets the limits of an element's multipliers (rows), -INFINITY to INFINITY before the call; NULL: they stay so. */
  void (*limits) (const void *definition, pw_bounds *limit);
  /* The type that stands for this one where is_exact (definition) is not 0; with the same definition and fields. */
  const struct pw_kind *exact;
  int (*is_exact) (const void *definition);
  /* The type of an element that accompanies one of this type where has_companion (definition) is not 0, such as the
   * friction of a contact; with the same name, definition and fields, and relative limits (pw_bounds). */
  const struct pw_kind *companion;
  int (*has_companion) (const void *definition);
};

/* The number of values of a field, and the bytes of one value; 0 bytes: invalid type. */
static inline int pw_field_count (const pw_field *f) {
  return f->count > 0 ? f->count : 1;
}
size_t pw_field_bytes (pw_field_type type);

/* Value k (from 0) of a type in a definition, over all fields of that type; NULL if there are fewer. */
const void *pw_field_at (const pw_kind *kind, const void *definition, pw_field_type type, int k);

/* 1 if elements of the type influence the motion; 0 for markers. */
static inline int pw_kind_acts (const pw_kind *kind) {
  return kind->rows > 0 || kind->internal > 0 || kind->force != NULL;
}

/* 1 if its signals belong to a force, or to a limit (NULL): they may depend on states and need no time derivatives. */
static inline int pw_kind_signals_force (const pw_kind *kind) {
  return kind == NULL || kind->force_u != NULL;
}

/* 1 if they belong to a velocity constraint and may depend on positions and first-order states. */
static inline int pw_kind_signals_feedback (const pw_kind *kind) {
  return kind->level == PW_NONHOLONOMIC && kind->force_u == NULL && (kind->J_u || kind->eta_u);
}

/* For each built-in element type k: its table pw_kind_k, and pw_add_k, which is pw_add with that table. */
#define PW_KIND(k)                                                       \
  extern const pw_kind pw_kind_##k;                                      \
  static inline int pw_add_##k (pw_model *m, const pw_##k *definition) { \
    return pw_add (m, &pw_kind_##k, definition);                         \
  }
PW_KINDS
#undef PW_KIND

/* What stands for these types where Coulomb friction is exact, and where wheels slip (pw_kind.exact). */
extern const pw_kind pw_kind_dry_friction;
extern const pw_kind pw_kind_slipping_wheel;
extern const pw_kind pw_kind_dry_sliding_friction;

/* What accompanies a contact with friction (pw_kind.companion). */
extern const pw_kind pw_kind_contact_friction;

/* The built-in element types; ends with NULL. */
extern const pw_kind *const pw_kinds[];

/* ---- Creating and modifying models ---- */

/* Creates a model with default parameters.  `name` is copied; the table must outlive the model.  NULL and the error if
 * the table fails pw_plugin_check, or if out of memory. */
pw_model *pw_model_new (const char *name, const pw_plugin_table *table, pw_error *error);
void pw_model_free (pw_model *m);

/* Sets a parameter before pw_model_build.  Errors: PW_INPUT for an unknown name or a value outside its domain. */
int pw_model_set (pw_model *m, const char *parameter, double value, pw_error *error);

/* Runs the model's build function.  Errors: the model's first one, which may be of a body or element added; PW_INPUT
 * for a second call.  Values are checked by pw_system_compile. */
int pw_model_build (pw_model *m, pw_error *error);

/* Replaces a signal of a built model; pw_system_compile checks it.  field: "value", or "value[1]" if the field has
 * several.  PW_INPUT for an unknown element or field. */
int pw_model_set_signal (pw_model *m, const char *element, const char *field, const pw_signal *signal, pw_error *error);

/* Prescribes the initial value of a state, "frame.vx" or "wheel.spin", which the consistent initial state keeps if
 * possible; pw_system_compile checks the name.  Errors: PW_INPUT for a value that is not finite. */
int pw_model_set_initial (pw_model *m, const char *state, double value, pw_error *error);

/* ---- Contents of a model ---- */

const char *pw_model_name (const pw_model *m);
const pw_plugin_table *pw_model_table (const pw_model *m);
double pw_model_parameter (const pw_model *m, const pw_parameter *p); /* value of p, an entry of the model's table */

/* Bodies and elements of a built model, in the order added; valid until more are added. */
typedef struct {
  const pw_kind *kind;
  void *definition; /* kind->definition bytes; the first member is its name */
} pw_element;
const pw_body *pw_model_bodies (const pw_model *m, int *count);
const pw_element *pw_model_elements (const pw_model *m, int *count);
static inline const char *pw_element_name (const pw_element *e) {
  return *(const char *const *)e->definition;
}
const pw_named_output *pw_model_outputs (const pw_model *m, int *count);
int pw_model_initials (const pw_model *m); /* number of values set by pw_model_set_initial */

/* The points of a path of a text model (pw_path_open). */
typedef struct {
  const char *name;
  const double *x, *y; /* count */
  int count, interpolation, closed;
  const pw_path *path;
} pw_path_text;

/* Reference solution of a text model, expressions of time for some states; names and paths used in expressions. */
typedef struct {
  int states;                 /* 0: no reference solution */
  const char **state, **text; /* states: name, "bob.phi", and expression */
  int names;
  const char **name;                               /* names */
  double *value;                                   /* names: their values */
  int paths;                                       /* paths */
  pw_path_text *path;                              /* paths */
  double (*eval) (void *context, int i, double t); /* value of expression i at time t */
  void *context;
} pw_reference_text;
const pw_reference_text *pw_model_reference_text (const pw_model *m);          /* all zero if there is none */
void pw_model_set_reference (pw_model *m, const pw_reference_text *reference); /* must outlive the model */

/* ---- For build functions that read models from other sources ---- */

/* Frees an object together with the model.  If it returns PW_RESOURCE, the object has been freed already. */
int pw_model_keep (pw_model *m, void *object, void (*free_object) (void *object));

/* The first error of a model; a build function may set it. */
pw_error *pw_model_error (pw_model *m);

/* Check a body, an element and an output as pw_system_compile does, except whether names are unique, whether bodies of
 * the element and columns of the output exist, and what `prepare` checks.  Errors: PW_INPUT, beginning with
 * "model NAME: ". */
int pw_model_check_body (const pw_model *m, const pw_body *body, pw_error *error);
int pw_model_check_element (const pw_model *m, const pw_element *element, pw_error *error);
int pw_model_check_output (const pw_model *m, const pw_named_output *output, pw_error *error);

/* Writes the fault of a signal used by an element type, or "", to the buffer, which is returned.  *point: the faulty
 * point of a table, or -1. */
char *pw_signal_check (const pw_signal *s, const pw_kind *kind, int *point, char *buffer, size_t size);

/* Checks a plug-in's table: ABI, build function, texts and parameters.  Errors: PW_INPUT, beginning with `what`,
 * which is a path or "model NAME". */
int pw_plugin_check (const pw_plugin_table *table, const char *what, pw_error *error);

/* ---- The compiled system ---- */

/* A compiled system is never modified: any number of runs and threads may share it.  It does not refer to the model
 * it was compiled from; it does refer to element types and function signals. */
typedef struct pw_system pw_system;

/* What an evaluation modifies: configurations, J, values of signals, scratch memory.  Each run has one.  Use it from
 * one thread at a time; the system must outlive it. */
typedef struct pw_workspace pw_workspace;

/* Checks and compiles a built model.  Returns NULL and sets the error on failure. */
pw_system *pw_system_compile (const pw_model *m, pw_error *error);
void pw_system_free (pw_system *s);

/* Whether a built model has a reference solution (see pw_plugin_table), and its values at time t.  q and v:
 * pw_system_coordinates entries each; unknown ones are NaN.  Valid for the described initial conditions, not for
 * values of pw_model_set_initial.  Errors: PW_INPUT for a state the system does not have. */
int pw_model_has_reference (const pw_model *m);
int pw_system_reference (const pw_model *m, const pw_system *s, double t, double *q, double *v, pw_error *error);

/* Numbers of bodies; coordinates (entries of q and of v); constraint equations; holonomic ones, which come first. */
int pw_system_bodies (const pw_system *s);
int pw_system_coordinates (const pw_system *s);
int pw_system_rows (const pw_system *s);
int pw_system_holonomic (const pw_system *s);

/* Index of a body by name, or -1. */
int pw_system_find_body (const pw_system *s, const char *name);

/* Index of a state by name: i for coordinate q[i], n + i for velocity v[i], where n is the number of coordinates.
 * PW_INPUT and the error, with the nearest name, for an unknown state. */
int pw_system_find_state (const pw_system *s, const char *name, pw_error *error);

enum { PW_NAME_BYTES = 160 }; /* size of buffers in which every name of a system fits */

/* Name and unit of a state ("frame.vx", "m/s").  The name is written to the buffer, which is returned. */
char *pw_system_state_name (const pw_system *s, int state, char *buffer, size_t size);
const char *pw_system_state_unit (const pw_system *s, int state);

/* The number of first-order states.  Each is the velocity of one of the last coordinates; that coordinate itself, the
 * integral of the state, is hidden: it has no meaning and is in no table. */
int pw_system_states (const pw_system *s);
int pw_system_state_hidden (const pw_system *s, int state); /* 1 for such a coordinate */

/* Name and unit of the reaction of a constraint equation ("B.Fx", "N"), as pw_system_state_name. */
char *pw_system_reaction_name (const pw_system *s, int row, char *buffer, size_t size);
const char *pw_system_reaction_unit (const pw_system *s, int row);

/* The constraint equation whose reaction has this name; the reaction is -lambda[row] of a sample.  PW_INPUT and the
 * error, with the nearest name, if there is none. */
int pw_system_find_reaction (const pw_system *s, const char *name, pw_error *error);

/* The number of signals; name and unit of one ("rider.value", "N m"), as pw_system_state_name; 1 if it belongs to a
 * force. */
int pw_system_signals (const pw_system *s);
char *pw_system_signal_name (const pw_system *s, int signal, char *buffer, size_t size);
const char *pw_system_signal_unit (const pw_system *s, int signal);
int pw_system_signal_of_force (const pw_system *s, int signal);

/* What the user should know of a signal that is a table: that its times do not cover a run from 0 to t_end, or that
 * rows of its file are left out.  "torque T: value: ...", in the buffer, which is returned; "" if there is nothing. */
enum { PW_NOTICE_BYTES = 600 }; /* size of buffers in which it fits */
char *pw_system_table_notice (const pw_system *s, int signal, double t_end, char *buffer, size_t size);

/* The signal of this name; the name of an element suffices if the element has one signal.  PW_INPUT and the error, with
 * the nearest name, if there is none. */
int pw_system_find_signal (const pw_system *s, const char *name, pw_error *error);

/* Type and name of the element of a constraint equation ("wheel C"), as pw_system_state_name. */
char *pw_system_row_name (const pw_system *s, int row, char *buffer, size_t size);

/* Name of the model; name of a body; diagonal of M, one entry per coordinate [kg], [kg m^2]; length scale L [m]. */
const char *pw_system_name (const pw_system *s);
const char *pw_system_body_name (const pw_system *s, int body);
const double *pw_system_mass (const pw_system *s);
double pw_system_length (const pw_system *s);

/* 1 if a body has no inertia and nothing turns it: no constraint, force or signal depends on its angle or acts on it.
 * The angle is left out of the equations of motion and keeps its velocity. */
int pw_system_unturned (const pw_system *s, int body);

/* The initial conditions as described, or set by pw_model_set_initial: coordinates and velocities. */
const double *pw_system_initial_q (const pw_system *s);
const double *pw_system_initial_v (const pw_system *s);

/* 1 if multipliers may be discontinuous at time t: a force's signal may jump, or a constraint's signal or its first or
 * second derivative. */
int pw_system_jumps (const pw_system *s, double t);

/* Specialised code: C code for this system alone, which evaluates and projects it faster than the library
 * (pw_settings.specialised).  independent: for each constraint equation, 0 if it is redundant (pw_run_source); NULL:
 * none is redundant.  Free the text.  NULL and the error if a system cannot have such code, for example if it is too
 * large. */
char *pw_system_source (const pw_system *s, const unsigned char *independent, pw_error *error);
/* PW_OK; PW_INPUT if the system is too large for pw_system_source. */
int pw_system_check_source (const pw_system *s, pw_error *error);

/* 1 if compiled code has this library's interface to such code and is of a system with the same structure: parameters
 * and initial values may differ. */
typedef struct pw_specialised pw_specialised;
int pw_specialised_fits (const pw_specialised *code, const pw_system *s);

/* The text of pw_system_source compiled with PW_LANES defined as the number of runs that it advances at once
 * (pw_runs_advance): 2, 4 or PW_LANES_MOST. */
enum { PW_LANES_MOST = 8 };
typedef struct pw_specialised_lanes pw_specialised_lanes;
int pw_specialised_lanes_fit (const pw_specialised_lanes *code, const pw_system *s);
int pw_specialised_lanes_count (const pw_specialised_lanes *code);
/* Memory for the runs of one thread; NULL if out of memory.  Free it. */
void *pw_specialised_lanes_memory (const pw_specialised_lanes *code);
/* 1 if the code can be compiled for several runs at once: all element types are built-in, signals depend on time alone,
 * and the system is not too large.  The runs must not have redundant equations. */
int pw_system_has_lanes (const pw_system *s);
/* 1 if accelerations may be discontinuous within a step, at some states: an element type is from a plug-in, or a
 * signal depends on states. */
int pw_system_may_jump (const pw_system *s);

/* ---- Elements of a system, in the order of its constraint equations ---- */

/* An element that acts on every body appears once per body with mass. */
typedef struct {
  const char *name;
  const pw_kind *kind; /* kind->level is the type of its constraint equations */
  const int *body;     /* kind->bodies indices; the ground's index is the number of bodies */
  int row;             /* its first constraint equation, of kind->rows */
  int coordinate;      /* its first internal coordinate, of kind->internal */
  int contact;         /* index of its contact point or marker; -1: it has none */
  int force;           /* index in `out` of pw_workspace_forces of its first number */
} pw_element_info;
int pw_system_elements (const pw_system *s);
pw_element_info pw_system_element (const pw_system *s, int element);
int pw_system_row_element (const pw_system *s, int row); /* the element of a constraint equation */

/* A workspace for the functions below.  NULL and the error if out of memory. */
pw_workspace *pw_workspace_new (const pw_system *s, pw_error *error);
void pw_workspace_free (pw_workspace *w);

/* The functions below evaluate a state.  Errors: PW_METHOD if a signal fails, PW_RESOURCE. */

/* Number of elements with a place on the ground, which is the contact point of a wheel or tyre, or the point of a
 * marker; place (x, y) [m] and heading [rad] of each. */
int pw_system_contacts (const pw_system *s);
/* Name of x (i = 0) or y (1) of the first contact point, "W.x", of the next (2, 3) etc., as pw_system_state_name. */
char *pw_system_contact_name (const pw_system *s, int i, char *buffer, size_t size);
int pw_workspace_contact_points (pw_workspace *w, double t, const double *q, const double *v, double (*out)[3],
                                 pw_error *error);

/* The force (Fx, Fy [N], M [N m] about the centre of mass) of each element on each of its bodies: -J^T lambda plus the
 * applied force; meaningless for the ground.  out: pw_system_force_size numbers, three per body of each element. */
int pw_system_force_size (const pw_system *s);
int pw_workspace_forces (pw_workspace *w, double t, const double *q, const double *v, const double *lambda, double *out,
                         pw_error *error);

/* The equations M a + J^T lambda = f,  J v = eta,  J a = gamma at a state.  J is sparse: the entries of each element
 * row by row, including those that are 0 at this state, at most one for each row and column. */
typedef struct {
  int coordinates, rows, holonomic, entries;
  double *mass, *force; /* coordinates: diagonal of M; f */
  double *g;            /* holonomic */
  double *eta, *gamma;  /* rows */
  int *row, *column;    /* entries: indices in J, from 0 */
  double *value;        /* entries */
} pw_equations;
int pw_system_equations (const pw_system *s, double t, const double *q, const double *v, pw_equations *out,
                         pw_error *error);
void pw_equations_free (pw_equations *e); /* required even after an error */

/* Number of blocks of a plug-in's types given as PW_BY_DIFFERENCES; name of one, as pw_system_state_name: "force_q of
 * element type drag". */
int pw_system_differences (const pw_system *s);
char *pw_system_difference_name (const pw_system *s, int i, char *buffer, size_t size);

PW_END

#endif
