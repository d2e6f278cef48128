"""Every formulation of the whole-body program with every solver, on the same states: times and accuracy."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from comparison.measure.replay import WBC_PHASES, WholeBodyChain
from comparison.measure.states import StateSequence
from comparison.measure.timing import Bench, summarise
from comparison.tables import Table, in_columns
from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.gaits import make_gait
from harpy_pin.wbc import FORMULATIONS, SOLVERS, QPStatus, WholeBodyLimits, installed_solvers
from harpy_pin.wbc.solvers import ProxQPSolver

STATES = 500
"""States of the walk that are used, from its middle."""

EXACT = ("daqp", "quadprog")
"""Active-set methods end at the optimum to rounding: the first of these that is installed is the reference."""

LOOSE = "command, proxqp to 1e-6 without duality gap"
"""ProxQP with its own settings but for the tolerance."""

COLUMNS = {
    "tick_p50_us": ("tick", "µs"),
    "build_p50_us": ("build", "µs"),
    "solve_p50_us": ("solve", "µs"),
    "solve_p99_us": ("solve, p99", "µs"),
    "unsolved": ("not solved", ""),
    "violation_max": ("largest violation", ""),
    "difference_max": ("largest difference", "N, N·m"),
}


class _CheckedChain(WholeBodyChain):
    """Keeps status and violation of every solve beside its times."""

    def start(self, states: Any) -> None:
        """See :meth:`TickReplay.start`."""
        super().start(states)
        self.unsolved, self.violation = 0, 0.0

    def _keep(self, i: int, command: Any) -> None:
        super()._keep(i, command)
        solution = self.controller.solution
        self.unsolved += solution.status is not QPStatus.SOLVED
        if solution.usable:
            self.violation = max(self.violation, solution.violation)


def _configurations(friction: float) -> dict[str, WholeBodyParameters]:
    limits = WholeBodyLimits(mu=friction)
    found: dict[str, WholeBodyParameters] = {}
    for formulation in FORMULATIONS:
        for solver in (name for name in SOLVERS if name in installed_solvers()):
            for reuse in (False, True) if solver in ("proxqp", "daqp") else (False,):
                name = f"{formulation}, {solver}" + (", active set reused" if reuse else "")
                found[name] = WholeBodyParameters(formulation=formulation, solver=solver, reuse=reuse, limits=limits)
    return found


def time_formulations(bench: Bench, sequence: StateSequence) -> dict[str, Any]:
    """Time every formulation with every solver that is installed.

    Returns:
        For each configuration medians of the tick and its phases, the tail of the solve, ticks that were not solved,
        the largest violation of a constraint, and the largest difference of a command (N, N·m) from that of the
        ``full`` formulation solved by an active-set method (null where none is installed).
    """
    robot, settings = bench.robot, bench.settings
    begin = max((len(sequence) - STATES) // 2, 0)
    states = sequence.states[begin : begin + STATES]
    timed = {
        name: _CheckedChain(WholeBodyController(make_gait(robot), parameters))
        for name, parameters in _configurations(bench.friction).items()
    }
    plain = WholeBodyParameters(limits=WholeBodyLimits(mu=bench.friction))
    loose = partial(ProxQPSolver, tolerance=1e-6, gap=None)
    timed[LOOSE] = _CheckedChain(WholeBodyController(make_gait(robot), plain, solver=loose))

    def start(_: int) -> dict[str, _CheckedChain]:
        for timer in timed.values():
            timer.start(states)
        return timed

    laps, overhead = bench.repeat(start, [len(states)], block=max(settings.block // 5, 2 * settings.settle))
    reference = next((timed[key].commands for key in (f"full, {name}" for name in EXACT) if key in timed), None)
    result: dict[str, Any] = {}
    for name, timer in timed.items():
        tick = summarise([part.sum(axis=1) for part in laps[name]], len(WBC_PHASES) * overhead)
        build, solve = (
            summarise([part[:, WBC_PHASES.index(phase)] for part in laps[name]], overhead)
            for phase in ("build", "solve")
        )
        result[name] = {
            "tick_p50_us": tick["p50_us"],
            "build_p50_us": build["p50_us"],
            "solve_p50_us": solve["p50_us"],
            "solve_p99_us": solve["p99_us"],
            "unsolved": int(timer.unsolved),
            "violation_max": timer.violation,
            "difference_max": None if reference is None else float(np.abs(timer.commands - reference).max()),
        }
    return result


def formulations_table(entry: dict[str, Any], friction: float) -> Table:
    """The table of :func:`time_formulations`, and what is not installed."""
    cells = [cell for name, row in entry.items() for cell in in_columns(name, row, COLUMNS)]
    absent = [name for name in SOLVERS if not any(f", {name}" in row for row in entry)]
    note = (
        f"Medians unless stated, on {STATES} states of the pushed walk of the QP controller. "
        "The difference is that of the commands from the full formulation solved by an active-set method. 'full' and "
        "'input_space' are the same problem: where it is not small, the solver stopped short. 'contact_force' has no "
        "posture task, and holds the limits of the motors by choosing other forces."
    )
    note += f" Not installed: {', '.join(absent)}." if absent else ""
    return Table("formulations", f"Formulations and solvers of the program, friction {friction:g}", tuple(cells), note)
