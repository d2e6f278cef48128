"""G1 walks, and its hand stays where the body's target carries it: a task of one's own in the
condensed controller (extra robots).
"""

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]

import harpy_pin as hp

HAND = "left_wrist_yaw_link"
robot = hp.load_robot("g1")
gait = hp.WalkingGait(robot, velocity=(0.4, 0.0, 0.0))
ground = hp.Ground(mu_s=0.6).fitted(robot, walks=True)
plant = hp.Simulator(robot, ground)
plant.reset(*gait.initial_state(penetration=plant.static_penetration))

model, data = robot.model, robot.model.createData()
pin.framesForwardKinematics(model, data, plant.q)
start = data.oMf[robot.frame_id(HAND)].copy()
hand = hp.FrameTask(
    HAND, part="both", position=start.translation, rotation=start.rotation, gains=(400.0, 40.0)
)
controller = hp.make_controller("condensed", gait, mu=0.6)
controller.add(hand, weight=10.0)

assert hand.position is not None
assert hand.velocity is not None
ahead = start.translation - plant.q[:3]
worst = np.zeros(2)
controller.step(plant.state)  # so that there is a target
while plant.t < 4.0:
    body = controller.target.body  # position, then velocity
    # body[6:] is the acceleration of the centre of mass
    hand.acceleration[:3] = (body[3:6] - hand.velocity[:3]) / 1e-3
    hand.position[:], hand.velocity[:3] = body[:3] + ahead, body[3:6]
    plant.advance(controller.step(plant.state), steps=2)  # of half a millisecond
    pin.framesForwardKinematics(model, data, plant.q)
    now = data.oMf[robot.frame_id(HAND)]
    far = np.linalg.norm(now.translation - hand.position)
    turned = np.degrees(np.linalg.norm(pin.log3(start.rotation.T @ now.rotation)))
    worst = np.maximum(worst, (1e3 * far, turned))
print(f"walked {plant.q[0]:.2f} m, hand within {worst[0]:.1f} mm and {worst[1]:.2f}°")
