# Shared by the test scripts, which source it in the top folder:
#
#   $pinwheel           absolute path of the program (PINWHEEL, or build/pinwheel)
#   $work               a temporary folder, removed when the script ends
#   report NAME STATUS  prints the result of a test that ended with this status, with the end of $work/log if it failed
#   random LOW HIGH     sets $random to a pseudorandom number in this range; it begins with $seed (SEED, or the process id)
#   exit $bad           at the end of a script: 0 if no test failed; [ ! -e "$work/failed" ] if tests are reported in pipelines

pinwheel=${PINWHEEL:-build/pinwheel}
case $pinwheel in /*) ;; *) pinwheel=$PWD/$pinwheel ;; esac
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
export XDG_CACHE_HOME="$work/cache" # no code compiled before
bad=0
seed=${SEED:-$$}

report () {
  if [ "$2" = 0 ]; then
    echo "ok $1"
  else
    echo "not ok $1"
    [ ! -f "$work/log" ] || tail -n 20 "$work/log"
    bad=1
    : >"$work/failed"
  fi
}

random () {
  seed=$(((seed * 1103515245 + 12345) % 2147483648))
  random=$(awk -v x=$seed -v a="$1" -v b="$2" 'BEGIN { print a + (b - a) * (x / 65536 % 1000) / 1000 }')
}
