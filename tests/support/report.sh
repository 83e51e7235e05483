# What the test scripts share.  Sourced, with the top folder as the current one:
#
#   $pinwheel           the program, by its whole path (PINWHEEL, or build/pinwheel)
#   $work               a folder that goes when the script ends
#   report NAME STATUS  a line for a test that has ended with this status; what $work/log holds if it failed
#   random LOW HIGH     sets $random, from $seed (SEED, or another one each time; print it)
#   exit $bad           at the end: 0 if all were good

pinwheel=${PINWHEEL:-build/pinwheel}
case $pinwheel in /*) ;; *) pinwheel=$PWD/$pinwheel ;; esac
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
export XDG_CACHE_HOME="$work/cache" # not the user's
bad=0
seed=${SEED:-$$}

report () {
  if [ "$2" = 0 ]; then
    echo "ok $1"
  else
    echo "not ok $1"
    [ ! -f "$work/log" ] || tail -n 20 "$work/log"
    bad=1
  fi
}

random () {
  seed=$(((seed * 1103515245 + 12345) % 2147483648))
  random=$(awk -v x=$seed -v a="$1" -v b="$2" 'BEGIN { print a + (b - a) * (x / 65536 % 1000) / 1000 }')
}
