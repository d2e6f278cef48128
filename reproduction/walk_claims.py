"""The second simulation: the full robot at the paper's friction, what the model expects of the
ground, and Q4 to Q8.
"""

import gc
from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter_ns

import numpy as np

from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.controllers.named_controllers import make_governor
from harpy_pin.errors import InputError
from harpy_pin.governors.point_mass import Law, axial_force, model_record
from harpy_pin.governors.rows import ForceRows
from harpy_pin.ground.ground import Ground
from harpy_pin.log.measures import Measures, measure
from harpy_pin.log.run import Run
from harpy_pin.model.loading import load_harpy
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, State, Vector
from harpy_pin.model.terms import body_rotation
from harpy_pin.scenario import Governed, Scenario, walk
from harpy_pin.wbc import make_solver
from reproduction.chattering import Chattering, chattering
from reproduction.claims import CLAIMS, Finding, judge
from reproduction.gait.periodicity import analyse_periodicity
from reproduction.gait.planar_gait import PACKAGED_GAIT, PAPER_CURVES_GAIT, SPACE_GAIT, load_gait
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.planar_walk import PlanarWalk
from reproduction.gait.spatial import make_named_gait


def body_velocity(run: Run) -> Vector:
    """(n, 3) velocity of the body's origin, world axes, m/s."""
    velocity, rotation = np.empty((len(run), 3)), np.empty((3, 3))
    for q, v, out in zip(run["q"], run["v"], velocity, strict=True):
        body_rotation(q, rotation)
        out[:] = rotation @ v[:3]
    return velocity


def _measured(run: Run) -> Vector:
    """(n, 9) [c; ċ; u] along the run."""
    for name in ("centre_of_pressure", "x_r", "x_w"):
        if name not in run:
            raise InputError(
                f"the run has no signal '{name}': it was not made by the governed controller",
                name="run",
            )
    return np.concatenate((run["q"][:, :3], body_velocity(run), run["centre_of_pressure"]), axis=1)


def model_rows(run: Run, *, mu: float, reference: str = "x_w") -> Vector:
    """(n, 5) force rows at the measured state (equations.md R1) for a logged reference, N.

    Args:
        run: of the governed controller.
        mu: friction coefficient of the rows.
        reference: signal to evaluate at, ``x_w`` or ``x_r``.

    Raises:
        InputError: the run lacks a signal.
    """
    rows = ForceRows(mass=float(run.metadata["mass"]), mu=mu, g=GRAVITY)
    out, jacobian = np.empty((len(run), len(rows.names))), np.empty((len(rows.names), 6))
    for x, w, h in zip(_measured(run), run[reference], out, strict=True):
        rows.evaluate(x, w, h, jacobian)
    return out


def model_force(run: Run, *, reference: str = "x_w") -> Vector:
    """(n, 3) contact force that the reduced-order model expects for a logged reference, world axes,
    N.

    Args:
        run: of the governed controller.
        reference: signal to evaluate at, ``x_w`` or ``x_r``.

    Raises:
        InputError: the run lacks a signal.
    """
    model = model_record(mass=float(run.metadata["mass"]), g=GRAVITY, gains=None, law=Law.FULL)[0]
    out, jacobian = np.empty((len(run), 3)), np.empty(6)
    for x, w, force in zip(_measured(run), run[reference], out, strict=True):
        r = x[:3] - x[6:]
        d = axial_force(r, x[:3], x[3:6], model, jacobian)
        force[:] = (jacobian @ w + d) * r / np.linalg.norm(r)
    return out


MU = 0.25
"""μ_s of the paper's 3D run; μ_c is 0.225."""
WALKS = ("no thrusters", "no governor", "measured", "tracked")
DIVISORS = (1, 2, 4)
"""Of the control period of 1 ms, where chattering is measured; the physics step is the same 0.25 ms
for all.
"""
NORMAL = 4
"""Index of the normal-force row."""


@dataclass(frozen=True, eq=False)
class WalkStudy:
    """All runs of the second simulation."""

    runs: dict[str, Run]  # by name of :data:`WALKS`
    measures: dict[str, Measures]  # what each achieved
    # of the applied reference (positions) and of the total normal force, by walk and divisor of the
    # control period
    chattering: dict[tuple[str, int], tuple[Chattering, Chattering]]
    findings: tuple[Finding, ...]  # Q4 to Q7


def walk_run(
    gait: str, name: str, *, duration: float, dt: float = 5e-4, period: float = 1e-3
) -> Run:
    """One walk at the paper's friction.

    Args:
        gait: see :data:`reproduction.gait.spatial.GAITS`.
        name: one of :data:`WALKS`.
        duration: s.
        dt: physics step, s.
        period: control period, s.
    """
    governed = name in ("measured", "tracked")
    scenario = Scenario(
        controller=Governed(
            governor="paper" if governed else "none",
            evaluate_at=name if governed else "measured",
            thrust=name != "no thrusters",
        ),
        ground=Ground(mu_s=MU),
        duration=duration,
        dt=dt,
        period=period,
    )
    return walk(scenario, gait=make_named_gait(load_harpy(), gait))


def study_walk(gait: str, *, duration: float = 10.0) -> WalkStudy:
    """Walk with and without thrusters and governor, measure chattering at divided periods, and
    judge Q4 to Q7.

    Args:
        gait: see :data:`reproduction.gait.spatial.GAITS`.
        duration: of the walks, s.
    """
    runs = {name: walk_run(gait, name, duration=duration) for name in WALKS}
    measures = {name: measure(run) for name, run in runs.items()}
    chatter: dict[tuple[str, int], tuple[Chattering, Chattering]] = {}
    for name in WALKS[1:]:
        for divide in DIVISORS:
            period = 1e-3 / divide
            run = walk_run(gait, name, duration=duration, dt=2.5e-4, period=period)
            chatter[name, divide] = (
                chattering(run["x_w"][:, :3], period=period),
                chattering(run["foot_force"][1:, :, 2].sum(axis=1), period=period),
            )
    findings = (_q4(measures), _q5(measures), _q6(runs["measured"]), _q7(chatter, runs))
    return WalkStudy(
        runs, measures, chatter, tuple(replace(finding, setting=gait) for finding in findings)
    )


def _q4(measures: dict[str, Measures]) -> Finding:
    without, with_thrust = measures["no thrusters"], measures["no governor"]
    return Finding(
        CLAIMS["Q4"],
        judge(without.fell and not with_thrust.fell),
        f"without thrusters {'falls' if without.fell else 'does not fall'} after "
        f"{without.duration_s:.2f} s; with them "
        f"{'falls' if with_thrust.fell else 'walks'} {with_thrust.distance_m:.2f} m in "
        f"{with_thrust.duration_s:.1f} s",
        "python -m reproduction paper",
        {
            "without_duration_s": without.duration_s,
            "with_duration_s": with_thrust.duration_s,
            "with_distance_m": with_thrust.distance_m,
        },
    )


def _q5(measures: dict[str, Measures]) -> Finding:
    free = measures["no governor"]
    name = min(
        ("measured", "tracked"), key=lambda n: (measures[n].fell, measures[n].slip_mm_per_step)
    )
    best = measures[name]
    holds = not best.fell and best.slip_mm_per_step <= 8.0 and best.late_slip_mm_per_step <= 1.0
    return Finding(
        CLAIMS["Q5"],
        judge(holds, not best.fell and best.slip_mm_per_step < free.slip_mm_per_step),
        f"{best.slip_mm_per_step:.2f} mm per step, {best.late_slip_mm_per_step:.2f} of them after "
        f"50 ms ({name}); "
        f"without a governor {free.slip_mm_per_step:.2f} and {free.late_slip_mm_per_step:.2f}",
        "python -m reproduction paper",
        {
            "slip_mm_per_step": best.slip_mm_per_step,
            "late_slip_mm_per_step": best.late_slip_mm_per_step,
            "ungoverned_slip_mm_per_step": free.slip_mm_per_step,
            "sliding": best.sliding,
        },
    )


def _ending(run: Run) -> str:
    """How a walk ended, in words."""
    return f"the walk {'falls' if run.fell else 'ends'} at {run.metadata['end_time']:.2f} s"


def _q6(run: Run) -> Finding:
    violated = model_rows(run, mu=MU, reference="x_r")[:, NORMAL] < 0.0
    target = float(np.mean(violated))
    when = (
        f"; first at t = {run['t'][int(violated.argmax())]:.2f} s, {_ending(run)}"
        if target > 0.0
        else ""
    )
    applied = float(np.mean(model_rows(run, mu=MU, reference="x_w")[:, NORMAL] < 0.0))
    return Finding(
        CLAIMS["Q6"],
        judge(target > 0.01 and applied < 0.5 * target, target > 0.0),
        f"under 20 N at {100 * target:.2f} % of the ticks with the target reference, at "
        f"{100 * applied:.2f} % with the "
        f"applied one{when}",
        "python -m reproduction paper",
        {"target_share": target, "applied_share": applied},
    )


def _q7(
    chatter: dict[tuple[str, int], tuple[Chattering, Chattering]], runs: dict[str, Run]
) -> Finding:
    rates_of = {
        n: [chatter[n, divide][0].reversals_per_s for divide in DIVISORS]
        for n in ("measured", "tracked")
    }
    name = max(rates_of, key=lambda n: _growth(rates_of[n]))
    rates, growth = rates_of[name], _growth(rates_of[name])
    listed = ", ".join(f"{rate:.1f}" for rate in rates)
    return Finding(
        CLAIMS["Q7"],
        judge(growth >= 1.5, growth >= 1.1),
        f"{listed} reversals per second at Δt, Δt/2, Δt/4 ({name}; {_ending(runs[name])})",
        "python -m reproduction paper --out DIR",
        {
            "growth": growth,
            **{f"reversals_per_s_{d}": r for d, r in zip(DIVISORS, rates, strict=True)},
        },
    )


def _growth(rates: Sequence[float]) -> float:
    """The last rate relative to the first."""
    if rates[0] > 0.0:
        return float(rates[-1] / rates[0])
    return np.inf if rates[-1] > 0.0 else 1.0


DURATION = 30.0


def study_gait(robot: Robot) -> dict[str, str]:
    """What the packaged planar gaits do without thrust, in words and numbers, by heading."""
    model = PlanarModel.from_robot(robot)
    rows: dict[str, str] = {}
    for title, path, mu in (
        ("planar, friction 0.25", PACKAGED_GAIT, 0.25),
        ("planar, friction 0.8", PACKAGED_GAIT, 0.8),
        ("optimised (refined for space), friction 0.25", SPACE_GAIT, 0.25),
        ("optimised (refined for space), friction 0.8", SPACE_GAIT, 0.8),
        ("paper-curves, friction 0.8", PAPER_CURVES_GAIT, 0.8),
        ("paper-curves, friction 0.25", PAPER_CURVES_GAIT, 0.25),
    ):
        found = load_gait(path)
        ground = Ground(mu_s=mu)
        s = PlanarWalk(model, found.gait, ground=ground).run(DURATION)
        how = f"falls after {s.steps:.1f} steps" if s.fell else f"walks {s.steps:.1f} steps"
        rows[title] = (
            f"{how} at {s.speed:.3f} m/s, height {s.height_min:.3f} to {s.height_max:.3f} m, pitch "
            f"up to "
            f"{s.pitch_max:.3f} rad, slip {s.slip:.2f} mm per step"
        )
        if path != PAPER_CURVES_GAIT and mu == 0.25:
            name = title.split(",")[0]
            rows[f"{name}, found by"] = str(found.record.get("command", "unknown"))
            for memory, kind in ((False, "without the PID's integrals"), (True, "with them")):
                p = analyse_periodicity(model, found.gait, ground=ground, memory=memory)
                rows[f"{name}, spectral radius of the Poincaré map, {kind}"] = (
                    f"{p.spectral_radius:.3f} ({p.spread[0]:.3f} to {p.spread[1]:.3f} over the "
                    f"difference steps), "
                    f"residual of the fixed point {p.residual:.1e}"
                )
    return rows


REPETITIONS = 3
"""Passes over the states, alternating between the two; the median of their ratios counts."""


def study_cost(run: Run, robot: Robot, gait_name: str, *, mu: float) -> Finding:
    """Claim Q8: replay a governed walk's states through the governor and through the whole-body
    program.

    The program is solved by ProxQP, and by this library's own search, which was made for it. The
    claim is judged by the faster of the two.

    The full measurement, with whole ticks and phases, is ``python -m comparison``; this one is what
    the report needs.

    Args:
        run: of the governed controller.
        robot: that walked.
        gait_name: of the gait that it walked.
        mu: friction coefficient both assume.
    """
    governor = make_governor("paper", robot, mu=mu)
    if governor is None:
        raise InputError("there is no governor to time", name="governor")
    measured, targets = _measured(run), run["x_r"]
    gait = make_named_gait(robot, gait_name)
    controller = WholeBodyController(
        gait, WholeBodyParameters.for_gait(gait, limits={"mu": mu}, solver="active_set")
    )
    program = controller.problem.program
    solvers = [make_solver(name, program) for name in ("active_set", "proxqp")]
    ratios, updates, failed = [], [], 0
    solves: tuple[list[float], list[float]] = ([], [])
    collecting = gc.isenabled()
    gc.disable()
    try:
        for repetition in range(REPETITIONS + 1):  # the first pass warms up
            governor.reset(targets[0])
            spent = np.empty(len(run))
            for k, (x, x_r) in enumerate(zip(measured, targets, strict=True)):
                begin = perf_counter_ns()
                governor.update(x, x_r, 1e-3)
                spent[k] = perf_counter_ns() - begin
            solving = np.empty((len(run), 2))
            for column, solver in enumerate(solvers):
                controller.reset()
                solver.reset()
                for k in range(len(run)):
                    state = State(
                        float(run["t"][k]),
                        *(
                            run[name][k]
                            for name in ("q", "v", "foot_position", "foot_velocity", "foot_force")
                        ),
                    )
                    controller.prepare(state)
                    controller.build(state)
                    begin = perf_counter_ns()
                    solution = solver.solve(program)
                    solving[k, column] = perf_counter_ns() - begin
                    failed += repetition > 0 and not solution.usable
            if repetition > 0:
                updates.append(float(np.median(spent)) / 1e3)
                for column in range(2):
                    solves[column].append(float(np.median(solving[:, column])) / 1e3)
                ratios.append(updates[-1] / solves[0][-1])
    finally:
        if collecting:
            gc.enable()
    ratio = float(np.median(ratios))
    update, solve, proxqp = (float(np.median(times)) for times in (updates, *solves))
    return Finding(
        CLAIMS["Q8"],
        judge(ratio <= 0.1, ratio <= 0.5),
        f"a governor update takes {update / proxqp:.2g} of the program's solve by ProxQP and "
        f"{ratio:.2g} of that by "
        f"our own search: medians {update:.2f}, {proxqp:.1f} and {solve:.1f} µs over {len(run)} "
        f"states, "
        f"{failed} solves failed",
        "python -m comparison",
        {"ratio": ratio, "update_us": update, "own_search_us": solve, "proxqp_us": proxqp},
    )
