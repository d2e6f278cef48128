"""Tasks and ranges that a user adds to a whole-body problem, after it was built.

A task has rows A x ≈ b in x = [a; f] (:mod:`harpy_pin.wbc.task`). In every formulation x is affine in the variables z
of the program, so that the error of a task is, too,

    e(z) = A x − b = C z + d

A weight w adds ½ Σ w e² to the objective; a range adds the rows lower ≤ e(z) ≤ upper. The force of a foot in the air is
zero: rows that say nothing else rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.problem import WholeBodyProblem
from harpy_pin.wbc.program import UNBOUNDED, QuadraticProgram
from harpy_pin.wbc.settings import MOST_WEIGHT
from harpy_pin.wbc.task import Task

__all__ = ["AddedTask", "AddedTasks"]


class AddedTask:
    """A task in a problem; its arrays are those of the last tick.

    Attributes:
        task: as given.
        weight: (m,) of the squares of its error; may be overwritten between ticks. None without one.
        lower: (m,) least error, −inf for none; may be overwritten between ticks. None without a range.
        upper: (m,) largest error, likewise.
        matrix: (m, nv + 3 feet) A.
        target: (m,) b.
    """

    def __init__(
        self, task: Task, matrix: Vector, target: Vector, weight: Vector | None, limits: tuple[Vector, Vector] | None
    ) -> None:
        self.task, self.matrix, self.target, self.weight = task, matrix, target, weight
        self.lower: Vector | None = None if limits is None else limits[0]
        self.upper: Vector | None = None if limits is None else limits[1]
        self._error = np.full(len(target), np.nan)
        self._rows, self._offset = np.zeros((len(target), 0)), np.zeros(len(target))

    @property
    def error(self) -> Vector:
        """(m,) A x − b at the solution; not a number where the last tick had none."""
        return self._error

    def enter(self, problem: WholeBodyProblem, program: QuadraticProgram, held: Vector) -> None:
        """Add the weighted error to the objective, and keep its rows."""
        in_air = problem.nv + np.flatnonzero(np.repeat(held, 3) == 0.0)
        matrix = self.matrix
        if len(in_air):
            matrix = matrix.copy()
            matrix[:, in_air] = 0.0
        self._rows, offset = problem.rows_on_variables(matrix)
        self._offset = offset - self.target
        self._error = np.full(len(self.target), np.nan)
        if self.weight is not None:
            root = np.sqrt(self.weight)
            rows = root[:, None] * self._rows
            program.hessian += rows.T @ rows
            program.gradient += rows.T @ (root * self._offset)

    def limit(self, program: QuadraticProgram, first: int) -> int:
        """Write the rows of the range from row ``first`` on; returns the row behind them."""
        if self.lower is None or self.upper is None:
            return first
        last = first + len(self.target)
        resting = ~self._rows.any(axis=1)
        program.inequality[first:last] = self._rows
        program.lower[first:last] = np.where(resting, -1.0, np.maximum(self.lower - self._offset, -UNBOUNDED))
        program.upper[first:last] = np.where(resting, 1.0, np.minimum(self.upper - self._offset, UNBOUNDED))
        return last

    def read(self, z: Vector) -> None:
        """Evaluate the error at a solution."""
        self._error = self._rows @ z + self._offset


class AddedTasks:
    """The tasks that were added to a problem, and the program with all of them in it.

    Args:
        problem: any formulation; it is left as it is, but for the objective of its program.

    Attributes:
        tasks: in the order in which they were added.
        program: what is to be solved. Without ranges that of the problem itself; with ranges a larger one with the same
            variables, for which a new solver has to be made.
    """

    def __init__(self, problem: WholeBodyProblem) -> None:
        self.problem = problem
        self.tasks: list[AddedTask] = []
        self.program = problem.program
        self._dynamics = Dynamics(problem.robot)

    def add(
        self,
        task: Task,
        state: State,
        *,
        weight: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> AddedTask:
        """Add a task, with a weight, a range, or both.

        Args:
            task: any object with a method ``rows``; it is called once, for its number of rows.
            state: any state of the robot, for that call.
            weight: of the squares of the error A x − b, (m,) or one for all rows; at most 1e6.
            lower: least error, (m,) or one for all rows; without it there is none.
            upper: largest error, likewise.

        Raises:
            InputError: neither weight nor range, or one out of its domain; rows that do not fit; a task that the
                formulation has no place for.
        """
        self._dynamics.update(state.q, state.v)
        matrix, target = self._rows(task, self._dynamics, state)
        self.problem.rows_on_variables(matrix)
        if weight is None and lower is None and upper is None:
            raise InputError("an added task needs a weight, a range (lower, upper), or both", name="weight")
        size, limits = len(target), None
        if weight is not None:
            weight = checks.gains("weight", weight, size)
            checks.number("weight", weight.max(initial=0.0), high=MOST_WEIGHT)
        if lower is not None or upper is not None:
            least = _bound("lower", -np.inf if lower is None else lower, size)
            largest = _bound("upper", np.inf if upper is None else upper, size)
            if (least > largest).any():
                raise InputError(f"lower is above upper: {least.tolist()}, {largest.tolist()}", name="lower")
            limits = (least, largest)
        added = AddedTask(task, matrix, target, weight, limits)
        self.tasks.append(added)
        if limits is not None:
            n, equalities, rows = self.program.shape
            bounded = self.program.bounded
            self.program = QuadraticProgram(
                n, equalities=equalities, inequalities=rows - bounded + size, bounded=bounded
            )
        return added

    def build(self, dynamics: Dynamics, state: State, held: Vector) -> None:
        """Complete :attr:`program`, after the problem was built.

        Args:
            dynamics: terms at the state.
            state: as measured.
            held: (feet,) 1 where a foot is held on the ground, else 0.

        Raises:
            InputError: rows of a task that do not fit, or are not finite.
        """
        built, program = self.problem.program, self.program
        rows = len(built.lower)
        if program is not built:
            program.hessian[:], program.gradient[:] = built.hessian, built.gradient
            program.equality[:], program.equality_value[:] = built.equality, built.equality_value
            program.inequality[:rows] = built.inequality
            program.lower[:rows], program.upper[:rows] = built.lower, built.upper
        for added in self.tasks:
            matrix, target = self._rows(added.task, dynamics, state)
            if len(target) != len(added.target):
                message = f"{_name(added.task)} had {len(added.target)} rows when it was added, now {len(target)}"
                raise InputError(message, name="rows")
            added.matrix, added.target = matrix, target
            added.enter(self.problem, program, held)
            rows = added.limit(program, rows)

    def read(self, z: Vector) -> None:
        """Evaluate the errors at a solution of the program."""
        for added in self.tasks:
            added.read(z)

    def _rows(self, task: Task, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """Rows of a task on [a; f], checked."""
        problem = self.problem
        matrix, target = (np.asarray(part, dtype=np.float64) for part in task.rows(dynamics, state))
        narrow, wide = problem.nv, problem.nv + problem.n_force
        if target.ndim != 1 or matrix.shape not in ((len(target), narrow), (len(target), wide)):
            raise InputError(
                f"rows of {_name(task)} must have shapes (m, {narrow}) or (m, {wide}), and (m,); "
                f"got {matrix.shape} and {target.shape}",
                name="rows",
            )
        if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
            raise InputError(f"rows of {_name(task)} must be finite", name="rows")
        full = np.zeros((len(target), wide))
        full[:, : matrix.shape[1]] = matrix
        return full, target.copy()


def _name(task: Task) -> str:
    return type(task).__name__


def _bound(name: str, value: ArrayLike, size: int) -> Vector:
    """One end of a range for each row; infinite is none."""
    bound = np.asarray(value)
    result = checks.array(name, np.full(size, bound) if bound.ndim == 0 else bound, size)
    if np.isnan(result).any():
        raise InputError(f"{name} must be numbers, got {result.tolist()}", name=name, value=value)
    return result
