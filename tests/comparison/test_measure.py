"""How it is measured: metrics, replays, interleaving, and checks of solutions. No time is ever
asserted.
"""

import json
from typing import Any

import numpy as np
import pytest

import comparison.measure.replay as replays
import harpy_pin as hp
from comparison.contenders import OWN
from comparison.measure.inside_c import ReplayInsideC
from comparison.measure.replay import WBC_PHASES, TickReplay, WholeBodyChain, replay
from comparison.measure.timing import Bench, TimingSettings, counted, interleave, summarise
from comparison.measure.walking import StateSequence, make_contender, record_states, recorded_walk
from comparison.sections.ticks import make_all, proxqp_replay
from comparison.sections.timing import stationarity, time_parts
from harpy_pin.files import finite
from harpy_pin.kernels import Kernel
from harpy_pin.kernels.calls import Chain

FRICTION = 0.8
RECORDED = ("governed/paper", OWN)


class CountingClock:
    """Advances by 1 ns at its first reading, 2 ns at its second, ..."""

    def __init__(self) -> None:
        self.readings, self.now = 0, 0

    def __call__(self) -> int:
        self.readings += 1
        self.now += self.readings
        return self.now


@pytest.fixture(scope="module")
def sequences() -> list[StateSequence]:
    return [
        record_states(name, recorded_walk(name, friction=FRICTION, duration=0.3), least=1)
        for name in RECORDED
    ]


def test_percentiles_of_known_samples() -> None:
    first, second = np.arange(0, 50_000, 1000), np.arange(50_000, 101_000, 1000)
    expected = {"p50_us": 50.0, "p95_us": 95.0, "p99_us": 99.0, "p99_9_us": 99.9}
    expected |= {"max_us": 100.0, "mean_us": 50.0, "samples": 101}
    assert summarise([first, second]) == pytest.approx(expected)


def test_overhead_is_subtracted_and_never_makes_a_time_negative() -> None:
    summary = summarise([np.array([100, 1100, 2100])], overhead_ns=200.0)
    assert summary["p50_us"] == pytest.approx(0.9)
    assert summary["max_us"] == pytest.approx(1.9)
    assert summary["mean_us"] == pytest.approx((0.0 + 0.9 + 1.9) / 3.0)


def test_finite_makes_anything_valid_json() -> None:
    value = finite(
        {
            "a": np.nan,
            "b": [np.inf, np.float64(1.5)],
            "c": np.bool_(True),
            "d": np.int64(3),
            "e": (None,),
        }
    )
    assert value == {"a": None, "b": [None, 1.5], "c": True, "d": 3, "e": [None]}
    json.dumps(value, allow_nan=False)


def test_every_contender_is_shown_identical_states(
    robot: hp.Robot, sequences: list[StateSequence]
) -> None:
    seen: dict[str, list[hp.State]] = {}
    digest = sequences[0].digest()
    for name in (*RECORDED, "condensed", "wbc"):
        controller = make_contender(name, robot, FRICTION)
        states: list[hp.State] = []
        inner = controller.step

        def spy(state: hp.State, states: list[hp.State] = states, inner: Any = inner) -> Any:
            states.append(state.copy())
            return inner(state)

        controller.step = spy  # type: ignore[method-assign]
        replay(TickReplay(controller), sequences[0].states)
        seen[name] = states
    for name in (*RECORDED, "condensed", "wbc"):
        assert StateSequence(name, tuple(seen[name])).digest() == digest
    assert sequences[0].digest() == digest
    times = [state.t for state in sequences[0].states]
    assert times == sorted(times)


def test_phases_are_exclusive_and_sum_to_the_tick(
    sequences: list[StateSequence], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, states = hp.load_harpy(), sequences[1].states[:40]
    clock = CountingClock()
    monkeypatch.setattr(replays, "perf_counter_ns", clock)
    chain = replay(WholeBodyChain(make_contender("wbc", robot, FRICTION)), states)
    n = len(WBC_PHASES)
    # One reading more than there are phases: each phase begins where the one before ends.
    assert clock.readings == len(states) * (n + 1)
    for i, laps in enumerate(chain.laps):
        first = i * (n + 1) + 1
        assert laps.tolist() == [first + k for k in range(1, n + 1)]
    # The chain is the tick: it leaves nothing out.
    whole = replay(TickReplay(make_contender("wbc", robot, FRICTION)), states)
    np.testing.assert_allclose(chain.commands, whole.commands, atol=1e-6)


def test_replay_in_blocks_equals_replay_in_one_go(sequences: list[StateSequence]) -> None:
    robot, states = hp.load_harpy(), sequences[0].states
    for name in (*RECORDED, "condensed", "wbc"):
        whole = replay(TickReplay(make_contender(name, robot, FRICTION)), states)
        blocks = TickReplay(make_contender(name, robot, FRICTION))
        for _ in range(2):  # the second time shows that start() forgets the first
            blocks.start(states)
            for begin in range(0, len(states), 70):
                blocks.time_block(begin, begin + 70)
        assert np.isfinite(whole.commands).all()
        np.testing.assert_allclose(blocks.commands, whole.commands, atol=1e-6)
        if name != "wbc":  # C cannot call ProxQP
            inside = replay(ReplayInsideC(make_contender(name, robot, FRICTION)), states)
            np.testing.assert_array_equal(inside.commands, whole.commands)


def test_ticks_by_proxqp_and_what_its_own_timer_says_of_them(
    sequences: list[StateSequence],
) -> None:
    robot, states = hp.load_harpy(), sequences[1].states
    timed = replay(proxqp_replay(robot, FRICTION), states)
    whole = replay(TickReplay(make_contender("wbc", robot, FRICTION)), states)
    np.testing.assert_allclose(timed.commands, whole.commands, atol=1e-6)
    assert (timed.laps > 0).all()
    assert np.median(timed.laps) < np.median(whole.laps)


def test_every_tick_is_one_crossing_into_c(
    sequences: list[StateSequence], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One for all controllers whose ticks are compared; where Python calls the solver, more around
    that.
    """
    crossings: list[Any] = []
    for kind in (Kernel, Chain):

        def counted(self: Any, *given: Any, call: Any = kind.__call__) -> Any:
            crossings.append(self)
            return call(self, *given)

        monkeypatch.setattr(kind, "__call__", counted)
    for name, controller in make_all(hp.load_harpy(), FRICTION).items():
        controller.step(sequences[0].states[0])  # joins the kernels
        crossings.clear()
        for state in sequences[0].states[1:20]:
            controller.step(state)
        # Gait, terms and program; ProxQP's rows; after the solver the violation, the limits and the
        # forces; what closes every tick.
        each = {"wbc": 6, "wbc/daqp": 5}.get(name, 1)
        assert len(crossings) == 19 * each, (name, len(crossings))


def test_program_knows_objective_and_violation() -> None:
    """On the nearest point to (2, 3) on x + y = 1 with |x| ≤ 1 and y ≤ ∞: (0, 1)."""
    program = hp.wbc.QuadraticProgram(2, equalities=1, inequalities=0, bounded=2)
    program.hessian[:], program.gradient[:] = np.eye(2), (-2.0, -3.0)
    program.equality[:], program.equality_value[:] = 1.0, 1.0
    program.lower[0], program.upper[0] = -1.0, 1.0
    assert program.objective(np.array([0.0, 1.0])) == pytest.approx(-2.5)
    assert program.violation(np.array([0.0, 1.0])) == 0.0
    assert program.violation(np.array([0.0, 1.5])) == pytest.approx(0.5)
    assert program.violation(np.array([-3.0, 4.0])) == pytest.approx(2.0)


def test_solutions_are_judged_without_the_solver(sequences: list[StateSequence]) -> None:
    controller = make_contender("wbc", hp.load_harpy(), FRICTION)
    controller.step(sequences[1].states[0])
    program, z = controller.problem.program, controller.solution.z.copy()
    assert program.violation(z) < 1e-6
    assert stationarity(program, z) < 1e-6
    wrong = z.copy()
    wrong[-1] += 1.0
    assert stationarity(program, wrong) > 1e-5 or program.violation(wrong) > 0.1


def test_interleaving_reaches_every_piece_once() -> None:
    class Timed:
        def __init__(self) -> None:
            self.played: list[int] = []

        def time_block(self, begin: int, end: int) -> None:
            self.played += range(begin, min(end, 25))

    timed = [Timed(), Timed(), Timed()]
    interleave(timed, 25, block=7, rng=np.random.default_rng(0))
    assert all(timer.played == list(range(25)) for timer in timed)
    mask = counted(25, TimingSettings(warm_up=3, block=7, settle=2))
    assert np.flatnonzero(~mask).tolist() == [0, 1, 2, 7, 8, 14, 15, 21, 22]


def test_a_walk_that_is_too_short_says_so(robot: hp.Robot, sequences: list[StateSequence]) -> None:
    run = recorded_walk("governed/paper", friction=FRICTION, duration=0.05)
    with pytest.raises(hp.InputError, match="50 ticks"):
        record_states("governed", run, least=100)
    settings, rng = TimingSettings(warm_up=10_000), np.random.default_rng(0)
    bench = Bench(robot=robot, friction=FRICTION, settings=settings, rng=rng)
    with pytest.raises(hp.InputError, match="too few"):
        time_parts(bench, sequences)


def test_pushed_walk_is_pushed() -> None:
    runs = {
        impulse: recorded_walk("governed/filter", friction=0.25, duration=0.9, impulse=impulse)
        for impulse in (0.0, 3.0)
    }
    sideways = {impulse: run["v"][:, 1] for impulse, run in runs.items()}
    np.testing.assert_allclose(sideways[0.0][:590], sideways[3.0][:590])
    assert np.abs(sideways[3.0] - sideways[0.0]).max() > 0.1
