#!/bin/sh
# Sweeps that are repeatedly killed at random times, as a whole and in parts, also by GNU parallel if it is installed: the
# table is, byte for byte, that of an uninterrupted sweep.  Run from the top folder; reads PINWHEEL, SEED (of the times).

. "$(dirname "$0")/../support/report.sh"
echo "# SEED=$seed"

grid='ezyroller --vary omega=1:10:20:log --vary a=0.4,0.5,0.6 --vary frame.omega=0,0.1 --t-end 8'

"$pinwheel" sweep $grid --jobs 1 -o "$work/whole.csv" 2>"$work/err"
report 'an uninterrupted sweep' $?

# until_done FILE OPTION...: starts the sweep and sends it $signal, up to $most times, then lets it finish; $kills counts.  The
# table may exist before: a kill between writing it and removing the journal leaves both, and the next start removes the journal.
until_done () {
  file=$1 kills=0
  shift
  while [ $kills -lt "$most" ]; do
    env --default-signal=INT "$pinwheel" sweep $grid "$@" -o "$file" 2>"$work/err" &
    child=$!
    random 0.02 0.15
    sleep "$random"
    kill -"$signal" $child 2>/dev/null
    wait $child 2>/dev/null && return 0
    kills=$((kills + 1))
  done
  "$pinwheel" sweep $grid "$@" -o "$file" 2>"$work/err"
}

round=0 most=40
for signal in KILL KILL KILL INT TERM KILL KILL; do
  round=$((round + 1))
  until_done "$work/killed.csv" --jobs $((1 + round % 3))
  cmp "$work/killed.csv" "$work/whole.csv" && [ ! -e "$work/killed.csv.part" ]
  report "round $round, stopped $kills times by $signal" $?
  rm -f "$work"/killed.csv*
done

# A journal that ends after any byte is continued from there.
"$pinwheel" sweep $grid --part 1/3 -o "$work/part.csv" 2>"$work/err"
cp "$work/part.csv" "$work/good.csv"
size=$(wc -c <"$work/good.csv") failed=0 i=0
cp "$work/good.csv" "$work/part.csv.part" # killed when the table was complete
"$pinwheel" sweep $grid --part 1/3 -o "$work/part.csv" 2>"$work/err" && cmp "$work/part.csv" "$work/good.csv" &&
  [ ! -e "$work/part.csv.part" ]
report 'a table and its complete journal' $?
while [ $i -lt 40 ]; do
  i=$((i + 1))
  random 0 "$size"
  head -c "${random%.*}" "$work/good.csv" >"$work/part.csv.part"
  "$pinwheel" sweep $grid --part 1/3 -o "$work/part.csv" 2>"$work/err" && cmp "$work/part.csv" "$work/good.csv" || failed=1
done
report 'a journal cut after any byte' $failed

signal=KILL most=5
for i in 1 2 3 4; do until_done "$work/part$i.csv" --part $i/4; done
"$pinwheel" sweep --merge "$work"/part[1-4].csv -o "$work/merged.csv" && cmp "$work/merged.csv" "$work/whole.csv"
report 'four parts, each of them killed, merged' $?

if command -v parallel >/dev/null; then
  parallel -j 2 "$pinwheel" sweep $grid --jobs 1 --part {}/6 -o "$work/gnu-{}.csv" ::: $(seq 6) 2>"$work/err" </dev/null &&
    "$pinwheel" sweep --merge "$work"/gnu-*.csv -o "$work/gnu.csv" && cmp "$work/gnu.csv" "$work/whole.csv"
  report 'six parts by GNU parallel, merged' $?
else
  echo '# skipped: no GNU parallel'
fi

# same_lanes NAME OPTION...: the same bytes for any number of lanes (runs at once per processor) and jobs, also where runs fail,
# where steps are left to the general engine, and where the structure of the scene changes.
same_lanes () {
  name=$1 failed=0
  shift
  "$pinwheel" sweep "$@" --specialise always --lanes 1 --jobs 1 -o "$work/lanes.csv" 2>"$work/err" || failed=1
  for lanes in 2 4 8; do
    for jobs in 1 3; do
      "$pinwheel" sweep "$@" --specialise always --lanes $lanes --jobs $jobs -o "$work/lanes$lanes.csv" 2>"$work/err" &&
        cmp "$work/lanes$lanes.csv" "$work/lanes.csv" || failed=1
      rm -f "$work/lanes$lanes.csv"*
    done
  done
  rm -f "$work"/lanes.csv*
  report "lanes: $name" $failed
}
same_lanes 'initial values' snakeboard --t-end 2 --vary board.vx=0:1:11
same_lanes 'parameters, work of a signal' ezyroller --t-end 2 --vary m1=0.8:1.2:7 --vary a=0.4,0.5
same_lanes 'motors' roller-racer --t-end 2 --vary swing=0.4:0.8:5 --vary m1=4,5
same_lanes 'tyres, without stabilisation' car-tyres --method rk4+none --t-end 2 --vary car.vy=0:1:9
same_lanes 'springs, runs that fail' andrews-squeezer --method rk4+projection --t-end 0.01 --vary K1.omega=-100:200:5
same_lanes 'rows with code of their own' n-trailer --t-end 1 --vary n=2,3 --vary w=1:2:8
same_lanes 'singular configurations' slider-crank --t-end 3 --vary crank.omega=1:5:9
same_lanes 'order 8' car-two-trailers --method erk8+projection:steps=fixed --t-end 2 --vary car.vx=1:2:5
same_lanes 'numbers of bodies' n-trailer --t-end 1 --vary n=1,2,3 --vary tractor.vx=0.5:1:5
same_lanes 'every form of signals' tests/models/signals.yaml --method rk4+projection --t-end 2 --vary roller.omega=0:1:5
same_lanes 'redundant equations' differential-drive --t-end 1 --vary left=0.3:0.5:3

if [ "$("$pinwheel" sweep snakeboard --t-end 0.1 --vary board.vx=0,1 --specialise always --lanes 4 -o "$work/x.csv" 2>&1)" = '' ]; then
  grid='snakeboard --vary board.vx=0:1:40 --t-end 20 --specialise always --lanes 4'
  "$pinwheel" sweep $grid --jobs 1 -o "$work/whole.csv" 2>"$work/err"
  signal=KILL most=20
  until_done "$work/killed.csv" --jobs 2
  cmp "$work/killed.csv" "$work/whole.csv" && [ ! -e "$work/killed.csv.part" ]
  report "four lanes, stopped $kills times" $?
fi
exit $bad
