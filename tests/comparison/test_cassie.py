"""Cassie in MuJoCo Menagerie's model, where a clone of it is in ``out/clones``."""

from __future__ import annotations

import numpy as np
import pytest
from needs import CASSIE, needs_mujoco

import harpy_pin as hp
from comparison.studies.cassie import STUDY, cassie
from harpy_pin.errors import InputError

DRIVEN = ("hip-roll", "hip-yaw", "hip-pitch", "knee", "foot")


@needs_mujoco
def test_a_file_that_is_missing_is_said_in_a_sentence():
    with pytest.raises(InputError, match=r"missing: git clone .*mujoco_menagerie") as caught:
        cassie("nowhere/scene.xml")
    assert "\n" not in str(caught.value)


@pytest.mark.needs("menagerie")
def test_five_joints_of_a_leg_have_motors():
    _, robot = cassie(str(CASSIE))
    assert robot.joints == tuple(f"{side}-{name}" for side in ("left", "right") for name in DRIVEN)
    assert robot.mass == pytest.approx(33.3, abs=0.1)


@pytest.mark.needs("menagerie")
def test_accelerations_are_mujocos():
    """Of its model without springs, with loops as stiff as its steps allow."""
    import mujoco

    _, robot = cassie(str(CASSIE))
    spec = mujoco.MjSpec.from_file(str(CASSIE))
    sprung = [joint for joint in spec.joints if np.any(np.asarray(joint.stiffness) > 0.0)]
    for part in (*spec.sensors, *spec.keys, *sprung):
        spec.delete(part)
    model = spec.compile()
    model.jnt_limited[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.eq_solref[:], model.eq_solimp[:] = (2e-3, 1.0), (0.9999, 0.9999, 1e-3, 0.5, 2.0)
    data, bridge, dynamics = mujoco.MjData(model), hp.MujocoBridge(model, robot), hp.Dynamics(robot)
    rng = np.random.default_rng(0)
    for _ in range(100):
        q, v, torque = robot.reference, rng.normal(size=robot.nv), 10.0 * rng.normal(size=10)
        q[7:] += rng.uniform(-0.3, 0.3, 10)
        bridge.place((q, v), data)
        data.qfrc_applied[bridge.velocity] = torque
        mujoco.mj_forward(model, data)
        dynamics.update(q, v)
        force = np.append(np.zeros(6), torque - robot.damping * v[6:]) - dynamics.bias
        expected = np.linalg.solve(dynamics.mass_matrix, force)[6:]
        found, size = data.qacc[bridge.velocity], np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * size)


@pytest.mark.needs("menagerie")
def test_it_walks_with_live_springs():
    rows = STUDY.run(walks=1, duration=2.0, frictions=(0.8,), mjcf=str(CASSIE))
    assert [row["fell"] for row in rows] == [False] * 3
    plain, elliptic, stiff = rows
    assert 0.05 < plain["bent"] < 0.3
    assert stiff["bent"] < 0.01
    assert elliptic["slip_mm_s"] < plain["slip_mm_s"]
    (table,) = STUDY.tables(rows)
    assert table.get("friction 0.8, as it is", "fell").value == "0 of 1"
