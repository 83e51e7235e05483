#!/bin/sh
# Runs that are repeatedly killed by SIGKILL at random times and resumed: table and summary are, byte for byte, those of an
# uninterrupted run, for every method and every kind of state.
# Run from the top folder; reads PINWHEEL, SEED (of the random times).

. "$(dirname "$0")/../support/report.sh"
echo "# SEED=$seed"

# killed MODEL OPTION...: compares an uninterrupted run with one that is killed up to 30 times
killed () {
  rm -f "$work"/*
  "$pinwheel" run "$@" -o "$work/whole.csv" --json "$work/whole.json" --checkpoint "$work/whole.ck" 2>"$work/err" || {
    cat "$work/err"
    return 1
  }
  kills=0
  until [ -e "$work/done" ]; do
    resume=
    [ ! -e "$work/killed.ck" ] || resume=--resume
    "$pinwheel" run "$@" -o "$work/killed.csv" --json "$work/killed.json" --checkpoint "$work/killed.ck" \
      $resume ${resume:+"$work/killed.ck"} 2>"$work/err" &
    child=$!
    random 0.02 0.3
    [ $kills -ge 30 ] || { sleep "$random"; kill -KILL $child 2>/dev/null; }
    wait $child 2>/dev/null
    case $? in
    0) : >"$work/done" ;;
    137) kills=$((kills + 1)) ;;
    *) cat "$work/err"; return 1 ;;
    esac
  done
  for f in whole killed; do grep -v '"cpu_s"' "$work/$f.json" >"$work/$f"; done
  cmp "$work/whole.csv" "$work/killed.csv" && cmp "$work/whole" "$work/killed"
}

methods=$("$pinwheel" list methods | awk '/^  [a-z]/ { name = $1 } /^    \+/ { print name $1 }')
for method in $methods; do
  killed ezyroller --t-end 60 --every 0.005 --energy --method "$method" --checkpoint-every 0.7
  report "$method, killed $kills times" $?
done
killed ezyroller --t-end 40 --step 1e-4 --every 0.01 --checkpoint-every 3
report "massless bodies, many steps, killed $kills times" $?
killed redundant-parallelogram --t-end 60 --every 0.005 --energy --checkpoint-every 0.9
report "redundant rows, killed $kills times" $?
killed n-four-bar --t-end 20 --step 1e-3 --every 0.01 --checkpoint-every 0.3
report "singular configurations, killed $kills times" $?
killed chain --set n=200 --t-end 2 --every 0.01 --checkpoint-every 0.05
report "a large scene, killed $kills times" $?
exit $bad
