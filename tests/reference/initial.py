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


def freedom_left(J, n, kept):
    """The number of independent motions that the constraints allow while these coordinates do not move."""
    if len(J) == 0:
        return n - len(kept)
    _, s, V = np.linalg.svd(J)
    N = V[int(np.sum(s > 1e-7 * s[0])):]  # of motions
    return len(N) - (np.linalg.matrix_rank(N[:, kept], tol=1e-7) if kept and len(N) else 0)


def wrong_correction(m, row):
    """Checks the start in a row of a table, of a model that specifies all values near consistent ones: None, or a text
    that says what is wrong.  The values that are kept must determine all others."""
    positions, velocities = m.names()
    q, v = np.array([row[k] for k in positions]), np.array([row[k] for k in velocities])
    J, held, state = rows_at(m, q, v)
    residual = max([abs(state.rows[i][2]) for i in held] + [abs(r.x) for _, r, _ in state.rows] + [0.0])
    if residual > 1e-12:
        return "not consistent by %.2g" % residual
    for what, rows, now, described_values in ("positions", J[held], q, m.q), ("velocities", J, v, m.v):
        kept = [i for i in range(m.n) if now[i] == described_values[i]]
        left = freedom_left(rows, m.n, kept)
        if left > 0:
            return "%d more of the %s could be kept" % (left, what)
    return None
