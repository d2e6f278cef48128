"""A humanoid from a URDF walks on its soles, pushed once: the loop is visible (extra robots)."""

import numpy as np

import harpy_pin as hp

# Any URDF with a floating base; this file is Talos'.
URDF = hp.load_robot("talos").urdf
SOLE = hp.FlatFoot(length=0.2, width=0.12)  # in the frames of the feet, m
FEET = ("left_sole_link", "right_sole_link")

robot = hp.load_robot(URDF, feet=FEET, flat_feet=dict.fromkeys(FEET, SOLE))
gait = hp.WalkingGait(robot, velocity=(0.15, 0.0, 0.0))
controller = hp.make_controller("condensed", gait, mu=0.6)
ground = hp.Ground(mu_s=0.6).fitted(robot, walks=True)
plant = hp.Simulator(robot, ground)
plant.reset(*gait.initial_state(penetration=plant.static_penetration))
push = [hp.Push(2.0, (0.0, 6.0, 0.0))]  # N·s, to the left

lowest = np.inf
while plant.t < 4.0:
    command = controller.step(plant.state)
    plant.advance(command, push, steps=2)  # of half a millisecond
    lowest = min(lowest, plant.q[2])
print(f"walked {plant.q[0]:.2f} m in {plant.t:.1f} s, the body at least {lowest:.2f} m high")
