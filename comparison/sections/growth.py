"""How the times grow with the size of the problem: faces of the friction pyramid, contacts, degrees
of freedom.

Robots other than Harpy come from example-robot-data, where it is installed; their motion is a small
sway about a bent posture, smooth from tick to tick, with every foot that is counted held on the
ground.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.measure.timing import Laps, summarise, timer_overhead, without_gc
from comparison.measure.walking import sway
from comparison.tables import Cell, Table, in_columns
from harpy_pin.wbc.condensed import CondensedSolver

FACES = (4, 8, 16, 32)
"""Of the friction pyramid."""
STATES = 200
WARM_UP = 50
MU = 0.5

ROBOTS: dict[str, tuple[str, ...]] = {
    "Bolt": ("FL_FOOT", "FR_FOOT"),
    "Solo12": ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"),
    "G1": ("left_ankle_roll_link", "right_ankle_roll_link"),
}
"""The frames taken as point feet, by the robot's name in the catalogue, in lower case there."""

PARTS = {
    "terms": "rigid-body terms",
    "full": "whole-body QP, full, own search",
    "input_space": "whole-body QP, input_space, own search",
    "proxqp": "whole-body QP, input_space, ProxQP",
    "scratch": "whole-body QP, input_space, DAQP from scratch",
    "condensed": "condensed WBC",
    "filter": "contact-force filter, terms included",
}
"""What is timed, as readers see it; a program is built and solved."""

_PROGRAMS = {
    "full": ("full", "active_set"),
    "input_space": ("input_space", "active_set"),
    "proxqp": ("input_space", "proxqp"),
    "scratch": ("input_space", "daqp"),
}
"""Formulation and solver of each program."""

_COUNTS = {"unsolved": ("programs not solved", ""), "acting": ("governor acts, share", "")}
KINDS = {
    "faces": (
        "faces of the friction pyramid",
        "rows are built and checked once a solve: at most in proportion, exponent 1",
    ),
    "contacts": (
        "feet held",
        "three rows and columns each: between 1 and, where factorisations dominate, 3",
    ),
    "freedoms": (
        "degrees of freedom",
        "terms in proportion to bodies times depth; dense factorisations up to 3, less on trees",
    ),
}
"""What grows, and the exponents of growth that the algorithms suggest."""


@dataclass(frozen=True)
class Case:
    """What is timed: a robot, the faces of its pyramids, and how many of its feet are held."""

    robot: hp.Robot
    faces: int = 4
    held: int = 2


def growth_cases(
    robot: hp.Robot, faces: Sequence[int]
) -> tuple[dict[str, dict[str, tuple[float, Case]]], dict[str, str]]:
    """By what grows the cases with their sizes, and robots that are absent with the reason."""
    robots, absent = {"Harpy": robot}, {}
    for name, feet in ROBOTS.items():
        try:
            robots[name] = hp.load_robot(hp.model.CATALOGUE[name.lower()].path(), feet=feet)
        except hp.HarpyError as error:
            absent[name] = str(error).splitlines()[0]
    cases: dict[str, dict[str, tuple[float, Case]]] = {
        "faces": {f"Harpy, {n} faces": (n, Case(robot, faces=n)) for n in faces},
        "contacts": {
            f"{name}, {n} held": (n, Case(r, held=n))
            for name, r in robots.items()
            if name in ("Harpy", "Solo12")
            for n in range(1, len(r.feet) + 1)
        },
        "freedoms": {f"{name}, two feet held": (r.model.nv, Case(r)) for name, r in robots.items()},
    }
    return cases, absent


def time_growth(
    robot: hp.Robot,
    repetitions: int,
    seed: int,
    *,
    faces: Sequence[int] = FACES,
    stage: Callable[[int], Callable[[], None]] = lambda count: lambda: None,
) -> dict[str, Any]:
    """Time terms, two formulations of the program, the condensed WBC and the filter, for growing
    problems.

    ``stage`` is told how many cases there are, and what it returns is called after each.

    Returns:
        For each kind of growth the cases with their sizes and medians, µs, and for each part the
        exponent of growth (slope of a straight line in logarithms; null with fewer than two sizes);
        and robots that are absent, with the reason.
    """
    kinds, absent = growth_cases(robot, faces)
    step = stage(sum(map(len, kinds.values())))
    result: dict[str, Any] = {}
    for kind, cases in kinds.items():
        rows: dict[str, dict[str, float]] = {}
        for name, (size, case) in cases.items():
            rows[name] = {"size": size, **time_case(case, repetitions, np.random.default_rng(seed))}
            step()
        growing = (
            rows
            if kind != "contacts"
            else {k: v for k, v in rows.items() if k.startswith("Solo12")} or rows
        )
        exponents = {
            part: exponent_of([(r["size"], r[part]) for r in growing.values()]) for part in PARTS
        }
        result[kind] = {"cases": rows, "exponents": exponents}
    return {**result, "absent": absent}


def _motion(case: Case, rng: np.random.Generator) -> list[tuple[hp.State, hp.wbc.WholeBodyTargets]]:
    """A smooth sway, with the targets of each state."""
    robot, model, weight = case.robot, case.robot.model, case.robot.mass * 9.81
    posture, middle = pin.neutral(model), rng.uniform(0.2, 0.6, len(robot.joints))
    posture[7:] = np.clip(
        middle, np.maximum(robot.joint_lower, -1.5), np.minimum(robot.joint_upper, 1.5)
    )
    amplitude, desired = 0.05 * rng.standard_normal(model.nv), rng.standard_normal(6)
    force = np.zeros((len(robot.feet), 3))
    force[: case.held, 2] = weight / case.held
    target = hp.wbc.WholeBodyTargets(robot)
    target.body[:], target.orientation[:] = desired[:3], desired[3:]
    target.held[case.held :] = 0.0
    target.force_range[:] = (0.0, 10.0 * weight)
    phases = 2.0 * np.pi * np.arange(STATES) / STATES
    return [(state, target) for state in sway(robot, posture, amplitude, phases, 1.0, force)]


def time_case(case: Case, repetitions: int, rng: np.random.Generator) -> dict[str, float]:
    """Medians of every part, µs, over a sway drawn by ``rng``; programs not solved, and how often
    the filter acts.
    """
    robot = case.robot
    motion, dynamics = _motion(case, rng), hp.Dynamics(robot)
    limits = hp.wbc.WholeBodyLimits(mu=MU, faces=case.faces)
    problems = {
        name: hp.wbc.make_problem(formulation, robot, limits=limits)
        for name, (formulation, _) in _PROGRAMS.items()
    }
    solvers = {
        name: hp.wbc.make_solver(solver, problems[name].program)
        for name, (_, solver) in _PROGRAMS.items()
    }
    governor = hp.ContactForceFilter(robot, hp.ContactForceFilterParameters(mu=MU))
    law: CondensedSolver | None = None
    with suppress(hp.InputError):  # limbs that it does not take
        law = CondensedSolver(robot, limits=limits)
    command = hp.Command(np.zeros(len(robot.joints)), np.zeros((len(robot.thrusters), 3)))
    parts = [part for part in PARTS if part != "condensed" or law]
    laps: dict[str, Laps] = {
        part: np.zeros((repetitions, STATES), dtype=np.int64) for part in parts
    }
    rotation = np.zeros((3, 3))
    unsolved, acting, clock = 0, 0, perf_counter_ns

    with without_gc():
        overhead = timer_overhead()
        for place in product(range(repetitions), range(STATES)):
            state, target = motion[place[1]]
            t0 = clock()
            dynamics.update(state.q, state.v)
            laps["terms"][place] = clock() - t0
            rotation[:] = pin.Quaternion(state.q[3:7]).matrix()
            for name, problem in problems.items():
                t0 = clock()
                problem.build(dynamics, state.v, rotation, target)
                solution = solvers[name].solve(problem.program)
                laps[name][place] = clock() - t0
                unsolved += solution.status is not hp.wbc.QPStatus.SOLVED
            if law is not None:
                t0 = clock()
                law.solve(dynamics, state.v, target)
                laps["condensed"][place] = clock() - t0
            command.torque[:], command.thrust[:] = (
                dynamics.bias[6:],
                0.0,
            )  # loads the feet: the filter has work
            t0 = clock()
            governor.update(state, command)
            laps["filter"][place] = clock() - t0
            acting += bool((governor.status.h_r < 0.0).any())
    medians = dict.fromkeys(PARTS, float("nan"))
    medians |= {
        part: float(summarise(list(rows[:, WARM_UP:]), overhead)["p50_us"])
        for part, rows in laps.items()
    }
    return {**medians, "unsolved": float(unsolved), "acting": acting / (repetitions * STATES)}


def exponent_of(points: list[tuple[float, float]]) -> float | None:
    """Slope of a straight line through the logarithms of sizes and times."""
    known = [(size, time) for size, time in points if time > 0.0]
    if len({size for size, _ in known}) < 2:
        return None
    sizes, times = np.log(np.array(known)).T
    return float(np.polyfit(sizes, times, 1)[0])


def growth_tables(entry: Mapping[str, Any]) -> list[Table]:
    """The tables of :func:`time_growth`."""
    tables = []
    for kind, (title, expected) in KINDS.items():
        cells: list[Cell] = []
        for name, row in entry[kind]["cases"].items():
            cells.append(Cell(name, "size", row["size"]))
            cells += [Cell(name, text, row[part], "µs") for part, text in PARTS.items()]
            cells += in_columns(name, row, _COUNTS)
        exponents = entry[kind]["exponents"]
        cells += [Cell("exponent of growth", text, exponents[part]) for part, text in PARTS.items()]
        note = (
            f"Medians; a QP is built and solved. Expected: {expected}. The motion is slow and "
            f"smooth: the last "
            "active set and ProxQP's warm start are at their best here, and the governor acts "
            "wherever stated. Cases "
            "are timed one after the other, not interleaved: where the rigid-body terms change "
            "without reason, the "
            "machine's speed changed."
        )
        if kind != "faces" and entry["absent"]:
            note += (
                " Absent: "
                + "; ".join(f"{name} ({why})" for name, why in entry["absent"].items())
                + "."
            )
        tables.append(Table(f"growth_{kind}", f"Growth with the {title}", tuple(cells), note))
    return tables
