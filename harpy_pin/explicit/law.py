"""The whole-body optimum as a program in the contact forces alone, solved in a bounded number of operations.

With limbs eliminated (:mod:`harpy_pin.model.root_equation`), the whole-body program of :mod:`harpy_pin.wbc` is

    minimise    ½ ‖L⁻ᵀ (w − G_f f)‖² + ½ w_f ‖f‖²
    subject to  every f_k in its friction pyramid and its range of normal force

with three unknowns for each foot. The last tick's active set is tried, then exchanged; the dual active-set method
follows, and at the end every force is put into its pyramid, whatever happened before. Limits come after: a thrust
beyond its limit is fixed there and the forces are sought again; torques beyond theirs become rows of the program.

What holds, for the rigid robot with regular limbs, at every state and for every target: with the torques and thrusts
returned, the force on each held foot is f, and f is in its pyramid and range. The one exception is in the status:
torques that had to be clipped, since no force in the pyramids is within reach of the motors that the search could find.
"""

from __future__ import annotations

from enum import IntFlag

import numpy as np
from numba import njit
from numpy.typing import NDArray

from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.record import Record, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.root_equation import (
    eliminate_limbs,
    fix_thrusts,
    input_map,
    joint_torques,
    recover,
    root_equation,
    root_factor,
)
from harpy_pin.model.state import Vector
from harpy_pin.wbc.dual import DualActiveSet, dual_active_set
from harpy_pin.wbc.force import force_objective
from harpy_pin.wbc.problem import force_bounds, wanted_acceleration
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.reuse import EXCHANGES, ReusedActiveSet, exchange
from harpy_pin.wbc.settings import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights, thrust_box

__all__ = ["ExplicitLaw", "LawStatus"]


class LawStatus(IntFlag):
    """What happened in a tick; zero is the optimum of the program without limits of thrust or torque in the way."""

    OPTIMAL = 0
    THRUST_LIMITED = 1
    """A thrust was held at its limit."""
    TORQUE_LIMITED = 2
    """A torque was held at its limit by rows of the program."""
    SUBOPTIMAL = 4
    """The search for the active set ended at its bound; the forces were put into their pyramids."""
    TORQUE_CLIPPED = 8
    """Torques were clipped: the forces that follow are not the ones intended."""


class ExplicitLaw:
    """Contact forces, torques and thrusts of one tick in one call.

    Args:
        robot: each foot on a limb of three joints, no others.
        weights: of the tasks; the posture's does not enter, since limbs leave no posture free.
        limits: of the constraints; ``slack`` does not enter.

    Attributes:
        force: (feet, 3) contact forces of the last tick, world axes, N; zero in the air.
        inputs: (3 thrusters + joints,) [u; τ] of the last tick, N and N·m.
        acceleration: (nv,) generalised acceleration that follows.
        status: of the last tick.
        systems: linear systems solved in the last tick's search.

    Raises:
        InputError: another kind of robot.
    """

    def __init__(
        self, robot: Robot, weights: WholeBodyWeights | None = None, limits: WholeBodyLimits | None = None
    ) -> None:
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights()
        self.limits = limits if limits is not None else WholeBodyLimits()
        feet, joints, thrusts = len(robot.feet), len(robot.joints), 3 * len(robot.thrusters)
        w, pyramid = self.weights, self.limits.pyramid
        record = make_record(
            root=root_equation(robot),
            cones=self._search(pyramid, feet, joints),
            limited=self._search(pyramid, feet, joints),
            w_body=w.body,
            w_orientation=w.orientation,
            w_swing=w.swing,
            w_thrust=w.thrust,
            w_force=w.force,
            pyramid=pyramid,
            thrust_limit=thrust_box(robot, self.limits),
            torque_limit=self.limits.torque_scale * robot.torque_limit,
            force=np.zeros(3 * feet),
            inputs=np.zeros(thrusts + joints),
            response=np.zeros((6, 3 * feet)),
            wanted=np.zeros(robot.model.nv),
            gain=np.zeros((thrusts + joints, 3 * feet)),
            at_rest=np.zeros(thrusts + joints),
            status_and_systems=np.zeros(2, dtype=np.int64),
        )
        self.record = record
        self.force: Vector = field(record, "force").reshape(-1, 3)
        self.inputs: Vector = field(record, "inputs")
        self.acceleration: Vector = field(record["root"], "acceleration")
        self._told: NDArray[np.int64] = field(record, "status_and_systems")

    @staticmethod
    def _search(pyramid: Vector, feet: int, joints: int) -> Record:
        """A program, whose torque rows come last, and what the exchange and the dual method work in."""
        rows = len(pyramid) + 1
        program = QuadraticProgram(3 * feet, equalities=0, inequalities=rows * feet + joints, bounded=0)
        for k in range(feet):
            program.inequality[rows * k : rows * (k + 1) - 1, 3 * k : 3 * k + 3] = pyramid
            program.inequality[rows * (k + 1) - 1, 3 * k + 2] = 1.0
        # Rows of the torques that no torque is asked of: zero, and within any bounds.
        program.lower[rows * feet :], program.upper[rows * feet :] = -1.0, 1.0
        search = ReusedActiveSet(program, DualActiveSet(program))
        return make_record(program=program.record, exchange=search.record, dual=search.dual.record)

    def reset(self) -> None:
        """Forget the active sets."""
        for search in ("cones", "limited"):
            self.record[search]["exchange"]["active"] = 0

    @property
    def status(self) -> LawStatus:
        """Of the last tick."""
        return LawStatus(int(self._told[0]))

    @property
    def systems(self) -> int:
        """Linear systems of the last tick's search."""
        return int(self._told[1])

    def solve(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> Vector:
        """One tick.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            rotation: (3, 3) body to world.
            targets: of the tasks.

        Returns:
            (3 thrusters + joints,) [u; τ]: the array :attr:`inputs` itself.
        """
        _law(dynamics.record, targets.record, self.record, v, rotation)
        return self.inputs


@njit(cache=True)
def _law(dynamics, targets, record, v, rotation):  # type: ignore[no-untyped-def]
    law(dynamics[0], targets[0], record[0], v, rotation)


@njit(cache=True)
def law(d, t, p, v, rotation):  # type: ignore[no-untyped-def]
    """One tick, on elements of the records; see :class:`ExplicitLaw`."""
    r, cones, limited = p.root, p.cones.program, p.limited.program
    p.status_and_systems[:] = 0
    wanted_acceleration(v, rotation, t, p.wanted)
    for i in range(6):
        r.wanted[i] = p.wanted[i]
    eliminate_limbs(d, t, p, r, v)
    thrusts = d.thruster_jacobian.shape[0]
    torque = p.inputs[thrusts:]
    force_bounds(t, p.pyramid.shape[0], cones.lower, cones.upper)
    for _ in range(thrusts + 1):  # each pass but the last fixes a thrust, or more
        root_factor(r)
        force_objective(t, p.w_force, r, p.response, cones)
        _search(p, p.cones)
        into_pyramids(t, p)
        recover(r, p.force)
        if not fix_thrusts(r, p.thrust_limit):
            break
        p.status_and_systems[0] |= 1
    joint_torques(d, r, v, p.force, torque)
    if _beyond_torques(p, torque):
        p.status_and_systems[0] |= 2
        force_bounds(t, p.pyramid.shape[0], limited.lower, limited.upper)
        limited.hessian[:] = cones.hessian
        limited.gradient[:] = cones.gradient
        _torque_rows(d, t, p, r, limited, v)
        _search(p, p.limited)
        into_pyramids(t, p)
        recover(r, p.force)
        _clip_thrusts(p, r, thrusts)
        joint_torques(d, r, v, p.force, torque)
        if _clip_torques(p, torque):
            p.status_and_systems[0] |= 8
    for c in range(thrusts):
        p.inputs[c] = r.give[c]


@njit(cache=True)
def _search(p, search):  # type: ignore[no-untyped-def]
    """Forces at the optimum, by the last active set, its exchange, or the dual method."""
    systems, _ = exchange(search.program, search.exchange, p.force)
    p.status_and_systems[1] += systems
    if systems <= EXCHANGES:
        return
    outcome, exchanges = dual_active_set(search.program, search.dual, p.force)
    p.status_and_systems[1] += exchanges
    search.exchange.active[:] = search.dual.active
    finite = True
    for c in range(p.force.shape[0]):
        finite = finite and np.isfinite(p.force[c])
    if outcome != 0 or not finite:
        p.status_and_systems[0] |= 4
        search.exchange.active[:] = 0
        if not finite:
            p.force[:] = 0.0


@njit(cache=True)
def into_pyramids(t, p):  # type: ignore[no-untyped-def]
    """Put every force into its range and pyramid: it changes only what is outside, and little after a good search."""
    faces = p.pyramid.shape[0]
    for k in range(t.held.shape[0]):
        f = p.force[3 * k : 3 * k + 3]
        if t.held[k] == 0.0:
            f[:] = 0.0
            continue
        f[2] = min(max(f[2], t.force_range[k, 0]), t.force_range[k, 1])
        share = 1.0
        for r in range(faces):
            outward = -(p.pyramid[r, 0] * f[0] + p.pyramid[r, 1] * f[1])
            inside = p.pyramid[r, 2] * f[2]
            if outward * share > inside:
                share = max(inside, 0.0) / outward
        f[0] *= share
        f[1] *= share


@njit(cache=True)
def _clip_thrusts(p, r, thrusts):  # type: ignore[no-untyped-def]
    """Thrusts within their limits, and the acceleration that follows, after the last pass."""
    if fix_thrusts(r, p.thrust_limit):
        p.status_and_systems[0] |= 1
        root_factor(r)
        recover(r, p.force)
        for c in range(thrusts):
            if r.ease[c] != 0.0:
                # What the last pass left free is fixed as it is, clipped.
                r.give[c] = min(max(r.give[c], -p.thrust_limit[c]), p.thrust_limit[c])
                r.ease[c] = 0.0
                for i in range(6):
                    r.load[i] -= r.give_map[i, c] * r.give[c]
        root_factor(r)
        recover(r, p.force)


@njit(cache=True)
def _beyond_torques(p, torque):  # type: ignore[no-untyped-def]
    """Whether a torque is beyond its limit, or no number."""
    found = False
    for j in range(torque.shape[0]):
        found = found or not abs(torque[j]) <= p.torque_limit[j]
    return found


@njit(cache=True)
def _clip_torques(p, torque):  # type: ignore[no-untyped-def]
    """Clip the torques; whether more than rounding was clipped."""
    clipped = False
    for j in range(torque.shape[0]):
        limit = p.torque_limit[j]
        if not abs(torque[j]) <= limit:
            clipped = clipped or not abs(torque[j]) <= limit * (1.0 + 1e-6)
            torque[j] = min(max(torque[j], -limit), limit) if np.isfinite(torque[j]) else 0.0
    return clipped


@njit(cache=True)
def _torque_rows(d, t, p, r, qp, v):  # type: ignore[no-untyped-def]
    """Torques as an affine function of the forces, ``p.response`` being that of the objective: their rows."""
    joints, thrusts = p.torque_limit.shape[0], p.thrust_limit.shape[0]
    first = qp.lower.shape[0] - joints
    input_map(d, t, r, v, p.response, p.gain, p.at_rest)
    for j in range(joints):
        qp.inequality[first + j] = p.gain[thrusts + j]
        qp.lower[first + j] = -p.torque_limit[j] - p.at_rest[thrusts + j]
        qp.upper[first + j] = p.torque_limit[j] - p.at_rest[thrusts + j]
