"""Crocoddyl above the condensed whole-body controller: Go2 trots in MuJoCo by its whole dynamics.

In an environment of its own, because crocoddyl 3.2.1 beside pin 4.1.0 is silently wrong:
pip install "pin==4.0.0" "crocoddyl==3.2.1", then harpy-pin without its dependencies, lazy-loader,
proxsuite and mujoco.
"""

import crocoddyl as croc
import numpy as np
import pinocchio as pin

import harpy_pin as hp

N, DT, STEP = 16, 0.025, 0.25  # intervals, their length, s, and duration of a step, s
PAIR = np.array([0, 1, 1, 0])  # feet that step together
PLACE = [20.0, 20.0, 100.0, 30.0, 30.0, 10.0, *[0.1] * 12]  # weights of the body and the joints
RATE = [10.0, 10.0, 2.0, 2.0, 2.0, 2.0, *[0.02] * 12]  # of their velocities
WORLD = pin.LOCAL_WORLD_ALIGNED


class WholeBodyMpc:
    """Differential dynamic programming with contacts; three iterations from the last optimum."""

    def __init__(self, robot: hp.Robot, forward: float) -> None:
        self.robot, self.velocity = robot, np.array([forward, 0.0, 0.0])
        self.state = croc.StateMultibody(robot.model)
        self.legs = croc.ActuationModelFloatingBase(self.state)
        self.frames = [robot.frame_id(name) for name in robot.feet]
        q, v = hp.Standing(robot).initial_state()
        self.rest, terms = np.concatenate((q, v)), hp.Dynamics(robot)
        terms.update(q, v)
        self.hips = terms.foot_position * [1, 1, 0]
        self.rest[19], self.last = forward, None

    def node(self, wanted, contact, feet, rise, dt):
        s, nu = self.state, self.legs.nu
        contacts, costs = croc.ContactModelMultiple(s, nu), croc.CostModelSum(s, nu)
        cone = croc.FrictionCone(np.eye(3), 0.4, 4, False)
        inside = croc.ActivationModelQuadraticBarrier(croc.ActivationBounds(cone.lb, cone.ub))
        weigh = croc.ActivationModelWeightedQuad(np.array(PLACE + RATE))
        tasks = [(weigh, croc.ResidualModelState(s, wanted, nu), 1.0)]
        tasks.append((None, croc.ResidualModelControl(s, nu), 1e-3))
        for k, frame in enumerate(self.frames):
            if contact[k]:
                point = croc.ContactModel3D(s, frame, feet[k], WORLD, nu, np.array([0.0, 40.0]))
                contacts.addContact(str(k), point)
                force = croc.ResidualModelContactFrictionCone(s, frame, cone, nu, True)
                tasks.append((inside, force, 1.0))
            else:
                way = croc.ResidualModelFrameTranslation(s, frame, feet[k] + [0, 0, rise[k]], nu)
                tasks.append((None, way, 1e3))
        for i, (activation, residual, weight) in enumerate(tasks):
            both = (residual,) if activation is None else (activation, residual)
            costs.addCost(str(i), croc.CostModelResidual(s, *both), weight)
        moves = croc.DifferentialActionModelContactFwdDynamics(
            s, self.legs, contacts, costs, 0.0, True
        )
        return croc.IntegratedActionModelEuler(moves, dt)

    def plan(self, state: hp.State) -> hp.Plan:
        x, times = np.concatenate((state.q, state.v)), state.t + DT * np.arange(N + 1)
        clock = times[:, None] / STEP + 1e-6 + PAIR
        contact, step = clock % 2 < 1, clock // 2
        middle = (2 * (step + ~contact) - PAIR + 0.5) * STEP - state.t  # of stances, from now on
        off = pin.Quaternion(x[3:7]).matrix() @ state.v[:3] - self.velocity
        feet = (x[:3] + self.hips + middle[..., None] * self.velocity + 0.15 * off) * [1, 1, 0]
        stays = contact & contact[0] & (step == step[0])
        feet = np.where(stays[..., None], state.foot_position, feet)
        rise = 0.06 * np.sin(np.pi * clock) ** 2
        wanted = np.tile(self.rest, (N + 1, 1))
        wanted[:, 0] = x[0] + (times - state.t) * self.velocity[0]
        dts = [DT] * N + [0.0]
        *running, end = map(self.node, wanted, contact, feet, rise, dts)
        problem = croc.ShootingProblem(x, running, end)
        solver = croc.SolverFDDP(problem)
        if self.last is None:
            solver.solve([x] * (N + 1), problem.quasiStatic([x] * N), 20, False)
        else:
            solver.solve([x, *self.last.xs[1:]], [*self.last.us], 3, False)
        self.last = solver
        # All that stands between it and the robot
        x, force = np.array(solver.xs), np.zeros((N, 4, 3))
        turn = np.array([pin.Quaternion(row[3:7]).matrix() for row in x])
        for i, k in np.argwhere(contact[:N]).tolist():
            found = problem.runningDatas[i].differential.multibody.contacts.contacts[str(k)]
            force[i, k] = found.f.linear
        return hp.Plan(times=times, position=x[:, :3], orientation=x[:, 3:7],
                       velocity=np.einsum("nij,nj->ni", turn, x[:, 19:22]),
                       angular_velocity=np.einsum("nij,nj->ni", turn, x[:, 22:25]),
                       contact=contact, foothold=feet, force=force)  # fmt: skip


go2 = hp.load_robot("go2")
gait = hp.PlannedGait(go2, WholeBodyMpc(go2, 0.5), rate=50)
run = hp.walk(hp.Scenario(controller="condensed", plant="mujoco", duration=3.0), gait=gait)
print(f"{run.ending} at {run['q'][-1, 0]:.2f} m, {gait.status}")
total, planned = (run[f"{name}_force"][-1000:, :, 2].sum(axis=1) for name in ("foot", "planned"))
print(
    f"weight {9.81 * go2.mass:.0f} N, on the feet {total.mean():.0f}, planned {planned.mean():.0f}"
)
