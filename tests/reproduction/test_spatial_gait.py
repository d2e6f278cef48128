"""A planar gait walked in space."""

import numpy as np
import pytest
from planar_targets import targets

import harpy_pin as hp
from harpy_pin.errors import InputError
from reproduction.gait.planar_gait import PlanarGait
from reproduction.gait.spatial import GAITS, SpatialGait, make_named_gait


def test_spatial_gait_has_the_planar_feet(robot, packaged):
    gait = SpatialGait(robot, packaged.gait)
    planar = packaged.gait
    for t in np.linspace(0.0, 3.0, 31):
        target = gait.update(t)
        position, velocity, stance = targets(planar, t)
        np.testing.assert_allclose(target.foot_position[:, [0, 2]], position, atol=1e-12)
        np.testing.assert_allclose(target.foot_velocity[:, [0, 2]], velocity, atol=1e-11)
        np.testing.assert_allclose(
            target.foot_position[:, 1] + target.body[1], [0.1, -0.1], atol=1e-12
        )
        np.testing.assert_array_equal(target.stance, stance[:, 0])
        np.testing.assert_array_equal(target.world_frame_blend, 0.0)


def test_planar_reference_is_periodic_and_its_own_derivative(robot, packaged, ground):
    gait = SpatialGait(robot, packaged.gait, reference="planar", settle=6, friction=ground.mu_s)
    for t in np.linspace(0.05, 1.4, 9):
        here = gait.update(t).body.copy()
        later = gait.update(t + 1.5).body.copy()
        h = 5e-3
        ahead, behind = gait.update(t + h).body.copy(), gait.update(t - h).body.copy()
        np.testing.assert_allclose(later[2:6], here[2:6], atol=1e-9)
        assert later[0] - here[0] == pytest.approx(1.5 * 0.3, abs=0.05)
        np.testing.assert_allclose(here[[3, 5]], (ahead - behind)[[0, 2]] / (2 * h), atol=0.08)


def test_in_space_it_falls_without_thrusters_and_walks_with_them(robot, packaged, ground):
    """The paper's claim: the planar gait is not stable in space without thrusters (equations.md
    Q4).
    """
    endings = []
    for thrust in (False, True):
        controller = hp.Governed(governor="none", thrust=thrust)
        scenario = hp.Scenario(controller=controller, ground=ground, duration=3.0)
        endings.append(hp.walk(scenario, gait=SpatialGait(robot, packaged.gait)).ending)
    assert endings == ["fell", "completed"]


@pytest.mark.parametrize("governor", ["none", "paper"])
def test_in_space_at_the_papers_friction(robot, packaged, ground, governor):
    """No fall, 0.3 m/s ± 5 %, upright within 0.15 rad, at most 8 mm of slip per step."""
    gait = SpatialGait(robot, packaged.gait, reference="planar")
    scenario = hp.Scenario(controller=hp.Governed(governor=governor, mu=0.25), ground=ground)
    measures = hp.measure(hp.walk(scenario, gait=gait))
    assert measures.ending == "completed"
    assert measures.distance_m / measures.duration_s == pytest.approx(0.3, rel=0.05)
    assert max(measures.roll_max_rad, measures.pitch_max_rad, measures.yaw_max_rad) <= 0.15
    assert measures.slip_mm_per_step <= 8.0


def test_optimised_gait_under_the_papers_governor(robot):
    """Ten seconds at the paper's friction: speed, angles, slip, and the normal force against no
    governor's.
    """
    found = {}
    for governor in ("none", "paper"):
        scenario = hp.Scenario(
            controller=hp.Governed(governor=governor), ground=hp.Ground(mu_s=0.25), duration=10.0
        )
        found[governor] = hp.measure(hp.walk(scenario, gait=make_named_gait(robot, "optimised")))
    walked = found["paper"]
    assert not walked.fell
    assert walked.distance_m == pytest.approx(3.0, rel=0.05)
    assert max(walked.roll_max_rad, walked.pitch_max_rad, walked.yaw_max_rad) <= 0.15
    assert walked.slip_mm_per_step <= 8.0
    assert walked.late_slip_mm_per_step <= 1.0
    assert walked.low_force < 0.5 * found["none"].low_force


@pytest.mark.parametrize("name", GAITS)
def test_named_gaits_walk_a_little(robot, name):
    scenario = hp.Scenario(controller="governed", ground=hp.Ground(mu_s=0.25), duration=0.3)
    assert hp.walk(scenario, gait=make_named_gait(robot, name)).ending == "completed"
    with pytest.raises(InputError, match="valid names: hand, optimised, paper-curves"):
        make_named_gait(robot, "trot")


def test_spatial_gait_refuses(robot, packaged):
    with pytest.raises(InputError, match="valid names: constant, planar"):
        SpatialGait(robot, packaged.gait, reference="moon")
    with pytest.raises(InputError, match="falls before"):
        SpatialGait(robot, PlanarGait(), reference="planar")
    with pytest.raises(InputError, match="reach"):
        SpatialGait(robot, PlanarGait(end_height=0.85))
