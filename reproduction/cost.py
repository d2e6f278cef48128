"""Claim Q8: a governor update against the whole-body program's solve, on the same states.

The full measurement, with whole ticks and phases, is ``python -m comparison``; this one is what the report needs.
"""

from __future__ import annotations

import gc
from time import perf_counter_ns

import numpy as np

from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.controllers.named_controllers import make_governor
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State
from harpy_pin.wbc import WholeBodyLimits
from reproduction.claims import CLAIMS, Finding, judge
from reproduction.gait.spatial import make_named_gait
from reproduction.reduced_order import body_velocity

__all__ = ["study_cost"]

REPETITIONS = 3
"""Passes over the states, alternating between the two; the median of their ratios counts."""


def study_cost(run: Run, robot: Robot, gait_name: str, *, mu: float) -> Finding:
    """Replay a governed walk's states through the governor and through the whole-body program.

    Args:
        run: of the governed controller.
        robot: that walked.
        gait_name: of the gait that it walked.
        mu: friction coefficient both assume.
    """
    governor = make_governor("paper", robot, mu=mu)
    if governor is None:
        raise InputError("there is no governor to time", name="governor")
    measured = np.concatenate((run["q"][:, :3], body_velocity(run), run["centre_of_pressure"]), axis=1)
    targets = run["x_r"]
    limits = WholeBodyLimits(mu=mu)
    controllers = [
        WholeBodyController(make_named_gait(robot, gait_name), WholeBodyParameters(limits=limits, reuse=reuse))
        for reuse in (True, False)
    ]
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
            for column, controller in enumerate(controllers):
                controller.reset()
                for k in range(len(run)):
                    state = State(
                        float(run["t"][k]),
                        *(run[name][k] for name in ("q", "v", "foot_position", "foot_velocity", "foot_force")),
                    )
                    controller.prepare(state)
                    controller.build(state)
                    begin = perf_counter_ns()
                    solution = controller.solve()
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
        f"a governor update takes {ratio:.2f} of the program's solve (the last active set, else ProxQP) and "
        f"{update / proxqp:.2f} of that by ProxQP only: medians {update:.2f}, {solve:.1f} and {proxqp:.1f} µs over "
        f"{len(run)} states, {failed} solves failed",
        "python -m comparison",
        {"ratio": ratio, "update_us": update, "solve_us": solve, "solve_alone_us": proxqp},
    )
