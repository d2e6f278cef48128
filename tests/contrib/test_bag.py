"""Logs of one's own robot: in and out of files, and what is wrong with them."""

import numpy as np
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.contrib.bag import estimate_log, read_log
from harpy_pin.contrib.foxglove import write_mcap
from harpy_pin.log.run import Run

pytestmark = needs_robots
SENSED = ("gyroscope", "accelerometer", "joint_position", "joint_velocity", "joint_torque", "q")


@pytest.fixture(scope="module")
def run(go2):
    return hp.walk(
        hp.Scenario(robot="go2", state="estimated", ground=hp.Ground(mu_s=0.6), duration=1.0)
    )


@pytest.fixture
def signals(run, go2, tmp_path):
    run.save(tmp_path / "walk.npz")
    return read_log(tmp_path / "walk.npz", go2)


def test_a_run_is_a_log(run, signals, go2):
    found, measures = estimate_log(signals, go2)
    assert measures["velocity_cm_s"] < 2.0
    assert measures["tilt_deg"] < 1.0
    assert measures["uneven_steps"] == 0.0
    assert measures["status: good"] > 0.9
    np.testing.assert_allclose(found["estimated_q"], run["estimated_q"], atol=5e-3)


def test_the_estimate_is_a_run(signals, go2, tmp_path):
    del signals["q"]
    found, measures = estimate_log(signals, go2)
    assert "drift" not in measures
    found.save(tmp_path / "estimate.npz")
    again = Run.load(tmp_path / "estimate.npz")
    np.testing.assert_array_equal(again["q"], found["estimated_q"])
    assert repr(again) == repr(found)


def test_a_table_is_the_same_log(run, signals, go2, tmp_path):
    named = {
        f"joint_position/{name}": signals["joint_position"][:, j]
        for j, name in enumerate(go2.joints)
    }
    columns = {"t": signals["t"]} | dict(reversed(named.items()))
    for name in ("gyroscope", "accelerometer", "joint_velocity", "joint_torque"):
        columns |= {f"{name}/{j}": column for j, column in enumerate(signals[name].T)}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "log.csv", rows, "%.17g", ",", header=",".join(columns), comments="")
    read = read_log(tmp_path / "log.csv", go2)
    for name in ("t", *SENSED[:-1]):
        np.testing.assert_array_equal(read[name], signals[name])
    run.to_csv(tmp_path / "run.csv")
    np.testing.assert_array_equal(
        read_log(tmp_path / "run.csv", go2)["joint_torque"], run["torque"]
    )


def test_an_mcap_is_the_same_log(run, signals, go2, tmp_path):
    pytest.importorskip("foxglove")
    write_mcap(run, tmp_path / "walk.mcap", go2)
    read = read_log(tmp_path / "walk.mcap", go2)
    np.testing.assert_allclose(read["t"], signals["t"], atol=1e-9)
    for name in SENSED:
        np.testing.assert_allclose(read[name], signals[name], atol=1e-9)


def test_foxglove_finds_frames_forces_and_cones(run, go2, tmp_path):
    """Written by Foxglove's library, read by the one for protobuf."""
    pytest.importorskip("foxglove")
    protobuf = pytest.importorskip("mcap_protobuf.decoder")
    from mcap.reader import make_reader

    write_mcap(run, tmp_path / "walk.mcap", go2)
    with (tmp_path / "walk.mcap").open("rb") as file:
        found = {}
        for schema, _, message, content in make_reader(
            file, decoder_factories=[protobuf.DecoderFactory()]
        ).iter_decoded_messages(topics=["/tf", "/forces"]):
            found.setdefault(schema.name, []).append((1e-9 * message.log_time, content))
    k = 500
    t, frames = min(found["foxglove.FrameTransforms"], key=lambda row: abs(row[0] - run["t"][k]))
    k = int(np.abs(run["t"] - t).argmin())
    of = {one.child_frame_id: one.translation for one in frames.transforms}
    assert {"base", *go2.feet} <= set(of)
    for foot, place in zip(go2.feet, run["foot_position"][k], strict=True):
        np.testing.assert_allclose((of[foot].x, of[foot].y, of[foot].z), place, atol=1e-6)
    scene = dict(found["foxglove.SceneUpdate"])[t]
    force = np.linalg.norm(run["foot_force"][k], axis=1)
    for entity, strength in zip(scene.entities, force, strict=True):
        if strength > 1.0:
            arrow, cone = entity.arrows[0], entity.cylinders[0]
            assert arrow.shaft_length == pytest.approx(0.5 * strength / (9.81 * go2.mass))
            assert 0.5 * cone.size.x / cone.size.z == pytest.approx(0.6)
            assert (cone.bottom_scale, cone.top_scale) == (0.0, 1.0)


WRONG = {
    "no gyroscope": (
        lambda s: s.pop("gyroscope"),
        "the log has no gyroscope; it has accelerometer",
    ),
    "ms": (lambda s: s.update(t=1e3 * s["t"]), "must be in s, not ms or ns"),
    "stands": (lambda s: s.update(t=0.0 * s["t"]), "must be finite and go on"),
    "g": (lambda s: s.update(accelerometer=s["accelerometer"] / 9.81), "and not 9.81 m/s²: in g"),
    "degrees": (
        lambda s: s.update(joint_position=np.degrees(s["joint_position"])),
        "must be in rad",
    ),
    "fewer": (
        lambda s: s.update(joint_position=s["joint_position"][:, 1:]),
        "must be (1000, 12) for 'go2'",
    ),
    "no torque": (lambda s: s.pop("joint_torque"), "neither joint_torque nor foot_force"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said(signals, go2, tmp_path, name):
    spoil, message = WRONG[name]
    spoil(signals)
    np.savez(tmp_path / "log.npz", **signals)
    with pytest.raises(hp.InputError) as error:
        read_log(tmp_path / "log.npz", go2)
    assert message in str(error.value)


@pytest.mark.parametrize("text", ["", "t,gyroscope/x\n1,two\n", "t,q/0\n1\n"])
def test_what_is_no_table_is_said(go2, tmp_path, text):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(hp.InputError, match="cannot read"):
        read_log(tmp_path / "log.csv", go2)


def test_uneven_steps_are_counted(signals, go2):
    signals["t"] = signals["t"] + 0.4 * np.diff(signals["t"]).mean() * (
        np.arange(len(signals["t"])) % 10 == 0
    )
    assert estimate_log(signals, go2)[1]["uneven_steps"] == pytest.approx(0.2, abs=0.01)
