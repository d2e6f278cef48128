"""The study of joints from a log, on Harpy: no wheel of the tests has other robots."""

import numpy as np
import pytest

import harpy_pin as hp
from comparison.studies import identification
from comparison.worlds.hung import PERIOD, STEP, hang, hidden, replayed, with_hidden
from harpy_pin.contrib.identify import excitation
from harpy_pin.model.loading import harpy_urdf

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def hung_harpy():
    robot = hp.load_harpy()
    return hang(mujoco.MjSpec.from_file(str(harpy_urdf())), robot), robot


def test_replays_step_by_step(hung_harpy):
    """As MuJoCo steps when Python shifts the targets by the delay."""
    model, robot = hung_harpy
    plan = excitation(robot, duration=4.0)
    truth = hidden(robot, np.random.default_rng(0), np.abs(plan.torque).max(axis=0))
    rows, every = 200, round(PERIOD / STEP)
    late = np.round(truth.delay / STEP).astype(int)
    stepped = with_hidden(model, truth, plan.k_p, plan.k_d)
    data = mujoco.MjData(stepped)
    place = stepped.jnt_qposadr[stepped.actuator_trnid[:, 0]]
    data.qpos[place] = plan.q[0]
    sent = plan.torque + plan.k_p * plan.q + plan.k_d * plan.v
    expected = []
    for k in range(rows * every):
        if k % every == 0:
            expected.append(data.qpos[place].copy())
        data.ctrl = [sent[(k - d) // every, j] if k >= d else 0.0 for j, d in enumerate(late)]
        mujoco.mj_step(stepped, data)
    assert replayed(model, [truth], plan, rows)[0] == pytest.approx(np.array(expected), abs=1e-9)


def test_the_study(hung_harpy, monkeypatch):
    monkeypatch.setattr(identification, "hung", lambda name: hung_harpy)
    monkeypatch.setattr(identification, "TIMES", (0.1, 0.2))
    monkeypatch.setattr(identification, "REPLAYED", 0.1)
    settings = identification.STUDY.settings(worlds=("Go2",), logs=1, duration=8.0, walks=0)
    rows = [job | identification.measured(job) for job in identification.STUDY.timed(settings)]
    assert [row["law"] for row in rows] == [False, True]
    assert all(row["torque_scale"] < 10.0 and row["delay_ms"] < 1.0 for row in rows)
    assert rows[1]["trials_after_0.1"] > 0
    tables = {table.name: table for table in identification.STUDY.tables(rows)}
    assert {"identification", "identification_search"} <= set(tables)
    assert tables["identification"].get("Go2, torques", "armatures excited").value.endswith("of 6")
