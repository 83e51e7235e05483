"""Sweeps: runs for many values of parameters; and the commands of the program as functions."""

from __future__ import annotations

import concurrent.futures
import csv
import ctypes as c
import itertools
import json
import os
import pathlib
import tempfile
import threading

import numpy as np

from . import _library as lib
from . import _program
from ._progress import watched
from .simulation import columns, specialised, warn_of_unused

# ---- Sweeps ----

def _final(model, parameters, start, method, t_end, settings, error=False, cancelled=None):
    """The last sample of one run, {} if it failed; the units of its columns; why it failed, or "".

    Executors call it in threads or other processes; cancelled: a function that says whether to stop.
    """
    varied = model.replace(start=start, **parameters)
    varied._warns_of, varied._warns_of_unused = lib.core.pw_initial_given, False  # as the program does
    end = varied.defaults["t_end"] if t_end is None else t_end
    units, _ = columns(varied._compile()[0].pointer, settings.get("energy"))
    try:
        with varied.open(method, t_end=end or None, **settings) as simulation:
            simulation._cancelled = cancelled or simulation._cancelled
            if not error:
                simulation.advance(end)
                return simulation.sample(), units, ""
            result = simulation.record(end, times=np.linspace(0, end, 101))
            if result.status == "failed":
                return {}, units, result.reason
            simulation._state_error(result)
            stated = {f"error.{name}": (result.error or {}).get(name, (np.nan,))[0] for name in result.states}
            return result.final | stated, units | {f"error.{name}": units[name] for name in result.states}, ""
    except (lib.InitialError, lib.MethodError) as failure:
        return {}, units, str(failure)
    except Exception as failure:
        if not (reason := lib.raised_by_function(failure)):
            raise
        return {}, units, f"{reason}: {type(failure).__name__}: {failure}"


def _points(vary):
    """Names, their values, and all combinations as dicts."""
    if not hasattr(vary, "items"):
        raise lib.InputError(f"vary: expected a dict of values by name, found {vary!r:.60}")
    names, values = [lib.encode(name, "vary").decode() for name in vary], []
    for name, given in vary.items():
        each = [lib.number(x, name) for x in np.atleast_1d(np.asarray(given)).tolist()] if np.ndim(given) < 2 else []
        if not each:
            raise lib.InputError(f"vary {name}: expected a number or an array of shape (n,), found shape {np.shape(given)}")
        values.append(np.array(each))
    return names, values, [dict(zip(names, map(float, point))) for point in itertools.product(*values)]


def _specialise(model, runs, method, t_end, settings):
    """The setting ``specialise`` of all runs, which depends on the steps of the whole sweep, as in the program."""
    when, given = settings.pop("specialise", "auto"), lib.pw_settings()
    for name in ("step", "rtol"):
        setattr(given, name, model._setting(name, settings.get(name)))
    method = model.defaults["method"] if method is None else method
    warn_of_unused(method, [name for name, value in settings.items() if value is not None], 3)
    end = model.defaults["t_end"] if t_end is None else t_end
    steps = runs * lib.core.pw_method_steps(lib.encode(method, "method"), c.byref(given), model.defaults["step"], end)
    return "always" if specialised(when, steps) else "never"


def sweep(model, vary: dict, *, method: str | None = None, t_end: float | None = None,
          executor: concurrent.futures.Executor | None = None, progress=None, error: bool = False, **settings):
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
    progress : callable or bool, optional
        As in :meth:`Model.run`.
    error : bool
        Add the stated errors of the final states, "error.NAME", as :meth:`Model.run` states them.

    Returns
    -------
    xarray.Dataset or dict of ndarray
        Final values by name, with units, shape (len of each varied name); "failed" contains the reason of a run that
        failed, or "".

    Raises
    ------
    InputError
        For a value that the model refuses; runs that fail only leave NaN.
    """
    names, values, points = _points(vary)
    t_end = None if t_end is None else lib.number(t_end, "t_end")
    settings["specialise"] = _specialise(model, len(points), method, t_end, dict(settings))
    pool, cancelled = executor or concurrent.futures.ThreadPoolExecutor(os.cpu_count()), threading.Event()
    watch = [cancelled.is_set] if executor is None else []  # it cannot be sent to other processes
    if not hasattr(pool, "submit"):
        raise lib.InputError(f"executor: expected a concurrent.futures.Executor, found {executor!r:.60}")
    try:
        system = model._compile()[0].pointer
        starts = {n for n in names if n not in model.parameters
                  and ("." in n or lib.core.pw_system_find_state(system, n.encode(), None) >= 0)}
        pending = [pool.submit(_final, model, {n: x for n, x in p.items() if n not in starts},
                               {n: x for n, x in p.items() if n in starts}, method, t_end, settings, error, *watch)
                   for p in points]
        with watched(progress) as report:
            rows = [(future.result(), report((i + 1) / len(pending)))[0] for i, future in enumerate(pending)]
    finally:
        cancelled.set()
        if executor is None:
            pool.shutdown(cancel_futures=True)
    return _table(dict(zip(names, values)), rows, model.units)


def _table(values, rows, units):
    """The result of a sweep.  values: those varied, by name; rows: results of _final; units: those of parameters."""
    shape = [len(v) for v in values.values()]
    names = next((of for row, of, _ in rows if row), rows[0][1])
    table = {name: np.array([row.get(name, np.nan) for row, _, _ in rows]).reshape(shape) for name in names}
    table["failed"] = np.array([why for _, _, why in rows], dtype=object).reshape(shape)
    try:
        import xarray
    except ImportError:
        return {**table, **values}
    data = xarray.Dataset({name: (list(values), column) for name, column in table.items() if name not in values}, coords=values)
    for name, unit in {**names, **units}.items():
        if name in data.variables:
            data[name].attrs["units"] = unit
    return data


# ---- The program ----

def command(name: str, model, *arguments, **options):
    """Runs a command of the program and returns what it writes.

    Parameters
    ----------
    name : str
        "check", "linearise", "steady", "periodic", ...; see ``pinwheel --help``.
    model : Model or str
    *arguments, **options
        Further arguments and options of the command, see :func:`help_of`: ``t_end=10`` stands for ``--t-end=10``,
        ``energy=True`` for ``--energy``; a list repeats the option, and so does a dict: ``hold={"frame.vx": 1}`` stands
        for ``--hold=frame.vx=1``, and ``free={"m": (0, 2)}`` for ``--free=m=0:2``.  ``data`` may be a dict of arrays or a
        DataFrame.

    Returns
    -------
    dict or str
        The JSON of commands that have one, otherwise the text that the command prints.

    Raises
    ------
    InputError, InitialError, MethodError, ResourceError
        With the program's message.

    Examples
    --------
    >>> pw.command("check", "n-trailer")["mobility"]
    >>> print(pw.command("compare", "ezyroller", t_end=10, methods="rk4+projection,ida+ggl"))
    """
    return _report(name, model, arguments, options, tables=False)


def help_of(name: str) -> str:
    """The options of a command of the program, as ``pinwheel NAME --help`` prints them."""
    return _program.run([lib.encode(name, "command").decode(), "--help"]).stdout


_SUMMARIES = {
    "check": "Checks mobility, redundancy, initial conditions, derivatives and stability.",
    "compare": "Compares the accuracy and cost of methods against a reference solution.",
    "drift": "Compares the drift of constraints and energy in long runs, by stabilisation.",
    "steady": "Finds steady motions, and follows them over a parameter.",
    "periodic": "Finds periodic motions, and follows them over a parameter.",
    "sensitivity": "Differentiates outputs of a run with respect to parameters and initial values.",
    "fit": "Fits parameters and initial values to measured data.",
    "optimise": "Finds the parameters for which an output is largest or smallest.",
}
_RETURNS = dict.fromkeys(("compare", "drift"), "Columns of the table: arrays of shape (rows,), with units in their names.")


def analysis(name):
    """The method of :class:`Model` that runs a command of the program."""

    def method(self, *arguments, **options):
        return _report(name, self, arguments, options, tables=True)

    method.__name__, method.__qualname__, method.__module__ = name, f"Model.{name}", "pinwheel"
    method.__doc__ = f"""{_SUMMARIES[name]}

        Runs ``pinwheel {name}`` with this model, its parameters and initial values.

        Parameters
        ----------
        *arguments, **options
            Options of the command, see ``print(pw.help_of("{name}"))``; for their form see :func:`command`.

        Returns
        -------
        dict
            {_RETURNS.get(name, "The command's JSON.")}

        Raises
        ------
        InputError, InitialError, MethodError, ResourceError
            With the program's message.
        """
    return method


def _report(name, model, arguments, options, tables):
    """What a command writes: its JSON; its table, if requested; or the text that it prints."""
    described = help_of(name)
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        words = [name, *_program.options(model), *map(str, arguments)]
        words += [word for key, value in options.items() for word in _words(key, value, folder)]
        wanted = _output(name, described, folder, tables)
        if wanted and not any(word.split("=")[0] in ("-o", wanted.split("=")[0]) for word in words):
            words.append(wanted)
        text = _program.run(words).stdout
        report, table = folder / f"{name}.json", folder / f"{name}.csv"
        if report.exists():
            return json.loads(report.read_text(encoding="utf-8"))
        return _columns(table) if tables and table.exists() else text


def _output(name, described, folder, tables):
    """The option, found in the command's help, that makes it write to the folder; None if it has none."""
    if "--json" in described:
        return f"--json={folder / name}.json"
    if "-o, --name=NAME" in described:
        return f"--name={folder / name}"
    if "-o, --output=DIR" in described and (tables or f"{name}.json" in described):
        return f"--output={folder}"
    return None


_LISTS = (list, tuple, np.ndarray)


def _words(key, value, folder):
    """An option as arguments."""
    option = "--" + key.replace("_", "-")
    if key == "data" and not isinstance(value, (str, os.PathLike)):
        value = _write_columns(folder / "data.csv", value)
    if value is None or value is False:
        return []
    if hasattr(value, "items"):
        return [f"{option}={name}={_value(x)}" for name, x in value.items()]
    return [option if item is True else f"{option}={item}" for item in (value if isinstance(value, _LISTS) else [value])]


def _value(x):
    """A value of an option: a range as LOW:HIGH."""
    return ":".join(map(str, x)) if isinstance(x, _LISTS) else str(x)


def _write_columns(path, columns):
    """Writes a dict of arrays or a DataFrame as a CSV table; NaN: an empty cell."""
    try:
        names = list(columns)
        rows = np.column_stack([np.asarray(columns[name], float) for name in names])
    except (TypeError, ValueError, KeyError, IndexError) as failure:
        raise lib.InputError(f"data: expected the path of a table or a dict of arrays of one length: {failure}") from None
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([["" if np.isnan(x) else repr(x) for x in row] for row in rows.tolist()])
    return path


def _columns(path):
    """The columns of a CSV table by name, without lines that begin with #."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    return {name: _array([row[i] for row in rows[1:]]) for i, name in enumerate(rows[0])}


def _array(cells):
    try:
        return np.array([cell or "nan" for cell in cells], float)
    except ValueError:
        return np.array(cells)
