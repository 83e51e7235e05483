#!/bin/sh
# What fuzzing began with and has found, through each target once more.  Reads BUILD.

. "$(dirname "$0")/../support/report.sh"

for target in "${BUILD:-build}"/fuzz/*; do
  name=$(basename "$target")
  case $name in *.*) continue ;; esac
  more=
  [ "$name" != model ] || more='models tests/models tests/bad-models'
  timeout 300 "$target" "tests/fuzz/corpus/$name" $more >"$work/log" 2>&1
  report "$name: $(tail -n 1 "$work/log")" $?
done
exit $bad
