"""The step of a planar gait as a map: its fixed point, and how fast disturbances decay."""

import numpy as np
import pytest

from harpy_pin.errors import InputError
from reproduction.gait.periodicity import SCALE, StepMap, analyse_periodicity
from reproduction.gait.planar_gait import PlanarGait
from reproduction.gait.planar_walk import PlanarJoints


@pytest.fixture(scope="module")
def periodic(model, packaged, ground):
    return analyse_periodicity(model, packaged.gait, ground=ground, memory=False, settle=20)


@pytest.fixture
def step_map(model, packaged, ground):
    """A step of the packaged gait, with joints whose integrals are off."""
    return StepMap(model, packaged.gait, ground=ground, joints=PlanarJoints(k_i=(0.0, 0.0)))


def test_step_map_is_the_walk(step_map):
    """Two maps in a row are two steps of the walk, legs exchanged twice."""
    start, later = step_map.settle(4), step_map.settle(6)
    np.testing.assert_allclose(step_map(step_map(start)), later, atol=1e-6)


def test_fixed_point(step_map, periodic):
    assert periodic.residual < 1e-8
    np.testing.assert_allclose(step_map(periodic.section), periodic.section, atol=1e-6)
    assert not periodic.memory
    assert len(periodic.eigenvalues) == 13


def test_packaged_gait_is_stable(step_map, periodic):
    """Spectral radius below one, and a disturbed walk really comes back at that rate."""
    assert periodic.stable
    assert periodic.spread[0] <= periodic.spectral_radius <= periodic.spread[1] < 0.95
    rng = np.random.default_rng(0)
    section = periodic.section + 1e-5 * SCALE[:13] * rng.standard_normal(13)
    distance = [np.abs((section - periodic.section) / SCALE[:13]).max()]
    for _ in range(12):
        section = step_map(section)
        distance.append(np.abs((section - periodic.section) / SCALE[:13]).max())
    assert distance[-1] < 0.1 * distance[0]


def test_packaged_gait_is_stable_with_its_integrals(model, packaged, ground):
    """The integrals creep for hundreds of steps; once settled, their slow decay is the largest
    eigenvalue.
    """
    found = analyse_periodicity(model, packaged.gait, ground=ground, newton=0)
    assert found.memory
    assert found.residual < 1e-5
    assert 0.95 < found.spread[0] <= found.spread[1] < 1.0


def test_jacobian_predicts_a_disturbance(step_map, periodic):
    matrix = step_map.jacobian(periodic.section)
    shift = 1e-5 * np.random.default_rng(1).standard_normal(13)
    found = (step_map(periodic.section + shift * SCALE[:13]) - step_map(periodic.section)) / SCALE[
        :13
    ]
    np.testing.assert_allclose(found, matrix @ shift, atol=0.05 * np.abs(matrix @ shift).max())


def test_periodicity_refuses(model):
    with pytest.raises(InputError, match="falls after"):
        analyse_periodicity(model, PlanarGait(), settle=10)
    with pytest.raises(InputError, match="whole number of ticks"):
        StepMap(model, PlanarGait(step_duration=0.7503))
