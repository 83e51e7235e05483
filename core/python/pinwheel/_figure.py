"""Figures of results, with matplotlib."""

from __future__ import annotations

import numpy as np

_ENERGIES = ("kinetic", "potential", "work", "loss", "balance")


def draw(result, names):
    """A figure of these columns, or of paths, states and energies: see :meth:`Result.plot`."""
    import matplotlib.pyplot as plt
    paths = [] if names else _paths(result)
    panels = _by_unit(result, names or [n for n in result.states if n not in {axis for path in paths for axis in path}])
    energies = [] if names else [n for n in _ENERGIES if np.nanmax(np.abs(result[n]), initial=0) > 0]
    count = bool(paths) + len(panels) + bool(energies)
    rows = (count + 1) // 2 if count > 2 else 1
    figure, axes = plt.subplots(rows, -(-count // rows), figsize=(5 * -(-count // rows), 3.2 * rows), squeeze=False, layout="constrained")
    free = iter(axes.flat)
    if paths:
        _draw_paths(next(free), result, paths)
    for unit, columns in panels.items():
        _draw_columns(next(free), result, columns, unit)
    if energies:
        _draw_columns(next(free), result, energies, "J")
    for unused in free:
        unused.remove()
    title = getattr(result.model, "name", "")
    figure.suptitle(" ".join(filter(None, [title, result.settings.get("method"), result.reason])))
    return figure


def _paths(result):
    """Pairs of columns that are coordinates of a point."""
    return [(name, name[:-1] + "y") for name in result if name.endswith(".x") and name[:-1] + "y" in result and result.units[name] == "m"]


def _by_unit(result, names):
    panels: dict = {}
    for name in names:
        result[name]  # KeyError
        panels.setdefault(result.units[name], []).append(name)
    return panels


def _legend(axes, count):
    if count <= 12:
        axes.legend(fontsize="small", ncols=1 + (count > 6))


def _draw_paths(axes, result, paths):
    for x, y in paths:
        line, = axes.plot(result[x], result[y], label=x[:-2])
        axes.plot(result[x][:1], result[y][:1], "o", markersize=4, color=line.get_color())
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="paths, from the dots")
    _legend(axes, len(paths))


def _draw_columns(axes, result, names, unit):
    few = len(result) < 2
    for name in names:
        axes.plot(result.t, result[name], "o" if few else "-", label=name)
    for i, event in enumerate(e for e in result.events if len(result) and e["t"] <= result.t[-1]):
        axes.axvline(event["t"], color="0.5", linewidth=0.8, linestyle=":" if event["impulse"] is None else "--", label=None if i else "event")
    axes.set(xlabel="t [s]", ylabel=f"[{unit}]" if unit else "")
    _legend(axes, len(names))
