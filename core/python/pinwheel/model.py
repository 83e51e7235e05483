"""Models: files, descriptions in Python, compiled systems."""

from __future__ import annotations

import contextlib
import ctypes as c
import functools
import json
import math
import multiprocessing.util
import operator
import os
import pathlib
import shutil
import tempfile
import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _library as lib
from . import _program, studies
from .ensemble import columns
from .results import Result, _nearest
from .simulation import Simulation, specialised, warn_of_unused


class _System(lib.Handle):
    """A compiled system, which simulations share.

    needed: C objects to which it refers; signals: functions; inputs: initial values of the signals that are set between
    steps; in_python: whether there are functions in Python.
    """

    _compiling = threading.RLock()  # one specialised code at a time; a function of a signal may run other models

    def __init__(self, pointer, needed, signals, inputs, in_python):
        super().__init__(pointer, lib.core.pw_system_free, *needed)
        self.model = needed[-1].pointer
        self._signals, self.inputs, self.in_python = signals, inputs, in_python
        self._code = self._lanes = lib.Handle(None, lib.files.pw_scene_code_close)
        self._code_tried, self.no_code = False, ""

    def code(self) -> int | None:
        """Specialised code, compiled or from the cache; None, with the reason in no_code, if there cannot be any."""
        with self._compiling:
            if not self._code_tried:
                try:
                    self._code = self._built(lib.files.pw_scene_code_open)
                except lib.Error as failure:
                    self.no_code = str(failure)
                self._code_tried = True
        return lib.files.pw_scene_code_table(self._code.pointer)

    def lanes(self) -> int | None:
        """Code that advances several runs at once; None if there cannot be any, or it would not be faster."""
        count = lib.files.pw_processor_lanes()
        with self._compiling:
            if count > 1 and self.code() and self._lanes.pointer is None and lib.core.pw_system_has_lanes(self.pointer):
                with contextlib.suppress(lib.Error):
                    self._lanes = self._built(lib.files.pw_scene_lanes_open, count)
        return lib.files.pw_scene_code_lanes(self._lanes.pointer)

    def _built(self, function, *arguments):
        """The code that a function of the library makes from the text."""
        text, error = self._source(), lib.pw_error()
        code = lib.Handle(function(text, self.pointer, *arguments, c.byref(error)), lib.files.pw_scene_code_close)
        lib.free(text)
        lib.check(error)
        return code

    def _source(self):
        """The text of the code for the independent constraint equations, which a run selects."""
        try:
            run = self.call(lib.core.pw_run_open, self.pointer, b"rk4+none", None)
        except lib.Error:
            return self.call(lib.core.pw_system_source, self.pointer, None)
        try:
            return self.call(lib.core.pw_run_source, run)
        finally:
            lib.core.pw_run_close(run)

    def has_columns_of(self, other: _System, ledger) -> bool:
        """Whether results of both have the same columns."""
        return self is other or bool(lib.core.pw_system_record_same(self.pointer, other.pointer, bool(ledger)))

    def call(self, function, *arguments):
        """The result of a function of the library that evaluates the system, whose last argument is an error."""
        error = lib.pw_error()
        if self.in_python:
            with lib.Call() as call:
                result = function(*arguments, c.byref(error))
            check = call.check
        else:
            result, check = function(*arguments, c.byref(error)), lib.check
        try:
            check(error)
        except BaseException:
            if function is lib.core.pw_run_open:
                lib.core.pw_run_close(result)
            raise
        return result


# Functions that delete folders, with the next description or at the end of the process, if it has made them and not a
# parent that it is a copy of.
_unused_folders: list = []


class _Described:
    """The text of a model described in Python, as a file that exists as long as this object; str() is its path."""

    __del__ = property(operator.attrgetter("_delete"))  # as that of lib.Handle

    def __init__(self, name: str, text: str):
        if not isinstance(name, str) or not name or len(name) > 50 or set(name) & set("/\\\0"):
            raise lib.InputError(f"describe: name = {name!r:.60}: expected at most 50 characters, without / and \\")
        with contextlib.suppress(IndexError):
            while True:
                _unused_folders.pop()()
        self._name, self._text, folder = name, text, tempfile.mkdtemp(prefix="pinwheel-")
        delete = multiprocessing.util.Finalize(None, shutil.rmtree, (folder, True), exitpriority=0)
        self._delete = functools.partial(_unused_folders.append, delete)
        path = pathlib.Path(folder) / f"{name}.yaml"
        path.write_text(text, encoding="utf-8")
        self._path = str(path)

    def __str__(self):
        return self._path

    def __reduce__(self):
        return _Described, (self._name, self._text)


@dataclass(frozen=True)
class Linear:
    """A linearisation x' = A x + B u in minimal coordinates x [m], positions first, in a frame that moves with the motion.

    Attributes
    ----------
    A : ndarray, shape (n, n)
        [1/s]
    B : ndarray, shape (n, inputs)
        [m/s] per unit of each input u; columns of signals of constraints are NaN.
    eigenvalues : ndarray of complex, shape (n,)
        [1/s], the fastest growing first.
    basis : ndarray, shape (states, n)
        Perturbations of the states, one column for each coordinate x = 1 m.
    inputs, states : list of str
        Names of the signals and of the states.
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


_TOO_MANY = "too many coordinates to linearise: raise `most`"


class Feedback:
    """A signal that is a function of the time and of states: ``pw.Feedback(lambda t, x: -0.5 * x[0], ["steer.phi"])``.

    It is called at every stage of every step; a signal of a text model that is an expression of the states is faster.

    Parameters
    ----------
    function : callable
        ``f(t, x)`` of the time [s] and the list of the states named in reads; returns a number.  Of a velocity constraint it
        may return the value, its partial derivative by the time, and any third number; the derivative of a number is found by
        differences.
    reads : sequence of str
        States: of velocity constraints positions and first-order states, of forces any.
    gradient : callable, optional
        ``g(t, x)`` returns the derivatives by x; by default, they are found by differences, with errors of about 1e-9.
    """

    def __init__(self, function: Callable, reads, gradient: Callable | None = None):
        if not callable(function) or not (gradient is None or callable(gradient)):
            raise lib.InputError(f"Feedback: expected functions of the time and the states, found {function!r:.60}")
        self.reads = [reads] if isinstance(reads, str) else list(reads)
        self.function, self.gradient = function, gradient

    def __call__(self, t, x):
        return self.function(t, x)

    def _value(self, t, x, name):
        """Acceleration, rate and value, the rate a partial derivative by the time."""
        found = self.function(t, x)
        if np.ndim(found):
            return _numbers_of(found, name)
        h = 6e-6 * max(1.0, abs(t))
        return 0.0, (self._number(t + h, x, name) - self._number(t - h, x, name)) / (2 * h), _numbers_of(found, name)[2]

    def _slopes(self, t, x, name):
        """The derivatives by x."""
        if self.gradient:
            found = np.ravel(np.asarray(self.gradient(t, x), float)).tolist()
            if len(found) != len(x):
                raise lib.InputError(f"signal {name}: expected a gradient of {len(x)} numbers, found {len(found)}")
            return found
        found = []
        for i, at in enumerate(x):
            h = 6e-6 * max(1.0, abs(at))
            found.append((self._number(t, [*x[:i], at + h, *x[i + 1:]], name) - self._number(t, [*x[:i], at - h, *x[i + 1:]], name)) / (2 * h))
        return found

    def _number(self, t, x, name):
        return _numbers_of(self.function(t, x), name)[2]


def models() -> dict:
    """Names of the models on the search path, and their files."""
    found, error = {}, lib.pw_error()

    @c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_char_p, c.c_char_p)
    def add(_, name, path):
        found[os.fsdecode(name)] = os.fsdecode(path)
        return 0

    with lib.Call() as call:
        lib.files.pw_file_list(add, None, c.byref(error))
    call.check(error)
    return found


class Model(studies.Analyses):
    """A model with values of its parameters.

    Parameters
    ----------
    model : str or path
        A name ("snakeboard"), or the path of a .yaml, .c or .so file.  Models in C are programs: open only files
        that you trust.
    start : dict, optional
        Initial values of states [m, rad, m/s, rad/s], such as ``{"frame.vx": 1}``.
    signals : dict, optional
        Functions of the time [s] that replace signals: ``{"rider": lambda t: 0.1 * math.cos(t)}``; of a constraint they
        return the value, its rate and its acceleration, which are compared at a few times, to 1 %.  The name is that of
        the element, or ELEMENT.FIELD.  Functions of states: :class:`Feedback`.
    **parameters : float or str
        Values of the model's parameters, in the units of :attr:`units`, or expressions such as ``"30*deg"``.

    Raises
    ------
    InputError
        For an unknown name, parameter, state or signal, with the nearest valid name; for a value that the model refuses;
        and for a function, of a constraint, whose rate or acceleration is not the derivative of its value.

    Attributes
    ----------
    name, about : str
    parameters, units : dict
        Values and units of all parameters.
    defaults : dict
        Method, t_end, step, rtol of the model; rtol None: the library's default.
    """

    _warns_of = staticmethod(lib.core.pw_initial_specified)  # whether a run warns of a changed initial value

    _warns_of_unused = True  # whether a run warns of settings without effect

    def __init__(self, model, *, start: dict | None = None, signals: dict[str, Callable] | None = None, **parameters):
        self._origin = model if isinstance(model, _Described) else str(model)  # keeps the file of a described model
        self.source = str(model)
        self.start, self.signals = lib.numbers(start or {}, "start"), _functions(signals or {})
        error = lib.pw_error()
        pointer = lib.files.pw_file_open(lib.encode(self.source, "model"), c.byref(error))
        lib.check(error)
        self._file = lib.Handle(pointer, lib.files.pw_file_close)
        table = lib.files.pw_file_table(pointer).contents
        self.name, self.about = lib.text(lib.files.pw_file_name(pointer)), lib.text(table.about)
        self.defaults: dict[str, Any] = {"method": lib.text(table.run__method) or "rk4+projection", "t_end": table.run__t_end or 10.0,
                         "step": table.run__step or 1e-3, "rtol": table.run__rtol or None}
        listed = list(lib.listed(lib.pw_parameter, table.parameters))
        self.parameters = {p.name.decode(): p.value for p in listed}
        self.units = {p.name.decode(): lib.text(p.unit) for p in listed}
        self._given: dict[str, float] = {}
        self._set(parameters)

    def _set(self, parameters):
        """Sets parameters and compiles."""
        for name in self.start:
            if name in self.parameters:
                raise lib.InputError(f"start: {name} is a parameter of model {self.name}, expected a state; pass {name}=VALUE")
        for name, value in parameters.items():
            if name not in self.parameters and "." in name:
                raise lib.InputError(f"{name!r}: expected a parameter; initial values of states are given by start={{...}}")
            if name not in self.parameters:
                raise lib.InputError(f"model {self.name} has no parameter {name!r}{_nearest(name, self.parameters)}")
            self.parameters[name] = self._given[name] = lib.number(value, name)
        self._compiled: dict[tuple, _System] = {}  # by inputs
        self._compile()  # refuses what is wrong

    def __repr__(self):
        changed = "".join(f", {name}={value:g}" for name, value in self._given.items())
        return f"<Model {self.name}{changed}: {self.about}>"

    def _repr_html_(self) -> str:
        """In notebooks: the page that simulates the model."""
        return _program.interactive(self)

    def __reduce__(self):
        if self.signals:
            raise TypeError("a model with functions as signals cannot be sent to other processes")
        return functools.partial(Model, self._origin, start=self.start, **self._given), ()

    def __copy__(self) -> Model:
        return self.replace()

    def __deepcopy__(self, _) -> Model:
        return self.replace()

    def replace(self, *, start: dict | None = None, **parameters) -> Model:
        """The same model with other parameters or initial values.

        Parameters
        ----------
        start : dict, optional
            Initial values of states [m, rad, m/s, rad/s]; the others stay.
        **parameters : float or str
            Values of parameters; the others stay.
        """
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.__dict__.pop("_columns", None)
        other.start = {**self.start, **lib.numbers(start or {}, "start")}
        other.parameters, other._given = dict(self.parameters), dict(self._given)
        other._set(parameters)
        return other

    # ---- Compiling ----

    def _compile(self, inputs=None) -> _System:
        """The compiled system.  inputs: initial values of the signals that are set between steps, by name."""
        inputs = lib.numbers(inputs or {}, "inputs")
        if system := self._compiled.get(tuple(inputs.items())):
            return system
        if len(self._compiled) > 7:
            self._compiled.clear()
        error, keep = lib.pw_error(), []
        model = lib.Handle(lib.files.pw_file_model(self._file.pointer, c.byref(error)), lib.core.pw_model_free)
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
            feedback = function if isinstance(function, Feedback) else None
            keep.append(_callback(name, function) if feedback is None else _feedback_callback(name, feedback))
            signal = lib.pw_signal(type=lib.PW_FUNCTION, function__eval=c.cast(keep[-1], c.c_void_p).value)
            if feedback:
                keep.append((c.c_char_p * (len(feedback.reads) + 1))(*[lib.encode(name, "reads") for name in feedback.reads], None))
                signal.function__reads = c.addressof(keep[-1])
            self._set_signal(model, name, signal)
            if feedback is None and self.signals.checked.get(name) is not function:
                call, count = lib.Call(), _derivatives(model.pointer, name.partition(".")[0])
                call.passing(_check_derivatives, name, function, count, self.defaults["t_end"], call)
                self.signals.checked[name] = function
        for name, value in inputs.items():
            self._set_signal(model, name, lib.pw_constant(type=lib.PW_HARMONIC, harmonic__offset=value))
        pointer = lib.core.pw_system_compile(model.pointer, c.byref(error))
        lib.check(error)
        in_python = any(name not in inputs for name in self.signals)
        system = self._compiled[tuple(inputs.items())] = _System(pointer, (self._file, model), keep, inputs, in_python)
        return system

    @staticmethod
    def _set_signal(model, name, signal):
        """Replaces a signal.  name: ELEMENT or ELEMENT.FIELD."""
        error, (element, _, field) = lib.pw_error(), name.partition(".")
        as_signal = c.cast(c.byref(signal), c.POINTER(lib.pw_signal))
        lib.core.pw_model_set_signal(model.pointer, element.encode(), (field or "value").encode(), as_signal, c.byref(error))
        lib.check(error)

    # ---- Contents ----

    @property
    def bodies(self) -> dict:
        """Names of the bodies: mass [kg] and inertia [kg m^2] of each."""
        s = self._compile().pointer
        mass, count = lib.core.pw_system_mass(s), lib.core.pw_system_bodies(s)
        return {lib.text(lib.core.pw_system_body_name(s, i)): {"mass": mass[3 * i], "inertia": mass[3 * i + 2]} for i in range(count)}

    @property
    def elements(self) -> dict:
        """Names of the elements: the type of each."""
        count = c.c_int()
        elements = lib.core.pw_model_elements(self._compile().model, c.byref(count))
        return {lib.text(e.definition[0]): lib.text(e.kind.contents.name) for e in elements[:count.value]}

    @property
    def states(self) -> dict:
        """Names of coordinates, velocities and first-order states: their units."""
        units, groups = self._columns
        return {name: units[name] for name in groups["states"]}

    @property
    def inputs(self) -> dict:
        """Signals that a simulation may set (``open(inputs=...)``) or a function replace (``signals``): their units."""
        s, core = self._compile().pointer, lib.core
        return {lib.name_of(core.pw_system_signal_name, s, i): lib.text(core.pw_system_signal_unit(s, i)) for i in range(core.pw_system_signals(s))}

    @property
    def outputs(self) -> dict:
        """Outputs of the model: their units."""
        units, groups = self._columns
        return {name: units[name] for name in groups["outputs"]}

    @property
    def columns(self) -> dict:
        """All columns of results, with the ledger: their units."""
        return dict(self._columns[0])

    @functools.cached_property
    def _columns(self):
        return columns(self._compile().pointer, True)

    # ---- Running ----

    def open(self, method: str | None = None, *, t_end: float | None = None, step: float | None = None,
             rtol: float | None = None, atol: float | None = None, max_steps: int | None = None, energy: bool = False,
             inputs: dict[str, float] | None = None, specialise: str = "auto") -> Simulation:
        """Opens a run that the caller advances.

        Parameters
        ----------
        method : str, optional
            Integrator and stabilisation, "erk8+projection"; default: the model's.
        t_end : float, optional
            Expected final time [s], from which only the time scale of a scene at rest is estimated.
        step : float, optional
            Step size of fixed-step methods [s]; default: the model's.
        rtol, atol : float, optional
            Relative tolerance of adaptive methods (default: the model's), absolute tolerance of every state (default:
            rtol times its scale).
        max_steps : int, optional
            Largest number of attempted steps of adaptive methods, 1e7 by default.
        energy : bool
            Whether samples contain work and losses by element.
        inputs : dict, optional
            Signals that the caller sets between steps, and their initial values: ``{"rider": 0.0}``.
        specialise : {"auto", "always", "never"}
            Use code compiled for this model alone, if possible: from 1e6 expected steps on, as the program does;
            always; never.  ``statistics["specialised"]`` counts its evaluations.

        Returns
        -------
        Simulation

        Raises
        ------
        InputError, InitialError, MethodError
        """
        return Simulation(self, *self._prepare(1, 4, method, t_end, step, rtol, atol, max_steps, energy, inputs, specialise))

    def _prepare(self, runs, stacklevel, method=None, t_end=None, step=None, rtol=None, atol=None, max_steps=None, energy=False,
                 inputs=None, specialise="auto"):
        """System, method, settings in C, and those that were given, of a number of runs with the arguments of `open`."""
        settings = lib.pw_settings()
        numbers = {"span": t_end, "step": step, "rtol": rtol, "atol": atol, "max_steps": max_steps}
        for name, value in numbers.items():
            setattr(settings, name, self._setting(name, value))
        settings.ledger = bool(energy)
        given = {name: getattr(settings, name) for name, value in numbers.items() if value is not None and name != "span"}
        given |= {"energy": True} if energy else {}
        given |= {"specialise": specialise} if specialise != "auto" else {}
        given |= {"inputs": lib.numbers(inputs, "inputs")} if inputs else {}
        method = self.defaults["method"] if method is None else method
        steps = runs * lib.core.pw_method_steps(lib.encode(method, "method"), c.byref(settings), self.defaults["step"], settings.span)
        system = self._compile(inputs)
        if self._warns_of_unused:
            warn_of_unused(method, given, stacklevel)
        if specialised(specialise, steps):
            settings.specialised = system.code()
            if system.no_code and self._warns_of_unused:
                warnings.warn(f"general engine: {system.no_code}", stacklevel=stacklevel)
        return system, method, settings, given

    def _setting(self, name, value):
        """A setting by its name in C, as a number; the model's default for None, 0 if it has none."""
        if value is None:
            return self.defaults.get("t_end" if name == "span" else name) or 0
        value = lib.number(value, "t_end" if name == "span" else name, above=0)
        if name == "max_steps" and (value != int(value) or value > 2**53):
            raise lib.InputError(f"max_steps = {value:g}: expected a whole number from 1 to 2^53")
        return int(value) if name == "max_steps" else value

    def run(self, method: str | None = None, *, t_end: float | None = None, every: float | None = None, times=None,
            start: dict | None = None, progress: Callable[[float], object] | bool | None = None, error: bool = False,
            until: str | None = None, **settings) -> Result:
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
            Increasing times of samples [s], at most t_end; the run ends at the last one.
        start : dict, optional
            Initial values of states [m, rad, m/s, rad/s].
        progress : callable or bool, optional
            Called now and then with the fraction done; True: a progress bar, False: none; default: a bar in notebooks.
        error : bool
            Repeat the run with a tenth of the tolerance or half the step, and state its errors: ``result.error``.
        until : str, optional
            A condition on columns, "car.x > 10", at whose instant the run ends: the last sample.
        **settings
            step, rtol, atol, max_steps, energy, inputs, specialise: see :meth:`open`.

        Returns
        -------
        Result

        Raises
        ------
        InputError, InitialError, MethodError
        Exception
            What functions in Python and handlers of signals raise, with the samples in its attribute ``result``: see
            :meth:`Simulation.record`.
        """
        if until is not None and error:
            raise lib.InputError("error compares complete runs: it cannot be given together with until")
        model = self.replace(start=start) if start else self
        end = self.defaults["t_end"] if t_end is None else lib.number(t_end, "t_end")
        with model.open(method, t_end=end or None, **settings) as simulation:
            result = simulation.record(end, every, times, progress, until)
            if error and result.status == "ok":
                simulation._state_error(result)
            return result

    # ---- Analyses ----

    def linearise(self, at: float = 0.0, most: int = 200, *, steady: bool = False, hold: dict | None = None) -> Linear:
        """Linearises the equations of motion in the frame that moves with the motion.

        Parameters
        ----------
        at : float
            Time of a run with the model's method [s]; of a steady motion, that at which signals are evaluated.
        most : int
            Refuse models with more minimal coordinates.
        steady : bool
            Linearise at the steady motion that is reached from the initial state, by the program.
        hold : dict, optional
            Values of states, or of BODY.speed, .radius or .curvature, that this motion has.

        Returns
        -------
        Linear

        Raises
        ------
        InputError, InitialError, MethodError
        """
        at, most = lib.number(at, "at"), int(lib.number(most, "most", above=0))
        if not 0 <= at < math.inf:
            raise lib.InputError(f"at = {at!r}: expected a time >= 0")
        if steady or hold:
            return self._linear_steady(studies.command("linearise", self, at=at, steady=True, hold=hold), most)
        with self.open(t_end=at or None) as simulation:
            if at:
                simulation.advance(at)
            linear, system = lib.pw_linear(), simulation._system
            try:
                with simulation._used() as run:
                    system.call(lib.core.pw_run_linear_modes, run, min(most, 2**31 - 1), c.byref(linear))
                return self._linear(linear, system.pointer)
            finally:
                lib.core.pw_linear_free(c.byref(linear))

    sweep = studies.sweep

    def _linear_steady(self, found, most) -> Linear:
        """The JSON of the program's command as a Linear."""
        A, inputs, states = np.array(found["A"]), list(self.inputs), list(self.states)
        if len(A) > most:
            raise lib.InputError(_TOO_MANY)
        B = np.full((len(A), len(inputs)), np.nan)
        B[:, [inputs.index(u["name"]) for u in found["inputs"]]] = np.array(found["B"]).reshape(len(A), -1)
        return Linear(A, B, np.array([complex(x["re"], x["im"]) for x in found["eigenvalues"]]), np.array(found["C"]), inputs, states,
                      found["motion"] == "steady", np.array(found["twist"]))

    def _linear(self, linear, system) -> Linear:
        """The library's linearisation as a Linear."""
        if not linear.A:
            raise lib.InputError(_TOO_MANY)
        n, rows, inputs = linear.unknowns, 2 * lib.core.pw_system_coordinates(system), list(self.inputs)
        shown = [i for i in range(rows) if not lib.core.pw_system_state_hidden(system, i)]

        def matrix(pointer, rows, columns):
            return np.ctypeslib.as_array(pointer, (rows, columns)).copy() if rows * columns else np.zeros((rows, columns))

        return Linear(matrix(linear.A, n, n), matrix(linear.B, n, len(inputs)),
                      np.array([complex(linear.re[i], linear.im[i]) for i in range(n)]), matrix(linear.basis, rows, n)[shown], inputs,
                      list(self.states), linear.steady == lib.PW_STEADY, np.array(linear.twist))


@functools.wraps(studies.sweep, assigned=["__doc__"])  # with its own module, by which it is pickled
def sweep(model, *arguments, **settings):
    return studies.sweep(model if isinstance(model, Model) else Model(model), *arguments, **settings)


class _Signals(dict):
    """Functions by name, and those whose derivatives have been checked."""

    def __init__(self, signals):
        super().__init__(signals)
        self.checked = dict(getattr(signals, "checked", {}))


def _functions(signals):
    """Functions by name."""
    if not hasattr(signals, "items"):
        raise lib.InputError(f"signals: expected a dict of functions by name, found {signals!r:.60}")
    for name, function in signals.items():
        lib.encode(name, "signals")
        if not callable(function):
            raise lib.InputError(f"signal {name}: expected a function of the time, found {function!r:.60}")
    return _Signals(signals)


def _derivatives(model, element):
    """The number of derivatives of its signals that an element of a built model needs."""
    count = c.c_int()
    elements = lib.core.pw_model_elements(model, c.byref(count))
    kind = next(e.kind.contents for e in elements[:count.value] if e.definition[0] == element.encode())
    return 0 if kind.force_u else {lib.PW_HOLONOMIC: 2, lib.PW_NONHOLONOMIC: 1}.get(kind.level, 0)


def _check_derivatives(name, function, count, t_end, call):
    """Refuses a function of a constraint if one of its first `count` derivatives is not the derivative of the one before it.

    It is compared at a few times before t_end with central differences of many widths, one of which must agree within 1 %:
    the function may interpolate.  call: the lib.Call during which it is called.
    """
    def returned(t):
        return _numbers_of(function(t), name)[::-1]

    widths = min(1, t_end / 10) * 0.5 ** np.arange(4, 24)  # [s]
    for i in range(1, count + 1):
        found, size = [], 0.0
        for t in (0.03137 * t_end, 0.17321 * t_end, 0.41231 * t_end):  # arbitrary, hardly a point of a table
            try:
                value, given = returned(t)[i - 1:i + 1]
                slopes = [(returned(t + h)[i - 1] - returned(t - h)[i - 1]) / (2 * h) for h in widths]
                slope = min(slopes, key=lambda x: abs(x - given))
                if math.isfinite(given + slope):
                    found.append((t, given, slope))
                    size = max(size, abs(given) + abs(slope) + 1e-6 * abs(value))
            except Exception:  # noqa: BLE001: it ends the run, if that gets there
                if call.failure:
                    raise
                continue
        for t, given, slope in found:
            if abs(given - slope) > 0.01 * size:
                what = ("rate", "acceleration")[i - 1]
                raise lib.InputError(f"signal {name}: the {what} at t = {t:.5g} s is {given:.6g}, but the derivative is {slope:.4g}")


def _guarded(compute):
    """The function of a signal as the library calls it, within a lib.Call: compute(t, x, value, gradient) in Python."""

    @lib.eval_function
    def evaluate(_context, t, x, value, gradient):
        call = lib.thread.call
        try:
            if call.failure is None:
                call.inside = True
                compute(call, t, x, value, gradient)
        except BaseException as failure:  # noqa: BLE001: nothing may pass through C
            call.inside, lib.thread.call = False, call
            if call.failure is None:
                call.failure, call.of_function = failure, True
        lib.thread.call = call  # also if it has run models of its own, and these were interrupted
        return call.failure is not None

    return evaluate


def _callback(name, function):
    """The callback of a function of the time."""
    def compute(call, t, _x, value, _gradient):
        result = function(t)
        call.inside = False
        # the value last: without one, C has a failure
        value[2], value[1], value[0] = (math.nan, math.nan, result) if result.__class__ is float else _numbers_of(result, name)

    return _guarded(compute)


def _feedback_callback(name, feedback):
    """The callback of a function of time and states."""
    count = len(feedback.reads)

    def compute(call, t, x, value, gradient):
        states = x[:count]
        slopes = feedback._slopes(t, states, name) if gradient else []
        found = feedback._value(t, states, name)
        call.inside = False
        for i, slope in enumerate(slopes):
            gradient[i] = slope
        value[2], value[1], value[0] = found

    return _guarded(compute)


def _numbers_of(result, name):
    """Acceleration, rate and value that a signal has returned; NaN: not given."""
    expected = f"signal {name}: expected a number, or value, rate and acceleration"
    try:
        is_number = not hasattr(result, "__len__") or getattr(result, "shape", None) == ()
        found = [float(result)] if is_number else [float(result[i]) for i in range(len(result))]
    except (TypeError, ValueError, LookupError) as failure:
        raise lib.InputError(f"{expected}: {failure}") from failure
    if len(found) not in (1, 3):
        raise lib.InputError(f"{expected}, found {len(found)} numbers")
    return found[::-1] if len(found) == 3 else (math.nan, math.nan, found[0])


def describe(name: str = "model", *, about: str = "", bodies=(), elements=(), parameters=(), let: dict | None = None,
             run: dict | None = None, outputs=(), paths=(), **model) -> Model:
    """A model described in Python, with the keywords of text models.

    Parameters
    ----------
    name : str
        Name of the model, at most 50 characters.
    about : str
        One line: what the model is.
    bodies : list of Body or dict
        ``{"name": "sleigh", "mass": 1, "inertia": 0.5}``; see :class:`Body`.  Numbers may be expressions of parameters.
    elements : list of Element or dict
        ``pw.Wheel("edge", body="sleigh", at=[-0.25, 0])`` or ``{"wheel": "edge", "body": "sleigh", "at": [-0.25, 0]}``.
        A signal may be a Python function of the time.  First-order states are among them: ``pw.State("z", rate="1 - z")``.
    parameters : list of dict
        ``{"name": "a", "value": 0.25, "unit": "m"}``.
    let, run : dict, optional
        Definitions and default run settings, as in a text model.
    outputs : list of dict
        Named functions of columns: ``{"name": "offset", "value": "car.y - sin (car.x)", "unit": "m"}``.
    paths : list of dict
        Curves whose functions expressions use: ``{"name": "road", "points": [[0, 0], [9, 0]]}``; points may be an array.
    **model
        Parameters and keywords of :class:`Model`.

    Returns
    -------
    Model

    Raises
    ------
    InputError
        With the line of the text model that is wrong, or as :class:`Model` does.

    Examples
    --------
    >>> sleigh = pw.describe(bodies=[pw.Body("sleigh", mass=1, inertia=0.5)],
    ...                      elements=[pw.Wheel("edge", body="sleigh", at=[-0.25, 0]),
    ...                                pw.Torque("motor", body=["sleigh", "ground"], value=lambda t: math.sin(t))])
    """
    signals, plain, states = _functions(model.pop("signals", None) or {}), [], []
    for element in _entries(elements, "elements"):
        kind = next(iter(element))
        signals.update({f"{element[kind]}.{field}": value for field, value in element.items() if callable(value)})
        fields = {field: 0 if callable(value) else value for field, value in element.items()}
        if kind == "state":
            states.append({"name": fields.pop("state"), **fields})
        else:
            plain.append(fields)
    head = {"about": about, "run": run, "parameters": _entries(parameters, "parameters"), "let": let}
    lines = ["pinwheel: 1"] + [f"{key}: {_json(value)}" for key, value in head.items() if value]
    for key, entries in (("paths", _entries(paths, "paths")), ("bodies", _entries(bodies, "bodies")), ("elements", plain),
                         ("states", states), ("outputs", _entries(outputs, "outputs"))):
        lines += [f"{key}:"] + [f"  - {_json(entry)}" for entry in entries] if entries else []
    return Model(_Described(name, "\n".join(lines) + "\n"), signals=signals, **model)


def _entries(given, what):
    """A list of dicts, made from one or several."""
    entries = [given] if isinstance(given, (str, dict)) else list(given) if np.iterable(given) else [given]
    for entry in entries:
        if not isinstance(entry, dict) or not entry:
            raise lib.InputError(f"{what}: expected a list of dicts, found {entry!r:.60}")
    return entries


def _json(value):
    """JSON, which is YAML of one line."""
    def convert(x):
        if isinstance(x, np.ndarray):
            return x.tolist()
        return lib.number(x, "a value of the description")
    try:
        return json.dumps(value, default=convert)
    except (TypeError, ValueError, RecursionError) as failure:
        raise lib.InputError(f"the description cannot be written as text: {failure}") from None
