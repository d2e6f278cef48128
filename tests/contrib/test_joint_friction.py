"""Joint friction estimated while walking: its values where they are known, and what it is good
for.
"""

import numpy as np
import pytest
from walks import own_search, walked

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.controllers import WholeBodyParameters


def estimating(
    name: str = "condensed", *, estimate: bool = True, mu_s: float = 0.5, **how: object
) -> hp.Run:
    """A walk with an estimate, or without."""
    part = {"name": name, "parameters": {"estimate_joint_friction": estimate, **own_search(name)}}
    return walked(controller=part, mu_s=mu_s, duration=3.0, **how)


@pytest.mark.parametrize(
    ("name", "noise", "within"),
    [
        ("condensed", {}, 0.1),
        ("wbc", {}, 0.1),
        ("condensed", {"noise": hp.Noise.typical(), "delay": 1e-3}, 0.25),
    ],
)
def test_finds_viscous_friction(name, noise, within):
    run = estimating(name, actuators=hp.Actuators(viscous_friction=2.0), **noise)
    assert run.ending == "completed"
    np.testing.assert_allclose(
        run["viscous_estimate"][-1][[1, 2, 4, 5]], 2.0, rtol=within
    )  # hips and knees swing
    total = run["viscous_estimate"][-1] + run["coulomb_estimate"][-1]
    assert (total[[0, 3]] > 0.3).all()


@pytest.mark.parametrize(("name", "size"), [("condensed", 0.4), ("wbc", 0.4), ("condensed", 0.0)])
def test_finds_coulomb_friction(name, size):
    run = estimating(name, actuators=hp.Actuators(coulomb_friction=size))
    assert run.ending == "completed"
    np.testing.assert_allclose(run["coulomb_estimate"][-1], size, atol=0.06 if size else 0.02)
    assert (run["viscous_estimate"][-1] < (0.1 if size else 0.02)).all()


def test_a_walk_that_slips_or_falls_without_it_does_not():
    strong = hp.Actuators(viscous_friction=3.0, torque_share=1.0)
    with_it, without = (
        estimating(actuators=strong, estimate=on, mu_s=0.25) for on in (True, False)
    )
    assert with_it.ending == "completed"
    slip = hp.measure(with_it).slip_mm_per_step
    assert slip < 0.5
    assert without.ending != "completed" or hp.measure(without).slip_mm_per_step > 10.0 * slip


def test_a_batch_refuses_it():
    with pytest.raises(hp.errors.InputError, match="estimates no friction"):
        CondensedBatch(
            hp.load_harpy(),
            2,
            WholeBodyParameters.for_gait(
                hp.make_gait(hp.load_harpy()), estimate_joint_friction=True
            ),
        )
