"""Hostile states through every controller: of any size, half of them spoiled, for point feet and
flat ones.

``--fuzz 100 -s`` is 100,000 states for each, and prints how long ticks take.
"""

from time import thread_time_ns

import numpy as np
import pytest
from guarded_walks import CONTROLLERS
from hostile_states import draw_hostile
from long import long_but
from needs import needs_robots
from random_states import draw

import harpy_pin as hp
from harpy_pin.contrib.solvers import SOLVERS
from harpy_pin.wbc import FORMULATIONS
from harpy_pin.wbc.active_set import EXCHANGES
from harpy_pin.wbc.active_set_warm_start import WarmStartedActiveSet
from harpy_pin.wbc.newton import TOTAL
from harpy_pin.wbc.program import ACCEPTED

STATES = 1000
MORE = {
    "paper, tracked": ("governed", {"governor": "paper", "evaluate_at": "tracked"}),
    "filter, limits": ("governed", {"governor": "filter", "limits": True}),
    "wbc": ("wbc", {"solver": "active_set"}),
    "wbc, ProxQP": ("wbc", {}),
}
QPS = {f"{a}, {b}": ("wbc", {"formulation": a, "solver": b}) for a in FORMULATIONS for b in SOLVERS}
"""Formulations of the whole-body QP with every solver."""
CASES = [("harpy", name) for name in CONTROLLERS | MORE]
CASES += [
    (robot, name) for robot in ("solo12", "go2", "g1", "talos") for name in ("wbc", "condensed")
]
CASES += [(robot, name) for robot in ("harpy", "solo12", "g1") for name in QPS]
RARE = ("piqp", "osqp", "clarabel", "quadprog", "proxqp")


def max_systems(controller):
    """Linear systems after which the searches of a tick end: Newton's steps, or those by active
    sets and then by the dual method.
    """
    if isinstance(controller, hp.WholeBodyController):
        solver = controller._solver
        return (
            2 * (EXCHANGES + 1) + solver.dual.limit
            if isinstance(solver, WarmStartedActiveSet)
            else np.inf
        )
    return TOTAL


@needs_robots
@pytest.mark.parametrize(
    ("who", "name"),
    long_but(
        CASES,
        [case for case in CASES if case[0] not in ("go2", "talos") and not case[1].endswith(RARE)],
    ),
)
def test_hostile_states(who, name, fuzz):
    """No exception, every command finite and within the limits, failures counted, and searches that
    end.
    """
    robot = hp.load_robot(who) if who != "harpy" else hp.load_harpy()
    gait = hp.Standing(robot) if who != "harpy" else hp.make_gait(robot)
    kind, options = (CONTROLLERS | MORE | QPS)[name]
    controller = hp.make_controller(kind, gait, mu=0.25, **options)
    searched, states = 0, STATES * fuzz if fuzz > 1 or who == "harpy" else STATES // 3
    times = np.full(states, np.inf)
    controller.step(
        draw_hostile(robot, np.random.default_rng(2))
    )  # the first tick looks for kernels
    for _ in range(1 + (fuzz > 1)):  # the same ticks twice: what is slow only once is the machine's
        controller.reset()
        rng, failures = np.random.default_rng(14), 0
        for k in range(states):
            state = draw_hostile(robot, rng) if k % 4 or who != "harpy" else draw(robot, rng)
            bad, begin = controller.bad_samples, thread_time_ns()
            command = controller.step(state)
            times[k] = min(times[k], (thread_time_ns() - begin) / 1e3)
            assert np.isfinite(command.torque).all(), k
            assert np.isfinite(command.thrust).all(), k
            if kind != "governed" or "limits" in options:
                assert np.all(np.abs(command.torque) <= robot.torque_limit + ACCEPTED), k
                assert np.all(
                    np.linalg.norm(command.thrust, axis=1) <= robot.thrust_limit + ACCEPTED
                ), k
            if kind == "wbc" and controller.bad_samples == bad:
                failures += not controller.solution.usable
            if kind != "governed":
                searched = max(
                    searched,
                    controller.solution.iterations if kind == "wbc" else controller.solver.steps,
                )
    assert 0.2 < controller.bad_samples / states < 0.6
    p50, p999, worst = np.percentile(times[10:], [50, 99.9, 100])
    print(
        f"{who:8s} {name:26s} {states:7d} ticks, µs: {p50:.1f}, 99.9 % {p999:.1f}, worst "
        f"{worst:.1f}"
    )
    if kind == "wbc":
        assert controller.failures == failures
    if kind != "governed":
        assert searched <= max_systems(controller)
        print(
            f"{'':24s} at most {searched} linear systems in one tick; the searches end after "
            f"{max_systems(controller)}"
        )
