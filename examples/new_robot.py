"""A robot of one's own under the whole-body QP: its URDF, feet and a posture (extra robots)."""

import numpy as np

import harpy_pin as hp

# Any URDF with a floating base; this file is Solo12's.
URDF = hp.load_robot("solo12").urdf
FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
POSTURE = [0.0, 0.7, -1.4] * 2 + [0.0, -0.7, 1.4] * 2  # rad, leg by leg

robot = hp.load_robot(URDF, feet=FEET)
gait = hp.Standing(robot, POSTURE, shift=(0.02, 0.01, 0.0))
controller = hp.make_controller("wbc", gait, mu=0.5)  # its settings fit the robot's weight
simulator = hp.Simulator(robot, hp.Ground(mu_s=0.6))
simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
run = simulator.run(controller, 2.0, pushes=[hp.Push(1.0, (0.0, 0.3, 0.0))])

error = 1e3 * np.linalg.norm(run["q"][:, :3] - run["x_r"][:, :3], axis=1).max()
slip = 1e3 * run["slip_path"][-1].max()
print(f"{run.ending}: body within {error:.1f} mm, feet slipped {slip:.2f} mm")
