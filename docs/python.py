"""The table of the README and a work-precision diagram of the EzyRoller, from Python."""
import time
import matplotlib.pyplot as plt
import numpy as np
import pinwheel as pw

model, coordinates = pw.Model("ezyroller"), ["frame.x", "frame.y", "frame.phi", "steer.phi"]
reference = model.run("erk8+projection", rtol=3e-14, every=1)

def measure(method, **settings):
    start = time.process_time()
    run = model.run(method, every=1, energy=True, **settings)
    error = [max(abs(run[name][t] - reference[name][t]) for name in coordinates) for t in (10, 100)]
    return run.statistics, error, abs(run["balance"]).max(), time.process_time() - start

print("method            steps     rhs  error 10 s  100 s     |g| [m]  |Jv| [m/s]  gap [J]  CPU [s]")
for method, settings in {"rk4+projection": {"step": 1e-3}, **{f"ida+{s}": {"rtol": 1e-10, "atol": 1e-10} for s in ("baumgarte", "ggl")}}.items():
    n, error, gap, seconds = measure(method, **settings)
    print(f"{method:15} {n['steps']:7} {n['rhs']:7}   {error[0]:.1e}  {error[1]:.1e}  {n['g']:.1e}  {n['jv']:.1e}     {gap:.1e}  {seconds:.2f}")

for method, name, values in (("rk4+projection", "step", 0.1 / 2 ** np.arange(6)), ("erk8+projection", "rtol", 10. ** -np.arange(3, 12))):
    points = [measure(method, **{name: x}) for x in values]
    plt.loglog([p[3] for p in points], [p[1][1] for p in points], "o-", label=method)
plt.xlabel("processor time [s]"); plt.ylabel("error at 100 s [m], [rad]"); plt.legend(); plt.savefig("work-precision.png")
