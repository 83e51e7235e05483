"""The documentation: every snippet runs, docstrings are complete, the notebook and the script do what they say."""

import inspect
import json
import os
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import pinwheel as pw
from pinwheel import _library as lib
from pinwheel import _progress

TOP = pathlib.Path(__file__).resolve().parents[2]


def snippets(name):
    return re.findall(r"^```python\n(.*?)^```", (TOP / "docs" / name).read_text(encoding="utf-8"), re.S | re.M)


def test_snippets_of_the_page(tmp_path, monkeypatch):
    """In one session, from the first to the last, as a reader types them."""
    for module in ("pandas", "xarray"):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    scope, found = {}, snippets("python.md")
    assert len(found) >= 5
    for snippet in found:
        exec(snippet, scope)  # noqa: S102: the documentation of this repository


def test_notebook():
    cells = json.loads((TOP / "docs/pinwheel.ipynb").read_text(encoding="utf-8"))["cells"]
    scope = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), scope)  # noqa: S102: the notebook of this repository


def test_script_has_the_table_of_the_readme(tmp_path):
    """Counts are equal, measured errors within rounding and the compiler's arithmetic."""
    pytest.importorskip("matplotlib")
    script = TOP / "docs/python.py"
    assert len(script.read_text().splitlines()) <= 25
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, cwd=tmp_path,
                          env={**os.environ, "MPLBACKEND": "agg"})
    assert (tmp_path / "work-precision.png").stat().st_size > 5000
    expected = dict(re.findall(r"^    ((?:rk4|ida)\+\S+) (.*)$", (TOP / "README.md").read_text(), re.M))
    assert len(expected) == 3
    for line in done.stdout.splitlines()[1:]:
        method, numbers = line.split()[0], [float(x) for x in line.split()[1:]]
        listed = [float(x) for x in re.sub(r"^.*?(h = \S+ s|rtol \S+)", "", expected[method]).replace("|", "").split()]
        assert numbers[:2] == listed[:2]
        assert np.allclose(np.log10(numbers[2:7]), np.log10(listed[2:7]), atol=0.5), (numbers, listed)  # a factor of 3


# ---- Docstrings ----

def public():
    for name in pw.__all__:
        made = getattr(pw, name)
        if inspect.isclass(made) or inspect.isfunction(made):
            yield name, made
        if inspect.isclass(made) and made.__module__.startswith("pinwheel") and not issubclass(made, (pw.Element, Exception)):
            yield from ((f"{name}.{n}", m) for n, m in vars(made).items() if not n.startswith("_") and callable(m))


@pytest.mark.parametrize("name, made", [pytest.param(n, m, id=n) for n, m in public()])
def test_docstrings_name_every_parameter(name, made):
    doc = inspect.getdoc(made)
    assert doc and doc[0].isupper() and doc.splitlines()[0].endswith("."), name
    if isinstance(made, type) and issubclass(made, (Exception, pw.Simulation, pw.Inputs, pw.Linear, pw.Result)) or made is pw.Element:
        return
    parameters = [p for p in inspect.signature(made).parameters.values() if p.name != "self"]
    if len(parameters) and name not in ("Result.keys",):
        section = doc.partition("Parameters\n----------\n")[2]
        assert section or len(parameters) == 1 and "`" in doc or len(parameters) == 1 and parameters[0].name in doc, name
        for p in parameters if section else []:
            assert re.search(rf"^(.*, )?\**{p.name}\b.* : |^(.*, )?\**{p.name}(,|$)", section, re.M), (name, p.name)


def test_elements_have_the_fields_of_the_tables():
    listed = pw.help_of("list") and subprocess.run([lib.program(), "list", "kinds", "all"], capture_output=True, text=True).stdout
    for made in pw.elements.KINDS.values():
        block = re.search(rf"^{made.kind}: (.*?)(?=^\S|\Z)", listed, re.S | re.M).group(1)
        fields = re.search(r"^    fields\n(.*?)(?=^    \S|\Z)", block + "\n", re.S | re.M)
        names = re.findall(r"^      (\S+)", fields.group(1), re.M) if fields else []
        assert list(made._fields.values()) == names, made.kind
        assert [p for p in inspect.signature(made).parameters if p != "name"] and all(f"{n} : " in made.__doc__ for n in made._fields)
    assert "the common point in each body's frame [m]" in pw.Pin.__doc__
    assert "stiffness" in pw.Spring.__doc__ and "[N/m]" in pw.Spring.__doc__
    assert inspect.signature(pw.Gear).parameters["from_"].default == "start"


def test_elements_make_the_model_of_dictionaries():
    body = pw.Body("sleigh", mass=1, inertia=0.5, rate={"vx": 1, "omega": 0.8})
    classes = pw.describe(bodies=[body], elements=[pw.Wheel("edge", body="sleigh", at=[-0.25, 0])])
    plain = pw.describe(bodies=[{"name": "sleigh", "mass": 1, "inertia": 0.5, "rate": {"vx": 1, "omega": 0.8}}],
                        elements=[{"wheel": "edge", "body": "sleigh", "at": [-0.25, 0]}])
    assert np.array_equal(classes.run(t_end=1).rows, plain.run(t_end=1).rows)


def test_types(tmp_path):
    """mypy accepts the package and a program that uses it, and finds a wrong argument."""
    api = pytest.importorskip("mypy.api")
    (tmp_path / "user.py").write_text("import pinwheel as pw\nr = pw.Model('pendulum', m=1).run(t_end=1.0)\nx: int = len(r['t'])\n"
                                      "p = pw.Pin('p', body=['a', 'b'], at=[[0, 0], [0, 0]])\npw.Model('pendulum').run(t_end=[1])\n")
    (tmp_path / "mypy.ini").write_text("[mypy]\n[mypy-numpy.*,xarray.*]\nfollow_imports = skip\n")
    text, _, _ = api.run([str(TOP / "core/python/pinwheel"), str(tmp_path / "user.py"), "--cache-dir", str(tmp_path),
                          "--ignore-missing-imports", "--config-file", str(tmp_path / "mypy.ini")])
    errors = [line for line in text.splitlines() if ": error: " in line]
    assert len(errors) == 1 and 'user.py:5' in errors[0] and "t_end" in errors[0], text


# ---- Notebooks ----

def test_progress_in_a_terminal(capfd, monkeypatch):
    monkeypatch.setattr(_progress.time, "monotonic", iter(np.arange(0, 1000, 1.0)).__next__)
    r = pw.Model("pendulum").run(t_end=0.2, progress=True)
    assert r.status == "ok" and "remaining" in capfd.readouterr().err
    pw.Model("pendulum").run(t_end=0.2)
    assert capfd.readouterr() == ("", "")


def test_progress_in_a_notebook(monkeypatch):
    """A bar that is updated and removed at the end; False shows none."""
    shown = []

    class Display:
        def __init__(self):
            shown.append("")

        def update(self, html):
            shown.append(html)

    display = type(sys)("IPython.display")
    display.HTML, display.display = str, lambda html, display_id: Display()
    shell = type("Shell", (), {"kernel": None})()
    ipython = type(sys)("IPython")
    ipython.get_ipython, ipython.display = lambda: shell, display
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(_progress.time, "monotonic", iter(np.arange(0, 1000, 1.0)).__next__)
    pw.Model("pendulum").run(t_end=0.2, progress=False)
    assert shown == []
    pw.Model("pendulum").run(t_end=0.2)
    assert any(html.startswith("<progress value=") and "remaining" in html for html in shown) and shown[-1] == ""
