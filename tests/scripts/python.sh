#!/bin/sh
# The Python package: tests/python by pytest, and docs/python.py.  Reads PINWHEEL, PYTHON.

. "$(dirname "$0")/../support/report.sh"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import numpy, pytest' 2>/dev/null || { echo '# skipped: no numpy or pytest'; exit 0; }
export PYTHONPATH=$PWD/core/python PINWHEEL="$pinwheel" PINWHEEL_LIBRARY="${pinwheel%/*}" MPLBACKEND=agg PYTHONDONTWRITEBYTECODE=1

timeout 600 "$python" -m pytest -q -p no:cacheprovider -rs --tb=short --junitxml="$work/results.xml" tests/python >"$work/output" 2>&1
"$python" - "$work/results.xml" <<'P' || { cat "$work/output"; exit 1; }
import sys, xml.etree.ElementTree as tree
bad = False
for case in tree.parse(sys.argv[1]).iter("testcase"):
    failed = case.find("failure") is not None or case.find("error") is not None
    print("not ok" if failed else "# skipped:" if case.find("skipped") is not None else "ok", case.get("name"))
    bad |= failed
sys.exit(bad)
P
(cd "$work" && timeout 300 "$python" "$OLDPWD/docs/python.py" >log 2>&1)
report 'docs/python.py' $?
exit $bad
