"""Harpy's walks on stairs: its feet are set beside risers, and go over them on a way that they can follow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin.compiled import kernel
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.terrain_record import RADIUS, STEEPEST, way_over
from harpy_pin.log.measures import measure
from harpy_pin.simulation.terrain import Stairs

ROBOT = hp.load_harpy()
AWAY = 0.02
"""Distance of a foothold from a riser, m: the margin, less the way on which a riser rises by as much."""
starts = st.floats(0.3, 0.6)
rises = st.sampled_from((0.05, -0.05))


def to_risers(stairs: Stairs, x: float) -> float:
    """Distance of a place from the nearest riser, m; negative on one."""
    begin = stairs.start + stairs.depth * np.arange(stairs.steps)
    return float(np.maximum(begin - x, x - begin - stairs.edge).min())


@kernel
def over(record, x, y):
    return way_over(record[0], x, y)


@given(start=starts, rise=rises)
@settings(max_examples=15, deadline=None)
def test_footholds_keep_their_distance_from_risers(start, rise):
    """That of a foot that carries, after its first swing; it stays in the world, and its walk is that of flat ground
    where no riser is near."""
    stairs = Stairs(rise=rise, depth=0.3, start=start)
    flat, gait = hp.make_gait(ROBOT), OnTerrain(hp.make_gait(ROBOT), stairs)
    at = np.full(2, np.nan)
    for t in np.arange(0.0, 9.0, 0.01):
        plain, target = flat.update(float(t)), gait.update(float(t))
        for k in range(2):
            x = target.body[0] + target.foot_position[k, 0]
            own = plain.body[0] + plain.foot_position[k, 0]
            if not target.stance[k] or t < 1.5:
                at[k] = np.nan
                continue
            assert to_risers(stairs, x) > AWAY - 1e-9
            assert abs(x - own) <= (0.035 if to_risers(stairs, own) < 0.025 else 1e-9)
            assert np.isnan(at[k]) or x == pytest.approx(at[k], abs=1e-9)
            at[k] = x


def test_feet_move_as_their_velocities_say():
    """Beside a riser, too, along the ground: places are the integral of velocities, these of accelerations."""
    stairs, step = Stairs(rise=0.05, depth=0.3, start=0.47), 1e-4
    gait = OnTerrain(hp.make_gait(ROBOT), stairs)
    rows = []
    for t in np.arange(0.5, 4.0, step):
        target = gait.update(float(t))
        moving = target.foot_velocity + target.body[3:6]
        rows.append((target.foot_position + target.body[:3], moving, target.foot_acceleration + target.body[6:9]))
    place, velocity, acceleration = (np.array(part) for part in zip(*rows, strict=True))
    for value, rate in ((place, velocity), (velocity, acceleration)):
        sums = step * np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0)
        np.testing.assert_allclose((value[1:] - value[0])[..., :2], sums[..., :2], atol=5e-3)
    drops = np.abs(np.diff(place[..., 2], axis=0)).max()
    assert drops < 2.5 * step  # no jumps: 2.5 m/s


@given(x=st.floats(0.2, 1.4), start=starts, rise=rises)
@settings(max_examples=60, deadline=None)
def test_the_way_over_steps_is_the_lowest_that_is_not_too_steep(x, start, rise):
    """Against the definition, looked up at many places."""
    stairs = Stairs(rise=rise, depth=0.3, start=start)
    dx = np.linspace(-RADIUS, RADIUS, 24001)
    around = stairs.height(x + dx, 0.0 * dx)
    assert over(stairs.record, x, 0.0)[0] == pytest.approx((around - STEEPEST * np.abs(dx)).max(), abs=2e-4)


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
@pytest.mark.parametrize("rise", [0.05, -0.05])
def test_harpy_slips_little_on_stairs_wherever_they_begin(plant, rise):
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    for start in (0.5, 0.52, 0.56, 0.58):
        stairs = Stairs(rise=rise, depth=0.3, start=start, steps=4)
        run = hp.walk(hp.Scenario(ground=hp.Ground(terrain=stairs, mu_s=0.6), duration=7.0, plant=plant))
        assert run.ending == "completed"
        assert measure(run).slip_mm_per_step < 1.0


@pytest.mark.parametrize(("rise", "start"), [(0.05, 0.59), (-0.05, 0.59), (-0.05, 0.74)])
def test_a_commanded_walk_keeps_off_risers_and_stops_on_stairs(rise, start):
    stairs = Stairs(rise=rise, depth=0.3, start=start, steps=10)
    gait = OnTerrain(hp.make_commanded_gait(ROBOT, [(0.0, 0.3, 0.0, 0.05), (7.0, 0.0, 0.0, 0.0)]), stairs)
    run = hp.walk(hp.Scenario(ground=hp.Ground(terrain=stairs, mu_s=0.6), duration=11.0), gait=gait)
    assert run.ending == "completed"
    assert measure(run).slip_mm_per_step < 1.0
    assert not gait.gait.walking
    assert 1.5 < run["q"][-1, 0] < 3.0
    place, loaded = run["foot_position"][::20], np.abs(run["foot_force"][::20]).max(axis=2) > 1.0
    assert min(to_risers(stairs, x) for x in place[..., 0][loaded]) > AWAY - 0.01


def test_a_clock_that_goes_back_begins_anew():
    stairs = Stairs(rise=0.05, depth=0.3, start=0.47)
    gait, new = OnTerrain(hp.make_gait(ROBOT), stairs), OnTerrain(hp.make_gait(ROBOT), stairs)
    for t in np.arange(0.0, 5.0, 0.05):
        gait.update(float(t))
    for t in np.arange(0.0, 2.0, 0.05):
        a, b = gait.update(float(t)), new.update(float(t))
        np.testing.assert_array_equal(a.foot_position, b.foot_position)
