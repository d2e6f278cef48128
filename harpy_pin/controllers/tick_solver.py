"""The solutions of a tick of the whole-body controller: each is bounded, and tasks give way at limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import KeepsViews
from harpy_pin.wbc import (
    AddedTasks,
    QPSolution,
    QPSolver,
    QPStatus,
    QuadraticProgram,
    WholeBodyProblem,
    WholeBodyTargets,
)
from harpy_pin.wbc.active_set_warm_start import WarmStartedActiveSet
from harpy_pin.wbc.dual import DualActiveSet
from harpy_pin.wbc.giving_way import at_a_limit

__all__: list[str] = []


class TickSolver(KeepsViews):
    """Solves the program of a tick; where its solver does not finish, by the dual active-set method.

    Args:
        problem: whose program is solved.
        make: makes the solver of a program.

    Attributes:
        solver: of the program.
        beyond: whether torques were beyond their limits in the last solution without limits.
    """

    def __init__(self, problem: WholeBodyProblem, make: Callable[[QuadraticProgram], QPSolver]) -> None:
        self.beyond = False
        self._problem, self._make = problem, make
        self._added: AddedTasks | None = None
        self._inputs = np.zeros(problem.n_thrust + problem.joints)
        self._use(problem.program)

    def add(self, added: AddedTasks) -> None:
        """Solve the program with added tasks."""
        self._added = added
        if added.program is not self._program:
            self._use(added.program)

    def _use(self, program: QuadraticProgram) -> None:
        """Solvers for programs of this size."""
        self._program = program
        checks.function("solver", self._make, 1)
        self.solver = made = self._make(program)
        if not (hasattr(made, "solve") and hasattr(made, "solution")):
            raise InputError(f"solver must return a QPSolver, got {shown(made)}", name="solver", value=made)
        self._other_active = np.zeros(len(program.lower), np.int64)
        self._second = None if isinstance(self.solver, WarmStartedActiveSet) else DualActiveSet(program)
        for solver in (self.solver, self._second):
            if isinstance(solver, QPSolver):
                solver.prepare(program)

    def reset(self) -> None:
        """Forget the active sets."""
        self.solver.reset()
        self._other_active[:] = 0

    def swap_active(self) -> None:
        """Take up the other one of two programs of a tick, and its active set."""
        if isinstance(self.solver, WarmStartedActiveSet):
            self.solver.swap_active(self._other_active)

    def solve(self, *, further: bool = False) -> QPSolution:
        """Solution of the program as it is: the first of this tick, or a further one."""
        solver = self.solver
        if further and isinstance(solver, WarmStartedActiveSet):
            solution = solver.solve_further(self._program)
        else:
            solution = solver.solve(self._program)
        if solution.status is not QPStatus.SOLVED and self._second is not None:
            second = self._second.solve(self._program)
            return second if second.usable else solution
        return solution

    def give_way(self, limited: QPSolution, dynamics: Dynamics, targets: WholeBodyTargets) -> QPSolution:
        """Where thrusts or torques are at their limits, or these leave no solution: let tasks give way, and solve anew.

        The solution with limits stays where torques are within them in the one without, or nothing else is found.
        """
        problem = self._problem
        self.beyond = False
        if not problem.gives_way:
            return limited
        if limited.usable:
            problem.inputs(limited.z, self._inputs)
            if not at_a_limit(self._inputs, problem.record):
                return limited
        kept = replace(limited, z=limited.z.copy())
        self.beyond = self._torques_beyond(dynamics, targets)
        if self.beyond:
            solution = self.solve(further=True)
            if solution.usable:
                return solution
        limited.z[:], limited.status = kept.z, kept.status
        limited.iterations, limited.violation = kept.iterations, kept.violation
        return limited

    def _torques_beyond(self, dynamics: Dynamics, targets: WholeBodyTargets) -> bool:
        """Whether torques are beyond their limits in the solution without limits; if so, tasks have given way."""
        problem, first = self._problem, self._problem.n_thrust
        problem._put_limits(False)
        self._copy_added()
        free = self.solve(further=True)
        beyond = False
        if free.usable:
            problem.inputs(free.z, self._inputs)
            beyond = bool((np.abs(self._inputs[first:]) > problem.record["torque_limit"][0]).any())
        problem._put_limits(True)
        if beyond:
            problem._let_give_way(dynamics, targets, free.z)
        self._copy_added()
        return beyond

    def _copy_added(self) -> None:
        """Bring a change of the problem's program into that with added tasks."""
        if self._added is not None:
            self._added.copy()
