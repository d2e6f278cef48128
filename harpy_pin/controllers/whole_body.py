"""Whole-body controller: gait → task accelerations → quadratic program → joint torques and
thrusts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.stage import Stage, Stages
from harpy_pin.controllers.task_controller import TaskController
from harpy_pin.controllers.tick import BAD_SAMPLE, take_sample, tick_of
from harpy_pin.controllers.whole_body_tick import (
    GAVE_WAY,
    PROGRAMS,
    WholeBodyTickRecord,
    open_program,
    program_tick,
    set_program_law,
    write_solved_thrust,
)
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait
from harpy_pin.ground.contact_frame import turn_feet
from harpy_pin.kernels import Kernel
from harpy_pin.model.entry import as_state
from harpy_pin.model.record import Records, field
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

    A bad sample is answered as
    :class:`~harpy_pin.controllers.gait_controller.GaitController` says: nothing is solved.

    Args:
        gait: where body and feet should be. Of one that never changes the controller takes a copy
            with targets of its own; every other gait serves one controller.
        parameters: gains, weights and limits; by default those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`).
        solver: makes a solver of your own for the program, instead of the one that the parameters
            name.
        stages: of your own, see :class:`Stage`.

    Attributes:
        problem: the whole-body problem of the last tick; its ``program`` is what is solved, unless
            ranges were added.
        added: tasks and ranges that :meth:`add` has put in, with the ``program`` that is solved;
            None without any.
    """

    _rebuilt = (
        *TaskController._rebuilt,
        *("_opening", "_kernels", "_close", "_program_parts", "_around"),
    )
    _program_parts: tuple[Records[Any], ...]  # records of the problem and its program
    _opening: Kernel[int]  # of a tick, up to its tasks
    _close: Kernel[int]  # of a tick, from the inputs on
    _around: Stages = ()  # kernels around the optimum
    _set_law = set_program_law
    _fell_back = False  # whether the dual method followed the solver in this tick

    @checked
    def __init__(
        self,
        gait: Gait,
        parameters: WholeBodyParameters | None = None,
        *,
        solver: Callable[[QuadraticProgram], QPSolver] | None = None,
        stages: Sequence[Stage] = (),
    ) -> None:
        super().__init__(gait, parameters, stages)
        p = self.parameters
        self.problem: WholeBodyProblem = make_problem(
            p.formulation, self.robot, p.weights, p.limits
        )
        self.added: AddedTasks | None = None
        self._make_solver = solver if solver is not None else partial(make_solver, p.solver)
        size = self.problem.program.shape[0]
        follows = p.joint_stiffness > 0.0 or p.joint_damping > 0.0
        self._begin_tasks(
            WholeBodyTickRecord,
            **{name: np.zeros(size) for name in ("z", "found", "kept")},
            acceleration=np.zeros(self.robot.nv if follows else 0),
            posture=self.gait.initial_state()[0][7:],
            torque_limit=self.robot.torque_limit,
            gives_way=np.int64(True),
            hold_ticks=np.int64(p.hold_ticks),
            held_for=np.int64(p.hold_ticks),
        )
        record = self._record_
        if follows:
            self._intended = field(record, "acceleration")
        self._solved, self._outcome = field(record, "solved"), field(record, "outcome")
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
        self._rebuild()
        record, sample = self._record_, self._measured(State(0.0, *self._sample))
        self._step.prepare(record, self.target._record_, *sample, *self._parts)
        if not self._in_python:
            return
        for solver in (made, self._second):
            if isinstance(solver, QPSolver):
                solver.prepare(program)
        parts = self._program_parts
        if self._around:
            self._kernels.build.prepare(record, *parts, sample[1])
        for part in self._around:
            part.prepare(record, *self._limits_and_inputs(), True)
        self._kernels.go_on.prepare(record, *parts)
        self._kernels.finish.prepare(record, *parts, *sample[:2])
        self._close.prepare(record, self.target._record_, *sample)

    def _rebuild(self) -> None:
        """See :meth:`GaitController._rebuild`: one kernel where nothing of the program is
        Python's.
        """
        super()._rebuild()
        solver: Any = getattr(self, "_solver", None)
        if solver is None:
            return
        formulation = self.parameters.formulation
        self._around = around = self._kernels_of("around_optimum")
        self._kernels, problem = PROGRAMS[formulation], self.problem
        self._program_parts = problem._record_, problem._terms_, problem.program._record_
        self._opening = tick_of((take_sample,), self._before(), ())
        after = self._kernels_of("after_optimum") + (() if around else (write_solved_thrust,))
        self._close = tick_of((), after, self._closing())
        # Rows of added tasks come from Python, and kernels around the optimum make it several.
        own = type(solver) is WarmStartedActiveSet and self.added is None and not around
        self._in_python = not own
        if own:
            self._step = program_tick(formulation, self._opening, self._close)
            self._parts = (*self._program_parts, solver._record_, solver.dual._record_)
        elif around:
            self._step, self._parts = self._opening, ()
        else:
            self._step = open_program(formulation, self._opening)
            self._parts = self._program_parts

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
        self._record_["failures"] = self._record_["fallbacks"] = 0
        self._record_["held_for"] = self.parameters.hold_ticks  # there is no command to hold

    def _go_on(self, status: int, state: State) -> int:
        """The program, in whose solution Python takes part, then the command."""
        if status != BAD_SAMPLE:
            if self._around:
                self._solve_several(state)
            else:
                self._add_rows(state)
                self._solve_all()
            self._finish(state)
        return self._close(self._record_, self.target._record_, *self._measured(state))

    def _solve_several(self, state: State) -> None:
        """The optimum as often as a stage asks for, with its kernels around it.

        All share the solution without limits, so that tasks give way in each or in none. Of two,
        each begins with an active set of its own.
        """
        *before, after = self._around
        record, solver, usable = self._record_, self._solver, False
        given = self._limits_and_inputs()
        for k, part in enumerate(before):
            part(record, *given, usable)
            record["gives_way"] = k == 0 or record["program"] == GAVE_WAY
            if isinstance(solver, WarmStartedActiveSet):
                solver._swap_active(self._other_active)
            self._build(state)
            self._solve_all()
            usable = int(self._outcome) <= QPStatus.INACCURATE
        after(record, *given, usable)

    def _limits_and_inputs(self) -> tuple[Vector, Vector, Vector]:
        """What kernels around the optimum take."""
        return *self.problem.thrust_bounds, self._solved

    def prepare(self, state: State) -> None:
        """Targets of the gait; the robot's dynamics, tasks and contact states.

        Args:
            state: measured, see :class:`~harpy_pin.model.state.State`.

        Raises:
            InputError: it is no state of the robot, or a bad sample.
        """
        state = as_state(state, self.robot)
        sample = self._plan(state)
        status = self._opening(self._record_, self.target._record_, *sample)
        if status == BAD_SAMPLE:
            self._close(self._record_, self.target._record_, *sample)
            self._refuse_misfit(state)
            raise InputError(
                "the state is a bad sample, which step() answers without a program", name="state"
            )

    def build(self, state: State) -> WholeBodyProblem:
        """The quadratic program, ready to be solved.

        Args:
            state: as given to :meth:`prepare`.
        """
        self._build(as_state(state, self.robot))
        return self.problem

    def _build(self, state: State) -> None:
        """As :meth:`build`, of a state that was checked."""
        self._kernels.build(self._record_, *self._program_parts, state.v)
        self._add_rows(state)

    def _add_rows(self, state: State) -> None:
        """The rows of added tasks, which are in world axes, in the program."""
        added, targets = self.added, self.targets
        if added is None:
            return
        if not targets.tilted:
            added.build(self.dynamics, state, targets._held_)
            return
        turn_feet(self.dynamics._record_, np.ascontiguousarray(targets.frame.transpose(0, 2, 1)))
        added.build(self.dynamics, state, targets.held, frame=targets.frame)
        turn_feet(self.dynamics._record_, targets.frame)

    def solve(self) -> QPSolution:
        """Solve the problem from the last tick's solution."""
        self._solve_all()
        return self.solution

    def _solve_all(self) -> None:
        """The programs of a tick, by a solver that may be Python's."""
        self._solve_once(further=False)
        while self._kernels.go_on(self._record_, *self._program_parts):
            if self.added is not None:
                self.added.copy()
            self._solve_once(further=True)

    def _solve_once(self, *, further: bool) -> None:
        """Solve the program as it is, where its solver does not finish by the dual method.

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

    def finish(self, state: State) -> Command:
        """Torques and thrusts of the solution, or the fallback.

        Args:
            state: as given to :meth:`prepare`.
        """
        state = as_state(state, self.robot)
        self._finish(state)
        self._close(self._record_, self.target._record_, *self._measured(state))
        return self._command

    def _finish(self, state: State) -> None:
        """Inputs, forces and status of the solution."""
        if self._fell_back:
            self._fallbacks += 1
            self._fell_back = False
        if self.added is not None and self.solution.usable:
            self.added.read(self._solution._z_)
        self._kernels.finish(self._record_, *self._program_parts, state.q, state.v)
