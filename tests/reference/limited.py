"""Random mechanisms whose reactions have limits: wheels that slide, dry friction, stops, ropes, freewheels, contacts.  A
seed always gives the same mechanism; the reference alone rejects one, if its motion touches a limit or is singular."""
import cmath
import collections
import math
import numpy as np
from events import Motion, Response
from mechanisms import POSITION, Builder
from simulator import Failure, Mechanism, State

SPAN = 2.0  # of a run [s]
GRIPS = ["wheel", "wheel", "steered-wheel", "rolling-wheel", "friction", "friction", "sliding-friction", "sliding-friction"]
SIDES = ["stop", "stop", "rope", "freewheel", "contact", "contact"]
FORCES = ["spring", "rotational-spring", "force", "force", "torque", "torque", "gravity", "drag", "motor"]


class LimitedBuilder(Builder):
    """Elements with limits, near those at the start."""

    def limit(self, low, high):
        """A limit, constant or a signal, that is positive."""
        form, size = self.r.choice(["constant", "constant", "harmonic", "load", "step"]), self.number(low, high)
        if form == "harmonic":
            return {"harmonic": {"amplitude": 0.4 * size, "omega": self.number(1, 6), "phase": self.number(-3, 3),
                                 "offset": size}}
        if form == "load":
            return {"mu": 0.5, "load": 2 * size}
        if form == "step":
            return {"smooth-step": {"from": size, "to": size * self.number(0.3, 1.5), "start": self.number(0, 0.5) * SPAN,
                                    "duration": self.number(0.1, 0.5) * SPAN}}
        return size

    def limits(self, field, low, high):
        """Fields: the limit, and in a third of the cases a smaller one while sliding."""
        most = self.limit(low, high)
        if isinstance(most, float) and self.chance(0.5):
            return {field: most, field + "_sliding": most * self.number(0.5, 0.95)}
        return {field: most}

    def _wheel(self):
        self.add("wheel", body=self.one(), at=self.point(), heading=self.number(-3, 3), **self.limits("grip", 0.2, 4))

    def _steered_wheel(self):
        self.add("steered-wheel", body=self.one(), at=self.point(), heading=self.signal(0.5, "velocity"),
                 **self.limits("grip", 0.2, 4))

    def _rolling_wheel(self):
        fields = {"torque": self.signal(1.0, "force")} if self.chance(0.7) else {}
        if self.chance(0.3):
            fields["brake"] = self.limit(0.05, 0.6)
        self.add("rolling-wheel", body=self.one(), at=self.point(), heading=self.number(-3, 3),
                 radius=self.number(0.2, 0.6), inertia=self.number(0.05, 0.3), **self.limits("grip", 0.3, 4), **fields)

    def _friction_law(self):
        return {**({"viscous": self.number(0.1, 0.6)} if self.chance(0.3) else {}), **self.limits("limit", 0.1, 2)}

    def _restitution(self):
        return {"restitution": self.number(0.2, 0.9)} if self.chance(0.6) else {}

    def _stop(self):
        body, what = self.pair(), self.r.choice(["x", "y", "angle"])
        at = [self.point(), self.point()]
        (_, a), (_, b) = map(self.frame, body)
        d = (self.world(body[0], at[0]) - self.world(body[1], at[1])) * cmath.exp(-1j * b)
        value = {"x": d.real, "y": d.imag, "angle": a - b}[what]
        sides = self.r.choice([["low"], ["high"], ["low", "high"]])
        room = {"low": value - self.number(0.02, 0.4), "high": value + self.number(0.02, 0.4)}
        self.add("stop", body=body, at=at, what=what, **{s: room[s] for s in sides}, **self._restitution())

    def _rope(self):
        body = self.pair()
        at, d = self.apart(body)
        self.add("rope", body=body, at=at, length=d + self.number(0.02, 0.4), **self._restitution())

    def _freewheel(self):
        self.add("freewheel", body=self.pair())

    def _contact(self):
        body, fields, r, gap = self.pair(), self._restitution(), 0.0, self.number(0.02, 0.4)
        if self.chance(0.5):
            r = fields["radius"] = self.number(0.05, 0.3)
        if self.chance(0.5):
            fields["mu"] = self.number(0.1, 0.7)
            if self.chance(0.4):
                fields["mu_sliding"] = self.number(0.5, 0.95) * fields["mu"]
        if self.chance(0.3):
            at, d = self.apart(body)
            fields["other_radius"] = d - r - min(gap, d / 3)
            if fields["other_radius"] < 0.03:
                return
            self.add("contact", body=body, at=at, **fields)
            return
        s, h = self.point(), self.number(-3, 3)
        P, along = self.world(body[0], s), cmath.exp(1j * (self.frame(body[1])[1] + h))
        Q = P - 1j * along * (r + gap) + along * self.r.uniform(-0.5, 0.5)
        self.add("contact", body=body, at=[s, self.local(body[1], Q)], heading=h, **fields)

    def model(self):
        return {**super().model(), "run": {"t_end": SPAN}}


def build(seed):
    b = LimitedBuilder(seed)
    for i in range(b.r.choice([1, 1, 1, 2, 2, 3, 4])):
        b.bodies.append({"name": f"b{i}", "mass": b.number(0.5, 2), "inertia": b.number(0.05, 0.5),
                         "start": {"x": b.number(-1.2, 1.2), "y": b.number(-1.2, 1.2), "phi": b.number(-3, 3)}})
    for i, body in enumerate(b.bodies):
        if b.chance(0.5):
            other = b.r.choice([x["name"] for x in b.bodies[:i]] + ["ground"])
            b.attempt(b.r.choice(POSITION), b.r.sample([body["name"], other], 2))
    kinds = b.r.choice([GRIPS, GRIPS, SIDES, GRIPS + SIDES, GRIPS + SIDES])
    for _ in range(b.r.randint(1, 4)):
        b.place(b.r.choice(kinds))
    for _ in range(b.r.randint(1, 4)):
        b.place(b.r.choice(FORCES))
    b.r.shuffle(b.elements)
    start(b)
    return b.model()


def start(b):
    """Random velocities that satisfy the constraints, and some of the equations with limits."""
    m = Mechanism(b.model())
    state = State(m, 0.0, m.middle(0.0), m.q, np.array([b.r.uniform(-1.5, 1.5) for _ in range(m.n)]))
    constraints, v = [r for _, r, _ in state.rows], state.v
    rates = list(constraints)
    for e in state.limited:
        if e.gap is None and b.chance(0.6) or e.gap is not None and e.gap != e.gap and e.rates[0].x < 0.1:
            rates += e.rates
    for some in (rates, constraints):  # the first may contradict each other
        J, x = np.array([r.g for r in some]).reshape(len(some), m.n), np.array([r.x for r in some])
        u = x + J @ (v - state.v)
        if max(abs(u), default=0) > 1e-9:
            v = v - np.linalg.lstsq(J, u, rcond=1e-9)[0]
    for i, body in enumerate(b.bodies):
        body["rate"] = dict(zip(("vx", "vy", "omega"), (float(x) for x in v[3 * i:3 * i + 3])))
    for e in b.elements:
        if "rolling-wheel" in e:
            e["rate"] = float(v[m.own[e["rolling-wheel"]]])


REJECTED = collections.Counter()


def limited_mechanism(seed):
    """The first mechanism of this seed with an event that the reference can follow: (mechanism, table, motion)."""
    for n in range(1000):
        try:
            m = Mechanism(build(seed * 1000 + n))
            if given(m):
                raise Failure("a freewheel whose rate is given")
            motion = Motion(m, m.q, m.v, SPAN)
            table = motion.run([SPAN / 2, SPAN], watch(m))
            if any(t > 0 for t, *_ in motion.events):
                return m, table, motion
            REJECTED["no event"] += 1
        except (Failure, OverflowError, ZeroDivisionError) as e:
            REJECTED[str(e)[:40]] += 1
    raise Failure("no mechanism in 1000 attempts")


def given(m):
    """Whether constraints without limits determine the rate of a freewheel: the error of a method decides then if it
    holds."""
    state = State(m, 0.0, m.middle(0.0), m.q, m.v)
    response = Response(m, state)
    rows = [e.rates[0].g for e in state.limited if e.gap is not None and math.isnan(e.gap)]
    return any(g @ response.to(g[:, None])[:, 0] < 1e-9 * (g @ (g / m.mass)) for g in rows)


def watch(m):
    def check(t, middle, y):
        state = State(m, t, middle, y[:m.n], y[m.n:])
        smallest, rank, _ = m.condition(state)
        if smallest < 0.05 or rank != len(state.rows):
            raise Failure("near a singular configuration")
        if max(abs(y[m.n:])) > 25:
            raise Failure("too fast")
    return check
