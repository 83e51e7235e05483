"""Random mechanisms: bodies at random positions, and elements placed to fit them.  A seed always gives the same
mechanism.

All quantities are about 1 in SI units.  A mechanism that is near a singular configuration, or comes near one, is
rejected; the reference alone decides on that."""
import cmath
import math
import random
import numpy as np
from simulator import Failure, Mechanism, State

SPAN = 1.0  # of a run [s]
POSITION = ["pin", "pin", "pin", "weld", "slider", "slot", "rod", "drive", "gear"]
VELOCITY = ["wheel", "wheel", "rolling-wheel", "rolling-wheel", "steered-wheel", "speed", "pfaffian"]
FORCE = ["tyre", "rolling-resistance", "spring", "spring", "rotational-spring", "friction", "sliding-friction", "drag",
         "gravity", "force", "torque", "motor", "marker"]


class Builder:
    """The bodies and elements of a model, as entries of a text model; r: random numbers.

    hard: masses, stiffnesses and smoothing speeds of friction differ by orders of magnitude."""

    def __init__(self, seed, hard=False):
        self.r, self.hard = random.Random(seed), hard
        self.bodies, self.elements = [], []

    def number(self, low, high):
        return round(self.r.uniform(low, high), 4)

    def signed(self, low, high):
        return self.number(low, high) * self.r.choice([-1, 1])

    def wide(self, low, high):
        """A factor: 1, or in hard mechanisms a power of ten between these."""
        return 10.0**self.r.uniform(low, high) if self.hard else 1.0

    def chance(self, p):
        return self.r.random() < p

    # ---- Places ----

    def frame(self, name):
        """Position, as a complex number, and angle."""
        if name == "ground":
            return 0j, 0.0
        s = next(b for b in self.bodies if b["name"] == name)["start"]
        return complex(s["x"], s["y"]), s["phi"]

    def local(self, name, world):
        z, phi = self.frame(name)
        s = (world - z) * cmath.exp(-1j * phi)
        return [s.real, s.imag]

    def world(self, name, s):
        z, phi = self.frame(name)
        return z + complex(*s) * cmath.exp(1j * phi)

    def point(self):
        return [self.signed(0.1, 0.8), self.signed(0.1, 0.8)]

    def pair(self):
        """Two bodies, or one and the ground."""
        names = [b["name"] for b in self.bodies] + ["ground"]
        return self.r.sample(names, 2)

    def one(self):
        return self.r.choice(self.bodies)["name"]

    def meeting(self, body):
        """A point between two bodies: in the world, and in the frames of both."""
        a, b = (self.frame(x)[0] for x in body)
        P = a + (b - a) * self.r.uniform(0.2, 0.8) + complex(self.r.uniform(-0.4, 0.4), self.r.uniform(-0.4, 0.4))
        return P, [self.local(x, P) for x in body]

    def apart(self, body):
        """A point in the frame of each body, and their distance [m], which is not small."""
        while True:
            at = [self.point(), self.point()]
            d = abs(self.world(body[0], at[0]) - self.world(body[1], at[1]))
            if d > 0.4:
                return at, d

    # ---- Signals ----

    def table(self, size, cubic, ends):
        points, t = [], self.number(-0.3, 0.3) * SPAN
        for _ in range(self.r.randint(4, 6)):
            points.append([round(t, 5), self.number(-size, size)])
            t += self.number(0.12, 0.45) * SPAN
        table = {"points": points}
        if cubic:
            table.update(interpolation="cubic", ends=ends)
        return {"table": table}

    def expression(self, size):
        """An expression of time, with its first and second derivative."""
        A, w, p, o = self.number(0.2, 1) * size, self.number(0.5, 4), self.number(-3, 3), self.number(-0.5, 0.5) * size
        if self.chance(0.6):
            a = f"{w}*t + {p}"
            return f"{A}*sin({a}) + {o}", f"{A}*{w}*cos({a})", f"-{A}*{w}^2*sin({a})"
        return f"{o} + {A}*exp(-{w}*t)", f"-{A}*{w}*exp(-{w}*t)", f"{A}*{w}^2*exp(-{w}*t)"

    def state_expression(self, size):
        b, c = self.one(), self.one()
        k, d = self.number(0.2, 1) * size, self.number(0.2, 1) * size
        return self.r.choice([f"-{k}*{b}.omega", f"-{k}*sin({b}.phi) - {d}*{b}.omega",
                              f"{k}*cos({b}.x + {c}.y) - {d}*{c}.vx",
                              f"{k}*sin(2*t)*{b}.phi", f"-{d}*tanh({b}.vy)"])

    def signal(self, size, use):
        """use: force, velocity or position."""
        forms = ["constant", "harmonic", "smooth-step", "cubic-rest", "expression"]
        forms += ["ramp", "linear", "cubic-free"] if use != "position" else []
        forms += ["pulse", "states", "expression", "conditional"] if use == "force" else []
        form, n = self.r.choice(forms), self.number
        start, duration = n(0.05, 0.5) * SPAN, n(0.2, 0.8) * SPAN
        if form == "constant":
            return n(-size, size) if self.chance(0.5) else {"constant": n(-size, size)}
        if form == "harmonic":
            return {"harmonic": {"amplitude": n(0.2, 1) * size, "omega": n(1, 5), "phase": n(-3, 3),
                                 "offset": n(-0.5, 0.5) * size}}
        if form == "ramp":
            return {"ramp": {"from": n(-1, 1) * size, "to": n(-1, 1) * size, "start": start, "duration": duration}}
        if form == "smooth-step":
            return {"smooth-step": {"from": n(-1, 1) * size, "to": n(-1, 1) * size, "start": start,
                                    "duration": duration}}
        if form == "pulse":
            pulse = {"height": n(0.2, 1) * size, "start": n(-0.1, 0.6) * SPAN, "width": n(0.05, 0.2) * SPAN,
                     "offset": n(-0.3, 0.3) * size}
            if self.chance(0.5):
                pulse["period"] = n(0.21, 0.4) * SPAN
            return {"pulse": pulse}
        if form in ("linear", "cubic-free", "cubic-rest"):
            return self.table(size, form != "linear", form[6:])
        if form == "states":
            return self.state_expression(size)
        if form == "conditional":
            return f"t > {start} && t < {round(start + duration, 5)} ? {n(-size, size)} : {n(-size, size)}*cos(2*t)"
        value, rate, acceleration = self.expression(size)
        if use == "force" or self.chance(0.5):
            return value
        return {"expression": value, "rate": rate, **({"acceleration": acceleration} if use == "position" else {})}

    def shifted(self, size, value):
        """A signal of positions that has this value at t = 0."""
        s = self.signal(size, "position")
        d = value - evaluate(s)
        if isinstance(s, str):
            return f"{s} + {d!r}" if d >= 0 else f"{s} - {-d!r}"
        if not isinstance(s, dict):
            return value
        (form, f), = list(s.items())[:1]
        if form == "expression":
            s["expression"] = f"{f} + {d!r}" if d >= 0 else f"{f} - {-d!r}"
        elif form == "constant":
            s["constant"] = value
        elif form == "harmonic":
            f["offset"] += d
        elif form == "table":
            for p in f["points"]:
                p[1] += d
        else:
            f["from"], f["to"] = f["from"] + d, f["to"] + d
        return s

    # ---- Elements ----

    def add(self, kind, **fields):
        self.elements.append({kind: f"e{len(self.elements)}", **fields})

    def place(self, kind, body=None):
        """Adds a random element of the kind; body: the two bodies of a constraint of positions."""
        return getattr(self, "_" + kind.replace("-", "_"))(*([body] if kind in POSITION else []))

    def _pin(self, body):
        self.add("pin", body=body, at=self.meeting(body)[1])

    def _weld(self, body):
        (_, a), (_, b) = map(self.frame, body)
        self.add("weld", body=body, at=self.meeting(body)[1], angle=b - a)

    def _line(self, body):
        """Points of both bodies, and the heading of a line through the second point on which the first one lies."""
        P, (s, _) = self.meeting(body)
        h = self.number(-3, 3)
        Q = P + self.r.uniform(-0.8, 0.8) * cmath.exp(1j * (self.frame(body[1])[1] + h))
        return {"body": body, "at": [s, self.local(body[1], Q)], "heading": h}

    def _slot(self, body):
        self.add("slot", **self._line(body))

    def _slider(self, body):
        (_, a), (_, b) = map(self.frame, body)
        self.add("slider", **self._line(body), angle=a - b)

    def _rod(self, body):
        at, d = self.apart(body)
        self.add("rod", body=body, at=at, length=d)

    def _drive(self, body):
        what = self.r.choice(["x", "y", "angle"])
        (_, a), (_, b) = map(self.frame, body)
        at = [self.point(), self.point()]
        P, Q = (self.world(x, s) for x, s in zip(body, at))
        d = (P - Q) * cmath.exp(-1j * b)
        value = {"x": d.real, "y": d.imag, "angle": a - b}[what]
        self.add("drive", body=body, at=at, what=what, value=self.shifted(0.6, value))

    def _gear(self, body):
        others = [x["name"] for x in self.bodies if x["name"] not in body] + ["ground"] * ("ground" not in body)
        if not others:
            return
        third = self.r.choice(others)
        ratio = self.signed(0.5, 2)
        fields = {}
        if self.chance(0.5):
            a, b, c = (self.frame(x)[1] for x in body + [third])
            fields = {"from": "offset", "offset": a - c - ratio * (b - c)}
        self.add("gear", body=body + [third], ratio=ratio, **fields)

    def _wheel(self):
        self.add("wheel", body=self.one(), at=self.point(), heading=self.number(-3, 3))

    def _rolling_wheel(self):
        fields = {"torque": self.signal(1.0, "force")} if self.chance(0.7) else {}
        if self.chance(0.7):
            fields["inertia"] = self.number(0.05, 0.3)
        self.add("rolling-wheel", body=self.one(), at=self.point(), heading=self.number(-3, 3),
                 radius=self.number(0.2, 0.6),
                 start=self.number(-1, 1), rate=self.number(0.5, 1), **fields)

    def _steered_wheel(self):
        self.add("steered-wheel", body=self.one(), at=self.point(), heading=self.signal(0.5, "velocity"))

    def _speed(self):
        self.add("speed", body=self.one(), at=self.point(), heading=self.number(-3, 3),
                 value=self.signal(0.8, "velocity"))

    def _pfaffian(self):
        self.add("pfaffian", body=self.pair(), a=[self.signed(0.3, 1) for _ in range(3)],
                 b=[self.signed(0.3, 1) for _ in range(3)],
                 value=self.signal(0.5, "velocity"))

    def _tyre(self):
        fields = {"load": self.number(2, 6), "friction": self.number(0.4, 1)} if self.chance(0.5) else {}
        self.add("tyre", body=self.one(), at=self.point(), heading=self.number(-3, 3),
                 stiffness=self.number(1, 6) * self.wide(0, 3),
                 speed=self.number(0.4, 1) * self.wide(-3, 0), **fields)

    def _rolling_resistance(self):
        self.add("rolling-resistance", body=self.one(), at=self.point(), heading=self.number(-3, 3),
                 limit=self.number(0.3, 2),
                 speed=self.number(0.3, 1) * self.wide(-4, 0))

    def _spring(self):
        body = self.pair()
        at, d = self.apart(body)
        self.add("spring", body=body, at=at, stiffness=self.number(2, 20) * self.wide(0, 3),
                 length=self.number(0.3, 1.2) * d,
                 damping=self.number(0.1, 1) * self.wide(0, 2) if self.chance(0.6) else 0)

    def _rotational_spring(self):
        self.add("rotational-spring", body=self.pair(), stiffness=self.number(0.5, 5) * self.wide(0, 3),
                 angle=self.number(-1, 1),
                 damping=self.number(0.05, 0.4) * self.wide(0, 2) if self.chance(0.6) else 0)

    def _friction_law(self):
        law = self.r.choice(["viscous", "limit", "both"])
        fields = {"viscous": self.number(0.1, 0.6)} if law != "limit" else {}
        return {**fields, "limit": self.number(0.2, 1),
                "speed": self.number(0.3, 1) * self.wide(-4, 0)} if law != "viscous" else fields

    def _friction(self):
        self.add("friction", body=self.pair(), **self._friction_law())

    def _sliding_friction(self):
        self.add("sliding-friction", **self._line(self.pair()), **self._friction_law())

    def _drag(self):
        names = self.r.sample(["linear", "quadratic", "turning", "turning_quadratic"], self.r.randint(1, 4))
        self.add("drag", body=self.one(), **{n: self.number(0.05, 0.5) for n in names})

    def _gravity(self):
        self.add("gravity", acceleration=[self.number(-5, 5), self.number(-9.81, 0)])

    def _force(self):
        self.add("force", body=self.one(), at=self.point(), axes=self.r.choice(["world", "body"]),
                 fx=self.signal(3, "force"),
                 fy=self.signal(3, "force"))

    def _torque(self):
        self.add("torque", body=self.pair(), value=self.signal(2, "force"))

    def _motor(self):
        fields = {"limit": self.number(1, 4)} if self.chance(0.5) else {}
        self.add("motor", body=self.pair(), stiffness=self.number(1, 5) * self.wide(0, 2),
                 damping=self.number(0.1, 1) * self.wide(0, 2), angle=self.signal(0.6, "force"),
                 rate=self.signal(0.6, "force"), **fields)

    def _marker(self):
        self.add("marker", body=self.one(), at=self.point())

    # ---- Whole mechanisms ----

    def model(self):
        return {"pinwheel": 1, "about": "a random mechanism", "run": {"t_end": SPAN}, "bodies": self.bodies,
                "elements": self.elements}

    def condition(self):
        """The mechanism, and Mechanism.condition of its start."""
        m = Mechanism(self.model())
        return m, m.condition(State(m, 0.0, m.middle(0.0), m.q, m.v))

    def attempt(self, kind, body=None):
        """Adds an element if the configuration stays regular and keeps a degree of freedom."""
        before = list(self.elements)
        self.place(kind, body)
        try:
            m, (smallest, rank, _) = self.condition()
        except Failure:
            smallest = 0
        if smallest < 0.2 or rank != len(State(m, 0.0, m.middle(0.0), m.q, m.v).rows) or m.n - rank < 1:
            self.elements = before


def evaluate(signal):
    """A signal at t = 0."""
    from signals import Signal
    s = Signal(signal)
    after = [b for b in s.breaks if b > 0]
    return s.at(0.0, after[0] / 2 if after else 1.0, None).x


def massless(b):
    """Removes mass or inertia, or both, of some bodies, where the constraints still determine their motion."""
    for body in b.bodies:
        if not b.chance(0.5):
            continue
        saved = dict(body)
        for part in b.r.choice([["mass"], ["inertia"], ["mass", "inertia"], ["mass", "inertia"]]):
            body.pop(part)
        m, (_, _, kinetic) = b.condition()
        if kinetic < 0.02 * min(1.0, m.lightest):
            body.clear()
            body.update(saved)


def redundant(b):
    """Adds redundant constraints: the same element again, a wheel on the same axle, a point on the same line."""
    candidates = [e for e in b.elements if next(iter(e)) in ("pin", "weld", "slider", "slot", "rod", "gear", "drive",
                                                             "wheel",
                                                             "steered-wheel", "speed", "pfaffian")]
    for e in b.r.sample(candidates, min(len(candidates), b.r.randint(1, 2))):
        kind = next(iter(e))
        twin = {k: v for k, v in e.items() if k != kind}
        if kind == "wheel":
            z = complex(*e["at"]) + 1j * b.r.uniform(-0.6, 0.6) * cmath.exp(1j * e["heading"])
            twin["at"] = [z.real, z.imag]
        elif kind == "slider":
            z = complex(*e["at"][1]) + b.r.uniform(-0.6, 0.6) * cmath.exp(1j * e["heading"])
            twin["at"] = [e["at"][0], [z.real, z.imag]]
        elif kind == "weld":
            P = b.world(e["body"][0], e["at"][0]) + complex(b.r.uniform(-0.6, 0.6), b.r.uniform(-0.6, 0.6))
            twin["at"] = [b.local(x, P) for x in e["body"]]
        elif kind == "pfaffian":
            k = b.signed(0.5, 2)
            if isinstance(e["value"], (int, float)):
                twin.update(a=[k * x for x in e["a"]], b=[k * x for x in e["b"]], value=k * e["value"])
        b.add(kind, **twin)


def build(seed, hard=False):
    """A model; Failure if it is near a singular configuration."""
    b = Builder(seed, hard)
    for i in range(b.r.choice([1, 1, 2, 2, 3, 3, 4, 5])):
        b.bodies.append({"name": f"b{i}", "mass": b.number(0.5, 2) * b.wide(-4, 1),
                         "inertia": b.number(0.05, 0.5) * b.wide(-4, 1),
                         "start": {"x": b.number(-1.2, 1.2), "y": b.number(-1.2, 1.2), "phi": b.number(-3, 3)}})
    for i, body in enumerate(b.bodies):
        if b.chance(0.85):
            other = b.r.choice([x["name"] for x in b.bodies[:i]] + ["ground"])
            b.attempt(b.r.choice(POSITION), b.r.sample([body["name"], other], 2))
    for _ in range(b.r.randint(0, 5)):
        if b.chance(0.3):
            b.attempt(b.r.choice(POSITION), b.pair())
        else:
            b.attempt(b.r.choice(VELOCITY))
    if b.chance(0.35):
        massless(b)
    if b.chance(0.25):
        redundant(b)
    for _ in range(b.r.randint(1, 5)):
        b.place(b.r.choice(FORCE))
    b.r.shuffle(b.elements)
    m, (smallest, _, kinetic) = b.condition()
    if smallest < 0.15 or kinetic < 0.02 * min(1.0, m.lightest):
        raise Failure("near a singular configuration at the start")
    # Velocities: at random, then consistent.
    _, v = m.project(m.q, np.array([b.r.uniform(-1.5, 1.5) for _ in range(m.n)]))
    for i, body in enumerate(b.bodies):
        body["rate"] = dict(zip(("vx", "vy", "omega"), (float(x) for x in v[3 * i:3 * i + 3])))
    for e in b.elements:
        if "rolling-wheel" in e:
            e["rate"] = float(v[m.own[e["rolling-wheel"]]])
    return b.model()


def random_mechanism(seed, hard=False):
    """The first regular mechanism of this seed, and its table at half the span and the span by the reference."""
    for n in range(1000):
        try:
            m = Mechanism(build(seed * 1000 + n, hard))
            return m, m.run(m.q, m.v, [SPAN / 2, SPAN])
        except (Failure, OverflowError, ZeroDivisionError):
            continue
    raise Failure("no mechanism in 1000 attempts")
