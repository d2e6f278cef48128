"""Any robot in MuJoCo: Solo12 on joint springs is pushed. It needs the extras robots and mujoco."""

import numpy as np

import harpy_pin as hp
from harpy_pin.simulation.mujoco import MujocoPlant


class Springs:
    """Springs and dampers that hold the joints in the robot's standing posture."""

    def __init__(self, robot: hp.Robot) -> None:
        self.posture = hp.Standing(robot).initial_state()[0][7:]

    def step(self, state: hp.State) -> hp.Command:
        return hp.Command(20.0 * (self.posture - state.q[7:]) - 0.3 * state.v[6:], np.zeros((0, 3)))


robot = hp.load_robot("solo12")

# MuJoCo takes whatever load_robot takes. It needs only these lines, and the log is the usual one.
plant = MujocoPlant(robot, hp.Ground(mu_s=0.6))
plant.reset(*hp.Standing(robot).initial_state(penetration=plant.static_penetration))
run = plant.run(Springs(robot), 2.0, pushes=[hp.Push(1.0, (0.0, 0.5, 0.0))])

moved = 1e3 * np.ptp(run["q"][:, :3], axis=0)
slip = 1e3 * run["slip_path"][-1].max()
print(
    f"{run.ending} in {run.metadata['plant']['name']}: body moved by {moved.round(1)} mm, "
    f"feet slipped {slip:.2f} mm"
)
