"""The Python package against the program and against closed forms."""

import concurrent.futures
import contextlib
import csv
import json
import math
import os
import pathlib
import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings

import numpy as np
import pytest

import pinwheel as pw
from pinwheel import _library as lib

TOP = pathlib.Path(__file__).resolve().parents[2]


def program(*words):
    return subprocess.run([lib.program(), *words], capture_output=True, text=True, check=True)


def table(path):
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    return {name.split(" [")[0]: np.array(column, float) for name, column in zip(rows[0], zip(*rows[1:]))}


# ---- Models ----

def test_every_model_of_the_gallery_opens():
    for name in pw.models():
        assert pw.Model(name).about


@pytest.mark.parametrize("make, kind, text", [
    (lambda: pw.Model("snakebord"), pw.InputError, 'did you mean "snakeboard"?'),
    (lambda: pw.Model("snakeboard", swin=1), pw.InputError, "did you mean 'swing'?"),
    (lambda: pw.Model("ezyroller", q=1), pw.InputError, "no parameter 'q'; valid are a, b, c, d, m1, I1, m2, I2, M0, omega"),
    (lambda: pw.Model("ezyroller", start={"m1": 1}), pw.InputError, "start: m1 is a parameter of model ezyroller, expected a state"),
    (lambda: pw.Model("ezyroller", **{"frame.vx": 1}), pw.InputError, "'frame.vx': expected a parameter; initial values of states"),
    (lambda: pw.Model("snakeboard").run(step=1e-300), pw.InputError, "setting step = 1e-300: expected at least"),
    (lambda: pw.Model("pendulum", m=-1), pw.InputError, "m = -1"),
    (lambda: pw.Model("snakeboard", swing=math.nan), pw.InputError, "swing = nan"),
    (lambda: pw.Model("snakeboard", start={"board.vxx": 1}), pw.InputError, 'did you mean "board.vx"?'),
    (lambda: pw.Model("ezyroller", signals={"ridr": math.cos}), pw.InputError, 'did you mean "rider"?'),
    (lambda: pw.sweep("snakeboard", {"swng": [1]}), pw.InputError, "did you mean 'swing'?"),
    (lambda: pw.sweep("snakeboard", {"board.vxx": [1]}), pw.InputError, 'did you mean "board.vx"?'),
    (lambda: pw.Model("snakeboard").run("rk9"), pw.InputError, "rk9"),
    (lambda: pw.Model("snakeboard").run(start={"bord.x": 1}), pw.InputError, 'did you mean "board.x"?'),
    (lambda: pw.Model("snakeboard").run(times=np.zeros((2, 2))), pw.InputError, "found shape (2, 2)"),
    (lambda: pw.Model("snakeboard").run(times=[1, 0.5]), pw.InputError, "increasing times"),
    (lambda: pw.Model("snakeboard").run(every=-1), pw.InputError, "every = -1"),
    (lambda: pw.Model("ezyroller", a=0, b=0, c=0, d=0).run(), pw.Error, "ezyroller"),
    (lambda: pw.describe(bodies=[{"name": "a", "mas": 1}]), pw.InputError, 'yaml:3:19: error: a body has no "mas"'),
    (lambda: pw.command("check", "snakebord"), pw.InputError, "snakebord"),
])
def test_refusals_have_the_text_of_the_library(make, kind, text):
    with pytest.raises(kind) as raised:
        make()
    assert text in str(raised.value)


def test_unknown_columns_name_the_nearest():
    with pytest.raises(KeyError, match="board.y"):
        pw.Model("snakeboard").run(t_end=0.1)["board.yy"]


def test_description_in_python():
    bodies = [{"name": "sleigh", "mass": 1, "inertia": 0.5, "rate": {"vx": 1, "vy": 0.2, "omega": 0.8}}]
    elements = [{"wheel": "edge", "body": "sleigh", "at": ["-a", 0]}]
    parameters = [{"name": "a", "value": 0.25, "unit": "m"}]
    r = pw.describe("sleigh", bodies=bodies, elements=elements, parameters=parameters).run("erk8+projection", t_end=60, rtol=1e-12)
    assert math.hypot(r["sleigh.vx"][-1], r["sleigh.vy"][-1]) == pytest.approx(math.sqrt(1 + 0.5625 * 0.64), rel=1e-11)


def test_functions_as_signals():
    bodies = [{"name": "disc", "mass": 1, "inertia": 2}]
    element = {"torque": "motor", "body": ["disc", "ground"], "value": lambda t: math.cos(t)}
    r = pw.describe(bodies=bodies, elements=[element]).run("erk8", t_end=3, rtol=1e-12)
    assert r["disc.omega"][-1] == pytest.approx(math.sin(3) / 2, abs=1e-11)
    assert r["disc.phi"][-1] == pytest.approx((1 - math.cos(3)) / 2, abs=1e-11)


class Unsized:
    """A number as arrays of other packages have them."""
    shape = ()

    def __init__(self, value):
        self.value = value

    def __len__(self):
        raise TypeError("len() of a 0-d array")

    def __float__(self):
        return float(self.value)


NUMBERS = [np.array, np.float64, np.float32, Unsized, lambda x: np.where(True, x, 0), lambda x: np.array([x]), lambda x: [x], lambda x: (np.array(x),)]


@pytest.mark.filterwarnings("ignore:model snakeboard. initial values")
@pytest.mark.parametrize("form", NUMBERS)
def test_arrays_without_dimension_are_numbers(form):
    """In signals of forces, and as value, rate and acceleration of constraints, where derivatives are compared, too."""
    push = pw.Model("ezyroller", signals={"rider": lambda t: form(0.25)}).run(t_end=0.1)
    assert np.array_equal(push.rows, pw.Model("ezyroller", signals={"rider": lambda t: 0.25}).run(t_end=0.1).rows)

    def swing(of):
        return lambda t: (of(0.7 + 0.5 * t), of(0.5), of(0.0))
    if form not in NUMBERS[5:]:
        turned, plain = (pw.Model("snakeboard", signals={"swing": swing(of)}).run(t_end=0.1) for of in (form, float))
        assert np.allclose(turned.rows, plain.rows, rtol=0, atol=1e-5)
        with pytest.raises(pw.InputError, match="the rate at"):
            pw.Model("snakeboard", signals={"swing": lambda t: (form(0.7 + 0.5 * t), form(0.6), form(0))})


def test_interpolations_of_scipy_are_signals():
    interpolate = pytest.importorskip("scipy.interpolate")
    t = np.linspace(0, 1, 21)
    for make in (interpolate.CubicSpline, interpolate.interp1d, interpolate.PchipInterpolator, interpolate.make_interp_spline):
        model = pw.describe(bodies=[pw.Body("disc", mass=1, inertia=2)], elements=[pw.Torque("motor", body=["disc", "ground"], value=make(t, t))])
        assert model.run("rk4", t_end=0.5)["disc.omega"][-1] == pytest.approx(0.0625, abs=1e-9)


def swinging(rate, acceleration, w=math.pi):
    """The snakeboard with a swing of 0.7 rad, whose derivatives have these factors."""
    return pw.Model("snakeboard", signals={"swing": lambda t: (
        0.7 * math.cos(w * t), -0.7 * rate * w * math.sin(w * t), -0.7 * acceleration * w * w * math.cos(w * t))})


@pytest.mark.parametrize("w", [0.01, 1, 100, 1e5])
def test_derivatives_of_functions_are_checked(w):
    swinging(1, 1, w)
    with pytest.raises(pw.InputError, match="signal swing: the rate at t = 0.3137 s is .*, but the derivative is"):
        swinging(-1, 1, w)
    with pytest.raises(pw.InputError, match="signal swing: the acceleration at t = 0.3137 s is .*, but the derivative is"):
        swinging(1, 1.1, w)


def test_functions_that_interpolate_pass_the_check_of_derivatives():
    t = np.arange(0, 6, 0.02)
    tables = np.cos(3 * t), -3 * np.sin(3 * t), -9 * np.cos(3 * t)
    calls = []
    model = pw.Model("snakeboard", signals={"swing": lambda now: calls.append(now) or tuple(np.interp(now, t, x) for x in tables)})
    assert "swing" in model.signals
    assert 0 < max(calls) < model.defaults["t_end"]
    calls.clear()
    model.replace(start={"front.x": 1})
    assert len(calls) < 20  # derivatives are not checked again


def test_functions_of_forces_are_not_called_before_the_run():
    calls = []
    pw.Model("ezyroller", signals={"rider": lambda t: calls.append(t) or 0.0})
    assert calls == []


def test_a_failing_function_stops_the_run(capfd):
    element = {"torque": "motor", "body": ["disc", "ground"], "value": lambda t: 1 / 0 if t > 1 else 0}
    with pytest.raises(ZeroDivisionError) as raised:
        pw.describe(bodies=[{"name": "disc", "mass": 1, "inertia": 2}], elements=[element]).run(t_end=3)
    r = raised.value.result
    assert r.status == "failed" and 0.9 < r.t[-1] <= 1.01 and "motor" in r.reason and "ZeroDivisionError" in r.reason
    assert capfd.readouterr() == ("", "")


# ---- Runs ----

@pytest.mark.parametrize("model, method", [("snakeboard", "rk4+projection"), ("ezyroller", "ida+ggl"),
                                           ("car-tyres", "erk8+projection"), ("redundant-parallelogram", "galpha"),
                                           ("differential-drive", "bdf+projection")])
def test_same_bits_as_the_program(model, method, tmp_path):
    program("run", model, "--method", method, "--t-end", "2", "--every", "0.25", "--energy", "-o", str(tmp_path / "t.csv"))
    expected = table(tmp_path / "t.csv")
    r = pw.Model(model).run(method, t_end=2, every=0.25, energy=True)
    assert len(expected) > 8
    for name in expected:
        assert np.array_equal(r[name], expected[name]), name


@pytest.mark.parametrize("model", list(pw.models()))
def test_every_column_of_the_program_has_its_name_and_unit(model, tmp_path):
    program("run", model, "--t-end", "0.01", "--every", "0.005", "--specialise", "never", "--energy", "-o", str(tmp_path / "t.csv"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of initial values
        r = pw.Model(model).run(t_end=0.01, every=0.005, energy=True, specialise="never")
    rows = list(csv.reader((tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()))
    for cell, column in zip(rows[0], zip(*rows[1:])):
        name, _, unit = cell.partition(" [")
        assert np.array_equal(r[name], np.array(column, float), equal_nan=True) and r.units[name] == unit.rstrip("]"), name


def test_wheels_and_markers_have_positions():
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1, start={"x": 3, "phi": math.pi / 2}, rate={"vy": 1})],
                        elements=[pw.Wheel("edge", body="a", at=[-1, 0]), pw.Marker("tip", body="a", at=[2, 1])])
    r = model.run(t_end=1)
    assert [r.final[name] for name in ("edge.x", "edge.y", "tip.x", "tip.y")] == pytest.approx([3, 0, 2, 3], abs=1e-12)
    assert pw.sweep(model, {"a.vy": [2.0]}, t_end=1)["tip.y"] == pytest.approx(4, abs=1e-12)


@pytest.mark.parametrize("method, settings", [
    ("erk8+projection", {"step": 0.01}), ("rk4", {"rtol": 1e-3}), ("rk4", {"atol": 1e-3}), ("rk4", {"max_steps": 100, "step": 0.01}),
    ("galpha", {"max_steps": 100, "rtol": 1e-3}), ("radau:steps=fixed", {"rtol": 1e-3}), ("radau", {"step": 0.01}),
    ("rk4", {"step": 0.01, "rtol": 1e-3}), ("erk5", {"step": 0.01, "rtol": 1e-3}), ("bdf", {"max_steps": 10000}), ("rk4+nothing", {"rtol": 1})])
def test_settings_without_effect_are_those_of_the_program(method, settings):
    """Of runs, of open runs, and once of a sweep."""
    words = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]
    done = subprocess.run([lib.program(), "run", "pendulum", "--t-end", "0.1", "--method", method, *words], capture_output=True, text=True)
    expected = [re.sub("--(\\w+)-?", r"\1_", line).replace("_ ", " ").replace("_,", ",").rstrip("_").partition(": ")[2]
                for line in done.stderr.splitlines() if "no effect" in line]
    model = pw.Model("pendulum")
    for call in (lambda: model.run(method, t_end=0.1, **settings), lambda: model.open(method, **settings),
                 lambda: pw.sweep(model, {"m": [1, 2, 3]}, method=method, t_end=0.1, **settings)):
        with warnings.catch_warnings(record=True) as shown:
            warnings.simplefilter("always")
            with contextlib.suppress(pw.InputError):
                call()
        assert [str(w.message) for w in shown] == expected
        assert all(w.filename in (__file__, pw.model.__file__, pw.studies.__file__) for w in shown)


def test_specialised_code_that_is_impossible_is_reported():
    with pytest.warns(UserWarning, match="general engine: .*specialised code has at most"):
        pw.Model("chain", n=200).run(t_end=0.01, specialise="always")


@pytest.mark.parametrize("model, method, settings", [
    ("ezyroller", "rk4+projection", {"t_end": 20.0, "step": 1e-5, "every": 2.0}),
    ("redundant-parallelogram", "rk4+projection", {"t_end": 1.0, "every": 0.25, "specialise": "always"}),
    ("snakeboard", "erk8+projection", {"t_end": 2.0, "every": 0.25, "specialise": "always"})])
def test_same_bits_as_the_program_with_specialised_code(model, method, settings, tmp_path, monkeypatch):
    """Also where both decide for it because the run is long."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    words = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]
    program("run", model, "--method", method, *words, "-o", str(tmp_path / "t.csv"))
    expected = table(tmp_path / "t.csv")
    r = pw.Model(model).run(method, **settings)
    assert r.statistics["specialised"] > 0.9 * r.statistics["rhs"]
    for name in expected:
        if name in r:
            assert np.array_equal(r[name], expected[name]), name


def test_functions_with_specialised_code():
    model = pw.Model("ezyroller", signals={"rider": lambda t: 0.1})
    r, general = (model.run(t_end=0.1, specialise=when) for when in ("always", "never"))
    assert r.statistics["specialised"] > 0 and general.statistics["specialised"] == 0
    assert np.allclose(r["frame.x"], general["frame.x"], rtol=0, atol=1e-13)


@pytest.mark.filterwarnings("ignore:general engine")
def test_models_without_specialised_code_run():
    r = pw.Model("chain", n=200).run(t_end=0.01, specialise="always")
    assert r.status == "ok" and r.statistics["specialised"] == 0


def test_summaries_follow_their_schema(tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((TOP / "docs/summary.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    runs = [(name, "--energy") for name in pw.models()]
    runs += [("elliptic-wire",), ("nothing",), ("theo-jansen", "--method", "rk4", "--step", "0.05", "--t-end", "20")]
    runs += [("pendulum", "--error"), ("pendulum", "--error", "--method", "erk8", "--rtol", "1e-4")]
    for words in runs:
        file = tmp_path / "summary.json"
        file.unlink(missing_ok=True)
        time = () if "--t-end" in words else ("--t-end", "0.1")
        subprocess.run([lib.program(), "run", *words, *time, "--json", str(file)], capture_output=True)
        validator.validate(json.loads(file.read_text()))


def test_stated_errors_contain_the_true_ones():
    pendulum, time = pw.Model("pendulum"), 5
    exact = pendulum.run("erk8+projection", rtol=1e-13, t_end=time).final
    for settings in {"method": "erk8+projection", "rtol": 1e-6}, {"method": "rk4+projection", "step": 0.01}:
        run = pendulum.run(t_end=time, every=0.05, error=True, **settings)
        for name in run.states:
            end, largest = run.error[name]
            assert abs(run.final[name] - exact[name]) <= end <= largest < 1e-3
    assert pendulum.run(t_end=1).error is None
    sweep = pw.sweep(pendulum, {"l": [1, 2]}, method="erk8+projection", t_end=1, error=True)
    assert (np.asarray(sweep["error.bob.x"]) > 0).all() and (np.asarray(sweep["error.bob.x"]) < 1e-4).all()


def test_errors_of_chaotic_runs_are_unknown():
    m = pw.describe(bodies=[pw.Body("a", mass=1, inertia=0.1, start={"phi": 2.5}), pw.Body("b", mass=1, inertia=0.1, start={"phi": 2.8})],
                    elements=[pw.Gravity("g", acceleration=[0, -9.81]), pw.Pin("A", body=["a", "ground"], at=[[-0.5, 0], [0, 0]]),
                              pw.Pin("B", body=["a", "b"], at=[[0.5, 0], [-0.5, 0]])])
    run = m.run("rk4+projection", step=0.02, t_end=40, every=0.5, error=True)
    assert run.error is None and "chaotic" in run.error_unknown


def test_archives_have_the_numbers_of_tables(tmp_path):
    for name in "t.csv", "t.npz":
        program("run", "ezyroller", "--t-end", "2", "--every", "0.25", "--energy", "-o", str(tmp_path / name))
    expected = table(tmp_path / "t.csv")
    with np.load(tmp_path / "t.npz") as archive:
        assert archive.files == list(expected)
        for name in archive.files:
            assert np.array_equal(archive[name], expected[name]), name


def test_columns_are_views():
    r = pw.Model("pendulum").run(t_end=1, every=0.1)
    assert r["bob.x"].base is r.rows or np.shares_memory(r["bob.x"], r.rows)
    assert r.rows.shape == (11, len(r.units)) and r.t[-1] == 1


def test_ctrl_c_keeps_the_samples():
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    # started when the run has begun: before, specialised code may be compiled
    with pytest.raises(KeyboardInterrupt) as raised:
        pw.Model("ezyroller").run(t_end=1e5, progress=lambda done: timer.ident or timer.start())
    r = raised.value.result
    assert r.status == "stopped" and 0 < r.t[-1] < 1e5 and "interrupted" in r.reason


def test_failures_keep_the_samples():
    r = pw.Model("ezyroller").run("erk8+projection", rtol=1e-12, max_steps=20)
    assert r.status == "failed" and "max_steps" in r.reason.replace("-", "_") and len(r) > 2


def test_tables_that_do_not_cover_the_run_are_reported(tmp_path):
    def torque(**table):
        return pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)],
                           elements=[pw.Torque("T", body=["a", "ground"], value={"table": {"points": [[0, 1], [4000, 1]], **table}})])
    model = torque(time_scale=1e-3)
    with pytest.warns(UserWarning, match="torque T: value: the table has times from 0 to 4 s and covers 40 % of the run, which ends at 10 s"):
        model.run(t_end=10)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.run(t_end=4)
        torque(time_scale=1e-3, time_offset=-1).run(t_end=3)
    (tmp_path / "M.csv").write_text("t;M\n0;1,5\n1;\n10;2,5\n")
    (tmp_path / "m.yaml").write_text("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                                     "elements: [{torque: T, body: [a, ground], value: {table: {file: M.csv, time: t}}}]\n")
    with pytest.warns(UserWarning, match="torque T: value: 1 row with empty cells is left out of the table"):
        r = pw.Model(tmp_path / "m.yaml").run("rk4", t_end=10, step=0.1)
    assert r["a.omega"][-1] == pytest.approx(20)


def test_changed_initial_values_are_reported():
    model = pw.Model("ezyroller")
    assert model.run(t_end=0.01).changed == {}
    r = model.run(t_end=0.01, start={"frame.vy": 1})
    assert r.changed["frame.omega"] == (0, pytest.approx(2, rel=1e-12)) and len(r.changed) == 3
    with pytest.warns(UserWarning, match="model ezyroller: initial values were changed to satisfy the constraints: frame.omega from 0 to 2 rad/s$"):
        model.run(t_end=0.01, start={"frame.vy": 1, "frame.omega": 0})
    sleigh = pw.describe(bodies=[pw.Body("sleigh", mass=1, inertia=0.5, rate={"vx": 1, "vy": 0.1, "omega": 0.8})],
                         elements=[pw.Wheel("edge", body="sleigh", at=[-0.25, 0])])
    with pytest.warns(UserWarning, match="constraints: sleigh.vy from 0.1 to 0.2 m/s .specified by the model.$"):
        sleigh.run(t_end=0.01)
    with pytest.warns(UserWarning, match="constraints: sleigh.omega from 0.8 to 0 rad/s .specified by the model.$"):
        sleigh.run(t_end=0.01, start={"sleigh.vy": 0, "sleigh.vx": 1})


def test_controller():
    """A torque that is set every 10 ms is the same as a pulse train: omega is the sum of impulses."""
    bodies = [{"name": "disc", "mass": 1, "inertia": 2}]
    model = pw.describe(bodies=bodies, elements=[{"torque": "motor", "body": ["disc", "ground"], "value": 0}])
    total = 0.0
    with model.open("rk4", inputs={"motor": 0.0}) as simulation:
        for k in range(100):
            simulation.inputs["motor"] = math.sin(k)
            simulation.advance(0.01 * (k + 1))
            total += 0.01 * math.sin(k) / 2
        assert simulation.sample()["disc.omega"] == pytest.approx(total, abs=1e-13)
        with pytest.raises(KeyError, match="motor"):
            simulation.inputs["moter"] = 1
        with pytest.raises(pw.InputError, match="has reached"):
            simulation.advance(0.5)


def test_threads_share_a_model():
    model = pw.Model("snakeboard")
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda _: model.run(t_end=2, every=0.5).rows, range(8)))
    assert all(np.array_equal(rows, runs[0]) for rows in runs)


def test_the_lock_is_released():
    """While a run computes, another thread runs Python."""
    count, done = 0, threading.Event()

    def work():
        pw.Model("ezyroller").run(t_end=300, every=300)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        count += 1
        time.sleep(0)
    thread.join()
    assert count > 50


def test_tables():
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    r = pw.Model("pendulum").run(t_end=1, every=0.5)
    assert isinstance(r.to_dataframe(), pandas.DataFrame) and r.to_dataframe()["bob.x"].iloc[-1] == r["bob.x"][-1]
    data = r.to_xarray()
    assert isinstance(data, xarray.Dataset) and data["bob.x"].attrs["units"] == "m"


def test_notebook_shows_the_animation():
    page = pw.Model("pendulum").run(t_end=1)._repr_html_()
    assert page.startswith("<iframe srcdoc=") and "pendulum" in page


def shown_in_a_notebook(page, script, folder):
    """What a browser has in an element "verdict" at the end of a script that waits for a page inside another one."""
    browser = os.environ.get("BROWSER") or next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        pytest.skip("no browser")
    # The browser writes the document when it is loaded, that is, not before the second frame is closed, with the verdict.
    (folder / "notebook.html").write_text(f"""<!DOCTYPE html><html><body>{page}<pre id="verdict"></pre><script>
        (async () => {{
          const frame = document.querySelector("iframe"), $ = id => frame.contentDocument.getElementById(id);
          const until = async good => {{ for (let i = 0; i < 1500 && !good(); i++) await new Promise(done => setTimeout(done, 20)); }};
          const root = () => frame.contentDocument?.documentElement?.dataset || {{}};
          const hold = document.body.appendChild(document.createElement("iframe"));
          hold.contentDocument.open();
          try {{ {script} }} finally {{ hold.contentDocument.close(); }}
        }})();</script></body></html>""", encoding="utf-8")
    done = subprocess.run([browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile", "--enable-logging=stderr",
                           "--v=0", "--dump-dom", f"file://{folder}/notebook.html"], capture_output=True, text=True, timeout=240)
    assert ":CONSOLE" not in done.stderr, done.stderr
    return re.search(r'<pre id="verdict">(.*?)</pre>', done.stdout, re.S).group(1)


def test_the_page_of_a_notebook_computes(tmp_path):
    """An iframe with srcdoc, which has no address of its own."""
    text = shown_in_a_notebook(pw.Model("pendulum", l=1.5)._repr_html_(), """
        await until(() => root().simulated === "yes");
        const field = document.querySelector("iframe").contentDocument.querySelector('#parameters input[type=number][data-name="l"]');
        const before = field.value;
        root().simulated = "";
        field.value = 2;
        field.dispatchEvent(new Event("change", { bubbles: true }));
        await until(() => root().simulated === "yes");
        document.getElementById("verdict").textContent = [before, root().simulated, $("page-link").hidden, $("reason").textContent].join("|");""", tmp_path)
    assert text == "1.5|yes|true|"


def test_notebook_shows_the_animation_of_the_settings_that_were_used(tmp_path, monkeypatch):
    words = []
    monkeypatch.setattr(pw.results._program, "run", lambda given: words.extend(given) or (tmp_path / "no page").read_text())
    with pw.Model("pendulum").open(step="2e-3") as simulation:
        r = simulation.record(1)
    r._repr_html_()
    monkeypatch.undo()
    assert r.settings["step"] == 0.002 and "--step=0.002" in words
    with pw.Model("ezyroller").open(inputs={"rider": 0.1}) as simulation:
        assert "cannot set inputs" in simulation.record(1)._repr_html_()


def test_notebook_shows_the_interactive_page():
    page = pw.Model("snakeboard", swing=0.61)._repr_html_()
    assert page.startswith("<iframe srcdoc=") and "0.61" in page and "WebAssembly" in page
    hidden = pw.Model("ezyroller", signals={"rider": lambda t: 0.0})._repr_html_()
    assert hidden.startswith("&lt;Model ezyroller") and "functions in Python" in hidden
    assert "name its source, a .c file" in pw.Model(lib.program().removesuffix("pinwheel") + "models/ezyroller.so")._repr_html_()


# ---- Studies ----

def test_sweep_has_the_values_of_the_program(tmp_path):
    program("sweep", "snakeboard", "--vary", "swing=0.3,0.6", "--vary", "board.vx=0,0.1,0.2", "--t-end", "1", "--method",
            "rk4+projection", "--step", "1e-3", "-o", str(tmp_path / "s.csv"))
    expected = table_of_sweep(tmp_path / "s.csv")
    data = pw.sweep("snakeboard", {"swing": [0.3, 0.6], "board.vx": [0, 0.1, 0.2]}, t_end=1, method="rk4+projection", step=1e-3)
    for name in ("board.x", "board.phi", "rotor.omega"):
        assert np.array_equal(np.asarray(data[name]).ravel(), expected[name]), name


def test_sweeps_have_outputs():
    """A block of 1 kg with the force 1 N: x = x0 + t^2/2 reaches a stop at t1 = sqrt (2 (1 - x0)), mean of x' until then t1/2."""
    block = pw.describe(bodies=[pw.Body("block", mass=1, inertia=1)],
                        elements=[pw.Force("F", body="block", at=[0, 0], fx=1),
                                  {"stop": "wall", "body": ["block", "ground"], "what": "x", "high": 1, "restitution": 0.5}])
    x0 = np.array([0.0, 0.36])
    data = block.sweep({"block.x": x0}, method="erk8", rtol=1e-10, t_end=2,
                       of=["event:wall", "events:wall", "max:block.vx", "at 0.5:block.x - 0.125"])
    t1 = np.sqrt(2 * (1 - x0))
    assert np.asarray(data["event:wall"]) == pytest.approx(t1, abs=1e-9) and (np.asarray(data["events:wall"]) >= 1).all()
    assert np.asarray(data["max:block.vx"]) == pytest.approx(t1, abs=1e-9)
    assert np.asarray(data["at 0.5:block.x - 0.125"]) == pytest.approx(x0, abs=1e-9)
    stopped = block.replace(start={"block.x": 0.1}).sweep({"block.x": x0}, method="erk8", rtol=1e-10, until="block.vx > 0.5", t_end=2)
    assert np.asarray(stopped["t"]) == pytest.approx([0.5, 0.5], abs=1e-9) and list(np.asarray(stopped["failed"])) == ["", ""]
    failed = block.sweep({"block.x": x0}, of="max:block.vx", method="erk8", max_steps=1)
    assert all("max" in why for why in np.asarray(failed["failed"])) and np.isnan(np.asarray(failed["max:block.vx"])).all()
    for options, text in (({"of": "max:block.xx"}, "block.vx|block.x"), ({"of": "t", "executor": 1}, "together with executor"),
                          ({"of": "t", "energie": True}, 'no option "--energie"')):
        with pytest.raises(pw.InputError, match=text):
            block.sweep({"block.x": x0}, **options)
    with pytest.raises(pw.InputError, match="functions in Python"):
        pw.Model("ezyroller", signals={"rider": math.cos}).sweep({"a": [0.5]}, of="t")


def test_a_sweep_of_which_all_runs_fail_has_its_columns():
    data = pw.sweep("snakeboard", {"swing": [0.1, 0.2]}, method="erk8", max_steps=3, t_end=1, energy=True)
    good = pw.sweep("snakeboard", {"swing": [0.1, 0.2]}, method="erk8", t_end=1, energy=True)
    assert set(data) == set(good) and np.isnan(np.asarray(data["board.x"])).all() and all(np.asarray(data["failed"]))


def table_of_sweep(path):
    rows = list(csv.reader(line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")))
    columns = {}
    for name, column in zip(rows[0], zip(*rows[1:])):
        try:
            columns[name.split(" [")[0]] = np.array(column, float)
        except ValueError:
            pass
    return columns


@pytest.mark.parametrize("pool", ["process", "dask"])
def test_executors(pool):
    vary = {"swing": [0.3, 0.6]}
    expected = np.asarray(pw.sweep("snakeboard", vary, t_end=0.5)["board.x"])
    if pool == "process":
        import multiprocessing
        executor = concurrent.futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))
    else:
        distributed = pytest.importorskip("distributed")
        client = distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None)
        executor = client.get_executor()
    with executor:
        assert np.array_equal(np.asarray(pw.sweep("snakeboard", vary, t_end=0.5, executor=executor)["board.x"]), expected)


def test_mpi_executor(tmp_path):
    pytest.importorskip("mpi4py.futures")
    if shutil.which("mpiexec") is None:
        pytest.skip("no mpiexec")
    (tmp_path / "sweep.py").write_text("""
import mpi4py.futures, numpy, pinwheel
if __name__ == "__main__":
    with mpi4py.futures.MPIPoolExecutor() as executor:
        data = pinwheel.sweep("snakeboard", {"swing": [0.3, 0.6]}, t_end=0.5, executor=executor)
    print(numpy.asarray(data["board.x"]).tolist())
""")
    allowed = {name: "1" for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe")}
    done = subprocess.run(["mpiexec", "-n", "2", sys.executable, "-m", "mpi4py.futures", tmp_path / "sweep.py"], env={**os.environ, **allowed},
                          capture_output=True, text=True, timeout=120, check=True)
    assert json.loads(done.stdout) == np.asarray(pw.sweep("snakeboard", {"swing": [0.3, 0.6]}, t_end=0.5)["board.x"]).tolist()


def test_sweeps_have_units():
    xarray = pytest.importorskip("xarray")
    data = pw.sweep("snakeboard", {"swing": [0.3]}, t_end=0.1)
    assert isinstance(data, xarray.Dataset) and data["board.x"].attrs["units"] == "m" and data["swing"].attrs["units"] == "rad"


@pytest.mark.parametrize("call, keys", [
    (lambda: pw.Model("n-trailer").check(), {"status", "mobility"}),
    (lambda: pw.Model("pendulum").compare(t_end=1, methods="rk4,erk8"), {"method", "cpu [s]"}),
    (lambda: pw.Model("pendulum").drift(t_end=1), {"method", "largest.position"}),
    (lambda: pw.Model("n-trailer").steady(starts=3), {"motions"}),
    (lambda: pw.Model("pendulum").sensitivity(of="bob.x", by=["m", "l"], t_end=1), {"outputs"}),
    (lambda: pw.command("linearise", "pendulum"), {"eigenvalues"}),
])
def test_analyses_return_what_the_commands_write(call, keys):
    assert keys <= set(call())


def test_fit_of_arrays():
    r = pw.Model("pendulum", l=1.0).run(t_end=1, every=0.1)
    fit = pw.Model("pendulum", l=1.1).fit(data={"t": r.t, "bob.x": r["bob.x"]}, columns="bob.x", free={"l": (0.5, 2)})
    assert fit["unknowns"][0]["value"] == pytest.approx(1, abs=1e-9)


def test_optimum():
    best = pw.Model("pendulum").optimise(maximise="max:bob.x", free={"theta": np.array([-3, 0])}, starts=2, t_end=2)
    assert best["status"] == "ok" and -3 <= best["unknowns"][0]["value"] <= 0


def test_analyses_refuse_functions():
    with pytest.raises(pw.InputError, match="functions in Python"):
        pw.Model("ezyroller", signals={"rider": lambda t: 0.0}).check()


def test_failed_runs_of_a_sweep_are_named():
    data = pw.sweep("ezyroller", {"a": [0.5, 0.6]}, t_end=50, method="erk8+projection", rtol=1e-12, max_steps=10)
    assert np.isnan(np.asarray(data["frame.x"]) if "frame.x" in data else np.nan).all()
    assert all("max" in why for why in np.asarray(data["failed"]))


def test_models_are_pickled():
    model = pickle.loads(pickle.dumps(pw.Model("snakeboard", swing=0.5, start={"board.vx": 0.1})))
    assert model.parameters["swing"] == 0.5 and model.start == {"board.vx": 0.1}


def test_linearise():
    l = pw.Model("pendulum", theta=-math.pi / 2, l=2.0, g=8.0).linearise()
    assert l.steady and sorted(l.eigenvalues.imag) == pytest.approx([-2, 2], abs=1e-12)
    assert np.linalg.eigvals(l.A).imag.max() == pytest.approx(2, abs=1e-12)
    assert l.basis.shape == (len(l.states), 2)


def test_linearise_at_a_steady_motion():
    """The trailers, of 0.6 and 0.8 m, behind a tractor on a straight line at 2 m/s fall in line as exp (-2 t/length)."""
    trailers, hold = pw.Model("n-trailer"), {"tractor.vx": 2, "tractor.vy": 0, "tractor.omega": 0}
    start = trailers.replace(start={f"{body}.phi": 0 for body in trailers.bodies})
    l = start.linearise(steady=True, hold=hold)
    assert l.steady and l.A.shape == (7, 7) and l.basis.shape == (len(l.states), 7) and l.B.shape == (7, len(l.inputs))
    for eigenvalues in (l.eigenvalues, np.linalg.eigvals(l.A)):
        assert sorted(eigenvalues.real)[:2] == pytest.approx([-2 / 0.6, -2 / 0.8], abs=1e-9)
    same = trailers.linearise()
    assert l.states == same.states and l.inputs == same.inputs
    with pytest.raises(pw.InputError, match="raise `most`"):
        start.linearise(most=3, hold=hold)


def test_commands():
    report = pw.command("check", pw.Model("n-trailer"))
    assert report["status"] == json.loads(program("check", "n-trailer", "--json", "-").stdout)["status"]
    assert "frame" in pw.command("show", "ezyroller", matrices=True)


def test_until():
    """A run ends at the instant at which a condition becomes true: x = t^2/2 passes 2 m at t = 2 s."""
    model = pw.describe(bodies=[pw.Body("block", mass=1, inertia=1)],
                        elements=[pw.Force("F", body="block", at=[0, 0], fx=1)],
                        outputs=[{"name": "way", "value": "block.x", "unit": "m"}])
    for method, every in (("erk8", None), ("rk4", None), ("rk4", 0.3), ("bdf", 0.3)):
        result = model.run(method, t_end=5, step=0.13, rtol=1e-10, every=every, until="way > 2")
        assert abs(result.stopped - 2) < 1e-8 and result.t[-1] == result.stopped and (np.diff(result.t) > 0).all()
        assert result["way"][-1] > 2 > result["way"][-2] and result.status == "ok"
        assert every is None or np.allclose(result.t[:-1], 0.3 * np.arange(7))
    assert model.run("rk4", t_end=1, until="way > 2").stopped is None
    for until, message in (("ways > 2", "did you mean \"way\""), ("way", "expected a condition"), ("work > 1", "add energy=True")):
        with pytest.raises(pw.InputError, match=message):
            model.run("rk4", t_end=1, until=until)
    with pytest.raises(pw.InputError, match="complete runs"):
        model.run("rk4", t_end=1, until="way > 2", error=True)


def test_events():
    """A block of 1 kg at 3 m/s sticks after 1.5 s of a friction of 2 N; at a stop at x = 1 m it rebounds with half its speed."""
    block = pw.Body("block", mass=1, inertia=1, rate={"vx": 3})
    friction = {"sliding-friction": "floor", "body": ["block", "ground"], "at": [[0, 0], [0, 0]], "limit": 2}
    for method in ("erk8", "bdf+projection", "radau"):
        held, = pw.describe(bodies=[block], elements=[friction]).run(method, t_end=2, rtol=1e-10).events
        assert abs(held["t"] - 1.5) < 1e-8 and (held["from"], held["to"], held["impulse"]) == ("slides+", "holds", None)
        assert "floor" in held["reaction"]
        stop = {"stop": "wall", "body": ["block", "ground"], "what": "x", "high": 1, "restitution": 0.5}
        impact, = pw.describe(bodies=[block], elements=[stop]).run(method, t_end=2, rtol=1e-10).events
        assert abs(impact["t"] - 1 / 3) < 1e-8 and abs(abs(impact["impulse"]) - 4.5) < 1e-8
    assert pw.describe(bodies=[block], elements=[]).run("rk4", t_end=1).events == []


def test_paths():
    """A bead on a circle, a spline through an array of points, swings like a pendulum of its radius."""
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    model = pw.describe(paths=[{"name": "wire", "interpolation": "cubic", "closed": True,
                                "points": 2 * np.stack([np.cos(angle), np.sin(angle)], 1)}],
                        bodies=[pw.Body("bead", mass=1)],
                        elements=[pw.OnCurve("track", body="bead", x="wire.x (s)", y="wire.y (s)", start=1e-9),
                                  pw.Gravity("g", acceleration=[0, -9.81])],
                        outputs=[{"name": "off", "value": "wire.offset (bead.x, bead.y)"},
                                 {"name": "outside", "value": "2 - hypot (bead.x, bead.y)"}])
    result = model.run("erk8+projection", t_end=3, rtol=1e-10)
    assert abs(result["off"]).max() < 1e-12 and abs(result["outside"]).max() < 1e-8
    energy = (result["bead.vx"]**2 + result["bead.vy"]**2) / 2 + 9.81 * result["bead.y"]
    assert abs(energy).max() < 1e-6
    with pytest.raises(pw.InputError, match="there is no path \"wires\"; did you mean \"wire\""):
        pw.describe(paths={"name": "wire", "points": [[0, 0], [1, 0]]}, bodies=pw.Body("a", mass=1, inertia=1),
                    outputs={"name": "x", "value": "wires.s (a.x, a.y)"}).run("rk4", t_end=1)


def test_states():
    """A first-order state is integrated with the motion, and is a column under its name; its integral is none."""
    model = pw.describe(bodies=[pw.Body("block", mass=1, inertia=1)],
                        elements=[pw.Slider("rail", body=["block", "ground"], at=[[0, 0], [0, 0]]),
                                  pw.Force("F", body="block", at=[0, 0], fx="f"),
                                  pw.State("f", rate="1 - f", start=0.5, unit="N")])
    result = model.run("erk8", t_end=1, rtol=1e-12)
    assert abs(result["f"][-1] - (1 - 0.5 * math.exp(-1))) < 1e-10
    assert "f" in result.states and "f.integral" not in result.states
    swept = model.sweep({"f": [0.0, 0.5]}, method="erk8", t_end=1, rtol=1e-12)
    assert np.allclose(swept["block.vx"], [math.exp(-1), 0.5 + 0.5 * math.exp(-1)], rtol=0, atol=1e-10)
    assert abs(result["block.vx"][-1] - (1 - 0.5 * (1 - math.exp(-1)))) < 1e-10
