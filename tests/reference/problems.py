"""Reference digits of the problems in benchmarks/scenes, computed twice: from minimal equations derived by hand, with
30 digits, and from a closed form, other equations, published digits or the simulator of this folder.  Prints the
states for tests/methods/test_problems.c, and their differences; takes minutes and needs mpmath and yaml.

  problems.py [PART OF A NAME]                    from the top folder"""
import re
import subprocess
import sys
import mpmath as mp
import yaml
from simulator import Mechanism

mp.mp.dps = 30
FOLDER = "./benchmarks/scenes/"
one, pi = mp.mpf(1), mp.pi


def d(text):
    """A decimal number as it is written."""
    return mp.mpf(text)


def integrate(f, y, t_end, steps, columns=10):
    """y(t_end) of y' = f (t, y), by extrapolation of the modified midpoint rule (Gragg 1965, Bulirsch & Stoer 1966)."""
    t, h, y = mp.mpf(0), mp.mpf(t_end) / steps, list(y)
    for k in range(steps):
        table = []
        for j in range(columns):
            n = 2 * (j + 1)
            s, a = h / n, y
            b = [x + s * g for x, g in zip(a, f(t, a))]
            for i in range(1, n):
                a, b = b, [x + 2 * s * g for x, g in zip(a, f(t + i * s, b))]
            row = [[(x + z + s * g) / 2 for x, z, g in zip(a, b, f(t + h, b))]]
            for i in range(j):
                q = (mp.mpf(n) / (2 * (j - i)))**2 - 1
                row.append([x + (x - z) / q for x, z in zip(row[i], table[i])])
            table = row
        y, t = table[-1], (k + 1) * h
    return y


def dot(a, b):
    return sum(x * z for x, z in zip(a, b))


# ---- The problems: minimal equations; each returns the states that are compared ----


def knife_edge_drift(t):
    """phi = w t, u' = drift w + G cos phi; velocity of the contact point: u along the blade, drift to its left."""
    G, w, u0, drift = d("9.81") / 2, one, d("0.5"), d("0.1")

    def f(t, y):
        x, z, u = y
        c, s = mp.cos(w * t), mp.sin(w * t)
        return [u * c - drift * s, u * s + drift * c, drift * w + G * c]
    y = integrate(f, [0, 0, u0], t, 60)
    return {"skate.x": y[0], "skate.y": y[1]}


def sleigh_friction(t):
    m, I, a, limit, speed, turning = one, one / 2, one / 4, d("0.15"), d("0.02"), d("0.05")

    def f(t, y):
        x, z, phi, u, w = y
        return [u * mp.cos(phi), u * mp.sin(phi), w, a * w * w - limit / m * mp.tanh(u / speed),
                (-m * a * u * w - turning * w) / (I + m * a * a)]
    x, z, phi, u, w = integrate(f, [0, 0, 0, d("-0.4"), 2], t, 1000)
    return {"sleigh.x": x + a * mp.cos(phi), "sleigh.y": z + a * mp.sin(phi), "sleigh.phi": phi, "sleigh.omega": w}


def caster_shimmy(t):
    """Lagrange's equations for y of the pivot and the angle psi of the caster."""
    M, m, I, p, e, V, k, c = one, 3 * one, d("0.05"), d("0.05"), d("0.1"), 5 * one, 4000 * one, 5 * one
    C, limit, v0 = 2000 * one, 100 * one, d("0.01")

    def f(t, y):
        z, psi, v, w = y
        co, si = mp.cos(psi), mp.sin(psi)
        ve, vn = V * co + v * si, v * co - V * si - e * w
        F = -limit * mp.tanh(C * vn / (mp.sqrt(ve * ve + v0 * v0) * limit))
        # [ M + m, -m p cos; -m p cos, I + m p^2 ] a = right
        a11, a12, a22 = M + m, -m * p * co, I + m * p * p
        b1, b2 = F * co - k * z - c * v - m * p * si * w * w, -e * F
        D = a11 * a22 - a12 * a12
        return [v, w, (a22 * b1 - a12 * b2) / D, (a11 * b2 - a12 * b1) / D]
    z, psi, v, w = integrate(f, [0, d("0.02"), 0, 0], t, 3000)
    return {"pivot.y": z, "caster.phi": psi, "pivot.vy": v, "caster.omega": w}


def car_axis(t):
    """Degrees of freedom: the distance of the left mass from its wheel and the angle of the axle; the road is given."""
    m, L, r, W = d("0.0005"), one, d("0.1"), 10 * one

    def road(t):
        s = r * mp.sin(W * t)
        c = mp.sqrt(1 - s * s)
        a1 = r * W * mp.cos(W * t) / c
        a2 = (-W * W * s + a1 * a1 * s) / c
        return s, c, a1, a2

    def f(t, y):
        z, th, v, w = y
        s, c, a1, a2 = road(t)
        n, e, E, N = (-s, c), (c, s), (mp.cos(th), mp.sin(th)), (-mp.sin(th), mp.cos(th))
        left = (z * n[0], z * n[1])
        right = (left[0] + E[0], left[1] + E[1])
        # Accelerations: left = v' n + rest, right = v' n + w' N + rest - w^2 E.
        rest = [-2 * v * a1 * e[i] - z * a2 * e[i] - z * a1 * a1 * n[i] for i in range(2)]

        def force(point, wheel):
            x = [point[i] - wheel[i] for i in range(2)]
            l = mp.sqrt(dot(x, x))
            return [-(l - L / 2) * x[i] / l - (m if i else 0) for i in range(2)]
        FL, FR = force(left, (0, 0)), force(right, e)
        b1 = dot(n, FL) + dot(n, FR) - m * (2 * dot(n, rest) - w * w * dot(n, E))
        b2 = dot(N, FR) - m * dot(N, rest)
        nN = dot(n, N)
        D = m * (2 - nN * nN)
        return [v, w, (b1 - nN * b2) / D, (2 * b2 - nN * b1) / D]
    v0 = -one / 2
    # Left moves along x at -1/2 = -z a1, with a1 = 1: its speed along n and the axle's rate are 0.
    z, th, v, w = integrate(f, [one / 2, 0, 0, 0], t, 3000)
    s, c, a1, _ = road(t)
    left, vl = (-z * s, z * c), (-v * s - z * a1 * c, v * c - z * a1 * s)
    return {"left.x": left[0], "left.y": left[1], "right.x": left[0] + mp.cos(th), "right.y": left[1] + mp.sin(th),
            "left.vx": vl[0], "left.vy": vl[1], "right.vx": vl[0] - w * mp.sin(th), "right.vy": vl[1] + w * mp.cos(th)}


def transmission(t, radii, multiplier=False):
    """radii: a1, b1, a2, b2.  The speed s satisfies the constraint by y' = r2 s, z' = r1 s; multiplier: the equations
    of y and z with the multiplier l instead."""
    (a1, b1, a2, b2), beta = radii, d("0.3")
    k1, k2, rest, off, g = d("1.7"), d("2.3"), d("0.3"), d("0.1"), d("9.81")

    def torques(y, z, u):
        return -k1 * (y - rest) - g * off * mp.cos(y) + beta * u, -k2 * z

    def by_speed(t, state):
        x, y, z, u, s = state
        r1, r2 = a1 + b1 * x, a2 + b2 * x
        Q1, Q2 = torques(y, z, u)
        ds = (r2 * Q1 + r1 * Q2 - (r2 * b2 + r1 * b1) * u * s) / (r1 * r1 + r2 * r2)
        return [u, r2 * s, r1 * s, -x - beta * r2 * s, ds]

    def by_multiplier(t, state):
        x, y, z, u, v, w = state
        r1, r2 = a1 + b1 * x, a2 + b2 * x
        Q1, Q2 = torques(y, z, u)
        l = (r1 * Q1 - r2 * Q2 + (b1 * v - b2 * w) * u) / (r1 * r1 + r2 * r2)
        return [u, v, w, -x - beta * v, Q1 - r1 * l, Q2 + r2 * l]
    x, y, v = d("0.8"), d("0.5"), d("0.6")
    r1, r2 = a1 + b1 * x, a2 + b2 * x
    rates = [v, r1 * v / r2] if multiplier else [v / r2]
    x, y, z = integrate(by_multiplier if multiplier else by_speed, [x, y, 0, 0] + rates, t, 300)[:3]
    return {"carriage.x": x, "first.phi": y, "second.phi": z}


CONTACT, CONES = (d("0.2"), 1, 1, 0), (1, d("0.3"), 1, -d("0.3"))


def slider_crank(t, by_acceleration=False):
    """Crank of length 1 and rod l of 1 kg each, slider of 1 kg: I(theta) theta'^2 / 2 is constant.  The angle follows
    from the time by quadrature and secants; by_acceleration: from theta'' = -I' theta'^2 / (2 I) instead."""
    l = d("1.001")

    def inertia(a):
        """I and I'."""
        c, s = mp.cos(a), mp.sin(a)
        cb = mp.sqrt(1 - (s / l)**2)
        b = -c / (l * cb)  # of the rod's angle beta = -asin (sin theta / l), by theta
        db = (s - s * c * c / (l * l * cb * cb)) / (l * cb)
        sb = -s / l
        x, y, X = -s - l / 2 * sb * b, c + l / 2 * cb * b, -s - l * sb * b
        dx = -c - l / 2 * (cb * b * b + sb * db)
        dy = -s - l / 2 * (sb * b * b - cb * db)
        dX = -c - l * (cb * b * b + sb * db)
        return (one / 3 + l * l * b * b / 12 + x * x + y * y + X * X,
                2 * (l * l * b * db / 12 + x * dx + y * dy + X * dX))
    start, w = pi / 4, 2 * one
    two_E = inertia(start)[0] * w * w
    if by_acceleration:
        def f(t, y):
            I, dI = inertia(y[0])
            return [y[1], -dI * y[1]**2 / (2 * I)]
        return {"crank.phi": integrate(f, [start, w], t, 4000)[0]}

    def time(a):
        cuts = [start] + [x for x in [pi / 2 + s * d(10)**-k for s in (-1,) for k in range(1, 6)] if x < a]
        cuts += [x for x in [pi / 2] + [pi / 2 + d(10)**-k for k in range(5, 0, -1)] if x < a] + [a]
        return mp.quad(lambda x: mp.sqrt(inertia(x)[0] / two_E), cuts)
    return {"crank.phi": mp.findroot(lambda a: time(a) - t, (2.3, 2.5), solver="secant", tol=d("1e-24"))}


# ---- The same problems, by other computations ----


def simulated(name, t):
    """By the simulator of this folder, from the text model with values for its parameters: about 9 digits."""
    text = subprocess.run(["build/pinwheel", "show", "--yaml", FOLDER + name], capture_output=True, text=True,
                          check=True)
    model = yaml.safe_load(text.stdout)
    for e in model["elements"]:
        for signal in [x for x in e.values() if isinstance(x, dict) and "expression" in x]:
            for k, x in model["let"].items():
                signal["expression"] = re.sub(r"\b%s\b" % k, "(%r)" % float(x), signal["expression"])
    m = Mechanism(model)
    return m.run(m.q, m.v, [float(t)], check=False)[-1]


def closed_knife_edge(t):
    G, w, u0, k = d("9.81") / 2, one, d("0.5"), d("0.1")
    s, c = mp.sin(w * t), mp.cos(w * t)
    return {"skate.x": u0 / w * s + k * (t * s + 2 / w * (c - 1)) + G / (2 * w * w) * s * s,
            "skate.y": u0 / w * (1 - c) + k * (2 / w * s - t * c) + G / (2 * w * w) * (w * t - mp.sin(2 * w * t) / 2)}


# The IVP Test Set, release 2.4: the car axis problem at t = 3.
PUBLISHED = {"left.x": "0.493455784275402809122e-1", "left.y": "0.496989460230171153861",
             "right.x": "0.104174252488542151681e1", "right.y": "0.373911027265361256927",
             "left.vx": "-0.770583684040972357970e-1", "left.vy": "0.744686658723778553466e-2",
             "right.vx": "0.175568157537232222276e-1", "right.vy": "0.770341043779251976443"}


CASES = [  # problem, time, minimal equations, other computation, parameters
    ("benchmarks/scenes/knife-edge-drift.yaml", 10, knife_edge_drift, closed_knife_edge, ""),
    ("benchmarks/scenes/transmission.c", 10, lambda t: transmission(t, CONTACT),
     lambda t: transmission(t, CONTACT, multiplier=True), ""),
    ("benchmarks/scenes/transmission.c", 10, lambda t: transmission(t, CONES),
     lambda t: transmission(t, CONES, multiplier=True), "a1=1 b1=0.3 a2=1 b2=-0.3"),
    ("benchmarks/scenes/car-axis.yaml", 3, car_axis, lambda t: {k: d(x) for k, x in PUBLISHED.items()}, ""),
    ("slider-crank", 1, slider_crank, lambda t: slider_crank(t, by_acceleration=True), "l2=1.001"),
    ("benchmarks/scenes/sleigh-friction.yaml", 5, sleigh_friction, lambda t: simulated("sleigh-friction.yaml", t), ""),
    ("benchmarks/scenes/caster-shimmy.yaml", 2, caster_shimmy, lambda t: simulated("caster-shimmy.yaml", t), ""),
]


def main():
    for name, t, first, second, parameters in CASES:
        if sys.argv[1:] and sys.argv[1] not in name:
            continue
        one_way, other_way = first(mp.mpf(t)), second(mp.mpf(t))
        apart = max(abs(x - other_way[k]) for k, x in one_way.items())
        print("%s %s at %d s: %s; both agree to %s" % (name, parameters, t, ", ".join(
            "%s %s" % (k, mp.nstr(x, 18)) for k, x in one_way.items()), mp.nstr(apart, 2)), flush=True)


if __name__ == "__main__":
    main()
