"""The samples of a run, as a table with named columns."""

from __future__ import annotations

import numpy as np

from . import _program
from ._figure import draw


class Result:
    """Samples of a run: a table whose columns have names and units.

    Attributes
    ----------
    t : ndarray, shape (samples,)
        Times [s].
    rows : ndarray, shape (samples, columns)
        All samples; ``result[name]`` is a view of one column.
    units : dict of str
        Unit of each column.
    states, reactions, outputs, ledger : list of str
        Names of columns: coordinates and velocities; reactions; outputs of the model; work and losses by element.
    status : {"ok", "stopped", "failed"}
        "stopped" by an exception of a handler of signals (Ctrl-C) or of ``progress``.
    reason : str
        Why the run ended early, or "".
    statistics : dict
        Numbers of steps and evaluations, the latter in all and by specialised code; largest constraint residuals.
    changed : dict of tuple
        Initial values that the constraints have changed: (described, consistent) by name of the state.
    error : dict of tuple or None
        Stated errors by column, at the end and the largest of the run, if :meth:`Model.run` was asked for them.
    error_unknown : str
        Why no errors can be stated, or "".
    events : list of dict
        Changes of constraint equations whose reactions have limits: t [s], reaction, from, to ("holds", "slides+",
        "slides-", "free") and, of an impact, impulse [N s, N m s].  Empty with the method moreau, which locates none.
    stopped : float or None
        The time at which the condition ``until`` became true [s].
    model : Model or None
        None in copies, and in other processes, if the model has functions in Python.
    settings : dict
        Method, t_end and the settings that were given.

    Notes
    -----
    The columns are those of ``pinwheel run -o``, and more: the time, residuals of the constraints, energies, then
    coordinates and velocities (``states``), accelerations (the velocity's name and '), positions of wheels and markers,
    reactions, outputs of the model and, with ``energy``, the ledger.
    """

    def __init__(self, rows, groups, units, status="ok", reason="", statistics=None, model=None, settings=None):
        self.rows = rows
        self.units = units
        self.status, self.reason, self.statistics = status, reason, statistics or {}
        self.model, self.settings = model, settings or {}
        self.states, self.reactions, self.ledger = groups["states"], groups["reactions"], groups["ledger"]
        self.outputs = groups.get("outputs", [])
        self.changed: dict[str, tuple[float, float]] = {}
        self.error: dict[str, tuple[float, float]] | None = None
        self.error_unknown = ""
        self.stopped: float | None = None
        self.events: list[dict] = []
        self._column = {name: i for i, name in enumerate(units)}
        self.t = rows[:, 0]

    def __getstate__(self):
        return {**self.__dict__, "model": None if self.model is not None and self.model.signals else self.model}

    def __getitem__(self, name: str) -> np.ndarray:
        """The column of this name, shape (samples,), without copying."""
        if not isinstance(name, str) or name not in self._column:
            raise KeyError(f"no column {name!r:.60}{_nearest(name, self._column)}")
        return self.rows[:, self._column[name]]

    def __contains__(self, name):
        return name in self._column

    def __iter__(self):
        return iter(self._column)

    def __len__(self):
        return len(self.rows)

    def keys(self):
        """The names of the columns."""
        return self._column.keys()

    _ipython_key_completions_ = keys

    def values(self):
        """The columns."""
        return [self[name] for name in self._column]

    def items(self):
        """Pairs of a name and its column."""
        return [(name, self[name]) for name in self._column]

    def get(self, name: str, default=None):
        """The column of this name, or the default if there is none.

        Parameters
        ----------
        name : str
        default : optional
        """
        return self[name] if name in self else default

    @property
    def final(self) -> dict:
        """The last sample, by name."""
        return dict(zip(self._column, self.rows[-1].tolist()))

    def to_dataframe(self):
        """A pandas DataFrame, indexed by time."""
        import pandas  # type: ignore[import]
        return pandas.DataFrame(self.rows[:, 1:], columns=list(self._column)[1:], index=pandas.Index(self.t, name="t"))

    def to_xarray(self):
        """An xarray Dataset over the time, with units as attributes."""
        import xarray
        return xarray.Dataset({n: ("t", self[n], {"units": self.units[n]}) for n in self._column if n != "t"},
                              coords={"t": ("t", self.t, {"units": "s"})})

    def plot(self, *names: str):
        """Draws the run with matplotlib.

        Parameters
        ----------
        *names : str
            Columns, each over the time, in one panel for each unit; by default: paths of bodies, wheels and markers, states,
            energies.  Vertical lines show events.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        KeyError
            For an unknown name, with the nearest one.
        ImportError
            If matplotlib is not installed.
        """
        return draw(self, names)

    def animate(self, path=None):
        """Writes a page with the animation, by repeating the run in the program.

        Parameters
        ----------
        path : str or path, optional
            The file, "run.html"; by default, notebooks show the page.

        Returns
        -------
        path, or the object that shows the page

        Raises
        ------
        InputError
            If the model has functions in Python, or inputs.
        """
        if path is not None:
            _program.write_animation(self, path)
            return path
        return _Page(_program.animation(self))

    def __repr__(self):
        end = f", {self.reason}" if self.reason else ""
        reached = f" to t = {self.t[-1]:.6g} s" if len(self) else ""
        return f"<{self.settings.get('method', 'run')}: {len(self)} samples{reached}, {self.status}{end}>"

    def _repr_html_(self) -> str:
        """In notebooks: the animation."""
        return _program.animation(self)


class _Page:
    """A text of HTML that notebooks show."""

    def __init__(self, text):
        self._text = text

    def _repr_html_(self):
        return self._text


def _nearest(name, names):
    """A hint for messages about an unknown name: the nearest one, else all if they are few, else ""."""
    import difflib
    near = difflib.get_close_matches(str(name), list(names), 1, 0.5)
    known = ", ".join(names)
    return f"; did you mean {near[0]!r}?" if near else f"; valid are {known}" if known and len(known) < 88 else ""
