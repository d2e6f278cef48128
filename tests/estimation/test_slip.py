"""How feet move that stand: a fit against velocities of known creep and radius, and a walk on
ground that lets round feet in.
"""

import numpy as np
import pytest
from needs import needs_mujoco, needs_robots

import harpy_pin as hp
from harpy_pin.contrib.drift import off
from harpy_pin.estimation.slip import EVERY, MOST_SUNK, learn_slip, looseness, roll, roll_and_creep

pytestmark = needs_robots
RADIUS = 0.022


def standing(radius=RADIUS):
    """The record of a Go2 whose feet have stood for a second."""
    record = hp.Estimator(hp.load_robot("go2"), foot_radius=radius)._record_
    record["contact"]["since"], record["contact"]["probability"] = 1.0, 1.0
    return record


def learnt(record, creep, sunk, *, samples=2000, rng=None):
    """Of feet that move so, beside a common velocity that is not known."""
    rng = np.random.default_rng(0) if rng is None else rng
    record["filter"]["period"] = EVERY
    weight = float(record["weight"][0])
    for _ in range(samples):
        record["dynamics"]["tree"]["twist"] = rng.standard_normal(
            record["dynamics"]["tree"]["twist"].shape
        )
        force = 0.1 * weight * rng.standard_normal((4, 3))
        record["contact"]["force"] = force
        roll(record)
        velocity = (1.0 - sunk) * record["rolling"][0] - creep / weight * force
        record["dynamics"]["foot_velocity"] = velocity + rng.standard_normal(3)
        learn_slip(record)
    return record["contact"]


@pytest.mark.parametrize(("creep", "sunk"), [(0.0, 0.0), (0.4, 0.0), (0.0, 0.3), (0.8, 0.5)])
def test_creep_and_the_lost_radius_are_found(creep, sunk):
    contact = learnt(standing(), creep, sunk)
    assert contact["creep"][0] == pytest.approx(creep, rel=0.05, abs=1e-3)
    assert contact["sunk"][0] == pytest.approx(sunk, rel=0.05, abs=1e-3)


@pytest.mark.parametrize(
    ("creep", "sunk", "found"), [(-0.4, -0.3, 0.0), (0.0, 3.0, MOST_SUNK)], ids=["less", "more"]
)
def test_neither_is_what_cannot_be(creep, sunk, found):
    contact = learnt(standing(), creep, sunk)
    assert 0.0 <= contact["creep"][0] < 0.01
    assert contact["sunk"][0] == found


def test_feet_move_as_was_found():
    """Point feet, too, and no further at each step."""
    for radius in (0.0, RADIUS):
        record = standing(radius)
        contact = learnt(record, 0.4, 0.2)
        roll(record)
        expected = (1.0 - contact["sunk"][0]) * record["rolling"][0]
        expected[:, :2] -= contact["creep"][0] / record["weight"][0] * contact["force"][0, :, :2]
        for _ in range(3):
            roll_and_creep(record)
            np.testing.assert_allclose(record["rolling"][0], expected, rtol=1e-12, atol=1e-15)


def test_a_foothold_is_loose_after_feet_have_skidded():
    """By the speed that was seen, and for a few hundredths of a second."""
    record, usual = standing(), 0.002
    record["contact"]["since"] = 0.01
    record["filter"]["period"] = EVERY
    for _ in range(500):
        roll(record)
        record["dynamics"]["foot_velocity"] = record["rolling"] + [0.3, 0.0, 0.0]
        learn_slip(record)
    assert record["contact"]["skid"][0] == pytest.approx(0.09, rel=0.01)
    at = {}
    for since in (0.0, 0.02, 0.1):
        record["contact"]["since"] = since
        at[since] = usual * looseness(record, 0)
    assert at[0.0] == pytest.approx(np.sqrt(0.02 * 0.09 + usual**2), rel=0.01)
    assert at[0.0] > 2.0 * at[0.02] > 4.0 * at[0.1]
    assert at[0.1] == pytest.approx(usual, rel=1e-6)


@needs_mujoco
def test_a_walk_on_ground_that_lets_round_feet_in():
    """Their centres move at half of what the radius says; the drift was 3 to 4 %."""
    plant = hp.Mujoco("menagerie", foot_radius=RADIUS)
    run = hp.walk(
        hp.Scenario(
            robot="go2",
            plant=plant,
            state="estimated",
            ground=hp.Ground(mu_s=0.6),
            gait=hp.Walking(velocity=(0.4, 0.0, 0.1)),
            duration=8.0,
        )
    )
    assert run.ending == "completed"
    found = off(run["q"], run["v"], run["estimated_q"], run["estimated_v"], period=1e-3)
    assert found["drift"] < 2.0
    assert found["velocity_cm_s"] < 1.6
