"""Microseconds of processor time of calls from Python: the numbers of docs/python.md.

    PYTHONPATH=core/python python3 benchmarks/python.py       after make; about a minute
"""
import statistics
import time

import numpy as np
import pinwheel as pw


def median(function, count, repeat=15):
    """Of processor times of a call [us], each a mean over `count` calls."""
    def mean():
        began = time.process_time()
        for k in range(count):
            function(k)
        return (time.process_time() - began) / count * 1e6
    return statistics.median(mean() for _ in range(repeat))


def one_vehicle():
    with pw.Model("ezyroller").open("rk4+projection", inputs={"rider": 0.0}) as vehicle:
        names = tuple(vehicle.states[:6])

        def control(k):
            vehicle.step(0.1 * (-1) ** k, 1e-3)
            vehicle.observe(names)
        print(f"a step with a new input, and an observation of six states: {median(control, 5000):.1f}")
        print(f"a reset: {median(lambda k: vehicle.reset({'frame.y': 1e-3 * k}), 2000):.0f}")


def many_vehicles(n=256):
    torque = np.random.default_rng(0).uniform(-0.1, 0.1, (n, 1))
    for name, specialise in (("general engine", "never"), ("compiled, in 8 lanes", "always")):
        with pw.VectorSimulation("ezyroller", n, "rk4+projection", inputs={"rider": 0.0}, specialise=specialise, threads=1) as vehicles:
            names = tuple(vehicles.states[:6])
            for steps in (1, 10):
                def control(k):
                    vehicles.step(torque * (-1) ** k, steps * 1e-3)
                    vehicles.observe(names)
                print(f"{n} vehicles, {name}, {steps} step{'s' * (steps > 1)} an interval: {median(control, 100) / n / steps:.2f} per vehicle and step")


def sweeps(runs=500):
    model, vary = pw.Model("ezyroller"), {"frame.vx": np.linspace(0, 0.1, runs)}
    print(f"a run of a sweep, of one step: {median(lambda _: model.sweep(vary, t_end=1e-3), 1) / runs:.0f}")


if __name__ == "__main__":
    one_vehicle()
    many_vehicles()
    sweeps()
