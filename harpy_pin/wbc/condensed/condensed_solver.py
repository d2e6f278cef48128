"""The condensed whole-body optimum from Python: the records of a robot, and one solve."""

from __future__ import annotations

from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import as_array
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Record, Records, field, make_record, same_layout
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condense import CondensationRecord
from harpy_pin.wbc.condensed.limits import TorqueLimitsRecord
from harpy_pin.wbc.condensed.solve import CondensedRecord, solve_condensed
from harpy_pin.wbc.newton import newton_record
from harpy_pin.wbc.problem import problem_values
from harpy_pin.wbc.weights import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights, check_terms

_JOINTS = {1: 3}
"""Joints of a limb by the contact points of its foot; six for all others."""


class CondensedStatus(IntFlag):
    """How a tick ended; up to three it is the optimum."""

    OPTIMAL = 0
    THRUST_LIMITED = 1
    """A thrust is at its limit."""
    TORQUE_LIMITED = 2
    """A torque is at its limit."""
    SUBOPTIMAL = 4
    """The search for the forces ended at its bound; they are in their pyramids."""
    TORQUE_CLIPPED = 8
    """Torques were clipped: the forces that follow are not the ones intended."""


def condensed_record(
    robot: Robot, weights: WholeBodyWeights, limits: WholeBodyLimits, *, hold_ticks: float = 0
) -> Records[CondensedRecord]:
    """A new :class:`CondensedRecord`; arguments and errors as of :class:`CondensedSolver`.

    For ``hold_ticks`` ticks in a row :func:`hold_last` gives the last inputs in the place of
    clipped ones.
    """
    sizes = condensed_sizes(robot)
    return make_record(
        CondensedRecord,
        sizes,
        root=condensation_record(robot),
        newton=newton_record(
            sizes, limits, force_weight=weights.force, thrust_weight=weights.thrust
        ),
        limits=make_record(TorqueLimitsRecord, sizes),
        hold_ticks=np.int64(hold_ticks),
        clipped=np.array(
            [0, hold_ticks], dtype=np.int64
        ),  # before the first command there is none to hold
        **problem_values(robot, weights, limits),
    )


def condensation_record(robot: Robot) -> Records[CondensationRecord]:
    """A new :class:`CondensationRecord`.

    Raises:
        InputError: the feet do not hang on such limbs, or are of several kinds.
    """
    model, limbs = robot.model, _limbs(robot)
    columns = {column for limb in limbs for column in limb}
    corners = robot.corners[0] if limbs else 1
    joints = len(limbs[0]) if limbs else 3
    return make_record(
        CondensationRecord,
        {**condensed_sizes(robot), "limbs": len(limbs), "j": joints, "r": 3 * corners},
        limb=np.array(limbs, dtype=np.int64).reshape(-1, joints),
        others=np.array([c for c in range(6, model.nv) if c not in columns], dtype=np.int64),
    )


def condensed_sizes(robot: Robot) -> dict[str, int]:
    """Numbers by which shapes of the condensed program are named: those of the robot, and of its
    joints on no limb.
    """
    on_limbs = sum(_JOINTS.get(corners, 6) for corners in robot.corners)
    return {**robot.sizes, "others": len(robot.joints) - on_limbs}


def _limbs(robot: Robot) -> list[list[int]]:
    """Columns of the joints between the root and each foot."""
    model = robot.model
    if len(set(robot.corners)) > 1:
        raise InputError(
            f"the feet of '{robot.name}' have {robot.corners} contact points: all must be points, "
            f"or flat feet alike",
            name="robot",
        )
    starts = np.cumsum((0, *robot.corners))[:-1]
    feet = [robot.feet[first] for first in starts]
    supports = [model.supports[model.frames[robot.frame_id(foot)].parentJoint] for foot in feet]
    limbs = [[j for j in chain if j > 1] for chain in supports]
    used: dict[int, str] = {}
    for foot, limb in zip(feet, limbs, strict=True):
        for joint in limb:
            if joint in used:
                raise InputError(
                    f"joint '{model.names[joint]}' of '{robot.name}' moves the feet "
                    f"'{used[joint]}' and '{foot}': "
                    "limbs must not share joints, so every leg must begin at the base; controller "
                    "'wbc' has any legs",
                    name="robot",
                )
            used[joint] = foot
    for foot, corners, limb in zip(feet, robot.corners, limbs, strict=True):
        desired = _JOINTS.get(corners, 6)
        if len(limb) != desired:
            kind = "point foot" if corners == 1 else "flat foot"
            names = ", ".join(model.names[j] for j in limb) or "none"
            raise InputError(
                f"the limb of a {kind} must have {desired} joints; that of '{foot}' of "
                f"'{robot.name}' has "
                f"{len(limb)}: {names}; controller 'wbc' has any legs",
                name="robot",
            )
    return [[model.joints[j].idx_v for j in limb] for limb in limbs]


@fixed_arrays("acceleration", "force", "inputs", "record")
class CondensedSolver(KeepsViews):
    """Contact forces, torques and thrusts of one tick in one call.

    Args:
        robot: with a limb of its own for each foot.
        weights: of the tasks, by default those that fit the robot; the posture's is not used: limbs
            have no free posture.
        limits: of the constraints.
        record: where everything is kept, a part of a larger record, made by
            :func:`condensed_record`.

    Attributes:
        force: (feet, 3) contact forces of the last tick, world axes, N; zero in swing.
        inputs: (thrust variables + joints,) [u; τ] of the last tick, N and N·m; see
            :mod:`harpy_pin.model.rotor`.
        acceleration: (nv,) generalised acceleration that follows.
        status: of the last tick.
        steps: Newton's steps of the last tick's search.

    Raises:
        InputError: another kind of robot.
    """

    _record_: Records[CondensedRecord]
    _inputs_: Vector

    @checked
    def __init__(
        self,
        robot: Robot,
        weights: WholeBodyWeights | None = None,
        limits: WholeBodyLimits | None = None,
        *,
        record: Record | None = None,
    ) -> None:
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights.for_robot(robot)
        self.limits = limits if limits is not None else WholeBodyLimits()
        own = condensed_record(robot, self.weights, self.limits)
        self.record = own if record is None else same_layout(record, own)
        self.force: Vector = field(self._record_, "force").reshape(-1, 3)
        self.inputs: Vector = field(self._record_, "inputs")
        self.acceleration: Vector = field(self._record_["root"], "acceleration")
        self._outcome: NDArray[np.int64] = field(self._record_, "status_and_steps")

    def reset(self) -> None:
        """Forget where the last tick's search ended."""
        for name in ("free_piece", "limited_piece"):
            self._record_[name] = 0
        self._record_["limits"]["last_end"] = 0

    @property
    def status(self) -> CondensedStatus:
        """Status of the last tick."""
        return CondensedStatus(int(self._outcome[0]))

    @property
    def steps(self) -> int:
        """Newton's steps of the last tick's search."""
        return int(self._outcome[1])

    def solve(
        self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets
    ) -> Vector:
        """One tick.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            rotation: (3, 3) body to world.
            targets: of the tasks.

        Returns:
            (thrust variables + joints,) [u; τ]: the array :attr:`inputs` itself.

        Raises:
            InputError: terms or targets of another robot, or an array of another shape.
        """
        check_terms(self.robot, dynamics, targets)
        v = as_array("v", v, (self.robot.model.nv,))
        rotation = as_array("rotation", rotation, (3, 3))
        solve_condensed(dynamics._record_, targets._record_, self._record_, v, rotation)
        return self._inputs_
