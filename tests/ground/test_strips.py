"""Ground whose friction and stiffness change along the way."""

import numpy as np
import pytest
from walks import put, walked

import harpy_pin as hp
from harpy_pin import Command, Condensed, Ground, Scenario, Simulator
from harpy_pin.simulation.mujoco import MujocoPlant
from harpy_pin.view.scene.frames import Contacts, ground_of

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))
G = 9.81


def slide_to_rest(plant, speed):
    """Where a sled of one point comes to rest that slides from x = 0."""
    put(plant, v=(speed, 0.0, 0.0, 0.0, 0.0, 0.0))
    while plant.v[0] > 1e-6:
        plant.advance(NOTHING)
    return float(plant.q[0])


def test_a_sled_crosses_ice_as_coulomb_has_it_and_better_at_half_the_step(sled):
    """A foot is at most one step late at each edge: less than the way of two steps, at either
    step.
    """
    ice = (0.1, 0.3, 0.05)
    ground = Ground(mu_s=0.3, mu_c=0.3, mu_v=0.0, friction_strips=(ice,))
    begin, end, slippery = ice  # every metre takes 2 μ g off the square of the speed
    exact = end + (1.0 - 2.0 * G * (0.3 * begin + slippery * (end - begin))) / (2.0 * G * 0.3)
    without = slide_to_rest(Simulator(sled, Ground(mu_s=0.3, mu_c=0.3, mu_v=0.0)), 1.0)
    assert without == pytest.approx(1.0 / (2.0 * G * 0.3), abs=1e-3)
    assert without < 0.2 < exact
    for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        assert abs(slide_to_rest(Simulator(sled, ground, dt=dt), 1.0) - exact) <= 2.0 * dt * 1.0


def test_mujoco_slides_with_the_friction_of_the_place(sled):
    """At every step in which the sled slides, ratio of forces by where it was when the step
    began.
    """
    ground = Ground(mu_s=0.3, friction_strips=((0.1, 0.3, 0.05),))
    plant = MujocoPlant(sled, ground)
    put(plant, v=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    seen = {0.3: 0, 0.05: 0}
    while plant.v[0] > 0.01:
        mu = float(ground.friction(plant.q[0]))
        plant.advance(NOTHING)
        along, _, up = plant.state.foot_force[0]
        if up > 1e-3 and plant.v[0] > 0.01:
            assert -along / up == pytest.approx(mu, rel=1e-6)
            seen[mu] += 1
    assert min(seen.values()) > 50


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_every_foot_of_a_walk_is_inside_its_own_cone_and_ice_is_felt(plant):
    ice = (0.25, 0.6, 0.1)
    ground = Ground(mu_s=0.8, mu_v=0.0, friction_strips=(ice,))
    trusting = Condensed(parameters={"estimate_friction": False})
    run = walked(controller=trusting, plant=plant, ground=ground, duration=2.5)
    x, force = run["foot_position"][..., 0], run["foot_force"]
    # not where it crosses an edge within a step
    clear = np.min([abs(x - edge) for edge in ice[:2]], axis=0) > 2e-3
    used = np.hypot(force[..., 0], force[..., 1]) - ground.friction(x) * force[..., 2]
    assert used[clear].max() <= 1e-6 if plant == "compliant" else used[clear].max() <= 1e-3
    on_ice = (ice[0] < x) & (x < ice[1]) & (force[..., 2] > 5.0)
    assert on_ice.sum() > 100
    slip = 1e3 * run["slip_path"][-1].sum()
    plain = walked(controller=trusting, plant=plant, mu_s=0.8, mu_v=0.0, duration=2.5)
    assert slip > 50.0 + 1e3 * plain["slip_path"][-1].sum()


def test_friction_of_places():
    ground = Ground(mu_s=0.8, friction_strips=((0.6, 1.2, 0.15), (1.2, 2.0, 0.5)))
    np.testing.assert_array_equal(
        ground.friction([0.0, 0.599, 0.6, 1.1999, 1.2, 2.0, np.nan]),
        [0.8, 0.8, 0.15, 0.15, 0.5, 0.8, 0.8],
    )


def test_a_strip_keeps_the_ratio_of_the_grounds_coefficients():
    strip = Ground(mu_s=0.8, mu_c=0.4, friction_strips=((0.0, 1.0, 0.2),)).record["strip"][0, 0]
    np.testing.assert_allclose(strip, (0.0, 1.0, 0.2, 0.1), rtol=1e-15)
    np.testing.assert_allclose(
        Ground(mu_s=0.0, friction_strips=((0.0, 1.0, 0.2),)).record["strip"][0, 0, 3],
        0.18,
        rtol=1e-15,
    )


def test_grounds_with_and_without_strips_share_their_kernels():
    assert Ground().record.dtype is Ground(friction_strips=((0.0, 1.0, 0.2),)).record.dtype


def test_friction_under_the_feet_of_a_log():
    ground = Ground(mu_s=0.8, friction_strips=((0.05, 0.4, 0.1),))
    run = hp.walk(Scenario(ground=ground, duration=0.8))
    place = run["foot_position"]
    mu = Contacts.of(run, ground_of(run)).mu
    np.testing.assert_array_equal(mu, ground.friction(place[..., 0]))
    assert len(np.unique(mu)) == 2


SOFT = Ground(mu_s=0.5, stiffness_strips=((0.5, 1.0, 2000.0), (1.0, 2.0, 32000.0)))


@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
@pytest.mark.parametrize(
    ("x", "stiffness"), [(0.0, 8000.0), (0.7, 2000.0), (1.0, 32000.0), (2.0, 8000.0)]
)
def test_it_rests_as_deep_as_the_place_is_soft(sled, kind, x, stiffness):
    assert float(SOFT.stiffness_at(x)) == stiffness
    plant = put(kind(sled, SOFT), x=x, z=0.0)
    plant.advance(NOTHING, steps=2000)
    assert -plant.q[2] == pytest.approx(sled.mass * G / stiffness, rel=1e-3)


@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
def test_a_strip_is_a_ground_of_its_stiffness(sled, kind):
    """A mass that drops onto it moves as on a ground with that stiffness, whose damping has the
    usual ratio.
    """
    paths = []
    for ground in (SOFT, Ground(mu_s=0.5, stiffness=2000.0)):
        plant = put(kind(sled, ground), x=0.7, z=0.02)
        path = []
        for _ in range(400):
            plant.advance(NOTHING)
            path.append(plant.q[2])
        paths.append(path)
    np.testing.assert_allclose(*paths, atol=1e-9)
    assert min(paths[0]) < -sled.mass * G / 2000.0


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_harpy_walks_over_a_strip_of_half_the_stiffness(plant):
    run = walked(mu_s=0.8, stiffness_strips=((0.1, 0.35, 4000.0),), plant=plant, duration=2.5)
    assert run.ending == "completed"
    x, depth, force = (
        run["foot_position"][..., 0],
        -run["foot_position"][..., 2],
        run["foot_force"][..., 2],
    )
    still = (np.abs(run["foot_velocity"][..., 2]) < 5e-3) & (force > 10.0)
    for on, stiffness in (((x > 0.1) & (x < 0.35), 4000.0), (x > 0.35, 8000.0)):
        assert (still & on).sum() > 50
        assert np.median(force[still & on] / depth[still & on]) == pytest.approx(stiffness, rel=0.1)
