/* A model as text, from the file to some steps of a run; mutated by lines and words as well as by bytes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fuzz.h"
#include "model.h"
#include "pinwheel-files.h"
#include "pinwheel-analysis.h"
#include "system.h"

/* A few steps: what a description can do to the solvers. */
static void model_run (pw_system *s, const char *method) {
  pw_error error = { 0 };
  pw_settings settings = { .step = 1e-3, .span = 1e-2, .ledger = 1 };
  pw_run *r = s->coords <= 60 && s->rows <= 60 ? pw_run_open (s, method, &settings, &error) : NULL;
  for (int i = 0; r && i < 3 && error.status == PW_OK; i++) pw_run_advance (r, 1, &error);
  pw_linear linear = { .A = NULL };
  if (r && pw_run_linearise (r, 20, &linear, &(pw_error){ 0 }) == PW_OK && linear.A)
    for (int i = 0; i < linear.unknowns; i++)
      if (isinf (linear.re[i]) || isinf (linear.im[i])) abort ();
  pw_linear_free (&linear);
  if (r) pw_run_close (r);
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const char *const methods[] = { "rk4+projection", "ida+ggl",   "erk5+nullspace",
                                         "galpha+ggl",     "radau+ggl", "bdf+projection" };
  pw_error error = { 0 };
  pw_file *file = pw_file_open (fuzz_file (data, size, ".yaml"), &error);
  pw_model *m = file ? pw_file_model (file, &error) : NULL;
  pw_system *s = m && pw_model_build (m, &error) == PW_OK ? pw_system_compile (m, &error) : NULL;
  if (s == NULL && error.status >= 0) abort (); /* what fails says so */
  if (s) model_run (s, methods[size % (sizeof methods / sizeof *methods)]);
  pw_system_free (s);
  pw_model_free (m);
  pw_file_close (file);
  return 0;
}

/* ---- Mutations along the grammar ---- */

static fuzz_grammar model_rules[] = {
  "m:pinwheel: 1\nbodies:\n$b`$h$p$l"
  "bodies:\n$b$b$belements:\n$k`$h$p$l"
  "bodies:\n$b$b"
  "elements:\n$k$k$k$k",
  "h:pinwheel: 1\nabout: $w\nrun: {t_end: $n, step: $n}\n`pinwheel: 1\n",
  "p:`parameters:\n$q$q",
  "q:  - {name: $w, value: $e}\n`  - {name: $w, value: $n, unit: $u, domain: positive}\n`  - {name: $w, value: $n, "
  "min: $n}\n",
  "l:`let: {$w: $e, $w: $e}\n`let:\n  $w: $e\n",
  "b:  - {name: $w, mass: $n, inertia: $n, start: {x: $e, y: $e, phi: $e}}\n`  - {name: $w, mass: $e, inertia: "
  "$e}\n`$b$b"
  "`  - {name: $w, mass: $n, inertia: $n, rate: {vx: $e, omega: $e}}\n",
  "k:  - {gravity: $w, acceleration: [0, -9.81]}\n`$k$k`  - {pin: $w, body: [$w, $w], at: [$a, $a]}\n"
  "`  - {wheel: $w, body: $w, at: $a, heading: $e}\n`  - {torque: $w, body: [$w, $w], value: $s}\n"
  "`  - {force: $w, body: $w, fx: $s, fy: $s}\n`  - {drive: $w, body: [$w, $w], at: [$a, $a], what: angle, value: $s}\n"
  "`  - {spring: $w, body: [$w, $w], at: [$a, $a], stiffness: $e, damping: $e, length: $e}\n"
  "`  - {weld: $w, body: [$w, $w], at: [$a, $a]}\n`  - {rod: $w, body: [$w, $w], at: [$a, $a]}\n"
  "`  - {slider: $w, body: [$w, $w], at: [$a, $a]}\n`  - {friction: $w, body: [$w, $w], limit: $e}\n"
  "`  - {motor: $w, body: [$w, $w], stiffness: $e, damping: $e, angle: $s, rate: $s}\n`  - $y\n",
  "s:$e`{expression: $e}`{expression: $e, rate: $e, acceleration: $e}`{constant: $e}`{harmonic: {amplitude: $e, omega: "
  "$e}}"
  "`{ramp: {from: $e, to: $e, duration: $e}}`{table: {points: [$a, $a, [2, $e]], interpolation: cubic, ends: rest}}"
  "`{table: {points: [[0, $e], [1, $e]], scale: $e, offset: $e}}`{pulse: {height: $e, width: $e, period: $e}}",
  "a:[0, 0]`[$e, $e]`[$n, $n]",
  "e:$n`$n`t`$w`$w.phi`$w.omega`$e*$e`$e + $e`-$e`sin($e)`abs($e)`$e > $e ? $e : $e`min($e, "
  "$e)`sqrt($e)`floor($e)`($e)^$n",
  "n:1`0`2`0.5`-1`1e-3`10`pi`1e308`1e-320",
  "w:A`B`C`D`ground`E",
  "u:m`kg`rad`N m/rad",
  "y:1`{$w: $y}`[$y, $y]`{$w: $y, $w: $y}`\"$w\"`'$w'`&$w $y`*$w`!!str $y`[[[[$y]]]]`{{$y: $y}: $y}`|\n  $w\n`? $y\n: "
  "$y",
  NULL
};

size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed) {
  return fuzz_mutate (model_rules, data, size, most, seed);
}
