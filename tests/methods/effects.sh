#!/bin/sh
# An effect that is not used costs nothing: the EzyRoller takes the same instructions, to the last one, from a library with
# all kinds as from one that has only those it needs.
# Run from the top folder; reads BUILD.

BUILD=${BUILD:-build}
unset MAKEFLAGS MAKELEVEL MFLAGS
command -v valgrind >/dev/null || { echo '# valgrind is not there: not tried'; exit 0; }
. "$(dirname "$0")/../support/report.sh"

make NO_DEPS=1 BUILD="$BUILD" bench-effects >"$work/log" 2>&1
status=$?
cat "$work/log"
grep -qx 'all kinds:.* gravity.*' "$work/log" && grep -qx 'few kinds: pin wheel torque' "$work/log"
report 'two libraries, one with all kinds and one with three' $?
grep -qx 'the same to the instruction' "$work/log" && [ $status = 0 ]
report 'kinds that are not used take no instruction' $?
awk '/^with one effect more/ { after = 1; next } /^an event/ { after = 0 } after && NF && $(NF - 3) > 0 { n++ } END { exit n != 9 }' "$work/log"
report 'each effect is counted' $?
awk '/^a grip/ { held = $NF == 0 && $(NF - 1) == 0 } /in evaluations/ { n += $(NF - 1) > 0 && $(NF - 1) < 30 } END { exit !held || n != 2 }' "$work/log"
report 'a grip that holds takes no instruction, an event less than 30 evaluations' $?
! "$BUILD/benchmarks/effects" --help >"$work/log" 2>&1 && grep -q 'usage: effects' "$work/log"
report 'an option is not taken for a folder' $?
exit $bad
