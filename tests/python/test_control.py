"""Steps of a caller: controllers, learning, saved states, many vehicles."""

import gc
import math
import os
import pathlib
import sys
import types
import warnings

import numpy as np
import pytest

import pinwheel as pw

TOP = pathlib.Path(__file__).resolve().parents[2]
METHODS = ["rk4+projection", "rk4+none", "erk5+projection", "erk8", "adams", "bdf+projection", "ida+ggl", "ida+baumgarte", "radau+ggl",
           "galpha", "leapfrog"]


@pytest.fixture
def roller():
    with pw.Model("ezyroller").open("rk4+projection", inputs={"rider": 0.0}) as simulation:
        yield simulation


def driven(simulation, steps=30, dt=0.01):
    """The states after steps with different torques."""
    return np.array([(simulation.step(0.1 * math.sin(k), dt), simulation.observe())[1].copy() for k in range(steps)])


# ---- Control loops ----

# A Chaplygin sleigh with PI control of its yaw rate, torque 2 (0.5 - omega) + z, z' = 0.5 - omega: x, y, phi, omega at 5 s
# from the equations in minimal coordinates by extrapolation with 30 digits.
YAW_RATE = np.array([1.166661059, 4.40253730653, 2.33153029684, 0.486864505218])


def sleigh(torque=0, *states):
    return pw.describe("sleigh", bodies=[pw.Body("sleigh", mass=1, inertia=0.2, rate={"vx": 1})], elements=[
        pw.Wheel("edge", body="sleigh", at=[-0.3, 0]), pw.Torque("motor", body=["sleigh", "ground"], value=torque), *states])


def controlled(dt):
    """The sleigh at 5 s with a controller that acts every dt."""
    with sleigh().open("erk8+projection", rtol=1e-12, inputs={"motor": 0.0}) as simulation:
        integral, omega = 0.0, 0.0
        for _ in range(round(5 / dt)):
            simulation.step(2 * (0.5 - omega) + integral, dt)
            (before, omega) = omega, simulation.observe(("sleigh.omega",))[0]
            integral += dt * (0.5 - (before + omega) / 2)
        return simulation.observe(("sleigh.x", "sleigh.y", "sleigh.phi", "sleigh.omega")).copy()


def test_a_controller_in_python_converges_to_continuous_feedback():
    """A torque that is held is late by dt/2: errors of order dt, which extrapolation removes, then dt^2."""
    held = [controlled(0.1 / 2**k) for k in (1, 2, 3)]
    once = [2 * fine - coarse for coarse, fine in zip(held, held[1:])]
    for values, order in ((held, 1), (once, 2)):
        assert np.log2(np.abs(values[0] - YAW_RATE) / np.abs(values[1] - YAW_RATE)) == pytest.approx([order] * 4, abs=0.15)
    assert np.abs((4 * once[1] - once[0]) / 3 - YAW_RATE).max() < 0.1 * 0.025**2 / 2  # the terms of dt^2 are gone, too


def test_feedback_of_a_text_model_has_the_reference_digits():
    """What the controller in Python converges to, in words of the model."""
    model = sleigh("2*(0.5 - sleigh.omega) + z", pw.State("z", rate="0.5 - sleigh.omega"))
    final = model.run("erk8+projection", t_end=5, rtol=1e-12, every=5).final
    assert [final[f"sleigh.{n}"] for n in ("x", "y", "phi", "omega")] == pytest.approx(YAW_RATE, abs=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_steps_are_those_of_inputs_and_advance(method):
    model = pw.Model("ezyroller")
    with model.open(method, rtol=1e-8, inputs={"rider": 0.0}) as stepped, model.open(method, rtol=1e-8, inputs={"rider": 0.0}) as advanced:
        for k in range(12):
            stepped.step(0.1 * math.sin(k), 0.01)
            advanced.inputs["rider"] = 0.1 * math.sin(k)
            advanced.advance(advanced.t + 0.01)
            sample = advanced.sample()
            assert np.array_equal(stepped.observe(list(sample)), list(sample.values()))
            assert stepped.state == {name: sample[name] for name in stepped.states}
            assert stepped.time == stepped.t == sample["t"] and dict(stepped.inputs) == dict(advanced.inputs)


def test_inputs_have_three_forms():
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)],
                        elements=[pw.Force("f", body="a", fx=0, fy=0), pw.Torque("m", body=["a", "ground"], value=0)])
    with model.open("rk4", inputs={"m": 0.5, "f.fy": 0.0}) as simulation:
        simulation.step(dt=1.0)
        simulation.step([1.0, 2], 1)
        simulation.step({"f.fy": -2}, 1.0)
        assert list(simulation.observe(("a.omega", "a.vy", "a.vx"))) == pytest.approx([2.5, 0, 0], abs=1e-12)
        assert dict(simulation.inputs) == {"m": 1, "f.fy": -2}
    with model.open("rk4", step=0.25) as simulation:
        simulation.step()
        assert simulation.time == 0.25 and simulation.inputs == {}


def test_inputs_of_velocity_constraints_act_at_once():
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)],
                        elements=[pw.Wheel("w", body="a", at=[0, 0]), pw.Speed("drive", body="a", at=[0, 0], value=0)])
    with model.open("erk5+projection", inputs={"drive": 0.0}) as simulation:
        simulation.step(2.0, 0.0)
        assert simulation.state["a.vx"] == pytest.approx(2, abs=1e-14)
        simulation.step(-1.0, 1.0)
        assert simulation.state["a.x"] == pytest.approx(-1, abs=1e-12)


def test_reactions_with_limits_accept_inputs():
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)], elements=[
        pw.Wheel("w", body="a", at=[0, 0], grip=1.0), pw.Force("push", body="a", fx=0, fy=0)])
    with model.open("rk4+projection", inputs={"push.fy": 0.0}) as simulation:
        simulation.step(0.9, 1.0)
        assert simulation.state["a.y"] == pytest.approx(0, abs=1e-14)
        simulation.step(3.0, 1.0)  # slides with 3 N - 1 N
        assert simulation.state["a.vy"] == pytest.approx(2, abs=1e-12)
        result = simulation.record(2.5)
        assert [event["to"] for event in result.events] == ["slides+"] and result.events[0]["t"] == 1


@pytest.mark.parametrize("call, kind, text", [
    ("step([1, 2])", pw.InputError, r"inputs: expected shape \(1,\), found \(2,\)"), ("step('a')", pw.InputError, "inputs: expected numbers"),
    ("step({'ridr': 1})", KeyError, "did you mean 'rider'"), ("step(math.nan)", pw.InputError, "input rider.value = nan"),
    ("step(0.0, -1.0)", pw.InputError, "dt = -1: expected a finite time >= 0"), ("step(0.0, 'x')", pw.InputError, "dt = 'x'"),
    ("step(0.0, math.nan)", pw.InputError, "dt = "), ("step(0.0, math.inf)", pw.InputError, "dt = inf"),
    ("observe(['frame.xx'])", KeyError, "did you mean 'frame.x'"), ("observe('frame.xx')", KeyError, "did you mean"),
    ("reset({'frame.vxx': 1})", pw.InputError, "did you mean .frame.vx.?"), ("reset({'frame.x': 'a'})", pw.InputError, "frame.x = 'a'"),
    ("reset([1, 2])", pw.InputError, r"state: expected shape \(12,\)"), ("reset({'frame.x': math.nan})", pw.InputError, "state 0 = nan"),
    ("set_state(q=[1])", pw.InputError, r"q: expected shape \(6,\), found \(1,\)"), ("set_state(t='now')", pw.InputError, "t = 'now'"),
    ("set_state({'rider': 1})", pw.InputError, 'has no state "rider"'), ("load(b'')", pw.InputError, "load: expected the bytes"),
    ("load('text')", pw.InputError, "load: expected the bytes"), ("load(b'[[], 0, [0]]\\n' + bytes(400))", pw.InputError, "does not belong to this run"),
    ("load(simulation.save()[:-9])", pw.InputError, "does not belong to this run"), ("load(b'[[[0, 1]], 0, [0, 1]]\\n')", pw.InputError, "inputs"),
])
def test_refusals_leave_the_simulation_as_it_was(roller, call, kind, text):
    roller.step(0.1, 0.1)
    before, bits = roller.state, roller.save()
    with pytest.raises(kind, match=text):
        eval(f"simulation.{call}", {"simulation": roller, "math": math})  # noqa: S307
    roller.inputs["rider"] = 0.1
    assert roller.state == before and roller.save()[:200] == bits[:200]
    expected = pw.Model("ezyroller").open("rk4+projection", inputs={"rider": 0.0})
    expected.step(0.1, 0.1)
    for simulation in (roller, expected):
        simulation.save()
        simulation.step(0.2, 0.1)
    assert roller.state == expected.state


def test_a_closed_simulation_refuses_steps(roller):
    roller.close()
    for call in (roller.step, roller.observe, roller.reset, roller.save, lambda: roller.load(b"[[], 0, [0]]\n"), lambda: roller.state):
        with pytest.raises(pw.Error, match="the run is closed"):
            call()


def test_functions_in_python_raise_in_steps():
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)], elements=[
        pw.Torque("m", body=["a", "ground"], value=lambda t: 1 / 0 if t > 0.5 else 1.0), pw.Force("f", body="a")])
    with model.open("rk4", inputs={"f.fx": 0.0}) as simulation:
        simulation.step(1.0, 0.5)
        with pytest.raises(ZeroDivisionError) as raised:
            simulation.step(1.0, 0.5)
        assert "m" in str(getattr(raised.value, "__notes__", "")) and 0.5 <= simulation.time < 0.6
        assert simulation.state["a.omega"] == pytest.approx(simulation.time, abs=1e-12)
    with pw.VectorSimulation(model, 3) as vehicles:
        vehicles.step(dt=0.25)
        assert vehicles.observe("a.omega") == pytest.approx(0.25, abs=1e-12)
        with pytest.raises(ZeroDivisionError):
            vehicles.step(dt=0.5)


def test_views_are_not_allocated_again(roller):
    view = roller.observe(("frame.x", "steer.phi"))
    roller.step(0.1, 0.1)
    first = view.copy()
    assert roller.observe(["frame.x", "steer.phi"]).base is view.base and not np.array_equal(view, first)


# ---- States ----

def test_reset_begins_a_run(roller):
    begun = roller.state
    expected = driven(roller)
    roller.reset()
    assert roller.time == 0 and roller.state == begun and dict(roller.inputs) == {"rider": 0}
    assert np.array_equal(driven(roller), expected)
    roller.reset({"frame.y": 0.5})
    run = pw.Model("ezyroller").run("rk4+projection", t_end=0, start={"frame.y": 0.5})
    assert [roller.state[name] for name in roller.states] == [run[name][0] for name in roller.states]
    values = list(roller.state.values())
    roller.reset(np.array(values))
    assert list(roller.state.values()) == pytest.approx(values, abs=1e-14)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # values of the model may change without notice
        roller.reset({"frame.phi": 0.3})
    with pytest.warns(UserWarning, match="initial values were changed to satisfy the constraints: frame.omega from 0 to 2 rad/s"):
        roller.reset({"frame.vy": 1, "frame.omega": 0})
    assert roller.changed["frame.omega"] == (0, pytest.approx(2))


def test_reset_draws_from_the_generator(roller):
    def state(generator):
        return {"frame.phi": generator.uniform(-1, 1)}
    roller.reset(state, seed=3)
    first = roller.state["frame.phi"]
    roller.reset(state)
    second = roller.state["frame.phi"]
    roller.reset(state, seed=3)
    assert roller.state["frame.phi"] == first != second


def test_a_refused_reset_changes_nothing(roller):
    four_bar = pw.Model("n-four-bar")
    with four_bar.open() as simulation:
        simulation.step(dt=0.01)
        before = simulation.state
        with pytest.raises(pw.Error):
            simulation.reset(dict.fromkeys(simulation.states, 1e120))
        assert simulation.state == before and simulation.time == 0.01


def test_set_state_moves_the_vehicle_and_the_clock():
    text = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)], elements=[
        pw.Force("f", body="a", fx="z"), pw.State("z", rate="cos(t)")])
    with text.open("erk8", rtol=1e-12) as simulation:
        simulation.step(dt=1.0)
        simulation.set_state(q=[1, 2, 3], v={"a.vx": 4, "a.vy": 5, "a.omega": 6}, z=[0], t=math.pi)
        assert simulation.time == math.pi and list(simulation.state.values()) == [1, 2, 3, 4, 5, 6, 0]
        simulation.step(dt=1.0)
        assert simulation.state["z"] == pytest.approx(-math.sin(1), abs=1e-11)
        simulation.set_state(q={"a.x": 0})
        assert simulation.time == math.pi + 1 and simulation.state["a.x"] == 0 and simulation.state["a.y"] == pytest.approx(7, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_saved_states_continue_with_the_same_bits(method):
    model = pw.Model("ezyroller")
    with model.open(method, inputs={"rider": 0.0}, energy=True) as simulation:
        simulation.reset({"frame.y": 0.1})
        driven(simulation, 7)
        simulation.inputs["rider"] = 0.05
        saved = simulation.save()
        clone = simulation.clone()
        expected, names = driven(simulation), tuple(simulation.sample())
        last = simulation.observe(names).copy()
        assert np.array_equal(driven(clone), expected) and np.array_equal(clone.observe(names), last)
        simulation.load(saved)
        assert dict(simulation.inputs) == {"rider": 0.05} and clone.inputs["rider"] != 0.05
        assert np.array_equal(driven(simulation), expected) and np.array_equal(simulation.observe(names), last)
        with model.open(method, inputs={"rider": 0.0}, energy=True) as other:
            other.load(saved)
            assert np.array_equal(driven(other), expected)


def test_states_of_other_simulations_are_refused(roller):
    model = pw.Model("ezyroller")
    for other in (model.open("erk5+projection", inputs={"rider": 0.0}), model.open("rk4+projection", step=1e-4, inputs={"rider": 0.0}),
                  model.replace(a=0.6).open("rk4+projection", inputs={"rider": 0.0}), model.open("rk4+projection")):
        with other, pytest.raises(pw.InputError):
            other.load(roller.save())


def test_clones_draw_the_same_numbers(roller):
    roller.reset(seed=1)
    with roller.clone() as clone:
        assert clone.random.uniform() == roller.random.uniform()


# ---- Memory ----

def resident():
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_resets_need_no_memory(roller):
    """1e5 resets with a step each, and clones; the first tenth fills caches."""
    def work(n):
        for k in range(n):
            roller.reset({"frame.y": 1e-3 * k})
            roller.step(0.1, 1e-3)
            if k % 100 == 0:
                roller.load(roller.save())
                roller.clone().close()
        gc.collect()
        return resident()
    before = work(10_000)
    assert work(90_000) - before < 2e6  # 22 bytes for each, less than one allocation


# ---- Many vehicles ----

def torques(n, k):
    return 0.1 * np.sin(k // 2 + np.arange(n))[:, None]


@pytest.mark.parametrize("model, specialise, n, threads", [("ezyroller", "never", 5, 1), ("ezyroller", "always", 21, 2), ("ezyroller", "always", 3, 1)])
def test_each_of_many_vehicles_moves_as_if_alone(model, specialise, n, threads):
    model = pw.Model(model)
    with pw.VectorSimulation(model, n, "rk4+projection", inputs={"rider": 0.0}, specialise=specialise, threads=threads) as vehicles:
        vehicles.reset({"frame.y": np.arange(n) / 10, "frame.vx": 0.2})
        observed = [(vehicles.step(torques(n, k), dt), vehicles.observe().copy())[1] for k, dt in enumerate([1e-3, 1e-2, 5e-3] * 10)]
        assert vehicles.time == pytest.approx(0.16, abs=1e-12) and not vehicles.failed.any() and vehicles.reasons == {}
        for i in range(n):
            with model.open("rk4+projection", inputs={"rider": 0.0}, specialise=specialise) as alone:
                alone.reset({"frame.y": i / 10, "frame.vx": 0.2})
                for k, dt in enumerate([1e-3, 1e-2, 5e-3] * 10):
                    alone.step(torques(n, k)[i], dt)
                    assert np.array_equal(alone.observe(), observed[k][i]), (i, k)


def test_vehicles_may_have_parameters_of_their_own():
    masses = np.array([4.0, 5, 6])
    with pw.VectorSimulation("ezyroller", 3, "rk4+projection", inputs={"rider": 0.1}, parameters={"m1": masses}, specialise="always") as vehicles:
        vehicles.step(dt=0.1)
        for mass, row in zip(masses, vehicles.observe()):
            with pw.Model("ezyroller", m1=mass).open("rk4+projection", inputs={"rider": 0.1}, specialise="always") as alone:
                alone.step(dt=0.1)
                assert np.array_equal(alone.observe(), row)


def test_vehicles_are_reset_one_by_one():
    with pw.VectorSimulation("ezyroller", 4, inputs={"rider": 0.0}) as vehicles:
        vehicles.step([0.1, 0.2, 0.3, 0.4], 0.1)
        before = vehicles.observe().copy()
        vehicles.reset({"frame.y": [1, 2, 3, 4]}, which=[1, 3])
        after = vehicles.observe(("frame.y", "t"))
        assert after[:, 0].tolist() == [before[0, 1], 2, before[2, 1], 4] and after[:, 1].tolist() == [0.1, 0, 0.1, 0]
        vehicles.reset(lambda random: {"frame.y": random.uniform()}, seed=5)
        drawn = vehicles.observe("frame.y").copy()
        vehicles.reset(lambda random: {"frame.y": random.uniform()}, seed=5, which=[True, True, False, True])
        assert len(set(drawn[:, 0])) == 4 and np.array_equal(vehicles.observe("frame.y"), drawn)


def test_a_vehicle_that_fails_waits():
    """The force of one of three bodies has no value beyond x = 1."""
    model = pw.describe(bodies=[pw.Body("a", mass=1, inertia=1)], elements=[
        pw.Force("f", body="a", fx="sqrt(1 - a.x)"), pw.Torque("m", body=["a", "ground"], value=0)])
    with pw.VectorSimulation(model, 3, "rk4", inputs={"m": 0.0}) as vehicles:
        vehicles.reset({"a.vx": [0, 1, 0]})
        for _ in range(12):
            vehicles.step([1, 1, 1], 0.1)
        assert vehicles.failed.tolist() == [False, True, False] and list(vehicles.reasons) == [1] and "force f" in vehicles.reasons[1]
        observed = vehicles.observe(("t", "a.omega"))
        assert np.isnan(observed[1]).all() and observed[[0, 2]] == pytest.approx(1.2, abs=1e-12) and math.isnan(vehicles.time[1])
        vehicles.reset(which=vehicles.failed)
        vehicles.step(dt=0.1)
        assert not vehicles.failed.any() and vehicles.observe("t")[1, 0] == 0.1


@pytest.mark.parametrize("make, text", [
    (lambda: pw.VectorSimulation("ezyroller", 0), "n = 0"), (lambda: pw.VectorSimulation("ezyroller", 2.5), "n = 2.5"),
    (lambda: pw.VectorSimulation("ezyroller", 2, threads=-1), "threads = -1"),
    (lambda: pw.VectorSimulation("ezyroller", 2, parameters={"m1": [1]}), r"parameter m1: expected shape \(2,\), found \(1,\)"),
    (lambda: pw.VectorSimulation("chain", 2, parameters={"n": [3, 4]}), "same bodies and elements"),
    (lambda: pw.VectorSimulation("ezyroller", 2).reset({"frame.x": [1, 2, 3]}), r"state frame.x: expected shape \(2,\)"),
    (lambda: pw.VectorSimulation("ezyroller", 2).reset({"frame.xx": 1}), "did you mean .frame.x.?"),
    (lambda: pw.VectorSimulation("ezyroller", 2, inputs={"rider": 0}).step([[1], [2], [3]]), r"inputs: expected shape \(2, 1\), found \(3, 1\)"),
])
def test_refusals_of_many_vehicles(make, text):
    with pytest.raises(pw.InputError, match=text):
        make()


def test_vehicles_that_are_closed_refuse_steps():
    vehicles = pw.VectorSimulation("ezyroller", 2)
    vehicles.close()
    vehicles.step(dt=0.1)
    assert vehicles.failed.all() and "a run is missing" in vehicles.reasons[0]


# ---- Learning ----

def environment(monkeypatch):
    """The environment of the documentation; without Gymnasium, with the parts of it that it uses."""
    try:
        import gymnasium
    except ImportError:
        class Env:
            def reset(self, seed=None):
                if seed is not None:
                    self.np_random = np.random.default_rng(seed)

        class Box:
            def __init__(self, low, high, shape, dtype):
                self.low, self.high, self.shape = low, high, shape

            def sample(self):
                return np.random.default_rng(1).uniform(self.low, self.high, self.shape)

        gymnasium = types.ModuleType("gymnasium")
        gymnasium.Env, gymnasium.spaces = Env, types.SimpleNamespace(Box=Box)
        monkeypatch.setitem(sys.modules, "gymnasium", gymnasium)
    scope = {"__name__": "environment"}
    exec((TOP / "docs/environment.py").read_text(), scope)  # noqa: S102: the documentation of this repository
    return scope["EzyRoller"]()


def test_the_environment_passes_the_checker_of_gymnasium(monkeypatch):
    checker = pytest.importorskip("gymnasium.utils.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*infinity.*")  # velocities have no bounds
        checker.check_env(environment(monkeypatch), skip_render_check=True)


def test_the_environment_follows_the_interface(monkeypatch):
    """Seeds repeat episodes; observations are not overwritten; episodes end after their duration."""
    env = environment(monkeypatch)
    first, info = env.reset(seed=7)
    kept = first.copy()
    steps = [env.step(np.array([0.1])) for _ in range(200)]
    assert info == {} and np.array_equal(first, kept) and first.shape == env.observation_space.shape
    again, _ = env.reset(seed=7)
    repeated = [env.step(np.array([0.1])) for _ in range(200)]
    assert np.array_equal(first, again) and all(np.array_equal(a[0], b[0]) and a[1:] == b[1:] for a, b in zip(steps, repeated))
    assert [s[3] for s in steps] == [False] * 199 + [True] and not any(s[2] for s in steps)
    assert all(isinstance(s[1], float) and isinstance(s[2], (bool, np.bool_)) and isinstance(s[3], bool) for s in steps)
    env.close()
