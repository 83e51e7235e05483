"""A second simulator: dense, from the positions of points and their derivatives, without any of Pinwheel's code.

It reads a text model in the syntax of JSON, without expressions for numbers.  The equations of the elements are those
of the manual, written with points, directions and rates.  A constraint prescribes a coordinate or a rate; its
multiplier mu is the force or moment whose power is mu times that rate:

    M a = f + J^T mu,    J a + b = 0         b: the derivatives of the constrained rates at zero accelerations.

  simulator.py MODEL [T_END]                      prints the states at 0 and T_END [s]"""
import json
import math
import sys
import numpy as np
from scipy.integrate import DOP853
import taylor
from taylor import Jet, Rate, dot
from signals import Signal


np.seterr(all="ignore")  # a motion that is not finite is rejected later


class Failure(Exception):
    """A mechanism for which the reference has no reliable solution; the text has the reason."""


class Frame:
    """A body in motion, or the ground: position z of its centre of mass, direction e of its x axis, angle phi."""

    def __init__(self, z, phi):
        self.z, self.phi = z, phi
        self.e = taylor.turn(phi)

    def point(self, s):
        return self.z + self.e * complex(*s)

    def direction(self, angle):
        return self.e * complex(math.cos(angle), math.sin(angle))


class State:
    """One state of a mechanism: frames of its bodies, constraints and forces of its elements.

    rows: constraints (name, Rate that is zero, g or None); f: applied forces by coordinate; work, loss: powers by
    element [W]; potential [J]; driven: (name, row, rate that a signal prescribes); limited: equations that hold only
    within limits, which events.py decides on."""

    def __init__(self, m, t, middle, q, v):
        self.m, self.t, self.middle = m, t, middle
        self.v, unit = v, m.unit
        self.coordinate = [Jet(q[i], v[i], 0.0, unit[i]) for i in range(m.n)]
        zero = np.zeros(m.n)
        self.frame = {"ground": Frame(Jet(0j, 0j, 0j, zero), Jet(0.0, 0.0, 0.0, zero))}
        for k, name in enumerate(m.bodies):
            i = 3 * k
            self.frame[name] = Frame(Jet(complex(q[i], q[i + 1]), complex(v[i], v[i + 1]), 0j,
                                         unit[i] + 1j * unit[i + 1]),
                                     self.coordinate[i + 2])
        self.states = m.named(q, v) if m.reads_states else None
        self.rows, self.limited, self.f = [], [], np.zeros(m.n)
        self.work, self.loss, self.potential = {}, {}, 0.0
        self.driven = []
        for kind, name, e in m.elements:
            KINDS[kind](self, name, e)

    def signal(self, e, field):
        s = self.m.signals.get((id(e), field))
        return s.at(self.t, self.middle, self.states) if s else Jet(0.0)

    def frames(self, e):
        return [self.frame[b] for b in e["body"]]

    def points(self, e):
        return [self.frame[b].point(s) for b, s in zip(e["body"], e.get("at", [[0, 0], [0, 0]]))]

    def constrain(self, name, g):
        """Adds the holonomic constraint g = 0."""
        self.rows.append((name, g.rate(), g.x))

    def limit(self, e, field):
        """The value of a limit, or None."""
        s = self.m.signals.get((id(e), field))
        return s.at(self.t, self.middle, self.states).x * self.m.factor(e[field]) if s else None

    def hold(self, name, e, field, *rates):
        """Constrains rates: up to a limit of their multipliers, if there is one."""
        most = self.limit(e, field)
        if most is None:
            self.rows += [(name[:-1] + part, r, None) for part, r in zip("NT", rates)]
        else:
            sliding = self.limit(e, field + "_sliding")
            self.limited.append(Limited(name, rates, most=most, sliding=most if sliding is None else sliding))

    def one_sided(self, name, rate, gap, restitution=0, angular=False):
        """rate >= 0 where gap = 0; its multiplier is >= 0."""
        self.limited.append(Limited(name, [rate], gap=gap, restitution=restitution, angular=angular))

    def apply(self, effort, rate):
        """Adds a force or moment whose power is effort times rate."""
        self.f += effort * rate.g

    def apply_at(self, F, P):
        """Adds a force, as a vector, at a point."""
        self.f += (F.conjugate() * P.g).real


class Limited:
    """Rates that are 0 while their multipliers mu are within limits.

    Friction of one rate, or of two, a vector: |mu| <= most; sliding: |mu| where the rates are not 0.  One-sided, with a
    gap (NaN: of a rate only): rate >= 0 where gap <= 0, mu >= 0.  Friction of a contact: `normal` is its one-sided
    equation, most and sliding are factors of that multiplier."""

    def __init__(self, name, rates, most=None, sliding=None, gap=None, restitution=0, normal=None, angular=False):
        self.name, self.rates, self.most, self.sliding, self.normal = name, rates, most, sliding, normal
        self.gap, self.restitution, self.angular = gap, restitution, angular


def pin(state, name, e):
    P, Q = state.points(e)
    d = P - Q
    state.constrain(name + ".Fx", taylor.real(d))
    state.constrain(name + ".Fy", taylor.real(d * -1j))


def weld(state, name, e):
    pin(state, name, e)
    A, B = state.frames(e)
    state.constrain(name + ".M", A.phi - B.phi + e.get("angle", 0))


def slot(state, name, e):
    P, Q = state.points(e)
    state.constrain(name + ".N", dot(state.frames(e)[1].direction(e.get("heading", 0)) * 1j, P - Q))


def slider(state, name, e):
    slot(state, name, e)
    A, B = state.frames(e)
    state.constrain(name + ".M", A.phi - B.phi - e.get("angle", 0))


def rod(state, name, e):
    P, Q = state.points(e)
    state.constrain(name + ".F", taylor.sqrt(dot(P - Q, P - Q)) - e["length"])


def gear(state, name, e):
    A, B, C = (f.phi for f in state.frames(e))
    a, b, c = (state.m.start_angle(x) for x in e["body"])
    i = e["ratio"]
    offset = e.get("offset", 0) if e.get("from", "start") == "offset" else a - c - i * (b - c)
    state.constrain(name + ".M", A - C - (B - C) * i - offset)


def drive(state, name, e):
    u = state.signal(e, "value")
    A, B = state.frames(e)
    P, Q = state.points(e)
    if e["what"] == "angle":
        g = A.phi - B.phi - u
    else:
        g = dot(B.direction(0 if e["what"] == "x" else math.pi / 2), P - Q) - u
    state.constrain(name + ".F", g)
    state.driven.append((name, len(state.rows) - 1, u.d))


def heading(state, e):
    return state.frame[e["body"]].direction(e.get("heading", 0))


def contact(state, e):
    return state.frame[e["body"]].point(e.get("at", [0, 0]))


def wheel(state, name, e):
    state.hold(name + ".N", e, "grip", dot(heading(state, e) * 1j, contact(state, e).rate()))


def rolling_wheel(state, name, e):
    spin = state.coordinate[state.m.own[name]]
    h, velocity = heading(state, e), contact(state, e).rate()
    state.hold(name + ".N", e, "grip", dot(h * 1j, velocity), dot(h, velocity) - spin.rate() * e["radius"])
    if "brake" in e:
        state.hold(name + ".B", e, "brake", spin.rate())
    u = state.signal(e, "torque").x
    state.apply(u, spin.rate())
    state.work[name] = u * spin.d


def steered_wheel(state, name, e):
    h = state.frame[e["body"]].e * taylor.turn(state.signal(e, "heading"))
    state.hold(name + ".N", e, "grip", dot(h * 1j, contact(state, e).rate()))


def stop(state, name, e):
    A, B = state.frames(e)
    P, Q = state.points(e)
    g = A.phi - B.phi if e["what"] == "angle" else dot(B.direction(0 if e["what"] == "x" else math.pi / 2), P - Q)
    for side, gap in (("low", g - e.get("low", 0)), ("high", e.get("high", 0) - g)):
        if side in e:
            state.one_sided(name + "." + side, gap.rate(), gap.x, e.get("restitution", 0), e["what"] == "angle")


def rope(state, name, e):
    P, Q = state.points(e)
    gap = e["length"] - taylor.sqrt(dot(P - Q, P - Q))
    state.one_sided(name + ".F", gap.rate(), gap.x, e.get("restitution", 0))


def freewheel(state, name, e):
    A, B = state.frames(e)
    state.one_sided(name + ".T", (A.phi - B.phi).rate(), math.nan, 0, True)


def contact_of_bodies(state, name, e):
    """A disc on a line, or on another disc; tangent h, normal h i, C: where they touch."""
    A, B = state.frames(e)
    P, Q = state.points(e)
    r, other = e.get("radius", 0), e.get("other_radius", 0)
    if other > 0:
        d = taylor.sqrt(dot(P - Q, P - Q))
        h, gap = (P - Q) / d * -1j, d - (r + other)
    else:
        h = B.direction(e.get("heading", 0))
        gap = dot(h * 1j, P - Q) - r
    state.one_sided(name + ".N", gap.rate(), gap.x, e.get("restitution", 0))
    if e.get("mu", 0) > 0:
        C = P - h * (1j * r)
        sliding = dot(h, P.rate()) + A.phi.rate() * r - dot(h, Q.rate()) - taylor.product(dot(h, (C - Q) * 1j),
                                                                                           B.phi.rate())
        state.limited.append(Limited(name + ".T", [sliding], most=e["mu"], sliding=e.get("mu_sliding", e["mu"]),
                                     normal=state.limited[-1]))


def prescribed(state, name, rate, u):
    """Constrains a rate to the signal u; the work of the element is that of mu."""
    state.rows.append((name + ".F", Rate(rate.x - u.x, rate.d - u.d, rate.g), None))
    state.driven.append((name, len(state.rows) - 1, u.x))


def speed(state, name, e):
    prescribed(state, name, dot(heading(state, e), contact(state, e).rate()), state.signal(e, "value"))


def pfaffian(state, name, e):
    A, B = state.frames(e)
    total = None
    for body, (x, y, turning) in ((A, e["a"]), (B, e.get("b", [0, 0, 0]))):
        part = dot(A.e * complex(x, y), body.z.rate()) + body.phi.rate() * turning
        total = part if total is None else total + part
    prescribed(state, name, total, state.signal(e, "value"))


def tyre(state, name, e):
    P, h = contact(state, e), heading(state, e)
    along, across = dot(h, P.rate()).x, dot(h * 1j, P.rate()).x
    F = -e["stiffness"] * across / math.hypot(along, e["speed"])
    limit = e.get("load", 0) * e.get("friction", 0)
    if limit > 0:
        F = limit * math.tanh(F / limit)
    state.apply_at(F * h.x * 1j, P)
    state.loss[name] = -F * across


def rolling_resistance(state, name, e):
    w = dot(heading(state, e), contact(state, e).rate())
    F = -e["limit"] * math.tanh(w.x / e["speed"])
    state.apply(F, w)
    state.loss[name] = -F * w.x


def spring(state, name, e):
    P, Q = state.points(e)
    l = taylor.sqrt(dot(P - Q, P - Q))
    state.m.check_length(l.x, name)
    stretch, c = l.x - e.get("length", 0), e.get("damping", 0)
    state.apply(-e["stiffness"] * stretch - c * l.d, l.rate())
    state.potential += e["stiffness"] * stretch**2 / 2
    state.loss[name] = c * l.d**2


def rotational_spring(state, name, e):
    A, B = state.frames(e)
    angle, c = A.phi - B.phi - e.get("angle", 0), e.get("damping", 0)
    state.apply(-e["stiffness"] * angle.x - c * angle.d, angle.rate())
    state.potential += e["stiffness"] * angle.x**2 / 2
    state.loss[name] = c * angle.d**2


def resist(state, name, e, w):
    """Viscous and Coulomb friction against the rate w; without a speed the latter is exact."""
    F = e.get("viscous", 0) * w.x
    if "limit" in e and "speed" not in e:
        state.hold(name, e, "limit", w)
    elif e.get("limit", 0) > 0:
        F += e["limit"] * math.tanh(w.x / e["speed"])
    state.apply(-F, w)
    state.loss[name[:-2]] = F * w.x


def friction(state, name, e):
    A, B = state.frames(e)
    resist(state, name + ".T", e, (A.phi - B.phi).rate())


def sliding_friction(state, name, e):
    P, Q = state.points(e)
    resist(state, name + ".F", e, dot(state.frames(e)[1].direction(e.get("heading", 0)), P - Q).rate())


def drag(state, name, e):
    A = state.frame[e["body"]]
    v, w = A.z.d, A.phi.d
    F = -(e.get("linear", 0) + e.get("quadratic", 0) * abs(v)) * v
    M = -(e.get("turning", 0) + e.get("turning_quadratic", 0) * abs(w)) * w
    state.apply_at(F, A.z)
    state.apply(M, A.phi.rate())
    state.loss[name] = -(F * v.conjugate()).real - M * w


def gravity(state, name, e):
    a = complex(*e["acceleration"])
    for body, mass in zip(state.m.bodies, state.m.mass[0::3]):
        z = state.frame[body].z
        state.apply_at(mass * a, z)
        state.potential -= mass * (a.conjugate() * z.x).real


def force(state, name, e):
    F = complex(state.signal(e, "fx").x, state.signal(e, "fy").x)
    if e.get("axes", "world") == "body":
        F *= state.frame[e["body"]].e.x
    P = contact(state, e)
    state.apply_at(F, P)
    state.work[name] = (F.conjugate() * P.d).real


def apply_torque(state, name, e, T):
    """A torque T on body 1, -T on body 2."""
    A, B = state.frames(e)
    angle = A.phi - B.phi
    state.apply(T, angle.rate())
    state.work[name] = T * angle.d


def torque(state, name, e):
    apply_torque(state, name, e, state.signal(e, "value").x)


def motor(state, name, e):
    A, B = state.frames(e)
    angle = A.phi - B.phi
    y = e.get("stiffness", 0) * (state.signal(e, "angle").x - angle.x) + \
        e.get("damping", 0) * (state.signal(e, "rate").x - angle.d)
    limit = e.get("limit", 0)
    apply_torque(state, name, e, limit * math.tanh(y / limit) if limit > 0 else y)


def marker(state, name, e):
    pass


KINDS = {f.__name__.replace("_", "-"): f for f in (
    pin, weld, slider, slot, rod, gear, drive, wheel, rolling_wheel, steered_wheel, speed, pfaffian, tyre,
    rolling_resistance, spring, rotational_spring, friction, sliding_friction, drag, gravity, force, torque, motor,
    marker, stop, rope, freewheel)} | {"contact": contact_of_bodies}
SIGNALS = {("drive", "value"), ("speed", "value"), ("pfaffian", "value"), ("torque", "value"),
           ("rolling-wheel", "torque"), ("force", "fx"), ("force", "fy"), ("motor", "angle"), ("motor", "rate"),
           ("steered-wheel", "heading"), ("rolling-wheel", "brake")} | {
               (kind, field + end) for kind, field in (("wheel", "grip"), ("steered-wheel", "grip"), ("rolling-wheel", "grip"),
                                                       ("friction", "limit"), ("sliding-friction", "limit"))
               for end in ("", "_sliding")}


class Mechanism:
    """A model, ready to be evaluated.

    bodies, elements: of the description; n coordinates: x, y, phi of each body, then the spin angles `own`; mass (n,):
    masses and inertias; q, v (n,): the described start."""

    def __init__(self, model):
        self.model, self.bodies = model, [b["name"] for b in model["bodies"]]
        self.elements = [(kind, e[kind], e) for e in model["elements"] for kind in KINDS if next(iter(e)) == kind]
        if len(self.elements) < len(model["elements"]):
            raise Failure("an element of a kind that is not known")
        rolling = [(name, e) for kind, name, e in self.elements if kind == "rolling-wheel"]
        self.own = {name: 3 * len(self.bodies) + i for i, (name, e) in enumerate(rolling)}
        self.n = 3 * len(self.bodies) + len(rolling)
        self.unit = np.eye(self.n)
        self.mass = np.array([x for b in model["bodies"] for x in [b.get("mass", 0)] * 2 + [b.get("inertia", 0)]] +
                             [e.get("inertia", 0) for _, e in rolling], float)
        self.lightest = min(self.mass[self.mass > 0], default=1.0)
        start = [b.get("start", {}).get(k, 0) for b in model["bodies"] for k in ("x", "y", "phi")]
        rate = [b.get("rate", {}).get(k, 0) for b in model["bodies"] for k in ("vx", "vy", "omega")]
        self.q = np.array(start + [e.get("start", 0) for _, e in rolling], float)
        self.v = np.array(rate + [e.get("rate", 0) for _, e in rolling], float)
        self.reads_states, self.signals = False, {}
        for kind, name, e in self.elements:
            for field, value in e.items():
                if (kind, field) in SIGNALS:
                    s = self.signals[id(e), field] = Signal(self.load(value))
                    self.reads_states = self.reads_states or s.states
        self.breaks = sorted({b for s in self.signals.values() for b in s.breaks})
        self.length = self._length()
        self.regular = False  # set by run: the constraints are independent

    def _length(self):
        """L of the manual, section Scales and tolerances; markers do not count."""
        far = 0.0
        for kind, _, e in self.elements:
            if "at" in e and kind != "marker":
                single = isinstance(e["body"], str)
                for body, at in zip([e["body"]] if single else e["body"], [e["at"]] if single else e["at"]):
                    far = max(far, math.hypot(*at) if body != "ground" else 0)
        if far > 0:
            return far
        for b in self.model["bodies"]:
            if b.get("mass", 0) > 0:
                return math.sqrt(b.get("inertia", 0) / b["mass"]) or 1.0
        return 1.0

    @staticmethod
    def load(value):
        """The signal of a field: of a limit with a friction coefficient, that of the load."""
        return value["load"] if isinstance(value, dict) and "load" in value else value

    @staticmethod
    def factor(value):
        return value["mu"] if isinstance(value, dict) and "load" in value else 1.0

    def start_angle(self, body):
        return 0.0 if body == "ground" else self.q[3 * self.bodies.index(body) + 2]

    @staticmethod
    def check_length(length, name):
        """Fails where the direction of a spring is badly defined."""
        if length < 0.05:
            raise Failure("the ends of " + name + " meet")

    def names(self):
        return [b + s for b in self.bodies for s in (".x", ".y", ".phi")] + [o + ".spin" for o in self.own], \
               [b + s for b in self.bodies for s in (".vx", ".vy", ".omega")] + [o + ".spin_rate" for o in self.own]

    def named(self, q, v):
        a, b = self.names()
        return dict(zip(a + b, list(q) + list(v)))

    # ---- Equations ----

    def constraints(self, state):
        """J, the residuals of the constrained rates, and b."""
        J = np.array([r.g for _, r, _ in state.rows]).reshape(len(state.rows), self.n)
        return J, np.array([r.x for _, r, _ in state.rows]), np.array([r.d for _, r, _ in state.rows])

    def weights(self, state):
        """The weight of each multiplier in the least-squares norm: 1 of a force, 1/L of a moment."""
        angles = {name for kind, name, e in self.elements if kind == "drive" and e["what"] == "angle"}
        return np.array([1 / self.length if name.endswith(".M") or name[:-2] in angles else 1.0 for name, _,
                         _ in state.rows])

    def solve(self, state):
        """Accelerations (n,) and multipliers (rows,); where these are not unique, those of the smallest norm."""
        J, _, b = self.constraints(state)
        k, n = len(b), self.n
        if k == 0:
            return state.f / self.mass, np.zeros(0)
        w = self.weights(state)
        K = np.zeros((n + k, n + k))
        K[:n, :n] = np.diag(self.mass)
        K[:n, n:] = -(J / w[:, None]).T
        K[n:, :n] = J / w[:, None]
        r = np.concatenate([state.f, -b / w])
        if self.regular:
            x = np.linalg.solve(K, r)
        else:
            x = np.linalg.lstsq(K, r, rcond=1e-9)[0]
        return x[:n], x[n:] / w

    def derivative(self, t, middle, y):
        n = self.n
        state = State(self, t, middle, y[:n], y[n:2 * n])
        a, mu = self.solve(state)
        return np.concatenate([y[n:2 * n], a, list(self.powers(state, mu).values())])

    def powers(self, state, mu):
        """Powers by column of the ledger, such as "T.work"."""
        p = {name + ".work": x for name, x in state.work.items()}
        p.update({name + ".work": mu[i] * u for name, i, u in state.driven})
        p.update({name + ".loss": x for name, x in state.loss.items()})
        return p

    # ---- Consistent states ----

    def middle(self, t):
        """A time after t and before the next break: it selects the smooth pieces of the signals."""
        after = [b for b in self.breaks if b > t]
        return (t + after[0]) / 2 if after else t + 1

    def project(self, q, v):
        """The consistent state next to (q, v) at t = 0: Gauss-Newton on positions, then velocities."""
        middle = self.middle(0.0)
        for _ in range(20):
            state = State(self, 0.0, middle, q, v)
            held = [i for i, (_, _, g) in enumerate(state.rows) if g is not None]
            if not held:
                break
            g = np.array([state.rows[i][2] for i in held])
            if max(abs(g)) < 1e-14:
                break
            q = q - np.linalg.lstsq(self.constraints(state)[0][held], g, rcond=1e-9)[0]
        state = State(self, 0.0, middle, q, v)
        J, residual, _ = self.constraints(state)
        return q, v - np.linalg.lstsq(J, residual, rcond=1e-9)[0] if len(J) else v

    def condition(self, state):
        """Smallest nonzero singular value of J with rows of length 1; its rank; smallest eigenvalue of M on its null
        space."""
        J, _, _ = self.constraints(state)
        scale = np.ones(self.n)
        scale[2:3 * len(self.bodies):3] = 1 / self.length
        if not len(J):
            return 1.0, 0, (min(self.mass) > 0) * 1.0
        J = J * scale
        s = np.linalg.svd(J / np.linalg.norm(J, axis=1)[:, None], compute_uv=False)
        rank = int(np.sum(s > 1e-7))
        _, _, V = np.linalg.svd(J)
        N = V[rank:]
        kinetic = np.linalg.eigvalsh((N * (self.mass * scale**2)) @ N.T) if len(N) else np.array([1.0])
        return s[rank - 1], rank, kinetic[0]

    # ---- Runs ----

    def run(self, q, v, times, check=True):
        """States at the times [s]: a list of dicts of columns, as a table of `pinwheel run --energy` has them.  Raises
        Failure where the motion fails; check: or comes near a singular configuration, or is too fast to be compared."""
        t, k = 0.0, len(self.powers(State(self, 0, self.middle(0), q, v), np.zeros(1000)))
        y = np.concatenate([q, v, np.zeros(k)])
        rank = None
        out = []
        stops = sorted(set(times) | {b for b in self.breaks if 0 < b < max(times)})
        for stop in [0.0] + stops:
            middle = (t + stop) / 2 if stop > 0 else self.middle(0)
            if stop > 0:
                solver = DOP853(lambda s, z: self.derivative(s, middle, z), t, y, stop, rtol=1e-11, atol=1e-12)
                steps = 0
                while solver.status == "running":
                    if solver.step() is not None or steps > 3000:
                        raise Failure("the reference fails, or needs more than 3000 steps")
                    steps += 1
                    if check:
                        self.watch(solver.t, middle, solver.y, rank)
                y, t = solver.y, stop
            else:
                state = State(self, 0, middle, q, v)
                smallest, rank, kinetic = self.condition(state)
                self.regular = rank == len(state.rows)
            if stop in times or stop == 0:
                out.append(self.columns(t, middle, y))
        return out

    def watch(self, t, middle, y, rank):
        n = self.n
        state = State(self, t, middle, y[:n], y[n:2 * n])
        smallest, r, kinetic = self.condition(state)
        if smallest < 0.05 or r != rank or kinetic < 0.01 * min(1.0, self.lightest):
            raise Failure("near a singular configuration")
        if max(abs(y[n:2 * n])) > 25:
            raise Failure("too fast")

    def columns(self, t, middle, y):
        n = self.n
        q, v, ledger = y[:n], y[n:2 * n], y[2 * n:]
        state = State(self, t, middle, q, v)
        a, mu = self.solve(state)
        row = {"t": t, **self.named(q, v)}
        row.update({name: x for (name, _, _), x in zip(state.rows, mu)})
        row.update(zip(self.powers(state, mu), ledger))
        row["kinetic"], row["potential"] = 0.5 * float(self.mass @ v**2), state.potential
        return row


if __name__ == "__main__":
    with open(sys.argv[1]) as f:
        m = Mechanism(json.load(f))
    end = float(sys.argv[2]) if len(sys.argv) > 2 else m.model["run"]["t_end"]
    for row in m.run(*m.project(m.q, m.v), [end], check=False):
        print(json.dumps(row, indent=1))
