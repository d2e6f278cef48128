"""Robots with tasks and contacts for the whole-body optimum, and the same program written densely
from Pinocchio.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
import proxsuite
import quadprog
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

import harpy_pin as hp
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.state import GRAVITY, State, Vector
from harpy_pin.wbc import MomentumTask, WholeBodyLimits
from harpy_pin.wbc.condensed import WholeBodySolution, WholeBodySolver
from harpy_pin.wbc.condensed.limits import COMPLIANCE
from harpy_pin.wbc.condensed.task_memory import AnyTask

Program = tuple[Vector, ...]
"""P, p, A, b, C, lower, upper: minimise ½ xᵀ P x + pᵀ x with A x = b and lower ≤ C x ≤ upper."""
Held = tuple[int, ...] | None
"""Which contacts are held; None for all."""

LIMITS = WholeBodyLimits(mu=0.8, friction_share=0.75)
DAMPING = 20.0
SCALE = 1e4
"""Factor on the objective for the reference: its forces are as exact as its gradient over their
small weight.
"""
HANDS = {
    "g1": ("left_wrist_yaw_link", "right_wrist_yaw_link"),
    "talos": ("arm_left_7_link", "arm_right_7_link"),
}
TORSO = {"g1": "torso_link", "talos": "torso_2_link"}
GRIPPER = "gripperStator"
ARM = {"joint2": 1.2, "joint3": -1.6, "joint4": 0.4}
WORLD = pin.LOCAL_WORLD_ALIGNED


@dataclass
class Case:
    """A robot with tasks, its solver, and random states and targets."""

    robot: hp.Robot
    q: Vector
    tasks: Mapping[AnyTask, ArrayLike]
    held: Held = None
    regularisation: float = 1e-3
    compliance: float = 0.0  # of the contacts in the dense program; zero for equalities
    period: float | None = None
    solver: WholeBodySolver = field(init=False)

    def __post_init__(self) -> None:
        self.solver = WholeBodySolver(
            self.robot,
            self.tasks,
            limits=LIMITS,
            regularisation=self.regularisation,
            contact_damping=DAMPING,
            period=self.period,
        )
        self.solver.held[:] = 1.0 if self.held is None else self.held
        if self.compliance:
            self.solver.record["contacts"]["compliance"] = self.compliance
        share = self.robot.mass * GRAVITY / max(len(self.robot.feet), 1)
        self.solver.force_range[:] = 0.02 * share, 6.0 * share
        self.dynamics = hp.Dynamics(self.robot)

    def draw(self, rng: np.random.Generator, *, spread: float = 0.2, size: float = 1.0) -> State:
        """A random state near the posture, and random targets."""
        model, solver = self.robot.model, self.solver
        step = spread * rng.standard_normal(model.nv)
        step[:6] *= 0.6
        for task in self.tasks:
            for name, scale in {
                "acceleration": 3.0,
                "rate": 3.0,
                "velocity": 0.3,
                "momentum": 0.3,
            }.items():
                if hasattr(task, name):
                    getattr(task, name)[:] = (
                        size * scale * rng.standard_normal(getattr(task, name).shape)
                    )
        solver.contact_acceleration[:] = (
            0.5 * size * rng.standard_normal(solver.contact_acceleration.shape)
        )
        feet = np.zeros((len(self.robot.feet), 3))
        share = self.robot.mass * GRAVITY / max(len(feet), 1)
        solver.reference_force[:] = 0.5 * size * share * rng.standard_normal(feet.shape)
        return hp.State(
            0.0,
            pin.integrate(model, self.q, step),
            0.3 * rng.standard_normal(model.nv),
            feet,
            feet,
            feet,
        )

    def answer(self, solution: WholeBodySolution) -> Vector:
        """[a; f; u] of a solution."""
        return np.concatenate((solution.acceleration, solution.force.ravel(), solution.thrust))

    def contact_rows(self, data: pin.Data, state: State) -> tuple[Vector, Vector]:
        """J and the acceleration demanded of every foot that is held: three rows of a point, six of
        a sole.
        """
        model, rows, values, first = self.robot.model, [], [], 0
        for k, corners in enumerate(self.robot.corners):
            names = self.robot.feet[first : first + corners]
            first += corners
            if self.solver.held[k] == 0.0:
                continue
            frames = [model.frames[self.robot.frame_id(name)] for name in names]
            joint, n = frames[0].parentJoint, 3 if corners == 1 else 6
            arm = data.oMi[joint].rotation @ np.mean(
                [frame.placement.translation for frame in frames], axis=0
            )
            jacobian = pin.getJointJacobian(model, data, joint, WORLD)
            jacobian[:3] -= pin.skew(arm) @ jacobian[3:]
            drift = pin.getClassicalAcceleration(model, data, joint, WORLD)
            w = pin.getVelocity(model, data, joint, WORLD).angular
            linear = drift.linear + np.cross(drift.angular, arm) + np.cross(w, np.cross(w, arm))
            desired = self.solver.contact_acceleration[k] - DAMPING * (jacobian @ state.v)
            rows.append(jacobian[:n])
            values.append((desired - np.concatenate((linear, drift.angular)))[:n])
        return np.vstack([np.zeros((0, model.nv)), *rows]), np.concatenate([np.zeros(0), *values])

    def dense(self, state: State) -> tuple[Program, Callable[[Vector], Vector]]:
        """The program in [a; f; u]: P, p, A, b, C, lower, upper; and the torques of its answers.

        With a period it is one in [a; f; u; s], with s the accelerations of joints beyond their
        ranges.
        """
        robot, solver, model = self.robot, self.solver, self.robot.model
        nv, forces, thrusts = model.nv, 3 * len(robot.feet), robot.n_thrust
        self.dynamics.update(state.q, state.v)
        data = model.createData()
        pin.computeJointJacobians(model, data, state.q)
        pin.forwardKinematics(model, data, state.q, state.v, np.zeros(nv))
        pin.updateFramePlacements(model, data)
        weights = [self.regularisation] * nv + [2e-4 / robot.mass**2] * forces + [5e-3] * thrusts
        hessian, gradient = np.diag(weights), np.zeros(nv + forces + thrusts)
        gradient[nv : nv + forces] = -weights[nv] * solver.reference_force.ravel()
        rows, values = self.contact_rows(data, state)
        squares = [(*task.rows(self.dynamics, state), solver.weights[task]) for task in self.tasks]
        if self.compliance:
            squares.append((rows, values, np.full(len(rows), 1.0 / self.compliance)))
            rows, values = rows[:0], values[:0]
        for matrix, target, weight in squares:
            hessian[:nv, :nv] += matrix.T @ (weight[:, None] * matrix)
            gradient[:nv] -= matrix.T @ (weight * target)
        feet = [
            pin.getFrameJacobian(model, data, robot.frame_id(name), WORLD)[:3]
            for name in robot.feet
        ]
        outer = np.vstack([np.zeros((0, nv)), *feet, self.dynamics.thruster_jacobian])
        upper = np.triu(pin.crba(model, model.createData(), state.q))
        mass = upper + np.triu(upper, 1).T
        bias = pin.nle(model, model.createData(), state.q, state.v) + model.damping * state.v
        equalities = [
            np.hstack((mass[:6], -outer[:, :6].T)),
            np.hstack((rows, np.zeros((len(rows), forces + thrusts)))),
        ]
        bounds, identity = [], np.eye(nv + forces + thrusts)
        held = np.repeat(solver.held, robot.corners)
        for k in range(len(held)):
            own = identity[nv + 3 * k : nv + 3 * k + 3]
            if held[k] == 0.0:
                equalities.append(own)
                continue
            bounds.append(
                (
                    LIMITS.pyramid @ own,
                    np.zeros(len(LIMITS.pyramid)),
                    np.full(len(LIMITS.pyramid), 1e20),
                )
            )
            bounds.append((own[2:], *solver.force_range[k, :, None]))
        bounds.append((identity[nv + forces :], *solver.record["newton"]["thrust_range"][0].T))
        joints = np.hstack((mass[6:], -outer[:, 6:].T))
        bounds.append((joints, *(solver.torque_range - bias[6:, None]).T))
        equality = np.vstack(equalities)
        value = np.zeros(len(equality))
        value[:6], value[6 : 6 + len(values)] = -bias[:6], values

        def torques(x: Vector) -> Vector:
            found: Vector = (mass @ x[:nv] + bias - outer.T @ x[nv : nv + len(outer)])[6:]
            return found

        limits: list[Vector] = [np.concatenate([bound[n] for bound in bounds]) for n in range(3)]
        if self.period is not None:
            ranges = joint_ranges(model, self.period, 100.0, state)
            slack = nv - 6
            hessian = block_diag(hessian, np.eye(slack) / COMPLIANCE)
            gradient = np.concatenate((gradient, np.zeros(slack)))
            equality, rows = (
                np.hstack((part, np.zeros((len(part), slack)))) for part in (equality, limits[0])
            )
            own = np.zeros((slack, len(gradient)))
            own[:, 6:nv] = own[:, -slack:] = np.eye(slack)
            limits = [
                np.vstack((rows, own)),
                *map(np.concatenate, zip(limits[1:], ranges, strict=True)),
            ]
        return (hessian, gradient, equality, value, *limits), torques


def joint_ranges(model: pin.Model, period: float, deceleration: float, state: State) -> Vector:
    """Least and largest accelerations with which joints keep their velocities and can still stop
    within their positions, by bisection.
    """
    ranges = np.zeros((2, model.nv - 6))
    for j in range(model.nv - 6):
        for row, sign, end in (
            (0, -1.0, model.lowerPositionLimit[7 + j]),
            (1, 1.0, model.upperPositionLimit[7 + j]),
        ):
            room = sign * (end - state.q[7 + j]) - 0.125 * deceleration * period**2
            speed = sign * state.v[6 + j]
            fastest = model.velocityLimit[6 + j]

            low, high, a = -deceleration, 1e6, -deceleration
            for _ in range(100):
                after, left = speed + period * a, room - period * speed - 0.5 * period**2 * a
                stops = after <= 0.0 or (left >= 0.0 and after**2 <= 2.0 * deceleration * left)
                low, high = (a, high) if stops and after <= fastest else (low, a)
                a = 0.5 * (low + high)
            ranges[row, j] = sign * low
    return ranges


def solve_proxqp(program: Program) -> Vector:
    """The optimum by ProxQP at 1e-9, whose duality gap is checked."""
    hessian, gradient, equality, value, rows, lower, upper = program
    qp = proxsuite.proxqp.dense.QP(len(gradient), len(value), len(lower))
    qp.settings.eps_abs, qp.settings.eps_rel, qp.settings.max_iter = 1e-9, 0.0, 100000
    qp.settings.check_duality_gap, qp.settings.eps_duality_gap_abs = True, 1e-6 * SCALE
    qp.init(SCALE * hessian, SCALE * gradient, equality, value, rows, lower, upper)
    qp.solve()
    assert qp.results.info.status == proxsuite.proxqp.PROXQP_SOLVED
    return np.array(qp.results.x)


def solve_quadprog(program: Program) -> Vector:
    """The optimum by quadprog's dual active-set method."""
    hessian, gradient, equality, value, rows, lower, upper = program
    matrix, least = np.vstack((equality, rows, -rows)), np.concatenate((value, lower, -upper))
    known = least > -1e19
    found: Vector = quadprog.solve_qp(
        SCALE * hessian, -SCALE * gradient, matrix[known].T, least[known], len(value)
    )[0]
    return found


def legged(name: str, *, held: Held = None, regularisation: float = 1e-3) -> Case:
    """A robot on point feet with tasks of its base and of its swing feet."""
    robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
    q = (hp.make_gait(robot) if name == "harpy" else hp.gaits.Standing(robot)).initial_state()[0]
    return Case(robot, q, _base_and_swing(robot, held), held, regularisation)


def _base_and_swing(robot: hp.Robot, held: Held) -> dict[AnyTask, ArrayLike]:
    base = robot.model.names[1]
    tasks: dict[AnyTask, ArrayLike] = {
        hp.FrameTask(base): 1.0,
        hp.FrameTask(base, part="orientation", axes="local"): 0.25,
    }
    return tasks | {
        hp.FrameTask(foot): 12.0 for foot, on in zip(robot.feet, held or (), strict=False) if not on
    }


def humanoid(name: str, *, held: Held = None) -> Case:
    """A humanoid on soles with tasks of torso, both hands, centre of mass, angular momentum and
    joints.
    """
    robot = hp.load_robot(name)
    tasks: dict[AnyTask, ArrayLike] = {
        hp.FrameTask(TORSO[name], part="orientation"): 1.0,
        hp.CentreOfMassTask(): 5.0,
    }
    tasks |= {
        hp.FrameTask(hand, part="both"): (1.0, 1.0, 1.0, 0.2, 0.2, 0.2) for hand in HANDS[name]
    }
    tasks[hp.JointTask(robot.joints)] = np.linspace(1e-3, 3e-2, len(robot.joints))
    tasks[MomentumTask()] = 1e-2
    return Case(robot, hp.gaits.Standing(robot).initial_state()[0], tasks, held)


def with_both_hands() -> Case:
    """G1 whose one hand has tasks of its pose relative to the other and of the place relative to
    the torso.
    """
    robot = hp.load_robot("g1")
    left, right = HANDS["g1"]
    tasks: dict[AnyTask, ArrayLike] = {
        hp.FrameTask(left, part="both", root=right): (1.0, 1.0, 1.0, 0.2, 0.2, 0.2),
        hp.FrameTask(right, root=TORSO["g1"], axes="local"): 3.0,
        hp.CentreOfMassTask(): 5.0,
        hp.JointTask(robot.joints): np.linspace(1e-3, 3e-2, len(robot.joints)),
    }
    return Case(robot, hp.gaits.Standing(robot).initial_state()[0], tasks)


def on_points() -> Case:
    """G1 with a point in the middle of each sole."""
    robot = hp.load_robot("g1", feet=CATALOGUE["g1"].feet)
    q = hp.gaits.Standing(hp.load_robot("g1")).initial_state()[0]
    return Case(robot, q, _base_and_swing(robot, None), regularisation=1e-2)


def b1_with_arm() -> hp.Robot:
    """A quadruped with an arm of six joints on its back."""
    path = CATALOGUE["b1"].path().with_name("b1-z1.urdf")
    names = [*pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer()).names][2:]
    legs = {"hip": 0.0, "thigh": 0.8, "calf": -1.6}
    posture = [
        ARM.get(name, legs.get(name.split("_")[1] if "_" in name else "", 0.0)) for name in names
    ]
    feet = [f"{leg}_foot" for leg in ("FL", "FR", "RL", "RR")]
    return hp.load_robot(path, feet=feet, posture=posture)


def with_arm(*, held: Held = None) -> Case:
    """It, with tasks of its gripper."""
    robot = b1_with_arm()
    tasks = _base_and_swing(robot, held) | {
        hp.FrameTask(GRIPPER, part="both"): (1.0, 1.0, 1.0, 0.2, 0.2, 0.2)
    }
    return Case(robot, hp.gaits.Standing(robot).initial_state()[0], tasks, held, 1e-2)


def _link(
    model: pin.Model, joint: int, mass: float, size: Sequence[float], centre: Sequence[float]
) -> None:
    model.appendBodyToJoint(
        joint, pin.Inertia.FromBox(mass, *size), pin.SE3(np.eye(3), np.array(centre))
    )


def legs_of(
    kinds: Sequence[Callable[[], object]],
    lengths: Sequence[float],
    places: Sequence[tuple[float, float, float]],
    *,
    sole: bool = False,
    angles: Sequence[float],
    height: float,
) -> tuple[hp.Robot, Vector]:
    """A box on legs with joints of these kinds, each its length below the last."""
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.addJointFrame(root, 0)
    _link(model, root, 15.0, (0.4, 0.3, 0.2), (0.0, 0.0, 0.1))
    feet = []
    for leg, place in enumerate(places):
        joint, origin = root, np.array(place)
        for n, (kind, length) in enumerate(zip(kinds, lengths, strict=True)):
            joint = model.addJoint(joint, kind(), pin.SE3(np.eye(3), origin), f"leg{leg}_{n}")
            _link(model, joint, 1.0, (0.05, 0.05, max(length, 0.05)), (0.0, 0.0, -0.5 * length))
            origin = np.array((0.0, 0.0, -length))
        corners = (
            [(x, y, 0.0) for x in (0.1, -0.1) for y in (0.04, -0.04)] if sole else [(0.0, 0.0, 0.0)]
        )
        for n, corner in enumerate(corners):
            feet.append(f"foot{leg}_{n}")
            place = pin.SE3(np.eye(3), origin + corner)
            model.addFrame(pin.Frame(feet[-1], joint, 0, place, pin.FrameType.OP_FRAME))
    q = np.concatenate(((0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0), np.tile(angles, len(places))))
    robot = hp.Robot(
        model, None, tuple(feet), (), np.inf, flat_feet=(4,) * len(places) if sole else ()
    )
    return robot, q


def seven_joints(*, held: Held = None) -> Case:
    """A biped with legs of seven joints on soles."""
    x, y, z = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
    places, angles = ((0.0, 0.1, 0.0), (0.0, -0.1, 0.0)), (0.0, 0.0, -0.4, 0.8, 0.0, -0.4, 0.0)
    lengths = (0.0, 0.0, 0.4, 0.2, 0.2, 0.0, 0.06)
    robot, q = legs_of((z, x, y, y, z, y, x), lengths, places, sole=True, angles=angles, height=0.9)
    return Case(robot, q, _base_and_swing(robot, None), held, 1e-2)


def two_joints(*, held: Held = None, compliance: float = 0.0) -> Case:
    """A quadruped with legs of two joints: four feet cannot follow every target."""
    places = tuple((x, y, 0.0) for x in (0.2, -0.2) for y in (0.15, -0.15))
    angles = (0.6, -1.2)
    robot, q = legs_of((pin.JointModelRY,) * 2, (0.2, 0.2), places, angles=angles, height=0.35)
    return Case(robot, q, _base_and_swing(robot, held), held, 1e-2, compliance)


CASES: dict[str, Callable[[], Case]] = {
    "go2 stands": lambda: legged("go2"),
    "go2 trots": lambda: legged("go2", held=(1, 0, 0, 1)),
    "solo12 stands": lambda: legged("solo12"),
    "harpy stands": lambda: legged("harpy", regularisation=1e-6),
    "harpy on one foot": lambda: legged("harpy", held=(1, 0), regularisation=1e-6),
    "g1 stands": lambda: humanoid("g1"),
    "g1 on one foot": lambda: humanoid("g1", held=(1, 0)),
    "talos stands": lambda: humanoid("talos"),
    "talos on one foot": lambda: humanoid("talos", held=(1, 0)),
    "g1 with both hands": with_both_hands,
    "g1 on points": on_points,
    "b1 with an arm stands": with_arm,
    "b1 with an arm trots": lambda: with_arm(held=(1, 0, 0, 1)),
    "legs of seven joints": seven_joints,
    "legs of seven joints, one held": lambda: seven_joints(held=(1, 0)),
    "legs of two joints trot": lambda: two_joints(held=(1, 0, 0, 1)),
}
