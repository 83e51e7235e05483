"""Models whose start Pinwheel has to make consistent: independent values are given or specified, or more values that
contradict each other."""
import copy
import numpy as np
from scipy.linalg import qr
from mechanisms import SPAN
from simulator import Failure, Mechanism, State

OFF = 0.02  # largest error of a described position [m, rad]
WELL = 1e-2  # least singular value, relative, of the equations for values that are determined well
CHANGE = 0.05  # what a position that is kept may change others, at least [units of L and rad]


def rows_at(m, q, v):
    """J, the indices of its holonomic rows, and the state."""
    state = State(m, 0.0, m.middle(0.0), q, v)
    return m.constraints(state)[0], [i for i, (_, _, g) in enumerate(state.rows) if g is not None], state


def free(J, n):
    """Independent coordinates: as many as J leaves free, those that determine the others best."""
    if len(J) == 0:
        return list(range(n))
    _, s, V = np.linalg.svd(J)
    N = V[int(np.sum(s > 1e-7 * s[0])):]
    return list(qr(N, pivoting=True, mode="r")[1][:len(N)])


def described(m, q, v):
    """The model with another start; gears keep their offsets."""
    model = copy.deepcopy(m.model)
    for i, b in enumerate(model["bodies"]):
        b["start"] = dict(zip(("x", "y", "phi"), map(float, q[3 * i:3 * i + 3])))
        b["rate"] = dict(zip(("vx", "vy", "omega"), map(float, v[3 * i:3 * i + 3])))
    for e in model["elements"]:
        if "rolling-wheel" in e:
            i = m.own[e["rolling-wheel"]]
            e["start"], e["rate"] = float(q[i]), float(v[i])
        if "gear" in e and e.get("from", "start") == "start":
            a, b, c = (m.start_angle(x) for x in e["body"])
            e.update({"from": "offset", "offset": a - c - e["ratio"] * (b - c)})
    return model


def by_free(m, r):
    """A model, options and the names kept: independent values by --start, the others with errors; the consistent start is
    that of m."""
    J, held, _ = rows_at(m, m.q, m.v)
    positions, velocities = m.names()
    fq, fv = free(J[held], m.n), free(J, m.n)
    q = np.array([x if i in fq else x + r.uniform(-OFF, OFF) for i, x in enumerate(m.q)])
    model = described(m, q, [0.01] * m.n)
    options = [o for i in fq for o in ("--start", "%s=%r" % (positions[i], m.q[i]))]
    options += [o for i in fv for o in ("--start", "%s=%r" % (velocities[i], m.v[i]))]
    return model, options, [positions[i] for i in fq] + [velocities[i] for i in fv]


def without(m, model, names):
    """The model without these values: they are left out."""
    model = copy.deepcopy(model)
    for b in model["bodies"]:
        for part in ("start", "rate"):
            b[part] = {k: x for k, x in b[part].items() if "%s.%s" % (b["name"], k) not in names}
    for e in model["elements"]:
        for field, state in (("start", "spin"), ("rate", "spin_rate")):
            if "rolling-wheel" in e and "%s.%s" % (e["rolling-wheel"], state) in names:
                del e[field]
    return model


def specified(m, positions):
    """A model that specifies independent velocities alone, or such positions, too; and the names of these values."""
    J, held, _ = rows_at(m, m.q, m.v)
    names, kept = m.names(), {m.names()[1][i] for i in free(J, m.n)}
    kept |= {names[0][i] for i in (free(J[held], m.n) if positions else range(m.n))}
    return without(m, described(m, m.q, m.v), set(names[0] + names[1]) - kept), sorted(kept)


def nearby(m, r):
    """A model whose start is only near a consistent one, options that give some of its values, and the importance of
    each value (0: left out) by name."""
    q = [x + r.uniform(-OFF, OFF) for x in m.q]
    v = [0.0 if r.random() < 0.2 else x + r.uniform(-0.3, 0.3) for x in m.v]
    importance, options = {}, []
    for names, values, left_out in zip(m.names(), (q, v), (0.05, 0.2)):
        for name, x in zip(names, values):
            given = r.random() < 0.2
            left_out_here = r.random() < left_out or x == 0 and name.endswith(".spin_rate")  # 0: from rolling
            importance[name] = 0 if not given and left_out_here else 1 + (x != 0) + 2 * given
            options += ["--start", "%s=%r" % (name, x)] if given else []
    return without(m, described(m, q, v), {k for k, i in importance.items() if i == 0}), options, importance


def inconsistent(m, q, v):
    """A text if positions or velocities violate the constraints."""
    _, held, state = rows_at(m, q, v)
    residual = max([abs(state.rows[i][2]) for i in held] + [abs(r.x) for _, r, _ in state.rows] + [0.0])
    return "not consistent by %.2g" % residual if residual > 1e-12 else None


def with_values(m, level, q, v, held, values):
    """The positions (level 0) or velocities (1) next to q or v with those `held` at their values, or None: there are none,
    or others would not be determined well."""
    state = [np.array(q), np.array(v)]
    state[level][held] = values[held]
    others = [j for j in range(m.n) if j not in held]
    for _ in range(15):
        J, positions, now = rows_at(m, *state)
        A = J if level else J[positions]
        b = np.array([r.x for _, r, _ in now.rows] if level else [now.rows[i][2] for i in positions])
        if len(b) == 0 or max(abs(b)) < 1e-12:
            return state[level]
        if others:
            state[level][others] -= np.linalg.lstsq(A[:, others], b, rcond=WELL)[0]
    return None


def precedence(m, names, importance):
    """The values that are not left out, the most important ones first, and in the order of the file; of a body the angle
    comes first."""
    bodies = 3 * len(m.bodies)
    order = [j for i in range(0, bodies, 3) for j in (i + 2, i, i + 1)] + list(range(bodies, m.n))
    return sorted([j for j in order if importance[names[j]]], key=lambda j: -importance[names[j]])


def not_kept(m, row, importance):
    """Checks which values of the described start of m are kept in a row of a table: None, or a text that names one that
    is lost, although a consistent state near the row has it and those kept before it, and changes others little."""
    q, v = ([row[k] for k in part] for part in m.names())
    for level, (names, values, now) in enumerate(zip(m.names(), (m.q, m.v), (q, v))):
        order, kept = precedence(m, names, importance), []
        unit = np.array([1.0 if level or i % 3 == 2 or i >= 3 * len(m.bodies) else m.length for i in range(m.n)])
        size = 10 * (1 + max(abs(m.v))) if level else CHANGE
        for j in order:
            if now[j] == values[j]:
                kept.append(j)
                continue
            other = with_values(m, level, q, v, kept + [j], values)
            if other is not None and max(abs(other - values)[order] / unit[order]) < size:
                return "%s is not kept, though it could be together with %s; it changes others by %.2g" % (
                    names[j], ", ".join(names[k] for k in kept), max(abs(other - values)[order] / unit[order]))
    return None


def locked(m, v, importance):
    """Whether the constraints allow none of the most important velocities that are not 0 to move, at the start of m."""
    J, names = rows_at(m, m.q, m.v)[0], m.names()[1]
    N = np.linalg.svd(J)[2][np.linalg.matrix_rank(J, 1e-9):] if len(J) else np.eye(m.n)
    moving = [j for j in range(m.n) if v[j] != 0 and importance[names[j]]]
    first = max([importance[names[j]] for j in moving], default=0)
    return all(np.linalg.norm(N[:, j]) < 1e-9 for j in moving if importance[names[j]] == first)


def wrong_start(m, row, importance):
    """Checks a consistent start, a row of a table: None, or a text that says what is wrong."""
    q, v = (np.array([row[k] for k in part]) for part in m.names())
    return inconsistent(m, q, v) or not_kept(m, row, importance)
