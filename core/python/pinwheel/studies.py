"""Many runs, and the commands of the program."""

from __future__ import annotations

import concurrent.futures
import itertools
import json
import os
import pathlib
import tempfile

import numpy as np

from . import _library as lib
from . import _program
from .model import Model


# ---- Sweeps ----

def _final(model, parameters, start, method, t_end, settings):
    """The last sample of one run; NaN if it fails.  Not nested, so that other processes can call it."""
    varied = model.replace(start=start, **parameters)
    end = t_end if t_end is not None else varied.defaults["t_end"]
    with varied.open(method, t_end=end, **settings) as simulation:
        try:
            simulation.advance(end)
        except lib.Error as failure:
            return {}, str(failure)
        return simulation.sample(), ""


def sweep(model, vary, *, method=None, t_end=None, executor=None, **settings):
    """Runs a model for all combinations of values; the last one varies fastest.

    Parameters
    ----------
    model : Model or str
    vary : dict of array_like
        Values of parameters and initial states: ``{"swing": [0.3, 0.6], "board.vx": np.linspace(0, 1, 5)}``.
    method, t_end, **settings
        As in :meth:`Model.run`.
    executor : concurrent.futures.Executor, optional
        Threads on all processors by default; process pools, Dask clients' and mpi4py's executors work too.

    Returns
    -------
    xarray.Dataset or dict of ndarray
        Final values by name, shape (len of each varied name); "failed" contains the reason of a run that failed, or "".
    """
    model = model if isinstance(model, Model) else Model(model)
    names, values = list(vary), [np.atleast_1d(np.asarray(v, float)) for v in vary.values()]
    points = [dict(zip(names, map(float, point))) for point in itertools.product(*values)]
    own = executor is None
    pool = concurrent.futures.ThreadPoolExecutor(os.cpu_count()) if own else executor
    try:
        pending = [pool.submit(_final, model, {n: x for n, x in p.items() if n in model.parameters},
                               {n: x for n, x in p.items() if n not in model.parameters}, method, t_end, settings) for p in points]
        rows = [future.result() for future in pending]
    finally:
        if own:
            pool.shutdown(cancel_futures=True)
    shape = [len(v) for v in values]
    columns = next((row for row, _ in rows if row), {})
    table = {name: np.array([row.get(name, np.nan) for row, _ in rows]).reshape(shape) for name in columns}
    table["failed"] = np.array([why for _, why in rows], dtype=object).reshape(shape)
    try:
        import xarray
    except ImportError:
        return {**dict(zip(names, values)), **table}
    return xarray.Dataset({name: (names, column) for name, column in table.items() if name not in names},
                          coords=dict(zip(names, values)))


# ---- The program ----

def command(name, model, *arguments, **options):
    """Runs a command of the program and returns what it writes.

    Parameters
    ----------
    name : str
        "check", "compare", "drift", "steady", ...; see ``pinwheel --help``.
    model : Model or str
    *arguments, **options
        Further arguments; ``t_end=10`` stands for ``--t-end=10``, ``energy=True`` for ``--energy``, a list repeats the option.

    Returns
    -------
    dict or str
        The JSON of commands that have ``--json``, otherwise the text that the command prints.

    Examples
    --------
    >>> pw.command("check", "n-trailer")["..."]
    >>> print(pw.command("compare", "ezyroller", t_end=10, methods="rk4+projection,ida+ggl"))
    """
    words = [name, *_program.options(model), *map(str, arguments)]
    for key, value in options.items():
        option = "--" + key.replace("_", "-")
        for item in value if isinstance(value, (list, tuple)) else [value]:
            words.append(option if item is True else f"{option}={item}")
    if "--json" in _program.run([name, "--help"]).stdout:
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "report.json"
            _program.run([*words, f"--json={path}"])
            return json.loads(path.read_text(encoding="utf-8"))
    return _program.run(words).stdout
