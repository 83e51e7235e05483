"""Reference digits of the vehicles that follow paths and walls, for tests/methods/test_followers.c: equations reduced by
hand, integrated by DOP853; splines of scipy, arc lengths by Gauss's rule.  Prints rows of numbers; needs scipy and yaml.

  followers.py                                    from the top folder"""
import numpy as np
import yaml
from numpy import arctan as atan, cos, sin, tan
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline


class Curve:
    """A spline p(l) through points in the accumulated distance l of the points."""

    def __init__(self, points, closed):
        points = np.array(points + points[:1] if closed else points, dtype=float)
        self.knot = np.append(0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
        self.p = CubicSpline(self.knot, points, bc_type="periodic" if closed else "not-a-knot")
        self.closed, self.gauss = closed, np.polynomial.legendre.leggauss(24)
        self.cells = np.linspace(0, 1, 21)
        self.l = np.unique(np.concatenate([a + (b - a) * self.cells for a, b in zip(self.knot, self.knot[1:])]))
        self.s = np.append(0, np.cumsum([self.part(a, b) for a, b in zip(self.l, self.l[1:])]))
        self.length = self.s[-1]

    def part(self, a, b):
        """Arc length from l = a to b within one piece."""
        node, weight = self.gauss
        return (b - a) / 2 * weight @ np.hypot(*self.p((a + b) / 2 + (b - a) / 2 * node, 1).T)

    def arc_length(self, l):
        i = np.clip(np.searchsorted(self.l, l, side="right") - 1, 0, len(self.l) - 2)
        return self.s[i] + self.part(self.l[i], l)

    def at(self, s):
        """l at an arc length."""
        l = np.interp(s, self.s, self.l)
        for _ in range(20):
            l -= (self.arc_length(l) - s) / np.hypot(*self.p(l, 1))
        return l

    def nearest(self, point, near):
        """Arc length, offset, heading as sine and cosine, curvature of the place next to `near`."""
        lap = np.floor(near / self.length) if self.closed else 0
        l = self.at(np.clip(near - lap * self.length, 0, self.length))
        for _ in range(60):
            r, t, k = self.p(l) - point, self.p(l, 1), self.p(l, 2)
            step = r @ t / (t @ t + r @ k)
            l -= np.clip(step, -1, 1)
            if self.closed:
                lap, l = lap + np.floor(l / self.knot[-1]), l % self.knot[-1]
        t, k = self.p(l, 1), self.p(l, 2)
        v, d = np.hypot(*t), point - self.p(l)
        return (self.arc_length(l) + lap * self.length, (t[0] * d[1] - t[1] * d[0]) / v, t / v,
                (t[0] * k[1] - t[1] * k[0]) / v**3)


def model(name):
    y = yaml.safe_load(open(f"models/vehicles/{name}.yaml"))
    path = y.get("paths", [None])[0]
    return ({p["name"]: float(p["value"]) for p in y["parameters"]},
            path and Curve(path["points"], path.get("closed", False)))


def forces(p, omega, alpha, delta):
    """Forces of the speed, the rear and the front wheel on the body, from its accelerations."""
    m, a, b = p["m"], p["a"], p["b"]
    along, across = -b * omega**2, p["u"] * omega + b * alpha
    front = (p["I"] * alpha + b * m * across) / (a + b) / cos(delta)
    return m * along + front * sin(delta), m * across - front * cos(delta), front


def run(f, y0, times, out):
    x = solve_ivp(f, (0, times[-1]), y0, "DOP853", times, rtol=2.3e-14, atol=1e-13)
    for t, y in zip(times, x.y.T):
        print("    { " + ", ".join(f"{n:.14g}" for n in (t, *out(t, y))) + " },")


def pure_pursuit():
    p, road = model("pure-pursuit")
    L, u = p["a"] + p["b"], p["u"]

    def law(t, y):
        """Rates of x, y of the rear axle, the heading and the steering angle; offset."""
        x, z, phi, delta = y
        s, offset, *_ = road.nearest(y[:2], u * t)
        dx, dy = road.p(road.at(s + p["ahead"])) - y[:2]
        curvature = 2 * (dy * cos(phi) - dx * sin(phi)) / (dx**2 + dy**2)
        return [u * cos(phi), u * sin(phi), u * tan(delta) / L, (atan(L * curvature) - delta) / p["lag"]], offset

    def out(t, y):
        rates, offset = law(t, y)
        x, z, phi, delta = y
        alpha = u * rates[3] / (L * cos(delta)**2)
        return (x + p["b"] * cos(phi), z + p["b"] * sin(phi), phi, delta, offset, *forces(p, rates[2], alpha, delta))
    print("pure-pursuit: t, car.x, car.y, car.phi, steer, offset, cruise.F, rear.N, front.N")
    run(lambda t, y: law(t, y)[0], [2, 1.5, 0, 0], [1, 8, 16], out)


def stanley():
    p, track = model("stanley")
    L, u, k = p["a"] + p["b"], p["u"], p["k"]

    def law(t, y):
        """Rates of x, y of the rear axle and of the heading; offset; steering angle and its rate."""
        phi = y[2]
        _, e, (c, s), curvature = track.nearest(y[:2] + L * np.array([cos(phi), sin(phi)]), u * t)
        turn = atan(k * e / u)
        delta = np.angle(np.exp(1j * (np.arctan2(s, c) - turn - phi)))
        v, omega = u / cos(delta), u * tan(delta) / L
        rate = curvature * v * cos(turn) / (1 - curvature * e) + k / u * v * sin(turn) / (1 + (k * e / u)**2) - omega
        return [u * cos(phi), u * sin(phi), omega], e, delta, rate

    def out(t, y):
        (_, _, omega), e, delta, rate = law(t, y)
        alpha = u * rate / (L * cos(delta)**2)
        return y[0] + p["b"] * cos(y[2]), y[1] + p["b"] * sin(y[2]), y[2], delta, e, *forces(p, omega, alpha, delta)
    t0 = track.p(0, 1) / np.hypot(*track.p(0, 1))
    phi0 = np.arctan2(t0[1], t0[0]) - atan(k * p["e0"] / u)
    front = track.p(0) + p["e0"] * np.array([-t0[1], t0[0]])
    print("stanley: t, car.x, car.y, car.phi, steer, offset, cruise.F, rear.N, front.N")
    run(lambda t, y: law(t, y)[0], [*(front - L * np.array([cos(phi0), sin(phi0)])), phi0], [1, 10, 30], out)


def wall_follower():
    p, _ = model("wall-follower")

    def law(y):
        e = y[1] - p["d"] - p["A"] * sin(y[0])
        heading = atan(p["A"] * cos(y[0])) - atan(p["k"] * e)
        rates = [p["u"] * cos(y[2]), p["u"] * sin(y[2]), p["turn"] * (heading - y[2])]
        fall = rates[1] - p["A"] * cos(y[0]) * rates[0]
        slope = -p["A"] * sin(y[0]) * rates[0] / (1 + (p["A"] * cos(y[0]))**2) - p["k"] * fall / (1 + (p["k"] * e)**2)
        return rates, e, p["turn"] * (slope - rates[2])
    print("wall-follower: t, robot.x, robot.y, robot.phi, robot.omega, offset, drive.F, edge.N, yaw.F")
    run(lambda t, y: law(y)[0], [0, 1, 0], [1, 5, 15],
        lambda t, y: (*y, law(y)[0][2], law(y)[1], 0, p["m"] * p["u"] * law(y)[0][2], p["I"] * law(y)[2]))


pure_pursuit()
stanley()
wall_follower()
