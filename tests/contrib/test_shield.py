"""The shield behind a foreign controller: what comes out is safe, near, and explained."""

import numpy as np
import pytest
from forward_dynamics import constrained_dynamics
from shield_cases import AT_ONCE, ROBOT, draw

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield
from harpy_pin.model.entry import FADE, HOLD_TICKS

MU = 0.3


def margins(state, command):
    """(feet, 2) friction margin and normal force, by Pinocchio; +inf in the air."""
    touching, kappa = (
        state.foot_force[:, 2] > 1.0,
        hp.ContactForceFilterParameters().contact_damping,
    )
    force, _ = constrained_dynamics(ROBOT, state.q, state.v, command, touching, damping=kappa)
    result = np.column_stack((MU * force[:, 2] - np.hypot(force[:, 0], force[:, 1]), force[:, 2]))
    return np.where(touching[:, None], result, np.inf)


def test_report_is_true_and_what_it_calls_safe_is_safe():
    """Against forces from Pinocchio, for commands from small to far beyond the motors."""
    rng, shield = np.random.default_rng(0), Shield(ROBOT, mu=MU, parameters=AT_ONCE)
    unsafe_before = saved = let_through = limited = 0
    for _ in range(400):
        state, command = draw(rng, size=10.0 ** rng.uniform(-1.0, 1.7))
        shield.reset()
        given = hp.Command(command.torque.copy(), command.thrust.copy())
        result, report = shield(state, command)
        np.testing.assert_array_equal(command.torque, given.torque)
        np.testing.assert_array_equal(command.thrust, given.thrust)
        np.testing.assert_array_equal(report.torque, result.torque - given.torque)
        np.testing.assert_array_equal(report.thrust, result.thrust - given.thrust)
        assert report.changed == bool(report.torque.any() or report.thrust.any())
        assert report.reasons or not report.changed
        assert (np.abs(result.torque) <= ROBOT.torque_limit).all()
        assert (np.linalg.norm(result.thrust, axis=1) <= ROBOT.thrust_limit * (1.0 + 1e-12)).all()
        after = margins(state, result)
        np.testing.assert_allclose(
            report.after, after, atol=1e-6 * (1.0 + np.abs(after[np.isfinite(after)]).max())
        )
        beyond = any(reason.startswith(("torque", "thrust")) for reason in report.reasons)
        limited += beyond
        if not beyond:
            before = margins(state, given)
            np.testing.assert_allclose(report.before, before, atol=1e-6)
            unsafe_before += bool((before < 0.0).any())
            saved += report.safe and bool((before < 0.0).any())
            let_through += not report.changed
        assert report.safe == bool((after >= 0.0).all()) or np.abs(after).min() < 1e-6
    assert min(unsafe_before, saved, limited, let_through) > 10
    assert saved > 0.5 * unsafe_before


def test_it_is_the_governor_for_commands_within_the_limits():
    rng = np.random.default_rng(1)
    shield = Shield(ROBOT, mu=MU)
    governor = hp.ContactForceFilter(ROBOT, hp.ContactForceFilterParameters(mu=MU))
    compared = 0
    for _ in range(200):
        state, command = draw(rng, size=1.0)
        result, report = shield(state, command)
        expected = governor.update(state, hp.Command(command.torque.copy(), command.thrust.copy()))
        if (np.abs(expected.torque) > ROBOT.torque_limit).any():
            continue
        if (np.linalg.norm(expected.thrust, axis=1) > ROBOT.thrust_limit).any():
            continue
        compared += 1
        np.testing.assert_array_equal(result.torque, expected.torque)
        np.testing.assert_array_equal(result.thrust, expected.thrust)
        np.testing.assert_array_equal(report.before.ravel(), governor.status.h_r)
        np.testing.assert_array_equal(report.after.ravel(), governor.status.h_w)
    assert compared > 100


def test_reasons_name_what_was_beyond():
    shield = Shield(ROBOT, mu=MU, parameters=AT_ONCE)
    state, _ = draw(np.random.default_rng(2), size=1.0)
    state.foot_force[:] = 0.0  # in the air there is no friction to keep
    still = hp.Command(np.zeros(6), np.zeros((2, 3)))
    _, report = shield(state, still)
    assert (report.changed, report.safe, report.reasons) == (False, True, ())
    strong = hp.Command(np.zeros(6), np.zeros((2, 3)))
    strong.torque[2], strong.thrust[1] = 1e4, (0.0, 3e3, 4e3)
    result, report = shield(state, strong)
    assert report.reasons == (f"torque {ROBOT.joints[2]}", f"thrust {ROBOT.thrusters[1]}")
    assert result.torque[2] == ROBOT.torque_limit[2]
    np.testing.assert_allclose(result.thrust[1], np.array((0.0, 0.6, 0.8)) * ROBOT.thrust_limit)
    state.foot_force[:, 2] = 30.0
    pulled = hp.Command(np.zeros(6), np.tile((20.0, 0.0, 20.0), (2, 1)))
    before = margins(state, pulled)
    _, report = shield(state, pulled)
    for k, foot in enumerate(ROBOT.feet):
        assert (f"friction {foot}" in report.reasons) or before[k, 0] > 0.0
        assert (f"normal force {foot}" in report.reasons) == (before[k, 1] < 1.0)
    assert report.reasons


def test_change_fades_where_it_is_needed_no_more():
    shield = Shield(ROBOT, mu=MU)
    rng = np.random.default_rng(3)
    state, _ = draw(rng, size=1.0)
    pulled = hp.Command(np.zeros(6), np.tile((20.0, 0.0, 20.0), (2, 1)))
    shield(state, pulled)
    state.foot_force[:] = 0.0
    _, report = shield(state, pulled)
    assert report.reasons == ("fading",)
    shield.reset()
    _, report = shield(state, pulled)
    assert report.reasons == ()


def test_bad_commands_are_answered_by_the_last_good_one():
    shield = Shield(ROBOT, mu=MU)
    state, command = draw(np.random.default_rng(4), size=1.0)
    good, _ = shield(state, command)
    bad = hp.Command(np.full(6, np.nan), command.thrust)
    for tick in range(HOLD_TICKS + 3):
        result, report = shield(state, bad)
        scale = FADE ** max(tick + 1 - HOLD_TICKS, 0)
        np.testing.assert_allclose(result.torque, scale * good.torque, rtol=1e-12)
        np.testing.assert_allclose(result.thrust, scale * good.thrust, rtol=1e-12)
        assert (report.safe, report.reasons) == (False, ("bad command",))
        assert report.changed


def test_bad_states_are_told():
    shield = Shield(ROBOT, mu=MU)
    state, command = draw(np.random.default_rng(5), size=1.0)
    state.q[9] = np.nan
    result, report = shield(state, command)
    np.testing.assert_array_equal(result.torque, command.torque)
    assert (report.changed, report.safe, report.reasons) == (False, False, ("bad state",))
    assert np.isnan(report.before).all()


def test_bad_states_are_answered_like_the_filter():
    shield = Shield(ROBOT, mu=MU)
    governor = hp.ContactForceFilter(ROBOT, hp.ContactForceFilterParameters(mu=MU))
    rng = np.random.default_rng(7)
    state, _ = draw(rng, size=1.0)
    pulled = hp.Command(np.zeros(6), np.tile((5.0, 0.0, 5.0), (2, 1)))
    for tick in range(HOLD_TICKS + 10):
        result, report = shield(state, pulled)
        expected = governor.update(state, hp.Command(pulled.torque.copy(), pulled.thrust.copy()))
        np.testing.assert_array_equal(result.torque, expected.torque)
        np.testing.assert_array_equal(result.thrust, expected.thrust)
        assert report.changed
        assert shield.governor.status.bad_samples == tick
        state.v[0] = np.nan


def test_wrong_shapes_are_refused_and_lists_are_taken():
    shield = Shield(ROBOT, mu=MU)
    state, command = draw(np.random.default_rng(6), size=1.0)
    with pytest.raises(hp.InputError, match=r"command.torque must have shape \(6,\)"):
        shield(state, hp.Command(np.zeros(5), np.zeros((2, 3))))
    with pytest.raises(hp.InputError, match="mu must be"):
        Shield(ROBOT, mu=-1.0)
    as_lists = hp.Command(command.torque.tolist(), command.thrust.tolist())
    expected, _ = Shield(ROBOT, mu=MU)(state, command)
    result, _ = shield(state, as_lists)
    np.testing.assert_array_equal(result.torque, expected.torque)


class Shielded:
    period = 1e-3

    def __init__(self, gait):
        self.inner = hp.make_controller("governed", gait, mu=0.2, governor="none")
        self.shield, self.reports = Shield(gait.robot, mu=0.2), []

    def step(self, state):
        command, report = self.shield(state, self.inner.step(state))
        self.reports.append(report)
        return command


def test_walk_behind_it_slips_less():
    scenario = hp.Scenario(
        ground=hp.Ground(mu_s=0.2), duration=2.0, controller=hp.Governed(governor="none")
    )
    made = []

    def shielded(gait):
        made.append(Shielded(gait))
        return made[0]

    plain, held = hp.walk(scenario), hp.walk(scenario, controller=shielded)
    assert held.ending == "completed"
    slips = [hp.measure(run, step_duration=0.75).slip_mm_per_step for run in (plain, held)]
    assert slips[1] < 0.5 * slips[0]
    assert any(report.changed for report in made[0].reports)
