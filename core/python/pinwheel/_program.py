"""Runs the program ``pinwheel``, for commands and pages that are not in the library."""

from __future__ import annotations

import html
import pathlib
import subprocess
import tempfile

from . import _library as lib


def options(model):
    """The arguments that name a model (a Model or its name), with its parameters and initial values."""
    given = [lib.encode(str(getattr(model, "source", model)), "model").decode()]
    if hasattr(model, "signals"):
        if model.signals:
            raise lib.InputError("the program cannot evaluate functions in Python: describe the signal by an expression")
        given += [f"--set={name}={value!r}" for name, value in model._given.items()]
        given += [f"--start={name}={value!r}" for name, value in model.start.items()]
    return given


def run(arguments):
    """Runs the program and returns the finished process; raises the exception of its exit status, unless that is 130, of a
    command that Ctrl-C has stopped."""
    try:
        done = subprocess.run([lib.program(), *arguments], capture_output=True, text=True, check=False)
    except ValueError as failure:
        raise lib.InputError(f"an argument of pinwheel {arguments[0]}: {failure}") from None
    except OSError as failure:
        raise lib.ResourceError(f"{lib.program()} cannot be run: {failure}; install it, or name it in PINWHEEL") from None
    if done.returncode not in (0, 130):
        lines = done.stderr.strip().removeprefix("pinwheel: ")
        raise lib._EXCEPTIONS.get(-done.returncode, lib.Error)(lines or f"pinwheel ended with status {done.returncode}")
    return done


def _animated(result):
    """The arguments that repeat a run; InputError if the program cannot."""
    given = result.settings
    if result.model is None:
        raise lib.InputError("the copy of a result has no functions in Python")
    if "inputs" in given:
        raise lib.InputError("the program cannot set inputs")
    return [*options(result.model), f"--method={given['method']}", f"--t-end={given['t_end']!r}",
            f"--specialise={given.get('specialise', 'auto')}"] + [f"--{name}={given[name]!r}" for name in ("step", "rtol", "atol") if name in given]


def write_animation(result, path) -> None:
    """Writes the page that animates a run of the result's model and settings."""
    run(["run", *_animated(result), f"--animate={path}"])


def animation(result) -> str:
    """An HTML frame that animates a run of the result's model and settings; a text with the reason if there is none."""
    return _page(lambda path: write_animation(result, path), repr(result))


def interactive(model) -> str:
    """An HTML frame with the page that simulates a model in the browser; a text with the reason if there is none."""
    return _page(lambda path: run(["page", *options(model), f"--output={path}"]), repr(model))


def _page(write, otherwise):
    """An HTML frame with the page that a function writes to a path; if it fails, `otherwise` and the reason."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "page.html"
        try:
            write(path)
            page = path.read_text(encoding="utf-8")
        except (lib.Error, OSError) as failure:
            return html.escape(f"{otherwise}, not shown: {failure}")
    return f'<iframe srcdoc="{html.escape(page)}" style="width: 100%; height: 40em; border: 0"></iframe>'
