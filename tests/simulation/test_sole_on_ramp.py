"""A sole on a slope, in both engines, against the statics of a rigid block."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from harpy_pin.model.state import Command
from harpy_pin.simulation.mujoco import MujocoPlant
from harpy_pin.simulation.simulator import Simulator
from harpy_pin.simulation.terrain import Plane

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))
WEIGHT = 2.0 * 9.81
HALF, HEIGHT = 0.1, 0.05
"""Half the length of the sole, and height of the centre of mass above it, m."""


@pytest.fixture(scope="module")
def block(sled):
    sole = hp.FlatFoot(length=2.0 * HALF, width=0.1, centre=(0.0, 0.0, -HEIGHT))
    return hp.load_robot(sled.urdf, feet=("skid",), flat_feet={"skid": sole})


def on_slope(kind, block, slope, heading, *, steps, stiffness=2e5, friction=1.0, height=0.0):
    """The block after some time on a plane, its length along the slope."""
    terrain = Plane(slope=slope, heading=heading)
    plant = kind(block, hp.Ground(mu_s=friction, stiffness=stiffness, terrain=terrain))
    normal = terrain.normal(0.0, 0.0)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    q = pin.neutral(block.model)
    q[:3] = (HEIGHT + height) * normal
    q[3:7] = pin.Quaternion(turn @ pin.exp3(np.array([0.0, 0.0, heading]))).coeffs()
    plant.reset(q, np.zeros(6))
    plant.advance(NOTHING, steps=steps)
    return plant, normal


@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi, 2.0])
@pytest.mark.parametrize("degrees", [6.0, 20.0])
@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
def test_its_corners_carry_what_the_balance_of_moments_says(kind, degrees, heading, block):
    """The lower edge carries W cos θ / 2 (1 + h tan θ / a), and friction holds W sin θ."""
    if kind is MujocoPlant:
        pytest.importorskip("mujoco")
    slope = np.radians(degrees)
    plant, normal = on_slope(kind, block, slope, heading, steps=4000)
    force = plant.state.foot_force
    load = force @ normal
    share = HEIGHT / HALF * np.tan(slope)
    upper, lower = load[:2].sum(), load[2:].sum()
    within = 5e-3 if kind is Simulator else 3e-2  # MuJoCo's ground is softer
    assert lower == pytest.approx(0.5 * WEIGHT * np.cos(slope) * (1.0 + share), rel=within)
    assert upper == pytest.approx(0.5 * WEIGHT * np.cos(slope) * (1.0 - share), rel=within)
    np.testing.assert_allclose(force.sum(axis=0), (0.0, 0.0, WEIGHT), atol=1e-2 * WEIGHT)


@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
def test_it_tips_over_its_lower_edge_where_the_weight_is_beyond_it(kind, block):
    """That is from tan θ = a / h on; friction would hold it."""
    if kind is MujocoPlant:
        pytest.importorskip("mujoco")
    limit = np.arctan(HALF / HEIGHT)
    for slope, tips in ((limit - 0.06, False), (limit + 0.06, True)):
        plant, normal = on_slope(kind, block, slope, 0.0, steps=1000, friction=4.0)
        up = pin.Quaternion(plant.q[3:7]).matrix()[:, 2]
        tilt = np.arccos(np.clip(up @ normal, -1.0, 1.0))
        assert (tilt > 0.2) == tips
