"""Ground: the law of equations.md E1 and E2 as properties, its implicit step against the law, and a
sled on a slope.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from walks import put

from harpy_pin import Command, Ground, InputError, Simulator
from harpy_pin.simulation.implicit_contact import contact_step

CONES = ("circular", "per_axis")
seeds = st.integers(0, 2**32 - 1)
cones = st.sampled_from(CONES)


def draw_contact(seed, feet):
    """Feet above and in the ground, with a random symmetric positive definite mobility."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3 * feet, 3 * feet))
    mobility = root @ root.T + 0.1 * np.eye(3 * feet)
    dt = 10 ** rng.uniform(-4, -3)
    mobility *= dt * 10 ** rng.uniform(-0.5, 1.5) / np.trace(mobility)  # of the order dt / mass
    free = rng.normal(size=3 * feet) * 10 ** rng.uniform(-4, 0.5)
    height = rng.normal(size=feet) * 10 ** rng.uniform(-5, -2)
    return mobility, free, height, dt


@st.composite
def grounds(draw, cone=cones):
    mu_s = draw(st.floats(0.0, 1.5))
    return Ground(
        stiffness=draw(st.floats(100.0, 1e5)),
        damping=draw(st.floats(0.0, 1e3)),
        mu_s=mu_s,
        mu_c=mu_s * draw(st.floats(0.3, 1.0)),
        mu_v=draw(st.floats(0.0, 2.0)),
        stribeck_velocity=draw(st.floats(1e-3, 0.1)),
        cone=draw(cone),
    )


def stribeck(ground, speed, normal, static=1.0):
    """Magnitude of E2 at a speed, regularisation aside, written from the page; on a place of
    another friction.
    """
    mu = ground.mu_c + (ground.mu_s - ground.mu_c) * np.exp(
        -((speed / ground.stribeck_velocity) ** 2)
    )
    return static * mu * normal + ground.mu_v * speed


def solve(ground, mobility, free, height, dt, guess=None, static=1.0):
    """Forces and sweeps; the friction of each foot is so many times the ground's."""
    force = np.zeros(len(free)) if guess is None else guess.copy()
    friction = np.tile((ground.mu_s, ground.mu_c, 1.0), (len(height), 1))
    friction[:, :2] *= np.reshape(static, (-1, 1))
    sweeps = contact_step(mobility, free, height, friction, dt, ground.record[0], force)
    return force, sweeps


def violation(ground, mobility, free, height, dt, force, static=1.0):
    """By how much forces break E1 and E2 at the end of the step, N, relative to 1 N + the largest
    force.
    """
    velocity = (free + mobility @ force).reshape(-1, 3)
    worst = 0.0
    statics = np.broadcast_to(static, len(height))
    for (fx, fy, fz), u, h, mu in zip(force.reshape(-1, 3), velocity, height, statics, strict=True):
        end = h + dt * u[2]
        damped = ground.damping * max(-u[2], 0.0)
        # At the surface the damper sets in with a jump: any force up to the damper's is lawful
        # there.
        spring = ground.stiffness * max(-end, 0.0)
        low = spring + (damped if end < -1e-13 else 0.0)
        high = spring + (damped if end < 1e-13 else 0.0)
        worst = max(worst, low - fz, fz - high, -fz)
        pairs = (
            [((fx,), u[:1]), ((fy,), u[1:2])] if ground.cone == "per_axis" else [((fx, fy), u[:2])]
        )
        for friction, slip in pairs:
            size, speed = (
                np.hypot(*friction, 0.0) if len(friction) == 1 else np.hypot(*friction),
                np.linalg.norm(slip),
            )
            if speed <= 1e-9:
                worst = max(worst, size - mu * ground.mu_s * fz)
            elif fz > 0.0:
                lawful = -stribeck(ground, speed, fz, mu) * slip / speed
                worst = max(worst, np.linalg.norm(np.array(friction) - lawful))
            else:
                worst = max(worst, size)
    return worst / (1.0 + np.abs(force).max())


@settings(max_examples=300)
@given(ground=grounds(), seed=seeds, feet=st.sampled_from([1, 2]), alike=st.booleans())
def test_step_obeys_the_law_at_its_end(ground, seed, feet, alike):
    """Also where each foot has a friction of its own."""
    problem = draw_contact(seed, feet)
    static = 1.0 if alike else np.random.default_rng(seed).uniform(0.1, 1.5, feet)
    force, sweeps = solve(ground, *problem, static=static)
    assume(sweeps <= 500)  # how often that fails is tested below
    assert violation(ground, *problem, force, static) <= 1e-7


@given(ground=grounds(), seed=seeds, share=st.floats(0.0, 0.3))
def test_step_obeys_the_law_where_the_damper_sets_in(ground, seed, share):
    """A foot that would pass the surface by little: the damper's jump holds it at the surface, it
    does not throw it.
    """
    mobility, free, _, dt = draw_contact(seed, 1)
    free[2] = -abs(free[2])
    height = np.array([-(1.0 - share) * dt * free[2]])
    force, sweeps = solve(ground, mobility, free, height, dt)
    assume(sweeps <= 500)
    assert violation(ground, mobility, free, height, dt, force) <= 1e-7


def test_step_nearly_always_converges():
    """Gauss–Seidel has no guarantee for strongly coupled, unlike feet: it says so, and it is
    rare.
    """
    failed, contacts = 0, 0
    for seed in range(2000):
        ground = Ground(mu_s=[0.25, 0.8][seed % 2], cone=CONES[seed // 2 % 2])
        force, sweeps = solve(ground, *draw_contact(seed, 1 + seed // 4 % 2))
        contacts += bool(force.any())
        failed += sweeps > 500
    assert contacts > 750
    assert failed <= 0.001 * contacts


@settings(max_examples=200)
@given(ground=grounds(), seed=seeds, feet=st.sampled_from([1, 2]))
def test_solution_is_a_fixed_point(ground, seed, feet):
    problem = draw_contact(seed, feet)
    force, sweeps = solve(ground, *problem)
    assume(0 < sweeps <= 500)
    again, more = solve(ground, *problem, guess=force)
    assert more <= 500
    np.testing.assert_allclose(again, force, rtol=0, atol=1e-8 * (1 + np.abs(force).max()))


@given(ground=grounds(), seed=seeds)
def test_feet_in_the_air_feel_nothing(ground, seed):
    mobility, free, height, dt = draw_contact(seed, 2)
    height = np.abs(height) + dt * np.abs(free[2::3])
    force, _ = solve(ground, mobility, free, height, dt, guess=np.full(6, 7.0))
    np.testing.assert_array_equal(force, 0.0)


def test_defaults_and_ratio():
    assert Ground().mu_c == pytest.approx(0.225)
    assert Ground(mu_s=0.8).mu_c == pytest.approx(0.72)
    assert Ground(mu_s=0.8, mu_c=0.0).mu_c == 0.0
    with pytest.raises(InputError, match=r"circular.*per_axis"):
        Ground(cone="box")


NO_COMMAND = Command(np.zeros(0), np.zeros((0, 3)))
MASS = 2.0


def slide(sled, ground, slope, heading, dt, duration):
    """Sled at rest on a slope that falls along ``heading``; returns path and velocity along the
    ground.
    """
    down = 9.81 * np.sin(slope)
    gravity = np.array([down * np.cos(heading), down * np.sin(heading), -9.81 * np.cos(slope)])
    simulator = put(
        Simulator(sled, ground, dt=dt, gravity=gravity), z=MASS * gravity[2] / ground.stiffness
    )
    for _ in range(round(duration / dt)):
        simulator.advance(NO_COMMAND)
        assert simulator.sweeps <= 500
    assert simulator.state.foot_force[0, 2] == pytest.approx(-MASS * gravity[2], rel=1e-9)
    return simulator.q[:2].copy(), simulator.v[:2].copy()


def slide_exactly(ground, slope, heading, duration):
    """The same from the law, as an ordinary differential equation of a body that already moves."""
    down, normal = 9.81 * np.sin(slope), MASS * 9.81 * np.cos(slope)
    pull = MASS * down * np.array([np.cos(heading), np.sin(heading)])

    def slope_of(_, y):
        v = y[2:]
        if ground.cone == "per_axis":
            # An axis whose pull the box can hold does not start.
            moving = np.abs(pull) > ground.mu_s * normal
            friction = np.array(
                [
                    -stribeck(ground, abs(u), normal) * np.sign(p)
                    for u, p in zip(v, pull, strict=True)
                ]
            )
            acceleration = np.where(moving, (pull + friction) / MASS, 0.0)
        else:
            acceleration = (
                pull - stribeck(ground, np.linalg.norm(v), normal) * pull / np.linalg.norm(pull)
            ) / MASS
        return np.concatenate((v, acceleration))

    found = solve_ivp(
        slope_of, (0, duration), np.zeros(4), rtol=1e-10, atol=1e-12, max_step=duration / 200
    )
    return found.y[:2, -1], found.y[2:, -1]


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_at_rest_on_ten_degrees(sled, cone, heading):
    """tan 10° = 0.176 < 0.25: ten seconds without creep. A regularised law would creep."""
    path, velocity = slide(sled, Ground(cone=cone), np.radians(10), heading, 1e-3, 10.0)
    assert np.linalg.norm(path) < 1e-9
    assert np.linalg.norm(velocity) < 1e-12


@pytest.mark.parametrize("cone", CONES)
def test_threshold_of_sliding(sled, cone):
    """It holds just under atan μ_s and goes just over it."""
    ground = Ground(cone=cone)
    limit = np.arctan(0.25)
    assert np.linalg.norm(slide(sled, ground, limit - 1e-4, 0.0, 1e-3, 1.0)[0]) < 1e-9
    assert np.linalg.norm(slide(sled, ground, limit + 1e-4, 0.0, 1e-3, 1.0)[0]) > 1e-5


@pytest.mark.parametrize(
    ("cone", "slope", "heading"),
    [
        ("circular", 20, 0.0),
        ("circular", 20, 0.7),
        ("per_axis", 20, 0.0),
        ("per_axis", 30, 0.7),
        ("per_axis", 20, 0.6),
    ],
)
def test_sliding_down_a_slope(sled, cone, slope, heading):
    """Against the law's own differential equation: the error is of order one in the step, and
    small.
    """
    ground = Ground(cone=cone)
    true_path, true_velocity = slide_exactly(ground, np.radians(slope), heading, 1.0)
    assert np.linalg.norm(true_path) > 0.05
    errors = []
    for dt in (2e-3, 1e-3, 5e-4):
        path, velocity = slide(sled, ground, np.radians(slope), heading, dt, 1.0)
        errors.append([np.linalg.norm(path - true_path), np.linalg.norm(velocity - true_velocity)])
    errors = np.array(errors)
    assert errors[-1, 0] < 2e-3 * np.linalg.norm(true_path)
    assert errors[-1, 1] < 1e-3 * np.linalg.norm(true_velocity)
    np.testing.assert_allclose(errors[0] / errors[1], 2.0, atol=0.4)
    np.testing.assert_allclose(errors[1] / errors[2], 2.0, atol=0.4)
