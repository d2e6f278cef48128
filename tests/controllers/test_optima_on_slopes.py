"""Random states on random normals, thousands at a time: the condensed controller gives the optimum,
and keeps forces in their cones about the normals.
"""

from collections import Counter

import numpy as np
from optimality import Programs, optima_from, times
from tilted_cases import GivenTargets, parameters, sloped_case
from whole_body_oracle import MU, NV, solve_oracle

from harpy_pin.controllers import CondensedController
from harpy_pin.wbc import WholeBodyLimits
from harpy_pin.wbc.condensed import CondensedStatus

BATCH = 500
CLOSE = 1e-7
"""Largest difference from the optimum, relative to it."""
DAQP = 2e-6
"""Likewise, from DAQP's own."""


def answers(controller: CondensedController, rng: np.random.Generator):
    """Programs, answers [a; f; u] and their status, of random states with one or two feet on the
    ground.
    """
    groups: dict[int, list] = {1: [], 2: []}
    for _ in range(BATCH):
        _, command, case = sloped_case(controller, rng)
        force = np.ravel(controller.telemetry()["desired_force"])
        z = np.concatenate((controller.solver.acceleration, force, command.thrust.ravel()))
        groups[int(controller.targets.held.sum())].append((case, z, int(controller.solver.status)))
    return groups.values()


def test_condensed_is_the_optimum_on_any_normals(fuzz):
    """KKT conditions of a program of the test's own; where an answer's active set has none, DAQP
    says what there is.

    ``--fuzz 1000`` looks at a million states.
    """
    rng = np.random.default_rng(31)
    controller = CondensedController(
        GivenTargets(), parameters(WholeBodyLimits(mu=MU, give_way=1.0))
    )
    seen: Counter[str] = Counter()
    worst = promise = 0.0
    for _ in range(1000 * fuzz // BATCH):
        for group in answers(controller, rng):
            programs = Programs.of([case for case, _, _ in group])
            given = np.array([z for _, z, _ in group])
            clipped = np.array(
                [bool(status & CondensedStatus.TORQUE_CLIPPED) for _, _, status in group]
            )
            size = 1.0 + np.abs(given).max(axis=1, keepdims=True)
            # rows of the pyramids; the others are limits of the inputs
            feet = programs.inequality.shape[1] - 24
            off = np.abs(times(programs.equality, given) - programs.value) / size
            over = (times(programs.inequality, given) - programs.upper)[:, :feet] / size
            promise = max(promise, off[~clipped].max(), over[~clipped].max())
            found = optima_from(programs, given)
            apart = (np.abs(found.z - given) / size)[:, NV:].max(axis=1)
            for i, (case, z, _) in enumerate(group):
                if found.fits[i] and not clipped[i]:
                    seen["optimal"] += 1
                    seen["a cone binds"] += bool(found.binding[i, :feet].any())
                    seen["an input's limit binds"] += bool(found.binding[i, feet:].any())
                    worst = max(worst, float(apart[i]))
                    continue
                optimum, flag = solve_oracle(case)
                if flag <= 0:
                    seen["without solution"] += 1
                    continue
                near = np.abs(optimum - z)[NV:].max() <= DAQP * (1.0 + np.abs(z).max())
                seen["optimal by DAQP" if near else "missed"] += 1
    print(dict(seen), f"largest difference {worst:.1e}, promise missed by {promise:.1e}")
    assert worst < CLOSE
    assert promise < 1e-9
    assert seen["missed"] == 0
    assert seen["optimal"] > 700 * fuzz
    assert min(seen["a cone binds"], seen["an input's limit binds"]) > 300 * fuzz
    assert seen["optimal by DAQP"] < 20 * fuzz
