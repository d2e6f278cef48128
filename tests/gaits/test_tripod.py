"""A robot on six legs, which sprawl, stands and walks by threes."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from needs import QUICK_PLANTS
from sprawling_urdf import LIMITS, sprawling_urdf
from walks import path_error, slip_per_step

import harpy_pin as hp

ROWS = ("front", "middle", "hind")
FEET = tuple(f"{side}_{row}_foot" for side in ("left", "right") for row in ROWS)
TRIPOD = {"left_front_foot", "left_hind_foot", "right_middle_foot"}


@pytest.fixture
def sprawling(tmp_path: Path):
    """Makes a robot of what :func:`sprawling_urdf` takes, on the given feet."""

    def make(feet: tuple[str, ...] = FEET, **settings) -> hp.Robot:
        (tmp_path / "sprawling.urdf").write_text(sprawling_urdf(**settings))
        return hp.load_robot(tmp_path / "sprawling.urdf", feet=feet)

    return make


@pytest.mark.parametrize("rows", [ROWS, ("front", "hind")])
def test_its_feet_are_below_its_knees_as_they_are_at_zero(sprawling, rows):
    feet = tuple(foot for foot in FEET if foot.split("_")[1] in rows)
    robot = sprawling(feet, rows=rows)
    model, data = robot.model, robot.model.createData()
    q = hp.Standing(robot).initial_state()[0]
    assert ((q[7:] >= robot.joint_lower) & (q[7:] <= robot.joint_upper)).all()
    pin.framesForwardKinematics(model, data, q)
    standing = np.array([data.oMf[robot.frame_id(foot)].translation for foot in feet])
    assert np.ptp(standing[:, 2]) < 1e-4
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    knees = [
        data.oMi[model.getJointId(foot.replace("foot", "tibia_joint"))].translation for foot in feet
    ]
    np.testing.assert_allclose(standing[:, :2], np.array(knees)[:, :2], atol=1e-5)
    assert q[2] - standing[0, 2] == pytest.approx(0.75 * 0.138, abs=1e-5)


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (4, 2, 0, 3, 5, 1)])
def test_by_threes_whatever_the_order_of_its_feet(sprawling, order):
    feet = tuple(FEET[k] for k in order)
    gait = hp.WalkingGait(sprawling(feet))
    assert gait.schedule == "tripod"
    group = gait.record["pace"]["group"][0]
    assert {foot for foot, number in zip(feet, group, strict=True) if number == 0} == TRIPOD
    with pytest.raises(hp.InputError, match="tripod"):
        hp.WalkingGait(gait.robot, "trot")
    with pytest.raises(hp.InputError, match="half of the feet must be on the left, got 3 of 4"):
        hp.WalkingGait(sprawling(FEET[:4]))


@pytest.mark.parametrize("plant", QUICK_PLANTS)
@pytest.mark.parametrize("controller", ["condensed", "wbc"])
@pytest.mark.parametrize("velocity", [(0.2, 0.0, 0.0), (0.1, 0.08, 0.4)])
def test_it_walks_as_commanded_and_never_tips(sprawling, controller, plant, velocity):
    """The centre of mass stays above the triangle of the feet that are held, in the middle of a
    step, too.
    """
    robot = sprawling()
    data = robot.model.createData()
    gait = hp.WalkingGait(robot, velocity=velocity)
    scenario = hp.Scenario(
        controller=controller, plant=plant, ground=hp.Ground(mu_s=0.6), duration=3.0
    )
    run = hp.walk(scenario, gait=gait)
    assert run.ending == "completed"
    measured = hp.measure(run)
    assert measured.tilt_max_rad < 0.02
    assert measured.torque_max_nm < 1.8
    assert slip_per_step(run) < 3 * 0.5
    assert path_error(run) < 0.01
    assert (run["stance"].sum(axis=1) >= 3.0).all()
    for tick in np.flatnonzero(run["stance"].sum(axis=1) == 3.0)[::10]:
        corners = run["foot_position"][tick][run["stance"][tick] == 1.0][:, :2]
        centre = pin.centerOfMass(robot.model, data, run["q"][tick])[:2]
        shares = np.linalg.solve(np.vstack((corners.T, np.ones(3))), np.append(centre, 1.0))
        assert shares.min() > 0.1
    swings = 1.0 - run["stance"][run["t"] > 1.0].mean(axis=0)
    assert swings.min() > 0.3
    settled = run["t"] > 1.5
    turned, moved = run["path"][settled, 2], run["path"][settled, :2]
    assert np.polyfit(run["t"][settled], turned, 1)[0] == pytest.approx(velocity[2], abs=0.02)
    rate = np.gradient(moved, run["t"][settled], axis=0)
    ahead = rate[:, 0] * np.cos(turned) + rate[:, 1] * np.sin(turned)
    assert ahead.mean() == pytest.approx(velocity[0], rel=0.05)


def test_a_pattern_that_takes_too_many_frames_is_told_its_feet(sprawling):
    robot = sprawling((*FEET, "left_front_tibia"))
    with pytest.raises(
        hp.InputError, match=r"no gait is for the 7 feet of 'sprawling': left_front_foot, .*_tibia"
    ):
        hp.Scenario(robot=robot)


def test_why_no_posture_was_found(sprawling):
    with pytest.raises(
        hp.InputError, match="'left_front_tibia' is on the axis of 'left_front_tibia_joint', which"
    ):
        hp.Standing(sprawling(tuple(foot.replace("foot", "tibia") for foot in FEET)))
    still = sprawling(limits=(LIMITS[0], (0.0, 0.0), LIMITS[2]))
    with pytest.raises(
        hp.InputError, match="6 joints of its legs have no range, such as 'left_front_femur_joint'"
    ):
        hp.Standing(still)
