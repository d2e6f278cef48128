"""Whole-body controller: gait → task accelerations → quadratic program → joint torques and thrusts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.controllers.contacts import turn_feet_of
from harpy_pin.controllers.gait_controller import GaitController, fill_thrusts, make_command
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.tasks import Tasks, governed_gait
from harpy_pin.controllers.thrust_lag import (
    ThrustLagRecord,
    add_kept,
    advance_thrusts,
    bound_thrusts,
    command_thrusts,
    count_from_kept,
    keep_thrusts,
    thrust_lag_record,
)
from harpy_pin.controllers.tick_solver import TickSolver
from harpy_pin.controllers.whole_body_tick import AT_A_LIMIT, TICKS
from harpy_pin.gaits.foothold_governor import GovernedGait, note_gap
from harpy_pin.gaits.gait import LONGEST, Gait
from harpy_pin.model.entry import BAD, GOOD, as_state
from harpy_pin.model.record import Records
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.wbc import (
    AddedTask,
    AddedTasks,
    QPSolution,
    QPSolver,
    QPStatus,
    QuadraticProgram,
    Task,
    WholeBodyProblem,
    make_problem,
    make_solver,
)
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, WarmStartedActiveSet
from harpy_pin.wbc.problem import desired_acceleration

if TYPE_CHECKING:
    from harpy_pin.wbc.weights import TargetsRecord

__all__ = ["WholeBodyController"]


class WholeBodyController(GaitController):
    """Walks by solving a quadratic program at every tick.

    ``step`` does what :meth:`prepare`, :meth:`build`, :meth:`solve` and :meth:`finish` do one after the other. They may
    be called (and timed) apart; between them :attr:`problem` can be inspected. With ``input_space`` or
    ``contact_force``, ``reuse``, and no task added, ``step`` is one compiled call wherever the last tick's active set,
    or its exchange, ends with the optimum (:mod:`harpy_pin.controllers.whole_body_tick`).

    Every solve is bounded in its iterations. Where the parameters' solver does not finish, the dual active-set method
    follows (:mod:`harpy_pin.wbc.dual`), which finds a solution or proves that there is none; with ``reuse`` it comes
    before that solver. Where that fails too, the last good command is held for ``hold_ticks`` ticks; then a soft spring
    and damper hold the joints at the gait's posture, without thrust. :attr:`failures` counts the ticks.

    A state whose time, q, v or foot forces are not all finite numbers is a bad sample, which
    :class:`~harpy_pin.controllers.gait_controller.GaitController` answers: nothing is solved.

    Args:
        gait: where body and feet should be; the controller takes its own copy of a library's gait, with targets of its
            own, so that one gait may serve several controllers.
        parameters: gains, weights and limits.
        solver: makes a solver of your own for the program, instead of the one that the parameters name.

    Attributes:
        problem: the whole-body problem of the last tick; its ``program`` is what is solved, unless ranges were added.
        added: tasks and ranges that :meth:`add` has put in, with the ``program`` that is solved; None without any.
        solution: its solution.
        failures: ticks whose solution was not usable, since the last reset.
    """

    @checked
    def __init__(
        self,
        gait: Gait,
        parameters: WholeBodyParameters | None = None,
        *,
        solver: Callable[[QuadraticProgram], QPSolver] | None = None,
    ) -> None:
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        super().__init__(governed_gait(gait, p), p.period)
        self._governor = self.gait if isinstance(self.gait, GovernedGait) else None
        self.tasks = Tasks(self.gait, p)
        self.dynamics, self.targets = self.tasks.dynamics, self.tasks.targets
        self.problem: WholeBodyProblem = make_problem(p.formulation, self.robot, p.weights, p.limits)
        self.failures = 0
        self.added: AddedTasks | None = None
        make = solver if solver is not None else partial(make_solver, p.solver, reuse=p.reuse)
        self._solving = TickSolver(self.problem, make)
        self._solver = self._solving.solver
        self.solution: QPSolution = self._solver.solution
        self._posture = self.gait.initial_state()[0][7:]
        self._reference = np.zeros(6)
        self._inputs = np.zeros(self.problem.n_thrust + self.problem.joints)
        self._wanted = self._inputs.copy()
        self._lag = thrust_lag_record(self.robot, p)
        self._command = make_command(self.dynamics, self._inputs, apart=self._lag is not None)
        self._rotors = bool(self.robot.rotors)
        self._held_for = 0
        self._verdict = BAD
        self._violation = self.problem.record["violation"]
        self._make_anew()
        self._prepare_tick()

    _made_anew = ("_tick",)

    def _make_anew(self) -> None:
        """The tick, which a copy binds to its own arrays."""
        self._tick = self._one_call()

    def _prepare_tick(self) -> None:
        """Begin to compile the tick, and load what it needs, or may need once."""
        solver = self._solver
        if self._tick is None or not isinstance(solver, WarmStartedActiveSet):
            self.tasks.prepare(self.target)
            self.problem.prepare(self.dynamics, self.targets)
            if self._governor is not None:
                v = self.tasks.samples[1]
                _gap.prepare(v, self.dynamics.rotation, self.targets.record, v, self._governor.gap)
            self.problem._rehearse(self.dynamics, self.targets)
            return
        tasks, z, inputs = self.tasks, solver.solution.z, self._inputs
        records = (self.problem.record, self.problem.terms, self.problem.program.record, solver.record)
        kernel = TICKS[self.parameters.formulation]
        kernel.prepare(tasks.record, self.target.record, *records, *tasks.samples, z, inputs)
        self.problem._rehearse(self.dynamics, self.targets)
        # The first call of a kernel loads it: here, not in a tick. Forces of a foot too many make the tick do nothing;
        # the search, which few ticks need, gets any program.
        kernel(tasks.record, self.target.record, *records, *tasks.misfit, z, inputs)
        np.fill_diagonal(self.problem.program.hessian, 1.0)
        solver.search(self.problem.program)
        solver.reset()

    def _one_call(self) -> Callable[[State], int] | None:
        """The tick as one compiled call, where there is one."""
        kernel, solver = TICKS.get(self.parameters.formulation), self._solver
        if kernel is None or type(solver) is not WarmStartedActiveSet or self._governor is not None:
            return None
        if self.added is not None or self._lag is not None:
            return None  # rows come from Python, or a tick is two solves
        tasks, z, inputs = self.tasks, solver.solution.z, self._inputs
        records = (self.problem.record, self.problem.terms, self.problem.program.record, solver.record)

        def tick(state: State) -> int:
            target, arrays = self.target._record_, (state.q, state.v, state.foot_force)
            told: int = kernel(tasks._record_, target, *records, *arrays, z, inputs)
            return told

        return tick

    def add(
        self,
        task: Task,
        *,
        weight: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> AddedTask:
        """Add a task of your own to the program, with a weight, a range, or both.

        The error of a task is A x − b, in accelerations and contact forces x = [a; f]. Those of this library are in
        :mod:`harpy_pin.wbc.tasks`. A range is hard: where it leaves no solution, the tick is a failure, see above. It
        makes the program larger, so that the solvers start anew and are compiled for the new size.

        Args:
            task: any object with a method ``rows(dynamics, state) -> (A, b)``, see :class:`~harpy_pin.wbc.Task`.
            weight: of the squares of the error, (m,) or one for all m rows. Those of the program's own tasks are in
                :class:`~harpy_pin.wbc.weights.WholeBodyWeights`.
            lower: least error, (m,) or one for all rows; without it there is none.
            upper: largest error, (m,) or one for all rows; without it there is none.

        Returns:
            The task in the program: its ``matrix`` A, ``target`` b and ``error`` after each tick.

        Raises:
            InputError: neither weight nor range, or one out of its domain; rows that do not fit; a frame, joint or foot
                that the robot does not have; a task that the formulation has no place for.
        """
        added = AddedTasks(self.problem) if self.added is None else self.added
        q, v = self.gait.initial_state()
        feet = np.zeros((len(self.robot.feet), 3))
        result = added.add(task, State(0.0, q, v, feet, feet, feet), weight=weight, lower=lower, upper=upper)
        self.added = added
        self._tick = None
        self._solving.add(added)
        if self._solver is not self._solving.solver:
            self._solver = self._solving.solver
            self.solution = self._solver.solution
        return result

    def reset(self) -> None:
        """Forget the warm start, the last command, and the changes of the gait."""
        super().reset()
        self._solving.reset()
        self.tasks.reset()
        self._inputs[:] = 0.0
        self._held_for = 0
        self.failures = 0
        if self._lag is not None:
            self._lag["settled"] = 0
        if self._governor is not None:
            self._governor.reset()

    def _phases(self, state: State) -> Command:
        if self._tick is not None and isinstance(self._solver, WarmStartedActiveSet):
            command = self._at_once(self._tick, self._solver, state)
        else:
            self.prepare(state)
            gave_way = self._lag is None or self._choose_thrusts(self._lag, state)
            self.build(state)
            self._solve(gives_way=gave_way)
            command = self.finish(state)
            if self._lag is not None and self._verdict == GOOD:
                count_from_kept(self._lag, self.dynamics.record, -1.0)
        if self.parameters.estimate_joint_friction:
            self.tasks.record["joint_friction"]["inputs"] = self._inputs
        return command

    def _choose_thrusts(self, lag: Records[ThrustLagRecord], state: State) -> bool:
        """Command the thrusts of the program without lag, and fix those of this tick in the program.

        Returns:
            Whether torques are beyond their limits in its solution without limits, which both programs share.
        """
        bounds = self.problem.thrust_bounds
        advance_thrusts(lag)
        if self._verdict == GOOD:
            keep_thrusts(lag, self.dynamics.rotation)
            count_from_kept(lag, self.dynamics.record, 1.0)
        self._solving.swap_active()
        for bound in bounds:
            bound_thrusts(lag, False, *bound)
        self.build(state)
        if self._verdict == GOOD and self.solve().usable:
            self.problem.inputs(self.solution.z, self._wanted)
            command_thrusts(lag, self.dynamics.record, self._wanted, self._command.thrust)
        for bound in bounds:
            bound_thrusts(lag, True, *bound)
        self._solving.swap_active()
        return self._solving.beyond

    def _at_once(self, tick: Callable[[State], int], solver: WarmStartedActiveSet, state: State) -> Command:
        """All phases in one call; where the search does not end, the last two apart."""
        told = -BAD
        if -LONGEST < state.t < LONGEST:
            self._plan(state)
            told = tick(state)
        if told < 0:
            self._verdict = -told
            self._answer_bad(-told, state)
            return self._command
        self._verdict, self._bad_in_a_row = GOOD, 0
        self.solution = solution = solver.solution
        solution.iterations, solution.violation = told, self._violation.item()
        if told > EXCHANGES:
            solver.start_tick()
            if told == AT_A_LIMIT:
                solution.iterations, solution.status = 1, QPStatus.SOLVED
            else:
                solution = solver.search(self.problem.program)
            self.solution = self._solving.give_way(solution, self.dynamics, self.targets)
            return self.finish(state)
        solution.status = QPStatus.SOLVED
        self._held_for = 0
        if self._rotors:
            fill_thrusts(self.dynamics, self._inputs, self._command)
        return self._command

    def prepare(self, state: State) -> None:
        """Targets of the gait; the robot's dynamics, tasks and contact states.

        Args:
            state: measured, see :class:`~harpy_pin.model.state.State`.
        """
        self._verdict = BAD
        try:
            if -LONGEST < state.t < LONGEST:
                self._plan(state)
                self._verdict = self.tasks.update(self.target, state)
        except (AttributeError, TypeError):
            as_state(state, self.robot)
            raise
        if self._verdict == GOOD:
            self._bad_in_a_row = 0
        else:
            self._answer_bad(self._verdict, state)

    def build(self, state: State) -> WholeBodyProblem:
        """The quadratic program.

        Args:
            state: as given to :meth:`prepare`.

        Returns:
            The problem, ready to be solved.
        """
        if self._verdict == GOOD:
            self.problem._fill(self.dynamics, state.v, self.dynamics.rotation, self.targets)
            if self.added is not None:
                self._build_added(self.added, state)
        return self.problem

    def _build_added(self, added: AddedTasks, state: State) -> None:
        """Rows of the tasks added, which are in world axes."""
        targets = self.targets
        if not targets.tilted:
            added.build(self.dynamics, state, targets.held)
            return
        back = np.ascontiguousarray(targets.frame.transpose(0, 2, 1))
        turn_feet_of(self.dynamics.record, back)
        added.build(self.dynamics, state, targets.held, frame=targets.frame)
        turn_feet_of(self.dynamics.record, targets.frame)

    def solve(self) -> QPSolution:
        """Solve the problem from the last tick's solution."""
        return self._solve(gives_way=True)

    def _solve(self, *, gives_way: bool) -> QPSolution:
        """Solve it, and again where tasks give way, if they may."""
        if self._verdict == GOOD:
            solution = self._solving.solve()
            self.solution = self._solving.give_way(solution, self.dynamics, self.targets) if gives_way else solution
        return self.solution

    def finish(self, state: State) -> Command:
        """Torques and thrusts of the solution, or the fallback.

        Args:
            state: as given to :meth:`prepare`.
        """
        command = self._command
        if self._verdict != GOOD:
            return command
        if self.solution.usable:
            self._held_for = 0
            self.problem.inputs(self.solution.z, self._inputs)
            if self._lag is not None:
                add_kept(self._lag, self._inputs)
            if self._rotors and self._lag is None:
                fill_thrusts(self.dynamics, self._inputs, command)
            if self.added is not None:
                self.added.read(self.solution.z)
            if self._governor is not None:
                given = self.problem.acceleration(self.solution.z)
                _gap(state.v, self.dynamics.rotation, self.targets.record, given, self._governor.gap)
        else:
            self.failures += 1
            self._held_for += 1
            if self._held_for > self.parameters.hold_ticks:
                command.torque[:] = 50.0 * (self._posture - state.q[7:]) - 1.0 * state.v[6:]
                np.clip(command.torque, -self.robot.torque_limit, self.robot.torque_limit, out=command.torque)
                command.thrust[:] = 0.0
        return command

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, planned and held feet, forces of the program, and the solver's status."""
        self._reference[:] = self.target.body[:6]
        return {
            "x_r": self._reference,
            "stance": self.target.stance,
            "held": self.targets.held,
            "desired_force": self.targets.to_world(self.problem.contact_force(self.solution.z)),
            "qp_status": int(self.solution.status),
            "qp_iterations": self.solution.iterations,
            "qp_violation": self.solution.violation,
            "bad_samples": self.bad_samples,
            **self.tasks.telemetry(),
            **self._gait_signals(),
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}


@kernel
def _gap(v: Vector, rotation: Vector, t: TargetsRecord, given: Vector, out: Vector) -> None:
    desired = np.empty(6 + t.joints.shape[0])
    desired_acceleration(v, rotation, t, desired)
    note_gap(desired, given, rotation, out)
