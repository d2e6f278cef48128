"""The governors beyond the paper's, on the reduced-order model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from reduced_states import references, states

from harpy_pin.errors import InputError
from harpy_pin.governors import ConeGovernor
from harpy_pin.governors.reduced.cone import ROWS, cone_record, cone_rows
from harpy_pin.governors.reduced.feedback import acceleration, direction, feedback, feedback_record, lift
from harpy_pin.governors.reduced.point_mass import Law, leg_force
from harpy_pin.model.thrust import CentreGains, centre_feedback
from reproduction.margin import MarginGovernor
from reproduction.vlip_simulation import (
    VLIP_GOVERNORS,
    VlipParameters,
    cartesian,
    simulate_vlip,
    vlip_governor,
    vlip_setting,
)

GAINS = CentreGains(k_pt=660.0, k_dt=60.0, k_pr=300.0, k_dr=30.0)
MASS, MU, G = 4.0, 0.45, 9.81


def model(x, w, law):
    """Contact force and acceleration of the model's own equations (equations.md E3–E6)."""
    r, thrust, force = x[:3] - x[6:], np.empty(3), np.empty(3)
    u_r = centre_feedback(r, x[:3], x[3:6], w, int(law), GAINS.record[0], thrust)
    if law is Law.FULL:
        u_r = 0.0
    leg_force(r, MASS, np.array([0.0, 0.0, -G]), thrust, u_r, np.zeros(3), force)
    return force, np.array([0.0, 0.0, -G]) + (thrust + force) / MASS, thrust


@given(states(), references(), st.sampled_from(Law))
def test_feedback_is_the_law(x, w, law):
    p = feedback_record(mass=MASS, g=G, gains=GAINS, law=law)[0]
    r_hat, force, c_ddot = np.empty(3), np.empty(3), np.empty(3)
    direction(x, r_hat)
    feedback(x, w, r_hat, p, force)
    acceleration(force, r_hat, p, c_ddot)
    expected_force, expected, _ = model(x, w, law)
    np.testing.assert_allclose(c_ddot, expected, rtol=1e-9, atol=1e-8)
    sign = 1.0 if law is Law.PROJECTED else -1.0
    normal = r_hat[2] * (MASS * G * r_hat[2] + sign * r_hat @ force)
    np.testing.assert_allclose(normal, expected_force[2], rtol=1e-9, atol=1e-8)


@given(states(), references(), arrays(np.float64, 3, elements=st.floats(-50, 50)), st.sampled_from(Law))
def test_lift_is_the_least_change(x, w, change, law):
    """It changes F as asked, and is orthogonal to every change of the reference that leaves F alone."""
    p = feedback_record(mass=MASS, g=G, gains=GAINS, law=law)[0]
    r_hat, before, after, moved = np.empty(3), np.empty(3), np.empty(3), w.copy()
    direction(x, r_hat)
    feedback(x, w, r_hat, p, before)
    lift(change, r_hat, p, moved)
    feedback(x, moved, r_hat, p, after)
    np.testing.assert_allclose(after - before, change, rtol=1e-8, atol=1e-7)
    columns = []
    for i in range(6):
        unit, out = w.copy(), np.empty(3)
        unit[i] += 1.0
        feedback(x, unit, r_hat, p, out)
        columns.append(out - before)
    null = np.linalg.svd(np.array(columns).T)[2][3:]
    np.testing.assert_allclose(null @ (moved - w), 0.0, atol=1e-7)


@given(states(), references(), st.sampled_from(Law))
def test_rows_are_the_barriers_of_the_model(x, w, law):
    """b̈ + (k₁ + k₂) ḃ + k₁ k₂ b of each face and of the leg, and the normal force, all from the model's equations."""
    k1, k2, leg, thrust_limit = 12.0, 20.0, (0.3, 0.7), 60.0
    p = cone_record(
        mass=MASS,
        mu=MU,
        gains=GAINS,
        law=law,
        g=G,
        rates=(k1, k2),
        min_normal_force=20.0,
        max_normal_force=80.0,
        leg=leg,
        thrust_limit=thrust_limit,
        tightening=0.0,
    )[0]
    rows, bounds, r_hat, f = np.empty((len(ROWS), 3)), np.empty(len(ROWS)), np.empty(3), np.empty(3)
    length = direction(x, r_hat)
    feedback(x, w, r_hat, p, f)
    cone_rows(x, r_hat, length, p, rows, bounds)
    h = rows @ f - bounds
    force, c_ddot, thrust = model(x, w, law)
    r, v = x[:3] - x[6:], x[3:6]
    expected = []
    for a in ([-1, 0, MU], [1, 0, MU], [0, -1, MU], [0, 1, MU]):
        a = np.array(a) / np.hypot(1.0, MU)
        expected.append(MASS * (a @ c_ddot + (k1 + k2) * a @ v + k1 * k2 * a @ r))
    expected += [force[2] - 20.0, 80.0 - force[2]]
    np.testing.assert_allclose(h[:6], expected, rtol=1e-8, atol=1e-6)
    if law is Law.PROJECTED:
        for k, limit in enumerate(leg):
            b, b1 = r @ r - limit**2, 2.0 * r @ v
            b2 = 2.0 * (v @ v + r @ c_ddot)
            sign = 1.0 if k == 0 else -1.0
            desired = sign * MASS * (b2 + (k1 + k2) * b1 + k1 * k2 * b) / (2.0 * np.linalg.norm(r))
            np.testing.assert_allclose(h[6 + k], desired, rtol=1e-8, atol=1e-6)
    if (h[8:] >= 0.0).all():
        assert np.linalg.norm(thrust) <= thrust_limit + 1e-9


@given(states(), references(), st.sampled_from(Law))
def test_cone_gives_the_closest_reference(x, w, law):
    """Rows hold at the applied reference, or the status says by how much they cannot; inside, it is the target."""
    governor = ConeGovernor(mass=MASS, mu=MU, gains=GAINS, law=law)
    governor.reset(w)
    applied = governor.update(x, w, 1e-3)
    status = governor.status
    assert np.isfinite(applied).all()
    scale = 1.0 + np.abs(status.h_r).max()
    assert status.h_w.min() > -status.least_violation - 1e-8 * scale
    assert status.infeasible == (status.least_violation > 0.0)
    if status.h_r.min() >= 0.0:
        np.testing.assert_allclose(applied, w, atol=1e-12)


def test_cone_holds_on_the_papers_reference_and_does_not_chatter():
    """Zero violations over 4 s from a start inside, at every step, with as many reversals at dt as at dt/4."""
    rates = []
    for divide in (1, 2, 4):
        p = vlip_setting("cone", VlipParameters(start="inside", dt=1e-3 / divide))
        summary = simulate_vlip(vlip_governor(p, name="cone"), p).summary()
        assert summary.violation_share == 0.0
        assert summary.infeasible_share == 0.0
        rates.append(summary.reversals_per_s)
    assert max(rates) <= 1.1 * min(rates)


def test_the_papers_governor_does_chatter():
    """The same measure sees the chattering of Algorithm 1: reversals double as the step halves."""
    rates = []
    for divide in (1, 2):
        p = VlipParameters(start="inside", coordinates="cartesian", dt=1e-3 / divide)
        rates.append(simulate_vlip(vlip_governor(p), p).summary().reversals_per_s)
    assert rates[1] > 1.7 * rates[0]


def reversals(evaluate_at, reference):
    """(3,) reversals of the normal force per second under Algorithm 1, at 1, 1/2 and 1/4 ms."""
    rates = []
    for divide in (1, 2, 4):
        p = VlipParameters(start="inside", coordinates="cartesian", dt=1e-3 / divide)
        summary = simulate_vlip(vlip_governor(p, evaluate_at=evaluate_at), p, reference=reference).summary()
        rates.append(summary.reversals_per_s)
    return rates


def test_chattering_of_the_papers_governor_depends_on_the_target():
    """Reversals are a + b/Δt (docs/governors.md). On a sine that would violate rows for most of the time b is
    zero in both readings; on a target that jumps a is not: they grow, but do not double."""

    def sine(t):
        return np.array([0.2 + 0.1 * np.sin(2 * np.pi * t), 0.3, 0.45 + 0.1 * np.cos(2 * np.pi * t), 0.0, 0.0, 0.0])

    rng = np.random.default_rng(3)
    places = [np.array([rng.uniform(0, 0.8), rng.uniform(-3, 3), rng.uniform(0.3, 0.6), 0, 0, 0]) for _ in range(8)]

    p = VlipParameters(start="inside", coordinates="cartesian")
    for evaluate_at in ("measured", "tracked"):
        acted = simulate_vlip(vlip_governor(p, evaluate_at=evaluate_at), p, reference=sine).summary()
        assert acted.target_violation_share > 0.5
        assert acted.deviation_rms_m > 0.01
        once, twice, fourfold = reversals(evaluate_at, sine)
        assert once > 0.0
        assert fourfold == pytest.approx(once, rel=0.01)
        assert twice == pytest.approx(once, rel=0.01)
    once, twice, fourfold = reversals("measured", lambda t: places[int(2.0 * t + 1e-9)])
    assert 1.4 < twice / once < 1.85
    assert fourfold - twice == pytest.approx(2.0 * (twice - once), rel=0.15)


def test_margin_keeps_its_invariant():
    """V ≤ Γ after every update, whatever the target does: the invariant of its proof."""
    p = vlip_setting("margin", VlipParameters(start="inside", duration=2.0))
    for seed in range(10):
        governor = vlip_governor(p, name="margin")
        run = simulate_vlip(governor, p, reference=_inside_start(seed))
        assert run.infeasible.max() == 0.0
        assert run.margins(run.force).min() >= 0.0
        assert np.abs(np.diff(run.x_w[:, :3], axis=0)).max() > 0.0


def random_reference(seed):
    """A smooth random target like the paper's: leg angle, heading and length are short Fourier sums.

    Args:
        seed: of the sum.

    Returns:
        t ↦ (6,) (θ, φ, l, θ̇, φ̇, l̇).
    """
    rng = np.random.default_rng(seed)
    rate = np.pi * np.array([0.5, 1.0, 1.5])
    size, phase = rng.normal(0.0, 1.0, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    size *= np.array([0.25, 0.8, 0.05])[:, None] / np.array([1.0, 2.0, 3.0])
    mean = np.array([0.3, rng.uniform(-np.pi, np.pi), 0.45])

    def reference(t):
        value = mean + np.sum(size * np.sin(rate * t + phase), axis=1)
        slope = np.sum(size * rate * np.cos(rate * t + phase), axis=1)
        return np.concatenate((value, slope))

    return reference


def _inside_start(seed):
    """A random target that begins where the run begins, inside the cone."""
    random = random_reference(seed)

    def reference(t):
        value = random(t)
        value[2] = min(max(value[2], 0.3), 0.6)
        return value

    return reference


def test_cone_holds_wherever_its_conditions_do(fuzz):
    """Random smooth targets: no violation where the start and every tick are feasible; elsewhere the status says so,
    and nothing is ever NaN. ``--fuzz 7`` looks at 1,050."""
    held = flagged = 0
    for seed in range(150 * fuzz):
        p = vlip_setting("cone", VlipParameters(start="inside", dt=2e-3, duration=1.0))
        run = simulate_vlip(vlip_governor(p, name="cone"), p, reference=random_reference(seed))
        assert np.isfinite(run.position).all()
        assert np.isfinite(run.x_w).all()
        if run.infeasible.any():
            flagged += 1
            continue
        held += 1
        assert run.margins(run.force).min() >= 0.0
    assert held > 75 * fuzz
    # Conditions that do not hold are told: a start outside the cone, on the ground's edge of it, and beyond.
    for angle in (0.6, 0.9, 1.3):
        governor = ConeGovernor(mass=MASS, mu=MU, gains=GAINS, law=Law.PROJECTED, leg=(0.1, 0.45), thrust_limit=1.0)
        x = np.concatenate((cartesian(angle, 0.3, 0.4), [2.0, 0.0, -3.0], np.zeros(3)))
        applied = governor.update(x, np.zeros(6), 1e-3)
        assert governor.status.infeasible
        assert governor.status.least_violation > 0.0
        assert np.isfinite(applied).all()


class Told:
    """A governor that keeps what its status said at every tick."""

    def __init__(self, governor):
        self.governor, self.applied, self.status = governor, governor.applied, governor.status
        self.outside = []

    def reset(self, x_r):
        self.governor.reset(x_r)

    def update(self, x, x_r, dt):
        applied = self.governor.update(x, x_r, dt)
        self.outside.append(self.status.outside)
        return applied


def jumping_reference(seed):
    """A target that jumps every quarter of a second."""
    rng = np.random.default_rng(seed)
    places = [np.array([rng.uniform(0, 0.8), rng.uniform(-3, 3), rng.uniform(0.3, 0.6), 0, 0, 0]) for _ in range(9)]
    return lambda t: places[int(t / 0.25 + 1e-9)]


def told_walk(seed, dt=1e-3):
    """Run on a jumping target, where the status was outside, and margins (n, 3) at each tick and at its end, N."""
    p = vlip_setting("cone", VlipParameters(start="inside", dt=dt, duration=2.0))
    governor = Told(vlip_governor(p, name="cone"))
    run = simulate_vlip(governor, p, reference=jumping_reference(seed))
    # The force that the reference of a tick makes at the state at its end.
    late = np.zeros((len(run.t) - 1, 3))
    for k in range(len(late)):
        r_hat = run.position[k + 1] / np.linalg.norm(run.position[k + 1])
        e, e_dot = run.x_w[k, :3] - run.position[k + 1], run.x_w[k, 3:] - run.velocity[k + 1]
        late[k] = MASS * (G * r_hat[2] + r_hat @ (660.0 * e + 60.0 * e_dot)) * r_hat
    return run, np.array(governor.outside), run.margins(run.force), run.margins(late)


def test_cone_says_when_friction_is_not_promised():
    """After ticks that were infeasible the rows may hold while the leg is still outside: friction is violated, and
    the status says so. Where it says neither, friction holds at the tick."""
    unsaid = told = 0.0
    for seed in range(60):
        run, outside, margins, _ = told_walk(seed)
        feasible = run.infeasible == 0.0
        friction = margins[:, :2].min(axis=1)
        told = max(told, -friction[feasible & outside].min(initial=0.0))
        unsaid = max(unsaid, -friction[feasible & ~outside].min(initial=0.0))
    assert told > 0.1
    assert unsaid < 1e-9


@given(states(), st.sampled_from(Law))
def test_outside_is_where_the_proof_does_not_begin(x, law):
    """b ≥ 0 and ḃ + k₁ b ≥ 0 of all faces, from their definition."""
    governor = ConeGovernor(mass=MASS, mu=MU, gains=GAINS, law=law, rates=(12.0, 20.0))
    governor.update(x, x[:6].copy(), 1e-3)
    faces = np.array([[-1.0, 0.0, MU], [1.0, 0.0, MU], [0.0, -1.0, MU], [0.0, 1.0, MU]])
    b, b_dot = faces @ (x[:3] - x[6:]), faces @ x[3:6]
    least = min(b.min(), (b_dot + 12.0 * b).min())
    if abs(least) > 1e-9:
        assert governor.status.outside == (least < 0.0)


def test_cone_holds_at_ticks_and_drifts_between_them():
    """A target that jumps: the normal force keeps its window at every feasible tick, and leaves it by newtons before
    the next, half as far at half the period. Friction is kept between ticks too."""
    worst = []
    for dt in (1e-3, 5e-4):
        drift = 0.0
        for seed in range(12):
            run, outside, margins, late = told_walk(seed, dt)
            good = (run.infeasible == 0.0) & ~outside
            assert margins[good].min() > -1e-9
            assert late[good[:-1], :2].min() > -0.05
            drift = max(drift, -late[good[:-1], 2].min())
        worst.append(drift)
    assert worst[0] > 1.0
    assert 0.4 < worst[1] / worst[0] < 0.6


def test_target_velocity_is_fed_forward():
    governor = ConeGovernor(mass=MASS, mu=5.0, gains=GAINS, law=Law.PROJECTED, min_normal_force=0.0, feed_forward=True)
    x = np.concatenate((cartesian(0.1, 0.0, 0.5), np.zeros(6)))
    target = np.concatenate((x[:3], np.zeros(3)))
    governor.reset(target)
    governor.update(x, target, 1e-3)
    target = target + np.array([2e-4, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(governor.update(x, target, 1e-3)[3:], [0.2, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    "bad",
    [
        lambda: ConeGovernor(mass=-1.0, mu=0.3),
        lambda: ConeGovernor(mass=4.0, mu=np.nan),
        lambda: ConeGovernor(mass=4.0, mu=0.3, gains=CentreGains(k_pt=(1.0, 2.0, 3.0))),
        lambda: ConeGovernor(mass=4.0, mu=0.3, gains=CentreGains(), law=Law.PROJECTED),
        lambda: ConeGovernor(mass=4.0, mu=0.3, leg=(0.5, 0.3)),
        lambda: MarginGovernor(mass=4.0, mu=0.3, k_p=100.0, k_d=0.0),
        lambda: MarginGovernor(mass=1.0, mu=0.9, k_p=100.0, k_d=10.0, min_normal_force=20.0),
        lambda: vlip_setting("mine"),
        lambda: vlip_governor(name="mine"),
        lambda: replace(VlipParameters(), mass=-1.0),
    ],
)
def test_bad_input(bad):
    with pytest.raises(InputError):
        bad()


def test_every_name_gives_a_governor():
    for name in VLIP_GOVERNORS:
        p = vlip_setting(name)
        assert (vlip_governor(p, name=name) is None) == (name == "none")
