"""A batch of shields: every environment is answered as by a shield of its own."""

import numpy as np
import pytest
from shield_cases import AT_ONCE, ROBOT, draw

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield
from harpy_pin.contrib.shield_batch import ShieldBatch
from harpy_pin.model.entry import HOLD_TICKS

WHAT = ("friction", "normal force")


def stack(pairs):
    """Arrays of a batch from states and commands."""
    states, commands = zip(*pairs, strict=True)
    return (
        *(
            np.array([getattr(state, name) for state in states])
            for name in ("q", "v", "foot_force")
        ),
        *(
            np.array([getattr(command, name) for command in commands])
            for name in ("torque", "thrust")
        ),
    )


def compare(batch, shields, pairs):
    """One call of the batch against one of each shield; returns the single reports."""
    given = stack(pairs)
    copies = [array.copy() for array in given]
    torque, thrust, report = batch(*given)
    for array, copy in zip(given, copies, strict=True):
        np.testing.assert_array_equal(array, copy)
    singles = []
    for i, (shield, (state, command)) in enumerate(zip(shields, pairs, strict=True)):
        expected, single = shield(state, command)
        np.testing.assert_allclose(torque[i], expected.torque, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(thrust[i], expected.thrust, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(report.before[i], single.before, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(report.after[i], single.after, rtol=1e-9, atol=1e-9)
        assert (report.changed[i], report.safe[i]) == (single.changed, single.safe)
        assert report.bad_state[i] == ("bad state" in single.reasons)
        assert report.bad_command[i] == ("bad command" in single.reasons)
        assert report.limited[i] == any(
            reason.startswith(("torque", "thrust")) for reason in single.reasons
        )
        for k, foot in enumerate(ROBOT.feet):
            assert report.short[i, k].tolist() == [
                f"{what} {foot}" in single.reasons for what in WHAT
            ]
        singles.append(single)
    return singles


@pytest.mark.parametrize("parameters", [None, AT_ONCE], ids=["lag", "at once"])
def test_every_environment_has_a_shield_of_its_own(parameters):
    rng, n = np.random.default_rng(0), 6
    mu = rng.uniform(0.15, 0.6, n)
    batch = ShieldBatch(ROBOT, n, mu=mu, parameters=parameters)
    shields = [Shield(ROBOT, mu=value, parameters=parameters) for value in mu]
    seen: set[str] = set()
    for tick in range(40):
        pairs = [draw(rng, size=10.0 ** rng.uniform(-1.0, 1.7)) for _ in range(n)]
        if tick % 7 == 3:
            pairs[1][0].q[8] = np.nan
            pairs[2][1].torque[0] = np.inf
            pairs[3][0].foot_force[1, 2] = np.nan
        for report in compare(batch, shields, pairs):
            seen.update(reason.split()[0] for reason in report.reasons)
        if tick == 20:
            batch.reset([0, 4])
            for i in (0, 4):
                shields[i].reset()
    assert {"friction", "normal", "torque", "thrust", "bad"} <= seen


def test_bad_samples_are_bridged_as_by_a_single_shield():
    rng = np.random.default_rng(1)
    batch, shields = ShieldBatch(ROBOT, 2, mu=0.3), [Shield(ROBOT, mu=0.3) for _ in range(2)]
    good = [draw(rng, size=3.0) for _ in range(2)]
    compare(batch, shields, good)
    good[0][0].v[3] = np.nan
    good[1][1].thrust[0, 1] = np.nan
    for _ in range(HOLD_TICKS + 3):
        compare(batch, shields, good)
    compare(batch, shields, [draw(rng, size=1.0) for _ in range(2)])


def test_wrong_arrays_are_refused():
    batch = ShieldBatch(ROBOT, 3, mu=0.3)
    arrays = list(stack([draw(np.random.default_rng(2), size=1.0) for _ in range(3)]))
    with pytest.raises(hp.InputError, match=r"thrust must have shape \(3, 2, 3\), got \(3, 6\)"):
        batch(*arrays[:4], arrays[4].reshape(3, 6))
    for n, mu in ((0, 0.3), (2.0, 0.3), (2, -0.1), (2, [0.1, 0.2, 0.3]), (2, np.nan)):
        with pytest.raises(hp.InputError, match=r"n must|mu must"):
            ShieldBatch(ROBOT, n, mu=mu)
