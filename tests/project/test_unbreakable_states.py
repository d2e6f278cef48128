"""Random states through every controller and governor, every tenth of them spoiled; and hostile ones.

``--fuzz 100 -s`` is 100,000 states for each, and prints how long ticks take. With ``-k hostile`` these are states of
any size, half of them spoiled, for point feet (Harpy, Solo12) and flat ones (G1, Talos).
"""

from __future__ import annotations

import gc
from time import perf_counter_ns, thread_time_ns

import numpy as np
import pytest
from hostile_states import draw_hostile
from long import long_but
from random_states import draw

import harpy_pin as hp
from harpy_pin.model.catalogue import installed_data
from harpy_pin.wbc import FORMULATIONS, installed_solvers
from harpy_pin.wbc.active_set_warm_start import EXCHANGES
from harpy_pin.wbc.qp_solver import ACCEPTED

STATES = 1000
MU = 0.25


def spoil(rng, arrays):
    """One number of some arrays, in place."""
    array = arrays[rng.integers(len(arrays))].reshape(-1)
    array[rng.integers(array.size)] = (np.nan, np.inf, -np.inf)[rng.integers(3)]


class Clocks:
    """Time of every call on the wall and in this thread, µs: the rest of the machine is in the first alone."""

    def __init__(self):
        self.wall, self.thread = [], []

    def call(self, function, *arguments):
        thread, wall = thread_time_ns(), perf_counter_ns()
        result = function(*arguments)
        self.wall.append((perf_counter_ns() - wall) / 1e3)
        self.thread.append((thread_time_ns() - thread) / 1e3)
        return result

    def show(self, name):
        parts = [f"{name:24s} {len(self.wall):7d} ticks, µs"]
        for clock in ("wall", "thread"):
            p50, p999, worst = np.percentile(getattr(self, clock)[10:], [50, 99.9, 100])
            parts.append(f"{clock}: p50 {p50:.1f}, p99.9 {p999:.1f}, max {worst:.1f}")
        print("; ".join(parts))


CONTROLLERS = {
    "none": ("governed", {"governor": "none"}),
    "paper": ("governed", {"governor": "paper"}),
    "paper, tracked": ("governed", {"governor": "paper", "evaluate_at": "tracked"}),
    "filter": ("governed", {"governor": "filter"}),
    "contact, limits": ("governed", {"governor": "filter", "limits": True}),
    "wbc": ("wbc", {}),
    "wbc, full": ("wbc", {"formulation": "full"}),
    "wbc, daqp": ("wbc", {"solver": "daqp"}),
    "condensed": ("condensed", {}),
}


@pytest.mark.parametrize("name", tuple(CONTROLLERS))
def test_controllers(name, robot, fuzz):
    """Every command is of finite numbers, within the limits where there are some; every failure is counted."""
    rng = np.random.default_rng(11)
    kind, options = CONTROLLERS[name]
    controller = hp.make_controller(kind, hp.make_gait(robot), mu=MU, **options)
    limited = kind != "governed" or "limits" in options
    failures, bad, clocks = 0, 0, Clocks()
    for k in range(STATES * fuzz):
        state = draw(robot, rng)
        spoiled = k % 10 == 9
        if spoiled:
            spoil(rng, [state.q, state.v, state.foot_force])
            bad += 1
        command = clocks.call(controller.step, state)
        assert np.isfinite(command.torque).all(), k
        assert np.isfinite(command.thrust).all(), k
        if limited:
            assert np.all(np.abs(command.torque) <= robot.torque_limit + 1e-6), k
            assert np.all(np.linalg.norm(command.thrust, axis=1) <= robot.thrust_limit + 1e-6), k
        if kind == "wbc" and not spoiled:
            failures += not controller.solution.usable
    assert controller.bad_samples == bad
    if kind == "wbc":
        assert controller.failures == failures > 0
    clocks.show(name)


def most_systems(controller):
    """Linear systems after which the searches of a tick end: by active sets, then by the dual method."""
    if isinstance(controller, hp.WholeBodyController):
        return 2 * (EXCHANGES + 1) + controller._solver.dual.limit
    searches = [controller.solver.record[name][0] for name in ("free", "limited")]
    return sum(EXCHANGES + 1 + int(search["dual"]["limit"]) for search in searches)


UNUSUAL = ("piqp", "osqp", "clarabel", "quadprog", "proxqp")
HOSTILE = [("harpy", name) for name in ("none", "paper", "filter")]
HOSTILE += [(robot, name) for robot in ("harpy", "solo12", "g1", "talos") for name in ("wbc", "condensed")]
OTHERS = [f"{formulation}, {solver}" for formulation in FORMULATIONS for solver in installed_solvers()]
"""Formulations of the whole-body QP, with the solver that is its last resort."""
HOSTILE += [(robot, name) for robot in ("harpy", "solo12", "g1") for name in OTHERS]
CONTROLLERS |= {name: ("wbc", dict(zip(("formulation", "solver"), name.split(", "), strict=True))) for name in OTHERS}


def is_long(who, name):
    """Kernels are compiled for each size of robot; most solvers are a last resort of rare ticks."""
    return who == "talos" or name.endswith(UNUSUAL)


@pytest.fixture(scope="module")
def table():
    """Rows of what was timed, printed at the end."""
    rows = []
    yield rows
    if rows:
        print("\n\nthread time of a tick, µs")
        print(f"{'robot':8s} {'controller':26s} {'ticks':>7s} {'median':>7s} {'99.9 %':>7s} {'worst':>7s}  over 2 ms")
    for who, name, times in rows:
        p50, p999, worst = np.percentile(times, [50, 99.9, 100])
        late = int((np.array(times) > 2000.0).sum())
        print(f"{who:8s} {name:26s} {len(times):7d} {p50:7.1f} {p999:7.1f} {worst:7.1f}  {late}")


@pytest.fixture
def no_collection():
    """No pause for Python's garbage, as in a loop in real time."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_collection")
@pytest.mark.parametrize(("who", "name"), long_but(HOSTILE, [case for case in HOSTILE if not is_long(*case)]))
def test_hostile_states(who, name, fuzz, table):
    """No exception, and every command of finite numbers within the limits; the time is printed, never asserted."""
    if who != "harpy" and installed_data() is None:
        pytest.skip("the robots are an extra: pip install 'harpy-pin[robots]'")
    robot = hp.load_robot(who) if who != "harpy" else hp.load_harpy()
    gait = hp.Standing(robot) if who != "harpy" else hp.make_gait(robot)
    kind, options = CONTROLLERS[name]
    controller = hp.make_controller(kind, gait, mu=MU, **options)
    rng, clocks, searched = np.random.default_rng(14), Clocks(), 0
    states = STATES * fuzz if fuzz > 1 or who == "harpy" else STATES // 3
    controller.step(draw_hostile(robot, np.random.default_rng(2)))  # the first tick looks for kernels
    controller.reset()
    for k in range(states):
        command = clocks.call(controller.step, draw_hostile(robot, rng))
        assert np.isfinite(command.torque).all(), k
        assert np.isfinite(command.thrust).all(), k
        if kind != "governed":
            assert np.all(np.abs(command.torque) <= robot.torque_limit + ACCEPTED), k
            systems = controller.solution.iterations if kind == "wbc" else controller.solver.systems
            searched = max(searched, systems)
    assert 0.2 < controller.bad_samples / states < 0.6
    clocks.show(f"{who}, {name}")
    table.append((who, name, clocks.thread[10:]))
    if kind != "governed":
        bound = most_systems(controller)
        assert searched <= bound or controller._solver.fallback_solves
        print(f"{'':24s} at most {searched} linear systems in one tick; the searches end after {bound}")
