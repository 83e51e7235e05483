"""Bodies and elements as dictionaries of text models; the classes of elements come from the library's field tables."""

from __future__ import annotations

import ctypes as c
import inspect
import keyword

from . import _library as lib
from .results import _nearest

_SHAPES = {lib.PW_NUMBER: "float", lib.PW_POINT: "[x, y]", lib.PW_VECTOR: "[x, y]", lib.PW_BODY: "str",
           lib.PW_SIGNAL: "float, dict or function of the time", lib.PW_CHOICE: "str", lib.PW_TEXT: "str", lib.PW_TRACK: "str"}
_DEFAULTS = {lib.PW_NUMBER: 0.0, lib.PW_POINT: [0, 0], lib.PW_VECTOR: [0, 0], lib.PW_SIGNAL: 0.0, lib.PW_TEXT: "", lib.PW_TRACK: None}


class Body(dict):
    """A rigid body; its origin is the centre of mass.

    Parameters
    ----------
    name : str
        Unique among bodies and elements; "ground" is reserved.
    mass : float or str
        [kg], >= 0; a number or an expression of parameters.
    inertia : float or str
        About the centre of mass [kg m^2], >= 0.
    start : dict, optional
        Initial values of x, y [m], phi [rad]; those that are not given may change to satisfy the constraints.
    rate : dict, optional
        Initial values of vx, vy [m/s], omega [rad/s].
    """

    def __init__(self, name: str, mass=0, inertia=0, start: dict | None = None, rate: dict | None = None):
        given = {"name": name, "mass": mass, "inertia": inertia, "start": start, "rate": rate}
        super().__init__({key: value for key, value in given.items() if value is not None})


class Element(dict):
    """An element of a model: ``{TYPE: NAME, FIELD: VALUE, ...}``; see the classes of the types, such as ``Pin``."""

    kind = ""
    _required: tuple = ()
    _fields: dict = {}  # names in text models, by names in Python

    def __init__(self, name: str, **fields):
        for field in fields:
            if field not in self._fields:
                raise lib.InputError(f"a {self.kind} has no {field!r}{_nearest(field, self._fields)}")
        for field in self._required:
            if field not in fields:
                raise lib.InputError(f"{self.kind} {name} needs {field!r}; see help(pinwheel.{type(self).__name__})")
        super().__init__({self.kind: name, **{self._fields[field]: value for field, value in fields.items()}})


def _python_name(field):
    name = field.name.decode().replace("-", "_")
    return name + "_" * keyword.iskeyword(name)


def _parameter(field):
    """A field as a parameter of the signature, and as lines of the docstring."""
    name, about = _python_name(field), lib.text(field.about)
    shape, unit = _SHAPES[field.type], f"[{lib.text(field.unit)}]" if field.unit else ""
    names = [word.decode() for word in _until_null(field.choices)]
    default = names[0] if names else _DEFAULTS.get(field.type, "")
    if names:
        shape = "{" + ", ".join(f'"{word}"' for word in names) + "}"
    if field.count > 1:
        shape, default = f"list of {field.count} {shape}", [default] * field.count
    properties = [shape, "required" if field.required else f"default {default!r}"]
    domain = [*lib.DOMAINS.values()][field.domain]
    lines = [f"{name} : {', '.join(properties)}", "    " + " ".join(filter(None, [about, unit, domain]))]
    if field.required:
        default = inspect.Parameter.empty
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default), lines


def _until_null(pointer):
    """The entries of an array in C that ends with NULL."""
    i = 0
    while pointer and pointer[i]:
        yield pointer[i]
        i += 1


def _class(kind):
    """The subclass of Element for an element type."""
    fields = [(field, *_parameter(field)) for field in lib.listed(lib.pw_field, kind.fields)]
    name = kind.name.decode()
    about = lib.text(kind.about)
    doc = [about[:1].upper() + about[1:] + ".", "", "Parameters", "----------", "name : str",
           "    Unique among bodies and elements."] + [line for _, _, lines in fields for line in lines]
    reactions = list((lib.pw_quantity * kind.rows).from_address(kind.reaction)) if kind.reaction else []
    if reactions:
        doc += ["", "Notes", "-----", "Reactions, as columns NAME.REACTION of results:", ""]
        doc += [f"- {r.name.decode()} [{lib.text(r.unit)}]: {lib.text(r.about)}" for r in reactions]
    signature = inspect.Signature([inspect.Parameter("name", inspect.Parameter.POSITIONAL_OR_KEYWORD)]
                                  + sorted((p for _, p, _ in fields), key=lambda p: p.default is not p.empty))
    title = "".join(word.capitalize() for word in name.split("-"))
    return type(title, (Element,), {
        "__doc__": "\n".join(doc), "__module__": "pinwheel", "__signature__": signature, "kind": name,
        "_fields": {p.name: f.name.decode() for f, p, _ in fields},
        "_required": tuple(p.name for f, p, _ in fields if f.required)})


def _classes():
    """Names and classes of all element types."""
    pointers = c.cast(lib.core.pw_kinds, c.POINTER(c.c_void_p))
    for address in _until_null(pointers):
        element = _class(lib.pw_kind.from_address(address))
        yield element.__name__, element


KINDS = dict(_classes())
