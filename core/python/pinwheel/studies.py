"""Sweeps: runs for many values of parameters; and the commands of the program as functions."""

from __future__ import annotations

import concurrent.futures
import csv
import ctypes as c
import functools
import inspect
import itertools
import json
import os
import pathlib
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, Union, cast

import numpy as np

from . import _library as lib
from . import _program
from ._progress import watched
from .ensemble import Ensemble, columns
from .simulation import adaptive, specialised, warn_of_unused

# ---- Sweeps ----

# The function that a run asks whether to stop: the length of a text, which is empty until the runs are to stop.
_STRLEN = c.cast(c.CDLL(None).strlen, c.c_void_p).value


def _runs(model, points, starts, method, end, settings, lanes=False, error=False, stop=None):
    """Some points of a sweep, in blocks: units of columns by name; last samples, NaN of runs that failed; why these failed.

    Executors call it in threads or other processes.  starts: names of states among those varied; lanes: whether to use
    code for several runs at once; stop: a buffer, a text in which ends the runs.
    """
    stop, blocks, models = stop or c.create_string_buffer(1), [], []
    for parameters, group in itertools.groupby(points, lambda p: {n: x for n, x in p.items() if n not in starts}):
        models += [model.replace(**parameters)] * len(list(group))
    values = [{n: x for n, x in p.items() if n in starts} for p in points]
    while models:
        system, chosen, given, _ = models[0]._prepare(1, 0, method, end or None, **settings)
        alike = itertools.takewhile(lambda m: system.has_columns_of(m._compile(), given.ledger) and not system.in_python, models[1:])
        count = 1 if error else 1 + len(list(alike))
        given.stop, given.stop_context = _STRLEN, c.addressof(stop)
        blocks.append(_with_errors(models[0], values[0], method, end, settings, stop) if error else
                      _final([m._compile() for m in models[:count]], values[:count], chosen, given, end, system.lanes() if lanes else None))
        models, values = models[count:], values[count:]
    return blocks


def _final(systems, starts, method, settings, end, lanes):
    """A block of `_runs`, of systems with the same columns."""
    ensemble, reasons = Ensemble(systems, method, settings, lanes=lanes), [""] * len(systems)
    for i, start in enumerate(starts):
        try:
            ensemble.open(i, ensemble.numbers(start))
        except (lib.InitialError, lib.MethodError) as failure:
            reasons[i] = str(failure)
        except Exception as failure:
            reasons[i] = _reason(failure)
    try:
        ensemble.step(end)
    except Exception as failure:
        reasons[0] = _reason(failure)  # there is one run of a model with functions in Python
        ensemble.close(0)
    store, values, _ = ensemble.plan(ensemble.columns[0])
    store()
    return ensemble.columns[0], values, [why or ensemble.error(i) for i, why in enumerate(reasons)]


def _with_errors(model, start, method, end, settings, stop):
    """A block of `_runs`, of one run, with the stated errors of its states."""
    model = model.replace(start=start)
    units, groups = columns(model._compile().pointer, settings.get("energy"))
    units |= {f"error.{name}": units[name] for name in groups["states"]}
    failed = np.full((1, len(units)), np.nan)
    try:
        with model.open(method, t_end=end or None, **settings) as simulation:
            simulation._cancelled = lambda: bool(stop.value)
            result = simulation.record(end, times=np.linspace(0, end, 101))
            if result.status == "failed":
                return units, failed, [result.reason]
            simulation._state_error(result)
    except (lib.InitialError, lib.MethodError) as failure:
        return units, failed, [str(failure)]
    except Exception as failure:
        return units, failed, [_reason(failure)]
    stated = [(result.error or {}).get(name, (np.nan,))[0] for name in result.states]
    return units, np.array([[*result.rows[-1], *stated]]), [""]


def _reason(failure):
    """Why a function in Python has ended a run; raises what is none of its exceptions."""
    if reason := lib.raised_by_function(failure):
        return f"{reason}: {type(failure).__name__}: {failure}"
    raise failure


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


def _specialise(model, runs, method, end, settings):
    """The setting ``specialise`` of all runs, and whether to use lanes: both depend on the steps of the whole sweep, as in
    the program."""
    when, given = settings.pop("specialise", "auto"), lib.pw_settings()
    for name in ("step", "rtol"):
        setattr(given, name, model._setting(name, settings.get(name)))
    warn_of_unused(method, [name for name, value in settings.items() if value is not None], 3)
    steps = runs * lib.core.pw_method_steps(lib.encode(method, "method"), c.byref(given), model.defaults["step"], end)
    always = specialised(when, steps)
    return "always" if always else "never", always and steps >= 10 * lib.PW_SPECIALISE_STEPS and not adaptive(method)


def sweep(model, vary: dict, *, method: str | None = None, t_end: float | None = None,
          of=None, until: str | None = None, limit: float | None = None, executor: concurrent.futures.Executor | None = None,
          progress=None, error: bool = False, **settings):
    """Runs a model for all combinations of values; the last one varies fastest.

    Parameters
    ----------
    model : Model or str
    vary : dict of array_like
        Values of parameters and initial states: ``{"swing": [0.3, 0.6], "board.vx": np.linspace(0, 1, 5)}``.
    method, t_end, **settings
        As in :meth:`Model.run`.
    of : str or list of str, optional
        Outputs of the runs: "max:A.N", "events:stop", "event:stop", "at 2:board.x", "board.x / rider.work", ...
    until : str, optional
        A condition on columns, "car.x > 10", at whose instant a run ends.
    limit : float, optional
        Most processor time of a run [s].
    executor : concurrent.futures.Executor, optional
        Threads on all processors by default; process pools, Dask clients' and mpi4py's executors work too.
    progress : callable or bool, optional
        As in :meth:`Model.run`.
    error : bool
        Add the stated errors of the final states, "error.NAME", as :meth:`Model.run` states them.

    Returns
    -------
    xarray.Dataset or dict of ndarray
        Final values and outputs by name, with units, shape (len of each varied name); "failed" contains the reason of a
        run that failed, or "".

    Raises
    ------
    InputError
        For a value that the model refuses; runs that fail only leave NaN.

    Notes
    -----
    With of, until or limit the program makes the sweep, on all processors: without executor, progress, functions in Python.
    """
    names, values, points = _points(vary)
    if any(given is not None for given in (of, until, limit)):
        if executor is not None:
            raise lib.InputError("of, until and limit are for sweeps on all processors: they cannot be given together with executor")
        return _table(dict(zip(names, values)), _outputs(model, dict(zip(names, values)), {
            "of": of, "until": until, "limit": limit, "method": method, "t_end": t_end, "error": error, **settings}), model.units)
    end = model.defaults["t_end"] if t_end is None else lib.number(t_end, "t_end")
    method = model.defaults["method"] if method is None else method
    settings["specialise"], lanes = _specialise(model, len(points), method, end, dict(settings))
    pool, stop = executor or concurrent.futures.ThreadPoolExecutor(os.cpu_count()), c.create_string_buffer(2)
    own = {"stop": stop} if executor is None else {}  # it cannot be sent to other processes
    if not hasattr(pool, "submit"):
        raise lib.InputError(f"executor: expected a concurrent.futures.Executor, found {executor!r:.60}")
    try:
        system, quiet = model._compile().pointer, model.replace()
        quiet._warns_of, quiet._warns_of_unused = lib.core.pw_initial_given, False  # as the program does
        starts = {n for n in names if n not in model.parameters
                  and ("." in n or lib.core.pw_system_find_state(system, n.encode(), None) >= 0)}
        size = max(8 if lanes else 1, min(64, len(points) // (4 * (os.cpu_count() or 1))))  # runs in one call of the library
        pending = [pool.submit(_runs, quiet, points[i:i + size], starts, method, end, settings, lanes, error, **own)
                   for i in range(0, len(points), size)]
        with watched(progress) as report:
            blocks = [block for i, future in enumerate(pending) for block in (future.result(), report((i + 1) / len(pending)))[0]]
    finally:
        stop.value = b"x"
        if executor is None:
            pool.shutdown(cancel_futures=True)
    return _table(dict(zip(names, values)), blocks, model.units)


def _outputs(model, values, options):
    """What _runs returns, from the table of the program's sweep.  values: those varied, by name."""
    model = model.replace()
    for given in (model._given, model.start):
        for name in values.keys() & given:
            del given[name]
    with tempfile.TemporaryDirectory() as made:
        path = pathlib.Path(made) / "sweep.json"
        try:
            _report("sweep", model, (), {**options, "vary": {name: v.tolist() for name, v in values.items()}, "output": path}, False)
        except lib.Error:  # also if all runs have failed
            if not path.exists():
                raise
        table = {tuple(re.findall(r"(.*?)(?: \[(.*)\])?$", name)[0]): column for name, column in _json_of(path).items()}
    status, reasons = (table.pop((name, "")) for name in ("status", "reason"))
    units = dict(list(table)[len(values):])  # by name, without those varied
    rows = np.array([column for _, column in list(table.items())[len(values):]], float).T
    return [(units, rows, [why or "" if ended != "ok" else "" for ended, why in zip(status, reasons)])]


def _table(values, blocks, units):
    """The result of a sweep.  values: those varied, by name; blocks: results of _runs; units: those of parameters."""
    shape = [len(v) for v in values.values()]
    names = next((of for of, _, reasons in blocks if not all(reasons)), blocks[0][0])

    def column(name):
        return [rows[:, list(of).index(name)] if name in of else np.full(len(rows), np.nan) for of, rows, _ in blocks]

    table = {name: np.concatenate(column(name)).reshape(shape) for name in names}
    table["failed"] = np.array([why for *_, reasons in blocks for why in reasons], dtype=object).reshape(shape)
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
        for ``--hold=frame.vx=1``, ``free={"m": (0, 2)}`` for ``--free=m=0:2``, and in a sweep ``vary={"m": [0, 2]}`` for
        ``--vary=m=0,2``.  ``data`` may be a dict of arrays or a DataFrame.

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


# Parameters that several analyses have; a method's docstring describes the others.
_COMMON = {
    "method": "str, optional\n    Integrator and stabilisation; default: the model's.",
    "method_file": "path, optional\n    A method of your own, a file in C.",
    "t_end": "float, optional\n    Final time [s].",
    "step": "float, optional\n    Step size of methods with fixed steps [s].",
    "rtol": "float, optional\n    Relative tolerance of adaptive methods.",
    "atol": "float, optional\n    Absolute tolerance of every state.",
    "max_steps": "int, optional\n    Most attempted steps of adaptive methods.",
    "limit": "float, optional\n    Most processor time of a run, or of a search for motions [s].",
    "jobs": "int, optional\n    Number of concurrent runs; default: one for each processor.",
    "specialise": '{"auto", "always", "never"}, optional\n    When to compile code for this model alone.',
    "until": "str, optional\n    A condition at whose instant runs end.",
    "starts": "int, optional\n    Number of points from which to search.",
    "vary": 'dict, optional\n    A parameter, and its first and last value: ``{"m1": (1, 5)}``.',
    "methods": 'str or list of str, optional\n    Methods, "rk4+all".',
    "output": "path, optional\n    A table to write: .csv, .npz or .json.",
    "plots": "path, optional\n    A folder for figures.",
    "width": 'str, optional\n    Width of figures, "85mm".',
}
_RETURNS = "dict\n    The command's JSON."
_TABLE = "dict\n    Columns of the table: arrays of shape (rows,), with units in their names."
_RAISES = "InputError, InitialError, MethodError, ResourceError\n    With the program's message."

_Method = TypeVar("_Method", bound=Callable[..., Any])


def _analysis(function: _Method) -> _Method:
    """A method that runs the command of its name; each argument that is not None is the option of its name.

    Its docstring begins with what it does and the parameters that are not in _COMMON; the rest is added.
    """
    signature = inspect.signature(function)
    name = function.__name__

    @functools.wraps(function)
    def method(self, *arguments, **options):
        try:
            given = signature.bind(self, *arguments, **options).arguments
        except TypeError as failure:
            raise lib.InputError(f"{name}: {failure}; see help(pinwheel.Model.{name})") from None
        del given["self"]
        return _report(name, self, (), given, tables=True)

    about, _, described = inspect.cleandoc(function.__doc__ or "").partition("\n\n")
    own = re.findall(r"\w+", " ".join(line.split(" : ")[0] for line in described.splitlines() if " : " in line))
    listed = [described] * bool(described) + [f"{p} : {_COMMON[p]}" for p in signature.parameters if p != "self" and p not in own]
    returned = _TABLE if name in ("compare", "drift") else _RETURNS
    sections = {"Parameters": "\n".join(listed), "Returns": returned, "Raises": _RAISES}
    method.__doc__ = "\n\n".join([about] + [f"{title}\n{'-' * len(title)}\n{text}" for title, text in sections.items() if text])
    return cast(_Method, method)


_Names = Union[str, Sequence[str]]
_Free = Union[_Names, Mapping[str, Any]]
_Path = Union[str, "os.PathLike[str]"]


class Analyses:
    """Analyses of a model: they run the program's commands of the same names, with its parameters and initial values."""

    @_analysis
    def check(self) -> dict:  # type: ignore[empty-body]
        """Checks mobility, redundancy, initial conditions, derivatives and stability."""

    @_analysis
    def compare(self, *, methods: _Names | None = None, method_file: _Path | None = None,  # type: ignore[empty-body]
                t_end: float | None = None, limit: float | None = None, repeats: int | None = None, jobs: int | None = None,
                rtol_ladder: tuple | str | None = None, step_ladder: tuple | str | None = None, reference: _Path | None = None,
                specialise: str | None = None, output: _Path | None = None, plots: _Path | None = None, width: str | None = None) -> dict:
        """Compares the accuracy and cost of methods against a reference solution.

        repeats : int, optional
            Timed repetitions of each run.
        rtol_ladder, step_ladder : pair of float, optional
            First and last tolerance of adaptive methods, and step of others.
        reference : path, optional
            A table with which runs are compared.
        """

    @_analysis
    def drift(self, *, methods: _Names | None = None, method_file: _Path | None = None,  # type: ignore[empty-body]
              t_end: float | None = None, step: float | None = None, rtol: float | None = None, max_steps: int | None = None,
              limit: float | None = None, jobs: int | None = None, vary: Mapping[str, Any] | None = None,
              only_methods: bool = False, specialise: str | None = None, output: _Path | None = None,
              plots: _Path | None = None, width: str | None = None) -> dict:
        """Compares the drift of constraints and energy in long runs, by stabilisation.

        vary : dict, optional
            Values of an option of stabilisations: ``{"alpha": [1, 10]}``.
        only_methods : bool
            Leave out how drift depends on options.
        """

    @_analysis
    def steady(self, *, hold: Mapping[str, float] | None = None, vary: Mapping[str, Any] | None = None,  # type: ignore[empty-body]
               starts: int | None = None, at: float | None = None, limit: float | None = None, output: _Path | None = None,
               plots: _Path | None = None, width: str | None = None) -> dict:
        """Finds steady motions, and follows them over a parameter or a held value.

        hold : dict, optional
            Values of states, or of BODY.speed, .radius or .curvature, that the motions have.
        at : float, optional
            Time at which signals are evaluated [s].
        """

    @_analysis
    def periodic(self, *, period: float | str | None = None, periods: int | None = None,  # type: ignore[empty-body]
                 guess: float | None = None, vary: Mapping[str, Any] | None = None, method: str | None = None,
                 method_file: _Path | None = None, rtol: float | None = None, limit: float | None = None,
                 output: _Path | None = None, plots: _Path | None = None, width: str | None = None) -> dict:
        """Finds periodic motions, and follows them over a parameter.

        period : float or "free", optional
            [s]; by default that of the signals.
        periods : int, optional
            Number of periods of the signals after which the motion repeats.
        guess : float, optional
            First guess of a free period [s].
        """

    @_analysis
    def sensitivity(self, of: _Names, by: _Names, *, every: float | None = None,  # type: ignore[empty-body]
                    until: str | None = None, method: str | None = None, method_file: _Path | None = None,
                    t_end: float | None = None, step: float | None = None, rtol: float | None = None, atol: float | None = None,
                    max_steps: int | None = None, limit: float | None = None, jobs: int | None = None,
                    specialise: str | None = None, output: _Path | None = None, plots: _Path | None = None,
                    width: str | None = None) -> dict:
        """Differentiates outputs of a run with respect to parameters and initial values.

        of : str or list of str
            Columns at the end, or outputs such as "max:board.x".
        by : str or list of str
            Parameters, initial values of states.
        every : float, optional
            Time between rows of the table [s], which ``output`` writes.
        """

    @_analysis
    def fit(self, data, columns: _Names, free: _Free, *, sigma: Mapping[str, Any] | None = None,  # type: ignore[empty-body]
            confidence: float | None = None, starts: int | None = None, time: str | None = None,
            time_scale: float | None = None, time_offset: float | None = None, method: str | None = None,
            method_file: _Path | None = None, t_end: float | None = None, step: float | None = None, rtol: float | None = None,
            atol: float | None = None, max_steps: int | None = None, limit: float | None = None, jobs: int | None = None,
            specialise: str | None = None, output: _Path | None = None, plots: _Path | None = None, width: str | None = None) -> dict:
        """Fits parameters and initial values to measured data, up to t_end if that is given.

        data : dict of arrays, DataFrame or path
            Times "t", and columns with the names of results; NaN: not measured.
        columns : str or list of str
            The columns of the data to compare; also numbers that a run yields, such as "event 2:floor", without times.
        free : dict, str or list of str
            Unknowns, with bounds: ``{"l": (0.5, 2)}`` or ``(0.5, 2, "log")``; None: without.
        sigma : dict, optional
            Standard deviations of columns: numbers, or names of columns of the data.
        confidence : float, optional
            Probability of confidence intervals.
        time : str, optional
            Column of the times.
        time_scale, time_offset : float, optional
            Factor of these times, and what is added to them [s].
        """

    @_analysis
    def optimise(self, free: _Free, *, maximise: str | None = None, minimise: str | None = None,  # type: ignore[empty-body]
                 subject_to: _Names | None = None, starts: int | None = None, seed: int | None = None, until: str | None = None,
                 method: str | None = None, method_file: _Path | None = None, t_end: float | None = None,
                 step: float | None = None, rtol: float | None = None, atol: float | None = None, max_steps: int | None = None,
                 limit: float | None = None, jobs: int | None = None, specialise: str | None = None,
                 output: _Path | None = None, plots: _Path | None = None, width: str | None = None) -> dict:
        """Finds the parameters for which an output is largest or smallest.

        free : dict, str or list of str
            Unknowns, with bounds: ``{"theta": (-1, 1)}``.
        maximise, minimise : str
            One of them: an output such as "max:bob.vx", or an expression of outputs.
        subject_to : str or list of str, optional
            Constraints, "max:B.Fx <= 10".
        seed : int, optional
            Seed of the choice of starts.
        output : path, optional
            A file .yaml to write, with the optimum.
        """


def _report(name, model, arguments, options, tables):
    """What a command writes: its JSON; its table, if requested; or the text that it prints."""
    described = help_of(name)
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        words = [name, *_program.options(model), *map(str, arguments)]
        words += [word for key, value in options.items() for word in _words(name, key, value, folder)]
        wanted = _output(name, described, folder, tables)
        if wanted and not any(word.split("=")[0] in ("-o", wanted.split("=")[0]) for word in words):
            words.append(wanted)
        text = _program.run(words).stdout
        report, table = folder / f"{name}.json", pathlib.Path(options.get("output") or folder / f"{name}.csv")
        if report.exists():
            return _json_of(report)
        return _columns(table) if tables and table.exists() else text


def _json_of(path):
    return json.loads(path.read_text(encoding="utf-8"))


def _output(name, described, folder, tables):
    """The option, found in the command's help, that makes it write to the folder; None if it has none."""
    if "--json" in described:
        return f"--json={folder / name}.json"
    if tables and "-o, --output=FILE.csv" in described:
        return f"--output={folder / name}.csv"
    return None


_LISTS = (list, tuple, np.ndarray)


def _words(name, key, value, folder):
    """An option of a command as arguments."""
    option = "--" + key.replace("_", "-")
    if key == "data" and not isinstance(value, (str, os.PathLike)):
        value = _write_columns(folder / "data.csv", value)
    if value is None or value is False:
        return []
    if hasattr(value, "items"):
        return [f"{option}={item}" + ("" if x is None else f"={_value(name, x)}") for item, x in value.items()]
    if key in ("columns", "methods") or key.endswith("_ladder"):
        value = value if isinstance(value, str) else (":" if key.endswith("_ladder") else ",").join(map(str, value))
    return [option if item is True else f"{option}={item}" for item in (value if isinstance(value, _LISTS) else [value])]


def _value(name, x):
    """A value of an option: a range as LOW:HIGH, the values of a list of a sweep one by one."""
    separator = "," if name == "sweep" and not isinstance(x, tuple) else ":"
    return separator.join(map(str, x)) if isinstance(x, _LISTS) else str(x)


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
