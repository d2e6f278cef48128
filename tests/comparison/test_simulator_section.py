"""The comparison's section on the simulator: its document, its tables, and MuJoCo's absence. No time is asserted."""

from __future__ import annotations

import json
from typing import Any

import mujoco
import numpy as np
import pytest

import comparison.sections.simulator_speed as section
from comparison.contenders import label
from comparison.measure.interleave import Bench, TimingSettings
from harpy_pin import Ground, Robot, Simulator, load_harpy, make_gait
from harpy_pin.model.state import Command
from harpy_pin.simulation.mujoco import MujocoModel, installed_version

SETTINGS = TimingSettings(repetitions=2)


def bench(friction: float, **more: Any) -> Bench:
    return Bench(robot=load_harpy(), friction=friction, settings=SETTINGS, rng=np.random.default_rng(0), **more)


@pytest.fixture(scope="module")
def entry() -> dict[str, Any]:
    pieces: list[int] = []
    result = section.time_simulator(bench(0.8, on_pass=lambda: pieces.append(1)), duration=0.1)
    assert len(pieces) == section.count_pieces(SETTINGS)
    return result


def test_section_has_its_shape(entry: dict[str, Any]) -> None:
    step = entry["step"]
    counted = 5 * 2 * (section.BLOCK - section.SETTLE)  # blocks in 100 ticks, two steps a tick
    for name in ("ours", "MuJoCo"):
        assert {"p50_us", "p95_us", "p99_us"} <= step[name].keys()
        assert step[name]["samples"] == SETTINGS.repetitions * counted
        assert 1.0 <= step[name]["contacts_mean"] <= 2.0
        assert step[name]["deviation_mm"] < 1.0  # both go where the walk went
    assert step["dt_s"] == 5e-4
    assert step["MuJoCo"]["version"] == mujoco.__version__ == installed_version()
    assert len(step["ratio"]["repetitions"]) == SETTINGS.repetitions
    assert entry["walk"].keys() == set(section.WALKERS) >= {"governed/none", "governed/filter", "wbc"}
    for row in entry["walk"].values():
        assert row["ending"] == "completed"
        assert 0.0 < row["low"] <= row["real_time"] <= row["high"]
    assert {"controller tick", "physics steps", "log", "rest"} <= entry["profile"].keys()
    json.dumps(entry, allow_nan=False)


def test_section_is_in_the_whole_document(whole_document: dict[str, Any]) -> None:
    assert whole_document["simulator"]["step"]["ours"]["samples"] > 0


def test_tables(entry: dict[str, Any]) -> None:
    step, walk, profile = section.simulator_tables(entry)
    assert step.number("ours", "p50") == entry["step"]["ours"]["p50_us"]
    assert step.number("ours / MuJoCo", "p50") == entry["step"]["ratio"]["p50"]
    assert f"MuJoCo {mujoco.__version__}" in step.note
    assert "soft contact" in step.note
    assert walk.rows == [label(name) for name in section.WALKERS]
    assert profile.rows == list(entry["profile"])


def test_absent_mujoco_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harpy_pin.simulation.mujoco.mujoco_model.find_spec", lambda name: None)
    monkeypatch.setattr(section, "WALKERS", ("governed/paper",))
    assert installed_version() is None
    entry = section.time_simulator(bench(0.25), duration=0.05)
    assert "not installed" in entry["step"]["MuJoCo"]["absent"]
    assert entry["step"]["ours"]["samples"] > 0
    table = section.simulator_tables(entry)[0]
    assert "MuJoCo was not timed: mujoco is not installed" in table.note
    cell = table.get("MuJoCo", "p50")
    assert cell is not None
    assert cell.value is None


def standing(robot: Robot) -> tuple[Simulator, MujocoModel]:
    gait = make_gait(robot, speed=0.0)
    simulator = Simulator(robot, Ground(mu_s=0.8))
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    peer = MujocoModel(robot, friction=0.8, dt=simulator.dt, gravity=simulator.gravity, foot_radius=section.FOOT_RADIUS)
    peer.reset(simulator.q, simulator.v)
    return simulator, peer


def test_peer_is_the_same_robot(robot: Robot) -> None:
    _, peer = standing(robot)
    assert (peer.model.nq, peer.model.nv) == (13, 12)
    assert peer.model.body_mass.sum() == pytest.approx(robot.mass)
    assert peer.model.opt.timestep == 5e-4
    np.testing.assert_array_equal(peer.model.dof_armature, robot.model.armature)
    np.testing.assert_array_equal(peer.model.dof_damping, robot.model.damping)


def test_peer_flies_as_ours_under_the_same_command(robot: Robot) -> None:
    """Without contact both integrate the same equations: torques and thrusts arrive where they should."""
    simulator, peer = standing(robot)
    q, v = simulator.q.copy(), np.linspace(-0.3, 0.3, 12)
    q[2] += 1.0
    q[3:7] = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
    command = Command(np.linspace(-1.0, 1.0, 6), np.array([[1.0, -2.0, 12.0], [-3.0, 1.0, 18.0]]))
    simulator.reset(q, v)
    peer.reset(q, v)
    for _ in range(20):
        simulator.advance(command)
        peer.apply(command.torque, command.thrust)
        mujoco.mj_step(peer.model, peer.data)
    ours = np.concatenate((simulator.q[:3], simulator.q[[6, 3, 4, 5]], simulator.q[7:]))
    moved = np.abs(ours - np.concatenate((q[:3], q[[6, 3, 4, 5]], q[7:]))).max()
    assert moved > 1e-2
    # Two integrators of order one: they differ by the order of dt times the way.
    assert np.abs(ours - peer.data.qpos).max() < 0.02 * moved


def test_peer_stands_on_its_feet_only(robot: Robot) -> None:
    simulator, peer = standing(robot)
    q = simulator.q.copy()
    mujoco.mj_forward(peer.model, peer.data)
    assert peer.data.ncon == len(robot.feet)
    q[2] += 0.02
    peer.reset(q, simulator.v)
    mujoco.mj_forward(peer.model, peer.data)
    assert peer.data.ncon == 0
