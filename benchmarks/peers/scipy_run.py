"""What an accuracy costs with SciPy: 100 s of the EzyRoller with a massive steering assembly, as benchmarks/peers.c.

The accelerations solve [M J^T; J 0] [a; lambda] = [f; gamma] with numpy; DOP853 integrates them.  Prints
"error[m] processor-time[ms]" of a run for each tolerance.
"""
import time

import numpy as np
from scipy.integrate import solve_ivp

a, b, c, d, m1, I1, m2, I2, M0, omega = 0.5, 0.5, 0.125, 0.125, 1, 0.1, 0.1, 0.01, 0.1, np.pi
# x, y of both centres of mass at 100 s, in quadruple precision (peers_exact of benchmarks/peers.c)
EXACT = np.array([85.776831285852169, -52.654687622986008, 86.105849606538573, -52.834610154037750])

matrix, right = np.zeros((10, 10)), np.zeros(10)
matrix[range(6), range(6)] = [m1, m1, I1, m2, m2, I2]


def rates(t, y):
    v = y[6:]
    c1, s1, c2, s2 = np.cos(y[2]), np.sin(y[2]), np.cos(y[5]), np.sin(y[5])
    J = np.array([[1, 0, -b * s1, -1, 0, -d * s2], [0, 1, b * c1, 0, -1, d * c2],
                  [-s1, c1, -a, 0, 0, 0], [0, 0, 0, -s2, c2, c]])
    matrix[6:, :6], matrix[:6, 6:] = J, J.T
    moment = M0 * np.cos(omega * t)
    right[2], right[5] = moment, -moment
    w1, w2 = v[2]**2, v[5]**2
    right[6:] = (b * c1 * w1 + d * c2 * w2, b * s1 * w1 + d * s2 * w2, v[2] * (c1 * v[0] + s1 * v[1]),
                 v[5] * (c2 * v[3] + s2 * v[4]))
    return np.concatenate((v, np.linalg.solve(matrix, right)[:6]))


for power in range(4, 13):
    start = np.zeros(12)
    start[3], start[5] = b - d, np.pi
    begin = time.process_time()
    end = solve_ivp(rates, (0, 100), start, method="DOP853", rtol=10.0**-power, atol=10.0**-power).y[:, -1]
    ms = 1e3 * (time.process_time() - begin)
    print(f"{np.abs(end[[0, 1, 3, 4]] - EXACT).max():.3g} {ms:.4g}", flush=True)
