"""Open runs: recorded as a whole, or advanced by the caller."""

from __future__ import annotations

import contextlib
import ctypes as c
import json
import os
import threading
import time
import warnings
from collections.abc import Callable, Iterator, MutableMapping
from typing import Any

import numpy as np

from . import _library as lib
from ._progress import watched
from .ensemble import Ensemble, array, duration
from .results import Result, _nearest

_IN_USE = "the run is in use, by another thread or by the function that called this one"
_MEMORY = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")  # of the machine [bytes]


class Inputs(MutableMapping):
    """Values of the signals that the user of a simulation sets, by name; no names can be added or removed."""

    def __init__(self, names: list, values: np.ndarray):
        self._index, self._values = {name: i for i, name in enumerate(names)}, values

    def __getitem__(self, name: str) -> float:
        return float(self._values[self._at(name)])

    def __setitem__(self, name: str, value: float) -> None:
        self._values[self._at(name)] = _finite(value, f"input {name}")

    def __delitem__(self, name):
        raise TypeError("inputs cannot be removed")

    def __iter__(self):
        return iter(self._index)

    def __len__(self):
        return len(self._index)

    def __repr__(self):
        return repr(dict(self))

    def _ipython_key_completions_(self):
        return list(self._index)

    def _at(self, name):
        if name not in self._index:
            raise KeyError(f"no input {name!r}{_nearest(name, self._index)}; inputs are named when the simulation is opened")
        return self._index[name]


def _finite(value, what):
    value = lib.number(value, what)
    if not np.isfinite(value):
        raise lib.InputError(f"{what} = {value}: expected a finite number")
    return value


class _Rows:
    """An array that grows: its capacity follows the fraction of the run that is done, so that little is copied."""

    def __init__(self, width: int, capacity: int):
        self.count, self._rows = 0, self._allocate(capacity, width)

    @staticmethod
    def _allocate(capacity, width):
        try:
            if capacity * width * 8 > _MEMORY:  # the system might grant it and end the process when it is used
                raise MemoryError
            return np.empty((capacity, width))
        except (MemoryError, ValueError):
            raise lib.ResourceError(f"{capacity} samples of {width} numbers: out of memory") from None

    def room(self, done: float) -> np.ndarray:
        """The rows that are not used yet, at least one; done: fraction of the run that is done."""
        if self.count == len(self._rows):
            # 10 % more than the whole run needs at this rate; growth by a factor from 1.2 to 64
            expected = self.count * min(64, max(1.1 / done, 1.2)) if done > 0 else 64 * self.count
            most = max(_MEMORY // (8 * self._rows.shape[1]), self.count + 1)
            larger = self._allocate(min(int(expected) + 16, most), self._rows.shape[1])
            larger[:self.count] = self._rows
            self._rows = larger
        return self._rows[self.count:]

    @property
    def used(self) -> np.ndarray:
        return self._rows[:self.count]


def specialised(when: str, steps: float) -> bool:
    """Whether runs with this number of steps use compiled code."""
    if when not in ("auto", "always", "never"):
        raise lib.InputError(f"specialise = {when!r:.60}: expected auto, always or never")
    return when == "always" or (when == "auto" and steps >= lib.PW_SPECIALISE_STEPS)


def adaptive(method: str) -> bool | None:
    """Whether a method chooses its steps; None for an unknown one."""
    integrator = c.c_void_p()
    if lib.core.pw_method_parse(lib.encode(method, "method"), None, c.byref(integrator), None, None) != lib.PW_OK:
        return None
    return bool(lib.core.pw_method_adaptive(integrator, method.encode()))


def warn_of_unused(method: str, given, stacklevel: int) -> None:
    """Warns of settings (their names) without effect on a method, as the program does."""
    controls_steps, tolerances = adaptive(method), [name for name in ("rtol", "atol") if name in given]
    if controls_steps is None:
        return  # opening the run refuses it
    if controls_steps and "step" in given and not tolerances:
        warnings.warn(f"step has no effect: {method} chooses its steps by rtol, atol", stacklevel=stacklevel + 1)
    if not controls_steps and "max_steps" in given:
        warnings.warn(f"max_steps has no effect: {method} takes as many steps as step requires", stacklevel=stacklevel + 1)
    if not controls_steps and tolerances and "step" not in given:
        warnings.warn(f"{tolerances[0]} has no effect: {method} takes steps of step", stacklevel=stacklevel + 1)


class _Condition:
    """The instant at which a condition becomes true, sought in the last step of a run."""

    def __init__(self, system, text, ledger):
        self._system, self.time = system, None
        try:
            pointer = system.call(lib.files.pw_condition_open, system.pointer, lib.encode(text, "until"))
        except lib.InputError as why:
            raise lib.InputError(f"until = {text!r:.60}: {why}") from None
        self._handle = lib.Handle(pointer, lib.files.pw_condition_close, system)
        if lib.files.pw_condition_needs_ledger(pointer) and not ledger:
            raise lib.InputError(f"until = {text!r:.60} reads work or losses: add energy=True")
        self._crossing = lib.pw_crossing(value=c.cast(lib.files.pw_condition_value, c.c_void_p).value, context=pointer)

    def check(self, run):
        t = c.c_double()
        self._system.call(lib.core.pw_run_find_crossing, run, c.byref(self._crossing), c.byref(t))
        self.time = None if t.value != t.value else t.value
        return self.time


class Simulation:
    """An open run of a model, advanced by its caller: for controllers, or to look at every step.

    Open it with :meth:`Model.open`; use it as a context manager.  One thread at a time may use it.

    Attributes
    ----------
    model : Model
    method : str
    inputs : Inputs
        Inputs that may be set between steps, by name; after a change the method restarts from the state reached.
    changed : dict of tuple
        Initial values that the constraints have changed: (described, consistent) by name of the state; a warning names
        those that the user gives or, except in sweeps, the model specifies.

    Examples
    --------
    >>> with pw.Model("ezyroller").open("erk5+projection", inputs={"rider": 0.0}) as simulation:
    ...     simulation.inputs["rider"] = -0.5 * simulation.sample()["steer.phi"]
    ...     simulation.advance(0.01)
    """

    _run: Any = None  # a closed run
    _cancelled = staticmethod(lambda: False)  # asked between calls of the library; True: ends the run as Ctrl-C does

    def __init__(self, model, system, method, settings, given, stacklevel=4):
        self.model, self._system, self._settings = model, system, settings
        self.method, self._given = method, given
        self._lock, self._steps_per_call = threading.Lock(), 16
        self._ensemble = Ensemble([system], method, settings)
        self._run = self._ensemble.open(0)
        self._values = self._ensemble.input[0]
        self.inputs = Inputs(list(system.inputs), self._values)
        self.random = np.random.default_rng()
        self.changed = self._initial(stacklevel, model._warns_of)
        for i in range(lib.core.pw_system_signals(system.pointer) if stacklevel else 0):
            if notice := lib.name_of(lib.core.pw_system_table_notice, system.pointer, i, settings.span):
                warnings.warn(f"model {model.name}: {notice}", stacklevel=3)

    def _initial(self, stacklevel, warns_of):
        """The attribute `changed`; warns of it."""
        s, core, report, changed, texts = self._system.pointer, lib.core, lib.core.pw_run_initial(self._run.pointer), {}, []
        n, x = core.pw_system_coordinates(s), report.contents
        if x.moved == 0:
            return changed
        for i in range(2 * n):
            moved = core.pw_initial_moved(s, report, i)
            if not moved:
                continue
            name = lib.name_of(core.pw_system_state_name, s, i)
            changed[name] = (x.q_given[i], x.q[i]) if i < n else (x.v_given[i - n], x.v[i - n])
            if moved > 1 and warns_of(report, i):  # not of rounded values
                texts.append(f"{name} from {changed[name][0]:.10g} to {changed[name][1]:.10g} {lib.text(core.pw_system_state_unit(s, i))}"
                             + ("" if core.pw_initial_given(report, i) else " (specified by the model)"))
        if texts[8:]:
            texts[8:] = [f"and {len(texts) - 8} more"]
        if texts and stacklevel:
            warnings.warn(f"model {self.model.name}: initial values were changed to satisfy the constraints: {', '.join(texts)}",
                          stacklevel=stacklevel)
        return changed

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, leaving, *_):
        with contextlib.suppress(lib.Error) if leaving else contextlib.nullcontext():
            self.close()

    def __reduce_ex__(self, _):
        raise TypeError("an open run cannot be copied or sent to other processes")

    def _acquire(self) -> None:
        """Takes the lock of the run, which one user at a time may hold."""
        if not self._lock.acquire(blocking=False):
            raise lib.Error(_IN_USE)
        if self._run is None:
            self._lock.release()
            raise lib.Error("the run is closed")

    @contextlib.contextmanager
    def _used(self) -> Iterator[int]:
        """The run, for one user at a time."""
        self._acquire()
        try:
            yield self._run.pointer
        finally:
            self._lock.release()

    def close(self) -> None:
        """Frees the run; a closed one can be closed again."""
        if self._run is not None:
            with self._used():
                self._run = None
                self._ensemble.close(0)

    @property
    def time(self) -> float:
        """The time reached [s]; ``t`` is the same."""
        with self._used() as run:
            return lib.core.pw_run_time(run)

    t = time

    @property
    def statistics(self) -> dict:
        """Numbers of steps and evaluations, in all and by specialised code; largest constraint residuals so far."""
        with self._used() as run:
            return self._statistics(run)

    @staticmethod
    def _statistics(run):
        s = lib.core.pw_run_statistics(run).contents
        counts = ("steps", "rejected", "rhs", "jacobians", "factorisations", "restarts", "specialised", "conditions",
                  "unresolved", "g", "jv")
        return {**{name: getattr(s, name) for name in counts}, "residual.position": s.position, "residual.velocity": s.velocity}

    # ---- Control ----

    def step(self, inputs=None, dt: float | None = None) -> None:
        """Sets inputs and advances, in a few microseconds.

        Parameters
        ----------
        inputs : float, array_like of shape (inputs,) or dict, optional
            Constant during the step, in the order in which they were named; by default those of the step before.
        dt : float, optional
            Duration [s]; by default the step size of the method.

        Raises
        ------
        InputError, MethodError
            After a MethodError the run stays where it failed.
        """
        if inputs is not None:
            if inputs.__class__ is float and len(self._values) == 1:
                self._values[0] = inputs
            elif hasattr(inputs, "items"):
                self.inputs.update(inputs)
            else:
                self._values[:] = array(np.atleast_1d(inputs), self._values.shape, "inputs")
        dt = duration(dt, self._settings.step)
        self._acquire()
        try:
            self._ensemble.step(dt)
            self._ensemble.check(0)
        finally:
            self._lock.release()

    def observe(self, names=None) -> np.ndarray:
        """Columns at the time reached.

        Parameters
        ----------
        names : sequence of str, optional
            Names of columns, as in :class:`Result`; by default, the states.  A tuple is looked up fastest.

        Returns
        -------
        ndarray, shape (len(names),)
            An array that the next call with these names overwrites.

        Raises
        ------
        KeyError
            For an unknown name, with the nearest one.
        InputError, MethodError
        """
        store, values, _ = self._ensemble.plan(self.states if names is None else names)
        self._acquire()
        try:
            store()
            self._ensemble.check(0)
        finally:
            self._lock.release()
        return values[0]

    def reset(self, state=None, seed: int | None = None) -> None:
        """Starts again at time 0, with the initial inputs.

        Parameters
        ----------
        state : dict, array_like or callable, optional
            Initial values of states by name, or an array over ``states``, or a function of ``random`` that returns a dict;
            others are the model's.  They are made consistent with the constraints: see ``changed``.
        seed : int, optional
            Makes ``random`` a new generator.

        Raises
        ------
        InputError, InitialError
            The run is what it was.
        """
        if seed is not None:
            self.random = np.random.default_rng(seed)
        self._reopen(state(self.random) if callable(state) else state, 0.0, lib.core.pw_initial_given)
        self._values[:] = list(self._system.inputs.values())

    def _reopen(self, state, t, warns_of):
        with self._used():
            self._run = self._ensemble.open(0, self._ensemble.numbers(state), t)
            self.changed = self._initial(4, warns_of)

    @property
    def states(self) -> list:
        """Names of the states: coordinates, velocities, first-order states."""
        return self._ensemble.states

    @property
    def state(self) -> dict:
        """Values of the states by name; ``observe ()`` has them as an array."""
        return dict(zip(self.states, self.observe().tolist()))

    @property
    def _parts(self):
        """Slices of positions, velocities and first-order states in the array of the states."""
        n = len(self.states) - lib.core.pw_system_coordinates(self._system.pointer)
        return slice(0, n), slice(n, 2 * n), slice(2 * n, None)

    def set_state(self, q=None, v=None, z=None, t: float | None = None) -> None:
        """Continues from another state; it is made consistent with the constraints: see ``changed``.

        Parameters
        ----------
        q, v, z : array_like or dict, optional
            Coordinates, velocities, first-order states, in the order of ``states`` or by name; others stay.
        t : float, optional
            Time [s]; by default it stays.

        Raises
        ------
        InputError, InitialError, MethodError
            The run is what it was.
        """
        state, numbers = self.observe().copy(), list(self._ensemble.number.values())
        given = set()
        for name, values, part in zip("qvz", (q, v, z), self._parts):
            if hasattr(values, "items"):
                own = self._ensemble.numbers(values)
                state[[numbers.index(i) for i in own]] = list(own.values())
            elif values is not None:
                state[part] = array(values, state[part].shape, name)
                own = numbers[part]
            given.update(own if values is not None else ())
        self._reopen(state, self.time if t is None else _finite(t, "t"), lambda _, i: i in given)

    def save(self) -> bytes:
        """The state, from which :meth:`load` continues with the same bits as this simulation.

        Methods of several steps (adams, bdf, ida) restart here.

        Returns
        -------
        bytes

        Raises
        ------
        MethodError
            Near a singular configuration: try after the next step.
        """
        archive = lib.pw_archive()
        with self._used() as run:
            self._ensemble.step(0.0)  # inputs
            self._ensemble.check(0)
            try:
                self._system.call(lib.core.pw_run_save, run, c.byref(archive))
                saved = c.string_at(archive.at, archive.used) if archive.used else b""
            finally:
                lib.core.pw_archive_free(c.byref(archive))
        if not saved:
            raise lib.MethodError(f"t = {self.time:.6g} s: near a singular configuration states cannot be saved: try after the next step")
        (start, t), inputs = self._ensemble.started[0], self._values.tolist()
        return json.dumps([list(start.items()), t, inputs]).encode() + b"\n" + saved

    def load(self, saved: bytes) -> None:
        """Continues from a state of :meth:`save` of a simulation of this model with this method, settings and inputs.

        Parameters
        ----------
        saved : bytes

        Raises
        ------
        InputError
            For bytes of something else; the run is what it was.
        """
        try:
            head, _, rest = bytes(saved).partition(b"\n")
            start, t, inputs = json.loads(head)
            start, t, inputs = {int(i): float(x) for i, x in start}, float(t), array(inputs, self._values.shape, "inputs")
        except (TypeError, ValueError, RecursionError):
            raise lib.InputError("load: expected the bytes of a simulation that was saved, with the same inputs") from None
        buffer = c.create_string_buffer(rest, len(rest))
        archive = lib.pw_archive(at=c.addressof(buffer), size=len(rest), loading=1)
        with self._used():
            former, started = self._run, self._ensemble.started[0]
            run = self._ensemble.open(0, start, t)
            try:
                self._system.call(lib.core.pw_run_load, run.pointer, c.byref(archive))
            except BaseException:
                self._ensemble.put(0, former, started)
                raise
            self._run = run
            self._values[:] = inputs

    def clone(self) -> Simulation:
        """Another simulation in the same state, which continues with the same bits."""
        other = Simulation(self.model, self._system, self.method, lib.pw_settings.from_buffer_copy(self._settings), self._given, 0)
        other.load(self.save())
        other.random.bit_generator.state = self.random.bit_generator.state
        other.changed = self.changed
        return other

    # ---- Steps of the caller ----

    def advance(self, t: float) -> None:
        """Advances to the time t.

        Parameters
        ----------
        t : float
            [s], not earlier than the time reached.

        Raises
        ------
        InputError, MethodError
        """
        with self._used() as run:
            self._record(run, np.array([self._later(run, t, "advance")]), t)

    def sample(self) -> dict:
        """The state reached, with reactions and energies: numbers by name."""
        with self._used() as run:
            units, _ = self._ensemble.columns
            t = lib.core.pw_run_time(run)
            return dict(zip(units, self._record(run, np.array([t]), t).used[0].tolist()))

    def _later(self, run, t, what):
        """The time t as a number; it must not be earlier than the time reached."""
        reached, t = lib.core.pw_run_time(run), _finite(t, what)
        if not t >= reached:
            raise lib.InputError(f"{what}({t}): the run has reached t = {reached}")
        return t

    # ---- Tables ----

    def record(self, t_end: float, every: float | None = None, times=None,
               progress: Callable[[float], object] | bool | None = None, until: str | None = None) -> Result:
        """Advances to t_end, or to the last of ``times``, and returns the samples.

        Parameters
        ----------
        t_end : float
            Final time [s].
        every : float, optional
            Time between samples [s]; default: a sample after every step.
        times : array_like, shape (n,), optional
            Increasing times of samples [s], in place of ``every``.
        progress : callable or bool, optional
            Called now and then with the fraction done; True: a progress bar, False: none; default: a bar in notebooks.
        until : str, optional
            A condition on columns, "car.x > 10": the last sample is at the instant at which it becomes true.  The
            simulation itself is at the end of that step.

        Returns
        -------
        Result
            A method that fails ends it early: see ``status`` and ``reason``.  ``stopped``: the time at which the
            condition became true, or None.

        Raises
        ------
        InputError, MethodError, ResourceError
            The last two only if the run fails before the first sample.
        Exception
            What a function of a signal or ``progress`` raises, or a handler of signals, such as KeyboardInterrupt of
            Ctrl-C.  Its attribute ``result`` is the Result up to there; the run can continue.
        """
        with self._used() as run:
            t_end = self._later(run, t_end, "t_end")
            times = self._times(lib.core.pw_run_time(run), t_end, every, times)
            rows = _Rows(lib.core.pw_run_record_width(run), 4096 if times is None else len(times))
            condition = None if until is None else _Condition(self._system, until, self._settings.ledger)
            try:
                call = lib.Call()
                call.passing(self._record, run, times, t_end, rows, progress, call, condition)
            except BaseException as failure:
                in_function = lib.raised_by_function(failure)
                if in_function:
                    result = self._result(run, rows, t_end, "failed", f"{in_function}: {type(failure).__name__}: {failure}")
                elif isinstance(failure, (lib.MethodError, lib.ResourceError)):
                    result = self._result(run, rows, t_end, "failed", str(failure))
                    if rows.count:
                        return result
                else:
                    what = "interrupted" if isinstance(failure, KeyboardInterrupt) else f"{type(failure).__name__}: {failure}"
                    result = self._result(run, rows, t_end, "stopped", f"{what} at t = {lib.core.pw_run_time(run):.6g} s")
                lib.set_attribute(failure, "result", result)
                raise
            result = self._result(run, rows, t_end, "ok", "")
            result.stopped = condition.time if condition else None
            return result

    def _result(self, run, rows, t_end, status, reason):
        """The rows as a Result."""
        units, groups = self._ensemble.columns
        result = Result(rows.used, groups, units, status, reason, self._statistics(run), self.model,
                        {"method": self.method, "t_end": t_end, **self._given})
        result.changed = self.changed
        result.events = self._events(run)
        return result

    def _events(self, run):
        """The changes of equations whose reactions have limits, up to the time reached."""
        count, s = c.c_int(), self._system.pointer
        events = lib.core.pw_run_events(run, c.byref(count))

        def event(e):
            mode = [lib.core.pw_system_mode_name(s, e.row, mode).decode() for mode in (getattr(e, "from"), e.to)]
            return {"t": e.t, "reaction": lib.name_of(lib.core.pw_system_reaction_name, s, e.row), "from": mode[0],
                    "to": mode[1], "impulse": e.impulse if e.impact else None}

        return [event(events[i]) for i in range(count.value)]

    def _state_error(self, result) -> None:
        """Repeats a complete run with a tenth of the tolerance or half the step, and states its errors (repetition.c)."""
        times, rows = np.ascontiguousarray(result.t), np.ascontiguousarray(result.rows)
        end, largest = np.empty((2, rows.shape[1]))
        method = lib.encode(self.method, "method")  # the repetition keeps a pointer to it
        r = self._system.call(lib.core.pw_repetition_open, self._system.pointer, method, c.byref(self._settings),
                              times.ctypes.data, len(times))
        try:
            while self._system.call(lib.core.pw_repetition_run, r, 20000) == lib.PW_RETRY:
                if self._cancelled():
                    raise KeyboardInterrupt
            self._system.call(lib.core.pw_repetition_error, r, rows.ctypes.data, len(rows), end.ctypes.data, largest.ctypes.data)
        except lib.MethodError as unknown:
            result.error_unknown = str(unknown)
        else:
            result.error = {name: (a, b) for name, a, b in zip(result, end.tolist(), largest.tolist()) if a == a}
        finally:
            lib.core.pw_repetition_close(r)

    @staticmethod
    def _times(start, t_end, every, times):
        """The times of samples; None: every step."""
        if times is None and every is None:
            return None
        if times is not None and every is not None:
            warnings.warn("every has no effect: times are given", stacklevel=4)
        if times is None:
            every = lib.number(every, "every", above=0)
            count = np.floor((t_end - start) / every * (1 + 1e-12))
            if not count * 8 * lib.PW_RECORD_STATES < _MEMORY:
                raise lib.ResourceError(f"every = {every}: {count:g} samples: out of memory")
            times = start + every * np.arange(count + 1)
            return np.append(times[:-1], t_end) if abs(times[-1] - t_end) < 1e-9 * every else np.append(times, t_end)
        try:
            times = np.ascontiguousarray(times, float)
        except (TypeError, ValueError):
            raise lib.InputError(f"times: expected an array of shape (n,) of times, found {times!r:.60}") from None
        if times.ndim != 1 or times.size == 0 or not ((np.diff(times) > 0).all() and times[0] >= start and times[-1] <= t_end):
            raise lib.InputError(f"times: expected an array of shape (n,) of increasing times from {start} to {t_end}, "
                                 f"found shape {times.shape}")
        return times

    def _record(self, run, times, t_end, rows=None, progress=False, call=None, condition=None):
        """Advances and adds the samples at these times, or after every step (None), to the rows, which are returned.

        call: the lib.Call that keeps what handlers of signals raise; None: they may raise in finalizers without effect.
        condition: a _Condition that ends the run.
        """
        rows = rows or _Rows(lib.core.pw_run_record_width(run), len(times))
        start, now = lib.core.pw_run_time(run), lib.core.pw_run_time
        if self.inputs:
            self._ensemble.step(0.0)
            self._ensemble.check(0)
        if times is None:
            self._call(run, np.array([start]), start, rows, 1.0)
        if condition:
            condition.check(run)
        with watched(progress) as report:
            while not (condition and condition.time is not None) and (
                    rows.count < len(times) if times is not None else now(run) < t_end):
                done = (now(run) - start) / (t_end - start) if t_end > start else 1.0
                if condition:
                    self._steps_per_call = 1
                self._call(run, None if times is None else times[rows.count:], t_end, rows, done)
                if condition and condition.check(run) is not None:
                    rows.count = int(np.searchsorted(rows.used[:, 0], condition.time))
                    self._call(run, np.array([condition.time]), now(run), rows, 1.0)
                report(min(1.0, done))
                if self._cancelled():
                    raise KeyboardInterrupt
                if call and call.failure:
                    raise call.failure
            report(1.0)
        return rows

    def _call(self, run, times, t_end, rows, done):
        """One call of the library, of 40 to 100 ms, so that Python reacts to Ctrl-C soon."""
        recorded, room, began = c.c_long(), rows.room(done), time.perf_counter()
        room = room if times is None else room[:len(times)]
        try:
            self._system.call(lib.core.pw_run_record, run, t_end, None if times is None else times.ctypes.data, len(room),
                              self._steps_per_call, room.ctypes.data, c.byref(recorded))
        finally:
            rows.count += recorded.value
        seconds = time.perf_counter() - began
        if seconds < 0.04:
            self._steps_per_call = min(10**7, 2 * self._steps_per_call)
        elif seconds > 0.1:
            self._steps_per_call = max(1, self._steps_per_call // 2)
