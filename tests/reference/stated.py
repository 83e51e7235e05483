"""The errors that `pinwheel run --error` states, against the true ones: random mechanisms (mechanisms.py) by every method
with random tolerances or steps, compared at the end with the reference simulator.

Required of at least 99 % of the runs: every body's position, angle, velocities are as accurate as stated.  Median over
the bodies of the stated over the true error: below 10.  Prints counts, and the runs whose errors are larger than
stated; status 1 if the requirements are not met."""
import argparse
import collections
import json
import math
import os
import random
import subprocess
import sys
import tempfile

import compare
import numpy as np

LEAST = 1e-10  # error of the reference


def run(program, case, method, setting):
    """The summary of a run with --error."""
    command = [program, "run", case.path, "-m", method, "-t", repr(compare.SPAN), "--energy", "--error", "--json", "-",
               *setting, *case.options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise compare.Refused(compare.reason_in(done.stderr))
    return json.loads(done.stdout)


def setting(method, r):
    integrator = method.split("+")[0]
    if integrator in compare.STEP:
        return ["--step", repr(compare.STEP[integrator] * 2**r.uniform(-2, 2))]
    return ["--rtol", repr(10**r.uniform(-8, -3))]


def bodies(case, summary):
    """(what, stated error, true error) of each body's position, angle, velocity, angular velocity at the end."""
    truth, end = case.table[-1], summary["error"]["end"]
    for name, body in summary["bodies"].items():
        for what in (("x", "y"), ("phi",), ("vx", "vy"), ("omega",)):
            keys = ["%s.%s" % (name, w) for w in what]
            yield (keys[0], math.hypot(*(end[k] for k in keys)),
                   math.hypot(*(body[w] - truth[k] for w, k in zip(what, keys))))


def columns(case, summary):
    """The same of the energies and reactions; those of redundant constraints are not unique."""
    truth, end = case.table[-1], summary["error"]["end"]
    values = {**summary["energy"], **(summary["reactions"] if case.m.regular else {})}
    for name in values:
        if name in truth and name in end:
            yield name, end[name], abs(values[name] - truth[name])


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--count", type=int, default=300)
    p.add_argument("--methods")
    p.add_argument("--program", default=os.environ.get("PINWHEEL", "build/pinwheel"))
    a = p.parse_args()
    methods = a.methods.split(",") if a.methods else compare.methods(a.program)
    n, ratios, by_method, reasons = collections.Counter(), [], collections.Counter(), collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(a.seed, a.seed + a.count):
            try:
                case = compare.Case(seed, folder, a.program, False)
            except (compare.Failure, compare.Refused):
                continue
            if case.table is None:
                continue
            for method in methods:
                r = random.Random("%d %s" % (seed, method))
                option = setting(method, r)
                try:
                    summary = run(a.program, case, method, option)
                except compare.Refused:
                    n["refused"] += 1
                    continue
                if summary["error"]["unknown"]:
                    n["unknown"] += 1
                    reasons[compare.reason_of(summary["error"]["unknown"])[:150], method] += 1
                    continue
                n["runs"] += 1
                found = list(bodies(case, summary))
                more = list(columns(case, summary))
                ratios += [stated / true for _, stated, true in found if true > LEAST]
                outside = [x for x in found if x[2] > x[1] + LEAST]
                n["outside"] += bool(outside)
                n["columns"] += len(more)
                n["columns outside"] += sum(true > stated + 1e-8 * (1 + abs(stated)) for _, stated, true in more)
                if outside:
                    by_method[method] += 1
                    print("outside: seed %d %s %s: %s" % (seed, method, " ".join(option), ", ".join(
                        "%s %.2g, stated %.2g" % (w, t, s) for w, s, t in outside[:3])), flush=True)
    median = float(np.median(ratios)) if ratios else math.nan
    for (reason, method), k in reasons.most_common():
        print("unknown: %d %s: %s" % (k, method, reason))
    print("outside by method: " + ", ".join("%s %d" % x for x in by_method.most_common()))
    print("energies and reactions: %d of %d outside" % (n["columns outside"], n["columns"]))
    print("%d runs: %d with an error larger than stated; median of stated over true %.2g; %d unknown, %d refused" % (
        n["runs"], n["outside"], median, n["unknown"], n["refused"]))
    return 0 if n["runs"] and n["outside"] <= 0.01 * n["runs"] and median < 10 and n["unknown"] < 0.05 * n["runs"] else 1


if __name__ == "__main__":
    sys.exit(main())
