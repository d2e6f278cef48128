"""The comparison: metrics, replays, checks, the document and the command line. No time is ever asserted."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from comparison.cli import app, main
from comparison.measure import tick_replay
from comparison.measure.controllers import CONTENDERS, make_contender, make_governed, make_whole_body
from comparison.measure.interleave import Bench, TimingSettings
from comparison.measure.states import StateSequence, draw_push, record_states, walk
from comparison.measure.statistics import ratio_of_medians, summarise
from comparison.measure.tick_replay import (
    GOVERNED_PHASES,
    WBC_PHASES,
    GovernedChain,
    TickReplay,
    WholeBodyChain,
    replay,
)
from comparison.measure.verification import is_feasible, one_sided, stationarity
from comparison.sections.timing import time_contenders
from harpy_pin import InputError, RunFileError, State, load_harpy
from harpy_pin.files import finite, write_json
from harpy_pin.wbc import QuadraticProgram

ROOT = Path(__file__).resolve().parents[2]

FRICTION = 0.8


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
    return [record_states(name, walk(name, friction=FRICTION, duration=0.3), least=1) for name in ("governed", "wbc")]


def test_percentiles_of_known_samples() -> None:
    first, second = np.arange(0, 50_000, 1000), np.arange(50_000, 101_000, 1000)
    summary = summarise([first, second])
    assert summary["p50_us"] == pytest.approx(50.0)
    assert summary["p95_us"] == pytest.approx(95.0)
    assert summary["p99_us"] == pytest.approx(99.0)
    assert summary["p99_9_us"] == pytest.approx(99.9)
    assert summary["max_us"] == pytest.approx(100.0)
    assert summary["mean_us"] == pytest.approx(50.0)
    assert summary["samples"] == 101


def test_overhead_is_subtracted_and_never_makes_a_time_negative() -> None:
    summary = summarise([np.array([100, 1100, 2100])], overhead_ns=200.0)
    assert summary["p50_us"] == pytest.approx(0.9)
    assert summary["max_us"] == pytest.approx(1.9)
    assert summary["mean_us"] == pytest.approx((0.0 + 0.9 + 1.9) / 3.0)


def test_ratio_of_medians_and_its_spread() -> None:
    ratio = ratio_of_medians([np.array([10, 20, 30]), np.array([40, 40, 40])], [np.array([10] * 3), np.array([8] * 3)])
    assert ratio["repetitions"] == pytest.approx([2.0, 5.0])
    assert (ratio["min"], ratio["max"]) == pytest.approx((2.0, 5.0))
    assert ratio["p50"] == pytest.approx(3.5)
    assert ratio["pooled"] == pytest.approx(35.0 / 9.0)


def test_finite_makes_anything_valid_json() -> None:
    value = finite(
        {"a": np.nan, "b": [np.inf, np.float64(1.5)], "c": np.bool_(True), "d": np.int64(3), "e": (None, "x")}
    )
    assert value == {"a": None, "b": [None, 1.5], "c": True, "d": 3, "e": [None, "x"]}
    json.dumps(value, allow_nan=False)


def test_every_contender_is_shown_identical_states(sequences: list[StateSequence]) -> None:
    robot = load_harpy()
    seen: dict[str, list[State]] = {}
    digest = sequences[0].digest()
    for name in CONTENDERS:
        controller = make_contender(name, robot, FRICTION)
        states: list[State] = []
        inner = controller.step

        def spy(state: State, states: list[State] = states, inner: Any = inner) -> Any:
            states.append(state.copy())
            return inner(state)

        controller.step = spy  # type: ignore[method-assign]
        replay(TickReplay(controller), sequences[0].states)
        seen[name] = states
    for name in CONTENDERS:
        assert StateSequence(name, tuple(seen[name])).digest() == digest
    assert sequences[0].digest() == digest
    times = [state.t for state in sequences[0].states]
    assert times == sorted(times)


@pytest.mark.parametrize(
    ("make", "timer", "phases"),
    [(make_governed, GovernedChain, GOVERNED_PHASES), (make_whole_body, WholeBodyChain, WBC_PHASES)],
)
def test_phases_are_exclusive_and_sum_to_the_tick(
    sequences: list[StateSequence], make: Any, timer: Any, phases: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, states = load_harpy(), sequences[1].states[:40]
    clock = CountingClock()
    monkeypatch.setattr(tick_replay, "perf_counter_ns", clock)
    chain = replay(timer(make(robot, FRICTION)), states)
    n = len(phases)
    # One reading more than there are phases: each phase begins where the one before ends.
    assert clock.readings == len(states) * (n + 1)
    for i, laps in enumerate(chain.laps):
        first = i * (n + 1) + 1
        assert laps.tolist() == [first + k for k in range(1, n + 1)]
    # The chain is the tick: it leaves nothing out.
    whole = replay(TickReplay(make(robot, FRICTION)), states)
    np.testing.assert_allclose(chain.commands, whole.commands, atol=1e-6)


def test_replay_in_blocks_equals_replay_in_one_go(sequences: list[StateSequence]) -> None:
    robot, states = load_harpy(), sequences[0].states
    for name in CONTENDERS:
        whole = replay(TickReplay(make_contender(name, robot, FRICTION)), states)
        blocks = TickReplay(make_contender(name, robot, FRICTION))
        for _ in range(2):  # the second time shows that start() forgets the first
            blocks.start(states)
            for begin in range(0, len(states), 70):
                blocks.time_block(begin, begin + 70)
        assert np.isfinite(whole.commands).all()
        np.testing.assert_allclose(blocks.commands, whole.commands, atol=1e-6)


def test_program_knows_objective_violation_and_one_sided_form() -> None:
    """On the nearest point to (2, 3) on x + y = 1 with |x| ≤ 1 and y ≤ ∞: (0, 1)."""
    program = QuadraticProgram(2, equalities=1, inequalities=0, bounded=2)
    program.hessian[:], program.gradient[:] = np.eye(2), (-2.0, -3.0)
    program.equality[:], program.equality_value[:] = 1.0, 1.0
    program.lower[0], program.upper[0] = -1.0, 1.0
    assert program.objective(np.array([0.0, 1.0])) == pytest.approx(-2.5)
    assert program.violation(np.array([0.0, 1.0])) == 0.0
    assert program.violation(np.array([0.0, 1.5])) == pytest.approx(0.5)
    assert program.violation(np.array([-3.0, 4.0])) == pytest.approx(2.0)
    g, h = one_sided(program)
    np.testing.assert_array_equal(g, [[1.0, 0.0], [-1.0, 0.0]])
    np.testing.assert_array_equal(h, [1.0, 1.0])


def test_solutions_are_judged_without_the_solver(sequences: list[StateSequence]) -> None:
    controller = make_whole_body(load_harpy(), FRICTION)
    controller.step(sequences[1].states[0])
    program, z = controller.problem.program, controller.solution.z.copy()
    assert program.violation(z) < 1e-6
    assert stationarity(program, z) < 1e-6
    assert is_feasible(program)
    wrong = z.copy()
    wrong[-1] += 1.0
    assert stationarity(program, wrong) > 1e-5 or program.violation(wrong) > 0.1
    carrying = program.bounded + 4
    program.lower[carrying], program.upper[carrying] = 1e3, 1e4  # more normal force than torques can bear
    program.lower[:6], program.upper[:6] = 0.0, 0.0
    assert not is_feasible(program)


def test_a_walk_that_is_too_short_says_so(sequences: list[StateSequence]) -> None:
    robot = load_harpy()
    run = walk("governed", friction=FRICTION, duration=0.05)
    with pytest.raises(InputError, match="50 ticks"):
        record_states("governed", run, least=100)
    settings, rng = TimingSettings(warm_up=10_000), np.random.default_rng(0)
    bench = Bench(robot=robot, friction=FRICTION, settings=settings, rng=rng)
    with pytest.raises(InputError, match="too few"):
        time_contenders(bench, sequences)
    with pytest.raises(InputError, match="valid names: condensed, governed, ungoverned, wbc"):
        make_contender("mpc", robot, FRICTION)


def test_pushes_follow_the_seed() -> None:
    push = draw_push(np.random.default_rng(3), 0.2)
    assert np.linalg.norm(push) == pytest.approx(0.2)
    np.testing.assert_array_equal(push, draw_push(np.random.default_rng(3), 0.2))


def test_document_has_its_schema(whole_document: dict[str, Any]) -> None:
    document = whole_document
    for condition in ("", "_low_friction"):
        timing = document[f"timing{condition}"]
        desired = {
            "ungoverned": {"tick"},
            "governed": {"tick", "chain", "governor_alone", "governor_alone_violated", *GOVERNED_PHASES},
            "condensed": {"tick"},
            "wbc": {"tick", "chain", "solve_alone", "solve_alone_proxqp", *WBC_PHASES},
        }
        for name, phases in desired.items():
            assert phases <= timing[name].keys()
            for row in timing[name].values():
                assert {"p50_us", "p95_us", "p99_us", "max_us", "mean_us", "samples"} <= row.keys()
                assert row["samples"] > 0
        assert {"p50", "min", "max", "repetitions"} <= timing["ratio"].keys()
        assert len(timing["ratio"]["repetitions"]) == 2
        walks = document[f"walk{condition}"]
        assert walks.keys() == set(CONTENDERS)
        for measures in walks.values():
            assert {"fell", "distance_m", "slip_mm_per_step", "late_slip_mm_per_step"} <= measures.keys()
            for share in ("sliding", "low_force", "no_contact"):
                assert 0.0 <= measures[share] <= 1.0
        assert document[f"walk_pushed{condition}"]["wbc"]["walks"] == 1
        checks = document[f"checks{condition}"]
        assert checks["passed"] is True
        for activity in document[f"activity{condition}"].values():
            assert activity["strained_rows_violated"] > 0.9
        assert checks["commands_differing"] == sum(checks["commands_differing_by_controller"].values())
        assert checks["commands_differing_by_controller"]["governed"] == 0
        assert checks["commands_differing_by_controller"]["condensed"] == 0
        assert checks["commands_compared"] == 2 * 2 * 6 * 250  # repetitions, sequences, replays, ticks
        assert checks["qp_solves"] == 2 * 250
    assert document["settings"]["friction"] == 0.8
    assert document["machine"]["cpu"]
    assert document["versions"]["pin"] != "not installed"
    assert len(document["limitations"]) > 5


def test_document_is_written_as_it_is(whole_document: dict[str, Any], tmp_path: Path) -> None:
    document = whole_document
    path = tmp_path / "comparison.json"
    write_json(path, document)
    assert json.loads(path.read_text(encoding="utf-8")) == document
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(RunFileError, match="cannot write"):
        write_json(tmp_path / "missing" / "x.json", document)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--json", "{tmp}/missing/x.json"), "no folder"),
        (("--json", "{tmp}"), "it is a folder"),
        (("--friction", "-0.5"), "friction must be finite"),
        (("--duration", "nan"), "duration must be finite"),
        (("--duration", "0.01"), "duration must be finite and"),
        (("--seed", "-1"), "seed must be"),
        (("diff", "{tmp}/none.json", "{tmp}/none.json"), "cannot read"),
    ],
)
def test_command_line_errors_are_one_line(
    arguments: Sequence[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["comparison", *(a.replace("{tmp}", str(tmp_path)) for a in arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1


def test_what_is_not_installed_is_one_line() -> None:
    script = "import runpy, sys; sys.modules['pandas'] = None; runpy.run_module('comparison', run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr == "error: the comparison needs 'pandas': pip install -e '.[compare]'\n"


def test_command_line_help() -> None:
    done = CliRunner().invoke(app, ["--help"])
    assert done.exit_code == 0
    for option in ("--quick", "--json", "--seed", "--friction", "--duration", "Example"):
        assert option in done.stdout
