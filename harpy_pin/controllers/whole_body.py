"""Whole-body controller: gait → task accelerations → quadratic program → joint torques and
thrusts.
"""

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
from harpy_pin.controllers.whole_body_tick import (
    QP_TICKS,
    WholeBodyTargetsRecord,
    WholeBodyTickRecord,
    begin_tick,
)
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait
from harpy_pin.ground.contact_frame import turn_feet
from harpy_pin.kernels.calls import Chain
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

    Every tick is solved by the solver that the parameters name: ProxQP by default. With
    ``active_set``, this library's own search, a tick is one compiled call
    (:mod:`harpy_pin.controllers.whole_body_tick`); it must be that for export to C, and where a
    tick needs a bound in time. With every other solver, with thrusts that lag and with added tasks,
    Python calls the same kernels around the solver: one crossing for gait, terms and program, then
    the solver, then what its solution is read by. ``step`` does what :meth:`prepare`,
    :meth:`build`, :meth:`solve` and :meth:`finish` do one after the other. They may be called (and
    timed) apart; between them :attr:`problem` can be inspected.

    Every solve is bounded in its iterations. Where a solver does not finish, the dual active-set
    method follows, which finds a solution or proves that there is none; :attr:`fallbacks` counts
    the ticks. Where that fails, too, the last good command is held for ``hold_ticks`` ticks; then a
    soft spring and damper hold the joints at the gait's posture, without thrust. :attr:`failures`
    counts the ticks.

    A state whose time, q, v or foot forces are not all finite numbers is a bad sample, which
    :class:`~harpy_pin.controllers.gait_controller.GaitController` answers: nothing is solved.

    Args:
        gait: where body and feet should be. Of one that never changes the controller takes a copy
            with targets of its own; every other gait serves one controller.
        parameters: gains, weights and limits; by default those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`).
        solver: makes a solver of your own for the program, instead of the one that the parameters
            name.

    Attributes:
        problem: the whole-body problem of the last tick; its ``program`` is what is solved, unless
            ranges were added.
        added: tasks and ranges that :meth:`add` has put in, with the ``program`` that is solved;
            None without any.
    """

    _made_anew = (*TaskController._made_anew, "_kernels_of_tick", "_parts_of_program", "_opening")
    _fell_back = False  # whether the dual method followed the solver in this tick

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
        self.problem: WholeBodyProblem = make_problem(
            p.formulation, self.robot, p.weights, p.limits
        )
        self._lag = thrust_lag_record(self.robot, p)
        self.added: AddedTasks | None = None
        self._make_solver = solver if solver is not None else partial(make_solver, p.solver)
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
        if self._command.law is not None:
            self._intended = field(record["motors"], "acceleration")
        self._inputs, self._outcome = field(record, "inputs"), field(record, "outcome")
        self._iterations = field(record, "iterations")
        self._violation, self._failures = field(record, "violation"), field(record, "failures")
        self._fallbacks = field(record, "fallbacks")
        self._solution = QPSolution(field(record, "z"))
        self._signals |= {
            "qp_status": self._outcome,
            "qp_iterations": self._iterations,
            "qp_violation": self._violation,
            "qp_fallbacks": self._fallbacks,
            "desired_force": field(record, "force").reshape(-1, 3),
        }
        self._use(self.problem.program)

    def _use(self, program: QuadraticProgram) -> None:
        """Solve programs of this size, and begin to compile what a tick needs."""
        self._program = program
        checks.function("solver", self._make_solver, 1)
        self._solver = made = self._make_solver(program)
        if not (hasattr(made, "solve") and hasattr(made, "solution")):
            raise InputError(
                f"solver must return a QPSolver, got {shown(made)}", name="solver", value=made
            )
        self._other_active = np.zeros(len(program.lower), np.int64)
        self._second = None if isinstance(made, WarmStartedActiveSet) else DualActiveSet(program)
        self._make_anew()
        example, kernels, parts = (
            State(0.0, *self._sample),
            self._kernels_of_tick,
            self._parts_of_program,
        )
        first = (self._record_, self.target._record_, *self._measured(example))
        if self._lag is None:
            self._step.prepare(*first, *self._parts)
        else:
            begin_tick.prepare(*first)
            self.problem.prepare(self.dynamics, self.targets)
        if not self._in_python:
            return
        for solver in (made, self._second):
            if isinstance(solver, QPSolver):
                solver.prepare(program)
        for one in (kernels.relax, kernels.give_way):
            one.prepare(self._record_, *parts, False)
        kernels.settle.prepare(self._record_, *parts[1:], False)
        kernels.finish.prepare(self._record_, *parts, False, example.q, example.v)
        if self._command.law is not None:
            kernels.targets.prepare(self._record_, parts[1], False, example.q, example.v)
            keep_targets.prepare(self._record_, self._record_["motors"])

    def _make_anew(self) -> None:
        """See :meth:`GaitController._make_anew`: one kernel where nothing of the program is
        Python's.
        """
        super()._make_anew()
        self._opening: Chain | None = None  # gait, terms and program in one crossing from Python
        self._kernels_of_tick = ticks = QP_TICKS[self.parameters.formulation]
        solver, problem = getattr(self, "_solver", None), self.problem
        self._parts = self._parts_of_program = (
            problem._record_,
            problem._terms_,
            problem.program._record_,
        )
        # Rows of added tasks come from Python, and with a lag of thrusts a tick is two solves.
        self._in_python = (
            type(solver) is not WarmStartedActiveSet
            or self.added is not None
            or self._lag is not None
        )
        self._step = ticks.open
        if type(solver) is WarmStartedActiveSet and not self._in_python:
            self._step = ticks.step if self._command.law is None else ticks.step_with_targets
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

    @property
    def fallbacks(self) -> int:
        """Ticks in which the solver did not finish and the dual method followed, since the last
        reset.
        """
        return int(self._fallbacks)

    def add(
        self,
        task: Task,
        *,
        weight: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> AddedTask:
        """Add a task of your own to the program, with a weight, a range, or both.

        The error of a task is A x − b, in accelerations and contact forces x = [a; f]. Those of
        this library are in :mod:`harpy_pin.wbc.tasks`. A range is hard: where it leaves no
        solution, the tick is a failure, see above. It makes the program larger, so that the solvers
        start anew and are compiled for the new size.

        Args:
            task: any object with a method ``rows(dynamics, state) -> (A, b)``, see
                :class:`~harpy_pin.wbc.Task`.
            weight: of the squares of the error, (m,) or one for all m rows. Those of the program's
                own tasks are in :class:`~harpy_pin.wbc.weights.WholeBodyWeights`.
            lower: least error, (m,) or one for all rows; without it there is none.
            upper: largest error, (m,) or one for all rows; without it there is none.

        Returns:
            The task in the program: its ``matrix`` A, ``target`` b and ``error`` after each tick.

        Raises:
            InputError: neither weight nor range, or one out of its domain; rows that do not fit; a
                frame, joint or foot that the robot does not have.
        """
        added = AddedTasks(self.problem) if self.added is None else self.added
        q, v = self.gait.initial_state()
        feet = np.zeros((len(self.robot.feet), 3))
        result = added.add(
            task, State(0.0, q, v, feet, feet, feet), weight=weight, lower=lower, upper=upper
        )
        self.added = added
        if added.program is not self._program or not self._in_python:
            self._use(added.program)
        return result

    def reset(self) -> None:
        """Forget the warm start, the last command, and the estimates."""
        super().reset()
        self._solver.reset()
        self._other_active[:] = 0
        self._record_["inputs"] = self._record_["failures"] = self._record_["fallbacks"] = 0
        self._record_["held_for"] = self.parameters.hold_ticks  # there is no command to hold
        if self._lag is not None:
            self._lag["settled"] = 0

    def _join(self) -> None:
        super()._join()
        if self._in_python and self._lag is None:
            self._opening = self._joined()

    def _tick(self, state: State) -> Command:
        """See :meth:`GaitController._tick`."""
        opened = None if self._opening is None else self._opening(state)
        if opened is None:
            return super()._tick(state)
        if self._go_on(opened, state) == BAD_SAMPLE:
            self._refuse_misfit(state)
        return self._command

    def _answer_in_python(self, target: Records[Any], state: State) -> int:
        """The phases one after the other, where something of the program is Python's, or thrusts
        lag.
        """
        if self._lag is not None:
            return self._answer_with_lag(self._lag, target, state)
        return self._go_on(
            self._step(self._record_, target, *self._measured(state), *self._parts), state
        )

    def _go_on(self, opened: int, state: State) -> int:
        """The rest of a tick, from the status on with which its kernel has built the program."""
        if opened == BAD_SAMPLE:
            return self._keep_targets()
        if self.added is not None:
            self._add_rows(state)
        self._finish(state, self._solve(gives_way=True))
        return 0

    def _answer_with_lag(
        self, lag: Records[ThrustLagRecord], target: Records[Any], state: State
    ) -> int:
        """A tick of thrusts that lag: the program that chooses their commands, then that of this
        tick's thrusts.
        """
        advance_thrusts(lag)
        if begin_tick(self._record_, target, *self._measured(state)) != GOOD:
            return self._keep_targets()
        gives_way = self._choose_thrusts(lag, state)
        self.build(state)
        self._finish(state, self._solve(gives_way=gives_way))
        count_from_kept(lag, self.dynamics._record_, -1.0)
        return 0

    def _keep_targets(self) -> int:
        """The answer to a bad sample."""
        if self._command.law is not None:
            keep_targets(self._record_, self._record_["motors"])
        return BAD_SAMPLE

    def _choose_thrusts(self, lag: Records[ThrustLagRecord], state: State) -> bool:
        """Command the thrusts of the program without lag, and fix those of this tick in the
        program.

        Returns:
            Whether torques are beyond their limits in its solution without limits, which both
            programs share.
        """
        lower, upper, last = *self.problem.thrust_bounds, self._inputs.copy()
        keep_thrusts(lag, self.dynamics.rotation)
        count_from_kept(lag, self.dynamics._record_, 1.0)
        self._swap_active()
        bound_thrusts(lag, False, lower, upper)
        self.build(state)
        if self._solve(gives_way=True):
            command_thrusts(lag, self.dynamics._record_, self._inputs, self._command._thrust_)
        self._inputs[:] = last
        bound_thrusts(lag, True, lower, upper)
        self._swap_active()
        return self._gave_way

    def _swap_active(self) -> None:
        """Take up the other one of the two programs of a tick in which thrusts lag, and its active
        set.
        """
        if isinstance(self._solver, WarmStartedActiveSet):
            self._solver._swap_active(self._other_active)

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
            raise InputError(
                "the state is a bad sample, which step() answers without a program", name="state"
            )

    def build(self, state: State) -> WholeBodyProblem:
        """The quadratic program, ready to be solved.

        Args:
            state: as given to :meth:`prepare`.
        """
        state = as_state(state, self.robot)
        self.problem._fill(self.dynamics, state.v, self.dynamics._rotation_, self.targets)
        if self.added is not None:
            self._add_rows(state)
        return self.problem

    def _add_rows(self, state: State) -> None:
        """The rows of added tasks, which are in world axes, in the program."""
        added, targets = self.added, self.targets
        assert added is not None
        if not targets.tilted:
            added.build(self.dynamics, state, targets._held_)
            return
        turn_feet(self.dynamics._record_, np.ascontiguousarray(targets.frame.transpose(0, 2, 1)))
        added.build(self.dynamics, state, targets.held, frame=targets.frame)
        turn_feet(self.dynamics._record_, targets.frame)

    def solve(self) -> QPSolution:
        """Solve the problem from the last tick's solution."""
        self._solve(gives_way=True)
        return self.solution

    def _solve(self, *, gives_way: bool) -> bool:
        """The solutions of a tick as its kernel has them, by a solver that may be Python's; whether
        there is one.
        """
        kernels, record, parts = self._kernels_of_tick, self._record_, self._parts_of_program
        usable = self._solve_once(further=False)
        self._gave_way = False
        if gives_way and kernels.relax(record, *parts, usable):
            self._copy_added()
            self._gave_way = kernels.give_way(record, *parts, self._solve_once(further=True))
            self._copy_added()
            usable = kernels.settle(
                record, *parts[1:], self._gave_way and self._solve_once(further=True)
            )
        elif usable and not gives_way:
            self.problem.kernels.inputs(*parts[1:], self._solution._z_, self._inputs)
        return usable

    def _solve_once(self, *, further: bool) -> bool:
        """Solve the program as it is, where its solver does not finish by the dual method; whether
        that was possible.

        It is a ``further`` one where it is not the first of the tick.
        """
        solver, program = self._solver, self._program
        if further and isinstance(solver, WarmStartedActiveSet):
            solution = solver.solve_further(program)
        else:
            solution = solver.solve(program)
        if solution.status is not QPStatus.SOLVED and self._second is not None:
            self._fell_back = True
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
        self._finish(as_state(state, self.robot), self.solution.usable)
        return self._command

    def _finish(self, state: State, usable: bool) -> None:
        """As :meth:`finish`, of a state that was checked."""
        if self._fell_back:
            self._fallbacks += 1
            self._fell_back = False
        if usable:
            if self._lag is not None:
                add_kept(self._lag, self._inputs)
            if self.added is not None:
                self.added.read(self._solution._z_)
        kernels, parts = self._kernels_of_tick, self._parts_of_program
        kernels.finish(self._record_, *parts, usable, state.q, state.v)
        if self._command.law is not None:
            kernels.targets(self._record_, parts[1], usable, state.q, state.v)
