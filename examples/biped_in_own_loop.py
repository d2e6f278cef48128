"""A biped on point feet in a loop and physics of one's own: Pinocchio, springs (extra robots)."""

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]

import harpy_pin as hp

STIFFNESS, DAMPING, FRICTION = 2e4, 150.0, 0.7  # of the floor: N/m, N·s/m
SLIP = 1e-2  # m/s, below which friction is viscous
DT, STEPS = 1e-4, 10  # physics, and its steps in a tick of the controller

robot = hp.load_robot("bolt")
model, data = robot.model, robot.model.createData()
frames = [robot.frame_id(foot) for foot in robot.feet]
gait = hp.WalkingGait(robot, velocity=(0.2, 0.0, 0.0))
controller = hp.make_controller("condensed", gait, mu=0.5)
q, v = gait.initial_state(penetration=robot.mass * 9.81 / 2 / STIFFNESS)


def feet(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, m, and velocities, m/s, of the feet, and the floor's forces on them, N: (2, 3)."""
    pin.forwardKinematics(model, data, q, v)
    pin.updateFramePlacements(model, data)
    axes = pin.LOCAL_WORLD_ALIGNED
    place = np.array([data.oMf[frame].translation for frame in frames])
    speed = np.array([pin.getFrameVelocity(model, data, frame, axes).linear for frame in frames])
    load = np.maximum(-STIFFNESS * place[:, 2] - DAMPING * speed[:, 2], 0.0) * (place[:, 2] < 0.0)
    along = speed[:, :2] / np.maximum(np.linalg.norm(speed[:, :2], axis=1, keepdims=True), SLIP)
    return place, speed, np.hstack((-FRICTION * load[:, None] * along, load[:, None]))


for tick in range(3000):
    state = hp.State(1e-3 * tick, q, v, *feet(q, v))
    command = controller.step(state)
    for _ in range(STEPS):
        place, _speed, force = feet(q, v)
        push = [pin.Force.Zero() for _ in range(model.njoints)]
        for k, frame in enumerate(frames):
            joint = model.frames[frame].parentJoint
            push[joint] += data.oMi[joint].actInv(pin.Force(force[k], np.cross(place[k], force[k])))
        torque = np.concatenate((np.zeros(6), command.torque))
        v = v + DT * pin.aba(model, data, q, v, torque, push)
        q = pin.integrate(model, q, DT * v)
print(f"walked {q[0]:.2f} m in {state.t:.1f} s, the body {q[2]:.2f} m above the floor")
