#!/bin/sh
# The instructions of docs/adding.md, in a copy of the sources: a model, an element type, a Runge-Kutta tableau and another
# one-step method, each one file and at most one line in a list.  Reads PINWHEEL, CC.  (In an installed tree: install.sh.)

. "$(dirname "$0")/../support/report.sh"

tree=$work/tree
mkdir "$tree" && cp -R Makefile .ci core solvers models docs "$tree" && cd "$tree" || exit 1

"$pinwheel" new models/arm.c >"$work/log" 2>&1

sed 's/torque/twist/g' core/kinds/forces/torque.c >core/kinds/forces/twist.c
sed -e '/^#define PW_KINDS/i typedef struct {\n  const char *name;\n  const char *body[2];\n  pw_signal value;\n} pw_twist;\n' \
  -e 's/PW_KIND (torque) /PW_KIND (torque) PW_KIND (twist) /' core/pinwheel.h >"$work/h" && mv "$work/h" core/pinwheel.h

# Kutta's 3/8 rule (1901).
sed -e 's/rk4/kutta38/g' -e 's/_c\[\] = .*/_c[] = { 0, 1. \/ 3, 2. \/ 3, 1 };/' -e 's/_A\[\] = .*/_A[] = { 1. \/ 3, -1. \/ 3, 1, 1, -1, 1 };/' \
  -e 's/_b\[\] = .*/_b[] = { 1. \/ 8, 3. \/ 8, 3. \/ 8, 1. \/ 8 };/' solvers/rk/rk4.c >solvers/rk/kutta38.c
sed -e '/pinwheel-files/d; /^static const pw_method \*const methods/,$d' -e 's/^static const pw_method kutta3 /const pw_method pw_method_kutta3 /' \
  docs/method.c >solvers/rk/kutta3.c
sed 's/PW_METHOD (rk4) /PW_METHOD (rk4) PW_METHOD (kutta38) PW_METHOD (kutta3) /' solvers/methods.h >"$work/h" && mv "$work/h" solvers/methods.h

make -s NO_DEPS=1 CC="${CC:-cc}" CFLAGS=-O0 BUILD=build all >"$work/log" 2>&1
report 'the tree with another model, another element type and two other methods' $?
added=build/pinwheel
unset PINWHEEL_MODELS

$added list models >"$work/log" 2>&1 && grep -q '^ *arm ' "$work/log" && $added check arm >"$work/log" 2>&1
report 'the model' $?

cat >twisted.yaml <<'EOF'
pinwheel: 1
bodies: [{name: disc, mass: 1, inertia: 0.1}]
elements: [{twist: T, body: [disc, ground], value: 0.2}]
EOF
$added check ./twisted.yaml >"$work/log" 2>&1 && grep -q '^ *twist (1 element) *good' "$work/log" && $added list kinds twist >>"$work/log" 2>&1
report 'the element type, with its self-test' $?

# order METHOD ORDER: with half the step the error is 2^ORDER times smaller; x, y and phi of the pendulum at 1 s
order () {
  for h in 0.02 0.01; do
    $added run pendulum -m "$1" -t 1 --step $h --every 1 -o - 2>"$work/log" | tail -n 1 | cut -d, -f2-4
  done >"$work/runs"
  $added run pendulum -m rk4 -t 1 --step 1e-3 --every 1 -o - | tail -n 1 | cut -d, -f2-4 >>"$work/runs"
  awk -F, -v order="$2" '{ x[NR] = $1 } END { p = log ((x[1] - x[3]) / (x[2] - x[3])) / log (2); print "order", p
    exit !(p > order - 0.2 && p < order + 0.2) }' "$work/runs" >>"$work/log"
}
order kutta38 4
report 'the tableau, of order 4' $?
order kutta3 3
report 'the one-step method, of order 3' $?
for m in kutta38+nullspace kutta3+projection; do $added run pendulum -m $m -t 0.1 || exit 1; done >"$work/log" 2>&1
report 'with stabilisations' $?

exit $bad
