"""A run that the caller advances."""

from __future__ import annotations

import ctypes as c

import numpy as np

from . import _library as lib
from .results import Result, _nearest

_SLICE = 20000  # steps between two looks at Ctrl-C
_HEAD = {"t": "s", "position_residual": "", "velocity_residual": "", "kinetic": "J", "potential": "J", "work": "J", "loss": "J",
         "projection": "J", "balance": "J"}


class Inputs(dict):
    """Values of the signals that a simulation's user sets."""

    def __init__(self, cells, changed):
        super().__init__({name: cell.value for name, cell in cells.items()})
        self._cells, self._changed = cells, changed

    def __setitem__(self, name, value):
        if name not in self._cells:
            raise KeyError(f"no input {name!r}{_nearest(name, self._cells)}; inputs are named when the simulation is opened")
        self._cells[name].value = value
        super().__setitem__(name, value)
        self._changed()


class Simulation:
    """An open run of a model, advanced by its caller: for controllers, or to look at every step.

    Open it with :meth:`Model.open`; use it as a context manager.

    Attributes
    ----------
    inputs : dict
        Inputs that may be set between steps.
    """

    def __init__(self, model, system, cells, method, settings, ledger):
        self.model, self._system, self._settings = model, system, settings
        self.method, self._ledger, self._restart = method, ledger, False
        error = lib.pw_error()
        self._run = lib.core.pw_run_open(system.pointer, method.encode(), c.byref(settings), c.byref(error))
        lib.check(error)
        self.inputs = Inputs(cells, self._changed)

    def _changed(self):
        self._restart = True

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Frees the run."""
        if self._run:
            lib.core.pw_run_close(self._run)
        self._run = None

    __del__ = close

    @property
    def t(self) -> float:
        """The time reached [s]."""
        return lib.core.pw_run_time(self._run)

    @property
    def statistics(self) -> dict:
        """Steps, evaluations, largest constraint residuals so far."""
        s = lib.core.pw_run_statistics(self._run).contents
        return {name: getattr(s, name) for name in ("steps", "rejected", "rhs", "jacobians", "factorisations", "position",
                                                    "velocity", "g", "jv")}

    def _columns(self):
        s, n, core = self._system.pointer, lib.core.pw_system_coordinates(self._system.pointer), lib.core
        units, groups = dict(_HEAD), {}
        groups["states"] = [lib.name_of(core.pw_system_state_name, s, i) for i in range(2 * n)]
        for i, name in enumerate(groups["states"]):
            units[name] = lib.text(core.pw_system_state_unit(s, i))
        for i, name in enumerate(groups["states"][n:]):
            unit = units[name]
            units[name + "'"] = unit[:-1] + "s^2" if unit.endswith("/s") else unit + "/s"
        groups["reactions"] = [lib.name_of(core.pw_system_reaction_name, s, i) for i in range(core.pw_system_rows(s))]
        for i, name in enumerate(groups["reactions"]):
            units[name] = lib.text(core.pw_system_reaction_unit(s, i))
        entries = core.pw_system_ledger_entries(s) if self._ledger else 0
        groups["ledger"] = [lib.name_of(core.pw_system_ledger_name, s, i) for i in range(entries)]
        units.update(dict.fromkeys(groups["ledger"], "J"))
        return units, groups

    def _restart_if_changed(self):
        if self._restart:
            error = lib.pw_error()
            lib.core.pw_run_restart(self._run, None, None, c.byref(error))
            lib.check(error)
            self._restart = False

    def advance(self, t: float) -> None:
        """Advances to the time t [s], which must not be earlier than the time reached."""
        self._restart_if_changed()
        if not t >= self.t:
            raise lib.InputError(f"advance({t}): the run has reached t = {self.t}")
        self._rows([t], t)

    def sample(self) -> dict:
        """The state reached, by name."""
        units, _ = self._columns()
        return dict(zip(units, self._rows([self.t], self.t)[0].tolist()))

    def record(self, t_end: float, every=None, times=None, progress=None) -> Result:
        """Advances to t_end and returns the samples.

        Parameters
        ----------
        t_end : float
            Final time [s].
        every : float, optional
            Time between samples [s]; default: a sample after every step.
        times : array_like, shape (n,), optional
            Increasing times of samples [s], in place of ``every``.
        progress : callable, optional
            Called with the fraction done now and then.

        Returns
        -------
        Result
            Ctrl-C and failing methods end it early: see ``status`` and ``reason``.
        """
        self._restart_if_changed()
        start = self.t
        if every is not None and times is None:
            if not every > 0:
                raise lib.InputError(f"every = {every}: expected a positive time")
            count = int(np.floor((t_end - start) / every * (1 + 1e-12)))
            times = start + every * np.arange(count + 1)
            times = np.append(times[:-1], t_end) if abs(times[-1] - t_end) < 1e-9 * every else np.append(times, t_end)
        if times is not None:
            times = np.ascontiguousarray(times, float)
            if times.ndim != 1 or (np.diff(times) <= 0).any() or (times < start).any() or (times > t_end).any():
                raise lib.InputError(f"times: expected an array of shape (n,) of increasing times from {start} to {t_end}, "
                                     f"found shape {times.shape}")
        status, reason, blocks = "ok", "", []
        try:
            for block in self._blocks(t_end, times, start):
                blocks.append(block)
                if progress:
                    progress(min(1.0, (self.t - start) / (t_end - start)) if t_end > start else 1.0)
        except KeyboardInterrupt:
            status, reason = "stopped", f"interrupted at t = {self.t:.6g} s"
        except lib.Error as failure:
            if not blocks:
                raise
            status, reason = "failed", str(failure)
        units, groups = self._columns()
        rows = blocks[0].base if times is not None and status == "ok" else np.concatenate(blocks)
        return Result(rows, groups, units, status, reason, self.statistics, self.model,
                      {"method": self.method, "t_end": t_end})

    def _blocks(self, t_end, times, start):
        """Rows in parts, so that Ctrl-C is noticed; those at given times are parts of one array."""
        width = lib.core.pw_run_record_width(self._run)
        if times is None:
            yield self._rows([start], start)
            while self.t < t_end:
                yield from self._fill(np.empty((4096, width)), t_end, None)
        else:
            rows, done = np.empty((len(times), width)), 0
            while done < len(times):
                for part in self._fill(rows[done:], t_end, times[done:]):
                    done += len(part)
                    yield part

    def _fill(self, rows, t_end, times):
        """Yields what one call records, then raises its error."""
        recorded, error = c.c_long(), lib.pw_error()
        lib.core.pw_run_record(self._run, t_end, None if times is None else times.ctypes.data, len(rows), _SLICE,
                               rows.ctypes.data, c.byref(recorded), c.byref(error))
        if recorded.value:
            yield rows[:recorded.value]
        lib.check(error)

    def _rows(self, times, t_end):
        """Samples at a few times, without looking at Ctrl-C."""
        times = np.array(times, float)
        rows, done = np.empty((len(times), lib.core.pw_run_record_width(self._run))), 0
        while done < len(times):
            done += sum(map(len, self._fill(rows[done:], t_end, times[done:])))
        return rows
