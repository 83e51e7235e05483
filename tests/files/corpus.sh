#!/bin/sh
# What fuzzing began with and has found, through each target once more.  Reads BUILD.

. "$(dirname "$0")/../support/report.sh"

for target in "${BUILD:-build}"/fuzz/*; do
  name=$(basename "$target")
  case $name in *.*) continue ;; esac
  more=
  [ "$name" != model ] || more="models tests/models $work/bad-models"
  sh tests/support/entries.sh unpack "tests/fuzz/$name.txt" "$work/$name" >"$work/log" 2>&1 &&
    sh tests/support/entries.sh unpack tests/bad-models.txt "$work/bad-models" >"$work/log" 2>&1 &&
    timeout 300 "$target" "$work/$name" $more >"$work/log" 2>&1
  status=$?
  report "$name: $(tail -n 1 "$work/log" | sed "s,^$work/,,")" $status
done
exit $bad
