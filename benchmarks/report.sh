#!/bin/sh
# Tables and figures of docs/benchmarks.md from the results of `make bench`, or of its parts.
#
#   report.sh MACHINE       reads benchmarks/results/*-MACHINE.csv
#
# Replaces what stands between the lines <!-- PART --> and <!-- end --> of the page, for each part that has a result, and
# draws the figures as SVG and PNG, if there is a gnuplot.
set -eu
machine=$1 results=benchmarks/results page=docs/benchmarks.md figures=docs/figures
export LC_ALL=C
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Methods that are shown; the CSV has all of them.
shown='rk4+projection erk5+projection erk8+projection adams+none bdf+projection ida+baumgarte ida+ggl galpha+index3'

# section PART: puts standard input into the page.
section () {
  cat >"$work/section"
  awk -v part="<!-- $1 -->" -v file="$work/section" '
    /^<!-- end -->/ { skip = 0 }
    !skip { print }
    $0 == part { skip = 1; print ""; while ((getline line < file) > 0) print line; print "" }
  ' "$page" >"$work/page"
  cp "$work/page" "$page"
}

# draw NAME WIDTH HEIGHT: a gnuplot script from standard input, as PNG.
draw () {
  cat >"$work/script"
  command -v gnuplot >/dev/null || { echo 'report.sh: no gnuplot, no figures' >&2; return 0; }
  { echo "set encoding utf8"; echo "set terminal pngcairo size $2,$3 noenhanced font 'Sans,9.5' background rgb 'white'"
    echo "set output '$figures/$1.png'"; cat "$work/script"; } | LC_ALL= LC_CTYPE=C.UTF-8 LC_NUMERIC=C gnuplot
}

# Colour, mark and dash of a method's line: told apart in black and white too.
style () {
  case $1 in
  rk4+*) echo "lc rgb '#004488' pt 7 dt 1" ;;
  erk5+*) echo "lc rgb '#bb5566' pt 4 dt 1" ;;
  erk8+*) echo "lc rgb '#997700' pt 9 dt 1" ;;
  adams+*) echo "lc rgb '#228877' pt 6 dt (8,4)" ;;
  bdf+*) echo "lc rgb '#228877' pt 13 dt (8,4)" ;;
  ida+ggl) echo "lc rgb '#000000' pt 12 dt (14,5,3,5)" ;;
  ida+*) echo "lc rgb '#000000' pt 5 dt (3,4)" ;;
  *) echo "lc rgb '#774499' pt 2 dt (14,5)" ;;
  esac
}

for part in work parts engine; do . "benchmarks/report/$part.sh"; done
