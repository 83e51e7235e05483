#!/bin/sh
# The Python package: tests/python by pytest, and a wheel that is installed and used without the source tree.  Reads
# PINWHEEL, PYTHON.

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

# Runs $work/check in a namespace in which the source tree is empty, if that is permitted.
without_tree() {
  if unshare -rm true 2>/dev/null; then
    unshare -rm sh -c 'mount -t tmpfs none "$1" && [ ! -e "$1/Makefile" ] && cd "$2" && ./check "$1"' sh "$PWD" "$work"
  else (top=$PWD && cd "$work" && ./check "$top"); fi
}

case ${pinwheel%/*} in "$PWD/build") ;; *) echo '# skipped: a wheel of another build'; exit $bad ;; esac
"$python" -c 'import ensurepip' 2>/dev/null || { echo '# skipped: a wheel, no venv'; exit $bad; }
cat >"$work/check" <<'P'
#!/bin/sh -e
unset PYTHONPATH PINWHEEL PINWHEEL_LIBRARY
if grep -rl "$1" venv/lib/python*/site-packages/pinwheel; then exit 1; fi
cat >model.yaml <<Y
pinwheel: 1
bodies: [{name: a, mass: 1, inertia: 1, rate: {vx: 2}}]
Y
venv/bin/python -c '
import pinwheel as pw
assert len(pw.models()) > 20
assert pw.Model("ezyroller").run(t_end=0.1).status == "ok"
assert abs(pw.Model("./model.yaml").run(t_end=1)["a.x"][-1] - 2) < 1e-9
assert pw.Model("car").check()["status"] == "ok"
assert "WebAssembly" in pw.Model("car")._repr_html_()
assert "venv" in pw._library.program() and "venv" in str(pw._library.library_path)'
P
chmod +x "$work/check"
("$python" -m venv --system-site-packages "$work/venv" &&
  "$work/venv/bin/pip" -q install --no-index --no-deps core/python && without_tree) >"$work/log" 2>&1
report 'a wheel without the source tree' $?
exit $bad
