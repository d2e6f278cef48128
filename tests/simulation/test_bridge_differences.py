"""What a bridge says of a user's model: what MuJoCo does otherwise than the robot that the
controller knows.
"""

import mujoco
import numpy as np
import pytest
from needs import needs_robots
from own_models import described, give

import harpy_pin as hp
from harpy_pin import InputError, MujocoBridge
from harpy_pin.model.mjcf_options import enabled_actuators
from harpy_pin.simulation.mujoco.differences import WRONG_IF_SPARSE

pytestmark = needs_robots
CALF = "FL_calf_joint"
PLANE, SPHERE = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_SPHERE


def changed(robot, change, **how):
    """A bridge to a model of the robot after a change of its description."""
    spec = described(robot, **{"actuators": "motor", **how})
    change(spec)
    return MujocoBridge(spec.compile(), robot)


def tendon(spec):
    made = spec.add_tendon(name="band", stiffness=[40.0, 0.0, 0.0])
    made.wrap_joint(CALF, 1.0)


def asleep(spec, policy=mujoco.mjtSleepPolicy.mjSLEEP_ALLOWED):
    spec.body("base").sleep = policy
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def sparse(spec):
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            lambda s: give(s.joint(CALF), range=(-2.0, -0.84)),
            f"lower end of joint of {CALF}: -2 rad in the model, -2.7",
        ),
        (
            lambda s: give(s.joint(CALF), limited=0),
            f"upper end of joint of {CALF}: inf rad in the model, -0.8",
        ),
        (
            lambda s: give(s.joint(CALF), stiffness=[30.0, 0, 0]),
            f"the model has springs of joint '{CALF}' (30 N·m",
        ),
        (
            lambda s: give(s.option, gravity=(0, 0, -3.71)),
            "gravity of the world: [ 0.    0.   -3.71] m/s² in the model",
        ),
        (lambda s: give(s.body("base"), gravcomp=1.0), "the model has gravcomp of body 'base' (1)"),
        (
            lambda s: give(s.option, wind=(3, 0, 0), density=1.2),
            "the model has air of density 1.2 kg/m³ and viscosity",
        ),
        (
            lambda s: give(s.actuators[2], delay=0.005, nsample=4),
            f"the model has delay of actuator 'of {CALF}' (0.005",
        ),
        (
            lambda s: give(s.joint(CALF), damping=[0.0, 0.02, 0]),
            f"the model has damping that is not linear of joint '{CALF}' (0.",
        ),
        (tendon, "the model has tendon 'band'"),
        (asleep, "the robot may sleep in the model, and then has no contacts"),
        pytest.param(
            sparse,
            "Newton's solver is wrong with sparse Jacobians in MuJoCo 4.0.0",
            marks=pytest.mark.skipif(
                mujoco.__version__ != WRONG_IF_SPARSE, reason="MuJoCo's solver is right"
            ),
        ),
        (lambda s: give(s.option, disableflags=16), "the model has the flag contact='disable'"),
        (
            lambda s: give(s.option, disableflags=128),
            "gravity of the world: [0. 0. 0.] m/s² in the model",
        ),
    ],
)
def test_what_the_robot_has_not_is_named(go2, change, line):
    assert changed(go2, lambda spec: None).differences == ""
    assert any(said.startswith(line) for said in changed(go2, change).differences.splitlines())


def test_a_change_of_the_model_is_said_at_once(go2):
    bridge = changed(go2, lambda spec: None)
    bridge.model.opt.gravity[2] = -1.62
    assert "gravity" in bridge.differences


def test_a_base_that_never_sleeps_has_its_contacts(go2):
    never = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
    assert changed(go2, lambda spec: asleep(spec, never)).differences == ""


def test_armature_and_damping_of_actuators_are_mujocos(go2):
    """Through gears, against MuJoCo's inertia matrix and its passive forces."""

    def change(spec):
        give(spec.joint(CALF), armature=0.01, damping=[0.1, 0.2, 0.0])
        give(spec.actuators[2], armature=0.02, damping=[0.3, 0.4, 0.5])

    plain, bridge = changed(go2, lambda spec: None).model, changed(go2, change)
    model = bridge.model
    place, said = model.joint(CALF).dofadr[0], bridge.differences
    matrices = []
    for one in (plain, model):
        data, full = mujoco.MjData(one), np.zeros((one.nv, one.nv))
        data.qvel[place] = 2.0
        mujoco.mj_forward(one, data)
        mujoco.mj_fullM(one, data, full)
        matrices.append(full[place, place])
    assert f"armature of {CALF}: {matrices[1] - matrices[0]:.4g} kg·m² in the model" in said
    first, second, third = 0.1 + 9.0 * 0.3, 0.2 + 9.0 * 0.4, 9.0 * 0.5
    assert -data.qfrc_damper[place] == pytest.approx(first * 2.0 + second * 4.0 + third * 8.0)
    assert f"damping of {CALF}: {first:.4g} N·m·s/rad in the model" in said
    assert (
        f"damping that is not linear of joint '{CALF}' ({second:.4g}, {third:.4g} N·m·s²/rad²)"
        in said
    )


def test_a_range_of_control_that_cuts_torques_off(go2):
    """A servo gives what the line says at the end where MuJoCo cuts off most."""
    bridge = changed(
        go2, lambda s: give(s.actuators[2], ctrllimited=1, ctrlrange=(-7, -1)), actuators="position"
    )
    model, data, limit = bridge.model, mujoco.MjData(bridge.model), float(go2.torque_limit[2])
    number, place, given = model.joint(CALF).id, model.joint(CALF).dofadr[0], []
    for angle in model.jnt_range[number]:
        for torque in (limit, -limit):
            data.qpos[model.joint(CALF).qposadr[0]] = angle
            mujoco.mj_forward(model, data)
            bridge.write(hp.Command(np.eye(12)[2] * torque), data)
            mujoco.mj_forward(model, data)
            given.append(max(data.qfrc_actuator[place] * np.sign(torque), 0.0))
    least = min(given)
    assert least < limit - 1.0
    line = (
        f"torque that ranges of control and force leave at the ends of {CALF}: {least:.4g} N·m "
        f"in the model"
    )
    assert line in bridge.differences


@pytest.mark.parametrize("override", [False, True])
def test_a_robot_hovers_on_the_margins_of_feet_and_floor(go2, override):
    def change(spec):
        for geom in spec.geoms:
            geom.margin, geom.gap = 0.02, 0.02
        if override:
            spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
            spec.option.o_margin = 0.03

    bridge = changed(go2, change)
    model, data, gait = bridge.model, mujoco.MjData(bridge.model), hp.Standing(go2)
    bridge.place(gait.initial_state(penetration=-0.1), data)
    mujoco.mj_forward(model, data)
    assert data.nefc == 0
    while (
        data.nefc < 16
    ):  # four edges of each foot's pyramid; a gap finds contacts earlier, which push later
        data.qpos[2] -= 1e-4
        mujoco.mj_forward(model, data)
    said = 0.03 if override else 0.04
    assert data.contact.dist.max() == pytest.approx(said, abs=1e-3)
    assert f"on which it hovers, of foot 'FL_foot' ({said} m) and 3 more" in bridge.differences


def test_disabled_actuators_do_not_count(go2):
    """A servo and a motor in a joint, one of which is off; and joints whose only actuator is."""
    spec = described(go2, actuators="motor")
    for joint in go2.joints:
        spec.add_actuator(name=f"servo {joint}", target=joint, trntype=0, group=3).set_to_position(
            kp=10.0
        )
    spec.option.disableactuator = 1 << 3
    model = spec.compile()
    data = mujoco.MjData(model)
    MujocoBridge(model, go2).write(hp.Command(np.full(12, 6.0)), data)
    np.testing.assert_allclose(data.ctrl, [*[2.0] * 12, *[0.0] * 12])
    model.opt.disableactuator = 1 | 1 << 3
    with pytest.raises(
        InputError, match="no actuator of the MuJoCo model drives a joint of the robot, or"
    ):
        MujocoBridge(model, go2)
    model.opt.disableactuator, model.actuator_group[3] = 1 << 3, 3
    with pytest.raises(InputError, match="'FR_hip_joint' has no actuators that are enabled"):
        MujocoBridge(model, go2)


def weld(spec, **how):
    return spec.add_equality(type=1, name1="base", objtype=mujoco.mjtObj.mjOBJ_BODY, **how)


def couple(spec):
    spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=CALF, name2="FR_calf_joint")


def passive(spec):
    give(spec.body("base"), gravcomp=0.5)
    give(spec.option, density=1.2, viscosity=0.1)


def delay(spec):
    give(spec.actuators[2], delay=0.5, nsample=400)


@pytest.mark.parametrize(
    ("change", "off"),
    [
        (weld, "equality"),
        (couple, "equality"),
        (weld, "constraint"),
        (lambda s: give(s.joint(CALF), frictionloss=0.7), "frictionloss"),
        (lambda s: give(s.joint(CALF), frictionloss=0.7), "constraint"),
        (lambda s: give(s.joint(CALF), range=(-0.86, -0.85)), "limit"),
        (lambda s: give(s.joint(CALF), stiffness=[30.0, 2.0, 0.0]), "spring"),
        (tendon, "spring"),
        (lambda s: give(s.joint(CALF), damping=[3.0, 2.0, 0.0]), "damper"),
        (lambda s: give(s.actuators[2], damping=[3.0, 2.0, 0.0]), "damper"),
        (lambda s: give(s.body("base"), gravcomp=0.5), "gravity"),
        (passive, "spring damper"),
        (lambda s: give(s.actuators[2], ctrllimited=1, ctrlrange=(-0.1, 0.1)), "clampctrl"),
        (lambda s: [give(geom, margin=0.5) for geom in s.geoms], "contact"),
    ],
)
def test_what_the_options_disable_has_no_effect_and_is_not_said(go2, change, off):
    """The robot accelerates as without it, in MuJoCo; and would not, were it not disabled."""

    def accelerations(*changes):
        spec = described(go2, actuators="motor")
        for one in changes:
            one(spec)
        model = spec.compile()
        data = mujoco.MjData(model)
        data.qpos[:7], data.qpos[7:] = (0, 0, 0.25, 1, 0, 0, 0), go2.posture
        data.qvel[:], data.ctrl[:] = 0.3, 2.0
        mujoco.mj_forward(model, data)
        return model, data.qacc.copy()

    def disable(spec):
        for flag in off.split():
            spec.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}"))

    (model, with_it), (plain, without) = accelerations(change, disable), accelerations(disable)
    np.testing.assert_allclose(with_it, without, atol=1e-9)
    assert MujocoBridge(model, go2).differences == MujocoBridge(plain, go2).differences
    assert hp.load_robot(model, feet=go2.feet).model == hp.load_robot(plain, feet=go2.feet).model
    assert np.abs(accelerations(change)[1] - accelerations()[1]).max() > 1e-3


def test_actuators_that_are_disabled_delay_nothing(go2):
    """And limit no torque; but their armature and damping stay, as in MuJoCo's own numbers."""

    def change(spec):
        servo = spec.add_actuator(name="servo", target=CALF, trntype=0, group=3, armature=0.02)
        give(servo, forcelimited=1, forcerange=(-1.0, 1.0), damping=[0.5, 0.0, 0.0])
        give(servo, delay=0.5, nsample=400)
        spec.option.disableactuator = 1 << 3

    bridge = changed(go2, change)
    model, data = bridge.model, mujoco.MjData(bridge.model)
    place, full = model.joint(CALF).dofadr[0], np.zeros((model.nv, model.nv))
    data.qvel[place] = 1.0
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    plain, without = changed(go2, lambda spec: None).model, np.zeros((model.nv, model.nv))
    other = mujoco.MjData(plain)
    mujoco.mj_forward(plain, other)
    mujoco.mj_fullM(plain, other, without)
    armature, damping = full[place, place] - without[place, place], -data.qfrc_damper[place]
    known = go2.with_mujoco(model)
    assert known.model.armature[8] == pytest.approx(armature)
    assert known.model.damping[8] == pytest.approx(damping)
    np.testing.assert_array_equal(known.torque_limit, go2.torque_limit)
    assert [line.split(":")[0] for line in bridge.differences.splitlines()[:2]] == [
        f"armature of {CALF}",
        f"damping of {CALF}",
    ]
    assert "delay" not in bridge.differences
    model.opt.disableactuator = 0
    assert "delay" in bridge.differences


@pytest.mark.parametrize("group", [-1, 0, 1, 2, 30, 31, 40])
def test_groups_of_actuators_are_disabled_as_in_mujoco(go2, group):
    model = changed(go2, lambda spec: give(spec.actuators[2], group=group)).model
    model.opt.disableactuator = 1 << 2 | 1 << 30 | 1
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    mujoco.mj_forward(model, data)
    acts = data.qfrc_actuator[model.jnt_dofadr[model.actuator_trnid[:, 0]]] != 0.0
    np.testing.assert_array_equal(enabled_actuators(model), acts)
    assert acts[2] == (group in (-1, 1, 31, 40))


def test_a_weld_that_is_not_active_is_none(go2):
    assert changed(go2, lambda spec: weld(spec, active=False)).differences == ""
    with pytest.raises(InputError, match="<weld>"):
        changed(go2, weld)


def test_a_weld_of_something_else_holds_no_robot(go2):
    def change(spec):
        ball = spec.worldbody.add_body(name="ball", pos=(3, 0, 1))
        ball.add_freejoint()
        ball.add_geom(size=(0.1, 0, 0))
        spec.add_equality(type=1, name1="ball", objtype=mujoco.mjtObj.mjOBJ_BODY)

    assert changed(go2, change).differences == ""


def test_tendons_that_couple_joints_are_refused(go2):
    def change(spec):
        tendon(spec)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_TENDON, name1="band", objtype=mujoco.mjtObj.mjOBJ_TENDON
        )

    with pytest.raises(
        InputError, match="<tendon> of the MuJoCo model holds the robot otherwise than a loop"
    ):
        changed(go2, change)


def test_plants_of_this_library_have_dense_jacobians(go2):
    plant = hp.build(hp.Scenario(robot="go2", plant="mujoco", controller="condensed")).simulator
    assert not mujoco.mj_isSparse(plant.model)
    assert plant.model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE
