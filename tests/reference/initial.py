"""Models whose start Pinwheel has to make consistent: only independent values are given, or a state near a consistent
one."""
import copy
import numpy as np
from scipy.linalg import qr
from mechanisms import SPAN
from simulator import Failure, Mechanism, State

OFF = 0.02  # largest error of a described position [m, rad]


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
    """A model and options: independent values by --start, the others with errors; the consistent start is that of m."""
    J, held, _ = rows_at(m, m.q, m.v)
    positions, velocities = m.names()
    fq, fv = free(J[held], m.n), free(J, m.n)
    q = np.array([x if i in fq else x + r.uniform(-OFF, OFF) for i, x in enumerate(m.q)])
    model = described(m, q, [0.01] * m.n)
    options = [o for i in fq for o in ("--start", "%s=%r" % (positions[i], m.q[i]))]
    return model, options + [o for i in fv for o in ("--start", "%s=%r" % (velocities[i], m.v[i]))]


def specified(m):
    """A model that specifies independent velocities alone: the others follow."""
    model = copy.deepcopy(m.model)
    kept = {m.names()[1][i] for i in free(rows_at(m, m.q, m.v)[0], m.n)}
    for b in model["bodies"]:
        b["rate"] = {k: x for k, x in b["rate"].items() if "%s.%s" % (b["name"], k) in kept}
    for e in model["elements"]:
        if "rolling-wheel" in e and e["rolling-wheel"] + ".spin_rate" not in kept:
            del e["rate"]
    return model


def nearby(m, r):
    """A model whose start is only near a consistent one."""
    return described(m, [x + r.uniform(-OFF, OFF) for x in m.q], [x + r.uniform(-0.3, 0.3) for x in m.v])


def outside_range(A, b):
    """The part of b that is not in the range of A, relative to b."""
    size = np.linalg.norm(b)
    return 0.0 if size < 1e-13 else np.linalg.norm(b - A @ np.linalg.lstsq(A, b, rcond=1e-9)[0]) / size


def wrong_correction(m, row):
    """Checks the correction from the described start of m to the start in a row of a table, by the equations of the
    manual: None, or a text that says what is wrong.  Velocities: M dv = J^T mu.  Positions: M dq = G^T mu up to the
    curvature of the constraints, which is of the size of dq."""
    positions, velocities = m.names()
    q, v = np.array([row[k] for k in positions]), np.array([row[k] for k in velocities])
    J, held, state = rows_at(m, q, v)
    residual = max([abs(state.rows[i][2]) for i in held] + [abs(r.x) for _, r, _ in state.rows] + [0.0])
    if residual > 1e-12:
        return "not consistent by %.2g" % residual
    e = outside_range(J.T, m.mass * (v - m.v)) if len(J) else 0.0
    if e > 1e-9:
        return "the correction of velocities is not the smallest, by %.2g" % e
    dq = q - m.q
    e = outside_range(J[held].T, m.mass * dq) if held else 0.0
    # G is that of the last iterate, not of the described start; curvatures are about 1 to 10.
    if e > 20 * np.linalg.norm(dq):
        return "the correction of positions is not the smallest, by %.2g of it" % e
    return None
