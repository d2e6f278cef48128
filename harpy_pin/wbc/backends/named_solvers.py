"""Solvers of whole-body programs, by name."""

from __future__ import annotations

from importlib import import_module

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.wbc.active_set_warm_start import WarmStartedActiveSet
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver

__all__ = ["SOLVERS", "installed_solvers", "make_solver"]

SOLVERS: dict[str, str] = {
    "proxqp": "ProxQPSolver",
    "daqp": "DAQPSolver",
    "piqp": "PIQPSolver",
    "osqp": "OSQPSolver",
    "clarabel": "ClarabelSolver",
    "quadprog": "QuadprogSolver",
}
"""Class of each solver in :mod:`harpy_pin.wbc.backends`."""


@checked
def make_solver(name: str, program: QuadraticProgram, *, reuse: bool = False) -> QPSolver:
    """A solver for programs of one size.

    Args:
        name: one of :data:`SOLVERS`; all but ``proxqp`` are optional to install.
        program: gives the sizes.
        reuse: try the last active set first (:class:`WarmStartedActiveSet`).

    Raises:
        InputError: unknown name, or a solver that is not installed.
    """
    checks.one_of("solver", name, SOLVERS)
    try:
        module = import_module(f"harpy_pin.wbc.backends.{name}")
    except ImportError as error:
        message = f"solver {name!r} is not installed; 'pip install harpy-pin[compare]' brings it ({error})"
        raise InputError(message, name="solver", value=name) from error
    solver: QPSolver = getattr(module, SOLVERS[name])(program)
    return WarmStartedActiveSet(program, solver) if reuse else solver


def installed_solvers() -> tuple[str, ...]:
    """Names of the solvers that can be imported here."""

    def importable(name: str) -> bool:
        try:
            import_module(f"harpy_pin.wbc.backends.{name}")
        except ImportError:
            return False
        return True

    return tuple(name for name in SOLVERS if importable(name))
