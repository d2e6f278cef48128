"""Walks on points over stairs and rough ground: where feet are set, what they clear, and where the
robot arrives.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.terrain_targets import MARGIN, fit_plane
from harpy_pin.ground.surface import greatest_rise
from harpy_pin.ground.terrain import Plane, Rough, Stairs
from harpy_pin.log.measures import measure

UPSTAIRS = Stairs(rise=0.08, depth=0.3, steps=4, start=0.5)


def climbed(terrain: Stairs, **part) -> hp.Run:
    ground = hp.Ground(terrain=terrain, mu_s=0.6, stiffness=75e3)
    gait = hp.Walking(velocity=(0.4, 0.0, 0.0))
    return hp.walk(
        hp.Scenario(**{"robot": "go2", "ground": ground, "gait": gait, "duration": 6.5, **part})
    )


@needs_robots
@pytest.mark.parametrize(
    ("rise", "part"),
    [(0.08, {}), (-0.08, {}), (0.08, {"plant": "mujoco"}), (0.08, {"controller": "wbc"})],
    ids=["up", "down", "mujoco", "wbc"],
)
def test_go2_walks_stairs(rise, part):
    """Four steps of 8 cm; behind them its body is as high above the last tread as it was above the
    ground.
    """
    if part.get("plant") == "mujoco":
        pytest.importorskip("mujoco")
    stairs = Stairs(rise=rise, depth=0.3, steps=4, start=0.5)
    run = climbed(stairs, **part)
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 0.5 + 4 * 0.3 + 0.25  # its hind feet are up, too
    assert run["q"][-1, 2] - run["q"][0, 2] == pytest.approx(4 * rise, abs=0.02)
    assert measure(run).slip_mm_per_step < 3.0


@needs_robots
def test_feet_stand_on_treads_and_clear_the_steps():
    """A loaded foot is away from every riser; a swing foot is nowhere below the ground."""
    run = climbed(UPSTAIRS)
    x, y, z = np.moveaxis(run["foot_position"][::5], 2, 0)
    assert (z > UPSTAIRS.height(x, y) - 0.01).all()
    loaded = np.abs(run["foot_force"][::5]).max(axis=2) > 10.0
    risers = UPSTAIRS.start + UPSTAIRS.depth * np.arange(UPSTAIRS.steps)
    away = np.maximum(risers - x[loaded, None], x[loaded, None] - risers - UPSTAIRS.edge)
    assert away.min() > 0.4 * MARGIN  # knees reach their ends as they are pulled up


@needs_robots
@pytest.mark.parametrize("start", [0.52, 0.56, 0.6])
def test_go2_goes_down_wherever_stairs_begin(start):
    run = climbed(Stairs(rise=-0.08, depth=0.3, steps=3, start=start), duration=5.5)
    assert run.ending == "completed"
    assert measure(run).slip_mm_per_step < 0.1


@needs_robots
def test_steps_last_as_long_as_lifting_a_foot_takes():
    """From rest to rest over h in a time t the least peak of a quintic's acceleration is 10 h / (√3
    t²).
    """
    gait = hp.WalkingGait(hp.load_robot("go2"))
    flat = gait.step_duration
    over = OnTerrain(gait, UPSTAIRS)
    assert over.step_duration == gait.step_duration > flat
    way = 0.08 + float(gait.record["pace"]["clearance"][0])
    time = gait.parameters.apex * (1.0 - gait.double_support) * over.step_duration
    assert 10.0 * way / (np.sqrt(3.0) * time**2) == pytest.approx(
        gait.parameters.lift_acceleration, rel=1e-4
    )
    assert OnTerrain(hp.WalkingGait(hp.load_robot("go2")), Plane(slope=0.3)).step_duration == flat


def test_the_greatest_rise_is_that_of_the_steps_in_reach():
    assert greatest_rise(Stairs(rise=0.08, depth=0.3, steps=3).record, 0.2) == pytest.approx(0.08)
    assert greatest_rise(Stairs(rise=-0.08, depth=0.3, steps=3).record, 0.4) == pytest.approx(0.16)
    assert greatest_rise(Plane(slope=0.4).record, 0.2) == 0.0
    rough = Rough(amplitude=0.03, seed=2)
    assert greatest_rise(rough.record, 0.2) == pytest.approx(np.ptp(rough.record["grid"]))


@given(x=st.floats(-0.5, 4.0), slope=st.floats(-0.3, 0.3))
@settings(max_examples=50, deadline=None)
def test_the_body_follows_the_line_nearest_to_the_steps(x, slope):
    """Against a fit to many samples."""
    gait = OnTerrain(hp.make_gait(hp.load_harpy()), UPSTAIRS)
    record = gait._record
    record["terrain"]["slope"][0] = (slope, 0.1)
    reach = float(record["reach"][0])
    height, along, across = fit_plane(record["terrain"], x, 0.2, reach)
    samples = x + reach * (np.arange(-5000, 5000) + 0.5) / 5000
    heights = UPSTAIRS.height(samples, 0.0 * samples) + slope * samples + 0.1 * 0.2
    line = np.polynomial.polynomial.polyfit(samples - x, heights, 1)
    np.testing.assert_allclose((height, along), line, atol=1e-4)
    assert across == pytest.approx(0.1)
