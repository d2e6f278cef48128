"""Which joints are of a leg, and which of them is its knee, of generated bipeds and of robots that
are known.
"""

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from biped_urdf import SIX, biped_urdf
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.gaits.fitting import leg_length
from harpy_pin.gaits.walking import WalkingParameters
from harpy_pin.gaits.walking.build import build_of
from harpy_pin.gaits.walking.can_walk import why_no_walk
from harpy_pin.gaits.walking.swing_load import holding_load
from harpy_pin.model.legs import legs
from harpy_pin.model.robot import feet_moved
from harpy_pin.wbc import (
    WholeBodyLimits,
    WholeBodyTargets,
    WholeBodyWeights,
    make_problem,
    make_solver,
)
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus

FEET = ("L_sole", "R_sole")
SOLE = hp.FlatFoot(length=0.2, width=0.1)
SEVEN = ("yaw", "roll", "pitch", "turn", "knee", "ankle", "tilt")
FIVE = SIX[:-1]
NO_YAW = SIX[1:]


@pytest.fixture
def biped(tmp_path: Path):
    """Makes a biped of what :func:`biped_urdf` takes, on soles unless ``flat`` is false."""

    def make(
        *arguments, flat: bool = True, sole: hp.FlatFoot = SOLE, posture=None, **settings
    ) -> hp.Robot:
        (tmp_path / "biped.urdf").write_text(biped_urdf(*arguments, **settings))
        soles = dict.fromkeys(FEET, sole) if flat else None
        return hp.load_robot(tmp_path / "biped.urdf", feet=FEET, flat_feet=soles, posture=posture)

    return make


def names_of(robot: hp.Robot, joints) -> list[str]:
    return [str(robot.model.names[j]) for j in joints]


@pytest.mark.parametrize(
    ("joints", "below"),
    [
        (SIX, "pitch knee ankle tilt"),
        (("pitch", "roll", "yaw", "knee", "ankle", "tilt"), "yaw knee ankle tilt"),
        (SEVEN, "turn knee ankle tilt"),
        (FIVE, "pitch knee ankle"),
        (("roll", "pitch", "knee"), "pitch knee"),
        (("pitch", "knee"), "pitch knee"),
        (("yaw", "pitch", "roll"), "yaw pitch roll"),
    ],
)
@pytest.mark.parametrize("waist", [(), ("waist",), ("waist", "lean")])
def test_knees_are_found_by_axes_and_waists_are_of_no_leg(biped, joints, below, waist):
    robot = biped(joints, waist=waist, flat=False)
    for side, leg in zip("LR", legs(robot), strict=True):
        assert leg.points == (f"{side}_sole",)
        assert names_of(robot, leg.joints) == [f"j_{side}_{name}" for name in joints]
        assert names_of(robot, leg.way) == [f"j_{side}_{name}" for name in below.split()]
    assert feet_moved(robot.model, robot.feet)[2 : 2 + len(waist)] == [2] * len(waist)
    assert leg_length(robot) == pytest.approx(leg_length(biped(joints, flat=False)), rel=1e-12)


@needs_robots
@pytest.mark.parametrize(
    ("name", "below"),
    [
        ("go2", "thigh_joint calf_joint"),
        ("solo8", "HFE KFE"),
        ("hyq", "hfe_joint kfe_joint"),
        ("talos", "3_joint 4_joint 5_joint 6_joint"),
        ("icub", "hip_yaw knee ankle_pitch ankle_roll"),
        ("g1", "hip_yaw_joint knee_joint ankle_pitch_joint ankle_roll_joint"),
    ],
)
def test_knees_of_known_robots(name, below):
    robot = hp.load_robot(name)
    for leg in legs(robot):
        found = names_of(robot, leg.way)
        assert all(joint.endswith(end) for joint, end in zip(found, below.split(), strict=True))


def test_a_waist_stays_as_it_is_in_a_posture_and_the_soles_are_level(biped):
    robot, plain = biped(waist=("waist", "lean")), biped()
    q, model, data = hp.Standing(robot).initial_state()[0], robot.model, robot.model.createData()
    np.testing.assert_array_equal(q[7:9], 0.0)
    np.testing.assert_allclose(q[9:], hp.Standing(plain).initial_state()[0][7:], atol=1e-6)
    pin.framesForwardKinematics(model, data, q)
    np.testing.assert_allclose(
        [data.oMf[robot.frame_id(name)].translation[2] for name in robot.feet], 0.0, atol=1e-5
    )


@pytest.mark.parametrize(
    ("joints", "flat"), [(SIX, True), (SEVEN, True), (SIX, False), (FIVE, False)]
)
def test_legs_that_mirror_each_other_stand_alike(biped, joints, flat):
    """Also where a leg has more joints than its foot needs: none of them is then turned for
    nothing.
    """
    robot = biped(joints, flat=flat)
    angles = dict(zip(robot.joints, hp.Standing(robot).initial_state()[0][7:], strict=True))
    for name in joints:
        sign = 1.0 if name in ("pitch", "knee", "ankle") else -1.0
        assert angles[f"j_L_{name}"] == pytest.approx(sign * angles[f"j_R_{name}"], abs=1e-4)


def test_a_waist_is_no_part_of_a_walk_s_build(biped):
    """All that a walk takes from legs is that of the robot without a waist, which weighs the same
    in all.
    """
    robots = biped(waist=("waist",)), biped()
    with_waist, without = (
        build_of(robot, hp.Standing(robot).initial_state()[0], WalkingParameters())
        for robot in robots
    )
    for name in ("leg", "reach", "hip", "sole"):
        np.testing.assert_allclose(getattr(with_waist, name), getattr(without, name), atol=1e-6)


@pytest.mark.parametrize("controller", ["wbc", "condensed"])
@pytest.mark.parametrize("joints", [SIX, SEVEN, NO_YAW])
def test_legs_that_can_put_a_level_sole_anywhere_walk(biped, joints, controller):
    robot = biped(joints)
    assert why_no_walk(robot) == ""
    gait = hp.WalkingGait(robot, velocity=(0.15, 0.0, 0.0))
    run = hp.walk(hp.Scenario(robot=robot, controller=controller, duration=2.0), gait=gait)
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 0.15


@pytest.mark.parametrize(
    ("joints", "where"),
    [
        (FIVE, "aside"),
        (("yaw", "pitch", "knee", "ankle", "tilt"), "aside"),
        (("yaw", "roll", "knee", "tilt"), "forward"),
    ],
)
@pytest.mark.parametrize("waist", [(), ("waist", "lean")])
def test_soles_on_legs_without_an_ankle_do_not_walk_but_stand(biped, joints, where, waist):
    """As on H1: without a joint that tilts it, a sole that stays level holds the body where it
    is.
    """
    robot = biped(
        joints, waist=waist, posture=None if "ankle" in joints else np.zeros(8 + len(waist))
    )
    says = (
        rf"'biped' cannot walk on soles: the {len(joints)} joints of the leg of 'L_sole_0' "
        rf"cannot move it {where} and"
    )
    with pytest.raises(hp.InputError, match=says):
        hp.WalkingGait(robot)
    with pytest.raises(hp.InputError, match=says):
        hp.Scenario(robot=robot, gait="walking")
    assert hp.Scenario(robot=robot).gait.name == "standing"
    if "ankle" in joints:
        run = hp.walk(hp.Scenario(robot=robot, controller="wbc", duration=0.3))
        assert run.ending == "completed"


@pytest.mark.parametrize("joints", [FIVE, SEVEN])
def test_the_governed_controller_says_how_many_joints_it_takes(biped, joints):
    gait = hp.Standing(biped(joints))
    with pytest.raises(hp.InputError, match=rf"moves 6 joints, 'biped' has {2 * len(joints)}"):
        hp.make_controller("governed", gait, mu=0.5)


@pytest.mark.parametrize("waist", [(), ("waist", "lean")])
@pytest.mark.parametrize(
    ("joints", "flat"), [(FIVE, True), (SEVEN, True), (SIX, True), (FIVE, False), (SIX, False)]
)
def test_the_condensed_optimum_of_any_legs_is_that_of_the_program(biped, joints, flat, waist):
    """Legs of five, six and seven joints, with soles and points, under a waist and without one, of
    which at most one stands where it has too few joints for its sole.
    """
    robot = biped(joints, flat=flat, waist=waist)
    mass, nv, rng = robot.mass, robot.model.nv, np.random.default_rng(7)
    posture = 1e-9 if joints == SIX and flat and not waist else 1e-6  # limbs have none of their own
    weights = WholeBodyWeights(
        orientation=0.25, swing=12.0, posture=posture, thrust=1.0, force=2e-2 / mass**2
    )
    limits = WholeBodyLimits(mu=0.5, torque_scale=100.0)
    law, problem = (
        CondensedSolver(robot, weights, limits),
        make_problem("full", robot, weights, limits),
    )
    solver, dynamics = make_solver("active_set", problem.program), hp.Dynamics(robot)
    standing, inputs = hp.Standing(robot).initial_state()[0], np.empty(len(robot.joints))
    targets = WholeBodyTargets(robot)
    targets.force_range[:] = 0.5, 20.0 * mass
    too_few = joints == FIVE and flat  # then contacts yield: ρ times a large multiplier
    size = 1e-3 if too_few else 1e-6
    for i in range(40):
        q, v = pin.integrate(robot.model, standing, 0.1 * rng.standard_normal(nv)), np.empty(nv)
        v[:] = 0.1 * rng.standard_normal(nv)
        held = (1 - i % 2, i % 2) if too_few else rng.integers(0, 2, 2)
        targets.held[:] = np.repeat(held, robot.corners)
        targets.body[:], targets.orientation[:] = rng.standard_normal((2, 3))
        targets.feet[:] = rng.standard_normal(targets.feet.shape)
        if too_few:  # the foot that stands stays where it is
            v[:] = targets.feet[targets.held > 0.0] = 0.0
        dynamics.update(q, v)
        found = law.solve(dynamics, v, targets)
        problem.build(dynamics, v, dynamics.rotation, targets)
        assert solver.solve(problem.program).usable
        problem.inputs(solver.solution.z, inputs)
        np.testing.assert_allclose(found, inputs, rtol=0.0, atol=size * np.abs(inputs).max())
        assert law.status == CondensedStatus.OPTIMAL
        assert (limits.pyramid @ law.force[targets.held > 0.0].T >= -1e-9).all()


def test_a_holding_leg_needs_the_torque_of_the_work_against_its_share_of_the_weight(biped):
    """By finite differences of the potential energy of the robot and of its share of the weight at
    the foot.
    """
    robot = biped()
    q, model, data = hp.Standing(robot).initial_state()[0], robot.model, robot.model.createData()

    def energy(angles: np.ndarray) -> float:
        potential = pin.computePotentialEnergy(model, data, angles)
        pin.framesForwardKinematics(model, data, angles)
        height = np.mean([data.oMf[robot.frame_id(name)].translation[2] for name in robot.feet[:4]])
        return float(potential - robot.mass * 9.81 * height)

    joints = [model.joints[j].idx_v for j in legs(robot)[0].joints]
    step, torques = 1e-5, []
    for column in joints:
        v = np.zeros(model.nv)
        v[column] = step
        torques.append(
            (energy(pin.integrate(model, q, v)) - energy(pin.integrate(model, q, -v)))
            / (2.0 * step)
        )
    expected = np.max(np.abs(torques) / model.effortLimit[joints])
    assert holding_load(robot, q, np.array([0, 1])) == pytest.approx(expected, rel=1e-6)
    assert holding_load(robot, q, np.array([0, 0])) < expected


@pytest.mark.parametrize("flat", [True, False])
def test_the_largest_speed_is_positive_or_refused_and_says_what_it_depends_on(biped, flat):
    joints = SIX if flat else ("roll", "pitch", "knee")
    by, refused = set(), set()
    for hips in (0.05, 0.15, 0.3, 0.4, 0.6):
        for effort in (500.0, 60.0, 20.0, 3.0):
            robot = biped(joints, hips=hips, effort=effort, flat=flat)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    gait = hp.WalkingGait(robot)
            except hp.InputError as error:
                refused.add(" ".join(str(error).split()[:5]))
                continue
            assert gait.max_speed > 0.0
            assert gait.max_aside >= 0.0
            by.add(gait.limited_by)
    assert by >= {"how far its feet reach", "the length of its legs"} if flat else by
    assert {"at no speed can the", "'biped' cannot walk: its feet,"} <= refused if flat else refused


def test_motors_that_cannot_hold_a_robot_make_it_fall_and_are_refused(biped):
    weak = biped(effort=16.0)
    with pytest.raises(
        hp.InputError, match=r"motors of 'biped' hold it in mid-step, which takes 1\.3 times their"
    ):
        hp.WalkingGait(weak)
    gait = hp.WalkingGait(weak, max_speed=0.3, velocity=(0.1, 0.0, 0.0))
    assert gait.limited_by == "max_speed"
    run = hp.walk(hp.Scenario(robot=weak, controller="wbc", duration=2.0), gait=gait)
    assert run.ending == "fell"


def test_slow_robots_are_said_to_be_slow_and_why(biped):
    wide = biped(hips=0.3)
    with pytest.warns(
        UserWarning,
        match=r"'biped' walks at 0\.0\d* m/s at most, limited by how far its feet reach",
    ) as said:
        hp.WalkingGait(wide)
    assert [warning.filename for warning in said] == [__file__]
    with pytest.warns(
        UserWarning, match=r"velocity \(3, 0, 0\) .* limited to .* by the length of its legs$"
    ):
        hp.WalkingGait(biped(), velocity=(3.0, 0.0, 0.0))


def test_heavier_motors_swing_legs_slower_also_on_two_feet(biped):
    speeds = []
    for armature in (0.0, 0.5, 1.0):
        gait = hp.WalkingGait(biped(effort=60.0).with_joints(armature=armature))
        speeds.append(gait.max_speed)
        assert gait.limited_by == (
            "the torques of its motors" if armature else "the length of its legs"
        )
    assert speeds[0] > speeds[1] > speeds[2] > 0.0


def test_points_on_legs_that_could_hold_a_sole_are_said(biped):
    with pytest.warns(
        UserWarning,
        match="'biped' has points as feet on legs of 6 joints: flat_feet makes them soles",
    ):
        hp.WalkingGait(biped(flat=False))


def test_a_foot_that_no_joint_moves_has_no_posture(tmp_path: Path):
    (tmp_path / "biped.urdf").write_text(biped_urdf(SIX))
    robot = hp.load_robot(tmp_path / "biped.urdf", feet=("base", "L_sole"))
    with pytest.raises(hp.InputError, match=r"no standing posture .*; no joint moves 'base' alone"):
        hp.WalkingGait(robot)
