#!/bin/sh
# Hard cases by the methods that are to be relied on, against the verdicts expected of them; `make hard` has all methods.
# Reads BUILD.

build=${BUILD:-build} bad=0
log=$(mktemp) || exit 1
trap 'rm -f "$log"' EXIT
for method in '*+projection' ida+ggl; do
  if "$build/benchmarks/hard" -m "$method" benchmarks/hard >"$log" 2>&1; then
    echo "ok $method on every hard case"
  else
    echo "not ok $method on every hard case"
    cat "$log"
    bad=1
  fi
done
exit $bad
