"""Motions with limits of reactions, from first principles: dry friction, grips, one-sided constraints, impacts.

Between events every limited equation is in one mode, and DOP853 integrates.  At an event all combinations of modes are
tried; the one is taken whose accelerations and multipliers obey Coulomb's law and the complementarity of one-sided
constraints.  Impulses follow in the same way, from Newton's law of restitution."""
import collections
import itertools
import math
import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar
from simulator import Failure, Mechanism, State

# One rate slides in the direction +1 or -1, a vector SLIDES.  (IDLE, direction): at its limit; others keep its rate 0.
HOLDS, FREE, SLIDES, IDLE = "holds", "free", "slides", "idle"
SLIP = 1e-10  # [m/s] a vector slides from this speed on, and until a tenth of it
SLOW = 1e-6  # in units of the scene: impacts below do not bounce
MOST_EVENTS, MOST_STEPS = 400, 4000
PARTS = 6  # of a step, at whose ends event functions are evaluated


class Response:
    """The system with its constraints that have no limits: its reaction to forces on limited rows."""

    def __init__(self, m, state):
        J, _, b = m.constraints(state)
        n, k = m.n, len(b)
        self.K = np.zeros((n + k, n + k))
        self.K[:n, :n], self.K[:n, n:], self.K[n:, :n] = np.diag(m.mass), -J.T, J
        self.n, self.b = n, b

    def to(self, forces, b=0.0):
        """Accelerations (n, columns) under generalised forces (n, columns), with J a + b = 0."""
        right = np.zeros((len(self.K), forces.shape[1]))
        right[:self.n] = forces
        right[self.n:] -= np.reshape(b, (-1, 1))
        return np.linalg.solve(self.K, right)[:self.n]


class Option:
    """What an equation may do.  holds: its rates of change have the value `given`; otherwise its multipliers have it,
    plus `ratio` times that of the normal.  fits(w, x, normal): whether rates w and multipliers x obey its law."""

    def __init__(self, mode, fits, holds=False, given=0.0, ratio=0.0):
        self.mode, self.fits, self.holds, self.given, self.ratio = mode, fits, holds, np.atleast_1d(given), ratio


class Problem:
    """Equations with options and w = b + A x.  rows: of each equation; normal: the row of its normal or None."""

    def __init__(self, A, b, rows, normals, options):
        self.A, self.b, self.rows, self.normals, self.options = A, b, rows, normals, options

    def linear(self, choice, direction):
        """x of a choice; direction: multipliers of the vector that slides, if one does."""
        M, r = np.eye(len(self.b)), np.zeros(len(self.b))
        for rows, normal, o in zip(self.rows, self.normals, choice):
            given = direction if o.mode == SLIDES else o.given
            for i, row in enumerate(rows):
                if o.holds:
                    M[row], r[row] = self.A[row], given[i % len(given)] - self.b[row]
                else:
                    r[row] = given[i % len(given)]
                    if normal is not None:
                        M[row, normal] -= o.ratio
        held = [row for rows, o in zip(self.rows, choice) if o.holds for row in rows]
        if dependent(self.A, held):
            return None
        try:
            return np.linalg.solve(M, r)
        except np.linalg.LinAlgError:
            return None

    def directions(self, choice):
        """Multipliers of the vector that slides: against its rate of change, in all directions n with w = |w| n."""
        slides = [(rows, o) for rows, o in zip(self.rows, choice) if o.mode == SLIDES]
        if not slides:
            return [None]
        if len(slides) > 1:
            return []  # not tried: if this is the only possible choice, the reference fails
        (rows, o), = slides

        def turned(angle):
            """w across the direction."""
            n = np.array([math.cos(angle), math.sin(angle)])
            x = self.linear(choice, o.given[0] * n)
            w = self.b[rows] + self.A[rows] @ x
            return n[0] * w[1] - n[1] * w[0]
        if self.linear(choice, np.zeros(2)) is None:
            return []
        grid = np.linspace(0, 2 * math.pi, 25)
        values = [turned(a) for a in grid]
        roots = [brentq(turned, a, c, xtol=1e-14)
                 for a, c, u, v in zip(grid, grid[1:], values, values[1:]) if u * v < 0]
        return [o.given[0] * np.array([math.cos(a), math.sin(a)]) for a in roots]

    def solve(self):
        """The choice that obeys all laws, its x and w."""
        if np.prod([float(len(o)) for o in self.options]) > 20000:
            raise Failure("too many combinations")
        found = []
        for choice in itertools.product(*self.options):
            for direction in self.directions(choice):
                x = self.linear(choice, direction)
                if x is None:
                    continue
                w = self.b + self.A @ x
                if all(o.fits(w[rows], x[rows], 0 if normal is None else x[normal])
                       for rows, normal, o in zip(self.rows, self.normals, choice)):
                    found.append((choice, x, w))
        if not found:
            raise Failure("no combination of modes is possible")
        for other in found[1:]:
            if max(abs(other[2] - found[0][2])) > 1e-6 * (1 + max(abs(found[0][2]))):
                raise Failure("several combinations of modes are possible")
        return found[0]


def dependent(A, rows):
    if not rows:
        return False
    S = A[np.ix_(rows, rows)]
    scale = np.sqrt(np.abs(np.diag(S)))
    return min(scale) == 0 or np.linalg.cond(S / np.outer(scale, scale)) > 1e10


def coulomb(most, excluded, small):
    """Options of a friction whose rate is 0."""
    return [Option(HOLDS, lambda w, x, _: abs(x[0]) <= most + small, holds=True)] * (not excluded) + [
        Option(s, lambda w, x, _, s=s: s * w[0] >= -small, given=-s * most) for s in (1, -1)]


def vector_coulomb(most, excluded, small):
    return [Option(HOLDS, lambda w, x, _: math.hypot(*x) <= most + small, holds=True)] * (not excluded) + [
        Option(SLIDES, lambda w, x, _: w @ x <= small * most, given=-most)]


def one_sided(excluded, small):
    return [Option(HOLDS, lambda w, x, _: x[0] >= -small, holds=True)] * (not excluded) + [
        Option(FREE, lambda w, x, _: w[0] >= -small)]


def contact_coulomb(most, sliding, excluded, small, moves):
    """Options of a contact's friction; moves: the sign of its rate, or 0."""
    if moves:
        return [Option(moves, lambda w, x, _: True, ratio=-moves * sliding)]
    return [Option(HOLDS, lambda w, x, normal: abs(x[0]) <= most * normal + small, holds=True)] * (not excluded) + [
        Option(s, lambda w, x, _, s=s: s * w[0] >= -small, ratio=-s * sliding) for s in (1, -1)]


def speeds(limited):
    return np.array([r.x for r in limited.rates])


class Motion:
    """A run of a mechanism.  events: (t, reaction, mode before, mode after, impulse or None); arbitrary: reactions of
    which some modes make no difference."""

    zero = 1e-9  # [m/s, m] rates and gaps below are 0 at an event

    def __init__(self, m, q, v, span):
        self.m, self.t, self.q, self.v, self.events, self.modes, self.arbitrary = m, 0.0, q, v, [], {}, set()
        self.slow = SLOW * self.scales(span)
        self.middle = m.middle(0.0)
        self.begin()

    # ---- Decisions ----

    def state(self):
        return State(self.m, self.t, self.middle, self.q, self.v)

    def closed(self, limited):
        return limited.gap is not None and (math.isnan(limited.gap) or limited.gap < self.zero)

    def scales(self, span):
        """(L/T, 1/T) of the manual's scales at the start, for lengths and angles."""
        self.middle, m = self.m.middle(0.0), self.m
        start = self.q, self.v
        self.decide(set(), record=False)
        a, _ = self.accelerations(self.state(), m.mass)
        self.t, self.q, self.v = 0.0, *start
        unit = np.full(m.n, 1.0)
        for k in range(len(m.bodies)):
            unit[3 * k:3 * k + 2] = m.length
        rate = max([1 / span, *(abs(self.v) / unit), *np.sqrt(abs(a) / unit)])
        return np.array([m.length * rate, rate])

    def record(self, name, mode, impulse=None):
        before = self.modes.get(name)
        if before is not None and (before != mode or impulse is not None):
            self.events.append((self.t, name, before, mode, impulse))
        self.modes[name] = mode

    def decide(self, excluded, record=True):
        """Modes from here on; excluded: names of equations that no longer hold."""
        state, m = self.state(), self.m
        response = Response(m, state)
        f, open_, modes = state.f.copy(), [], {}
        for e in state.limited:
            u = speeds(e)
            if e.gap is not None:
                if self.closed(e) and u[0] < self.zero:
                    open_.append(e)
                else:
                    modes[e.name] = FREE
            elif e.normal is not None:
                if e.normal in open_:
                    open_.append(e)
                else:
                    modes[e.name] = int(math.copysign(1, u[0]))
            elif np.linalg.norm(u) < self.zero:
                open_.append(e)
            else:
                modes[e.name] = int(math.copysign(1, u[0])) if len(u) == 1 else SLIDES
                f -= e.sliding * (u / np.linalg.norm(u)) @ np.array([r.g for r in e.rates])
        self.starting = []
        found = self.undecided(response, open_, f, excluded)
        for e in state.limited:
            mode = found[e.name] if e in open_ else modes[e.name]
            if record:
                self.record(e.name, mode)
            else:
                self.modes[e.name] = mode
        for e, n, rate in self.starting:
            if rate < 1e-6:
                self.direct(e, n)
            else:
                self.begin_to_slide(e, n, SLIP / rate)

    def begin_to_slide(self, e, n, dt):
        """Moves on by dt, after which a vector slides in the direction n."""
        self.direct(e, n * 1e-3)
        a, _ = self.accelerations(self.state(), self.m.mass)
        self.t, self.q, self.v = self.t + dt, self.q + dt * self.v, self.v + dt * a

    def undecided(self, response, equations, f, excluded):
        """Modes of the equations that may hold, by name; of those with smaller sliding forces in a second attempt, with
        these."""
        if not equations:
            return {}
        G = np.array([r.g for e in equations for r in e.rates])
        a0 = response.to(f[:, None], response.b)[:, 0]
        A = G @ response.to(G.T)
        b = G @ a0 + np.array([r.d for e in equations for r in e.rates])
        rows, at = [], 0
        for e in equations:
            rows.append(list(range(at, at + len(e.rates))))
            at += len(e.rates)
        first = {e: r[0] for e, r in zip(equations, rows)}
        normals = [first[e.normal] if e.normal is not None else None for e in equations]
        small = 1e-8 * (1 + max(abs(b)))
        slides = set()
        while True:
            choice, x, w = Problem(A, b, rows, normals, [self.options(e, e.name in excluded, small, e in slides)
                                                         for e in equations]).solve()
            held = [r for rs, o in zip(rows, choice) if o.holds for r in rs]
            more = {e for e, rs, o in zip(equations, rows, choice) if e.most is not None and e.sliding < e.most and
                    not o.holds and not self.idle(A, w, rs, held)} - slides
            if not more:
                break
            slides |= more
        out = {}
        for e, rs, o in zip(equations, rows, choice):
            out[e.name] = o.mode
            if o.holds and e.most is None and abs(x[rs[0]]) < small:
                self.arbitrary.add(e.name)  # no force: whether it holds makes no difference
            if not o.holds and self.idle(A, w, rs, held):
                out[e.name] = (IDLE, tuple(-x[rs] / np.linalg.norm(x[rs])) if e.most is not None else None)
                self.arbitrary |= {o.name for o in equations}  # which of them carry the load is not unique
            if o.mode == SLIDES:
                self.starting.append((e, -x[rs] / np.linalg.norm(x[rs]), np.linalg.norm(w[rs])))
        return out

    @staticmethod
    def idle(A, w, rows, held):
        """Whether others that hold keep the rates of an equation at 0 that does not."""
        return bool(held) and max(abs(w[rows])) < 1e-7 and dependent(A, held + rows)

    def options(self, e, excluded, small, slides):
        if e.gap is not None:
            return one_sided(excluded, small)
        most = e.sliding if slides else e.most
        if e.normal is not None:
            u = speeds(e)[0]
            return contact_coulomb(most, most, excluded, small, 0 if abs(u) < self.zero else int(math.copysign(1, u)))
        return (coulomb if len(e.rates) == 1 else vector_coulomb)(most, excluded, small)

    def direct(self, e, n):
        """Gives a vector that begins to slide its first speed."""
        G = np.array([r.g for r in e.rates])
        state = self.state()
        J, _, _ = self.m.constraints(state)
        held = [r.g for o in state.limited if self.modes.get(o.name) == HOLDS and o.name != e.name for r in o.rates]
        rows = np.vstack([G, J, np.array(held).reshape(len(held), self.m.n)])
        self.v = self.v + np.linalg.lstsq(rows, np.concatenate([SLIP * n, np.zeros(len(rows) - 2)]), rcond=1e-9)[0]

    # ---- Impacts ----

    def impact(self):
        """Impulses where a closed one-sided equation has a negative rate; whether there were any."""
        state = self.state()
        taking = [e for e in state.limited if e.gap is not None and self.closed(e) and speeds(e)[0] < self.zero]
        if not any(speeds(e)[0] < -self.zero for e in taking):
            return False
        equations = [e for e in state.limited if e in taking or e.normal in taking]
        G = np.array([e.rates[0].g for e in equations])
        response = Response(self.m, state)
        H = response.to(G.T)
        A, u = G @ H, np.array([e.rates[0].x for e in equations])
        factor = 1.0
        p = self.impulses(A, u, equations, factor)
        if self.gain(A, u, p) > 1e-12 * (1 + u @ u):
            low, high = 0.0, 1.0
            for _ in range(60):
                factor = (low + high) / 2
                p = self.impulses(A, u, equations, factor)
                low, high = (factor, high) if self.gain(A, u, p) <= 0 else (low, factor)
            p = self.impulses(A, u, equations, low)
        self.v = self.v + H @ p
        for e, x in zip(equations, p):
            if abs(x) > 1e-11:
                self.record(e.name, self.modes[e.name], float(x))
        return True

    @staticmethod
    def gain(A, u, p):
        """The kinetic energy that impulses add."""
        return p @ u + p @ A @ p / 2

    def impulses(self, A, u, equations, factor):
        options, normals = [], []
        for e in equations:
            i = len(options)
            if e.gap is not None:
                slow = self.slow[1 if self.turns(e) else 0]
                bounce = factor * e.restitution * u[i] if u[i] < -slow else 0.0
                options.append([Option(HOLDS, lambda w, x, _: x[0] >= -1e-10, holds=True, given=-bounce),
                                Option(FREE, lambda w, x, _, c=bounce: w[0] + c >= -1e-10)])
                normals.append(None)
            else:
                options.append(contact_coulomb(e.most, e.most, False, 1e-10, 0))
                normals.append(equations.index(e.normal))
        choice, p, _ = Problem(A, u, [[i] for i in range(len(u))], normals, options).solve()
        return p

    def turns(self, e):
        """Whether a one-sided equation limits an angle."""
        return e.angular

    # ---- Between events ----

    def accelerations(self, state, mass):
        """Accelerations, and the multipliers of limited equations that hold, by name, in the present modes."""
        n, f = self.m.n, state.f.copy()
        rates = [r for _, r, _ in state.rows]
        columns = [r.g for r in rates]
        names, used = [], {}
        for e in state.limited:
            mode = self.modes[e.name]
            if mode == HOLDS:
                for r in e.rates:
                    used[e] = len(rates)
                    rates.append(r), columns.append(r.g), names.append(e.name)
            elif isinstance(mode, tuple):
                if e.normal is not None:
                    if e.normal in used:
                        columns[used[e.normal]] = columns[used[e.normal]] - mode[1][0] * e.most * e.rates[0].g
                elif e.most is not None:
                    f -= e.most * np.array(mode[1]) @ np.array([r.g for r in e.rates])
            elif e.normal is not None:
                if e.normal in used:
                    columns[used[e.normal]] = columns[used[e.normal]] - mode * e.sliding * e.rates[0].g
            elif mode in (1, -1):
                f -= mode * e.sliding * e.rates[0].g
            elif mode == SLIDES:
                u = speeds(e)
                f -= e.sliding * (u / np.linalg.norm(u)) @ np.array([r.g for r in e.rates])
        k = len(rates)
        K, right = np.zeros((n + k, n + k)), np.concatenate([f, np.zeros(k)])
        K[range(n), range(n)] = mass
        for i, (r, c) in enumerate(zip(rates, columns)):
            K[:n, n + i], K[n + i, :n], right[n + i] = -c, r.g, -r.d
        try:
            x = np.linalg.solve(K, right)
        except np.linalg.LinAlgError:
            raise Failure("singular") from None
        mu = collections.defaultdict(list)
        for name, y in zip(names, x[n + len(state.rows):]):
            mu[name].append(y)
        return x[:n], mu

    def derivative(self, t, y):
        n = self.m.n
        a, _ = self.accelerations(State(self.m, t, self.middle, y[:n], y[n:]), self.m.mass)
        return np.concatenate([y[n:], a])

    def functions(self, t, y):
        """Of each limited equation: a value that is positive while its mode lasts."""
        n = self.m.n
        state = State(self.m, t, self.middle, y[:n], y[n:])
        _, mu = self.accelerations(state, self.m.mass)
        out = {}
        for e in state.limited:
            mode, u, x = self.modes[e.name], speeds(e), mu[e.name]
            if isinstance(mode, tuple):
                if max(abs(u)) > 1e-7:
                    raise Failure("dependent equations become independent")
            elif mode == HOLDS and e.normal is not None:
                out[e.name] = e.most * mu[e.normal.name][0] - abs(x[0])
            elif mode == HOLDS:
                out[e.name] = x[0] if e.most is None else e.most - np.linalg.norm(x)
            elif mode == FREE:
                out[e.name] = u[0] if math.isnan(e.gap) else e.gap
            elif mode == SLIDES:
                out[e.name] = np.linalg.norm(u) - SLIP / 10
            elif e.normal is None or mu[e.normal.name]:
                out[e.name] = mode * u[0]
        return out

    def begin(self):
        """Impacts, then modes, at the present state."""
        self.settle(set())

    def settle(self, excluded):
        for _ in range(20):
            if not self.impact():
                break
        else:
            raise Failure("impacts follow each other")
        self.decide(excluded)
        self.restore()

    def restore(self):
        """Projects the state onto the equations that hold."""
        m = self.m
        for _ in range(3):
            state = self.state()
            rows = [(r.g, g) for _, r, g in state.rows if g is not None]
            rows += [(e.rates[0].g, e.gap) for e in state.limited if self.modes[e.name] == HOLDS and e.gap is not None
                     and not math.isnan(e.gap)]
            if rows:
                J, g = np.array([r for r, _ in rows]), np.array([g for _, g in rows])
                self.q = self.q - np.linalg.lstsq(J, g, rcond=1e-9)[0]
        state = self.state()
        rates = [r for _, r, _ in state.rows]
        rates += [r for e in state.limited if self.modes[e.name] == HOLDS for r in e.rates]
        if rates:
            J, u = np.array([r.g for r in rates]), np.array([r.x for r in rates])
            self.v = self.v - np.linalg.lstsq(J, u, rcond=1e-9)[0]

    def run(self, times, watch=None):
        """States at the times, as dicts of columns."""
        m, out = self.m, []
        stops = sorted(set(times) | {b for b in m.breaks if 0 < b < max(times)})
        for stop in stops:
            self.middle = (self.t + stop) / 2
            if self.t > 0:
                self.settle(set())
            while self.t < stop:
                self.advance(stop, watch)
                if len(self.events) > MOST_EVENTS:
                    raise Failure("too many events")
            if stop in times:
                out.append({"t": stop, **m.named(self.q, self.v)})
        return out

    def advance(self, stop, watch):
        """To the next event, or `stop`."""
        n, y = self.m.n, np.concatenate([self.q, self.v])
        solver = DOP853(self.derivative, self.t, y, stop, rtol=1e-12, atol=1e-13, max_step=0.05)
        before, fresh = {}, None
        for _ in range(MOST_STEPS):
            if solver.step() is not None:
                raise Failure("the reference fails")
            dense = solver.dense_output()
            times = np.linspace(solver.t_old, solver.t, PARTS + 1)
            values = [self.functions(t, dense(t)) for t in times]
            event = self.first(times, values, dense, solver.t_old == self.t)
            if event is not None:
                t, name = event
                y = dense(t)
                self.t, self.q, self.v = t, y[:n], y[n:]
                self.event(name)
                return
            if watch is not None:
                watch(solver.t, self.middle, solver.y)
            if solver.status == "finished":
                self.t, self.q, self.v = stop, solver.y[:n], solver.y[n:]
                return
        raise Failure("too many steps")

    def first(self, times, values, dense, begins):
        """(t, name) of the first function that becomes negative, or None."""
        found = []
        for name in values[0]:
            f = [x[name] for x in values]
            one = lambda t, name=name: self.functions(t, dense(t))[name]
            if begins and f[0] < self.zero:
                f[0] = 0.0
                if f[1] < 0:
                    found.append((self.soon(one, times[0], times[1], f[1]), name))
                    continue
            for i in range(len(times) - 1):
                if f[i] >= 0 > f[i + 1]:
                    found.append((brentq(one, times[i], times[i + 1], xtol=1e-15, rtol=8.9e-16), name))
                    break
            dips = [(times[i - 1], times[i + 1]) for i in range(1, len(times) - 1)
                    if f[i] > 0 and f[i - 1] > f[i] <= f[i + 1] and f[i] < 0.3 * (f[i - 1] + f[i + 1])]
            if begins and 0 < f[0] <= f[1] and one(times[0] + 1e-3 * (times[1] - times[0])) < f[0]:
                dips.insert(0, (times[0], times[1]))  # a step after an event may be longer than the next phase
            for start, end in dips:
                least = minimize_scalar(one, bounds=(start, end), method="bounded", options={"xatol": 1e-10})
                if least.fun < 0:
                    found.append((brentq(one, start, least.x, xtol=1e-15, rtol=8.9e-16), name))
                    break
                if least.fun < 1e-7:
                    raise Failure("a motion touches a limit")
        return min(found) if found else None

    @staticmethod
    def soon(function, start, end, last):
        """The root of a function that grows from 0 at the start and is negative (`last`) at the end."""
        length = end - start
        for k in range(1, 40):
            t = start + length / 2**k
            value = function(t)
            if value > 0:
                return brentq(function, t, end, xtol=1e-15, rtol=8.9e-16)
            end = t
        raise Failure("a phase is too short")

    def event(self, name):
        """The changes at an event of this equation: exactly 0 is what has just reached 0."""
        mode = self.modes[name]
        state = self.state()
        e = next(x for x in state.limited if x.name == name)
        if mode in (1, -1, SLIDES) or mode == FREE and math.isnan(e.gap):
            G, J = np.array([r.g for r in e.rates]), self.m.constraints(state)[0]
            held = [r.g for o in state.limited if self.modes[o.name] == HOLDS for r in o.rates]
            rows = np.vstack([G, J, np.array(held).reshape(len(held), self.m.n)])
            self.v = self.v - np.linalg.lstsq(rows, np.concatenate([speeds(e), np.zeros(len(rows) - len(G))]),
                                              rcond=1e-9)[0]
        self.settle({name} if mode == HOLDS else set())


def simulate(model, times):
    """States at the times, and the events, of a model from its described start."""
    m = Mechanism(model)
    motion = Motion(m, m.q, m.v, max(times))
    return motion.run(times), motion.events
