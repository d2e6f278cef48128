"""What other people published, through ours: programs beside their solvers, models, recorded states and motions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparison.measure.walking import Progress, Rows
from comparison.public.flips import flip_columns, replay_flips
from comparison.public.models import compare_states, growth_exponents, time_models
from comparison.public.problems import is_convex, mat_problems, npz_problems
from comparison.public.solvers import LEVELS, time_solvers
from comparison.public.sources import find_sources, how_to_get
from comparison.tables import Cell, Table, in_columns
from harpy_pin import checks

__all__ = ["PublicSettings", "measure_public", "public_tables"]

SETS = {"mpc": "dense programs of mpc_qpbenchmark", "maros": "dense positive definite ones of maros_meszaros"}
_ACCURACY = {"primal_max": "primal residual", "dual_max": "dual residual", "gap_max": "gap"}
_STATE = {"mass": ("M A⁻¹ − 1", ""), "jacobian": ("Jacobians", ""), "gravity": ("torques against gravity", "N·m")}
_PARTS = {
    "terms": ("rigid-body terms", "µs"),
    "condensed": ("condensed WBC", "µs"),
    "full": ("WBC QP, full", "µs"),
    "input_space": ("WBC QP, input_space", "µs"),
}


@dataclass(frozen=True, kw_only=True)
class PublicSettings:
    """How much is measured.

    Attributes:
        problems: most programs of each set; they are taken evenly.
        repetitions: how often each is solved.
        joints: of the models whose ticks are timed.
        flips: whether motions are replayed at all gains.
    """

    problems: int = 1000
    repetitions: int = 5
    joints: tuple[int, ...] = (18, 24, 30, 36, 45)

    def __post_init__(self) -> None:
        checks.whole("problems", self.problems, low=1)
        checks.whole("repetitions", self.repetitions, low=1)

    @classmethod
    def quick(cls) -> PublicSettings:
        """A few programs and two models: to see whether it works."""
        return cls(problems=6, repetitions=1, joints=(18, 45))


def measure_public(settings: PublicSettings, folder: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Everything that the clones in a folder allow.

    Args:
        settings: how much.
        folder: with a clone of each repository, under its name.
        progress: told after every program and every model.

    Returns:
        For each repository what was found; ``missing`` has the commands that bring the absent ones.

    Raises:
        InputError: no clone is there, or a file in one is not what it should be.
    """
    found, missing = find_sources(folder)
    result: dict[str, Any] = {"missing": how_to_get(missing, folder)}
    for name in (name for name in SETS if name in found):
        problems = (
            list(npz_problems(found[name])) if name == "mpc" else list(filter(is_convex, mat_problems(found[name])))
        )
        problems = problems[:: -(-len(problems) // settings.problems) or 1]
        result[name] = {"problems": len(problems), "solvers": time_solvers(problems, settings.repetitions, progress)}
    if "libdwbc" in found:
        models = time_models(found["libdwbc"], settings.joints, settings.repetitions, progress)
        result["states"], result["models"] = compare_states(found["libdwbc"]), models
    if "flips" in found:
        result["flips"] = replay_flips(found["flips"])
    return result


def public_tables(result: dict[str, Any]) -> list[Table]:
    """The tables of :func:`measure_public`."""
    tables = [_solver_table(name, result[name]) for name in SETS if name in result]
    if "states" in result:
        cells = [cell for row in result["states"] for cell in in_columns(row["state"], row, _STATE)]
        note = "Largest entry of each: our terms against what libdwbc recorded of RBDL's, and of its own torques."
        tables.append(Table("public_states", "libdwbc: recorded states of TOCABI", tuple(cells), note))
        tables.append(_model_table(result["models"]))
    if "flips" in result:
        cells = [cell for row in result["flips"] for cell in flip_columns(row)]
        note = (
            "Positive turns are forwards. The files have joint angles, speeds and torques, and no motion of the body."
        )
        tables.append(Table("public_flips", "dfki-quad: motions replayed", tuple(cells), note))
    if result["missing"]:
        cells = [Cell(f"missing {k}", "to get it", text) for k, text in enumerate(result["missing"], start=1)]
        tables.append(Table("public_missing", "Repositories that are not there", tuple(cells)))
    return tables


def _solver_table(name: str, entry: dict[str, Any]) -> Table:
    cells = []
    high = list(LEVELS)[-1]
    best = min(row[high]["shifted_mean_us"] for row in entry["solvers"].values())
    for solver, levels in entry["solvers"].items():
        cells += [Cell(solver, f"solved, {level}", levels[level]["solved_percent"], "%") for level in LEVELS]
        row = levels[high]
        cells += [Cell(solver, text, row[key]) for key, text in _ACCURACY.items()]
        cells += [
            Cell(solver, "median", row["median_us"], "µs"),
            Cell(solver, "mean time, to the best", row["shifted_mean_us"] / best),
        ]
    note = (
        "Solved: claimed, with both residuals and the gap below 1e-3, 1e-6 and 1e-9. Residuals, gap and times at the "
        "last of these; residuals and gap are the largest of programs that were claimed. The mean is the shifted "
        "geometric one of qpbenchmark, in which a program without a solution counts 10 s."
    )
    return Table(f"public_{name}", f"{entry['problems']} {SETS[name]}", tuple(cells), note)


def _model_table(rows: Rows) -> Table:
    cells = [cell for row in rows for cell in in_columns(f"{row['joints']} joints", row, _PARTS)]
    cells += in_columns(
        "exponent of growth", growth_exponents(rows), {key: (text, "µs") for key, (text, _) in _PARTS.items()}
    )
    note = "Medians; a tick of a controller without its terms. Both soles are on the ground, four contact points each."
    return Table("public_models", "libdwbc: TOCABI with 18 to 45 joints", tuple(cells), note)
