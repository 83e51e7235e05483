"""Compares random mechanisms with limits of reactions (limited.py), by every method of Pinwheel, with the reference.

  compare_limited.py [--seed S] [--count N] [--methods A,B,...] [--keep FOLDER] [--program PATH]

States at half the span and at its end, and events: which equation changes, how, when.  Prints counts, and for each
difference the seed, the method, errors; status 1 if there are any, or if more than FAILURES of the runs stop.  A motion
is sensitive if the reference changes as much for masses that differ by 1e-9, or for events resolved a thousand times
finer: such differences are counted separately."""
import argparse
import collections
import copy
import json
import os
import sys
import tempfile
from compare import FACTOR, FAILURES, ORDER, RTOL, STEP, Refused, errors, methods, reason_of, run, setting
from events import FREE, HOLDS, SLIDES, Motion
from limited import REJECTED, SPAN, limited_mechanism
from simulator import Failure, Mechanism

REFINEMENTS = 5
CLOSE = 1e-3  # [s] events closer to each other than this are not compared one by one
LEAST = 1e-7  # errors below are accepted: impacts that accumulate end in units of 1e-6, and so differ by their square
SENSITIVE = 0.05  # largest fraction of comparisons of sensitive motions


def name_of(mode):
    """A mode as Pinwheel lists it; equations that others keep at 0 hold."""
    return {1: "slides+", -1: "slides-"}.get(mode, HOLDS if isinstance(mode, tuple) else mode)


def instants(events):
    """Events of one reaction at one time, as one: (t, reaction, mode before, mode after, whether with an impulse)."""
    out = {}
    for t, name, before, after, impulse in events:
        first = out.get((t, name))
        out[t, name] = (first[0] if first else before, after, impulse is not None or bool(first and first[2]))
    return [(*key, *x) for key, x in out.items()]


def changes(events, circles, without):
    """(t, reaction, mode) of changes and impacts after the start, without some reactions; a vector just slides."""
    out = []
    for t, name, before, after, impulse in instants(events):
        before, after = name_of(before), name_of(after)
        if name in circles:
            before, after = (x if x == HOLDS else SLIDES for x in (before, after))
        if t > 1e-9 and name not in without and (before != after or impulse):
            out.append((t, name, after))
    return out


class Finer(Motion):
    """The same with smaller rates and gaps that count as 0, which decide where impacts that accumulate end."""

    zero = Motion.zero / 1000


class Case:
    """A mechanism and its motion by the reference.  history, bad: errors of the last method that differs, and the groups
    of columns in which it does."""

    def __init__(self, seed, folder, program):
        self.m, self.table, motion = limited_mechanism(seed)
        self.events = motion.events
        self.program, self.path, self.changed = program, os.path.join(folder, "m%d.yaml" % seed), None
        elements = self.m.model["elements"]
        self.circles = {e["rolling-wheel"] + ".N" for e in elements if "rolling-wheel" in e}
        # Of contacts the friction, whose mode is arbitrary where they do not touch.
        self.without = motion.arbitrary | {e["contact"] + ".T" for e in elements if "contact" in e}
        self.want = self.listed(self.events)
        with open(self.path, "w") as f:
            json.dump(self.m.model, f)

    def listed(self, events):
        return changes(events, self.circles, self.without)

    def isolated(self):
        """Events with no other one within CLOSE, except at the same time."""
        return [e for e in self.want if all(abs(e[0] - o[0]) < 1e-12 or abs(e[0] - o[0]) > CLOSE for o in self.want)]

    def wrong_events(self, summary, bound):
        """Events that differ by more than a bound [s]: missed, or invented."""
        got = self.listed([(e["t"], e["reaction"], e["from"], e["to"], e.get("impulse")) for e in summary["events"]])
        missed = [x for x in self.isolated() if not any(x[1:] == y[1:] and abs(x[0] - y[0]) < bound for y in got)]
        near = lambda y: [x for x in self.want if abs(x[0] - y[0]) < bound + CLOSE]
        invented = [y for y in got if not any(x[1:] == y[1:] for x in near(y)) and len({x[0] for x in near(y)}) < 2]
        return (["misses %s %s at %.9g" % (n, mode, t) for t, n, mode in missed] +
                ["invents %s %s at %.9g" % (n, mode, t) for t, n, mode in invented])

    def is_decided(self, method):
        """Whether the laws of impact determine the motion: moreau decides those of one instant together."""
        impacts = [t for t, _, _, _, with_impulse in instants(self.events) if with_impulse]
        return not method.startswith("moreau") or len(set(impacts)) == len(impacts)

    def order(self, integrator):
        """Friction circles reduce every order to 2, events that are not located to 1."""
        return 1 if integrator == "moreau" else 2 if self.circles else ORDER[integrator]

    def accepted(self, integrator, group, history):
        e, refine = history[-1][group], len(history) - 1
        if integrator == "moreau" and refine > 1 and e < history[0][group] / 4**(0.6 * refine) and e < 1e-2:
            return True
        if integrator not in STEP:
            return e < LEAST + FACTOR[integrator] * RTOL[integrator] / 10**refine
        smaller = refine > 0 and e < history[-2][group] / 2**(self.order(integrator) - 0.6)
        return e < LEAST or smaller and e < 1e-2

    def errors(self, integrator, rows):
        """Velocities differ as they jump where impacts are not located."""
        found = errors(self.m, self.table, rows, True)
        return {"positions": found["positions"]} if integrator == "moreau" else found

    def check(self, method):
        """None, or how a method differs: errors by group at finer and finer settings, and events."""
        integrator, history, events = method.split("+")[0], [], []
        halvings = 2 if integrator == "moreau" else 1  # its error depends on where in a step events are
        for refine in range(REFINEMENTS):
            try:
                rows, summary = run(self.program, self.path, method, SPAN, SPAN / 2, setting(method, halvings * refine))
            except Refused as e:
                if refine == REFINEMENTS - 1 or "too large" not in str(e):
                    raise
                continue
            history.append(self.errors(integrator, rows))
            bad = [g for g in history[-1] if not self.accepted(integrator, g, history)]
            error = max(history[-1].values())
            events = [] if integrator == "moreau" else self.wrong_events(summary, 1e-5 + 100 * error)
            if not bad and not events:
                LARGEST[method] = max(LARGEST[method], error)
                REFINED[integrator, refine] += 1
                return None
        self.history, self.bad = history, bad
        return "; ".join(" ".join("%s %.2g" % x for x in e.items()) for e in history) + " " + ", ".join(events[:4])

    def change(self, model, motion, unknown):
        """Errors of the reference, by group, for another model or resolution; `unknown` if it cannot follow it."""
        try:
            m = Mechanism(model)
            return errors(m, self.table, motion(m, m.q, m.v, SPAN).run([SPAN / 2, SPAN]), True)
        except Failure:
            return collections.defaultdict(lambda: unknown)

    def sensitivity(self):
        """Changes for masses that differ by 1e-9, and for events resolved a thousand times finer."""
        if self.changed is None:
            model = copy.deepcopy(self.m.model)
            for k, b in enumerate(model["bodies"]):
                b["mass"] *= 1 + 1e-9 * (1 + k % 3)
                b["inertia"] *= 1 - 1e-9 * (1 + k % 2)
            self.changed = self.change(model, Motion, float("inf")), self.change(self.m.model, Finer, 0.0)
        return self.changed


LARGEST, REFINED = collections.Counter(), collections.Counter()


class Campaign:
    """Many mechanisms: counts of events and of comparisons, reasons of refusals."""

    def __init__(self, args):
        self.args, self.methods = args, args.methods.split(",") if args.methods else methods(args.program)
        self.counts, self.reasons, self.kinds = collections.Counter(), collections.Counter(), collections.Counter()

    def run_case(self, seed, folder):
        case = Case(seed, self.args.keep or folder, self.args.program)
        self.counts["events"] += len(case.want)
        self.kinds.update({next(iter(e)) for e in case.m.model["elements"]})
        decided = [method for method in self.methods if case.is_decided(method)]
        self.counts["undecided"] += len(self.methods) - len(decided)
        good = [self.by_method(case, seed, method) for method in decided]
        if all(good) and self.args.keep:
            os.remove(case.path)

    def by_method(self, case, seed, method):
        try:
            wrong = case.check(method)
        except Refused as e:
            unsupported = str(e).startswith("exit 2")
            self.counts["refused" if unsupported else "stopped"] += 1
            self.reasons[method, reason_of(str(e))] += 1
            if not unsupported:
                print("STOPPED seed %d %s: %s" % (seed, method, e), flush=True)
            return unsupported
        if not wrong:
            self.counts["agree"] += 1
        elif case.bad and all(max(x[g] for x in case.sensitivity()) > case.history[-1][g] / 2 for g in case.bad):
            self.counts["sensitive"] += 1
        else:
            self.counts["differ"] += 1
            print("MISMATCH seed %d %s: %s" % (seed, method, wrong), flush=True)
        return not wrong

    def report(self):
        n = self.counts
        total = sum(n[k] for k in ("agree", "refused", "stopped", "sensitive", "differ"))
        print("mechanisms with: " + ", ".join("%s %d" % x for x in sorted(self.kinds.items())))
        print("rejected by the reference: " + ", ".join("%s %d" % x for x in REJECTED.most_common()))
        print("refinements needed: " + ", ".join("%s %d: %d" % (*k, x) for k, x in sorted(REFINED.items())))
        for (method, reason), k in self.reasons.most_common():
            print("%d %s: %s" % (k, method, reason))
        print("%d mechanisms, %d events, %d methods: %d agree, %d refused with a message, %d stopped, %d sensitive, "
              "%d differ; %d not compared: impacts at one instant" % (
                  self.args.count, n["events"], len(self.methods), n["agree"], n["refused"], n["stopped"],
                  n["sensitive"], n["differ"], n["undecided"]))
        return 1 if n["differ"] or n["stopped"] > FAILURES * total or n["sensitive"] > SENSITIVE * total else 0


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--count", type=int, default=300)
    p.add_argument("--methods")
    p.add_argument("--keep", help="folder for models of mismatches")
    p.add_argument("--program", default=os.environ.get("PINWHEEL", "build/pinwheel"))
    a = p.parse_args()
    campaign = Campaign(a)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(a.seed, a.seed + a.count):
            campaign.run_case(seed, folder)
    return campaign.report()


if __name__ == "__main__":
    sys.exit(main())
