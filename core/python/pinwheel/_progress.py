"""Progress bars."""

from __future__ import annotations

import contextlib
import sys
import time


def _in_notebook() -> bool:
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and hasattr(shell, "kernel")


def _remaining(done, seconds):
    """Percentage and time remaining; done: fraction of the work; seconds: time elapsed."""
    return f"{100 * done:.0f} %, {seconds * (1 / done - 1):.0f} s remaining" if done > 0 else ""


class _Page:
    """A bar in a notebook's page."""

    def __init__(self):
        from IPython import display  # type: ignore[import]
        self._html = display.HTML
        self._shown = display.display(self._html(""), display_id=True)

    def show(self, done, seconds):
        self._shown.update(self._html(f'<progress value="{done:.3f}"></progress> {_remaining(done, seconds)}'))

    def close(self):
        self._shown.update(self._html(""))


class _Terminal:
    """A line on standard error."""

    @staticmethod
    def show(done, seconds):
        sys.stderr.write(f"\r[{'#' * round(30 * done):30}] {_remaining(done, seconds)}\033[K")
        sys.stderr.flush()

    @staticmethod
    def close():
        sys.stderr.write("\r\033[K")


@contextlib.contextmanager
def watched(progress):
    """Yields a function to call with the fraction done.  Bars appear after half a second and are removed at the end.

    Parameters
    ----------
    progress : callable, bool or None
        A function: yielded itself; True: a bar; None: a bar in notebooks only; False: nothing.
    """
    if callable(progress):
        yield progress
        return
    bar, began, shown = None, time.monotonic(), 0.0

    def report(done):
        nonlocal bar, shown
        seconds = time.monotonic() - began
        if seconds < 0.5 or seconds < shown + 0.2:
            return
        bar, shown = bar or (_Page() if _in_notebook() else _Terminal()), seconds
        bar.show(done, seconds)

    try:
        yield report if progress or (progress is None and _in_notebook()) else lambda done: None
    finally:
        if bar:
            bar.close()
