"""Tasks and ranges that a user adds to a whole-body problem, after it was built.

A task has rows A x ≈ b in x = [a; f] (:mod:`harpy_pin.wbc.tasks.task`). In every formulation x is
affine in the variables z of the program, so the error of a task is affine in z, too:

    e(z) = A x − b = C z + d

A weight w adds ½ Σ w e² to the objective; a range adds the rows lower ≤ e(z) ≤ upper. The force of
a swing foot is zero whatever z, so a row that depends on nothing else is inactive. A row of A that
is zero has the error −b whatever z: there is no solution where that is outside its range.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import KeepsViews, fixed_arrays, lasting, move_array
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.active_set import UNBOUNDED
from harpy_pin.wbc.problem import WholeBodyProblem
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.tasks.task import Task
from harpy_pin.wbc.weights import MAX_WEIGHT


@fixed_arrays("error", "lower", "matrix", "target", "upper", "weight")
class AddedTask(KeepsViews):
    """A task in a problem. Its arrays are those of the last tick; weight and range may be
    overwritten in place.

    Args:
        task: whose rows are added.
        shape: of these rows, (m, nv) or (m, nv + 3 feet).
        limited: whether it has a range.

    Attributes:
        task: as given.
        matrix: (m, nv + 3 feet) A.
        target: (m,) b.
        error: (m,) A x − b at the solution; NaN where the last tick had none.
        weight: (m,) of the squares of its error; zero where there is none.
        lower: (m,) least error; −inf for none.
        upper: (m,) largest error; inf for none.
        limited: whether it was added with a range.
    """

    matrix: Vector
    target: Vector
    error: Vector
    _matrix_: Vector
    _target_: Vector
    weight: Vector
    lower: Vector
    upper: Vector

    def __init__(self, task: Task, shape: tuple[int, int], *, limited: bool) -> None:
        self.task, self.limited = task, limited
        self._shape = shape

    @checked
    def update(self, dynamics: Dynamics, state: State) -> None:
        """Evaluate its rows.

        Args:
            dynamics: terms at the state.
            state: as measured.
        """
        matrix, target = _rows(self.task, dynamics, state)
        if matrix.shape != self._shape or target.shape != self._shape[:1]:
            raise InputError(
                f"rows of {self.name} had shapes {self._shape} and {self._shape[:1]} when it was "
                f"added, "
                f"now {matrix.shape} and {target.shape}",
                name="rows",
            )
        self._matrix_[:, : self._shape[1]], self._target_[:] = matrix, target

    @property
    def name(self) -> str:
        """For messages: the name of its class."""
        return type(self.task).__name__


class AddedTasks(KeepsViews):
    """The tasks that were added to a problem, and the program with all of them in it.

    Args:
        problem: any formulation; only the objective of its program is changed.

    Attributes:
        tasks: in the order in which they were added.
        program: what is to be solved. Without ranges that of the problem itself; with ranges a
            larger one with the same variables, for which a new solver has to be made.
    """

    def __init__(self, problem: WholeBodyProblem) -> None:
        if not hasattr(problem, "motion_map"):
            raise InputError(
                f"problem must be a WholeBodyProblem, got {shown(problem)}",
                name="problem",
                value=problem,
            )
        self.problem = problem
        self.tasks: list[AddedTask] = []
        self.program = problem.program
        # One row for each row of the tasks, whose arrays are views of these.
        self._arrays: dict[str, Vector] = {"matrix": np.zeros((0, problem.nv + problem.n_force))}
        self._arrays |= {
            name: np.zeros(0) for name in ("target", "error", "weight", "lower", "upper")
        }
        self._limited = np.zeros(0, dtype=np.int64)  # rows of tasks with a range
        self._rows, self._offset = (
            np.zeros((0, len(problem.program.gradient))),
            np.zeros(0),
        )  # C and d

    @checked
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
            upper: largest error, (m,) or one for all rows; without it there is none.

        Raises:
            InputError: neither weight nor range, or one out of its domain; rows that do not fit; a
                row of zeros with a range that its error is outside of; a task that the formulation
                has no place for.
        """
        limited = lower is not None or upper is not None
        if weight is None and not limited:
            raise InputError(
                "an added task needs a weight, a range (lower, upper), or both", name="weight"
            )
        dynamics = Dynamics(self.problem.robot)
        dynamics.update(state.q, state.v)
        if not callable(getattr(task, "rows", None)):
            raise InputError(
                f"a task needs rows(dynamics, state), got {shown(task)}", name="task", value=task
            )
        matrix, target = _rows(task, dynamics, state)
        size, columns = self._shape(task, matrix, target)
        weights = np.zeros(size) if weight is None else checks.gains("weight", weight, size)
        checks.number("weight", weights.max(initial=0.0), high=MAX_WEIGHT)
        least = _bound("lower", -np.inf if lower is None else lower, size)
        largest = _bound("upper", np.inf if upper is None else upper, size)
        if (least > largest).any():
            raise InputError(
                f"lower {least.tolist()} is above upper {largest.tolist()}",
                name="lower",
                value=lower,
            )
        full = np.zeros((size, self._arrays["matrix"].shape[1]))
        full[:, :columns] = checks.vector("rows", matrix, (size, columns))
        target = checks.vector("rows", target, size)
        for row in np.flatnonzero(~full.any(axis=1) & ((-target < least) | (-target > largest))):
            raise InputError(
                f"row {row} of {type(task).__name__} is zero, so that its error is always "
                f"{-target[row]:g}: "
                f"outside [{least[row]:g}, {largest[row]:g}]",
                name="rows",
            )
        new = {
            "matrix": full,
            "target": target,
            "weight": weights,
            "lower": least,
            "upper": largest,
        }
        self.tasks.append(AddedTask(task, (size, columns), limited=limited))
        self._enlarge({**new, "error": np.full(size, np.nan)}, size, limited=limited)
        return self.tasks[-1]

    def build(
        self, dynamics: Dynamics, state: State, held: Vector, *, frame: Vector | None = None
    ) -> None:
        """Complete :attr:`program`, after the problem was built.

        Args:
            dynamics: terms at the state, those of the feet in world axes.
            state: as measured.
            held: (feet,) 1 where a foot is held on the ground, else 0.
            frame: (feet, 3, 3) of the contacts, where the problem's forces are in those; by default
                in world axes.

        Raises:
            InputError: rows of a task that do not fit, or are not finite.
        """
        arrays, nv = self._arrays, self.problem.nv
        for added in self.tasks:
            added.update(dynamics, state)
        matrix, target = arrays["matrix"], arrays["target"]
        if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
            bad = [
                a.name
                for a in self.tasks
                if not (np.isfinite(a.matrix).all() and np.isfinite(a.target).all())
            ]
            raise InputError(f"rows of {', '.join(bad)} must be finite", name="rows")
        arrays["error"][:] = np.nan
        if frame is not None:
            frame = checks.vector("frame", frame, (self.problem.feet, 3, 3))
            forces = matrix[:, nv:].reshape(len(matrix), -1, 3)
            matrix = np.hstack(
                (matrix[:, :nv], np.einsum("rki,kij->rkj", forces, frame).reshape(len(matrix), -1))
            )
        motion, at_zero = self.problem.motion_map(held)
        np.dot(matrix, motion, out=self._rows)
        np.dot(matrix, at_zero, out=self._offset)
        self._offset -= target
        self.copy()
        if self.program is self.problem.program:
            self._add_weights()

    def copy(self) -> None:
        """With ranges: make :attr:`program` anew from the problem's, which was changed since
        :meth:`build`.
        """
        program, built, arrays = self.program, self.problem.program, self._arrays
        if program is built:
            return
        rows = len(built.lower)
        program.hessian[:], program.gradient[:] = built.hessian, built.gradient
        program.equality[:], program.equality_value[:] = built.equality, built.equality_value
        program.inequality[:rows] = built.inequality
        program.lower[:rows], program.upper[:rows] = built.lower, built.upper
        limited, offset = self._rows[self._limited], self._offset[self._limited]
        lower, upper = (
            arrays["lower"][self._limited] - offset,
            arrays["upper"][self._limited] - offset,
        )
        of_swing_feet = arrays["matrix"][self._limited].any(axis=1)
        inactive = ~limited.any(axis=1) & (of_swing_feet | ((lower <= 0.0) & (upper >= 0.0)))
        program.inequality[rows:] = limited
        program.lower[rows:] = np.where(inactive, -1.0, np.maximum(lower, -UNBOUNDED))
        program.upper[rows:] = np.where(inactive, 1.0, np.minimum(upper, UNBOUNDED))
        self._add_weights()

    def _add_weights(self) -> None:
        """Add the weighted squares of the errors to the objective."""
        root = np.sqrt(self._arrays["weight"])
        rows = root[:, None] * self._rows
        self.program._hessian_ += rows.T @ rows
        self.program._gradient_ += (root * self._offset) @ rows

    def read(self, z: Vector) -> None:
        """Evaluate the errors at a solution of the program.

        Args:
            z: (variables,) solution of the program.
        """
        error = self._arrays["error"]
        np.dot(self._rows, checks.array("z", z, self._rows.shape[1]), out=error)
        error += self._offset

    def _shape(self, task: Task, matrix: Vector, target: Vector) -> tuple[int, int]:
        """Numbers of rows and columns of a task, if they fit."""
        size, narrow = len(np.atleast_1d(target)), self.problem.nv
        wide = narrow + self.problem.n_force
        if target.ndim != 1 or matrix.shape not in ((size, narrow), (size, wide)):
            raise InputError(
                f"rows of {type(task).__name__} must have shapes (m, {narrow}) or (m, {wide}), and "
                f"(m,); "
                f"got {matrix.shape} and {target.shape}",
                name="rows",
            )
        return size, matrix.shape[1]

    def _enlarge(self, new: dict[str, Vector], size: int, *, limited: bool) -> None:
        """Append the rows of the last task."""
        first = len(self._offset)
        self._arrays = {
            name: lasting(np.concatenate((old, new[name]))) for name, old in self._arrays.items()
        }
        row = 0
        for added in self.tasks:
            count = added._shape[0]
            for name, array in self._arrays.items():
                move_array(added, name, array[row : row + count])
            row += count
        n, equalities, rows = self.program.shape
        self._rows, self._offset = np.zeros((row, n)), np.zeros(row)
        if limited:
            self._limited = np.concatenate((self._limited, np.arange(first, row)))
            bounded, weight = self.program.bounded, self.program.weight_unit
            self.program = QuadraticProgram(
                n,
                equalities=equalities,
                inequalities=rows - bounded + size,
                bounded=bounded,
                weight_unit=weight,
            )


def _rows(task: Task, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
    """A and b of a task as arrays, whatever it has returned."""
    returned = task.rows(dynamics, state)
    if not isinstance(returned, tuple | list) or len(returned) != 2:
        message = f"rows of {type(task).__name__} must return A and b, got {shown(returned)}"
        raise InputError(message, name="rows", value=returned)
    matrix, target = returned
    return (
        matrix if isinstance(matrix, np.ndarray) else checks.array("rows", matrix, None),
        target if isinstance(target, np.ndarray) else checks.array("rows", target, None),
    )


def _bound(name: str, value: ArrayLike, size: int) -> Vector:
    """One end of a range for each row, infinite for none."""
    bound = checks.array(name, value, None)
    result = checks.array(name, np.full(size, bound) if bound.ndim == 0 else bound, size)
    unreachable = np.inf if name == "lower" else -np.inf
    if np.isnan(result).any() or (result == unreachable).any():
        message = (
            f"{name} must be numbers or {-unreachable:g} for none, got {shown(result.tolist())}"
        )
        raise InputError(message, name=name, value=value)
    return result
