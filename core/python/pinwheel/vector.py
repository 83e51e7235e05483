"""Many vehicles, stepped together, for learning and control."""

from __future__ import annotations

import os
import warnings

import numpy as np

from . import _library as lib
from .ensemble import Ensemble, array, duration
from .model import Model
from .simulation import adaptive


class VectorSimulation:
    """Many vehicles of one model, stepped together in threads and in lanes of vector registers, for learning and control.

    Each vehicle moves as if it were alone.  One that fails waits until it is reset: its observations are NaN, ``failed``
    marks it, and ``reasons`` says why.

    Parameters
    ----------
    model : Model or str
    n : int
        Number of vehicles.
    method, t_end, step, rtol, atol, max_steps, energy, inputs, specialise
        As in :meth:`Model.open`; ``specialise="auto"`` counts the steps of all vehicles up to t_end.
    threads : int, optional
        By default, one for each processor.
    parameters : dict of array_like, shape (n,), optional
        Values of parameters that differ between the vehicles.

    Raises
    ------
    InputError, InitialError, MethodError

    Attributes
    ----------
    n : int
    inputs, states : list of str
        Names of the inputs, and of coordinates, velocities and first-order states.
    random : list of numpy.random.Generator
        One for each vehicle, from the seed of ``reset``.

    Examples
    --------
    >>> with pw.VectorSimulation("ezyroller", 256, inputs={"rider": 0.0}) as vehicles:
    ...     for k in range(100):
    ...         vehicles.step(-0.5 * vehicles.observe(["steer.phi"]), 0.01)
    """

    def __init__(self, model, n: int, method: str | None = None, *, t_end: float | None = None, step: float | None = None,
                 rtol: float | None = None, atol: float | None = None, max_steps: int | None = None, energy: bool = False,
                 inputs: dict[str, float] | None = None, specialise: str = "auto", threads: int | None = None,
                 parameters: dict | None = None):
        model = model if isinstance(model, Model) else Model(model)
        self.n = _count(n, "n")
        varied = {name: array(values, (self.n,), f"parameter {name}") for name, values in (parameters or {}).items()}
        models = [model.replace(**{name: values[i] for name, values in varied.items()}) for i in range(self.n)] if varied else [model]
        system, chosen, settings, _ = models[0]._prepare(
            self.n, 3, method, t_end, step, rtol, atol, max_steps, energy, inputs, specialise)
        systems = [m._compile(inputs) for m in models] if varied else [system] * self.n
        if not all(s.has_columns_of(system, energy) for s in systems):
            raise lib.InputError("parameters: the vehicles must have the same bodies and elements")
        lanes = system.lanes() if settings.specialised and self.n > 1 and not adaptive(chosen) else None
        self._ensemble = Ensemble(systems, chosen, settings, _count(threads or os.cpu_count(), "threads"), lanes)
        self.inputs, self.states, self._settings = list(system.inputs), self._ensemble.states, settings
        self._initial_inputs, self._times = np.array(list(system.inputs.values())), self._ensemble.plan("t")
        self.random = [np.random.default_rng(seed) for seed in np.random.SeedSequence().spawn(self.n)]
        self.reset()

    def __enter__(self) -> VectorSimulation:
        return self

    def __exit__(self, *_):
        self.close()

    def close(self) -> None:
        """Frees the runs."""
        for i in range(self.n):
            self._ensemble.close(i)

    def reset(self, state=None, seed: int | None = None, which=None) -> None:
        """Starts vehicles again at time 0, with the initial inputs.

        Parameters
        ----------
        state : dict, array_like or callable, optional
            Initial values of states, numbers or arrays of shape (n,) by name, or an array of shape (n, len(states)); or a
            function of a vehicle's random generator that returns a dict of numbers.  Others are the model's.
        seed : int, optional
            Seeds the generators of all vehicles.
        which : array_like, optional
            Indices of vehicles, or booleans of shape (n,), such as ``failed``; by default, all.

        Raises
        ------
        InputError, InitialError
        """
        if seed is not None:
            self.random = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(self.n)]
        chosen = np.arange(self.n) if which is None else np.flatnonzero(which) if np.asarray(which).dtype == bool else np.asarray(which, int)
        changed = 0
        for i in chosen.tolist():
            run = self._ensemble.open(i, self._ensemble.numbers(self._state_of(state, i)))
            changed += lib.core.pw_run_initial(run.pointer).contents.released
        self._ensemble.input[chosen] = self._initial_inputs
        if changed:
            warnings.warn(f"initial values of {changed} vehicles were changed to satisfy the constraints", stacklevel=2)

    def _state_of(self, state, i):
        if callable(state):
            return state(self.random[i])
        if not hasattr(state, "items"):
            return None if state is None else array(state, (self.n, len(self.states)), "state")[i]
        return {name: values if np.ndim(values) == 0 else array(values, (self.n,), f"state {name}")[i] for name, values in state.items()}

    def step(self, inputs=None, dt: float | None = None) -> None:
        """Sets inputs and advances all vehicles that have not failed, as :meth:`Simulation.step` does one.

        Parameters
        ----------
        inputs : array_like, shape (n, len(inputs)), or (n,) if there is one; optional
        dt : float, optional
            [s]

        Raises
        ------
        InputError
        """
        if inputs is not None:
            given = self._ensemble.input
            given[:] = array(np.reshape(inputs, given.shape) if np.shape(inputs) == (self.n,) and given.shape[1] == 1 else inputs,
                             given.shape, "inputs")
        self._ensemble.step(duration(dt, self._settings.step))

    def observe(self, names=None) -> np.ndarray:
        """Columns at the times reached, as those of :meth:`Simulation.observe`; NaN for vehicles that have failed.

        Parameters
        ----------
        names : sequence of str, optional

        Returns
        -------
        ndarray, shape (n, len(names))
        """
        store, values, _ = self._ensemble.plan(self.states if names is None else names)
        store()
        return values

    @property
    def time(self) -> np.ndarray:
        """The times reached [s], shape (n,); NaN for vehicles that have failed."""
        store, values, _ = self._times
        store()
        return values[:, 0].copy()

    @property
    def failed(self) -> np.ndarray:
        """Whether each vehicle has failed, shape (n,)."""
        return self._ensemble.status != 0

    @property
    def reasons(self) -> dict:
        """Why vehicles have failed, by index."""
        return {i: self._ensemble.error(i) for i in np.flatnonzero(self.failed).tolist()}


def _count(value, what):
    number = lib.number(value, what, above=0)
    if number != int(number) or number > 2**31 - 1:
        raise lib.InputError(f"{what} = {value!r}: expected a whole number from 1 to 2147483647")
    return int(number)
