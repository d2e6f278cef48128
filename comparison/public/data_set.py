"""Whole-body programs recorded on walks, as a data set that qpbenchmark reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparison.measure.states import record_states, walk
from comparison.public.problems import KEYS, Problem
from harpy_pin import InputError, load_harpy, make_gait
from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.files import replacing
from harpy_pin.wbc import FORMULATIONS, QuadraticProgram, WholeBodyLimits
from harpy_pin.wbc.program import UNBOUNDED

FRICTIONS = (0.8, 0.25)
PUSH = 0.15
"""Speed added to the start of each walk in a drawn direction, m/s."""


def problem_of(name: str, program: QuadraticProgram) -> Problem:
    """A program of ours as others write it: bounds apart, rows with one side, what is empty None."""
    p, bounded, n = program, program.bounded, len(program.gradient)
    box = np.full((2, n), np.inf) * np.array([[-1.0], [1.0]])
    box[0, :bounded], box[1, :bounded] = p.lower[:bounded], p.upper[:bounded]
    box[np.abs(box) >= UNBOUNDED] *= np.inf
    rows, lower, upper = p.inequality[bounded:], p.lower[bounded:], p.upper[bounded:]
    above, below = upper < UNBOUNDED, lower > -UNBOUNDED
    g, h = np.vstack((rows[above], -rows[below])), np.concatenate((upper[above], -lower[below]))
    parts: dict[str, Any] = {"G": g, "h": h} if h.size else {}
    parts |= {"A": p.equality.copy(), "b": p.equality_value.copy()} if p.equality_value.size else {}
    parts |= {"lb": box[0], "ub": box[1]} if np.isfinite(box).any() else {}
    return Problem(name, p.hessian.copy(), p.gradient.copy(), **parts)


def record_problems(count: int, *, duration: float, seed: int) -> list[Problem]:
    """Programs of Harpy's walks under the whole-body QP, ``count`` of each formulation, evenly spread over the ticks.

    There is a walk for each friction, started with a push in a drawn direction.
    """
    rng, robot, problems = np.random.default_rng(seed), load_harpy(), []
    for friction in FRICTIONS:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        push = PUSH * np.array([np.cos(angle), np.sin(angle)])
        run = walk("wbc", friction=friction, duration=duration, push=push)
        states = record_states("wbc", run, least=1).states
        ticks = np.unique(np.linspace(0, len(states) - 1, max(count // len(FRICTIONS), 1)).astype(int))
        for formulation in FORMULATIONS:
            parameters = WholeBodyParameters(formulation=formulation, limits=WholeBodyLimits(mu=friction))
            controller = WholeBodyController(make_gait(robot), parameters)
            kind = formulation.replace("_", "").upper()
            for tick in ticks:
                controller.prepare(states[tick])
                program = controller.build(states[tick]).program
                problems.append(problem_of(f"HARPY{kind}{100 * friction:02.0f}T{tick}", program))
    return problems


def write_problems(path: Path, problems: Sequence[Problem]) -> None:
    """Write a Parquet file if the path ends so (``qpbenchmark.ParquetTestSet``), else a folder of ``NAME.npz``
    (``qpbenchmark.Problem.load``), whose absent fields are None.

    Raises:
        InputError: a Parquet file without pyarrow.
    """
    if path.suffix != ".parquet":
        path.mkdir(parents=True, exist_ok=True)
        for problem in problems:
            arrays: dict[str, Any] = {key: np.array(getattr(problem, key)) for key in KEYS}
            np.savez(path / f"{problem.name}.npz", **arrays)
        return
    import pandas as pd

    flat = [{key: None if (x := getattr(p, key)) is None else np.ravel(x) for key in KEYS} for p in problems]
    frame = pd.DataFrame([{**row, "name": p.name} for row, p in zip(flat, problems, strict=True)])
    try:
        with replacing(path) as file:
            frame.to_parquet(file, engine="pyarrow", index=False)
    except ImportError as error:
        message = "a Parquet file needs pyarrow: 'pip install pyarrow', or give the name of a folder for files of NumPy"
        raise InputError(message, name="export", value=path) from error
