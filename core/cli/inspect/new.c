/* pinwheel new: writes a small commented model to begin with. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "cli.h"

/* The model file after its first line. */
static const char new_text[] =
    " * Try:  pinwheel show ./%s.c\n"
    " *       pinwheel run ./%s.c --set torque=0.15 -o %s.csv\n"
    " *\n"
    " * Units are SI, angles are radians, counter-clockwise. */\n"
    "#include \"pinwheel.h\"\n"
    "\n"
    "/* The numbers of the model.  All of them are doubles, and can be changed with --set NAME=VALUE. */\n"
    "typedef struct {\n"
    "  double mass, load, hitch, bar, speed, torque, omega;\n"
    "} numbers;\n"
    "\n"
    "/* Of each: default, unit, meaning, and which values make sense. */\n"
    "static const pw_parameter parameters[] = {\n"
    "  { PW_AT (numbers, mass), 2, \"kg\", \"mass of the car\", PW_POSITIVE },\n"
    "  { PW_AT (numbers, load), 1, \"kg\", \"mass of the trailer\", PW_POSITIVE },\n"
    "  { PW_AT (numbers, hitch), 0.4, \"m\", \"hitch behind the centre of mass of the car\", PW_NONNEGATIVE },\n"
    "  { PW_AT (numbers, bar), 0.6, \"m\", \"hitch ahead of the centre of mass of the trailer\", PW_POSITIVE },\n"
    "  { PW_AT (numbers, speed), 1, \"m/s\", \"speed of the car at the start\", PW_REAL },\n"
    "  { PW_AT (numbers, torque), 0.1, \"N m\", \"amplitude of the torque in the hitch\", PW_REAL },\n"
    "  { PW_AT (numbers, omega), 2 * PW_PI, \"rad/s\", \"angular frequency of that torque\", PW_REAL },\n"
    "  { .name = NULL }, /* the end */\n"
    "};\n"
    "\n"
    "/* Says what there is.  A body's frame sits at its centre of mass; points are given in that frame. */\n"
    "static void build (pw_model *m, const void *given) {\n"
    "  const numbers *p = given;\n"
    "\n"
    "  /* Two bodies, with where they are (x, y, phi) and how they move (vx, vy, omega) at the start. */\n"
    "  pw_add_body (m, &(pw_body){ .name = \"car\", .mass = p->mass, .inertia = 0.1, .rate = { p->speed, 0, 0 } });\n"
    "  pw_add_body (m, &(pw_body){ .name = \"trailer\",\n"
    "                              .mass = p->load,\n"
    "                              .inertia = 0.05,\n"
    "                              .start = { -(p->hitch + p->bar), 0, 0 },\n"
    "                              .rate = { p->speed, 0, 0 } });\n"
    "\n"
    "  /* A point of one body and a point of the other coincide.  \"ground\" may stand for one of the two. */\n"
    "  pw_add_pin (m, &(pw_pin){ .name = \"H\", .body = { \"car\", \"trailer\" }, .at = { { -p->hitch, 0 }, { p->bar, "
    "0 } } });\n"
    "\n"
    "  /* Knife edges: these points do not move sideways. */\n"
    "  pw_add_wheel (m, &(pw_wheel){ .name = \"A\", .body = \"car\", .at = { 0, 0 } });\n"
    "  pw_add_wheel (m, &(pw_wheel){ .name = \"C\", .body = \"trailer\", .at = { 0, 0 } });\n"
    "\n"
    "  /* torque cos (omega t) on the car, and its opposite on the trailer. */\n"
    "  pw_add_torque (m, &(pw_torque){ .name = \"drive\",\n"
    "                                  .body = { \"car\", \"trailer\" },\n"
    "                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = p->torque, .omega = p->omega "
    "} } });\n"
    "}\n"
    "\n"
    "/* How Pinwheel finds all this.  .run says what `pinwheel run` does without options. */\n"
    "PW_MODEL (.about = \"a car and its trailer, wriggling\",\n"
    "          .parameters = parameters,\n"
    "          .parameters_size = sizeof (numbers),\n"
    "          .run = { .t_end = 20, .step = 1e-3, .method = \"rk4+projection\" },\n"
    "          .build = build);\n";

/* The same as text, after its first lines. */
static const char new_yaml[] =
    "# Units are SI, angles are radians, counter-clockwise.\n"
    "pinwheel: 1 # the version of the format\n"
    "about: a car and its trailer, wriggling\n"
    "\n"
    "# What `pinwheel run` does without options.\n"
    "run: {t_end: 20, step: 1e-3, method: rk4+projection}\n"
    "\n"
    "# The numbers of the model.  They can be changed with --set NAME=VALUE.\n"
    "parameters:\n"
    "  - {name: mass, value: 2, unit: kg, domain: positive, about: mass of the car}\n"
    "  - {name: load, value: 1, unit: kg, domain: positive, about: mass of the trailer}\n"
    "  - {name: hitch, value: 0.4, unit: m, domain: nonnegative, about: hitch behind the centre of mass of the car}\n"
    "  - {name: bar, value: 0.6, unit: m, domain: positive, about: hitch ahead of the centre of mass of the trailer}\n"
    "  - {name: speed, value: 1, unit: m/s, about: speed of the car at the start}\n"
    "  - {name: torque, value: 0.1, unit: N m, about: amplitude of the torque in the hitch}\n"
    "  - {name: omega, value: 2*pi, unit: rad/s, about: angular frequency of that torque}\n"
    "\n"
    "# A body's frame sits at its centre of mass.  start: x, y, phi; rate: vx, vy, omega; what is left out is 0.  Any "
    "number\n"
    "# may be an expression of the parameters.\n"
    "bodies:\n"
    "  - {name: car, mass: mass, inertia: 0.1, rate: {vx: speed}}\n"
    "  - {name: trailer, mass: load, inertia: 0.05, start: {x: -(hitch + bar)}, rate: {vx: speed}}\n"
    "\n"
    "# Each begins with its kind and its name; `pinwheel list kinds` shows what there is, `list kinds pin` all about "
    "one.\n"
    "elements:\n"
    "  # A point of one body and a point of the other coincide.  ground may stand for one of the two.\n"
    "  - {pin: H, body: [car, trailer], at: [[-hitch, 0], [bar, 0]]}\n"
    "\n"
    "  # Knife edges: these points do not move sideways.\n"
    "  - {wheel: A, body: car, at: [0, 0]}\n"
    "  - {wheel: C, body: trailer, at: [0, 0]}\n"
    "\n"
    "  # torque cos (omega t) on the car, and its opposite on the trailer.\n"
    "  - {torque: drive, body: [car, trailer], value: {harmonic: {amplitude: torque, omega: omega}}}\n";

/* "folder/my_car.c" gives "my_car" and ".c"; PW_INPUT if a model could not be found under that name. */
static int new_name (const char *path, char *name, size_t size, const char **ending, pw_error *error) {
  const char *base = strrchr (path, '/');
  base = base ? base + 1 : path;
  size_t n = strspn (base, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-");
  *ending = base + n;
  if (n == 0 || n >= size || base[0] == '-' || (strcmp (*ending, ".c") != 0 && strcmp (*ending, ".yaml") != 0))
    return pw_fail (error, PW_INPUT,
                    "\"%s\": a model file's name is made of letters, digits, _ and -, and ends in .c or .yaml", path);
  snprintf (name, size, "%.*s", (int)n, base);
  return PW_OK;
}

static void new_print (FILE *f, const char *name, int yaml) {
  const char *title = "a car and its trailer, held together by a pin, each on a knife edge";
  if (yaml) {
    fprintf (f, "# %s: %s.\n#\n", name, title);
    fprintf (f, "# Try:  pinwheel show ./%s.yaml\n#       pinwheel run ./%s.yaml --set torque=0.15 -o %s.csv\n#\n",
             name, name, name);
    fputs (new_yaml, f);
  } else {
    fprintf (f, "/* %s: %s.\n *\n", name, title);
    fprintf (f, new_text, name, name, name);
  }
}

static int new_write (const char *path, pw_error *error) {
  char name[100];
  const char *ending;
  if (new_name (path, name, sizeof name, &ending, error) != PW_OK) return PW_INPUT;
  FILE *f = fopen (path, "wx"); /* never over a file that is there */
  if (f == NULL && errno == EEXIST)
    return pw_fail (error, PW_INPUT, "%s is there already; it has been left as it is", path);
  if (f == NULL) return pw_fail (error, PW_MACHINE, "cannot write %s: %s", path, strerror (errno));
  new_print (f, name, ending[1] == 'y');
  errno = 0;
  int bad = fflush (f) != 0 || ferror (f), why = errno;
  if (fclose (f) != 0 && !bad) bad = 1, why = errno;
  if (bad) {
    remove (path);
    return pw_fail (error, PW_MACHINE, "cannot write %s: %s", path, strerror (why));
  }
  pw_cli_print (stdout, "%s is written; now:  pinwheel run %s%s\n", path, strchr (path, '/') ? "" : "./", path);
  return PW_OK;
}

static int new_command (void *options, pw_error *error) {
  return new_write (((const pw_cli_line *)options)->argument[0], error);
}

const pw_command pw_cli_new = {
  .name = "new",
  .synopsis = "NAME.c|NAME.yaml",
  .summary = "write a small commented model to start from",
  .help = "Write a small commented model, in C or as text, to start from. Existing files are never overwritten.",
  .least = 1,
  .most = 1,
  .size = sizeof (pw_cli_line),
  .function = new_command,
  .options = (const struct poptOption[]){ POPT_TABLEEND },
};
