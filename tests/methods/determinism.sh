#!/bin/sh
# The same bits from every build: gcc -O0, gcc -O2, clang -O2, and gcc -O3 for this very processor; from every run of one
# build, whatever was in its memory; from any number of threads.  Hashes of whole tables: every step, every state.
# Run from the top folder; reads BUILD.

BUILD=${BUILD:-build}
builds=$BUILD/variant/bits
. "$(dirname "$0")/../support/report.sh"
unset MAKEFLAGS MAKELEVEL MFLAGS CFLAGS CPPFLAGS LDFLAGS

# build NAME CC CFLAGS: the program and the scenes of the tests
build () {
  make NO_DEPS=1 BUILD="$builds/$1" CC="$2" CFLAGS="$3" all >"$work/log" 2>&1 || { cat "$work/log"; return 1; }
  mkdir -p "$builds/$1/scenes"
  for s in chain zoo; do
    # shellcheck disable=SC2086
    $2 -std=c11 -ffp-contract=off $3 -fPIC -shared -I "$builds/$1/include" -o "$builds/$1/scenes/$s.so" tests/scenes/$s.c ||
      return 1
  done
}

# hashes NAME: a line per run with the hash of its table, "-" for the scene if it could not be run
hashes () {
  p=$builds/$1/pinwheel
  for method in rk4+none rk4+projection rk4+projection:metric=identity rk4+baumgarte ida+none ida+baumgarte ida+ggl; do
    for scene in 'ezyroller --t-end 3' 'ezyroller --t-end 3 --set m2=0.1 --set I2=0.01' "$builds/$1/scenes/zoo.so --t-end 3" \
      "$builds/$1/scenes/chain.so --t-end 2" "$builds/$1/scenes/chain.so --t-end 0.05 --set links=300 --every 0.05"; do
      # shellcheck disable=SC2086
      "$p" run $scene --energy --method $method -o "$work/table.csv" 2>"$work/err" || { cat "$work/err" >&2; rm -f "$work/table.csv"; }
      echo "$method ${scene##*/} $(cksum <"$work/table.csv")"
    done
  done
}

# ---- One build ----

build gcc-O2 gcc -O2
report 'gcc -O2' $?
hashes gcc-O2 >"$work/reference"
cat "$work/reference"
[ "$(wc -l <"$work/reference")" = 35 ] && [ "$(cut -d' ' -f3- "$work/reference" | sort -u | wc -l)" = 35 ]
report 'every run has a table, and they differ' $?

export MALLOC_PERTURB_=165
hashes gcc-O2 | cmp - "$work/reference"
report 'once more, on memory that is not zero' $?
unset MALLOC_PERTURB_

for method in rk4+projection ida+ggl ida+baumgarte; do
  for scene in ezyroller\ --vary\ omega=1:4:12 "$builds/gcc-O2/scenes/zoo.so --vary torque=0:1:12" \
    "$builds/gcc-O2/scenes/chain.so --vary links=1,2,3,20,30,40"; do
    for jobs in 1 2 3 8; do
      # shellcheck disable=SC2086
      "$builds/gcc-O2/pinwheel" sweep $scene --t-end 0.5 --method $method --jobs $jobs -o "$work/$jobs.csv" 2>"$work/err" || cat "$work/err"
    done
    cmp "$work/1.csv" "$work/2.csv" && cmp "$work/1.csv" "$work/3.csv" && cmp "$work/1.csv" "$work/8.csv"
    report "threads: 1, 2, 3, 8: $method, ${scene##*/}" $?
    rm -f "$work"/[1238].csv
  done
done

# ---- The others ----

# others NAME CC CFLAGS
others () {
  command -v "$2" >/dev/null || { echo "# $2 is not there: not tried"; return; }
  build "$@" && hashes "$1" >"$work/$1" && diff "$work/reference" "$work/$1"
  report "$2 $3" $?
}

others gcc-O0 gcc -O0
others clang-O2 clang -O2
others gcc-native gcc '-O3 -march=native'
exit $bad
