#!/bin/sh
# Random mechanisms against a simulator that shares no code with Pinwheel (tests/reference), and in other words against
# themselves.  Run from the top folder; reads PINWHEEL, PYTHON, COUNT (mechanisms), SEED (the first one).

. "$(dirname "$0")/../support/report.sh"
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-/usr/bin/python3}

if ! "$python" -c 'import numpy, scipy' 2>/dev/null; then
  echo '[  SKIPPED ] no Python with numpy and scipy: make deps TOOLS=reference'
  exit 0
fi
export OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1

# campaign NAME PROGRAM ARGUMENT...: shows its counts, and all that is wrong.
campaign () {
  name=$1 script=$2
  shift 2
  "$python" "$here/$script" "$@" --program "$pinwheel" >"$work/log" 2>&1
  status=$?
  grep -v '^MISMATCH' "$work/log" | sed 's/^/# /'
  grep '^MISMATCH' "$work/log"
  sum=$(tail -n 1 "$work/log")
  rm -f "$work/log"
  report "$name: $sum" $status
}

campaign 'the reference against closed forms' closed_forms.py
campaign 'random mechanisms by every method' compare.py --seed "${SEED:-1}" --count "${COUNT:-300}"
campaign 'the same motion in other words' metamorphic.py --seed "${SEED:-1}" --count $((${COUNT:-300} / 3))
exit $bad
