#!/bin/sh
# Hard cases by the methods that are to be relied on, against the verdicts expected of them; `make hard` has all methods.
# Reads BUILD.

. "$(dirname "$0")/../support/report.sh"

for method in '*+projection' ida+ggl; do
  "${BUILD:-build}/benchmarks/hard" -m "$method" benchmarks/hard >"$work/log" 2>&1
  report "$method on every hard case" $?
done
"${BUILD:-build}/benchmarks/hard" -s -m 'rk4+projection' benchmarks/hard >"$work/log" 2>&1
report 'rk4+projection on specialised scenes of every hard case' $?
exit $bad
