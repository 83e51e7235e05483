"""Hostile calls: whatever is passed, and in whatever order, an exception that says why, and never a crash."""

import copy
import gc
import itertools
import math
import os
import pickle
import random
import re
import signal
import subprocess
import sys
import tempfile
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
        ("signals(3)", "expected a function"), ("signals(None)", "expected a function"),
        ("signals(lambda t: 'a').run()", "convert"), ("signals(lambda t: None).run()", "NoneType"), ("signals(lambda t: NAN).run()", "finite"),
        ("signals(lambda t: (0,) * 100000).run()", "found 100000"), ("signals(lambda t: ()).run()", "found 0"), ("signals(lambda t: [1j]).run()", "complex"),
        ("signals(lambda t: np.zeros(7)).run()", "found 7"), ("signals(lambda t: {1}).run()", "signal rider: expected a number"),
        ("pw.Model('ezyroller', signals={'frame': lambda t: 0}).run()", "frame"), ("pw.Model('ezyroller', signals={3: lambda t: 0})", "expected a text")],
}


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


# ---- Exceptions of functions, and of handlers of signals ----

METHODS = [f"{block[0]}+{name}" for block in re.findall(r"^  (\w+)  \(.*\n((?:    .*\n?)+)", pw._program.run(["list", "methods"]).stdout, re.M)
           for name in re.findall(r"^    \+(\w+)", block[1], re.M)]


class Alarm(Exception):
    pass


@pytest.fixture
def alarm():
    """A handler of SIGALRM that raises Alarm; how often it was called."""
    calls = []

    def handler(*_):
        calls.append(1)
        raise Alarm
    before = signal.signal(signal.SIGALRM, handler)
    gc.disable()  # Python drops what handlers raise in the finalizers of what other tests have left
    yield calls
    gc.enable()
    signal.setitimer(signal.ITIMER_REAL, 0)
    assert signal.getsignal(signal.SIGALRM) is handler
    signal.signal(signal.SIGALRM, before)


def pendulum(function):
    """A pendulum with a torque that is a function of the time."""
    return pw.describe(bodies=[{"name": "bob", "mass": 1, "inertia": 0.1, "start": {"x": 0, "y": -1}}],
                       elements=[{"gravity": "g", "acceleration": [0, -9.81]}, {"pin": "pivot", "body": ["bob", "ground"], "at": [[0, 1], [0, 0]]},
                                 {"torque": "motor", "body": ["bob", "ground"], "value": function}])


def smooth(t):
    return 0.3 * math.cos(3 * t)


def test_there_are_all_methods():
    assert len(METHODS) == 29 and "bdf+projection" in METHODS


@pytest.mark.parametrize("method", METHODS)
def test_signals_interrupt_runs_anywhere(method, alarm, capfd):
    """Also before the first and after the last instruction of a callback: no run ends with other numbers, or goes on."""
    model, chance = pendulum(smooth), random.Random(method)
    expected, interrupted, seconds = model.run(method, t_end=0.2), 0, 1e-3
    for _ in range(40):
        alarm.clear()
        try:
            signal.setitimer(signal.ITIMER_REAL, 1e-5 + seconds * chance.random())
            r = model.replace().run(method, t_end=0.2)
            signal.setitimer(signal.ITIMER_REAL, 0)
            assert not alarm and r.status == "ok"
            seconds *= 0.8
        except Alarm as failure:
            interrupted, seconds = interrupted + 1, seconds * 1.1
            r = getattr(failure, "result", expected)  # before the run or after it there is none
            assert r is expected or (r.status == "stopped" and "Alarm" in r.reason)
        assert np.array_equal(r.rows, expected.rows[:len(r)])
    assert interrupted > 5 and capfd.readouterr() == ("", "")


@pytest.mark.parametrize("method", METHODS)
def test_exceptions_of_functions_pass_with_the_result(method):
    def value(t):
        if t > 0.1:
            raise ZeroDivisionError("by what?")
        return smooth(t)
    model, expected = pendulum(value), pendulum(smooth).run(method, t_end=0.2)
    with pytest.raises(ZeroDivisionError, match="by what") as raised:
        model.run(method, t_end=0.2)
    r = raised.value.result
    assert r.status == "failed" and "torque motor: value" in r.reason and "ZeroDivisionError: by what?" in r.reason
    assert 1 <= len(r) < len(expected) and r.t[-1] <= 0.1 and np.array_equal(r.rows, expected.rows[:len(r)])


@pytest.mark.parametrize("method", METHODS)
def test_a_run_continues_after_an_interrupt(method, alarm):
    once = iter([True])

    def value(t):
        if t > 0.1 and next(once, False):
            signal.raise_signal(signal.SIGALRM)
        return smooth(t)
    expected = pendulum(smooth).run(method, t_end=0.2, times=[0.2])
    with pendulum(value).open(method) as simulation:
        with pytest.raises(Alarm):
            simulation.record(0.2)
        assert simulation.t <= 0.1
        assert simulation.record(0.2)["bob.x"][-1] == pytest.approx(expected["bob.x"][-1], abs=1e-5)


@pytest.mark.parametrize("leave", [KeyboardInterrupt, SystemExit, GeneratorExit, pw.MethodError, pw.InputError, StopIteration])
@pytest.mark.parametrize("t", [-1, 0.05])
def test_what_functions_raise_passes(leave, t):
    """When the run is opened, and during the run."""
    def value(now):
        if now > t:
            raise leave("from here")
        return 0.0
    with pytest.raises(leave, match="from here") as raised:
        signals(value).run(t_end=0.1)
    assert t < 0 or 0 < raised.value.result.t[-1] <= t


def test_recursion_passes():
    def value(t):
        return value(t)
    with pytest.raises(RecursionError):
        signals(value).run()


@pytest.mark.parametrize("call", ["linearise(at=0.2)", "open().advance(0.2)", "run(t_end=0.2, specialise='always')", "open(inputs={'fx': 0}).record(0.2)"])
def test_every_call_passes_exceptions(call):
    def value(t):
        if t > 0.1:
            raise ZeroDivisionError
        return 0.0
    model = pw.describe(bodies=[BODY], elements=[{"torque": "motor", "body": ["a", "ground"], "value": value},
                                                 {"torque": "fx", "body": ["a", "ground"], "value": 0}])
    with pytest.raises(ZeroDivisionError):
        eval(f"model.{call}")  # noqa: S307


def test_exceptions_stay_in_their_thread():
    def value(t):
        time.sleep(1e-4)  # the others continue
        if t > 0.005 and threading.current_thread().name != "good":
            raise RuntimeError(threading.current_thread().name)
        return 0.1
    model = signals(value)

    def work(name, seen):
        try:
            seen[name] = model.run("rk4", t_end=0.01).status
        except RuntimeError as failure:
            seen[name] = str(failure), failure.result.status
    for _ in range(20):  # one time in two, exceptions that threads confuse show
        seen = {}
        threads = [threading.Thread(target=work, args=(name, seen), name=name) for name in ("a", "good", "b", "c")]
        for call in (threading.Thread.start, threading.Thread.join):
            for thread in threads:
                call(thread)
        assert seen == {"good": "ok", **{name: (name, "failed") for name in "abc"}}


def test_an_interrupt_that_a_function_catches_ends_the_run(alarm):
    """It may have been a library below the function, which then returns anything."""
    def value(t):
        try:
            if t > 0.05:
                signal.raise_signal(signal.SIGALRM)
        except Alarm:
            return 1e9
        return 0.0
    with pytest.raises(Alarm) as raised:
        signals(value).run(t_end=1)
    assert np.array_equal(raised.value.result.rows, signals(lambda t: 0.0).run(t_end=1).rows[:len(raised.value.result)])


def test_an_interrupt_of_a_run_inside_a_function_ends_both(alarm):
    def value(t):
        if t > 0.05:
            with pytest.raises(Alarm):
                signals(lambda t: signal.raise_signal(signal.SIGALRM) or 0.0).run(t_end=0.1)
        return 0.0
    with pytest.raises(Alarm) as raised:
        signals(value).run(t_end=0.1)
    assert 0 < raised.value.result.t[-1] <= 0.05


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_a_finalizer_drops_ends_the_run(model, alarm):
    class Left:
        def __del__(self):
            signal.raise_signal(signal.SIGALRM)
    left = [Left()]
    for running in (model, signals(lambda t: left.clear() or 0.0)):
        with pytest.raises(Alarm) as raised:
            running.run(t_end=1e5, progress=lambda done: left.clear())
        assert running is not model or raised.value.result.status == "stopped"
        left.append(Left())
    left[0].__class__.__del__ = lambda self: None


def test_functions_can_set_handlers(alarm):
    handler = signal.getsignal(signal.SIGALRM)

    def value(t):
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
        return 0.0
    assert signals(value).run(t_end=0.01).status == "ok"
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_IGN
    signal.signal(signal.SIGALRM, handler)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_callback_that_does_not_begin_is_a_failure(method):
    """ctypes drops its exception, here of a debugger, and returns 0, which means success."""
    calls = itertools.count()

    def trace(frame, event, _):
        if event == "call" and frame.f_code.co_name == "evaluate" and next(calls) % 50 == 30:
            raise ZeroDivisionError
    model = pendulum(smooth)
    sys.settrace(trace)
    try:
        r = model.run(method, t_end=1)
    finally:
        sys.settrace(None)
    expected = pendulum(smooth).run(method, t_end=1)
    assert r.status == "failed" and "torque motor" in r.reason or method.startswith(("radau", "adams", "bdf", "ida"))
    assert r["bob.x"][-1] == pytest.approx(np.interp(r.t[-1], expected.t, expected["bob.x"]), abs=1e-3)


def test_ctrl_c_ends_a_loop_of_runs(model):
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(10**6):
            model.run(t_end=1)


def test_interrupts_are_noticed_between_few_steps():
    """A step takes 20 ms: Ctrl-C cannot wait for many of them."""
    def value(t):
        time.sleep(0.005)
        return 0.0
    timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt) as raised:
        signals(value).run("rk4", t_end=0.2)
    assert raised.value.result.status == "stopped" and len(raised.value.result) < 100


def test_functions_that_do_not_return_are_interrupted(alarm):
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    with pytest.raises(Alarm):
        signals(lambda t: time.sleep(1000)).run()


def test_a_function_that_raises_only_ends_its_run_of_a_sweep():
    def value(t):
        if t > 0.05:
            raise ZeroDivisionError("too late")
        return 0.0
    data = pw.sweep(signals(value), {"a": [0.5, 0.6]}, t_end=0.1)
    assert all("rider" in why and "ZeroDivisionError: too late" in why for why in np.asarray(data["failed"]))


def test_interrupts_end_sweeps(model):
    """Runs of hours in threads end, too."""
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        pw.sweep(model, {"a": [0.5, 0.51, 0.52]}, t_end=1e8)


def test_tables_larger_than_the_memory_are_refused(model, monkeypatch):
    """Those whose size is not known in advance keep what fits."""
    monkeypatch.setattr(pw.simulation, "_MEMORY", 8 * 20000 * len(model.run(t_end=0).units))
    with pytest.raises(pw.ResourceError, match="out of memory"):
        model.run(t_end=100, every=1e-3)
    with pytest.raises(pw.ResourceError, match="1e\\+10 samples"):
        model.run(t_end=10, every=1e-9)
    r = model.run("rk4+projection", t_end=100, step=1e-3)
    assert r.status == "failed" and "out of memory" in r.reason and len(r) == 20000
    assert len(model.run("rk4+projection", t_end=15, step=1e-3)) == 15001


def test_exceptions_of_progress_pass_and_the_run_goes_on(model):
    with model.open() as simulation:
        with pytest.raises(ZeroDivisionError) as raised:
            simulation.record(1, progress=lambda done: 1 / 0)
        assert raised.value.result.status == "stopped" and raised.value.result.t[-1] == simulation.t
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


@pytest.mark.parametrize("copier", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_results_of_models_with_functions_are_copied_and_pickled(copier):
    r = signals(lambda t: 0.1).run(t_end=0.1, energy=True)
    copied = copier(r)
    assert np.array_equal(copied.rows, r.rows) and copied.final == r.final and list(copied) == list(r) and copied.units == r.units
    assert (copied.status, copied.reason, copied.statistics, copied.settings) == (r.status, r.reason, r.statistics, r.settings)
    assert copied.model is None and "not shown" in copied._repr_html_() and r.model is not None

    def value(t):
        return 1 / 0 if t > 0.05 else 0.0
    with pytest.raises(ZeroDivisionError) as raised:
        signals(value).run(t_end=0.1)
    assert np.array_equal(copier(raised.value).result.rows, raised.value.result.rows)


def run_script(text, *options):
    """What a process with these options of Python prints."""
    done = subprocess.run([sys.executable, *options, "-c", text], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


def test_a_forked_child_leaves_the_files_of_its_parent():
    folders = run_script("""
import gc, os, pathlib, sys
import pinwheel as pw
BODY = {"name": "a", "mass": 1, "inertia": 1}
model = pw.describe("parent", bodies=[BODY])
for leave in (os._exit, sys.exit):
    child = os.fork()
    if child == 0:
        model = None
        gc.collect()
        pw.describe("child", bodies=[BODY]).run(t_end=0.01)
        made = pw.describe("child", bodies=[BODY])
        print(pathlib.Path(made.source).parent, flush=True)
        made = None if leave is os._exit else made
        pw.describe("child", bodies=[BODY])
        leave(0)
    assert os.waitpid(child, 0)[1] == 0 and os.path.exists(model.source), leave
model.replace(start={"a.vx": 1}).run(t_end=0.01)
print(pathlib.Path(model.source).parent)""")
    assert len(set(folders)) == 3
    assert not any(map(os.path.exists, folders))


def test_files_of_descriptions_do_not_accumulate(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for _ in range(20):
        pw.describe(bodies=[BODY])
    assert len(list(tmp_path.iterdir())) <= 2


def test_resources_are_not_left_to_the_collector():
    run_script("""
import pickle
import pinwheel as pw
model = pw.describe(bodies=[{"name": "a", "mass": 1, "inertia": 1}], elements=[pw.Torque("m", body=["a", "ground"], value=lambda t: 0.1)])
r = model.run(t_end=0.01)
pickle.dumps(r)
pickle.loads(pickle.dumps(pw.describe(bodies=[{"name": "a", "mass": 1}])))
pw.Model("pendulum")._repr_html_(), pw.Model("pendulum").run(t_end=0.1)._repr_html_()
pw.sweep("pendulum", {"m": [1, 2]}, t_end=0.1)
pw.Model("pendulum").fit(data={"t": [0, 0.1, 0.2], "bob.x": [1, 0.9976, 0.9617]}, columns="bob.x", free={"l": (0.5, 2)})
pw.models(), pw.Model("pendulum").check(), pw.Model("pendulum").open()""", "-W", "error::ResourceWarning", "-X", "dev")


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
