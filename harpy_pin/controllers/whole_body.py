"""Whole-body controller: gait → task accelerations → quadratic program → joint torques and thrusts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.joint_targets import keep_targets
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.task_controller import TaskController
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
from harpy_pin.controllers.tick import BAD_SAMPLE
from harpy_pin.controllers.whole_body_tick import QP_TICKS, WholeBodyTargetsRecord, WholeBodyTickRecord, begin_tick
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait
from harpy_pin.ground.contact_frame import turn_feet
from harpy_pin.model.entry import GOOD, as_state
from harpy_pin.model.record import Records, field
from harpy_pin.model.state import Command, State
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
from harpy_pin.wbc.active_set_warm_start import DualActiveSet, WarmStartedActiveSet


class WholeBodyController(TaskController):
    """Walks by solving a quadratic program at every tick.

    ``step`` does what :meth:`prepare`, :meth:`build`, :meth:`solve` and :meth:`finish` do one after the other. They may
    be called (and timed) apart; between them :attr:`problem` can be inspected. With ``reuse``, no lag of thrusts and no
    task added, ``step`` is one compiled call of the same kernels (:mod:`harpy_pin.controllers.whole_body_tick`). What
    is left is Python's: another solver in every tick, and rows that come from Python.

    Every solve is bounded in its iterations. Where the parameters' solver does not finish, the dual active-set method
    follows, which finds a solution or proves that there is none; with ``reuse`` it comes before that solver, which one
    compiled call does without. Where that fails too, the last good command is held for ``hold_ticks`` ticks; then a
    soft spring and damper hold the joints at the gait's posture, without thrust.
    :attr:`failures` counts the ticks.

    A state whose time, q, v or foot forces are not all finite numbers is a bad sample, which
    :class:`~harpy_pin.controllers.gait_controller.GaitController` answers: nothing is solved.

    Args:
        gait: where body and feet should be; the controller takes its own copy of a library's gait, with targets of its
            own, so that one gait may serve several controllers.
        parameters: gains, weights and limits; by default those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`).
        solver: makes a solver of your own for the program, instead of the one that the parameters name.

    Attributes:
        problem: the whole-body problem of the last tick; its ``program`` is what is solved, unless ranges were added.
        added: tasks and ranges that :meth:`add` has put in, with the ``program`` that is solved; None without any.
    """

    _made_anew = (*TaskController._made_anew, "_kernels_of_tick", "_parts_of_program")

    @checked
    def __init__(
        self,
        gait: Gait,
        parameters: WholeBodyParameters | None = None,
        *,
        solver: Callable[[QuadraticProgram], QPSolver] | None = None,
    ) -> None:
        super().__init__(gait, parameters)
        p = self.parameters
        self.problem: WholeBodyProblem = make_problem(p.formulation, self.robot, p.weights, p.limits)
        self._lag = thrust_lag_record(self.robot, p)
        self.added: AddedTasks | None = None
        self._make_solver = solver if solver is not None else partial(make_solver, p.solver, reuse=p.reuse)
        size = self.problem.program.shape[0]
        self._begin_tasks(
            WholeBodyTickRecord,
            WholeBodyTargetsRecord,
            **{name: np.zeros(size) for name in ("z", "found", "kept")},
            posture=self.gait.initial_state()[0][7:],
            torque_limit=self.robot.torque_limit,
            hold_ticks=np.int64(p.hold_ticks),
            held_for=np.int64(p.hold_ticks),
            lagging=np.int64(self._lag is not None),
        )
        record = self._record_
        self._inputs, self._outcome = field(record, "inputs"), field(record, "outcome")
        self._iterations = field(record, "iterations")
        self._violation, self._failures = field(record, "violation"), field(record, "failures")
        self._solution = QPSolution(field(record, "z"))
        self._signals |= {
            "qp_status": self._outcome,
            "qp_iterations": self._iterations,
            "qp_violation": self._violation,
            "desired_force": field(record, "force").reshape(-1, 3),
        }
        self._use(self.problem.program)

    def _use(self, program: QuadraticProgram) -> None:
        """Solve programs of this size, and begin to compile what a tick needs."""
        self._program = program
        checks.function("solver", self._make_solver, 1)
        self._solver = made = self._make_solver(program)
        if not (hasattr(made, "solve") and hasattr(made, "solution")):
            raise InputError(f"solver must return a QPSolver, got {shown(made)}", name="solver", value=made)
        self._other_active = np.zeros(len(program.lower), np.int64)
        self._second = None if isinstance(made, WarmStartedActiveSet) else DualActiveSet(program)
        self._make_anew()
        example, kernels, parts = State(0.0, *self._sample), self._kernels_of_tick, self._parts_of_program
        first = (self._record_, self.target._record_, *self._measured(example))
        if not self._in_python:
            self._step.prepare(*first, *self._parts)
            return
        for solver in (made, self._second):
            if isinstance(solver, QPSolver):
                solver.prepare(program)
        begin_tick.prepare(*first)
        self.problem.prepare(self.dynamics, self.targets)
        for one in (kernels.relax, kernels.give_way):
            one.prepare(self._record_, *parts, False)
        kernels.settle.prepare(self._record_, *parts[1:], False)
        kernels.finish.prepare(self._record_, *parts, False, example.q, example.v)

    def _make_anew(self) -> None:
        """See :meth:`GaitController._make_anew`: one kernel where nothing of the program is Python's."""
        super()._make_anew()
        self._kernels_of_tick = QP_TICKS[self.parameters.formulation]
        solver, problem = getattr(self, "_solver", None), self.problem
        # Rows of added tasks come from Python, and with a lag of thrusts a tick is two solves.
        self._in_python = type(solver) is not WarmStartedActiveSet or self.added is not None or self._lag is not None
        ticks, with_targets = self._kernels_of_tick, self._command.law is not None
        self._step = ticks.step_with_targets if with_targets else ticks.step
        self._parts_of_program = (problem._record_, problem._terms_, problem.program._record_)
        if type(solver) is WarmStartedActiveSet:
            self._parts = (*self._parts_of_program, solver._record_, solver.dual._record_)

    @property
    def solution(self) -> QPSolution:
        """Solution of the last tick."""
        solution = self._solution
        solution.status, solution.iterations = QPStatus(int(self._outcome)), int(self._iterations)
        solution.violation = float(self._violation)
        return solution

    @property
    def failures(self) -> int:
        """Ticks whose solution was not usable, since the last reset."""
        return int(self._failures)

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
        if added.program is not self._program or not self._in_python:
            self._use(added.program)
        return result

    def reset(self) -> None:
        """Forget the warm start, the last command, and the estimates."""
        super().reset()
        self._solver.reset()
        self._other_active[:] = 0
        self._record_["inputs"] = self._record_["failures"] = 0
        self._record_["held_for"] = self.parameters.hold_ticks  # there is no command to hold
        if self._lag is not None:
            self._lag["settled"] = 0

    def _answer_in_python(self, target: Records[Any], state: State) -> int:
        """The phases one after the other, where something of the program is Python's, or thrusts lag."""
        lag, gives_way = self._lag, True
        if lag is not None:
            advance_thrusts(lag)
        if begin_tick(self._record_, target, *self._measured(state)) != GOOD:
            if self._command.law is not None:
                keep_targets(self._record_, self._record_["motors"])
            return BAD_SAMPLE
        if lag is not None:
            gives_way = self._choose_thrusts(lag, state)
        self.build(state)
        self._solve(gives_way=gives_way)
        self.finish(state)
        if lag is not None:
            count_from_kept(lag, self.dynamics._record_, -1.0)
        return 0

    def _choose_thrusts(self, lag: Records[ThrustLagRecord], state: State) -> bool:
        """Command the thrusts of the program without lag, and fix those of this tick in the program.

        Returns:
            Whether torques are beyond their limits in its solution without limits, which both programs share.
        """
        lower, upper, last = *self.problem.thrust_bounds, self._inputs.copy()
        keep_thrusts(lag, self.dynamics.rotation)
        count_from_kept(lag, self.dynamics._record_, 1.0)
        self._swap_active()
        bound_thrusts(lag, False, lower, upper)
        self.build(state)
        if self.solve().usable:
            command_thrusts(lag, self.dynamics._record_, self._inputs, self._command._thrust_)
        self._inputs[:] = last
        bound_thrusts(lag, True, lower, upper)
        self._swap_active()
        return self._gave_way

    def _swap_active(self) -> None:
        """Take up the other one of the two programs of a tick in which thrusts lag, and its active set."""
        if isinstance(self._solver, WarmStartedActiveSet):
            self._solver.swap_active(self._other_active)

    def prepare(self, state: State) -> None:
        """Targets of the gait; the robot's dynamics, tasks and contact states.

        Args:
            state: measured, see :class:`~harpy_pin.model.state.State`.

        Raises:
            InputError: it is no state of the robot, or a bad sample.
        """
        state = as_state(state, self.robot)
        if begin_tick(self._record_, self._plan(state)._record_, *self._measured(state)) != GOOD:
            self._refuse_misfit(state)
            raise InputError("the state is a bad sample, which step() answers without a program", name="state")

    def build(self, state: State) -> WholeBodyProblem:
        """The quadratic program, ready to be solved.

        Args:
            state: as given to :meth:`prepare`.
        """
        state, targets = as_state(state, self.robot), self.targets
        self.problem._fill(self.dynamics, state.v, self.dynamics._rotation_, targets)
        if self.added is not None and not targets.tilted:
            self.added.build(self.dynamics, state, targets._held_)
        elif self.added is not None:  # rows of added tasks are in world axes
            turn_feet(self.dynamics._record_, np.ascontiguousarray(targets.frame.transpose(0, 2, 1)))
            self.added.build(self.dynamics, state, targets.held, frame=targets.frame)
            turn_feet(self.dynamics._record_, targets.frame)
        return self.problem

    def solve(self) -> QPSolution:
        """Solve the problem from the last tick's solution."""
        return self._solve(gives_way=True)

    def _solve(self, *, gives_way: bool) -> QPSolution:
        """The solutions of a tick as its kernel has them, by a solver that may be Python's."""
        kernels, record, parts = self._kernels_of_tick, self._record_, self._parts_of_program
        usable = self._solve_once(further=False)
        self._gave_way = False
        if gives_way and kernels.relax(record, *parts, usable):
            self._copy_added()
            self._gave_way = kernels.give_way(record, *parts, self._solve_once(further=True))
            self._copy_added()
            kernels.settle(record, *parts[1:], self._gave_way and self._solve_once(further=True))
        elif usable:
            self.problem.kernels.inputs(*parts[1:], self._solution._z_, self._inputs)
        return self.solution

    def _solve_once(self, *, further: bool) -> bool:
        """Solve the program as it is, where its solver does not finish by the dual method; whether that was possible.

        It is a ``further`` one where it is not the first of the tick.
        """
        solver, program = self._solver, self._program
        if further and isinstance(solver, WarmStartedActiveSet):
            solution = solver.solve_further(program)
        else:
            solution = solver.solve(program)
        if solution.status is not QPStatus.SOLVED and self._second is not None:
            second = self._second.solve(program)
            solution = second if second.usable else solution
        self._solution._z_[:] = solution._z_
        self._outcome[...], self._iterations[...] = solution.status, solution.iterations
        self._violation[...] = solution.violation
        return solution.usable

    def _copy_added(self) -> None:
        """Bring a change of the problem's program into that with added tasks."""
        if self.added is not None:
            self.added.copy()

    def finish(self, state: State) -> Command:
        """Torques and thrusts of the solution, or the fallback.

        Args:
            state: as given to :meth:`prepare`.
        """
        state, solution = as_state(state, self.robot), self.solution
        if solution.usable:
            if self._lag is not None:
                add_kept(self._lag, self._inputs)
            if self.added is not None:
                self.added.read(solution._z_)
        kernels, parts, measured = self._kernels_of_tick, self._parts_of_program, (state.q, state.v)
        kernels.finish(self._record_, *parts, solution.usable, *measured)
        if self._command.law is not None:
            kernels.targets(self._record_, parts[1], solution.usable, *measured)
        return self._command
