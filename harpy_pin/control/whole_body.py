"""Whole-body controller: gait → task accelerations → quadratic program → joint torques and thrusts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.control.bridge import Bridge
from harpy_pin.errors import InputError
from harpy_pin.gait.base import Gait, GaitTarget, own_target
from harpy_pin.governor.command import CommandGovernorParameters, GovernedGait
from harpy_pin.model import record
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import BAD, GOOD, MISFIT, all_finite, all_finite_rows, as_state
from harpy_pin.model.kinematics import body_rotation
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.wbc import (
    FORMULATIONS,
    SOLVERS,
    QPSolution,
    QPSolver,
    QPStatus,
    QuadraticProgram,
    WholeBodyLimits,
    WholeBodyProblem,
    WholeBodyTargets,
    WholeBodyWeights,
    make_problem,
    make_solver,
)
from harpy_pin.wbc.dual import DualActiveSet
from harpy_pin.wbc.problem import wanted_acceleration
from harpy_pin.wbc.reuse import ReusedActiveSet

__all__ = ["WholeBodyController", "WholeBodyParameters"]

MOST_GAIN = 1e6
"""Largest gain, 1/s² and 1/s: a millisecond's tick cannot follow even a tenth of it."""
MOST_FORCE = 1e6
"""Largest limit of a normal force, N."""
MOST_HELD = 1000
"""Most ticks that the last good command is held."""


@dataclass(frozen=True, kw_only=True)
class WholeBodyParameters:
    """Settings of :class:`WholeBodyController`; gains and forces are at most 1e6.

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
        hold_ticks: how many ticks in a row a failed solve is bridged by the last good command, at most 1000.
        formulation: one of :data:`harpy_pin.wbc.FORMULATIONS`; all have the same solutions, ``command`` is the fastest.
        solver: one of :data:`harpy_pin.wbc.SOLVERS`.
        reuse: try the last tick's active set first, and ask the solver only where it is not optimal any more.
        govern_command: bend the gait while its demand lies outside what the limits allow
            (:mod:`harpy_pin.governor.command`).
        command: settings of that governor.
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
    govern_command: bool = False
    command: CommandGovernorParameters = field(default_factory=CommandGovernorParameters)
    weights: WholeBodyWeights = field(default_factory=WholeBodyWeights)
    limits: WholeBodyLimits = field(default_factory=WholeBodyLimits)

    def __post_init__(self) -> None:
        checks.number("period", self.period, low=0.0, strict=True)
        for name in ("body", "orientation", "swing", "posture"):
            for gain in checks.gains(f"gains of {name}", getattr(self, name), 2):
                checks.number(f"gains of {name}", gain, high=MOST_GAIN)
        checks.number("contact_damping", self.contact_damping, low=0.0, high=MOST_GAIN)
        checks.number("hold_ticks", self.hold_ticks, low=0.0, high=MOST_HELD)
        for name in ("min_normal_force", "contact_threshold"):
            checks.number(name, getattr(self, name), low=0.0, high=MOST_FORCE)
        low = self.min_normal_force
        checks.number("max_normal_force", self.max_normal_force, low=low, high=MOST_FORCE, strict=True)
        for kind, name, valid in (("formulation", self.formulation, FORMULATIONS), ("solver", self.solver, SOLVERS)):
            if name not in valid:
                raise InputError.unknown(kind, name, valid)


class WholeBodyController:
    """Walks by solving a quadratic program at every tick.

    ``step`` is a chain of :meth:`prepare`, :meth:`build`, :meth:`solve` and :meth:`finish`, which may be called (and
    timed) apart; between them :attr:`problem` can be inspected.

    Every solve is bounded in its iterations. Where the parameters' solver does not finish, the dual active-set
    method is asked (:mod:`harpy_pin.wbc.dual`), which finds one or proves that there is none; with ``reuse`` it is
    asked before that solver already. Where that fails too, the last good command is held for ``hold_ticks`` ticks; then
    the joints are held by a soft spring and damper at the gait's posture, without thrust. :attr:`failures` counts the
    ticks.

    A state whose time, q, v or foot forces are not all finite numbers is a bad sample: nothing is solved, and
    :class:`~harpy_pin.control.bridge.Bridge` says what is commanded.

    Args:
        gait: where body and feet should be; the controller takes its own copy of a library's gait, with targets of its
            own, so that one gait may serve several controllers.
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
        self.robot = gait.robot
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        self.gait, self._governor = governed_gait(gait, p)
        self.period = p.period
        self.dynamics = Dynamics(self.robot)
        self.problem: WholeBodyProblem = make_problem(p.formulation, self.robot, p.weights, p.limits)
        self.targets = WholeBodyTargets(self.robot)
        self.target: GaitTarget = self.gait.target
        self.failures = 0
        program = self.problem.program
        self._solver = make_solver(p.solver, program, reuse=p.reuse) if solver is None else solver(program)
        self._second = None if isinstance(self._solver, ReusedActiveSet) else DualActiveSet(program)
        self.solution: QPSolution = self._solver.solution
        self._posture = gait.initial_state()[0][7:]
        self._record = task_record(gait, p)
        self._rotation: Vector = record.field(self._record, "rotation")
        self._reference = np.zeros(6)
        thrusts = self.problem.n_thrust
        self._inputs = np.zeros(thrusts + self.problem.joints)
        self._command = Command(self._inputs[thrusts:], self._inputs[:thrusts].reshape(-1, 3))
        self._held_for = 0
        self._bridge = Bridge()
        self._blind = False
        self._convert = False  # whether states come in a form that kernels do not take

    @property
    def bad_samples(self) -> int:
        """States that were not all numbers, since the last reset."""
        return self._bridge.bad_samples

    def reset(self) -> None:
        """Forget the warm start, the last command, and what was bent."""
        self._bridge.reset()
        self._solver.reset()
        self._inputs[:] = 0.0
        self._held_for = 0
        self.failures = 0
        if self._governor is not None:
            self._governor.reset()

    def step(self, state: State) -> Command:
        """One tick: joint torques and thrusts.

        Raises:
            InputError: an array of the state has the wrong shape, or no numbers.
        """
        if self._convert:
            state = as_state(state, self.robot)
        try:
            self.prepare(state)
            self.build(state)
            self.solve()
            return self.finish(state)
        except Exception:
            fit = as_state(state, self.robot)
            if fit is state:
                raise
            self._convert = True
        return self.step(fit)

    def prepare(self, state: State) -> None:
        """Targets of the gait, and the robot's dynamics at the state."""
        if isfinite(state.t):
            self.target = self.gait.update(state.t)
        self.dynamics.update(state.q, state.v)

    def build(self, state: State) -> WholeBodyProblem:
        """Task accelerations and contact states, then the quadratic program.

        Returns:
            The problem, ready to be solved.
        """
        verdict = BAD
        if self.dynamics.finite and isfinite(state.t):
            verdict = self._set_targets(state)
        self._blind = verdict != GOOD
        if verdict == GOOD:
            self._bridge.in_a_row = 0
            self.problem.build(self.dynamics, state.v, self._rotation, self.targets)
        else:
            self._bridge.hold(self._command)
        return self.problem

    def _set_targets(self, state: State) -> int:
        """Task accelerations and contact states; returns whether the state is good."""
        verdict: int = task_targets(
            self.dynamics.record,
            self.target.record,
            self._record,
            self.targets.record,
            state.q,
            state.v,
            state.foot_force,
        )
        if verdict == MISFIT:
            as_state(state, self.robot)
            raise InputError("the gait's targets are no numbers", name="gait", value=self.gait)
        return verdict

    def solve(self) -> QPSolution:
        """Solve the problem from the last tick's solution."""
        if self._blind:
            return self.solution
        self.solution = self._solver.solve(self.problem.program)
        if self.solution.status is not QPStatus.SOLVED and self._second is not None:
            second = self._second.solve(self.problem.program)
            self.solution = second if second.usable else self.solution
        return self.solution

    def finish(self, state: State) -> Command:
        """Torques and thrusts of the solution, or the fallback."""
        command = self._command
        if self._blind:
            return command
        if self.solution.usable:
            self._held_for = 0
            self.problem.inputs(self.solution.z, self._inputs)
            if self._governor is not None:
                given = self.problem.acceleration(self.solution.z)
                _gap(state.v, self._rotation, self.targets.record, given, self._governor.gap)
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
            "bad_samples": self.bad_samples,
            **({} if self._governor is None else self._governor.telemetry()),
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}


def governed_gait(gait: Gait, parameters: WholeBodyParameters) -> tuple[Gait, GovernedGait | None]:
    """The gait to follow, with targets of the controller's own, and the governor of its command, if there is one."""
    chosen = own_target(gait)
    if parameters.govern_command and not isinstance(gait, GovernedGait):
        chosen = GovernedGait(gait, parameters.command)
    return chosen, chosen if isinstance(chosen, GovernedGait) else None


def task_record(gait: Gait, parameters: WholeBodyParameters) -> record.Record:
    """What :func:`task_targets` knows: gains, ranges of forces, the posture at rest; and the body's rotation, out."""
    p = parameters
    return record.make_record(
        body=p.body,
        orientation=p.orientation,
        swing=p.swing,
        posture=p.posture,
        contact_damping=p.contact_damping,
        min_normal_force=p.min_normal_force,
        max_normal_force=p.max_normal_force,
        contact_threshold=p.contact_threshold,
        double_support=gait.double_support,
        rest=gait.initial_state()[0][7:],
        rotation=np.zeros((3, 3)),
    )


@njit(cache=True)
def gap_of(wanted, given, rotation, out):  # type: ignore[no-untyped-def]
    """What the body's linear acceleration lacks, world axes, for :attr:`GovernedGait.gap`.

    Args:
        wanted: (nv,) demanded generalised acceleration; its first three entries in body axes.
        given: (nv,) the one that follows.
        rotation: (3, 3) body to world.
        out: (4,) out; the last entry says that it is new.
    """
    for i in range(3):
        s = 0.0
        for j in range(3):
            s += rotation[i, j] * (wanted[j] - given[j])
        out[i] = s
    out[3] = 1.0


@njit(cache=True)
def _gap(v, rotation, targets, given, out):  # type: ignore[no-untyped-def]
    wanted = np.empty(v.shape[0])
    wanted_acceleration(v, rotation, targets[0], wanted)
    gap_of(wanted, given, rotation, out)


@njit(cache=True)
def task_targets(dynamics, gait, control, targets, q, v, foot_force):  # type: ignore[no-untyped-def]
    """Task accelerations, which feet are held, and the range of their normal forces; returns what the state is."""
    d, g, p, t = dynamics[0], gait[0], control[0], targets[0]
    if q.shape[0] != p.rest.shape[0] + 7 or v.shape != d.bias.shape or foot_force.shape != t.feet.shape:
        return MISFIT
    if not all_finite_rows(foot_force):
        return BAD
    if not all_finite(g.body):
        return MISFIT
    body_rotation(q, p.rotation)
    _body_targets(g, p, t, q, v)
    for j in range(t.joints.shape[0]):
        t.joints[j] = p.posture[0] * (p.rest[j] - q[7 + j]) - p.posture[1] * v[6 + j]
    for k in range(t.held.shape[0]):
        touching = foot_force[k, 2] > p.contact_threshold or (g.stance[k] != 0.0 and d.foot_position[k, 2] <= 0.0)
        # A foot is held where it should be on the ground and is, or when it meets the ground early.
        t.held[k] = 1.0 if touching and (g.stance[k] != 0.0 or g.progress[k] > 0.5) else 0.0
        if t.held[k] != 0.0:
            for i in range(3):
                t.feet[k, i] = -p.contact_damping * d.foot_velocity[k, i]
            load = _share_of_load(g, k, p.double_support)
            t.force_range[k, 0] = load * p.min_normal_force
            t.force_range[k, 1] = load * p.max_normal_force
        else:
            for i in range(3):
                t.feet[k, i] = (
                    g.body[6 + i]
                    + g.foot_acceleration[k, i]
                    + p.swing[0] * (g.body[i] + g.foot_position[k, i] - d.foot_position[k, i])
                    + p.swing[1] * (g.body[3 + i] + g.foot_velocity[k, i] - d.foot_velocity[k, i])
                )
    return GOOD


@njit(cache=True)
def _body_targets(g, p, t, q, v):  # type: ignore[no-untyped-def]
    """Accelerations of the body's position and orientation."""
    # Rotation vector of the body, from the quaternion: the target body is upright.
    x, y, z, w = q[3], q[4], q[5], q[6]
    sign = 1.0 if w >= 0.0 else -1.0
    norm = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 * sign
    if norm > 1e-9:
        scale = 2.0 * sign * np.arctan2(norm, abs(w)) / norm
    for i in range(3):
        velocity = p.rotation[i, 0] * v[0] + p.rotation[i, 1] * v[1] + p.rotation[i, 2] * v[2]
        t.body[i] = g.body[6 + i] + p.body[0] * (g.body[i] - q[i]) + p.body[1] * (g.body[3 + i] - velocity)
        t.orientation[i] = -p.orientation[0] * scale * q[3 + i] - p.orientation[1] * v[3 + i]


@njit(cache=True)
def _share_of_load(g, k, double_support):  # type: ignore[no-untyped-def]
    """Share of the load of a foot that is held: it grows over the double support that begins a stance, and shrinks
    over the one that ends it."""
    if g.stance[k] == 0.0:
        return 0.1
    if double_support <= 0.0:
        return 1.0
    rise = g.progress[k] * (1.0 + double_support) / double_support
    fall = (1.0 - g.progress[k]) * (1.0 + double_support) / double_support
    return max(min(rise, fall, 1.0), 0.05)
