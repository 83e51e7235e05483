#!/bin/sh
# The table of README.md: the processor time for 100 s of the EzyRoller to an error of 1e-3, 1e-6 and 1e-9 m, by Pinwheel, by
# programs written by hand, SciPy and Simbody, one after the other on this machine.  Needs libsimbody-dev, python3-scipy.  Reads PYTHON.
#
#   table.sh BUILD
set -e
build=$1 here=$(dirname "$0")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
c++ -O2 -w -I/usr/include/simbody "$here/simbody.cpp" -o "$work/simbody" -lSimTKsimbody -lSimTKmath -lSimTKcommon
"$build/benchmarks/peers" "$work/peers.csv" >/dev/null
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "${PYTHON:-python3}" "$here/scipy_run.py" >"$work/scipy"
"$work/simbody" >"$work/simbody.txt"

# Times depend on other programs of the machine: two digits.
short=' function short(x) { return sprintf ("%.2g", x) + 0 }'

# cost FILE ERROR: interpolated between the logarithms of errors and times [ms]
cost () {
  awk -v error="$2" '
    { e = log ($1); t = log ($2)
      if (NR > 1 && !done && e <= log (error) && before > log (error)) { printf "%s", short(exp (last + (t - last) * (log (error) - before) / (e - before))); done = 1 }
      if (NR == 1 && e <= log (error)) { printf "%s", short($2); done = 1 }
      before = e; last = t }
    END { if (!done) printf "-" }'"$short" "$1"
}
# column NAME FIELD: times of Pinwheel or of the program by hand, from the table of peers
column () { awk -F, -v row="$1" -v field="$2" '$1 == "erk8+projection" && index ($0, row) { printf " %s |", short($field) }'"$short" "$work/peers.csv" | cut -d'|' -f1-3; }

echo '| program | 1e-3 m | 1e-6 m | 1e-9 m |'
echo '|---|---|---|---|'
echo "| Pinwheel, \`erk8+projection\`, general engine |$(column 'order and projection' 5)|"
echo "| by hand for this mechanism, C, the same method |$(column 'order and projection' 4)|"
echo "| SciPy 1.10, DOP853, numpy | $(cost "$work/scipy" 1e-3) | $(cost "$work/scipy" 1e-6) | $(cost "$work/scipy" 1e-9) |"
echo "| Simbody 3.7, Runge-Kutta-Merson | $(cost "$work/simbody.txt" 1e-3) | $(cost "$work/simbody.txt" 1e-6) | $(cost "$work/simbody.txt" 1e-9) |"
