"""The planar model, the packaged gait and the ground that it was found on."""

import pytest

import harpy_pin as hp
from reproduction.gait.planar_gait import load_gait
from reproduction.gait.planar_model import PlanarModel


@pytest.fixture(scope="module")
def model(robot):
    return PlanarModel.from_robot(robot)


@pytest.fixture(scope="module")
def packaged():
    return load_gait()


@pytest.fixture(scope="module")
def ground(packaged):
    """The ground that the packaged gait was found on."""
    return hp.Ground(mu_s=packaged.record["friction"][0])
