"""Standing on any number of feet: the targets, and the condensed controller beside the QP on other
robots.
"""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import places
from long import long_but
from needs import needs_robots
from same_optimum import same_optimum
from walks import own_search, walked

import harpy_pin as hp
from comparison.studies.robots import friction_used, run_standing, stood, terms_error
from harpy_pin.gaits.gait import own_target
from harpy_pin.wbc import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights
from harpy_pin.wbc.condensed import CondensedSolver

FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
SOLO = np.array([0.1, 0.8, -1.6, -0.1, 0.8, -1.6, 0.1, -0.8, 1.6, -0.1, -0.8, 1.6])
BOLT = np.array([-0.2, 0.7854, -1.5708, 0.2, 0.7854, -1.5708])
LIGHT = {"min_normal_force": 0.5, "max_normal_force": 60.0}
"""Ranges of normal force for robots of some kilograms."""
WEIGHTS = WholeBodyWeights(orientation=0.25, swing=12.0, posture=1e-10, thrust=3.5e-4, force=1.9e-5)


@pytest.fixture(scope="module")
def solo() -> hp.Robot:
    return hp.load_robot("solo12")


@needs_robots
def test_targets_are_smooth_and_keep_the_feet_in_place(solo):
    gait = hp.Standing(
        solo, SOLO, shift=(0.02, -0.01, 0.015), shift_period=1.5, penetration_offset=0.004
    )
    on_ground, h = [], 1e-5
    for t in np.linspace(0.0, 3.0, 31):
        before, after = (gait.update(float(t + s)).body.copy() for s in (-h, h))
        target = gait.update(float(t))
        np.testing.assert_allclose(
            (after[:3] - before[:3]) / (2.0 * h), target.body[3:6], atol=1e-8
        )
        np.testing.assert_allclose(
            (after[3:6] - before[3:6]) / (2.0 * h), target.body[6:], atol=1e-7
        )
        on_ground.append(target.body[:3] + target.foot_position)
        np.testing.assert_array_equal(target.foot_velocity, np.tile(-target.body[3:6], (4, 1)))
        np.testing.assert_array_equal(target.foot_acceleration, np.tile(-target.body[6:], (4, 1)))
        assert (target.stance == 1.0).all()
    np.testing.assert_allclose(on_ground, np.tile(on_ground[0], (31, 1, 1)), atol=1e-15)
    half, start = gait.update(0.75).body[:3].copy(), gait.update(0.0).body[:3].copy()
    np.testing.assert_allclose(half - start, (0.02, -0.01, 0.015), atol=1e-12)
    q, v = gait.initial_state(penetration=0.003)
    feet = places(solo, q)
    np.testing.assert_allclose(feet, on_ground[0] + (0.0, 0.0, 0.004 - 0.003), atol=1e-12)
    assert feet[:, 2].min() == pytest.approx(-0.003)
    assert not v.any()


@needs_robots
def test_four_feet_optimum_is_that_of_the_whole_body_program(solo):
    """In every support from none to four feet: the same forces and torques; always inside pyramids
    and ranges.
    """
    rng, standing = np.random.default_rng(0), hp.Standing(solo, SOLO).initial_state()[0]
    states = [
        (
            pin.integrate(solo.model, standing, 0.1 * rng.standard_normal(18)),
            0.3 * rng.standard_normal(18),
        )
        for _ in range(160)
    ]
    how = {"spread": 3.0, "most": 60.0}
    _, binding = same_optimum(
        solo, states, WEIGHTS, WholeBodyLimits(mu=0.4), ("input_space",), **how
    )
    assert binding > 35


@needs_robots
def test_late_feet_land(solo):
    """Let go 5 mm above the ground: all feet are late, and reach for it, softly; then it stands."""
    gait = hp.Standing(solo, SOLO)
    soft = {**LIGHT, "weights": {"swing": 0.2}}
    walk = hp.build(hp.Scenario(controller=hp.Condensed(parameters=soft), duration=1.5), gait=gait)
    walk.simulator.reset(*gait.initial_state(penetration=-0.005))
    run = walk.run()
    assert run.ending == "completed"
    assert not run["held"][0].any()
    assert run["held"][-1].all()
    assert abs(run["q"][-1, 2] - gait.initial_state()[0][2]) < 2e-3


@needs_robots
def test_two_feet_with_thrusters_stand():
    """Bolt with thrusters at its shoulders, where it could not stay upright on two points without
    them.
    """
    thrusters = ("FL_SHOULDER", "FR_SHOULDER")
    bolt = hp.load_robot("bolt", thrusters=thrusters, thrust_limit=20.0)
    gait = hp.Standing(bolt, BOLT, shift=(0.0, 0.01, 0.0))
    parts = [
        {"name": name, "parameters": {**LIGHT, **own_search(name)}} for name in ("condensed", "wbc")
    ]
    pushes = (hp.Push(0.3, (0.1, 0.2, 0.0)),)
    runs = [walked(gait, controller=part, mu_s=0.4, duration=1.5, pushes=pushes) for part in parts]
    assert runs[0].ending == runs[1].ending == "completed"
    np.testing.assert_allclose(runs[0]["q"], runs[1]["q"], rtol=0, atol=1e-3)


@needs_robots
def test_straight_legs_give_numbers_within_every_limit(solo):
    """A straight knee leaves its limb singular: the foot is not held exactly, but what is commanded
    is bounded.
    """
    dynamics, rng = hp.Dynamics(solo), np.random.default_rng(1)
    limits = WholeBodyLimits(mu=0.4)
    law = CondensedSolver(solo, WEIGHTS, limits)
    for i in range(200):
        posture = SOLO.copy()
        bent = (0.0, 1e-12, 1e-6, 1e-3)[i % 4]
        posture[2::3] = bent
        posture[1::3] = rng.uniform(-0.3, 0.3, 4)
        q = pin.neutral(solo.model)
        q[7:] = posture
        v = 0.3 * rng.standard_normal(18)
        targets = WholeBodyTargets(solo)
        targets.body[:] = rng.standard_normal(3)
        targets.force_range[:] = (0.5, 60.0)
        dynamics.update(q, v)
        inputs = law.solve(dynamics, v, targets)
        assert np.isfinite(inputs).all()
        assert (np.abs(inputs) <= solo.torque_limit).all()
        assert ((limits.pyramid @ law.force.T) >= -1e-9).all()
        assert ((law.force[:, 2] >= 0.5) & (law.force[:, 2] <= 60.0)).all()


@needs_robots
def test_legs_without_a_foot_are_like_arms():
    two = hp.load_robot("solo12", feet=FEET[:2])
    law = CondensedSolver(two)
    np.testing.assert_array_equal(law.record["system"]["order"][0], np.arange(12, 18))


@needs_robots
def test_moves_are_smooth_and_end_at_rest(solo):
    """Position, velocity and acceleration fit each other and have no jump, also where one move
    begins in another.
    """
    gait, h = hp.Standing(solo, SOLO, shift=(0.01, 0.0, 0.0), shift_period=0.9), 1e-5
    start = gait.update(0.0).body[:3].copy()
    end = gait.over(0, 1)
    gait.move(end, t=0.5, duration=1.0)
    before = gait.update(1.1).body.copy()
    gait.move((0.0, 0.02, -0.01), t=1.1, duration=0.8)
    np.testing.assert_allclose(gait.update(1.1).body, before, atol=1e-9)
    for t in np.linspace(1.11, 2.5, 40):
        early, late = (gait.update(float(t + s)).body.copy() for s in (-h, h))
        body = gait.update(float(t)).body
        np.testing.assert_allclose((late[:3] - early[:3]) / (2.0 * h), body[3:6], atol=1e-8)
        np.testing.assert_allclose((late[3:6] - early[3:6]) / (2.0 * h), body[6:], atol=1e-5)
        np.testing.assert_allclose(gait.target.foot_velocity[0], -body[3:6], atol=1e-15)
    np.testing.assert_allclose(gait.update(2.25).body[:3] - start, (0.01, 0.02, -0.01), atol=1e-12)
    gait.move((0.0, 0.0, 0.0), t=3.0, duration=1e-3)
    np.testing.assert_allclose(gait.update(3.6).body[:6], [*start, 0.0, 0.0, 0.0], atol=1e-12)
    for feet in ((), (4,), (-1,)):
        with pytest.raises(hp.InputError):
            gait.over(*feet)


@needs_robots
def test_over_is_where_the_centre_of_mass_has_to_go(solo):
    gait = hp.Standing(solo, SOLO)
    q, _ = gait.initial_state()
    centre = pin.centerOfMass(solo.model, solo.model.createData(), q)
    np.testing.assert_allclose((centre + gait.over(2) - places(solo, q)[2])[:2], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        gait.over(0, 1, 2, 3), np.mean([gait.over(k) for k in range(4)], axis=0), atol=1e-15
    )


@needs_robots
def test_copies_of_controllers_move_too(solo):
    gait = hp.Standing(solo, SOLO)
    copy = own_target(gait)
    gait.move((0.01, 0.0, 0.0), t=0.0, duration=0.5)
    np.testing.assert_array_equal(copy.update(0.3).body, gait.update(0.3).body)
    assert copy.target is not gait.target


@needs_robots
def test_settings_fit_the_weight(solo):
    parameters = hp.Standing(solo, SOLO).controller_parameters
    assert parameters["min_normal_force"] == pytest.approx(0.02 * solo.mass * 9.81 / 4.0)
    assert parameters["max_normal_force"] == pytest.approx(2.0 * solo.mass * 9.81)
    assert "formulation" not in parameters


ALWAYS = ("g1",)  # the study of robots stands with solo12
REQUIRED = (*ALWAYS, "solo12", "go2", "anymal_b", "talos")


@needs_robots
def test_soles_stand_on_the_ground_that_a_scenario_gives_them():
    """For a while: on ground that is as soft as for points soles rock, and G1 falls after two
    seconds.
    """
    gait = hp.Standing(hp.load_robot("g1"))
    run = hp.walk(
        hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.6), duration=3.0), gait=gait
    )
    assert stood(run)
    assert np.ptp(run["q"][:, 2]) < 1e-3


@needs_robots
@pytest.mark.parametrize("name", long_but(REQUIRED, ALWAYS))
def test_stands_and_takes_a_push(name):
    """The weight shifted towards a foot, and a push on the base of 0.1 m/s times the mass; both
    controllers alike.
    """
    robot = hp.load_robot(name)
    assert terms_error(robot, np.random.default_rng(0), states=3) < 1e-9
    runs = {"shift": {"lean": 0.2}, "push": {"push": (0.06, 0.08, 0.0)}}
    for case, how in runs.items():
        ends = []
        for controller in ("wbc", "condensed"):
            run, _ = run_standing(robot, controller, duration=1.0, **how)
            assert stood(run)
            assert 1e3 * run["slip_path"][-1].mean() < 0.5
            assert friction_used(run, robot) < 0.5
            desired, held = run["desired_force"], run["held"] > 0.0
            outside = (
                np.linalg.norm(desired[held][:, :2], axis=1) - 0.75 * 0.5 * desired[held][:, 2]
            )
            assert outside.max() < 1e-6 * robot.mass
            moved = run["q"][-1, :2] - run["q"][0, :2]
            if case == "shift":
                assert np.linalg.norm(moved - 0.2 * hp.Standing(robot).over(0)[:2]) < 5e-3
            else:
                assert np.abs(run["q"][:, :2] - run["q"][0, :2]).max() > 5e-3  # it was pushed
            ends.append(run["q"][-1])
        np.testing.assert_allclose(ends[0][:7], ends[1][:7], rtol=0, atol=5e-3)


@needs_robots
@pytest.mark.parametrize(
    ("speed", "degrees"), long_but([(0.1, 20.0), (0.17, 40.0)], [(0.17, 40.0)])
)
def test_a_push_askew_does_not_tip_the_soles(speed, degrees):
    """The centre of pressure stays inside the soles, so that they neither rock nor walk away."""
    robot, angle = hp.load_robot("g1"), np.deg2rad(degrees)
    run, _ = run_standing(
        robot, "condensed", duration=2.0, push=(speed * np.cos(angle), speed * np.sin(angle), 0.0)
    )
    assert stood(run)
    places = run["foot_position"].reshape(len(run), 8, 3)
    assert 1e3 * np.linalg.norm(places[-1, :, :2] - places[0, :, :2], axis=1).max() < 2.0
    assert 1e3 * run["slip_path"][-1].mean() < 1.0
    force = run["desired_force"].reshape(len(run), 2, 4, 3)[..., 2]
    for foot in range(2):
        corners, load = places[0, 4 * foot : 4 * foot + 4, :2], force[:, foot].sum(axis=1)
        pressure = (force[:, foot] @ corners)[load > 0.0] / load[load > 0.0, None]
        inside = np.minimum(pressure - corners.min(axis=0), corners.max(axis=0) - pressure)
        assert len(inside) > 1000
        assert (inside > 0.02 * np.ptp(corners, axis=0)).all()


@needs_robots
@pytest.mark.parametrize("kind", [hp.Standing, hp.WalkingGait])
def test_an_angle_beyond_its_limits_is_refused_by_name(go2: hp.Robot, kind: type) -> None:
    bent_the_wrong_way = np.tile((0.0, -0.7, 1.4), 4)
    with pytest.raises(
        hp.InputError, match=r"'FL_calf_joint' is at 1\.4 rad, .* -2\.7227 to -0\.83776 rad"
    ):
        kind(go2, posture=bent_the_wrong_way)


@needs_robots
def test_hovering_refuses_it_too() -> None:
    robot = hp.load_robot("borinot")
    with pytest.raises(hp.InputError, match="beyond its limits"):
        hp.Hovering(robot, posture=robot.joint_upper + 0.1)


def test_joints_without_limits_are_free(tmp_path: Path) -> None:
    text = hp.load_harpy().urdf.read_text()
    free = tmp_path / "free.urdf"
    free.write_text(re.sub(r'lower="[^"]*" upper="[^"]*"', "", text))
    robot = hp.load_harpy(free)
    assert not np.any([robot.joint_lower, robot.joint_upper])
    hp.Standing(robot, [0.0, 0.7, -1.4] * 2)
