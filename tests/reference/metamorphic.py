"""Compares transformed random mechanisms with the reference of the original: in other units, mirrored, displaced,
turned, in another order, in two runs, with equivalent elements.

  metamorphic.py [--seed S] [--count N] [--program PATH] [--keep FOLDER]"""
import argparse
import collections
import json
import os
import random
import re
import sys
import tempfile
import compare
import transform
from mechanisms import SPAN, random_mechanism

# One method of each kind.
METHODS = ["erk8+projection", "rk4+projection", "bdf+projection", "ida+ggl", "galpha+ggl", "radau+ggl",
           "leapfrog+rattle", "erk5+nullspace", "adams+baumgarte"]


class Check:
    """A mechanism with its reference, and the comparisons of its transformations; counts: results by transformation."""

    def __init__(self, args, seed, folder, counts):
        self.args, self.seed, self.folder, self.counts = args, seed, folder, counts
        self.m, self.table = random_mechanism(seed)
        self.r = random.Random(seed)

    def write(self, name, model):
        path = os.path.join(self.args.keep or self.folder, "m%d-%s.yaml" % (self.seed, name))
        with open(path, "w") as f:
            json.dump(model, f)
        return path

    def count(self, name, method, wrong):
        self.counts[name, "mismatches" if wrong else "good"] += 1
        if wrong:
            print("MISMATCH seed %d %s %s: %s" % (self.seed, name, method, wrong), flush=True)

    def transformed(self, name, result, method):
        if result is None:
            return
        model, back, s = result
        path = self.write(name, model)

        def rows(refine):
            # Baumgarte's coefficients are rates.
            scaled = method + (":alpha=%r:beta=%r" % (10 / s, 10 / s) if method.endswith("baumgarte") else "")
            out, _ = compare.run(self.args.program, path, scaled, SPAN * s, SPAN * s / 2,
                                 compare.setting(method, refine, s))
            return [back(row) for row in out]
        states_only = name.startswith("equivalent")
        self.attempt(name, method, lambda: compare.converges(self.m, self.table, method, rows, states_only))
        if not self.args.keep:
            os.remove(path)

    def attempt(self, name, method, wrong):
        try:
            self.count(name, method, wrong())
        except compare.Refused as e:
            self.count(name, method, str(e))

    def tyres(self, method):
        """Wheels as tyres: the difference is proportional to 1/stiffness."""
        def wrong():
            found = []
            for stiffness in (1e4, 1e5, 1e6):
                path = self.write("tyres", transform.tyres(self.m.model, stiffness))
                rows, _ = compare.run(self.args.program, path, method, SPAN, SPAN / 2, ["--rtol", "1e-9"])
                found.append(max(compare.errors(self.m, self.table, rows, states_only=True).values()))
            # Ten times the stiffness, a tenth of the difference up to its next term; 1e-6: errors of the method.
            good = all(b < 1e-6 or b < a / 8 for a, b in zip(found, found[1:]))
            return None if good and found[-1] < 1e-3 else "differences " + " ".join("%.2g" % x for x in found)
        self.attempt("tyres", method, wrong)

    def split(self, method):
        """A run to half the span, and another one from its final state."""
        half = SPAN / 2
        first, second = self.write("first", self.m.model), self.write("second", transform.later(self.m.model, half))

        def rows(refine):
            a, _ = compare.run(self.args.program, first, method, half, half, compare.setting(method, refine))
            positions, velocities = self.m.names()
            start = [x for k in positions + velocities for x in ("--start", "%s=%r" % (k, a[-1][k]))]
            b, _ = compare.run(self.args.program, second, method, half, half, compare.setting(method, refine), start)
            before = {k: x for k, x in a[-1].items() if k.endswith((".work", ".loss"))}
            whole = {**b[-1], **{k: b[-1][k] + x for k, x in before.items()}, "t": SPAN}
            return [a[0], a[-1], whole]
        self.attempt("split", method, lambda: compare.converges(self.m, self.table, method, rows))


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--count", type=int, default=40)
    p.add_argument("--keep", default=None, help="folder for models")
    p.add_argument("--program", default=os.environ.get("PINWHEEL", "build/pinwheel"))
    a = p.parse_args()
    counts = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(a.seed, a.seed + a.count):
            c = Check(a, seed, folder, counts)
            for method in [METHODS[0], c.r.choice(METHODS[1:])]:
                for f in (transform.units, transform.mirrored, transform.displaced, transform.turned,
                          transform.shuffled):
                    c.transformed(f.__name__, f(c.m.model, c.r), method)
                c.split(method)
                for i, rules in enumerate(transform.EQUIVALENT):
                    c.transformed("equivalent-" + "-".join(rules), transform.rewrite(c.m.model, rules, c.r), method)
            if any("wheel" in e for e in c.m.model["elements"]) and c.m.regular and min(c.m.mass) > 0:
                c.tyres("bdf+projection")
    for name in sorted({k for k, _ in counts}):
        print("%-40s %5d good %5d mismatches" % (name, counts[name, "good"], counts[name, "mismatches"]))
    bad = sum(n for (_, what), n in counts.items() if what == "mismatches")
    print("%d metamorphic comparisons, %d mismatches" % (sum(counts.values()), bad))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
