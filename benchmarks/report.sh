#!/bin/sh
# Writes the tables and figures of docs/benchmarks.md from the results of `make bench`, or of its parts.
#
#   report.sh [MACHINE]     reads benchmarks/results/*-MACHINE.csv, by default the newest; PAGE: another page to write
#
# Replaces the lines between <!-- PART --> and <!-- end --> of the page for each part that has a result, and draws the
# figures as PNG if gnuplot is installed.
set -eu
results=benchmarks/results page=${PAGE:-docs/benchmarks.md} figures=docs/figures
export LC_ALL=C
newest=$(ls -t "$results"/work-precision-*.csv | head -1)
machine=${1:-$(basename "$newest" .csv | sed 's/work-precision-//')}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Methods in the tables and figures; the CSV has all methods.
shown='rk4+projection erk5+projection erk8+projection adams+none bdf+projection ida+baumgarte ida+ggl radau+ggl galpha+index3'

# section PART: replaces this part of the page by standard input.
section () {
  cat >"$work/section"
  awk -v part="<!-- $1 -->" -v file="$work/section" '
    /^<!-- end -->/ { skip = 0 }
    !skip { print }
    $0 == part { skip = 1; print ""; while ((getline line < file) > 0) print line; print "" }
  ' "$page" >"$work/page"
  cp "$work/page" "$page"
}

# draw NAME HEIGHT TITLE: runs a gnuplot script from standard input; writes a PNG in the style of the program's figures.
# HEIGHT is in thousandths of the width.
draw () {
  cat >"$work/script"
  command -v gnuplot >/dev/null || { echo 'report.sh: no gnuplot, no figures' >&2; return 0; }
  { echo "width = 481.89; height = 0.48189*$2; name = '$figures/$1'; about = '$3'; incomplete = ''"
    cat core/cli/plot/templates/look.gp
    echo "title = ''; unset xzeroaxis; unset offsets; eval page('png')"
    cat "$work/script"; echo "unset multiplot"; } | LC_ALL= LC_CTYPE=C.UTF-8 LC_NUMERIC=C gnuplot
}

# style METHOD: colour, mark and dash of its line, which can be distinguished in black and white, too.
style () {
  case $1 in
  rk4+*) echo "lc rgb '#004488' pt 7 dt 1" ;;
  erk5+*) echo "lc rgb '#cc6677' pt 4 dt 1" ;;
  erk8+*) echo "lc rgb '#c49a00' pt 9 dt 1" ;;
  adams+*) echo "lc rgb '#117755' pt 6 dt (8,4)" ;;
  bdf+*) echo "lc rgb '#44aadd' pt 13 dt (8,4)" ;;
  radau+*) echo "lc rgb '#884411' pt 2 dt (14,3,3,3)" ;;
  ida+ggl) echo "lc rgb '#000000' pt 12 dt (10,4,3,4)" ;;
  ida+*) echo "lc rgb '#777777' pt 5 dt (3,3)" ;;
  *) echo "lc rgb '#8844aa' pt 11 dt (10,4)" ;;
  esac
}

[ ! -f "$results/machine-$machine.txt" ] || section machine <"$results/machine-$machine.txt"
for part in work parts engine; do . "benchmarks/report/$part.sh"; done
