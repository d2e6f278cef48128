"""Settings of a governor by their names: what they change, and what is refused."""

import json
from typing import Any

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.controllers import make_governor_parameters
from harpy_pin.governors import ContactForceFilterParameters, ForceRows, PaperGovernorParameters


def rows_of(rows: ForceRows, rng: np.random.Generator) -> np.ndarray:
    x, w = rng.normal(size=9), rng.normal(size=6)
    x[2], w[2] = 0.6, 0.55
    h, jacobian = np.zeros(5), np.zeros((5, 6))
    rows.evaluate(x, w, h, jacobian)
    return np.vstack((h, jacobian.T))


@pytest.mark.parametrize("at", ["measured", "tracked"])
def test_a_share_of_the_friction_is_a_smaller_coefficient(at: Any) -> None:
    for seed in range(20):
        shared, scaled = (
            ForceRows(mass=4.0, mu=mu, friction_share=share, evaluate_at=at)
            for mu, share in ((0.4, 0.75), (0.3, 1.0))
        )
        one, other = (rows_of(rows, np.random.default_rng(seed)) for rows in (shared, scaled))
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    assert rows_of(ForceRows(mass=4.0, mu=0.4), np.random.default_rng(0))[0, 0] != one[0, 0]


def test_an_estimate_of_the_friction_is_shared_too() -> None:
    """With a share of a half, the rows use half of what is estimated; the estimate begins at what
    is assumed.
    """
    part = hp.Governed(
        evaluate_at="tracked",
        parameters={"estimate_friction": True},
        governor_parameters={"friction_share": 0.5},
    )
    controller = hp.build(
        hp.Scenario(controller=part, ground=hp.Ground(mu_s=0.4), duration=0.3)
    ).controller
    assert isinstance(controller, hp.controllers.GovernedController)
    assert controller.friction is not None
    gait = controller.gait
    q, v = gait.initial_state()
    feet = np.array([[0.0, 0.15, 0.0], [0.0, -0.15, 0.0]])
    force = np.array([[0.0, 0.0, 20.0]] * 2)
    for k in range(5):
        controller.step(hp.State(1e-3 * k, q, v, feet, np.zeros((2, 3)), force))
    assert controller.friction.least == pytest.approx(0.4)
    assert controller.governor is not None
    assert controller.governor.rows.friction == pytest.approx(0.2)  # type: ignore[attr-defined]


def test_settings_reach_the_governor_and_change_the_walk() -> None:
    def slip(**settings: Any) -> float:
        part = hp.Governed(parameters={"legs": "feedforward"}, **settings)
        scenario = hp.Scenario(controller=part, ground=hp.Ground(mu_s=0.2), duration=1.5)
        assert hp.Scenario.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario
        return hp.measure(hp.walk(scenario)).slip_mm_per_step

    published = slip()
    assert slip(governor_parameters={"alpha_r": 10.0, "friction_share": 1.0}) == published
    assert slip(governor_parameters={"min_normal_force": 35.0}) != published
    filtered = slip(governor="filter")
    assert slip(governor="filter", governor_parameters={"margin": 0.2}) == filtered
    assert slip(governor="filter", governor_parameters={"friction_share": 0.6}) != filtered


def test_parameters_by_name() -> None:
    assert make_governor_parameters("paper", mu=0.3) == PaperGovernorParameters()
    made = make_governor_parameters(
        "filter", mu=0.3, changes={"lag": 0.004, "linear": [0.1, 1, 0.1]}
    )
    assert made == ContactForceFilterParameters(mu=0.3, lag=0.004, linear=(0.1, 1, 0.1))
    assert make_governor_parameters("none", mu=0.3) is None
