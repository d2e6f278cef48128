"""An MPC of one's own above the condensed whole-body controller: Go2 trots by a single rigid
body.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import harpy_pin as hp

N, DT, STEP = 12, 0.025, 0.25  # intervals and their length, s; duration of a step, s
GRAVITY = np.array([0.0, 0.0, -9.81, 0.0, 0.0, 0.0])
NEAR = np.array([20.0, 20.0, 300.0, 100.0, 100.0, 50.0])  # weights of place and orientation
CALM = np.array([4.0, 4.0, 4.0, 1.0, 1.0, 1.0])  # of their velocities
AHEAD = DT * np.arange(1, N + 1)[:, None]
TO_VELOCITY = DT * np.tri(N)
TO_PLACE = DT * np.tril(AHEAD - AHEAD.T + 0.5 * DT)


class TrotMpc:
    """A single rigid body (Di Carlo et al. 2018), without friction cones: the controller has
    them.
    """

    def __init__(self, robot: hp.Robot, velocity: tuple[float, float]) -> None:
        self.robot, self.data = robot, robot.model.createData()
        self.velocity = np.array([*velocity, 0.0])
        dynamics, (q, v) = hp.Dynamics(robot), hp.Standing(robot).initial_state()
        dynamics.update(q, v)
        self.height = pin.centerOfMass(robot.model, self.data, q)[2]
        self.feet = dynamics.foot_position - dynamics.foot_position.mean(axis=0)

    def plan(self, state: hp.State) -> hp.Plan:
        # The present: centre of mass, orientation, and their velocities
        pin.ccrba(self.robot.model, self.data, state.q, state.v)
        rotation, mass = pin.Quaternion(state.q[3:7]).matrix(), self.robot.mass
        centre, inertia = self.data.com[0], np.linalg.inv(self.data.Ig.inertia)
        place = np.concatenate((centre, pin.rpy.matrixToRpy(rotation)))
        motion = np.concatenate((self.data.hg.linear / mass, rotation @ state.v[3:6]))
        # What is wanted, when feet stand, and where
        wanted = np.concatenate((self.velocity, np.zeros(3)))
        path = place * [1, 1, 0, 0, 0, 0] + AHEAD * wanted
        path[:, 2] = self.height
        times = state.t + DT * np.arange(N + 1)
        clock = (times[:-1, None] + 1e-6) / STEP + [0, 1, 1, 0]
        contact, number = clock % 2 < 1, clock // 2
        middle = (2 * number - [0, 1, 1, 0] + 0.5) * STEP - state.t
        feet = centre + self.feet + middle[..., None] * self.velocity
        feet += 0.15 * (motion[:3] - self.velocity)
        feet[..., 2] = 0.0
        stays = contact & contact[0] & (number == number[0])
        feet = np.where(stays[..., None], state.foot_position, feet)
        # Accelerations are G f + gravity; place and velocity are sums of them
        gain = np.zeros((N, 6, 4, 3))
        for i, k in np.argwhere(contact):
            gain[i, :3, k] = np.eye(3) / mass
            gain[i, 3:, k] = inertia @ pin.skew(feet[i, k] - path[i, :3])
        gain = gain.reshape(N, 6, 12)
        to_place, to_velocity = (
            np.einsum("ij,jac->iajc", sums, gain).reshape(6 * N, 12 * N)
            for sums in (TO_PLACE, TO_VELOCITY)
        )
        falls = place + AHEAD * motion + TO_PLACE.sum(axis=1)[:, None] * GRAVITY
        flies = motion + TO_VELOCITY.sum(axis=1)[:, None] * GRAVITY
        near, calm = np.tile(NEAR, N), np.tile(CALM, N)
        square = to_place.T * near @ to_place + to_velocity.T * calm @ to_velocity
        value = to_place.T * near @ (path - falls).ravel()
        value += to_velocity.T * calm @ (wanted - flies).ravel()
        force = np.linalg.solve(square + 1e-6 * np.eye(12 * N), value)
        places = np.vstack((place, falls + (to_place @ force).reshape(N, 6)))
        motions = np.vstack((motion, flies + (to_velocity @ force).reshape(N, 6)))
        return hp.Plan(
            times=times,
            position=places[:, :3],
            velocity=motions[:, :3],
            orientation=places[:, 3:],
            angular_velocity=motions[:, 3:],
            contact=contact,
            foothold=feet,
            force=force.reshape(N, 4, 3),
            centre_of_mass=True,
        )


def main(duration: float = 5.0) -> None:
    go2 = hp.load_robot("go2")
    for plant in (hp.scenario.Own(), hp.Mujoco()):
        gait = hp.PlannedGait(go2, TrotMpc(go2, (0.5, 0.0)), rate=50)
        run = hp.walk(hp.Scenario(controller="condensed", plant=plant, duration=duration), gait=gait)
        print(f"{run.ending}: {run['q'][-1, 0]:.2f} m, {gait.status}")


if __name__ == "__main__":
    main()
