"""Numbers that are none, wherever data enters: answered, counted and not remembered."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from guarded_walks import (
    NAMES,
    REFERENCE,
    X_R,
    X,
    command_of,
    controller_of,
    copy,
    equal,
    governor_of,
)

import harpy_pin as hp
from harpy_pin.governors import ForceRows
from harpy_pin.governors.point_mass import Law
from harpy_pin.governors.thrust import CentreGains
from harpy_pin.model.entry import FADE, HOLD_TICKS


def spoiled(rng, state, name):
    """A copy of the state with one number of those that a controller reads spoiled."""
    bad = state.copy()
    fields = ["t", "q", "v", "foot_force"] + ([] if name == "wbc" else ["foot_position"])
    field = fields[rng.integers(len(fields))]
    value = (np.nan, np.inf, -np.inf)[rng.integers(3)]
    if field == "t":
        bad.t = value
    else:
        array = getattr(bad, field)
        array.reshape(-1)[rng.integers(array.size)] = value
    return bad


@pytest.mark.parametrize("name", NAMES)
def test_bad_samples_leave_no_trace(name, gait, states, fuzz):
    """Commands at good samples are those of a controller that never saw the bad ones, to the last
    bit.
    """
    rng = np.random.default_rng(5)
    controller, clean = controller_of(name, gait), controller_of(name, gait)
    last = hp.Command(np.zeros(6), np.zeros((2, 3)))
    count = 0
    for k, state in enumerate(itertools.islice(itertools.cycle(states), 200 * fuzz)):
        if k % 10 == 0:
            held = controller.step(spoiled(rng, state, name))
            count += 1
            assert equal(held, last), k
        command = controller.step(state)
        assert equal(command, clean.step(state)), k
        assert np.isfinite(command.torque).all()
        assert np.isfinite(command.thrust).all()
        last = copy(command)
    assert controller.bad_samples == count == controller.telemetry()["bad_samples"]
    assert clean.bad_samples == 0
    controller.reset()
    assert controller.bad_samples == 0


@pytest.mark.parametrize("name", NAMES)
def test_blindness_is_held_then_fades(name, gait, states):
    controller = controller_of(name, gait)
    for state in states[:5]:
        good = copy(controller.step(state))
    bad = states[5].copy()
    bad.q[:] = np.nan
    for _ in range(HOLD_TICKS):
        assert equal(controller.step(bad), good)
    for k in range(1, 6):
        command = controller.step(bad)
        np.testing.assert_allclose(command.torque, good.torque * FADE**k, rtol=1e-12)
        np.testing.assert_allclose(command.thrust, good.thrust * FADE**k, rtol=1e-12)
    for _ in range(200):
        command = controller.step(bad)
    assert abs(command.torque).max() < 1e-6
    clean = controller_of(name, gait)
    for state in states[:5]:
        clean.step(state)
    assert equal(controller.step(states[6]), clean.step(states[6]))


@pytest.mark.parametrize("name", REFERENCE)
def test_references_survive_bad_samples(name, robot, fuzz):
    rng = np.random.default_rng(6)
    governor, clean = governor_of(name, robot), governor_of(name, robot)
    governor.reset(X_R)
    clean.reset(X_R)
    bad = 0
    for k in range(200 * fuzz):
        scale = 0.05 if k % 2 else 10.0 ** rng.uniform(-3.0, 2.0)
        x, x_r = X + scale * rng.standard_normal(9), X_R + scale * rng.standard_normal(6)
        if k % 10 == 0:
            both = np.concatenate((x, x_r))
            both[rng.integers(15)] = (np.nan, np.inf, -np.inf)[rng.integers(3)]
            before = governor.applied.copy()
            np.testing.assert_array_equal(governor.update(both[:9], both[9:], 1e-3), before)
            assert governor.status.infeasible
            assert governor.status.least_violation == np.inf
            bad += 1
        np.testing.assert_array_equal(governor.update(x, x_r, 1e-3), clean.update(x, x_r, 1e-3))
        assert np.isfinite(governor.applied).all()
        assert governor.status.infeasible == clean.status.infeasible
        assert governor.status.least_violation < np.inf
    assert governor.status.bad_samples == bad
    assert clean.status.bad_samples == 0


def test_contact_governor_holds_its_bend_and_says_so(robot, states):
    governor, clean = (
        hp.ContactForceFilter(robot, hp.ContactForceFilterParameters(mu=0.05)) for _ in range(2)
    )
    for state in states[:10]:
        governor.update(state, command_of(robot))
        clean.update(state, command_of(robot))
    bend = governor.bend.copy()
    assert abs(bend).max() > 0.1
    bad = states[10].copy()
    bad.foot_force[0, 2] = np.nan
    for k in range(HOLD_TICKS + 3):
        bent = governor.update(bad, command_of(robot))
        share = FADE ** max(k + 1 - HOLD_TICKS, 0)
        np.testing.assert_allclose(bent.thrust.ravel() - 10.0, share * bend[:6], atol=1e-12)
        np.testing.assert_allclose(bent.torque - 1.0, share * bend[6:], atol=1e-12)
        assert governor.status.infeasible
        assert governor.status.least_violation == np.inf
    assert governor.status.bad_samples == HOLD_TICKS + 3
    good = governor.update(states[11], command_of(robot))
    assert equal(good, clean.update(states[11], command_of(robot)))
    assert governor.status.least_violation < np.inf
    # A command that is no number is no reason to forget either.
    governor.update(states[12], hp.Command(np.full(6, np.nan), np.zeros((2, 3))))
    assert governor.status.infeasible
    assert governor.status.bad_samples == HOLD_TICKS + 4
    assert equal(
        governor.update(states[13], command_of(robot)), clean.update(states[13], command_of(robot))
    )


class Flaky:
    """Sensors whose every tenth reading is no number."""

    def __init__(self, count=0):
        self.count = count

    def measure(self, state):
        self.count += 1
        measured = state.copy()
        if self.count % 10 == 0:
            measured.v[self.count % 12] = np.nan
        return measured


@pytest.mark.parametrize("name", NAMES)
def test_walk_with_bad_sensors_is_counted(name, gait, simulator):
    run = simulator.run(controller_of(name, gait), 0.5, sensors=Flaky())
    assert run.ending == "completed"
    measures = hp.measure(run)
    assert measures.bad_samples == 50
    assert not measures.stumbled
    assert np.isfinite(run["torque"]).all()
    assert np.isfinite(run["thrust"]).all()


@pytest.mark.parametrize("name", REFERENCE)
@pytest.mark.parametrize("law", [Law.FULL, Law.PROJECTED])
def test_body_on_its_foot(name, law, robot):
    governor = governor_of(name, robot)
    if name in ("paper", "paper, tracked"):
        gains = CentreGains(k_pr=10.0, k_dr=1.0)
        evaluate_at = "tracked" if "tracked" in name else "measured"
        governor = hp.ExplicitReferenceGovernor(
            ForceRows(mass=4.6, mu=0.25, law=law, evaluate_at=evaluate_at, gains=gains)
        )
    foot = X.copy()
    foot[:3] = foot[6:]
    target = np.append(foot[6:], np.zeros(3))
    governor.reset(target)
    for _ in range(3):
        assert np.isfinite(governor.update(foot, target, 1e-3)).all()
    assert governor.status.infeasible


def test_legs_have_length(robot):
    model = robot.model.copy()
    foot = model.frames[robot.frame_id("left_foot")]
    foot.placement.translation = np.zeros(3)
    with pytest.raises(hp.RobotError, match="left_foot"):
        hp.make_gait(replace(robot, model=model))
