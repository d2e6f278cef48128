"""An MPC of one's own above the condensed whole-body controller: Go2 trots by one rigid body."""

import numpy as np

import harpy_pin as hp

N, DT, STEP = 12, 0.025, 0.25  # intervals, their length, s, and duration of a step, s
PAIR = np.array([0, 1, 1, 0])  # feet that step together
WEIGHTS = np.array([[20, 20, 300, 100, 100, 50], [4, 4, 4, 1, 1, 1]])  # of places, velocities
AHEAD = DT * np.arange(1, N + 1)[:, None]
SUMS = np.array([DT * np.tril(AHEAD - AHEAD.T + 0.5 * DT), DT * np.tri(N)])  # of accelerations


class TrotMpc:
    """A single rigid body (Di Carlo et al. 2018); the controller sees to the friction cones."""

    def __init__(self, robot: hp.Robot, forward: float) -> None:
        self.robot, self.terms = robot, hp.Dynamics(robot)
        self.velocity = np.array([forward, 0, 0, 0, 0, 0])
        q, v = hp.Standing(robot).initial_state()
        self.terms.update(q, v)
        feet, self.height = self.terms.foot_position, q[2]
        self.hips = feet - feet.mean(axis=0)

    def plan(self, state: hp.State) -> hp.Plan:
        self.terms.update(state.q, state.v)
        r = self.terms.rotation
        angles = np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])
        inertia = r @ self.terms.mass_matrix[3:6, 3:6] @ r.T
        x, v = np.array([*state.q[:3], *angles]), (state.v[:6].reshape(2, 3) @ r.T).ravel()
        path = x + AHEAD * self.velocity  # that is wanted
        path[:, 1:] = 0, self.height, 0, 0, 0
        times = state.t + DT * np.arange(N + 1)
        clock = times[:-1, None] / STEP + 1e-6 + PAIR
        contact, step = clock % 2 < 1, clock // 2
        middle = (2 * step - PAIR + 0.5) * STEP - state.t  # of each stance, from now on
        feet = (x + middle[..., None] * self.velocity + 0.15 * (v - self.velocity))[..., :3]
        feet = (feet + self.hips) * [1, 1, 0]
        feet = np.where((contact[0] & (step == step[0]))[..., None], state.foot_position, feet)
        gain = np.zeros((N, 6, 4, 3))  # accelerations per force
        for i, k in np.argwhere(contact):
            gain[i, :3, k] = np.eye(3) / self.robot.mass
            gain[i, 3:, k] = np.linalg.solve(inertia, np.cross(np.eye(3), feet[i, k] - path[i, :3]))
        a = np.einsum("sij,jakc->siajkc", SUMS, gain).reshape(12 * N, 12 * N)
        falls = np.array([x + AHEAD * v, np.tile(v, (N, 1))])
        falls += SUMS.sum(axis=2)[..., None] * [0, 0, -9.81, 0, 0, 0]
        missing = np.array([path, np.tile(self.velocity, (N, 1))]) - falls
        w = np.repeat(WEIGHTS[:, None], N, axis=1).ravel()
        force = np.linalg.solve(a.T * w @ a + 1e-6 * np.eye(12 * N), a.T * w @ missing.ravel())
        x, v = np.hstack(([[x], [v]], falls + (a @ force).reshape(2, N, 6)))
        return hp.Plan(times=times, position=x[:, :3], velocity=v[:, :3], orientation=x[:, 3:],
                       angular_velocity=v[:, 3:], contact=contact, foothold=feet,
                       force=force.reshape(N, 4, 3))  # fmt: skip


go2 = hp.load_robot("go2")
for plant in ("compliant", "mujoco"):
    gait = hp.PlannedGait(go2, TrotMpc(go2, 0.5), rate=50)
    run = hp.walk(hp.Scenario(controller="condensed", plant=plant, duration=5.0), gait=gait)
    print(f"{plant}: {run.ending} at {run['q'][-1, 0]:.2f} m, {gait.status}")
