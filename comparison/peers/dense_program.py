"""The program of the numbers that peers are given, by Pinocchio and NumPy alone: nothing of
``harpy_pin`` builds it.

Tests solve it and compare with our controllers; placo's planar contacts are checked with it, which
pose another one. It is slow.
"""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import quadprog

from comparison.peers.peer_problem import Expected, PeerProblem
from harpy_pin.model.state import Vector

WORLD = pin.LOCAL_WORLD_ALIGNED

_PYRAMID = np.array(((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)))


def planar_options(problem: PeerProblem) -> dict[str, object]:
    """What placo's worker is told of planar contacts: sides of the soles, m, and weights of force
    and moment.

    Their weights are those of four corners that share a force, and a moment about the normal,
    alike.
    """
    corners, force = np.array(problem.settings["corners"]), problem.settings["weights"]["force"]
    sides = (2.0 * corners.max(axis=1))[:, :2].tolist()
    moment = [force / float((corner[:, :2] ** 2).sum()) for corner in corners]
    return {"planar": {"sides": sides, "force": 0.25 * force, "moment": moment}}


class DenseProgram:
    """½ xᵀ H x + gᵀ x with A x = b and C x ≤ d, in x = [accelerations; contact forces; thrusts], of
    one tick.

    Args:
        problem: what peers are given.
        model: of the file that they read.
        i: the tick.
        planar: whether soles are planar contacts as placo has them, in place of corners.
    """

    def __init__(
        self, problem: PeerProblem, model: pin.Model, i: int, *, planar: bool = False
    ) -> None:
        s = problem.settings
        self.problem, self.i, self.model, self.data, nv = (
            problem,
            i,
            model,
            model.createData(),
            model.nv,
        )
        self._evaluate()
        self.held, self.nv = problem.held[i] > 0.0, nv
        self.points = [] if planar else [int(k) for k in np.flatnonzero(problem.loaded[i])]
        supports = list(self._planar() if planar else self._corners())
        thrusters = [self.frame(name)[0][:3] for name in s["thrusters"]]
        jacobian = np.vstack([*(rows for rows, _, _ in supports), *thrusters, np.zeros((0, nv))])
        size, at = nv + len(jacobian), nv
        # Inverse dynamics: [0; τ] = left x + right.
        left = np.hstack((self.mass, -jacobian.T))
        right = self.data.nle + problem.resistance[i]
        self.torque_left, self.torque_right = left[6:], right[6:]
        holding = list(self._holding())
        motions = [np.hstack((rows, np.zeros((len(rows), size - nv)))) for rows, _ in holding]
        self.equal = np.vstack([left[:6], *motions])
        self.value = np.concatenate([-right[:6], *(value for _, value in holding)])
        limit = np.array(s["torque_limit"])
        below, bound, squares = [left[6:], -left[6:]], [limit - right[6:], limit + right[6:]], []
        for rows, cone, weights in supports:
            inside = np.zeros((len(cone), size))
            inside[:, at : at + len(rows)] = cone
            below.append(inside)
            bound.append(np.zeros(len(cone)))
            squares.append(weights)
            at += len(rows)
        squares.append(np.full(3 * len(thrusters), s["weights"]["thrust"]))
        finite = np.isfinite(np.concatenate(bound))
        self.below, self.bound = np.vstack(below)[finite], np.concatenate(bound)[finite]
        self.hessian, self.gradient = np.zeros((size, size)), np.zeros(size)
        self.hessian[nv:, nv:] = np.diag(np.concatenate(squares))
        self._add_tasks()

    def _evaluate(self) -> None:
        q, v, rest = self.problem.q[self.i], self.problem.v[self.i], np.zeros(self.model.nv)
        pin.computeAllTerms(self.model, self.data, q, v)
        self.mass = np.triu(self.data.M) + np.triu(self.data.M, 1).T
        pin.centerOfMass(self.model, self.data, q, v, rest)
        pin.forwardKinematics(self.model, self.data, q, v, rest)
        pin.updateFramePlacements(self.model, self.data)

    def frame(self, name: str, axes: pin.ReferenceFrame = WORLD) -> tuple[Vector, Vector]:
        """(6, nv) Jacobian of a frame, and (6,) its acceleration at none of the joints."""
        number = self.model.getFrameId(name)
        drift = pin.getFrameClassicalAcceleration(self.model, self.data, number, axes).vector
        return pin.getFrameJacobian(self.model, self.data, number, axes), drift

    def _corners(self) -> Iterator[tuple[Vector, Vector, Vector]]:
        """Jacobian, rows of the cone (cone f ≤ 0) and weights of each point that bears."""
        s = self.problem.settings
        cone = np.hstack((_PYRAMID, np.full((4, 1), -s["mu"])))
        for k in self.points:
            yield self.frame(s["contacts"][k])[0][:3], cone, np.full(3, s["weights"]["force"])

    def _planar(self) -> Iterator[tuple[Vector, Vector, Vector]]:
        """The same of the wrench of each held sole, in its own axes."""
        s, options = self.problem.settings, planar_options(self.problem)["planar"]
        assert isinstance(options, dict)
        for n, name in enumerate(s["soles"]):
            if self.held[4 * n]:
                length, width = options["sides"][n]
                cone = np.zeros((9, 6))
                cone[0, 2] = -1.0
                cone[1:5, :2], cone[1:5, 2] = _PYRAMID, -s["mu"]
                cone[5:9, 3:5], cone[5:9, 2] = _PYRAMID, np.repeat((-0.5 * width, -0.5 * length), 2)
                weights = np.repeat((options["force"], options["moment"][n]), 3)
                yield self.frame(name, pin.LOCAL)[0], cone, weights

    def _holding(self) -> Iterator[tuple[Vector, Vector]]:
        """What holds the feet: rows on the accelerations, and their values."""
        p, s, i = self.problem, self.problem.settings, self.i
        for n, name in enumerate(s["soles"]):
            if self.held[4 * n]:
                jacobian, drift = self.frame(name)
                yield jacobian, p.sole[i][n] - drift
        for k in np.flatnonzero(self.held) if not s["soles"] else ():
            jacobian, drift = self.frame(s["contacts"][k])
            yield jacobian[:3], p.feet[i][k] - drift[:3]

    def _add_tasks(self) -> None:
        p, s, i, w = self.problem, self.problem.settings, self.i, self.problem.settings["weights"]
        body, drift = self.frame(s["base"])
        if s["centred"]:
            self._add(w["body"], self.data.Jcom[:2], p.body[i][:2] - self.data.acom[0][:2])
            self._add(w["body"], body[2:3], p.body[i][2:] - drift[2:3])
        else:
            self._add(w["body"], body[:3], p.body[i] - drift[:3])
        self._add(w["orientation"], body[3:], p.orientation[i] - drift[3:])
        for j, weight in enumerate(s["joint_weights"] + p.brake[i]):
            self._add(weight, np.eye(self.nv)[6 + j : 7 + j], p.joints[i][j : j + 1])
        for k in np.flatnonzero(~self.held):
            jacobian, drift = self.frame(s["contacts"][k])
            self._add(w["swing"], jacobian[:3], p.feet[i][k] - drift[:3])

    def _add(self, weight: float, rows: Vector, desired: Vector) -> None:
        """Add ½ weight ‖rows a − desired‖²."""
        self.hessian[: self.nv, : self.nv] += weight * rows.T @ rows
        self.gradient[: self.nv] -= weight * rows.T @ desired

    def solve(self) -> Vector:
        """The optimum: equalities are eliminated, then the dual method of quadprog, which ends to
        rounding.
        """
        r = len(self.value)
        turn, triangle = np.linalg.qr(self.equal.T, mode="complete")
        known = turn[:, :r] @ np.linalg.solve(triangle[:r].T, self.value)
        free = turn[:, r:]
        gradient = free.T @ (self.gradient + self.hessian @ known)
        rows, room = self.below @ free, self.bound - self.below @ known
        y = quadprog.solve_qp(free.T @ self.hessian @ free, -gradient, -rows.T, -room)[0]
        x: Vector = known + free @ y
        return x

    def torque(self, x: Vector) -> Vector:
        """(joints,) of a solution, N·m."""
        tau: Vector = self.torque_left @ x + self.torque_right
        return tau


def read_model(problem: PeerProblem) -> pin.Model:
    """The model that peers read."""
    model = pin.buildModelFromUrdf(problem.settings["urdf"], pin.JointModelFreeFlyer())
    model.armature = np.array(problem.settings["armature"])
    return model


def planar_solutions(problem: PeerProblem, *, every: int) -> Expected:
    """Accelerations and torques with planar contacts at every so many ticks; the others are not
    solved.
    """
    model, e = read_model(problem), problem.expected
    acceleration, torque = np.full_like(e.acceleration, np.nan), np.full_like(e.torque, np.nan)
    solved = np.zeros(len(problem), dtype=np.bool_)
    for i in range(0, len(problem), every):
        program = DenseProgram(problem, model, i, planar=True)
        x = program.solve()
        acceleration[i], torque[i], solved[i] = x[: model.nv], program.torque(x), True
    return Expected(acceleration, torque, e.force, e.thrust, solved)
