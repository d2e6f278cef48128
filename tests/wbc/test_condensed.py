"""The condensed controller: its promise on the contact forces, its optimum, and the walks it
makes.
"""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import constrained_dynamics
from walks import OWN_SEARCH, own_search, states_of, walked
from whole_body_oracle import NV, ROBOT, WEIGHTS, wild_case

import harpy_pin as hp
from harpy_pin.wbc import WholeBodyLimits
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus
from reproduction.chattering import chattering


def test_promise_for_every_state_and_target(fuzz):
    """The force on every held foot is the one intended, and it is in its pyramid and range:
    whatever was asked for.

    ``--fuzz 500`` looks at a million states.
    """
    dynamics = hp.Dynamics(ROBOT)
    rng = np.random.default_rng(0)
    limits = WholeBodyLimits(mu=0.3, torque_scale=0.6)
    condensed = CondensedSolver(ROBOT, WEIGHTS, limits)
    seen = CondensedStatus.OPTIMAL
    for _ in range(2000 * fuzz):
        q, v, targets = wild_case(rng, spread=10.0 ** rng.uniform(-2.0, -0.5))
        dynamics.update(q, v)
        inputs = condensed.solve(dynamics, v, targets)
        assert np.isfinite(inputs).all()
        assert (np.abs(inputs[:6]) <= 53.0).all()
        assert (np.abs(inputs[6:]) <= 0.6 * ROBOT.torque_limit + 1e-12).all()
        held = targets.held > 0.0
        for k in np.flatnonzero(held):
            assert (limits.pyramid @ condensed.force[k]).min() >= -1e-9 * (
                1.0 + condensed.force[k, 2]
            )
            least = targets.force_range[k, 0] * condensed.record["least_share"][0, k]
            assert least - 1e-9 <= condensed.force[k, 2] <= 200.0 + 1e-9
        assert (condensed.force[~held] == 0.0).all()
        seen |= condensed.status
        if condensed.status & CondensedStatus.TORQUE_CLIPPED:
            continue
        command = hp.Command(inputs[6:], inputs[:6].reshape(2, 3))
        force, acceleration = constrained_dynamics(
            ROBOT, q, v, command, targets.held, desired=targets.feet
        )
        scale = 1.0 + np.abs(force).max() + np.abs(inputs).max()
        np.testing.assert_allclose(condensed.force, force, rtol=0, atol=1e-8 * scale)
        np.testing.assert_allclose(
            condensed.acceleration,
            acceleration,
            rtol=0,
            atol=1e-6 * (1.0 + np.abs(acceleration).max()),
        )
    # The states and targets reached what they were to reach.
    assert seen & CondensedStatus.THRUST_LIMITED
    assert seen & CondensedStatus.TORQUE_LIMITED


def the_way(dynamics, condensed, rng):
    """A function of the place on the way from one random state and target to another: inputs and
    status.
    """
    q, v, targets = wild_case(rng, spread=0.05)
    far_q = pin.integrate(ROBOT.model, q, 0.2 * rng.standard_normal(NV))
    far_v = v + 0.3 * rng.standard_normal(NV)
    fields = (targets.body, targets.orientation, targets.feet)
    near = [field.copy() for field in fields]
    size = 10.0 ** rng.uniform(-1.0, 2.0)
    far = [field + size * rng.standard_normal(field.shape) for field in near]

    def at(s):
        for field, a, b in zip(fields, near, far, strict=True):
            field[:] = (1.0 - s) * a + s * b
        here, speed = pin.interpolate(ROBOT.model, q, far_q, s), (1.0 - s) * v + s * far_v
        dynamics.update(here, speed)
        condensed.reset()
        return condensed.solve(dynamics, speed, targets).copy(), condensed.status

    return at


def test_continuous_in_state_and_target():
    """The largest step between samples of a way is cut in half again and again: a jump would stay.
    Limits of friction, thrust and torque come and go on the way; where torques have to be clipped,
    nothing is promised.
    """
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(7)
    condensed = CondensedSolver(ROBOT, WEIGHTS, WholeBodyLimits(mu=0.3, torque_scale=0.6))
    crossed = set()
    for _ in range(60):
        at = the_way(dynamics, condensed, rng)
        places = np.linspace(0.0, 1.0, 61)
        answers = [at(s) for s in places]
        steps = [np.abs(b[0] - a[0]).max() for a, b in pairwise(answers)]
        i = int(np.argmax(steps))
        low, high, below, above = places[i], places[i + 1], answers[i], answers[i + 1]
        for _ in range(40):
            middle = 0.5 * (low + high)
            answer = at(middle)
            if np.abs(answer[0] - below[0]).max() > np.abs(above[0] - answer[0]).max():
                high, above = middle, answer
            else:
                low, below = middle, answer
        if (below[1] | above[1]) & (CondensedStatus.SUBOPTIMAL | CondensedStatus.TORQUE_CLIPPED):
            continue
        crossed |= {status for _, status in answers}
        assert np.abs(above[0] - below[0]).max() < 1e-4
    assert {
        CondensedStatus.OPTIMAL,
        CondensedStatus.THRUST_LIMITED,
        CondensedStatus.TORQUE_LIMITED,
    } <= crossed


def test_no_chattering():
    """A command that chatters changes its direction once or twice in a tick, so four times as often
    at a quarter of the period; a smooth one as often as before.
    """
    reversals = []
    for period in (1e-3, 2.5e-4):
        run = walked(mu_s=0.15, duration=2.0, period=period, dt=2.5e-4)
        assert run.ending == "completed"
        signals = np.concatenate((run["torque"], run["thrust"].reshape(len(run), -1)), axis=1)
        reversals.append(chattering(signals, period=period).reversals_per_s)
    assert reversals[1] < 1.3 * reversals[0]


def test_walks_like_the_whole_body_program():
    """Torques of one second of a pushed walk on slippery ground; the same slip in the end."""
    pushes = (hp.Push(0.6, (0.0, 4.0, 0.0)),)
    own = {"name": "wbc", "parameters": OWN_SEARCH}
    condensed, proxqp, wbc = (
        walked(controller=part, mu_s=0.15, duration=2.0, pushes=pushes)
        for part in ("condensed", "wbc", own)
    )
    assert condensed.ending == proxqp.ending == wbc.ending == "completed"
    np.testing.assert_allclose(condensed["q"], wbc["q"], rtol=0, atol=2e-4)
    np.testing.assert_allclose(proxqp["q"], wbc["q"], rtol=0, atol=1e-6)
    assert hp.measure(proxqp).solver_fallbacks == 0
    a, b = hp.measure(condensed), hp.measure(wbc)
    assert a.slip_mm_per_step == pytest.approx(b.slip_mm_per_step, abs=2e-3)
    assert a.thrust_max_n == pytest.approx(b.thrust_max_n, rel=1e-2)


@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_the_first_tick_has_no_command_to_hold(name):
    """New or reset, with a velocity that no motor can stop: clipped torques, or the soft posture,
    and not zero.
    """
    gait = hp.make_gait(ROBOT)
    q, v = gait.initial_state()
    dynamics, fast = hp.Dynamics(ROBOT), v + np.random.default_rng(0).normal(scale=8.0, size=12)
    dynamics.update(q, fast)
    wild = hp.State(0.0, q, fast, dynamics.foot_position, dynamics.foot_velocity, np.zeros((2, 3)))
    for again in (False, True):
        controller = hp.make_controller(name, gait, mu=0.3, **own_search(name))
        if again:
            controller.step(
                hp.State(0.0, q, v, wild.foot_position, wild.foot_velocity, wild.foot_force)
            )
            controller.reset()
        torque = controller.step(wild).torque
        assert (controller.clipped if name == "condensed" else controller.failures) == 1
        assert np.abs(torque).max() > 0.1


def test_where_no_forces_are_within_reach_the_last_command_is_held():
    """A foot in the air is taken for one on the ground: no motor can stop it within the tick. The
    QP has no solution there; both hold the last command for a while, and go on as if nothing had
    been.
    """
    states = states_of(walked(duration=0.53))
    condensed, qp = (
        hp.make_controller(name, hp.make_gait(ROBOT), mu=0.25, **own_search(name))
        for name in ("condensed", "wbc")
    )
    for state in states:
        good = condensed.step(state).torque.copy()
        qp.step(state)
    touched = states[-1].copy()
    touched.foot_force[np.argmin(condensed.targets.held), 2] = 5.0
    for _ in range(condensed.parameters.hold_ticks):
        np.testing.assert_array_equal(condensed.step(touched).torque, good)
        qp.step(touched)
    assert condensed.clipped == qp.failures == condensed.parameters.hold_ticks
    clipped = condensed.step(touched).torque
    assert np.abs(clipped - good).max() > 1.0
    assert (np.abs(clipped) <= ROBOT.torque_limit).all()
    after = condensed.step(states[-1])
    fresh = qp.step(states[-1])
    np.testing.assert_allclose(after.torque, fresh.torque, rtol=0, atol=1e-3)
