"""Models and results in Python: functions of states, contents, figures, options with names."""

import inspect
import math
import re

import numpy as np
import pytest

import pinwheel as pw

METHODS = ["rk4+projection", "erk8+projection", "ida+ggl", "bdf+projection", "adams", "radau+ggl", "galpha"]


def roller(signal, **settings):
    return pw.Model("ezyroller", signals={"rider": signal}).run(t_end=2, every=0.5, **settings)


# ---- Functions of states ----

@pytest.mark.parametrize("method", METHODS)
def test_feedback_is_the_expression_of_a_text_model(method):
    """With a gradient, and with one from differences."""
    bodies = [pw.Body("a", mass=1, inertia=2, rate={"omega": 1})]

    def run(value):
        return pw.describe(bodies=bodies, elements=[pw.Torque("m", body=["a", "ground"], value=value)]).run(
            method, t_end=3, every=0.5, **({"step": 1e-3} if method in ("rk4+projection", "galpha") else {"rtol": 1e-9}))
    expected = run("-3*sin(a.phi) - 0.2*a.omega + 0.1*t")
    for gradient in (None, lambda t, x: [-3 * math.cos(x[0]), -0.2]):
        found = run(pw.Feedback(lambda t, x: -3 * math.sin(x[0]) - 0.2 * x[1] + 0.1 * t, ["a.phi", "a.omega"], gradient))
        assert np.allclose(found["a.phi"], expected["a.phi"], rtol=0, atol=1e-7)  # 100 rtol: iterations end elsewhere


@pytest.mark.parametrize("value", [lambda t, x: 1 + 0.2 * math.sin(t) - 0.1 * x[0], lambda t, x: (1 + 0.2 * math.sin(t) - 0.1 * x[0], 0.2 * math.cos(t), 0)])
def test_feedback_of_a_velocity_constraint(value):
    """v = 1 + 0.2 sin t - 0.1 x: the derivative by the time is found, or returned."""
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)], elements=[
        pw.Wheel("w", body="a", at=[0, 0]), pw.Speed("drive", body="a", at=[0, 0], value=pw.Feedback(value, ["a.x"]))])
    r = model.run("erk8+projection", t_end=4, rtol=1e-10)
    k, t = 0.1, 4  # x' = 1 + 0.2 sin t - k x
    exact = (1 - math.exp(-k * t)) / k + 0.2 * (k * math.sin(t) - math.cos(t) + math.exp(-k * t)) / (1 + k * k)
    assert r["a.x"][-1] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("make, kind, text", [
    (lambda: roller(pw.Feedback(lambda t, x: 0.0, ["steer.ph"])), pw.InputError, 'did you mean "steer.phi"'),
    (lambda: pw.Feedback(3, ["steer.phi"]), pw.InputError, "expected functions"),
    (lambda: roller(pw.Feedback(lambda t, x: 0.0, [3])), pw.InputError, "reads: expected a text"),
    (lambda: roller(pw.Feedback(lambda t, x: x[1], "steer.phi")), IndexError, "range"),
    (lambda: roller(pw.Feedback(lambda t, x: "a", ["steer.phi"])), pw.InputError, "signal rider: expected a number"),
    (lambda: roller(pw.Feedback(lambda t, x: 0.0, ["steer.phi"], lambda t, x: [1, 2]), method="radau"), pw.InputError, "expected a gradient of 1 numbers, found 2"),
])
def test_refusals_of_feedback(make, kind, text):
    with pytest.raises(kind, match=text):
        make()


def test_a_failing_feedback_keeps_the_samples():
    with pytest.raises(ZeroDivisionError) as raised:
        roller(pw.Feedback(lambda t, x: 1 / 0 if t > 1 else 0.0, "steer.phi"))
    assert raised.value.result.t[-1] == 0.5 and "rider" in raised.value.result.reason


# ---- Contents ----

def test_contents_of_a_model_are_known_without_a_run():
    model = pw.describe(parameters=[{"name": "m", "value": 3.0}], bodies=[pw.Body("a", mass="m", inertia=0.5), pw.Body("b", mass=1, inertia=2)], elements=[
        pw.Pin("p", body=["a", "b"], at=[[1, 0], [-1, 0]]), pw.Force("f", body="a", fx="z"), pw.State("z", rate="1 - z", unit="N")],
        outputs=[{"name": "far", "value": "a.x - b.x", "unit": "m"}])
    assert model.bodies == {"a": {"mass": 3, "inertia": 0.5}, "b": {"mass": 1, "inertia": 2}}
    assert {name: model.elements[name] for name in ("p", "f")} == {"p": "pin", "f": "force"}
    assert list(model.states) == model.run(t_end=0.01).states and model.states["a.omega"] == "rad/s" and model.states["z"] == "N"
    assert model.outputs == {"far": "m"} and model.inputs["f.fx"] == "N"
    assert model.columns == model.run(t_end=0.01, energy=True).units
    assert model.replace(m=4).bodies["a"]["mass"] == 4


@pytest.mark.parametrize("name", ["ezyroller", "n-trailer", "car-tyres"])
def test_every_input_can_be_set(name):
    model = pw.Model(name)
    for signal, unit in model.inputs.items():
        assert isinstance(unit, str)
        model._compile({signal: 0.25})


# ---- Results ----

def test_results_are_like_dicts():
    r = pw.Model("pendulum").run(t_end=0.1)
    assert r.get("bob.x") is not None and r.get("bob.xx") is None and r.get("bob.xx", 3) == 3
    assert [name for name, _ in r.items()] == list(r) == list(r.keys()) and all(np.array_equal(a, b) for (_, a), b in zip(r.items(), r.values()))
    assert list(r._ipython_key_completions_()) == list(r)
    assert {"residual.position", "residual.velocity", "steps", "restarts"} <= set(r.statistics)
    with pw.Model("ezyroller").open(inputs={"rider": 0}) as simulation:
        assert simulation.inputs._ipython_key_completions_() == ["rider"]


def test_plots_have_the_values_of_the_run(tmp_path):
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    r = pw.Model("ezyroller").run(t_end=3, energy=True)
    figure = r.plot()
    paths, *panels = figure.axes
    lines = {line.get_label(): line for line in paths.get_lines()}
    assert {"frame", "steer", "A", "C"} <= set(lines) and np.array_equal(lines["A"].get_ydata(), r["A.y"])
    assert [axes.get_ylabel() for axes in panels] == ["[rad]", "[m/s]", "[rad/s]", "[J]"]
    assert {line.get_label() for line in panels[-1].get_lines()} == {"kinetic", "work", "balance"}
    figure.savefig(tmp_path / "run.png")
    one, two = r.plot("steer.phi", "frame.phi", "A.N").axes
    assert np.array_equal(one.get_lines()[1].get_ydata(), r["frame.phi"]) and two.get_ylabel() == "[N]"
    with pytest.raises(KeyError, match="steer.phi"):
        r.plot("steer.ph")
    plt.close("all")


def test_plots_show_events():
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)], elements=[
        pw.Wheel("w", body="a", at=[0, 0], grip=1.0), pw.Force("push", body="a", fx=0, fy="2*t")])
    r = model.run(t_end=1)
    lines = [line for line in r.plot("a.vy").axes[0].get_lines() if line.get_label() == "event"]
    assert len(r.events) == 1 and lines[0].get_xdata()[0] == r.events[0]["t"] == pytest.approx(0.5, abs=1e-9)
    plt.close("all")


def test_animations_are_written(tmp_path):
    r = pw.Model("pendulum").run(t_end=1)
    assert r.animate(tmp_path / "a.html") == tmp_path / "a.html" and "pendulum" in (tmp_path / "a.html").read_text()
    assert r.animate()._repr_html_() == r._repr_html_()
    with pytest.raises(pw.InputError, match="functions in Python"):
        roller(lambda t: 0.0).animate(tmp_path / "b.html")


# ---- Analyses ----

@pytest.mark.parametrize("call, text", [
    (lambda m: m.fit(columns="bob.x", free="l"), "missing a required argument: 'data'"),
    (lambda m: m.steady(3), "too many positional arguments"), (lambda m: m.steady(hod={"bob.x": 1}), "unexpected keyword argument 'hod'"),
    (lambda m: m.optimise(free={"theta": (-1, 1)}, maximise="max:bob.xx"), "bob.x"),
])
def test_options_of_analyses_have_names(call, text):
    with pytest.raises(pw.InputError, match=text):
        call(pw.Model("pendulum"))


@pytest.mark.parametrize("name", ["check", "compare", "drift", "steady", "periodic", "sensitivity", "fit", "optimise"])
def test_analyses_have_the_options_of_the_program(name):
    """All but those of the model and of what is returned."""
    options = {o.replace("-", "_") for o in re.findall(r"^ +(?:-\w, )?--([\w-]+)", pw.help_of(name), re.M)}
    assert options - {"json", "set", "start", "max_file", "help", "table"} == set(inspect.signature(getattr(pw.Model, name)).parameters) - {"self"}


def test_analyses_write_tables_and_figures(tmp_path):
    model = pw.Model("pendulum")
    compared = model.compare(t_end=0.5, methods="rk4", step_ladder="1e-2:1e-3", output=tmp_path / "c.csv")
    assert set(compared["method"]) == {"rk4"} and (tmp_path / "c.csv").exists()
    found = model.sensitivity(of="bob.x", by="l", t_end=1, every=0.5, output=tmp_path / "s.npz", plots=tmp_path)
    table = np.load(tmp_path / "s.npz")
    assert found["outputs"] and len(table["t"]) == 3 and list(tmp_path.glob("*.png"))


def test_options_of_analyses_reach_the_command():
    model = pw.Model("pendulum")
    assert set(model.compare(t_end=0.5, methods=["rk4", "erk8"], rtol_ladder=(1e-6, 1e-8))["method"]) == {"rk4", "erk8"}
    best = model.optimise({"theta": (-1, 1)}, maximise="max:bob.vx", subject_to="max:bob.vx<=100", starts=2, seed=3, t_end=1)
    assert best["unknowns"][0]["name"] == "theta"
    t = np.linspace(0, 1, 11)
    data = {"time": 1000 * t, "bob.x": pw.Model("pendulum", l=1.2).run(times=t)["bob.x"]}
    found = model.fit(data, ["bob.x"], {"l": (0.5, 2, "log")}, time="time", time_scale=1e-3, sigma={"bob.x": 0.01}, confidence=0.9)
    assert found["unknowns"][0]["value"] == pytest.approx(1.2, abs=1e-6)
    motions = pw.Model("n-trailer").steady(hold={"tractor.vx": 1.0}, starts=3)["motions"]
    assert motions
