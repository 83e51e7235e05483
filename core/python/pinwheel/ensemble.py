"""Runs that are stepped together: the arrays of ``pw_ensemble`` in C."""

from __future__ import annotations

import ctypes as c
import functools

import numpy as np

from . import _library as lib
from .results import _nearest


def columns(s, ledger) -> tuple[dict, dict]:
    """Of a compiled system: units of all columns by name, in their order; names of columns by group, as in :class:`Result`."""
    core, width = lib.core, lib.core.pw_system_record_width(s, bool(ledger))
    names = [lib.name_of(core.pw_system_record_name, s, i) for i in range(width)]
    n = core.pw_system_coordinates(s)
    reactions = lib.PW_RECORD_STATES + 3 * n + 2 * core.pw_system_contacts(s)
    outputs = reactions + core.pw_system_rows(s)
    entries = outputs + core.pw_system_outputs(s)
    states = [names[lib.PW_RECORD_STATES + i] for i in range(2 * n) if not core.pw_system_state_hidden(s, i)]
    groups = {"states": states, "reactions": names[reactions:outputs], "outputs": names[outputs:entries],
              "ledger": names[entries:]}
    units = {name: lib.text(core.pw_system_record_unit(s, i)) for i, name in enumerate(names)}
    return units, groups


def _address(array):
    return array.ctypes.data if array.size else None


class Ensemble:
    """The runs of one method, of systems of the same structure; arrays that the library reads and writes.

    systems: one for each run, with the same columns.  input: shape (runs, inputs), the values that the next step sets; status: of each run, 0 or why it waits.
    """

    def __init__(self, systems, method, settings, threads=1, lanes=None):
        count, s = len(systems), systems[0]
        self._systems, self._method, self._settings = systems, lib.encode(method, "method"), settings
        self._in_python = any(system.in_python for system in systems)
        self.columns, self._plans = columns(s.pointer, settings.ledger), {}
        self._column = {name: i for i, name in enumerate(self.columns[0])}
        self.states = self.columns[1]["states"]
        self.number = {name: self._column[name] - lib.PW_RECORD_STATES for name in self.states}
        names = list(s.inputs)
        self._signals = np.array([self._signal(s, name) for name in names], np.int32)
        self.input = np.empty((count, len(names)))
        self.input[:] = list(s.inputs.values())
        self._runs, self._handles = (c.c_void_p * count)(), [None] * count
        self._status, self._errors = (c.c_int * count)(), (lib.pw_error * count)()
        self.status = np.frombuffer(self._status, np.int32)
        self.started: list = [({}, 0.0)] * count  # states, by number, and times with which the runs were opened
        self._c = lib.pw_ensemble(
            run=c.addressof(self._runs), count=count, threads=1 if self._in_python else threads, inputs=len(names),
            signal=_address(self._signals), input=_address(self.input), status=c.addressof(self._status),
            error=c.addressof(self._errors), lanes=lanes)
        if not self._in_python:  # no instructions of Python but the call
            self.step = functools.partial(lib.core.pw_ensemble_step, c.addressof(self._c))  # type: ignore[method-assign]

    @staticmethod
    def _signal(system, name):
        number, error = -1, lib.pw_error()
        for wanted in (name, f"{name}.value"):  # an element with one signal has its name
            if number < 0:
                error = lib.pw_error()
                number = lib.core.pw_system_find_signal(system.pointer, wanted.encode(), c.byref(error))
        lib.check(error)
        return number

    def open(self, i, start=None, t=0.0):
        """Opens run i anew, with these values of states, by number, and initial time; a refused one leaves the former."""
        start, settings = start or {}, self._settings
        values = (lib.pw_initial_value * len(start))(*[lib.pw_initial_value(state=i, value=x) for i, x in start.items()])
        settings.t, settings.initial, settings.initials = t, c.addressof(values), len(start)
        system = self._systems[i]
        code = settings.specialised
        if code and not lib.core.pw_specialised_fits(code, system.pointer):
            settings.specialised = None
        try:
            run = system.call(lib.core.pw_run_open, system.pointer, self._method, c.byref(settings))
        finally:
            settings.specialised = code
        return self.put(i, lib.Handle(run, lib.core.pw_run_close, system), (start, t))

    def put(self, i, run, started):
        """Makes an opened run, or None, run i."""
        self._runs[i], self._handles[i], self.started[i] = run and run.pointer, run, started
        self.clear(i)
        return run

    def close(self, i):
        self.put(i, None, ({}, 0.0))

    def numbers(self, state) -> dict:
        """Values of states, a dict by name or an array over `states`, by their numbers."""
        if state is None:
            return {}
        if hasattr(state, "items"):
            for name in state:
                if name not in self.number:
                    error = lib.pw_error()
                    lib.core.pw_system_find_state(self._systems[0].pointer, lib.encode(name, "state"), c.byref(error))
                    lib.check(error)
                    raise lib.InputError(f"{name!r:.60} cannot be set")
            return {self.number[name]: lib.number(value, name) for name, value in state.items()}
        return dict(zip(self.number.values(), array(state, (len(self.states),), "state").tolist()))

    def step(self, dt):
        self._call(lib.core.pw_ensemble_step, c.addressof(self._c), dt)

    def plan(self, names):
        """Observes columns: a function that stores them, and the array, of shape (runs, columns), in which it does."""
        key = names if names.__class__ is tuple else (names,) if isinstance(names, str) else tuple(names)
        if key not in self._plans:
            for name in key:
                if name not in self._column:
                    raise KeyError(f"no column {name!r:.60}{_nearest(name, self._column)}")
            index, out = np.array([self._column[name] for name in key], np.int32), np.empty((len(self._runs), len(key)))
            own = lib.pw_ensemble.from_buffer_copy(self._c)
            own.columns, own.column, own.observed = len(key), _address(index), _address(out)
            call = functools.partial(self._call, lib.core.pw_ensemble_observe) if self._in_python else lib.core.pw_ensemble_observe
            self._plans[key] = functools.partial(call, c.addressof(own)), out, (own, index)
        return self._plans[key]

    def _call(self, function, *arguments):
        """A call during which the library calls functions in Python; what they raise passes."""
        with lib.Call() as call:
            function(*arguments)
        if call.failure:
            failed = int(np.flatnonzero(self.status)[0]) if self.status.any() else 0
            error = lib.pw_error.from_buffer_copy(self._errors[failed])
            self.clear(failed)
            call.check(error)

    def error(self, i) -> str:
        """Why run i waits; "" if it does not."""
        return lib.text(self._errors[i].text) or "the method gave up" if self._status[i] else ""

    def clear(self, i):
        self._status[i], self._errors[i].status, self._errors[i].text = 0, 0, b""

    def check(self, i):
        """Raises the error of run i, which then continues."""
        if not self._status[i]:
            return
        error = lib.pw_error.from_buffer_copy(self._errors[i])
        reason = self.error(i)
        self.clear(i)
        lib.check(error)
        raise lib.MethodError(reason)


def array(values, shape, what) -> np.ndarray:
    """The values as an array of this shape."""
    try:
        made = np.asarray(values, float)
    except (TypeError, ValueError) as failure:
        raise lib.InputError(f"{what}: expected numbers: {failure}") from None
    if made.shape != shape:
        raise lib.InputError(f"{what}: expected shape {shape}, found {made.shape}")
    return made


def duration(dt, default) -> float:
    """A step of a caller; its sign is checked in C."""
    return default if dt is None else dt if dt.__class__ is float else lib.number(dt, "dt")
