"""Rods on ball joints and stiff springs of MJCF: against MuJoCo's own model, and one sentence for
what is no rod, or no stiff spring.
"""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pinocchio as pin
import pytest
from sprung_robot import FEET, inertial, rod, sprung, sprung_text

import harpy_pin as hp
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.posed import Posed

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is an extra")
SITES = ("left_sole_0", "left_sole_1", "right_sole_0", "right_sole_1")
PASSIVE = ("rod_ball", "rod_ball_2", "tarsus_joint", "crank_joint", "plantar_joint")


@cache
def robot() -> hp.Robot:
    return sprung(Path(mkdtemp()))


def loaded(text: str) -> hp.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return hp.load_robot(mujoco.MjModel.from_xml_string(text), feet=FEET)


def rigid_model():
    """MuJoCo's, as stiff as its steps allow: springs and dampers are gone, and bodies fixed."""
    spec = mujoco.MjSpec.from_string(sprung_text())
    for side in ("left", "right"):
        spec.delete(spec.joint(f"{side}_spring"))
    model = spec.compile()
    model.eq_solref[:], model.eq_solimp[:] = (2e-3, 1.0), (0.9999, 0.9999, 1e-3, 0.5, 2.0)
    return model


def states(count: int):
    given, rng = robot(), np.random.default_rng(4)
    for _ in range(count):
        q = given.reference
        q[3:7] = rng.normal(size=4)
        q[3:7] /= np.linalg.norm(q[3:7])
        q[7:] += rng.uniform(-0.3, 0.3, 10)
        yield q, rng.normal(size=given.nv)


def test_driven_joints_have_motors_and_springs_are_held():
    given = robot()
    assert len(given.joints) == 10
    passive = [str(given.model.names[k]) for k in given.loops.passive]
    assert passive == [f"{side}_{name}" for side in ("left", "right") for name in PASSIVE]
    assert not any("spring" in name for name in given.model.names)


def test_what_is_held_is_said(tmp_path):
    path = tmp_path / "sprung.xml"
    path.write_text(sprung_text())
    with pytest.warns(UserWarning, match="stiff springs, held .* 'left_spring' .1500 N.m/rad. and"):
        hp.load_robot(path, feet=FEET)


def test_a_state_goes_into_mujoco_and_back():
    """Rods turn where their ends are, and springs are at rest."""
    given, model = robot(), mujoco.MjModel.from_xml_string(sprung_text())
    data, bridge = mujoco.MjData(model), hp.MujocoBridge(model, given)
    for q, v in states(20):
        data.qpos[:] = data.qvel[:] = 0.3
        bridge.place((q, v), data)
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.efc_pos[:12], 0.0, rtol=0, atol=1e-8)
        np.testing.assert_allclose(data.efc_vel[:12], 0.0, rtol=0, atol=1e-7)
        state, places = bridge.read(data), [data.site(name).xpos for name in SITES]
        np.testing.assert_allclose(state.q, q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(state.v, v, rtol=0, atol=1e-12)
        np.testing.assert_allclose(state.foot_position, places, rtol=0, atol=1e-8)
    assert "stiff springs, held" in bridge.differences
    assert bridge.differences.count("\n") == 0


def test_accelerations_are_mujocos():
    """Of its own model of the file, whose rods may spin."""
    given, model, rng = robot(), rigid_model(), np.random.default_rng(3)
    data, bridge, dynamics = mujoco.MjData(model), hp.MujocoBridge(model, given), hp.Dynamics(given)
    for q, v in states(100):
        q[2] += 5.0
        bridge.place((q, v), data)
        torque = 3.0 * rng.normal(size=10)
        data.qfrc_applied[bridge.velocity] = torque
        mujoco.mj_forward(model, data)
        dynamics.update(q, v)
        force = np.append(np.zeros(6), torque) - dynamics.bias
        expected = np.linalg.solve(dynamics.mass_matrix, force)[6:]
        size = np.abs(expected).max()
        found = data.qacc[bridge.velocity]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * size)


def test_a_spring_is_held_where_it_is_at_rest():
    text = sprung_text().replace('damping="0.1"/>', 'damping="0.1" springref="0.1"/>')
    given, model = loaded(text), mujoco.MjModel.from_xml_string(text)
    data, bridge = mujoco.MjData(model), hp.MujocoBridge(model, given)
    q = given.reference
    bridge.place((q, np.zeros(given.nv)), data)
    mujoco.mj_forward(model, data)
    assert data.joint("left_spring").qpos[0] == pytest.approx(0.1)
    place = Posed(given, q).frame("left_foot_0").translation
    np.testing.assert_allclose(place, data.site("left_sole_0").xpos, rtol=0, atol=1e-9)
    held = Posed(robot(), robot().reference).frame("left_foot_0").translation
    assert np.linalg.norm(place - held) > 0.01


def test_a_keyframe_with_turned_rods_is_the_posture():
    given, model = robot(), mujoco.MjModel.from_xml_string(sprung_text())
    data, q = mujoco.MjData(model), robot().reference
    q[7:] = np.tile((0.05, -0.1, -0.2, 0.4, -0.2), 2)
    hp.MujocoBridge(model, given).place((q, np.zeros(given.nv)), data)
    spin = pin.Quaternion(pin.exp3(0.7 * np.array((-0.2, 0.0, -0.25)) / np.hypot(0.2, 0.25)))
    place = model.joint("left_rod_ball").qposadr[0]
    turned = pin.Quaternion(*data.qpos[place : place + 4]) * spin  # about itself
    data.qpos[place : place + 4] = turned.w, turned.x, turned.y, turned.z
    key = (
        f'<keyframe><key name="home" qpos="{" ".join(map(repr, data.qpos.tolist()))}"/></keyframe>'
    )
    again = loaded(sprung_text().replace("</mujoco>", f"{key}</mujoco>"))
    np.testing.assert_allclose(again.posture, q[7:], rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.loops.angles, given.closed(q)[7:], rtol=0, atol=1e-7)


LUMP, BENT = inertial(0.2, "-0.1 0 -0.12", 0.2), inertial(0.15, "-0.1 0.05 -0.12", 1e-3)
BALL = 'type="ball"/>'


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (sprung_text(ball=LUMP), InputError, "'left_rod_ball' is a ball joint of what is no thin"),
        (sprung_text(ball=BENT), InputError, "its mass is 0.05 m beside it"),
        (sprung_text(anchor="0 0 0"), InputError, "the ball joint 'left_rod_ball' has no length"),
        (
            sprung_text().replace("</actuator>", '<motor joint="left_rod_ball"/></actuator>'),
            InputError,
            "only for a rod without a motor",
        ),
        (
            sprung_text().replace(
                "</equality>",
                '<connect body1="left_rod" body2="left_shin" anchor="-0.1 0 -0.1"/></equality>',
            ),
            InputError,
            "that one <connect> closes",
        ),
        (
            sprung_text().replace(
                'name="left_tarsus_joint" axis="0 1 0"/>', f'name="left_tarsus_joint" {BALL}'
            ),
            InputError,
            "'left_tarsus_joint' is a ball joint",
        ),
        (sprung_text(spring=60.0), RobotError, "no loop of 'sprung' holds joint .* stiffer spring"),
    ],
)
def test_what_is_no_rod_or_no_stiff_spring_is_refused_in_a_sentence(text, error, message):
    with pytest.raises(error, match=message) as caught:
        loaded(text)
    assert "\n" not in str(caught.value)


def test_a_joint_with_a_spring_that_follows_another_one_is_not_held():
    tie = '<joint joint1="left_spring" joint2="left_knee" polycoef="0 0.1 0 0 0"/></equality>'
    given = loaded(sprung_text().replace("</equality>", tie))
    names = [given.model.names[k] for k in given.loops.passive]
    assert "left_spring" in names
    assert "right_spring" not in given.model.names


def test_a_model_without_motors_has_no_springs_that_hold():
    """Its joints may be driven from outside, against their springs."""
    text = sprung_text()
    first, last = text.index("<actuator>"), text.index("</mujoco>")
    with pytest.raises(RobotError, match="no loop of 'sprung' holds joint"):
        loaded(text[:first] + text[last:])


def test_a_rod_is_thin_and_a_spring_stiff_in_measure():
    """The same robot with a thin rod of another mass, and with a stiffer spring, is no other."""
    heavier = loaded(sprung_text(ball=rod(0.3, (-0.2, 0.0, -0.25))))
    assert heavier.mass == pytest.approx(robot().mass + 0.3)
    stiffer = loaded(sprung_text(spring=5e4))
    assert stiffer.model == robot().model
