import json
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin.files import OwnFolder
from reproduction import vlip_claims
from reproduction.chattering import chattering
from reproduction.claims import CLAIMS, DEPARTURES, Verdict
from reproduction.gait.planar_gait import SPACE_GAIT, load_gait
from reproduction.gait.search import SpaceCost
from reproduction.report import SETTINGS, reproduce, write_report
from reproduction.vlip_claims import VlipCase, polar_of
from reproduction.vlip_simulation import cartesian
from reproduction.walk_claims import MU, body_velocity, model_force, model_rows, walk_run


@given(st.integers(1, 40), st.floats(0.1, 10.0))
def test_chattering_of_a_triangle_wave(reversals, height):
    """A wave that reverses ``reversals`` times: known reversals and variation, whatever the
    sampling.
    """
    corners = height * (np.arange(reversals + 2) % 2)
    for per_leg in (3, 7, 20):
        t = np.linspace(0.0, reversals + 1.0, (reversals + 1) * per_leg + 1)
        signal = np.interp(t, np.arange(reversals + 2), corners)
        result = chattering(signal, period=float(t[1]))
        assert result.reversals_per_s == pytest.approx(reversals / (reversals + 1.0))
        assert result.variation_per_s == pytest.approx(height)


def test_chattering_ignores_rounding():
    rng = np.random.default_rng(0)
    ramp = np.linspace(0.0, 1.0, 1000)
    ramp[300:700] = ramp[300]
    assert chattering(ramp + 1e-13 * rng.standard_normal(1000), period=1e-3).reversals_per_s < 2.1


@given(st.floats(0.05, 1.4), st.floats(-3.0, 3.0), st.floats(0.1, 2.0))
def test_polar_of_is_the_inverse_of_cartesian(theta, phi, length):
    np.testing.assert_allclose(
        polar_of(cartesian(theta, phi, length)[None])[0], [theta, phi, length], atol=1e-12
    )


@pytest.fixture(scope="module")
def walked():
    return walk_run("hand", "measured", duration=1.0)


def test_body_velocity(walked):
    for i in range(0, len(walked), 97):
        rotation = pin.Quaternion(walked["q"][i, 3:7]).matrix()
        np.testing.assert_allclose(
            body_velocity(walked)[i], rotation @ walked["v"][i, :3], atol=1e-12
        )


def test_model_rows_are_those_the_governor_saw(walked):
    """h_r as logged by the governor in the loop, and as computed from the log afterwards."""
    np.testing.assert_allclose(model_rows(walked, mu=MU, reference="x_r"), walked["h_r"], atol=1e-9)
    force = model_force(walked, reference="x_r")
    expected = MU * force[:, 2] - np.abs(force[:, 0])
    np.testing.assert_allclose(
        model_rows(walked, mu=MU, reference="x_r")[:, :2].min(axis=1), expected, atol=1e-9
    )


def test_a_run_of_another_controller_has_no_model_force():
    run = hp.walk(hp.Scenario(controller="wbc", duration=0.01))
    with pytest.raises(hp.InputError, match="centre_of_pressure"):
        model_force(run)


def test_no_thrusters_means_no_thrust():
    run = walk_run("hand", "no thrusters", duration=0.5)
    assert np.all(run["thrust"] == 0.0)


def test_commands_of_the_cases_give_their_runs():
    case = VlipCase("measured", "cartesian", "inside")
    run = case.run()
    assert run.parameters.coordinates == "cartesian"
    assert run.parameters.start == "inside"
    assert (
        case.command
        == "python -m reproduction vlip --evaluate-at measured --coordinates cartesian --start "
        "inside"
    )
    assert len(case.run(divide=2).t) == 2 * len(run.t)


def test_runs_from_inside_the_cone(monkeypatch):
    """Without a governor as that case's own run; the margin governor violates nothing, as is proved
    of it.
    """
    monkeypatch.setattr(vlip_claims, "DIVISORS", (1, 2))
    names = ("no governor", "margin")
    monkeypatch.setattr(vlip_claims, "INSIDE", {name: vlip_claims.INSIDE[name] for name in names})
    found = vlip_claims.study_inside()
    case = VlipCase(None, start="inside")
    summaries = [case.run(divide=divide).summary() for divide in (1, 2)]
    reversals = {
        str(k): summary.reversals_per_s for k, summary in zip((1, 2), summaries, strict=True)
    }
    assert found["no governor"] == vars(summaries[0]) | {"reversals_per_s": reversals}
    assert found["margin"]["violation_share"] == 0.0
    assert found["no governor"]["violation_share"] > 0.1


@pytest.mark.long
def test_report(robot, tmp_path):
    """Every claim has a verdict and finite numbers, for every gait; the page loads nothing."""
    result = reproduce(robot, duration=0.9)
    page = write_report(result, OwnFolder(tmp_path / "out")).read_text()
    assert list(dict.fromkeys(f.claim.key for f in result.findings)) == list(CLAIMS)
    assert [f.setting for f in result.findings if f.claim.key == "Q5"] == list(SETTINGS)
    for finding in result.findings:
        assert finding.verdict in Verdict
        assert finding.values
        assert all(np.isfinite(v) for v in finding.values.values())
        assert finding.claim.text.split(":")[-1].strip()[:30].replace("'", "&#39;") in page
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!data:)""", page)
    plates = 4 + 3 * len(SETTINGS)
    assert page.count("<figure") == plates
    assert sorted(p.suffix for p in (tmp_path / "out" / "figures").iterdir()) == [".pdf"] * plates
    for departure in DEPARTURES:
        assert departure.row in page
    numbers = json.loads((tmp_path / "out" / "numbers.json").read_text())
    assert {entry["claim"] for entry in numbers["claims"]} == set(CLAIMS)
    assert "NaN" not in (tmp_path / "out" / "numbers.json").read_text()


def test_space_cost_prefers_the_walk_that_does_not_slip(robot):
    """The refined gait costs little in space; one that falls, or cannot be walked, costs more than
    any that does.
    """
    cost = SpaceCost(robot=robot, duration=3.0)
    good = load_gait(SPACE_GAIT).gait
    assert cost(good) < 10.0
    assert cost(replace(good, half_step=0.01)) > cost(good)
    assert cost(replace(good, end_height=0.9)) >= 60.0
    with pytest.raises(hp.InputError):
        SpaceCost(robot=robot, width=-1.0)
