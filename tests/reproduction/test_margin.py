"""The governors of the VLIP: the margin's invariant, and the chattering of the paper's."""

import numpy as np
import pytest

from reproduction.vlip_simulation import (
    VLIP_GOVERNORS,
    VlipParameters,
    paper_reference,
    simulate_vlip,
    vlip_governor,
    vlip_setting,
)


def reversals(evaluate_at, reference):
    """(3,) reversals of the normal force per second under Algorithm 1, at 1, 1/2 and 1/4 ms."""
    rates = []
    for divide in (1, 2, 4):
        p = VlipParameters(start="inside", coordinates="cartesian", dt=1e-3 / divide)
        summary = simulate_vlip(
            vlip_governor(p, evaluate_at=evaluate_at), p, reference=reference
        ).summary()
        rates.append(summary.reversals_per_s)
    return rates


def test_the_papers_governor_does_chatter():
    """Reversals under Algorithm 1 double as the step halves."""
    once, twice, _ = reversals("measured", paper_reference)
    assert twice > 1.7 * once


def test_chattering_of_the_papers_governor_depends_on_the_target():
    """Reversals are a + b/Δt (docs/governors.md). On a sine that would violate rows for most of the
    time b is zero in both readings; on a target that jumps a is not: they grow, but do not double.
    """

    def sine(t):
        return np.array(
            [
                0.2 + 0.1 * np.sin(2 * np.pi * t),
                0.3,
                0.45 + 0.1 * np.cos(2 * np.pi * t),
                0.0,
                0.0,
                0.0,
            ]
        )

    rng = np.random.default_rng(3)
    places = [
        np.array([rng.uniform(0, 0.8), rng.uniform(-3, 3), rng.uniform(0.3, 0.6), 0, 0, 0])
        for _ in range(8)
    ]

    p = VlipParameters(start="inside", coordinates="cartesian")
    for evaluate_at in ("measured", "tracked"):
        acted = simulate_vlip(
            vlip_governor(p, evaluate_at=evaluate_at), p, reference=sine
        ).summary()
        assert acted.target_violation_share > 0.5
        assert acted.deviation_rms_m > 0.01
        once, twice, fourfold = reversals(evaluate_at, sine)
        assert once > 0.0
        assert fourfold == pytest.approx(once, rel=0.01)
        assert twice == pytest.approx(once, rel=0.01)
    once, twice, fourfold = reversals("measured", lambda t: places[int(2.0 * t + 1e-9)])
    assert 1.4 < twice / once < 1.85
    assert fourfold - twice == pytest.approx(2.0 * (twice - once), rel=0.15)


def random_reference(seed):
    """A smooth random target like the paper's: leg angle, heading and length are short Fourier
    sums; the length keeps where the run begins, inside the cone.
    """
    rng = np.random.default_rng(seed)
    rate = np.pi * np.array([0.5, 1.0, 1.5])
    size, phase = rng.normal(0.0, 1.0, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    size *= np.array([0.25, 0.8, 0.05])[:, None] / np.array([1.0, 2.0, 3.0])
    mean = np.array([0.3, rng.uniform(-np.pi, np.pi), 0.45])

    def reference(t):
        value = mean + np.sum(size * np.sin(rate * t + phase), axis=1)
        value[2] = min(max(value[2], 0.3), 0.6)
        return np.concatenate((value, np.sum(size * rate * np.cos(rate * t + phase), axis=1)))

    return reference


def test_margin_keeps_its_invariant():
    """V ≤ Γ after every update, whatever the target does: the invariant of its proof."""
    p = vlip_setting("margin", VlipParameters(start="inside", duration=2.0))
    for seed in range(10):
        governor = vlip_governor(p, name="margin")
        run = simulate_vlip(governor, p, reference=random_reference(seed))
        assert run.infeasible.max() == 0.0
        assert run.margins(run.force).min() >= 0.0
        assert np.abs(np.diff(run.x_w[:, :3], axis=0)).max() > 0.0


def test_every_name_gives_a_governor():
    for name in VLIP_GOVERNORS:
        p = vlip_setting(name)
        assert (vlip_governor(p, name=name) is None) == (name == "none")
