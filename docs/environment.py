"""A Gymnasium environment: the rider of an EzyRoller learns to ride along the x axis.

The action is the torque of the rider between frame and steering.  Observed are the distance from the axis, the heading, the
steering angle, and the three velocities.  The reward is the speed along the axis, less the distance from it.
"""
import gymnasium
import numpy as np
import pinwheel as pw

OBSERVED = ("frame.y", "frame.phi", "steer.phi", "frame.vx", "frame.vy", "steer.omega")


class EzyRoller(gymnasium.Env):
    metadata = {"render_modes": []}

    def __init__(self, interval=0.05, duration=10.0):
        self.action_space = gymnasium.spaces.Box(-0.5, 0.5, (1,), np.float64)  # [N m]
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (len(OBSERVED),), np.float64)
        self.simulation = pw.Model("ezyroller").open("rk4+projection", step=0.01, inputs={"rider": 0.0})
        self.interval, self.duration = interval, duration

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.simulation.reset({"frame.phi": self.np_random.uniform(-0.1, 0.1)})
        return self.simulation.observe(OBSERVED).copy(), {}

    def step(self, action):
        failed = False
        try:
            self.simulation.step(action, self.interval)
        except pw.MethodError:  # such as a singular configuration
            failed = True
        y, _, _, vx, _, _ = observed = self.simulation.observe(OBSERVED).copy()
        return observed, float(vx - abs(y)), failed or abs(y) > 5, self.simulation.time >= self.duration - 1e-9, {}

    def close(self):
        self.simulation.close()


if __name__ == "__main__":
    environment = EzyRoller()
    environment.reset(seed=0)
    total = sum(environment.step(environment.action_space.sample())[1] for _ in range(200))
    print(f"reward of random torques: {total:.3f}")
