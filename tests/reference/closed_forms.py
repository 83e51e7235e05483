"""Checks of the reference simulator: against closed forms, digits in quadruple precision, differences, energy
balances."""
import functools
import math
import os
import sys
import numpy as np
from scipy.special import ellipj, ellipkinc
from mechanisms import random_mechanism
from simulator import Mechanism, State

HERE = os.path.dirname(os.path.abspath(__file__))
PENDULUM = {"bodies": [{"name": "b", "mass": 2, "inertia": 0.3, "start": {"x": 0.5}}],
            "elements": [{"pin": "O", "body": ["b", "ground"], "at": [[-0.5, 0], [0, 0]]},
                         {"gravity": "g", "acceleration": [0, -9.81]}]}
SKATE = {"bodies": [{"name": "b", "mass": 1, "inertia": 0.1, "rate": {"omega": 1.3}}],
         "elements": [{"wheel": "A", "body": "b", "at": [0, 0]}, {"gravity": "g", "acceleration": [4.905, 0]}]}
EZYROLLER = {"bodies": [{"name": "frame", "mass": 1, "inertia": 0.1},
                        {"name": "steer", "start": {"x": 0.375, "phi": math.pi}}],
             "elements": [{"pin": "B", "body": ["frame", "steer"], "at": [[0.5, 0], [-0.125, 0]]},
                          {"wheel": "A", "body": "frame", "at": [-0.5, 0]},
                          {"wheel": "C", "body": "steer", "at": [0.125, 0]},
                          {"torque": "T", "body": ["frame", "steer"],
                           "value": {"harmonic": {"amplitude": 0.1, "omega": math.pi}}}]}


def table(model, times):
    m = Mechanism(model)
    return m.run(m.q, m.v, times, check=False)


def pendulum():
    """phi'' = -w0^2 cos phi from rest at 0: sin (theta/2) = k sn, theta the angle from hanging down (Whittaker 1904,
    section 44).
    The pin carries weight and the centripetal force: along the rod m (s w^2 - g sin phi)."""
    m, s, I, g, t = 2, 0.5, 0.3, 9.81, 3.7
    w0, k = math.sqrt(m * g * s / (I + m * s * s)), math.sin(math.pi / 4)
    sn = ellipj(w0 * t + ellipkinc(math.pi / 2, k * k), k * k)[0]
    theta = 2 * math.asin(k * sn)
    row = table(PENDULUM, [t])[-1]
    phi = theta - math.pi / 2
    along = row["O.Fx"] * math.cos(phi) + row["O.Fy"] * math.sin(phi)
    w2 = 2 * w0 * w0 * math.cos(theta)
    return max(abs(row["b.phi"] - phi), abs(along + m * (s * w2 - g * math.sin(phi))) / (m * g))


def skate():
    """x = a/(2 w^2) sin^2 wt, y = a/(2 w^2) (wt - sin (2 wt)/2); lateral force 2 m a sin wt (Neimark & Fufaev 1972)."""
    a, w, t = 4.905, 1.3, 2.0
    row = table(SKATE, [t])[-1]
    return max(abs(row["b.x"] - a / (2 * w * w) * math.sin(w * t)**2),
               abs(row["b.y"] - a / (2 * w * w) * (w * t - math.sin(2 * w * t) / 2)),
               abs(row["A.N"] - 2 * a * math.sin(w * t)))


def ezyroller():
    """Digits in quadruple precision."""
    want = np.loadtxt(os.path.join(HERE, "ezyroller.txt"))[:4]
    rows = table(EZYROLLER, list(want[:, 0]))[1:]
    got = [[r["t"], r["frame.x"], r["frame.y"], r["frame.phi"], r["steer.phi"], r["T.work"]] for r in rows]
    return float(np.max(np.abs(np.array(got) - want)))


@functools.lru_cache(None)
def mechanisms():
    return [random_mechanism(seed) for seed in range(500, 530)]


def derivatives():
    """Central differences of the constrained rates along a motion with the accelerations of the simulator: zero."""
    worst, h = 0.0, 1e-4
    for m, _ in mechanisms():
        q, v = m.q, m.v
        a = m.solve(State(m, 0.0, m.middle(0.0), q, v))[0]
        moved = [State(m, s, m.middle(0.0), q + s * v + s * s / 2 * a, v + s * a) for s in (-h, h)]
        residuals = [np.array([r.x for _, r, _ in state.rows]) for state in moved]
        if len(residuals[0]):
            worst = max(worst, float(np.max(np.abs(residuals[1] - residuals[0]))) / (2 * h) / (1 + max(abs(a))))
    return worst


def energy():
    """Kinetic and potential energy change by work less losses."""
    worst = 0.0
    for _, rows in mechanisms():
        energies = ("work", "loss", "kinetic", "potential")
        size = max([1.0] + [abs(x) for r in rows for k, x in r.items() if k.endswith(energies)])
        total = [r["kinetic"] + r["potential"] - sum(x for k, x in r.items() if k.endswith(".work")) +
                 sum(x for k, x in r.items() if k.endswith(".loss")) for r in rows]
        worst = max(worst, (max(total) - min(total)) / size)
    return worst


if __name__ == "__main__":
    # Tolerances of 1e-11 over up to 10 s; differences have an error of h^2 times third derivatives of about 100.
    bounds = {pendulum: 1e-9, skate: 1e-9, ezyroller: 1e-9, derivatives: 1e-5, energy: 1e-9}
    bad = 0
    for f, bound in bounds.items():
        error = f()
        bad += not error < bound
        print("%s%s: %.2g, bound %g" % ("" if error < bound else "MISMATCH ", f.__name__, error, bound))
    print("%d checks of the reference, %d mismatches" % (len(bounds), bad))
    sys.exit(bad > 0)
