#!/bin/sh
# Runs all benchmarks: `make bench`.
#
#   suite.sh BUILD          runs BUILD/pinwheel and BUILD/benchmarks, works in BUILD/bench, writes benchmarks/results
#
# Steps that have finished since the program was built are skipped, so that an interrupted suite continues; remove
# BUILD/bench to run all of them again.  Results are one CSV per part and machine, from which benchmarks/report.sh
# writes the tables and figures of docs/benchmarks.md.  For a quick trial: LIMIT=0.05 REPEATS=1.
set -eu
build=$1
program=$build/pinwheel work=$build/bench results=benchmarks/results
machine=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -1 | tr 'A-Z' 'a-z' | sed 's/[^a-z0-9]\{1,\}/-/g; s/^-//; s/-$//')
machine=${machine:-unknown}
mkdir -p "$work" "$results"
PINWHEEL_MODELS=benchmarks/scenes${PINWHEEL_MODELS:+:$PINWHEEL_MODELS}
export PINWHEEL_MODELS LC_ALL=C

# Scenes of the work-precision part: group, name, model and options.  Step ladders begin at the largest useful step.
scenes='smooth ezyroller ezyroller --step-ladder 0.1:4e-4
smooth chaplygin-sleigh chaplygin-sleigh --step-ladder 0.1:4e-4
smooth knife-edge-incline knife-edge-incline --step-ladder 0.1:4e-4
smooth knife-edge-drift knife-edge-drift --step-ladder 0.1:4e-4
smooth snakeboard snakeboard --step-ladder 0.1:4e-4
smooth n-trailer n-trailer --set n=3 --step-ladder 0.1:4e-4
smooth transmission benchmarks/scenes/transmission.c --step-ladder 0.1:4e-4
smooth sleigh-friction sleigh-friction --step-ladder 0.1:4e-4
smooth caster-shimmy caster-shimmy --step-ladder 0.01:1e-5
smooth pendulum pendulum --step-ladder 0.05:1e-4
smooth car-axis car-axis --step-ladder 0.01:1e-5
smooth andrews-squeezer andrews-squeezer --step-ladder 1e-4:5e-7
smooth theo-jansen theo-jansen --step-ladder 0.02:1e-4
smooth chain chain --set n=100 --t-end 0.2 --step-ladder 0.01:3e-4 --rtol-ladder 1e-3:1e-9
singular n-four-bar n-four-bar --step-ladder 0.02:1e-4
singular slider-crank slider-crank --set l2=1.001 --step-ladder 0.02:1e-4
stiff stiff-tyres stiff-tyres --step-ladder 1e-3:1e-5 --rtol-ladder 1e-3:1e-9
stiff stiff-steering stiff-steering --step-ladder 1e-3:1e-5 --rtol-ladder 1e-3:1e-9
stiff stiff-bushings stiff-bushings --step-ladder 1e-3:1e-5 --rtol-ladder 1e-3:1e-9'
# Methods that are also measured with code specialised for the scene.
specialised=rk4+projection,erk5+projection,erk8+projection,bdf+projection
limit=${LIMIT:-0.3} repeats=${REPEATS:-3} # of a run: processor time [s]; timed runs

# ---- Steps ----

count=$(printf '%s\n' "$scenes" | wc -l)
total=$((count + 5)) number=0 begun=$(date +%s)

# step NAME COMMAND...: runs the command unless it is done; its output goes to files in BUILD/bench/NAME.
step () {
  name=$1
  shift
  number=$((number + 1))
  if [ -f "$work/$name/done" ] && [ "$work/$name/done" -nt "$program" ]; then
    printf '[%2d/%d] %-20s done before\n' $number "$total" "$name"
    return
  fi
  rm -rf "$work/$name"
  mkdir -p "$work/$name"
  printf '[%2d/%d] %-20s ' $number "$total" "$name"
  from=$(date +%s)
  if "$@" >"$work/$name/log" 2>"$work/$name/errors"; then
    touch "$work/$name/done"
    printf '%4d s, %d s in all\n' $(($(date +%s) - from)) $(($(date +%s) - begun))
  else
    status=$?
    [ $status = 130 ] && { echo 'interrupted; make bench continues here'; exit 130; }
    echo "FAILED, status $status: $(tail -1 "$work/$name/errors")"
    failed="$failed $name"
  fi
}
failed=

# scene NAME MODEL [OPTION...]: all methods with the general engine, then a few with specialised code.
scene () {
  name=$1
  shift
  "$program" compare "$@" --methods all --specialise never --limit "$limit" --repeats "$repeats" --plots "$work/$name" &&
    "$program" compare "$@" --methods "$specialised" --specialise always --limit "$limit" --repeats "$repeats" \
      --plots "$work/$name/specialised"
}

# The original program held the torque constant over each step, projected with the pseudo-inverse, and summed its work
# by the rectangle rule: awk computes that sum from a table with a row per step.
original () {
  "$program" compare ezyroller --methods rk4+projection:metric=identity:inputs=held,rk4+projection \
    --step-ladder 0.1:2e-4 --repeats "$repeats" -o "$work/original"
  echo 'step,kinetic,rectangles' >"$work/original/work.csv"
  for h in 0.1 0.05 0.025 0.0125 0.00625 0.003125 0.0015625; do
    "$program" run ezyroller --method rk4+projection:metric=identity:inputs=held --step $h --energy -o - |
      awk -F, -v h=$h '
        NR == 1 { for (i = 1; i <= NF; i++) { if ($i == "frame.omega [rad/s]") a = i; if ($i == "steer.omega [rad/s]") b = i; if ($i == "kinetic [J]") k = i } next }
        NR > 2 { work += torque * rate * ($1 - t) }
        { t = $1; torque = 0.1 * cos (3.141592653589793 * t); rate = $a - $b; kinetic = $k }
        END { printf "%s,%.9g,%.9g\n", h, kinetic, work }' >>"$work/original/work.csv"
  done
}

drift () {
  "$program" drift pendulum --t-end 100 --step 0.01 --plots "$work/drift"
}

peers () {
  "$build/benchmarks/peers" "$work/peers/peers.csv"
}

engine () {
  "$build/benchmarks/engine"
}

effects () {
  "$build/benchmarks/effects" "$build/variant/basic"
}

# ---- Results ----

# The columns of the reports, with four digits; the last one, the reason, may have commas.
gather () {
  printf 'group,scene,engine,method,ladder,rung,status,t,end_length,end_angle,largest_length,largest_angle,multiplier,below,order,position,velocity,balance,steps,rhs,jacobians,factorisations,cpu,spread,reason\n'
  { printf '%s\n' "$scenes"; echo original original; } | while read -r group name options; do
    [ -f "$work/$name/done" ] || continue
    for engine in general specialised; do
      file=$work/$name/compare.csv
      [ $engine = general ] || file=$work/$name/specialised/compare.csv
      [ -f "$file" ] || continue
      awk -F, -v first="$group,$name,$engine" '
        function short(x) { return x == "nan" || x == "" ? x : sprintf ("%.4g", x) }
        NR == 1 { for (i = 1; i <= NF; i++) { name = $i; sub (/ \[.*/, "", name); at[name] = i }; next }
        { reason = $0; for (i = 1; i < NF && i < at["reason"]; i++) sub (/^[^,]*,/, "", reason)
          printf "%s,%s,%s,%s,%s", first, $1, $2, short($3), $4
          n = split ("t end.length end.angle largest.length largest.angle multiplier", c, " ")
          for (i = 1; i <= n; i++) printf ",%s", short($at[c[i]])
          printf ",%s", $at["below"]
          n = split ("order residual.position residual.velocity balance steps rhs jacobians factorisations cpu spread", c, " ")
          for (i = 1; i <= n; i++) printf ",%s", (c[i] ~ /^[srjf]/ && c[i] !~ /\./ && c[i] != "spread" ? $at[c[i]] : short($at[c[i]]))
          printf ",%s\n", reason }' "$file"
    done
  done
}

references () {
  echo 'scene,reference,against,largest_length,largest_angle'
  printf '%s\n' "$scenes" | while read -r group name options; do
    [ -f "$work/$name/done" ] || continue
    awk -v scene="$name" 'NR > 1 && /"uncertainty"/ { text = $0; split (text, part, "\""); split (text, cell, "\",\"uncertainty\","); split (cell[2], v, ","); printf "%s,\"%s\",uncertainty,%.2g,%.2g\n", scene, part[2], v[5], v[6] }' "$work/$name/truth.csv"
  done
}

# keep STEP FILE NAME: copies a file of a finished step to the results.
keep () {
  if [ -f "$work/$1/done" ]; then cp "$work/$1/$2" "$results/$3"; fi
}

echo "machine $machine; results go to $results/*-$machine.csv"
printf '%s\n' "$scenes" >"$work/scenes"
while read -r group name options; do
  # shellcheck disable=SC2086
  step "$name" scene "$name" $options
done <"$work/scenes"
step original original
step drift drift
step peers peers
step engine engine
step effects effects

{
  sed -n 's/^model name[^:]*: /Machine: /p' /proc/cpuinfo | head -1 | tr '\n' ','
  echo " $(nproc) processors; $(uname -s), $(${CC:-cc} --version | head -1); $(date +%F)."
} >"$results/machine-$machine.txt"
gather >"$results/work-precision-$machine.csv"
references >"$results/reference-$machine.csv"
keep original work.csv "original-$machine.csv"
keep drift drift.csv "drift-$machine.csv"
keep drift drift.png ../../docs/figures/bench-drift.png
keep peers peers.csv "peers-$machine.csv"
keep effects log "effects-$machine.txt"
sh benchmarks/report.sh "$machine"
echo "$(($(date +%s) - begun)) s; docs/benchmarks.md has the results"
[ -z "$failed" ] || { echo "failed:$failed"; exit 1; }
