"""Models: files, descriptions in Python, compiled systems."""

from __future__ import annotations

import ctypes as c
import json
import pathlib
import tempfile
from dataclasses import dataclass

import numpy as np

from . import _library as lib
from .results import Result, _nearest
from .simulation import Simulation


class _System:
    """A compiled system; simulations share it."""

    def __init__(self, pointer, keep):
        self.pointer, self._keep = pointer, keep

    def __del__(self):
        if self.pointer:
            lib.core.pw_system_free(self.pointer)


class _Handle:
    """A C object and the function that deletes it."""

    def __init__(self, pointer, free):
        self.pointer, self._free = pointer, free

    def __del__(self):
        if self.pointer:
            self._free(self.pointer)


@dataclass(frozen=True)
class Linear:
    """A linearisation x' = A x + B u in minimal coordinates, positions first, in a frame that moves with the motion.

    Attributes
    ----------
    A : ndarray, shape (n, n)
        [1/s]
    B : ndarray, shape (n, inputs)
        Columns of signals of constraints are NaN.
    eigenvalues : ndarray of complex, shape (n,)
        [1/s], the fastest growing first.
    basis : ndarray, shape (states, n)
        Perturbation of the states per m of x.
    steady : bool
        Whether the eigenvalues are growth rates of perturbations.
    twist : ndarray, shape (3,)
        Velocity of the frame [m/s, m/s, rad/s].
    """

    A: np.ndarray
    B: np.ndarray
    eigenvalues: np.ndarray
    basis: np.ndarray
    inputs: list
    states: list
    steady: bool
    twist: np.ndarray


def models() -> dict:
    """Names of the models on the search path, and their files."""
    found, error = {}, lib.pw_error()

    @c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_char_p, c.c_char_p)
    def each(_, name, path):
        found[name.decode()] = path.decode()
        return 0

    lib.files.pw_file_list(each, None, c.byref(error))
    lib.check(error)
    return found


class Model:
    """A model with values of its parameters.

    Parameters
    ----------
    model : str or path
        A name ("snakeboard"), or the path of a .yaml, .c or .so file.
    start : dict, optional
        Initial values of states, such as ``{"frame.vx": 1}``.
    signals : dict, optional
        Functions of the time that replace signals: ``{"rider": lambda t: 0.1 * math.cos(t)}``; of a constraint they return
        the value, its rate and its acceleration.
    **parameters : float
        Values of the model's parameters.

    Raises
    ------
    InputError
        For an unknown name, parameter or state, with the nearest valid name.

    Attributes
    ----------
    name, about : str
    parameters : dict
        Values of all parameters.
    defaults : dict
        Method, t_end, step, rtol of the model.
    """

    def __init__(self, model, *, start=None, signals=None, **parameters):
        self.source, self.start, self.signals = str(model), dict(start or {}), dict(signals or {})
        error = lib.pw_error()
        pointer = lib.files.pw_file_open(self.source.encode(), c.byref(error))
        lib.check(error)
        self._file = _Handle(pointer, lib.files.pw_file_close)
        table = lib.files.pw_file_table(pointer).contents
        self.name, self.about = lib.text(lib.files.pw_file_name(pointer)), lib.text(table.about)
        self.defaults = {"method": lib.text(table.run__method) or "rk4+projection", "t_end": table.run__t_end or 10.0,
                         "step": table.run__step or 1e-3, "rtol": table.run__rtol or 1e-6}
        self.parameters, self.units = {}, {}
        size, at = c.sizeof(lib.pw_parameter), table.parameters
        while at and (p := lib.pw_parameter.from_address(at)).name:
            self.parameters[p.name.decode()], self.units[p.name.decode()] = p.value, lib.text(p.unit)
            at += size
        for name, value in parameters.items():
            if name not in self.parameters:
                raise lib.InputError(f"model {self.name} has no parameter {name!r}{_nearest(name, self.parameters)}")
            self.parameters[name] = float(value)
        self._given = parameters
        self._compiled = None

    def __repr__(self):
        changed = "".join(f", {name}={value:g}" for name, value in self._given.items())
        return f"<Model {self.name}{changed}: {self.about}>"

    def __reduce__(self):
        if self.signals:
            raise TypeError("a model with functions as signals cannot be sent to other processes")
        return _restore, (self.source, self.start, self._given)

    def replace(self, *, start=None, **parameters) -> Model:
        """The same model with other parameters or initial values."""
        return Model(self.source, start={**self.start, **(start or {})}, signals=self.signals, **{**self._given, **parameters})

    # ---- Compiling ----

    def _compile(self, inputs=()):
        if not inputs and self._compiled:
            return self._compiled
        error, keep = lib.pw_error(), [self._file]
        model = _Handle(lib.files.pw_file_model(self._file.pointer, c.byref(error)), lib.core.pw_model_free)
        lib.check(error)
        for name, value in self._given.items():
            lib.core.pw_model_set(model.pointer, name.encode(), value, c.byref(error))
        lib.check(error)
        lib.core.pw_model_build(model.pointer, c.byref(error))
        lib.check(error)
        for state, value in self.start.items():
            lib.core.pw_model_set_initial(model.pointer, state.encode(), value, c.byref(error))
        lib.check(error)
        for name, function in self.signals.items():
            self._set_signal(model, name, _callback(function), None, keep)
        cells = {name: c.c_double(inputs[name]) for name in inputs}
        own = c.cast(lib.core.pw_input_signal, c.c_void_p).value
        for name, cell in cells.items():
            self._set_signal(model, name, own, c.addressof(cell), keep)
        pointer = lib.core.pw_system_compile(model.pointer, c.byref(error))
        lib.check(error)
        system = _System(pointer, (keep, model, cells))
        if not inputs:
            self._compiled = system, cells
        return system, cells

    def _set_signal(self, model, name, function, context, keep):
        """`name`: ELEMENT or ELEMENT.FIELD."""
        signal, error = lib.pw_signal(), lib.pw_error()
        signal.type = lib.PW_FUNCTION
        signal.function__eval = function if isinstance(function, int) else c.cast(function, c.c_void_p).value
        signal.function__context = context
        keep.append(function)
        element, _, field = name.partition(".")
        lib.core.pw_model_set_signal(model.pointer, element.encode(), (field or "value").encode(), c.byref(signal), c.byref(error))
        lib.check(error)

    # ---- Running ----

    def open(self, method=None, *, t_end=None, step=None, rtol=None, atol=None, max_steps=None, energy=False,
             inputs=None) -> Simulation:
        """Opens a run that the caller advances.

        Parameters
        ----------
        method : str, optional
            Integrator and stabilisation, "erk8+projection"; default: the model's.
        t_end : float, optional
            Expected final time [s]: only for the scale of a scene at rest.
        step, rtol, atol, max_steps : float, optional
            Step size [s] of fixed-step methods; tolerances of adaptive ones; largest number of steps.
        energy : bool
            Whether samples contain work and losses by element.
        inputs : dict, optional
            Signals that the caller sets between steps, and their initial values: ``{"rider": 0.0}``.

        Raises
        ------
        InputError, InitialError, MethodError
        """
        system, cells = self._compile(inputs or {})
        given = {"span": t_end or self.defaults["t_end"], "step": step or self.defaults["step"],
                 "rtol": rtol or self.defaults["rtol"], "atol": atol or 0.0, "max_steps": int(max_steps or 0),
                 "ledger": int(energy)}
        settings = lib.pw_settings()
        for name, value in given.items():
            setattr(settings, name, value)
        return Simulation(self, system, cells, method or self.defaults["method"], settings, energy)

    def run(self, method=None, *, t_end=None, every=None, times=None, start=None, progress=None, **settings) -> Result:
        """Integrates and returns the samples.

        Parameters
        ----------
        method : str, optional
            "erk8+projection"; default: the model's.
        t_end : float, optional
            Final time [s]; default: the model's.
        every : float, optional
            Time between samples [s]; default: a sample after every step.
        times : array_like, shape (n,), optional
            Increasing times of samples [s].
        start : dict, optional
            Initial values of states.
        progress : callable, optional
            Called with the fraction done.
        **settings
            step, rtol, atol, max_steps, energy: see :meth:`open`.

        Returns
        -------
        Result
        """
        model = self.replace(start=start) if start else self
        end = float(t_end if t_end is not None else self.defaults["t_end"])
        with model.open(method, t_end=end, **settings) as simulation:
            result = simulation.record(end, every, times, progress)
        result.settings.update(settings)
        return result

    def linearise(self, at=0.0, most=200) -> Linear:
        """Linearises at time ``at`` [s] of a run with the model's method; at most ``most`` coordinates."""
        with self.open(t_end=at or None) as simulation:
            if at:
                simulation.advance(at)
            linear, error = lib.pw_linear(), lib.pw_error()
            lib.core.pw_run_linear_modes(simulation._run, most, c.byref(linear), c.byref(error))
            try:
                lib.check(error)
                return self._linear(linear, simulation._system.pointer)
            finally:
                lib.core.pw_linear_free(c.byref(linear))

    @staticmethod
    def _linear(l, s):
        if not l.A:
            raise lib.InputError("too many coordinates to linearise: raise `most`")
        n, states = l.unknowns, 2 * lib.core.pw_system_coordinates(s)
        inputs = [lib.name_of(lib.core.pw_system_signal_name, s, i) for i in range(lib.core.pw_system_signals(s))]

        def matrix(pointer, rows, columns):
            return np.ctypeslib.as_array(pointer, (rows, columns)).copy() if rows * columns else np.zeros((rows, columns))

        return Linear(matrix(l.A, n, n), matrix(l.B, n, len(inputs)),
                      np.array([complex(l.re[i], l.im[i]) for i in range(n)]), matrix(l.basis, states, n), inputs,
                      [lib.name_of(lib.core.pw_system_state_name, s, i) for i in range(states)], l.steady == 0, np.array(l.twist))


def _restore(source, start, parameters):
    return Model(source, start=start, **parameters)


def _callback(function):
    """A function of the time as the library calls it; an exception stops the run."""

    @lib.eval_function
    def evaluate(_context, t, _x, value, _gradient):
        try:
            result = function(t)
            for i, x in enumerate(result if isinstance(result, (tuple, list)) else (result, float("nan"), float("nan"))):
                value[i] = x
            return 0
        except Exception:  # noqa: BLE001: nothing may pass through C
            import traceback
            traceback.print_exc()
            return 1

    return evaluate


def describe(name="model", *, about="", bodies=(), elements=(), parameters=(), let=None, run=None, **model) -> Model:
    """A model described in Python, with the words of text models.

    Parameters
    ----------
    name : str
    bodies, elements, parameters : list of dict
        As in a text model: ``{"name": "sleigh", "mass": 1, "inertia": 0.5}``, ``{"wheel": "edge", "body": "sleigh",
        "at": [-0.25, 0]}``.  Numbers may be expressions; a signal may be a Python function of the time.
    let, run : dict, optional
        Definitions and default run settings, as in a text model.
    **model
        Parameters and keywords of :class:`Model`.

    Examples
    --------
    >>> sleigh = pw.describe(bodies=[{"name": "sleigh", "mass": 1, "inertia": 0.5}],
    ...                      elements=[{"wheel": "edge", "body": "sleigh", "at": [-0.25, 0]},
    ...                                {"torque": "motor", "body": ["sleigh", "ground"], "value": lambda t: math.sin(t)}])
    """
    signals, plain = dict(model.pop("signals", None) or {}), []
    for element in elements:
        kind = next(iter(element))
        signals.update({f"{element[kind]}.{field}": value for field, value in element.items() if callable(value)})
        plain.append({field: 0 if callable(value) else value for field, value in element.items()})
    head = {"pinwheel": 1, "about": about, "run": run, "parameters": list(parameters), "let": let}
    lines = [f"{key}: {json.dumps(value)}" for key, value in head.items() if value]
    for key, entries in (("bodies", bodies), ("elements", plain)):
        lines += [f"{key}:"] + [f"  - {json.dumps(entry, default=float)}" for entry in entries] if entries else []
    folder = tempfile.TemporaryDirectory(prefix="pinwheel-")
    path = pathlib.Path(folder.name) / f"{name}.yaml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = Model(path, signals=signals, **model)
    made._folder = folder
    return made
