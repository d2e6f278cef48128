"""Soles on the compliant ground: the law at every corner at the end of a step, one solution, rest
and sliding.
"""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import put

from harpy_pin import Command, FlatFoot, Ground, Simulator, load_robot
from harpy_pin.ground.contact_frame import contact_frame
from harpy_pin.simulation.sole_contact import CREEP, ENGAGING, rigid_modes, sole_step, turn_modes
from harpy_pin.simulation.step import MAX_SWEEPS, step_record

CONES = ("circular", "per_axis")
seeds = st.integers(0, 2**32 - 1)


def fields_of(record):
    """The fields that tests write and read: views into the record."""
    names = ("mobility", "height", "friction", "force", "frame", "load")
    fields = {name: record[name][0] for name in names}
    return SimpleNamespace(**fields, dt=float(record["dt"][0]), mode=record["soles"]["mode"][0])


def draw(seed):
    """A step of one or two soles on random ground: its record, the ground, the velocities of the
    modes.
    """
    rng = np.random.default_rng(seed)
    soles = rng.integers(1, 3)
    dt = 10 ** rng.uniform(-4, -3)
    record = step_record({"nv": 6, "feet": 4 * soles, "soles": soles}, dt=dt)
    s = fields_of(record)
    size = 6 * soles
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    s.mobility[:] = basis * (dt * 10 ** rng.uniform(-2, 1, size)) @ basis.T
    for n in range(soles):
        corners = np.array([(x, y, 0.0) for x in (1, -1) for y in (1, -1)]) * rng.uniform(
            0.02, 0.15, 3
        )
        corners = corners @ pin.exp3(rng.normal(size=3) * 0.1).T
        rigid_modes(corners, s.mode[4 * n : 4 * n + 4])
        s.height[4 * n : 4 * n + 4] = (
            10 ** rng.uniform(-5, -2.5) * rng.normal() + 0.1 * corners[:, 2]
        )
    for frame in s.frame:
        slope = rng.normal(size=2) * 0.2
        contact_frame(*(np.array([*slope, 1.0]) / np.linalg.norm([*slope, 1.0])), frame)
    turn_modes(s.frame, s.mode)
    mu = rng.uniform(0.0, 1.2)
    ground = Ground(
        stiffness=10 ** rng.uniform(3, 5.5),
        mu_s=mu,
        mu_c=mu * rng.uniform(0.5, 1.0),
        mu_v=rng.uniform(0.0, 2.0),
        stribeck_velocity=10 ** rng.uniform(-2.5, -1),
        cone=CONES[rng.integers(2)],
    )
    s.friction[:] = ground.mu_s, ground.mu_c, 1.0
    return record, ground, rng.normal(size=size) * 10 ** rng.uniform(-4, 0)


def solve(record, ground, free):
    steps = sole_step(record[0], ground.record[0], free, 1e-10, MAX_SWEEPS)
    return record["force"][0].copy(), steps


def violation(s, ground, free):
    """By how much forces break the law at the corners, N, relative to 1 N + the largest force."""
    mode = s.mode
    soles = len(mode) // 4
    force = s.force.reshape(-1, 4, 3)
    load = np.concatenate(
        [np.einsum("kac,ka->c", mode[4 * n :][:4], force[n]) for n in range(soles)]
    )
    worst = np.abs(load - s.load).max()
    motion = (free + s.mobility @ s.load).reshape(soles, 6)
    velocity = np.concatenate([mode[4 * n :][:4] @ motion[n] for n in range(soles)])
    for (fx, fy, fz), (ux, uy, uz), h in zip(
        s.force.reshape(-1, 3), velocity, s.height, strict=True
    ):
        depth = -(h + s.dt * uz)
        spring = ground.stiffness * max(depth, 0.0)
        damper = ground.damping * max(-uz, 0.0)
        # over the first nanometres the damper sets in
        low = spring + (damper if depth > s.dt * ENGAGING * (1 + 1e-6) else 0.0)
        high = spring + (damper if depth > 0.0 else 0.0)
        worst = max(worst, low - fz, fz - high)
        pairs = (
            [((fx,), (ux,)), ((fy,), (uy,))]
            if ground.cone == "per_axis"
            else [((fx, fy), (ux, uy))]
        )
        for friction, slip in pairs:
            u = np.array(slip)
            ratio = np.exp(-((np.linalg.norm(u) / ground.stribeck_velocity) ** 2))
            most = (ground.mu_c + (ground.mu_s - ground.mu_c) * ratio) * fz
            lawful = -(most / np.hypot(np.linalg.norm(u), CREEP) + ground.mu_v * (fz > 0.0)) * u
            worst = max(worst, np.linalg.norm(np.array(friction) - lawful))
    return worst / (1.0 + np.abs(s.force).max())


@settings(max_examples=100)
@given(seed=seeds)
def test_step_obeys_the_law_at_its_end(seed):
    record, ground, free = draw(seed)
    _, steps = solve(record, ground, free)
    assert steps <= MAX_SWEEPS
    assert violation(fields_of(record), ground, free) <= 1e-7


@settings(max_examples=100)
@given(seed=seeds)
def test_the_guess_does_not_matter(seed):
    """But for falling friction, where two velocities may hold the same force, one solution is found
    from everywhere.
    """
    record, ground, free = draw(seed)
    ground = Ground(
        stiffness=ground.stiffness,
        mu_s=min(ground.mu_s, 0.5),
        mu_c=min(ground.mu_s, 0.5),
        cone=ground.cone,
    )
    record["friction"][0] = ground.mu_s, ground.mu_c, 1.0
    first, _ = solve(record, ground, free)
    record["force"][0] = (
        np.abs(np.random.default_rng(seed).normal(size=len(first))) * np.abs(first).max()
    )
    again, _ = solve(record, ground, free)
    np.testing.assert_allclose(again, first, rtol=0, atol=1e-6 * (1 + np.abs(first).max()))


def test_it_converges():
    """Nothing proves it where friction falls with velocity; steps that run out are rare, and nearly
    solved.
    """
    failed, contacts = 0, 0
    for seed in range(1000):
        force, steps = solve(*draw(seed))
        contacts += bool(force.any())
        failed += steps > MAX_SWEEPS
    assert contacts > 300
    assert failed <= 0.001 * contacts


@pytest.fixture(scope="module")
def flat_sled(sled):
    return load_robot(
        sled.urdf, feet=("skid",), flat_feet={"skid": FlatFoot(length=0.2, width=0.1)}
    )


def slide(robot, ground, slope, dt, duration):
    gravity = 9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    simulator = put(
        Simulator(robot, ground, dt=dt, gravity=gravity),
        z=2.0 * gravity[2] / (4 * ground.stiffness),
    )
    simulator.advance(Command(np.zeros(0), np.zeros((0, 3))), steps=round(duration / dt))
    assert simulator.counts[1] == 0
    return simulator


def test_rest_on_a_slope(flat_sled):
    """It creeps by less than a micrometre per second."""
    simulator = slide(flat_sled, Ground(), np.radians(10), 1e-3, 2.0)
    assert np.linalg.norm(simulator.v) < CREEP
    assert simulator.state.foot_force[:, 2].sum() == pytest.approx(
        2 * 9.81 * np.cos(np.radians(10)), rel=1e-9
    )


def test_corners_share_friction_as_they_share_the_load(flat_sled):
    force = slide(flat_sled, Ground(), np.radians(8), 1e-3, 1.0).state.foot_force
    np.testing.assert_allclose(force[:, 0] / force[:, 2], -np.tan(np.radians(8)), rtol=1e-6)
    np.testing.assert_allclose(force[:, 1], 0.0, atol=1e-9)


def test_sliding_down_a_slope(flat_sled):
    """Without viscous friction and Stribeck's fall: acceleration g (sin − μ cos)."""
    ground = Ground(mu_s=0.2, mu_c=0.2, mu_v=0.0)
    slope = np.radians(20)
    simulator = slide(flat_sled, ground, slope, 5e-4, 1.0)
    assert simulator.v[0] == pytest.approx(9.81 * (np.sin(slope) - 0.2 * np.cos(slope)), rel=1e-3)
