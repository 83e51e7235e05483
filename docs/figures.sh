#!/bin/sh
# Draws all figures of README and docs into docs/figures, as `make figures` calls it.
#
#   figures.sh PINWHEEL [NAME...]     only these figures, "gallery-car", if any are named
#
# The others of docs/benchmarks.md come from the results in benchmarks/results, the pictures of pages from chromium.
set -eu
pinwheel=$1 figures=docs/figures
shift
only=$*
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
browser=$(command -v chromium || command -v chromium-browser || true)

wanted () {
  [ -z "$only" ] || case " $only " in *" $1 "*) ;; *) return 1 ;; esac
}

# draw NAME FIGURE COMMAND...: the figure that a command writes into the folder that is its last argument.
draw () {
  name=$1 figure=$2
  shift 2
  wanted "$name" || return 0
  echo "$name"
  "$pinwheel" "$@" "$work/$name" >/dev/null 2>"$work/messages" || { cat "$work/messages" >&2; exit 1; }
  cp "$work/$name/$figure.png" "$figures/$name.png"
}

# shot NAME WIDTH,HEIGHT PAGE SCRIPT: a page in a browser, after a script.
shot () {
  [ -n "$browser" ] || { echo "figures.sh: no chromium, no $1" >&2; return 0; }
  { sed '$d' "$3" | sed '$d'; echo "<script>$4</script></body></html>"; } >"$work/shot.html"
  "$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$work/profile" --window-size="$2" \
    --virtual-time-budget=10000 --screenshot="$figures/$1.png" "file://$work/shot.html" >/dev/null 2>&1
}

# ---- Gallery ----

for model in $(find models -name '*.c' -o -name '*.yaml' | sed 's,.*/,,; s/\..*//' | sort | grep -vx ezyroller); do
  draw gallery-$model mechanism run $model --plots
done

# ---- The EzyRoller ----

for figure in mechanism paths velocities angular energy; do
  draw ezyroller-$figure $figure run ezyroller --plots
done
draw ezyroller-free mechanism run ezyroller --set M0=0 --start frame.vx=1 --start frame.vy=0 --start frame.omega=0 \
  --start steer.phi=-1.5707963267948966 --start steer.x=0.5 --start steer.y=-0.125 --t-end 1 --plots
draw ezyroller-work-precision work-precision compare ezyroller --plots

# ---- Lessons ----

draw lesson-drift drift drift pendulum --t-end 100 --step 0.01 --only-methods \
  --methods rk4+none,rk4+baumgarte,rk4+projection,ida+ggl --plots
draw lesson-cost work-precision compare pendulum --methods rk4+projection,erk5+projection,erk8+projection,ida+ggl --plots

draw bench-drift drift drift pendulum --t-end 100 --step 0.01 --plots

# ---- Analyses ----

draw optimise-snakeboard optimise optimise snakeboard --maximise board.x --free omega=1:8 --free swing=0.1:1.5 --free steer=0.1:0.6 \
  --subject-to 'max:swing.F<=3' --subject-to 'min:swing.F>=-3' --t-end 10 --step 0.01 --plots

car=$work/car-trailer.yaml
awk '/^```yaml/ { n++; next } /^```/ { if (n == 1) exit } n == 1' docs/analysis.md >"$car"
draw steady-car-trailer steady steady "$car" --vary u=2:60 --starts 0 --plots
draw sensitivity-car-trailer sensitivity sensitivity "$car" --start trailer.omega=0.2 --of rms:trailer.omega --of trailer.omega --by u --by ahead --by grip --plots
if wanted fit-car-trailer; then
  "$pinwheel" run "$car" --set steer=0.02 --set ahead=0.15 --set grip=6e4 --every 0.05 -o "$work/run.csv" >/dev/null
  awk -F, 'NR == 1 { print $1 "," $7 "," $19 } NR > 1 { printf "%s,%.3f,%.3f\n", $1, $7, $19 }' "$work/run.csv" >"$work/measured.csv"
fi
draw fit-car-trailer fit fit "$car" --set steer=0.02 --data "$work/measured.csv" --columns car.omega,trailer.omega --free ahead --free grip --plots
if wanted periodic-racer || wanted periodic-swing; then
  awk '/^```yaml/ { n++; next } /^```/ { if (n == 2) exit } n == 2' docs/analysis.md >"$work/racer.yaml"
fi
draw periodic-racer periodic periodic "$work/racer.yaml" --plots
draw periodic-swing periodic periodic "$work/racer.yaml" --vary swing=0.2:1 --plots

# ---- Pages, benchmarks ----

if wanted animation; then
  echo animation
  "$pinwheel" run ezyroller --t-end 20 --animate "$work/page.html" >/dev/null
  shot animation 900,640 "$work/page.html" "seek(12); fit(); draw();"
fi
if [ -z "$only" ]; then
  echo benchmarks
  cp docs/benchmarks.md "$work/page.md"
  PAGE=$work/page.md sh benchmarks/report.sh
fi
