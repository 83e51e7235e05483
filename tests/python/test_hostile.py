"""Hostile calls: whatever is passed, and in whatever order, an exception that says why, and never a crash."""

import copy
import gc
import itertools
import os
import pickle
import signal
import threading
import time

import numpy as np
import pytest

import pinwheel as pw

NAN, INF = float("nan"), float("inf")
BODY = {"name": "a", "mass": 1, "inertia": 1}


@pytest.fixture(scope="module")
def model():
    return pw.Model("ezyroller")


def signals(function):
    return pw.Model("ezyroller", signals={"rider": function})


# By kind of argument: expressions with m = Model("ezyroller"), and a part of the message.
REFUSED = {
    "names": [
        ("pw.Model(None)", "None"), ("pw.Model('')", "missing"), ("pw.Model('\\0')", "expected a text"),
        ("pw.Model('snakeboard\\0x')", "expected a text"), ("pw.Model(b'snakeboard')", "snakeboard"), ("pw.Model([])", "[]"),
        ("pw.Model('\\ud800')", "no model"), ("pw.sweep(None, {'a': [1]})", "None"), ("pw.command('check', '\\0')", "expected a text"),
        ("pw.command(None, m)", "expected a text"), ("pw.command('', m)", "no command"), ("pw.command('nothing', m)", "no command"),
        ("pw.command('run', m, nonsense=3)", "--nonsense"), ("pw.command('check', m, 'a\\0b')", "null"),
        ("m.run(3)", "method: expected a text, found 3"), ("m.run('')", "integrator"), ("m.run('rk4\\0')", "expected a text"),
        ("m.run(specialise='yes')", "specialise"), ("m.run(b'rk4')", "expected a text"), ("m.run('rk4+')", "stabilisation"), ("m.run('rk4:' * 1000)", "option"),
        ("m.run('\u00e9' * 1000)", "too long"), ("m.run(start={3: 1})", "start: expected a text"), ("m.run(start={'': 1})", "state"),
        ("m.open(inputs={None: 0})", "inputs: expected a text"), ("m.open(inputs={'ride': 0})", "rider"),
        ("m.open(inputs={'frame': 0})", "frame"), ("pw.Pin('p', bdy=1)", "did you mean 'body'"), ("pw.Pin('p')", "needs 'body'")],
    "numbers": [
        ("pw.Model('snakeboard', swing='abc')", "expected a number"), ("pw.Model('snakeboard', swing=None)", "expected a number"),
        ("pw.Model('snakeboard', swing=[1, 2])", "expected a number"), ("pw.Model('snakeboard', swing=1j)", "expected a number"),
        ("pw.Model('snakeboard', swing=10**400)", "expected a number"), ("pw.Model('snakeboard', swing=NAN).run()", "swing = nan"),
        ("pw.Model('snakeboard', swing=np.zeros(2))", "expected a number"), ("m.run(start={'frame.x': NAN})", "frame.x = nan"),
        ("m.run(start={'frame.x': 'a'})", "frame.x = 'a'"), ("m.run(start={'frame.vx': 1e300})", "extreme"),
        ("m.run(t_end=NAN)", "t_end"), ("m.run(t_end=INF)", "expected a finite number"), ("m.run(t_end=-1)", "t_end"), ("m.run(t_end='a')", "t_end"),
        ("m.run(t_end=[])", "t_end"), ("m.run(every=NAN)", "every"), ("m.run(every=INF)", "every"), ("m.run(every=0)", "every"),
        ("m.run(every='a')", "every"), ("m.run(every=1e-300)", "memory"), ("m.run(every=1e-10)", "memory"), ("m.run(t_end=1e300, every=1)", "setting step"),
        *[(f"m.run({name}={value})", name) for name in ("step", "rtol", "atol", "max_steps") for value in ("0", "-1", "NAN", "INF", "'a'")],
        ("m.run(max_steps=1.5)", "whole number"), ("m.run(max_steps=10**30)", "whole number"), ("m.linearise(NAN)", "at = nan"),
        ("m.linearise(-1)", "at = -1"), ("m.linearise('a')", "at = 'a'"), ("m.linearise(0, 0)", "most"), ("m.linearise(0, None)", "most"),
        ("m.linearise(0, 2)", "raise `most`"), ("m.open().advance(NAN)", "finite"), ("m.open().advance(INF)", "finite"),
        ("m.open().advance('a')", "expected a number"), ("m.open().advance(-1)", "has reached"), ("m.open().record(-1)", "has reached"),
        ("m.open().record(None)", "t_end"), ("m.open(inputs={'rider': 'a'})", "rider = 'a'"),
        ("m.open(inputs={'rider': 0}).inputs.update(rider=NAN)", "finite"), ("m.open(inputs={'rider': 0}).inputs.update(rider=None)", "number")],
    "shapes": [
        *[(f"m.run(t_end=1, times={times})", "times: expected an array of shape (n,)")
          for times in ("[]", "3", "'abc'", "[NAN]", "[0, NAN, 1]", "[INF]", "[-1]", "[0, 0]", "[0, 2]", "[[0], [1]]", "[None]",
                        "np.linspace(0, 1, 7)[::-1]", "[1, [2, 3]]")],
        ("m.run(start=7)", "start: expected a dict"), ("pw.Model('ezyroller', signals=3)", "signals: expected a dict"),
        ("m.open(inputs=['rider'])", "inputs: expected a dict"), ("pw.sweep(m, 3)", "vary: expected a dict"),
        ("pw.sweep(m, {'a': []})", "vary a"), ("pw.sweep(m, {'a': [[1, 2]]})", "found shape (1, 2)"), ("pw.sweep(m, {'a': 'x'})", "number"),
        ("pw.sweep(m, {'nothing': [1]})", "nothing"), ("pw.sweep(m, {'a': [1]}, executor=3)", "executor"), ("pw.sweep(m, {'a': [1]}, t_end=-1)", "t_end"),
        ("m.fit(data={'t': [0, 1], 'frame.x': [1]}, columns='frame.x', free='a')", "data"), ("m.fit(data=3, columns='frame.x', free='a')", "data")],
    "descriptions": [
        ("pw.describe()", "has no body"), ("pw.describe(bodies=3)", "bodies"), ("pw.describe(bodies=[3])", "bodies"), ("pw.describe(bodies=[{}])", "bodies"),
        ("pw.describe(elements=[{}])", "elements"), ("pw.describe(elements='pin')", "elements"), ("pw.describe(bodies=[BODY], parameters=3)", "parameters"),
        ("pw.describe(bodies=[BODY], let=[1])", "let"), ("pw.describe(bodies=[{'name': 'a', 'mass': -1}])", "mass = -1"),
        ("pw.describe(bodies=[{'name': 'a', 'mass': NAN}])", "NaN"), ("pw.describe(bodies=[{'name': 'a', 'mass': object()}])", "description"),
        ("pw.describe(bodies=[{'name': 'a\\0b', 'mass': 1}])", "character 0"), ("pw.describe(bodies=[BODY] * 2)", "already"),
        ("pw.describe(bodies=[BODY], signals=[1])", "signals: expected a dict"),
        ("pw.describe(bodies=[BODY], elements=[{'pn': 'p'}])", 'did you mean "pin"'), ("pw.describe(bodies=[BODY], nonsense=3)", "nonsense"),
        *[(f"pw.describe({name}, bodies=[BODY])", "name") for name in ("'a/b'", "'../x'", "''", "'\\0'", "None", "'a' * 300")]],
    "functions": [
        ("signals(3)", "expected a function"), ("signals(None)", "expected a function"), ("signals(lambda: 0).run()", "TypeError"),
        ("signals(lambda t: 'a').run()", "convert"), ("signals(lambda t: None).run()", "NoneType"), ("signals(lambda t: NAN).run()", "finite"),
        ("signals(lambda t: (0,) * 100000).run()", "found 100000"), ("signals(lambda t: ()).run()", "found 0"), ("signals(lambda t: [1j]).run()", "complex"),
        ("signals(lambda t: np.zeros(7)).run()", "found 7"), ("signals(recursive).run()", "RecursionError"),
        ("pw.Model('ezyroller', signals={'frame': lambda t: 0}).run()", "frame"), ("pw.Model('ezyroller', signals={3: lambda t: 0})", "expected a text")],
}


def recursive(t):
    return recursive(t)


@pytest.mark.parametrize("kind, call, text", [(kind, *case) for kind, cases in REFUSED.items() for case in cases])
def test_refused(model, kind, call, text):
    with pytest.raises(pw.Error) as raised:
        made = eval(call, {**globals(), "m": model})  # noqa: S307: the calls above
        if isinstance(made, pw.Model):
            made.run(t_end=0.01)
    assert text in str(raised.value), str(raised.value)


@pytest.mark.parametrize("call", ["advance(1)", "sample()", "t", "statistics", "record(1)"])
def test_closed_runs_are_refused(model, call):
    simulation = model.open()
    simulation.close()
    simulation.close()
    with pytest.raises(pw.Error, match="the run is closed"):
        eval(f"simulation.{call}")  # noqa: S307


@pytest.mark.parametrize("call", ["close()", "advance(1)", "sample()", "t", "record(1)"])
def test_a_run_in_use_is_refused(call):
    """From a function that the run calls, and from another thread."""
    box, seen = [], []

    def value(t):
        if box:
            try:
                eval(f"box[0].{call}", {"box": box})  # noqa: S307
            except pw.Error as failure:
                seen.append(str(failure))
        return 0.0

    box.append(signals(value).open())
    box[0].advance(0.01)
    assert seen and all("in use" in text for text in seen)


def test_a_run_is_not_closed_below_a_thread(model):
    simulation, outcome = model.open(), []
    thread = threading.Thread(target=lambda: outcome.append(simulation.record(20, every=20).t[-1]))
    thread.start()
    while not simulation._lock.locked():
        time.sleep(0)
    with pytest.raises(pw.Error, match="in use"):
        simulation.close()
    thread.join()
    assert outcome == [20]


@pytest.mark.parametrize("leave", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_what_functions_raise_to_leave_python_passes(leave):
    def value(t):
        raise leave
    with pytest.raises(leave):
        signals(value).run(t_end=0.1)


def test_an_interrupt_in_a_function_keeps_the_samples():
    def value(t):
        if t > 0.05:
            os.kill(os.getpid(), signal.SIGINT)
        return 0.0
    r = signals(value).run(t_end=1)
    assert r.status == "stopped" and 0.04 < r.t[-1] < 1


def test_an_interrupt_in_a_function_ends_runs_by_methods_that_shorten_the_step():
    calls = []

    def value(t):
        calls.append(t)
        if len(calls) == 40:
            raise KeyboardInterrupt
        return 0.1 * np.cos(t)
    r = signals(value).run("radau", t_end=1000)
    assert r.status == "stopped" and r.t[-1] < 1000


def test_interrupts_are_noticed_between_few_steps():
    """A step takes 20 ms: Ctrl-C cannot wait for many of them."""
    def value(t):
        time.sleep(0.005)
        return 0.0
    timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    r = signals(value).run("rk4", t_end=0.2)
    assert r.status == "stopped" and len(r) < 100


def test_interrupts_end_sweeps(model):
    """Runs of hours in threads end, too."""
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        pw.sweep(model, {"a": [0.5, 0.51, 0.52]}, t_end=1e8)


def test_tables_larger_than_the_memory_are_refused(model, monkeypatch):
    """Those whose size is not known in advance keep what fits."""
    monkeypatch.setattr(pw.simulation, "_MEMORY", 8 * 31 * 20000)
    with pytest.raises(pw.ResourceError, match="out of memory"):
        model.run(t_end=100, every=1e-3)
    with pytest.raises(pw.ResourceError, match="1e\\+10 samples"):
        model.run(t_end=10, every=1e-9)
    r = model.run("rk4+projection", t_end=100, step=1e-3)
    assert r.status == "failed" and "out of memory" in r.reason and len(r) == 20000
    assert len(model.run("rk4+projection", t_end=15, step=1e-3)) == 15001


def test_exceptions_of_progress_pass_and_the_run_goes_on(model):
    with model.open() as simulation:
        with pytest.raises(ZeroDivisionError):
            simulation.record(1, progress=lambda done: 1 / 0)
        with pytest.raises(pw.Error, match="in use"):
            simulation.record(2, progress=lambda done: simulation.close())
        assert simulation.record(3).status == "ok"


def test_inputs_keep_their_names(model):
    with model.open(inputs={"rider": 0.0}) as simulation:
        for change in (lambda i: i.clear(), lambda i: i.pop("rider"), lambda i: i.update(other=1), lambda i: i.setdefault("other", 1)):
            with pytest.raises((TypeError, KeyError)):
                change(simulation.inputs)
        assert dict(simulation.inputs) == {"rider": 0.0}


def test_every_way_to_set_inputs_reaches_the_run():
    model = pw.describe(bodies=[BODY], elements=[{"torque": "motor", "body": ["a", "ground"], "value": 0}])
    with model.open("rk4", inputs={"motor": 0.0}) as simulation:
        simulation.inputs.update(motor=2.0)
        simulation.advance(1)
        assert simulation.sample()["a.omega"] == pytest.approx(2, abs=1e-12)


# ---- Copies, processes, memory ----

def test_open_runs_are_not_copied(model):
    with model.open() as simulation:
        for copier in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(TypeError, match="cannot be copied"):
                copier(simulation)
        simulation.advance(0.1)


@pytest.mark.parametrize("copier", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_are_the_same_and_outlive_the_original(copier):
    def made():
        return pw.describe("described", bodies=[BODY], parameters=[{"name": "k", "value": 2.0}], k=3.0, start={"a.vx": 1})
    expected = made().run(t_end=0.1).rows
    copied = copier(made())
    gc.collect()
    assert copied.replace().parameters == {"k": 3.0}
    assert np.array_equal(copied.run(t_end=0.1).rows, expected)
    result = copier(made().run(t_end=0.1))
    assert np.array_equal(result.rows, expected) and result.model.name == "described"


def test_models_with_functions_are_copied_but_not_pickled():
    model = signals(lambda t: 0.1)
    assert np.array_equal(copy.deepcopy(model).run(t_end=0.1).rows, model.run(t_end=0.1).rows)
    with pytest.raises(TypeError, match="functions"):
        pickle.dumps(model)


def test_any_order_of_deletion():
    gc.freeze()  # what the other tests have left takes long to look at
    for order in itertools.permutations(range(4)):
        model = signals(lambda t: 0.1)
        simulation = model.open()
        result = simulation.record(0.01)
        held = [model, simulation, simulation.inputs, result]
        del model, simulation, result
        for i in order:
            held[i] = None
            gc.collect()
    gc.unfreeze()


def test_objects_without_init_do_not_crash():
    for kind in (pw.Model, pw.Simulation, pw.Result):
        made = kind.__new__(kind)
        for name in ("run", "open", "t", "close", "linearise", "final"):
            try:
                getattr(made, name)()
            except (AttributeError, TypeError, pw.Error):
                pass
        del made
    gc.collect()
