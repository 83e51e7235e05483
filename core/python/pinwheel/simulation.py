"""Open runs: recorded as a whole, or advanced by the caller."""

from __future__ import annotations

import contextlib
import ctypes as c
import os
import threading
import time
import warnings
from collections.abc import Callable, Iterator, MutableMapping

import numpy as np

from . import _library as lib
from ._progress import watched
from .results import Result, _nearest

_FIRST_COLUMNS = 9  # before the states: PW_RECORD_STATES
_MEMORY = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")  # of the machine [bytes]


class Inputs(MutableMapping):
    """Values of the signals that the user of a simulation sets, by name; no names can be added or removed."""

    def __init__(self, cells: dict, changed: Callable[[], None]):
        self._cells, self._changed = cells, changed

    def __getitem__(self, name: str) -> float:
        return self._cell(name).value

    def __setitem__(self, name: str, value: float) -> None:
        self._cell(name).value = _finite(value, f"input {name}")
        self._changed()

    def __delitem__(self, name):
        raise TypeError("inputs cannot be removed")

    def __iter__(self):
        return iter(self._cells)

    def __len__(self):
        return len(self._cells)

    def __repr__(self):
        return repr(dict(self))

    def _cell(self, name):
        if name not in self._cells:
            raise KeyError(f"no input {name!r}{_nearest(name, self._cells)}; inputs are named when the simulation is opened")
        return self._cells[name]


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


def warn_of_unused(method: str, given, stacklevel: int) -> None:
    """Warns of settings (their names) without effect on a method, as the program does."""
    integrator = c.c_void_p()
    if lib.core.pw_method_parse(lib.encode(method, "method"), c.byref(integrator), None, None) != lib.PW_OK:
        return  # opening the run refuses it
    adaptive, tolerances = lib.core.pw_method_adaptive(integrator, method.encode()), [name for name in ("rtol", "atol") if name in given]
    if adaptive and "step" in given and not tolerances:
        warnings.warn(f"step has no effect: {method} chooses its steps by rtol, atol", stacklevel=stacklevel + 1)
    if not adaptive and "max_steps" in given:
        warnings.warn(f"max_steps has no effect: {method} takes as many steps as step requires", stacklevel=stacklevel + 1)
    if not adaptive and tolerances and "step" not in given:
        warnings.warn(f"{tolerances[0]} has no effect: {method} takes steps of step", stacklevel=stacklevel + 1)


def columns(s, ledger) -> tuple[dict, dict]:
    """Of a compiled system: units of all columns by name, in their order; names of columns by group, as in :class:`Result`."""
    core, width = lib.core, lib.core.pw_system_record_width(s, bool(ledger))
    names = [lib.name_of(core.pw_system_record_name, s, i) for i in range(width)]
    n = core.pw_system_coordinates(s)
    reactions = _FIRST_COLUMNS + 3 * n + 2 * core.pw_system_contacts(s)
    outputs = reactions + core.pw_system_rows(s)
    entries = outputs + core.pw_system_outputs(s)
    states = [names[_FIRST_COLUMNS + i] for i in range(2 * n) if not core.pw_system_state_hidden(s, i)]
    groups = {"states": states, "reactions": names[reactions:outputs], "outputs": names[outputs:entries],
              "ledger": names[entries:]}
    units = {name: lib.text(core.pw_system_record_unit(s, i)) for i, name in enumerate(names)}
    return units, groups


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

    _run = None  # a closed run
    _cancelled = staticmethod(lambda: False)  # asked between calls of the library; True: ends the run as Ctrl-C does

    def __init__(self, model, system, cells, method, settings, given):
        self.model, self._system, self._settings = model, system, settings
        self.method, self._given, self._restart = method, given, False
        self._lock, self._steps_per_call = threading.Lock(), 16
        run = system.call(lib.core.pw_run_open, system.pointer, lib.encode(method, "method"), c.byref(settings))
        self._run = lib.Handle(run, lib.core.pw_run_close, system)
        self.inputs = Inputs(cells, self._input_changed)
        self.changed = self._initial()

    def _input_changed(self):
        self._restart = True

    def _initial(self):
        """The attribute `changed`; warns of it, and of tables that do not cover the run."""
        s, core, report, changed, texts = self._system.pointer, lib.core, lib.core.pw_run_initial(self._run.pointer), {}, []
        n, x = core.pw_system_coordinates(s), report.contents
        for i in range(2 * n):
            moved = core.pw_initial_moved(s, report, i)
            if not moved:
                continue
            name = lib.name_of(core.pw_system_state_name, s, i)
            changed[name] = (x.q_given[i], x.q[i]) if i < n else (x.v_given[i - n], x.v[i - n])
            if moved > 1 and self.model._warns_of(report, i):  # not of rounded values
                texts.append(f"{name} from {changed[name][0]:.10g} to {changed[name][1]:.10g} {lib.text(core.pw_system_state_unit(s, i))}"
                             + ("" if core.pw_initial_given(report, i) else " (specified by the model)"))
        if texts[8:]:
            texts[8:] = [f"and {len(texts) - 8} more"]
        if texts:
            warnings.warn(f"model {self.model.name}: initial values were changed to satisfy the constraints: {', '.join(texts)}", stacklevel=4)
        for i in range(core.pw_system_signals(s)):
            if notice := lib.name_of(core.pw_system_table_notice, s, i, self._settings.span):
                warnings.warn(f"model {self.model.name}: {notice}", stacklevel=4)
        return changed

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, leaving, *_):
        with contextlib.suppress(lib.Error) if leaving else contextlib.nullcontext():
            self.close()

    def __reduce_ex__(self, _):
        raise TypeError("an open run cannot be copied or sent to other processes")

    @contextlib.contextmanager
    def _used(self) -> Iterator[int]:
        """The run, for one user at a time."""
        if self._run is None:
            raise lib.Error("the run is closed")
        if not self._lock.acquire(blocking=False):
            raise lib.Error("the run is in use, by another thread or by the function that called this one")
        try:
            if self._run is None:
                raise lib.Error("the run is closed")
            yield self._run.pointer
        finally:
            self._lock.release()

    def close(self) -> None:
        """Frees the run; a closed one can be closed again."""
        if self._run is not None:
            with self._used():
                self._run = None

    @property
    def t(self) -> float:
        """The time reached [s]."""
        with self._used() as run:
            return lib.core.pw_run_time(run)

    @property
    def statistics(self) -> dict:
        """Numbers of steps and evaluations, in all and by specialised code; largest constraint residuals so far."""
        with self._used() as run:
            return self._statistics(run)

    @staticmethod
    def _statistics(run):
        s = lib.core.pw_run_statistics(run).contents
        return {name: getattr(s, name) for name in ("steps", "rejected", "rhs", "jacobians", "factorisations",
                                                    "specialised", "unresolved", "position", "velocity", "g", "jv")}

    def _columns(self):
        return columns(self._system.pointer, self._settings.ledger)

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
            units, _ = self._columns()
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
            condition = None if until is None else self._condition(until)
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

    def _condition(self, text):
        return _Condition(self._system, text, self._settings.ledger)

    def _result(self, run, rows, t_end, status, reason):
        """The rows as a Result."""
        units, groups = self._columns()
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
            if not count * 8 * _FIRST_COLUMNS < _MEMORY:
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
        if self._restart:
            self._system.call(lib.core.pw_run_restart, run, None, None)
            self._restart = False
        if times is None:
            self._call(run, np.array([start]), start, rows, 1.0)
        if condition:
            self._steps_per_call = 1
            condition.check(run)
        with watched(progress) as report:
            while not (condition and condition.time is not None) and (
                    rows.count < len(times) if times is not None else now(run) < t_end):
                done = (now(run) - start) / (t_end - start) if t_end > start else 1.0
                self._call(run, None if times is None else times[rows.count:], t_end, rows, done)
                if condition:
                    self._steps_per_call = 1
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
