"""Whole-body controller: gait → task accelerations → quadratic program → joint torques and thrusts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.base import Gait, GaitTarget
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.kinematics import body_rotation
from harpy_pin.model.state import Command, State
from harpy_pin.wbc import (
    FORMULATIONS,
    SOLVERS,
    QPSolution,
    QPSolver,
    QuadraticProgram,
    WholeBodyLimits,
    WholeBodyProblem,
    WholeBodyTargets,
    WholeBodyWeights,
    make_problem,
    make_solver,
)
from harpy_pin.wbc.settings import unpack_targets

__all__ = ["WholeBodyController", "WholeBodyParameters"]


@dataclass(frozen=True, kw_only=True)
class WholeBodyParameters:
    """Settings of :class:`WholeBodyController`.

    Attributes:
        period: time between ticks, s.
        body: (k_p, k_d) of the body's position, 1/s² and 1/s.
        orientation: (k_p, k_d) of its orientation.
        swing: (k_p, k_d) of a foot in the air.
        posture: (k_p, k_d) of the joints.
        contact_damping: of the velocity of a foot that is held, 1/s.
        min_normal_force: f_min of a foot that carries, N.
        max_normal_force: f_max, N.
        contact_threshold: measured normal force that counts as contact, N.
        hold_ticks: how many ticks in a row a failed solve is bridged by the last good command.
        formulation: one of :data:`harpy_pin.wbc.FORMULATIONS`; all have the same solutions, ``command`` is the fastest.
        solver: one of :data:`harpy_pin.wbc.SOLVERS`.
        reuse: try the last tick's active set first, and ask the solver only where it is not optimal any more.
        weights: of the tasks.
        limits: of the constraints.
    """

    period: float = 1e-3
    body: tuple[float, float] = (25.0, 10.0)
    orientation: tuple[float, float] = (400.0, 40.0)
    swing: tuple[float, float] = (400.0, 40.0)
    posture: tuple[float, float] = (100.0, 20.0)
    contact_damping: float = 200.0
    min_normal_force: float = 20.0
    max_normal_force: float = 200.0
    contact_threshold: float = 1.0
    hold_ticks: int = 20
    formulation: str = "command"
    solver: str = "proxqp"
    reuse: bool = True
    weights: WholeBodyWeights = field(default_factory=WholeBodyWeights)
    limits: WholeBodyLimits = field(default_factory=WholeBodyLimits)

    def __post_init__(self) -> None:
        checks.number("period", self.period, low=0.0, strict=True)
        for name in ("body", "orientation", "swing", "posture"):
            checks.gains(f"gains of {name}", getattr(self, name), 2)
        for name in ("contact_damping", "min_normal_force", "contact_threshold", "hold_ticks"):
            checks.number(name, getattr(self, name), low=0.0)
        checks.number("max_normal_force", self.max_normal_force, low=self.min_normal_force, strict=True)
        for kind, name, valid in (("formulation", self.formulation, FORMULATIONS), ("solver", self.solver, SOLVERS)):
            if name not in valid:
                raise InputError.unknown(kind, name, valid)


class WholeBodyController:
    """Walks by solving a quadratic program at every tick.

    ``step`` is a chain of :meth:`prepare`, :meth:`build`, :meth:`solve` and :meth:`finish`, which may be called (and
    timed) apart; between them :attr:`problem` can be inspected.

    Where the solver fails, the last good command is held for ``hold_ticks`` ticks; after that the joints are held by
    a soft spring and damper at the gait's posture, without thrust. :attr:`failures` counts the ticks.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits.
        solver: makes a solver of your own for the program, instead of the one that the parameters name.

    Attributes:
        problem: the whole-body problem of the last tick; its ``program`` is what is solved.
        solution: its solution.
        failures: ticks whose solution was not usable, since the last reset.
    """

    def __init__(
        self,
        gait: Gait,
        parameters: WholeBodyParameters | None = None,
        *,
        solver: Callable[[QuadraticProgram], QPSolver] | None = None,
    ) -> None:
        self.gait = gait
        self.robot = gait.robot
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        self.period = p.period
        self.dynamics = Dynamics(self.robot)
        self.problem: WholeBodyProblem = make_problem(p.formulation, self.robot, p.weights, p.limits)
        self.targets = WholeBodyTargets(self.robot)
        self.target: GaitTarget = gait.target
        self.failures = 0
        program = self.problem.program
        self._solver = make_solver(p.solver, program, reuse=p.reuse) if solver is None else solver(program)
        self.solution: QPSolution = self._solver.solution
        self._gains = np.array([*p.body, *p.orientation, *p.swing, *p.posture, p.contact_damping])
        self._force = np.array([p.min_normal_force, p.max_normal_force, p.contact_threshold])
        self._posture = gait.initial_state()[0][7:]
        self._rotation = np.zeros((3, 3))
        self._reference = np.zeros(6)
        thrusts = self.problem.n_thrust
        self._inputs = np.zeros(thrusts + self.problem.joints)
        self._command = Command(self._inputs[thrusts:], self._inputs[:thrusts].reshape(-1, 3))
        self._held_for = 0
        self._double = gait.double_support

    def reset(self) -> None:
        """Forget the warm start and the last command."""
        self._solver.reset()
        self._inputs[:] = 0.0
        self._held_for = 0
        self.failures = 0

    def step(self, state: State) -> Command:
        """One tick: joint torques and thrusts."""
        self.prepare(state)
        self.build(state)
        self.solve()
        return self.finish(state)

    def prepare(self, state: State) -> None:
        """Targets of the gait, and the robot's dynamics at the state."""
        self.target = self.gait.update(state.t)
        self.dynamics.update(state.q, state.v)

    def build(self, state: State) -> WholeBodyProblem:
        """Task accelerations and contact states, then the quadratic program.

        Returns:
            The problem, ready to be solved.
        """
        target, targets, d = self.target, self.targets, self.dynamics
        _targets(
            state.q,
            state.v,
            d.foot_position,
            d.foot_velocity,
            state.foot_force,
            target.packed,
            self._posture,
            self._gains,
            self._force,
            self._double,
            self._rotation,
            targets.packed,
        )
        self.problem.build(d, state.v, self._rotation, targets)
        return self.problem

    def solve(self) -> QPSolution:
        """Solve the problem from the last tick's solution."""
        self.solution = self._solver.solve(self.problem.program)
        return self.solution

    def finish(self, state: State) -> Command:
        """Torques and thrusts of the solution, or the fallback."""
        command = self._command
        if self.solution.usable:
            self._held_for = 0
            self.problem.inputs(self.solution.z, self._inputs)
        else:
            self.failures += 1
            self._held_for += 1
            if self._held_for > self.parameters.hold_ticks:
                command.torque[:] = 50.0 * (self._posture - state.q[7:]) - 1.0 * state.v[6:]
                np.clip(command.torque, -self.robot.torque_limit, self.robot.torque_limit, out=command.torque)
                command.thrust[:] = 0.0
        return command

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, planned and held feet, forces the program wanted, and the solver's status."""
        self._reference[:] = self.target.body[:6]
        return {
            "x_r": self._reference,
            "stance": self.target.stance,
            "held": self.targets.held,
            "wanted_force": self.problem.contact_force(self.solution.z),
            "qp_status": int(self.solution.status),
            "qp_iterations": self.solution.iterations,
            "qp_violation": self.solution.violation,
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {
            "gait": dict(self.gait.describe()),
            "control": asdict(self.parameters),
        }


@njit(cache=True)
def _targets(  # type: ignore[no-untyped-def]
    q,
    v,
    foot_position,
    foot_velocity,
    foot_force,
    target,
    posture,
    gains,
    force,
    double,
    rotation,
    packed,
):
    """Task accelerations, which feet are held, and the range of their normal forces."""
    body_out, orientation_out, feet_out, held, force_range, joints_out = unpack_targets(packed, 2)
    body, foot_target, foot_target_velocity = target[:9], target[9:15], target[15:21]
    foot_target_acceleration, stance, progress = target[21:27], target[27:29], target[29:31]
    body_rotation(q, rotation)
    x, y, z, w = q[3], q[4], q[5], q[6]

    # Rotation vector of the body, from the quaternion: the target body is upright.
    sign = 1.0 if w >= 0.0 else -1.0
    norm = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 * sign
    if norm > 1e-9:
        scale = 2.0 * sign * np.arctan2(norm, abs(w)) / norm
    for i in range(3):
        velocity = rotation[i, 0] * v[0] + rotation[i, 1] * v[1] + rotation[i, 2] * v[2]
        body_out[i] = body[6 + i] + gains[0] * (body[i] - q[i]) + gains[1] * (body[3 + i] - velocity)
        orientation_out[i] = -gains[2] * scale * q[3 + i] - gains[3] * v[3 + i]
    for j in range(joints_out.shape[0]):
        joints_out[j] = gains[6] * (posture[j] - q[7 + j]) - gains[7] * v[6 + j]

    for k in range(held.shape[0]):
        touching = foot_force[k, 2] > force[2] or (stance[k] != 0.0 and foot_position[k, 2] <= 0.0)
        # A foot is held where it should be on the ground and is, or when it meets the ground early.
        held[k] = 1.0 if touching and (stance[k] != 0.0 or progress[k] > 0.5) else 0.0
        if held[k] != 0.0:
            for i in range(3):
                feet_out[3 * k + i] = -gains[8] * foot_velocity[k, i]
            # Share of the load: grows over the double support that begins a stance, shrinks over the one that ends it.
            load = 1.0
            if stance[k] == 0.0:
                load = 0.1
            elif double > 0.0:
                rise = progress[k] * (1.0 + double) / double
                fall = (1.0 - progress[k]) * (1.0 + double) / double
                load = max(min(rise, fall, 1.0), 0.05)
            force_range[2 * k] = load * force[0]
            force_range[2 * k + 1] = load * force[1]
        else:
            for i in range(3):
                feet_out[3 * k + i] = (
                    body[6 + i]
                    + foot_target_acceleration[3 * k + i]
                    + gains[4] * (body[i] + foot_target[3 * k + i] - foot_position[k, i])
                    + gains[5] * (body[3 + i] + foot_target_velocity[3 * k + i] - foot_velocity[k, i])
                )
