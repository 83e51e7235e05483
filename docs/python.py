"""The table of the README and a work-precision diagram of the EzyRoller, from Python."""
import time
import numpy as np
import pinwheel as pw

model = pw.Model("ezyroller")
exact = model.run("erk8+projection", rtol=1e-13, times=[10, 100])
coordinates = ["frame.x", "frame.y", "frame.phi", "steer.phi"]

def measure(method, **settings):
    start = time.process_time()
    run = model.run(method, times=[10, 100], **settings)
    seconds = time.process_time() - start
    return [max(abs(run[name][i] - exact[name][i]) for name in coordinates) for i in (0, 1)], run.statistics, seconds

print("method            steps     error 10 s  error 100 s  |g| [m]   CPU [s]")
for method, settings in (("rk4+projection", {"step": 1e-3}), ("ida+baumgarte", {"rtol": 1e-10, "atol": 1e-10}), ("ida+ggl", {"rtol": 1e-10, "atol": 1e-10})):
    error, statistics, seconds = measure(method, **settings)
    print(f"{method:15} {statistics['steps']:8} {error[0]:11.1e} {error[1]:11.1e} {statistics['g']:11.1e} {seconds:7.2f}")

import matplotlib.pyplot as plt
for method, name, values in (("rk4+projection", "step", 0.1 / 2 ** np.arange(6)), ("erk8+projection", "rtol", 10. ** -np.arange(3, 12))):
    points = [measure(method, **{name: x}) for x in values]
    plt.loglog([p[2] for p in points], [p[0][1] for p in points], "o-", label=method)
plt.xlabel("processor time [s]"); plt.ylabel("error at 100 s [m], [rad]"); plt.legend(); plt.savefig("work-precision.png")
