#!/bin/sh
# Compares random mechanisms, and transformations of them, with a simulator that shares no code with Pinwheel.  Run from
# the top folder; reads PINWHEEL, PYTHON, COUNT (mechanisms), SEED (the first one).

. "$(dirname "$0")/../support/report.sh"
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-/usr/bin/python3}

if ! "$python" -c 'import numpy, scipy' 2>/dev/null; then
  echo '[  SKIPPED ] no Python with numpy and scipy: make deps TOOLS=reference'
  exit 0
fi
export OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1

# campaign NAME SCRIPT ARGUMENT...: prints its counts and its mismatches, and reports the result.
campaign () {
  name=$1 script=$2
  shift 2
  "$python" "$here/$script" "$@" --program "$pinwheel" >"$work/log" 2>&1
  status=$?
  grep -v '^MISMATCH' "$work/log" | sed 's/^/# /'
  grep '^MISMATCH' "$work/log"
  summary=$(tail -n 1 "$work/log")
  rm -f "$work/log"
  report "$name: $summary" $status
}

campaign 'the reference against closed forms' closed_forms.py
campaign 'random mechanisms by every method' compare.py --seed "${SEED:-1}" --count "${COUNT:-300}"
campaign 'mechanisms with limits' compare_limited.py --seed "${SEED:-1}" --count $((${COUNT:-300} / 20))
campaign 'transformed mechanisms' metamorphic.py --seed "${SEED:-1}" --count $((${COUNT:-300} / 3))
campaign 'stated errors' stated.py --seed "${SEED:-1}" --count $((${COUNT:-300} / 3))
exit $bad
