"""Transformations of models whose results follow from those of the model: units, mirror, displacement, order, time.

A transformation is a function of a model and random numbers.  It returns another model, a function that maps a row of
its table to the row that the first model must have (columns that are missing there are not compared), and the ratio of
the times; or None if it does not apply."""
import cmath
import copy
import json
import math
import re
from simulator import SIGNALS

# Dimensions of fields: exponents of kg, m, s.  Other fields, such as angles, have none.
LENGTH, SPEED, FORCE, MOMENT = (0, 1, 0), (0, 1, -1), (1, 1, -2), (1, 2, -2)
FIELDS = {
    "rod": {"length": LENGTH}, "rolling-wheel": {"radius": LENGTH, "inertia": (1, 2, 0), "rate": (0, 0, -1),
                                                 "torque": MOMENT},
    "speed": {"value": SPEED}, "pfaffian": {"value": SPEED},
    "tyre": {"stiffness": FORCE, "speed": SPEED, "load": FORCE}, "rolling-resistance": {"limit": FORCE, "speed": SPEED},
    "spring": {"stiffness": (1, 0, -2), "damping": (1, 0, -1), "length": LENGTH},
    "rotational-spring": {"stiffness": MOMENT, "damping": (1, 2, -1)},
    "friction": {"viscous": (1, 2, -1), "limit": MOMENT, "speed": (0, 0, -1)},
    "sliding-friction": {"viscous": (1, 0, -1), "limit": FORCE, "speed": SPEED},
    "drag": {"linear": (1, 0, -1), "quadratic": (1, -1, 0), "turning": (1, 2, -1), "turning_quadratic": (1, 2, 0)},
    "gravity": {"acceleration": (0, 1, -2)}, "force": {"fx": FORCE, "fy": FORCE}, "torque": {"value": MOMENT},
    "motor": {"stiffness": MOMENT, "damping": (1, 2, -1), "limit": MOMENT, "rate": (0, 0, -1)}}
STATES = {"x": LENGTH, "y": LENGTH, "phi": (0, 0, 0), "vx": SPEED, "vy": SPEED, "omega": (0, 0, -1), "spin": (0, 0, 0),
          "spin_rate": (0, 0, -1)}

def kind_of(e):
    return next(iter(e))


def is_signal(kind, field):
    return (kind, field) in SIGNALS


def signal(s, scale=1.0, tau=1.0, shift=0.0, states=None):
    """The signal scale u (t/tau + shift); states: formats that replace a state, by its name such as "vx"."""
    if not isinstance(s, (dict, str)):
        return scale * s

    def words(text, factor):
        text = re.sub(r"\b[A-Za-z]\w*\.([a-z]\w*)\b", lambda m: (states or {}).get(m[1], "%s") % m[0], text)
        # In comparisons of t the other side is transformed, elsewhere t.
        parts = re.split(r"\bt ([<>]) ([\d.]+)", text)
        moved = "t" if (tau, shift) == (1.0, 0.0) else "(t*%r + %r)" % (1 / tau, shift)
        parts[1::3] = [" t %s " % x for x in parts[1::3]]
        parts[2::3] = [repr((float(x) - shift) * tau) for x in parts[2::3]]
        parts[0::3] = [re.sub(r"\bt\b", moved, x) for x in parts[0::3]]
        return "%r*(%s)" % (factor, "".join(parts))
    if isinstance(s, str):
        return words(s, scale)
    if "expression" in s:
        return {k: words(x, scale / tau**["expression", "rate", "acceleration"].index(k)) for k, x in s.items()}
    (form, f), = copy.deepcopy(s).items()
    if form == "constant":
        return {form: scale * f}
    for k in ("amplitude", "offset", "from", "to", "height"):
        if k in f:
            f[k] *= scale
    for k in ("duration", "width", "period"):
        if k in f:
            f[k] *= tau
    if form == "harmonic":
        f["phase"], f["omega"] = f.get("phase", 0) + f["omega"] * shift, f["omega"] / tau
    elif form == "table":
        f["points"] = [[(t - shift) * tau, scale * u] for t, u in f["points"]]
    else:
        f["start"] = (f.get("start", 0) - shift) * tau
    return {form: f}


def scaled(x, c):
    return [scaled(y, c) for y in x] if isinstance(x, list) else x * c


def units(model, r, scales=None):
    """Random units of mass, length and time, 1e-9 to 1e6 of the SI units."""
    kg, m, s = scales or [10.0**r.uniform(-9, 6) for _ in range(3)]

    def factor(d):
        return kg**d[0] * m**d[1] * s**d[2]
    new = copy.deepcopy(model)
    states = {k: "(%%s*%r)" % (1 / factor(d)) for k, d in STATES.items()}
    new["run"]["t_end"] *= s
    for b in new["bodies"]:
        b.update({k: b[k] * factor(d) for k, d in (("mass", (1, 0, 0)), ("inertia", (1, 2, 0))) if k in b})
        for part in ("start", "rate"):
            b[part] = {k: x * factor(STATES[k]) for k, x in b.get(part, {}).items()}
    for e in new["elements"]:
        kind = kind_of(e)
        dimensions = {**FIELDS.get(kind, {}), "at": LENGTH}
        if kind == "drive" and e["what"] != "angle":
            dimensions["value"] = LENGTH
        for field in list(e):
            c = factor(dimensions.get(field, (0, 0, 0)))
            if is_signal(kind, field):
                e[field] = signal(e[field], c, s, 0.0, states)
            elif field in dimensions:
                e[field] = scaled(e[field], c)
        if kind == "pfaffian":
            for k in "ab":
                e[k] = [x * c for x, c in zip(e[k], (1, 1, m))]
    moments = {e["drive"] for e in new["elements"] if kind_of(e) == "drive" and e["what"] == "angle"}

    def back(row):
        out = {}
        for k, x in row.items():
            name, _, column = k.partition(".")
            d = (0, 0, 1) if k == "t" else STATES.get(column) or \
                ((1, 2, -2) if column in ("M", "work", "loss", "") or name in moments else FORCE)
            out[k] = x / factor(d)
        return out
    return new, back, s


def mirrored(model, r):
    """Mirrored in the x axis: y and angles change their signs."""
    new = copy.deepcopy(model)
    flip = {k: "(-%s)" for k in ("y", "phi", "vy", "omega")}
    for b in new["bodies"]:
        for part in ("start", "rate"):
            b[part] = {k: -x if k in flip else x for k, x in b.get(part, {}).items()}
    for e in new["elements"]:
        kind = kind_of(e)
        if "at" in e:
            e["at"] = [[x, -y] for x, y in e["at"]] if isinstance(e["body"], list) else [e["at"][0], -e["at"][1]]
        for field in list(e):
            odd = (kind, field) in (("steered-wheel", "heading"), ("torque", "value"), ("force", "fy"),
                                    ("motor", "angle"), ("motor", "rate")) or \
                (kind, field) == ("drive", "value") and e["what"] != "x"
            if is_signal(kind, field):
                e[field] = signal(e[field], -1.0 if odd else 1.0, states=flip)
            elif field in ("heading", "angle", "offset"):
                e[field] *= -1
        if kind == "pfaffian":
            e["a"], e["b"] = ([x, -y, -w] for x, y, w in (e["a"], e["b"]))
        if kind == "gravity":
            e["acceleration"][1] *= -1
    odd = {e[kind_of(e)] for e in new["elements"] if kind_of(e) == "drive" and e["what"] != "x"}

    def back(row):
        return {k: -x if k.partition(".")[2] in ("y", "phi", "vy", "omega", "Fy", "M", "N") or
                k.partition(".")[0] in odd and k.endswith(".F") else x for k, x in row.items()}
    return new, back, 1.0


def displaced(model, r):
    """Displaced by a random vector."""
    d = [r.uniform(-50, 50), r.uniform(-50, 50)]
    new = copy.deepcopy(model)
    states = {"x": "(%%s - %r)" % d[0], "y": "(%%s - %r)" % d[1]}
    constant = 0.0  # that is added to the potential energy
    for b in new["bodies"]:
        b["start"]["x"] += d[0]
        b["start"]["y"] += d[1]
    for e in new["elements"]:
        kind = kind_of(e)
        if "at" in e and isinstance(e["body"], list):
            e["at"] = [[s[0] + d[0], s[1] + d[1]] if b == "ground" else s for b, s in zip(e["body"], e["at"])]
        e.update({f: signal(e[f], states=states) for f in list(e) if is_signal(kind, f)})
        if kind == "gravity":
            a = e["acceleration"]
            constant -= sum(b.get("mass", 0) for b in model["bodies"]) * (d[0] * a[0] + d[1] * a[1])

    def back(row):
        moved = {k: x - d["xy".index(k[-1])] for k, x in row.items() if re.fullmatch(r"b\d+\.[xy]", k)}
        return {**row, **moved, "potential": row["potential"] - constant}
    return new, back, 1.0


def turned(model, r):
    """Turned and displaced: a massless body that is welded to the ground replaces it."""
    angle, z = r.uniform(-3, 3), complex(r.uniform(-2, 2), r.uniform(-2, 2))
    if any(kind_of(e) == "force" and e["axes"] == "world" for e in model["elements"]):
        angle = 0.0
    turn = cmath.exp(1j * angle)
    new = copy.deepcopy(model)
    if any(re.search(r"\.(x|y|vx|vy)\b", json.dumps(e.get(f))) for e in new["elements"] for f in e):
        angle, turn = 0.0, 1.0
    states = {"x": "(%%s - %r)" % z.real, "y": "(%%s - %r)" % z.imag, "phi": "(%%s - %r)" % angle}
    for b in new["bodies"]:
        p = z + turn * complex(b["start"]["x"], b["start"]["y"])
        v = turn * complex(b["rate"]["vx"], b["rate"]["vy"])
        b["start"] = {"x": p.real, "y": p.imag, "phi": b["start"]["phi"] + angle}
        b["rate"] = {"vx": v.real, "vy": v.imag, "omega": b["rate"]["omega"]}
    constant = 0.0  # that is added to the potential energy
    for e in new["elements"]:
        kind = kind_of(e)
        if isinstance(e.get("body"), list):
            e["body"] = ["base" if b == "ground" else b for b in e["body"]]
        e.update({f: signal(e[f], states=states) for f in list(e) if is_signal(kind, f)})
        if kind == "gravity":
            a = turn * complex(*e["acceleration"])
            e["acceleration"] = [a.real, a.imag]
            constant -= sum(b.get("mass", 0) for b in model["bodies"]) * (z.conjugate() * a).real
    new["bodies"].append({"name": "base", "start": {"x": z.real, "y": z.imag, "phi": angle}, "rate": {}})
    new["elements"].append({"weld": "hold", "body": ["base", "ground"], "at": [[0, 0], [z.real, z.imag]],
                            "angle": -angle})

    def back(row):
        out = {k: x for k, x in row.items() if not k.startswith(("base.", "hold."))}
        for k in list(out):
            name, _, column = k.partition(".")
            for a, b, shift in (("x", "y", z), ("vx", "vy", 0), ("Fx", "Fy", 0)):
                if column == a:
                    p = (complex(row[k], row[name + "." + b]) - shift) / turn
                    out[k], out[name + "." + b] = p.real, p.imag
            if column == "phi":
                out[k] -= angle
        return {**out, "potential": out["potential"] - constant}
    return new, back, 1.0


def shuffled(model, r):
    """Bodies and elements in another order."""
    new = copy.deepcopy(model)
    r.shuffle(new["bodies"])
    r.shuffle(new["elements"])
    return new, lambda row: row, 1.0


def later(model, shift):
    """The model as it is from the time `shift` on."""
    new = copy.deepcopy(model)
    for e in new["elements"]:
        e.update({f: signal(e[f], shift=shift) for f in list(e) if is_signal(kind_of(e), f)})
    return new


# ---- Equivalent elements: the states must agree ----

def rewrite(model, rules, r):
    """Replaces most elements for which there is a rule by kind; None if none is replaced."""
    new, found = copy.deepcopy(model), False
    new["elements"] = []
    for e in model["elements"]:
        other = rules.get(kind_of(e), lambda e, new: None)(copy.deepcopy(e), new) if r.random() < 0.8 else None
        found = found or other is not None
        new["elements"] += [e] if other is None else other
    return (new, lambda row: row, 1.0) if found else None


def rod_to_body(e, new):
    """A massless body with a pin at each end."""
    name, frames = e["rod"], {b["name"]: b["start"] for b in new["bodies"]}
    ends = []
    for b, s in zip(e["body"], e["at"]):
        f = frames.get(b, {"x": 0, "y": 0, "phi": 0})
        ends.append(complex(f["x"], f["y"]) + complex(*s) * cmath.exp(1j * f["phi"]))
    middle, phi = (ends[0] + ends[1]) / 2, cmath.phase(ends[0] - ends[1])
    new["bodies"].append({"name": name + "bar", "start": {"x": middle.real, "y": middle.imag, "phi": phi}})
    half = e["length"] / 2
    return [{"pin": name + "p", "body": [e["body"][0], name + "bar"], "at": [e["at"][0], [half, 0]]},
            {"pin": name + "q", "body": [e["body"][1], name + "bar"], "at": [e["at"][1], [-half, 0]]}]


def angle_drive(name, e, value):
    return {"drive": name + "d", "body": e["body"], "what": "angle", "value": value}


def pin_of(name, e):
    return {"pin": name + "p", "body": e["body"], "at": e["at"]}


def slots(name, e, headings):
    return [{"slot": name + "s%d" % i, "body": e["body"], "at": e["at"], "heading": h} for i, h in enumerate(headings)]


def wheel_pfaffian(e, new):
    """The same row, written by its coefficients."""
    c, s = math.cos(e["heading"]), math.sin(e["heading"])
    return [{"pfaffian": e["wheel"], "body": [e["body"], "ground"], "a": [-s, c, e["at"][0] * c + e["at"][1] * s]}]


def friction_expression(e, w):
    text = "-%r*(%s)" % (e.get("viscous", 0), w)
    return text + (" - %r*tanh((%s)/%r)" % (e["limit"], w, e["speed"]) if e.get("limit", 0) > 0 else "")


def state(body, name):
    return "0" if body == "ground" else body + "." + name


def relative(e, name):
    return "%s - %s" % (state(e["body"][0], name), state(e["body"][1], name))


def motor_expression(e, new):
    if not all(isinstance(e[k], (int, float)) for k in ("angle", "rate")):
        return None
    y = "(%r*(%r - (%s)) + " % (e["stiffness"], e["angle"], relative(e, "phi"))
    y += "%r*(%r - (%s)))" % (e["damping"], e["rate"], relative(e, "omega"))
    y = "%r*tanh(%s/%r)" % (e["limit"], y, e["limit"]) if e.get("limit") else y
    return [{"torque": e["motor"], "body": e["body"], "value": y}]


def drag_force(e, new):
    b, name = e["body"], e["drag"]
    c = "-(%r + %r*sqrt(%s.vx^2 + %s.vy^2))" % (e.get("linear", 0), e.get("quadratic", 0), b, b)
    d = "-(%r + %r*sqrt(%s.omega^2))*%s.omega" % (e.get("turning", 0), e.get("turning_quadratic", 0), b, b)
    return [{"force": name, "body": b, "at": [0, 0], "axes": "world", "fx": "%s*%s.vx" % (c, b),
             "fy": "%s*%s.vy" % (c, b)},
            {"torque": name + "t", "body": [b, "ground"], "value": d}]


def gravity_forces(e, new):
    return [{"force": e["gravity"] + b["name"], "body": b["name"], "at": [0, 0], "axes": "world",
             "fx": b["mass"] * e["acceleration"][0],
             "fy": b["mass"] * e["acceleration"][1]} for b in new["bodies"] if b.get("mass", 0) > 0]


def rolling_without_inertia(e, new):
    """A wheel without inertia transmits its torque to the ground: a wheel, and a force along its heading."""
    if e.get("inertia", 0) > 0 or any("%s.spin" % e["rolling-wheel"] in json.dumps(x) for x in new["elements"]):
        return None
    name = e["rolling-wheel"]
    out = [{"wheel": name, "body": e["body"], "at": e["at"], "heading": e["heading"]}]
    if "torque" in e:
        c, s = math.cos(e["heading"]) / e["radius"], math.sin(e["heading"]) / e["radius"]
        out.append({"force": name + "f", "body": e["body"], "at": e["at"], "axes": "body", "fx": signal(e["torque"], c),
                    "fy": signal(e["torque"], s)})
    return out


def gear_pfaffian(e, new):
    if e["body"][2] != "ground":
        return None
    return [{"pfaffian": e["gear"], "body": e["body"][:2], "a": [0, 0, 1], "b": [0, 0, -e["ratio"]]}]


def tyres(model, stiffness):
    """Replaces wheels by tyres: their lateral velocity is the lateral force times speed / stiffness."""
    new = copy.deepcopy(model)
    new["elements"] = [{"tyre": e["wheel"], **{k: e[k] for k in ("body", "at", "heading")}, "stiffness": stiffness,
                        "speed": 0.5}
                       if "wheel" in e else e for e in new["elements"]]
    return new


def zero_lateral_speed(e, new):
    return [{"speed": e["wheel"], **{k: e[k] for k in ("body", "at")}, "heading": e["heading"] + math.pi / 2,
             "value": 0}]


def friction_torque(e, new):
    return [{"torque": e["friction"], "body": e["body"], "value": friction_expression(e, relative(e, "omega"))}]


EQUIVALENT = [
    {"rod": rod_to_body},
    {"slider": lambda e, new: slots(e["slider"], e, [e["heading"]]) + [angle_drive(e["slider"], e, e["angle"])],
     "pin": lambda e, new: slots(e["pin"], e, [0.3, 0.3 + math.pi / 2])},
    {"weld": lambda e, new: [pin_of(e["weld"], e), angle_drive(e["weld"], e, -e["angle"])]},
    {"weld": lambda e, new: [{"slider": e["weld"] + "a", **{k: e[k] for k in ("body", "at")}, "heading": 0.7,
                              "angle": -e["angle"]}] +
        slots(e["weld"], e, [2.0]), "pin": lambda e, new: [
            {"drive": e["pin"] + w, "body": e["body"], "at": e["at"], "what": w, "value": 0} for w in "xy"]},
    {"wheel": wheel_pfaffian, "gear": gear_pfaffian},
    {"wheel": lambda e, new: [{**{"steered-wheel": e["wheel"]}, **{k: x for k, x in e.items() if k != "wheel"}}]},
    {"wheel": zero_lateral_speed},
    {"friction": friction_torque,
     "motor": motor_expression},
    {"rotational-spring": lambda e, new: [{"motor": e["rotational-spring"], "body": e["body"],
                                           "stiffness": e["stiffness"],
                                           "damping": e["damping"], "angle": e["angle"]}]},
    {"drag": drag_force, "gravity": gravity_forces},
    {"rolling-wheel": rolling_without_inertia}]
