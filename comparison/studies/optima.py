"""Check the optimum in six unknowns, and time it.

At random states of robots that stand, trot and balance, accelerations, forces and torques are
compared with those of the dense program, by ProxQP at 1e-9. At absurd states, warm from an answer
to something else, each force must be in its pyramid and range all the same. Then solves are timed
inside C: of generated bipeds with legs of ever more joints, of Go2 on ever more feet, of G1 with
ever more tasks, and of every case. Needs the extra "robots".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.measure.optimum_cases import CASES, LIMITS, Case, legged, legs_of, solve_proxqp
from comparison.study import Job, Rows, Study, View, grid, most, shown
from harpy_pin.kernels import kernel
from harpy_pin.kernels.kernels import wait_for_all
from harpy_pin.model.state import Vector
from harpy_pin.wbc import WholeBodyStatus
from harpy_pin.wbc.condensed.whole_body_solve import WholeBodyRecord, solve_whole_body

SWAY = 200
"""States that are timed, of a robot that sways a little."""
QUICK = ("go2 trots", "harpy on one foot", "legs of two joints trot")


@kernel
def solve_all(r: WholeBodyRecord, q: Vector, v: Vector) -> None:
    """The optima of states q (n, nq), v (n, nv), one after the other."""
    for k in range(q.shape[0]):
        solve_whole_body(r, q[k], v[k])


def _exact(job: Job) -> dict[str, Any]:
    """Largest differences from the dense program, as shares of the largest entry."""
    case, rng = CASES[job["case"]](), np.random.default_rng(job["seed"])
    found: dict[str, Any] = {"motion": 0.0, "force": 0.0, "torque": 0.0, "optimal": 0}
    for _ in range(job["states"]):
        state = case.draw(rng)
        solution = case.solver.solve(state)
        program, torques = case.dense(state)
        best, nv = solve_proxqp(program), len(state.v)
        forces = slice(nv, nv + solution.force.size)
        for name, ours, true in (
            ("motion", solution.acceleration, best[:nv]),
            ("force", solution.force.ravel(), best[forces]),
            ("torque", solution.torque, torques(best)),
        ):
            apart = float(np.abs(ours - true).max() / max(np.abs(true).max(), 1.0))
            found[name] = max(found[name], apart)
        found["optimal"] += int(solution.status == WholeBodyStatus.OPTIMAL)
    return found


def _admissible(job: Job) -> dict[str, Any]:
    """Largest violation of cones and ranges, as a share of 1 N + the force, and how solves end."""
    case, rng = CASES[job["case"]](), np.random.default_rng([job["seed"], *map(ord, job["case"])])
    solver, worst, outside, ends = case.solver, 0.0, 0, [0, 0, 0, 0]
    share = case.robot.mass * hp.model.GRAVITY / len(case.robot.feet)
    for _ in range(job["states"]):
        spread, size = 10.0 ** rng.uniform(-2.0, 0.0), 10.0 ** rng.uniform(-1.0, 2.0)
        state = case.draw(rng, spread=spread, size=size)
        state.v[:] *= 10.0 ** rng.uniform(-1.0, 1.5)
        solver.held[:] = rng.integers(0, 2, len(solver.held))
        solver.force_range[:, 1] = share * 10.0 ** rng.uniform(-1.0, 1.0)
        solver.contact_frame[:] = pin.exp3(0.5 * rng.standard_normal(3))
        solution = solver.solve(state)
        local = np.einsum("kij,ki->kj", solver.contact_frame, solution.force)
        held = np.repeat(solver.held, case.robot.corners) > 0.0
        beyond = np.stack(
            (
                -(local @ LIMITS.pyramid.T).min(axis=1),
                local[:, 2] - solver.force_range[:, 1],
                solver.force_range[:, 0] - local[:, 2],
            )
        ).max(axis=0)
        beyond = np.where(held, beyond, np.abs(local).max(axis=1))
        violation = float((beyond / (1.0 + np.abs(local).max())).max())
        violation = violation if np.isfinite(solution.force).all() else np.inf
        worst, outside = max(worst, violation), outside + int(violation > 1e-9)
        ends[solution.status] += 1
    counts = {status.name: ends[status] for status in WholeBodyStatus}
    return {"violation": worst, "outside": outside, **counts}


def biped(joints: int) -> Case:
    """A generated biped on points, with legs of so many joints and a task of its base."""
    kinds = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRY, pin.JointModelRZ)
    robot, q = legs_of(
        [kinds[n % 4] for n in range(joints)],
        [0.8 / joints] * joints,
        ((0.0, 0.1, 0.0), (0.0, -0.1, 0.0)),
        angles=[(-1.0) ** n * 0.3 for n in range(joints)],
        height=0.8,
    )
    return Case(robot, q, {hp.FrameTask("root", part="both"): 1.0}, regularisation=1e-2)


def _on_feet(count: int) -> Case:
    return legged("go2", held=tuple(int(n < count) for n in range(4)))


def _with_tasks(count: int) -> Case:
    case = CASES["g1 stands"]()
    return Case(case.robot, case.q, dict(islice(case.tasks.items(), count)))


def _of_list(name: str) -> Case:
    return CASES[name]()


SERIES: dict[str, Callable[[Any], Case]] = {
    "joints": biped,
    "feet": _on_feet,
    "tasks": _with_tasks,
    "case": _of_list,
}
"""What is timed, by what grows."""
TITLES = {
    "joints": "degrees of freedom of a biped",
    "feet": "feet of Go2 on the ground",
    "tasks": "tasks of G1",
}


def _cost(job: Job) -> dict[str, Any]:
    """µs of a solve inside C: of the best round."""
    case: Case = SERIES[job["grows"]](job["of"])
    robot = case.robot
    turns = 2e-3 * np.sin(2.0 * np.pi * np.arange(SWAY)[:, None] / SWAY + np.arange(robot.model.nv))
    q = np.array([pin.integrate(robot.model, case.q, turn) for turn in turns])
    solve_all(case.solver._record_, q, 5.0 * turns)
    wait_for_all()
    laps = []
    for _ in range(job["rounds"]):
        begin = perf_counter_ns()
        solve_all(case.solver._record_, q, 5.0 * turns)
        laps.append((perf_counter_ns() - begin) * 1e-3 / SWAY)
    contacts = int(np.repeat(case.solver.held, robot.corners).sum())
    tasks = sum(len(weights) for weights in case.solver.weights.values())
    sizes = {"nv": robot.model.nv, "contacts": contacts, "rows": tasks}
    return {**sizes, "us": min(laps)}


KINDS = {"exact": _exact, "admissible": _admissible, "cost": _cost}


def _measured(job: Job) -> dict[str, Any]:
    return KINDS[job["kind"]](job)


def _jobs(s: Any) -> Iterator[Job]:
    yield from grid(kind="exact", case=s.cases, states=s.states, seed=s.seed)
    yield from grid(kind="admissible", case=s.cases, states=s.absurd, seed=s.seed)


def _timed(s: Any) -> Iterator[Job]:
    for grows, values in {
        "joints": s.joints,
        "feet": s.feet,
        "tasks": s.tasks,
        "case": s.cases,
    }.items():
        yield from grid(kind="cost", grows=grows, of=values, rounds=s.rounds)


def _draw(figure: Any, rows: Rows) -> None:
    figure.set_size_inches(7.2, 2.8)
    for panel, (grows, title) in zip(
        figure.subplots(1, 3, sharey=True), TITLES.items(), strict=True
    ):
        mine = [row for row in rows if row.get("grows") == grows]
        name = "nv" if grows == "joints" else "of"
        panel.plot([row[name] for row in mine], [row["us"] for row in mine], "o-")
        panel.set(xlabel=title)
    longest = max(row["us"] for row in rows if row.get("grows") in TITLES)
    figure.axes[0].set(ylabel="a solve inside C, µs", ylim=(0.0, 1.1 * longest))


def _only(kind: str) -> Any:
    return lambda row: row["kind"] == kind


STUDY = Study(
    name="optima",
    help=__doc__,
    example="--only g1 --out g1.jsonl",
    defaults={
        "cases": tuple(CASES),
        "states": 1000,  # that are compared
        "absurd": 62_500,  # at which forces are checked: a million of all cases
        "joints": (3, 5, 7, 10, 13, 16),  # of each leg of the generated bipeds
        "feet": (0, 1, 2, 3, 4),
        "tasks": (1, 2, 3, 4, 5, 6),
        "rounds": 41,
        "seed": 0,
    },
    quick={
        "cases": QUICK,
        "states": 5,
        "absurd": 50,
        "joints": (3, 7),
        "feet": (2, 4),
        "tasks": (2, 6),
        "rounds": 5,
    },
    jobs=_jobs,
    timed=_timed,
    measure=_measured,
    views=[
        View(
            "optima",
            "Largest differences from the dense program by ProxQP at 1e-9, over the largest entry",
            row="{case}",
            columns={
                "states": shown("states"),
                "optimal": shown("optimal"),
                **{name: most(name) for name in ("motion", "force", "torque")},
            },
            note="Contacts are hard there; ours yield by 1e-9 of their multipliers.",
            only=_only("exact"),
        ),
        View(
            "optima_admissible",
            "Forces at absurd states",
            row="{case}",
            columns={
                "states": shown("states"),
                "outside": shown("outside"),
                "largest violation": most("violation"),
                **{status.name: shown(status.name) for status in WholeBodyStatus},
            },
            note="Violation of a pyramid or a range over 1 N + the largest force. Outside: by more "
            "than 1e-9. States and targets up to a hundred times those that are compared, any feet "
            "on the ground, on slopes, warm from another answer.",
            only=_only("admissible"),
        ),
        View(
            "optima_cost",
            "A solve inside C, terms included",
            row=lambda row: (
                row["of"] if row["grows"] == "case" else f"{TITLES[row['grows']]}: {row['of']}"
            ),
            columns={
                "degrees of freedom": shown("nv"),
                "contact points": shown("contacts"),
                "rows of tasks": shown("rows"),
                "time": (shown("us"), "µs"),
            },
            note="Of the best round, since other work on the machine lowers the others.",
            only=_only("cost"),
        ),
    ],
    draw=_draw,
    only="cases",
)
