"""Joint friction estimated while walking: its values where they are known, and what it is good for."""

from __future__ import annotations

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.controllers import WholeBodyParameters


def walked(name: str, actuators: hp.Actuators, *, estimate: bool = True, friction: float = 0.5, duration: float = 3.0):
    """A walk with an estimate, or without."""
    return hp.walk(
        hp.Scenario(
            controller={"name": name, "parameters": {"estimate_joint_friction": estimate}},
            ground=hp.Ground(mu_s=friction),
            disturbances=hp.Disturbances(actuators=actuators),
            duration=duration,
        )
    )


@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_finds_viscous_friction(name):
    run = walked(name, hp.Actuators(viscous_friction=2.0))
    assert run.ending == "completed"
    np.testing.assert_allclose(run["viscous_estimate"][-1][[1, 2, 4, 5]], 2.0, rtol=0.1)  # hips and knees swing
    total = run["viscous_estimate"][-1] + run["coulomb_estimate"][-1]
    assert (total[[0, 3]] > 0.3).all()


@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_finds_coulomb_friction(name):
    run = walked(name, hp.Actuators(coulomb_friction=0.4))
    assert run.ending == "completed"
    np.testing.assert_allclose(run["coulomb_estimate"][-1], 0.4, atol=0.06)
    assert (run["viscous_estimate"][-1] < 0.1).all()


def test_finds_none_where_there_is_none():
    run = walked("condensed", hp.Actuators())
    assert run["viscous_estimate"][-1].max() < 0.02
    assert run["coulomb_estimate"][-1].max() < 0.02


def test_finds_it_with_noise():
    scenario = hp.Scenario(
        controller=hp.Condensed(parameters={"estimate_joint_friction": True}),
        ground=hp.Ground(mu_s=0.8),
        disturbances=hp.Disturbances(
            actuators=hp.Actuators(viscous_friction=2.0), noise=hp.Noise.typical(), delay=1e-3
        ),
        duration=3.0,
    )
    run = hp.walk(scenario)
    assert run.ending == "completed"
    np.testing.assert_allclose(run["viscous_estimate"][-1][[1, 2, 4, 5]], 2.0, rtol=0.25)


def test_a_walk_that_slips_or_falls_without_it_does_not():
    strong = hp.Actuators(viscous_friction=3.0, torque_share=1.0)
    with_it, without = (walked("condensed", strong, estimate=on, friction=0.25) for on in (True, False))
    assert with_it.ending == "completed"
    slip = hp.measure(with_it).slip_mm_per_step
    assert slip < 0.5
    assert without.ending != "completed" or hp.measure(without).slip_mm_per_step > 10.0 * slip


def test_reset_forgets_it():
    gait = hp.make_gait(hp.load_harpy())
    controller = hp.CondensedController(gait, WholeBodyParameters(estimate_joint_friction=True))
    simulator = hp.Simulator(gait.robot, hp.Ground(mu_s=0.5), actuators=hp.Actuators(viscous_friction=2.0))
    signals = []
    for _ in range(2):
        controller.reset()
        simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
        run = simulator.run(controller, 0.8)
        signals.append(run["viscous_estimate"])
        assert run["viscous_estimate"][-1].max() > 1.0
    assert np.array_equal(*signals)


def test_a_batch_refuses_it():
    with pytest.raises(hp.errors.InputError, match="estimates no friction"):
        CondensedBatch(hp.load_harpy(), 2, WholeBodyParameters(estimate_joint_friction=True))
