#!/bin/sh
# Scenes of any size on the sparse path: programs of tests with a library that has no dense path.
# Run from the top folder; reads BUILD.

large=${BUILD:-build}/variant/large
unset MAKEFLAGS MAKELEVEL MFLAGS
. "$(dirname "$0")/../support/report.sh"

tests=
for t in saddle start redundant singular hub agree weld rod slider gear drive rolling kinds vehicles restart project random; do
  tests="$tests $large/tests/test_$t"
done
# shellcheck disable=SC2086
make NO_DEPS=1 BUILD="$large" CPPFLAGS="$CPPFLAGS -DPW_DENSE_MOST=0" all $tests >"$work/log" 2>&1
report 'a library without the dense path' $?
[ $bad = 0 ] || exit $bad

for t in $tests; do
  PINWHEEL=$large/pinwheel BUILD=$large timeout 600 "$t" >"$work/log" 2>&1 </dev/null
  report "large: ${t##*/}" $?
done
exit $bad
