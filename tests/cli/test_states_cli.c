/* First-order states and feedback in every command that reads a model. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "cli.h"

const check_fixture fixture = { cli_setup, cli_teardown };

/* An oscillator that a lagging actuator drives: f' = (cos 2t - f)/0.3, x'' = f - 4 x - 0.4 x'. */
static const char actuator[] =
    "pinwheel: 1\n"
    "parameters: [{name: lag, value: 0.3, unit: s, domain: positive}]\n"
    "bodies: [{name: block, mass: 1, inertia: 1}]\n"
    "elements:\n"
    "  - {slider: rail, body: [block, ground], at: [[0, 0], [0, 0]]}\n"
    "  - {spring: S, body: [ground, block], at: [[-3, 0], [0, 0]], stiffness: 4, damping: 0.4, length: 3}\n"
    "  - {force: F, body: block, at: [0, 0], fx: f}\n"
    "states: [{name: f, rate: (cos(2*t) - f)/lag, unit: N, start: 0.2}]\n";

/* A car whose steering follows its lateral position. */
static const char car[] = "pinwheel: 1\n"
                          "bodies: [{name: car, mass: 2, inertia: 0.5, start: {y: 1, phi: 0}}]\n"
                          "elements:\n"
                          "  - {wheel: R, body: car, at: [-0.4, 0]}\n"
                          "  - {speed: X, body: car, at: [-0.4, 0], value: 1}\n"
                          "  - {steered-wheel: F, body: car, at: [0.6, 0], heading: delta}\n"
                          "states: [{name: delta, rate: (-atan (car.y) - car.phi - delta)/0.2, unit: rad}]\n";

TEST (every_command) {
  cli_write ("a.yaml", actuator);
  cli_write ("c.yaml", car);
  cli_good ("pinwheel run @/a.yaml -t 2 -o @/a.csv --plots @/plots --animate @/a.html --json @/a.json --error");
  cli_shows ("f  ");
  assert_non_null (strstr (cli_file ("a.csv"), ",f [N],"));
  assert_null (strstr (cli_file ("a.csv"), "integral"));
  assert_null (strstr (cli_file ("a.json"), "f.integral"));
  assert_non_null (strstr (strstr (cli_file ("a.html"), "\"outputs\": ["), "\"name\": \"f\""));
  assert_non_null (strstr (strstr (cli_file ("a.html"), "\"output\": ["), "\n    0.2")); /* its initial value */
  assert_non_null (cli_file ("plots/outputs.svg"));
  cli_shell ("pinwheel run @/c.yaml -t 2 -o @/c.npz --plots @/plots2 --animate @/c.html");
  cli_shell ("pinwheel check @/a.yaml && pinwheel check @/c.yaml");
  cli_good ("pinwheel show @/a.yaml && pinwheel show --matrices @/a.yaml");
  cli_write ("bare.yaml", "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nstates: [{name: z, rate: 1}]\n");
  cli_good ("pinwheel show @/bare.yaml");
  cli_shell ("pinwheel linearise @/c.yaml -o @/l");
  cli_good ("pinwheel run @/a.yaml -t 1 --start f=1");
  cli_good ("pinwheel sweep @/a.yaml -t 1 --vary f=0:1:3 -o @/s.csv");
  assert_non_null (strstr (cli_file ("s.csv"), "f [N]"));
  cli_good ("pinwheel sensitivity @/a.yaml -t 1 --by lag --by f --of f --of block.x -o @/sens/sensitivity.csv --json "
            "@/sens/sensitivity.json --plots @/sens");
  cli_shell ("pinwheel compare @/a.yaml -t 1 --methods rk4,erk8");
  cli_good ("pinwheel run @/a.yaml -t 1 --specialise always");
}

/* Text that `show --yaml` writes describes the same model. */
TEST (round_trip) {
  cli_write ("a.yaml", actuator);
  cli_good ("pinwheel show --yaml @/a.yaml >@/b.yaml && pinwheel run @/b.yaml -t 1 -o @/b.csv && "
            "pinwheel run @/a.yaml -t 1 -o @/a.csv && cmp @/a.csv @/b.csv");
}

/* The state x = Re (X exp (2 i t)), f = Re (F exp (2 i t)) with F = 1/(1 + 0.6 i), X = F/(0.8 i). */
TEST (periodic) {
  cli_write ("a.yaml", actuator);
  cli_good ("pinwheel periodic @/a.yaml --period pi -o @/per/periodic.csv --json @/per/periodic.json --plots @/per");
  const char *json = cli_file ("per/periodic.json");
  check_close ("f", cli_number (json, "start", "f", NULL), 0.7352941176470589, 1e-12, "the search's rtol");
  check_close ("x", cli_number (json, "start", "block.x", NULL), -0.5514705882352942, 1e-12, "the search's rtol");
  assert_non_null (strstr (json, "\"symmetries\": 0"));
}
