#!/bin/sh
# What fuzzing began with and has found, through each target once more.  Reads BUILD.

build=${BUILD:-build} bad=0
log=$(mktemp) || exit 1
trap 'rm -f "$log"' EXIT
for target in "$build"/fuzz/*; do
  name=$(basename "$target")
  case $name in *.*) continue ;; esac
  more=
  [ "$name" != model ] || more='models tests/models tests/bad-models'
  if timeout 300 "$target" "tests/fuzz/corpus/$name" $more >"$log" 2>&1; then
    echo "ok $name: $(tail -n 1 "$log")"
  else
    echo "not ok $name"
    tail -n 20 "$log"
    bad=1
  fi
done
exit $bad
