"""G1 stands, sways, and holds a hand where it is: tasks of one's own (extra robots)."""

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]

import harpy_pin as hp

HAND, GAINS = "left_wrist_yaw_link", (400.0, 40.0)
robot = hp.load_robot("g1")
ground = hp.Ground(mu_s=0.6).fitted(robot, walks=True)
plant = hp.Simulator(robot, ground)
plant.reset(*hp.gaits.Standing(robot).initial_state(penetration=plant.static_penetration))

model, data = robot.model, robot.model.createData()
pin.framesForwardKinematics(model, data, plant.q)
place = data.oMf[robot.frame_id(HAND)].copy()
centre = pin.centerOfMass(model, data, plant.q).copy()

body = hp.CentreOfMassTask(position=centre, gains=(100.0, 20.0))
solver = hp.WholeBodySolver(
    robot,
    {
        body: 10.0,
        hp.FrameTask("torso_link", part="orientation", rotation=np.eye(3), gains=GAINS): 1.0,
        hp.FrameTask(
            HAND, part="both", position=place.translation, rotation=place.rotation, gains=GAINS
        ): 10.0,
        hp.JointTask(robot.joints, position=plant.q[7:], gains=(100.0, 20.0)): 0.01,
    },
)

assert body.position is not None  # now in the solver's memory
worst = np.zeros(2)
while plant.t < 4.0:
    body.position[1] = centre[1] + 0.03 * np.sin(2.0 * plant.t)
    solution = solver.solve(plant.state)
    plant.advance(hp.Command(solution.torque), steps=2)  # of half a millisecond
    pin.framesForwardKinematics(model, data, plant.q)
    off = place.actInv(data.oMf[robot.frame_id(HAND)])
    worst = np.maximum(
        worst, (np.linalg.norm(off.translation), np.linalg.norm(pin.log3(off.rotation)))
    )
far, turned = 1e3 * worst[0], np.degrees(worst[1])
print(f"hand within {far:.1f} mm and {turned:.2f}° of its place, solved {solution.status.name}")
