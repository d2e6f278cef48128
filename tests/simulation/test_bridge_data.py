"""Data that are not of the bridge's model: a clear error, and not one byte is written. And what it
may be given.
"""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from needs import needs_robots
from own_models import described

import harpy_pin as hp
from harpy_pin import InputError, MujocoBridge
from harpy_pin.simulation.mujoco.bridge import read_state, write_controls
from harpy_pin.simulation.mujoco.conventions import from_mujoco, to_mujoco

pytestmark = needs_robots
JOINTS = {"armature": 0.02}
WHOLE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
GUARD = 0x5AA5C33C


@pytest.fixture(scope="module")
def bridge(go2):
    return MujocoBridge(described(go2, actuators="motor").compile(), go2)


def whole(data):
    """All that a user may write, and that decides the next step."""
    state = np.zeros(mujoco.mj_stateSize(data.model, WHOLE))
    mujoco.mj_getState(data.model, data, state, WHOLE)
    return state


def test_controls_are_where_the_model_has_them(go2):
    """Behind an actuator with three controls, joints accelerate as under the torques themselves."""
    spec = described(go2)
    body = spec.worldbody.add_body(pos=(0, 0, 5))
    body.add_joint(name="ball", type=mujoco.mjtJoint.mjJNT_BALL)
    body.add_geom(size=(0.1, 0, 0))
    head = '<actuator><orientation joint="ball" kp="3"/>'
    motors = "".join(
        f'<motor joint="{name}" gear="{2 + k % 3}"/>' for k, name in enumerate(go2.joints)
    )
    text = spec.to_xml().replace("</mujoco>", f"{head}{motors}</actuator></mujoco>")
    model = mujoco.MjModel.from_xml_string(text)
    assert model.actuator_ctrladr.tolist() == [0, *range(3, 15)]
    bridge, data, other = MujocoBridge(model, go2), mujoco.MjData(model), mujoco.MjData(model)
    torque = np.random.default_rng(0).normal(size=12)
    bridge.write(hp.Command(torque), data)
    other.qfrc_applied[bridge.velocity] = torque
    for one in (data, other):
        mujoco.mj_forward(model, one)
    np.testing.assert_allclose(data.ctrl[:3], 0.0)
    np.testing.assert_allclose(data.qacc, other.qacc, rtol=1e-9, atol=1e-9)


def test_two_robots_in_one_world(go2):
    spec, parts = mujoco.MjSpec(), {"a/": 0.0, "b/": 2.0}
    for prefix, aside in parts.items():
        spec.attach(
            described(go2, actuators="motor"),
            prefix=prefix,
            frame=spec.worldbody.add_frame(pos=(0, aside, 0)),
        )
    model = spec.compile()
    for function in (lambda: MujocoBridge(model, go2), lambda: go2.with_mujoco(model)):
        with pytest.raises(InputError, match="2 joints"):
            function()
    model.dof_armature[-12:] = 0.03  # of the second one's joints
    armature = {
        prefix: go2.with_mujoco(model, prefix=prefix).model.armature[6:] for prefix in parts
    }
    np.testing.assert_array_equal(armature["a/"], 0.0)
    np.testing.assert_array_equal(armature["b/"], 0.03)
    model.dof_armature[:] = 0.0
    data, (q, v) = mujoco.MjData(model), hp.Standing(go2).initial_state()
    bridges = {prefix: MujocoBridge(model, go2, prefix=prefix) for prefix in parts}
    for n, (prefix, one) in enumerate(bridges.items()):
        assert one.differences == ""
        one.place((q + n * np.eye(19)[1], v), data)
        one.write(hp.Command(np.full(12, 3.0 + n)), data)
        assert copy.deepcopy(one).prefix == prefix
    mujoco.mj_forward(model, data)
    for n, (prefix, one) in enumerate(bridges.items()):
        state = one.read(data)
        assert state.q[1] == n
        assert state.foot_force.sum(axis=0)[2] > 10.0
        numbers = [model.actuator(f"{prefix}of {name}").id for name in go2.joints]
        np.testing.assert_allclose(data.ctrl[numbers], (3.0 + n) / 3.0)
    with pytest.raises(InputError, match="joint of the MuJoCo model 'c/FL_hip_joint'"):
        MujocoBridge(model, go2, prefix="c/")


def other_models(robot):
    """Models whose data have other sizes, or other places."""
    for how in ({}, {"actuators": "position"}):
        yield described(robot, **how).compile()
    for change in (
        lambda spec: spec.worldbody.add_body(mass=1.0, inertia=(1, 1, 1)).add_freejoint(),
        lambda spec: spec.delete(spec.actuators[-1]),
        lambda spec: spec.body("FL_foot").add_geom(size=(0.01, 0, 0)),
        lambda spec: setattr(spec.body("FL_foot"), "name", "other"),
    ):
        spec = described(robot, actuators="motor")
        change(spec)
        yield spec.compile()
    yield described(hp.load_robot("solo12"), actuators="motor").compile()
    yield mujoco.MjModel.from_xml_string("<mujoco/>")


def test_data_of_another_model_are_refused_and_left_as_they_are(go2, bridge):
    state = hp.State(0.2, *hp.Standing(go2).initial_state(), *np.zeros((3, 4, 3)))
    for model in other_models(go2):
        data = mujoco.MjData(model)
        before = whole(data)
        for call in (
            lambda data=data: bridge.read(data),
            lambda data=data: bridge.write(hp.Command(np.ones(12)), data),
            lambda data=data: bridge.write(hp.Command(np.ones(12), q=np.zeros(12), k_p=1.0), data),
            lambda data=data: bridge.place(state, data),
            lambda data=data: bridge.place((state.q, state.v), data),
        ):
            with pytest.raises(
                InputError, match="data are of another MuJoCo model than the bridge"
            ):
                call()
        np.testing.assert_array_equal(whole(data), before)


def test_what_only_looks_like_data_is_refused(go2, bridge):
    data = mujoco.MjData(bridge.model)
    names = (
        "qpos",
        "qvel",
        "ctrl",
        "qfrc_applied",
        "ncon",
        "time",
        "model",
        "contact",
        "sensordata",
    )
    known = {name: getattr(data, name) for name in names}
    for changes in (
        {},
        {"qpos": data.qpos[:5]},
        {"ctrl": np.zeros(3)},
        {"qvel": np.zeros(18, np.float32)},
    ):
        for call in (
            bridge.read,
            lambda d: bridge.write(hp.Command(np.ones(12)), d),
            bridge.readings,
        ):
            with pytest.raises(InputError):
                call(SimpleNamespace(**{**known, **changes}))
    with pytest.raises(AttributeError):
        bridge.model = described(go2).compile()


def guarded(rng, size):
    """An array amid guards: of a size that may be wrong, of another type, read only, or with
    gaps.
    """
    length = int(rng.choice([size, size - 1, size + 1, 0, 1, 2 * size]))
    kind = rng.choice(["f8", "f8", "f8", "f4", "i8"])
    step = int(rng.choice([1, 1, 2, -1]))
    memory = np.full(4 * size + 64, GUARD, kind)
    part = memory[16 : 16 + abs(step) * length][:: step or 1]
    part[...] = 0.5
    if rng.random() < 0.2:
        part.flags.writeable = False
    return memory, part


def test_kernels_write_into_arrays_that_fit_and_nowhere_else(bridge):
    """Thousands of arrays of wrong sizes and kinds: an error of ours, or a result inside; guards
    stay whole.
    """
    rng, record, sizes = np.random.default_rng(0), bridge._record, bridge._shapes
    conventions, (nq, nv, feet), model = bridge._record_, sizes, bridge.model
    refused = 0
    for _ in range(3000):
        (a, q), (b, v) = guarded(rng, nq), guarded(rng, nv)
        (c, qpos), (d, qvel), (e, out) = (guarded(rng, n) for n in (model.nq, model.nv, model.nu))
        called = rng.integers(4)
        before = [int((memory == GUARD).sum()) for memory in (a, b, c, d, e)]
        fits = all(part.flags.writeable and part.dtype == float for part in (q, v, qpos, qvel, out))
        sized = len(q) == nq and len(v) == nv and len(qpos) == model.nq and len(qvel) == model.nv
        try:
            if called == 0:
                from_mujoco(conventions, qpos, qvel, q, v)
            elif called == 1:
                to_mujoco(conventions, q, v, qpos, qvel)
            elif called == 2:
                read_state(record, qpos, qvel, q, v, np.zeros(feet), np.zeros(feet))
            else:
                law = np.zeros((4, 12)), bool(rng.integers(2))
                write_controls(record, np.zeros(12), *law, qpos, qvel, *bridge._gains, out)
        except hp.HarpyError:
            refused += 1
            assert not (fits and sized and (called < 3 or len(out) == model.nu))
        assert [int((memory == GUARD).sum()) for memory in (a, b, c, d, e)] == before
    assert 2000 < refused < 3000


def test_gears_and_gains_are_those_of_the_moment(bridge, go2):
    data, model = mujoco.MjData(bridge.model), bridge.model
    gear = model.actuator_gear.copy()
    model.actuator_gear[:, 0] = 5.0
    bridge.write(hp.Command(np.full(12, 10.0)), data)
    np.testing.assert_allclose(data.ctrl, 2.0)
    model.actuator_gear[:] = 0.0
    with pytest.raises(InputError, match="a gear or gain of the model is zero"):
        bridge.write(hp.Command(np.full(12, 20.0)), data)
    np.testing.assert_allclose(data.ctrl, 2.0)
    model.actuator_gear[:] = gear


COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
}


@pytest.mark.parametrize("way", COPIES)
def test_copies_of_bridge_and_data_go_together(bridge, go2, way):
    data = mujoco.MjData(bridge.model)
    bridge.place(hp.Standing(go2).initial_state(penetration=0.005), data)
    mujoco.mj_forward(bridge.model, data)
    expected = bridge.read(data).foot_force
    twin, same = COPIES[way](bridge), COPIES[way](data)
    for one, of in ((twin, data), (bridge, same), (twin, same), COPIES["pickle"]((bridge, data))):
        mujoco.mj_forward(one.model, of)
        np.testing.assert_allclose(one.read(of).foot_force, expected, atol=1e-6)
        one.write(hp.Command(np.full(12, 3.0)), of)
        np.testing.assert_array_equal(of.ctrl, 1.0)
        of.ctrl[:] = 0.0
    assert twin._record is not bridge._record


@pytest.mark.parametrize("plant", ["mujoco", hp.Mujoco("default")])
@pytest.mark.parametrize("way", ["deepcopy", "pickle"])
def test_plants_go_on_after_a_copy(plant, way):
    plant = hp.build(hp.Scenario(plant=plant)).simulator
    plant.reset(*hp.make_gait(plant.robot).initial_state())
    command = hp.Command(np.ones(6), np.ones((2, 3)))
    plant.advance(command, steps=20)
    twin = COPIES[way](plant)
    for one in (plant, twin):
        one.advance(command, steps=20)
    np.testing.assert_array_equal(twin.q, plant.q)
    np.testing.assert_array_equal(twin.state.foot_force, plant.state.foot_force)
    assert not np.shares_memory(twin.data.qpos, plant.data.qpos)


def test_one_bridge_serves_several_threads(bridge, go2):
    """Each with its own data, whose contacts are as different as their heights."""
    worlds, expected = [], []
    for n in range(4):
        data = mujoco.MjData(bridge.model)
        bridge.place(hp.Standing(go2).initial_state(penetration=0.001 * (n + 1)), data)
        mujoco.mj_forward(bridge.model, data)
        worlds.append(data)
        expected.append(bridge.read(data).foot_force)

    def read(n):
        return all(
            np.array_equal(bridge.read(worlds[n]).foot_force, expected[n]) for _ in range(200)
        )

    with ThreadPoolExecutor(4) as threads:
        assert all(threads.map(read, range(4)))
    assert len({force.tobytes() for force in expected}) == 4
