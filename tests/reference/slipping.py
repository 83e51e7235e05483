"""Reference digits of the gallery's models with events, for tests/methods/test_slipping.c: the phases between events, in
equations reduced by hand.  Sleigh and car: integrated by DOP853; rocking block: by quadrature; gripper and hopper: closed
forms.  Prints the times of events and final states; needs scipy and yaml.

  slipping.py                                     from the top folder"""
import glob
import numpy as np
import yaml
from numpy import arccos, arctan, cos, hypot, pi, sin, sqrt
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq


def parameters(name):
    y = yaml.safe_load(open(glob.glob(f"models/*/{name}.yaml")[0]))
    return {p["name"]: float(eval(str(p["value"]), {"pi": pi})) for p in y["parameters"]}


def show(name, events, states):
    print(f"{name}: events " + ", ".join(f"{t:.13g}" for t in events))
    print("    " + ", ".join(f"{k} {v:.12g}" for k, v in states.items()))


# ---- Wheels that slide: phases in which each contact holds or slides ----


class Contact:
    """One or two velocities u = J v with a limit of the size of the force that keeps them 0."""

    def __init__(self, rows, limit):
        self.rows, self.limit, self.slides, self.first = rows, limit, False, None


class Phases:
    """M v' = f (t, q, v) - sum J^T F.  Where a contact slides, F has the size of its limit and the direction of u."""
    SMALL = 1e-9  # slip at which sliding begins, in the direction in which it grows, and ends

    def __init__(self, mass, contacts, force=lambda t, q, v: 0):
        self.M, self.contacts, self.force, self.n = np.array(mass), contacts, force, len(mass)

    def slip(self, c, t, y):
        return c.rows(t, y[:self.n], y[self.n:])[0] @ y[self.n:]

    def accelerations(self, t, q, v):
        """v' and the forces of the contacts that hold, in their order."""
        f, J, gamma = self.force(t, q, v) + np.zeros(self.n), [], []
        for c in self.contacts:
            rows, g = c.rows(t, q, v)
            if c.slides:
                u = rows @ v
                size = np.linalg.norm(u)
                f = f - rows.T @ (u / size if size > self.SMALL / 2 else c.first) * c.limit(t)
            else:
                J.append(rows), gamma.append(g)
        if not J:
            return f / self.M, []
        J, gamma = np.vstack(J), np.concatenate(gamma)
        F = np.linalg.solve(J / self.M @ J.T, J @ (f / self.M) - gamma)
        return (f - J.T @ F) / self.M, F

    def held(self, F):
        """The part of each contact that holds in these forces."""
        at = 0
        for c in self.contacts:
            if not c.slides:
                rows = c.count
                yield c, F[at:at + rows]
                at += rows

    def begin(self, c, t, q, v):
        """Sliding begins in the direction n of the slip's rate: u' = b - A n, n = u'/|u'|."""
        c.slides, c.first = True, np.zeros(c.count)
        J, gamma = c.rows(t, q, v)
        others = [J @ self.accelerations_with(c, t, q, v, e) - gamma for e in [np.zeros(c.count), *np.eye(c.count)]]
        b, A = others[0], np.column_stack([others[0] - o for o in others[1:]])
        n = np.linalg.lstsq(A, b, rcond=None)[0] if A.any() else b
        n = n / np.linalg.norm(n)
        for _ in range(1000):
            rate = b - A @ n
            if np.linalg.norm(rate) < 1e-6 * np.linalg.norm(b):
                break  # the limit has just been reached
            n = n + rate / np.linalg.norm(rate)
            n /= np.linalg.norm(n)
        c.first = n
        return v + np.linalg.pinv(J) @ ((self.SMALL * n if c.count == 2 else 0) - J @ v)

    def accelerations_with(self, c, t, q, v, n):
        """v' with the slip 0 and this direction of the force of contact c."""
        c.first, keep = n, c.rows
        J, gamma = keep(t, q, v)
        c.rows = lambda t, q, v: (J, gamma)
        try:
            return self.accelerations(t, q, v - np.linalg.pinv(J) @ (J @ v))[0]
        finally:
            c.rows = keep

    def run(self, q, v, t_end, breaks=()):
        """The state at t_end, and the times of events.  breaks: times at which limits jump."""
        t, y, events, n = 0., np.concatenate([q, v]), [], self.n
        for c in self.contacts:
            c.count = len(c.rows(t, y[:n], y[n:])[1])
        while t < t_end:
            stop = min([b for b in breaks if b > t] + [t_end])
            changed = True
            while changed:  # contacts that cannot hold here slide
                changed = False
                for c, F in list(self.held(self.accelerations(t, y[:n], y[n:])[1])):
                    if np.linalg.norm(F) > c.limit(t) * (1 + 1e-9) + 1e-12:
                        y[n:], changed = self.begin(c, t, y[:n], y[n:]), True
                        events += [t]
                        break

            def function(c):
                if c.slides and c.count == 1:  # u changes its sign, by more than round-off
                    sign = np.sign(self.slip(c, t, y)[0] + 1e-3 * self.SMALL * c.first[0])
                    g = lambda t, y: sign * self.slip(c, t, y)[0] + 1e-12
                elif c.slides:  # |u| falls below SMALL
                    g = lambda t, y: np.linalg.norm(self.slip(c, t, y)) / self.SMALL - 0.9
                else:
                    g = lambda t, y: c.limit(t) - next(np.linalg.norm(F) for o, F in self.held(
                        self.accelerations(t, y[:n], y[n:])[1]) if o is c)
                g.terminal, g.direction = True, -1
                return g
            x = solve_ivp(lambda t, y: np.concatenate([y[n:], self.accelerations(t, y[:n], y[n:])[0]]), (t, stop), y,
                          "DOP853", rtol=1e-12, atol=1e-13, max_step=0.02, events=[function(c) for c in self.contacts])
            t, y = x.t[-1], x.y[:, -1]
            for c, at in zip(self.contacts, x.t_events):
                if len(at) and c.slides:
                    c.slides = False
                    J = c.rows(t, y[:n], y[n:])[0]
                    y[n:] -= np.linalg.pinv(J) @ (J @ y[n:])
                    events += [t]
                elif len(at):
                    y[n:] = self.begin(c, t, y[:n], y[n:])
                    events += [t]
        return y, events


def across(x, heading):
    """Rows of the velocity across a heading [rad], and along it, of the point (x, 0) of a body; J and -J' v."""
    def row(q, v, phi, d):
        e = np.array([cos(phi), sin(phi)]) if d else np.array([-sin(phi), cos(phi)])
        arm = x * np.array([cos(q[2]), sin(q[2])])
        turn = np.array([-e[1], e[0]])
        J = [*e, e @ [-arm[1], arm[0]]]
        point = v[:2] + v[2] * np.array([-arm[1], arm[0]])
        return J, v[2]**2 * (e @ arm), turn @ point
    return row


def sleigh():
    p = parameters("skidding-sleigh")

    def rows(t, q, v):
        J, centripetal, turned = across(-p["a"], 0)(q, v, q[2], 0)
        return np.array([J]), np.array([centripetal - v[2] * turned])
    x, events = Phases([p["m"], p["m"], p["I"]], [Contact(rows, lambda t: p["grip"])]).run(
        [p["a"], 0, 0], [p["u0"], p["a"] * p["w0"], p["w0"]], 8)
    show("skidding-sleigh", events, dict(zip(("sleigh.x", "sleigh.y", "sleigh.phi"), x)))


def car():
    p = parameters("drifting-car")
    weight = 9.81 * p["m"] / (p["a"] + p["b"])

    def steer(t):
        """The angle, its rate: a smooth step of degree 5."""
        s = np.clip((t - 0.2) / 0.6, 0, 1)
        return p["steer"] * s**3 * (10 - 15 * s + 6 * s * s), p["steer"] * 30 * s * s * (1 - s)**2 / 0.6

    def front(t, q, v):
        delta, rate = steer(t)
        J, centripetal, turned = across(p["a"], 0)(q, v, q[2] + delta, 0)
        return np.array([J + [0]]), np.array([centripetal - (v[2] + rate) * turned])

    def rear(t, q, v):
        side, ahead = (across(-p["b"], 0)(q, v, q[2], d) for d in (0, 1))
        return (np.array([side[0] + [0], ahead[0] + [-0.3]]),
                np.array([side[1] - v[2] * side[2], ahead[1] - v[2] * ahead[2]]))

    def brake(t, q, v):
        return np.array([[0., 0, 0, 1]]), np.zeros(1)

    def pulled(t):
        return p["brake"] if p["start"] <= t < p["start"] + p["width"] else 0.

    contacts = [Contact(front, lambda t: p["mu"] * p["b"] * weight), Contact(rear, lambda t: p["mu"] * p["a"] * weight),
                Contact(brake, pulled)]
    contacts[2].slides, contacts[2].first = True, np.ones(1)
    x, events = Phases([p["m"], p["m"], p["I"], 3], contacts).run(
        [0, 0, 0, 0], [p["u0"], 0, 0, p["u0"] / 0.3], 5, (p["start"], p["start"] + p["width"]))
    show("drifting-car", events, dict(zip(("car.x", "car.y", "car.phi", "rear.spin"), x)))


# ---- Contacts ----


def gripper():
    """The arm is at A (1 - cos w t); the part sticks, or its acceleration is 2 mu F/m - g."""
    p = parameters("gripper")
    A, w, limit = p["A"], p["w"], 2 * p["mu"] * p["F"] / p["m"] - 9.81
    t, y, v, t_end, events = 0., -0.1, 0., 2., [0.]
    ahead = arccos(limit / (A * w * w)) / w  # before and after t = 2 pi n/w the arm needs more than the limit
    while True:
        s = lambda T: v + limit * (T - t) - A * w * sin(w * T)
        stick = brentq(s, t + 1e-3 + ahead, t + 2 * pi / w, xtol=1e-15)
        if stick > t_end:
            break
        y, t = y + v * (stick - t) + limit / 2 * (stick - t)**2, stick
        events += [t]
        slide = 2 * pi / w * np.ceil(t * w / (2 * pi)) - ahead
        y += A * (cos(w * t) - cos(w * slide))
        t, v = slide, A * w * sin(w * slide)
        if t > t_end:
            break
        events += [t]
    y += v * (t_end - t) + limit / 2 * (t_end - t)**2
    show("gripper", events, {"part.y": y})


def block():
    """theta, the angle of the line from the corner to the centre from the vertical, is alpha where both corners touch:
    theta'' = k sin theta, k = 3 g/(4 R).  The impacts are those of Housner."""
    p = parameters("rocking-block")
    R, alpha = hypot(p["width"], p["height"]) / 2, arctan(p["width"] / p["height"])
    k, factor = 3 * 9.81 / (4 * R), 1 - 1.5 * sin(alpha)**2
    rest, t, events = alpha - p["tilt"], 0., []  # rest: theta where it turns back

    def fall():
        """The time from `rest` to alpha, theta = rest + s^2."""
        return quad(lambda s: s / sqrt(k * sin(rest + s * s / 2) * sin(s * s / 2)), 0, sqrt(alpha - rest), epsabs=1e-14,
                    epsrel=1e-13)[0]
    for _ in range(8):
        t += fall()
        events += [t]
        rest = arccos(cos(alpha) + factor**2 * (cos(rest) - cos(alpha)))
        t += fall()
    show("rocking-block", events, {})


def hopper():
    """The foot (x, y), mass m + mf, is driven by the trunk, which is at foot + l(t) (sin lean, cos lean)."""
    p = parameters("hopper")
    M, r, L, w, mu, e, up = (p["m"] + p["mf"], p["r"], p["l"], p["w"], p["mu"], sin(p["lean"]), cos(p["lean"]))

    def leg(t):
        """Length and its rate; the crank begins at the top: the rod is long by l - r."""
        c, s = cos(w * t), sin(w * t)
        root = sqrt(L * L - (r * s)**2)
        return root - r * c, w * (r * s - r * r * s * c / root)

    def second(t):
        h = 1e-3 / w
        return sum(k * leg(t + i * h)[1] for i, k in ((-3, -1), (-2, 9), (-1, -45), (1, 45), (2, -9), (3, 1))) / (60 * h)
    share = p["m"] / M
    normal = lambda t: M * 9.81 + p["m"] * second(t) * up
    pull = lambda t: p["m"] * second(t) * e  # needed along the ground where the foot sticks
    t, x, t_end, events = 0., 0., 3.9, [0.]

    def root(f, t):
        step = 1e-4
        while f(t + step) > 0:
            t += step
        return brentq(f, t, t + step, xtol=1e-15)
    while True:
        slide = root(lambda T: mu * normal(T) - abs(pull(T)), t)
        events += [slide]
        sign = np.sign(-pull(slide))  # of the velocity with which the foot slides
        off = root(normal, slide)
        # (m + mf) v' = -pull - sign mu normal, integrated once and twice
        b = lambda T: share * (leg(T)[1] - leg(slide)[1])
        g = lambda T: 9.81 * (T - slide)
        vx = lambda T: -b(T) * e - sign * mu * (g(T) + b(T) * up)
        u0 = vx(off)
        span = off - slide
        area = share * (leg(off)[0] - leg(slide)[0] - leg(slide)[1] * span)
        x += -area * e - sign * mu * (9.81 / 2 * span**2 + area * up)
        events += [off]
        flight = lambda T, d, v0, acc: v0 * (T - off) - share * d * (leg(T)[0] - leg(off)[0] - leg(off)[1] * (T - off)) + acc / 2 * (T - off)**2
        y = lambda T: flight(T, up, 0., -9.81)
        if y(t_end) > 0 and t_end < off + 0.25:
            break
        land = root(y, off + 1e-3)
        x += flight(land, e, u0, 0)
        vy = -share * up * (leg(land)[1] - leg(off)[1]) - 9.81 * (land - off)
        vx = u0 - share * e * (leg(land)[1] - leg(off)[1])
        assert abs(vx) < mu * abs(vy)  # it sticks
        events += [land]
        t = land
    x += flight(t_end, e, u0, 0)
    show("hopper", events, {"foot.x": x, "foot.y": y(t_end) + 0.015})


for problem in (sleigh, car, gripper, block, hopper):
    problem()
