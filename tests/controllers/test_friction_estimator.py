"""The estimate of the friction coefficient: its bounds, what slides and sticks teach it, and who
follows it.
"""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_states import draw
from walks import own_search, scenario, walked
from whole_body_oracle import wild_case

import harpy_pin as hp
from harpy_pin import InputError
from harpy_pin.controllers import (
    GovernedController,
    GovernedParameters,
    WholeBodyController,
    WholeBodyParameters,
)
from harpy_pin.controllers.condensed import CondensedController
from harpy_pin.controllers.friction import (
    FILTER_TIME,
    LEAST_ESTIMATE,
    LEAST_LOAD,
    MARGIN,
    MEMORY,
    RECOVERY,
    SLIP_SPEED,
)
from harpy_pin.controllers.governed import FrictionEstimator
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.wbc import FORMULATIONS, WholeBodyLimits, make_problem
from harpy_pin.wbc.condensed import CondensedSolver

HELD = np.ones(2)
number = st.floats(-1e3, 1e3) | st.sampled_from((0.0, np.nan, np.inf, -np.inf, 1e300))
samples = st.lists(
    st.tuples(*[st.lists(number, min_size=6, max_size=6)] * 2, st.tuples(*[st.booleans()] * 2)),
    max_size=60,
)


def feed(estimator, force, velocity, times=1, held=HELD):
    for _ in range(times):
        estimator.update(
            np.array(force, dtype=float),
            np.array(velocity, dtype=float),
            np.array(held, dtype=float),
        )
    return estimator.estimate.copy()


def both(*vector):
    return np.tile(vector, (2, 1))


@given(samples, st.floats(0.0, 10.0))
def test_it_is_within_its_bounds_whatever_is_measured(sequence, assumed):
    estimator, lowest = FrictionEstimator(assumed=assumed), LEAST_ESTIMATE
    for force, velocity, held in sequence:
        estimate = feed(
            estimator, np.reshape(force, (2, 3)), np.reshape(velocity, (2, 3)), held=held
        )
        assert np.all(estimate >= min(lowest, assumed))
        assert np.all(estimate <= assumed)
        assert min(lowest, assumed) <= estimator.least[0] <= assumed


@given(samples, st.integers(0, 1), st.integers(0, 4), st.sampled_from((np.nan, np.inf, -np.inf)))
def test_a_bad_sample_of_a_foot_leaves_that_foot_as_it_was(sequence, foot, entry, bad):
    estimator = FrictionEstimator(assumed=0.8)
    for force, velocity, held in sequence:
        feed(estimator, np.reshape(force, (2, 3)), np.reshape(velocity, (2, 3)), held=held)
    names = [
        name
        for name in estimator.record.dtype.names
        if estimator.record.dtype[name].shape[:1] == (2,)
    ]
    before = {name: estimator.record[name][0, foot].copy() for name in names}
    force, velocity = both(3.0, 0.0, 30.0), both(0.2, 0.0, 0.0)
    (force[foot] if entry < 3 else velocity[foot])[entry if entry < 3 else entry - 3] = bad
    feed(estimator, force, velocity)
    assert {"estimate", "proven", "samples", "force", "velocity"} <= set(names)
    for name in names:
        np.testing.assert_array_equal(estimator.record[name][0, foot], before[name])


@given(st.integers(0, 10_000))
def test_what_sticks_never_lowers_it(seed):
    rng = np.random.default_rng(seed)
    estimator = FrictionEstimator(assumed=0.8)
    estimator.estimate[:] = before = rng.uniform(0.1, 0.8, 2)
    for _ in range(200):
        angle, speed = rng.uniform(0.0, 2.0 * np.pi, 2), rng.uniform(0.0, SLIP_SPEED, 2)
        velocity = np.column_stack(
            (speed * np.cos(angle), speed * np.sin(angle), rng.standard_normal(2))
        )
        force = np.column_stack(
            (rng.standard_normal((2, 2)) * 10.0, rng.uniform(LEAST_LOAD + 1e-9, 60.0, 2))
        )
        # a foothold begins
        before = before if estimator.record["samples"][0].any() else np.full(2, before.min())
        estimate = feed(estimator, force, velocity)
        assert np.all(estimate >= before)
        before = estimate


@pytest.mark.parametrize("ratio", [0.05, 0.15, 0.5, 0.79])
@pytest.mark.parametrize("speed", [0.03, 1.0])
def test_a_slide_gives_its_ratio_less_the_margin(ratio, speed):
    for angle in np.linspace(0.0, 6.0, 7):
        estimator = FrictionEstimator(assumed=0.8)
        along = np.array((np.cos(angle), np.sin(angle), 0.0))
        estimate = feed(
            estimator, both(*-20.0 * ratio * along[:2], 20.0), both(*speed * along), times=30
        )
        np.testing.assert_allclose(estimate, (1.0 - MARGIN) * ratio, rtol=1e-12)


def test_a_slide_is_noticed_within_the_filter_time():
    estimator = FrictionEstimator(assumed=0.8)
    ticks = 1
    while feed(estimator, both(-3.0, 0.0, 20.0), both(0.1, 0.0, 0.0))[0] == 0.8:
        ticks += 1
    assert ticks <= 1e3 * FILTER_TIME + 1


def test_a_slide_that_has_ended_does_not_lower_it_with_the_force_of_the_sticking_foot():
    """The low-passed speed is still above the threshold when the foot sticks, with nearly no
    force.
    """
    estimator = FrictionEstimator(assumed=0.8)
    feed(estimator, both(-6.0, 0.0, 20.0), both(0.3, 0.0, 0.0), times=20)
    estimate = feed(estimator, both(0.1, 0.0, 20.0), both(0.0, 0.0, 0.0), times=20)
    assert np.all(estimate >= (1.0 - MARGIN) * 0.3 * (1.0 - 1e-12))


def test_while_it_slides_it_never_rises():
    rng = np.random.default_rng(0)
    estimator, before = FrictionEstimator(assumed=0.8), np.full(2, 0.8)
    for _ in range(500):
        normal = rng.uniform(6.0, 60.0)
        force = both(-normal * rng.uniform(0.05, 0.6), 0.0, normal)
        estimate = feed(estimator, force, both(rng.uniform(0.05, 1.0), 0, 0))
        assert np.all(estimate <= before)
        before = estimate


def test_what_a_foot_holds_is_proven():
    """A foot that sticks at a ratio has at least that, less the margin, at once; and no slide of
    noise undoes it.
    """
    estimator = FrictionEstimator(assumed=0.8)
    estimator.estimate[:] = 0.1
    estimate = feed(estimator, both(10.0, 0.0, 20.0), both(0.0, 0.0, 0.0), times=10)
    assert np.all(estimate >= (1.0 - MARGIN) * 0.5)
    estimator.estimate[:] = 0.48
    estimate = feed(estimator, both(-0.2, 0.0, 20.0), both(0.2, 0.0, 0.0), times=3)
    np.testing.assert_allclose(estimate, (1.0 - MARGIN) * 0.5 * np.exp(-3e-3 / MEMORY), rtol=0.02)


def test_all_of_it_comes_back_under_load():
    estimator = FrictionEstimator(assumed=0.8)
    feed(estimator, both(-2.0, 0.0, 20.0), both(0.2, 0.0, 0.0), times=20)
    ticks = int(np.ceil((0.8 - LEAST_ESTIMATE) / RECOVERY * 1e3)) + 100
    assert estimator.estimate.max() < 0.1
    np.testing.assert_array_equal(
        feed(estimator, both(0.0, 0.0, 20.0), both(0.0, 0.0, 0.0), times=ticks), 0.8
    )


def test_a_foot_that_lands_takes_what_the_other_knows_if_it_is_lower():
    estimator = FrictionEstimator(assumed=0.8)
    feed(estimator, both(-2.0, 0.0, 20.0), both(0.2, 0.0, 0.0), times=20, held=(1.0, 0.0))
    np.testing.assert_allclose(estimator.estimate, (0.095, 0.8))
    feed(estimator, both(-2.0, 0.0, 20.0), both(0.2, 0.0, 0.0))
    np.testing.assert_allclose(estimator.estimate, 0.095)
    estimator.reset()
    np.testing.assert_array_equal(estimator.estimate, 0.8)


@pytest.mark.parametrize("velocity", [both(0.0, 0.0), np.zeros((3, 3)), np.zeros(6), "still"])
def test_other_arrays_are_refused(velocity):
    with pytest.raises(InputError, match="foot_velocity"):
        FrictionEstimator(assumed=0.8).update(np.zeros((2, 3)), velocity, HELD)


@pytest.mark.parametrize("name", [*FORMULATIONS, "condensed"])
def test_a_lower_coefficient_of_the_feet_is_one_of_the_limits(robot, name):
    """Program (or forces) for μ = 0.8 with 0.2 under the feet are those for μ = 0.2; nothing is
    left of it after.
    """
    rng, different = np.random.default_rng(5), 0
    limits = [WholeBodyLimits(mu=mu) for mu in (0.8, 0.2)]
    kind = (
        partial(CondensedSolver, robot)
        if name == "condensed"
        else partial(make_problem, name, robot)
    )
    high, low = (kind(limits=one) for one in limits)

    def result(one, friction=np.inf):
        targets.friction[:] = friction
        if name == "condensed":
            one.reset()
            one.solve(dynamics, v, targets)
            return one.force.copy()
        one.build(dynamics, v, dynamics.rotation, targets)
        return np.column_stack((one.program.inequality, one.program.lower, one.program.upper))

    for _ in range(10):
        q, v, targets = wild_case(rng, spread=0.2)
        dynamics = Dynamics(robot)
        dynamics.update(q, v)
        plain, limited = result(high), result(low)
        different += np.abs(plain - limited).max() > 1e-3
        for one in (high, low):
            np.testing.assert_array_equal(result(one, 0.2), limited)
        np.testing.assert_array_equal(result(high, 0.9), plain)
    assert different >= 5


@pytest.mark.parametrize("kind", [CondensedController, WholeBodyController])
def test_a_controller_keeps_the_cones_of_its_estimate_at_every_tick(gait, robot, kind):
    """Whatever is measured, tick after tick."""
    rng = np.random.default_rng(3)
    parameters = WholeBodyParameters.for_gait(
        gait, estimate_friction=True, solver="active_set", limits={"mu": 0.8}
    )
    controller = kind(gait, parameters)
    lowest = 1.0
    for _ in range(300):
        controller.step(draw(robot, rng))
        estimate = controller.telemetry()["friction_estimate"]
        if kind is WholeBodyController and not controller.solution.usable:
            continue
        force = controller.telemetry()["desired_force"]
        allowed, within = (
            0.75 * estimate * force[:, 2],
            1e-9 if kind is CondensedController else 1e-5,
        )
        assert np.all(
            np.hypot(force[:, 0], force[:, 1]) <= allowed + within * (1.0 + np.abs(force).max())
        )
        lowest = min(lowest, estimate.min())
    assert lowest < 0.4
    controller.reset()
    np.testing.assert_array_equal(controller.telemetry()["friction_estimate"], 0.8)


@pytest.mark.parametrize(("controller", "plant"), [("condensed", "mujoco"), ("wbc", "compliant")])
def test_it_holds_the_feet_on_ice(controller, plant):
    """A strip of 0.15 on ground of 0.8: without the estimate feet slide by decimetres, with it by
    millimetres.
    """
    slip = {}
    for estimate in (False, True):
        part = {
            "name": controller,
            "parameters": {"estimate_friction": estimate, **own_search(controller)},
        }
        run = walked(
            controller=part,
            plant=plant,
            mu_s=0.8,
            friction_strips=((0.3, 0.7, 0.15),),
            duration=3.0,
        )
        assert run.ending == "completed"
        slip[estimate] = 1e3 * run["slip_path"][-1].sum()
        assert ("friction_estimate" in run) is estimate
    assert slip[False] > 100.0
    assert slip[True] < 10.0


@pytest.mark.parametrize("mu", [0.15, 0.3, 0.8])
def test_noise_does_not_lower_it_for_long(mu):
    """On the ground that is assumed, with noise and 2 ms of delay, the estimate is on average
    nearly all of it.
    """
    part = hp.Condensed(parameters={"estimate_friction": True})
    run = walked(controller=part, mu_s=mu, noise=hp.Noise.typical(), delay=2e-3, duration=3.0)
    assert run.ending == "completed"
    assert run["friction_estimate"].mean() > 0.85 * mu


@pytest.mark.parametrize("governor", ["paper", "filter"])
def test_governors_take_it(governor):
    """Where feet slide, the governors' coefficients are those of the estimate, and rows follow."""
    part = hp.Governed(governor=governor, mu=0.8, parameters={"estimate_friction": True})
    built = hp.build(scenario(controller=part, mu_s=0.15, duration=0.6))
    run = built.run()
    controller = built.controller
    assert isinstance(controller, GovernedController)
    assert run["friction_estimate"].min() < 0.3
    assert controller.friction is not None
    if governor == "filter":
        np.testing.assert_array_equal(
            controller.force_filter.friction, controller.friction.estimate
        )
    else:
        np.testing.assert_array_equal(controller.governor.rows.friction, controller.friction.least)
    controller.reset()
    np.testing.assert_array_equal(controller.friction.estimate, 0.8)


def test_an_estimate_needs_a_governor_that_takes_it(robot):
    with pytest.raises(InputError, match="governor"):
        GovernedController(hp.make_gait(robot), None, GovernedParameters(estimate_friction=True))
